"""Parts that all commands use: the robot argument, tables for people, JSON for programs, errors as one message."""

from __future__ import annotations

import functools
import inspect
import json
import math
import re
import sys
from collections.abc import Callable, Container, Generator, Iterable, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Annotated, Any, ParamSpec, TypeVar, cast

import numpy as np
import typer
from rich.console import Console
from rich.progress import Progress, ProgressColumn, SpinnerColumn, Task, TextColumn
from rich.text import Text

from pinbound.cli.tables import show
from pinbound.exceptions import InputError, MachineError, PinboundError, Problem, blames_the_path
from pinbound.model.document import TRUST
from pinbound.robot.loading import load
from pinbound.robot.robot import Robot
from pinbound.typing import Array

__all__ = [
    "Annotations",
    "AsJson",
    "PackageDirs",
    "RobotName",
    "Window",
    "XacroArgs",
    "console",
    "degrees",
    "emit_json",
    "guarded",
    "hint_degrees",
    "load_robot",
    "millimetres",
    "number",
    "parse_configuration",
    "parse_window",
    "print_table",
    "refuse_twice",
    "typed",
    "working",
]

P = ParamSpec("P")
R = TypeVar("R")

_PIPE_WIDTH = 140
# Remedies in messages: the text for Python, and the text with the command line option.
_OPTIONS = {
    r"give coordinates=\(\.{3}, \.{3}\)(?:, two names)? out of:": "add --coordinates NAME,NAME with two names out of:",
    r"give window=\{[^}]*\}": "add --window NAME=LOWER..UPPER",
}
_trusted = ContextVar("trust", default=TRUST[0])

