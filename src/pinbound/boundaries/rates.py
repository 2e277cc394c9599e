"""How fast one coordinate can reduce a clearance, for all q: boundaries that are far enough away need no search.

A distance, or a height above a plane, changes by at most `sum_i rho_i |c_ij|` for each unit of coordinate j. Here rho_i
bounds the lever arm of rotation i (for bodies, over all pairs of their corners), and c_i are the coefficients of its
angle; a height is a projection. A block with a prismatic joint on the coordinate adds its length for each unit. A
stop's signed clearance `A sin(d / 2)` changes by at most `A |c_j| / 2`; it does not change if it does not depend on the
coordinate. So a clearance s > L |x - q_j| means that there is no contact between q_j and x; `ahead` extends this.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pinbound.boundaries.ahead import Ahead, Ask, farness
from pinbound.boundaries.boundary import Boundary
from pinbound.bounds.bodies import swept_bundle
from pinbound.bounds.bounds import bundle, lever_arms
from pinbound.model.coupling import LinearLimit
from pinbound.tolerances import INFLATION, LIMIT
from pinbound.typing import Array, Flags, Indices

__all__ = ["farthest", "rates_of", "spans_of", "tighten_all"]


def farthest(limits: Sequence[LinearLimit], n: int) -> Array:
    """Return upper bounds (n,) of the coordinates within joint limits [rad or m]; infinite if there is no bound.

    Example:
        >>> import pinbound as pb
        >>> farthest(pb.load("minervabot_v3").linear_limits, 3).round(3).tolist()
        [2.356, 3.142, 3.142]
    """
    found = np.full(n, math.inf)
    for limit in limits:
        used = np.flatnonzero(limit.coefficients)
        if len(used) == 1:
            ends = (np.array([limit.lower, limit.upper]) - limit.offset) / limit.coefficients[used[0]]
            found[used[0]] = min(found[used[0]], float(np.abs(ends).max()))
    return found * INFLATION + LIMIT  # limits are kept up to rounding


def rates_of(boundaries: Sequence[Boundary], index: int, reach: Array | None = None) -> Array:
    """Return bounds (m,) of the rates at which coordinate `index` changes signed clearances; infinite if unknown.

    They are in m per unit. `reach` (n,) bounds each coordinate [rad or m], which matters for prismatic joints; None:
    unknown.

    Example:
        >>> import pinbound as pb
        >>> B = pb.load("minervabot_v3").boundaries
        >>> rates_of(B, 0).tolist() == [0.0] * len(B)  # q1 turns the whole arm
        True
    """
    return np.array([_rate(boundary, index, reach) for boundary in boundaries])


def _rate(boundary: Boundary, index: int, reach: Array | None) -> float:
    stop, path = boundary.rule.stop, boundary.path
    if stop is not None:
        return 0.5 * stop.amplitude * abs(float(stop.coefficients[index])) * INFLATION
    chain = path.minimal
    if index not in chain.coordinates:
        return 0.0
    slides = np.any(chain.slides, axis=(0, 1))
    most = np.zeros(len(slides))
    if np.any(slides):
        if reach is None or not np.all(np.isfinite(reach[slides])):
            return np.inf
        most[slides] = reach[slides]
    if path.is_harmonic:
        arms = lever_arms(bundle([chain], len(most)), -most, most)[0]
    else:
        arms = swept_bundle([path], -most, most).arms[0, : len(chain.coefficients)]
    slid = float(np.linalg.norm(chain.slides[:, :, index], axis=1).sum())
    return (float(arms @ np.abs(chain.coefficients[:, index])) + slid) * INFLATION


def spans_of(
    boundaries: Sequence[Boundary],
    ahead: Ahead,
    clearances: Array,
    coordinate: str,
    q: Array,
    within: tuple[float, float],
    ask: Ask,
) -> list[tuple[float, float] | None]:
    """Return `boundary.span` of each boundary, the nearest first: later ones are searched only up to the stops found.

    Args:
        boundaries: m boundaries of one robot.
        ahead: Their data before the coordinate moves.
        clearances: (m,) signed clearances at q [m].
        coordinate: A coordinate.
        q: (n,) configuration.
        within: The search interval; if it does not contain the coordinate's value, the search is everywhere.
        ask: Returns signed clearances (N, m) at other configurations (N, n).
    """
    spans: list[tuple[float, float] | None] = [(-math.inf, math.inf) if s > 0.0 else None for s in clearances.tolist()]
    if not spans:
        return spans
    index = boundaries[0].robot_coordinates.index(coordinate)
    value = float(q[index])
    low, high = within if within[0] <= value <= within[1] else (-math.inf, math.inf)
    seen = low, high  # a little wider than the known interval, so that of several stops at one value each is found
    down, up = ahead.reach(clearances, value, (low, high), _along(ask, q, index))
    nearest_first: list[int] = np.argsort(np.minimum(down, up), kind="stable").tolist()
    for k in nearest_first:
        if spans[k] is None or (_is_beyond(down[k], value - low) and _is_beyond(up[k], high - value)):
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
    ahead: Ahead,
    clearances: Array,
    coordinate: str,
    Q: Array,
    ends: Array,
    stops: NDArray[np.object_],
    ask: Ask,
) -> None:
    """Intersect intervals (N, 2) with those that each boundary allows, in place, and name what stops there.

    The arguments are those of `spans_of` for N rows: clearances (N, m), Q (N, n); the intervals contain the values.
    """
    if not len(boundaries):
        return
    index = boundaries[0].robot_coordinates.index(coordinate)
    values = Q[:, index]
    held = float(ends[:, 0].min()), float(ends[:, 1].max())
    met = ~np.all(clearances > 0.0, axis=1)
    ends[met], stops[met] = np.nan, ""
    rank, (down, up) = np.full(ends.shape, -1), _reaches(ahead, clearances, index, Q, ends, np.flatnonzero(~met), ask)
    nearest_first: list[int] = np.argsort(np.median(np.minimum(down, up), axis=0), kind="stable").tolist()
    for k in nearest_first:
        clear = _is_beyond(down[:, k], values - ends[:, 0]) & _is_beyond(up[:, k], ends[:, 1] - values)
        near = np.flatnonzero(~met & ~clear)
        if not len(near):
            continue
        spans = boundaries[k].spans(coordinate, Q[near], held, np.ones(len(near), dtype=np.bool_))
        for side, sign in ((0, 1.0), (1, -1.0)):
            new, old = sign * spans[:, side], sign * ends[near, side]
            # of several stops at one value the first is named: joint limits, then boundaries, in order
            first = (new > old) | (np.isfinite(new) & (new == old) & (rank[near, side] > k))
            rows = near[first]
            ends[rows, side], stops[rows, side], rank[rows, side] = spans[first, side], boundaries[k].name, k


def _is_beyond(reach: Array, end: Array | float) -> Flags:
    """Return whether a reach goes beyond an end of the interval; both may be infinite."""
    return (reach > end) | np.isinf(reach)


def _reaches(
    ahead: Ahead, clearances: Array, index: int, Q: Array, ends: Array, rows: Indices, ask: Ask
) -> tuple[Array, Array]:
    """Return `ahead.reach` of rows of Q (N, n), each within its ends: (N, m), (N, m); for other rows the least."""
    down = farness(clearances, ahead.rates)
    up = down.copy()
    for row in rows if np.any(ahead.sampled) else ():
        within, along = (float(ends[row, 0]), float(ends[row, 1])), _along(ask, Q[row], index)
        down[row], up[row] = ahead.reach(clearances[row], float(Q[row, index]), within, along)
    return down, up


def _along(ask: Ask, q: Array, index: int) -> Ask:
    """Return a function that evaluates `ask` at q (n,) with other values (N,) of one coordinate."""

    def along(x: Array) -> Array:
        moved = np.tile(q, (len(x), 1))
        moved[:, index] = x
        return ask(moved)

    return along
