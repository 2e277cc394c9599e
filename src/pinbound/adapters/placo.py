"""placo: convex sets of q as its joint-space half-spaces. placo itself is not imported: it brings its own Pinocchio.

A, b = pinbound.adapters.placo.half_spaces(robot, placo_robot, region)
solver.add_joint_space_half_spaces_constraint(A, b).configure("region", "hard", 1.0)
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pinbound.adapters.shared import half_spaces_of
from pinbound.exceptions import UnsupportedError
from pinbound.robot.robot import Robot
from pinbound.typing import Array

__all__ = ["half_spaces"]


def half_spaces(robot: Robot, wrapper: Any, A: Any, b: ArrayLike | None = None) -> tuple[Array, Array]:
    """Return A (k, len(wrapper.state.q)) and b (k,) of `A q <= b`, for q in placo's order.

    A has a column for every entry of placo's q. The seven columns of its floating base are zero. Columns of mimic
    joints are zero, too: placo must move them with their primaries.

    Args:
        robot: The robot.
        wrapper: A `placo.RobotWrapper` of the same URDF; `state.q` and `get_joint_offset(name)` are used.
        A: A convex `Region` of all coordinates that boundaries depend on, or (k, n) for the robot's q.
        b: (k,), if A is an array.

    Raises:
        UnsupportedError: If the region is not convex, or boundaries depend on coordinates that it fixes; or a row uses
            a continuous joint, which placo stores as cos and sin.
        DimensionError: If A and b do not fit.
    """
    rows, bound = half_spaces_of(robot, A, b)
    endless = {joint.name for joint in robot.tree.moving_joints if joint.type == "continuous"}
    found = np.zeros((len(rows), len(wrapper.state.q)))
    for column, name in enumerate(robot.coordinates):
        if not np.any(rows[:, column]):
            continue
        if name in endless:
            said = f"joint {name!r} is continuous, and placo stores its cos and sin"
            raise UnsupportedError(f"{said}: a linear row cannot bound the angle. Make the joint revolute, with limits")
        found[:, int(wrapper.get_joint_offset(name))] = rows[:, column]
    return found, bound
