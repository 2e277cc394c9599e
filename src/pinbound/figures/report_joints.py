"""Tables of the report about joints: the tree with the declared limits, the limits at home, and the closed loops."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pinbound import units
from pinbound.boundaries.boundary import Boundary
from pinbound.boundaries.looped import LoopBoundarySet, formula_joints
from pinbound.boundaries.spans import CoordinateLimits
from pinbound.exceptions import UnsupportedError
from pinbound.loops.solving import toggles
from pinbound.model.coupling import linear_text
from pinbound.robot.loop_robot import LoopRobot
from pinbound.robot.robot import Robot
from pinbound.typing import Array

__all__ = ["ClosureRow", "LimitRow", "LoopRow", "closure_rows", "limit_rows", "loop_rows", "solved_joints", "tree_rows"]

_SAMPLES = 10_000


@dataclass(frozen=True)
class LoopRow:
    """The row of a loop that is not a parallelogram.

    Attributes:
        name: The name of the closure.
        passive: Names of the two joints that it determines.
        inputs: Names of the joints that determine them; these may be passive joints of another loop.
        form: The closed form that solves the loop, e.g. ``"two arms"``.
        toggles: The configurations in which its two assemblies meet, as text for people.
    """

    name: str
    passive: tuple[str, ...]
    inputs: tuple[str, ...]
    form: str
    toggles: str


@dataclass(frozen=True)
class ClosureRow:
    """The row of a pin.

    Attributes:
        name: The name of the closure.
        links: The two links that it joins.
        bound: Proven bound of its gap, as text for people; for a solved loop, how it is solved.
        largest: The largest gap among the samples [m].
    """

    name: str
    links: tuple[str, str]
    bound: str
    largest: float


@dataclass(frozen=True)
class LimitRow:
    """The row of one coordinate: how far it can move from home, and what limits it, as text for people.

    Attributes:
        coordinate: Name of the coordinate.
        home: Its value at home.
        ends: The lower and the upper end of its motion.
        stops: The limit or boundary at each end; "-" if there is none.
        fault: The reason why there are no ends; empty if there are.
    """

    coordinate: str
    home: str
    ends: tuple[str, str] = ("", "")
    stops: tuple[str, str] = ("", "")
    fault: str = ""


def tree_rows(robot: Robot) -> Iterator[tuple[int, str, str, str, str]]:
    """Yield depth, link, joint, the coordinates that move it (or its type), and its declared limits, depth first."""
    for link, joint, depth in robot.tree.walk():
        moves = ends = ""
        if joint is not None:
            moves = robot.coupling.text(joint.name) if joint.moves else joint.type
            if joint.moves:
                unit = "rad" if robot.turns(joint.name) else "m"
                low, high = (units.amount(end, unit, 3) for end in (joint.lower, joint.upper))
                ends = "no limits" if low == high == "none" else f"{low} to {high}"
        helper = " (helper)" if link.name in robot.tree.helpers else ""
        yield depth, link.name + helper, "" if joint is None else joint.name, moves, ends


def limit_rows(robot: Robot) -> list[LimitRow]:
    """Return how far each coordinate can move from home while the others are fixed."""
    return [_limit_row(robot, name) for name in robot.coordinates]


def _limit_row(robot: Robot, name: str) -> LimitRow:
    unit = "rad" if robot.turns(name) else "m"
    home = units.amount(float(robot.home[robot.coordinates.index(name)]), unit)
    try:
        found: CoordinateLimits = robot.boundaries.limits(name, robot.home)
    except UnsupportedError as error:
        return LimitRow(name, home, fault=str(error))
    if found.blocked_by:
        return LimitRow(name, home, fault=f"home is not free: {', '.join(found.blocked_by)}")
    low, high = (units.amount(float(end), unit) for end in (found.lower, found.upper))
    return LimitRow(name, home, (low, high), (found.lower_stop or "-", found.upper_stop or "-"))


def loop_rows(robot: Robot) -> list[LoopRow]:
    """Return one row for each loop that is not a parallelogram."""
    if not isinstance(robot, LoopRobot):
        return []
    names, found = robot.lift.names, list[LoopRow]()
    for one in robot.lift.linkages:
        at = toggles(one)
        if at is None:
            said = f'limited by "{one.name} toggle"'
        elif at.angles:
            row, angles = at.positive
            where = " and ".join(units.amount(x, "rad") for x in angles)
            said = f"{linear_text(row, names)} = {where}, every turn"
        else:
            said = "never"
        passive, inputs = (tuple(names[index] for index in group) for group in (one.passive, one.inputs))
        found.append(LoopRow(one.name, passive, inputs, one.form.value, said))
    return found


def closure_rows(robot: Robot) -> tuple[list[ClosureRow], str]:
    """Return one row for each pin, and a text about the samples that give the largest gaps.

    A loop that is not a parallelogram can be closed only for some q: samples at which it cannot are left out.
    """
    low, high = (np.clip(ends, -2 * np.pi, 2 * np.pi) for ends in (robot.lower, robot.upper))
    Q: Array = np.random.default_rng(0).uniform(low, high, (_SAMPLES, len(robot.coordinates)))
    said = units.several(_SAMPLES, "sample")
    solved = set[str]()
    if isinstance(robot.boundaries, LoopBoundarySet):
        lift = robot.boundaries.lift
        solved = {one.name for one in lift.linkages}
        kept = Q[np.asarray(robot.boundaries.closed(lift(Q)))]
        said = f"{units.several(len(kept) + 1, 'sample')} of {_SAMPLES:,} and home, where all loops can be closed"
        Q = np.vstack((robot.home, kept))
    largest = robot.closure_residuals(Q).max(axis=0).tolist()
    return [
        ClosureRow(
            one.name,
            (one.mark.link_a, one.mark.link_b),
            "solved in closed form" if one.name in solved else f"{one.bound:.1e}",
            gap,
        )
        for one, gap in zip(robot.closures, largest, strict=True)
    ], said


def solved_joints(robot: Robot, boundary: Boundary) -> str:
    """Return which joints in a boundary's formula are determined by loops: ``"knee = four_bar(crank)"``."""
    found = robot.coupling.solved(formula_joints(boundary)).items()
    return ", ".join(f"{name} = {text}" for name, text in found)
