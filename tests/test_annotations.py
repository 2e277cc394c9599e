"""Annotations from Python: to YAML and XML and back, exactly; from SRDF; wherever they stand, the same robot."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

import pinbound as pb
from pinbound.annotations.sidecar import read_sidecar
from pinbound.annotations.srdf import read_srdf
from pinbound.exceptions import Problems
from robots import joint, robot_xml
from test_input import BARE, GOOD

Load = Callable[..., pb.Robot]
NUMBER = st.floats(-10, 10, allow_nan=False)
LENGTH = st.floats(0, 10, allow_nan=False)
NAME = st.text(st.characters(codec="utf-8", categories=("L", "N", "P")), min_size=1, max_size=8)


def bare(annotations: pb.Annotations) -> pb.Annotations:
    """Return the same without lines, which files add."""
    return replace(
        annotations,
        home_line=None,
        marks={name: replace(mark, line=None) for name, mark in annotations.marks.items()},
        **{
            key: tuple(replace(mark, line=None) for mark in getattr(annotations, key))
            for key in ("boundaries", "closures", "followers", "limits")
        },
    )


@st.composite
def marks(draw: Callable[..., object]) -> pb.Annotations:
    names = draw(st.lists(NAME, min_size=2, max_size=5, unique=True))
    vector = st.tuples(NUMBER, NUMBER, NUMBER)
    points = [pb.Point(n, f"link {i}", draw(vector), draw(LENGTH)) for i, n in enumerate(names)]
    return pb.Annotations.of(
        points,
        [pb.BoundaryMark(draw(NAME), names[0], names[1], draw(LENGTH))],
        contact_tolerance=draw(LENGTH),
        home={"q1": draw(NUMBER), "q2": draw(NUMBER)},
        closures=(pb.ClosureMark("loop", "a", draw(vector), "b", draw(vector), ("x", "y")),),
        followers=(pb.FollowerMark("f", "g", draw(NUMBER), draw(NUMBER)),),
        limits=(pb.LimitMark("q1", -1.5, draw(LENGTH)),),
        assumptions=("a sentence: with [brackets], and # signs",),
    )


@settings(max_examples=100, deadline=None, derandomize=True)
@given(marks())
def test_save_and_load_give_everything_back_exactly(
    tmp_path_factory: pytest.TempPathFactory, found: pb.Annotations
) -> None:
    path = tmp_path_factory.mktemp("marks") / "robot.pinbound.yaml"
    found.save(path)
    assert bare(pb.Annotations.load(path)) == found


def test_inline_sidecar_and_python_say_the_same(load_text: Load, tmp_path: Path) -> None:
    inline = load_text(GOOD)
    notes = bare(inline.annotations)
    sidecar = load_text(BARE, notes.to_yaml())
    (tmp_path / "robot.pinbound.yaml").unlink()
    pasted = load_text(BARE.replace("</robot>", notes.to_xml() + "</robot>"))
    given_path = tmp_path / "robot.urdf"
    given_path.write_text(BARE)
    given_object = pb.load(given_path, annotations=notes)
    Q = np.random.default_rng(0).uniform(-2, 2, (20, 1))
    for robot in (sidecar, pasted, given_object):
        assert bare(robot.annotations) == notes
        assert np.array_equal(robot.boundaries.norms(Q), inline.boundaries.norms(Q))
        assert np.array_equal(robot.home, inline.home)


def test_minervabot_survives_both_round_trips(minerva: pb.Robot, tmp_path: Path) -> None:
    minerva.annotations.save(tmp_path / "m.yaml")
    assert bare(pb.Annotations.load(tmp_path / "m.yaml")) == bare(minerva.annotations)


def test_a_joint_name_that_xml_forbids_needs_a_sidecar() -> None:
    notes = pb.Annotations(home={"joint 1": 0.0})
    assert "joint 1" in notes.to_yaml()
    with pytest.raises(pb.UnsupportedError, match="sidecar"):
        notes.to_xml()


def test_faults_of_python_annotations_are_faults_of_load(tmp_path: Path) -> None:
    path = tmp_path / "robot.urdf"
    path.write_text(BARE)
    wrong = pb.Annotations.of([pb.Point("p", "bsae", (0, 0, 0)), pb.Point("s", "arm", (float("nan"), 0, 0))])
    with pytest.raises(pb.InputError) as caught:
        pb.load(path, annotations=wrong)
    assert {problem.source for problem in caught.value.problems} == {"annotations"}
    assert "Did you mean 'base'" in str(caught.value)
    assert "not finite" in str(caught.value)


def test_followers_and_limits_replace_those_of_the_urdf(tmp_path: Path) -> None:
    path = tmp_path / "robot.urdf"
    path.write_text(
        BARE.replace('<mimic joint="q1"', '<mimic joint="gone"').replace('lower="-2" upper="2"', 'lower="2" upper="-2"')
    )
    with pytest.raises(pb.InputError, match=r"(?s)above upper.*follows 'gone'"):
        pb.load(path)
    mended = pb.Annotations(
        followers=(pb.FollowerMark("q1_rod", "q1", -1.0, 0.25),), limits=(pb.LimitMark("q1", -0.5, 0.5),)
    )
    robot = pb.load(path, annotations=mended)
    assert robot.coupling.text("q1_rod") == "- q1 + 0.25"
    assert robot.upper.tolist() == [0.5]
    assert any("replace the limits of joint 'q1'" in note for note in robot.notes)


SRDF = """<robot name="arm">
  <link_sphere_approximation link="base"><sphere center="1 0 0" radius="0.1"/></link_sphere_approximation>
  <link_sphere_approximation link="arm">
    <sphere center="0 0 0.5" radius="0.05"/><sphere center="0 0 1" radius="0.05"/></link_sphere_approximation>
  <link_sphere_approximation link="rod"><sphere center="0 0 0.2" radius="0.02"/></link_sphere_approximation>
  <disable_collisions link1="rod" link2="arm" reason="Adjacent"/>
