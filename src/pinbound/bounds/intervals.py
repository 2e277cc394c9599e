"""Interval arithmetic on arrays: every result contains all values for its operands, with rounding.

Sums, products and roots of float64 are rounded to the nearest number, so widening the result by one unit roundoff is
sufficient. Sines and arctangents of NumPy have errors of at most four units; they are widened by eight.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pinbound.tolerances import UNIT_ROUNDOFF
from pinbound.typing import Array, Flags

__all__ = ["Interval", "arctan2", "cos", "hull", "sin", "sqrt"]


_TINY = 1e-300  # below this, a relative widening may vanish
_ULPS = 8.0
_TURN = 2.0 * np.pi


@dataclass(frozen=True, eq=False)
class Interval:
    """`[lower, upper]`, arrays of one shape.

    Example:
        >>> x = Interval.at(np.array([0.1])) + 0.2
        >>> bool(x.lower[0] <= 0.3 < x.upper[0]), bool(x.upper[0] - x.lower[0] < 1e-15)
        (True, True)
    """

    lower: Array
    upper: Array

    __array_ufunc__ = None  # for an array times an interval, the method of the interval is called

    @classmethod
    def at(cls, value: Array, radius: Array | float = 0.0) -> Interval:
        """Return `value +- radius`."""
        if np.ndim(radius) == 0 and radius == 0.0:
            return cls(value, value)
        return _outwards(value - radius, value + radius)

    @property
    def middle(self) -> Array:
        """The middle, up to rounding."""
        return 0.5 * (self.lower + self.upper)

    @property
    def radius(self) -> Array:
        """The largest distance of the interval's points from `middle`, rounded up."""
        middle = self.middle
        return np.maximum(self.upper - middle, middle - self.lower) * (1.0 + 4.0 * UNIT_ROUNDOFF)

    @property
    def magnitude(self) -> Array:
        """The largest absolute value."""
        return np.maximum(np.abs(self.lower), np.abs(self.upper))

    def __neg__(self) -> Interval:
        """Return `-x`."""
        return Interval(-self.upper, -self.lower)

    def __add__(self, other: Interval | Array | float) -> Interval:
        """Return `x + y`."""
        y = _as_interval(other)
        return _outwards(self.lower + y.lower, self.upper + y.upper)

    __radd__ = __add__

    def __sub__(self, other: Interval | Array | float) -> Interval:
        """Return `x - y`."""
        return self + (-_as_interval(other))

    def __rsub__(self, other: Array | float) -> Interval:
        """Return `y - x`."""
        return (-self) + other

    def __mul__(self, other: Interval | Array | float) -> Interval:
        """Return `x y`."""
        y = _as_interval(other)
        ends = (self.lower * y.lower, self.lower * y.upper, self.upper * y.lower, self.upper * y.upper)
        low, high = np.minimum(ends[0], ends[1]), np.maximum(ends[0], ends[1])
        return _outwards(np.minimum(low, np.minimum(ends[2], ends[3])), np.maximum(high, np.maximum(ends[2], ends[3])))

    __rmul__ = __mul__

    def __truediv__(self, other: Interval | Array | float) -> Interval:
        """Return `x / y`; y must not contain zero."""
        y = _as_interval(other)
        return self * _outwards(1.0 / y.upper, 1.0 / y.lower)

    def squared(self) -> Interval:
        """Return `x^2`, which is nowhere negative."""
        a, b = self.lower * self.lower, self.upper * self.upper
        least = np.where((self.lower <= 0.0) & (self.upper >= 0.0), 0.0, np.minimum(a, b))
        found = _outwards(least, np.maximum(a, b))
        return Interval(np.maximum(found.lower, 0.0), found.upper)

    def clipped(self, low: float, high: float) -> Interval:
        """Return `min(max(x, low), high)`."""
        return Interval(np.clip(self.lower, low, high), np.clip(self.upper, low, high))

    def meet(self, other: Interval) -> Interval:
        """Return the intersection; it is not empty, because both intervals contain the true value."""
        return Interval(np.maximum(self.lower, other.lower), np.minimum(self.upper, other.upper))


