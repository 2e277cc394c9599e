"""The t in [0, 1] that minimise `|w + sum_i t_i e_i|`, for any number of edge vectors e_i: boxes and prisms.

`Z = {w + sum_i t_i e_i}` is convex, and its furthest point against a direction v is a corner, `t_i = [v . e_i < 0]`. So
corners are sufficient, as in the algorithm of Gilbert, Johnson and Keerthi (1988): v is the point nearest to the origin
in the hull of up to four corners, and s(v), the corner furthest against v, is the next corner. Then

    v . s(v) / |v| <= distance <= |v|,     so every answer has its own proof: the search ends when both sides agree up
    to rounding. If they do not agree, as for flat bodies with the origin in their plane, the free t are computed once
    more. `docs/segments.md`. With Numba, and enough work, `machine/searched.py` does the same in machine code.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pinbound.geometry import gjk
from pinbound.typing import Array, Indices

__all__ = ["nearest_corners", "nearest_hulls", "nearest_in_tables"]


_WORTH_LOADING, _WORTH_COMPILING = 2_000, 50_000  # rows: 20 ms, and half a second, in NumPy
_TABLE = 3  # edge vectors of a body whose vertices stand in a table
_SINGULAR = 1e-12  # relative: directions in which edge vectors lead less far do not count as theirs


def nearest_corners(w: Array, edges: Array) -> tuple[Array, Array]:
    """Return the t (N, k) of the minimum, and a proven lower bound of the distance (N,), at most zero if it is inside.

    If the origin is outside, bound and distance agree up to rounding. If it is inside, a ball around it with the radius
    `-bound` is inside the hull of the four corners at which the search ended; zero if it ended with fewer corners.

    Args:
        w: (N, 3).
        edges: (k, N, 3).

    Example:
        >>> w = np.array([[-0.25, 1.0, -0.5], [-0.5, -0.5, -0.5]])  # a unit cube beside, and around the origin
        >>> t, bound = nearest_corners(w, np.repeat(np.eye(3)[:, None], 2, axis=1))
        >>> bound.round(12).tolist(), t[0].round(12).tolist()
        ([1.0, 0.0], [0.25, 0.0, 0.5])
    """
    if _is_worth_compiling(len(edges), len(w)):
        from pinbound.machine.searched import search

        t, bound = search(w, edges, gjk.AGREE, gjk.MOST_ROUNDS, gjk.INSIDE)
    else:
        t, bound = _in_numpy(w, edges)
    t = np.clip(t, 0.0, 1.0)  # weights add up to one but for rounding
    scale = np.linalg.norm(w, axis=1) + np.linalg.norm(edges, axis=2).sum(axis=0)
    with np.errstate(invalid="ignore"):
        apart = np.linalg.norm(w + np.einsum("nk,kni->ni", t, edges), axis=1) - np.maximum(bound, 0.0)
    rough = np.flatnonzero(apart > gjk.AGREE * scale)
    t[rough] = _solved(w[rough], np.moveaxis(edges[:, rough], 0, 2), t[rough])
    return t, bound


def nearest_hulls(w: Array, edges: Array, corners: tuple[Array, Array]) -> Array:
    """Return the t (N, m) that minimise `|w + sum_i t_i e_i|`, for t in the product of two hulls of corners.

    Args:
        w: (N, 3).
        edges: (m, N, 3).
        corners: (k_a, m_a) and (k_b, m_b), m_a + m_b = m.
    """
    counts = [one.shape[1] for one in corners]
    if max(counts) > _TABLE or not _is_worth_compiling(0, len(w)):
        return gjk.nearest_vertices(w, edges, corners)[0]
    slots = np.array([*range(counts[0]), *range(_TABLE, _TABLE + counts[1])], dtype=np.intp)
    padded = np.zeros((len(w), 2 * _TABLE, 3))
    padded[:, slots] = np.moveaxis(edges, 0, 1)
    table = np.vstack([np.pad(one, ((0, 0), (0, _TABLE - one.shape[1]))) for one in corners])
    bodies = np.array([0, len(corners[0]), len(corners[0]), len(corners[1])], dtype=np.float64)
    middle = np.concatenate([one.mean(axis=0) for one in corners])
    start = w + np.einsum("k,kni->ni", middle, edges)
    size = gjk.reach(w, edges, corners)
    t, bound = nearest_in_tables(w, padded, start, size, table, np.tile(bodies, (len(w), 1)))
    return gjk.settled(w, edges, corners, t[:, slots], bound)[0]


def nearest_in_tables(
    w: Array, edges: Array, start: Array, scale: Array, table: Array, bodies: Array
) -> tuple[Array, Array]:
    """Return the same t (N, 6) for many pairs, each row with its own two bodies, and a proven bound (N,) as in `gjk`.

    The few rows that float64 cannot decide (thin bodies that touch) are left as they are.

    Args:
        w: (N, 3).
        edges: (N, 6, 3): three of the first body, three of the second; zero where it has fewer.
        start: (N, 3), the first search direction.
        scale: (N,), the length to which rounding is relative.
        table: (V, 3), the vertices of all bodies as coefficients of their three edge vectors.
        bodies: (N, 4), first vertex and number of vertices of either body.
    """
    if _is_worth_compiling(0, len(w)):
        from pinbound.machine.searched import search_vertices

        return search_vertices(w, edges, start, scale, table, bodies, (gjk.AGREE, gjk.MOST_ROUNDS, gjk.INSIDE))
    sides: list[tuple[int, Array, NDArray[Any], int]] = []
    for side in (0, 1):
        kinds, kind = np.unique(bodies[:, 2 * side : 2 * side + 2], axis=0, return_inverse=True)
        for number, (first, many) in enumerate(kinds.astype(np.intp).tolist()):
            sides.append((side, table[first : first + many], kind, number))

    def support(v: Array, rows: Indices) -> tuple[Array, Array, Array]:
        along, t = np.einsum("nki,ni->nk", edges[rows], v), np.zeros((len(rows), 2 * _TABLE))
        for side, corners, kind, number in sides:
            mine, columns = np.flatnonzero(kind[rows] == number), slice(_TABLE * side, _TABLE * (side + 1))
            if len(corners):
                t[mine, columns] = corners[np.argmin(along[mine, columns] @ corners.T, axis=1)]
        x = w[rows] + np.einsum("nk,nki->ni", t, edges[rows])
        return x, np.einsum("ni,ni->n", x, v), t

    return gjk.search(w, np.moveaxis(edges, 1, 0), support, start, scale)


def _is_worth_compiling(k: int, rows: int) -> bool:
    """Count rows, and return whether there were enough to load machine code, or to compile it."""
    _rows[k] = _rows.get(k, 0) + rows
    if _rows[k] < _WORTH_LOADING:
        return False
    from pinbound.machine.compiled import has_numba
    from pinbound.machine.searched import is_ready

    return has_numba() and (_rows[k] >= _WORTH_COMPILING or is_ready(k, gjk.AGREE, gjk.MOST_ROUNDS, gjk.INSIDE))


_rows: dict[int, int] = {}


def _in_numpy(w: Array, edges: Array) -> tuple[Array, Array]:
    def support(v: Array, rows: Indices) -> tuple[Array, Array, Array]:
        corner = (np.einsum("kni,ni->nk", edges[:, rows], v) < 0.0).astype(np.float64)
        x = w[rows] + np.einsum("nk,kni->ni", corner, edges[:, rows])
        return x, np.einsum("ni,ni->n", x, v), corner

    scale = np.linalg.norm(w, axis=1) + np.linalg.norm(edges, axis=2).sum(axis=0)
    return gjk.search(w, edges, support, w + 0.5 * edges.sum(axis=0), scale)


def _solved(w: Array, edges: Array, t: Array) -> Array:
    """Return t (N, k) that are at least as good: free t are computed again, others stay; edges (N, 3, k)."""
    r: Array = w + np.einsum("nik,nk->ni", edges, t)
    for _ in range(3):
        free = (t > 0.0) & (t < 1.0)
        inverse = np.linalg.pinv(edges * free[:, None], rcond=_SINGULAR).astype(np.float64)
        tried = np.clip(t - np.einsum("nki,ni->nk", inverse, r), 0.0, 1.0)
        left: Array = w + np.einsum("nik,nk->ni", edges, tried)
        better = (np.linalg.norm(left, axis=1) < np.linalg.norm(r, axis=1))[:, None]
        t, r = np.where(better, tried, t), np.where(better, left, r)
    return t
