"""The t in [0, 1] that make `|w + sum_i t_i e_i|` least, for any number of ways e_i: boxes and prisms.

`Z = {w + sum_i t_i e_i}` is convex, and its furthest point against a direction v is a corner, `t_i = [v . e_i < 0]`. So
Z is handled by its corners alone, as in the algorithm of Gilbert, Johnson and Keerthi (1988): v is the point nearest to
the origin of the hull of up to four corners, and the next corner is the furthest against v. With it

    v . s(v) / |v| <= distance <= |v|,     s(v) being that corner,

so that every answer carries its own proof: the search ends when both sides agree to rounding. Where they do not, as of
flat bodies with the origin in their plane, the t that are free are solved for once more. `docs/segments.md`.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from pinbound.tolerances import UNIT_ROUNDOFF

__all__ = ["nearest_corners"]

Array = NDArray[np.float64]

_MOST_ROUNDS = 60
_AGREE = 8.0 * UNIT_ROUNDOFF  # relative to the furthest corner: both bounds differ by no more
_INSIDE = 1e-8  # relative to four corners: further from the origin, what they say of it is rounding of a flat body
_SINGULAR = 1e-12  # relative: directions in which ways lead less far do not count as theirs
_SUBSETS = tuple(subset for size in (1, 2, 3) for subset in combinations(range(4), size))


def nearest_corners(w: Array, ways: Array) -> tuple[Array, Array]:
    """Return the least t (N, k), and a proven lower bound of the distance (N,), zero or less if the origin is inside.

    Outside, bound and distance agree but for rounding. Inside, a ball of minus the bound around the origin is inside,
    too: within the four corners at which the search ended; zero if it ended with fewer.

    Args:
        w: (N, 3).
        ways: (k, N, 3).

    Example:
        >>> w = np.array([[-0.25, 1.0, -0.5], [-0.5, -0.5, -0.5]])  # a unit cube beside, and around the origin
        >>> t, bound = nearest_corners(w, np.repeat(np.eye(3)[:, None], 2, axis=1))
        >>> bound.round(12).tolist(), t[0].round(12).tolist()
        ([1.0, 0.0], [0.25, 0.0, 0.5])
    """
    count, k = len(w), len(ways)
    t, bound = np.zeros((count, k)), np.full(count, np.nan)
    rows = np.flatnonzero(np.all(np.isfinite(w), axis=1) & np.all(np.isfinite(ways), axis=(0, 2)))
    scale = np.linalg.norm(w, axis=1) + np.linalg.norm(ways, axis=2).sum(axis=0)
    points, corners = np.zeros((count, 4, 3)), np.zeros((count, 4, k))
    used = np.zeros((count, 4), dtype=np.bool_)
    v = w + 0.5 * ways.sum(axis=0)
    bound[rows] = 0.0
    for _ in range(_MOST_ROUNDS):
        if not len(rows):
            break
        x, towards, corner = _support(v[rows], w[rows], ways[:, rows])
        length = np.sqrt(np.einsum("ni,ni->n", v[rows], v[rows]))
        below = np.divide(towards, length, out=np.zeros_like(length), where=length > 0.0)
        bound[rows] = np.maximum(bound[rows], below)
        known = np.all(corners[rows] == corner[:, None], axis=2) & used[rows]  # no further corner: v is the nearest
        done = np.any(known, axis=1) | (used[rows].any(axis=1) & (length - below <= _AGREE * scale[rows]))
        rows, x, corner = rows[~done], x[~done], corner[~done]
        if not len(rows):
            break
        slot = np.argmin(used[rows], axis=1)
        points[rows, slot], corners[rows, slot], used[rows, slot] = x, corner, True
        weights, depth = _nearest_in_hull(points[rows], used[rows])
        inside = depth > 0.0
        used[rows] = weights > 0.0
        v[rows] = np.einsum("ns,nsi->ni", weights, points[rows])
        t[rows] = np.einsum("ns,nsk->nk", weights, corners[rows])
        bound[rows[inside]] = -depth[inside]
        rows = rows[~inside]
    t = np.clip(t, 0.0, 1.0)  # weights add up to one but for rounding
    apart = np.linalg.norm(w + np.einsum("nk,kni->ni", t, ways), axis=1) - np.maximum(bound, 0.0)
    rough = np.flatnonzero(apart > _AGREE * scale)
    t[rough] = _solved(w[rough], np.moveaxis(ways[:, rough], 0, 2), t[rough])
    return t, bound


def _solved(w: Array, ways: Array, t: Array) -> Array:
    """Return t (N, k) no worse: those between their ends solved for, the others as they are; ways (N, 3, k)."""
    r: Array = w + np.einsum("nik,nk->ni", ways, t)
    for _ in range(3):
        free = (t > 0.0) & (t < 1.0)
        inverse = np.linalg.pinv(ways * free[:, None], rcond=_SINGULAR).astype(np.float64)
        tried = np.clip(t - np.einsum("nki,ni->nk", inverse, r), 0.0, 1.0)
        left: Array = w + np.einsum("nik,nk->ni", ways, tried)
        better = (np.linalg.norm(left, axis=1) < np.linalg.norm(r, axis=1))[:, None]
        t, r = np.where(better, tried, t), np.where(better, left, r)
    return t


def _support(v: Array, w: Array, ways: Array) -> tuple[Array, Array, Array]:
    """Return the corner furthest against v (N, 3), its product with v (N,), and its t (N, k)."""
    corner = (np.einsum("kni,ni->nk", ways, v) < 0.0).astype(np.float64)
    x = w + np.einsum("nk,kni->ni", corner, ways)
    return x, np.einsum("ni,ni->n", x, v), corner


def _nearest_in_hull(points: Array, used: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Return the weights (N, 4) of the hull's point nearest to the origin, and how deep inside four it lies (N,)."""
    best = np.full(len(points), np.inf)
    weights = np.zeros((len(points), 4))
    for subset in _SUBSETS:
        there = np.all(used[:, subset], axis=1)
        if not np.any(there):
            continue
        corners = points[there][:, subset]
        found = (_vertex, _edge, _triangle)[len(subset) - 1](corners)
        r = np.einsum("ns,nsi->ni", found, corners)
        square = np.where(np.all(found >= 0.0, axis=1), np.einsum("ni,ni->n", r, r), np.inf)
        better = square < best[there]
        at = np.flatnonzero(there)[better]
        best[at] = square[better]
        weights[at] = 0.0
        weights[at[:, None], list(subset)] = found[better]
    deep = np.zeros(len(points))
    full = np.flatnonzero(used.all(axis=1))
    if len(full):
        found, depth = _tetrahedron(points[full])
        r = np.einsum("ns,nsi->ni", found, points[full])
        near = np.linalg.norm(r, axis=1) <= _INSIDE * np.linalg.norm(points[full], axis=2).max(axis=1)
        inside = np.all(found > 0.0, axis=1) & (depth > 0.0) & near
        deep[full[inside]], weights[full[inside]] = depth[inside], found[inside]
    return weights, deep


