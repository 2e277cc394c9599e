"""Functions with bounds of their derivatives: honest ones are certified, those that contradict themselves refused."""

from pathlib import Path

import numpy as np
import pytest

import pinbound as pb
from mechanisms import sidecar, write
from pinbound.robot.robot import Robot

ARM = """<robot name="arm"><link name="base"/><link name="upper"/><link name="fore"/>
<joint name="a" type="continuous"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/></joint>
<joint name="b" type="continuous"><parent link="upper"/><child link="fore"/><origin xyz="0 0 0.5"/><axis xyz="0 1 0"/>
</joint></robot>"""


@pytest.fixture
def robot(tmp_path: Path) -> Robot:
    points = [("tip", "fore", np.array([0.0, 0.0, 0.4]), 0.02), ("post", "base", np.array([0.3, 0.0, 0.86]), 0.02)]
    return pb.load(write(tmp_path, ARM, sidecar(points, [("tip", "post", 0.0)], {})))


def columns(a, b=0.0):
    return np.column_stack([a, b + 0.0 * a])


def honest(t, order=0):
    return columns(np.sin(t), 0.0) if order == 0 else columns(np.cos(t), 0.0)


def test_honest_bounds_are_believed(robot: Robot) -> None:
    for bound in (None, (1.0, 0.0)):
        found = pb.certify(robot, pb.BoundedMotion(honest, -1.0, 0.2, (1.0, 0.0), bound))
        assert found.verdict is pb.Verdict.CERTIFIED
        assert any("caller's bounds of speed" in note for note in found.notes)
        found = pb.certify(robot, pb.BoundedMotion(honest, -1.0, 1.0, (1.0, 0.0), bound))
        assert found.verdict is pb.Verdict.VIOLATED


def test_a_function_that_forgets_the_order_is_refused(robot: Robot) -> None:
    forgetful = lambda t, order=0: columns(t - 0.3)  # noqa: E731
    with pytest.raises(pb.DimensionError, match="'a' has the derivatives"):
        pb.certify(robot, pb.BoundedMotion(forgetful, 0.0, 1.0, (1.0, 0.0), (0.0, 0.0)))
    with pytest.raises(pb.DimensionError, match="contradicts"):
        pb.certify(robot, pb.BoundedMotion(forgetful, 0.0, 1.0, (1.0, 0.0), (1.0, 0.0)))


def test_a_derivative_of_the_wrong_sign_is_refused(robot: Robot) -> None:
    wrong = lambda t, order=0: columns(t) if order == 0 else columns(0.0 * t - 1.0)  # noqa: E731
    with pytest.raises(pb.DimensionError, match=r"'a' is .* this contradicts the derivative"):
        pb.certify(robot, pb.BoundedMotion(wrong, 0.0, 1.0, (1.0, 0.0), (0.0, 0.0)))


def test_a_derivative_above_the_bound_of_speed_is_refused(robot: Robot) -> None:
    steep = lambda t, order=0: columns(0.0 * t + 1.5 * order)  # noqa: E731
    with pytest.raises(pb.DimensionError, match=r"'a' has the derivative 1.5 .* more than its bound of speed, 1"):
        pb.certify(robot, pb.BoundedMotion(steep, 0.0, 1.0, (1.0, 0.0), (2e3, 0.0)))


def test_speed_that_only_shows_between_equal_steps_is_refused(robot: Robot) -> None:
    beat = lambda t: columns(0.3 * np.sin(64 * np.pi * t) ** 2)  # noqa: E731  zero at every 64th of the duration
    with pytest.raises(pb.DimensionError, match="faster than its bound of speed"):
        pb.certify(robot, pb.BoundedMotion(beat, 0.0, 1.0, (0.01, 0.0)))


def test_a_jump_found_late_in_the_search_is_refused(robot: Robot) -> None:
    """A step between two probes, near contact: the search looks there, and finds it."""
    place = 0.5 + 1e-4
    step = lambda t: columns(0.318 + 1e-3 * (t - 0.5) + 5e-3 * (t > place))  # noqa: E731
    with pytest.raises(pb.DimensionError, match="faster than its bound of speed"):
        pb.certify(robot, pb.BoundedMotion(step, 0.0, 1.0, (1.0, 0.0)))


def test_values_that_change_from_call_to_call_are_refused(robot: Robot) -> None:
    rng = np.random.default_rng(0)
    with pytest.raises(pb.DimensionError, match="faster than its bound of speed, 1, allows"):
        pb.certify(robot, pb.BoundedMotion(lambda t: columns(rng.normal(0, 1e-6) + 0.0 * t), 0.0, 1.0, (1.0, 0.0)))
    with pytest.raises(pb.DimensionError, match="faster than its bound of speed"):  # a value that its neighbours change
        pb.certify(robot, pb.BoundedMotion(lambda t: columns(t - t[0]), 0.0, 1.0, (1.0, 0.0)))


