"""`pinbound mark`: propose a sidecar of marks and pairs for a robot with simple collision bodies."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Annotated, cast

import typer

from pinbound.annotations import kind_of
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
)
from pinbound.coverage.covers import By, Cover
from pinbound.exceptions import InputError, Problem
from pinbound.marking.propose import SHAPES, Proposal, propose_marks
from pinbound.robot.robot import Robot

__all__ = ["mark"]


def mark(
    robot: RobotName,
    out: Annotated[Path | None, typer.Option(help="Sidecar to write; it must not exist.")] = None,
    accuracy: Annotated[float, typer.Option(help="How far a mark may stick out of its body [m].")] = 0.02,
    shapes: Annotated[str, typer.Option(help="Shapes to cover, separated by commas.")] = ",".join(SHAPES),
    by: Annotated[str, typer.Option(help="Cover by 'bodies' (capsules, boxes, prisms) or by 'spheres'.")] = "bodies",
    annotations: Annotations = None,
    package_dir: PackageDirs = None,
    xacro_arg: XacroArgs = None,
    as_json: AsJson = False,
) -> None:
    """Propose marks over the bodies of all links and all pairs worth checking, with reasons for what is left out.

    Exits with 1 if a body is not covered: no boundary then speaks of it.
    """
    if out is not None and out.exists():
        raise InputError([Problem("exists already", "Remove it, or give another name", str(out))])
    loaded = load_robot(robot, annotations, package_dir, xacro_arg)
    chosen = tuple(word.strip() for word in shapes.split(",") if word.strip())
    proposal = propose_marks(loaded, accuracy, chosen, cast(By, by))
    if out is not None:
        proposal.annotations.save(out)
    if as_json:
        emit_json(_record(proposal))
    else:
        _print(loaded, proposal, out)
    if proposal.uncovered:
        raise typer.Exit(1)


def _print(robot: Robot, proposal: Proposal, out: Path | None) -> None:
    rows = [
        (one.link, ", ".join(body.shape for body in one.bodies), _said(one), millimetres(one.excess, 2))
        for one in proposal.covers
    ]
    print_table("Bodies and the marks that hold them", ("link", "bodies", "marks", "excess [mm]"), rows)
    reasons = [(a, b, reason, count) for (a, b, reason), count in sorted(proposal.left_out.items())]
    print_table("Pairs left out", ("link", "link", "reason", "pairs []"), reasons)
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
    say(f"{len(proposal.annotations.marks)} marks, {len(proposal.annotations.boundaries)} boundaries.")
    if out is not None:
        say(f"Wrote {out}.")
    missing: dict[str, Counter[str]] = {}
    for body in proposal.uncovered:
        missing.setdefault(body.link, Counter())[body.shape] += 1
    for link, shapes in missing.items():
        listed = ", ".join(f"{count} {shape}" for shape, count in shapes.items())
        count, it = (f"{sum(shapes.values())} bodies", "them") if sum(shapes.values()) > 1 else ("1 body", "it")
        say(f"Not covered: {count} of {link} ({listed}); no boundary speaks of {it}.")
    if missing:
        few, all_of = len(proposal.uncovered), sum(len(one.bodies) for one in proposal.covers)
        say(
            f"{few} of {few + all_of} bodies {'carry' if few > 1 else 'carries'} no mark: what is certified says "
            "nothing of contact with them. Mark them by hand (meshes, other shapes), or ask for their shapes."
        )


def _value(robot: Robot, joint: str, value: float) -> str:
    return f"{joint} = {degrees(value)} deg" if robot.turns(joint) else f"{joint} = {millimetres(value)} mm"


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
            {"links": [a, b], "reason": reason, "pairs": count} for (a, b, reason), count in proposal.left_out.items()
        ],
    }
