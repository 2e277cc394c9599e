"""Bad input: every fault is reported at once, with its line, what is valid, and the remedy; never a traceback."""

import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import pinbound as pb
from pinbound.cli import app

Load = Callable[..., pb.Robot]

GOOD = """<robot name="arm" xmlns:pinbound="urn:pinbound:1">
  <link name="base"/>
  <link name="arm"><visual><geometry><box size="1 1 1"/></geometry></visual></link>
  <link name="rod"><visual><geometry><box size="1 1 1"/></geometry></visual></link>
  <joint name="q1" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
  <joint name="q1_rod" type="revolute"><parent link="arm"/><child link="rod"/><origin xyz="0 0 1"/><axis xyz="0 1 0"/>
    <limit lower="-4" upper="4" effort="1" velocity="1"/><mimic joint="q1" multiplier="-1"/></joint>
  <pinbound:annotations>
    <pinbound:home q1="0"/>
    <pinbound:point name="p" link="base" xyz="1 0 0"/>
    <pinbound:point name="s" link="arm" xyz="0 0 1"/>
    <pinbound:boundary name="stop" a="p" b="s"/>
    <pinbound:closure name="loop" link_a="rod" xyz_a="0 0 0" link_b="arm" xyz_b="0 0 1"/>
  </pinbound:annotations>
</robot>
"""

FAULTS = {
    "missing link": ('link="base" xyz="1 0 0"', 'link="bsae" xyz="1 0 0"', 11, "'bsae'.*Did you mean 'base'"),
    "duplicated boundary": (
        '    <pinbound:closure name="loop"',
        '    <pinbound:boundary name="stop" a="s" b="p"/>\n    <pinbound:closure name="loop"',
        14,
        "'stop' is declared twice .first on line 13.",
    ),
    "NaN coordinates": ('xyz="1 0 0"', 'xyz="1 nan 0"', 11, "not finite"),
    "words for numbers": ('xyz="1 0 0"', 'xyz="1 zero 0"', 11, "is not 3 numbers"),
    "other scripts' digits": ('xyz="1 0 0"', 'xyz="1 0 ٣"', 11, "is not 3 numbers"),
    "two numbers": ('xyz="1 0 0"', 'xyz="1 0"', 11, "holds 2 numbers"),
    "a closure that does not close": ('xyz_b="0 0 1"', 'xyz_b="0 0.002 1"', 14, "does not close.*2 mm"),
    "home outside the region": ('q1="0"', 'q1="1.5707963267948966"', 10, "outside the feasible region.*'stop'"),
    "home outside the limits": ('q1="0"', 'q1="2.5"', 10, "outside the limits of 'q1'"),
    "home of a follower": ('q1="0"', 'q1="0" q1_rod="0"', 10, "follows another joint.*Valid: q1"),
    "unknown attribute": ('b="s"/>', 'b="s" min_distanse="0.1"/>', 13, "Did you mean 'min_distance'"),
    "unknown element": ("<pinbound:home q1", "<pinbound:hmoe q1", 10, "is no annotation.*Did you mean 'home'"),
    "negative distance": ('b="s"/>', 'b="s" min_distance="-1"/>', 13, "is negative"),
    "one link twice": ('link="arm" xyz="0 0 1"', 'link="base" xyz="0 0 1"', 13, "distance never changes"),
    "point not marked": ('a="p" b="s"', 'a="p" b="x"', 13, "'x', which is not marked"),
    "annotation outside its block": (
        '<link name="base"/>',
        '<link name="base"><pinbound:point name="z"/></link>',
        2,
        "stands outside",
    ),
    "no name": ('<pinbound:point name="p"', "<pinbound:point", 11, "has no name"),
    "text in an element": ('xyz="1 0 0"/>', 'xyz="1 0 0">x</pinbound:point>', 11, "Use attributes"),
    "joint type": ('type="revolute"><parent link="base"', 'type="hinge"><parent link="base"', 5, "Valid types"),
    "no limit": ('<limit lower="-2" upper="2" effort="1" velocity="1"/>', "", 5, "has no <limit>"),
    "lower above upper": ('lower="-2" upper="2"', 'lower="2" upper="-2"', 6, "above upper"),
    "zero axis": ('<child link="arm"/><axis xyz="0 1 0"/>', '<child link="arm"/><axis xyz="0 0 0"/>', 5, "zero axis"),
    "NaN axis": ('<child link="arm"/><axis xyz="0 1 0"/>', '<child link="arm"/><axis xyz="0 nan 0"/>', 5, "not finite"),
    "follower of nothing": ('<mimic joint="q1"', '<mimic joint="q7"', 7, "'q7', which is no joint"),
    "follower of itself": ('<mimic joint="q1"', '<mimic joint="q1_rod"', 7, "follows itself"),
    "two parents": ('<child link="rod"/>', '<child link="arm"/>', 7, "child of two joints"),
    "link twice": ('<link name="rod">', '<link name="arm">', 4, "declared twice"),
    "missing parent": ('<parent link="arm"/>', '<parent link="amr"/>', 7, "'amr', which is not a link"),
}


