"""A hash of everything that a proof about free space depends on: coordinates, limits, rules, paths, thresholds."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Mapping, Sequence
from enum import Enum
from typing import Any, cast

import numpy as np

from pinbound.boundaries.boundary import Boundary
from pinbound.robot.robot import Robot
from pinbound.typing import AnyArray

__all__ = ["content_digest", "robot_digest"]

_FORMAT = "1"
_NOT_COUNTED = {"line"}
"""Fields that say where something is written in a file; they do not change its meaning."""


def robot_digest(robot: Robot, boundaries: Sequence[Boundary]) -> str:
    """Return the SHA-256 of the proof's data: two robots with the same hash have the same free configurations.

    Comments, meshes, inertias and marks that no boundary uses do not count. Every number from which a clearance or a
    limit is computed counts, to its last bit.

    Example:
        >>> import pinbound as pb
        >>> robot = pb.load("minervabot_v3")
        >>> again = robot_digest(pb.load("minervabot_v3"), list(robot.boundaries))
        >>> again == robot_digest(robot, list(robot.boundaries)), again == robot_digest(robot, [])
        (True, False)
    """
    known = hashlib.sha256(_FORMAT.encode())
    _feed(known, [robot.name, robot.coordinates, robot.linear_limits, robot.guarded_limits, robot.home])
    for one in boundaries:
        _feed(known, [one.name, one.point_a, one.point_b, one.min_distance, one.contact_tolerance, one.place_error])
        _feed(known, [one.stop, one.path, one.rule.stop])
    return known.hexdigest()


def content_digest(*parts: Any) -> str:
    """Return the SHA-256 of arrays and text."""
    known = hashlib.sha256(_FORMAT.encode())
    _feed(known, parts)
    return known.hexdigest()


def _feed(known: Any, value: Any) -> None:
    """Add a value, with its type first, so that two different values never give the same bytes."""
    known.update(f"{type(value).__name__}(".encode())
    if isinstance(value, np.ndarray):
        array: AnyArray = np.ascontiguousarray(cast(Any, value))
        known.update(f"{array.dtype.str}{array.shape}".encode())
        known.update(array.tobytes())
    elif isinstance(value, Enum):
        known.update(value.name.encode())
    elif dataclasses.is_dataclass(value) and not isinstance(value, type):
        for one in dataclasses.fields(value):
            if one.name not in _NOT_COUNTED:
                known.update(f"{one.name}=".encode())
                _feed(known, getattr(value, one.name))
    elif isinstance(value, Mapping):
        entries = cast(Mapping[Any, Any], value)
        for key in sorted(entries, key=repr):
            _feed(known, key)
            _feed(known, entries[key])
    elif isinstance(value, (tuple, list)):
        for one in cast(Sequence[Any], value):
            _feed(known, one)
    elif value is None or isinstance(value, (str, bool, int, float, np.generic)):
        known.update(repr(cast(object, value)).encode())
    else:
        raise TypeError(f"no hash is defined for a {type(value).__name__}")
    known.update(b")")
