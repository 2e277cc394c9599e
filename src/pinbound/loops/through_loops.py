"""Contacts and limits along one coordinate, or in a slice of two, through loops that are not parallelograms.

Over a box of these coordinates with middle c and half-widths h, F is `F(c) + sum_a s_a J_a h_a + e` with `s_a` in [-1,
1], J the middle of an interval that contains F', and a bound of |e| from the rest of this interval (`Lift.linear`). A
limit is linear in z, so it is exact except for e. The distance of two marks is bounded to second order as over any box
of z, with its linear part along the `J_a h_a` only: so coordinates of z that depend on q together do not count as
independent. `docs/loops.md` derives both.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from pinbound.bounds.swept_bounds import SweptBundle, over_box, rounding_bound, swept_bundle
from pinbound.contact.rule import ContactRule
from pinbound.evaluate import separation
from pinbound.exceptions import UnsupportedError
from pinbound.limits.univariate import gap_around
from pinbound.loops.lift import Lift, LinearParts
from pinbound.model.coupling import GuardedLimit, LinearLimit
from pinbound.path.relative import RelativePath
from pinbound.tolerances import CONTOUR_ROUNDING, ROOT, UNIT_ROUNDOFF
from pinbound.typing import Array, Flags, Indices, Ints
from pinbound.values import Value

__all__ = [
    "Contact",
    "LiftedPlane",
    "LoopBounds",
    "LoopContact",
    "LoopFunction",
    "LoopLimit",
    "contacts_through",
    "free_parts",
    "limits_through",
    "proven_end",
    "rules_through",
]

_ROWS = 2**12  # boxes whose F is bounded in one call
_MOST_OPEN = 2**14  # undecided pieces along a coordinate at one time
_NOISY = 1e-9  # rad or m: shorter pieces may be undecided by rounding alone


@dataclass(frozen=True, eq=False)
class LiftedPlane(Value):
    """One or two coordinates of q, with the others fixed, and their map to z.

    Attributes:
        lift: `z = F(q)`.
        at: (n,) the values of the other coordinates.
        indices: Indices of the p coordinates.
        errors: Bounds of the error of each loop's gap, by the rounding of its numbers [m].
    """

    lift: Lift
    at: Array
    indices: tuple[int, ...]
    errors: tuple[float, ...]

    @cached_property
    def fastest(self) -> Array:
        """(p,) the largest rates of the loops' angles with each of the coordinates."""
        angles = np.concatenate([one.angles for one in self.lift.linkages])[:, list(self.indices)]
        return np.maximum(np.abs(angles).max(axis=0), 1.0)

    def configurations(self, X: Array) -> Array:
        """Return q (N, n) of points (N, p)."""
        Q = np.tile(self.at, (len(X), 1))
        Q[:, list(self.indices)] = X
        return Q

    def lifted(self, X: Array) -> Array:
        """Return z (N, n + k) of points (N, p)."""
        return self.lift(self.configurations(X))

    def jacobians(self, X: Array) -> Array:
        """Return the derivatives of z by the coordinates (N, n + k, p)."""
        return self.lift.jacobians(self.configurations(X))[:, :, list(self.indices)]

    def over(self, middle: Array, half: Array) -> LinearParts:
        """Return bounds of z over boxes `middle +- half` (N, p)."""
        wide = np.zeros((len(half), len(self.at)))
        wide[:, list(self.indices)] = half
        return self.lift.linear(self.configurations(middle), wide, self.indices, self.errors)


@dataclass(frozen=True, eq=False)
class Contact:
    """Contact `|r| <= threshold` of a boundary in a slice.

    Attributes:
        name: The boundary.
        path: Its path.
        threshold: T [m].
    """

    name: str
    path: RelativePath
    threshold: float

    is_contact = True

    @property
    def source(self) -> str:
        """The boundary's name."""
        return self.name


