"""Two trees of straight pieces that grow towards each other through free samples, and the shortening of paths.

Nothing here is a proof: `certify` proves the path, also between the samples.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pinbound.certificates.search import Meter
from pinbound.freespace.faces import limit_faces, outer_box
from pinbound.robot.robot import Robot
from pinbound.typing import Array

__all__ = ["Trees"]

_STEP = 0.05
"""[rad or m], the distance of the samples that a tree tests on a straight piece; `certify` proves the rest."""
_REACH = 1.0
"""[rad or m], the largest growth of a tree in one step."""
_SHORTCUTS = 64


class Trees:
    """Two trees of straight free pieces, from the start and from the goal."""

    def __init__(
        self,
        robot: Robot,
        names: Sequence[str],
        ends: tuple[Array, Array],
        bad: Sequence[Array],
        window: Mapping[str, tuple[float, float]],
        rng: np.random.Generator,
        meter: Meter,
    ) -> None:
        """Store both ends, points with proven contact, and the search range for coordinates without limits."""
        self.robot, self.rng, self.meter = robot, rng, meter
        self.chosen = robot.boundaries.select(names) if names else None
        self.low, self.high = outer_box(limit_faces(robot, window), robot.coordinates)
        self.ends, self.bad = ends, list(bad)

    def path(self) -> Array | None:
        """Return waypoints whose samples are free; None if the budget is spent first."""
        trees = [_Tree([one], [-1]) for one in self.ends]
        side = 0
        while self.meter.spent() is None:
            self.meter.boxes += 1
            here, there = trees[side], trees[1 - side]
            target = self.rng.uniform(self.low, self.high)
            new = self._extend(here, target, _REACH)
            if new is not None and self._extend(there, here.points[new], np.inf, whole=True) is not None:
                way = here.way(new)[::-1] + there.way(len(there.points) - 1)[1:]
                way = way if side == 0 else way[::-1]
                return self.shortened(np.array(way))
            side = 1 - side
        return None

    def _extend(self, tree: _Tree, target: Array, reach: float, whole: bool = False) -> int | None:
        near = int(np.argmin(np.linalg.norm(np.array(tree.points) - target, axis=1)))
        step = target - tree.points[near]
        length = float(np.linalg.norm(step))
        if not length > 0.0:
            return near if whole else None
        end = tree.points[near] + step * min(1.0, reach / length)
        if not self._is_free(tree.points[near], end):
            return None
        tree.points.append(end)
        tree.parents.append(near)
        return len(tree.points) - 1

    def _is_free(self, a: Array, b: Array) -> bool:
        count = int(np.ceil(float(np.linalg.norm(b - a)) / _STEP)) + 1
        Q = a + np.linspace(0.0, 1.0, count + 1)[:, None] * (b - a)
        for q in self.bad:  # points between samples at which a proof found contact
            along = b - a
            t = float(np.clip((q - a) @ along / max(float(along @ along), 1e-300), 0.0, 1.0))
            if float(np.linalg.norm(a + t * along - q)) < 1e-3:
                return False
        if not np.all(self.robot.intervals.hold(Q)):
            return False
        return self.chosen is None or bool(np.all(self.chosen.signed_clearances(Q) > 0.0))

    def shortened(self, way: Array) -> Array:
        """Return a path with fewer points: a point is removed if the straight path past it is free at its samples."""
        for _ in range(_SHORTCUTS):
            if len(way) < 3:
                break
            i, j = np.sort(self.rng.choice(len(way), 2, replace=False))
            if j - i > 1 and self._is_free(way[i], way[j]):
                way = np.concatenate([way[: i + 1], way[j:]])
        return way


@dataclass
class _Tree:
    points: list[Array]
    parents: list[int]

    def way(self, index: int) -> list[Array]:
        """Return the points from one point back to the root."""
        found: list[Array] = []
        while index >= 0:
            found.append(self.points[index])
            index = self.parents[index]
        return found
