"""Times for a path, and a smooth motion along it: quintic pieces in Bernstein form, whose control points bound all.

A piece from x to y in time T, with velocities v at x and w at y and no acceleration at either, has the control points
x, x + vT/5, x + 2vT/5, y - 2wT/5, y - wT/5, y. Neighbours share velocity, and acceleration zero: the motion is twice
continuously differentiable. It lies in the hull of its control points, and its velocity in that of `5/T` times their
differences, so that limits of velocity that these keep are kept at every moment. With v = w = 0 it is the straight way.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pinbound.typing import Array

__all__ = ["smooth_motion", "straight_times"]

_SHORTEST = 1e-3
"""Seconds: how long a piece lasts at least, so that times increase."""
_SPARE = 1.0 + 1e-9
"""Times are longer by this factor, which rounding of velocities does not use up."""


def straight_times(waypoints: Array, velocity: Array) -> Array:
    """Return times (N,) at which a motion straight between waypoints passes them, as early as velocities allow."""
    steps = np.max(np.abs(np.diff(waypoints, axis=0)) / velocity, axis=1)
    return np.concatenate([[0.0], np.cumsum(np.maximum(steps * _SPARE, _SHORTEST))])


def smooth_motion(waypoints: Array, velocity: Array, pace: float) -> Any:
    """Return a SciPy BPoly through waypoints (N, n), at rest at both ends, slowed down to keep all velocities.

    Args:
        waypoints: (N, n), N at least 2.
        velocity: (n,) largest speeds.
        pace: How fast it passes inner waypoints, of the mean speed of its neighbours: 0 stops at each and leaves the
            straight way nowhere.

    Example:
        >>> motion = smooth_motion(np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]), np.ones(2), 1.0)
        >>> motion(motion.x).round(12).tolist()
        [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]
    """
    from scipy import interpolate

    solver: Any = interpolate
    T = np.diff(straight_times(waypoints, velocity))
    speeds = np.zeros_like(waypoints)
    speeds[1:-1] = pace * (waypoints[2:] - waypoints[:-2]) / (T[1:] + T[:-1])[:, None]
    x, y = waypoints[:-1], waypoints[1:]
    before, after = speeds[:-1] * T[:, None] / 5.0, speeds[1:] * T[:, None] / 5.0
    control = np.stack([x, x + before, x + 2.0 * before, y - 2.0 * after, y - after, y])
    fastest = float(np.max(5.0 * np.abs(np.diff(control, axis=0)) / T[:, None] / velocity))
    times = np.concatenate([[0.0], np.cumsum(T * max(fastest, 1.0) * _SPARE)])
    return solver.BPoly(control, times)
