"""Rotations: about a unit axis by Rodrigues' formula, and by roll, pitch and yaw as URDF writes them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TypeAlias

import numpy as np

from pinbound.typing import Array

__all__ = ["matrix_rpy", "rotate", "rotation_matrices", "rotation_matrix", "rpy_matrix"]

Components: TypeAlias = tuple[Array, Array, Array]


def rotation_matrix(axis: Array, angle: float) -> Array:
    """Return the rotation `I + sin [u]x + (1 - cos) [u]x [u]x` (3, 3) about a unit axis; the identity for angle 0.

    Example:
        >>> rotation_matrix(np.array([0.0, 1.0, 0.0]), np.pi / 2).round(12) @ [0.0, 0.0, 1.0]
        array([1., 0., 0.])
    """
    cross = _cross_matrix(axis)
    return np.eye(3) + np.sin(angle) * cross + 2.0 * np.sin(angle / 2) ** 2 * (cross @ cross)


def rotation_matrices(axis: Array, angles: Array) -> Array:
    """Return `rotation_matrix(axis, angle)` of each of N angles, (N, 3, 3).

    Example:
        >>> rotation_matrices(np.array([0.0, 0.0, 1.0]), np.array([0.0, np.pi / 2])).round(12)[:, 0].tolist()
        [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]
    """
    cross, angles = _cross_matrix(axis), angles[:, None, None]
    return np.eye(3) + np.sin(angles) * cross + 2.0 * np.sin(angles / 2) ** 2 * (cross @ cross)


def _cross_matrix(axis: Array) -> Array:
    """Return `[u]x`."""
    x, y, z = axis
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def rotate(axis: Array, cos: Array, sin: Array, x: Components | Array) -> Components:
    """Return the components of `R(u, phi) x = along + cos (x - along) + sin u x x`, along being `u (u . x)`.

    Args:
        axis: The components of unit axes u, numbers or arrays.
        cos: Cosines of the angles phi; all arrays broadcast.
        sin: Their sines.
        x: The components of the vector that is rotated.

    Example:
        >>> [float(part) for part in rotate(np.array([0.0, 0.0, 1.0]), np.array(0.0), np.array(1.0), (1.0, 2.0, 3.0))]
        [-2.0, 1.0, 3.0]
    """
    (u, v, w), (a, b, c) = axis, x
    height = u * a + v * b + w * c
    along = u * height, v * height, w * height
    return (
        along[0] + (a - along[0]) * cos + (v * c - w * b) * sin,
        along[1] + (b - along[1]) * cos + (w * a - u * c) * sin,
        along[2] + (c - along[2]) * cos + (u * b - v * a) * sin,
    )


def rpy_matrix(rpy: Sequence[float]) -> Array:
    """Return `R_z(yaw) R_y(pitch) R_x(roll)` (3, 3), the convention of URDF.

    Example:
        >>> rpy_matrix((0.0, 0.0, math.pi / 2)).round(12) @ [1.0, 0.0, 0.0]
        array([0., 1., 0.])
    """
    (sr, sp, sy), (cr, cp, cy) = map(math.sin, rpy), map(math.cos, rpy)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def matrix_rpy(R: Array) -> tuple[float, float, float]:
    """Return roll, pitch and yaw [rad] of a rotation (3, 3); pitch is within a quarter turn.

    Yaw is read off the first column, then turned back: `R_z(-yaw) R = R_y R_x` gives the other two. So the angles give
    R again to rounding also near a pitch of a quarter turn, where roll and yaw by themselves are hardly known.

    Example:
        >>> np.round(matrix_rpy(rpy_matrix((0.1, 0.2, 0.3))), 12).tolist()
        [0.1, 0.2, 0.3]
    """
    yaw = math.atan2(R[1, 0], R[0, 0])
    s, c = math.sin(yaw), math.cos(yaw)
    pitch = math.atan2(-R[2, 0], c * R[0, 0] + s * R[1, 0])
    return math.atan2(s * R[0, 2] - c * R[1, 2], c * R[1, 1] - s * R[0, 1]), pitch, yaw
