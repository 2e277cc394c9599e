"""The outer surface of a link's marks, seen along an axis, and the distance of each of its points from the bodies.

A mark is convex: half-spaces `n_f . x <= b_f`. The line through (u, v) along axis k is in the mark between

    bottom = max over n_k < 0 of (b - n_u u - n_v v) / n_k,    top = min over n_k > 0 of the same,

so the outer surface of all marks, seen from the plus side, is the largest top. The distance of such a point from the
bodies is what the marks add there. It is approximate, and never too small. It is not a bound for the points in between.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, cast

import numpy as np

from pinbound.annotations import Mark
from pinbound.coverage.bodies import Body
from pinbound.coverage.near import Near
from pinbound.meshes import Mesh
from pinbound.typing import Array, Flags, Ints
from pinbound.values import Value

__all__ = ["PIXELS", "Seen", "body_triangles", "half_spaces", "seen", "views_of"]

View = tuple[int, int, int]

PIXELS = 200
"""Size of a view along its longest side."""
_SIDEWAYS = 1e-12  # of a unit normal along the line of sight: less counts as zero
_THIN = 2e-3  # of a mark's extent: marks without volume are drawn with this thickness
_ROUND = 48  # corners of a circle that replaces a round body, or the ball of a mark
_CLOSE, _AGAIN, _EXACT = 1e-5, 12, 100  # metres, triangles, points: where distances are computed again
_MANY = 64  # vertices of a mark; with more, its faces are moved by its radius, and its edges stay sharp


@dataclass(frozen=True, eq=False)
class Seen(Value):
    """A view of the outer surface, as a picture of rows (v) and columns (u).

    Attributes:
        view: The axes u, v and k: to the right, up, and the viewing direction.
        low: (2,) [m], lower corner of the picture.
        high: (2,) [m], upper corner.
        away: (2, rows, columns) [m], distances from the bodies seen from the plus and the minus side; NaN where there
            is no mark.
        light: (2, rows, columns), from 0 to 1: how directly the surface faces the viewer.
        mark: (2, rows, columns), the index of the visible mark; -1 where there is none.
    """

    view: View
    low: Array
    high: Array
    away: Array
    light: Array
    mark: Ints


def views_of(low: Array, high: Array) -> tuple[View, View, View]:
    """Return three views (u, v, k) of a box, the longest side to the right, in right-handed order where that allows.

    Example:
        >>> views_of(np.zeros(3), np.array([1.0, 2.0, 5.0]))
        ((2, 1, 0), (2, 0, 1), (1, 0, 2))
    """
    a, b, c = np.argsort(-(high - low), kind="stable").tolist()
    return (a, b, c), (a, c, b), (b, c, a)


def half_spaces(mark: Mark) -> tuple[Array, Array]:
    """Return unit normals n (F, 3) and b (F,) [m] of a bounded mark: it is the set of all x with `n . x <= b`.

    Balls are drawn by polyhedra with corners on them.
    """
    corners, radius = np.asarray(mark.shape.vertices, dtype=np.float64), float(mark.shape.radius)
    extent = float(np.linalg.norm(corners.max(axis=0) - corners.min(axis=0))) + radius
    flat = np.linalg.matrix_rank(corners - corners.mean(axis=0), tol=_THIN * extent) < 3
    if flat or (radius and len(corners) <= _MANY):
        ball = max(radius, _THIN * extent) if flat else radius
        corners, radius = (corners[:, None] + ball * _directions()).reshape(-1, 3), 0.0
    planes = np.unique(_hull(corners).equations.round(12), axis=0)  # triangles of one face have one plane
    return planes[:, :3], radius - planes[:, 3]


def _directions() -> Array:
    """Return directions on the whole sphere (k, 3): rings of latitude."""
    heights = np.linspace(-np.pi / 2, np.pi / 2, _ROUND // 4 + 1)
    turns = np.linspace(0.0, 2 * np.pi, _ROUND // 2, endpoint=False)
    found = [
        (np.cos(up) * np.cos(turn), np.cos(up) * np.sin(turn), np.sin(up)) for up, turn in product(heights[1:-1], turns)
    ]
    return np.array([*found, (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)])


def body_triangles(bodies: Sequence[Body], meshes: Sequence[Mesh | None]) -> list[Array]:
    """Return the triangles (m, 3, 3) [m] of each body in the link's frame; none for unknown shapes."""
    return [
        _of_shape(body) if mesh is None else mesh.vertices[mesh.triangles]
        for body, mesh in zip(bodies, meshes, strict=True)
    ]


