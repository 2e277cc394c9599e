"""Proofs over a polytope: boxes that no face cuts off and no bound clears are halved; what remains is cut off."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from pinbound.certificates.records import OpenBox, Reason
from pinbound.certificates.search import Meter
from pinbound.freespace.draft import SHARE, Draft
from pinbound.freespace.pairs import Affine
from pinbound.freespace.quick_proofs import ProofTables, Stack
from pinbound.tolerances import INFLATION, UNIT_ROUNDOFF
from pinbound.typing import Array, Flags, Indices

__all__ = ["Boxes", "Prover"]


_BATCH = 8192
_FEW = 60_000
"""Boxes that NumPy bounds before machine code is used: small proofs are the same with and without it."""
_AT_ONCE = 200_000
"""Boxes that machine code bounds between two checks of the time; some 0.1 s."""
_COMPILING = 300_000
_TOGETHER = 8
_WEIGHINGS = 4
_SMALLEST = 2.0**-40
_COARSE = 0.25
"""Share of the change of a group's clearance over a box: a group with a larger error is left where it is not clear."""
_NARROW = 0.02
"""Share of the distance to the seed. If a box is this small, and its tangent plane is not well away from the seed, it
is cut off by a plane normal to the line from the seed."""


@dataclass(frozen=True)
class Boxes:
    """Boxes [low, high] (N, n), each for one pair; neighbours share their corners, so there is no gap."""

    which: Indices
    low: Array
    high: Array

    def __len__(self) -> int:
        """Return the number of boxes."""
        return len(self.which)

    def take(self, rows: Flags | slice | Indices) -> Boxes:
        """Return some of the boxes."""
        return Boxes(self.which[rows], self.low[rows], self.high[rows])

    def middles(self) -> tuple[Array, Array]:
        """Return centres, and half-widths that include the corners in spite of rounding."""
        centre = 0.5 * (self.low + self.high)
        half = np.maximum(self.high - centre, centre - self.low) * INFLATION
        return centre, half

    def halved(self, reach: Array) -> Boxes:
        """Halve each box in the coordinate with the largest `reach` (N, n)."""
        rows, across = np.arange(len(self)), np.argmax(reach, axis=1)
        middle = 0.5 * (self.low[rows, across] + self.high[rows, across])
        first, second = self.high.copy(), self.low.copy()
        first[rows, across] = middle
        second[rows, across] = middle
        return Boxes(
            np.concatenate([self.which, self.which]),
            np.concatenate([self.low, second]),
            np.concatenate([first, self.high]),
        )


