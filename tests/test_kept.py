"""What is kept between certificates: the same answers as from the first question, and findings that are made late."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

import pinbound as pb
from pinbound.boundaries.boundary_set import BoundarySet
from pinbound.certificates.constraints import families
from pinbound.certificates.kept import tables_of
from pinbound.certificates.records import Finding, Findings

ARM = """<robot name="arm" xmlns:pinbound="urn:pinbound:1">
  <link name="base"/><link name="upper"/><link name="fore"/><link name="hand"/>
  <joint name="a" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <joint name="b" type="revolute"><parent link="upper"/><child link="fore"/><origin xyz="0.4 0 0"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <joint name="c" type="prismatic"><parent link="fore"/><child link="hand"/><origin xyz="0.3 0 0"/><axis xyz="1 0 0"/>
    <limit lower="0" upper="0.5" effort="1" velocity="1"/></joint>
  <pinbound:annotations>
    <pinbound:point name="p" link="base" xyz="-0.2 0 0.1" radius="0.05"/>
    <pinbound:point name="u" link="upper" xyz="0.1 0 0.1" radius="0.02"/>
    <pinbound:point name="h" link="hand" xyz="0.1 0 0" radius="0.05"/>
    <pinbound:boundary name="p_h" a="p" b="h"/>
    <pinbound:boundary name="p_u" a="p" b="u"/>
    <pinbound:boundary name="u_h" a="u" b="h"/>
  </pinbound:annotations>
</robot>"""


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> pb.Robot:
    path = Path(tmp_path_factory.mktemp("arm")) / "arm.urdf"
    path.write_text(ARM)
    return pb.load(path)


def resized(robot: pb.Robot, distance: float) -> pb.Robot:
    changed = [dataclasses.replace(one, min_distance=distance) for one in robot.boundaries]
    return dataclasses.replace(robot, boundaries=BoundarySet(changed, robot.coordinates, robot.linear_limits))


def test_tables_are_made_once_and_never_mistaken(arm: pb.Robot) -> None:
    chosen = tuple(arm.boundaries)
    assert tables_of(arm, chosen) is tables_of(arm, chosen)
    assert tables_of(arm, chosen[:2]) is tables_of(arm, list(chosen[:2])) is not tables_of(arm, chosen)
    other = resized(arm, 0.01)
    assert tables_of(other, tuple(other.boundaries)) is not tables_of(arm, chosen)
    for size in (1.0, 3.0):  # bounds that depend on how far q reaches are not kept from the last time
        for robot, distance in ((arm, 0.0), (other, 0.01)):
            _, one, many, _ = families(robot, tuple(robot.boundaries), np.full(3, -size), np.full(3, size))
            assert many.names == ("p_h", "u_h")
            assert one.names == ("p_u",)
            assert np.allclose(many.threshold, np.array([0.1, 0.07]) + distance)
            assert many.arms[0, 0] >= 0.4 + 0.3 + 0.1 + 0.99 * size  # what slides reaches as far as the box says


def test_a_later_question_has_the_same_answer(arm: pb.Robot) -> None:
    rng = np.random.default_rng(3)
    for _ in range(4):
        motion = np.column_stack([rng.uniform(-1, 1, (3, 2)), rng.uniform(0, 0.5, 3)])
        first, again = pb.certify(arm, motion, each=True), pb.certify(arm, motion, each=True)
        assert first.verdict is again.verdict
        assert np.array_equal(first.boundaries.lower, again.boundaries.lower)
        alone = pb.certify(arm, motion, boundaries=["u_h"], each=True)
        assert alone.boundaries[0].lower == pytest.approx(first.boundaries[2].lower, abs=1e-9)


def test_findings_are_a_sequence_in_the_order_of_the_robot(arm: pb.Robot) -> None:
    big = resized(arm, 0.12)
    found = pb.certify(big, [[0.0, 0.0, 0.0], [2.8, 2.9, 0.1]])
    assert found.verdict is pb.Verdict.VIOLATED
    boundaries = found.boundaries
    assert isinstance(boundaries, Findings)
    assert [one.name for one in boundaries] == list(arm.boundaries.names)
    assert all(isinstance(one, Finding) for one in boundaries)
    assert boundaries[-1].name == "u_h"
    assert [one.name for one in boundaries[1:]] == ["p_u", "u_h"]
    with pytest.raises(IndexError):
        boundaries[3]
    for one in boundaries:
        assert (one.contact is not None) == (one.verdict is pb.Verdict.VIOLATED)
        if one.contact is not None:
            value = big.boundaries[one.name].signed_clearance(one.contact.q)
            assert value < 0.0
            assert one.contact.clearance == pytest.approx(value, abs=1e-9)
    assert found.lower == min(one.lower for one in boundaries)
    with pytest.raises(ValueError, match="read-only"):
        boundaries.lower[0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        boundaries[0].q[0] = 1.0
