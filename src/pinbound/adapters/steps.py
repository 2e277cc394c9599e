"""Rows that are safe for a whole step: linear in the step, and no step that keeps them meets a boundary on its way.

With a unit vector n that stands still, every corner c of a pair of marks gives `phi_c(q) = n . r_c(q)`, and the
separation is at least `min_c phi_c`. Over a step d within the box `|d_j| <= s_j`,

    phi_c(q + d) >= phi_c(q) + g_c . d - K_c,       K_c = sup |d^2 r_c| / 2 over the box,

so that `-g_c . d <= phi_c(q) - T - K_c`, a row a corner, keeps the pair apart for all of the step. K_c is what lever
arms prove (`interpreters.bounds`) and falls with the square of the box: the box is made smaller until standing still
keeps all rows. Stops and joint limits are linear in q. `docs/steps.md` derives it, and says what happens near contact.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pinbound.boundaries.boundary import Boundary, one_configuration
from pinbound.bounds.bounds import box_terms
from pinbound.bounds.rounding import walks
from pinbound.bounds.swept_bounds import SweptBundle, all_rows, rounding_bound, separated, swept_bundle
from pinbound.exceptions import DimensionError, UnsupportedError
from pinbound.model.coupling import real_array
from pinbound.robot.robot import Robot, refuse_conditions
from pinbound.tolerances import INFLATION, LIMIT, STEP_BOX, UNIT_ROUNDOFF
from pinbound.typing import Array, Indices
from pinbound.values import Value

__all__ = ["StepBounds", "StepRows"]

_FEW = 8  # pairs of vertices that have a row each; of more, one row with the loss of the others


@dataclass(frozen=True, eq=False)
class StepRows(Value):
    """`A d <= b` and `|d| <= step`: a step d that keeps both is safe, and so is the straight way to its end.

    Attributes:
        A: (k, n), over the robot's coordinates.
        b: (k,) [m; rad or m for joint limits]; none is negative unless `blocked` names its boundary.
        step: (n,) the box [rad or m]; at most what was asked for.
        names: Of each row, its boundary or joint limit.
        scale: `step` over what was asked for, in (0, 1].
        blocked: Boundaries and joint limits that q does not keep, as far as is proved: their rows ask for a way out,
            which may not exist within the box, and nothing is promised of them.
    """

    A: Array
    b: Array
    step: Array
    names: tuple[str, ...]
    scale: float
    blocked: tuple[str, ...] = ()

    @property
    def half_spaces(self) -> tuple[Array, Array]:
        """All rows, those of the box too: (k + 2 n, n) and (k + 2 n,)."""
        unit = np.eye(len(self.step))
        return np.vstack((self.A, unit, -unit)), np.concatenate((self.b, self.step, self.step))


@dataclass(frozen=True)
class _Row:
    """`value + g . d - linear x - bend x^2 > 0` is asked for, x in [0, 1] being the scale of the box."""

    name: str
    value: float
    g: Array
    linear: float = 0.0
    bend: float = 0.0
    margin: float = 0.0
    share: float = 1.0

    def fits(self, loss: float, more: float = 0.0) -> float:
        """Return the largest scale at which the losses, and `more` a scale, are at most `loss`."""
        if loss <= 0.0:
            return 0.0
        linear = self.linear + more
        below = linear + math.sqrt(linear * linear + 4.0 * self.bend * loss)
        return 2.0 * loss / below if below > 0.0 else math.inf

    def loss(self, scale: float) -> float:
        """Return what may be lost at a scale of the box."""
        return self.linear * scale + self.bend * scale * scale

    def bound(self, scale: float) -> float:
        """Return b: what is proved to be safe, and no nearer than the margin; outwards where q is in contact."""
        safe = self.value - self.loss(scale)
        return safe if self.value <= 0.0 else min(safe, max(self.share * (self.value - self.margin), 0.0))


class StepBounds:
    """Makes step-safe rows for one robot.

    Example:
        >>> import pinbound as pb, numpy as np
        >>> robot = pb.load("minervabot_v3")
        >>> rows = pb.StepBounds(robot).rows(robot.home, 0.2)
        >>> rows.names, rows.A.shape, rows.scale
        (('beta_9', 'beta_10'), (2, 3), 1.0)
        >>> np.degrees(rows.b).round(3).tolist()
        [4.23, 5.072]
    """

    def __init__(self, robot: Robot, boundaries: Sequence[str] | str | None = None) -> None:
        """Prepare bounds of a robot's boundaries, by name; None: all.

        Raises:
            UnknownNameError: If the robot has no boundary of a name.
            UnsupportedError: If the robot has rules with conditions.
        """
        refuse_conditions(robot, "Rows of a step")
        self.robot = robot
        self.boundaries = robot.boundaries if boundaries is None else robot.boundaries.select(boundaries)
        self.stops = [one for one in self.boundaries if one.is_stop]
        self._areas: tuple[Boundary, ...] = tuple(one for one in self.boundaries if not one.is_stop)
        self._box: tuple[Array, Array] | None = None
        self._groups: list[_Group] = []
        self._moved = self._known = self._there = self._slack = np.zeros(0)

    def rows(
        self,
        q: ArrayLike,
        step: ArrayLike,
        *,
        limits: bool = True,
        most: int | None = None,
        gain: float = 0.5,
        margin: float = 1e-3,
        reserve: float = 1e-6,
    ) -> StepRows:
        """Return the rows at q for steps d of at most `step` in each coordinate.

        While `blocked` is empty, d = 0 keeps all rows: they alone never make a QP infeasible. Rows that no d in the box
        can break are left out, which is proved of each.

        Args:
            q: (n,).
            step: The largest step, (n,) or one number for all [rad or m]; positive.
            limits: Whether rows of joint limits, those of mimic joints too, are made.
            most: At most so many rows beside those of `blocked`: the box is made smaller until no more can be broken
                in it. None: all that can.
            gain: Share of a clearance that one step may use, in (0, 1].
            margin: [m] Nearer than this no boundary is approached, so that motion along it stays possible: the box
                shrinks with the root of the clearance. A boundary that is nearer already may be followed or left.
            reserve: [m] for what a solver may leave of a row: give more than its tolerance.

        Raises:
            DimensionError: If q or step are of another shape or not finite, or an argument is outside its range.
            UnsupportedError: If joint limits are left out though bounds of the boundaries hold within them only.
        """
        if not limits and any(one.place_error for one in self.boundaries):
            said = "where sides of closed loops differ, links are where the coupling puts them within joint limits only"
            raise UnsupportedError(f"{said}; leave limits=True")
        point = one_configuration(q, self.robot.coordinates)
        asked = self._checked(step, gain, margin, reserve, most)
        half = asked * STEP_BOX
        areas = self._area_rows(point, half, reserve, margin, gain)
        ends = self._stop_rows(point, reserve, gain) + (self._limit_rows(point) if limits else [])
        blocked = [row.name for row in areas if row.value <= 0.0] + [row.name for row in ends if row.value < 0.0]
        found = [row for row in areas + ends if row.value - row.loss(1.0) - float(np.abs(row.g) @ half) <= 0.0]
        scale = min([1.0, *[row.fits(gain * row.value) for row in found if row.value > 0.0]])
        if most is not None:
            reach = [row.fits(row.value, float(np.abs(row.g) @ half)) for row in found]
            free = sorted(x for row, x in zip(found, reach, strict=True) if row.name not in blocked)
            if len(free) > most:
                scale = min(scale, free[most] * (1.0 - LIMIT))
                found = [row for row, x in zip(found, reach, strict=True) if x <= scale or row.name in blocked]
        return StepRows(
            A=-np.array([row.g for row in found]).reshape(-1, len(point)),
            b=np.array([row.bound(scale) for row in found]),
            step=asked * scale,
            names=tuple(row.name for row in found),
            scale=float(scale),
            blocked=tuple(dict.fromkeys(blocked)),
        )

    def _checked(self, step: ArrayLike, gain: float, margin: float, reserve: float, most: int | None) -> Array:
        given, n = real_array(step, "step"), len(self.robot.coordinates)
        if given.shape not in ((), (n,)) or not np.all(np.isfinite(given)) or not np.all(given > 0.0):
            raise DimensionError(f"step is {step!r}; give one positive number, or {n} of them [rad, or m of a slide]")
        if not 0.0 < gain <= 1.0:
            raise DimensionError(f"gain is {gain}; give a share above 0, at most 1")
        if not (0.0 <= margin < np.inf and 0.0 <= reserve < np.inf):
            raise DimensionError(f"margin is {margin} and reserve {reserve}; give metres, not below 0")
        if most is not None and most < 1:
            raise DimensionError(f"most is {most}; give the number of rows, at least 1, or None")
        return np.broadcast_to(given, (n,)).astype(np.float64)

    def _stop_rows(self, q: Array, reserve: float, gain: float) -> list[_Row]:
        """Return both ends of every stop's gap: linear in q, so that nothing is lost."""
        rows: list[_Row] = []
        for boundary in self.stops:
            stop: Any = boundary.rule.stop
            c, (low, high), phi = stop.coefficients, stop.free_gap, float(stop.coefficients @ q)
            kept = LIMIT + UNIT_ROUNDOFF * (len(q) + 8.0) * (float(np.abs(c) @ np.abs(q)) + abs(low) + abs(high))
            for room, g in ((phi - low, c), (high - phi, -c)):
                value = room - kept - 2.0 * reserve / stop.amplitude
                rows.append(_Row(boundary.name, max(value, 0.0) if room > kept else value, g, share=gain))
        return rows

    def _limit_rows(self, q: Array) -> list[_Row]:
        rows: list[_Row] = []
        for limit in self.robot.linear_limits:
            value = float(limit.coefficients @ q) + limit.offset
            for room, sign in ((limit.upper - value, -1.0), (value - limit.lower, 1.0)):
                if np.isfinite(room):
                    within = max(room, 0.0) if room >= -LIMIT else room
                    rows.append(_Row(limit.joint, within, sign * limit.coefficients))
        return rows

    def _area_rows(self, q: Array, half: Array, reserve: float, margin: float, gain: float) -> list[_Row]:
        rows: list[_Row] = []
        near = self._near(q, half, reserve)
        for group in self._groups if len(near) else ():
            which = np.flatnonzero(np.isin(group.places, near))
            if not len(which):
                continue
            bundle, count = group.bundle, group.bundle.rows
            terms = box_terms(
                bundle.chains, bundle.arms, all_rows(bundle, which), *_repeated(q, half, len(which) * count)
            )
            r = terms.r.T.reshape(-1, count, 3)
            _, n, _, _ = separated(bundle, which, r)
            along = np.einsum("mci,mi->mc", r, n)
            rates = np.einsum("jimc,mi->mcj", np.array(terms.rates).reshape(len(q), 3, len(which), count), n) / half
            bend = 0.5 * np.asarray(terms.second).reshape(-1, count) * INFLATION
            off = group.error[which] * (1.0 + terms.wide.reshape(-1, count).max(axis=1)) + reserve
            for place, k in enumerate(map(int, group.places[which])):
                boundary = self._areas[k]
                value = along[place].copy()
                value[0] -= boundary.rule.distance + off[place]
                rows += _corner_rows(boundary, value, rates[place], bend[place], half, margin, gain)
        return rows

    def _near(self, q: Array, half: Array, reserve: float) -> Indices:
        """Return the places of the boundaries that some step may reach; proved of the others, mostly from earlier q.

        A separation changes by at most `moved . |change of q|`, so that one that was measured bounds it elsewhere.
        """
        if not self._areas:
            return np.zeros(0, dtype=np.intp)
        self._prepare(q, half)
        known, there = self._known, self._there
        reach = self._moved @ half * INFLATION + self._slack + reserve
        while True:
            least = known - np.einsum("mn,mn->m", self._moved, np.abs(q - there)) * INFLATION
            near = np.flatnonzero(~(least - reach > 0.0))
            stale = [k for k in map(int, near) if not np.array_equal(there[k], q)]
            for k in stale:
                known[k], there[k] = float(self._areas[k].signed_clearance(q)), q
            if not stale:
                return near

    def _prepare(self, q: Array, half: Array) -> None:
        """Make bounds that hold in a box around q, anew when steps lead out of it."""
        box = self._box
        if box is not None and np.all(q - half >= box[0]) and np.all(q + half <= box[1]):
            return
        ends = q - half - 1.0, q + half + 1.0
        lower, upper = ends if box is None else (np.minimum(box[0], ends[0]), np.maximum(box[1], ends[1]))
        self._box = lower, upper
        m, n = len(self._areas), len(q)
        if box is None:
            self._known, self._there = np.full(m, np.nan), np.full((m, n), np.nan)
        self._moved, self._slack, groups = np.zeros((m, n)), np.zeros(m), list[_Group]()
        for edges in sorted({len(one.path.difference.directions) for one in self._areas}):
            places = np.array(
                [k for k, one in enumerate(self._areas) if len(one.path.difference.directions) == edges], np.intp
            )
            chosen = [self._areas[k] for k in map(int, places)]
            bundle = swept_bundle([one.path for one in chosen], lower, upper)
            links = [(one.ancestor, one.point_a.link, one.point_b.link) for one in chosen]
            error = rounding_bound(bundle, walks(self.robot.tree, self.robot.coupling, links), lower, upper)
            moved = np.einsum("mk,mkn->mn", bundle.arms, np.abs(bundle.chains.coefficients))
            if bundle.chains.slides is not None:
                moved = moved + np.linalg.norm(bundle.chains.slides, axis=2).sum(axis=1)
            self._moved[places], self._slack[places] = moved[:: bundle.rows], 8.0 * error
            groups.append(_Group(places, bundle, error))
        self._groups = groups