@dataclass(frozen=True, eq=False)
class LoopContact(Contact):
    """Contact `|r(F(x))| <= threshold` of a boundary through loops; its path is over z.

    Attributes:
        plane: The map from points of the slice to z.
    """

    plane: LiftedPlane

    @property
    def fastest(self) -> Array:
        """(2,) about the rates of angles with each of the coordinates."""
        return self.plane.fastest

    def value(self, X: Array) -> Array:
        """Return the separation minus T (N,) [m]."""
        return separation.separations(self.path, self.plane.lifted(X)) - self.threshold

    def gradient(self, X: Array) -> Array:
        """Return its gradient (N, p), by the chain rule; NaN where bodies overlap."""
        gradients = separation.gradients(self.path, self.plane.lifted(X))
        return np.einsum("nz,nza->na", gradients, self.plane.jacobians(X))

    def free(self, X: Array) -> Flags:
        """Return whether points (N, p) are out of contact."""
        return np.asarray(self.value(X) > 0.0, dtype=np.bool_)


@dataclass(frozen=True, eq=False)
class LoopLimit:
    """A constraint that is linear in z: allowed if one of `ends_j - rows_j . z` is positive; most have only one.

    Attributes:
        name: The name for people, e.g. ``"B upper"`` or ``"bar toggle upper"``.
        source: The joint, the loop, the rule or the boundary.
        rows: (p, n + k).
        ends: (p,) [rad or m].
        plane: The map from points of the slice to z.
        is_contact: Whether it is a stop of a boundary, which is open; limits are closed.
    """

    name: str
    source: str
    rows: Array
    ends: Array
    plane: LiftedPlane
    is_contact: bool = False

    @property
    def fastest(self) -> Array:
        """(2,) about the rates of angles with each of the coordinates."""
        return self.plane.fastest

    def _each(self, X: Array) -> Array:
        return self.ends - self.plane.lifted(X) @ self.rows.T

    def value(self, X: Array) -> Array:
        """Return how far points (N, p) are inside [rad or m]."""
        return self._each(X).max(axis=1)

    def gradient(self, X: Array) -> Array:
        """Return the gradient (N, p)."""
        most = np.argmax(self._each(X), axis=1)
        return -np.einsum("nz,nza->na", self.rows[most], self.plane.jacobians(X))

    def free(self, X: Array) -> Flags:
        """Return whether points (N, p) are out of contact; for limits, `Slice.within` decides by their one rule."""
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
    """A contact or limit over the slice in units of its scales, for tracing.

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
        """Return the value (N,) and its gradient (N, p)."""
        return self.value(X), self.curve.gradient(X * self.scales) * self.scales


class LoopBounds:
    """Proven bounds of contacts and limits through loops over boxes of the slice."""

    def __init__(self, curves: Sequence[LoopContact | LoopLimit], low: Array, high: Array) -> None:
        """Bundle the contacts' paths, with lever arms that hold between two corners (2,) of the slice."""
        self.curves, self.plane = tuple(curves), curves[0].plane
        self._contacts = [k for k, one in enumerate(curves) if isinstance(one, LoopContact)]
        self._place = np.full(len(curves), -1, dtype=np.intp)
        self._place[self._contacts] = np.arange(len(self._contacts))
        lower, upper = self.plane.configurations(np.stack((low, high)))
        box = self.plane.lift.over(lower[None], upper[None], self.plane.errors)
        more = 2.0 * math.pi * np.nansum([np.abs(jump) for _, jump in self._turns], axis=0)
        self._extent = box.lower[0] - more, box.upper[0] + more

    @cached_property
    def _turns(self) -> list[tuple[int, Array]]:
        """For each loop whose X may go around zero: its turn's index, and the jump of z in turns when it jumps by one.

        It is NaN if another loop uses a coordinate that jumps.
        """
        lift, found = self.plane.lift, list[tuple[int, Array]]()
        for one, columns in zip(lift.linkages, lift.columns, strict=True):
            if len(columns) < 4:
                continue
            jump = np.zeros(len(lift.names))
            jump[list(columns[:2])], jump[columns[3]] = one.turns_with_x, 1.0
            moved = np.flatnonzero(jump)
            for other in lift.linkages:
                uses = (np.any(part[..., moved[moved < part.shape[-1]]]) for part in (other.angles, other.rows))
                if other is not one and any(uses):
                    jump[:] = np.nan
            found.append((columns[3], jump))
        return found

    @cached_property
    def _bundle(self) -> tuple[SweptBundle, Array, Array]:
        chosen = [one for one in self.curves if isinstance(one, LoopContact)]
        swept = swept_bundle([one.path for one in chosen], *self._extent)
        error = rounding_bound(swept, None, *self._extent) + CONTOUR_ROUNDING * swept.reach
        return swept, error, np.array([one.threshold for one in chosen])

    def bounds(self, which: Ints, middle: Array, half: Array) -> tuple[Array, Array]:
        """Return bounds (P,) of the values of curves `which` (P,) over boxes `middle +- half` (P, p).

        Rows of one box are consecutive, so that F is bounded once for each box.
        """
        lower, upper = np.empty(len(which)), np.empty(len(which))
        new = np.ones(len(which), dtype=np.bool_)
        new[1:] = np.any((middle[1:] != middle[:-1]) | (half[1:] != half[:-1]), axis=1)
        box, first = np.cumsum(new) - 1, np.flatnonzero(new)
        for start in range(0, len(first), _ROWS):
            chosen = first[start : start + _ROWS]
            z = self.plane.over(middle[chosen], half[chosen])
            rows = np.flatnonzero((box >= start) & (box < start + len(chosen)))
            lower[rows], upper[rows] = self._around(which[rows], z, box[rows] - start)
        return lower, upper

    def _around(self, which: Ints, z: LinearParts, box: Indices) -> tuple[Array, Array]:
        """Return bounds that hold on both sides of a cut, for boxes that may contain one.

        F continues smoothly over the cut, and there it differs from the passive joints by full turns.
        """
        lower, upper = self._over(which, z, box)
        cut = np.zeros(len(box), dtype=np.intp)
        for column, jump in self._turns:
            reach = np.minimum(np.abs(z.steps[:, :, column]).sum(axis=0) + z.off[:, column], z.half[:, column])
            rows = np.flatnonzero(~(np.abs(z.centre[:, column]) + reach < (1.0 - _NOISY) * math.pi)[box])
            if not len(rows):
                continue
            cut[rows] += 1
            beyond = np.where(z.centre[:, column] > 0.0, -2.0 * math.pi, 2.0 * math.pi)
            other = replace(z, centre=z.centre + beyond[:, None] * jump)
            low, high = self._over(which[rows], other, box[rows])
            lower[rows], upper[rows] = np.minimum(lower[rows], low), np.maximum(upper[rows], high)
        open_ = (cut > 1) | ~np.isfinite(lower) | ~np.isfinite(upper)
        return np.where(open_, -np.inf, lower), np.where(open_, np.inf, upper)

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


