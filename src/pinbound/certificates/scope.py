"""The scope of a certificate: the requested boundaries, or limits alone, and the pairs that are not watched."""

from __future__ import annotations

from collections.abc import Sequence

from pinbound.boundaries.boundary import Boundary
from pinbound.certificates.constraints import select
from pinbound.certificates.records import Verdict
from pinbound.coverage import CoverageRecord
from pinbound.exceptions import DimensionError
from pinbound.robot.robot import Robot, check_robot

__all__ = ["ONLY_LIMITS", "covered", "scope", "settled"]

ONLY_LIMITS = "no boundary was checked: the verdict is about joint limits alone"
"""The note of a certificate for limits only."""


def scope(robot: Robot, boundaries: Sequence[str] | None, limits: bool, limits_only: bool) -> tuple[Boundary, ...]:
    """Return the boundaries to check: those with these names, all for None, none if only limits are checked.

    Raises:
        UnknownNameError: If the robot has no boundary of that name.
        DimensionError: If only limits are requested, and also boundaries, or no limits.
    """
    check_robot(robot)
    if limits_only and (boundaries or not limits):
        asked = "names of boundaries" if boundaries else "limits=False"
        raise DimensionError(f"limits_only=True checks joint limits and nothing else; leave {asked} out")
    return () if limits_only else select(robot, boundaries)


def covered(robot: Robot, chosen: Sequence[Boundary]) -> CoverageRecord:
    """Return which pairs of links these boundaries watch."""
    if len(chosen) == len(robot.boundaries):
        return robot.coverage.record
    return robot.coverage.of(boundary.name for boundary in chosen).record


def settled(verdict: Verdict, chosen: Sequence[Boundary], limits_only: bool) -> Verdict:
    """Return the verdict; without boundaries NOTHING_TO_CHECK, unless a limit is violated or only limits count."""
    if chosen or limits_only or verdict is Verdict.VIOLATED:
        return verdict
    return Verdict.NOTHING_TO_CHECK
