"""The contact rule of one boundary: its signed clearance `s(q)`, which is positive exactly where the boundary is free.

    distance:  s = separation - T,  T = max(threshold, contact_tolerance): contact is an area;
    height:    s = height - threshold, above a plane: the height has a sign of its own;
    stop:      s = 2 sqrt(|p| |s|) sin(d / 2),  d = min(phi - low, high - phi),  phi = c . q.

A *stop* is a pair of two points of zero threshold and one effective angle phi: two arms p and s about one pivot. The
robot stops where they align, on the lines `phi = phi* + 2 pi k`. Home lies in the gap (low, high) between two of these
lines, and d [rad] is the depth of q in that gap, negative beyond it. A pair is a stop if it is declared as one, or if
the distance of its points, where the arms align, is at most `contact_tolerance`. This distance is the *miss* m, and

    norm^2 = m^2 + 4 |p| |s| sin^2((phi - phi*) / 2),    so that    |s| = sqrt(norm^2 - m^2),

which is zero at contact, and smooth there. More than a turn beyond the gap, s stays negative: `-2 sqrt(|p| |s|)
|sin(d/2)|`.

If the sides of closed loops differ, marks may have an error of up to the boundary's `place_error` e
(`docs/closures.md`). It is added to T. The arms of a stop then have direction errors of up to `asin(e / |p|)` and
`asin(e / |s|)`, and the gap is narrower by their sum at both ends.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from pinbound.evaluate import separation
from pinbound.limits import univariate
from pinbound.limits.univariate import AllowedArcsTable, Strip
from pinbound.model.coupling import combination
from pinbound.path.chain import HullChain
from pinbound.path.relative import RelativePath
from pinbound.tolerances import REDUCTION, STOP_MISS
from pinbound.typing import Array
from pinbound.values import Value

__all__ = ["ContactRule", "Stop", "contact_distance", "stop_fault"]

_TURN = 2.0 * math.pi


def contact_distance(path: RelativePath, threshold: float, tolerance: float) -> float:
    """Return the largest separation that is contact, if contact is an area [m]; for a plane, the signed height."""
    return max(threshold, path.floor + tolerance)


@dataclass(frozen=True, eq=False)
class Stop(Value):
    """Two arms that stop a robot where they align.

    Attributes:
        coefficients: (n,) c, the last that is not zero positive: `phi = c . q`.
        angle: phi* [rad], in (-pi, pi].
        gap: (low, high) [rad], the two neighbouring contact lines between which home lies; NaN if home is on one.
        miss: [m], the norm at the angle at which the arms align.
        arms: (|p|, |s|) [m], the lengths of the arms, perpendicular to the axis of the pivot.
        play: [rad], the largest direction error of the arms, if the sides of loops differ.
    """

    coefficients: Array
    angle: float
    gap: tuple[float, float]
    miss: float
    arms: tuple[float, float]
    play: float = 0.0

    @cached_property
    def free_gap(self) -> tuple[float, float]:
        """The gap, narrowed by the direction errors of the arms [rad]."""
        return self.gap[0] + self.play, self.gap[1] - self.play

    @cached_property
    def amplitude(self) -> float:
        """`2 sqrt(|p| |s|)` [m], the largest signed clearance."""
        return 2.0 * math.sqrt(self.arms[0]) * math.sqrt(self.arms[1])

    def depth(self, phi: Array) -> Array:
        """Return the depth of phi in home's gap [rad]: at most pi, negative beyond a contact line."""
        low, high = self.free_gap
        return np.minimum(phi - low, high - phi)

    def signed(self, Q: Array) -> Array:
        """Return the signed clearances (N,) [m]."""
        return self.amplitude * signed_share(self.depth(combination(self.coefficients, Q)))

    def signed_at(self, q: Sequence[float]) -> float:
        """Return the signed clearance of one finite q, by plain Python [m]."""
        phi = 0.0
        for index, c in self._terms:
            phi += c * q[index]
        depth = min(phi - self.free_gap[0], self.free_gap[1] - phi)
        share = math.sin(0.5 * depth)
        return self.amplitude * (-abs(share) if depth < -_TURN else share)

    @cached_property
    def _terms(self) -> tuple[tuple[int, float], ...]:
        return tuple((int(index), float(self.coefficients[index])) for index in np.flatnonzero(self.coefficients))

    def gradients(self, Q: Array) -> Array:
        """Return the gradients (N, n) of the signed clearances [m/rad or 1]."""
        low, high = self.free_gap
        phi = combination(self.coefficients, Q)
        rising = np.where(phi - low <= high - phi, 1.0, -1.0)
        slope = 0.5 * self.amplitude * rising * share_slope(self.depth(phi))
        return slope[:, None] * self.coefficients


