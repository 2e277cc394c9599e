"""Boundary level: contacts found on coal's distance along rays, compared with the closed form.

A ray is `q(t) = start + t d`. Along it coal's distance f(t) is scanned, and its first change of sign is bisected.
Points of zero threshold do not cross: they approach and separate again, and contact is the minimum of f. Around a
contact angle f is even (both points rotate about one pivot). So `f(t + h) - f(t - h)` changes its sign there, steeply,
and this is bisected.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from pinbound.boundaries.boundary import Boundary, ContactAngle
from pinbound.crosscheck.engine import Engine, is_iterated, pair_engine, sample, tolerances_of
from pinbound.limits.univariate import AllowedArcs
from pinbound.robot.robot import Robot
from pinbound.tolerances import CROSSCHECK_ANGLE, CROSSCHECK_GRAZING, CROSSCHECK_POINT, CROSSCHECK_SOLID
from pinbound.typing import Array
from pinbound.values import Value

__all__ = ["BoundaryLevel", "RayCheck", "check_contacts"]

_COARSE = 97  # nodes of a scan along a ray; a thinner contact is searched again where pinbound claims it
_FINE = 129
_LEAST_RATE = 0.05  # of an effective angle along a ray: a smaller rate would make the ray needlessly long
_BISECTION = 1e-14


@dataclass(frozen=True, eq=False)
class RayCheck(Value):
    """One boundary along many rays.

    Attributes:
        method: The quantity compared with coal: ``"contact angle"``, ``"contact strip"``, ``"smallest norm"`` (for a
            boundary that is never in contact) or ``"allowed arcs"``.
        rays: Number of rays.
        free: Number of rays without contact, by both sides.
        grazing: Number of contacts that are too flat to be located; they are compared in metres only.
        angle: [rad], largest difference of the contact, in the effective angle, the coordinate, or along the ray;
            infinite if only one side found a contact.
        metres: [m], largest difference of the distances at the contact in closed form, or of the smallest ones.
        witness: (n,), the contact with this difference.
    """

    method: str
    rays: int
    free: int
    grazing: int
    angle: float
    metres: float
    witness: Array


@dataclass(frozen=True)
class BoundaryLevel(Value):
    """Contacts in closed form, compared with contacts found on coal's distance.

    Attributes:
        rays: Number of rays in total.
        boundaries: The results, by boundary.
        allowed: [m], by boundary: the allowed difference. It grows with the length of the boundary's path.
        solid: Boundaries of boxes and prisms, which coal measures by iteration: compared in metres.
        tolerance: [rad].
        metres_tolerance: [m].
        solid_tolerance: [m], for those of `solid`.
    """

    rays: int
    boundaries: Mapping[str, RayCheck]
    allowed: Mapping[str, float]
    solid: tuple[str, ...] = ()
    tolerance: float = CROSSCHECK_ANGLE
    metres_tolerance: float = CROSSCHECK_POINT
    solid_tolerance: float = CROSSCHECK_SOLID

    @property
    def worst(self) -> float:
        """[rad], the largest difference over all boundaries that are not solid."""
        return max((one.angle for name, one in self.boundaries.items() if name not in self.solid), default=0.0)

    @property
    def holds(self) -> bool:
        """Whether all differences are within the tolerances."""
        seen = all(math.isfinite(one.angle) for one in self.boundaries.values())
        near = all(one.metres <= self.allowed[name] for name, one in self.boundaries.items())
        return seen and near and self.worst <= self.tolerance


@dataclass(frozen=True)
class _Claim:
    """The first contact on a ray according to pinbound; `t` is None if there is none up to `length`.

    `unit` converts differences of t to the stated angle. `expected` is the clearance there, and `level` is the
    clearance of contact: above zero if the tolerance is larger than the threshold.
    """

    method: str
    start: Array
    direction: Array
    length: float
    t: float | None
    unit: float = 1.0
    period: float = math.inf
    expected: float = 0.0
    level: float = 0.0


@dataclass(frozen=True)
class _Seen:
    free: bool
    grazing: bool
    angle: float
    metres: float
    place: Array


def check_contacts(robot: Robot, rays: int, rng: np.random.Generator) -> BoundaryLevel:
    """Cast rays, in turn for each boundary and at least one for each, and compare the first contacts on them.

    A boundary that does not depend on q has no rays.
    """
    found: dict[str, RayCheck] = {}
    for index, boundary in enumerate(robot.boundaries):
        if not boundary.coordinates:
            continue
        count = max(1, len(range(index, rays, len(robot.boundaries))))
        starts = sample(robot, count, rng)
        claims = [_claim(robot, boundary, starts[row % len(starts)], rng) for row in range(count)]
        engine = pair_engine(robot, boundary)
        seen = [_compare(engine, boundary, claim) for claim in claims]
        worst = max(seen, key=lambda one: (one.angle, one.metres))
        found[boundary.name] = RayCheck(
            " and ".join(sorted({claim.method for claim in claims})),
            count,
            sum(one.free for one in seen),
            sum(one.grazing for one in seen),
            worst.angle,
            max(one.metres for one in seen),
            worst.place,
        )
    allowed = {boundary.name: tolerances_of(boundary) for boundary in robot.boundaries}
    solid = tuple(boundary.name for boundary in robot.boundaries if is_iterated(boundary))
    return BoundaryLevel(sum(one.rays for one in found.values()), found, allowed, solid)


def _claim(robot: Robot, boundary: Boundary, start: Array, rng: np.random.Generator) -> _Claim:
    contact = boundary.contact
    if contact is not None and boundary.path.is_plain:
        return _one_angle(robot, boundary, contact, rng)
    return _along_one_coordinate(robot, boundary, start, rng)


def _direction(robot: Robot, boundary: Boundary, rng: np.random.Generator) -> Array:
    """Return a random unit vector in the coordinates that the boundary depends on."""
    direction = np.zeros(len(robot.coordinates))
    used = list(boundary.path.minimal.coordinates)
    direction[used] = rng.normal(size=len(used))
    return direction / np.linalg.norm(direction)


def _one_angle(robot: Robot, boundary: Boundary, contact: ContactAngle, rng: np.random.Generator) -> _Claim:
    """A ray from home, over one turn of the effective angle."""
    c, rate = contact.coefficients, 0.0
    direction = np.zeros(len(c))
    while abs(rate) < _LEAST_RATE * float(np.linalg.norm(c)):
        direction = _direction(robot, boundary, rng)
        rate = float(c @ direction)
    method = "contact angle" if contact.is_stop else "contact strip"
    level = 0.0 if contact.is_stop else boundary.contact_distance - boundary.threshold
    period = 2.0 * math.pi / abs(rate)
    if contact.half_width is None:
        away = contact.smallest - boundary.threshold
        return _Claim("smallest norm", robot.home, direction, period, None, expected=away)
    phi = float(c @ robot.home)
    end = contact.gap(phi)[1 if rate > 0 else 0]
    expected = contact.smallest - boundary.threshold if contact.is_stop else level
    t = (end - phi) / rate
    return _Claim(method, robot.home, direction, period, t, abs(rate), period, expected, level)


def _along_one_coordinate(robot: Robot, boundary: Boundary, start: Array, rng: np.random.Generator) -> _Claim:
    """A ray along one coordinate from a random free start, for the articular limit in closed form."""
    index = int(rng.choice(boundary.path.minimal.coordinates))
    name, side = robot.coordinates[index], int(rng.integers(2))
    level = 0.0 if boundary.is_stop else boundary.contact_distance - boundary.threshold
    arcs, around = _arcs_around(boundary, name, index, start)
    if around is None:
        start = robot.home
        arcs, around = _arcs_around(boundary, name, index, start)
    direction = np.zeros(len(start))
    direction[index] = (-1.0, 1.0)[side]
    length = arcs.period if math.isfinite(arcs.period) else 2.0 * math.pi
    if around is None or not math.isfinite(around[side]):
        return _Claim("allowed arcs", start, direction, length, None, level=level)
    t = abs(around[side] - float(start[index]))
    return _Claim("allowed arcs", start, direction, length, t, expected=level, level=level)


def _arcs_around(
    boundary: Boundary, name: str, index: int, start: Array
) -> tuple[AllowedArcs, tuple[float, float] | None]:
    """Return the allowed arcs of a coordinate within a turn to either side, and the one that contains the start."""
    value = float(start[index])
    window = (value - 2.0 * math.pi, value + 2.0 * math.pi)
    arcs: AllowedArcs = boundary.limits(name, start, window)
    around = arcs.around(value)
    if around is None:
        return arcs, None
    low = -math.inf if around[0] <= arcs.window[0] else around[0]  # an end of the window is not a contact
    high = math.inf if around[1] >= arcs.window[1] else around[1]
    return arcs, (low, high)


def _compare(engine: Engine, boundary: Boundary, claim: _Claim) -> _Seen:
    def coal(t: float) -> float:
        return engine.distance(claim.start + t * claim.direction, 0)

    def above(t: float) -> float:
        return coal(t) - claim.level

    if claim.method == "smallest norm":
        t = _minimum(coal, claim.length)
        place = claim.start if t is None else claim.start + t * claim.direction
        metres = math.inf if t is None else abs(coal(t) - claim.expected)
        return _Seen(True, False, 0.0, metres, place)
    if claim.method == "contact angle":
        t = _minimum(coal, claim.length)
    else:
        t = _first_root(above, 0.0, claim.length, _COARSE)
        if claim.t is not None and (t is None or abs(t - claim.t) * claim.unit > CROSSCHECK_ANGLE):
            # It may be thinner than the scan: search closely where pinbound claims the contact.
            step = claim.length / _COARSE
            closer = _first_root(above, max(0.0, claim.t - step), claim.t + step, _FINE)
            t = closer if t is None or (closer is not None and closer < t) else t
    if claim.t is None:
        place = claim.start if t is None else claim.start + t * claim.direction
        return _Seen(t is None, False, 0.0 if t is None else math.inf, 0.0, place)
    place = claim.start + claim.t * claim.direction
    metres = abs(coal(claim.t) - claim.expected)
    slope = abs(float(boundary.gradient(place) @ claim.direction)) / claim.unit
    if claim.method != "contact angle" and slope < CROSSCHECK_GRAZING:
        return _Seen(False, True, 0.0, metres, place)
    if t is None:
        return _Seen(False, False, math.inf, metres, place)
    apart = t - claim.t
    if claim.method == "contact angle":
        apart -= claim.period * round(apart / claim.period)
    return _Seen(False, False, abs(apart) * claim.unit, metres, place)


def _first_root(f: Callable[[float], float], start: float, stop: float, nodes: int) -> float | None:
    """Return where f, scanned at equal steps, first falls to zero; None if it does not."""
    before, first = start, f(start)
    if first <= 0.0:
        return start
    for node in np.linspace(start, stop, nodes)[1:].tolist():
        if f(node) <= 0.0:
            return _bisect(f, before, node)
        before = node
    return None


def _minimum(f: Callable[[float], float], period: float) -> float | None:
    """Return the minimum of an even dip of f within a period, from the change of sign of `f(t + h) - f(t - h)`."""
    step = period / _COARSE
    lowest = step * int(np.argmin([f(step * node) for node in range(_COARSE)]))

    def difference(t: float) -> float:
        return f(t + step) - f(t - step)

    if not difference(lowest - step) < 0.0 < difference(lowest + step):
        return None
    return _bisect(difference, lowest - step, lowest + step)


def _bisect(f: Callable[[float], float], low: float, high: float) -> float:
    from scipy import optimize

    return float(cast(Any, optimize).bisect(f, low, high, xtol=_BISECTION))
