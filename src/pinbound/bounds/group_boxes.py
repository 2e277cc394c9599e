"""Pairs of points in groups, over boxes of configurations: the results of machine code, and the undecided rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pinbound.bounds.code import Code
from pinbound.bounds.groups import Groups
from pinbound.machine.box_source import BOX_HEAD, ENTRY, box_source
from pinbound.machine.compiled import has_numba
from pinbound.machine.motion_source import GROUP, TILE
from pinbound.typing import Array, Indices, Ints

__all__ = ["BoxFound", "is_worth", "search_box"]

_ROOM = 1 << 14
"""Largest number of boxes in the queue."""

_BOXES = Code(box_source)


@dataclass(frozen=True)
class BoxFound:
    """The results for m pairs over a box.

    Attributes:
        lower: Smallest lower bound of all parts that are proven free [m].
        upper: The smallest computed value, plus its rounding bound [m].
        witness: A q at which a pair is in contact, and the pair; None if none was found.
        unknown: (u,) pairs that cannot be decided somewhere because of rounding.
        open: Pairs, and start and width of boxes (v, n) as shares of the whole, that the budget did not reach.
        boxes: The number of bounds computed, one for each box and pair, or group.
    """

    lower: float
    upper: float
    witness: tuple[Array, int] | None
    unknown: Ints
    open: tuple[Indices, Array, Array]
    boxes: int


def is_worth(boxes: int, seconds: float) -> bool:
    """Count boxes to come, and return whether there were enough to load machine code, or to compile it."""
    return has_numba() and _BOXES.is_worth(boxes, seconds)


def search_box(groups: Groups, weights: Array, low: Array, high: Array, budget: float) -> BoxFound:
    """Search a box for contact of any pair.

    Args:
        groups: The pairs.
        weights: (m, n) how much each coordinate moves a pair. A box is halved in the coordinate with the largest weight
            times width.
        low: (n,) lower corner.
        high: (n,) upper corner.
        budget: Boxes.
    """
    n, table = len(low), groups.table
    heads = table[int(table[2]) :][: GROUP * int(table[1])].reshape(-1, GROUP)
    tiles = int(table[5])
    most = int(heads[:, 0].max()) + 1
    results = 8 + 5 * n + 17 * most
    size, queue = ENTRY + 2 * n, results + TILE * tiles
    entries = np.zeros((tiles, size))
    entries[:, ENTRY + n :] = 1.0
    each = np.zeros((len(heads), n))
    is_first = np.zeros(TILE * tiles, dtype=np.bool_)
    is_first[groups.places] = True
    for number, (_, count, _, _, _, first) in enumerate(heads.astype(np.intp).tolist()):
        rows = groups.pairs[TILE * first : TILE * (first + count)]
        each[number] = weights[rows].max(axis=0)
        entries[first : first + count, 0] = number
    halves = is_first.reshape(tiles, 2, TILE // 2).astype(np.float64) @ 2.0 ** np.arange(TILE // 2)
    entries[:, 1], entries[:, 2:ENTRY] = np.arange(tiles), halves
    room = max(_ROOM, 4 * tiles)
    out = np.empty(queue + size * room)
    out[results:queue], out[queue : queue + entries.size] = 0.0, entries.ravel()
    farthest = np.maximum(np.abs(low), np.abs(high))
    head = np.array([budget, room, tiles, results, queue, most], dtype=np.float64)
    assert len(head) == BOX_HEAD
    question = np.concatenate((head, low, high, farthest, each.ravel()))
    boxes = _BOXES.run(question, out, 0, 0, table, 1)
    lower, upper, stop, place, first, filled = out[:6].tolist()
    witness = (out[8 : 8 + n].copy(), int(groups.pairs[int(place)])) if stop == 1.0 else None
    unknown = groups.pairs[np.flatnonzero(out[results:queue] > 0.0)]
    left = out[queue:].reshape(room, size)[(int(first) + np.arange(int(filled))) % room if stop == 2.0 else []]
    return BoxFound(lower, upper, witness, unknown, _pairs_of(groups, left, n), boxes)


def _pairs_of(groups: Groups, entries: Array, n: int) -> tuple[Indices, Array, Array]:
    """Return the single pairs of entries of the queue, with start and width of their boxes."""
    bits = np.arange(TILE // 2)
    asked = [(half.astype(np.int64)[:, None] >> bits) & 1 for half in (entries[:, 2], entries[:, 3])]
    row, bit = np.nonzero(np.hstack(asked))
    pairs = groups.pairs[entries[row, 1].astype(np.intp) * TILE + bit].astype(np.intp)
    return pairs, entries[row, ENTRY : ENTRY + n], entries[row, ENTRY + n :]
