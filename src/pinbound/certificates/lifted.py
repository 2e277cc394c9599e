"""Motions and boxes through loops that are not parallelograms: bounds of `z = F(q)` from bounds of q.

A motion of q gives a motion of z. Interval arithmetic bounds its passive coordinates: value, first and second
derivative. The robot over z, in which these loops are open, is then certified like any other. `docs/loops.md` proves
it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pinbound.bounds.bounds import Expansion, bundle
from pinbound.bounds.intervals import Interval, hull
from pinbound.bounds.rounding import rounding_bound, walks
from pinbound.certificates.enclosures import Enclosure, Family
from pinbound.certificates.one_angle import OneAngleBoundaries
from pinbound.certificates.polynomials import Trajectory
from pinbound.certificates.records import Certificate, Contact, Findings
from pinbound.loops.jets import Jet
from pinbound.loops.lift import Lift
from pinbound.robot.loop_robot import LoopRobot
from pinbound.robot.robot import Robot
from pinbound.tolerances import INFLATION, UNIT_ROUNDOFF
from pinbound.typing import Array, Indices

__all__ = ["LiftedFamily", "LiftedTrajectory", "closed_only", "loop_errors", "lowered", "told"]

_NEAR = 1e-6  # m or rad: the rounding of F is considered only for clearances below this


@dataclass(frozen=True, eq=False)
class LiftedTrajectory:
    """The motion of z that belongs to a motion of q.

    Attributes:
        motion: The motion of q.
        lift: `z = F(q)`.
        errors: (loops,) [m], bounds of the errors of each loop's numbers, compared with its file.
    """

    motion: Trajectory
    lift: Lift
    errors: Array

    @classmethod
    def of(cls, robot: LoopRobot, motion: Trajectory) -> LiftedTrajectory:
        """Return the motion of a robot's z."""
        return cls(motion, robot.lift, loop_errors(robot, *motion.extent, motion.degree))

    @property
    def starts(self) -> Array:
        """Those of the motion of q."""
        return self.motion.starts

    @property
    def durations(self) -> Array:
        """Those of the motion of q."""
        return self.motion.durations

    @property
    def degree(self) -> int:
        """That of the motion of q: the intervals include the rounding of the other coordinates of z."""
        return self.motion.degree

    @property
    def notes(self) -> tuple[str, ...]:
        """Those of the motion of q."""
        return self.motion.notes

    @property
    def extent(self) -> tuple[Array, Array]:
        """A box that contains z while q is in its extent."""
        low, high = self.motion.extent
        found = self.lift.over(low[None], high[None], self.errors.tolist())
        return found.lower[0], found.upper[0]

    def at(self, piece: Indices, u: Array) -> Array:
        """Return z (N, n + k) at the fractions u of pieces."""
        return self.lift(self.motion.at(piece, u))

    def expand(self, piece: Indices, a: Array, b: Array) -> Expansion:
        """Return bounds of z on the parts [a, b] of pieces."""
        q = self.motion.expand(piece, a, b)
        n, size, count = q.middle.shape[1], len(self.lift.names), len(q.middle)
        spread = (count, n)
        value = _around(q.values, np.broadcast_to(q.value_radius, spread))
        slope = _around(q.slopes, np.broadcast_to(q.slope_radius, spread))
        bends = np.zeros((count, 1, n)) if q.bends is None else q.bends
        bend = _around(bends, np.broadcast_to(q.bend_radius, spread))
        start = Interval.at(q.middle, np.broadcast_to(q.middle_radius, spread))
        zero = Interval.at(np.zeros(count))
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            parts = [Jet(_column(value, k), _column(slope, k), _column(bend, k)) for k in range(n)]
            over = self.lift.jets(parts, self.errors.tolist())
            parts = [Jet(_column(start, k), Interval.at(q.slope[:, k]), zero) for k in range(n)]
            at = self.lift.jets(parts, self.errors.tolist())
        radius = np.zeros((4, count, size))
        for row, given in enumerate((q.middle_radius, q.value_radius, q.slope_radius, q.bend_radius)):
            radius[row, :, :n] = given
        wide = np.zeros((5, count, size))
        wide[0, :, :n], wide[1, :, :n] = q.middle, q.slope
        beside = self.lift.beside([one.value for one in over], [one.value for one in at])
        for k in range(n, size):
            middle, rate, moved = at[k].value, at[k].first, over[k].first
            held = beside[k].meet(middle + 0.5 * hull(moved, -moved))
            wide[:, :, k] = middle.middle, rate.middle, held.middle, moved.middle, over[k].second.middle
            # the error of the slope in the middle counts as bending: r moves by half of it at an end, by an eighth
            bent = over[k].second.radius + 4.0 * rate.radius
            radius[:, :, k] = middle.radius, held.radius, moved.radius, bent
        return Expansion(
            middle=wide[0],
            middle_radius=radius[0],
            slope=wide[1],
            values=_with(q.values, wide[2, :, n:]),
            value_radius=radius[1],
            slopes=_with(q.slopes, wide[3, :, n:]),
            slope_radius=radius[2],
            bends=None if q.bends is None else _with(q.bends, wide[4, :, n:]),
            bend_radius=radius[3],
        )


