"""Tables of coupled limits as text: what scikit-robot, jskeus and hrpsys read, CSV and JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pinbound.exceptions import UnsupportedError
from pinbound.typing import Array
from pinbound.values import Value

__all__ = ["FORMATS", "GRIDS", "Table", "degrees_of"]

_DECIMALS = 6  # of printed limits, in degrees: 1e-6 deg is far below any encoder
_WITHIN = 1e-4  # of the last decimal: a whole degree in radians is none to the last bit; entries have a margin of 0.05
_ANGLES = 12  # decimals of printed angles: between entries a table is proved at these very angles
_EVEN = 1e-9  # degrees: spacings that differ by no more are one spacing


@dataclass(frozen=True, eq=False)
class Table(Value):
    """Limits of the dependent joint at some angles of the target joint, straight between them.

    Attributes:
        robot: The robot's name.
        target: The joint that the limits depend on.
        dependent: The joint that is limited.
        angles: (k,) of the target [rad].
        lower: (k,) of the dependent [rad].
        upper: (k,) [rad].
        loss: [rad], the most that the table takes from the dependent joint's true range, at any angle of the target
            within `angles`.
        target_range: [rad], the true range of the target: nothing is allowed beyond it.
        notes: What a user of the table must know.
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


def degrees_of(table: Table) -> tuple[Array, Array, Array]:
    """Return angles, lower and upper in degrees, as printed: limits are rounded inwards."""
    scale = 10.0**_DECIMALS
    lower = np.ceil(np.degrees(table.lower) * scale - _WITHIN) / scale
    upper = np.floor(np.degrees(table.upper) * scale + _WITHIN) / scale
    return np.asarray(np.round(np.degrees(table.angles), _ANGLES), dtype=np.float64), lower, upper


def _number(value: float) -> str:
    return f"{value + 0.0:.{_ANGLES}f}".rstrip("0").rstrip(".")


def _numbers(values: Array, by: str) -> str:
    return by.join(_number(float(value)) for value in values)


def _whole_degrees(table: Table, reader: str) -> tuple[Array, Array, Array]:
    angles, lower, upper = degrees_of(table)
    if not np.array_equal(np.diff(angles), np.ones(len(angles) - 1)) or not np.array_equal(angles, np.round(angles)):
        raise UnsupportedError(f"{reader} takes one entry a whole degree; make the table with spacing=1")
    return angles, lower, upper


def _head(table: Table, mark: str) -> str:
    lines = [
        f"pinbound: limits of {table.dependent} over {table.target} of {table.robot} [deg], straight between entries;",
        f"at most {math.degrees(table.loss):.4f} deg are lost. " + " ".join(table.notes),
    ]
    return "".join(f"{mark} {' '.join(line.split())}\n" for line in lines)


def _skrobot(table: Table) -> str:
    angles, lower, upper = degrees_of(table)
    if np.ptp(np.diff(angles)) > _EVEN if len(angles) > 1 else False:
        raise UnsupportedError(
            "skrobot takes entries of one spacing; make the table with grid='fitted' (--grid fitted)"
        )
    return (
        f"{_head(table, '#')}joint_limit_tables:\n"
        f"- target_joint: {json.dumps(table.target)}\n  dependent_joint: {json.dumps(table.dependent)}\n"
        f"  target_min_angle: {_number(float(angles[0]))}\n  target_max_angle: {_number(float(angles[-1]))}\n"
        f"  min_angles: [{_numbers(lower, ', ')}]\n  max_angles: [{_numbers(upper, ', ')}]\n"
    )


def _jskeus(table: Table) -> str:
    angles, lower, upper = _whole_degrees(table, "jskeus")
    if not (np.array_equal(lower, np.round(lower)) and np.array_equal(upper, np.round(upper))):
        raise UnsupportedError("jskeus takes whole degrees; make the table with whole=True (--whole)")
    rows = " ".join(f"({_numbers(row, ' ')})" for row in (angles, lower, upper))
    return (
        f"{_head(table, ';;')}(:joint-min-max-target {json.dumps(table.target)}\n :joint-min-max-table #2f({rows}))\n"
    )


def _hrpsys(table: Table) -> str:
    angles, lower, upper = _whole_degrees(table, "hrpsys")
    ends = f"{_number(float(angles[0]))}:{_number(float(angles[-1]))}"
    values = f"{_numbers(lower, ',')}:{_numbers(upper, ',')}"
    return f"{_head(table, '#')}joint_limit_table: {table.dependent}:{table.target}:{ends}:{values}\n"


def _csv(table: Table) -> str:
    rows = np.column_stack(degrees_of(table))
    return "target_deg,min_deg,max_deg\n" + "".join(f"{_numbers(row, ',')}\n" for row in rows)


def _json(table: Table) -> str:
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


FORMATS: dict[str, Callable[[Table], str]] = {
    "skrobot": _skrobot,
    "jskeus": _jskeus,
    "hrpsys": _hrpsys,
    "csv": _csv,
    "json": _json,
}
"""Writers by format: degrees, but for JSON, which is in radians."""

GRIDS = {"skrobot": "fitted", "jskeus": "multiples", "hrpsys": "multiples", "csv": "corners", "json": "corners"}
"""Which entries lose least, of those that a format can hold: `limit_table(grid=)`."""