def signed_share(depth: Array) -> Array:
    """Return `sin(d / 2)`, or `-|sin(d / 2)|` more than a turn beyond the gap."""
    share = np.sin(0.5 * depth)
    far = depth < -_TURN
    return np.where(far, -np.abs(share), share) if np.any(far) else share


def share_slope(depth: Array) -> Array:
    """Return the derivative of `2 signed_share` by d; at a contact line more than a turn away the one from home."""
    slope = np.cos(0.5 * depth)
    return np.where((depth < -_TURN) & (np.sin(0.5 * depth) > 0.0), -slope, slope)


@dataclass(frozen=True, eq=False)
class ContactRule(Value):
    """The contact rule of one boundary.

    Attributes:
        path: The reduced path between its marks.
        threshold: `radius_a + radius_b + min_distance` [m].
        tolerance: `contact_tolerance` [m].
        home: (n,), the home, which decides on which side of a stop is free.
        is_declared: Whether it is declared as a stop.
        error: [m], the largest error of the separation, if the sides of loops differ.
    """

    path: RelativePath
    threshold: float
    tolerance: float
    home: Array
    is_declared: bool = False
    error: float = 0.0

    @cached_property
    def _arms(self) -> tuple[Array, Strip, tuple[float, float]] | None:
        """Coefficients, strip and arm lengths of two points of zero threshold and one effective angle; else None."""
        if not self.path.is_plain or self.threshold != 0.0 or self.path.turns_several:
            return None
        found = univariate.one_angle(self.path.minimal)
        if found is None:
            return None
        coefficients, axis = found
        arms = [offset - axis * (axis @ offset) for offset in self.path.minimal.offsets]
        lengths = float(np.linalg.norm(arms[0])), float(np.linalg.norm(arms[1]))
        p, s = self.path.minimal.offsets
        return coefficients, univariate.strip(p, s, axis, 0.0, math.inf), lengths

    @cached_property
    def miss(self) -> float | None:
        """[m], the distance of the points of a possible stop where its arms align; None for other pairs."""
        return None if self._arms is None else self._arms[1].smallest

    @cached_property
    def stop(self) -> Stop | None:
        """The stop, if the boundary is one: declared, or by its equal arms; else None."""
        if self._arms is None:
            return None
        coefficients, strip, arms = self._arms
        rounding = REDUCTION * (sum(arms) + strip.smallest)  # equal arms must not come out unequal by an ulp
        if not (self.is_declared or strip.smallest <= self.tolerance + rounding) or min(arms) == 0.0:
            return None
        phi = float(combination(coefficients, self.home[None])[0])
        gap = univariate.gap_around(strip.angle, 0.0, phi)
        play = sum(math.asin(min(self.error / arm, 1.0)) for arm in arms)
        return Stop(coefficients, strip.angle, gap, strip.smallest, arms, play)

    @property
    def size_path(self) -> RelativePath:
        """The path whose norm is the absolute signed clearance of a stop: both arms are `sqrt(|p| |s|)`."""
        chain = self.path.minimal
        axis = chain.axes[0]
        arms = np.array([offset - axis * (axis @ offset) for offset in chain.offsets])
        arms *= 0.5 * self.stop.amplitude / np.linalg.norm(arms, axis=1)[:, None] if self.stop else 1.0
        return replace(self.path, difference=HullChain(replace(chain, offsets=arms)))

    @property
    def is_stop(self) -> bool:
        """Whether contact is the angle at which two arms align."""
        return self.stop is not None

    @cached_property
    def distance(self) -> float:
        """T [m], the largest separation that is contact, if contact is an area; for a stop, its miss."""
        return self.stop.miss if self.stop else self.raised(0.0)

    @cached_property
    def placed_distance(self) -> float:
        """T [m] without `error`, for bounds that include `error` themselves."""
        return self.stop.miss if self.stop else contact_distance(self.path, self.threshold, self.tolerance)

    def signed(self, Q: Array) -> Array:
        """Return the signed clearances (N,) of Q (N, n) [m]: positive is free; NaN for a row that is not finite."""
        if self.stop:
            with np.errstate(invalid="ignore"):
                found = self.stop.signed(Q)
            return np.where(np.all(np.isfinite(Q[:, self.stop.coefficients != 0.0]), axis=1), found, np.nan)
        return separation.separations(self.path, Q) - self.distance

    def gradients(self, Q: Array) -> Array:
        """Return the gradients (N, n) of the signed clearances [m/rad or 1]; NaN where a distance is zero."""
        if self.stop:
            with np.errstate(invalid="ignore"):
                found = self.stop.gradients(Q)
            found[~np.all(np.isfinite(Q[:, self.stop.coefficients != 0.0]), axis=1)] = np.nan
            return found
        return separation.gradients(self.path, Q)

    def strips(self, margin: float = 0.0) -> tuple[Array, tuple[Strip, ...]] | None:
        """Return the coefficients of the effective angle, and the strips of signed clearances up to a margin.

        Args:
            margin: [m]; for boundaries that are not stops, it is added to the threshold.

        Returns:
            As `univariate.one_angle_strips`: None if there are several angles, or a prismatic joint.
        """
        if self.stop is None:
            return self._contacts if margin == 0.0 else univariate.one_angle_strips(self.path, self.raised(margin), 0.0)
        share = min(margin / self.stop.amplitude, 1.0)
        half_width = min(2.0 * math.asin(share) + self.stop.play, math.pi)
        return self.stop.coefficients, (Strip(self.stop.angle, half_width, self.stop.miss),)

    @cached_property
    def _contacts(self) -> tuple[Array, tuple[Strip, ...]] | None:
        """The strips of a boundary that is not a stop, without a margin; for bodies, they are searched once."""
        return univariate.one_angle_strips(self.path, self.raised(0.0), 0.0)

    def raised(self, margin: float) -> float:
        """Return the largest separation that is contact plus a margin [m], for a boundary that is not a stop."""
        return contact_distance(self.path, self.threshold + margin, self.tolerance) + self.error

    def arcs(self, index: int, name: str, Q: Array, window: tuple[float, float] | None = None) -> AllowedArcsTable:
        """Return the values of one coordinate that are not in contact; the other coordinates are those of Q (N, n).

        For a stop, these are all arcs between its contact lines, also beyond home's gap; `signed` has the side.
        """
        if self.stop is None:
            return univariate.allowed_arcs_table(self.path, index, name, Q, self.distance, 0.0, window)
        if self.stop.coefficients[index] == 0.0:  # nothing changes: all is allowed, or nothing
            everywhere = np.where(self.signed(Q) > 0.0, math.inf, math.nan)
            intervals = np.stack((-everywhere, everywhere), axis=1)[:, None]
            return AllowedArcsTable(name, intervals, np.full(len(Q), math.inf))
        if self.stop.play:  # the separation at which the arms are that far from alignment
            reached = math.hypot(self.stop.miss, self.stop.amplitude * math.sin(0.5 * self.stop.play))
            return univariate.allowed_arcs_table(self.path, index, name, Q, reached, 0.0, window)
        return univariate.allowed_arcs_table(self.path, index, name, Q, 0.0, math.inf, window)

    def refusal_at_home(self) -> str | None:
        """Return why home is not free, by the rule; None if it is free."""
        stop = self.stop
        if stop is not None:
            away = float(stop.signed(self.home[None])[0]) if math.isfinite(stop.gap[0]) else 0.0
            if away > self.tolerance:
                return None
            least = _millimetres(self.tolerance)
            return f"is a stop, and home is {_millimetres(away)} from it, not more than contact_tolerance, {least}"
        value = float(separation.separations(self.path, self.home[None])[0])
        if value > self.distance:
            return None
        measured = f"has a {self.path.measure.quantity} of {_millimetres(value)}"
        least = _millimetres(self.distance)
        if self.error:
            off = _millimetres(self.error)
            return (
                f"{measured}, which is not above {least}: the sides of its loops differ, so the value may "
                f"be wrong by {off}"
            )
        if self.distance > self.threshold:
            return f"{measured}, which is below contact_tolerance, {least}"
        return f"{measured}, which is not above its threshold of {least} (radii and min_distance)"


