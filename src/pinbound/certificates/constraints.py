"""What has to hold: limits, boundaries of one effective angle, of several, of segments and planes; with enclosures.

Four families, one question: over a part of a motion, or over a box, what is the clearance in the middle, what is it
at least, and is that beyond every rounding error? `docs/certificates.md` and `docs/segments.md` give the arguments.

The *signed clearance* that is certified is that of the contact rule (`pinbound.contact`), which home, `free`, limits
and regions follow too: the separation less the contact distance, and of stops the sine of half the depth in home's gap.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from pinbound.boundaries.boundary import Boundary
from pinbound.bounds.bounds import (
    Bundle,
    Expansion,
    OneAngle,
    along_motion,
    bundle,
    lever_arms,
    one_angle,
    over_box,
)
from pinbound.bounds.rounding import Walks, rounding_bound, walks
from pinbound.certificates.enclosures import Enclosure
from pinbound.certificates.guarded import GuardedLimits, pieces
from pinbound.certificates.swept import SweptBoundaries, swept_boundaries
from pinbound.contact import Stop, signed_share
from pinbound.evaluate import numeric
from pinbound.exceptions import UnknownNameError, UnsupportedError
from pinbound.robot.robot import Robot
from pinbound.tolerances import LIMIT, UNIT_ROUNDOFF
from pinbound.typing import Array, Flags, Indices

__all__ = ["families", "far_sides", "needs_limits", "select", "signed_clearances", "unplaced"]

_ANYWHERE = 1e9  # metres: larger than any path, and still finite


@dataclass(frozen=True)
class Limits:
    """`bound - c . q >= 0`: every end of every joint limit, said of q. Affine, so that enclosures are exact."""

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

    def enclose(self, which: Indices, part: Expansion, rows: Indices) -> Enclosure:
        """Return the enclosure: the largest `c . q` is at a control point."""
        return self.judge(which, *_range(self.coefficients, which, part, rows))

    def enclose_box(self, which: Indices, centre: Array, half: Array) -> Enclosure:
        """Return the enclosure: the largest `c . q` is at a corner."""
        c = self.coefficients[which]
        middle, wide = np.einsum("ni,ni->n", c, centre), np.einsum("ni,ni->n", np.abs(c), half)
        return self.judge(which, middle, middle - wide, middle + wide)

    def judge(self, which: Indices, middle: Array, lower: Array, upper: Array) -> Enclosure:
        """Return the enclosure from the range of `c . q`; only its upper end matters."""
        error, bound = self.error[which], self.bounds[which]
        value, lower = bound - middle, bound - upper - error
        return Enclosure(value, lower, error, lower >= -LIMIT, value < -LIMIT - error, value - lower <= 2.0 * error)


@dataclass(frozen=True)
class OneAngleBoundaries:
    """Boundaries of one effective angle: the exact extremes of the signed clearance over an interval of the angle.

    Attributes:
        names: Their names.
        chains: Their closed form.
        threshold: (m,) what the norm must exceed [m]; not used of stops.
        is_stop: (m,) whether contact is a line, so that the side of it counts.
        gap: (m, 2) home's gap between contact lines [rad]; infinite where it is no stop.
        amplitude: (m,) of stops, the largest signed clearance [m].
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
        return np.abs(self.chains.coefficients)

    def signed(self, Q: Array) -> Array:
        """Return the signed clearances (N, m) [m]."""
        phi = Q @ self.chains.coefficients.T
        which = np.broadcast_to(np.arange(len(self.names)), phi.shape)
        return self._signed(which, phi)

    def clearance(self, row: int, q: Array) -> float:
        """Return the signed clearance of one boundary [m]."""
        return float(self._signed(np.array([row]), self.chains.coefficients[row : row + 1] @ q)[0])

    def _signed(self, which: Indices, phi: Array) -> Array:
        norm = self.chains.norm(which, phi) - self.threshold[which]
        return np.where(self.is_stop[which], self._stopped(which, self._depth(which, phi)), norm)

    def _depth(self, which: Indices, phi: Array) -> Array:
        return np.minimum(phi - self.gap[which, 0], self.gap[which, 1] - phi)

    def _stopped(self, which: Indices, depth: Array) -> Array:
        return self.amplitude[which] * signed_share(np.where(np.isfinite(depth), depth, 0.0))

    def _least(self, which: Indices, lower: Array, upper: Array) -> Array:
        """Return the smallest signed clearance of stops while phi runs over [lower, upper].

        The depth is concave in phi, so it runs over [least at an end, most]; the clearance grows with it from -pi to
        pi, and below that it lies between `-amplitude`, at every odd multiple of pi, and zero.
        """
        ends = self._depth(which, lower), self._depth(which, upper)
        least, most = np.minimum(*ends), np.maximum(*ends)
        with np.errstate(invalid="ignore"):  # of boundaries that are no stops, which have no gap
            middle = 0.5 * (self.gap[which, 0] + self.gap[which, 1])
            most = np.where((lower <= middle) & (upper >= middle), np.pi, most)
            bottom = -np.pi - 2.0 * np.pi * np.ceil((-np.pi - most) / (2.0 * np.pi))  # the highest one up to most
            reached = np.where(bottom > -np.pi, -np.pi, bottom) >= least
        found = np.minimum(self._stopped(which, least), self._stopped(which, most))
        return np.where(reached, -self.amplitude[which], found)

    def enclose(self, which: Indices, part: Expansion, rows: Indices) -> Enclosure:
        """Return the enclosure over the range of the effective angle."""
        return self.judge(which, *_range(self.chains.coefficients, which, part, rows))

    def enclose_box(self, which: Indices, centre: Array, half: Array) -> Enclosure:
        """Return the enclosure over the range of the effective angle."""
        c = self.chains.coefficients[which]
        middle, wide = np.einsum("ni,ni->n", c, centre), np.einsum("ni,ni->n", np.abs(c), half)
        return self.judge(which, middle, middle - wide, middle + wide)

    def judge(self, which: Indices, middle: Array, lower: Array, upper: Array) -> Enclosure:
        """Return the enclosure from the range of the effective angle."""
        error, slack, stop = self.error[which], self.angle_error[which], self.is_stop[which]
        value = self._signed(which, middle)
        near, _ = self.chains.extremes(which, lower, upper)
        start, end = self.gap[which, 0], self.gap[which, 1]
        home = (lower - slack > start) & (upper + slack < end)
        over = (middle + slack < start) | (middle - slack > end)
        bound = np.where(stop, self._least(which, lower, upper), near - self.threshold[which]) - error
        bound = np.where(stop & home, np.maximum(bound, 0.0), bound)
        clear = np.where(stop, home, bound > 0.0)
        violated = np.where(stop, over & (value < 0.0), value < -error)
        narrow = np.where(stop & ~home, upper - lower <= slack, value - bound <= 2.0 * error)
        return Enclosure(value, bound, error, clear, violated, narrow)


