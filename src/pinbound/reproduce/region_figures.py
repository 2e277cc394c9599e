"""Figs. 8-12, 16, 17: contact curves, region, workspace, swept volume, summed norms."""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely

from pinbound.region import Region
from pinbound.region.workspace import Section
from pinbound.reproduce.drawing import (
    FILL,
    beta,
    colour_of,
    draw_silhouette,
    draw_solids,
    draw_surface,
    frames,
    name_along,
    spatial,
    to_scale,
)
from pinbound.reproduce.study import FACTOR, SAMPLES, SEED, Study
from pinbound.typing import Array

__all__ = ["figure_8", "figure_9", "figure_10", "figure_11", "figure_12", "figure_16", "figure_17"]

_CHORD = 1e-5
_INSIDE, _OUTSIDE = "#1FB5AD", "#8E5BA6"  # turquoise and purple, as in the paper


def figure_8(study: Study) -> Any:
    """Draw the contact curves of all ten boundaries in the plane, and the region between them."""
    robot, region = study.robot, study.region
    figure, (axes,) = frames(9.6, 6.6)
    axes.fill(*np.degrees(region.vertices).T, color=FILL, zorder=1, label="feasible region")
    window = np.array([[-60.0, -60.0], [110.0, 100.0]])
    edges = {edge.name for edge in region.edges}
    for boundary in robot.boundaries:
        contact = study.contact(boundary.name)
        c = contact.coefficients[[robot.coordinates.index(name) for name in region.coordinates]]
        line = _line_in_box(c, float(np.degrees(contact.angle)), window)
        style = "-" if boundary.name in edges else (0, (5, 3))
        side = "below" if contact.angle > 0 else "above"
        text = f"{beta(boundary.name)}: {contact.text} = {np.degrees(contact.angle):.3f}°, free {side}".replace(
            "-", "\u2212"
        )
        text += "" if boundary.name in edges else ", implied"
        colour = colour_of(robot, boundary.name)
        axes.plot(*line.T, color=colour, linestyle=style, linewidth=1.8, label=text, zorder=3)
        spread = {"beta_1": 0.93, "beta_4": 0.8, "beta_2": 0.9, "beta_8": 0.78, "beta_3": 0.05, "beta_6": 0.14}
        share = spread.get(boundary.name, 0.06)
        place = line[0] + share * (line[1] - line[0])
        axes.text(*place, beta(boundary.name), color=colour, ha="center", va="center", zorder=5, bbox=_WHITE)
    axes.plot(*np.degrees(_in_plane(study, robot.home)), "s", color="#333333", markersize=7, label="home", zorder=5)
    axes.set(xlim=window[:, 0], ylim=window[:, 1], aspect="equal", xlabel="q2 [deg]", ylabel="q3 [deg]")
    axes.set_title("Contacts in the joint plane; each repeats every turn", loc="left")
    axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False, fontsize=9)
    return figure


_WHITE = {"facecolor": "white", "edgecolor": "none", "pad": 1.2}


def _line_in_box(c: Array, value: float, box: Array) -> Array:
    """Return the part (2, 2) of `c @ x = value` inside a box, from left to right or upwards."""
    along = np.array([-c[1], c[0]])
    foot = c * value / float(c @ c)
    with np.errstate(divide="ignore"):
        ends = np.sort((box - foot) / along, axis=0)
    points = np.array([foot + t * along for t in (float(np.max(ends[0])), float(np.min(ends[1])))])
    return points[np.argsort(points @ np.array([1.0, 0.5]))]


def _in_plane(study: Study, q: Array) -> Array:
    return q[[study.robot.coordinates.index(name) for name in study.region.coordinates]]


def figure_9(study: Study) -> Any:
    """Draw the region with named edges, and the positions that the tool can have."""
    figure, (left, right) = frames(13.0, 6.0, 2)
    _draw_region(left, study, study.region)
    left.set_title(f"(a) Feasible region, {study.region.area:.4f} rad²", loc="left")
    draw_silhouette(right, study.robot, study.robot.home, (0, 2), "robot at home")
    _draw_section(right, study, study.section)
    right.set_title(f"(b) Section of the workspace, {1e6 * study.section.area.value:.2f} mm²", loc="left")
    left.legend(loc="upper left", framealpha=1)
    right.legend(loc="lower right", framealpha=1)
    return figure


