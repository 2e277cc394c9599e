"""Hulls whose vertices are those of a mesh file: three spellings, places, faults, and the bodies that they hold."""

import pickle
import shutil
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import pinbound as pb
from pinbound.annotations import HullFiles

# Its corners are in general position, one of them inside: mirrored or turned, it is another body.
PEBBLE = """v 0.05 0.01 0.02
v -0.04 0.06 0.01
v 0.02 -0.05 0.03
v 0.01 0.02 -0.06
v 0.01 0.01 0.01
f 1 2 3
f 1 3 4
f 1 4 2
f 2 4 3
f 1 2 5
"""
CORNERS = np.array([[0.05, 0.01, 0.02], [-0.04, 0.06, 0.01], [0.02, -0.05, 0.03], [0.01, 0.02, -0.06]])
SCALE, XYZ, RPY = (2.0, -1.0, 0.5), (0.1, 0.02, -0.03), (0.3, -0.4, 2.0)
PLACED = 'mesh="package://quarry/pebble.obj" scale="2 -1 0.5" xyz="0.1 0.02 -0.03" rpy="0.3 -0.4 2"'
ARM = """<robot name="arm" xmlns:pinbound="urn:pinbound:1"><link name="base"/><link name="tool">
<collision><origin xyz="0.1 0.02 -0.03" rpy="0.3 -0.4 2"/><geometry>
<mesh filename="package://quarry/pebble.obj" scale="2 -1 0.5"/></geometry></collision></link>
<joint name="q1" type="revolute"><parent link="base"/><child link="tool"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
<pinbound:annotations>{}</pinbound:annotations></robot>"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "quarry").mkdir()
    (tmp_path / "quarry" / "pebble.obj").write_text(PEBBLE)
    return tmp_path


def loaded(folder: Path, inside: str = "", **more: object) -> pb.Robot:
    file = folder / "arm.urdf"
    file.write_text(ARM.format(inside))
    return pb.load(file, package_dirs=[folder], **more)


def vertices(robot: pb.Robot, name: str = "h") -> np.ndarray:
    mark = robot.annotations.marks[name]
    assert isinstance(mark, pb.Hull)
    return np.array(mark.vertices)


def test_three_spellings_place_the_vertices_as_the_law_says(folder: Path) -> None:
    expected = (CORNERS * SCALE) @ pin.rpy.rpyToMatrix(*RPY).T + XYZ
    inline = loaded(folder, f'<pinbound:hull name="h" link="tool" {PLACED} radius="0.003"/>')
    (folder / "more.yaml").write_text(
        "hulls: [{name: h, link: tool, mesh: 'package://quarry/pebble.obj', scale: [2, -1, 0.5], "
        "xyz: [0.1, 0.02, -0.03], rpy: [0.3, -0.4, 2], radius: 0.003}]"
    )
    sidecar = loaded(folder, annotations=folder / "more.yaml")
    made = pb.Hull.of_mesh("h", "tool", "package://quarry/pebble.obj", SCALE, XYZ, RPY, 0.003, package_dirs=[folder])
    assert np.abs(vertices(inline) - expected).max() < 1e-15
    assert inline.annotations.marks["h"].vertices == sidecar.annotations.marks["h"].vertices == made.vertices
    assert inline.annotations.marks["h"].radius == sidecar.annotations.marks["h"].radius == made.radius == 0.003
    assert any("4 of 5 vertices" in note for note in inline.notes)


def test_it_holds_the_body_of_the_same_mesh(folder: Path) -> None:
    """The hull is that of the collision body, by the proof of coverage; mirrored it is another one."""
    ball = '<pinbound:point name="p" link="base" xyz="1 0 0"/><pinbound:boundary name="b" a="p" b="h"/>'
    for scale, held in (("2 -1 0.5", True), ("2 1 0.5", False)):
        hull = f'<pinbound:hull name="h" link="tool" {PLACED}/>'.replace("2 -1 0.5", scale)
        assert loaded(folder, hull + ball).coverage.links["tool"].bodies[0].is_held is held


def test_relative_names_are_beside_the_file_that_has_them(folder: Path) -> None:
    (folder / "apart").mkdir()
    (folder / "apart" / "more.yaml").write_text("hulls: [{name: h, link: tool, mesh: stone.obj}]")
    (folder / "apart" / "stone.obj").write_text(PEBBLE)
    (folder / "stone.obj").write_text(PEBBLE.replace("v 0.05", "v 0.07"))
    assert vertices(loaded(folder, annotations=folder / "apart" / "more.yaml")).max() == 0.06
    assert vertices(loaded(folder, '<pinbound:hull name="h" link="tool" mesh="stone.obj"/>')).max() == 0.07
    assert np.array(pb.Annotations.load(folder / "apart" / "more.yaml").marks["h"].vertices).max() == 0.06


def test_what_was_read_is_written_as_vertices_and_not_read_again(folder: Path) -> None:
    robot = loaded(folder, f'<pinbound:hull name="h" link="tool" {PLACED}/>')
    shutil.rmtree(folder / "quarry")
    more = pb.Annotations.of([pb.Point("p", "base", (1.0, 0.0, 0.0))], [pb.BoundaryMark("b", "p", "h")])
    for one in (robot.with_annotations(more), pickle.loads(pickle.dumps(robot)).with_annotations(more)):
        assert one.annotations.marks["h"] == robot.annotations.marks["h"]
    robot.annotations.save(folder / "kept.yaml")
    assert pb.Annotations.load(folder / "kept.yaml").marks["h"].vertices == robot.annotations.marks["h"].vertices
    assert loaded(folder, annotations=folder / "kept.yaml").boundaries is not None
    assert "mesh=" not in robot.annotations.to_xml()


@pytest.mark.parametrize(
    ("attributes", "said"),
    [
        ('mesh="package://quarry/pebbel.obj"', "the package .* has no file 'pebbel.obj'"),
        ('mesh="package://quary/pebble.obj"', "there is no package 'quary'"),
        ('mesh="https://quarry/pebble.obj"', "Nothing is read from a network"),
        ('mesh="package://quarry/broken.obj"', "the mesh of hull 'h' cannot be read: .*broken.obj"),
        ('mesh="package://quarry/pebble.obj" scale="1 0 1"', "Give factors other than zero"),
        ('mesh="package://quarry/pebble.obj" scale="1 1"', "scale of hull 'h'"),
        ('mesh="package://quarry/pebble.obj" xyz="1e90 0 0"', "Give metres"),
        ('mesh="package://quarry/pebble.obj" size="1 1 1"', "the unknown attribute 'size'.*scale"),
        ('mesh="package://quarry/pebble.obj" vertices="0 0 0"', "has vertices and a mesh"),
        ('mesh=""', r"has no mesh"),
        ('vertices="0 0 0" scale="1 1 1"', "the unknown attribute 'scale'"),
        ("", r"has no vertices.*It needs name, link, vertices \(or mesh\)"),
    ],
)
def test_each_fault_is_one_error_with_its_line(folder: Path, attributes: str, said: str) -> None:
    (folder / "quarry" / "broken.obj").write_text("v 0 0 0\nf 1 2 3\n")
    boundary = '<pinbound:point name="p" link="base" xyz="1 0 0"/>\n<pinbound:boundary name="b" a="p" b="h"/>'
    with pytest.raises(pb.InputError, match=said) as caught:
        loaded(folder, f'{boundary}\n<pinbound:hull name="h" link="tool" {attributes}/>')
    assert [problem.line for problem in caught.value.problems] == [8]


def test_a_file_is_read_once_for_each_scale(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import pinbound.meshes

    read = pinbound.meshes.read_mesh
    calls: list[object] = []
    monkeypatch.setattr(pinbound.meshes, "read_mesh", lambda *given: calls.append(given) or read(*given))
    files = HullFiles(folder / "arm.urdf", [folder])
    for xyz in ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0)):
        assert len(files.vertices("package://quarry/pebble.obj", xyz=xyz)) == 4
    files.vertices("package://quarry/pebble.obj", scale=(1.0, 1.0, -1.0))
    assert len(calls) == 2
