"""Figures: the robot seen from the side, a region with named edges, its image in the workspace.

Matplotlib loads when the first figure is drawn. The colours are those of Okabe and Ito, which colour-blind readers can
distinguish. A boundary has the same colour in all figures of a page (`order_of`), and every edge also has its name.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, cast

import numpy as np
import shapely

from pinbound import units
from pinbound.annotations import Mark
from pinbound.boundaries.boundary import Boundary
from pinbound.figures.canvas import fit, lay_out, new_axes, without_math
from pinbound.figures.colours import PALETTE, order_of, style_of
from pinbound.figures.names import Names, draw_edge, legend_of_short_edges, name_edges
from pinbound.figures.workspace_image import WorkspaceImage, section_axes, workspace_image
from pinbound.marking.candidates import configuration_text
from pinbound.region import Region
from pinbound.robot.robot import Robot
from pinbound.typing import Array

__all__ = [
    "PALETTE",
    "draw_region",
    "draw_robot",
    "draw_verdicts",
    "draw_workspace",
    "region_axes",
    "robot_axes",
    "section_axes",
    "side_axes",
]

gis = cast(Any, shapely)  # its type stubs lack some of the accepted arguments

_GREY = "#8A8A8A"
_FILL = "#DCEBF5"
_BELOW: dict[str, Any] = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.1), "ncols": 3, "frameon": False}
_MOST_LINES = 20  # a robot's figure shows all boundaries up to this number
_NEAREST = 12  # if there are more, it shows only this number, those nearest to contact
_STRETCH = 0.1  # metres: length of the drawn part of a line, or of a plane's normal


def draw_region(region: Region, home: Array, contacts: Sequence[tuple[str, Array, float]] = ()) -> Any:
    """Draw a region, each edge with its own colour and its name, and implied contact lines in grey.

    Args:
        region: The region; angles are drawn in degrees, lengths in millimetres.
        home: (2,) the start point [rad or m].
        contacts: Lines `c @ x = value` that are no edges: name, c (2,), value, in rad and m.
    """
    return region_axes(region, None, home, contacts).figure


def region_axes(
    region: Region, axes: Any = None, home: Array | None = None, contacts: Sequence[tuple[str, Array, float]] = ()
) -> Any:
    """Draw a region as `draw_region` does, in axes if any are given, and return the axes.

    Args:
        region: The region; angles are drawn in degrees, lengths in millimetres.
        axes: Matplotlib axes; None: those of a new figure.
        home: (2,) the start point [rad or m]; None: the region's own.
        contacts: Lines `c @ x = value` that are no edges: name, c (2,), value, in rad and m.
    """
    is_new, axes = axes is None, new_axes(8.2, 7.2, axes)
    home = region.slice.start if home is None else home
    scale = units.factors(region.units)
    _fill(axes, [[scale * edge.points for edge in loop] for loop in region.loops])
    lines = [(name, normal / scale, value) for name, normal, value in contacts]
    low, high = _frame(scale * np.concatenate([edge.points for edge in region.edges]), lines)
    for name, normal, value in lines:
        _draw_line(axes, name, normal, value, low, high)
    names, alike = order_of(region, region.slice.robot.boundaries.names), region.units[0] == region.units[1]
    edges = [(edge.name, scale * edge.points, style_of(edge.name, names)) for edge in region.edges]
    for _, points, style in edges:
        draw_edge(axes, points, style)
    corners = scale * np.array([corner.point for corner in region.corners]).reshape(-1, 2)
    axes.plot(*corners.T, "o", color="#333333", markersize=4, zorder=4)
    shown = axes.plot(*(scale * home), "s", color="#333333", markersize=7, label="home", zorder=5)
    shown += axes.plot(*(scale * region.centroid), "+", color="#333333", markersize=11, label="centroid", zorder=5)
    for slit in region.slits:
        axes.plot(*(scale * slit.points).T, color="#333333", linewidth=1.6, linestyle=(0, (2, 1.5)), zorder=4)
    if region.slits:
        cut = ", ".join(dict.fromkeys(slit.name for slit in region.slits))
        label = f"{cut}: a cut that no motion crosses"
        shown += axes.plot([], [], color="#333333", linewidth=1.6, linestyle=(0, (2, 1.5)), label=label)
    if contacts:
        shown += axes.plot([], [], color=_GREY, linestyle=(0, (4, 3)), label="contact, implied by an edge")
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    _label_plane(axes, region)
    area = f"{region.area:.4g} {units.area_name(region.area_unit)}"
    axes.set_title(f"Feasible region of ({', '.join(region.coordinates)}): {area}", loc="left")
    axes.legend(handles=shown, **_BELOW)
    spots = (scale * home, scale * region.centroid)
    if is_new:
        fit(axes)
    legend_of_short_edges(axes, name_edges(axes, edges, scale * region.centroid, alike, is_new, spots), is_new)
    return without_math(axes)


def _fill(axes: Any, loops: Sequence[Sequence[Array]]) -> None:
    """Fill the area between an outer contour and its holes; each is a list of polylines (k, 2)."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path as Outline

    rings = [Outline(np.concatenate(loop), closed=True) for loop in loops]
    outline = Outline.make_compound_path(*rings)
    axes.add_patch(PathPatch(outline, facecolor=_FILL, edgecolor="none", zorder=1))


