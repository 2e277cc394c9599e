"""Boundaries of two points with several effective angles, or with prismatic joints: lever-arm bounds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pinbound.boundaries.boundary import Boundary
from pinbound.bounds.bounds import Bundle, Expansion, along_motion, over_box
from pinbound.bounds.groups import Groups
from pinbound.certificates.enclosures import Enclosure
from pinbound.evaluate import numeric
from pinbound.typing import Array, Indices

__all__ = ["ManyAngleBoundaries"]


@dataclass(frozen=True)
class ManyAngleBoundaries:
    """Boundaries of several effective angles, or with prismatic joints: lever-arm bounds.

    Attributes:
        names: Their names.
        chains: The bundle of their chains.
        arms: (m, k) lever arms [m].
        threshold: (m,) the value that the norm must exceed, by the contact rule [m].
        error: (m,) rounding bound of a norm [m].
        boundaries: The boundaries.
        groups: Their tables for machine code; None with prismatic joints.
    """

    names: tuple[str, ...]
    chains: Bundle
    arms: Array
    threshold: Array
    error: Array
    boundaries: tuple[Boundary, ...]
    groups: Groups | None

    @property
    def weights(self) -> Array:
        """Lever arms, and rates of prismatic joints, for each coordinate."""
        turned = np.einsum("mk,mkn->mn", self.arms, np.abs(self.chains.coefficients))
        slides = self.chains.slides
        return turned if slides is None else turned + np.linalg.norm(slides, axis=2).sum(axis=1)

    def signed(self, Q: Array) -> Array:
        """Return the signed clearances (N, m) [m]."""
        norms = [numeric.norm(numeric.positions(boundary.path.minimal, Q)) for boundary in self.boundaries]
        return np.array(norms).reshape(len(self.boundaries), len(Q)).T - self.threshold

    def clearance(self, row: int, q: Array) -> float:
        """Return the signed clearance of one boundary [m]."""
        return float(self.boundaries[row].norm(q) - self.threshold[row])

    def enclose(self, which: Indices, part: Expansion, rows: Indices) -> Enclosure:
        """Return the enclosure by the bounds along a motion."""
        error = self.error[which]
        return self._judge(which, error, *along_motion(self.chains, self.arms, which, part.take(rows), error))

    def enclose_box(self, which: Indices, centre: Array, half: Array) -> Enclosure:
        """Return the enclosure by the bounds over a box."""
        error = self.error[which]
        return self._judge(which, error, *over_box(self.chains, self.arms, which, centre, half, error))

    def _judge(self, which: Indices, error: Array, norm: Array, bound: Array) -> Enclosure:
        value = norm - self.threshold[which]
        lower = np.maximum(bound, 0.0) - self.threshold[which] - error
        return Enclosure(value, lower, error, lower > 0.0, value < -error, value - lower <= 2.0 * error)
