"""Motions that are functions of time, with bounds of their derivatives; every value is checked against the bounds."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pinbound.bounds.bounds import Expansion
from pinbound.exceptions import DimensionError
from pinbound.model.coupling import real_array
from pinbound.tolerances import SAMPLE_ROUNDOFFS, UNIT_ROUNDOFF
from pinbound.typing import Array, Indices

__all__ = ["BoundedMotion", "BoundedTrajectory"]

_PROBES = 65
_BETWEEN = 192
"""Probes at times without a common period: multiples of the golden ratio."""
_SINGLE = (0, 3, 31, 63, 64)
_KEPT = 2**16
"""The largest number of samples that are kept; beyond it, every second one is dropped."""


@dataclass(frozen=True, eq=False)
class BoundedMotion:
    """A function of time with bounds of its derivatives, e.g. a path of `toppra`.

    The caller states the bounds, and a certificate is true only if they are. `certify` compares every value that it
    asks for (some 250 before it starts) with the bounds and with its neighbours in time. It refuses the motion if two
    values contradict the bounds.

    Attributes:
        function: q (N, n) = function(t), t (N,). With `acceleration`, also function(t, 1), the first derivative, as
            SciPy's splines and toppra's paths have it.
        start: First time [s, or the unit of the function's argument].
        end: Last time [as `start`].
        speed: (n,) bounds of |dq/dt|.
        acceleration: (n,) bounds of |d^2q/dt^2|, or None. With it, certificates near contact cost much less.

    Example:
        >>> import pinbound as pb
        >>> robot = pb.load("minervabot_v3")
        >>> swing = lambda t: np.column_stack([0.0 * t, 0.2 * np.sin(t) + 0.2, 0.3 + 0.0 * t])
        >>> pb.certify(robot, pb.BoundedMotion(swing, 0.0, 6.0, speed=(0.0, 0.2, 0.0))).verdict
        <Verdict.CERTIFIED: 'certified'>
        >>> pb.certify(robot, pb.BoundedMotion(swing, 0.0, 6.0, speed=(0.0, 0.1, 0.0)))
        Traceback (most recent call last):
        pinbound.exceptions.DimensionError: 'q2' is ...: faster than its bound of speed, 0.1, allows; ...
    """

    function: Callable[..., Any]
    start: float
    end: float
    speed: ArrayLike
    acceleration: ArrayLike | None = None


class BoundedTrajectory:
    """A `BoundedMotion` in the form that a certificate needs, with all samples taken so far."""

    def __init__(self, motion: BoundedMotion, coordinates: Sequence[str]) -> None:
        """Read the bounds and test them on samples.

        Raises:
            DimensionError: If shapes or times do not fit, a number is not finite, or samples contradict the bounds.
        """
        self.coordinates, self.function, n = tuple(coordinates), motion.function, len(coordinates)
        if not callable(self.function):
            raise DimensionError(f"the motion's function is a {type(self.function).__name__}; give a function of time")
        span = real_array([motion.start, motion.end], "the motion's span of time")
        if (
            span.shape != (2,)
            or not np.all(np.isfinite(span))
            or span[0] > span[1]
            or not math.isfinite(float(span[1]) - float(span[0]))
        ):
            raise DimensionError(f"the motion runs from {motion.start} to {motion.end}; give finite times in order")
        self.start, self.end = float(span[0]), float(span[1])
        self.has_slopes = motion.acceleration is not None
        self.speed = self._bound(motion.speed, "speed", n)
        self.acceleration = self._bound(motion.acceleration, "acceleration", n) if self.has_slopes else np.zeros(n)
        self.count = 0
        self._times, self._values, self._slopes = np.zeros(0), np.zeros((0, n)), np.zeros((0, n))
        self._probe()

    @staticmethod
    def _bound(given: ArrayLike | None, name: str, n: int) -> Array:
        bound = real_array(given, f"the bound of {name}")
        if bound.shape != (n,):
            raise DimensionError(f"the bound of {name} has shape {bound.shape}; give one number per coordinate, ({n},)")
        if not np.all(np.isfinite(bound)) or np.any(bound < 0.0):
            raise DimensionError(f"the bounds of {name} are {bound.tolist()}; give finite numbers, 0 or more")
        return bound.copy()

    @property
    def degree(self) -> int:
        """The values are those of the function."""
        return 1

    @property
    def notes(self) -> tuple[str, ...]:
        """A note that the bounds are the caller's."""
        what = "speed and acceleration" if self.has_slopes else "speed"
        return (f"true only if the caller's bounds of {what} are true; {self.count:,} samples do not contradict them",)

    @property
    def starts(self) -> Array:
        """One piece."""
        return np.array([self.start])

    @property
    def durations(self) -> Array:
        """One piece."""
        return np.array([self.end - self.start])

    @property
    def extent(self) -> tuple[Array, Array]:
        """A box around the middle of the motion; at its speed the motion cannot leave the box."""
        middle = self.at(np.zeros(1, dtype=np.intp), np.array([0.5]))[0]
        with np.errstate(over="ignore"):
            room = self.speed * (self.end - self.start) / 2.0 * (1.0 + 4.0 * UNIT_ROUNDOFF) + self._jitter
            return middle - room, middle + room

    @property
    def _jitter(self) -> Array:
        """How far q may move within the rounding error of a time, (n,)."""
        return self.speed * (4.0 * UNIT_ROUNDOFF * max(abs(self.start), abs(self.end)))

    def at(self, piece: Indices, u: Array) -> Array:
        """Call the function."""
        return self._sample(self._time(u), slopes=False)[0]

    def _time(self, u: Array) -> Array:
        return np.clip(self.start + u * (self.end - self.start), self.start, self.end)

    def expand(self, piece: Indices, a: Array, b: Array) -> Expansion:
        """Widen the middle of a part by the bounds of the derivatives."""
        span = ((b - a) * (self.end - self.start))[:, None]
        middle, slopes = self._sample(self._time(0.5 * (a + b)), slopes=self.has_slopes)
        zero = np.zeros_like(middle)
        return Expansion(
            middle=middle,
            middle_radius=self._jitter,
            slope=slopes * span if self.has_slopes else zero,
            values=middle[:, None],
            value_radius=0.5 * self.speed * span + self._jitter,
            slopes=zero[:, None],
            slope_radius=self.speed * span,
            bends=zero[:, None] if self.has_slopes else None,
            bend_radius=self.acceleration * span**2,
        )

    def _sample(self, times: Array, slopes: bool) -> tuple[Array, Array]:
        """Return values and first derivatives (NaN if not requested), and keep both."""
        values = self._call(times)
        rates = self._call(times, 1) if slopes else np.full_like(values, np.nan)
        self._remember(times, values, rates)
        return values, rates

    def _call(self, times: Array, *order: int) -> Array:
        what = "the derivative function(t, 1)" if order else "the motion's function"
        try:
            given = self.function(times.copy(), *order)  # a copy: the function may write to it
        except TypeError as error:
            if not order:
                raise
            message = f"{what} cannot be called: {error}; let function(t, 1) be dq/dt, or leave acceleration out"
            raise DimensionError(message) from error
        values = real_array(given, f"the result of {what}").copy()  # the function may return the same buffer again
        expected = (len(times), len(self.coordinates))
        if values.shape != expected:
            raise DimensionError(f"{what} gives shape {values.shape}; give (times, coordinates), here {expected}")
        if not np.all(np.isfinite(values)):
            bad = float(times[np.flatnonzero(~np.all(np.isfinite(values), axis=1))[0]])
            raise DimensionError(f"{what} is not finite at t = {bad:.9g}; end the motion before, or start after")
        return values

    def _probe(self) -> None:
        """Compute values over the whole motion, some of them twice: alone, and in another order."""
        golden = np.modf(np.arange(1, _BETWEEN + 1) * (0.5 * (math.sqrt(5.0) - 1.0)))[0]
        fractions = np.concatenate([np.linspace(0.0, 1.0, _PROBES), np.sort(golden)])
        self._sample(self._time(fractions), self.has_slopes)
        self._sample(self._time(fractions[::-1]), self.has_slopes)
        for index in _SINGLE:
            self._sample(self._time(fractions[index : index + 1]), self.has_slopes)

    def _remember(self, times: Array, values: Array, slopes: Array) -> None:
        """Compare new samples with each other and with earlier ones.

        Raises:
            DimensionError: If two neighbours in time contradict each other or a bound.
        """
        self.count += len(times)
        times = np.concatenate([self._times, times])
        order = np.argsort(times, kind="stable")
        self._times = times[order]
        self._values = np.concatenate([self._values, values])[order]
        self._slopes = np.concatenate([self._slopes, slopes])[order]
        self._contradiction()
        if len(self._times) > _KEPT:
            self._times, self._values, self._slopes = self._times[::2], self._values[::2], self._slopes[::2]

    def _contradiction(self) -> None:
        t, q, s = self._times, self._values, self._slopes
        step, moved = np.diff(t)[:, None], np.diff(q, axis=0)
        unit = SAMPLE_ROUNDOFFS * UNIT_ROUNDOFF
        slack = unit * (1.0 + np.abs(q).max(axis=0)) + self._jitter

        def pair(x: Array, i: int, j: int) -> str:
            return f"{x[i, j]:.9g} at t = {t[i]:.9g} and {x[i + 1, j]:.9g} at t = {t[i + 1]:.9g}"

        def too_fast(i: int, j: int) -> str:
            return f"is {pair(q, i, j)}: faster than its bound of speed, {self.speed[j]:.6g}, allows"

        def too_steep(i: int, j: int) -> str:
            bound = f"more than its bound of speed, {self.speed[j]:.6g}"
            return f"has the derivative {s[i, j]:.9g} at t = {t[i]:.9g}, {bound}"

        def too_bent(i: int, j: int) -> str:
            return f"has the derivatives {pair(s, i, j)}: its bound of acceleration is {self.acceleration[j]:.6g}"

        def apart(i: int, j: int) -> str:
            whose = "the derivative that function(t, 1) gives, or the bound of acceleration"
            return f"is {pair(q, i, j)}; this contradicts {whose}"

        self._refuse(np.abs(moved) - self.speed * step - slack, too_fast)
        if not self.has_slopes:
            return
        rough = unit * (1.0 + self.speed)
        self._refuse(np.abs(s) - self.speed - rough, too_steep)
        self._refuse(np.abs(np.diff(s, axis=0)) - self.acceleration * step - rough, too_bent)
        bent = 0.5 * self.acceleration * step**2 + slack + unit * self.speed * step
        for rate in (s[:-1], s[1:]):
            self._refuse(np.abs(moved - rate * step) - bent, apart)

    def _refuse(self, excess: Array, say: Callable[[int, int], str]) -> None:
        """Raise if any excess (N, n) is positive; NaN (no known derivative) is not."""
        if not np.any(excess > 0.0):
            return
        row, column = np.unravel_index(int(np.nanargmax(excess)), excess.shape)
        message = f"{self.coordinates[column]!r} {say(int(row), int(column))}"
        raise DimensionError(f"{message}; a certificate needs true bounds and true derivatives")
