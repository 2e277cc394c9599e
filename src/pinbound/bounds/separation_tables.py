"""Pairs of bodies as tables for the machine code that bounds their separations, and the call of this code.

`swept_bounds` computes the same in NumPy, for few rows, and for bodies with more than three edge vectors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pinbound.bounds.bodies import SweptBundle
from pinbound.bounds.bounds import Expansion
from pinbound.bounds.code import Code
from pinbound.bounds.vertices import Corners
from pinbound.geometry.gjk import AGREE, MOST_ROUNDS
from pinbound.machine.compiled import has_numba
from pinbound.machine.separation_source import EDGES, LANES, PAIR, TABLES, room_of, separation_source
from pinbound.tolerances import OVERLAP, UNIT_ROUNDOFF
from pinbound.typing import Array, Flags, Indices

__all__ = ["SeparationTables", "is_worth", "separation_tables"]

_KNOWN = (64.0 * UNIT_ROUNDOFF) ** 2  # squared, relative: rounding alone may decide the sign of a smaller volume
_SHARP = 1e-4  # a squared sine: on flatter faces, the nearest point is corrected a second time
_FLAT = 64.0 * UNIT_ROUNDOFF**2  # a squared sine: a flatter face is treated as an edge

_ROWS = Code(separation_source, loading=300, compiling=20_000)
"""A row takes NumPy some 50 us near the end of a search, where few rows are left."""


@dataclass(frozen=True, eq=False)
class SeparationTables:
    """Tables of m pairs.

    Attributes:
        fits: (m,) whether the pair is in the tables: both bodies have at most three edge vectors.
        table: What the machine code reads.
        arms: Start of the lever arms of each pair, and its number of rotations.
        room: Number of float64 of working memory that the code needs.
    """

    fits: Flags
    table: Array
    arms: tuple[tuple[int, int], ...]
    room: int

    def with_arms(self, swept: SweptBundle) -> SeparationTables:
        """Return the same tables with other lever arms, which depend on the box of q if joints are prismatic."""
        table, rows = self.table.copy(), swept.rows
        for pair, (at, k) in enumerate(self.arms):
            if self.fits[pair]:
                table[at : at + k] = swept.arms[pair * rows, :k]
        return replace(self, table=table)

    def along_motion(self, which: Indices, piece: Expansion, rows: Indices, error: Array) -> tuple[Array, Array]:
        """Return value and lower bound (N,) of separations `which` on pieces `rows`, as `swept_bounds` does.

        Args:
            which: (N,) the pair of each row.
            piece: Some pieces.
            rows: (N,) the piece of each row.
            error: (m,) rounding bounds of all pairs [m].
        """
        count, n = piece.middle.shape
        parts = [piece.middle, piece.middle_radius, piece.slope, piece.slope_radius, piece.bend_radius]
        columns = [np.broadcast_to(part, (count, n)) for part in parts]
        columns.append(piece.slopes.reshape(count, -1))
        if piece.bends is not None:
            columns.append(piece.bends.reshape(count, -1))
        bends = -1 if piece.bends is None else piece.bends.shape[1]
        return self._run((0, piece.slopes.shape[1], bends), np.concatenate(columns, axis=1), which, rows, error)

    def over_box(self, which: Indices, centre: Array, half: Array, error: Array) -> tuple[Array, Array]:
        """Return value and lower bound (N,) of separations `which` over the boxes `centre +- half` (N, n)."""
        return self._run((1, 0, 0), np.concatenate((centre, half), axis=1), which, np.arange(len(which)), error)

    def _run(
        self, mode: tuple[int, int, int], records: Array, which: Indices, rows: Indices, error: Array
    ) -> tuple[Array, Array]:
        count, size = len(which), records.shape[1]
        rates = size // 2 if mode[0] else 1
        question = np.concatenate(([*mode, size, len(error), rates], error, records.ravel()), dtype=np.float64)
        index = np.empty((count, 2), dtype=np.int64)
        index[:, 0], index[:, 1] = which, rows
        out = np.empty(2 * count + self.room)
        _ROWS.run(question, out, 0, 0, self.table, count, index.ravel())
        found = out[: 2 * count].reshape(count, 2)
        return found[:, 0], found[:, 1]


def is_worth(rows: int, seconds: float) -> bool:
    """Count rows to come, and return whether there were enough to load machine code, or to compile it.

    `seconds` is the time for the whole work: compiling takes a few seconds.
    """
    return has_numba() and _ROWS.is_worth(rows, seconds)


class _Tape:
    """A sequence of numbers, in which equal parts are stored once."""

    def __init__(self) -> None:
        self.parts: list[Array] = [np.zeros(TABLES)]
        self.length = TABLES
        self.known: dict[bytes, int] = {}

    def place(self, numbers: Array, key: bytes = b"") -> int:
        """Return the index of the numbers; numbers with the key of earlier numbers share their index."""
        if key and key in self.known:
            return self.known[key]
        at = self.length
        self.parts.append(np.ascontiguousarray(numbers, dtype=np.float64).ravel())
        self.length += numbers.size
        if key:
            self.known[key] = at
        return at


def separation_tables(swept: SweptBundle) -> SeparationTables:
    """Return the tables of all pairs of a bundle that fit."""
    corners, rows, n = swept.corners, swept.rows, swept.chains.coefficients.shape[2]
    fits = np.array([max(c.shape[1] for c in bodies) <= EDGES for bodies in corners.pairs], dtype=np.bool_)
    tape, m = _Tape(), len(corners.pairs)
    pairs = np.zeros((m, PAIR))
    at_pairs = tape.place(pairs)
    arms: list[tuple[int, int]] = []
    most, most_blocks = 1, 1
    for pair in range(m):
        record, first = pairs[pair], pair * rows
        k = _rotations(swept.chains.coefficients[first])
        arms.append((tape.length, k))
        if not fits[pair]:
            continue
        C, axes = swept.chains.coefficients[first, :k], swept.chains.axes[first, :k]
        turns = np.hstack((C, axes))
        record[0], record[1] = k, tape.place(turns, b"turns" + turns.tobytes())
        blocks = 0
        slots = _slots(corners, pair)
        for vector, row in enumerate(slots):
            used = np.zeros((0, 4)) if row < 0 else _blocks(swept.chains.offsets[first + row, : k + 1])
            record[2 + 2 * vector : 4 + 2 * vector] = tape.place(used), len(used)
            blocks += len(used)
        slides = _slides(swept, first, k)
        record[16:18] = len(slides), tape.place(slides)
        arms[pair] = (tape.place(swept.arms[first, :k]), k)
        record[18] = arms[pair][0]
        for side, body in enumerate(corners.pairs[pair]):
            count = len(body)
            table = np.zeros((EDGES, -(-count // LANES) * LANES))
            table[: body.shape[1], :count], table[: body.shape[1], count:] = body.T, body[-1:].T
            at = tape.place(table, b"body" + table.tobytes())
            record[19 + 3 * side : 22 + 3 * side] = at, table.shape[1], count - 1
        record[25:38] = _measured(swept, pair)
        record[38:44] = _middle(corners, pair, slots)
        record[44] = _reach(swept, pair)
        most, most_blocks = max(most, k), max(most_blocks, blocks)
    table = np.concatenate(tape.parts)
    table[at_pairs : at_pairs + pairs.size] = pairs.ravel()
    table[:11] = n, at_pairs, most, most_blocks, 0.0, AGREE, MOST_ROUNDS, _KNOWN, OVERLAP, _FLAT, _SHARP
    table[16:24] = np.arange(LANES)
    return SeparationTables(fits, table, tuple(arms), room_of(most, most_blocks, n))


def _rotations(coefficients: Array) -> int:
    """Return the number of rotations that are not padding."""
    used = np.flatnonzero(np.any(coefficients, axis=1))
    return int(used[-1]) + 1 if len(used) else 0


def _slots(corners: Corners, pair: int) -> list[int]:
    """Return the rows of the chain and of three edge vectors of each body; -1 where there is none."""
    first, second = (body.shape[1] for body in corners.pairs[pair])
    sides = range(1, 1 + first), range(1 + first, 1 + first + second)
    return [0, *(row for side in sides for row in [*side, *[-1] * (EDGES - len(side))])]


def _blocks(offsets: Array) -> Array:
    """Return the nonzero blocks and their indices."""
    used = np.flatnonzero(np.any(offsets, axis=1))
    return np.column_stack((used.astype(np.float64), offsets[used]))


def _slides(swept: SweptBundle, first: int, k: int) -> Array:
    """Return the index, the directions and their lengths of each block with prismatic joints."""
    if swept.chains.slides is None:
        return np.zeros((0, 0))
    slides = swept.chains.slides[first, : k + 1]
    used = np.flatnonzero(np.any(slides, axis=(1, 2)))
    directions = np.moveaxis(slides[used], 1, 2).reshape(len(used), 3 * slides.shape[2])
    return np.column_stack((used.astype(np.float64), directions, np.linalg.norm(slides[used], axis=1)))


def _measured(swept: SweptBundle, pair: int) -> Array:
    """Return the kind of quantity, the normal or any direction that counts, and the projection."""
    projection, normal = swept.projection[pair], swept.normal[pair]
    if swept.is_signed[pair]:
        return np.array([2.0, *normal, *projection.ravel()])
    kind = 0.0 if np.array_equal(projection, np.eye(3)) else 1.0
    column = projection[:, int(np.argmax(np.linalg.norm(projection, axis=0)))]
    return np.array([kind, *(column / np.linalg.norm(column)), *projection.ravel()])


def _middle(corners: Corners, pair: int, slots: Sequence[int]) -> Array:
    """Return the coefficients of a point inside both bodies."""
    found = np.zeros(2 * EDGES)
    for vector, row in enumerate(slots[1:]):
        if row > 0:
            found[vector] = corners.middle[pair, row - 1]
    return found


def _reach(swept: SweptBundle, pair: int) -> float:
    """Return the largest distance of vertices from the point inside both bodies [m]."""
    first = pair * swept.rows + 1
    lengths = np.linalg.norm(swept.chains.offsets[first : first + swept.rows - 1], axis=2).sum(axis=1)
    return float(2.0 * swept.corners.spread[pair] @ lengths)
