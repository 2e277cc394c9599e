"""How far one coordinate can move from its value: the search goes outwards, for windows of any width.

Closed forms come from `univariate`. Other contacts are isolated with a proof, the nearest first.
"""

from __future__ import annotations

import math

import numpy as np

from pinbound.limits.univariate import allowed_arcs_table
from pinbound.path.relative import RelativePath
from pinbound.typing import Array

__all__ = ["around", "arounds", "is_closed"]


def is_closed(path: RelativePath, index: int) -> bool:
    """Return whether a coordinate's contacts have closed forms: it is in one rotation of points, or only translates."""
    turned = np.count_nonzero(path.minimal.coefficients[:, index])
    slides = bool(np.any(path.minimal.slides[:, :, index]))
    return not turned or (turned == 1 and not slides and path.is_harmonic)


def around(
    path: RelativePath,
    index: int,
    name: str,
    q: Array,
    threshold: float,
    domain: tuple[float, float],
) -> tuple[float, float] | None:
    """Return the allowed interval of coordinate `index` around q's (n,) own value, within a domain that contains it.

    The result is that of `allowed_arcs_table(...).around(...)`, but the search goes outwards from the value, for
    domains of any width. None if the value is in contact. Ends of the domain are not contacts, and count as allowed.

    Raises:
        UnsupportedError: If the coordinate has contacts without a period, and none is near.
    """
    if is_closed(path, index):
        return allowed_arcs_table(path, index, name, q[None], threshold, 0.0)[0].around(float(q[index]))
    far = _farthest_contact(path, index, q, threshold)
    low, high = max(domain[0], -far), min(domain[1], far)
    if not low < high:
        low, high = domain
    near = q.copy()
    near[index] = min(max(float(q[index]), low), high)  # the part beyond is free, and has no contact
    from pinbound.limits import isolated

    found = isolated.around(path, index, name, near, threshold, (low, high))
    if found is None:
        return None
    return domain[0] if found[0] <= low else found[0], domain[1] if found[1] >= high else found[1]


def _farthest_contact(path: RelativePath, index: int, q: Array, distance: float) -> float:
    """Return an upper bound of coordinate `index` in contact, the others as in q (n,); infinite if there is none.

    If only one block translates with it, by L for each unit, `|r| >= |L| |x| - sum of all other lengths`.
    """
    chain = path.minimal
    rates = np.linalg.norm(chain.slides[:, :, index], axis=1)
    if path.projection is not None or np.count_nonzero(rates) != 1:
        return math.inf
    rest = q.copy()
    rest[index] = 0.0
    held = chain.offsets + chain.slides @ rest
    moved = np.linalg.norm(np.array(path.difference.directions).reshape(-1, *held.shape), axis=2).sum(axis=1)
    split = path.difference.corners[0].shape[1]
    sides = zip((moved[:split], moved[split:]), path.difference.corners, strict=True)
    others = float(np.linalg.norm(held, axis=1).sum() + sum((np.abs(c) @ part).max() for part, c in sides))
    return (others + distance) / float(rates.max()) * (1.0 + 1e-9)


def arounds(
    path: RelativePath,
    index: int,
    name: str,
    Q: Array,
    threshold: float,
    domain: tuple[float, float],
) -> Array:
    """Return `around` for many q (N, n) with values in the domain: (N, 2), NaN if the value is in contact."""
    chain = path.minimal
    used = chain.coefficients[chain.coefficients[:, index] != 0.0, index]
    repeats = len(used) and not np.any(chain.slides[:, :, index])
    if is_closed(path, index) or (repeats and _repeats_soon(used)):
        return allowed_arcs_table(path, index, name, Q, threshold, 0.0).around(Q[:, index])
    found = [around(path, index, name, q, threshold, domain) for q in Q]
    return np.array([(math.nan, math.nan) if one is None else one for one in found]).reshape(-1, 2)


def _repeats_soon(coefficients: Array) -> bool:
    from pinbound.limits.isolation import MOST_TURNS, common_period

    period = common_period(coefficients)
    return period is not None and period * float(np.abs(coefficients).max()) <= 2.0 * math.pi * MOST_TURNS
