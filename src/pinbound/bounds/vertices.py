"""The vertices of many pairs of bodies: which of them is least along a direction, and what the others cost.

The vector between two bodies is `r(t) = w + sum_i t_i e_i`, where t runs over the product of two convex hulls, one of
each body, whose corners are given as coefficients of the edges e_i: none of a point, 0 and 1 of a segment, metres along
orthogonal unit vectors of a polytope. Along a vector n every body is least at a corner,

    min_t n . r(t) = n . w + min_c (n . E_a) . c + min_c (n . E_b) . c,

so that a pair needs its few edges at a configuration, and never a chain for a vertex. Bodies with the same corners
share a table; rows that ask for one table are looked up in one matrix product. `docs/hull-proofs.md`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pinbound.tolerances import INFLATION
from pinbound.typing import Array, Flags, Indices

__all__ = ["Corners", "Side", "corners_of"]

_MOST_NUMBERS = 1 << 21  # of a table of rows and vertices at a time, to bound memory
_TABLE = 3  # edges of a body that stands in the table


@dataclass(frozen=True, eq=False)
class Side:
    """One body of some pairs: its corners, and where its edges stand among the pair's.

    Attributes:
        corners: (k, m) coefficients of its edge vectors.
        columns: Its m edges among those of the pair.
    """

    corners: Array
    columns: slice


@dataclass(frozen=True, eq=False)
class Corners:
    """The corners of m pairs.

    Attributes:
        sides: Distinct sides.
        which: (m, 2) index among them, of the first and second body of each pair; -1 of a point.
        spread: (m, K) the largest coefficient of each edge, in size; K edges at most.
        middle: (m, K) coefficients of a place inside both bodies.
        scatter: (m, K, K) covariance of the coefficients of all pairs of corners.
        searched: (m,) whether the nearest places have no closed form.
        pairs: Of each pair the corners of its two bodies.
        wide: (m,) whether a body has more than three edges, so that it does not stand in the table.
        table: (V, 3) the corners of all sides, as coefficients of three edges each.
        bodies: (m, 4) first corner in the table and number of corners of either body; zero of a point.
        slots: (m, 6) where the three edges of either body stand among the pair's; K where there is none.
    """

    sides: tuple[Side, ...]
    which: Indices
    spread: Array
    middle: Array
    scatter: Array
    searched: Flags
    pairs: tuple[tuple[Array, Array], ...]
    wide: Flags
    table: Array
    bodies: Array
    slots: Indices

    @cached_property
    def members(self) -> Flags:
        """Which pairs have each side, (sides, m)."""
        return np.array([np.any(self.which == number, axis=1) for number in range(len(self.sides))])

    def asked(self, which: Indices) -> Iterator[tuple[Side, Indices | slice]]:
        """Return each side with the rows (of pairs `which`) that ask for it, not too many at a time."""
        for side, has in zip(self.sides, self.members, strict=True):
            rows = np.flatnonzero(has[which])
            step = max(1, _MOST_NUMBERS // len(side.corners))
            if len(rows) == len(which) <= step:
                yield side, slice(None)
                continue
            for start in range(0, len(rows), step):
                yield side, rows[start : start + step]

    def least(self, which: Indices, along: Array) -> tuple[Array, Array]:
        """Return the least `sum_i t_i along_i` (N,) of pairs `which` (N,), and the corner's t (N, K).

        Args:
            which: (N,) the pair of each row.
            along: (N, K) `n . e_i`.
        """
        value, chosen = np.zeros(len(which)), np.zeros_like(along)
        for side, rows in self.asked(which):
            heights = along[rows, side.columns] @ side.corners.T
            star = heights.argmin(axis=1)
            value[rows] += heights[np.arange(len(star)), star]
            chosen[rows, side.columns] = side.corners[star]
        return value, chosen

    def slack(self, which: Indices, along: Array, rates: Sequence[Array], t: Array) -> Array:
        """Return by how much corners may pass below the one that is least in the middle, if that moves as t (N,) [m].

        A corner that leads away from t by d is above the least one by its height there, and falls against t by no more
        than `sum |n . E' d|` of all rates. What stays above costs nothing. Zero or less.

        Args:
            which: (N,) the pair of each row.
            along: (N, K) `n . e_i`.
            rates: (N, K) each, `n . e_i'` over half the piece, or half across the box in each coordinate.
            t: (N, K) any places on the bodies; the nearest ones cost least.
        """
        found = np.zeros(len(which))
        for side, rows in self.asked(which):
            corners, columns = side.corners, side.columns
            heights = along[rows, columns] @ corners.T
            rest = heights - heights.min(axis=1)[:, None]
            for rate in rates:
                there = np.einsum("nk,nk->n", rate[rows, columns], t[rows, columns])
                rest -= np.abs(rate[rows, columns] @ corners.T - there[:, None]) * INFLATION
            found[rows] += np.minimum(rest.min(axis=1), 0.0)
        return found


def corners_of(
    pairs: Sequence[tuple[Array, Array]],
    edges: int,
    searched: Sequence[bool],
) -> Corners:
    """Return the corners of pairs, those that are equal once.

    Args:
        pairs: Of each pair the corners (k, m_a) and (k, m_b) of its two bodies; m is zero for a point.
        edges: The number K of edges that every pair is padded to.
        searched: Of each pair whether its nearest places have no closed form.
    """
    sides: list[Side] = []
    known: dict[tuple[bytes, ...], int] = {}
    which = np.full((len(pairs), 2), -1, dtype=np.intp)
    spread, middle = np.zeros((len(pairs), edges)), np.zeros((len(pairs), edges))
    scatter = np.zeros((len(pairs), edges, edges))
    for row, bodies in enumerate(pairs):
        start = 0
        for number, corners in enumerate(bodies):
            m = corners.shape[1]
            columns, start = slice(start, start + m), start + m
            if not m:
                continue
            spread[row, columns], middle[row, columns] = np.abs(corners).max(axis=0), corners.mean(axis=0)
            scatter[row, columns, columns] = np.cov(corners.T, bias=True)
            key = (corners.tobytes(), bytes([columns.start, m]))
            if key not in known:
                known[key] = len(sides)
                sides.append(Side(corners, columns))
            which[row, number] = known[key]
    bodies, slots = np.zeros((len(pairs), 4)), np.full((len(pairs), 2 * _TABLE), edges, dtype=np.intp)
    wide = np.array([max(corners.shape[1] for corners in bodies) > _TABLE for bodies in pairs], dtype=np.bool_)
    tables = [np.zeros((0, _TABLE))]
    starts = np.zeros(len(sides))
    for number, side in enumerate(sides):
        m, starts[number] = side.corners.shape[1], sum(map(len, tables))
        if m <= _TABLE:
            tables.append(np.pad(side.corners, ((0, 0), (0, _TABLE - m))))
    placed: list[list[int]] = np.argwhere((which >= 0) & ~wide[:, None]).tolist()
    for row, number in placed:
        side = sides[int(which[row, number])]
        bodies[row, 2 * number : 2 * number + 2] = starts[which[row, number]], len(side.corners)
        columns = range(side.columns.start, side.columns.stop)
        slots[row, _TABLE * number : _TABLE * number + len(columns)] = columns
    return Corners(
        sides=tuple(sides),
        which=which,
        spread=spread,
        middle=middle,
        scatter=scatter,
        searched=np.array(searched, dtype=np.bool_),
        pairs=tuple(pairs),
        wide=wide,
        table=np.vstack(tables),
        bodies=bodies,
        slots=slots,
    )
