"""A tree of balls as the array that its machine code reads, and the call of this code.

`machine/ball_source.py` is one text for all robots. It names what it reads, in this order and in these units.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any, cast

import numpy as np

from pinbound.kernel.ball_order import BINS, Keys, Sample
from pinbound.kernel.ball_pruning import Window, meeting, with_pairs
from pinbound.kernel.ball_rows import Rows, mean_distance
from pinbound.kernel.balls import BallTree, Cluster, PairOfClusters
from pinbound.machine.ball_free_source import TILE
from pinbound.machine.ball_source import CLUSTERS, GROUP, HEAD, NODE, WINDOW, ball_source
from pinbound.machine.compiled import KernelSource, MachineCode, compile_source, vector_bytes
from pinbound.typing import AnyArray, Array

__all__ = ["BallTables", "balls_code", "balls_source", "reach_of", "single_error"]

_SINGLE = 2.0**-24
"""Unit roundoff of float32."""

_ERRORS = 80.0
"""Unit roundoffs, relative to the reach of a tree, for each level of depth and one more; see `docs/kernel.md`."""

_SQUARES = 100.0
"""Unit roundoffs, relative to the square of a tree's reach: the error of `|a|^2 + |b|^2 - 2 a . b` and of a square."""

_FEW = 2
"""Groups with at most this many pairs are cheaper than the test that could skip them."""

_MOST_GROUPS = 256
"""Largest number of groups for which an order of rows and groups is learned; it takes 0.1 ms for each."""

_WITH_INDEX = HEAD.index("with_index")

_WORDS = 8
"""Numbers of float64 in a cache line, to which vectors are aligned."""


def _lanes(mode: str) -> int:
    return 16 if mode == "free" and vector_bytes() >= 32 else 8


@cache
def balls_source(mode: str) -> KernelSource:
    """Return the source of a mode of `ball_source` for this processor."""
    return ball_source(mode, _lanes(mode))


@cache
def balls_code(mode: str) -> MachineCode:
    """Compile or load the code."""
    return compile_source(balls_source(mode))


def reach_of(tree: BallTree, most: Array) -> float:
    """Return the largest distance of a ball from the root, for |q_j| up to `most` (n,) [m]."""
    return tree.scale + float(tree.rates @ np.where(tree.rates > 0.0, most, 0.0))


def single_error(tree: BallTree, most: Array) -> float:
    """Return the largest error of a ball's position in float32, for |q_j| up to `most` (n,) [m]."""
    depth = max(node.depth for node in tree.nodes)
    return _ERRORS * _SINGLE * (depth + 1) * reach_of(tree, most)


