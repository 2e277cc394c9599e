"""What rules with conditions forbid in a plane of two coordinates: convex polygons with straight, named edges.

A rule's end and its conditions are half-planes once the other coordinates are held. What it forbids is the
intersection of the conditions, which are closed, and of what lies beyond the end. So the region loses convex pieces: it
keeps straight edges and exact corners, and is not convex in general.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pinbound.exceptions import UnsupportedError
from pinbound.model.coupling import GuardedLimit, LinearLimit
from pinbound.region.halfplanes import HalfPlane, intersect
from pinbound.robot.rules import condition_text
from pinbound.tolerances import VERTEX
from pinbound.typing import Array
from pinbound.values import Value

__all__ = ["Obstacle", "obstacle_of", "obstacle_sides"]

_PLANE = 2


@dataclass(frozen=True, eq=False)
class Obstacle(Value):
    """What one end of a rule forbids in the plane: the intersection of half-planes.

    Attributes:
        name: The rule and its end, e.g. ``"front lower"``.
        end: The half-plane that would keep the rule; None where the end is broken whatever the two coordinates are.
        conditions: Where it is asked for, closed half-planes, named after the rule and the condition.
    """

    name: str
    end: HalfPlane | None
    conditions: tuple[HalfPlane, ...]

    @property
    def sides(self) -> tuple[HalfPlane, ...]:
        """All its sides; it lies where each of them allows it."""
        beyond = () if self.end is None else (replace(self.end, normal=-self.end.normal, bound=-self.end.bound),)
        return (*beyond, *self.conditions)


def obstacle_of(
    one: GuardedLimit, at: Array, indices: Sequence[int], coordinates: Sequence[str]
) -> Obstacle | tuple[HalfPlane, ...]:
    """Return what a guarded end forbids in the plane through `at`; half-planes to keep if every condition holds there.

    Args:
        one: The end.
        at: (n,) the values of the other coordinates.
        indices: Of the plane's two coordinates.
        coordinates: Names of all coordinates.

    Returns:
        An obstacle; or the half-planes that q must keep, none if the end binds nowhere in the plane.
    """
    sides: list[HalfPlane] = []
    for condition in one.where:
        if not np.any(condition.coefficients[list(indices)]):
            if not condition.holds(at[None])[0]:
                return ()
            continue
        for lower, upper in ((-math.inf, condition.upper), (condition.lower, math.inf)):
            if math.isfinite(lower) or math.isfinite(upper):
                half = replace(condition, lower=lower, upper=upper)
                sides.append(_half(half, at, indices, f"{one.rule} where {condition_text(half, coordinates)}"))
    if not np.any(one.limit.coefficients[list(indices)]):
        return () if one.limit.holds(at[None])[0] else Obstacle(one.name, None, tuple(sides))
    keep = _half(one.limit, at, indices, one.name)
    if not sides:
        return (keep,)
    return Obstacle(one.name, keep, tuple(sides))


def _half(limit: LinearLimit, at: Array, indices: Sequence[int], name: str) -> HalfPlane:
    """Return the half-plane of a limit with one finite end, in the plane through `at`."""
    normal = limit.coefficients[list(indices)]
    rest = limit.offset + float(limit.coefficients @ at) - float(normal @ at[list(indices)])
    if math.isfinite(limit.upper):
        return HalfPlane(limit.joint, name, normal.copy(), limit.upper - rest, False)
    return HalfPlane(limit.joint, name, -normal, rest - limit.lower, False)


def obstacle_sides(obstacle: Obstacle, wide: Array, scales: Array) -> list[tuple[HalfPlane, Array]]:
    """Return the sides of an obstacle within a wide window, each with its two ends (2, 2), in units of `scales`.

    Args:
        obstacle: The obstacle.
        wide: (2, 2) lower and upper corner.
        scales: (2,) units of the two coordinates.

    Raises:
        UnsupportedError: If it is thinner than a vertex can be told from another: a motion crosses it, and no region
            could show it.
    """
    box = [
        HalfPlane("", "", side * np.eye(_PLANE)[axis], side * float(wide[(1 if side > 0.0 else 0), axis]), False)
        for side, axis in ((1.0, 0), (1.0, 1), (-1.0, 0), (-1.0, 1))
    ]
    sides = [replace(side, normal=side.normal * scales) for side in obstacle.sides]
    vertices, edges = intersect([*box, *sides])
    if not len(vertices):
        grown = [side.inset(-1e3 * VERTEX) for side in sides]
        if len(intersect([*box, *grown])[0]):
            raise UnsupportedError(
                f"the set that the rule {obstacle.name!r} forbids in the slice has no width; widen its "
                "conditions, or give a window beside it"
            )
        return []
    ends = np.roll(vertices, -1, axis=0)
    return [(e, np.stack((a, b))) for e, a, b in zip(edges, vertices, ends, strict=True) if e.name]
