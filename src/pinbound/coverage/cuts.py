"""Cut a surface in two by a plane, and close the cut where it is the section of a body.

A part of a solid is the hull of its share of the surface and of the section, because the inside belongs to the body.
All of this only proposes parts. A part that is larger or smaller than necessary fits less well, but its marks are still
proven.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pinbound.tolerances import SAME_BODY
from pinbound.values import Value

__all__ = ["NO_ROW", "Side", "cut_by_plane", "on_plane"]

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Ints = NDArray[np.int64]

NO_ROW = -1
"""In place of a triangle's number: it closes a cut."""
_FLUSH = 1e-7  # of a surface's extent: corners this near to a plane are on it, because files have seven digits
_MOST_PAIRS = 4_000_000  # pairs of a point and a side of a section that are examined; larger sections use the hull


def on_plane(height: Array) -> Array:
    """Return heights above a plane; heights that are only the rounding of a file become zero."""
    least = max(SAME_BODY, _FLUSH * float(np.ptp(height))) if height.size else SAME_BODY
    return np.where(np.abs(height) <= least, 0.0, height)


@dataclass(frozen=True, eq=False)
class Side(Value):
    """The part of a body's surface on one side of a plane.

    Attributes:
        triangles: (n, 3, 3) [m].
        rows: (n,), the triangle from which each was cut; `NO_ROW` for triangles that close the cut.
    """

    triangles: Array
    rows: Ints


def cut_by_plane(group: Array, axis: Array, at: float) -> tuple[Side, Side]:
    """Cut triangles (n, 3, 3) by the plane `axis . x = at`; return those below and above it, with the cut closed.

    Triangles in the plane belong to the side of which they are the surface.

    Example:
        >>> corner = np.array([[[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0]]])
        >>> below, above = cut_by_plane(corner, np.array([1.0, 0.0, 0.0]), 1.0)
        >>> float(below.triangles[..., 0].max()), float(above.triangles[..., 0].min()), above.rows.tolist()
        (1.0, 1.0, [0])
    """
    height = on_plane(group @ axis - at)
    below, above = np.all(height <= 0.0, axis=1), np.all(height >= 0.0, axis=1)
    across, lying = ~below & ~above, below & above
    corners, heights = group[across], height[across]
    signs = np.sign(heights)
    # The corner that is alone on its side comes first; if a corner is on the plane, the one below it comes first.
    alone = np.where(np.sum(signs, axis=1) > 0.0, -1.0, np.where(np.sum(signs, axis=1) < 0.0, 1.0, -1.0))
    first = np.argmax(signs == alone[:, None], axis=1)
    rows = np.arange(len(corners))
    order = [(first + turn) % 3 for turn in range(3)]
    a, b, c = (corners[rows, one] for one in order)
    p, q, r = (heights[rows, one] for one in order)
    one, two = _crossing(a, b, p, q), _crossing(a, c, p, r)
    tips = np.stack((a, one, two), axis=1)
    rest = np.concatenate((np.stack((one, b, c), axis=1), np.stack((one, c, two), axis=1)))
    low = alone < 0.0
    both = np.concatenate((low, low))
    # Seen from above, the body is on the right of its section's sides.
    sides = np.where(low[:, None, None], np.stack((one, two), axis=1), np.stack((two, one), axis=1))
    normals: Any = np.cross(group[lying, 1] - group[lying, 0], group[lying, 2] - group[lying, 0])
    up = np.zeros(len(group), dtype=np.bool_)
    up[lying] = normals @ axis > 0.0
    own = below & (~lying | up), above & (~lying | ~up)
    cut = np.flatnonzero(across)
    found: list[Side] = []
    for flags, whole, tip, other in ((below, own[0], low, ~both), (above, own[1], ~low, both)):
        lid = _lids(np.concatenate((sides, _edges(group, height, flags & ~lying, axis))), axis)
        triangles = np.concatenate((group[whole], tips[tip], rest[other], lid))
        source = np.flatnonzero(whole), cut[tip], np.tile(cut, 2)[other], np.full(len(lid), NO_ROW)
        found.append(Side(triangles, np.concatenate(source)))
    return found[0], found[1]


def _crossing(a: Array, b: Array, p: Array, q: Array) -> Array:
    """Return where edges cross the plane: the same point for either order of the ends."""
    swap = (p > q)[:, None]
    start, end = np.where(swap, b, a), np.where(swap, a, b)
    low, high = np.minimum(p, q), np.maximum(p, q)
    share = np.divide(-low, high - low, out=np.zeros_like(low), where=high > low)
    return start + share[:, None] * (end - start)


def _edges(group: Array, height: Array, flags: Flags, axis: Array) -> Array:
    """Return the sides (n, 2, 3), in the plane, of triangles on one side of it; the body is on their right."""
    rows = np.flatnonzero(flags & (np.sum(height == 0.0, axis=1) == 2))
    apex = np.argmax(height[rows] != 0.0, axis=1)
    start, end = group[rows, (apex + 1) % 3], group[rows, (apex + 2) % 3]
    turn = (height[rows, apex] > 0.0)[:, None]
    return np.stack((np.where(turn, end, start), np.where(turn, start, end)), axis=1)


def _lids(sides: Array, axis: Array) -> Array:
    """Return triangles that fill the outline of a section, given by its sides (n, 2, 3).

    The Delaunay triangles whose middles are inside are taken. A middle is inside by the number of sides in one
    direction, or by the turns of the sides about it, because bodies may overlap and triangles may be inverted.
    """
    from scipy.spatial import Delaunay, QhullError

    least = np.eye(3)[int(np.argmin(np.abs(axis)))]
    u: Any = np.cross(axis, least)
    u /= np.linalg.norm(u)
    frame: Any = np.stack((u, np.cross(axis, u)), axis=1)
    flat: Array = sides @ frame
    sides, flat = sides[np.any(flat[:, 0] != flat[:, 1], axis=1)], flat[np.any(flat[:, 0] != flat[:, 1], axis=1)]
    if len(sides) < 3:
        return np.zeros((0, 3, 3))
    points, place = np.unique(np.round(flat.reshape(-1, 2), 9), axis=0, return_index=True)
    try:
        rows: Ints = np.array(Delaunay(points).simplices, dtype=np.int64)
    except QhullError:  # it has no area
        return np.zeros((0, 3, 3))
    triangles = sides.reshape(-1, 3)[place][rows]
    if len(rows) * len(flat) > _MOST_PAIRS:
        return triangles
    middles = points[rows].mean(axis=1)
    (x0, y0), (x1, y1) = flat[:, 0].T, flat[:, 1].T
    rises: Ints = (y0 <= middles[:, 1:]).astype(np.int64) - (y1 <= middles[:, 1:])
    share: Array = np.divide(middles[:, 1:] - y0, y1 - y0, out=np.zeros((len(rows), len(flat))), where=rises != 0)
    right: Flags = (rises != 0) & (x0 + share * (x1 - x0) > middles[:, :1])
    inside = (np.count_nonzero(right, axis=1) % 2 == 1) | (np.sum(rises * right, axis=1) != 0)
    return triangles[inside]
