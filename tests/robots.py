"""A zoo of small robots, degenerate ones included, and the Pinocchio oracle that the laws compare with."""

from typing import Any

import numpy as np
import pinocchio as pin

import pinbound as pb

__all__ = ["ARM", "ZOO", "joint", "oracle_vectors", "random_q", "robot_xml"]

HEAD = '<robot name="zoo" xmlns:pinbound="urn:pinbound:1">'


def joint(name: str, kind: str, parent: str, child: str, **options: str) -> str:
    """Return one joint element and its child link."""
    parts = [f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>']
    parts.append(f'<origin xyz="{options.get("xyz", "0 0 0")}" rpy="{options.get("rpy", "0 0 0")}"/>')
    parts.append(f'<axis xyz="{options.get("axis", "0 1 0")}"/>')
    if kind in ("revolute", "prismatic"):
        lower, upper = options.get("limit", "-3 3").split()
        parts.append(f'<limit lower="{lower}" upper="{upper}" effort="1" velocity="1"/>')
    if "mimic" in options:
        primary, multiplier, offset = options["mimic"].split()
        parts.append(f'<mimic joint="{primary}" multiplier="{multiplier}" offset="{offset}"/>')
    return "".join([*parts, f'</joint><link name="{child}"/>'])


def robot_xml(
    joints: list[str], points: dict[str, tuple[str, str]], pairs: list[tuple[str, str]], extra: str = ""
) -> str:
    """Return a URDF with root link `base`, marked points {name: (link, xyz)} and a boundary for each pair."""
    marks = "".join(f'<pinbound:point name="{n}" link="{link}" xyz="{xyz}"/>' for n, (link, xyz) in points.items())
    bounds = "".join(f'<pinbound:boundary name="{a}_{b}" a="{a}" b="{b}"/>' for a, b in pairs)
    notes = f"<pinbound:annotations>{marks}{bounds}{extra}</pinbound:annotations>"
    return f'{HEAD}<link name="base"/>{"".join(joints)}{notes}</robot>'


ARM = [
    joint("j1", "revolute", "base", "a", axis="0 0 1", xyz="0 0 0.3"),
    joint("j2", "revolute", "a", "b", axis="0 1 0", xyz="0.05 0.02 0.1"),
    joint("j3", "revolute", "b", "c", axis="0 1 0", xyz="0 0 0.4", rpy="0.1 0 0.2"),
    joint("j4", "revolute", "c", "d", axis="1 0 0", xyz="0.1 0 0.2", rpy="0 1.5707963267948966 0"),
]

ZOO = {
    "minervabot_v3": "minervabot_v3",
    "planar_2r": robot_xml(
        [joint("q1", "revolute", "base", "a", xyz="0 0 0.1"), joint("q2", "revolute", "a", "b", xyz="0 0 0.4")],
        {"p": ("base", "0.2 0 0.1"), "s": ("a", "0.1 0 0.3"), "t": ("b", "0.05 0 0.35")},
        [("p", "s"), ("s", "t"), ("p", "t")],
    ),
    "spatial_4r": robot_xml(
        ARM,
        {"p": ("base", "0.2 0.1 0.4"), "s": ("b", "0 0.1 0.2"), "t": ("d", "0.05 0.02 0.3"), "u": ("a", "0.1 0 0")},
        [("p", "s"), ("p", "t"), ("s", "t"), ("t", "u")],
    ),
    "slides": robot_xml(
        [
            joint("lift", "prismatic", "base", "a", axis="0 0 1", limit="0 0.5"),
            joint("turn", "continuous", "a", "b", axis="0 0 1", xyz="0.1 0 0"),
            joint("reach", "prismatic", "b", "c", axis="1 0 0", xyz="0.2 0 0", limit="0 0.3"),
            joint("tilt", "revolute", "c", "d", axis="0 1 0", xyz="0 0 0.1"),
            joint("copy", "revolute", "d", "e", axis="0 1 0", xyz="0.2 0 0", mimic="tilt -2 0.25"),
        ],
        {"p": ("base", "0.5 0.1 0.2"), "s": ("b", "0.1 0.1 0.3"), "t": ("e", "0.1 0 0.05"), "u": ("d", "0 0 0.2")},
        [("p", "s"), ("p", "t"), ("s", "t"), ("u", "t"), ("p", "u")],
    ),
    "antiparallel_zero_offset": robot_xml(
        [
            joint("q1", "revolute", "base", "a", axis="0 0 1", rpy="3.141592653589793 0 0"),
            joint("q2", "revolute", "a", "b", axis="0 0 1", rpy="3.141592653589793 0 0"),
            joint("q3", "revolute", "b", "c", axis="1 1 1", xyz="0 0 0.2"),
            joint("f", "continuous", "base", "x", axis="0 0 2", mimic="q1 1 1.0", xyz="0 0 0.1"),
        ],
        {"p": ("base", "0.3 0 0.1"), "s": ("b", "0 0.25 0.15"), "t": ("c", "0.1 0.1 0.1"), "u": ("x", "0.3 0.1 0")},
        [("p", "s"), ("p", "t"), ("u", "s"), ("u", "t"), ("s", "u")],
    ),
}


def random_q(robot: pb.Robot, count: int, seed: int) -> Any:
    """Return configurations far beyond the limits: boundaries hold everywhere."""
    return np.random.default_rng(seed).uniform(-2 * np.pi, 2 * np.pi, (count, len(robot.coordinates)))


def oracle_vectors(robot: pb.Robot, Q: Any) -> Any:
    """Return every r in its ancestor's frame from Pinocchio's frame placements, (N, m, 3)."""
    model = robot.model
    data = model.createData()
    vectors = np.empty((len(Q), len(robot.boundaries), 3))
    for row, theta in enumerate(robot.coupling.expand(Q)):
        pin.framesForwardKinematics(model, data, theta)
        for column, boundary in enumerate(robot.boundaries):
            a, b = (
                data.oMf[model.getFrameId(point.link)] * np.array(point.xyz)
                for point in (boundary.point_a, boundary.point_b)
            )
            vectors[row, column] = data.oMf[model.getFrameId(boundary.ancestor)].rotation.T @ (a - b)
    return vectors
