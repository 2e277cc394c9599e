"""Pairs that an SRDF disables: each verdict has a proof or a witness that somebody else confirms."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import pinbound as pb
from pinbound.cli.app import app
from pinbound.coverage.bodies import collision_bodies
from pinbound.coverage.covers import covers
from pinbound.crosscheck.engine import Engine, body_shapes
from pinbound.marking import DisabledPair, disabled_pairs, find_srdf
from robots import joint
from test_marking import ball, block, urdf

Load = Callable[..., pb.Robot]

LINKS = {
    "base": ball(0.05),
    "a": ball(0.05),
    "b": ball(0.04, "0 0 0.2"),
    "c": ball(0.03, "0 0 0.25"),
    "tip": ball(0.01, "0 0 0.36"),
    "bare": "",
}
JOINTS = [
    joint("q1", "revolute", "base", "a", axis="0 0 1", xyz="0 0 0.3", limit="-2.5 2.5"),
    joint("q2", "revolute", "a", "b", axis="0 1 0", limit="-2.5 2.5"),
    joint("q3", "revolute", "b", "c", axis="0 1 0", xyz="0 0 0.4", limit="-3.1 3.1"),
    joint("fix", "fixed", "c", "tip"),
    joint("q4", "revolute", "c", "bare"),
]
SRDF = """<robot name="r">
  <disable_collisions link1="base" link2="a" reason="Adjacent"/>
  <disable_collisions link1="base" link2="b" reason="Never"/>
  <disable_collisions link1="base" link2="c" reason="Never"/>
  <disable_collisions link1="tip" link2="a" reason="Never"/>
  <disable_collisions link1="c" link2="tip" reason="Default"/>
  <disable_collisions link1="a" link2="bare" reason="Never"/>
  <disable_collisions link1="a" link2="elbow" reason="Never"/>
