"""What the report says of boundaries and edges, by the region's own edges."""

import json
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from typer.testing import CliRunner

import pinbound as pb
from pinbound.cli import app
from pinbound.figures.report import _exactness, _formulas, boundary_rows, write_report
from robots import joint, robot_xml

Load = Callable[..., pb.Robot]

ARM = [
    joint("q1", "revolute", "base", "a", axis="0 0 1", limit="-2 2"),
    joint("q2", "revolute", "a", "b", axis="0 0 1", xyz="1 0 0", limit="-2 2"),
    joint("q3", "revolute", "base", "c", axis="1 0 0"),
]
MARKS = (
    '<pinbound:point name="tip" link="b" xyz="0.5 0 0"/>'
    '<pinbound:point name="near" link="base" xyz="0.4 1.1 0" radius="0.2"/>'  # an island
    '<pinbound:point name="far" link="base" xyz="-1.2 0 0" radius="0.05"/>'  # behind what q2 reaches from home
    '<pinbound:point name="out" link="base" xyz="3 0 0" radius="0.1"/>'  # never reached
    '<pinbound:point name="high" link="c" xyz="0 0 1"/>'  # does not move with the plane
    '<pinbound:point name="low" link="base" xyz="0 0 -1"/>'
)


def pair(a: str, b: str) -> str:
    return f'<pinbound:boundary name="{a}_{b}" a="{a}" b="{b}"/>'


def arm(load_text: Load) -> pb.Robot:
    pairs = [("tip", "near"), ("tip", "far"), ("tip", "out"), ("high", "low")]
    return load_text(robot_xml(ARM, {}, [], MARKS + "".join(pair(*names) for names in pairs)))


def test_only_edges_are_called_edges(load_text: Load) -> None:
    robot = arm(load_text)
    region = pb.feasible_region(robot, ("q1", "q2"))
    edges = {edge.source for edge in region.edges if edge.is_contact}
    rows = {row.boundary.name: row for row in boundary_rows(robot, region)}
    assert {name for name, row in rows.items() if row.status == "active"} == edges == {"tip_near"}
    assert rows["tip_near"].where == "an edge"
    assert rows["tip_out"].where == "no contact here"
    assert rows["high_low"].status == "constant"
    assert rows["tip_far"].status in ("not an edge", "no contact here")
    assert all("edge" not in row.where for row in boundary_rows(robot, None))


def test_a_contact_curve_elsewhere_is_not_an_edge_and_has_its_distance(load_text: Load) -> None:
    """A wall of q1 alone keeps the region away from the island behind it."""
    marks = '<pinbound:point name="tip" link="b" xyz="0.5 0 0"/><pinbound:point name="knee" link="a" xyz="1 0 0"/>'
    marks += '<pinbound:point name="stop" link="base" xyz="0 1 0" radius="0.3"/>'
    marks += '<pinbound:point name="post" link="base" xyz="-0.59 1.29 0" radius="0.1"/>'
    robot = load_text(robot_xml(ARM[:2], {}, [], marks + pair("knee", "stop") + pair("tip", "post")))
    region = pb.feasible_region(robot)
    rows = {row.boundary.name: row for row in boundary_rows(robot, region)}
    assert {edge.source for edge in region.edges if edge.is_contact} == {"knee_stop"}
    assert rows["knee_stop"].where == "an edge"
    assert rows["tip_post"].status == "not an edge"
    assert rows["tip_post"].by == ()
    assert rows["tip_post"].slack > 0.0
    assert rows["tip_post"].where.endswith("° away")


def test_the_page_counts_edges(load_text: Load, tmp_path: Path) -> None:
    robot = arm(load_text)
    by_hand = robot.boundaries.names
    page, rows = write_report(robot, tmp_path / "out")
    assert len(rows) == len(by_hand)
    edges = {row.boundary.name for row in rows if row.status == "active"}
    assert f"<b>{len(edges)} of 4</b>" in page.read_text(encoding="utf-8")


def test_a_robot_of_more_than_two_coordinates_has_a_region_too(load_text: Load, tmp_path: Path) -> None:
    """The page said that a planar region needs two coordinates, with an argument of Python as the remedy."""
    robot = arm(load_text)  # q1, q2 and q3
    page, _ = write_report(robot, tmp_path / "most")
    used = {name: sum(name in one.coordinates for one in robot.boundaries) for name in robot.coordinates}
    two = sorted(sorted(robot.coordinates, key=lambda name: -used[name])[:2])
    text = page.read_text(encoding="utf-8")
    assert f"slice of ({', '.join(two)}) that the robot can reach from home, with the other coordinates at home" in text
    assert f"{pb.feasible_region(robot, two).area:.10f}" in text
    page, _ = write_report(robot, tmp_path / "asked", coordinates=("q1", "q3"))
    assert "slice of (q1, q3)" in page.read_text(encoding="utf-8")
    with pytest.raises(pb.UnknownNameError):
        write_report(robot, tmp_path / "none", coordinates=("q1", "q9"))


def test_points_have_no_surface_to_show(tmp_path: Path) -> None:
    """Two of three panels were empty: points of radius 0 have no surface whose distance could have a colour."""
    page, _ = write_report(pb.load("minervabot_v3"), tmp_path)
    assert not list(tmp_path.glob("cover_*.png"))
    text = page.read_text(encoding="utf-8")
    assert "link_1: 4 boxes; 2 marks; 0 of 4 bodies proven to be held; its marks are points without a surface" in text
    assert "furthest place" not in text


