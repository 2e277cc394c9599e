"""A slice divided into cells: each is proven free or in contact; undecided cells are cut, down to a stated width.

Contacts of boxes, prisms and segments edge to edge need a search. They have no smooth function whose zeros could be
traced. But over a box of the slice the separation has proven bounds (`bounds/swept_bounds`). So with the contact
distances T_b a cell is

    free:       lower_b > T_b for every boundary b;
    in contact: upper_b <= T_b for one of them;
    undecided:  neither; it is cut into four, until no side is longer than the width.

Then all contours lie in undecided cells, and no island can be missed. `docs/regions-cells.md` has the proofs.

Coordinates here are those of the slice in units of `Slice.scales`. Corners of cells are whole multiples of the finest
step, so that neighbours share them to the last bit.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pinbound.bounds.swept_bounds import SweptBundle, over_box, rounding_bound, swept_bundle
from pinbound.evaluate import separation
from pinbound.exceptions import UnsupportedError
from pinbound.loops.through_loops import LoopBounds, LoopContact, LoopFunction, LoopLimit
from pinbound.path.relative import RelativePath
from pinbound.region.deadline import Deadline
from pinbound.region.slice import Curve, Slice
from pinbound.tolerances import CONTOUR_ROUNDING
from pinbound.typing import Array, Flags, Indices, Ints
from pinbound.values import Value

__all__ = ["Cells", "Grid", "Searched", "SeparationFunction", "decided", "pave"]

FINEST = 20  # halvings of a root cell at most: 1e-6 of it
_ROOTS = 6  # root cells along the shorter side of the window, about
_MOST_ROOTS = 64
_ROWS = 2**13  # pairs of a boundary and a cell that are bounded in one call
_MOST_CELLS = 400_000
_ENOUGH = 20_000  # cells, if no width is requested: some seconds
_SETTLED = 3  # halvings of root cells, to some 0.1 rad: from there on undecided cells follow curves
_FOUR: Ints = np.array([[0, 0], [1, 0], [0, 1], [1, 1]])
_TURN = 2.0 * np.pi


@dataclass(frozen=True, eq=False)
class SeparationFunction:
    """`f(x) - T`, the separation minus the contact distance, over the slice in units of its scales.

    Attributes:
        path: The path over the two coordinates.
        threshold: T [m].
        scales: (2,) units of the slice.
    """

    path: RelativePath
    threshold: float
    scales: Array

    def value(self, X: Array) -> Array:
        """Return `f - T` (N,) [m]."""
        return separation.separations(self.path, X * self.scales) - self.threshold

    def value_gradient(self, X: Array) -> tuple[Array, Array]:
        """Return `f - T` (N,) and its gradient (N, 2); NaN where bodies overlap, because there is no direction."""
        return self.value(X), separation.gradients(self.path, X * self.scales) * self.scales


@dataclass(frozen=True, eq=False)
class Grid:
    """The grid of cells: their corners are `origin + step * k` with whole numbers k.

    Attributes:
        origin: (2,) lower corner of the window.
        step: (2,) the finest step.
        roots: (2,) root cells along each side; each is `2**FINEST` steps wide.
        level: The number of halvings of a root cell until no side is longer than the width.
    """

    origin: Array
    step: Array
    roots: tuple[int, int]
    level: int

    @classmethod
    def over(cls, window: Array, width: float) -> Grid:
        """Return the grid of a window (2, 2), rows lower and upper, with nearly square cells."""
        sides = window[1] - window[0]
        level = int(np.clip(np.floor(np.log2(sides.min() / (_ROOTS * width))), 0, FINEST))
        root = max(width * 2.0**level, sides.max() / _MOST_ROOTS)
        level = int(np.clip(np.ceil(np.log2(root / width)), 0, FINEST))
        roots = np.ceil(sides / root).astype(int)
        return cls(window[0], sides / roots / 2.0**FINEST, (int(roots[0]), int(roots[1])), level)

    @property
    def size(self) -> int:
        """The side of a cell of the stated width, in finest steps."""
        return 1 << (FINEST - self.level)

    def places(self, corners: Ints) -> Array:
        """Return points (..., 2) from whole numbers of steps."""
        return self.origin + self.step * corners

    def boxes(self, cells: Cells) -> tuple[Array, Array]:
        """Return the lower and the upper corners (N, 2)."""
        return self.places(cells.corners), self.places(cells.corners + cells.sizes[:, None])


@dataclass(frozen=True, eq=False)
class Cells(Value):
    """Cells, and for each cell the boundaries whose contact may begin in it.

    Attributes:
        corners: (N, 2) lower corners in finest steps.
        sizes: (N,) sides in finest steps.
        cell: (P,) the index of a cell, ascending.
        which: (P,) a boundary that is undecided on this cell.
    """

    corners: Ints
    sizes: Ints
    cell: Ints
    which: Ints

    def __len__(self) -> int:
        """Return the number of cells."""
        return len(self.corners)

    def take(self, kept: Flags) -> Cells:
        """Return some of the cells, with their boundaries."""
        number = np.cumsum(kept) - 1
        rows = kept[self.cell]
        return Cells(self.corners[kept], self.sizes[kept], number[self.cell[rows]], self.which[rows])

    def quarters(self) -> Cells:
        """Return every cell cut into four."""
        half = self.sizes // 2
        corners = (self.corners[:, None, :] + half[:, None, None] * _FOUR).reshape(-1, 2)
        cell = (4 * self.cell[:, None] + np.arange(4)).ravel()
        order = np.argsort(cell, kind="stable")
        return Cells(corners, np.repeat(half, 4), cell[order], np.repeat(self.which, 4)[order])

    def with_more(self, other: Cells) -> Cells:
        """Return the cells of both."""
        return Cells(
            np.concatenate((self.corners, other.corners)),
            np.concatenate((self.sizes, other.sizes)),
            np.concatenate((self.cell, other.cell + len(self))),
            np.concatenate((self.which, other.which)),
        )


class Searched:
    """The boundaries of a slice whose contact needs a search, with proven bounds over cells."""

    def __init__(self, slice_: Slice, curves: tuple[Curve | LoopContact | LoopLimit, ...], grid: Grid) -> None:
        """Bundle paths with the same number of edge vectors; boundaries through loops are separate."""
        self.slice, self.curves, self.grid = slice_, curves, grid
        self.functions = tuple(
            SeparationFunction(one.path, one.threshold, slice_.scales)
            if isinstance(one, Curve)
            else LoopFunction(one, slice_.scales)
            for one in curves
        )
        far = grid.places(np.array([[0, 0], np.array(grid.roots) << FINEST])) * slice_.scales
        lower, upper = far
        plain = {row: one for row, one in enumerate(curves) if isinstance(one, Curve)}
        counts = np.full(len(curves), -1)
        counts[list(plain)] = [len(one.path.difference.directions) for one in plain.values()]
        self._group = np.full(len(curves), -1, dtype=np.int64)
        self._place = np.zeros(len(curves), dtype=np.intp)
        self._bundles: list[tuple[SweptBundle, Array, Array]] = []
        for number, count in enumerate(np.unique(counts[counts >= 0]).tolist()):
            rows = np.flatnonzero(counts == count)
            self._group[rows], self._place[rows] = number, np.arange(len(rows))
            bundle = swept_bundle([plain[int(row)].path for row in rows], lower, upper)
            error = rounding_bound(bundle, None, lower, upper) + CONTOUR_ROUNDING * bundle.reach
            threshold = np.array([plain[int(row)].threshold for row in rows])
            self._bundles.append((bundle, error, threshold))
        through = [one for one in curves if not isinstance(one, Curve)]
        self._place[counts < 0] = np.arange(len(through))
        self._through = LoopBounds(through, lower, upper) if through else None

    def bounds(self, which: Ints, low: Array, high: Array, deadline: Deadline | None = None) -> tuple[Array, Array]:
        """Return proven bounds (P,) of `f - T` of boundaries `which` over boxes with corners (P, 2)."""
        scales = self.slice.scales
        middle, half = 0.5 * (low + high) * scales, 0.5 * (high - low) * scales * (1.0 + 1e-9)
        lower, upper = np.empty(len(which)), np.empty(len(which))
        for number, (bundle, error, threshold) in enumerate(self._bundles):
            for rows in _chunks(np.flatnonzero(self._group[which] == number)):
                if deadline is not None:
                    deadline.check()
                place = self._place[which[rows]]
                found = over_box(bundle, place, middle[rows], half[rows], error[place])
                lower[rows], upper[rows] = found.lower - threshold[place], found.upper - threshold[place]
        if self._through is not None:
            for rows in _chunks(np.flatnonzero(self._group[which] == -1)):
                if deadline is not None:
                    deadline.check()
                lower[rows], upper[rows] = self._through.bounds(self._place[which[rows]], middle[rows], half[rows])
        return lower, upper


def _chunks(rows: Indices) -> list[Indices]:
    return [rows[start : start + _ROWS] for start in range(0, len(rows), _ROWS)]


def pave(searched: Searched, deadline: Deadline | None = None, adapts: bool = False) -> tuple[Cells, Grid]:
    """Return the undecided cells of the stated width; all others are proven free, in contact or outside a limit.

    Also return the grid of that width. If it `adapts`, the width is larger when this gives enough cells.

    Raises:
        UnsupportedError: If there are too many cells, or time is up.
    """
    grid, count = searched.grid, len(searched.curves)
    across, up = (np.arange(number, dtype=np.int64) << FINEST for number in grid.roots)
    corners = np.stack(np.meshgrid(across, up, indexing="ij"), axis=-1).reshape(-1, 2)
    number = len(corners)
    cells = Cells(
        corners,
        np.full(number, 1 << FINEST, dtype=np.int64),
        np.repeat(np.arange(number), count),
        np.tile(np.arange(count), number),
    )
    cells = decided(searched, cells, deadline)
    for level in range(grid.level):
        if adapts and level > _SETTLED and 2 * len(cells) > _ENOUGH:
            return cells, replace(grid, level=level)
        cells = decided(searched, cells.quarters(), deadline)
        if level >= _SETTLED and not adapts:  # along curves, the number doubles at each level from here on
            _refuse_more_than(searched, len(cells) << (grid.level - 1 - level))
    return cells, grid


def _refuse_more_than(searched: Searched, count: int) -> None:
    if count > _MOST_CELLS:
        x, y = searched.slice.coordinates
        raise UnsupportedError(
            f"the contact curves in the slice of {x!r} and {y!r} need about {count:.1g} cells of the requested width, "
            f"and at most {_MOST_CELLS} are allowed; give a larger width= (on the command line --width), or a smaller "
            "window (window=, --window)"
        )


def decided(searched: Searched, cells: Cells, deadline: Deadline | None = None) -> Cells:
    """Return the undecided cells among some cells, each with its undecided boundaries.

    Raises:
        UnsupportedError: If there are too many cells, or time is up.
    """
    _refuse_more_than(searched, len(cells) // 4)
    low, high = searched.grid.boxes(cells)
    cells = cells.take(~_needless(searched.slice, low, high))
    low, high = searched.grid.boxes(cells)
    lower, upper = searched.bounds(cells.which, low[cells.cell], high[cells.cell], deadline)
    contact = np.zeros(len(cells), dtype=bool)
    contact[cells.cell[upper <= 0.0]] = True
    open_ = ~(lower > 0.0) & ~contact[cells.cell]
    kept = np.zeros(len(cells), dtype=bool)
    kept[cells.cell[open_]] = True
    number = np.cumsum(kept) - 1
    return Cells(cells.corners[kept], cells.sizes[kept], number[cells.cell[open_]], cells.which[open_])


def _needless(slice_: Slice, low: Array, high: Array) -> Flags:
    """Return which cells (N,) lie completely, with a margin, beyond a limit or in a contact of one effective angle."""
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    found = np.zeros(len(low), dtype=bool)
    for side in (*slice_.box, *slice_.limits):
        normal = side.normal * slice_.scales
        reach = half @ np.abs(normal)
        spare = 1e-2 * float(np.abs(side.normal) @ (slice_.window[1] - slice_.window[0]))
        found |= middle @ normal - reach > side.bound + spare
    for strip in slice_.strips:
        normal = strip.normal * slice_.scales
        away = np.abs(np.remainder(middle @ normal - strip.angle + np.pi, _TURN) - np.pi)
        found |= away + 2.0 * (half @ np.abs(normal)) < strip.half_width
    return found
