"""Covers hold their bodies; proposals leave nothing out without a reason that holds."""

import itertools
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import pinbound as pb
from pinbound.coverage.bodies import Body, collision_bodies
from pinbound.coverage.covers import cover, covers
from pinbound.coverage.poses import Poses
from pinbound.coverage.reach import least_separation
from pinbound.evaluate.closest import nearest
from pinbound.evaluate.separation import separations
from pinbound.marking.candidates import draw, within_limits
from pinbound.model.coupling import LinearLimit
from pinbound.path.relative import relative_path
from robots import ARM, joint, robot_xml

Load = Callable[..., pb.Robot]

SHAPES = {
    "box": (0.3, 0.1, 0.05),
    "flat box": (0.4, 0.4, 0.01),
    "cylinder": (0.05, 0.4),
    "disc": (0.2, 0.03),
    "capsule": (0.05, 0.4),
    "sphere": (0.1,),
    "short capsule": (0.1, 0.0),
}


def points_of(shape: str, size: tuple[float, ...], rng: np.random.Generator, count: int) -> np.ndarray:
    """Return points of a body in its own frame, many of them on its surface and its edges."""
    if shape == "box":
        points = rng.uniform(-0.5, 0.5, (count, 3))
        faces = rng.random((count, 3)) < 0.6
        return np.where(faces, np.sign(points) / 2, points) * size
    direction = rng.normal(size=(count, 3))
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    if shape == "sphere":
        return direction * size[0]
    radius, length = size
    if shape == "capsule":
        return direction * radius + np.outer(rng.uniform(-length / 2, length / 2, count), [0, 0, 1])
    angle = rng.uniform(0, 2 * np.pi, count)
    height = np.where(rng.random(count) < 0.5, np.sign(rng.normal(size=count)) / 2, rng.uniform(-0.5, 0.5, count))
    return np.column_stack((radius * np.cos(angle), radius * np.sin(angle), height * length))


def distance_outside(shape: str, size: tuple[float, ...], points: np.ndarray) -> np.ndarray:
    if shape == "box":
        return np.linalg.norm(np.maximum(np.abs(points) - np.array(size) / 2, 0.0), axis=1)
    if shape == "sphere":
        return np.maximum(np.linalg.norm(points, axis=1) - size[0], 0.0)
    radius, length = size
    beyond = np.maximum(np.abs(points[:, 2]) - length / 2, 0.0)
    across = np.linalg.norm(points[:, :2], axis=1)
    if shape == "capsule":
        return np.maximum(np.hypot(across, beyond) - radius, 0.0)
    return np.hypot(np.maximum(across - radius, 0.0), beyond)


