"""Convex polygons: half-spaces, an inscribed polygon, and a decomposition into several."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
import shapely

from pinbound.checks import random_numbers
from pinbound.tolerances import VERTEX
from pinbound.typing import Array

__all__ = ["convex_parts", "inner", "inscribed_polygon", "is_convex", "polygon_halfspaces"]

gis = cast(Any, shapely)  # its stubs know only part of what its functions take

_SEEDS = 8
_ROUNDS = 12


def is_convex(polygon: Any) -> bool:
    """Return whether a polygon without holes turns left at every vertex, up to `tolerances.VERTEX`.

    Example:
        >>> is_convex(shapely.box(0, 0, 1, 1)), is_convex(shapely.Polygon([(0, 0), (2, 0), (1, 0.1), (0, 2)]))
        (True, False)
    """
    if len(polygon.interiors):
        return False
    steps = np.diff(gis.get_coordinates(gis.orient_polygons(polygon).exterior), axis=0)
    after = np.roll(steps, -1, axis=0)
    turns = steps[:, 0] * after[:, 1] - steps[:, 1] * after[:, 0]
    return bool(np.all(turns >= -VERTEX * np.linalg.norm(steps, axis=1)))


def polygon_halfspaces(polygon: Any) -> tuple[Array, Array]:
    """Return A (k, 2), rows of unit length, and b (k,) of a convex polygon.

    Example:
        >>> A, b = polygon_halfspaces(shapely.box(0, 0, 2, 1))
        >>> sorted((b + 0.0).tolist())
        [0.0, 0.0, 1.0, 2.0]
    """
    points = gis.get_coordinates(gis.orient_polygons(polygon).exterior)
    steps = np.diff(points, axis=0)
    normals = steps[:, ::-1] * np.array([1.0, -1.0])
    normals = normals / np.linalg.norm(normals, axis=1)[:, None]
    return normals, np.einsum("na,na->n", normals, points[:-1])


def inner(polygon: Any, rim: float, accuracy: float) -> Any:
    """Return a polygon of few vertices inside another, at most `rim + accuracy` [rad] deep; it may have several parts.

    It is shrunk by half the rim, then simplified by less than the other half. So it never leaves the original.
    """
    return polygon.buffer(-(rim / 2.0 + accuracy), join_style="mitre").simplify(0.49 * rim)


def convex_parts(polygon: Any) -> list[Any]:
    """Return convex polygons whose union is a polygon: a constrained Delaunay triangulation, merged (Hertel-Mehlhorn).

    There are at most four times as many as the smallest possible number.

    Example:
        >>> corner = shapely.Polygon([(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)])
        >>> parts = convex_parts(corner)
        >>> len(parts), round(sum(part.area for part in parts), 12)
        (2, 3.0)
    """
    found: list[Any] = []
    for whole in gis.get_parts(polygon):
        triangles = list(gis.get_parts(gis.constrained_delaunay_triangles(whole)))
        found += _merge([gis.get_coordinates(gis.orient_polygons(t).exterior)[:-1] for t in triangles])
    return [gis.Polygon(ring) for ring in found]


def _merge(rings: list[Array]) -> list[Array]:
    """Remove diagonals between two parts as long as the joined part is convex."""
    parts: dict[int, list[tuple[float, float]]] = {
        number: [(float(x), float(y)) for x, y in ring] for number, ring in enumerate(rings)
    }
    where: dict[tuple[Any, Any], int] = {}
    for number, ring in parts.items():
        for a, b in zip(ring, ring[1:] + ring[:1], strict=True):
            where[a, b] = number
    diagonals = [(a, b) for a, b in where if (b, a) in where and a < b]
    for a, b in sorted(diagonals, key=lambda ends: -np.hypot(ends[0][0] - ends[1][0], ends[0][1] - ends[1][1])):
        left, right = where[a, b], where[b, a]
        if left == right:
            continue
        first, second = parts[left], parts[right]
        i, j = first.index(b), second.index(a)
        joined = first[i:] + first[:i]  # from b around to a
        joined += (second[j:] + second[:j])[1:-1]  # from a to b, without both
        if _turns_left(joined):
            parts[left] = joined
            del parts[right]
            for c, d in zip(joined, joined[1:] + joined[:1], strict=True):
                where[c, d] = left
    return [np.array(ring) for ring in parts.values()]


def _turns_left(ring: list[tuple[float, float]]) -> bool:
    points = np.array(ring)
    steps = np.roll(points, -1, axis=0) - points
    after = np.roll(steps, -1, axis=0)
    return bool(np.all(steps[:, 0] * after[:, 1] - steps[:, 1] * after[:, 0] >= 0.0))


def inscribed_polygon(polygon: Any, seed: int = 0) -> Any:
    """Return a large convex polygon inside a polygon: the best of several grown ellipses (IRIS, in the plane).

    From a centre and an ellipse, pieces of the contour are cut off by tangents of the growing ellipse, the nearest
    first. The second moments of the remaining polygon give the next ellipse. The result need not be the largest of all.
    """
    whole = max(gis.get_parts(polygon), key=lambda part: part.area)
    triangles = np.asarray(gis.get_parts(gis.constrained_delaunay_triangles(whole)))
    areas = gis.area(triangles)
    chosen = random_numbers(seed).choice(len(areas), min(_SEEDS, len(areas)), replace=False, p=areas / areas.sum())
    centres = [gis.get_coordinates(gis.centroid(triangles[i]))[0] for i in chosen]
    pole = gis.maximum_inscribed_circle(whole, 1e-3 * float(np.sqrt(whole.area)))
    centres.append(gis.get_coordinates(pole)[0])
    rings = [gis.get_coordinates(ring) for ring in (whole.exterior, *whole.interiors)]
    segments = np.concatenate([np.stack((ring[:-1], ring[1:]), axis=1) for ring in rings])
    best = gis.Polygon()
    for start in centres:
        centre, shape = start, np.eye(2)
        for _ in range(_ROUNDS):
            found = _cut(whole, segments, centre, shape)
            if found.area <= best.area * (1.0 + 1e-4):
                best = found if found.area > best.area else best
                break
            best = found
            centre, shape = _moments(found)
    return best


def _cut(whole: Any, segments: Array, centre: Array, shape: Array) -> Any:
    """Return the convex polygon that remains when a tangent of the ellipse cuts off every contour segment."""
    inverse = np.linalg.inv(shape)
    pieces = (segments - centre) @ inverse.T
    normals: list[Array] = []
    bounds: list[float] = []
    while len(pieces):
        step = pieces[:, 1] - pieces[:, 0]
        square = np.einsum("na,na->n", step, step)
        with np.errstate(invalid="ignore", divide="ignore"):
            t = np.clip(np.nan_to_num(-np.einsum("na,na->n", pieces[:, 0], step) / square), 0.0, 1.0)
        near = pieces[:, 0] + t[:, None] * step
        size = np.linalg.norm(near, axis=1)
        first = int(np.argmin(size))
        if not size[first] > 0.0:
            return gis.Polygon()
        normal, bound = near[first] / size[first], float(size[first])
        normals.append(normal)
        bounds.append(bound)
        depth = pieces @ normal - bound
        pieces, depth = pieces[np.min(depth, axis=1) < -VERTEX], depth[np.min(depth, axis=1) < -VERTEX]
        crossing = np.flatnonzero(np.max(depth, axis=1) > 0.0)
        for i in crossing.tolist():
            a, b = depth[i]
            place = pieces[i, 0] + (a / (a - b)) * (pieces[i, 1] - pieces[i, 0])
            pieces[i, 0 if a > 0.0 else 1] = place
    found = gis.envelope(whole)
    for normal, bound in zip(normals, bounds, strict=True):
        found = found.intersection(_half(normal @ inverse, bound + float(normal @ inverse @ centre), whole))
    return found if found.geom_type == "Polygon" else gis.Polygon()


def _half(normal: Array, bound: float, whole: Any) -> Any:
    """Return a box that contains the part with `normal @ x <= bound` of a polygon's surroundings."""
    x0, y0, x1, y1 = whole.bounds
    reach = 4.0 * float(np.hypot(x1 - x0, y1 - y0))
    middle = np.array([x0 + x1, y0 + y1]) / 2.0
    unit = normal / np.linalg.norm(normal)
    along = np.array([-unit[1], unit[0]])
    foot = middle + unit * (bound / float(np.linalg.norm(normal)) - float(unit @ middle))
    corners = [foot + reach * along, foot - reach * along, foot - reach * (along + unit), foot + reach * (along - unit)]
    return gis.Polygon(corners)


def _moments(polygon: Any) -> tuple[Array, Array]:
    """Return the centroid of a convex polygon and the square root of its second moments (2, 2)."""
    points = gis.get_coordinates(polygon.exterior)
    centre = np.array([polygon.centroid.x, polygon.centroid.y])
    a, b = points[:-1] - centre, points[1:] - centre
    weight = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    total = np.einsum("n,ni,nj->ij", weight, a, a) + np.einsum("n,ni,nj->ij", weight, b, b)
    total += 0.5 * (np.einsum("n,ni,nj->ij", weight, a, b) + np.einsum("n,ni,nj->ij", weight, b, a))
    values, vectors = np.linalg.eigh(total / np.sum(weight))
    return centre, vectors @ np.diag(np.sqrt(np.abs(values))) @ vectors.T
