"""plan(): a motion between two configurations that is certified, or a proof that there is none, or neither.

How a path is found is a heuristic, two trees of straight pieces that grow towards each other; what it is worth is not:
`certify` proves it, over all of its length. That there is no motion is proven where an effective angle, or one
inequality, has to pass through contact.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pinbound.boundaries.boundary import Boundary, one_configuration
from pinbound.certificates import certify, certify_box
from pinbound.certificates.records import Budget, Certificate, Verdict
from pinbound.certificates.scope import scope
from pinbound.certificates.search import Meter
from pinbound.freespace.faces import OneAngleGaps, limit_faces, outer_box
from pinbound.robot.robot import Robot
from pinbound.typing import Array
from pinbound.values import Value

__all__ = ["Plan", "plan"]

_BUDGET = Budget(boxes=20_000_000, seconds=30.0)
_STEP = 0.05
"""Radians or metres: how far apart samples of a straight piece are that a tree tries; `certify` looks between them."""
_REACH = 1.0
"""Radians or metres: how far a tree grows in one go."""
_SHORTCUTS = 64
_ANGLES = 257
"""Angles between start and goal at which contact is looked for, beside the middles of its strips."""


@dataclass(frozen=True, eq=False)
class Plan(Value):
    """A motion, and what was proven of it. Made by `plan`.

    Attributes:
        verdict: CERTIFIED: the motion, straight between `waypoints`, is proven clear and within limits. VIOLATED: there
            is none, with proof: start or goal is not free, or `separated_by` is between them. UNDECIDED: none was
            found, which proves nothing. NOTHING_TO_CHECK: there is no boundary.
        waypoints: (k, n); none unless a motion was found.
        certificate: Of the motion; None if none was found.
        separated_by: The boundary that every motion between the two would touch, or what start or goal violate.
        notes: What the verdict does not say.
        seconds: Wall time.
    """

    verdict: Verdict
    waypoints: Array
    certificate: Certificate | None
    separated_by: str | None
    notes: tuple[str, ...]
    seconds: float

    @property
    def length(self) -> float:
        """Length of the motion in q, Euclidean [rad, metres where a joint slides]; 0 if there is none."""
        return float(np.linalg.norm(np.diff(self.waypoints, axis=0), axis=1).sum())


def plan(
    robot: Robot,
    start: ArrayLike,
    goal: ArrayLike,
    boundaries: Sequence[str] | None = None,
    budget: Budget | None = None,
    *,
    limits_only: bool = False,
    seed: int = 0,
) -> Plan:
    """Return a certified motion from one configuration to another, straight between waypoints.

    The straight motion is tried first; where all boundaries have one effective angle and no rule has a condition, no
    other is needed, since what can be reached is convex. Otherwise two trees grow from both ends through free samples,
    the path is shortened, and certified as a whole. It is not the shortest one.

    Args:
        robot: The robot.
        start: (n,) [rad or m].
        goal: (n,).
        boundaries: Names of the boundaries; None: all.
        budget: How much work is allowed; None: 30 seconds.
        limits_only: Keep limits and rules and nothing else.
        seed: Of the random samples.

    Returns:
        The motion with its certificate; or a proof that there is none; or UNDECIDED.

    Raises:
        DimensionError: If start or goal is not one finite configuration, or a coordinate has no limits.
        UnknownNameError: If the robot has no boundary of that name.

    Example:
        >>> import pinbound as pb
        >>> robot = pb.load("minervabot_v3")
        >>> found = pb.plan(robot, [-1.5, 0.1, 0.1], [1.5, 0.6, 0.8])
        >>> found.verdict.value, len(found.waypoints)
        ('certified', 2)
        >>> beyond = pb.plan(robot, [-1.5, 0.1, 0.1], [0.0, 0.0, 1.4])
        >>> beyond.verdict.value, beyond.separated_by is not None
        ('violated', True)
    """
    first, last = (one_configuration(one, robot.coordinates).copy() for one in (start, goal))
    chosen = scope(robot, boundaries, True, limits_only)
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
    between = _separation(robot, chosen, first, last)
    if between is not None:
        notes = (f"every motion touches {between!r}: its angle takes all values between those of start and goal",)
        return _said(nothing, meter, verdict=Verdict.VIOLATED, separated_by=between, notes=notes)
    rng, bad = np.random.default_rng(seed), list[Array]()
    waypoints: Array | None = np.stack([first, last])
    while waypoints is not None:
        left = Budget(max(meter.budget.boxes - meter.boxes, 0), max(meter.budget.seconds - meter.seconds, 0.0))
        proof = certify(robot, waypoints, boundaries=names, budget=left, limits_only=limits_only)
        meter.boxes += proof.boxes
        if proof.verdict in (Verdict.CERTIFIED, Verdict.NOTHING_TO_CHECK):
            return _said(nothing, meter, verdict=proof.verdict, waypoints=waypoints, certificate=proof)
        contact = proof.first_contact
        if contact is not None:
            bad.append(contact.q)
        waypoints = _Trees(robot, names, (first, last), bad, rng, meter).path()
    notes = ("no motion was found within the budget; that proves nothing",)
    return _said(nothing, meter, notes=notes)


def _said(one: Plan, meter: Meter, **changes: Any) -> Plan:
    return replace(one, seconds=meter.seconds, **changes)


def _separation(robot: Robot, chosen: Sequence[Boundary], first: Array, last: Array) -> str | None:
    """Return a boundary of one effective angle whose contact lies between both, proven; None if none was found.

    The angle is continuous along any motion, so that it takes all values in between, and the clearance depends on it
    alone: one value that is proven in contact suffices.
    """
    gaps = OneAngleGaps(robot, chosen, *outer_box(limit_faces(robot, {}), robot.coordinates))
    for name, (c, strips) in gaps.strips.items():
        low, high = sorted((float(c @ first), float(c @ last)))
        first_turn, last_turn = math.floor(low / (2.0 * math.pi)) - 1, math.ceil(high / (2.0 * math.pi)) + 1
        middles = [strip.angle + 2.0 * math.pi * k for strip in strips for k in range(first_turn, last_turn + 1)]
        phi = np.concatenate([np.linspace(low, high, _ANGLES), np.array(middles)])
        phi = phi[(phi >= low) & (phi <= high)]
        if np.any(gaps.violated(name, phi)):
            return name
    return None


class _Trees:
    """Two trees of straight free pieces, from the start and from the goal."""

    def __init__(
        self,
        robot: Robot,
        names: Sequence[str],
        ends: tuple[Array, Array],
        bad: Sequence[Array],
        rng: np.random.Generator,
        meter: Meter,
    ) -> None:
        self.robot, self.rng, self.meter = robot, rng, meter
        self.chosen = robot.boundaries.select(names) if names else None
        self.low, self.high = outer_box(limit_faces(robot, {}), robot.coordinates)
        self.ends, self.bad = ends, list(bad)

    def path(self) -> Array | None:
        """Return waypoints that are free where they are sampled; None if the budget is spent first."""
        trees = [_Tree([one], [-1]) for one in self.ends]
        side = 0
        while self.meter.spent() is None:
            self.meter.boxes += 1
            here, there = trees[side], trees[1 - side]
            target = self.rng.uniform(self.low, self.high)
            new = self._extend(here, target, _REACH)
            if new is not None and self._extend(there, here.points[new], np.inf, whole=True) is not None:
                way = here.way(new)[::-1] + there.way(len(there.points) - 1)[1:]
                way = way if side == 0 else way[::-1]
                return self._shortened(np.array(way))
            side = 1 - side
        return None

    def _extend(self, tree: _Tree, target: Array, reach: float, whole: bool = False) -> int | None:
        near = int(np.argmin(np.linalg.norm(np.array(tree.points) - target, axis=1)))
        step = target - tree.points[near]
        length = float(np.linalg.norm(step))
        if not length > 0.0:
            return near if whole else None
        end = tree.points[near] + step * min(1.0, reach / length)
        if not self._is_free(tree.points[near], end):
            return None
        tree.points.append(end)
        tree.parents.append(near)
        return len(tree.points) - 1

    def _is_free(self, a: Array, b: Array) -> bool:
        count = int(np.ceil(float(np.linalg.norm(b - a)) / _STEP)) + 1
        Q = a + np.linspace(0.0, 1.0, count + 1)[:, None] * (b - a)
        for q in self.bad:  # where a proof has found contact between samples
            along = b - a
            t = float(np.clip((q - a) @ along / max(float(along @ along), 1e-300), 0.0, 1.0))
            if float(np.linalg.norm(a + t * along - q)) < 1e-3:
                return False
        if not np.all(self.robot.intervals.hold(Q)):
            return False
        return self.chosen is None or bool(np.all(self.chosen.signed_clearances(Q) > 0.0))

    def _shortened(self, way: Array) -> Array:
        for _ in range(_SHORTCUTS):
            if len(way) < 3:
                break
            i, j = np.sort(self.rng.choice(len(way), 2, replace=False))
            if j - i > 1 and self._is_free(way[i], way[j]):
                way = np.concatenate([way[: i + 1], way[j:]])
        return way


@dataclass
class _Tree:
    points: list[Array]
    parents: list[int]

    def way(self, index: int) -> list[Array]:
        """Return the points from one back to the root."""
        found: list[Array] = []
        while index >= 0:
            found.append(self.points[index])
            index = self.parents[index]
        return found
