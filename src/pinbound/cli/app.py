"""The command line program: one typer app, one module a group of commands."""

from __future__ import annotations

import typer

from pinbound.cli import batch, inspect
from pinbound.cli.shared import guarded

__all__ = ["app", "main"]

app = typer.Typer(
    name="pinbound",
    help="Coupled joint limits and self-collision boundaries in closed form, from a URDF.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

for command in (inspect.info, inspect.derive, inspect.limits, inspect.region, batch.batch):
    app.command(command.__name__)(guarded(command))


def main() -> None:
    """Run the program; the entry point of `pinbound`."""
    app()
