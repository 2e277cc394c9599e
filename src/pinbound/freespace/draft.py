"""A polytope while it is made: what proposing faces and proving them share."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from pinbound.freespace.pairs import Pairs
from pinbound.typing import Array, Flags

__all__ = ["SHARE", "Draft"]

SHARE = 0.3
"""Of the distance from the seed to contact: a face keeps at most this much of it away from contact."""


@dataclass
class Draft:
    """`{A q <= b}` around a seed; faces are only added, so that what is proven of it stays so.

    Attributes:
        pairs: The boundaries that are searched.
        seed: (n,) inside.
        low: (n,) a corner of the box that holds the polytope.
        high: (n,) the other one.
        A: (m, n) normals.
        b: (m,) bounds [rad or m].
        margin: How far faces keep from contact, where there is room [rad or m].
        source: Of each face that was added, its pair.
    """

    pairs: Pairs
    seed: Array
    low: Array
    high: Array
    A: Array
    b: Array
    margin: float
    source: list[int] = field(default_factory=list[int])

    def add(self, normal: Array, bound: float, source: int) -> None:
        """Add one face, of a pair."""
        self.A, self.b = np.vstack([self.A, normal]), np.append(self.b, bound)
        self.source.append(source)

    def inside(self, Q: Array) -> Flags:
        """Return which of Q (N, n) keep all faces."""
        return np.all(Q @ self.A.T <= self.b, axis=1)
