"""Proofs that marks hold a body: no point of the body is outside them.

A mark is a convex body Z (a point, a segment, a box, a hull) with a ball of radius R around: `Z + R`. A body is a core
C (a point, a segment, eight corners, a cylinder) with a ball of radius r around. If `r <= R`, the mark holds the body
exactly if every extreme point of C is within `R - r` of Z, for the distance from a convex set is a convex function. If
`r > R`, Z has to hold the core with a ball of `r - R`, which its facets decide: `h_C(n) + r - R <= h_Z(n)` for every
unit normal n, h being the support function. `docs/coverage.md` has the cylinder, and several spheres over one body.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations, product
from typing import TYPE_CHECKING, Any

import numpy as np

from pinbound.annotations import Mark, Shape
from pinbound.coverage.bodies import Body
from pinbound.coverage.unions import spheres_over
from pinbound.evaluate.closest import nearest, nearest_of_hulls
from pinbound.tolerances import HELD
from pinbound.typing import Array

if TYPE_CHECKING:
    from pinbound.meshes import Mesh

__all__ = ["holders", "holds", "holds_points", "is_known"]

_SOLID = 3  # dimensions
_ROUND = 32  # corners of the polygon around a cylinder's rim


def holders(body: Body, marks: Sequence[Mark], mesh: Mesh | None = None) -> tuple[tuple[str, ...], ...]:
    """Return the marks that hold a body: each mark that holds it alone, or else one set of spheres that do so.

    Args:
        body: The body; marks hold a mesh only if `mesh` is given.
        marks: Marks on the body's link.
        mesh: For a mesh: its content, in the frame of its link.

    Example:
        >>> body = Body("arm", 0, "capsule", (0.05, 0.4), np.eye(3), np.zeros(3))
        >>> from pinbound.annotations import Point
        >>> ends = [Point("low", "arm", (0.0, 0.0, -0.2), 0.13), Point("high", "arm", (0.0, 0.0, 0.2), 0.13)]
        >>> holders(body, [*ends, Point("all", "arm", (0.0, 0.0, 0.0), 0.25)])
        (('all',),)
        >>> holders(body, ends), holders(body, [*ends, Point("middle", "arm", (0.0, 0.0, 0.0), 0.1)])
        ((), (('low', 'middle', 'high'),))
    """
    if mesh is not None and body.shape == "mesh":
        from pinbound.coverage.mesh_proof import prove

        proof = prove(mesh, marks)
        return (proof.used,) if proof.is_complete else ()
    alone = tuple((mark.name,) for mark in marks if holds(mark, body))
    if alone or not is_known(body):
        return alone
    spheres = [mark for mark in marks if mark.shape.is_point and mark.shape.radius > 0.0]
    if not spheres:
        return ()
    centres = (np.array([mark.shape.origin for mark in spheres]) - body.translation) @ body.rotation
    used = spheres_over(body.shape, body.size, centres, np.array([mark.shape.radius for mark in spheres]))
    return (tuple(spheres[index].name for index in used),) if used else ()


def holds(mark: Mark, body: Body) -> bool:
    """Return whether one mark is proven to hold a body; False for lines and planes, and for meshes.

    Example:
        >>> body = Body("arm", 0, "sphere", (0.05,), np.eye(3), np.zeros(3))
        >>> from pinbound.annotations import Point
        >>> [holds(Point("p", "arm", (x, 0.0, 0.0), 0.06), body) for x in (0.01, 0.02)]
        [True, False]
    """
    shape, radius = mark.shape, mark.shape.radius
    if shape.is_unbounded or not is_known(body):
        return False
    points, around = _core(body)
    if around <= radius and holds_points(shape, points, radius - around):
        return True
    if body.shape == "cylinder" and shape.is_point:
        return _ball_holds_cylinder(shape.origin, radius, body)
    if body.shape == "cylinder" and radius > 0.0 and holds_points(shape, _rims(body), radius):
        return True
    return not shape.is_point and _between_facets(body, shape)


def is_known(body: Body) -> bool:
    """Return whether the body is one of the supported shapes, with finite sizes."""
    return body.shape in ("sphere", "box", "cylinder", "capsule") and bool(
        np.all(np.isfinite([*body.size, *body.translation, *body.rotation.ravel()]))
    )


def _core(body: Body) -> tuple[Array, float]:
    """Return the extreme points of the core, in the link's frame (k, 3), and the radius around it.

    For a cylinder, these are the ends of its axis: it lies in the capsule of its radius.
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


