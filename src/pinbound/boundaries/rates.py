"""How fast one coordinate can bring a contact nearer, whatever q: boundaries that are too far away need no closer look.

A distance of two points, or a height above a plane, changes by at most `sum_i rho_i |c_ij|` per unit of coordinate j:
rho_i bounds the lever arm of rotation i (`bounds.lever_arms`), c_i is its angle's coefficient, and a height is a
projection. A stop's signed clearance `A sin(d / 2)` changes by at most `A |c_j| / 2`, and one that does not depend on
the coordinate not at all. So a clearance s > L |x - q_j| is one between q_j and x, too.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pinbound.boundaries.boundary import Boundary
from pinbound.bounds.bounds import bundle, lever_arms
from pinbound.tolerances import INFLATION, NEVER_MEETS
from pinbound.typing import Array

__all__ = ["rates_of", "spans_of", "tighten_all"]


def rates_of(boundaries: Sequence[Boundary], index: int) -> Array:
    """Return bounds (m,) of how fast coordinate `index` changes signed clearances [m per unit]; infinite if unknown.

    Example:
        >>> import pinbound as pb
        >>> B = pb.load("minervabot_v3").boundaries
        >>> rates_of(B, 0).tolist() == [0.0] * len(B)  # q1 turns the whole arm
        True
    """
    return np.array([_rate(boundary, index) for boundary in boundaries])


def _rate(boundary: Boundary, index: int) -> float:
    stop, path = boundary.rule.stop, boundary.path
    if stop is not None:
        return 0.5 * stop.amplitude * abs(float(stop.coefficients[index])) * INFLATION
    chain = path.minimal
    if index not in chain.coordinates:
        return 0.0
    if not path.is_harmonic or np.any(chain.slides):
        return np.inf
    nothing = np.zeros(chain.coefficients.shape[1])
    arms = lever_arms(bundle([chain], len(nothing)), nothing, nothing)[0]
    return float(arms @ np.abs(chain.coefficients[:, index])) * INFLATION


def spans_of(
    boundaries: Sequence[Boundary],
    rates: Array,
    clearances: Array,
    coordinate: str,
    q: Array,
    within: tuple[float, float],
) -> list[tuple[float, float] | None]:
    """Return `boundary.span` of each boundary, the nearest looked at first: what lies beyond its stops, stops nothing.

    Args:
        boundaries: m boundaries of one robot.
        rates: (m,) as of `rates_of`.
        clearances: (m,) signed clearances at q [m].
        coordinate: A coordinate.
        q: (n,) configuration.
        within: The interval to look in; if it does not hold the coordinate's value, everywhere.
    """
    spans: list[tuple[float, float] | None] = [(-math.inf, math.inf) if s > 0.0 else None for s in clearances.tolist()]
    value = float(q[boundaries[0].robot_coordinates.index(coordinate)]) if spans else 0.0
    low, high = within if within[0] <= value <= within[1] else (-math.inf, math.inf)
    seen = low, high  # a little wider than what is known, so that of several stops at one place each is told
    far = _farness(clearances, rates)
    nearest_first: list[int] = np.argsort(far, kind="stable").tolist()
    for k in nearest_first:
        if far[k] > max(value - low, high - value):
            break
        if spans[k] is None:
            continue
        found = boundaries[k].span(coordinate, q, seen, True)
        spans[k] = found
        if found is not None and found[0] > low:
            low, seen = found[0], (math.nextafter(found[0], -math.inf), seen[1])
        if found is not None and found[1] < high:
            high, seen = found[1], (seen[0], math.nextafter(found[1], math.inf))
    return spans


def tighten_all(
    boundaries: Sequence[Boundary],
    rates: Array,
    clearances: Array,
    coordinate: str,
    Q: Array,
    ends: Array,
    stops: NDArray[np.object_],
) -> None:
    """Intersect intervals (N, 2) with what each boundary leaves, in place, and name what stops there.

    Arguments are as for `spans_of`, of N rows: clearances (N, m), Q (N, n); the intervals hold the values.
    """
    values = Q[:, boundaries[0].robot_coordinates.index(coordinate)] if len(boundaries) else np.zeros(len(Q))
    held = float(ends[:, 0].min()), float(ends[:, 1].max())
    met = ~np.all(clearances > 0.0, axis=1)
    ends[met], stops[met] = np.nan, ""
    far, rank = _farness(clearances, rates), np.full(ends.shape, -1)
    nearest_first: list[int] = np.argsort(np.median(far, axis=0), kind="stable").tolist()
    for k in nearest_first:
        near = np.flatnonzero(~met & ~(far[:, k] > np.maximum(values - ends[:, 0], ends[:, 1] - values)))
        if not len(near):
            continue
        spans = boundaries[k].spans(coordinate, Q[near], held, np.ones(len(near), dtype=np.bool_))
        for side, sign in ((0, 1.0), (1, -1.0)):
            new, old = sign * spans[:, side], sign * ends[near, side]
            # of several at one place the first is named: joint limits, then boundaries, in order
            first = (new > old) | (np.isfinite(new) & (new == old) & (rank[near, side] > k))
            rows = near[first]
            ends[rows, side], stops[rows, side], rank[rows, side] = spans[first, side], boundaries[k].name, k


def _farness(clearances: Array, rates: Array) -> Array:
    """Return how far the coordinate moves, at least, until each boundary is in contact (..., m) [rad or m]."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(rates > 0.0, (clearances - NEVER_MEETS) / rates, math.inf)
