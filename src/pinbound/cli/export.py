"""`pinbound export`: writes boundaries as C or data, or a table of coupled limits, for programs without pinbound."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

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
    working,
)
from pinbound.exceptions import InputError, Problem, UnknownNameError
from pinbound.robot.limit_tables import ENTRIES, limit_table
from pinbound.robot.robot import Robot
from pinbound.robot.table_formats import FORMATS, GRIDS

__all__ = ["export"]

_KINDS = ("c", "json", "ros2", "table")


def export(
    robot: RobotName,
    kind: Annotated[
        str, typer.Argument(help="'c' (C99), 'json' (reduced chains), 'ros2' (joint_limits) or 'table' (limits).")
    ],
    out: Annotated[Path, typer.Option(help="File to write. For 'c' it ends in .c; a header .h is written beside it.")],
    boundary: Annotated[
        list[str] | None, typer.Option(help="Export this boundary only. May be given more than once.")
    ] = None,
    form: Annotated[str, typer.Option("--format", help=f"Format of a table: {', '.join(FORMATS)}.")] = "csv",
    target: Annotated[str | None, typer.Option(help="For a table: joint on which the limits depend.")] = None,
    dependent: Annotated[str | None, typer.Option(help="For a table: joint that is limited.")] = None,
    spacing: Annotated[float, typer.Option(help="For a table: degrees between entries.")] = 1.0,
    grid: Annotated[
        str | None,
        typer.Option(help=f"For a table: {', '.join(ENTRIES)}. Default: the grid that loses least in this format."),
    ] = None,
    whole: Annotated[bool, typer.Option("--whole", help="For a table: whole degrees, as jskeus needs them.")] = False,
    annotations: Annotations = None,
    package_dir: PackageDirs = None,
    xacro_arg: XacroArgs = None,
    as_json: AsJson = False,
) -> None:
    """Write boundaries as C99, reduced chains as JSON, limits as ROS 2 YAML, or a table of coupled limits."""
    if kind not in _KINDS:
        raise UnknownNameError("kind of export", kind, _KINDS)
    loaded = load_robot(robot, annotations, package_dir, xacro_arg)
    ready_file(out)
    with working(f"writing {out.name}"):
        if kind != "table":
            files = loaded.export(kind, out, boundary)
            notes: tuple[str, ...] = ()
        else:
            notes = _table(
                loaded,
                out,
                form,
                (target, dependent),
                {"spacing": spacing, "whole": whole, "boundaries": boundary, "grid": grid},
            )
            files = (out,)
    if as_json:
        emit_json({"kind": kind, "files": [str(path) for path in files], "notes": list(notes)})
        return
    said = console()
    for note in notes:
        said.print(f"Note: {note}.", soft_wrap=True)
    said.print(f"Wrote {', '.join(str(path) for path in files)}.", soft_wrap=True)


def _table(
    robot: Robot,
    out: Path,
    form: str,
    joints: tuple[str | None, str | None],
    options: dict[str, Any],
) -> tuple[str, ...]:
    if form not in FORMATS:
        raise UnknownNameError("format", form, FORMATS)
    target, dependent = joints
    if target is None or dependent is None:
        known = ", ".join(robot.coordinates)
        raise InputError([Problem("a table needs two joints", f"Give --target and --dependent, of {known}", "export")])
    options["grid"] = options["grid"] or GRIDS[form]
    table = limit_table(robot, target, dependent, **options)
    out.write_text(table.text(form), encoding="utf-8")
    return table.notes