def holds_points(shape: Shape, points: Array, distance: float) -> bool:
    """Return whether all points (k, 3) of the link are within `distance` [m] of a shape without its radius.

    The shape then holds their convex hull, too, so the vertices of a mesh are enough. The nearest points found are
    points of the shape. So this is proven.

    Example:
        >>> from pinbound.annotations import Hull
        >>> corner = Hull("h", "arm", ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))).shape
        >>> [holds_points(corner, np.array([[x, 0.25, 0.25]]), 0.0) for x in (0.5, 0.51)]
        [True, False]
    """
    w = shape.origin - points
    edges = np.repeat(shape.directions[:, None], len(points), axis=1)
    own = shape.corners, np.zeros((1, 0))
    t = nearest(w, edges) if shape.is_zonotope else nearest_of_hulls(w, edges, own)
    away = np.linalg.norm(w + np.einsum("nk,kni->ni", t, edges), axis=1)
    return bool(np.all(away <= distance + HELD))


def _ball_holds_cylinder(centre: Array, radius: float, body: Body) -> bool:
    x, y, z = (centre - body.translation) @ body.rotation
    return math.hypot(math.hypot(x, y) + body.size[0], abs(z) + body.size[1] / 2) <= radius + HELD


def _between_facets(body: Body, shape: Shape) -> bool:
    """Return whether a body, minus a ball of the mark's radius if it has a radius, lies in a solid shape."""
    around = 0.0 if body.shape in ("box", "cylinder") else max(body.size[0] - shape.radius, 0.0)
    units = _facet_normals(shape)
    if not len(units) or np.linalg.matrix_rank(shape.directions) < _SOLID:
        return False
    mark = (units @ shape.vertices.T).max(axis=1)
    return bool(np.all(_support(body, units) + around <= mark + HELD))


def _facet_normals(shape: Shape) -> Array:
    """Return outward unit normals (m, 3) of all facets of a solid; for a hull, Qhull gives those of triangles."""
    if shape.is_zonotope:
        normals: Any = [np.cross(a, b) for a, b in combinations(shape.directions, 2)]
        normals = np.array(normals).reshape(-1, 3)
        normals = np.vstack((normals, -normals))
    else:
        from scipy.spatial import ConvexHull

        if len(shape.directions) < _SOLID:
            return np.zeros((0, 3))
        found = ConvexHull(shape.corners)
        a, b, c = (shape.corners[found.simplices[:, corner]] for corner in range(3))
        normals = np.cross(b - a, c - a)
        inward = np.einsum("ni,ni->n", normals, found.equations[:, :3]) < 0.0
        normals[inward] *= -1.0
    lengths = np.linalg.norm(normals, axis=1)
    return normals[lengths > 0.0] / lengths[lengths > 0.0, None]


def _support(body: Body, normals: Array) -> Array:
    """Return the support of the core (a cylinder: its own) along unit normals (m,), from the link's origin [m]."""
    middle = normals @ body.translation
    if body.shape == "sphere":
        return middle
    own = normals @ body.rotation
    if body.shape == "box":
        return middle + np.abs(own) @ np.array(body.size) / 2
    radius, length = body.size
    flat = radius * np.linalg.norm(own[:, :2], axis=1) if body.shape == "cylinder" else 0.0
    return middle + np.abs(own[:, 2]) * length / 2 + flat
