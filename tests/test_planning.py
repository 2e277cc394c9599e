"""Plans against certificates made anew, separations against gaps, and a wall that a straight motion cannot pass."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import shapely
from scipy.sparse import csgraph

import pinbound as pb
from pinbound.freespace.pieces import free_union
from pinbound.freespace.vertices import Factor
from robots import joint, robot_xml
from test_polytope import CAPSULES, POST, load, marks

WALL = robot_xml(
    [joint("q1", "revolute", "base", "a", xyz="0 0 0.1"), joint("q2", "revolute", "a", "b", xyz="0 0 0.4")],
    {},
    [],
    marks([("w", "base", "0.4 0 0.1", 0.31), ("t", "b", "0 0 0.35", 0.05)], [("w", "t")]),
)
"""The tip is 0.05 to 0.75 m from the first joint, and the sphere holds all of one ray of that: no motion passes it."""


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
        assert str(found.coverage) in repr(found.certificate)
        assert pb.certify(robot, found.waypoints).verdict is pb.Verdict.CERTIFIED
        assert np.array_equal(found.waypoints, [start, goal])
        assert found.length == pytest.approx(np.linalg.norm(goal - start))


def test_a_contact_between_is_a_proof_that_there_is_no_motion() -> None:
    robot = pb.load("minervabot_v3")
    region = pb.feasible_region(robot)
    found = pb.plan(robot, robot.home, [9.0, 0.0, 0.0])
    assert (found.verdict, found.separated_by) == (pb.Verdict.VIOLATED, "q1 upper")
    assert "goal" in found.notes[0]
    assert found.coverage is None  # nothing was certified
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


def test_a_joint_without_limits_is_planned_and_where_it_was_looked_is_said(tmp_path: Path) -> None:
    robot = load(POST.replace('name="q1" type="revolute"', 'name="q1" type="continuous"'), tmp_path)
    assert robot.upper[0] == np.inf
    found = pb.plan(robot, [-0.2, 1.3], [1.6, 1.3])
    assert found.verdict is pb.Verdict.CERTIFIED
    assert pb.certify(robot, found.waypoints).verdict is pb.Verdict.CERTIFIED
    short = pb.plan(robot, [-0.2, 1.3], [1.6, 1.3], budget=pb.Budget(boxes=3, seconds=5.0))
    assert short.verdict is pb.Verdict.UNDECIDED
    assert short.notes[0] == "'q1' has no limits: plan() searched between -6.48319 and 7.88319 rad only"


def test_no_budget_is_undecided(tmp_path: Path) -> None:
    robot = load(POST, tmp_path)
    found = pb.plan(robot, [-0.2, 1.3], [1.6, 1.3], budget=pb.Budget(boxes=0, seconds=0.0))
    assert found.verdict is pb.Verdict.UNDECIDED
    assert "does not prove that there is none" in found.notes[0]


def shapely_length(polygons: list[shapely.Polygon], start: np.ndarray, goal: np.ndarray) -> float:
    """Return the length of the shortest way in a union of polygons by shapely's own union and predicates."""
    whole = shapely.union_all(polygons)
    room = whole.buffer(1e-7)
    nodes = [start, goal, *np.array(whole.exterior.coords)[:-1]]
    length = np.zeros((len(nodes), len(nodes)))
    for i, a in enumerate(nodes):
        for j, b in enumerate(nodes[:i]):
            if room.covers(shapely.LineString([a, b])):
                length[i, j] = np.linalg.norm(a - b)
    return float(csgraph.dijkstra(length, directed=False, indices=0)[1])


def test_the_shortest_way_around_a_rule_with_a_condition() -> None:
    """The plane of J2 and J3 is not convex; J1 and J4 go evenly along."""
    robot = pb.load("palletizers/dobot_mg400")
    union = free_union(robot, [], np.zeros(4), {})
    assert union is not None
    polygons = []
    for A, b in union:
        polytope = Factor(np.array([1, 2]), np.arange(0), *planar(A, b))
        polygons.append(shapely.MultiPoint(polytope.vertices).convex_hull)
    start = np.array([-1.0, -0.40, 0.05, 0.5])
    for J2, J3 in ((-0.33, -0.43), (-0.3, -0.3), (-0.2, -0.42), (-0.3315, -0.05)):
        goal = np.array([2.0, J2, J3, -1.0])
        assert not np.all(robot.intervals.hold(np.linspace(start, goal, 2000)))
        way = pb.plan(robot, start, goal, limits_only=True)
        assert (way.verdict, way.found_by) == (pb.Verdict.CERTIFIED, "shortest")
        assert np.array_equal(way.waypoints[[0, -1]], [start, goal])
        in_plane = np.linalg.norm(np.diff(way.waypoints[:, 1:3], axis=0), axis=1).sum()
        assert in_plane == pytest.approx(shapely_length(polygons, start[1:3], goal[1:3]), abs=1e-6)
        assert way.length == pytest.approx(np.hypot(in_plane, np.linalg.norm((goal - start)[[0, 3]])), abs=1e-9)
        assert pb.certify(robot, way.waypoints, limits_only=True).verdict is pb.Verdict.CERTIFIED


