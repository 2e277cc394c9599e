"""Tables of coupled limits: the limits of one joint over the angle of another, sound as the reader interpolates.

Boundaries of one effective angle keep home's gap, and joint limits an interval, of a linear combination of q. Over
two coordinates that is a convex polygon: every entry lies in it, so that every line between two entries does. That
is the proof between entries. The limits of the row are `lower(x) = max (b_k - a_k x) / c_k`, and likewise above.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from pinbound.boundaries.boundary import Boundary
from pinbound.exceptions import DimensionError, UnknownNameError, UnsupportedError
from pinbound.robot.robot import Robot, refuse_conditions
from pinbound.tolerances import TABLE
from pinbound.typing import Array
from pinbound.values import Value

__all__ = ["FORMATS", "LimitTable", "limit_table"]

_DECIMALS = 6  # of printed degrees: 1e-6 deg is far below any encoder
_WITHIN = 1e-4  # of the last decimal: a whole degree in radians is none to the last bit; entries have a margin of 0.05


@dataclass(frozen=True, eq=False)
class LimitTable(Value):
    """Limits of the dependent joint at equally spaced angles of the target joint, straight between them.

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

    def text(self, form: str) -> str:
        """Return the table as a reader takes it: a key of `FORMATS`.

        Raises:
            UnknownNameError: If there is no such format.
            UnsupportedError: If the format takes whole degrees only, and the table has others.
        """
        if form not in FORMATS:
            raise UnknownNameError("format", form, FORMATS)
        return FORMATS[form](self)

    def in_degrees(self) -> tuple[Array, Array, Array]:
        """Return angles, lower and upper in degrees, as printed: rounded inwards."""
        scale = 10.0**_DECIMALS
        lower = np.ceil(np.degrees(self.lower) * scale - _WITHIN) / scale
        upper = np.floor(np.degrees(self.upper) * scale + _WITHIN) / scale
        return np.asarray(np.round(np.degrees(self.angles), _DECIMALS), dtype=np.float64), lower, upper


def limit_table(
    robot: Robot,
    target: str,
    dependent: str,
    *,
    spacing: float = 1.0,
    whole: bool = False,
    boundaries: Sequence[str] | str | None = None,
) -> LimitTable:
    """Return the limits of one joint over the angle of another, sound under straight interpolation between entries.

    All boundaries and joint limits that depend on the two joints are kept, mimic joints' limits too. Every pair of
    angles that a reader accepts, who interpolates linearly and refuses targets beyond the entries, is free.

    Args:
        robot: The robot.
        target: An active revolute joint: the one that the limits depend on.
        dependent: Another: the one that is limited.
        spacing: Of the entries [deg]; entries are whole multiples of it.
        whole: Whether the limits are rounded inwards to whole degrees, as jskeus takes them.
        boundaries: Names of boundaries, None: all.

    Raises:
        UnknownNameError: If a joint or boundary does not exist.
        DimensionError: If the joints are one, or the spacing is none, or no entry lies in the range of the target.
        UnsupportedError: If a table cannot say it: a joint slides, a boundary has several effective angles or depends
            on a third coordinate, the dependent joint has no limit, a rule has a condition.

    Example:
        >>> import pinbound as pb
        >>> table = pb.limit_table(pb.load("minervabot_v3"), "q2", "q3")
        >>> angles, lower, upper = table.in_degrees()
        >>> len(angles), float(angles[0]), float(lower[20]), float(upper[20])
        (81, -10.0, -8.462041, 42.429119)
        >>> round(float(np.degrees(table.loss)), 6) < 0.5
        True
    """
    refuse_conditions(robot, "A table")
    pair = _pair(robot, target, dependent, spacing)
    chosen = robot.boundaries if boundaries is None else robot.boundaries.select(boundaries)
    planes = _half_planes(robot, list(chosen), pair)
    low, high = _range(planes, dependent)
    step = math.radians(spacing)
    first, last = math.ceil(low / step - TABLE), math.floor(high / step + TABLE)
    angles = np.asarray(np.arange(first, last + 1) * step, dtype=np.float64)
    rows = np.array([_interval(planes, float(x)) for x in angles]).reshape(-1, 2)
    lower, upper = rows[:, 0] + TABLE, rows[:, 1] - TABLE
    if whole:
        lower, upper = np.radians(np.ceil(np.degrees(lower))), np.radians(np.floor(np.degrees(upper)))
    kept = np.flatnonzero(lower <= upper)
    if not len(kept):
        said = f"no multiple of {spacing:g} deg of {target!r} leaves {dependent!r} anything"
        said += f", for the range of {target!r} is {_degrees(low)} .. {_degrees(high)}"
        raise DimensionError(f"{said}; give a smaller spacing, or leave whole out")
    inside = slice(int(kept[0]), int(kept[-1]) + 1)  # a convex set: no gap between
    angles, lower, upper = angles[inside], lower[inside], upper[inside]
    notes = [
        f"keep {target!r} within {_degrees(float(angles[0]))} .. {_degrees(float(angles[-1]))}: readers hold the last "
        f"entries beyond them, where they need not be safe; the true range is {_degrees(low)} .. {_degrees(high)}"
    ]
    others = [name for name in robot.boundaries.names if name not in chosen.names]
    if others:
        notes.append(f"not kept by this table: {', '.join(others)}")
    loss = _loss(planes, angles, lower, upper)
    return LimitTable(robot.name, target, dependent, angles, lower, upper, loss, (low, high), tuple(notes))


