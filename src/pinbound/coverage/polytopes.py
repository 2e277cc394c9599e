"""A closed surface of triangles around the hull of some points, with its proof, and a test of points inside it.

Qhull proposes the triangles. The proof has two conditions: each edge is in two triangles, once in each direction, and a
point c sees all of them from inside. Then every ray from c meets one of them, at `gauge = 1`:

    gauge(x) = max over facets f of n_f . (x - c) / n_f . (a_f - c).

The corners of all triangles are among the points, so the enclosed volume is in the hull. `docs/covers.md`.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pinbound.coverage.triangles import Triangles
from pinbound.tolerances import UNIT_ROUNDOFF
from pinbound.values import Value, read_only

__all__ = ["Polytope", "split_polygon"]

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

_ROUNDED = 32.0 * UNIT_ROUNDOFF  # of a product of three lengths: the error of a determinant of rounded differences
_MOST_MENDED = 12  # rounds in which slivers are replaced
_MOST_SLIVERS = 100  # slivers replaced at once
_NEEDLE = 1e-9  # of a sliver's longest side: corners nearer to each other count as one
_BLOCK = 2_000_000  # entries of a table of points and facets that is made at once


@dataclass(frozen=True, eq=False)
class Polytope(Value):
    """Points, and triangles that are proven to enclose nearly their hull.

    Attributes:
        vertices: (k, 3) [m].
        facets: (F, 3), rows of `vertices`, counter-clockwise seen from outside.
        centre: (3,) [m], the point that sees all facets from inside.
        slopes: (F, 3) [1/m], `n_f / n_f . (a_f - c)`: gauge is the largest entry of `slopes @ (x - centre)`.
        rounded: (F,), bounds of the rounding of each of these entries within `reach` of the centre.
        reach: [m], the largest distance of a vertex from the centre.
        slack: [m], how far a point of the hull may be outside the enclosed volume.
    """

    vertices: Array
    facets: Ints
    centre: Array
    slopes: Array
    rounded: Array
    reach: float
    slack: float

    @classmethod
    def of(cls, vertices: Array) -> Polytope | None:
        """Return it; None if the points lie in a plane, or if no proof is found.

        Example:
            >>> cube = Polytope.of(np.array([(x, y, z) for x in (0.0, 1) for y in (0.0, 1) for z in (0.0, 1)]))
            >>> cube.away(np.array([[0.5, 0.5, 1.0], [0.5, 0.5, 2.0]])).round(6).tolist()
            [0.0, 1.0]
        """
        facets = _proposed(vertices)
        if facets is None:
            return None
        centre = vertices.mean(axis=0)
        offsets = vertices - centre
        reach = float(np.linalg.norm(offsets, axis=1).max()) * (1.0 + 8.0 * UNIT_ROUNDOFF)
        for _ in range(_MOST_MENDED):
            if not _is_closed(facets):
                return None
            a, b, c = (vertices[facets[:, corner]] for corner in range(3))
            normals: Any = np.cross(b - a, c - a)
            heights = np.einsum("fi,fi->f", normals, a - centre)
            size = np.linalg.norm(b - a, axis=1) * np.linalg.norm(c - a, axis=1)
            error = _ROUNDED * size * 2.0 * reach
            unsure = heights <= error
            # The centre sees it from behind, or it is so flat that its height cannot be a divisor.
            wrong = [row for row in np.flatnonzero(unsure).tolist() if not _is_edge_on(vertices[facets[row]], centre)]
            if not wrong:
                break
            if len(wrong) > _MOST_SLIVERS:
                return None
            facets = _without(facets, wrong, vertices)
        else:
            return None
        sure = ~unsure  # triangles without area as seen from c: only the rays of one plane meet them
        if not np.any(sure):
            return None
        slopes = normals[sure] / heights[sure, None]
        rounded = 2.0 * error[sure] / heights[sure]
        out = float(np.max(offsets @ slopes.T + rounded)) - 1.0
        return cls(vertices, facets, centre, slopes, rounded, reach, max(out, 0.0) * reach)

    def away(self, points: Array) -> Array:
        """Return upper bounds (N,) of the distances of points from the enclosed volume [m]; 0 for points inside."""
        found = np.zeros(len(points))
        step = max(1, _BLOCK // len(self.slopes))
        for start in range(0, len(points), step):
            block = points[start : start + step] - self.centre
            gauge = self._gauge(block)
            length = np.linalg.norm(block, axis=1)
            found[start : start + step] = np.maximum(1.0 - 1.0 / np.maximum(gauge, 1.0), 0.0) * length
        return found

    def beyond(self, points: Array) -> Array:
        """Return the distances of points from the nearest triangle that sees them (N,) [m]; infinite if there is none.

        A triangle is in the hull. So this is an upper bound of the distance from the hull. It equals the distance, up
        to rounding and `slack`, because the point of a hull that is nearest to a point outside is on such a triangle.
        """
        found = np.full(len(points), np.inf)
        step = max(1, _BLOCK // len(self.facets))
        for start in range(0, len(points), step):
            block = points[start : start + step]
            rows, facets = np.nonzero(self.heights(block) >= 0.0)
            np.minimum.at(found, start + rows, self._triangles.away(block[rows], facets))
        return found

    @cached_property
    def _triangles(self) -> Triangles:
        return Triangles(self.vertices[self.facets])

    def inside(self, points: Array, depth: float) -> NDArray[np.bool_]:
        """Return which points (N,) are inside, by at least `depth` (share of the way from the centre)."""
        return self._gauge(points - self.centre) <= 1.0 - depth

    def _gauge(self, offsets: Array) -> Array:
        stretch = np.maximum(np.abs(offsets).max(axis=1, initial=0.0) / self.reach, 1.0)
        return np.max(offsets @ self.slopes.T + self.rounded * stretch[:, None], axis=1)

    def heights(self, points: Array) -> Array:
        """Return the heights of points (N, 3) above the plane of each facet (N, F) [m]."""
        normals = self.normals
        level = np.einsum("fi,fi->f", normals, self.vertices[self.facets[:, 0]])
        return points @ normals.T - level

    @cached_property
    def normals(self) -> Array:
        """Outward unit normals (F, 3); zero for triangles without area."""
        a, b, c = (self.vertices[self.facets[:, corner]] for corner in range(3))
        normals: Any = np.cross(b - a, c - a)
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        return read_only(np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0.0))


def _proposed(vertices: Array) -> Ints | None:
    """Return the triangles that Qhull makes of the points, scaled to equal extents, oriented outwards."""
    from scipy.spatial import ConvexHull, QhullError

    if len(vertices) < 4:
        return None
    middle = vertices.mean(axis=0)
    spread = np.linalg.svd(vertices - middle, full_matrices=False)
    if not spread[1][2] > 1e-9 * spread[1][0]:
        return None
    local = (vertices - middle) @ spread[2].T / spread[1]
    try:
        hull = ConvexHull(local)
    except QhullError:
        return None
    facets = np.array(hull.simplices, dtype=np.int64)
    a, b, c = (local[facets[:, corner]] for corner in range(3))
    normals: Any = np.cross(b - a, c - a)
    inward = np.einsum("fi,fi->f", normals, hull.equations[:, :3]) < 0.0
    if np.linalg.det(spread[2]) < 0.0:
        inward = ~inward
    facets[inward] = facets[inward][:, ::-1]
    return facets


def _is_closed(facets: Ints) -> bool:
    """Return whether each edge is in two triangles, once in each direction."""
    count = int(facets.max()) + 1
    start, end = facets.ravel(), np.roll(facets, -1, axis=1).ravel()
    there, back = np.sort(start * count + end), np.sort(end * count + start)
    return bool(np.array_equal(there, back)) and not np.any(there[1:] == there[:-1])


def _without(facets: Ints, rows: list[int], vertices: Array) -> Ints:
    """Return other triangles in place of slivers, with the same border; the result must still be proven.

    A sliver and the triangle at its longest side have four corners: the side is replaced by the other diagonal. If two
    corners are much nearer to each other than to the third, one replaces the other.
    """
    found: list[list[int]] = facets.tolist()
    gone: set[int] = set()
    for row in rows:
        corners = found[row]
        if row in gone:
            continue
        ends = vertices[np.roll(corners, -1)] - vertices[corners]
        lengths = np.linalg.norm(ends, axis=1)
        longest, shortest = int(np.argmax(lengths)), int(np.argmin(lengths))
        if lengths[shortest] <= _NEEDLE * lengths[longest]:
            kept, lost = corners[shortest], corners[(shortest + 1) % 3]
            found = [[kept if corner == lost else corner for corner in one] for one in found]
            gone |= {place for place, one in enumerate(found) if len(set(one)) < 3}
            continue
        i, j, k = (corners[(longest + turn) % 3] for turn in range(3))
        for place, other in enumerate(found):
            at = next((turn for turn in range(3) if (other[turn], other[(turn + 1) % 3]) == (j, i)), None)
            if at is not None and place not in gone:
                last = other[(at + 2) % 3]
                found[row], found[place] = [k, i, last], [last, j, k]
                break
    kept_rows = [one for place, one in enumerate(found) if place not in gone]
    return np.array(kept_rows, dtype=np.int64).reshape(-1, 3)


def _is_edge_on(corners: Array, centre: Array) -> bool:
    """Return whether a triangle and the centre are in one plane: without rounding, the determinant is zero."""
    c = [Fraction(x) for x in centre.tolist()]
    a, b, d = ([Fraction(x) - y for x, y in zip(row, c, strict=True)] for row in corners.tolist())
    minors = (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
    return sum((x * y for x, y in zip(minors, d, strict=True)), Fraction(0)) == 0


def split_polygon(polygon: Array, height: Array) -> tuple[Array, Array]:
    """Return the parts of a convex polygon with a negative height, and with a positive height; both include the cut.

    Example:
        >>> square = np.array([[0.0, 0, 0], [2.0, 0, 0], [2.0, 2.0, 0], [0, 2.0, 0]])
        >>> [len(part) for part in split_polygon(square, square[:, 0] - 1.0)]
        [4, 4]
    """
    below: list[Array] = []
    above: list[Array] = []
    count = len(polygon)
    for row in range(count):
        here, there = float(height[row]), float(height[(row + 1) % count])
        if here <= 0.0:
            below.append(polygon[row])
        if here >= 0.0:
            above.append(polygon[row])
        if here * there < 0.0:
            place = polygon[row] + here / (here - there) * (polygon[(row + 1) % count] - polygon[row])
            below.append(place)
            above.append(place)
    return np.array(below).reshape(-1, 3), np.array(above).reshape(-1, 3)
