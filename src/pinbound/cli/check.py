"""`pinbound check`: certifies a motion from a file."""

from __future__ import annotations

from math import degrees, floor, isfinite
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.text import Text

from pinbound.certificates import Budget, Certificate, Finding, Verdict, certify
from pinbound.cli.coverage import (
    LimitsOnly,
    RequireCoverage,
    coverage_record,
    nothing_to_check,
    require_coverage,
    say_assumptions,
    say_coverage,
)
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
    print_table,
    working,
)
from pinbound.exceptions import PinboundError
from pinbound.extras import require
from pinbound.motion.history import Motion, history, read_motion
from pinbound.region import Region, feasible_region
from pinbound.robot.robot import Robot
from pinbound.units import several

__all__ = ["check"]

_DEFAULT = Budget()
_MOST_ROWS = 12

MotionFile = Annotated[
    Path,
    typer.Argument(help="Waypoints: .csv, .npz or .parquet with one column for each joint, and optionally 'time'."),
]
Degrees = Annotated[bool, typer.Option("--deg", help="Angles in the file are in degrees; otherwise in radians.")]
NoLimits = Annotated[bool, typer.Option("--no-limits", help="Do not check the joint limits.")]
Each = Annotated[
    bool, typer.Option("--each", help="Compute tight bounds for every boundary, not only for the tightest one.")
]
Only = Annotated[
    list[str] | None, typer.Option("--boundary", help="Check this boundary only. May be given more than once.")
]
Plot = Annotated[Path | None, typer.Option(help="Draw the clearances over time into this .png, .svg or .pdf file.")]
Boxes = Annotated[int, typer.Option(min=1, help="Budget: number of parts of the motion, summed over the boundaries.")]
Seconds = Annotated[float, typer.Option(min=0.0, help="Budget: wall time in seconds.")]


def check(
    robot: RobotName,
    motion: MotionFile,
    deg: Degrees = False,
    boundary: Only = None,
    no_limits: NoLimits = False,
    limits_only: LimitsOnly = False,
    require_coverage_: RequireCoverage = False,
    each: Each = False,
    max_boxes: Boxes = _DEFAULT.boxes,
    max_seconds: Seconds = _DEFAULT.seconds,
    plot: Plot = None,
    annotations: Annotations = None,
    package_dir: PackageDirs = None,
    xacro_arg: XacroArgs = None,
    as_json: AsJson = False,
) -> None:
    """Prove that a motion is clear at every moment, or show where it is not. Between rows the motion is straight in q.

    Exit codes: 0 certified; 1 violated, undecided, or required coverage is partial; 2 bad input or nothing to check.
    """
    if plot is not None:
        require("plots", "--plot")
    loaded = load_robot(robot, annotations, package_dir, xacro_arg)
    read = read_motion(loaded, motion, deg)
    budget = Budget(max_boxes, max_seconds)
    options = {"limits": not no_limits, "limits_only": limits_only, "each": each}
    with working("certifying", max_seconds):
        found = certify(loaded, read.waypoints, read.times, boundary, budget, **options)
    if plot is not None:
        _draw(loaded, read, found, plot)
    if as_json:
        emit_json(_record(loaded, read, found))
    else:
        _report(loaded, read, found)
        if plot is not None:
            console().print(f"figure: {plot}", markup=False)
    if found.verdict is Verdict.NOTHING_TO_CHECK:
        nothing_to_check(loaded.name, robot)
    require_coverage(loaded.coverage.of(one.name for one in found.boundaries), require_coverage_)
    if found.verdict is not Verdict.CERTIFIED:
        raise typer.Exit(1)


def _draw(robot: Robot, motion: Motion, found: Certificate, path: Path) -> None:
    from pinbound.figures.motion_figure import draw_motion

    seen = history(robot, motion.waypoints, motion.times, _plane(robot))
    figure = draw_motion(seen, found, "waypoint" if motion.times is None else "time")
    try:
        figure.savefig(path, dpi=160)
    except ValueError as error:  # matplotlib raises this error for an unknown suffix
        raise typer.BadParameter(str(error), param_hint="--plot") from error


def _plane(robot: Robot) -> Region | None:
    """Return the region of the two coordinates that the boundaries use; None if there is no such region."""
    try:
        return feasible_region(robot)
    except PinboundError:
        return None


