"""How far the outer surface of a cover is from its mesh: an upper bound, by subdivision.

The surface of the parts is cut into pieces. The distance from one triangle T of the mesh is a convex function, so that
over a piece it is nowhere larger than at one of the piece's corners; each piece takes the T that is nearest to its
middle, and is halved if that bound is too large. Pieces that are inside another part are no outer surface.
`docs/covers.md` has the derivation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pinbound.coverage.polytopes import Polytope, split_polygon
from pinbound.meshes import Mesh
from pinbound.tolerances import HELD
from pinbound.values import Value

__all__ = ["Excess", "Near", "Surface", "excess_of", "surface_of"]

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

_NORMALS = 5  # that are looked along at an edge: no normal between is further than 22 degrees from one of them
_SHARP, _FLIPPED = 1e-6, 3.0  # radians between two faces: too little to divide by, too much to say what is between
_ROUNDS = 18  # halvings of a piece
_MOST_PIECES = 20_000  # of one part; if more are needed the bound is as large as it is then
_TRIED = 20  # middles of pieces, of which one may be a place of the outer surface that is far from the mesh
_MOST_CUTS = 20  # of a triangle by the planes of another part
_STRICT = 1e-9  # of the way from the centre: this far inside a part, a place is inside, whatever rounding did
_FEW = 24  # vertices of which all triangles are looked at


@dataclass(frozen=True, eq=False)
class Surface(Value):
    """Pieces of a part's surface, and what it encloses.

    Attributes:
        pieces: Corners (n, 3, 3) [m] and outward normals (n, S, 3), none where they are not known, sort by sort: faces,
            edges (triangles with two equal corners), vertices.
        polytope: What is enclosed; None if that is not proven.
        radius: [m] around it.
        slack: [m], how far the hull may be outside the pieces.
    """

    pieces: tuple[tuple[Array, Array], ...]
    polytope: Polytope | None
    radius: float
    slack: float


class Near:
    """The triangles of a mesh, to be found near a place."""

    def __init__(self, mesh: Mesh) -> None:
        """Lay points over the triangles: dense enough that the next point is on a triangle that is nearly the next."""
        from scipy import spatial

        corners = mesh.vertices[mesh.triangles]
        self.corners = corners
        spread = float(np.linalg.norm(mesh.vertices.max(axis=0) - mesh.vertices.min(axis=0))) / 40.0
        owner, laid = np.arange(len(corners)), [corners.mean(axis=1)]
        owners, pieces = [owner], corners
        for _ in range(20):
            sides = np.linalg.norm(pieces - np.roll(pieces, -1, axis=1), axis=2)
            wide = sides.max(axis=1) > spread
            if not np.any(wide) or int(np.count_nonzero(wide)) > 50_000:
                break
            pieces, owner = _halved(pieces[wide]), np.repeat(owner[wide], 2)
            laid.append(pieces.mean(axis=1))
            owners.append(owner)
        self._owner = np.concatenate(owners)
        library: Any = spatial
        self._tree: Any = library.cKDTree(np.concatenate(laid))

    def triangles(self, points: Array, count: int = 3) -> Ints:
        """Return triangles (N, count) that are near places (N, 3), by number."""
        rows: Any = self._tree.query(points, k=min(count, len(self._owner)))[1]
        return self._owner[np.asarray(rows).reshape(len(points), -1)]

    def bounds(self, pieces: Array) -> tuple[Array, Array]:
        """Return upper bounds of the distance of all of each piece (n, 3, 3), and about the distance of its middle."""
        middles = pieces.mean(axis=1)
        near = self.triangles(middles)
        size = np.linalg.norm(pieces - middles[:, None], axis=2).max(axis=1)
        best, middle = np.full(len(pieces), np.inf), np.full(len(pieces), np.inf)
        for column in near.T:
            triangle = self.corners[column]
            at = np.stack([_distance(pieces[:, corner], triangle) for corner in range(3)]).max(axis=0)
            here = _distance(middles, triangle)
            best, middle = np.minimum(best, at), np.minimum(middle, here)
        return np.minimum(best, middle + size), middle


def surface_of(vertices: Array, radius: float) -> Surface:
    """Return the surface of a hull with a ball of `radius` around."""
    polytope = Polytope.of(vertices)
    if polytope is not None:
        return Surface(_pieces(polytope), polytope, radius, polytope.slack)
    if len(vertices) <= _FEW:
        # Whatever its shape: by Caratheodory's theorem each place of a surface is in a triangle of vertices.
        last = len(vertices) - 1
        rows = np.array([*combinations(range(len(vertices)), 3)] or [[0, last, last]])
        return Surface(((vertices[rows], np.zeros((len(rows), 0, 3))),), None, radius, 0.0)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    wide = max(float((high - low).max()) * 1e-3, HELD)  # of a flat box, so that it has sides that can be proven
    corners = np.array([*product(*zip(low - wide, high + wide, strict=True))])
    box = Polytope.of(corners)
    assert box is not None
    return Surface(((box.vertices[box.facets], np.zeros((len(box.facets), 0, 3))),), None, radius, 0.0)


def _pieces(polytope: Polytope) -> tuple[tuple[Array, Array], ...]:
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
    vertices = np.repeat(polytope.vertices[:, None], 3, axis=1)
    return (
        (faces[clear], normals[clear][:, None]),
        (edges[known], arcs[known]),
        (np.concatenate((faces[~clear], edges[~known], vertices)), np.zeros((0, 0, 3))),
    )


@dataclass(frozen=True, eq=False)
class Excess(Value):
    """An upper bound of how far a part's outer surface is from the mesh [m], and where it is about that far."""

    bound: float
    place: Array


