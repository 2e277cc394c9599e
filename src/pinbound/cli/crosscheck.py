"""`pinbound crosscheck`: compares the boundaries with coal, on four levels."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, cast

import numpy as np
import typer

from pinbound.cli.coverage import RequireCoverage, nothing_to_check, require_coverage, say_coverage
from pinbound.cli.outputs import ready_file
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
    parse_window,
    print_table,
    typed,
    working,
)
from pinbound.crosscheck import (
    LEVELS,
    BodyLevel,
    BoundaryLevel,
    CrossCheck,
    Level,
    LinkPair,
    PointLevel,
    RegionLevel,
    cross_check,
)
from pinbound.exceptions import InputError, Problem
from pinbound.robot.robot import Robot
from pinbound.tolerances import REGION_ACCURACY
from pinbound.units import several

__all__ = ["crosscheck"]

_MOST_ROWS = 20


def crosscheck(
    robot: RobotName,
    samples: Annotated[int, typer.Option(help="Number of random configurations for points and bodies.")] = 10_000,
    rays: Annotated[int, typer.Option(help="Number of rays for boundaries.")] = 1_000,
    seed: Annotated[int, typer.Option(help="Seed of the random numbers.", min=0)] = 0,
    levels: Annotated[str, typer.Option(help="Levels to compare, separated by commas.")] = ",".join(LEVELS),
    coordinates: Annotated[str | None, typer.Option(help="Two coordinates of the region, e.g. q2,q3.")] = None,
    window: Window = None,
    deg: Annotated[bool, typer.Option("--deg", help="Angles of --window are in degrees.")] = False,
    step: Annotated[float | None, typer.Option(help="Step of the grid for the region, in rad or m.")] = None,
    accuracy: Annotated[
        float, typer.Option(help="Accuracy of curved edges of the region, in rad or m.")
    ] = REGION_ACCURACY,
    out: Annotated[Path | None, typer.Option(help="Draw the region level into this .png and .svg file.")] = None,
    require_coverage_: RequireCoverage = False,
    annotations: Annotations = None,
    package_dir: PackageDirs = None,
    xacro_arg: XacroArgs = None,
    as_json: AsJson = False,
) -> None:
    """Compare points, contacts, bodies and the region with coal, an independent collision engine.

    Exit codes: 0 all levels agree; 1 one disagrees, or required coverage is partial; 2 bad input, nothing to check.
    """
    chosen = cast("tuple[Level, ...]", tuple(word.strip() for word in levels.split(",") if word.strip()))
    if out is not None and out.suffix not in (".png", ".svg"):
        raise InputError([Problem("is no name of a figure", "Let it end in .png or .svg", str(out))])
    if out is not None and "region" not in chosen:
        raise InputError([Problem("is drawn from the region level", "Add it to --levels", "--out")])
    loaded = load_robot(robot, annotations, package_dir, xacro_arg)
    ready_file(out)
    plane = None if coordinates is None else [name.strip() for name in coordinates.split(",")]
    within = parse_window(loaded, window, deg)
    with working(f"asking coal: {', '.join(chosen)}"):
        found = cross_check(loaded, samples, seed, chosen, rays, step, plane, within, accuracy)
    if as_json:
        emit_json(found.to_dict())
    else:
        _print(loaded, found)
    if out is not None:
        _draw(loaded, found, out)
    if not len(loaded.boundaries):
        nothing_to_check(loaded.name, robot)
    if not found.levels:
        raise typer.Exit(2)
    require_coverage(loaded.coverage, require_coverage_)
    if not found.holds:
        raise typer.Exit(1)


def _print(robot: Robot, found: CrossCheck) -> None:
    for level in found.levels.values():
        if isinstance(level, PointLevel):
            _print_points(level)
        elif isinstance(level, BoundaryLevel):
            _print_boundaries(level)
        elif isinstance(level, BodyLevel):
            _print_bodies(robot, level)
        else:
            _print_region(robot, level)
    said = console()
    for name, reason in found.not_checked.items():
        said.print(f"Not checked: {name}: {reason}.", markup=False)
    verdicts = ", ".join(f"{name} {'holds' if level.holds else 'DISAGREES'}" for name, level in found.levels.items())
    said.print(verdicts or "Nothing was checked.", markup=False)
    say_coverage(found.coverage)


def _print_points(level: PointLevel) -> None:
    rows = [(f"pin of closure {name}", f"{1e3 * gap:.1e}") for name, gap in level.pins.items()]
    worst = sorted(level.differences.items(), key=lambda one: one[1], reverse=True)
    rows += [(name, f"{1e3 * value:.1e}") for name, value in worst]
    title = f"Points: clearances compared with coal's shapes, {level.samples} configurations, worst first"
    allowed = f"Allowed: {1e3 * level.tolerance:.0e} mm per metre of path." + _solid(level)
    print_table(title, ("boundary", "worst difference [mm]"), rows, allowed, _MOST_ROWS)


def _solid(level: PointLevel | BoundaryLevel) -> str:
    return f" Boxes and prisms: {1e3 * level.solid_tolerance:.0e} mm." if level.solid else ""


def _print_boundaries(level: BoundaryLevel) -> None:
    rows = [
        (name, one.method, one.rays, one.free, one.grazing, f"{np.degrees(one.angle):.1e}", f"{1e3 * one.metres:.1e}")
        for name, one in sorted(level.boundaries.items(), key=lambda one: one[1].metres, reverse=True)
    ]
    columns = ("boundary", "compared with", "rays []", "free []", "grazing []", "worst [deg]", "worst [mm]")
    title = f"Contacts: closed form compared with bisection on coal's distance, {level.rays} rays, worst first"
    allowed = (
        f"Allowed: {np.degrees(level.tolerance):.1e} deg, {1e3 * level.metres_tolerance:.0e} mm per metre of path."
    )
    allowed += _solid(level)
    print_table(title, columns, rows, allowed, _MOST_ROWS)


def _print_bodies(robot: Robot, level: BodyLevel) -> None:
    rows = [
        (
            " - ".join(pair.links),
            len(pair.boundaries),
            pair.both_clear,
            pair.both_contact,
            pair.misses,
            pair.refusals,
            pair.unreachable,
            pair.ways,
            pair.near,
            pair.inside,
            millimetres(pair.miss),
            millimetres(pair.refusal),
        )
        for pair in sorted(level.pairs, key=lambda one: (one.misses, one.refusal), reverse=True)
    ]
    columns = ("links", "boundaries []", "both clear []", "both contact []", "missed []", "refused []")
    columns += ("unreachable []", "ways []", "near []", "inside []", "worst miss [mm]", "needless refusal [mm]")
    title = f"Bodies: verdicts compared with coal on the collision bodies, {level.samples} configurations, worst first"
    allowed = f"Allowed: misses {millimetres(level.tolerance)} mm; refusals, for boundaries of zero threshold,"
    print_table(title, columns, rows, f"{allowed} {millimetres(level.stop_tolerance)} mm.", _MOST_ROWS)
    said = console()
    for pair in level.pairs:
        if not level.pair_holds(pair):
            said.print(f"{' - '.join(pair.links)} ({', '.join(pair.boundaries)}):", markup=False)
            for what, q in (("miss", pair.miss_q), ("needless refusal", pair.refusal_q)):
                if q is not None:
                    said.print(f"  worst {what} at {typed(robot, q)}", markup=False)
    meshed = [pair for pair in level.pairs if pair.meshes]
    if meshed:
        text = f"{several(len(meshed), 'pair has', 'pairs have')} meshes: coal answers yes or no for their triangles,"
        said.print(
            f"{text} no motion is swept, and refusals are measured "
            f"{several(sum(pair.measured for pair in meshed), 'time')}.",
            markup=False,
        )
        for pair in meshed:
            _print_inside(robot, pair)
    part = [" - ".join(pair.links) for pair in level.pairs if pair.coverage not in ("watched", "")]
    if part:
        said.print(f"Not fully watched, so misses are possible: {', '.join(part)}.", markup=False)
    for link, reason in level.left_out.items():
        said.print(f"Not compared: {link} {reason}.", markup=False)


def _print_inside(robot: Robot, pair: LinkPair) -> None:
    """Print the cases in which a body is completely inside another body's mesh, so that no triangles touch."""
    said = console()
    text = f"Completely inside a mesh ({pair.within}), so that no triangles touch"
    if pair.inside_q is not None:
        said.print(
            f"{text}: {pair.inside} samples that the marks refuse, e.g. {typed(robot, pair.inside_q)}. "
            "They do not count as needless refusals.",
            markup=False,
        )
    if pair.hidden_q is not None:
        said.print(
            f"{text}: {pair.hidden} samples that the marks call CLEAR, e.g. {typed(robot, pair.hidden_q)}. "
            "A motion gets there only through a contact.",
            markup=False,
        )


