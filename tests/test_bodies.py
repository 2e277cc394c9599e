"""Bodies are those of Pinocchio; every fault of the geometry has its line; nothing is dropped in silence."""

import importlib.metadata
import random
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from lxml import etree

import pinbound as pb
from pinbound.coverage.bodies import Body, collision_bodies, read_bodies
from pinbound.coverage.covers import cover
from pinbound.exceptions import Problems

Load = Callable[..., pb.Robot]
SHARE = Path(str(importlib.metadata.distribution("example-robot-data").locate_file("cmeel.prefix/share")))
PUBLIC = SHARE / "example-robot-data/robots"
ROBOTS = {
    "panda_collision": "panda_description/urdf/panda_collision.urdf",
    "simple_humanoid": "simple_humanoid_description/urdf/simple_humanoid.urdf",
    "allegro": "allegro_hand_description/urdf/allegro_right_hand.urdf",
    "a1": "a1_description/urdf/a1.urdf",
}
KINDS = {"collision": pin.GeometryType.COLLISION, "visual": pin.GeometryType.VISUAL}


def of_link(inner: str, head: str = "") -> str:
    return f'<robot name="r" {head}>\n<link name="hand">\n{inner}\n</link>\n</robot>'


def read(load_text: Load, inner: str) -> tuple[Body, ...]:
    return collision_bodies(load_text(of_link(inner)))


def rod(name: str = "rod", tag: str = "collision") -> str:
    return f'<{tag} name="{name}"><geometry><cylinder radius="0.1" length="0.4"/></geometry></{tag}>'


def size_in_coal(shape: Any) -> tuple[str, tuple[float, ...]]:
    """Return name and measures of one of Pinocchio's shapes, as `Body` says them."""
    kind = type(shape).__name__
    if kind == "Box":
        return "box", tuple((2 * shape.halfSide).tolist())
    if kind == "Sphere":
        return "sphere", (shape.radius,)
    if kind in ("Cylinder", "Capsule"):
        return kind.lower(), (shape.radius, 2 * shape.halfLength)
    return "mesh", ()


@pytest.mark.parametrize("name", ROBOTS)
def test_bodies_are_those_of_pinocchio(name: str) -> None:
    path = PUBLIC / ROBOTS[name]
    model = pin.buildModelFromUrdf(str(path))
    bodies = collision_bodies(pb.load(path))
    assert {body.source for body in bodies} <= set(KINDS)
    compared = 0
    for source, kind in KINDS.items():
        if source == "visual" and name != "panda_collision" and not any(body.source == source for body in bodies):
            continue
        geometry = pin.buildGeomFromUrdf(model, str(path), kind, package_dirs=[str(SHARE)])
        ours = {(body.link, body.index): body for body in bodies if body.source == source}
        theirs = {tuple(one.name.rsplit("_", 1)): one for one in geometry.geometryObjects}
        if source == "collision":
            assert {(link, str(index)) for link, index in ours} == set(theirs)
        for (link, index), body in ours.items():
            found = theirs[link, str(index)]
            frame = model.frames[model.getFrameId(link, pin.BODY)].placement
            expected = frame * pin.SE3(np.array(body.rotation), np.array(body.translation))
            assert np.abs(found.placement.homogeneous - expected.homogeneous).max() < 1e-12
            shape, size = size_in_coal(found.geometry)
            assert body.shape == shape
            assert body.size == pytest.approx(size, rel=1e-15, abs=0.0)
            if shape == "mesh":
                assert found.meshPath.endswith(body.filename.removeprefix("package://"))
                assert found.meshScale.tolist() == pytest.approx(body.scale)
            compared += 1
    assert compared == len(bodies) > 0


