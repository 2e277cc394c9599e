"""Contacts and limits of a plane through loops that are no parallelograms: `z = F(q)`, with bounds over boxes.

Over a box of the plane with middle c and half-widths h, F is `F(c) + sum_a s_a J_a h_a + e` with `s_a` in [-1, 1], J
the middle of an interval that holds F', and |e| bounded by what is left of it (`Lift.linear`). A limit is linear in z,
and so exact but for e. The distance of two marks is bounded to second order as over any box of z, its linear part along
the `J_a h_a` alone: what follows q together is not taken for independent. `docs/loops.md` derives both.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pinbound.bounds.swept_bounds import SweptBundle, over_box, rounding_bound, swept_bundle
from pinbound.evaluate import separation
from pinbound.loops.lift import Lift, LinearParts
from pinbound.path.relative import RelativePath
from pinbound.tolerances import CONTOUR_ROUNDING, UNIT_ROUNDOFF
from pinbound.typing import Array, Flags, Indices, Ints
from pinbound.values import Value

__all__ = ["LiftedPlane", "LoopBounds", "LoopContact", "LoopFunction", "LoopLimit"]

_ROWS = 2**12  # boxes whose F is bounded in one go


@dataclass(frozen=True, eq=False)
class LiftedPlane(Value):
    """Two coordinates of q, the others held, seen in z.

    Attributes:
        lift: `z = F(q)`.
        at: (n,) where the other coordinates are held.
        indices: Of the two coordinates.
        errors: By how much the gap of each loop may be off by rounding of its numbers [m].
    """

    lift: Lift
    at: Array
    indices: tuple[int, int]
    errors: tuple[float, ...]

    @cached_property
    def fastest(self) -> Array:
        """(2,) how fast angles of the loops turn with each of the two coordinates, at most."""
        angles = np.concatenate([one.angles for one in self.lift.linkages])[:, self.indices]
        return np.maximum(np.abs(angles).max(axis=0), 1.0)

    def configurations(self, X: Array) -> Array:
        """Return q (N, n) of points (N, 2)."""
        Q = np.tile(self.at, (len(X), 1))
        Q[:, self.indices] = X
        return Q

    def lifted(self, X: Array) -> Array:
        """Return z (N, n + k) of points (N, 2)."""
        return self.lift(self.configurations(X))

    def jacobians(self, X: Array) -> Array:
        """Return dz by the two coordinates (N, n + k, 2)."""
        return self.lift.jacobians(self.configurations(X))[:, :, self.indices]

    def over(self, middle: Array, half: Array) -> LinearParts:
        """Return what holds z over boxes `middle +- half` (N, 2)."""
        wide = np.zeros((len(half), len(self.at)))
        wide[:, self.indices] = half
        return self.lift.linear(self.configurations(middle), wide, self.indices, self.errors)


@dataclass(frozen=True, eq=False)
class LoopContact:
    """Contact `|r(F(x))| <= threshold` of a boundary through loops.

    Attributes:
        name: The boundary.
        path: Over z.
        threshold: T [m].
        plane: What takes points of the plane to z.
    """

    name: str
    path: RelativePath
    threshold: float
    plane: LiftedPlane

    is_contact = True

    @property
    def source(self) -> str:
        """The boundary."""
        return self.name

    @property
    def fastest(self) -> Array:
        """(2,) how fast angles turn with each of the two coordinates, about."""
        return self.plane.fastest

    def value(self, X: Array) -> Array:
        """Return the separation less T (N,) [m]."""
        return separation.separations(self.path, self.plane.lifted(X)) - self.threshold

    def gradient(self, X: Array) -> Array:
        """Return its gradient (N, 2), by the chain rule; NaN where bodies overlap."""
        gradients = separation.gradients(self.path, self.plane.lifted(X))
        return np.einsum("nz,nza->na", gradients, self.plane.jacobians(X))

    def free(self, X: Array) -> Flags:
        """Return whether points (N, 2) are out of contact."""
        return np.asarray(self.value(X) > 0.0, dtype=np.bool_)


@dataclass(frozen=True, eq=False)
class LoopLimit:
    """What is linear in z: allowed where one of `ends_j - rows_j . z` is positive; of most there is but one.

    Attributes:
        name: What people read, e.g. ``"B upper"`` or ``"bar toggle upper"``.
        source: The joint, the loop, the rule or the boundary.
        rows: (p, n + k).
        ends: (p,) [rad or m].
        plane: What takes points of the plane to z.
        is_contact: Whether it is a stop of a boundary, and so open; limits are closed.
    """

    name: str
    source: str
    rows: Array
    ends: Array
    plane: LiftedPlane
    is_contact: bool = False

    @property
    def fastest(self) -> Array:
        """(2,) how fast angles turn with each of the two coordinates, about."""
        return self.plane.fastest

    def _each(self, X: Array) -> Array:
        return self.ends - self.plane.lifted(X) @ self.rows.T

    def value(self, X: Array) -> Array:
        """Return how far points (N, 2) are inside [rad or m]."""
        return self._each(X).max(axis=1)

    def gradient(self, X: Array) -> Array:
        """Return the gradient (N, 2)."""
        most = np.argmax(self._each(X), axis=1)
        return -np.einsum("nz,nza->na", self.rows[most], self.plane.jacobians(X))

    def free(self, X: Array) -> Flags:
        """Return whether points (N, 2) are out of contact; limits are for `Slice.within`, by their one rule."""
        if not self.is_contact:
            return np.ones(len(X), dtype=np.bool_)
        return np.asarray(self.value(X) > 0.0, dtype=np.bool_)

    def bounds(self, z: LinearParts) -> tuple[Array, Array]:
        """Return proven bounds (N,) of `value` over boxes."""
        rows = self.rows.T
        centre, wide = z.centre @ rows, np.abs(rows)
        moved = np.abs(z.steps @ rows).sum(axis=0) + z.off @ wide
        moved = np.minimum(moved, z.half @ wide)
        moved = moved + 64.0 * UNIT_ROUNDOFF * ((np.abs(z.centre) + z.half) @ wide + np.abs(self.ends))
        found = self.ends - centre
        return (found - moved).max(axis=1), (found + moved).max(axis=1)


@dataclass(frozen=True, eq=False)
class LoopFunction:
    """A contact or limit over the plane in units of its scales, for tracing.

    Attributes:
        curve: The contact or limit.
        scales: (2,).
    """

    curve: LoopContact | LoopLimit
    scales: Array

    def value(self, X: Array) -> Array:
        """Return the value (N,)."""
        return self.curve.value(X * self.scales)

    def value_gradient(self, X: Array) -> tuple[Array, Array]:
        """Return the value (N,) and its gradient (N, 2)."""
        return self.value(X), self.curve.gradient(X * self.scales) * self.scales


class LoopBounds:
    """Proven bounds of contacts and limits through loops over boxes of the plane."""

    def __init__(self, curves: Sequence[LoopContact | LoopLimit], low: Array, high: Array) -> None:
        """Put the contacts' paths side by side, with lever arms that hold between two corners (2,) of the plane."""
        self.curves, self.plane = tuple(curves), curves[0].plane
        self._contacts = [k for k, one in enumerate(curves) if isinstance(one, LoopContact)]
        self._place = np.full(len(curves), -1, dtype=np.intp)
        self._place[self._contacts] = np.arange(len(self._contacts))
        lower, upper = self.plane.configurations(np.stack((low, high)))
        box = self.plane.lift.over(lower[None], upper[None], self.plane.errors)
        self._extent = box.lower[0], box.upper[0]

    @cached_property
    def _bundle(self) -> tuple[SweptBundle, Array, Array]:
        chosen = [one for one in self.curves if isinstance(one, LoopContact)]
        swept = swept_bundle([one.path for one in chosen], *self._extent)
        error = rounding_bound(swept, None, *self._extent) + CONTOUR_ROUNDING * swept.reach
        return swept, error, np.array([one.threshold for one in chosen])

    def bounds(self, which: Ints, middle: Array, half: Array) -> tuple[Array, Array]:
        """Return bounds (P,) of the values of curves `which` (P,) over boxes `middle +- half` (P, 2).

        Rows of one box follow one another, so that F is bounded once a box.
        """
        lower, upper = np.empty(len(which)), np.empty(len(which))
        new = np.ones(len(which), dtype=np.bool_)
        new[1:] = np.any((middle[1:] != middle[:-1]) | (half[1:] != half[:-1]), axis=1)
        box, first = np.cumsum(new) - 1, np.flatnonzero(new)
        for start in range(0, len(first), _ROWS):
            chosen = first[start : start + _ROWS]
            z = self.plane.over(middle[chosen], half[chosen])
            rows = np.flatnonzero((box >= start) & (box < start + len(chosen)))
            lower[rows], upper[rows] = self._over(which[rows], z, box[rows] - start)
        return lower, upper

    def _over(self, which: Ints, z: LinearParts, box: Indices) -> tuple[Array, Array]:
        lower, upper = np.empty(len(which)), np.empty(len(which))
        for number, one in enumerate(self.curves):
            if isinstance(one, LoopLimit):
                rows = np.flatnonzero(which == number)
                if len(rows):
                    lower[rows], upper[rows] = one.bounds(z.take(box[rows]))
        rows = np.flatnonzero(self._place[which] >= 0)
        if len(rows):
            swept, error, threshold = self._bundle
            place, part = self._place[which[rows]], z.take(box[rows])
            found = over_box(swept, place, part.centre, part.half, error[place], part.steps, part.off)
            lower[rows], upper[rows] = found.lower - threshold[place], found.upper - threshold[place]
        return lower, upper