def limits_through(limit: LinearLimit, plane: LiftedPlane) -> list[LoopLimit]:
    """Return both ends of a limit over z, if they are finite."""
    c, o = limit.coefficients, limit.offset
    ends = (("upper", c, limit.upper - o), ("lower", -c, o - limit.lower))
    return [
        LoopLimit(f"{limit.joint} {name}", limit.joint, row[None], np.array([end]), plane)
        for name, row, end in ends
        if math.isfinite(end)
    ]


def rules_through(guarded: Iterable[GuardedLimit], plane: LiftedPlane) -> list[LoopLimit]:
    """Return guarded ends over z: allowed if the end is kept, or if a condition does not hold."""
    found: list[LoopLimit] = []
    for one in guarded:
        rows: list[Array] = []
        ends: list[float] = []
        for limit, sign in ((one.limit, 1.0), *((condition, -1.0) for condition in one.where)):
            for row, end in (
                (limit.coefficients, limit.upper - limit.offset),
                (-limit.coefficients, limit.offset - limit.lower),
            ):
                if math.isfinite(end):
                    rows.append(sign * row)
                    ends.append(sign * end)
        found.append(LoopLimit(one.name, one.rule, np.array(rows), np.array(ends), plane))
    return found


def contacts_through(
    name: str, rule: ContactRule, plane: LiftedPlane, margin: float = 0.0
) -> list[LoopContact | LoopLimit]:
    """Return the contact of a boundary over z; for a stop, both ends of home's gap, which are linear in z."""
    if rule.stop is None:
        return [LoopContact(name, rule.path, rule.raised(margin), plane)]
    strips = rule.strips(margin)
    assert strips is not None
    c, (strip, *_) = strips
    assert strip.half_width is not None
    low, high = gap_around(strip.angle, strip.half_width, 0.5 * (rule.stop.gap[0] + rule.stop.gap[1]))
    return [
        LoopLimit(name, name, row[None], np.array([end]), plane, is_contact=True)
        for row, end in ((c, high), (-c, -low))
    ]


