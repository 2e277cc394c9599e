"""Boundaries of segments, bodies, lines and planes: bounded along a fixed direction."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from pinbound.boundaries.boundary import Boundary
from pinbound.bounds.bounds import Expansion
from pinbound.bounds.separation_tables import SeparationTables, is_worth
from pinbound.bounds.swept_bounds import SweptBundle, along_motion, over_box
from pinbound.certificates.enclosures import Enclosure
from pinbound.evaluate import separation
from pinbound.typing import Array, Flags, Indices

__all__ = ["SweptBoundaries"]


@dataclass(frozen=True)
class SweptBoundaries:
    """Boundaries of other marks than two points.

    Attributes:
        names: Their names.
        swept: The bundle of their paths.
        threshold: (m,) the value that the separation must exceed [m]; for distances at least the contact tolerance.
        error: (m,) rounding bound of a separation [m].
        boundaries: The boundaries.
        tables: The tables for machine code, made when first needed.
        seconds: The time for the whole search; machine code is not compiled in the last few seconds.
    """

    names: tuple[str, ...]
    swept: SweptBundle
    threshold: Array
    error: Array
    boundaries: tuple[Boundary, ...]
    tables: Callable[[], SeparationTables]
    seconds: float = np.inf

    @property
    def is_coded(self) -> bool:
        """Whether machine code bounds them, because there was enough work."""
        return is_worth(0, self.seconds)

    def within(self, seconds: float) -> SweptBoundaries:
        """Return the same family, for a search of at most so many seconds."""
        return replace(self, seconds=seconds)

    @property
    def weights(self) -> Array:
        """Lever arms, and rates of prismatic joints, for each coordinate, of the corner that moves most."""
        chains, rows = self.swept.chains, self.swept.rows
        moved = np.einsum("mk,mkn->mn", self.swept.arms, np.abs(chains.coefficients))
        if chains.slides is not None:
            moved = moved + np.linalg.norm(chains.slides, axis=2).sum(axis=1)
        return moved[::rows]

    def signed(self, Q: Array) -> Array:
        """Return the signed clearances (N, m) [m]."""
        found = [separation.separations(boundary.path, Q) for boundary in self.boundaries]
        return np.array(found).reshape(len(self.boundaries), len(Q)).T - self.threshold

    def clearance(self, row: int, q: Array) -> float:
        """Return the signed clearance of one boundary [m]."""
        return float(self.boundaries[row].norm(q) - self.threshold[row])

    def enclose(self, which: Indices, part: Expansion, rows: Indices) -> Enclosure:
        """Return the enclosure by the bounds along a motion."""
        value, lower = np.empty(len(which)), np.empty(len(which))
        coded = self._coded(which)
        if np.any(coded):
            chosen = which[coded], part, rows[coded], self.error
            value[coded], lower[coded] = self.tables().along_motion(*chosen)
        if not np.all(coded):
            rest = which[~coded]
            found = along_motion(self.swept, rest, part.take(rows[~coded]), self.error[rest])
            value[~coded], lower[~coded] = found.value, found.lower
        return self._judge(which, value, lower)

    def enclose_box(self, which: Indices, centre: Array, half: Array) -> Enclosure:
        """Return the enclosure by the bounds over a box."""
        value, lower = np.empty(len(which)), np.empty(len(which))
        coded = self._coded(which)
        if np.any(coded):
            value[coded], lower[coded] = self.tables().over_box(which[coded], centre[coded], half[coded], self.error)
        if not np.all(coded):
            rest = which[~coded]
            found = over_box(self.swept, rest, centre[~coded], half[~coded], self.error[rest])
            value[~coded], lower[~coded] = found.value, found.lower
        return self._judge(which, value, lower)

    def _coded(self, which: Indices) -> Flags:
        """Return the rows that machine code bounds; none if loading or compiling it would take longer."""
        if not is_worth(len(which), self.seconds):
            return np.zeros(len(which), dtype=np.bool_)
        return self.tables().fits[which]

    def _judge(self, which: Indices, value: Array, lower: Array) -> Enclosure:
        error, threshold = self.error[which], self.threshold[which]
        value, lower = value - threshold, lower - threshold
        lower = np.where(self.swept.is_signed[which], lower, np.maximum(lower, -threshold - error))
        return Enclosure(value, lower, error, lower > 0.0, value < -error, value - lower <= 4.0 * error)
