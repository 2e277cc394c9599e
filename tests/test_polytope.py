"""Free polytopes against regions, clearances at random, boxes proven otherwise, and Monte Carlo."""

import math
from pathlib import Path

import numpy as np
import pytest

import pinbound as pb
from robots import ARM, joint, robot_xml

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


def load(text: str, folder: Path) -> pb.Robot:
    path = folder / "robot.urdf"
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


def test_capsules_of_one_angle_are_proven_by_halving(tmp_path: Path) -> None:
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


def marks(points: list[tuple[str, str, str, float]], pairs: list[tuple[str, str]], extra: str = "") -> str:
    found = [f'<pinbound:point name="{n}" link="{link}" xyz="{x}" radius="{r}"/>' for n, link, x, r in points]
    return "".join([*found, *(f'<pinbound:boundary name="{a}_{b}" a="{a}" b="{b}"/>' for a, b in pairs), extra])


TWO = [joint("q1", "revolute", "base", "a", xyz="0 0 0.1"), joint("q2", "revolute", "a", "b", xyz="0 0 0.4")]
POST = robot_xml(TWO, {}, [], marks([("w", "base", "0.5 0 0.3", 0.1), ("t", "b", "0 0 0.35", 0.05)], [("w", "t")]))
CAPSULES = robot_xml(
    ARM,
    {},
    [],
    '<pinbound:segment name="post" link="base" xyz_a="0 0 0" xyz_b="0 0 0.3" radius="0.1"/>'
    '<pinbound:segment name="arm" link="b" xyz_a="0 0 0" xyz_b="0 0 0.4" radius="0.05"/>'
    '<pinbound:segment name="tool" link="d" xyz_a="0 0 0" xyz_b="0.3 0 0" radius="0.04"/>'
    '<pinbound:boundary name="arm_tool" a="arm" b="tool"/><pinbound:boundary name="post_tool" a="post" b="tool"/>',
)
SLIDING = robot_xml(
    [
        joint("lift", "prismatic", "base", "a", axis="0 0 1", limit="0 0.5"),
        joint("turn", "revolute", "a", "b", axis="0 0 1", xyz="0.1 0 0"),
        joint("reach", "prismatic", "b", "c", axis="1 0 0", xyz="0.2 0 0", limit="0 0.3"),
    ],
    {},
    [],
    marks([("w", "base", "0.5 0.1 0.2", 0.1), ("t", "c", "0.1 0 0", 0.05)], [("w", "t")]),
)


@pytest.mark.parametrize(
    ("text", "q", "least"),
    [(POST, [-1.0, 0.5], 0.5), (CAPSULES, [0.0, 0.0, 0.0, 0.0], 0.2), (SLIDING, [0.4, 2.0, 0.1], 0.2)],
    ids=["spheres", "capsules", "slides"],
)
def test_several_angles_are_searched_and_proven(text: str, q: list[float], least: float, tmp_path: Path) -> None:
    robot = load(text, tmp_path)
    polytope = pb.certified_polytope(robot, q)
    assert polytope.verdict is pb.Verdict.CERTIFIED
    assert not polytope.is_exact
    assert polytope.contains(q)
    rng = np.random.default_rng(3)
    Q = rng.uniform(robot.lower, robot.upper, (100_000, len(q)))
    inside, free = polytope.contains(Q), robot.boundaries.free(Q)
    assert not np.any(inside & ~free)
    assert np.mean(inside) > least * np.mean(free)
    assert not np.all(free)
    value, error = polytope.sampled_volume(100_000)
    share, width = np.mean(inside), np.prod(robot.upper - robot.lower)
    assert value / width == pytest.approx(share, abs=5.0 * (error / width + math.sqrt(share / len(Q))))


def test_a_thin_obstacle_that_samples_miss_is_found_by_the_proof(tmp_path: Path) -> None:
    """A wall of radius 1e-5 m before a tip of radius 1e-5 m: six thousand samples are never in contact."""
    thin = robot_xml(TWO, {}, [], marks([("w", "base", "0.5 0 0.3", 1e-5), ("t", "b", "0 0 0.35", 1e-5)], [("w", "t")]))
    robot = load(thin, tmp_path)
    polytope = pb.certified_polytope(robot, [-1.0, 0.5])
    assert polytope.verdict is pb.Verdict.CERTIFIED
    target = np.array([0.4, -0.04])  # from the two arms, 0.4 and 0.35 m, the tip meets the wall in two ways
    reach, height = 0.5, 0.2
    cosine = (reach**2 + height**2 - 0.4**2 - 0.35**2) / (2 * 0.4 * 0.35)
    for bend in (math.acos(cosine), -math.acos(cosine)):
        lean = math.atan2(reach, height) - math.atan2(0.35 * math.sin(bend), 0.4 + 0.35 * math.cos(bend))
        target = np.array([lean, bend])
        assert robot.boundaries.norms(target)[0] < 1e-9
        assert not polytope.contains(target)
    assert polytope.contains([-1.0, 0.5])


