"""Proposed faces: tangents of contact that cut off much contact and little else.

Nothing here is a proof; `proving` has the proofs. From the seed, or another sample, towards a sample in contact,
bisection finds the contact of its pair. The tangent there is a candidate. From some hundred candidates the best one is
taken: it cuts off many samples in contact, compared with all samples that it cuts off. This is repeated until no sample
in contact is left.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pinbound.certificates.search import Meter
from pinbound.freespace.draft import Draft
from pinbound.robot.robot import Robot
from pinbound.typing import Array, Indices

__all__ = ["Grower"]


_CANDIDATES = 256
_ROUNDS = 4
_SCORING = 20_000


@dataclass
class Grower:
    """A polytope while faces are proposed."""

    draft: Draft
    robot: Robot
    rng: np.random.Generator

    def __post_init__(self) -> None:
        """Store the boundaries, and the number of each pair."""
        self.chosen = self.robot.boundaries.select(self.draft.pairs.names)
        column = {name: index for index, name in enumerate(self.draft.pairs.names)}
        self.order = np.array([column[name] for name in self.chosen.names], dtype=np.intp)

    def begin(self) -> None:
        """Add the tangents of pairs to whose contact the seed is close: they are needed, and save much work."""
        which = np.arange(len(self.draft.pairs))
        seeds = np.tile(self.draft.seed, (len(which), 1))
        value, slope = self.draft.pairs.signed(which, seeds), self.draft.pairs.slopes(which, seeds)
        square = np.einsum("ni,ni->n", slope, slope)
        with np.errstate(divide="ignore", invalid="ignore"):
            step = -2.0 * (value / square)[:, None] * slope
        near = np.flatnonzero(np.linalg.norm(step, axis=1) <= 2.0 * self.draft.margin)
        near = near[self.draft.pairs.signed(near, self.draft.seed + step[near]) < 0.0] if len(near) else near
        for pair in near[np.argsort(np.linalg.norm(step[near], axis=1))].tolist():
            A, b, _ = self.draft.tangents((self.draft.seed + step[pair])[None], np.array([pair]), self.draft.seed[None])
            if len(A):
                self.draft.add(A[0], float(b[0]), pair)

    def sampled(self, count: int) -> Array:
        """Return up to `count` samples of the outer box that are within all faces."""
        Q = self.rng.uniform(self.draft.low, self.draft.high, (count, len(self.draft.low)))
        return Q[self.draft.inside(Q)]

    def contacts(self, Q: Array) -> tuple[Indices, Indices]:
        """Return the rows of Q in contact, and for each the pair in deepest contact."""
        found = self.chosen.smallest(Q)
        rows = np.flatnonzero(np.asarray(found.clearance) <= 0.0)
        return rows, self.order[np.asarray(found.index)[rows]]

    def grow(self, samples: int, meter: Meter, until: float) -> None:
        """Add faces until new samples show no contact inside, or until `until` seconds."""
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
            self.draft.add(A[best], float(b[best]), int(source[best]))
            left = ~cut[best]
            X, which = X[left], which[left]
            free = free[free @ A[best] <= b[best]]

    def _candidates(self, X: Array, which: Indices, free: Array) -> tuple[Array, Array, Indices]:
        rows = self.rng.integers(0, len(X), _CANDIDATES)
        x, pair = X[rows], which[rows]
        start = np.tile(self.draft.seed, (len(rows), 1))
        if len(free):
            half = len(rows) // 2
            start[:half] = free[self.rng.integers(0, len(free), half)]
        return self.draft.tangents(x, pair, start)
