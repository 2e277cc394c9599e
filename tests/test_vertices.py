"""Tables of corners: which is least along a direction, and what the others may cost, against all pairs one by one."""

import numpy as np

from pinbound.bounds.vertices import Corners, corners_of

SEGMENT = np.array([[0.0], [1.0]])
SQUARE = np.array([[0.0, 0.0], [0.0, 1.0], [1.0, 0.0], [1.0, 1.0]])
POINT = np.zeros((1, 0))


def some(rng: np.random.Generator) -> tuple[list[tuple[np.ndarray, np.ndarray]], Corners]:
    hulls = [rng.normal(size=(k, 3)) for k in (4, 9, 700)]
    pairs = [
        (hulls[0], hulls[1]),
        (POINT, hulls[1]),
        (SEGMENT, POINT),
        (POINT, SEGMENT),
        (SQUARE, hulls[2]),
        (POINT, POINT),
    ]
    return pairs, corners_of(pairs, 6, [True] * len(pairs))


def test_the_least_corner_is_that_of_all_pairs_one_by_one() -> None:
    rng = np.random.default_rng(0)
    pairs, corners = some(rng)
    which, along = rng.integers(0, len(pairs), 300), rng.normal(size=(300, 6))
    value, t = corners.least(which, along)
    for row, pair in enumerate(which.tolist()):
        a, b = pairs[pair]
        split = a.shape[1], a.shape[1] + b.shape[1]
        heights = (a @ along[row, : split[0]])[:, None] + (b @ along[row, split[0] : split[1]])[None]
        assert value[row] == np.float64(heights.min()) or abs(value[row] - heights.min()) < 1e-12
        assert abs(t[row] @ along[row] - value[row]) < 1e-12
        assert not np.any(t[row, split[1] :])


def test_equal_bodies_stand_in_the_table_once() -> None:
    rng = np.random.default_rng(1)
    hull = rng.normal(size=(8, 3))
    pairs = [(hull, POINT), (hull, SEGMENT), (hull, hull)]
    corners = corners_of(pairs, 6, [True] * 3)
    assert len(corners.sides) == 3  # the hull as first body, the segment and the hull as second ones
    assert np.array_equal(corners.table[: len(hull)], hull)


def test_what_other_corners_cost_is_never_less_than_what_they_do() -> None:
    """Ways that move by `tau` rates: no corner comes further below than the slack says, the least one in the middle."""
    rng = np.random.default_rng(2)
    pairs, corners = some(rng)
    lowered = 0
    for _ in range(200):
        pair = int(rng.integers(len(pairs)))
        a, b = pairs[pair]
        m = a.shape[1] + b.shape[1]
        along, rate = np.zeros((1, 6)), np.zeros((1, 6))
        along[0, :m], rate[0, :m] = rng.normal(size=m), 0.8 * rng.normal(size=m)
        which = np.array([pair])
        least, star = corners.least(which, along)
        slack = corners.slack(which, along, [rate], star)
        assert slack[0] <= 0.0
        for tau in (-1.0, -0.3, 1.0):
            moved = along + tau * rate
            corner = least[0] + float((star @ (moved - along).T)[0, 0])
            lower = corners.least(which, moved)[0][0] - corner
            assert slack[0] <= lower + 1e-12
            lowered += lower < -1e-9
    assert lowered > 100


def test_a_corner_that_stays_above_costs_nothing() -> None:
    body = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    corners = corners_of([(body, POINT)], 3, [True])
    which, along = np.array([0]), np.array([[1.0, 1.0, 1.0]])
    star = np.zeros((1, 3))
    assert corners.slack(which, along, [np.array([[-0.9, 0.0, 0.0]])], star)[0] == 0.0
    assert corners.slack(which, along, [np.array([[-1.25, 0.0, 0.0]])], star)[0] < -0.2499
