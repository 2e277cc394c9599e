"""The t in [0, 1] that make `|w + sum_i t_i e_i|` least, for any number of ways e_i: boxes and prisms.

`Z = {w + sum_i t_i e_i}` is convex, and its furthest point against a direction v is a corner, `t_i = [v . e_i < 0]`. So
Z is handled by its corners alone, as in the algorithm of Gilbert, Johnson and Keerthi (1988): v is the point nearest to
the origin of the hull of up to four corners, and the next corner is the furthest against v. With it

    v . s(v) / |v| <= distance <= |v|,     s(v) being that corner,

so that every answer carries its own proof: the search ends when both sides agree to rounding. Where they do not, as of
flat bodies with the origin in their plane, the t that are free are solved for once more. `docs/segments.md`. Where
there is Numba, and enough to do, `kernel/searched.py` does the same in machine code.
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
_WORTH_LOADING, _WORTH_COMPILING = 2_000, 50_000  # rows: 20 ms, and half a second, in NumPy
_INSIDE = 1e-8  # relative to four corners: further from the origin, what they say of it is rounding of a flat body
_SINGULAR = 1e-12  # relative: directions in which ways lead less far do not count as theirs
_FIRST, _SECOND = np.array(list(combinations(range(4), 2))).T  # corners of the six edges
_FACES = np.array(list(combinations(range(4), 3)))  # of the four faces
_FEATURES = 14


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
    if _is_worth_compiling(len(ways), len(w)):
        from pinbound.interpreters.kernel.searched import search

        t, bound = search(w, ways, _AGREE, _MOST_ROUNDS, _INSIDE)
    else:
        t, bound = _in_numpy(w, ways)
    t = np.clip(t, 0.0, 1.0)  # weights add up to one but for rounding
    scale = np.linalg.norm(w, axis=1) + np.linalg.norm(ways, axis=2).sum(axis=0)
    with np.errstate(invalid="ignore"):
        apart = np.linalg.norm(w + np.einsum("nk,kni->ni", t, ways), axis=1) - np.maximum(bound, 0.0)
    rough = np.flatnonzero(apart > _AGREE * scale)
    t[rough] = _solved(w[rough], np.moveaxis(ways[:, rough], 0, 2), t[rough])
    return t, bound


def _is_worth_compiling(k: int, rows: int) -> bool:
    """Count rows, and say whether there have been enough to pay for loading machine code, or for compiling it."""
    _rows[k] = _rows.get(k, 0) + rows
    if _rows[k] < _WORTH_LOADING:
        return False
    from pinbound.interpreters.kernel.compiled import has_numba
    from pinbound.interpreters.kernel.searched import is_ready

    return has_numba() and (_rows[k] >= _WORTH_COMPILING or is_ready(k, _AGREE, _MOST_ROUNDS, _INSIDE))


_rows: dict[int, int] = {}


def _in_numpy(w: Array, ways: Array) -> tuple[Array, Array]:
    count, k = len(w), len(ways)
    t, bound = np.zeros((count, k)), np.full(count, np.nan)
    rows = np.flatnonzero(np.all(np.isfinite(w), axis=1) & np.all(np.isfinite(ways), axis=(0, 2)))
    scale = np.linalg.norm(w, axis=1) + np.linalg.norm(ways, axis=2).sum(axis=0)
    points, corners = np.zeros((count, 4, 3)), np.zeros((count, 4, k))
    used = np.zeros((count, 4), dtype=np.bool_)
    v, shortest = w + 0.5 * ways.sum(axis=0), np.full(count, np.inf)
    bound[rows] = 0.0
    for _ in range(_MOST_ROUNDS):
        if not len(rows):
            break
        x, towards, corner = _support(v[rows], w[rows], ways[:, rows])
        length = np.sqrt(np.einsum("ni,ni->n", v[rows], v[rows]))
        below = np.divide(towards, length, out=np.zeros_like(length), where=length > 0.0)
        bound[rows] = np.maximum(bound[rows], below)
        known = np.all(corners[rows] == corner[:, None], axis=2) & used[rows]  # no further corner: v is the nearest
        agree = length - np.maximum(below, 0.0) <= _AGREE * scale[rows]  # zero to rounding has no direction to look in
        stalled = length >= shortest[rows] * (1.0 - _AGREE)  # the corner is new by rounding alone
        has_corners = used[rows].any(axis=1)
        done = np.any(known, axis=1) | (has_corners & (agree | stalled))
        shortest[rows[has_corners]] = length[has_corners]
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
    """Return the weights (N, 4) of the hull's point nearest to the origin, and how deep inside four it lies (N,).

    The point is the nearest of a corner, an edge or a face: all fourteen are tried at once.
    """
    count = len(points)
    weights = np.zeros((count, _FEATURES, 4))
    weights[:, :4] = np.eye(4)
    valid = np.empty((count, _FEATURES), dtype=np.bool_)
    valid[:, :4] = used
    a, along = points[:, _FIRST], points[:, _SECOND] - points[:, _FIRST]
    square = _dot(along, along)
    t = np.divide(-_dot(a, along), square, out=np.full_like(square, -1.0), where=square > 0.0)
    edges = np.arange(4, 10)
    weights[:, edges, _FIRST], weights[:, edges, _SECOND] = 1.0 - t, t
    valid[:, 4:10] = used[:, _FIRST] & used[:, _SECOND] & (t >= 0.0) & (t <= 1.0)
    a, b, c = (points[:, _FACES[:, corner]] for corner in range(3))
    n = _cross(b - a, c - a)
    areas = np.stack((_dot(n, _cross(b, c)), _dot(n, _cross(c, a)), _dot(n, _cross(a, b))), axis=2)
    square = areas.sum(axis=2, keepdims=True)  # |n|^2 but for rounding, with which a sliver's weights would not add up
    shares = np.divide(areas, square, out=np.full_like(areas, -1.0), where=square > 0.0)
    weights[:, np.arange(10, 14)[:, None], _FACES] = shares
    valid[:, 10:] = used[:, _FACES].all(axis=2) & (shares >= 0.0).all(axis=2)
    r = weights @ points
    best = np.argmin(np.where(valid, _dot(r, r), np.inf), axis=1)
    chosen = weights[np.arange(count), best]
    deep = np.zeros(count)
    full = np.flatnonzero(used.all(axis=1))
    if len(full):
        found, depth = _tetrahedron(points[full])
        r = np.einsum("ns,nsi->ni", found, points[full])
        near = np.sqrt(_dot(r, r)) <= _INSIDE * np.linalg.norm(points[full], axis=2).max(axis=1)
        inside = np.all(found > 0.0, axis=1) & (depth > 0.0) & near
        deep[full[inside]], chosen[full[inside]] = depth[inside], found[inside]
    return chosen, deep


def _tetrahedron(points: Array) -> tuple[Array, Array]:
    """Return barycentric coordinates (N, 4) of the origin, negative where all is flat, and its depth inside."""
    a, b, c = (points[:, _FACES[::-1, corner]] for corner in range(3))  # the face without corner 0, 1, 2, 3
    volume = _dot(a, _cross(b, c)) * np.array([1.0, -1.0, 1.0, -1.0])
    normal = _cross(b - a, c - a)
    area = np.sqrt(_dot(normal, normal))
    depth = np.divide(np.abs(volume), area, out=np.zeros_like(area), where=area > 0.0).min(axis=1)
    total = volume.sum(axis=1, keepdims=True)
    return np.divide(volume, total, out=np.full_like(volume, -1.0), where=np.abs(total) > 0.0), depth


def _dot(a: Array, b: Array) -> Array:
    return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]


def _cross(a: Array, b: Array) -> Array:
    x, y, z = a[..., 0], a[..., 1], a[..., 2]
    u, v, w = b[..., 0], b[..., 1], b[..., 2]
    return np.stack((y * w - z * v, z * u - x * w, x * v - y * u), axis=-1)
