"""Free volumes against exact areas, Monte Carlo, and every box against samples of it."""

import math
from pathlib import Path

import numpy as np
import pytest

import pinbound as pb
from robots import joint, robot_xml
from test_polytope import CAPSULES, POST, SLIDING, TWO, load, marks


def samples_agree(robot: pb.Robot, found: pb.FreeVolume, seed: int = 0) -> None:
    """Samples of boxes proven free are free, and the interval holds the share of free samples of the whole box."""
    rng = np.random.default_rng(seed)
    axes = [robot.coordinates.index(name) for name in found.coordinates]

    def free(points: np.ndarray) -> np.ndarray:
        Q = np.tile(found.at, (len(points), 1))
        Q[:, axes] = points
        return robot.boundaries.free(Q) if len(robot.boundaries) else robot.intervals.hold(Q)

    boxes = found.free[rng.integers(0, len(found.free), 5_000)]
    assert np.all(free(boxes[:, 0] + rng.uniform(size=(5_000, len(axes))) * (boxes[:, 1] - boxes[:, 0])))
    share = np.mean(free(rng.uniform(found.box[0], found.box[1], (40_000, len(axes)))))
    spread = 5.0 * math.sqrt(0.25 / 40_000)
    assert found.lower / found.volume - spread <= share <= found.upper / found.volume + spread


def test_an_exact_area_lies_in_the_interval() -> None:
    robot = pb.load("minervabot_v3")
    found = pb.free_volume(robot, ("q2", "q3"), decided=0.9999)
    area = pb.feasible_region(robot).area
    assert found.lower < area < found.upper
    assert found.upper - found.lower <= 1e-4 * found.volume
    assert found.reason is None
    samples_agree(robot, found)


@pytest.mark.parametrize("text", [POST, CAPSULES, SLIDING], ids=["spheres", "capsules", "slides"])
def test_boxes_of_spatial_robots(text: str, tmp_path: Path) -> None:
    robot = load(text, tmp_path)
    found = pb.free_volume(robot, robot.coordinates[-3:], decided=0.98)
    assert found.decided >= 0.98
    assert found.lower > 0.0
    samples_agree(robot, found)
    pieces = np.prod(np.diff(found.free, axis=1), axis=(1, 2)).sum()
    assert pieces == pytest.approx(found.lower, rel=1e-9)
    assert found.upper - found.lower == pytest.approx(np.prod(np.diff(found.open, axis=1), axis=(1, 2)).sum(), rel=1e-9)


def test_rules_with_conditions_count() -> None:
    robot = pb.load("palletizers/dobot_mg400")
    found = pb.free_volume(robot, ("J2", "J3"), decided=0.999)
    samples_agree(robot, found)
    two = [pb.certified_polytope(robot, np.radians(q), limits_only=True) for q in ([0, 0, 0, 0], [0, -22, 10, 0])]
    first, second = (float(one.factors[1].volume[0]) for one in two)
    rng = np.random.default_rng(0)
    Q = np.zeros((100_000, 4))
    Q[:, 1:3] = rng.uniform(found.box[0], found.box[1], (100_000, 2))
    both = np.mean(two[0].contains(Q) & two[1].contains(Q)) * found.volume
    assert found.lower - 0.05 < first + second - both < found.upper + 0.05


def test_nothing_free_and_all_free_are_decided_at_once(tmp_path: Path) -> None:
    robot = load(POST, tmp_path)
    held = robot_xml(
        [*TWO, joint("q3", "revolute", "b", "c", axis="0 0 1", xyz="0 0 0.35"), joint("q4", "revolute", "c", "d")],
        {},
        [],
        marks([("w", "base", "0.5 0 0.3", 0.1), ("t", "b", "0 0 0.35", 0.05)], [("w", "t")]),
    )
    (tmp_path / "b").mkdir()
    four = load(held, tmp_path / "b")
    contact = [0.6, 1.3, 0.0, 0.0]
    assert not robot.boundaries.free(contact[:2])
    none = pb.free_volume(four, ("q3", "q4"), at=contact, decided=1.0)
    assert (none.lower, none.decided) == (0.0, pytest.approx(1.0, abs=1e-12))
    assert none.upper < 1e-12 * none.volume
    everything = pb.free_volume(four, ("q3", "q4"), at=[0.0, 0.0, 0.0, 0.0], decided=0.999)
    assert everything.lower > 0.999 * everything.volume