</robot>"""


def test_srdf_spheres_become_points_and_disabled_pairs_are_respected(tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text(BARE)
    srdf = tmp_path / "arm.srdf"
    srdf.write_text(SRDF)
    robot = pb.load(tmp_path / "arm.urdf", annotations=srdf)
    assert set(robot.boundaries.names) == {"base.0-arm.0", "base.0-arm.1", "base.0-rod.0"}
    assert robot.boundaries["base.0-rod.0"].threshold == pytest.approx(0.12)
    assert bare(robot.annotations) == bare(pb.Annotations.load(srdf))
    srdf.write_text(SRDF.replace('link="base"', 'link="bsae"').replace('radius="0.02"', 'radius="-1"'))
    with pytest.raises(pb.InputError, match=r"(?s)arm.srdf, line 2.*Did you mean 'base'.*line 5.*negative"):
        pb.load(tmp_path / "arm.urdf", annotations=srdf)
    srdf.write_text("<robot/>")
    with pytest.raises(pb.InputError, match="link_sphere_approximation"):
        pb.load(tmp_path / "arm.urdf", annotations=srdf)


WRIST = """<robot name="wrist">
<link name="base"/><link name="arm"/><link name="hand"/><link name="plate"/><link name="tip"/>
<joint name="q" type="revolute"><parent link="base"/><child link="arm"/><origin xyz="0 0 0.5"/>
  <limit lower="-1" upper="1"/></joint>
<joint name="p" type="revolute"><parent link="arm"/><child link="hand"/><origin xyz="0 0 0.5"/>
  <limit lower="-1" upper="1"/></joint>