def swap(old: str, new: str, text: str = GOOD) -> str:
    assert old in text, "the test's own replacement must apply"
    return text.replace(old, new, 1)


def test_the_good_robot_loads(load_text: Load) -> None:
    robot = load_text(GOOD)
    assert robot.boundaries["stop"].contact is not None
    assert robot.closure_residuals([0.3]).max() < 1e-15


@pytest.mark.parametrize("fault", FAULTS)
def test_one_fault_gives_one_message_with_its_line(load_text: Load, fault: str) -> None:
    old, new, line, message = FAULTS[fault]
    with pytest.raises(pb.InputError) as caught:
        load_text(swap(old, new))
    problem = next((p for p in caught.value.problems if p.line == line), None)
    assert problem is not None, str(caught.value)
    assert re.search(message, str(problem)), str(problem)
    assert problem.remedy


def test_all_faults_of_a_file_are_reported_at_once(load_text: Load) -> None:
    text = GOOD
    for fault in ("missing link", "unknown attribute", "a closure that does not close", "duplicated boundary"):
        old, new, _, _ = FAULTS[fault]
        text = swap(old, new, text)
    text = swap('q1="0"', 'q1="2.5"', text)
    with pytest.raises(pb.InputError) as caught:
        load_text(text)
    said = str(caught.value)
    for part in ("bsae", "min_distanse", "does not close", "declared twice", "outside the limits"):
        assert part in said
    assert [p.line for p in caught.value.problems] == sorted(p.line or 0 for p in caught.value.problems)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("this is no XML", "not well-formed"),
        ("", "not well-formed"),
        ("<robot name='r'><link name='a'></robot>", "not well-formed"),
        ("<robot name='r'/>", "no links"),
        ("<mujoco/>", "starts with <robot>"),
        ('<!DOCTYPE r [<!ENTITY a "b">]><robot name="&a;"><link name="a"/></robot>', "DOCTYPE"),
        ('<!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/passwd">]><robot name="&x;"/>', "DOCTYPE"),
        ('<robot name="r" xmlns:pinbound="urn:pinbound:9"><pinbound:annotations/></robot>', "urn:pinbound:1"),
        ("<robot name='r'><link name='a'/><link name='b'/></robot>", "one root link"),
        ('<robot name="r"><pinbound:annotations/></robot>', "not well-formed"),
    ],
)
def test_files_that_are_no_robot(load_text: Load, text: str, message: str) -> None:
    with pytest.raises(pb.InputError, match=message):
        load_text(text)


