"""Covers of meshes: a mark around each of several pieces of the surface.

The part that sticks out furthest is cut in two by a plane, until none sticks out too far. That is a proposal. What is
proven is that each triangle lies in marks (`mesh_proof`), and how far their outer surface is from it (`excess`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pinbound.annotations import Mark
from pinbound.coverage.excess import UNKNOWN, Excess, excess_of, guess_of
from pinbound.coverage.mesh_proof import NONE, MeshProof, away_from, prove
from pinbound.coverage.near import Near
from pinbound.coverage.parts import FITS, Fit, outline
from pinbound.coverage.planes import best_cut
from pinbound.coverage.solids import Group, group_of
from pinbound.coverage.surfaces import Surface, surface_of
from pinbound.exceptions import UnsupportedError
from pinbound.meshes import Mesh
from pinbound.tolerances import FEELER
from pinbound.values import Value

__all__ = ["MeshCover", "cover_meshes"]

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

_SIMPLER = 0.1  # of the accuracy: what vertices that are left out may cost, and pockets that count as filled
_FINER = 0.01  # of the accuracy: what vertices that are left out may cost where parts lie beside each other
_ATTEMPTS = 6


@dataclass(frozen=True, eq=False)
class MeshCover(Value):
    """Marks whose union holds a mesh.

    Attributes:
        marks: The marks.
        proof: For each triangle the mark that holds it.
        excess: [m]: no place of the outer surface of the marks is further than this from the mesh.
    """

    marks: tuple[Mark, ...]
    proof: MeshProof
    excess: float


@dataclass(eq=False)
class _Work:
    """One mesh while its cover is made: its surface in groups, and a mark, a surface and an excess for each group."""

    name: str
    link: str
    mesh: Mesh
    fit: Fit
    accuracy: float
    near: Near = field(init=False)
    groups: list[Group] = field(default_factory=list[Group])
    marks: list[Mark] = field(default_factory=list[Mark])
    surfaces: list[Surface] = field(default_factory=list[Surface])
    excess: list[Excess] = field(default_factory=list[Excess])
    guessed: list[bool] = field(default_factory=list[bool])
    around: float = 0.0
    stuck: bool = False

    def __post_init__(self) -> None:
        self.near = Near(self.mesh)
        self._add(group_of(self.mesh), alone=True)
        self._guess(range(1))

    def _add(self, group: Group, alone: bool = False) -> None:
        mark = FITS[self.fit](self.name, self.link, _points(group.triangles), _SIMPLER * self.accuracy)
        self.groups.append(group)
        self.marks.append(mark)
        self.surfaces.append(self._surface(mark, group, alone))
        self.excess.append(UNKNOWN)
        self.guessed.append(True)

    def _surface(self, mark: Mark, group: Group, alone: bool) -> Surface:
        """Return the surface of a part, which holds its mark.

        Beside other parts it has more vertices than the mark: what is between two parts is known to be inside them only
        if the gap between their hulls is narrower than the ball about all parts.
        """
        vertices, radius = outline(mark)
        if not alone and self.fit == "hulls" and radius > 0.0:
            fine = FITS["hulls"](self.name, self.link, _points(group.triangles), _FINER * self.accuracy).shape
            vertices, radius = fine.vertices, radius + fine.radius
        return surface_of(vertices, radius)

    def _place(self) -> None:
        """Set how wide the ball is about all parts; if it changes, nothing is known of any part."""
        around = max(one.radius + one.slack for one in self.surfaces)
        if len(self.surfaces) > 1:
            around = max(around + FEELER, _SIMPLER * self.accuracy)
        if around != self.around:
            self.around, self.guessed = around, [True] * len(self.surfaces)

    def _guess(self, asked: Sequence[int]) -> None:
        """Look how far some parts stick out, which proves nothing: it says where to cut."""
        self._place()
        for part in asked:
            self.excess[part] = guess_of(self.surfaces, part, self.near, self.around)
            self.guessed[part] = True

    def measure(self) -> None:
        """Bound the excess of all parts of which there is a guess only."""
        self._place()
        asked = [part for part, is_guess in enumerate(self.guessed) if is_guess]
        for part, one in zip(
            asked, excess_of(self.surfaces, self.near, self.around, self.accuracy, asked), strict=True
        ):
            self.excess[part], self.guessed[part] = one, False

    @property
    def worst(self) -> int:
        """The part that sticks out furthest."""
        return int(np.argmax([one.bound for one in self.excess]))

    @property
    def bound(self) -> float:
        return max(one.bound for one in self.excess)

    @property
    def can_be_cut(self) -> bool:
        return self.bound > self.accuracy and not self.stuck

    def cut(self) -> None:
        """Cut the part that sticks out furthest, by the plane that leaves the best hulls."""
        place = self.worst
        old = self.surfaces[place]
        sides = best_cut(self.groups[place], self.excess[place].place, self.accuracy, self.near)
        if sides is None:
            self.stuck = True
            return
        del self.groups[place], self.marks[place], self.surfaces[place], self.excess[place], self.guessed[place]
        for side in sides:
            self._add(side)
        last = len(self.groups)
        touched = [i for i in range(last - 2) if _meet(self.surfaces[i], old)]
        self._guess([*touched, last - 2, last - 1])

    def finished(self) -> MeshCover:
        """Return the marks under their names, proven; parts take in what they were not proven to hold."""
        several = len(self.marks) > 1
        names = [f"{self.name}.{place}" if several else self.name for place in range(len(self.marks))]
        left = 0
        for _ in range(_ATTEMPTS):
            marks = [_named(mark, name) for mark, name in zip(self.marks, names, strict=True)]
            proof = prove(self.mesh, marks)
            if proof.is_complete:
                self.measure()
                return MeshCover(tuple(marks), proof, self.bound)
            left = len(proof.part_of) - proof.held
            self._take_in(np.flatnonzero(proof.part_of == NONE))
        raise UnsupportedError(
            f"{self.mesh.source}: {left} triangles are not proven to lie in a mark; "
            "their numbers are too large for float64: give the mesh in metres"
        )

    def _take_in(self, rows: Ints) -> None:
        """Add triangles to the parts that they are nearest to as a whole."""
        polygons = np.isin(self.mesh.polygons, self.mesh.polygons[rows])
        triangles = self.mesh.vertices[self.mesh.triangles[polygons]]
        away: list[Array] = [
            away_from(mark.shape, triangles.reshape(-1, 3)).reshape(-1, 3).max(axis=1) for mark in self.marks
        ]
        nearest = np.argmin(away, axis=0)
        for place in range(len(self.marks)):
            if not np.any(nearest == place):
                continue
            more = triangles[nearest == place]
            old = self.groups[place]
            group = Group(
                np.concatenate((old.triangles, more)),
                np.concatenate((old.solids, np.repeat(old.solids[:1], len(more)))),
                old.hollows,
            )
            mark = FITS[self.fit](self.name, self.link, _points(group.triangles), 0.0)
            self.groups[place], self.guessed = group, [True] * len(self.marks)
            self.marks[place], self.surfaces[place] = mark, self._surface(mark, group, len(self.marks) == 1)


def cover_meshes(
    named: Sequence[tuple[str, str, Mesh]], accuracy: float, fit: Fit = "hulls", most: int = 16
) -> tuple[MeshCover, ...]:
    """Return covers of the meshes of one link, in the link's frame.

    Args:
        named: For each mesh a name for its marks, the link, and the mesh.
        accuracy: [m], the excess to aim at.
        fit: What marks are made.
        most: Marks that they may have together; each mesh has one at least.

    Raises:
        UnsupportedError: If rounding hides whether a triangle is held, which takes vertices many kilometres away.
    """
    works = [_Work(name, link, mesh, fit, accuracy) for name, link, mesh in named]
    while sum(len(one.marks) for one in works) < most:
        if not any(one.can_be_cut for one in works):
            for one in works:  # what was a guess may be more
                one.measure()
        open_ones = [one for one in works if one.can_be_cut]
        if not open_ones:
            break
        max(open_ones, key=lambda one: one.bound).cut()
    return tuple(one.finished() for one in works)


def _named(mark: Mark, name: str) -> Mark:
    known: Any = mark
    named: Mark = replace(known, name=name)
    return named


def _meet(one: Surface, two: Surface) -> bool:
    return bool(np.all((one.low <= two.high) & (two.low <= one.high)))


def _points(group: Array) -> Array:
    return np.unique(group.reshape(-1, 3), axis=0)
