"""Colours of names: those of Okabe and Ito; a boundary has the same colour on a whole page."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pinbound.region import Region

__all__ = ["PALETTE", "ink", "order_of", "style_of"]

PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7F6000", "#000000")
_LINES = ("-", (0, (4, 1.2)), (0, (1, 1)), (0, (5, 1, 1, 1)))
_INK = 0.6  # of a colour's light: text in this colour has a contrast of 4.5 with white and with a region's fill


def order_of(region: Region | None, boundaries: Sequence[str]) -> tuple[str, ...]:
    """Return the order in which names get their colours: the edges of a region, then the other boundaries.

    Args:
        region: The region of a page; None if there is none.
        boundaries: Names of the robot's boundaries.
    """
    edges = {edge.name for edge in region.edges} if region is not None else set[str]()
    parts = (edges, set(boundaries) - edges)
    return tuple(name for part in parts for name in sorted(part, key=lambda name: (len(name), name)))


def style_of(name: str, order: Sequence[str]) -> dict[str, Any]:
    """Return colour and line style of a name in `order_of`; after eight names the colours repeat, dashed, then dotted.

    Example:
        >>> style_of("b", ("a", "b"))
        {'color': '#D55E00', 'linestyle': '-'}
    """
    index = list(order).index(name)
    return {"color": PALETTE[index % len(PALETTE)], "linestyle": _LINES[index // len(PALETTE) % len(_LINES)]}


def ink(colour: str) -> tuple[float, ...]:
    """Return a colour dark enough for text."""
    from matplotlib.colors import to_rgb

    return tuple(_INK * part for part in to_rgb(colour))
