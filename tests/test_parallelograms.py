"""Loops of open trees: parallelograms are recognised by geometry and proven, all others refused with their sides."""

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import pinbound as pb
from robots import joint, random_q, robot_xml

Load = Callable[..., pb.Robot]


def closure(a: tuple[str, str], b: tuple[str, str], **extra: str) -> str:
    more = "".join(f' {key}="{value}"' for key, value in extra.items())
    return f'<pinbound:closure name="loop" link_a="{a[0]}" xyz_a="{a[1]}" link_b="{b[0]}" xyz_b="{b[1]}"{more}/>'


def four_bar(width: float = 0.3, height: float = 0.5, far: float = 0.5, tilt: float = 0.0, extra: str = "") -> str:
    """Return an open four-bar: base - left - coupler, base - right, and the pin between coupler and right."""
    joints = [
        joint("left", "revolute", "base", "a", rpy=f"0 {tilt} 0"),
        joint("middle", "revolute", "a", "b", xyz=f"0 0 {height}", rpy=f"0 {-tilt} 0"),
        joint("right", "revolute", "base", "c", xyz=f"{width} 0 0", rpy=f"0 {tilt} 0"),
    ]
    return robot_xml(joints, {}, [], closure(("b", f"{width} 0 0"), ("c", f"0 0 {far}")) + extra)


def gap_by_pinocchio(robot: pb.Robot, Q: np.ndarray) -> float:
    model, mark = robot.model, robot.closures[0].mark
    data, worst = model.createData(), 0.0
    for theta in robot.coupling.expand(Q):
        pin.framesForwardKinematics(model, data, theta)
        ends = [
            data.oMf[model.getFrameId(link)] * np.array(xyz)
            for link, xyz in ((mark.link_a, mark.xyz_a), (mark.link_b, mark.xyz_b))
        ]
        worst = max(worst, float(np.linalg.norm(ends[0] - ends[1])))
    return worst


@pytest.mark.parametrize("tilt", [0.0, 0.4])
def test_a_four_bar_becomes_one_coordinate(load_text: Load, tilt: float) -> None:
    robot = load_text(four_bar(tilt=tilt))
    assert robot.coordinates == ("left",)
    assert {name: robot.coupling.text(name) for name in robot.coupling.joints} == {
        "left": "left",
        "middle": "- left",
        "right": "left",
    }
    assert gap_by_pinocchio(robot, random_q(robot, 200, seed=0)) < 1e-14
    assert robot.closures[0].bound < 1e-12
    assert any("'middle' follows - left" in note for note in robot.notes)


def test_passive_joints_can_be_named(load_text: Load) -> None:
    text = four_bar().replace('name="loop"', 'name="loop" passive="left middle"')
    assert load_text(text).coordinates == ("right",)
    with pytest.raises(pb.InputError, match="'elbow', which does not exist"):
        load_text(four_bar().replace('name="loop"', 'name="loop" passive="elbow"'))


def palletizer(rod: float = 0.4, tail: str = "-0.1 0 0.05") -> str:
    joints = [
        joint("arm", "revolute", "base", "a", axis="0 1 0"),
        joint("elbow", "revolute", "a", "b", axis="0 -1 0", xyz="0 0 0.4"),
        joint("crank", "revolute", "base", "c", axis="0 1 0", xyz="0 0.02 0"),
        joint("rod", "continuous", "c", "d", axis="0 1 0", xyz="-0.1 -0.02 0.05"),
    ]
    points = {"p": ("a", "0.05 0 0.3"), "s": ("b", "0.1 0 0.05"), "t": ("d", "0 0 0.2")}
    return robot_xml(joints, points, [("p", "s"), ("p", "t")], closure(("d", f"0 0 {rod}"), ("b", tail)))


def test_an_open_palletizer_keeps_arm_and_crank(load_text: Load) -> None:
    robot = load_text(palletizer())
    assert robot.coordinates == ("arm", "crank")
    assert robot.coupling.text("elbow") == "arm - crank"
    assert robot.coupling.text("rod") == "arm - crank"
    assert gap_by_pinocchio(robot, random_q(robot, 200, seed=1)) < 1e-14
    assert robot.boundaries["p_s"].contact is not None
    assert robot.boundaries["p_s"].contact.text == "crank - arm"


