"""Motions as the certificates read them: pieces in Bernstein form, or a function with bounds of its derivatives.

A polynomial in Bernstein form lies in the hull of its control points, and so do its derivatives in the hulls of
theirs; restricted to a part of a piece the hull shrinks with it. Straight segments are pieces of degree one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pinbound.coupling import as_configurations
from pinbound.exceptions import DimensionError, UnsupportedError
from pinbound.interpreters.bounds import Expansion
from pinbound.tolerances import UNIT_ROUNDOFF

__all__ = ["BoundedMotion", "Polynomials", "Trajectory", "as_trajectory"]

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_PROBES = 65
_CONVERSION = 64
"""Unit roundoffs per degree that a change of polynomial basis may cost, relative to the sum of its terms."""


class Trajectory(Protocol):
    """What a certificate needs of a motion."""

    @property
    def starts(self) -> Array:
        """(K,) times at which its pieces start."""
        ...

    @property
    def durations(self) -> Array:
        """(K,) of its pieces."""
        ...

    @property
    def degree(self) -> int:
        """Rounding of q grows with it."""
        ...

    @property
    def extent(self) -> tuple[Array, Array]:
        """Corners (n,) of a box that q never leaves, widened by rounding."""
        ...

    def at(self, piece: Indices, u: Array) -> Array:
        """Return q (N, n) at the fractions u of pieces."""
        ...

    def expand(self, piece: Indices, a: Array, b: Array) -> Expansion:
        """Return what is known of q on the parts [a, b] of pieces."""
        ...


@dataclass(frozen=True)
class Polynomials:
    """Polynomial pieces, one after the other.

    Attributes:
        controls: (K, d + 1, n) control points of each piece, in [0, 1].
        starts: (K,).
        durations: (K,).
        radius: (n,) how far the true motion may be from the one of these control points; 0 for straight segments.
    """

    controls: Array
    starts: Array
    durations: Array
    radius: Array

    @property
    def degree(self) -> int:
        """Degree of the pieces."""
        return self.controls.shape[1] - 1

    @property
    def extent(self) -> tuple[Array, Array]:
        """Hull of all control points."""
        lower, upper = self.controls.min(axis=(0, 1)), self.controls.max(axis=(0, 1))
        return lower - self.radius, upper + self.radius

    @cached_property
    def _first(self) -> Array:
        return self.degree * np.diff(self.controls, axis=1) if self.degree else np.zeros_like(self.controls)

    @cached_property
    def _second(self) -> Array:
        if self.degree < 2:
            return np.zeros_like(self.controls[:, :1])
        return (self.degree - 1) * np.diff(self._first, axis=1)

    def at(self, piece: Indices, u: Array) -> Array:
        """Return q by de Casteljau's scheme; exact at u = 0 and u = 1."""
        return _blossom(self.controls[piece], [u] * self.degree)

    def expand(self, piece: Indices, a: Array, b: Array) -> Expansion:
        """Restrict pieces, and their derivatives, to [a, b]; each by its own control points."""
        width = (b - a)[:, None, None]
        middle = 0.5 * (a + b)
        first, second = self._first, self._second
        slopes = _restrict(first[piece], a, b) * width
        slope = _blossom(first[piece], [middle] * (first.shape[1] - 1)) * width[:, 0]
        bends = _restrict(second[piece], a, b) * width**2
        loose = 2.0 * self.degree * self.radius * width[:, 0]
        return Expansion(
            middle=self.at(piece, middle),
            middle_radius=self.radius,
            slope=slope,
            values=_restrict(self.controls[piece], a, b),
            value_radius=self.radius,
            slopes=slopes,
            slope_radius=loose,
            bends=bends,
            bend_radius=2.0 * self.degree * loose * width[:, 0],
        )


def _blossom(controls: Array, arguments: Sequence[Array]) -> Array:
    """Return the polar form (N, n) of polynomials (N, d + 1, n) at d arguments (N,); all equal: their value."""
    points = controls
    for u in arguments:
        fraction = u[:, None, None]
        points = np.where(fraction == 1.0, points[:, 1:], points[:, :-1] + fraction * (points[:, 1:] - points[:, :-1]))
    return points[:, 0]


def _restrict(controls: Array, a: Array, b: Array) -> Array:
    """Return the control points of the same polynomials on [a, b]."""
    degree = controls.shape[1] - 1
    return np.stack([_blossom(controls, [a] * (degree - j) + [b] * j) for j in range(degree + 1)], axis=1)


