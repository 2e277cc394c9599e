"""Sets proven for pairs over their own coordinates: intervals of one angle, or a tree of boxes.

Both hold several pairs that move by the same chain, the *slots*. A point is FREE if all slots are proven free there,
CONTACT if one is proven in contact, and UNDECIDED otherwise.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property

import numpy as np

from pinbound.tolerances import LIMIT, UNIT_ROUNDOFF
from pinbound.typing import Array, Codes, Flags, Indices
from pinbound.values import Value

__all__ = ["AngleSet", "BoxTree", "PairSet", "Where"]


class Where(IntEnum):
    """What is proven about a configuration.

    FREE: no boundary is in contact. CONTACT: at least one boundary is in contact. UNDECIDED: neither is proven.

    Example:
        >>> import pinbound as pb
        >>> robot = pb.load("minervabot_v3")
        >>> pb.pair_atlas(robot).where(robot.home) is pb.Where.FREE
        True
    """

    CONTACT = -1
    UNDECIDED = 0
    FREE = 1


@dataclass(frozen=True, eq=False)
class PairSet(Value):
    """Sets proven for m pairs over k coordinates, or for one pair over one angle.

    Attributes:
        volume: Volume of the searched box [rad^k, metres for a prismatic joint; rad for one angle].
        free: Lower bound of the volume where all pairs are free.
        contact: Lower bound of the volume where at least one pair is in contact.
        slot_free: (m,) lower bound of the volume where each pair is free.
        slot_contact: (m,) lower bound of the volume where each pair is in contact.
        work: The number of bounds computed, one for each box and pair, or group of pairs.
    """

    volume: float
    free: float
    contact: float
    slot_free: Array
    slot_contact: Array
    work: int

    @property
    def slots(self) -> int:
        """The number of pairs."""
        return len(self.slot_free)

    def where(self, Y: Array) -> Codes:
        """Return what is proven (N,) at values Y (N, k) of the coordinates: values of `Where`."""
        raise NotImplementedError

    def slots_where(self, Y: Array) -> Codes:
        """Return what is proven (N, m) about each pair."""
        raise NotImplementedError


@dataclass(frozen=True, eq=False)
class AngleSet(PairSet):
    """One pair of one effective angle `phi = c . y`: adjacent intervals of phi, each with what is proven in it.

    Attributes:
        coefficients: (k,) c.
        low: (k,) corner of the box of limits.
        high: (k,) corner.
        edges: (p + 1,) ends of the intervals [rad].
        codes: (p,) values of `Where`.
    """

    coefficients: Array
    low: Array
    high: Array
    edges: Array
    codes: Codes

    def where(self, Y: Array) -> Codes:
        """Return what is proven (N,) at values Y (N, k), in spite of the rounding of `c . y`."""
        inside = _within(Y, self.low, self.high)
        Y = np.where(inside[:, None], Y, 0.0)
        size = np.abs(Y) @ np.abs(self.coefficients)
        phi, error = Y @ self.coefficients, UNIT_ROUNDOFF * (len(self.coefficients) + 2) * size
        # An angle on an edge lies in both intervals, so it is undecided.
        least = np.searchsorted(self.edges, phi - error, side="left") - 1
        most = np.searchsorted(self.edges, phi + error, side="right") - 1
        known = inside & (least == most) & (least >= 0) & (least < len(self.codes))
        return np.where(known, self.codes[np.clip(least, 0, len(self.codes) - 1)], Where.UNDECIDED).astype(np.int8)

    def slots_where(self, Y: Array) -> Codes:
        """Return the proven result (N, 1) of the pair."""
        return self.where(Y)[:, None]


def _within(Y: Array, low: Array, high: Array) -> Flags:
    """Return which points keep the box of limits, by the one limit rule; points that are not finite do not."""
    return np.all((Y >= low - LIMIT) & (Y <= high + LIMIT), axis=1)


@dataclass(frozen=True, eq=False)
class BoxTree(PairSet):
    """Pairs over a box that is halved recursively: nodes in order of their levels, each box before its halves.

    Attributes:
        low: (k,) corner of the box of limits.
        high: (k,) corner.
        codes: (t,) for each node, the coordinate in which it is halved, or `FREE`, `CONTACT`, `OPEN`. The halves of the
            i-th halved node are the nodes 2 i + 1 and 2 i + 2; the first half has the lower values.
        touching: For each node in contact, the pair that is in contact.
        first: For each node in contact or open, the start of its list in `listed`, and one more entry. A single pair
            has no lists, because the codes are sufficient.
        listed: Lists of the pairs that are not proven free in each node, as rows of `members`.
        members: (g, m) the pairs of each row.
    """

    low: Array
    high: Array
    codes: Codes
    touching: Indices
    first: Indices
    listed: Indices
    members: Flags

    FREE = 120
    CONTACT = 121
    OPEN = 122

    @cached_property
    def _halves(self) -> Indices:
        """The first half of each halved node; the second half comes after it."""
        return 2 * np.cumsum(self.codes < self.FREE) - 1

    def leaves(self, Y: Array) -> Indices:
        """Return the leaf (N,) in which each of Y (N, k) lies; -1 outside the box."""
        inside = _within(Y, self.low, self.high)
        found = np.where(inside, 0, -1)
        rows = np.flatnonzero(inside)
        rows = rows[self.codes[found[rows]] < self.FREE]
        low, high = np.tile(self.low, (len(rows), 1)), np.tile(self.high, (len(rows), 1))
        y, node = Y[rows], np.zeros(len(rows), dtype=np.intp)
        while len(rows):
            each, across = np.arange(len(rows)), self.codes[node]
            middle = 0.5 * (low[each, across] + high[each, across])
            up = y[each, across] > middle
            low[each[up], across[up]] = middle[up]
            high[each[~up], across[~up]] = middle[~up]
            node = self._halves[node] + up
            found[rows] = node
            left = self.codes[node] < self.FREE
            rows, low, high, y, node = rows[left], low[left], high[left], y[left], node[left]
        return found

    def where(self, Y: Array) -> Codes:
        """Return the proven result (N,) of all pairs at points Y (N, k)."""
        leaf = self.leaves(Y)
        code = self.codes[leaf]
        found = np.where(code == self.FREE, Where.FREE, np.where(code == self.CONTACT, Where.CONTACT, Where.UNDECIDED))
        return np.where(leaf < 0, Where.UNDECIDED, found).astype(np.int8)

    def slots_where(self, Y: Array) -> Codes:
        """Return what is proven (N, m) about each pair: pairs on no list are free; one pair is in contact."""
        if self.slots == 1:
            return self.where(Y)[:, None]
        leaf = self.leaves(Y)
        found = np.full((len(Y), self.slots), Where.FREE, dtype=np.int8)
        found[leaf < 0] = Where.UNDECIDED
        unsure = np.flatnonzero((leaf >= 0) & (self.codes[leaf] != self.FREE))
        place = self._unsure[leaf[unsure]]
        length = self.first[place + 1] - self.first[place]
        row = np.repeat(unsure, length)
        start = np.repeat(self.first[place] - (np.cumsum(length) - length), length)
        rows, slots = np.nonzero(self.members[self.listed[np.arange(len(row)) + start]])
        found[row[rows], slots] = Where.UNDECIDED
        touched = np.flatnonzero((leaf >= 0) & (self.codes[leaf] == self.CONTACT))
        found[touched, self.touching[self._touched[leaf[touched]]]] = Where.CONTACT
        return found

    @cached_property
    def _unsure(self) -> Indices:
        """For each node, the number of nodes before it that are in contact or undecided."""
        return np.cumsum(self.codes > self.FREE) - 1

    @cached_property
    def _touched(self) -> Indices:
        """For each node, the number of nodes before it that are in contact."""
        return np.cumsum(self.codes == self.CONTACT) - 1

    @cached_property
    def boxes(self) -> tuple[Array, Indices]:
        """Corners (l, 2, k) of all leaves, and their node numbers."""
        level, nodes = np.stack([self.low, self.high])[None], np.zeros(1, dtype=np.intp)
        parts, numbers = list[Array](), list[Indices]()
        while len(level):
            split = self.codes[nodes] < self.FREE
            parts.append(level[~split])
            numbers.append(nodes[~split])
            across = self.codes[nodes[split]].astype(np.intp)
            each = np.repeat(level[split], 2, axis=0)
            rows = np.arange(len(across))
            middle = 0.5 * (each[2 * rows, 0, across] + each[2 * rows, 1, across])
            each[2 * rows, 1, across] = middle
            each[2 * rows + 1, 0, across] = middle
            first = self._halves[nodes[split]]
            level, nodes = each, np.stack([first, first + 1], axis=1).ravel()
        return np.concatenate(parts), np.concatenate(numbers)

    def boxes_of(self, where: Where) -> Array:
        """Return the corners (f, 2, k) of all boxes with this result."""
        corners, nodes = self.boxes
        code = {Where.FREE: self.FREE, Where.CONTACT: self.CONTACT, Where.UNDECIDED: self.OPEN}[where]
        return corners[self.codes[nodes] == code]
