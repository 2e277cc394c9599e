"""`pinbound report`: writes the HTML page with its figures, and prints a summary."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pinbound.cli.coverage import RequireCoverage, require_coverage, say_coverage
from pinbound.cli.outputs import ready_folder
from pinbound.cli.shared import (
    Annotations,
    PackageDirs,
    RobotName,
    XacroArgs,
    console,
    load_robot,
    print_table,
    working,
)
from pinbound.extras import require
from pinbound.figures.report import write_report

__all__ = ["report"]


def report(
    robot: RobotName,
    out: Annotated[Path, typer.Option(help="Folder for the page and its figures.")] = Path("report"),
    frame: Annotated[
        str | None, typer.Option(help="Link whose origin is the tool point. Default: the deepest link of the tree.")
    ] = None,
    free: Annotated[
        str | None,
        typer.Option(
            help="Two or three coordinates whose free volume is drawn, e.g. q2,q3,q4. Default: the three that most "
            "boundaries depend on."
        ),
    ] = None,
    coordinates: Annotated[
        str | None,
        typer.Option(
            help="Two coordinates of the region, e.g. q2,q3; the others stay at home. Default: those of the "
            "boundaries; if these are more, the two that most boundaries depend on."
        ),
    ] = None,
    require_coverage_: RequireCoverage = False,
    annotations: Annotations = None,
    package_dir: PackageDirs = None,
    xacro_arg: XacroArgs = None,
) -> None:
    """Write an HTML page with the kinematic tree, boundaries, region, workspace image and assumptions."""
    require("report", "a report")
    loaded = load_robot(robot, annotations, package_dir, xacro_arg)
    ready_folder(out)
    drawn, plane = (
        None if names is None else [name.strip() for name in names.split(",")] for names in (free, coordinates)
    )
    with working("region, figures, page"):
        page, rows = write_report(loaded, out, frame, drawn, plane)
    table = [
        (row.boundary.name, row.boundary.kind.value, row.boundary.ancestor, row.contact, row.where) for row in rows
    ]
    print_table(loaded.name, ("boundary", "kind", "ancestor", "contact", "in the region"), table)
    say_coverage(loaded.coverage.record)
    console().print(f"Wrote {page} and its figures.", markup=False, soft_wrap=True)
    require_coverage(loaded.coverage, require_coverage_)