@pytest.mark.parametrize(
    "inner",
    [
        rod() + '<collision_checking><capsule name="rod"/></collision_checking>',
        '<collision_checking><capsule name="rod"/></collision_checking>' + rod(),
        rod() + rod("pole") + '<collision_checking><convex name="rod"/><capsule name="pole"/></collision_checking>',
        rod() + rod("") + '<collision_checking><capsule name=""/></collision_checking>',
        rod() + rod() + '<collision_checking><capsule name="rod"/></collision_checking>',
        rod() + "<collision_checking/>",
        '<collision name="rod"><geometry><box size="1 2 3"/></geometry></collision>'
        '<collision_checking><capsule name="rod"/></collision_checking>',
        rod(tag="visual") + '<collision_checking><capsule name="rod"/></collision_checking>',
        '<collision><geometry><capsule radius="0.1" length="0.4"/></geometry></collision>',
    ],
)
def test_capsules_and_namespaces_are_read_as_pinocchio_reads_them(load_text: Load, inner: str) -> None:
    text = of_link(inner, 'version="1.2"')
    bodies = collision_bodies(load_text(text))
    kind = KINDS[bodies[0].source]
    model = pin.buildModelFromXML(text)
    theirs = pin.buildGeomFromUrdfString(model, text, kind).geometryObjects
    assert [(body.shape, body.size) for body in bodies] == [size_in_coal(one.geometry) for one in theirs]
    for body, one in zip(bodies, theirs, strict=True):
        assert np.abs(one.placement.rotation - body.rotation).max() < 1e-15
        assert np.abs(one.placement.translation - body.translation).max() < 1e-15


def shape(text: str) -> str:
    return f"<collision>\n<geometry>{text}</geometry>\n</collision>"


