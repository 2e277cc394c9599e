"""Pairs of balls that are proven never to meet: `free` skips them.

There are few rotations between the nodes of two balls, often one or two. If the last rotation belongs to the ball's own
node, the ball moves on an arc, and the distance of a point from an arc has a closed form. The angles of the other
rotations are covered by cells. From the middle of a cell to its corner the distance changes by at most the sum of
half-widths times lever arms. So the distance in the middle minus this sum is a lower bound for the whole cell
(`docs/kernel.md`). A pair that is proven in all cells is dropped. Other pairs are examined only if a lane is in a cell
in which the pair is not proven.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from pinbound.geometry.rotations import rotate
from pinbound.kernel.balls import BallTree
from pinbound.tolerances import STAYS_APART
from pinbound.typing import Array, Flags, Ints

__all__ = ["Window", "meeting", "with_pairs"]

_CELLS = {0: 1, 1: 256, 2: 64}
"""Largest number of cells of each angle, by the number of angles with cells; with more angles, nothing is proven."""

_DISTANCES = 1 << 18
"""Largest number of distances for one group of pairs: some 10 ms. Groups of many pairs have fewer cells."""

_ROUNDED = 4e-6
"""rad: the largest error of an angle within one turn in float32, and so of its cell: about ten times 2^-24 of 2 pi."""

_NUMBERS = 1 << 16
"""Number of distances at a time: as many as fit L2."""


@dataclass(frozen=True)
class _Turn:
    """One rotation between two nodes.

    Attributes:
        node: The node of this rotation.
        half: Half of its range of angles, pi for a full turn [rad].
        middle: Middle of the range [rad].
    """

    node: int
    half: float
    middle: float


@dataclass(frozen=True, eq=False)
class Window:
    """The cells of one or two angles in which each pair of two nodes may meet.

    Attributes:
        angles: Numbers of the angles.
        middles: Middle of the range of each [rad].
        halves: Half of each range [rad].
        counts: Number of cells of each.
        pairs: (k,) numbers of the pairs.
        near: (k, cells) whether a pair is not proven to stay apart there; cells of the last angle are next to each
            other.
    """

    angles: tuple[int, ...]
    middles: tuple[float, ...]
    halves: tuple[float, ...]
    counts: tuple[int, ...]
    pairs: Ints
    near: Flags

    @classmethod
    def of(cls, walk: Sequence[tuple[int, _Turn]], pairs: Ints, near: Flags) -> Window:
        """Return the window from results in the cells of some angles, with the same number of cells for each."""
        count = round(near.shape[1] ** (1.0 / len(walk)))
        return cls(
            tuple(angle for angle, _ in walk),
            tuple(turn.middle for _, turn in walk),
            tuple(turn.half for _, turn in walk),
            (count,) * len(walk),
            pairs,
            near,
        )

    def of_kept(self, kept: Flags) -> Window:
        """Return the window with the numbers that its pairs have among the kept pairs (m,)."""
        mine = kept[self.pairs]
        return replace(self, pairs=(np.cumsum(kept) - 1)[self.pairs[mine]], near=self.near[mine])

    def near_any(self, pairs: Sequence[int]) -> Flags:
        """Return in which cells any of some pairs may meet; pairs that it does not contain may meet in all cells."""
        places = {number: i for i, number in enumerate(self.pairs.tolist())}
        if any(number not in places for number in pairs):
            return np.ones(len(self.near.T), dtype=np.bool_)
        return np.any(self.near[[places[number] for number in pairs]], axis=0)

    def cells(self, tree: BallTree, Q: Array) -> Ints:
        """Return the cell (N,) of each row of Q (N, n) within the limits."""
        found = np.zeros(len(Q), dtype=np.int64)
        for angle, middle, half, count in zip(self.angles, self.middles, self.halves, self.counts, strict=True):
            place = (_wrapped(Q @ np.array(tree.angles[angle]) - middle) + half) * (count / (2.0 * half))
            found = found * count + np.clip(place.astype(np.int64), 0, count - 1)
        return found


def meeting(tree: BallTree, low: Array, high: Array) -> tuple[Flags, dict[tuple[int, int], Window]]:
    """Return which pairs (m,) are not proven to stay apart for all `low <= q <= high`, and windows by both nodes.

    A pair that is proven has a distance above its threshold by `STAYS_APART` times the longest chain at least. Ends
    (n,) may be infinite: all angles are between them.
    """
    found, windows = np.ones(len(tree.ends), dtype=np.bool_), dict[tuple[int, int], Window]()
    groups: dict[tuple[int, int], list[tuple[int, int, int]]] = {}
    for number, (a, b) in enumerate(cast(list[list[int]], tree.ends.tolist())):
        ends = (tree.balls[a][0], a), (tree.balls[b][0], b)
        (first, x), (last, y) = sorted(ends)  # a node comes after the one above it: the last one rotates
        if abs(tree.nodes[first].depth - tree.nodes[last].depth) > max(_CELLS) + 1:
            continue
        groups.setdefault((first, last), []).append((number, x, y))
    for (first, last), pairs in groups.items():
        above, below = tree.apart(first, last)
        if not below or any(tree.nodes[i].slides for i in (*above, *below)):
            continue
        turns = {i: _turn(tree, i, low, high) for i in (*above, *below) if tree.nodes[i].angle >= 0}
        if last not in turns or len(turns) - 1 not in _CELLS:
            continue
        numbers = np.array([number for number, _, _ in pairs])
        xs, ys = (list(dict.fromkeys(pair[side] for pair in pairs)) for side in (1, 2))
        gaps, walk = _gaps(tree, (above, below[::-1]), turns, (xs, ys))
        gaps = gaps[[xs.index(x) for _, x, _ in pairs], [ys.index(y) for _, _, y in pairs]]
        near = gaps <= tree.thresholds[numbers, None] + STAYS_APART * max(tree.scale, 1.0)
        found[numbers] = near.any(axis=1)
        if walk:
            windows[first, last] = Window.of([(tree.nodes[i].angle, turns[i]) for i in walk], numbers, near)
    return found, windows


def with_pairs(tree: BallTree, kept: Flags) -> BallTree:
    """Return a tree with the same nodes and some of the pairs, and the balls of these."""
    ends = tree.ends[kept]
    balls = np.flatnonzero(np.bincount(ends.ravel()))  # `np.unique` would import masked arrays, which takes 10 ms
    return replace(
        tree,
        balls=[tree.balls[ball] for ball in balls.tolist()],
        ends=np.searchsorted(balls, ends),
        thresholds=tree.thresholds[kept],
    )


def _turn(tree: BallTree, number: int, low: Array, high: Array) -> _Turn:
    """Return the range of a node's angle for all q."""
    c = np.array(tree.angles[tree.nodes[number].angle])
    used = c != 0.0
    ends = np.stack((c[used] * low[used], c[used] * high[used]))
    least, most = float(ends.min(axis=0).sum()), float(ends.max(axis=0).sum())
    half = 0.5 * (most - least) + 1e-9  # far above the rounding of an angle
    if not half < np.pi - 1e-4:  # a full turn, which closes: the cells cover it completely
        return _Turn(number, np.pi, 0.0)
    return _Turn(number, half, 0.5 * (least + most))


