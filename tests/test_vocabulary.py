"""Words of URDF: what is nearly one of them, stands twice or in a strange namespace is a fault; the rest is a note."""

import re
from collections.abc import Callable

import pytest
from lxml import etree

import pinbound as pb
from pinbound.exceptions import Problems
from pinbound.model.vocabulary import WORDS, check_vocabulary, near_miss

Load = Callable[..., pb.Robot]

ARM = """<robot name="lamp">
  <link name="foot"/>
  <link name="pole"><collision><origin xyz="0 0 0.1"/><geometry>\
<cylinder radius="0.02" length="0.2"/></geometry></collision></link>
  <link name="head"/>
  <joint name="swing" type="revolute">
    <parent link="foot"/><child link="pole"/>
    <origin xyz="0 0 0.05" rpy="0 0 0.3"/>
    <axis xyz="0 1 0"/>
    <limit lower="-1" upper="0.5" effort="2" velocity="3"/>
  </joint>
  <joint name="nod" type="revolute">
    <parent link="pole"/><child link="head"/>
    <origin xyz="0 0 0.2"/>
    <axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" effort="2" velocity="3"/>
    <mimic joint="swing" multiplier="-1" offset="0.1"/>
  </joint>
</robot>
"""

AXIS, HEAD = '<axis xyz="0 1 0"/>', '<link name="head"/>'
LIMIT = '<limit lower="0" upper="0" effort="1" velocity="1"/><limit lower'
WRAPPED = '<model><link name="w"><visual/></link></model></robot>'
FAULTS = {
    "attribute of a limit": ('upper="0.5"', 'uper="0.5"', 9, "'uper'.*Did you mean 'upper'"),
    "attribute of a mimic": ("multiplier=", "multiplyer=", 16, "'multiplyer'.*Did you mean 'multiplier'"),
    "two letters swapped": (
        '<axis xyz="0 1 0"/>\n    <limit lower="-1"',
        '<axis xzy="0 1 0"/>\n    <limit lower="-1"',
        8,
        "'xyz'",
    ),
    "plural element": (AXIS, '<axes xyz="0 1 0"/>', 8, "<axes>.*Did you mean <axis>"),
    "capitals of an element": (AXIS, '<Axis xyz="0 1 0"/>', 8, "<Axis>.*Did you mean <axis>"),
    "capitals of an attribute": ('xyz="0 0 0.05"', 'XYZ="0 0 0.05"', 7, "'XYZ'.*Did you mean 'xyz'"),
    "another word for it": ('lower="-1" upper="0.5"', 'min="-1" max="0.5"', 9, "'min'.*Did you mean 'lower'"),
    "quaternions": ('rpy="0 0 0.3"', 'quat_xyzw="0 0 0 1"', 7, "'quat_xyzw'.*'rpy'"),
    "no xyz": (AXIS, "<axis/>", 8, "no xyz"),
    "text for an attribute": (AXIS, "<axis>0 1 0</axis>", 8, "holds the text '0 1 0'"),
    "offset as an element": (
        '<origin xyz="0 0 0.2"/>',
        "<origin><xyz>0 0 0.2</xyz></origin>",
        13,
        "'xyz' as an element",
    ),
    "multiplier as an element": (
        'multiplier="-1" offset="0.1"/>',
        "><multiplier>-1</multiplier></mimic>",
        16,
        "'multiplier' as an element",
    ),
    "axis as an attribute": ('"revolute">', '"revolute" axis="0 0 1">', 5, "'axis' as an attribute"),
    "origin of a body as an attribute": ("<collision>", '<collision origin="0 0 1">', 3, "'origin' as an attribute"),
    "a mass as text": (HEAD, '<link name="head"><inertial><mass>1</mass></inertial></link>', 4, "holds the text '1'"),
    "two axes": (AXIS, '<axis xyz="0 1 0"/><axis xyz="1 0 0"/>', 8, "has two <axis>"),
    "two limits": (
        "<limit lower",
        '<limit lower="0" upper="0" effort="1" velocity="1"/><limit lower',
        9,
        "has two <limit>",
    ),
    "two origins": ("<origin xyz", '<origin xyz="1 0 0"/><origin xyz', 3, "has two <origin>"),
    "two mimics": ("<mimic", '<mimic joint="swing"/><mimic', 16, "has two <mimic>"),
    "two parents": ('<parent link="foot"/>', '<parent link="foot"/><parent link="head"/>', 6, "has two <parent>"),
    "two shapes": ("<geometry>", '<geometry><sphere radius="1"/>', 3, "holds 2 shapes"),
    "a link inside a link": (
        HEAD,
        '<link name="head"><link name="x"/></link>',
        4,
        "inside link 'head'",
    ),
    "a joint inside a link": (
        HEAD,
        '<link name="head"><joint name="x"/></link>',
        4,
        "inside link 'head'",
    ),
    "a link inside an axis": (AXIS, '<axis xyz="0 1 0"><link name="x"/></axis>', 8, "inside <axis>"),
    "a default namespace inside": (AXIS, '<axis xmlns="urn:x" xyz="0 1 0"/>', 8, "namespace 'urn:x'"),
    "a prefix before a word": (AXIS, '<p:axis xmlns:p="urn:x" xyz="0 1 0"/>', 8, "namespace 'urn:x'"),
    "a prefix before an attribute": (
        AXIS,
        '<axis xmlns:p="urn:x" p:xyz="0 1 0"/>',
        8,
        "'xyz' in the name",
    ),
    "twice, once with a prefix": (
        AXIS,
        '<axis xmlns:p="urn:x" p:xyz="0 1 0" xyz="1 0 0"/>',
        8,
        "'xyz' in",
    ),
    "a link with a prefix": (
        HEAD,
        '<link name="head"/><p:link xmlns:p="urn:x" name="y"/>',
        4,
        "'urn:x'",
    ),
    "capitals of a joint": ("</robot>", '<Joint name="z" type="fixed"/></robot>', 18, "<Joint>.*Did you mean <joint>"),
    "a misspelt body": ("<collision>", "<colision>", 3, "<colision>.*Did you mean <collision>"),
    "a misspelt size": ('radius="0.02"', 'radus="0.02"', 3, "'radus'.*Did you mean 'radius'"),
    "a wrapped link": (
        "</robot>",
        '<model><link name="w"><visual/></link></model></robot>',
        18,
        "link 'w' stands inside <model>",
    ),
    "annotations without a prefix": ("</robot>", "<annotations/></robot>", 18, "pinbound:annotations"),
    "a mark on a link": (
        HEAD,
        '<link xmlns:k="urn:pinbound:1" name="head" k:radius="1"/>',
        4,
        "k?radius",
    ),
    "xacro": ("</robot>", '<x:if xmlns:x="http://www.ros.org/wiki/xacro"/></robot>', 18, "xacro elements.*urdf.xacro"),
    "joint type in capitals": ('type="revolute"', 'type="Revolute"', 5, "Did you mean 'revolute'"),
}


