"""A small ball around points: what bounds of many points at once start from."""

from __future__ import annotations

import math

import numpy as np

from pinbound.typing import Array

__all__ = ["middle_of"]

_SHRINKS = 200
"""Steps towards the centre of the least ball."""


def middle_of(points: Array) -> Array:
    """Return a point (3,) that is nearly the centre of the least ball around points (k, 3)."""
    if len(points) == 1:
        return points[0].copy()
    centre = 0.5 * (points.min(axis=0) + points.max(axis=0))
    best, least = centre, math.inf
    for step in range(_SHRINKS):
        away = np.linalg.norm(points - centre, axis=1)
        far = int(np.argmax(away))
        if away[far] < least:
            best, least = centre, float(away[far])
        centre = centre + (points[far] - centre) / (step + 2.0)
    return best
