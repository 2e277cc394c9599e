"""`pinbound info`, `limits`, `region`: print the data of a robot, its limits, and its region."""

from __future__ import annotations

import math
from typing import Annotated, Any

import numpy as np
import typer
from rich.text import Text

from pinbound.annotations import FIELDS, Mark, kind_of
from pinbound.boundaries.boundary_set import CoordinateLimits
from pinbound.cli.coverage import (
    RequireCoverage,
    coverage_record,
    print_coverage,
    require_coverage,
    say_assumptions,
    say_coverage,
)
from pinbound.cli.rules import opened, rule_rows
from pinbound.cli.shared import (
    Annotations,
    AsJson,
    PackageDirs,
    RobotName,
    Window,
    XacroArgs,
    console,
    emit_json,
    load_robot,
    millimetres,
    parse_configuration,
    parse_window,
    print_table,
    working,
)
from pinbound.coverage import Coverage
from pinbound.loops.closures import Closure
from pinbound.model.coupling import linear_text
from pinbound.region import Region, feasible_region
from pinbound.robot.robot import Robot
from pinbound.tolerances import REGION_BUDGET
from pinbound.units import amount, factors, names, several, shown

__all__ = ["info", "limits", "region"]

At = Annotated[
    str | None, typer.Option(help="Configuration, e.g. q2=0.1,q3=-0.2. Coordinates not given have home's value.")
]
DegreesAt = Annotated[bool, typer.Option("--deg", help="Angles of --at are in degrees.")]
Degrees = Annotated[bool, typer.Option("--deg", help="Angles of --at and --window are in degrees.")]
InPlane = Annotated[
    str | None, typer.Option("--coordinates", help="Two coordinates, e.g. q2,q3. Default: those of the boundaries.")
]
Budget = Annotated[
    float, typer.Option(help="Time limit in seconds. After it the answer lists what is unresolved. inf: no limit.")
]
Width = Annotated[
    float | None,
    typer.Option(
        help="Width in rad of the cells that enclose the contact curves of boxes and prisms that turn by several "
        "angles. Default: 0.002; two or four times that for long curves.",
        show_default=False,
    ),
]
Pairs = Annotated[
    bool, typer.Option("--pairs", help="List every pair of links with bodies: watched, left out, or not watched.")
]


def info(
    robot: RobotName,
    pairs: Pairs = False,
    annotations: Annotations = None,
    package_dir: PackageDirs = None,
    xacro_arg: XacroArgs = None,
    as_json: AsJson = False,
) -> None:
    """Print joints, limits, couplings, closures with their residuals, marks, coverage, notes and assumptions."""
    loaded = load_robot(robot, annotations, package_dir, xacro_arg)
    if as_json:
        emit_json(_info_record(loaded))
        return
    out = console()
    counts = f"{several(len(loaded.coordinates), 'coordinate')}, {several(len(loaded.tree.links), 'link')}"
    out.print(Text(loaded.name, "bold"), f": {counts}", sep="")
    print_table("Joints", ("joint", "type", "moves", "home", "limits"), _joint_rows(loaded))
    if loaded.annotations.rules:
        print_table("Rules", ("rule", "binds", "where"), rule_rows(loaded, for_people=True))
    if loaded.closures:
        rows = [(c.name, f"{c.mark.link_a} - {c.mark.link_b}", f"{c.bound:.1e}", _off(c)) for c in loaded.closures]
        headings = ("closure", "links", "largest residual, for every q [m]", "largest error of joints [rad]")
        print_table("Closures", headings, rows)
    rows = [
        (p.name, p.link, *(millimetres(x, 3) for x in p.xyz), millimetres(p.radius, 3))
        for p in loaded.annotations.points.values()
    ]
    if rows:
        print_table("Marked points", ("point", "link", "x [mm]", "y [mm]", "z [mm]", "radius [mm]"), rows)
    points = loaded.annotations.points
    others = [mark for name, mark in loaded.annotations.marks.items() if name not in points]
    if others:
        rows = [(m.name, kind_of(m), m.link, *_vectors(m), millimetres(m.radius, 3)) for m in others]
        headings = ("mark", "kind", "link", "from [mm]", "to, or edge vectors [mm]; or direction []", "radius [mm]")
        print_table("Segments, boxes, hulls, lines and planes", headings, rows)
    out.print(f"{several(len(loaded.boundaries), 'boundary')}: {', '.join(loaded.boundaries.names) or 'none'}")
    print_coverage(loaded.coverage, pairs)
    stops = [f"{b.name} ({millimetres(b.contact_distance, 3)})" for b in loaded.boundaries if b.is_stop]
    if stops:
        out.print(
            f"{len(stops)} stops, with the difference of their arm lengths in mm: {', '.join(stops)}", markup=False
        )
    for heading, lines in (("Notes", loaded.notes), ("Assumptions", loaded.annotations.assumptions)):
        if lines:
            out.print(heading, style="bold")
            for line in lines:
                out.print(f"- {line}", markup=False)


