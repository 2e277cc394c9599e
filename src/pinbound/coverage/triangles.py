"""Distances of points from triangles: from a point of each triangle that is the nearest, up to rounding."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["Triangles", "cut_along", "halved"]

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

_BLOCK = 4_096  # pairs of a point and a triangle that are examined at once: as many as a cache holds
_SLIVER = 1e-12  # of the product of two squared sides: if it is less, only rounding is left, and the sides decide


class Triangles:
    """Triangles `a + s u + t v`, `s, t >= 0`, `s + t <= 1`, with the values that do not depend on the point.

    The nearest points of each side and of the plane are compared by their squared distances, and one of them is chosen.
    The result is the distance of that point itself. So it is never less than the true distance, up to rounding. For
    slivers rounding may make a wrong choice, and the result may be larger.

    Example:
        >>> corner = Triangles(np.array([[[0.0, 0, 0], [1.0, 0, 0], [0, 1.0, 0]]]))
        >>> corner.away(np.array([[0.2, 0.2, 0.5], [1.0, 1.0, 0.0]]), np.zeros(2, np.int64)).round(6).tolist()
        [0.5, 0.707107]
    """

    def __init__(self, corners: Array) -> None:
        """Take corners (m, 3, 3)."""
        self.corners = corners
        a, u, v = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        uu, uv, vv = (np.einsum("ni,ni->n", x, y) for x, y in ((u, u), (u, v), (v, v)))
        ww = np.einsum("ni,ni->n", v - u, v - u)
        det = uu * vv - uv * uv
        det[det <= _SLIVER * uu * vv] = 0.0
        inverses = [np.divide(1.0, one, out=np.zeros_like(one), where=one > 0.0) for one in (uu, vv, ww, det)]
        self._table = np.ascontiguousarray(np.vstack((a.T, u.T, v.T, uu, uv, vv, *inverses)))

    def __len__(self) -> int:
        """Return the number of triangles."""
        return len(self.corners)

    def away(self, points: Array, rows: Ints) -> Array:
        """Return the distance of each point (N, 3) from the triangle of its row (N,) [m]."""
        if len(points) > _BLOCK:
            cuts = range(0, len(points), _BLOCK)
            return np.concatenate([self.away(points[at : at + _BLOCK], rows[at : at + _BLOCK]) for at in cuts])
        table = self._table[:, rows]
        w, u, v = points.T - table[:3], table[3:6], table[6:9]
        uu, uv, vv, per_uu, per_vv, per_ww, per_det = table[9:]
        d1, d2 = _dot(w, u), _dot(w, v)
        s, t = (vv * d1 - uv * d2) * per_det, (uu * d2 - uv * d1) * per_det
        outside = (s < 0.0) | (t < 0.0) | (s + t > 1.0) | (per_det == 0.0)
        rim = np.flatnonzero(outside)
        if len(rim):
            d1, d2, uu, uv, vv = d1[rim], d2[rim], uu[rim], uv[rim], vv[rim]
            one: Array = np.clip(d1 * per_uu[rim], 0.0, 1.0)
            two: Array = np.clip(d2 * per_vv[rim], 0.0, 1.0)
            along: Array = np.clip((d2 - d1 + uu - uv) * per_ww[rim], 0.0, 1.0)  # from a + u towards a + v
            least: Array = one * (one * uu - 2.0 * d1)
            found = two * (two * vv - 2.0 * d2)
            nearer = found < least
            least = np.where(nearer, found, least)
            best_s, best_t = np.where(nearer, 0.0, one), np.where(nearer, two, 0.0)
            rest = 1.0 - along
            found = rest * (rest * uu - 2.0 * d1) + along * (along * vv - 2.0 * d2) + 2.0 * rest * along * uv
            nearer = found < least
            s[rim], t[rim] = np.where(nearer, rest, best_s), np.where(nearer, along, best_t)
        r = w - s * u - t * v
        return np.sqrt(_dot(r, r))

    def least(self, points: Array) -> Array:
        """Return the distance of each point (N, 3) from the nearest of all triangles [m]; all pairs are examined."""
        count = len(self.corners)
        rows = np.tile(np.arange(count), len(points))
        return self.away(np.repeat(points, count, axis=0), rows).reshape(-1, count).min(axis=1)


def _dot(one: Array, two: Array) -> Array:
    return one[0] * two[0] + one[1] * two[1] + one[2] * two[2]


def halved(pieces: Array) -> Array:
    """Return two triangles for each triangle (n, 3, 3), halved at its longest side: (2 n, 3, 3).

    Example:
        >>> halved(np.array([[[0.0, 0, 0], [2.0, 0, 0], [0, 1.0, 0]]])).shape
        (2, 3, 3)
    """
    ends: Any = np.roll(pieces, -1, axis=1) - pieces
    longest = np.argmax(np.einsum("nki,nki->nk", ends, ends), axis=1)
    rows = np.arange(len(pieces))
    a, b, c = (pieces[rows, (longest + turn) % 3] for turn in range(3))
    middle = 0.5 * (a + b)
    return np.stack((np.stack((a, middle, c), axis=1), np.stack((middle, b, c), axis=1)), axis=1).reshape(-1, 3, 3)


def cut_along(pieces: Array, triangles: Array) -> tuple[tuple[Array, Ints], tuple[Array, Ints]]:
    """Cut triangles (n, 3, 3) along the sides of others (n, 3, 3), row by row, by planes perpendicular to these.

    Returns:
        The pieces over or under the other triangle, and the rest: corners (m, 3, 3), and the index (m,) of the cut
        triangle.

    Example:
        >>> large = np.array([[[0.0, 0.0, 0.0], [5.0, 0.0, 0.0], [0.0, 5.0, 0.0]]])
        >>> small = np.array([[[1.0, 1.0, 1.0], [2.0, 1.0, 1.0], [1.0, 2.0, 1.0]]])
        >>> (over, _), (rest, _) = cut_along(large, small)
        >>> len(over), len(rest)
        (1, 6)
    """
    kept, owner = pieces, np.arange(len(pieces))
    gone, whose = list[Array](), list[Ints]()
    normals: Any = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    for corner in range(3):
        start, end = triangles[:, corner], triangles[:, (corner + 1) % 3]
        inward: Any = np.cross(normals, end - start)
        height = np.einsum("nki,ni->nk", kept - start[owner, None], inward[owner])
        flush = 1e-12 * np.abs(height).max(axis=1, initial=0.0, keepdims=True)
        height[np.abs(height) <= flush] = 0.0
        (inside, one), (outside, two) = _split(kept, height)
        gone.append(outside)
        whose.append(owner[two])
        kept, owner = inside, owner[one]
    return (kept, owner), (np.concatenate(gone), np.concatenate(whose))


def _split(corners: Array, height: Array) -> tuple[tuple[Array, Ints], tuple[Array, Ints]]:
    """Return the pieces of triangles with a height of zero or more, and those with less, and their triangles."""
    above, below = np.all(height >= 0.0, axis=1), np.all(height <= 0.0, axis=1) & np.any(height < 0.0, axis=1)
    rows = np.flatnonzero(~above & ~below)
    h = height[rows]
    signs = np.sign(h)
    # The corner that is alone on its side comes first; if a corner is on the plane, the one above it comes first.
    alone = np.where(signs.sum(axis=1) < 0.0, 1.0, np.where(signs.sum(axis=1) > 0.0, -1.0, 1.0))
    first = np.argmax(signs == alone[:, None], axis=1)
    n = np.arange(len(rows))
    (a, p), (b, q), (c, r) = ((corners[rows, k], h[n, k]) for k in ((first + turn) % 3 for turn in range(3)))
    one = a + np.divide(p, p - q, out=np.ones_like(p), where=p != q)[:, None] * (b - a)
    two = a + np.divide(p, p - r, out=np.ones_like(p), where=p != r)[:, None] * (c - a)
    tips = np.stack((a, one, two), axis=1)
    rest = np.concatenate((np.stack((one, b, c), axis=1), np.stack((one, c, two), axis=1)))
    up = alone > 0.0
    both, doubled = np.concatenate((up, up)), np.concatenate((rows, rows))
    return (
        (
            np.concatenate((corners[above], tips[up], rest[~both])),
            np.concatenate((np.flatnonzero(above), rows[up], doubled[~both])),
        ),
        (
            np.concatenate((corners[below], tips[~up], rest[both])),
            np.concatenate((np.flatnonzero(below), rows[~up], doubled[both])),
        ),
    )
