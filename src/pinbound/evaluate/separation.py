"""Distance of points, of bodies, or from a line, or signed height, along a relative path; with its derivatives.

With `r(q, t) = w + sum_i t_i e_i`, the separation is `f = min_t |r|`, t in [0, 1]. At the minimum t*, the slope of a
free t is zero, and a t at its end does not move. So with the Hessian H of |r| over (q, t), and f for the free t,

    grad = r^ . (w' + sum_i t*_i e_i'),      Hess = H_qq - H_qf H_ff^-1 H_fq.

For hulls, the free t are those that stay in the nearest face: the differences of its vertices span them. If H_ff is
singular in a direction along which q does not move the bodies either (edges parallel to the axes of all joints), the
separation does not depend on that direction, and it is left out.

A plane measures `n . r` instead of |r|, which is linear, so the t of the minimum are 0 or 1. `docs/segments.md` derives
all this, and says where derivatives jump.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pinbound.evaluate import numeric
from pinbound.evaluate.closest import lowest, nearest, nearest_of_hulls
from pinbound.path.kind import Case
from pinbound.path.relative import RelativePath
from pinbound.tolerances import OVERLAP, UNIT_ROUNDOFF
from pinbound.typing import Array

__all__ = ["gradients", "hessians", "measured", "nearest_points", "parameters", "separations", "vectors"]

_FACE = 64  # unit roundoffs of the path's length: vertices this near to the lowest are of one face
_SPANNED = 1e-9  # relative: directions in which a face leads less far do not count as its own
_FLAT_FACE = 1e-10  # relative: a curvature this small is none (two directions at 1e-5 rad)
_STILL = 1e-8  # relative: so little does q lead along a direction that it does not follow
_SINGULAR = 1e-14  # a determinant of unit rows: two edge vectors at 1e-7 rad


def separations(path: RelativePath, Q: Array) -> Array:
    """Return the distance, or the signed height above a plane, (N,) [m]; NaN for a row that is not finite."""
    found = _of(path).values(path, Q)
    return np.where(np.isfinite(found), found, np.nan)  # an infinite prismatic coordinate gives no clearance


def gradients(path: RelativePath, Q: Array) -> Array:
    """Return the gradient (N, n) of the separation; NaN where a distance is zero (a kink)."""
    return _of(path).gradients(path, Q)


def hessians(path: RelativePath, Q: Array) -> Array:
    """Return the Hessian (N, n, n) of the separation; NaN where a distance is zero, or segments are parallel."""
    return _of(path).hessians(path, Q)


def parameters(path: RelativePath, Q: Array) -> Array:
    """Return the t (N, k) in [0, 1], one for each segment, at which the two marks are nearest."""
    return _of(path).nearest(path, *measured(path, Q))


def vectors(path: RelativePath, Q: Array) -> Array:
    """Return `r = x_a - x_b` (N, 3) [m] between the nearest points of the marks, in the ancestor's frame."""
    r = numeric.positions(path.branch_a.chain, Q) - numeric.positions(path.branch_b.chain, Q)
    if not path.difference.directions:
        return _left_of(path, r, Q)
    t = parameters(path, Q)
    for branch, sign in ((path.branch_a, 1.0), (path.branch_b, -1.0)):
        for column, edge in enumerate(branch.edges):
            r = r + sign * t[:, column, None] * numeric.positions(edge, Q)
    return _left_of(path, r, Q)


def nearest_points(path: RelativePath, Q: Array) -> Array:
    """Return the nearest points of both marks (N, 2, 3) [m], without radii, in the ancestor's frame.

    On a line or plane, it is the foot of the other mark's point. If several pairs are equally near, it is one of them.
    """
    t = parameters(path, Q)
    points: list[Array] = []
    for branch in (path.branch_a, path.branch_b):
        x = numeric.positions(branch.chain, Q)
        for column, edge in enumerate(branch.edges):
            x = x + t[:, column, None] * numeric.positions(edge, Q)
        points.append(x)
    if path.normal is not None:
        r = _left_of(path, points[0] - points[1], Q)
        if path.first_is_b:
            points[1] = points[0] - r
        else:
            points[0] = points[1] + r
    return np.stack(points, axis=1)


def _left_of(path: RelativePath, r: Array, Q: Array) -> Array:
    """Return the part of r (N, 3) that counts, in the ancestor's frame."""
    normal = path.normal
    if normal is None:
        return r
    unit = numeric.positions(normal, Q)
    return path.left_of(r, np.einsum("ni,ni->n", r, unit)[:, None] * unit)


