"""Pairs of links and of marks, each judged once: need they be looked at, and where do they touch?"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Literal

import numpy as np

from pinbound.annotations import Mark
from pinbound.contact import contact_distance
from pinbound.coverage.bodies import Body
from pinbound.coverage.poses import Poses
from pinbound.coverage.reach import least_separation
from pinbound.evaluate import depth, separation
from pinbound.exceptions import UnsupportedError
from pinbound.loops.closures import place_error
from pinbound.marking.always import overlap_everywhere
from pinbound.marking.candidates import draw, simple_homes
from pinbound.path.relative import RelativePath, relative_path
from pinbound.robot.robot import Robot
from pinbound.tolerances import FOLDING, NEVER_MEETS, UNIT_ROUNDOFF
from pinbound.typing import Array, Flags
from pinbound.values import Value

__all__ = [
    "ALWAYS",
    "AT_HOME",
    "FREE_JOINT",
    "IN_ALL",
    "NEIGHBOURS",
    "NEVER",
    "RIGID",
    "Basis",
    "Evidence",
    "Judge",
    "Pair",
    "count_uncovered",
    "links_reason",
    "listed",
    "moving_pairs",
]

Basis = Literal["proof", "witness", "samples", "granted"]

SAMPLES = 500
_NAMED = 5  # how many pairs a sentence names

NEIGHBOURS = "neighbours"
RIGID = "never move against each other"
FREE_JOINT = "a free joint lies between"
NEVER = "can never meet"
AT_HOME = "in contact at home"
ALWAYS = "always overlap"
IN_ALL = "in contact in all of"


@dataclass(frozen=True, eq=False)
class Evidence(Value):
    """What leaving out a pair of links for one reason rests on.

    Attributes:
        basis: ``"proof"``: it holds for all q; ``"witness"``: it was seen at `q`; ``"samples"``: it was seen in all
            sampled configurations, which proves nothing; ``"granted"``: it is taken for granted.
        text: The number behind it, for people.
        q: (n,), where it was seen; None but for a witness.
        marks: The pairs of marks that are left out for it, though other pairs of these links may be watched.
    """

    basis: Basis
    text: str
    q: Array | None = None
    marks: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, eq=False)
class Pair:
    """Two marks that may meet: in which candidates they are in contact (N,), and their gap [m] in the first.

    `always` is by how much they are proven to overlap in every configuration [m]; None if that is not proven.
    """

    a: Mark
    b: Mark
    contact: Flags
    gap: float
    always: float | None = None


class Judge:
    """Judges pairs of links and of marks of one robot, each once."""

    def __init__(self, robot: Robot, neighbours: bool = False) -> None:
        """Draw the configurations; `neighbours`: pairs of neighbours are worth a look, too."""
        self.robot, self.neighbours = robot, neighbours
        drawn = draw(robot, SAMPLES - 1, np.random.default_rng(0))
        self.Q: Array = np.vstack((robot.home, simple_homes(robot), drawn))
        self._poses = Poses(robot.tree, robot.coupling, self.Q)
        self._links: dict[tuple[str, str], str | None] = {}
        self._pairs: dict[tuple[Mark, Mark], Pair | float] = {}

    def links_reason(self, link_a: str, link_b: str) -> str | None:
        """Return why no pair on two links is worth checking, or None."""
        if (link_a, link_b) not in self._links:
            found = links_reason(self.robot, link_a, link_b)
            self._links[link_a, link_b] = None if found == NEIGHBOURS and self.neighbours else found
        return self._links[link_a, link_b]

    def pair(self, a: Mark, b: Mark) -> Pair | float:
        """Return what is known of two marks, or how far they are proven to stay apart [m]."""
        if (a, b) not in self._pairs:
            self._pairs[a, b] = self._judged(a, b)
        return self._pairs[a, b]

    def at_home(self, pair: Pair) -> float:
        """Return the signed distance of two marks at the robot's home [m]: negative is how deep they overlap."""
        if not pair.contact[0]:
            return pair.gap
        robot = self.robot
        path = relative_path(robot.tree, robot.coupling, pair.a, pair.b)
        radii = pair.a.shape.radius + pair.b.shape.radius
        return float(depth.signed_distances(path, radii, self.Q[:1])[0])

    def _judged(self, a: Mark, b: Mark) -> Pair | float:
        robot = self.robot
        with np.errstate(over="ignore", invalid="ignore"):
            path = relative_path(robot.tree, robot.coupling, a, b)
            radii = a.shape.radius + b.shape.radius
            distance = contact_distance(path, radii, robot.annotations.contact_tolerance)
            joints = len(robot.tree.path_between(a.link, b.link))
            rounding = FOLDING * UNIT_ROUNDOFF * (joints + 2) ** 2 * path.minimal.scale
            off = place_error(robot.tree, robot.coupling, robot.linear_limits, robot.closures, a, b)
            spare = least_separation(path) - (distance + off + rounding)
            if spare > 0.0:  # false where a number is not finite: that proves nothing
                return spare
            found = self._separations(path, a, b, distance)
        if not np.all(np.isfinite(found)):
            raise UnsupportedError(
                f"the distance of {a.name!r} and {b.name!r} is no finite number; are all lengths of the URDF in metres?"
            )
        contact = found <= distance
        always = overlap_everywhere(robot.tree, robot.coupling, a, b) if np.all(contact) and not off else None
        return Pair(a, b, contact, float(found[0]) - radii, always)

    def _separations(self, path: RelativePath, a: Mark, b: Mark, distance: float) -> Array:
        """Return separations (N,) [m]; where balls about both marks are apart, a lower bound that is no contact."""
        balls = self._poses.gaps(a, b)
        radii = a.shape.radius + b.shape.radius
        near = ~(balls > distance - radii + NEVER_MEETS * max(1.0, path.minimal.scale))
        near[0] = True  # home's is told
        found = balls + radii
        found[near] = separation.separations(path, self.Q[near])
        return found


