"""Lower bounds, over all q, of the distance of two marks, or of two groups of marks on two links.

In a reduced chain `r = b_0 + R_1(b_1 + R_2(...))`, `|r| >= 2 max |b_i| - sum |b_i|` holds for all rotations: the
longest offset minus all others. If a mark is a body, b_i varies with its parameters t in [0, 1] about a middle. Each of
its edge vectors reduces the bound by at most half its length, once for each offset. With one rotation about u, the
least distance of two points is `sqrt((u . (b_0 + b_1))^2 + (|b_0| - |b_1|)^2)`, with lengths perpendicular to u. Bodies
are then divided into cells, each in a ball.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from itertools import product

import numpy as np

from pinbound.annotations import Mark, Sweep
from pinbound.evaluate import separation
from pinbound.limits import univariate
from pinbound.model.coupling import Coupling
from pinbound.model.tree import Tree
from pinbound.path.chain import HullChain
from pinbound.path.relative import RelativePath, minimal_chain
from pinbound.tolerances import NEVER_MEETS
from pinbound.typing import Array, Flags

__all__ = ["MOST_PATHS", "Reach", "least_separation"]

MOST_PATHS = 20
"""Pairs of marks of one pair of links that are examined one by one; each takes a millisecond."""
_TURNS = 64
"""Angles of a full turn at which a separation is computed before it is bounded for all angles."""
_MOST_BALLS = 64
"""The largest number of balls that hold a mark."""


def least_separation(path: RelativePath, enough: float = -np.inf) -> float:
    """Return a lower bound of a path's norm over all q [m]: exact for one angle, else by the triangle inequality.

    It is minus infinity if a value not above `enough` was found; then no bound is computed.
    """
    chain = path.minimal
    if np.any(chain.slides):
        return 0.0
    if chain.rotations == 1 and math.isfinite(enough):
        c = chain.coefficients[0]
        turn: Array = np.linspace(-np.pi, np.pi, _TURNS + 1)[1:, None] * (c / (c @ c))
        if np.any(separation.separations(path, turn) <= enough):
            return -np.inf
    single = univariate.one_angle_smallest(path)
    if single is not None:
        return single
    # For lines and planes only a part of r counts, so the length of r bounds nothing.
    return -np.inf if path.projection is not None else _triangle(path.difference)


def _triangle(difference: HullChain) -> float:
    """Return the longest offset minus all others, the least over all t [m]; 0 if the chain has prismatic joints."""
    chain = difference.chain
    if np.any(chain.slides):
        return 0.0
    edges, split = np.array(difference.directions).reshape(-1, *chain.offsets.shape), difference.corners[0].shape[1]
    centre, around = chain.offsets, 0.0
    for corners, own in zip(difference.corners, (edges[:split], edges[split:]), strict=True):
        middle = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
        centre = centre + np.tensordot(middle, own, axes=1)
        around += np.sum(np.linalg.norm(np.tensordot(corners - middle, own, axes=1), axis=2).max(axis=0))
    lengths = np.linalg.norm(centre, axis=1)
    return float(np.max(2.0 * lengths) - np.sum(lengths) - around)


class Reach:
    """Two links, and a test of which marks on one can never meet which marks on the other.

    The chain between the links is reduced once, with both end points as variables: its offsets are linear in the ends.
    """

    def __init__(self, tree: Tree, coupling: Coupling, link_a: str, link_b: str) -> None:
        """Take the two links; there must be no free joint between them."""
        self._tree, self._coupling, self._links = tree, coupling, (link_a, link_b)

    @cached_property
    def _chain(self) -> HullChain | None:
        """The chain with both ends at the links' origins, and how they move it; None if there are prismatic joints."""
        x, y, z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
        ends = [Sweep("", link, (0.0, 0.0, 0.0), (x, y, z)) for link in self._links]
        difference = minimal_chain(self._tree, self._coupling, ends[0], ends[1])
        return None if np.any(difference.chain.slides) else difference

    def never_meet(self, marks_a: Sequence[Mark], marks_b: Sequence[Mark]) -> bool:
        """Return whether every pair of marks is proven to stay apart over all q; never for lines and planes."""
        if self._chain is None or any(mark.shape.is_unbounded for mark in (*marks_a, *marks_b)):
            return False
        left = np.argwhere(~self.apart(marks_a, marks_b))
        return len(left) <= MOST_PATHS and all(self._stays_apart(marks_a[i], marks_b[j]) for i, j in left.tolist())

    def apart(self, marks_a: Sequence[Mark], marks_b: Sequence[Mark]) -> Flags:
        """Return which pairs the open chain proves apart, (len(marks_a), len(marks_b)); none with lines or planes."""
        return self.gaps(marks_a, marks_b) > NEVER_MEETS

    def gaps(self, marks_a: Sequence[Mark], marks_b: Sequence[Mark]) -> Array:
        """Return lower bounds of the gaps of all pairs over all q (len(marks_a), len(marks_b)) [m].

        They are minus infinity for lines and planes, and if prismatic joints are between the links. They do not include
        rounding.
        """
        if self._chain is None or not len(marks_a) or not len(marks_b):
            return np.full((len(marks_a), len(marks_b)), -np.inf)
        flat = [np.array([mark.shape.is_unbounded for mark in marks]) for marks in (marks_a, marks_b)]
        return np.where(flat[0][:, None] | flat[1], -np.inf, self._bounded(marks_a, marks_b))

    def _bounded(self, marks_a: Sequence[Mark], marks_b: Sequence[Mark]) -> Array:
        assert self._chain is not None
        offsets, directions = self._chain.chain.offsets, np.array(self._chain.directions)
        gaps = np.empty((len(marks_a), len(marks_b)))
        if self._chain.chain.rotations == 1:
            axis, balls_b = self._chain.chain.axes[0], [_balls(mark) for mark in marks_b]
            for (row, a), (column, (to, thick)) in product(enumerate(map(_balls, marks_a)), enumerate(balls_b)):
                moved = offsets + np.tensordot(a[0], directions[:3], axes=1)[:, None]
                moved = moved + np.tensordot(to, directions[3:], axes=1)
                least = _over_a_turn(axis, moved[..., 0, :], moved[..., 1, :])
                gaps[row, column] = np.min(least - a[1][:, None] - thick)
            return gaps
        middle_a, around_a = _spread(marks_a, directions[:3])
        middle_b, around_b = _spread(marks_b, directions[3:])
        radii = np.array([m.shape.radius for m in marks_a])[:, None] + np.array([m.shape.radius for m in marks_b])
        for row in range(len(marks_a)):
            lengths = np.linalg.norm(offsets + middle_a[row] + middle_b, axis=2)
            least = 2.0 * np.max(lengths, axis=1) - np.sum(lengths, axis=1) - around_a[row] - around_b
            gaps[row] = least - radii[row]
        return gaps

    def is_all(self, marks_a: Sequence[Mark], marks_b: Sequence[Mark]) -> Flags:
        """Return for which pairs (len(marks_a), len(marks_b)) `gaps` is all that `least_separation` can prove.

        The chain of a pair is the open chain with its end points inserted. There is one exception: if a mark is on the
        axis of the first or last rotation, this rotation changes nothing and is removed. A chain with one rotation has
        a better bound of its own.
        """
        chain = None if self._chain is None else self._chain.chain
        if chain is None or chain.rotations <= 1:
            return np.zeros((len(marks_a), len(marks_b)), dtype=np.bool_)
        assert self._chain is not None
        directions, found = np.array(self._chain.directions), np.ones((len(marks_a), len(marks_b)), dtype=np.bool_)
        for place, axis in ((0, chain.axes[0]), (chain.rotations, chain.axes[-1])):
            across = np.eye(3) - np.outer(axis, axis)
            (a, wide), (b, thick) = (
                _across(marks, part[:, place] @ across)
                for marks, part in ((marks_a, directions[:3]), (marks_b, directions[3:]))
            )
            far = np.linalg.norm(chain.offsets[place] @ across + a[:, None] + b, axis=2)
            found &= np.maximum(far, np.maximum(wide[:, None], thick)) > NEVER_MEETS * max(1.0, chain.scale)
        return found

    def _stays_apart(self, a: Mark, b: Mark) -> bool:
        """Return whether two marks are proven to stay apart by their own chain, which may be shorter."""
        threshold = a.shape.radius + b.shape.radius + NEVER_MEETS
        difference = minimal_chain(self._tree, self._coupling, a, b)
        if _triangle(difference) > threshold:
            return True
        chain = difference.chain
        if chain.rotations != 1 or difference.directions or np.any(chain.slides):
            return False
        return float(_over_a_turn(chain.axes[0], chain.offsets[0], chain.offsets[1])) > threshold


