"""Times for a path, and a smooth motion along it: quintic pieces in Bernstein form, with bounds from control points.

A piece goes from x to y in time T, with velocities v at x and w at y, and no acceleration at its ends. Its control
points are x, x + vT/5, x + 2vT/5, y - 2wT/5, y - wT/5, y. Neighbouring pieces share the velocity, and the acceleration
zero, so the motion is twice continuously differentiable. It lies in the hull of its control points, and its velocity in
the hull of `5/T` times their differences. So if these differences keep the velocity limits, the motion keeps them at
every moment. With v = w = 0 it is the straight path.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pinbound.typing import Array

__all__ = ["smooth_motion", "straight_times"]

_SHORTEST = 1e-3
"""Seconds: the shortest duration of a piece, so that times increase."""
_SPARE = 1.0 + 1e-9
"""Times are longer by this factor, which is more than the rounding of velocities."""


def straight_times(waypoints: Array, velocity: Array) -> Array:
    """Return the earliest times (N,) at which a motion, straight between waypoints, may pass them."""
    steps = np.max(np.abs(np.diff(waypoints, axis=0)) / velocity, axis=1)
    return np.concatenate([[0.0], np.cumsum(np.maximum(steps * _SPARE, _SHORTEST))])


def smooth_motion(waypoints: Array, velocity: Array, pace: float) -> Any:
    """Return a SciPy BPoly through waypoints (N, n), at rest at both ends, slowed down to keep all velocities.

    Args:
        waypoints: (N, n), N at least 2.
        velocity: (n,) largest speeds.
        pace: Speed at inner waypoints, as a share of the mean speed of its neighbours. With 0 the motion stops at each,
            and stays on the straight path.

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