def test_limits_of_joints_that_became_passive_bind_the_active_ones(load_text: Load) -> None:
    robot = load_text(palletizer().replace('name="elbow"', 'name="elbow"').replace('lower="-3"', 'lower="-0.7"', 2))
    limit = next(limit for limit in robot.linear_limits if limit.joint == "elbow")
    assert limit.coefficients.tolist() == [1.0, -1.0]
    assert (limit.lower, limit.upper) == (-0.7, 3.0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (four_bar(width=0.5), "_"),
        (palletizer(tail="-0.1 0.01 0.05"), "10 mm apart along the axis"),
        (palletizer(tail="-0.1 0 -0.05"), r"open by 100 mm in the pose that home gives"),
    ],
)
def test_what_is_no_parallelogram_is_refused_with_its_sides(load_text: Load, text: str, message: str) -> None:
    if message == "_":  # a rhombus has equal sides in every pairing; the pose tells the opposite ones
        assert load_text(text).coordinates == ("left",)
        return
    with pytest.raises(pb.InputError, match=message) as caught:
        load_text(text)
    assert "ends are" in str(caught.value)


@pytest.mark.parametrize("text", [four_bar(far=0.45), palletizer(rod=0.39)])
def test_sides_that_differ_by_far_make_another_linkage_which_is_said(load_text: Load, text: str) -> None:
    robot = load_text(text)
    assert any(re.search(r"no parallelogram: its sides of .* mm are not equal in two pairs", n) for n in robot.notes)
    with pytest.raises(pb.UnsupportedError, match="is not a parallelogram"):
        _ = robot.coupling.S


def test_an_anti_parallelogram_is_told_apart(load_text: Load) -> None:
    """Sides 0.6 and 0.2 with the coupler folded back: the same lengths, the other assembly."""
    a, b = 0.6, 0.2
    for left in (0.5, 1.0):
        end = np.array([a * np.sin(left), a * np.cos(left)])
        to_right = np.array([b, 0.0]) - end
        distance = np.linalg.norm(to_right)
        # the coupler end is at distance b from `end` and a from the right pivot: take the crossed solution
        x = (b**2 - a**2 + distance**2) / (2 * distance)
        h = np.sqrt(b**2 - x**2)
        along, across = to_right / distance, np.array([-to_right[1], to_right[0]]) / distance
        candidates = [end + x * along + s * h * across for s in (1, -1)]
        crossed = max(candidates, key=lambda p: float(np.linalg.norm(p - (end + np.array([b, 0.0])))))
        coupler = crossed - end
        middle = float(np.arctan2(-coupler[1], coupler[0])) - left
        rod = crossed - np.array([b, 0.0])
        right = float(np.arctan2(rod[0], rod[1]))
        pose = f'<pinbound:home left="{left}" middle="{middle}" right="{right}"/>'
        robot = load_text(four_bar(width=b, height=a, far=a, extra=pose).replace('lower="-3"', 'lower="-4"'))
        assert any("anti-parallelogram" in note for note in robot.notes)
        assert robot.coupling.expand(robot.home) == pytest.approx([left, middle, right], abs=1e-9)


def test_a_flat_pose_does_not_tell_the_assembly(load_text: Load) -> None:
    quarter = np.pi / 2
    flat = f'<pinbound:home left="{quarter}" middle="{-quarter}" right="{quarter}"/>'
    with pytest.raises(pb.InputError, match="flat in the pose"):
        load_text(four_bar(width=0.5, extra=flat))
    clear = '<pinbound:home left="0.3" middle="-0.3" right="0.3"/>'
    assert load_text(four_bar(extra=clear)).home.tolist() == [0.3]


def test_home_of_a_passive_joint_must_be_where_the_loop_puts_it(load_text: Load) -> None:
    text = palletizer().replace(
        "<pinbound:closure", '<pinbound:home arm="0.2" crank="0.2" elbow="0.0"/><pinbound:closure'
    )
    assert load_text(text).home.tolist() == [0.2, 0.2]


