"""The places that the image of a region covers, each counted once, for a map that may fold or overlap itself.

A region is cut along its folds. On each part the Jacobian keeps its sign. So the winding number of the image of the
part's contour about a place is, up to that sign, the number of points of the part that are mapped there. The part
covers the places where this number is not zero, however often the image overlaps itself. The images of all contours and
folds together divide the plane into faces. In each face no winding number changes, so one point decides.
`docs/workspace.md`.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
import shapely

from pinbound.bounds.derivative_bounds import LeverArms
from pinbound.evaluate import numeric
from pinbound.exceptions import UnsupportedError
from pinbound.region.contours import trace
from pinbound.region.planar_image import PlanarImage
from pinbound.tolerances import REDUCTION
from pinbound.typing import Array, Ints

__all__ = ["FoldFunction", "Parts", "covered", "cut_along_folds", "subdivided"]

sh = cast(Any, shapely)  # newer functions than the stubs know

_FOLD = 1e-5  # rad or m: the largest distance of a fold's polyline from the fold; its image moves by the square of that
_GRID = 65  # points on each side, to detect a Jacobian that is zero everywhere
_LEAST_FACE = 1e-12  # of the area inside the contours: smaller faces are slivers from rounding


@dataclass(frozen=True)
class FoldFunction:
    """The determinant `det(x) = n . (p_1 x p_2)` of a planar map, in the form for `contours.trace`.

    Attributes:
        image: The map.
        arms: Bounds of |det|, and of its first and second derivatives.
        threshold: 0, because the determinant is zero on folds.
    """

    image: PlanarImage
    arms: LeverArms
    threshold: float = 0.0

    @property
    def scale(self) -> float:
        """The bound of |det|; rounding is relative to it."""
        return self.arms.length

    @classmethod
    def of(cls, image: PlanarImage) -> FoldFunction:
        """Bound the derivatives of the determinant by those of the map."""
        first, second, third = image.first_bound, image.second_bound, image.third_bound
        slope = image.determinant_lipschitz
        bend = np.zeros((2, 2))
        for k, m in itertools.product(range(2), repeat=2):
            bend[k, m] = (
                third[0, k, m] * first[1]
                + second[0, k] * second[1, m]
                + second[0, m] * second[1, k]
                + first[0] * third[1, k, m]
            )
        return cls(image, LeverArms(float(first[0] * first[1]), slope, bend))

    def value(self, X: Array) -> Array:
        """Return det (N,) [m^2/rad^2]."""
        return self.image.determinant(X)

    def value_gradient(self, X: Array) -> tuple[Array, Array]:
        """Return det (N,) and its gradient (N, 2)."""
        _, J, H = numeric.derivatives(self.image.chain, X, order=2)
        plane = np.array((self.image.u, self.image.v))
        J, H = np.einsum("ai,nik->nak", plane, J), np.einsum("ai,nikl->nakl", plane, H)
        value = J[:, 0, 0] * J[:, 1, 1] - J[:, 0, 1] * J[:, 1, 0]
        gradient = (
            H[:, 0, 0] * J[:, 1, 1, None]
            + J[:, 0, 0, None] * H[:, 1, 1]
            - H[:, 0, 1] * J[:, 1, 0, None]
            - J[:, 0, 1, None] * H[:, 1, 0]
        )
        return value, gradient

    def parts(self, X: Array) -> tuple[Array, Array, Array, Array]:
        """Return det (N,), its gradient (N, 2), det again, and the gradient's sizes (N, 2)."""
        value, gradient = self.value_gradient(X)
        return value, gradient, value, np.abs(gradient)

    def curvature(self, length: Array, slopes: Array, half: Array) -> Array:
        """Return bounds (N, 2, 2) of det's Hessian."""
        return np.broadcast_to(self.arms.second, (len(half), 2, 2))


@dataclass(frozen=True)
class Parts:
    """A region cut along the folds of a map.

    Attributes:
        lines: (k, 2) each: all contours and folds, cut at their crossings.
        polygons: The parts, in each of which the determinant keeps its sign.
        is_flat: Whether the determinant is zero everywhere: the image is a curve, and covers no area.
    """

    lines: tuple[Array, ...]
    polygons: tuple[Any, ...]
    is_flat: bool = False


