"""Sweeps: walk from home towards a configuration so carefully that no contact of two links' bodies is stepped over.

Two bodies cannot come nearer to each other than at the speed v of their points, at most `sum_j rho |dtheta_j/dt|` over
the joints between them, if no point of either is further than rho from one of these joints. From a distance d, a step
of d / v in t is free.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pinbound.coverage.bodies import Body
from pinbound.crosscheck.engine import Engine
from pinbound.robot.robot import Robot
from pinbound.tolerances import CROSSCHECK_STOP
from pinbound.typing import Array

__all__ = ["approach_speed", "sweep"]

_FLOOR = CROSSCHECK_STOP / 2  # metres: the least step, so that near misses are passed; no deeper contact is skipped
_MOST_STEPS = 5000


def sweep(
    robot: Robot, engine: Engine, bodies: Sequence[Body], links: tuple[str, str], ends: Array, until: Array
) -> tuple[Array, Array, int]:
    """Return the configurations (k, n) at which bodies were in contact on the ways, and the depths (k,) [m].

    Args:
        robot: The robot.
        engine: The pairs of bodies of the two links.
        bodies: These bodies.
        links: The two links.
        ends: (N, n), where the straight ways from home lead.
        until: (N,), the share of each way that is walked.

    Returns:
        Configurations, depths, and how many ways were given up before their end: very close all the way.
    """
    ways = ends - robot.home
    speed = np.maximum(approach_speed(robot, bodies, links, ways), 1e-12)
    t, active = np.zeros(len(ways)), np.flatnonzero(until > 0.0)
    places, depths = [np.empty((0, ends.shape[1]))], [np.empty(0)]
    for _ in range(_MOST_STEPS):
        if not len(active):
            break
        Q = robot.home + t[active, None] * ways[active]
        distance = np.min(engine.distances(Q), axis=1)
        places.append(Q[distance <= 0.0])
        depths.append(-distance[distance <= 0.0])
        t[active] += np.maximum(np.abs(distance), _FLOOR) / speed[active]
        active = active[t[active] < until[active]]
    return np.concatenate(places), np.concatenate(depths), len(active)


def approach_speed(robot: Robot, bodies: Sequence[Body], links: tuple[str, str], ways: Array) -> Array:
    """Return a bound (N,) of the relative speed of two links' bodies [m per unit of t] along straight ways."""
    joints = robot.tree.path_between(*links)
    reach = max(float(np.linalg.norm(body.translation)) + _radius(body) for body in bodies)
    rho = 2.0 * reach + sum(float(np.linalg.norm(joint.translation)) for joint in joints)
    turning, sliding = np.zeros(len(ways)), np.zeros(len(ways))
    for joint in joints:
        if joint.moves:
            coefficients, offset = robot.coupling.row(joint.name)
            rate = np.abs(ways @ coefficients)
            if joint.type == "prismatic":
                sliding += rate
                rho += abs(float(coefficients @ robot.home) + offset) + float(np.max(rate, initial=0.0))
            else:
                turning += rate
    return rho * turning + sliding


def _radius(body: Body) -> float:
    """Return the radius of a sphere about the body's centre that holds it."""
    if body.shape == "box":
        return float(np.linalg.norm(body.size)) / 2
    return body.size[0] + (body.size[1] / 2 if len(body.size) > 1 else 0.0)
