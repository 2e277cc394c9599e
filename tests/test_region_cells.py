"""Regions where contact is searched for: cells proven, curves enclosed, areas bounded, and what is open is told."""

from __future__ import annotations

import importlib.util
import json
import math
import pickle
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import shapely
from scipy import ndimage
from typer.testing import CliRunner

import pinbound as pb
from pinbound.cli import app
from pinbound.region.cells import Grid, Searched, pave
from pinbound.region.slice import slice_of
from robots import joint
from segments import PLANAR, assemble, oracle_clearances

Load = Callable[..., pb.Robot]

HOME = '<pinbound:home q1="-0.4" q2="-0.5"/>'
SCENE = [
    '<pinbound:sweep name="box" link="base" xyz="0.3 -0.1 0.3" ways="0.2 0 0  0 0.2 0  0 0 0.2"/>',
    '<pinbound:sweep name="post" link="base" xyz="-0.5 -0.1 0" ways="0.05 0.02 0  0 0.2 0  0 0 0.35" radius="0.01"/>',
    '<pinbound:sweep name="hand" link="b" xyz="-0.02 -0.05 0" ways="0.04 0 0  0 0.1 0  0 0 0.3"/>',
    '<pinbound:segment name="skew" link="base" xyz_a="0 -0.3 0.75" xyz_b="0.1 0.3 0.7" radius="0.01"/>',
    '<pinbound:segment name="bar" link="b" xyz_a="0.05 0.1 0.05" xyz_b="-0.05 -0.1 0.25" radius="0.01"/>',
    '<pinbound:point name="ball" link="base" xyz="-0.2 0 -0.25" radius="0.05"/>',
    '<pinbound:point name="tip" link="b" xyz="0 0 0.35" radius="0.02"/>',
]
PAIRS = ["box_hand", "post_hand", "skew_bar", "ball_hand", "ball_tip"]
SLIDE_TURN = [
    joint("x", "prismatic", "base", "a", axis="1 0 0", limit="-0.9 0.9"),
    joint("turn", "revolute", "a", "b", axis="0 1 0", limit="-1 1"),
]
BAR = '<pinbound:sweep name="bar" link="b" xyz="-0.2 -0.05 -0.05" ways="0.4 0 0  0 0.1 0  0 0 0.1"/>'
WIDTH = 3e-2


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> pb.Robot:
    path = tmp_path_factory.mktemp("cells") / "scene.urdf"
    path.write_text(assemble(PLANAR, SCENE, PAIRS, HOME))
    return pb.load(path)


@pytest.fixture(scope="module")
def region(scene: pb.Robot) -> pb.Region:
    return pb.feasible_region(scene, width=WIDTH)


def door(load_text: Load, gap: float, home: str = 'x="-0.8" turn="0"') -> pb.Robot:
    """A bar 0.1 m thick, that slides and turns, before a door that is higher than the bar by a gap."""
    z = 0.05 + gap / 2
    wall = '<pinbound:sweep name="{}" link="base" xyz="-0.1 -0.1 {!r}" ways="0.2 0 0  0 0.2 0  0 0 {}"/>'
    marks = [wall.format("up", z, 0.6), wall.format("low", -z, -0.6), BAR]
    return load_text(assemble(SLIDE_TURN, marks, ["up_bar", "low_bar"], f"<pinbound:home {home}/>"))


def searched(robot: pb.Robot, width: float) -> Searched:
    plane = slice_of(robot, None, robot.home.copy(), {})
    return Searched(plane, plane.curves, Grid.over(plane.window / plane.scales, width))


def test_bounds_over_cells_hold_between_their_corners(scene: pb.Robot) -> None:
    found = searched(scene, WIDTH)
    rng = np.random.default_rng(1)
    low = rng.uniform(-3.0, 2.8, (60, 2))
    high = low + rng.uniform(0.001, 0.2, (60, 2))
    shares = np.concatenate((rng.uniform(0.0, 1.0, (40, 2)), [[0, 0], [0, 1], [1, 0], [1, 1]]))
    inside = low[:, None] + shares * (high - low)[:, None]
    for which, function in enumerate(found.functions):
        lower, upper = found.bounds(np.full(60, which), low, high)
        values = function.value(inside.reshape(-1, 2)).reshape(60, -1)
        assert np.all(lower <= values.min(axis=1) + 1e-12)
        assert np.all(upper >= values.max(axis=1) - 1e-12)
        assert np.any(lower > 0.0)