def _report(robot: Robot, motion: Motion, found: Certificate) -> None:
    out = console()
    unit = "waypoint" if motion.times is None else "time"
    counts = f"{several(len(motion.waypoints), 'waypoint')}, {unit} {found.start:.9g} to {found.end:.9g}; "
    counts += f"{several(len(found.boundaries), 'boundary')}, {several(len(found.limits), 'end')} of joint limits"
    spent = f"{several(found.boxes, 'box')}, {1e3 * found.seconds:.1f} ms"
    colour = {"certified": "green", "violated": "red"}.get(found.verdict.value, "yellow")
    out.print(
        Text(found.verdict.value.upper(), f"bold {colour}"),
        f": {counts}; {spent}",
        sep="",
    )
    say_coverage(found.coverage)
    if found.boundaries:
        title = "Boundaries, the tightest first"
        columns = ("boundary", "verdict", "smallest clearance [mm]", "proven at least [mm]", f"at {unit}", "q")
        ordered = sorted(found.boundaries, key=lambda finding: finding.upper)
        print_table(title, columns, [_row(robot, finding) for finding in ordered], most=_MOST_ROWS)
    if found.violations:
        columns = ("violated", f"clear until {unit}", f"violated at {unit}", "q there")
        rows = [
            (f.name, f"{f.contact.before:.12g}", f"{f.contact.after:.12g}", _place(robot, f.contact.q))
            for f in found.violations
            if f.contact
        ]
        print_table("First contacts", columns, rows, most=_MOST_ROWS)
    if found.open_parts:
        columns = ("undecided", f"from {unit}", f"to {unit}", "why")
        rows = [(p.name, f"{p.start:.9g}", f"{p.end:.9g}", p.reason.value) for p in found.open_parts[:20]]
        print_table(f"Undecided ({several(len(found.open_parts), 'part')})", columns, rows)
    for note in found.notes:
        out.print(f"note: {note}", markup=False)
    say_assumptions(robot)


def _row(robot: Robot, finding: Finding) -> tuple[str, ...]:
    proven = f"{floor(1e9 * finding.lower) / 1e6:.6f}" if isfinite(finding.lower) else "no bound"  # never rounded up
    clearances = (millimetres(finding.upper, 6), proven)
    return finding.name, finding.verdict.value, *clearances, f"{finding.time:.9g}", _place(robot, finding.q)


def _place(robot: Robot, q: Any) -> str:
    words = [
        f"{name} {degrees(value):.4f} deg" if robot.turns(name) else f"{name} {1e3 * value:.3f} mm"
        for name, value in zip(robot.coordinates, q.tolist(), strict=True)
    ]
    return ", ".join(words)


def _finding(robot: Robot, finding: Finding) -> dict[str, Any]:
    contact = finding.contact
    return {
        "name": finding.name,
        "verdict": finding.verdict.value,
        "lower": finding.lower,
        "upper": finding.upper,
        "time": finding.time,
        "q": dict(zip(robot.coordinates, finding.q.tolist(), strict=True)),
        "first_contact": contact
        and {
            "not_before": contact.before,
            "at": contact.after,
            "clearance": contact.clearance,
            "q": dict(zip(robot.coordinates, contact.q.tolist(), strict=True)),
        },
    }


def _record(robot: Robot, motion: Motion, found: Certificate) -> dict[str, Any]:
    first = found.first_contact
    return {
        "verdict": found.verdict.value,
        "coverage": coverage_record(found.coverage),
        "waypoints": len(motion.waypoints),
        "start": found.start,
        "end": found.end,
        "lower": found.lower,
        "upper": found.upper,
        "tightest": found.tightest and found.tightest.name,
        "first_contact": first
        and {"not_before": first.before, "at": first.after, "violated": found.violations[0].name},
        "boundaries": [_finding(robot, finding) for finding in found.boundaries],
        "limits": [_finding(robot, finding) for finding in found.limits],
        "undecided": [
            {"name": p.name, "start": p.start, "end": p.end, "lower": p.lower, "reason": p.reason.value}
            for p in found.open_parts
        ],
        "notes": found.notes,
        "assumptions": robot.annotations.assumptions,
        "boxes": found.boxes,
        "seconds": found.seconds,
    }
