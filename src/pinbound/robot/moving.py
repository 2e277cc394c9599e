"""Marks that move from call to call: a box on a conveyor, a sphere around a person, a growing pallet.

A mark on the root link is fixed to the world. `MovingMarks` places such marks at new poses in each call. Only the
boundaries of moved marks are reduced again, with the rules of `load`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pinbound.annotations import BoundaryMark, Mark
from pinbound.boundaries.boundary import Boundary
from pinbound.boundaries.boundary_set import BoundarySet
from pinbound.exceptions import DimensionError, UnknownNameError, UnsupportedError
from pinbound.geometry.rotations import matrix_rpy, rpy_matrix
from pinbound.loops.closures import place_error
from pinbound.model.coupling import real_array
from pinbound.path.relative import relative_path
from pinbound.robot.robot import Robot
from pinbound.tolerances import SAME_ROBOT
from pinbound.typing import Array

__all__ = ["MovingMarks", "moved_mark"]


def moved_mark(mark: Mark, pose: ArrayLike) -> Mark:
    """Return a mark, transformed by a pose in the frame of its link.

    Args:
        mark: The mark.
        pose: (4, 4) or (3, 4): rotation, and translation [m].

    Raises:
        DimensionError: If the pose is not a rigid transform.

    Example:
        >>> turned = [[0.0, -1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.5]]
        >>> from pinbound.annotations import Point
        >>> moved_mark(Point("p", "base", (1.0, 2.0, 3.0)), turned).xyz
        (-2.0, 1.0, 3.5)
    """
    R, p = _checked(pose)

    def point(xyz: Any) -> tuple[float, float, float]:
        x, y, z = (R @ np.array(xyz, dtype=np.float64) + p).tolist()
        return x, y, z

    def way(vector: Any) -> tuple[float, float, float]:
        x, y, z = (R @ np.array(vector, dtype=np.float64)).tolist()
        return x, y, z

    changed: dict[str, Any] = {}
    for name in (field.name for field in fields(mark)):
        value = getattr(mark, name)
        if name in _POINTS:
            changed[name] = point(value)
        elif name in _DIRECTIONS:
            changed[name] = way(value)
        elif name == "vertices":
            changed[name] = tuple(map(point, value))
        elif name == "ways":
            changed[name] = tuple(map(way, value))
        elif name == "rpy":
            changed[name] = matrix_rpy(R @ rpy_matrix(value))
    return replace(mark, **changed)


_POINTS, _DIRECTIONS = ("xyz", "xyz_a", "xyz_b"), ("direction", "normal")
"""Fields of marks that are points, and fields that are vectors; `vertices` and `ways` hold several of them."""


def _checked(pose: ArrayLike) -> tuple[Array, Array]:
    given = real_array(pose, "pose")
    if given.shape not in ((4, 4), (3, 4)) or not np.all(np.isfinite(given)):
        raise DimensionError(f"a pose has shape {given.shape}; give finite numbers (4, 4): a rotation, and metres")
    R = given[:3, :3]
    if np.abs(R @ R.T - np.eye(3)).max() > SAME_ROBOT or np.linalg.det(R) < 0.0:
        raise DimensionError("the rotation part of a pose is not a rotation; give an orthonormal right-handed matrix")
    return R, given[:3, 3]


class MovingMarks:
    """Boundaries between a robot's marks and marks of the world that move from call to call.

    Example:
        >>> import pinbound as pb, numpy as np
        >>> robot = pb.load("minervabot_v3")
        >>> tool = pb.Point("tool", "link_6", (0.0, 0.0, 0.0), radius=0.01)
        >>> robot = robot.with_annotations(pb.Annotations.of([tool], []))
        >>> parcel = pb.Box("parcel", "base_link", (0.3, 0.0, 0.0), (0.0, 0.0, 0.0), (0.1, 0.1, 0.1))
        >>> moving = pb.MovingMarks(robot, [parcel], [pb.BoundaryMark("tool_parcel", "tool", "parcel")])
        >>> pose = np.eye(4)
        >>> pose[0, 3] = -0.12  # on its conveyor
        >>> moving.at({}).signed_clearances(robot.home).round(4), moving.at({"parcel": pose}).free(robot.home)
        (array([0.1457]), True)
    """

    def __init__(self, robot: Robot, marks: Sequence[Mark], boundaries: Sequence[BoundaryMark]) -> None:
        """Take marks of the world, at the poses of no movement, and boundaries between them and marks of the robot.

        Args:
            robot: The robot; `with_annotations` gives it marks of its own.
            marks: Marks on the root link.
            boundaries: Each between one of `marks` and a mark of the robot.

        Raises:
            UnknownNameError: If a boundary names no mark.
            UnsupportedError: If a mark is not on the root link, or a boundary is a stop or does not join one of each.
        """
        self.robot, self.marks = robot, {mark.name: mark for mark in marks}
        known = robot.annotations.marks
        for mark in marks:
            if mark.link != robot.tree.root:
                said = f"mark {mark.name!r} is on {mark.link!r}, and moves with it already"
                raise UnsupportedError(f"{said}; put it on the root link, {robot.tree.root!r}")
            if mark.name in known:
                raise DimensionError(f"the robot has a mark {mark.name!r} already; give it another name")
        for one in boundaries:
            for name in (one.a, one.b):
                if name not in self.marks and name not in known:
                    raise UnknownNameError("mark", name, [*self.marks, *known])
            if one.stop or (one.a in self.marks) == (one.b in self.marks):
                said = f"boundary {one.name!r} is a stop, or does not lead from a mark of the robot to one that moves"
                raise UnsupportedError(f"{said}; name one of each, or use with_annotations")
        self._boundaries = tuple(boundaries)
        self._kept: dict[str, tuple[bytes, Mark]] = {}
        self._made: dict[str, tuple[Mark, Boundary]] = {}

    def at(self, poses: Mapping[str, ArrayLike]) -> BoundarySet:
        """Return a `BoundarySet` with the marks at their poses.

        Contact is allowed, also at home, because an object on a conveyor may be anywhere.

        Args:
            poses: The pose (4, 4) or (3, 4) of each moved mark, in the frame of the root link, relative to where it was
                given. Marks without a pose stay where they were given.

        Raises:
            UnknownNameError: If a pose names a mark that does not exist.
            DimensionError: If a pose is not a rigid transform.
        """
        for name in poses:
            if name not in self.marks:
                raise UnknownNameError("mark that moves", name, self.marks)
        placed = {name: self._placed(name, poses.get(name)) for name in self.marks}
        made = [self._boundary(one, placed) for one in self._boundaries]
        robot = self.robot
        return BoundarySet(made, robot.coordinates, robot.linear_limits, robot.home, guarded=robot.guarded_limits)

    def _placed(self, name: str, pose: ArrayLike | None) -> Mark:
        if pose is None:
            return self.marks[name]
        key = real_array(pose, "pose").tobytes()
        if name not in self._kept or self._kept[name][0] != key:
            self._kept[name] = key, moved_mark(self.marks[name], pose)
        return self._kept[name][1]

    def _boundary(self, one: BoundaryMark, placed: Mapping[str, Mark]) -> Boundary:
        robot, known = self.robot, self.robot.annotations.marks
        a, b = (placed[name] if name in placed else known[name] for name in (one.a, one.b))
        moving = a if one.a in placed else b
        if one.name in self._made and self._made[one.name][0] is moving:
            return self._made[one.name][1]
        found = Boundary(
            name=one.name,
            point_a=a,
            point_b=b,
            min_distance=one.min_distance,
            path=relative_path(robot.tree, robot.coupling, a, b),
            robot_coordinates=robot.coordinates,
            contact_tolerance=robot.annotations.contact_tolerance,
            place_error=place_error(robot.tree, robot.coupling, robot.linear_limits, robot.closures, a, b),
            home=robot.home,
            stop=False,
        )
        self._made[one.name] = moving, found
        return found
