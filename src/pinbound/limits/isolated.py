"""Contacts along one coordinate that have no closed form: one entry, whatever the two marks are.

Two points have `|r|^2 - T^2`, whose derivatives are bounded up to the third: `isolation`. All others have a separation
that is only piecewise smooth, and bounds over intervals: `piecewise_isolation`. `docs/hull-proofs.md` says why.
"""

from __future__ import annotations

import math

from pinbound.limits import isolation, piecewise_isolation
from pinbound.path.relative import RelativePath
from pinbound.typing import Array

__all__ = ["arcs", "around"]


def arcs(
    path: RelativePath, index: int, name: str, Q: Array, threshold: float, window: tuple[float, float] | None
) -> tuple[list[Array], list[float], tuple[float, float]]:
    """Return for each row of Q (N, n) the free intervals (k, 2) of a coordinate, and their period; and the window.

    Raises:
        UnsupportedError: If nothing repeats and there is no finite window, or there are too many turns.
    """
    if path.is_plain:
        rows = [isolation.arcs(path.minimal, index, name, q, threshold, window) for q in Q]
        ends = rows[0][2] if rows else (-math.inf, math.inf)
        return [row[0] for row in rows], [row[1] for row in rows], ends
    found, period, ends = piecewise_isolation.arcs(path, index, name, Q, threshold, window)
    return found, [period if len(one) and math.isfinite(one[0, 0]) else math.inf for one in found], ends


def around(
    path: RelativePath, index: int, name: str, q: Array, threshold: float, domain: tuple[float, float]
) -> tuple[float, float] | None:
    """Return the free interval of a coordinate around q's (n,) own value within a domain; None if it is in contact.

    Raises:
        UnsupportedError: If nothing is met over `isolation.MOST_TURNS` turns.
    """
    if path.is_plain:
        return isolation.around(path.minimal, index, name, q, threshold, domain)
    return piecewise_isolation.around(path, index, name, q, threshold, domain)