def test_two_loops_that_share_links_are_coupled_one_after_the_other(load_text: Load) -> None:
    joints = [
        joint("j1", "revolute", "base", "a"),
        joint("j2", "revolute", "a", "b", xyz="0 0 0.5"),
        joint("j3", "revolute", "base", "c", xyz="0.3 0 0"),
        joint("j4", "revolute", "c", "d", xyz="0 0 0.5"),
        joint("j5", "revolute", "base", "e", xyz="0.8 0 0"),
    ]
    second = closure(("d", "0.5 0 0"), ("e", "0 0 0.5")).replace('"loop"', '"second"')
    robot = load_text(robot_xml(joints, {}, [], second + closure(("b", "0.3 0 0"), ("c", "0 0 0.5"))))
    assert robot.coordinates == ("j1",)
    assert robot.closure_residuals(random_q(robot, 50, seed=2)).max() < 1e-14


def test_the_turn_of_a_passive_joint_is_that_of_the_assembled_pose(load_text: Load) -> None:
    """Angles are not wrapped: a cable that is wound up once stays wound up."""
    pose = f'<pinbound:home arm="0" crank="0" elbow="0" rod="{2 * np.pi}"/>'
    robot = load_text(palletizer().replace("<pinbound:closure", pose + "<pinbound:closure"))
    assert robot.coupling.row("rod")[1] == pytest.approx(2 * np.pi, abs=1e-15)
    assert gap_by_pinocchio(robot, random_q(robot, 20, seed=3)) < 1e-14


def bars(ground: float, crank: float, pose: float, extra: str = "", coupler: float | None = None) -> str:
    """Return a four-bar drawn along x, pivots on one line at zero, its crank turning by `pose` at home."""
    joints = [
        joint("jA", "revolute", "base", "a", axis="0 0 1"),
        joint("jB", "revolute", "a", "b", axis="0 0 1", xyz=f"{crank} 0 0"),
        joint("jD", "revolute", "base", "c", axis="0 0 1", xyz=f"{ground} 0 0"),
    ]
    ends = closure(("b", f"{coupler or ground} 0 0"), ("c", f"{crank} 0 0"))
    home = f'<pinbound:home jA="{pose!r}" jB="{-pose!r}" jD="{pose!r}"/>' if pose else ""
    return robot_xml(joints, {}, [], home + ends + extra)


@pytest.mark.parametrize("pose", [0.0, 1e-9, 1e-5, 1e-3, np.pi, -np.pi + 1e-4, 3.1416])
@pytest.mark.parametrize("ground", [0.25, 0.1])
def test_a_loop_drawn_flat_does_not_say_its_assembly(load_text: Load, pose: float, ground: float) -> None:
    """Sides of two lengths, or a rhombus: with all pivots on one line the crossed assembly fits as well."""
    with pytest.raises(pb.InputError, match="flat in the pose that home gives"):
        load_text(bars(ground, 0.1, pose).replace('lower="-3" upper="3"', 'lower="-4" upper="4"'))
    assert load_text(bars(ground, 0.1, 0.01)).coordinates == ("jA",)


def test_a_kite_is_no_anti_parallelogram(load_text: Load) -> None:
    """Ground 0.3 and crank 0.3, coupler 0.1 and rocker 0.1: neighbours are equal."""
    a, b, turn = 0.3, 0.1, 0.5
    end = a * np.exp(1j * turn)
    half, along = abs(end - a) / 2, (end - a) / abs(end - a)
    pin = (end + a) / 2 + 1j * along * np.sqrt(b * b - half * half)
    home = {"jA": turn, "jB": float(np.angle(pin - end)) - turn, "jD": float(np.angle(pin - a))}
    pose = "<pinbound:home " + " ".join(f'{name}="{value!r}"' for name, value in home.items()) + "/>"
    text = bars(a, a, 0.0, pose).replace('link_a="b" xyz_a="0.3 0 0"', f'link_a="b" xyz_a="{b} 0 0"')
    robot = load_text(text.replace('xyz_b="0.3 0 0"', f'xyz_b="{b} 0 0"'))
    assert any("it is a kite" in note for note in robot.notes)


