"""All contacts along one coordinate for a piecewise smooth separation: free is proven, the rest counts as contact.

Distances of segments are only piecewise smooth. So their roots cannot be isolated by derivatives as in `isolation`.
Instead the range of the coordinate is halved until each piece is proven free (lower bound above the threshold), proven
in contact (upper bound below), or too short for halving to help. Its width is then that of rounding, and it counts as
contact. Both bounds are of second order, so the remaining pieces shrink to the contacts quadratically. The undecided
end of a free interval is then bisected to the last bit. Many configurations of the other coordinates are handled
together. `docs/segments.md`.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from pinbound.bounds.bounds import Expansion
from pinbound.bounds.swept_bounds import Bounds, SweptBundle, along_motion, rounding_bound, swept_bundle
from pinbound.evaluate import separation
from pinbound.exceptions import UnsupportedError
from pinbound.limits.isolation import check_turns, holding, listed_period, outward, wrapped
from pinbound.path.relative import RelativePath
from pinbound.tolerances import PRECISION, ROOT
from pinbound.typing import Array, Flags, Ints

__all__ = ["arcs", "around", "smallest", "turn_arcs"]

_PIECES = 5  # 2^5 pieces at the start
_FINEST = 50  # 2^50 steps in all
_MOST_OPEN = 1 << 15  # pieces for each configuration: more mean that the separation is the threshold along an interval
_STRETCH = 64  # consecutive pieces, all at the threshold: so many are not the end of a contact, if each was halved
_CUTS = (32, 3), (256, 2)  # so few pieces are cut into 2^3, or 2^2, at once: a round costs as much for one
_SECTIONS = 7  # points between an end and its contact that are tested in one call
_ROWS = 64  # configurations at a time, to bound memory
_WIDENINGS, _WIDER, _LAST_BIT = 14, 8.0, 4e-16  # from the width of a root to any wall, and back to the last bit


def arcs(
    path: RelativePath, index: int, name: str, Q: Array, threshold: float, window: tuple[float, float] | None
) -> tuple[list[Array], float, tuple[float, float]]:
    """Return the free intervals (k, 2) of coordinate `index` for each row of Q (N, n), their period, and the window.

    If the separation equals the threshold up to rounding along an interval, this interval counts as contact.

    Raises:
        UnsupportedError: If there is no period and no finite window, or the coordinate rotates the path by more than
            `isolation.MOST_TURNS` turns in the window.
    """
    used = path.minimal.coefficients[:, index]
    used = used[used != 0.0]
    slides = bool(np.any(path.minimal.slides[:, :, index]))
    period = listed_period(used, window) if len(used) and not slides else None
    if not len(used) and not slides:
        period = 2.0 * math.pi  # it changes nothing: everything is free, or nothing
    if period is None and (window is None or not all(map(math.isfinite, window))):
        raise UnsupportedError(
            f"{name!r} translates the path, or rotates it by angles without a common period, and without "
            "joint limits its "
            "contacts cannot all be listed: give window=(lower, upper)"
        )
    low, high = (-period / 2, period / 2) if period is not None else window or (-math.inf, math.inf)
    check_turns(name, used, low, high)
    found: list[Array] = []
    for start in range(0, len(Q), _ROWS):
        rows = Q[start : start + _ROWS]
        found += _found(path, index, name, rows, threshold, (low, high))
    if period is None:
        return found, math.inf, (low, high)
    return [wrapped(one, low, high, period)[0] for one in found], period, (-math.inf, math.inf)


def around(
    path: RelativePath, index: int, name: str, q: Array, threshold: float, domain: tuple[float, float]
) -> tuple[float, float] | None:
    """Return the free interval of coordinate `index` around q's own value within a domain; None if it is in contact.

    Ends of the domain are returned unchanged: there is no contact up to them.

    Raises:
        UnsupportedError: If no contact is found over `isolation.MOST_TURNS` turns.
    """
    used = path.minimal.coefficients[:, index]

    def find(low: float, high: float) -> tuple[float, float] | None:
        found = _found(path, index, name, q[None], threshold, (low, high))[0]
        return holding(found, float(q[index]), (low, high))

    slides = bool(np.any(path.minimal.slides[:, :, index]))
    return outward(find, name, float(q[index]), domain, used[used != 0.0], slides)


def _found(
    path: RelativePath, index: int, name: str, Q: Array, threshold: float, domain: tuple[float, float]
) -> list[Array]:
    """Return the free intervals (k, 2) of a finite domain for each row of Q."""
    if not domain[0] < domain[1]:  # a joint whose limits are equal
        apart = separation.separations(path, Q) > threshold
        return [np.array([domain] if one else []).reshape(-1, 2) for one in apart]
    free, open_too = _free(path, index, name, Q, threshold, *domain)
    return _polished(path, index, Q, threshold, free, open_too, domain)


def turn_arcs(path: RelativePath, threshold: float) -> Array:
    """Return the free intervals (k, 2) over one turn of a path with one rotation, in its effective angle [rad]."""
    return arcs(_one_coordinate(path), 0, "the angle", np.zeros((1, 1)), threshold, None)[0][0]


def smallest(path: RelativePath) -> tuple[float, float]:
    """Return the smallest separation over a turn of a path with one rotation [m]: a proven bound, a value.

    They differ by at most `tolerances.PRECISION`, unless the separation is constant over so long an interval, as
    between two boxes side by side, that there are too many pieces. The separation of bodies that overlap is the path's
    floor, zero, up to rounding: no piece needs to be smaller.
    """
    one = _one_coordinate(path)
    bundle, error = _bundle(one, np.full(1, -math.pi), np.full(1, math.pi))
    half, best, proven = math.pi / 64, math.inf, math.inf
    middle: Any = np.linspace(-math.pi, math.pi, 65)[:-1] + half
    for _ in range(_FINEST):
        found = _bound(bundle, np.zeros((len(middle), 1)), 0, middle, half, error)
        best = min(best, float(found.value.min()))
        left = (found.lower < best - PRECISION) & (found.upper - found.lower > 4.0 * error)
        proven = min(proven, float(found.lower[~left].min(initial=math.inf)))
        middle = middle[left]
        if not len(middle) or len(middle) > _MOST_OPEN or best <= path.floor + 4.0 * error:
            proven = min(proven, float(found.lower[left].min(initial=math.inf)))
            break
        half /= 2.0
        middle = np.concatenate((middle - half, middle + half))
    return max(proven, path.floor), best


def _one_coordinate(path: RelativePath) -> RelativePath:
    """Return a path of one rotation over its effective angle alone, with the sign of `univariate.one_angle`."""
    chain, c = path.minimal, path.minimal.coefficients[0]
    sign = np.sign(c[np.flatnonzero(c)[-1]])
    only = replace(chain, slides=np.zeros((2, 3, 1)), axes=sign * chain.axes, coefficients=np.ones((1, 1)))
    return replace(path, difference=replace(path.difference, chain=only))


def _bundle(path: RelativePath, lower: Array, upper: Array) -> tuple[SweptBundle, float]:
    bundle = swept_bundle([path], lower, upper)
    return bundle, float(rounding_bound(bundle, None, lower, upper)[0])  # limits are those of the reduced path


def _bound(bundle: SweptBundle, Q: Array, index: int, middle: Array, half: float, error: float) -> Bounds:
    """Bound the separation while coordinate `index` runs over `middle +- half`, the others as in Q."""
    q, slope, zero = Q.copy(), np.zeros_like(Q), np.zeros(Q.shape[1])
    q[:, index], slope[:, index] = middle, 2.0 * half
    piece = Expansion(q, zero, slope, q[:, None], zero, slope[:, None], zero, np.zeros_like(slope[:, None]), zero)
    return along_motion(bundle, np.zeros(len(Q), dtype=np.intp), piece, np.full(len(Q), error))


def _free(
    path: RelativePath, index: int, name: str, Q: Array, threshold: float, low: float, high: float
) -> tuple[list[Array], list[Array]]:
    """Return the intervals (k, 2) of [low, high] that are proven free, for each row of Q; and those not in contact.

    Everything between two of the latter counts as contact: it is proven to be, or the separation equals the threshold
    up to rounding along an interval, as for faces that slide along each other.
    """
    ends = Q.min(axis=0), Q.max(axis=0)
    ends[0][index], ends[1][index] = low, high
    bundle, error = _bundle(path, *ends)
    step = (high - low) / 2**_FINEST
    size = 1 << (_FINEST - _PIECES)
    row = np.repeat(np.arange(len(Q)), 1 << _PIECES)
    start = np.tile(np.arange(1 << _PIECES, dtype=np.int64) * size, len(Q))
    cuts = 1
    kept: list[tuple[Ints, Ints, int]] = []
    undecided: list[tuple[Ints, Ints, int]] = []
    reached = max(threshold, path.floor + 4.0 * error)  # a distance of zero is known up to rounding
    while len(row):
        half = size * step / 2.0
        middle: Any = low + step * start + half
        found = _bound(bundle, Q[row], index, middle, half, error)
        free = found.lower > threshold
        kept.append((row[free], start[free], size))
        stuck = (found.upper - found.lower <= 4.0 * error) | (half <= ROOT * max(1.0, abs(low), abs(high)))
        hit = found.upper <= reached
        left, doubtful = ~free & ~hit & ~stuck, ~free & ~hit & stuck
        undecided.append((row[doubtful], start[doubtful], size))
        at_threshold = np.abs(found.value[left] - threshold) <= 4.0 * error
        kept_open = ~_inside_stretches(row[left], start[left], size, at_threshold, _STRETCH << (cuts - 1))
        row, start = row[left][kept_open], start[left][kept_open]
        if len(row) and int(np.bincount(row).max()) > _MOST_OPEN:
            gap, place = float(np.median(np.abs(found.value[left] - threshold))), float(middle[left][0])
            raise UnsupportedError(
                f"around {place:.6g} the separation stays within {gap:.1e} m of the contact distance over a whole "
                f"interval of {name!r}, too near to contact to decide; change the threshold by more than that"
            )
        cuts = next((cuts for most, cuts in _CUTS if len(row) <= most and size >> cuts), 1)
        size >>= cuts
        steps = np.arange(1 << cuts, dtype=np.int64)[:, None] * size
        row, start = np.tile(row, 1 << cuts), (start + steps).ravel()
    return _joined(kept, len(Q), low, high), _joined([*kept, *undecided], len(Q), low, high)


def _inside_stretches(row: Ints, start: Ints, size: int, flat: Flags, many: int) -> Flags:
    """Return which pieces lie inside a long run of neighbours that are all at the threshold, without its ends."""
    order = np.lexsort((start, row))
    flat = flat[order]
    follows = np.zeros(len(row), dtype=np.bool_)
    follows[1:] = (row[order][1:] == row[order][:-1]) & (np.diff(start[order]) == size) & flat[1:] & flat[:-1]
    run = np.cumsum(~follows)
    first = np.searchsorted(run, run)
    last = np.searchsorted(run, run, side="right") - 1
    place = np.arange(len(row))
    inside = np.zeros(len(row), dtype=np.bool_)
    inside[order] = flat & (last - first >= many) & (place > first + 1) & (place < last - 1)
    return inside


def _polished(
    path: RelativePath,
    index: int,
    Q: Array,
    threshold: float,
    free: list[Array],
    open_too: list[Array],
    domain: tuple[float, float],
) -> list[Array]:
    """Move ends of free intervals to the contact, only over what rounding left undecided."""
    rows = np.repeat(np.arange(len(free)), [len(one) for one in free])
    ends = np.concatenate(free)
    walls, beside = (np.concatenate(part) for part in zip(*map(_walls, free, open_too), strict=True))
    joined = np.ones((len(ends), 2), dtype=np.bool_)  # no contact between an end and the next interval
    for side in (0, 1):
        q, inside, wall = Q[rows], ends[:, side].copy(), walls[:, side]

        def above(x: Array, q: Array = q) -> Flags:
            q[:, index] = x
            return separation.separations(path, q) > threshold

        step, outside = np.full(len(inside), ROOT), inside
        for _ in range(_WIDENINGS):
            outside = np.maximum(inside - step, wall) if side == 0 else np.minimum(inside + step, wall)
            apart = above(outside)
            if not np.any(apart & (outside != wall)):
                break
            step = np.where(apart, _WIDER * step, step)
        met = ~above(outside) & (inside > domain[0]) & (inside < domain[1])  # ends of the window are not contacts
        joined[:, side] = ~met & (outside == wall) & beside[:, side]
        every, shares = np.tile(rows, _SECTIONS), np.arange(1, _SECTIONS + 1)[:, None] / (_SECTIONS + 1)
        while np.any(met & (np.abs(outside - inside) > _LAST_BIT * np.maximum(1.0, np.abs(inside)))):
            between = np.concatenate((inside[None], inside + shares * (outside - inside), outside[None]))
            apart = above(between[1:-1].ravel(), Q[every]).reshape(_SECTIONS, -1)
            first = np.argmin(np.concatenate((apart, np.zeros_like(apart[:1]))), axis=0)  # the first that is in contact
            inside, outside = (between[first + beyond, np.arange(len(first))] for beyond in (0, 1))
        ends[met, side] = inside[met]
    cuts = np.cumsum([len(one) for one in free])[:-1]
    return [_united(one, flags) for one, flags in zip(np.split(ends, cuts), np.split(joined, cuts), strict=True)]


def _walls(free: Array, open_too: Array) -> tuple[Array, Flags]:
    """Return how far each end of free intervals (k, 2) may move (k, 2), and whether another free one begins there.

    The limit is the proven contact: an end of the interval of `open_too` that contains it.
    """
    holder = np.searchsorted(open_too[:, 0], free[:, 0], side="right") - 1
    walls, beside = open_too[holder], np.zeros(free.shape, dtype=np.bool_)
    same = holder[1:] == holder[:-1]
    walls[1:, 0][same], walls[:-1, 1][same] = free[:-1, 1][same], free[1:, 0][same]
    beside[1:, 0], beside[:-1, 1] = same, same
    return walls, beside


def _united(intervals: Array, joined: Flags) -> Array:
    """Return intervals (k, 2) that do not overlap: undecided parts between some of them turned out to be free."""
    found: list[Array] = []
    for place, one in enumerate(intervals):
        if place and (one[0] < found[-1][1] or (joined[place, 0] and joined[place - 1, 1])):
            found[-1][1] = max(found[-1][1], one[1])
        else:
            found.append(one.copy())
    return np.array(found).reshape(-1, 2)


def _joined(kept: list[tuple[Ints, Ints, int]], count: int, low: float, high: float) -> list[Array]:
    """Return free pieces of [low, high] joined to intervals, row by row; the ends of the range are exact."""
    step = (high - low) / 2**_FINEST
    row = np.concatenate([part[0] for part in kept])
    start = np.concatenate([part[1] for part in kept])
    stop = start + np.concatenate([np.full(len(part[0]), part[2], dtype=np.int64) for part in kept])
    order = np.lexsort((start, row))
    row, start, stop = row[order], start[order], stop[order]
    first = np.ones(len(row), dtype=np.bool_)
    first[1:] = (row[1:] != row[:-1]) | (start[1:] != stop[:-1])
    last = np.append(first[1:], True)[: len(row)]
    intervals: Array = low + step * np.stack((start[first], stop[last]), axis=1).astype(np.float64)
    intervals[start[first] == 0, 0] = low
    intervals[stop[last] == 1 << _FINEST, 1] = high
    owner = row[first]
    return [intervals[owner == one] for one in range(count)]