def test_outside_undecided_cells_all_is_as_the_drawing_says(scene: pb.Robot, region: pb.Region) -> None:
    found = searched(scene, WIDTH)
    cells, _ = pave(found)
    low, high = found.grid.boxes(cells)
    assert np.max(high - low) <= WIDTH
    points = np.random.default_rng(2).uniform(-2.99, 2.99, (5_000, 2))
    tree = shapely.STRtree(shapely.box(low[:, 0], low[:, 1], high[:, 0], high[:, 1]))
    open_ = np.zeros(len(points), dtype=bool)
    open_[tree.query(shapely.points(points), predicate="intersects")[0]] = True
    drawn = np.any([shapely.contains_xy(part.polygon, *points.T) for part in region.components], axis=0)
    free = oracle_free(scene, points[~open_])
    assert 0.7 < np.mean(~open_) < 1.0
    assert np.array_equal(drawn[~open_], free)


def oracle_free(robot: pb.Robot, points: np.ndarray) -> np.ndarray:
    return np.all(robot.boundaries.signed_clearances(points) > 0.0, axis=1)


def test_a_turning_box_before_a_wall_has_the_area_of_the_formula(load_text: Load) -> None:
    """The box of half-sides 0.2 and 0.05 m reaches `0.2 cos + 0.05 |sin|` ahead of its joint."""
    wall = '<pinbound:sweep name="wall" link="base" xyz="0.5 -1 -1" ways="0.2 0 0  0 2 0  0 0 2"/>'
    robot = load_text(assemble(SLIDE_TURN, [wall, BAR], ["wall_bar"], '<pinbound:home x="-0.5" turn="0"/>'))
    exact = 2.0 * (1.4 - 2e-5) - 0.4 * math.sin(1.0) - 0.1 * (1.0 - math.cos(1.0))
    widths = []
    for width in (2e-2, 5e-3):
        region = pb.feasible_region(robot, ("x", "turn"), width=width)
        lower, upper = region.area_interval
        assert lower < exact < upper
        assert region.area == pytest.approx(exact, abs=width**2)
        assert abs(region.area - exact) < region.area_error
        assert region.width == width
        assert [edge.name for edge in region.edges].count("wall_bar") == 1
        widths.append(upper - lower)
        contour = np.concatenate([edge.points for edge in region.edges if edge.is_contact])
        x = 0.5 - 2e-5 - 0.2 * np.cos(contour[:, 1]) - 0.05 * np.abs(np.sin(contour[:, 1]))
        assert np.abs(contour[:, 0] - x).max() < 1e-6
    assert widths[1] < widths[0] / 3.0


def test_the_region_is_what_coal_lets_a_flood_reach(scene: pb.Robot, region: pb.Region) -> None:
    assert {"box_hand", "post_hand", "skew_bar", "ball_hand", "q2"} <= {edge.source for edge in region.edges}
    count = 31
    nodes = np.linspace(-2.97, 2.97, count)
    grid = np.stack(np.meshgrid(nodes, nodes, indexing="ij"), axis=-1).reshape(-1, 2)
    gaps = [boundary.contact_distance - boundary.threshold for boundary in scene.boundaries]
    free = np.all(oracle_clearances(scene, grid) > gaps, axis=1).reshape(count, count)
    labels, _ = ndimage.label(free)
    home = tuple(int(np.argmin(np.abs(nodes - value))) for value in scene.home)
    flooded = (labels == labels[home]).ravel()
    inside = np.asarray(region.contains(grid))
    differ = grid[inside != flooded]
    assert np.all(shapely.distance(shapely.points(differ), region.polygon.boundary) <= WIDTH)
    assert not np.any(inside & ~free.ravel())
    lower, upper = region.area_interval
    assert lower < region.area < upper
    step = nodes[1] - nodes[0]
    area = flooded.sum() * step**2
    assert area == pytest.approx(region.area, abs=0.3 * step * region.perimeter())