def test_an_entity_bomb_is_refused_without_being_expanded(load_text: Load) -> None:
    entities = "".join(f'<!ENTITY a{i} "{f"&a{i - 1};" * 10}">' for i in range(1, 12))
    bomb = f'<!DOCTYPE r [<!ENTITY a0 "boom">{entities}]><robot name="&a11;"><link name="a"/></robot>'
    with pytest.raises(pb.InputError, match="DOCTYPE"):
        load_text(bomb)


def test_a_xacro_with_a_doctype_is_refused_before_xacro_sees_it(tmp_path: Path) -> None:
    path = tmp_path / "bomb.urdf.xacro"
    path.write_text('<!DOCTYPE r [<!ENTITY a "b">]><robot name="&a;"><link name="a"/></robot>')
    with pytest.raises(pb.InputError, match="DOCTYPE"):
        pb.load(path)


@pytest.mark.parametrize(
    ("args", "message"),
    [({"pivot": "1"}, "Did you mean"), ({"bridge": "steep"}, "bridge"), ({"pivot_x": "nan"}, "not finite|pivot")],
)
def test_wrong_xacro_arguments(args: dict[str, str], message: str) -> None:
    with pytest.raises(pb.InputError, match=message):
        pb.load("minervabot_v3", xacro_args=args)


def test_a_path_that_is_not_there_names_the_packaged_robots() -> None:
    with pytest.raises(pb.InputError, match="minervabot_v3"):
        pb.load("no/such/robot.urdf")


def test_a_default_namespace_is_dropped_and_noted(load_text: Load) -> None:
    robot = load_text(GOOD.replace("<robot ", '<robot xmlns="http://www.ros.org" '))
    assert robot.coordinates == ("q1",)
    assert "default namespace" in robot.notes[0]
    assert robot.model.nq == 2


SIDECAR = """contact_tolerance: 2.0e-5
home: {q1: 0.0}
points:
  - {name: p, link: base, xyz: [1, 0, 0]}
  - {name: s, link: arm, xyz: [0, 0, 1], radius: 0.0}
boundaries: [{name: stop, a: p, b: s, min_distance: 0.0}]
closures: [{name: loop, link_a: rod, xyz_a: [0, 0, 0], link_b: arm, xyz_b: [0, 0, 1]}]
assumptions: [the rod is rigid]
"""
BARE = re.sub(r"  <pinbound:annotations>.*</pinbound:annotations>\n", "", GOOD, flags=re.DOTALL)


def test_a_sidecar_says_the_same_as_inline_annotations(load_text: Load) -> None:
    inline, sidecar = load_text(GOOD), load_text(BARE, SIDECAR)
    assert sidecar.boundaries.norms([0.4]) == inline.boundaries.norms([0.4])
    assert sidecar.annotations.assumptions == ("the rod is rigid",)
    assert [c.name for c in sidecar.closures] == ["loop"]


@pytest.mark.parametrize(
    ("old", "new", "line", "message"),
    [
        ("link: base", "link: bsae", 4, "Did you mean 'base'"),
        ("min_distance", "mindistance", 6, "Did you mean 'min_distance'"),
        ("points:", "poinst:", 4, "Did you mean 'points'"),
        ("[1, 0, 0]", "[1, .nan, 0]", 4, "is not 3 numbers|not finite"),
        ("{q1: 0.0}", "{q1: 0.0, q1: 1.0}", 2, "given twice"),
        ("{q1: 0.0}", "[0.0]", 2, "not a mapping"),
        ("home: {q1: 0.0}", "home: {q1: 0.0", 3, "not YAML"),
        ("xyz: [0, 0, 1], radius", "xyz: [0, 0], radius", 5, "holds 2 numbers"),
    ],
)
def test_faults_of_a_sidecar_carry_its_lines(load_text: Load, old: str, new: str, line: int, message: str) -> None:
    with pytest.raises(pb.InputError) as caught:
        load_text(BARE, swap(old, new, SIDECAR))
    problem = next(p for p in caught.value.problems if p.source == "robot.pinbound.yaml" and p.line == line)
    assert re.search(message, str(problem))


