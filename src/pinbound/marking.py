"""Propose marks for a robot: marks over its collision bodies, and every pair of them worth checking.

What is left out is left out with a reason that is proven, or that a reader can judge; bodies that cannot be covered
are named, for the boundaries then say nothing of them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from pinbound.annotations import Annotations, BoundaryMark, Mark
from pinbound.bodies import Body, collision_bodies
from pinbound.contact import contact_distance
from pinbound.coupling import Intervals
from pinbound.covers import By, Cover, covers
from pinbound.exceptions import UnknownNameError
from pinbound.home import coordinate_ends
from pinbound.interpreters import separation, univariate
from pinbound.path import RelativePath, relative_path
from pinbound.robot import Robot
from pinbound.tolerances import CONTACT

__all__ = ["SHAPES", "Proposal", "propose_marks"]

Array = NDArray[np.float64]

_SAMPLES = 500
_FINEST = 0.01  # of a body's smallest measure: the excess to aim at where marks touch at home

SHAPES = ("sphere", "box", "cylinder", "capsule")


@dataclass(frozen=True)
class Proposal:
    """Marks for a robot, and what they leave out.

    Attributes:
        annotations: Points, boundaries and home, to save as a sidecar.
        covers: The bodies that are covered, each with its excess [m].
        uncovered: Bodies that no boundary speaks of: meshes, or shapes that were not asked for.
        left_out: Pairs of marks left out, counted by pair of links and reason.
    """

    annotations: Annotations
    covers: tuple[Cover, ...]
    uncovered: tuple[Body, ...]
    left_out: dict[tuple[str, str, str], int]

    @property
    def excess(self) -> float:
        """[m], the largest excess of a cover: a refusal may be needless by twice this."""
        return max((one.excess for one in self.covers), default=0.0)


def propose_marks(
    robot: Robot, accuracy: float = 0.02, shapes: Collection[str] = SHAPES, by: By = "bodies"
) -> Proposal:
    """Return marks that hold the robot's collision bodies, and a boundary for every pair worth checking.

    Left out are pairs on one link, on links that never move against each other, on a link and its parent (helper
    links aside), and pairs that are proven never to meet. A home is looked for, today's first, at which the fewest
    pairs touch; pairs that touch there all the same are left out too, for no region could hold it, and are counted
    apart: those that touch in every sample overlap by design, the others deserve a better home. Before that, bodies of
    such pairs are covered as finely as polygons can.

    Args:
        robot: The robot; what is marked on it already is not repeated.
        accuracy: [m], how far a mark may stick out of its body, where that can be reached.
        shapes: The shapes to cover, of ``"sphere"``, ``"box"``, ``"cylinder"``, ``"capsule"``.
        by: ``"bodies"``: by points, capsules, boxes and prisms, which fit; ``"spheres"``: by spheres alone, which are
            many, but compiled as a whole, and whose regions have curved edges.

    Returns:
        The proposal; `proposal.annotations.save(path)` writes the sidecar.

    Raises:
        UnknownNameError: If a shape is none of these, or `by` neither.
        DimensionError: If the accuracy is not positive.
    """
    for shape in shapes:
        if shape not in SHAPES:
            raise UnknownNameError("shape", shape, SHAPES)
    if by not in ("bodies", "spheres"):
        raise UnknownNameError("cover", by, ("bodies", "spheres"))
    bodies = collision_bodies(robot)
    chosen = [body for body in bodies if body.shape in shapes]
    uncovered = tuple(body for body in bodies if body.shape not in shapes)
    found = covers(chosen, accuracy, by)
    proposal, touching = _proposal(robot, found, uncovered)
    if touching and by == "bodies":
        fine = {one for one in found if one.link in touching}
        finest = min(accuracy, *(_FINEST * min(body.size) for one in fine for body in one.bodies))
        again = covers([body for body in chosen if body.link in touching], finest, by)
        rest = covers([body for body in chosen if body.link not in touching], accuracy, by)
        proposal, _ = _proposal(robot, (*rest, *again), uncovered)
    return proposal


def _proposal(robot: Robot, found: Sequence[Cover], uncovered: tuple[Body, ...]) -> tuple[Proposal, set[str]]:
    """Return the proposal with these covers, and the links of which some pair touches at home for its covers' sake."""
    left_out: Counter[tuple[str, str, str]] = Counter()
    excess = {mark.name: one.excess for one in found for mark in one.marks}
    pairs = _moving_pairs(robot, [mark for one in found for mark in one.marks], left_out)
    Q = _samples(robot)
    contact = np.array([separation.separations(path, Q) <= _contact(a, b, path) for a, b, path in pairs])
    contact = contact.reshape(len(pairs), len(Q))
    best = int(np.argmin(np.sum(contact[~np.all(contact, axis=1)], axis=0))) if len(pairs) else 0
    boundaries: list[BoundaryMark] = []
    touching: set[str] = set()
    for (a, b, _), touches in zip(pairs, contact, strict=True):
        if not touches[best]:
            boundaries.append(BoundaryMark(f"{a.name}-{b.name}", a.name, b.name))
            continue
        always = f"in contact in all of {len(Q)} sampled configurations"
        left_out[a.link, b.link, always if np.all(touches) else "in contact at home"] += 1
        if excess[a.name] + excess[b.name] > 0.0:
            touching |= {a.link, b.link}
    marks = {mark.name: mark for a, b, _ in pairs for mark in (a, b)}
    used = {name for boundary in boundaries for name in (boundary.a, boundary.b)}
    annotations = Annotations.of(
        (mark for mark in marks.values() if mark.name in used),
        boundaries,
        home=dict(zip(robot.coordinates, Q[best].tolist(), strict=True)),
    )
    return Proposal(annotations, tuple(found), uncovered, dict(left_out)), touching


