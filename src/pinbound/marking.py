"""Propose marks for a robot: spheres over its collision bodies, and every pair of them worth checking.

What is left out is left out with a reason that is proven, or that a reader can judge; bodies that cannot be covered
are named, for the boundaries then say nothing of them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from pinbound.annotations import Annotations, BoundaryMark, Point
from pinbound.bodies import Body, Cover, collision_bodies, cover
from pinbound.chain import Chain
from pinbound.exceptions import UnknownNameError
from pinbound.interpreters import numeric, univariate
from pinbound.path import relative_path
from pinbound.robot import Robot

__all__ = ["SHAPES", "Proposal", "propose_marks"]

Array = NDArray[np.float64]

_SAMPLES = 500

SHAPES = ("sphere", "box", "cylinder", "capsule")


@dataclass(frozen=True)
class Proposal:
    """Marks for a robot, and what they leave out.

    Attributes:
        annotations: Points, boundaries and home, to save as a sidecar.
        covers: The bodies that are covered, each with its excess [m].
        uncovered: Bodies that no boundary speaks of: meshes, or shapes that were not asked for.
        left_out: Pairs of spheres left out, counted by pair of links and reason.
    """

    annotations: Annotations
    covers: tuple[Cover, ...]
    uncovered: tuple[Body, ...]
    left_out: dict[tuple[str, str, str], int]

    @property
    def excess(self) -> float:
        """[m], the largest excess of a cover: a refusal may be needless by twice this."""
        return max((one.excess for one in self.covers), default=0.0)


def propose_marks(robot: Robot, accuracy: float = 0.02, shapes: Collection[str] = SHAPES) -> Proposal:
    """Return spheres that hold the robot's collision bodies, and a boundary for every pair worth checking.

    Left out are pairs on one link, on links that never move against each other, on a link and its parent (helper
    links aside), and pairs that are proven never to meet. A home is looked for, today's first, at which the fewest
    pairs touch; pairs that touch there all the same are left out too, for no region could hold it, and are counted
    apart: those that touch in every sample overlap by design, the others deserve a better home.

    Args:
        robot: The robot; what is marked on it already is not repeated.
        accuracy: [m], how far a sphere may stick out of its body, where that can be reached.
        shapes: The shapes to cover, of ``"sphere"``, ``"box"``, ``"cylinder"``, ``"capsule"``.

    Returns:
        The proposal; `proposal.annotations.save(path)` writes the sidecar.

    Raises:
        UnknownNameError: If a shape is none of these.
        DimensionError: If the accuracy is not positive.
    """
    for shape in shapes:
        if shape not in SHAPES:
            raise UnknownNameError("shape", shape, SHAPES)
    bodies = collision_bodies(robot)
    covers = tuple(cover(body, accuracy) for body in bodies if body.shape in shapes)
    left_out: Counter[tuple[str, str, str]] = Counter()
    pairs = _moving_pairs(robot, [point for one in covers for point in _points(one)], left_out)
    Q = _samples(robot)
    contact = np.array([numeric.norm(numeric.positions(chain, Q)) <= a.radius + b.radius for a, b, chain in pairs])
    contact = contact.reshape(len(pairs), len(Q))
    best = int(np.argmin(np.sum(contact[~np.all(contact, axis=1)], axis=0))) if len(pairs) else 0
    boundaries: list[BoundaryMark] = []
    for (a, b, _), touches in zip(pairs, contact, strict=True):
        if np.all(touches):
            left_out[a.link, b.link, f"in contact in all of {len(Q)} sampled configurations"] += 1
        elif touches[best]:
            left_out[a.link, b.link, "in contact at home"] += 1
        else:
            boundaries.append(BoundaryMark(f"{a.name}-{b.name}", a.name, b.name))
    points = {point.name: point for a, b, _ in pairs for point in (a, b)}
    used = {name for boundary in boundaries for name in (boundary.a, boundary.b)}
    return Proposal(
        annotations=Annotations.of(
            (point for point in points.values() if point.name in used),
            boundaries,
            home=dict(zip(robot.coordinates, Q[best].tolist(), strict=True)),
        ),
        covers=covers,
        uncovered=tuple(body for body in bodies if body.shape not in shapes),
        left_out=dict(left_out),
    )


def _samples(robot: Robot) -> Array:
    """Return home, and random configurations within the limits: candidates for a home without contact."""
    lower, upper = np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi)
    drawn = np.random.default_rng(0).uniform(lower, upper, (_SAMPLES - 1, len(robot.coordinates)))
    return np.vstack((robot.home, drawn))


def _moving_pairs(
    robot: Robot, points: Sequence[Point], left_out: Counter[tuple[str, str, str]]
) -> list[tuple[Point, Point, Chain]]:
    """Return the pairs that may meet, with their chains; count the others by reason."""
    reasons: dict[tuple[str, str], str | None] = {}
    pairs: list[tuple[Point, Point, Chain]] = []
    for a, b in combinations(points, 2):
        if a.link == b.link:
            continue
        links = (a.link, b.link)
        if links not in reasons:
            reasons[links] = _links_reason(robot, *links)
        reason = reasons[links]
        if reason is None:
            chain = relative_path(robot.tree, robot.coupling, a, b).minimal
            if _least(chain) <= a.radius + b.radius:
                pairs.append((a, b, chain))
                continue
            reason = "can never meet"
        left_out[(*links, reason)] += 1
    return pairs


def _points(one: Cover) -> Iterable[Point]:
    for index, (x, y, z) in enumerate(one.centres.tolist()):
        name = f"{one.body.link}.{one.body.index}" + (f".{index}" if len(one.centres) > 1 else "")
        yield Point(name, one.body.link, (x, y, z), one.radius)


def _links_reason(robot: Robot, link_a: str, link_b: str) -> str | None:
    """Return why no pair on two links is worth checking, or None."""
    joints = robot.tree.path_between(link_a, link_b)
    if any(joint.type in ("floating", "planar") for joint in joints):
        return "a free joint lies between"
    if not any(joint.moves for joint in joints):
        return "never move against each other"
    return "parent and child" if robot.tree.are_adjacent(link_a, link_b) else None


def _least(chain: Chain) -> float:
    """Return a lower bound of a chain's norm over all q: exact for one angle, else by the triangle inequality."""
    if np.any(chain.slides):
        return 0.0
    single = univariate.one_angle_strip(chain, 0.0, 0.0)
    if single is not None:
        return single[1].smallest
    lengths = np.linalg.norm(chain.offsets, axis=1)
    return float(np.max(2.0 * lengths) - np.sum(lengths))
