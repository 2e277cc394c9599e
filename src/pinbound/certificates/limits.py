"""Ends of joint limits as constraints: they are affine in q, so every enclosure is exact."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pinbound.bounds.bounds import Expansion
from pinbound.certificates.enclosures import Enclosure, angle_range
from pinbound.tolerances import LIMIT
from pinbound.typing import Array, Indices

__all__ = ["Limits"]


@dataclass(frozen=True)
class Limits:
    """`bound - c . q >= 0`, for every end of every joint limit, as a function of q."""

    names: tuple[str, ...]
    coefficients: Array
    bounds: Array
    error: Array

    @property
    def angles(self) -> Array:
        """Coefficients."""
        return self.coefficients

    @property
    def weights(self) -> Array:
        """Coefficients."""
        return np.abs(self.coefficients)

    def signed(self, Q: Array) -> Array:
        """Return the margins (N, m) [rad or m]."""
        return self.bounds - Q @ self.coefficients.T

    def clearance(self, row: int, q: Array) -> float:
        """Return the margin of one end [rad or m]."""
        return float(self.bounds[row] - self.coefficients[row] @ q)

    def at(self, which: Indices | slice, phi: Array) -> Array:
        """Return the margins (N,) of ends `which` where `c . q` is phi (N,) [rad or m]."""
        return self.bounds[which] - phi

    def enclose(self, which: Indices, part: Expansion, rows: Indices) -> Enclosure:
        """Return the enclosure: the largest `c . q` is at a control point."""
        return self.judge(which, *angle_range(self.coefficients, which, part, rows))

    def enclose_box(self, which: Indices, centre: Array, half: Array) -> Enclosure:
        """Return the enclosure: the largest `c . q` is at a corner."""
        c = self.coefficients[which]
        middle, wide = np.einsum("ni,ni->n", c, centre), np.einsum("ni,ni->n", np.abs(c), half)
        return self.judge(which, middle, middle - wide, middle + wide)

    def judge(self, which: Indices | slice, middle: Array, lower: Array, upper: Array) -> Enclosure:
        """Return the enclosure from the range of `c . q`; only its upper end matters."""
        error, bound = self.error[which], self.bounds[which]
        value, lower = bound - middle, bound - upper - error
        return Enclosure(value, lower, error, lower >= -LIMIT, value < -LIMIT - error, value - lower <= 2.0 * error)