def _label_plane(axes: Any, region: Region) -> None:
    """Label the axes with names and units; both axes have the same scale only if they have the same unit."""
    a, b = units.names(region.units)
    axes.set_xlabel(f"{region.coordinates[0]} [{a}]")
    axes.set_ylabel(f"{region.coordinates[1]} [{b}]")
    axes.set_aspect("equal" if a == b else "auto")


def draw_verdicts(region: Region, home: Array, groups: Mapping[str, Array]) -> Any:
    """Draw the verdicts of another engine on a region: each group of points (k, 2) has its own colour and marker.

    Args:
        region: The region; angles are drawn in degrees, lengths in millimetres.
        home: (2,) the start point [rad or m].
        groups: Points [rad or m] by the name of their group; the legend counts them, also in empty groups.
    """
    axes = new_axes(8.2, 7.6)
    scale, alike = units.factors(region.units), region.units[0] == region.units[1]
    _fill(axes, [[scale * edge.points for edge in loop] for loop in region.loops])
    markers = ("o", "X", "s", "^", "v")
    shown = [scale * np.concatenate([edge.points for edge in region.edges])]
    for index, (name, points) in enumerate(groups.items()):
        style = {"color": PALETTE[index % len(PALETTE)], "zorder": 3 + index, "label": f"{name} ({len(points)})"}
        size = 2.5 if index == 0 else 4.5
        drawn = scale * np.asarray(points, dtype=np.float64).reshape(-1, 2)
        axes.plot(*drawn.T, markers[index % len(markers)], markersize=size, markeredgewidth=0, **style)
        shown.append(drawn)
    edges = [(edge.name, scale * edge.points, {"color": "#333333"}) for edge in region.edges]
    for _, points, style in edges:
        draw_edge(axes, points, style, 1.2)
    axes.plot(*(scale * home), "P", color="#333333", markersize=8, label="home", zorder=9)
    everything = np.concatenate(shown)
    spread = np.ptp(everything, axis=0)
    pad = 0.06 * (float(np.max(spread)) if alike else spread)
    low, high = everything.min(axis=0) - pad, everything.max(axis=0) + pad
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    _label_plane(axes, region)
    axes.set_title(f"Region of ({', '.join(region.coordinates)}) against coal's flood fill from home", loc="left")
    axes.legend(**_BELOW | {"ncols": 2})
    fit(axes)
    name_edges(axes, edges, scale * region.centroid, alike, True, (scale * home,))
    return without_math(axes.figure)


def _frame(vertices: Array, contacts: Sequence[tuple[str, Array, float]]) -> tuple[Array, Array]:
    """Return the lower and the upper corner of a frame with the region and the implied lines near it."""
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    span = np.maximum(high - low, 1e-3 * float(np.max(high - low)))
    points = [*vertices]
    for _, normal, value in contacts:
        length = float(np.linalg.norm(normal))
        nearest = vertices[np.argmax(vertices @ normal)]
        gap = (value - float(nearest @ normal)) / length
        if np.all(np.abs(gap * normal / length) < 0.3 * span):
            points.append(nearest + gap * normal / length)
    pad = 0.1 * span
    return np.min(points, axis=0) - pad, np.max(points, axis=0) + pad


def _draw_line(axes: Any, name: str, normal: Array, value: float, low: Array, high: Array) -> None:
    """Draw `normal @ x = value` inside the frame, dashed, with its name at one end."""
    along = np.array([-normal[1], normal[0]])
    foot = normal * value / float(normal @ normal)
    with np.errstate(divide="ignore"):
        ends = np.sort(np.stack([(low - foot) / along, (high - foot) / along]), axis=0)
    enter, leave = float(np.max(ends[0])), float(np.min(ends[1]))
    if not enter < leave:
        return
    points = np.array([foot + enter * along, foot + leave * along])
    axes.plot(*points.T, color=_GREY, linewidth=1.1, linestyle=(0, (4, 3)), zorder=2)
    first, last = points[np.argsort(points @ np.array([1.0, 0.5]))]
    room = np.array([0.008 * len(name), 0.02]) * (high - low)  # estimated size: the name must stay inside the axes
    places = last + np.linspace(0.07, 0.5, 44)[:, None] * (first - last)
    fits = np.all((low + room <= places) & (places <= high - room), axis=1)
    axes.text(
        *places[int(np.argmax(fits))],
        name,
        ha="center",
        va="center",
        color="#5A5A5A",
        fontsize=9,
        zorder=6,
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.5},
    )


