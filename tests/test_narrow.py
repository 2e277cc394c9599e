"""Pairs of marks that are judged together are judged as each would be by its own path."""

from collections.abc import Callable
from itertools import combinations

import numpy as np
import pytest

from pinbound.annotations import Mark, Point, Segment, Sweep
from pinbound.coverage.poses import Poses
from pinbound.coverage.reach import Reach, least_separation
from pinbound.evaluate.separation import separations
from pinbound.marking.narrow import Links, Pair
from pinbound.path.relative import relative_path
from pinbound.robot.robot import Robot
from robots import ARM, joint, robot_xml

Load = Callable[[str], Robot]

PLANAR = [
    joint("q1", "revolute", "base", "a", xyz="0 0 0.1"),
    joint("q2", "revolute", "a", "b", xyz="0 0 0.4"),
    joint("q3", "revolute", "b", "c", xyz="0 0.05 0.3", axis="1 0 0"),
    joint("s", "prismatic", "c", "d", xyz="0 0 0.1", axis="1 0 0", limit="0 0.2"),
    joint("q4", "revolute", "d", "e", xyz="0 0 0.2", axis="0 0 1"),
]


def marks_on(link: str, rng: np.random.Generator) -> list[Mark]:
    """Return marks of several kinds, some of them on the axes of joints."""
    off, at = rng.normal(scale=0.1, size=(2, 3)).tolist()
    box = Sweep("box", link, tuple(at), ((0.1, 0.0, 0.0), (0.0, 0.1, 0.0), (0.0, 0.0, 0.1)), 0.01)
    return [
        Point("on", link, (0.0, 0.0, 0.0), 0.05),
        Point("up", link, (0.0, 0.0, 0.2), 0.1),
        Point("off", link, tuple(off), 0.2),
        Segment("along", link, (0.0, -0.05, 0.0), (0.0, 0.05, 0.0), 0.02),
        *([box] if link in ("base", "c") else []),
    ]


@pytest.mark.parametrize("joints", [ARM, PLANAR], ids=["spatial", "planar, slides"])
def test_pairs_are_judged_together_as_each_by_its_own_path(load_text: Load, joints: list[str]) -> None:
    robot, rng = load_text(robot_xml(joints, {}, [])), np.random.default_rng(3)
    Q = rng.uniform(-1.5, 1.5, (20, len(robot.coordinates)))
    poses = Poses(robot.tree, robot.coupling, Q)
    marks = {link: marks_on(link, rng) for link in robot.tree.links}
    wide = rng.uniform(-7.0, 7.0, (60, len(robot.coordinates)))
    kinds = {"apart": 0, "touching": 0, "clear": 0}
    for a, b in ((a, b) for (i, a), (j, b) in combinations(enumerate(marks), 2) if j > i + 1):  # no neighbours
        links = Links(robot, a, b, Q, poses)
        for (one, two), judged in links.judged(marks[a], marks[b]).items():
            alone = links._judged(one, two)
            path = relative_path(robot.tree, robot.coupling, one, two)
            seen = separations(path, wide).min() - one.shape.radius - two.shape.radius
            if isinstance(judged, Pair):
                assert isinstance(alone, Pair), (one, two)  # no proof is lost
                assert np.array_equal(judged.contact, alone.contact)
                assert (judged.always is None) == (alone.always is None)
                kinds["touching" if np.any(judged.contact) else "clear"] += 1
            else:
                assert 0.0 < judged <= seen, (one, two)
                assert isinstance(alone, Pair) or alone <= seen
                kinds["apart"] += 1
    assert min(kinds.values()) >= 4, kinds


def test_what_an_open_chain_leaves_to_a_pairs_own_is_said(load_text: Load) -> None:
    """Where `is_all` says so, a pair's own path proves no more than the open chain."""
    robot, rng = load_text(robot_xml(ARM, {}, [])), np.random.default_rng(4)
    own = 0
    for a, b in [("base", "b"), ("base", "d"), ("a", "c"), ("b", "d")]:
        reach = Reach(robot.tree, robot.coupling, a, b)
        ones, others = marks_on(a, rng), marks_on(b, rng)
        gaps, is_all = reach.gaps(ones, others), reach.is_all(ones, others)
        for (i, one), (j, other) in ((x, y) for x in enumerate(ones) for y in enumerate(others)):
            radii = one.shape.radius + other.shape.radius
            alone = least_separation(relative_path(robot.tree, robot.coupling, one, other)) - radii
            if is_all[i, j]:
                assert alone == pytest.approx(gaps[i, j], abs=1e-9)
            else:
                own += alone > gaps[i, j] + 1e-3
    assert own > 0  # marks on an axis do have shorter chains