def excess_of(
    parts: Sequence[Surface], near: Near, around: float, fine: float, asked: Sequence[int], within: float = 0.05
) -> list[Excess]:
    """Return, for each part that is asked for, a bound of how far its outer surface is from the mesh.

    The surface is that of all parts with balls of `around` about them, which is at least every part's own radius.

    Args:
        parts: All parts of the body.
        near: Its mesh.
        around: [m], at least radius and slack of every part.
        fine: [m]: what bounds need not tell apart.
        asked: Numbers of parts.
        within: Of `fine`, and of the bound: finer is not looked.
    """
    return [_of_part(parts, index, near, around, fine, within) for index in asked]


def _of_part(parts: Sequence[Surface], index: int, near: Near, around: float, fine: float, within: float) -> Excess:
    own = parts[index]
    others = [one for place, one in enumerate(parts) if place != index and one.polytope is not None]
    bound, lower, place = 0.0, 0.0, own.pieces[0][0].reshape(-1, 3).mean(axis=0)
    for faces, normals in own.pieces:
        left = faces, normals if normals.size else np.full((len(faces), 1, 3), np.nan)
        if left[1].shape[1] == 1 and around > 0.0:
            left = _uncovered(*left, others, around)
        for halvings in range(_ROUNDS + 1):
            shown = ~_hidden(*left, others, around) if len(left[0]) else np.zeros(0, dtype=np.bool_)
            if not np.any(shown):
                break
            corners, sides = left[0][shown], left[1][shown]
            above, middle = near.bounds(corners)
            rows = np.argsort(-middle)[:_TRIED]
            rows = rows[middle[rows] > lower]
            if len(rows):  # a place that is on the outer surface itself, and far from the mesh
                here = np.repeat(corners[rows].mean(axis=1)[:, None], 3, axis=1)
                out = np.flatnonzero(~_hidden(here, sides[rows], others, around))
                if len(out):
                    lower, place = float(middle[rows[out[0]]]), here[out[0], 0]
            done = above <= max(bound, lower * (1.0 + within) + within * fine)
            if halvings == _ROUNDS or 2 * np.count_nonzero(~done) > _MOST_PIECES:
                done[:] = True
            bound = max(bound, float(above[done].max(initial=0.0)))
            left = _halved(corners[~done]), np.repeat(sides[~done], 2, axis=0)
    return Excess((around + own.slack + bound) * (1.0 + HELD) + HELD, place)


def _uncovered(corners: Array, normals: Array, others: Sequence[Surface], around: float) -> tuple[Array, Array]:
    """Return what is left of triangles when what leads into other parts is cut away, in triangles again."""
    for other in others:
        polytope = other.polytope
        assert polytope is not None
        if not len(corners):
            break
        height = polytope.heights((corners + around * normals).reshape(-1, 3)).reshape(len(corners), 3, -1)
        near = np.flatnonzero(~np.any(height.min(axis=1) > 0.25 * around, axis=1) & np.isfinite(normals[:, 0, 0]))
        if not len(near):
            continue
        stay = np.ones(len(corners), dtype=np.bool_)
        pieces, sides = [corners], [normals]
        for row in near.tolist():
            rest = _cut_away(corners[row], around * normals[row], polytope, around)
            if rest is None:
                continue
            stay[row] = False
            fans = [np.stack((np.repeat(p[:1], len(p) - 2, axis=0), p[1:-1], p[2:]), axis=1) for p in rest]
            if fans:
                pieces.append(np.concatenate(fans))
                sides.append(np.repeat(normals[row : row + 1], len(pieces[-1]), axis=0))
        pieces[0], sides[0] = corners[stay], normals[stay]
        corners, normals = np.concatenate(pieces), np.concatenate(sides)
    return corners, normals


