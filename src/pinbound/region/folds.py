"""Folds of a planar map: the places where the determinant of the Jacobian changes its sign, or a proof of none.

On a box with centre c and half-sides h, `|det(x) - det(c)| <= sum_k D_k h_k`, where D are the Lipschitz bounds. If
|det(c)| is larger, the box has one sign. Other boxes are cut in four, up to a budget, and those outside the region are
left out. The remaining boxes are reported as undecided, and count as a fold.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, cast

import numpy as np
import shapely

from pinbound.region.planar_image import PlanarImage
from pinbound.typing import Array
from pinbound.values import Value

__all__ = ["Folds", "find_folds", "triangulate"]

gis = cast(Any, shapely)  # its stubs leave types open

_LEVELS = 10
_BUDGET = 200_000
_CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


@dataclass(frozen=True, eq=False)
class Folds(Value):
    """The proven sign of the determinant over a region.

    Attributes:
        sign: 1 or -1 if proven over the whole region, else 0.
        margin: [m^2/rad^2]. With a proven sign, a lower bound of |det| over the region; else 0.
        points: (k, 2) centres [rad] of the undecided boxes: they follow the fold.
        boxes: The number of boxes examined.
    """

    sign: int
    margin: float
    points: Array
    boxes: int


def triangulate(polygon: Any) -> Array:
    """Return a triangulation (M, 3, 2) of a polygon with holes; corners are the polygon's own vertices.

    Example:
        >>> triangulate(shapely.box(0.0, 0.0, 1.0, 1.0)).shape
        (2, 3, 2)
    """
    parts = shapely.get_parts(cast(Any, shapely).constrained_delaunay_triangles(polygon))
    return np.array([shapely.get_coordinates(part)[:3] for part in parts]).reshape(-1, 3, 2)


def find_folds(image: PlanarImage, polygon: Any) -> Folds:
    """Return the proven sign of the determinant over a polygon, or the places where it is not proven."""
    west, south, east, north = polygon.bounds
    centres, half = np.array([[west + east, south + north]]) / 2, np.array([east - west, north - south]) / 2
    margin, signs, looked_at = np.inf, set[int](), 0
    shapely.prepare(polygon)
    for level in range(_LEVELS):
        if looked_at + len(centres) > _BUDGET:
            break
        corners = np.concatenate((centres - half, centres + half), axis=1)
        centres = centres[gis.intersects(polygon, gis.box(*corners.T))]
        looked_at += len(centres)
        determinant = image.determinant(centres)
        room = np.abs(determinant) - float(half @ image.determinant_lipschitz)
        proven = room > 0.0
        if np.any(proven):
            margin = min(margin, float(np.min(room[proven])))
            signs |= set(np.sign(determinant[proven]).astype(int).tolist())
        centres = centres[~proven]
        if not len(centres):
            break
        if level < _LEVELS - 1:
            half = half / 2
            centres = (centres[:, None] + half * _CORNERS).reshape(-1, 2)
    if len(signs) == 1 and not len(centres):
        return Folds(signs.pop(), margin, np.empty((0, 2)), looked_at)
    return Folds(0, 0.0, centres, looked_at)