def _draw_region(axes: Any, study: Study, region: Region) -> None:
    vertices = np.degrees(region.vertices)
    axes.fill(*vertices.T, color=FILL, zorder=1)
    centre = np.degrees(region.centroid)
    for edge in region.edges:
        line = np.degrees([edge.start, edge.end])
        colour = colour_of(study.robot, edge.name)
        axes.plot(*line.T, color=colour, linewidth=3, solid_capstyle="round", zorder=3)
        name_along(axes, edge.name, line, centre, colour)
    axes.plot(*centre, "+", color="#333333", markersize=11, label="centroid", zorder=5)
    axes.plot(*np.degrees(_in_plane(study, study.robot.home)), "s", color="#333333", label="home", zorder=5)
    axes.set(aspect="equal", xlabel="q2 [deg]", ylabel="q3 [deg]")
    axes.margins(0.12)


def _draw_section(axes: Any, study: Study, section: Section) -> None:
    outline = 1e3 * shapely.get_coordinates(section.polygon(_CHORD).exterior)
    axes.fill(*outline.T, color=FILL, zorder=1, alpha=0.85)
    centre = 1e3 * section.image(section.region.centroid)[0]
    for edge in section.region.edges:
        line = 1e3 * section.edge_image(edge.start, edge.end, _CHORD)
        colour = colour_of(study.robot, edge.name)
        axes.plot(*line.T, color=colour, linewidth=3, solid_capstyle="round", zorder=4)
        name_along(axes, edge.name, line, centre, colour)
    axes.plot(*(1e3 * section.image(_in_plane(study, study.robot.home))[0]), "s", color="#333333", label="tool at home")
    axes.set(aspect="equal", xlabel="x [mm], distance from the axis of q1", ylabel="z [mm]")


def figure_10(study: Study) -> Any:
    """Draw the region and the scaled region, in joint space and in the workspace."""
    figure, (left, right) = frames(13.0, 6.0, 2)
    for region, section, style, colour, name in (
        (study.region, study.section, "-", "#333333", "feasible region"),
        (study.scaled, study.scaled_section, (0, (5, 2)), "#0072B2", f"scaled by {FACTOR:g} about the centroid"),
    ):
        ring = np.degrees(np.vstack((region.vertices, region.vertices[:1])))
        left.plot(*ring.T, linestyle=style, color=colour, linewidth=2.2, label=f"{name}, {region.area:.4f} rad²")
        curve = 1e3 * shapely.get_coordinates(section.polygon(_CHORD).exterior)
        area = 1e6 * section.area.value
        right.plot(*curve.T, linestyle=style, color=colour, linewidth=2.2, label=f"{name}, {area:.1f} mm²", zorder=4)
        left.plot(*np.degrees(region.vertices).T, "o", color=colour, markersize=4)
    left.plot(*np.degrees(study.region.centroid), "+", color="#333333", markersize=11, label="centroid")
    for edge in study.region.edges:
        colour = colour_of(study.robot, edge.name)
        name_along(left, edge.name, np.degrees([edge.start, edge.end]), np.degrees(study.region.centroid), colour)
    draw_silhouette(right, study.robot, study.robot.home, (0, 2))
    left.set(aspect="equal", xlabel="q2 [deg]", ylabel="q3 [deg]")
    left.margins(0.1)
    left.set_title("(a) Joint plane", loc="left")
    right.set(aspect="equal", xlabel="x [mm], distance from the axis of q1", ylabel="z [mm]")
    right.set_title("(b) Tool point", loc="left")
    left.legend(loc="lower center", bbox_to_anchor=(0.5, -0.32), frameon=False)
    right.legend(loc="lower center", bbox_to_anchor=(0.5, -0.32), frameon=False)
    return figure


def figure_11(study: Study) -> Any:
    """Draw the scaled section, rotated about q1 in steps of 15 degrees."""
    figure, axes = spatial(8.4, 6.8)
    body = study.scaled_body
    ring = 1e3 * shapely.get_coordinates(study.scaled_section.polygon(1e-4).exterior)
    angles = np.linspace(body.lower, body.upper, 19)
    for angle in angles:
        turned = np.column_stack((ring[:, 0] * np.cos(angle), ring[:, 0] * np.sin(angle), ring[:, 1]))
        ends = angle in (angles[0], angles[-1])
        axes.plot(*turned.T, color="#0072B2", linewidth=2.0 if ends else 0.9, alpha=1.0 if ends else 0.75)
    fine = np.linspace(body.lower, body.upper, 109)
    for vertex in study.scaled.vertices:
        u, v = 1e3 * study.scaled_section.image(vertex)[0]
        axes.plot(u * np.cos(fine), u * np.sin(fine), np.full_like(fine, v), color="#D55E00", linewidth=1.2)
    axes.plot([], [], color="#0072B2", label="scaled section, every 15°")
    axes.plot([], [], color="#D55E00", label="paths of its corners")
    axes.set_title(f"Swept by q1 in ±135°: {1e9 * body.volume.value:.6g} mm³ (scaled region)", loc="left")
    to_scale(axes, 1.08)
    axes.view_init(28, -62)
    axes.legend(loc="upper right")
    return figure


