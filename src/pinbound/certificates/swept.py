"""Boundaries of segments, lines and planes: bounded along a direction that stands still."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pinbound.boundaries.boundary import Boundary
from pinbound.bounds.bounds import Expansion
from pinbound.bounds.swept_bounds import Bounds, SweptBundle, along_motion, over_box
from pinbound.certificates.enclosures import Enclosure
from pinbound.evaluate import separation
from pinbound.typing import Array, Indices

__all__ = ["SweptBoundaries"]


@dataclass(frozen=True)
class SweptBoundaries:
    """Boundaries that are not between two points.

    Attributes:
        names: Their names.
        swept: Their paths, side by side.
        threshold: (m,) what the separation must exceed [m]; of distances at least the contact tolerance.
        error: (m,) rounding bound of a separation [m].
        boundaries: They themselves.
    """

    names: tuple[str, ...]
    swept: SweptBundle
    threshold: Array
    error: Array
    boundaries: tuple[Boundary, ...]

    @property
    def weights(self) -> Array:
        """Lever arms, and lengths of slides, a coordinate, of the corner that moves most."""
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
        return self._judge(which, along_motion(self.swept, which, part.take(rows), self.error[which]))

    def enclose_box(self, which: Indices, centre: Array, half: Array) -> Enclosure:
        """Return the enclosure by the bounds over a box."""
        return self._judge(which, over_box(self.swept, which, centre, half, self.error[which]))

    def _judge(self, which: Indices, found: Bounds) -> Enclosure:
        error, threshold = self.error[which], self.threshold[which]
        value, lower = found.value - threshold, found.lower - threshold
        lower = np.where(self.swept.is_signed[which], lower, np.maximum(lower, -threshold - error))
        return Enclosure(value, lower, error, lower > 0.0, value < -error, value - lower <= 4.0 * error)
