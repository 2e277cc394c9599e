"""A plane of two coordinates: what bounds it, and which of its points are free.

Held at the other coordinates, each boundary is one of three things in the plane, after its chain has been reduced
again (`interpreters/restriction`):

    constant:   it does not depend on the plane; it only has to be free where the others are held;
    strip:      one effective angle; contact is `c . x in [phi* - w, phi* + w]`, every turn: straight lines, exact;
    curve:      anything else; contact is `|r(x)| <= T`, T being the contact rule's distance (`pinbound.contact`).

A strip of zero width, of a stop, is a line that cuts. A curve's T is never below the contact tolerance: two points that
could meet at zero threshold meet in isolated points of the plane, data are rounded, and so a disc is kept around each.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pinbound.boundary import Boundary
from pinbound.exceptions import DimensionError, UnknownNameError, UnsupportedError
from pinbound.interpreters import separation
from pinbound.interpreters.restriction import restrict_path
from pinbound.interpreters.univariate import gap_around, one_angle_strips
from pinbound.path import RelativePath
from pinbound.region.halfplanes import HalfPlane
from pinbound.robot import Robot

__all__ = ["Curve", "Plane", "Strips", "plane_of"]

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

_PLANE = 2
_TURN = 2.0 * math.pi


@dataclass(frozen=True)
class Strips:
    """Contact of a boundary of one effective angle in the plane.

    Attributes:
        name: The boundary.
        normal: (2,) c.
        angle: phi* [rad].
        half_width: w [rad], 0 for a line that cuts.
    """

    name: str
    normal: Array
    angle: float
    half_width: float

    def free(self, X: Array) -> Bools:
        """Return whether points (N, 2) are out of contact; a line of zero width holds no point."""
        away = np.abs(np.remainder(X @ self.normal - self.angle + math.pi, _TURN) - math.pi)
        return away > self.half_width

    def gap(self, x: Array) -> tuple[float, float]:
        """Return the open interval of `c . x` around a point; NaN if it is in contact."""
        return gap_around(self.angle, self.half_width, float(self.normal @ x))

    def lines(self, lowest: float, highest: float) -> list[float]:
        """Return every value of `c . x` in a range at which contact begins or ends."""
        sides = (0.0,) if self.half_width == 0.0 else (-self.half_width, self.half_width)
        found: list[float] = []
        for side in sides:
            first = math.ceil((lowest - self.angle - side) / _TURN)
            last = math.floor((highest - self.angle - side) / _TURN)
            found += [self.angle + side + turn * _TURN for turn in range(first, last + 1)]
        return sorted(found)


@dataclass(frozen=True)
class Curve:
    """Contact `|r(x)| <= threshold` of a boundary of several effective angles in the plane.

    Attributes:
        name: The boundary.
        path: Over the plane's two coordinates.
        threshold: T [m].
    """

    name: str
    path: RelativePath
    threshold: float

    def free(self, X: Array) -> Bools:
        """Return whether points (N, 2) are out of contact."""
        return separation.separations(self.path, X) > self.threshold


@dataclass(frozen=True)
class Plane:
    """Two coordinates of a robot, the others held, and everything that bounds them.

    Attributes:
        robot: The robot.
        coordinates: The two coordinates.
        at: (n,) where the others are held, and the start point.
        box: The window or the joints' own limits, as right, top, left, low half-planes.
        limits: Limits of further joints, followers or not, that bind the two.
        strips: Boundaries of one effective angle in the plane.
        curves: Boundaries of several.
        fixed: Held coordinates that some boundary or limit depends on.
        margin: [m] added to every threshold.
    """

    robot: Robot
    coordinates: tuple[str, str]
    at: Array
    box: tuple[HalfPlane, ...]
    limits: tuple[HalfPlane, ...]
    strips: tuple[Strips, ...]
    curves: tuple[Curve, ...]
    fixed: tuple[str, ...]
    margin: float

    @cached_property
    def start(self) -> Array:
        """(2,) the start point."""
        return self.at[[self.robot.coordinates.index(name) for name in self.coordinates]]

    @cached_property
    def window(self) -> Array:
        """(2, 2), rows lower and upper: the box."""
        right, top, left, low = self.box
        return np.array([[-left.bound, -low.bound], [right.bound, top.bound]])

    def lift(self, X: Array) -> Array:
        """Return configurations (N, n) of points (N, 2)."""
        Q = np.tile(self.at, (len(X), 1))
        Q[:, [self.robot.coordinates.index(name) for name in self.coordinates]] = X
        return Q

    def free(self, X: Array) -> Bools:
        """Return whether points (N, 2) are within all limits and out of all contacts, by the exact functions."""
        found = np.ones(len(X), dtype=bool)
        for plane in (*self.box, *self.limits):
            found &= X @ plane.normal < plane.bound
        for contact in (*self.strips, *self.curves):
            found &= contact.free(X)
        return found


def plane_of(
    robot: Robot,
    coordinates: Sequence[str] | None,
    start: Array,
    window: Mapping[str, tuple[float, float]],
    margin: float = 0.0,
) -> Plane:
    """Return the plane of two coordinates through a start point, checked to be free.

    Args:
        robot: The robot.
        coordinates: The two coordinates; None: those that the boundaries use.
        start: (n,) finite.
        window: Ends by coordinate [rad or m].
        margin: [m] added to every threshold.

    Raises:
        UnknownNameError: If the robot has no such coordinate.
        UnsupportedError: If there are not two coordinates.
        DimensionError: If a coordinate is without limits, or the start is in contact or out of limits.
    """
    names = _two_coordinates(robot, coordinates)
    indices = [robot.coordinates.index(name) for name in names]
    used = {robot.coordinates.index(name) for boundary in robot.boundaries for name in boundary.coordinates}
    limits: list[HalfPlane] = []
    for limit in robot.linear_limits:
        c = limit.coefficients[indices]
        if not np.any(c):
            continue
        used |= set(np.flatnonzero(limit.coefficients).tolist())
        rest = limit.offset + float(limit.coefficients @ start) - float(c @ start[indices])
        limits += _slab(limit.joint, c, limit.lower - rest, limit.upper - rest)
    strips: list[Strips] = []
    curves: list[Curve] = []
    for boundary in robot.boundaries:
        for contact in _contacts(boundary, start, indices, margin):
            if isinstance(contact, Strips):
                strips.append(contact)
            else:
                curves.append(contact)
    fixed = tuple(robot.coordinates[index] for index in sorted(used - set(indices)))
    box = _box(robot, names, window)
    plane = Plane(robot, names, start, box, tuple(limits), tuple(strips), tuple(curves), fixed, margin)
    _check_start(plane)
    return plane


def _two_coordinates(robot: Robot, coordinates: Sequence[str] | None) -> tuple[str, str]:
    used = {name for boundary in robot.boundaries for name in boundary.coordinates}
    names = tuple(name for name in robot.coordinates if name in used) if coordinates is None else tuple(coordinates)
    for name in names:
        if name not in robot.coordinates:
            raise UnknownNameError("coordinate", name, robot.coordinates)
    if len(names) != _PLANE or names[0] == names[1]:
        whose = "the boundaries use" if coordinates is None else "you gave"
        listed = ", ".join(names) or "none"
        raise UnsupportedError(
            f"a planar region needs two coordinates, and {whose} {len(names)} ({listed}); "
            f"give coordinates=(..., ...) out of: {', '.join(robot.coordinates)}"
        )
    return names[0], names[1]


def _box(robot: Robot, names: Sequence[str], window: Mapping[str, tuple[float, float]]) -> tuple[HalfPlane, ...]:
    """Return the box of the two coordinates: window, or joint limits; in the order right, top, left, low."""
    for name in window:
        if name not in names:
            raise UnknownNameError("coordinate of the window", name, names)
    planes: list[HalfPlane] = []
    for axis, name in enumerate(names):
        index = robot.coordinates.index(name)
        own = (float(robot.lower[index]), float(robot.upper[index]))
        given = window.get(name, own)
        lower, upper = max(own[0], given[0]), min(own[1], given[1])
        if not math.isfinite(lower) or not math.isfinite(upper):
            raise DimensionError(f"{name!r} has no limits; give window={{{name!r}: (lower, upper)}} around the start")
        if not lower < upper:
            raise DimensionError(f"{name!r} has no room: its window and limits leave [{lower}, {upper}]")
        planes += _slab(name, np.eye(_PLANE)[axis], lower, upper)
    return planes[0], planes[2], planes[1], planes[3]


def _slab(source: str, normal: Array, lower: float, upper: float) -> list[HalfPlane]:
    """Return `normal @ x <= upper` and `normal @ x >= lower`, those of the two that are finite."""
    sides = ((f"{source} upper", normal, upper), (f"{source} lower", -normal, -lower))
    return [HalfPlane(source, name, n, bound, False) for name, n, bound in sides if math.isfinite(bound)]


def _contacts(
    boundary: Boundary, start: Array, indices: Sequence[int], margin: float
) -> tuple[Strips, ...] | tuple[Curve, ...]:
    """Return what a boundary is in the plane; nothing if it never comes into contact there."""
    rule = boundary.rule
    whole = rule.strips(margin)
    if whole is not None:  # one effective angle in the robot: its contact angles, moved by what is held
        coefficients, strips = whole
        normal = coefficients[list(indices)]
        if np.any(normal):
            rest = float(coefficients @ start) - float(normal @ start[list(indices)])
            return tuple(
                Strips(boundary.name, normal, s.angle - rest, s.half_width) for s in strips if s.half_width is not None
            )
    path, distance = restrict_path(boundary.path, start, indices), rule.raised(margin)
    if not path.minimal.coordinates:
        value = float(rule.signed(start[None])[0]) - (distance - rule.distance if rule.stop is None else margin)
        if not value > 0.0:
            raise DimensionError(f"the start point is not free: {boundary.name!r} is in contact")
        return ()
    found = one_angle_strips(path, distance, 0.0)
    if found is None:
        return (Curve(boundary.name, path, distance),)
    normal, strips = found
    return tuple(Strips(boundary.name, normal, s.angle, s.half_width) for s in strips if s.half_width is not None)


def _check_start(plane: Plane) -> None:
    """Raise if the start is not free, and say what forbids it."""
    start = plane.start
    where = f"the start point {start.tolist()} is not free"
    for limit in (*plane.box, *plane.limits):
        if float(limit.normal @ start) >= limit.bound:
            raise DimensionError(f"{where}: {limit.name!r} forbids it; start inside all limits")
    for contact in (*plane.strips, *plane.curves):
        if not contact.free(start[None])[0]:
            raise DimensionError(f"{where}: {contact.name!r} is in contact; start out of contact")
    for boundary in plane.robot.boundaries:
        if boundary.parts(plane.robot.home, plane.at):
            raise DimensionError(
                f"{where}: a contact of {boundary.name!r} lies between it and home; start on home's side"
            )
