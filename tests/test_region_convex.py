"""Planar regions of boundaries with one effective angle, against brute force."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy import ndimage

import pinbound as pb
from robots import joint, robot_xml

Load = Callable[..., pb.Robot]


def flood_fill(robot: pb.Robot, region: pb.Region, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return grid points (count^2, 2) and whether each is connected with home, by contact lines crossed on a grid.

    A zero-threshold contact is a line, which no grid point hits: a step between neighbours is blocked if an
    effective angle passes a contact on the way, which the sign of sin((phi - phi*) / 2) tells.
    """
    plane = [robot.coordinates.index(name) for name in region.coordinates]
    low, high = robot.lower[plane], robot.upper[plane]
    axes = [np.linspace(a, b, count) for a, b in zip(low, high, strict=True)]
    x, y = np.meshgrid(*axes, indexing="ij")
    Q = np.repeat(robot.home[None], x.size, axis=0)
    Q[:, plane] = np.column_stack((x.ravel(), y.ravel()))
    free = np.ones((count, count), dtype=bool)
    cell = np.zeros((count, count), dtype=np.int64)
    for k, boundary in enumerate(robot.boundaries):
        contact = boundary.contact
        assert contact is not None
        turns = np.floor((Q @ contact.coefficients - contact.angle) / (2 * np.pi)).astype(np.int64)
        cell += (turns.reshape(count, count) + 4) * 16**k
        free &= boundary.clearance(Q).reshape(count, count) > 0
    at_home = [int(np.argmin(np.abs(axis - robot.home[i]))) for axis, i in zip(axes, plane, strict=True)]
    same = free & (cell == cell[tuple(at_home)])
    labels, _ = ndimage.label(same)
    return Q[:, plane], (labels == labels[tuple(at_home)]).ravel()


TWO_STOPS = robot_xml(
    [joint("q2", "revolute", "base", "a", limit="-2 2"), joint("q3", "revolute", "a", "b", limit="-2.5 2.5")],
    {"p": ("base", "0.3 0 0"), "s": ("a", "0 0 0.3"), "t": ("a", "0.2 0.05 0"), "u": ("b", "0 0.05 0.2")},
    [],
    '<pinbound:boundary name="shoulder" a="p" b="s" min_distance="0.05"/>'
    '<pinbound:boundary name="elbow" a="t" b="u" min_distance="0.02"/>',
)


def test_membership_equals_brute_force_with_thresholds(load_text: Load) -> None:
    robot = load_text(TWO_STOPS)
    region = pb.feasible_region(robot)
    points, expected = flood_fill(robot, region, 201)
    distance = region.signed_distance(points)
    far = np.abs(distance) > 1e-9
    assert np.array_equal(region.contains(points)[far], expected[far])
    assert expected.any()
    assert not expected.all()


def test_membership_of_the_hexagon_equals_brute_force(minerva: pb.Robot) -> None:
    region = pb.feasible_region(minerva)
    points, expected = flood_fill(minerva, region, 301)
    far = np.abs(region.signed_distance(points)) > 1e-9
    assert np.array_equal(region.contains(points)[far], expected[far])


def test_clearance_at_edges_is_zero_and_turns_negative_beyond(load_text: Load) -> None:
    robot = load_text(TWO_STOPS)
    for edge in pb.feasible_region(robot).edges:
        if not edge.is_contact:
            continue
        middle = (edge.start + edge.end) / 2
        along = edge.end - edge.start
        outwards = np.array([along[1], -along[0]]) / np.linalg.norm(along)
        boundary = robot.boundaries[edge.name]
        assert abs(boundary.clearance(middle)) < 1e-13
        assert boundary.clearance(middle + 1e-6 * outwards) < 0 < boundary.clearance(middle - 1e-6 * outwards)


