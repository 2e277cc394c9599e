"""Regions through loops that are not parallelograms: floods of exact clearances, toggles as edges, bounds that hold."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import cast

import numpy as np
import pytest
import shapely
from typer.testing import CliRunner

import pinbound as pb
from linkages import KINDS, Mechanism, Part, flooded, scene
from pinbound.boundaries.looped import over_z
from pinbound.cli import app
from pinbound.loops.through_loops import (
    LoopBounds,
    LoopContact,
    LoopLimit,
    contacts_through,
    limits_through,
    proven_end,
)
from pinbound.region.loop_slice import lifted_plane
from pinbound.robot.loop_robot import LoopRobot
from test_lifted import linkage

Load = Callable[..., pb.Robot]

WALL = """<pinbound:point name="p" link="rocker" xyz="0.4 0.05 0"/>
<pinbound:point name="w" link="base" xyz="0.32 0.42 0" radius="0.05"/>
<pinbound:boundary name="p_w" a="p" b="w"/>"""


def five_bar(load_text: Load, marks: str = "", limit: float = 9.0) -> LoopRobot:
    """Return cranks 0.3 m long on the ground, 0.4 m apart, and arms of 0.35 m between them."""
    parts = [
        Part("A", "base", "left", 0j, lower=-0.2, upper=2.9),
        Part("B", "left", "near", 0.3 + 0j, lower=-limit, upper=limit),
        Part("D", "base", "right", 0.4 + 0j, lower=0.2, upper=3.2),
        Part("E", "right", "far", 0.3 + 0j),
    ]
    pin = ("five", "near", 0.35 + 0j, "far", 0.35 + 0j)
    home = {"A": 2.0, "B": -1.0, "D": 1.1, "E": 1.0}
    robot = load_text(Mechanism(parts, [pin], {"five": ("B", "E")}, home).urdf(marks))
    assert isinstance(robot, LoopRobot)
    return robot


@pytest.mark.parametrize(("kind", "seed"), [("four-bar", 3), ("five-bar", 0), ("slider-crank", 4), ("cylinder", 2)])
def test_the_region_is_what_a_flood_reaches(load_text: Load, kind: str, seed: int) -> None:
    robot = scene(kind, np.random.default_rng(seed), load_text)
    region = pb.feasible_region(robot, robot.coordinates[:2], width=0.04)
    X, free, reached = flooded(region, 301)
    inside = np.asarray(region.contains(X, order="region"))
    assert not np.any(inside & ~free)
    differ = inside != reached
    away = shapely.distance(shapely.points(X[differ]), region.polygon.boundary)
    assert np.all(away <= region.accuracy)
    lower, upper = region.area_interval
    assert lower <= region.area <= upper
    sides = region.slice.window[1] - region.slice.window[0]
    rim = region.polygon.length * float(sides.max()) / 301
    assert lower - rim <= reached.mean() * float(np.prod(sides)) <= upper + rim


def test_edges_through_a_loop_are_where_its_functions_are_zero(load_text: Load) -> None:
    """Points of a contact edge have no clearance; of a toggle, arms in line: cranks' ends 0.7 m apart.

    Where the cranks' ends meet, the arms fold onto each other: a toggle in one point, which stays open with its name.
    """
    robot = five_bar(load_text, WALL.replace("rocker", "near"))
    region = pb.feasible_region(robot, width=0.05)
    (place,) = region.unresolved
    assert place.name == "five toggle lower"
    left, right = 0.3 * np.exp(1j * place.point[0]), 0.4 + 0.3 * np.exp(1j * place.point[1])
    assert abs(left - right) < place.width
    seen = set()
    for edge in region.edges:
        middle = edge.points[1:-1]
        middle = middle[np.abs(middle - place.point).max(axis=1) > place.width]
        if not len(middle):
            continue
        Q = region.slice.lift(middle)
        if edge.name == "p_w":
            # a crossing is known to 1e-4 of a side of 0.05 rad, and nothing moves faster than 20 m or rad a radian
            assert np.abs(robot.boundaries["p_w"].signed_clearance(Q)).max() < 1e-4
        elif edge.source == "five toggle":
            ends = [(0.3 * np.exp(1j * Q[:, 0])), 0.4 + 0.3 * np.exp(1j * Q[:, 1])]
            assert np.abs(np.abs(ends[0] - ends[1]) - 0.7).max() < 1e-4
            assert not edge.is_contact
        seen.add(edge.source)
    assert {"p_w", "five toggle"} <= seen
    with pytest.raises(pb.UnknownNameError):
        region.touching(next(edge for edge in region.edges if not edge.is_contact))
    (touch, *_) = region.touching(next(edge for edge in region.edges if edge.name == "p_w"))
    assert str(touch) == "point on point"


def test_limits_of_passive_joints_and_rules_over_them_bound_the_region(load_text: Load) -> None:
    free = pb.feasible_region(five_bar(load_text), width=0.05)
    tight = pb.feasible_region(five_bar(load_text, limit=1.9), width=0.05)
    assert "B lower" in {edge.name for edge in tight.edges}
    assert tight.area_interval[1] < free.area_interval[0]
    for edge in tight.edges:
        if edge.name == "B lower":
            theta = tight.slice.robot.coupling.expand(tight.slice.lift(edge.points[1:-1]))
            assert np.abs(theta[:, 1] + 1.9).max() < 1e-4
    rule = (
        '<pinbound:rule name="low" lower="-1.5" coefficients="B: 1"><pinbound:where upper="1.5" coefficients="A: 1"/>'
        "</pinbound:rule>"
    )
    ruled = pb.feasible_region(five_bar(load_text, rule), width=0.05)
    slice_ = ruled.slice
    X = np.random.default_rng(4).uniform(*slice_.window, (4000, 2))
    theta = slice_.robot.coupling.expand(slice_.lift(X))
    forbidden = (theta[:, 0] <= 1.5) & (theta[:, 1] < -1.5)
    held = np.asarray(ruled.contains(X, order="region"))
    assert not np.any(held & forbidden)
    assert np.any(forbidden & np.asarray(free.contains(X, order="region")))
    assert "low lower" in {edge.name for edge in ruled.edges}


def test_a_toggle_in_closed_form_is_a_straight_edge(load_text: Load) -> None:
    """Ground 0.4, crank 0.3, coupler 0.2, rocker 0.25: the crank stops by the law of cosines."""
    robot = load_text(linkage())
    region = pb.feasible_region(robot, ("A", "T"), window={"T": (-0.5, 0.5)}, width=0.05)
    flat = math.acos((0.4**2 + 0.3**2 - 0.45**2) / (2 * 0.4 * 0.3))
    assert region.slice.window[1, 0] == pytest.approx(flat, abs=1e-8)
    alone = load_text(linkage().replace('name="s_w" a="s" b="w"', 'name="s_w" a="s" b="floor"'))
    wide = pb.feasible_region(alone, ("A", "T"), window={"T": (-0.5, 0.5)}, width=0.05)
    ends = [edge for edge in wide.edges if edge.name.startswith("bar toggle")]
    assert ends
    for edge in ends:
        assert len(edge.points) == 2
        assert np.abs(np.abs(edge.points[:, 0]) - flat).max() < 1e-8


def test_bounds_over_boxes_hold_all_samples(load_text: Load) -> None:
    rng = np.random.default_rng(1)
    for kind in KINDS:
        robot = scene(kind, rng, load_text)
        assert isinstance(robot, LoopRobot)
        box = np.stack((robot.home[:2] - 0.3, robot.home[:2] + 0.3))
        plane = lifted_plane(robot, robot.home, (0, 1), box)
        curves = [c for b in robot.boundaries for c in contacts_through(b.name, over_z(b).rule, plane)]
        curves += [c for one in robot.opened.linear_limits for c in limits_through(one, plane)]
        bounds = LoopBounds(curves, *box)
        for half in (0.1, 0.01):
            middle = robot.home[:2] + rng.uniform(-1.0, 1.0, (4, 2)) * (0.3 - half)
            which = np.tile(np.arange(len(curves)), len(middle))
            rows = np.repeat(middle, len(curves), axis=0)
            lower, upper = bounds.bounds(which, rows, np.full_like(rows, half))
            for _ in range(25):
                X = middle + half * rng.uniform(-1.0, 1.0, middle.shape)
                kept = robot.intervals.hold(plane.configurations(X))
                values = np.stack([one.value(X) for one in curves], axis=1).ravel()
                known = np.repeat(kept, len(curves))
                assert np.all((lower <= values + 1e-12)[known])
                assert np.all((values <= upper + 1e-12)[known])


def test_the_smallest_clearance_over_a_region_is_bounded(load_text: Load) -> None:
    robot = five_bar(load_text, WALL.replace("rocker", "near").replace('radius="0.05"', 'radius="0.01"'))
    region = pb.feasible_region(robot, width=0.05).inset(0.2)
    found = region.clearance(gap=1e-3)
    inside = region.slice.lift(np.array([edge.points[0] for edge in region.edges]))
    assert found.lower <= robot.boundaries["p_w"].signed_clearance(inside).min()
    assert found.upper == pytest.approx(float(robot.boundaries["p_w"].signed_clearance(found.q)), abs=1e-12)
    assert found.upper - found.lower < 2e-3


def test_points_of_another_slice_and_held_limits_are_told(load_text: Load) -> None:
    robot = load_text(linkage())
    assert isinstance(robot, LoopRobot)
    more = scene("five-bar", np.random.default_rng(9), load_text)
    region = pb.feasible_region(more, more.coordinates[:2], width=0.05)
    assert region.contains(more.home)
    away = more.home.copy()
    away[2] += 100.0
    with pytest.raises(pb.DimensionError, match="is the slice at"):
        region.contains(away)
    assert isinstance(region.slice.curves[0].free(region.slice.start[None])[0], np.bool_)
    assert any(isinstance(curve, LoopContact) for curve in region.slice.curves)


def test_a_contact_that_only_rounding_sees_is_no_violation(load_text: Load) -> None:
    """The clearance through a loop is known to some 1e-14 m: less than that decides nothing."""
    verdicts = []
    for missing in (1e-9, 1e-16):
        bare = load_text(linkage())
        q = np.array([0.4, 1.0])
        distance = float(bare.boundaries["t_w"].norm(q)) - 0.07 + missing
        text = linkage().replace('name="t_w" a="t" b="w"', f'name="t_w" a="t" b="w" min_distance="{distance!r}"')
        try:
            robot = load_text(text)
        except pb.InputError:
            pytest.fail("home is in contact")
        assert robot.boundaries["t_w"].signed_clearance(q) < 1e-15
        found = pb.certify(robot, [q, q], boundaries=["t_w"], limits=False)
        box = pb.certify_box(robot, q, q, boundaries=["t_w"], limits=False)
        verdicts.append((found.verdict, box.verdict))
    assert verdicts == [(pb.Verdict.VIOLATED,) * 2, (pb.Verdict.UNDECIDED,) * 2]


@pytest.mark.parametrize("kind", KINDS)
def test_limits_of_one_coordinate_end_where_something_is_met(load_text: Load, kind: str) -> None:
    """Up to its ends all is free by 400 samples; just beyond, the stop that is named forbids it."""
    for seed in (1,):
        robot = scene(kind, np.random.default_rng(seed), load_text)
        for index, name in enumerate(robot.coordinates[:2]):
            found = robot.boundaries.limits(name, robot.home)
            assert found.lower < robot.home[index] < found.upper
            Q = np.tile(robot.home, (400, 1))
            Q[:, index] = np.linspace(found.lower, found.upper, 402)[1:-1]
            assert np.all(robot.boundaries.free(Q))
            for end, stop, side in ((found.lower, found.lower_stop, -1.0), (found.upper, found.upper_stop, 1.0)):
                q = robot.home.copy()
                q[index] = end + side * 1e-9
                assert not robot.boundaries.free(q)
                assert robot.boundaries.limits(name, q).blocked_by
                assert stop in {*robot.boundaries.names, *(one.joint for one in robot.opened.linear_limits)}
        ends, stops = robot.boundaries.limits_table(name, robot.home[None])
        assert ends[0].tolist() == [found.lower, found.upper]
        assert stops[0].tolist() == [found.lower_stop, found.upper_stop]


def test_allowed_values_of_one_boundary_are_where_it_is_free_and_the_loop_closes(load_text: Load) -> None:
    robot = load_text(linkage())
    assert isinstance(robot, LoopRobot)
    one = robot.boundaries["s_w"]
    arcs = one.limits("A", robot.home, window=(-2.0, 2.0))
    x = np.linspace(-2.0, 2.0, 2001)
    Q = np.stack((x, np.zeros_like(x)), axis=1)
    closed = robot.boundaries.closed(robot.lift(Q))
    expected = closed & (one.signed_clearance(Q) > 0.0)
    assert [arcs.contains(value) for value in x.tolist()] == expected.tolist()
    assert len(arcs.intervals) == 3
    table = one.limits("A", np.stack((robot.home, robot.home)), window=(-2.0, 2.0))
    assert table[1].intervals.tolist() == arcs.intervals.tolist()
    with pytest.raises(pb.UnsupportedError, match="window"):
        one.limits("A", robot.home)
    assert one.limits("T", robot.home).intervals.tolist() == [[-math.inf, math.inf]]


def test_a_gripper_of_two_four_bars_is_driven_by_one_coordinate(load_text: Load) -> None:
    """As Robotiq's: both fingers are four-bars, the second crank mimics the first; pads stay level, and close."""
    parts = [
        Part("A", "base", "knuckle", 0.03 + 0j, lower=0.0, upper=0.8),
        Part("B", "knuckle", "finger", complex(0.04 * np.exp(0.9j))),
        Part("D", "base", "inner", 0.012 + 0.005j),
        Part("A2", "base", "knuckle2", -0.03 + 0j, sign=-1, lower=0.0, upper=0.8),
        Part("B2", "knuckle2", "finger2", complex(0.04 * np.exp(1j * (np.pi - 0.9))), sign=-1),
        Part("D2", "base", "inner2", -0.012 + 0.005j, sign=-1),
    ]
    pins = [
        ("right", "finger", -0.02 + 0.008j, "inner", complex(0.0445 * np.exp(0.88j))),
        ("left", "finger2", 0.02 + 0.008j, "inner2", complex(0.0445 * np.exp(1j * (np.pi - 0.88)))),
    ]
    home = {"A": 0.1, "B": -0.1, "D": 0.1, "B2": -0.1, "D2": 0.1}
    mechanism = Mechanism(parts, pins, {"right": ("B", "D"), "left": ("B2", "D2")}, home)
    marks = """<pinbound:point name="pad" link="finger" xyz="0.005 0.05 0" radius="0.004"/>
    <pinbound:point name="pad2" link="finger2" xyz="-0.005 0.05 0" radius="0.004"/>
    <pinbound:boundary name="pads" a="pad" b="pad2"/>"""
    text = mechanism.urdf(marks).replace(
        '<joint name="A2" type="revolute">', '<joint name="A2" type="revolute"><mimic joint="A"/>'
    )
    robot = load_text(text)
    assert isinstance(robot, LoopRobot)
    assert robot.coordinates == ("A",)
    found = robot.boundaries.limits("A", robot.home)
    Q = np.linspace(found.lower, found.upper, 40)[1:-1, None]
    theta = dict(zip(robot.coupling.joints, robot.coupling.expand(Q).T, strict=True))
    for one in ("A", "B", "D"):
        np.testing.assert_allclose(theta[one + "2"], theta[one], atol=1e-12)  # the mirror's image
    assert robot.closure_residuals(Q).max() < 1e-13
    assert robot.boundaries.free(Q).all()
    assert pb.certify(robot, [Q[0], Q[-1]]).verdict is pb.Verdict.CERTIFIED


