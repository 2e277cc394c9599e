"""Pairs of links and of marks, each judged once: whether they need a boundary, and where they touch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import Literal

import numpy as np

from pinbound.annotations import Mark
from pinbound.coverage.bodies import Body
from pinbound.coverage.poses import Poses
from pinbound.evaluate import depth
from pinbound.marking.broad import least_gaps
from pinbound.marking.candidates import draw, simple_homes
from pinbound.marking.narrow import Links, Pair
from pinbound.model.tree import MANY_DEGREES
from pinbound.path.relative import relative_path
from pinbound.robot.robot import Robot
from pinbound.typing import Array
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
    "Spare",
    "count_uncovered",
    "listed",
    "moving_pairs",
]

Basis = Literal["proof", "witness", "samples", "granted"]

SAMPLES = 500
_NAMED = 5  # the number of pairs that a sentence names
_NONE: dict[str, int] = {}

NEIGHBOURS = "neighbours"
RIGID = "never move against each other"
FREE_JOINT = "a free joint lies between"
NEVER = "can never meet"
AT_HOME = "in contact at home"
ALWAYS = "always overlap"
IN_ALL = "in contact in all of"


@dataclass(frozen=True, eq=False, slots=True)
class Evidence(Value):
    """The evidence for leaving out a pair of links for one reason.

    Attributes:
        basis: ``"proof"``: it holds for all q; ``"witness"``: it was seen at `q`; ``"samples"``: it was seen in all
            sampled configurations, which is not a proof; ``"granted"``: it is assumed.
        text: The number that supports it, as text.
        q: (n,), the configuration at which it was seen; None except for a witness.
        marks: The pairs of marks that are left out for this reason; other pairs of these links may be watched.
    """

    basis: Basis
    text: str
    q: Array | None = None
    marks: tuple[tuple[str, str], ...] = ()

    def __eq__(self, other: object) -> bool:
        """Return whether all four fields are equal."""
        if not isinstance(other, Evidence):
            return NotImplemented
        mine, its = (None if one.q is None else one.q.tolist() for one in (self, other))
        return (self.basis, self.text, self.marks, mine) == (other.basis, other.text, other.marks, its)

    def __hash__(self) -> int:
        """Return a hash of the texts and the marks."""
        return hash((self.basis, self.text, self.marks))


@dataclass(frozen=True, eq=False)
class Spare:
    """Lower bounds of the distance of the marks of two links that can never meet [m].

    Attributes:
        judged: The bounds of links whose marks were examined, by the names of the two links.
        places: The row of each link's name in `bounds`.
        bounds: (k, k) lower bounds for all other links; None if there are none.
    """

    judged: dict[tuple[str, str], float]
    places: dict[str, int]
    bounds: Array | None

    def of(self, a: str, b: str) -> float:
        """Return the bound for two links."""
        found = self.judged.get((a, b))
        if found is not None:
            return found
        assert self.bounds is not None  # links either were examined or have a bound
        return float(self.bounds[self.places[a], self.places[b]])


class Judge:
    """Judges pairs of links and of marks of one robot, each only once."""

    def __init__(self, robot: Robot, neighbours: bool = False) -> None:
        """Draw the configurations; with `neighbours`, pairs of neighbours get boundaries, too."""
        self.robot, self.neighbours = robot, neighbours
        drawn = draw(robot, SAMPLES - 1, np.random.default_rng(0))
        self.Q: Array = np.vstack((robot.home, simple_homes(robot), drawn))
        self._poses = Poses(robot.tree, robot.coupling, self.Q)
        self._pairs: dict[tuple[Mark, Mark], Pair | float] = {}

    def links_reason(self, link_a: str, link_b: str) -> str | None:
        """Return why no pair of marks on two links needs a boundary, or None."""
        if self._parts[link_a] != self._parts[link_b]:
            return FREE_JOINT
        degrees = self._degrees.get(link_a, _NONE).get(link_b, MANY_DEGREES)
        return RIGID if degrees == 0 else NEIGHBOURS if degrees == 1 and not self.neighbours else None

    @cached_property
    def _degrees(self) -> dict[str, dict[str, int]]:
        """The degrees of freedom between links that are near each other, in both orders; all other pairs have more."""
        found: dict[str, dict[str, int]] = {}
        for (a, b), degrees in self.robot.tree.degrees_nearby(self.robot.coupling).items():
            found.setdefault(a, {})[b] = degrees
            found.setdefault(b, {})[a] = degrees
        return found

    @cached_property
    def _parts(self) -> dict[str, int]:
        """The part of the tree that contains each link; the tree is divided at free joints."""
        found: dict[str, int] = {}
        for link, joint, _ in self.robot.tree.walk():
            is_cut = joint is None or joint.type in ("floating", "planar")
            found[link.name] = len(found) if joint is None or is_cut else found[joint.parent]
        return found

    def pairs(self, marks_a: Sequence[Mark], marks_b: Sequence[Mark]) -> list[list[Pair | float]]:
        """Return a `Pair` for each pair of marks that may meet, else how far apart it is proven to stay [m]."""
        new = [a for a in marks_a if any((a, b) not in self._pairs for b in marks_b)]
        if new:
            links = Links(self.robot, new[0].link, marks_b[0].link, self.Q, self._poses)
            self._pairs.update(links.judged(new, marks_b))
        return [[self._pairs[a, b] for b in marks_b] for a in marks_a]

    def gaps(self, pair: Pair) -> Array:
        """Return the gaps (N,) of two marks that have ends [m]; they are not above 0 where the marks overlap."""
        radii = pair.a.shape.radius + pair.b.shape.radius
        return self._poses.distances(pair.a, pair.b, np.arange(len(self.Q))) - radii

    def at_home(self, pair: Pair) -> float:
        """Return the signed distance of two marks in contact at home [m]: if they overlap, minus the depth."""
        robot = self.robot
        path = relative_path(robot.tree, robot.coupling, pair.a, pair.b)
        radii = pair.a.shape.radius + pair.b.shape.radius
        return float(depth.signed_distances(path, radii, self.Q[:1])[0])


def moving_pairs(
    judge: Judge, marks: Sequence[Mark], left_out: dict[tuple[str, str, str], int]
) -> tuple[list[Pair], Spare]:
    """Return the pairs that may meet, and the bounds of those that never do; count the other pairs by reason.

    Pairs of links are judged first by balls about all of their marks (`broad`), which is cheap for each pair.
    """
    by_link: dict[str, list[Mark]] = {}
    for mark in marks:
        by_link.setdefault(mark.link, []).append(mark)
    if not by_link:
        return [], Spare({}, {}, None)
    radii = np.array([min(mark.shape.radius for mark in own) for own in by_link.values()])
    more = np.maximum(0.0, judge.robot.annotations.contact_tolerance - radii[:, None] - radii)  # beyond the radii
    is_exact = not any(closure.deviations for closure in judge.robot.closures)
    gaps = least_gaps(judge.robot.tree, by_link) - more if is_exact else None
    place = {mark: place for place, mark in enumerate(marks)}
    pairs: list[Pair] = []
    spare: dict[tuple[str, str], float] = {}
    row, of_row = list[float](), -1  # numbers of one link at a time: for thousands of links all would be gigabytes
    for (i, a), (j, b) in combinations(enumerate(by_link), 2):
        ones, others = by_link[a], by_link[b]
        if gaps is not None and of_row != i:
            row, of_row = gaps[i].tolist(), i
        reason = judge.links_reason(a, b)
        if reason is not None:
            left_out[a, b, reason] = len(ones) * len(others)
            continue
        if gaps is not None and row[j] > 0.0:
            left_out[a, b, NEVER] = len(ones) * len(others)
            continue
        judged = [one for row in judge.pairs(ones, others) for one in row]
        pairs += [one for one in judged if isinstance(one, Pair)]
        apart = [one for one in judged if not isinstance(one, Pair)]
        if apart:
            left_out[a, b, NEVER] = len(apart)
            spare[a, b] = min(apart)
    pairs.sort(key=lambda pair: (place[pair.a], place[pair.b]))
    return pairs, Spare(spare, {link: i for i, link in enumerate(by_link)}, gaps)


def count_uncovered(
    judge: Judge, bodies: Sequence[Body], uncovered: Sequence[Body], left_out: dict[tuple[str, str, str], int]
) -> None:
    """Count the pairs of bodies that have no boundary because one of the two is not covered."""
    of_link: dict[str, list[Body]] = {}
    for body in bodies:
        of_link.setdefault(body.link, []).append(body)
    if not uncovered:
        return
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
        key = link_a, link_b, reason
        left_out[key] = left_out.get(key, 0) + pairs


def listed(words: Sequence[str]) -> str:
    """Return the first few words, and the number of the others."""
    more = f" and {len(words) - _NAMED} more" if len(words) > _NAMED else ""
    return ", ".join(words[:_NAMED]) + more
