"""The data of a robot's boundaries that certificates need and that no motion changes; they are kept for the next call.

Bundles of chains, lever arms, closed forms and the joints between marks are the same for every motion and box. Only
rounding bounds depend on the range of q, and lever arms if joints are prismatic. The tables of the last few robots are
kept. The paths are the key. So a robot that differs only in distances between the same marks shares them.
"""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable, Sequence
from functools import cache, cached_property
from typing import Any

import numpy as np

from pinbound.boundaries.boundary import Boundary
from pinbound.bounds.bodies import SweptBundle, swept_bundle, with_arms
from pinbound.bounds.bounds import Bundle, bundle, lever_arms, one_angle
from pinbound.bounds.groups import Groups, groups_of
from pinbound.bounds.rounding import Rounding, Walks, walks
from pinbound.bounds.separation_tables import SeparationTables, separation_tables
from pinbound.bounds.swept_bounds import bound_of, chain_rounding
from pinbound.certificates.distances import ManyAngleBoundaries
from pinbound.certificates.guarded import GuardedLimits, pieces
from pinbound.certificates.limits import Limits
from pinbound.certificates.one_angle import OneAngleBoundaries, with_stops
from pinbound.certificates.swept import SweptBoundaries
from pinbound.robot.robot import Robot
from pinbound.tolerances import UNIT_ROUNDOFF
from pinbound.typing import Array

__all__ = ["Tables", "tables_of"]

_KEPT = 16
"""The number of tables that are kept, each for one set of boundaries of a robot."""


class _Memory:
    """The last few values, with the objects from which they were made as keys."""

    def __init__(self) -> None:
        self.kept: OrderedDict[Any, tuple[Any, Any]] = OrderedDict()
        self.lock = threading.Lock()

    def get(self, parts: tuple[Any, ...], make: Callable[[], Any]) -> Any:
        """Return the value made from these objects; they are kept alive, so that no other object gets their id."""
        key = tuple(map(id, parts))
        with self.lock:
            if key in self.kept:
                self.kept.move_to_end(key)
                return self.kept[key][1]
        made = make()
        with self.lock:
            self.kept[key] = parts, made
            while len(self.kept) > _KEPT:
                self.kept.popitem(last=False)
        return made


_tables, _chains, _bodies = _Memory(), _Memory(), _Memory()


def tables_of(robot: Robot, boundaries: Sequence[Boundary]) -> Tables:
    """Return the tables of some boundaries of a robot, from an earlier call if the boundaries are the same."""
    chosen = tuple(boundaries)
    named = (chosen,) if chosen is robot.boundaries[:] else chosen  # all of them as one object, not one by one
    parts = (robot.tree, robot.coupling, robot.home, robot.linear_limits, robot.guarded_limits, *named)
    return _tables.get(parts, lambda: Tables(robot, chosen))


class _Chains:
    """A bundle of chains between points, with the data of their rounding bounds."""

    def __init__(self, robot: Robot, boundaries: Sequence[Boundary]) -> None:
        self.n = len(robot.coordinates)
        self.each = [boundary.path.minimal for boundary in boundaries]
        self.bundle: Bundle = bundle(self.each, self.n)
        self.rounding = Rounding.of(self.bundle, _walked(robot, boundaries))

    @cached_property
    def still(self) -> Array:
        """The lever arms (m, k) of chains without prismatic joints [m]."""
        return lever_arms(self.bundle, np.zeros(self.n), np.zeros(self.n))

    def arms(self, lower: Array, upper: Array) -> Array:
        """Return the lever arms (m, k) [m]; they depend on the box only if joints are prismatic."""
        return self.still if self.bundle.slides is None else lever_arms(self.bundle, lower, upper)


class _Bodies:
    """A bundle of paths of other marks than points, with the data of their rounding bounds."""

    def __init__(self, robot: Robot, boundaries: Sequence[Boundary]) -> None:
        self.n = len(robot.coordinates)
        self.paths = [boundary.path for boundary in boundaries]
        self.walked = _walked(robot, boundaries)

    @cached_property
    def _still(self) -> SweptBundle:
        return swept_bundle(self.paths, np.zeros(self.n), np.zeros(self.n))

    @cached_property
    def rounding(self) -> Rounding:
        """The data of the rounding bounds, without the range of q."""
        return chain_rounding(self._still, self.walked)

    @cached_property
    def _tables(self) -> SeparationTables:
        return separation_tables(self._still)

    def over(self, lower: Array, upper: Array) -> tuple[SweptBundle, Callable[[], SeparationTables]]:
        """Return the paths with lever arms that hold in a box; they depend on it only if joints are prismatic."""
        if self._still.chains.slides is None:
            return self._still, lambda: self._tables
        moved = with_arms(self._still, lower, upper)
        return moved, cache(lambda: self._tables.with_arms(moved))