def test_a_delta_robot_is_refused_with_the_reason(load_text: Load) -> None:
    """Its arms end in universal joints: the loops are spatial, and nothing is taken for a planar one."""
    parts = "".join(
        f"""<joint name="m{k}" type="revolute"><parent link="base"/><child link="upper{k}"/><origin xyz="0 0 0"
        rpy="0 0 {2.0943951 * k}"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
        <link name="upper{k}"/><joint name="u{k}" type="revolute"><parent link="upper{k}"/><child link="cross{k}"/>
        <origin xyz="0.3 0 0"/><axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
        <link name="cross{k}"/><joint name="v{k}" type="revolute"><parent link="cross{k}"/><child link="rod{k}"/>
        <axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint><link name="rod{k}"/>"""
        for k in range(3)
    )
    pins = "".join(
        f'<pinbound:closure name="arm{k}" link_a="rod0" xyz_a="0.2 0 -0.4" link_b="rod{k}" xyz_b="0.2 0 -0.4"/>'
        for k in (1, 2)
    )
    text = f'<robot name="delta" xmlns:pinbound="urn:pinbound:1"><link name="base"/>{parts}'
    text += f"<pinbound:annotations>{pins}</pinbound:annotations></robot>"
    with pytest.raises(pb.InputError, match="spatial loop"):
        load_text(text)


