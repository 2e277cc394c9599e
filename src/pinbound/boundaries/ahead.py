"""How far a coordinate can move before any contact of bodies, proven from samples, so that few need an exact search.

A contact of two points has a closed form. A contact of bodies is isolated with bounds over intervals, which costs a
thousand times more, and most bodies are never near. `rates` gives a bound L of how fast the coordinate changes a
clearance. So between two values with the clearances s and t there is no contact if `s + t > L` times their distance,
because the clearance can fall from s and rise to t only at the rate L. All boundaries are sampled together, and more
densely where the samples do not yet decide.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from pinbound.boundaries.boundary import Boundary
from pinbound.limits import outwards
from pinbound.tolerances import NEVER_MEETS
from pinbound.typing import Array, Flags, Indices

__all__ = ["Ahead", "Ask", "ahead_of", "farness"]

_FIRST, _MOST = 65, 1025  # number of samples at the start, and at most
_TURN = 2.0 * math.pi
_ROUNDS = 6  # rounds in which samples are added halfway

Ask = Callable[[Array], Array]
"""Returns signed clearances (N, m) [m] of N values of the coordinate; the other coordinates are fixed."""


def farness(clearances: Array, rates: Array) -> Array:
    """Return the least motion of the coordinate until each boundary can be in contact (..., m) [rad or m]."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(rates > 0.0, (clearances - NEVER_MEETS) / rates, math.inf)


@dataclass(frozen=True)
class Ahead:
    """The data of m boundaries before one coordinate moves.

    Attributes:
        rates: (m,) bounds of the rates at which the coordinate changes their signed clearances [m per unit].
        sampled: (m,) which contacts have no closed form, with a rate that is finite and not zero.
        turning: (m,) which of these repeat with every turn of the coordinate.
    """

    rates: Array
    sampled: Flags
    turning: Flags

    def reach(self, clearances: Array, value: float, within: tuple[float, float], ask: Ask) -> tuple[Array, Array]:
        """Return the least motion of the coordinate down and up until each boundary can be in contact (m,), (m,).

        Infinite means: no contact on this side within the interval.

        Args:
            clearances: (m,) signed clearances at the value [m].
            value: The coordinate's value, in the interval.
            within: The interval of the search.
            ask: Returns signed clearances at other values.
        """
        far = farness(clearances, self.rates)
        far[self.turning & (far > math.pi)] = math.inf  # free over a full turn
        low = max(within[0], value - math.pi)
        high = min(within[1], low + _TURN)
        low = max(within[0], high - _TURN)
        asked = self.sampled & (clearances > 0.0) & (far <= max(value - low, high - value))
        if not np.any(asked) or not low < high:
            return far, far
        x, s = self._samples(asked, (low, value, high), ask)
        free = self._free(x, s)
        here = int(np.searchsorted(x, value))
        down = self._run(value - x[here::-1], s[here::-1], free[:here][::-1], low <= within[0])
        up = self._run(x[here:] - value, s[here:], free[here:], high >= within[1])
        if within[1] - within[0] > _TURN:  # one turn is sampled
            whole = self.turning & np.all(free, axis=0)
            down[whole], up[whole] = math.inf, math.inf
        return np.where(asked, down, far), np.where(asked, up, far)

    def _samples(self, asked: Flags, ends: tuple[float, float, float], ask: Ask) -> tuple[Array, Array]:
        """Return increasing values (N,), which include the three of `ends`, and their clearances (N, m)."""
        low, value, high = ends
        x: Array = np.unique([*np.linspace(low, high, _FIRST).tolist(), *ends])
        s = ask(x)
        for _ in range(_ROUNDS):
            met = np.any(s <= 0.0, axis=1)  # values beyond the first contact on either side do not matter
            last = x[met & (x > value)].min(initial=high)
            first = x[met & (x < value)].max(initial=low)
            open_too = np.any(~self._free(x, s)[:, asked], axis=1) & (x[1:] > first) & (x[:-1] < last)
            halves = 0.5 * (x[:-1] + x[1:])[open_too]
            if not len(halves) or len(x) + len(halves) > _MOST:
                break
            order: Indices = np.argsort(np.concatenate((x, halves)), kind="stable")
            x, s = np.concatenate((x, halves))[order], np.concatenate((s, ask(halves)))[order]
        return x, s

    def _free(self, x: Array, s: Array) -> Flags:
        """Return which boundaries are proven clear between neighbouring ones of N values (N - 1, m)."""
        return s[:-1] + s[1:] - 2.0 * NEVER_MEETS > self.rates * np.diff(x)[:, None]

    def _run(self, way: Array, s: Array, free: Flags, is_whole: bool) -> Array:
        """Return how far each boundary stays clear (m,) over samples in order of distance from the first one."""
        ended = np.concatenate((free, np.zeros((1, free.shape[1]), np.bool_)))
        count = np.argmin(ended, axis=0)  # number of proven intervals
        reached = way[count] + np.maximum(farness(s[count, np.arange(s.shape[1])], self.rates), 0.0)
        return np.where((count == len(free)) & is_whole, math.inf, reached)


def ahead_of(boundaries: Sequence[Boundary], index: int, rates: Array) -> Ahead:
    """Return the data of a robot's boundaries before coordinate `index` moves; `rates` come from `rates_of`."""
    plain = [one.is_stop or outwards.is_closed(one.path, index) for one in boundaries]
    sampled = ~np.array(plain, dtype=np.bool_) & (rates > 0.0) & np.isfinite(rates)
    chains = [one.path.minimal for one in boundaries]
    turns = [not np.any(one.coefficients[:, index] % 1.0) and not np.any(one.slides[:, :, index]) for one in chains]
    return Ahead(rates, sampled, sampled & np.array(turns, dtype=np.bool_))
