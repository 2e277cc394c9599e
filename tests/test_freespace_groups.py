"""Groups of pairs: what a group says from below holds of every pair in it, and every pair is in one root."""

from pathlib import Path

import numpy as np

from pinbound.freespace.pairs import Pairs
from robots import ARM, robot_xml
from test_polytope import load, marks


def test_a_groups_bound_holds_of_its_pairs(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    points = [(f"a{k}", "a", " ".join(map(str, rng.uniform(-0.2, 0.2, 3))), 0.01 * (k + 1)) for k in range(4)]
    points += [(f"d{k}", "d", " ".join(map(str, rng.uniform(0.3, 0.6, 3))), 0.005 * (k + 1)) for k in range(5)]
    pairs = [(f"a{i}", f"d{k}") for i in range(4) for k in range(5)]
    robot = load(robot_xml(ARM, {}, [], marks(points, pairs)), tmp_path)
    found = Pairs(robot, list(robot.boundaries), robot.lower, robot.upper)
    groups = found.groups
    assert sorted(pair for root in groups.roots for pair in groups.members[root]) == list(range(len(pairs)))
    assert len(groups.roots) < len(pairs)
    rotations = [one.path.minimal.rotations for one in found.boundaries]
    assert {chain.rotations for chain in groups.chains} < set(range(1, max(rotations)))
    nodes = np.arange(len(groups.pair))
    assert all(
        sorted(groups.members[node])
        == sorted(one for half in groups.halves[node] if half >= 0 for one in groups.members[half])
        for node in nodes[len(pairs) :]
    )
    for _ in range(20):
        centre = rng.uniform(robot.lower, robot.upper)
        half = rng.uniform(0.0, 0.2, len(centre))
        bound = found.bound_nodes(nodes, np.tile(centre, (len(nodes), 1)), np.tile(half, (len(nodes), 1)))
        Q = centre + rng.uniform(-1.0, 1.0, (50, len(centre))) * half
        most = robot.boundaries.signed_clearances(Q).max(axis=0)
        assert np.all(bound.upper[: len(pairs)] >= most[[robot.boundaries.names.index(n) for n in found.names]] - 1e-12)
        least = robot.boundaries.signed_clearances(Q).min(axis=0)
        column = {name: k for k, name in enumerate(robot.boundaries.names)}
        clearances = np.array([least[column[name]] for name in found.names])
        for node in nodes:
            members = list(groups.members[node])
            assert bound.lower[node] <= clearances[members].min() + 1e-12
    assert np.all(groups.extra[len(pairs) :] > 0.0)
