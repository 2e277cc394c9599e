"""Figs. 13-15 and 18-22: norms along the contours, the tool path, its joints, its membership."""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely

from pinbound.figures.plots import PALETTE
from pinbound.reproduce.drawing import (
    FILL,
    GREY,
    PLACE_STYLE,
    beta,
    draw_silhouette,
    draw_solids,
    draw_surface,
    frames,
    mixed,
    to_scale,
)
from pinbound.reproduce.study import FACTOR, Study
from pinbound.typing import Array, Flags

__all__ = ["figure_13", "figure_14", "figure_15", "figure_18", "figure_19", "figure_20", "figure_21", "figure_22"]


def figure_13(study: Study) -> Any:
    """Draw the norms of beta_1 to beta_4 along the contours."""
    return _norms(study, (("beta_1", "beta_2"), ("beta_3", "beta_4")))


def figure_14(study: Study) -> Any:
    """Draw the norms of beta_5 to beta_8 along the contours."""
    return _norms(study, (("beta_5", "beta_6"), ("beta_7", "beta_8")))


def figure_15(study: Study) -> Any:
    """Draw the norms of beta_9 and beta_10 along the contours."""
    return _norms(study, (("beta_9", "beta_10"),))


def _norms(study: Study, panels: tuple[tuple[str, str], ...]) -> Any:
    figure, grid = frames(6.8 * len(panels), 4.9, len(panels))
    edges = [edge.name for edge in study.region.edges]
    for axes, names, letter in zip(grid, panels, "ab", strict=False):
        for region, style, what in ((study.region, "-", "region"), (study.scaled, (0, (4, 2)), f"scaled {FACTOR:g}")):
            share, X, _ = study.contour(region)
            Q = study.configurations(X)
            for name, colour in zip(names, ("#0072B2", "#D55E00"), strict=True):
                norm = 1e3 * study.robot.boundaries[name].norm(Q)
                axes.plot(share, norm, linestyle=style, color=colour, linewidth=1.8, label=f"{beta(name)}, {what}")
        corners = study.contour(study.region)[2]
        top = axes.get_ylim()[1]
        for corner in corners:
            axes.axvline(corner, color="#CFCFCF", linewidth=0.8, zorder=1)
        for name, start, end in zip(edges, corners[:-1], corners[1:], strict=True):
            axes.text((start + end) / 2, 1.005 * top, beta(name), ha="center", va="bottom", fontsize=9, color="#5A5A5A")
        axes.set(xlim=(0, 1), ylim=(0, top), xlabel="length along the contour / whole length [-]", ylabel="norm [mm]")
        title = f"({letter}) " if len(panels) > 1 else ""
        axes.set_title(f"{title}{beta(names[0])} and {beta(names[1])}; above: the edge", loc="left", pad=18)
        axes.legend(loc="lower center", bbox_to_anchor=(0.5, -0.38), ncols=2, frameon=False)
    return figure


def _classes(study: Study) -> list[tuple[Flags, str, str, str]]:
    place = study.path.place
    return [(place == value, *style) for value, style in PLACE_STYLE.items()]


def _scatter(axes: Any, study: Study, points: Array, size: float = 14.0) -> None:
    """Draw points (N, 2) or (N, 3); each class has its own colour and marker."""
    for chosen, colour, marker, name in _classes(study):
        label = f"{name} ({int(chosen.sum())})"
        axes.scatter(*points[chosen].T, s=size, color=colour, marker=marker, linewidths=1.1, label=label, zorder=5)


