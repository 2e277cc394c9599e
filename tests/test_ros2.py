"""ROS 2 limits say what one joint at a time can say, and name the couplings that they lose."""

from pathlib import Path

import numpy as np
import pytest
import yaml

import pinbound as pb
from robots import joint, robot_xml


def test_limits_of_one_coordinate_each_are_sound_and_lost_couplings_are_named(
    minerva: pb.Robot, tmp_path: Path
) -> None:
    (path,) = minerva.export("ros2", tmp_path / "limits.yaml")
    text = path.read_text()
    read = yaml.safe_load(text)["joint_limits"]
    assert list(read) == ["q1", "q2", "q3"]
    several = [b for b in minerva.boundaries if len(b.coordinates) > 1]
    alone = [b for b in minerva.boundaries if len(b.coordinates) == 1]
    assert len(several) > 2
    assert len(alone) > 2
    for boundary in several:
        assert f"boundary {boundary.name} (couples {', '.join(boundary.coordinates)})" in text
    for boundary in alone:
        assert boundary.name not in text
    assert "WITHIN THESE LIMITS THE ROBOT CAN BE IN CONTACT" in text
    ends = np.array([[one["min_position"], one["max_position"]] for one in read.values()])
    Q = np.random.default_rng(0).uniform(ends[:, 0], ends[:, 1], (2000, 3))
    for column, (low, high) in enumerate(ends):  # at the very ends, too
        Q[2 * column, column], Q[2 * column + 1, column] = low, high
    assert minerva.boundaries.select([b.name for b in alone]).signed_clearances(Q).min() > 0.0
    assert not minerva.boundaries.free(Q).all(), "as the file says"
    for boundary in alone:  # nothing is given away
        column = minerva.coordinates.index(boundary.coordinates[0])
        free = boundary.limits(boundary.coordinates[0], minerva.home).around(minerva.home[column])
        assert ends[column, 0] >= free[0]
        assert ends[column, 1] <= free[1]


def test_mimic_joints_limits_and_none_at_all(tmp_path: Path) -> None:
    joints = [
        joint("a", "revolute", "base", "l1", xyz="0 0 1", limit="-1 1"),
        joint("b", "revolute", "l1", "l2", xyz="0 0 1", limit="-0.5 0.4", mimic="a -2 0.1"),
        joint("c", "continuous", "l2", "l3", xyz="0 0 1"),
        joint("d", "prismatic", "l3", "l4", xyz="0 0 1", limit="-0.1 0.3"),
    ]
    robot = pb.load(robot_xml(joints, {}, []))
    text = robot.export("ros2", tmp_path / "limits.yaml")[0].read_text()
    read = yaml.safe_load(text)["joint_limits"]
    assert read["a"]["min_position"] == pytest.approx(-0.15, abs=2e-9)
    assert read["a"]["max_position"] == pytest.approx(0.3, abs=2e-9)
    assert read["a"]["max_position"] <= 0.3
    assert read["c"] == {"has_position_limits": False}
    assert read["d"] == {"has_position_limits": True, "min_position": -0.1, "max_position": 0.3}
    assert "[rad, m]" in text
    assert "IN CONTACT" not in text
