"""`pinbound mark`: proposes a sidecar with marks that hold the bodies, and with boundaries between them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, cast

import typer
from rich.progress import Progress

from pinbound.annotations import kind_of
from pinbound.cli.outputs import ready_file
from pinbound.cli.shared import (
    Annotations,
    AsJson,
    PackageDirs,
    RobotName,
    XacroArgs,
    console,
    degrees,
    emit_json,
    load_robot,
    millimetres,
    print_table,
    typed,
)
from pinbound.coverage.covers import By, Cover
from pinbound.exceptions import InputError, Problem
from pinbound.marking.disabled import DisabledPair, disabled_pairs, find_srdf, stated_pairs
from pinbound.marking.judge import Evidence
from pinbound.marking.propose import ALL_SHAPES, Proposal, propose_marks
from pinbound.robot.robot import Robot
from pinbound.typing import Array
from pinbound.units import several

if TYPE_CHECKING:
    from pinbound.crosscheck.raw import RawBodies

__all__ = ["mark"]

_MOST_LINES = 40
_BASES = {"proof": "proof", "witness": "witness", "samples": "samples", "granted": "taken for granted"}


def mark(
    robot: RobotName,
    out: Annotated[Path | None, typer.Option(help="Sidecar to write. The file must not exist yet.")] = None,
    accuracy: Annotated[float, typer.Option(help="How far a mark may stick out of its body, in mm.")] = 20.0,
    shapes: Annotated[str, typer.Option(help="Shapes of bodies to cover, separated by commas.")] = ",".join(ALL_SHAPES),
    by: Annotated[str, typer.Option(help="Cover meshes by hulls, capsules, spheres or boxes.")] = "hulls",
    most: Annotated[
        int | None,
        typer.Option(
            help="Largest number of marks for the meshes of one link. Default: 8; 32 if the accuracy is below 10 mm."
        ),
    ] = None,
    skip_missing: Annotated[
        bool, typer.Option("--skip-missing", help="List a mesh that cannot be read as not covered, and go on.")
    ] = False,
    neighbours: Annotated[bool, typer.Option("--neighbours", help="Also watch pairs of neighbours.")] = False,
    srdf: Annotated[
        Path | None,
        typer.Option(help="SRDF whose disable_collisions are examined. Default: the one beside the robot."),
    ] = None,
    annotations: Annotations = None,
    package_dir: PackageDirs = None,
    xacro_arg: XacroArgs = None,
    as_json: AsJson = False,
) -> None:
    """Propose marks that hold the bodies, and boundaries for pairs that can collide. List what is left out, and why.

    Exit codes: 0 all bodies are covered; 1 a body is not covered, so no boundary watches it; 2 bad input.
    """
    if out is not None and out.exists():
        raise InputError([Problem("exists already", "Remove it, or give another name", str(out))])
    loaded = load_robot(robot, annotations, package_dir, xacro_arg)
    ready_file(out)
    examined, said_of_srdf = _srdf(loaded, srdf)
    chosen = tuple(word.strip() for word in shapes.split(",") if word.strip())
    start = perf_counter()
    bar = console(stderr=True)
    progress = Progress(console=bar, transient=True)
    with progress if bar.is_terminal else nullcontext():  # without a terminal, the bar would print an empty line
        task = progress.add_task("covers of meshes", total=None, visible=False)

        def step(done: int, total: int, link: str) -> None:
            if done < total:
                progress.update(task, completed=done, total=total, description=f"meshes of {link}", visible=True)
            else:
                progress.update(task, completed=0, total=None, description="pairs of marks, and home", visible=True)

        proposal = propose_marks(loaded, accuracy / 1e3, chosen, cast(By, by), neighbours, most, skip_missing, step)
    disabled = disabled_pairs(loaded, proposal.covers, examined, _Raw(loaded), proposal.judge)
    if out is not None:
        proposal.annotations.save(out)
    if as_json:
        emit_json(_record(proposal) | {"disabled": [_disabled_record(one) for one in disabled], "srdf": said_of_srdf})
    else:
        _print(loaded, proposal, out, perf_counter() - start)
        _print_disabled(loaded, disabled, said_of_srdf)
    if proposal.uncovered:
        raise typer.Exit(1)


def _srdf(robot: Robot, given: Path | None) -> tuple[Path | None, str]:
    """Return the SRDF to examine, or None; and a sentence if no SRDF is read, or if it disables no pair."""
    files = list(find_srdf(robot)) if given is None else [given]
    if not files:
        return None, ""
    if len(files) > 1:
        named = ", ".join(file.name for file in files)
        return None, f"{len(files)} SRDFs name this robot, so none was read. Choose one with --srdf: {named}."
    return files[0], "" if stated_pairs(robot, files[0]) else f"{files[0].name} disables no pair of links."


class _Raw:
    """Compares the bodies of a robot, also meshes, in coal; coal loads when the first pair is compared."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self._known: dict[tuple[str, str], RawBodies] = {}

    def __call__(self, links: tuple[str, str], Q: Array) -> int | None:
        from pinbound.crosscheck.raw import RawBodies

        if links not in self._known:
            self._known[links] = RawBodies(self.robot, [links])
        return self._known[links].first_contact(links, Q)


