"""The interface of constraints, and their results."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from pinbound.bounds.bounds import Expansion
from pinbound.typing import Array, Flags, Indices

__all__ = ["Enclosure", "Family", "angle_range"]


@dataclass(frozen=True)
class Enclosure:
    """The results for N parts.

    Attributes:
        value: (N,) signed clearance in the middle, as computed [m, or rad for limits].
        lower: (N,) proven lower bound over the part.
        error: (N,) rounding bound of `value`.
        clear: (N,) whether the part is proven free.
        violated: (N,) whether the middle is proven to violate the constraint.
        settled: (N,) whether halving gives no more information: the remaining width of the part is below rounding.
    """

    value: Array
    lower: Array
    error: Array
    clear: Flags
    violated: Flags
    settled: Flags


class Family(Protocol):
    """Constraints of one kind, over one extent of q."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the constraints."""
        ...

    @property
    def weights(self) -> Array:
        """(m, n): how much each coordinate moves the bounded quantity, to choose where a box is halved."""
        ...

    def enclose(self, which: Indices, part: Expansion, rows: Indices) -> Enclosure:
        """Return the enclosures of constraints `which` (N,) on the parts `rows` (N,) of `part`."""
        ...

    def enclose_box(self, which: Indices, centre: Array, half: Array) -> Enclosure:
        """Return the enclosures of constraints `which` on boxes `centre +- half`."""
        ...

    def signed(self, Q: Array) -> Array:
        """Return the signed clearances (N, m) at configurations, as computed."""
        ...

    def clearance(self, row: int, q: Array) -> float:
        """Return the signed clearance of one constraint at one q (n,)."""
        ...


def angle_range(C: Array, which: Indices, part: Expansion, rows: Indices) -> tuple[Array, Array, Array]:
    """Return `c . q` in the middle, and its smallest and largest value, (N,) each."""
    if len(part.middle) * len(C) <= 2 * len(which):  # all constraints on all parts: one product, then look up
        phi = part.values @ C.T
        wide = np.broadcast_to(part.value_radius @ np.abs(C.T), (len(part.middle), len(C)))
        tables = part.middle @ C.T, phi.min(axis=1) - wide, phi.max(axis=1) + wide
        middle, low, high = (table[rows, which] for table in tables)
        return middle, low, high
    c, values = C[which], part.values[rows]
    phi = np.einsum("ni,npi->np", c, values)
    radius = part.value_radius[rows] if part.value_radius.ndim > 1 else part.value_radius
    wide = np.einsum("ni,ni->n", np.abs(c), np.broadcast_to(radius, c.shape))
    return np.einsum("ni,ni->n", c, part.middle[rows]), phi.min(axis=1) - wide, phi.max(axis=1) + wide