BALL = '<geometry><sphere radius="0.1"/></geometry>'
FAULTS = {
    "no geometry": ("<collision/>", 3, "collision 0 of link 'hand' has no <geometry>"),
    "no geometry of a drawn body": ("<visual/>", 3, "visual 0 of link 'hand' has no <geometry>"),
    "empty geometry": (shape(""), 4, "is empty. Give it one of: sphere, box"),
    "two shapes": (shape('<sphere radius="1"/><box size="1 1 1"/>'), 4, "holds 2 shapes"),
    "two geometries": (f"<collision>{BALL}\n{BALL}</collision>", 4, "has two <geometry>"),
    "two origins": (f"<collision><origin/>\n<origin/>{BALL}</collision>", 4, "has two <origin>"),
    "misspelt shape": (shape('<spheer radius="0.1"/>'), 4, "<spheer> .* Did you mean <sphere>"),
    "misspelt geometry": ("<collision><geometri/></collision>", 3, "Did you mean <geometry>"),
    "misspelt origin": (f'<collision>\n<orign xyz="1 0 0"/>{BALL}</collision>', 4, "Did you mean <origin>"),
    "misspelt collision": (f"<colision>{BALL}</colision>", 3, "Did you mean <collision>"),
    "capital collision": (f"<Collision>{BALL}</Collision>", 3, "Did you mean <collision>"),
    "shape outside geometry": (f'<collision>{BALL}\n<box size="1 1 1"/></collision>', 4, "<box> .* not in <geometry>"),
    "shape in a link": ('<box size="1 1 1"/>', 3, "<box> .* stands in <link>"),
    "shape in a shape": (shape('<box size="1 1 1"><sphere radius="1"/></box>'), 4, "stands in <box>"),
    "no radius": (shape("<sphere/>"), 4, "has no radius"),
    "misspelt radius": (shape('<sphere raduis="0.1"/>'), 4, "Did you mean 'radius'"),
    "namespaced radius": (shape('<sphere xmlns:x="u" x:radius="0.1"/>'), 4, "'radius' in the namespace 'u'"),
    "size as in SDF": (shape("<box><size>1 1 1</size></box>"), 4, "'size' as an element.*size="),
    "no length": (shape('<cylinder radius="0.1"/>'), 4, "has no length"),
    "no length of a capsule": (shape('<capsule radius="0.1"/>'), 4, "has no length"),
    "size of a capsule": (shape('<capsule size="1 1 1"/>'), 4, "has no radius"),
    "two numbers": (shape('<box size="0.1 0.1"/>'), 4, "holds 2 numbers, not 3"),
    "four numbers": (shape('<box size="1 1 1 1"/>'), 4, "holds 4 numbers, not 3"),
    "two radii": (shape('<sphere radius="0.1 0.2"/>'), 4, "holds 2 numbers, not 1"),
    "commas": (shape('<box size="1, 1, 1"/>'), 4, "is not 3 numbers"),
    "a word": (shape('<cylinder radius="0.1" length="null"/>'), 4, "'null' is not a number"),
    "empty number": (shape('<sphere radius=""/>'), 4, "holds 0 numbers"),
    "unexpanded": (shape('<sphere radius="${r}"/>'), 4, "is not a number"),
    "nan": (shape('<box size="0.1 nan 0.1"/>'), 4, "not finite"),
    "infinite": (shape('<sphere radius="inf"/>'), 4, "not finite"),
    "overflow": (shape('<sphere radius="1e999"/>'), 4, "not finite"),
    "negative": (shape('<sphere radius="-0.1"/>'), 4, "is negative"),
    "negative side": (shape('<box size="0.1 -0.1 0.1"/>'), 4, "is negative"),
    "absurd": (shape('<capsule radius="0.1" length="1e200"/>'), 4, "larger than 1e\\+09 m"),
    "mesh without a file": (shape("<mesh/>"), 4, "has no filename"),
    "mesh with an empty file": (shape('<mesh filename=" "/>'), 4, "has no filename"),
    "scale of a mesh": (shape('<mesh filename="a.stl" scale="1 1"/>'), 4, "holds 2 numbers, not 3"),
    "flat mesh": (shape('<mesh filename="a.stl" scale="1 0 1"/>'), 4, "Give factors other than zero"),
    "xyz": (f'<collision>\n<origin xyz="1 1"/>{BALL}</collision>', 4, "xyz of the origin .* 2 numbers, not 3"),
    "rpy": (f'<collision>\n<origin rpy="é"/>{BALL}</collision>', 4, "rpy of the origin .* is not 3 numbers"),
    "nan in xyz": (f'<collision>\n<origin xyz="nan 0 0"/>{BALL}</collision>', 4, "not finite"),
    "far away": (f'<collision>\n<origin xyz="0 1e99 0"/>{BALL}</collision>', 4, "larger than"),
    "a quaternion": (f'<collision>\n<origin quat_xyzw="0 0 1 0"/>{BALL}</collision>', 4, "Did you mean 'rpy'"),
    "capsule of another name": (
        rod() + '\n<collision_checking><capsule name="rodd"/></collision_checking>',
        4,
        "names 'rodd', .* Did you mean 'rod'",
    ),
    "capsule without a name": (rod() + "\n<collision_checking><capsule/></collision_checking>", 4, "has no name"),
    "two blocks": (
        rod() + '<collision_checking/>\n<collision_checking><capsule name="rod"/></collision_checking>',
        4,
        "Pinocchio reads the first only",
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_of_the_geometry_has_its_line(load_text: Load, fault: str) -> None:
    inner, line, message = FAULTS[fault]
    with pytest.raises(pb.InputError) as caught:
        read(load_text, inner)
    (problem,) = caught.value.problems
    assert problem.line == line
    assert re.search(message, str(problem)), str(problem)
    assert problem.remedy


def test_all_faults_are_told_at_once_and_sound_bodies_can_be_had(load_text: Load) -> None:
    robot = load_text(
        of_link(shape("<sphere/>") + "\n" + shape('<box size="1 2"/>') + "\n" + shape('<sphere radius="2"/>'))
    )
    with pytest.raises(pb.InputError) as caught:
        collision_bodies(robot)
    assert [problem.line for problem in caught.value.problems] == [4, 7]
    problems = Problems("r.urdf")
    found = read_bodies(robot.document, problems)
    assert [(body.index, body.size) for body in found.bodies] == [(2, (2.0,))]
    assert len(problems.found) == 2


@pytest.mark.parametrize("kind", ["ellipsoid", "plane", "torus", "drake:capsule"])
def test_a_shape_that_no_mark_holds_is_returned_by_its_name(load_text: Load, kind: str) -> None:
    text = of_link(shape(f'<{kind} radius="0.1" length="1" size="1 1 1"/>'), 'xmlns:drake="https://drake.mit.edu"')
    robot = load_text(text)
    (body,) = collision_bodies(robot)
    assert (body.shape, body.size) == (kind, ())
    proposal = pb.propose_marks(robot)
    assert proposal.uncovered[0].name == body.name
    assert not proposal.covers
    with pytest.raises(pb.UnsupportedError, match=kind):
        cover(body, 0.01)


def test_a_link_without_collision_bodies_has_its_visual_ones(load_text: Load) -> None:
    drawn = '<visual name="skin"><geometry><box size="1 2 3"/></geometry></visual>'
    (body,) = read(load_text, drawn)
    assert (body.source, body.name, body.size, body.line) == ("visual", "skin", (1.0, 2.0, 3.0), 3)
    (body,) = read(load_text, drawn + '\n<collision><geometry><sphere radius="0.1"/></geometry></collision>')
    assert (body.source, body.name, body.shape, body.line) == ("collision", "hand.0", "sphere", 4)


def test_meshes_keep_their_file_and_scale(load_text: Load) -> None:
    (body,) = read(load_text, shape('<mesh filename="package://p/a.stl" scale="0.001 -0.001 0.001"/>'))
    assert (body.shape, body.filename, body.scale) == ("mesh", "package://p/a.stl", (0.001, -0.001, 0.001))


def test_what_is_ignored_is_noted(load_text: Load) -> None:
    inner = '<collision name="a">' + BALL + "</collision>"
    robot = load_text(of_link(inner + '<collision_checking><capsule name="a"/></collision_checking>'))
    notes = pb.propose_marks(robot).notes
    assert "<collision_checking> names 'a' of link 'hand', which is not a cylinder" in notes


@pytest.mark.parametrize(
    "inner", ['<collision xmlns="urn:other">{}</collision>', '<x:collision xmlns:x="u">{}</x:collision>']
)
def test_a_body_that_only_some_readers_see_is_a_fault(load_text: Load, inner: str) -> None:
    with pytest.raises(pb.InputError, match="some readers see it, and some do not"):
        read(load_text, inner.format(BALL))


def test_bodies_own_their_arrays(load_text: Load) -> None:
    (body,) = read(load_text, shape('<sphere radius="1"/>'))
    for array in (body.rotation, body.translation):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0
    mine = np.eye(3)
    made = Body("l", 0, "sphere", (1.0,), mine, np.zeros(3))
    mine[:] = 7.0
    assert np.array_equal(made.rotation, np.eye(3))


GOOD = """<robot name="r">
<link name="base"><collision name="foot"><origin xyz="0 0 0.1" rpy="0.1 0 0"/>
  <geometry><box size="0.2 0.1 0.1"/></geometry></collision></link>
<link name="a"><visual><geometry><cylinder radius="0.05" length="0.3"/></geometry></visual></link>
<link name="b"><collision><origin xyz="0 0 0.2"/><geometry><capsule radius="0.05" length="0.3"/></geometry></collision>
  <collision><geometry><mesh filename="b.stl" scale="1 1 1"/></geometry></collision></link>
<link name="c"><collision name="pole"><origin rpy="0 1.5 0"/>
  <geometry><cylinder radius="0.02" length="0.2"/></geometry></collision>
  <collision><geometry><sphere radius="0.05"/></geometry></collision>
  <collision_checking><capsule name="pole"/></collision_checking></link>
<joint name="q1" type="revolute"><parent link="base"/><child link="a"/><origin xyz="0 0 0.3"/><axis xyz="0 1 0"/>
  <limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
<joint name="q2" type="prismatic"><parent link="a"/><child link="b"/><origin xyz="0 0 0.4"/><axis xyz="0 0 1"/>
  <limit lower="0" upper="0.4" effort="1" velocity="1"/></joint>
<joint name="q3" type="continuous"><parent link="b"/><child link="c"/><origin xyz="0 0 0.4"/><axis xyz="1 0 0"/></joint>
</robot>"""
TOKENS = [
    "",
    "nan",
    "-0.1",
    "inf",
    "1e999",
    "1e300",
    "1e-300",
    "0",
    "0 0 0",
    "1 2",
    "1 2 3 4",
    "é",
    "null",
    "${x}",
    "1,2,3",
]
TAGS = ["sphere", "box", "cylinder", "capsule", "mesh", "geometry", "collision", "visual", "origin", "plane", "x"]


def mutated(rng: random.Random) -> str:
    """Return a URDF with one or two changes in its geometry."""
    root = etree.fromstring(GOOD)
    for _ in range(rng.randint(1, 2)):
        inside = [one for link in root.findall("link") for one in link.iterdescendants()]
        if not inside:
            break
        element = rng.choice(inside)
        above = element.getparent()
        assert above is not None
        choice = rng.randrange(6)
        if choice == 0 and element.attrib:
            element.set(rng.choice(list(element.attrib)), rng.choice(TOKENS))
        elif choice == 1 and element.attrib:
            del element.attrib[rng.choice(list(element.attrib))]
        elif choice == 2:
            element.tag = rng.choice(TAGS)
        elif choice == 3:
            above.append(etree.fromstring(etree.tostring(element)))
        elif choice == 4:
            above.remove(element)
        else:
            element.append(etree.fromstring(etree.tostring(rng.choice(inside))))
    return etree.tostring(root, encoding="unicode")


def test_mutated_geometry_is_refused_or_answered(tmp_path: Path) -> None:
    rng, path, answered = random.Random(0), tmp_path / "r.urdf", 0
    for _ in range(300):
        text = mutated(rng)
        path.write_text(text, encoding="utf-8")
        try:
            robot = pb.load(path)
            proposal = pb.propose_marks(robot)
        except pb.InputError as error:
            assert all(problem.line is not None and problem.remedy for problem in error.problems), text
            continue
        answered += 1
        marked = pb.load(path, annotations=proposal.annotations)
        assert len(marked.boundaries) == len(proposal.annotations.boundaries), text
    assert 60 < answered < 240


def test_measures_may_be_zero_and_their_marks_load(load_text: Load, tmp_path: Path) -> None:
    """A flat box, a thin rod, a point: each is what it says, and its mark is one that a sidecar may hold."""
    shapes = ['<box size="0.1 0 0.2"/>', '<box size="0 0.1 0"/>', '<box size="0 0 0"/>', '<sphere radius="0"/>']
    shapes += [
        f'<{kind} radius="{r}" length="{z}"/>' for kind in ("cylinder", "capsule") for r, z in ((0, 1), (0.1, 0))
    ]
    held = "".join(
        f'<collision><origin xyz="{3 * k} 0 0"/><geometry>{one}</geometry></collision>' for k, one in enumerate(shapes)
    )
    joints = "".join(
        f'<joint name="{c}" type="continuous"><parent link="{p}"/><child link="{c}"/>'
        '<origin xyz="9 2 0"/><axis xyz="0 0 1"/></joint>'
        for p, c in (("a", "b"), ("b", "c"))
    )
    ball = '<link name="c"><collision><geometry><sphere radius="1"/></geometry></collision></link>'
    text = f'<robot name="r"><link name="a">{held}</link><link name="b"/>{ball}{joints}</robot>'
    for by in ("bodies", "spheres"):
        proposal = pb.propose_marks(load_text(text), by=by)
        assert len(proposal.covers) == len(shapes) + 1
        assert not proposal.uncovered
        proposal.annotations.save(tmp_path / f"{by}.yaml")
        marked = pb.load(tmp_path / "robot.urdf", annotations=tmp_path / f"{by}.yaml")
        assert len(marked.boundaries) == len(proposal.annotations.boundaries) > 0
