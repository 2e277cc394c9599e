"""The regions on the page: outlines with named edges, as Python computed them; and the windows for sampling."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from pinbound import units
from pinbound.exceptions import DimensionError, UnknownNameError, UnsupportedError
from pinbound.region import Edge, Region, feasible_region
from pinbound.region.halfplanes import HalfPlane
from pinbound.robot.loop_robot import LoopRobot
from pinbound.robot.robot import Robot
from pinbound.typing import Array

__all__ = ["chosen_planes", "plane_record", "windows"]

_DIGITS = 12  # decimals of the points of an outline, in rad and m; four are visible in a picture


def chosen_planes(robot: Robot, planes: Sequence[Sequence[str]] | None) -> list[tuple[str, str]]:
    """Return the pairs of coordinates whose regions are computed.

    Args:
        robot: The robot.
        planes: Two coordinates each. None: the two that most boundaries depend on, the first ones if several tie.

    Raises:
        DimensionError: If a plane has not two coordinates.
        UnknownNameError: If the robot has no such coordinate.
    """
    names = robot.coordinates
    if planes is None:
        if len(names) < 2:
            return []
        used = Counter(name for one in robot.boundaries for name in one.coordinates)
        two = sorted(sorted(names, key=lambda name: -used[name])[:2], key=names.index)
        return [(two[0], two[1])]
    found: list[tuple[str, str]] = []
    for plane in planes:
        for name in plane:
            if name not in names:
                raise UnknownNameError("coordinate", name, names)
        if len(set(plane)) != 2:
            raise DimensionError(f"a plane has two coordinates, not {', '.join(plane)}; give two of {', '.join(names)}")
        found.append((plane[0], plane[1]))
    return found


def windows(robot: Robot, at: Array, window: dict[str, tuple[float, float]]) -> list[tuple[float, float]]:
    """Return the range of each coordinate that the page shows: its limits, else the window, else one turn or 2 m.

    Limits of mimic joints and rules of one coordinate narrow the range, too. Values at which a loop cannot be closed
    stay in the range: there the page says that the loop cannot be closed.
    """
    ends: list[tuple[float, float]] = []
    is_looped = isinstance(robot, LoopRobot)
    toggles = robot.lift.toggle_names() if is_looped else ()
    limits = [one for one in (robot.opened if is_looped else robot).linear_limits if one.joint not in toggles]
    for index, name in enumerate(robot.coordinates):
        low, high = float(robot.lower[index]), float(robot.upper[index])
        for limit in limits:
            c = float(limit.coefficients[index])
            if c and np.count_nonzero(limit.coefficients) == 1:
                two = sorted(((limit.lower - limit.offset) / c, (limit.upper - limit.offset) / c))
                low, high = max(low, two[0]), min(high, two[1])
        half = math.pi if robot.turns(name) else 1.0
        given = window.get(name, (-math.inf, math.inf))
        low, high = max(low, given[0]), min(high, given[1])
        value = float(at[index])
        ends.append((low if math.isfinite(low) else value - half, high if math.isfinite(high) else value + half))
    return ends


def plane_record(
    robot: Robot,
    plane: tuple[str, str],
    at: Array,
    shown: Sequence[tuple[float, float]],
    budget: float,
    width: float,
) -> dict[str, Any]:
    """Return the outline of one region, or the reason why there is none.

    Args:
        robot: The robot.
        plane: The two coordinates.
        at: (n,) the values of the other coordinates.
        shown: The range of each coordinate that the page shows.
        budget: The time for tracing [s].
        width: The longest side of the cells around curved edges, as in `feasible_region`.
    """
    columns = [robot.coordinates.index(name) for name in plane]
    record: dict[str, Any] = {"columns": columns, "at": at.tolist()}
    window = {
        name: shown[column]
        for name, column in zip(plane, columns, strict=True)
        if not (math.isfinite(robot.lower[column]) and math.isfinite(robot.upper[column]))
    }
    try:
        region = feasible_region(robot, plane, at, window, budget=budget, width=width)
    except (DimensionError, UnsupportedError) as error:
        return record | {"error": str(error)}
    if region.is_empty:
        return record | {"error": "the region is empty"}
    return record | {
        "fixed": [robot.coordinates.index(name) for name in region.fixed],
        "loops": [[_edge(edge) for edge in loop] for loop in region.loops],
        "corners": region.vertices.tolist(),
        "is_exact": region.accuracy == 0.0,
        "said": _said(region),
        "implied": _implied(region),
        "slits": [np.round(slit.points, _DIGITS).tolist() for slit in region.slits],
    }


def _edge(edge: Edge) -> dict[str, Any]:
    return {
        "name": edge.name,
        "source": edge.source,
        "is_contact": edge.is_contact,
        "points": np.round(edge.points, _DIGITS).tolist() if len(edge.points) > 2 else edge.points.tolist(),
    }


def _said(region: Region) -> str:
    """Return how exact the outline is, and its area, as text."""
    unit = units.area_name(region.area_unit)
    area = f"area {region.area:.6g} {unit}"
    if region.accuracy == 0.0:
        return f"straight edges, exact; {area}"
    low, high = region.area_interval
    said = f"curved edges within {region.accuracy:.3g}; {area}, between {low:.6g} and {high:.6g}"
    if region.slits:
        said += f"; no motion crosses the dashed cut ({', '.join(dict.fromkeys(slit.name for slit in region.slits))})"
    return f"{said}; {region.unresolved_text}" if region.unresolved_text else said


def _implied(region: Region) -> list[dict[str, Any]]:
    """Return implied contact lines `normal . x = bound`: they are no edges; the nearest of each boundary is dashed."""
    supports, edges = region.supports(), {edge.source for edge in region.edges}
    nearest: dict[str, tuple[float, HalfPlane]] = {}
    for half in region.half_planes:
        if half.is_contact and half.source not in edges and half.name in supports and supports[half.name].by:
            slack = half.bound - float(np.max(region.vertices @ half.normal))
            if slack < nearest.get(half.name, (math.inf, half))[0]:
                nearest[half.name] = slack, half
    return [{"name": name, "normal": half.normal.tolist(), "bound": half.bound} for name, (_, half) in nearest.items()]
