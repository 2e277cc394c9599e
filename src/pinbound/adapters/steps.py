"""Rows that are safe for a whole step: linear in the step, and no step that keeps them meets a boundary on its way.

With a unit vector n that stands still, every corner c of a pair of marks gives `phi_c(q) = n . r_c(q)`, and the
separation is at least `min_c phi_c`. Over a step d within the box `|d_j| <= s_j`,

    phi_c(q + d) >= phi_c(q) + g_c . d - K_c,       K_c = sup |d^2 r_c| / 2 over the box,

so that `-g_c . d <= phi_c(q) - T - K_c`, a row a corner, keeps the pair apart for all of the step. K_c is what lever
arms prove (`bounds/bounds`) and falls with the square of the box: the box is made smaller until standing still
keeps all rows. Stops and joint limits are linear in q. `docs/steps.md` derives it, and says what happens near contact.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pinbound.adapters.step_terms import StepTerms, step_terms
from pinbound.boundaries.boundary import Boundary, one_configuration
from pinbound.bounds.rounding import walks
from pinbound.exceptions import DimensionError, UnsupportedError
from pinbound.kernel.hulls import HullTables, is_ready, prepare_hulls, tables_of
from pinbound.kernel.program import Pair
from pinbound.machine.compiled import has_numba
from pinbound.model.coupling import real_array
from pinbound.robot.robot import Robot, refuse_conditions
from pinbound.tolerances import INFLATION, LIMIT, STEP_BOX, STEP_SEARCH, UNIT_ROUNDOFF
from pinbound.typing import Array, Indices
from pinbound.values import Value

__all__ = ["StepBounds", "StepRows"]

_WORTH = 100_000  # measured boundaries from which compiling machine code (some seconds, once a machine) pays
_FARTHEST = 1e6  # larger coordinates are measured by the reference
_PROBED = 8  # boundaries that are looked at first: they shrink the box for the others
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

    @property
    def nearness(self) -> float:
        """The clearance in units of the margin, at most 1."""
        return min(1.0, self.value / self.margin) if self.margin > 0.0 else 1.0

    def swing(self, half: Array) -> float:
        """Return by how much the linear part may fall within the box."""
        return float(np.abs(self.g) @ half)

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
        self._groups: list[StepTerms] = []
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
        ends = self._stop_rows(point, half, reserve, gain) + (self._limit_rows(point, half) if limits else [])
        blocked = [row.name for row in areas if row.value <= 0.0] + [row.name for row in ends if row.value < 0.0]
        found = [row for row in areas + ends if row.value - row.loss(1.0) - row.swing(half) <= 0.0]
        scale = _scale(found, half, gain)
        if most is not None:
            reach = [row.fits(row.value, row.swing(half)) for row in found]
            free = sorted(x for row, x in zip(found, reach, strict=True) if row.name not in blocked)
            if len(free) > most:
                scale = min(scale, free[most] * (1.0 - LIMIT))
                found = [row for row, x in zip(found, reach, strict=True) if x <= scale or row.name in blocked]
        found = [row for row in found if row.bound(scale) <= scale * row.swing(half)]  # or nothing in the box breaks it
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

    @cached_property
    def _stop_ends(self) -> tuple[Array, Array, Array, Array, tuple[str, ...]]:
        """Both ends of every stop's gap as `side . q + offset`: sides (k, n), offsets, sizes, amplitudes, names."""
        n = len(self.robot.coordinates)
        rules: list[Any] = [one.rule.stop for one in self.stops]
        c = np.repeat(np.array([stop.coefficients for stop in rules]).reshape(-1, n), 2, axis=0)
        gaps = np.array([stop.free_gap for stop in rules]).reshape(-1, 2)
        sign = np.tile((1.0, -1.0), len(rules))
        size = np.repeat(np.abs(gaps).sum(axis=1), 2)
        amplitudes = np.repeat(np.array([stop.amplitude for stop in rules]), 2)
        names = tuple(one.name for one in self.stops for _ in range(2))
        return sign[:, None] * c, -sign * gaps.ravel(), size, amplitudes, names

    def _stop_rows(self, q: Array, half: Array, reserve: float, gain: float) -> list[_Row]:
        """Return the ends of stops' gaps that a step may reach: linear in q, so that nothing is lost."""
        sides, offsets, size, amplitudes, names = self._stop_ends
        room = sides @ q + offsets
        kept = LIMIT + UNIT_ROUNDOFF * (len(q) + 8.0) * (np.abs(sides) @ np.abs(q) + size)
        value = room - kept - 2.0 * reserve / amplitudes
        value = np.where(room > kept, np.maximum(value, 0.0), value)
        reached = np.flatnonzero(value - np.abs(sides) @ half <= 0.0).tolist()
        return [_Row(names[k], float(value[k]), sides[k], share=gain) for k in reached]

    @cached_property
    def _limit_ends(self) -> tuple[Array, Array, tuple[str, ...]]:
        """Finite ends of all joint limits as `side . q + offset`: sides (k, n), offsets (k,), names."""
        sides, offsets, names = list[Array](), list[float](), list[str]()
        for limit in self.robot.linear_limits:
            for end, sign in ((limit.upper, -1.0), (limit.lower, 1.0)):
                if np.isfinite(end):
                    sides.append(sign * limit.coefficients)
                    offsets.append(sign * (limit.offset - end))
                    names.append(limit.joint)
        return np.array(sides).reshape(-1, len(self.robot.coordinates)), np.array(offsets), tuple(names)

    def _limit_rows(self, q: Array, half: Array) -> list[_Row]:
        """Return the ends of joint limits that a step may reach."""
        sides, offsets, names = self._limit_ends
        room = sides @ q + offsets
        value = np.where(room >= -LIMIT, np.maximum(room, 0.0), room)
        reached = np.flatnonzero(value - np.abs(sides) @ half <= 0.0).tolist()
        return [_Row(names[k], float(value[k]), sides[k]) for k in reached]

    def _area_rows(self, q: Array, half: Array, reserve: float, margin: float, gain: float) -> list[_Row]:
        """Return the rows of the boundaries that a step may bring within the margin.

        Of many, those that a step reaches first come first: they shrink the box, and the smaller box reaches fewer.
        """
        near, reach, fixed = self._near(q, half, reserve + margin)
        if len(near) <= 2 * _PROBED:
            return self._rows_of(near, q, half, reserve, margin, gain)
        near = near[np.argsort((self._known[near] - fixed[near]) / reach[near])]
        rows = self._rows_of(near[:_PROBED], q, half, reserve, margin, gain)
        scale, rest = _scale(rows, half, gain), near[_PROBED:]
        rest = rest[~(self._known[rest] - scale * reach[rest] - fixed[rest] > 0.0)]
        return rows + self._rows_of(np.sort(rest), q, half, reserve, margin, gain)

    def _rows_of(self, near: Indices, q: Array, half: Array, reserve: float, margin: float, gain: float) -> list[_Row]:
        """Return the rows of areas, by their places."""
        rows: list[_Row] = []
        for group in self._groups if len(near) else ():
            which = np.flatnonzero(np.isin(group.places, near))
            if not len(which):
                continue
            along, rates, bend, off = group.at(which, q, half)
            for place, k in enumerate(map(int, group.places[which])):
                boundary = self._areas[k]
                value = along[place].copy()
                value[0] -= boundary.rule.distance + off[place] + reserve
                rows += _corner_rows(boundary, value, rates[place], bend[place], half, margin, gain)
        return rows

    def _near(self, q: Array, half: Array, more: float) -> tuple[Indices, Array, Array]:
        """Return the places of the boundaries that some step may bring within `more` [m], and what proves the others.

        A separation changes by at most `moved . |change of q|`, so that one that was measured bounds it elsewhere. That
        is (m,) how far the box reaches, and (m,) what is taken off besides.
        """
        if not self._areas:
            return np.zeros(0, dtype=np.intp), np.zeros(0), np.zeros(0)
        self._prepare(q, half)
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
        """Load now what measures bodies, compiled first where this machine has not done it yet (some seconds).

        Otherwise it is loaded on the first call if it is there, and compiled in the middle of a long run.
        """
        if self._areas and self._tables is not None:
            prepare_hulls()
            self._is_worth = True

    @cached_property
    def _tables(self) -> HullTables | None:
        """All areas as tables of the machine code that measures bodies; None where it cannot run."""
        if not has_numba():
            return None
        names = [(one.point_a.name, one.point_b.name) for one in self._areas]
        pairs = [Pair(one.path, one.rule.distance, marks) for one, marks in zip(self._areas, names, strict=True)]
        return tables_of(pairs, len(self.robot.coordinates))

    def _measured(self, q: Array, places: Indices) -> Array:
        """Return the signed clearances of some areas at q [m], all of them at once where machine code runs."""
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

    def _prepare(self, q: Array, half: Array) -> None:
        """Make bounds that hold in a box around q, anew when steps lead out of it."""
        box = self._box
        if box is not None and np.all(q - half >= box[0]) and np.all(q + half <= box[1]):
            return
        ends = q - half - 1.0, q + half + 1.0
        if box is None:  # what joint limits leave is prepared at once
            box = tuple(np.where(np.isfinite(end), end, q) for end in (self.robot.lower, self.robot.upper))
            m, n = len(self._areas), len(q)
            self._known, self._there = np.full(m, np.nan), np.full((m, n), np.nan)
        lower, upper = np.minimum(box[0], ends[0]), np.maximum(box[1], ends[1])
        self._box = lower, upper
        m, n = len(self._areas), len(q)
        self._moved, self._slack, groups = np.zeros((m, n)), np.zeros(m), list[StepTerms]()
        for edges in sorted({len(one.path.difference.directions) for one in self._areas}):
            places = np.array(
                [k for k, one in enumerate(self._areas) if len(one.path.difference.directions) == edges], np.intp
            )
            chosen = [self._areas[k] for k in map(int, places)]
            links = [(one.ancestor, one.point_a.link, one.point_b.link) for one in chosen]
            walked = walks(self.robot.tree, self.robot.coupling, links)
            group = step_terms(places, [one.path for one in chosen], walked, lower, upper)
            self._moved[places], self._slack[places] = group.moved, 8.0 * group.error + STEP_SEARCH
            groups.append(group)
        self._groups = groups


def _scale(rows: Sequence[_Row], half: Array, gain: float) -> float:
    """Return the scale of the box at which no row that it can break loses more than the gain's share.

    Below the margin the share falls with the clearance: a step along a boundary loses by its curvature, and half of
    what is left at each step would be nothing soon.
    """
    broken = [row for row in rows if row.value > 0.0 and row.value - row.loss(1.0) - row.swing(half) <= 0.0]
    return min([1.0, *[row.fits(gain * row.value * row.nearness) for row in broken]])


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