@dataclass
class Prover:
    """A polytope while it is proven; faces are only added or moved inwards, so proven results stay true."""

    draft: Draft
    meter: Meter
    stuck: list[Boxes] = field(default_factory=list[Boxes])

    def __post_init__(self) -> None:
        """Store the bound of the rounding of `a . q`."""
        nothing = np.empty((0, len(self.draft.low)))
        self.left, self.unseen = Boxes(np.empty(0, np.intp), nothing, nothing), np.empty(0, np.intp)
        self.farthest = np.maximum(np.abs(self.draft.low), np.abs(self.draft.high))
        self.unit = 8.0 * (len(self.draft.low) + 2) * UNIT_ROUNDOFF
        self.bounded, self.tables = 0, ProofTables(self.draft.pairs)

    def rounding(self) -> Array:
        """Return a bound of the rounding of every `a . q - b` (m,)."""
        return self.unit * (np.abs(self.draft.A) @ self.farthest + np.abs(self.draft.b))

    def prove_all(self) -> bool:
        """Prove all pairs, those with few coordinates first; False if the budget, or rounding, left some undecided."""
        groups = self.draft.pairs.groups
        used = np.count_nonzero(self.draft.pairs.weights[groups.pair[groups.roots]], axis=1)
        order = groups.roots[np.lexsort((np.arange(len(used)), used))]
        for start in range(0, len(order), _TOGETHER):
            if not self.prove(order[start : start + _TOGETHER]):
                self.unseen = order[start + _TOGETHER :]
                return False
        return not self.stuck

    def open_boxes(self) -> tuple[OpenBox, ...]:
        """Return the boxes that are not proven."""
        reason = self.meter.spent() or Reason.ROUNDING
        whole = Boxes(
            self.unseen, np.tile(self.draft.low, (len(self.unseen), 1)), np.tile(self.draft.high, (len(self.unseen), 1))
        )
        found: list[OpenBox] = []
        for boxes, why in (*((one, Reason.ROUNDING) for one in self.stuck), (whole, reason), (self.left, reason)):
            for node, low, high in zip(boxes.which, boxes.low, boxes.high, strict=True):
                for pair in self.draft.pairs.groups.members[int(node)]:
                    found.append(OpenBox(self.draft.pairs.names[pair], low, high, -np.inf, why))
        return tuple(found)

    def prove(self, rows: Indices) -> bool:
        """Prove nodes `rows` of the pairs' groups free over the polytope; False if the budget ended the proof."""
        stack = Boxes(
            np.asarray(rows), np.tile(self.draft.low, (len(rows), 1)), np.tile(self.draft.high, (len(rows), 1))
        )
        self.left = stack
        while len(stack):
            if self.meter.spent():
                self.left = stack
                return False
            if self._is_quick(stack):
                stack = self._quick(stack)
                continue
            start = max(0, len(stack) - _BATCH)
            now, stack = stack.take(slice(start, None)), stack.take(slice(0, start))
            again = self._nearest_last(self._round(now))
            stack = _joined([stack, again])
        self.left = stack
        return True

    def _is_quick(self, stack: Boxes) -> bool:
        if self.bounded < _FEW or not np.all(self.tables.has(stack.which)):
            return False
        return self.tables.is_ready(_COMPILING, self.meter.budget.seconds - self.meter.seconds)

    def _shadows(self, own: Flags) -> tuple[Array, Array]:
        """Return what faces say about some coordinates, for any values of the others in the box, with rounding.

        From `a . q <= b` follows `a_own . q_own <= b - min (a_others . q_others)`. A face that the whole box satisfies
        gives nothing.
        """
        draft = self.draft
        others = np.where(own, 0.0, draft.A)
        least = np.maximum(others, 0.0) @ draft.low + np.minimum(others, 0.0) @ draft.high
        A, b = np.where(own, draft.A, 0.0), draft.b - least + 2.0 * self.rounding()
        most = np.maximum(A, 0.0) @ draft.high + np.minimum(A, 0.0) @ draft.low
        return A[most > b], b[most > b]

    def _quick(self, stack: Boxes) -> Boxes:
        """Return what machine code leaves of a stack: it clears and halves; boxes to cut off are handled here."""
        n, draft = stack.low.shape[1], self.draft
        found = self.tables.run(
            Stack(np.column_stack([stack.which.astype(np.float64), stack.low, stack.high])),
            self._shadows(self.tables.used_by(stack.which)),
            (draft.seed, self.farthest),
            (self.unit, draft.margin, SHARE, _SMALLEST),
            min(_AT_ONCE, self.meter.budget.boxes - self.meter.boxes),
        )
        self.meter.boxes += found.boxes
        left = Boxes(found.rows[:, 0].astype(np.intp), found.rows[:, 1 : 1 + n], found.rows[:, 1 + n :])
        if not found.is_stopped:
            return left
        return _joined([left.take(slice(0, -1)), self._round(left.take(slice(-1, None)))])

    def _nearest_last(self, boxes: Boxes) -> Boxes:
        """Return boxes in an order in which a stack gives the nearest to the seed first: its faces save most work."""
        away = np.maximum(np.maximum(boxes.low - self.draft.seed, self.draft.seed - boxes.high), 0.0)
        return boxes.take(np.argsort(-np.einsum("ni,ni->n", away, away), kind="stable"))

    def _round(self, boxes: Boxes) -> Boxes:
        self.meter.boxes, self.bounded = self.meter.boxes + len(boxes), self.bounded + len(boxes)
        boxes = boxes.take(~self._outside(boxes))
        centre, half = boxes.middles()
        found = self.draft.pairs.bound_nodes(boxes.which, centre, half)
        open_ = found.lower <= 0.0
        boxes, centre, half = boxes.take(open_), centre[open_], half[open_]
        found = _some(found, open_)
        if not len(boxes):
            return boxes
        open_ = self._weigh(found, centre, half) <= 0.0
        boxes, centre, half = boxes.take(open_), centre[open_], half[open_]
        found = _some(found, open_)
        if not len(boxes):
            return boxes
        groups = self.draft.pairs.groups
        reach = found.rest + np.einsum("ni,ni->n", np.abs(found.slope), half)
        is_group = boxes.which >= len(self.draft.pairs)
        slack = groups.extra[boxes.which]
        coarse = is_group & ((slack >= reach) | ((found.value <= 0.0) & (slack >= _COARSE * reach)))
        halves = boxes.take(coarse)
        asked = [Boxes(groups.halves[halves.which, side], halves.low, halves.high) for side in (0, 1)]
        asked = [one.take(one.which >= 0) for one in asked]
        split = is_group & ~coarse
        again = boxes.take(split).halved(self.draft.pairs.weights[groups.pair[boxes.which[split]]] * half[split])
        single = ~is_group
        boxes, half = self._cut(boxes.take(single), _some(found, single), centre[single], half[single])
        boxes = boxes.halved(self.draft.pairs.weights[boxes.which] * half)
        return _joined([*asked, again, boxes])

    def _outside(self, boxes: Boxes) -> Flags:
        """Return which boxes lie completely beyond a face."""
        centre, half = boxes.middles()
        least = centre @ self.draft.A.T - half @ np.abs(self.draft.A.T)
        return np.any(least > self.draft.b + self.rounding(), axis=1)

    def _weigh(self, found: Affine, centre: Array, half: Array) -> Array:
        """Return lower bounds (N,) over the parts of boxes in the polytope: faces weighed against the slope."""
        best, slope = found.lower.copy(), found.slope.copy()
        constant = found.value - found.rest
        room = self.draft.b + self.rounding()
        todo = np.arange(len(best))
        for _ in range(_WEIGHINGS):
            corner = centre[todo] - np.sign(slope[todo]) * half[todo]
            beyond = corner @ self.draft.A.T - room
            face = np.argmax(beyond, axis=1)
            useful = beyond[np.arange(len(todo)), face] > 0.0
            todo, face = todo[useful], face[useful]
            if not len(todo):
                break
            a, s, h = self.draft.A[face], slope[todo], half[todo]
            distance = room[face] - np.einsum("ni,ni->n", a, centre[todo])
            with np.errstate(divide="ignore", invalid="ignore"):
                weight = np.where(a != 0.0, -s / a, 0.0)
            weight = np.where(np.isfinite(weight) & (weight > 0.0), weight, 0.0)  # (N, n) candidates
            tried = np.abs(s[:, None] + weight[:, :, None] * a[:, None])  # (N, candidates, n)
            spread = np.matmul(tried, h[:, :, None])[:, :, 0] * INFLATION
            value = constant[todo, None] - weight * distance[:, None] - spread
            rows = np.arange(len(todo))
            pick = np.argmax(value, axis=1)
            chosen = weight[rows, pick]
            lost = self.unit * ((np.abs(s) + chosen[:, None] * np.abs(a)) @ self.farthest)
            slope[todo] = s + chosen[:, None] * a
            constant[todo] -= chosen * distance + lost
            best[todo] = np.maximum(best[todo], value[rows, pick] - lost)
            todo = todo[(best[todo] <= 0.0) & (chosen > 0.0)]
        return best

    def _cut(self, boxes: Boxes, found: Affine, centre: Array, half: Array) -> tuple[Boxes, Array]:
        """Cut off what halving cannot clear: boxes in contact that are small enough to be cut off by a face."""
        slope = found.slope
        flat = np.flatnonzero(~np.any(slope != 0.0, axis=1))
        slope = slope.copy()
        if len(flat):  # without an affine bound, the whole box is cut off, normal to the gradient
            slope[flat] = self.draft.pairs.gradients(boxes.which[flat], centre[flat])
        steep = np.linalg.norm(slope, axis=1)
        away = -np.einsum("ni,ni->n", slope, centre - self.draft.seed)  # times the slope: how far on the seed's side
        room = np.minimum(self.draft.margin * steep, SHARE * away)
        ripe = (found.rest <= 0.25 * room) & (found.value <= found.rest + 0.25 * room)
        own = self.draft.pairs.weights[boxes.which] > 0.0
        way = np.where(own, centre - self.draft.seed, 0.0)
        far = np.linalg.norm(way, axis=1)
        size = np.linalg.norm(np.where(own, half, 0.0), axis=1)
        small = ((found.value <= found.rest) & (size <= _NARROW * far)) | (size <= 0.1 * _NARROW * far)
        ripe &= steep > 0.0  # deep in contact there is no gradient: the box is halved until a radial face cuts it off
        radial = ~ripe & small & (away <= _NARROW * far * steep) & (far > 0.0)
        hopeless = np.max(np.where(own, half, 0.0), axis=1) < _SMALLEST
        is_flat = np.zeros(len(boxes), dtype=np.bool_)
        is_flat[flat] = True
        is_flat |= radial
        slope[radial] = -way[radial]
        steep[radial] = far[radial]
        room[radial] = 0.0
        ripe |= radial
        for row in np.flatnonzero(ripe).tolist():
            if self.meter.spent():
                break
            one, part = boxes.take(slice(row, row + 1)), _some(found, slice(row, row + 1))
            h = half[row : row + 1]
            if self._outside(one)[0] or self._weigh(part, centre[row : row + 1], h)[0] > 0.0:
                continue
            normal = -slope[row] / steep[row]
            bound = float(normal @ centre[row])
            if is_flat[row]:
                bound -= float(np.abs(normal) @ half[row]) + 0.25 * float(room[row] / steep[row])
            else:
                bound += float(found.value[row] - found.rest[row] - 0.5 * room[row]) / float(steep[row])
            if normal @ self.draft.seed < bound:
                self.draft.add(normal, bound, int(one.which[0]))
            else:
                self._cut_before(one, centre[row])
        if np.any(hopeless):
            self.stuck.append(boxes.take(hopeless))
        keep = ~hopeless
        boxes, half, found, centre = boxes.take(keep), half[keep], _some(found, keep), centre[keep]
        if np.any(ripe) and len(boxes):
            open_ = ~self._outside(boxes)
            open_[open_] = self._weigh(_some(found, open_), centre[open_], half[open_]) <= 0.0
            boxes, half = boxes.take(open_), half[open_]
        return boxes, half

    def _cut_before(self, one: Boxes, centre: Array) -> None:
        """Cut off a box deep in contact at the first contact on the straight line from the seed to it."""
        A, b, _ = self.draft.tangents(centre[None], one.which, self.draft.seed[None])
        if len(A) and A[0] @ self.draft.seed < b[0] < A[0] @ centre:
            self.draft.add(A[0], float(b[0]), int(one.which[0]))


def _joined(parts: Sequence[Boxes]) -> Boxes:
    return Boxes(
        np.concatenate([one.which for one in parts]),
        np.concatenate([one.low for one in parts]),
        np.concatenate([one.high for one in parts]),
    )


def _some(found: Affine, rows: Flags | slice) -> Affine:
    parts = (found.value, found.slope, found.rest, found.moved, found.lower, found.upper)
    return Affine(*(part[rows] for part in parts))
