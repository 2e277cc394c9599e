"""A ball around the origin that is proven to be inside a convex body, of which only the support function is known.

Take the furthest points of the body along directions that are the corners of a triangulated sphere, and let the
triangles of the sphere connect these points. They form a closed surface within the body, for any body. If the surface
winds around the origin, it winds around every point of the ball about the origin up to the surface's nearest point. It
does not wind around any point outside the body, because the body is convex. So the ball is inside. The winding number
is the sum of the solid angles of the triangles,

    tan(angle / 2) = a . (b x c) / (|a||b||c| + (a . b)|c| + (b . c)|a| + (c . a)|b|),

divided by 4 pi, a whole number up to rounding. In a plane the same is true for a polygon (`docs/hull-proofs.md`).

While bodies move, the surface moves with them. It keeps its winding number as long as no triangle passes through the
origin.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from pinbound.bounds.vertices import Corners
from pinbound.geometry.vectors import cross, dot
from pinbound.typing import Array, Flags, Indices

__all__ = ["ball", "disc", "stays_inside"]

_ROUNDING = 1e-12  # relative to the body: the error of a distance from a triangle by rounding, also for slivers
_WHOLE = 0.1  # largest distance of a sum of angles from a whole number; rounding is far smaller
_AROUND = 16  # directions in a plane
_TILTS = (0.04, 0.15, 0.45, 1.1, 2.0)  # [rad] of rings of directions around the one in which a body is shallowest
_RING_OF = 6  # directions
_STEPS = tuple(0.5 * 0.6**k for k in range(8))  # [rad], steps of the search for that direction
_FLATTEST = 1e-24  # of the squares of the widths of a body: the smallest ratio that is used


def ball(corners: Corners, which: Indices, w: Array, edges: Array) -> Array:
    """Return the radius (N,) of a ball around the origin that is inside `w + sum_i t_i e_i`; zero if none is found.

    Args:
        corners: The corners that t runs over.
        which: (N,) the pair of each row.
        w: (N, 3) [m].
        edges: (K, N, 3), the e_i.
    """
    along = np.einsum("ui,nij->nuj", _SPHERE, _rounder(corners.scatter[which], edges))
    points, _ = _supports(corners, which, w, edges, along)
    faces = _faces(points, _TRIANGLES)
    return _kept(_turns(*faces), np.linalg.norm(_feet(*faces), axis=2), points)


def stays_inside(
    corners: Corners, which: Indices, w: Array, edges: Array, moves: Sequence[tuple[Array, Array]], off: Array
) -> Flags:
    """Return for which rows (N,) the origin certainly stays inside `w + sum_i t_i e_i` while this body moves.

    Every point of the body moves by `sum_j s_j (w_j + sum_i t_i e_ij)` with `|s_j| <= 1`, and additionally by at most
    `off`. Let u be the unit vector from the origin to the nearest point of a triangle. No point of the triangle reaches
    the origin if all three corners p satisfy `u . p > sum_j |u . p_j| + off`.

    Args:
        corners: The corners that t runs over.
        which: (N,) the pair of each row.
        w: (N, 3) [m].
        edges: (K, N, 3), the e_i.
        moves: The w_j (N, 3) and the e_ij (K, N, 3) [m] for each j.
        off: (N,) [m].
    """
    rounder = _rounder(corners.scatter[which], edges)
    pole, height = _shallowest(corners, which, w, edges, rounder)
    inside = np.zeros(len(which), dtype=np.bool_)
    rows = np.flatnonzero(height > off)  # a ball inside has at most this radius
    which, w, edges = which[rows], w[rows], edges[:, rows]
    along = np.einsum("ui,nji,nkj->nuk", _POLAR, _frames(pole[rows]), rounder[rows])
    points, t = _supports(corners, which, w, edges, along)
    faces = _faces(points, _POLAR_TRIANGLES)
    feet = _feet(*faces)
    length: Array = np.linalg.norm(feet, axis=2)
    u = np.divide(feet, length[..., None], out=np.zeros_like(feet), where=length[..., None] > 0.0)
    heights = np.stack([dot(face, u) for face in faces])
    for shift, turned in moves:
        moved = shift[rows, None] + np.einsum("nuk,kni->nui", t, turned[:, rows])
        heights -= np.abs([dot(face, u) for face in _faces(moved, _POLAR_TRIANGLES)])
    inside[rows] = _kept(_turns(*faces), heights.min(axis=0), points) > off[rows]
    return inside


def _shallowest(corners: Corners, which: Indices, w: Array, edges: Array, rounder: Array) -> tuple[Array, Array]:
    """Return the direction (N, 3) in which bodies extend least beyond the origin, in original units, and how far (N,).

    It is approximate; the proof does not depend on it.
    """

    def heights(around: Array) -> Array:
        along = np.einsum("nui,nji->nuj", around, rounder)
        length = np.linalg.norm(along, axis=2)
        return dot(_supports(corners, which, w, edges, along)[0], along) / length

    rows = np.arange(len(which))
    found = heights(np.broadcast_to(_SPHERE, (len(which), *_SPHERE.shape)))
    best = found.argmin(axis=1)
    pole, height = _SPHERE[best], found[rows, best]
    for step in _STEPS:
        frames = _frames(pole)
        ring = math.cos(step) * frames[:, None, :, 2] + math.sin(step) * np.einsum("ui,nji->nuj", _RING, frames)
        found = heights(ring)
        best = found.argmin(axis=1)
        better = found[rows, best] < height
        pole = np.where(better[:, None], ring[rows, best], pole)
        height = np.where(better, found[rows, best], height)
    return pole, height


def _frames(pole: Array) -> Array:
    """Return rotations (N, 3, 3) whose third column is a unit vector (N, 3)."""
    side: Any = np.cross(pole, np.eye(3)[np.argmin(np.abs(pole), axis=1)])
    side /= np.linalg.norm(side, axis=1)[:, None]
    frames: Array = np.stack((side, cross(pole, side), pole), axis=2)
    return frames


def _faces(points: Array, triangles: Indices) -> tuple[Array, Array, Array]:
    a, b, c = (points[:, triangles[:, corner]] for corner in range(3))
    return a, b, c


def _turns(a: Array, b: Array, c: Array) -> Array:
    """Return the winding number of triangles (N, T, 3) around the origin (N,)."""
    lengths = [np.sqrt(dot(x, x)) for x in (a, b, c)]
    volume = dot(a, cross(b, c))
    rest = lengths[0] * lengths[1] * lengths[2] + dot(a, b) * lengths[2]
    rest += dot(b, c) * lengths[0] + dot(c, a) * lengths[1]
    found: Array = np.arctan2(volume, rest).sum(axis=1) / (2.0 * math.pi)
    return found


def disc(corners: Corners, which: Indices, w: Array, edges: Array, normal: Array) -> Array:
    """Return the radius (N,) of a disc around the foot of the origin that is inside, in a plane with normals (N, 3)."""
    first: Any = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal), axis=1)])
    first /= np.linalg.norm(first, axis=1)[:, None]
    second: Any = np.cross(normal, first)
    angles = 2.0 * math.pi * (np.arange(_AROUND) + 0.3) / _AROUND
    along = np.cos(angles)[:, None] * first[:, None] + np.sin(angles)[:, None] * second[:, None]
    points, _ = _supports(corners, which, w, edges, along)
    flat = np.stack([np.einsum("nui,ni->nu", points, axis) for axis in (first, second)], axis=2)
    a, b = flat, np.roll(flat, -1, axis=1)
    crossed = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    turns = np.arctan2(crossed, np.einsum("nui,nui->nu", a, b)).sum(axis=1) / (2.0 * math.pi)
    return _kept(turns, np.linalg.norm(_foot(a, b), axis=2), flat)


def _kept(turns: Array, distance: Array, points: Array) -> Array:
    """Return the distance (N,) of a surface that winds around the origin, minus rounding; else zero."""
    whole = np.rint(turns)
    winds = (whole != 0.0) & (np.abs(turns - whole) <= _WHOLE)
    size = np.linalg.norm(points, axis=2).max(axis=1)
    return np.where(winds, np.maximum(distance.min(axis=1) - _ROUNDING * size, 0.0), 0.0)


def _rounder(scatter: Array, edges: Array) -> Array:
    """Return the maps (N, 3, 3) that scale bodies to about the same width in all directions."""
    values, vectors = np.linalg.eigh(np.einsum("kni,nkl,lnj->nij", edges, scatter, edges))
    widths = np.sqrt(np.maximum(values, _FLATTEST * values[:, 2:]))
    share = np.divide(widths[:, 2:], widths, out=np.ones_like(widths), where=widths > 0.0)
    return np.einsum("nik,nk,njk->nij", vectors, share, vectors)


def _supports(corners: Corners, which: Indices, w: Array, edges: Array, directions: Array) -> tuple[Array, Array]:
    """Return the furthest points (N, U, 3) of the bodies along directions (N, U, 3), and their t (N, U, K)."""
    count, many = directions.shape[:2]
    along = -np.einsum("kni,nui->nuk", edges, directions).reshape(count * many, len(edges))
    t = corners.least(np.repeat(which, many), along)[1].reshape(count, many, len(edges))
    return w[:, None] + np.einsum("nuk,kni->nui", t, edges), t


def _feet(a: Array, b: Array, c: Array) -> Array:
    """Return the points of triangles (N, T, 3) that are nearest to the origin: on an edge, or in the plane."""
    normal = cross(b - a, c - a)
    square = dot(normal, normal)
    inside = square > 0.0
    for first, second in ((b, c), (c, a), (a, b)):
        inside &= dot(normal, cross(first, second)) >= 0.0
    height = np.divide(dot(normal, a), square, out=np.zeros_like(square), where=square > 0.0)
    feet = np.stack((height[..., None] * normal, _foot(a, b), _foot(b, c), _foot(c, a)))
    lengths = dot(feet, feet)
    lengths[0, ~inside] = np.inf
    found: Array = np.take_along_axis(feet, lengths.argmin(axis=0)[None, ..., None], axis=0)[0]
    return found


def _foot(a: Array, b: Array) -> Array:
    """Return the points of edges (...) that are nearest to the origin."""
    along = b - a
    square = np.einsum("...i,...i->...", along, along)
    t = np.divide(-np.einsum("...i,...i->...", a, along), square, out=np.zeros_like(square), where=square > 0.0)
    found: Array = a + np.clip(t, 0.0, 1.0)[..., None] * along
    return found


def _octahedron() -> tuple[Array, Indices]:
    directions = np.vstack((np.eye(3), -np.eye(3)))
    triangles = [
        (x, y, z) if (x < 3) == ((y < 4) == (z < 5)) else (x, z, y) for x in (0, 3) for y in (1, 4) for z in (2, 5)
    ]
    return directions, np.array(triangles, dtype=np.intp)


def _halved(directions: Array, triangles: Indices) -> tuple[Array, Indices]:
    """Return the sphere with each triangle divided into four."""
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
    """Return a rotation after which no direction is an axis of symmetry, along which many corners are furthest."""
    turned = np.linalg.qr(np.array([[1.0, 0.31, -0.17], [-0.23, 1.0, 0.41], [0.37, -0.13, 1.0]]))[0]
    return turned * np.sign(np.linalg.det(turned))


_SPHERE, _TRIANGLES = _halved(*_octahedron())
_SPHERE = _SPHERE @ _askew().T


def _globe() -> tuple[Array, Indices]:
    """Return a triangulated sphere whose corners are concentrated around its pole, the third axis."""
    angles = 2.0 * math.pi * np.arange(_RING_OF) / _RING_OF
    rings = [
        np.stack((np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.full(_RING_OF, np.cos(tilt))), axis=1)
        for number, tilt in enumerate(_TILTS)
        for turn in [angles + (number % 2) * math.pi / _RING_OF]
    ]
    directions = np.vstack(([[0.0, 0.0, 1.0]], *rings, [[0.0, 0.0, -1.0]]))
    triangles: list[tuple[int, int, int]] = []
    last = len(directions) - 1
    for here in range(_RING_OF):
        there = (here + 1) % _RING_OF
        triangles.append((0, 1 + here, 1 + there))
        for ring in range(len(_TILTS) - 1):
            above, below = 1 + ring * _RING_OF, 1 + (ring + 1) * _RING_OF
            if ring % 2:  # the ring below is rotated back by half a corner
                triangles += [(above + here, below + here, below + there), (above + here, below + there, above + there)]
            else:
                triangles += [(above + here, below + here, above + there), (above + there, below + here, below + there)]
        bottom = 1 + (len(_TILTS) - 1) * _RING_OF
        triangles.append((bottom + here, last, bottom + there))
    return directions, np.array(triangles, dtype=np.intp)


_POLAR, _POLAR_TRIANGLES = _globe()
_RING = np.column_stack(
    (np.cos(_TURNS := 2.0 * math.pi * np.arange(_RING_OF) / _RING_OF), np.sin(_TURNS), 0.0 * _TURNS)
)
