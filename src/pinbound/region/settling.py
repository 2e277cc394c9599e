"""Faces of a drawing whose contact curves are known to within tubes: what is proven, and what is undecided.

The slice is drawn again with finer cells wherever the tubes do not decide whether two parts are connected, or whether
there is an island, until these cells are a hundredth of the stated width. What is then still undecided is reported. If
the drawing connects the parts there, a wall separates them: the region is the one in which the parts are separate.
`docs/regions-cells.md`.
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

_CUTS = 2  # rounds of cuts of undecided cells before the slice is drawn again
_DRAWINGS = 24
_TURN = 2.0 * np.pi


@dataclass(frozen=True, eq=False)
class Settled:
    """The faces of a slice, after its tubes were cut as far as this helped.

    Attributes:
        faces: The free faces, the start's first, in units of `Slice.scales` (as all fields).
        lines: Searched contours, and walls around undecided places.
        blocks: The undecided places: a polygon and the boundary's name.
        error: The largest distance of a searched contour from the lines.
        tubes: The undecided cells.
        parts: The parts of the faces that are proven free.
    """

    faces: tuple[Any, ...]
    lines: tuple[Line, ...]
    blocks: tuple[Block, ...]
    error: float
    tubes: Tubes
    parts: tuple[Part, ...]

    def areas(self, index: int, chord_error: float) -> tuple[float, float]:
        """Return proven bounds of the area of the component that one face represents.

        The lower bound is the largest proven part, for the first face the part with the start. The upper bound is all
        faces that tubes may connect with it, and these tubes. Smooth curves may have an error of `chord_error` along
        their whole length.

        Args:
            index: The face.
            chord_error: The error of the curves that need no search.
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
    """Draw the faces, and cut cells further if this may decide what they connect.

    Args:
        tubes: The undecided cells; they are cut.
        draw: Returns the free faces between searched lines, without the blocks; None if the start is in no face.

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
    """Return places that do not overlap, each with the name of the first given place inside it."""
    places = gis.get_parts(gis.union_all([shape for shape, _ in blocks])) if blocks else ()
    return tuple((place, next(name for shape, name in blocks if shape.intersects(place))) for place in places)


def _room(slice_: Slice) -> Any:
    """Return the set within the limits and the window, as a polygon in units of `Slice.scales`."""
    return gis.Polygon(intersect((*slice_.box, *slice_.limits))[0] / slice_.scales)


def _sides(slice_: Slice, faces: Sequence[Any]) -> list[tuple[int, ...]]:
    """Return for each face its sides of the exact lines of one-angle contacts."""
    places = gis.get_coordinates(gis.point_on_surface(np.array(faces))) * slice_.scales
    turns = [np.floor((places @ strip.normal - strip.angle) / _TURN).astype(int) for strip in slice_.strips]
    return [tuple(int(turn[i]) for turn in turns) for i in range(len(faces))]