def figure_12(study: Study) -> Any:
    """Draw the swept body of the region, with the robot inside."""
    figure, axes = spatial(8.4, 6.8)
    draw_solids(axes, study.robot, study.robot.home)
    draw_surface(axes, study.body.mesh(1e-3), "#56B4E9", 0.42)
    reach = 1e3 * float(study.section.polygon(1e-4).bounds[2])
    axes.set(xlim=(-reach, reach), ylim=(-reach, reach), zlim=(0, 230))
    to_scale(axes, 1.12)
    axes.view_init(24, 168)
    axes.set_title(f"Where the tool may be, q1 in ±135°: {1e9 * study.body.volume.value:.6g} mm³", loc="left")
    return figure


def figure_16(study: Study) -> Any:
    """Draw the summed norms as a surface, coloured by membership."""
    figure, axes = spatial(9.0, 6.8)
    axes.set_box_aspect((1, 1, 0.42), zoom=1.0)
    q2, q3, height, inside = study.summed_norms
    colours = np.where(inside[..., None], _rgba(_INSIDE, 1.0), _rgba(_OUTSIDE, 0.8))
    surface = axes.plot_surface(
        np.degrees(q2), np.degrees(q3), height, facecolors=colours, rstride=2, cstride=2, linewidth=0, antialiased=False
    )
    surface.set_rasterized(True)
    axes.computed_zorder = False  # otherwise the surface hides the contour that is drawn on it
    _, X, _ = study.contour(study.region)
    lifted = np.sum(study.robot.boundaries.norms(study.configurations(X)) / study.samples[1].max(axis=0), axis=1)
    axes.plot(*np.degrees(X).T, lifted, color="black", linewidth=1.2, zorder=10)
    axes.set_xlabel("q2 [deg]", labelpad=8)
    axes.set_ylabel("q3 [deg]", labelpad=8)
    axes.set_zlabel("sum of normalised norms [-]")
    axes.plot([], [], "s", color=_INSIDE, label="in the feasible region")
    axes.plot([], [], "s", color=_OUTSIDE, alpha=0.55, label="outside")
    axes.view_init(66, -118)
    axes.legend(loc="upper right")
    axes.set_title(f"{SAMPLES:,} random configurations, seed {SEED}; each norm over its largest value", loc="left")
    return figure


def _rgba(colour: str, alpha: float) -> Array:
    from matplotlib.colors import to_rgba

    return np.array(to_rgba(colour, alpha))


def figure_17(study: Study) -> Any:
    """Draw the surface of Fig. 16 from above, with the contour of the region."""
    figure, (axes,) = frames(8.6, 7.0)
    q2, q3, height, _ = study.summed_norms
    shown = axes.pcolormesh(np.degrees(q2), np.degrees(q3), height, cmap="cividis", shading="nearest", rasterized=True)
    figure.colorbar(shown, ax=axes, label="sum of normalised norms [-]")
    axes.fill(*np.degrees(study.region.vertices).T, facecolor="none", edgecolor="white", linewidth=4.5)
    axes.fill(
        *np.degrees(study.region.vertices).T,
        facecolor="none",
        edgecolor="#D55E00",
        linewidth=2,
        label="feasible region",
    )
    axes.set(aspect="equal", xlabel="q2 [deg]", ylabel="q3 [deg]", xlim=(-360, 360), ylim=(-360, 360))
    axes.set_xticks(range(-360, 361, 120))
    axes.set_yticks(range(-360, 361, 120))
    share = float(np.mean(study.samples[2]))
    expected = study.region.area / (4 * np.pi) ** 2
    axes.set_title(f"From above: {100 * share:.3f} % of the samples inside; by area {100 * expected:.3f} %", loc="left")
    axes.legend(loc="upper right", framealpha=1)
    return figure
