"""Tables of coupled limits: the limits of one joint over the angle of another, safe under linear interpolation.

Boundaries of one effective angle, and joint limits, each allow an interval of a linear combination of q. Over two
coordinates they form a convex polygon. Every entry lies in it, so every line between two entries does, too. This is the
proof between entries. The lower limit of a row is `lower(x) = max (b_k - a_k x) / c_k`; the upper limit is similar.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pinbound.boundaries.boundary import Boundary
from pinbound.checks import names_of
from pinbound.exceptions import DimensionError, UnknownNameError, UnsupportedError
from pinbound.robot.robot import Robot, check_robot, refuse_conditions
from pinbound.robot.table_formats import LimitTable
from pinbound.tolerances import LIMIT, TABLE
from pinbound.typing import Array

__all__ = ["ENTRIES", "limit_table"]

_BESIDE = 1e-3  # rad: distance to both sides of a corner
_MOST_ENTRIES = 100_000
_FINER = 6  # number of spacings that are tried between two corners; each has one entry more than the one before
_STRAIGHT = 1e-6  # slopes that differ by less count as equal

ENTRIES = ("multiples", "fitted", "corners")
"""The kinds of grids; `limit_table` explains them."""


def limit_table(
    robot: Robot,
    target: str,
    dependent: str,
    *,
    spacing: float = 1.0,
    grid: str | None = None,
    whole: bool = False,
    boundaries: Sequence[str] | str | None = None,
) -> LimitTable:
    """Return the limits of one joint over the angle of another, safe under linear interpolation between entries.

    All boundaries and joint limits that depend on the two joints are used, also limits of mimic joints. A reader that
    interpolates linearly and refuses targets beyond the entries accepts free pairs of angles only.

    Args:
        robot: The robot.
        target: An active revolute joint, on which the limits depend.
        dependent: Another active revolute joint, which is limited.
        spacing: Largest spacing of the entries [deg].
        grid: The positions of the entries. ``"fitted"``: equally spaced by at most `spacing`, such that corners of the
            limits fall on entries; skrobot needs this. ``"corners"``: at whole multiples of the spacing and at all
            corners, also at the ends of the target's range; nothing is lost, but only CSV and JSON can store it.
            ``"multiples"``: at whole multiples only; jskeus and hrpsys need this, and corners between entries are lost.
            None: ``"fitted"``, or ``"multiples"`` if `whole`.
        whole: Whether the limits are rounded inwards to whole degrees, which jskeus needs.
        boundaries: Names of the boundaries; None: all.

    Raises:
        UnknownNameError: If a joint, boundary or grid does not exist.
        DimensionError: If the two joints are the same, if the spacing is not positive, or if no entry lies in the range
            of the target.
        UnsupportedError: If a table cannot represent the limits: a joint is prismatic, a boundary has several effective
            angles or depends on a third coordinate, the dependent joint has no limit, or a rule has a condition.

    Example:
        >>> import pinbound as pb
        >>> table = pb.limit_table(pb.load("minervabot_v3"), "q2", "q3")
        >>> angles, lower, upper = table.in_degrees()
        >>> len(angles), angles[[0, -1]].round(3).tolist(), float(lower[20]), float(upper[20])
        (89, [-9.524, 69.981], -8.462041, 40.974386)
        >>> round(float(np.degrees(table.loss)), 3)
        0.0
        >>> whole = pb.limit_table(pb.load("minervabot_v3"), "q2", "q3", grid="multiples")
        >>> round(float(np.degrees(whole.loss)), 3)
        0.247
    """
    check_robot(robot)
    target, dependent = names_of((target, dependent), "coordinates")
    grid = ("multiples" if whole else "fitted") if grid is None else grid
    if grid not in ENTRIES:
        raise UnknownNameError("grid", grid, ENTRIES)
    refuse_conditions(robot, "A table")
    pair = _pair(robot, target, dependent, spacing)
    chosen = robot.boundaries if boundaries is None else robot.boundaries.select(boundaries)
    planes = _half_planes(robot, list(chosen), pair)
    low, high = _range(planes, dependent)
    angles = _angles(planes, low, high, spacing, grid)
    angles, lower, upper = _entries(planes, angles, whole)
    if not len(angles):
        said = f"no multiple of {spacing:g} deg of {target!r} leaves {dependent!r} a range"
        said += f", for the range of {target!r} is {_degrees(low)} .. {_degrees(high)}"
        raise DimensionError(f"{said}; give a smaller spacing, or leave whole out")
    notes = [
        f"keep {target!r} within {_degrees(float(angles[0]))} .. {_degrees(float(angles[-1]))}: beyond them readers "
        f"repeat the last entry, which need not be safe there; the true range is {_degrees(low)} .. {_degrees(high)}"
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
            raise UnsupportedError(
                f"{name!r} is prismatic, and these tables are of angles. Use `boundaries.limits_table`"
            )
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
            said = f"boundary {one.name!r} has several effective angles, so its contact is not a straight line"
            raise UnsupportedError(
                f"{said}: nothing can be proven between entries. Trace a region, or leave this boundary out"
            )
        for contact in one.contacts:
            gap = contact.gap(float(contact.coefficients @ robot.home))
            stop = one.rule.stop
            low, high = stop.free_gap if stop is not None else gap
            # `_entries` keeps a margin in the dependent joint; contacts that it does not change need the margin here.
            spare = 0.0 if contact.coefficients[pair[1]] else TABLE
            _add(rows, contact.coefficients, (low + spare, high - spare), pair, one.name, robot)
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
        said = f"{name!r} also depends on {robot.coordinates[others[0]]!r}"
        raise UnsupportedError(f"{said}: a table of two joints cannot represent it. Leave it out, or name other joints")
    for end, sign in ((ends[1], 1.0), (ends[0], -1.0)):
        if math.isfinite(end):
            rows.append((sign * a, sign * c, sign * end))


def _interval(planes: Array, x: float) -> tuple[float, float]:
    a, c, b = planes.T
    room = b - a * x
    above, below = c > 0.0, c < 0.0
    lower = float((room[below] / c[below]).max(initial=-math.inf))
    return lower, float((room[above] / c[above]).min(initial=math.inf))


def _entries(planes: Array, angles: Array, whole: bool) -> tuple[Array, Array, Array]:
    """Return the angles at which an interval remains, and its lower and upper end there, `TABLE` inside the limits."""
    rows = np.array([_interval(planes, float(x)) for x in angles]).reshape(-1, 2)
    lower, upper = rows[:, 0] + TABLE, rows[:, 1] - TABLE
    if whole:
        lower, upper = np.radians(np.ceil(np.degrees(lower))), np.radians(np.floor(np.degrees(upper)))
    a, c, b = planes.T
    straight = c == 0.0
    within = np.all(np.outer(angles, a[straight]) <= b[straight] + LIMIT, axis=1)
    kept = np.flatnonzero((lower <= upper) & within)
    inside = slice(int(kept[0]), int(kept[-1]) + 1) if len(kept) else slice(0)  # the set is convex: it has no gaps
    return angles[inside], lower[inside], upper[inside]


def _angles(planes: Array, low: float, high: float, spacing: float, grid: str) -> Array:
    """Return the angles of the entries [rad]; corners are exact to 1e-12 degrees, the precision of printed angles."""
    step = math.radians(spacing)
    if (high - low) / step > _MOST_ENTRIES:
        said = (
            f"a range of {math.degrees(high - low):g} deg in steps of {spacing:g} deg has over {_MOST_ENTRIES} entries"
        )
        raise DimensionError(f"{said}; give a larger spacing, or narrower limits")
    first, last = math.ceil(low / step - TABLE), math.floor(high / step + TABLE)
    multiples = np.asarray(np.arange(first, last + 1) * step, dtype=np.float64)
    inner = np.array(sorted(x for x in _breaks(planes) if low < x < high and _is_corner(planes, x)))
    corners: list[float] = inner[np.diff(inner, prepend=-math.inf) > TABLE].tolist()
    if grid == "multiples" or (grid == "fitted" and not corners):
        return multiples
    if grid == "corners":
        ends = (low + TABLE, high - TABLE)
        every = np.unique(np.concatenate((multiples[(multiples > ends[0]) & (multiples < ends[1])], corners, ends)))
        return every[np.concatenate(([True], np.diff(every) > TABLE))]
    candidates = [multiples]
    for index, start in enumerate(corners):
        for other in [*corners[:index], *corners[index + 1 :]] or [start + step]:
            apart = abs(other - start)
            for more in range(_FINER):
                width = apart / (max(math.ceil(apart / step - TABLE), 1) + more)
                if width > 0.25 * step:  # otherwise corners that are close to each other would make the table too long
                    before, behind = math.floor((start - low) / width), math.floor((high - start) / width)
                    candidates.append(np.asarray(start + width * np.arange(-before, behind + 1), dtype=np.float64))

    def rank(angles: Array) -> tuple[float, float, int]:
        """Return the sort key: loss of the dependent joint, then loss of the target's range, then number of entries."""
        kept, lower, upper = _entries(planes, angles, False)
        if not len(kept):
            return math.inf, math.inf, 0
        loss, left_out = _loss(planes, kept, lower, upper), high - low - (kept[-1] - kept[0])
        return round(math.degrees(loss), 3), round(math.degrees(left_out), 1), len(kept)

    return min(candidates, key=rank)


