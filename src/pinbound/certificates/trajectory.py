"""Motions in the form for certificates: waypoints, splines, or a function with bounds of its derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pinbound.certificates.bounded_motion import BoundedMotion, BoundedTrajectory
from pinbound.certificates.polynomials import Polynomials, Trajectory
from pinbound.certificates.splines import from_spline
from pinbound.exceptions import DimensionError, UnsupportedError
from pinbound.model.coupling import as_configurations, real_array
from pinbound.tolerances import FARTHEST
from pinbound.typing import Array

__all__ = ["BoundedMotion", "Polynomials", "Trajectory", "as_trajectory", "refuse_far"]


def as_trajectory(motion: Any, coordinates: Sequence[str], times: ArrayLike | None = None) -> Trajectory:
    """Return a motion in the form for certificates.

    Args:
        motion: Waypoints (N, n) with straight segments between, or a `scipy.interpolate` PPoly, CubicSpline, BPoly
            or BSpline of values (n,), or a `BoundedMotion`.
        coordinates: Names of the active coordinates.
        times: (N,) increasing times of waypoints; None: 0, 1, ... Not for splines, which have their own.

    Raises:
        DimensionError: If shapes do not fit, something is not finite, times do not increase, a spline jumps, or the
            values of a function contradict its bounds.
        UnsupportedError: If it is not a motion that can be certified.
    """
    if isinstance(motion, BoundedMotion) or (callable(motion) and hasattr(motion, "c")):
        if times is not None:
            raise DimensionError("times belong to waypoints; a spline or function has its own")
        is_function = isinstance(motion, BoundedMotion)
        found = BoundedTrajectory(motion, coordinates) if is_function else from_spline(motion, coordinates)
        refuse_far(*found.extent, coordinates)
        return found
    if callable(motion):
        raise UnsupportedError(
            f"a {type(motion).__name__} does not say how it moves between two times; wrap it as "
            "pb.BoundedMotion(function, start, end, speed=...) with bounds of its derivatives"
        )
    Q = as_configurations(motion, coordinates)
    Q = Q[None] if Q.ndim == 1 else Q
    if not len(Q):
        raise DimensionError("the motion has no waypoint; give at least one")
    is_finite = np.isfinite(Q)
    if not is_finite.all():
        bad = np.flatnonzero(~np.all(is_finite, axis=1))
        raise DimensionError(
            f"waypoint {bad[0]} of the motion is not finite, {Q[bad[0]].tolist()}; give finite numbers"
        )
    knots = _times(times, len(Q))
    refuse_far(Q.min(axis=0), Q.max(axis=0), coordinates)
    ends = Q if len(Q) > 1 else np.repeat(Q, 2, axis=0)
    durations = knots[1:] - knots[:-1] if len(Q) > 1 else np.zeros(1)
    controls = np.empty((len(ends) - 1, 2, Q.shape[1]))
    controls[:, 0], controls[:, 1] = ends[:-1], ends[1:]
    return Polynomials(controls, knots[: len(controls)], durations, np.zeros((len(controls), Q.shape[1])))


def _times(times: ArrayLike | None, count: int) -> Array:
    if times is None:
        return np.arange(count, dtype=np.float64)
    knots = real_array(times, "the list of times")
    if knots.shape != (count,):
        raise DimensionError(f"times have shape {knots.shape}; give one per waypoint, ({count},)")
    if not np.all(np.isfinite(knots)):
        raise DimensionError(f"time {int(np.flatnonzero(~np.isfinite(knots))[0])} is not finite; give finite numbers")
    with np.errstate(over="ignore"):
        too_long = not np.isfinite(knots[-1] - knots[0])
    if too_long:
        raise DimensionError(
            f"times from {knots[0]:g} to {knots[-1]:g} are too far apart for float64; give them in seconds"
        )
    falling = np.flatnonzero(np.diff(knots) <= 0.0)
    if falling.size:
        row = int(falling[0])
        said = f"t[{row + 1}] = {knots[row + 1]:g} comes after t[{row}] = {knots[row]:g}"
        raise DimensionError(f"times must increase, and {said}; sort the waypoints, one for each time")
    return knots


def refuse_far(lower: Array, upper: Array, coordinates: Sequence[str]) -> None:
    """Refuse a motion or box so far away that its squares overflow.

    Raises:
        DimensionError: If a coordinate may be beyond `tolerances.FARTHEST`.
    """
    farthest = np.maximum(np.abs(lower), np.abs(upper))
    if not (farthest <= FARTHEST).all():
        beyond = np.flatnonzero(~(farthest <= FARTHEST))
        name, value = coordinates[int(beyond[0])], farthest[beyond[0]]
        said = f"{name!r} may reach {value:.3g}, and float64 proves nothing beyond {FARTHEST:g} rad or m"
        raise DimensionError(f"{said}; give a motion that stays nearer to zero")
