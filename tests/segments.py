"""Robots with segments, lines and planes, degenerate ones included, and an oracle of Pinocchio and coal; no test."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import coal
import numpy as np
import pinocchio as pin
from scipy.optimize import lsq_linear

import pinbound as pb
from robots import ARM, HEAD, joint

__all__ = ["MARKS", "PLANAR", "ROBOTS", "assemble", "exact_clearance", "oracle_clearances", "place"]

FAR = 1e3  # metres: half the length of a capsule that stands for a line


def assemble(joints: list[str], marks: list[str], pairs: list[str], home: str = "") -> str:
    """Return a URDF with marks, and a boundary for each pair `a_b` of their names."""
    bounds = "".join(f'<pinbound:boundary name="{p}" a="{p.split("_")[0]}" b="{p.split("_")[1]}"/>' for p in pairs)
    notes = f"<pinbound:annotations>{''.join(marks)}{bounds}{home}</pinbound:annotations>"
    return f'{HEAD}<link name="base"/>{"".join(joints)}{notes}</robot>'


def _segment(name: str, link: str, a: str, b: str, radius: float = 0.0) -> str:
    return f'<pinbound:segment name="{name}" link="{link}" xyz_a="{a}" xyz_b="{b}" radius="{radius}"/>'


def _point(name: str, link: str, xyz: str, radius: float = 0.0) -> str:
    return f'<pinbound:point name="{name}" link="{link}" xyz="{xyz}" radius="{radius}"/>'


def _line(name: str, link: str, xyz: str, direction: str, radius: float = 0.0) -> str:
    return f'<pinbound:line name="{name}" link="{link}" xyz="{xyz}" direction="{direction}" radius="{radius}"/>'


def _plane(name: str, link: str, xyz: str, normal: str) -> str:
    return f'<pinbound:plane name="{name}" link="{link}" xyz="{xyz}" normal="{normal}"/>'


def _sweep(name: str, link: str, xyz: str, ways: str, radius: float = 0.0) -> str:
    return f'<pinbound:sweep name="{name}" link="{link}" xyz="{xyz}" ways="{ways}" radius="{radius}"/>'


PLANAR = [joint("q1", "revolute", "base", "a", xyz="0 0 0.1"), joint("q2", "revolute", "a", "b", xyz="0 0 0.4")]
SLIDES = [
    joint("lift", "prismatic", "base", "a", axis="0 0 1", limit="0 0.5"),
    joint("turn", "continuous", "a", "b", axis="0 0 1", xyz="0.1 0 0"),
    joint("reach", "prismatic", "b", "c", axis="1 0 0", xyz="0.2 0 0", limit="0 0.3"),
    joint("tilt", "revolute", "c", "d", axis="0 1 0", xyz="0 0 0.1"),
    joint("copy", "revolute", "d", "e", axis="0 1 0", xyz="0.2 0 0", mimic="tilt -2 0.25"),
]

MARKS = [  # of PLANAR
    _segment("A", "base", "0.2 0 0.1", "0.5 0 0.3", 0.01),
    _segment("B", "a", "0.05 0.02 0.1", "0.05 0.02 0.35", 0.02),
    _segment("C", "b", "0 0.02 0.1", "0.1 0.02 0.3", 0.015),
    _segment("Z", "base", "-0.5 0.3 0.1", "-0.2 0.3 0.5", 0.01),
    _point("p", "base", "-0.3 0.01 0.3", 0.02),
    _point("s", "b", "0.05 0 0.3", 0.01),
    _plane("floor", "base", "0 0 -0.2", "0 0 1"),
    _plane("edge", "b", "-0.05 0 0", "-2 0 0.4"),
    _line("rod", "base", "0.4 0 0.6", "0 3 0", 0.03),
    _line("post", "base", "0.45 0.2 0.5", "0.3 1 0.2", 0.02),
]

ROBOTS = {
    "planar": assemble(
        PLANAR,
        [
            _segment("A", "base", "0.2 0 0.1", "0.5 0 0.3", 0.01),
            _segment("B", "a", "0.05 0.02 0.1", "0.05 0.02 0.35", 0.02),
            _segment("C", "b", "0 0.02 0.1", "0.1 0.02 0.3", 0.015),
            _segment("along", "b", "0.1 -0.3 0.2", "0.1 0.3 0.2"),  # along the axis of every joint
            _point("p", "base", "-0.3 0.01 0.3", 0.02),
            _plane("floor", "base", "0 0 -0.2", "0 0 1"),
            _plane("edge", "b", "-0.05 0 0", "-2 0 0.4"),
            _line("rod", "base", "0.4 0 0.6", "0 3 0", 0.03),
            _line("bar", "a", "0.1 0.3 0.2", "1 0 1", 0.01),
        ],
        [
            "A_C",
            "B_p",
            "C_p",
            "A_B",
            "along_p",
            "A_along",
            "C_floor",
            "floor_along",
            "edge_p",
            "rod_C",
            "C_rod",
            "bar_p",
            "p_bar",
            "bar_C",
        ],
        '<pinbound:home q1="-0.4" q2="-0.5"/>',
    ),
    "spatial": assemble(
        ARM,
        [
            _segment("A", "base", "0.3 0.3 0.2", "-0.1 0.4 0.7", 0.01),
            _segment("B", "b", "0.05 0.1 0", "0 0.1 0.3", 0.02),
            _segment("D", "d", "0.05 0.02 0.1", "0.1 -0.2 0.3", 0.015),
            _segment("dot", "d", "0.1 0 0.1", "0.1 0 0.1", 0.02),  # of no length
            _point("p", "base", "0.4 -0.3 0.5", 0.02),
            _plane("wall", "base", "-0.6 0 0", "1 0.2 0"),
            _plane("face", "d", "0 0 0.35", "0 0.1 -1"),
            _line("pole", "base", "0.6 0.6 0", "0.1 0 1", 0.03),
            _line("ray", "b", "0 0.2 0.2", "1 0.5 0"),
        ],
        [
            "A_D",
            "A_B",
            "B_D",
            "dot_A",
            "dot_p",
            "B_p",
            "p_D",
            "wall_D",
            "D_wall",
            "wall_B",
            "p_face",
            "face_A",
            "pole_D",
            "D_pole",
            "p_ray",
            "ray_D",
        ],
        '<pinbound:home j2="0.3" j3="0.2"/>',
    ),
    "slides": assemble(
        SLIDES,
        [
            _segment("A", "base", "0.5 0.1 0.2", "0.5 0.3 0.6", 0.01),
            _segment("B", "b", "0.1 0.1 0.3", "0 -0.2 0.4", 0.02),
            _segment("E", "e", "0.1 0 0.05", "0.1 0.2 0.1", 0.01),
            _plane("top", "base", "0 0 1.5", "0 0 -1"),
            _line("pole", "base", "-0.2 -0.6 0", "0 0 1", 0.05),
        ],
        ["A_E", "B_E", "A_B", "top_E", "pole_E"],
    ),
    "parallel": assemble(  # two segments that stay parallel, and two that cross, at any angle
        [
            joint("x", "prismatic", "base", "a", axis="1 0 0", limit="-2 2"),
            joint("z", "prismatic", "a", "b", axis="0 0 1", limit="-2 2"),
            joint("turn", "revolute", "b", "c", axis="0 0 1"),
        ],
        [
            _segment("A", "base", "0 0 0", "0 0 1", 0.1),
            _segment("B", "b", "0.5 0 0.2", "0.5 0 0.9", 0.1),
            _segment("C", "base", "-0.5 1 0", "0.5 1 0", 0.05),
            _segment("D", "c", "-0.5 1.2 0", "0.5 1.2 0", 0.05),
        ],
        ["A_B", "C_D", "A_D"],
    ),
    "bodies": assemble(  # rectangles, boxes and a prism of six sides
        ARM,
        [
            _sweep("box", "base", "0.35 0.2 0.1", "0.2 0 0  0 0.3 0  0 0 0.25", 0.01),
            _sweep("arm", "b", "-0.05 -0.04 0", "0.1 0 0  0 0.08 0  0 0 0.35"),
            _sweep("hand", "d", "0 0 0.05", "0.1 0.02 0  -0.03 0.1 0  0 0 0.2"),
            _sweep("plate", "c", "-0.1 -0.1 0.05", "0.2 0 0  0 0.2 0", 0.005),
            _sweep("prism", "base", "-0.5 -0.5 0", "0.1 0 0  0.05 0.0866 0  -0.05 0.0866 0  0 0 0.8"),
            _point("p", "base", "0.5 -0.5 0.5", 0.02),
            _segment("D", "d", "0.05 0.02 0.1", "0.1 -0.2 0.3", 0.015),
            _plane("wall", "base", "-0.9 0 0", "1 0.2 0"),
            _line("pole", "base", "0.6 0.6 0", "0.1 0 1", 0.03),
        ],
        [
            "box_hand",
            "box_arm",
            "hand_p",
            "D_box",
            "prism_hand",
            "arm_hand",
            "plate_p",
            "box_plate",
            "wall_hand",
            "pole_hand",
            "plate_wall",
            "prism_D",
        ],
        '<pinbound:home j1="1.2" j2="0.3" j3="0.2"/>',
    ),
}


def place(robot: pb.Robot, theta: Any, mark: Any, data: Any) -> Any:
    """Return a mark's points in the world, after `framesForwardKinematics`."""
    return [data.oMf[robot.model.getFrameId(mark.link, pin.BODY)].act(xyz) for xyz in mark.shape.anchors]