def test_a_volume_of_three_coordinates_is_drawn_with_its_proven_interval(load_text: Load, tmp_path: Path) -> None:
    robot = arm(load_text)
    page, _ = write_report(robot, tmp_path / "three")
    text = page.read_text(encoding="utf-8")
    volume = pb.free_volume(robot, ("q1", "q2", "q3"), decided=0.97)
    assert (tmp_path / "three" / "free.png").stat().st_size > 10_000
    assert "of the box of limits of q1, q2, q3 is free, proven" in text
    found = re.search(r"At least ([0-9.]+) % and at most\s+([0-9.]+) %", text)
    assert found is not None
    assert 100 * volume.lower / volume.volume - 3.0 < float(found[1]) <= 100 * volume.upper / volume.volume
    assert float(found[2]) - float(found[1]) < 3.0
    page, _ = write_report(robot, tmp_path / "two", free=("q2", "q1"))
    assert "of the box of limits of q2, q1 is free" in page.read_text(encoding="utf-8")
    with pytest.raises(pb.UnknownNameError):
        write_report(robot, tmp_path / "none", free=("q2", "q9"))
    plain = load_text(
        robot_xml(ARM[:2], {}, [], MARKS[: MARKS.index('<pinbound:point name="high"')] + pair("tip", "near"))
    )
    page, _ = write_report(plain, tmp_path / "plane")
    assert 'id="free"' not in page.read_text(encoding="utf-8")  # two coordinates: the region says it


def saddle(folder: Path) -> Path:
    """The outstretched tip is exactly on the post's rim at q = 0."""
    marks = '<pinbound:home q1="1.5" q2="0.3"/><pinbound:point name="tip" link="b" xyz="0.5 0 0"/>'
    marks += '<pinbound:point name="post" link="base" xyz="0.75 0 0" radius="0.75"/>' + pair("tip", "post")
    path = folder / "saddle.urdf"
    path.write_text(robot_xml(ARM[:2], {}, [], marks))
    return path


def test_what_is_undecided_is_printed_everywhere(tmp_path: Path) -> None:
    path = saddle(tmp_path)
    region = pb.feasible_region(pb.load(path))
    assert region.joined_area > 1.5 * region.area
    said = CliRunner().invoke(app, ["region", str(path)])
    assert said.exit_code == 0
    assert "UNDECIDED" in said.stdout
    assert f"joined, {region.joined_area:.6g}" in said.stdout
    record = json.loads(CliRunner().invoke(app, ["region", str(path), "--json"]).stdout)
    assert record["joined_area"] == pytest.approx(region.joined_area)
    assert record["units"] == ["rad", "rad"]
    (place,) = record["unresolved"]
    assert place["name"] == "tip_post"
    assert place["joins"] is True
    assert place["point"] == pytest.approx([0.0, 0.0], abs=1e-6)
    page, _ = write_report(pb.load(path), tmp_path / "out")
    text = page.read_text(encoding="utf-8")
    assert "UNDECIDED" in text
    assert "<b>1 of 1</b>" in text
    is_a_sound_page(text)
    assert "Straight edges are exact. Curved edges are within 0.000573 deg of the contact." in text
    assert "grey dashed lines" not in text
    assert "<summary>tip_post</summary>" in text
    assert len(text) < 100_000


def is_a_sound_page(text: str) -> None:
    """Links lead somewhere, and tables scroll on a narrow screen."""
    targets = re.findall(r'href="#([\w-]+)"', text)
    assert {"region", "boundaries", "formulas", "workspace", "robot", "guarantees"} <= set(targets)
    assert [target for target in targets if f'id="{target}"' not in text] == []
    assert text.count('<div class="scroll"><table') == text.count("<table")


def test_the_window_of_the_command_line(tmp_path: Path) -> None:
    path = tmp_path / "free.urdf"
    path.write_text(robot_xml([joint("q1", "continuous", "base", "a"), joint("s", "prismatic", "a", "b")], {}, []))
    refused = CliRunner().invoke(app, ["region", str(path)])
    assert refused.exit_code == 2
    assert "--window q1=LOWER..UPPER" in refused.stderr
    for deg, window, width in ((), "q1=-1..1", 2.0), (("--deg",), "q1=-90..90,s=0..0.5", 3.14159265358979):
        said = CliRunner().invoke(app, ["region", str(path), "--window", window, "--json", *deg])
        ends = [vertex[0] for vertex in json.loads(said.stdout)["vertices"]]
        assert max(ends) - min(ends) == pytest.approx(width)
    for wrong in ("q1=1..-1", "q9=0..1", "q1=0", "q1=a..b", "q1"):
        said = CliRunner().invoke(app, ["region", str(path), "--window", wrong])
        assert said.exit_code == 2
        assert "NAME=LOWER..UPPER" in said.stderr


def test_a_convex_region_is_called_exact() -> None:
    assert _exactness(pb.feasible_region(pb.load("minervabot_v3"))) == "All edges are straight and exact."


def test_long_formulas_are_left_to_derive(load_text: Load) -> None:
    """78 pairs of the Panda took 5.4 MB."""
    links = ("base", "l1", "l2", "l3", "l4", "l5")
    axes = ("0 0 1", "0 1 0", "1 0 0", "0 1 0", "0 0 1")
    joints = [
        joint(f"q{k}", "revolute", links[k], links[k + 1], axis=axis, xyz="0.1 0.2 0.3", limit="-1 1")
        for k, axis in enumerate(axes)
    ]
    marks = '<pinbound:point name="foot" link="base" xyz="0 0 0"/>'
    marks += "".join(f'<pinbound:point name="p{k}" link="l{k}" xyz="0.3 0 0" radius="0.01"/>' for k in (2, 5))
    robot = load_text(robot_xml(joints, {}, [], marks + pair("foot", "p2") + pair("foot", "p5")))
    assert list(_formulas(robot, set())) == ["foot_p2"]
