"""`pinbound plan`: finds a certified motion from one configuration to another, and writes a file of waypoints."""

from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.text import Text

from pinbound.certificates import Budget, Verdict
from pinbound.cli.coverage import (
    LimitsOnly,
    RequireCoverage,
    coverage_record,
    nothing_to_check,
    require_coverage,
    say_assumptions,
    say_coverage,
)
from pinbound.cli.outputs import ready_file
from pinbound.cli.shared import (
    Annotations,
    AsJson,
    PackageDirs,
    RobotName,
    XacroArgs,
    console,
    emit_json,
    load_robot,
    millimetres,
    parse_configuration,
    print_table,
    working,
)
from pinbound.exceptions import InputError, Problem
from pinbound.freespace import Plan
from pinbound.freespace import plan as find_plan
from pinbound.robot.robot import Robot
from pinbound.units import several

__all__ = ["plan"]

_SECONDS = 30.0
_MOST_ROWS = 40


def plan(
    robot: RobotName,
    goal: Annotated[
        str, typer.Option(help="Goal, e.g. q2=0.1,q3=-0.2. Coordinates that are not given have home's value.")
    ],
    start: Annotated[str | None, typer.Option(help="Start, in the same form. Default: home.")] = None,
    out: Annotated[
        Path | None, typer.Option(help="Write the waypoints to this .csv file. 'pinbound check' reads it.")
    ] = None,
    deg: Annotated[
        bool, typer.Option("--deg", help="Angles of --start, --goal, --out and the table are in degrees.")
    ] = False,
    velocity: Annotated[
        float | None, typer.Option(help="Largest speed of each coordinate, in rad/s or m/s. Gives the plan times.")
    ] = None,
    budget: Annotated[
        float, typer.Option(help="Time limit in seconds. After it the answer is UNDECIDED.", min=0.0)
    ] = _SECONDS,
    limits_only: LimitsOnly = False,
    require_coverage_: RequireCoverage = False,
    annotations: Annotations = None,
    package_dir: PackageDirs = None,
    xacro_arg: XacroArgs = None,
    as_json: AsJson = False,
) -> None:
    """Find a motion that is proven clear, or prove that there is none. Between waypoints the motion is straight in q.

    Exit codes: 0 found; 1 no motion exists, undecided, or required coverage is partial; 2 bad input, nothing to check.
    """
    if out is not None and out.suffix != ".csv":
        raise InputError([Problem("is no name of a table", "Let it end in .csv", str(out))])
    loaded = load_robot(robot, annotations, package_dir, xacro_arg)
    ready_file(out)
    ends = [parse_configuration(loaded, text, deg, option) for text, option in ((start, "--start"), (goal, "--goal"))]
    with working("looking for a motion", budget):
        found = find_plan(
            loaded, ends[0], ends[1], budget=Budget(seconds=budget), velocity=velocity, limits_only=limits_only
        )
    if found.verdict is Verdict.NOTHING_TO_CHECK:
        nothing_to_check(loaded.name, robot)
    if out is not None and found.verdict is Verdict.CERTIFIED:
        _write(loaded, found, out, deg)
    if as_json:
        emit_json(_record(loaded, found))
    else:
        _print(loaded, found, out, deg)
    require_coverage(loaded.coverage.of(()) if limits_only else loaded.coverage, require_coverage_)
    if found.verdict is not Verdict.CERTIFIED:
        raise typer.Exit(1)


def _shown(robot: Robot, found: Plan, deg: bool) -> np.ndarray[Any, Any]:
    """Return the waypoints; angles are in degrees if `deg`."""
    factors = [math.degrees(1.0) if deg and robot.turns(name) else 1.0 for name in robot.coordinates]
    return found.waypoints * np.array(factors)


def _write(robot: Robot, found: Plan, path: Path, deg: bool) -> None:
    rows = _shown(robot, found, deg).tolist()
    with path.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        if found.times is None:
            table.writerows([robot.coordinates, *rows])
        else:
            table.writerow(("time", *robot.coordinates))
            table.writerows((time, *row) for time, row in zip(found.times.tolist(), rows, strict=True))


def _print(robot: Robot, found: Plan, out: Path | None, deg: bool) -> None:
    said = console()
    colour = {"certified": "green", "violated": "red"}.get(found.verdict.value, "yellow")
    proof = found.certificate
    if proof is not None:
        least = f"at least {millimetres(proof.lower, 3)} mm clear" if math.isfinite(proof.lower) else "within limits"
        tells = f"{several(len(found.waypoints), 'waypoint')} ({found.found_by}), {least}"
    elif found.separated_by is not None:
        tells = f"there is no motion: {found.separated_by} separates start and goal, or one of them violates it"
    else:
        tells = "no motion was found, but one may exist; give more time with --budget"
    said.print(Text(found.verdict.value.upper(), f"bold {colour}"), f": {tells}; {found.seconds:.1f} s", sep="")
    say_coverage(robot.coverage.record)
    if proof is not None:
        units = ["m" if not robot.turns(name) else "deg" if deg else "rad" for name in robot.coordinates]
        columns = [f"{name} [{unit}]" for name, unit in zip(robot.coordinates, units, strict=True)]
        rows = [[f"{value:.6g}" for value in row] for row in _shown(robot, found, deg).tolist()]
        if found.times is not None:
            columns, rows = (
                ["time [s]", *columns],
                [[f"{time:.6g}", *row] for time, row in zip(found.times.tolist(), rows, strict=True)],
            )
        print_table("Waypoints, straight between them", columns, rows, most=_MOST_ROWS)
        if out is not None:
            again = " --deg" if deg else ""
            said.print(f"Wrote {out}. Check it: pinbound check ROBOT {out}{again}", soft_wrap=True)
    for note in found.notes:
        said.print(f"note: {note}", soft_wrap=True)
    say_assumptions(robot)


def _record(robot: Robot, found: Plan) -> dict[str, Any]:
    return {
        "verdict": found.verdict.value,
        "found_by": found.found_by,
        "coordinates": robot.coordinates,
        "waypoints": found.waypoints,
        "times": found.times,
        "length": found.length,
        "lower": None if found.certificate is None else found.certificate.lower,
        "separated_by": found.separated_by,
        "coverage": coverage_record(robot.coverage.record),
        "notes": found.notes,
        "assumptions": robot.annotations.assumptions,
        "seconds": found.seconds,
    }
