"""Boundaries of one effective angle, also stops: exact extremes over a range of the angle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pinbound.bounds.bounds import Expansion, OneAngle
from pinbound.certificates.enclosures import Enclosure, angle_range
from pinbound.contact import Stop, signed_share
from pinbound.typing import Array, Flags, Indices

__all__ = ["OneAngleBoundaries", "with_stops"]


@dataclass(frozen=True)
class OneAngleBoundaries:
    """Boundaries of one effective angle: the exact extremes of the signed clearance over an interval of the angle.

    Attributes:
        names: Their names.
        chains: Their closed form.
        threshold: (m,) the value that the norm must exceed [m]; not used for stops.
        is_stop: (m,) whether contact is a line, so that its two sides are distinguished.
        gap: (m, 2) home's gap between contact lines [rad]; infinite if it is not a stop.
        amplitude: (m,) for stops, the largest signed clearance [m].
        error: (m,) rounding bound of a signed clearance [m].
        angle_error: (m,) rounding bound of the angle between phi and a contact line [rad].
    """

    names: tuple[str, ...]
    chains: OneAngle
    threshold: Array
    is_stop: Flags
    gap: Array
    amplitude: Array
    error: Array
    angle_error: Array

    @property
    def angles(self) -> Array:
        """Coefficients of the effective angle."""
        return self.chains.coefficients

    @property
    def weights(self) -> Array:
        """Coefficients of the effective angle."""
        return self.chains.weights

    @cached_property
    def has_stops(self) -> bool:
        """Whether any of them is a stop."""
        return bool(self.is_stop.any())

    def signed(self, Q: Array) -> Array:
        """Return the signed clearances (N, m) [m]."""
        phi = Q @ self.chains.coefficients.T
        which = np.broadcast_to(np.arange(len(self.names)), phi.shape)
        return self.at(which, phi)

    def clearance(self, row: int, q: Array) -> float:
        """Return the signed clearance of one boundary [m]."""
        return float(self.at(np.array([row]), self.chains.coefficients[row : row + 1] @ q)[0])

    def at(self, which: Indices | slice, phi: Array) -> Array:
        """Return the signed clearances (N,) of boundaries `which` at their angles phi (N,) [m]."""
        norm = self.chains.norm(which, phi) - self.threshold[which]
        if not self.has_stops:
            return norm
        return np.where(self.is_stop[which], self._stopped(which, self._depth(which, phi)), norm)

    def _depth(self, which: Indices | slice, phi: Array) -> Array:
        return np.minimum(phi - self.gap[which, 0], self.gap[which, 1] - phi)

    def _stopped(self, which: Indices | slice, depth: Array) -> Array:
        return self.amplitude[which] * signed_share(np.where(np.isfinite(depth), depth, 0.0))

    def _least(self, which: Indices | slice, lower: Array, upper: Array) -> Array:
        """Return the smallest signed clearance of stops while phi runs over [lower, upper].

        The depth is concave in phi. So its range is [the smaller end value, the maximum]. From -pi to pi, the clearance
        increases with the depth. Below -pi it is between `-amplitude`, at every odd multiple of pi, and zero.
        """
        ends = self._depth(which, lower), self._depth(which, upper)
        least, most = np.minimum(*ends), np.maximum(*ends)
        with np.errstate(invalid="ignore"):  # boundaries that are not stops have no gap
            middle = 0.5 * (self.gap[which, 0] + self.gap[which, 1])
            most = np.where((lower <= middle) & (upper >= middle), np.pi, most)
            bottom = -np.pi - 2.0 * np.pi * np.ceil((-np.pi - most) / (2.0 * np.pi))  # the highest, at most `most`
            reached = np.where(bottom > -np.pi, -np.pi, bottom) >= least
        found = np.minimum(self._stopped(which, least), self._stopped(which, most))
        return np.where(reached, -self.amplitude[which], found)

    def enclose(self, which: Indices, part: Expansion, rows: Indices) -> Enclosure:
        """Return the enclosure over the range of the effective angle."""
        return self.judge(which, *angle_range(self.chains.coefficients, which, part, rows))

    def enclose_box(self, which: Indices, centre: Array, half: Array) -> Enclosure:
        """Return the enclosure over the range of the effective angle."""
        c = self.chains.coefficients[which]
        middle, wide = np.einsum("ni,ni->n", c, centre), np.einsum("ni,ni->n", np.abs(c), half)
        return self.judge(which, middle, middle - wide, middle + wide)

    def judge(self, which: Indices | slice, middle: Array, lower: Array, upper: Array) -> Enclosure:
        """Return the enclosure from the range of the effective angle."""
        error = self.error[which]
        value, near = self.at(which, middle), self.chains.least(which, lower, upper)
        if not self.has_stops:
            bound = near - self.threshold[which] - error
            return Enclosure(value, bound, error, bound > 0.0, value < -error, value - bound <= 2.0 * error)
        slack, stop = self.angle_error[which], self.is_stop[which]
        start, end = self.gap[which, 0], self.gap[which, 1]
        home = (lower - slack > start) & (upper + slack < end)
        over = (middle + slack < start) | (middle - slack > end)
        bound = np.where(stop, self._least(which, lower, upper), near - self.threshold[which]) - error
        bound = np.where(stop & home, np.maximum(bound, 0.0), bound)
        clear = np.where(stop, home, bound > 0.0)
        violated = np.where(stop, over & (value < 0.0), value < -error)
        narrow = np.where(stop & ~home, upper - lower <= slack, value - bound <= 2.0 * error)
        return Enclosure(value, bound, error, clear, violated, narrow)


def with_stops(closed: OneAngle, is_stop: Flags, stops: Sequence[Stop]) -> OneAngle:
    """Return the closed forms, with the angles of stops as in the contact rule."""
    coefficients, angle = closed.coefficients.copy(), closed.angle.copy()
    coefficients[is_stop] = np.array([stop.coefficients for stop in stops]).reshape(len(stops), coefficients.shape[1])
    angle[is_stop] = [stop.angle for stop in stops]
    return OneAngle(coefficients, angle, closed.smallest, closed.reach, closed.arm)
