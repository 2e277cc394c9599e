"""Names in figures, placed where there is room: inside the axes, and not over each other.

Text sizes are estimated from the number of letters, so that the figure need not be drawn first. If there is no room for
the name of an edge, the legend has an entry instead.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, cast

import numpy as np
import shapely

from pinbound.figures.canvas import fit, grow, lay_out, width_of
from pinbound.figures.colours import ink
from pinbound.typing import Array

__all__ = ["Names", "draw_edge", "legend_of_short_edges", "name_edges", "resampled"]

gis = cast(Any, shapely)

_LETTER, _LINE = 0.62, 1.15  # width of a letter and height of a line, relative to the font size
_SHARES = (0.5, 0.35, 0.65, 0.2, 0.8)  # shares of an edge's length at which its name may be placed
_LONGER = 1.3  # a name may be longer by this factor than the straight line under it
_OFFSET = 11.0  # points from an edge to the middle of its name
_LINE_WIDTH = 1.5  # points: half of the line width of an edge
_SPOT = 7.0  # points: radius around a marker that names must not cover
_MOST_ENTRIES = 40  # largest number of entries in a legend
_CORNERS = ((1, 1), (1, -1), (-1, 1), (-1, -1))  # directions from a point in which its name may be placed


def resampled(points: Array, share: Array) -> Array:
    """Return points of a polyline (k, 2) at shares (N,) of its length.

    Example:
        >>> resampled(np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]), np.array([0.25, 0.75])).tolist()
        [[0.5, 0.0], [1.0, 0.5]]
    """
    steps = np.asarray(np.linalg.norm(np.diff(points, axis=0), axis=1), dtype=np.float64)
    length = np.concatenate((np.zeros(1), np.cumsum(steps)))
    x, y = (np.asarray(np.interp(share * length[-1], length, column), dtype=np.float64) for column in points.T)
    return np.column_stack((x, y))


@dataclass
class Names:
    """The names in one pair of axes, whose limits are already set.

    Attributes:
        axes: Matplotlib axes.
        taken: Areas that names must not cover: edges, markers, and names that are already placed [points].
    """

    axes: Any
    taken: list[Any] = field(default_factory=list[Any])

    def __post_init__(self) -> None:
        """Apply the aspect ratio of the axes, so that data can be converted to points."""
        self.axes.apply_aspect()
        per_point = 72.0 / self.axes.figure.dpi
        self._to_points = self.axes.transData
        self._factor = per_point
        box = self.axes.get_window_extent()
        self.frame = gis.box(*(per_point * np.array([box.x0, box.y0, box.x1, box.y1])))

    def points(self, data: Array) -> Array:
        """Return data (k, 2) in points of the figure, (k, 2)."""
        return self._factor * np.asarray(self._to_points.transform(data), dtype=np.float64)

    def along(self, name: str, edge: Array, inside: Array, colour: str, turned: bool, size: float = 10.0) -> bool:
        """Write a name along an edge (k, 2), on the side of the point `inside`; return whether there was room.

        If it is not `turned`, the name is horizontal and beside the edge.
        """
        width, height = _LETTER * size * len(name), _LINE * size
        line = self.points(edge)
        length = float(np.sum(np.linalg.norm(np.diff(line, axis=0), axis=1)))
        if length == 0.0:  # the image of an edge may be one point
            return False
        half = min(0.5, 0.5 * width / length)
        for share in _SHARES:
            ends = resampled(line, np.clip(np.array([share - half, share + half]), 0.0, 1.0))
            chord = float(np.linalg.norm(ends[1] - ends[0]))
            if chord == 0.0 or (turned and width > _LONGER * chord):
                continue
            place = resampled(line, np.array([share]))[0]
            direction = (ends[1] - ends[0]) / chord
            normal = np.array([direction[1], -direction[0]])
            inwards = normal * (1.0 if normal @ (self.points(inside[None])[0] - place) >= 0.0 else -1.0)
            angle = math.degrees(math.atan2(direction[1], direction[0])) if turned else 0.0
            offset = _OFFSET if turned else 0.5 * (width * abs(inwards[0]) + height * abs(inwards[1])) + 5.0
            if self._write(name, place, offset * inwards, angle, (width, height), colour, size, "bold"):
                return True
        return False

    def beside(self, name: str, place: Array, colour: str, size: float = 8.0) -> bool:
        """Write a name beside a point (2,), at one of its four corners; return whether there was room."""
        width, height = _LETTER * size * len(name), _LINE * size
        for across, up in _CORNERS:
            shift = np.array([across * (0.5 * width + 4.0), up * (0.5 * height + 2.0)])
            if self._write(name, self.points(place[None])[0], shift, 0.0, (width, height), colour, size, "normal"):
                return True
        return False

    def _write(
        self,
        name: str,
        place: Array,
        shift: Array,
        angle: float,
        extent: tuple[float, float],
        colour: str,
        size: float,
        weight: str,
    ) -> bool:
        upright = angle - 180.0 if angle > 91 else angle + 180.0 if angle < -89 else angle
        box = _box(place + shift, extent, upright)
        if not self.frame.contains(box) or any(box.intersects(one) for one in self.taken):
            return False
        self.taken.append(box)
        at = self._to_points.inverted().transform(place / self._factor)
        self.axes.annotate(
            name,
            at,
            xytext=tuple(shift.tolist()),
            textcoords="offset points",
            rotation=upright,
            rotation_mode="anchor",
            ha="center",
            va="center",
            color=ink(colour),
            fontsize=size,
            weight=weight,
            zorder=6,
        )
        return True


def _box(middle: Array, extent: Sequence[float], angle: float) -> Any:
    """Return the box of a text around its middle, rotated by an angle [deg]."""
    c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    corners = 0.5 * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * extent
    return gis.Polygon(middle + corners @ np.array([[c, s], [-s, c]]))


def draw_edge(axes: Any, points: Array, style: Mapping[str, Any], linewidth: float = 3.0) -> None:
    """Draw an edge (k, 2) of a region, or its image."""
    axes.plot(*points.T, **style, linewidth=linewidth, solid_capstyle="butt", zorder=3)


def name_edges(
    axes: Any,
    edges: Iterable[tuple[str, Array, Mapping[str, Any]]],
    inside: Array,
    turned: bool,
    is_new: bool,
    spots: Iterable[Array] = (),
) -> list[Any]:
    """Write each edge's name along the edge; return legend lines for edges whose names have no room.

    Args:
        axes: The axes, with their limits set.
        edges: Name, points (k, 2) and style of each edge.
        inside: (2,) a point on the side of the names.
        turned: Whether names are rotated to the direction of their edges, for axes with equal scales.
        is_new: Whether pinbound made the figure, so that it may be laid out first.
        spots: Places (2,) of markers that names must not cover.
    """
    if is_new:
        lay_out(axes)  # layout changes the size of the axes
    names, edges = Names(axes), list(edges)
    names.taken += [gis.buffer(gis.LineString(names.points(points)), _LINE_WIDTH) for _, points, _ in edges]
    names.taken += [gis.Point(names.points(spot[None])[0]).buffer(_SPOT) for spot in spots]
    all_of = sorted(edges, key=lambda edge: -_length(edge[1]))
    written = {name for name, points, style in all_of if names.along(name, points, inside, style["color"], turned)}
    left = {name: style for name, _, style in all_of if name not in written}
    return [axes.plot([], [], **style, linewidth=3.0, label=name)[0] for name, style in sorted(left.items())]


def _length(points: Array) -> float:
    return float(np.sum(np.linalg.norm(np.diff(points, axis=0), axis=1)))


def legend_of_short_edges(axes: Any, handles: Sequence[Any], is_new: bool) -> None:
    """Add a second legend, to the right of the axes, for edges that have no room for their names.

    Args:
        axes: The axes.
        handles: Lines with labels; if there are none, there is no second legend.
        is_new: Whether pinbound made the figure, so that it must be laid out again.
    """
    if not handles:
        return
    width = width_of(axes)
    first, shown = axes.get_legend(), list(handles[:_MOST_ENTRIES])
    if len(handles) > _MOST_ENTRIES:
        shown += axes.plot([], [], linestyle="none", label=f"and {len(handles) - _MOST_ENTRIES} more")
    title = "edges without room\nfor a name"
    axes.legend(
        handles=shown,
        loc="upper left",
        bbox_to_anchor=(1.01, 1.0),
        frameon=False,
        fontsize=8,
        title=title,
        title_fontsize=8,
        alignment="left",
    )
    if first is not None:
        axes.add_artist(first)
        first.set_clip_on(False)  # the layout leaves room only for artists that are not clipped
    if is_new:
        grow(axes, width)  # names were placed for axes of this size
        fit(axes)
