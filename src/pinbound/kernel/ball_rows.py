"""Groups, pairs of clusters and rows of balls, in the order in which machine code examines them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from pinbound.kernel.balls import BallTree, Cluster, PairOfClusters

__all__ = ["Rows", "mean_distance"]


@dataclass
class Rows:
    """Groups, pairs of clusters and rows of balls, while they are written."""

    groups: list[list[int]]
    clusters: list[list[int]]
    rows: list[list[int]]
    numbers: list[int]
    far: list[float]
    pairs_far: list[float]
    windows: list[list[int]]

    def add(self, tree: BallTree, one: PairOfClusters, inside: set[int], spot: dict[int, int], width: int) -> None:
        """Write the rows of a pair of clusters: a ball, and others with consecutive spots."""
        by_ball = dict[int, list[tuple[int, int]]]()
        for number in one.pairs:
            x, y = tree.ends[number].tolist()
            x, y = (x, y) if x in inside else (y, x)
            by_ball.setdefault(x, []).append((spot[y], number))
        for x, others in by_ball.items():
            last = -1
            for place, number in sorted(others):
                if last < 0 or place != last + width:
                    self.rows.append([spot[x], place, len(self.numbers), len(self.numbers)])
                self.numbers.append(number)
                self.rows[-1][3] += 1
                last = place


def mean_distance(tree: BallTree, clusters: Sequence[Cluster]) -> Callable[[int, int], float]:
    """Return a function of two clusters: the mean distance of their middles over some configurations."""
    Q = np.random.default_rng(0).uniform(-np.pi, np.pi, (16, tree.n))
    places = tree.places(Q, [(one.node, one.middle) for one in clusters])

    def mean(a: int, b: int) -> float:
        apart = places[a] - places[b]
        return float(np.sqrt(np.einsum("in,in->n", apart, apart)).sum()) / len(Q)

    return mean
