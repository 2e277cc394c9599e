"""The data of a page: a robot as JSON, with numbers that JavaScript reads without a change of value."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from pinbound.boundaries.boundary import Boundary
from pinbound.boundaries.looped import formula_joints
from pinbound.certificates import Certificate
from pinbound.coverage import Coverage
from pinbound.explorer.loops import boundary_speeds, loops_record
from pinbound.explorer.planes import plane_record, windows
from pinbound.explorer.program import program_record, ways
from pinbound.explorer.solids import bodies_record, marks_record
from pinbound.figures.plots import PALETTE
from pinbound.model.coupling import GuardedLimit, Intervals, LinearLimit
from pinbound.motion.history import Motion
from pinbound.robot.loop_robot import LoopRobot
from pinbound.robot.robot import Robot
from pinbound.tolerances import UNIT_ROUNDOFF
from pinbound.typing import Array

__all__ = ["motion_record", "page_record"]

MOST_FORMULAS = 60
"""Boundaries whose formulas are on the page: SymPy takes 50 ms and more for each."""
MOST_ROTATIONS = 3
"""Rotations of a path up to which its formula can be read."""


def page_record(
    robot: Robot,
    planes: Sequence[tuple[str, str]],
    at: Array,
    window: dict[str, tuple[float, float]],
    meshes: bool,
    budget: float,
    width: float,
) -> dict[str, Any]:
    """Return all data of the page except the motion.

    Args:
        robot: The robot.
        planes: Pairs of coordinates whose regions are computed.
        at: (n,) the values at which the other coordinates are fixed and at which the page starts.
        window: The ranges of coordinates without limits.
        meshes: Whether meshes are drawn.
        budget: The time for each region [s].
        width: The longest side of the cells around curved edges, as in `feasible_region`.
    """
    looped = robot if isinstance(robot, LoopRobot) else None
    over = robot if looped is None else looped.opened  # the page evaluates the opened robot at z = F(q)
    boundaries = list(over.boundaries)
    marks = [(one.point_a.name, one.point_b.name) for one in boundaries]
    rules = [one.rule for one in boundaries]
    program, values, places = program_record(over, rules, marks, over.boundaries.common)
    shown = windows(robot, at, window)
    reach = np.maximum(np.abs(over.lower), np.abs(over.upper))
    drawn, missing = bodies_record(robot, meshes)
    regions = [plane_record(robot, plane, at, shown, budget, width) for plane in planes]
    points = [one for one in boundaries if not one.path.difference.directions]
    formulas = [one for one in points if one.path.minimal.rotations <= MOST_ROTATIONS][:MOST_FORMULAS]
    named = {one.name: _formula(one) for one in formulas}
    return {
        "format": "pinbound explorer 1",
        "robot": robot.name,
        "coordinates": [
            {"name": name, "unit": "rad" if robot.turns(name) else "m", "window": list(ends)}
            for name, ends in zip(robot.coordinates, shown, strict=True)
        ],
        "home": robot.home.tolist(),
        "at": at.tolist(),
        "program": program,
        "boundaries": [
            _boundary(one, value, reach, named.get(one.name, []))
            | {"coordinates": list(robot.boundaries[one.name].coordinates)}
            | ({} if looped is None else _through(looped, one, reach))
            for one, value in zip(boundaries, values, strict=True)
        ],
        "limits": _limits(over.linear_limits, over.guarded_limits, over.intervals),
        "loops": looped and loops_record(looped, shown),
        "links": [
            {"name": name, "parent": joint.parent if (joint := robot.tree.parent_joint.get(name)) else None} | place
            for name, place in zip(robot.tree.links, places, strict=True)
        ],
        "bodies": drawn,
        "marks": marks_record(robot),
        "regions": regions,
        "colours": _colours(regions, robot.boundaries.names),
        "palette": len(PALETTE),
        "coverage": _coverage(robot.coverage),
        "missing": missing,
        "notes": [*missing, *robot.notes],
        "assumptions": list(robot.annotations.assumptions),
    }


def _boundary(one: Boundary, value: dict[str, Any], reach: Array, formula: Sequence[str]) -> dict[str, Any]:
    stop = one.rule.stop
    return value | {
        "name": one.name,
        "marks": [one.point_a.name, one.point_b.name],
        "links": [one.point_a.link, one.point_b.link],
        "kind": one.kind.value,
        "ancestor": one.ancestor,
        "threshold": one.threshold,
        "distance": one.contact_distance,
        "is_height": one.path.floor < 0.0,
        "stop": stop
        and {"coefficients": stop.coefficients.tolist(), "gap": list(stop.free_gap), "amplitude": stop.amplitude},
        "ways": ways(one.rule, reach),
        "contacts": None
        if one.contacts is None
        else [
            {"text": c.text, "angle": c.angle, "half_width": c.half_width, "smallest": c.smallest} for c in one.contacts
        ],
        "formula": list(formula),
    }


def _through(robot: LoopRobot, one: Boundary, reach: Array) -> dict[str, Any]:
    """Return the data that the page needs to evaluate a boundary at z where loops are solved."""
    return {"speeds": boundary_speeds(one.rule, reach), "solved": robot.coupling.solved(formula_joints(one))}


def _formula(one: Boundary) -> list[str]:
    """Return the components of the minimal form as MathML."""
    from pinbound.evaluate import symbolic

    return list(symbolic.mathml(one.expression()))


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _linear(one: LinearLimit) -> dict[str, Any]:
    return {
        "joint": one.joint,
        "coefficients": one.coefficients.tolist(),
        "offset": one.offset,
        "lower": _finite(one.lower),
        "upper": _finite(one.upper),
    }


def _limits(linear: Sequence[LinearLimit], guarded: Sequence[GuardedLimit], intervals: Intervals) -> dict[str, Any]:
    """Return limits and rules as declared, and as the rows by which the page decides whether q is within them."""
    return {
        "linear": [_linear(one) for one in linear],
        "guarded": [
            {"name": one.name, "limit": _linear(one.limit), "where": [_linear(part) for part in one.where]}
            for one in guarded
        ],
        "rows": [
            {"coefficients": c, "low": low, "high": high, "is_sum": is_sum}
            for c, low, high, is_sum in zip(
                intervals.coefficients.tolist(),
                intervals.low.tolist(),
                intervals.high.tolist(),
                intervals.is_sum.tolist(),
                strict=True,
            )
        ],
        "roundoff": UNIT_ROUNDOFF,
    }


def _colours(regions: Sequence[dict[str, Any]], names: Sequence[str]) -> dict[str, int]:
    """Return the index of each name's colour in the palette: edges first, as in the figures, then other boundaries."""
    edges = {edge["name"] for region in regions for loop in region.get("loops", ()) for edge in loop}
    first = sorted(edges, key=lambda name: (len(name), name))
    rest = sorted(set(names) - edges, key=lambda name: (len(name), name))
    return {name: index for index, name in enumerate([*first, *rest])}


