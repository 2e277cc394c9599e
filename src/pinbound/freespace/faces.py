"""Half-spaces that hold in all coordinates: limits, rules, and the contact angles of boundaries of one effective angle.

Each is `normal . q <= bound`. The proven bound is slightly smaller, `normal . q <= bound - slack`: the slack includes
every rounding error of the boundary or the limit. `docs/free-space.md` has the argument.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pinbound.boundaries.boundary import Boundary
from pinbound.certificates.constraints import families
from pinbound.certificates.enclosures import Enclosure, Family
from pinbound.exceptions import DimensionError, UnknownNameError
from pinbound.limits.univariate import gap_around
from pinbound.model.coupling import GuardedLimit, LinearLimit
from pinbound.robot.robot import Robot
from pinbound.tolerances import LIMIT, UNIT_ROUNDOFF, WIDEST_WINDOW
from pinbound.typing import Array, Flags
from pinbound.values import Value

__all__ = ["Face", "Gap", "OneAngleGaps", "guarded_choices", "limit_faces", "outer_box", "without_limits"]


_SMALLEST = 4.0
"""Unit roundoffs of an angle: the first slack that is tried; it is doubled until the rest of the gap is proven."""
_DOUBLINGS = 52
_PARTS = 4096


@dataclass(frozen=True, eq=False)
class Face(Value):
    """One side of a polytope: `normal . q <= bound`.

    Attributes:
        name: The name for people, e.g. ``"beta_4"`` or ``"q2 upper"``.
        source: The boundary, joint or rule that gives it.
        normal: (n,), not zero.
        bound: [rad or m] in closed form, or as the search placed it.
        slack: The difference of `bound` and the proven bound [rad or m].
        is_contact: True for a boundary, False for a limit or rule.
    """

    name: str
    source: str
    normal: Array
    bound: float
    slack: float
    is_contact: bool

    @property
    def proven(self) -> float:
        """The bound for which every q is proven to keep it."""
        return self.bound - self.slack


def limit_faces(robot: Robot, window: Mapping[str, tuple[float, float]], farthest: Array | None = None) -> list[Face]:
    """Return the faces of all limits of joints, mimic joints and rules without conditions, and of a window.

    A limit is kept if it is passed by at most `tolerances.LIMIT`. So the slack is zero unless |q| is huge.

    Args:
        robot: The robot.
        window: More ends, by coordinate [rad or m].
        farthest: (n,) upper bound of abs(q), for the slack; None: no slack yet.
    """
    found = [face for limit in robot.linear_limits for face in _ends(limit, farthest)]
    for name, ends in window.items():
        if name not in robot.coordinates:
            raise UnknownNameError("coordinate of the window", name, robot.coordinates)
        low, high = (float(end) for end in ends)
        if not -WIDEST_WINDOW <= low <= high <= WIDEST_WINDOW:
            raise DimensionError(f"the window of {name!r} is {ends!r}; give two numbers (lower, upper), lower first")
        one = np.eye(len(robot.coordinates))[robot.coordinates.index(name)]
        found.append(Face(f"{name} window upper", name, one, high, 0.0, False))
        found.append(Face(f"{name} window lower", name, -one, -low, 0.0, False))
    return found


def _ends(limit: LinearLimit, farthest: Array | None, beyond: bool = False) -> list[Face]:
    found: list[Face] = []
    for end, sign, bound in (("upper", 1.0, limit.upper), ("lower", -1.0, limit.lower)):
        if not math.isfinite(bound):
            continue
        c = sign * limit.coefficients
        slack = 0.0
        if farthest is not None:
            size = float(np.abs(c) @ farthest) + abs(bound) + abs(limit.offset)
            error = UNIT_ROUNDOFF * (len(c) + 12) * size
            slack = 2.0 * LIMIT + error if beyond else max(0.0, error - LIMIT)
        found.append(Face(f"{limit.joint} {end}", limit.joint, c, sign * (bound - limit.offset), slack, False))
    return found


def guarded_choices(one: GuardedLimit, farthest: Array, names: Sequence[str]) -> list[Face]:
    """Return the faces of which one must be kept: the end of the rule, or the opposite of a condition.

    The set that a rule with conditions allows is the union of these half-spaces.
    """
    found = _ends(one.limit, farthest)
    for condition in one.where:
        c = condition
        for lower, upper in ((c.upper, math.inf), (-math.inf, c.lower)):
            if math.isfinite(lower) or math.isfinite(upper):
                beyond = LinearLimit(one.rule, c.coefficients, c.offset, lower, upper)
                (face,) = _ends(beyond, farthest, beyond=True)
                found.append(Face(f"{one.name} where {_said(c, names)}", one.rule, *_rest(face)))
    return found


def _rest(face: Face) -> tuple[Array, float, float, bool]:
    return face.normal, face.bound, face.slack, face.is_contact


def _said(condition: LinearLimit, names: Sequence[str]) -> str:
    from pinbound.robot.rules import condition_text

    return condition_text(condition, names)


def outer_box(faces: Sequence[Face], names: Sequence[str]) -> tuple[Array, Array]:
    """Return the corners of a box that contains the set within the faces, from faces of one coordinate.

    If no such face bounds a coordinate, faces of several coordinates do, if their other coordinates are bounded.

    Raises:
        DimensionError: If a coordinate is not bounded; the message says what to give.
    """
    low, high = _extent(faces, len(names))
    open_ends = _open_ends(low, high)
    if open_ends:
        name = names[open_ends[0]]
        raise DimensionError(f"{name!r} has no limits; give window={{{name!r}: (lower, upper)}}")
    spare = 8.0 * UNIT_ROUNDOFF * (1.0 + np.maximum(np.abs(low), np.abs(high)))  # for the quotients of _extent
    return low - spare, high + spare


def without_limits(robot: Robot) -> tuple[str, ...]:
    """Return the coordinates that neither a limit nor a rule bounds."""
    return tuple(robot.coordinates[j] for j in _open_ends(*_extent(limit_faces(robot, {}), len(robot.coordinates))))


def _open_ends(low: Array, high: Array) -> list[int]:
    return [j for j in range(len(low)) if not (low[j] >= -WIDEST_WINDOW and high[j] <= WIDEST_WINDOW)]


def _extent(faces: Sequence[Face], n: int) -> tuple[Array, Array]:
    low, high = np.full(n, -np.inf), np.full(n, np.inf)
    for _ in range(n + 1):
        for face in faces:
            for j in np.flatnonzero(face.normal).tolist():
                c = float(face.normal[j])
                others = face.normal.copy()
                others[j] = 0.0
                used = others != 0.0
                least = np.where(others > 0.0, low, high)[used] @ others[used]
                if not math.isfinite(least):
                    continue
                end = (face.bound - least) / c
                wide = 0.0 if not np.any(used) else 1e-9 * (1.0 + abs(end))
                if c > 0.0:
                    high[j] = min(high[j], end + wide)
                else:
                    low[j] = max(low[j], end - wide)
    return low, high


@dataclass(frozen=True)
class Gap:
    """The free interval of one effective angle around a configuration.

    Attributes:
        boundary: The boundary.
        coefficients: (n,) c of `phi = c . q`.
        low: Lower end, in closed form [rad]; -inf if there is no contact.
        high: Upper end.
        slack: The amount by which both ends are moved inwards so that the interval can be proven.
    """

    boundary: str
    coefficients: Array
    low: float
    high: float
    slack: float

    def faces(self) -> list[Face]:
        """Return its two faces; none if there is no contact."""
        name, c = self.boundary, self.coefficients
        ends = ((c, self.high), (-c, -self.low))
        return [Face(name, name, normal, end, self.slack, True) for normal, end in ends if math.isfinite(end)]


class OneAngleGaps:
    """Free intervals of all boundaries of one effective angle, with proof."""

    def __init__(self, robot: Robot, boundaries: Sequence[Boundary], low: Array, high: Array) -> None:
        """Store the boundaries; the proofs hold while q stays in the box (n,), (n,)."""
        self.low, self.high = low, high
        self.farthest = np.maximum(np.abs(low), np.abs(high))
        self.known: dict[str, tuple[Family, int]] = {}
        self.strips = {b.name: found for b in boundaries if (found := b.rule.strips()) is not None}
        self.boundaries = {b.name: b for b in boundaries if b.name in self.strips}
        _, *others = families(robot, tuple(self.boundaries.values()), low, high)
        for family in others:
            self.known |= {name: (family, row) for row, name in enumerate(family.names)}

    def around(self, name: str, q: Array) -> Gap | None:
        """Return the proven free interval around q; None if q is not proven free of this boundary."""
        c, strips = self.strips[name]
        phi, rule = float(c @ q), self.boundaries[name].rule
        low, high = -math.inf, math.inf
        if rule.stop is not None:
            low, high = rule.stop.free_gap
        else:
            for strip in strips:
                if strip.half_width is not None:
                    ends = gap_around(strip.angle, strip.half_width, phi)
                    low, high = max(low, ends[0]), min(high, ends[1])
        if not low < phi < high:
            return None
        wide = float(np.abs(c) @ self.farthest)
        inside = max(low, -wide), min(high, wide)
        slack = _SMALLEST * UNIT_ROUNDOFF * (1.0 + wide)
        for _ in range(_DOUBLINGS):
            ends = (low + slack if low > -wide else inside[0]), (high - slack if high < wide else inside[1])
            if not ends[0] <= phi <= ends[1]:
                return None
            if self._is_clear(name, c, *ends):
                return Gap(name, c, low, high, slack)
            slack *= 2.0
        return None

    def violated(self, name: str, phi: Array) -> Flags:
        """Return the angles (N,) at which a boundary is proven to be in contact, as flags."""
        c, (family, row) = self.strips[name][0], self.known[name]
        j, centre = int(np.argmax(np.abs(c))), np.zeros((len(phi), len(c)))
        centre[:, j] = phi / c[j]
        return family.enclose_box(np.full(len(phi), row), centre, np.zeros_like(centre)).violated

    def _is_clear(self, name: str, c: Array, low: float, high: float) -> bool:
        """Return whether every angle in [low, high] is proven clear: halving, along one coordinate of the angle."""
        family, row = self.known[name]
        j = int(np.argmax(np.abs(c)))
        ends = np.array([[low, high]])
        for _ in itertools.repeat(None):
            if not len(ends):
                return True
            if len(ends) > _PARTS:
                return False
            centre, half = np.zeros((2, len(ends), len(c)))
            centre[:, j] = 0.5 * (ends[:, 0] + ends[:, 1]) / c[j]
            # Widened by the rounding of these products, so that it contains all angles of the range.
            room = 8.0 * UNIT_ROUNDOFF * (np.abs(ends).max(axis=1) + 1.0)
            half[:, j] = (0.5 * (ends[:, 1] - ends[:, 0]) + room) / abs(float(c[j]))
            found: Enclosure = family.enclose_box(np.full(len(ends), row), centre, half)
            if np.any(found.settled & ~found.clear) or np.any(found.violated):
                return False
            left = ends[~found.clear]
            if np.any(left[:, 1] - left[:, 0] <= room[~found.clear]):
                return False
            middle = left.mean(axis=1)
            ends = np.concatenate([np.stack((left[:, 0], middle), axis=1), np.stack((middle, left[:, 1]), axis=1)])
        return True
