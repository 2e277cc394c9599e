"""Intervals of one effective angle, each proven free, proven in contact, or narrower than rounding.

The ends of contact strips are known in closed form, and divide the range of the angle. No proof depends on them: each
part is halved until the enclosures of `certify_box` prove it, or until it is too narrow for them.
"""

from __future__ import annotations

import math

import numpy as np

from pinbound.boundaries.boundary import Boundary
from pinbound.freespace.pair_sets import AngleSet, Where
from pinbound.freespace.pairs import Pairs
from pinbound.robot.robot import Robot
from pinbound.tolerances import UNIT_ROUNDOFF
from pinbound.typing import Array, Indices

__all__ = ["angle_set"]

_PARTS = 256
"""Intervals that are halved at once; if more are undecided, all of them are within rounding of contact."""
_TURN = 2.0 * math.pi


def angle_set(robot: Robot, boundary: Boundary, columns: Indices, low: Array, high: Array, beside: Array) -> AngleSet:
    """Return the proven sets of a boundary of one effective angle.

    Args:
        robot: The robot.
        boundary: One for which `boundary.rule.strips()` is not None.
        columns: Indices in q of the coordinates that it depends on.
        low: (n,) lower corner of the box of limits.
        high: (n,) upper corner.
        beside: (n,) by how much limits may be passed.
    """
    strips = boundary.rule.strips()
    assert strips is not None
    c = strips[0]
    j = int(np.argmax(np.abs(c)))
    ends = np.where(c > 0.0, low, high) @ c, np.where(c > 0.0, high, low) @ c
    farthest = float(np.abs(c) @ np.maximum(np.abs(low), np.abs(high)))
    room = 8.0 * UNIT_ROUNDOFF * (1.0 + farthest)
    wide = float(np.abs(c) @ beside) + room
    lower, upper = float(ends[0]) - wide, float(ends[1]) + wide
    # An angle is evaluated at q_j = phi / c_j alone, so the rounding bounds must hold over a box with these
    # points, too.
    far = (max(abs(lower), abs(upper)) + 2.0 * room) / abs(float(c[j]))
    around = np.eye(len(c))[j] * far
    pairs = Pairs(robot, [boundary], np.minimum(low - beside, -around), np.maximum(high + beside, around))

    def codes(a: Array, b: Array) -> Array:
        centre, half = np.zeros((2, len(a), len(c)))
        centre[:, j] = 0.5 * (a + b) / c[j]
        half[:, j] = (0.5 * (b - a) + room) / abs(float(c[j]))
        found = pairs.bound(np.zeros(len(a), dtype=np.intp), centre, half)
        return np.where(found.lower > 0.0, Where.FREE, np.where(found.upper < 0.0, Where.CONTACT, Where.UNDECIDED))

    starts, known, work = [np.empty(0)], [np.empty(0)], 0
    edges = np.unique([lower, *(x for x in _edges(boundary, lower, upper) if lower < x < upper), upper])
    a, b = edges[:-1], edges[1:]
    while len(a):
        code, work = codes(a, b), work + len(a)
        middle = 0.5 * (a + b)
        split = (code == Where.UNDECIDED) & (a < middle) & (middle < b) & (b - a > room)
        split &= np.count_nonzero(split) <= _PARTS
        starts.append(a[~split])
        known.append(code[~split])
        a, b = np.concatenate([a[split], middle[split]]), np.concatenate([middle[split], b[split]])
    order = np.argsort(np.concatenate(starts), kind="stable")
    start, code = np.concatenate(starts)[order], np.concatenate(known)[order].astype(np.int8)
    first = np.flatnonzero(np.concatenate([[True], code[1:] != code[:-1]]))
    edges, code = np.append(start[first], upper), code[first]
    within = np.clip(edges, float(ends[0]), float(ends[1]))
    size = np.diff(within)
    free, contact = (float(size[code == one].sum()) for one in (Where.FREE, Where.CONTACT))
    return AngleSet(
        volume=float(ends[1] - ends[0]),
        free=free,
        contact=contact,
        slot_free=np.array([free]),
        slot_contact=np.array([contact]),
        work=work,
        coefficients=c[columns],
        low=low[columns],
        high=high[columns],
        edges=edges,
        codes=code,
    )


def _edges(boundary: Boundary, lower: float, upper: float) -> list[float]:
    """Return the ends of contact strips, in closed form, that may lie in a range of the angle."""
    if boundary.rule.stop is not None:
        return [end for end in boundary.rule.stop.free_gap if math.isfinite(end)]
    found, strips = list[float](), boundary.rule.strips()
    for strip in strips[1] if strips is not None else ():
        if strip.half_width is not None:
            for k in range(math.floor((lower - strip.angle) / _TURN), math.ceil((upper - strip.angle) / _TURN) + 1):
                found += [strip.angle + k * _TURN - strip.half_width, strip.angle + k * _TURN + strip.half_width]
    return found
