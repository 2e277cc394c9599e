"""What is proven to overlap always does so at every angle; what is only seen to is not called proven."""

from collections.abc import Callable

import numpy as np
import pytest

import pinbound as pb
from pinbound.annotations import Box, Hull, Mark, Point, Segment
from pinbound.evaluate import depth
from pinbound.marking.always import overlap_everywhere
from pinbound.path.relative import relative_path
from robots import joint, robot_xml
from test_marking import ball, block, reason_of, urdf

Load = Callable[..., pb.Robot]

WRIST = [
    joint("q1", "continuous", "base", "a", axis="0 0 1", xyz="0 0 0.3"),
    joint("q2", "continuous", "a", "b", axis="0 1 0", xyz="0.05 0 0.2", rpy="0.3 0 0.2"),
    joint("q3", "continuous", "b", "c", axis="1 0 0", xyz="0 0.02 0.1"),
]
OCTAHEDRON = tuple(tuple(float(x) for x in row) for row in np.vstack((np.eye(3), -np.eye(3))) * 0.3)


def about(link: str) -> list[Mark]:
    return [
        Point("p", link, (0.0, 0.0, 0.0), 0.31),
        Segment("s", link, (0.0, -0.2, -0.1), (0.1, 0.3, 0.1), 0.2),
        Box("b", link, (0.0, 0.0, 0.1), (0.1, 0.2, 0.3), (0.5, 0.6, 0.7)),
        Hull("h", link, OCTAHEDRON, 0.1),
        Hull("flat", link, ((0.2, 0.2, 0.0), (-0.3, 0.1, 0.0), (0.0, -0.3, 0.0)), 0.15),
    ]


@pytest.mark.parametrize("end", ["b", "c"])
def test_the_bound_is_below_the_overlap_at_every_angle(load_text: Load, end: str) -> None:
    robot = load_text(robot_xml(WRIST, {}, []))
    Q = np.random.default_rng(3).uniform(-np.pi, np.pi, (12, 3))
    proven = 0
    for one in about("base"):
        for other in about(end)[::2]:
            found = overlap_everywhere(robot.tree, robot.coupling, one, other)
            path = relative_path(robot.tree, robot.coupling, one, other)
            deep = -depth.signed_distances(path, one.shape.radius + other.shape.radius, Q).max()
            if found is not None:
                proven += 1
                assert 0.0 < found <= deep + 1e-9, (one.name, other.name)
    assert proven >= 3


def test_one_turn_about_a_common_axis_is_proven_though_the_bodies_are_eccentric(load_text: Load) -> None:
    """Both hold a piece of the joint's axis, and nothing else in common."""
    robot = load_text(robot_xml(WRIST[:1], {}, []))
    one = Box("one", "base", (0.2, 0.0, 0.3), (0.0, 0.0, 0.0), (0.5, 0.1, 0.2))
    other = Hull("other", "a", ((-0.02, 0, 0), (0.3, 0.3, 0), (0.3, -0.3, 0), (0.3, 0, 0.3), (0.3, 0, -0.3)))
    found = overlap_everywhere(robot.tree, robot.coupling, one, other)
    assert found is not None
    assert 0.0 < found < 0.1


def test_what_parts_at_one_angle_is_not_proven(load_text: Load) -> None:
    robot = load_text(robot_xml(WRIST[:1], {}, []))
    one, other = Point("one", "base", (0.1, 0.0, 0.3), 0.06), Point("other", "a", (0.1, 0.0, 0.0), 0.06)
    assert overlap_everywhere(robot.tree, robot.coupling, one, other) is None  # 0.2 m apart at pi, radii 0.12
    nearly = Point("other", "a", (0.0199, 0.0, 0.0), 0.06)
    assert overlap_everywhere(robot.tree, robot.coupling, one, nearly) == pytest.approx(0.0001, abs=1e-6)
    assert overlap_everywhere(robot.tree, robot.coupling, one, Point("other", "a", (0.0201, 0.0, 0.0), 0.06)) is None


def test_sliding_links_are_never_proven(load_text: Load) -> None:
    robot = load_text(robot_xml([joint("q1", "prismatic", "base", "a", limit="-0.001 0.001")], {}, []))
    marks = Point("one", "base", (0.0, 0.0, 0.0), 1.0), Point("other", "a", (0.0, 0.0, 0.0), 1.0)
    assert overlap_everywhere(robot.tree, robot.coupling, *marks) is None


def test_a_proposal_says_proof_where_there_is_one_and_samples_where_there_is_none(load_text: Load) -> None:
    """Two blocks about one wrist overlap always; two that overlap within the joint limits only are seen to."""
    links = {"base": ball(0.2, "0 0 0.4"), "a": "", "b": ball(0.2)}
    joints = [joint("q1", "revolute", "base", "a", xyz="0 0 0.3"), joint("q2", "revolute", "a", "b", xyz="0 0 0.1")]
    proven = pb.propose_marks(load_text(urdf(links, joints)))
    assert reason_of(proven, "base", "b") == ["always overlap"]
    assert proven.evidence["base", "b", "always overlap"].basis == "proof"
    narrow = [
        joint("q1", "revolute", "base", "a", xyz="0 0 0.3", limit="-0.1 0.1"),
        joint("q2", "revolute", "a", "b", xyz="0 0 0.1", limit="-0.1 0.1"),
    ]
    beside = {"base": block("1 0.2 0.2", "0.5 0 0.4"), "a": "", "b": block("0.2 0.1 0.1", "0.4 0 0")}
    seen = pb.propose_marks(load_text(urdf(beside, narrow)))
    (reason,) = reason_of(seen, "base", "b")
    assert reason.startswith("in contact in all of")
    found = seen.evidence["base", "b", reason]
    assert (found.basis, found.q) == ("samples", None)
    assert "not proven" in found.text
