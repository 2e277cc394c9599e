"""Bodies of a link and the marks that hold them, from three sides; and how far the marks stick out, as colours.

On the left, the bodies are grey under their translucent marks. Next to them is the outer surface of the marks, seen
from either side; each point has the colour of its distance from the bodies. All panels of a figure have one scale, and
all figures of a report have one scale of colours.

The outline of a mark is the hull of its projected vertices with its radius around it. Its arcs are drawn by chords,
which are inside by 0.03 % of the radius. Parts of bodies outside all marks are blue.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, cast

import numpy as np
import shapely

from pinbound.annotations import Mark
from pinbound.coverage.bodies import Body
from pinbound.extras import Needs
from pinbound.figures.canvas import without_math
from pinbound.figures.colours import PALETTE
from pinbound.figures.cover_surfaces import PIXELS, Seen, View, body_triangles, seen
from pinbound.meshes import Mesh
from pinbound.typing import Array
from pinbound.values import Value

__all__ = ["CoverPicture", "draw_cover", "outline_of", "picture_of"]

gis = cast(Any, shapely)

_BODY, _OUT, _LINE = "#A9B4BF", "#0033CC", "#3C4650"
_ADDED = "#F6B8A8"
_COLOURS = "YlOrRd"
_ROUND = 32  # corners of a quarter circle
_MOST_TRIANGLES = 20_000  # drawn one by one: more take seconds and show nothing more
_MARGIN = 0.06
_LEAST_SCALE = 0.1  # mm: a shorter scale of colours would show rounding
_WIDTH, _LEFT, _GAP, _RIGHT, _TOP, _LABELS = 13.0, 0.75, 0.6, 0.95, 0.9, 0.65  # inches
_TALLEST = 3.6  # inches of a row


@dataclass(frozen=True, eq=False)
class CoverPicture(Value):
    """The content of a figure of one link.

    Attributes:
        link: Its name.
        bodies: Its bodies.
        meshes: For each body, its mesh in the link's frame; None for other bodies, and for meshes that are not read.
        marks: Bounded marks on the link.
        views: The outer surface of the marks along three axes.
    """

    link: str
    bodies: tuple[Body, ...]
    meshes: tuple[Mesh | None, ...]
    marks: tuple[Mark, ...]
    views: tuple[Seen, ...]

    @property
    def furthest(self) -> float:
        """[m], the largest visible distance from the bodies; 0 if no body is known."""
        return max((float(np.nanmax(one.away, initial=0.0)) for one in self.views), default=0.0)


def picture_of(
    link: str, bodies: Sequence[Body], meshes: Sequence[Mesh | None], marks: Sequence[Mark], pixels: int = PIXELS
) -> CoverPicture:
    """Return the content of `draw_cover` for a link, computed.

    Args:
        link: Its name.
        bodies: Its bodies.
        meshes: For each body, its mesh in the link's frame; None for other bodies, and for meshes that are not read.
        marks: Bounded marks on the link.
        pixels: Size of a view along its longest side.
    """
    low, high = 1e-3 * _bounds(bodies, meshes, marks)
    views = seen(marks, body_triangles(bodies, meshes), low, high, pixels)
    return CoverPicture(link, tuple(bodies), tuple(meshes), tuple(marks), tuple(views))


def draw_cover(picture: CoverPicture, said: str, scale: float | None = None) -> Any:
    """Draw the bodies of a link under its marks, and how far the marks stick out; in millimetres, in the link's frame.

    Args:
        picture: The result of `picture_of`.
        said: A text after the link's name.
        scale: [m], the end of the scale of colours; None: the largest visible distance.
    """
    with Needs("plots", "a figure"):
        from matplotlib.figure import Figure

    end = max(_LEAST_SCALE, 1e3 * (picture.furthest if scale is None else scale))
    spans = np.array([1e3 * (one.high - one.low) for one in picture.views])
    panel = (_WIDTH - _LEFT - _RIGHT - 2 * _GAP) / 3
    inch = min(panel / spans[:, 0].max(), _TALLEST / spans[:, 1].max())
    rows = spans[:, 1] * inch + _LABELS
    height = float(rows.sum()) + _TOP + 0.1
    figure = cast(Any, Figure(figsize=(_WIDTH, height)))
    top = height - _TOP
    image = None
    for one, row in zip(picture.views, rows.tolist(), strict=True):
        for column in range(3):
            size = 1e3 * (one.high - one.low) * inch
            left = _LEFT + column * (panel + _GAP) + 0.5 * (panel - size[0])
            axes = figure.add_axes((left / _WIDTH, (top - size[1]) / height, size[0] / _WIDTH, size[1] / height))
            if column == 0:
                _draw_bodies(axes, picture, one.view)
            else:
                image = _draw_surface(axes, one, column - 1, end)
            _dress(axes, one, column)
        top -= row
    bar = figure.add_axes(((_WIDTH - 0.75) / _WIDTH, 0.6 / height, 0.16 / _WIDTH, min(4.0, height - 1.9) / height))
    figure.colorbar(image, cax=bar, label="distance of the marks' surface from the bodies [mm]")
    seen_mm = f"{1e3 * picture.furthest:.2f} mm"
    figure.text(0.15 / _WIDTH, 1 - 0.25 / height, f"{picture.link}: {said}", fontsize=12, weight="bold", va="center")
    figure.text(
        0.15 / _WIDTH,
        1 - 0.5 / height,
        f"furthest place seen: {seen_mm} from the bodies. Left: bodies (grey) under translucent marks; "
        "middle and right: the marks' outer surface from both sides.",
        fontsize=9.5,
        va="center",
    )
    return without_math(figure)


def _draw_bodies(axes: Any, picture: CoverPicture, view: View) -> None:
    flat = view[:2]
    outlines = [outline_of(mark, flat) for mark in picture.marks]
    whole = gis.union_all(outlines) if outlines else gis.Polygon()
    _fill(axes, whole, _ADDED, 1)
    for body, mesh in zip(picture.bodies, picture.meshes, strict=True):
        _draw_body(axes, body, mesh, view, whole)
    for index, outline in enumerate(outlines):
        colour = PALETTE[1 + index % (len(PALETTE) - 1)]
        _fill(axes, outline, colour, 4, 0.18)
        _trace(axes, outline, colour)


def _draw_surface(axes: Any, one: Seen, side: int, end: float) -> Any:
    """Colour each point by its distance from the bodies, lighter where it faces the viewer; marks have outlines."""
    import matplotlib as mpl_untyped
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    known = ScalarMappable(Normalize(0.0, end), cast(Any, mpl_untyped).colormaps[_COLOURS])
    shown = known.to_rgba(np.nan_to_num(1e3 * one.away[side]))
    shown[..., :3] *= (0.8 + 0.2 * one.light[side])[..., None]
    missing = (one.mark[side] >= 0) & np.isnan(one.away[side])
    shown[missing] = (0.8, 0.8, 0.8, 1.0)
    shown[one.mark[side] < 0] = 0.0
    corners: list[float] = [1e3 * float(end) for i in range(2) for end in (one.low[i], one.high[i])]
    axes.imshow(shown, origin="lower", extent=corners, interpolation="bilinear", aspect="auto", zorder=2)
    number = one.mark[side].astype(float)
    if len(np.unique(number)) > 1:
        for index in range(int(number.max()) + 1):
            rim = {"levels": [0.5], "colors": _LINE, "linewidths": 0.5, "zorder": 3}
            axes.contour(number == index, origin="lower", extent=corners, **rim)
    return known


def _dress(axes: Any, one: Seen, column: int) -> None:
    u, v, k = one.view
    low, high = 1e3 * one.low, 1e3 * one.high
    right_handed = (u, v, k) in ((0, 1, 2), (1, 2, 0), (2, 0, 1))
    from_plus = column < 2
    # From the side for which u and v are right-handed, u grows to the right; from the other side, to the left.
    ends = (low[0], high[0]) if right_handed == from_plus else (high[0], low[0])
    axes.set(xlim=ends, ylim=(low[1], high[1]))
    axes.set_xlabel(f"{'xyz'[u]} [mm]", fontsize=9, labelpad=1)
    axes.set_ylabel(f"{'xyz'[v]} [mm]", fontsize=9, labelpad=1)
    axes.tick_params(labelsize=8)
    axes.grid(True, color="#E4E4E4", linewidth=0.5)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.set_title(f"from {'+' if from_plus else '-'}{'xyz'[k]}", fontsize=9, pad=3)


def outline_of(mark: Mark, view: tuple[int, int]) -> Any:
    """Return the outline of a bounded mark, seen along the third axis, as a shapely geometry in mm.

    Example:
        >>> from pinbound.annotations import Segment
        >>> rod = Segment("rod", "arm", (0.0, 0.0, 0.0), (0.1, 0.0, 0.0), 0.01)
        >>> round(outline_of(rod, (0, 1)).area, -1)
        2310.0
    """
    flat = gis.convex_hull(gis.MultiPoint(1e3 * mark.shape.vertices[:, list(view)]))
    radius = 1e3 * mark.shape.radius
    return gis.buffer(flat, radius, quad_segs=_ROUND) if radius else flat


def _draw_body(axes: Any, body: Body, mesh: Mesh | None, view: View, whole: Any) -> None:
    """Draw a body: triangles from the furthest to the nearest, lighter where they face the viewer."""
    from matplotlib.collections import PolyCollection
    from matplotlib.colors import to_rgb

    if mesh is not None:
        step = 1 + (len(mesh.triangles) - 1) // _MOST_TRIANGLES
        corners = 1e3 * mesh.vertices[mesh.triangles[::step]]
        corners = corners[np.argsort(corners[:, :, view[2]].mean(axis=1), kind="stable")]
        normals: Array = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        sizes = np.linalg.norm(normals, axis=1)
        facing = np.abs(normals[:, view[2]]) / np.where(sizes > 0.0, sizes, 1.0)
        grey = np.array(to_rgb(_BODY)) * (0.7 + 0.3 * facing)[:, None]
        flat = list(corners[:, :, list(view[:2])])
        axes.add_collection(PolyCollection(flat, facecolors=grey, edgecolors="#7B8794", linewidths=0.12, zorder=3))
        _mark_outside(axes, 1e3 * mesh.vertices[:, list(view[:2])], whole)
        return
    outline = _outline_of_body(body, view[:2])
    if outline is not None:
        _fill(axes, outline, _BODY, 3)
        _mark_outside(
            axes, np.array(outline.exterior.coords) if outline.geom_type == "Polygon" else np.empty((0, 2)), whole
        )


def _mark_outside(axes: Any, points: Array, whole: Any) -> None:
    """Show points of bodies that are outside all marks; up to rounding there should be none."""
    if not len(points) or whole.is_empty:
        return
    away = gis.distance(gis.points(points), whole)
    out = points[away > 1e-6]
    if len(out):
        axes.plot(*out.T, ".", color=_OUT, markersize=3, zorder=6)


def _outline_of_body(body: Body, view: tuple[int, int]) -> Any:
    """Return the outline of a body with a simple shape in mm; None for other bodies."""
    size = body.size
    if body.shape == "box":
        corners, radius = np.array(list(product((-0.5, 0.5), repeat=3))) * size, 0.0
    elif body.shape == "sphere":
        corners, radius = np.zeros((1, 3)), size[0]
    elif body.shape == "capsule":
        corners, radius = np.array([[0.0, 0.0, -size[1] / 2], [0.0, 0.0, size[1] / 2]]), size[0]
    elif body.shape == "cylinder":
        angles = np.linspace(0.0, 2.0 * np.pi, 4 * _ROUND, endpoint=False)
        ring = size[0] * np.column_stack((np.cos(angles), np.sin(angles), np.zeros(len(angles))))
        up = np.array([0.0, 0.0, size[1] / 2])
        corners, radius = np.vstack((ring + up, ring - up)), 0.0
    else:
        return None
    flat = gis.convex_hull(gis.MultiPoint(1e3 * (corners @ body.rotation.T + body.translation)[:, list(view)]))
    return gis.buffer(flat, 1e3 * radius, quad_segs=_ROUND) if radius else flat


def _fill(axes: Any, shape: Any, colour: str, level: int, alpha: float = 1.0) -> None:
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    for one in getattr(shape, "geoms", [shape]):
        if one.geom_type == "Polygon" and not one.is_empty:
            rings = [Path(np.array(ring.coords), closed=True) for ring in (one.exterior, *one.interiors)]
            path = Path.make_compound_path(*rings)
            axes.add_patch(PathPatch(path, facecolor=colour, edgecolor="none", zorder=level, alpha=alpha))


def _trace(axes: Any, outline: Any, colour: str) -> None:
    if outline.geom_type == "Polygon" and not outline.is_empty:
        axes.plot(*np.array(outline.exterior.coords).T, color=colour, linewidth=1.1, zorder=5)
    elif outline.geom_type == "LineString":
        axes.plot(*np.array(outline.coords).T, color=colour, linewidth=1.1, zorder=5)
    elif not outline.is_empty:
        axes.plot(*np.array(outline.centroid.coords).T, "+", color=colour, zorder=5)


def _bounds(bodies: Sequence[Body], meshes: Sequence[Mesh | None], marks: Sequence[Mark]) -> Array:
    """Return the corners (2, 3) [mm] of a box around everything that is drawn, with a margin."""
    points = list[Array]()
    for mark in marks:
        points += [mark.shape.vertices - mark.shape.radius, mark.shape.vertices + mark.shape.radius]
    points += [one.reshape(-1, 3) for one in body_triangles(bodies, meshes)]
    found = 1e3 * np.concatenate(points)
    low, high = found.min(axis=0), found.max(axis=0)
    more = _MARGIN * float(np.max(high - low)) + 1.0
    return np.stack((low - more, high + more))
