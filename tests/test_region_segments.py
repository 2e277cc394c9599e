"""Regions of segments, lines and planes: the free set by random points, connectivity by flood fill, refusals."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

import numpy as np
import pytest
import shapely

import pinbound as pb
from segments import MARKS, PLANAR, assemble

Load = Callable[..., pb.Robot]

CASES = {
    "two capsules": ["A_C"],
    "a capsule and a sphere": ["C_p"],
    "a sphere and a capsule": ["A_s"],
    "a capsule above a plane": ["C_floor"],
    "a point before an edge": ["edge_p"],
    "a sphere across a line": ["rod_s"],
    "a sphere across a skew line": ["post_s"],
    "capsules side by side": ["Z_C"],
    "capsules on neighbours": ["A_B"],
    "all": ["A_C", "A_B", "C_p", "C_floor", "edge_p", "rod_s", "B_p"],
}
CHORD = 1e-5  # m: the region's accuracy, 1e-5 rad, where two pieces of a curve meet, on arms below 1 m
HOME = '<pinbound:home q1="-0.4" q2="-0.5"/>'


def separation(robot: pb.Robot, Q: np.ndarray) -> np.ndarray:
    return np.min([boundary.norm(Q) - boundary.contact_distance for boundary in robot.boundaries], axis=0)


@pytest.fixture(scope="module", params=CASES)
def planar(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> pb.Robot:
    path = tmp_path_factory.mktemp("regions") / "planar.urdf"
    path.write_text(assemble(PLANAR, MARKS, CASES[request.param], HOME))
    return pb.load(path)


def test_components_are_the_free_set(planar: pb.Robot) -> None:
    region = pb.feasible_region(planar, ("q1", "q2"))
    parts = (region, *region.components)
    Q = np.random.default_rng(1).uniform(-3, 3, (30_000, 2))
    free = separation(planar, Q) > 0.0
    inside = np.any([part.contains(Q) for part in parts], axis=0)
    drawn = np.any([shapely.contains_xy(part.polygon, *Q.T) for part in parts], axis=0)
    assert np.array_equal(inside, free)
    assert np.abs(separation(planar, Q)[drawn != free]).max(initial=0.0) < 1e-4  # a chord's error
    for part in parts:
        corners = shapely.get_coordinates(part.polygon)
        assert separation(planar, corners).min() > -CHORD
    assert {edge.source for edge in region.edges} <= {*planar.boundaries.names, "q1", "q2"}


def test_edges_lie_on_their_contacts(planar: pb.Robot) -> None:
    region = pb.feasible_region(planar, ("q1", "q2"))
    for edge in region.edges:
        if edge.is_contact:
            boundary = planar.boundaries[edge.name]
            assert np.abs(boundary.norm(edge.points) - boundary.contact_distance).max() < CHORD
        assert np.linalg.norm(np.diff(edge.points, axis=0), axis=1).sum() > 1e-6  # none is a crumb


def test_connectivity_equals_a_flood_fill(planar: pb.Robot) -> None:
    region = pb.feasible_region(planar, ("q1", "q2"))
    nodes = np.linspace(-3, 3, 241)
    grid = np.stack(np.meshgrid(nodes, nodes, indexing="ij"), axis=-1).reshape(-1, 2)
    gap = separation(planar, grid).reshape(241, 241)
    free = gap > 0.0
    start = tuple(int(np.argmin(np.abs(nodes - value))) for value in planar.home)
    reached, queue = {start}, deque([start])
    while queue:
        i, j = queue.popleft()
        for cell in ((i + 1, j), (i - 1, j), (i, j + 1), (i, j - 1)):
            if 0 <= min(cell) and max(cell) < 241 and free[cell] and cell not in reached:
                reached.add(cell)
                queue.append(cell)
    inside = np.asarray(region.contains(grid)).reshape(241, 241)
    flooded = np.zeros_like(free)
    flooded[tuple(np.array(list(reached)).T)] = True
    inner = (np.abs(grid) < 2.99).all(axis=1).reshape(241, 241)
    assert not np.any(inner & flooded & ~inside)
    assert np.abs(gap[inner & inside & ~flooded]).max(initial=0.0) < 0.02  # a wedge thinner than the grid


def test_the_smallest_clearance_over_a_part_is_bounded(planar: pb.Robot) -> None:
    region = pb.feasible_region(planar, ("q1", "q2")).inset(0.3)
    found = region.clearance(1e-3)
    Q = np.random.default_rng(2).uniform(*np.array(region.polygon.bounds).reshape(2, 2), (20_000, 2))
    Q = Q[shapely.contains_xy(region.polygon, *Q.T)]
    least = min(float(np.min(boundary.clearance(Q))) for boundary in planar.boundaries)
    assert found.lower <= least
    assert found.upper - found.lower <= 1.1e-3
    assert planar.boundaries[found.boundary].clearance(found.q) == pytest.approx(found.upper, abs=1e-12)


def test_a_box_in_the_plane_of_several_angles_is_searched_for_and_of_one_is_strips(load_text: Load) -> None:
    box = (
        '<pinbound:sweep name="box" link="base" xyz="0.3 -0.1 0.3" ways="0.2 0 0  0 0.2 0  0 0 0.2"/>'
        '<pinbound:segment name="bar" link="b" xyz_a="0 0.1 0" xyz_b="0 -0.1 0.3" radius="0.01"/>'
        '<pinbound:segment name="arm" link="a" xyz_a="0 0 0.1" xyz_b="0 0 0.6" radius="0.02"/>'
    )
    robot = load_text(assemble(PLANAR, [box], ["box_bar"], HOME))
    region = pb.feasible_region(robot, ("q1", "q2"), width=0.05)
    assert [edge.name for edge in region.edges].count("box_bar") == 1
    assert region.width == 0.05
    robot = load_text(assemble(PLANAR, [box], ["box_arm"], HOME))
    region = pb.feasible_region(robot, ("q1", "q2"))
    assert [edge.name for edge in region.edges].count("box_arm") == 1
    assert region.width == 0.0
    assert region.area_interval == (region.area, region.area)
    (stop,) = (edge for edge in region.edges if edge.name == "box_arm")
    q = robot.home.copy()
    q[0] = stop.start[0]
    assert robot.boundaries["box_arm"].clearance(q) == pytest.approx(0.0, abs=1e-12)


def test_skew_segments_in_the_plane_of_several_angles_are_searched_for(load_text: Load) -> None:
    marks = [
        '<pinbound:segment name="X" link="base" xyz_a="0.5 -0.3 0.3" xyz_b="0.6 0.3 0.3" radius="0.01"/>',
        '<pinbound:segment name="Y" link="b" xyz_a="0 0.1 0" xyz_b="0 -0.1 0.3" radius="0.01"/>',
    ]
    robot = load_text(assemble(PLANAR, marks, ["X_Y"], HOME))
    region = pb.feasible_region(robot, ("q1", "q2"), width=0.02)
    Q = np.random.default_rng(4).uniform(-3, 3, (5_000, 2))
    inside = np.any([part.contains(Q) for part in region.components], axis=0)
    differ = inside != (separation(robot, Q) > 0.0)
    assert np.abs(separation(robot, Q)[differ]).max(initial=0.0) < 1e-4
    assert 0 < np.sum(~inside) < len(Q)


def test_bounds_over_boxes_of_the_plane_hold(planar: pb.Robot) -> None:
    from pinbound.region.margins import _SeparationBounds  # pyright: ignore[reportPrivateUsage]

    rng = np.random.default_rng(3)
    for boundary in planar.boundaries:
        bounds = _SeparationBounds(boundary.path)
        bounds.over(np.full(2, 3.5))
        for half in (np.array([0.01, 0.02]), np.array([0.3, 0.1])):
            middle = rng.uniform(-3, 3, (30, 2))
            found = bounds.lower(middle, half, np.array([]))
            corners = middle[:, None] + half * np.array([[1, 1], [1, -1], [-1, 1], [-1, -1], [0, 0]])
            values = boundary.norm(corners.reshape(-1, 2)).reshape(30, 5)
            assert np.all(found <= values.min(axis=1))
