"""The default home of a robot: a configuration within all joint limits, as near to zero as possible."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, cast

import numpy as np

from pinbound.model.coupling import GuardedLimit, Intervals, LinearLimit
from pinbound.tolerances import BESIDE_CONDITION
from pinbound.typing import Array, Flags

__all__ = ["coordinate_ends", "feasible_start", "nearest_within", "ways_to_keep"]


def coordinate_ends(limits: Sequence[LinearLimit], n: int) -> Array:
    """Return the ends (n, 2) that limits on single coordinates allow, also of mimic joints [rad or m].

    Example:
        >>> own = LinearLimit("q", np.array([1.0]), 0.0, -1.0, 1.0)
        >>> coordinate_ends([own, LinearLimit("mimic", np.array([2.0]), 0.5, -0.5, 0.5)], 1)
        array([[-0.5,  0. ]])
    """
    ends = np.tile([-math.inf, math.inf], (n, 1))
    for limit in limits:
        used = np.flatnonzero(limit.coefficients)
        if len(used) == 1:
            low, high = sorted(
                (end - limit.offset) / float(limit.coefficients[used[0]]) for end in (limit.lower, limit.upper)
            )
            row = ends[used[0]]
            row[0], row[1] = max(low, row[0]), min(high, row[1])
    return ends


def feasible_start(
    limits: Sequence[LinearLimit], fixed: Array, names: Sequence[str], guarded: Sequence[GuardedLimit] = ()
) -> tuple[Array | None, dict[str, str]]:
    """Return a configuration (n,) within all limits, and how each coordinate that is neither given nor zero was chosen.

    A coordinate whose limits do not contain zero is set to their middle, or to the only end. If a limit on several
    coordinates is still violated, these coordinates move as little as possible (a linear program minimises the sum of
    the changes).

    Args:
        limits: All joint limits.
        fixed: (n,) given values; NaN where none is given.
        names: Names of the coordinates.
        guarded: Ends of rules with conditions, which must be kept, too.

    Returns:
        None if no configuration keeps all limits with these values.
    """
    n, test = len(fixed), Intervals.of(limits, len(fixed), guarded=guarded)
    q = np.where(np.isnan(fixed), 0.0, fixed)
    reasons: dict[str, str] = {}
    for index, (low, high) in enumerate(coordinate_ends(limits, n).tolist()):
        if math.isnan(fixed[index]) and not low <= 0.0 <= high:
            ends = [end for end in (low, high) if math.isfinite(end)]
            q[index] = sum(ends) / len(ends)
            reasons[names[index]] = "the middle of its limits" if len(ends) > 1 else "the end of its limits"
    if test.hold(q[None])[0]:
        return q, reasons
    moved = nearest_within(limits, guarded, q, np.isnan(fixed))
    if moved is None or not test.hold(moved[None])[0]:
        return None, {}
    changed = {names[i]: "the nearest to zero within all limits" for i in np.flatnonzero(moved != q).tolist()}
    return moved, reasons | changed


def nearest_within(
    limits: Sequence[LinearLimit], guarded: Sequence[GuardedLimit], q: Array, loose: Flags
) -> Array | None:
    """Return the configuration within all limits, also guarded ones, that is nearest to q; None if there is none.

    Only the coordinates `loose` (n,) move. Each way to keep a guarded limit is tried, and the nearest answer is
    returned.
    """
    moved = _nearest(limits, q, loose)
    broken = None if moved is None else next((one for one in guarded if not one.holds(moved[None])[0]), None)
    if broken is None:
        return moved
    found = [nearest_within((*limits, way), guarded, q, loose) for way in ways_to_keep(broken)]
    return min((one for one in found if one is not None), key=lambda one: float(np.sum(np.abs(one - q))), default=None)


def ways_to_keep(guarded: GuardedLimit) -> list[LinearLimit]:
    """Return limits that each keep a guarded limit: its end, or a violated end of a condition."""
    ways = [guarded.limit]
    for one in guarded.where:
        ways.append(replace(one, lower=one.upper + BESIDE_CONDITION, upper=math.inf))
        ways.append(replace(one, lower=-math.inf, upper=one.lower - BESIDE_CONDITION))
    return [way for way in ways if math.isfinite(way.lower) or math.isfinite(way.upper)]


def _nearest(limits: Sequence[LinearLimit], q: Array, loose: Flags) -> Array | None:
    """Return the configuration within all limits whose loose coordinates differ least from q; None if there is none.

    The change is `u - v` with u, v >= 0; the linear program minimises `sum(u + v)`.
    """
    from scipy import optimize

    rows, bounds = list[Array](), list[float]()
    for limit in limits:
        value = float(limit.values(q[None])[0])
        for sign, end in ((1.0, limit.upper), (-1.0, limit.lower)):
            if math.isfinite(end):
                c = sign * limit.coefficients * loose
                rows.append(np.concatenate((c, -c)))
                bounds.append(sign * (end - value))
    if not rows:
        return q
    found = cast(Any, optimize).linprog(np.ones(2 * len(q)), A_ub=np.array(rows), b_ub=np.array(bounds), method="highs")
    if found.x is None:
        return None
    change = np.asarray(found.x, dtype=np.float64).reshape(2, -1)
    moved = np.where(loose, q + change[0] - change[1], q)
    for limit in limits:  # the program's tolerance is wider than a limit's: move one joint to its end
        used = np.flatnonzero((limit.coefficients != 0.0) & loose)
        value = float(limit.values(moved[None])[0])
        if len(used) and not limit.holds(moved[None])[0]:
            end = limit.upper if value > limit.upper else limit.lower
            moved[used[-1]] += (end - value) / float(limit.coefficients[used[-1]])
    return moved
