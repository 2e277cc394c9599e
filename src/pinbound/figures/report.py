"""The HTML report: region, boundaries, formulas, bodies and notes of a robot, on one page."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from pinbound import units
from pinbound.annotations import Mark
from pinbound.boundaries.boundary import Boundary
from pinbound.boundaries.looped import over_z
from pinbound.certificates import Budget
from pinbound.coverage.bodies import Body, collision_bodies
from pinbound.exceptions import DimensionError, UnknownNameError, UnsupportedError
from pinbound.extras import require
from pinbound.figures import plots
from pinbound.figures.canvas import save
from pinbound.figures.colours import PALETTE, order_of, style_of
from pinbound.figures.cover_figure import CoverPicture, draw_cover, picture_of
from pinbound.figures.free_figure import draw_free
from pinbound.figures.report_joints import closure_rows, limit_rows, loop_rows, solved_joints, tree_rows
from pinbound.figures.workspace_image import workspace_image
from pinbound.freespace import FreeVolume, free_volume
from pinbound.region import Region, feasible_region
from pinbound.robot.loop_robot import LoopRobot
from pinbound.robot.robot import Robot
from pinbound.units import several

_REGION_SECONDS = 20.0  # budget of the region, as in the explorer
_FREE_SECONDS, _FREE_SHARE = 5.0, 0.97  # the free volume stops after this time, or when this share of it is decided
_MOST_FORMULAS = 200
_MOST_BYTES = 400_000  # largest size of all formulas together

__all__ = ["BoundaryRow", "boundary_rows", "tool_link", "write_covers", "write_report"]


@dataclass(frozen=True)
class BoundaryRow:
    """The row of one boundary in the report.

    Attributes:
        boundary: The boundary.
        contact: Effective angle and contact angle, for people.
        status: ``"active"``: it is an edge of the region; ``"implied"``: edges keep the region away from its contact
            line; ``"not an edge"``: its contact curve is elsewhere in the window; ``"no contact here"``: the window has
            no contact; ``"constant"``: its clearance is the same everywhere in the plane; ``"never in contact"``;
            ``"no region"``.
        by: The edges that imply it.
        slack: The distance of the region from a contact that is no edge: [deg], in a plane of prismatic joints [mm];
            NaN if there is no such contact, or if the plane has an angle and a length.
        unit: Unit of the slack: ``"°"`` or ``" mm"``.
    """

    boundary: Boundary
    contact: str
    status: str
    by: tuple[str, ...]
    slack: float
    unit: str = "°"

    @property
    def where(self) -> str:
        """How the boundary limits the region, as text for people."""
        away = f"{self.slack:.4f}{self.unit} away" if np.isfinite(self.slack) else ""
        if self.status == "active":
            return "an edge"
        if self.status == "implied":
            return f"implied by {' and '.join(self.by)}" + (f", {away}" if away else "")
        return self.status + (f": {away}" if away else "")


def boundary_rows(robot: Robot, region: Region | None) -> list[BoundaryRow]:
    """Return one row for each boundary: its contact, whether it is an edge, and the edges that imply it."""
    supports = region.supports() if region is not None else {}
    edges = {edge.source for edge in region.edges} if region is not None else set[str]()
    rows: list[BoundaryRow] = []
    for boundary in robot.boundaries:
        one = over_z(boundary)  # its only angle may be that of a passive joint
        contact = one.contact
        if contact is None and one.contacts:
            strips = [f"{np.degrees(c.angle):.6f} ± {np.degrees(c.half_width or 0.0):.6f}" for c in one.contacts]
            text, status = f"{one.contacts[0].text} = {' and '.join(strips)}°", "no region"
        elif contact is None:
            text, status = "a curve", "no region"
        elif contact.half_width is None:
            text, status = f"never: |r| ≥ {1e3 * contact.smallest:.3f} mm", "never in contact"
        else:
            width = f" ± {np.degrees(contact.half_width):.6f}" if contact.half_width else ""
            text, status = f"{contact.text} = {np.degrees(contact.angle):.9f}{width}°", "no region"
        by, slack, unit = (), np.nan, "°"
        if region is not None and status != "never in contact":
            found = supports.get(boundary.name)
            by = found.by if found and boundary.name not in edges else ()
            if boundary.name in edges:
                status = "active"
            elif found is not None:
                status = "implied" if by else "not an edge"
                metres = region.units == ("m", "m")
                slack, unit = (1e3 * found.slack, " mm") if metres else (float(np.degrees(found.slack)), "°")
            else:
                moves = set(boundary.coordinates) & set(region.coordinates)
                status = "no contact here" if moves else "constant"
        rows.append(BoundaryRow(boundary, text, status, by, slack, unit))
    return rows


def tool_link(robot: Robot, frame: str | None = None) -> str:
    """Return the link whose origin the workspace figure shows: the given link, or the deepest leaf of the tree.

    Raises:
        UnknownNameError: If there is no such link.

    Example:
        >>> import pinbound as pb
        >>> tool_link(pb.load("minervabot_v3"))
        'link_6'
    """
    if frame is not None and frame not in robot.tree.links:
        raise UnknownNameError("link", frame, robot.tree.links)
    return frame or max(robot.tree.walk(), key=lambda step: step[2])[0].name


def write_report(
    robot: Robot,
    out: Path,
    frame: str | None = None,
    free: Sequence[str] | None = None,
    coordinates: Sequence[str] | None = None,
) -> tuple[Path, list[BoundaryRow]]:
    """Write `index.html` and its figures (SVG and PNG) into a folder.

    Args:
        robot: The robot.
        out: The folder; it is made if it does not exist. Files of the same names are replaced; others are kept.
        frame: The link whose origin is the tool point; the deepest leaf by default.
        free: Two or three coordinates whose free volume is drawn; the others are at home. Default: of the coordinates
            with limits, the three that most boundaries depend on; no volume is drawn if there are fewer.
        coordinates: The two coordinates of the region; the others are at home. Default: those that the boundaries use.
            If the boundaries use more than two: of those with limits, the two that most boundaries depend on.

    Returns:
        The path of the page, and the rows of its boundary table.

    Raises:
        UnsupportedError: If the extra `report` is not installed, or more than three coordinates are to be drawn.
        UnknownNameError: If the robot has no coordinate of that name.
    """
    require("report", "a report")
    import jinja2

    tool = tool_link(robot, frame)
    region, reason = _region(robot, coordinates)
    out.mkdir(parents=True, exist_ok=True)
    figures = {"robot": plots.draw_robot(robot, robot.home, region)}
    implied = _implied_lines(robot, region) if region is not None else []
    image = None if region is None else workspace_image(robot, region, tool)
    if region is not None:
        figures["region"] = plots.draw_region(region, _in_plane(region, robot.home), implied)
        figures["workspace"] = plots.draw_workspace(robot, region, tool, image)
    volume, no_volume = _volume(robot, free)
    for name, figure in figures.items():
        save(figure, out / name)
    if volume is not None:
        draw_free(robot, volume).savefig(out / "free.png", dpi=130)  # no SVG: it has thousands of faces
    covers = list(write_covers(robot, out))
    rows = boundary_rows(robot, region)
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("pinbound"), autoescape=True, trim_blocks=True, lstrip_blocks=True
    )
    closures, samples = closure_rows(robot)
    formulas = _formulas(robot, {row.boundary.name for row in rows if row.status == "active"})
    page = environment.get_template("report.html.j2").render(
        robot=robot,
        region=region,
        reason=reason,
        volume=volume,
        no_volume=no_volume,
        volume_unit="" if volume is None else _volume_unit(robot, volume),
        rows=rows,
        tool=tool,
        image=image,
        covers=covers,
        tree=list(tree_rows(robot)),
        limits=limit_rows(robot),
        loops=loop_rows(robot),
        formulas=formulas,
        solved={name: solved_joints(robot, robot.boundaries[name]) for name in formulas},
        implied=implied,
        exactness="" if region is None else _exactness(region),
        swatches=_swatches(robot, region),
        closures=closures,
        samples=samples,
        amount=units.amount,
        several=units.several,
        units=units.names(region.units) if region else (),
        area_unit=units.area_name(region.area_unit) if region else "",
        shown=partial(units.shown, units=region.units if region else ()),
    )
    target = out / "index.html"
    target.write_text(page, encoding="utf-8")
    return target, rows


def write_covers(robot: Robot, out: Path) -> Iterator[tuple[str, str, str]]:
    """Write a picture of every link that has bodies and marks; yield link, file name, and the caption.

    If all marks of a link are points of radius 0, there is no surface to show: no file is written, and its name is "".
    """
    by_link: dict[str, list[Body]] = {}
    for body in collision_bodies(robot):
        by_link.setdefault(body.link, []).append(body)
    shown: dict[int, CoverPicture | str] = {}
    for index, (link, bodies) in enumerate(by_link.items()):
        marks = [one for one in robot.annotations.marks.values() if one.link == link and not one.shape.is_unbounded]
        if all(one.shape.radius == 0.0 and len(one.shape.vertices) == 1 for one in marks):
            if marks:
                shown[index] = f"{_said_of(robot, link, bodies, marks)}; its marks are points without a surface"
            continue
        readable = [body.shape == "mesh" and not robot.meshes.fault(body) for body in bodies]
        meshes = [robot.meshes.of(body) if one else None for body, one in zip(bodies, readable, strict=True)]
        shown[index] = picture_of(link, bodies, meshes, marks)
    scale = max((one.furthest for one in shown.values() if not isinstance(one, str)), default=0.0)
    links = list(by_link)
    for index, picture in shown.items():
        if isinstance(picture, str):
            yield links[index], "", picture
            continue
        said = _said_of(robot, picture.link, picture.bodies, picture.marks)
        figure = draw_cover(picture, said, scale)
        name = f"cover_{index}.png"
        figure.savefig(out / name, dpi=130)
        yield picture.link, name, f"{said}; furthest place seen {1e3 * picture.furthest:.2f} mm from the bodies"


def _said_of(robot: Robot, link: str, bodies: Sequence[Body], marks: Sequence[Mark]) -> str:
    coverage = robot.coverage.links[link]
    shapes = ", ".join(several(count, shape) for shape, count in Counter(body.shape for body in bodies).items())
    held = len(coverage.held)
    proven = "held, proven" if held == len(bodies) else f"{held} of {len(bodies)} bodies proven to be held"
    return f"{shapes}; {several(len(marks), 'mark')}; {proven}"


def _formulas(robot: Robot, edges: set[str]) -> dict[str, dict[str, tuple[str, ...]]]:
    """Return the printed formulas by boundary: short formulas of points and segments, with those of edges first."""
    plain = [one for one in robot.boundaries if over_z(one).path.is_short]
    found: dict[str, dict[str, tuple[str, ...]]] = {}
    left = _MOST_BYTES
    for boundary in sorted(plain, key=lambda one: one.name not in edges)[:_MOST_FORMULAS]:
        forms = _forms(boundary)
        size = sum(len(component) for components in forms.values() for component in components)
        if size <= left:
            found[boundary.name] = forms
            left -= size
    return {name: found[name] for name in robot.boundaries.names if name in found}


def _exactness(region: Region) -> str:
    """Return one or two sentences about how exact the edges of a region are."""
    to = " and ".join(dict.fromkeys(units.amount(region.accuracy, unit) for unit in region.units))
    if region.width:
        low, high = region.area_interval
        return (
            f"Edges without a formula are enclosed in cells of the width {region.width:g}. The true area is "
            f"proven to be between {low:.6g} and {high:.6g} {units.area_name(region.area_unit)}."
        )
    if region.accuracy:
        return f"Straight edges are exact. Curved edges are within {to} of the contact."
    return "All edges are straight and exact."


def _swatches(robot: Robot, region: Region | None) -> dict[str, str]:
    """Return the CSS of the line with which the figures of the page draw each edge."""
    if region is None:
        return {}
    order = order_of(region, robot.boundaries.names)
    shown = {edge.name for edge in region.edges}
    kinds = ("solid", "dashed", "dotted", "double")
    return {
        name: f"border-color: {style_of(name, order)['color']}; "
        f"border-style: {kinds[order.index(name) // len(PALETTE) % len(kinds)]} none none"
        for name in order
        if name in shown
    }


def _region(robot: Robot, names: Sequence[str] | None) -> tuple[Region | None, str]:
    """Return the region that is drawn, or the reason why there is none."""
    used = {name for boundary in robot.boundaries for name in boundary.coordinates}
    asked = names or (_most_used(robot, 2) if len(used) > 2 else None) or None
    try:
        return feasible_region(robot, asked, budget=_REGION_SECONDS), ""
    except (DimensionError, UnsupportedError) as error:
        if names is not None:
            raise
        return None, str(error)


def _volume(robot: Robot, names: Sequence[str] | None) -> tuple[FreeVolume | None, str]:
    """Return the free volume that is drawn, or the reason why there is none; "" if too few coordinates have limits."""
    asked = names if names is not None else _most_used(robot, 3)
    if not asked:
        return None, ""
    if names is None and isinstance(robot, LoopRobot):
        return None, "free volumes through loops that are not parallelograms are not computed"
    try:
        return free_volume(robot, asked, budget=Budget(seconds=_FREE_SECONDS), decided=_FREE_SHARE), ""
    except (DimensionError, UnsupportedError) as error:
        if names is not None:
            raise
        return None, str(error)


def _most_used(robot: Robot, count: int) -> list[str]:
    """Return the `count` coordinates with limits that most boundaries depend on, in the robot's order; [] if fewer."""
    used = Counter(name for boundary in robot.boundaries for name in boundary.coordinates)
    held = np.isfinite(robot.lower) & np.isfinite(robot.upper) & (robot.lower < robot.upper)
    bounded = [name for name, one in zip(robot.coordinates, held.tolist(), strict=True) if one and used[name]]
    most = sorted(bounded, key=lambda name: -used[name])[:count]
    return [name for name in bounded if name in most] if len(most) == count else []


