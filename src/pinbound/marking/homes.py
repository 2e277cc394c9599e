"""The home of a proposal, and a note about the robot's present home: it is never replaced without a note."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pinbound.marking.candidates import can_be_home, configuration_text, within_limits
from pinbound.marking.judge import Judge, listed
from pinbound.marking.narrow import Pair
from pinbound.typing import Ints
from pinbound.units import several

__all__ = ["Home", "choose_home", "home_note"]


@dataclass(frozen=True)
class Home:
    """The candidate that is home, the best candidate, numbers of touching pairs, and whether home can be written."""

    chosen: int
    best: int
    touching: Ints
    can_be_said: bool


def choose_home(judge: Judge, touching: Ints) -> Home:
    """Choose the present home if the user gave it or if no candidate is better; `touching` (N,) counts pairs."""
    robot = judge.robot
    inside = bool(within_limits(robot.linear_limits, robot.home[None], robot.guarded_limits)[0])
    best: int | None = None
    for index in np.argsort(touching, kind="stable").tolist():
        if inside and touching[index] >= touching[0]:
            best = 0
            break
        if index and can_be_home(robot, judge.Q[index]):
            best = index
            break
    chosen = 0 if best is None or robot.annotations.home else best
    can_be_said = chosen != 0 or (inside and can_be_home(robot, robot.home))
    return Home(chosen, chosen if best is None else best, touching, can_be_said)


def home_note(judge: Judge, home: Home, at_home: Sequence[tuple[Pair, float]]) -> str:
    """Return what is wrong with the robot's home, and which home is proposed and why; empty if nothing is wrong.

    Args:
        judge: The configurations; the first is the robot's home.
        home: The chosen home.
        at_home: The pairs that touch at the robot's home, but not everywhere, and their signed distances [m].
    """
    robot = judge.robot
    inside = within_limits(robot.linear_limits, robot.home[None], robot.guarded_limits)[0]
    said = f"home ({configuration_text(robot, robot.home)})"
    faults = [] if inside else ["is outside the limits of a joint"]
    if at_home:
        deepest = sorted(at_home, key=lambda one: one[1])
        pairs = listed([f"{pair.a.name} and {pair.b.name} {_overlap(gap)}" for pair, gap in deepest])
        faults.append(f"has {_pairs(len(at_home))} of marks in contact: {pairs}")
    if not faults:
        return ""
    given = "given" if robot.annotations.home else "the URDF's zero within its limits, as no home is given"
    note = f"The robot's {said}, {given}, {' and '.join(faults)}."
    there = f"{configuration_text(robot, judge.Q[home.best])}, with {_pairs(int(home.touching[home.best]))} in contact"
    tried = f"the fewest of the {len(judge.Q)} configurations that were tried and that could be home"
    why = f"{tried}{_moved(judge, home.best)}"
    if home.chosen:
        return f"{note} The proposal replaces it by {there}: {why}."
    if home.best:
        return f"{note} The home that was given is kept, and these pairs are left out. Another home is {there}: {why}."
    return f"{note} No better home was found among {len(judge.Q)} configurations; these pairs are left out."


def _moved(judge: Judge, best: int) -> str:
    """Return the coordinate that differs from the present home, if it is only one."""
    robot, q = judge.robot, judge.Q[best]
    moved = [name for name, now, then in zip(robot.coordinates, robot.home, q, strict=True) if now != then]
    return f"; it moves {moved[0]} alone" if len(moved) == 1 < len(q) else ""


def _pairs(count: int) -> str:
    return several(count, "pair") if count else "no pair"


def _overlap(gap: float) -> str:
    """Return by how much two marks overlap, as text; between 0 and the contact tolerance they touch."""
    return f"overlap by {-1e3 * gap:.4g} mm" if gap < 0.0 else "touch"