@pytest.mark.parametrize(("ground", "crank"), [(0.0, 0.1), (0.25, 0.0), (0.0, 0.0)])
def test_sides_of_no_length_make_no_parallelogram(load_text: Load, ground: float, crank: float) -> None:
    with pytest.raises(pb.InputError, match=r"sides of|gap of|nothing|not a planar loop"):
        load_text(bars(ground, crank, 0.5, coupler=0.25))


def test_a_pin_that_is_off_in_every_pose_is_said_to_be(load_text: Load) -> None:
    joints = [
        joint("j", "revolute", "base", "arm"),
        joint("s", "continuous", "base", "side", xyz="0.2 0 0", mimic="j 1 0"),
        joint("b", "continuous", "arm", "bar", xyz="0 0 0.4", mimic="j -1 0"),
    ]
    with pytest.raises(pb.InputError, match=r"gap of 15 mm is the same in every pose. Correct xyz_a") as said:
        load_text(robot_xml(joints, {}, [], closure(("bar", "0.215 0 0"), ("side", "0 0 0.4"))))
    assert "planar loop" not in str(said.value)


def test_rounding_of_the_data_needs_a_tolerance_that_says_so(load_text: Load) -> None:
    """1.7 um more than a parallelogram: the message says by how much, and what to write."""
    text = bars(0.25, 0.1, 1.0, coupler=0.2500017).replace('lower="-3" upper="3"', 'lower="0.2" upper="2.9"', 1)
    with pytest.raises(pb.InputError, match=r"differ by 1\.7 um, its tolerance is 1 um\. .* the tolerance 2e-06"):
        load_text(text)
    robot = load_text(text.replace('name="loop"', 'name="loop" tolerance="2e-6"'))
    assert robot.closures[0].mark.tolerance == 2e-6
    assert {one.joint for one in robot.closures[0].deviations} == {"jB", "jD"}
    with pytest.raises(pb.InputError, match="tolerance = -1 is negative"):
        load_text(text.replace('name="loop"', 'name="loop" tolerance="-1"'))


def test_passive_joints_may_have_spaces_in_their_names(load_text: Load) -> None:
    text = four_bar().replace('"middle"', '"middle pin"').replace('"right"', '"right pin"')
    body = text.replace(closure(("b", "0.3 0 0"), ("c", "0 0 0.5")), "")
    loop = "closures: [{name: loop, link_a: b, xyz_a: [0.3, 0, 0], link_b: c, xyz_b: [0, 0, 0.5], passive: [%s]}]\n"
    robot = load_text(body, loop % '"middle pin", right pin')
    assert robot.coupling.text("middle pin") == "- left"
    assert pb.Annotations.load(robot.document.path.with_name("robot.pinbound.yaml")) == replace(
        robot.annotations, home_line=None
    )
    saved = robot.annotations.to_yaml()
    assert load_text(body, saved).annotations.closures[0].passive == ("middle pin", "right pin")
    robot.document.path.with_name("robot.pinbound.yaml").unlink()
    inline = text.replace('name="loop"', 'name="loop" passive="middle pin right pin"')
    assert load_text(inline).annotations.closures[0].passive == ("middle pin", "right pin")
    two = inline.replace('"left"', '"middle"')
    assert load_text(two).annotations.closures[0].passive == ("middle pin", "right pin")
    with pytest.raises(pb.InputError, match="'elbow', which does not exist"):
        load_text(body, loop % "elbow, right pin")


def test_names_that_can_be_read_in_two_ways_are_not_guessed(load_text: Load) -> None:
    text = four_bar().replace('"left"', '"m"').replace('"middle"', '"m m"').replace('"right"', '"r"')
    with pytest.raises(pb.InputError, match="can be read as"):
        load_text(text.replace('name="loop"', 'name="loop" passive="m m m r"'))
