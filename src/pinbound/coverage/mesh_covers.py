"""Covers of meshes: a mark around each of several pieces of the surface.

The part that sticks out furthest is cut in two by a plane, until no part sticks out too far. This proposes the marks.
`mesh_proof` proves that each triangle lies in marks, and `excess` bounds how far their outer surface is from the mesh.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pinbound.annotations import Mark
from pinbound.coverage.mesh_proof import NONE, MeshProof, prove, unheld
from pinbound.coverage.partition import Partition
from pinbound.coverage.parts import Fit
from pinbound.exceptions import UnsupportedError
from pinbound.meshes import Mesh
from pinbound.values import Value

__all__ = ["MeshCover", "cover_meshes"]

_ATTEMPTS, _IN_PIECES = 8, 5  # attempts to hold all triangles; of them with pieces, before whole triangles
_MORE = 32  # additional parts (or as many again as allowed, if fewer) that are cut before parts are joined
_RECUTS = 4  # cuts in a row after joining that may leave the largest excess as it is: sections of sections explode
_HARDLY, _PATIENCE = 0.98, 3  # cutting ends after this many cuts in a row that leave more than this share of the excess


@dataclass(frozen=True, eq=False)
class MeshCover(Value):
    """Marks whose union holds a mesh.

    Attributes:
        marks: The marks.
        proof: For each triangle the mark that holds it.
        excess: [m]: no point of the outer surface of the marks is further from the mesh.
    """

    marks: tuple[Mark, ...]
    proof: MeshProof
    excess: float


def cover_meshes(
    named: Sequence[tuple[str, str, Mesh]], accuracy: float, fit: Fit = "hulls", most: int = 16
) -> tuple[MeshCover, ...]:
    """Return covers of the meshes of one link, in the link's frame.

    Args:
        named: For each mesh a name for its marks, the link, and the mesh.
        accuracy: [m], the excess to aim at.
        fit: The kind of the marks.
        most: The largest number of their marks together; each mesh has at least one.

    Raises:
        UnsupportedError: If rounding hides whether a triangle is held. This needs vertices many kilometres away.
    """
    works = [Partition(name, link, mesh, fit, accuracy) for name, link, mesh in named]
    _cut(works, most)
    _improve(works, accuracy, most)
    return tuple(_finished(one) for one in works)


def _count(works: Sequence[Partition]) -> int:
    return sum(len(one.parts) for one in works)


def _cut(works: Sequence[Partition], most: int, patience: float = math.inf) -> None:
    """Cut the part that sticks out furthest, until no part sticks out too far, or `most` parts exist.

    After `patience` cuts in a row that hardly reduced the largest excess it stops.
    """
    vain = 0
    while _count(works) < most and vain < patience:
        if not any(one.can_be_cut for one in works):
            for one in works:  # a bound may be larger than the estimate
                one.measure()
        open_ones = [one for one in works if one.can_be_cut]
        if not open_ones:
            break
        before = max(one.bound for one in works)
        max(open_ones, key=lambda one: one.bound).cut()
        vain = vain + 1 if max(one.bound for one in works) > _HARDLY * before else 0


def _improve(works: Sequence[Partition], accuracy: float, most: int) -> None:
    """Join parts again; if they stick out too far, cut beyond `most` first. Keep the result only if it is better."""
    if _count(works) == len(works):
        return
    for one in works:
        one.measure()
    old, worth = [one.parts for one in works], _worth(works, accuracy)
    if worth[0] > accuracy:
        _cut_on(works, most + min(most, _MORE))
        while _count(works) > most and _join_best(works, np.inf):
            pass
    while _join_best(works, accuracy):
        pass
    _cut(works, sum(map(len, old)) if worth[0] <= accuracy else most, _RECUTS)  # a bound may exceed the accuracy
    for one in works:
        one.measure()
    if _worth(works, accuracy) >= worth:
        for one, parts in zip(works, old, strict=True):
            one.restore(parts)


def _cut_on(works: Sequence[Partition], most: int) -> None:
    """Cut further while it helps: stop when the last cuts hardly reduced the excess of the parts that they cut."""
    vain = 0
    while _count(works) < most and vain < _PATIENCE and any(one.can_be_cut for one in works):
        work = max((one for one in works if one.can_be_cut), key=lambda one: one.bound)
        before = work.bound
        work.cut()
        vain = vain + 1 if max(one.excess.bound for one in work.parts[-2:]) > _HARDLY * before else 0


def _worth(works: Sequence[Partition], accuracy: float) -> tuple[float, int]:
    """Return the measure of a cover: its excess, if it is above the accuracy, and then its number of parts."""
    return max(accuracy, *(one.bound for one in works)), _count(works)


def _join_best(works: Sequence[Partition], limit: float) -> bool:
    """Join the pair of parts of one mesh with the smallest joined excess; return False if all exceed a limit [m]."""
    found = [(joint.excess, place, joint) for place, one in enumerate(works) for joint in one.joints(limit)]
    for _, place, joint in sorted(found, key=lambda one: one[:2]):
        if works[place].join(joint, limit):
            return True
    return False


def _finished(work: Partition) -> MeshCover:
    """Return the named marks with their proof; parts take in the pieces that they were not proven to hold."""
    several = len(work.parts) > 1
    names = [f"{work.name}.{place}" if several else work.name for place in range(len(work.parts))]
    left = 0
    for attempt in range(_ATTEMPTS):
        marks = [_named(one.mark, name) for one, name in zip(work.parts, names, strict=True)]
        proof = prove(work.mesh, marks)
        if proof.is_complete:
            work.measure()
            return MeshCover(tuple(marks), proof, work.bound)
        left = len(proof.part_of) - proof.held
        missing = unheld(work.mesh, marks, np.flatnonzero(proof.part_of == NONE))
        if attempt < _IN_PIECES:
            work.take_in([piece for pieces in missing.values() for piece in pieces])
        else:
            work.take_in([*work.mesh.vertices[work.mesh.triangles[[*missing]]]])
    raise UnsupportedError(
        f"{work.mesh.source}: {left} triangles are not proven to lie in a mark; "
        "their numbers are too large for float64: give the mesh in metres"
    )


def _named(mark: Mark, name: str) -> Mark:
    known: Any = mark
    named: Mark = replace(known, name=name)
    return named