def _gaps(
    tree: BallTree,
    ways: tuple[Sequence[int], Sequence[int]],
    turns: dict[int, _Turn],
    balls: tuple[list[int], list[int]],
) -> tuple[Array, list[int]]:
    """Return lower bounds (k, l, cells) of distances of balls on two nodes [m], and the nodes whose angles have cells.

    Args:
        tree: The tree of the balls.
        ways: The nodes from the first node up to where both chains meet, and from there down to the last.
        turns: The rotations of these nodes.
        balls: The balls of the first node, and of the last.
    """
    (up, down), last = ways, ways[1][-1]
    x, y = (np.array([tree.balls[ball][1] for ball in some]).reshape(-1, 3) for some in balls)
    walk = [number for number in (*up, *down[:-1]) if number in turns]
    levers = _levers(tree, ways, walk, (x, y))
    count = _CELLS[len(walk)]
    if walk:
        count = max(1, min(count, int((_DISTANCES / (len(x) * len(y))) ** (1.0 / len(walk)))))
    grids = np.meshgrid(*(np.arange(count) + 0.5 for _ in walk), indexing="ij")
    angles = {
        number: turns[number].middle + turns[number].half * (2.0 * grid.ravel() / count - 1.0)
        for number, grid in zip(walk, grids, strict=True)
    }
    slack = np.zeros((len(x), len(y)))
    for number in walk:
        slack += levers[number] * (turns[number].half / count + _ROUNDED)
    axis = tree.nodes[last].axis
    along, across, phase = _about(axis, y)
    cells = count ** len(walk)
    gaps = np.empty((len(x), len(y), cells))
    step = max(1, _NUMBERS // max(1, len(x) * len(y)))
    for start in range(0, cells, step):
        some = {number: values[start : start + step] for number, values in angles.items()}
        place = np.broadcast_to(x[:, :, None], (*x.shape, min(step, cells - start)))
        for number in up:
            place = _turned(tree, number, place, some, 1.0) + tree.nodes[number].step[:, None]
        for number in down[:-1]:
            place = _turned(tree, number, place - tree.nodes[number].step[:, None], some, -1.0)
        place = np.moveaxis(place - tree.nodes[last].step[:, None], 1, 2)
        h, s, angle = _about(axis, place)  # (k, cells) each
        away = np.abs(_wrapped(angle[:, None] - phase[:, None] - turns[last].middle))
        away = np.maximum(away - turns[last].half, 0.0)
        height, gap = h[:, None] - along[:, None], s[:, None] - across[:, None]
        squares = height**2 + gap**2 + 4.0 * s[:, None] * across[:, None] * np.sin(0.5 * away) ** 2
        gaps[:, :, start : start + step] = np.sqrt(squares)
    return gaps - slack[:, :, None], walk


def _levers(
    tree: BallTree, ways: tuple[Sequence[int], Sequence[int]], walk: Sequence[int], balls: tuple[Array, Array]
) -> dict[int, Array]:
    """Return bounds of the change of a distance with each angle (k, l) [m/rad], by the node of the rotation.

    With u the unit vector between the balls, it is `u . (w x (x - P))`. Because u is along x - y, it is also `u . (w x
    (y - P))`. So the distance of either ball from the axis bounds it.
    """
    (up, down), (x, y) = ways, balls
    far = dict[int, Array]()
    steps = {number: float(np.linalg.norm(tree.nodes[number].step)) for number in (*up, *down)}
    lengths = [np.linalg.norm(some, axis=1) for some in (x, y)]
    for number in walk:
        node = tree.nodes[number]
        if number in up:
            place = up.index(number)
            first = _about(node.axis, x)[1] if not place else lengths[0] + sum(steps[i] for i in up[:place])
            other = sum(steps[i] for i in (*up[place:], *down)) + lengths[1]
        else:
            place = down.index(number)
            if not up and not place:
                first = _about(node.axis, x - node.step)[1]
            else:
                first = lengths[0] + sum(steps[i] for i in (*up, *down[: place + 1]))
            other = sum(steps[i] for i in down[place + 1 :]) + lengths[1]
        far[number] = np.minimum(first[:, None], other[None])
    return far


def _about(axis: Array, x: Array) -> tuple[Array, Array, Array]:
    """Return height, distance and angle of points (..., 3) about an axis through the origin."""
    e = np.eye(3)[int(np.argmin(np.abs(axis)))]
    e = e - axis * (axis @ e)
    e /= np.linalg.norm(e)
    a, b = x @ e, x @ np.cross(axis, e)
    return x @ axis, np.hypot(a, b), np.arctan2(b, a)


def _wrapped(angle: Array) -> Array:
    return angle - 2.0 * np.pi * np.round(angle / (2.0 * np.pi))


def _turned(tree: BallTree, number: int, x: Array, angles: dict[int, Array], sign: float) -> Array:
    """Return points (k, 3, cells) rotated by a node's rotation, or back."""
    if number not in angles:
        return x
    cos, sin = np.cos(angles[number]), sign * np.sin(angles[number])
    return np.stack(rotate(tree.nodes[number].axis, cos, sin, (x[:, 0], x[:, 1], x[:, 2])), axis=1)
