"""Many spheres on few links as tables: nodes of rotations, balls on nodes, clusters of balls, pairs of clusters.

A ball is a marked point; the distance that its pair must keep is the pair's threshold. All chains start at the root, so
that they share their beginnings. Each rotation is a *node*, placed once for each configuration, `W = W_above R`, `P =
P_above + W_above (b + L q)`, and a ball is `P + W x`. The balls of one node are a body. Bodies are divided into
clusters of a few balls. If the enclosing balls of two clusters are further apart than the largest threshold of their
pairs, all these pairs are skipped.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, cast

import numpy as np

from pinbound.kernel.program import CommonMark, Pair
from pinbound.kernel.spheres import middle_of
from pinbound.path.shared import Spot, Step
from pinbound.tolerances import KERNEL_CONSTANT, REDUCTION
from pinbound.typing import Array, Ints

__all__ = ["BallTree", "Cluster", "Node", "PairOfClusters", "tree_of"]

_CLUSTER = 8
"""Largest number of balls of a cluster: the test of a cluster costs as much as one pair."""

_PAIRS = 256
"""Number of pairs whose gradients NumPy computes together."""

_NUMPY_BYTES = 1 << 20
"""Memory of one block of rows in NumPy, for slopes: as much as fits L2."""

_PART_BYTES = 1 << 17
"""Memory of the differences that NumPy computes together: as much as stays in L2 with all balls."""

_ROWS = 512
"""Configurations of one block in NumPy: with fewer, a call costs more than its numbers."""

_FEW_ROWS = 64
"""With fewer rows, a call for each pair costs more than a copy of its two positions."""


@dataclass(frozen=True)
class Node:
    """A constant step and a prismatic displacement, then a rotation.

    Attributes:
        above: The node above it.
        step: (3,) [m].
        slides: Coordinates of prismatic joints and their directions.
        angle: The number of its angle; -1 without a rotation.
        axis: (3,) unit vector.
        depth: Number of rotations down to it.
        reach: Largest distance from the root, without prismatic displacements [m].
    """

    above: int
    step: Array
    slides: tuple[tuple[int, tuple[float, ...]], ...]
    angle: int
    axis: Array
    depth: int
    reach: float


@dataclass(frozen=True)
class Cluster:
    """Some balls of one node, and a ball around all their centres.

    Attributes:
        node: The node.
        balls: Their numbers.
        middle: (3,) its centre on the node [m].
        radius: [m].
    """

    node: int
    balls: tuple[int, ...]
    middle: Array
    radius: float


@dataclass(frozen=True)
class PairOfClusters:
    """Two clusters, and the pairs of their balls.

    Attributes:
        first: One cluster.
        last: The other.
        pairs: Numbers of the pairs.
        threshold: Their largest threshold [m].
    """

    first: int
    last: int
    pairs: tuple[int, ...]
    threshold: float


@dataclass
class BallTree:
    """Balls and pairs of one set.

    Attributes:
        n: Number of coordinates.
        angles: Coefficients of each angle.
        nodes: The nodes; the first is the root.
        balls: Node of each ball, and its position on it.
        ends: (m, 2) the balls of each pair.
        thresholds: (m,) [m].
        scale: Length of the longest chain [m].
    """

    n: int
    angles: list[tuple[float, ...]] = field(default_factory=list[tuple[float, ...]])
    nodes: list[Node] = field(default_factory=list[Node])
    balls: list[tuple[int, Array]] = field(default_factory=list[tuple[int, Array]])
    ends: Ints = field(default_factory=lambda: np.empty((0, 2), dtype=np.int64))
    thresholds: Array = field(default_factory=lambda: np.empty(0))
    scale: float = 0.0

    @cached_property
    def coordinates(self) -> tuple[int, ...]:
        """The coordinates that occur."""
        turning = {j for angle in self.angles for j, c in enumerate(angle) if c}
        return tuple(sorted(turning | {j for node in self.nodes for j, _ in node.slides}))

    @cached_property
    def rates(self) -> Array:
        """(n,) the largest displacement of a ball for a unit of each coordinate, by prismatic joints [m]."""
        found = np.zeros((len(self.nodes), self.n))
        for number, node in enumerate(self.nodes):
            found[number] = found[node.above] if number else 0.0
            for j, way in node.slides:
                found[number, j] += float(np.linalg.norm(way))
        return found.max(axis=0, initial=0.0)

    @cached_property
    def turns(self) -> Array:
        """(n,) the sum of all angles' |c_j|."""
        return np.abs(np.array(self.angles).reshape(len(self.angles), self.n)).sum(axis=0)

    @cached_property
    def clusters(self) -> list[Cluster]:
        """All clusters, grouped by node."""
        found: list[Cluster] = []
        for body in self.bodies:
            found += [self._enclosed(body.node, part) for part in _parts(list(body.balls), self._places)]
        return found

    @cached_property
    def bodies(self) -> list[Cluster]:
        """For each node with balls, all of them as one cluster."""
        of_node: dict[int, list[int]] = {}
        for ball, (node, _) in enumerate(self.balls):
            of_node.setdefault(node, []).append(ball)
        return [self._enclosed(node, balls) for node, balls in sorted(of_node.items())]

    @cached_property
    def _places(self) -> Array:
        return np.array([place for _, place in self.balls]).reshape(-1, 3)

    def _enclosed(self, node: int, balls: Sequence[int]) -> Cluster:
        points = self._places[list(balls)]
        middle = middle_of(points)
        radius = float(np.linalg.norm(points - middle, axis=1).max())
        return Cluster(node, tuple(balls), middle, radius * (1.0 + 1e-12))

    def pairs_of(self, clusters: Sequence[Cluster]) -> list[PairOfClusters]:
        """Return all pairs by the clusters of their balls."""
        of_ball = {ball: number for number, cluster in enumerate(clusters) for ball in cluster.balls}
        groups: dict[tuple[int, int], list[int]] = {}
        for number, (a, b) in enumerate(self.ends.tolist()):
            first, last = sorted((of_ball[a], of_ball[b]))
            groups.setdefault((first, last), []).append(number)
        return [
            PairOfClusters(first, last, tuple(pairs), float(self.thresholds[pairs].max()))
            for (first, last), pairs in groups.items()
        ]

    def apart(self, a: int, b: int) -> tuple[list[int], list[int]]:
        """Return the nodes at and above a that are not above b, the last first, and those of b; without the root."""
        alone: tuple[list[int], list[int]] = [], []
        while a != b:  # a node comes after the one above it
            if a > b:
                alone[0].append(a)
                a = self.nodes[a].above
            else:
                alone[1].append(b)
                b = self.nodes[b].above
        return alone

    def slopes(self, Q: Array, out: Any) -> None:
        """Fill `out` (N, m n) with the gradients of all norms, in NumPy; NaN where a norm is zero."""
        m, n = len(self.ends), self.n
        block = max(1, _NUMPY_BYTES // (8 * (12 * len(self.nodes) + 3 * n * len(self.balls))))
        with np.errstate(all="ignore"):
            for start in range(0, len(Q), block):
                rows = slice(start, min(start + block, len(Q)))
                x, moved = self._moved(Q[rows])
                for first in range(0, m, _PAIRS):
                    a, b = self.ends[first : first + _PAIRS].T
                    r = x[a] - x[b]
                    unit = r / np.sqrt(np.einsum("kin,kin->kn", r, r))[:, None]
                    slopes = np.einsum("kin,kijn->nkj", unit, moved[a] - moved[b])
                    out[rows, n * first : n * (first + len(a))] = slopes.reshape(len(slopes), -1)

    def _moved(self, Q: Array) -> tuple[Array, Array]:
        """Return the positions (k, 3, N) of all balls, and their derivatives by each coordinate (k, 3, n, N)."""
        W, P = self._frames(Q)
        x = self._on(W, P, self.balls)
        moved = np.zeros((len(self.balls), 3, self.n, len(Q)))
        of_node: dict[int, list[int]] = {}
        for ball, (node, _) in enumerate(self.balls):
            of_node.setdefault(node, []).append(ball)
        for host, mine in of_node.items():
            number = host
            while number:
                node = self.nodes[number]
                if node.angle >= 0:
                    axis = np.einsum("ijn,j->in", W[number], node.axis)
                    way = np.cross(axis[None], x[mine] - P[number], axis=1)
                    for j in np.flatnonzero(self.angles[node.angle]).tolist():
                        moved[mine, :, j] += self.angles[node.angle][j] * way
                for j, along in node.slides:
                    moved[mine, :, j] += np.einsum("ijn,j->in", W[node.above], np.array(along))
                number = node.above
        return x, moved

    def clearances(self, Q: Array, out: Any, thresholds: Array) -> None:
        """Fill `out` (N, m) with all norms minus thresholds, in NumPy."""

        def take(rows: slice, found: Array) -> None:
            out[rows] = found.T

        self.each_block(Q, thresholds, take)

    def each_block(self, Q: Array, thresholds: Array, take: Callable[[slice, Array], None]) -> None:
        """Call `take(rows, found)` for each block of rows, with all norms minus thresholds (m, rows)."""
        block = min(len(Q), _ROWS)
        part = max(1, min(len(self.ends), _PART_BYTES // (8 * 3 * max(1, block))))  # pairs at a time
        all_found, apart = np.empty(len(self.ends) * block), np.empty(3 * part * block)
        ends = cast(list[list[int]], self.ends.tolist())
        with np.errstate(all="ignore"):
            for start in range(0, len(Q), _ROWS):
                rows = slice(start, min(start + _ROWS, len(Q)))
                x, count = self.places(Q[rows]), rows.stop - start
                found = all_found[: len(ends) * count].reshape(-1, count)
                for first in range(0, len(ends), part):
                    some, squares = ends[first : first + part], found[first : first + part]
                    r = apart[: 3 * len(some) * count].reshape(-1, 3, count)
                    if count < _FEW_ROWS:
                        a, b = self.ends[first : first + part].T
                        np.subtract(x[a], x[b], out=r)
                    else:  # without a copy of both positions
                        for (i, j), difference in zip(some, r, strict=True):
                            np.subtract(x[i], x[j], out=difference)
                    np.multiply(r, r, out=r)
                    np.add(r[:, 0], r[:, 1], out=squares)
                    np.add(squares, r[:, 2], out=squares)
                    np.sqrt(squares, out=squares)
                    squares -= thresholds[first : first + part, None]
                take(rows, found)

    def places(self, Q: Array, points: Sequence[tuple[int, Array]] | None = None) -> Array:
        """Return positions (k, 3, N) for Q (N, n), in the root's frame, of all balls, or of points on nodes."""
        return self._on(*self._frames(Q), self.balls if points is None else points)

    def _frames(self, Q: Array) -> tuple[Array, Array]:
        """Return the rotations (k, 3, 3, N) and positions (k, 3, N) of all nodes."""
        count = len(Q)
        W, P = np.empty((len(self.nodes), 3, 3, count)), np.empty((len(self.nodes), 3, count))
        turned = [(np.cos(x), np.sin(x)) for x in (Q @ np.array(c) for c in self.angles)]
        W[0], P[0] = np.eye(3)[:, :, None], 0.0
        for number, (node, turn) in enumerate(zip(self.nodes[1:], self._turning[1:], strict=True), 1):
            step = node.step[:, None]
            for j, way in node.slides:
                step = step + np.array(way)[:, None] * Q[:, j]
            up = W[node.above]
            np.add(P[node.above], np.einsum("ijn,jn->in", up, step), out=P[number])
            if turn is None:
                W[number] = up
                continue
            cos, sin = turned[node.angle]
            along, across, cross, kept = turn
            if kept >= 0:  # a coordinate axis: two columns change, one stays
                y, z = (kept + 1) % 3, (kept + 2) % 3
                sin = node.axis[kept] * sin
                W[number, :, kept] = up[:, kept]
                np.add(up[:, y] * cos, up[:, z] * sin, out=W[number, :, y])
                np.subtract(up[:, z] * cos, up[:, y] * sin, out=W[number, :, z])
                continue
            np.einsum("ijn,jkn->ikn", up, along + across * cos + cross * sin, out=W[number])
        return W, P

    @cached_property
    def _turning(self) -> list[tuple[Array, Array, Array, int] | None]:
        """For each rotation: what stays, the parts with cosine and sine, and the coordinate axis if there is one."""
        found = list[tuple[Array, Array, Array, int] | None]()
        for node in self.nodes:
            u, along = node.axis, np.outer(node.axis, node.axis)[:, :, None]
            cross = np.array([[0.0, -u[2], u[1]], [u[2], 0.0, -u[0]], [-u[1], u[0], 0.0]])[:, :, None]
            used = np.flatnonzero(u)
            kept = int(used[0]) if len(used) == 1 else -1
            found.append((along, np.eye(3)[:, :, None] - along, cross, kept) if node.angle >= 0 else None)
        return found

    @staticmethod
    def _on(W: Array, P: Array, points: Sequence[tuple[int, Array]]) -> Array:
        """Return positions (k, 3, N) of points on nodes."""
        x, of_node = np.empty((len(points), 3, W.shape[3])), dict[int, list[int]]()
        for number, (node, _) in enumerate(points):
            of_node.setdefault(node, []).append(number)
        for node, mine in of_node.items():
            x[mine] = P[node] + np.einsum("ijn,bj->bin", W[node], np.array([points[i][1] for i in mine]))
        return x


def _parts(balls: list[int], places: Array) -> list[list[int]]:
    """Divide balls in halves along their longest side, down to clusters."""
    if len(balls) <= _CLUSTER:
        return [balls] if balls else []
    points = places[balls]
    axis = int(np.argmax(np.ptp(points, axis=0)))
    order = [balls[int(i)] for i in np.argsort(points[:, axis], kind="stable")]
    half = len(order) // 2
    return _parts(order[:half], places) + _parts(order[half:], places)


def tree_of(pairs: Sequence[Pair], n: int, common: Mapping[str, CommonMark]) -> BallTree:
    """Return the tree of pairs of points, by where their marks are in the root's frame."""
    builder = _Builder(BallTree(n))
    tree, numbers = builder.tree, dict[str, int]()
    for name in dict.fromkeys(name for pair in pairs for name in pair.marks):
        numbers[name] = len(tree.balls)
        spot = common[name].spot
        assert spot is not None
        tree.balls.append(builder.ball(spot))
    tree.ends = np.array([[numbers[name] for name in pair.marks] for pair in pairs], dtype=np.int64).reshape(-1, 2)
    tree.thresholds = np.array([pair.threshold for pair in pairs])
    tree.scale = max((tree.nodes[node].reach + float(np.linalg.norm(x)) for node, x in tree.balls), default=0.0)
    return tree


class _Builder:
    def __init__(self, tree: BallTree) -> None:
        self.tree = tree
        self.known: dict[object, int] = {}
        self.angles: dict[tuple[tuple[int, float], ...], int] = {}
        self.of_step: dict[int, int] = {}
        tree.nodes.append(Node(0, np.zeros(3), (), -1, np.array([0.0, 0.0, 1.0]), 0, 0.0))

    def ball(self, spot: Spot) -> tuple[int, Array]:
        """Return the node that a point is fixed to, and its place there."""
        steps, step = list[Step](), spot.step
        while step is not None and id(step) not in self.of_step:
            steps.append(step)
            step = step.above
        node = 0 if step is None else self.of_step[id(step)]
        for step in reversed(steps):
            node = self.of_step[id(step)] = self._node(node, step.offset, step.slides, step.axis, step.terms)
        if spot.slides:
            node = self._node(node, np.zeros(3), spot.slides, np.array([0.0, 0.0, 1.0]), None)
        return node, spot.place

    def _node(
        self,
        above: int,
        step: Array,
        slides: Mapping[int, Array],
        axis: Array,
        terms: tuple[tuple[int, float], ...] | None,
    ) -> int:
        tree = self.tree
        ways = tuple((j, tuple(way.tolist())) for j, way in sorted(slides.items()))
        rounded = np.round(axis)
        unit = rounded if np.abs(axis - rounded).max() <= REDUCTION else axis
        key = (above, tuple(step.tolist()), ways, terms, tuple(np.round(unit / KERNEL_CONSTANT).tolist()))
        if key not in self.known:
            turn = -1 if terms is None else self._angle(terms)
            before = tree.nodes[above]
            self.known[key] = len(tree.nodes)
            reach = before.reach + float(np.linalg.norm(step))
            tree.nodes.append(Node(above, step, ways, turn, unit, before.depth + (turn >= 0), reach))
        return self.known[key]

    def _angle(self, terms: tuple[tuple[int, float], ...]) -> int:
        """Return the number of an angle."""
        if terms not in self.angles:
            self.angles[terms] = len(self.tree.angles)
            row = [0.0] * self.tree.n
            for j, c in terms:
                row[j] = c
            self.tree.angles.append(tuple(row))
        return self.angles[terms]