def stop_fault(rule: ContactRule) -> tuple[str, str] | None:
    """Return what is wrong with a boundary that is declared as a stop, and what to do; None if it can be a stop.

    It is already checked that its marks are points of zero threshold.
    """
    path = rule.path
    if not path.minimal.rotations and not np.any(path.minimal.slides):
        remedy = "Name points of two links with a revolute joint between them"
        return "no joint moves its two points relative to each other", remedy
    if rule._arms is None:
        slides = bool(np.any(path.minimal.slides))
        what = (
            "a prismatic joint is between its two points"
            if slides
            else "its two points rotate by several effective angles"
        )
        remedy = (
            "A stop is the alignment of two lever arms about one pivot. Remove stop, and give a point a "
            "radius or a min_distance"
        )
        return what, remedy
    _, strip, arms = rule._arms
    if not strip.smallest <= STOP_MISS * min(arms):
        what = (
            f"its arms are {_millimetres(arms[0])} and {_millimetres(arms[1])} long and miss each other by "
            f"{_millimetres(strip.smallest)} where they align, more than {STOP_MISS:.0%} of the shorter one"
        )
        return what, "Correct the two points, or remove stop: as they are they never touch"
    return None


def _millimetres(value: float) -> str:
    return f"{1e3 * value:.4g} mm"
