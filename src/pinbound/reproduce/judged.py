"""The sixteen printed limits of Eqs. (18)-(20); each is checked by putting it into its own component equation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pinbound.boundaries.boundary import Boundary
from pinbound.reproduce.printed import BOUNDARIES, LIMITS, Constants, PrintedLimit
from pinbound.robot.robot import Robot
from pinbound.tolerances import SOLVES
from pinbound.typing import Array

__all__ = ["JudgedLimit", "derived_limit", "judge_limits"]

_TURN = 2.0 * np.pi
_OTHERS = np.linspace(-np.pi, np.pi, 361)


@dataclass(frozen=True)
class JudgedLimit:
    """One printed limit, compared with the derived limit.

    Attributes:
        limit: The printed limit.
        values: The two printed angles [rad] (plus, minus) at `other`, with tan^-1 read as atan2.
        other: Angle of the other joint [rad] at which values are given.
        residual: Largest |component| [m] over all angles of the other joint and both signs, with atan2.
        residual_one_argument: The same residual, with tan^-1 read as the arctangent of the quotient.
        derived: The contact angle of this joint at `other` [rad], from the URDF.
        branch: ``"+"`` or ``"-"``: the sign whose value is nearest to the contact.
        difference: This value minus the derived one, without whole turns [rad].
        mended: The offset, divided by pi, with which the line solves its equation: the printed one if it does; None if
            no offset does.
    """

    limit: PrintedLimit
    values: tuple[float, float]
    other: float
    residual: float
    residual_one_argument: float
    derived: float
    branch: str
    difference: float
    mended: int | None

    @property
    def solves(self) -> bool:
        """Whether the line, read with atan2, solves its component equation."""
        return self.residual <= SOLVES

    @property
    def solves_with_one_argument(self) -> bool:
        """Whether the line, read with the arctangent of the quotient, solves its component equation."""
        return self.residual_one_argument <= SOLVES


def derived_limit(boundary: Boundary, joint: str, other: float) -> float:
    """Return the value of `joint` [rad] at which a boundary of one effective angle is in contact.

    The effective angle depends on q2 and q3 only: `phi = c_j q_j + c_o q_o`, so `q_j = (phi* - c_o q_o) / c_j`.
    """
    contact = boundary.contact
    if contact is None:
        return float("nan")
    names = boundary.robot_coordinates
    partner = "q3" if joint == "q2" else "q2"
    own, rest = (float(contact.coefficients[names.index(name)]) for name in (joint, partner))
    return (contact.angle - rest * other) / own


def judge_limits(robot: Robot, k: Constants, other: float) -> tuple[JudgedLimit, ...]:
    """Check all sixteen lines.

    Args:
        robot: The paper's robot.
        k: The lengths [mm], including r_1,27.
        other: Angle of the other joint [rad] at which values are given.
    """
    return tuple(_judge(robot, k, limit, other) for limit in LIMITS)


def _judge(robot: Robot, k: Constants, limit: PrintedLimit, other: float) -> JudgedLimit:
    at = np.array([other])
    plus, minus = (float(limit.value(k, at, sign, True)[0]) for sign in (1.0, -1.0))
    derived = derived_limit(robot.boundaries[f"beta_{limit.boundary}"], limit.joint, other)
    differences = [float(np.remainder(value - derived + np.pi, _TURN) - np.pi) for value in (plus, minus)]
    nearest = int(np.nanargmin(np.abs(differences))) if np.any(np.isfinite(differences)) else 0
    residual = _residual(k, limit, True, limit.half_turns)
    others = (limit.half_turns, 0, 1, 2, 3)
    mended = next((turns for turns in others if _residual(k, limit, True, turns) <= SOLVES), None)
    return JudgedLimit(
        limit=limit,
        values=(plus, minus),
        other=other,
        residual=residual,
        residual_one_argument=_residual(k, limit, False, limit.half_turns),
        derived=derived,
        branch="+-"[nearest],
        difference=differences[nearest],
        mended=mended,
    )


def _residual(k: Constants, limit: PrintedLimit, two_arguments: bool, half_turns: int) -> float:
    """Return the largest |component| [m] at the printed angles, over a grid of the other joint's angle."""
    printed = next(one for one in BOUNDARIES if one.number == limit.boundary)
    worst = list[Array]()
    for sign in (1.0, -1.0):
        value = limit.value(k, _OTHERS, sign, two_arguments, half_turns)
        q2, q3 = (value, _OTHERS) if limit.joint == "q2" else (_OTHERS, value)
        components = printed.components(k, q2, q3)
        worst.append(np.abs(components[0 if limit.component == 1 else 1]))
    residuals = np.concatenate(worst)
    return 1e-3 * float(np.nanmax(residuals)) if np.any(np.isfinite(residuals)) else float("inf")
