"""The window of a plane: whose limits bound it, what is too wide, and starts that limits allow or forbid."""

import time
from collections.abc import Callable

import numpy as np
import pytest

import pinbound as pb
from pinbound.tolerances import LIMIT
from robots import joint, robot_xml

Load = Callable[..., pb.Robot]


def names(region: pb.Region) -> list[str]:
    return [edge.name for edge in region.edges]


def held(load_text: Load) -> pb.Robot:
    joints = [
        joint("q1", "revolute", "base", "a", axis="0 0 1", limit="-1 1"),
        joint("q2", "revolute", "a", "b", limit="-1 1"),
        joint("q3", "revolute", "b", "c", xyz="0 0 1", limit="-1 1"),
        joint("g", "revolute", "a", "d", mimic="q1 1 0.3", limit="-0.4 0.8"),
    ]
    return load_text(robot_xml(joints, {}, []))


@pytest.mark.parametrize(
    ("q1", "whose"), [(5.0, "'q1'"), (-0.8, "'g'"), (0.6, "g = q1 \\+ 0.3 is 0.9"), (0.5 + 1e-9, "'g'")]
)
def test_a_held_coordinate_out_of_the_limits_of_any_joint_is_refused(load_text: Load, q1: float, whose: str) -> None:
    robot = held(load_text)
    with pytest.raises(pb.DimensionError, match=whose):
        pb.feasible_region(robot, ("q2", "q3"), at=[q1, 0.0, 0.0])
    stops = robot.boundaries.limits("q2", [q1, 0.0, 0.0])
    assert stops.blocked_by


@pytest.mark.parametrize("q1", [0.5, -0.7, 0.5 + 0.5 * LIMIT])
def test_a_held_coordinate_on_a_limit_is_allowed(load_text: Load, q1: float) -> None:
    region = pb.feasible_region(held(load_text), ("q2", "q3"), at=[q1, 0.0, 0.0])
    assert region.area == pytest.approx(4.0)


def test_home_on_limits_of_its_own_plane(load_text: Load) -> None:
    joints = [
        joint("lift", "prismatic", "base", "a", axis="0 0 1", limit="0 0.04"),
        joint("tilt", "revolute", "a", "b", limit="0 2"),
    ]
    robot = load_text(robot_xml(joints, {}, []))
    region = pb.feasible_region(robot, ("lift", "tilt"))
    assert region.area == pytest.approx(0.08)
    assert region.contains(robot.home)
    assert region.vertices.min() == 0.0
    mark = '<pinbound:point name="p" link="b" xyz="0 0 0.3" radius="0.02"/>'
    mark += '<pinbound:point name="o" link="base" xyz="0.25 0 0.2" radius="0.02"/>'
    curved = load_text(robot_xml(joints, {}, [], mark + '<pinbound:boundary name="p_o" a="p" b="o"/>'))
    region = pb.feasible_region(curved, ("lift", "tilt"))
    assert region.accuracy > 0.0
    assert region.contains(curved.home)
    assert region.contains([0.04, 0.0])


def followed(load_text: Load, kind: str = "continuous", limit: str = "-1 1", mimic: str = "q1 2 0") -> pb.Robot:
    joints = [
        joint("q1", kind, "base", "a"),
        joint("q2", "revolute", "a", "b", xyz="0 0 0.5", limit="-1 1"),
        joint("f", "revolute", "base", "c", xyz="1 0 0", mimic=mimic, limit=limit),
    ]
    return load_text(robot_xml(joints, {}, []))


@pytest.mark.parametrize(
    ("limit", "mimic", "ends"),
    [
        ("-1 1", "q1 2 0", (-0.5, 0.5)),
        ("-1 0.5", "q1 -2 0.25", (-0.125, 0.625)),
        ("-0.1 3", "q1 0.001 0", (-100.0, 3000.0)),
    ],
)
def test_the_limit_of_a_mimic_joint_bounds_a_continuous_one(
    load_text: Load, limit: str, mimic: str, ends: tuple[float, float]
) -> None:
    robot = followed(load_text, limit=limit, mimic=mimic)
    region = pb.feasible_region(robot, ("q1", "q2"))
    assert (region.vertices[:, 0].min(), region.vertices[:, 0].max()) == pytest.approx(ends)
    assert sorted(set(names(region))) == ["f lower", "f upper", "q2 lower", "q2 upper"]
    stops = robot.boundaries.limits("q1", robot.home)
    assert (stops.lower, stops.upper) == pytest.approx(ends)


def test_whichever_is_tightest_names_the_side(load_text: Load) -> None:
    robot = followed(load_text)
    region = pb.feasible_region(robot, ("q1", "q2"), window={"q1": (-3, 0.2), "q2": (-0.5, 5)})
    assert names(region) == ["q1 window upper", "q2 upper", "f lower", "q2 window lower"]
    assert region.with_clearance(0.0).area == pytest.approx(region.area)


