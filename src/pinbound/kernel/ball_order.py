"""The order in which `free` examines rows and pairs: learned from some random rows, which are always the same ones.

Rows are in lanes. If one lane needs a pair, all lanes of its block examine it. So rows are sorted first, by one or two
coordinates, such that rows that need the same pairs are together. Groups that decide most for their cost are examined
first. No order changes an answer.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np

from pinbound.kernel.ball_pruning import Window
from pinbound.kernel.balls import BallTree, Cluster, PairOfClusters
from pinbound.typing import AnyArray, Array, Flags, Ints

__all__ = ["BINS", "Keys", "Sample"]

BINS = 512
"""Number of bins for sorting rows."""

_ROWS = 1024
"""Largest number of random rows; it is a whole number of blocks."""

_NUMBERS = 1 << 19
"""Largest number of float64 for all positions at these rows."""

_TOGETHER = 16
"""Rows of one block."""

_COORDINATES = 12
"""Number of coordinates that may be used for sorting: those that lie between most pairs."""

_TEST, _PAIR = 10.0, 6.0
"""Instructions of a test of two enclosing balls, and of a pair."""

_GAIN = 0.9
"""Sorting costs a few instructions for each row, so the other instructions must decrease to less than this share."""


@dataclass(frozen=True)
class Keys:
    """One or two coordinates and their bins; `x = (q_j - low) scale`, cut off at zero and at the last bin.

    Attributes:
        columns: The coordinates; the same one twice if one is enough.
        bins: Number of bins of each; one bin of each if rows are not sorted.
        lows: Lower ends of q.
        scales: Bins for each unit of q.
    """

    columns: tuple[int, int]
    bins: tuple[int, int]
    lows: tuple[float, float]
    scales: tuple[float, float]


class Sample:
    """Random rows within limits, and the groups and clusters of a tree that are near each other there."""

    def __init__(self, tree: BallTree, low: Array, high: Array, windows: Mapping[tuple[int, int], Window]) -> None:
        """Place everything for some rows; the ends (n,) may be infinite."""
        self.limits = low, high
        wide = np.where(tree.rates > 0.0, 1.0, np.pi)  # a coordinate without a limit: a half turn, or 1 m, each way
        self.low, self.high = np.maximum(low, -wide), np.minimum(high, wide)
        empty = self.low >= self.high
        self.low[empty], self.high[empty] = -wide[empty], wide[empty]
        self.tree = tree
        bodies, clusters = tree.bodies, tree.clusters
        room = 12 * len(tree.nodes) + 3 * (len(tree.balls) + len(bodies) + len(clusters))
        self.count = min(_ROWS, max(_TOGETHER, _NUMBERS // room // _TOGETHER * _TOGETHER))
        self.Q = np.random.default_rng(0).uniform(self.low, self.high, (self.count, tree.n))
        self._balls = tree.places(self.Q)
        self._bodies = tree.places(self.Q, [(one.node, one.middle) for one in bodies])
        self._clusters = tree.places(self.Q, [(one.node, one.middle) for one in clusters])
        self._needed: list[tuple[float, Flags]] = []
        self._windows = windows

    def window(self, a: int, b: int) -> Window | None:
        """Return the window of two bodies."""
        first, last = sorted((self.tree.bodies[a].node, self.tree.bodies[b].node))
        return self._windows.get((first, last))

    def is_within(self, most: Array) -> bool:
        """Return whether the limits exclude any |q_j| above `most` (n,)."""
        low, high = self.limits
        return bool(np.all((low >= -most) & (high <= most)))

    def decides(self, a: int, b: int, parts: Sequence[PairOfClusters]) -> float:
        """Return the share of rows that a group of pairs finds in contact, for each instruction that it costs a row."""
        bodies, clusters = self.tree.bodies, self.tree.clusters
        near = _near(self._bodies, (a, b), bodies, max(one.threshold for one in parts))
        self._needed.append((_TEST * len(parts), near))
        window = self.window(a, b)
        cells = None if window is None else window.cells(self.tree, self.Q)
        cost, hit = _TEST + _TEST * len(parts) * float(near.mean()), np.zeros(self.count, dtype=np.bool_)
        for one in parts:
            some = near & _near(self._clusters, (one.first, one.last), clusters, one.threshold)
            if window is not None and cells is not None:
                some &= window.near_any(one.pairs)[cells]
            instructions = _TEST + _PAIR * len(one.pairs)
            self._needed.append((instructions, some))
            cost += instructions * float(some.mean())
            rows = np.flatnonzero(some)
            pairs = list(one.pairs)
            x, y = (self._balls[self.tree.ends[pairs, side]][:, :, rows] for side in (0, 1))
            squares = ((x - y) ** 2).sum(axis=1)
            hit[rows] |= np.any(squares < self.tree.thresholds[pairs][:, None] ** 2, axis=0)
        return float(hit.mean()) / cost

    def keys(self) -> Keys:
        """Return the sort keys of rows, after all groups have been added."""
        usual = self._cost(np.arange(self.count))
        used = self._coordinates()
        one = [(self._cost(np.argsort(self.Q[:, j])), j) for j in used]
        best, first = min(one, default=(np.inf, 0))
        several = round((self.count / _TOGETHER) ** 0.5)
        two = [(self._cost(self._sorted(first, j, several)), j) for j in used if j != first]
        least, second = min(two, default=(np.inf, 0))
        if min(best, least) > _GAIN * usual:
            return self._of((first, first), (1, 1))
        if best <= least:
            return self._of((first, first), (BINS, 1))
        return self._of((first, second), (32, BINS // 32))

    def _of(self, columns: tuple[int, int], bins: tuple[int, int]) -> Keys:
        lows = [float(self.low[j]) for j in columns]
        spans = [float(self.high[j] - self.low[j]) for j in columns]
        scales = [count / span for count, span in zip(bins, spans, strict=True)]
        return Keys(columns, bins, (lows[0], lows[1]), (scales[0], scales[1]))

    def _coordinates(self) -> list[int]:
        """Return the coordinates that lie between most pairs."""
        counts = np.zeros(self.tree.n)
        hosts: AnyArray = np.array([node for node, _ in self.tree.balls])
        both = cast(list[tuple[int, int]], [(a, b) for a, b in hosts[self.tree.ends].tolist()])
        for (a, b), number in Counter(both).items():
            above, below = self.tree.apart(a, b)
            for node in (self.tree.nodes[i] for i in (*above, *below)):
                if node.angle >= 0:
                    counts += number * (np.array(self.tree.angles[node.angle]) != 0.0)
                counts[[j for j, _ in node.slides]] += number
        return [int(j) for j in np.argsort(-counts, kind="stable")[:_COORDINATES] if counts[j]]

    def _sorted(self, first: int, second: int, several: int) -> Ints:
        span = self.high - self.low
        bins = np.floor((self.Q[:, [first, second]] - self.low[[first, second]]) / span[[first, second]] * several)
        return np.lexsort((self.Q[:, second], bins[:, 0]))

    def _cost(self, order: Ints) -> float:
        """Return the instructions of a block, for an order of rows."""
        ends = np.arange(0, self.count, _TOGETHER)
        return sum(cost * float(np.logical_or.reduceat(some[order], ends).mean()) for cost, some in self._needed)


def _near(places: Array, ends: tuple[int, int], clusters: Sequence[Cluster], threshold: float) -> Flags:
    a, b = ends
    wide = clusters[a].radius + clusters[b].radius + threshold
    return ((places[a] - places[b]) ** 2).sum(axis=0) < wide**2