def _print_disabled(robot: Robot, disabled: Sequence[DisabledPair], said_of_srdf: str) -> None:
    said = console()
    if said_of_srdf:
        said.print(said_of_srdf, markup=False)
    if not disabled:
        return
    sources = ", ".join(dict.fromkeys(one.source for one in disabled))
    counts = Counter((one.verdict, _BASES[one.basis]) for one in disabled)
    rows = [(verdict, basis, count) for (verdict, basis), count in counts.items()]
    print_table(f"Pairs of links that {sources} disables", ("found", "rests on", "pairs []"), rows)
    seen = [(one, one.q) for one in disabled if one.q is not None]
    rows = [(*one.links, one.reason, f"{one.verdict}: {one.text}") for one, _ in seen[:_MOST_LINES]]
    print_table(
        "Disabled, and in contact at the configurations below", ("link", "link", "file's reason", "found"), rows
    )
    for one, q in seen[:_MOST_LINES]:
        said.print(f"{' - '.join(one.links)}: at {typed(robot, q, 6)}", markup=False, soft_wrap=True)
    if len(seen) > _MOST_LINES:
        said.print(f"... and {len(seen) - _MOST_LINES} more: --json lists all.", markup=False)
    said.print("A pair that a file disables is still watched, unless a reason above leaves it out.", markup=False)


def _disabled_record(one: DisabledPair) -> dict[str, object]:
    return {
        "links": list(one.links),
        "file": one.source,
        "line": one.line,
        "reason": one.reason,
        "found": one.verdict,
        "basis": one.basis,
        "text": one.text,
        "q": None if one.q is None else one.q.tolist(),
    }