def changed(old: str, new: str) -> str:
    assert old in ARM, "the test's own replacement must apply"
    text = ARM.replace(old, new, 1)
    return text.replace("</collision>", "</colision>") if "<colision>" in new else text


def test_the_lamp_itself_has_no_note(load_text: Load) -> None:
    assert load_text(ARM.replace("-2", "-0.4").replace('upper="2"', 'upper="1.1"')).notes == ()


@pytest.mark.parametrize("fault", FAULTS)
def test_what_loses_its_meaning_is_a_fault_with_its_line(load_text: Load, fault: str) -> None:
    old, new, line, message = FAULTS[fault]
    with pytest.raises(pb.InputError) as caught:
        load_text(changed(old, new))
    assert any(p.line == line and re.search(message, str(p)) for p in caught.value.problems), str(caught.value)


def test_words_of_other_programs_are_one_note_each(load_text: Load) -> None:
    text = ARM.replace("<limit", '<spring k="1"/><limit').replace("<limit", '<m:tag xmlns:m="urn:m"/><limit')
    robot = load_text(text.replace("<axis", '<axis frame="local"'))
    notes = [note for note in robot.notes if "ignored" in note]
    assert len(notes) == 3
    for word in ("<spring> in <joint>", "<tag> of the namespace 'urn:m'", "the attribute 'frame' of <axis>"):
        assert any(note.startswith(word) and "2 times, first on line" in note for note in notes)


@pytest.mark.parametrize(
    ("text", "note"),
    [
        ('<xi:include xmlns:xi="http://www.w3.org/2001/XInclude" href="arm.urdf"/>', "<include> of the namespace"),
        ('<loop_joint name="l" type="revolute"><link1 link="foot"/></loop_joint>', "loops are open: 'l' (line 18)"),
        ('<gazebo><joint name="g"><parent>foot</parent><child>head</child></joint></gazebo>', "'g' (line 18)"),
    ],
)
def test_links_and_loops_that_other_programs_would_add_are_said(load_text: Load, text: str, note: str) -> None:
    assert any(note in said for said in load_text(ARM.replace("</robot>", text + "</robot>")).notes)


def test_words_of_urdf_that_pinbound_does_not_need_are_no_note() -> None:
    root = etree.fromstring(
        '<robot name="r" version="1.0"><material name="m"><color rgba="0 0 0 1"/></material>'
        '<transmission><joint name="j"/></transmission><gazebo><whatever/></gazebo>'
        '<link name="a"><inertial><origin xyz="0 0 0"/><mass value="1"/><inertia ixx="1"/></inertial>'
        '<visual name="v"><geometry><mesh filename="x" scale="1 1 1"/></geometry></visual>'
        '<collision_checking><capsule radius="1"/></collision_checking></link>'
        '<joint name="j" type="fixed"><calibration rising="0"/><dynamics damping="1"/>'
        '<safety_controller k_velocity="1"/></joint></robot>'
    )
    problems = Problems("r.urdf")
    assert check_vocabulary(root, problems) == []
    assert problems.found == []


def test_expressions_of_xacro_in_names_are_noted(load_text: Load) -> None:
    robot = load_text(ARM.replace('"head"', '"${prefix}head"').replace('"swing"', '"$(arg side)_swing"'))
    assert any("'${prefix}head', '$(arg side)_swing'" in note for note in robot.notes)


def test_no_word_of_urdf_is_a_near_miss_of_another_in_its_place() -> None:
    for place, word in WORDS.items():
        for other in word.ignored:
            assert not [known for known in word.read if near_miss(other, known)] or place == "link", (place, other)


@pytest.mark.parametrize(
    "namespace", ["urn:pinbond:1", "urn:pinbound:2", "urn:Pinbound:1", "https://example.org/pinbuond"]
)
def test_annotations_in_a_namespace_that_nothing_reads_are_a_fault(load_text: Load, namespace: str) -> None:
    marks = '<p:annotations xmlns:p="{}">\n<p:point name="a" link="foot" xyz="0 0 0"/></p:annotations>'
    with pytest.raises(pb.InputError, match="urn:pinbound:1") as caught:
        load_text(ARM.replace("</robot>", marks.format(namespace) + "</robot>"))
    assert [problem.line for problem in caught.value.problems] == [18]
    assert load_text(ARM.replace("</robot>", marks.format("urn:pinbound:1") + "</robot>")).annotations.points
