"""Branch and bound over the parts of a motion, as arrays: cut the parts that are neither clear nor violated.

All open parts of all constraints of a family are bounded in one call and cut together. A part leaves the list in three
cases: it is proven clear and cannot contain the smallest clearance; it is after the first contact; or halving it cannot
help, because its remaining width is below rounding.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import cast

import numpy as np

from pinbound.bounds.bounds import Expansion
from pinbound.certificates.distances import ManyAngleBoundaries
from pinbound.certificates.enclosures import Enclosure, Family
from pinbound.certificates.lifted import LiftedTrajectory, told
from pinbound.certificates.limits import Limits
from pinbound.certificates.one_angle import OneAngleBoundaries
from pinbound.certificates.polynomials import Polynomials, Trajectory, is_straight
from pinbound.certificates.records import Budget, Contact, Findings, OpenPart, Reason
from pinbound.certificates.swept import SweptBoundaries
from pinbound.exceptions import DimensionError
from pinbound.tolerances import FIRST_CONTACT
from pinbound.typing import Array, Flags, Indices
from pinbound.values import owned

__all__ = ["Meter", "Search"]

_BATCH = 2**14
_NARROWEST = 2.0**-48
_A_SECOND = 5e6  # a low estimate of the boxes that machine code bounds in a second
_WAYS = ((32, 8), (256, 4))
_WAYS_IN_CODE = ((8, 32), (32, 16), (128, 8), (512, 4))  # if machine code bounds a part in microseconds
_REASONS = tuple(Reason)
_NONE = owned(np.zeros(0, dtype=np.intp))


@dataclass
class Meter:
    """The part of its budget that a certificate has used."""

    budget: Budget
    boxes: int = 0
    started: float = field(default_factory=time.perf_counter)

    def __post_init__(self) -> None:
        """Refuse a budget that is none.

        Raises:
            DimensionError: If it is no `Budget`.
        """
        if not isinstance(cast(object, self.budget), Budget):
            raise DimensionError(f"the budget is {self.budget!r}; give pinbound.Budget(boxes=..., seconds=...)")

    @property
    def seconds(self) -> float:
        """Wall time so far."""
        return time.perf_counter() - self.started

    def spent(self) -> Reason | None:
        """Return which part of the budget is spent, or None."""
        if self.boxes >= self.budget.boxes:
            return Reason.BOXES
        return Reason.TIME if self.seconds >= self.budget.seconds else None


@dataclass(frozen=True)
class _Parts:
    """Parts [a, b] of pieces, each for one constraint."""

    piece: Indices
    which: Indices
    a: Array
    b: Array

    def __len__(self) -> int:
        return len(self.piece)

    def take(self, rows: Flags | slice) -> _Parts:
        return _Parts(self.piece[rows], self.which[rows], self.a[rows], self.b[rows])

    def cut(self, is_coded: bool) -> _Parts:
        """Cut each part into equal ones; few parts are cut into more, because a round costs as much as some parts.

        Parts are dyadic, so their ends are exact, and neighbours share them without a gap.
        """
        ways = next((ways for most, ways in (_WAYS_IN_CODE if is_coded else _WAYS) if len(self) <= most), 2)
        steps = np.arange(ways + 1) / ways
        edges = self.a + (self.b - self.a) * steps[:, None]
        edges[-1] = self.b
        piece, which = np.tile(self.piece, ways), np.tile(self.which, ways)
        return _Parts(piece, which, edges[:-1].ravel(), edges[1:].ravel())


class Search:
    """The results for the constraints of one family along one motion."""

    def __init__(
        self, family: Family, trajectory: Trajectory, meter: Meter, precision: float | None, best: float = np.inf
    ) -> None:
        """Start without results, except that some clearance elsewhere is at most `best`.

        `precision` [m] is requested for the smallest clearance; None: the precision that the verdict needs.
        """
        self.family, self.is_coded = family, False
        if isinstance(family, SweptBoundaries):
            self.family, self.is_coded = family.within(meter.budget.seconds), family.is_coded
        self.trajectory, self.meter = trajectory, meter
        self.precision, self.elsewhere = np.inf if precision is None else precision, best
        m = len(family.names)
        self.lower, self.best, self.first = np.full((3, m), np.inf)
        self.best_piece: Indices = np.zeros(m, np.intp)
        self.first_piece: Indices = np.zeros(m, np.intp)
        self.best_u, self.first_u, self.first_value = np.zeros((3, m))
        self.has_contact = False
        self.open: list[tuple[_Parts, Array, Indices]] = []
        self.unseen: tuple[float, Indices, Reason] | None = None
        starts = trajectory.starts
        self.origin, self.total = float(starts[0]), float(starts[-1] + trajectory.durations[-1] - starts[0])

    def run(self, each: bool, rows: Indices | None = None) -> None:
        """Search until everything is decided, or the budget is spent.

        Args:
            each: Whether every constraint gets tight bounds of its smallest clearance, not only the smallest of all.
            rows: The constraints to examine; None: all of them, by quick methods first.
        """
        active = self._quick(self._sweep(each), each) if rows is None else rows
        pieces = len(self.trajectory.starts)
        m = len(active)
        if not m:
            return
        step = max(1, _BATCH // m)
        for start in range(0, pieces, step):  # the knots first, because contacts there save much work
            if self.meter.spent():
                break
            self._knots(active, np.arange(start, min(start + step, pieces)), last=start + step >= pieces)
        for start in range(0, pieces, step):
            piece = np.repeat(np.arange(start, min(start + step, pieces)), m)
            which = np.tile(active, len(piece) // m)
            parts = _Parts(piece, which, np.zeros(len(piece)), np.ones(len(piece)))
            while len(parts):
                reason = self.meter.spent()
                if reason:
                    self._give_up(parts, active, reason)
                    return
                batches: list[_Parts] = []
                batch = _BATCH * 2 // (1 + max(1, self.trajectory.degree))
                for i in range(0, len(parts), batch):
                    if i and self.meter.spent():  # the rest of the round is left open
                        batches.append(parts.take(slice(i, len(parts))))
                        break
                    batches.append(self._round(parts.take(slice(i, i + batch)), each))
                parts = batches[0] if len(batches) == 1 else _joined(batches)

    def _sweep(self, each: bool) -> Indices:
        """Decide what one bound of the whole motion decides; return the constraints that need more.

        A constraint on one angle is proven for the motion if it is proven for the whole range of that angle. Its
        clearance is smallest at an end of the range. A motion that is straight between knots reaches this end at a
        knot. All control points of all pieces count, so both ends of each piece. It is not assumed that a piece begins
        where the one before ends.
        """
        m, family, trajectory = len(self.family.names), self.family, self.trajectory
        if not m or not isinstance(family, Limits | OneAngleBoundaries) or not isinstance(trajectory, Polynomials):
            return np.arange(m)
        controls, every = trajectory.controls, slice(None)
        phi = trajectory.ends @ family.angles.T
        first, last = phi.min(axis=0), phi.max(axis=0)
        if is_straight(trajectory):
            low, high = first, last
        else:
            inner = controls.reshape(-1, controls.shape[2]) @ family.angles.T
            wide = np.abs(family.angles) @ trajectory.radius.max(axis=0)
            low, high = inner.min(axis=0) - wide, inner.max(axis=0) + wide
        self.meter.boxes += m
        found = family.judge(every, last, low, high)
        clear, lower = found.clear, found.lower
        upper, other = family.at(every, first) + found.error, found.value + found.error
        better = other < upper
        row: Indices = np.array(phi.argmin(axis=0), dtype=np.intp)
        row[better] = phi.argmax(axis=0)[better]
        self.best, self.best_piece = np.where(better, other, upper), row // 2
        self.best_u = np.array(row % 2, dtype=np.float64)
        target = self.best if each else min(float(self.best.min()), self.elsewhere)
        settled = clear & ((self.best - lower <= self.precision) | (lower >= target - self.precision))
        if settled.all():
            self.lower = lower
            return _NONE
        self.lower[settled] = lower[settled]
        return np.flatnonzero(~settled)

    def _quick(self, active: Indices, each: bool) -> Indices:
        """Decide by machine code what is clear; return the constraints that need more.

        Machine code proves pairs of points clear on straight motions, and bounds their smallest clearance as tightly as
        requested. Pairs that it finds in contact, or cannot decide, are searched again here. So first contacts,
        witnesses and open parts come from this search only.
        """
        family, trajectory = self.family, self.trajectory
        if not len(active) or not isinstance(family, ManyAngleBoundaries) or not is_straight(trajectory):
            return active
        groups, controls = family.groups, trajectory.controls
        left = self.meter.budget.seconds - self.meter.seconds
        if groups is None or self.meter.spent() or not groups.is_worth(2 * len(active) * len(controls), left):
            return active
        room = min(self.meter.budget.boxes - self.meter.boxes, _A_SECOND * left)
        found = groups.motion(controls, self.precision, self.elsewhere, room, each)
        if found is None:
            return active
        self.meter.boxes += found.boxes
        self.best, self.best_piece, self.best_u = found.upper, found.piece, found.u
        self.lower = np.where(found.settled, found.lower, np.inf)
        return np.flatnonzero(~found.settled)

    def _times(self, piece: Indices, u: Array) -> Array:
        """Return times since the start of the motion."""
        return (self.trajectory.starts[piece] - self.origin) + u * self.trajectory.durations[piece]

    def _enclose(self, parts: _Parts) -> Enclosure:
        self.meter.boxes += len(parts)
        expansion, rows = _expanded(self.trajectory, parts)
        found = self.family.enclose(parts.which, expansion, rows)
        if isinstance(self.trajectory, LiftedTrajectory):
            found = told(found, self.family, parts.which, expansion.take(rows).middle_radius)
        middle = 0.5 * (parts.a + parts.b)
        upper = found.value + found.error
        self._smallest(parts, middle, upper)
        if np.any(found.violated):
            self.has_contact = True
            self._earliest(parts.take(found.violated), middle[found.violated], found.value[found.violated])
        return found

    def _knots(self, active: Indices, pieces: Indices, last: bool) -> None:
        m = len(active)
        zero = np.zeros(len(pieces) * m)
        parts = [_Parts(np.repeat(pieces, m), np.tile(active, len(pieces)), zero, zero)]
        if last:
            parts.append(_Parts(np.full(m, pieces[-1]), active, np.ones(m), np.ones(m)))
        for one in parts:
            self._enclose(one)

    def _smallest(self, parts: _Parts, u: Array, upper: Array) -> None:
        rows = _least(parts.which, upper, self.best)
        which = parts.which[rows]
        self.best[which], self.best_piece[which], self.best_u[which] = upper[rows], parts.piece[rows], u[rows]

    def _earliest(self, parts: _Parts, u: Array, value: Array) -> None:
        times = self._times(parts.piece, u)
        rows = _least(parts.which, times, self.first)
        which = parts.which[rows]
        self.first[which], self.first_piece[which], self.first_u[which] = times[rows], parts.piece[rows], u[rows]
        self.first_value[which] = value[rows]

    def _round(self, parts: _Parts, each: bool) -> _Parts:
        """Bound parts, decide those that can be decided, and return the others, cut."""
        found = self._enclose(parts)
        which, first = parts.which, self.first[parts.which]
        begin, end = self._times(parts.piece, parts.a), self._times(parts.piece, parts.b)
        doubtful = ~found.clear & (begin < first)
        target = self.best[which] if each else np.full(len(parts), min(float(self.best.min()), self.elsewhere))
        wanted = found.lower < target - self.precision
        stuck = found.settled & ~found.violated
        narrow = parts.b - parts.a <= _NARROWEST
        timed = np.isfinite(first) & (end - begin <= FIRST_CONTACT * self.total / 4.0)
        split = (doubtful & ~timed & ~stuck | wanted & ~found.settled) & ~narrow
        done = ~split
        np.minimum.at(self.lower, which[done], found.lower[done])
        left = done & doubtful
        if np.any(left):
            code = np.where(stuck[left], _REASONS.index(Reason.ROUNDING), _REASONS.index(Reason.RESOLUTION))
            self.open.append((parts.take(left), found.lower[left], code))
        return parts.take(split).cut(self.is_coded)

    def _give_up(self, parts: _Parts, active: Indices, reason: Reason) -> None:
        """Keep as open what the budget does not allow to examine: these parts, and all later pieces."""
        self.lower[np.unique(parts.which)] = -np.inf
        code = np.full(len(parts), _REASONS.index(reason))
        self.open.append((parts, np.full(len(parts), -np.inf), code))
        behind = int(parts.piece.max()) + 1
        if behind < len(self.trajectory.starts):
            self.lower[active] = -np.inf
            self.unseen = (float(self.trajectory.starts[behind]) - self.origin, active, reason)

    def results(self) -> tuple[Findings, list[OpenPart]]:
        """Return a finding for each constraint, and its open parts before the first contact, neighbours merged."""
        m, names = len(self.family.names), self.family.names
        if not self.open and not self.unseen and not self.has_contact:
            return self._findings(np.zeros(m, dtype=np.int64), {}), []
        pending, hit = np.full(m, np.inf), np.isfinite(self.first)
        listed: list[OpenPart] = []
        for parts, lower, code in self.open:
            begin, end = self._times(parts.piece, parts.a), self._times(parts.piece, parts.b)
            before = begin < self.first[parts.which]
            np.minimum.at(pending, parts.which[before], begin[before])
            for row in np.flatnonzero(before & ~hit[parts.which]):
                name, reason = names[int(parts.which[row])], _REASONS[int(code[row])]
                span = self.origin + float(begin[row]), self.origin + float(end[row])
                listed.append(OpenPart(name, *span, float(lower[row]), reason))
        if self.unseen:
            begun, active, reason = self.unseen
            span = self.origin + begun, self.origin + self.total
            for row in active[self.first[active] > begun]:
                pending[row] = min(float(pending[row]), begun)
                if not hit[row]:
                    listed.append(OpenPart(names[int(row)], *span, -np.inf, reason))
        contacts: dict[int, Contact] = {}
        for row in np.flatnonzero(hit).tolist():
            before, after = (float(min(pending[row], self.first[row])), float(self.first[row]))
            q = self.trajectory.at(self.first_piece[row : row + 1], self.first_u[row : row + 1])[0]
            contacts[row] = Contact(self.origin + before, self.origin + after, q, float(self.first_value[row]))
        codes = np.where(hit, 1, np.where(np.isfinite(pending), 2, 0))
        return self._findings(codes, contacts), _merged(listed)

    def _findings(self, codes: Indices, contacts: dict[int, Contact]) -> Findings:
        return Findings(
            self.family.names,
            owned(codes),
            owned(np.minimum(self.lower, self.best)),
            self.best,
            owned(self.origin + self._times(self.best_piece, self.best_u)),
            owned(self.trajectory.at(self.best_piece, self.best_u)),
            contacts,
        )


def _expanded(trajectory: Trajectory, parts: _Parts) -> tuple[Expansion, Indices]:
    """Return the distinct parts, expanded, and the row of each part among them; only neighbours are compared."""
    new = np.ones(len(parts), dtype=np.bool_)
    new[1:] = (np.diff(parts.piece) != 0) | (np.diff(parts.a) != 0.0) | (np.diff(parts.b) != 0.0)
    once = parts.take(new)
    return trajectory.expand(once.piece, once.a, once.b), np.cumsum(new) - 1


def _least(which: Indices, values: Array, known: Array) -> Indices:
    """Return, for each constraint with a new smallest value, a row that has this value."""
    least = known.copy()
    np.minimum.at(least, which, values)
    return np.flatnonzero((values == least[which]) & (values < known[which]))


def _joined(parts: list[_Parts]) -> _Parts:
    return _Parts(
        np.concatenate([part.piece for part in parts]),
        np.concatenate([part.which for part in parts]),
        np.concatenate([part.a for part in parts]),
        np.concatenate([part.b for part in parts]),
    )


def _merged(parts: list[OpenPart]) -> list[OpenPart]:
    """Join touching open parts of one constraint and reason."""
    merged: list[OpenPart] = []
    for part in sorted(parts, key=lambda part: (part.name, part.reason.value, part.start)):
        last = merged[-1] if merged else None
        if last and (last.name, last.reason) == (part.name, part.reason) and part.start <= last.end:
            end, lower = max(last.end, part.end), min(last.lower, part.lower)
            merged[-1] = OpenPart(last.name, last.start, end, lower, last.reason)
        else:
            merged.append(part)
    return sorted(merged, key=lambda part: (part.start, part.name))
