"""Faces of the plane between limits and contact curves: connected components, their edges named.

All lines and traced curves are put together, cut where they cross, and the faces between them found (GEOS). No curve
runs through the inside of a face, so all of it is free or none is, and one exact evaluation inside decides. Free faces
are the connected components. Each piece of a face's contour is named after the curve it came from; where two names
meet, the corner is solved from the two exact functions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
import shapely
from numpy.typing import NDArray

from pinbound.exceptions import UnsupportedError
from pinbound.region.halfplanes import HalfPlane
from pinbound.region.lines import Line, segment_owners, vertex_owners
from pinbound.region.outlines import outline
from pinbound.region.plane import Plane
from pinbound.tolerances import VERTEX

__all__ = ["Arrangement", "Corner", "Edge", "arrange", "arranged_loops"]

Array = NDArray[np.float64]
gis = cast(Any, shapely)  # its stubs know only part of what its functions take
Ints = NDArray[np.int64]

_BEYOND = 0.02  # curves are traced this much of the window beyond it, so that they cross its border properly
_NEWTON = 30


@dataclass(frozen=True)
class Edge:
    """One edge of a region: which boundary or joint limit it is, and where it runs.

    Attributes:
        name: Boundary name, or joint and end, e.g. ``"q2 upper"``.
        source: Boundary name, or joint name.
        is_contact: True for a boundary, False for a joint limit.
        start: (2,) [rad].
        end: (2,) [rad]; the region lies to the left of start -> end. Equal to start if the edge is a closed curve.
        points: (k, 2) polyline from start to end: two points if it is straight.
    """

    name: str
    source: str
    is_contact: bool
    start: Array
    end: Array
    points: Array


@dataclass(frozen=True)
class Corner:
    """Where two edges of a region meet.

    Attributes:
        point: (2,) [rad].
        before: Name of the edge that ends here.
        after: Name of the edge that starts here.
        polished: Whether the point solves both contact equations to `tolerances.VERTEX`; False only where the two
            touch so flatly that it is known no better than the region's accuracy.
    """

    point: Array
    before: str
    after: str
    polished: bool


@dataclass(frozen=True)
class Arrangement:
    """The free faces of a plane.

    Attributes:
        plane: The plane.
        lines: Every line and curve.
        faces: Free faces as `shapely.Polygon`, counter-clockwise; the start's first, then the largest first.
        chord_error: [rad]; no point of a contact curve is further than this from its polyline.
        unresolved: (u, 2) centres of tiny boxes in which a contact curve may cross itself.
    """

    plane: Plane
    lines: tuple[Line, ...]
    faces: tuple[Any, ...]
    chord_error: float
    unresolved: Array


def arrange(plane: Plane, accuracy: float) -> Arrangement:
    """Return the free faces of a plane, contact curves traced to an accuracy [rad].

    Raises:
        UnsupportedError: If a contact curve is degenerate (`contours.trace`), or the start is too near to contact.
    """
    low, high = plane.window
    wide = np.array([low - _BEYOND * (high - low), high + _BEYOND * (high - low)])
    lines = [_straight(wide, limit, limit) for limit in (*plane.box, *plane.limits)]
    for strip in plane.strips:
        corners = wide[[0, 0, 1, 1], 0][:, None] * [1, 0] + wide[[0, 1, 0, 1], 1][:, None] * [0, 1]
        values = corners @ strip.normal
        for bound in strip.lines(float(values.min()), float(values.max())):
            lines.append(_straight(wide, HalfPlane(strip.name, strip.name, strip.normal, bound, True)))
    error, unresolved = 0.0, [np.empty((0, 2))]
    for curve in plane.curves:
        found = outline(plane, curve, wide, accuracy)
        error = max(error, found.chord_error)
        unresolved.append(found.unresolved)
        lines += found.lines
    kept = tuple(line for line in lines if line is not None)
    faces = gis.polygonize(gis.get_parts(gis.union_all([gis.linestrings(x.points) for x in kept])))
    polygons = np.asarray(gis.get_parts(faces))
    inside = gis.get_coordinates(gis.point_on_surface(polygons))
    free = plane.free(inside)
    thick = gis.area(polygons) > accuracy * gis.length(polygons) / 2.0
    away = np.where(free, gis.distance(polygons, gis.Point(plane.start)), np.inf)
    home = int(np.argmin(away))
    if away[home] > accuracy:
        raise UnsupportedError(
            f"the start point {plane.start.tolist()} is free, but nearer to contact than the accuracy of {accuracy} "
            "rad can tell; give a smaller accuracy, or start elsewhere"
        )
    rest = [i for i in np.argsort(-gis.area(polygons)).tolist() if free[i] and thick[i] and i != home]
    ordered = gis.orient_polygons(polygons[[home, *rest]])
    return Arrangement(plane, kept, tuple(ordered), error, np.concatenate(unresolved))


def _straight(wide: Array, half: HalfPlane, limit: HalfPlane | None = None) -> Line | None:
    """Return the part of `normal @ x = bound` in the wide window, or None if it misses it."""
    normal = half.normal
    foot = normal * (half.bound / float(normal @ normal))
    direction = np.array([-normal[1], normal[0]])
    span = [-np.inf, np.inf]
    for axis in (0, 1):
        if direction[axis] == 0.0:
            if not wide[0, axis] <= foot[axis] <= wide[1, axis]:
                return None
            continue
        ends = sorted((float(wide[side, axis]) - foot[axis]) / direction[axis] for side in (0, 1))
        span = [max(span[0], ends[0]), min(span[1], ends[1])]
    if not span[0] < span[1]:
        return None
    points = foot + np.array(span)[:, None] * direction
    return Line(half.name, half.source, half.is_contact, points, half)


def arranged_loops(
    arrangement: Arrangement, polygon: Any, accuracy: float
) -> tuple[tuple[tuple[Edge, ...], ...], tuple[Corner, ...]]:
    """Return a face's loops of named edges, the exterior first, and its corners."""
    lines = arrangement.lines
    keys, owners = vertex_owners(lines)
    loops: list[tuple[Edge, ...]] = []
    corners: list[Corner] = []
    for ring in (polygon.exterior, *polygon.interiors):
        coordinates = gis.get_coordinates(ring)
        owner = segment_owners(lines, keys, owners, coordinates)
        edges, met = _edges(lines, coordinates[:-1], owner, accuracy)
        loops.append(edges)
        corners += met
    return tuple(loops), tuple(corners)


