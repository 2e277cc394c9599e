"""The bound of how far opposite sides are from parallel, against triangles in closed form at 50 digits."""

import math

import mpmath
import numpy as np
import pytest

from pinbound.loops.planar_loops import deviations

mpmath.mp.dps = 50


def missing(ground: float, crank: float, coupler: float, rocker: float, phi: float) -> tuple[float, float]:
    """Return by how much coupler and rocker are from parallel: the law of cosines on their diagonal."""
    a, b, c, d = (mpmath.mpf(value) for value in (ground, crank, coupler, rocker))
    diagonal = mpmath.sqrt(a * a + b * b + 2 * a * b * mpmath.cos(phi))

    def at_diagonal(one: mpmath.mpf, other: mpmath.mpf) -> mpmath.mpf:
        return mpmath.acos((one * one + diagonal**2 - other * other) / (2 * one * diagonal))

    return float(at_diagonal(c, d) - at_diagonal(a, b)), float(at_diagonal(d, c) - at_diagonal(b, a))


def test_no_four_bar_is_further_from_parallel_than_the_bound() -> None:
    rng, shares = np.random.default_rng(11), []
    for _ in range(300):
        ground, crank = (float(x) for x in rng.uniform(0.02, 0.6, 2))
        mismatch = 10.0 ** rng.uniform(-14, -4)
        e_1, e_2 = (float(x) for x in rng.uniform(-0.5, 0.5, 2) * mismatch)
        coupler, rocker = ground + e_1, crank + e_2
        low, high = rng.uniform(0.02, 0.5), math.pi - rng.uniform(0.02, 0.5)
        total = abs(coupler - ground) + abs(rocker - crank)
        lengths = min(ground, coupler), min(crank, rocker)
        bound = deviations(lengths, total, 0.0, 0.0, (low, high))
        if bound is None:
            continue
        for phi in (low, high, *rng.uniform(low, high, 2)):
            found = missing(ground, crank, coupler, rocker, float(phi))
            assert abs(found[0]) <= bound[0]
            assert abs(found[1]) <= bound[1]
            shares.append(max(abs(found[0]) / bound[0], abs(found[1]) / bound[1]))
    assert len(shares) > 900
    assert max(shares) > 0.95  # the bound is reached, or it would be no more than a guess


@pytest.mark.parametrize("turns", [-3, -1, 0, 2])
def test_flat_poses_repeat_every_half_turn(turns: int) -> None:
    shape = 0.3 + turns * math.pi, 2.5 + turns * math.pi
    assert deviations((0.2, 0.1), 1e-6, 0.0, 0.0, shape) == pytest.approx(
        deviations((0.2, 0.1), 1e-6, 0.0, 0.0, (0.3, 2.5)), rel=1e-9
    )
    assert deviations((0.2, 0.1), 1e-6, 0.0, 0.0, (shape[0], shape[1] + math.pi)) is None


def test_there_is_no_bound_where_the_linkage_may_not_close() -> None:
    """Nearer to flat than about 2 sqrt(m / l) a linkage with a longer coupler has no pose at all."""
    ground, crank, longer = 0.25, 0.1, 1e-6
    for phi in (1e-3, 2e-3, 4e-3, 1e-2):
        diagonal = math.hypot(ground + crank * math.cos(phi), crank * math.sin(phi))
        closes = abs(ground - longer - crank) <= diagonal <= ground - longer + crank  # of a coupler that is shorter
        bound = deviations((ground - longer, crank), longer, 0.0, 0.0, (phi, 1.0))
        assert closes or bound is None
    assert deviations((ground, crank), longer, 0.0, 0.0, (1e-2, 1.0)) is not None


def test_equal_sides_have_no_deviation_even_when_flat() -> None:
    assert deviations((0.2, 0.1), 0.0, 0.0, 0.0, (-9.0, 9.0)) == (0.0, 0.0)


def test_small_sides_that_swing_widen_the_bound() -> None:
    still = deviations((0.2, 0.1), 1e-4, 1e-4, 0.0, (0.5, 2.5))
    swinging = deviations((0.2, 0.1), 1e-4, 1e-4, 1.0, (0.5, 2.5))
    assert still is not None
    assert swinging is not None
    assert swinging[0] > still[0]
