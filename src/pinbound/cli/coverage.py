"""Output about coverage: one line with every verdict, and the list of pairs of links that are not watched."""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict
from typing import Annotated, Any

import typer

from pinbound.cli.shared import console, print_table
from pinbound.coverage import Coverage, CoverageRecord, PairCoverage
from pinbound.robot.robot import Robot
from pinbound.units import several

__all__ = [
    "LimitsOnly",
    "RequireCoverage",
    "coverage_record",
    "nothing_to_check",
    "print_coverage",
    "require_coverage",
    "say_assumptions",
    "say_coverage",
]

RequireCoverage = Annotated[
    bool, typer.Option("--require-coverage", help="Exit with 1 if a pair of links is neither watched nor left out.")
]
LimitsOnly = Annotated[bool, typer.Option("--limits-only", help="Check the joint limits only, no boundaries.")]

_MOST_LINES = 40


def say_assumptions(robot: Robot) -> None:
    """Print the robot's assumptions, for example which numbers of a preset are unpublished and not in the model."""
    for one in robot.annotations.assumptions:
        console().print(f"assumption: {one}", markup=False, soft_wrap=True)


def say_coverage(record: CoverageRecord) -> None:
    """Print the line about coverage that every verdict has."""
    console().print(f"coverage: {record.summary}", markup=False, soft_wrap=True)


def coverage_record(record: CoverageRecord) -> dict[str, Any]:
    """Return the numbers, and the line about coverage, for JSON."""
    return asdict(record)


def require_coverage(coverage: Coverage, required: bool) -> None:
    """Exit with code 1, and list the pairs on stderr, if coverage is required and some pair of links is open.

    Raises:
        Exit: If coverage is required and a pair is open.
    """
    if not required or coverage.is_complete:
        return
    said = console(stderr=True)
    lines = [f"{' - '.join(pair.links)}: {pair.status.value}; {pair.reason}" for pair in coverage.open]
    said.print(
        f"coverage is required, and {several(len(lines), 'pair of links is', 'pairs of links are')} open:", markup=False
    )
    for line in lines[:_MOST_LINES] or ["no link has a body, so no pair of links can be watched"]:
        said.print(f"- {line}", markup=False, soft_wrap=True)
    if len(lines) > _MOST_LINES:
        said.print(f"... and {len(lines) - _MOST_LINES} more: pinbound info ROBOT --pairs", markup=False)
    said.print("Mark the bodies of these links (pinbound mark), or state a reason: left_out: [{a:, b:, reason:}].")
    raise typer.Exit(1)


def nothing_to_check(name: str, robot: str) -> None:
    """Exit with code 2: the robot has no boundary, and the user did not ask to check only its limits.

    Args:
        name: Name of the robot.
        robot: The robot argument as typed.

    Raises:
        Exit: Always.
    """
    said = console(stderr=True)
    said.print(
        f"pinbound: {name} has no boundary to check. Mark it (pinbound mark {robot} --out NAME.pinbound.yaml), "
        "or ask for joint limits alone with --limits-only.",
        markup=False,
        soft_wrap=True,
    )
    raise typer.Exit(2)


def print_coverage(coverage: Coverage, every_pair: bool) -> None:
    """Print the numbers of pairs of links by status and reason, or each pair, and then the line about coverage."""
    if every_pair:
        rows = [(*pair.links, pair.status.value, ", ".join(pair.boundaries), pair.reason) for pair in coverage.pairs]
        print_table("Pairs of links with bodies", ("link", "link", "coverage", "boundaries", "why"), rows)
    else:
        counts = Counter((pair.status.value, _short(pair)) for pair in coverage.pairs)
        print_table("Coverage", ("pairs of links", "why", "number []"), [(*key, n) for key, n in counts.items()])
    reasons = Counter(body.reason for body in coverage.bodies if body.reason)
    if reasons:
        print_table("Bodies that no mark holds", ("why", "number []"), list(reasons.items()))
    for note in coverage.notes:
        console().print(f"note: {note}", markup=False)
    say_coverage(coverage.record)


def _short(pair: PairCoverage) -> str:
    """Return the reason without names and numbers that belong to one pair."""
    if pair.boundaries and pair.reason:
        return "not all of their bodies are held, or not all pairs of them are watched"
    return pair.reason
