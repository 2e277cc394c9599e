"""Pairs of points in groups with equal rotations, as tables for the machine code that searches straight motions.

Chains with the same axes and coefficients form a group; their blocks b_i differ. Each group has one more chain, the
middle: its blocks are in the middle of the others, and its threshold is the largest one plus the sum over the blocks of
the largest distance from the middle. If it is proven free, every pair is free, by the triangle inequality.
`docs/certificates.md`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pinbound.bounds.bounds import Bundle, bundle, lever_arms
from pinbound.bounds.code import Code
from pinbound.bounds.rounding import Rounding
from pinbound.machine.compiled import has_numba
from pinbound.machine.motion_source import GROUP, HEAD, ROTATION, TABLES, TILE, motion_source
from pinbound.path.chain import Chain
from pinbound.tolerances import INFLATION
from pinbound.typing import Array, Flags, Indices, Ints

__all__ = ["Groups", "ManyFound", "MotionFound", "groups_of"]

_LEVELS = 64
"""Upper bound of the levels of halves of a piece, which is cut at most 48 times."""

_EMPTY = -1e9
"""Metres: the threshold of empty entries of a table, so that they are free."""

_RESULT = 5
_SUMMARY = 6


@dataclass(frozen=True)
class MotionFound:
    """The results for m pairs along one motion.

    Attributes:
        lower: (m,) proven lower bounds of the signed clearances [m], for pairs that are settled.
        upper: (m,) the smallest computed value, plus its rounding bound [m].
        piece: (m,) the piece of this value.
        u: (m,) its parameter on the piece.
        settled: (m,) whether the pair is proven free on the whole motion, with the requested precision.
        boxes: The number of bounds computed, one for each part and pair, or group.
    """

    lower: Array
    upper: Array
    piece: Indices
    u: Array
    settled: Flags
    boxes: int


@dataclass(frozen=True)
class ManyFound:
    """The results for N motions.

    Attributes:
        lower: (N,) proven lower bound of the smallest clearance of all pairs [m]; only for free motions.
        upper: (N,) the smallest computed value, plus its rounding bound [m].
        pair: (N,) the pair of this value.
        u: (N,) its parameter on the motion.
        violated: (N,) whether it is proven contact.
        unknown: (N,) whether a pair is neither proven free nor in contact.
        boxes: The number of bounds computed, one for each part and pair, or group.
    """

    lower: Array
    upper: Array
    pair: Indices
    u: Array
    violated: Flags
    unknown: Flags
    boxes: int


@dataclass(frozen=True, eq=False)
class Groups:
    """Tables of m pairs.

    Attributes:
        places: (m,) index of each pair among all entries of all tiles.
        pairs: (places,) the pair at each entry.
        table: The numbers that the machine code reads.
        room: Number of float64 of working memory that it needs.
        results: Index in the working memory at which its results begin.
    """

    places: Indices
    pairs: Ints
    table: Array
    room: int
    results: int
    _spaces: list[Array] = field(default_factory=list[Array])

    def is_worth(self, boxes: int, seconds: float) -> bool:
        """Count boxes of motions to come, and return whether there were enough to load machine code, or to compile it.

        `seconds` is the time for the whole work: compiling takes a few seconds.
        """
        return has_numba() and _MOTIONS.is_worth(boxes, seconds)

    def motion(self, ends: Array, precision: float, elsewhere: float, budget: float, each: bool) -> MotionFound | None:
        """Search one motion of straight pieces; None if the budget of boxes did not suffice.

        Args:
            ends: (K, 2, n) ends of the pieces.
            precision: [m] requested for the smallest clearance.
            elsewhere: [m] the smallest known clearance of other boundaries.
            budget: Boxes.
            each: Whether every pair gets tight bounds.
        """
        question = np.concatenate((_head(precision, elsewhere, budget, 0.0, each), ends.ravel()))
        try:  # memory that no other thread uses now
            out = self._spaces.pop()
        except IndexError:
            out = np.empty(self.room)
        boxes = _MOTIONS.run(question, out, 0, 0, self.table, len(ends))
        found = out[self.results : self.results + _RESULT * len(self.pairs)].reshape(-1, _RESULT)[self.places]
        self._spaces.append(out)
        if boxes < 0:
            return None
        return MotionFound(
            lower=found[:, 0],
            upper=found[:, 1],
            piece=found[:, 2].astype(np.intp),
            u=found[:, 3],
            settled=found[:, 4] == 0.0,
            boxes=boxes,
        )

    def many(self, ends: Array, precision: float, budget: float) -> ManyFound:
        """Search N motions of one straight piece each, ends (N, 2, n), with a budget of boxes for each of them."""
        count = len(ends)
        question = np.concatenate((_head(precision, np.inf, budget, 1.0, False), ends.ravel()))
        out = np.empty(self.room + _SUMMARY * count)
        boxes = _MOTIONS.run(question, out, self.room, _SUMMARY, self.table, count)
        lower, upper, place, u, violated, unknown = out[self.room :].reshape(count, _SUMMARY).T
        pair = self.pairs[place.astype(np.intp)].astype(np.intp)
        return ManyFound(lower, upper, pair, u, violated > 0.0, unknown > 0.0, boxes)


def _head(*values: float) -> Array:
    found = np.zeros(HEAD)
    found[:] = values
    return found


_MOTIONS = Code(motion_source)


def groups_of(
    chains: Sequence[Chain], stacked: Bundle, arms: Array, rounding: Rounding, threshold: Array, places: Array
) -> Groups:
    """Return the tables of m pairs of points whose chains have no prismatic joint.

    Args:
        chains: Their chains.
        stacked: The same chains as one bundle.
        arms: (m, k) lever arms [m].
        rounding: The data of their rounding bounds.
        threshold: (m,) the values that their distances must exceed [m].
        places: (m,) additional errors of their distances [m].
    """
    n = stacked.coefficients.shape[2]
    constant, slope = rounding.linear()
    constant = (constant + places) * INFLATION
    members: dict[tuple[int, bytes, bytes, float], list[int]] = {}
    for row, (chain, place) in enumerate(zip(chains, places.tolist(), strict=True)):
        key = chain.rotations, chain.axes.tobytes(), chain.coefficients.tobytes(), place
        members.setdefault(key, []).append(row)
    groups = list(members.values())
    rows: dict[bytes, tuple[int, Array]] = {}
    turns: list[list[float]] = []
    for chain in (chains[group[0]] for group in groups):
        for coefficients, axis in zip(chain.coefficients, chain.axes, strict=True):
            number, _ = rows.setdefault(coefficients.tobytes(), (len(rows), coefficients))
            turns.append([float(number), *axis.tolist()])
    blocks = [_block([chains[row] for row in group], arms[group], threshold[group]) for group in groups]
    constants, slopes = _errors(groups, blocks, rounding.reach, constant, slope)
    counts = [len(block) - 1 for block in blocks]
    parts = [
        np.zeros(TABLES),
        np.zeros(GROUP * len(groups)),
        np.array([coefficients for _, coefficients in rows.values()]).reshape(-1),
        np.array(slopes).reshape(-1),
        np.array(turns).reshape(-1),
        *(block.reshape(-1) for block in blocks),
    ]
    table, starts = np.concatenate(parts), np.cumsum([0, *map(len, parts)])
    first_turn, first_tile = starts[4], 0
    where, pairs = np.zeros(len(chains), dtype=np.intp), list[int]()
    for number, (group, count) in enumerate(zip(groups, counts, strict=True)):
        k, at = chains[group[0]].rotations, starts[1] + GROUP * number
        table[at : at + GROUP] = k, count, first_turn, starts[5 + number], constants[number], first_tile
        where[group] = TILE * first_tile + np.arange(len(group))
        pairs += [*group, *[group[0]] * (TILE * count - len(group))]
        first_turn, first_tile = first_turn + ROTATION * k, first_tile + count
    most = max((chain.rotations for chain in chains), default=0) + 1
    longest = TILE * max(counts, default=0)
    sizes = [9 * most, 9 * most, most, most, 4 * len(rows), n, TILE * first_tile, _LEVELS * longest, 8 * _LEVELS]
    rooms = 8 * TILE + np.cumsum([0, *sizes])
    table[:7] = n, len(groups), starts[1], len(rows), starts[2], first_tile, starts[3]
    table[7 : 7 + len(rooms)] = rooms
    results = int(rooms[-1])
    return Groups(where, np.array(pairs, dtype=np.int64), table, results + _RESULT * TILE * first_tile, results)


def _errors(
    groups: Sequence[list[int]], blocks: Sequence[Array], reach: Array, constant: Array, slope: Array
) -> tuple[list[float], list[Array]]:
    """Return the rounding bounds of each group: that of its pairs, and that of the middle.

    A rounding bound is a length times a factor, which depends on joints and angles; the middle has its own length.
    """
    constants: list[float] = []
    slopes: list[Array] = []
    share = np.divide(1.0, reach, out=np.zeros_like(reach), where=reach > 0.0)
    for group, block in zip(groups, blocks, strict=True):
        k = (block.shape[1] - 5) // 4
        length = np.linalg.norm(block[0, : 3 * k + 3, 0].reshape(k + 1, 3), axis=1).sum()
        constants.append(float(constant[group].max() + length * (constant * share)[group].max()) * INFLATION)
        slopes.append((slope[group].max(axis=0) + length * (slope * share[:, None])[group].max(axis=0)) * INFLATION)
    return constants, slopes


def _block(chains: Sequence[Chain], arms: Array, threshold: Array) -> Array:
    """Return the numbers of a group (tiles + 1, 4 k + 5, 64): the middle of all first, then its pairs.

    Rows are the components of all blocks, the lever arms, the threshold, and how many pairs there are.
    """
    k, count = chains[0].rotations, -(-len(chains) // TILE)
    offsets = np.array([chain.offsets.ravel() for chain in chains])
    rows = np.column_stack((offsets, arms[:, :k], threshold))
    found = np.zeros((1 + count, 4 * k + 5, TILE))
    found[:, -2] = _EMPTY
    for tile in range(count):
        some = rows[TILE * tile : TILE * (tile + 1)]
        found[1 + tile, :-1, : len(some)], found[1 + tile, -1, 0] = some.T, len(some)
    middle = 0.5 * (offsets.min(axis=0) + offsets.max(axis=0))
    away = np.linalg.norm((offsets - middle).reshape(len(chains), k + 1, 3), axis=2).max(axis=0).sum()
    between = replace(chains[0], offsets=middle.reshape(k + 1, 3))
    still = np.zeros(chains[0].coefficients.shape[1])
    found[0, :-2, 0] = [*middle, *lever_arms(bundle([between], len(still)), still, still)[0]]
    found[0, -2:, 0] = threshold.max() + away * INFLATION, 1.0
    return found
