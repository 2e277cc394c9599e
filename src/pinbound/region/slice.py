"""A slice of two coordinates: its limits and contacts, and which of its points are free.

With the other coordinates fixed, each boundary is one of three things in the slice, after its chain has been reduced
again (`path/restriction`):

    constant:   it does not depend on the two coordinates; it must be free at the values of the others;
    strip:      one effective angle; contact is `c . x in [phi* - w, phi* + w]`, every turn: straight lines, exact;
    curve:      anything else; contact is `|r(x)| <= T`, with the distance T of the contact rule (`pinbound.contact`).

The strip of a stop has zero width: it is a line that cuts the slice. A curve's T is at least the contact tolerance. The
reason: two points with zero threshold would meet only in isolated points of the slice, and data are rounded. So a disc
is kept around each such point.

The slice is closed at limits and open at contacts: a point belongs to it if it passes no limit by more than
`tolerances.LIMIT`, and is in no contact.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pinbound.boundaries.boundary import Boundary
from pinbound.boundaries.looped import over_z
from pinbound.checks import names_of
from pinbound.evaluate import separation
from pinbound.exceptions import DimensionError, UnknownNameError, UnsupportedError
from pinbound.limits.univariate import gap_around, one_angle_strips
from pinbound.loops.through_loops import Contact, LiftedPlane, LoopContact, LoopLimit
from pinbound.model.coupling import Intervals
from pinbound.path.restriction import restrict_path
from pinbound.region.halfplanes import HalfPlane
from pinbound.region.loop_slice import curves_through, lifted_plane, moved_columns, over
from pinbound.region.obstacles import Obstacle, obstacle_of
from pinbound.region.window import box_of, slab
from pinbound.robot.loop_robot import LoopRobot
from pinbound.robot.robot import Robot
from pinbound.typing import Array, Flags
from pinbound.values import Value, read_only

__all__ = ["Curve", "Slice", "Strips", "slice_of"]

_PLANE = 2
_TURN = 2.0 * math.pi


@dataclass(frozen=True, eq=False)
class Strips(Value):
    """Contact of a boundary of one effective angle in the slice.

    Attributes:
        name: The boundary.
        normal: (2,) c.
        angle: phi* [rad].
        half_width: w [rad], 0 for a line that cuts the slice.
    """

    name: str
    normal: Array
    angle: float
    half_width: float

    def free(self, X: Array) -> Flags:
        """Return whether points (N, 2) are out of contact; a line of zero width contains no point."""
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


@dataclass(frozen=True, eq=False)
class Curve(Contact):
    """Contact `|r(x)| <= threshold` of a boundary of several effective angles; its path is over the two coordinates."""

    def free(self, X: Array) -> Flags:
        """Return whether points (N, 2) are out of contact."""
        return separation.separations(self.path, X) > self.threshold


@dataclass(frozen=True, eq=False)
class Slice(Value):
    """Two coordinates of a robot, with the others fixed, and all limits and contacts in their plane.

    Attributes:
        robot: The robot.
        coordinates: The two coordinates.
        at: (n,) the values of the others, and the start point.
        box: The bounds of each coordinate alone, as right, top, left, low half-planes: its joint's limit, the limit of
            a mimic joint, or the window, whichever is tightest.
        limits: All other limits of joints, also of mimic joints, that depend on the two.
        strips: Boundaries of one effective angle in the slice.
        curves: Boundaries of several; and boundaries, limits and rules through loops that are not parallelograms.
        fixed: Fixed coordinates on which a boundary or limit depends.
        margin: [m] added to every threshold.
        obstacles: The sets that rules with conditions forbid.
        lifted: The map from points of the slice through loops that are not parallelograms, if its coordinates move any.
    """

    robot: Robot
    coordinates: tuple[str, str]
    at: Array
    box: tuple[HalfPlane, ...]
    limits: tuple[HalfPlane, ...]
    strips: tuple[Strips, ...]
    curves: tuple[Curve | LoopContact | LoopLimit, ...]
    fixed: tuple[str, ...]
    margin: float
    obstacles: tuple[Obstacle, ...] = ()
    lifted: LiftedPlane | None = None

    @cached_property
    def start(self) -> Array:
        """(2,) the start point."""
        return read_only(self.at[[self.robot.coordinates.index(name) for name in self.coordinates]])

    @cached_property
    def window(self) -> Array:
        """(2, 2), rows lower and upper: the box."""
        return read_only(_ends(self.box))

    @cached_property
    def units(self) -> tuple[str, str]:
        """The unit of each coordinate: ``"rad"``, or ``"m"`` for a prismatic joint."""
        first, second = ("rad" if self.robot.turns(name) else "m" for name in self.coordinates)
        return first, second

    @cached_property
    def scales(self) -> Array:
        """(2,) the length [rad or m] to which accuracies of each coordinate are relative.

        It is one, or the width of the window if that is less, rounded down to a power of two so that scaling is exact.
        """
        width = self.window[1] - self.window[0]
        return read_only(np.minimum(1.0, np.exp2(np.floor(np.log2(width)))))

    def lift(self, X: Array) -> Array:
        """Return configurations (N, n) of points (N, 2)."""
        Q = np.tile(self.at, (len(X), 1))
        Q[:, [self.robot.coordinates.index(name) for name in self.coordinates]] = X
        return Q

    @cached_property
    def _intervals(self) -> Intervals:
        return self.robot.intervals

    def keeps_held(self, Q: Array) -> Flags:
        """Return which configurations (N, n) keep all limits that do not depend on the slice's two coordinates."""
        indices = [self.robot.coordinates.index(name) for name in self.coordinates]
        whole, moved = over(self.robot, self.at)[0], moved_columns(self.robot, indices)
        moved[indices] = True
        Z, found = over(self.robot, Q)[1], np.ones(len(Q), dtype=np.bool_)
        for limit in whole.linear_limits:
            if not np.any(limit.coefficients[moved]):
                found &= limit.holds(Z)
        for one in whole.guarded_limits:
            if not np.any(one.uses[moved]):
                found &= one.holds(Z)
        return found

    def users(self, index: int) -> list[str]:
        """Return the boundaries, rules and limits that depend on a coordinate of q, as text."""
        whole = over(self.robot, self.at)[0]
        found = [one.name for one in self.robot.boundaries if self.robot.coordinates[index] in one.coordinates]
        rules = [one for one in whole.guarded_limits if index in _inputs(self.robot, one.uses)]
        limits = [one for one in whole.linear_limits if index in _inputs(self.robot, one.coefficients)]
        return found + [f"the rule {one.rule}" for one in rules] + [f"the limit of {one.joint}" for one in limits]

    def within(self, X: Array) -> Flags:
        """Return whether points (N, 2) keep the limits of all joints, by the one rule (`Intervals`), and the window."""
        found = self._intervals.hold(self.lift(X))
        for side in (*self.box, *self.limits):
            found &= side.allows(X)
        return found

    def free(self, X: Array) -> Flags:
        """Return whether points (N, 2) are within all limits and out of all contacts, by the exact functions."""
        found = self.within(X)
        for contact in (*self.strips, *self.curves):
            found &= contact.free(X)
        return found


