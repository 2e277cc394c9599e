"""Candidates for a home: configurations within all limits, on the same side of every contact as home.

The limits of mimic joints count, too. Candidates are drawn from the box of the limits of single coordinates, and kept
if they satisfy the other limits. If too few do, candidates are drawn along random lines through a configuration within
all limits (hit and run). A linear program finds this configuration.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, cast

import numpy as np

from pinbound.exceptions import Problems, UnsupportedError
from pinbound.loops.parallelograms import settle
from pinbound.model.coupling import GuardedLimit, Intervals, LinearLimit, couple
from pinbound.robot.axes import new_coordinates
from pinbound.robot.home import coordinate_ends
from pinbound.robot.robot import Robot
from pinbound.tolerances import LIMIT
from pinbound.typing import Array, Flags

__all__ = ["can_be_home", "configuration_text", "draw", "home_entries", "simple_homes", "within_limits"]

_FAR = {True: math.pi, False: 1.0}  # radians or metres from home, for a coordinate without limits
_WIDEST = {True: 2 * math.pi, False: 10.0}  # radians or metres from home: no candidate is further away
_ROUNDS = 20
_SHARES = (0.25, 0.75)  # of the limits: what a person would try next, after the middle
_NARROW = 0.01  # of the widest limit: steps go along limits that are narrower


def within_limits(limits: Sequence[LinearLimit], Q: Array, guarded: Sequence[GuardedLimit] = ()) -> Flags:
    """Return which rows of Q (N, n) keep all limits, as `free` judges it."""
    return Intervals.of(limits, Q.shape[1], guarded=guarded).hold(Q)


def draw(robot: Robot, count: int, rng: np.random.Generator) -> Array:
    """Return up to `count` random configurations (k, n) within all limits, those of mimic joints too.

    Coordinates without limits are drawn within pi or 1 m of home.

    Raises:
        UnsupportedError: If no configuration keeps all limits.
    """
    lower, upper = _box(robot)
    drawn, have = list[Array](), 0
    for _ in range(_ROUNDS):
        Q = lower + rng.random((count, len(lower))) * (upper - lower)
        drawn.append(Q[within_limits(robot.linear_limits, Q, robot.guarded_limits)])
        have += len(drawn[-1])
        if have >= count:
            break
    if have < count // 10:
        drawn.append(_hit_and_run(robot, (lower, upper), count - have, rng))
    return np.concatenate(drawn)[:count]


def simple_homes(robot: Robot) -> Array:
    """Return configurations (k, n) that a person would try first: home with one coordinate moved, and the middle.

    A coordinate goes to quarters of its limits, rounded to hundredths; all of them to the middle at once. What does
    not keep all limits is left out.
    """
    lower, upper = _box(robot)
    middle = np.round(0.5 * (lower + upper), 2)
    tried = [middle, *(np.round(lower + share * (upper - lower), 2) for share in _SHARES)]
    found: list[Array] = []
    for values in tried:
        for index, value in enumerate(values.tolist()):
            q = robot.home.copy()
            q[index] = value
            found.append(q)
    found.insert(len(lower), middle)
    Q = np.array(found).reshape(len(found), len(lower))
    return Q[within_limits(robot.linear_limits, Q, robot.guarded_limits)]


def _box(robot: Robot) -> tuple[Array, Array]:
    """Return the box of all limits that speak of one coordinate alone, windows where there are none (n,), (n,)."""
    lower, upper = coordinate_ends(robot.linear_limits, len(robot.coordinates)).T.copy()
    for index, name in enumerate(robot.coordinates):
        turns = robot.turns(name)
        at = float(np.clip(robot.home[index], lower[index], upper[index]))
        far = _WIDEST[turns] if math.isfinite(lower[index]) and math.isfinite(upper[index]) else _FAR[turns]
        lower[index], upper[index] = max(lower[index], at - far), min(upper[index], at + far)
    return lower, upper


def _hit_and_run(robot: Robot, box: tuple[Array, Array], count: int, rng: np.random.Generator) -> Array:
    """Return configurations (count, n), each from the one before by a random step along a random line."""
    rows, low, high = _inequalities(robot, box)
    limits = robot.intervals
    q = robot.home if limits.hold(robot.home[None])[0] else _inside(robot, rows, low, high)
    along = _wide_directions(rows, low, high)
    found = np.empty((count, len(q)))
    for row in range(count):
        direction = rng.normal(size=len(q))
        if row % 2 and np.any(along):
            direction = along @ direction  # along narrow limits: across them each step is short
        rate, value = rows @ direction, rows @ q
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = np.sort(np.stack(((low - value) / rate, (high - value) / rate)), axis=0)
        moving = rate != 0.0
        first, last = float(np.max(ends[0][moving])), float(np.min(ends[1][moving]))
        step = rng.uniform(first, last) if first < last else 0.0
        following = q + step * direction
        if limits.holds_at(following.tolist()):
            q = following
        found[row] = q
    return found


def _wide_directions(rows: Array, low: Array, high: Array) -> Array:
    """Return the projection (n, n) onto the directions in which no limit is narrow."""
    width = (high - low) / np.maximum(np.linalg.norm(rows, axis=1), LIMIT)
    finite = width[np.isfinite(width)]
    narrow = rows[width <= _NARROW * np.max(finite, initial=0.0)]
    if not len(narrow):
        return np.zeros((rows.shape[1], rows.shape[1]))
    return np.eye(rows.shape[1]) - np.linalg.pinv(narrow) @ narrow


def _inequalities(robot: Robot, box: tuple[Array, Array]) -> tuple[Array, Array, Array]:
    """Return rows, lower and upper ends of all limits and of the box: `low <= rows @ q <= high`."""
    limits = robot.linear_limits
    rows = np.array([limit.coefficients for limit in limits]).reshape(-1, len(box[0]))
    low = np.array([limit.lower - limit.offset for limit in limits])
    high = np.array([limit.upper - limit.offset for limit in limits])
    return np.vstack((rows, np.eye(len(box[0])))), np.append(low, box[0]), np.append(high, box[1])


def _inside(robot: Robot, rows: Array, low: Array, high: Array) -> Array:
    """Return the configuration that is furthest inside all limits, measured in each limit's own unit."""
    import scipy.optimize

    n = rows.shape[1]
    A = np.vstack((np.column_stack((rows, np.ones(len(rows)))), np.column_stack((-rows, np.ones(len(rows))))))
    b = np.concatenate((high, -low))
    finite = np.isfinite(b)
    bounds = [*[(None, None)] * n, (0.0, 1.0)]
    found: Any = cast(Any, scipy.optimize).linprog(
        np.append(np.zeros(n), -1.0), A_ub=A[finite], b_ub=b[finite], bounds=bounds
    )
    q: Any = np.full(n, np.nan) if found.x is None else np.array(found.x[:n], dtype=np.float64)
    if not within_limits(robot.linear_limits, q[None], robot.guarded_limits)[0]:
        raise UnsupportedError(
            f"no configuration of {robot.name!r} keeps the limits of all joints; widen the limits of mimic joints"
        )
    return q