def _volume_unit(robot: Robot, volume: FreeVolume) -> str:
    return units.area_name(units.product(["rad" if robot.turns(name) else "m" for name in volume.coordinates]))


def _in_plane(region: Region, q: Any) -> Any:
    return q[[region.robot_coordinates.index(name) for name in region.coordinates]]


def _implied_lines(robot: Robot, region: Region) -> list[tuple[str, Any, float]]:
    """Return the contact lines that are implied: name, normal in the plane, value [rad]."""
    supports = region.supports()
    names = {b.name for b in robot.boundaries if b.name in supports and supports[b.name].by}
    nearest: dict[str, tuple[float, Any, float]] = {}
    for plane in region.half_planes:
        slack = plane.bound - float(np.max(region.vertices @ plane.normal))
        if plane.name in names and slack < nearest.get(plane.name, (np.inf, None, 0.0))[0]:
            nearest[plane.name] = (slack, plane.normal, plane.bound)
    return [(name, normal, bound) for name, (_, normal, bound) in nearest.items()]


def _forms(boundary: Boundary) -> dict[str, tuple[str, ...]]:
    """Return the components of the paper's form as MathML, and those of the minimal form if it differs.

    With loops that are not parallelograms, the components are functions of all joints, including passive joints.
    """
    from pinbound.evaluate import symbolic

    one = over_z(boundary)
    ancestor, minimal = one.expression("ancestor"), one.expression()
    formulas = {f"in {boundary.ancestor}": symbolic.mathml(ancestor)}
    return formulas if ancestor == minimal else formulas | {"minimal": symbolic.mathml(minimal)}