def _print(robot: Robot, proposal: Proposal, out: Path | None, seconds: float) -> None:
    rows = [
        (
            one.link,
            ", ".join(body.shape for body in one.bodies),
            _triangles(one),
            _said(one),
            millimetres(one.excess, 2),
        )
        for one in proposal.covers
    ]
    columns = ("link", "bodies", "triangles held []", "marks", "excess [mm]")
    if not any(one.proof for one in proposal.covers):
        columns, rows = columns[:2] + columns[3:], [row[:2] + row[3:] for row in rows]
    print_table("Bodies and the marks that hold them", columns, rows)
    reasons = [
        (a, b, reason, count, _BASES[proposal.evidence[a, b, reason].basis], proposal.evidence[a, b, reason].text)
        for (a, b, reason), count in sorted(proposal.left_out.items())
    ]
    print_table("Pairs left out", ("link", "link", "reason", "pairs []", "rests on", "how"), reasons)
    deepest = sorted(proposal.touching.items(), key=lambda one: one[1])
    overlaps = [(*marks, millimetres(-gap) if gap < 0.0 else "touch") for marks, gap in deepest]
    if overlaps:
        home = (
            "the given home"
            if robot.annotations.home
            else "the URDF's zero within its limits, because no home is given"
        )
        print_table(f"In contact at {home}", ("mark", "mark", "overlap [mm]"), overlaps)
    said = console()

    def say(text: str) -> None:
        said.print(text, markup=False, soft_wrap=True)

    for note in proposal.notes:
        say(f"Note: {note}.")
    if proposal.home_note:
        say(proposal.home_note)
    if proposal.annotations.home:
        home = [_value(robot, name, value) for name, value in proposal.annotations.home.items()]
        say(f"home: {', '.join(home)}")
    proofs = [one.proof for one in proposal.covers if one.proof is not None]
    if proofs:
        held, count = sum(one.held for one in proofs), sum(len(one.part_of) for one in proofs)
        say(f"{several(len(proofs), 'mesh')}: {held} of {count} triangles are proven to lie in the marks.")
    marks, watched = proposal.annotations.marks, proposal.annotations.boundaries
    counts = f"{several(len(marks), 'mark')}, {several(len(watched), 'boundary')}"
    say(f"{counts}; found in {seconds:.1f} s.")
    if out is not None:
        say(f"Wrote {out}.")
    missing: dict[str, Counter[str]] = {}
    for body in proposal.uncovered:
        missing.setdefault(body.link, Counter())[body.shape] += 1
    for link, shapes in missing.items():
        listed = ", ".join(f"{count} {shape}" for shape, count in shapes.items())
        count, it = (f"{sum(shapes.values())} bodies", "them") if sum(shapes.values()) > 1 else ("1 body", "it")
        say(f"Not covered: {count} of {link} ({listed}); no boundary watches {it}.")
    if missing:
        few, all_of = len(proposal.uncovered), sum(len(one.bodies) for one in proposal.covers)
        say(
            f"{few} of {few + all_of} bodies {'have' if few > 1 else 'has'} no mark: certificates say nothing about "
            "contact with them. Mark them by hand, or add their shapes to --shapes."
        )


def _value(robot: Robot, joint: str, value: float) -> str:
    return f"{joint} = {degrees(value)} deg" if robot.turns(joint) else f"{joint} = {millimetres(value)} mm"


def _triangles(cover: Cover) -> str:
    return "" if cover.proof is None else f"{cover.proof.held} of {len(cover.proof.part_of)}"


def _said(cover: Cover) -> str:
    counts = Counter(kind_of(mark) for mark in cover.marks)
    return ", ".join(f"{count} {kind}{'s' if count > 1 else ''}" for kind, count in counts.items())


def _record(proposal: Proposal) -> dict[str, object]:
    return {
        "marks": len(proposal.annotations.marks),
        "boundaries": len(proposal.annotations.boundaries),
        "excess": proposal.excess,
        "covers": [
            {
                "link": c.link,
                "shapes": [body.shape for body in c.bodies],
                "marks": [kind_of(mark) for mark in c.marks],
                "excess": c.excess,
                "triangles": None if c.proof is None else len(c.proof.part_of),
                "triangles_held": None if c.proof is None else c.proof.held,
            }
            for c in proposal.covers
        ],
        "uncovered": [
            {"link": body.link, "name": body.name, "shape": body.shape, "source": body.source, "line": body.line}
            for body in proposal.uncovered
        ],
        "home": dict(proposal.annotations.home),
        "home_note": proposal.home_note,
        "touching": [{"marks": [a, b], "gap": gap} for (a, b), gap in proposal.touching.items()],
        "notes": list(proposal.notes),
        "left_out": [
            {"links": [a, b], "reason": reason, "pairs": count} | _evidence_record(proposal.evidence[a, b, reason])
            for (a, b, reason), count in proposal.left_out.items()
        ],
    }


def _evidence_record(one: Evidence) -> dict[str, object]:
    q = None if one.q is None else one.q.tolist()
    return {"basis": one.basis, "text": one.text, "q": q, "marks": [list(pair) for pair in one.marks]}