class _Lengths:
    """Distances of bodies, and from lines: the minimum of |r|."""

    @staticmethod
    def values(path: RelativePath, Q: Array) -> Array:
        w, edges = measured(path, Q)
        r = w + np.einsum("nk,kni->ni", _Lengths.nearest(path, w, edges), edges)
        return numeric.norm(_settled(path, r))

    @staticmethod
    def nearest(path: RelativePath, w: Array, edges: Array) -> Array:
        corners = path.difference.corners
        return nearest(w, edges) if path.difference.is_zonotope else nearest_of_hulls(w, edges, corners)

    @staticmethod
    def gradients(path: RelativePath, Q: Array) -> Array:
        r, J, _, _ = _around(path, Q, order=1)
        r = _settled(path, r)
        return np.einsum("ni,nia->na", numeric.unit(r), J[:, :, : Q.shape[1]])

    @staticmethod
    def hessians(path: RelativePath, Q: Array) -> Array:
        r, J, H, t = _around(path, Q, order=2)
        r, n = _settled(path, r), Q.shape[1]
        full = numeric.norm_hessian(r, J, H)
        free = (t > 0.0) & (t < 1.0)
        found = full[:, :n, :n].copy()
        if not path.difference.is_zonotope:
            return found - _follows(full, _faces(path, r, J[:, :, n:]), n)
        patterns: Any = np.unique(free, axis=0)
        for pattern in patterns:
            rows, columns = np.flatnonzero(np.all(free == pattern, axis=1)), n + np.flatnonzero(pattern)
            if len(columns):
                inner = full[rows[:, None, None], columns[:, None], columns]
                mixed = full[rows[:, None, None], columns[:, None], np.arange(n)]
                found[rows] -= np.swapaxes(mixed, 1, 2) @ _solve(inner, mixed)
        return found


class _Points(_Lengths):
    """Distances of two points: one smooth |r|."""

    @staticmethod
    def values(path: RelativePath, Q: Array) -> Array:
        return numeric.norm(numeric.positions(path.minimal, Q))

    @staticmethod
    def gradients(path: RelativePath, Q: Array) -> Array:
        return numeric.gradient(path.minimal, Q)

    @staticmethod
    def hessians(path: RelativePath, Q: Array) -> Array:
        return numeric.hessian(path.minimal, Q)


class _Heights:
    """Heights above planes: the minimum of n . r, which is linear in t."""

    @staticmethod
    def values(path: RelativePath, Q: Array) -> Array:
        w, edges = measured(path, Q)
        r: Array = w + np.einsum("nk,kni->ni", _Heights.nearest(path, w, edges), edges)
        return r[:, 0]

    @staticmethod
    def nearest(path: RelativePath, w: Array, edges: Array) -> Array:
        return lowest(edges, path.difference.corners)

    @staticmethod
    def gradients(path: RelativePath, Q: Array) -> Array:
        return _around(path, Q, order=1)[1][:, 0, : Q.shape[1]]

    @staticmethod
    def hessians(path: RelativePath, Q: Array) -> Array:
        n = Q.shape[1]
        return _around(path, Q, order=2)[2][:, 0, :n, :n]


_MEASURED: Mapping[Case, type[_Lengths] | type[_Heights]] = {
    Case.POINTS: _Points,
    Case.BODIES: _Lengths,
    Case.LINE: _Lengths,
    Case.PLANE: _Heights,
}


def _of(path: RelativePath) -> type[_Lengths] | type[_Heights]:
    """Return the evaluator of a path: the only function that asks for the case."""
    return _MEASURED[path.case]


def _faces(path: RelativePath, r: Array, edges: Array) -> Array:
    """Return the projectors (N, k, k) onto the t that stay in the nearest face of each body."""
    towards, k = numeric.unit(r), edges.shape[2]
    heights, split = np.einsum("ni,nik->nk", towards, edges), path.difference.corners[0].shape[1]
    size = np.linalg.norm(r, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):  # a unit vector is known to the rounding of r
        tolerance = _FACE * UNIT_ROUNDOFF * path.minimal.scale * (1.0 + path.minimal.scale / size)
    projectors, first = np.zeros((len(r), k, k)), 0
    for corners, along in zip(path.difference.corners, (heights[:, :split], heights[:, split:]), strict=True):
        above = along @ corners.T
        with np.errstate(invalid="ignore"):
            lowest = above <= above.min(axis=1, keepdims=True) + tolerance[:, None]
        m = corners.shape[1]
        for row in np.flatnonzero(lowest.sum(axis=1) > 1).tolist():
            face = corners[lowest[row]]
            _, sizes, rows = np.linalg.svd(face[1:] - face[0], full_matrices=False)
            rows = rows[sizes > _SPANNED * sizes[0]]
            projectors[row, first : first + m, first : first + m] = rows.T @ rows
        first += m
    return projectors