def exact_clearance(robot: pb.Robot, boundary: pb.Boundary, q: Any) -> float:
    """Return one clearance from Pinocchio's placements and SciPy's bounded least squares, exact but for rounding."""
    data = robot.model.createData()
    theta = robot.coupling.expand(q[None])[0]
    pin.framesForwardKinematics(robot.model, data, theta)
    one, two = boundary.point_a, boundary.point_b
    (first, *ends), (second, *others) = (place(robot, theta, mark, data) for mark in (one, two))
    threshold = boundary.min_distance + one.radius + two.radius
    ways = [end - first for end in ends] + [second - other for other in others]
    if any(isinstance(mark, pb.Plane) for mark in (one, two)):
        (top, *corners), mark = (others, two) if isinstance(two, pb.Plane) else (ends, one)
        assert not corners
        base, normal = (second, top - second) if mark is two else (first, top - first)
        start, body = (first, ends) if mark is two else (second, others)
        return float((start - base) @ normal + sum(min(0.0, (end - start) @ normal) for end in body)) - threshold
    free = np.array([isinstance(mark, pb.Line) for mark in (one, two) for _ in (ends if mark is one else others)])
    if not ways:
        return float(np.linalg.norm(second - first)) - threshold
    ends_of_t = np.where(free, -np.inf, 0.0), np.where(free, np.inf, 1.0)
    found = lsq_linear(np.column_stack(ways), second - first, ends_of_t, method="bvls", tol=1e-16)
    return float(np.linalg.norm(found.fun)) - threshold


