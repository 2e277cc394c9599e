"""A tree of balls as the array that its machine code reads, and the call of that code.

`machine/ball_source.py` is one text for all robots, and names what it reads, in this order and in these units.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, cast

import numpy as np

from pinbound.kernel.balls import BallTree, Cluster, PairOfClusters
from pinbound.machine.ball_source import CLUSTERS, GROUP, HEAD, NODE, ball_source
from pinbound.machine.compiled import KernelSource, MachineCode, compile_source, vector_bytes
from pinbound.typing import AnyArray, Array

__all__ = ["BallTables", "balls_code", "balls_source", "reach_of", "single_error"]

_SINGLE = 2.0**-24
"""Unit roundoff of float32."""

_ERRORS = 80.0
"""Unit roundoffs, relative to the reach of a tree, for each of its depths and one more; derived in `docs/kernel.md`."""

_SQUARES = 100.0
"""Unit roundoffs, relative to the square of a tree's reach: what `|a|^2 + |b|^2 - 2 a . b` and a square lose."""

_FEW = 2
"""Pairs of a group that cost less than the test whether the group can be left out."""

_WORDS = 8
"""Numbers of float64 in a cache line, to which vectors are laid."""


def _lanes(mode: str) -> int:
    return max(8, vector_bytes() // 4) if mode == "free" else 8


@cache
def balls_source(mode: str) -> KernelSource:
    """Return the source of a mode of `ball_source` for this processor."""
    return ball_source(mode, _lanes(mode))


@cache
def balls_code(mode: str) -> MachineCode:
    """Compile or load it."""
    return compile_source(balls_source(mode))


def reach_of(tree: BallTree, most: Array) -> float:
    """Return how far a ball may be from the root, for |q_j| up to `most` (n,) [m]."""
    return tree.scale + float(tree.rates @ np.where(tree.rates > 0.0, most, 0.0))


def single_error(tree: BallTree, most: Array) -> float:
    """Return how far float32 may place a ball from where it is, for |q_j| up to `most` (n,) [m]."""
    depth = max(node.depth for node in tree.nodes)
    return _ERRORS * _SINGLE * (depth + 1) * reach_of(tree, most)


class _Writer:
    """Numbers of several kinds in one array of float64."""

    def __init__(self) -> None:
        self.parts: list[Array] = []
        self.words = 0
        self.ints(np.zeros(len(HEAD), dtype=np.int32))

    def put(self, array: AnyArray) -> int:
        """Lay an array down, and return its place in words."""
        text = np.ascontiguousarray(array).tobytes()
        words = np.frombuffer(text + bytes(-len(text) % (8 * _WORDS)), dtype=np.float64)
        self.parts.append(words)
        self.words += len(words)
        return self.words - len(words)

    def ints(self, values: Any) -> int:
        return 2 * self.put(np.array(values, dtype=np.int32).ravel())

    def doubles(self, values: Any) -> int:
        return self.put(np.array(values, dtype=np.float64).ravel())

    def singles(self, values: Any) -> int:
        return 2 * self.put(np.array(values, dtype=np.float32).ravel())


@dataclass(eq=False)
class BallTables:
    """What the machine code of a mode reads of a tree.

    Attributes:
        mode: ``"free"``, ``"least"``, ``"all"`` or ``"slopes"``, as for `ball_source`.
        numbers: Head, tables and room to work in.
        lower: Where the lower ends of the coordinates stand.
        upper: Where the upper ends stand.
        less: Where what is taken off the norms stands, in the mode ``"all"``.
        places: Of names at the head.
    """

    mode: str
    numbers: Array
    places: dict[str, int]

    def run(
        self,
        Q: Array,
        out: Array,
        index: AnyArray,
        limits: tuple[Array, Array] | None = None,
        less: Array | None = None,
        with_index: bool = False,
    ) -> int:
        """Fill rows and return how many blocks hold numbers that are not finite, or not sure in sign.

        Args:
            Q: (N, n), C-contiguous.
            out: (N, columns), in the mode ``"free"`` not used.
            index: (N,) integers; in the mode ``"free"`` one a block, as `ball_source` says.
            limits: Ends of all coordinates, in the mode ``"free"``.
            less: (m,) what is taken off the norms, in the mode ``"all"``.
            with_index: Whether `index` is written, in the mode ``"least"``.
        """
        code, lanes = balls_code(self.mode), _lanes(self.mode)
        space = np.empty(len(self.numbers) + _WORDS)
        start = -(space.__array_interface__["data"][0] // 8) % _WORDS
        s = space[start : start + len(self.numbers)]
        s[:] = self.numbers
        head = s[: len(HEAD)].view(np.int32)
        head[HEAD.index("with_index")] = with_index
        for name, ends in zip(("lower", "upper"), limits or (), strict=False):
            s[self.places[name] :][: Q.shape[1]] = ends
        if less is not None:
            s[self.places["less"] :][: len(less)] = less
        whole = len(Q) // lanes * lanes
        found = self._call(code, s, Q[:whole], out[:whole], index) if whole else 0
        rest = len(Q) - whole
        if rest:
            rows = np.repeat(Q[-1:], lanes, axis=0)
            rows[:rest] = Q[whole:]
            to, places = np.empty((lanes, out.shape[1])), np.zeros(lanes, dtype=np.int64)
            found += self._call(code, s, rows, to, places)
            if self.mode == "free":
                index[whole // lanes :] = places[:1]
            else:
                out[whole:] = to[:rest]
                if with_index:
                    index[whole:] = places[:rest]
        return found

    def _call(self, code: MachineCode, s: Array, Q: Array, out: Array, index: AnyArray) -> int:
        row, column = (step // out.itemsize for step in out.strides)
        addresses = [array.__array_interface__["data"][0] for array in (Q, out, index, s)]
        return code.function(*addresses[:2], row, column, *addresses[2:], len(Q))

    @classmethod
    def of(cls, tree: BallTree, mode: str, most: Array, sure: float) -> BallTables:
        """Write the tables.

        Args:
            tree: The balls.
            mode: Of `ball_source`.
            most: (n,) the largest |q_j| of a row that is no case of its own.
            sure: Up to which size a sign is not sure in float64 [m].
        """
        return cls(mode, *_written(tree, mode, most, sure))


def _written(tree: BallTree, mode: str, most: Array, sure: float) -> tuple[Array, dict[str, int]]:
    lanes, writer = _lanes(mode), _Writer()
    placed = writer.singles if mode == "free" else writer.doubles  # nodes
    looked = writer.doubles if mode in ("all", "slopes") else writer.singles  # balls
    reach = reach_of(tree, most)
    error = 2.0 * single_error(tree, most) + sure
    head: dict[str, int] = dict.fromkeys(HEAD, 0)
    head |= {"n": tree.n, "angle_count": len(tree.angles), "node_count": len(tree.nodes)}
    terms = [np.flatnonzero(angle) for angle in tree.angles]
    ends = np.cumsum([0, *(len(which) for which in terms)])
    head["angles"] = writer.ints(np.column_stack((ends[:-1], ends[1:])))
    head["slots"] = writer.ints(np.concatenate([*terms, [0]]))
    factors = [np.array(angle)[which] for angle, which in zip(tree.angles, terms, strict=True)]
    head["factors"] = writer.doubles(np.concatenate([*factors, [0.0]]))
    head["shelf"] = writer.doubles(np.zeros(lanes * tree.n))
    head["most"] = writer.doubles(np.square(most))
    head["lower"] = writer.doubles(np.full(tree.n, -np.inf))
    head["upper"] = writer.doubles(np.full(tree.n, np.inf))
    head["trig"] = placed(np.zeros(2 * lanes * len(tree.angles)))
    state = np.zeros((len(tree.nodes), 12, lanes))
    state[0, [0, 5, 10]] = 1.0  # the root
    head["state"], head["single_state"] = placed(state), writer.singles(state) if mode == "least" else 0
    _nodes(writer, placed, tree, lanes, head)
    clusters, bodies = tree.clusters, tree.bodies
    order = [ball for cluster in clusters for ball in cluster.balls]
    points = [(one.node, one.middle) for one in (*bodies, *clusters)] + [tree.balls[ball] for ball in order]
    head["locals"] = looked([x for _, x in points])
    head["spots"] = looked(np.zeros(4 * lanes * len(points)))
    if mode == "least":
        head["hosts"] = writer.ints([node for node, _ in points])
        head["exact"] = writer.doubles([x for _, x in points])
    _sets(writer, bodies, clusters, head)
    head["spare"] = writer.doubles(np.zeros(2 * lanes))
    first = head["spots"] + 4 * lanes * (len(bodies) + len(clusters))
    spot = {ball: first + 4 * lanes * place for place, ball in enumerate(order)}
    head["body_count"], head["pair_count"] = len(bodies), len(tree.ends)
    head["bounds"] = writer.doubles([sure**2])
    if mode in ("all", "slopes"):
        head["pairs"] = writer.ints([[spot[a], spot[b]] for a, b in tree.ends.tolist()])
        head["less"] = writer.doubles(tree.thresholds)
        if mode == "slopes":
            _walks(writer, tree, head)
    else:
        _groups(writer, tree, mode, (bodies, clusters, spot), (error, 4 * lanes), head)
        head["slack"] = writer.singles([_up(_SQUARES * _SINGLE * reach**2)])
    if mode == "free":
        t = tree.thresholds
        worst = np.max(2.0 * t * error + error**2 + 32.0 * _SINGLE * t**2, initial=0.0)
        head["bounds"] = writer.singles([_up(worst + _SQUARES * _SINGLE * reach**2)])
    numbers = np.concatenate(writer.parts)
    numbers[: len(HEAD)].view(np.int32)[: len(HEAD)] = [head[name] for name in HEAD]
    return numbers, head


def _walks(writer: _Writer, tree: BallTree, head: dict[str, int]) -> None:
    """Write for each pair the nodes above its first ball alone, then those above its second one alone."""
    walks, ends, both = list[int](), [0], cast(list[list[int]], tree.ends.tolist())
    for a, b in both:
        for alone in tree.apart(tree.balls[a][0], tree.balls[b][0]):
            walks += alone
            ends.append(len(walks))
    head["walks"] = writer.ints([*(len(ends) + end for end in ends), *walks])
    head["turned"] = writer.doubles(np.zeros(24 * len(tree.nodes)))
    head["slopes"] = writer.doubles(np.zeros(8 * tree.n))


def _up(value: Any) -> float:
    """Return a bound that stays one in float32."""
    return float(np.nextafter(np.float32(value), np.float32(np.inf))) * (1.0 + 1e-6)


def _nodes(writer: _Writer, placed: Callable[[Any], int], tree: BallTree, lanes: int, head: dict[str, int]) -> None:
    """Write the nodes; a rotation about a coordinate axis turns two columns and leaves one."""
    rows, steps, slides, ways = list[list[int]](), list[list[float]](), list[int](), list[tuple[float, ...]]()
    for node in tree.nodes:
        axis = np.flatnonzero(node.axis)
        numbers = [*node.step.tolist(), *node.axis.tolist()]
        columns = [-1, 0, 0]
        if node.angle >= 0 and len(axis) == 1:
            kept = int(axis[0])
            columns = [lanes * kept, lanes * ((kept + 1) % 3), lanes * ((kept + 2) % 3)]
            numbers[3] = float(node.axis[kept])
        start = len(slides)
        slides += [j for j, _ in node.slides]
        ways += [way for _, way in node.slides]
        rows.append([node.above, node.angle, *columns, start, len(slides)])
        steps.append(numbers)
    head["nodes"], head["steps"] = writer.ints(np.array(rows).reshape(-1, NODE)), placed(steps)
    head["slides"], head["ways"] = writer.ints([*slides, 0]), placed([*ways, (0.0, 0.0, 0.0)])


def _sets(writer: _Writer, bodies: Sequence[Cluster], clusters: Sequence[Cluster], head: dict[str, int]) -> None:
    """Write what is placed together: each body's middle, its clusters' middles, each cluster's balls."""
    rows, at = [[body.node, i, i + 1] for i, body in enumerate(bodies)], len(bodies)
    counts = Counter(cluster.node for cluster in clusters)
    for body in bodies:
        count = counts[body.node]
        rows.append([body.node, at, at + count])
        at += count
    for cluster in clusters:
        rows.append([cluster.node, at, at + len(cluster.balls)])
        at += len(cluster.balls)
    head["set_count"], head["sets"] = len(rows), writer.ints(rows)
    head["stamps"] = writer.ints([0] * len(rows))


def _groups(
    writer: _Writer,
    tree: BallTree,
    mode: str,
    shape: tuple[Sequence[Cluster], Sequence[Cluster], dict[int, int]],
    sizes: tuple[float, int],
    head: dict[str, int],
) -> None:
    """Write groups of pairs of clusters, nearest first, and what their middles must be apart to be left out.

    Args:
        writer: Takes the tables.
        tree: The balls.
        mode: Of `ball_source`.
        shape: Bodies, clusters, and the spot of each ball.
        sizes: How far float32 may be off [m], and the numbers of a spot.
        head: Takes their places.
    """
    (bodies, clusters, spot), (error, width) = shape, sizes
    body_of = {ball: i for i, body in enumerate(bodies) for ball in body.balls}
    apart, count = _apart(tree, [*bodies, *clusters]), len(bodies)
    groups = dict[tuple[int, int], list[PairOfClusters]]()
    for one in tree.pairs_of(clusters):
        first, last = (body_of[clusters[i].balls[0]] for i in (one.first, one.last))
        groups.setdefault((first, last), []).append(one)

    def reach(a: Cluster, b: Cluster, threshold: float) -> float:
        return a.radius + b.radius + threshold

    def part_gap(one: PairOfClusters) -> float:
        wide = reach(clusters[one.first], clusters[one.last], one.threshold)
        return apart(count + one.first, count + one.last) - wide

    def gap(key: tuple[int, int]) -> float:
        wide = reach(bodies[key[0]], bodies[key[1]], max(one.threshold for one in groups[key]))
        return apart(*key) - wide

    def far(wide: float, always: bool) -> float:
        """Return what lets a group out; the least clearance so far is added to it, and may be anything."""
        if mode == "free":
            return np.inf if always else _up((wide + 2.0 * error) ** 2 * (1.0 + 16.0 * _SINGLE))
        return 1e15 if always else _up((wide + 3.0 * error) * (1.0 + 16.0 * _SINGLE))

    table = _Rows([], [], [], [], [], [])
    for a, b in sorted(groups, key=gap):
        parts = sorted(groups[a, b], key=part_gap)
        few = sum(len(one.pairs) for one in parts) <= _FEW
        table.far.append(far(reach(bodies[a], bodies[b], max(one.threshold for one in parts)), few))
        start = len(table.clusters)
        for one in parts:
            first = len(table.rows)
            table.add(tree, one, set(clusters[one.first].balls), spot, width)
            wide = reach(clusters[one.first], clusters[one.last], one.threshold)
            table.pairs_far.append(far(wide, len(parts) == 1 or len(one.pairs) <= _FEW))
            sets = [2 * count + one.first, 2 * count + one.last]
            table.clusters.append([count + one.first, count + one.last, first, len(table.rows), *sets])
        table.groups.append([a, b, start, len(table.clusters), count + a, count + b])
    head["group_count"] = len(table.groups)
    head["groups"] = writer.ints(np.array(table.groups).reshape(-1, GROUP))
    head["clusters"] = writer.ints(np.array(table.clusters).reshape(-1, CLUSTERS))
    head["far"], head["pairs_far"] = writer.singles([*table.far, 0.0]), writer.singles([*table.pairs_far, 0.0])
    head["rows"] = writer.ints(table.rows)
    less = tree.thresholds[table.numbers]
    if mode == "free":
        head["squares"] = writer.singles(np.square(less))
        return
    head["squares"] = writer.singles([_up(value + 2.0 * error + 8.0 * _SINGLE * tree.scale) for value in less])
    head["less"], head["numbers"] = writer.doubles(less), writer.doubles(table.numbers)


@dataclass
class _Rows:
    """Groups, pairs of clusters and rows of balls while they are written."""

    groups: list[list[int]]
    clusters: list[list[int]]
    rows: list[list[int]]
    numbers: list[int]
    far: list[float]
    pairs_far: list[float]

    def add(self, tree: BallTree, one: PairOfClusters, inside: set[int], spot: dict[int, int], width: int) -> None:
        """Write the rows of a pair of clusters: a ball and others whose spots are one after the other."""
        by_ball = dict[int, list[tuple[int, int]]]()
        for number in one.pairs:
            x, y = tree.ends[number].tolist()
            x, y = (x, y) if x in inside else (y, x)
            by_ball.setdefault(x, []).append((spot[y], number))
        for x, others in by_ball.items():
            last = -1
            for place, number in sorted(others):
                if last < 0 or place != last + width:
                    self.rows.append([spot[x], place, len(self.numbers), len(self.numbers)])
                self.numbers.append(number)
                self.rows[-1][3] += 1
                last = place


def _apart(tree: BallTree, clusters: Sequence[Cluster]) -> Callable[[int, int], float]:
    """Return a function of two clusters: the mean distance of their middles over some configurations."""
    Q = np.random.default_rng(0).uniform(-np.pi, np.pi, (16, tree.n))
    places = tree.places(Q, [(one.node, one.middle) for one in clusters])

    def mean(a: int, b: int) -> float:
        return float(np.linalg.norm(places[a] - places[b], axis=0).mean())

    return mean