def test_a_limit_of_both_coordinates_bounds_one_that_has_none(load_text: Load) -> None:
    """A parallelogram's crank: q2 is limited, and so is q3 - q2, but q3 is not."""
    joints = [
        joint("q2", "revolute", "base", "a", limit="-1 1"),
        joint("q3", "continuous", "base", "c"),
        joint("drag", "revolute", "a", "rod", mimic="q2 -1 0"),
        joint("elbow", "revolute", "rod", "b", xyz="0 0 1", mimic="q3 1 0", limit="-0.5 0.75"),
    ]
    robot = load_text(robot_xml(joints, {}, []))
    assert names(pb.feasible_region(robot, ("q2", "q3"))) == ["q2 upper", "elbow upper", "q2 lower", "elbow lower"]
    coupled = pb.region.slice.HalfPlane
    from pinbound.region.window import box_of

    sides = [
        coupled("q2", "q2 upper", np.array([1.0, 0.0]), 1.0, False),
        coupled("q2", "q2 lower", np.array([-1.0, 0.0]), 1.0, False),
        coupled("d", "d upper", np.array([-1.0, 2.0]), 0.5, False),
        coupled("d", "d lower", np.array([1.0, -2.0]), 0.25, False),
    ]
    _, top, _, low = box_of(("q2", "q3"), sides, {})  # q3 <= (0.5 + 1) / 2, q3 >= -(0.25 + 1) / 2, and a little more
    assert 0.75 < top.bound < 0.8
    assert 0.625 < low.bound < 0.68


FAR = [
    joint("q1", "revolute", "base", "a", limit="{0} {1}"),
    joint("q2", "revolute", "a", "b", xyz="0 0 0.5", limit="-2.5 2.5"),
]
MARKS = (
    '<pinbound:point name="p" link="base" xyz="0.3 0 0" radius="0.05"/>'
    '<pinbound:point name="s" link="a" xyz="0 0 0.3" radius="0.05"/>'
    '<pinbound:point name="e" link="b" xyz="0 0 0.4" radius="0.05"/>'
)


@pytest.mark.parametrize("end", [1e3, 1e6, 1e9, 1e16, 1.7e308])
@pytest.mark.parametrize("pairs", [["s"], ["e"], ["s", "e"]])
def test_limits_that_are_none_are_refused_at_once_with_a_remedy_that_works(
    load_text: Load, end: float, pairs: list[str]
) -> None:
    joints = [text.format(-end, end) for text in FAR]
    bounds = "".join(f'<pinbound:boundary name="p_{other}" a="p" b="{other}"/>' for other in pairs)
    robot = load_text(robot_xml(joints, {}, [], MARKS + bounds))
    begun = time.process_time()
    if pairs == ["s"] and end <= 1e6:  # straight edges: the gap around the start needs no other turn
        region = pb.feasible_region(robot, ("q1", "q2"))
        stops = robot.boundaries.limits("q1", robot.home)
        assert (region.vertices[:, 0].min(), region.vertices[:, 0].max()) == pytest.approx((stops.lower, stops.upper))
        if end > 1e3:
            with pytest.raises(pb.UnsupportedError, match=r"very wide.*window=\{'q1'"):
                _ = region.components
    else:
        with pytest.raises(pb.PinboundError, match=r"window=\{'q1': \(lower, upper\)\}.*--window q1=LOWER\.\.UPPER"):
            pb.feasible_region(robot, ("q1", "q2"))
    assert time.process_time() - begun < 5.0
    region = pb.feasible_region(robot, ("q1", "q2"), window={"q1": (-3.0, 3.0)})
    assert region.contains(robot.home)


@pytest.mark.parametrize(
    ("window", "match"),
    [
        ({"q1": (1.0, -1.0)}, "lower first"),
        ({"q1": (0.0, float("nan"))}, "two numbers"),
        ({"q1": (0.0, 1.0, 2.0)}, "two numbers"),
        ({"q1": 3.0}, "two numbers"),
        ({"q1": (0.2, 0.9)}, "q1 window lower"),
        ({"q1": (1.5, 2.5)}, "has no range"),
        ({"q9": (0.0, 1.0)}, "coordinate of the window"),
    ],
)
def test_windows_that_are_none_say_so(load_text: Load, window: dict[str, tuple[float, float]], match: str) -> None:
    with pytest.raises(pb.PinboundError, match=match):
        pb.feasible_region(followed(load_text), ("q1", "q2"), window=window)


@pytest.mark.parametrize(
    ("coordinates", "error", "match"),
    [
        (("q1", "q1"), pb.UnsupportedError, "you gave 1"),
        (("q1",), pb.UnsupportedError, "you gave 1"),
        ((), pb.UnsupportedError, "you gave 0"),
        (("q1", "q2", "q1"), pb.UnsupportedError, "two coordinates"),
        (("q1", "f"), pb.UnsupportedError, "mimic joint, 2 q1"),
        (("q1", "q9"), pb.UnknownNameError, "q9"),
        (("q1", 2), pb.UnknownNameError, "2"),
        ("q1,q2", pb.UnsupportedError, "the text 'q1,q2'"),
        ("q1", pb.UnsupportedError, "the text 'q1'"),
    ],
)
def test_planes_that_are_none_say_so(load_text: Load, coordinates: object, error: type[Exception], match: str) -> None:
    with pytest.raises(error, match=match):
        pb.feasible_region(followed(load_text), coordinates)  # pyright: ignore[reportArgumentType]


def test_a_budget_that_runs_out_says_what_is_left(load_text: Load) -> None:
    joints = [text.format(-3, 3) for text in FAR]
    robot = load_text(robot_xml(joints, {}, [], MARKS + '<pinbound:boundary name="p_e" a="p" b="e"/>'))
    with pytest.raises(pb.UnsupportedError, match=r"budget of 1e-09 s; left: p_e; give a larger budget"):
        pb.feasible_region(robot, budget=1e-9)
    region = pb.feasible_region(robot, budget=float("inf"))
    with pytest.raises(pb.UnsupportedError, match=r"inset by 0\.1"):
        region.inset(0.1, budget=1e-9)
    for wrong in (0.0, -1.0, float("nan")):
        with pytest.raises(pb.DimensionError, match="budget"):
            pb.feasible_region(robot, budget=wrong)