def _follows(full: Array, faces: Array, n: int) -> Array:
    """Return `H_qf H_ff^+ H_fq` (N, n, n); NaN if H_ff is singular in a direction along which q moves."""
    inner = faces @ full[:, n:, n:] @ faces
    mixed = faces @ full[:, n:, :n]
    found = np.full((len(full), n, n), np.nan)
    rows = np.flatnonzero(np.all(np.isfinite(inner), axis=(1, 2)) & np.all(np.isfinite(mixed), axis=(1, 2)))
    sizes, axes = np.linalg.eigh(inner[rows])
    largest = np.abs(sizes).max(axis=1, initial=0.0)[:, None]
    kept = sizes > _FLAT_FACE * largest
    turned = np.swapaxes(axes, 1, 2) @ mixed[rows]
    size = np.abs(full[rows]).max(axis=(1, 2))
    lost = np.abs(np.where(kept[:, :, None], 0.0, turned)).max(axis=(1, 2), initial=0.0)
    parts = np.divide(turned, sizes[:, :, None], out=np.zeros_like(turned), where=kept[:, :, None])
    found[rows] = np.where((lost <= _STILL * size)[:, None, None], np.swapaxes(turned, 1, 2) @ parts, np.nan)
    return found


def _solve(inner: Array, mixed: Array) -> Array:
    """Solve for the free t; singular systems (parallel edge vectors, many nearest points) give NaN."""
    size = np.sqrt(np.einsum("nii->ni", inner))
    with np.errstate(invalid="ignore", divide="ignore"):
        scaled = inner / (size[:, :, None] * size[:, None, :])
    sound = np.all(np.isfinite(scaled), axis=(1, 2))
    sound[sound] = np.linalg.det(scaled[sound]) > _SINGULAR
    found = np.full_like(mixed, np.nan)
    found[sound] = np.linalg.solve(inner[sound], mixed[sound])
    return found


def measured(path: RelativePath, Q: Array) -> tuple[Array, Array]:
    """Return the parts of w (N, d) and e (k, N, d) that count: d = 3, 2 for a line, 1 for a plane."""
    w = numeric.positions(path.minimal, Q)
    chains = path.difference.edges
    edges = np.array([numeric.positions(edge, Q) for edge in chains]).reshape(len(chains), *w.shape)
    with np.errstate(invalid="ignore"):
        return path.counted(w), path.counted(edges)


def _settled(path: RelativePath, r: Array) -> Array:
    """Return r, with zero where bodies overlap: r is only rounding there, without a direction."""
    if not path.is_solid:
        return r
    return np.where((np.abs(r).max(axis=1) <= OVERLAP * path.minimal.scale)[:, None], 0.0, r)


def _around(path: RelativePath, Q: Array, order: int) -> tuple[Array, Array, Array, Array]:
    """Return r (N, d), its derivatives by (q, t), (N, d, n + k) and (N, d, n + k, n + k), and t, at the minimum."""
    chains = (path.minimal, *path.difference.edges)
    parts = [path.counted_of_each(numeric.derivatives(chain, Q, order)) for chain in chains]
    (w, J, H), others = parts[0], parts[1:]
    n, k = Q.shape[1], len(others)
    edges = np.array([one[0] for one in others]).reshape(k, *w.shape)
    t = _of(path).nearest(path, w, edges)
    r, slope = w.copy(), np.concatenate((J, np.zeros((*w.shape, k))), axis=2)
    bend = np.pad(H, ((0, 0), (0, 0), (0, k), (0, k))) if order > 1 else H
    for i, (e, e_slope, e_bend) in enumerate(others):
        weight = t[:, i, None]
        r += weight * e
        slope[:, :, :n] += weight[:, :, None] * e_slope
        slope[:, :, n + i] = e
        if order > 1:
            bend[:, :, :n, :n] += weight[:, :, None, None] * e_bend
            bend[:, :, :n, n + i] = bend[:, :, n + i, :n] = e_slope
    return r, slope, bend, t