def _over_a_turn(axis: Array, p: Array, s: Array) -> Array:
    """Return the least of `|p + R(u, phi) s|` over phi, row by row [m]."""
    along = (p + s) @ axis
    across = [np.linalg.norm(one - (one @ axis)[..., None] * axis, axis=-1) for one in (p, s)]
    return np.hypot(along, across[0] - across[1])


def _balls(mark: Mark) -> tuple[Array, Array]:
    """Return balls (m, 3), (m,) whose union holds a mark: one for each cell; the cells are about as long as wide."""
    shape = mark.shape
    if not len(shape.directions) or not shape.is_zonotope:
        return shape.middle[None], np.array([shape.radius + shape.around])
    edges = shape.directions
    counts, lengths = np.ones(len(edges), dtype=int), np.linalg.norm(edges, axis=1)
    while np.prod(counts) * 2 <= _MOST_BALLS:
        counts[int(np.argmax(lengths / counts))] *= 2
    cells = np.indices(tuple(counts.tolist())).reshape(len(edges), -1).T
    centres = shape.origin + ((cells + 0.5) / counts) @ edges
    around = 0.5 * float(np.sum(lengths / counts))  # the sum of half the edges of a cell
    return centres, np.full(len(centres), shape.radius + around)


def _across(marks: Sequence[Mark], directions: Array) -> tuple[Array, Array]:
    """Return the marks' middles along three directions (m, 3), and how far their vertices are from there."""
    middles = np.array([mark.shape.middle for mark in marks])
    wide = [float(np.linalg.norm((m.shape.vertices - m.shape.middle) @ directions, axis=1).max()) for m in marks]
    return middles @ directions, np.array(wide)


def _spread(marks: Sequence[Mark], directions: Array) -> tuple[Array, Array]:
    """Return how much each mark's middle moves the offsets (m, k, 3), and by how much its body widens them (m,)."""
    middles, around = np.empty((len(marks), *directions.shape[1:])), np.empty(len(marks))
    for row, mark in enumerate(marks):
        middle = mark.shape.middle
        middles[row] = np.tensordot(middle, directions, axes=1)
        spokes = np.tensordot(mark.shape.vertices - middle, directions, axes=1)
        around[row] = np.linalg.norm(spokes, axis=2).max(axis=0).sum()
    return middles, around
