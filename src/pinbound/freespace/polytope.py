"""certified_polytope(): a polytope around a configuration, in all coordinates, every q of which is proven free."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pinbound.boundaries.boundary import Boundary, one_configuration
from pinbound.certificates.records import Budget, Verdict
from pinbound.certificates.scope import covered, scope, settled
from pinbound.certificates.search import Meter
from pinbound.exceptions import UnsupportedError
from pinbound.freespace.faces import Face, OneAngleGaps, guarded_choices, limit_faces, outer_box
from pinbound.freespace.records import FreePolytope
from pinbound.robot.robot import Robot
from pinbound.tolerances import UNIT_ROUNDOFF

__all__ = ["certified_polytope"]

Array = NDArray[np.float64]

_BUDGET = Budget(boxes=100_000_000, seconds=60.0)


def certified_polytope(
    robot: Robot,
    q: ArrayLike,
    boundaries: Sequence[str] | None = None,
    budget: Budget | None = None,
    window: Mapping[str, tuple[float, float]] | None = None,
    *,
    limits_only: bool = False,
) -> FreePolytope:
    """Return a polytope `{A q <= b}` around q, every configuration of which is proven free and within all limits.

    If every boundary has one effective angle, as those of parallelogram arms have, the polytope is exact: its faces are
    limits, rules and contact angles, all in closed form, less a slack for rounding of some 1e-11 rad. Of a rule with
    conditions the half-space is taken that keeps q furthest inside; a note says which.

    Args:
        robot: The robot.
        q: (n,) the configuration inside.
        boundaries: Names of the boundaries; None: all.
        budget: How much work is allowed; None: 60 seconds.
        window: Ends [rad or m] by coordinate; needed for coordinates without limits.
        limits_only: Keep limits and rules and nothing else. Without it, no boundary at all is NOTHING_TO_CHECK.

    Returns:
        The polytope. If q itself is not free, an empty one, with the verdict VIOLATED.

    Raises:
        DimensionError: If q is not one finite configuration, or a coordinate has no limits.
        UnknownNameError: If the robot has no boundary, or the window no coordinate, of that name.
        UnsupportedError: If a boundary has several effective angles.

    References:
        `docs/free-space.md`.

    Example:
        >>> import pinbound as pb
        >>> robot = pb.load("minervabot_v3")
        >>> polytope = pb.certified_polytope(robot, robot.home)
        >>> polytope.verdict.value, polytope.is_exact, len(polytope.vertices), len(polytope.edges)
        ('certified', True, 12, 18)
        >>> polytope.names
        ('q1 upper', 'q1 lower', 'beta_3', 'beta_4', 'beta_7', 'beta_8', 'beta_9', 'beta_10')
    """
    start = one_configuration(q, robot.coordinates).copy()
    chosen = scope(robot, boundaries, True, limits_only)
    meter = Meter(budget or _BUDGET)
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
    if ground.searched:
        names = ", ".join(boundary.name for boundary in ground.searched[:3])
        said = f"boundaries of several effective angles have no exact polytope: {names}"
        raise UnsupportedError(f"{said}; name others by boundaries=, or ask certified_box")
    verdict = settled(Verdict.CERTIFIED, chosen, limits_only)
    faces = needed_faces(ground.faces)
    return replace(empty, verdict=verdict, faces=faces, is_exact=True, seconds=meter.seconds, notes=tuple(ground.notes))


class _Ground:
    """What is known of a polytope before any search: limits, rules, and boundaries of one angle or none."""

    def __init__(
        self, robot: Robot, q: Array, chosen: Sequence[Boundary], window: Mapping[str, tuple[float, float]]
    ) -> None:
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
        self.searched: list[Boundary] = []
        for boundary in chosen:
            if boundary.name in gaps.strips:
                continue
            self.searched.append(boundary)

    def _stop(self, name: str, is_proven: bool) -> None:
        self.violated, self.is_proven = self.violated or name, is_proven
        self.searched = []

    def _rules(self, robot: Robot, q: Array, farthest: Array) -> None:
        """Add one face for each rule with conditions: the one that q keeps by most, and no polytope loses q."""
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
    """Return the faces that no others imply, each proven bound the tightest; equal ones once."""
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

    A linear program proposes weights of the others, and its word is not taken: a face is dropped only if the weights
    are not negative, give its normal to the last digit, and its bound with the rounding of their sum.
    """
    from scipy.optimize import linprog

    kept = list(faces)
    for face in list(faces):
        others = [one for one in kept if one is not face]
        if not others:
            continue
        A = np.array([one.normal for one in others])
        b = np.array([one.proven for one in others])
        found = linprog(b, A_eq=A.T, b_eq=face.normal, bounds=[(0.0, None)] * len(others), method="highs")
        if not found.success:
            continue
        weights = np.maximum(np.asarray(found.x), 0.0)
        weights[weights < 1e-12] = 0.0
        off = np.abs(A.T @ weights - face.normal)
        if np.any(off > 0.0):
            continue
        rounding = 4.0 * UNIT_ROUNDOFF * len(weights) * float(np.abs(b) @ weights)
        if float(b @ weights) + rounding < face.proven:
            kept = others
    return kept
