"""Pairs of spheres that never meet: nothing within the limits brings a dropped pair near, and most are found."""

from typing import Any

import numpy as np
import pytest

from pinbound.kernel.ball_pruning import Window, meeting, with_pairs
from pinbound.kernel.balls import BallTree, Node

NO_END = np.inf


def tree_of_arm(seed: int, skew: bool) -> BallTree:
    """A chain of four rotations, one of them of two coordinates, with a branch and spheres on all nodes."""
    rng = np.random.default_rng(seed)

    def node(above: int, angle: int, depth: int) -> Node:
        axis = rng.normal(size=3) if skew else np.eye(3)[rng.integers(3)] * rng.choice([-1.0, 1.0])
        return Node(above, rng.uniform(-0.3, 0.3, 3), (), angle, axis / np.linalg.norm(axis), depth, 1.0)

    angles = [(1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, -1.0, 0.5, 0.0), (0.0, 0.0, 0.0, 1.0)]
    root = Node(0, np.zeros(3), (), -1, np.array([0.0, 0.0, 1.0]), 0, 0.0)
    nodes = [root, node(0, 0, 1), node(1, 1, 2), node(2, 2, 3), node(2, 3, 3), node(3, -1, 3)]
    balls = [(int(host), rng.uniform(-0.15, 0.15, 3)) for host in np.repeat(np.arange(6), 5)]
    ends = [(a, b) for a in range(30) for b in range(a) if balls[a][0] != balls[b][0]]
    rng.shuffle(ends)
    thresholds = rng.uniform(0.02, 0.15, len(ends))
    return BallTree(4, angles, nodes, balls, np.array(ends), thresholds, 1.5)


def distances(tree: BallTree, Q: Any) -> Any:
    places = tree.places(Q)
    return np.linalg.norm(places[tree.ends[:, 0]] - places[tree.ends[:, 1]], axis=1)


LIMITS = {
    "none": (np.full(4, -NO_END), np.full(4, NO_END)),
    "narrow": (np.array([-0.4, -0.2, -0.3, 0.1]), np.array([0.3, 0.5, 0.1, 0.9])),
    "across the turn": (np.array([2.0, -4.0, -1.0, 2.9]), np.array([4.5, -2.0, 0.5, 3.9])),
    "one end": (np.array([-NO_END, -1.0, -NO_END, -3.14]), np.array([0.0, 1.0, NO_END, 3.14])),
}


@pytest.mark.parametrize("skew", [False, True])
@pytest.mark.parametrize("limits", LIMITS.values(), ids=LIMITS.keys())
def test_no_dropped_pair_meets_and_windows_hold_all_contacts(limits: tuple[Any, Any], skew: bool) -> None:
    low, high = limits
    tree = tree_of_arm(5, skew)
    kept, windows = meeting(tree, low, high)
    ends = np.maximum(low, -7.0), np.minimum(high, 7.0)
    Q = np.random.default_rng(1).uniform(*ends, (4000, 4))
    corners = np.array(np.meshgrid(*np.stack(ends, axis=1), indexing="ij")).reshape(4, -1).T
    Q = np.concatenate((Q, corners))
    near = distances(tree, Q) <= tree.thresholds[:, None]
    assert not np.any(near[~kept])
    assert 0 < np.count_nonzero(~kept) < len(kept)
    assert windows
    for window in windows.values():
        met = near[window.pairs]
        cells = window.cells(tree, Q)
        assert not np.any(met & ~window.near[:, cells])
        assert np.array_equal(window.near.any(axis=1), kept[window.pairs])


def test_most_pairs_that_never_meet_are_found_where_few_angles_are_between_them() -> None:
    tree = tree_of_arm(5, True)
    low, high = LIMITS["narrow"]
    kept, _ = meeting(tree, low, high)
    Q = np.random.default_rng(2).uniform(low, high, (4000, 4))
    clear = distances(tree, Q).min(axis=1) > tree.thresholds + 0.02
    between = np.array([_rotations(tree, *pair) for pair in tree.ends.tolist()])
    assert np.count_nonzero(clear & (between <= 3)) > 50
    hosts = np.array([node for node, _ in tree.balls])[tree.ends].max(axis=1)
    turns = np.array([node.angle >= 0 for node in tree.nodes])[hosts]
    some = clear & turns & (between <= 3)
    assert np.mean(~kept[some]) > 0.8
    assert np.all(kept[between > 3])  # nothing is claimed of them


def _rotations(tree: BallTree, a: int, b: int) -> int:
    above, below = tree.apart(tree.balls[a][0], tree.balls[b][0])
    return sum(tree.nodes[i].angle >= 0 for i in (*above, *below))


def test_two_circles_are_as_far_apart_as_geometry_says() -> None:
    """Both spheres turn about the z axis, 0.3 m and 0.5 m from it: 0.2 m apart where no limit keeps them apart."""
    root = Node(0, np.zeros(3), (), -1, np.array([0.0, 0.0, 1.0]), 0, 0.0)
    turn = Node(0, np.zeros(3), (), 0, np.array([0.0, 0.0, 1.0]), 1, 0.0)
    balls = [(0, np.array([0.3, 0.0, 0.0])), (1, np.array([0.5, 0.0, 0.0]))]
    for low, high, gap in (
        (-NO_END, NO_END, 0.2),
        (0.5, 1.0, float(np.hypot(0.5 * np.cos(0.5) - 0.3, 0.5 * np.sin(0.5)))),
        (0.5, 2.0 * np.pi - 0.25, float(np.hypot(0.5 * np.cos(0.25) - 0.3, 0.5 * np.sin(0.25)))),
        (np.pi, np.pi, 0.8),
    ):
        for threshold, meets in ((gap - 1e-4, False), (gap + 1e-4, True)):
            tree = BallTree(1, [(1.0,)], [root, turn], balls, np.array([[0, 1]]), np.array([threshold]), 1.0)
            kept, windows = meeting(tree, np.array([low]), np.array([high]))
            assert kept.tolist() == [meets]
            assert not windows  # no angle but the last: no cells


def test_a_tree_of_some_pairs_has_their_balls() -> None:
    tree = tree_of_arm(3, False)
    kept = np.arange(len(tree.ends)) % 7 == 2
    part = with_pairs(tree, kept)
    Q = np.random.default_rng(4).uniform(-2, 2, (20, 4))
    assert np.allclose(distances(part, Q), distances(tree, Q)[kept], rtol=0, atol=1e-15)
    assert np.array_equal(part.thresholds, tree.thresholds[kept])
    none = with_pairs(tree, np.zeros(len(tree.ends), dtype=np.bool_))
    assert not none.balls
    assert none.ends.shape == (0, 2)


def test_windows_know_their_pairs_by_their_new_numbers() -> None:
    tree = tree_of_arm(5, True)
    kept, windows = meeting(tree, *LIMITS["narrow"])
    numbers = np.flatnonzero(kept)
    for window in windows.values():
        new = window.of_kept(kept)
        assert np.array_equal(numbers[new.pairs], window.pairs[kept[window.pairs]])
        assert np.array_equal(new.near, window.near[kept[window.pairs]])
        for number in new.pairs.tolist()[:3]:
            assert np.array_equal(new.near_any([number]), new.near[new.pairs.tolist().index(number)])
    assert np.all(Window((0,), (0.0,), (1.0,), (4,), np.array([1]), np.zeros((1, 4), dtype=np.bool_)).near_any([2]))
