"""Faces of a drawing whose contact curves are known to within tubes: what of them is proven, and what stays open.

The plane is drawn again with finer cells wherever the tubes leave open whether two parts are connected, or if there
is an island, until those cells are a hundredth of the stated width. What is then still open is told, and closed by a
wall where the drawing had it open: the region is the reading in which parts are apart. `docs/regions-cells.md`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
import shapely

from pinbound.region.halfplanes import intersect
from pinbound.region.lines import Line
from pinbound.region.slice import Slice
from pinbound.region.tubes import Part, Tubes

__all__ = ["Settled", "settle"]

Block = tuple[Any, str]
Draw = Callable[[Sequence[Line], Sequence[Block]], "tuple[Any, ...] | None"]
gis = cast(Any, shapely)  # its stubs know only part of what its functions take

_CUTS = 2  # how often doubtful cells are cut before the plane is drawn again
_DRAWINGS = 24
_TURN = 2.0 * np.pi


@dataclass(frozen=True, eq=False)
class Settled:
    """The faces of a plane, its tubes cut as far as that helped.

    Attributes:
        faces: The free faces, the start's first, in units of `Slice.scales`, as all that follows.
        lines: Searched contours, and walls around what stays open.
        blocks: What stays open: a polygon and the boundary's name.
        error: No point of a searched contour is further than this from the lines.
        tubes: The undecided cells.
        parts: What is proven of the faces.
    """

    faces: tuple[Any, ...]
    lines: tuple[Line, ...]
    blocks: tuple[Block, ...]
    error: float
    tubes: Tubes
    parts: tuple[Part, ...]

    def areas(self, index: int, chord_error: float) -> tuple[float, float]:
        """Return proven bounds of the area of the component that one face stands for.

        At least the largest proven part, that with the start in the first face; at most all faces that tubes may
        connect with it, and those tubes. Smooth curves, if there are any, may be off by `chord_error` all along.

        Args:
            index: The face.
            chord_error: Of the curves that are not searched for.
        """
        slice_ = self.tubes.searched.slice
        room, start = _room(slice_), gis.Point(slice_.start / slice_.scales)
        mine = [part.polygon for part in self.parts if part.face == index]
        lower = max((float(one.area) for one in mine), default=0.0)
        if index == 0:
            lower = next((float(one.area) for one in mine if one.intersects(start)), 0.0)
        cells, joined = self.tubes.network(self.faces, index, _sides(slice_, self.faces), room)
        proven = sum(float(part.polygon.area) for part in self.parts if part.face in joined)
        upper = proven + float(np.sum(gis.area(gis.intersection(self.tubes.boxes(cells), room))))
        spare = 2.0 * chord_error * float(sum(self.faces[i].length for i in joined))
        return max(lower - spare, 0.0), upper + spare


def settle(tubes: Tubes, draw: Draw) -> Settled | None:
    """Draw the faces, and cut cells further wherever that may settle what they connect.

    Args:
        tubes: The undecided cells; they are cut.
        draw: Returns the free faces between searched lines, of which blocks are no part; None if the start is in none.

    Raises:
        UnsupportedError: If time is up.
    """
    slice_ = tubes.searched.slice
    room, start = _room(slice_), slice_.start / slice_.scales
    walls: list[Line] = []
    closed: list[Block] = []
    for turn in range(_DRAWINGS):
        traced = tubes.lines()
        faces = draw((*traced, *walls), closed)
        near = tubes.around(start)
        if faces is None:
            if not len(near) or turn == _DRAWINGS - 1:
                return None
            tubes.cut(near)
            continue
        outline = tubes.outline()
        parts = tubes.parts(faces, outline)
        doubts = tubes.doubts(faces, _sides(slice_, faces), parts, start, room)
        finer = np.union1d(tubes.deeper(np.union1d(doubts.within, doubts.between)), near)
        finer = np.union1d(finer, tubes.deeper(tubes.hidden))
        if len(finer) and turn < _DRAWINGS // 2:
            tubes.cut(finer)
            continue
        open_ = [*tubes.blocks(doubts.within), *tubes.blocks(tubes.hidden)]
        new = [block for block in open_ if not any(block[0].equals(old) for old, _ in closed)]
        if not new or turn == _DRAWINGS - 1:
            break
        closed += new
        walls += [Line(name, name, True, gis.get_coordinates(shape.exterior), None) for shape, name in new]
    else:
        return None
    error = tubes.farthest((*traced, *walls), room, [shape for shape, _ in closed])
    blocks = _merged((*closed, *tubes.blocks(doubts.between)))
    return Settled(faces, (*traced, *walls), blocks, error, tubes, tuple(parts))


def _merged(blocks: Sequence[Block]) -> tuple[Block, ...]:
    """Return places that do not overlap, each with the name of the first of those that it holds."""
    places = gis.get_parts(gis.union_all([shape for shape, _ in blocks])) if blocks else ()
    return tuple((place, next(name for shape, name in blocks if shape.intersects(place))) for place in places)


def _room(slice_: Slice) -> Any:
    """Return what the limits and the window leave, as a polygon in units of `Slice.scales`."""
    return gis.Polygon(intersect((*slice_.box, *slice_.limits))[0] / slice_.scales)


def _sides(slice_: Slice, faces: Sequence[Any]) -> list[tuple[int, ...]]:
    """Return on which sides of the exact lines of one-angle contacts each face lies."""
    places = gis.get_coordinates(gis.point_on_surface(np.array(faces))) * slice_.scales
    turns = [np.floor((places @ strip.normal - strip.angle) / _TURN).astype(int) for strip in slice_.strips]
    return [tuple(int(turn[i]) for turn in turns) for i in range(len(faces))]
