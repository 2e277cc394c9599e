"""`pinbound explore`: one page in which the user moves a point through a region, and the robot follows."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pinbound.cli.coverage import RequireCoverage, require_coverage, say_assumptions, say_coverage
from pinbound.cli.outputs import ready_file
from pinbound.cli.shared import (
    Annotations,
    PackageDirs,
    RobotName,
    Window,
    XacroArgs,
    console,
    load_robot,
    parse_configuration,
    parse_window,
    working,
)
from pinbound.explorer import explorer_page
from pinbound.extras import require
from pinbound.motion.history import read_motion
from pinbound.tolerances import EXPLORER_BUDGET, REGION_WIDTH

__all__ = ["explore"]

Planes = Annotated[
    list[str] | None,
    typer.Option("--plane", help="Two coordinates whose region is computed, e.g. q2,q3. May be given more than once."),
]


def explore(
    robot: RobotName,
    out: Annotated[Path, typer.Option(help="File to write.")] = Path("explorer.html"),
    plane: Planes = None,
    at: Annotated[
        str | None, typer.Option(help="Values of the other coordinates, e.g. q1=0.1,q4=-0.2. Default: home.")
    ] = None,
    motion: Annotated[
        Path | None, typer.Option(help="Motion to play with its certificate; a file that 'pinbound check' reads.")
    ] = None,
    deg: Annotated[bool, typer.Option("--deg", help="Angles of --at, --window and --motion are in degrees.")] = False,
    meshes: Annotated[
        bool, typer.Option("--meshes", help="Also draw bodies that are meshes. The page becomes larger.")
    ] = False,
    window: Window = None,
    budget: Annotated[
        float, typer.Option(min=0.0, help="Time limit in seconds for each region, and for --motion.")
    ] = EXPLORER_BUDGET,
    width: Annotated[
        float, typer.Option(help="Width in rad or m of the cells that enclose contact curves without a formula.")
    ] = REGION_WIDTH,
    require_coverage_: RequireCoverage = False,
    annotations: Annotations = None,
    package_dir: PackageDirs = None,
    xacro_arg: XacroArgs = None,
) -> None:
    """Write a page that works offline: drag a point through the region, and the robot moves with it."""
    require("report", "the explorer's page")
    loaded = load_robot(robot, annotations, package_dir, xacro_arg)
    ready_file(out)
    with working("regions and page", budget * (len(plane or [""]) + (motion is not None))):
        page = explorer_page(
            loaded,
            [[name.strip() for name in one.split(",")] for one in plane] if plane else None,
            parse_configuration(loaded, at, deg) if at is not None else None,
            None if motion is None else read_motion(loaded, motion, deg),
            window=parse_window(loaded, window, deg),
            meshes=meshes,
            budget=budget,
            width=width,
            motion_name="motion" if motion is None else motion.name,
        )
    page.save(out)
    said = console()
    for note in page.notes:
        said.print(f"note: {note}", soft_wrap=True)
    say_coverage(loaded.coverage.record)
    say_assumptions(loaded)
    if page.verdict is not None:
        said.print(f"motion: {page.verdict.value}", soft_wrap=True)
    said.print(f"Wrote {out}, {page.size / 1e6:.2f} MB.", soft_wrap=True)
    require_coverage(loaded.coverage, require_coverage_)