</robot>"""


def judged(robot: pb.Robot, path: Path) -> dict[frozenset[str], DisabledPair]:
    found = disabled_pairs(robot, pb.propose_marks(robot).covers, path)
    return {frozenset(one.links): one for one in found}


def test_every_disabled_pair_has_its_verdict(load_text: Load, tmp_path: Path) -> None:
    robot, path = load_text(urdf(LINKS, JOINTS)), tmp_path / "other.srdf"
    path.write_text(SRDF)
    found = judged(robot, path)
    of = {tuple(sorted(links)): (one.verdict, one.basis) for links, one in found.items()}
    assert of["b", "base"] == of["a", "base"] == ("can never meet", "proof")
    assert of["base", "c"] == of["a", "tip"] == ("can touch", "witness")
    assert of["c", "tip"] == ("never move against each other", "proof")
    assert of["a", "bare"] == ("bare has no body", "proof")
    assert of["a", "elbow"] == ("'elbow' is not a link", "granted")
    assert found[frozenset(("base", "c"))].line == 4
    bodies = collision_bodies(robot)
    shapes = body_shapes(bodies)
    for links, one in found.items():
        if one.q is not None:  # coal, placed by Pinocchio, sees the contact too, within the limits
            pair = [(i, j) for i in range(5) for j in range(i) if {bodies[i].link, bodies[j].link} == set(links)]
            assert Engine(robot, shapes, pair).distances(one.q[None]).min() < 0.0
            assert robot.intervals.hold(one.q[None])[0]


def test_a_contact_that_few_samples_see_is_found_by_the_search(load_text: Load, tmp_path: Path) -> None:
    """Two small spheres meet in a thousandth of the configurations: no sample of 500 need see them."""
    links = {"base": ball(0.012, "0.3 0.3 0.42"), "a": "", "b": "", "c": ball(0.012, "0 0 0.3")}
    joints = [text.replace('"tip"', '"x"') for text in JOINTS[:3]]
    robot, path = load_text(urdf(links, joints)), tmp_path / "r.srdf"
    path.write_text('<robot name="r"><disable_collisions link1="c" link2="base" reason="Never"/></robot>')
    (one,) = judged(robot, path).values()
    assert one.verdict == "can touch"
    assert one.q is not None
    gap = np.linalg.norm(robot.positions("c", one.q, (0, 0, 0.3)) - robot.positions("base", one.q, (0.3, 0.3, 0.42)))
    assert gap <= 0.024


def test_covers_that_stick_out_are_no_bodies(load_text: Load, tmp_path: Path) -> None:
    """Prisms about two cylinders meet corner to corner; the cylinders pass by."""
    rod = '<collision><geometry><cylinder radius="0.1" length="0.2"/></geometry></collision>'
    joints = [
        joint("q1", "revolute", "base", "a", axis="0 0 1", xyz="0.2005 0 0", limit="-0.01 0.01"),
        joint("q2", "revolute", "a", "b", axis="1 0 0", limit="-0.01 0.01"),
    ]
    robot, path = load_text(urdf({"base": rod, "a": "", "b": rod}, joints)), tmp_path / "r.srdf"
    path.write_text('<robot name="r"><disable_collisions link1="base" link2="b" reason="Never"/></robot>')
    marks = covers(collision_bodies(robot), 0.02)
    assert all(0.0 < one.excess < 0.02 for one in marks)
    (one,) = disabled_pairs(robot, marks, path)
    assert one.verdict == "their marks can touch; no contact of their bodies was found"
    assert one.basis == "samples"
    (asked,) = disabled_pairs(robot, marks, path, touches=lambda links, Q: len(Q) - 1)
    assert asked.verdict == "can touch"
    assert asked.q is not None
    (thin,) = disabled_pairs(robot, covers(collision_bodies(robot), 1e-9), path)
    assert (thin.verdict, thin.basis, thin.q) == ("no contact found", "samples", None)  # flat sides face each other


def test_the_srdf_beside_the_robot_is_found_by_its_name(load_text: Load, tmp_path: Path) -> None:
    robot = load_text(urdf(LINKS, JOINTS))
    assert find_srdf(robot) == ()
    (tmp_path / "stranger.srdf").write_text(SRDF.replace('name="r"', 'name="another"'))
    (tmp_path / "broken.srdf").write_text("<robot name='r'")
    assert find_srdf(robot) == ()
    for name in ("first", "second"):
        (tmp_path / f"{name}.srdf").write_text(SRDF)
    assert [path.name for path in find_srdf(robot)] == ["first.srdf", "second.srdf"]
    (tmp_path / "robot.srdf").write_text(SRDF)
    assert [path.name for path in find_srdf(robot)] == ["robot.srdf"]


def test_the_command_says_which_disabled_pairs_touch_and_watches_them(load_text: Load, tmp_path: Path) -> None:
    load_text(urdf(LINKS, JOINTS))
    (tmp_path / "robot.srdf").write_text(SRDF)
    ran = CliRunner().invoke(app, ["mark", str(tmp_path / "robot.urdf"), "--out", str(tmp_path / "marks.yaml")])
    assert ran.exit_code == 0, ran.output
    assert "robot.srdf disables" in ran.output
    assert "base - c: at q1=" in ran.output
    marked = pb.load(tmp_path / "robot.urdf", annotations=tmp_path / "marks.yaml")
    pairs = {frozenset(pair.links): pair.status.value for pair in marked.coverage.pairs}
    assert pairs[frozenset(("base", "c"))] == "watched"
    none = CliRunner().invoke(app, ["mark", str(tmp_path / "robot.urdf"), "--srdf", str(tmp_path / "none.srdf")])
    assert none.exit_code == 2


GROUPS_ONLY = '<robot name="r"><group name="arm"><chain base_link="base" tip_link="c"/></group></robot>'
BY_DEFAULT = '<robot name="r"><disable_default_collisions link="c"/><enable_collisions link1="c" link2="a"/></robot>'


def test_an_srdf_that_disables_nothing_is_no_fault_and_is_told(load_text: Load, tmp_path: Path) -> None:
    load_text(urdf(LINKS, JOINTS))
    (tmp_path / "robot.srdf").write_text(GROUPS_ONLY)
    urdf_file = str(tmp_path / "robot.urdf")
    for given in ([], ["--srdf", str(tmp_path / "robot.srdf")]):
        ran = CliRunner().invoke(app, ["mark", urdf_file, *given])
        assert ran.exit_code == 0, ran.output
        assert "robot.srdf disables no pair of links." in ran.output
    as_json = CliRunner().invoke(app, ["mark", urdf_file, "--json"])
    assert json.loads(as_json.output)["srdf"] == "robot.srdf disables no pair of links."


def test_pairs_that_a_link_disables_by_default_are_examined(load_text: Load, tmp_path: Path) -> None:
    robot, path = load_text(urdf(LINKS, JOINTS)), tmp_path / "other.srdf"
    path.write_text(BY_DEFAULT)
    found = {frozenset(one.links): one for one in disabled_pairs(robot, covers(collision_bodies(robot), 0.02), path)}
    assert frozenset(("base", "c")) in found
    assert frozenset(("a", "c")) not in found
    assert all("c" in one.links and one.reason == "disable_default_collisions" for one in found.values())


@pytest.mark.parametrize("asked", [False, True])
def test_neighbours_are_watched_if_they_are_asked_for(load_text: Load, asked: bool) -> None:
    """The link of a hinge meets its parent before the joint limit: the boundary says where."""
    links = {"base": block("0.1 0.1 0.4"), "a": block("0.05 0.05 0.3", "0 0 0.25")}
    robot = load_text(urdf(links, [joint("q1", "revolute", "base", "a", xyz="0 0 0.35", limit="-3 3")]))
    proposal = pb.propose_marks(robot, neighbours=asked)
    assert len(proposal.annotations.boundaries) == asked
    assert ("base", "a", "neighbours") in proposal.left_out or asked
    marked = robot.with_annotations(proposal.annotations)
    (pair,) = marked.coverage.pairs
    assert pair.status.value == ("watched" if asked else "left out")
    if asked:
        stop = marked.boundaries.limits("q1", marked.home)
        assert 1.5 < stop.upper < 3.0
        engine = Engine(robot, body_shapes(collision_bodies(robot)), [(0, 1)])
        below, above = (engine.distance(np.array([stop.upper + off]), 0) for off in (-1e-3, 1e-3))
        assert below > 0.0 > above - 1e-9