def can_be_home(robot: Robot, q: Array) -> bool:
    """Return whether q could be home and leave everything else as it is.

    The boundaries that the robot has are free at q, no contact lies between home and q, and every closed loop couples
    its joints as before.
    """
    for boundary in robot.boundaries:
        least = boundary.contact_tolerance if boundary.is_stop else 0.0  # as `load` asks of a home
        if not float(boundary.signed_clearance(q)) > least:
            return False
    return not robot.boundaries.beyond(q) and _couples_alike(robot, q)


def _couples_alike(robot: Robot, q: Array) -> bool:
    if not robot.annotations.closures:
        return True
    marks = replace(robot.annotations, home=home_entries(robot, q))
    problems = Problems(robot.document.label)
    found = settle(robot.tree, couple(robot.tree.moving_joints), marks, problems).coupling
    change = new_coordinates(robot.annotations.axes, found, problems)
    found = found if change is None else change.coupling(found)
    same = found.coordinates == robot.coordinates and not problems.found
    return same and bool(
        np.allclose(found.S, robot.coupling.S, rtol=0.0, atol=LIMIT)
        and np.allclose(found.offset, robot.coupling.offset, rtol=0.0, atol=LIMIT)
    )


def home_entries(robot: Robot, q: Array) -> dict[str, float]:
    """Return q as a home element says it: every coordinate, and every joint that a closed loop moves."""
    axes = {axis.name for axis in robot.annotations.axes}  # home is said by joints
    entries = {name: value for name, value in zip(robot.coordinates, q.tolist(), strict=True) if name not in axes}
    theta = dict(zip(robot.coupling.joints, robot.coupling.expand(q).tolist(), strict=True))
    free = [joint.name for joint in robot.tree.moving_joints if joint.mimic is None]
    return entries | {name: theta[name] for name in free if name not in entries}


def configuration_text(robot: Robot, q: Array) -> str:
    """Return q for people: degrees, and millimetres for sliding joints.

    Example:
        >>> import pinbound as pb
        >>> configuration_text(pb.load("minervabot_v3"), np.array([0.0, np.pi / 2, -0.1]))
        'q1 = 0 deg, q2 = 90 deg, q3 = -5.72958 deg'
    """
    return ", ".join(_values(robot, q))


def _values(robot: Robot, q: Array) -> Iterator[str]:
    for name, value in zip(robot.coordinates, q.tolist(), strict=True):
        yield f"{name} = {math.degrees(value):.6g} deg" if robot.turns(name) else f"{name} = {1e3 * value:.6g} mm"
