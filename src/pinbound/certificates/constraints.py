"""The constraints of a certificate, with enclosures: limits, and boundaries of one angle, of several, of bodies.

There are four families of constraints. Each computes, over a part of a motion or over a box, the clearance in the
middle and a lower bound of the clearance that includes rounding. `docs/certificates.md` and `docs/segments.md` give the
arguments.

The certified *signed clearance* is that of the contact rule (`pinbound.contact`), which home, `free`, limits and
regions use, too: the separation minus the contact distance; for stops, the sine of half the depth in home's gap.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from numpy.typing import ArrayLike

from pinbound.boundaries.boundary import Boundary
from pinbound.certificates.distances import ManyAngleBoundaries
from pinbound.certificates.guarded import GuardedLimits
from pinbound.certificates.kept import tables_of
from pinbound.certificates.limits import Limits
from pinbound.certificates.one_angle import OneAngleBoundaries
from pinbound.certificates.swept import SweptBoundaries
from pinbound.checks import names_of
from pinbound.exceptions import UnknownNameError
from pinbound.robot.robot import Robot
from pinbound.typing import Array

__all__ = ["families", "needs_limits", "select", "signed_clearances", "unplaced"]

_ANYWHERE = 1e9  # metres: larger than any path, and still finite


def select(robot: Robot, boundaries: Sequence[str] | None) -> tuple[Boundary, ...]:
    """Return the boundaries with these names, in the robot's order; None: all.

    Raises:
        UnknownNameError: If the robot has no boundary of that name.
    """
    if boundaries is None:
        return tuple(robot.boundaries[:])  # always the same tuple, which `kept` finds again
    wanted = names_of(boundaries, "boundaries")
    known = robot.boundaries.names
    for name in sorted(set(wanted).difference(known), key=wanted.index):
        raise UnknownNameError("boundary", name, known)
    asked = set(wanted)
    return tuple(boundary for boundary in robot.boundaries if boundary.name in asked)


def needs_limits(boundaries: Sequence[Boundary]) -> bool:
    """Return whether the bounds hold only within the joint limits, because the sides of a loop on the path differ."""
    return any(boundary.place_error for boundary in boundaries)


def unplaced(boundaries: Sequence[Boundary]) -> list[Boundary]:
    """Return boundaries whose links may be anywhere if sides of a loop differ: so they are outside the joint limits."""
    return [replace(one, place_error=_ANYWHERE) if one.place_error else one for one in boundaries]


def families(
    robot: Robot, boundaries: Sequence[Boundary], lower: Array, upper: Array, degree: int = 1
) -> tuple[Limits | GuardedLimits, OneAngleBoundaries, ManyAngleBoundaries, SweptBoundaries]:
    """Return all constraints of a robot, with rounding bounds that hold while q stays in a box.

    Args:
        robot: The robot.
        boundaries: The boundaries to check.
        lower: (n,) lower corner.
        upper: (n,) upper corner.
        degree: Polynomial degree of the pieces of the motion.
    """
    return tables_of(robot, boundaries).families(lower, upper, degree)


def signed_clearances(robot: Robot, Q: ArrayLike, boundaries: Sequence[str] | None = None) -> Array:
    """Return `robot.boundaries.signed_clearances(Q)` of all or some boundaries: the quantity that certificates bound.

    Args:
        robot: The robot.
        Q: One q (n,) or many (N, n).
        boundaries: Names of boundaries, None: all.

    Returns:
        (m,) or (N, m) [m]: positive is free.

    Raises:
        UnknownNameError: If the robot has no boundary of that name.
        DimensionError: If the last axis of Q is not n long.

    Example:
        >>> import numpy as np
        >>> import pinbound as pb
        >>> robot = pb.load("minervabot_v3")
        >>> Q = np.radians([[0.0, 0.0, 0.0], [0.0, 0.0, 60.0]])
        >>> [bool(x) for x in pb.signed_clearances(robot, Q, ["beta_4"])[:, 0] > 0.0]
        [True, False]
    """
    names = [boundary.name for boundary in select(robot, boundaries)]
    columns = [robot.boundaries.names.index(name) for name in names]
    return robot.boundaries.signed_clearances(Q)[..., columns]
