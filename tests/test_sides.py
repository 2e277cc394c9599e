"""The far side of a strip: what is said without the strips is what their isolation says."""

from pathlib import Path

import numpy as np
import pytest

import pinbound as pb
from pinbound.certificates import sides
from pinbound.certificates.kept import tables_of

DOOR = """<robot name="door" xmlns:pinbound="urn:pinbound:1">
  <link name="base"/><link name="door"/>
  <joint name="hinge" type="revolute"><parent link="base"/><child link="door"/><axis xyz="0 0 1"/>
    <limit lower="-7" upper="7" effort="1" velocity="1"/></joint>
  <pinbound:annotations>
    <pinbound:home hinge="HOME"/>
    <pinbound:box name="post" link="base" xyz="0 0.5 0" rpy="0 0 0" size="0.1 0.1 0.3"/>
    <pinbound:box name="leaf" link="door" xyz="0.5 0 0" rpy="0 0 0.1" size="0.6 0.04 0.2"/>
    <pinbound:boundary name="post_leaf" a="post" b="leaf"/>
  </pinbound:annotations>
</robot>"""


@pytest.mark.parametrize("home", [0.0, -2.0, 4.0])
def test_the_way_from_home_says_what_the_strips_say(tmp_path: Path, home: float) -> None:
    path = tmp_path / "door.urdf"
    path.write_text(DOOR.replace("HOME", str(home)))
    robot = pb.load(path)
    boundary, tables = robot.boundaries[0], tables_of(robot, tuple(robot.boundaries))
    said: list[bool] = []
    for q in np.linspace(-6.5, 6.5, 27):
        if boundary.signed_clearance([q]) > 1e-3:
            said.append(bool(sides.far_sides(tables, robot.boundaries.names, np.array([q]))))
            assert said[-1] == boundary.parts(robot.home, np.array([q]))
    assert any(said)
    assert not all(said)


def test_strips_are_not_isolated_where_the_way_is_proven(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "door.urdf"
    path.write_text(DOOR.replace("HOME", "0.0"))
    robot = pb.load(path)
    tables = tables_of(robot, tuple(robot.boundaries))
    monkeypatch.setattr(type(robot.boundaries[0]), "contacts", property(lambda _: pytest.fail("strips were isolated")))
    assert sides.far_sides(tables, robot.boundaries.names, np.array([0.4])) == ()
    assert sides.far_sides(tables, robot.boundaries.names, np.array([3.5])) == ("post_leaf",)
