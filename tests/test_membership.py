"""Membership: Eq. (21) against its own text, and the signed distance against brute force."""

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

import pinbound as pb
from pinbound.region.membership import Place, axis_membership, classify, projections, region_membership


def printed_piecewise(x: float, low: float, high: float) -> float:
    """Eq. (21), line by line."""
    if x < low:
        return x - low
    if x <= high:
        return min(x - low, high - x)
    return x - high


numbers = st.floats(-10, 10)


@given(numbers, numbers, numbers)
def test_printed_formula_line_by_line(x: float, a: float, b: float) -> None:
    low, high = min(a, b), max(a, b)
    assert axis_membership(x, low, high, printed=True) == printed_piecewise(x, low, high)


@given(numbers, numbers, numbers)
def test_sign_and_size_are_what_the_papers_text_promises(x: float, a: float, b: float) -> None:
    """Positive strictly inside, zero on an end, negative outside, its size the distance to the nearest end."""
    low, high = min(a, b), max(a, b)
    mu = float(axis_membership(x, low, high))
    assert abs(mu) == pytest.approx(min(abs(x - low), abs(x - high)), abs=1e-12)
    assert (mu > 0) == (low < x < high)
    assert (mu < 0) == (x < low or x > high)


def test_as_printed_a_joint_beyond_its_upper_end_counts_as_inside() -> None:
    assert axis_membership(1.5, 0.0, 1.0, printed=True) > 0
    assert axis_membership(1.5, 0.0, 1.0) < 0


def test_nan_and_infinite_ends() -> None:
    assert np.isnan(axis_membership(np.nan, 0.0, 1.0))
    assert axis_membership(3.0, -np.inf, np.inf) == np.inf
    with pytest.raises(pb.DimensionError, match="not an interval"):
        axis_membership(0.0, 1.0, 0.0)
    with pytest.raises(pb.DimensionError, match="not an interval"):
        axis_membership(0.0, np.nan, 1.0)


def test_membership_of_the_robot(minerva: pb.Robot) -> None:
    region = pb.feasible_region(minerva).scale(0.9)
    Q = np.random.default_rng(9).uniform(-2.5, 2.5, (5000, 3))
    found = region_membership(minerva, region, Q)
    assert np.array_equal(found.mu[:, 0], np.minimum(Q[:, 0] - minerva.lower[0], minerva.upper[0] - Q[:, 0]))
    low, high = region.vertices.min(axis=0), region.vertices.max(axis=0)
    assert np.array_equal(found.mu[:, 1:], axis_membership(Q[:, 1:], low, high))
    points = shapely.points(Q[:, 1:])
    inside = shapely.contains(region.polygon, points)
    allowed = found.mu[:, 0] >= 0.0  # beyond the limits of q1 there is no region
    assert np.array_equal(found.signed_distance > 0, inside & allowed)
    expected = np.where(inside, 1.0, -1.0) * shapely.distance(region.polygon.exterior, points)
    assert found.signed_distance[allowed] == pytest.approx(expected[allowed], abs=1e-12)
    assert np.all(np.isneginf(found.signed_distance[~allowed]))
    assert 0 < allowed.sum() < len(allowed)
    assert np.all((found.mu[:, 1:].min(axis=1) > 0)[inside])  # a box holds its polygon ...
    assert np.any((found.mu[:, 1:].min(axis=1) > 0) & ~inside)  # ... and more


def test_the_papers_fault_at_zero_and_sixty_degrees(minerva: pb.Robot) -> None:
    found = region_membership(minerva, pb.feasible_region(minerva), np.radians([0.0, 0.0, 60.0]))
    assert np.all(found.mu > 0)
    assert np.all(found.mu_printed > 0)
    assert found.signed_distance[0] < 0


def test_projections_touch_the_region(minerva: pb.Robot) -> None:
    region = pb.feasible_region(minerva)
    lower, upper = projections(region)
    assert np.degrees(lower) == pytest.approx([-10.145750656, -8.462041074], abs=1e-9)
    assert np.degrees(upper) == pytest.approx([70.001229130, 68.981699122], abs=1e-9)
    with pytest.raises(pb.DimensionError, match="empty"):
        projections(region.inset(2.0))


def test_classes(minerva: pb.Robot) -> None:
    region = pb.feasible_region(minerva)
    middles = (region.vertices + np.roll(region.vertices, -1, axis=0)) / 2
    for factor, place in ((1 - 1e-6, Place.INSIDE), (1.0, Place.ON), (1 + 1e-6, Place.OUTSIDE)):
        X = region.centroid + factor * (middles - region.centroid)
        Q = np.column_stack((np.zeros(len(X)), X))
        assert np.all(classify(region.signed_distance(Q)) == place)
    assert classify([np.nan, 0.0, -np.inf]).tolist() == [Place.UNKNOWN, Place.ON, Place.OUTSIDE]
    with pytest.raises(pb.DimensionError, match="tolerance"):
        classify([0.0], tolerance=-1.0)