@dataclass(frozen=True)
class BoundedMotion:
    """A function of time with bounds of its derivatives, e.g. a path of `toppra`.

    The bounds are the caller's word: a certificate is as good as they are. They are tried on a few pairs of times.

    Attributes:
        function: q (N, n) = function(t), t (N,); with `acceleration` also function(t, 1), the first derivative, as
            SciPy's splines and toppra's paths offer it.
        start: First time.
        end: Last time.
        speed: (n,) bounds of |dq/dt|.
        acceleration: (n,) bounds of |d^2q/dt^2|, or None; with it the cost near contact is far smaller.

    Example:
        >>> import pinbound as pb
        >>> robot = pb.load("minervabot_v3")
        >>> swing = lambda t: np.column_stack([0.0 * t, 0.2 * np.sin(t) + 0.2, 0.3 + 0.0 * t])
        >>> pb.certify(robot, pb.BoundedMotion(swing, 0.0, 6.0, speed=(0.0, 0.2, 0.0))).verdict
        <Verdict.CERTIFIED: 'certified'>
    """

    function: Callable[..., Any]
    start: float
    end: float
    speed: ArrayLike
    acceleration: ArrayLike | None = None

    @property
    def degree(self) -> int:
        """Values are taken as the function gives them."""
        return 1

    @property
    def starts(self) -> Array:
        """One piece."""
        return np.array([float(self.start)])

    @property
    def durations(self) -> Array:
        """One piece."""
        return np.array([float(self.end) - float(self.start)])

    @cached_property
    def _bounds(self) -> tuple[Array, Array]:
        speed = np.asarray(self.speed, dtype=np.float64)
        acceleration = np.zeros_like(speed) if self.acceleration is None else np.asarray(self.acceleration, np.float64)
        return speed, acceleration

    @property
    def extent(self) -> tuple[Array, Array]:
        """Box around the middle of the motion that its speed cannot leave."""
        middle = self.at(np.zeros(1, dtype=np.intp), np.array([0.5]))[0]
        room = self._bounds[0] * self.durations[0] / 2.0 * (1.0 + 4.0 * UNIT_ROUNDOFF)
        return middle - room, middle + room

    def at(self, piece: Indices, u: Array) -> Array:
        """Call the function."""
        return self._call(self.start + u * self.durations[0])

    def _call(self, times: Array, *order: int) -> Array:
        values = np.asarray(self.function(times, *order), dtype=np.float64)
        if values.shape != (len(times), len(self._bounds[0])):
            expected = (len(times), len(self._bounds[0]))
            raise DimensionError(
                f"the motion's function gives shape {values.shape} for {expected}: (times, coordinates)"
            )
        if not np.all(np.isfinite(values)):
            bad = float(times[np.flatnonzero(~np.all(np.isfinite(values), axis=1))[0]])
            raise DimensionError(f"the motion's function is not finite at t = {bad:.9g}")
        return values

    def expand(self, piece: Indices, a: Array, b: Array) -> Expansion:
        """Widen the middle of a part by what the derivatives allow."""
        span = ((b - a) * self.durations[0])[:, None]
        speed, acceleration = self._bounds
        middle = self.at(piece, 0.5 * (a + b))
        zero = np.zeros_like(middle)
        jitter = speed * (4.0 * UNIT_ROUNDOFF * max(abs(self.start), abs(self.end)))  # times are rounded too
        known = self.acceleration is not None
        slope = self._call(self.start + 0.5 * (a + b) * self.durations[0], 1) * span if known else zero
        return Expansion(
            middle=middle,
            middle_radius=jitter,
            slope=slope,
            values=middle[:, None],
            value_radius=0.5 * speed * span + jitter,
            slopes=zero[:, None],
            slope_radius=speed * span,
            bends=zero[:, None] if known else None,
            bend_radius=acceleration * span**2,
        )

    def check(self, n: int) -> None:
        """Try the bounds.

        Raises:
            DimensionError: If shapes or times do not fit, or two probes are further apart than the speed allows.
        """
        speed, acceleration = self._bounds
        if speed.shape != (n,) or acceleration.shape != (n,):
            raise DimensionError(f"speed and acceleration have shapes {speed.shape}, {acceleration.shape}; give ({n},)")
        if not np.all(np.isfinite(speed)) or not np.all(np.isfinite(acceleration)) or min(*speed, *acceleration) < 0.0:
            raise DimensionError("bounds of speed and acceleration must be finite and not negative")
        if not (math.isfinite(self.start) and math.isfinite(self.end) and self.start <= self.end):
            raise DimensionError(f"the motion runs from {self.start} to {self.end}; give finite times in order")
        times = np.linspace(self.start, self.end, _PROBES)
        probes = self._call(times)
        allowed = speed * np.diff(times)[:, None]
        slack = 1e3 * UNIT_ROUNDOFF * (1.0 + np.abs(probes).max())
        excess = np.abs(np.diff(probes, axis=0)) - allowed
        if excess.max() > slack:
            row, column = np.unravel_index(int(np.argmax(excess)), excess.shape)
            message = f"coordinate {column} moves faster than its bound {speed[column]:.6g} near t = {times[row]:.6g}"
            raise DimensionError(f"{message}; a certificate needs a true bound")


