"""Curves at which contact of a boundary of several angles begins: zeros of one smooth function, or of several.

Two points, a point and a line, and a height above a plane have one smooth contact function, whose zeros are traced
(`contours`). The distance of segments is piecewise smooth: each piece is the distance of a point from an end, or from
the whole line of a segment if the foot lies between the ends. Each piece is traced as a whole, and so are the curves on
which the foot is at an end. Between all these curves the state (contact or free) does not change, so one exact
evaluation in each face decides. The contour of the faces in contact is the contact curve. `docs/segments.md` proves
that no feature is missing. Bodies that only translate relative to each other have one convex curve, for all kinds of
bodies (`sliding`).

All lengths are in units of `Slice.scales`: a chain over `y = x / s` is the chain over x with its slides and
coefficients multiplied by s.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, cast

import numpy as np
import shapely

from pinbound.annotations import Line as LineMark
from pinbound.annotations import Mark, Point
from pinbound.annotations import Plane as PlaneMark
from pinbound.boundaries.boundary import Boundary
from pinbound.evaluate import separation
from pinbound.exceptions import UnsupportedError
from pinbound.loops.through_loops import LoopContact, LoopLimit
from pinbound.path.chain import Chain
from pinbound.path.kind import Case
from pinbound.path.relative import RelativePath, relative_path
from pinbound.path.restriction import restrict_path
from pinbound.region.contours import ContactFunction, HeightFunction, Traced, trace
from pinbound.region.deadline import Deadline
from pinbound.region.lines import Line, segment_owners, vertex_owners
from pinbound.region.loop_slice import over
from pinbound.region.slice import Curve, Slice
from pinbound.region.sliding import SlidingFunction, only_slides, sliding_curves
from pinbound.tolerances import CONTOUR_ROUNDING, REDUCTION
from pinbound.typing import Array, Ints

__all__ = ["Outline", "check_turns", "is_searched", "outline"]

_INSET = 0.015  # of the window's side: more than a bump that tracing may miss (BUMP), less than the margin
_FEW = 16  # vertices above a plane that are traced one by one
_MOST_TURNS = 100  # periods of the angles in the window: with more, tracing would only use up its budget of boxes

gis = cast(Any, shapely)  # its stubs know only part of what its functions take


@dataclass(frozen=True, eq=False)
class Outline:
    """The curves in a window at which contact of one boundary begins.

    Attributes:
        lines: Their pieces, each with the function that is zero on it.
        chord_error: The largest distance of a curve from its polyline.
        unresolved: (u, 2) centres of tiny boxes in which a curve may cross itself.
        step: (2,) sides of these boxes.
    """

    lines: tuple[Line, ...]
    chord_error: float
    unresolved: Array
    step: Array


def outline(slice_: Slice, curve: Curve, window: Array, accuracy: float, deadline: Deadline | None = None) -> Outline:
    """Return the curves in a window (2, 2) at which contact begins, to an accuracy, in units of `Slice.scales`.

    Raises:
        UnsupportedError: If a curve is degenerate (`contours.trace`), the window holds too many turns, or time is up.
    """
    if only_slides(curve.path):
        sliding = SlidingFunction(curve.path, curve.threshold, slice_.scales)
        drawn, error = sliding_curves(sliding, window, accuracy, deadline)
        pieces = tuple(Line(curve.name, curve.name, True, points, sliding) for points in drawn)
        return Outline(pieces, error, np.empty((0, 2)), np.zeros(2))
    check_turns(slice_, curve)
    functions = _functions(slice_, curve, window)
    contours = [trace(function, window, accuracy, deadline) for function in functions]
    lines = tuple(
        Line(curve.name, curve.name, True, points, function)
        for function, contour in zip(functions, contours, strict=True)
        for points in contour.lines
    )
    error = max((contour.chord_error for contour in contours), default=0.0)
    unresolved = np.concatenate([contour.unresolved for contour in contours])
    if len(functions) > 1:
        lines = _between(slice_, curve, lines, window) if lines else ()
        unresolved = _near_contact(slice_, curve, unresolved, contours[0].step)
    return Outline(lines, error, unresolved, contours[0].step)


def is_searched(slice_: Slice, curve: Curve | LoopContact | LoopLimit) -> bool:
    """Return whether the contact curves are not among the zeros of known smooth functions, because edges may meet.

    This holds for boxes, prisms and skew segments that rotate by several angles; `cells` handles them. It also holds
    for boundaries through loops that are not parallelograms, because their derivatives have no bound for the whole
    window.
    """
    if not isinstance(curve, Curve):
        return True
    path = curve.path
    if not path.difference.directions or only_slides(path):
        return False
    return _SEARCHED[path.case](path, _segments(slice_.robot.boundaries[curve.name]))


def _has_many_vertices(path: RelativePath, segments: Sequence[Mark]) -> bool:
    return math.prod(len(corners) for corners in path.difference.corners) > _FEW


def _may_meet_edge_to_edge(path: RelativePath, segments: Sequence[Mark]) -> bool:
    return len(segments) != len(path.difference.directions) or (len(segments) > 1 and not _is_flat(path))


_SEARCHED: Mapping[Case, Callable[[RelativePath, Sequence[Mark]], bool]] = {
    Case.BODIES: _may_meet_edge_to_edge,
    Case.LINE: lambda path, segments: True,
    Case.PLANE: _has_many_vertices,
}


def _segments(boundary: Boundary) -> list[Mark]:
    """Return the marks of a boundary that are segments."""
    return [mark for mark in (boundary.point_a, boundary.point_b) if mark.shape.is_segment]


def _near_contact(slice_: Slice, curve: Curve, centres: Array, step: Array) -> Array:
    """Return the boxes in which contact may begin; curves with a foot at an end also cross at other places.

    From the middle of a box to its corner, the separation changes by at most the lever arms.
    """
    if not len(centres):
        return centres
    arms = [
        ContactFunction.over(_scaled(slice_, corner), 0.0, np.array([centres.min(axis=0), centres.max(axis=0)])).arms
        for corner in curve.path.difference.vertex_chains
    ]
    most = np.max([arm.first for arm in arms], axis=0)
    values = separation.separations(curve.path, centres * slice_.scales)
    reach = float(most @ step) + CONTOUR_ROUNDING * max(arm.length for arm in arms)
    return centres[np.abs(values - curve.threshold) <= reach]


def check_turns(slice_: Slice, curve: Curve | LoopContact | LoopLimit) -> None:
    """Raise if a window contains so many turns that the contacts, which repeat every turn, cannot all be drawn."""
    most = (
        curve.fastest
        if not isinstance(curve, Curve)
        else np.abs(curve.path.minimal.coefficients).max(axis=0, initial=0.0)
    )
    turns: Array = (slice_.window[1] - slice_.window[0]) * most / (2.0 * np.pi)
    if float(np.prod(np.maximum(turns, 1.0))) > _MOST_TURNS:
        axis = int(np.argmax(turns))
        name, (low, high) = slice_.coordinates[axis], slice_.window[:, axis].tolist()
        raise UnsupportedError(
            f"the window is very wide: {name!r} reaches from {low:.6g} to {high:.6g} rad, and the contacts of "
            f"{curve.name!r} repeat every turn; give a smaller window, window={{{name!r}: (lower, upper)}} around the "
            f"start (on the command line --window {name}=LOWER..UPPER)"
        )


def _scaled(slice_: Slice, chain: Chain) -> Chain:
    """Return a chain over the slice's coordinates as a chain over these coordinates in units of its scales."""
    s = slice_.scales
    return replace(chain, slides=chain.slides * s, coefficients=chain.coefficients * s)


