"""Faces of a slice between limits and contact curves: the connected components, with named edges.

All lines and traced curves are cut where they cross, and GEOS finds the faces between them. No curve passes through the
interior of a face. So a face is either completely free or not free at all, and one exact evaluation inside decides.
Free faces are the connected components. Each piece of the contour of a face has the name of its curve. Where two names
meet, the corner is computed from the two exact functions.

At a point where a contact curve may cross or touch itself, a box of 1e-8 of the window is undecided (`contours`). Its
interior counts as not free, so the parts on both sides of it are separate. `Arrangement.joined_area` is the area if
they are in fact connected.

Everything here is in units of `Slice.scales`; results (`arranged_loops`, `drawn`) are in radians and metres.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, cast

import numpy as np
import shapely

from pinbound.exceptions import UnsupportedError
from pinbound.region.cells import Grid, Searched
from pinbound.region.contours import BUMP
from pinbound.region.deadline import Deadline
from pinbound.region.halfplanes import HalfPlane
from pinbound.region.lines import Line, segment_owners, vertex_owners
from pinbound.region.obstacles import obstacle_sides
from pinbound.region.outlines import check_turns, is_searched, outline
from pinbound.region.settling import Settled, settle
from pinbound.region.slice import Curve, Slice, Strips
from pinbound.region.tubes import Tubes
from pinbound.region.turn_cuts import cuts_of
from pinbound.tolerances import REGION_WIDTH, VERTEX
from pinbound.typing import Array, Ints
from pinbound.values import Value

__all__ = ["Arrangement", "Corner", "Edge", "Unresolved", "arrange", "arranged_loops"]

gis = cast(Any, shapely)  # its stubs know only part of what its functions take

_BEYOND = 0.02  # of the window: curves are traced this far beyond it; a bump without a corner is lower
assert _BEYOND > BUMP * (1.0 + 2.0 * _BEYOND)
_NEWTON = 30
_WALL = 3.0  # steps between an undecided box and the wall around it
_MOST_UNDECIDED = 20_000
_MOST_LINES = 500
_TURN = 2.0 * np.pi


@dataclass(frozen=True, eq=False)
class Edge(Value):
    """An edge of a region, with the name of its boundary or joint limit, and its points.

    Attributes:
        name: Boundary name, or joint and end, e.g. ``"q2 upper"``.
        source: Boundary name, or joint name.
        is_contact: True for a boundary, False for a joint limit.
        start: (2,) [rad or m].
        end: (2,) [rad or m]; the region lies to the left of start -> end. It equals start if the edge is a closed
            curve.
        points: (k, 2) polyline from start to end; two points for a straight edge.

    Example:
        >>> import pinbound as pb
        >>> edge = pb.feasible_region(pb.load("minervabot_v3")).edges[0]
        >>> edge.name, edge.is_contact, edge.points.shape
        ('beta_7', True, (2, 2))
    """

    name: str
    source: str
    is_contact: bool
    start: Array
    end: Array
    points: Array


@dataclass(frozen=True, eq=False)
class Corner(Value):
    """The point where two edges of a region meet.

    Attributes:
        point: (2,) [rad or m].
        before: Name of the edge that ends here.
        after: Name of the edge that starts here.
        polished: Whether the point solves both contact equations to `tolerances.VERTEX`. It is False only where the two
            curves are nearly tangent; then the point has the region's accuracy.

    Example:
        >>> import pinbound as pb
        >>> corner = pb.feasible_region(pb.load("minervabot_v3")).corners[0]
        >>> corner.before, corner.after, corner.polished
        ('beta_8', 'beta_7', True)
    """

    point: Array
    before: str
    after: str
    polished: bool


@dataclass(frozen=True)
class Unresolved:
    """A place too small to resolve, in which a contact curve may cross or only touch itself.

    Attributes:
        name: The boundary.
        point: The two coordinates of its middle [rad or m].
        width: Its largest extent [rad or m].
        joins: Whether this part and another part meet there. They may be connected by a passage of zero width. The
            region assumes that contact separates them.
    """

    name: str
    point: tuple[float, float]
    width: float
    joins: bool


@dataclass(frozen=True, eq=False)
class Arrangement(Value):
    """The free faces of a slice.

    Attributes:
        plane: The slice.
        lines: Every line and curve, in units of `Slice.scales`.
        faces: Free faces as `shapely.Polygon`, counter-clockwise, in the same units; first the face with the start,
            then the largest first.
        chord_error: The largest distance of a contact curve from its polyline, in the same units.
        smooth_error: The same for smooth curves, which need no search.
        blocks: Undecided places in the same units: a polygon and the name of the boundary.
        settled: The undecided cells of contacts that need a search; None if there are none.
    """

    slice: Slice
    lines: tuple[Line, ...]
    faces: tuple[Any, ...]
    chord_error: float
    smooth_error: float
    blocks: tuple[tuple[Any, str], ...]
    settled: Settled | None = None

    @cached_property
    def drawn(self) -> tuple[Line, ...]:
        """The lines with their points in radians and metres."""
        return tuple(replace(line, points=line.points * self.slice.scales) for line in self.lines)

    def _at(self, block: Any, face: Any) -> bool:
        return bool(gis.intersects(block, face))

    def unresolved(self, index: int) -> tuple[Unresolved, ...]:
        """Return the undecided places on the contour of one face."""
        found: list[Unresolved] = []
        for block, name in self.blocks:
            if self._at(block, self.faces[index]):
                west, south, east, north = block.bounds
                point = np.array([west + east, south + north]) / 2.0 * self.slice.scales
                width = float(np.max(np.array([east - west, north - south]) * self.slice.scales))
                joins = any(self._at(block, face) for i, face in enumerate(self.faces) if i != index)
                found.append(Unresolved(name, (float(point[0]), float(point[1])), width, joins))
        return tuple(found)

    def joined_area(self, index: int) -> float:
        """Return the area [product of the units] of a face with all parts that undecided places may connect to it."""
        reached, news = {index}, [index]
        while news:
            face = self.faces[news.pop()]
            for block, _ in self.blocks:
                if self._at(block, face):
                    more = [i for i, other in enumerate(self.faces) if i not in reached and self._at(block, other)]
                    reached |= set(more)
                    news += more
        return float(sum(self.faces[i].area for i in sorted(reached))) * float(np.prod(self.slice.scales))

    def area_interval(self, index: int) -> tuple[float, float] | None:
        """Return proven bounds of the area of the component of a face, if contacts need a search."""
        if self.settled is None:
            return None
        unit = float(np.prod(self.slice.scales))
        lower, upper = self.settled.areas(index, self.smooth_error)
        return lower * unit, upper * unit


def arrange(
    slice_: Slice, accuracy: float, deadline: Deadline | None = None, width: float | None = None
) -> Arrangement:
    """Return the free faces of a slice, with contact curves traced to an accuracy in units of `Slice.scales`.

    If the start is too near to contact for the accuracy, a finer accuracy is used. Contacts that need a search
    are enclosed in cells of this width; None: `REGION_WIDTH`, or wider if there would be too many cells.

    Raises:
        UnsupportedError: If a contact curve is degenerate (`contours.trace`), if the window holds too many turns, if
            the start is too near to contact even then, if there are too many cells, or if the time is spent.
    """
    searched = tuple(curve for curve in slice_.curves if is_searched(slice_, curve))
    tubes = None
    if searched:
        for curve in searched:
            check_turns(slice_, curve)
        asked = REGION_WIDTH if width is None else width
        tubes = Tubes(Searched(slice_, searched, Grid.over(_wide(slice_), asked)), asked, deadline, width is None)
    finest = accuracy
    for finer in (1.0, 1e-2, 1e-4):
        finest = accuracy * finer
        found = _arranged(slice_, finest, tubes, deadline)
        if found is not None:
            return found
        if len(slice_.curves) == len(searched):
            break
    raise UnsupportedError(
        f"the start point {slice_.start.tolist()} is free, but it is nearer to contact than the accuracy of "
        f"{finest:.3g} "
        "can decide; give a smaller accuracy, or start elsewhere"
    )


def _wide(slice_: Slice) -> Array:
    """Return the window in which curves are traced, rows lower and upper, in units of `Slice.scales`."""
    low, high = slice_.window / slice_.scales
    return np.array([low - _BEYOND * (high - low), high + _BEYOND * (high - low)])


def _arranged(slice_: Slice, accuracy: float, tubes: Tubes | None, deadline: Deadline | None) -> Arrangement | None:
    """Return the faces, or None if the start cannot be distinguished from contact at this accuracy."""
    wide = _wide(slice_)
    sides = [_scaled(limit, slice_.scales) for limit in (*slice_.box, *slice_.limits)]
    lines = [_straight(wide, side, side) for side in sides]
    lines += _strip_lines(slice_, wide)
    for obstacle in slice_.obstacles:
        for side, ends in obstacle_sides(obstacle, wide, slice_.scales):
            lines.append(Line(side.name, side.source, False, ends, side))
    error, blocks = 0.0, list[tuple[Any, str]]()
    if slice_.lifted is not None:
        for cut in cuts_of(slice_.lifted, slice_.scales, wide, accuracy, deadline):
            lines.append(Line(cut.name, cut.name, False, cut.points, cut.function))
            error = max(error, cut.chord_error)
    for curve in slice_.curves if deadline is None else deadline.each(slice_.curves):
        if tubes is not None and curve in tubes.searched.curves:
            continue
        assert isinstance(curve, Curve)  # all others need a search
        found = outline(slice_, curve, wide, accuracy, deadline)
        error = max(error, found.chord_error)
        lines += found.lines
        for block in _blocks(found.unresolved, found.step):
            blocks.append((block, curve.name))
            if found.lines:
                wall = gis.get_coordinates(block.exterior)
                lines.append(Line(curve.name, curve.name, True, wall, found.lines[0].function))
            error = max(error, float(np.hypot(*np.subtract(block.bounds[2:], block.bounds[:2]))))
    fixed = tuple(line for line in lines if line is not None)
    if tubes is None:
        faces = _free_faces(slice_, fixed, blocks, accuracy)
        return None if faces is None else Arrangement(slice_, fixed, faces, error, error, tuple(blocks))
    settled = settle(tubes, lambda more, open_: _free_faces(slice_, (*fixed, *more), [*blocks, *open_], accuracy))
    if settled is None:
        return None
    kept, blocks = (*fixed, *settled.lines), [*blocks, *settled.blocks]
    return Arrangement(slice_, kept, settled.faces, max(error, settled.error), error, tuple(blocks), settled)


def _free_faces(
    slice_: Slice, lines: Sequence[Line], blocks: Sequence[tuple[Any, str]], accuracy: float
) -> tuple[Any, ...] | None:
    """Return the free faces between lines: the start's face first, then the largest; None if the start is in none."""
    faces = gis.polygonize(gis.get_parts(gis.union_all([gis.linestrings(x.points) for x in lines])))
    polygons = np.asarray(gis.get_parts(faces))
    inside = gis.get_coordinates(gis.point_on_surface(polygons))
    free = slice_.free(inside * slice_.scales)
    for block, _ in blocks:
        near = np.flatnonzero(free)
        free[near] &= ~gis.contains_xy(block, inside[near])
    thick = gis.area(polygons) > accuracy * gis.length(polygons) / 2.0
    away = np.where(free, gis.distance(polygons, gis.Point(slice_.start / slice_.scales)), np.inf)
    home = int(np.argmin(away))
    if away[home] > VERTEX:
        return None
    rest = [i for i in np.argsort(-gis.area(polygons)).tolist() if free[i] and thick[i] and i != home]
    return tuple(gis.orient_polygons(polygons[[home, *rest]]))


