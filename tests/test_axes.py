"""The third axis counted from the arm or from the ground: the same robot in other coordinates."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import pinbound as pb
from robots import joint

HEAD = '<robot name="arm" xmlns:pinbound="urn:pinbound:1"><link name="base"/>'
MARKS = """<pinbound:point name="p" link="base" xyz="0.3 0 0.1"/><pinbound:point name="s" link="fore" xyz="0.4 0 0"/>
<pinbound:point name="u" link="upper" xyz="0.05 0 0.1"/><pinbound:boundary name="ground" a="p" b="s"/>
<pinbound:boundary name="fold" a="u" b="s" min_distance="0.1"/>"""
TOTAL = '<pinbound:axis name="from_ground" instead_of="J3" coefficients="J2: 1, J3: 1"/>'
LESS = '<pinbound:axis name="from_arm" instead_of="J3" coefficients="J3: 1, J2: -1"/>'


def serial(marks: str = "") -> str:
    """J3 is counted from the arm."""
    joints = [
        joint("J1", "revolute", "base", "column", axis="0 0 1", limit="-3 3"),
        joint("J2", "revolute", "column", "upper", limit="-0.8 1.4"),
        joint("J3", "revolute", "upper", "fore", xyz="0 0 0.4", limit="-0.5 1.9"),
    ]
    return f"{HEAD}{''.join(joints)}<pinbound:annotations>{MARKS}{marks}</pinbound:annotations></robot>"


def level(marks: str = "") -> str:
    """J3 is counted from the ground, by a level link."""
    joints = [
        joint("J1", "revolute", "base", "column", axis="0 0 1", limit="-3 3"),
        joint("J2", "revolute", "column", "upper", limit="-0.8 1.4"),
        joint("back", "revolute", "upper", "elbow", xyz="0 0 0.4", limit="-7 7", mimic="J2 -1 0"),
        joint("J3", "revolute", "elbow", "fore", limit="-0.5 1.9"),
    ]
    return f"{HEAD}{''.join(joints)}<pinbound:annotations>{MARKS}{marks}</pinbound:annotations></robot>"


def load(tmp_path: Path, text: str) -> pb.Robot:
    path = tmp_path / "arm.urdf"
    path.write_text(text)
    return pb.load(path)


@pytest.mark.parametrize(("make", "axis", "sign"), [(serial, TOTAL, 1.0), (level, LESS, -1.0)])
def test_the_same_robot_in_other_coordinates(
    tmp_path: Path, make: Callable[[str], str], axis: str, sign: float
) -> None:
    """Every answer is that of the joints at `q = T^-1 p`; corners of the region are images of corners."""
    old, new = load(tmp_path, make("")), load(tmp_path, make(axis))
    name = "from_ground" if sign > 0 else "from_arm"
    assert new.coordinates == ("J1", "J2", name)
    assert new.coupling.text("J3") == f"{name} {'-' if sign > 0 else '+'} J2".replace(f"{name} + J2", "J2 + from_arm")
    T = np.array([[1, 0, 0], [0, 1, 0], [0, sign, 1]])
    Q = np.random.default_rng(0).uniform([-3, -1, -2], [3, 2, 2.5], (1000, 3))
    P = Q @ T.T
    np.testing.assert_allclose(new.coupling.expand(P), old.coupling.expand(Q), rtol=0, atol=1e-15)
    np.testing.assert_allclose(new.boundaries.norms(P), old.boundaries.norms(Q), rtol=0, atol=1e-14)
    np.testing.assert_allclose(new.boundaries.gradients(P), old.boundaries.gradients(Q) @ np.linalg.inv(T), atol=1e-12)
    np.testing.assert_array_equal(new.boundaries.free(P), old.boundaries.free(Q))
    assert [pair.status for pair in new.coverage.pairs] == [pair.status for pair in old.coverage.pairs]
    regions = [pb.feasible_region(robot, robot.coordinates[1:]) for robot in (old, new)]
    assert regions[1].area == pytest.approx(regions[0].area, abs=2 * sum(r.area_error for r in regions) + 1e-12)
    assert {edge.name for edge in regions[1].edges} == {edge.name for edge in regions[0].edges}
    for corner in regions[0].corners:
        near = np.linalg.norm([c.point - T[1:, 1:] @ corner.point for c in regions[1].corners], axis=1)
        assert near.min() < 1e-9
    assert new.turns(name)
    assert new.lower[2] == -math.inf
    assert np.isfinite(new.lower[1])
    np.testing.assert_array_equal(new.home, T @ old.home)


def test_limits_of_a_joint_are_slanted_in_the_other_coordinate(tmp_path: Path) -> None:
    robot = load(tmp_path, serial(TOTAL))
    for arm in (-0.5, 0.25, 1.0):
        found = robot.boundaries.limits("from_ground", [0.0, arm, arm + 0.2])
        if found.upper_stop == "J3":
            assert found.upper == pytest.approx(arm + 1.9, abs=1e-15)
    assert robot.boundaries.free([0.0, -0.5, 0.2]) is True
    assert robot.boundaries.free([0.0, -0.5, 1.41]) is False  # J3 = 1.91


def test_rules_and_home_speak_of_joints_or_axes(tmp_path: Path) -> None:
    said = TOTAL + '<pinbound:rule name="sum" upper="1.0" coefficients="J2: 1, J3: 1"/>'
    robot = load(tmp_path, serial(said + '<pinbound:home J2="0.2" from_ground="0.5"/>'))
    np.testing.assert_allclose(robot.home, [0.0, 0.2, 0.5], atol=1e-15)
    (limit,) = [one for one in robot.linear_limits if one.joint == "sum"]
    assert limit.coefficients.tolist() == [0.0, 0.0, 1.0]
    found = pb.certify(robot, [[0, 0.1, 0.3], [0, 0.3, 1.2]], limits_only=True)
    assert found.violations[0].name == "sum upper"
    again = pb.Annotations.load(_sidecar(tmp_path, robot))
    assert [(a.name, a.instead_of, a.coefficients) for a in again.axes] == [
        ("from_ground", "J3", {"J2": 1.0, "J3": 1.0})
    ]


def _sidecar(tmp_path: Path, robot: pb.Robot) -> Path:
    robot.annotations.save(tmp_path / "again.yaml")
    return tmp_path / "again.yaml"


def test_axes_with_factors_and_offsets_are_exact(tmp_path: Path) -> None:
    """A motor axis geared 3 : 1, and a mimic joint with an offset in the sum."""
    follow = joint("cam", "revolute", "base", "disc", limit="-9 9", mimic="J2 2 0.25")
    axes = '<pinbound:axis name="motor" instead_of="J3" coefficients="J3: 3, cam: 1"/>'
    text = serial(axes).replace("<pinbound:annotations>", f"{follow}<pinbound:annotations>", 1)
    robot = load(tmp_path, text)
    theta = robot.coupling.expand([0.1, 0.2, 0.9])
    values = dict(zip(robot.coupling.joints, theta.tolist(), strict=True))
    assert values["cam"] == pytest.approx(2 * 0.2 + 0.25, abs=1e-15)
    assert 3 * values["J3"] + values["cam"] == pytest.approx(0.9, abs=1e-15)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            '<pinbound:axis name="a" instead_of="J3" coefficients="J2: 1"/>',
            "replaces 'J3' but has no coefficient for it",
        ),
        ('<pinbound:axis name="J2" instead_of="J3" coefficients="J3: 1"/>', "has the name of a joint"),
        ('<pinbound:axis name="a" instead_of="J9" coefficients="J9: 1"/>', "'J9', which does not exist"),
        (TOTAL + TOTAL.replace("from_ground", "other"), "both replace 'J3'"),
        (
            '<pinbound:axis name="a" instead_of="J3" coefficients="J2: 1, J3: 1"/>'
            '<pinbound:axis name="b" instead_of="J2" coefficients="J2: 1, J3: 1"/>',
            "do not determine the joints",
        ),
        (TOTAL + '<pinbound:home J3="0.1" from_ground="0.5"/>', "the values of its joints at home give another number"),
    ],
)
def test_faults_of_axes_are_told(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(pb.InputError) as caught:
        load(tmp_path, serial(text))
    assert message in str(caught.value)


def test_loops_close_in_other_coordinates_too() -> None:
    """The packaged palletizer, its third axis counted from the arm: loops proven, limits and rules the same."""
    axis = pb.Annotations(axes=(pb.Axis("rel", "J3", {"J3": 1.0, "J2": -1.0}),))
    old, new = pb.load("palletizer"), pb.load("palletizer", annotations=axis)
    T = np.eye(4)
    T[2, 1] = -1.0
    Q = np.random.default_rng(0).uniform(-1.0, 1.0, (100, 4))
    P = Q @ T.T
    assert [closure.is_exact for closure in new.closures] == [True] * 3
    assert new.closure_residuals(P).max() < 1e-14
    np.testing.assert_array_equal(new.boundaries.free(P), old.boundaries.free(Q))
    np.testing.assert_allclose(new.to_pinocchio(new.model, P), old.to_pinocchio(old.model, Q), rtol=0, atol=1e-15)
