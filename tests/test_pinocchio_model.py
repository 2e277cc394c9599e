"""Pinocchio's own reading of every file is compared on load; what differs is a fault that names joint and values."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pinbound as pb
from pinbound.exceptions import Problems
from pinbound.model import pinocchio_model
from pinbound.model.kinematics import Joint
from pinbound.model.pinocchio_model import compare_with_pinocchio
from pinbound.model.tree import Tree
from robots import joint, robot_xml

Load = Callable[..., pb.Robot]
TURNED = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])

TEXT = robot_xml(
    [
        joint("a", "revolute", "base", "l1", axis="0.2 1 0", xyz="0.1 0 0.2", rpy="0.3 -1 2"),
        joint("b", "prismatic", "l1", "l2", axis="1 0 1", xyz="0 0.4 0", limit="-0.2 0.3"),
        joint("c", "continuous", "l2", "l3", axis="0 0 -3", rpy="0 0.5 0"),
        joint("d", "revolute", "l3", "l4", axis="1 0 0", xyz="0.2 0 0", mimic="a -0.5 0.25"),
        joint("e", "fixed", "l4", "l5", xyz="0 0 0.1", rpy="1 1 1"),
        joint("f", "floating", "base", "l6", xyz="0 1 0"),
    ],
    {},
    [],
)


def compared(robot: pb.Robot, name: str | None = None, **changes: Any) -> list[str]:
    """Return the differences that Pinocchio has with the robot, one joint of which is changed."""
    joints = tuple(replace(j, **changes) if j.name == name else j for j in robot.tree.kinematics.joints)
    tree = Tree(replace(robot.tree.kinematics, joints=joints))
    problems = Problems("robot.urdf")
    compare_with_pinocchio(robot.document, tree, problems)
    return [str(problem) for problem in problems.found]


def found(robot: pb.Robot, name: str) -> Joint:
    return next(j for j in robot.tree.kinematics.joints if j.name == name)


def test_a_robot_with_every_type_of_joint_agrees(load_text: Load) -> None:
    assert compared(load_text(TEXT)) == []


@pytest.mark.parametrize("name", ["a", "b", "c", "d", "e", "f"])
def test_a_joint_elsewhere_is_named_with_both_places(load_text: Load, name: str) -> None:
    robot = load_text(TEXT)
    moved = found(robot, name).translation + np.array([0.0, 0.0, 1e-9])
    said = compared(robot, name, translation=moved)
    assert len(said) == 1
    assert f"joint {name!r} is the first that differs" in said[0]
    assert "m, not (" in said[0]
    assert compared(robot, name, rotation=found(robot, name).rotation @ TURNED)


@pytest.mark.parametrize("name", ["a", "b", "c", "d"])
def test_another_axis_or_type_differs(load_text: Load, name: str) -> None:
    robot = load_text(TEXT)
    assert compared(robot, name, axis=-found(robot, name).axis)
    assert compared(robot, name, type="prismatic" if name != "b" else "revolute")


def test_other_limits_differ_and_both_are_named(load_text: Load) -> None:
    robot = load_text(TEXT)
    (said,) = compared(robot, "b", upper=0.30000001)
    assert "limits of joint 'b' as -0.2 .. 0.3, not -0.2 .. 0.30000001" in said


@pytest.mark.parametrize(("multiplier", "offset"), [(0.5, 0.25), (-0.5, 0.0), (-0.5, 0.2500001)])
def test_another_mimic_differs(load_text: Load, multiplier: float, offset: float) -> None:
    robot = load_text(TEXT)
    said = compared(robot, "d", mimic=pb.FollowerMark("d", "a", multiplier, offset))
    assert len(said) == 1
    assert "with mimic joints" in said[0]


def test_load_raises_what_the_comparison_finds(load_text: Load, monkeypatch: pytest.MonkeyPatch) -> None:
    import pinbound.model.normalise
    import pinbound.model.urdf

    monkeypatch.setattr(pinbound.model.urdf, "unit_vector", lambda axis: -pinbound.model.normalise.unit_vector(axis))
    with pytest.raises(pb.InputError, match="Pinocchio places link 'l1' elsewhere"):
        load_text(TEXT)


def test_what_annotations_replace_is_not_compared(load_text: Load) -> None:
    robot = load_text(
        TEXT, "limits: [{joint: b, lower: 0, upper: 0.1}]\nfollowers: [{joint: d, primary: a, multiplier: 2}]"
    )
    assert robot.upper[robot.coordinates.index("b")] == 0.1


def test_limits_that_a_mimic_joint_takes_from_its_primary_are_said(load_text: Load) -> None:
    palm = [
        joint("left", "revolute", "base", "l", limit="0 0.8"),
        joint("right", "revolute", "base", "r", limit="0 0.8", mimic="left -1 0"),
        joint("tip", "revolute", "l", "t", limit="-0.25 2", mimic="left 0.5 -0.1"),
    ]
    robot = load_text(robot_xml(palm, {}, []))
    said = [note for note in robot.notes if "reduce" in note]
    assert len(said) == 1
    assert "mimic joint 'right' (0 .. 0.8) reduce the range of 'left' from 0 .. 0.8 to 0 .. 0" in said[0]


def test_huge_offsets_and_slides_are_no_difference(tmp_path: Path) -> None:
    """Offsets of 1e8 rad are rounded by 1e-8, over arms of 1e6 m: both readers, each in its own way."""
    path = tmp_path / "huge.urdf"
    path.write_text("""<robot name="r"><link name="a"/><link name="b"/><link name="c"/><link name="d"/>
      <joint name="q" type="continuous"><parent link="a"/><child link="b"/><axis xyz="0 1 0"/></joint>
      <joint name="s" type="prismatic"><parent link="b"/><child link="c"/><axis xyz="1 0 0"/>
        <limit lower="-1e9" upper="1e9" effort="1" velocity="1"/>
        <mimic joint="q" multiplier="0.3" offset="7000000.1"/></joint>
      <joint name="t" type="continuous"><parent link="c"/><child link="d"/><origin xyz="1 2 3"/><axis xyz="0 0 1"/>
        <mimic joint="q" multiplier="1.7" offset="100000000.3"/></joint></robot>""")
    assert pb.load(path).coordinates == ("q",)
    path.write_text(path.read_text().replace('<axis xyz="0 0 1"/>', '<axis xyz="0 0 1"/><axis xyz="0 1 0"/>'))
    with pytest.raises(pb.InputError, match="axis"):
        pb.load(path)


def test_large_models_are_placed_joint_by_joint_as_by_pinocchios_data(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pinocchio's Data holds arrays of nv^3 numbers: of 500 joints it takes gigabytes, and a minute."""
    import pinocchio as pin

    for is_mimic in (False, True):
        model = pin.buildModelFromXML(TEXT, mimic=is_mimic)
        for seed in range(3):
            velocity = np.random.default_rng(seed).uniform(-1.0, 1.0, model.nv)
            q = pin.integrate(model, pin.neutral(model), velocity)
            found = list[Any]()
            for large in (100, 0):
                monkeypatch.setattr(pinocchio_model, "_LARGE", large)
                found.append(np.array(pinocchio_model._frame_places(model, q)))
            assert np.allclose(found[0], found[1], rtol=0, atol=1e-14)
    monkeypatch.setattr(pinocchio_model, "_LARGE", 0)
    robot = pb.load(TEXT)
    assert compared(robot) == []
    assert "places link 'l2'" in compared(robot, "b", translation=np.array([0.0, 0.41, 0.0]))[0]