def test_a_slider_crank_of_three_equal_terms_loads(load_text: Load) -> None:
    """Its X can go round zero, and it asks for no angle of X."""
    parts = [
        Part("A", "base", "a", 0j),
        Part("C", "a", "c", 0.3 + 0j),
        Part("B", "c", "b", 0.25 + 0j),
        Part("S", "base", "s", 0.2 + 0.1j, 1 + 0j),
    ]
    home = {"A": 0.5, "C": 0.3, "B": -1.2, "S": 0.3}
    robot = load_text(Mechanism(parts, [("loop", "b", 0.5 + 0j, "s", 0j)], {"loop": ("B", "S")}, home).urdf())
    Q = robot.home + np.random.default_rng(0).uniform(-0.2, 0.2, (50, 2))
    assert robot.closure_residuals(Q).max() < 1e-13


class Graze:
    """Bounds of `(x - 1)^2 + miss`, and how often they are asked."""

    curves = (None,)

    def __init__(self, miss: float) -> None:
        self.miss, self.asked = miss, 0

    def bounds(self, which: np.ndarray, middle: np.ndarray, half: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        self.asked += 1
        x, h = middle[:, 0] - 1.0, half[:, 0]
        value, rest = x * x + self.miss, 2.0 * np.abs(x) * h + h * h
        return value - rest, value + rest


@pytest.mark.parametrize("miss", [1e-4, 1e-8, 1e-12])
def test_what_is_all_but_met_on_the_way_costs_a_few_steps(miss: float) -> None:
    """Steps get short beside a near miss, and long again behind it: they are not kept short to the end."""
    graze = Graze(miss)
    assert proven_end(cast(LoopBounds, graze), 0.0, 12.0) == (12.0, -1)
    assert graze.asked < 300
    reached, which = proven_end(cast(LoopBounds, Graze(0.0)), 0.0, 12.0)
    assert which == 0
    assert 1.0 - 1e-7 < reached <= 1.0


def test_a_loop_that_another_loop_moves_is_bounded_away_from_the_cut(load_text: Load) -> None:
    """A four-bar on the five-bar's left crank, turned by its passive joint B: its numbers are finite, and hold."""
    parts = [
        Part("A", "base", "left", 0j, lower=-0.2, upper=2.9),
        Part("B", "left", "near", 0.3 + 0j),
        Part("D", "base", "right", 0.4 + 0j, lower=0.2, upper=3.2),
        Part("E", "right", "far", 0.3 + 0j),
        Part("K", "near", "coupler", 0.05 + 0j),
        Part("R", "left", "rocker", 0.3 + 0.2j),
    ]
    pins = [("five", "near", 0.35 + 0j, "far", 0.35 + 0j), ("four", "coupler", 0.2 + 0j, "rocker", 0.15 + 0j)]
    home = {"A": 2.0, "B": -1.0, "D": 1.1, "E": 1.0, "K": 2.0, "R": -1.5}
    mechanism = Mechanism(parts, pins, {"five": ("B", "E"), "four": ("K", "R")}, home)
    mechanism.home = {name: float(value) for name, value in mechanism.solved(home).items()}
    wall = WALL.replace("rocker", "coupler").replace("0.4 0.05 0", "0.1 0 0")
    robot = load_text(mechanism.urdf(wall))
    assert isinstance(robot, LoopRobot)
    box = np.stack((robot.home[:2] - 0.05, robot.home[:2] + 0.05))
    plane = lifted_plane(robot, robot.home, (0, 1), box)
    curves = list(contacts_through("p_w", over_z(robot.boundaries["p_w"]).rule, plane))
    bounds, rng = LoopBounds(curves, *box), np.random.default_rng(0)
    middle, half = robot.home[None, :2], np.full((1, 2), 0.02)
    lower, upper = bounds.bounds(np.zeros(1, dtype=np.int64), middle, half)
    assert np.all(np.isfinite(lower) & np.isfinite(upper))
    values = curves[0].value(middle + rng.uniform(-0.02, 0.02, (500, 2)))
    assert np.all((lower <= values) & (values <= upper))


def test_a_wall_that_ends_inside_a_region_is_said(load_text: Load, tmp_path: Path) -> None:
    """The cranks' ends may meet: round that hole the arms go round, and a cut leads from it to the limit of A."""
    parts = [
        Part("A", "base", "left", 0j, lower=-0.6, upper=2.9),
        Part("B", "left", "near", 0.3 + 0j, lower=-9.0, upper=9.0),
        Part("D", "base", "right", 0.4 + 0j, lower=0.2, upper=3.2),
        Part("E", "right", "far", 0.3 + 0j, lower=-9.0, upper=9.0),
    ]
    home = {"A": 1.6, "B": -1.0, "D": 1.5, "E": 1.0}
    pin = ("five", "near", 0.4 + 0j, "far", 0.3 + 0j)
    robot = load_text(Mechanism(parts, [pin], {"five": ("B", "E")}, home).urdf())
    region = pb.feasible_region(robot, width=0.05)
    (slit,) = region.slits
    assert slit.name == "five turn"
    assert slit.name not in {edge.name for edge in region.edges}
    assert slit.points[0][0] == pytest.approx(-0.6, abs=1e-9)
    hole = shapely.LineString(np.concatenate([e.points for e in region.edges if e.name == "five toggle lower"]))
    assert hole.distance(shapely.Point(slit.points[-1])) < 1e-3
    middle = len(slit.points) // 2
    along = slit.points[middle + 1] - slit.points[middle]
    across = 0.02 * np.array([-along[1], along[0]]) / np.hypot(*along)
    ends = slit.points[middle] + np.array([across, -across])
    assert region.contains(ends).all()
    theta = robot.coupling.expand(ends)
    assert abs(theta[0] - theta[1]).max() == pytest.approx(2.0 * math.pi, abs=0.3)
    found = pb.certify(robot, ends)
    assert [one.name.removesuffix(" upper").removesuffix(" lower") for one in found.violations] == [slit.name]
    file = tmp_path / "robot.urdf"
    done = CliRunner().invoke(app, ["region", str(file), "--width", "0.05"], env={"COLUMNS": "200"})
    assert done.exit_code == 0
    assert "a cut inside it: five turn from (-34.377468, 58.3" in done.output


def test_a_cell_across_a_cut_has_the_values_of_both_sides(load_text: Load) -> None:
    """Across the cut of X's angle B and E jump by a turn: bounds over a cell hold what they are on both sides of it.

    A limit's curve that ends at the cut once left a face open there: 0.6 rad^2 beyond B upper were said to be free.
    """
    rng = np.random.default_rng(7)
    for number in range(42):
        robot = scene(list(KINDS)[number % len(KINDS)], rng, load_text)
        names = tuple(rng.choice(robot.coordinates, 2, replace=False).tolist())
    region = pb.feasible_region(robot, names, width=0.05)
    assert region.slice.lifted is not None
    turn = region.slice.lifted.lift.names.index("loop turn")
    curves = [one for one in region.slice.curves if isinstance(one, LoopLimit)]
    bounds = LoopBounds(curves, *region.slice.window)
    X = rng.uniform(*region.slice.window, (20_000, 2))
    turns = region.slice.lifted.lifted(X)[:, turn]
    at_cut = np.flatnonzero(np.abs(turns) > math.pi - 0.02)[:30]
    near, turns = X[at_cut], turns[at_cut]
    assert len(near) == 30
    which = np.tile(np.arange(len(curves)), len(near))
    half = np.full((len(which), 2), 0.02)
    lower, upper = bounds.bounds(which, np.repeat(near, len(curves), axis=0), half)
    jumped = 0
    for _ in range(25):
        moved = near + 0.02 * rng.uniform(-1.0, 1.0, near.shape)
        values = np.stack([one.value(moved) for one in curves], axis=1).ravel()
        assert np.all((lower <= values + 1e-12) & (values <= upper + 1e-12))
        jumped += int(np.sum(np.abs(region.slice.lifted.lifted(moved)[:, turn] - turns) > math.pi))
    assert jumped > 0
    X, free, reached = flooded(region, 301)
    lower_area, upper_area = region.area_interval
    sides = region.slice.window[1] - region.slice.window[0]
    rim = region.polygon.length * float(sides.max()) / 301
    assert lower_area - rim <= reached.mean() * float(np.prod(sides)) <= upper_area + rim
    assert not np.any(np.asarray(region.contains(X, order="region")) & ~free)
