"""Limits with ends of rules that apply only under conditions: a row is clear if one of its inequalities is.

The set that a guarded end forbids is convex: q satisfies every condition, and passes the end. Its complement is a union
of half-spaces, `end kept` or `condition not satisfied`. So the margin is the largest of their margins,

    m(q) = max(end's margin, margins beyond each end of each condition),

a maximum of affine functions. Over a part of a motion it is at least the largest of their lower bounds. So the part is
clear if one half-space alone contains it. If a part goes from one half-space to another, it is halved.

The end is kept if it is passed by at most `tolerances.LIMIT`. A condition is not satisfied if it is passed by more.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pinbound.bounds.bounds import Expansion
from pinbound.certificates.enclosures import Enclosure, Family
from pinbound.model.coupling import GuardedLimit, LinearLimit
from pinbound.tolerances import LIMIT
from pinbound.typing import Array, Flags, Indices

__all__ = ["GuardedLimits", "pieces"]


def pieces(guarded: Sequence[GuardedLimit]) -> list[tuple[str, LinearLimit, bool]]:
    """Return every inequality of guarded ends, as `(name, limit, whether it is the end)`, in order.

    For a condition `lower <= v <= upper` these are `v >= upper` and `v <= lower`, if the ends exist.
    """
    found: list[tuple[str, LinearLimit, bool]] = []
    for one in guarded:
        found.append((one.name, one.limit, True))
        for c in one.where:
            ends = ((c.upper, np.inf), (-np.inf, c.lower))
            for lower, upper in ends:
                if np.isfinite(lower) or np.isfinite(upper):
                    beyond = LinearLimit(c.joint, c.coefficients, c.offset, lower, upper)
                    found.append((one.name, beyond, False))
    return found


@dataclass(frozen=True)
class GuardedLimits:
    """Rows of limits; a row is kept if one of its inequalities is.

    Attributes:
        names: Names of the rows.
        plain: All inequalities, as limits.
        members: (m, w) the inequalities of each row; short rows repeat their last one.
        beyond: (k,) which inequalities are conditions; these must be passed by more than `tolerances.LIMIT`.
    """

    names: tuple[str, ...]
    plain: Family
    members: Indices
    beyond: Flags

    @classmethod
    def of(cls, plain: Family, guarded: Sequence[GuardedLimit]) -> GuardedLimits:
        """Return the rows of all limits; `plain` has those of joints first, then the `pieces` of guarded ends."""
        parts = pieces(guarded)
        first = len(plain.names) - len(parts)
        rows, start = [[row] for row in range(first)], first
        for one in guarded:
            count = len(pieces([one]))
            rows.append(list(range(start, start + count)))
            start += count
        width = max(map(len, rows))
        members = np.array([row + row[-1:] * (width - len(row)) for row in rows], dtype=np.intp)
        beyond = np.array([False] * first + [not is_end for _, _, is_end in parts], dtype=np.bool_)
        names = (*plain.names[:first], *(one.name for one in guarded))
        return cls(names, plain, members, beyond)

    @property
    def weights(self) -> Array:
        """(m, n): the largest coefficients of each row."""
        return self.plain.weights[self.members].max(axis=1)

    def signed(self, Q: Array) -> Array:
        """Return the margins (N, m) [rad or m]."""
        return self.plain.signed(Q)[:, self.members].max(axis=2)

    def clearance(self, row: int, q: Array) -> float:
        """Return the margin of one row [rad or m]."""
        return max(self.plain.clearance(int(one), q) for one in self.members[row])

    def enclose(self, which: Indices, part: Expansion, rows: Indices) -> Enclosure:
        """Return the enclosure over parts of a motion."""
        found = [(one, self.plain.enclose(one, part, rows)) for one in self.members[which].T]
        return self._any(found)

    def enclose_box(self, which: Indices, centre: Array, half: Array) -> Enclosure:
        """Return the enclosure over boxes."""
        found = [(one, self.plain.enclose_box(one, centre, half)) for one in self.members[which].T]
        return self._any(found)

    def _any(self, found: Sequence[tuple[Indices, Enclosure]]) -> Enclosure:
        clear = [np.where(self.beyond[which], e.lower > LIMIT, e.clear) for which, e in found]
        violated = [np.where(self.beyond[which], e.value <= LIMIT - e.error, e.violated) for which, e in found]
        return Enclosure(
            np.max([e.value for _, e in found], axis=0),
            np.max([e.lower for _, e in found], axis=0),
            np.max([e.error for _, e in found], axis=0),
            np.any(clear, axis=0),
            np.all(violated, axis=0),
            np.all([e.settled for _, e in found], axis=0),
        )