def _edges(lines: Sequence[Line], ring: Array, owner: Ints, accuracy: float) -> tuple[tuple[Edge, ...], list[Corner]]:
    """Cut a ring (open, counter-clockwise) into runs of one curve, of however many pieces, corners polished."""
    names = [line.name if not isinstance(line.function, HalfPlane) else "" for line in lines]
    curve = np.array([names.index(name) if name else place for place, name in enumerate(names)])[owner]
    breaks = np.flatnonzero(curve != np.roll(curve, 1))
    if not len(breaks):
        line = lines[int(owner[0])]
        closed = np.concatenate((ring, ring[:1]))
        return (Edge(line.name, line.source, line.is_contact, ring[0], ring[0], closed),), []
    corners: list[Corner] = []
    moved: list[float] = []
    for place in breaks.tolist():
        before, after = lines[int(owner[place - 1])], lines[int(owner[place])]
        point, polished = _polish(before, after, ring[place], accuracy)
        corners.append(Corner(point, before.name, after.name, polished))
        moved.append(float(np.linalg.norm(point - ring[place])))
    edges: list[Edge] = []
    for i, place in enumerate(breaks.tolist()):
        j = (i + 1) % len(breaks)
        stop = int(breaks[j]) if j > i else int(breaks[j]) + len(ring)
        line = lines[int(owner[place])]
        inner = ring[np.arange(place + 1, stop) % len(ring)]
        start, end = corners[i].point, corners[j].point
        straight = isinstance(line.function, HalfPlane)
        far = np.linalg.norm(inner - start, axis=1) > 3.0 * moved[i]
        far &= np.linalg.norm(inner - end, axis=1) > 3.0 * moved[j]
        inner = inner[far & (not straight)]
        points = np.concatenate((start[None], inner, end[None]))
        edges.append(Edge(line.name, line.source, line.is_contact, start, end, points))
    return tuple(edges), corners


def _polish(a: Line, b: Line, x: Array, accuracy: float) -> tuple[Array, bool]:
    """Solve both functions from a crossing of their polylines, by Newton; keep the crossing where that leaves it."""
    point = x
    limit = np.sqrt(accuracy)
    for _ in range(_NEWTON):
        (va, ga), (vb, gb) = a.value_gradient(point), b.value_gradient(point)
        determinant = float(ga[0] * gb[1] - ga[1] * gb[0])
        if abs(determinant) <= 1e-9 * float(np.linalg.norm(ga) * np.linalg.norm(gb)):
            return x, False
        step = np.array([gb[1] * va - ga[1] * vb, ga[0] * vb - gb[0] * va]) / determinant
        point = point - step
        if not np.linalg.norm(point - x) <= limit:
            return x, False
        if np.linalg.norm(step) <= VERTEX:
            return point, True
    return x, False