def _functions(slice_: Slice, curve: Curve, window: Array) -> list[Traced]:
    """Return the smooth functions whose zeros include all contact curves, and all places where the feature changes."""
    return _FUNCTIONS[curve.path.case](slice_, curve, window)


def _distance(slice_: Slice, curve: Curve, window: Array) -> list[Traced]:
    path = curve.path
    return [ContactFunction.over(_scaled(slice_, path.minimal), curve.threshold, window, path.projection)]


def _heights(slice_: Slice, curve: Curve, window: Array) -> list[Traced]:
    path, T = curve.path, curve.threshold
    return [_height(path, _scaled(slice_, corner), T, window) for corner in path.difference.vertex_chains]


def _features(slice_: Slice, curve: Curve, window: Array) -> list[Traced]:
    """Return the distances of ends of segments from each other and from lines, and the places with a foot at an end."""
    path, T = curve.path, curve.threshold
    boundary = slice_.robot.boundaries[curve.name]
    segments = _segments(boundary)
    found: list[Traced] = [
        ContactFunction.over(_scaled(slice_, corner), T, window) for corner in path.difference.vertex_chains
    ]
    for segment in segments:
        other = boundary.point_b if segment is boundary.point_a else boundary.point_a
        first, last = segment.shape.vertices
        along = tuple((last - first).tolist())
        for xyz in other.shape.vertices.tolist():
            end = Point("", other.link, tuple(xyz))
            line = _seen(slice_, LineMark("", segment.link, tuple(first.tolist()), along), end)
            found.append(ContactFunction.over(_scaled(slice_, line.minimal), T, window, line.projection))
            for foot in (first, last):  # the foot on the line is at an end of the segment
                plane = _seen(slice_, PlaneMark("", segment.link, tuple(foot.tolist()), along), end)
                found.append(_height(plane, _scaled(slice_, plane.minimal), 0.0, window))
    return [function for function in found if function.chain.coordinates]


