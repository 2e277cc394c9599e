"""Proofs over a polytope in machine code: tables of pairs and groups, and the stack that both sides use."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np

from pinbound.bounds.code import Code
from pinbound.certificates.constraints import ManyAngleBoundaries
from pinbound.freespace.groups import Groups
from pinbound.freespace.pairs import Pairs
from pinbound.machine.compiled import has_numba
from pinbound.machine.proof_source import PROOF_HEAD, proof_source
from pinbound.typing import Array, Flags, Indices

__all__ = ["ProofTables", "Stack", "node_table"]

_ROOM = 1 << 14
"""Size of the stack in boxes; the last box comes first, so a few for each halving are enough."""
_PROOFS = Code(proof_source, loading=1_000, compiling=300_000)


@dataclass
class Stack:
    """Boxes with their nodes, rows (node, low, high) (s, 1 + 2 n), and the number of bounds computed.

    Attributes:
        rows: The remaining boxes; the last one is next.
        boxes: The number of bounds computed.
        is_stopped: Whether the last box may have to be cut off.
    """

    rows: Array
    boxes: int = 0
    is_stopped: bool = False


class ProofTables:
    """The tables for machine code of the pairs of points without prismatic joints, and of their groups."""

    def __init__(self, pairs: Pairs) -> None:
        """Write the tables."""
        family, groups = pairs.families[1], pairs.groups
        n = pairs.weights.shape[1]
        self.n, self.known = n, np.zeros(len(groups.pair), dtype=np.bool_)
        self.is_empty = not (isinstance(family, ManyAngleBoundaries) and family.chains.slides is None)
        some = {} if self.is_empty else {number: pairs.families[number] for number in (1, 3)[: len(pairs.families) - 2]}
        parts = [(int(pairs.first[number]), cast(ManyAngleBoundaries, one)) for number, one in some.items()]
        first, last = int(pairs.first[1]), int(pairs.first[2])
        if not self.is_empty:
            self.known = np.array([all(first <= p < last for p in some) for some in groups.members])
        used = pairs.weights > 0.0
        self.uses = np.array([np.any(used[list(some)], axis=0) for some in groups.members]).reshape(-1, n)
        self.table, self.turns = node_table(groups, parts, pairs.weights)

    def has(self, nodes: Indices) -> Flags:
        """Return which nodes machine code can bound."""
        return self.known[nodes]

    def used_by(self, nodes: Indices) -> Flags:
        """Return which coordinates (n,) the pairs of any of these nodes depend on."""
        return np.any(self.uses[np.unique(nodes)], axis=0)

    def is_ready(self, boxes: int, seconds: float) -> bool:
        """Count boxes to come, and return whether the code is loaded, or worth compiling."""
        return not self.is_empty and has_numba() and _PROOFS.is_worth(boxes, seconds)

    def run(
        self,
        stack: Stack,
        faces: tuple[Array, Array],
        places: tuple[Array, Array],
        numbers: tuple[float, float, float, float],
        budget: int,
    ) -> Stack:
        """Work on a stack until it is empty, a box has to be cut off, or the budget of boxes is spent.

        Args:
            stack: The remaining boxes.
            faces: A (m, n), and b (m,) with their rounding added.
            places: The seed (n,), and upper bounds of abs(q) (n,).
            numbers: Unit of rounding, margin, share of the distance, smallest half-width.
            budget: Boxes.
        """
        n, (A, b), (seed, far) = self.n, faces, places
        room = max(_ROOM, 2 * len(stack.rows))
        head = np.array([budget, room, len(stack.rows), len(b), *numbers], dtype=np.float64)
        assert len(head) == PROOF_HEAD
        question = np.concatenate((head, seed, far, np.zeros(n), np.column_stack([A, b]).ravel()))
        queue, size = 8 + 4 * n + 9 * self.turns, 1 + 2 * n
        out = np.empty(queue + size * room)
        out[queue : queue + stack.rows.size] = stack.rows.ravel()
        boxes = _PROOFS.run(question, out, 0, 0, self.table, 1)
        filled = int(out[1])
        rows = out[queue : queue + size * filled].reshape(filled, size).copy()
        return Stack(rows, boxes, bool(out[0] == 1.0))


def node_table(groups: Groups, parts: Sequence[tuple[int, ManyAngleBoundaries]], weights: Array) -> tuple[Array, int]:
    """Return the tables of nodes and of pairs for machine code, and the largest number of rotations.

    Args:
        groups: The nodes.
        parts: Pairs of points without prismatic joints, and the number of the first pair of each part.
        weights: (p, n) of all pairs, also those of other parts.
    """
    nodes = np.column_stack([groups.pair, groups.extra, groups.halves]).astype(np.float64)
    n, blocks, places, turns = weights.shape[1], list[Array](), np.zeros((len(weights), 2)), 1
    start = 4 + nodes.size + places.size
    for first, family in parts:
        turns = max(turns, family.chains.rotations)
        for row in range(len(family.threshold)):
            block, k = _block(family, row, weights[first + row])
            places[first + row] = start, k
            start += len(block)
            blocks.append(block)
    head = np.array([n, 4, 4 + nodes.size, turns], dtype=np.float64)
    return np.concatenate([head, nodes.ravel(), places.ravel(), *blocks]), turns


def _block(family: ManyAngleBoundaries, row: int, weights: Array) -> tuple[Array, int]:
    """Return the numbers of one pair, and its number of rotations."""
    chains = family.chains
    k = int(np.max(np.flatnonzero(np.any(chains.coefficients[row] != 0.0, axis=1)), initial=-1)) + 1
    parts = (
        np.array([family.threshold[row], family.error[row]]),
        chains.coefficients[row, :k],
        chains.axes[row, :k],
        chains.offsets[row, : k + 1],  # after them are zeros
        family.arms[row, :k],
        weights,
    )
    return np.concatenate([np.ravel(part) for part in parts]), k
