"""The vertices of many pairs of bodies: the lowest vertex along a direction, and the cost of the others.

The vector between two bodies is `r(t) = w + sum_i t_i e_i`, where t runs over the product of two convex hulls, one for
each body. Their corners are coefficients of the edges e_i: none for a point, 0 and 1 for a segment, metres along
orthogonal unit vectors for a polytope. Along a vector n, the minimum of every body is at a corner,

    min_t n . r(t) = n . w + min_c (n . E_a) . c + min_c (n . E_b) . c,

so a pair needs only its few edges at a configuration, and no chain for a vertex. Bodies with the same corners share a
table; one matrix product serves all rows with the same table. `docs/hull-proofs.md`.
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
_TABLE = 3  # edges of a body that is in the table


@dataclass(frozen=True, eq=False)
class Side:
    """One body of some pairs: its corners, and the indices of its edges among those of the pair.

    Attributes:
        corners: (k, m) coefficients of its edge vectors.
        columns: Indices of its m edges among those of the pair.
    """

    corners: Array
    columns: slice


@dataclass(frozen=True, eq=False)
class Corners:
    """The corners of m pairs.

    Attributes:
        sides: Distinct sides.
        which: (m, 2) index in `sides` for the first and second body of each pair; -1 for a point.
        spread: (m, K) the largest absolute coefficient of each edge; at most K edges.
        middle: (m, K) coefficients of a point inside both bodies.
        scatter: (m, K, K) covariance of the coefficients of all pairs of corners.
        searched: (m,) whether the nearest points have no closed form.
        pairs: The corners of the two bodies of each pair.
        wide: (m,) whether a body has more than three edges, so that it is not in the table.
        table: (V, 3) the corners of all sides, as coefficients of three edges each.
        bodies: (m, 4) first corner in the table and number of corners of each body; zero for a point.
        slots: (m, 6) indices of the three edges of each body among those of the pair; K where there is none.
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
        """Whether each pair has each side, (sides, m)."""
        return np.array([np.any(self.which == number, axis=1) for number in range(len(self.sides))])

    def asked(self, which: Indices) -> Iterator[tuple[Side, Indices | slice]]:
        """Return each side with the rows (of pairs `which`) that need it, in parts of limited size."""
        for side, has in zip(self.sides, self.members, strict=True):
            rows = np.flatnonzero(has[which])
            step = max(1, _MOST_NUMBERS // len(side.corners))
            if len(rows) == len(which) <= step:
                yield side, slice(None)
                continue
            for start in range(0, len(rows), step):
                yield side, rows[start : start + step]

    def least(self, which: Indices, along: Array) -> tuple[Array, Array]:
        """Return the minimum of `sum_i t_i along_i` (N,) for pairs `which` (N,), and the corner's t (N, K).

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
        """Return how far corners may fall below the lowest corner of the middle, if it moves like t (N,) [m].

        A corner at the distance d from t is above the lowest corner by its height, and decreases relative to t by at
        most `sum |n . E' d|` over all rates. A corner that stays above costs nothing. The result is at most zero.

        Args:
            which: (N,) the pair of each row.
            along: (N, K) `n . e_i`.
            rates: (N, K) each, `n . e_i'` over half the piece, or over half the box in each coordinate.
            t: (N, K) any points on the bodies; the nearest points cost least.
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
    """Return the corners of pairs; equal corners are stored once.

    Args:
        pairs: The corners (k, m_a) and (k, m_b) of the two bodies of each pair; m is zero for a point.
        edges: The number K of edges to which every pair is padded.
        searched: Whether the nearest points of each pair have no closed form.
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
