"""Plans against certificates made anew, separations against gaps, and a wall that a straight motion cannot pass."""

from pathlib import Path

import numpy as np
import pytest

import pinbound as pb
from test_polytope import CAPSULES, POST, load


def test_a_pick_and_place_cycle_is_planned_and_certified_again() -> None:
    """Corners of the region to 1e-6: nearer than a margin by scaling about the centroid leaves anything."""
    robot = pb.load("minervabot_v3")
    region = pb.feasible_region(robot)
    near = region.centroid + (1.0 - 1e-6) * (region.vertices - region.centroid)
    assert not np.any(region.scale(0.95).contains(near))
    stops = np.column_stack([np.linspace(-2.0, 2.0, len(near)), near])
    for start, goal in zip(stops, np.roll(stops, -1, axis=0), strict=True):
        found = pb.plan(robot, start, goal)
        assert found.verdict is pb.Verdict.CERTIFIED
        assert pb.certify(robot, found.waypoints).verdict is pb.Verdict.CERTIFIED
        assert np.array_equal(found.waypoints, [start, goal])
        assert found.length == pytest.approx(np.linalg.norm(goal - start))


def test_a_contact_between_is_a_proof_that_there_is_no_motion() -> None:
    robot = pb.load("minervabot_v3")
    region = pb.feasible_region(robot)
    found = pb.plan(robot, robot.home, [9.0, 0.0, 0.0])
    assert (found.verdict, found.separated_by) == (pb.Verdict.VIOLATED, "q1 upper")
    assert "goal" in found.notes[0]
    assert len(found.waypoints) == 0
    edge = next(one for one in region.edges if one.name == "beta_3")
    for step, verdict in ((-1e-9, pb.Verdict.CERTIFIED), (1e-9, pb.Verdict.VIOLATED)):
        goal = 0.5 * (edge.start + edge.end) + [0.0, step]
        assert pb.plan(robot, robot.home, [0.0, *goal]).verdict is verdict


def test_a_strip_between_separates_and_names_it(tmp_path: Path) -> None:
    text = (
        POST.replace('a="w" b="t"', 'a="w" b="e"')
        .replace("</pinbound:annotations>", "")
        .replace(
            "</robot>",
            '<pinbound:point name="e" link="a" xyz="0 0 0.45" radius="0.05"/></pinbound:annotations></robot>',
        )
    )
    robot = load(text, tmp_path)
    assert robot.boundaries[0].rule.strips() is not None
    start, goal = [-0.5, 0.0], [2.5, 0.0]
    assert robot.boundaries.free(start)
    assert robot.boundaries.free(goal)
    found = pb.plan(robot, start, goal)
    assert (found.verdict, found.separated_by) == (pb.Verdict.VIOLATED, "w_t")
    assert found.certificate is None


def test_around_a_post(tmp_path: Path) -> None:
    robot = load(POST, tmp_path)
    start, goal = np.array([-0.2, 1.3]), np.array([1.6, 1.3])
    assert pb.certify(robot, [start, goal]).verdict is pb.Verdict.VIOLATED
    found = pb.plan(robot, start, goal)
    assert found.verdict is pb.Verdict.CERTIFIED
    assert len(found.waypoints) > 2
    assert np.array_equal(found.waypoints[[0, -1]], [start, goal])
    again = pb.certify(robot, found.waypoints)
    assert again.verdict is pb.Verdict.CERTIFIED
    assert again.lower > 0.0


def test_capsules_and_random_ends(tmp_path: Path) -> None:
    robot = load(CAPSULES, tmp_path)
    rng = np.random.default_rng(5)
    Q = rng.uniform(robot.lower, robot.upper, (60, 4))
    Q = Q[robot.boundaries.free(Q)][:4]
    for start, goal in zip(Q[::2], Q[1::2], strict=True):
        found = pb.plan(robot, start, goal, budget=pb.Budget(seconds=3.0))
        if found.verdict is pb.Verdict.CERTIFIED:
            assert pb.certify(robot, found.waypoints).verdict is pb.Verdict.CERTIFIED
            assert np.array_equal(found.waypoints[[0, -1]], [start, goal])
        else:
            assert found.verdict is pb.Verdict.UNDECIDED
            assert found.notes


def test_no_budget_is_undecided(tmp_path: Path) -> None:
    robot = load(POST, tmp_path)
    found = pb.plan(robot, [-0.2, 1.3], [1.6, 1.3], budget=pb.Budget(boxes=0, seconds=0.0))
    assert found.verdict is pb.Verdict.UNDECIDED
    assert "proves nothing" in found.notes[0]
