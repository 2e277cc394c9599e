"""Folds of a planar map: where the Jacobian's determinant changes its sign, with a proof where it does not.

On a triangle with centre c, `|det(x) - det(c)| <= max over corners of sum_k D_k |x_k - c_k|`, D being the Lipschitz
bounds. A triangle where |det(c)| is larger has one sign. Others are cut in four, up to a budget; what is left then is
reported as undecided, and counts as a fold.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, cast

import numpy as np
import shapely
from numpy.typing import NDArray

from pinbound.region.planar_image import PlanarImage

__all__ = ["Folds", "find_folds", "split", "triangulate"]

Array = NDArray[np.float64]

_LEVELS = 9
_BUDGET = 200_000


@dataclass(frozen=True)
class Folds:
    """What is known of the sign of the determinant over a region.

    Attributes:
        sign: 1 or -1 if proven over the whole region, else 0.
        margin: [m^2/rad^2]. With a proven sign, a lower bound of |det| over the region; else 0.
        points: (k, 2) centres [rad] of the triangles that were left undecided: they line the fold.
        triangles: How many triangles were looked at.
    """

    sign: int
    margin: float
    points: Array
    triangles: int


def triangulate(polygon: Any) -> Array:
    """Return a triangulation (M, 3, 2) of a polygon with holes; corners are the polygon's own vertices.

    Example:
        >>> triangulate(shapely.box(0.0, 0.0, 1.0, 1.0)).shape
        (2, 3, 2)
    """
    parts = shapely.get_parts(cast(Any, shapely).constrained_delaunay_triangles(polygon))
    return np.array([shapely.get_coordinates(part)[:3] for part in parts]).reshape(-1, 3, 2)


def split(triangles: Array) -> Array:
    """Return every triangle cut in four by the middles of its sides."""
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
    parts = [np.stack(corners, axis=1) for corners in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
    return np.concatenate(parts)


def find_folds(image: PlanarImage, polygon: Any) -> Folds:
    """Return the sign of the determinant over a polygon, proven, or the places where it is not."""
    triangles, looked_at = triangulate(polygon), 0
    margin, signs = np.inf, set[int]()
    for _ in range(_LEVELS):
        if not len(triangles) or looked_at + len(triangles) > _BUDGET:
            break
        looked_at += len(triangles)
        centres = triangles.mean(axis=1)
        determinant = image.determinant(centres)
        reach = np.max(np.abs(triangles - centres[:, None]) @ image.determinant_lipschitz, axis=1)
        room = np.abs(determinant) - reach
        proven = room > 0.0
        if np.any(proven):
            margin = min(margin, float(np.min(room[proven])))
            signs |= set(np.sign(determinant[proven]).astype(int).tolist())
        triangles = split(triangles[~proven])
    if len(signs) == 1 and not len(triangles):
        return Folds(signs.pop(), margin, np.empty((0, 2)), looked_at)
    return Folds(0, 0.0, triangles.mean(axis=1), looked_at)