@dataclass(frozen=True)
class ManyAngleBoundaries:
    """Boundaries of several effective angles, or with slides: lever-arm bounds.

    Attributes:
        names: Their names.
        chains: Their chains, side by side.
        arms: (m, k) lever arms [m].
        threshold: (m,) what the norm must exceed, by the contact rule [m].
        error: (m,) rounding bound of a norm [m].
    """

    names: tuple[str, ...]
    chains: Bundle
    arms: Array
    threshold: Array
    error: Array
    boundaries: tuple[Boundary, ...]

    @property
    def weights(self) -> Array:
        """Lever arms, and lengths of slides, a coordinate."""
        turned = np.einsum("mk,mkn->mn", self.arms, np.abs(self.chains.coefficients))
        slides = self.chains.slides
        return turned if slides is None else turned + np.linalg.norm(slides, axis=2).sum(axis=1)

    def signed(self, Q: Array) -> Array:
        """Return the signed clearances (N, m) [m]."""
        norms = [numeric.norm(numeric.positions(boundary.path.minimal, Q)) for boundary in self.boundaries]
        return np.array(norms).reshape(len(self.boundaries), len(Q)).T - self.threshold

    def clearance(self, row: int, q: Array) -> float:
        """Return the signed clearance of one boundary [m]."""
        return float(self.boundaries[row].norm(q) - self.threshold[row])

    def enclose(self, which: Indices, part: Expansion, rows: Indices) -> Enclosure:
        """Return the enclosure by the bounds along a motion."""
        error = self.error[which]
        return self._judge(which, error, *along_motion(self.chains, self.arms, which, part.take(rows), error))

    def enclose_box(self, which: Indices, centre: Array, half: Array) -> Enclosure:
        """Return the enclosure by the bounds over a box."""
        error = self.error[which]
        return self._judge(which, error, *over_box(self.chains, self.arms, which, centre, half, error))

    def _judge(self, which: Indices, error: Array, norm: Array, bound: Array) -> Enclosure:
        value = norm - self.threshold[which]
        lower = np.maximum(bound, 0.0) - self.threshold[which] - error
        return Enclosure(value, lower, error, lower > 0.0, value < -error, value - lower <= 2.0 * error)


