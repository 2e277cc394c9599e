"""Shapes of marks: the convex hull of vertices with a radius around it, a line, or a plane, fixed to a link.

A point is the hull of one vertex, a segment of two, a box of eight. Each mark becomes a `Shape` once; later code does
not depend on how the mark was written.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np

from pinbound.geometry import gjk
from pinbound.tolerances import EXTREME
from pinbound.typing import Array, Ints
from pinbound.values import Value, read_only

__all__ = ["Measure", "Shape", "cube_corners", "extreme_vertices", "hull", "unbounded", "zonotope"]


_DEEP = 1e-9  # of a hull of unit extent: further inside all facets, a point is not a vertex, rounded or not


class Measure(Enum):
    """The quantity that a boundary measures.

    `DISTANCE` is the distance of two bodies, `ACROSS` the distance from an unbounded line, and `HEIGHT` the height
    above a plane.

    Example:
        >>> Measure.HEIGHT.quantity, Measure.ACROSS.quantity
        ('height', 'distance')
    """

    DISTANCE = "distance"
    ACROSS = "across a line"
    HEIGHT = "height above a plane"

    @property
    def quantity(self) -> str:
        """The name of the quantity, for texts."""
        return "height" if self is Measure.HEIGHT else "distance"


@dataclass(frozen=True, eq=False)
class Shape(Value):
    """All points `origin + sum_i t_i direction_i`, t in the convex hull of the corners, with `radius` around them.

    Attributes:
        origin: (3,) [m] in the frame of the link; for a line or plane, a point on it.
        directions: (m, 3) [m]. A point has none; a segment has its edge vector; a parallelogram or parallelepiped has
            its two or three edge vectors; other hulls have orthonormal vectors of 1 m.
        corners: (k, m), the vertices as coefficients of the directions.
        radius: [m].
        measure: The quantity that a boundary measures; a bounded shape always has the distance.
        normal: (3,) unit vector along a line, or unit normal of a plane; None for a bounded shape.
        excess: How far the shape sticks out of the marked body [m]; not zero for the prism around a cylinder.

    Example:
        >>> import pinbound as pb
        >>> shape = pb.Segment("s", "arm", (0.0, 0.0, 0.0), (0.2, 0.0, 0.0), radius=0.01).shape
        >>> shape.is_segment, shape.vertices.shape, shape.radius
        (True, (2, 3), 0.01)
    """

    origin: Array
    directions: Array
    corners: Array
    radius: float = 0.0
    measure: Measure = Measure.DISTANCE
    normal: Array | None = None
    excess: float = 0.0

    @property
    def is_unbounded(self) -> bool:
        """Whether it is a line or a plane."""
        return self.measure is not Measure.DISTANCE

    @property
    def is_point(self) -> bool:
        """Whether it has one vertex: a point, or a sphere if it has a radius."""
        return not self.is_unbounded and not len(self.directions)

    @property
    def is_segment(self) -> bool:
        """Whether it has two vertices: a segment, or a capsule if it has a radius."""
        return not self.is_unbounded and len(self.corners) == 2

    @cached_property
    def is_zonotope(self) -> bool:
        """Whether its corners are those of the unit cube, so that t runs over [0, 1]^m."""
        m = len(self.directions)
        return len(self.corners) == 2**m and bool(np.array_equal(self.corners, cube_corners(m)))

    @cached_property
    def vertices(self) -> Array:
        """Its vertices (k, 3) [m] in the frame of the link; for a line or plane, the point on it."""
        return read_only(self.origin + self.corners @ self.directions)

    @property
    def middle(self) -> Array:
        """The middle of its vertices (3,) [m]; for a line or plane, the point on it."""
        return read_only(0.5 * (self.vertices.min(axis=0) + self.vertices.max(axis=0)))

    @cached_property
    def around(self) -> float:
        """The largest distance of its vertices from `middle` [m], without the radius."""
        return float(np.linalg.norm(self.vertices - self.middle, axis=1).max())

    @property
    def half_edges(self) -> float:
        """Half the sum of the lengths of its edge vectors [m]; for other hulls, the largest distance from `middle`."""
        return 0.5 * float(np.linalg.norm(self.directions, axis=1).sum()) if self.is_zonotope else self.around

    @property
    def anchors(self) -> Array:
        """Its origin, and the ends of its directions from there (1 + m, 3) [m]; of its normal for a line or plane."""
        return read_only(
            self.origin + np.vstack((np.zeros(3), self.directions if self.normal is None else self.normal))
        )

    @property
    def reach(self) -> float:
        """An upper bound of the distance of its vertices from the origin of the link [m]."""
        if self.is_zonotope:
            return float(np.linalg.norm(self.origin) + np.linalg.norm(self.directions, axis=1).sum())
        return float(np.linalg.norm(self.origin) + np.linalg.norm(self.corners, axis=1).max())


def zonotope(origin: Sequence[float], edges: Sequence[Sequence[float]], radius: float = 0.0) -> Shape:
    """Return the shape of all `origin + sum_i t_i edge_i`, t_i in [0, 1]; edge vectors must not be zero.

    Example:
        >>> zonotope((1.0, 0.0, 0.0), [(0.0, 2.0, 0.0)]).vertices.tolist()
        [[1.0, 0.0, 0.0], [1.0, 2.0, 0.0]]
    """
    directions = np.array(edges, dtype=np.float64).reshape(-1, 3)
    return Shape(np.array(origin, dtype=np.float64), directions, cube_corners(len(directions)), radius)


def unbounded(measure: Measure, origin: Sequence[float], towards: Sequence[float], radius: float = 0.0) -> Shape:
    """Return a line or plane through a point, along a vector, or with the vector as its normal, of any length."""
    length = math.hypot(*towards)
    normal = np.array([part / length for part in towards])
    return Shape(np.array(origin, dtype=np.float64), np.zeros((0, 3)), np.zeros((1, 0)), radius, measure, normal)


def hull(vertices: Sequence[Sequence[float]] | Array, radius: float = 0.0) -> Shape:
    """Return the shape of a convex hull: its extreme vertices, over the directions that it spans.

    A hull that is flat up to rounding (`tolerances.EXTREME`, relative to the furthest vertex) has fewer than three
    directions.

    Example:
        >>> square = [(x, y, 0.0) for x in (0.0, 1.0) for y in (0.0, 2.0)]
        >>> shape = hull([*square, (0.5, 1.0, 0.0), (0.5, 0.0, 0.0)])
        >>> len(shape.directions), shape.vertices.round(12).tolist()
        (2, [[0.0, 0.0, 0.0], [0.0, 2.0, 0.0], [1.0, 0.0, 0.0], [1.0, 2.0, 0.0]])
        >>> hull([(0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, 0.25)]).directions.tolist()
        [[0.0, 0.0, 1.0]]
    """
    points = extreme_vertices(np.array(vertices, dtype=np.float64).reshape(-1, 3))
    if len(points) == 1:
        return zonotope(points[0], (), radius)
    if len(points) == 2:
        return zonotope(points[0], [points[1] - points[0]], radius)
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    offsets = points - middle
    axes = _spanned(offsets, _rounding(points))
    if len(axes) == 3:
        return Shape(middle, np.eye(3), offsets, radius)
    normal: Any = np.cross(axes[0], axes[1])
    plane = _plane_axes(normal)
    return Shape(middle, plane, offsets @ plane.T, radius)


def extreme_vertices(points: Array) -> Array:
    """Return the extreme points (k, 3) of their convex hull, in their order; all others are inside it up to rounding.

    Scaling along a direction does not change which points are extreme. So each principal direction is scaled to unit
    extent first, and a thin hull becomes a body with good angles. Qhull finds the vertices. Each point that Qhull
    leaves out is compared with the hull of the kept points, and is kept too if it is outside by more than rounding.
    """
    points = points[np.sort(np.unique(points, axis=0, return_index=True)[1])]
    offsets = points - points[0]
    axes = _spanned(offsets, _rounding(points))
    if len(axes) == 0:
        return points[:1]
    local = offsets @ axes.T
    if len(axes) == 1:
        return points[np.sort([int(np.argmin(local[:, 0])), int(np.argmax(local[:, 0]))])]
    low, high = local.min(axis=0), local.max(axis=0)
    local = (local - 0.5 * (low + high)) / (high - low)
    kept, doubtful = _sorted_by_qhull(local)
    while len(doubtful):
        outside = _outside(local[doubtful], local[kept])
        furthest = int(np.argmax(outside))
        if outside[furthest] <= EXTREME:
            break
        kept, doubtful = np.append(kept, doubtful[furthest]), np.delete(doubtful, furthest)
    return points[np.sort(kept)]


def _outside(points: Array, kept: Array) -> Array:
    """Return the distances of points (N, d) from the hull of others."""
    points, kept = (np.pad(one, ((0, 0), (0, 3 - one.shape[1]))) for one in (points, kept))
    directions = np.repeat(-np.eye(3)[:, None], len(points), axis=1)
    t = gjk.nearest_vertices(points, directions, (kept, np.zeros((1, 0))))[0]
    found: Array = np.linalg.norm(points - t, axis=1)
    return found


def _sorted_by_qhull(local: Array) -> tuple[Ints, Ints]:
    """Return which points (N, d) are vertices, and which others are not deep inside all facets."""
    from scipy.spatial import ConvexHull, QhullError

    everything = np.arange(len(local))
    if len(local) == local.shape[1] + 1:
        return everything, everything[:0]
    try:
        found = ConvexHull(local)
    except QhullError:  # a sliver that is flat for Qhull: its furthest points, to which others are added
        kept = np.unique(np.concatenate((np.argmin(local, axis=0), np.argmax(local, axis=0))))
        return kept, np.setdiff1d(everything, kept)
    kept = np.sort(found.vertices).astype(np.int64)
    height = np.full(len(local), -np.inf)
    for normal in found.equations:  # one at a time: points and facets may be many
        height = np.maximum(height, local @ normal[:-1] + normal[-1])
    return kept, np.setdiff1d(np.flatnonzero(height > -_DEEP), kept)


def _spanned(offsets: Array, tolerance: float) -> Array:
    """Return orthonormal rows (m, 3) of the directions in which offsets extend further than the tolerance."""
    rows: list[Array] = []
    left = offsets.copy()
    for _ in range(3):
        lengths = np.linalg.norm(left, axis=1)
        furthest = int(np.argmax(lengths))
        if lengths[furthest] <= tolerance:
            break
        axis = left[furthest] / lengths[furthest]
        for row in rows:  # a second time, for the digits that the difference lost
            axis = axis - row * (row @ axis)
        axis /= np.linalg.norm(axis)
        rows.append(axis)
        left = left - np.outer(left @ axis, axis)
    return np.array(rows).reshape(-1, 3)


def _plane_axes(normal: Array) -> Array:
    """Return two unit vectors perpendicular to a normal, one of them as near as possible to an axis of the link."""
    axis = np.eye(3)[int(np.argmin(np.abs(normal)))]
    first = axis - normal * (normal @ axis) / (normal @ normal)
    first /= np.linalg.norm(first)
    second: Any = np.cross(normal, first)
    return np.stack((first, second / np.linalg.norm(second)))


def _rounding(points: Array) -> float:
    return EXTREME * float(np.linalg.norm(points, axis=1).max())


def cube_corners(m: int) -> Array:
    """Return the corners of the unit cube (2^m, m), with zeros first."""
    return np.array(list(product((0.0, 1.0), repeat=m))).reshape(2**m, m)