def hull(x: Interval, y: Interval | float) -> Interval:
    """Return the smallest interval that contains both."""
    other = _as_interval(y)
    return Interval(np.minimum(x.lower, other.lower), np.maximum(x.upper, other.upper))


def sqrt(x: Interval) -> Interval:
    """Return the square root of an interval that is nowhere negative."""
    return _outwards(np.sqrt(x.lower), np.sqrt(x.upper))


def cos(x: Interval) -> Interval:
    """Return the cosine, with extremes inside the interval.

    Example:
        >>> found = cos(Interval(np.array([-1.0, 0.5]), np.array([2.0, 1.0])))
        >>> found.upper.round(6).tolist(), found.lower.round(6).tolist()
        ([1.0, 0.877583], [-0.416147, 0.540302])
    """
    a, b = np.cos(x.lower), np.cos(x.upper)
    low, high = np.minimum(a, b) - _ULPS * UNIT_ROUNDOFF, np.maximum(a, b) + _ULPS * UNIT_ROUNDOFF
    high = np.where(_holds(x, 0.0), 1.0, high)
    low = np.where(_holds(x, np.pi), -1.0, low)
    return Interval(np.maximum(low, -1.0), np.minimum(high, 1.0))


def sin(x: Interval) -> Interval:
    """Return the sine, with extremes inside the interval."""
    a, b = np.sin(x.lower), np.sin(x.upper)
    low, high = np.minimum(a, b) - _ULPS * UNIT_ROUNDOFF, np.maximum(a, b) + _ULPS * UNIT_ROUNDOFF
    high = np.where(_holds(x, 0.5 * np.pi), 1.0, high)
    low = np.where(_holds(x, -0.5 * np.pi), -1.0, low)
    return Interval(np.maximum(low, -1.0), np.minimum(high, 1.0))


def arctan2(y: Interval, x: Interval) -> Interval:
    """Return the angle of (x, y), near `arctan2` of the middles, without a jump at pi; a full turn if 0 is inside.

    The box is rotated so that its middle is on the positive x axis; then the extreme angles are at corners.

    Example:
        >>> found = arctan2(Interval.at(np.array([0.0]), 0.1), Interval.at(np.array([-1.0]), 0.1))
        >>> bool(abs(found.middle[0] - np.pi) < 1e-9), round(float(found.radius[0]), 3)
        (True, 0.111)
    """
    middle = np.arctan2(y.middle, x.middle)
    c, s = np.cos(middle), np.sin(middle)
    ulp = _ULPS * UNIT_ROUNDOFF
    cc, ss = Interval.at(c, ulp), Interval.at(s, ulp)
    ahead, aside = x * cc + y * ss, y * cc - x * ss
    inside = ahead.lower > 0.0
    near = np.where(inside, ahead.lower, 1.0)
    far = np.where(inside, ahead.upper, 1.0)
    ends = [np.arctan2(end, reach) for end in (aside.lower, aside.upper) for reach in (near, far)]
    low = middle + np.minimum(np.minimum(ends[0], ends[1]), np.minimum(ends[2], ends[3]))
    high = middle + np.maximum(np.maximum(ends[0], ends[1]), np.maximum(ends[2], ends[3]))
    slack = 4.0 * ulp * np.pi
    low, high = np.where(inside, low, middle - np.pi), np.where(inside, high, middle + np.pi)
    return Interval(low - slack, high + slack)


def _holds(x: Interval, angle: float) -> Flags:
    """Return whether the interval may contain `angle + 2 pi k` for a whole number k."""
    slack = 16.0 * UNIT_ROUNDOFF * (1.0 + x.magnitude)
    return np.ceil((x.lower - slack - angle) / _TURN) * _TURN + angle <= x.upper + slack


def _as_interval(x: Interval | Array | float) -> Interval:
    if isinstance(x, Interval):
        return x
    value = np.asarray(x, dtype=np.float64)
    return Interval(value, value)


def _outwards(low: Array, high: Array) -> Interval:
    step = 2.0 * UNIT_ROUNDOFF
    return Interval(low - (np.abs(low) * step + _TINY), high + (np.abs(high) * step + _TINY))
