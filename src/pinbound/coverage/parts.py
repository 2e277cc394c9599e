"""One mark around some points: a hull of few of them, a capsule, a sphere, or a box, enlarged until it holds all.

The fit is a proposal. Then the radius, or the size, is enlarged to hold the furthest point, rounded up.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pinbound.annotations import Box, Hull, Mark, Point, Segment
from pinbound.annotations.shapes import extreme_vertices
from pinbound.coverage.ball import BALL, ball_corners
from pinbound.coverage.mesh_proof import away_from
from pinbound.coverage.polytopes import Polytope
from pinbound.geometry.rotations import matrix_rpy
from pinbound.tolerances import HELD

__all__ = ["FITS", "Fit", "directions", "outline"]

Array = NDArray[np.float64]
Fit = Literal["hulls", "capsules", "spheres", "boxes"]

_COUNTS = (12, 16, 24, 32, 48, 64, 96)
"""Numbers of directions for the vertices of a hull, tried until the other points are near enough."""
_STEPS = 200  # of the search for a small ball
_LARGER = 1.0 + 1e-12  # so that rounding leaves no point outside


def outline(mark: Mark) -> tuple[Array, float]:
    """Return vertices (k, 3) and a radius such that their hull with a ball of that radius holds the mark.

    For capsules and spheres this is a polytope around them, which is larger by 2 % of their radius.
    """
    shape = mark.shape
    if len(shape.vertices) > 2 or not shape.radius > 0.0:
        return shape.vertices, shape.radius
    ball = ball_corners() * (BALL * shape.radius)
    return extreme_vertices((shape.vertices[:, None] + ball).reshape(-1, 3)), 0.0


def _hull(name: str, link: str, points: Array, budget: float) -> Mark:
    """Return a hull of few of the points, with a radius that holds the others; the radius is at most about `budget`."""
    extreme = extreme_vertices(points)
    if len(extreme) <= _COUNTS[0] or not budget > 0.0:
        return Hull(name, link, _rows(extreme))
    centred = extreme - extreme.mean(axis=0)
    for count in _COUNTS:
        chosen = np.unique(np.argmax(centred @ directions(count).T, axis=0))
        if 3 * len(chosen) > 2 * len(extreme):
            break
        polytope = Polytope.of(extreme[chosen])
        if polytope is None:
            continue
        rest = np.setdiff1d(np.arange(len(extreme)), chosen)
        outside = extreme[rest[polytope.away(extreme[rest]) > budget]]
        if len(outside) and polytope.beyond(outside).max() > budget:
            continue
        mark = Hull(name, link, _rows(extreme[chosen]))
        radius = float(away_from(mark.shape, extreme[rest]).max(initial=0.0)) * _LARGER + HELD
        if radius <= budget:
            return Hull(name, link, mark.vertices, radius)
    return Hull(name, link, _rows(extreme))


def _capsule(name: str, link: str, points: Array, budget: float) -> Mark:
    """Return the capsule of least volume of three, along the axes in which the points spread."""
    extreme = extreme_vertices(points)
    found: list[tuple[float, Segment]] = []
    for axis in _principal(extreme):
        along = extreme @ axis
        flat = extreme - np.outer(along, axis)
        centre = _ball_centre(flat)
        lateral = np.linalg.norm(flat - centre, axis=1)
        radius = float(lateral.max())
        cap = np.sqrt(np.maximum(radius**2 - lateral**2, 0.0))
        low, high = float(np.min(along + cap)), float(np.max(along - cap))
        if low > high:
            low = high = 0.5 * (low + high)
        ends = [_row(centre - axis * (centre @ axis) + axis * height) for height in (low, high)]
        bare = Segment(name, link, ends[0], ends[1])
        radius = float(away_from(bare.shape, extreme).max()) * _LARGER + HELD
        found.append((radius**2 * (high - low + 4.0 / 3.0 * radius), Segment(name, link, ends[0], ends[1], radius)))
    return min(found, key=lambda one: one[0])[1]


def _sphere(name: str, link: str, points: Array, budget: float) -> Mark:
    extreme = extreme_vertices(points)
    centre = _row(_ball_centre(extreme))
    radius = float(np.linalg.norm(extreme - np.array(centre), axis=1).max()) * _LARGER + HELD
    return Point(name, link, centre, radius)


def _box(name: str, link: str, points: Array, budget: float) -> Mark:
    """Return the smaller of two boxes: along the link's axes, or along the axes in which the points spread."""
    extreme = extreme_vertices(points)
    found: list[tuple[float, Box]] = []
    ways: tuple[Array, Array] = (np.eye(3), _principal(extreme))
    for axes in ways:
        local = extreme @ axes.T
        low, high = local.min(axis=0), local.max(axis=0)
        grown = HELD * (1.0 + float(np.abs(local).max()))
        size = high - low + 2.0 * grown
        middle = (0.5 * (low + high)) @ axes
        bare = Box(name, link, _row(middle), matrix_rpy(axes.T), _row(size))
        out = float(away_from(bare.shape, extreme).max())
        if out > 0.0:
            bare = Box(name, link, bare.xyz, bare.rpy, _row(size + 2.0 * _LARGER * out))
        found.append((float(size[0] * size[1] * size[2]), bare))
    return min(found, key=lambda one: one[0])[1]


FITS: dict[Fit, Callable[[str, str, Array, float], Mark]] = {
    "hulls": _hull,
    "capsules": _capsule,
    "spheres": _sphere,
    "boxes": _box,
}
"""Functions that make a mark around points (N, 3), from name, link, points, and the error [m] that fewer vertices may
make."""


def _row(values: Array) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z


def _rows(points: Array) -> tuple[tuple[float, float, float], ...]:
    return tuple(_row(point) for point in points)


def _principal(points: Array) -> Array:
    """Return the axes (3, 3), rows, along which points spread, the longest first; right-handed."""
    axes: Any = np.linalg.svd(points - points.mean(axis=0), full_matrices=True)[2]
    return axes * np.linalg.det(axes)


def _ball_centre(points: Array) -> Array:
    """Return nearly the centre of the smallest ball around points (Badoiu and Clarkson, 2003)."""
    centre = 0.5 * (points.min(axis=0) + points.max(axis=0))
    best, least = centre, math.inf
    for step in range(1, _STEPS + 1):
        away = points - centre
        square = np.einsum("ni,ni->n", away, away)
        furthest = int(np.argmax(square))
        if square[furthest] < least:
            best, least = centre, float(square[furthest])
        centre = centre + away[furthest] / (step + 1.0)
    return best


def directions(count: int) -> Array:
    """Return unit vectors (2 count + 6, 3) spread over the sphere: a spiral, its opposite, and the axes."""
    heights = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    turns = np.pi * (1.0 + math.sqrt(5.0)) * np.arange(count)
    flat = np.sqrt(1.0 - heights**2)
    spiral = np.column_stack((flat * np.cos(turns), flat * np.sin(turns), heights))
    return np.vstack((spiral, np.eye(3), -np.eye(3)))
