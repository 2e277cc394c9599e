"""Directions all around: corners of a polytope that is nearly a ball."""

from __future__ import annotations

import math
from functools import cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pinbound.values import read_only

__all__ = ["BALL", "ball_corners"]

BALL: Final = 1.02
"""The hull of the corners, enlarged by this factor, holds the unit ball. So the angle between any direction and the
nearest corner has a cosine of 1 / 1.02 or more: it is at most 11.4 degrees."""


@cache
def ball_corners() -> NDArray[np.float64]:
    """Return 162 unit vectors: an icosahedron with its edges halved twice."""
    g = 0.5 * (1.0 + math.sqrt(5.0))
    corners = [(0.0, s, t * g) for s in (-1.0, 1.0) for t in (-1.0, 1.0)]
    points = np.array([turned for x, y, z in corners for turned in ((x, y, z), (y, z, x), (z, x, y))])
    for shortest in (2.0, 1.0):
        gaps = np.linalg.norm(points[:, None] - points, axis=2)
        near = np.argwhere(np.triu((gaps > 0.0) & (gaps < 1.3 * np.min(gaps + np.eye(len(gaps)) * 9.0))))
        points = np.vstack((points, 0.5 * (points[near[:, 0]] + points[near[:, 1]])))
        points = points / np.linalg.norm(points, axis=1, keepdims=True) * (1.0 if shortest < 2.0 else g)
    return read_only(points / np.linalg.norm(points, axis=1, keepdims=True))
