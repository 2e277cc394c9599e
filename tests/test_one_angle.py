"""Boundaries of one angle: what is proven of them over a range of the angle."""

import dataclasses

import numpy as np

from pinbound.bounds.bounds import OneAngle
from pinbound.certificates.one_angle import OneAngleBoundaries
from pinbound.values import owned


def family(m: int, rng: np.random.Generator, stops: int) -> OneAngleBoundaries:
    """Return m boundaries of one angle, the last few of them stops."""
    arms = rng.uniform(0.1, 1.0, (m, 2))
    is_stop = np.arange(m) >= m - stops
    axial = np.where(is_stop, 0.0, rng.uniform(0.0, 0.2, m))
    smallest = np.hypot(axial, np.where(is_stop, 0.0, arms[:, 0] - arms[:, 1]))
    chains = OneAngle(
        rng.normal(size=(m, 3)), rng.uniform(-3, 3, m), smallest, 4.0 * arms.prod(axis=1), arms.min(axis=1)
    )
    gap = np.where(is_stop[:, None], chains.angle[:, None] + [-2.0 * np.pi, 0.0], [-np.inf, np.inf])
    amplitude = np.where(is_stop, 2.0 * np.sqrt(arms.prod(axis=1)), 1.0)
    threshold, error = np.where(is_stop, 0.0, rng.uniform(0.0, 0.6, m)), np.full(m, 1e-13)
    names = tuple(f"b{i}" for i in range(m))
    return OneAngleBoundaries(names, chains, threshold, is_stop, gap, amplitude, error, np.full(m, 1e-13))


def first(known: OneAngleBoundaries, count: int) -> OneAngleBoundaries:
    """Return the first few boundaries alone."""
    chains = known.chains
    parts = {f.name: getattr(chains, f.name)[:count] for f in dataclasses.fields(chains)}
    rest = {f.name: getattr(known, f.name)[:count] for f in dataclasses.fields(known) if f.name != "chains"}
    return OneAngleBoundaries(chains=OneAngle(**parts), **rest)


def test_boundaries_without_stops_are_judged_as_beside_a_stop() -> None:
    rng = np.random.default_rng(0)
    both = family(40, rng, 3)
    alone = first(both, 37)
    assert not alone.is_stop.any()
    which = np.tile(np.arange(37), 50)
    middle, half = rng.uniform(-9.0, 9.0, len(which)), rng.exponential(1.0, len(which))
    wanted = both.judge(which, middle, middle - half, middle + half)
    found = alone.judge(which, middle, middle - half, middle + half)
    for name in ("value", "lower", "error", "clear", "violated", "settled"):
        assert np.array_equal(getattr(found, name), getattr(wanted, name)), name
    assert 0.1 < found.clear.mean() < 0.9
    assert found.violated.any()


def test_the_least_norm_over_a_range_is_below_all_in_it_and_reached() -> None:
    rng = np.random.default_rng(1)
    chains = family(30, rng, 0).chains
    which = np.repeat(np.arange(30), 20)
    lower = rng.uniform(-9.0, 9.0, len(which))
    upper = lower + rng.exponential(2.0, len(which))
    least, most = chains.extremes(which, lower, upper)
    shares = np.linspace(0.0, 1.0, 2001)
    seen = np.array([chains.norm(which, lower + share * (upper - lower)) for share in shares])
    assert np.array_equal(least, chains.least(which, lower, upper))
    assert np.all(least <= seen.min(axis=0) + 1e-12)
    assert np.all(seen.min(axis=0) - least < 1e-2)
    assert np.all(most >= seen.max(axis=0) - 1e-12)
    assert np.all(most - seen.max(axis=0) < 1e-2)


def test_an_owned_array_is_kept_as_it_is() -> None:
    array = np.zeros(3)
    assert owned(array) is array
    assert not array.flags.writeable