def test_yaml_aliases_are_refused(load_text: Load) -> None:
    with pytest.raises(pb.InputError, match="alias"):
        load_text(BARE, "home: &h {q1: 0}\nassumptions: [*h]\n")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("limits:\n- {joint: q1, lower: !degrees -90, upper: 1}", "line 2.*'!degrees'.*radians"),
        ("home: !!python/tuple [1]", "python/tuple"),
        ("points: " + "[" * 20_000, "nests deeper"),
        ("- " * 20_000, "nests deeper"),
        ("\n".join(" " * depth + "a:" for depth in range(60)), "line 33: nests deeper"),
        ("home:\n  <<: {q1: 1}", "merge"),
    ],
)
def test_tags_and_deep_nesting_of_yaml_are_faults(load_text: Load, text: str, message: str) -> None:
    with pytest.raises(pb.InputError, match=message):
        load_text(BARE, text)


MARKS = """
points:
  - {name: p, link: base, xyz: [0, 0, 0.5], radius: 0.3}
  - {name: s, link: arm, xyz: [0, 0, 0.5], radius: 0.3}
"""
LATER = {
    "contact at home": (MARKS + "boundaries:\n  - {name: stop, a: p, b: s}\n", 6, "outside the feasible region"),
    "a loop that does not close": (
        "closures:\n\n  - {name: loop, link_a: rod, xyz_a: [0, 0, 0], link_b: arm, xyz_b: [0, 0.1, 1]}\n",
        3,
        "does not close",
    ),
    "home outside a limit": ("\n\nhome: {q1: 2.5}\n", 3, "outside the limits of 'q1'"),
    "home of no joint": ("\nhome:\n  q7: 2.5\n", 3, "'q7', which does not exist"),
    "a rule that nothing keeps": (
        "rules:\n  - {name: r, lower: 1, upper: 2, coefficients: {q1: 1}}\n"
        "  - {name: s, lower: -2, upper: -1, coefficients: {q1: 1}}\n",
        2,
        "no configuration keeps all joint limits: at zero 'r' is 0",
    ),
    "limits that a mimic joint cannot keep": (
        "followers: [{joint: q1_rod, primary: q1}]\nlimits: [\n  {joint: q1_rod, lower: 3, upper: 4}]\n",
        3,
        "no configuration keeps all joint limits: at zero 'q1_rod' is 0",
    ),
    "axes that determine nothing": (
        "axes:\n  - {name: s, instead_of: q1, coefficients: {q1: 1, q1_rod: 1}}\n",
        2,
        "axes s do not determine the joints",
    ),
    "a mark beyond all lengths": ("points:\n\n  - {name: p, link: base, xyz: [1e80, 0, 0]}\n", 3, "'p' is 1e\\+80 m"),
    "a mapping for a name": ("points:\n  - {name: {p: 1}, link: base, xyz: [1, 0, 0]}\n", 2, "holds a mapping"),
    "a mapping for a vector": ("points:\n  - {name: p, link: base, xyz: {x: 1}}\n", 2, "holds a mapping"),
    "a list in a vector": ("points:\n  - {name: p, link: base, xyz: [[1, 0], 0]}\n", 2, "holds a list"),
    "rows of other lengths": (
        "hulls:\n  - {name: h, link: arm, vertices: [[0, 0, 0, 1],\n    [1, 0]]}\n",
        2,
        "a vector has 4 numbers",
    ),
    "an assumption that is a mapping": ("assumptions:\n  - {a: b}\n", 2, "holds a mapping"),
    "a mimic of nothing": ("\n\n\nfollowers: [{joint: q1, primary: q1}]\n", 4, "follows itself"),
}


