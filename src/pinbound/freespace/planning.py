"""plan(): a certified motion between two configurations, or a proof that there is none, or UNDECIDED.

Heuristics find a path: the straight path, the shortest path through polytopes, a chain of sets of a cover, two trees.
`certify` then proves the whole path. It is proven that no motion exists if an effective angle, or one inequality, must
pass through contact, or if the boxes of a cover that may be free do not connect start and goal.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pinbound.boundaries.boundary import Boundary, one_configuration
from pinbound.certificates import certify, certify_box
from pinbound.certificates.records import Budget, Certificate, Verdict
from pinbound.certificates.scope import scope
from pinbound.certificates.search import Meter
from pinbound.checks import random_numbers
from pinbound.coverage import CoverageRecord
from pinbound.exceptions import UnsupportedError
from pinbound.freespace.cover_records import APART, FreeCover
from pinbound.freespace.digest import robot_digest
from pinbound.freespace.faces import OneAngleGaps, limit_faces, outer_box, without_limits
from pinbound.freespace.pieces import free_union, lifted, path_in_union
from pinbound.freespace.smoothing import smooth_motion, straight_times
from pinbound.freespace.trees import Trees
from pinbound.robot.robot import Robot, check_robot
from pinbound.robot.speeds import largest_speeds
from pinbound.typing import Array
from pinbound.units import several
from pinbound.values import Value

__all__ = ["Plan", "plan"]

_BUDGET = Budget(boxes=20_000_000, seconds=30.0)
_ANGLES = 257
"""The number of angles between start and goal at which contact is tested, besides the middles of strips."""
_SLIDES = 1.0
"""Metres: the least range beyond start and goal in which a prismatic joint without limits is searched."""
_PACES = (1.0, 0.5, 0.2, 0.0)
"""Speeds at which a smooth motion passes its waypoints, tried in this order. The last one stops at each waypoint."""


@dataclass(frozen=True, eq=False)
class Plan(Value):
    """A motion, and what was proven about it. Made by `plan`.

    Attributes:
        verdict: CERTIFIED: the motion, straight between `waypoints`, is proven free and within limits. VIOLATED: it is
            proven that no motion exists, because start or goal is not free, or `separated_by` is between them.
            UNDECIDED: no motion was found, which proves nothing. NOTHING_TO_CHECK: there is no boundary.
        waypoints: (k, n); empty if no motion was found.
        certificate: The certificate of the motion; None if no motion was found.
        separated_by: The boundary that every motion from start to goal would touch, or the boundary or limit that start
            or goal violates; "cover" if the boxes of a cover prove that there is no motion.
        notes: Sentences about what the verdict does not cover.
        seconds: Wall time [s].
        found_by: How the motion was found: "straight", "shortest" (through polytopes), "sets", "trees"; empty if none
            was.
        times: (k,) times [s] at which the straight motion passes its waypoints at the given velocities; None without
            them.
        motion: A smooth motion past the waypoints, a SciPy BPoly over time [s], which keeps the velocities; None
            without velocities, or if no smooth motion was certified.
        motion_certificate: The certificate of the smooth motion.

    Example:
        >>> import pinbound as pb
        >>> robot = pb.load("minervabot_v3")
        >>> found = pb.plan(robot, robot.home, [0.5, 0.6, 0.8])
        >>> found.verdict.name, found.waypoints.shape[1], found.certificate.lower > 0.0
        ('CERTIFIED', 3, True)
    """

    verdict: Verdict
    waypoints: Array
    certificate: Certificate | None
    separated_by: str | None
    notes: tuple[str, ...]
    seconds: float
    found_by: str = ""
    times: Array | None = None
    motion: Any = None
    motion_certificate: Certificate | None = None

    @property
    def coverage(self) -> CoverageRecord | None:
        """Which pairs of links the boundaries watch, and which they do not; None without a certificate."""
        return None if self.certificate is None else self.certificate.coverage

    @property
    def length(self) -> float:
        """Length of the motion in q, Euclidean [rad, metres for a prismatic joint]; 0 if there is none."""
        return float(np.linalg.norm(np.diff(self.waypoints, axis=0), axis=1).sum())


def plan(
    robot: Robot,
    start: ArrayLike,
    goal: ArrayLike,
    boundaries: Sequence[str] | None = None,
    budget: Budget | None = None,
    *,
    cover: FreeCover | None = None,
    velocity: ArrayLike | Mapping[str, float] | None = None,
    limits_only: bool = False,
    seed: int = 0,
) -> Plan:
    """Return a certified motion from one configuration to another, straight between waypoints.

    The straight motion is tried first. If all boundaries have one effective angle, the free set is a union of
    polytopes, one for each way to satisfy the rules with conditions; the shortest path through it is tried next. Then
    follow a chain of sets of a cover, and two trees that grow from both ends through free samples. Every path is
    certified. A revolute joint without limits is searched one turn beyond start and goal; a prismatic joint without
    limits, by the distance of start and goal, but at least one metre.

    Args:
        robot: The robot.
        start: (n,) [rad or m].
        goal: (n,).
        boundaries: Names of the boundaries; None: all.
        budget: The work allowed; None: 30 seconds.
        cover: A cover of this robot and these boundaries, from `certified_cover` or `load_cover`.
        velocity: Largest speed of each coordinate [rad/s or m/s]: (n,), one number, or by name. It is needed for
            `times` and the smooth `motion`.
        limits_only: Whether to use limits and rules only, without boundaries.
        seed: Seed of the random samples.

    Returns:
        The motion with its certificate, or a proof that there is none, or UNDECIDED.

    Raises:
        DimensionError: If start or goal is not one finite configuration, or a velocity is not positive.
        UnknownNameError: If a boundary, or a coordinate of `velocity`, does not exist.
        UnsupportedError: If the cover belongs to another robot or to other boundaries.

    Example:
        >>> import pinbound as pb
        >>> robot = pb.load("minervabot_v3")
        >>> found = pb.plan(robot, [-1.5, 0.1, 0.1], [1.5, 0.6, 0.8], velocity=2.0)
        >>> found.verdict.value, found.found_by, len(found.waypoints), bool(abs(found.times[-1] - 1.5) < 1e-6)
        ('certified', 'straight', 2, True)
        >>> found.motion_certificate.verdict.value, bool(np.allclose(found.motion(0.0), [-1.5, 0.1, 0.1]))
        ('certified', True)
        >>> beyond = pb.plan(robot, [-1.5, 0.1, 0.1], [0.0, 0.0, 1.4])
        >>> beyond.verdict.value, beyond.separated_by is not None
        ('violated', True)
    """
    check_robot(robot)
    first, last = (one_configuration(one, robot.coordinates).copy() for one in (start, goal))
    chosen, rng = scope(robot, boundaries, True, limits_only), random_numbers(seed)
    speeds = None if velocity is None else largest_speeds(robot, velocity)
    if cover is not None and cover.digest != robot_digest(robot, chosen):
        counted = several(len(cover.boundaries), "boundary")
        said = f"the cover is of {cover.robot!r} with {counted}, and of other limits or marks"
        raise UnsupportedError(f"{said} than these; make one of this robot and these boundaries with certified_cover()")
    names, meter = [boundary.name for boundary in chosen], Meter(budget or _BUDGET)
    nothing = Plan(Verdict.UNDECIDED, np.empty((0, len(first))), None, None, (), 0.0)
    for where, q in (("start", first), ("goal", last)):
        found = certify_box(robot, q, q, names, limits_only=limits_only)
        if found.verdict is Verdict.VIOLATED:
            notes = (f"the {where} is not free: {found.violated}",)
            return _said(nothing, meter, verdict=Verdict.VIOLATED, separated_by=found.violated, notes=notes)
        if found.verdict is Verdict.UNDECIDED:
            notes = (f"the {where} is nearer to contact than rounding can tell",)
            return _said(nothing, meter, notes=notes)
    window = _window(robot, first, last)
    between = _separation(robot, chosen, first, last, window)
    if between is not None:
        notes = (f"every motion touches {between!r}: its angle takes all values between those of start and goal",)
        return _said(nothing, meter, verdict=Verdict.VIOLATED, separated_by=between, notes=notes)
    if cover is not None and _is_apart(cover, first, last):
        notes = (
            "start and goal are not connected: no chain of boxes that may be free joins them, for any "
            "values of the other coordinates",
        )
        return _said(nothing, meter, verdict=Verdict.VIOLATED, separated_by="cover", notes=notes)
    search = _Search(robot, chosen, (first, last), window, cover, rng, meter)
    for how, waypoints in search.ways():
        proof = _proof(robot, waypoints, names, meter, limits_only)
        if proof.verdict in (Verdict.CERTIFIED, Verdict.NOTHING_TO_CHECK):
            done = replace(nothing, verdict=proof.verdict, waypoints=waypoints, certificate=proof, found_by=how)
            return _said(done, meter, **_timed(robot, done, names, speeds, meter, limits_only))
        contact = proof.first_contact
        if contact is not None:
            search.bad.append(contact.q)
    notes = (*search.notes, "no motion was found within the budget; this does not prove that there is none")
    return _said(nothing, meter, notes=notes)


def _said(one: Plan, meter: Meter, **changes: Any) -> Plan:
    return replace(one, seconds=meter.seconds, **changes)


def _proof(robot: Robot, motion: Any, names: Sequence[str], meter: Meter, limits_only: bool) -> Certificate:
    left = Budget(max(meter.budget.boxes - meter.boxes, 0), max(meter.budget.seconds - meter.seconds, 0.0))
    proof = certify(robot, motion, boundaries=names, budget=left, limits_only=limits_only)
    meter.boxes += proof.boxes
    return proof


def _timed(
    robot: Robot, found: Plan, names: Sequence[str], speeds: Array | None, meter: Meter, limits_only: bool
) -> dict[str, Any]:
    """Return times and the smoothest motion that is certified."""
    if speeds is None:
        return {}
    changes: dict[str, Any] = {"times": straight_times(found.waypoints, speeds)}
    for pace in _PACES if len(found.waypoints) > 2 else (0.0,):
        motion = smooth_motion(found.waypoints, speeds, pace)
        proof = _proof(robot, motion, names, meter, limits_only)
        if proof.verdict is found.verdict:
            return changes | {"motion": motion, "motion_certificate": proof}
    return changes | {
        "notes": (
            *found.notes,
            "no smooth motion was certified within the budget; the motion of straight pieces is certified",
        )
    }


class _Search:
    """Paths that may be free, one after the other, the simplest first."""

    def __init__(
        self,
        robot: Robot,
        chosen: Sequence[Boundary],
        ends: tuple[Array, Array],
        window: Mapping[str, tuple[float, float]],
        cover: FreeCover | None,
        rng: np.random.Generator,
        meter: Meter,
    ) -> None:
        self.robot, self.chosen, self.ends, self.window = robot, chosen, ends, window
        self.cover, self.rng, self.meter = cover, rng, meter
        self.names = [boundary.name for boundary in chosen]
        self.bad: list[Array] = []
        """Where a proof has found contact."""
        self.notes = [
            f"{name!r} has no limits: plan() searched between {low:.6g} and {high:.6g}"
            f" {'rad' if robot.turns(name) else 'm'} only"
            for name, (low, high) in window.items()
        ]

    def ways(self) -> Iterator[tuple[str, Array]]:
        """Yield the method and the waypoints, until the budget is spent."""
        first, last = self.ends
        yield "straight", np.stack([first, last])
        union = free_union(self.robot, self.chosen, first, self.window)
        way = None if union is None else path_in_union(union, first, last)
        if way is not None:
            yield "shortest", way
        if self.cover is not None and len(self.cover):
            for one in self._through(self.cover):
                yield "sets", self._trees().shortened(one)
                yield "sets", one
        while (found := self._trees().path()) is not None:
            yield "trees", found

    def _trees(self) -> Trees:
        return Trees(self.robot, self.names, self.ends, self.bad, self.window, self.rng, self.meter)

    def _through(self, cover: FreeCover) -> Iterator[Array]:
        """Yield the shortest path through the sets of a cover, straight to the nearest set from an end in no set."""
        first, last = self.ends
        held = np.isfinite(cover.at)
        if not cover.is_whole and np.any(first[held] != last[held]):
            self.notes.append(
                "start and goal differ in coordinates that the cover keeps fixed, so its sets were not used"
            )
            return
        if not cover.is_whole and np.any(first[held] != cover.at[held]):
            self.notes.append(
                "the cover keeps coordinates fixed at other values than those of start and "
                "goal, so its sets were not used"
            )
            return
        axes, best = list(cover.axes), list[tuple[float, Array]]()
        for start in cover.graph.entries(first[axes]):
            for goal in cover.graph.entries(last[axes]):
                route = cover.graph.route(start, goal)
                if route is not None:
                    way = np.vstack([first[axes], route.points, last[axes]])
                    keep = np.append(True, np.any(np.diff(way, axis=0) != 0.0, axis=1))
                    best.append((float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum()), way[keep]))
                if self.meter.spent():
                    break
        best.sort(key=lambda one: one[0])
        for _, way in best:
            if len(way) > 1:
                yield lifted(way, axes, first, last)


def _is_apart(cover: FreeCover, first: Array, last: Array) -> bool:
    """Return whether boxes prove that there is no motion: the free and undecided boxes do not connect the two.

    They contain every free configuration in their coordinates, for all values of the others. A motion is continuous, so
    the boxes along it touch one after the other.
    """
    if not cover.is_whole or not len(cover.boxes) + len(cover.open):
        return False
    boxes, axes = np.concatenate([cover.boxes, cover.open]), list(cover.axes)
    low, high = boxes[:, 0] - APART, boxes[:, 1] + APART
    first_label, last_label = (
        cover.components[np.all((low <= q[axes]) & (q[axes] <= high), axis=1)] for q in (first, last)
    )
    return bool(len(first_label) and len(last_label)) and not np.intersect1d(first_label, last_label).size


def _window(robot: Robot, first: Array, last: Array) -> dict[str, tuple[float, float]]:
    """Return by name the search range of each coordinate without limits: start, goal, and a range beyond them.

    The range beyond is one turn for a revolute joint. For a prismatic joint it is the distance of start and goal, but
    at least `_SLIDES`.
    """
    found: dict[str, tuple[float, float]] = {}
    for name in without_limits(robot):
        low, high = sorted(float(q[robot.coordinates.index(name)]) for q in (first, last))
        room = 2.0 * math.pi if robot.turns(name) else max(high - low, _SLIDES)
        found[name] = low - room, high + room
    return found


def _separation(
    robot: Robot, chosen: Sequence[Boundary], first: Array, last: Array, window: Mapping[str, tuple[float, float]]
) -> str | None:
    """Return a boundary of one effective angle with a proven contact between both; None if none was found.

    The angle is continuous along any motion, so it takes all values in between. The clearance depends only on the
    angle. So one value with a proven contact is enough, for all values of the other coordinates.
    """
    gaps = OneAngleGaps(robot, chosen, *outer_box(limit_faces(robot, window), robot.coordinates))
    for name, (c, strips) in gaps.strips.items():
        low, high = sorted((float(c @ first), float(c @ last)))
        first_turn, last_turn = math.floor(low / (2.0 * math.pi)) - 1, math.ceil(high / (2.0 * math.pi)) + 1
        middles = [strip.angle + 2.0 * math.pi * k for strip in strips for k in range(first_turn, last_turn + 1)]
        phi = np.concatenate([np.linspace(low, high, _ANGLES), np.array(middles)])
        phi = phi[(phi >= low) & (phi <= high)]
        if np.any(gaps.violated(name, phi)):
            return name
    return None
