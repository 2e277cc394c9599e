"""The surface of a part (a hull of some points) in pieces: faces with their normals, sharp edges, vertices."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import combinations, product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pinbound.coverage.polytopes import Polytope
from pinbound.tolerances import HELD, UNIT_ROUNDOFF
from pinbound.values import Value

__all__ = ["Pieces", "Surface", "surface_of"]

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

_GENTLE = 0.9  # radians between two faces: each normal of the edge is within half of it from one of theirs
_WIDE = 50.0  # of the slack, and of rounding: the normal of a narrower face is not accurate
_FEW = 24  # vertices of which all triangles are examined


@dataclass(frozen=True, eq=False)
class Pieces(Value):
    """Pieces of one kind.

    Attributes:
        corners: (n, 3, 3) [m]; for an edge two are equal, and for a vertex all three.
        normals: (n, 3), outwards; empty if they are not known.
        beside: (n, k), indices of the faces that have the piece on their border; -1 if there are fewer than k. A bound
            of such a whole face also holds for the piece.
    """

    corners: Array
    normals: Array
    beside: Ints


@dataclass(frozen=True, eq=False)
class Surface(Value):
    """Pieces of a part's surface, and the volume that it encloses.

    Attributes:
        pieces: First the faces with their normals. Then the pieces without a single normal: sharp edges, vertices,
            faces that are too narrow.
        polytope: The enclosed volume; None if that is not proven.
        radius: [m], the radius around it.
        slack: [m], how far the hull may be outside the pieces.
        low: (3,) [m], the smallest coordinates.
        high: (3,) [m], the largest coordinates.
    """

    pieces: tuple[Pieces, ...]
    polytope: Polytope | None
    radius: float
    slack: float
    low: Array
    high: Array


def surface_of(vertices: Array, radius: float) -> Surface:
    """Return the surface of a hull with a ball of `radius` around."""
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    polytope = Polytope.of(vertices)
    if polytope is not None:
        pieces = _pieces(polytope)
        if len(pieces[0].corners):
            return Surface(pieces, polytope, radius, polytope.slack, low, high)
    if len(vertices) <= _FEW:
        # For any shape, by Caratheodory's theorem, each point of a surface is in a triangle of vertices.
        last = len(vertices) - 1
        rows = np.array([*combinations(range(len(vertices)), 3)] or [[0, last, last]])
        return Surface((_bare(vertices[rows]),), None, radius, 0.0, low, high)
    wide = max(float((high - low).max()) * 1e-3, HELD)  # a flat box gets a thickness, so that its sides can be proven
    low, high = low - wide, high + wide
    box = Polytope.of(np.array([*product(*zip(low, high, strict=True))]))
    assert box is not None
    return Surface((_bare(box.vertices[box.facets]),), None, radius, 0.0, low, high)


def _bare(corners: Array) -> Pieces:
    """Return triangles whose normals are not known."""
    return Pieces(corners, np.zeros((0, 3)), np.zeros((len(corners), 0), dtype=np.int64))


def _pieces(polytope: Polytope) -> tuple[Pieces, ...]:
    """Return faces with their normals, and the pieces without one: sharp edges, vertices, faces that are too narrow."""
    normals, facets = polytope.normals, polytope.facets
    faces = polytope.vertices[facets]
    ends: Any = np.roll(faces, -1, axis=1) - faces
    crossed: Any = np.cross(ends[:, 0], ends[:, 1])
    least = _WIDE * max(polytope.slack, UNIT_ROUNDOFF * polytope.reach)
    clear = np.linalg.norm(crossed, axis=1) > least * np.linalg.norm(ends, axis=2).max(axis=1)
    count = len(polytope.vertices)
    start, end = facets.ravel(), np.roll(facets, -1, axis=1).ravel()
    face = np.repeat(np.arange(len(facets)), 3)
    there, back = np.argsort(start * count + end), np.argsort(end * count + start)
    first = start[there] < end[there]
    one, two = face[there][first], face[back][first]
    edges = polytope.vertices[np.column_stack((start[there], end[there], end[there]))[first]]
    # A gentle edge needs no bound of its own: those of its two faces are enough.
    sharp = np.einsum("ei,ei->e", normals[one], normals[two]) < math.cos(_GENTLE)
    sharp |= ~clear[one] | ~clear[two]
    place = np.cumsum(clear) - 1  # index of a face among the wide ones
    place[~clear] = -1
    beside = place[np.column_stack((one, two))][sharp]
    of_vertex: list[list[int]] = [[] for _ in range(count)]
    rows_of: list[int] = place.tolist()
    corners_of: list[list[int]] = facets.tolist()
    for row, corners in zip(rows_of, corners_of, strict=True):
        for corner in corners:
            of_vertex[corner].append(row)
    width = max(2, *map(len, of_vertex))
    around = np.array([[*rows, *[rows[0] if rows else -1] * (width - len(rows))] for rows in of_vertex])
    vertices = np.repeat(polytope.vertices[:, None], 3, axis=1)
    nothing = np.full((np.count_nonzero(~clear), width), -1)
    return (
        Pieces(faces[clear], normals[clear], np.zeros((np.count_nonzero(clear), 0), dtype=np.int64)),
        Pieces(
            np.concatenate((faces[~clear], edges[sharp], vertices)),
            np.zeros((0, 3)),
            np.concatenate((nothing, np.pad(beside, ((0, 0), (0, width - 2)), mode="edge"), around)),
        ),
    )