def _pair(robot: Robot, target: str, dependent: str, spacing: float) -> tuple[int, int]:
    for name in (target, dependent):
        if name not in robot.coordinates:
            raise UnknownNameError("coordinate", name, robot.coordinates)
        if not robot.turns(name):
            raise UnsupportedError(f"{name!r} slides: these tables are of angles. Use `boundaries.limits_table`")
    if target == dependent:
        raise DimensionError(f"target and dependent are both {target!r}; name two joints")
    if not 0.0 < spacing <= 90.0:
        raise DimensionError(f"spacing is {spacing}; give degrees above 0, at most 90")
    return robot.coordinates.index(target), robot.coordinates.index(dependent)


def _half_planes(robot: Robot, boundaries: Sequence[Boundary], pair: tuple[int, int]) -> Array:
    """Return rows (a, c, b): `a x + c y <= b`."""
    rows: list[tuple[float, float, float]] = []
    for limit in robot.linear_limits:
        _add(
            rows, limit.coefficients, (limit.lower - limit.offset, limit.upper - limit.offset), pair, limit.joint, robot
        )
    for one in boundaries:
        used = [robot.coordinates.index(name) for name in one.coordinates]
        if not set(used) & set(pair):
            continue
        if one.contacts is None:
            said = f"boundary {one.name!r} has several effective angles, so that its contact is no straight line"
            raise UnsupportedError(f"{said}: between entries nothing is proved. Trace a region, or leave it out")
        for contact in one.contacts:
            gap = contact.gap(float(contact.coefficients @ robot.home))
            stop = one.rule.stop
            ends = stop.free_gap if stop is not None else gap
            _add(rows, contact.coefficients, ends, pair, one.name, robot)
    return np.array(rows).reshape(-1, 3)


def _add(
    rows: list[tuple[float, float, float]],
    coefficients: Array,
    ends: tuple[float, float],
    pair: tuple[int, int],
    name: str,
    robot: Robot,
) -> None:
    others = [index for index in np.flatnonzero(coefficients).tolist() if index not in pair]
    a, c = (float(coefficients[index]) for index in pair)
    if not a and not c:
        return
    if others:
        said = f"{name!r} depends on {robot.coordinates[others[0]]!r}, too"
        raise UnsupportedError(f"{said}: a table of two joints cannot say it. Leave it out, or take other joints")
    for end, sign in ((ends[1], 1.0), (ends[0], -1.0)):
        if math.isfinite(end):
            rows.append((sign * a, sign * c, sign * end))


