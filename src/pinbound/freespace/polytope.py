"""certified_polytope(): a polytope around a configuration, in all coordinates, in which every q is proven free."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from pinbound.boundaries.boundary import Boundary, one_configuration
from pinbound.certificates.boxes import certify_box
from pinbound.certificates.records import Budget, Reason, Verdict
from pinbound.certificates.scope import covered, scope, settled
from pinbound.certificates.search import Meter
from pinbound.checks import whole_number
from pinbound.exceptions import UnsupportedError
from pinbound.freespace.draft import Draft
from pinbound.freespace.faces import Face, OneAngleGaps, guarded_choices, limit_faces, outer_box
from pinbound.freespace.growing import Grower
from pinbound.freespace.pairs import Pairs
from pinbound.freespace.proving import Prover
from pinbound.freespace.records import FreePolytope
from pinbound.freespace.vertices import linear_program
from pinbound.robot.robot import Robot, check_robot
from pinbound.tolerances import UNIT_ROUNDOFF
from pinbound.typing import Array

__all__ = ["certified_polytope"]


_BUDGET = Budget(boxes=1_000_000_000, seconds=60.0)
_AT_Q = Budget(boxes=2_000_000, seconds=10.0)
"""Boxes for the proof of q alone, which do not count in the budget."""
_STAGES = ((1.0 / 16.0, 0.1 / 16.0), (0.25, 0.025), (1.0, 0.4), (1.0, 0.2), (1.0, 0.1))
"""Of the way from q to all limits, the box within which a polytope is proven, and how far faces keep away from contact
there, where there is room [rad or m]. Twice the distance takes a fifth of the boxes, and little of the volume."""
_JUDGED = 20_000
"""Number of samples of the box of limits, which choose the largest of the proven polytopes."""
_SAMPLES = 6000
_SIDE = -1
"""Marks a face that is a side of the box within which the polytope is proven; it belongs to no pair."""
_GROWING = 0.2
"""Share of the remaining seconds for proposing faces."""


def certified_polytope(
    robot: Robot,
    q: ArrayLike,
    boundaries: Sequence[str] | None = None,
    budget: Budget | None = None,
    window: Mapping[str, tuple[float, float]] | None = None,
    *,
    limits_only: bool = False,
    seed: int = 0,
) -> FreePolytope:
    """Return a polytope `{A q <= b}` around q in which every configuration is proven free and within all limits.

    Boundaries of several effective angles need a search: samples propose tangents of contact as faces. Then every pair
    is proven free over the polytope, in its own coordinates, by halving boxes. If a box with contact, or a box that
    cannot be decided, is inside, a face is added. The polytope is not the largest possible one.

    If every boundary has one effective angle (as for parallelogram arms), the polytope is exact: its faces are limits,
    rules and contact angles in closed form, minus a slack of about 1e-11 rad for rounding. A rule with conditions gives
    several half-spaces; the one in which q is furthest inside is used, and a note says which.

    Args:
        robot: The robot.
        q: (n,) the configuration inside.
        boundaries: Names of the boundaries; None: all.
        budget: The work allowed; None: 60 seconds. If it ends the search, the largest proven polytope is returned, with
            a note; if there is none, the verdict is UNDECIDED.
        window: Ends [rad or m] by coordinate; needed for coordinates without limits.
        limits_only: Whether to use limits and rules only, without boundaries. Without it, no boundary at all is
            NOTHING_TO_CHECK.
        seed: Seed of the random samples that propose faces; the proofs do not depend on them.

    Returns:
        The polytope. If q itself is not free, it is empty and has the verdict VIOLATED.

    Raises:
        DimensionError: If q is not one finite configuration, a coordinate has no limits, or the seed is negative.
        UnknownNameError: If a boundary, or a coordinate of `window`, does not exist.
        UnsupportedError: If the robot has no moving joint.

    References:
        `docs/free-space.md`.

    Example:
        >>> import pinbound as pb
        >>> robot = pb.load("minervabot_v3")
        >>> polytope = pb.certified_polytope(robot, robot.home)
        >>> polytope.verdict.value, polytope.is_exact, len(polytope.vertices), len(polytope.edges)
        ('certified', True, 12, 18)
        >>> sorted(polytope.names)
        ['beta_10', 'beta_3', 'beta_4', 'beta_7', 'beta_8', 'beta_9', 'q1 lower', 'q1 upper']
    """
    check_robot(robot)
    start = one_configuration(q, robot.coordinates).copy()
    chosen = scope(robot, boundaries, True, limits_only)
    whole_number(seed, "seed")
    meter = Meter(budget or _BUDGET)
    if not robot.coordinates:
        raise UnsupportedError(f"no joint of {robot.name!r} moves, so there is no free space; call certify()")
    ground = _Ground(robot, start, chosen, dict(window or {}))
    empty = FreePolytope(
        verdict=Verdict.UNDECIDED,
        coverage=covered(robot, chosen),
        coordinates=robot.coordinates,
        q=start,
        faces=(),
        is_exact=False,
        violated=None,
        open_boxes=(),
        boxes=0,
        seconds=0.0,
    )
    if ground.violated is not None:
        is_proven = ground.is_proven
        verdict = Verdict.VIOLATED if is_proven else Verdict.UNDECIDED
        note = () if is_proven else (f"q is nearer to contact of {ground.violated!r} than rounding can tell",)
        violated = ground.violated if is_proven else None
        return replace(empty, verdict=verdict, violated=violated, seconds=meter.seconds, notes=note)
    verdict = settled(Verdict.CERTIFIED, chosen, limits_only)
    exact = replace(
        empty,
        verdict=verdict,
        faces=needed_faces(ground.faces),
        is_exact=True,
        seconds=meter.seconds,
        notes=tuple(ground.notes),
    )
    if not ground.searched:
        return exact
    left = Budget(_AT_Q.boxes, min(_AT_Q.seconds, max(0.0, meter.budget.seconds - meter.seconds)))
    at_q = certify_box(robot, start, start, [boundary.name for boundary in ground.searched], left)
    if at_q.verdict is not Verdict.CERTIFIED:
        is_spent = any(one.reason in (Reason.TIME, Reason.BOXES) for one in at_q.open_boxes)
        said = "the budget was spent at q itself" if is_spent else "q is nearer to contact than rounding can tell"
        note = () if at_q.violated else (said,)
        return replace(empty, verdict=at_q.verdict, violated=at_q.violated, open_boxes=at_q.open_boxes, notes=note)
    return _searched(robot, exact, ground, meter, seed)


def _searched(robot: Robot, exact: FreePolytope, ground: _Ground, meter: Meter, seed: int) -> FreePolytope:
    """Return the largest polytope that could be proven: within a small box around q first, then within larger ones."""
    pairs = Pairs(robot, ground.searched, ground.low, ground.high)
    best: FreePolytope | None = None
    left: FreePolytope = exact
    Q = np.random.default_rng(seed).uniform(ground.low, ground.high, (_JUDGED, len(ground.q)))
    most, is_done = -1, True
    for share, margin in _STAGES:
        low, high = ground.low, ground.high
        if share < 1.0:
            low, high = ground.q + share * (low - ground.q), ground.q + share * (high - ground.q)
        around = [] if share == 1.0 else _sides(robot.coordinates, low, high)
        faces = (*exact.faces, *around)
        draft = Draft(pairs, ground.q, low, high, exact.A, exact.b, margin)
        grower = Grower(draft, robot, np.random.default_rng(seed))
        grower.begin()
        budget = meter.budget
        if share == 1.0:  # for smaller polytopes, this takes more time than it saves
            grower.grow(_SAMPLES, meter, meter.seconds + _GROWING * (budget.seconds - meter.seconds))
        for face in around:
            draft.add(face.normal, face.proven, _SIDE)
        prover = Prover(draft, meter)
        is_done = prover.prove_all()
        rows = range(len(exact.faces), len(draft.b))
        found = [
            Face(pairs.names[pair], pairs.names[pair], draft.A[row], float(draft.b[row]), 0.0, True)
            for row, pair in zip(rows, draft.source, strict=True)
            if pair != _SIDE
        ]
        left = replace(
            exact,
            verdict=exact.verdict if is_done else Verdict.UNDECIDED,
            faces=(*faces, *found),
            is_exact=False,
            open_boxes=() if is_done or best is not None else prover.open_boxes(),
            boxes=meter.boxes,
            seconds=meter.seconds,
        )
        if not is_done:
            break
        inside = int(np.count_nonzero(np.all(Q @ draft.A.T <= draft.b, axis=1)))
        if inside >= most:
            best, most = left, inside
    if best is None:
        return left
    if not is_done:
        is_box = any(face.name.endswith(" reach") for face in best.faces)
        where = "; this one lies in a box around q, the faces '... reach'" if is_box else ""
        note = f"the budget was spent: a larger polytope may be certified{where}"
        best = replace(best, boxes=meter.boxes, seconds=meter.seconds, notes=(*best.notes, note))
    return best


def _sides(names: Sequence[str], low: Array, high: Array) -> list[Face]:
    found: list[Face] = []
    for j, name in enumerate(names):
        one = np.eye(len(names))[j]
        found.append(Face(f"{name} upper reach", name, one, float(high[j]), 0.0, False))
        found.append(Face(f"{name} lower reach", name, -one, float(-low[j]), 0.0, False))
    return found


class _Ground:
    """The parts of a polytope that need no search: limits, rules, and boundaries of one angle."""

    def __init__(
        self, robot: Robot, q: Array, chosen: Sequence[Boundary], window: Mapping[str, tuple[float, float]]
    ) -> None:
        self.q = q
        self.searched: list[Boundary] = []
        self.notes: list[str] = []
        self.violated: str | None = None
        self.is_proven = True
        rough = limit_faces(robot, window)
        self.low, self.high = outer_box(rough, robot.coordinates)
        farthest = np.maximum(np.abs(self.low), np.abs(self.high))
        self.faces = limit_faces(robot, window, farthest)
        for face in self.faces:
            if not float(face.normal @ q) <= face.proven:
                self._stop(face.name, float(face.normal @ q) > face.bound + face.slack)
                return
        self._rules(robot, q, farthest)
        gaps = OneAngleGaps(robot, chosen, self.low, self.high)
        for name in gaps.strips:
            gap = gaps.around(name, q)
            if gap is None:
                (signed,) = robot.boundaries[name].rule.signed(q[None])
                self._stop(name, bool(signed < 0.0))
                return
            self.faces += gap.faces()
        self.searched = [boundary for boundary in chosen if boundary.name not in gaps.strips]

    def _stop(self, name: str, is_proven: bool) -> None:
        self.violated, self.is_proven = name, is_proven

    def _rules(self, robot: Robot, q: Array, farthest: Array) -> None:
        """Add one face for each rule with conditions: the one that q keeps by most, so that q stays inside."""
        for one in robot.guarded_limits:
            choices = guarded_choices(one, farthest, robot.coordinates)
            margins = [face.proven - float(face.normal @ q) for face in choices]
            best = int(np.argmax([m / float(np.linalg.norm(f.normal)) for m, f in zip(margins, choices, strict=True)]))
            if not margins[best] >= 0.0:
                self._stop(one.name, not bool(one.holds(q[None])[0]))
                return
            self.faces.append(choices[best])
            self.notes.append(
                f"rule {one.rule!r} allows a union of {len(choices)} half-spaces, and the polytope lies in one: "
                f"{choices[best].name}"
            )


def needed_faces(faces: Sequence[Face]) -> tuple[Face, ...]:
    """Return the faces that no other faces imply, each with its tightest proven bound; equal faces once."""
    kept: list[Face] = []
    for face in faces:
        scaled = face.normal / np.linalg.norm(face.normal)
        same = [
            i for i, other in enumerate(kept) if np.array_equal(other.normal / np.linalg.norm(other.normal), scaled)
        ]
        if same:
            other = kept[same[0]]
            ends = [one.proven / float(np.linalg.norm(one.normal)) for one in (face, other)]
            if ends[0] < ends[1]:
                kept[same[0]] = face
            continue
        kept.append(face)
    return tuple(_without_implied(kept))


def _without_implied(faces: Sequence[Face]) -> list[Face]:
    """Drop faces that the others imply.

    A linear program proposes weights of the others, and they are verified: a face is dropped only if the weights are
    not negative, give its normal to the last digit, and give its bound with the rounding of their sum.
    """
    kept = list(faces)
    for face in list(faces):
        others = [one for one in kept if one is not face]
        if not others:
            continue
        A = np.array([one.normal for one in others])
        b = np.array([one.proven for one in others])
        found = linear_program(b, np.empty((0, len(b))), np.empty(0), 0.0, (A.T, face.normal))
        if found is None:
            continue
        weights = np.maximum(found, 0.0)
        weights[weights < 1e-12] = 0.0
        off = np.abs(A.T @ weights - face.normal)
        if np.any(off > 0.0):
            continue
        rounding = 4.0 * UNIT_ROUNDOFF * len(weights) * float(np.abs(b) @ weights)
        if float(b @ weights) + rounding < face.proven:
            kept = others
    return kept
