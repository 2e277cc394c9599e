"""The limits and boundaries of a slice that go through loops that are not parallelograms, and those that do not.

The robot over z is an ordinary robot (`docs/loops.md`). One of its limits, rules or boundaries goes through a loop if
it uses a coordinate of z that the slice's two coordinates move through the loop. All others are as they would be
without loops.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from pinbound.boundaries.boundary import Boundary
from pinbound.boundaries.looped import over_z
from pinbound.certificates.lifted import loop_errors
from pinbound.loops.through_loops import (
    LiftedPlane,
    LoopContact,
    LoopLimit,
    contacts_through,
    limits_through,
    rules_through,
)
from pinbound.model.coupling import LinearLimit
from pinbound.robot.loop_robot import LoopRobot
from pinbound.robot.robot import Robot
from pinbound.typing import Array, Flags

__all__ = ["curves_through", "is_needless", "lifted_plane", "moved_columns", "over"]


def over(robot: Robot, q: Array) -> tuple[Robot, Array]:
    """Return a robot whose limits and paths are linear in its coordinates (itself, or the one over z), and its q."""
    return (robot.opened, robot.lift(q)) if isinstance(robot, LoopRobot) else (robot, q)


def moved_columns(robot: Robot, indices: Sequence[int]) -> Flags:
    """Return which coordinates of `over` depend on the slice's two coordinates through a loop."""
    found = np.zeros(len(over(robot, robot.home)[0].coordinates), dtype=np.bool_)
    if isinstance(robot, LoopRobot):
        moves = set(indices)
        for one, columns in zip(robot.lift.linkages, robot.lift.columns, strict=True):
            if moves & set(one.inputs):
                moves |= set(columns)
                found[list(columns)] = True
    return found


def is_needless(robot: Robot, limit: LinearLimit) -> bool:
    """Return whether a transmission's limit has another form: a closed form over q, or the cut of a turn."""
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
    """Return all limits, rules, and boundaries of these that bound a slice through loops."""
    whole = robot.opened
    found: list[LoopContact | LoopLimit] = []
    for limit in whole.linear_limits:
        if np.any(limit.coefficients[moved]) and not is_needless(robot, limit):
            found += limits_through(limit, plane)
    found += rules_through([one for one in whole.guarded_limits if np.any(one.uses[moved])], plane)
    for boundary in boundaries:
        found += contacts_through(boundary.name, over_z(boundary).rule, plane, margin)
    return found


def lifted_plane(robot: LoopRobot, at: Array, indices: Sequence[int], window: Array) -> LiftedPlane:
    """Return the map from points of the slice to z, with the rounding of its loops in a window (2, 2)."""
    lower, upper = at.copy(), at.copy()
    lower[list(indices)], upper[list(indices)] = window
    errors = loop_errors(robot, lower, upper, 1)
    return LiftedPlane(robot.lift, at, (indices[0], indices[1]), tuple(errors.tolist()))
