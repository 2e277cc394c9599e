"""Pairs of spheres whose chains turn alike as a tree, so that one bound clears many.

Let two pairs have chains `b_0 + R_1(b_1 + ... R_k b_k)` with the same axes and coefficients, as those of the same two
links have, and those of links that are fixed to these. Their vectors differ by at most `d = sum_i |b_i - b'_i|` in
every configuration, and, on the same two links, by at most as much as their points are apart on these. So with
thresholds T and rounding bounds E

    f_other(q) >= |r(q)| - T - extra,    extra = T_other - T + d + E_other.

A group is represented by the pair for which the largest extra of its members is least; what clears it by that much
clears them all. Where it is too coarse, its two halves are asked.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pinbound.boundaries.boundary import Boundary
from pinbound.tolerances import INFLATION
from pinbound.typing import Array, Indices

__all__ = ["Groups"]


@dataclass(frozen=True)
class Groups:
    """Nodes: first all m pairs, each itself, then groups of them.

    Attributes:
        pair: (N,) the pair that represents each node.
        extra: (N,) what is taken off its clearance [m]; 0 of pairs.
        halves: (N, 2) the nodes that a group is made of; -1 of pairs.
        roots: The nodes that together hold every pair once.
        members: Of each node, its pairs.
    """

    pair: Indices
    extra: Array
    halves: Indices
    roots: Indices
    members: tuple[tuple[int, ...], ...]

    @classmethod
    def of(cls, boundaries: Sequence[Boundary], error: Array, grouped: Sequence[int]) -> Groups:
        """Return the tree of boundaries; `grouped` are between two points, `error` (m,) bounds their rounding [m]."""
        found = _Builder(boundaries, error)
        alike: dict[tuple[bytes, bytes], list[int]] = {}
        for pair in grouped:
            chain = boundaries[pair].path.minimal
            alike.setdefault((chain.axes.tobytes(), chain.coefficients.tobytes()), []).append(pair)
        single = sorted(set(range(len(boundaries))) - set(grouped))
        roots = [*single, *(found.node(np.array(members)) for members in alike.values())]
        return cls(
            np.array(found.pair, dtype=np.intp),
            np.array(found.extra, dtype=np.float64),
            np.array(found.halves, dtype=np.intp).reshape(-1, 2),
            np.array(roots, dtype=np.intp),
            tuple(found.members),
        )


class _Builder:
    def __init__(self, boundaries: Sequence[Boundary], error: Array) -> None:
        self.boundaries, self.error = boundaries, error
        count = len(boundaries)
        self.pair, self.extra = list(range(count)), [0.0] * count
        self.halves = [(-1, -1)] * count
        self.members: list[tuple[int, ...]] = [(pair,) for pair in range(count)]

    def node(self, members: Indices) -> int:
        """Return the node of some pairs of the same two links."""
        if len(members) == 1:
            return int(members[0])
        some = [self.boundaries[int(pair)] for pair in members]
        blocks = np.array([one.path.minimal.offsets for one in some])
        places = blocks.reshape(len(blocks), -1)
        threshold = np.array([self.boundaries[int(pair)].rule.placed_distance for pair in members])
        apart = np.linalg.norm(blocks[:, None] - blocks[None], axis=3).sum(axis=2)
        links = {(one.point_a.link, one.point_b.link) for one in some}
        if len(links) == 1:
            ends = np.array([[one.point_a.shape.origin, one.point_b.shape.origin] for one in some])
            apart = np.minimum(apart, np.linalg.norm(ends[:, None] - ends[None], axis=3).sum(axis=2))
        extra = (threshold + self.error[members] - threshold[:, None] + apart * INFLATION).max(axis=1)
        best = int(np.argmin(extra))
        wide = int(np.argmax(places.max(axis=0) - places.min(axis=0)))
        order = np.argsort(places[:, wide], kind="stable")
        middle = len(order) // 2
        halves = self.node(members[order[:middle]]), self.node(members[order[middle:]])
        self.pair.append(int(members[best]))
        self.extra.append(max(0.0, float(extra[best])) * INFLATION)
        self.halves.append(halves)
        self.members.append(tuple(int(pair) for pair in members))
        return len(self.pair) - 1