def as_trajectory(motion: Any, coordinates: Sequence[str], times: ArrayLike | None = None) -> Trajectory:
    """Return a motion in the form that certificates read.

    Args:
        motion: Waypoints (N, n) with straight segments between, or a `scipy.interpolate` PPoly, CubicSpline, BPoly
            or BSpline of values (n,), or a `BoundedMotion`.
        coordinates: Names of the active coordinates.
        times: (N,) increasing times of waypoints; None: 0, 1, ... Not for splines, which have their own.

    Raises:
        DimensionError: If shapes do not fit, something is not finite, or times do not increase.
        UnsupportedError: If it is no motion that can be certified.
    """
    n = len(coordinates)
    if isinstance(motion, BoundedMotion):
        motion.check(n)
    if isinstance(motion, BoundedMotion) or hasattr(motion, "c"):
        if times is not None:
            raise DimensionError("times belong to waypoints; a spline or function has its own")
        return motion if isinstance(motion, BoundedMotion) else _from_spline(motion, n)
    if callable(motion):
        raise UnsupportedError(
            f"a {type(motion).__name__} says nothing about what lies between two of its times; wrap it as "
            "pb.BoundedMotion(function, start, end, speed=...) with bounds of its derivatives"
        )
    Q = as_configurations(motion, coordinates)
    Q = Q[None] if Q.ndim == 1 else Q
    if not len(Q):
        raise DimensionError("the motion has no waypoint")
    bad = np.flatnonzero(~np.all(np.isfinite(Q), axis=1))
    if bad.size:
        raise DimensionError(f"waypoint {bad[0]} of the motion is not finite: {Q[bad[0]].tolist()}")
    knots = _times(times, len(Q))
    ends = Q if len(Q) > 1 else np.repeat(Q, 2, axis=0)
    durations = np.diff(knots) if len(Q) > 1 else np.zeros(1)
    controls = np.stack([ends[:-1], ends[1:]], axis=1)
    return Polynomials(controls, knots[: len(controls)], durations, np.zeros(n))


def _times(times: ArrayLike | None, count: int) -> Array:
    if times is None:
        return np.arange(count, dtype=np.float64)
    try:
        knots = np.asarray(times, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise DimensionError(f"times are no array of numbers: {error}") from error
    if knots.shape != (count,):
        raise DimensionError(f"times have shape {knots.shape}; give one a waypoint, ({count},)")
    if not np.all(np.isfinite(knots)):
        raise DimensionError(f"time {int(np.flatnonzero(~np.isfinite(knots))[0])} is not finite")
    falling = np.flatnonzero(np.diff(knots) <= 0.0)
    if falling.size:
        row = int(falling[0])
        raise DimensionError(f"times must increase: t[{row + 1}] = {knots[row + 1]:g} after t[{row}] = {knots[row]:g}")
    return knots


def _from_spline(spline: Any, n: int) -> Polynomials:
    """Return a SciPy spline in Bernstein form, each piece on its own interval."""
    from scipy import interpolate

    interpolation: Any = interpolate
    if isinstance(spline, interpolation.BSpline):
        first, last = float(spline.t[spline.k]), float(spline.t[-spline.k - 1])
        columns = np.asarray(spline.c, dtype=np.float64)
        if columns.ndim != 2 or columns.shape[1] != n:
            raise DimensionError(f"the spline has values of shape {columns.shape[1:]}; give ({n},)")
        each = [interpolation.PPoly.from_spline((spline.t, column, spline.k)) for column in columns.T]
        spline = interpolation.PPoly(np.stack([one.c for one in each], axis=-1), each[0].x)
    elif isinstance(spline, (interpolation.PPoly, interpolation.BPoly)):
        first, last = float(spline.x[0]), float(spline.x[-1])
    else:
        raise UnsupportedError(f"a {type(spline).__name__} is no PPoly, BPoly or BSpline of SciPy")
    coefficients, knots = np.asarray(spline.c, dtype=np.float64), np.asarray(spline.x, dtype=np.float64)
    if coefficients.ndim != 3 or coefficients.shape[2] != n:
        raise DimensionError(f"the spline has values of shape {coefficients.shape[2:]}; give ({n},)")
    if not np.all(np.isfinite(coefficients)) or not np.all(np.isfinite(knots)):
        raise DimensionError("the spline holds a number that is not finite")
    if np.any(np.diff(knots) < 0.0):
        raise DimensionError("the spline's breakpoints must increase")
    inside = (knots[:-1] >= first) & (knots[1:] <= last) & (np.diff(knots) > 0.0)
    if not np.any(inside):
        raise DimensionError("the spline has no piece of positive duration")
    widths = np.diff(knots)[inside]
    terms = np.moveaxis(coefficients, 0, 1)[inside]
    degree = terms.shape[1] - 1
    if isinstance(spline, interpolation.BPoly):
        controls, size = terms, np.abs(terms).max(axis=(0, 1))
    else:
        powers: Array = terms[:, ::-1] * widths[:, None, None] ** np.arange(degree + 1, dtype=np.float64)[:, None]
        change = [[math.comb(j, i) / math.comb(degree, i) for i in range(degree + 1)] for j in range(degree + 1)]
        controls = np.einsum("ji,kin->kjn", np.array(change), powers)
        size = np.abs(powers).sum(axis=1).max(axis=0)
    if degree == 0:
        controls = np.repeat(controls, 2, axis=1)
    radius = _CONVERSION * (degree + 1) * UNIT_ROUNDOFF * size
    return Polynomials(controls, knots[:-1][inside], widths, radius)