def test_a_passage_of_a_ten_thousandth_of_a_radian_is_not_lost(tmp_path: Path) -> None:
    """Free is 1e-4 rad between two contacts of the first joint: too narrow for samples, and proven all the same."""
    arm, post = 0.4, 0.1
    at = post / arm  # half the angle that a post of this radius takes at this distance, to first order
    reach = 2.0 * math.asin(at / 2.0) + 5e-5
    places = [
        (f"w{k}", "base", f"{arm * math.sin(s * reach)} 0 {0.1 + arm * math.cos(s * reach)}", post)
        for k, s in ((0, 1), (1, -1))
    ]
    text = robot_xml(TWO, {}, [], marks([*places, ("t", "a", "0 0 0.4", 0.0)], [("w0", "t"), ("w1", "t")]))
    robot = load(text, tmp_path)
    found = pb.free_volume(robot, ("q1", "q2"), window={"q1": (-0.2, 0.2)}, decided=0.99999)
    width = found.volume / 0.4
    assert found.lower / width == pytest.approx(1e-4, abs=1e-5)
    polytope = pb.certified_polytope(robot, [0.0, 0.0])
    assert polytope.volume == pytest.approx(1e-4 * 6.0, rel=1e-3)


def test_a_budget_that_is_spent_and_faults(tmp_path: Path) -> None:
    robot = load(CAPSULES, tmp_path)
    found = pb.free_volume(robot, ("j2", "j3", "j4"), budget=pb.Budget(boxes=500, seconds=60.0))
    assert found.reason is not None
    assert found.decided < 0.99
    assert len(found.open) > 0
    with pytest.raises(pb.UnsupportedError, match="two to four"):
        pb.free_volume(robot, ("j1",))
    with pytest.raises(pb.UnknownNameError, match="j9"):
        pb.free_volume(robot, ("j1", "j9"))
    with pytest.raises(pb.DimensionError, match="share"):
        pb.free_volume(robot, ("j1", "j2"), decided=0.0)


def test_what_limits_leave_beyond_the_box_is_not_proven_to_be_in_contact() -> None:
    """A mimic joint of slope 0.01 is within its limit until its coordinate is 1e-10 beyond it, out of contact there."""
    joints = [
        joint("a", "revolute", "base", "l1", xyz="0 0 1", limit="-2 2"),
        joint("b", "revolute", "l1", "l2", xyz="0 0 1", limit="-2 2"),
        joint("c", "revolute", "l2", "l3", xyz="0 0 1", limit="-0.01 0.01", mimic="b 0.01 0"),
        joint("d", "revolute", "l2", "l4", xyz="0 0 1", limit="-1 1"),
    ]
    marks_ = [pb.Point("p", "l1", (0.0, 0.0, 2.0)), pb.Point("r", "l2", (0.0, 0.0, 1.0), 2.0 * math.sin(0.5 + 2.5e-11))]
    found = pb.Annotations.of(marks_, [pb.BoundaryMark("near", "p", "r")], home={"b": 1.0 + 9e-11})
    robot = pb.load(robot_xml(joints, {}, [])).with_annotations(found)
    assert robot.boundaries.free(np.array([[0.0, 1.0, 0.0], [0.0, 1.0 + 9e-11, 0.0]])).tolist() == [False, True]
    projection = pb.free_projection(robot, ("a", "d"), budget=pb.Budget(boxes=20_000, seconds=60.0))
    assert not len(projection.outside)
