"""Nearest points of two segments or parallelograms: the t in [0, 1] that minimise `|w + t_1 e_1 + t_2 e_2 + ...|`.

`minimum_norm` is for more than two edge vectors. With two, the minimum of the convex function of t is on a side of the
square, or at a stationary point inside. On a side, `t = -w . e / |e|^2`, limited to [0, 1]. Inside, with `n = e_1 x
e_2`,

    t_1 = -(w x e_2) . n / |n|^2,     t_2 = -(e_1 x w) . n / |n|^2.

The denominator is `|n|^2` and not `|e_1|^2 |e_2|^2 - (e_1 . e_2)^2`, which loses all its digits if the segments are
parallel to 1e-8. Each t is limited to the square and moved to the foot on the other segment, so each of the five
candidates is a true distance between two points of the segments. The smallest candidate is the answer: rounding can
only choose wrongly between candidates that are equal up to rounding. `docs/segments.md`.
"""

from __future__ import annotations

import numpy as np

from pinbound.evaluate.minimum_norm import nearest_corners, nearest_hulls
from pinbound.geometry.vectors import cross
from pinbound.tolerances import UNIT_ROUNDOFF
from pinbound.typing import Array

__all__ = ["lowest", "nearest", "nearest_of_hulls", "overlap", "overlap_in_plane"]

_PARALLEL = 1e-8  # sine, below which rounding makes the normal of two edge vectors
_FACE = 64  # unit roundoffs, relative to the furthest corner over the least sine: a unit normal and its products


def nearest(w: Array, edges: Array) -> Array:
    """Return the t (N, k) in [0, 1] at which `|w + sum_i t_i e_i|` is smallest.

    Args:
        w: (N, d), d being 3, or 2 across a line.
        edges: (k, N, d), the e_i; they may be zero.

    Example:
        >>> w, edges = np.array([[-0.25, 1.0, 0.0]]), np.array([[[1.0, 0.0, 0.0]], [[0.0, -2.0, 0.0]]])
        >>> nearest(w, edges[:1]).tolist(), nearest(w, edges).tolist()
        ([[0.25]], [[0.25, 0.5]])
    """
    if not len(edges):
        return np.empty((len(w), 0))
    if len(edges) == 1:
        with np.errstate(invalid="ignore"):
            return _foot(w, edges[0])[:, None]
    if len(edges) > 2:
        if w.shape[1] == 2:
            w, edges = np.pad(w, ((0, 0), (0, 1))), np.pad(edges, ((0, 0), (0, 0), (0, 1)))
        return nearest_corners(w, edges)[0]
    with np.errstate(invalid="ignore"):
        return _on_square(w, edges[0], edges[1])


def nearest_of_hulls(w: Array, edges: Array, corners: tuple[Array, Array]) -> Array:
    """Return the t (N, k) at which `|w + sum_i t_i e_i|` is smallest, for t in the product of two hulls of corners.

    Args:
        w: (N, d), d being 3, or 2 across a line.
        edges: (k, N, d), the e_i.
        corners: (k_a, m_a) and (k_b, m_b), m_a + m_b = k.
    """
    if w.shape[1] == 2:
        w, edges = np.pad(w, ((0, 0), (0, 1))), np.pad(edges, ((0, 0), (0, 0), (0, 1)))
    return nearest_hulls(w, edges, corners)


def lowest(edges: Array, corners: tuple[Array, Array]) -> Array:
    """Return the t (N, k) of the corner at which `sum_i t_i e_i` is smallest; the e_i are heights (k, N, 1).

    Example:
        >>> lowest(np.array([[[1.0]], [[-2.0]]]), (np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]), np.zeros((1, 0))))
        array([[0., 1.]])
    """
    heights, split = edges[:, :, 0].T, corners[0].shape[1]
    sides = zip((heights[:, :split], heights[:, split:]), corners, strict=True)
    return np.hstack([c[np.argmin(part @ c.T, axis=1)] for part, c in sides])


def _on_square(w: Array, first: Array, second: Array) -> Array:
    zero, one = np.zeros(len(w)), np.ones(len(w))
    candidates = [
        (zero, _foot(w, second)),
        (one, _foot(w + first, second)),
        (_foot(w, first), zero),
        (_foot(w + second, first), one),
        _inside(w, first, second),
    ]
    s, t = np.stack([c[0] for c in candidates]), np.stack([c[1] for c in candidates])
    r = w + s[:, :, None] * first + t[:, :, None] * second
    best = np.argmin(np.nan_to_num(np.einsum("cni,cni->cn", r, r), nan=np.inf), axis=0)
    rows = np.arange(len(w))
    return np.stack((s[best, rows], t[best, rows]), axis=1)


