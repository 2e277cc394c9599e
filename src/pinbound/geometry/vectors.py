"""Products of vectors along the last axis: written out, several times faster than `np.cross` and `np.einsum`."""

from __future__ import annotations

import numpy as np

from pinbound.typing import Array

__all__ = ["cross", "dot"]


def dot(a: Array, b: Array) -> Array:
    """Return `a . b` (...,) of vectors (..., 3)."""
    return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]


def cross(a: Array, b: Array) -> Array:
    """Return `a x b` (..., 3) of vectors (..., 3).

    Example:
        >>> cross(np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])).tolist()
        [0.0, 0.0, 1.0]
    """
    x, y, z, u, v, w = a[..., 0], a[..., 1], a[..., 2], b[..., 0], b[..., 1], b[..., 2]
    return np.stack((y * w - z * v, z * u - x * w, x * v - y * u), axis=-1)