def test_followers_limits_bind_their_primaries(load_text: Load) -> None:
    joints = [
        joint("q1", "revolute", "base", "a", limit="-3 3"),
        joint("q2", "revolute", "base", "b", limit="-3 3"),
        joint("f1", "revolute", "a", "c", mimic="q1 2 0.1", limit="-0.5 0.7"),
    ]
    region = pb.feasible_region(load_text(robot_xml(joints, {}, [])), coordinates=("q1", "q2"))
    assert [edge.name for edge in region.edges if edge.source == "f1"] == ["f1 upper", "f1 lower"]
    assert region.vertices[:, 0].min() == pytest.approx(-0.3)
    assert region.vertices[:, 0].max() == pytest.approx(0.3)


def test_halfspaces_distance_and_membership_agree(minerva: pb.Robot) -> None:
    region = pb.feasible_region(minerva)
    A, b = region.halfspaces()
    points = np.random.default_rng(3).uniform(-1, 2, (500, 2))
    inside = np.all(points @ A.T < b, axis=1)
    assert np.array_equal(region.contains(points), inside)
    from shapely import Point

    for point, distance in zip(points[:50], region.signed_distance(points[:50]), strict=True):
        expected = region.polygon.exterior.distance(Point(point)) * (1 if region.polygon.contains(Point(point)) else -1)
        assert distance == pytest.approx(expected, abs=1e-12)


def test_of_q1_only_its_limits_count_and_non_finite_rows_are_outside(minerva: pb.Robot) -> None:
    region = pb.feasible_region(minerva)
    rows = np.array([[2.3, 0, 0], [np.nan, 0, 0], [0, np.inf, 0], [0, 0, 2.0], [5.0, 0, 0], [minerva.upper[0], 0, 0]])
    assert region.contains(rows).tolist() == [True, False, False, False, False, True]
    assert region.signed_distance(rows)[4] == -np.inf
    assert np.isnan(region.signed_distance(rows)[[1, 2]]).all()


def test_scaling_and_inset(minerva: pb.Robot) -> None:
    region = pb.feasible_region(minerva)
    scaled = region.scale(0.9)
    expected = region.centroid + 0.9 * (region.vertices - region.centroid)
    assert scaled.vertices == pytest.approx(expected, abs=1e-12)
    assert scaled.centroid == pytest.approx(region.centroid, abs=1e-12)
    inset = region.inset(0.05)
    assert region.signed_distance(inset.vertices).min() == pytest.approx(0.05, abs=1e-12)
    assert region.inset(2.0).is_empty
    assert not region.inset(2.0).contains([0.0, 0.0, 0.0])
    for wrong in (0.0, 1.1, np.nan):
        with pytest.raises(pb.DimensionError):
            region.scale(wrong)


def test_questions_that_cannot_be_answered_say_why(minerva: pb.Robot, load_text: Load) -> None:
    with pytest.raises(pb.UnknownNameError, match="q1, q2, q3"):
        pb.feasible_region(minerva, coordinates=("q2", "q4"))
    with pytest.raises(pb.UnsupportedError, match="two coordinates"):
        pb.feasible_region(minerva, coordinates=("q2",))
    with pytest.raises(pb.DimensionError, match="beta_10"):
        pb.feasible_region(minerva, at=[0.0, -0.5, 0.0])
    free = load_text(robot_xml([joint("q1", "continuous", "base", "a"), joint("q2", "continuous", "a", "b")], {}, []))
    with pytest.raises(pb.DimensionError, match="window"):
        pb.feasible_region(free, coordinates=("q1", "q2"))
    window = pb.feasible_region(free, ("q1", "q2"), window={"q1": (-1, 1), "q2": (-2, 2)})
    assert window.area == pytest.approx(8.0)


def test_every_other_turn_has_a_region_of_its_own(minerva: pb.Robot) -> None:
    wide = {"q2": (-10.0, 10.0), "q3": (-10.0, 10.0)}
    assert pb.feasible_region(minerva, window=wide).area == pytest.approx(1.5434743997, abs=1e-9)