<joint name="f" type="fixed"><parent link="hand"/><child link="plate"/></joint>
<joint name="g" type="fixed"><parent link="plate"/><child link="tip"/><origin xyz="0 0 0.1"/></joint>
</robot>"""
HELD = """<robot name="wrist">
<group_state name="ready" group="all"><joint name="q" value="0.5"/></group_state>
<link_sphere_approximation link="base"><sphere center="0 0 0" radius="0.1"/></link_sphere_approximation>
<link_sphere_approximation link="arm"><sphere center="0 0 0" radius="0.1"/></link_sphere_approximation>
<link_sphere_approximation link="hand"><sphere center="0 0 0" radius="0.1"/></link_sphere_approximation>
<link_sphere_approximation link="tip"><sphere center="0 0 0" radius="0.1"/></link_sphere_approximation>
<link_sphere_approximation link="hand"><sphere center="0 0 0.2" radius="0.1"/></link_sphere_approximation>
<disable_collisions link1="arm" link2="base" reason="Adjacent"/>
<disable_collisions link1="arm" link2="cover"/>
</robot>"""


def test_srdf_pairs_that_never_move_are_left_out_with_their_reason(tmp_path: Path) -> None:
    (tmp_path / "wrist.urdf").write_text(WRIST)
    srdf = tmp_path / "wrist.srdf"
    srdf.write_text(HELD)
    robot = pb.load(tmp_path / "wrist.urdf", annotations=srdf)
    expected = {
        ("base.0", "hand.0"),
        ("base.0", "hand.1"),
        ("base.0", "tip.0"),
        ("arm.0", "hand.0"),
        ("arm.0", "tip.0"),
    }
    assert {(mark.a, mark.b) for mark in robot.annotations.boundaries} == {*expected, ("arm.0", "hand.1")}
    read = read_srdf(srdf, Problems("wrist.srdf"), robot.document.root)
    assert read.left_out == {
        ("base", "arm"): "disable_collisions: Adjacent",
        ("hand", "tip"): "never move against each other",
    }
    assert [note for note in robot.notes if "wrist.srdf" in note] == [
        "wrist.srdf leaves out 1 pair of links (disable_collisions: Adjacent): base and arm",
        "wrist.srdf leaves out 1 pair of links (never move against each other): hand and tip",
        "wrist.srdf has 1 group state, ignored: ready",
        "wrist.srdf names links that the robot does not have: 'cover'",
    ]


def test_two_marks_of_one_name_are_refused_from_python() -> None:
    first, other = pb.Point("p", "base", (0.0, 0.0, 0.0)), pb.Segment("p", "arm", (0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    with pytest.raises(pb.InputError, match="two marks have the name 'p'"):
        pb.Annotations.of([first, other])


def test_an_srdf_of_another_robot_is_noted(tmp_path: Path) -> None:
    """Its pairs are left out if links have the same names, whatever robot they were judged on."""
    (tmp_path / "wrist.urdf").write_text(WRIST)
    name = pb.load(tmp_path / "wrist.urdf").name
    for other in (name, "crane"):
        (tmp_path / "wrist.srdf").write_text(re.sub(r'<robot name="\w+"', f'<robot name="{other}"', HELD, count=1))
        robot = pb.load(tmp_path / "wrist.urdf", annotations=tmp_path / "wrist.srdf")
        said = [note for note in robot.notes if "says that it is of the robot" in note]
        assert [f"'crane', and this one is '{name}'" in note for note in said] == ([] if other == name else [True])


def test_a_sidecar_may_repeat_a_tolerance_but_not_contradict_it(tmp_path: Path) -> None:
    path, sidecar = tmp_path / "wrist.urdf", tmp_path / "wrist.pinbound.yaml"
    said = '<pinbound:annotations xmlns:pinbound="urn:pinbound:1" contact_tolerance="1e-4"/></robot>'
    path.write_text(WRIST.replace("</robot>", said))
    sidecar.write_text("contact_tolerance: 0.0001")
    assert pb.load(path).annotations.contact_tolerance == 1e-4
    sidecar.write_text("contact_tolerance: 0.0002")
    with pytest.raises(pb.InputError, match="contact_tolerance is given twice"):
        pb.load(path)


def test_both_readers_of_yaml_give_the_same_items_and_faults(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """libyaml reads ten times faster; where it allows what PyYAML's own reader refuses, that one is asked."""
    texts = (
        "points:\n- {name: p, link: l, xyz: [1, -2.5e-3, 0x10]}\n- {name: 'q q', link: l, xyz: [~, true, 1_0]}\n",
        "contact_tolerance:\t1e-5\n",
        "points: [{name: p, link: l, xyz: [1,,2]}]\n",
        "home: {a: !degrees 90}\n",
        "home: &x {a: 1}\nlimits: [*x]\n",
        "home: {a: 1}\nhome: {a: 2}\npoint: []\n",
        "points:\n- {name: ü, link: l}\n",
        "home: {a: 1\n",
        "home: [" * 40 + "]" * 40 + "\n",
        'home: {a: "\\u00fc"}\n',
    )
    for text in texts:
        said = []
        for quick in (True, False):
            with monkeypatch.context() as patched:
                if not quick:
                    patched.setattr(yaml, "CSafeLoader", None, raising=False)
                path, problems = tmp_path / "some.yaml", Problems("robot")
                path.write_text(text, encoding="utf-8")
                said.append((read_sidecar(path, problems), problems.found))
        assert said[0] == said[1]
        assert said[0][0] or said[0][1]


