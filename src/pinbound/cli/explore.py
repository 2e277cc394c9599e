"""`pinbound explore`: one page in which one drags through a region and sees the robot move."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pinbound.cli.coverage import RequireCoverage, require_coverage, say_assumptions, say_coverage
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
    typer.Option("--plane", help="Two coordinates whose region is computed, e.g. q2,q3; may be repeated."),
]


def explore(
    robot: RobotName,
    out: Annotated[Path, typer.Option(help="The page.")] = Path("explorer.html"),
    plane: Planes = None,
    at: Annotated[str | None, typer.Option(help="q1=0.1,q2=-0.2: where the others are held; home by default.")] = None,
    motion: Annotated[Path | None, typer.Option(help="A motion to play with its certificate, as for check.")] = None,
    deg: Annotated[bool, typer.Option("--deg", help="Angles of --at, --window and --motion are in degrees.")] = False,
    meshes: Annotated[
        bool, typer.Option("--meshes", help="Draw bodies that are meshes; the page grows by them.")
    ] = False,
    window: Window = None,
    budget: Annotated[
        float, typer.Option(min=0.0, help="Seconds for each region, and for --motion.")
    ] = EXPLORER_BUDGET,
    width: Annotated[
        float, typer.Option(help="Side of the cells about contacts that are searched for.")
    ] = REGION_WIDTH,
    require_coverage_: RequireCoverage = False,
    annotations: Annotations = None,
    package_dir: PackageDirs = None,
    xacro_arg: XacroArgs = None,
) -> None:
    """Write one page, offline, in which one drags through the region and sees the robot move."""
    require("report", "the explorer's page")
    loaded = load_robot(robot, annotations, package_dir, xacro_arg)
    with working("regions and page"):
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
