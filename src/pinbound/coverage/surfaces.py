"""The surface of a part, the hull of some points, in pieces: faces, edges, vertices, with the normals on them."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray

from pinbound.coverage.polytopes import Polytope
from pinbound.tolerances import HELD
from pinbound.values import Value

__all__ = ["Pieces", "Surface", "surface_of"]

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

_NORMALS = 5  # that are looked along at an edge: no normal between is further than 22 degrees from one of them
_SHARP, _FLIPPED = 1e-6, 3.0  # radians between two faces: too little to divide by, too much to say what is between
_FEW = 24  # vertices of which all triangles are looked at


@dataclass(frozen=True, eq=False)
class Pieces(Value):
    """Pieces of one sort.

    Attributes:
        corners: (n, 3, 3) [m]; two of an edge, and all of a vertex, are equal.
        normals: (n, S, 3), outwards; none where they are not known.
        beside: (n, k), numbers of faces that have the piece on their rim, by their places among the faces; -1 where
            there are fewer. What is said of all of such a face is said of the piece.
    """

    corners: Array
    normals: Array
    beside: Ints


@dataclass(frozen=True, eq=False)
class Surface(Value):
    """Pieces of a part's surface, and what it encloses.

    Attributes:
        pieces: Sort by sort: faces, edges, and vertices with all that has no known normal.
        polytope: What is enclosed; None if that is not proven.
        radius: [m] around it.
        slack: [m], how far the hull may be outside the pieces.
        low: (3,) [m], the least coordinates.
        high: (3,) [m], the largest.
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
        return Surface(_pieces(polytope), polytope, radius, polytope.slack, low, high)
    if len(vertices) <= _FEW:
        # Whatever its shape: by Caratheodory's theorem each place of a surface is in a triangle of vertices.
        last = len(vertices) - 1
        rows = np.array([*combinations(range(len(vertices)), 3)] or [[0, last, last]])
        return Surface((_bare(vertices[rows]),), None, radius, 0.0, low, high)
    wide = max(float((high - low).max()) * 1e-3, HELD)  # of a flat box, so that it has sides that can be proven
    low, high = low - wide, high + wide
    box = Polytope.of(np.array([*product(*zip(low, high, strict=True))]))
    assert box is not None
    return Surface((_bare(box.vertices[box.facets]),), None, radius, 0.0, low, high)


def _bare(corners: Array) -> Pieces:
    """Return triangles of which no normal is known."""
    return Pieces(corners, np.zeros((len(corners), 0, 3)), np.zeros((len(corners), 0), dtype=np.int64))


def _pieces(polytope: Polytope) -> tuple[Pieces, ...]:
    """Return faces with their normal, edges with normals from that of the one face to that of the other, vertices."""
    normals, facets = polytope.normals, polytope.facets
    clear = np.any(normals, axis=1)
    faces = polytope.vertices[facets]
    count = len(polytope.vertices)
    start, end = facets.ravel(), np.roll(facets, -1, axis=1).ravel()
    face = np.repeat(np.arange(len(facets)), 3)
    there, back = np.argsort(start * count + end), np.argsort(end * count + start)
    first = start[there] < end[there]
    one, two = face[there][first], face[back][first]
    edges = polytope.vertices[np.column_stack((start[there], end[there], end[there]))[first]]
    turn = np.arccos(np.clip(np.einsum("ei,ei->e", normals[one], normals[two]), -1.0, 1.0))
    shares = np.linspace(0.0, 1.0, _NORMALS)[:, None]
    low = turn < _SHARP
    sine = np.sin(np.where(low, 1.0, turn))
    weights = [np.where(low, 1.0 - part, np.sin((1.0 - part) * turn) / sine) for part in (shares, 1.0 - shares)]
    arcs = weights[0].T[:, :, None] * normals[one][:, None] + weights[1].T[:, :, None] * normals[two][:, None]
    # Normals that are nearly opposite, or of a triangle without area, do not say what lies between them.
    known = clear[one] & clear[two] & (turn < _FLIPPED)
    place = np.cumsum(clear) - 1  # of a face among those that are clear
    place[~clear] = -1
    beside = place[np.column_stack((one, two))]
    of_vertex: list[list[int]] = [[] for _ in range(count)]
    rows_of: list[int] = place.tolist()
    corners_of: list[list[int]] = facets.tolist()
    for row, corners in zip(rows_of, corners_of, strict=True):
        for corner in corners:
            of_vertex[corner].append(row)
    width = max(map(len, of_vertex))
    around = np.array([[*rows, *[rows[0] if rows else -1] * (width - len(rows))] for rows in of_vertex])
    vertices = np.repeat(polytope.vertices[:, None], 3, axis=1)
    nothing = np.full((np.count_nonzero(~clear), width), -1)
    some = np.pad(beside[~known], ((0, 0), (0, width - 2)), mode="edge")
    return (
        Pieces(faces[clear], normals[clear][:, None], np.zeros((np.count_nonzero(clear), 0), dtype=np.int64)),
        Pieces(edges[known], arcs[known], beside[known]),
        Pieces(
            np.concatenate((faces[~clear], edges[~known], vertices)),
            np.zeros((0, 0, 3)),
            np.concatenate((nothing, some, around)),
        ),
    )
