"""Rules of robot makers, as `pinbound info` prints them."""

from __future__ import annotations

import math

from pinbound.model.coupling import LinearLimit
from pinbound.robot.robot import Robot
from pinbound.robot.rules import condition_text

__all__ = ["opened", "rule_rows"]


def rule_rows(robot: Robot, for_people: bool = False) -> list[tuple[str, str, str]]:
    """Return every rule in terms of q: its name, its inequality, and the conditions where it applies.

    For people, a rule with angles only is in degrees. Otherwise numbers are in radians and metres. With loops that are
    not parallelograms, a rule is in terms of q and the passive joints.
    """
    robot = opened(robot)

    def said(limit: LinearLimit) -> str:
        used = [name for name, c in zip(robot.coordinates, limit.coefficients, strict=True) if c]
        if not for_people:
            return condition_text(limit, robot.coordinates)
        if all(map(robot.turns, used)):
            return condition_text(limit, robot.coordinates, math.degrees(1.0), " deg")
        return f"{condition_text(limit, robot.coordinates)} (rad, m)"

    names = {rule.name for rule in robot.annotations.rules}
    plain = [limit for limit in robot.linear_limits if limit.joint in names]
    rows = [(limit.joint, said(limit), "everywhere") for limit in plain]
    for one in robot.guarded_limits:
        rows.append((one.rule, said(one.limit), " and ".join(map(said, one.where))))
    return rows


def opened(robot: Robot) -> Robot:
    """Return the robot whose loops that are not parallelograms are open; the robot itself, if it has no such loop."""
    found: Robot = getattr(robot, "opened", robot)
    return found
