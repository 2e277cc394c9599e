"""Tables of coupled limits in the formats of scikit-robot, jskeus and hrpsys, as CSV and as JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pinbound.exceptions import UnknownNameError, UnsupportedError
from pinbound.typing import Array
from pinbound.values import Value

__all__ = ["FORMATS", "GRIDS", "LimitTable"]

_DECIMALS = 6  # decimals of printed limits, in degrees: 1e-6 deg is far below the resolution of encoders
_WITHIN = 1e-4  # of the last decimal: rounding allowance for a whole degree in radians; entries have a margin of 0.05
_ANGLES = 12  # decimals of printed angles: the proof between entries holds for exactly these angles
_EVEN = 1e-9  # degrees: spacings that differ by no more count as equal


@dataclass(frozen=True, eq=False)
class LimitTable(Value):
    """Limits of the dependent joint at some angles of the target joint, linear between them.

    Attributes:
        robot: The robot's name.
        target: The joint that the limits depend on.
        dependent: The joint that is limited.
        angles: (k,) angles of the target joint [rad].
        lower: (k,) lower limits of the dependent joint [rad].
        upper: (k,) upper limits of the dependent joint [rad].
        loss: [rad], the largest part of the dependent joint's true range that the table loses, at any angle of the
            target within `angles`.
        target_range: [rad], the true range of the target joint.
        notes: Sentences that a user of the table must know.

    Example:
        >>> import pinbound as pb
        >>> table = pb.limit_table(pb.load("minervabot_v3"), "q2", "q3", spacing=5.0)
        >>> len(table.angles) == len(table.lower) == len(table.upper)
        True
    """

    robot: str
    target: str
    dependent: str
    angles: Array
    lower: Array
    upper: Array
    loss: float
    target_range: tuple[float, float]
    notes: tuple[str, ...]

    def text(self, form: str) -> str:
        """Return the text of the table in a format, a key of `FORMATS`.

        Raises:
            UnknownNameError: If the format does not exist.
            UnsupportedError: If the format needs other entries: skrobot needs equal spacing, jskeus and hrpsys need one
                entry for each whole degree.
        """
        if form not in FORMATS:
            raise UnknownNameError("format", form, FORMATS)
        return FORMATS[form](self)

    def in_degrees(self) -> tuple[Array, Array, Array]:
        """Return angles, lower and upper limits (k,) [deg] as printed; limits are rounded inwards."""
        scale = 10.0**_DECIMALS
        lower = np.ceil(np.degrees(self.lower) * scale - _WITHIN) / scale
        upper = np.floor(np.degrees(self.upper) * scale + _WITHIN) / scale
        return np.asarray(np.round(np.degrees(self.angles), _ANGLES), dtype=np.float64), lower, upper


def _number(value: float) -> str:
    return f"{value + 0.0:.{_ANGLES}f}".rstrip("0").rstrip(".")


def _numbers(values: Array, by: str) -> str:
    return by.join(_number(float(value)) for value in values)


def _whole_degrees(table: LimitTable, reader: str) -> tuple[Array, Array, Array]:
    angles, lower, upper = table.in_degrees()
    if not np.array_equal(angles, np.round(angles)) or np.any(np.diff(angles) != 1.0):
        said = "make the table with grid='multiples' and spacing=1 (--grid multiples --spacing 1)"
        raise UnsupportedError(f"{reader} takes one entry per whole degree; {said}")
    return angles, lower, upper


def _head(table: LimitTable, mark: str) -> str:
    lines = [
        f"pinbound: limits of {table.dependent} over {table.target} of {table.robot} [deg], straight between entries;",
        f"at most {math.degrees(table.loss):.4f} deg are lost. " + " ".join(table.notes),
    ]
    return "".join(f"{mark} {' '.join(line.split())}\n" for line in lines)


def _skrobot(table: LimitTable) -> str:
    angles, lower, upper = table.in_degrees()
    steps = np.diff(angles)
    if len(steps) and np.ptp(steps) > _EVEN:
        raise UnsupportedError(
            "skrobot takes entries of one spacing; make the table with grid='fitted' (--grid fitted)"
        )
    return (
        f"{_head(table, '#')}joint_limit_tables:\n"
        f"- target_joint: {json.dumps(table.target)}\n  dependent_joint: {json.dumps(table.dependent)}\n"
        f"  target_min_angle: {_number(float(angles[0]))}\n  target_max_angle: {_number(float(angles[-1]))}\n"
        f"  min_angles: [{_numbers(lower, ', ')}]\n  max_angles: [{_numbers(upper, ', ')}]\n"
    )


def _jskeus(table: LimitTable) -> str:
    _, lower, upper = table.in_degrees()
    if not (np.array_equal(lower, np.round(lower)) and np.array_equal(upper, np.round(upper))):
        raise UnsupportedError("jskeus takes whole degrees; make the table with whole=True (--whole)")
    angles, lower, upper = _whole_degrees(table, "jskeus")
    rows = " ".join(f"({_numbers(row, ' ')})" for row in (angles, lower, upper))
    return (
        f"{_head(table, ';;')}(:joint-min-max-target {json.dumps(table.target)}\n :joint-min-max-table #2f({rows}))\n"
    )


def _hrpsys(table: LimitTable) -> str:
    angles, lower, upper = _whole_degrees(table, "hrpsys")
    ends = f"{_number(float(angles[0]))}:{_number(float(angles[-1]))}"
    values = f"{_numbers(lower, ',')}:{_numbers(upper, ',')}"
    return f"{_head(table, '#')}joint_limit_table: {table.dependent}:{table.target}:{ends}:{values}\n"


def _csv(table: LimitTable) -> str:
    rows = np.column_stack(table.in_degrees())
    return "target_deg,min_deg,max_deg\n" + "".join(f"{_numbers(row, ',')}\n" for row in rows)


def _json(table: LimitTable) -> str:
    record = {
        "robot": table.robot,
        "target": table.target,
        "dependent": table.dependent,
        "unit": "rad",
        "interpolation": "linear",
        "angles": table.angles.tolist(),
        "lower": table.lower.tolist(),
        "upper": table.upper.tolist(),
        "loss": table.loss,
        "target_range": list(table.target_range),
        "notes": list(table.notes),
    }
    return json.dumps(record, indent=1) + "\n"


FORMATS: dict[str, Callable[[LimitTable], str]] = {
    "skrobot": _skrobot,
    "jskeus": _jskeus,
    "hrpsys": _hrpsys,
    "csv": _csv,
    "json": _json,
}
"""Writers by format. All use degrees except JSON, which uses radians."""

GRIDS = {"skrobot": "fitted", "jskeus": "multiples", "hrpsys": "multiples", "csv": "corners", "json": "corners"}
"""For each format, the value of `limit_table(grid=)` with the least loss among those that the format can store."""
