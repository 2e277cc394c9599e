"""Motions of polynomial pieces in Bernstein form, and the interface that a certificate needs of any motion.

A polynomial in Bernstein form lies in the hull of its control points, and its derivatives lie in the hulls of theirs.
For a part of a piece the hull is smaller. Straight segments are pieces of degree one.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol, TypeGuard

import numpy as np

from pinbound.bounds.bounds import Expansion
from pinbound.tolerances import UNIT_ROUNDOFF
from pinbound.typing import Array, Indices

__all__ = ["Polynomials", "Trajectory", "is_straight"]

_RESTRICTING = 8
"""Unit roundoffs per degree, relative to the largest control point: two runs of de Casteljau's scheme."""


class Trajectory(Protocol):
    """The interface that a certificate needs of a motion."""

    @property
    def starts(self) -> Array:
        """(K,) times at which the pieces start."""
        ...

    @property
    def durations(self) -> Array:
        """(K,) durations of the pieces."""
        ...

    @property
    def degree(self) -> int:
        """Polynomial degree; the rounding of q grows with it."""
        ...

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes for the reader of the certificate."""
        ...

    @property
    def extent(self) -> tuple[Array, Array]:
        """Corners (n,) of a box that contains all q of the motion, widened by rounding."""
        ...

    def at(self, piece: Indices, u: Array) -> Array:
        """Return q (N, n) at the fractions u of pieces."""
        ...

    def expand(self, piece: Indices, a: Array, b: Array) -> Expansion:
        """Return bounds of q on the parts [a, b] of pieces."""
        ...


@dataclass(frozen=True, eq=False)
class Polynomials:
    """A sequence of polynomial pieces.

    Attributes:
        controls: (K, d + 1, n) control points of each piece, in [0, 1].
        starts: (K,).
        durations: (K,).
        radius: (K, n) how far the true motion may be from that of these control points; 0 for straight segments.
        notes: Notes for the reader of the certificate.
    """

    controls: Array
    starts: Array
    durations: Array
    radius: Array
    notes: tuple[str, ...] = ()

    @property
    def degree(self) -> int:
        """Degree of the pieces."""
        return self.controls.shape[1] - 1

    @property
    def extent(self) -> tuple[Array, Array]:
        """Hull of all control points."""
        if self.is_exact:
            return self.controls.min(axis=(0, 1)), self.controls.max(axis=(0, 1))
        lower, upper = self.controls.min(axis=1) - self.radius, self.controls.max(axis=1) + self.radius
        return lower.min(axis=0), upper.max(axis=0)

    @cached_property
    def is_exact(self) -> bool:
        """Whether the motion is exactly that of the control points, without a radius."""
        return not self.radius.any()

    @cached_property
    def ends(self) -> Array:
        """(2 K, n) both ends of each piece: start and end of the first, of the second, and so on."""
        return self.controls[:, [0, -1]].reshape(-1, self.controls.shape[2])

    @cached_property
    def _first(self) -> Array:
        return self.degree * np.diff(self.controls, axis=1) if self.degree else np.zeros_like(self.controls)

    @cached_property
    def _second(self) -> Array:
        if self.degree < 2:
            return np.zeros_like(self.controls[:, :1])
        return (self.degree - 1) * np.diff(self._first, axis=1)

    @cached_property
    def _rounding(self) -> tuple[Array, Array]:
        """Rounding bounds (K, n) of restricted first and second derivatives; a straight segment has none."""
        unit = _RESTRICTING * self.degree * UNIT_ROUNDOFF if self.degree > 1 else 0.0
        first, second = np.abs(self._first).max(axis=1), np.abs(self._second).max(axis=1)
        return unit * first, unit * (first + second)

    def at(self, piece: Indices, u: Array) -> Array:
        """Return q by de Casteljau's scheme; exact at u = 0 and u = 1."""
        if self.degree == 1 and len(self.controls) == 1:  # the same result, without a copy of the piece for each u
            start, end = self.controls[0]
            found = start + u[:, None] * (end - start)
            found[u == 1.0] = end
            return found
        return _value(self.controls[piece], u)

    def expand(self, piece: Indices, a: Array, b: Array) -> Expansion:
        """Restrict pieces, and their derivatives, to [a, b]; each from its own control points."""
        if self.degree == 1 and self.is_exact:
            return self._straight(piece, a, b)
        width = (b - a)[:, None, None]
        middle = 0.5 * (a + b)
        first, second, radius = self._first, self._second, self.radius[piece]
        slope_rounding, bend_rounding = (one[piece] for one in self._rounding)
        loose = 2.0 * self.degree * radius
        return Expansion(
            middle=self.at(piece, middle),
            # The slope in the middle is rounded, too. A point that moves along it has half of this error at an end.
            middle_radius=radius + 0.5 * slope_rounding * width[:, 0],
            slope=_value(first[piece], middle) * width[:, 0],
            values=_restrict(self.controls[piece], a, b),
            value_radius=radius,
            slopes=_restrict(first[piece], a, b) * width,
            slope_radius=(loose + slope_rounding) * width[:, 0],
            bends=_restrict(second[piece], a, b) * width**2,
            bend_radius=(2.0 * self.degree * loose + bend_rounding) * width[:, 0] ** 2,
        )

    def _straight(self, piece: Indices, a: Array, b: Array) -> Expansion:
        """Return the same for straight segments: slopes are constant, and exact up to a difference and a product."""
        controls, none = self.controls[piece], np.zeros(self.controls.shape[2])
        slope = (controls[:, 1] - controls[:, 0]) * (b - a)[:, None]
        return Expansion(
            middle=_value(controls, 0.5 * (a + b)),
            middle_radius=none,
            slope=slope,
            values=np.stack((_value(controls, a), _value(controls, b)), axis=1),
            value_radius=none,
            slopes=slope[:, None],
            slope_radius=none,
            bends=np.zeros((len(slope), 1, len(none))),
            bend_radius=none,
        )


def _step(points: Array, u: Array) -> Array:
    """Return the next level of de Casteljau's scheme at u (N,)."""
    fraction = u[:, None, None]
    return np.where(fraction == 1.0, points[:, 1:], points[:, :-1] + fraction * (points[:, 1:] - points[:, :-1]))


def _value(controls: Array, u: Array) -> Array:
    """Return the values (N, n) of polynomials (N, d + 1, n) at u (N,)."""
    points = controls
    while points.shape[1] > 1:
        points = _step(points, u)
    return points[:, 0]


def _restrict(controls: Array, a: Array, b: Array) -> Array:
    """Return the control points of the same polynomials on [a, b]: cut at b, and the part before b cut at a / b."""
    points, left = controls, [controls[:, 0]]
    while points.shape[1] > 1:
        points = _step(points, b)
        left.append(points[:, 0])
    points = np.stack(left, axis=1)
    share = np.divide(a, b, out=np.zeros_like(a), where=b > 0.0)
    right = [points[:, -1]]
    while points.shape[1] > 1:
        points = _step(points, share)
        right.append(points[:, -1])
    return np.stack(right[::-1], axis=1)


def is_straight(trajectory: Trajectory) -> TypeGuard[Polynomials]:
    """Return whether a motion is straight between its knots, and exact."""
    return isinstance(trajectory, Polynomials) and trajectory.degree == 1 and trajectory.is_exact
