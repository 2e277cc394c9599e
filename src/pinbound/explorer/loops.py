"""Loops that are not parallelograms, for the page: the numbers of their closed forms, and bounds of their rates.

The page evaluates all quantities at z, as Python does. z is q, then the passive joints and the transmission of each
loop.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pinbound.bounds.intervals import Interval
from pinbound.certificates.lifted import loop_errors
from pinbound.contact import ContactRule
from pinbound.explorer.program import speeds
from pinbound.loops.jets import Jet
from pinbound.loops.linkages import Form, Linkage
from pinbound.robot.loop_robot import LoopRobot
from pinbound.tolerances import TOGGLE
from pinbound.typing import Array, Ints

__all__ = ["boundary_speeds", "loops_record"]

_CELLS = 360
"""Number of parts of a coordinate's window; each part has its own bounds."""
_GRID = 180, 60
"""Parts of a coordinate's window, and of that of the one other coordinate that moves the same loops."""
_OVER = 1e-6
"""Of a part: how far its bounds hold beyond its ends, so that rounding never asks a neighbour's."""
_UP = 6e-3
"""Relative, by which bounds are raised before they are written with three digits, which are off by 5e-3 at most."""


def loops_record(robot: LoopRobot, shown: Sequence[tuple[float, float]]) -> dict[str, Any]:
    """Return the data with which the page solves the loops.

    Args:
        robot: The robot.
        shown: The range of each coordinate that the page shows.
    """
    lift = robot.lift
    return {
        "names": list(lift.names),
        "linkages": [_linkage(one, columns) for one, columns in zip(lift.linkages, lift.columns, strict=True)],
        "units": {name: "rad" if robot.turns(name) else "m" for name in robot.coupling.joints},
        "solved": robot.coupling.solved(lift.names),
        "pins": [
            {"link": link, "xyz": list(xyz)}
            for one in robot.closures
            for link, xyz in ((one.mark.link_a, one.mark.xyz_a), (one.mark.link_b, one.mark.xyz_b))
        ],
        "rates": [
            _rates(robot, index, shown) if index in lift.inputs else None for index in range(len(lift.coordinates))
        ],
    }


def _linkage(one: Linkage, columns: Sequence[int]) -> dict[str, Any]:
    most = 0.5 * TOGGLE
    low, high = one.transmission_range
    return {
        "name": one.name,
        "form": one.form.name,
        "angles": one.angles.tolist(),
        "vectors": one.vectors.tolist(),
        "slides": one.slides.tolist(),
        "lengths": list(one.lengths),
        "sign": one.sign,
        "mix": one.mix.tolist(),
        "rows": one.rows.tolist(),
        "offset": one.offset.tolist(),
        "ahead": one.ahead,
        "reference": one.reference,
        "columns": list(columns),
        "inputs": list(one.inputs),
        "range": [low, None if one.form is Form.TELESCOPE else high],
        "flat": float(np.sqrt((1.0 - most) * (1.0 + most))),
    }


def _rates(robot: LoopRobot, index: int, shown: Sequence[tuple[float, float]]) -> dict[str, Any]:
    """Return bounds of `|dz_k / dq_j|`, one for each of the equal parts of a coordinate's window.

    If exactly one other coordinate moves the same loops, its window is divided into `rows` parts, too. If several do,
    a bound holds for all values in their windows. A bound is null where none is known. All are null if one loop moves
    another and the angle of some loop can pass its cut: Python does not follow such loops over a box, either.
    """
    lift, n = robot.lift, len(robot.coordinates)
    is_chained = any(max(one.inputs) >= n for one in lift.linkages) and any(one.ahead < 0 for one in lift.linkages)
    ends = np.array(shown)
    errors = loop_errors(robot, ends[:, 0], ends[:, 1], 1).tolist()
    others = _beside(robot, index)
    cells, rows = (_CELLS, 1) if len(others) != 1 else _GRID
    count = cells * rows
    zero, one = Interval(np.zeros(count), np.zeros(count)), Interval(np.ones(count), np.ones(count))
    box = [Interval(np.full(count, low), np.full(count, high)) for low, high in shown]
    box[index] = _parts(*shown[index], cells, np.tile(np.arange(cells), rows))
    if rows > 1:
        box[others[0]] = _parts(*shown[others[0]], rows, np.repeat(np.arange(rows), cells))
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        jets = lift.jets([Jet(box[k], one if k == index else zero, zero) for k in range(n)], errors)
    found: dict[str, Any] = {}
    for k in range(n, len(lift.names)):
        rate = np.asarray(jets[k].first.magnitude)
        if np.any(rate != 0.0):
            found[str(k)] = [_written(value) if not is_chained else None for value in rate.tolist()]
    low, high = shown[index]
    return {
        "from": low,
        "to": high,
        "cells": cells,
        "rows": rows,
        "other": others[0] if rows > 1 else None,
        "of": found,
    }


def _beside(robot: LoopRobot, index: int) -> list[int]:
    """Return the other coordinates that move the same loops as a coordinate."""
    lift, n = robot.lift, len(robot.coordinates)
    moving: dict[int, set[int]] = {}  # for each passive joint, the coordinates that move it
    found: set[int] = set()
    for one in lift.linkages:
        inputs = set[int]().union(*({k} if k < n else moving[k] for k in one.inputs))
        moving |= dict.fromkeys(one.passive, inputs)
        found |= inputs if index in inputs else set()
    return sorted(found - {index})


def _parts(low: float, high: float, count: int, which: Ints) -> Interval:
    ends = np.linspace(low, high, count + 1)
    over = _OVER * (ends[1] - ends[0])
    return Interval(ends[which] - over, ends[which + 1] + over)


def _written(bound: float) -> float | None:
    return float(f"{bound * (1.0 + _UP):.3g}") if np.isfinite(bound) else None


def boundary_speeds(rule: ContactRule, reach: Array) -> list[float | None]:
    """Return bounds (n + k,) of `|d separation / d z_i|`, one for each entry of z; null where no bound is known."""
    return [float(one) if np.isfinite(one) else None for one in speeds(rule.path, reach)]
