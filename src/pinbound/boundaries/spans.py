"""Records of answers (limits of a coordinate, the smallest clearance), and the intervals that joint limits allow."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from operator import itemgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pinbound.exceptions import DimensionError
from pinbound.limits import univariate
from pinbound.model.coupling import GuardedLimit, LinearLimit
from pinbound.typing import Array
from pinbound.values import Value

__all__ = [
    "ContactAngle",
    "CoordinateLimits",
    "Smallest",
    "checked_window",
    "guarded_span",
    "guarded_spans",
    "linear_span",
    "linear_spans",
    "tighten",
]


@dataclass(frozen=True, eq=False)
class ContactAngle(Value):
    """The values of the effective angle `phi = coefficients @ q` at which a boundary is in contact.

    Attributes:
        coefficients: (n,), one for each active coordinate.
        text: The effective angle for people, e.g. ``"q3 - q2"``.
        angle: phi* [rad], in (-pi, pi]; contacts repeat every turn.
        half_width: w [rad]; contact is the strip `phi* +- w`. 0: a stop. None: never in contact.
        smallest: [m], the smallest norm over a turn. For a stop it is the distance of the two points at contact.
        is_stop: Whether it is a stop: declared, or because its arms are equally long.

    Example:
        >>> import pinbound as pb
        >>> contact = pb.load("minervabot_v3").boundaries["beta_4"].contact
        >>> contact.text, round(float(np.degrees(contact.angle)), 6), contact.is_stop
        ('q3 - q2', 32.42912, True)
    """

    coefficients: Array
    text: str
    angle: float
    half_width: float | None
    smallest: float
    is_stop: bool = False

    def gap(self, phi: float) -> tuple[float, float]:
        """Return the open interval without contact around `phi` [rad]; NaN if phi is in contact.

        Example:
            >>> ContactAngle(np.array([1.0]), "q1", 1.0, 0.25, 0.0).gap(0.0)
            (-5.03..., 0.75)
        """
        if self.half_width is None:
            return -math.inf, math.inf
        return univariate.gap_around(self.angle, self.half_width, phi)


@dataclass(frozen=True)
class CoordinateLimits(Value):
    """How far one coordinate can move from a configuration, and what stops it.

    Attributes:
        coordinate: Its name.
        value: Its value [rad or m].
        lower: [rad or m], lower end of the interval around the value, may be -inf; NaN if the value is not allowed.
        upper: [rad or m] upper end, may be inf; NaN if the value is not allowed.
        lower_stop: Boundary or joint limit at the lower end; None if there is none.
        upper_stop: Boundary or joint limit at the upper end; None if there is none.
        blocked_by: Boundaries whose signed clearance is not positive at the configuration, and limits that it passes.
        beyond: Boundaries whose contact lies between home and this configuration, which makes it unreachable.

    Example:
        >>> import pinbound as pb
        >>> found = pb.load("minervabot_v3").boundaries.limits("q2", [0.0, 0.0, 0.0])
        >>> found.upper_stop, round(float(np.degrees(found.upper)), 6)
        ('beta_8', 68.504624)
    """

    coordinate: str
    value: float
    lower: float
    upper: float
    lower_stop: str | None
    upper_stop: str | None
    blocked_by: tuple[str, ...] = ()
    beyond: tuple[str, ...] = ()

    @classmethod
    def of(
        cls,
        coordinate: str,
        value: float,
        spans: Sequence[tuple[str, tuple[float, float] | None]],
        beyond: tuple[str, ...],
    ) -> CoordinateLimits:
        """Return the intersection of intervals around the value, each with its name; None: the value is not allowed.

        Args:
            coordinate: Its name.
            value: Its value [rad or m].
            spans: The interval that each boundary or limit allows, by its name [rad or m].
            beyond: Boundaries whose contact lies between home and the value.

        Example:
            >>> CoordinateLimits.of("q", 0.0, [("q", (-1.0, 1.0)), ("b", (-2.0, 0.5))], ()).upper_stop
            'b'
        """
        blocked = tuple(name for name, span in spans if span is None)
        if blocked:
            return cls(coordinate, value, math.nan, math.nan, None, None, blocked, beyond)
        first = itemgetter(0)  # of several at one place the first is named: joint limits, then boundaries, in order
        lower, lower_stop = max(((span[0], name) for name, span in spans if span), default=(-math.inf, ""), key=first)
        upper, upper_stop = min(((span[1], name) for name, span in spans if span), default=(math.inf, ""), key=first)
        return cls(
            coordinate,
            value,
            lower,
            upper,
            lower_stop if math.isfinite(lower) else None,
            upper_stop if math.isfinite(upper) else None,
            beyond=beyond,
        )


@dataclass(frozen=True)
class Smallest:
    """The smallest signed clearance of a set, and which boundary has it.

    Attributes:
        clearance: [m], signed: a float or (N,); inf if there is no boundary, NaN if one of them is NaN.
        index: Position of that boundary in the set, an int or (N,); -1 if there is no boundary, or a NaN. If several
            clearances are equal up to rounding, it is one of them.

    Example:
        >>> import pinbound as pb
        >>> B = pb.load("minervabot_v3").boundaries
        >>> found = B.smallest(np.zeros((2, 3)))
        >>> found.clearance.shape, B.names[found.index[0]]
        ((2,), 'beta_9')
    """

    clearance: Any
    index: Any


def tighten(ends: Array, stops: NDArray[np.object_], name: str, spans: Array) -> None:
    """Intersect intervals (N, 2) with others, in place. NaN means no interval, and stays."""
    lower, upper = spans[:, 0] > ends[:, 0], spans[:, 1] < ends[:, 1]
    ends[lower, 0], ends[upper, 1] = spans[lower, 0], spans[upper, 1]
    stops[lower, 0], stops[upper, 1] = name, name
    nothing = np.any(np.isnan(spans), axis=1)
    ends[nothing] = np.nan
    stops[np.any(np.isnan(ends), axis=1)] = ""


def linear_spans(limit: LinearLimit, index: int, Q: Array) -> Array:
    """Return the intervals (N, 2) of coordinate `index` that one joint limit allows; NaN where Q is outside it."""
    c = float(limit.coefficients[index])
    spans = np.tile([-math.inf, math.inf], (len(Q), 1))
    if c != 0.0:
        value = Q[:, index, None]
        ends = np.sort(value + (np.array([limit.lower, limit.upper]) - limit.values(Q)[:, None]) / c, axis=1)
        spans = np.concatenate((np.minimum(ends[:, :1], value), np.maximum(ends[:, 1:], value)), axis=1)
    spans[~limit.holds(Q)] = np.nan
    return spans


def guarded_spans(limit: GuardedLimit, index: int, Q: Array) -> Array:
    """Return the intervals (N, 2) of coordinate `index` around its values that one guarded limit allows; NaN: none.

    The forbidden values of the coordinate satisfy every condition and pass the end. They form one interval, because
    this set is convex. The allowed interval ends at it, on the side of the value.
    """
    value = Q[:, index]
    first, last = np.full(len(Q), -math.inf), np.full(len(Q), math.inf)
    for one, broken in ((limit.limit, True), *((condition, False) for condition in limit.where)):
        c, rest = float(one.coefficients[index]), one.values(Q)
        low, high = one.lower, one.upper
        if broken:  # beyond its one finite end
            low, high = (high, math.inf) if math.isfinite(high) else (-math.inf, low)
        if c == 0.0:
            never = one.holds(Q) if broken else ~one.holds(Q)
            first[never], last[never] = math.inf, -math.inf
            continue
        ends = np.sort(value[:, None] + (np.array([low, high]) - rest[:, None]) / c, axis=1)
        np.maximum(first, ends[:, 0], out=first)
        np.minimum(last, ends[:, 1], out=last)
    spans = np.tile([-math.inf, math.inf], (len(Q), 1))
    some = first <= last
    below = some & (last - value > value - first)
    above = some & ~below
    spans[below, 1] = np.maximum(first, value)[below]
    spans[above, 0] = np.minimum(last, value)[above]
    spans[~limit.holds(Q)] = np.nan
    return spans


def guarded_span(limit: GuardedLimit, index: int, q: Array) -> tuple[float, float] | None:
    """Return the interval of coordinate `index` around its value that a guarded limit allows; others are those of q."""
    low, high = guarded_spans(limit, index, q[None])[0].tolist()
    return None if math.isnan(low) else (low, high)


def linear_span(limit: LinearLimit, index: int, q: Array) -> tuple[float, float] | None:
    """Return the interval of coordinate `index` that one joint limit allows; the other coordinates are those of q."""
    low, high = linear_spans(limit, index, q[None])[0].tolist()
    return None if math.isnan(low) else (low, high)


def checked_window(window: Any) -> tuple[float, float]:
    """Return a window as two numbers; the first is the lower one.

    Raises:
        DimensionError: If the window is not two increasing finite numbers.

    Example:
        >>> checked_window([-1, 2])
        (-1.0, 2.0)
    """
    try:
        low, high = (float(end) for end in window)
    except (TypeError, ValueError) as error:
        raise DimensionError(f"the window {window!r} is not two numbers; give window=(lower, upper)") from error
    if not low < high:  # also if one is NaN
        raise DimensionError(f"the window ({low}, {high}) is empty; give window=(lower, upper), the lower end first")
    return low, high