def moving_pairs(
    judge: Judge, marks: Sequence[Mark], left_out: Counter[tuple[str, str, str]], spare: dict[tuple[str, str], float]
) -> list[Pair]:
    """Return the pairs that may meet; count the others by reason, and note how far those never come near [m]."""
    pairs: list[Pair] = []
    for a, b in combinations(marks, 2):
        if a.link == b.link:
            continue
        reason = judge.links_reason(a.link, b.link)
        if reason is None:
            pair = judge.pair(a, b)
            if isinstance(pair, Pair):
                pairs.append(pair)
                continue
            reason = NEVER
            spare[a.link, b.link] = min(pair, spare.get((a.link, b.link), np.inf))
        left_out[a.link, b.link, reason] += 1
    return pairs


def count_uncovered(
    judge: Judge, bodies: Sequence[Body], uncovered: Sequence[Body], left_out: Counter[tuple[str, str, str]]
) -> None:
    """Count the pairs of bodies that no boundary can speak of, as one of the two is not covered."""
    of_link: dict[str, list[Body]] = {}
    for body in bodies:
        of_link.setdefault(body.link, []).append(body)
    missing = set(uncovered)
    bare = {link: [body for body in found if body in missing] for link, found in of_link.items()}
    for link_a, link_b in combinations(of_link, 2):
        a, b = len(of_link[link_a]), len(of_link[link_b])
        pairs = a * b - (a - len(bare[link_a])) * (b - len(bare[link_b]))
        if not pairs:
            continue
        reason = judge.links_reason(link_a, link_b)
        if reason is None:
            named = [f"{body.name} ({body.shape})" for body in (*bare[link_a], *bare[link_b])]
            reason = f"not covered: {listed(named)}"
        left_out[link_a, link_b, reason] += pairs


def listed(words: Sequence[str]) -> str:
    """Return the first few words, and how many more there are."""
    more = f" and {len(words) - _NAMED} more" if len(words) > _NAMED else ""
    return ", ".join(words[:_NAMED]) + more


def links_reason(robot: Robot, link_a: str, link_b: str) -> str | None:
    """Return why no pair on two links is worth checking, or None."""
    joints = robot.tree.path_between(link_a, link_b)
    if any(joint.type in ("floating", "planar") for joint in joints):
        return FREE_JOINT
    degrees = robot.tree.degrees_between(link_a, link_b, robot.coupling)
    return {0: RIGID, 1: NEIGHBOURS}.get(degrees)
