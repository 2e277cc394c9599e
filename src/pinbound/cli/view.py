"""`pinbound view`: the robot live in a browser, meshes included."""

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
    port: Annotated[int, typer.Option(min=1, max=65535, help="The first port that is tried.")] = 8080,
    host: Annotated[str, typer.Option(help="Who may look: this machine only, or 0.0.0.0 for all.")] = "127.0.0.1",
    at: Annotated[str | None, typer.Option(help="q1=0.1,q2=-0.2: what is shown first; home by default.")] = None,
    deg: Annotated[bool, typer.Option("--deg", help="Angles of --at are in degrees.")] = False,
    annotations: Annotations = None,
    package_dir: PackageDirs = None,
    xacro_arg: XacroArgs = None,
) -> None:
    """Serve the robot live with its meshes, sliders, clearances and limits, until Ctrl-C (needs pinbound[view])."""
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
