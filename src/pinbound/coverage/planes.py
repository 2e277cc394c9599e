"""The choice of the plane that cuts a part: the one that leaves the hulls nearest to the surface.

These planes are tried: planes perpendicular to the axes in which the surface spreads and to those of the link; planes
of its own large faces, at which solids meet; planes along concave edges, where convex bodies meet; and planes through
the bottom of the pocket that sticks out furthest. If the surface consists of several closed ones, they may also be
divided without a cut. All are compared by the volume of the two hulls, and the best ones by the distance of the hulls'
surfaces from the mesh.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pinbound.coverage.cuts import on_plane
from pinbound.coverage.near import Near, lay_points
from pinbound.coverage.parts import directions
from pinbound.coverage.solids import Group

__all__ = ["best_cut"]

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]
Plane = tuple[Array, float]

_LEVELS = 7  # planes perpendicular to an axis, and one more through the point that sticks out furthest
_FACES = 12  # planes of its own faces, those of the largest area
_TURNS = 4  # planes through the bottom of a pocket, parallel to the way out of it
_LOOKED = 60  # directions of the vertices that are used for a part's hull
_HOLLOW = 5  # planes along concave edges that are compared by distances, whatever their volumes
_WHOLE = 1.5  # how much better a plane must be than a division of whole closed surfaces, because it cuts more of them
_COMPARED = 8  # planes that are compared by distances
_ALIKE = 0.999  # cosine between axes of which only one is tried
_APART = 1e-3  # of the extent: planes nearer to each other count as one, and planes nearer to the border are not tried
_CELLS = 40.0  # of the extent: while planes are compared, the corners in one cell of this size are one
_DENSE = 16.0  # of a hull's extent: the distance between the points at which distances are measured


def best_cut(group: Group, place: Array, thick: float, near: Near) -> tuple[Group, Group] | None:
    """Return a surface in two, by the plane or division that leaves the best hulls; None if there is none.

    Both sides have triangles. Heights that are only the rounding of a file count as zero.

    Args:
        group: The surface.
        place: (3,) [m], the point at which the part sticks out furthest.
        thick: [m], the weight of a hull's area, because flat hulls have no volume.
        near: The mesh.
    """
    sketch = _Sketch(group.triangles)
    planes = _planes(group, sketch.points, place, near)
    sides: list[tuple[Array, Array]] = [sketch.sides(*plane) for plane in planes]
    costs = [sum(_volume(one, thick) for one in pair) for pair in sides]
    order: list[int] = np.argsort(costs, kind="stable")[:_COMPARED].tolist()
    order += [row for row in range(len(planes) - _TURNS - _HOLLOW, len(planes)) if row >= 0 and row not in order]
    found: list[tuple[float, int, tuple[Array, float] | Flags]] = []
    for row in order:
        found.append((sum(_air(one, planes[row], near) for one in sides[row]), row, planes[row]))
    for chosen in _apart(group, thick):
        pair = group.of_solids(chosen)
        air = sum(_air(np.unique(one.triangles.reshape(-1, 3), axis=0), None, near) for one in pair)
        found.append((air / _WHOLE, -1 - len(found), chosen))
    for _, _, way in sorted(found, key=lambda one: one[:2]):
        below, above = group.cut(*way) if isinstance(way, tuple) else group.of_solids(way)
        if len(below) and len(above):  # a plane along a flat part has all of it on one side, up to rounding
            return below, above
    return None


def _apart(group: Group, thick: float) -> list[Flags]:
    """Return the best divisions of a group's closed surfaces between two: which triangles go with the first."""
    numbers, which = np.unique(group.solids, return_inverse=True)
    if len(numbers) < 2:
        return []
    points = [np.unique(group.triangles[which == one].reshape(-1, 3), axis=0) for one in range(len(numbers))]
    middles = np.array([0.5 * (one.min(axis=0) + one.max(axis=0)) for one in points])
    ways = {tuple(row.tolist()) for row in np.eye(len(numbers), dtype=np.bool_)}
    axes: Any = np.vstack((np.eye(3), np.linalg.svd(middles - middles.mean(axis=0))[2]))
    for axis in axes:
        order = np.argsort(middles @ axis)
        for count in range(1, len(numbers)):
            way = np.zeros(len(numbers), dtype=np.bool_)
            way[order[:count]] = True
            ways.add(tuple(way.tolist()))
    found: list[tuple[float, Flags]] = []
    for way in sorted(ways):
        pair = [
            np.concatenate([one for one, mine in zip(points, way, strict=True) if mine is side])
            for side in (True, False)
        ]
        found.append((sum(_volume(one, thick) for one in pair), np.array(way)))
    return [way[which] for _, way in sorted(found, key=lambda one: one[0])[:_COMPARED]]


def _planes(group: Group, points: Array, place: Array, near: Near) -> list[Plane]:
    axes: Any = np.linalg.svd(points - points.mean(axis=0), full_matrices=True)[2]
    rows: list[Array] = [np.eye(3)[row] for row in range(3)]
    rows += [axis for axis in axes if np.max(np.abs(axis)) < _ALIKE]
    tried = [
        (axis, float(at))
        for axis in rows
        for low, high in ((float((points @ axis).min()), float((points @ axis).max())),)
        for at in (float(place @ axis), *np.linspace(low, high, _LEVELS + 2)[1:-1])
    ]
    tried += _of_faces(group.triangles)
    bottom = near.nearest(place[None])[0]
    out = place - bottom
    length = float(np.linalg.norm(out))
    if length > 0.0:
        first = np.linalg.svd(out[None] / length)[2][1:]
        angles = np.pi * np.arange(_TURNS) / _TURNS
        tried += [(axis, float(bottom @ axis)) for axis in np.column_stack((np.cos(angles), np.sin(angles))) @ first]
    tried += group.planes()
    found: list[Plane] = []
    for axis, at in tried:
        height = points @ axis - at
        wide = _APART * float(np.ptp(height))
        if height.min() < -wide and height.max() > wide:
            found.append((axis, at))
    return found