def side_axes(robot: Robot, q: Array) -> tuple[int, int]:
    """Return the two world axes of the view in which a robot's motion is visible: x and z, y and z, or x and y.

    The view is along the horizontal world axis, x or y, about which the joints rotate most. The view is from above only
    if no joint rotates about an axis with a horizontal component.

    Example:
        >>> import pinbound as pb
        >>> robot = pb.load("minervabot_v3")
        >>> side_axes(robot, robot.home)
        (0, 2)
    """
    turned = np.zeros(3)
    for joint in robot.tree.moving_joints:
        origin, end = (robot.positions(joint.child, q, xyz) for xyz in ((0.0, 0.0, 0.0), tuple(joint.axis.tolist())))
        if joint.type != "prismatic":
            turned += np.abs(end - origin)
    return (0, 1) if max(turned[:2]) < 1e-6 * max(turned[2], 1e-9) else (0, 2) if turned[1] >= turned[0] else (1, 2)


def _skeleton(robot: Robot, q: Array) -> list[tuple[str, Array]]:
    """Return one polyline (k, 3) for each link: from its origin to its joints and to its pins of closures."""
    ends: dict[str, list[Array]] = {name: [] for name in robot.tree.links}
    for joint in robot.tree.kinematics.joints:
        ends[joint.parent].append(robot.positions(joint.child, q))
    for closure in robot.closures:
        for link, xyz in ((closure.mark.link_a, closure.mark.xyz_a), (closure.mark.link_b, closure.mark.xyz_b)):
            ends[link].append(robot.positions(link, q, xyz))
    lines: list[tuple[str, Array]] = []
    for link, points in ends.items():
        origin = robot.positions(link, q)
        lines += [(link, np.array([origin, point])) for point in points if np.linalg.norm(point - origin) > 0.0]
    return lines


def _draw_skeleton(axes: Any, robot: Robot, q: Array, plane: tuple[int, int], colour: str) -> None:
    for _, line in _skeleton(robot, q):
        axes.plot(*(1e3 * line[:, list(plane)]).T, color=colour, linewidth=2.2, solid_capstyle="round", zorder=2)
        axes.plot(*(1e3 * line[:, list(plane)]).T, "o", color=colour, markersize=4.5, markerfacecolor="white", zorder=3)


def draw_robot(robot: Robot, q: Array, region: Region | None = None) -> Any:
    """Draw joints, pins and marks of a robot at one configuration, in the view of `side_axes`.

    Args:
        robot: The robot.
        q: (n,) the configuration [rad or m].
        region: A region of the same page: its edges have the colours that they have there.
    """
    return robot_axes(robot, q, None, region).figure


def robot_axes(robot: Robot, q: Array, axes: Any = None, region: Region | None = None) -> Any:
    """Draw a robot as `draw_robot` does, in axes if any are given, and return the axes.

    Args:
        robot: The robot.
        q: (n,) the configuration [rad or m].
        axes: Matplotlib axes; None: those of a new figure.
        region: A region of the same page: its edges have the colours that they have there.
    """
    is_new, axes = axes is None, new_axes(8.2, 6.6, axes)
    marked = {name: _anchors(robot, mark, q) for name, mark in robot.annotations.marks.items()}
    plane = side_axes(robot, q)
    _draw_skeleton(axes, robot, q, plane, "#9AA5B1")
    boundaries = _nearest_boundaries(robot, q)
    order = order_of(region, [boundary.name for boundary in boundaries])  # edges first, then the boundaries shown
    for mark in robot.annotations.marks.values():
        _draw_mark(axes, mark, marked[mark.name], plane)
    places: dict[str, tuple[Array, str]] = {}
    for boundary in boundaries:
        style, ends = style_of(boundary.name, order), _nearest_ends(robot, boundary, q)[:, list(plane)]
        axes.plot(*ends.T, **style, marker="o", markersize=5, linewidth=1.1, label=boundary.name, zorder=4)
        for point, place in zip((boundary.point_a, boundary.point_b), ends, strict=True):
            places.setdefault(point.name, (place, style["color"]))
    labels = "xyz"
    axes.set_xlabel(f"{labels[plane[0]]} [mm]")
    axes.set_ylabel(f"{labels[plane[1]]} [mm]")
    axes.set_aspect("equal", adjustable="datalim")
    place = "at home" if np.array_equal(q, robot.home) else f"at {configuration_text(robot, q)}"
    count, few = len(robot.boundaries), len(boundaries)
    told = "with its marks and their nearest points" if few == count else f"the {few} of {count} pairs nearest contact"
    axes.set_title(f"{robot.name} {place}, {told}", loc="left")
    if few:
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    if is_new:
        lay_out(axes)
    names = Names(axes)
    for name, (spot, colour) in places.items():
        names.beside(name, spot, colour)
    return without_math(axes)


