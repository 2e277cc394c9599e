"""Penetration depth of two convex bodies and the direction that separates them, with proven lower and upper bounds.

All differences `x_a - x_b` of points of the two bodies form a convex set D. The bodies overlap if D holds the origin.
With the support function `h(n) = max n . p` over p in D, the depth is

    depth = min over unit n of h(n):

A displacement of body a by `-depth n` makes the bodies touch, and no shorter displacement does. Any n proves `depth <=
h(n)`. A polytope within D proves that the depth is at least the smallest distance of its faces from the origin. So D is
approximated from within: faces that are nearer than the best h(n) move out to the support point along their normals,
until both bounds agree (expanding polytope). A radius around the bodies adds to the depth. `docs/depth.md`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from pinbound.evaluate import numeric, separation
from pinbound.geometry.gjk import nearest_vertices
from pinbound.path.chain import Chain
from pinbound.path.kind import Case
from pinbound.path.relative import RelativePath
from pinbound.tolerances import DEPTH, EQUALLY_NEAR
from pinbound.typing import Array, Indices
from pinbound.values import Value

__all__ = ["Penetration", "penetrations", "signed_distances", "signed_gradients"]

_MOST_ROUNDS = 100
_SAME = 1e-12  # 1 - cos of an angle of 1.4e-6 rad: normals nearer than that are of one face, cut into triangles
_THIN = 1e-14  # relative: extents that are less are rounding


@dataclass(frozen=True, eq=False)
class Penetration(Value):
    """The penetration depth of two bodies.

    Attributes:
        depth: (N,) [m], the length of the shortest displacement that makes the bodies touch; zero where they are apart.
        direction: (N, 3), unit vector in the ancestor's frame: body a, displaced by the depth along it, touches body b.
            Where the bodies are apart, it points from b's nearest point to a's.
        is_unique: (N,) bools, whether there is only one such direction. If not, `direction` is one of several.

    Example:
        >>> import pinbound as pb
        >>> found = pb.load("minervabot_v3").boundaries["beta_4"].penetration([0.0, 0.0, 0.0])
        >>> found.depth, found.direction.shape
        (0.0, (3,))
    """

    depth: Any
    direction: Array
    is_unique: Any


@dataclass
class _Deepest:
    """The depth in one row, the outward normal of the nearest face, and whether this normal is unique."""

    depth: float
    normal: Array
    is_unique: bool


@dataclass
class _Placed:
    """Bodies in the ancestor's frame: w (N, 3), edge vectors (k, N, 3), and a line's chain and unit vectors (N, 3)."""

    w: Array
    edges: Array
    line: tuple[Chain, Array] | None


def signed_distances(path: RelativePath, radius: float, Q: Array) -> Array:
    """Return the signed distance (N,) of two bodies [m]; `radius` is the sum of their radii."""
    found = separation.separations(path, Q)
    inside = _overlapping(path, found)
    for row, deepest in _deepest_of(path, Q, inside):
        found[row] = -deepest.depth
    return found - radius


def penetrations(path: RelativePath, radius: float, Q: Array, is_plane_first: bool) -> Penetration:
    """Return the depth, the direction, and whether it is unique; NaN for rows that are not finite."""
    apart = separation.separations(path, Q)
    inside = _overlapping(path, apart)
    direction, is_unique = numeric.unit(separation.vectors(path, Q)), np.isfinite(apart)
    line = _line(path, Q)
    if line is not None and path.case is Case.PLANE:
        direction = (-1.0 if is_plane_first else 1.0) * line[1]
    for row, deepest in _deepest_of(path, Q, inside):
        apart[row], direction[row], is_unique[row] = -deepest.depth, -deepest.normal, deepest.is_unique
    return Penetration(np.maximum(radius - apart, 0.0), direction, is_unique)


def signed_gradients(path: RelativePath, Q: Array) -> Array:
    """Return the gradient (N, n) of the signed distance; NaN where the direction is not unique.

    The depth is the minimum of `h(n)` over n, and h is a maximum of `n . p`. So if n is unique, `d(-h) = -n . dr/dq`,
    with the points of p fixed on their bodies.
    """
    found = separation.gradients(path, Q)
    inside = _overlapping(path, separation.separations(path, Q))
    for row, deepest in _deepest_of(path, Q, inside):
        found[row] = _slope(path, Q[row : row + 1], -deepest.normal, deepest.depth) if deepest.is_unique else np.nan
    return found


def _overlapping(path: RelativePath, apart: Array) -> Indices:
    """Return the rows with a distance of zero, which have a depth; a height is negative itself."""
    return np.flatnonzero(apart == path.floor)


def _line(path: RelativePath, Q: Array) -> tuple[Chain, Array] | None:
    """Return a line's direction, or a plane's normal, as a chain and as unit vectors (N, 3); None without one."""
    normal = path.normal
    return None if normal is None else (normal, numeric.positions(normal, Q))


def _placed(path: RelativePath, Q: Array) -> _Placed:
    w = numeric.positions(path.branch_a.chain, Q) - numeric.positions(path.branch_b.chain, Q)
    sides = ((path.branch_a.edges, 1.0), (path.branch_b.edges, -1.0))
    own = (path.difference.corners[0].shape[1], path.difference.corners[1].shape[1])
    edges = [
        sign * numeric.positions(edge, Q)
        for (chains, sign), (start, stop) in zip(sides, ((0, own[0]), (own[0], sum(own))), strict=True)
        for edge in chains[start:stop]
    ]
    return _Placed(w, np.array(edges).reshape(len(edges), *w.shape), _line(path, Q))


def _deepest_of(path: RelativePath, Q: Array, rows: Indices) -> list[tuple[int, _Deepest]]:
    if not len(rows):
        return []
    placed = _placed(path, Q[rows])
    corners = path.difference.corners
    split = corners[0].shape[1]
    found: list[tuple[int, _Deepest]] = []
    for place, row in enumerate(rows.tolist()):
        edges = placed.edges[:, place]
        a, b = placed.w[place] + corners[0] @ edges[:split], corners[1] @ edges[split:]
        basis = np.eye(3) if placed.line is None else _normal_plane(placed.line[1][place])
        found.append((row, _deepest(a @ basis.T, b @ basis.T, basis)))
    return found


def _normal_plane(unit: Array) -> Array:
    """Return two unit rows that are normal to a unit vector and to each other."""
    one = np.asarray(np.cross(unit, np.eye(3)[int(np.argmin(np.abs(unit)))]), dtype=np.float64)
    one /= np.linalg.norm(one)
    return np.stack((one, np.asarray(np.cross(unit, one), dtype=np.float64)))


def _deepest(a: Array, b: Array, basis: Array) -> _Deepest:
    """Return the depth of the origin in the set of all sums of vertices a (k, d) and b (l, d), and its normal.

    Args:
        a: Vertices of one body, d being 3, or 2 across a line.
        b: Vertices of the other body, negated.
        basis: (d, 3), unit rows.
    """
    from scipy.spatial import QhullError

    size = float(np.abs(a).max() + np.abs(b).max())

    def support(normals: Array) -> Array:
        return a[np.argmax(normals @ a.T, axis=1)] + b[np.argmax(normals @ b.T, axis=1)]

    points, thin = _spanning(support, a.shape[1], size)
    if thin is not None:
        return _Deepest(0.0, thin @ basis, False)  # a flat set: both of its sides are at the origin
    upper, best, near = np.inf, points[0], EQUALLY_NEAR * size
    normals, offsets = np.zeros((1, a.shape[1])), np.zeros(1)
    for _ in range(_MOST_ROUNDS):
        try:
            normals, offsets = _faces(points)
        except QhullError:  # rounding alone spans it
            break
        watched = offsets <= min(upper, float(np.min(offsets))) + near
        further = support(normals[watched])
        heights = np.einsum("ni,ni->n", normals[watched], further)
        least = int(np.argmin(heights))
        if heights[least] < upper:
            upper, best = float(heights[least]), normals[watched][least]
        fresh = further[heights - offsets[watched] > DEPTH * size]
        if not len(fresh):
            break
        grown = np.unique(np.vstack((points, fresh)), axis=0)
        if len(grown) == len(points):
            break
        points = grown
    equal = offsets <= upper + near
    is_unique = not np.any(normals[equal] @ best < 1.0 - _SAME)
    return _Deepest(max(upper, 0.0), best @ basis, is_unique)


def _spanning(support: Callable[[Array], Array], d: int, size: float) -> tuple[Array, Array | None]:
    """Return points of the set that span all d dimensions, or a unit vector along which it has no extent."""
    points = np.unique(support(np.vstack((np.eye(d), -np.eye(d)))), axis=0)
    while True:
        _, sizes, axes = np.linalg.svd(points - points[0], full_matrices=True)
        sizes = np.append(sizes, np.zeros(d - len(sizes)))
        thin = axes[sizes <= _THIN * size * np.sqrt(len(points))]
        if not len(thin):
            return points, None
        ends = support(np.stack((thin[0], -thin[0])))
        if (ends[0] - ends[1]) @ thin[0] <= _THIN * size:
            return points, thin[0]
        points = np.vstack((points, ends))


def _faces(points: Array) -> tuple[Array, Array]:
    """Return the outward unit normals (f, d) of the faces of a hull, and the origin's distances behind them (f,).

    The points are scaled to equal extents for Qhull, so that it can distinguish the faces of thin bodies. A distance is
    the smallest value over the vertices of the face: a lower bound.
    """
    from scipy.spatial import ConvexHull

    middle = points.mean(axis=0)
    _, sizes, axes = np.linalg.svd(points - middle, full_matrices=False)
    found = ConvexHull((points - middle) @ axes.T / sizes)
    normals: Array = (found.equations[:, :-1] / sizes) @ axes
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    heights: Array = np.einsum("fi,fki->fk", normals, points[found.simplices])
    return normals, heights.min(axis=1)


def _slope(path: RelativePath, q: Array, m: Array, depth: float) -> Array:
    """Return the gradient (n,) of the signed distance of bodies that overlap; m is the only separating direction."""
    placed, corners = _placed(path, q), path.difference.corners
    split = corners[0].shape[1]
    w, edges = placed.w, placed.edges
    size = float(np.linalg.norm(w) + np.linalg.norm(edges, axis=2).sum())
    beyond = w + (depth + size) * m  # the point of the face below the origin is nearest to one far outside it
    if placed.line is not None:
        unit = placed.line[1]
        beyond = beyond - np.einsum("ni,ni->n", beyond, unit)[:, None] * unit
        edges = edges - np.einsum("kni,ni->kn", edges, unit)[:, :, None] * unit
    t = nearest_vertices(beyond, edges, corners)[0][0]
    slope = m @ (numeric.derivative(path.branch_a.chain, q)[0] - numeric.derivative(path.branch_b.chain, q)[0])
    r = placed.w[0] + t @ placed.edges[:, 0]
    for branch, sign, columns in ((path.branch_a, 1.0, range(split)), (path.branch_b, -1.0, range(split, len(t)))):
        for column in columns:
            slope = slope + sign * t[column] * (m @ numeric.derivative(branch.edges[column], q)[0])
    if placed.line is not None:  # m turns with the line
        direction, unit = placed.line
        slope = slope - (unit[0] @ r) * (m @ numeric.derivative(direction, q)[0])
    return slope
