"""Pairs of spheres whose chains have the same rotations, as a tree, so that one bound proves many pairs clear.

Let two pairs have chains `b_0 + R_1(b_1 + ... R_k b_k)` with the same axes and coefficients. This holds for pairs of
the same two links, and of links that are fixed to these. Then their vectors differ by at most `d = sum_i |b_i - b'_i|`
in every configuration. On the same two links, this is at most the distance of their points on these links. So with
thresholds T and rounding bounds E

    f_other(q) >= |r(q)| - T - extra,    extra = T_other - T + d + E_other.

The pair with the smallest maximum of `extra` over the members represents the group. If its clearance exceeds this
extra, all members are clear. If the group is too coarse, its two halves are bounded.

*Fewer coordinates.* The last rotation does not change the part of b_k along its axis. Without the part perpendicular to
the axis, `b_k'`, the chain has one rotation less, and its vector has an error of at most `|b_k'|` in every
configuration. The same holds for the first axis and b_0. So a ball on the axis of a wrist can represent the bodies of a
hand, for all values of the last joint.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pinbound.boundaries.boundary import Boundary
from pinbound.path.chain import Chain
from pinbound.tolerances import INFLATION
from pinbound.typing import Array, Indices

__all__ = ["Groups"]

_FEWEST = 3
"""Number of rotations of a chain from which on a chain with fewer rotations is tried first."""
_COARSE = 0.12
"""[m], the largest error of a chain with fewer rotations, in addition to the error of the group."""


@dataclass(frozen=True)
class Groups:
    """Nodes: first all m single pairs, then groups of them.

    Attributes:
        pair: (N,) the pair that represents each node; from m on, one of `chains`.
        extra: (N,) the reduction of its clearance [m]; 0 for single pairs.
        halves: (N, 2) the nodes that form a group; -1 for single pairs, and for a missing second node.
        roots: The nodes that together contain every pair once.
        members: The pairs of each node.
        chains: Chains with fewer rotations, each made from a pair.
        made_of: (c,) the pair of each.
    """

    pair: Indices
    extra: Array
    halves: Indices
    roots: Indices
    members: tuple[tuple[int, ...], ...]
    chains: tuple[Chain, ...]
    made_of: Indices

    @classmethod
    def of(
        cls,
        boundaries: Sequence[Boundary],
        error: Array,
        grouped: Sequence[int],
        chains: Mapping[int, Chain] | None = None,
    ) -> Groups:
        """Return the tree of boundaries.

        Args:
            boundaries: All of them.
            error: (m,) bounds of their rounding [m].
            grouped: Which are between two points, without prismatic joints.
            chains: For these, chains with the same norms; None: those of their paths.
        """
        known = {pair: boundaries[pair].path.minimal for pair in grouped} if chains is None else chains
        found = _Builder(boundaries, error, known)
        alike: dict[tuple[bytes, bytes], list[int]] = {}
        for pair in grouped:
            chain = known[pair]
            alike.setdefault((chain.axes.tobytes(), chain.coefficients.tobytes()), []).append(pair)
        single = sorted(set(range(len(boundaries))) - set(grouped))
        roots = [*single, *(found.node(np.array(members)) for members in alike.values())]
        return cls(
            np.array(found.pair, dtype=np.intp),
            np.array(found.extra, dtype=np.float64),
            np.array(found.halves, dtype=np.intp).reshape(-1, 2),
            np.array(roots, dtype=np.intp),
            tuple(found.members),
            tuple(found.chains),
            np.array(found.made_of, dtype=np.intp),
        )


class _Builder:
    def __init__(self, boundaries: Sequence[Boundary], error: Array, known: Mapping[int, Chain]) -> None:
        self.boundaries, self.error, self.known = boundaries, error, known
        count = len(boundaries)
        self.pair, self.extra = list(range(count)), [0.0] * count
        self.halves = [(-1, -1)] * count
        self.members: list[tuple[int, ...]] = [(pair,) for pair in range(count)]
        self.chains: list[Chain] = []
        self.made_of: list[int] = []

    def node(self, members: Indices) -> int:
        """Return the node of some pairs whose chains have the same rotations."""
        if len(members) == 1:
            return self._shorter(int(members[0]), members, (int(members[0]), -1), 0.0)
        some = [self.boundaries[int(pair)] for pair in members]
        blocks = np.array([self.known[int(pair)].offsets for pair in members])
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
        room = max(0.0, float(extra[best])) * INFLATION
        shorter = self._shorter(int(members[best]), members, halves, room)
        return shorter if shorter >= 0 else self._add(int(members[best]), room, halves, members)

    def _add(self, pair: int, extra: float, halves: tuple[int, int], members: Indices) -> int:
        self.pair.append(pair)
        self.extra.append(extra)
        self.halves.append(halves)
        self.members.append(tuple(int(one) for one in members))
        return len(self.pair) - 1

    def _shorter(self, best: int, members: Indices, halves: tuple[int, int], room: float) -> int:
        """Return a node with fewer coordinates for the same pairs; the pair itself, or -1, if there is none."""
        none = best if halves[1] < 0 else -1
        whole = self.known[best]
        if whole.rotations < _FEWEST or np.any(whole.slides):
            return none
        blocks, chain, found = whole.offsets.copy(), whole, none
        threshold = np.array([self.boundaries[int(pair)].rule.placed_distance for pair in members])
        theirs = np.array([self.known[int(pair)].offsets for pair in members])
        own = self.boundaries[best].rule.placed_distance
        ends = [(0, whole.axes[0]), (whole.rotations, whole.axes[-1])]
        ends.sort(key=lambda one: float(np.linalg.norm(_across(blocks[one[0]], one[1]))))
        for place, axis in ends:
            if chain.rotations < _FEWEST:
                break
            blocks[place] -= _across(blocks[place], axis)
            chain = _without(chain, is_first=place == 0)
            apart = np.linalg.norm(theirs - blocks, axis=2).sum(axis=1)
            extra = float((threshold + self.error[members] - own + apart * INFLATION).max()) * INFLATION
            if extra - room > _COARSE:
                break
            self.chains.append(chain)
            self.made_of.append(best)
            below = halves if found == none else (found, -1)
            found = self._add(len(self.boundaries) + len(self.chains) - 1, max(0.0, extra), below, members)
        return found


def _across(block: Array, axis: Array) -> Array:
    """Return the part of a block perpendicular to an axis."""
    return block - axis * float(axis @ block)


def _without(chain: Chain, is_first: bool) -> Chain:
    """Return a chain without its first or last rotation, and without the part that this rotates."""
    offsets = chain.offsets
    if is_first:
        merged = offsets[0] - _across(offsets[0], chain.axes[0]) + offsets[1]
        kept, part = np.vstack([merged[None], offsets[2:]]), slice(1, None)
    else:
        merged = offsets[-2] + offsets[-1] - _across(offsets[-1], chain.axes[-1])
        kept, part = np.vstack([offsets[:-2], merged[None]]), slice(None, -1)
    return replace(
        chain, offsets=kept, slides=chain.slides[:-1], axes=chain.axes[part], coefficients=chain.coefficients[part]
    )