def _range(C: Array, which: Indices, part: Expansion, rows: Indices) -> tuple[Array, Array, Array]:
    """Return `c . q` in the middle, and its least and largest value, (N,) each."""
    if len(part.middle) * len(C) <= 2 * len(which):  # all constraints on all parts: one product, then look up
        phi = part.values @ C.T
        wide = np.broadcast_to(part.value_radius @ np.abs(C.T), (len(part.middle), len(C)))
        tables = part.middle @ C.T, phi.min(axis=1) - wide, phi.max(axis=1) + wide
        middle, low, high = (table[rows, which] for table in tables)
        return middle, low, high
    c, values = C[which], part.values[rows]
    phi = np.einsum("ni,npi->np", c, values)
    radius = part.value_radius[rows] if part.value_radius.ndim > 1 else part.value_radius
    wide = np.einsum("ni,ni->n", np.abs(c), np.broadcast_to(radius, c.shape))
    return np.einsum("ni,ni->n", c, part.middle[rows]), phi.min(axis=1) - wide, phi.max(axis=1) + wide


def select(robot: Robot, boundaries: Sequence[str] | None) -> tuple[Boundary, ...]:
    """Return the boundaries of these names, in the robot's order; None: all.

    Raises:
        UnknownNameError: If the robot has no boundary of that name.
    """
    if boundaries is None:
        return tuple(robot.boundaries)
    wanted = [boundaries] if isinstance(boundaries, str) else list(boundaries)
    for name in wanted:
        if name not in robot.boundaries.names:
            raise UnknownNameError("boundary", name, robot.boundaries.names)
    return tuple(boundary for boundary in robot.boundaries if boundary.name in wanted)


def needs_limits(boundaries: Sequence[Boundary]) -> bool:
    """Return whether the boundaries' bounds hold within the joint limits only: links of loops whose sides differ."""
    return any(boundary.place_error for boundary in boundaries)


def unplaced(boundaries: Sequence[Boundary]) -> list[Boundary]:
    """Return boundaries as they are outside the joint limits: where loops' sides differ, links may be anywhere."""
    return [replace(one, place_error=_ANYWHERE) if one.place_error else one for one in boundaries]


def families(
    robot: Robot, boundaries: Sequence[Boundary], lower: Array, upper: Array, degree: int = 1
) -> tuple[Limits | GuardedLimits, OneAngleBoundaries, ManyAngleBoundaries, SweptBoundaries]:
    """Return all constraints of a robot, with rounding bounds that hold while q stays in a box.

    Args:
        robot: The robot.
        boundaries: Which of its boundaries.
        lower: (n,) lower corner.
        upper: (n,) upper corner.
        degree: Degree of the motion's pieces.
    """
    points = [boundary for boundary in boundaries if boundary.path.is_plain]
    one = [boundary for boundary in points if boundary.contact is not None]
    many = tuple(boundary for boundary in points if boundary.contact is None)
    swept = tuple(boundary for boundary in boundaries if not boundary.path.is_plain)
    return (
        _limits(robot, lower, upper, degree),
        _one_angle(robot, one, lower, upper, degree),
        _many_angles(robot, many, lower, upper, degree),
        swept_boundaries(swept, _walked(robot, swept), lower, upper, degree),
    )


def _limits(robot: Robot, lower: Array, upper: Array, degree: int) -> Limits | GuardedLimits:
    names: list[str] = []
    rows: list[Array] = []
    bounds: list[float] = []
    sizes: list[float] = []
    for limit in (*robot.linear_limits, *(limit for _, limit, _ in pieces(robot.guarded_limits))):
        for end, sign, bound in (("upper", 1.0, limit.upper), ("lower", -1.0, limit.lower)):
            if np.isfinite(bound):
                names.append(f"{limit.joint} {end}")
                rows.append(sign * limit.coefficients)
                bounds.append(sign * (bound - limit.offset))
                sizes.append(abs(bound) + abs(limit.offset))  # these may cancel, their rounding does not
    C = np.array(rows).reshape(-1, len(robot.coordinates))
    size = np.abs(C) @ np.maximum(np.abs(lower), np.abs(upper)) + np.array(sizes)
    found = Limits(tuple(names), C, np.array(bounds), UNIT_ROUNDOFF * (C.shape[1] + 4 + 8 * degree) * size)
    return GuardedLimits.of(found, robot.guarded_limits) if robot.guarded_limits else found


def _errors(
    robot: Robot, boundaries: Sequence[Boundary], chains: Bundle, lower: Array, upper: Array, degree: int
) -> Array:
    places = np.array([boundary.place_error for boundary in boundaries])
    return rounding_bound(chains, _walked(robot, boundaries), lower, upper, degree) + places


def _walked(robot: Robot, boundaries: Sequence[Boundary]) -> Walks:
    """Return the joints between the marks of each boundary, as they are in the tree."""
    ends = [(boundary.ancestor, boundary.point_a.link, boundary.point_b.link) for boundary in boundaries]
    return walks(robot.tree, robot.coupling, ends)


