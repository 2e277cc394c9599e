"""What a region says of points: their order, other slices, its border, held coordinates, and units that do not mix."""

from collections.abc import Callable

import numpy as np
import pytest

import pinbound as pb
from pinbound.tolerances import LIMIT
from robots import joint, robot_xml

Load = Callable[..., pb.Robot]

ELBOW = [
    joint("q1", "revolute", "base", "a", axis="0 0 1"),
    joint("q2", "revolute", "a", "b", axis="0 0 1", xyz="1 0 0", limit="-2.5 2.5"),
]
POST = '<pinbound:point name="post" link="base" xyz="0.2 1.4 0" radius="0.25"/>'
TIP = '<pinbound:point name="tip" link="b" xyz="0.7 0 0"/><pinbound:boundary name="tip_post" a="tip" b="post"/>'
SLIDE_AND_TURN = [
    joint("q", "revolute", "base", "a", axis="0 0 1", limit="-1 1.5"),
    joint("s", "prismatic", "a", "b", axis="1 0 0", limit="-0.2 0.3"),
]


def elbow(load_text: Load) -> pb.Robot:
    return load_text(robot_xml(ELBOW, {}, [], POST + TIP))


@pytest.mark.parametrize("ask", ["contains", "signed_distance", "points", "applies"])
def test_two_numbers_that_can_be_read_in_two_ways_are_refused(load_text: Load, ask: str) -> None:
    region = pb.feasible_region(elbow(load_text), ("q2", "q1"))
    with pytest.raises(pb.DimensionError, match=r'configuration \(q1, q2\).*point \(q2, q1\).*order="region"'):
        getattr(region, ask)([0.3, 1.45])
    with pytest.raises(pb.UnknownNameError, match="robot, region"):
        getattr(region, ask)([0.3, 1.45], "plane")


def test_both_orders_are_answered_by_the_exact_clearance(load_text: Load) -> None:
    robot = elbow(load_text)
    swapped, straight = pb.feasible_region(robot, ("q2", "q1")), pb.feasible_region(robot, ("q1", "q2"))
    Q = np.random.default_rng(0).uniform(-2.4, 2.4, (4000, 2))
    clear = robot.boundaries.clearances(Q)[:, 0] > 0.0
    expected = straight.contains(Q)  # the robot's own order: one reading only
    assert np.array_equal(swapped.contains(Q, order="robot"), expected)
    assert np.array_equal(swapped.contains(Q[:, ::-1], order="region"), expected)
    assert not np.any(expected & ~clear)
    assert clear.mean() - 0.2 < expected.mean() <= clear.mean() < 1.0
    mirrored = swapped.contains(Q, order="region")
    assert np.any(mirrored & ~clear)  # what the wrong reading would have said
    apart = swapped.signed_distance(Q, order="robot")
    assert np.allclose(apart, straight.signed_distance(Q), atol=3e-5)
    found = pb.region_membership(robot, swapped, Q)
    assert np.array_equal(found.signed_distance, apart)


def test_shapes_that_fit_neither_reading_are_refused(load_text: Load, minerva: pb.Robot) -> None:
    region = pb.feasible_region(minerva)
    for wrong in ([0.0], np.zeros((2, 4)), np.zeros((2, 2, 2)), [["a", "b"]]):
        with pytest.raises(pb.DimensionError):
            region.contains(wrong)
    with pytest.raises(pb.DimensionError):
        region.contains([0.0, 0.0, 0.0], order="region")
    with pytest.raises(pb.DimensionError):
        region.contains([0.0, 0.0], order="robot")
    assert region.contains(np.zeros((0, 3))).shape == (0,)


def certified(robot: pb.Robot, q: np.ndarray) -> bool:
    """Whether a motion that stands still at q is certified, joint limits alone if there is no boundary."""
    return pb.certify(robot, [q, q], limits_only=not len(robot.boundaries)).verdict is pb.Verdict.CERTIFIED


def test_a_region_holds_free_configurations_only_and_all_that_are_connected(minerva: pb.Robot) -> None:
    """A convex region of all coordinates that matter: inside is free, on home's side of every stop, to the last bit."""
    region = pb.feasible_region(minerva)
    rng = np.random.default_rng(5)
    X = [rng.uniform(-0.3, 1.4, (20_000, 2))]
    for edge in region.edges:  # on the edges, and a few roundings to either side
        t = rng.uniform(0.0, 1.0, (400, 1))
        X.append(edge.start + t * (edge.end - edge.start) + rng.choice([-1e-15, 0.0, 1e-16, 1e-13], (400, 2)))
    Q = np.column_stack((rng.uniform(-2.5, 2.5, len(np.concatenate(X))), np.concatenate(X)))
    assert np.array_equal(region.contains(Q), minerva.boundaries.free(Q))


