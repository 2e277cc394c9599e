"""`pinbound reproduce`: computes the paper's tables and figures again, and its errata with their numbers."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pinbound.cli.outputs import refuse_file
from pinbound.cli.shared import Annotations, PackageDirs, XacroArgs, console, load_robot, print_table
from pinbound.extras import require

__all__ = ["reproduce"]


def reproduce(
    out: Annotated[Path, typer.Option(help="Folder for the page, its figures, tables and meshes.")],
    robot: Annotated[str, typer.Option(help="The paper's robot, or a changed copy of it.")] = "minervabot_v3",
    annotations: Annotations = None,
    package_dir: PackageDirs = None,
    xacro_arg: XacroArgs = None,
) -> None:
    """Compute tables, figures and errata of the paper from the URDF, and write them as a page."""
    require("report", "the paper's page")
    require("meshes", "the paper's page")
    from pinbound.reproduce import reproduce_paper

    loaded = load_robot(robot, annotations, package_dir, xacro_arg)
    refuse_file(out)
    with console(stderr=True).status("") as status:
        result = reproduce_paper(loaded, out, lambda step: status.update(f"{step} ..."))
    print_table(
        "Tables and equations",
        ("printed", "what", "verdict"),
        [
            *((one.label, one.title, one.verdict) for one in result.tables),
            *(
                (f"Eq. {one.number}", one.says, f"largest difference {one.difference:.1e} m")
                for one in result.equations
            ),
        ],
    )
    rows = [
        (str(one.number), one.where, one.title, f"{one.derived}", "yes" if one.holds else "no") for one in result.errata
    ]
    confirmed = "on this robot" if result.changes else "confirmed"
    print_table("Errata", ("no.", "where", "fault", "computed", confirmed), rows)
    for change in result.changes:
        console().print(f"Not the paper's robot: {change}", markup=False)
    console().print(f"Wrote {result.page}, {len(result.files)} files beside it.", markup=False, soft_wrap=True)