@pytest.mark.parametrize("fault", LATER)
def test_what_is_found_late_names_the_file_that_said_it(load_text: Load, fault: str) -> None:
    text, line, message = LATER[fault]
    with pytest.raises(pb.InputError) as caught:
        load_text(BARE, text)
    problem = next(problem for problem in caught.value.problems if re.search(message, problem.message))
    assert (problem.source, problem.line) == ("robot.pinbound.yaml", line)


def test_annotations_may_be_given_more_than_once(tmp_path: Path) -> None:
    robot, marks, more = (tmp_path / name for name in ("arm.urdf", "marks.yaml", "more.yaml"))
    robot.write_text(BARE)
    marks.write_text("contact_tolerance: 2.0e-5\npoints:\n  - {name: p, link: base, xyz: [1, 0, 0]}\n")
    more.write_text("contact_tolerance: 2.0e-5\npoints:\n  - {name: s, link: arm, xyz: [0, 0, 1]}\n")
    last = pb.Annotations(boundaries=(pb.BoundaryMark("stop", "p", "s"),), home={"q1": 0.25})
    found = pb.load(robot, annotations=[marks, str(more), last])
    assert found.boundaries.names == ("stop",)
    assert found.home.tolist() == [0.25]
    done = subprocess.run(
        [sys.executable, "-m", "pinbound", "info", robot, "--annotations", marks, "--annotations", more],
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    )
    assert re.search(r"(?s)Marked points.*p .*base.*s .*arm", done.stdout)
    more.write_text(more.read_text().replace("2.0e-5", "3.0e-5"))
    with pytest.raises(pb.InputError, match="contact_tolerance is given twice"):
        pb.load(robot, annotations=(marks, more))
    assert pb.load("minervabot_v3", annotations=pb.Annotations()).boundaries.names


