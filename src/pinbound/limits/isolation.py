"""All contacts along one coordinate, for any use in the path: every root is isolated with a proof, then refined.

`f = |r|^2 - T^2` has `f' = 2 r . r'` and `f'' = 2 (r' . r' + r . r'')`. Lever arms (`derivative_bounds`) bound f'' by
F_2 and f''' by F_3 over the whole domain. An interval of half-width h around m

    has no root           if |f(m)| > |f'(m)| h + F_2 h^2 / 2,
    has at most one       if |f'(m)| > F_2 h, because f is monotone: the signs at its ends decide,
    has at most two       if |f''(m)| > F_3 h, because f' is monotone: it is cut at the root of f', if there is one,

and is halved otherwise. So double roots are recognised, and no root is missed: there is no sampling, and no counting of
sign changes. With several angles `c_i x` of commensurate c_i, f repeats after `2 pi / gcd(c_i)`, and one period is the
domain; otherwise the domain is a window.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction
from functools import reduce

import numpy as np

from pinbound.bounds.derivative_bounds import line_bounds
from pinbound.evaluate import numeric
from pinbound.exceptions import UnsupportedError
from pinbound.path.chain import Chain
from pinbound.path.restriction import restrict
from pinbound.tolerances import CONTOUR_ROUNDING, ROOT
from pinbound.typing import Array

__all__ = [
    "MOST_TURNS",
    "arcs",
    "around",
    "check_turns",
    "common_period",
    "holding",
    "listed_period",
    "outward",
    "wrapped",
]

MOST_TURNS = 10_000.0
"""Largest number of turns of the fastest angle over which contacts are listed; more would give some 20,000
intervals."""

_PIECES = 16  # intervals at the start
_MOST_OPEN = 1 << 16  # intervals: more mean that the function is zero, up to rounding, along an interval
_LARGEST_DENOMINATOR = 24
_COMMENSURATE = 1e-12


def common_period(coefficients: Array) -> float | None:
    """Return the smallest common period of angles `c_i x`; None if there is none of at most 24 turns.

    Example:
        >>> [None if p is None else round(p / np.pi, 12) for p in map(common_period, ([1, -2], [1, 0.5], [1, 2**0.5]))]
        [2.0, 4.0, None]
    """
    base = float(coefficients[0])
    ratios = [Fraction(float(c) / base).limit_denominator(_LARGEST_DENOMINATOR) for c in coefficients]
    if any(abs(float(c) / base - float(r)) > _COMMENSURATE * abs(r) for c, r in zip(coefficients, ratios, strict=True)):
        return None
    greatest = reduce(
        lambda a, b: Fraction(
            math.gcd(a.numerator * b.denominator, b.numerator * a.denominator), a.denominator * b.denominator
        ),
        map(abs, ratios),
    )
    turns = 1 / greatest
    return None if turns > _LARGEST_DENOMINATOR else 2.0 * math.pi * float(turns) / abs(base)


def listed_period(coefficients: Array, window: tuple[float, float] | None) -> float | None:
    """Return the period over which contacts are listed; None: there is no period, or only the window is short enough.

    Example:
        >>> listed_period(np.array([1.0, 1e6]), (0.0, 0.01)), listed_period(np.array([1.0]), (0.0, 0.01))
        (None, 6.283185307179586)
    """
    period = common_period(coefficients)
    if period is None or window is None:
        return period
    fastest = float(np.abs(coefficients).max()) / (2.0 * math.pi)
    return None if fastest * period > MOST_TURNS >= fastest * (window[1] - window[0]) else period


def arcs(
    chain: Chain, index: int, name: str, q: Array, threshold: float, window: tuple[float, float] | None
) -> tuple[Array, float, tuple[float, float]]:
    """Return the open intervals (k, 2) of coordinate `index` with `|r| > threshold`, their period, and the window.

    If `|r|` equals the threshold up to rounding along an interval, this interval counts as contact.

    Raises:
        UnsupportedError: If there is no period and no finite window, or the coordinate rotates the path by more than
            `MOST_TURNS` turns in the window.
    """
    line = restrict(chain, q, [index])
    used = line.coefficients[np.any(line.coefficients, axis=1), 0]
    everywhere = (-math.inf, math.inf)
    if not line.rotations and not np.any(line.slides):
        clear = float(np.linalg.norm(line.offsets[0])) > threshold
        return np.array([everywhere] if clear else []).reshape(-1, 2), math.inf, everywhere
    period = listed_period(used, window) if len(used) and not np.any(line.slides) else None
    if period is None and (window is None or not all(map(math.isfinite, window))):
        raise UnsupportedError(
            f"{name!r} rotates the path by angles without a common period, or rotates and translates it; without joint "
            "limits its contacts never repeat: give window=(lower, upper)"
        )
    low, high = (-period / 2, period / 2) if period is not None else window or everywhere
    check_turns(name, used, low, high)
    function = _Function(line, threshold, max(abs(low), abs(high)))
    free = _free_intervals(function, low, high)
    if period is None:
        return free, math.inf, (low, high)
    return *wrapped(free, low, high, period), everywhere


def around(
    chain: Chain, index: int, name: str, q: Array, threshold: float, domain: tuple[float, float]
) -> tuple[float, float] | None:
    """Return the interval of coordinate `index` around q's own value within a domain; None if it is in contact.

    The search goes outwards, so a wide domain costs nothing if contacts are near. Ends of the domain are not contacts.

    Raises:
        UnsupportedError: If no contact is found over `MOST_TURNS` turns.
    """
    line = restrict(chain, q, [index])
    used = line.coefficients[np.any(line.coefficients, axis=1), 0]
    value = float(q[index])

    stands_still = not len(used) and not np.any(line.slides)
    if stands_still or not domain[0] < domain[1]:
        return domain if float(numeric.norm(numeric.positions(line, np.array([[value]])))[0]) > threshold else None

    def find(low: float, high: float) -> tuple[float, float] | None:
        found = _free_intervals(_Function(line, threshold, max(abs(low), abs(high))), low, high)
        return holding(found, value, (low, high))

    return outward(find, name, value, domain, used, slides=bool(np.any(line.slides)))


def holding(intervals: Array, value: float, domain: tuple[float, float]) -> tuple[float, float] | None:
    """Return the interval (of (k, 2)) that contains a value; the value may be an end of the domain (no contact)."""
    for low, high in intervals.tolist():
        if low < value < high or low == value == domain[0] or high == value == domain[1]:
            return low, high
    return None


def outward(
    find: Callable[[float, float], tuple[float, float] | None],
    name: str,
    value: float,
    domain: tuple[float, float],
    coefficients: Array,
    slides: bool,
) -> tuple[float, float] | None:
    """Return the free interval around a value; the searched part of the domain grows by a factor of four each time.

    A periodic function is searched for one period to either side: if it is free over a period, it is free everywhere.

    Args:
        find: Returns the free interval around the value within (low, high), or None.
        name: Name of the coordinate.
        value: Its value.
        domain: The range of the search; it may be infinite.
        coefficients: Of the angles that the coordinate rotates; not empty.
        slides: Whether the coordinate also translates the path.

    Raises:
        UnsupportedError: If no contact is found over `MOST_TURNS` turns of the fastest angle.
    """
    low, high = domain
    period = None if slides else common_period(coefficients)
    if period is not None:
        low, high = max(low, value - period), min(high, value + period)
    turn = 2.0 * math.pi / float(np.abs(coefficients).max())
    reach = turn
    while True:
        a, b = max(low, value - reach), min(high, value + reach)
        found = find(a, b)
        if found is None:
            return None
        met = found[0] > a, found[1] < b
        if period is not None and not any(met) and b - a >= period:
            return domain
        if (met[0] or a == low) and (met[1] or b == high):
            return found if period is None else _within(found, met, (a, b), domain, period)
        if reach > MOST_TURNS * turn:
            raise UnsupportedError(
                f"{name!r} meets no contact within {MOST_TURNS:.0f} turns from {value:.6g}, and contacts "
                f"further away are not searched; give a window of at most {2.0 * MOST_TURNS * turn:.6g} around it"
            )
        reach *= 4.0


def _within(
    found: tuple[float, float],
    met: tuple[bool, bool],
    looked: tuple[float, float],
    domain: tuple[float, float],
    period: float,
) -> tuple[float, float]:
    """Return an interval; an end without contact is an end of the domain, or the other contact, a period on."""
    lower, upper = found
    if not met[0] and looked[0] != domain[0]:
        lower = upper - period
    if not met[1] and looked[1] != domain[1]:
        upper = found[0] + period
    return max(lower, domain[0]), min(upper, domain[1])


def check_turns(name: str, coefficients: Array, low: float, high: float) -> None:
    """Refuse to list contacts over too many turns.

    Raises:
        UnsupportedError: If the fastest angle makes more than `MOST_TURNS` turns from low to high.
    """
    turns = float(np.abs(coefficients).max(initial=0.0)) * (high - low) / (2.0 * math.pi)
    if turns > MOST_TURNS:
        raise UnsupportedError(
            f"from {low:.6g} to {high:.6g} {name!r} rotates the path {turns:.3g} times, and its contacts are "
            f"too many to list; give a window of at most {MOST_TURNS * (high - low) / turns:.6g}, or call "
            "BoundarySet.limits, which finds the nearest ones only"
        )


def wrapped(free: Array, low: float, high: float, period: float) -> tuple[Array, float]:
    """Join the first and the last interval across the ends of the period."""
    if not len(free) or free[0, 0] > low or free[-1, 1] < high:
        return free, period if len(free) else math.inf
    if len(free) == 1:
        return np.array([[-math.inf, math.inf]]), math.inf
    joined = free[1:].copy()
    joined[-1, 1] = free[0, 1] + period
    return joined, period


class _Function:
    """f with its derivatives and their bounds."""

    def __init__(self, line: Chain, threshold: float, reach: float) -> None:
        self.line, self.threshold = line, threshold
        b0, b1, b2, b3 = line_bounds(line, np.array([reach]), 0)
        self.second, self.third = 2.0 * (b1 * b1 + b0 * b2), 2.0 * (3.0 * b1 * b2 + b0 * b3)
        self.rounding = CONTOUR_ROUNDING * (b0 + threshold) ** 2
        self.slope_rounding = CONTOUR_ROUNDING * 2.0 * b0 * b1

    def value(self, x: Array) -> Array:
        length = numeric.norm(numeric.positions(self.line, x[:, None]))
        return (length - self.threshold) * (length + self.threshold)

    def derivatives(self, x: Array) -> tuple[Array, Array, Array]:
        r, first, second = numeric.along(self.line, 0, x[:, None])
        length = numeric.norm(r)
        value = (length - self.threshold) * (length + self.threshold)
        bend = np.einsum("ni,ni->n", first, first) + np.einsum("ni,ni->n", r, second)
        return value, 2.0 * np.einsum("ni,ni->n", r, first), 2.0 * bend

    def slope(self, x: Array) -> Array:
        return self.derivatives(x)[1]


def _free_intervals(function: _Function, low: float, high: float) -> Array:
    """Return the intervals of a domain with f > 0; everything that is not proven free is contact."""
    edges = np.linspace(low, high, _PIECES + 1)
    middle, half = 0.5 * (edges[1:] + edges[:-1]), (high - low) / (2 * _PIECES)
    monotone: list[Array] = []
    blocked: list[tuple[float, float]] = []
    while len(middle):
        value, slope, bend = function.derivatives(middle)
        empty = np.abs(value) > np.abs(slope) * half + 0.5 * function.second * half * half + function.rounding
        single = np.abs(slope) > function.second * half + function.slope_rounding
        double = np.abs(bend) > function.third * half + 2.0 * function.slope_rounding
        monotone.append(np.stack((middle - half, middle + half), axis=1)[~empty & single])
        humps = np.stack((middle - half, middle + half), axis=1)[~empty & ~single & double]
        extrema = _bracketed(function.slope, humps)
        for (a, b), e in zip(humps, extrema, strict=True):
            inner = [a, b] if math.isnan(e) else [a, e, b]
            monotone.append(np.stack((inner[:-1], inner[1:]), axis=1))
            if not math.isnan(e) and abs(float(function.value(np.array([e]))[0])) <= function.rounding:
                blocked.append((e, e))
        middle = middle[~empty & ~single & ~double]
        if half <= ROOT * max(1.0, abs(low), abs(high)) or len(middle) > _MOST_OPEN:
            blocked += _runs(middle, half)
            break
        half *= 0.5
        middle = np.concatenate((middle - half, middle + half))
    roots = _bracketed(function.value, np.concatenate(monotone))
    return _between(function, roots[~np.isnan(roots)], blocked, low, high)


def _runs(middle: Array, half: float) -> list[tuple[float, float]]:
    """Return intervals `middle +- half`, with touching ones joined."""
    middle = np.sort(middle)
    first = np.diff(middle, prepend=-np.inf) > 2.5 * half
    last = np.append(first[1:], True)[: len(middle)]
    return list(zip((middle[first] - half).tolist(), (middle[last] + half).tolist(), strict=True))


def _between(function: _Function, roots: Array, blocked: list[tuple[float, float]], low: float, high: float) -> Array:
    """Return the pieces between roots on which f is positive, without the blocked ones, and with neighbours joined."""
    marks = np.unique(np.concatenate((roots, np.array(blocked).ravel(), [low, high])))
    free: list[list[float]] = []
    for a, b in zip(marks[:-1].tolist(), marks[1:].tolist(), strict=True):
        m = 0.5 * (a + b)
        if not float(function.value(np.array([m]))[0]) > 0.0 or any(x <= m <= y for x, y in blocked):
            continue
        if free and free[-1][1] == a and not any(x <= a <= y for x, y in blocked) and a not in roots:
            free[-1][1] = b
        else:
            free.append([a, b])
    return np.array(free).reshape(-1, 2)


def _bracketed(function: Callable[[Array], Array], pieces: Array) -> Array:
    """Return the root in each piece (N, 2) whose ends differ in sign, NaN for others; bisection, then secants.

    The step of false position (Illinois) is taken inside the bracket. If it is slow, the bracket is halved. So the root
    is found to the last bits for any function.
    """
    if not len(pieces):
        return np.empty(0)
    a, b = pieces[:, 0].copy(), pieces[:, 1].copy()
    fa, fb = function(a), function(b)
    differ = (fa > 0.0) != (fb > 0.0)
    root = np.full(len(pieces), np.nan)
    a, b, fa, fb = a[differ], b[differ], fa[differ], fb[differ]
    best = 0.5 * (a + b)
    for step in range(120):
        with np.errstate(invalid="ignore", divide="ignore"):
            guess = (a * fb - b * fa) / (fb - fa)
        x = 0.5 * (a + b) if step % 3 == 2 else np.where(np.isfinite(guess), np.clip(guess, a, b), 0.5 * (a + b))
        fx = function(x)
        best = x
        same = (fx > 0.0) == (fa > 0.0)
        a, fa = np.where(same, x, a), np.where(same, fx, 0.5 * fa)
        b, fb = np.where(same, b, x), np.where(same, 0.5 * fb, fx)
        if np.all((b - a <= 4e-16 * np.maximum(np.abs(a), np.abs(b))) | (fx == 0.0)):
            break
    root[differ] = best
    return root