def _is_corner(planes: Array, x: float) -> bool:
    """Return whether the slope of one of the two limits changes at x."""
    at, before, behind = (np.array(_interval(planes, x + step)) for step in (0.0, -_BESIDE, _BESIDE))
    return bool(np.any(np.abs(before + behind - 2.0 * at) > _BESIDE * _STRAIGHT))


def _range(planes: Array, dependent: str) -> tuple[float, float]:
    """Return the range of x over the polygon; its ends are at corners."""
    a, c, b = planes.T
    if not (np.any(c > 0.0) and np.any(c < 0.0)):
        raise UnsupportedError(
            f"nothing limits {dependent!r} on both sides: a table needs a finite range; give it limits"
        )
    corners = _breaks(planes)
    straight = c == 0.0
    fits = [
        x
        for x in corners
        if np.all(a[straight] * x <= b[straight] + TABLE) and _interval(planes, x)[0] <= _interval(planes, x)[1] + TABLE
    ]
    if len(fits) < 2:
        raise UnsupportedError(
            "the target has no range with limits on both sides: a table needs a finite range; give it limits"
        )
    return min(fits), max(fits)


def _breaks(planes: Array) -> list[float]:
    """Return x of the intersection of every two lines."""
    found: list[float] = []
    for k, (a, c, b) in enumerate(planes.tolist()):
        for u, v, w in planes[:k].tolist():
            area = a * v - c * u
            if area:
                found.append((b * v - c * w) / area)
    return found


def _loss(planes: Array, angles: Array, lower: Array, upper: Array) -> float:
    """Return the largest difference from the true interval; as both are piecewise linear, it is at a corner of one."""
    inner = [x for x in _breaks(planes) if angles[0] <= x <= angles[-1]]
    xs = np.unique(np.concatenate((angles, np.array(inner))))
    true = np.array([_interval(planes, float(x)) for x in xs])
    below, above = np.interp(xs, angles, lower) - true[:, 0], true[:, 1] - np.interp(xs, angles, upper)
    return float(np.maximum(below, above).max())


def _degrees(angle: float) -> str:
    return f"{math.degrees(angle):.6g} deg"
