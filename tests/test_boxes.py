"""Boxes: every part of them is looked at, budgets are totals, and bad input gets one clear error."""

import time
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

import pinbound as pb
from mechanisms import random_robot
from oracles import JointData, Machine
from pinbound.certificates.boxes import _Boxes


@pytest.fixture(scope="module")
def robot() -> pb.robot.Robot:
    return pb.load("minervabot_v3")


def test_halves_are_exact_and_leave_no_gap() -> None:
    rng = np.random.default_rng(0)
    boxes = _Boxes(np.zeros(1, np.intp), np.zeros((1, 3)), np.ones((1, 3)))
    for _ in range(100):
        boxes = boxes.halved(rng.random(boxes.width.shape))
        volume = sum(Fraction(float(w[0])) * Fraction(float(w[1])) * Fraction(float(w[2])) for w in boxes.width)
        assert volume == 1 or len(boxes) < 2
        if len(boxes) > 64:
            break
    tail = _Boxes(np.zeros(1, np.intp), np.zeros((1, 1)), np.ones((1, 1)))
    for _ in range(40):  # always the second half: 1 - 2^-k, exact
        tail = tail.halved(np.ones(tail.width.shape)).take(slice(-1, None))
    assert tail.start[0, 0] == 1.0 - 2.0**-40
    assert tail.start[0, 0] + tail.width[0, 0] == 1.0


def test_rounding_of_centres_does_not_grow_with_depth(tmp_path: Path) -> None:
    """A slide far from zero: what is open of a box that touches contact is bounded by corners within rounding of it."""
    joints = [JointData("prismatic", 0, axis=(1.0, 0.0, 0.0)), JointData("prismatic", 1, axis=(0.0, 1.0, 0.0))]
    machine = Machine(joints, home={0: 2.0, 1: 2.0})
    machine.marks = {"a": (2, "point", {"xyz": (0.0, 0.0, 0.0)}), "b": (0, "point", {"xyz": (0.0, 0.0, 0.0)})}
    machine.boundaries = [("a", "b", 1.0)]
    robot = machine.load(tmp_path)
    third = 1.0 / 3.0
    low, high = np.array([1.0, -third]), np.array([1e6 + third, third])
    found = pb.certify_box(robot, low, high, budget=pb.Budget(50_000))
    assert found.verdict is pb.Verdict.UNDECIDED
    for box in found.open_boxes:
        assert np.all(box.lower_corner >= low)
        assert np.all(box.upper_corner <= high)
        assert np.all(box.lower_corner <= box.upper_corner)
    low[0] = 1.0 + 1e-6
    assert pb.certify_box(robot, low, high, budget=pb.Budget(200_000)).verdict is pb.Verdict.CERTIFIED
    low[0] = 1.0 - 1e-6
    found = pb.certify_box(robot, low, high, budget=pb.Budget(200_000))
    assert found.verdict is pb.Verdict.VIOLATED
    assert np.all((found.witness >= low) & (found.witness <= high))