def _nearest_boundaries(robot: Robot, q: Array) -> list[Boundary]:
    """Return the boundaries whose nearest points are drawn: all of them, or those that are nearest to contact at q."""
    if len(robot.boundaries) <= _MOST_LINES:
        return list(robot.boundaries)
    clearances = robot.boundaries.signed_clearances(q)
    nearest = sorted(np.argsort(clearances, kind="stable")[:_NEAREST].tolist())
    return [robot.boundaries[robot.boundaries.names[index]] for index in nearest]


def _anchors(robot: Robot, mark: Mark, q: Array) -> list[Array]:
    """Return the positions of a mark's vertices [m]; for a line or plane, the ends of a part of 0.1 m."""
    shape = mark.shape
    local = shape.vertices if shape.normal is None else shape.origin + np.outer((0.0, _STRETCH), shape.normal)
    return list(_in_root(robot, mark.link, q, local))


def _draw_mark(axes: Any, mark: Mark, places: list[Array], plane: tuple[int, int]) -> None:
    """Draw the outline of a mark in the plane of the figure: the hull of its corners, with the radius around it."""
    if mark.shape.is_unbounded:
        axes.plot(*(1e3 * np.array(places)[:, list(plane)]).T, color="#333333", linewidth=2.0, zorder=3)
        return
    shape = gis.MultiPoint(1e3 * np.array(places)[:, list(plane)]).convex_hull.buffer(1e3 * mark.shape.radius)
    if shape.area > 0.0:
        axes.fill(*shape.exterior.xy, facecolor="#9AA5B1", edgecolor="#5B6770", linewidth=0.8, alpha=0.25, zorder=1)
    elif shape.length > 0.0:
        axes.plot(*shape.xy, color="#5B6770", linewidth=2.0, alpha=0.5, zorder=1)


def _nearest_ends(robot: Robot, boundary: Boundary, q: Array) -> Array:
    """Return the nearest points (2, 3) of a boundary's two marks, in the root link's frame [mm]."""
    return 1e3 * _in_root(robot, boundary.ancestor, q, boundary.nearest_points(q))


def _in_root(robot: Robot, link: str, q: Array, points: Array) -> Array:
    """Return points (k, 3), given in a link's frame, in the frame of the root link."""
    centre, *axes = (robot.positions(link, q, xyz) for xyz in np.vstack((np.zeros(3), np.eye(3))).tolist())
    found: Array = centre + points @ (np.array(axes) - centre)
    return found


def draw_workspace(robot: Robot, region: Region, frame: str, image: WorkspaceImage | None = None) -> Any:
    """Draw the image of a region's contour under the forward kinematics of a link's origin, with named edges.

    If the link moves in a plane, the image of the region is filled. The images of the edges need not be its border:
    where the map folds, the link reaches positions beyond them.

    Args:
        robot: The robot.
        region: The region.
        frame: The link.
        image: The image, if it has already been computed.
    """
    from matplotlib.transforms import ScaledTranslation

    axes = new_axes(8.2, 6.6)
    image = image or workspace_image(robot, region, frame)
    contour, plane = image.edges, image.plane
    home = robot.positions(frame, region.at)
    outline = np.concatenate(contour)
    keep = list(plane)
    for rings in image.rings:
        _fill(axes, [[ring] for ring in rings])
    _draw_skeleton(axes, robot, region.at, plane, "#9AA5B1")
    order = order_of(region, robot.boundaries.names)
    centre = 1e3 * np.mean(outline[:, keep], axis=0)
    edges = [
        (edge.name, 1e3 * curve[:, keep], style_of(edge.name, order))
        for edge, curve in zip(region.edges, contour, strict=True)
    ]
    for _, points, style in edges:
        draw_edge(axes, points, style)
    axes.plot(*(1e3 * home[keep]), "s", color="#333333", markersize=7, label=f"{frame} at home", zorder=5)
    labels = "xyz"
    axes.set_xlabel(f"{labels[plane[0]]} [mm]")
    axes.set_ylabel(f"{labels[plane[1]]} [mm]")
    axes.set_aspect("equal")
    axes.set_title(f"Reachable points of {frame},\nand the image of the region's edges", loc="left")
    below = ScaledTranslation(0.0, -0.5, axes.figure.dpi_scale_trans)  # in inches, because the axes may be flat
    axes.legend(**_BELOW | {"bbox_to_anchor": (0.5, 0.0), "bbox_transform": axes.transAxes + below})
    fit(axes)
    legend_of_short_edges(axes, name_edges(axes, edges, centre, True, True, (1e3 * home[keep],)), True)
    return without_math(axes.figure)