def test_numbers_of_numpy_are_numbers(minerva: pb.Robot) -> None:
    mark = pb.Point("p", "base_link", tuple(np.array([0.3, 0.0, 0.0])), np.float64(0.01))
    boundary = pb.BoundaryMark("near", "p", minerva.boundaries[0].point_b.name, np.float64(0.02))
    got = minerva.with_annotations(pb.Annotations.of([mark], [boundary])).annotations
    assert got.marks["p"] == mark
    assert got.boundaries[-1] == boundary


ON_ONE = """boundaries: [{name: b, a: p, b: s}]
points: [{name: p, link: base, xyz: [50, 0, 0]}, {name: s, link: '010', xyz: [%s, 0, 0]}]"""


@pytest.mark.parametrize(
    ("written", "value"), [("'010'", 10.0), ("10", 10.0), ("010.0", 10.0), ("07", 7.0), ("08", 8.0)]
)
def test_a_yaml_number_that_all_readers_take_for_the_same_is_read(written: str, value: float, tmp_path: Path) -> None:
    (tmp_path / "n.yaml").write_text(ON_ONE % written)
    robot = pb.load(robot_xml([joint("q", "revolute", "base", "010")], {}, []), annotations=tmp_path / "n.yaml")
    assert robot.annotations.points["s"].xyz == (value, 0.0, 0.0)


@pytest.mark.parametrize(("written", "octal"), [("010", 8), ("-012", -10), ("+0017", 15)])
def test_a_yaml_number_that_readers_take_for_different_ones_is_refused(
    written: str, octal: int, tmp_path: Path
) -> None:
    (tmp_path / "n.yaml").write_text(ON_ONE % written)
    assert yaml.safe_load(f"x: {written}") == {"x": octal}
    with pytest.raises(pb.InputError, match=rf"n\.yaml, line 2: {re.escape(written)} is {octal} in YAML 1\.1 and"):
        pb.load(robot_xml([joint("q", "revolute", "base", "010")], {}, []), annotations=tmp_path / "n.yaml")


def test_a_name_of_octal_digits_survives_a_sidecar(tmp_path: Path) -> None:
    marks = [pb.Point("010", "base", (50.0, 0, 0)), pb.Point("s", "010", (1.0, 0, 0))]
    text = robot_xml([joint("q", "revolute", "base", "010")], {}, [])
    once = pb.load(text, annotations=pb.Annotations.of(marks, [pb.BoundaryMark("012", "010", "s")]))
    (tmp_path / "n.yaml").write_text(once.annotations.to_yaml())
    assert pb.load(text, annotations=tmp_path / "n.yaml").boundaries.names == ("012",)


def test_angles_of_annotations_that_look_like_degrees_are_noted() -> None:
    text = robot_xml([joint("q", "revolute", "base", "a"), joint("x", "prismatic", "a", "b")], {}, [])
    right = pb.Box("right", "a", (9.0, 0, 0), (0.0, 1.5, 3.0), (0.1, 0.1, 0.1), 0.0)
    wrong = pb.Box("wrong", "a", (9.0, 0, 0), (0.0, 90.0, 0.0), (0.1, 0.1, 0.1), 0.0)
    rules = [pb.Rule("lean", {"q": 1.0}, -19.0), pb.Rule("reach", {"x": 1.0}, -19.0), pb.Rule("far", {"q": 1.0}, -1.5)]

    def said(*marks: pb.Box, rules: list[pb.Rule]) -> list[str]:
        found = pb.load(text, annotations=pb.Annotations.of(marks, rules=rules))
        return [note for note in found.notes if "degrees" in note]

    told = "angles are read as radians, and these look like degrees: "
    assert said(right, rules=[]) == []
    assert said(right, rules=rules[1:]) == []
    assert said(right, wrong, rules=[]) == [f"{told}rpy 0 90 0 of box 'wrong'"]
    assert said(right, rules=rules) == [f"{told}-19 .. inf of rule 'lean'"]
