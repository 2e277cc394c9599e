"""Normalised before anything reads it: printed multiples of pi/2, axes of any length, an implied world."""

import math
from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import pinbound as pb
from pinbound.model.normalise import quarter_turns, unit_vector
from robots import joint, robot_xml

Load = Callable[..., pb.Robot]
HALF = math.pi / 2


def elbow(pi: str) -> str:
    """Return an elbow that turns its axis upside down twice: with pi exact, its arms align at one angle."""
    return robot_xml(
        [
            joint("a", "revolute", "base", "upper", axis="0 0 1", limit="-1 1"),
            joint("level", "revolute", "upper", "helper", axis="0 0 1", xyz="0.4 0 0", rpy=f"{pi} 0 0", mimic="a 1 0"),
            joint("b", "revolute", "helper", "fore", axis="0 0 1", rpy=f"{pi} 0 0", limit="-2.5 2.5"),
        ],
        {"p": ("upper", "0.6 0.1 0"), "s": ("fore", f"{math.hypot(0.2, 0.1)} 0 0")},
        [("p", "s")],
        '<pinbound:home b="-0.4"/>',
    )


@settings(max_examples=300, deadline=None, derandomize=True)
@given(st.integers(-8, 8).filter(bool), st.integers(3, 14), st.booleans(), st.sampled_from(["", "00", "e0", "E+00"]))
def test_every_rounding_or_cut_of_a_quarter_turn_is_recognised(k: int, digits: int, cut: bool, tail: str) -> None:
    scale = 10**digits
    value = (math.trunc(k * HALF * scale) if cut else round(k * HALF * scale)) / scale
    word = f"{value:.{digits}f}{tail}"
    if abs(float(word) - k * HALF) <= 1e-14 or abs(float(word) - k * HALF) > 5e-4:
        assert quarter_turns(word) is None
    else:
        assert quarter_turns(word) == k


@settings(max_examples=200, deadline=None, derandomize=True)
@given(st.integers(-8, 8).filter(bool), st.integers(4, 12), st.integers(2, 50), st.sampled_from([-1, 1]))
def test_what_its_digits_tell_from_a_quarter_turn_stays(k: int, digits: int, units: int, side: int) -> None:
    value = round(k * HALF * 10**digits) + side * units
    assume(value % 10 != 0)  # zeros at the end may be padding: 1.570800 prints pi/2
    assume(abs(value / 10**digits - float(np.float32(k * HALF))) > 10**-digits)
    assert quarter_turns(f"{value / 10**digits:.{digits}f}") is None


def test_single_precision_is_a_rounding_too() -> None:
    assert quarter_turns("1.57079637") == 1
    assert quarter_turns(repr(float(np.float32(math.pi)))) == 2
    assert quarter_turns("1.57079647") is None


@pytest.mark.parametrize("pi", ["3.14159265359", "3.1415926", "3.14159", "3.1416", "-3.142", "3.14159265358979"])
def test_printed_pi_gives_the_answers_of_pi(load_text: Load, pi: str) -> None:
    exact, printed = load_text(elbow(repr(math.pi))), load_text(elbow(pi))
    want, found = exact.boundaries["p_s"].contact, printed.boundaries["p_s"].contact
    assert want is not None
    assert found is not None
    assert found.angle == pytest.approx(want.angle, abs=1e-12)
    assert pb.certify(printed, [[0.2, 1.0], [0.2, 2.0]]).verdict is pb.certify(exact, [[0.2, 1.0], [0.2, 2.0]]).verdict
    assert (f"{pi} as" in " ".join(printed.notes)) is (pi != "3.14159265358979")
    data = [robot.model.createData() for robot in (exact, printed)]
    for robot, one in zip((exact, printed), data, strict=True):
        pin.framesForwardKinematics(robot.model, one, robot.coupling.expand([0.3, 0.7]))
    assert np.abs(data[0].oMf[-1].homogeneous - data[1].oMf[-1].homogeneous).max() < 1e-14


def test_an_angle_near_pi_that_does_not_print_it_is_taken_and_noted(load_text: Load) -> None:
    robot = load_text(elbow("3.1410"))
    assert robot.boundaries["p_s"].contact is None
    assert any("nearly parallel" in note and "'level' and 'b'" in note for note in robot.notes)


@pytest.mark.parametrize("length", ["1e-320", "1e-200", "1e-3", "2", "1e200", "1.7e308"])
def test_an_axis_of_any_length_is_its_direction(load_text: Load, length: str) -> None:
    arm = joint("q", "revolute", "base", "a", axis="0 -{0} 0", xyz="0.1 0 0").format(length)
    robot = load_text(robot_xml([arm], {"p": ("base", "0 0 1"), "s": ("a", "0.3 0.2 0")}, [("p", "s")]))
    unit = load_text(
        robot_xml(
            [joint("q", "revolute", "base", "a", axis="0 -1 0", xyz="0.1 0 0")],
            *[{"p": ("base", "0 0 1"), "s": ("a", "0.3 0.2 0")}, [("p", "s")]],
        )
    )
    Q = np.linspace(-3, 3, 13)[:, None]
    assert np.array_equal(robot.boundaries.norms(Q), unit.boundaries.norms(Q))
    assert len(robot.notes) >= 1
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, np.array([0.7]))
    expected = pin.Quaternion(math.cos(0.35), 0.0, -math.sin(0.35), 0.0).matrix()
    assert np.abs(data.oMf[robot.model.getFrameId("a")].rotation - expected).max() < 1e-15


def test_unit_vectors_lose_nothing_at_both_ends_of_float64() -> None:
    assert unit_vector((3e-320, 0.0, 4e-320))[2] == pytest.approx(0.8, abs=1e-3)  # subnormal numbers have few digits
    assert np.linalg.norm(unit_vector((1e308, -1e308, 1e308))) == pytest.approx(1.0, abs=1e-15)


def test_a_world_that_no_link_declares_is_the_root(load_text: Load) -> None:
    text = (
        '<robot name="r"><link name="b"/><joint name="w" type="fixed"><parent link="world"/><child link="b"/></joint>'
    )
    text += "</robot>"
    robot = load_text(text)
    assert robot.tree.root == "world"
    assert any("'world'" in note for note in robot.notes)
    with pytest.raises(pb.InputError, match="'earth', which is not a link"):
        load_text(text.replace("world", "earth"))


@pytest.mark.parametrize(
    ("limits", "rpy", "note"),
    [
        ('lower="-90" upper="90"', "0 0 0", "limits -90 .. 90 of 'q'"),
        ('lower="0" upper="270"', "0 0 180", "limits 0 .. 270 of 'q', rpy 0 0 180 of 'q'"),
        ('lower="-1e16" upper="1e16"', "0 0 3.5", None),
        ('lower="-6.28" upper="12.5"', "0 0 -6.2832", None),
    ],
)
def test_angles_that_look_like_degrees_are_noted(load_text: Load, limits: str, rpy: str, note: str | None) -> None:
    robot = load_text(
        f'''<robot name="r"><link name="a"/><link name="b"/><joint name="q" type="revolute"><parent link="a"/>
<child link="b"/><origin rpy="{rpy}"/><axis xyz="0 1 0"/><limit {limits} effort="1" velocity="1"/></joint></robot>'''
    )
    said = [one for one in robot.notes if "degrees" in one]
    assert said == ([f"angles are read as radians, and these look like degrees: {note}"] if note else [])