@pytest.mark.parametrize("encoding", ["utf-16", "utf-32", "utf-8", "utf-8-sig", "iso-8859-1", "ascii"])
def test_a_doctype_is_refused_in_every_encoding(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / "robot.urdf"
    declared = "" if encoding == "utf-8-sig" else f'<?xml version="1.0" encoding="{encoding}"?>'
    path.write_bytes((declared + BARE).encode(encoding))
    assert pb.load(path).coordinates == ("q1",)
    bad = f'{declared}<!DOCTYPE robot [<!ENTITY z "0 1 0">]>' + BARE.replace('axis xyz="0 1 0"', 'axis xyz="&z;"')
    path.write_bytes(bad.encode(encoding))
    with pytest.raises(pb.InputError, match="DOCTYPE"):
        pb.load(path)


@pytest.mark.parametrize("encoding", ["gbk", "shift_jis", "euc-kr", "utf-7", "bogus", "cp500"])
def test_encodings_that_readers_disagree_about_are_one_fault(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / "robot.urdf"
    path.write_text(f'<?xml version="1.0" encoding="{encoding}"?>' + BARE)
    with pytest.raises(pb.InputError) as caught:
        pb.load(path)
    assert len(caught.value.problems) == 1


def test_processing_instructions_are_no_joints_and_no_traceback(load_text: Load) -> None:
    robot = load_text(BARE.replace("<limit", "<?x y?><limit", 1).replace("<link", "<?x?><link", 1))
    assert robot.model.nq == 2


@pytest.mark.parametrize("fault", ["missing link", "a closure that does not close", "home outside the region"])
def test_the_command_line_says_it_once_and_exits_with_2(tmp_path: Path, fault: str) -> None:
    old, new, line, _ = FAULTS[fault]
    path = tmp_path / "arm.urdf"
    path.write_text(swap(old, new))
    done = subprocess.run(
        [sys.executable, "-m", "pinbound", "info", str(path)], capture_output=True, text=True, check=False, timeout=60
    )
    assert done.returncode == 2
    assert done.stdout == ""
    assert f"arm.urdf, line {line}" in done.stderr
    assert "Traceback" not in done.stderr


LONG = (
    '<robot name="r" xmlns:pinbound="urn:pinbound:1"><link name="b"/><link name="x"/>'
    '<joint name="q" type="continuous"><parent link="b"/><child link="x"/><origin xyz="{offset} 0 0"/>'
    '<axis xyz="0 0 1"/></joint><pinbound:annotations><pinbound:point name="p" link="x" xyz="{mark} 0.1 0"/>'
    '<pinbound:point name="o" link="b" xyz="0 0 1"/><pinbound:boundary name="beta" a="p" b="o"/>'
    "</pinbound:annotations></robot>"
)


@pytest.mark.parametrize("long", ["1e155", "-1e80", "1e300"])
def test_lengths_whose_products_overflow_are_refused(load_text: Load, long: str) -> None:
    """The square of 1e155 m is no number; what can be measured is said."""
    for text, what in (
        (LONG.format(offset="0", mark=long), "mark 'p' is"),
        (LONG.format(offset=long, mark="0"), "joint 'q' has an offset of"),
    ):
        with pytest.raises(pb.InputError, match=rf"{what}.*up to 1e\+75 m"):
            load_text(text)
    far = load_text(LONG.format(offset="1e74", mark="1"))
    assert np.isfinite(far.boundaries.norms([0.3])).all()
    assert np.isfinite(far.boundaries.norms([[0.3]] * 3)).all()


def test_a_floating_base_is_held_at_its_origin(load_text: Load, tmp_path: Path) -> None:
    """Positions are those of `robot.model`, and a report says so instead of speaking of boundaries."""
    text = (
        '<robot name="r"><link name="world"/><link name="base"/><link name="arm"/>'
        '<joint name="root" type="floating"><parent link="world"/><child link="base"/><origin xyz="0.1 0 0"/></joint>'
        '<joint name="q" type="revolute"><parent link="base"/><child link="arm"/><origin xyz="0 0 0.5"/>'
        '<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>'
    )
    robot = load_text(text)
    found = robot.positions("arm", [0.3], (0.0, 0.0, 0.2))
    assert found == pytest.approx([0.1 + 0.2 * np.sin(0.3), 0.0, 0.5 + 0.2 * np.cos(0.3)])
    assert any("held at its origin" in note for note in robot.notes)
    path = tmp_path / "floating.urdf"
    path.write_text(text)
    result = CliRunner().invoke(app, ["report", str(path), "--out", str(tmp_path / "out")])
    assert result.exit_code == 0, result.output
    assert (tmp_path / "out" / "index.html").is_file()


@pytest.mark.parametrize(
    ("old", "new", "ends"),
    [
        ('lower="-1"', 'lower=" -1\n"', (-1.0, 1.0)),
        ('effort="1"', 'effort="-1"', (-1.0, 1.0)),
        ('effort="1"', 'effort=" inf "', (-1.0, 1.0)),
        ("</joint>", "<dynamics/></joint>", (-1.0, 1.0)),
        ("</joint>", '<safety_controller k_position="x"/></joint>', (-1.0, 1.0)),
        ("</joint>", '<calibration rising="?"/></joint>', (-1.0, 1.0)),
        ('type="revolute"', 'type="continuous"', (-np.inf, np.inf)),
        ('type="revolute"', 'type="fixed"', None),
    ],
)
def test_what_pinocchio_refuses_and_moves_no_link_is_read(
    load_text: Load, old: str, new: str, ends: tuple[float, float] | None
) -> None:
    text = """<robot name="r"><link name="a"/><link name="b"/><joint name="q" type="revolute"><parent link="a"/>
<child link="b"/><origin xyz="0 0 1"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
</robot>"""
    text = text.replace(old, new)
    if "revolute" in old:
        text = text.replace('lower="-1"', 'lower=" "')
    robot = load_text(text)
    assert (robot.lower[0], robot.upper[0]) == ends if ends else robot.coordinates == ()
    if ends:
        assert (robot.model.lowerPositionLimit[0], robot.model.upperPositionLimit[0]) == ends
