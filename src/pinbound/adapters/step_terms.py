"""The terms of step-safe rows, for many boundaries at one q: vectors, their rates along n, bounds of their curvature.

Between two marks there are a chain and edge vectors, `r_c = w + sum_k c_k e_k`, all with the same rotations. They are
placed once from the tail, `x_i = b_i + R_(i+1) x_(i+1)`. With `u_i = R_i^T ... R_1^T n` the rates along n are

    n . dr/dphi_i = n . W_(i-1) (a_i x R_i x_i) = (u_(i-1) x a_i) . R_i x_i,

so one vector for each rotation serves all of them; the result is linear in the rates of q.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from pinbound.bounds.bounds import bends_over_box
from pinbound.bounds.code import Code
from pinbound.bounds.rounding import Walks
from pinbound.bounds.separation_tables import SeparationTables, separation_tables
from pinbound.bounds.swept_bounds import SweptBundle, all_rows, rounding_bound, separated, swept_bundle
from pinbound.bounds.three_edges import in_three_edges
from pinbound.machine.compiled import has_numba
from pinbound.machine.step_source import FEW, ROW, step_source
from pinbound.path.relative import RelativePath
from pinbound.tolerances import INFLATION
from pinbound.typing import Array, Indices

__all__ = ["StepRowTerms", "StepTerms", "load_code", "step_terms"]

_CODE = Code(step_source, loading=200, compiling=100_000)
"""Pairs: one pair takes NumPy some 100 us, if there are few."""


@dataclass(frozen=True, eq=False)
class StepRowTerms:
    """Rows `value + g . d - loss x - bend x^2 > 0` that keep pairs apart; x in [0, 1] is the scale of the box.

    Attributes:
        places: (r,) the pair of each row.
        value: (r,) separation along n of a pair of vertices, minus all rounding [m].
        g: (r, n) its rates.
        loss: (r,) by how much other pairs of vertices may pass below it over the box [m].
        bend: (r,) half the bound of second derivatives over the box [m].
    """

    places: Indices
    value: Array
    g: Array
    loss: Array
    bend: Array


@dataclass(frozen=True, eq=False)
class StepTerms:
    """A bundle of paths.

    Attributes:
        bundle: The paths.
        error: (m,) rounding bounds [m].
        tables: The same as tables for machine code; None if it cannot run.
    """

    bundle: SweptBundle
    error: Array
    tables: SeparationTables | None

    @property
    def moved(self) -> Array:
        """(m, n) the largest change of a separation for a unit of each coordinate [m/rad or 1]."""
        chains, rows = self.bundle.chains, self.bundle.rows
        found: Array = np.einsum("mk,mkn->mn", self.bundle.arms, np.abs(chains.coefficients))
        if chains.slides is not None:
            found = found + np.linalg.norm(chains.slides, axis=2).sum(axis=1)
        return found[::rows]

    def rows(self, which: Indices, q: Array, half: Array) -> StepRowTerms:
        """Return the rows of paths `which` (c,) at q (n,), for steps within `half` (n,), path by path."""
        tables = self.tables
        if tables is None or not np.all(tables.fits[which]) or not _CODE.is_worth(len(which), np.inf):
            return self.rows_in_numpy(which, q, half)
        return self._rows_in_machine_code(tables, which, q, half)

    def _rows_in_machine_code(self, tables: SeparationTables, which: Indices, q: Array, half: Array) -> StepRowTerms:
        size = ROW + len(q)
        out = np.empty(FEW * size * len(which) + tables.room)
        question = np.concatenate((q, half, np.ones(len(q)), self.error))
        count = _CODE.run(question, out, 0, 0, tables.table, len(which), which.astype(np.int64))
        found = out[: size * count].reshape(count, size)
        return StepRowTerms(
            places=found[:, 0].astype(np.intp), value=found[:, 1], g=found[:, ROW:], loss=found[:, 2], bend=found[:, 3]
        )

    def rows_in_numpy(self, which: Indices, q: Array, half: Array) -> StepRowTerms:
        """Return the same without machine code, equal up to the rounding bounds."""
        along, rates, bend, off, t = self.at(which, q, half)
        along[:, 0] -= off
        places, values, slopes, losses = list[int](), list[float](), list[Array](), list[float]()
        for row, place in enumerate(map(int, which)):
            bodies = self.bundle.corners.pairs[place]
            for value, slope, loss in _rows(bodies, along[row], rates[row], half, t[row]):
                places.append(row)
                values.append(value)
                slopes.append(slope)
                losses.append(loss)
        rows = np.array(places, dtype=np.intp)
        g = np.array(slopes).reshape(-1, len(q))
        return StepRowTerms(which[rows], np.array(values), g, np.array(losses), bend[rows])

    def at(self, which: Indices, q: Array, half: Array) -> tuple[Array, Array, Array, Array, Array]:
        """Return the terms of paths `which` (c,) at q (n,), for steps within `half` (n,).

        These are `n . r` of chain and edge vectors (c, 1 + K) [m]; its rates (c, 1 + K, n); half the bound of second
        derivatives of any pair of vertices over the box (c,) [m]; the rounding bound of all (c,) [m]; and the t (c, K)
        of the nearest points.
        """
        chains, rows, c = self.bundle.chains, self.bundle.rows, len(which)
        first, each = which * rows, all_rows(self.bundle, which)
        axes, C = chains.axes[first], chains.coefficients[first]
        blocks = chains.offsets[each].reshape(c, rows, -1, 3)
        slides = None if chains.slides is None else chains.slides[each].reshape(c, rows, -1, 3, len(q))
        if slides is not None:
            blocks = blocks + slides @ q
        turns, k = _rotations(axes, C @ q), axes.shape[1]
        x, tails = blocks[:, :, k], list[Array]()
        for i in reversed(range(k)):
            x = x @ turns[:, i].transpose(0, 2, 1)
            tails.append(x)
            x = x + blocks[:, :, i]
        _, n, _, t = separated(self.bundle, which, x)
        along = (x @ n[:, :, None])[:, :, 0]
        rates, u = np.empty((*along.shape, k)), n[:, None]
        sliding = np.zeros((*along.shape, len(q)))
        for i in range(k + 1):
            if slides is not None:
                sliding = sliding + np.einsum("crdj,cd->crj", slides[:, :, i], u[:, 0])
            if i < k:
                across = _cross(u[:, 0], axes[:, i])
                rates[:, :, i] = (tails[k - 1 - i] @ across[:, :, None])[:, :, 0]
                u = u @ turns[:, i]
        second, wide = bends_over_box(chains, self.bundle.arms, first, half)
        off = self.error[which] * (1.0 + wide.sum(axis=1))
        return along, rates @ C + sliding, 0.5 * second * INFLATION, off, t


def step_terms(paths: Sequence[RelativePath], walked: Walks, lower: Array, upper: Array) -> StepTerms:
    """Return the terms of paths, with bounds that hold in a box of q (n,), (n,)."""
    found = [in_three_edges(path) for path in paths]
    bundle, off = swept_bundle([path for path, _ in found], lower, upper), np.array([off for _, off in found])
    error = rounding_bound(bundle, walked, lower, upper)
    if np.any(off > 0.0):  # the edges were reduced as they are given: what that has rounded counts, too
        given = rounding_bound(swept_bundle(paths, lower, upper), walked, lower, upper)
        error = np.where(off > 0.0, error + given + off, error)
    return StepTerms(bundle, error, separation_tables(bundle) if has_numba() and len(paths) else None)


def load_code() -> None:
    """Load the machine code now, compiled first where this machine has not done it yet."""
    _CODE.load()


def _rows(
    bodies: tuple[Array, Array], along: Array, rates: Array, half: Array, t: Array
) -> Iterator[tuple[float, Array, float]]:
    """Return value, rates and loss of a pair's rows: of few pairs of vertices each, of more the one of places t.

    A separation along a direction is the least over the vertices of either body, so that each side is looked at alone.
    """
    first, second = bodies
    split, count = 1 + first.shape[1], 1 + first.shape[1] + second.shape[1]
    along, rates = along[:count], rates[:count]
    if len(first) * len(second) <= FEW:
        for pair in product(first, second):
            corner = np.concatenate(([1.0], *pair))
            yield float(corner @ along), corner @ rates, 0.0
        return
    value, loss = float(along[0]), 0.0
    for vertices, edges in ((first, slice(1, split)), (second, slice(split, count))):
        heights, place = vertices @ along[edges], t[edges.start - 1 : edges.stop - 1]
        least = float(heights.min())
        swing = np.abs((vertices - place) @ rates[edges]) @ half - (heights - least)
        loss += float(np.maximum(swing, 0.0).max())
        value += least
    yield value, rates[0] + t[: count - 1] @ rates[1:], loss * INFLATION


def _rotations(axes: Array, angles: Array) -> Array:
    """Return the matrices (c, k, 3, 3) of rotations about unit axes (c, k, 3) by angles (c, k)."""
    u, v, w = np.moveaxis(axes, 2, 0)
    sin, zero = np.sin(angles)[:, :, None, None], np.zeros_like(u)
    cross = np.stack((zero, -w, v, w, zero, -u, -v, u, zero), axis=2).reshape(*angles.shape, 3, 3)
    along = axes[:, :, :, None] * axes[:, :, None, :]
    found: Array = along + np.cos(angles)[:, :, None, None] * (np.eye(3) - along) + sin * cross
    return found


def _cross(a: Array, b: Array) -> Array:
    """Return a x b (c, 3)."""
    return a[:, _FIRST] * b[:, _LAST] - a[:, _LAST] * b[:, _FIRST]


_FIRST, _LAST = np.array([1, 2, 0]), np.array([2, 0, 1])