def _scaled(half: HalfPlane, scales: Array) -> HalfPlane:
    return replace(half, normal=half.normal * scales)


def _strip_lines(slice_: Slice, wide: Array) -> list[Line | None]:
    """Return the lines at which strips begin or end.

    Raises:
        UnsupportedError: If there are too many turns to draw them all.
    """
    corners = wide[[0, 0, 1, 1], 0][:, None] * [1, 0] + wide[[0, 1, 0, 1], 1][:, None] * [0, 1]
    ranges: list[tuple[Strips, HalfPlane, float, float]] = []
    turns = 0.0
    for strip in slice_.strips:
        half = HalfPlane(strip.name, strip.name, strip.normal * slice_.scales, 0.0, True)
        values = corners @ half.normal
        ranges.append((strip, half, float(values.min()), float(values.max())))
        turns += (ranges[-1][3] - ranges[-1][2]) / _TURN * (1.0 if strip.half_width == 0.0 else 2.0)
    if turns > _MOST_LINES:
        (x0, y0), (x1, y1) = slice_.window.tolist()
        x, y = slice_.coordinates
        raise UnsupportedError(
            f"the window is very wide: {x!r} reaches from {x0:.6g} to {x1:.6g} and {y!r} from {y0:.6g} to {y1:.6g}, "
            f"where contacts, which repeat every turn, begin or end on {turns:.0f} lines; give a smaller window around "
            f"the start, e.g. window={{{x!r}: (lower, upper)}} (on the command line --window {x}=LOWER..UPPER)"
        )
    return [
        _straight(wide, replace(half, bound=bound))
        for strip, half, lowest, highest in ranges
        for bound in strip.lines(lowest, highest)
    ]