def _of_shape(body: Body) -> Array:
    size = body.size
    if body.shape == "box":
        corners = np.array(list(product((-0.5, 0.5), repeat=3))) * size
    elif body.shape == "sphere":
        corners = size[0] * _directions()
    elif body.shape == "capsule":
        up = np.array([0.0, 0.0, size[1] / 2])
        corners = np.concatenate((size[0] * _directions() + up, size[0] * _directions() - up))
    elif body.shape == "cylinder":
        turns = np.linspace(0.0, 2 * np.pi, _ROUND, endpoint=False)
        ring = np.column_stack((size[0] * np.cos(turns), size[0] * np.sin(turns), np.full(_ROUND, size[1] / 2)))
        corners = np.concatenate((ring, ring * (1.0, 1.0, -1.0)))
    else:
        return np.empty((0, 3, 3))
    placed = corners @ body.rotation.T + body.translation
    return placed[_hull(placed).simplices]


def _hull(corners: Array) -> Any:
    from scipy import spatial

    library = cast(Any, spatial)
    try:
        return library.ConvexHull(corners)
    except library.QhullError:  # nearly flat
        return library.ConvexHull(corners, qhull_options="QJ Pp")


def seen(
    marks: Sequence[Mark], triangles: Sequence[Array], low: Array, high: Array, pixels: int = PIXELS
) -> list[Seen]:
    """Return three views of the outer surface of bounded marks, with its distances from bodies.

    Args:
        marks: Bounded marks of one link.
        triangles: (m, 3, 3) [m] of each body, as `body_triangles` gives them.
        low: (3,) [m], lower corner of the shown box.
        high: (3,) [m], upper corner.
        pixels: Size of a view along its longest side.
    """
    solid = np.concatenate([*triangles, np.empty((0, 3, 3))])
    near = None
    if len(solid):
        rows = np.arange(3 * len(solid)).reshape(-1, 3)
        near = Near(Mesh(solid.reshape(-1, 3), rows, np.arange(len(solid))))
    planes = [half_spaces(mark) for mark in marks]
    step = float(np.max(high - low)) / pixels
    return [_seen(view, planes, near, low[list(view[:2])], high[list(view[:2])], step) for view in views_of(low, high)]


def _seen(
    view: View, planes: Sequence[tuple[Array, Array]], near: Near | None, low: Array, high: Array, step: float
) -> Seen:
    u, v, k = view
    counts = np.maximum(2, np.ceil((high - low) / step)).astype(int)
    ends: list[Array] = [low[i] + (np.arange(counts[i]) + 0.5) * (high[i] - low[i]) / counts[i] for i in range(2)]
    at: Array = np.stack(np.meshgrid(*ends), axis=-1).reshape(-1, 2)
    depth = np.tile([[-np.inf], [np.inf]], (1, len(at)))
    light, mark = np.zeros(depth.shape), np.full(depth.shape, -1, dtype=np.int64)
    for index, (normals, bounds) in enumerate(planes):
        for side, (along, facing) in enumerate(zip(*_between(normals[:, [u, v, k]], bounds, at), strict=True)):
            nearer = along > depth[0] if side == 0 else along < depth[1]
            depth[side, nearer], light[side, nearer], mark[side, nearer] = along[nearer], facing[nearer], index
    away = np.full(depth.shape, np.nan)
    for side in range(2):
        hit = mark[side] >= 0
        if near is not None and np.any(hit):
            places = np.empty((int(hit.sum()), 3))
            places[:, [u, v]], places[:, k] = at[hit], depth[side, hit]
            away[side, hit] = _away(near, places)
    shape = (2, counts[1], counts[0])
    return Seen(view, low, high, away.reshape(shape), light.reshape(shape), mark.reshape(shape))


def _away(near: Near, places: Array) -> Array:
    """Return the distances of points (N, 3) from triangles, computed again where the first ones may be wrong."""
    found = near.away(places)
    rows = np.flatnonzero(found > _CLOSE)
    if len(rows):
        of = near.near(places[rows], _AGAIN)
        found[rows] = np.min([near.triangles.away(places[rows], column) for column in of.T], axis=0)
        last = rows[np.argsort(-found[rows])[:_EXACT]]
        found[last] = near.exactly(places[last], found[last], np.zeros(len(last), dtype=np.int64))[0]
    return found


def _between(normals: Array, ends: Array, at: Array) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """Return top and bottom (N,) at points (N, 2), NaN outside, and how directly the surfaces face the viewer."""
    slope = normals[:, 2]
    room = ends[:, None] - normals[:, :2] @ at.T
    upper, lower = np.flatnonzero(slope > _SIDEWAYS), np.flatnonzero(slope < -_SIDEWAYS)
    tops, bottoms = room[upper] / slope[upper, None], room[lower] / slope[lower, None]
    first, second = np.argmin(tops, axis=0), np.argmax(bottoms, axis=0)
    columns = np.arange(len(at))
    top, bottom = tops[first, columns], bottoms[second, columns]
    inside: Flags = (top >= bottom) & np.all(room[np.abs(slope) <= _SIDEWAYS] >= 0.0, axis=0)
    found = np.where(inside, top, np.nan), np.where(inside, bottom, np.nan)
    return found, (slope[upper][first], -slope[lower][second])