def overlap(w: Array, edges: Array) -> Array:
    """Return the radius (N,) of a ball around the origin that is inside `w + sum_i t_i e_i`, for d = 3.

    It is the smallest distance of the origin from a face, minus the rounding error. Two edge vectors span each face,
    and all pairs are checked. It is zero if the origin is outside, or if the edge vectors span no body. If two edge
    vectors are nearly parallel, the normal of their face is only rounding. Such pairs are left out: replacing the
    shorter vector by a parallel of the other moves the body by less than `sine |e|`, and this is subtracted for all of
    them.

    Example:
        >>> overlap(np.array([[-0.5, -0.5, -0.3]]), np.eye(3)[:, None]).round(9).tolist()
        [0.3]
    """
    count, k = len(w), len(edges)
    if k <= 2:
        return np.zeros(count)
    first, second = np.triu_indices(k, 1)
    lengths = np.linalg.norm(edges, axis=2)
    size = np.linalg.norm(w, axis=1) + lengths.sum(axis=0)
    normals = cross(edges[first], edges[second])
    areas = np.linalg.norm(normals, axis=2)
    spans = lengths[first] * lengths[second]
    sines = np.divide(areas, spans, out=np.zeros_like(areas), where=spans > 0.0)
    faces = sines > _PARALLEL
    units = np.divide(normals, areas[:, :, None], out=np.zeros_like(normals), where=faces[:, :, None])
    middle = np.einsum("ni,fni->fn", w, units)
    products = np.einsum("kni,fni->kfn", edges, units)
    least = np.minimum(middle + np.maximum(products, 0.0).sum(axis=0), -middle - np.minimum(products, 0.0).sum(axis=0))
    depth = np.where(faces, least, np.inf).min(axis=0)
    left_out = 2.0 * k * np.where(faces, 0.0, sines).max(axis=0) * lengths.sum(axis=0)
    rounding = _FACE * UNIT_ROUNDOFF * size / np.where(faces, sines, 1.0).min(axis=0)
    return np.maximum(np.where(np.isfinite(depth), depth, 0.0) - left_out - rounding, 0.0)


def overlap_in_plane(w: Array, edges: Array, normal: Array) -> Array:
    """Return the same for bodies in a plane: how far the foot of the origin may move (N,), zero if it is outside.

    The sides of a polygon `w + sum_i t_i e_i` are parallel to its edge vectors, two sides to each.
    """
    depth = np.full(len(w), np.inf)
    for edge in edges:
        length = np.linalg.norm(edge, axis=1)
        across = np.divide(np.cross(normal, edge), length[:, None], out=np.zeros_like(w), where=length[:, None] > 0.0)
        middle, products = np.einsum("ni,ni->n", w, across), np.einsum("kni,ni->kn", edges, across)
        for side in (middle + np.maximum(products, 0.0).sum(axis=0), -middle - np.minimum(products, 0.0).sum(axis=0)):
            depth = np.minimum(depth, np.where(length > 0.0, side, np.inf))
    return np.maximum(np.where(np.isfinite(depth), depth, 0.0), 0.0)


def _inside(w: Array, first: Array, second: Array) -> tuple[Array, Array]:
    """Return the stationary point, limited to the square, with one t at the foot of the other."""
    if w.shape[1] == 3:
        n = np.cross(first, second)
        s = _cut(-np.einsum("ni,ni->n", np.cross(w, second), n), np.einsum("ni,ni->n", n, n))
    else:
        n = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
        s = _cut(-(w[:, 0] * second[:, 1] - w[:, 1] * second[:, 0]) * n, n * n)
    t = _foot(w + s[:, None] * first, second)
    s = _foot(w + t[:, None] * second, first)
    return s, _foot(w + s[:, None] * first, second)


def _foot(w: Array, edge: Array) -> Array:
    return _cut(-np.einsum("ni,ni->n", w, edge), np.einsum("ni,ni->n", edge, edge))


def _cut(above: Array, below: Array) -> Array:
    """Return the quotient limited to [0, 1]; 0 if the denominator is 0."""
    return np.clip(np.divide(above, below, out=np.zeros_like(above), where=below > 0.0), 0.0, 1.0)