def _samples(robot: Robot) -> Array:
    """Return home, and random configurations within all limits, mimic joints' too: candidates for a home."""
    n = len(robot.coordinates)
    lower, upper = coordinate_ends(robot.linear_limits, n).T
    lower, upper = np.maximum(lower, np.minimum(-np.pi, upper)), np.minimum(upper, np.maximum(np.pi, lower))
    drawn = np.random.default_rng(0).uniform(lower, np.maximum(lower, upper), (_SAMPLES - 1, n))
    return np.vstack((robot.home, drawn[Intervals.of(robot.linear_limits, n).hold(drawn)]))


def _moving_pairs(
    robot: Robot, marks: Sequence[Mark], left_out: Counter[tuple[str, str, str]]
) -> list[tuple[Mark, Mark, RelativePath]]:
    """Return the pairs that may meet, with their paths; count the others by reason."""
    reasons: dict[tuple[str, str], str | None] = {}
    pairs: list[tuple[Mark, Mark, RelativePath]] = []
    for a, b in combinations(marks, 2):
        if a.link == b.link:
            continue
        links = (a.link, b.link)
        if links not in reasons:
            reasons[links] = _links_reason(robot, *links)
        reason = reasons[links]
        if reason is None:
            path = relative_path(robot.tree, robot.coupling, a, b)
            if _least(path) <= a.radius + b.radius:
                pairs.append((a, b, path))
                continue
            reason = "can never meet"
        left_out[(*links, reason)] += 1
    return pairs


def _links_reason(robot: Robot, link_a: str, link_b: str) -> str | None:
    """Return why no pair on two links is worth checking, or None."""
    joints = robot.tree.path_between(link_a, link_b)
    if any(joint.type in ("floating", "planar") for joint in joints):
        return "a free joint lies between"
    if not any(joint.moves for joint in joints):
        return "never move against each other"
    return "parent and child" if robot.tree.are_adjacent(link_a, link_b) else None


def _contact(a: Mark, b: Mark, path: RelativePath) -> float:
    """Return up to which separation a boundary between two marks is in contact, as `load` will say."""
    return contact_distance(path, a.radius + b.radius, CONTACT)


def _least(path: RelativePath) -> float:
    """Return a lower bound of a path's norm over all q: exact for one angle, else by the triangle inequality."""
    chain = path.minimal
    if np.any(chain.slides):
        return 0.0
    single = univariate.one_angle_smallest(path)
    if single is not None:
        return single
    if path.across is not None:
        return -np.inf  # of lines and planes, which no cover holds, a part of r counts: its length bounds nothing
    ways = np.array(path.swept.directions).reshape(-1, *chain.offsets.shape)
    middle = np.linalg.norm(chain.offsets + 0.5 * ways.sum(axis=0), axis=1)
    around = 0.5 * np.linalg.norm(ways, axis=2).sum(axis=0)
    return float(np.max(2.0 * middle) - np.sum(middle) - np.sum(around))