def proven_end(bounds: LoopBounds, value: float, end: float) -> tuple[float, int]:
    """Return how far from a value towards an end all curves are proven positive, and which one stops it (-1: none).

    A proven step is taken, and the next one is twice as long; other steps are halved. The bounds are exact to second
    order. So next to a simple zero at least half of the remaining distance is proven in one step. At the end, a curve
    is zero to `tolerances.ROOT`.
    """
    which, x, step = np.arange(len(bounds.curves)), value, abs(end - value)
    while x != end:
        step = min(step, abs(end - x))
        reached = end if step == abs(end - x) else x + math.copysign(step, end - value)
        middle = np.full((len(which), 1), 0.5 * (x + reached))
        lower, _ = bounds.bounds(which, middle, np.full_like(middle, 0.5 * abs(reached - x) * (1.0 + 1e-9)))
        if np.all(lower > 0.0):
            x, step = reached, 2.0 * step
        elif step <= ROOT * max(1.0, abs(x)):
            return x, int(np.argmin(lower))
        else:
            step *= 0.5
    return end, -1


def free_parts(bounds: LoopBounds, low: float, high: float, name: str) -> Array:
    """Return the intervals (k, 2) of [low, high] on which all curves are positive; what is not proven free is contact.

    Raises:
        UnsupportedError: If a curve is zero up to rounding along an interval.
    """
    count, start, half = len(bounds.curves), np.array([low]), 0.5 * (high - low)
    free, fewest = list[Array](), _MOST_OPEN
    while len(start):
        which, middle = np.tile(np.arange(count), len(start)), np.repeat(start + half, count)[:, None]
        found = bounds.bounds(which, middle, np.full_like(middle, half * (1.0 + 1e-9)))
        lower, upper = (one.reshape(-1, count).min(axis=1) for one in found)
        free += [np.stack((start, start + 2.0 * half), axis=1)[lower > 0.0]]
        start = start[(lower <= 0.0) & (upper > 0.0)]
        if half <= ROOT * max(1.0, abs(low), abs(high)):
            break
        if len(start) > _MOST_OPEN:
            raise UnsupportedError(
                f"along {name!r} a contact through loops stays within rounding of the threshold over a whole "
                "interval; change the threshold, or give a smaller window (window=)"
            )
        fewest = min(fewest, len(start))
        if half <= _NOISY and len(start) > 4 * fewest:  # more than one piece for each contact: the rest is rounding
            break
        half *= 0.5
        start = np.concatenate((start, start + 2.0 * half))
    parts = np.concatenate(free) if free else np.empty((0, 2))
    parts = parts[np.argsort(parts[:, 0])]
    first = np.ones(len(parts), dtype=np.bool_)
    first[1:] = parts[1:, 0] - parts[:-1, 1] > 4.0 * UNIT_ROUNDOFF * (1.0 + np.abs(parts[1:, 0]))
    last = np.append(first[1:], True)[: len(parts)]
    return np.stack((parts[first, 0], parts[last, 1]), axis=1)