def test_a_seed_close_to_contact_has_a_small_polytope_or_none(tmp_path: Path) -> None:
    robot = load(POST, tmp_path)
    free, contact = np.array([-1.0, 0.5]), np.array([0.6, 1.3])
    aim = free - contact
    assert not robot.boundaries.free(contact)
    while np.max(np.abs(free - contact)) > 1e-12:  # down to the rounding of q
        middle = 0.5 * (free + contact)
        free, contact = (middle, contact) if robot.boundaries.free(middle) else (free, middle)
    for away, wanted in ((1e-4, True), (1e-7, True), (-1e-6, False)):
        q = free + away * aim / np.linalg.norm(aim)
        found = pb.certified_polytope(robot, q)
        assert (found.verdict is pb.Verdict.CERTIFIED) == wanted
        assert found.contains(q) == wanted
    at = pb.certified_polytope(robot, 0.5 * (free + contact))
    assert at.verdict is not pb.Verdict.CERTIFIED
    assert not at.contains(free)


def test_a_budget_that_is_spent_is_said(tmp_path: Path) -> None:
    robot = load(CAPSULES, tmp_path)
    none = pb.certified_polytope(robot, robot.home, budget=pb.Budget(boxes=0, seconds=60.0))
    assert none.verdict is pb.Verdict.UNDECIDED
    assert {box.name for box in none.open_boxes} == {"post_tool"}  # the other is of one angle, and exact
    assert not none.contains(robot.home)
    for boxes in 2 ** np.arange(5, 14):  # where the budget ends it depends on the order of rounds
        some = pb.certified_polytope(robot, robot.home, budget=pb.Budget(boxes=int(boxes), seconds=60.0))
        if some.verdict is pb.Verdict.CERTIFIED:
            break
    assert some.verdict is pb.Verdict.CERTIFIED
    assert any(name.endswith("reach") for name in some.names)
    assert "the budget was spent" in some.notes[-1]
    assert some.contains(robot.home)


def test_deep_in_contact_where_a_pair_has_no_gradient(tmp_path: Path) -> None:
    """Two boxes that overlap deeply are "-radius" apart in every direction: there a face cannot follow the slope."""
    text = robot_xml(
        [joint("q1", "revolute", "base", "a", xyz="0 0 0.1"), joint("q2", "revolute", "a", "b", xyz="0 0 0.4")],
        {},
        [],
        '<pinbound:segment name="fore" link="b" xyz_a="0 0 0" xyz_b="0 0 0.3" radius="0.02"/>'
        '<pinbound:box name="block" link="base" xyz="0.45 0 0.3" rpy="0 0 0" size="0.3 0.3 0.7"/>'
        '<pinbound:boundary name="hit" a="fore" b="block"/>',
    )
    robot = load(text, tmp_path)
    found = pb.certified_polytope(robot, [-0.6, -0.5])
    assert found.verdict is pb.Verdict.CERTIFIED
    Q = np.random.default_rng(2).uniform(robot.lower, robot.upper, (40_000, 2))
    inside = Q[np.all(Q @ found.A.T <= found.b, axis=1)]
    assert robot.boundaries.free(inside).all()
    assert len(inside) > 0.3 * robot.boundaries.free(Q).sum()


def test_a_coordinate_without_limits_needs_a_window(tmp_path: Path) -> None:
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


def test_a_robot_without_moving_joints_is_answered(tmp_path: Path) -> None:
    fixed = '<joint name="f" type="fixed"><parent link="base"/><child link="a"/><origin xyz="0 0 1"/></joint>'
    robot = load(
        f'<robot name="still" xmlns:pinbound="urn:pinbound:1"><link name="base"/><link name="a"/>{fixed}'
        '<pinbound:annotations><pinbound:point name="p" link="base" xyz="0 0 0" radius="0.1"/>'
        '<pinbound:point name="t" link="a" xyz="0 0 0" radius="0.1"/><pinbound:boundary name="pt" a="p" b="t"/>'
        "</pinbound:annotations></robot>",
        tmp_path,
    )
    q, boundaries = np.zeros(0), robot.boundaries
    assert robot.coordinates == ()
    assert boundaries.signed_clearances(q).tolist() == pytest.approx([0.8])
    assert boundaries.free(np.zeros((2, 0))).tolist() == [True, True]
    assert boundaries.gradients(np.zeros((2, 0))).shape == (2, 1, 0)
    certificates = [pb.certify(robot, np.zeros((2, 0))), pb.certify_box(robot, q, q), pb.certified_box(robot, q)]
    assert all(one.verdict is pb.Verdict.CERTIFIED and one.lower == pytest.approx(0.8) for one in certificates)
    assert pb.plan(robot, q, q).verdict is pb.Verdict.CERTIFIED
    with pytest.raises(pb.UnsupportedError, match="no joint of 'still' moves"):
        pb.certified_polytope(robot, q)