def cut_along_folds(image: PlanarImage, polygon: Any) -> Parts:
    """Return a region's parts between folds.

    Raises:
        UnsupportedError: If the folds cannot be traced.
    """
    west, south, east, north = polygon.bounds
    wide = np.array([east - west, north - south]) * 1e-3 + REDUCTION
    window = np.array([[west - wide[0], south - wide[1]], [east + wide[0], north + wide[1]]])
    sides: list[Any] = [np.linspace(low, high, _GRID) for low, high in window.T.tolist()]
    grid: Array = np.stack(cast(Any, np).meshgrid(*sides), axis=-1).reshape(-1, 2)
    values = image.determinant(grid)
    size = float(image.first_bound[0] * image.first_bound[1])
    if float(np.abs(values).max()) <= 1e3 * REDUCTION * size:
        return Parts((), (polygon,), is_flat=True)
    try:
        folds = trace(FoldFunction.of(image), window, _FOLD * max(1.0, float(wide.max()))).lines
    except UnsupportedError as error:
        if values.min() < 0.0 < values.max():
            raise UnsupportedError(
                "the folds of this map cannot be traced: its Jacobian is zero along a curve and to both sides of it; "
                "take a smaller region"
            ) from error
        folds = ()  # it touches zero, and keeps its sign: nothing folds
    noded = sh.union_all([polygon.boundary, *(shapely.LineString(fold) for fold in folds)])
    faces = shapely.get_parts(shapely.polygonize(shapely.get_parts(noded)))
    shapely.prepare(polygon)
    own = [face for face in faces.tolist() if polygon.contains(face.representative_point())]
    lines = [line for line in shapely.get_parts(noded).tolist() if _lies_in(line, polygon)]
    return Parts(tuple(shapely.get_coordinates(line) for line in lines), tuple(own))


def _lies_in(line: Any, polygon: Any) -> bool:
    """Return whether a line that crosses no contour is part of one, or inside."""
    return bool(polygon.intersects(line.interpolate(0.5, normalized=True).buffer(REDUCTION)))


def covered(image: PlanarImage, parts: Parts, chord: float, finer: int = 1) -> tuple[Any, float]:
    """Return the area that a region's image covers, as a `shapely` geometry [m], and the undecided area [m^2].

    Args:
        image: The map.
        parts: The region, cut along its folds.
        chord: The largest distance of the image of an edge from its polyline [m].
        finer: The factor by which the number of chords is then increased.
    """
    if parts.is_flat:
        return shapely.Polygon(), 0.0
    curves = [shapely.LineString(image.image(subdivided(image, line, chord, finer))) for line in parts.lines]
    faces = np.array(shapely.get_parts(shapely.polygonize(shapely.get_parts(sh.union_all(curves)))))
    if not len(faces):
        return shapely.Polygon(), 0.0
    areas: Any = sh.area(faces)
    small = areas <= _LEAST_FACE * float(areas.sum())
    left_out = float(areas[small].sum())
    faces = faces[~small]
    places = shapely.get_coordinates(shapely.point_on_surface(faces))
    found = np.zeros(len(faces), dtype=np.bool_)
    for polygon in parts.polygons:
        rings = [shapely.get_coordinates(ring) for ring in (polygon.exterior, *polygon.interiors)]
        turned = [ring if _is_left(ring) == (not place) else ring[::-1] for place, ring in enumerate(rings)]
        number = np.zeros(len(faces), dtype=np.int64)
        for ring in turned:
            number += _winding(image.image(subdivided(image, ring, chord, finer)), places)
        found |= number != 0
    return sh.union_all(faces[found]), left_out


def subdivided(image: PlanarImage, ring: Array, chord: float, finer: int = 1) -> Array:
    """Return a polyline with points added until the image's chords are within `chord`: `h^2 |p''| / 8`."""
    pieces: list[Any] = []
    steps = np.abs(np.diff(ring, axis=0))
    bends = np.einsum("ni,ij,nj->n", steps, image.second_bound, steps)
    counts = finer * np.maximum(1, np.ceil(np.sqrt(bends / (8.0 * chord)))).astype(int)
    for (start, end), count in zip(itertools.pairwise(ring), counts.tolist(), strict=True):
        pieces.append(start + np.arange(count)[:, None] / count * (end - start))
    return np.vstack((*pieces, ring[-1:]))


def _is_left(ring: Array) -> bool:
    x, y = (ring - ring[0]).T
    return math.fsum(x[:-1] * y[1:] - x[1:] * y[:-1]) > 0.0


def _winding(ring: Array, places: Array) -> Ints:
    """Return how often a closed polyline winds about each place (N,): crossings of the ray to the right of it.

    Edges are sorted by their lower ends, so that each place examines only the edges that may reach its height.
    """
    a, b = ring[:-1], ring[1:]
    low = np.minimum(a[:, 1], b[:, 1])
    order = np.argsort(low)
    a, b, low = a[order], b[order], low[order]
    tallest = float(np.abs(a[:, 1] - b[:, 1]).max())
    first, last = np.searchsorted(low, places[:, 1] - tallest), np.searchsorted(low, places[:, 1], side="right")
    number = np.zeros(len(places), dtype=np.int64)
    for place, (x, y) in enumerate(places.tolist()):
        p, q = a[first[place] : last[place]], b[first[place] : last[place]]
        up, down = (p[:, 1] <= y) & (y < q[:, 1]), (q[:, 1] <= y) & (y < p[:, 1])
        side = (q[:, 0] - p[:, 0]) * (y - p[:, 1]) - (x - p[:, 0]) * (q[:, 1] - p[:, 1])
        number[place] = np.count_nonzero(up & (side > 0.0)) - np.count_nonzero(down & (side < 0.0))
    return number
