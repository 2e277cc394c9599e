"""A small ball around points, for bounds of many points at once."""

from __future__ import annotations

import math

import numpy as np

from pinbound.typing import Array

__all__ = ["middle_of"]

_SHRINKS = 200
"""Steps towards the centre of the least ball."""

_FEW = 48
"""Largest number of points for which plain numbers are faster than arrays."""


def middle_of(points: Array) -> Array:
    """Return a point (3,) that is nearly the centre of the least ball around points (k, 3)."""
    if len(points) == 1:
        return points[0].copy()
    centre = 0.5 * (points.min(axis=0) + points.max(axis=0))
    if len(points) <= _FEW:
        return np.array(_by_hand(points.tolist(), *centre.tolist()))
    best, least = centre, math.inf
    for step in range(_SHRINKS):
        away = np.linalg.norm(points - centre, axis=1)
        far = int(np.argmax(away))
        if away[far] < least:
            best, least = centre, float(away[far])
        centre = centre + (points[far] - centre) / (step + 2.0)
    return best


def _by_hand(points: list[list[float]], x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return the result of `middle_of`, from the centre (x, y, z) on."""
    best, least = (x, y, z), math.inf
    for step in range(_SHRINKS):
        most, ahead = -1.0, (0.0, 0.0, 0.0)
        for a, b, c in points:
            u, v, w = a - x, b - y, c - z
            square = u * u + v * v + w * w
            if square > most:
                most, ahead = square, (u, v, w)
        if most < least:
            best, least = (x, y, z), most
        share = step + 2.0
        x, y, z = x + ahead[0] / share, y + ahead[1] / share, z + ahead[2] / share
    return best
