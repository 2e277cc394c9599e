"""Roll, pitch and yaw of a rotation give that rotation again, however near pitch is to a quarter turn."""

import math

import numpy as np
import pytest

from pinbound.geometry.rotations import matrix_rpy, rotation_matrix, rpy_matrix


@pytest.mark.parametrize("off", [1.0, 1e-3, 1e-5, 1e-8, 1e-11, 1e-13, 1e-16, 0.0])
def test_the_angles_of_a_rotation_give_it_again(off: float) -> None:
    rng = np.random.default_rng(0)
    for _ in range(200):
        pitch = float(rng.choice([-1.0, 1.0])) * (0.5 * math.pi - off * rng.uniform(0.0, 1.0))
        R = rpy_matrix((float(rng.uniform(-3, 3)), pitch, float(rng.uniform(-3, 3))))
        assert np.abs(rpy_matrix(matrix_rpy(R)) - R).max() < 1e-15


def test_any_product_of_rotations_is_given_again() -> None:
    rng = np.random.default_rng(1)
    for _ in range(500):
        axes = rng.normal(size=(3, 3))
        R = np.eye(3)
        for axis in axes / np.linalg.norm(axes, axis=1)[:, None]:
            R = R @ rotation_matrix(axis, float(rng.uniform(-4, 4)))
        assert np.abs(rpy_matrix(matrix_rpy(R)) - R).max() < 2e-15