def _of_faces(group: Array) -> list[Plane]:
    """Return the planes in which most of the surface lies."""
    normals: Any = np.cross(group[:, 1] - group[:, 0], group[:, 2] - group[:, 0])
    size: Array = np.linalg.norm(normals, axis=1)
    some = size > 0.0
    units: Array
    units, areas = normals[some] / size[some, None], size[some]
    units = units * np.where(units[np.arange(len(units)), np.argmax(np.abs(units), axis=1)] < 0.0, -1.0, 1.0)[:, None]
    at: Array = np.einsum("ni,ni->n", units, group[some, 0])
    extent: float = max(float(np.ptp(group.reshape(-1, 3), axis=0).max()), 1e-300)
    keys: Array = np.zeros((len(units), 4))
    keys[:, :3], keys[:, 3] = np.round(units * 200.0), np.round(at / (_APART * extent))
    first: Ints
    kind: Ints
    first, kind = np.unique(keys, axis=0, return_index=True, return_inverse=True)[1:]
    total = np.bincount(kind.ravel(), weights=areas)
    return [(units[first[row]], float(at[first[row]])) for row in np.argsort(-total)[:_FACES]]


class _Sketch:
    """The corners and sides of a surface, with the corners in one small cell merged, to compare planes."""

    def __init__(self, group: Array) -> None:
        flat = group.reshape(-1, 3)
        low = flat.min(axis=0)
        cell = max(float(np.ptp(flat, axis=0).max()) / _CELLS, 1e-300)
        x, y, z = ((flat - low) / cell).astype(np.int64).T
        few = int(_CELLS) + 2
        key, index = np.unique((x * few + y) * few + z, return_inverse=True)
        if len(key) > len(flat) // 6:
            _, index = np.unique(flat, axis=0, return_inverse=True)
        index = index.ravel()
        count = int(index.max()) + 1
        # of the corners of a cell, take the one furthest from the middle, because it makes the hull
        order = np.argsort(np.linalg.norm(flat - flat.mean(axis=0), axis=1))
        chosen = np.zeros(count, dtype=np.int64)
        chosen[index[order]] = order
        self.points = flat[chosen]
        corners = index.reshape(-1, 3)
        ends: Ints = np.sort(np.concatenate((corners[:, :2], corners[:, 1:], corners[:, ::2])), axis=1)
        pairs = np.unique(ends[:, 0] * count + ends[:, 1])
        self.start, self.end = pairs // count, pairs % count

    def sides(self, axis: Array, at: float) -> tuple[Array, Array]:
        """Return the points below and above a plane, with those of its section."""
        height = on_plane(self.points @ axis - at)
        p, q = height[self.start], height[self.end]
        rows = np.flatnonzero(p * q < 0.0)
        share = (p[rows] / (p[rows] - q[rows]))[:, None]
        a, b = self.points[self.start[rows]], self.points[self.end[rows]]
        section = a + share * (b - a)
        found: list[Array] = []
        for sign in (-1.0, 1.0):
            own = sign * height > 0.0
            # A point on the plane belongs to the sides of the points that it is connected to.
            beside = np.concatenate((self.end[own[self.start]], self.start[own[self.end]]))
            own[beside[height[beside] == 0.0]] = True
            found.append(np.concatenate((self.points[own], section)))
        return found[0], found[1]


def _hull(points: Array) -> Any:
    from scipy.spatial import ConvexHull, QhullError

    chosen = points[np.unique(np.argmax(points @ directions(_LOOKED).T, axis=0))]
    try:
        return ConvexHull(chosen)
    except QhullError:  # flat
        return None


def _volume(points: Array, thick: float) -> float:
    """Return about the volume of a hull [m^3], plus its area times `thick`, so that flat ones count, too."""
    if not len(points):
        return 0.0
    hull = _hull(points)
    if hull is None:
        return thick * float(np.sort(np.ptp(points, axis=0))[1:].prod())
    return float(hull.volume + thick * hull.area)


def _air(points: Array, plane: Plane | None, near: Near) -> float:
    """Return about the integral of the squared distance from the mesh over a hull [m^4], without the section."""
    hull = _hull(points) if len(points) else None
    if hull is None:
        return 0.0
    corners = hull.points[hull.simplices]
    extent = float(np.linalg.norm(np.ptp(points, axis=0)))
    if plane is not None:
        flush = np.all(np.abs(corners @ plane[0] - plane[1]) <= _APART * extent, axis=1)
        if np.all(flush):
            return 0.0
        corners = corners[~flush]
    places, owner = lay_points(corners, extent / _DENSE)
    normals: Any = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    weight = 0.5 * np.linalg.norm(normals, axis=1) / np.bincount(owner, minlength=len(corners))
    return math.fsum((weight[owner] * near.away(places) ** 2).tolist())
