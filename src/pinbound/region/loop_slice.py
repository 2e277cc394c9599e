"""What bounds a plane through loops that are no parallelograms, told apart from what stays linear in the plane.

The robot over z is an ordinary one (`docs/loops.md`). A limit, a rule or a boundary of it is through a loop in a plane
if it uses a coordinate of z that the plane's two move; anything else is as it would be without loops.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from pinbound.boundaries.boundary import Boundary
from pinbound.boundaries.looped import over_z
from pinbound.certificates.lifted import loop_errors
from pinbound.exceptions import DimensionError
from pinbound.limits.univariate import gap_around
from pinbound.model.coupling import GuardedLimit, LinearLimit
from pinbound.region.through_loops import LiftedPlane, LoopContact, LoopLimit
from pinbound.robot.loop_robot import LoopRobot
from pinbound.robot.robot import Robot
from pinbound.typing import Array, Flags

__all__ = [
    "contacts_through",
    "is_needless",
    "lifted_plane",
    "limits_through",
    "moved_columns",
    "over",
    "rules_through",
]


def over(robot: Robot, q: Array) -> tuple[Robot, Array]:
    """Return a robot whose limits and paths are linear in its coordinates, and q in them: itself, or the one over z."""
    return (robot.opened, robot.lift(q)) if isinstance(robot, LoopRobot) else (robot, q)


def moved_columns(robot: Robot, indices: Sequence[int]) -> Flags:
    """Return which coordinates of `over` follow the plane's two through a loop."""
    found = np.zeros(len(over(robot, robot.home)[0].coordinates), dtype=np.bool_)
    if isinstance(robot, LoopRobot):
        moves = set(indices)
        for one, columns in zip(robot.lift.linkages, robot.lift.columns, strict=True):
            if moves & set(one.inputs):
                moves |= set(columns)
                found[list(columns)] = True
    return found


def is_needless(robot: Robot, limit: LinearLimit) -> bool:
    """Return whether a transmission's limit is said otherwise: in closed form over q, or of a turn by its cut."""
    n = len(robot.coordinates)
    if not isinstance(robot, LoopRobot) or limit.joint not in robot.lift.toggle_names():
        return False
    if any(limit.joint == robot.lift.names[index] for columns in robot.lift.columns for index in columns[3:]):
        return True
    same = [one for one in robot.opened.linear_limits if one.joint == limit.joint and one is not limit]
    return bool(np.any(limit.coefficients[n:])) and any(not np.any(one.coefficients[n:]) for one in same)


def curves_through(
    robot: LoopRobot, moved: Flags, boundaries: Iterable[Boundary], plane: LiftedPlane, margin: float
) -> list[LoopContact | LoopLimit]:
    """Return all that bounds a plane through loops: limits, rules, and these boundaries."""
    whole = robot.opened
    found: list[LoopContact | LoopLimit] = []
    for limit in whole.linear_limits:
        if np.any(limit.coefficients[moved]) and not is_needless(robot, limit):
            found += limits_through(limit, plane)
    found += rules_through([one for one in whole.guarded_limits if np.any(one.uses[moved])], plane)
    for boundary in boundaries:
        found += contacts_through(boundary, plane, margin)
    return found


def lifted_plane(robot: LoopRobot, at: Array, indices: Sequence[int], window: Array) -> LiftedPlane:
    """Return what takes points of a plane to z, with what rounding leaves of its loops in a window (2, 2)."""
    lower, upper = at.copy(), at.copy()
    lower[list(indices)], upper[list(indices)] = window
    errors = loop_errors(robot, lower, upper, 1)
    return LiftedPlane(robot.lift, at, (indices[0], indices[1]), tuple(errors.tolist()))


def limits_through(limit: LinearLimit, plane: LiftedPlane) -> list[LoopLimit]:
    """Return both ends of a limit over z, those that are finite."""
    c, o = limit.coefficients, limit.offset
    ends = (("upper", c, limit.upper - o), ("lower", -c, o - limit.lower))
    return [
        LoopLimit(f"{limit.joint} {name}", limit.joint, row[None], np.array([end]), plane)
        for name, row, end in ends
        if math.isfinite(end)
    ]


def rules_through(guarded: Iterable[GuardedLimit], plane: LiftedPlane) -> list[LoopLimit]:
    """Return guarded ends over z: allowed where the end is kept, or a condition does not hold."""
    found: list[LoopLimit] = []
    for one in guarded:
        rows: list[Array] = []
        ends: list[float] = []
        for limit, sign in ((one.limit, 1.0), *((condition, -1.0) for condition in one.where)):
            for row, end in (
                (limit.coefficients, limit.upper - limit.offset),
                (-limit.coefficients, limit.offset - limit.lower),
            ):
                if math.isfinite(end):
                    rows.append(sign * row)
                    ends.append(sign * end)
        found.append(LoopLimit(one.name, one.rule, np.array(rows), np.array(ends), plane))
    return found


def contacts_through(boundary: Boundary, plane: LiftedPlane, margin: float) -> list[LoopContact | LoopLimit]:
    """Return the contact of a boundary through loops: of a stop both ends of home's gap, which are linear in z.

    Raises:
        DimensionError: If a stop's gap is narrower than twice the margin.
    """
    opened = over_z(boundary)
    rule = opened.rule
    if rule.stop is None:
        return [LoopContact(boundary.name, opened.path, rule.raised(margin), plane)]
    strips = rule.strips(margin)
    assert strips is not None
    c, (strip, *_) = strips
    assert strip.half_width is not None
    low, high = gap_around(strip.angle, strip.half_width, 0.5 * (rule.stop.gap[0] + rule.stop.gap[1]))
    if not low < high:
        raise DimensionError(f"the margin leaves nothing of the gap of {boundary.name!r}; give a smaller margin")
    return [
        LoopLimit(boundary.name, boundary.name, row[None], np.array([end]), plane, is_contact=True)
        for row, end in ((c, high), (-c, -low))
    ]
