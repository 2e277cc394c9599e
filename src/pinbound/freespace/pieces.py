"""The whole free set of a robot whose boundaries have one effective angle each, as a union of polytopes.

Limits and boundaries give half-spaces; a rule with conditions gives a choice of half-spaces. Each choice gives one
polytope. If the choices concern only two coordinates, the shortest path through the union turns at corners of the
union. A graph of the corners that see each other contains this path.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations, product
from typing import Any

import numpy as np

from pinbound.boundaries.boundary import Boundary
from pinbound.freespace.faces import OneAngleGaps, guarded_choices, limit_faces, outer_box
from pinbound.freespace.set_graph import SetGraph
from pinbound.freespace.vertices import Factor, factors
from pinbound.robot.robot import Robot
from pinbound.typing import Array

__all__ = ["Union", "free_union", "lifted", "path_in_union", "shortest_in_plane"]

_MOST = 64
"""Largest number of polytopes of a union: six rules with one condition each."""
_INSIDE = 1e-9
"""[rad or m], the distance that paths keep inside the faces, so that `certify` can distinguish them from contact."""
_SAME = 1e-12
"""[rad or m]: two parts of a straight path with at most this distance count as one."""

Union = Sequence[tuple[Array, Array]]


def free_union(
    robot: Robot, chosen: Sequence[Boundary], q: Array, window: Mapping[str, tuple[float, float]]
) -> list[tuple[Array, Array]] | None:
    """Return polytopes (A, b), proven free, whose union is the free set between the contacts around q, in a window.

    None if a boundary has more than one effective angle, or rules with conditions leave too many choices.
    """
    if any(boundary.rule.strips() is None for boundary in chosen):
        return None
    low, high = outer_box(limit_faces(robot, window), robot.coordinates)
    farthest = np.maximum(np.abs(low), np.abs(high))
    faces = limit_faces(robot, window, farthest)
    gaps = OneAngleGaps(robot, chosen, low, high)
    for name in gaps.strips:
        gap = gaps.around(name, q)
        if gap is None:
            return None
        faces += gap.faces()
    choices = [guarded_choices(one, farthest, robot.coordinates) for one in robot.guarded_limits]
    if np.prod([len(one) for one in choices]) > _MOST:
        return None
    found: list[tuple[Array, Array]] = []
    for some in product(*choices):
        all_faces = [*faces, *some]
        found.append((np.array([one.normal for one in all_faces]), np.array([one.proven for one in all_faces])))
    return found


def path_in_union(union: Union, start: Array, goal: Array) -> Array | None:
    """Return a path through a union of polytopes; it is the shortest if they differ only in two coordinates.

    Coordinates that no choice concerns go from start to goal evenly along the path. This is allowed because their
    constraints are convex and the same in all polytopes. So the path in all coordinates is the shortest one, too.
    """
    if len(union) < 2:
        return None
    tied = factors(np.vstack([A for A, _ in union]), np.concatenate([b for _, b in union]))
    choice = [part for part in tied if not _is_common(union, part)]
    if len(choice) == 1 and len(choice[0].coordinates) == 2:
        columns = choice[0].coordinates
        planar = [_restricted(one, columns) for one in union]
        way = shortest_in_plane(planar, start[columns], goal[columns])
        return None if way is None else lifted(way, columns, start, goal)
    graph = SetGraph.of_polytopes([(A, b - _INSIDE * np.linalg.norm(A, axis=1)) for A, b in union])
    best: Array | None = None
    for first in graph.entries(start):
        for last in graph.entries(goal):
            route = graph.route(first, last)
            if route is not None and (best is None or _length(route.points) < _length(best)):
                best = route.points
    return best


def lifted(way: Array, columns: Any, start: Array, goal: Array) -> Array:
    """Return a path over some coordinates in all coordinates; the others go evenly along it from start to goal."""
    steps = np.linalg.norm(np.diff(way, axis=0), axis=1)
    length = float(steps.sum())
    part = np.concatenate([[0.0], np.cumsum(steps)]) / length if length > 0.0 else np.linspace(0.0, 1.0, len(way))
    found = start + part[:, None] * (goal - start)
    found[:, columns] = way
    found[0], found[-1] = start, goal
    return found


def _is_common(union: Union, part: Factor) -> bool:
    """Return whether all polytopes have the same faces over the coordinates of a factor."""
    rows = [_rows(one, part) for one in union]
    return all(one == rows[0] for one in rows)


def _rows(one: tuple[Array, Array], part: Factor) -> set[tuple[float, ...]]:
    A, b = _restricted(one, part.coordinates)
    return {(*row, end) for row, end in zip(A.tolist(), b.tolist(), strict=True)}


def _restricted(one: tuple[Array, Array], columns: Any) -> tuple[Array, Array]:
    A, b = one
    rows = np.any(A[:, columns] != 0.0, axis=1)
    return A[np.ix_(rows, columns)], b[rows]


def _length(points: Array) -> float:
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def shortest_in_plane(union: Union, start: Array, goal: Array) -> Array | None:
    """Return the shortest path (p, 2) in a union of convex polygons {A x <= b}; None if there is none.

    It stays 1e-9 inside the faces, except at start and goal. It turns only at corners of the union that point inwards:
    corners of a polygon, or crossings of the sides of two of them.

    Example:
        >>> tall = np.array([[1.0, 0], [-1, 0], [0, 1], [0, -1]]), np.array([1.0, 0, 2, 0])
        >>> wide = tall[0], np.array([2.0, 0, 1, 0])
        >>> np.round(shortest_in_plane([tall, wide], np.array([0.5, 2.0]), np.array([2.0, 0.5])), 6).tolist()
        [[0.5, 2.0], [1.0, 1.0], [2.0, 0.5]]
    """
    inside = [(A, b - _INSIDE * np.linalg.norm(A, axis=1)) for A, b in union]
    nodes = [start, goal, *_corners(inside)]
    n = len(nodes)
    length = np.zeros((n, n))
    for i, j in combinations(range(n), 2):
        sets = union if i < 2 else inside
        if _sees(sets, nodes[i], nodes[j]):
            length[i, j] = max(float(np.linalg.norm(nodes[i] - nodes[j])), 1e-300)
    from scipy.sparse import csgraph

    solver: Any = csgraph
    _, before = solver.dijkstra(length, directed=False, indices=0, return_predecessors=True)
    way = [1]
    while way[-1] != 0:
        there = int(before[way[-1]])
        if there < 0:
            return None
        way.append(there)
    return np.array([nodes[index] for index in way[::-1]])


def _corners(union: Union) -> list[Array]:
    """Return crossings of the sides of two polygons, or of one, that lie in the union."""
    lines = [(a, float(end)) for A, b in union for a, end in zip(A, b, strict=True)]
    found: list[Array] = []
    for (a, a_end), (c, c_end) in combinations(lines, 2):
        across = float(a[0] * c[1] - a[1] * c[0])
        if abs(across) <= 1e-12 * float(np.linalg.norm(a) * np.linalg.norm(c)):
            continue
        point = np.array([a_end * c[1] - c_end * a[1], a[0] * c_end - c[0] * a_end]) / across
        held = any(bool(np.all(A @ point <= b + _SAME)) for A, b in union)
        if held and not any(float(np.abs(point - other).max()) <= _SAME for other in found):
            found.append(point)
    return found


def _sees(union: Union, a: Array, b: Array) -> bool:
    """Return whether the straight way from a to b lies in the union: the parts in each polygon cover it."""
    step, parts = b - a, list[tuple[float, float]]()
    for A, end in union:
        along, room = A @ step, end + _SAME - A @ a
        if np.any((along == 0.0) & (room < 0.0)):
            continue
        with np.errstate(divide="ignore", invalid="ignore"):
            times = room / along
        first = float(np.max(np.where(along < 0.0, times, 0.0), initial=0.0))
        last = float(np.min(np.where(along > 0.0, times, 1.0), initial=1.0))
        if first <= last:
            parts.append((first, last))
    reached, spare = 0.0, _SAME / max(float(np.linalg.norm(step)), _SAME)
    for first, last in sorted(parts):
        if first > reached + spare:
            return False
        reached = max(reached, last)
    return reached >= 1.0 - spare
