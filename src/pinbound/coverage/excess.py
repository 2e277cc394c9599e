"""An upper bound of the distance of a cover's outer surface from its mesh, by subdivision.

The surface of the parts is cut into pieces. The distance from one triangle T of the mesh is a convex function. So over
a piece its largest value is at one of the piece's corners. For each piece, T is the triangle nearest to its middle. If
the bound is too large, the piece is halved. Pieces inside another part are not outer surface. `docs/covers.md` has the
derivation.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pinbound.coverage.ball import BALL, ball_corners
from pinbound.coverage.near import Near, lay_points
from pinbound.coverage.polytopes import Polytope, split_polygon
from pinbound.coverage.surfaces import Pieces, Surface
from pinbound.coverage.triangles import cut_along, halved
from pinbound.tolerances import HELD
from pinbound.values import Value

__all__ = ["UNKNOWN", "Excess", "excess_of", "guess_of"]

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

_ROUNDS = 36  # halvings of a piece
_MOST_PIECES = 20_000  # for one part; if more are needed, the bound stays as large as it is then
_TRIED = 20  # middles of pieces that are tried as points of the outer surface far from the mesh
_MOST_CUTS = 60  # of a triangle by the planes of another part
_DENSE = 32.0  # of a part's extent: the distance between the points at which the excess is estimated
_LOOSE = 0.02  # of the ball about all parts: if the slack of a hull is larger, none of its pieces is left out
_NEARER = 0.75  # of that ball: how near to another part a piece must come when moved along each of the directions
_SINE = math.sqrt(1.0 - BALL**-2)  # of the angle from any direction to the nearest one of the fixed set
_STRICT = 1e-9  # of the way from the centre: a point this far inside a part is inside, in spite of rounding


@dataclass(frozen=True, eq=False)
class Excess(Value):
    """An upper bound of the distance of a part's outer surface from the mesh [m], and a point about that far."""

    bound: float
    place: Array


UNKNOWN = Excess(np.inf, np.zeros(3))
"""Nothing is known yet."""


def guess_of(parts: Sequence[Surface], index: int, near: Near, around: float) -> Excess:
    """Return an estimate of how far a part's outer surface is from the mesh, from points on its faces: not a bound."""
    own = parts[index]
    others = [one for place, one in enumerate(parts) if place != index and one.polytope is not None]
    others = [one for one in others if _near(own, one, 2.0 * around)]
    faces = own.pieces[0]
    places, owner = lay_points(faces.corners, float(np.linalg.norm(own.high - own.low)) / _DENSE)
    if own.polytope is not None:
        places = places[~_hidden(places[:, None], faces.normals[owner], others, around)]
    if not len(places):
        return Excess(around + own.slack, faces.corners[0, 0])
    furthest, away = near.furthest(places)
    return Excess(around + own.slack + away, places[furthest])


def excess_of(
    parts: Sequence[Surface], near: Near, around: float, fine: float, asked: Sequence[int], within: float = 0.05
) -> list[Excess]:
    """Return, for each part in `asked`, a bound of how far its outer surface is from the mesh.

    The surface is that of all parts with balls of radius `around` about them; `around` is at least every part's radius.

    Args:
        parts: All parts of the body.
        near: Its mesh.
        around: [m], at least the sum of radius and slack of every part.
        fine: [m]: bounds need not be more accurate than this.
        asked: Numbers of parts.
        within: Share of `fine`, and of the bound, to which the bound is refined.
    """
    return [_of_part(parts, index, near, around, fine, within) for index in asked]


def _of_part(parts: Sequence[Surface], index: int, near: Near, around: float, fine: float, within: float) -> Excess:
    own = parts[index]
    others = [one for place, one in enumerate(parts) if place != index and one.polytope is not None]
    others = [one for one in others if _near(own, one, 2.0 * around)]
    if own.slack > _LOOSE * around:  # its normals are not accurate enough
        others = []
    found = _Found(0.0, 0.0, own.pieces[0].corners.reshape(-1, 3).mean(axis=0), within, within * fine)
    if own.polytope is None:
        _look_at_the_bare(own.pieces[0].corners, own, others, near, around, found)
    else:
        faces, rest = own.pieces
        whole = _look_at_faces(faces, others, near, around, found)
        # The edges and vertices of a face that was bounded as a whole belong to it.
        open_ones = ~np.any(whole[rest.beside] & (rest.beside >= 0), axis=1)
        _look_at_the_bare(rest.corners[open_ones], own, others, near, around, found)
    return Excess((around + own.slack + found.bound) * (1.0 + HELD) + HELD, found.place)