def _interval(planes: Array, x: float) -> tuple[float, float]:
    a, c, b = planes.T
    room = b - a * x
    above, below = c > 0.0, c < 0.0
    lower = float((room[below] / c[below]).max(initial=-math.inf))
    return lower, float((room[above] / c[above]).min(initial=math.inf))


def _range(planes: Array, dependent: str) -> tuple[float, float]:
    """Return the range of x over the polygon: the ends lie at corners."""
    a, c, b = planes.T
    if not (np.any(c > 0.0) and np.any(c < 0.0)):
        raise UnsupportedError(f"nothing limits {dependent!r} on both sides: a table cannot say it; give it limits")
    corners = _breaks(planes)
    straight = c == 0.0
    fits = [
        x
        for x in corners
        if np.all(a[straight] * x <= b[straight] + TABLE) and _interval(planes, x)[0] <= _interval(planes, x)[1] + TABLE
    ]
    if len(fits) < 2:
        raise UnsupportedError(
            "the target has no range with limits on both sides: a table cannot say it; give it limits"
        )
    return min(fits), max(fits)


def _breaks(planes: Array) -> list[float]:
    """Return x of every two lines' common point."""
    found: list[float] = []
    for k, (a, c, b) in enumerate(planes.tolist()):
        for u, v, w in planes[:k].tolist():
            area = a * v - c * u
            if area:
                found.append((b * v - c * w) / area)
    return found


def _loss(planes: Array, angles: Array, lower: Array, upper: Array) -> float:
    """Return the largest difference from the true interval: both are broken lines, so it is at a break of one."""
    inner = [x for x in _breaks(planes) if angles[0] <= x <= angles[-1]]
    xs = np.unique(np.concatenate((angles, np.array(inner))))
    true = np.array([_interval(planes, float(x)) for x in xs])
    below, above = np.interp(xs, angles, lower) - true[:, 0], true[:, 1] - np.interp(xs, angles, upper)
    return float(np.maximum(below, above).max())


def _degrees(angle: float) -> str:
    return f"{math.degrees(angle):.6g} deg"


def _number(value: float) -> str:
    return f"{value + 0.0:.{_DECIMALS}f}".rstrip("0").rstrip(".")


def _numbers(values: Array, by: str) -> str:
    return by.join(_number(float(value)) for value in values)


def _whole_degrees(table: LimitTable, reader: str) -> tuple[Array, Array, Array]:
    angles, lower, upper = table.in_degrees()
    if not np.array_equal(np.diff(angles), np.ones(len(angles) - 1)) or not np.array_equal(angles, np.round(angles)):
        raise UnsupportedError(f"{reader} takes one entry a whole degree; make the table with spacing=1")
    return angles, lower, upper


def _head(table: LimitTable, mark: str) -> str:
    lines = [
        f"pinbound: limits of {table.dependent} over {table.target} of {table.robot} [deg], straight between entries;",
        f"at most {math.degrees(table.loss):.4f} deg are lost. " + " ".join(table.notes),
    ]
    return "".join(f"{mark} {' '.join(line.split())}\n" for line in lines)


def _skrobot(table: LimitTable) -> str:
    angles, lower, upper = table.in_degrees()
    return (
        f"{_head(table, '#')}joint_limit_tables:\n"
        f"- target_joint: {json.dumps(table.target)}\n  dependent_joint: {json.dumps(table.dependent)}\n"
        f"  target_min_angle: {_number(float(angles[0]))}\n  target_max_angle: {_number(float(angles[-1]))}\n"
        f"  min_angles: [{_numbers(lower, ', ')}]\n  max_angles: [{_numbers(upper, ', ')}]\n"
    )


def _jskeus(table: LimitTable) -> str:
    angles, lower, upper = _whole_degrees(table, "jskeus")
    if not (np.array_equal(lower, np.round(lower)) and np.array_equal(upper, np.round(upper))):
        raise UnsupportedError("jskeus takes whole degrees; make the table with whole=True (--whole)")
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
"""Writers by format: degrees, but for JSON, which is in radians."""