def _blocks(centres: Array, step: Array) -> list[Any]:
    """Return polygons around boxes; boxes that are next to each other share a polygon."""
    if not len(centres):
        return []
    if len(centres) > _MOST_UNDECIDED:
        raise UnsupportedError(
            f"whether there is contact stays undecided in {len(centres)} tiny boxes: somewhere the clearance touches "
            "zero along a curve; change min_distance slightly, or give a smaller window"
        )
    reach = (_WALL + 0.5) * step
    whole = gis.union_all(gis.box(*(centres - reach).T, *(centres + reach).T))
    return [gis.Polygon(part.exterior) for part in gis.get_parts(whole)]


def _straight(wide: Array, half: HalfPlane, limit: HalfPlane | None = None) -> Line | None:
    """Return the part of `normal @ x = bound` in the wide window, or None if the line misses the window."""
    normal = half.normal
    foot = normal * (half.bound / float(normal @ normal))
    direction = np.array([-normal[1], normal[0]])
    span = [-np.inf, np.inf]
    for axis in (0, 1):
        if direction[axis] == 0.0:
            if not wide[0, axis] <= foot[axis] <= wide[1, axis]:
                return None
            continue
        ends = sorted((float(wide[side, axis]) - foot[axis]) / direction[axis] for side in (0, 1))
        span = [max(span[0], ends[0]), min(span[1], ends[1])]
    if not span[0] < span[1]:
        return None
    points = foot + np.array(span)[:, None] * direction
    return Line(half.name, half.source, half.is_contact, points, half)