def test_contains_agrees_with_limits_and_certificates_on_the_border_of_limits(load_text: Load) -> None:
    """Limits belong to the region and may be passed by LIMIT; both kinds of region, plain corners included."""
    bare = load_text(robot_xml(ELBOW, {}, []))
    for robot in (bare, elbow(load_text)):
        region = pb.feasible_region(robot, ("q1", "q2"))
        low, high = robot.lower, robot.upper
        for q in (high, low, [0.0, high[1]], [low[0], 0.0], [high[0], low[1]]):
            inside = robot.boundaries.free(q)
            assert region.contains(q) == inside == certified(robot, q)
            assert region.signed_distance(q) == pytest.approx(0.0, abs=1e-9)
        for beyond, kept in ((0.5 * LIMIT, True), (3.0 * LIMIT, False), (1e-9, False)):
            q = np.array([0.0, high[1] + beyond])
            assert region.contains(q) is kept
            assert certified(robot, q) is kept
            assert robot.boundaries.free(q) is kept
            assert (region.signed_distance(q) >= 0.0) is kept


def test_contact_does_not_belong_to_the_region(load_text: Load) -> None:
    robot = elbow(load_text)
    region = pb.feasible_region(robot, ("q1", "q2"))
    for edge in region.edges:
        if edge.is_contact:
            blocked = robot.boundaries.clearances(edge.points)[:, 0] <= 0.0
            assert not np.any(region.contains(edge.points[blocked]))
            assert np.all(region.signed_distance(edge.points[blocked]) <= 0.0)


THREE = [
    joint("q1", "revolute", "base", "a", axis="0 0 1", limit="-1 2"),
    joint("q2", "revolute", "a", "b", axis="0 1 0"),
    joint("q3", "revolute", "b", "c", axis="0 1 0", xyz="0 0 1"),
    joint("f", "revolute", "a", "d", axis="0 1 0", mimic="q1 2 0", limit="-3 1"),
]


def test_limits_of_held_coordinates_count_those_of_mimic_joints_too(load_text: Load) -> None:
    robot = load_text(robot_xml(THREE, {"o": ("base", "0 0 0.2"), "t": ("c", "0.1 0 0.6")}, [("o", "t")]))
    region = pb.feasible_region(robot, ("q2", "q3"))
    Q = np.array([[q1, 0.1, 0.2] for q1 in (0.0, -1.0, 0.5, -1.5, 0.6, 3.0, 0.5 + 1e-13, 0.5 + 1e-9)])
    assert region.contains(Q).tolist() == [True, True, True, False, False, False, True, False]
    assert np.array_equal(region.contains(Q), region.signed_distance(Q) > 0.0)
    assert region.contains(Q[:, 1:]).all()  # points of the plane: the others are where the slice holds them


def test_a_configuration_of_another_slice_is_refused_and_named(load_text: Load) -> None:
    """The mast stands beside the axis of q1, so what q1 is matters."""
    robot = load_text(robot_xml(THREE, {"mast": ("base", "0.5 0 1"), "t": ("c", "0 0.05 0.6")}, [("mast", "t")]))
    region = pb.feasible_region(robot, ("q2", "q3"), at=[0.3, 0.0, 0.0])
    assert region.fixed == ("q1",)
    assert region.contains([0.3, 0.1, 0.1]) is True
    rows = np.array([[0.3, 0.1, 0.1], [0.2, 0.1, 0.1]])
    with pytest.raises(pb.DimensionError, match=r"slice at q1 = 0.3.*mast_t depends on q1.*row 1"):
        region.contains(rows)
    assert region.applies(rows).tolist() == [True, False]
    assert np.isnan(region.signed_distance(rows)).tolist() == [False, True]
    assert np.isnan(region.points(rows)[1]).all()
    assert region.contains([np.nan, 0.1, 0.1]) is False


def test_units_of_a_plane_and_of_its_area(load_text: Load) -> None:
    robot = load_text(robot_xml(SLIDE_AND_TURN, {}, []))
    region = pb.feasible_region(robot)
    assert region.units == ("rad", "m")
    assert region.area_unit == "m rad"
    assert region.area == pytest.approx(2.5 * 0.5)
    assert "m rad" in repr(region)
    assert pb.feasible_region(pb.load("minervabot_v3")).area_unit == "rad^2"