@dataclass(eq=False)
class _Found:
    """The present bounds of the distance of a surface from the mesh, a point, and the accuracy to reach."""

    bound: float
    lower: float
    place: Array
    within: float
    fine: float

    @property
    def target(self) -> float:
        """Pieces within this distance of the mesh need not be refined [m]."""
        return max(self.bound, self.lower * (1.0 + self.within) + self.fine)


def _look_at_faces(faces: Pieces, others: Sequence[Surface], near: Near, around: float, found: _Found) -> Flags:
    """Bound the distance of faces from the mesh, and return which faces were bounded with no piece left out."""
    whole = np.ones(len(faces.corners), dtype=np.bool_)
    left: tuple[Array, Array, Ints] = faces.corners, faces.normals, np.arange(len(whole))
    if around > 0.0:
        left = _uncovered(*left, others, around, whole)
    for halvings in range(_ROUNDS + 1):
        shown = ~_hidden(left[0], left[1], others, around) if len(left[0]) else np.zeros(0, dtype=np.bool_)
        whole[left[2][~shown]] = False
        if not np.any(shown):
            break
        corners, normals, owner = left[0][shown], left[1][shown], left[2][shown]
        above, middle, whose = near.bounds(corners, found.target)
        rows = np.argsort(-middle)[:_TRIED]
        rows = rows[middle[rows] > found.lower]
        if len(rows):  # a point on the outer surface that is far from the mesh
            here = np.repeat(corners[rows].mean(axis=1)[:, None], 3, axis=1)
            out = np.flatnonzero(~_hidden(here, normals[rows], others, around))
            if len(out):
                furthest, away = near.furthest(here[out, 0])
                if away > found.lower:
                    found.lower, found.place = away, here[out[furthest], 0]
        target = found.target
        done = above <= target
        if halvings == _ROUNDS or 4 * np.count_nonzero(~done) > _MOST_PIECES:
            done[:] = True
        found.bound = max(found.bound, float(above[done].max(initial=0.0)))
        rest, from_row, least = _smaller(corners, ~done, middle <= target, whose, near, target)
        found.bound = max(found.bound, least)
        left = rest, normals[from_row], owner[from_row]
    return whole


def _look_at_the_bare(
    corners: Array, own: Surface, others: Sequence[Surface], near: Near, around: float, found: _Found
) -> None:
    """Bound the distance of pieces without one normal: edges, vertices, and faces that are too narrow."""
    whole, owner = corners, np.arange(len(corners))
    for halvings in range(_ROUNDS + 1):
        if not len(corners):
            return
        above, middle, _ = near.bounds(corners, found.target)
        above_near = float(above[above <= found.target].max(initial=0.0))
        far = np.flatnonzero(above > found.target)
        far = far[~_buried(corners[far], whole[owner[far]], own, others, around)]
        rows = far[np.argsort(-middle[far])][:_TRIED]
        rows = rows[middle[rows] > found.lower]
        if len(rows):  # a point that is not proven to be inside, so that no smaller bound can be found
            here = np.repeat(corners[rows].mean(axis=1)[:, None], 3, axis=1)
            out = np.flatnonzero(~_buried(here, whole[owner[rows]], own, others, around))
            if len(out):
                furthest, away = near.furthest(here[out, 0])
                if away > found.lower:
                    found.lower, found.place = away, here[out[furthest], 0]
        done = above[far] <= found.target
        done |= np.all(corners[far] == corners[far][:, :1], axis=(1, 2))  # points
        if halvings == _ROUNDS or 2 * len(far) > _MOST_PIECES:
            done[:] = True
        found.bound = max(found.bound, above_near, float(above[far[done]].max(initial=0.0)))
        corners, owner = halved(corners[far[~done]]), np.repeat(owner[far[~done]], 2)


