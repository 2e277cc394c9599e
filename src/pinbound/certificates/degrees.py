"""Numbers that look like degrees, in motions and boxes that pass a joint limit."""

from __future__ import annotations

import math

import numpy as np

from pinbound.robot.robot import Robot
from pinbound.typing import Array

__all__ = ["look_like_degrees"]

_TURN = 2.0 * math.pi


def look_like_degrees(robot: Robot, Q: Array) -> tuple[str, ...]:
    """Return a note if most nonzero values in Q (N, n) are beyond a full turn, although the limits do not allow this.

    Only revolute joints with limits within one full turn to either side count. Zero is skipped, because it is zero in
    both units.
    """
    within = (robot.lower >= -_TURN) & (robot.upper <= _TURN)
    limited = [i for i, name in enumerate(robot.coordinates) if within[i] and robot.turns(name)]
    values = np.abs(Q[:, limited])
    beyond = values > _TURN
    if 2 * np.count_nonzero(beyond) <= np.count_nonzero(values):
        return ()
    names = ", ".join(robot.coordinates[index] for column, index in enumerate(limited) if np.any(beyond[:, column]))
    largest = float(values.max())
    return (
        f"these look like degrees: most values of {names} are beyond a full turn of 2 pi rad (the largest is "
        f"{largest:.6g}), more than their limits allow; angles are radians, see numpy.radians",
    )
