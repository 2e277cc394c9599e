"""The command line program: one typer app, with one module for each group of commands."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Annotated, TextIO, cast

import typer

from pinbound.cli import (
    batch,
    check,
    crosscheck,
    derive,
    explore,
    export,
    inspect,
    mark,
    plan,
    report,
    reproduce,
    robots,
    view,
)
from pinbound.cli.pipes import Unread
from pinbound.cli.shared import guarded

__all__ = ["app", "main"]

app = typer.Typer(
    name="pinbound",
    help="Compute coupled joint limits and self-collision boundaries in closed form, from a URDF.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(asked: bool) -> None:
    if asked:
        from pinbound import __version__

        typer.echo(f"pinbound {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", "-V", callback=_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None: ...


def _register(command: Callable[..., None]) -> None:
    app.command(command.__name__)(guarded(command))


_register(inspect.info)
_register(derive.derive)
_register(inspect.limits)
_register(inspect.region)
_register(batch.batch)
_register(check.check)
_register(plan.plan)
_register(mark.mark)
_register(crosscheck.crosscheck)
_register(export.export)
_register(explore.explore)
_register(view.view)
_register(report.report)
_register(reproduce.reproduce)
_register(robots.robots)
_register(robots.new)


def main() -> None:
    """Run the program; the entry point of `pinbound`."""
    sys.stdout = cast(TextIO, Unread(sys.stdout))
    app()