def _ends(box: Sequence[HalfPlane]) -> Array:
    """Return the box, rows lower and upper (2, 2)."""
    ends = [side.bound / float(side.normal[index % 2]) for index, side in enumerate(box)]
    return np.array([[ends[2], ends[3]], [ends[0], ends[1]]])


def _half_planes(whole: Robot, place: Array, indices: Sequence[int], moved: Flags) -> list[HalfPlane]:
    """Return the limits that depend on the slice's two coordinates without loops."""
    found: list[HalfPlane] = []
    for limit in whole.linear_limits:
        c = limit.coefficients[list(indices)]
        if np.any(c) and not np.any(limit.coefficients[moved]):
            rest = limit.offset + float(limit.coefficients @ place) - float(c @ place[list(indices)])
            found += slab(limit.joint, c, limit.lower - rest, limit.upper - rest)
    return found


def _of_the_plane(whole: Robot, moving: Flags) -> list[Array | Flags]:
    """Return the coefficients of each limit that depends on the slice, and of each guarded limit."""
    limits = [one.coefficients for one in whole.linear_limits if np.any(one.coefficients[moving])]
    return [*limits, *(one.uses for one in whole.guarded_limits)]


def _inputs(robot: Robot, uses: Array | Flags) -> set[int]:
    """Return the coordinates of q behind used coordinates, given as flags or coefficients of q (n,) or z (n + k,)."""
    used = set(np.flatnonzero(uses).tolist())
    if isinstance(robot, LoopRobot):
        for one, columns in zip(reversed(robot.lift.linkages), reversed(robot.lift.columns), strict=True):
            if used & set(columns):
                used |= set(one.inputs)
    return {index for index in used if index < len(robot.coordinates)}