@pytest.mark.parametrize("curved", [False, True])
def test_radians_and_metres_are_added_only_with_weights(load_text: Load, curved: bool) -> None:
    marks = '<pinbound:point name="p" link="b" xyz="0.5 0 0"/>'
    marks += '<pinbound:point name="o" link="base" xyz="0.3 0.5 0" radius="0.1"/>'
    marks += '<pinbound:boundary name="p_o" a="p" b="o"/>'
    robot = load_text(robot_xml(SLIDE_AND_TURN, {}, [], marks if curved else ""))
    region = pb.feasible_region(robot)
    assert bool(region.accuracy) is curved
    for ask in (
        lambda: region.signed_distance([0.1, 0.1]),
        lambda: region.inset(0.05),
        region.perimeter,
        *((region.convex_parts, region.inscribed_polygon) if curved else ()),
    ):
        with pytest.raises(pb.DimensionError, match=r"'q' in rad and 's' in m; give weights=\{'q': \.\.\., 's'"):
            ask()
    weights = {"q": 0.5, "s": 1.0}  # a lever arm of half a metre
    x = np.array([-0.8, 0.25])
    expected = min(0.5 * 0.2, 0.05)  # to q lower, and to s upper
    assert region.signed_distance(x, weights=weights) == pytest.approx(expected, abs=1e-12)
    assert region.contains(x)
    inset = region.inset(0.03, weights=weights)
    depth = region.signed_distance(np.concatenate([edge.points for edge in inset.edges]), weights=weights)
    assert depth.min() >= 0.03 - 1e-12
    assert depth.min() <= 0.03 + 2e-3 * 0.03 + 1e-5
    assert inset.contains(x) is True
    if not curved:
        assert region.perimeter(weights) == pytest.approx(2 * (0.5 * 2.5 + 0.5))
        assert inset.area == pytest.approx((2.5 - 0.12) * (0.5 - 0.06))
    for wrong, match in (({"q": 1.0}, "both"), ({"q": 1.0, "s": -1.0}, "both"), ({"q": 1.0, "z": 1.0}, "weights")):
        with pytest.raises(pb.PinboundError, match=match):
            region.signed_distance(x, weights=wrong)
    slacks = region.supports()
    if curved:
        assert all(part.polygon.is_valid for part in region.convex_parts(weights=weights))
        assert region.inscribed_polygon(weights=weights).area > 0.3 * region.area
    assert slacks["q upper"].slack == 0.0


def test_membership_in_a_plane_of_both_units_is_a_share_unless_weighted(load_text: Load) -> None:
    robot = load_text(robot_xml(SLIDE_AND_TURN, {}, []))
    region = pb.feasible_region(robot)
    found = pb.region_membership(robot, region, [[0.25, 0.05], [0.25, 0.25], [2.0, 0.0]])
    assert found.unit == "1"
    assert found.signed_distance == pytest.approx([0.5, 0.1, -0.2])
    weighted = pb.region_membership(robot, region, [0.25, 0.05], {"q": 0.1, "s": 1.0})
    assert weighted.unit == "weighted"
    assert weighted.signed_distance == pytest.approx([0.125])


def test_a_region_of_no_boundary_is_the_box_of_limits_and_an_empty_one_holds_nothing(load_text: Load) -> None:
    region = pb.feasible_region(load_text(robot_xml(ELBOW, {}, [])))
    assert [edge.name for edge in region.edges] == ["q1 upper", "q2 upper", "q1 lower", "q2 lower"]
    assert region.area == pytest.approx(30.0)
    empty = region.inset(3.0)
    assert empty.is_empty
    assert not empty.contains([0.0, 0.0])
    assert empty.signed_distance([0.0, 0.0]) == -np.inf
    assert empty.supports() == {}
    assert empty.perimeter() == 0.0


def test_records_hash_and_compare_and_their_arrays_are_read_only(load_text: Load) -> None:
    region = pb.feasible_region(elbow(load_text), ("q1", "q2"))
    for record in (region, region.slice, *region.edges, *region.corners, *region.slice.box):
        assert (record == region) is (record is region)
        assert isinstance(hash(record), int)
        assert record in {record}
    arrays = [region.at, region.vertices, region.slice.start, region.slice.window, region.edges[0].points]
    arrays += [region.corners[0].point, region.slice.box[0].normal]
    for array in arrays:
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0.0
