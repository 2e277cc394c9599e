"""Contact strips in closed form, at degenerate places: equal and unequal arms, grazing thresholds, no arm."""

import numpy as np
import pytest

from pinbound.limits.univariate import AllowedArcs, strip

Y = np.array([0.0, 1.0, 0.0])


def rotated(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return a random rotation and the axis that it makes of y."""
    turn = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    return turn, turn @ Y


@pytest.mark.parametrize("seed", range(50))
def test_equal_arms_touch_even_without_a_tolerance(seed: int) -> None:
    """Rounding must not make equal arms unequal: that would be a wrong "safe"."""
    turn, axis = rotated(seed)
    angle = np.random.default_rng(seed).uniform(-3, 3)
    p = turn @ [0.3, 0.0, 0.1]
    s = turn @ [np.hypot(0.3, 0.1) * np.cos(angle), 0.0, np.hypot(0.3, 0.1) * np.sin(angle)]
    found = strip(p, s, axis, 0.0, 0.0)
    assert found.half_width is not None


@pytest.mark.parametrize("seed", range(20))
def test_a_strip_is_where_the_norm_is_at_most_the_threshold(seed: int) -> None:
    rng = np.random.default_rng(seed)
    turn, axis = rotated(seed)
    p, s = turn @ rng.normal(size=3), turn @ rng.normal(size=3)
    phi = np.linspace(-np.pi, np.pi, 20_001)
    along = axis * (axis @ s)
    r = p + along + np.outer(np.cos(phi), s - along) + np.outer(np.sin(phi), np.cross(axis, s))
    norms = np.linalg.norm(r, axis=1)
    for threshold in (0.5 * norms.min(), 0.5 * (norms.min() + norms.max()), 1.1 * norms.max()):
        found = strip(p, s, axis, threshold, 0.0)
        expected = norms <= threshold
        if found.half_width is None:
            assert not expected.any()
            continue
        off = np.abs((phi - found.angle + np.pi) % (2 * np.pi) - np.pi)
        sure = np.abs(off - found.half_width) > 1e-9
        assert np.array_equal(expected[sure], (off <= found.half_width)[sure])
        assert found.smallest == pytest.approx(norms.min(), abs=1e-6)


def test_a_threshold_that_just_grazes() -> None:
    p, s = np.array([0.2, 0.0, 0.0]), np.array([0.1, 0.0, 0.0])
    assert strip(p, s, Y, 0.1 - 1e-6, 0.0).half_width is None
    grazing = strip(p, s, Y, 0.1, 0.0)
    assert grazing.half_width == pytest.approx(0.0, abs=1e-7)
    wide = strip(p, s, Y, 0.1 + 1e-12, 0.0).half_width
    assert wide is not None
    assert 2 * 0.02 * (1 - np.cos(wide)) == pytest.approx(2 * 0.1 * 1e-12, rel=1e-3)


def test_the_tolerance_never_makes_a_threshold_less_strict() -> None:
    p, s = np.array([0.2, 0.0, 0.0]), np.array([0.2 + 1.5e-5, 0.0, 0.0])
    zero = strip(p, s, Y, 0.0, 2e-5)
    small = strip(p, s, Y, 1e-5, 2e-5)
    assert zero.half_width == small.half_width == 0.0


def test_arcs_of_a_sliding_coordinate_do_not_repeat() -> None:
    arcs = AllowedArcs("x", np.array([[-np.inf, 0.1], [0.4, np.inf]]), np.inf)
    assert arcs.around(0.0) == (-np.inf, 0.1)
    assert arcs.around(0.2) is None
    assert arcs.around(1.0) == (0.4, np.inf)
    assert arcs.around(np.nan) is None
