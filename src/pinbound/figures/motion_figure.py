"""The figure of a motion over time: clearances, and membership if there is a region (the paper's Fig. 22)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from textwrap import wrap
from typing import Any, cast

import numpy as np

from pinbound import units
from pinbound.certificates import Certificate, Verdict
from pinbound.extras import Needs
from pinbound.figures.canvas import new_axes, without_math
from pinbound.figures.colours import order_of, style_of
from pinbound.motion.history import MotionHistory, tightest
from pinbound.region import Place, Region

__all__ = ["certificate_axes", "draw_motion", "draw_paths"]

_PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
_STYLES = ("-", "--", "-.", ":", (0, (5, 1, 1, 1)), (0, (1, 1)))
_GREY = "#B0B0B0"
_CONTACT = "#7A1F1F"
_MOST = len(_PALETTE)
_MOST_BARS = 24


def draw_motion(
    seen: MotionHistory, certificate: Certificate | None = None, clock: str = "time", region: Region | None = None
) -> Any:
    """Draw signed clearances over time, and below them memberships and signed distance if there is a region.

    Args:
        seen: The sampled motion.
        certificate: Its certificate; first contacts and undecided parts are marked.
        clock: The label of the time axis, e.g. ``"time [s]"`` or ``"waypoint"``.
        region: A region on the same page: boundaries have the same colours as there. None: the six boundaries nearest
            to contact have six colours.

    Returns:
        A matplotlib figure.
    """
    with Needs("plots", "a figure"):
        from matplotlib.figure import Figure

    rows = 1 if seen.mu is None else 2
    figure = cast(Any, Figure(figsize=(8.2, 3.4 * rows + 0.6), layout="constrained"))
    panels = figure.subplots(rows, 1, sharex=True, squeeze=False)[:, 0]
    for axes in panels:
        axes.grid(True, color="#E6E6E6", linewidth=0.6)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
        axes.axhline(0.0, color="#333333", linewidth=1.0)
    _clearances(panels[0], seen, region)
    if seen.mu is not None:
        _membership(panels[1], seen)
    if certificate is not None:
        _marks(panels[0], certificate)
        panels[0].set_title(_title(certificate), loc="left", fontsize=10)
    for axes in panels:
        axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False, fontsize=8)
        axes.margins(x=0.0)
    panels[-1].set_xlabel(clock)
    return without_math(figure)


def certificate_axes(certificate: Certificate, axes: Any = None) -> Any:
    """Draw the bounds of the smallest clearance of each boundary over a motion, and return the axes.

    Args:
        certificate: The certificate; its boundaries with the smallest clearances are drawn, at most 24.
        axes: Matplotlib axes; None: those of a new figure.
    """
    found = certificate.boundaries
    order: list[int] = np.argsort(found.upper, kind="stable")[:_MOST_BARS].tolist()
    axes = new_axes(8.2, 1.4 + 0.3 * max(len(order), 1), axes)
    colours = {Verdict.CERTIFIED: _PALETTE[0], Verdict.VIOLATED: _PALETTE[1], Verdict.UNDECIDED: _PALETTE[4]}
    for place, row in enumerate(order):
        one = found[row]
        low, high = (1e3 * bound if math.isfinite(bound) else 0.0 for bound in (one.lower, one.upper))
        label = one.verdict.value if one.verdict.value not in axes.get_legend_handles_labels()[1] else None
        end = low if one.verdict is Verdict.CERTIFIED else high
        axes.barh(place, end, color=colours[one.verdict], height=0.6, label=label, zorder=2)
        axes.plot([low, high], [place, place], color="#333333", linewidth=1.2, marker="|", markersize=7, zorder=3)
    axes.axvline(0.0, color="#333333", linewidth=1.0)
    axes.set_yticks(range(len(order)), [found.names[row] for row in order])
    axes.set_ylim(max(len(order), 1) - 0.4, -0.6)
    axes.set_xlabel("smallest clearance over the motion [mm], and its proven bounds")
    rest = f" ({len(found) - len(order)} more, further away)" if len(found) > len(order) else ""
    title = f"{certificate.verdict.value.upper()}: {certificate.coverage}{rest}"
    axes.set_title("\n".join(wrap(title, 90)), loc="left", fontsize=9)
    if len(order):
        axes.legend(loc="upper right", fontsize=8)
    return without_math(axes)


def draw_paths(region: Region, paths: Mapping[str, MotionHistory], margin: Region | None = None) -> Any:
    """Draw motions in the slice of a region, with samples outside it marked (the paper's Fig. 21).

    Args:
        region: The region; its edges are named.
        paths: Histories by label, each made with a region of the same slice.
        margin: A smaller region inside, drawn as a dashed outline.

    Returns:
        A matplotlib figure.
    """
    with Needs("plots", "a figure"):
        from matplotlib.figure import Figure

    figure = cast(Any, Figure(figsize=(7.6, 6.4), layout="constrained"))
    axes = figure.add_subplot()
    scale = units.factors(region.units)
    vertices, centre = scale * region.vertices, scale * region.centroid
    axes.fill(*vertices.T, color="#DCEBF5", zorder=1)
    for edge in region.edges:
        ends = scale * np.array([edge.start, edge.end])
        axes.plot(*ends.T, color="#333333", linewidth=1.6, zorder=2)
        middle = ends.mean(axis=0)
        direction = np.array([ends[1, 1] - ends[0, 1], ends[0, 0] - ends[1, 0]])
        place = middle + 3.2 * direction / np.linalg.norm(direction)
        side = "left" if place[0] > centre[0] else "right"
        axes.text(*place, edge.name, ha=side, va="center", fontsize=9, color="#333333")
    if margin is not None:
        outline = scale * np.vstack([margin.vertices, margin.vertices[:1]])
        axes.plot(*outline.T, color="#333333", linewidth=0.9, linestyle=(0, (4, 3)), label="margin", zorder=2)
    columns = [region.robot_coordinates.index(name) for name in region.coordinates]
    for row, (label, seen) in enumerate(paths.items()):
        points = scale * seen.Q[:, columns]
        axes.plot(*points.T, color=_PALETTE[row], linewidth=1.8, linestyle=_STYLES[row], label=label, zorder=3)
        outside = np.asarray(seen.places) == Place.OUTSIDE
        if np.any(outside):
            style = {"s": 16, "marker": "x", "color": _CONTACT, "linewidth": 0.9, "zorder": 4}
            axes.scatter(*points[outside].T, label=f"{label}: outside", **style)
    a, b = units.names(region.units)
    axes.set(xlabel=f"{region.coordinates[0]} [{a}]", ylabel=f"{region.coordinates[1]} [{b}]")
    axes.set_aspect("equal" if a == b else "auto")
    axes.set_title("Motions in the plane of the feasible region", loc="left", fontsize=10)
    axes.margins(x=0.2, y=0.1)
    axes.set_axisbelow(True)
    axes.grid(True, color="#E6E6E6", linewidth=0.6)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False, fontsize=9)
    return without_math(figure)


def _clearances(axes: Any, seen: MotionHistory, region: Region | None) -> None:
    millimetres = 1e3 * seen.clearances
    shown = tightest(seen.boundaries, seen.clearances, _MOST) if seen.boundaries else []
    rest = [column for column in range(len(seen.boundaries)) if column not in shown]
    for column in rest:
        label = f"{len(rest)} others" if column == rest[0] else None
        axes.plot(seen.times, millimetres[:, column], color=_GREY, linewidth=0.8, label=label, zorder=1)
    order = order_of(region, seen.boundaries)
    for place, column in enumerate(shown):
        name = seen.boundaries[column]
        colour = _PALETTE[place] if region is None else style_of(name, order)["color"]
        style = {"color": colour, "linestyle": _STYLES[place], "linewidth": 1.6, "zorder": 3}
        axes.plot(seen.times, _broken(millimetres[:, column]), label=name, **style)
    low, high = axes.get_ylim()
    low = min(low, -0.06 * (high - low))
    axes.set_ylim(low, high)
    axes.axhspan(low, 0.0, color="#F6E3E3", zorder=0, label="contact, or beyond")
    axes.set_ylabel("signed clearance [mm]")


def _broken(values: Any) -> Any:
    """Leave a gap where the sign jumps: a contact line was crossed, and the norm did not become zero."""
    jump = np.flatnonzero((values[1:] > 0.0) != (values[:-1] > 0.0))
    steps = np.abs(np.diff(values))
    typical = np.median(steps) if steps.size else 0.0
    shown = values.copy()
    shown[[row + 1 for row in jump if steps[row] > 20.0 * typical]] = np.nan
    return shown


def _membership(axes: Any, seen: MotionHistory) -> None:
    for place, name in enumerate(seen.coordinates):
        if not seen.angles[place]:
            continue
        values = np.degrees(cast(Any, seen.mu)[:, place])
        style = {"color": _PALETTE[place % _MOST], "linestyle": _STYLES[place % _MOST], "linewidth": 1.3}
        axes.plot(seen.times, values, label=f"\N{GREEK SMALL LETTER MU} of {name}", **style)
    factor, unit = (
        (units.factors([seen.unit])[0], units.names([seen.unit])[0]) if seen.unit in ("rad", "m") else (1.0, "1")
    )
    distance = factor * cast(Any, seen.signed_distance)
    axes.plot(seen.times, distance, color="black", linewidth=2.0, label="signed distance\nto the region")
    axes.fill_between(seen.times, distance, 0.0, where=distance < 0.0, color="#F6E3E3")
    axes.set_ylabel(f"inside by [{unit}]" if unit == "deg" else f"signed distance [{unit}], mu [deg]")


def _marks(axes: Any, certificate: Certificate) -> None:
    for place, finding in enumerate(certificate.violations):
        if finding.contact is None:
            continue
        label = "first contact" if place == 0 else None
        axes.axvline(finding.contact.after, color=_CONTACT, linewidth=1.0, linestyle=":", label=label, zorder=2)
    for part in certificate.open_parts:
        axes.axvspan(part.start, part.end, color="#FFF3C4", zorder=0)


def _title(certificate: Certificate) -> str:
    found = certificate.tightest
    if found is None:
        return certificate.verdict.value
    if certificate.verdict is Verdict.VIOLATED:
        first = certificate.violations[0]
        moment = first.contact.after if first.contact else np.nan
        return f"violated: {first.name} at {moment:.6g}; deepest {1e3 * found.upper:.3f} mm ({found.name})"
    return (
        f"{certificate.verdict.value}: smallest clearance {1e3 * found.lower:.4f} to {1e3 * found.upper:.4f} mm, "
        f"{found.name} at {found.time:.6g}"
    )
