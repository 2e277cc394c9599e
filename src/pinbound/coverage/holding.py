"""Proofs that marks hold a body: that no point of it is outside them.

A mark is a zonotope Z (a point, a segment, a box, a prism) with a ball of radius R around: `Z + R`. A body is a core C
(a point, a segment, eight corners, a cylinder) with a ball of radius r around. If `r <= R`, the mark holds the body
exactly if every extreme point of C is within `R - r` of Z, for the distance from a convex set is a convex function. If
`r > R`, Z has to hold the core with a ball of `r - R`, which its facets decide: `h_C(n) + r - R <= h_Z(n)` for every
unit normal n, h being the support function. `docs/coverage.md` has the cylinder, and several spheres over one body.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray

from pinbound.annotations import FlatMark, Mark, Point
from pinbound.bodies import Body
from pinbound.coverage.unions import spheres_over
from pinbound.interpreters.closest import nearest
from pinbound.tolerances import HELD

__all__ = ["holders", "holds", "is_known"]

Array = NDArray[np.float64]

_SOLID = 3  # dimensions
_ROUND = 32  # corners of the polygon around a cylinder's rim


def holders(body: Body, marks: Sequence[Mark]) -> tuple[tuple[str, ...], ...]:
    """Return the marks that hold a body: each one that holds it alone, else one set of spheres that does together.

    Args:
        body: The body; a mesh is held by nothing, for it is not read.
        marks: Marks on the body's link.

    Example:
        >>> body = Body("arm", 0, "capsule", (0.05, 0.4), np.eye(3), np.zeros(3))
        >>> ends = [Point("low", "arm", (0.0, 0.0, -0.2), 0.13), Point("high", "arm", (0.0, 0.0, 0.2), 0.13)]
        >>> holders(body, [*ends, Point("all", "arm", (0.0, 0.0, 0.0), 0.25)])
        (('all',),)
        >>> holders(body, ends), holders(body, [*ends, Point("middle", "arm", (0.0, 0.0, 0.0), 0.1)])
        ((), (('low', 'middle', 'high'),))
    """
    alone = tuple((mark.name,) for mark in marks if holds(mark, body))
    if alone or not is_known(body):
        return alone
    spheres = [mark for mark in marks if isinstance(mark, Point) and mark.radius > 0.0]
    if not spheres:
        return ()
    centres = (np.array([mark.xyz for mark in spheres]) - body.translation) @ body.rotation
    used = spheres_over(body.shape, body.size, centres, np.array([mark.radius for mark in spheres]))
    return (tuple(spheres[index].name for index in used),) if used else ()


def holds(mark: Mark, body: Body) -> bool:
    """Return whether one mark is proven to hold a body; False for lines and planes, and for meshes.

    Example:
        >>> body = Body("arm", 0, "sphere", (0.05,), np.eye(3), np.zeros(3))
        >>> [holds(Point("p", "arm", (x, 0.0, 0.0), 0.06), body) for x in (0.01, 0.02)]
        [True, False]
    """
    if isinstance(mark, FlatMark) or not is_known(body):
        return False
    ways = np.array(mark.ways).reshape(-1, 3)
    corner, radius = np.array(mark.xyz), mark.radius
    points, around = _core(body)
    if around <= radius and _within(points, corner, ways, radius - around):
        return True
    if body.shape == "cylinder" and not len(ways):
        return _ball_holds_cylinder(corner, radius, body)
    if body.shape == "cylinder" and radius > 0.0 and _within(_rims(body), corner, ways, radius):
        return True
    return bool(len(ways)) and _between_facets(body, corner, ways, radius)


def is_known(body: Body) -> bool:
    """Return whether the body is one of the shapes that are read, with finite sizes."""
    return body.shape in ("sphere", "box", "cylinder", "capsule") and bool(
        np.all(np.isfinite([*body.size, *body.translation, *body.rotation.ravel()]))
    )


def _core(body: Body) -> tuple[Array, float]:
    """Return the extreme points of the core, in the link's frame (k, 3), and the radius around it.

    Of a cylinder they are the ends of its axis: it lies in the capsule of its radius.
    """
    if body.shape == "sphere":
        points, around = np.zeros((1, 3)), body.size[0]
    elif body.shape == "box":
        points, around = np.array(list(product((-0.5, 0.5), repeat=3))) * body.size, 0.0
    else:
        around = body.size[0]
        points = np.array([[0.0, 0.0, -body.size[1] / 2], [0.0, 0.0, body.size[1] / 2]])
    return points @ body.rotation.T + body.translation, around


def _rims(body: Body) -> Array:
    """Return the corners of polygons around both rims of a cylinder, (2 m, 3): their prism holds it."""
    radius, length = body.size
    out = radius / math.cos(math.pi / _ROUND)
    angles = 2.0 * math.pi * np.arange(_ROUND) / _ROUND
    ring = np.column_stack((out * np.cos(angles), out * np.sin(angles), np.full(_ROUND, length / 2)))
    return np.vstack((ring, ring * (1.0, 1.0, -1.0))) @ body.rotation.T + body.translation


def _within(points: Array, corner: Array, ways: Array, distance: float) -> bool:
    """Return whether all points are this near to a zonotope; the nearest points found are feasible, so it is proven."""
    w = corner - points
    edges = np.repeat(ways[:, None], len(points), axis=1)
    t = nearest(w, edges)
    away = np.linalg.norm(w + np.einsum("nk,kni->ni", t, edges), axis=1)
    return bool(np.all(away <= distance + HELD))


def _ball_holds_cylinder(centre: Array, radius: float, body: Body) -> bool:
    x, y, z = (centre - body.translation) @ body.rotation
    return math.hypot(math.hypot(x, y) + body.size[0], abs(z) + body.size[1] / 2) <= radius + HELD


def _between_facets(body: Body, corner: Array, ways: Array, radius: float) -> bool:
    """Return whether a body, less a ball of the mark's radius where it has one, lies in a zonotope that is a solid."""
    around = 0.0 if body.shape in ("box", "cylinder") else max(body.size[0] - radius, 0.0)
    normals = [np.cross(a, b) for a, b in combinations(ways, 2)]
    lengths = [float(np.linalg.norm(normal)) for normal in normals]
    units = np.array([n / size for n, size in zip(normals, lengths, strict=True) if size > 0.0]).reshape(-1, 3)
    if not len(units) or np.linalg.matrix_rank(ways) < _SOLID:
        return False
    both = np.vstack((units, -units))
    mark = both @ corner + np.maximum(both @ ways.T, 0.0).sum(axis=1)
    return bool(np.all(_support(body, both) + around <= mark + HELD))


def _support(body: Body, normals: Array) -> Array:
    """Return the support of the core along unit normals (m,), from the link's origin [m]; a cylinder's is its own."""
    middle = normals @ body.translation
    if body.shape == "sphere":
        return middle
    own = normals @ body.rotation
    if body.shape == "box":
        return middle + np.abs(own) @ np.array(body.size) / 2
    radius, length = body.size
    flat = radius * np.linalg.norm(own[:, :2], axis=1) if body.shape == "cylinder" else 0.0
    return middle + np.abs(own[:, 2]) * length / 2 + flat