def _one_angle(
    robot: Robot, boundaries: Sequence[Boundary], lower: Array, upper: Array, degree: int
) -> OneAngleBoundaries:
    n = len(robot.coordinates)
    chains = [boundary.path.minimal for boundary in boundaries]
    closed = one_angle(chains, n)
    error = _errors(robot, boundaries, bundle(chains, n), lower, upper, degree)
    stops = [boundary.rule.stop for boundary in boundaries]
    is_stop = np.array([stop is not None for stop in stops], dtype=np.bool_)
    chosen = [stop for stop in stops if stop is not None]
    closed = _with_stops(closed, is_stop, chosen)
    gap, amplitude = np.tile([-np.inf, np.inf], (len(boundaries), 1)), np.ones(len(boundaries))
    gap[is_stop] = np.array([stop.gap for stop in chosen]).reshape(-1, 2)
    amplitude[is_stop] = [stop.amplitude for stop in chosen]
    farthest = np.maximum(np.abs(lower), np.abs(upper))
    ends = np.where(np.isfinite(gap), np.abs(gap), 0.0).max(axis=1, initial=0.0)
    size = np.abs(closed.coefficients) @ farthest + np.abs(closed.angle) + ends + 2.0 * np.pi
    with np.errstate(divide="ignore"):
        angle_error = 4.0 * error / closed.arm + UNIT_ROUNDOFF * (n + 16 + 8 * degree) * size
    threshold = np.array([boundary.rule.placed_distance for boundary in boundaries])
    ratio = np.array([np.sqrt(max(stop.arms) / min(stop.arms)) for stop in chosen])
    error = error.copy()
    error[is_stop] = 0.5 * amplitude[is_stop] * angle_error[is_stop] + 3.0 * ratio * error[is_stop]
    names = tuple(boundary.name for boundary in boundaries)
    return OneAngleBoundaries(names, closed, threshold, is_stop, gap, amplitude, error, angle_error)


def _with_stops(closed: OneAngle, is_stop: Flags, stops: Sequence[Stop]) -> OneAngle:
    """Return the closed forms with the angles of the stops counted as the contact rule counts them."""
    coefficients, angle = closed.coefficients.copy(), closed.angle.copy()
    coefficients[is_stop] = np.array([stop.coefficients for stop in stops]).reshape(len(stops), coefficients.shape[1])
    angle[is_stop] = [stop.angle for stop in stops]
    return OneAngle(coefficients, angle, closed.smallest, closed.reach, closed.arm)


def _many_angles(
    robot: Robot, boundaries: tuple[Boundary, ...], lower: Array, upper: Array, degree: int
) -> ManyAngleBoundaries:
    chains = bundle([boundary.path.minimal for boundary in boundaries], len(robot.coordinates))
    error = _errors(robot, boundaries, chains, lower, upper, degree)
    threshold = np.array([boundary.rule.placed_distance for boundary in boundaries])
    names = tuple(boundary.name for boundary in boundaries)
    return ManyAngleBoundaries(names, chains, lever_arms(chains, lower, upper), threshold, error, boundaries)


def far_sides(robot: Robot, boundaries: Sequence[Boundary], q: Array) -> tuple[str, ...]:
    """Return the boundaries with a contact strip beyond which q lies, seen from home: clear, but not reachable."""
    found: list[str] = []
    for boundary in boundaries:
        try:
            is_strip = any(contact.half_width for contact in boundary.contacts or ())
        except UnsupportedError:  # contact is flat along an interval, to rounding: its sides are not known
            continue
        if is_strip and boundary.parts(robot.home, q):
            found.append(boundary.name)
    return tuple(found)


def signed_clearances(robot: Robot, Q: ArrayLike, boundaries: Sequence[str] | None = None) -> Array:
    """Return `robot.boundaries.signed_clearances(Q)`, or that of some boundaries: what a certificate is about.

    Args:
        robot: The robot.
        Q: One q (n,) or many (N, n).
        boundaries: Names of boundaries, None: all.

    Returns:
        (m,) or (N, m) [m]: positive is free.

    Raises:
        UnknownNameError: If the robot has no boundary of that name.
        DimensionError: If the last axis of Q is not n long.

    Example:
        >>> import pinbound as pb
        >>> robot = pb.load("minervabot_v3")
        >>> Q = np.radians([[0.0, 0.0, 0.0], [0.0, 0.0, 60.0]])
        >>> [bool(x) for x in pb.signed_clearances(robot, Q, ["beta_4"])[:, 0] > 0.0]
        [True, False]
    """
    names = [boundary.name for boundary in select(robot, boundaries)]
    columns = [robot.boundaries.names.index(name) for name in names]
    return robot.boundaries.signed_clearances(Q)[..., columns]
