"""A polytope while it is made: what proposing faces and proving them share."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from pinbound.freespace.pairs import Pairs
from pinbound.typing import Array, Flags, Indices

__all__ = ["SHARE", "Draft"]

SHARE = 0.3
"""Of the distance from the seed to contact: a face keeps at most this much of it away from contact."""
_STEPS = 14


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

    def tangents(self, x: Array, pair: Indices, start: Array) -> tuple[Array, Array, Indices]:
        """Return tangents of contact on the ways from `start` to x, a little on the seed's side, and of which pair."""
        rows = x
        inside, outside = np.zeros(len(rows)), np.ones(len(rows))
        for _ in range(_STEPS):  # where the way there first is in contact, if there is one contact only
            middle = 0.5 * (inside + outside)
            free_there = self.pairs.signed(pair, start + middle[:, None] * (x - start)) > 0.0
            inside, outside = np.where(free_there, middle, inside), np.where(free_there, outside, middle)
        y = start + inside[:, None] * (x - start)
        slope = self.pairs.slopes(pair, y)
        length = np.linalg.norm(slope, axis=1)
        keep = length > 1e-9
        A = -slope[keep] / length[keep, None]
        away = np.einsum("ni,ni->n", A, y[keep] - self.seed)
        b = A @ self.seed + away - np.minimum(self.margin, SHARE * away)
        held = away > 1e-9
        return A[held], b[held], pair[keep][held]
