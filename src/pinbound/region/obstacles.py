"""The sets that rules with conditions forbid in a slice of two coordinates: convex polygons with straight, named edges.

If the other coordinates are fixed, the end and the conditions of a rule are half-planes. The forbidden set is the
intersection of the conditions, which are closed, and of the half-plane beyond the end. So the region loses convex
pieces. It keeps straight edges and exact corners, and in general it is not convex.
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
    """The set that one end of a rule forbids in the slice: an intersection of half-planes.

    Attributes:
        name: The rule and its end, e.g. ``"front lower"``.
        end: The half-plane in which the rule is kept; None if the end is violated for all values of the two
            coordinates.
        conditions: The conditions of the rule as closed half-planes, named after the rule and the condition.
    """

    name: str
    end: HalfPlane | None
    conditions: tuple[HalfPlane, ...]

    @property
    def sides(self) -> tuple[HalfPlane, ...]:
        """All its sides; the obstacle is the set that all of them allow."""
        beyond = () if self.end is None else (replace(self.end, normal=-self.end.normal, bound=-self.end.bound),)
        return (*beyond, *self.conditions)


def obstacle_of(
    one: GuardedLimit, at: Array, indices: Sequence[int], coordinates: Sequence[str]
) -> Obstacle | tuple[HalfPlane, ...]:
    """Return the set that a guarded end forbids in the slice through `at`; half-planes, if all conditions hold there.

    Args:
        one: The end.
        at: (n,) the values of the other coordinates.
        indices: Indices of the slice's two coordinates.
        coordinates: Names of all coordinates.

    Returns:
        An obstacle; or the half-planes that q must keep, which are none if the end never applies in the slice.
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
    """Return the half-plane of a limit with one finite end, in the slice through `at`."""
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
        UnsupportedError: If it is thinner than the smallest distance between vertices: a motion crosses it, and no
            region could show it.
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