@pytest.mark.parametrize("style", ["planar", "spatial"])
def test_random_mechanisms_agree_with_coal(style: str, tmp_path: Path) -> None:
    """A seeded part of `benchmarks/searched_mechanisms.py`."""
    path = Path(__file__).resolve().parents[1] / "benchmarks" / "searched_mechanisms.py"
    spec = importlib.util.spec_from_file_location("searched_mechanisms", path)
    assert spec is not None
    assert spec.loader is not None
    campaign = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = campaign
    spec.loader.exec_module(campaign)
    rng = np.random.default_rng(20)
    for robot, names in campaign.searched_robots(rng, tmp_path, 1, style, hulls=True):
        found = campaign.compare(pb.feasible_region(robot, names, width=WIDTH), (41, 121))
        assert (found.disagreements, found.told) == (0, 0)


def test_hulls_boxes_and_cylinders_have_regions_too(load_text: Load) -> None:
    rng = np.random.default_rng(0)
    rock = rng.normal(0, 0.06, (15, 3)) + np.array([0.3, 0, 0.4])
    fist = rng.normal(0, 0.05, (12, 3)) + np.array([0, 0, 0.2])
    text = [" ".join(f"{value:.4f}" for value in part.ravel()) for part in (rock, fist)]
    marks = [
        f'<pinbound:hull name="rock" link="base" vertices="{text[0]}"/>',
        f'<pinbound:hull name="fist" link="b" vertices="{text[1]}" radius="0.01"/>',
        '<pinbound:box name="table" link="base" xyz="-0.5 0 0.1" rpy="0 0.2 0" size="0.2 0.3 0.2"/>',
        '<pinbound:cylinder name="can" link="base" xyz_a="0 0 0.75" xyz_b="0.2 0 0.75" radius="0.05"/>',
        '<pinbound:plane name="floor" link="base" xyz="0 0 -0.1" normal="0 0 1"/>',
    ]
    pairs = ["rock_fist", "table_fist", "can_fist", "floor_fist"]
    robot = load_text(assemble(PLANAR, marks, pairs, HOME))
    region = pb.feasible_region(robot, width=0.05)
    assert {edge.source for edge in region.edges} >= {"rock_fist", "can_fist", "table_fist", "floor_fist"}
    for edge in region.edges:
        if edge.is_contact:
            boundary = robot.boundaries[edge.name]
            assert np.abs(boundary.norm(edge.points) - boundary.contact_distance).max() < 1e-5
    Q = rng.uniform(-2.99, 2.99, (4_000, 2))
    inside = np.any([part.contains(Q) for part in region.components], axis=0)
    differ = Q[inside != oracle_free(robot, Q)]
    borders = shapely.union_all([part.polygon.boundary for part in region.components])
    assert shapely.distance(shapely.points(differ), borders).max(initial=0.0) < 0.05
    lower, upper = region.area_interval
    assert lower < region.area < upper


def test_edges_lie_on_their_contacts_to_far_less_than_the_width(scene: pb.Robot, region: pb.Region) -> None:
    assert region.accuracy < 10 * WIDTH
    for edge in region.edges:
        if edge.is_contact:
            boundary = scene.boundaries[edge.name]
            assert np.abs(boundary.norm(edge.points) - boundary.contact_distance).max() < 1e-5
    for corner in region.corners:
        assert corner.polished


@pytest.mark.parametrize(("gap", "passes"), [(2e-2, True), (4e-3, True), (-2e-3, False)])
def test_a_passage_narrower_than_the_width_is_looked_at_closer(load_text: Load, gap: float, passes: bool) -> None:
    """In the door the bar may turn by some `gap / 0.2` to both sides: 0.02 rad at 4 mm, a cell of 0.05 rad."""
    region = pb.feasible_region(door(load_text, gap), ("x", "turn"), width=0.05)
    assert [region.contains([x, 0.0]) for x in (-0.5, 0.0, 0.5)] == [True, passes, passes]
    assert len(region.components) == (1 if passes else 2)
    assert region.unresolved == ()
    assert region.joined_area == region.area


