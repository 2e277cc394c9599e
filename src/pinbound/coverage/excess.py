"""How far the outer surface of a cover is from its mesh: an upper bound, by subdivision.

The surface of the parts is cut into pieces. The distance from one triangle T of the mesh is a convex function, so that
over a piece it is nowhere larger than at one of the piece's corners; each piece takes the T that is nearest to its
middle, and is halved if that bound is too large. Pieces that are inside another part are no outer surface.
`docs/covers.md` has the derivation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pinbound.coverage.near import Near, lay_points
from pinbound.coverage.polytopes import Polytope, split_polygon
from pinbound.coverage.surfaces import Surface
from pinbound.coverage.triangles import cut_along, halved
from pinbound.tolerances import HELD
from pinbound.values import Value

__all__ = ["UNKNOWN", "Excess", "excess_of", "guess_of"]

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

_ROUNDS = 18  # halvings of a piece
_MOST_PIECES = 20_000  # of one part; if more are needed the bound is as large as it is then
_TRIED = 20  # middles of pieces, of which one may be a place of the outer surface that is far from the mesh
_MOST_CUTS = 20  # of a triangle by the planes of another part
_DENSE = 32.0  # of a part's extent: how far places are apart that are guessed by
_STRICT = 1e-9  # of the way from the centre: this far inside a part, a place is inside, whatever rounding did


@dataclass(frozen=True, eq=False)
class Excess(Value):
    """An upper bound of how far a part's outer surface is from the mesh [m], and where it is about that far."""

    bound: float
    place: Array


UNKNOWN = Excess(np.inf, np.zeros(3))
"""Nothing is known yet."""


def guess_of(parts: Sequence[Surface], index: int, near: Near, around: float) -> Excess:
    """Return about how far a part's outer surface is from the mesh, as far as places on its faces tell: no bound."""
    own = parts[index]
    others = [one for place, one in enumerate(parts) if place != index and one.polytope is not None]
    others = [one for one in others if _near(own, one, 2.0 * around)]
    faces = own.pieces[0]
    places, owner = lay_points(faces.corners, float(np.linalg.norm(own.high - own.low)) / _DENSE)
    normals = faces.normals[owner] if faces.normals.size else np.full((len(places), 1, 3), np.nan)
    shown = np.flatnonzero(~_hidden(places[:, None], normals, others, around))
    if not len(shown):
        return Excess(around + own.slack, places[0])
    furthest, away = near.furthest(places[shown])
    return Excess(around + own.slack + away, places[shown[furthest]])


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
    others = [one for one in others if _near(own, one, 2.0 * around)]
    bound, lower, place = 0.0, 0.0, own.pieces[0].corners.reshape(-1, 3).mean(axis=0)
    whole = np.ones(len(own.pieces[0].corners), dtype=np.bool_)  # faces nothing of which was left out
    for sort, pieces in enumerate(own.pieces):
        # Edges and vertices of a face that was looked at as a whole are on it.
        open_ones = ~np.any(whole[pieces.beside] & (pieces.beside >= 0), axis=1)
        corners, owner = pieces.corners[open_ones], np.flatnonzero(open_ones)
        normals = pieces.normals if pieces.normals.size else np.full((len(pieces.corners), 1, 3), np.nan)
        left: tuple[Array, Array, Ints] = corners, normals[open_ones], owner
        if sort == 0 and normals.shape[1] == 1 and around > 0.0:
            left = _uncovered(*left, others, around, whole)
        for halvings in range(_ROUNDS + 1):
            shown = ~_hidden(left[0], left[1], others, around) if len(left[0]) else np.zeros(0, dtype=np.bool_)
            if sort == 0:
                whole[left[2][~shown]] = False
            if not np.any(shown):
                break
            corners, sides, owner = left[0][shown], left[1][shown], left[2][shown]
            target = max(bound, lower * (1.0 + within) + within * fine)
            above, middle, found = near.bounds(corners, target)
            rows = np.argsort(-middle)[:_TRIED]
            rows = rows[middle[rows] > lower]
            if len(rows):  # a place that is on the outer surface itself, and far from the mesh
                here = np.repeat(corners[rows].mean(axis=1)[:, None], 3, axis=1)
                out = np.flatnonzero(~_hidden(here, sides[rows], others, around))
                if len(out):
                    furthest, away = near.furthest(here[out, 0])
                    lower, place = max((lower, place), (away, here[out[furthest], 0]), key=lambda one: one[0])
            target = max(bound, lower * (1.0 + within) + within * fine)
            done = above <= target
            if halvings == _ROUNDS or 4 * np.count_nonzero(~done) > _MOST_PIECES:
                done[:] = True
            bound = max(bound, float(above[done].max(initial=0.0)))
            rest, from_row, least = _smaller(corners, ~done, middle <= target, found, near, target)
            bound = max(bound, least)
            left = rest, sides[from_row], owner[from_row]
    return Excess((around + own.slack + bound) * (1.0 + HELD) + HELD, place)


def _smaller(
    corners: Array, asked: Flags, flush: Flags, found: Ints, near: Near, target: float
) -> tuple[Array, Ints, float]:
    """Return smaller pieces in place of some, what each is cut from, and a bound for what is within `target` already.

    A piece whose middle lies on a triangle is cut along the sides of this: what is over it is near it as a whole,
    however the two surfaces are cut into triangles. Others are halved.
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
    """Return what is left of faces when what leads into other parts is cut away, in triangles; those are not whole."""
    for other in others:
        polytope = other.polytope
        assert polytope is not None
        if not len(corners):
            break
        moved = corners + around * normals
        close = np.all((moved.min(axis=1) <= other.high + around) & (moved.max(axis=1) >= other.low - around), axis=1)
        close &= np.isfinite(normals[:, 0, 0])
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
        inside = np.all(polytope.inside(corners[rows].reshape(-1, 3), _STRICT).reshape(len(rows), -1), axis=1)
        hidden[rows[inside]] = True
        rows = rows[~inside & known[rows]]
        if around > 0.0 and len(rows):
            moved = corners[rows][:, None] + around * normals[rows][:, :, None]
            near = polytope.away(moved.reshape(-1, 3)).reshape(*moved.shape[:3]) <= 0.5 * around
            leads[rows] |= np.all(near, axis=2)
            hidden |= np.all(leads, axis=1)
    return hidden