def _smaller(
    corners: Array, asked: Flags, flush: Flags, found: Ints, near: Near, target: float
) -> tuple[Array, Ints, float]:
    """Return smaller pieces in place of some, which piece each is from, and a bound of those already within `target`.

    A piece whose middle lies on a triangle is cut along the sides of this triangle, because every point over the
    triangle is near it. So the result does not depend on how the two surfaces are cut into triangles. Other pieces are
    halved.
    """
    halves, rows = np.flatnonzero(asked & ~flush), np.flatnonzero(asked & flush)
    pieces, owner, least = list[Array](), list[Ints](), 0.0
    if len(rows):
        (over, whose), (rest, others) = cut_along(corners[rows], near.triangles.corners[found[rows]])
        uncut = (np.bincount(others, minlength=len(rows)) == 0) | (np.bincount(whose, minlength=len(rows)) == 0)
        away = near.over(over, found[rows[whose]])
        clear = ~uncut[whose]
        least = float(away[clear & (away <= target)].max(initial=0.0))
        far = clear & (away > target)
        some = ~uncut[others]
        pieces, owner = [over[far], rest[some]], [rows[whose[far]], rows[others[some]]]
        halves = np.concatenate((halves, rows[uncut]))
    pieces.append(halved(corners[halves]))
    owner.append(np.repeat(halves, 2))
    return np.concatenate(pieces), np.concatenate(owner), least


def _near(one: Surface, two: Surface, margin: float) -> bool:
    """Return whether the boxes around two parts, wider by `margin` [m], have a point in common."""
    return bool(np.all((one.low <= two.high + margin) & (two.low <= one.high + margin)))


def _uncovered(
    corners: Array, normals: Array, owner: Ints, others: Sequence[Surface], around: float, whole: Flags
) -> tuple[Array, Array, Ints]:
    """Return the triangles of faces without what leads into other parts; such faces are marked as not whole."""
    for other in others:
        polytope = other.polytope
        assert polytope is not None
        if not len(corners):
            break
        moved = corners + around * normals[:, None]
        close = np.all((moved.min(axis=1) <= other.high + around) & (moved.max(axis=1) >= other.low - around), axis=1)
        rows = np.flatnonzero(close)
        if not len(rows):
            continue
        height = polytope.heights(moved[rows].reshape(-1, 3)).reshape(len(rows), 3, -1)
        near = rows[~np.any(height.min(axis=1) > 0.25 * around, axis=1)]
        stay = np.ones(len(corners), dtype=np.bool_)
        pieces, sides, owners = [corners], [normals], [owner]
        for row in near.tolist():
            rest = _cut_away(corners[row], around * normals[row], polytope, around)
            if rest is None:
                continue
            stay[row] = whole[owner[row]] = False
            fans = [np.stack((np.repeat(p[:1], len(p) - 2, axis=0), p[1:-1], p[2:]), axis=1) for p in rest]
            if fans:
                pieces.append(np.concatenate(fans))
                sides.append(np.repeat(normals[row : row + 1], len(pieces[-1]), axis=0))
                owners.append(np.repeat(owner[row], len(pieces[-1])))
        pieces[0], sides[0], owners[0] = corners[stay], normals[stay], owner[stay]
        corners, normals, owner = np.concatenate(pieces), np.concatenate(sides), np.concatenate(owners)
    return corners, normals, owner


def _cut_away(polygon: Array, shift: Array, polytope: Polytope, around: float) -> list[Array] | None:
    """Return the polygons of a triangle that do not lead into a part; None if no piece is proven to lead into it.

    At a sharp corner of the part, a point slightly above its planes can be far from it. There the planes themselves
    cut.
    """
    for above in (0.25 * around, 0.0):
        rest = list[Array]()
        left = polygon
        for _ in range(_MOST_CUTS):
            height = polytope.heights(left + shift) - above
            worst = int(np.argmax(height.max(axis=0)))
            if height[:, worst].max() <= HELD:
                if np.all(polytope.away(left + shift) <= 0.5 * around):
                    return rest
                break
            left, gone = split_polygon(left, height[:, worst])
            if len(left) < 3:
                break
            if len(gone) > 2:
                rest.append(gone)
    return None