def test_a_box_without_width_agrees_with_a_motion_that_stands_still(tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    for k in range(8):
        robot = random_robot(rng, tmp_path, ["planar", "spatial"][k % 2], k % 3 == 2)
        if robot is None:
            continue
        for q in robot.home + rng.normal(0, 1, (10, len(robot.home))):
            assert pb.certify_box(robot, q, q).verdict is pb.certify(robot, [q]).verdict


@pytest.mark.parametrize(
    ("lower", "upper", "message"),
    [
        ([0.0, 1.0, 0.0], [1.0, 0.5, 1.0], "'q2': 1 above 0.5; swap them"),
        ([0.0, np.nan, 0.0], [1.0, 1.0, 1.0], "not finite"),
        ([0.0, 0.0, 0.0], [1.0, np.inf, 1.0], "not finite"),
        ([0.0, 0.0], [1.0, 1.0], "shape"),
        ([[0.0, 0.0, 0.0]], [1.0, 1.0, 1.0], "one configuration"),
        (np.zeros((1, 1, 3)), [1.0, 1.0, 1.0], "shape"),
        (["a", "b", "c"], [1.0, 1.0, 1.0], "not an array of numbers"),
        ([0j, 0.0, 0.0], [1.0, 1.0, 1.0], "complex"),
        ([-1e200, 0.0, 0.0], [1.0, 1.0, 1.0], "'q1' may reach 1e\\+200"),
        (None, [1.0, 1.0, 1.0], "shape|not an array"),
    ],
)
def test_bad_corners_get_one_clear_error(robot, lower, upper, message: str) -> None:
    with pytest.raises(pb.DimensionError, match=message):
        pb.certify_box(robot, lower, upper)


@pytest.mark.parametrize("reach", [0.0, -1.0, np.nan, np.inf, 1e200, [1.0, 2.0]])
def test_bad_reach(robot, reach) -> None:
    with pytest.raises(pb.DimensionError, match="reach"):
        pb.certified_box(robot, robot.home, reach=reach)


@pytest.mark.parametrize("amount", [{"boxes": -1}, {"seconds": -1.0}, {"seconds": np.nan}, {"boxes": np.nan}])
def test_a_budget_that_would_never_be_spent_is_refused(amount) -> None:
    with pytest.raises(pb.DimensionError, match="budget"):
        pb.Budget(**amount)


def seven(folder: Path) -> pb.robot.Robot:
    """Return an arm of seven skew joints with ten pairs of points: a box of it is hard to grow."""
    axes = [(0.0, 0.0, 1.0), (0.0, 1.0, 0.0)]
    joints = [JointData("revolute", i, (0.05, 0.0, 0.3), axis=axes[i % 2], limits=(-3.0, 3.0)) for i in range(7)]
    machine = Machine(joints, home=dict.fromkeys(range(7), 0.3))
    machine.marks = {f"p{i}": (i, "point", {"xyz": (0.0, 0.05, 0.1), "radius": 0.05}) for i in range(8)}
    machine.boundaries = [(f"p{i}", f"p{j}", 0.0) for i in range(8) for j in range(i + 3, 8)]
    return machine.load(folder)


def test_the_budget_of_a_growing_box_is_a_total(tmp_path: Path) -> None:
    robot = seven(tmp_path)
    for budget in (pb.Budget(20_000, 30.0), pb.Budget(2_000_000, 0.5)):
        started = time.perf_counter()
        box = pb.certified_box(robot, robot.home, budget=budget)
        assert box.verdict is pb.Verdict.CERTIFIED
        assert box.boxes <= budget.boxes * 1.5 + 2**13
        assert time.perf_counter() - started < budget.seconds + 5.0  # one batch, on a machine that others use
        assert np.any(box.lower_corner < robot.home)
        assert pb.certify_box(robot, box.lower_corner, box.upper_corner).verdict is not pb.Verdict.VIOLATED


def test_a_spent_budget_is_said(tmp_path: Path) -> None:
    robot = seven(tmp_path)
    box = pb.certified_box(robot, robot.home, budget=pb.Budget(300, 30.0))
    assert box.verdict is pb.Verdict.CERTIFIED
    assert any("budget was spent" in note for note in box.notes)
    assert pb.certified_box(pb.load("minervabot_v3"), [0.0, 0.6, 0.45]).notes == ()


def test_a_step_that_looks_wrapped_is_told(tmp_path: Path) -> None:
    """The obstacle stands at pi: a recording that wraps there has met it, and the long way round does not."""
    text = """<robot name="wheel" xmlns:pinbound="urn:pinbound:1"><link name="base"/><link name="hand"/>
<joint name="turn" type="continuous"><parent link="base"/><child link="hand"/><axis xyz="0 0 1"/></joint>
<pinbound:annotations><pinbound:point name="p" link="base" xyz="-1 0 0" radius="0.01"/>
<pinbound:point name="s" link="hand" xyz="1 0 0"/><pinbound:boundary name="b" a="p" b="s"/></pinbound:annotations>
</robot>"""
    (tmp_path / "wheel.urdf").write_text(text)
    wheel = pb.load(tmp_path / "wheel.urdf")
    recorded = np.array([[2.9], [3.1], [-3.1], [-2.9]])
    found = pb.certify(wheel, recorded)
    assert found.verdict is pb.Verdict.CERTIFIED
    assert any("'turn' turns by -355.234 deg from waypoint 1 to 2" in note and "unwrap" in note for note in found.notes)
    unwrapped = pb.certify(wheel, np.unwrap(recorded, axis=0))
    assert unwrapped.verdict is pb.Verdict.VIOLATED
    for steps in (np.unwrap(recorded, axis=0), [[0.2], [6.1], [0.2]], [[3.0], [-3.0]]):
        notes = [note for note in pb.certify(wheel, steps).notes if "unwrap" in note]
        assert len(notes) == (0 if steps[0][0] == 2.9 else 1)
    assert pb.certify(wheel, [[-2.0], [2.0], [8.0]]).notes == ()
    still = text.replace('type="continuous"', 'type="fixed"').split("<pinbound:annotations>")[0] + "</robot>"
    (tmp_path / "still.urdf").write_text(still)
    assert pb.certify(pb.load(tmp_path / "still.urdf"), np.zeros((2, 0))).verdict is pb.Verdict.NOTHING_TO_CHECK


def test_numbers_that_look_like_degrees_are_told(robot) -> None:
    found = pb.certify(robot, [[0.0, 0.0, 0.0], [30.0, 20.0, 40.0]])
    assert found.verdict is pb.Verdict.VIOLATED
    assert any("look like degrees" in note and "40" in note for note in found.notes)
    box = pb.certify_box(robot, [-30.0, 0.0, 0.0], [30.0, 20.0, 40.0])
    assert any("look like degrees" in note for note in box.notes)
    for waypoints in ([[0.0, 0.0, 0.0], [0.5, 0.3, 0.4]], [[0.0, 0.0, 0.0], [3.0, 0.3, 0.4]]):
        assert [note for note in pb.certify(robot, waypoints).notes if "degrees" in note] == []


@pytest.mark.parametrize(
    ("waypoints", "times", "message"),
    [
        (np.zeros((1, 2, 3)), None, "shape"),
        ([0.0 + 0j, 0.0, 0.0], None, "complex"),
        (np.array([["0", "1", "2"]]), None, "not an array of numbers"),
        (np.array([[0, 1, None]], dtype=object), None, "not an array|not finite"),
        (np.ma.masked_array([[0.0, 1.0, 2.0]], [[False, True, False]]), None, "masked"),
        (np.zeros((2, 3)), np.array([0.0, 1.0]) * 1j, "complex"),
        (np.zeros((2, 3)), ["0", "1"], "not an array of numbers"),
        (np.zeros((2, 3)), [-1e308, 1e308], "too far apart"),
        ([[0.0, 1e150, 0.0]], None, "may reach"),
        (np.array([["2020-01-01"] * 3], dtype="datetime64[D]"), None, "not an array of numbers"),
    ],
)
def test_what_is_no_motion_gets_one_clear_error(robot, waypoints, times, message: str) -> None:
    with pytest.raises(pb.DimensionError, match=message):
        pb.certify(robot, waypoints, times)


def test_whole_numbers_and_objects_of_numbers_are_read(robot) -> None:
    wanted = pb.certify(robot, [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    for given in (
        [[0, 0, 0], [1, 0, 0]],
        np.array([[0, 0, 0], [1, 0, 0]], np.int8),
        np.array([[0, 0, 0], [1, 0, 0]], object),
    ):
        assert pb.certify(robot, given).upper == wanted.upper


def test_a_table_of_other_columns_is_refused(robot) -> None:
    class Table:
        """What of a data frame counts here."""

        def __init__(self, columns: list[str]) -> None:
            self.columns = columns

        def __array__(self, dtype=None, copy=None) -> np.ndarray:
            return np.array([[0.0, 0.0, 0.0], [1.0, 0.1, 0.2]])

    with pytest.raises(pb.DimensionError, match="give them in the order q1, q2, q3"):
        pb.certify(robot, Table(["q1", "q3", "q2"]))
    assert pb.certify(robot, Table(["q1", "q2", "q3"])).verdict is pb.Verdict.CERTIFIED


def test_precision_must_be_a_length(robot) -> None:
    for precision in (np.nan, -1.0):
        with pytest.raises(pb.DimensionError, match="precision"):
            pb.certify(robot, [[0.0, 0.0, 0.0]], precision=precision)
