"""Coverage of a robot, pair by pair, from its bodies, marks, boundaries, and the statements of files."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property
from itertools import combinations, product

import numpy as np

from pinbound.annotations import Annotations, LeftOutMark, Mark
from pinbound.boundaries.boundary import Boundary
from pinbound.coverage.bodies import Body
from pinbound.coverage.body_meshes import MeshSource
from pinbound.coverage.holding import holders, is_known
from pinbound.coverage.poses import Poses
from pinbound.coverage.reach import MOST_PATHS, Reach
from pinbound.coverage.records import (
    Basis,
    BodyCoverage,
    CoverageRecord,
    LinkCoverage,
    PairCoverage,
    Status,
    hollow_note,
    record_of,
)
from pinbound.exceptions import UnknownNameError
from pinbound.loops.closures import Closure, joint_errors
from pinbound.model.coupling import Coupling
from pinbound.model.tree import MANY_DEGREES, Tree
from pinbound.tolerances import SAME_BODY
from pinbound.typing import Flags
from pinbound.values import FrozenDict

__all__ = ["Coverage"]

_FINE = 0.05
"""How far the prism that replaces a cylinder in a proof may stick out, as a share of the body's smallest size."""
_FEW = 2
"""The largest number of coordinates between two links that may reduce to one angle; then balls give the best proof."""


