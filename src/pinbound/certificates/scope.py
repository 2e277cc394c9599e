"""What a certificate speaks of: the boundaries that are asked for, or limits alone; and what that leaves unseen."""

from __future__ import annotations

from collections.abc import Sequence

from pinbound.boundaries.boundary import Boundary
from pinbound.certificates.constraints import select
from pinbound.certificates.records import Verdict
from pinbound.coverage import CoverageRecord
from pinbound.exceptions import DimensionError
from pinbound.robot.robot import Robot

__all__ = ["ONLY_LIMITS", "covered", "scope", "settled"]

ONLY_LIMITS = "no boundary was checked: the verdict is about joint limits alone"
"""The note of a certificate that was asked for limits only."""


def scope(robot: Robot, boundaries: Sequence[str] | None, limits: bool, limits_only: bool) -> tuple[Boundary, ...]:
    """Return the boundaries to check: those of these names, all for None, none if limits alone are asked for.

    Raises:
        UnknownNameError: If the robot has no boundary of that name.
        DimensionError: If limits alone are asked for, and also boundaries, or no limits.
    """
    if limits_only and (boundaries or not limits):
        asked = "names of boundaries" if boundaries else "limits=False"
        raise DimensionError(f"limits_only=True checks joint limits and nothing else; leave {asked} out")
    return () if limits_only else select(robot, boundaries)


def covered(robot: Robot, chosen: Sequence[Boundary]) -> CoverageRecord:
    """Return what these boundaries watch of the robot."""
    if len(chosen) == len(robot.boundaries):
        return robot.coverage.record
    return robot.coverage.of(boundary.name for boundary in chosen).record


def settled(verdict: Verdict, chosen: Sequence[Boundary], limits_only: bool) -> Verdict:
    """Return the verdict, for which no boundary is nothing to check, unless a limit is passed or limits were all."""
    if chosen or limits_only or verdict is Verdict.VIOLATED:
        return verdict
    return Verdict.NOTHING_TO_CHECK
