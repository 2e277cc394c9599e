"""Checks the `disable_collisions` of an SRDF: which of its pairs can never meet, and which can touch.

A pair that a file disables is not assumed to be safe. Either it is proven never to meet, or a search looks for a
configuration at which its bodies touch: among samples, and from the nearest samples by random steps that bring the
covers closer. Covers may stick out of their bodies, so contact of covers is not yet contact of bodies: the function
`touches` checks the bodies.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pinbound.annotations import Mark
from pinbound.annotations.records import LeftOutMark
from pinbound.annotations.srdf import read_disabled
from pinbound.coverage.bodies import collision_bodies
from pinbound.coverage.covers import Cover
from pinbound.evaluate import depth, separation
from pinbound.exceptions import InputError
from pinbound.marking.judge import FREE_JOINT, NEVER, RIGID, Basis, Judge
from pinbound.marking.narrow import Pair
from pinbound.model.document import parse_file
from pinbound.path.relative import RelativePath, relative_path
from pinbound.robot.robot import Robot
from pinbound.typing import Array, Flags
from pinbound.values import Value

__all__ = ["CAN_TOUCH", "NOT_SEEN", "DisabledPair", "disabled_pairs", "find_srdf", "stated_pairs"]

Touches = Callable[[tuple[str, str], Array], int | None]

CAN_TOUCH = "can touch"
NOT_SEEN = "no contact found"
COVERS_TOUCH = "their marks can touch; no contact of their bodies was found"

_STARTS, _STEPS, _WIDTH = 4, 20, 32  # of the random search: number of start samples, steps, and tries in each step
_FIRST, _LAST = 0.3, 0.003  # of the limits' width: the first and the last step of the search
_MOST = 200  # configurations at which the bodies of one pair are tested


@dataclass(frozen=True, eq=False)
class DisabledPair(Value):
    """Two links whose collisions a file disables, and the result of the check.

    Attributes:
        links: The two links.
        reason: The file's reason.
        source: The file.
        line: Its line; None if it is not known.
        verdict: ``"can touch"``, ``"can never meet"``, ``"never move against each other"``, ``"no contact found"``, or
            why there is no result.
        basis: The basis of the verdict, as in `Evidence`.
        text: The number or the sentence that supports it.
        q: (n,) a configuration at which they touch; None if none was found.
    """

    links: tuple[str, str]
    reason: str
    source: str
    line: int | None
    verdict: str
    basis: Basis
    text: str
    q: Array | None = None


def find_srdf(robot: Robot) -> tuple[Path, ...]:
    """Return the SRDFs of this robot beside its file, or in `srdf/` beside its folder.

    An SRDF with the same stem as the file is returned alone; otherwise all are returned.
    """
    path = robot.document.path
    if not path.is_file():
        return ()
    folders = (path.resolve().parent, path.resolve().parent.parent / "srdf")
    files = [file for folder in folders if folder.is_dir() for file in sorted(folder.glob("*.srdf"))]
    named = [file for file in files if _names(file, robot.name)]
    same = [file for file in named if file.stem == path.name.partition(".")[0]]
    return tuple(same[:1] or named)


def _names(path: Path, robot: str) -> bool:
    try:
        return parse_file(path).get("name") == robot
    except InputError:  # this file was not requested, and is not XML
        return False


def stated_pairs(robot: Robot, srdf: Path | None = None) -> tuple[LeftOutMark, ...]:
    """Return the pairs of links that SRDFs among the annotations and one more file disable, each pair once.

    Raises:
        InputError: If the file cannot be read, or is no XML.
    """
    stated = [one for one in robot.annotations.left_out if one.source.endswith(".srdf")]
    if srdf is not None:
        stated += read_disabled(srdf, dict.fromkeys(body.link for body in collision_bodies(robot)))
    first: dict[frozenset[str], LeftOutMark] = {}
    for one in stated:
        first.setdefault(frozenset((one.a, one.b)), one)
    return tuple(first.values())


def disabled_pairs(
    robot: Robot,
    covers: Sequence[Cover],
    srdf: Path | None = None,
    touches: Touches | None = None,
    judge: Judge | None = None,
) -> tuple[DisabledPair, ...]:
    """Return the result for every pair of links that an SRDF disables.

    Args:
        robot: The robot; pairs that an SRDF among its annotations disables are checked, too.
        covers: Marks over its bodies, as in a `Proposal`.
        srdf: An SRDF; None: only the annotations.
        touches: Returns the first row of Q (k, n) at which bodies of two links touch, or None. Without it, only covers
            that do not stick out stand for their bodies.
        judge: The judge of the proposal with these covers, which knows most pairs of marks; None: all pairs are judged
            again.

    Raises:
        InputError: If the file cannot be read, or is not XML.
        UnsupportedError: If no configuration keeps all joint limits.
    """
    stated = stated_pairs(robot, srdf)
    if not stated:
        return ()
    finder = _Finder(robot, covers, touches, judge or Judge(robot))
    found: list[DisabledPair] = []
    for one in stated:
        verdict, basis, text, q = finder.judge(one.a, one.b)
        found.append(DisabledPair((one.a, one.b), one.reason, one.source, one.line, verdict, basis, text, q))
    return tuple(found)


Found = tuple[str, Basis, str, Array | None]


class _Finder:
    """Examines pairs of links, one by one."""

    def __init__(self, robot: Robot, covers: Sequence[Cover], touches: Touches | None, judge: Judge) -> None:
        self.robot, self.touches, self.judge_of = robot, touches, judge
        self.marks: dict[str, list[Mark]] = {}
        self.excess: dict[str, float] = {}
        held = {body.name for cover in covers for body in cover.bodies}
        for cover in covers:
            self.marks.setdefault(cover.link, []).extend(cover.marks)
            self.excess[cover.link] = max(cover.excess, self.excess.get(cover.link, 0.0))
        bodies = collision_bodies(robot)
        self.with_bodies = {body.link for body in bodies}
        self.bare = {body.link for body in bodies if body.name not in held}
        self.rng = np.random.default_rng(0)

    def judge(self, a: str, b: str) -> Found:
        robot = self.robot
        for link in (a, b):
            if link not in robot.tree.links:
                return f"{link!r} is not a link", "granted", "the robot does not have it", None
        for link in (a, b):
            if link not in self.with_bodies:
                return f"{link} has no body", "proof", "no body could touch", None
        why = self.judge_of.links_reason(a, b)
        if why == RIGID:
            return RIGID, "proof", "no degree of freedom lies between them", None
        if why == FREE_JOINT:
            return FREE_JOINT, "granted", "no boundary is possible over a free joint", None
        if {a, b} & self.bare:
            bare = " and ".join(sorted({a, b} & self.bare))
            return "not judged", "granted", f"{bare}: a body is held by no mark", None
        return self._moving(a, b)

    def _moving(self, a: str, b: str) -> Found:
        judged = [one for row in self.judge_of.pairs(self.marks[a], self.marks[b]) for one in row]
        near = [pair for pair in judged if isinstance(pair, Pair)]
        if not near:
            least = min(pair for pair in judged if not isinstance(pair, Pair))
            return NEVER, "proof", f"they stay more than {1e3 * least:.4g} mm apart, for all q", None
        Q = self.judge_of.Q
        touching = np.any([pair.contact for pair in near], axis=0)
        rows = Q[touching]
        if not len(rows):
            rows = self._approach(near)
        tried = f"{len(Q)} samples and {_STARTS * _STEPS * _WIDTH} steps of a search"
        if not len(rows):
            return NOT_SEEN, "samples", f"in {tried}; not proven", None
        excess = self.excess[a] + self.excess[b]
        if self.touches is not None:
            row = self.touches((a, b), rows[:_MOST])
            if row is not None:
                return CAN_TOUCH, "witness", f"bodies touch{_share(touching)}", rows[row]
        elif excess == 0.0:
            return CAN_TOUCH, "witness", f"{self._overlap(near, rows[0])}{_share(touching)}", rows[0]
        sticks = f"{self._overlap(near, rows[0])}, marks stick out by {1e3 * excess:.4g} mm together"
        return COVERS_TOUCH, "samples", f"{sticks}; {tried}", rows[0]

    def _overlap(self, pairs: Sequence[Pair], q: Array) -> str:
        """Return by how much the marks overlap at q, as text."""
        deepest = min(
            float(depth.signed_distances(self._path(pair), pair.a.shape.radius + pair.b.shape.radius, q[None])[0])
            for pair in pairs
        )
        return f"marks overlap by {-1e3 * deepest:.4g} mm"

    def _path(self, pair: Pair) -> RelativePath:
        return relative_path(self.robot.tree, self.robot.coupling, pair.a, pair.b)

    def _approach(self, pairs: Sequence[Pair]) -> Array:
        """Return configurations (k, n) within all limits at which two marks touch, found by random steps."""
        robot, Q = self.robot, self.judge_of.Q
        gaps = np.array([self.judge_of.gaps(pair) for pair in pairs])
        best = int(np.argmin(gaps.min(axis=1)))
        path, radii = self._path(pairs[best]), pairs[best].a.shape.radius + pairs[best].b.shape.radius
        width = np.ptp(Q, axis=0)
        starts = np.argsort(gaps[best])[:_STARTS]
        places, values = Q[starts].copy(), gaps[best, starts].copy()
        for step in np.geomspace(_FIRST, _LAST, _STEPS):  # all starts at once: few calls for many rows
            tries = places[:, None] + step * width * self.rng.normal(size=(len(starts), _WIDTH, Q.shape[1]))
            owner = np.repeat(np.arange(len(starts)), _WIDTH)
            tries = tries.reshape(-1, Q.shape[1])
            kept = robot.intervals.hold(tries)
            tries, owner = tries[kept], owner[kept]
            if not len(tries):
                continue
            found = separation.separations(path, tries) - radii
            if found.min() <= 0.0:
                return tries[found <= 0.0]
            for row in np.argsort(-found).tolist():  # the nearest of each start comes last
                if found[row] < values[owner[row]]:
                    places[owner[row]], values[owner[row]] = tries[row], found[row]
        return np.empty((0, Q.shape[1]))


def _share(touching: Flags) -> str:
    count = int(np.sum(touching))
    if count == len(touching):
        return f"; marks touch in all {count} samples"
    return f"; marks touch in {count} of {len(touching)} samples" if count else "; found by a search"
