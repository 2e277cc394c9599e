"""Pairs with the same rotations, which share one tree; sets of them that differ only in names are computed once.

Pairs of points without prismatic joints, whose chains have the same axes and coefficients, form one set: pairs of the
same two links, and of links fixed to these. Two sets are equal if all numbers that their proofs depend on are equal, to
the last bit: the reduced chains over their own coordinates, in the order of their rotations; thresholds; rounding
bounds; and the box of limits.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pinbound.boundaries.boundary import Boundary
from pinbound.freespace.digest import content_digest
from pinbound.freespace.pairs import Pairs
from pinbound.robot.robot import Robot
from pinbound.typing import Array, Indices

__all__ = ["Structure", "structures"]


@dataclass(frozen=True)
class Structure:
    """Pairs with the same rotations.

    Attributes:
        members: The pairs, in an order that does not depend on their names.
        columns: Indices in q of their coordinates, in the order of the rotations of their chains.
        key: Equal for structures that differ only in names.
        is_exact: Whether it is one pair of one effective angle.
    """

    members: tuple[Boundary, ...]
    columns: Indices
    key: str
    is_exact: bool


def structures(
    robot: Robot, chosen: Sequence[Boundary], ends: tuple[Array, Array, Array], each: bool
) -> list[Structure]:
    """Return the structures that together contain every boundary once, in the order of their first boundaries.

    Args:
        robot: The robot.
        chosen: Its boundaries.
        ends: (n,) each: corners of the box of limits, and by how much they may be passed.
        each: Whether every boundary is a structure of its own.
    """
    low, high, beside = ends
    pairs = Pairs(robot, chosen, low - beside, high + beside)
    one, many, swept = pairs.families[:3]
    errors = dict[str, tuple[float, float]]()
    for family in (one, many, swept):
        error: Array = getattr(family, "error")  # noqa: B009 - all three families have one
        more: Array = getattr(family, "angle_error", error)
        errors |= {name: (float(error[i]), float(more[i])) for i, name in enumerate(family.names)}
    points, alike = set(many.names), dict[object, list[Boundary]]()  # points with several angles, or prismatic joints
    for boundary in chosen:
        chain = boundary.path.minimal
        is_turning = boundary.name in points and chain.rotations > 0 and not np.any(chain.slides)
        alike.setdefault(_turning(boundary) if is_turning and not each else object(), []).append(boundary)
    return [_structure(some, ends, errors) for some in alike.values()]


def _turning(boundary: Boundary) -> object:
    chain = boundary.path.minimal
    return chain.axes.tobytes(), chain.coefficients.tobytes()


def _structure(
    some: Sequence[Boundary], ends: tuple[Array, Array, Array], errors: dict[str, tuple[float, float]]
) -> Structure:
    columns = _in_order(some[0])
    own = {one.name: _digest(one, columns, errors[one.name]) for one in some}
    members = tuple(sorted(some, key=lambda one: own[one.name]))
    is_exact = len(some) == 1 and some[0].rule.strips() is not None and len(columns) > 0
    key = content_digest([own[one.name] for one in members], *(part[columns] for part in ends))
    return Structure(members, columns, key, is_exact)


def _in_order(boundary: Boundary) -> Indices:
    """Return the indices in q of a boundary's coordinates, in the order in which its chain uses them."""
    chain = boundary.path.minimal
    found = list[int]()
    for block in range(chain.rotations + 1):
        uses = np.any(chain.slides[block] != 0.0, axis=0)
        if block < chain.rotations:
            uses = uses | (chain.coefficients[block] != 0.0)
        found += [j for j in np.flatnonzero(uses).tolist() if j not in found]
    return np.array(found, dtype=np.intp)


def _digest(boundary: Boundary, columns: Indices, error: tuple[float, float]) -> str:
    """Return a hash of all data on which the proof about a boundary depends, without names."""
    path, rule = boundary.path, boundary.rule
    offsets, slides, axes, coefficients, *others = path.constants
    stop = rule.stop
    numbers = [float(one) for one in (rule.placed_distance, boundary.place_error, *error)]
    if stop is not None:
        numbers += [float(one) for one in (stop.angle, *stop.free_gap, stop.miss, stop.amplitude)]
        numbers += stop.coefficients[columns].tolist()
    bodies = path.difference
    sort = [len(bodies.directions), bodies.is_zonotope, path.first_is_b, *(list(one.shape) for one in bodies.corners)]
    parts = (offsets, slides[:, :, columns], axes, coefficients[:, columns], path.minimal.scale, *others)
    return content_digest(sort, numbers, *parts)