def _place_robot(study: Study) -> Array:
    """Return the configuration in which the robot is drawn: a quarter of the way along the path."""
    return study.path.solution.q[len(study.path.solution.q) // 12]


def figure_18(study: Study) -> Any:
    """Draw the tool path in the swept volume, and from the side."""
    figure, left, right = mixed(13.4, 6.2, spatial_first=True)
    draw_solids(left, study.robot, _place_robot(study))
    draw_surface(left, study.scaled_body.mesh(1e-3), "#56B4E9", 0.16)
    left.plot(*(1e3 * study.path.targets).T, color="#333333", linewidth=1.0)
    _scatter(left, study, 1e3 * study.path.targets, 9.0)
    left.set(xlim=(-220, 220), ylim=(-220, 220), zlim=(0, 230))
    to_scale(left, 0.98)
    left.view_init(30, -52)
    left.set_title("(a) Path and volume of the scaled region", loc="left")
    draw_silhouette(right, study.robot, study.configurations(study.region.centroid[None])[0], (0, 2))
    flat = 1e3 * np.column_stack((np.hypot(*study.path.targets[:, :2].T), study.path.targets[:, 2]))
    for section, style, name in (
        (study.section, "-", "region"),
        (study.scaled_section, (0, (5, 2)), f"scaled by {FACTOR:g}"),
    ):
        curve = 1e3 * shapely.get_coordinates(section.polygon(1e-5).exterior)
        right.plot(*curve.T, color="#333333", linestyle=style, linewidth=1.5, label=f"section, {name}")
    _scatter(right, study, flat)
    right.set(aspect="equal", xlabel="distance from the axis of q1 [mm]", ylabel="z [mm]")
    right.set_title("(b) From the side, azimuth taken out", loc="left")
    right.legend(loc="upper right", framealpha=1, fontsize=9)
    return figure


def figure_19(study: Study) -> Any:
    """Draw the tool path from above, and a part of it enlarged."""
    figure, right, left = mixed(13.4, 6.4, spatial_first=False)
    targets = 1e3 * study.path.targets
    draw_silhouette(left, study.robot, _place_robot(study), (0, 1))
    low, high = study.scaled_body.lower, study.scaled_body.upper
    angles = np.linspace(low, high, 181)
    for radius in 1e3 * np.array(study.scaled_section.polygon(1e-5).bounds)[[0, 2]]:
        left.plot(radius * np.cos(angles), radius * np.sin(angles), color="#333333", linewidth=1.0)
    left.plot(*targets[:, :2].T, color="#333333", linewidth=0.8)
    _scatter(left, study, targets[:, :2])
    left.set(aspect="equal", xlabel="x [mm]", ylabel="y [mm]")
    left.set_title("(a) From above; arcs: innermost and outermost reach, scaled", loc="left")
    left.legend(loc="upper center", bbox_to_anchor=(0.5, -0.1), ncols=3, frameon=False)
    right.plot(*targets.T, color="#333333", linewidth=1.0)
    _scatter(right, study, targets, 16.0)
    to_scale(right, 0.88)
    right.view_init(35, -40)
    right.set_title("(b) The path close by", loc="left")
    return figure


def _time_frame(study: Study, axes: Any, ylabel: str, title: str) -> None:
    """Shade the parts of the path that are outside or on the contour, and label the axes."""
    share, place = study.path.share, study.path.place
    for value, colour in ((-1, "#D55E00"), (0, "#E69F00")):
        chosen = np.concatenate(([False], place == value, [False]))
        starts, ends = np.flatnonzero(~chosen[:-1] & chosen[1:]), np.flatnonzero(chosen[:-1] & ~chosen[1:]) - 1
        for start, end in zip(starts, ends, strict=True):
            axes.axvspan(share[start], share[end], color=colour, alpha=0.13, linewidth=0, zorder=0)
    axes.set(xlim=(0, 1), xlabel="length along the path / whole length [-]", ylabel=ylabel)
    axes.set_title(title, loc="left")


def _shades(axes: Any) -> None:
    axes.fill([], [], color="#D55E00", alpha=0.25, label="outside the scaled region")
    axes.fill([], [], color="#E69F00", alpha=0.25, label="on its contour")


def figure_20(study: Study) -> Any:
    """Draw the joint angles along the path."""
    figure, (axes,) = frames(9.6, 4.8)
    q = np.degrees(study.path.solution.q)
    for index, (name, style) in enumerate(zip(study.robot.coordinates, ("-", (0, (5, 2)), (0, (1, 1))), strict=False)):
        axes.plot(study.path.share, q[:, index], linestyle=style, color=PALETTE[index], linewidth=2.2, label=name)
    _shades(axes)
    worst = float(np.max(study.path.solution.residuals))
    reached = f"{int(study.path.solution.reached.sum())} of {len(q)} targets reached, residual below {worst:.0e} m"
    _time_frame(study, axes, "joint angle [deg]", f"Inverse kinematics: {reached}")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    return figure


def figure_21(study: Study) -> Any:
    """Draw the classified points of the path, in the plane and in the prism over q1."""
    figure, right, left = mixed(13.4, 6.4, spatial_first=False)
    coordinates = study.robot.coordinates
    q = np.degrees(study.path.solution.q)
    X = q[:, [coordinates.index(name) for name in study.region.coordinates]]
    for region, style, name in ((study.region, "-", "region"), (study.scaled, (0, (5, 2)), f"scaled by {FACTOR:g}")):
        ring = np.degrees(np.vstack((region.vertices, region.vertices[:1])))
        left.plot(*ring.T, color="#333333", linestyle=style, linewidth=1.5, label=name)
        q1 = np.degrees([study.body.lower, study.body.upper])
        for end in q1:
            right.plot(np.full(len(ring), end), *ring.T, color="#333333", linestyle=style, linewidth=1.3)
        for vertex in ring[:-1]:
            right.plot(q1, *np.repeat(vertex[:, None], 2, axis=1), color=GREY, linestyle=style, linewidth=0.8)
    left.fill(*np.degrees(study.scaled.vertices).T, color=FILL, zorder=1)
    _scatter(left, study, X, 18.0)
    left.set(aspect="equal", xlabel="q2 [deg]", ylabel="q3 [deg]")
    left.set_title("(a) With regard to the scaled region", loc="left")
    left.legend(loc="upper center", bbox_to_anchor=(0.5, -0.1), ncols=3, frameon=False)
    _scatter(right, study, np.column_stack((q[:, coordinates.index("q1")], X)), 10.0)
    right.set_xlabel("q1 [deg]", labelpad=8)
    right.set_ylabel("q2 [deg]", labelpad=8)
    right.set_zlabel("q3 [deg]", labelpad=6)
    right.set_yticks([0, 20, 40, 60])
    right.set_box_aspect((1.6, 1, 1), zoom=0.92)
    right.view_init(22, -58)
    right.set_title("(b) Prism over q1 in ±135°", loc="left")
    return figure


def figure_22(study: Study) -> Any:
    """Draw mu_1, mu_2, mu_3 along the path, and the signed distance beside them."""
    figure, (axes,) = frames(9.8, 6.2)
    found, share = study.path.membership, study.path.share
    styles = ("-", (0, (5, 2)), (0, (7, 2, 1, 2)))
    for index, (name, style) in enumerate(zip(found.coordinates, styles, strict=False)):
        number = name.removeprefix("q")
        axes.plot(share, np.degrees(found.mu[:, index]), linestyle=style, color=PALETTE[index], linewidth=2.0)
        axes.lines[-1].set_label(f"$\\mu_{number}$, third line $q_{{max}} - q$")
    differs = np.any(found.mu != found.mu_printed, axis=0)
    for index in np.flatnonzero(differs):
        printed = np.where(found.mu[:, index] != found.mu_printed[:, index], found.mu_printed[:, index], np.nan)
        label = f"$\\mu_{index + 1}$ as printed, where it differs"
        axes.plot(share, np.degrees(printed), linestyle=(0, (1, 1)), color=PALETTE[index], linewidth=2.4, label=label)
    axes.plot(
        share, np.degrees(found.signed_distance), color="black", linewidth=2.4, label="signed distance, scaled region"
    )
    axes.axhline(0.0, color="#333333", linewidth=0.9)
    _shades(axes)
    _time_frame(study, axes, "membership [deg]", "Membership in the scaled region, as in Eq. (21), and signed distance")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    return figure
