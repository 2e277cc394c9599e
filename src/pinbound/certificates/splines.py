"""SciPy's splines in Bernstein form, each piece on its own interval; refused if they jump.

The control points of a B-spline on an interval are values of its polar form, `f(a, ..., a, b, ..., b)`. De Boor's
scheme computes them by convex combinations only. So the conversion is well conditioned at any degree. The power basis
of a PPoly needs positive weights of at most one. So its error is relative to the sum of the sizes of its terms.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from pinbound.certificates.polynomials import Polynomials
from pinbound.exceptions import DimensionError, UnsupportedError
from pinbound.model.coupling import real_array
from pinbound.tolerances import CONVERSION, UNIT_ROUNDOFF
from pinbound.typing import Array, Indices

__all__ = ["from_spline"]

_HIGHEST = 50
"""The highest degree. The work for a part of a motion grows with its square; typical degrees are below 10."""


def from_spline(spline: Any, coordinates: Sequence[str]) -> Polynomials:
    """Return a SciPy spline in Bernstein form.

    Args:
        spline: PPoly (CubicSpline, Akima1DInterpolator, ...), BPoly or BSpline, of values (n,).
        coordinates: Names of the n active coordinates.

    Raises:
        DimensionError: If its values are not (n,), a number is complex or not finite, its breakpoints decrease, or it
            jumps at a breakpoint by more than rounding.
        UnsupportedError: If it is another kind of spline, or its degree is above 50.
    """
    from scipy import interpolate

    interpolation: Any = interpolate
    if isinstance(spline, interpolation.BSpline):
        controls, knots, size = _of_bspline(spline, len(coordinates))
    elif isinstance(spline, (interpolation.PPoly, interpolation.BPoly)):
        controls, knots, size = _of_pieces(spline, len(coordinates), isinstance(spline, interpolation.BPoly))
    else:
        raise UnsupportedError(
            f"a {type(spline).__name__} is not a PPoly, BPoly or BSpline of SciPy; convert it to one of these"
        )
    is_exact = isinstance(spline, interpolation.BPoly)
    if not np.all(np.isfinite(controls)) or not np.all(np.isfinite(size)):
        raise DimensionError(
            "the spline's terms overflow: its coefficients or the time between breakpoints are too large; "
            "give it in radians, metres and seconds"
        )
    degree = controls.shape[1] - 1
    rounding = CONVERSION * (degree + 1) * UNIT_ROUNDOFF * size
    _refuse_jumps(controls, knots[0], rounding, coordinates)
    if degree == 0:
        controls = np.repeat(controls, 2, axis=1)
    radius = np.zeros_like(rounding) if is_exact else rounding
    return Polynomials(controls, *knots, radius, _notes(spline, controls, knots, coordinates))


def _numbers(spline: Any, n: int, knots: Any, degree: int) -> tuple[Array, Array]:
    """Return coefficients (.., .., n) or (.., n) and knots, checked."""
    coefficients, breaks = (
        real_array(spline.c, "the array of coefficients"),
        real_array(knots, "the array of breakpoints"),
    )
    if not np.all(np.isfinite(coefficients)) or not np.all(np.isfinite(breaks)):
        raise DimensionError("the spline holds a number that is not finite; give finite numbers")
    if degree > _HIGHEST:
        message = f"the spline has degree {degree}; certificates read degrees up to {_HIGHEST}"
        raise UnsupportedError(f"{message}. Fit it by pieces of a lower degree")
    with np.errstate(over="ignore"):
        steps, whole = np.diff(breaks), breaks[-1] - breaks[0]
    if np.any(steps < 0.0):
        raise DimensionError("the spline's breakpoints must increase; build it again with its pieces in order of time")
    if not np.all(np.isfinite(steps)) or not np.isfinite(whole):
        raise DimensionError("the spline's breakpoints are too far apart for float64; give them in seconds")
    return coefficients, breaks


def _check_shape(shape: tuple[int, ...], n: int) -> None:
    if shape != (n,):
        raise DimensionError(f"the spline has values of shape {shape}; give ({n},)")


def _of_bspline(spline: Any, n: int) -> tuple[Array, tuple[Array, Array], Array]:
    """Return control points (K, k + 1, n), starts and durations, and the sizes (K, n) of the terms."""
    k = int(spline.k)
    coefficients, t = _numbers(spline, n, spline.t, k)
    _check_shape(coefficients.shape[1:], n)
    spans = k + np.flatnonzero(np.diff(t[k : len(t) - k]) > 0.0)
    if not len(spans):
        raise DimensionError("the spline has no piece of positive duration; give breakpoints that increase")
    a, b = t[spans], t[spans + 1]
    local = np.stack([coefficients[spans - k + i] for i in range(k + 1)], axis=1)
    columns = [_polar(local, t, spans, [a] * (k - j) + [b] * j) for j in range(k + 1)]
    return np.stack(columns, axis=1), (a, b - a), np.abs(local).max(axis=1)


def _polar(local: Array, t: Array, spans: Indices, arguments: Sequence[Array]) -> Array:
    """Return the polar form (K, n) at k arguments (K,) in the spans' own intervals, by de Boor's scheme."""
    points, k = local, len(arguments)
    for level, u in enumerate(arguments, start=1):
        left = np.stack([t[spans - k + i] for i in range(level, k + 1)], axis=1)
        right = np.stack([t[spans + 1 + i] for i in range(k - level + 1)], axis=1)
        share = ((u[:, None] - left) / (right - left))[:, :, None]
        points = np.where(share == 1.0, points[:, 1:], points[:, :-1] + share * (points[:, 1:] - points[:, :-1]))
    return points[:, 0]


def _of_pieces(spline: Any, n: int, is_bernstein: bool) -> tuple[Array, tuple[Array, Array], Array]:
    """Return the same for a PPoly or a BPoly."""
    coefficients, knots = _numbers(spline, n, spline.x, len(spline.c) - 1)
    _check_shape(coefficients.shape[2:], n)
    lasting = np.diff(knots) > 0.0
    if not np.any(lasting):
        raise DimensionError("the spline has no piece of positive duration; give breakpoints that increase")
    widths, terms = np.diff(knots)[lasting], np.moveaxis(coefficients, 0, 1)[lasting]
    spans = (knots[:-1][lasting], widths)
    if is_bernstein:
        return terms, spans, np.abs(terms).max(axis=1)
    degree = terms.shape[1] - 1
    with np.errstate(over="ignore", invalid="ignore"):
        powers: Array = terms[:, ::-1] * widths[:, None, None] ** np.arange(degree + 1, dtype=np.float64)[:, None]
        change = [[math.comb(j, i) / math.comb(degree, i) for i in range(degree + 1)] for j in range(degree + 1)]
        return np.einsum("ji,kin->kjn", np.array(change), powers), spans, np.abs(powers).sum(axis=1)


def _refuse_jumps(controls: Array, starts: Array, rounding: Array, coordinates: Sequence[str]) -> None:
    """Refuse a spline that is not continuous: the motion of the robot at the jump is not defined."""
    before, after = controls[:-1, -1], controls[1:, 0]
    excess = np.abs(after - before) - (rounding[:-1] + rounding[1:])
    if not len(excess) or excess.max() <= 0.0:
        return
    row, column = np.unravel_index(int(np.argmax(excess)), excess.shape)
    old, new = float(before[row, column]), float(after[row, column])
    message = f"the motion is not continuous: {coordinates[int(column)]!r} jumps by {new - old:.6g} at the breakpoint"
    message += f" t = {starts[row + 1]:.9g}, from {old:.9g} to {new:.9g}"
    raise DimensionError(f"{message}; join the pieces, or certify each continuous part on its own")


def _notes(spline: Any, controls: Array, knots: tuple[Array, Array], coordinates: Sequence[str]) -> tuple[str, ...]:
    """Return a note that one period of a periodic spline is checked."""
    if getattr(spline, "extrapolate", None) != "periodic":
        return ()
    starts, durations = knots
    span = f"one period of the spline is checked, t = {starts[0]:.9g} to {starts[-1] + durations[-1]:.9g}"
    jump = np.abs(controls[0, 0] - controls[-1, -1])
    column = int(np.argmax(jump))
    if jump[column] > CONVERSION * controls.shape[1] * UNIT_ROUNDOFF * np.abs(controls).max():
        return (f"{span}; at its end {coordinates[column]!r} jumps back by {jump[column]:.6g}, which is not certified",)
    return (span,)
