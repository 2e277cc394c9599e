"""The order of rows and groups of `free` changes no answer, and brings rows together that need the same pairs."""

import importlib.util
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pinbound.kernel import BallKernel
from pinbound.kernel.ball_order import Sample
from pinbound.kernel.balls import BallTree, Node
from pinbound.machine.ball_free_source import TILE

NUMBA = pytest.mark.skipif(not importlib.util.find_spec("numba"), reason="no Numba")
Z, Y = np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0])


def arm(threshold: float = 0.1) -> BallTree:
    """Two links that fold by q2 alone; q0, q1 and q3 move nothing against anything but one far sphere."""
    root = Node(0, np.zeros(3), (), -1, Z, 0, 0.0)
    axes = (Z, Z, Y, Z)
    steps = np.array([[0.0, 0.0, 0.2], [0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.5, 0.0, 0.0]])
    nodes = [root, *(Node(i, steps[i], (), i, axes[i], i + 1, 1.2) for i in range(4))]
    rng = np.random.default_rng(0)
    balls = [(2, rng.uniform(-0.1, 0.1, 3) + np.array([0.1, 0.0, 0.0])) for _ in range(9)]
    balls += [(3, rng.uniform(-0.1, 0.1, 3) + np.array([0.4, 0.0, 0.0])) for _ in range(9)]
    balls += [(4, np.array([0.0, 0.0, 0.1])), (0, np.array([0.0, 0.0, -0.3]))]
    ends = [(a, b) for a in range(9) for b in range(9, 18)] + [(18, 19)]
    return BallTree(
        4, [tuple(row) for row in np.eye(4).tolist()], nodes, balls, np.array(ends), np.full(82, threshold), 1.5
    )


def sample(tree: BallTree) -> Sample:
    wide = np.full(4, 3.0)
    found = Sample(tree, -wide, wide, {})
    place = {body.node: i for i, body in enumerate(tree.bodies)}
    groups: dict[tuple[int, int], list[Any]] = {}
    for one in tree.pairs_of(tree.clusters):
        nodes = sorted(place[tree.clusters[i].node] for i in (one.first, one.last))
        groups.setdefault((nodes[0], nodes[1]), []).append(one)
    for (a, b), parts in groups.items():
        found.decides(a, b, parts)
    return found


def test_rows_are_sorted_by_the_coordinate_that_brings_pairs_near() -> None:
    keys = sample(arm()).keys()
    assert keys.columns[0] == 2
    assert np.prod(keys.bins) > 1


def test_rows_are_not_sorted_where_no_coordinate_matters() -> None:
    tree = arm()
    close = replace(tree, balls=[(node, 1e-3 * x) for node, x in tree.balls[:18]], ends=tree.ends[:81])
    close.thresholds = tree.thresholds[:81] + 3.0  # near everywhere
    assert sample(close).keys().bins == (1, 1)


@NUMBA
@pytest.mark.parametrize("limited", [False, True])
def test_no_answer_depends_on_the_order_of_rows(limited: bool) -> None:
    tree = arm()
    kernel = BallKernel([], 4, None, lambda: None, tree)  # type: ignore[arg-type]
    high = np.array([3.0, 2.5, 2.8, 1.0]) if limited else np.full(4, np.inf)
    rng = np.random.default_rng(3)
    Q = rng.uniform(-3.2, 3.2, (2 * TILE + 77, 4))
    Q[5, 2], Q[TILE, 2], Q[-1, 0], Q[300, 1] = np.nan, np.inf, -np.inf, 999.0
    places = tree.places(np.nan_to_num(Q, posinf=0.0, neginf=0.0))
    apart = np.linalg.norm(places[tree.ends[:, 0]] - places[tree.ends[:, 1]], axis=1) - tree.thresholds[:, None]
    least = apart.min(axis=0)
    sure = np.isfinite(Q).all(axis=1) & (np.abs(least) > 1e-9)
    expected = (least > 0.0) & np.all((Q >= -high) & (Q <= high), axis=1)
    calls = list[int]()

    def counted(rows: Any, *_: Any) -> tuple[Any, Any]:
        calls.append(len(rows))
        found = tree.places(rows)
        norms = np.linalg.norm(found[tree.ends[:, 0]] - found[tree.ends[:, 1]], axis=1) - tree.thresholds[:, None]
        return np.where(np.isfinite(rows).all(axis=1), norms.min(axis=0), np.nan), np.empty(0)

    kernel.smallest = counted  # type: ignore[method-assign, assignment]
    kernel._are_positive = lambda rows, _: counted(rows)[0] > 0.0  # type: ignore[method-assign]
    with np.errstate(invalid="ignore"):
        for some in (np.arange(len(Q)), rng.permutation(len(Q)), np.arange(7, 19), np.arange(0, len(Q), 31)):
            found = kernel.free_within(Q[some], -high, high, backend="compiled")
            assert np.array_equal(found[sure[some]], expected[some][sure[some]])
            assert not np.any(found[~np.isfinite(Q[some]).all(axis=1)])
    assert 0.1 < np.mean(expected[sure]) < 0.9
    assert sum(calls) < 0.05 * 3 * len(Q)


@NUMBA
def test_a_set_without_contacts_is_free_everywhere_and_many_limits_share_tables() -> None:
    kernel = BallKernel([], 4, None, lambda: None, arm(1e-3))  # type: ignore[arg-type]
    kernel._are_positive = lambda rows, _: np.ones(len(rows), dtype=np.bool_)  # type: ignore[method-assign]
    Q = np.random.default_rng(5).uniform(-0.5, 0.5, (600, 4))
    for size in np.linspace(0.3, 0.5, 20):
        wide = np.full(4, size)
        assert np.array_equal(kernel.free_within(Q, -wide, wide, backend="compiled"), np.all(np.abs(Q) <= size, axis=1))
    assert len(kernel._tables) < 15
