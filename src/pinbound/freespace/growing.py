"""Faces that are likely to do: tangents of contact that cut off much contact and little else.

Nothing here is a proof: `proving` has that. From the seed, or another sample, towards a sample in contact the contact
of its pair is found by bisection, and the tangent there is a candidate. Of some hundred candidates the one is taken
that cuts off most contact for what it cuts off of all samples, until no sample in contact is left.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from pinbound.certificates.search import Meter
from pinbound.freespace.pairs import Pairs
from pinbound.robot.robot import Robot
from pinbound.typing import Array, Flags, Indices

__all__ = ["SHARE", "Grower"]


SHARE = 0.3
"""Of the distance from the seed to contact: a face keeps at most this much of it away from contact."""

_CANDIDATES = 256
_STEPS = 14
_ROUNDS = 4
_SCORING = 20_000


@dataclass
class Grower:
    """A polytope while faces are proposed."""

    robot: Robot
    pairs: Pairs
    seed: Array
    low: Array
    high: Array
    A: Array
    b: Array
    margin: float
    rng: np.random.Generator
    source: list[int] = field(default_factory=list[int])

    def __post_init__(self) -> None:
        """Know the boundaries, and which pair each is."""
        self.chosen = self.robot.boundaries.select(self.pairs.names)
        column = {name: index for index, name in enumerate(self.pairs.names)}
        self.order = np.array([column[name] for name in self.chosen.names], dtype=np.intp)

    def inside(self, Q: Array) -> Flags:
        """Return which of Q (N, n) keep all faces."""
        return np.all(Q @ self.A.T <= self.b, axis=1)

    def begin(self) -> None:
        """Add the tangents of pairs that the seed is close to contact of: they are needed, and spare much."""
        which = np.arange(len(self.pairs))
        seeds = np.tile(self.seed, (len(which), 1))
        value, slope = self.pairs.signed(which, seeds), self.pairs.slopes(which, seeds)
        square = np.einsum("ni,ni->n", slope, slope)
        with np.errstate(divide="ignore", invalid="ignore"):
            step = -2.0 * (value / square)[:, None] * slope
        near = np.flatnonzero(np.linalg.norm(step, axis=1) <= 2.0 * self.margin)
        near = near[self.pairs.signed(near, self.seed + step[near]) < 0.0] if len(near) else near
        for pair in near[np.argsort(np.linalg.norm(step[near], axis=1))].tolist():
            A, b, _ = self._tangents((self.seed + step[pair])[None], np.array([pair]), self.seed[None])
            if len(A):
                self.add(A[0], float(b[0]), pair)

    def sampled(self, count: int) -> Array:
        """Return up to `count` samples of the outer box that keep all faces."""
        Q = self.rng.uniform(self.low, self.high, (count, len(self.low)))
        return Q[self.inside(Q)]

    def contacts(self, Q: Array) -> tuple[Indices, Indices]:
        """Return the rows of Q in contact, and of each the pair that is deepest in it."""
        found = self.chosen.smallest(Q)
        rows = np.flatnonzero(np.asarray(found.clearance) <= 0.0)
        return rows, self.order[np.asarray(found.index)[rows]]

    def grow(self, samples: int, meter: Meter, until: float) -> None:
        """Add faces until fresh samples show no contact inside, or until so many seconds have gone."""
        for _ in range(_ROUNDS):
            Q = self.sampled(samples)
            if not len(Q) or meter.seconds >= until:
                return
            rows, which = self.contacts(Q)
            if not len(rows):
                return
            self._cover(Q[rows], which, self.sampled(_SCORING), meter, until)

    def _cover(self, X: Array, which: Indices, free: Array, meter: Meter, until: float) -> None:
        while len(X) and meter.seconds < until:
            A, b, source = self._candidates(X, which, free)
            if not len(A):
                return
            cut = A @ X.T > b[:, None]
            lost = np.count_nonzero(A @ free.T > b[:, None], axis=1) if len(free) else np.zeros(len(A))
            gain = np.count_nonzero(cut, axis=1)
            best = int(np.argmax(gain / (lost + 1.0 + 1e-3 * len(free))))
            if not gain[best]:
                return
            self.add(A[best], float(b[best]), int(source[best]))
            left = ~cut[best]
            X, which = X[left], which[left]
            free = free[free @ A[best] <= b[best]]

    def add(self, normal: Array, bound: float, source: int) -> None:
        """Add one face, of a pair."""
        self.A, self.b = np.vstack([self.A, normal]), np.append(self.b, bound)
        self.source.append(source)

    def _candidates(self, X: Array, which: Indices, free: Array) -> tuple[Array, Array, Indices]:
        rows = self.rng.integers(0, len(X), _CANDIDATES)
        x, pair = X[rows], which[rows]
        start = np.tile(self.seed, (len(rows), 1))
        if len(free):
            half = len(rows) // 2
            start[:half] = free[self.rng.integers(0, len(free), half)]
        return self._tangents(x, pair, start)

    def _tangents(self, x: Array, pair: Indices, start: Array) -> tuple[Array, Array, Indices]:
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