@pytest.mark.parametrize("accuracy", [0.5, 0.02, 0.002])
@pytest.mark.parametrize("name", SHAPES)
def test_a_cover_holds_its_body_and_sticks_out_by_no_more_than_it_says(name: str, accuracy: float) -> None:
    rng, shape = np.random.default_rng(1), name.rsplit(maxsplit=1)[-1] if name != "disc" else "cylinder"
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    body = Body("l", 0, shape, SHAPES[name], turn, np.array([0.1, -0.2, 0.3]))
    found = cover(body, accuracy, "spheres")
    centres, radius = np.array([mark.xyz for mark in found.marks]), found.marks[0].radius
    assert 1 <= len(centres) <= 64
    points = points_of(shape, body.size, rng, 4000) @ turn.T + body.translation
    nearest = np.min(np.linalg.norm(points[:, None] - centres[None], axis=2), axis=1)
    assert np.all(nearest <= radius * (1 + 1e-12))
    directions = rng.normal(size=(2000, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    for centre in centres:
        shell = (centre + radius * directions - body.translation) @ turn
        assert distance_outside(shape, body.size, shell).max() <= found.excess + 1e-12


@pytest.mark.parametrize("accuracy", [0.5, 0.02, 0.002, 1e-5])
@pytest.mark.parametrize("name", SHAPES)
def test_a_body_that_covers_holds_its_body_too(name: str, accuracy: float) -> None:
    rng, shape = np.random.default_rng(2), name.rsplit(maxsplit=1)[-1] if name != "disc" else "cylinder"
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    body = Body("l", 0, shape, SHAPES[name], turn, np.array([0.1, -0.2, 0.3]))
    found = cover(body, accuracy)
    (mark,) = found.marks
    points = points_of(shape, body.size, rng, 1500) @ turn.T + body.translation
    ways = np.array(mark.ways).reshape(-1, 1, 3)
    w, e = np.array(mark.xyz) - points, np.repeat(ways, len(points), axis=1)
    away = np.linalg.norm(w + np.einsum("nk,kni->ni", nearest(w, e), e), axis=1)
    assert np.all(away <= mark.radius + 1e-13 * (1 + max(body.size)))
    corners = np.array(list(itertools.product((0.0, 1.0), repeat=len(ways)))) @ ways.reshape(-1, 3) + mark.xyz
    outside = distance_outside(shape, body.size, (corners - body.translation) @ turn)
    assert outside.max() + (0.0 if shape in ("capsule", "sphere") else mark.radius) <= found.excess + 1e-12


def test_a_capsule_holds_end_spheres_that_are_a_little_larger_or_beside_its_ends() -> None:
    rod = Body("l", 0, "cylinder", (0.05, 0.4), np.eye(3), np.zeros(3))
    for aside, larger in ((9e-10, 0.0), (0.0, 9e-10), (6e-10, 6e-10), (0.0, -9e-10), (0.0, 0.0)):
        ends = [
            Body("l", i + 1, "sphere", (0.05 + larger,), np.eye(3), np.array([aside, 0.0, end]))
            for i, end in enumerate((0.2, -0.2))
        ]
        (found,) = covers([rod, *ends], 0.01)
        (mark,) = found.marks
        assert len(found.bodies) == 3
        assert mark.radius >= 0.05 + aside + larger - 1e-17
        assert mark.radius == 0.05 + found.excess
        assert found.excess <= max(aside + larger, 0.0) + 1e-16


def test_a_mesh_is_named_as_not_covered(tmp_path: Path) -> None:
    text = robot_xml(ARM, {}, []).replace(
        '<link name="d"/>', '<link name="d"><collision><geometry><mesh filename="x.stl"/></geometry></collision></link>'
    )
    path = tmp_path / "arm.urdf"
    path.write_text(text)
    proposal = pb.propose_marks(pb.load(path))
    assert [(body.link, body.shape) for body in proposal.uncovered] == [("d", "mesh")]
    assert not proposal.annotations.boundaries


def sphere(link: str, radius: float, xyz: str = "0 0 0") -> tuple[str, str]:
    shape = f'<collision><origin xyz="{xyz}"/><geometry><sphere radius="{radius}"/></geometry></collision>'
    return f'<link name="{link}"/>', f'<link name="{link}">{shape}</link>'


def test_reasons_for_leaving_pairs_out_hold(tmp_path: Path) -> None:
    text = robot_xml(ARM, {}, [])
    for link, radius, xyz in (
        ("base", 0.05, "0 0 0"),
        ("a", 0.05, "0 0 0"),
        ("b", 0.04, "0 0 0.2"),
        ("d", 0.03, "0 0 0"),
    ):
        text = text.replace(*sphere(link, radius, xyz))
    path = tmp_path / "arm.urdf"
    path.write_text(text)
    bare = pb.load(path)
    proposal = pb.propose_marks(bare)
    reasons = {(a, b): reason for a, b, reason in proposal.left_out}
    assert reasons["base", "a"] == reasons["a", "b"] == "neighbours"
    assert reasons["base", "b"] == "can never meet"
    Q = np.random.default_rng(0).uniform(-3.2, 3.2, (20_000, 4))
    gap = np.linalg.norm(bare.positions("base", Q) - bare.positions("b", Q, (0, 0, 0.2)), axis=1)
    assert gap.min() > 0.09
    assert {(mark.a, mark.b) for mark in proposal.annotations.boundaries} == {
        ("base.0", "d.0"),
        ("a.0", "d.0"),
        ("b.0", "d.0"),
    }
    proposal.annotations.save(tmp_path / "arm.pinbound.yaml")
    marked = pb.load(path)
    assert marked.boundaries.clearances(marked.home).min() > 0


def test_wrong_questions() -> None:
    robot = pb.load("minervabot_v3")
    with pytest.raises(pb.UnknownNameError, match="sphere, box, cylinder, capsule"):
        pb.propose_marks(robot, shapes=("cone",))
    with pytest.raises(pb.DimensionError, match="positive"):
        cover(Body("l", 0, "sphere", (1.0,), np.eye(3), np.zeros(3)), 0.0)


INERTIA = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'


def urdf(links: dict[str, str], joints: list[str], extra: str = "") -> str:
    """Return a URDF of links with the given elements inside; `joint` declares links, too, which is dropped."""
    body = "".join(f'<link name="{name}">{inner}</link>' for name, inner in links.items())
    bare = "".join(text.partition("</joint>")[0] + "</joint>" for text in joints)
    return f'<robot name="r" xmlns:pinbound="urn:pinbound:1">{body}{bare}{extra}</robot>'


def block(size: str, xyz: str = "0 0 0") -> str:
    return f'<collision><origin xyz="{xyz}"/><geometry><box size="{size}"/></geometry></collision>'


def ball(radius: float, xyz: str = "0 0 0") -> str:
    return f'<collision><origin xyz="{xyz}"/><geometry><sphere radius="{radius}"/></geometry></collision>'


def reason_of(proposal: pb.Proposal, a: str, b: str) -> list[str]:
    return [reason for left, right, reason in proposal.left_out if {left, right} == {a, b}]


@pytest.mark.parametrize("middle", ["", INERTIA, ball(0.001, "9 9 9")])
@pytest.mark.parametrize(
    ("lift", "then"),
    [
        (joint("q1", "prismatic", "a", "m", axis="0 0 1"), joint("q2", "revolute", "m", "b", axis="0 0 1")),
        (joint("q1", "prismatic", "a", "m", axis="1 0 0"), joint("q2", "prismatic", "m", "b", axis="0 0 1")),
        (joint("q1", "prismatic", "a", "m", axis="0 0 1"), joint("q2", "prismatic", "m", "b", axis="0 0 1")),
        (joint("q1", "revolute", "a", "m", axis="0 0 1"), joint("q2", "continuous", "m", "b", axis="0 1 0")),
        (joint("q1", "revolute", "a", "m", xyz="0 0 1"), joint("q2", "revolute", "m", "b", axis="0 1 0", xyz="1 0 0")),
        (
            joint("q1", "revolute", "a", "m", xyz="0 0 1"),
            joint("q2", "revolute", "m", "b", mimic="q1 1 0", xyz="1 0 0"),
        ),
    ],
)
def test_two_degrees_of_freedom_apart_is_never_neighbours(load_text: Load, middle: str, lift: str, then: str) -> None:
    links = {"a": block("0.5 0.5 0.5"), "m": middle, "b": block("0.5 0.5 0.5", "0 0 0.8")}
    robot = load_text(urdf(links, [lift, then]))
    assert robot.tree.degrees_between("a", "b", robot.coupling) == 2
    assert robot.tree.degrees_between("a", "m") == 1
    assert "neighbours" not in reason_of(pb.propose_marks(robot), "a", "b")


def test_which_links_are_neighbours(load_text: Load, minerva: pb.Robot) -> None:
    level = [
        joint("q1", "revolute", "a", "upper", xyz="0 0 1"),
        joint("flip", "fixed", "upper", "side", rpy="3.141592653589793 0 0"),
        joint("level", "revolute", "side", "helper", xyz="0 0 -1", mimic="q1 1 0"),
        joint("q2", "revolute", "helper", "fore", axis="0 -1 0"),
        joint("beside", "revolute", "side", "rod", xyz="0 0 -1", mimic="q1 1 0"),
        joint("still", "revolute", "fore", "tool", axis="1 0 0", xyz="1 0 0", mimic="q1 0 0.5"),
        joint("loose", "planar", "tool", "table"),
        joint("free", "floating", "table", "cup"),
    ]
    names = ("a", "upper", "side", "helper", "fore", "rod", "tool", "table", "cup")
    robot = load_text(urdf(dict.fromkeys(names, ""), level))
    between = {
        ("upper", "side"): 0,
        ("a", "side"): 1,
        ("upper", "helper"): 1,
        ("upper", "fore"): 1,  # the level link only carries a second joint at the same place
        ("side", "fore"): 1,
        ("a", "fore"): 2,
        ("fore", "tool"): 0,  # a mimic joint of multiplier 0
        ("helper", "rod"): 0,  # both keep the base's orientation
        ("fore", "rod"): 2,
        ("tool", "table"): 3,
        ("table", "cup"): 6,
        ("fore", "table"): 3,
    }
    for (a, b), count in between.items():
        assert robot.tree.degrees_between(a, b, robot.coupling) == count, (a, b)
        assert robot.tree.degrees_between(b, a, robot.coupling) == count, (b, a)
    tree, coupling = minerva.tree, minerva.coupling
    assert tree.degrees_between("link_2", "link_3", coupling) == 1
    assert tree.degrees_between("link_2", "link_13", coupling) != 1  # beside each other on link_1; beta_4 is theirs


LIMITED = urdf(
    {"base": ball(0.05), "a": "", "b": ball(0.05, "0.3 0 0"), "f": ""},
    [
        joint("j1", "revolute", "base", "a", xyz="0.2 0 0"),
        joint("j2", "revolute", "a", "b", xyz="0.2 0 0"),
        joint("j3", "revolute", "base", "f", xyz="0 1 0"),
    ],
)
SIDECAR = """
contact_tolerance: 1.0e-4
home: {j1: 0.1}
points: [{name: mine, link: f, xyz: [0, 1, 0], radius: 0.01}, {name: base.0, link: base, xyz: [0, 0, 1], radius: 0.02}]
boundaries: [{name: base.0-b.0, a: mine, b: base.0, min_distance: 0.003}]
followers: [{joint: j3, primary: j1, multiplier: -0.5}]
limits: [{joint: j1, lower: -0.5, upper: 0.5}]
assumptions: [measured with a ruler]
"""


def same_robot(robot: pb.Robot, marked: pb.Robot) -> None:
    """What was said stays said: the coupling, limits, loops, boundaries."""
    assert marked.coordinates == robot.coordinates
    assert np.array_equal(marked.coupling.S, robot.coupling.S)
    assert np.array_equal(marked.coupling.offset, robot.coupling.offset)
    ends = [[(limit.joint, limit.lower, limit.upper) for limit in one.linear_limits] for one in (robot, marked)]
    assert ends[0] == ends[1]
    assert len(marked.closures) == len(robot.closures)
    assert marked.annotations.contact_tolerance == robot.annotations.contact_tolerance
    assert marked.annotations.assumptions == robot.annotations.assumptions
    for boundary in robot.boundaries:
        kept = marked.boundaries[boundary.name]
        assert kept.threshold == boundary.threshold
        assert (kept.point_a.xyz, kept.point_b.xyz) == (boundary.point_a.xyz, boundary.point_b.xyz)


def test_what_the_sidecar_says_is_repeated(load_text: Load, tmp_path: Path) -> None:
    robot = load_text(LIMITED, SIDECAR)
    proposal = pb.propose_marks(robot)
    proposal.annotations.save(tmp_path / "more.yaml")
    marked = pb.load(tmp_path / "robot.urdf", annotations=tmp_path / "more.yaml")
    same_robot(robot, marked)
    assert marked.home.tolist() == robot.home.tolist() == [0.1, 0.0]
    assert [boundary.name for boundary in marked.boundaries] == ["base.0-b.0", "base.0.2-b.0"]
    verdict = [pb.certify(one, [[0.0, 0.0], [2.0, 0.0]]).verdict.name for one in (robot, marked)]
    assert verdict == ["VIOLATED", "VIOLATED"]
    again = pb.propose_marks(marked)
    assert again.annotations == proposal.annotations


def test_what_is_said_inside_the_urdf_stays_there(load_text: Load, tmp_path: Path) -> None:
    inline = (
        '<pinbound:annotations contact_tolerance="1e-4"><pinbound:home j1="0.1"/>'
        '<pinbound:point name="mine" link="f" xyz="0 1 0"/><pinbound:point name="yours" link="base" xyz="0 0 1"/>'
        '<pinbound:boundary name="stop" a="mine" b="yours"/><pinbound:limit joint="j1" lower="-0.5" upper="0.5"/>'
        '<pinbound:follower joint="j3" primary="j1" multiplier="-0.5"/><pinbound:assumption>level</pinbound:assumption>'
        "</pinbound:annotations></robot>"
    )
    robot = load_text(LIMITED.replace("</robot>", inline))
    proposal = pb.propose_marks(robot)
    own = proposal.annotations
    assert not own.home
    assert not own.limits
    assert not own.followers
    assert not own.assumptions
    assert set(own.marks) == {"base.0", "b.0"}
    own.save(tmp_path / "robot.pinbound.yaml")
    marked = pb.load(tmp_path / "robot.urdf")
    same_robot(robot, marked)
    assert marked.home.tolist() == robot.home.tolist()
    assert marked.boundaries.names == ("stop", "base.0-b.0")


def test_a_robot_with_loops_keeps_them(minerva: pb.Robot) -> None:
    proposal = pb.propose_marks(minerva, shapes=("box",))
    marked = pb.load("minervabot_v3", annotations=proposal.annotations)
    same_robot(minerva, marked)
    assert marked.boundaries.names[: len(minerva.boundaries)] == minerva.boundaries.names
    assert len(marked.boundaries) > len(minerva.boundaries) + 100


OPEN_LOOP = [
    joint("q1", "revolute", "base", "crank", xyz="0 0 0"),
    joint("q2", "revolute", "crank", "rod", xyz="0 0 0.2"),
    joint("q3", "revolute", "base", "lever", xyz="0.3 0 0"),
]
PIN = "closures: [{name: pin, link_a: rod, xyz_a: [0.3, 0, 0], link_b: lever, xyz_b: [0, 0, 0.2]}]"


def test_a_new_home_keeps_the_assembly_of_a_loop(load_text: Load, tmp_path: Path) -> None:
    """A home that is replaced names the joints of the loop, or the loop would be read in another pose."""
    links = {"base": ball(0.15, "0 0 0.4"), "crank": "", "rod": ball(0.1, "0 0 0.1"), "lever": ""}
    robot = load_text(urdf(links, OPEN_LOOP), PIN)
    assert robot.coordinates == ("q1",)
    proposal = pb.propose_marks(robot)
    assert "replaces it" in proposal.home_note
    assert set(proposal.annotations.home) == {"q1", "q2", "q3"}
    proposal.annotations.save(tmp_path / "more.yaml")
    marked = pb.load(tmp_path / "robot.urdf", annotations=tmp_path / "more.yaml")
    same_robot(robot, marked)
    assert len(marked.boundaries) == 1


def touching(limits: dict[str, str], *followers: str) -> str:
    """Return two blocks that touch at zero, on two revolute joints, with mimic joints aside."""
    links = {"base": block("0.3 0.3 1"), "a": "", "b": block("0.3 0.3 1", "0 0 0.1"), "f": "", "g": ""}
    joints = [
        joint("q1", "revolute", "base", "a", xyz="0 0 0.3", limit=limits.get("q1", "-3 3")),
        joint("q2", "revolute", "a", "b", xyz="0 0 0.5", limit=limits.get("q2", "-2.5 2.5")),
        *followers,
    ]
    names = {word for text in joints for word in ("f", "g") if f'<link name="{word}"/>' in text}
    return urdf({name: inner for name, inner in links.items() if name not in {"f", "g"} - names}, joints)


@pytest.mark.parametrize(
    "text",
    [
        touching({}, joint("f", "revolute", "base", "f", mimic="q1 1 0", limit="-1 0.3")),
        touching({}, joint("f", "revolute", "base", "f", mimic="q1 -2 0.1", limit="-0.001 3")),
        touching(
            {},
            joint("f", "revolute", "base", "f", mimic="q1 1000 0", limit="-1 1"),
            joint("g", "prismatic", "base", "g", mimic="q2 0.001 0", limit="-1 0.002"),
        ),
        touching({"q1": "-1e16 1e16", "q2": "-1e300 1e300"}),
        touching({"q1": "0 9"}, joint("f", "revolute", "base", "f", mimic="q1 1 0", limit="0.8 1.1")),  # not at zero
    ],
)
def test_a_new_home_keeps_the_limits_of_mimic_joints(load_text: Load, tmp_path: Path, text: str) -> None:
    robot = load_text(text)
    proposal = pb.propose_marks(robot)
    assert "The proposal replaces it by q1 = " in proposal.home_note
    assert " deg" in proposal.home_note
    proposal.annotations.save(tmp_path / "robot.pinbound.yaml")
    marked = pb.load(tmp_path / "robot.urdf")
    assert len(marked.boundaries) == 1
    assert marked.boundaries.clearances(marked.home).min() > 0.0
    for limit in marked.linear_limits:
        assert limit.lower <= float(limit.coefficients @ marked.home) + limit.offset <= limit.upper


def test_limits_that_chance_does_not_meet_are_met_by_a_program(load_text: Load) -> None:
    """A coupled limit of width 1e-6 over two joints, away from zero: no sample of the box would meet it."""
    robot = load_text(touching({}))
    row = np.array([1.0, -1.0])
    narrow = replace(robot, linear_limits=(*robot.linear_limits, LinearLimit("c", row, 0.0, 1.0, 1.0 + 1e-6)))
    Q = draw(narrow, 50, np.random.default_rng(0))
    assert len(Q) == 50
    assert np.all(within_limits(narrow.linear_limits, Q))
    assert np.ptp(Q[:, 0]) > 1.0
    closed = replace(narrow, linear_limits=(*narrow.linear_limits, LinearLimit("d", row, 0.0, 2.0, 3.0)))
    with pytest.raises(pb.UnsupportedError, match="no configuration"):
        draw(closed, 50, np.random.default_rng(0))


def test_a_home_that_the_user_gave_is_kept_and_a_better_one_is_told(load_text: Load) -> None:
    robot = load_text(touching({}), "home: {q1: 0.0}")
    proposal = pb.propose_marks(robot)
    assert proposal.annotations.home == {"q1": 0.0}
    assert not proposal.annotations.boundaries
    assert reason_of(proposal, "base", "b") == ["in contact at home"]
    assert "base.0 and b.0 overlap" in proposal.home_note
    assert "is kept" in proposal.home_note
    assert "Another home is q1 = " in proposal.home_note
    (depth,) = proposal.touching.values()
    assert depth == pytest.approx(-0.1)  # the blocks overlap by their height; before, 0 stood for any depth
    assert "overlap by 100 mm" in proposal.home_note


def test_how_deep_marks_overlap_at_home_is_told(load_text: Load) -> None:
    links = {"base": ball(0.1, "0 0 0.85"), "a": "", "b": ball(0.1, "0 0 0.1")}
    joints = [joint("q1", "revolute", "base", "a", xyz="0 0 0.3"), joint("q2", "revolute", "a", "b", xyz="0 0 0.5")]
    proposal = pb.propose_marks(load_text(urdf(links, joints)))
    assert proposal.touching["base.0", "b.0"] == pytest.approx(0.05 - 0.2)
    assert "overlap by 150 mm" in proposal.home_note


def test_existing_boundaries_stay_free_at_a_new_home(load_text: Load, tmp_path: Path) -> None:
    """No contact lies between the old home and the new one: the stop keeps its side."""
    stop = """
points: [{name: p, link: base, xyz: [0.3, 0, 0.3]}, {name: s, link: a, xyz: [0, 0, 0.3]}]
boundaries: [{name: stop, a: p, b: s}]
"""
    robot = load_text(touching({"q1": "-6 6"}), stop)
    contact = robot.boundaries["stop"].contact
    proposal = pb.propose_marks(robot)
    assert "replaces it" in proposal.home_note
    proposal.annotations.save(tmp_path / "more.yaml")
    marked = pb.load(tmp_path / "robot.urdf", annotations=tmp_path / "more.yaml")
    assert not robot.boundaries.beyond(marked.home)
    assert contact is not None
    assert contact.angle - 2 * np.pi < marked.home[0] < contact.angle


MIXED = urdf(
    {
        "base": ball(0.1) + '<collision name="cover"><geometry><mesh filename="c.stl"/></geometry></collision>',
        "a": "",
        "b": ball(0.1, "0 0 0.5"),
        "c": '<visual><geometry><ellipsoid radii="1 1 1"/></geometry></visual>',
        "d": ball(0.1),
        "e": "",
    },
    [
        joint("q1", "revolute", "base", "a", xyz="0 0 0.3"),
        joint("q2", "revolute", "a", "b", xyz="0 0 0.3"),
        joint("q3", "revolute", "b", "c", xyz="0 0 0.6"),
        joint("fix", "fixed", "c", "d", xyz="0 0 0.3"),
        joint("q4", "revolute", "d", "e"),
    ],
)


def test_every_pair_of_links_is_watched_or_has_its_reason(load_text: Load) -> None:
    for robot in (load_text(MIXED), pb.load("minervabot_v3")):
        proposal = pb.propose_marks(robot)
        marks = proposal.annotations.marks
        watched = {frozenset((marks[one.a].link, marks[one.b].link)) for one in proposal.annotations.boundaries}
        bare = {body.link for body in proposal.uncovered}
        linked = list(dict.fromkeys(body.link for body in collision_bodies(robot)))
        for a, b in itertools.combinations(linked, 2):
            assert reason_of(proposal, a, b) or frozenset((a, b)) in watched, (a, b)
            if {a, b} & bare:
                assert reason_of(proposal, a, b), (a, b)
    proposal = pb.propose_marks(load_text(MIXED))
    assert reason_of(proposal, "base", "b") == ["not covered: cover (mesh)"]
    assert reason_of(proposal, "base", "c") == ["not covered: cover (mesh), c.0 (ellipsoid)"]
    assert reason_of(proposal, "b", "c") == ["neighbours"]
    assert reason_of(proposal, "c", "d") == ["never move against each other"]
    assert proposal.left_out["base", "d", "not covered: cover (mesh)"] == 1
    assert [(body.name, body.shape) for body in proposal.uncovered] == [("cover", "mesh"), ("c.0", "ellipsoid")]


def test_can_never_meet_allows_for_the_contact_tolerance(load_text: Load) -> None:
    """Two marks that pass by at less than the contact tolerance do meet."""
    links = {"base": ball(0.1), "a": "", "b": ball(0.1, "0 0 0.2")}
    joints = [joint("q1", "revolute", "base", "a", axis="0 0 1"), joint("q2", "revolute", "a", "b", xyz="0 0 0.200001")]
    text = urdf(links, joints)
    assert reason_of(pb.propose_marks(load_text(text)), "base", "b") == []
    thin = text.replace('radius="0.1"', 'radius="0"').replace("0.200001", "0.20001")
    never = reason_of(pb.propose_marks(load_text(thin, "contact_tolerance: 1.0e-6")), "base", "b")
    assert never == ["can never meet"]
    meets = pb.propose_marks(load_text(thin, "contact_tolerance: 1.0e-4"))
    assert reason_of(meets, "base", "b") == []


def test_marks_under_names_that_are_taken_get_others(load_text: Load) -> None:
    """`a.0` is link a.0's body 1 under one reading and link a's body 0.1 under another."""
    links = {"a": ball(0.01) + ball(0.01, "0.1 0 0"), "m": "", "a.0": ball(0.01) + ball(0.01, "0.2 0 0")}
    joints = [joint("q1", "revolute", "a", "m", xyz="0 0 1"), joint("q2", "revolute", "m", "a.0", xyz="0 0 1")]
    proposal = pb.propose_marks(load_text(urdf(links, joints)), by="spheres")
    names = [mark.name for cover in proposal.covers for mark in cover.marks]
    assert len(set(names)) == len(names) == 4


@pytest.mark.parametrize("mimic", [False, True])
def test_distances_from_where_links_are_agree_with_paths(load_text: Load, mimic: bool) -> None:
    """Pairs of marks are judged by the placements of their links; the relative path has the same distances."""
    turn = {"mimic": "q1 -0.5 0.2"} if mimic else {}
    joints = [
        joint("q1", "revolute", "base", "a", xyz="0.1 0 0.3", rpy="0.2 0 0.1"),
        joint("q2", "prismatic", "a", "b", xyz="0 0.2 0.1", axis="1 0 0", limit="-1 1"),
        joint("q3", "revolute", "b", "c", xyz="0 0 0.2", axis="0 0 1", **turn),
    ]
    robot = load_text(robot_xml(joints, {}, []))
    rng = np.random.default_rng(3)
    corners = tuple(map(tuple, rng.normal(size=(9, 3)).tolist()))
    marks = [
        pb.Point("point", "base", (0.3, 0.1, 0.2), 0.05),
        pb.Segment("capsule", "base", (0.0, 0.0, 0.0), (0.4, 0.0, 0.1), 0.02),
        pb.Hull("hull", "base", corners, 0.01),
        pb.Box("box", "c", (0.1, 0.0, 0.0), (0.1, 0.2, 0.3), (0.1, 0.2, 0.3)),
        pb.Hull("far", "c", tuple((x + 0.9, y, z) for x, y, z in corners)),
    ]
    Q = rng.uniform(-3, 3, (60, len(robot.coordinates)))
    poses, rows = Poses(robot.tree, robot.coupling, Q), np.arange(5, 60)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("pinbound.coverage.poses._BYTES", 0)
        patch.setattr("pinbound.coverage.poses._FEWEST", 1)
        forgetful = Poses(robot.tree, robot.coupling, Q)  # places each link anew, from what it keeps
    for a, b in itertools.product(marks[:3], marks[3:]):
        expected = separations(relative_path(robot.tree, robot.coupling, a, b), Q[rows])
        assert np.abs(poses.distances(a, b, rows) - expected).max() < 1e-12
        assert np.array_equal(poses.distances(a, b, rows), forgetful.distances(a, b, rows))
        assert np.array_equal(poses.gaps([a], [b]), forgetful.gaps([a], [b]))
    assert len(forgetful._placed) == 1


@pytest.mark.parametrize("apart", ["0.4 0 0", "0 0 0.4", "0 0 0"])
def test_degrees_nearby_are_those_between(load_text: Load, apart: str) -> None:
    """Arms on one floor: beside each other, above each other about one axis, or at one place; and turns that cancel."""
    joints = [joint("fixed", "fixed", "base", "floor", xyz="0 0 0.1")]
    for arm, (xyz, mimic) in enumerate((("0 0 0", ""), (apart, ""), (apart, "a0_q0 1 0"), (apart, "a0_q0 0 0"))):
        more = {"mimic": mimic} if mimic else {}
        joints += [
            joint(f"a{arm}_q0", "revolute", "floor", f"a{arm}_0", xyz=xyz, axis="0 0 1", limit="-1 1", **more),
            joint(f"a{arm}_q1", "revolute", f"a{arm}_0", f"a{arm}_1", axis="0 0 1", xyz="0 0 0.2", limit="-1 1"),
            joint(f"a{arm}_q2", "prismatic", f"a{arm}_1", f"a{arm}_2", axis="1 0 0", xyz="0 0.2 0", limit="0 1"),
            joint(f"a{arm}_f", "fixed", f"a{arm}_2", f"a{arm}_3", xyz="0.1 0 0"),
        ]
    robot = load_text(robot_xml(joints, {}, []))
    near = robot.tree.degrees_nearby(robot.coupling)
    for a, b in itertools.combinations(robot.tree.links, 2):
        degrees = robot.tree.degrees_between(a, b, robot.coupling)
        assert near.get(frozenset((a, b)), degrees if degrees >= 2 else -1) == degrees, (a, b)
    assert 0 in near.values()


def test_a_turn_that_is_seen_to_come_near_enough_is_not_bounded(load_text: Load) -> None:
    """`enough` changes no bound that is above it: contact that is seen at one place of a turn ends the search."""
    robot = load_text(robot_xml([joint("q1", "revolute", "base", "arm", axis="0 0 1", limit="-0.1 0.1")], {}, []))
    edge = pb.Segment("edge", "arm", (0.5, -0.1, 0.0), (0.5, 0.1, 0.0))
    post = pb.Segment("post", "base", (-0.8, -0.1, 0.0), (-0.8, 0.1, 0.0))
    path = relative_path(robot.tree, robot.coupling, edge, post)
    exact = least_separation(path)
    assert exact == pytest.approx(0.8 - np.hypot(0.5, 0.1), abs=1e-6)
    assert least_separation(path, 0.9 * exact) == exact
    assert least_separation(path, exact + 0.01) == -np.inf
