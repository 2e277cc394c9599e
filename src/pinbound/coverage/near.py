"""The triangles of a mesh near a point, and bounds of the distance of pieces of another surface from them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pinbound.coverage.triangles import Triangles
from pinbound.meshes import Mesh
from pinbound.tolerances import HELD

__all__ = ["Near", "lay_points"]

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

_MOST_LAID = 40  # points along a side of a triangle
_SOME = 8  # triangles that are examined if the nearest three are too far
_LOOKED = 20  # points for which all triangles are examined, so that no nearer one is missed
_MOST_PAIRS = 1_000_000  # pairs of a point and a triangle that are examined at once


class Near:
    """The triangles of a mesh, with a search for those near a point."""

    def __init__(self, mesh: Mesh) -> None:
        """Lay points over the triangles, so dense that the nearest point is on one of the nearest triangles."""
        from scipy import spatial

        corners = mesh.vertices[mesh.triangles]
        self.triangles = Triangles(corners)
        self._low, self._high = corners.min(axis=1), corners.max(axis=1)
        spread = float(np.linalg.norm(mesh.vertices.max(axis=0) - mesh.vertices.min(axis=0))) / 40.0
        laid, self._owner = lay_points(corners, max(spread, HELD))
        library: Any = spatial
        self._tree: Any = library.cKDTree(laid, balanced_tree=False)

    def near(self, points: Array, count: int = 3) -> Ints:
        """Return the numbers of triangles (N, count) that are near points (N, 3)."""
        rows: Any = self._tree.query(points, k=min(count, len(self._owner)))[1]
        return self._owner[np.asarray(rows).reshape(len(points), -1)]

    def away(self, points: Array) -> Array:
        """Return upper bounds of the distances of points (N, 3) from the mesh; they are nearly the distances [m]."""
        near = self.near(points)
        return np.min([self.triangles.away(points, column) for column in near.T], axis=0)

    def exactly(self, points: Array, away: Array, rows: Ints) -> tuple[Array, Ints]:
        """Return the distances (N,) of points from the mesh, and the nearest triangles.

        Args:
            points: (N, 3).
            away: (N,) [m], the distance of each point from the triangle of its row: triangles further away are skipped.
            rows: (N,).
        """
        away, rows = away.copy(), rows.copy()
        step = max(1, _MOST_PAIRS // len(self._low))
        for start in range(0, len(points), step):
            block, limit = points[start : start + step], away[start : start + step, None, None]
            which, some = np.nonzero(
                np.all((self._low <= block[:, None] + limit) & (self._high >= block[:, None] - limit), axis=2)
            )
            found = self.triangles.away(block[which], some)
            order = np.lexsort((found, which))
            first = order[np.unique(which[order], return_index=True)[1]]
            first = first[found[first] < away[start + which[first]]]
            away[start + which[first]], rows[start + which[first]] = found[first], some[first]
        return away, rows

    def furthest(self, points: Array) -> tuple[int, float]:
        """Return which of some points is about the furthest from the mesh, and its distance [m]."""
        near = self.near(points)
        all_of = np.array([self.triangles.away(points, column) for column in near.T])
        rough, which = all_of.min(axis=0), near[np.arange(len(points)), np.argmin(all_of, axis=0)]
        chosen = np.argsort(-rough)[:_LOOKED]
        away = self.exactly(points[chosen], rough[chosen], which[chosen])[0]
        best = int(np.argmax(away))
        return int(chosen[best]), float(away[best])

    def is_inside(self, place: Array) -> bool:
        """Return whether the surface is closed around a place (3,): its solid angle there is about a whole sphere."""
        a, b, c = (self.triangles.corners[:, corner] - place for corner in range(3))
        p, q, r = (np.linalg.norm(one, axis=1) for one in (a, b, c))
        dots = [np.einsum("ni,ni->n", *pair) for pair in ((a, b), (b, c), (c, a))]
        volume = np.einsum("ni,ni->n", a, np.cross(b, c))
        angle = 2.0 * np.arctan2(volume, p * q * r + dots[0] * r + dots[1] * p + dots[2] * q)
        return abs(float(angle.sum())) > 2.0 * math.pi

    def nearest(self, points: Array) -> Array:
        """Return points (N, 3) of the mesh that are about the nearest to other points (N, 3)."""
        return np.asarray(self._tree.data)[self._tree.query(points)[1]]

    def bounds(self, pieces: Array, enough: float = -np.inf) -> tuple[Array, Array, Ints]:
        """Return bounds of the largest distance of pieces (n, 3, 3), their middles' distances, and the triangles (n,).

        If a bound is at most `enough`, no smaller bound is searched for, and the distance of the middle is given as 0.
        """
        middles = pieces.mean(axis=1)
        near = self.near(middles)
        best, middle = np.full(len(pieces), np.inf), np.zeros(len(pieces))
        for column in near.T:
            rows = np.flatnonzero(best > enough)
            if not len(rows):
                break
            best[rows] = np.minimum(best[rows], self.over(pieces[rows], column[rows]))
        rows = np.flatnonzero(best > enough)
        found = near[:, 0].copy()
        if len(rows):
            many = self.near(middles[rows], _SOME)
            here = np.array([self.triangles.away(middles[rows], column) for column in many.T])
            middle[rows], found[rows] = here.min(axis=0), many[np.arange(len(rows)), np.argmin(here, axis=0)]
            doubtful = rows[np.argsort(-middle[rows])][: _MOST_PAIRS // len(self.triangles)]
            doubtful = doubtful[middle[doubtful] > enough]
            middle[doubtful], found[doubtful] = self.exactly(middles[doubtful], middle[doubtful], found[doubtful])
            best[rows] = np.minimum(best[rows], self.over(pieces[rows], found[rows]))
            size = np.linalg.norm(pieces[rows] - middles[rows, None], axis=2).max(axis=1)
            best[rows] = np.minimum(best[rows], middle[rows] + size)
        return best, middle, found

    def over(self, pieces: Array, rows: Ints) -> Array:
        """Return the largest distance of each piece (n, 3, 3) from the triangle of its row; it occurs at a corner."""
        return self.triangles.away(pieces.reshape(-1, 3), np.repeat(rows, 3)).reshape(-1, 3).max(axis=1)


def lay_points(corners: Array, spread: float) -> tuple[Array, Ints]:
    """Return points on triangles, about `spread` apart in rows along the longest side, and each point's triangle."""
    ends: Any = np.roll(corners, -1, axis=1) - corners
    lengths = np.linalg.norm(ends, axis=2)
    rows, first = np.arange(len(corners)), np.argmax(lengths, axis=1)
    turned = np.stack([corners[rows, (first + turn) % 3] for turn in range(3)], axis=1)
    base = lengths[rows, first]
    normals: Any = np.cross(turned[:, 1] - turned[:, 0], turned[:, 2] - turned[:, 0])
    height = np.divide(np.linalg.norm(normals, axis=1), base, out=np.zeros_like(base), where=base > 0.0)
    # Along a thin triangle the points are as dense as it is wide: otherwise points of neighbours would be nearer.
    steps = np.column_stack((np.clip(height, spread / _MOST_LAID, spread), np.full(len(base), spread)))
    counts = np.clip(np.ceil(np.column_stack((base, height)) / steps), 1, _MOST_LAID).astype(np.int64)
    laid, owners = list[Array](), list[Ints]()
    kinds, kind = np.unique(counts, axis=0, return_inverse=True)
    for number, (along, across) in enumerate(kinds.tolist()):
        mine = np.flatnonzero(kind.ravel() == number)
        weights: list[tuple[float, float, float]] = []
        for row in range(across):
            t = (row + 0.5) / across if row else 0.5 / max(along, across)  # the first row reaches into thin corners
            many = max(1, round(along * (1.0 - t)))
            weights += [((1.0 - t) * (1.0 - s), (1.0 - t) * s, t) for s in ((i + 0.5) / many for i in range(many))]
        laid.append(np.einsum("wk,nki->nwi", np.array(weights), turned[mine]).reshape(-1, 3))
        owners.append(np.repeat(mine, len(weights)))
    return np.concatenate(laid), np.concatenate(owners)
