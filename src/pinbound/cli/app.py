"""The command line program: one typer app, one module a group of commands."""

from __future__ import annotations

from collections.abc import Callable

import typer

from pinbound.cli import batch, check, crosscheck, export, inspect, mark, report, reproduce
from pinbound.cli.shared import guarded

__all__ = ["app", "main"]

app = typer.Typer(
    name="pinbound",
    help="Coupled joint limits and self-collision boundaries in closed form, from a URDF.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


def _register(command: Callable[..., None]) -> None:
    app.command(command.__name__)(guarded(command))


_register(inspect.info)
_register(inspect.derive)
_register(inspect.limits)
_register(inspect.region)
_register(batch.batch)
_register(check.check)
_register(mark.mark)
_register(crosscheck.crosscheck)
_register(export.export)
_register(report.report)
_register(reproduce.reproduce)


def main() -> None:
    """Run the program; the entry point of `pinbound`."""
    app()