RobotName = Annotated[
    str, typer.Argument(help="Path to a .urdf or .xacro file, or the name of a robot that ships with pinbound.")
]
Annotations = Annotated[
    list[Path] | None,
    typer.Option(help="File with annotations: YAML sidecar, SRDF, robot.yaml or MJCF. May be given more than once."),
]
PackageDirs = Annotated[
    list[Path] | None,
    typer.Option("--package-dir", help="Folder in which package:// and $(find) look for ROS packages."),
]
XacroArgs = Annotated[
    list[str] | None,
    typer.Option("--xacro-arg", help="Argument of a xacro file, as NAME=VALUE. May be given more than once."),
]
Trust = Annotated[str, typer.Option(help="'urdf-only' refuses xacro files, because they can run code.")]
Window = Annotated[
    str | None,
    typer.Option(help="Range in which to search, e.g. q1=-1..1,q2=0..0.5. A coordinate without limits needs a range."),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON (metres, radians) instead of tables.")]


def console(stderr: bool = False) -> Console:
    """Return a console; output to a pipe has a fixed width, so that scripts get the same tables everywhere.

    Names are data: the console interprets no markup and no emoji codes in printed text, and highlights nothing. For
    bold text, pass `style=` or a `rich.text.Text`.
    """
    made = Console(stderr=stderr, markup=False, emoji=False, highlight=False)
    if made.is_terminal:
        return made
    return Console(stderr=stderr, markup=False, emoji=False, highlight=False, width=_PIPE_WIDTH)


@contextmanager
def working(what: str, seconds: float = math.inf) -> Generator[None, None, None]:
    """Show on a terminal the elapsed time of the work, and the time that is left at most; show nothing in a pipe.

    Args:
        what: The work, in a few words.
        seconds: The budget [s] after which the work ends; inf if it has none.
    """
    shown = console(stderr=True)
    if not shown.is_terminal:
        yield
        return
    fields = (SpinnerColumn(), TextColumn("{task.description}", markup=False), _Clock(seconds))
    with Progress(*fields, console=shown, transient=True) as progress:
        progress.add_task(what, total=None)
        yield


class _Clock(ProgressColumn):
    """A column with the time that a task has run, and the time that its budget leaves."""

    def __init__(self, seconds: float) -> None:
        super().__init__()
        self.seconds = seconds

    def render(self, task: Task) -> Text:
        """Return the two times."""
        elapsed = task.elapsed or 0.0
        left = f", at most {max(0.0, self.seconds - elapsed):.0f} s left" if math.isfinite(self.seconds) else ""
        return Text(f"{elapsed:.0f} s{left}")


def guarded(command: Callable[P, R]) -> Callable[..., R]:
    """Turn an expected error into one message on stderr; the exit code is 2 for bad input, 3 if the machine failed.

    Ctrl-C ends a command with exit code 130 and a message how to continue; `pinbound batch` has its own message about
    the files that it keeps.

    Every command that loads a robot gets the option `--trust`.
    """

    @functools.wraps(command)
    def run(*args: P.args, **kwargs: P.kwargs) -> R:
        _trusted.set(str(kwargs.pop("trust", TRUST[0])))
        try:
            return command(*args, **kwargs)
        except MachineError as error:
            typer.echo(f"pinbound: {error}", err=True)
            raise typer.Exit(3) from error
        except PinboundError as error:
            typer.echo(f"pinbound: {_in_options(str(error))}", err=True)
        except KeyboardInterrupt:
            typer.echo("pinbound: stopped. Run the same command again: it starts from the beginning.", err=True)
            raise typer.Exit(130) from None
        except OSError as error:
            place = error.filename if error.filename is not None else command.__name__
            typer.echo(f"pinbound: {place}: {error.strerror or error}", err=True)
            if not blames_the_path(error):
                raise typer.Exit(3) from error
        raise typer.Exit(2)

    signature = inspect.signature(command, eval_str=True)
    if "xacro_arg" in signature.parameters:
        asked = inspect.Parameter("trust", inspect.Parameter.KEYWORD_ONLY, default=TRUST[0], annotation=Trust)
        found: dict[str, Any] = {name: one.annotation for name, one in signature.parameters.items()}
        run.__annotations__ = found | {"trust": Trust, "return": signature.return_annotation}
        cast(Any, run).__signature__ = signature.replace(parameters=[*signature.parameters.values(), asked])
    return run


def _in_options(message: str) -> str:
    """Return a message in which remedies with Python arguments are replaced by command line options."""
    for pattern, option in _OPTIONS.items():
        message = re.sub(pattern, option, message)
    return message


def load_robot(
    robot: str,
    annotations: Sequence[Path] | None = None,
    package_dirs: Sequence[Path] | None = None,
    xacro_args: Sequence[str] | None = None,
) -> Robot:
    """Load the robot that a command line names."""
    mappings: dict[str, str] = {}
    for text in xacro_args or ():
        name, equals, value = text.partition("=")
        if not equals or not name:
            raise _bad("--xacro-arg", f"{text!r} is not NAME=VALUE", "Write e.g. --xacro-arg bridge=as_printed")
        refuse_twice(mappings, name, "--xacro-arg")
        mappings[name] = value
    with working(f"reading {Path(robot).name}"):
        return load(robot, annotations or None, tuple(package_dirs or ()), mappings, trust=_trusted.get())


def number(text: str) -> float:
    """Return the number in a word; NaN if the word is not a number. Digits are 0 to 9, without `_` between them.

    Example:
        >>> number(" 1e-3 "), number("1_0"), number("far")
        (0.001, nan, nan)
    """
    try:
        return float(text) if text.isascii() and "_" not in text else math.nan
    except ValueError:
        return math.nan


def refuse_twice(known: Container[object], name: str, option: str) -> None:
    """Refuse a name that an option gives a second time: one of the two values would be lost."""
    if name in known:
        raise _bad(option, f"{name!r} is given twice", "Keep one")


def _bad(option: str, message: str, remedy: str) -> InputError:
    return InputError([Problem(message, remedy, option)])


def parse_configuration(
    robot: Robot, text: str | None, deg: bool = False, option: str = "--at"
) -> np.ndarray[Any, Any]:
    """Return home, changed by ``"q2=0.1,q3=-0.2"`` (radians, or degrees with `deg`; always metres if prismatic)."""
    q, given = np.array(robot.home), set[str]()
    for part in filter(None, (text or "").split(",")):
        name, equals, word = (word.strip() for word in part.partition("="))
        value = number(word)
        if not equals or name not in robot.coordinates or not math.isfinite(value):
            remedy = f"Write NAME=NUMBER, NAME one of: {', '.join(robot.coordinates)}"
            raise _bad(option, f"{part.strip()!r} is not a coordinate with a finite number", remedy)
        refuse_twice(given, name, option)
        given.add(name)
        q[robot.coordinates.index(name)] = math.radians(value) if deg and robot.turns(name) else value
    if not deg:
        hint_degrees(robot, q[None], option)
    return q


def hint_degrees(robot: Robot, Q: np.ndarray[Any, Any], option: str) -> None:
    """Print a hint on stderr if numbers that are read as radians look like degrees."""
    from pinbound.certificates.degrees import look_like_degrees

    if look_like_degrees(robot, Q[np.all(np.isfinite(Q), axis=1)]):
        message = f"note: {option}: these numbers look like degrees, and are read as radians; add --deg if they are"
        typer.echo(message, err=True)


def parse_window(robot: Robot, text: str | None, deg: bool = False) -> dict[str, tuple[float, float]]:
    """Return the ends by coordinate of ``"q1=-1..1,s=0..0.5"`` (radians; degrees if `deg`; metres if prismatic)."""
    window: dict[str, tuple[float, float]] = {}
    for part in filter(None, (text or "").split(",")):
        name, _, ends = (word.strip() for word in part.partition("="))
        low, dots, high = ends.partition("..")
        lower, upper = number(low), number(high)
        if not dots or name not in robot.coordinates or not lower <= upper:
            remedy = f"Write NAME=LOWER..UPPER, e.g. q1=-1..1, NAME one of: {', '.join(robot.coordinates)}"
            raise _bad("--window", f"{part.strip()!r} is not a coordinate with two ends, lower first", remedy)
        refuse_twice(window, name, "--window")
        turns = deg and robot.turns(name)
        window[name] = (math.radians(lower), math.radians(upper)) if turns else (lower, upper)
    if window and not deg:
        ends = np.tile(np.zeros(len(robot.coordinates)), (2, 1))
        for name, both in window.items():
            ends[:, robot.coordinates.index(name)] = both
        hint_degrees(robot, ends, "--window")
    return window


def emit_json(value: Any) -> None:
    """Print a value as JSON: arrays as lists, numbers that are not finite as null."""
    sys.stdout.write(json.dumps(_plain(value), indent=2, allow_nan=False) + "\n")


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        return _plain(cast(Any, value).tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {str(key): _plain(entry) for key, entry in cast(dict[Any, Any], value).items()}
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in cast(Sequence[Any], value)]
    return value


def print_table(
    title: str, columns: Sequence[str], rows: Iterable[Sequence[object]], note: str = "", most: int | None = None
) -> None:
    """Print a table for people; columns whose heading ends in ``]`` have numbers and are right-aligned.

    The heading of numbers without a unit is ``"rows []"``; the brackets are not printed. A table without rows is not
    printed. If a table is too wide for the terminal, cells fold at spaces; if this is not enough, each row is printed
    as a record. Rows beyond the first `most` are not printed, and the note says how many these are.
    """
    rows = list(rows)
    if not rows:
        return
    if most is not None and len(rows) > most:
        note = f"The first {most} of {len(rows)} are shown: --json lists all. {note}".rstrip()
        rows = rows[:most]
    show(console(), title, columns, [[str(cell) for cell in row] for row in rows], note)


def degrees(angle: float | None, digits: int = 6) -> str:
    """Return an angle [rad] in degrees for people; a dash if there is no angle.

    Example:
        >>> degrees(np.pi / 4), degrees(None), degrees(np.inf)
        ('45.000000', '-', 'none')
    """
    if angle is None or math.isnan(angle):
        return "-"
    return f"{math.degrees(angle):.{digits}f}" if math.isfinite(angle) else "none"


def millimetres(length: float, digits: int = 4) -> str:
    """Return a length [m] in millimetres for people."""
    return f"{1e3 * length:.{digits}f}"


def typed(robot: Robot, q: Array, digits: int = 9) -> str:
    """Return q (n,) in the form of command line options: names and values in radians or metres."""
    return ",".join(f"{name}={value:.{digits}g}" for name, value in zip(robot.coordinates, q.tolist(), strict=True))