def oracle_clearances(robot: pb.Robot, Q: Any, chosen: Sequence[int] | None = None) -> Any:
    """Return clearances (N, m) from Pinocchio's placements and coal's distances: of all boundaries, or those chosen.

    coal's search ends within 1e-6 m of the distance, and its boxes are larger by 1e-10 of their size where the
    direction that it looks in has a component of exactly zero: on which rows that is, rounding decides.
    """
    data = robot.model.createData()
    boundaries = list(robot.boundaries) if chosen is None else [robot.boundaries[index] for index in chosen]
    found = np.empty((len(Q), len(boundaries)))
    for row, theta in enumerate(robot.coupling.expand(Q)):
        pin.framesForwardKinematics(robot.model, data, theta)
        for column, boundary in enumerate(boundaries):
            shapes = [_shape(mark, place(robot, theta, mark, data)) for mark in (boundary.point_a, boundary.point_b)]
            (one, T_one), (two, T_two) = shapes
            result = coal.DistanceResult()
            coal.distance(one, T_one, two, T_two, coal.DistanceRequest(), result)
            found[row, column] = result.min_distance - boundary.min_distance
    return found


def _shape(mark: Any, ends: Any) -> tuple[Any, Any]:
    if isinstance(mark, pb.Plane):
        normal = ends[1] - ends[0]
        return coal.Halfspace(normal, float(normal @ ends[0])), coal.Transform3s()
    if isinstance(mark, pb.Sweep) and len(mark.ways) == 2:
        sides = [end - ends[0] for end in ends[1:]]
        axes = [side / np.linalg.norm(side) for side in sides]
        plate = coal.Box(*map(np.linalg.norm, sides), 0.0)
        plate.setSweptSphereRadius(mark.radius)
        rotation = np.column_stack((*axes, np.cross(*axes)))
        return plate, coal.Transform3s(rotation, ends[0] + sum(sides) / 2)
    if isinstance(mark, pb.Hull | pb.Box | pb.Cylinder) and not mark.shape.is_segment:
        points = coal.StdVec_Vec3s()
        turn = np.array([end - ends[0] for end in ends[1:]])
        for corner in mark.shape.corners:
            points.append(corner @ turn)
        hull = coal.Convex.convexHull(points, True, "Qt")
        hull.setSweptSphereRadius(mark.shape.radius)
        return hull, coal.Transform3s(np.eye(3), ends[0])
    if isinstance(mark, pb.Sweep):
        points = coal.StdVec_Vec3s()
        for corner in itertools.product((0.0, 1.0), repeat=len(mark.ways)):
            points.append(sum(t * (end - ends[0]) for t, end in zip(corner, ends[1:], strict=True)))
        hull = coal.Convex.convexHull(points, True, "Qt")
        hull.setSweptSphereRadius(mark.radius)
        return hull, coal.Transform3s(np.eye(3), ends[0])
    if len(ends) == 1:
        return coal.Sphere(mark.radius), coal.Transform3s(np.eye(3), ends[0])
    along = ends[1] - ends[0]
    if isinstance(mark, pb.Line):
        ends = [ends[0] - FAR * along, ends[0] + FAR * along]
        along = ends[1] - ends[0]
    z = along / np.linalg.norm(along)
    x = np.cross(z, np.eye(3)[int(np.argmin(np.abs(z)))])
    x /= np.linalg.norm(x)
    rotation = np.column_stack((x, np.cross(z, x), z))
    capsule = coal.Capsule(mark.radius, float(np.linalg.norm(along)))
    return capsule, coal.Transform3s(rotation, (ends[0] + ends[1]) / 2)
