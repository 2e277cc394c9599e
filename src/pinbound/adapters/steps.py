"""Linear inequalities for one step of a controller: a step that satisfies them meets no boundary on its way.

Let n be a fixed unit vector. Every corner c of a pair of marks gives `phi_c(q) = n . r_c(q)`, and the separation is at
least `min_c phi_c`. For a step d within the box `|d_j| <= s_j`,

    phi_c(q + d) >= phi_c(q) + g_c . d - K_c,       K_c = sup |d^2 r_c| / 2 over the box,

so that the rows `-g_c . d <= phi_c(q) - T - K_c`, one for each corner, keep the pair apart during the whole step. Lever
arms prove K_c (`bounds/bounds`); it falls with the square of the box. The box is made smaller until d = 0 satisfies all
rows. Stops and joint limits are linear in q. `docs/steps.md` has the derivation, and says what happens near contact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pinbound.adapters.step_terms import StepTerms, load_code, step_terms
from pinbound.boundaries.boundary import Boundary, one_configuration
from pinbound.bounds.rounding import walks
from pinbound.certificates.trajectory import refuse_far
from pinbound.exceptions import DimensionError, UnsupportedError
from pinbound.kernel.hulls import HullTables, is_ready, prepare_hulls, tables_of
from pinbound.kernel.program import Pair
from pinbound.machine.compiled import has_numba
from pinbound.model.coupling import real_array
from pinbound.robot.robot import Robot, refuse_conditions
from pinbound.tolerances import INFLATION, LIMIT, STEP_BOX, STEP_LIMIT, STEP_SEARCH, UNIT_ROUNDOFF
from pinbound.typing import AnyArray, Array, Flags, Indices
from pinbound.values import Value

__all__ = ["StepBounds", "StepRows"]

_WORTH = 100_000  # measured boundaries from which compiling machine code (some seconds, once a machine) pays
_FARTHEST = 1e6  # larger coordinates are measured by the reference
_SMALLEST = 1e-6  # of a box, in which the boundaries of the second group are bounded
_PROBED = 8  # boundaries that are bounded first: they shrink the box for the others


@dataclass(frozen=True, eq=False)
class StepRows(Value):
    """Rows `A d <= b` and a box `|d_i| <= step_i`: if d satisfies both, q + t d is free for every t from 0 to 1.

    Attributes:
        A: (k, n), over the robot's coordinates.
        b: (k,) [m; rad or m for joint limits]; none is negative unless `blocked` names its boundary.
        step: (n,) the box [rad or m]; at most what was asked for.
        names: The boundary or joint limit of each row.
        scale: The ratio of `step` to the step that was asked for, in (0, 1].
        blocked: Boundaries and joint limits that q violates, or that are not proven to hold at q. Their rows ask for a
            step out of contact, which may not exist within the box. Nothing is guaranteed for them.

    Example:
        >>> import pinbound as pb
        >>> robot = pb.load("minervabot_v3")
        >>> rows = pb.StepBounds(robot).rows(robot.home, 0.2)
        >>> rows.A.shape, rows.b.shape, rows.blocked
        ((2, 3), (2,), ())
    """

    A: Array
    b: Array
    step: Array
    names: tuple[str, ...]
    scale: float
    blocked: tuple[str, ...] = ()

    @property
    def half_spaces(self) -> tuple[Array, Array]:
        """All rows with those of the box: A (k + 2 n, n) and b (k + 2 n,)."""
        unit = np.eye(len(self.step))
        return np.vstack((self.A, unit, -unit)), np.concatenate((self.b, self.step, self.step))


_VALUE, _LINEAR, _BEND, _MARGIN, _SHARE, _G = range(6)
"""Columns of the numbers of a row; the last columns are its rates."""


@dataclass(frozen=True, eq=False)
class _Rows:
    """Rows `value + g . d - linear x - bend x^2 > 0`, with the scale x of the box in [0, 1].

    Only rows are kept that, as far as is proven, some step within the whole box may violate.
    """

    names: AnyArray
    numbers: Array

    @classmethod
    def of(
        cls,
        names: AnyArray,
        value: Array,
        g: Array,
        share: float,
        margin: float = 0.0,
        loss: tuple[Array | float, Array | float] = (0.0, 0.0),
    ) -> _Rows:
        """Return rows with the same margin and share."""
        numbers = np.empty((len(value), _G + g.shape[1]))
        numbers[:, _VALUE], (numbers[:, _LINEAR], numbers[:, _BEND]) = value, loss
        numbers[:, _MARGIN], numbers[:, _SHARE], numbers[:, _G:] = margin, share, g
        return cls(names, numbers)

    @classmethod
    def joined(cls, parts: Sequence[_Rows]) -> _Rows:
        """Return the rows of all parts."""
        return cls(np.concatenate([part.names for part in parts]), np.concatenate([part.numbers for part in parts]))

    def take(self, which: Indices | Flags) -> _Rows:
        """Return some of the rows."""
        return _Rows(self.names[which], self.numbers[which])

    @property
    def value(self) -> Array:
        """(r,) clearance that is proven at q [m; rad or m for joint limits]."""
        return self.numbers[:, _VALUE]

    @property
    def g(self) -> Array:
        """(r, n) its rates."""
        return self.numbers[:, _G:]

    def fits(self, loss: Array, more: Array | float = 0.0) -> Array:
        """Return the largest scale at which the losses, and `more` times the scale, are at most `loss`."""
        linear = self.numbers[:, _LINEAR] + more
        below = linear + np.sqrt(linear * linear + 4.0 * self.numbers[:, _BEND] * np.maximum(loss, 0.0))
        is_some = loss > 0.0
        return np.divide(2.0 * loss, below, out=np.where(is_some, np.inf, 0.0), where=is_some & (below > 0.0))

    @property
    def nearness(self) -> Array:
        """The clearances in units of the margin, at most 1."""
        margin = self.numbers[:, _MARGIN]
        return np.minimum(1.0, np.divide(self.value, margin, out=np.ones(len(margin)), where=margin > 0.0))

    def swing(self, half: Array) -> Array:
        """Return the largest decrease of the linear part within the box."""
        return np.abs(self.g) @ half

    def loss(self, scale: float) -> Array:
        """Return the loss at a scale of the box."""
        return self.numbers[:, _LINEAR] * scale + self.numbers[:, _BEND] * scale * scale

    def bound(self, scale: float) -> Array:
        """Return b: proven to be safe, and not nearer than the margin; outwards where q is in contact."""
        value, safe = self.value, self.value - self.loss(scale)
        kept = np.maximum(self.numbers[:, _SHARE] * (value - self.numbers[:, _MARGIN]), 0.0)
        return np.where(value > 0.0, np.minimum(safe, kept), safe)


class StepBounds:
    """Makes rows that are safe for a whole step, for one robot.

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
        self._terms: StepTerms | None = None
        self._names = np.array([one.name for one in self._areas], dtype=object)
        self._distances = np.array([one.rule.distance for one in self._areas])
        self._moved = self._known = self._there = self._slack = np.zeros(0)
        self._asked, self._is_worth = 0, False

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

        While `blocked` is empty, d = 0 satisfies all rows, so these rows alone never make a QP infeasible. A row is
        left out if it is proven that no d in the box can violate it.

        Args:
            q: (n,).
            step: The largest step, (n,) or one number for all [rad or m]; positive.
            limits: Whether to make rows for joint limits, also those of mimic joints.
            most: The largest number of rows, those of `blocked` aside. The box is made smaller until no other row can
                be violated in it. None: no bound.
            gain: The share of a clearance that one step may use, in (0, 1].
            margin: [m] No step comes nearer to a boundary than this. So motion along it stays possible, although the
                box shrinks with the square root of the clearance. If a boundary is nearer already, steps may go along
                it or away.
            reserve: [m] Allowance for errors of the solver: give more than its tolerance.

        Raises:
            DimensionError: If q or step has another shape or is not finite, if q can pass `tolerances.FARTHEST`, or if
                an argument is outside its range.
            UnsupportedError: If joint limits are left out, but the bounds of a boundary hold only within them.
        """
        if not limits and any(one.place_error for one in self.boundaries):
            said = (
                "the sides of a closed loop differ, so the places of its links are proven within the joint limits only"
            )
            raise UnsupportedError(f"{said}; leave limits=True")
        point = one_configuration(q, self.robot.coordinates)
        asked = self._checked(step, gain, margin, reserve, most)
        half = asked * STEP_BOX
        low, high = self._reached(point, half, limits)
        refuse_far(low, high, self.robot.coordinates)
        self._prepare(low, high)
        areas = self._area_rows(point, half, reserve, margin, gain)
        ends = [self._stop_rows(point, half, reserve, gain)] if self.stops else []
        found = _Rows.joined([areas, *ends, *([self._limit_rows(point, half)] if limits else [])])
        in_contact = found.value < 0.0
        in_contact[: len(areas.names)] = ~(areas.value > 0.0)
        blocked = dict.fromkeys(found.names[in_contact].tolist())
        scale = _scale(found, gain)
        if most is not None:
            reach = found.fits(found.value, found.swing(half))
            is_blocked = np.array([name in blocked for name in found.names], dtype=np.bool_)
            free = np.sort(reach[~is_blocked])
            if len(free) > most:
                scale = min(scale, float(free[most]) * (1.0 - LIMIT))
                found = found.take((reach <= scale) | is_blocked)
        found = found.take(
            found.bound(scale) <= scale * found.swing(half)
        )  # no step in the box violates any of the others
        return StepRows(
            A=-found.g,
            b=found.bound(scale),
            step=asked * scale,
            names=tuple(found.names.tolist()),
            scale=float(scale),
            blocked=tuple(blocked),
        )

    def _checked(self, step: ArrayLike, gain: float, margin: float, reserve: float, most: int | None) -> Array:
        given, n = real_array(step, "step"), len(self.robot.coordinates)
        if given.shape not in ((), (n,)) or not np.all(np.isfinite(given)) or not np.all(given > 0.0):
            raise DimensionError(
                f"step is {step!r}; give one positive number, or {n} of them [rad, or m of a prismatic joint]"
            )
        if not 0.0 < gain <= 1.0:
            raise DimensionError(f"gain is {gain}; give a share above 0, at most 1")
        if not (0.0 <= margin < np.inf and 0.0 <= reserve < np.inf):
            raise DimensionError(f"margin is {margin} and reserve {reserve}; give metres, not below 0")
        if most is not None and most < 1:
            raise DimensionError(f"most is {most}; give the number of rows, at least 1, or None")
        return np.broadcast_to(given, (n,)).astype(np.float64)

    @cached_property
    def _stop_ends(self) -> tuple[Array, Array, Array, Array, AnyArray]:
        """Both ends of each stop's gap as `side . q + offset`: sides (k, n), offsets, sizes, amplitudes, names."""
        n = len(self.robot.coordinates)
        rules: list[Any] = [one.rule.stop for one in self.stops]
        c = np.repeat(np.array([stop.coefficients for stop in rules]).reshape(-1, n), 2, axis=0)
        gaps = np.array([stop.free_gap for stop in rules]).reshape(-1, 2)
        sign = np.tile((1.0, -1.0), len(rules))
        size = np.repeat(np.abs(gaps).sum(axis=1), 2)
        amplitudes = np.repeat(np.array([stop.amplitude for stop in rules]), 2)
        names = [one.name for one in self.stops for _ in range(2)]
        return sign[:, None] * c, -sign * gaps.ravel(), size, amplitudes, np.array(names, dtype=object)

    def _stop_rows(self, q: Array, half: Array, reserve: float, gain: float) -> _Rows:
        """Return the ends of the gaps of stops that a step may reach: linear in q, so nothing is lost."""
        sides, offsets, size, amplitudes, names = self._stop_ends
        room = sides @ q + offsets
        kept = LIMIT + UNIT_ROUNDOFF * (len(q) + 8.0) * (np.abs(sides) @ np.abs(q) + size)
        value = room - kept - 2.0 * reserve / amplitudes
        value = np.where(room > kept, np.maximum(value, 0.0), value)
        reached = np.flatnonzero(~(value - np.abs(sides) @ half > 0.0))
        return _Rows.of(names[reached], value[reached], sides[reached], gain)

    @cached_property
    def _limit_ends(self) -> tuple[Array, Array, AnyArray]:
        """Finite ends of all joint limits as `side . q + offset`: sides (k, n), offsets (k,), names."""
        sides, offsets, names = list[Array](), list[float](), list[str]()
        for limit in self.robot.linear_limits:
            for end, sign in ((limit.upper, -1.0), (limit.lower, 1.0)):
                if np.isfinite(end):
                    sides.append(sign * limit.coefficients)
                    offsets.append(sign * (limit.offset - end))
                    names.append(limit.joint)
        return (
            np.array(sides).reshape(-1, len(self.robot.coordinates)),
            np.array(offsets),
            np.array(names, dtype=object),
        )

    def _limit_rows(self, q: Array, half: Array) -> _Rows:
        """Return the ends of joint limits that a step may reach."""
        sides, offsets, names = self._limit_ends
        room = sides @ q + offsets
        value = np.where(room >= -LIMIT, np.maximum(room, 0.0), room)
        reached = np.flatnonzero(~(value - np.abs(sides) @ half > 0.0))
        return _Rows.of(names[reached], value[reached], sides[reached], 1.0)

    def _area_rows(self, q: Array, half: Array, reserve: float, margin: float, gain: float) -> _Rows:
        """Return the rows of the boundaries that a step may bring within the margin.

        Boundaries that a step reaches first are bounded first. They shrink the box, and fewer boundaries are left in
        it.
        """
        near, reach, fixed = self._near(q, half, reserve + margin)
        if len(near) <= 2 * _PROBED:
            return self._rows_of(near, q, half, reserve, margin, gain)
        near = near[np.argsort((self._known[near] - fixed[near]) / reach[near])]
        rows = self._rows_of(near[:_PROBED], q, half, reserve, margin, gain)
        scale, rest = max(_scale(rows, gain), _SMALLEST), near[_PROBED:]
        rest = rest[~(self._known[rest] - scale * reach[rest] - fixed[rest] > 0.0)]
        return _Rows.joined([rows, self._rows_of(np.sort(rest), q, half, reserve, margin, gain, scale)])

    def _rows_of(
        self, near: Indices, q: Array, half: Array, reserve: float, margin: float, gain: float, scale: float = 1.0
    ) -> _Rows:
        """Return the rows of areas, by index, that a step may violate; they hold up to a scale of the box.

        A loss is convex in the scale x and zero at x = 0, so up to `scale` it is at most `loss(scale) x / scale`.
        """
        if self._terms is None or not len(near):
            return _Rows.of(np.empty(0, dtype=object), np.zeros(0), np.zeros((0, len(q))), gain)
        found = self._terms.rows(near, q, scale * half)
        value, loss, bend = (
            found.value - (self._distances[found.places] + reserve),
            found.loss / scale,
            found.bend / scale**2,
        )
        rest = value - loss - bend - np.abs(found.g) @ half
        kept = np.flatnonzero(~((rest > 0.0) & (rest < np.inf)))
        bad = ~np.isfinite(rest[kept])  # no bound is known: 0 . d <= -1 [m], which no step satisfies
        value, g = np.where(bad, -1.0, value[kept]), np.where(bad[:, None], 0.0, found.g[kept])
        losses = np.where(bad, 0.0, loss[kept]), np.where(bad, 0.0, bend[kept])
        return _Rows.of(self._names[found.places[kept]], value, g, gain, margin, losses)

    def _near(self, q: Array, half: Array, more: float) -> tuple[Indices, Array, Array]:
        """Return the indices of boundaries that some step may bring within `more` [m], and the proof for the others.

        A separation changes by at most `moved . |change of q|`, so one measured value bounds it elsewhere. The proof is
        (m,) the largest change within the box, and (m,) other amounts that are subtracted.
        """
        if not self._areas:
            return np.zeros(0, dtype=np.intp), np.zeros(0), np.zeros(0)
        known, there = self._known, self._there
        reach, fixed = self._moved @ half * INFLATION, self._slack + more
        while True:
            least = known - np.einsum("mn,mn->m", self._moved, np.abs(q - there)) * INFLATION
            near = np.flatnonzero(~(least - reach - fixed > 0.0))
            stale = near[np.any(there[near] != q, axis=1)]
            if not len(stale):
                return near, reach, fixed
            known[stale], there[stale] = self._measured(q, stale), q

    def prepare(self) -> None:
        """Make tables and load machine code now, not during calls of `rows`; compile it if needed (some seconds)."""
        if not self._areas:
            return
        self._prepare(self.robot.home, self.robot.home)
        if has_numba():
            load_code()
        if self._tables is not None:
            prepare_hulls()
            self._is_worth = True

    @cached_property
    def _tables(self) -> HullTables | None:
        """All areas as tables for the machine code that measures bodies; None if it cannot run."""
        if not has_numba():
            return None
        names = [(one.point_a.name, one.point_b.name) for one in self._areas]
        pairs = [Pair(one.path, one.rule.distance, marks) for one, marks in zip(self._areas, names, strict=True)]
        return tables_of(pairs, len(self.robot.coordinates))

    def _measured(self, q: Array, places: Indices) -> Array:
        """Return the signed clearances of some areas at q [m]; all at once if machine code runs."""
        if self._asked == 0 and self._tables is not None:
            self._is_worth = self._is_worth or is_ready()
        self._asked += len(places)
        is_worth = self._is_worth or self._asked >= _WORTH
        if is_worth and self._tables is not None and np.all(np.abs(q) <= _FARTHEST):
            found = np.empty((1, len(self._areas)))
            self._tables.run(np.ascontiguousarray(q[None]), "clearances", found, np.zeros(1, dtype=np.int64))
            if np.all(np.isfinite(found)):
                return found[0, places]
        return np.array([float(self._areas[k].signed_clearance(q)) for k in map(int, places)])

    def _reached(self, q: Array, half: Array, limits: bool) -> tuple[Array, Array]:
        """Return the box (n,), (n,) of steps from q that satisfy the rows, also those of joint limits."""
        low, high = q - half, q + half
        if limits:
            low = np.maximum(low, np.minimum(q, self.robot.lower) - STEP_LIMIT)
            high = np.minimum(high, np.maximum(q, self.robot.upper) + STEP_LIMIT)
        return low, high

    def _prepare(self, low: Array, high: Array) -> None:
        """Make bounds that hold in a box (n,), (n,), and new bounds when steps leave this box.

        The box of the joint limits is prepared at once. Lever arms grow with the range of a prismatic joint. So the box
        is only as large as needed, plus one unit where steps have left it.
        """
        if self._box is None:
            ends = self.robot.lower - STEP_LIMIT, self.robot.upper + STEP_LIMIT
            lower = np.minimum(low, np.where(np.isfinite(ends[0]), ends[0], low - 1.0))
            upper = np.maximum(high, np.where(np.isfinite(ends[1]), ends[1], high + 1.0))
            m, n = len(self._areas), len(low)
            self._known, self._there = np.full(m, np.nan), np.full((m, n), np.nan)
        elif np.all(low >= self._box[0]) and np.all(high <= self._box[1]):
            return
        else:
            lower = np.where(low < self._box[0], low - 1.0, self._box[0])
            upper = np.where(high > self._box[1], high + 1.0, self._box[1])
        self._box = lower, upper
        links = [(one.ancestor, one.point_a.link, one.point_b.link) for one in self._areas]
        walked = walks(self.robot.tree, self.robot.coupling, links)
        self._terms = terms = step_terms([one.path for one in self._areas], walked, lower, upper)
        self._moved, self._slack = terms.moved, 8.0 * terms.error + STEP_SEARCH


def _scale(rows: _Rows, gain: float) -> float:
    """Return the scale of the box at which no row loses more than the share `gain`.

    Below the margin the share falls with the clearance: a step along a boundary loses clearance by curvature, and if
    each step lost half of it, nothing would remain soon.
    """
    fits = rows.fits(gain * rows.value * rows.nearness)
    return float(fits[rows.value > 0.0].min(initial=1.0))
