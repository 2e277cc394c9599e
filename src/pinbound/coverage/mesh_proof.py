"""Proofs that marks hold a mesh: for every triangle, a mark in which it lies.

A mark is the set of all points within a radius of a hull, which is convex. So it holds a triangle if it holds its three
corners. It holds a corner if a point of the hull is known that is near enough. A triangle that no single mark holds is
cut into pieces, each held by one mark: a piece is convex, too, so its corners decide. `docs/covers.md`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pinbound.annotations import Mark, Shape
from pinbound.coverage.polytopes import Polytope, split_polygon
from pinbound.evaluate.closest import nearest, nearest_of_hulls
from pinbound.meshes import Mesh
from pinbound.tolerances import HELD
from pinbound.values import Value

__all__ = ["JOINTLY", "NONE", "MeshProof", "away_from", "prove", "unheld"]

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

NONE, JOINTLY = -1, -2
"""A triangle that no marks are proven to hold; one that several hold together."""

_BLOCK = 20_000  # points whose nearest points are searched for at once
_MOST_CUTS = 60  # cuts of one piece of a triangle by the faces of one mark
_MOST_PIECES = 600  # pieces of one triangle
_DOUBTFUL = 1e-9  # metres: for points further outside, no nearer point of the hull is searched for
_SLIVER = 1e-9  # of a polygon's area: a mark that holds less of it is not used
_MOST_JOINTLY = 20_000  # triangles that are cut into pieces; a mesh with more of them is not proven to be held


@dataclass(frozen=True, eq=False)
class MeshProof(Value):
    """Which mark holds which triangle.

    Attributes:
        parts: Names of the marks.
        part_of: (m,), for each triangle the index in `parts` of the mark in which it lies; `JOINTLY` if it lies in
            several marks together; `NONE` if neither is proven.
        jointly: For each triangle that lies in several marks, by its number: the indices of these marks in `parts`.
    """

    parts: tuple[str, ...]
    part_of: Ints
    jointly: Mapping[int, tuple[int, ...]]

    @property
    def held(self) -> int:
        """Number of triangles that marks are proven to hold."""
        return int(np.count_nonzero(self.part_of != NONE))

    @property
    def is_complete(self) -> bool:
        """Whether every triangle is held."""
        return self.held == len(self.part_of)

    @property
    def used(self) -> tuple[str, ...]:
        """The marks that hold a triangle, in their order."""
        places = {*np.unique(self.part_of[self.part_of >= 0]).tolist()}
        return tuple(self.parts[place] for place in sorted(places.union(*self.jointly.values())))


def prove(mesh: Mesh, marks: Sequence[Mark]) -> MeshProof:
    """Return which of the marks holds each triangle of a mesh, both in the frame of one link.

    If one mark holds all corners of a polygon, it holds the polygon, whatever its triangles. Otherwise each triangle is
    tested, and is cut into pieces if necessary. Lines and planes hold nothing.

    Example:
        >>> from pinbound.annotations import Point
        >>> mesh = Mesh(np.eye(3), np.array([[0, 1, 2], [0, 0, 1]]), np.arange(2))
        >>> marks = [Point("small", "arm", (0.5, 0.5, 0.0), 0.71), Point("large", "arm", (0.0, 0.0, 0.0), 1.0)]
        >>> proof = prove(mesh, marks)
        >>> proof.part_of.tolist(), proof.is_complete, prove(mesh, marks[:1]).is_complete
        ([1, 0], True, False)
    """
    holders = [_Holder(mark.shape) for mark in marks]
    inside = np.zeros((len(holders), len(mesh.vertices)), dtype=np.bool_)
    part_of = np.full(len(mesh.triangles), NONE, dtype=np.int64)
    count = int(mesh.polygons.max()) + 1 if len(mesh.polygons) else 0
    for place, holder in enumerate(holders):
        left = part_of == NONE
        if not np.any(left):
            break
        asked = np.unique(mesh.triangles[left])
        inside[place, asked] = holder.holds(mesh.vertices[asked])
        whole = np.ones(count, dtype=np.bool_)
        np.logical_and.at(whole, np.repeat(mesh.polygons, 3), inside[place][mesh.triangles.ravel()])
        part_of[left & whole[mesh.polygons]] = place
    for place in range(len(holders)):
        left = part_of == NONE
        part_of[left & np.all(inside[place][mesh.triangles], axis=1)] = place
    jointly: dict[int, tuple[int, ...]] = {}
    for row in np.flatnonzero(part_of == NONE).tolist():
        if len(holders) < 2 or len(jointly) > _MOST_JOINTLY:
            break
        used = _held_by(mesh.vertices[mesh.triangles[row]], holders)
        if not used:
            break  # one such triangle is enough: the mesh is not held
        jointly[row], part_of[row] = used, JOINTLY
    return MeshProof(tuple(mark.name for mark in marks), part_of, jointly)


class _Holder:
    """A mark that may hold points: its shape, and the polytope that decides most of them."""

    def __init__(self, shape: Shape) -> None:
        self.shape = shape
        self.limit = shape.radius + HELD
        self.can_hold = not shape.is_unbounded
        self.polytope = Polytope.of(shape.vertices) if self.can_hold and len(shape.vertices) > 3 else None
        self.low, self.high = shape.vertices.min(axis=0) - self.limit, shape.vertices.max(axis=0) + self.limit

    def holds(self, points: Array) -> NDArray[np.bool_]:
        """Return which points (N, 3) are within the radius of the hull."""
        found = np.all((points >= self.low) & (points <= self.high), axis=1) & self.can_hold
        rows = np.flatnonzero(found)
        found[rows] = away_from(self.shape, points[rows], self.limit, self.polytope) <= self.limit
        return found

    def cut(self, polygon: Array) -> tuple[Array, list[Array]] | None:
        """Return the piece of a polygon that it holds, and the other pieces; None if no piece is proven to be held.

        The polygon is cut by one face after another, first by those that it exceeds most. These cuts only propose; then
        the corners of the piece inside are proven to be held.
        """
        if np.any(polygon.max(axis=0) < self.low) or np.any(polygon.min(axis=0) > self.high):
            return None
        if self.polytope is None:  # without a polytope, there are no planes to cut by
            return (polygon, []) if np.all(self.holds(polygon)) else None
        rest: list[Array] = []
        doubtful = self.limit + self.polytope.slack + _DOUBTFUL  # the hull may be outside its triangles by the slack
        for _ in range(_MOST_CUTS):
            height = self.polytope.heights(polygon)
            worst = int(np.argmax(height.max(axis=0)))
            if height[:, worst].max() <= doubtful and np.all(self.holds(polygon)):
                return polygon, rest
            kept, gone = split_polygon(polygon, height[:, worst])
            if len(kept) < 3 or len(gone) < 3:
                return None
            rest.append(gone)
            polygon = kept
        return None


def unheld(mesh: Mesh, marks: Sequence[Mark], rows: Ints) -> dict[int, list[Array]]:
    """Return the pieces of some triangles that no mark is proven to hold: convex polygons (k, 3), by triangle."""
    holders = [_Holder(mark.shape) for mark in marks]
    found = dict[int, list[Array]]()
    for count, row in enumerate(rows.tolist()):
        triangle = mesh.vertices[mesh.triangles[row]]
        pieces = [triangle]
        if len(holders) > 1 and count < _MOST_JOINTLY:
            pieces = [piece for place, piece in _in_pieces(triangle, holders) if place == NONE]
        if pieces:
            found[row] = pieces
    return found


def _held_by(triangle: Array, holders: Sequence[_Holder]) -> tuple[int, ...]:
    """Return marks that together hold a triangle, piece by piece; none if this is not proven."""
    used = set[int]()
    for place, _ in _in_pieces(triangle, holders):
        if place == NONE:
            return ()
        used.add(place)
    return tuple(sorted(used))


def _in_pieces(triangle: Array, holders: Sequence[_Holder]) -> Iterator[tuple[int, Array]]:
    """Yield pieces of a triangle, each after the mark that holds it; `NONE` if no mark is proven to hold it."""
    left = [triangle]
    for _ in range(_MOST_PIECES):
        if not left:
            return
        polygon = left.pop()
        found = [(place, holder.cut(polygon)) for place, holder in enumerate(holders)]
        sizes = [(_area(cut[0]), -place) for place, cut in found if cut is not None]
        if not sizes or max(sizes)[0] <= _SLIVER * _area(polygon):
            yield NONE, polygon
            continue
        place = -max(sizes)[1]
        cut = found[place][1]
        assert cut is not None
        yield place, cut[0]
        left += cut[1]
    for polygon in left:
        yield NONE, polygon


def _area(polygon: Array) -> float:
    edges = polygon[1:] - polygon[0]
    crossed: Any = np.cross(edges[:-1], edges[1:])
    return float(np.linalg.norm(crossed.sum(axis=0)))


def away_from(shape: Shape, points: Array, limit: float = 0.0, polytope: Polytope | None = None) -> Array:
    """Return upper bounds (N,) of the distances of points (N, 3) from a shape without its radius [m].

    With its polytope given, no nearer point is searched for if a point is within `limit` of it, or clearly not.
    """
    away = np.full(len(points), np.inf) if polytope is None else polytope.away(points)
    rows = np.flatnonzero(away > limit)
    if polytope is not None and len(rows):
        away[rows] = np.minimum(away[rows], polytope.beyond(points[rows]))
        rows = rows[(away[rows] > limit) & (away[rows] <= limit + polytope.slack + _DOUBTFUL)]
    own = shape.corners, np.zeros((1, 0))
    for start in range(0, len(rows), _BLOCK):
        block = rows[start : start + _BLOCK]
        w = shape.origin - points[block]
        edges = np.repeat(shape.directions[:, None], len(block), axis=1)
        t = nearest(w, edges) if shape.is_zonotope else nearest_of_hulls(w, edges, own)
        found = np.linalg.norm(w + np.einsum("nk,kni->ni", t, edges), axis=1)
        away[block] = np.minimum(away[block], found)
    return away