@dataclass(frozen=True, eq=False)
class LiftedFamily:
    """Constraints over z, bounded over boxes of q.

    Attributes:
        family: The constraints over z.
        lift: `z = F(q)`.
        errors: (loops,) [m], as in `LiftedTrajectory`.
    """

    family: Family
    lift: Lift
    errors: Array

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the constraints."""
        return self.family.names

    @property
    def weights(self) -> Array:
        """The weight of each coordinate of q; one that moves a loop has the weight of its passive coordinates, too."""
        w, n = self.family.weights, len(self.lift.coordinates)
        found = w[:, :n].copy()
        for one in self.lift.linkages:
            for k in (k for k in one.inputs if k < n):
                found[:, k] += w[:, list(one.passive)].sum(axis=1)
        return found

    def enclose_box(self, which: Indices, centre: Array, half: Array) -> Enclosure:
        """Return the enclosure over the box of z that contains `F(centre +- half)`; its middle is `F(centre)`."""
        box = Interval.at(centre, half)
        found = self.lift.over(box.lower, box.upper, self.errors.tolist())
        Z, n = self.lift(centre), half.shape[1]
        wide = np.maximum(found.upper - Z, Z - found.lower) * (1.0 + 4.0 * UNIT_ROUNDOFF)
        wide[:, :n] = half
        enclosure = self.family.enclose_box(which, Z, np.where(np.isfinite(wide), wide, 1e30))
        if not np.any(enclosure.violated | ~enclosure.clear & (enclosure.value < _NEAR)):
            return enclosure
        near = self.lift.linear(centre, np.zeros_like(centre), (), self.errors.tolist())
        return told(enclosure, self.family, which, near.off)


def told(found: Enclosure, family: Family, which: Indices, radius: Array) -> Enclosure:
    """Return an enclosure whose middle is violated only if it is for every z within the rounding of F.

    If a signed clearance in the middle is nearer to zero than this rounding, halving cannot help: the part is settled.

    Args:
        found: The enclosure of constraints `which` (N,).
        family: The constraints, over z.
        which: (N,).
        radius: (N, n + k), bounds of the error of the computed z in the middle.
    """
    off = np.einsum("nz,nz->n", family.weights[which], radius) * INFLATION
    if isinstance(family, OneAngleBoundaries):  # its weights are those of the angle
        off = off * np.maximum(family.chains.arm, 0.5 * family.amplitude)[which]
    error = found.error + off
    near = np.abs(found.value) <= error
    settled = found.settled | (near & (found.value - found.lower <= 4.0 * error))
    return replace(found, error=error, violated=found.violated & ~near, settled=settled)


def loop_errors(robot: LoopRobot, lower: Array, upper: Array, degree: int) -> Array:
    """Return bounds of the error of each loop's gap, by rounding of its constants and angles (loops,) [m].

    They hold while q stays in [lower, upper] (n,), and the passive joints in the range that results.
    """
    opened, lift = robot.opened, robot.lift
    found = lift.over(lower[None], upper[None])
    closures = {one.name: one for one in opened.closures}
    chosen = [closures[one.name] for one in lift.linkages]
    ends = [(one.path.ancestor, one.mark.link_a, one.mark.link_b) for one in chosen]
    chains = bundle([one.path.minimal for one in chosen], len(lift.names))
    return rounding_bound(chains, walks(opened.tree, opened.coupling, ends), found.lower[0], found.upper[0], degree)


def closed_only(robot: LoopRobot) -> Robot:
    """Return the robot over z with no other limits than those that close its loops: these are always needed."""
    toggles = robot.lift.toggle_names()
    kept = tuple(limit for limit in robot.opened.linear_limits if limit.joint in toggles)
    return replace(robot.opened, linear_limits=kept, guarded_limits=())


def lowered(found: Certificate, robot: LoopRobot) -> Certificate:
    """Return a certificate over z as a certificate over q."""
    n = len(robot.coordinates)

    def own(findings: Findings) -> Findings:
        contacts = {
            row: Contact(one.before, one.after, one.q[:n].copy(), one.clearance)
            for row, one in findings.contacts.items()
        }
        return replace(findings, Q=findings.Q[:, :n].copy(), contacts=contacts)

    return replace(found, boundaries=own(found.boundaries), limits=own(found.limits))


def _around(points: Array, radius: Array) -> Interval:
    """Return the box (N, n) that contains the hull of points (N, p, n), widened."""
    low, high = Interval.at(points.min(axis=1), radius), Interval.at(points.max(axis=1), radius)
    return Interval(low.lower, high.upper)


def _column(x: Interval, k: int) -> Interval:
    return Interval(x.lower[:, k], x.upper[:, k])


def _with(points: Array, more: Array) -> Array:
    """Return points (N, p, n), each with the same further columns (N, k)."""
    count, p, _ = points.shape
    return np.concatenate((points, np.broadcast_to(more[:, None], (count, p, more.shape[1]))), axis=2)
