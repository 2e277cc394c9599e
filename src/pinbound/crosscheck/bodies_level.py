"""Body level: whether the marks represent the bodies. pinbound's verdicts are compared with coal on collision bodies.

A configuration beyond any contact (`BoundarySet.beyond`) cannot be reached, and its bodies may have passed through each
other. So coal also examines the point at which the straight path from home meets a contact of these links. A gap there
is a needless refusal; a depth is a miss unless another boundary has stopped the path before. Because thin bodies can
pass between samples, some of these paths are swept.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from pinbound.coverage.bodies import Body, collision_bodies
from pinbound.crosscheck.engine import Engine, blocks, body_shapes, sample
from pinbound.crosscheck.link_pairs import LinkPair, largest, least_clearance
from pinbound.crosscheck.link_pairs import crossing as met_at
from pinbound.crosscheck.mesh_pairs import check_mesh_pairs
from pinbound.crosscheck.raw import READ, unreadable
from pinbound.crosscheck.sweep import sweep
from pinbound.robot.robot import Robot
from pinbound.tolerances import CROSSCHECK_BODY, CROSSCHECK_STOP
from pinbound.typing import Array
from pinbound.values import Value

__all__ = ["BodyLevel", "LinkPair", "check_bodies"]

_MOST_WAYS = 200


@dataclass(frozen=True)
class BodyLevel(Value):
    """The model: marks compared with collision bodies.

    Attributes:
        samples: Number of configurations.
        pairs: One entry for each pair of links that have a boundary and bodies.
        left_out: Links of boundaries that cannot be compared, with the reason.
        tolerance: [m], for misses: the accuracy of coal's distances of bodies.
        stop_tolerance: [m], for needless refusals of boundaries of zero threshold. Covers by spheres refuse more by
            design; for those the refusal is only reported.
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
    """Compare verdicts at random configurations within the limits; if this is not possible, return why."""
    groups: dict[tuple[str, str], list[int]] = {}
    for index, boundary in enumerate(robot.boundaries):
        first, second = sorted((boundary.point_a.link, boundary.point_b.link))
        groups.setdefault((first, second), []).append(index)
    bodies: dict[str, list[Body]] = {name: [] for links in groups for name in links}
    left_out: dict[str, str] = {}
    for body in collision_bodies(robot):
        if body.link not in bodies:
            continue
        why = f"has a {body.shape}, which is not compared" if body.shape not in READ else unreadable(robot, body)
        if why:
            left_out[body.link] = why
        else:
            bodies[body.link].append(body)
    left_out |= {name: "has no bodies" for name in bodies if not bodies[name] and name not in left_out}
    kept = [links for links in groups if all(bodies[name] for name in links)]
    if not kept:
        return "no boundary has bodies on both its links"
    Q = sample(robot, samples, rng)
    # Every second one is drawn towards home: few others would lie in a small region.
    Q[::2] = robot.home + rng.random((len(Q[::2]), 1)) * (Q[::2] - robot.home)
    first_met = np.full(len(Q), math.inf)
    for boundary in robot.boundaries:
        first_met = np.minimum(first_met, met_at(boundary, robot.home, Q))
    with_meshes = {links for links in kept if any(body.shape == "mesh" for name in links for body in bodies[name])}
    found: dict[tuple[str, str], LinkPair | None] = {
        links: _check_pair(robot, groups[links], (bodies[links[0]], bodies[links[1]]), Q, first_met)
        for links in kept
        if links not in with_meshes
    }
    found |= check_mesh_pairs(
        robot, {links: groups[links] for links in kept if links in with_meshes}, bodies, Q, first_met
    )
    status = {frozenset(pair.links): pair.status.value for pair in robot.coverage.pairs}
    pairs = [replace(pair, coverage=status.get(frozenset(links), "")) for links in kept if (pair := found[links])]
    return BodyLevel(len(Q), tuple(pairs), left_out)


def _check_pair(
    robot: Robot, members: Sequence[int], bodies: tuple[list[Body], list[Body]], Q: Array, first_met: Array
) -> LinkPair | None:
    """Compare one pair of links, unless all its bodies touch at home.

    `first_met` (N,) is the point at which the path from home to each q meets any contact.
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
    crossing = np.min([met_at(boundary, robot.home, Q) for boundary in boundaries], axis=0)
    touching = least_clearance(boundaries, Q) <= 0.0
    beyond = np.isfinite(first_met) & ~touching
    clear, contact = ~beyond & ~touching, gap <= 0.0
    meets = np.isfinite(crossing)
    there = robot.home + np.where(meets, crossing, 0.0)[:, None] * (Q - robot.home)
    gap_there, first = np.full(len(Q), np.nan), np.zeros(len(Q), dtype=bool)
    if np.any(meets):
        gap_there[meets] = np.min(engine.distances(there[meets]), axis=1)
        # If another boundary has stopped the path before, a depth is not a miss.
        first[meets] = least_clearance(boundaries, there[meets]) >= -CROSSCHECK_BODY
        first &= crossing <= first_met
    links = (bodies[0][0].link, bodies[1][0].link)
    swept = Q[1::2][:_MOST_WAYS]
    on_way, depth, given_up = sweep(
        robot, engine, [*bodies[0], *bodies[1]], links, swept, np.minimum(first_met, 1.0)[1::2][:_MOST_WAYS]
    )
    clear_on_way = least_clearance(boundaries, on_way) > 0.0 if len(on_way) else np.zeros(0, dtype=bool)
    miss, miss_q = largest([(clear, -gap, Q), (first, -gap_there, there), (clear_on_way, depth, on_way)])
    refusal, refusal_q = largest([(touching, gap, Q), (meets, gap_there, there)])
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
        measured=int(np.sum(touching & ~contact)) + int(np.sum(meets)),
    )