def _cut_away(polygon: Array, shift: Array, polytope: Polytope, around: float) -> list[Array] | None:
    """Return what of a triangle does not lead into a part, as polygons; None if nothing is proven to."""
    rest: list[Array] = []
    for _ in range(_MOST_CUTS):
        height = polytope.heights(polygon + shift) - 0.25 * around
        worst = int(np.argmax(height.max(axis=0)))
        if height[:, worst].max() <= HELD:
            return rest if np.all(polytope.away(polygon + shift) <= 0.5 * around) else None
        polygon, gone = split_polygon(polygon, height[:, worst])
        if len(polygon) < 3:
            return None
        if len(gone) > 2:
            rest.append(gone)
    return None


def _hidden(corners: Array, normals: Array, others: Sequence[Surface], around: float) -> Flags:
    """Return which pieces are inside another part, or lead into others along each normal: no outer surface is there."""
    hidden = np.zeros(len(corners), dtype=np.bool_)
    leads = np.zeros(normals.shape[:2], dtype=np.bool_)
    known = np.all(np.isfinite(normals), axis=(1, 2))
    low, high = corners.min(axis=1), corners.max(axis=1)
    for other in others:
        polytope = other.polytope
        assert polytope is not None
        below, above = polytope.vertices.min(axis=0) - 2.0 * around, polytope.vertices.max(axis=0) + 2.0 * around
        rows = np.flatnonzero(~hidden & np.all((low >= below) & (high <= above), axis=1))
        if not len(rows):
            continue
        inside = np.all(polytope.inside(corners[rows].reshape(-1, 3), _STRICT).reshape(-1, 3), axis=1)
        hidden[rows[inside]] = True
        rows = rows[~inside & known[rows]]
        if around > 0.0 and len(rows):
            moved = corners[rows][:, None] + around * normals[rows][:, :, None]
            near = polytope.away(moved.reshape(-1, 3)).reshape(len(rows), -1, 3) <= 0.5 * around
            leads[rows] |= np.all(near, axis=2)
            hidden |= np.all(leads, axis=1)
    return hidden


def _halved(pieces: Array) -> Array:
    """Return each triangle (n, 3, 3) as two, cut across its longest side, side by side: (2 n, 3, 3)."""
    sides = np.linalg.norm(np.roll(pieces, -1, axis=1) - pieces, axis=2)
    longest = np.argmax(sides, axis=1)
    rows = np.arange(len(pieces))
    a, b, c = (pieces[rows, (longest + turn) % 3] for turn in range(3))
    middle = 0.5 * (a + b)
    return np.stack((np.stack((a, middle, c), axis=1), np.stack((middle, b, c), axis=1)), axis=1).reshape(-1, 3, 3)


def _distance(points: Array, triangles: Array) -> Array:
    """Return how far points (N, 3) are from triangles (N, 3, 3): from a place of each that is nearest to rounding."""
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    best = np.full(len(points), np.inf)
    for start, end in ((a, b), (b, c), (c, a)):
        along = end - start
        square = np.einsum("ni,ni->n", along, along)
        dot = np.einsum("ni,ni->n", points - start, along)
        t = np.clip(np.divide(dot, square, out=np.zeros_like(dot), where=square > 0.0), 0.0, 1.0)
        best = np.minimum(best, np.linalg.norm(points - start - t[:, None] * along, axis=1))
    u, v, w = b - a, c - a, points - a
    uu, uv, vv = (np.einsum("ni,ni->n", x, y) for x, y in ((u, u), (u, v), (v, v)))
    wu, wv = np.einsum("ni,ni->n", w, u), np.einsum("ni,ni->n", w, v)
    det = uu * vv - uv * uv
    s = np.divide(vv * wu - uv * wv, det, out=np.full_like(det, -1.0), where=det > 0.0)
    t = np.divide(uu * wv - uv * wu, det, out=np.full_like(det, -1.0), where=det > 0.0)
    over = (s >= 0.0) & (t >= 0.0) & (s + t <= 1.0)
    face = np.linalg.norm(w - s[:, None] * u - t[:, None] * v, axis=1)
    return np.where(over, np.minimum(best, face), best)