def _hidden(corners: Array, normals: Array, others: Sequence[Surface], around: float) -> Flags:
    """Return which pieces are not outer surface: they are inside another part, or lead into it along their normal."""
    hidden = np.zeros(len(corners), dtype=np.bool_)
    low, high = corners.min(axis=1), corners.max(axis=1)
    for other in others:
        polytope = other.polytope
        assert polytope is not None
        rows = np.flatnonzero(
            ~hidden & np.all((low >= other.low - 2.0 * around) & (high <= other.high + 2.0 * around), axis=1)
        )
        if not len(rows):
            continue
        inside = _inside(corners[rows], polytope)
        hidden[rows[inside]] = True
        rows = rows[~inside]
        if around > 0.0 and len(rows):
            hidden[rows] = _are_near(corners[rows] + around * normals[rows][:, None], polytope, 0.5 * around)
    return hidden


def _buried(corners: Array, whole: Array, own: Surface, others: Sequence[Surface], around: float) -> Flags:
    """Return which pieces are inside another part, or lead into others along all directions that may be their normals.

    It tests the directions of a fixed set that are near a normal; each normal is near one of them.

    Args:
        corners: (n, 3, 3).
        whole: (n, 3, 3), the edge, vertex, or face to which each piece belongs.
        own: The part.
        others: Other parts.
        around: [m].
    """
    buried = np.zeros(len(corners), dtype=np.bool_)
    low, high = corners.min(axis=1), corners.max(axis=1)
    close = np.zeros((len(others), len(corners)), dtype=np.bool_)
    for place, one in enumerate(others):
        assert one.polytope is not None
        close[place] = np.all((low >= one.low - 2.0 * around) & (high <= one.high + 2.0 * around), axis=1)
        rows = np.flatnonzero(~buried & close[place])
        if len(rows):
            buried[rows[_inside(corners[rows], one.polytope)]] = True
    rows = np.flatnonzero(~buried & np.any(close, axis=0))
    if own.polytope is None or not around > 0.0 or not len(rows):
        return buried
    units = ball_corners()
    outward = _outward(whole[rows], own.polytope)
    first = np.argmax(outward, axis=1)  # most pieces have no other part near them: one direction decides
    leads = _lead(corners[rows], units[first], close[:, rows], others, around)
    rows, outward = rows[leads], outward[leads]
    which, along = np.nonzero(outward)
    leads = _lead(corners[rows[which]], units[along], close[:, rows[which]], others, around)
    out = ~np.any(outward, axis=1)
    out[which[~leads]] = True
    buried[rows[~out]] = True
    return buried


def _outward(corners: Array, polytope: Polytope) -> Flags:
    """Return which directions of the fixed set may be near to a normal on all corners (n, 3, 3) of its surface."""
    units = ball_corners()
    outward = np.ones((len(corners), len(units)), dtype=np.bool_)
    heights = units @ polytope.vertices.T
    places, index = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    of_place = np.empty((len(places), len(units)), dtype=np.bool_)
    for row, place in enumerate(places):
        away = _SINE * np.linalg.norm(polytope.vertices - place, axis=1)
        of_place[row] = np.max(heights - away, axis=1) <= units @ place + polytope.slack + HELD
    for corner in index.reshape(-1, 3).T:
        outward &= of_place[corner]
    return outward


def _lead(corners: Array, ways: Array, close: Flags, others: Sequence[Surface], around: float) -> Flags:
    """Return which pieces (n, 3, 3) lead into one of the other parts, each along its own direction (n, 3)."""
    moved = corners + around * ways[:, None]
    leads = np.zeros(len(corners), dtype=np.bool_)
    for one, mine in zip(others, close, strict=True):
        rows = np.flatnonzero(mine & ~leads)
        if len(rows):
            assert one.polytope is not None
            leads[rows] = _are_near(moved[rows], one.polytope, _NEARER * around)
    return leads


def _inside(corners: Array, polytope: Polytope) -> Flags:
    return np.all(polytope.inside(corners.reshape(-1, 3), _STRICT).reshape(corners.shape[:2]), axis=1)


def _are_near(corners: Array, polytope: Polytope, distance: float) -> Flags:
    return np.all(polytope.away(corners.reshape(-1, 3)).reshape(corners.shape[:2]) <= distance, axis=1)