def test_buffers_and_arguments_are_the_callers_own(robot: Robot) -> None:
    """A function may write to its argument, and hand out one buffer again and again: the answer is the same."""
    buffer = np.zeros((2**16, 2))

    def careless(t):
        out = buffer[: len(t)]
        out[:, 0], out[:, 1] = np.sin(t), 0.0
        t[:] = 99.0
        return out

    for span in ((-1.0, 0.2), (-1.0, 1.0)):
        found = pb.certify(robot, pb.BoundedMotion(careless, *span, (1.0, 0.0)))
        plain = pb.certify(robot, pb.BoundedMotion(honest, *span, (1.0, 0.0)))
        assert (found.verdict, found.lower, found.upper) == (plain.verdict, plain.lower, plain.upper)
    speed = np.array([1.0, 0.0])
    motion = pb.BoundedMotion(honest, -1.0, 1.0, speed)
    pb.certify(robot, motion)
    assert speed.tolist() == [1.0, 0.0]


def test_the_function_is_not_asked_beyond_its_ends(robot: Robot) -> None:
    start, end = 0.1, 0.1 + 0.2

    def only_here(t):
        assert np.all((t >= start) & (t <= end))
        return columns(t)

    assert pb.certify(robot, pb.BoundedMotion(only_here, start, end, (1.0, 0.0))).verdict is not None


@pytest.mark.parametrize(
    ("motion", "message"),
    [
        (pb.BoundedMotion(honest, 0.0, 1.0, (1.0,)), r"bound of speed has shape \(1,\)"),
        (pb.BoundedMotion(honest, 0.0, 1.0, 1.0), r"bound of speed has shape \(\)"),
        (pb.BoundedMotion(honest, 0.0, 1.0, (1.0, np.nan)), "give finite numbers, 0 or more"),
        (pb.BoundedMotion(honest, 0.0, 1.0, (1.0, -1.0)), "0 or more"),
        (pb.BoundedMotion(honest, 0.0, 1.0, (1.0, 0.0), (1.0, np.inf)), "bounds of acceleration are"),
        (pb.BoundedMotion(honest, 0.0, 1.0, ("fast", 0.0)), "not an array of numbers"),
        (pb.BoundedMotion(honest, 1.0, 0.0, (1.0, 0.0)), "finite times in order"),
        (pb.BoundedMotion(honest, 0.0, np.inf, (1.0, 0.0)), "finite times in order"),
        (pb.BoundedMotion(honest, "now", 1.0, (1.0, 0.0)), "not an array of numbers"),
        (pb.BoundedMotion(honest, -1e308, 1e308, (1.0, 0.0)), "finite times in order"),
        (pb.BoundedMotion("motion", 0.0, 1.0, (1.0, 0.0)), "give a function of time"),
        (pb.BoundedMotion(lambda t: np.zeros((2, len(t))), 0.0, 1.0, (1.0, 0.0)), r"gives shape \(2, 65|gives shape"),
        (pb.BoundedMotion(lambda t: None, 0.0, 1.0, (1.0, 0.0)), "shape|not an array"),
        (pb.BoundedMotion(lambda t: columns(t) + 0j, 0.0, 1.0, (1.0, 0.0)), "complex"),
        (
            pb.BoundedMotion(lambda t: columns(np.where(t < 0.7, 0.0, np.nan)), 0.0, 1.0, (1.0, 0.0)),
            "not finite at t = 0.7",
        ),
        (
            pb.BoundedMotion(lambda t: columns(2 * t), 0.0, 1.0, (2.0, 0.0), (0.0, 0.0)),
            r"function\(t, 1\) cannot be called",
        ),
        (pb.BoundedMotion(lambda t: columns(0.0 * t), 0.0, 1.0, (1e300, 0.0)), "may reach"),
        (
            pb.BoundedMotion(lambda t: np.zeros((1, 2)) if len(t) == 1 else np.zeros((3, 2)), 0, 1, (0, 0)),
            "gives shape",
        ),
    ],
)
def test_bad_functions_get_one_clear_error(robot: Robot, motion, message: str) -> None:
    with pytest.raises(pb.DimensionError, match=message):
        pb.certify(robot, motion)


def test_records_compare_and_hash_without_raising() -> None:
    one, two = (pb.BoundedMotion(honest, 0.0, 1.0, np.ones(2)) for _ in range(2))
    assert one != two
    assert len({one, two, one}) == 2
