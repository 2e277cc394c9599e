"""Home is within all limits, mimic joints' too, and as near to zero as they allow."""

from collections.abc import Callable

import numpy as np
import pytest

import pinbound as pb
from pinbound.model.coupling import LinearLimit
from pinbound.robot.home import coordinate_ends, feasible_start
from robots import joint, robot_xml

Load = Callable[..., pb.Robot]
ANY = np.full(2, np.nan)
NAMES = ("x", "y")


def limit(c: list[float], lower: float, upper: float, offset: float = 0.0) -> LinearLimit:
    return LinearLimit("j", np.array(c), offset, lower, upper)


def test_the_limit_of_a_mimic_joint_moves_home(load_text: Load) -> None:
    joints = [joint("a", "revolute", "base", "l"), joint("f", "revolute", "l", "m", mimic="a 1 0.5", limit="-0.2 0.2")]
    robot = load_text(robot_xml(joints, {}, []))
    assert robot.home.tolist() == [pytest.approx(-0.5)]
    assert robot.notes[-1] == "home of 'a' is -0.5, the middle of its limits: zero is outside them"
    assert robot.boundaries.limits("a", robot.home).blocked_by == ()
    marked = '<pinbound:home a="-0.7"/>'  # on the limit of the mimic joint
    assert load_text(robot_xml(joints, {}, [], marked)).home.tolist() == [-0.7]
    with pytest.raises(pb.InputError, match="outside the limits of 'f'"):
        load_text(robot_xml(joints, {}, [], '<pinbound:home a="-0.70001"/>'))


def test_a_coordinate_that_home_does_not_name_is_put_within_its_limits(load_text: Load) -> None:
    joints = [
        joint("a", "revolute", "base", "l"),
        joint("b", "revolute", "l", "m", limit="1 2"),
        joint("f", "revolute", "m", "n", mimic="a 2 -1", limit="0.5 1"),
    ]
    robot = load_text(robot_xml(joints, {}, [], '<pinbound:home b="1.25"/>'))
    assert robot.home.tolist() == [pytest.approx(0.875), 1.25]


def test_limits_that_leave_nothing_are_refused(load_text: Load) -> None:
    joints = [
        joint("a", "revolute", "base", "l", limit="-1 1"),
        joint("f", "revolute", "l", "m", mimic="a 1 5", limit="-1 1"),
    ]
    with pytest.raises(pb.InputError, match="no configuration keeps all joint limits: at zero 'f' is 5"):
        load_text(robot_xml(joints, {}, []))


def test_one_sided_limits_give_their_end() -> None:
    q, reasons = feasible_start([limit([2.0, 0.0], 1.0, np.inf)], ANY, NAMES)
    assert q is not None
    assert (q.tolist(), reasons) == ([0.5, 0.0], {"x": "the end of its limits"})
    assert coordinate_ends([limit([0.0, -2.0], -1.0, np.inf, 0.5)], 2).tolist() == [[-np.inf, np.inf], [-np.inf, 0.75]]


@pytest.mark.parametrize("seed", range(20))
def test_limits_of_several_coordinates_are_kept_with_the_least_change(seed: int) -> None:
    rng = np.random.default_rng(seed)
    inside = rng.uniform(-1.0, 1.0, 2)
    limits = [limit(c, c @ inside - 0.01, c @ inside + 0.02) for c in rng.uniform(-2.0, 2.0, (3, 2))]
    q, _ = feasible_start(limits, ANY, NAMES)
    assert q is not None
    assert all(one.holds(q[None])[0] for one in limits)
    grid = np.stack(np.meshgrid(*[np.linspace(x - 0.5, x + 0.5, 401) for x in inside]), axis=-1).reshape(-1, 2)
    held = grid[np.all([one.holds(grid) for one in limits], axis=0)]
    assert np.abs(q).sum() <= np.abs(held).sum(axis=1).min() + 1e-9
    fixed = np.array([inside[0], np.nan])
    again, _ = feasible_start(limits, fixed, NAMES)
    assert again is not None
    assert again[0] == inside[0]
    assert all(one.holds(again[None])[0] for one in limits)
    assert feasible_start([*limits, limit([1.0, 1.0], 50.0, 60.0)], ANY, NAMES) == (None, {})
