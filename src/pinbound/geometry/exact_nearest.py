"""The nearest point of two hulls in integer arithmetic, for the few cases that float64 cannot decide: touching slivers.

A float64 is an integer times a power of two. So vertices, their products and their signs are exact in Python's
integers, and the algorithm of `geometry/gjk.py` ends at the nearest point itself: v is shorter at each step, rounding
decides no step, and the last corner proves that no point is nearer. It takes some milliseconds.
"""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pinbound.typing import Array

__all__ = ["nearest_exactly"]

Whole = tuple[int, int, int]

_MOST_ROUNDS = 1_000  # a limit for a loop that ends by itself


def nearest_exactly(w: Array, directions: Array, corners: tuple[Array, Array]) -> Array:
    """Return t (m,) for which `|w + sum_i t_i e_i|` is least; arguments as for one row of `gjk.nearest_vertices`.

    Example:
        >>> w, needle = np.array([0.5, 1e-9, 0.0]), np.array([[0.0], [1.0]])
        >>> nearest_exactly(w, np.array([[-1.0, 0.0, 0.0]]), (needle, np.zeros((1, 0)))).tolist()
        [0.5]
    """
    split = corners[0].shape[1]
    offset, places = _whole(w)
    edges, more = _whole(directions)
    sides = [_whole(one) for one in corners]
    depth = max(0, *(power for _, power in sides))
    shift = max(places, more + depth)
    base = [x << (shift - places) for x in offset.tolist()]
    own = (edges[:split], edges[split:])
    steps = [
        (c @ part if part.size else np.zeros((len(c), 3), dtype=object)) * (1 << (shift - more - power))
        for (c, power), part in zip(sides, own, strict=True)
    ]

    def support(v: Whole) -> tuple[Whole, tuple[int, int]]:
        first, second = (int(np.argmin(step @ np.array(v, dtype=object))) for step in steps)
        x, y, z = (int(b + i + j) for b, i, j in zip(base, steps[0][first], steps[1][second], strict=True))
        return (x, y, z), (first, second)

    point, pair = support((0, 0, 0))
    points: list[Whole] = [point]
    pairs: list[tuple[int, int]] = [pair]
    shares, v = [1], point
    for _ in range(_MOST_ROUNDS):
        point, pair = support(v)
        if pair in pairs or _dot(v, point) * sum(shares) >= _dot(v, v):  # v is the point times sum(shares)
            break
        points, pairs = [*points, point], [*pairs, pair]
        used, shares, v = _nearest(points)
        points, pairs = [points[i] for i in used], [pairs[i] for i in used]
        if not any(v):
            break
    total, t = sum(shares), np.zeros(len(directions))
    for share, (i, j) in zip(shares, pairs, strict=True):
        t += (share / total) * np.concatenate((corners[0][i], corners[1][j]))
    return t


def _whole(values: Array) -> tuple[NDArray[Any], int]:
    """Return an array as integers times a power of two, and the power."""
    ratios = [float(value).as_integer_ratio() for value in values.ravel()]
    power = max((below.bit_length() - 1 for _, below in ratios), default=0)
    found = np.empty(len(ratios), dtype=object)
    found[:] = [above << (power - below.bit_length() + 1) for above, below in ratios]
    return found.reshape(values.shape), power


def _nearest(points: list[Whole]) -> tuple[list[int], list[int], Whole]:
    """Return which of up to four points span the nearest feature, their shares, and the point times their sum."""
    best: tuple[list[int], list[int], Whole] | None = None
    for count in range(1, len(points) + 1):
        for used in combinations(range(len(points)), count):
            shares = _shares([points[i] for i in used])
            if shares is None:
                continue
            x, y, z = (sum(s * points[i][axis] for s, i in zip(shares, used, strict=True)) for axis in range(3))
            v = (x, y, z)
            if best is None or _dot(v, v) * sum(best[1]) ** 2 < _dot(best[2], best[2]) * sum(shares) ** 2:
                best = list(used), shares, v
    assert best is not None  # a single point always gives a result
    return best


def _shares(points: list[Whole]) -> list[int] | None:
    """Return positive shares of points if the foot of the origin is inside their hull; else None."""
    if len(points) == 1:
        return [1]
    if len(points) == 2:
        a, b = points
        along = _minus(b, a)
        t, total = -_dot(a, along), _dot(along, along)
        return [total - t, t] if 0 < t < total else None
    if len(points) == 3:
        a, b, c = points
        n = _cross(_minus(b, a), _minus(c, a))
        found = [_dot(n, _cross(b, c)), _dot(n, _cross(c, a)), _dot(n, _cross(a, b))]
        return found if min(found) > 0 else None
    a, b, c, d = points
    volumes = [-_dot(b, _cross(c, d)), _dot(a, _cross(c, d)), -_dot(a, _cross(b, d)), _dot(a, _cross(b, c))]
    if max(volumes) < 0:
        volumes = [-volume for volume in volumes]
    return volumes if min(volumes) > 0 else None


def _dot(a: Whole, b: Whole) -> int:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _minus(a: Whole, b: Whole) -> Whole:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def _cross(a: Whole, b: Whole) -> Whole:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
