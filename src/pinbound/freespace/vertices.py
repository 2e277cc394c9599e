"""Vertices, edges and volume of `{A q <= b}`: proposed by Qhull, computed from the faces that meet, and verified.

Coordinates that no face couples to others are factors of a product: the polytope of MinervaBotV3 is an interval times a
polygon. Each factor is handled alone, so the volume is a product of exact areas and lengths.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, product
from typing import Any

import numpy as np

from pinbound.exceptions import UnsupportedError
from pinbound.tolerances import UNIT_ROUNDOFF, VERTEX
from pinbound.typing import Array, Flags, Indices
from pinbound.values import Value, read_only

__all__ = ["Factor", "centre_of", "factors", "linear_program", "product_edges", "product_vertices", "volume_of"]


_EXACT = 4
"""Largest number of coordinates of a factor whose vertices are listed: 80 faces in seven coordinates give millions."""
_MEETS = 64.0
"""Times `tolerances.VERTEX`: a face this near to a vertex that Qhull proposes is used to compute it."""


@dataclass(frozen=True, eq=False)
class Factor(Value):
    """A polytope over some of the coordinates.

    Attributes:
        coordinates: Their indices.
        faces: Indices of the rows of A and b that bound it.
        A: (m, k) these rows.
        b: (m,).
    """

    coordinates: Indices
    faces: Indices
    A: Array
    b: Array

    @cached_property
    def vertices(self) -> Array:
        """(v, k), each computed from the faces that meet in it; empty if the polytope is empty or flat."""
        return read_only(_vertices(self.A, self.b))

    @cached_property
    def extent(self) -> tuple[Array, Array]:
        """Corners (k,), (k,) of the smallest box around it, by linear programs."""
        ends: list[float] = []
        for j, sign in product(range(self.A.shape[1]), (1.0, -1.0)):
            cost = sign * np.eye(self.A.shape[1])[j]
            found = linear_program(cost, self.A, self.b)
            ends.append(0.0 if found is None else float(cost @ found) * sign)
        return read_only(np.array(ends[::2])), read_only(np.array(ends[1::2]))

    @cached_property
    def edges(self) -> Indices:
        """(e, 2) pairs of vertices whose common faces leave one free direction."""
        k, points = self.A.shape[1], self.vertices
        meets = self.meets
        if k == 1:
            return read_only(np.array([[0, 1]] if len(points) == 2 else [], dtype=np.intp).reshape(-1, 2))
        found: list[tuple[int, int]] = []
        for i, j in combinations(range(len(points)), 2):
            both = self.A[meets[i] & meets[j]]
            if len(both) >= k - 1 and np.linalg.matrix_rank(both, tol=1e-9) == k - 1:
                found.append((i, j))
        return read_only(np.array(found, dtype=np.intp).reshape(-1, 2))

    @cached_property
    def meets(self) -> Flags:
        """(v, m), whether each face meets each vertex."""
        return read_only(_near(self.A, self.b, self.vertices))

    @cached_property
    def volume(self) -> tuple[float, float]:
        """Volume, and a bound of its rounding error."""
        points, k = self.vertices, self.A.shape[1]
        if len(points) <= k:
            return 0.0, 0.0
        if k == 1:
            low, high = float(points.min()), float(points.max())
            return high - low, 4.0 * UNIT_ROUNDOFF * (abs(low) + abs(high))
        from scipy import spatial

        solver: Any = spatial
        hull: Any = solver.ConvexHull(points, qhull_options="Qt")
        corners = points[hull.simplices] - points.mean(axis=0)  # (s, k, k): a cone over each triangle of the surface
        parts = np.abs(np.linalg.det(corners)) / math.factorial(k)
        # An error e of a vertex moves each cone by at most its surface times e; determinants of k rows are
        # rounded similarly.
        off = _residual(self.A, self.b, points, self.meets) + 16.0 * k * UNIT_ROUNDOFF * float(np.abs(points).max())
        return float(np.sum(parts)), float(hull.area) * off + 64.0 * k * UNIT_ROUNDOFF * float(np.sum(parts))


def _near(A: Array, b: Array, points: Array) -> Flags:
    size = 1.0 + np.abs(points).max(axis=1, initial=0.0)
    return np.abs(points @ A.T - b) <= _MEETS * VERTEX * np.linalg.norm(A, axis=1) * size[:, None]


def _residual(A: Array, b: Array, points: Array, meets: Flags) -> float:
    lengths = np.linalg.norm(A, axis=1)
    return float(np.max(np.where(meets, np.abs(points @ A.T - b) / lengths, 0.0), initial=0.0))


def _vertices(A: Array, b: Array) -> Array:
    k = A.shape[1]
    if k == 1:
        a = A[:, 0]
        high, low = np.min(b[a > 0.0] / a[a > 0.0]), np.max(b[a < 0.0] / a[a < 0.0])
        return np.array([[low], [high]]) if low < high else np.empty((0, 1))
    if k > _EXACT:
        raise UnsupportedError(
            f"vertices are computed if faces couple at most {_EXACT} coordinates, and here they couple {k}; use .A "
            "and .b, or sampled_volume()"
        )
    centre, radius = centre_of(A, b)
    if not radius > 0.0:
        return np.empty((0, k))
    from scipy import spatial

    solver: Any = spatial
    proposed: Array = solver.HalfspaceIntersection(np.column_stack([A, -b]), centre).intersections
    found: dict[tuple[int, ...], Array] = {}
    lengths = np.linalg.norm(A, axis=1)
    for point in proposed:
        rows = np.flatnonzero(np.abs(A @ point - b) <= _MEETS * VERTEX * lengths * (1.0 + np.abs(point).max()))
        if len(rows) < k:
            continue
        algebra: Any = np.linalg
        solved: Array = algebra.lstsq(A[rows] / lengths[rows, None], b[rows] / lengths[rows], rcond=None)[0]
        if np.all(A @ solved <= b + _MEETS * VERTEX * lengths * (1.0 + np.abs(solved).max())):
            found[tuple(rows.tolist())] = solved + 0.0
    points = np.array(list(found.values())).reshape(-1, k)
    return points[np.lexsort(points.T[::-1])]


def centre_of(A: Array, b: Array) -> tuple[Array, float]:
    """Return the centre and radius of the largest ball in `{A x <= b}`; the radius is not positive if it is empty.

    Example:
        >>> A = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
        >>> centre, radius = centre_of(A, np.array([1.0, 1.0, 2.0, 0.0]))
        >>> radius, bool(np.all(A @ centre <= [1.0, 1.0, 2.0, 0.0]))
        (1.0, True)
    """
    lengths = np.linalg.norm(A, axis=1)
    k = A.shape[1]
    found = linear_program(np.append(np.zeros(k), -1.0), np.column_stack([A, lengths]), b)
    if found is None:
        return np.zeros_like(A[0]), -np.inf
    centre: Array = found[:k]
    return centre, float(found[k])


def linear_program(cost: Array, A: Array, b: Array, lowest: float | None = None, equal: Any = (None, None)) -> Any:
    """Return x of least cost with `A x <= b`, and `A_eq x = b_eq` of `equal`; None if there is none. It is not proven.

    Args:
        cost: (k,).
        A: (m, k).
        b: (m,).
        lowest: Lower bound of every entry; None: none.
        equal: `A_eq` and `b_eq`.
    """
    from scipy import optimize

    solver: Any = optimize
    bounds = [(lowest, None)] * len(cost)
    rows = (A, b) if len(A) else (None, None)
    found = solver.linprog(cost, *rows, *equal, bounds=bounds, method="highs")
    return np.asarray(found.x, dtype=np.float64) if found.success else None


def factors(A: Array, b: Array) -> tuple[Factor, ...]:
    """Return the polytopes whose product is `{A q <= b}`, by the coordinates that faces couple.

    Example:
        >>> A = np.array([[1.0, 0, 0], [-1, 0, 0], [0, 1, 1], [0, -1, 0], [0, 0, -1]])
        >>> [factor.coordinates.tolist() for factor in factors(A, np.array([1.0, 0, 1, 0, 0]))]
        [[0], [1, 2]]
    """
    n = A.shape[1]
    group = np.arange(n, dtype=np.intp)
    for row in A:
        used = np.flatnonzero(row)
        for j in used[1:]:
            group[group == group[j]] = group[used[0]]
    found: list[Factor] = []
    labels: list[int] = group.tolist()
    for label in dict.fromkeys(labels):
        columns = np.flatnonzero(group == label)
        rows = np.flatnonzero(np.any(A[:, columns] != 0.0, axis=1))
        found.append(Factor(columns, rows, A[np.ix_(rows, columns)], b[rows]))
    return tuple(found)


def product_vertices(parts: Sequence[Factor], n: int) -> Array:
    """Return the vertices (v, n) of a product."""
    found = [np.concatenate(one) for one in product(*(part.vertices for part in parts))]
    order = np.concatenate([part.coordinates for part in parts])
    points = np.array(found).reshape(-1, n)
    placed = np.empty_like(points)
    placed[:, order] = points
    return placed


def product_edges(parts: Sequence[Factor]) -> Indices:
    """Return the edges (e, 2) of a product, by rows of `product_vertices`: an edge of one, a vertex of the others."""
    counts = [len(part.vertices) for part in parts]
    if not all(counts):
        return np.empty((0, 2), dtype=np.intp)
    found: list[tuple[int, int]] = []
    for index, part in enumerate(parts):
        others = [range(count) for i, count in enumerate(counts) if i != index]
        for rest in product(*others):
            for first, second in part.edges.tolist():
                ends = [np.ravel_multi_index((*rest[:index], end, *rest[index:]), counts) for end in (first, second)]
                found.append((int(ends[0]), int(ends[1])))
    return np.array(found, dtype=np.intp).reshape(-1, 2)


def volume_of(parts: Sequence[Factor]) -> tuple[float, float]:
    """Return the volume of a product, and a bound of its rounding error.

    Example:
        >>> A = np.array([[1.0, 0, 0], [-1, 0, 0], [0, 1, 1], [0, -1, 0], [0, 0, -1]])
        >>> volume, error = volume_of(factors(A, np.array([2.0, 0, 1, 0, 0])))
        >>> abs(volume - 1.0) <= error < 1e-10
        True
    """
    value, most = 1.0, 1.0
    for part in parts:
        volume, error = part.volume
        value, most = value * volume, most * (volume + error)
    return value, most - value + 4.0 * len(parts) * UNIT_ROUNDOFF * value