@dataclass(frozen=True)
class _Group:
    """Boundaries of one number of edge vectors: their places, paths side by side, and rounding bounds [m]."""

    places: Indices
    bundle: SweptBundle
    error: Array


def _repeated(q: Array, half: Array, count: int) -> tuple[Array, Array]:
    return np.tile(q, (count, 1)), np.tile(half, (count, 1))


def _corner_rows(
    boundary: Boundary, value: Array, rates: Array, bend: Array, half: Array, margin: float, gain: float
) -> list[_Row]:
    """Return a row for each pair of vertices, or one row with what the others may lose; `bend[0]` is that of any pair.

    A separation along a direction is the least over the vertices of either body, so that each side is looked at alone.
    """
    first, second = boundary.path.difference.corners
    if len(first) * len(second) <= _FEW:
        found: list[_Row] = []
        for pair in product(first, second):
            chosen = np.concatenate(([1.0], *pair))
            found.append(_Row(boundary.name, float(chosen @ value), chosen @ rates, 0.0, float(bend[0]), margin, gain))
        return found
    split = 1 + first.shape[1]
    taken, loss = [np.ones(1)], 0.0
    for corners, edges in ((first, slice(1, split)), (second, slice(split, None))):
        heights = corners @ value[edges]
        least = int(np.argmin(heights))
        away = corners - corners[least]
        swing = np.abs(away @ rates[edges]) @ half + np.abs(away) @ bend[edges] - (heights - heights[least])
        loss += float(np.maximum(swing, 0.0).max())
        taken.append(corners[least])
    chosen = np.concatenate(taken)
    lost = loss * INFLATION
    return [_Row(boundary.name, float(chosen @ value), chosen @ rates, lost, float(bend[0]), margin, gain)]