def arranged_loops(
    arrangement: Arrangement, polygon: Any, accuracy: float
) -> tuple[tuple[tuple[Edge, ...], ...], tuple[Corner, ...]]:
    """Return the loops of named edges of a face, the exterior first, and its corners, in radians and metres."""
    lines, scales = arrangement.lines, arrangement.slice.scales
    keys, owners = vertex_owners(lines)
    loops: list[tuple[Edge, ...]] = []
    corners: list[Corner] = []
    for ring in (polygon.exterior, *polygon.interiors):
        coordinates = gis.get_coordinates(ring)
        owner = segment_owners(lines, keys, owners, coordinates)
        edges, met = _edges(lines, coordinates[:-1], owner, accuracy)
        loops.append(
            tuple(replace(e, start=e.start * scales, end=e.end * scales, points=e.points * scales) for e in edges)
        )
        corners += [replace(corner, point=corner.point * scales) for corner in met]
    return tuple(loops), tuple(corners)


def _edges(lines: Sequence[Line], ring: Array, owner: Ints, accuracy: float) -> tuple[tuple[Edge, ...], list[Corner]]:
    """Cut a ring (open, counter-clockwise) where the curve changes; Newton's method refines the corners."""
    names = [line.name if not isinstance(line.function, HalfPlane) else "" for line in lines]
    curve = np.array([names.index(name) if name else place for place, name in enumerate(names)])[owner]
    breaks = np.flatnonzero(curve != np.roll(curve, 1))
    if not len(breaks):
        line = lines[int(owner[0])]
        closed = np.concatenate((ring, ring[:1]))
        return (Edge(line.name, line.source, line.is_contact, ring[0], ring[0], closed),), []
    corners: list[Corner] = []
    moved: list[float] = []
    for place in breaks.tolist():
        before, after = lines[int(owner[place - 1])], lines[int(owner[place])]
        point, polished = _polish(before, after, ring[place], accuracy)
        corners.append(Corner(point, before.name, after.name, polished))
        moved.append(float(np.linalg.norm(point - ring[place])))
    edges: list[Edge] = []
    for i, place in enumerate(breaks.tolist()):
        j = (i + 1) % len(breaks)
        stop = int(breaks[j]) if j > i else int(breaks[j]) + len(ring)
        line = lines[int(owner[place])]
        inner = ring[np.arange(place + 1, stop) % len(ring)]
        start, end = corners[i].point, corners[j].point
        straight = isinstance(line.function, HalfPlane)
        far = np.linalg.norm(inner - start, axis=1) > 3.0 * moved[i]
        far &= np.linalg.norm(inner - end, axis=1) > 3.0 * moved[j]
        inner = inner[far & (not straight)]
        points = np.concatenate((start[None], inner, end[None]))
        edges.append(Edge(line.name, line.source, line.is_contact, start, end, points))
    return tuple(edges), corners


def _polish(a: Line, b: Line, x: Array, accuracy: float) -> tuple[Array, bool]:
    """Solve both functions by Newton's method from the crossing of their polylines; keep that if it diverges."""
    point = x
    limit = np.sqrt(accuracy)
    for _ in range(_NEWTON):
        (va, ga), (vb, gb) = a.value_gradient(point), b.value_gradient(point)
        determinant = float(ga[0] * gb[1] - ga[1] * gb[0])
        if abs(determinant) <= 1e-9 * float(np.linalg.norm(ga) * np.linalg.norm(gb)):
            return x, False
        step = np.array([gb[1] * va - ga[1] * vb, ga[0] * vb - gb[0] * va]) / determinant
        point = point - step
        if not np.linalg.norm(point - x) <= limit:
            return x, False
        if np.linalg.norm(step) <= VERTEX:
            return point, True
    return x, False