def _off(closure: Closure) -> str:
    return ", ".join(f"{one.joint} {one.bound:.1e}" for one in closure.deviations) or "0"


def _vectors(mark: Mark) -> tuple[str, str]:
    shape = mark.shape
    first = " ".join(millimetres(x, 3) for x in shape.origin)
    if shape.normal is not None:
        return first, " ".join(f"{x:.6g}" for x in shape.normal)
    if shape.is_point or shape.is_segment:
        return first, " ".join(millimetres(x, 3) for x in shape.vertices[-1])
    if not shape.is_zonotope:
        return first, f"{len(shape.vertices)} vertices around it"
    return first, "; ".join(" ".join(millimetres(x, 3) for x in edge) for edge in shape.directions)


def _joint_rows(robot: Robot) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = []
    for joint in robot.tree.moving_joints:
        home = "-"
        if joint.name in robot.coordinates:
            home = _amount(robot, joint.name, float(robot.home[robot.coordinates.index(joint.name)]))
        ends = f"{_amount(robot, joint.name, joint.lower)} .. {_amount(robot, joint.name, joint.upper)}"
        rows.append((joint.name, joint.type, robot.coupling.text(joint.name), home, ends))
    for axis in robot.annotations.axes:
        terms = linear_text(np.array(list(axis.coefficients.values())), list(axis.coefficients))
        home = _amount(robot, axis.name, float(robot.home[robot.coordinates.index(axis.name)]))
        rows.append((axis.name, "axis", terms, home, "those of its joints"))
    return rows


def _amount(robot: Robot, joint: str, value: float) -> str:
    if not math.isfinite(value):
        return "none"
    return f"{math.degrees(value):.6g} deg" if robot.turns(joint) else f"{1e3 * value:.6g} mm"


def _info_record(robot: Robot) -> dict[str, Any]:
    is_linear = opened(robot) is robot
    return {
        "name": robot.name,
        "coordinates": robot.coordinates,
        "lower": robot.lower,
        "upper": robot.upper,
        "home": robot.home,
        "joints": robot.coupling.joints,
        "S": robot.coupling.S if is_linear else None,
        "offset": robot.coupling.offset if is_linear else None,
        "moves": {joint: robot.coupling.text(joint) for joint in robot.coupling.joints},
        "links": list(robot.tree.links),
        "closures": [
            {"name": c.name, "residual_bound": c.bound, "joint_errors": {d.joint: d.bound for d in c.deviations}}
            for c in robot.closures
        ],
        "points": [_mark_record(mark) for mark in robot.annotations.points.values()],
        "marks": [_mark_record(mark) for mark in robot.annotations.marks.values()],
        "boundaries": robot.boundaries.names,
        "rules": [{"name": name, "binds": binds, "where": where} for name, binds, where in rule_rows(robot)],
        "contact_tolerance": robot.annotations.contact_tolerance,
        "coverage": _coverage_record(robot.coverage),
        "notes": robot.notes,
        "assumptions": robot.annotations.assumptions,
    }


def _coverage_record(coverage: Coverage) -> dict[str, Any]:
    return coverage_record(coverage.record) | {
        "bodies_by_link": {
            link.name: [
                {"index": b.index, "shape": b.shape, "held_by": b.held_by, "reason": b.reason} for b in link.bodies
            ]
            for link in coverage.links.values()
        },
        "pairs_of_links": [
            {
                "links": pair.links,
                "status": pair.status.value,
                "reason": pair.reason,
                "basis": pair.basis and pair.basis.value,
                "boundaries": pair.boundaries,
            }
            for pair in coverage.pairs
        ],
        "notes": coverage.notes,
    }


def _mark_record(mark: Mark) -> dict[str, Any]:
    required, optional = FIELDS[kind_of(mark)]
    return {"kind": kind_of(mark)} | {key: getattr(mark, key) for key in (*required, *optional)}


def limits(
    robot: RobotName,
    at: At = None,
    deg: DegreesAt = False,
    annotations: Annotations = None,
    package_dir: PackageDirs = None,
    xacro_arg: XacroArgs = None,
    as_json: AsJson = False,
) -> None:
    """Print how far each coordinate can move from a configuration, and what stops it. The others are held fixed."""
    loaded = load_robot(robot, annotations, package_dir, xacro_arg)
    q = parse_configuration(loaded, at, deg)
    with working("limits of each coordinate"):
        found = [loaded.boundaries.limits(name, q) for name in loaded.coordinates]
    if as_json:
        emit_json([vars(one) for one in found])
    else:
        columns = ("coordinate", "here", "from", "stopped by", "to", "stopped by")
        rows = [_row(loaded, x) for x in found]
        print_table("Limits of each coordinate, with the others held fixed", columns, rows)
    if found and found[0].beyond and not as_json:
        console().print(f"Not reachable from home: a contact of {', '.join(found[0].beyond)} is in between.")
    if any(one.blocked_by or one.beyond for one in found):
        raise typer.Exit(1)


