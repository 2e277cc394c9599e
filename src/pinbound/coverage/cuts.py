"""A surface cut in two by a plane, with the cut closed where it is the section of a body.

A part of a solid is the hull of its share of the surface and of the section, for what is inside belongs to the body.
All this only proposes: parts that are larger or smaller than they might be fit less well, but what they hold is proven.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pinbound.coverage.parts import directions
from pinbound.tolerances import SAME_BODY

__all__ = ["best_cut", "cut_by_plane"]

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

_CUTS = (0.25, 0.5, 0.75)
"""Where a part is cut, of its extent, beside the place where it sticks out furthest."""
_LOOKED = 60  # directions in which a part's extent is looked at for the volume of its hull


def best_cut(group: Array, place: Array, thick: float) -> tuple[Array, Array] | None:
    """Return a surface (n, 3, 3) in two, by the plane that leaves the smallest hulls; None if no plane cuts it.

    Args:
        group: Triangles [m].
        place: (3,) [m]: a plane through this place is tried along each axis of the surface.
        thick: [m], what the area of a hull counts for: hulls that are flat have no volume.
    """
    points = group.reshape(-1, 3)
    axes: Any = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2]
    best: tuple[float, tuple[Array, Array]] | None = None
    for axis in np.vstack((axes, np.eye(3))):
        extent = points @ axis
        low, high = float(extent.min()), float(extent.max())
        for at in (float(place @ axis), *(low + share * (high - low) for share in _CUTS)):
            if not low + SAME_BODY < at < high - SAME_BODY:
                continue
            sides = cut_by_plane(group, axis, at)
            cost = sum(_volume(one.reshape(-1, 3), thick) for one in sides)
            if best is None or cost < best[0]:
                best = cost, sides
    return None if best is None else best[1]


def cut_by_plane(group: Array, axis: Array, at: float) -> tuple[Array, Array]:
    """Return the triangles (n, 3, 3) below and above the plane `axis . x = at`, those across it cut, the cut closed.

    Example:
        >>> corner = np.array([[[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0]]])
        >>> below, above = cut_by_plane(corner, np.array([1.0, 0.0, 0.0]), 1.0)
        >>> float(below[..., 0].max()), float(above[..., 0].min()), len(above)
        (1.0, 1.0, 1)
    """
    height = group @ axis - at
    height[np.abs(height) <= SAME_BODY] = 0.0
    below, above = np.all(height <= 0.0, axis=1), np.all(height >= 0.0, axis=1)
    across = ~below & ~above
    corners, heights = group[across], height[across]
    signs = np.sign(heights)
    # The corner that is alone on its side comes first; if one is on the plane, the one below it does.
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
    flat = height == 0.0
    lying = np.argwhere((flat.sum(axis=1) == 2) & ~across)[:, 0]
    on = group[lying][flat[lying]].reshape(-1, 2, 3)
    lids = _lids(np.concatenate((np.stack((one, two), axis=1), on)), axis)
    return (
        np.concatenate((group[below], tips[low], rest[~both], lids)),
        np.concatenate((group[above & ~below], tips[~low], rest[both], lids)),
    )


def _crossing(a: Array, b: Array, p: Array, q: Array) -> Array:
    """Return where edges cross the plane: the same place whichever end comes first."""
    swap = (p > q)[:, None]
    start, end = np.where(swap, b, a), np.where(swap, a, b)
    low, high = np.minimum(p, q), np.maximum(p, q)
    share = np.divide(-low, high - low, out=np.zeros_like(low), where=high > low)
    return start + share[:, None] * (end - start)


def _lids(segments: Array, axis: Array) -> Array:
    """Return triangles over each connected piece of a section (n, 2, 3): the hull of its points."""
    from scipy.sparse import coo_matrix, csgraph
    from scipy.spatial import ConvexHull, QhullError

    if not len(segments):
        return np.zeros((0, 3, 3))
    keys, index = np.unique(np.round(segments.reshape(-1, 3) / SAME_BODY), axis=0, return_inverse=True)
    ends = index.reshape(-1, 2)
    matrix: Any = coo_matrix
    library: Any = csgraph
    graph = matrix((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(len(keys), len(keys)))
    label: NDArray[Any] = library.connected_components(graph, directed=False)[1][ends[:, 0]]
    least = np.eye(3)[int(np.argmin(np.abs(axis)))]
    u: Any = np.cross(axis, least)
    u /= np.linalg.norm(u)
    frame = np.stack((u, np.cross(axis, u)), axis=1)
    found: list[Array] = [np.zeros((0, 3, 3))]
    for piece in np.unique(label).tolist():
        points = np.unique(segments[label == piece].reshape(-1, 3), axis=0)
        if len(points) < 3:
            continue
        try:
            ring = points[ConvexHull(points @ frame).vertices]
        except QhullError:  # it has no area
            continue
        found.append(np.stack((np.repeat(ring[:1], len(ring) - 2, axis=0), ring[1:-1], ring[2:]), axis=1))
    return np.concatenate(found)


def _volume(points: Array, thick: float) -> float:
    """Return about the volume of a hull [m^3], and its area times `thick`, so that flat ones count, too."""
    from scipy.spatial import ConvexHull, QhullError

    if not len(points):
        return 0.0
    chosen = points[np.unique(np.argmax(points @ directions(_LOOKED).T, axis=0))]
    try:
        hull = ConvexHull(chosen)
    except QhullError:  # flat
        return thick * float(np.sort(np.ptp(chosen, axis=0))[1:].prod())
    return float(hull.volume + thick * hull.area)
