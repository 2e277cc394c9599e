"""Free polytopes against regions, clearances at random, boxes proven otherwise, and Monte Carlo."""

import math

import numpy as np
import pytest

import pinbound as pb
from robots import joint, robot_xml

ELBOW = robot_xml(
    [joint("q1", "revolute", "base", "a", xyz="0 0 0.1"), joint("q2", "revolute", "a", "b", xyz="0 0 0.4")],
    {},
    [],
    '<pinbound:segment name="upper" link="a" xyz_a="0 0 0" xyz_b="0 0 0.4" radius="0.05"/>'
    '<pinbound:segment name="lower" link="b" xyz_a="0 0 0.15" xyz_b="0 0 0.3" radius="0.04"/>'
    '<pinbound:boundary name="fold" a="upper" b="lower"/>',
)
"""One capsule against another at one joint: one effective angle, contact found by isolation and not by a formula."""


@pytest.fixture(scope="module")
def minerva() -> pb.Robot:
    return pb.load("minervabot_v3")


@pytest.fixture(scope="module")
def polytope(minerva: pb.Robot) -> pb.FreePolytope:
    return pb.certified_polytope(minerva, minerva.home)


def load(text: str, folder: object) -> pb.Robot:
    path = folder / "robot.urdf"  # type: ignore[operator]
    path.write_text(text)
    return pb.load(path)


def test_volume_is_the_regions_area_times_the_range_of_q1(minerva: pb.Robot, polytope: pb.FreePolytope) -> None:
    region = pb.feasible_region(minerva)
    width = minerva.upper[0] - minerva.lower[0]
    assert polytope.verdict is pb.Verdict.CERTIFIED
    assert polytope.volume == pytest.approx(width * region.area, abs=1e-10)
    assert polytope.volume_error < 1e-10
    assert set(polytope.names) == {"q1 upper", "q1 lower", *(edge.name for edge in region.edges)}
    corners = {tuple(np.round(v, 9)) for v in polytope.vertices[:, 1:]}
    assert corners == {tuple(np.round(v, 9)) for v in region.vertices}
    assert (len(polytope.vertices), len(polytope.edges)) == (12, 18)  # a prism over a hexagon


def test_whatever_is_inside_is_free_and_a_step_beyond_a_face_is_not(
    minerva: pb.Robot, polytope: pb.FreePolytope
) -> None:
    rng = np.random.default_rng(0)
    Q = rng.dirichlet(np.full(len(polytope.vertices), 0.2), 20_000) @ polytope.vertices
    inside = polytope.contains(Q)
    assert np.mean(inside) > 0.95
    assert np.all(minerva.boundaries.free(Q[inside]))
    beyond = 0
    for face in polytope.faces:
        on = polytope.vertices[np.abs(polytope.vertices @ face.normal - face.bound) < 1e-9].mean(axis=0)
        step = face.normal / (face.normal @ face.normal)
        assert polytope.contains(on - 1e-9 * step)
        outside = on + 1e-9 * step
        assert not polytope.contains(outside)
        assert not minerva.boundaries.free(outside)
        if face.is_contact:
            beyond += 1
            assert minerva.boundaries[face.source].rule.signed(outside[None])[0] < 0.0
    assert beyond == 6


def test_the_slack_is_proven_as_boxes_are(minerva: pb.Robot, polytope: pb.FreePolytope) -> None:
    """The polytope reaches to its slack, some 1e-11 rad, from contact; a box to the same corner is certified."""
    centre = polytope.vertices.mean(axis=0)
    for vertex in polytope.vertices:
        near = centre + (1.0 - 1e-9) * (vertex - centre)
        assert polytope.contains(near)
        assert pb.certify_box(minerva, near, near).verdict is pb.Verdict.CERTIFIED
    assert 0.0 < max(face.slack for face in polytope.faces if face.is_contact) < 1e-10


def test_a_seed_that_is_not_free_has_an_empty_polytope(minerva: pb.Robot) -> None:
    for q, names in (([0.0, 0.0, 1.3], {"beta_1", "beta_3", "beta_4"}), ([9.0, 0.0, 0.0], {"q1 upper"})):
        found = pb.certified_polytope(minerva, q)
        assert (found.verdict, found.volume) == (pb.Verdict.VIOLATED, 0.0)
        assert found.violated in names
        assert not found.contains(q)
        assert not found.contains(minerva.home)
        assert found.vertices.shape == (0, 3)


def test_a_seed_on_a_contact_line_is_not_certified(minerva: pb.Robot, polytope: pb.FreePolytope) -> None:
    face = next(face for face in polytope.faces if face.name == "beta_3")
    for step in (-1e-14, 0.0, 1e-14):
        found = pb.certified_polytope(minerva, [0.0, 0.9, face.bound + step])
        assert found.verdict is not pb.Verdict.CERTIFIED
        assert not found.contains([0.0, 0.9, face.bound + step])


