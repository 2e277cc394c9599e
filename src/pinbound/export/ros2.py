"""ROS 2 `joint_limits`: limits of single joints, with a list of the couplings that this format loses."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence

import numpy as np

from pinbound.model.coupling import LinearLimit
from pinbound.tolerances import TABLE

__all__ = ["ros2_text"]

_DECIMALS = 9  # of printed radians or metres: far below any encoder


def ros2_text(
    robot: str,
    coordinates: Sequence[str],
    limits: Sequence[LinearLimit],
    boundaries: Sequence[tuple[str, tuple[str, ...], tuple[float, float] | None]],
    units: Sequence[str],
) -> str:
    """Return YAML of `joint_limits` with one entry for each coordinate: limits and boundaries that depend only on it.

    These limits are correct, but limits that depend on several coordinates are lost; a comment lists them.

    Args:
        robot: The robot's name.
        coordinates: The active coordinates.
        limits: Joint limits, mimic joints' too, said of q.
        boundaries: Of each its name, its coordinates, and the free interval that holds home, of one that has one.
        units: Unit of each coordinate.
    """
    ends = {name: [-math.inf, math.inf] for name in coordinates}
    lost: list[str] = []

    def narrow(name: str, low: float, high: float) -> None:
        ends[name] = [max(ends[name][0], low), min(ends[name][1], high)]

    for limit in limits:
        used = np.flatnonzero(limit.coefficients).tolist()
        if len(used) > 1:
            names = ", ".join(coordinates[k] for k in used)
            lost.append(f"limits of {limit.joint} (couples {names})")
        elif used:
            slope = float(limit.coefficients[used[0]])
            values = sorted(((limit.lower - limit.offset) / slope, (limit.upper - limit.offset) / slope))
            narrow(coordinates[used[0]], values[0], values[1])
    for own, used, free in boundaries:
        if len(used) > 1:
            lost.append(f"boundary {own} (couples {', '.join(used)})")
        elif free is not None and used:
            narrow(used[0], free[0] + TABLE, free[1] - TABLE)
    head = [
        f"pinbound: limits of one joint each, of {robot} [{', '.join(dict.fromkeys(units))}].",
        *(
            ["WITHIN THESE LIMITS THE ROBOT CAN BE IN CONTACT: joint_limits cannot say couplings. Lost are:"]
            if lost
            else []
        ),
        *[f"  {line}" for line in lost],
    ]
    lines = [
        f"# {' '.join(line.split()) if not line.startswith('  ') else '  ' + ' '.join(line.split())}" for line in head
    ]
    lines.append("joint_limits:")
    for name in coordinates:
        low, high = ends[name]
        lines.append(f"  {json.dumps(name, ensure_ascii=False)}:")
        if not (math.isfinite(low) and math.isfinite(high)):
            lines.append("    has_position_limits: false")
            continue
        lines += [
            "    has_position_limits: true",
            f"    min_position: {_inwards(low, 1.0)}",
            f"    max_position: {_inwards(high, -1.0)}",
        ]
    return "\n".join(lines) + "\n"


def _inwards(value: float, sign: float) -> str:
    """Return a number rounded up (sign 1) or down (-1), unless it has no more decimals than are printed."""
    near = round(value, _DECIMALS)
    if sign * (near - value) < 0.0:
        near = round(near + sign * 10.0**-_DECIMALS, _DECIMALS)
    return f"{near + 0.0:.{_DECIMALS}f}"