def test_a_passage_that_cannot_be_told_is_closed_and_said(load_text: Load) -> None:
    """The gap is twice the contact tolerance to rounding: the bar fits in exactly one pose, or in none."""
    region = pb.feasible_region(door(load_text, 4e-5), ("x", "turn"), width=0.2)
    assert [region.contains([x, 0.0]) for x in (-0.5, 0.0, 0.5)] == [True, False, False]
    (place,) = region.unresolved
    assert place.joins
    assert place.name in ("up_bar", "low_bar")
    assert np.abs(place.point).max() < 0.2
    assert len(region.components) == 2
    assert region.components[1].contains([0.5, 0.0])
    total = sum(part.area for part in region.components)
    assert region.joined_area == pytest.approx(total)
    lower, upper = region.area_interval
    assert lower < region.area < total < upper
    assert "UNDECIDED" in repr(region)


def test_a_start_beside_contact_is_told_from_it(load_text: Load) -> None:
    wall = '<pinbound:sweep name="wall" link="base" xyz="0.5 -1 -1" ways="0.2 0 0  0 2 0  0 0 2"/>'
    for beside in (1e-2, 1e-4):
        home = f'<pinbound:home x="{0.3 - 2e-5 - beside!r}" turn="0"/>'
        region = pb.feasible_region(
            load_text(assemble(SLIDE_TURN, [wall, BAR], ["wall_bar"], home)), ("x", "turn"), width=WIDTH
        )
        assert region.contains(region.at)
        assert region.contains([-0.5, 0.3])
        assert region.area_interval[0] > 2.2


def test_an_obstacle_thinner_than_a_cell_leaves_an_island(load_text: Load) -> None:
    """Two thin skew bars: contact is a sliver some 1e-3 rad wide around a curve, a fiftieth of a cell."""
    marks = [
        '<pinbound:segment name="skew" link="base" xyz_a="0 -0.3 0.75" xyz_b="0.1 0.3 0.7" radius="3e-4"/>',
        '<pinbound:segment name="bar" link="b" xyz_a="0.05 0.1 0.05" xyz_b="-0.05 -0.1 0.25"/>',
    ]
    robot = load_text(assemble(PLANAR, marks, ["skew_bar"], HOME))
    region = pb.feasible_region(robot, width=0.05)
    lower, upper = region.area_interval
    assert lower < region.area < 36.0 - 1e-4
    assert region.area < upper
    assert any(edge.name == "skew_bar" for edge in region.edges)
    fine = pb.feasible_region(robot, width=2e-3)
    assert lower <= fine.area <= upper
    assert len(fine.loops) == 2


def test_all_that_regions_do_is_done_here(scene: pb.Robot, region: pb.Region) -> None:
    again = pickle.loads(pickle.dumps(region))
    assert (again.area, again.area_interval, again.width) == (region.area, region.area_interval, WIDTH)
    inset = region.inset(0.1)
    points = shapely.get_coordinates(inset.polygon)
    assert shapely.distance(shapely.points(points), region.polygon.boundary).min() >= 0.1
    with pytest.raises(pb.LeavesRegionError):
        region.scale(0.9)
    larger = region.with_clearance(0.02)
    assert larger.width == WIDTH
    assert larger.area < region.area
    assert shapely.within(larger.polygon, region.polygon.buffer(WIDTH**2))
    part = region.inscribed_polygon(rim=0.05)
    A, b = part.halfspaces()
    assert np.all(A @ part.centroid < b)
    assert all(region.contains(q) for q in part.vertices)
    assert region.signed_distance(scene.home) > 0.1
    assert region.supports()["box_hand"].slack == 0.0


def test_a_width_that_is_none_is_refused(scene: pb.Robot) -> None:
    for width in (0.0, -1e-3, 1.0, float("nan")):
        with pytest.raises(pb.DimensionError, match="the width"):
            pb.feasible_region(scene, width=width)
    with pytest.raises(pb.UnsupportedError, match="give a larger width="):
        pb.feasible_region(scene, width=1e-6)


def test_the_command_line_says_what_is_proven(load_text: Load, tmp_path: Path) -> None:
    door(load_text, 0.02)
    path = str(tmp_path / "robot.urdf")
    run = CliRunner().invoke(app, ["region", path, "--coordinates", "x,turn", "--width", "0.05", "--json"])
    assert run.exit_code == 0, run.output
    record = json.loads(run.stdout)
    assert record["width"] == 0.05
    lower, upper = record["area_interval"]
    assert lower < record["area"] < upper
    text = CliRunner().invoke(app, ["region", path, "--coordinates", "x,turn", "--width", "0.05"]).stdout
    assert "proven: area from" in " ".join(text.split())
