"""Contacts along one coordinate that have no closed form: one entry point for all kinds of marks.

Two points have `|r|^2 - T^2`, whose derivatives have bounds up to the third order: `isolation`. All other marks have a
separation that is only piecewise smooth, and bounds over intervals: `piecewise_isolation`. `docs/hull-proofs.md` says
why.
"""

from __future__ import annotations

import math

from pinbound.limits import isolation, piecewise_isolation
from pinbound.path.relative import RelativePath
from pinbound.typing import Array

__all__ = ["arcs", "around"]


class _Points:
    """The roots of `|r|^2 - T^2`."""

    @staticmethod
    def arcs(
        path: RelativePath, index: int, name: str, Q: Array, threshold: float, window: tuple[float, float] | None
    ) -> tuple[list[Array], list[float], tuple[float, float]]:
        rows = [isolation.arcs(path.minimal, index, name, q, threshold, window) for q in Q]
        ends = rows[0][2] if rows else (-math.inf, math.inf)
        return [row[0] for row in rows], [row[1] for row in rows], ends

    @staticmethod
    def around(
        path: RelativePath, index: int, name: str, q: Array, threshold: float, domain: tuple[float, float]
    ) -> tuple[float, float] | None:
        return isolation.around(path.minimal, index, name, q, threshold, domain)


class _Pieces:
    """Pieces of the coordinate that are proven free, by bounds of the separation."""

    @staticmethod
    def arcs(
        path: RelativePath, index: int, name: str, Q: Array, threshold: float, window: tuple[float, float] | None
    ) -> tuple[list[Array], list[float], tuple[float, float]]:
        found, period, ends = piecewise_isolation.arcs(path, index, name, Q, threshold, window)
        return found, [period if len(one) and math.isfinite(one[0, 0]) else math.inf for one in found], ends

    around = staticmethod(piecewise_isolation.around)


def _of(path: RelativePath) -> type[_Points] | type[_Pieces]:
    """Return the method that isolates a path's contacts: the only function that asks for its case."""
    return _Points if path.is_plain else _Pieces


def arcs(
    path: RelativePath, index: int, name: str, Q: Array, threshold: float, window: tuple[float, float] | None
) -> tuple[list[Array], list[float], tuple[float, float]]:
    """Return, for each row of Q (N, n), the free intervals (k, 2) of a coordinate; their period; and the window.

    Raises:
        UnsupportedError: If nothing repeats and there is no finite window, or there are too many turns.
    """
    return _of(path).arcs(path, index, name, Q, threshold, window)


def around(
    path: RelativePath, index: int, name: str, q: Array, threshold: float, domain: tuple[float, float]
) -> tuple[float, float] | None:
    """Return the free interval of a coordinate around q's (n,) own value within a domain; None if it is in contact.

    Raises:
        UnsupportedError: If no contact is found over `isolation.MOST_TURNS` turns.
    """
    return _of(path).around(path, index, name, q, threshold, domain)