def _coverage(coverage: Coverage) -> dict[str, Any]:
    return {
        "summary": coverage.record.summary,
        "is_complete": coverage.is_complete,
        "open": [
            {"links": list(pair.links), "status": pair.status.value, "reason": pair.reason} for pair in coverage.open
        ],
    }


def motion_record(robot: Robot, motion: Motion, found: Certificate, name: str) -> dict[str, Any]:
    """Return a motion and the contents of its certificate.

    Args:
        robot: The robot.
        motion: Waypoints; the motion is straight in q between them.
        found: The certificate of the whole motion.
        name: The name of the motion on the page.
    """
    times = np.arange(len(motion.waypoints), dtype=np.float64) if motion.times is None else motion.times
    first, tightest = found.first_contact, found.tightest
    return {
        "name": name,
        "waypoints": motion.waypoints.tolist(),
        "times": np.asarray(times, dtype=np.float64).tolist(),
        "is_timed": motion.times is not None,
        "verdict": found.verdict.value,
        "lower": _finite(found.lower),
        "upper": _finite(found.upper),
        "tightest": tightest and {"name": tightest.name, "time": tightest.time},
        "first_contact": first and {"before": first.before, "after": first.after, "name": found.violations[0].name},
        "open": [
            {"name": part.name, "start": part.start, "end": part.end, "reason": part.reason.value}
            for part in found.open_parts[:20]
        ],
        "coverage": found.coverage.summary,
        "notes": list(found.notes),
    }
