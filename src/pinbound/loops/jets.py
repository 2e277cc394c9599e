"""Jets: a value and its first two derivatives in one direction, for arrays or intervals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from pinbound.bounds import intervals
from pinbound.bounds.intervals import Interval
from pinbound.typing import Array, Flags

__all__ = [
    "Jet",
    "arctan2",
    "cos",
    "jet_root",
    "quotient_rate",
    "ratio",
    "root_below",
    "sin",
    "sqrt",
    "squared",
    "where",
]

T = TypeVar("T", Array, Interval)

_NO_BOUND = 1e30  # of a second derivative at a kink; times any length it is more than any path


@dataclass(frozen=True, eq=False)
class Jet:
    """A value and its first two derivatives by one parameter: arrays, or intervals."""

    value: Any
    first: Any
    second: Any

    def __add__(self, other: Jet) -> Jet:
        """Return the sum."""
        return Jet(self.value + other.value, self.first + other.first, self.second + other.second)

    def __mul__(self, other: Jet) -> Jet:
        """Return the product."""
        a, b = self, other
        return Jet(
            a.value * b.value,
            a.first * b.value + a.value * b.first,
            a.second * b.value + 2.0 * (a.first * b.first) + a.value * b.second,
        )

    def __sub__(self, other: Jet) -> Jet:
        """Return the difference."""
        return self + other.times(-1.0)

    def times(self, factor: float) -> Jet:
        """Return the jet times a constant."""
        if factor == 1.0:
            return self
        return Jet(self.value * factor, self.first * factor, self.second * factor)

    def plus(self, constant: float) -> Jet:
        """Return the jet plus a constant."""
        return Jet(self.value + constant, self.first, self.second) if constant else self

    def squared(self) -> Jet:
        """Return the square."""
        slope = 2.0 * self.value
        return Jet(squared(self.value), slope * self.first, 2.0 * squared(self.first) + slope * self.second)

    def turned(self) -> tuple[Jet, Jet]:
        """Return cosine and sine."""
        c, s, rate = cos(self.value), sin(self.value), squared(self.first)
        return (
            Jet(c, -(s * self.first), -(c * rate + s * self.second)),
            Jet(s, c * self.first, c * self.second - s * rate),
        )

    def clipped(self, low: float, high: float) -> Jet:
        """Return the value limited to [low, high]: beyond an end it is constant."""
        value = self.value
        if isinstance(value, Interval):
            outside = (value.upper <= low) | (value.lower >= high)
            across = ~outside & ((value.lower < low) | (value.upper > high))
            first = where(outside, Interval.at(np.zeros(len(outside))), self.first)
            second = where(outside, Interval.at(np.zeros(len(outside))), self.second)
            wide = np.full(len(outside), _NO_BOUND)
            return Jet(
                value.clipped(low, high),
                where(across, intervals.hull(first, 0.0), first),
                where(across, Interval(-wide, wide), second),
            )
        held = (value < low) | (value > high)
        return Jet(np.clip(value, low, high), np.where(held, 0.0, self.first), np.where(held, 0.0, self.second))


def where(condition: Flags, x: Interval, y: Interval) -> Interval:
    """Return x where a condition holds, else y."""
    return Interval(np.where(condition, x.lower, y.lower), np.where(condition, x.upper, y.upper))


def squared(x: T) -> T:
    """Return `x^2`."""
    return x.squared() if isinstance(x, Interval) else x * x


def sqrt(x: T) -> T:
    """Return the root; an interval that extends below zero because of rounding is cut at zero."""
    if isinstance(x, Interval):
        return intervals.sqrt(Interval(np.maximum(x.lower, 0.0), np.maximum(x.upper, 0.0)))
    return np.sqrt(x)


def cos(x: T) -> T:
    """Return the cosine."""
    return intervals.cos(x) if isinstance(x, Interval) else np.cos(x)


def sin(x: T) -> T:
    """Return the sine."""
    return intervals.sin(x) if isinstance(x, Interval) else np.sin(x)


def arctan2(y: Any, x: Any) -> Any:
    """Return the angle of (x, y)."""
    return intervals.arctan2(y, x) if isinstance(x, Interval) else np.arctan2(y, x)


def root_below(Y: float, y: Jet) -> Jet:
    """Return `sqrt(Y^2 - y^2)`."""
    value = sqrt((Y - y.value) * (Y + y.value))
    first = -(y.value * y.first) / value
    return Jet(value, first, -(squared(y.first) + y.value * y.second + squared(first)) / value)


def jet_root(x: Jet) -> Jet:
    """Return the root."""
    value = sqrt(x.value)
    first = 0.5 * x.first / value
    return Jet(value, first, (0.5 * x.second - squared(first)) / value)


def ratio(x: Jet, y: Jet) -> Jet:
    """Return a jet with the derivatives of an integral of `x' / y`; its value has no meaning."""
    first = x.first / y.value
    return Jet(x.value, first, (x.second - first * y.first) / y.value)


def quotient_rate(x: Jet, y: Jet) -> tuple[Any, Any]:
    """Return the first two derivatives of an integral of `x' / y`."""
    first = x.first / y.value
    return first, (x.second - first * y.first) / y.value
