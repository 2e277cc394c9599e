"""`pinbound view`: shows the robot in a browser, with its meshes; sliders move it."""

from __future__ import annotations

import time
from typing import Annotated

import typer

from pinbound.cli.coverage import say_assumptions, say_coverage
from pinbound.cli.shared import (
    Annotations,
    PackageDirs,
    RobotName,
    XacroArgs,
    console,
    load_robot,
    parse_configuration,
)
from pinbound.explorer.live import live_view

__all__ = ["view"]


def view(
    robot: RobotName,
    port: Annotated[int, typer.Option(min=1, max=65535, help="First port to try.")] = 8080,
    host: Annotated[
        str, typer.Option(help="Address to listen on. 0.0.0.0 also lets other machines connect.")
    ] = "127.0.0.1",
    at: Annotated[
        str | None, typer.Option(help="Configuration to show first, e.g. q1=0.1,q2=-0.2. Default: home.")
    ] = None,
    deg: Annotated[bool, typer.Option("--deg", help="Angles of --at are in degrees.")] = False,
    annotations: Annotations = None,
    package_dir: PackageDirs = None,
    xacro_arg: XacroArgs = None,
) -> None:
    """Show the robot in a browser with meshes, sliders, clearances and limits, until Ctrl-C. Needs the extra 'view'."""
    loaded = load_robot(robot, annotations, package_dir, xacro_arg)
    shown = live_view(loaded, port, host, parse_configuration(loaded, at, deg))
    said = console()
    for line in shown.missing:
        said.print(f"note: {line}", soft_wrap=True)
    say_coverage(loaded.coverage.record)
    say_assumptions(loaded)
    said.print(f"Open http://{host}:{shown.server.get_port()} in a browser. Ctrl-C ends it.", soft_wrap=True)
    try:
        while True:
            time.sleep(1.0)
    except KeyboardInterrupt:
        shown.server.stop()