class Tables:
    """The constraints of a robot, for any box of q.

    Attributes:
        one: Boundaries of one effective angle between two points.
        many: Boundaries of several angles between two points, or with prismatic joints.
        swept: Boundaries of other marks.
        names: Names of all boundaries, in the robot's order.
        order: Index of each boundary in the sequence of these three groups.
        turning: Boundaries of one rotation whose contact strips have a closed form.
        turning_bodies: Boundaries of one rotation whose strips have none.
        is_loose: Whether the sides of a loop differ, so that bounds hold only within the joint limits.
    """

    def __init__(self, robot: Robot, boundaries: Sequence[Boundary]) -> None:
        """Sort the boundaries into these groups."""
        points = [boundary for boundary in boundaries if boundary.path.is_plain]
        self.one = tuple(boundary for boundary in points if boundary.contact is not None)
        self.many = tuple(boundary for boundary in points if boundary.contact is None)
        self.swept = tuple(boundary for boundary in boundaries if not boundary.path.is_plain)
        self.robot, self.n = robot, len(robot.coordinates)
        places = {boundary.name: place for place, boundary in enumerate((*self.one, *self.many, *self.swept))}
        self.order = np.array([places[boundary.name] for boundary in boundaries], dtype=np.intp)
        self.names = tuple(boundary.name for boundary in boundaries)
        turning = [boundary for boundary in boundaries if boundary.path.minimal.rotations == 1]
        self.turning_bodies = tuple(boundary for boundary in turning if boundary.path.difference.directions)
        self.turning = tuple(boundary for boundary in turning if not boundary.path.difference.directions)
        self.is_loose = any(boundary.place_error for boundary in boundaries)

    def families(
        self, lower: Array, upper: Array, degree: int
    ) -> tuple[Limits | GuardedLimits, OneAngleBoundaries, ManyAngleBoundaries, SweptBoundaries]:
        """Return all constraints, with rounding bounds that hold in a box of q, for pieces of a degree."""
        farthest = np.maximum(np.abs(lower), np.abs(upper))
        return (
            self._limits(farthest, degree),
            self._one_angle(lower, upper, degree),
            self._many_angles(lower, upper, degree),
            self._swept(lower, upper, degree),
        )

    @cached_property
    def _strips(self) -> tuple[tuple[str, ...], Array, Array]:
        """Names of boundaries with contact strips in closed form, coefficients, and the gap that contains home."""
        rows = [
            (boundary.name, contact.coefficients, contact.gap(float(contact.coefficients @ self.robot.home)))
            for boundary in self.turning
            for contacts in [boundary.contacts or ()]
            if any(contact.half_width for contact in contacts)
            for contact in contacts
        ]
        coefficients = np.array([row[1] for row in rows]).reshape(len(rows), self.n)
        return tuple(row[0] for row in rows), coefficients, np.array([row[2] for row in rows]).reshape(-1, 2)

    def beyond(self, q: Array) -> set[str]:
        """Return the boundaries of `turning` with a contact strip between home and q (n,)."""
        names, coefficients, gap = self._strips
        phi = coefficients @ q
        return {names[row] for row in np.flatnonzero(~((gap[:, 0] < phi) & (phi < gap[:, 1]))).tolist()}

    @cached_property
    def _limit_rows(self) -> tuple[tuple[str, ...], Array, Array, Array]:
        names: list[str] = []
        rows: list[Array] = []
        bounds: list[tuple[float, float]] = []
        for limit in (*self.robot.linear_limits, *(limit for _, limit, _ in pieces(self.robot.guarded_limits))):
            for end, sign, bound in (("upper", 1.0, limit.upper), ("lower", -1.0, limit.lower)):
                if np.isfinite(bound):
                    names.append(f"{limit.joint} {end}")
                    rows.append(sign * limit.coefficients)
                    # The two may cancel, but their rounding does not.
                    bounds.append((sign * (bound - limit.offset), abs(bound) + abs(limit.offset)))
        table = np.array(bounds).reshape(-1, 2)
        return tuple(names), np.array(rows).reshape(len(rows), self.n), table[:, 0], table[:, 1]

    @cached_property
    def _limit_sizes(self) -> Array:
        return np.abs(self._limit_rows[1])

    def _limits(self, farthest: Array, degree: int) -> Limits | GuardedLimits:
        names, C, bounds, sizes = self._limit_rows
        size = self._limit_sizes @ farthest + sizes
        found = Limits(names, C, bounds, UNIT_ROUNDOFF * (C.shape[1] + 4 + 8 * degree) * size)
        return GuardedLimits.of(found, self.robot.guarded_limits) if self.robot.guarded_limits else found

    def _chains(self, boundaries: Sequence[Boundary]) -> _Chains:
        parts = (self.robot.tree, self.robot.coupling, *(boundary.path for boundary in boundaries))
        found: _Chains = _chains.get(parts, lambda: _Chains(self.robot, boundaries))
        return found

    @cached_property
    def _closed(self) -> OneAngleBoundaries:
        """The boundaries of one angle, without their rounding bounds."""
        boundaries, count = self.one, len(self.one)
        stops = [boundary.rule.stop for boundary in boundaries]
        is_stop = np.array([stop is not None for stop in stops], dtype=np.bool_)
        chosen = [stop for stop in stops if stop is not None]
        closed = with_stops(one_angle(self._one_chains.each, self.n), is_stop, chosen)
        gap, amplitude = np.tile([-np.inf, np.inf], (count, 1)), np.ones(count)
        gap[is_stop] = np.array([stop.gap for stop in chosen]).reshape(-1, 2)
        amplitude[is_stop] = [stop.amplitude for stop in chosen]
        names, nothing = tuple(boundary.name for boundary in boundaries), np.zeros(count)
        return OneAngleBoundaries(names, closed, _thresholds(boundaries), is_stop, gap, amplitude, nothing, nothing)

    @cached_property
    def _one_chains(self) -> _Chains:
        return self._chains(self.one)

    @cached_property
    def _one_places(self) -> tuple[Array, Array, Array]:
        """Errors of positions, the ends of gaps, and the root of the ratio of the arms; the last for stops only."""
        known = self._closed
        ends = np.where(np.isfinite(known.gap), np.abs(known.gap), 0.0).max(axis=1, initial=0.0)
        stops = [boundary.rule.stop for boundary in self.one]
        ratio = np.array([np.sqrt(max(stop.arms) / min(stop.arms)) for stop in stops if stop is not None])
        return _places(self.one), ends, ratio

    def _one_angle(self, lower: Array, upper: Array, degree: int) -> OneAngleBoundaries:
        known, (places, ends, ratio) = self._closed, self._one_places
        error = self._one_chains.rounding.bound(lower, upper, degree) + places
        farthest = np.maximum(np.abs(lower), np.abs(upper))
        closed, stop = known.chains, known.is_stop
        size = closed.weights @ farthest + np.abs(closed.angle) + ends + 2.0 * np.pi
        with np.errstate(divide="ignore"):
            angle_error = 4.0 * error / closed.arm + UNIT_ROUNDOFF * (self.n + 16 + 8 * degree) * size
        if known.has_stops:
            error[stop] = 0.5 * known.amplitude[stop] * angle_error[stop] + 3.0 * ratio * error[stop]
        gap = known.gap
        return OneAngleBoundaries(known.names, closed, known.threshold, stop, gap, known.amplitude, error, angle_error)

    @cached_property
    def _many_known(self) -> tuple[tuple[str, ...], _Chains, Array, Array]:
        names = tuple(boundary.name for boundary in self.many)
        return names, self._chains(self.many), _thresholds(self.many), _places(self.many)

    def _many_angles(self, lower: Array, upper: Array, degree: int) -> ManyAngleBoundaries:
        names, chains, threshold, places = self._many_known
        error = chains.rounding.bound(lower, upper, degree) + places
        arms, groups = chains.arms(lower, upper), self.groups
        return ManyAngleBoundaries(names, chains.bundle, arms, threshold, error, self.many, groups)

    @cached_property
    def groups(self) -> Groups | None:
        """The boundaries of several angles, as tables for machine code; None with prismatic joints, or if empty."""
        _, chains, threshold, places = self._many_known
        if not self.many or chains.bundle.slides is not None:
            return None
        return groups_of(chains.each, chains.bundle, chains.still, chains.rounding, threshold, places)

    @cached_property
    def _swept_known(self) -> tuple[tuple[str, ...], _Bodies, Array, Array]:
        parts = (self.robot.tree, self.robot.coupling, *(boundary.path for boundary in self.swept))
        bodies: _Bodies = _bodies.get(parts, lambda: _Bodies(self.robot, self.swept))
        return tuple(boundary.name for boundary in self.swept), bodies, _thresholds(self.swept), _places(self.swept)

    @cached_property
    def _none_swept(self) -> SweptBoundaries:
        """An empty family, for a robot whose marks are all points."""
        nothing = np.zeros(self.n)
        return self._swept_over(nothing, nothing, 1)

    def _swept(self, lower: Array, upper: Array, degree: int) -> SweptBoundaries:
        return self._swept_over(lower, upper, degree) if self.swept else self._none_swept

    def _swept_over(self, lower: Array, upper: Array, degree: int) -> SweptBoundaries:
        names, bodies, threshold, places = self._swept_known
        swept, tables = bodies.over(lower, upper)
        error = bound_of(swept, bodies.rounding, lower, upper, degree) + places
        return SweptBoundaries(names, swept, threshold, error, self.swept, tables)


def _thresholds(boundaries: Sequence[Boundary]) -> Array:
    return np.array([boundary.rule.placed_distance for boundary in boundaries])


def _places(boundaries: Sequence[Boundary]) -> Array:
    return np.array([boundary.place_error for boundary in boundaries])


def _walked(robot: Robot, boundaries: Sequence[Boundary]) -> Walks:
    """Return the joints between the marks of each boundary, as they are in the tree."""
    ends = [(boundary.ancestor, boundary.point_a.link, boundary.point_b.link) for boundary in boundaries]
    return walks(robot.tree, robot.coupling, ends)
