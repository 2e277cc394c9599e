"""Numbers that look like degrees, in motions and boxes that pass a joint limit; angles that look wrapped."""

from __future__ import annotations

import math

import numpy as np

from pinbound.robot.robot import Robot
from pinbound.typing import Array

__all__ = ["look_like_degrees", "look_wrapped"]

_TURN = 2.0 * math.pi
_LONG_WAY = 1.75 * math.pi  # the short way is 45 deg then, or less
_ROUNDED = 0.01  # a recording may round pi up


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


def look_wrapped(robot: Robot, starts: Array, ends: Array) -> tuple[str, ...]:
    """Return a note if a straight step goes from one end of a turn to the other, as where a recording wraps angles.

    Only revolute coordinates that may turn by a full turn count. The step that is checked is the one that is given, the
    long way round.

    Args:
        robot: The robot.
        starts: (N, n) where the steps start.
        ends: (N, n) where they end.
    """
    turning = np.array([robot.turns(name) for name in robot.coordinates], dtype=np.bool_)
    able = turning & (robot.upper - robot.lower >= _TURN - _ROUNDED)
    low, high = np.minimum(starts, ends), np.maximum(starts, ends)
    around = (low >= -math.pi - _ROUNDED) & (high <= math.pi + _ROUNDED)
    around |= (low >= -_ROUNDED) & (high <= _TURN + _ROUNDED)
    found = np.argwhere(able & around & (high - low >= _LONG_WAY))
    if not len(found):
        return ()
    row, column = found[0].tolist()
    degrees = math.degrees(float(ends[row, column] - starts[row, column]))
    more = f", and there are {len(found) - 1} more such steps" if len(found) > 1 else ""
    return (
        f"{robot.coordinates[column]!r} turns by {degrees:.6g} deg from waypoint {row} to {row + 1}{more}: this is "
        "checked as it is given, the long way round; if the angles were wrapped at a full turn, use numpy.unwrap first",
    )