_FUNCTIONS: Mapping[Case, Callable[[Slice, Curve, Array], list[Traced]]] = {
    Case.POINTS: _distance,
    Case.BODIES: _features,
    Case.LINE: _distance,
    Case.PLANE: _heights,
}


def _seen(slice_: Slice, mark: Mark, end: Point) -> RelativePath:
    """Return the path between a line or plane and a point, in the slice."""
    robot, at = over(slice_.robot, slice_.at)
    path = relative_path(robot.tree, robot.coupling, mark, end)
    return restrict_path(path, at, [robot.coordinates.index(name) for name in slice_.coordinates])


def _height(path: RelativePath, chain: Chain, threshold: float, window: Array) -> HeightFunction:
    return HeightFunction.over(chain, path.height_row(), threshold, window)


def _is_flat(path: RelativePath) -> bool:
    """Return whether two segments stay normal to the axis of all rotations, so that their lines keep a distance."""
    chain = path.minimal
    along = [float(np.abs(np.sum(edge, axis=0) @ chain.axes[0])) for edge in path.difference.directions]
    return chain.is_planar and max(along) <= REDUCTION


def _between(slice_: Slice, curve: Curve, lines: tuple[Line, ...], window: Array) -> tuple[Line, ...]:
    """Return the pieces of lines that separate contact from free."""
    rim = window + _INSET * (window[1] - window[0]) * np.array([[1.0], [-1.0]])  # traced curves cross it completely
    (x, y), (u, v) = rim
    frame = gis.linestrings([(x, y), (u, y), (u, v), (x, v), (x, y)])
    noded = gis.union_all([frame, *(gis.linestrings(line.points) for line in lines)])
    faces = np.asarray(gis.get_parts(gis.polygonize(gis.get_parts(noded))))
    inside = gis.get_coordinates(gis.point_on_surface(faces))
    contact = gis.union_all(faces[~curve.free(inside * slice_.scales)])
    keys, owners = vertex_owners(lines)
    pieces: list[Line] = []
    for ring in gis.get_parts(gis.boundary(contact)):
        points = gis.get_coordinates(ring)
        if len(points) > 1:
            pieces += _pieces(lines, points, segment_owners(lines, keys, owners, points), rim)
    return tuple(pieces)


def _pieces(lines: tuple[Line, ...], points: Array, owner: Ints, rim: Array) -> list[Line]:
    """Cut a polyline where its owner changes, and leave out the pieces along the margin."""
    middle = 0.5 * (points[1:] + points[:-1])
    at_rim = np.any(np.abs(middle[:, None] - rim) <= REDUCTION * (1.0 + np.abs(rim)), axis=(1, 2))
    kind = np.where(at_rim, -1, owner)
    breaks = [0, *(np.flatnonzero(np.diff(kind)) + 1).tolist(), len(kind)]
    return [
        Line(line.name, line.source, True, points[start : stop + 1], line.function)
        for start, stop in pairwise(breaks)
        if kind[start] >= 0
        for line in (lines[int(kind[start])],)
    ]
