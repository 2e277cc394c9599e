"""`pinbound batch`: evaluates boundaries on files, grids, random or Sobol points, and writes Parquet files."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from pinbound.batch import (
    COLUMNS,
    VERDICTS,
    Evaluation,
    GridSource,
    Outcome,
    RandomSource,
    SobolSource,
    Source,
    evaluation_of,
    open_source,
    run,
)
from pinbound.cli.coverage import (
    LimitsOnly,
    RequireCoverage,
    coverage_record,
    nothing_to_check,
    require_coverage,
    say_coverage,
)
from pinbound.cli.shared import (
    Annotations,
    AsJson,
    PackageDirs,
    RobotName,
    XacroArgs,
    console,
    emit_json,
    hint_degrees,
    load_robot,
    millimetres,
    number,
    print_table,
    refuse_twice,
)
from pinbound.exceptions import InputError, Problem, name_hint
from pinbound.robot.robot import Robot

__all__ = ["batch"]

QUANTILES = (0.01, 0.1, 0.5, 0.9)
_DIGITS = 15
_LOOK = 1000  # number of rows of a file that are checked for values that look like degrees


def batch(
    robot: RobotName,
    out: Annotated[Path, typer.Option(help="Folder for the Parquet files. An unfinished job there is resumed.")],
    file: Annotated[
        Path | None,
        typer.Option("--in", help="CSV, NPY, NPZ or Parquet file with one column for each coordinate."),
    ] = None,
    grid: Annotated[
        str | None,
        typer.Option(help="Grid as NAME=FROM:TO:COUNT, e.g. q2=-1.5:1.5:301,q3=... Other coordinates stay at home."),
    ] = None,
    random: Annotated[
        int | None, typer.Option(help="Number of random configurations, uniform within the joint limits.")
    ] = None,
    sobol: Annotated[int | None, typer.Option(help="Number of scrambled Sobol points within the joint limits.")] = None,
    seed: Annotated[int, typer.Option(help="Seed of --random and --sobol.", min=0)] = 0,
    within: Annotated[
        str | None, typer.Option(help="Other ranges for --random and --sobol, e.g. q2=-3:3,q3=-1:1.")
    ] = None,
    deg: Annotated[bool, typer.Option("--deg", help="Angles of --in, --grid and --within are in degrees.")] = False,
    columns: Annotated[
        str, typer.Option(help=f"Columns to write, some of: {', '.join(COLUMNS)}.")
    ] = "coordinates,smallest,verdict",
    chunk_rows: Annotated[
        int, typer.Option(help="Rows in each file. Memory use is a small multiple of one file.", min=1)
    ] = 1_000_000,
    threads: Annotated[int, typer.Option(help="Number of threads.", min=1)] = 1,
    scheduler: Annotated[str | None, typer.Option(help="Address of a Dask scheduler that runs the chunks.")] = None,
    summary: Annotated[
        bool, typer.Option("--summary", help="Print minimum, quantiles and number of contacts of each boundary.")
    ] = False,
    limits_only: LimitsOnly = False,
    require_coverage_: RequireCoverage = False,
    annotations: Annotations = None,
    package_dir: PackageDirs = None,
    xacro_arg: XacroArgs = None,
    as_json: AsJson = False,
) -> None:
    """Evaluate many configurations and write Parquet files. The same command resumes a job that was stopped.

    Exit codes: 0 files written, whatever the verdicts; 1 required coverage is partial; 2 bad input, nothing to check.
    """
    loaded = load_robot(robot, annotations, package_dir, xacro_arg)
    if not len(loaded.boundaries) and not limits_only:
        nothing_to_check(loaded.name, robot)
    require_coverage(loaded.coverage.of(()) if limits_only else loaded.coverage, require_coverage_)
    source = _source(loaded, file, grid, random, sobol, seed, within, deg)
    names = tuple(name.strip() for name in columns.split(",") if name.strip())
    evaluation = evaluation_of(loaded, names, summary, limits_only=limits_only)
    fields = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[rate]}"),
        TimeRemainingColumn(),
    )
    with Progress(*fields, console=console(stderr=True)) as progress:
        task = progress.add_task(loaded.name, total=source.rows, rate="")

        def advance(rows: int) -> None:
            progress.advance(task, rows)
            speed = progress.tasks[0].finished_speed or progress.tasks[0].speed
            progress.update(task, rate=f"{speed / 1e6:.3g} M rows/s" if speed else "")

        try:
            outcome = run(evaluation, source, out, chunk_rows, threads, scheduler, advance)
        except KeyboardInterrupt:
            progress.stop()
            typer.echo(f"pinbound: stopped; {out} keeps what is done: run the same command again to resume.", err=True)
            raise typer.Exit(130) from None
    record = _record(evaluation, outcome)
    if as_json:
        emit_json(record)
    else:
        _print(evaluation, outcome)


def _bad(option: str, message: str, remedy: str) -> InputError:
    return InputError([Problem(message, remedy, option)])


def _source(
    robot: Robot,
    file: Path | None,
    grid: str | None,
    random: int | None,
    sobol: int | None,
    seed: int,
    within: str | None,
    deg: bool,
) -> Source:
    given = [
        name
        for name, value in (("--in", file), ("--grid", grid), ("--random", random), ("--sobol", sobol))
        if value is not None
    ]
    if len(given) != 1:
        raise _bad("batch", f"{len(given)} sources of configurations", "Give one of --in, --grid, --random, --sobol")
    if within and (file is not None or grid is not None):
        raise _bad("--within", f"does nothing with {given[0]}", "Remove it, or give --random or --sobol")
    if file is not None:
        source = open_source(file, robot.coordinates, [deg and robot.turns(name) for name in robot.coordinates])
        if not deg and source.rows:
            hint_degrees(robot, source.read(0, min(source.rows, _LOOK)), "--in")
        return source
    if grid is not None:
        axes = [(float(value), float(value), 1) for value in robot.home]
        for index, words in _parts(robot, "--grid", grid, 3, "NAME=FROM:TO:COUNT"):
            low, high = _ends(robot, index, words, deg, "--grid")
            if not (words[2].isascii() and words[2].isdigit() and 0 < len(words[2].lstrip("0")) <= _DIGITS):
                raise _bad("--grid", f"{words[2]!r} is no count", "Write NAME=FROM:TO:COUNT, COUNT from 1 to 10^15")
            axes[index] = (low, high, int(words[2]))
        _hint(robot, [axis[:2] for axis in axes], deg, "--grid")
        return GridSource(tuple(axes))
    lower, upper = robot.lower.copy(), robot.upper.copy()
    given_ends = [(0.0, 0.0)] * len(robot.coordinates)
    for index, words in _parts(robot, "--within", within or "", 2, "NAME=FROM:TO"):
        given_ends[index] = lower[index], upper[index] = _ends(robot, index, words, deg, "--within")
    if within:
        _hint(robot, given_ends, deg, "--within")
    for index, name in enumerate(robot.coordinates):
        if not (math.isfinite(lower[index]) and math.isfinite(upper[index])):
            raise _bad("--within", f"{name!r} has no limits", f"Give its box, e.g. --within {name}=-3.14:3.14")
    count = random if random is not None else sobol
    if count is None or not 0 < count < 10**_DIGITS:
        raise _bad(given[0], f"{count} configurations", "Give from 1 to 10^15")
    kind = RandomSource if random is not None else SobolSource
    return kind(count, seed, tuple(lower.tolist()), tuple(upper.tolist()))


def _parts(robot: Robot, option: str, text: str, count: int, form: str) -> list[tuple[int, list[str]]]:
    found: list[tuple[int, list[str]]] = []
    for part in filter(None, (word.strip() for word in text.split(","))):
        name, _, rest = part.partition("=")
        words = rest.split(":")
        if name not in robot.coordinates or len(words) != count:
            hint = (
                f"Write {form}" if name in robot.coordinates else f"Coordinates: {name_hint(name, robot.coordinates)}"
            )
            raise _bad(option, f"{part!r} is not {form}", hint)
        refuse_twice([robot.coordinates[index] for index, _ in found], name, option)
        found.append((robot.coordinates.index(name), words))
    return found


def _ends(robot: Robot, index: int, words: list[str], deg: bool, option: str) -> tuple[float, float]:
    low, high = number(words[0]), number(words[1])
    if not (math.isfinite(low) and math.isfinite(high) and low <= high):
        raise _bad(option, f"{':'.join(words[:2])!r} is no interval", "Write FROM:TO, two finite numbers, FROM <= TO")
    turns = deg and robot.turns(robot.coordinates[index])
    return (math.radians(low), math.radians(high)) if turns else (low, high)


def _hint(robot: Robot, ends: list[tuple[float, float]], deg: bool, option: str) -> None:
    if not deg:
        hint_degrees(robot, np.array(ends).T, option)


def _record(evaluation: Evaluation, outcome: Outcome) -> dict[str, Any]:
    statistics = outcome.statistics
    record: dict[str, Any] = {
        "folder": str(outcome.folder),
        "rows": statistics.rows,
        "invalid": statistics.invalid,
        "chunks": outcome.chunks,
        "resumed": outcome.resumed,
        "bytes": outcome.bytes,
        "backend": evaluation.backend,
        "region_note": evaluation.region_note,
        "coverage": coverage_record(evaluation.coverage),
        "limits_only": evaluation.limits_only,
        "verdicts": dict(zip(VERDICTS, statistics.verdicts, strict=True)) if statistics.verdicts else None,
    }
    if statistics.minima:
        quantiles = outcome.quantiles(evaluation, QUANTILES)
        widths = np.diff(evaluation.spans)[:, 0] / 1024
        record["summary"] = [
            {
                "boundary": name,
                "minimum": statistics.minima[k],
                "contacts": statistics.contacts[k],
                "quantiles": dict(zip(map(str, QUANTILES), quantiles[k].tolist(), strict=True)),
                "quantile_resolution": float(widths[k]),
            }
            for k, name in enumerate(evaluation.boundaries)
        ]
    return record


def _print(evaluation: Evaluation, outcome: Outcome) -> None:
    statistics = outcome.statistics
    rows = [("rows", f"{statistics.rows:,}"), ("invalid", f"{statistics.invalid:,}")]
    if statistics.verdicts:
        rows += [(name, f"{n:,}") for name, n in zip(VERDICTS, statistics.verdicts, strict=True) if name != "invalid"]
    rows += [
        ("files", f"{outcome.chunks:,} ({outcome.resumed:,} existed already)"),
        ("size", f"{outcome.bytes / 1e6:,.1f} MB"),
    ]
    print_table(f"{evaluation.robot} in {outcome.folder}", ("what", "count"), rows, evaluation.region_note)
    say_coverage(evaluation.coverage)
    if not statistics.minima:
        return
    quantiles = outcome.quantiles(evaluation, QUANTILES)
    table = [
        (
            name,
            millimetres(statistics.minima[k], 6),
            *(millimetres(float(x), 2) for x in quantiles[k]),
            f"{statistics.contacts[k]:,}",
        )
        for k, name in enumerate(evaluation.boundaries)
    ]
    heads = ("boundary", "minimum [mm]", *(f"{100 * level:g} % below [mm]" for level in QUANTILES), "contacts")
    width = 1e3 * float(np.max(np.diff(evaluation.spans), initial=0.0)) / 1024
    print_table("Clearances of finite rows", heads, table, f"quantiles to {width:.2f} mm or better, minima exact")
