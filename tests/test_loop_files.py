"""Loops out of files that people have beside a URDF: Gepetto's robot.yaml, MJCF; and welds."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from typer.testing import CliRunner

import pinbound as pb
from loop_texts import ANCHOR, SITES, five_bar, four_bar, joint, loops, mjcf
from pinbound.cli import app
from pinbound.typing import Array


def frames(robot: pb.Robot, q: Array, *links: str) -> list[pin.SE3]:
    """Return where links are, by Pinocchio."""
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, robot.coupling.expand(q))
    return [data.oMf[robot.model.getFrameId(link)].copy() for link in links]


def written(folder: Path, urdf: str, name: str, text: str) -> tuple[Path, Path]:
    (folder / "robot.urdf").write_text(urdf)
    (folder / name).write_text(text)
    return folder / "robot.urdf", folder / name


def some_q(robot: pb.Robot, reach: float = 0.4) -> Array:
    return np.random.default_rng(5).uniform(-reach, reach, (20, len(robot.coordinates)))


@pytest.mark.parametrize("kind", ["3d", "3D"])
def test_a_pin_of_a_robot_yaml_closes_its_loop(tmp_path: Path, kind: str) -> None:
    urdf, closures = written(tmp_path, five_bar('type="fixed"'), "robot.yaml", loops(kind))
    robot = pb.load(urdf, annotations=closures)
    assert robot.coordinates == ("motor_l", "motor_r")  # both motors, whatever is deeper
    for q in some_q(robot):
        a, b = frames(robot, q, "ball", "loop_B")
        np.testing.assert_allclose(a.translation, b.translation, atol=1e-14)


def test_a_weld_of_a_robot_yaml_holds_the_orientation_too(tmp_path: Path) -> None:
    urdf, closures = written(tmp_path, five_bar(), "robot.yaml", loops("6d"))
    robot = pb.load(urdf, annotations=closures)
    assert robot.coordinates == ("motor_l", "motor_r")
    for q in some_q(robot):
        a, b = frames(robot, q, "ball", "loop_B")
        np.testing.assert_allclose(a.homogeneous, b.homogeneous, atol=1e-14)
    assert any("'loop_A' follows motor_r + free_r - motor_l - free_l - 1.1" in note for note in robot.notes)
    alone = pb.load(urdf, annotations=written(tmp_path, five_bar(), "pin.yaml", loops("3d"))[1])
    assert set(alone.coordinates) == {"motor_l", "motor_r", "loop_A"}


def test_motors_stay_active_however_deep_they_are(tmp_path: Path) -> None:
    given = loops("3d").replace("['motor']", "['free_l', 'motor_l']")
    robot = pb.load(*written(tmp_path, five_bar('type="fixed"'), "robot.yaml", given))
    assert set(robot.coordinates) == {"free_l", "motor_l"}
    kept = "closures: [{name: c, link_a: fore, xyz_a: [0.2, 0, 0], link_b: bar, xyz_b: [0, 0, 0], active: [elbow]}]"
    assert set(pb.load(*written(tmp_path, four_bar(), "c.yaml", kept)).coordinates) == {"elbow", "rod"}


def test_a_weld_counts_mimic_joints_with_their_offsets(tmp_path: Path) -> None:
    """One rod turns with its crank; drawn, both are 0.2 rad further than the rest of the loop is."""
    limit, mimic = '<limit lower="-1.5"', '<mimic joint="motor_l" multiplier="-1" offset="0.2"/><limit lower="-1.5"'
    head, tail = five_bar().split('name="free_l"')
    text = f'{head}name="free_l"{tail.replace(limit, mimic, 1)}'
    robot = pb.load(*written(tmp_path, text, "robot.yaml", loops("6d").replace("motor'", "motor_l'")))
    assert robot.coordinates == ("motor_l",)
    for q in some_q(robot, 0.3):
        a, b = frames(robot, q, "ball", "loop_B")
        np.testing.assert_allclose(a.homogeneous, b.homogeneous, atol=1e-13)


def test_a_weld_takes_a_freedom_where_nothing_turns_at_the_pin_alone(tmp_path: Path) -> None:
    """Both rods are one body then: a triangle on two cranks, a four-bar."""
    urdf, closures = written(
        tmp_path, five_bar('type="fixed"', -0.4), "robot.yaml", loops("6d").replace("motor'", "motor_l'")
    )
    robot = pb.load(urdf, annotations=closures)
    assert robot.coordinates == ("motor_l",)
    for q in some_q(robot, 0.3):
        a, b = frames(robot, q, "ball", "loop_B")
        np.testing.assert_allclose(a.homogeneous, b.homogeneous, atol=1e-13)


def test_a_weld_in_a_parallelogram_keeps_it_one() -> None:
    mark = pb.ClosureMark("loop", "fore", (0.2, 0.0, 0.0), "bar", (0.0, 0.0, 0.0), weld=True, active=("lean",))
    robot = pb.load(four_bar(), annotations=pb.Annotations(closures=(mark,)))
    assert robot.coordinates == ("lean",)
    a, b = frames(robot, np.array([0.7]), "fore", "bar")
    np.testing.assert_allclose(a.rotation, b.rotation, atol=1e-15)
    np.testing.assert_allclose(a.act(np.array([0.2, 0.0, 0.0])), b.translation, atol=1e-15)


def test_turns_of_a_weld_are_those_of_home(tmp_path: Path) -> None:
    text = five_bar().replace('upper="1.5"', 'upper="9"')
    urdf, closures = written(tmp_path, text, "robot.yaml", loops("6d"))
    home = pb.Annotations(home={"loop_A": 2.0 * math.pi - 1.1})
    robot = pb.load(urdf, annotations=[closures, home])
    place = robot.coupling.joints.index("loop_A")
    assert robot.coupling.expand(robot.home)[place] == pytest.approx(2.0 * math.pi - 1.1, abs=1e-12)


def test_files_write_and_read_welds_and_active_joints(tmp_path: Path) -> None:
    mark = pb.ClosureMark("loop", "a", (0.0, 0.1, 0.0), "b", (0.0, 0.0, 0.0), active=("a joint", "m"), weld=True)
    marks = pb.Annotations(closures=(mark,))
    marks.save(tmp_path / "one.yaml")
    assert pb.Annotations.load(tmp_path / "one.yaml").closures[0].active == ("a joint", "m")
    assert pb.Annotations.load(tmp_path / "one.yaml").closures[0].weld
    assert 'weld="true"' in marks.to_xml()


def test_info_tells_loops_and_rules_over_them(tmp_path: Path) -> None:
    """It asked for limits as rows over q, which loops do not have, and ended with exit code 2."""
    urdf, closures = written(tmp_path, five_bar('type="fixed"'), "robot.yaml", loops("3d"))
    rule = tmp_path / "rule.yaml"
    rule.write_text("rules: [{name: both, upper: 0.8726646259971648, coefficients: {motor_l: 1, free_l: -1}}]")
    words = ["info", str(urdf), "--annotations", str(closures), "--annotations", str(rule)]
    done = CliRunner().invoke(app, words, env={"COLUMNS": "200"})
    assert done.exit_code == 0, done.output
    assert "motor_l - free_l <= 50 deg" in done.output
    record = json.loads(CliRunner().invoke(app, [*words, "--json"]).stdout)
    assert record["S"] is None
    assert record["moves"]["free_l"] == "loop_B-loop_A(motor_l, motor_r)"


FAULTS = {
    "spherical": (loops("6d", "joint_name: ['free_l']\njoint_type: ['SPHERICAL']\n"), "'free_l' is SPHERICAL here"),
    "cardan": (loops("3d", "joint_name: ['free_l']\njoint_type: ['UJOINT_XY']\n"), "'free_l' is UJOINT_XY here"),
    "old": (loops("3d", "rotule_name: free\n"), "'free_r' is SPHERICAL here"),
    "frame": (loops("3d").replace("loop_B", "loop_C"), "names the frame 'loop_C', which the URDF does not have"),
    "kind": (loops("5d"), "has the type '5d'"),
    "count": (loops("3d', '3d"), "has 1 loops and 2 types"),
    "pair": (loops("3d").replace("'loop_B', ", ""), "Name two frames"),
    "motor": (loops("3d").replace("motor", "drive"), "no moving joint has 'drive' in its name"),
    "list": (loops("3d").replace("['3d']", "3d"), "type is no list"),
    "names": (loops("3d", "joint_name: ['free_l']\n"), "has 1 names in joint_name and 0 in joint_type"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_robot_yaml_that_cannot_be_taken_is_refused_by_name(tmp_path: Path, fault: str) -> None:
    text, said = FAULTS[fault]
    urdf, closures = written(tmp_path, five_bar(), "robot.yaml", text)
    with pytest.raises(pb.InputError) as refused:
        pb.load(urdf, annotations=closures)
    assert said in str(refused.value)
    assert "robot.yaml" in str(refused.value)


def test_joints_that_a_robot_yaml_fixes_are_held_at_zero(tmp_path: Path) -> None:
    more = "joint_name: ['motor_r', 'nobody']\njoint_type: ['FIXED', 'SPHERICAL']\nLidmot: [1]\n"
    urdf, closures = written(tmp_path, five_bar('type="fixed"'), "robot.yaml", loops("3d", more))
    robot = pb.load(urdf, annotations=closures)
    place = robot.coordinates.index("motor_r")
    assert (robot.lower[place], robot.upper[place]) == (0.0, 0.0)
    assert any("'nobody', which the URDF does not have" in note for note in robot.notes)
    assert any("has 'Lidmot', ignored" in note for note in robot.notes)


def test_welds_about_axes_that_are_not_parallel_are_spatial(tmp_path: Path) -> None:
    text = five_bar().replace('name="free_l" type="revolute"', 'name="free_l" type="revolute" ')
    head, tail = text.split('name="free_l"')
    urdf, closures = written(
        tmp_path, f'{head}name="free_l"{tail.replace("0 0 1", "0 1 0", 1)}', "robot.yaml", loops("6d")
    )
    with pytest.raises(pb.InputError, match=r"axes that are not parallel .*spatial loop"):
        pb.load(urdf, annotations=closures)


def test_frames_that_can_never_be_aligned_are_refused(tmp_path: Path) -> None:
    text = five_bar().replace('rpy="0 0 -0.4"', 'rpy="0.2 0 -0.4"')
    with pytest.raises(pb.InputError, match="never have the same orientation"):
        pb.load(*written(tmp_path, text, "robot.yaml", loops("6d")))


def test_files_that_need_the_urdf_say_so(tmp_path: Path) -> None:
    _, closures = written(tmp_path, five_bar(), "robot.yaml", loops("3d"))
    with pytest.raises(pb.InputError, match="Load both"):
        pb.Annotations.load(closures)


@pytest.mark.parametrize("equality", [ANCHOR, SITES])
def test_a_connect_of_mjcf_closes_its_loop(tmp_path: Path, equality: str) -> None:
    robot = pb.load(*written(tmp_path, five_bar('type="fixed"'), "robot.xml", mjcf(equality)))
    assert robot.coordinates == ("motor_l", "motor_r")
    for q in some_q(robot):
        a, b = frames(robot, q, "rod_l", "rod_r")
        ends = a.act(np.array([0.2, 0.25, 0.0])), b.act(np.array([-0.2, 0.25, 0.0]))
        np.testing.assert_allclose(*ends, atol=1e-14)
    assert any("1 loop is taken as exact pins" in note for note in robot.notes)


def test_a_connect_to_the_world_is_one_to_the_root(tmp_path: Path) -> None:
    """A crank whose rod is pinned to the world: nothing moves it but its crank."""
    parts = joint("crank", ("base", "arm"), (0.0, 0.0)) + joint("knee", ("arm", "rod"), (0.3, 0.0))
    slide = joint("slide", ("rod", "tip"), (0.1, 0.0), 'type="prismatic"').replace("0 0 1", "1 0 0")
    urdf = f'<robot name="slider"><link name="base"/>{parts}{slide}</robot>'
    model = """<mujoco><compiler angle="radian"/><worldbody><frame pos="0 0 1" euler="0 0 0.5"><body name="base">
    <body name="arm"><joint name="crank"/><body name="rod" pos="0.3 0 0"><joint name="knee"/>
    <body name="tip" pos="0.1 0 0"><joint name="slide" type="slide" axis="1 0 0"/></body></body></body></body></frame>
    </worldbody><equality><connect body1="tip" anchor="0.2 0.05 0"/></equality></mujoco>"""
    robot = pb.load(*written(tmp_path, urdf, "slider.xml", model))
    assert robot.coordinates == ("crank",)
    for q in (np.array([-0.3]), np.array([0.4])):
        np.testing.assert_allclose(
            frames(robot, q, "tip")[0].act(np.array([0.2, 0.05, 0.0])), [0.6, 0.05, 0.0], atol=1e-14
        )


def test_linear_joint_equalities_are_followers(tmp_path: Path) -> None:
    both = SITES + '<joint joint1="motor_r" joint2="motor_l" polycoef="0.1 -1"/><connect name="off" active="false"/>'
    robot = pb.load(*written(tmp_path, five_bar('type="fixed"'), "robot.xml", mjcf(both)))
    assert robot.coordinates == ("motor_l",)
    theta = dict(zip(robot.coupling.joints, robot.coupling.expand(np.array([0.2])), strict=True))
    assert theta["motor_r"] == pytest.approx(-0.1)
    assert any("'off' is not active there" in note for note in robot.notes)


MJCF_FAULTS = {
    "weld": (mjcf(ANCHOR + '<weld name="hold" body1="rod_l" body2="rod_r"/>'), "'hold' is a <weld>"),
    "curve": (mjcf('<joint joint1="motor_r" joint2="motor_l" polycoef="0 1 2"/>'), "it is no linear equation"),
    "fixed": (mjcf('<joint joint1="motor_r"/>'), "None is not a moving joint"),
    "moved": (mjcf(ANCHOR).replace('pos="0.1 0.2 0"', 'pos="0.1 0.2001 0"'), "body 'rod_r' is not where link 'rod_r'"),
    "turned": (mjcf(ANCHOR).replace('"rod_r" pos', '"rod_r" euler="0 0 1" pos'), "body 'rod_r' is not where"),
    "axis": (mjcf(ANCHOR, ' axis="0 1 1"'), "body 'crank_l' moves about another axis"),
    "beside": (mjcf(ANCHOR, ' pos="0 0.1 0"'), "body 'crank_l' moves about another axis"),
    "body": (mjcf(ANCHOR.replace("rod_r", "rod")), "names the body 'rod', which does not exist"),
    "site": (mjcf(SITES.replace("tip_r", "top")), "names the site 'top'"),
    "link": (mjcf(ANCHOR).replace("rod_r", "rad_r"), "body 'rad_r' is not a link of the URDF"),
    "anchor": (mjcf(ANCHOR.replace("anchor", "anker")), "no body1 with an anchor"),
    "include": (mjcf(ANCHOR, more='<include file="rest.xml"/>'), "includes 'rest.xml', which is not read"),
    "urdf": ("<robot/>", "starts with <robot>, not with <mujoco>"),
    "copies": (mjcf(ANCHOR).replace("</worldbody>", '<replicate count="2"/></worldbody>'), "<replicate> is not read"),
}


@pytest.mark.parametrize("fault", MJCF_FAULTS)
def test_an_mjcf_model_that_cannot_be_taken_is_refused_by_name(tmp_path: Path, fault: str) -> None:
    text, said = MJCF_FAULTS[fault]
    with pytest.raises(pb.InputError) as refused:
        pb.load(*written(tmp_path, five_bar('type="fixed"'), "robot.xml", text))
    assert said in str(refused.value)
    assert "robot.xml" in str(refused.value)


@pytest.mark.parametrize(
    "turn",
    ['quat="0.8 0 0 0.6"', 'axisangle="0 0 2 ANGLE"', 'euler="0 0 ANGLE"', 'xyaxes="0.28 0.96 0 -1 0.2 0"'],
)
def test_orientations_of_mjcf_are_read_in_every_form(tmp_path: Path, turn: str) -> None:
    angle = math.atan2(0.96, 0.28)
    urdf = five_bar('type="fixed"').replace('xyz="0.1 0.2 0" rpy="0 0 0.0"', f'xyz="0.1 0.2 0" rpy="0 0 {angle!r}"')
    given = turn.replace("ANGLE", repr(math.degrees(angle)))
    model = mjcf(ANCHOR).replace('"rod_r" pos', f'"rod_r" {given} pos')
    robot = pb.load(*written(tmp_path, urdf, "robot.xml", model))
    for q in some_q(robot)[:3]:
        a, b = frames(robot, q, "rod_l", "rod_r")
        here = frames(robot, np.zeros(2), "rod_r")[0].actInv(np.array([0.0, 0.45, 0.0]))
        np.testing.assert_allclose(a.act(np.array([0.2, 0.25, 0.0])), b.act(here), atol=1e-13)
