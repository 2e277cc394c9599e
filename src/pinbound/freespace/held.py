"""Pairs of points when the coordinates that are not paved are fixed: fewer rotations, and larger groups.

With the other coordinates fixed, a chain has at most as many axes as coordinates are paved. Links that do not move
relative to each other any more are one body. So their pairs have the same rotations, and one bound represents them
(`groups`). Boxes have lists of nodes. A node that is clear over a box is removed from the lists of all its parts. A
pair that is in contact in the whole box decides the box. A group that is too coarse is replaced by its halves. Machine
code does this if it is available, otherwise rounds of NumPy.

The rounding of fixing the others is at most that of the derivation and evaluation of the whole chain, because it folds
and reduces the same blocks and rotations. So the rounding bound is used twice. `docs/free-space.md`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pinbound.bounds.bounds import bundle, lever_arms
from pinbound.bounds.code import Code
from pinbound.certificates.constraints import ManyAngleBoundaries
from pinbound.freespace.groups import Groups
from pinbound.freespace.pairs import Affine, Pairs, bound_points
from pinbound.freespace.quick_proofs import node_table
from pinbound.machine.compiled import has_numba
from pinbound.machine.paving_source import PAVING_HEAD, PAVING_RESULT, paving_source
from pinbound.machine.proof_source import COARSE
from pinbound.path.restriction import restrict
from pinbound.tolerances import INFLATION
from pinbound.typing import Array, Flags, Indices

__all__ = ["Decided", "HeldPairs", "Lists"]

_ROOM = 1 << 21
"""Numbers of working memory for a call of machine code: nodes of all its boxes together."""
_MOST_BOXES = 4096
_PAVING = Code(paving_source, loading=2_000, compiling=300_000)


@dataclass(frozen=True)
class Lists:
    """Lists of nodes, one for each box; the halves of a box share its list.

    Attributes:
        nodes: All lists, one after the other.
        first: (N,) the start of each box's list.
        length: (N,) its length.
    """

    nodes: Indices
    first: Indices
    length: Indices

    def rows(self) -> tuple[Indices, Indices]:
        """Return the box and the node of all entries, box by box."""
        box = np.repeat(np.arange(len(self.first)), self.length)
        before = np.cumsum(self.length) - self.length
        return box, self.nodes[np.arange(len(box)) - before[box] + self.first[box]]

    def take(self, rows: Flags | slice | Indices) -> Lists:
        """Return the lists of some boxes."""
        return Lists(self.nodes, self.first[rows], self.length[rows])


@dataclass(frozen=True)
class Decided:
    """The results for N boxes.

    Attributes:
        lists: For each box, the nodes that are not proven clear in it; empty if it is in contact.
        contact: (N,) whether one pair is proven in contact in the whole box.
        across: (N,) the coordinate in which to halve it; for a box in contact, the pair in contact.
        least: (N,) the least lower bound of the remaining nodes [m]; infinite if there are none.
        bounded: The number of bounds computed, one for each box and node.
    """

    lists: Lists
    contact: Flags
    across: Indices
    least: Array
    bounded: int


class HeldPairs:
    """Pairs of points over boxes of some coordinates, with the others fixed."""

    def __init__(self, pairs: Pairs, axes: Indices, at: Array, low: Array, high: Array, beside: Array) -> None:
        """Fix the others; bounds hold while q stays in the box (k,), (k,) of the axes, enlarged by `beside` (k,)."""
        k, keep = len(axes), axes.tolist()
        family = pairs.families[1]
        assert isinstance(family, ManyAngleBoundaries)
        all_rows = np.arange(int(pairs.first[1]), int(pairs.first[2]))
        # Also if nothing is fixed: then the columns have the order of the axes, which users choose.
        chains = [restrict(pairs.boundaries[int(row)].path.minimal, at, keep) for row in all_rows]
        turning = np.array([not np.any(chain.slides) for chain in chains], dtype=np.bool_)
        self.rows = all_rows[turning]
        """Which of all pairs these are; the others are bounded with all their coordinates."""
        kept = [chain for chain, turns in zip(chains, turning, strict=True) if turns]
        boundaries = [pairs.boundaries[int(row)] for row in self.rows]
        error = 2.0 * family.error[turning]
        self.groups = groups = Groups.of(boundaries, error, range(len(kept)), dict(enumerate(kept)))
        threshold = np.array([one.rule.placed_distance for one in boundaries])
        self.families: list[tuple[int, ManyAngleBoundaries]] = []
        for first, some, made_of in (
            (0, kept, np.arange(len(kept))),
            (len(kept), groups.chains, groups.made_of),
        ):
            if len(some):
                stacked = bundle(some, k)
                arms = lever_arms(stacked, low - beside, high + beside)
                one = ManyAngleBoundaries((), stacked, arms, threshold[made_of], error[made_of], (), None)
                self.families.append((first, one))
        self.weights = np.concatenate([np.zeros((0, k)), *(one.weights for _, one in self.families)])
        self.beside = beside
        self.table, self.turns = node_table(groups, self.families, self.weights)
        self.most_boxes = max(1, min(_MOST_BOXES, _ROOM // max(1, len(self.rows))))

    def __len__(self) -> int:
        """Return the number of pairs."""
        return len(self.rows)

    def first_lists(self, count: int) -> Lists:
        """Return lists of all nodes that together contain every pair once, for some boxes."""
        roots = self.groups.roots
        return Lists(roots, np.zeros(count, dtype=np.intp), np.full(count, len(roots), dtype=np.intp))

    def decide(self, boxes: Array, lists: Lists, seconds: float) -> Decided:
        """Return the results for boxes (N, 2, k), at most `most_boxes` of them; `seconds` remain for the whole work."""
        work = int(lists.length.sum())
        if work and has_numba() and _PAVING.is_worth(work, seconds):
            return self._quick(boxes, lists)
        return self._slow(boxes, lists)

    def _quick(self, boxes: Array, lists: Lists) -> Decided:
        count, k = len(boxes), boxes.shape[2]
        start = PAVING_HEAD + k
        rows = np.column_stack([boxes.reshape(count, -1), lists.first, lists.length])
        question = np.concatenate(([start, start + rows.size], self.beside, rows.ravel(), lists.nodes))
        room = len(self.groups.pair)
        results = 8 + 3 * k + 9 * self.turns + room
        kept = results + PAVING_RESULT * count
        out = np.empty(kept + count * len(self.rows))
        bounded = _PAVING.run(question, out, room, 0, self.table, count)
        found = out[results:kept].reshape(count, PAVING_RESULT)
        filled = int(found[-1, 1] + found[-1, 2])
        first, length = found[:, 1].astype(np.intp), found[:, 2].astype(np.intp)
        left = Lists(out[kept : kept + filled].astype(np.intp), first, length)
        return Decided(left, found[:, 0] == 1.0, found[:, 3].astype(np.intp), found[:, 4].copy(), bounded)

    def _slow(self, boxes: Array, lists: Lists) -> Decided:
        count = len(boxes)
        centre = 0.5 * (boxes[:, 0] + boxes[:, 1])
        half = np.maximum(boxes[:, 1] - centre, centre - boxes[:, 0]) * INFLATION + self.beside
        contact, bounded = np.zeros(count, dtype=np.bool_), 0
        touching = np.zeros(count, dtype=np.intp)
        parts: list[tuple[Indices, Indices, Array, Array]] = []
        box, node = lists.rows()
        while len(box):
            bounded += len(box)
            found = self.bound_nodes(node, centre[box], half[box])
            linear = np.einsum("ni,ni->n", np.abs(found.slope), half[box])
            reach, extra = found.rest + linear, self.groups.extra[node]
            contact[box[found.upper < 0.0]] = True
            touching[box[found.upper < 0.0]] = node[found.upper < 0.0]
            is_open = ~(found.lower > 0.0)
            is_group = self.groups.halves[node, 0] >= 0
            coarse = (extra >= reach) | (found.value + reach <= 0.0)  # all of it in contact: nothing will be clear
            coarse = is_group & (coarse | ((found.value <= 0.0) & (extra >= COARSE * reach)))
            keep = is_open & ~coarse
            is_steep = (found.value > 0.0) & (linear >= found.rest)
            by = np.where(is_steep[:, None], np.abs(found.slope), self.weights[self.groups.pair[node]])
            across = np.argmax(by * half[box], axis=1)
            parts.append((box[keep], node[keep], found.lower[keep], across[keep]))
            split = is_open & coarse
            halves = self.groups.halves[node[split]].ravel()
            box, node = np.repeat(box[split], 2)[halves >= 0], halves[halves >= 0]
        found = self._gathered(parts, contact, bounded)
        return replace(found, across=np.where(contact, touching, found.across))

    def _gathered(
        self, parts: Sequence[tuple[Indices, Indices, Array, Array]], contact: Flags, bounded: int
    ) -> Decided:
        whole = [np.concatenate([np.empty(0, dtype=np.intp), *(one[index] for one in parts)]) for index in (0, 1, 3)]
        box, node, across = (one.astype(np.intp) for one in whole)
        lower = np.concatenate([np.empty(0), *(one[2] for one in parts)])
        order = np.lexsort((lower, box))
        order = order[~contact[box[order]]]
        box, node, lower, across = box[order], node[order], lower[order], across[order]
        length = np.bincount(box, minlength=len(contact))
        first = np.cumsum(length) - length
        some = length > 0
        least, which = np.full(len(contact), np.inf), np.zeros(len(contact), dtype=np.intp)
        least[some], which[some] = lower[first[some]], across[first[some]]
        return Decided(Lists(node, first, length), contact, which, least, bounded)

    def bound_nodes(self, nodes: Indices, centre: Array, half: Array) -> Affine:
        """Return the bounds of nodes (N,) over the boxes `centre +- half` (N, k); groups have no upper bound."""
        pair, extra = self.groups.pair[nodes], self.groups.extra[nodes]
        numbers = np.empty((5, len(nodes)))
        found = Affine(numbers[0], np.empty_like(centre), *numbers[1:])
        for first, family in self.families:
            rows = np.flatnonzero((pair >= first) & (pair < first + len(family.threshold)))
            part = bound_points(family, pair[rows] - first, centre[rows], half[rows])
            for name in ("value", "slope", "rest", "moved", "lower", "upper"):
                getattr(found, name)[rows] = getattr(part, name)
        upper = np.where(self.groups.halves[nodes, 0] < 0, found.upper, np.inf)
        return Affine(found.value - extra, found.slope, found.rest, found.moved, found.lower - extra, upper)