def slice_of(
    robot: Robot,
    coordinates: Sequence[str] | None,
    start: Array,
    window: Mapping[str, tuple[float, float]],
    margin: float = 0.0,
) -> Slice:
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
    _check_limits(robot, start)
    _check_rules(robot, start)
    indices = [robot.coordinates.index(name) for name in names]
    used = {robot.coordinates.index(name) for boundary in robot.boundaries for name in boundary.coordinates}
    whole, place = over(robot, start)
    moved = moved_columns(robot, indices)
    limits = _half_planes(whole, place, indices, moved)
    obstacles: list[Obstacle] = []
    for one in whole.guarded_limits:
        if np.any(one.uses[moved]):
            continue
        found = obstacle_of(one, place, indices, whole.coordinates)
        if isinstance(found, Obstacle):
            obstacles.append(found)
        else:
            limits += found
    for uses in _of_the_plane(whole, np.isin(np.arange(len(moved)), indices) | moved):
        used |= _inputs(robot, uses)
    box = box_of(names, limits, window)
    strips: list[Strips] = []
    curves: list[Curve | LoopContact | LoopLimit] = []
    through = [b for b in robot.boundaries if np.any(moved[list(over_z(b).path.minimal.coordinates)])]
    for boundary in robot.boundaries:
        if any(boundary is one for one in through):
            continue
        for contact in _contacts(over_z(boundary), place, indices, margin):
            if isinstance(contact, Strips):
                strips.append(contact)
            else:
                curves.append(contact)
    plane: LiftedPlane | None = None
    if isinstance(robot, LoopRobot) and np.any(moved):
        plane = lifted_plane(robot, start, indices, _ends(box))
        curves += curves_through(robot, moved, through, plane, margin)
    fixed = tuple(robot.coordinates[index] for index in sorted(used - set(indices)))
    others = tuple(limit for limit in limits if not any(limit is side for side in box))
    slice_ = Slice(
        robot, names, start, box, others, tuple(strips), tuple(curves), fixed, margin, tuple(obstacles), plane
    )
    _check_start(slice_)
    return slice_


def _two_coordinates(robot: Robot, coordinates: Sequence[str] | None) -> tuple[str, str]:
    used = {name for boundary in robot.boundaries for name in boundary.coordinates}
    if coordinates is None:
        names = tuple(name for name in robot.coordinates if name in used)
        if len(robot.coordinates) == _PLANE:  # there is but one plane, whatever the boundaries use
            names = robot.coordinates
    elif isinstance(coordinates, str):
        raise UnsupportedError(
            f"a planar region needs two coordinates, and you gave the text {coordinates!r}; "
            f"give coordinates=(..., ...), two names out of: {', '.join(robot.coordinates)}"
        )
    else:
        names = names_of(coordinates, "coordinates")
    for name in names:
        if name in robot.coordinates:
            continue
        if name in robot.coupling.joints:
            raise UnsupportedError(
                f"{name!r} is not an active coordinate: it is a mimic joint, {robot.coupling.text(name)}; "
                f"give coordinates=(..., ...) out of: {', '.join(robot.coordinates)}"
            )
        raise UnknownNameError("coordinate", name, robot.coordinates)
    if len(names) != _PLANE or names[0] == names[1]:
        whose = "the boundaries use" if coordinates is None else "you gave"
        listed = ", ".join(names) or "none"
        raise UnsupportedError(
            f"a planar region needs two coordinates, and {whose} {len(set(names))} ({listed}); "
            f"give coordinates=(..., ...) out of: {', '.join(robot.coordinates)}"
        )
    return names[0], names[1]


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
            raise DimensionError(f"the start point is not free: {boundary.name!r} is in contact; start out of contact")
        return ()
    found = one_angle_strips(path, distance, 0.0)
    if found is None:
        return (Curve(boundary.name, path, distance),)
    normal, strips = found
    return tuple(Strips(boundary.name, normal, s.angle, s.half_width) for s in strips if s.half_width is not None)


def _check_limits(robot: Robot, start: Array) -> None:
    """Raise if the start is out of the limits of any joint, mimic joints and held coordinates included."""
    whole, place = over(robot, start)
    for limit in whole.linear_limits:
        if not limit.holds(place[None])[0]:
            theta = float(limit.values(place[None])[0])
            what = limit.joint
            if what not in robot.coordinates and what in robot.coupling.joints:
                what += f" = {robot.coupling.text(limit.joint)}"
            raise DimensionError(
                f"the start point {start.tolist()} is out of limits: {what} is {theta:.9g} there, and the limits of "
                f"{limit.joint!r} are [{limit.lower:.9g}, {limit.upper:.9g}]; start within all limits"
            )


def _check_rules(robot: Robot, start: Array) -> None:
    whole, place = over(robot, start)
    for one in whole.guarded_limits:
        if not one.holds(place[None])[0]:
            raise DimensionError(
                f"the start point {start.tolist()} is out of limits: the rule {one.rule!r} forbids it, for its "
                f"conditions hold there and its sum is {float(one.limit.values(place[None])[0]):.9g}; start elsewhere"
            )


def _check_start(slice_: Slice) -> None:
    """Raise if the start is not free, and say what forbids it."""
    start = slice_.start
    where = f"the start point {start.tolist()} is not free"
    for limit in (*slice_.box, *slice_.limits):
        if not limit.allows(start[None])[0]:
            raise DimensionError(f"{where}: {limit.name!r} forbids it; start within all limits and the window")
    for contact in (*slice_.strips, *slice_.curves):
        if not contact.free(start[None])[0]:
            raise DimensionError(f"{where}: {contact.name!r} is in contact; start out of contact")
    for boundary in slice_.robot.boundaries:
        if boundary.parts(slice_.robot.home, slice_.at):
            raise DimensionError(
                f"{where}: a contact of {boundary.name!r} lies between it and home; start on home's side"
            )