def _print_region(robot: Robot, level: RegionLevel) -> None:
    turning = {robot.turns(name) for name in level.coordinates}
    # In a plane of an angle and a length, distances have no single unit.
    unit, factor = ("deg", np.degrees(1.0)) if turning == {True} else ("m" if turning == {False} else "rad or m", 1.0)
    amounts = [f"{factor * value:.2e}" for value in (level.contour_inside, level.contour_outside, level.tolerance)]
    rows = [
        ("nodes of the grid", level.nodes),
        ("nodes in the region that coal does not reach", level.unsafe),
        ("nodes outside the region that coal reaches", level.refused),
        ("places where coal stopped", len(level.contour)),
        (f"furthest of them inside the region [{unit}]", amounts[0]),
        (f"furthest of them outside the region [{unit}]", amounts[1]),
        (f"allowed [{unit}]", amounts[2]),
    ]
    rows += [("left out, for they touch at home", " - ".join(pair)) for pair in level.ignored]
    plane = ", ".join(level.coordinates)
    title = f"Region ({plane}): membership against a flood fill by coal on {level.shapes}"
    note = f"Step of the grid: {factor * level.step:.3f} {unit}." + ("" if level.complete else " It came to no end.")
    print_table(title, ("what", "value []"), rows, note)


def _draw(robot: Robot, found: CrossCheck, out: Path) -> None:
    from pinbound.figures.canvas import save
    from pinbound.figures.plots import draw_verdicts

    level = found.region
    if level is None:
        console(stderr=True).print("No figure: the region was not checked.", markup=False)
        return
    home = robot.home[[robot.coordinates.index(name) for name in level.coordinates]]
    groups = {
        "coal stops here": level.contour,
        "in the region, not reached by coal": level.unsafe_at,
        "outside the region, reached by coal": level.refused_at,
    }
    save(draw_verdicts(level.region, home, groups), out.with_suffix(""))
    console(stderr=True).print(f"Wrote {out.with_suffix('.svg')} and {out.with_suffix('.png')}.", markup=False)
