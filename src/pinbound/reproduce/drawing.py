"""Parts that all figures of the reproduction use: axes, colours, the robot's outline. Matplotlib loads here."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
import shapely

from pinbound.extras import Needs
from pinbound.figures.plots import PALETTE
from pinbound.robot.robot import Robot
from pinbound.typing import Array

__all__ = [
    "FILL",
    "GREY",
    "PLACE_STYLE",
    "beta",
    "colour_of",
    "draw_silhouette",
    "draw_solids",
    "draw_surface",
    "frames",
    "mixed",
    "name_along",
    "solids",
    "spatial",
    "to_scale",
]


GREY, FILL = "#8A8A8A", "#DCEBF5"

PLACE_STYLE: dict[int, tuple[str, str, str]] = {
    1: ("#009E73", "o", "inside"),
    0: ("#E69F00", "D", "on the contour"),
    -1: ("#D55E00", "x", "outside"),
}
"""Colour, marker and name of each `Place`; shape tells them apart without colour."""


def frames(width: float, height: float, columns: int = 1, **options: Any) -> tuple[Any, list[Any]]:
    """Return a figure and its axes, placed side by side, with a light grid."""
    with Needs("plots", "a figure"):
        from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    grid = np.atleast_1d(cast(Any, figure).subplots(1, columns, **options))
    for axes in grid:
        axes.grid(True, color="#E4E4E4", linewidth=0.6)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
    return figure, list(grid)


def spatial(width: float, height: float) -> tuple[Any, Any]:
    """Return a figure and its only axes: 3D axes labelled x, y, z in millimetres."""
    with Needs("plots", "a figure"):
        from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    return figure, _spatial_frame(figure, 111)


def _spatial_frame(figure: Any, place: int) -> Any:
    axes = figure.add_subplot(place, projection="3d")
    axes.set_xlabel("x [mm]", labelpad=8)
    axes.set_ylabel("y [mm]", labelpad=8)
    axes.set_zlabel("z [mm]", labelpad=6)
    for one in (axes.xaxis, axes.yaxis, axes.zaxis):
        one.set_pane_color((0.97, 0.97, 0.97, 1.0))
    return axes


def mixed(width: float, height: float, spatial_first: bool) -> tuple[Any, Any, Any]:
    """Return a figure, its 3D axes and its 2D axes, placed side by side."""
    with Needs("plots", "a figure"):
        from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    cast(Any, figure.get_layout_engine()).set(wspace=0.12)
    space = _spatial_frame(figure, 121 if spatial_first else 122)
    plane = cast(Any, figure).add_subplot(122 if spatial_first else 121)
    plane.grid(True, color="#E4E4E4", linewidth=0.6)
    plane.set_axisbelow(True)
    plane.spines[["top", "right"]].set_visible(False)
    return figure, space, plane


def to_scale(axes: Any, zoom: float) -> None:
    """Give 3D axes equal scales, and enlarge what they show by `zoom`."""
    spans = [float(np.ptp(limits())) for limits in (axes.get_xlim, axes.get_ylim, axes.get_zlim)]
    axes.set_box_aspect(spans, zoom=zoom)


def beta(name: str) -> str:
    """Return a boundary's name for a figure.

    Example:
        >>> beta("q2 upper"), len(beta("beta_10"))
        ('q2 upper', 12)
    """
    head, _, number = name.partition("_")
    return f"$\\beta_{{{number}}}$" if head == "beta" and number.isdigit() else name


def colour_of(robot: Robot, name: str) -> str:
    """Return the colour of a boundary, the same in every figure."""
    names = robot.boundaries.names
    return PALETTE[names.index(name) % len(PALETTE)] if name in names else "#333333"


def name_along(axes: Any, name: str, line: Array, inside: Array, colour: str) -> None:
    """Write a name beside the middle of a polyline (k, 2), on the side away from `inside`."""
    middle = max(len(line) // 2, 1)
    here, along = (line[middle - 1] + line[middle]) / 2, line[middle] - line[middle - 1]
    normal = np.array([along[1], -along[0]]) / np.linalg.norm(along)
    outwards = -normal * np.sign(normal @ (inside - here))
    axes.annotate(
        beta(name),
        here,
        xytext=13 * outwards,
        textcoords="offset points",
        ha="center",
        va="center",
        color=colour,
        weight="bold",
        fontsize=12,
        zorder=6,
    )


def solids(robot: Robot, q: Array) -> list[tuple[Any, str]]:
    """Return the boxes and cylinders of a robot's visuals at q: meshes in the root link's frame [m], and colours."""
    with Needs("meshes", "drawing solids"):
        import trimesh

    root: Any = robot.document.root
    shades = {
        str(material.get("name")): str(material.find("color").get("rgba"))
        for material in root.iter("material")
        if material.find("color") is not None
    }
    found = list[tuple[Any, str]]()
    for link in root.findall("link"):
        name = str(link.get("name"))
        origin = robot.positions(name, q)
        axes = np.array([robot.positions(name, q, tuple(unit.tolist())) - origin for unit in np.eye(3)])
        for visual in link.findall("visual"):
            mesh = _solid(visual.find("geometry"), cast(Any, trimesh).creation)
            if mesh is None:
                continue
            place = visual.find("origin")
            xyz, rpy = ("0 0 0" if place is None else place.get(key, "0 0 0") for key in ("xyz", "rpy"))
            turn = cast(Any, trimesh).transformations.euler_matrix(*map(float, rpy.split()), "sxyz")
            local = mesh.vertices @ turn[:3, :3].T + np.array([float(value) for value in xyz.split()])
            mesh.vertices = origin + local @ axes
            material = visual.find("material")
            rgba = shades.get("" if material is None else str(material.get("name")), "0.6 0.6 0.6 1")
            found.append((mesh, "#" + "".join(f"{round(255 * float(v)):02x}" for v in rgba.split()[:3])))
    return found


def _solid(geometry: Any, creation: Any) -> Any:
    box, cylinder = geometry.find("box"), geometry.find("cylinder")
    if box is not None:
        return creation.box(extents=[float(value) for value in box.get("size").split()])
    if cylinder is not None:
        radius, height = float(cylinder.get("radius")), float(cylinder.get("length"))
        return creation.cylinder(radius=radius, height=height, sections=24)
    return None


def draw_silhouette(axes: Any, robot: Robot, q: Array, plane: tuple[int, int], label: str | None = None) -> None:
    """Fill the robot's outline [mm], as seen along the axis that is not in `plane`: each solid in a pale colour."""
    columns = list(plane)
    for mesh, colour in solids(robot, q):
        hull: Any = cast(Any, shapely).MultiPoint(1e3 * mesh.vertices[:, columns]).convex_hull
        corners = shapely.get_coordinates(hull)
        axes.fill(*corners.T, facecolor=colour, edgecolor=colour, linewidth=0.6, alpha=0.35, zorder=2)
    if label:
        axes.fill([], [], facecolor="#9AA5B1", alpha=0.6, label=label)


def draw_solids(axes: Any, robot: Robot, q: Array) -> None:
    """Draw the robot's solids in 3D [mm], with shading."""
    for mesh, colour in solids(robot, q):
        draw_surface(axes, mesh, colour, 1.0)


def draw_surface(axes: Any, mesh: Any, colour: str, alpha: float) -> None:
    """Draw a mesh in 3D [mm], with shading from its normals."""
    from matplotlib.colors import to_rgb
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    light = np.array([0.4, -0.6, 0.7]) / np.linalg.norm([0.4, -0.6, 0.7])
    shade = 0.72 + 0.28 * np.asarray(mesh.face_normals) @ light
    colours = np.column_stack((np.clip(shade[:, None] * np.array(to_rgb(colour)), 0, 1), np.full(len(shade), alpha)))
    faces: Any = cast(Any, Poly3DCollection)(1e3 * np.asarray(mesh.triangles), facecolors=colours, edgecolors="none")
    faces.set_rasterized(True)
    axes.add_collection3d(faces)