def test_boundaries_that_are_left_out_do_not_cut(minerva: pb.Robot, polytope: pb.FreePolytope) -> None:
    some = pb.certified_polytope(minerva, minerva.home, ["beta_3", "beta_4"])
    assert some.volume > polytope.volume
    assert {face.name for face in some.faces if face.is_contact} <= {"beta_3", "beta_4"}
    limits = pb.certified_polytope(minerva, minerva.home, limits_only=True)
    assert limits.verdict is pb.Verdict.CERTIFIED
    assert limits.volume > some.volume
    assert not any(face.is_contact for face in limits.faces)


def test_rules_with_conditions_leave_a_union_of_which_one_part_is_taken() -> None:
    robot = pb.load("palletizers/dobot_mg400")
    assert pb.certified_polytope(robot, robot.home).verdict is pb.Verdict.NOTHING_TO_CHECK
    first = pb.certified_polytope(robot, robot.home, limits_only=True)
    second = pb.certified_polytope(robot, np.radians([0.0, -22.0, 10.0, 0.0]), limits_only=True)
    assert "front lower" in first.names
    assert "front lower where J3 <= 0" in second.names
    assert "union of 2 half-spaces" in first.notes[0]
    rng = np.random.default_rng(1)
    Q = rng.uniform(robot.lower, robot.upper, (200_000, 4))
    free = robot.intervals.hold(Q)
    held = first.contains(Q), second.contains(Q)
    assert not np.any((held[0] | held[1]) & ~free)
    assert np.array_equal(held[0] | held[1], free)  # the two parts are all there is
    width = np.prod(robot.upper - robot.lower)
    for polytope, inside in zip((first, second), held, strict=True):
        share, error = np.mean(inside), math.sqrt(0.25 / len(Q))
        assert polytope.volume / width == pytest.approx(share, abs=5.0 * error)
        assert polytope.volume_error < 1e-10
    forbidden = np.radians([0.0, -22.0, -1.0, 0.0])
    found = pb.certified_polytope(robot, forbidden, limits_only=True)
    assert (found.verdict, found.violated) == (pb.Verdict.VIOLATED, "front lower")
    edge = np.radians([0.0, -22.0, 0.0, 0.0])  # J3 = 0 is where the rule is still asked for
    assert not second.contains(edge)
    assert not robot.intervals.hold(edge[None])[0]


def test_capsules_of_one_angle_are_proven_by_halving(tmp_path: object) -> None:
    robot = load(ELBOW, tmp_path)
    polytope = pb.certified_polytope(robot, [0.0, 0.0])
    assert polytope.verdict is pb.Verdict.CERTIFIED
    assert polytope.is_exact
    (high,) = (face for face in polytope.faces if face.source == "fold" and face.normal[1] > 0.0)
    Q = np.array([[0.3, high.bound - 1e-8], [0.3, high.bound + 1e-8]])
    near, beyond = robot.boundaries.clearances(Q)[:, 0]
    assert near > 0.0 > beyond
    assert polytope.contains(Q).tolist() == [True, False]
    assert high.slack < 1e-9


def test_several_angles_are_refused_by_name(tmp_path: object) -> None:
    robot = load(
        robot_xml(
            [joint("q1", "revolute", "base", "a", xyz="0 0 0.1"), joint("q2", "revolute", "a", "b", xyz="0 0 0.4")],
            {"p": ("base", "0.2 0 0.1"), "t": ("b", "0.05 0 0.35")},
            [("p", "t")],
        ),
        tmp_path,
    )
    with pytest.raises(pb.UnsupportedError, match="p_t"):
        pb.certified_polytope(robot, [0.0, 0.0])


def test_a_coordinate_without_limits_needs_a_window(tmp_path: object) -> None:
    robot = load(
        robot_xml(
            [joint("q1", "continuous", "base", "a"), joint("q2", "revolute", "a", "b", xyz="0 0 0.4")],
            {"p": ("a", "0 0 0.2"), "t": ("b", "0.2 0 0")},
            [("p", "t")],
        ),
        tmp_path,
    )
    with pytest.raises(pb.DimensionError, match="window"):
        pb.certified_polytope(robot, [0.0, 1.0])
    found = pb.certified_polytope(robot, [0.0, 1.0], window={"q1": (-1.0, 2.0)})
    assert "q1 window upper" in found.names
    assert found.contains([1.9, 1.0])
    assert not found.contains([2.1, 1.0])


def test_what_a_polytope_holds_cannot_be_written_to(polytope: pb.FreePolytope) -> None:
    for array in (polytope.A, polytope.b, polytope.q):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0.0
    with pytest.raises(TypeError, match="neither true nor false"):
        bool(polytope)
    assert not polytope.contains([0.0, math.nan, 0.0])
    assert not polytope.contains([math.inf, 0.0, 0.0])