def planar(A: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    rows = np.any(A[:, 1:3] != 0.0, axis=1)
    return A[rows, 1:3], b[rows]


def test_a_smooth_cycle_keeps_velocities_and_is_certified() -> None:
    """Twice continuously differentiable, and no faster than allowed, whatever a dense look says."""
    robot = pb.load("minervabot_v3")
    region = pb.feasible_region(robot)
    near = region.centroid + (1.0 - 1e-6) * (region.vertices - region.centroid)
    fastest = np.array([2.0, 1.0, 1.5])
    stops = np.column_stack([np.linspace(-2.0, 2.0, len(near)), near])
    for start, goal in pairwise(stops[:4]):
        found = pb.plan(robot, start, goal, velocity=dict(zip(robot.coordinates, fastest.tolist(), strict=True)))
        assert found.motion_certificate is not None
        assert found.motion_certificate.verdict is pb.Verdict.CERTIFIED
        assert pb.certify(robot, found.motion).verdict is pb.Verdict.CERTIFIED
        times = np.linspace(found.motion.x[0], found.motion.x[-1], 2001)
        assert np.all(np.abs(found.motion.derivative()(times)) <= fastest)
        assert np.allclose(found.motion(times[[0, -1]]), [start, goal], atol=1e-12)
        assert np.allclose(found.motion.derivative()(times[[0, -1]]), 0.0, atol=1e-9)
        assert np.all(np.abs(np.diff(found.waypoints, axis=0)) <= fastest * np.diff(found.times)[:, None])
    with pytest.raises(pb.DimensionError, match="positive and finite"):
        pb.plan(robot, robot.home, robot.home, velocity=[1.0, 0.0, 1.0])
    with pytest.raises(pb.UnknownNameError):
        pb.plan(robot, robot.home, robot.home, velocity={"q9": 1.0})


def test_through_the_sets_of_a_cover(tmp_path: Path) -> None:
    robot = load(POST, tmp_path)
    cover = pb.certified_cover(robot, share=0.95, budget=pb.Budget(10**9, 300.0))
    start, goal = np.array([-0.2, 1.3]), np.array([1.6, 1.3])
    found = pb.plan(robot, start, goal, cover=cover, velocity=1.0)
    assert (found.verdict, found.found_by) == (pb.Verdict.CERTIFIED, "sets")
    assert pb.certify(robot, found.waypoints).verdict is pb.Verdict.CERTIFIED
    motion = found.motion
    assert pb.certify(robot, motion).verdict is pb.Verdict.CERTIFIED
    for order in (0, 1, 2):
        before, after = (motion.derivative(order)(motion.x[1:-1] + step) for step in (-1e-9, 1e-9))
        assert np.allclose(before, after, atol=1e-5)
    rng = np.random.default_rng(0)
    Q = rng.uniform(robot.lower, robot.upper, (100, 2))
    Q = Q[robot.boundaries.free(Q)][:40]
    for a, b in zip(Q[::2], Q[1::2], strict=True):
        way = pb.plan(robot, a, b, cover=cover)
        assert way.verdict is pb.Verdict.CERTIFIED
        assert pb.certify(robot, way.waypoints).verdict is pb.Verdict.CERTIFIED
        assert np.array_equal(way.waypoints[[0, -1]], [a, b])
    other = load(POST.replace('radius="0.1"', 'radius="0.11"'), tmp_path)
    with pytest.raises(pb.UnsupportedError, match="certified_cover"):
        pb.plan(other, start, goal, cover=cover)


def test_a_cover_proves_that_there_is_no_motion(tmp_path: Path) -> None:
    """Around a pair of two angles no gap of one angle tells; every box of the wall is proven in contact."""
    robot = load(WALL, tmp_path)
    assert robot.boundaries[0].rule.strips() is None
    start, goal = np.array([-0.5, 0.1]), np.array([2.5, 0.1])
    few = pb.Budget(boxes=200_000, seconds=0.5)
    assert pb.plan(robot, start, goal, budget=few).verdict is pb.Verdict.UNDECIDED
    cover = pb.certified_cover(robot, share=0.97, budget=pb.Budget(10**9, 300.0))
    found = pb.plan(robot, start, goal, cover=cover)
    assert (found.verdict, found.separated_by) == (pb.Verdict.VIOLATED, "cover")
    same_side = pb.plan(robot, start, np.array([-2.0, 1.0]), cover=cover)
    assert same_side.verdict is pb.Verdict.CERTIFIED
    coarse = pb.certified_cover(robot, share=0.3, budget=pb.Budget(10**9, 300.0))
    assert pb.plan(robot, start, goal, cover=coarse, budget=few).verdict is not pb.Verdict.CERTIFIED
