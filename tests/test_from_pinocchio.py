"""A robot from a Pinocchio model and its geometry is the robot of its URDF; what they do not say is refused by name."""

import re
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin
import pytest

import pinbound as pb
from robots import joint

BODIES = """
<link name="base"><collision><geometry><box size="0.2 0.3 0.1"/></geometry></collision></link>
<link name="l1"><collision name="rod"><origin xyz="0 0 0.2" rpy="0.1 0.2 0.3"/><geometry>
<cylinder radius="0.05" length="0.3"/></geometry></collision></link>
<link name="tool"><collision><origin xyz="0.1 0 0"/><geometry><sphere radius="0.04"/></geometry></collision></link>
<link name="l2"/><link name="l3"/><link name="l4"/>
"""
JOINTS = [
    joint("a", "revolute", "base", "l1", axis="0 0.6 0.8", xyz="0 0 0.3", rpy="0.1 0.2 0.3", limit="-1 2"),
    joint("w", "fixed", "l1", "tool", axis="1 0 0", xyz="0.1 0.2 0.3", rpy="0.3 0 0.1"),
    joint("b", "continuous", "tool", "l2", axis="0 0 1", xyz="0.1 0 0.2"),
    joint("c", "prismatic", "l2", "l3", axis="1 0 1", xyz="0 0 0.4", limit="-0.2 0.3"),
    joint("d", "revolute", "l3", "l4", axis="0 1 0", xyz="0.2 0 0", mimic="a -0.5 0.25"),
]
TEXT = f'<robot name="zoo">{BODIES}{re.sub(r"<link .*?/>", "", "".join(JOINTS))}</robot>'
MARKS = pb.Annotations.of(
    [pb.Point("p", "base", (0.5, 0.1, 0.2)), pb.Point("s", "l4", (0.1, 0.0, 0.1), 0.02)],
    [pb.BoundaryMark("b1", "p", "s")],
)


def built(flies: bool = False) -> tuple[Any, Any]:
    root = [pin.JointModelFreeFlyer()] if flies else []
    model = pin.buildModelFromXML(TEXT, *root, mimic=True)
    return model, pin.buildGeomFromUrdfString(model, TEXT, pin.GeometryType.COLLISION)


@pytest.mark.parametrize("flies", [False, True])
def test_a_model_is_the_robot_of_its_urdf(flies: bool) -> None:
    model, geometry = built(flies)
    made, expected = pb.from_pinocchio(model, geometry, MARKS), pb.load(TEXT, annotations=MARKS)
    assert made.coordinates == expected.coordinates
    assert np.array_equal(made.lower, expected.lower)
    assert np.array_equal(made.upper, expected.upper)
    assert np.array_equal(made.coupling.S, expected.coupling.S)
    Q = np.random.default_rng(0).uniform(-2, 2, (50, len(made.coordinates)))
    assert np.abs(made.boundaries.norms(Q) - expected.boundaries.norms(Q)).max() < 1e-13
    found, wanted = (pb.propose_marks(robot).annotations for robot in (made, expected))
    assert sorted(found.marks) == sorted(wanted.marks)
    both = [
        pb.from_pinocchio(model, geometry, found).boundaries,
        pb.load(TEXT, annotations=wanted).boundaries,
    ]
    assert both[0].names == both[1].names
    assert np.abs(both[0].signed_clearances(Q) - both[1].signed_clearances(Q)).max() < 1e-12


def test_a_reduced_model_has_fixed_joints_where_it_locks_them() -> None:
    model, _ = built()
    full = pb.from_pinocchio(model, annotations=MARKS)
    q = np.array([0.3, 0.7, 0.1])
    locked = pin.buildReducedModel(model, [model.getJointId("b")], full.to_pinocchio(model, q))
    made = pb.from_pinocchio(locked, annotations=MARKS)
    assert made.coordinates == ("a", "c")
    assert made.boundaries.norms(q[[0, 2]]) == pytest.approx(full.boundaries.norms(q), abs=1e-13)


def test_a_capsule_stays_one_and_meshes_keep_their_file(tmp_path: Path) -> None:
    model, geometry = built()
    frame = model.getFrameId("l2")
    parent = model.frames[frame].parentJoint
    place = pin.SE3(np.eye(3), np.array([0.0, 0.1, 0.2]))
    geometry.addGeometryObject(pin.GeometryObject("cap", parent, frame, place, coal.Capsule(0.03, 0.2)))
    mesh = tmp_path / "one.stl"
    corners = [(0, 0, 0), (0.1, 0, 0), (0, 0.1, 0), (0, 0, 0.1)]
    faces = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    mesh.write_text(
        "solid x\n"
        + "".join(
            "facet normal 0 0 0\nouter loop\n"
            + "".join("vertex {} {} {}\n".format(*corners[k]) for k in face)
            + "endloop\nendfacet\n"
            for face in faces
        )
        + "endsolid x\n"
    )
    loaded = pin.GeometryObject("hand", parent, frame, place, coal.MeshLoader().load(str(mesh), np.ones(3)))
    loaded.meshPath, loaded.meshScale = str(mesh), np.array([1.0, 2.0, 1.0])
    geometry.addGeometryObject(loaded)
    robot = pb.from_pinocchio(model, geometry)
    marks = pb.propose_marks(robot).annotations.marks
    segment = next(mark for mark in marks.values() if mark.link == "l2" and isinstance(mark, pb.Segment))
    assert np.allclose(sorted(end[2] for end in (segment.xyz_a, segment.xyz_b)), [0.1, 0.3])
    assert segment.radius == pytest.approx(0.03)
    assert robot.document.root.find(".//mesh").get("scale") == "1.0 2.0 1.0"


def test_what_a_model_does_not_determine_is_refused_by_name() -> None:
    model, geometry = built()
    frame = model.getFrameId("l2")
    cone = pin.GeometryObject("horn", model.frames[frame].parentJoint, frame, pin.SE3.Identity(), coal.Cone(0.1, 0.2))
    geometry.addGeometryObject(cone)
    with pytest.raises(pb.UnsupportedError, match="'horn' is a Cone: the model does not say"):
        pb.from_pinocchio(model, geometry)
    ball = pin.Model()
    ball.addJoint(0, pin.JointModelSpherical(), pin.SE3.Identity(), "shoulder")
    with pytest.raises(pb.UnsupportedError, match="no body frames"):
        pb.from_pinocchio(ball)
    text = TEXT.replace('name="b" type="continuous"', 'name="b" type="floating"')
    with pytest.raises(pb.UnsupportedError, match="joint 'b' is a JointModelFreeFlyer, of 6 degrees of freedom"):
        pb.from_pinocchio(pin.buildModelFromXML(text))
    lonely = pin.buildModelFromXML(TEXT)
    lonely.addFrame(pin.Frame("extra", 1, 2, pin.SE3.Identity(), pin.FrameType.BODY))
    with pytest.raises(pb.UnsupportedError, match="'l1', 'extra' hang on one joint"):
        pb.from_pinocchio(lonely)
