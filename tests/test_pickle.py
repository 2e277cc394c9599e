"""Robots, boundary sets and regions can be sent to other processes."""

import pickle

import numpy as np
import pytest

import pinbound as pb


def test_a_robot_and_its_region_survive_pickling(minerva: pb.Robot) -> None:
    region = pb.feasible_region(minerva)
    robot, sent = pickle.loads(pickle.dumps((minerva, region)))
    Q = np.random.default_rng(0).uniform(-2, 2, (200, 3))
    assert np.array_equal(sent.contains(Q), region.contains(Q))
    before, after = (one.boundaries.norms(Q, backend="numpy") for one in (minerva, robot))
    assert np.array_equal(before, after)
    assert robot.model.nq == 11
    with pytest.raises(pb.UnsupportedError, match="compute the region again"):
        sent.components  # noqa: B018
