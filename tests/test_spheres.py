"""A small ball around points is nearly the least one, by plain numbers as by arrays."""

import numpy as np
import pytest

from pinbound.kernel import spheres
from pinbound.kernel.spheres import middle_of


def radius(points: np.ndarray) -> float:
    return float(np.linalg.norm(points - middle_of(points), axis=1).max())


def test_the_ball_is_nearly_the_least_one() -> None:
    cube = np.array(np.meshgrid([0.0, 1.0], [0.0, 1.0], [0.0, 1.0])).reshape(3, -1).T
    triangle = np.array([[1.0, 0.0, 0.0], [-0.5, 0.75**0.5, 0.0], [-0.5, -(0.75**0.5), 0.0]])
    assert radius(cube) == pytest.approx(0.75**0.5, rel=1e-12)
    assert radius(np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]])) == pytest.approx(1.0, rel=1e-12)
    assert 1.0 <= radius(triangle + np.array([3.0, 0.0, 1.0])) <= 1.02
    assert radius(np.array([[1.0, 2.0, 3.0]])) == 0.0


@pytest.mark.parametrize("count", [2, 3, 7, 40])
def test_plain_numbers_and_arrays_find_the_same_ball(count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    points = np.random.default_rng(count).normal(size=(count, 3))
    by_hand = radius(points)
    monkeypatch.setattr(spheres, "_FEW", 0)
    assert by_hand == pytest.approx(radius(points), rel=1e-3)
