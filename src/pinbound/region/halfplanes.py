"""Convex cells as intersections of named half-planes; each vertex is computed from the two lines that meet there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pinbound.tolerances import IMPLIED, LIMIT, UNIT_ROUNDOFF, VERTEX
from pinbound.typing import Array, Flags
from pinbound.values import Value

__all__ = ["HalfPlane", "Support", "intersect", "support"]


@dataclass(frozen=True, eq=False)
class HalfPlane(Value):
    """`normal @ x <= bound` in a slice of two coordinates.

    Attributes:
        source: The boundary or the joint that gives it.
        name: The name for people, e.g. ``"beta_4"`` or ``"q2 upper"``.
        normal: (2,), not zero; not a unit vector in general.
        bound: [rad or m].
        is_contact: True for a boundary, False for a joint limit.
    """

    source: str
    name: str
    normal: Array
    bound: float
    is_contact: bool

    def allows(self, X: Array) -> Flags:
        """Return whether points (N, 2) keep it: a contact is open; a limit may be passed by the tolerance of its rule.

        Twice the rounding of the sums is allowed. `coupling.Intervals` has the exact decision about a joint's limit.
        """
        value = X @ self.normal
        if self.is_contact:
            return np.asarray(value < self.bound, dtype=bool)
        rounding = 16.0 * UNIT_ROUNDOFF * (abs(self.bound) + np.abs(X) @ np.abs(self.normal))
        return np.asarray(value <= self.bound + 2.0 * LIMIT + rounding, dtype=bool)

    def inset(self, distance: float, factors: ArrayLike = (1.0, 1.0)) -> HalfPlane:
        """Return the half-plane moved inwards by a Euclidean distance of coordinates multiplied by factors (2,)."""
        bound = self.bound - distance * float(np.linalg.norm(self.normal / np.asarray(factors)))
        return HalfPlane(self.source, self.name, self.normal, bound, self.is_contact)


@dataclass(frozen=True)
class Support:
    """The position of a half-plane relative to a convex cell.

    Attributes:
        slack: `(bound - max normal @ x) / |normal|` over the cell [rad or m]; zero for an edge, positive if implied.
        by: The edges whose combination implies it; empty if it is an edge itself.
    """

    slack: float
    by: tuple[str, ...]


def intersect(half_planes: Sequence[HalfPlane]) -> tuple[Array, tuple[HalfPlane, ...]]:
    """Return the cell `{x : normal_i @ x <= bound_i for all i}`, which must be bounded.

    Args:
        half_planes: Half-planes; the first four must form a box around the cell.

    Returns:
        Vertices (k, 2), counter-clockwise, and the k half-planes of the edges; edge i goes from vertex i to vertex i +
        1. Both are empty if the cell is empty or flat.

    Example:
        >>> sides = {"right": (1.0, 0.0), "top": (0.0, 1.0), "left": (-1.0, 0.0), "low": (0.0, -1.0)}
        >>> box = [HalfPlane("q", name, np.array(normal), 1.0, False) for name, normal in sides.items()]
        >>> corner = HalfPlane("beta", "beta", np.array([1.0, 1.0]), 1.0, True)
        >>> vertices, edges = intersect([*box, corner])
        >>> [half_plane.name for half_plane in edges]
        ['right', 'beta', 'top', 'left', 'low']
    """
    edges = list(half_planes[:4])
    vertices = [_meet(edges[i - 1], edges[i]) for i in range(4)]
    for half_plane in half_planes[4:]:
        vertices, edges = _clip(vertices, edges, half_plane)
    vertices, edges = _without_short_edges(vertices, edges)
    if len(edges) < 3:
        return np.empty((0, 2)), ()
    return np.array(vertices), tuple(edges)


def _meet(a: HalfPlane, b: HalfPlane) -> Array:
    point = np.linalg.solve(np.array([a.normal, b.normal]), np.array([a.bound, b.bound]))
    return np.asarray(point, dtype=np.float64) + 0.0  # no negative zeros


def _clip(vertices: list[Array], edges: list[HalfPlane], half_plane: HalfPlane) -> tuple[list[Array], list[HalfPlane]]:
    """Cut a convex polygon by one half-plane; new vertices are computed from the two lines, not interpolated."""
    inside = [float(half_plane.normal @ vertex) <= half_plane.bound for vertex in vertices]
    if all(inside) or not any(inside):
        return (vertices, edges) if any(inside) else ([], [])
    cut_vertices: list[Array] = []
    cut_edges: list[HalfPlane] = []
    for i, edge in enumerate(edges):
        following = (i + 1) % len(edges)
        if inside[i]:
            cut_vertices.append(vertices[i])
            cut_edges.append(edge)
        if inside[i] and not inside[following]:
            cut_vertices.append(_meet(edge, half_plane))
            cut_edges.append(half_plane)
        elif inside[following] and not inside[i]:
            cut_vertices.append(_meet(half_plane, edge))
            cut_edges.append(edge)
    return cut_vertices, cut_edges


def _without_short_edges(vertices: list[Array], edges: list[HalfPlane]) -> tuple[list[Array], list[HalfPlane]]:
    keep = [
        i for i, vertex in enumerate(vertices) if np.max(np.abs(vertices[(i + 1) % len(vertices)] - vertex)) > VERTEX
    ]
    return [vertices[i] for i in keep], [edges[i] for i in keep]


def support(
    vertices: Array, edges: Sequence[HalfPlane], half_plane: HalfPlane, factors: ArrayLike = (1.0, 1.0)
) -> Support:
    """Return a half-plane's slack over a cell (coordinates times factors (2,)), and the edges that imply it.

    At the vertex where `normal @ x` is largest, `normal = l_1 n_1 + l_2 n_2` with the normals of the two edges that
    meet there and `l >= 0` (Farkas): the edges with `l > 0` imply the half-plane.
    """
    if any(half_plane is edge for edge in edges):
        return Support(0.0, ())
    values = vertices @ half_plane.normal
    top = int(np.argmax(values))
    slack = (half_plane.bound - float(values[top])) / float(np.linalg.norm(half_plane.normal / np.asarray(factors)))
    meeting = (edges[top - 1], edges[top])
    weights = np.linalg.solve(np.column_stack([edge.normal for edge in meeting]), half_plane.normal)
    by = tuple(edge.name for edge, weight in zip(meeting, weights, strict=True) if weight > IMPLIED)
    return Support(slack, by)
