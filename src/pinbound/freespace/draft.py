"""A polytope while it is made: the data that the proposal and the proof of faces share."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from pinbound.freespace.pairs import Pairs
from pinbound.typing import Array, Flags, Indices

__all__ = ["SHARE", "Draft"]

SHARE = 0.3
"""Share of the distance from the seed to contact: a face keeps at most this much of it away from contact."""
_STEPS = 14


@dataclass
class Draft:
    """`{A q <= b}` around a seed; faces are only added, so what is proven of it stays true.

    Attributes:
        pairs: The boundaries that need a search.
        seed: (n,) the configuration inside.
        low: (n,) lower corner of the box that contains the polytope.
        high: (n,) upper corner.
        A: (m, n) normals.
        b: (m,) bounds [rad or m].
        margin: The distance that faces keep from contact, if there is room [rad or m].
        source: For each added face, its pair.
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
        """Return tangents of contact between `start` and x, slightly on the seed's side, and their pairs."""
        rows = x
        inside, outside = np.zeros(len(rows)), np.ones(len(rows))
        for _ in range(_STEPS):  # the point where the line first meets contact, if there is only one contact
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
