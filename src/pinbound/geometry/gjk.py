"""The point of a convex body nearest to the origin, from the support function of the body.

This is the algorithm of Gilbert, Johnson and Keerthi (1988). v is the point nearest to the origin in the hull of up to
four corners, and the next corner s(v) is the furthest corner of the body against v. Then

    v . s(v) / |v| <= distance <= |v|,

so every answer has its own proof: the search ends when both sides agree up to rounding. `docs/hulls.md`.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations

import numpy as np

from pinbound.geometry.exact_nearest import nearest_exactly
from pinbound.geometry.vectors import cross, dot
from pinbound.tolerances import NEARLY_TOUCHING, PROVEN_GAP, UNIT_ROUNDOFF
from pinbound.typing import Array, Flags, Indices

__all__ = ["AGREE", "INSIDE", "MOST_ROUNDS", "nearest_vertices", "reach", "search", "settled"]

Support = Callable[[Array, Indices], tuple[Array, Array, Array]]

MOST_ROUNDS = 60
AGREE = 8.0 * UNIT_ROUNDOFF  # relative to the furthest corner: the largest difference of both bounds at the end
INSIDE = 1e-8  # relative to four corners: beyond this distance from the origin, they are a flat body with rounding
_FIRST, _SECOND = np.array(list(combinations(range(4), 2))).T  # corners of the six edges
_FACES = np.array(list(combinations(range(4), 3)))  # of the four faces
_FEATURES = 14


def nearest_vertices(w: Array, directions: Array, corners: tuple[Array, Array]) -> tuple[Array, Array]:
    """Return t (N, m) for which `|w + sum_i t_i e_i|` is least, and a proven lower bound of that distance (N,).

    t runs over the product of two convex hulls: its first m_a entries over the hull of the rows of `corners[0]`, the
    others over that of the rows of `corners[1]`. The bound is zero or less if the origin is inside; minus it is then
    the radius of a ball around the origin that is inside, too.

    Args:
        w: (N, 3).
        directions: (m, N, 3), the e_i.
        corners: (k_a, m_a) and (k_b, m_b), m_a + m_b = m.

    Example:
        >>> w, axes = np.array([[2.0, 0.25, 0.25]]), np.repeat(np.eye(3)[:, None], 1, axis=1)
        >>> tetrahedron = np.array([[0.0, 0, 0], [-1.0, 0, 0], [0, -1.0, 0], [0, 0, -1.0]])
        >>> t, bound = nearest_vertices(w, axes, (tetrahedron, np.zeros((1, 0))))
        >>> t.round(9).tolist(), bound.round(9).tolist()
        ([[-1.0, 0.0, 0.0]], [1.06066...])
    """
    a, b = corners
    split = a.shape[1]

    def support(v: Array, rows: Indices) -> tuple[Array, Array, Array]:
        base, edges = w[rows], directions[:, rows]
        along = np.einsum("kni,ni->nk", edges, v)
        first, second = along[:, :split] @ a.T, along[:, split:] @ b.T
        corner = np.hstack((a[np.argmin(first, axis=1)], b[np.argmin(second, axis=1)]))
        x = base + np.einsum("nk,kni->ni", corner, edges)
        return x, np.einsum("ni,ni->n", x, v), corner

    middle = np.concatenate((a.mean(axis=0), b.mean(axis=0)))
    start = w + np.einsum("k,kni->ni", middle, directions)
    scale = reach(w, directions, corners)
    return settled(w, directions, corners, *search(w, directions, support, start, scale))


def settled(w: Array, directions: Array, corners: tuple[Array, Array], t: Array, bound: Array) -> tuple[Array, Array]:
    """Return t and bound of a search; unproven ones (touching slivers) are computed in integers.

    For bodies `NEARLY_TOUCHING` apart the distance is proven to `PROVEN_GAP`, for nearer ones to `AGREE`, both relative
    to the size.
    """
    scale = reach(w, directions, corners)
    with np.errstate(invalid="ignore"):
        length = np.linalg.norm(w + np.einsum("nk,kni->ni", t, directions), axis=1)
        enough = np.where(length > NEARLY_TOUCHING * scale, PROVEN_GAP, AGREE) * scale
        rough = (length - np.maximum(bound, 0.0) > enough) & ~((bound < 0.0) & (length <= AGREE * scale))
    for row in np.flatnonzero(rough).tolist():
        t[row] = nearest_exactly(w[row], directions[:, row], corners)
    return t, bound


def reach(w: Array, directions: Array, corners: tuple[Array, Array]) -> Array:
    """Return a bound of `|w + sum_i t_i e_i|` over all t (N,), to which rounding is relative."""
    lengths = np.linalg.norm(directions, axis=2)
    split = corners[0].shape[1]
    sides = zip((lengths[:split], lengths[split:]), corners, strict=True)
    return np.linalg.norm(w, axis=1) + sum((np.abs(c) @ part).max(axis=0) for part, c in sides)


def search(w: Array, edges: Array, support: Support, start: Array, scale: Array) -> tuple[Array, Array]:
    """Return the least t (N, k), and a proven lower bound of the distance (N,); zero or less if the origin is inside.

    Args:
        w: (N, 3).
        edges: (k, N, 3).
        support: Takes v (n, 3) of some rows, and the indices of these rows (n,). Returns the corner furthest against v
            (n, 3), its product with v (n,), and its t (n, k).
        start: (N, 3) the first search direction.
        scale: (N,) the lengths to which rounding is relative.
    """
    count, k = len(w), len(edges)
    t, bound = np.zeros((count, k)), np.full(count, np.nan)
    rows = np.flatnonzero(np.all(np.isfinite(w), axis=1) & np.all(np.isfinite(edges), axis=(0, 2)))
    points, corners = np.zeros((count, 4, 3)), np.zeros((count, 4, k))
    used = np.zeros((count, 4), dtype=np.bool_)
    v, shortest = start.copy(), np.full(count, np.inf)
    bound[rows] = 0.0
    for _ in range(MOST_ROUNDS):
        if not len(rows):
            break
        x, towards, corner = support(v[rows], rows)
        length = np.sqrt(np.einsum("ni,ni->n", v[rows], v[rows]))
        below = np.divide(towards, length, out=np.zeros_like(length), where=length > 0.0)
        bound[rows] = np.maximum(bound[rows], below)
        known = np.all(corners[rows] == corner[:, None], axis=2) & used[rows]  # no new corner: v is the nearest
        agree = length - np.maximum(below, 0.0) <= AGREE * scale[rows]  # zero up to rounding has no direction
        stalled = length >= shortest[rows] * (1.0 - AGREE)  # the corner is new only by rounding
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


def _nearest_in_hull(points: Array, used: Flags) -> tuple[Array, Array]:
    """Return the weights (N, 4) of the hull's point nearest to the origin, and the depth inside four corners (N,).

    The point is the nearest of a corner, an edge or a face: all fourteen are tried at once.
    """
    count = len(points)
    weights = np.zeros((count, _FEATURES, 4))
    weights[:, :4] = np.eye(4)
    valid = np.empty((count, _FEATURES), dtype=np.bool_)
    valid[:, :4] = used
    a, along = points[:, _FIRST], points[:, _SECOND] - points[:, _FIRST]
    square = dot(along, along)
    t = np.divide(-dot(a, along), square, out=np.full_like(square, -1.0), where=square > 0.0)
    edges = np.arange(4, 10)
    weights[:, edges, _FIRST], weights[:, edges, _SECOND] = 1.0 - t, t
    valid[:, 4:10] = used[:, _FIRST] & used[:, _SECOND] & (t >= 0.0) & (t <= 1.0)
    a, b, c = (points[:, _FACES[:, corner]] for corner in range(3))
    n = cross(b - a, c - a)
    areas = np.stack((dot(n, cross(b, c)), dot(n, cross(c, a)), dot(n, cross(a, b))), axis=2)
    square = areas.sum(axis=2, keepdims=True)  # not |n|^2, with which weights of a sliver add up badly
    shares = np.divide(areas, square, out=np.full_like(areas, -1.0), where=square > 0.0)
    weights[:, np.arange(10, 14)[:, None], _FACES] = shares
    valid[:, 10:] = used[:, _FACES].all(axis=2) & (shares >= 0.0).all(axis=2)
    r = weights @ points
    best = np.argmin(np.where(valid, dot(r, r), np.inf), axis=1)
    chosen = weights[np.arange(count), best]
    deep = np.zeros(count)
    full = np.flatnonzero(used.all(axis=1))
    if len(full):
        found, depth = _tetrahedron(points[full])
        r = np.einsum("ns,nsi->ni", found, points[full])
        near = np.sqrt(dot(r, r)) <= INSIDE * np.linalg.norm(points[full], axis=2).max(axis=1)
        inside = np.all(found > 0.0, axis=1) & (depth > 0.0) & near
        deep[full[inside]], chosen[full[inside]] = depth[inside], found[inside]
    return chosen, deep


def _tetrahedron(points: Array) -> tuple[Array, Array]:
    """Return barycentric coordinates (N, 4) of the origin (negative for a flat body), and its depth inside."""
    a, b, c = (points[:, _FACES[::-1, corner]] for corner in range(3))  # the face without corner 0, 1, 2, 3
    volume = dot(a, cross(b, c)) * np.array([1.0, -1.0, 1.0, -1.0])
    normal = cross(b - a, c - a)
    area = np.sqrt(dot(normal, normal))
    depth = np.divide(np.abs(volume), area, out=np.zeros_like(area), where=area > 0.0).min(axis=1)
    total = volume.sum(axis=1, keepdims=True)
    return np.divide(volume, total, out=np.full_like(volume, -1.0), where=np.abs(total) > 0.0), depth