class Coverage:
    """Which pairs of links the boundaries of a robot watch, and which they do not.

    Everything is computed when it is first asked for. It is proven that a mark holds a body, that two links never move
    relative to each other, that one degree of freedom lies between two links, and that two bodies can never meet. A
    reason that a file states is not proven; it is listed with the name of the file.

    Example:
        >>> import pinbound as pb
        >>> coverage = pb.load("minervabot_v3").coverage
        >>> coverage.is_complete, len(coverage.watched), len(coverage.links["link_27"].bodies)
        (False, 0, 2)
    """

    def __init__(
        self,
        tree: Tree,
        coupling: Coupling,
        annotations: Annotations,
        bodies: Sequence[Body],
        boundaries: Iterable[Boundary],
        closures: Sequence[Closure] = (),
        meshes: MeshSource | None = None,
    ) -> None:
        """Take the parts of a robot: `bodies` are those of all links, `meshes` reads those that are meshes."""
        self._survey = _Survey(tree, coupling, annotations, bodies, closures, meshes)
        self._boundaries = tuple(boundaries)
        self._parts: dict[frozenset[str], Coverage] = {}

    def __repr__(self) -> str:
        """Return the summary line."""
        return f"<Coverage: {self.summary}>"

    def of(self, names: Iterable[str]) -> Coverage:
        """Return the coverage of some boundaries only.

        Raises:
            UnknownNameError: If there is no boundary of that name.
        """
        wanted = frozenset(names)
        known = [boundary.name for boundary in self._boundaries]
        for name in sorted(wanted - set(known)):
            raise UnknownNameError("boundary", name, known)
        if len(wanted) == len(known):
            return self
        if wanted not in self._parts:
            part = object.__new__(Coverage)
            part._survey, part._parts = self._survey, {}
            part._boundaries = tuple(boundary for boundary in self._boundaries if boundary.name in wanted)
            self._parts[wanted] = part
        return self._parts[wanted]

    @cached_property
    def links(self) -> FrozenDict[str, LinkCoverage]:
        """All links by name, with their bodies, the marks that hold them, and reasons for bodies that are not held."""
        return FrozenDict(self._survey.links)

    @property
    def bodies(self) -> tuple[BodyCoverage, ...]:
        """All bodies, ordered by link."""
        return tuple(body for link in self._survey.links.values() for body in link.bodies)

    @cached_property
    def pairs(self) -> tuple[PairCoverage, ...]:
        """Every pair of links that both have bodies."""
        between: dict[frozenset[str], list[Boundary]] = {}
        for boundary in self._boundaries:
            between.setdefault(frozenset((boundary.point_a.link, boundary.point_b.link)), []).append(boundary)
        with_bodies = [link.name for link in self._survey.links.values() if link.bodies]
        return tuple(
            self._survey.pair(a, b, between.get(frozenset((a, b)), [])) for a, b in combinations(with_bodies, 2)
        )

    @property
    def watched(self) -> tuple[PairCoverage, ...]:
        """Pairs of links for which every pair of bodies is watched."""
        return self._of_status(Status.WATCHED)

    @property
    def in_part(self) -> tuple[PairCoverage, ...]:
        """Pairs of links with boundaries that do not watch every pair of bodies."""
        return self._of_status(Status.IN_PART)

    @property
    def left_out(self) -> tuple[PairCoverage, ...]:
        """Pairs of links that are left out for a reason, which is proven or stated by a file."""
        return self._of_status(Status.LEFT_OUT)

    @property
    def unwatched(self) -> tuple[PairCoverage, ...]:
        """Pairs of links without boundaries and without a reason."""
        return self._of_status(Status.UNWATCHED)

    def _of_status(self, status: Status) -> tuple[PairCoverage, ...]:
        return tuple(pair for pair in self.pairs if pair.status is status)

    @property
    def open(self) -> tuple[PairCoverage, ...]:
        """Pairs that are not or only partly watched, without a reason: their bodies may touch unnoticed."""
        return tuple(pair for pair in self.pairs if pair.is_open)

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes about links in files that the robot does not have, and about meshes that several marks hold."""
        return self._survey.notes

    @cached_property
    def record(self) -> CoverageRecord:
        """The numbers and the summary, as certificates record them."""
        return record_of(tuple(self._survey.links.values()), self.pairs, len(self._boundaries))

    @property
    def is_complete(self) -> bool:
        """Whether there are bodies, and every pair of links is watched or left out for a reason."""
        return self.record.is_complete

    @property
    def summary(self) -> str:
        """The line that every verdict shows."""
        return self.record.summary


class _Survey:
    """The part of coverage that does not depend on the boundaries: bodies, their marks, links that can meet."""

    def __init__(
        self,
        tree: Tree,
        coupling: Coupling,
        annotations: Annotations,
        bodies: Sequence[Body],
        closures: Sequence[Closure],
        meshes: MeshSource | None,
    ) -> None:
        self.meshes = meshes
        errors = joint_errors(coupling, closures)
        self.loose = {name for name, error in zip(coupling.joints, errors.tolist(), strict=True) if error}
        self.tree, self.coupling, self.annotations, self.all_bodies = tree, coupling, annotations, tuple(bodies)
        self.reaches: dict[tuple[str, str], Reach] = {}
        self.bases: dict[tuple[str, str], tuple[Basis | None, str]] = {}
        self.apart: dict[tuple[str, str], Flags] = {}

    @cached_property
    def bodies(self) -> dict[str, list[Body]]:
        found: dict[str, list[Body]] = {name: [] for name in self.tree.links}
        for body in self.all_bodies:
            found[body.link].append(body)
        return found

    @cached_property
    def marks(self) -> dict[str, list[Mark]]:
        found: dict[str, list[Mark]] = {name: [] for name in self.tree.links}
        for mark in self.annotations.marks.values():
            found[mark.link].append(mark)
        return found

    @cached_property
    def links(self) -> dict[str, LinkCoverage]:
        return {
            name: LinkCoverage(
                name,
                tuple(_body_coverage(body, self.marks[name], self.meshes) for body in self.bodies[name]),
                tuple(mark.name for mark in self.marks[name]),
            )
            for name in self.tree.links
        }

    @cached_property
    def said(self) -> dict[frozenset[str], list[LeftOutMark]]:
        found: dict[frozenset[str], list[LeftOutMark]] = {}
        for mark in self.annotations.left_out:
            found.setdefault(frozenset((mark.a, mark.b)), []).append(mark)
        return found

    @property
    def notes(self) -> tuple[str, ...]:
        absent = {
            (mark.source, name)
            for mark in self.annotations.left_out
            for name in (mark.a, mark.b)
            if name not in self.tree.links
        }
        said = [f"{source} leaves out pairs of {name!r}, which is not a link" for source, name in sorted(absent)]
        hollow = [
            body.link
            for link in self.links.values()
            for body in link.bodies
            if body.shape == "mesh" and body.held_by and min(map(len, body.held_by)) > 1
        ]
        return (*said, *filter(None, [hollow_note(hollow)]))

    def pair(self, a: str, b: str, boundaries: Sequence[Boundary]) -> PairCoverage:
        """Return how the boundaries between two links cover the pair."""
        names = tuple(boundary.name for boundary in boundaries)
        watched = self._watched(a, b, boundaries) if boundaries else 0
        count = len(self.bodies[a]) * len(self.bodies[b])
        if watched == count:
            return PairCoverage((a, b), Status.WATCHED, "", None, names)
        basis, why = self._basis(a, b)
        if basis is Basis.PROOF or (basis is not None and not boundaries):
            return PairCoverage((a, b), Status.LEFT_OUT, why, basis, names)
        if boundaries:
            reason = self._missing(a, b, watched, count) + (f"; the rest: {why}" if why else "")
            return PairCoverage((a, b), Status.IN_PART, reason, basis, names)
        free = "a free joint lies between them, so no boundary is possible" if self._is_free(a, b) else ""
        return PairCoverage((a, b), Status.UNWATCHED, free or "no boundary between them", None, names)

    def _basis(self, a: str, b: str) -> tuple[Basis | None, str]:
        """Return why two links need no boundary, or which file says so."""
        if (a, b) not in self.bases:
            said = self.said.get(frozenset((a, b)), [])
            found = self._proof(a, b)
            if found is None and said:
                found = Basis.SAID, "; ".join(dict.fromkeys(f"said by {one.source}: {one.reason}" for one in said))
            self.bases[a, b] = found or (None, "")
        return self.bases[a, b]

    def _proof(self, a: str, b: str) -> tuple[Basis, str] | None:
        degrees = self.degrees.get(frozenset((a, b)), MANY_DEGREES)
        if degrees == 0 and not self._is_loose(a, b):
            return Basis.PROOF, "never move against each other"
        if self._is_free(a, b):
            return None
        if degrees == 1:
            return Basis.NEIGHBOURS, "neighbours: one degree of freedom between them"
        pin = next((c.name for c in self.annotations.closures if {c.link_a, c.link_b} == {a, b}), None)
        if pin is not None:
            return Basis.NEIGHBOURS, f"neighbours: joined by the pin of closure {pin}"
        one, two = self.shapes[a], self.shapes[b]
        if not one or not two or self._is_loose(a, b):
            return None
        rows = [self.coupling.row(joint.name)[0] for joint in self.tree.path_between(a, b) if joint.moves]
        used = int(np.count_nonzero(np.any(np.array(rows), axis=0)))
        if used > _FEW and self.poses.come_near(a, one, b, two):
            return None  # if marks come this near, no bound of `reach` can prove them apart
        return (Basis.PROOF, "can never meet") if self._reach(a, b).never_meet(one, two) else None

    def _is_loose(self, a: str, b: str) -> bool:
        """Return whether a joint between two links is known only up to the error of a loop: then there is no proof."""
        return bool(self.loose) and any(joint.name in self.loose for joint in self.tree.path_between(a, b))

    def _is_free(self, a: str, b: str) -> bool:
        return any(joint.type in ("floating", "planar") for joint in self.tree.path_between(a, b))

    @cached_property
    def degrees(self) -> dict[frozenset[str], int]:
        """Degrees of freedom between links that are near each other in the tree; all other pairs have at least two."""
        return self.tree.degrees_nearby(self.coupling)

    @cached_property
    def poses(self) -> Poses:
        return Poses(self.tree, self.coupling)

    @cached_property
    def shapes(self) -> dict[str, list[Mark]]:
        """Marks that hold each link's bodies, for proofs; empty if the shape of one body is not supported."""
        from pinbound.coverage.covers import covers

        found: dict[str, list[Mark]] = {}
        for link, bodies in self.bodies.items():
            plain = [body for body in bodies if is_known(body)]
            held = [one.held_by[0] for one in self.links[link].bodies if one.shape == "mesh" and one.is_held]
            found[link] = []
            if len(plain) + len(held) == len(bodies):
                by_name = {mark.name: mark for mark in self.marks[link]}
                found[link] = [by_name[name] for names in held for name in names]
                found[link] += [mark for one in covers(plain, _fine(plain)) for mark in one.marks]
        return found

    def _reach(self, a: str, b: str) -> Reach:
        if (a, b) not in self.reaches:
            self.reaches[a, b] = Reach(self.tree, self.coupling, a, b)
        return self.reaches[a, b]

    def _watched(self, a: str, b: str, boundaries: Sequence[Boundary]) -> int:
        """Return how many pairs of bodies are watched: each pair of their marks is a boundary, or can never meet."""
        at_a = {name: place for place, name in enumerate(self.links[a].marks)}
        at_b = {name: place for place, name in enumerate(self.links[b].marks)}
        settled = self._apart(a, b).copy()
        for boundary in boundaries:
            one, two = boundary.point_a.name, boundary.point_b.name
            one, two = (one, two) if one in at_a else (two, one)
            settled[at_a[one], at_b[two]] = True
        bodies = list(product(self.links[a].bodies, self.links[b].bodies))
        choices = [
            [
                np.ix_([at_a[name] for name in one], [at_b[name] for name in two])
                for one, two in product(body_a.held_by, body_b.held_by)
            ]
            for body_a, body_b in bodies
        ]
        needed = np.zeros_like(settled)
        for chosen in (chosen for options in choices for chosen in options):
            needed[chosen] = True
        left = np.argwhere(needed & ~settled)
        if len(left) <= MOST_PATHS and not self._is_loose(a, b):
            marks_a, marks_b = self.marks[a], self.marks[b]
            for row, column in left.tolist():
                settled[row, column] = self._reach(a, b).never_meet([marks_a[row]], [marks_b[column]])
        return sum(any(bool(np.all(settled[chosen])) for chosen in options) for options in choices)

    def _apart(self, a: str, b: str) -> Flags:
        """Return which marks of two links the chain between them proves apart, (marks of a, marks of b)."""
        if (a, b) not in self.apart:
            nothing = np.zeros((len(self.marks[a]), len(self.marks[b])), dtype=np.bool_)
            proven = not self._is_loose(a, b)
            self.apart[a, b] = self._reach(a, b).apart(self.marks[a], self.marks[b]) if proven else nothing
        return self.apart[a, b]

    def _missing(self, a: str, b: str, watched: int, count: int) -> str:
        words = [
            f"{len(link.bodies) - len(link.held)} of {len(link.bodies)} bodies of {name} are not held "
            f"({', '.join(dict.fromkeys(body.reason for body in link.bodies if not body.is_held))})"
            for name, link in ((name, self.links[name]) for name in (a, b))
            if len(link.held) < len(link.bodies)
        ]
        return "; ".join([f"{watched} of {count} pairs of bodies are watched", *words])


def _body_coverage(body: Body, marks: Sequence[Mark], meshes: MeshSource | None) -> BodyCoverage:
    is_mesh = body.shape == "mesh" and meshes is not None
    fault = meshes.fault(body) if is_mesh and marks and meshes is not None else ""  # no file is read without need
    mesh = meshes.of(body) if is_mesh and marks and not fault and meshes is not None else None
    held = holders(body, marks, mesh)
    reason = ""
    if not held:
        reason = "no mark on its link" if not marks else "not proven to lie in the marks of its link"
        reason = reason if is_mesh or is_known(body) else f"a {body.shape}, which is not read"
        reason = f"a mesh, and {reason}" if is_mesh else reason
        reason = f"a mesh that cannot be read: {fault}" if fault else reason
    return BodyCoverage(body.link, body.index, body.shape, held, reason)


def _fine(bodies: Sequence[Body]) -> float:
    """Return how far the marks that replace bodies in proofs may stick out [m]."""
    return max([_FINE * min(min(body.size) for body in bodies), SAME_BODY]) if bodies else SAME_BODY
