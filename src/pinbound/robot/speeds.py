"""Largest speeds of coordinates, in the forms that users may give."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from pinbound.exceptions import DimensionError, UnknownNameError
from pinbound.model.coupling import real_array
from pinbound.robot.robot import Robot
from pinbound.typing import Array

__all__ = ["largest_speeds"]


def largest_speeds(robot: Robot, velocity: ArrayLike | Mapping[str, float]) -> Array:
    """Return the largest speed of each coordinate (n,) [rad/s or m/s], from one number, an array, or values by name.

    Raises:
        UnknownNameError: If a coordinate does not exist.
        DimensionError: If a speed is missing, or is not a positive finite number.

    Example:
        >>> import pinbound as pb
        >>> largest_speeds(pb.load("minervabot_v3"), {"q1": 1.0, "q2": 2.0, "q3": 2.0}).tolist()
        [1.0, 2.0, 2.0]
    """
    names = robot.coordinates
    if isinstance(velocity, Mapping):
        for name in velocity:
            if name not in names:
                raise UnknownNameError("coordinate", name, names)
        missing = [name for name in names if name not in velocity]
        if missing:
            raise DimensionError(
                f"velocity has no entry for {missing[0]!r}; give the largest speed of every coordinate"
            )
        velocity = [float(velocity[name]) for name in names]
    given = real_array(velocity, "velocity")
    if given.shape not in ((), (len(names),)) or not np.all((given > 0.0) & np.isfinite(given)):
        said = f"velocity is {given.tolist()}; give the largest speed of {', '.join(names)}, each positive and finite"
        raise DimensionError(said)
    return np.broadcast_to(given, (len(names),)).astype(np.float64)
