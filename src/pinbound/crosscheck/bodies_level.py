"""Body level: do the marked points stand for the bodies? pinbound's verdicts against coal on the collision bodies.

A configuration beyond any contact (`BoundarySet.beyond`) cannot be reached, and bodies there may have passed through
each other. So coal is also asked where the straight way from home meets a contact of these links: a gap there is
refused needlessly, a depth is a miss unless something else has stopped the way before. And since thin bodies slip
between samples, some of these ways are swept.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from pinbound.boundaries.boundary import Boundary
from pinbound.coverage.bodies import SHAPES, Body, collision_bodies
from pinbound.crosscheck.engine import Engine, blocks, body_shapes, sample
from pinbound.crosscheck.sweep import sweep
from pinbound.robot.robot import Robot
from pinbound.tolerances import CROSSCHECK_BODY, CROSSCHECK_STOP
from pinbound.typing import Array, Flags
from pinbound.values import Value

__all__ = ["BodyLevel", "LinkPair", "check_bodies"]

_MOST_WAYS = 200


@dataclass(frozen=True, eq=False)
class LinkPair(Value):
    """The bodies of two links, and the boundaries between them.

    Attributes:
        links: The two links.
        boundaries: Names of the boundaries between them.
        bodies: How many pairs of bodies.
        touching: How many pairs of bodies more were in contact at home, by coal, and therefore left out: home is free,
            so that they overlap by design.
        both_clear: Samples that both sides call clear.
        both_contact: Samples that both sides refuse.
        misses: Samples that pinbound calls clear, while bodies are in contact.
        refusals: Samples in contact for pinbound, while the bodies are clear.
        ways: How many straight ways from home were swept without stepping over a contact.
        unreachable: Samples beyond a contact of any links, at which these bodies are clear.
        miss: [m], the deepest penetration at a configuration that pinbound calls clear, sample or on a way, or where
            contact begins.
        miss_q: (n,), where that is; None if there is none.
        refusal: [m], the largest gap between the bodies where pinbound refuses, or where contact begins.
        refusal_q: (n,), where that is; None if there is none.
        stops: Whether a boundary of zero threshold is among them: it claims where bodies first touch.
    """

    links: tuple[str, str]
    boundaries: tuple[str, ...]
    bodies: int
    touching: int
    both_clear: int
    both_contact: int
    misses: int
    refusals: int
    unreachable: int
    ways: int
    miss: float
    miss_q: Array | None
    refusal: float
    refusal_q: Array | None
    stops: bool


@dataclass(frozen=True)
class BodyLevel(Value):
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
        if body.link in bodies and body.shape not in SHAPES:
            kind = "meshes" if body.shape == "mesh" else f"a {body.shape}"
            left_out[body.link] = f"has {kind}, which are not compared"
        elif body.link in bodies:
            bodies[body.link].append(body)
    left_out |= {name: "has no bodies" for name in bodies if not bodies[name] and name not in left_out}
    kept = [links for links in groups if all(bodies[name] for name in links)]
    if not kept:
        return "no boundary has simple collision bodies on both its links"
    Q = sample(robot, samples, rng)
    # Every second one is drawn towards home: in a small region few others would lie.
    Q[::2] = robot.home + rng.random((len(Q[::2]), 1)) * (Q[::2] - robot.home)
    first_met = np.full(len(Q), math.inf)
    for boundary in robot.boundaries:
        first_met = np.minimum(first_met, _crossing(boundary, robot.home, Q))
    pairs = [_check_pair(robot, groups[links], (bodies[links[0]], bodies[links[1]]), Q, first_met) for links in kept]
    return BodyLevel(len(Q), tuple(pair for pair in pairs if pair is not None), left_out)


def _check_pair(
    robot: Robot, members: Sequence[int], bodies: tuple[list[Body], list[Body]], Q: Array, first_met: Array
) -> LinkPair | None:
    """Compare one pair of links, unless all its bodies touch at home.

    `first_met` (N,) is where the way from home to each q meets any contact.
    """
    boundaries = [robot.boundaries[index] for index in members]
    count, shapes = len(bodies[0]), body_shapes([*bodies[0], *bodies[1]])
    places = list(product(range(count), range(count, len(shapes))))
    at_home = Engine(robot, shapes, places).distances(robot.home[None])[0]
    apart = [place for place, distance in zip(places, at_home, strict=True) if distance > 0.0]
    if not apart:
        return None
    engine = Engine(robot, shapes, apart)
    gap = np.concatenate([np.min(engine.distances(Q[block]), axis=1) for block in blocks(len(Q))])
    crossing = np.min([_crossing(boundary, robot.home, Q) for boundary in boundaries], axis=0)
    touching = _least_clearance(boundaries, Q) <= 0.0
    beyond = np.isfinite(first_met) & ~touching
    clear, contact = ~beyond & ~touching, gap <= 0.0
    meets = np.isfinite(crossing)
    there = robot.home + np.where(meets, crossing, 0.0)[:, None] * (Q - robot.home)
    gap_there, first = np.full(len(Q), np.nan), np.zeros(len(Q), dtype=bool)
    if np.any(meets):
        gap_there[meets] = np.min(engine.distances(there[meets]), axis=1)
        # Where another boundary has stopped the way before, a depth is no miss.
        first[meets] = _least_clearance(boundaries, there[meets]) >= -CROSSCHECK_BODY
        first &= crossing <= first_met
    links = (bodies[0][0].link, bodies[1][0].link)
    swept = Q[1::2][:_MOST_WAYS]
    on_way, depth, given_up = sweep(
        robot, engine, [*bodies[0], *bodies[1]], links, swept, np.minimum(first_met, 1.0)[1::2][:_MOST_WAYS]
    )
    clear_on_way = _least_clearance(boundaries, on_way) > 0.0 if len(on_way) else np.zeros(0, dtype=bool)
    miss, miss_q = _largest([(clear, -gap, Q), (first, -gap_there, there), (clear_on_way, depth, on_way)])
    refusal, refusal_q = _largest([(touching, gap, Q), (meets, gap_there, there)])
    return LinkPair(
        links=links,
        boundaries=tuple(boundary.name for boundary in boundaries),
        bodies=len(engine.pairs),
        touching=len(places) - len(apart),
        both_clear=int(np.sum(clear & ~contact)),
        both_contact=int(np.sum(~clear & contact)),
        misses=int(np.sum(clear & contact)),
        refusals=int(np.sum(touching & ~contact)),
        unreachable=int(np.sum(beyond & ~contact)),
        ways=len(swept) - given_up,
        miss=miss,
        miss_q=miss_q,
        refusal=refusal,
        refusal_q=refusal_q,
        stops=any(not boundary.has_size for boundary in boundaries),
    )


def _least_clearance(boundaries: Sequence[Boundary], Q: Array) -> Array:
    """Return the smallest signed clearance (N,); stops, whose contact is a place on the way, are not among them."""
    least = np.full(len(Q), math.inf)
    for boundary, block in product([one for one in boundaries if not one.is_stop], blocks(len(Q))):
        least[block] = np.minimum(least[block], boundary.signed_clearance(Q[block]))
    return least


def _largest(choices: Sequence[tuple[Flags, Array, Array]]) -> tuple[float, Array | None]:
    """Return the largest positive value over several masked arrays, with its configuration; 0 and None without."""
    value, q = 0.0, None
    for mask, values, Q in choices:
        if not len(mask):
            continue
        masked = np.where(mask, values, -np.inf)
        row = int(np.argmax(masked))
        if masked[row] > value:
            value, q = float(masked[row]), Q[row]
    return value, q


def _crossing(boundary: Boundary, home: Array, Q: Array) -> Array:
    """Return the share of the way from home to each q (N,) at which the boundary is met; infinite if it is not."""
    share = np.full(len(Q), math.inf)
    for contact in boundary.contacts or ():
        start = float(contact.coefficients @ home)
        phi = Q @ contact.coefficients
        lower, upper = contact.gap(start)
        with np.errstate(divide="ignore", invalid="ignore"):
            share = np.fmin(share, np.where(phi >= upper, (upper - start) / (phi - start), math.inf))
            share = np.fmin(share, np.where(phi <= lower, (lower - start) / (phi - start), math.inf))
    return share
