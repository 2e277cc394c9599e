"""The map from active coordinates q to z: q, passive joints of loops that are not parallelograms, and their toggles.

Everything that is linear in the joints stays linear in z (`theta = S z + o`). Only the map `z = F(q)` is not linear. It
comes with its derivatives, and with bounds of them over a motion or a box.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pinbound.bounds.intervals import Interval
from pinbound.loops.jets import Jet
from pinbound.loops.linkages import Linkage
from pinbound.model.coupling import as_configurations
from pinbound.tolerances import UNIT_ROUNDOFF
from pinbound.typing import Array, Indices
from pinbound.values import Value

__all__ = ["Lift", "LinearParts", "lifted_names", "places"]


_TOGGLE, _TURN = " toggle", " turn"
_BLOCK = 1 << 12  # rows at a time: they stay in the cache
_FAR = 1e30  # of z where nothing is known of it; times any length it is more than any path


def lifted_names(names: Sequence[str], linkages: Sequence[Linkage]) -> tuple[str, ...]:
    """Return the names of z: those of q first, then what each loop adds; its w is called ``"NAME toggle"``.

    Args:
        names: Names of the coordinates to which the indices of the linkages belong.
        linkages: The loops, in the order in which they are solved.
    """
    passive = {index for one in linkages for index in one.passive}
    found = [name for index, name in enumerate(names) if index not in passive]
    for one in linkages:
        found += [names[index] for index in one.passive]
        found += [one.name + _TOGGLE, *([one.name + _TURN] if one.ahead < 0 else [])]
    return tuple(found)


def places(names: Sequence[str], linkages: Sequence[Linkage]) -> list[int]:
    """Return the index of each name in z."""
    lifted = lifted_names(names, linkages)
    return [lifted.index(name) for name in names]


@dataclass(frozen=True, eq=False)
class LinearParts:
    """Enclosures of z over N boxes of q: `z = centre + sum_a s_a steps_a + e`, `s_a` in [-1, 1], `|e| <= off`.

    Attributes:
        centre: (N, n + k), F at the middles of the boxes, as computed.
        half: (N, n + k), the largest distance of z from the centre.
        steps: (p, N, n + k), the steps of the p requested coordinates.
        off: (N, n + k).
    """

    centre: Array
    half: Array
    steps: Array
    off: Array

    def take(self, rows: Indices) -> LinearParts:
        """Return some of the boxes, in that order."""
        return LinearParts(self.centre[rows], self.half[rows], self.steps[:, rows], self.off[rows])


@dataclass(frozen=True, eq=False)
class Lift(Value):
    """The map `z = F(q)` of a robot.

    Attributes:
        coordinates: Names of q (n).
        names: Names of z (n + k), q's first.
        linkages: The loops over z, in the order in which they are solved.
    """

    coordinates: tuple[str, ...]
    names: tuple[str, ...]
    linkages: tuple[Linkage, ...]

    @cached_property
    def inputs(self) -> tuple[int, ...]:
        """Indices of the coordinates in q that move any loop."""
        found = {index for one in self.linkages for index in one.inputs}
        return tuple(sorted(index for index in found if index < len(self.coordinates)))

    @cached_property
    def columns(self) -> tuple[tuple[int, ...], ...]:
        """The indices in z of the passive joints, w and turn of each linkage."""
        found: list[tuple[int, ...]] = []
        for one in self.linkages:
            extra = [one.name + _TOGGLE, *([one.name + _TURN] if one.ahead < 0 else [])]
            found.append((*one.passive, *(self.names.index(name) for name in extra)))
        return tuple(found)

    def toggle_names(self) -> tuple[str, ...]:
        """Return the names of the entries of z that are not joints."""
        return tuple(self.names[index] for columns in self.columns for index in columns[2:])

    def __call__(self, Q: ArrayLike) -> Array:
        """Return z of q: (n + k,) or (N, n + k); a row that is not finite gives NaN for what its loops move.

        Raises:
            DimensionError: If the last axis of Q is not n long.
        """
        array = as_configurations(Q, self.coordinates)
        rows = array if array.ndim > 1 else array[None]
        n = len(self.coordinates)
        found = np.empty((len(rows), len(self.names)))
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            for start in range(0, len(rows), _BLOCK):
                part = found[start : start + _BLOCK]
                part[:, :n] = rows[start : start + _BLOCK]
                z = [part[:, k].copy() for k in range(n)] + [part[:, 0]] * (len(self.names) - n)
                for one, columns in zip(self.linkages, self.columns, strict=True):
                    for index, value in zip(columns, one.values(z), strict=True):
                        part[:, index] = z[index] = value
        return found if array.ndim > 1 else found[0]

    def jets(self, given: Sequence[Jet], errors: Sequence[float] | None = None) -> list[Jet]:
        """Return all of z as jets, from those of q: of arrays, or of intervals.

        Args:
            given: Jets of q (n).
            errors: For intervals, the error of the gap of each loop [m] (`Linkage.widened`).
        """
        missing: Any = None
        z: list[Jet] = [*given, *([missing] * (len(self.names) - len(given)))]
        for number, (one, columns) in enumerate(zip(self.linkages, self.columns, strict=True)):
            solved = one.solve(z)
            if errors is not None:
                solved = one.widened(solved, errors[number])
            parts = (solved.first, solved.second, solved.transmission, solved.turn)
            for index, part in zip(columns, parts, strict=False):
                if part is not None:
                    z[index] = part
        return z

    def beside(self, values: Sequence[Interval], at: Sequence[Interval]) -> list[Interval]:
        """Return an enclosure of z over boxes of q, on the branch of the value of z at one point of each box.

        Interval arithmetic gives an angle of X near that of the middle of X's own box, which may be a whole turn off
        `at`. If the box of X contains zero, any angle is possible, and a turn to either side is added: z continues from
        `at` within that, or violates the limit of the turn.

        Args:
            values: One interval for each coordinate of z, over the boxes.
            at: The values of z at the points.
        """
        found, unknown = list(values), np.zeros(len(values[0].lower), dtype=np.bool_)
        for one, columns in zip(self.linkages, self.columns, strict=True):
            if any(index >= len(self.coordinates) for index in one.inputs):  # another loop moves it, on which branch?
                for index in columns:
                    low, high = found[index].lower, found[index].upper
                    found[index] = Interval(np.where(unknown, -_FAR, low), np.where(unknown, _FAR, high))
            if one.ahead >= 0:
                continue
            turn = values[columns[-1]]
            turns = np.rint((at[columns[-1]].middle - turn.middle) / (2.0 * math.pi))
            wide = np.where(turn.radius < math.pi, 0.0, 2.0 * math.pi)
            unknown = unknown | (turns != 0.0) | (wide > 0.0)
            for index, each in zip(columns, (*one.turns_with_x, 0.0, 1.0), strict=True):
                if each:
                    found[index] = (
                        found[index] + 2.0 * math.pi * each * turns + Interval(-abs(each) * wide, abs(each) * wide)
                    )
        return found

    def jacobians(self, Q: Array) -> Array:
        """Return `dz/dq` (N, n + k, n) of many q (N, n)."""
        return self.with_jacobians(Q)[1]

    def with_jacobians(self, Q: Array) -> tuple[Array, Array]:
        """Return z (N, n + k) and `dz/dq` (N, n + k, n) of many q (N, n), computed together."""
        (count, n), size = Q.shape, len(self.names)
        found, J = np.empty((count, size)), np.zeros((count, size, n))
        J[:, np.arange(n), np.arange(n)] = 1.0
        found[:, :n] = Q
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            for start in range(0, count, _BLOCK):
                rows = slice(start, start + _BLOCK)
                z = [Q[rows, k].copy() for k in range(n)] + [Q[rows, 0]] * (size - n)
                ways: list[list[Array | float]] = [[float(k == a) for k in range(size)] for a in self.inputs]
                for one, columns in zip(self.linkages, self.columns, strict=True):
                    values, slopes = one.slopes(z, ways)
                    for index, value in zip(columns, values, strict=True):
                        found[rows, index] = z[index] = value
                    for way, a, slope in zip(ways, self.inputs, slopes, strict=True):
                        for index, rate in zip(columns, slope, strict=True):
                            J[rows, index, a] = way[index] = rate
        return found, J

    def derivatives(self, Q: Array, order: int) -> tuple[Array, Array]:
        """Return `dz/dq` (N, n + k, n) and `d^2 z / dq^2` (N, n + k, n, n), which is empty for order 1."""
        (count, n), size = Q.shape, len(self.names)
        J, zero, one = np.zeros((count, size, n)), np.zeros(count), np.ones(count)
        J[:, np.arange(n), np.arange(n)] = 1.0
        H = np.zeros((count, size, n, n) if order > 1 else (count, size, 0, 0))

        def along(*ways: int) -> list[Jet]:
            return self.jets([Jet(Q[:, k], one if k in ways else zero, zero) for k in range(n)])

        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            for a in self.inputs:
                for index, jet in enumerate(along(a)[n:], n):
                    J[:, index, a] = jet.first
                    if order > 1:
                        H[:, index, a, a] = jet.second
            if order > 1:
                for a in self.inputs:
                    for b in (b for b in self.inputs if b > a):
                        for index, jet in enumerate(along(a, b)[n:], n):
                            mixed = 0.5 * (jet.second - H[:, index, a, a] - H[:, index, b, b])
                            H[:, index, a, b] = H[:, index, b, a] = mixed
        return J, H

    def over(self, lower: Array, upper: Array, errors: Sequence[float] | None = None) -> Interval:
        """Return an enclosure of z, (N, n + k), over boxes (N, n) of q; `errors` as in `jets`."""
        count, n, size = len(lower), len(self.coordinates), len(self.names)
        rate = np.zeros((count, size, n))
        nothing, unit = np.zeros(count), np.ones(count)
        zero, one = Interval(nothing, nothing), Interval(unit, unit)
        box = [Interval(lower[:, k], upper[:, k]) for k in range(n)]
        low, high = np.empty((count, size)), np.empty((count, size))
        low[:, :n], high[:, :n] = lower, upper
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            for a in self.inputs:
                jets = self.jets([Jet(box[k], one if k == a else zero, zero) for k in range(n)], errors)
                for index in range(n, size):
                    rate[:, index, a] = jets[index].first.magnitude
                    low[:, index], high[:, index] = jets[index].value.lower, jets[index].value.upper
            middle = 0.5 * (lower + upper)
            point = self.jets([Jet(Interval.at(middle[:, k]), zero, zero) for k in range(n)], errors)
            half = np.maximum(upper - middle, middle - lower)
            given = [Interval(low[:, index], high[:, index]) for index in range(size)]
            at = [*given[:n], *(jet.value for jet in point[n:])]
            for index, value in enumerate(self.beside(given, at)[n:], n):
                moved = np.einsum("na,na->n", rate[:, index], half) * (1.0 + 4.0 * n * UNIT_ROUNDOFF)
                near = at[index] + Interval(-moved, moved)
                low[:, index] = np.fmax(value.lower, near.lower)
                high[:, index] = np.fmin(value.upper, near.upper)
        self._spread(low, high)
        return Interval(low, high)

    def _spread(self, low: Array, high: Array) -> None:
        """Widen the enclosure of z (N, n + k), in place, where an angle of X passes its cut and z jumps by turns."""
        for one, columns in zip(self.linkages, self.columns, strict=True):
            if one.ahead >= 0:
                continue
            crosses = ~((low[:, columns[-1]] > -math.pi) & (high[:, columns[-1]] < math.pi))
            for index, turns in zip(columns, (*one.turns_with_x, 0.0, 1.0), strict=True):
                low[crosses, index] -= 2.0 * math.pi * abs(turns)
                high[crosses, index] += 2.0 * math.pi * abs(turns)

    def linear(
        self, centre: Array, half: Array, along: Sequence[int], errors: Sequence[float] | None = None
    ) -> LinearParts:
        """Return an enclosure of z over the boxes `centre +- half` (N, n) of q; `errors` as in `jets`.

        By the mean value theorem: `z - F(c) = sum_a F'_a(x) d_a` with x in the box. The steps are the middles of the
        intervals that contain F'_a, times the half-width; `off` bounds their errors. If interval arithmetic for F
        itself gives a better bound, the steps are zero, and `off` is this bound.

        Args:
            centre: (N, n).
            half: (N, n).
            along: Indices of the p coordinates that are not fixed; the others have a half-width of zero.
            errors: Errors of each loop [m].
        """
        count, n, size = len(centre), int(centre.shape[1]), len(self.names)
        zero, one = Interval.at(np.zeros(count)), Interval.at(np.ones(count))
        box = [Interval.at(centre[:, k], half[:, k]) for k in range(n)]
        steps, off = np.zeros((len(along), count, size)), np.zeros((count, size))
        low, high = np.full((count, size), -np.inf), np.full((count, size), np.inf)
        middle = self(centre)
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            at = self.jets([Jet(Interval.at(centre[:, k]), zero, zero) for k in range(n)], errors)
            for index in range(n, size):
                value, computed = at[index].value, middle[:, index]
                off[:, index] = np.maximum(value.upper - computed, computed - value.lower)
            for place, a in enumerate(along):
                steps[place, :, a] = half[:, a]
                if a not in self.inputs:
                    continue
                jets = self.jets([Jet(box[k], one if k == a else zero, zero) for k in range(n)], errors)
                for index in range(n, size):
                    rate, value = jets[index].first, jets[index].value
                    known = np.isfinite(rate.lower) & np.isfinite(rate.upper)
                    steps[place, :, index] = np.where(known, rate.middle, 0.0) * half[:, a]
                    off[:, index] += np.where(known, rate.radius * half[:, a], np.inf)
                    low[:, index] = np.fmax(low[:, index], value.lower)
                    high[:, index] = np.fmin(high[:, index], value.upper)
        wide = (np.abs(steps).sum(axis=0) + off) * (1.0 + 8.0 * len(along) * UNIT_ROUNDOFF)
        natural = np.maximum(high - middle, middle - low) * (1.0 + 4.0 * UNIT_ROUNDOFF)
        reach = np.fmin(wide, np.where(np.isnan(natural), np.inf, natural))
        loose = off >= reach  # next to toggles slopes say less than values do: z is within `reach` of the centre
        steps[:, loose] = 0.0
        off = np.where(loose, reach, off * (1.0 + 8.0 * UNIT_ROUNDOFF))
        return LinearParts(middle, np.minimum(reach, _FAR), steps, np.minimum(off, _FAR))
