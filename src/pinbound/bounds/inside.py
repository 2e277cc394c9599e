"""How far the origin is inside a convex body that is known by its support alone: a ball that is proven to be inside.

Take the furthest points of the body along directions that are the corners of a triangulated sphere, and lay the
sphere's triangles through them. That is a closed surface within the body, whatever it looks like. If it winds around
the origin, it winds around every point of the ball that reaches up to its nearest point; and it winds around nothing
outside the body, which is convex. So that ball is inside. How often it winds is the sum of the solid angles of the
triangles,

    tan(angle / 2) = a . (b x c) / (|a||b||c| + (a . b)|c| + (b . c)|a| + (c . a)|b|),

over 4 pi, a whole number but for rounding. In a plane the same holds of a polygon (`docs/hull-proofs.md`).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from pinbound.bounds.vertices import Corners
from pinbound.geometry.vectors import cross, dot
from pinbound.typing import Array, Indices

__all__ = ["ball", "disc"]

_ROUNDING = 1e-12  # relative to the body: what rounding can make of a distance from a triangle, slivers included
_WHOLE = 0.1  # how far from a whole number a sum of angles may be: rounding is far below, another number far above
_AROUND = 16  # directions in a plane
_FLATTEST = 1e-24  # of the squares of the widths of a body


def ball(corners: Corners, which: Indices, w: Array, edges: Array) -> Array:
    """Return the radius (N,) of a ball around the origin that is inside `w + sum_i t_i e_i`; zero if none is found.

    Args:
        corners: The corners that t runs over.
        which: (N,) whose.
        w: (N, 3) [m].
        edges: (K, N, 3), the e_i.
    """
    along = np.einsum("ui,nij->nuj", _SPHERE, _rounder(corners.scatter[which], edges))
    points = _supports(corners, which, w, edges, along)
    a, b, c = (points[:, _TRIANGLES[:, corner]] for corner in range(3))
    lengths = [np.sqrt(dot(x, x)) for x in (a, b, c)]
    volume = dot(a, cross(b, c))
    rest = lengths[0] * lengths[1] * lengths[2] + dot(a, b) * lengths[2]
    rest += dot(b, c) * lengths[0] + dot(c, a) * lengths[1]
    turns = np.arctan2(volume, rest).sum(axis=1) / (2.0 * math.pi)
    return _kept(turns, _triangles(a, b, c), points)


def disc(corners: Corners, which: Indices, w: Array, edges: Array, normal: Array) -> Array:
    """Return the radius (N,) of a disc around the origin's foot that is inside, of what stays in a plane (N, 3)."""
    first: Any = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal), axis=1)])
    first /= np.linalg.norm(first, axis=1)[:, None]
    second: Any = np.cross(normal, first)
    angles = 2.0 * math.pi * (np.arange(_AROUND) + 0.3) / _AROUND
    along = np.cos(angles)[:, None] * first[:, None] + np.sin(angles)[:, None] * second[:, None]
    points = _supports(corners, which, w, edges, along)
    flat = np.stack([np.einsum("nui,ni->nu", points, axis) for axis in (first, second)], axis=2)
    a, b = flat, np.roll(flat, -1, axis=1)
    crossed = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    turns = np.arctan2(crossed, np.einsum("nui,nui->nu", a, b)).sum(axis=1) / (2.0 * math.pi)
    return _kept(turns, _edge(a, b), flat)


def _kept(turns: Array, distance: Array, points: Array) -> Array:
    """Return the least distance (N,) of a surface that winds around the origin, rounding taken off; else zero."""
    whole = np.rint(turns)
    winds = (whole != 0.0) & (np.abs(turns - whole) <= _WHOLE)
    size = np.linalg.norm(points, axis=2).max(axis=1)
    return np.where(winds, np.maximum(distance.min(axis=1) - _ROUNDING * size, 0.0), 0.0)


def _rounder(scatter: Array, edges: Array) -> Array:
    """Return the maps (N, 3, 3) that make bodies about as wide along all directions, which flat ones are not."""
    values, vectors = np.linalg.eigh(np.einsum("kni,nkl,lnj->nij", edges, scatter, edges))
    widths = np.sqrt(np.maximum(values, _FLATTEST * values[:, 2:]))
    share = np.divide(widths[:, 2:], widths, out=np.ones_like(widths), where=widths > 0.0)
    return np.einsum("nik,nk,njk->nij", vectors, share, vectors)


def _supports(corners: Corners, which: Indices, w: Array, edges: Array, directions: Array) -> Array:
    """Return the furthest points (N, U, 3) of the bodies along directions (N, U, 3)."""
    count, many = directions.shape[:2]
    along = -np.einsum("kni,nui->nuk", edges, directions).reshape(count * many, len(edges))
    t = corners.least(np.repeat(which, many), along)[1].reshape(count, many, len(edges))
    found: Array = w[:, None] + np.einsum("nuk,kni->nui", t, edges)
    return found


def _triangles(a: Array, b: Array, c: Array) -> Array:
    """Return the distance of the origin from triangles (N, T): from the nearest edge, or from the plane above them."""
    normal = cross(b - a, c - a)
    square = dot(normal, normal)
    inside = square > 0.0
    for first, second in ((b, c), (c, a), (a, b)):
        inside &= dot(normal, cross(first, second)) >= 0.0
    plane = np.divide(np.abs(dot(normal, a)), np.sqrt(square), out=np.zeros_like(square), where=square > 0.0)
    edges = np.minimum(np.minimum(_edge(a, b), _edge(b, c)), _edge(c, a))
    return np.where(inside, np.minimum(plane, edges), edges)


def _edge(a: Array, b: Array) -> Array:
    """Return the distance of the origin from edges (...)."""
    along = b - a
    square = np.einsum("...i,...i->...", along, along)
    t = np.divide(-np.einsum("...i,...i->...", a, along), square, out=np.zeros_like(square), where=square > 0.0)
    foot = a + np.clip(t, 0.0, 1.0)[..., None] * along
    found: Array = np.sqrt(np.einsum("...i,...i->...", foot, foot))
    return found


def _octahedron() -> tuple[Array, Indices]:
    directions = np.vstack((np.eye(3), -np.eye(3)))
    triangles = [
        (x, y, z) if (x < 3) == ((y < 4) == (z < 5)) else (x, z, y) for x in (0, 3) for y in (1, 4) for z in (2, 5)
    ]
    return directions, np.array(triangles, dtype=np.intp)


def _halved(directions: Array, triangles: Indices) -> tuple[Array, Indices]:
    """Return the sphere with each triangle cut into four."""
    points, found, known = list(directions), list[tuple[int, int, int]](), dict[frozenset[int], int]()

    def between(i: int, j: int) -> int:
        key = frozenset((i, j))
        if key not in known:
            known[key] = len(points)
            middle = points[i] + points[j]
            points.append(middle / np.linalg.norm(middle))
        return known[key]

    for i, j, k in triangles.tolist():
        ij, jk, ki = between(i, j), between(j, k), between(k, i)
        found += [(i, ij, ki), (j, jk, ij), (k, ki, jk), (ij, jk, ki)]
    return np.array(points), np.array(found, dtype=np.intp)


def _askew() -> Array:
    """Return a rotation after which no direction is one of symmetry, along which many corners are furthest."""
    turned = np.linalg.qr(np.array([[1.0, 0.31, -0.17], [-0.23, 1.0, 0.41], [0.37, -0.13, 1.0]]))[0]
    return turned * np.sign(np.linalg.det(turned))


_SPHERE, _TRIANGLES = _halved(*_octahedron())
_SPHERE = _SPHERE @ _askew().T