def _vertex(points: Array) -> Array:
    return np.ones((len(points), 1))


def _edge(points: Array) -> Array:
    a, b = points[:, 0], points[:, 1]
    along = b - a
    square = np.einsum("ni,ni->n", along, along)
    t = np.divide(-np.einsum("ni,ni->n", a, along), square, out=np.full(len(a), -1.0), where=square > 0.0)
    return np.stack((1.0 - t, t), axis=1)


def _triangle(points: Array) -> Array:
    a, b, c = (points[:, i] for i in range(3))
    n = np.cross(b - a, c - a)
    products = np.stack([np.einsum("ni,ni->n", n, np.cross(*pair)) for pair in ((b, c), (c, a), (a, b))], axis=1)
    total: Array = products.sum(
        axis=1, keepdims=True
    )  # |n|^2 but for rounding, with which a sliver's weights would not add up
    return np.divide(products, total, out=np.full_like(products, -1.0), where=total > 0.0)


def _tetrahedron(points: Array) -> tuple[Array, Array]:
    """Return barycentric coordinates (N, 4) of the origin, negative where all is flat, and its depth inside."""
    volumes: list[Array] = []
    depth = np.full(len(points), np.inf)
    for index in range(4):
        a, b, c = (points[:, i] for i in range(4) if i != index)
        volume = (-1.0) ** index * np.einsum("ni,ni->n", a, np.cross(b, c))
        area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
        depth = np.minimum(depth, np.divide(np.abs(volume), area, out=np.zeros_like(area), where=area > 0.0))
        volumes.append(volume)
    stacked: Array = np.stack(volumes, axis=1)
    total = stacked.sum(axis=1, keepdims=True)
    return np.divide(stacked, total, out=np.full_like(stacked, -1.0), where=np.abs(total) > 0.0), depth
