"""Marks that move from call to call: where they are now, they are as if they had been there in the file."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import pinbound as pb
from pinbound.robot.moving import moved_mark
from robots import robot_xml
from test_steps import JOINTS

MARKS = [
    pb.Point("point", "base", (0.4, 0.1, 0.2), 0.05),
    pb.Segment("segment", "base", (0.4, 0.1, 0.2), (0.5, 0.3, 0.2), 0.02),
    pb.Sweep("sweep", "base", (0.4, 0.1, 0.2), ((0.1, 0, 0), (0, 0.1, 0.05)), 0.0),
    pb.Line("line", "base", (0.6, 0.1, 0.2), (0.1, 1.0, 0.3), 0.02),
    pb.Plane("plane", "base", (0.0, 0.0, -0.6), (0.1, 0.2, 1.0)),
    pb.Hull("hull", "base", ((0.4, 0, 0), (0.5, 0.1, 0), (0.4, 0.2, 0.1), (0.4, 0.1, 0.3))),
    pb.Box("box", "base", (0.6, 0.1, 0.2), (0.1, 0.2, 0.3), (0.1, 0.2, 0.3), 0.01),
    pb.Cylinder("cylinder", "base", (0.6, 0.1, 0.2), (0.7, 0.3, 0.2), 0.05),
]
TOOL = [pb.Segment("fore", "l5", (0.0, 0.0, 0.0), (0.3, 0.0, 0.1), 0.03)]
PAIRS = [pb.BoundaryMark(mark.name, "fore", mark.name, 0.01) for mark in MARKS]
POSE = pin.SE3(pin.rpy.rpyToMatrix(0.3, -0.4, 1.1), np.array([0.2, -0.3, 0.4]))


def robot() -> pb.Robot:
    return pb.load(robot_xml(JOINTS, {}, [])).with_annotations(pb.Annotations.of(TOOL, []))


def test_a_moved_mark_is_its_vertices_moved() -> None:
    for mark in MARKS:
        before, after = mark.shape, moved_mark(mark, POSE.homogeneous).shape
        where = np.sort((before.vertices @ POSE.rotation.T + POSE.translation).round(12), axis=0)
        if isinstance(mark, pb.Cylinder):  # another prism of 24 sides around the same cylinder
            middle = before.vertices.mean(axis=0) @ POSE.rotation.T + POSE.translation
            assert np.allclose(after.vertices.mean(axis=0), middle)
            assert np.linalg.norm(after.vertices - middle, axis=1) == pytest.approx(
                np.linalg.norm(before.vertices - before.vertices.mean(axis=0), axis=1)
            )
            continue
        assert np.allclose(np.sort(after.vertices.round(12), axis=0), where, atol=1e-11)
        assert after.radius == before.radius
        if before.normal is not None:
            assert np.allclose(after.normal, POSE.rotation @ before.normal)


def test_distances_at_a_pose_are_those_of_the_robot_moved_the_other_way() -> None:
    """Of a tree whose root is the other way: the world's marks stand still, the robot's base is moved back."""
    arm, moving = robot(), pb.MovingMarks(robot(), MARKS, PAIRS)
    Q = np.random.default_rng(0).uniform(-1, 1, (12, len(arm.coordinates)))
    found = moving.at(dict.fromkeys([mark.name for mark in MARKS], POSE.homogeneous)).signed_clearances(Q)
    inverse = POSE.inverse()
    rpy = " ".join(map(repr, pin.rpy.matrixToRpy(inverse.rotation).tolist()))
    xyz = " ".join(map(repr, inverse.translation.tolist()))
    fixed = (
        f'<joint name="place" type="fixed"><parent link="root"/><child link="base"/><origin xyz="{xyz}" rpy="{rpy}"/>'
    )
    text = robot_xml(JOINTS, {}, []).replace("</robot>", f'<link name="root"/>{fixed}</joint></robot>')
    other = pb.load(text, annotations=pb.Annotations.of(TOOL, []))
    still = [replace(mark, link="root") for mark in MARKS]
    expected = pb.MovingMarks(other, still, PAIRS).at({}).signed_clearances(Q)
    assert np.abs(found - expected)[:, :-1].max() < 1e-12
    assert np.abs(found - expected)[:, -1].max() < MARKS[-1].excess  # a prism that is turned about its axis


def test_unmoved_they_are_what_annotations_say_and_nothing_is_made_again() -> None:
    arm = robot()
    moving = pb.MovingMarks(arm, MARKS[:2], PAIRS[:2])
    fixed = arm.with_annotations(pb.Annotations.of(MARKS[:2], PAIRS[:2])).boundaries
    Q = np.random.default_rng(1).uniform(-1, 1, (20, len(arm.coordinates)))
    first = moving.at({})
    assert np.array_equal(first.signed_clearances(Q), fixed.signed_clearances(Q))
    assert np.allclose(first.signed_gradients(Q), fixed.signed_gradients(Q), atol=1e-14)
    assert np.array_equal(first.free(Q), fixed.free(Q))
    again = moving.at({"point": POSE.homogeneous})
    assert again["segment"] is first["segment"]
    assert again["point"] is not first["point"]
    assert moving.at({"point": POSE.homogeneous.copy()})["point"] is again["point"]


def test_contact_at_home_is_an_answer_and_no_fault() -> None:
    arm = robot()
    moving = pb.MovingMarks(arm, MARKS[:1], PAIRS[:1])
    tip = arm.positions("l5", arm.home)
    pose = np.eye(4)
    pose[:3, 3] = tip - np.array(MARKS[0].xyz)
    assert not moving.at({"point": pose}).free(arm.home)
    assert moving.at({"point": pose}).signed_clearances(arm.home)[0] < 0.0


def test_what_cannot_move_is_refused() -> None:
    arm = robot()
    for marks, pairs, said in (
        ([pb.Point("p", "l1", (0, 0, 0))], [], "put it on the root link, 'base'"),
        ([pb.Point("fore", "base", (0, 0, 0))], [], "give it another name"),
        (MARKS[:1], [pb.BoundaryMark("b", "fore", "nothing")], "nothing"),
        (MARKS[:2], [pb.BoundaryMark("b", "point", "segment")], "name one of each"),
        (MARKS[:1], [pb.BoundaryMark("b", "fore", "point", stop=True)], "name one of each"),
    ):
        with pytest.raises(pb.PinboundError, match=said):
            pb.MovingMarks(arm, marks, pairs)
    moving = pb.MovingMarks(arm, MARKS[:1], PAIRS[:1])
    with pytest.raises(pb.UnknownNameError, match="mark that moves"):
        moving.at({"pont": np.eye(4)})
    for pose, said in (
        (np.eye(3), "shape"),
        (np.diag([1.0, 1.0, 2.0, 1.0]), "is not a rotation"),
        (np.diag([1.0, 1, -1, 1]), "is not a rotation"),
    ):
        with pytest.raises(pb.DimensionError, match=said):
            moving.at({"point": pose})
