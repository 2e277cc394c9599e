"""Bodies of a link and the marks that hold them, seen from three sides: what is red is what the marks add.

The outline of a mark is the hull of its projected vertices with its radius around; its arcs are drawn by chords, inside
by 0.03 % of the radius. A body is drawn by its triangles; round bodies by their outline. What sticks out of all marks
shows in blue.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any, cast

import numpy as np
import shapely

from pinbound.annotations import Mark
from pinbound.coverage.bodies import Body
from pinbound.extras import Needs
from pinbound.figures.canvas import without_math
from pinbound.figures.colours import PALETTE
from pinbound.meshes import Mesh
from pinbound.typing import Array

__all__ = ["draw_cover", "outline_of"]

gis = cast(Any, shapely)

_VIEWS = ((0, 1), (0, 2), (1, 2))
_BODY, _HELD, _OUT = "#A9B4BF", "#F6B8A8", "#0033CC"
_ROUND = 32  # corners of a quarter of a circle
_MOST_TRIANGLES = 20_000  # drawn one by one: more take seconds, and show no more
_MARGIN = 0.06


def draw_cover(
    link: str, bodies: Sequence[Body], meshes: Sequence[Mesh | None], marks: Sequence[Mark], said: str
) -> Any:
    """Draw the bodies of a link in grey, and its marks around them in red; in millimetres, in the link's frame.

    Args:
        link: Its name.
        bodies: Its bodies.
        meshes: By body, its mesh in the link's frame; None of bodies that are none, or that are not read.
        marks: Bounded marks on the link.
        said: A line under the title.
    """
    with Needs("plots", "a figure"):
        from matplotlib.figure import Figure

    figure = Figure(figsize=(12.0, 4.4), layout="constrained")
    bounds = _bounds(bodies, meshes, marks)
    for place, view in enumerate(_VIEWS):
        axes = cast(Any, figure).add_subplot(1, 3, place + 1)
        outlines = [outline_of(mark, view) for mark in marks]
        whole = gis.union_all(outlines) if outlines else gis.Polygon()
        _fill(axes, whole, _HELD, 1)
        for body, mesh in zip(bodies, meshes, strict=True):
            _draw_body(axes, body, mesh, view, whole)
        for index, outline in enumerate(outlines):
            colour = PALETTE[1 + index % (len(PALETTE) - 1)]
            _trace(axes, outline, colour)
        axes.set_aspect("equal")
        axes.set(xlim=bounds[:, view[0]], ylim=bounds[:, view[1]])
        axes.set_xlabel(f"{'xyz'[view[0]]} [mm]")
        axes.set_ylabel(f"{'xyz'[view[1]]} [mm]")
        axes.grid(True, color="#E4E4E4", linewidth=0.5)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
    cast(Any, figure).suptitle(f"{link}: {said}", x=0.01, ha="left", fontsize=11)
    return without_math(figure)


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


def _draw_body(axes: Any, body: Body, mesh: Mesh | None, view: tuple[int, int], whole: Any) -> None:
    from matplotlib.collections import PolyCollection

    if mesh is not None:
        flat = 1e3 * mesh.vertices[:, list(view)]
        step = 1 + (len(mesh.triangles) - 1) // _MOST_TRIANGLES
        corners = flat[mesh.triangles[::step]]
        made = PolyCollection(list(corners), facecolors=_BODY, edgecolors="#7B8794", linewidths=0.15, zorder=3)
        axes.add_collection(made)
        _mark_outside(axes, flat, whole)
        return
    outline = _outline_of_body(body, view)
    if outline is not None:
        _fill(axes, outline, _BODY, 3)
        _mark_outside(
            axes, np.array(outline.exterior.coords) if outline.geom_type == "Polygon" else np.empty((0, 2)), whole
        )


def _mark_outside(axes: Any, points: Array, whole: Any) -> None:
    """Show points of bodies that are outside all marks: there should be none, but for rounding."""
    if not len(points) or whole.is_empty:
        return
    away = gis.distance(gis.points(points), whole)
    out = points[away > 1e-6]
    if len(out):
        axes.plot(*out.T, ".", color=_OUT, markersize=3, zorder=6)


def _outline_of_body(body: Body, view: tuple[int, int]) -> Any:
    """Return the outline of a body of a simple shape in mm; None of others."""
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


def _fill(axes: Any, shape: Any, colour: str, level: int) -> None:
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    for one in getattr(shape, "geoms", [shape]):
        if one.geom_type == "Polygon" and not one.is_empty:
            rings = [Path(np.array(ring.coords), closed=True) for ring in (one.exterior, *one.interiors)]
            axes.add_patch(PathPatch(Path.make_compound_path(*rings), facecolor=colour, edgecolor="none", zorder=level))


def _trace(axes: Any, outline: Any, colour: str) -> None:
    if outline.geom_type == "Polygon" and not outline.is_empty:
        axes.plot(*np.array(outline.exterior.coords).T, color=colour, linewidth=1.1, zorder=5)
    elif outline.geom_type == "LineString":
        axes.plot(*np.array(outline.coords).T, color=colour, linewidth=1.1, zorder=5)
    elif not outline.is_empty:
        axes.plot(*np.array(outline.centroid.coords).T, "+", color=colour, zorder=5)


def _bounds(bodies: Sequence[Body], meshes: Sequence[Mesh | None], marks: Sequence[Mark]) -> Array:
    """Return the corners (2, 3) [mm] of a box about all that is drawn, with a margin."""
    points = [mesh.vertices for mesh in meshes if mesh is not None]
    for mark in marks:
        points += [mark.shape.vertices - mark.shape.radius, mark.shape.vertices + mark.shape.radius]
    for body, mesh in zip(bodies, meshes, strict=True):
        if mesh is None:
            reach = float(np.sum(body.size)) if body.size else 0.0
            points += [body.translation[None] - reach, body.translation[None] + reach]
    found = 1e3 * np.concatenate(points)
    low, high = found.min(axis=0), found.max(axis=0)
    more = _MARGIN * float(np.max(high - low)) + 1.0
    return np.stack((low - more, high + more))