class _Writer:
    """Numbers of several kinds in one array of float64."""

    def __init__(self) -> None:
        self.parts: list[Array] = []
        self.words = 0
        self.ints(np.zeros(len(HEAD), dtype=np.int32))

    def put(self, array: AnyArray) -> int:
        """Append an array, and return its position in words."""
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
    """The tables of a tree that the machine code of a mode reads.

    Attributes:
        mode: ``"free"``, ``"least"``, ``"all"`` or ``"slopes"``, as for `ball_source`.
        numbers: Head and tables.
        room: Numbers of working memory behind them.
        places: Positions of the named entries of the head.
    """

    mode: str
    numbers: Array
    room: int
    places: dict[str, int]
    _spaces: list[Array] = field(default_factory=list[Array])

    def run(
        self,
        Q: Array,
        out: Array,
        index: AnyArray,
        limits: tuple[Array, Array] | None = None,
        less: Array | None = None,
        with_index: bool = False,
    ) -> int:
        """Fill rows and return the number of blocks with numbers that are not finite, or whose sign is not sure.

        Args:
            Q: (N, n), C-contiguous.
            out: (N, columns), not used in the mode ``"free"``.
            index: (N,) integers; in the mode ``"free"`` one byte each, as `ball_source` describes.
            limits: Ends of all coordinates, in the mode ``"free"``.
            less: (m,) what is subtracted from the norms, in the mode ``"all"``.
            with_index: Whether `index` is written, in the mode ``"least"``.
        """
        code = balls_code(self.mode)
        try:  # memory that no other thread uses now
            s = self._spaces.pop()
        except IndexError:
            s = self._space()
        head = s[: len(HEAD)].view(np.int32)
        head[_WITH_INDEX] = with_index
        for name, ends in zip(("lower", "upper"), limits or (), strict=False):
            s[self.places[name] :][: Q.shape[1]] = ends
        if self.mode == "all":
            at = self.places["less"]
            s[at : at + out.shape[1]] = self.numbers[at : at + out.shape[1]] if less is None else less
        found = self._rows(code, s, (Q, out, index), with_index)
        self._spaces.append(s)
        return found

    def _space(self) -> Array:
        """Return the tables with working memory behind them; simultaneous calls each have their own."""
        space = np.empty(len(self.numbers) + self.room + _WORDS)
        start = -(space.__array_interface__["data"][0] // 8) % _WORDS
        s = space[start : start + len(self.numbers) + self.room]
        s[: len(self.numbers)] = self.numbers
        return s

    def _rows(self, code: MachineCode, s: Array, arrays: tuple[Array, Array, AnyArray], with_index: bool) -> int:
        Q, out, index = arrays
        if self.mode == "free":
            return self._call(code, s, Q, out, index)
        lanes = _lanes(self.mode)
        whole = len(Q) // lanes * lanes
        found = self._call(code, s, Q[:whole], out[:whole], index) if whole else 0
        rest = len(Q) - whole
        if rest:
            rows = np.repeat(Q[-1:], lanes, axis=0)
            rows[:rest] = Q[whole:]
            to, places = np.empty((lanes, out.shape[1])), np.zeros(lanes, dtype=np.int64)
            found += self._call(code, s, rows, to, places)
            out[whole:] = to[:rest]
            if with_index:
                index[whole:] = places[:rest]
        return found

    def _call(self, code: MachineCode, s: Array, Q: Array, out: Array, index: AnyArray) -> int:
        row, column = (step // out.itemsize for step in out.strides)
        addresses = [array.__array_interface__["data"][0] for array in (Q, out, index, s)]
        return code.function(*addresses[:2], row, column, *addresses[2:], len(Q))

    @classmethod
    def of(
        cls, tree: BallTree, mode: str, most: Array, sure: float, limits: tuple[Array, Array] | None = None
    ) -> BallTables:
        """Write the tables.

        Args:
            tree: The balls.
            mode: Of `ball_source`.
            most: (n,) the largest |q_j| of a row that is not a special case.
            sure: The size below which a sign is not sure in float64 [m].
            limits: Ends of all coordinates (n,) each, in the mode ``"free"``. Only pairs that may meet between them are
                examined, so the tables are for these limits or narrower ones; None: without limits.
        """
        sample = None
        if mode == "free":
            low, high = limits or (np.full(tree.n, -np.inf), np.full(tree.n, np.inf))
            kept, windows = meeting(tree, low, high)
            tree = with_pairs(tree, kept)
            windows = {nodes: window.of_kept(kept) for nodes, window in windows.items()}
            sample = Sample(tree, low, high, windows)
        return cls(mode, *_written(tree, mode, most, sure, sample))


def _written(
    tree: BallTree, mode: str, most: Array, sure: float, sample: Sample | None
) -> tuple[Array, int, dict[str, int]]:
    lanes, writer = _lanes(mode), _Writer()
    placed = writer.singles if mode == "free" else writer.doubles  # nodes
    looked = writer.doubles if mode in ("all", "slopes") else writer.singles  # balls
    reach = reach_of(tree, most)
    error = 2.0 * single_error(tree, most) + sure
    head: dict[str, int] = dict.fromkeys(HEAD, 0)
    head |= {"n": tree.n, "angle_count": len(tree.angles), "node_count": len(tree.nodes)}
    _coordinates(writer, placed, tree, (lanes, most), head)
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
        keys = _groups(writer, tree, mode, (bodies, clusters, spot), (error, 4 * lanes), head, sample)
        if keys is not None:
            _sorting(writer, keys, head)
        head["slack"] = writer.singles([_up(_SQUARES * _SINGLE * reach**2)])
    if mode == "free":
        t = tree.thresholds
        worst = np.max(2.0 * t * error + error**2 + 32.0 * _SINGLE * t**2, initial=0.0)
        head["bounds"] = writer.singles([_up(worst + _SQUARES * _SINGLE * reach**2)])
    if mode == "free":
        head["turned_by"] = writer.singles(np.zeros(lanes * max(1, len(tree.angles))))
    numbers = np.concatenate(writer.parts)
    room = 0
    if mode == "free":
        room = _room(tree, lanes, len(numbers), head)
        head["bounded"] = int(sample is not None and sample.is_within(most))
    numbers[: len(HEAD)].view(np.int32)[: len(HEAD)] = [head[name] for name in HEAD]
    return numbers, room, head


def _coordinates(
    writer: _Writer, placed: Callable[[Any], int], tree: BallTree, sizes: tuple[int, Array], head: dict[str, int]
) -> None:
    """Write the angles, and memory for a block's coordinates; sizes: lanes, and the largest |q_j|."""
    lanes, most = sizes
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


def _room(tree: BallTree, lanes: int, start: int, head: dict[str, int]) -> int:
    """Assign positions from `start` on to the lists of `free`, and return how many numbers they take."""
    lists = {"order": TILE + 2 * lanes, "rows_of": TILE + 2 * lanes, "chosen_bin": TILE, "counts": BINS}
    lists |= {"near_groups": head["group_count"] + 2, "near_clusters": len(tree.pairs_of(tree.clusters)) + 2}
    room = 0
    for name, count in lists.items():
        head[name] = 2 * (start + room)
        room += -(-count // 2)
    return room


def _sorting(writer: _Writer, keys: Keys, head: dict[str, int]) -> None:
    """Write the sort keys of rows."""
    head["first"], head["second"] = keys.columns
    head["first_bins"], head["second_bins"] = keys.bins
    head["keys"] = writer.doubles([number for both in zip(keys.lows, keys.scales, strict=True) for number in both])


def _walks(writer: _Writer, tree: BallTree, head: dict[str, int]) -> None:
    """Write for each pair the nodes above only its first ball, then those above only its second one."""
    walks, ends, both = list[int](), [0], cast(list[list[int]], tree.ends.tolist())
    for a, b in both:
        for alone in tree.apart(tree.balls[a][0], tree.balls[b][0]):
            walks += alone
            ends.append(len(walks))
    head["walks"] = writer.ints([*(len(ends) + end for end in ends), *walks])
    head["turned"] = writer.doubles(np.zeros(24 * len(tree.nodes)))
    head["slopes"] = writer.doubles(np.zeros(8 * tree.n))


def _up(value: Any) -> float:
    """Return an upper bound that is still one in float32."""
    return float(np.nextafter(np.float32(value), np.float32(np.inf))) * (1.0 + 1e-6)


def _nodes(writer: _Writer, placed: Callable[[Any], int], tree: BallTree, lanes: int, head: dict[str, int]) -> None:
    """Write the nodes; a rotation about a coordinate axis changes two columns and keeps one."""
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
    """Write the sets that are placed together: each body's middle, its clusters' middles, each cluster's balls."""
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
    sample: Sample | None,
) -> Keys | None:
    """Write groups of pairs of clusters, and the distances beyond which they are skipped; return the sort keys.

    Groups are ordered by distance, the nearest first; or by what they decide for their cost, if there is a sample.

    Args:
        writer: Takes the tables.
        tree: The balls.
        mode: Of `ball_source`.
        shape: Bodies, clusters, and the spot of each ball.
        sizes: The error of float32 [m], and the numbers of a spot.
        head: Gets their positions.
        sample: Rows that give the order, in the mode ``"free"``.
    """
    (bodies, clusters, spot), (error, width) = shape, sizes
    body_of = {ball: i for i, body in enumerate(bodies) for ball in body.balls}
    apart, count = mean_distance(tree, [*bodies, *clusters]), len(bodies)
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
        """Return the distance beyond which a group is skipped; the least clearance so far is added to it."""
        if mode == "free":
            return np.inf if always else _up((wide + 2.0 * error) ** 2 * (1.0 + 16.0 * _SINGLE))
        return 1e15 if always else _up((wide + 3.0 * error) * (1.0 + 16.0 * _SINGLE))

    keys = Keys((0, 0), (1, 1), (0.0, 0.0), (0.0, 0.0)) if mode == "free" else None
    order = sorted(groups, key=gap)
    if sample is not None and 0 < len(groups) <= _MOST_GROUPS:
        decides = {key: sample.decides(*key, groups[key]) for key in order}
        order.sort(key=lambda key: -decides[key])  # equal ones stay nearest first
        keys = sample.keys()
    table = Rows([], [], [], [], [], [], [[0] * WINDOW])
    for a, b in order:
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
        table.groups.append([a, b, start, len(table.clusters), count + a, count + b, 0])
        window = None if sample is None else sample.window(a, b)
        if window is not None and sum(len(one.pairs) for one in parts) > _FEW:
            table.groups[-1][-1] = len(table.windows)
            table.windows.append(_window(writer, window, parts))
    head["group_count"], head["windows"] = len(table.groups), writer.ints(table.windows)
    head["groups"] = writer.ints(np.array(table.groups).reshape(-1, GROUP))
    head["clusters"] = writer.ints(np.array(table.clusters).reshape(-1, CLUSTERS))
    head["far"], head["pairs_far"] = writer.singles([*table.far, 0.0]), writer.singles([*table.pairs_far, 0.0])
    head["rows"] = writer.ints(table.rows)
    less = tree.thresholds[table.numbers]
    if mode == "free":
        head["squares"] = writer.singles(np.square(less))
        return keys
    head["squares"] = writer.singles([_up(value + 2.0 * error + 8.0 * _SINGLE * tree.scale) for value in less])
    head["less"], head["numbers"] = writer.doubles(less), writer.doubles(table.numbers)
    return keys


def _window(writer: _Writer, window: Window, parts: Sequence[PairOfClusters]) -> list[int]:
    """Write one byte for each cell; its bit i stands for the pairs of clusters i, i + 8 and so on."""
    bits = np.zeros(window.near.shape[1], dtype=np.uint8)
    for i, one in enumerate(parts):
        bits |= window.near_any(one.pairs).astype(np.uint8) << np.uint8(i % 8)
    one = len(window.angles) == 1  # as two angles, the second with one cell
    angles, counts = window.angles * (1 + one), (*window.counts, 1)[:2]
    middles, halves = window.middles * (1 + one), window.halves * (1 + one)
    scales = [count / (2.0 * half) for count, half in zip(counts, halves, strict=True)]
    rows = zip(middles, halves, scales, counts, strict=True)
    place = writer.singles([[middle, half, scale, count - 1.0] for middle, half, scale, count in rows])
    return [*angles, *counts, 8 * writer.put(bits), place]