def _row(robot: Robot, found: CoordinateLimits) -> tuple[str, ...]:
    here = _amount(robot, found.coordinate, found.value)
    if found.blocked_by:
        return found.coordinate, here, "not allowed here", ", ".join(found.blocked_by), "", ""
    ends = (_amount(robot, found.coordinate, found.lower), _amount(robot, found.coordinate, found.upper))
    return found.coordinate, here, ends[0], found.lower_stop or "-", ends[1], found.upper_stop or "-"


def region(
    robot: RobotName,
    coordinates: InPlane = None,
    at: At = None,
    window: Window = None,
    deg: Degrees = False,
    budget: Budget = REGION_BUDGET,
    width: Width = None,
    require_coverage_: RequireCoverage = False,
    annotations: Annotations = None,
    package_dir: PackageDirs = None,
    xacro_arg: XacroArgs = None,
    as_json: AsJson = False,
) -> None:
    """Print the feasible region of two coordinates around home: named edges, vertices, area, implied boundaries."""
    loaded = load_robot(robot, annotations, package_dir, xacro_arg)
    plane = None if coordinates is None else tuple(name.strip() for name in coordinates.split(","))
    within = parse_window(loaded, window, deg)
    q = parse_configuration(loaded, at, deg)
    with working("tracing the region", budget):
        found = feasible_region(loaded, plane, q, within, budget=budget, width=width)
    if as_json:
        emit_json(_region_record(found) | {"coverage": coverage_record(loaded.coverage.record)})
        require_coverage(loaded.coverage, require_coverage_)
        return
    x, y = found.coordinates
    a, b = names(found.units)
    rows = [
        (edge.name, *(f"{value:.9f}" for end in (edge.start, edge.end) for value in shown(end, found.units).tolist()))
        for edge in found.edges
    ]
    columns = ("edge", f"{x} from [{a}]", f"{y} from [{b}]", f"{x} to [{a}]", f"{y} to [{b}]")
    numbers = [f"{value:.9f}" for value in shown(found.centroid, found.units).tolist()]
    centre = f"({', '.join(numbers)}) {a}" if a == b else f"({numbers[0]} {a}, {numbers[1]} {b})"
    note = f"area {found.area:.10f} {found.area_unit}, centroid {centre}"
    if len(found.loops) > 1:
        note += f"; {len(found.loops) - 1} holes"
    if found.accuracy:
        to = " and ".join(dict.fromkeys(amount(found.accuracy, unit) for unit in found.units))
        note += f"; curved edges to {to}, area to {found.area_error:.1e} {found.area_unit}"
    if found.width:
        low, high = found.area_interval
        note += f"; proven: area from {low:.6g} to {high:.6g}, contacts enclosed in cells of {found.width:g}"
    print_table(f"Feasible region of ({x}, {y}) around home", columns, rows, note)
    if found.unresolved:
        console().print(f"{found.unresolved_text}.", markup=False, soft_wrap=True)
    for slit in found.slits:
        ends = " to ".join(
            f"({', '.join(f'{v:.6f}' for v in shown(end, found.units))})" for end in slit.points[[0, -1]]
        )
        said = f"a cut inside it: {slit.name} from {ends} [{a}, {b}]; both sides are free, but no motion crosses it"
        console().print(said, markup=False, soft_wrap=True)
    alike = a == b  # in a plane of an angle and a length, a distance has no single unit
    implied = [
        (name, ", ".join(s.by), f"{factors(found.units)[0] * s.slack:.6f}" if alike else "-")
        for name, s in found.supports().items()
        if s.by
    ]
    if implied:
        print_table("Implied", ("boundary or limit", "implied by", f"slack [{a}]" if alike else "slack"), implied)
    if not len(loaded.boundaries):
        console().print("The robot has no boundary: the region is what the joint limits alone allow.", markup=False)
    say_coverage(loaded.coverage.record)
    say_assumptions(loaded)
    require_coverage(loaded.coverage, require_coverage_)


def _region_record(region: Region) -> dict[str, Any]:
    return {
        "coordinates": region.coordinates,
        "assumptions": region.slice.robot.annotations.assumptions,
        "at": dict(zip(region.robot_coordinates, region.at.tolist(), strict=True)),
        "vertices": region.vertices,
        "edges": [
            {"name": e.name, "source": e.source, "start": e.start, "end": e.end, "points": e.points}
            for e in region.edges
        ],
        "holes": max(len(region.loops) - 1, 0),
        "accuracy": region.accuracy,
        "area": region.area,
        "area_error": region.area_error,
        "area_interval": region.area_interval,
        "width": region.width,
        "units": region.units,
        "area_unit": region.area_unit,
        "unresolved": [vars(place) for place in region.unresolved],
        "joined_area": region.joined_area,
        "slits": [{"name": slit.name, "points": slit.points} for slit in region.slits],
        "centroid": region.centroid,
        "implied": {name: {"by": s.by, "slack": s.slack} for name, s in region.supports().items() if s.by},
    }
