"""Body level: do the marked points stand for the bodies? pinbound's verdicts against coal on the collision bodies.

At a configuration beyond a contact (`BoundarySet.beyond`) the bodies may have passed through each other, so coal is
asked where the straight way from home meets that contact first: a gap there is refused needlessly, a depth is a miss.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from pinbound.bodies import Body, collision_bodies
from pinbound.boundary import Boundary
from pinbound.crosscheck.engine import Engine, blocks, body_shapes, sample
from pinbound.robot import Robot
from pinbound.tolerances import CROSSCHECK_BODY, CROSSCHECK_STOP

__all__ = ["BodyLevel", "LinkPair", "check_bodies"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LinkPair:
    """The bodies of two links, and the boundaries between them.

    Attributes:
        links: The two links.
        boundaries: Names of the boundaries between them.
        bodies: How many pairs of bodies.
        both_clear: Samples that both sides call clear.
        both_contact: Samples that both sides refuse.
        misses: Samples that pinbound calls clear, while bodies are in contact.
        refusals: Samples in contact for pinbound, while the bodies are clear.
        unreachable: Samples beyond a contact for pinbound, at which the bodies are clear again.
        miss: [m], the deepest penetration at a configuration that pinbound calls clear, or where contact begins.
        miss_q: (n,), where that is; None if there is none.
        refusal: [m], the largest gap between the bodies where pinbound refuses, or where contact begins.
        refusal_q: (n,), where that is; None if there is none.
        stops: Whether a boundary of zero threshold is among them: it claims where bodies first touch.
    """

    links: tuple[str, str]
    boundaries: tuple[str, ...]
    bodies: int
    both_clear: int
    both_contact: int
    misses: int
    refusals: int
    unreachable: int
    miss: float
    miss_q: Array | None
    refusal: float
    refusal_q: Array | None
    stops: bool


@dataclass(frozen=True)
class BodyLevel:
    """The model: marked points against collision bodies.

    Attributes:
        samples: How many configurations.
        pairs: One entry a pair of links that have a boundary and bodies.
        left_out: Links of boundaries that cannot be compared, with the reason.
        tolerance: [m], for misses: how well coal knows distances of bodies.
        stop_tolerance: [m], for needless refusals of boundaries of zero threshold; covers by spheres refuse more
            by design, and for those the refusal is stated only.
    """

    samples: int
    pairs: tuple[LinkPair, ...]
    left_out: Mapping[str, str]
    tolerance: float = CROSSCHECK_BODY
    stop_tolerance: float = CROSSCHECK_STOP

    @property
    def worst(self) -> float:
        """[m], the worst miss."""
        return max((pair.miss for pair in self.pairs), default=0.0)

    @property
    def refusal(self) -> float:
        """[m], the largest needless refusal."""
        return max((pair.refusal for pair in self.pairs), default=0.0)

    def pair_holds(self, pair: LinkPair) -> bool:
        """Whether one pair of links has no miss, and its stops are where the bodies touch."""
        return pair.miss <= self.tolerance and (not pair.stops or pair.refusal <= self.stop_tolerance)

    @property
    def holds(self) -> bool:
        """Whether all pairs hold."""
        return all(self.pair_holds(pair) for pair in self.pairs)


def check_bodies(robot: Robot, samples: int, rng: np.random.Generator) -> BodyLevel | str:
    """Compare verdicts at random configurations within the limits, or say why that cannot be done."""
    groups: dict[tuple[str, str], list[int]] = {}
    for index, boundary in enumerate(robot.boundaries):
        first, second = sorted((boundary.point_a.link, boundary.point_b.link))
        groups.setdefault((first, second), []).append(index)
    bodies: dict[str, list[Body]] = {name: [] for links in groups for name in links}
    left_out: dict[str, str] = {}
    for body in collision_bodies(robot):
        if body.link in bodies and body.shape == "mesh":
            left_out[body.link] = "has meshes, which are not compared"
        elif body.link in bodies:
            bodies[body.link].append(body)
    left_out |= {name: "has no collision bodies" for name in bodies if not bodies[name] and name not in left_out}
    kept = [links for links in groups if all(bodies[name] for name in links)]
    if not kept:
        return "no boundary has simple collision bodies on both its links"
    Q = sample(robot, samples, rng)
    pairs = tuple(_check_pair(robot, links, groups[links], bodies, Q) for links in kept)
    return BodyLevel(len(Q), pairs, left_out)


def _check_pair(
    robot: Robot, links: tuple[str, str], members: Sequence[int], bodies: Mapping[str, list[Body]], Q: Array
) -> LinkPair:
    boundaries = [robot.boundaries[index] for index in members]
    firsts, seconds = bodies[links[0]], bodies[links[1]]
    places = product(range(len(firsts)), range(len(firsts), len(firsts) + len(seconds)))
    engine = Engine(robot, body_shapes([*firsts, *seconds]), list(places))
    gap = np.concatenate([np.min(engine.distances(Q[block]), axis=1) for block in blocks(len(Q))])
    crossing = np.min([_crossing(boundary, robot.home, Q) for boundary in boundaries], axis=0)
    reached = np.isfinite(crossing)
    touching = _least_clearance(boundaries, Q) <= 0.0
    beyond, clear = reached & ~touching, ~reached & ~touching
    contact = gap <= 0.0
    there = robot.home + np.where(reached, crossing, 0.0)[:, None] * (Q - robot.home)
    gap_there, free_there = np.full(len(Q), np.nan), np.zeros(len(Q), dtype=bool)
    if np.any(reached):
        gap_there[reached] = np.min(engine.distances(there[reached]), axis=1)
        # Where another boundary of these links has stopped the way before, a depth is no miss.
        free_there[reached] = _least_clearance(boundaries, there[reached]) >= -CROSSCHECK_BODY
    miss, miss_q = _largest([(clear, -gap, Q), (free_there, -gap_there, there)])
    refusal, refusal_q = _largest([(touching, gap, Q), (reached, gap_there, there)])
    return LinkPair(
        links=links,
        boundaries=tuple(boundary.name for boundary in boundaries),
        bodies=len(engine.pairs),
        both_clear=int(np.sum(clear & ~contact)),
        both_contact=int(np.sum(~clear & contact)),
        misses=int(np.sum(clear & contact)),
        refusals=int(np.sum(touching & ~contact)),
        unreachable=int(np.sum(beyond & ~contact)),
        miss=miss,
        miss_q=miss_q,
        refusal=refusal,
        refusal_q=refusal_q,
        stops=any(boundary.threshold == 0.0 for boundary in boundaries),
    )


def _least_clearance(boundaries: Sequence[Boundary], Q: Array) -> Array:
    parts = [
        np.min([np.atleast_1d(boundary.clearance(Q[block])) for boundary in boundaries], axis=0)
        for block in blocks(len(Q))
    ]
    return np.concatenate(parts)


def _largest(choices: Sequence[tuple[NDArray[np.bool_], Array, Array]]) -> tuple[float, Array | None]:
    """Return the largest positive value over several masked arrays, with its configuration; 0 and None without."""
    value, q = 0.0, None
    for mask, values, Q in choices:
        masked = np.where(mask, values, -np.inf)
        row = int(np.argmax(masked))
        if masked[row] > value:
            value, q = float(masked[row]), Q[row]
    return value, q


def _crossing(boundary: Boundary, home: Array, Q: Array) -> Array:
    """Return the share of the way from home to each q (N,) at which the boundary is met; infinite if it is not."""
    contact = boundary.contact
    share = np.full(len(Q), math.inf)
    if contact is None or contact.half_width is None:
        return share
    start = float(contact.coefficients @ home)
    phi = Q @ contact.coefficients
    lower, upper = contact.gap(start)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(phi >= upper, (upper - start) / (phi - start), share)
        return np.where(phi <= lower, (lower - start) / (phi - start), share)
