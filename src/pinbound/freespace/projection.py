"""free_projection(): for which values of two coordinates a free value of all others exists, with proof.

A cell is *in* if one value of the other coordinates, the witness, is proven free for every point of the cell. A cell is
*out* if boxes that cover all values of the other coordinates are each proven in contact, or beyond a limit, for every
point of the cell.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pinbound.boundaries.boundary import Boundary
from pinbound.certificates.records import Budget, Reason
from pinbound.certificates.scope import covered, scope
from pinbound.certificates.search import Meter
from pinbound.checks import random_numbers
from pinbound.coverage import CoverageRecord
from pinbound.exceptions import DimensionError, UnsupportedError
from pinbound.freespace.paving import Paving, axes_of, halved, rounding_of_volumes, volume_of_boxes
from pinbound.robot.robot import Robot
from pinbound.typing import Array, Flags, Indices
from pinbound.values import Value

__all__ = ["FreeProjection", "free_projection"]

_BUDGET = Budget(boxes=20_000_000, seconds=20.0)
_CANDIDATES = 48
"""Number of values of the others that are tried in each cell, besides the witness of its parent cell."""
_SAMPLES = 4000
_TRIED = 2
"""Number of these, furthest from contact in the middle of the cell, for which a proof is tried."""
_PARTS = 48
"""Largest number of boxes over the others in an attempt to prove one cell out."""
_CELLS = 256


@dataclass(frozen=True, eq=False, repr=False)
class FreeProjection(Value):
    """Values of two coordinates for which some value of all others is free. Made by `free_projection`.

    Attributes:
        coordinates: The two coordinates.
        coverage: Which pairs of links the boundaries watch, and which they do not.
        box: (2, 2) corners of the box of limits [rad or m].
        inside: (f, 2, 2) corners of cells proven in: with the other coordinates of the witness, the whole cell is free.
        witnesses: (f, n) one configuration for each cell of `inside`, in the middle of the cell.
        outside: (o, 2, 2) corners of cells proven out: no value of the others is free.
        open: (u, 2, 2) corners of undecided cells.
        reason: Why undecided boxes remain (the budget); None if the requested share was decided.
        boxes: The number of bounds computed, one for each box and boundary.
        seconds: Wall time [s].

    Example:
        >>> import pinbound as pb
        >>> found = pb.free_projection(pb.load("minervabot_v3"), ("q1", "q2"), decided=0.8)
        >>> found.decided >= 0.8, found.inside.shape[1:]
        (True, (2, 2))
    """

    coordinates: tuple[str, ...]
    coverage: CoverageRecord
    box: Array
    inside: Array
    witnesses: Array
    outside: Array
    open: Array
    reason: Reason | None
    boxes: int
    seconds: float

    def __repr__(self) -> str:
        """Return the interval as shares of the box, and what the boundaries watch."""
        low, high = (area / float((self.box[1] - self.box[0]).prod()) for area in self.areas)
        said = f"share of the box that is in, in [{low:.6g}, {high:.6g}], proven"
        return f"<FreeProjection to {', '.join(self.coordinates)}: {said}; {self.coverage}>"

    @property
    def decided(self) -> float:
        """The decided share of the box, in [0, 1]."""
        return max(0.0, 1.0 - volume_of_boxes([self.open]) / float((self.box[1] - self.box[0]).prod()))

    @property
    def areas(self) -> tuple[float, float]:
        """Lower and upper bound of the area that is in [rad^2, metres for a prismatic joint]."""
        inside, left = volume_of_boxes([self.inside]), volume_of_boxes([self.open])
        room = rounding_of_volumes(float((self.box[1] - self.box[0]).prod()))
        return max(0.0, inside - room), inside + left + room


def free_projection(
    robot: Robot,
    coordinates: Sequence[str],
    boundaries: Sequence[str] | None = None,
    budget: Budget | None = None,
    window: Mapping[str, tuple[float, float]] | None = None,
    *,
    decided: float = 0.97,
    limits_only: bool = False,
    seed: int = 0,
) -> FreeProjection:
    """Return for which values of two coordinates the robot is free for some value of the others, with proof.

    Args:
        robot: The robot.
        coordinates: Names of two coordinates.
        boundaries: Names of the boundaries; None: all.
        budget: The work allowed; None: 20 seconds.
        window: Ends [rad or m] by coordinate, also for the others; needed for coordinates without limits.
        decided: The decided share of the box at which the search ends, in (0, 1].
        limits_only: Whether to use limits and rules only, without boundaries.
        seed: Seed of the random samples that propose witnesses; the proofs do not depend on them.

    Raises:
        UnknownNameError: If a coordinate or a boundary does not exist.
        UnsupportedError: If there are not two coordinates.
        DimensionError: If `decided` is not in (0, 1], or a coordinate has no limits.

    Example:
        >>> import pinbound as pb
        >>> robot = pb.load("minervabot_v3")
        >>> found = pb.free_projection(robot, ("q1", "q2"), decided=0.95)
        >>> low, high = found.areas  # whatever q1 is, q2 has the width of the region
        >>> width = (robot.upper[0] - robot.lower[0]) * np.ptp(pb.feasible_region(robot).vertices[:, 0])
        >>> bool(low < width < high), found.decided >= 0.95
        (True, True)
    """
    names, axes = axes_of(robot, coordinates)
    if len(names) != 2:
        raise UnsupportedError(f"you gave {len(names)} coordinates; give two of {', '.join(robot.coordinates)}")
    if not 0.0 < decided <= 1.0:
        raise DimensionError(f"the share {decided} is not in (0, 1]; give above 0, at most 1")
    chosen, rng = scope(robot, boundaries, True, limits_only), random_numbers(seed)
    everything = np.arange(len(robot.coordinates))
    paving = Paving(robot, chosen, everything, robot.home, dict(window or {}), Meter(budget or _BUDGET))
    search = _Search(robot, chosen, paving, axes, rng)
    reason = search.run(decided)
    box = np.stack([paving.low[axes], paving.high[axes]])
    nothing = np.empty((0, 2, 2))
    return FreeProjection(
        coordinates=names,
        coverage=covered(robot, chosen),
        box=box,
        inside=np.concatenate([nothing, *search.inside]),
        witnesses=np.concatenate([np.empty((0, len(everything))), *search.witnesses]),
        outside=np.concatenate([nothing, *search.outside]),
        open=np.concatenate([nothing, *search.left]),
        reason=reason,
        boxes=paving.meter.boxes,
        seconds=paving.meter.seconds,
    )


class _Search:
    """Cells (N, 2, 2) over the two coordinates, and a value of all others for each that may be its witness."""

    def __init__(
        self, robot: Robot, chosen: Sequence[Boundary], paving: Paving, axes: Indices, rng: np.random.Generator
    ) -> None:
        self.robot, self.paving, self.axes, self.rng = robot, paving, axes, rng
        self.some: Any = robot.boundaries.select([one.name for one in chosen]) if chosen else None
        self.others = np.setdiff1d(np.arange(len(robot.coordinates)), axes)
        self.items = np.arange(len(paving.pairs) + len(paving.rules))
        weights = paving.pairs.weights[: len(paving.pairs)]  # the entries after them are those of groups
        self.weights = np.vstack([weights, *(np.abs(rule[0].normal)[None] for rule in paving.rules)])
        Q = rng.uniform(paving.low, paving.high, (_SAMPLES, len(paving.low)))
        free = Q[self._clearance(Q) > 0.0]
        self.values = free if len(free) else Q[:1]
        self.inside: list[Array] = []
        self.witnesses: list[Array] = []
        self.outside: list[Array] = []
        self.left: list[Array] = []

    def run(self, decided: float) -> Reason | None:
        """Halve cells until enough is decided; return which part of the budget ended the work, if one did."""
        low, high = self.paving.low[self.axes], self.paving.high[self.axes]
        cells, known = np.stack([low, high])[None], self.values[:1].copy()
        most = (1.0 - decided) * float(np.prod(high - low))
        while len(cells):
            reason = self.paving.meter.spent()
            is_enough = volume_of_boxes([cells]) <= most
            if is_enough or reason:
                self.left.append(cells)
                return None if is_enough else reason
            is_open = np.ones(len(cells), dtype=np.bool_)
            known = known.copy()
            for start in range(0, len(cells), _CELLS):
                if start and self.paving.meter.spent():
                    break
                part = slice(start, start + _CELLS)
                is_open[part], known[part] = self._look(cells[part], known[part])
            cells, known = cells[is_open], known[is_open]
            wide = (cells[:, 1] - cells[:, 0]) / (high - low)
            cells, known = halved(cells, np.argmax(wide, axis=1)), np.concatenate([known, known])
        return None

    def _look(self, cells: Array, known: Array) -> tuple[Flags, Array]:
        """Decide some cells; return which are still undecided, and the best value of the others found for each."""
        count, n = len(cells), len(self.paving.low)
        middle = cells.mean(axis=1)
        picks = self.rng.integers(0, len(self.values), (count, _CANDIDATES))
        Q = np.concatenate([known[:, None], self.values[picks]], axis=1)
        Q[:, :, self.axes] = middle[:, None]
        clearance = self._clearance(Q.reshape(-1, n)).reshape(count, -1)
        order, rows = np.argsort(-clearance, axis=1), np.arange(count)
        is_open, best = np.ones(count, dtype=np.bool_), Q[rows, order[:, 0]]
        for turn in range(min(_TRIED, Q.shape[1])):
            q = Q[rows, order[:, turn]]
            some = np.flatnonzero(is_open & (clearance[rows, order[:, turn]] > 0.0))
            boxes = np.repeat(q[some, None], 2, axis=1)
            boxes[:, :, self.axes] = cells[some]
            proven = some[self._is_free(boxes)]
            is_open[proven] = False
            self.inside.append(cells[proven])
            self.witnesses.append(q[proven])
        doubtful = np.flatnonzero(is_open & (clearance[rows, order[:, 0]] <= 0.0))
        out = doubtful[self._is_out(cells[doubtful])]
        is_open[out] = False
        self.outside.append(cells[out])
        return is_open, best

    def _clearance(self, Q: Array) -> Array:
        """Return the smallest signed clearances (N,); -1 if a limit or rule is violated."""
        kept = self.robot.intervals.hold(Q)
        found = np.where(kept, 1.0, -1.0)
        if self.some is not None and np.any(kept):
            found[kept] = np.asarray(self.some.smallest(Q[kept]).clearance)
        return found

    def _is_free(self, boxes: Array) -> Flags:
        """Return which boxes (N, 2, n) are proven free of all pairs and limits."""
        if not len(boxes):
            return np.zeros(0, dtype=np.bool_)
        lower, _ = self._bounds(boxes)
        return np.all(lower > 0.0, axis=1)

    def _bounds(self, boxes: Array) -> tuple[Array, Array]:
        m = len(self.items)
        found = self.paving.bounds(np.tile(self.items, len(boxes)), np.repeat(boxes, m, axis=0))
        self.paving.meter.boxes += m * len(boxes)
        return found[0].reshape(-1, m), found[1].reshape(-1, m)

    def _is_out(self, cells: Array) -> Flags:
        """Return which cells are proven out: boxes over the others are halved until each is proven not to be free."""
        boxes = np.repeat(np.stack([self.paving.low, self.paving.high])[None], len(cells), axis=0)
        boxes[:, :, self.axes] = cells
        cell, is_out = np.arange(len(cells)), np.ones(len(cells), dtype=np.bool_)
        while len(boxes):
            _, upper = self._bounds(boxes)
            left = ~np.any(upper < 0.0, axis=1)
            boxes, cell, upper = boxes[left], cell[left], upper[left]
            counts = np.bincount(cell, minlength=len(cells))
            is_out &= 2 * counts <= _PARTS
            if not len(self.others):
                is_out[cell] = False
            keep = is_out[cell]
            boxes, cell, upper = boxes[keep], cell[keep], upper[keep]
            if not len(boxes) or self.paving.meter.spent():
                break
            worst = np.argmin(upper, axis=1)
            reach = self.weights[worst] * (boxes[:, 1] - boxes[:, 0])
            reach[:, self.axes] = 0.0
            is_still = ~np.any(reach > 0.0, axis=1)  # the pair that is nearest to contact does not depend on the others
            is_out[cell[is_still]] = False
            keep = is_out[cell]
            boxes, cell, reach = boxes[keep], cell[keep], reach[keep]
            boxes, cell = halved(boxes, np.argmax(reach, axis=1)), np.concatenate([cell, cell])
        is_out[cell] = False
        return is_out
