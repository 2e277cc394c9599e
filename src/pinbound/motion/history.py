"""Reads motions from files, and samples clearances, membership and distance to the region over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pinbound.certificates import signed_clearances
from pinbound.certificates.trajectory import as_trajectory
from pinbound.exceptions import Problems, name_hint
from pinbound.region import Region, classify, region_membership
from pinbound.robot.robot import Robot, check_robot
from pinbound.tables import open_table, read_table
from pinbound.tables.text import TextTable
from pinbound.tolerances import FOLLOWS
from pinbound.typing import Array, Ints
from pinbound.values import Value

__all__ = ["Motion", "MotionHistory", "history", "read_motion"]

_TIME = "time"
_MOST_FAULTS = 8


@dataclass(frozen=True, eq=False)
class Motion(Value):
    """Waypoints of a robot; the motion is straight in q between them.

    Attributes:
        waypoints: (N, n) [rad or m].
        times: (N,) the times in the file, or None if it has no `time` column.

    Example:
        >>> Motion(np.zeros((2, 3)), np.array([0.0, 1.0])).times.tolist()
        [0.0, 1.0]
    """

    waypoints: Array
    times: Array | None


@dataclass(frozen=True, eq=False)
class MotionHistory(Value):
    """A motion sampled over time, for figures and tables. Certificates do not sample.

    Attributes:
        coordinates: Active coordinates (n).
        angles: (n) whether each coordinate is an angle; otherwise it is a length.
        boundaries: Names of the boundaries (m).
        times: (N,).
        Q: (N, n) [rad or m].
        clearances: (N, m) signed clearances [m].
        mu: (N, n) membership of Eq. (21) [rad or m]; None without a region.
        signed_distance: (N,) signed distance to the contour of the region [unit], positive inside; None without a
            region.
        places: (N,) values of `Place`; None without a region.
        unit: Unit of the signed distance, as in `Membership.unit`.

    Example:
        >>> import pinbound as pb
        >>> seen = pb.history(pb.load("minervabot_v3"), np.radians([[0, 0, 0], [0, 20, 30]]), samples=5)
        >>> seen.clearances.shape[1], seen.mu
        (10, None)
    """

    coordinates: tuple[str, ...]
    angles: tuple[bool, ...]
    boundaries: tuple[str, ...]
    times: Array
    Q: Array
    clearances: Array
    mu: Array | None = None
    signed_distance: Array | None = None
    places: Ints | None = None
    unit: str = "rad"


def history(
    robot: Robot,
    waypoints: Any,
    times: ArrayLike | None = None,
    region: Region | None = None,
    samples: int = 1000,
) -> MotionHistory:
    """Return a motion's clearances, memberships and signed distance over time.

    Args:
        robot: The robot.
        waypoints: As in `certify`.
        times: As in `certify`.
        region: A region of the robot, for membership; the paper uses the scaled region.
        samples: The approximate number of samples; every waypoint or knot is one.

    Raises:
        DimensionError: As in `certify`.
        UnsupportedError: As in `certify`.

    References:
        Eq. (21); Figs. 20-22.

    Example:
        >>> import pinbound as pb
        >>> robot = pb.load("minervabot_v3")
        >>> region = pb.feasible_region(robot)
        >>> seen = history(robot, np.radians([[0, 0, 0], [0, 0, 60]]), region=region, samples=7)
        >>> [pb.Place(place).name for place in seen.places[[0, -1]]], bool(np.all(seen.mu[-1] > 0))
        (['INSIDE', 'OUTSIDE'], True)
    """
    check_robot(robot)
    trajectory = as_trajectory(waypoints, robot.coordinates, times)
    pieces = len(trajectory.starts)
    each = max(1, round(samples / pieces))
    piece = np.repeat(np.arange(pieces), each)
    u = np.tile(np.arange(each) / each, pieces)
    if trajectory.durations[-1] > 0.0:
        piece, u = np.append(piece, pieces - 1), np.append(u, 1.0)
    Q = trajectory.at(piece, u)
    clock = trajectory.starts[piece] + u * trajectory.durations[piece]
    clearances = signed_clearances(robot, Q)
    angles = tuple(robot.turns(name) for name in robot.coordinates)
    if region is None:
        return MotionHistory(robot.coordinates, angles, robot.boundaries.names, clock, Q, clearances)
    found = region_membership(robot, region, Q)
    return MotionHistory(
        robot.coordinates,
        angles,
        robot.boundaries.names,
        clock,
        Q,
        clearances,
        found.mu,
        found.signed_distance,
        classify(found.signed_distance),
        found.unit,
    )


def read_motion(robot: Robot, path: str | Path, deg: bool = False) -> Motion:
    r"""Read a motion from a file with one named column for each coordinate, and optionally a column `time`.

    The file is a .csv, .npy, .npz or .parquet (`pinbound.tables` has the rules). Mimic joints may have columns, too, as
    in recordings; their values must fit the coupling. An `.npz` holds one array for each column. The columns of an
    `.npy` are the coordinates, in order.

    Args:
        robot: The robot.
        path: The file.
        deg: Whether angles are in degrees. Prismatic joints are always in metres.

    Raises:
        InputError: If columns are missing or unknown, a cell is not a finite number, times do not increase, a mimic
            joint does not fit the coupling, or the file is empty or of another type. The error lists all faults.

    Example:
        >>> import pinbound as pb, tempfile
        >>> path = Path(tempfile.mkdtemp()) / "motion.csv"
        >>> _ = path.write_text("time,q1,q2,q3\n0,0,0,0\n2,90,30,40\n")
        >>> motion = read_motion(pb.load("minervabot_v3"), path, deg=True)
        >>> motion.times.tolist(), motion.waypoints[1].round(4).tolist()
        ([0.0, 2.0], [1.5708, 0.5236, 0.6981])
    """
    file = Path(path)
    problems = Problems(file.name)
    table = open_table(file, robot.coordinates)
    _check_names(robot, table.names, problems)
    problems.raise_if_any()
    columns = read_table(table, table.names)
    lines = table.lines() if isinstance(table, TextTable) else None
    if not any(len(column) for column in columns.values()):
        problems.add("there is no row", "Give at least one configuration")
    problems.raise_if_any()
    clock = columns.get(_TIME) if _TIME not in robot.coupling.joints else None
    _check_numbers(columns, clock, lines, problems)
    problems.raise_if_any()
    values = {name: np.radians(column) if deg and robot.turns(name) else column for name, column in columns.items()}
    waypoints = np.stack([values[name] for name in robot.coordinates], axis=1)
    _check_followers(robot, waypoints, values, lines, problems)
    problems.raise_if_any()
    return Motion(waypoints, clock)


def _check_names(robot: Robot, columns: Sequence[str], problems: Problems) -> None:
    valid = [_TIME, *robot.coupling.joints]
    for name in columns:
        if name not in valid:
            problems.add(f"column {name!r} is no joint of {robot.name!r}", name_hint(name, valid))
    missing = [name for name in robot.coordinates if name not in columns]
    if missing:
        needed = ", ".join(robot.coordinates)
        problems.add(f"there is no column for {', '.join(missing)}", f"Give one column per coordinate: {needed}")


def _check_numbers(
    columns: Mapping[str, Array], times: Array | None, lines: Sequence[int] | None, problems: Problems
) -> None:
    for name, column in columns.items():
        bad = np.flatnonzero(~np.isfinite(column))
        for row in bad[:_MOST_FAULTS]:
            value = "empty or nan" if np.isnan(column[row]) else f"{column[row]}"
            message = f"{name} in row {row + 1} is {value}"
            problems.add(message, "Give finite numbers", _line(lines, int(row)))
        if len(bad) > _MOST_FAULTS:
            problems.add(f"{name} is not finite in {len(bad)} rows", "Give finite numbers")
    if times is not None and not problems.found:
        falling = np.flatnonzero(np.diff(times) <= 0.0)
        if falling.size:
            row = int(falling[0]) + 1
            message = f"time does not increase in row {row + 1}: {times[row]:g} after {times[row - 1]:g}"
            more = f" (and in {len(falling) - 1} more)" if len(falling) > 1 else ""
            problems.add(message + more, "Sort the rows, one for each time", _line(lines, row))


def _check_followers(
    robot: Robot, waypoints: Array, values: Mapping[str, Array], lines: Sequence[int] | None, problems: Problems
) -> None:
    theta = robot.coupling.expand(waypoints)
    for column, name in enumerate(robot.coupling.joints):
        if name in values and name not in robot.coordinates:
            gap = np.abs(values[name] - theta[:, column])
            row = int(np.argmax(gap))
            if gap[row] > FOLLOWS:
                rule = robot.coupling.text(name)
                message = f"{name!r} does not follow ({rule}) in row {row + 1}: {values[name][row]:.9g}"
                remedy = f"It should be {theta[row, column]:.9g}; leave the column out, or correct it"
                problems.add(message, remedy, _line(lines, row))


def _line(lines: Sequence[int] | None, row: int) -> int | None:
    return None if lines is None else lines[row]


def tightest(names: Sequence[str], clearances: Array, most: int) -> list[int]:
    """Return the indices of the columns with the smallest clearances, the smallest first."""
    order = np.argsort(clearances.min(axis=0), kind="stable")
    return [int(column) for column in order[: min(most, len(names))]]
