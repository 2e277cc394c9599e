"""Which convex sets intersect, and the shortest chain of them: a graph, Dijkstra's path, and its shortening.

The result is a path through sets: straight between points, with each two neighbours in one set. It is not a proof:
`certify` proves the path.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from pinbound.freespace.vertices import centre_of, linear_program
from pinbound.typing import Array, Flags, Indices
from pinbound.values import Value

__all__ = ["Route", "SetGraph", "components", "connected", "touching"]

_CANDIDATES = 4_000_000
"""Pairs of boxes that are compared at once."""
_SOFT = 1e-18
"""Added to squares of lengths, so that a path has a derivative where two of its points coincide."""
_LARGEST = 210
"""The largest size of a path through polytopes, thirty points in seven coordinates, that is shortened."""
_INSIDE = 0.999999
"""Share of the way to a face: rounding leaves the points inside."""
_ENTRIES = 8
"""Number of sets that are tried as an entry, if an end is in no set."""


@dataclass(frozen=True, eq=False)
class Route(Value):
    """A path through sets.

    Attributes:
        points: (p, k); two neighbours are in one set.
        sets: (p - 1,) the set of each two neighbours.
    """

    points: Array
    sets: Indices


@dataclass(frozen=True, eq=False)
class SetGraph(Value):
    """Convex sets, pairs of sets that intersect, and a point in each intersection.

    Attributes:
        sets: (A, b) of each polytope; empty for boxes.
        boxes: (f, 2, k) of each box; empty for polytopes.
        pairs: (e, 2) sets that intersect.
        portals: (e, k) a point in both.
        centres: (f, k) a point of each.
    """

    sets: tuple[tuple[Array, Array], ...]
    boxes: Array
    pairs: Indices
    portals: Array
    centres: Array

    @classmethod
    def of_boxes(cls, boxes: Array) -> SetGraph:
        """Return the graph of closed boxes (f, 2, k); a common face or a common corner is an intersection."""
        pairs = touching(boxes)
        low = np.maximum(boxes[pairs[:, 0], 0], boxes[pairs[:, 1], 0])
        high = np.minimum(boxes[pairs[:, 0], 1], boxes[pairs[:, 1], 1])
        return cls((), boxes, pairs, low + 0.5 * (high - low), boxes.mean(axis=1))

    @classmethod
    def of_polytopes(cls, sets: Sequence[tuple[Array, Array]]) -> SetGraph:
        """Return the graph of polytopes; only intersections with an interior count."""
        k = sets[0][0].shape[1] if sets else 0
        around = np.array([_extent(A, b) for A, b in sets]).reshape(-1, 2, k)
        pairs, portals = list[tuple[int, int]](), list[Array]()
        near: list[tuple[int, int]] = touching(around).tolist()
        for i, j in near:
            centre, radius = centre_of(np.vstack([sets[i][0], sets[j][0]]), np.append(sets[i][1], sets[j][1]))
            if radius > 0.0:
                pairs.append((i, j))
                portals.append(centre)
        centres = np.array([centre_of(A, b)[0] for A, b in sets]).reshape(-1, k)
        meets = np.array(pairs, dtype=np.intp).reshape(-1, 2)
        return cls(tuple(sets), np.empty((0, 2, k)), meets, np.array(portals).reshape(-1, k), centres)

    def __len__(self) -> int:
        """Return the number of sets."""
        return len(self.centres)

    def holds(self, x: Array) -> Flags:
        """Return which sets contain x (k,)."""
        if len(self.boxes):
            return np.all((self.boxes[:, 0] <= x) & (x <= self.boxes[:, 1]), axis=1)
        return np.array([bool(np.all(A @ x <= b)) for A, b in self.sets], dtype=np.bool_)

    def entries(self, x: Array) -> list[tuple[int, Array]]:
        """Return sets and an entry point of each from x: the sets that contain x, with x; else the nearest sets."""
        inside = np.flatnonzero(self.holds(x)).tolist() if len(self) else []
        if inside:
            return [(one, x) for one in inside]
        if len(self.boxes):
            points = np.clip(x, self.boxes[:, 0], self.boxes[:, 1])
        else:
            points = np.array([self._towards(one, x) for one in range(len(self))]).reshape(-1, len(x))
        near = np.argsort(np.linalg.norm(points - x, axis=1), kind="stable")[:_ENTRIES]
        return [(int(one), points[one]) for one in near]

    def _towards(self, one: int, x: Array) -> Array:
        """Return a point slightly behind the entry of the line from x to the middle of a polytope."""
        A, b = self.sets[one]
        step = x - self.centres[one]
        along, room = A @ step, b - A @ self.centres[one]
        with np.errstate(divide="ignore", invalid="ignore"):
            most = float(np.min(np.where(along > 0.0, room / along, np.inf)))
        return self.centres[one] + min(1.0, 0.999 * most) * step

    def route(self, start: tuple[int, Array], goal: tuple[int, Array]) -> Route | None:
        """Return a short path from a point of one set to a point of another; None if no chain of sets connects them."""
        first, last = start[0], goal[0]
        chain = self._chain(first, last)
        if chain is None:
            return None
        edges = [self._edge[min(a, b), max(a, b)] for a, b in pairwise(chain)]
        points = np.array([start[1], *self.portals[edges], goal[1]])
        return Route(self._tightened(points, chain), np.array(chain, dtype=np.intp))

    @cached_property
    def _edge(self) -> dict[tuple[int, int], int]:
        return {(min(a, b), max(a, b)): index for index, (a, b) in enumerate(self.pairs.tolist())}

    @cached_property
    def _matrix(self) -> Any:
        from scipy import sparse

        solver: Any = sparse
        i, j = self.pairs.T
        length = np.linalg.norm(self.centres[i] - self.portals, axis=1)
        length += np.linalg.norm(self.portals - self.centres[j], axis=1)
        return solver.csr_matrix((np.maximum(length, 1e-300), (i, j)), shape=(len(self), len(self)))

    def _chain(self, first: int, last: int) -> list[int] | None:
        if first == last:
            return [first]
        from scipy.sparse import csgraph

        solver: Any = csgraph
        _, before = solver.dijkstra(self._matrix, directed=False, indices=first, return_predecessors=True)
        chain = [last]
        while chain[-1] != first:
            there = int(before[chain[-1]])
            if there < 0:
                return None
            chain.append(there)
        return chain[::-1]

    def _tightened(self, points: Array, chain: Sequence[int]) -> Array:
        """Return points in the same intersections with a shorter path, as far as the solver succeeds."""
        from scipy import optimize

        solver: Any = optimize
        inner = points[1:-1]
        if not len(inner):
            return points
        meets = list(pairwise(chain))

        def length(x: Array) -> tuple[float, Array]:
            steps = np.diff(np.vstack([points[0], x.reshape(inner.shape), points[-1]]), axis=0)
            sizes = np.sqrt(np.einsum("ij,ij->i", steps, steps) + _SOFT)
            ways = steps / sizes[:, None]
            return float(sizes.sum()), (ways[:-1] - ways[1:]).ravel()

        if len(self.boxes):
            low = np.array([np.maximum(self.boxes[i, 0], self.boxes[j, 0]) for i, j in meets])
            high = np.array([np.minimum(self.boxes[i, 1], self.boxes[j, 1]) for i, j in meets])
            ends = np.column_stack([low.ravel(), high.ravel()])
            found = solver.minimize(length, inner.ravel(), jac=True, method="L-BFGS-B", bounds=ends)
            better = np.clip(found.x.reshape(inner.shape), low, high)
        elif inner.size <= _LARGEST:
            both = [(self.sets[i], self.sets[j]) for i, j in meets]
            sides = [(np.vstack([one[0], two[0]]), np.append(one[1], two[1])) for one, two in both]
            whole = np.zeros((sum(len(b) for _, b in sides), inner.size))
            row, k = 0, inner.shape[1]
            for index, (A, _) in enumerate(sides):
                whole[row : row + len(A), k * index : k * (index + 1)] = A
                row += len(A)
            room = np.concatenate([b for _, b in sides])

            def spared(x: Array) -> Array:
                return room - whole @ x

            def slope(_: Array) -> Array:
                return -whole

            kept: dict[str, Any] = {"type": "ineq", "fun": spared, "jac": slope}
            found = solver.minimize(length, inner.ravel(), jac=True, method="SLSQP", constraints=[kept])
            step = found.x - inner.ravel()
            along, spare = whole @ step, np.maximum(room - whole @ inner.ravel(), 0.0)
            with np.errstate(divide="ignore", invalid="ignore"):
                most = float(np.min(np.where(along > 0.0, spare / along, np.inf), initial=np.inf))
            better = inner + (min(1.0, _INSIDE * most) * step).reshape(inner.shape)
        else:
            return points
        is_better = length(better.ravel())[0] < length(inner.ravel())[0]
        return np.vstack([points[0], better, points[-1]]) if is_better else points


def _extent(A: Array, b: Array) -> Array:
    """Return corners (2, k) of a box around `{A x <= b}`; all of space if a linear program fails."""
    k = A.shape[1]
    low, high = np.full(k, -np.inf), np.full(k, np.inf)
    for j in range(k):
        for sign in (1.0, -1.0):
            found = linear_program(sign * np.eye(k)[j], A, b)
            if found is not None:
                (low if sign > 0.0 else high)[j] = found[j]
    return np.stack([low, high])


def touching(boxes: Array, apart: float = 0.0) -> Indices:
    """Return the pairs (e, 2) of closed boxes (f, 2, k) that touch, or have a distance of at most `apart`.

    Example:
        >>> touching(np.array([[[0.0, 0.0], [1.0, 1.0]], [[1.0, 1.0], [2.0, 2.0]], [[3.0, 0.0], [4.0, 1.0]]])).tolist()
        [[0, 1]]
    """
    if len(boxes) < 2:
        return np.empty((0, 2), dtype=np.intp)
    wide = (boxes[:, 1] - boxes[:, 0]) / np.maximum(np.ptp(boxes.reshape(-1, boxes.shape[2]), axis=0), 1e-300)
    axis = int(np.argmin(np.median(wide, axis=0)))
    order = np.argsort(boxes[:, 0, axis], kind="stable")
    low, high = boxes[order, 0], boxes[order, 1] + apart
    first_edges: Array = low[:, axis]
    last_edges: Array = high[:, axis]
    ends = np.searchsorted(first_edges, last_edges, side="right")
    counts = np.maximum(ends - np.arange(len(order)) - 1, 0)
    found: list[Indices] = []
    start = 0
    while start < len(order):
        stop = max(start + 1, start + int(np.searchsorted(np.cumsum(counts[start:]), _CANDIDATES)))
        rows = np.repeat(np.arange(start, min(stop, len(order))), counts[start:stop])
        first = np.cumsum(counts[start:stop]) - counts[start:stop]
        others = rows + 1 + np.arange(len(rows)) - np.repeat(first, counts[start:stop])
        keep = np.ones(len(rows), dtype=np.bool_)
        for j in range(boxes.shape[2]):
            rows, others = rows[keep], others[keep]
            keep = (low[others, j] <= high[rows, j]) & (low[rows, j] <= high[others, j])
        found.append(np.sort(np.column_stack([order[rows[keep]], order[others[keep]]]), axis=1))
        start = stop
    return np.concatenate(found).astype(np.intp)


def connected(boxes: Array, starts: Flags, goals: Flags, apart: float) -> bool:
    """Return whether a chain of boxes that touch, or are at most `apart`, leads from `starts` to `goals`."""
    label = components(boxes, apart)
    return bool(np.intersect1d(label[starts], label[goals]).size)


def components(boxes: Array, apart: float) -> Indices:
    """Return a component number (f,) for each box: equal if a chain of boxes at most `apart` connects two.

    Example:
        >>> components(np.array([[[0.0], [1.0]], [[3.0], [4.0]], [[1.0], [2.0]]]), 0.0).tolist()
        [0, 1, 0]
    """
    from scipy import sparse
    from scipy.sparse import csgraph

    solver: Any = sparse
    graphs: Any = csgraph
    pairs = touching(boxes, apart)
    ones = np.ones(len(pairs))
    matrix: Any = solver.csr_matrix((ones, (pairs[:, 0], pairs[:, 1])), shape=(len(boxes), len(boxes)))
    _, label = graphs.connected_components(matrix, directed=False)
    return label.astype(np.intp)
