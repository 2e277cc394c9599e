"""Pairs with the same rotations, over a box of their own coordinates, halved until it is proven free or in contact.

A box keeps the pairs, or groups of pairs, that are not proven free in it. Groups come first, among them balls about an
axis of the wrist, which depend on fewer joints. If a group is proven FREE, all its pairs are; other results of a group
say nothing about its pairs. The largest boxes come first, so that the nodes are in order of their levels.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pinbound.boundaries.boundary import Boundary
from pinbound.certificates.search import Meter
from pinbound.freespace.held import HeldPairs, Lists
from pinbound.freespace.pair_sets import BoxTree
from pinbound.freespace.pairs import Pairs
from pinbound.robot.robot import Robot
from pinbound.tolerances import INFLATION
from pinbound.typing import AnyArray, Array, Codes, Flags, Indices

__all__ = ["PairPaving"]

_MOST = 4096
_FEW = 256
"""Boxes that are bounded in one call: parts of the queue are joined up to this number."""


@dataclass
class _Part:
    """Boxes (c, 2, k) in the order of their nodes, with their lists, and the share of the whole box that each is."""

    boxes: Array
    lists: Lists
    share: Array

    def take(self, rows: slice) -> _Part:
        return _Part(self.boxes[rows], self.lists.take(rows), self.share[rows])


class PairPaving:
    """A box over the coordinates of some pairs, and the results in it so far."""

    def __init__(
        self,
        robot: Robot,
        members: Sequence[Boundary],
        columns: Indices,
        at: Array,
        ends: tuple[Array, Array, Array],
        meter: Meter,
    ) -> None:
        """Start with the box of limits.

        Args:
            robot: The robot.
            members: One pair; or pairs of points with the same rotations and without prismatic joints.
            columns: Indices in q of their coordinates, in the order of the boxes.
            at: (n,) any q: the values of the others do not matter.
            ends: (n,) each: corners of the box of limits, and by how much they may be passed.
            meter: The budget.
        """
        low, high, beside = ends
        self.columns, self.at, self.meter = columns, at, meter
        self.pairs = Pairs(robot, members, low - beside, high + beside)
        self.names = self.pairs.names
        self.low, self.high, self.beside = low[columns], high[columns], beside[columns]
        held = HeldPairs(self.pairs, columns, at, self.low, self.high, self.beside) if len(columns) else None
        slots = len(self.pairs)
        self.held = held if held is not None and len(held) == slots else None
        assert self.held is not None or slots == 1
        members_of = ((0,),) if self.held is None else self.held.groups.members
        self.members = np.zeros((len(members_of), slots), dtype=np.bool_)
        for node, some in enumerate(members_of):
            self.members[node, list(some)] = True
        whole = np.stack([self.low, self.high])[None]
        alone = Lists(*(np.array([x], dtype=np.intp) for x in (0, 0, 1)))
        lists = alone if self.held is None else self.held.first_lists(1)
        self.queue = deque([_Part(whole, lists, np.ones(1))])
        self.undecided = 1.0
        """The share of the box that is not decided."""
        self.closed = 0.0
        """The share of it that is, but for rounding, too narrow to be halved."""
        self.codes: list[Codes] = []
        self.touching: list[Indices] = []
        self.kept: list[Lists] = []
        self.free: list[float] = []
        self.contact: list[float] = []
        self.on_list, self.touched = np.zeros(len(members_of)), np.zeros(slots)
        self.work = 0

    @property
    def is_done(self) -> bool:
        """Whether no box is left that could be halved."""
        return not self.queue

    def step(self) -> None:
        """Bound some of the largest remaining boxes, and halve the undecided ones."""
        part = self._next()
        boxes, lists = part.boxes, part.lists
        contact, is_open, across, left, touching = self._decide(boxes, lists)
        is_halved, across = _splittable(boxes, across, is_open)
        code = np.where(is_halved, across, np.where(is_open, BoxTree.OPEN, BoxTree.FREE))
        code[contact] = BoxTree.CONTACT
        self.codes.append(code.astype(np.int8))
        size = np.prod(boxes[:, 1] - boxes[:, 0], axis=1)
        self.free.append(float(size[code == BoxTree.FREE].sum()))
        self.contact.append(float(size[contact].sum()))
        self._count(contact, touching[contact], size)
        self._keep(lists, left, contact, is_open & ~is_halved, size)
        self.undecided -= float(part.share[~is_open].sum())
        self.closed += float(part.share[is_open & ~is_halved].sum())
        if np.any(is_halved):
            halves = np.repeat(boxes[is_halved], 2, axis=0)
            rows, j = 2 * np.arange(len(halves) // 2), across[is_halved]
            middle = 0.5 * (halves[rows, 0, j] + halves[rows, 1, j])
            halves[rows, 1, j] = middle
            halves[rows + 1, 0, j] = middle
            twice = np.repeat(np.flatnonzero(is_halved), 2)
            self.queue.append(_Part(halves, left.take(twice), 0.5 * part.share[twice]))

    def _next(self) -> _Part:
        """Return the boxes at the head of the queue, at most as many as fit one call, with small parts joined."""
        most = _MOST if self.held is None else self.held.most_boxes
        parts, count = list[_Part](), 0
        while self.queue and (not parts or count + len(self.queue[0].boxes) <= _FEW):
            parts.append(self.queue.popleft())
            count += len(parts[-1].boxes)
        part = parts[0]
        if len(parts) > 1:
            lists = _joined([one.lists for one in parts])
            boxes = np.concatenate([one.boxes for one in parts])
            part = _Part(boxes, lists, np.concatenate([one.share for one in parts]))
        if count > most:
            self.queue.appendleft(part.take(slice(most, None)))
            part = part.take(slice(0, most))
        return part

    def _decide(self, boxes: Array, lists: Lists) -> tuple[Flags, Flags, Indices, Lists, Indices]:
        """Return for boxes: contact, undecided, where to halve, nodes that are not clear, and pairs in contact."""
        if self.held is not None:
            found = self.held.decide(boxes, lists, self.meter.budget.seconds - self.meter.seconds)
            self._worked(found.bounded)
            is_open = ~found.contact & (found.lists.length > 0)
            across, touching = np.where(is_open, found.across, 0), np.where(found.contact, found.across, 0)
            return found.contact, is_open, across, found.lists, touching
        count, n = len(boxes), len(self.at)
        centre, half = np.tile(self.at, (count, 1)), np.zeros((count, n))
        middle = 0.5 * (boxes[:, 0] + boxes[:, 1])
        centre[:, self.columns] = middle
        wide = np.maximum(boxes[:, 1] - middle, middle - boxes[:, 0]) * INFLATION + self.beside
        half[:, self.columns] = wide
        nothing = np.zeros(count, dtype=np.intp)
        seen = self.pairs.bound(nothing, centre, half)
        self._worked(count)
        contact = seen.upper < 0.0
        is_open = ~contact & ~(seen.lower > 0.0)
        across = np.zeros(count, dtype=np.intp)
        if boxes.shape[2]:
            across = np.argmax(self.pairs.weights[0, self.columns] * wide, axis=1)
        return contact, is_open, across, Lists(nothing[:1], nothing, is_open.astype(np.intp)), nothing

    def _worked(self, count: int) -> None:
        self.work += count
        self.meter.boxes += count

    def _count(self, contact: Flags, touching: Indices, size: Array) -> None:
        self.touching.append(touching)
        self.touched += np.bincount(touching, weights=size[contact], minlength=len(self.touched))

    def _keep(self, before: Lists, after: Lists, contact: Flags, closed: Flags, size: Array) -> None:
        """Keep the lists of boxes that are not halved: the old ones for contact, the remaining nodes if undecided."""
        rows = np.flatnonzero(contact | closed)
        if not len(rows) or len(self.touched) == 1:  # for one pair the code says everything
            return
        for some, lists in ((contact, before), (closed, after)):
            box, node = lists.take(some).rows()
            self.on_list += np.bincount(node, weights=size[some][box], minlength=len(self.on_list))
        if not np.any(closed):
            self.kept.append(_compact(before.take(rows)))
            return
        one_by_one = [(before if contact[row] else after).take(slice(row, row + 1)) for row in rows.tolist()]
        self.kept.append(_compact(_joined(one_by_one)))

    def finish(self) -> BoxTree:
        """Return the tree; all remaining boxes are undecided."""
        codes = [*self.codes, *(np.full(len(part.boxes), BoxTree.OPEN, dtype=np.int8) for part in self.queue)]
        kept, on_list = list(self.kept), self.on_list.copy()
        for part in self.queue:
            size = np.prod(part.boxes[:, 1] - part.boxes[:, 0], axis=1)
            box, node = part.lists.rows()
            on_list += np.bincount(node, weights=size[box], minlength=len(on_list))
            kept.append(_compact(part.lists))
        volume = float(np.prod(self.high - self.low))
        free, contact = math.fsum(self.free), math.fsum(self.contact)
        is_one = len(self.touched) == 1
        lists = Lists(*(np.zeros(0, dtype=np.intp) for _ in range(3)))
        if kept and not is_one:
            lists = _compact(_joined(kept))
        first = np.concatenate([[0], np.cumsum(lists.length)]).astype(np.intp)
        slot_free = np.array([free]) if is_one else np.maximum(0.0, volume - on_list @ self.members)
        return BoxTree(
            volume=volume,
            free=free,
            contact=contact,
            slot_free=slot_free,
            slot_contact=self.touched.copy(),
            work=self.work,
            low=self.low,
            high=self.high,
            codes=np.concatenate(codes),
            touching=np.concatenate([np.empty(0, dtype=np.intp), *self.touching]),
            first=first,
            listed=lists.nodes,
            members=self.members,
        )


def _splittable(boxes: Array, across: Indices, is_open: Flags) -> tuple[Flags, Indices]:
    """Return which undecided boxes can be halved, and in which coordinate: another one if the first is too narrow."""
    middle = 0.5 * (boxes[:, 0] + boxes[:, 1])
    can = (boxes[:, 0] < middle) & (middle < boxes[:, 1])
    if not boxes.shape[2]:
        return np.zeros(len(boxes), dtype=np.bool_), across
    rows = np.arange(len(boxes))
    stuck = is_open & ~can[rows, across]
    if np.any(stuck):
        widest = np.argmax(np.where(can, boxes[:, 1] - boxes[:, 0], -1.0), axis=1)
        across = np.where(stuck, widest, across)
    return is_open & can[rows, across], across


def _compact(lists: Lists) -> Lists:
    """Return the same lists, one after the other, so that no boxes share a list."""
    _, node = lists.rows()
    return Lists(node, np.cumsum(lists.length) - lists.length, lists.length)


def _joined(parts: Sequence[Lists]) -> Lists:
    """Return the lists of all parts."""
    known: dict[int, int] = {}
    nodes, first, total = list[AnyArray](), list[AnyArray](), 0
    for one in parts:
        key = id(one.nodes)
        if key not in known:
            known[key] = total
            nodes.append(one.nodes)
            total += len(one.nodes)
        first.append(one.first + known[key])
    length: Any = np.concatenate([one.length for one in parts])
    return Lists(np.concatenate(nodes), np.concatenate(first), length)
