"""Eqs. (5)-(17) evaluated as printed, and compared with the norms that are derived from the URDF."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from pinbound.boundaries.boundary import Boundary
from pinbound.path.kind import Kind
from pinbound.reproduce.findings import Equation
from pinbound.reproduce.printed import BOUNDARIES
from pinbound.reproduce.study import SEED, Study
from pinbound.robot.robot import Robot
from pinbound.tolerances import SOLVES
from pinbound.typing import Array

__all__ = ["check_equations", "frame", "relative_frame"]

Frame = tuple[Array, Array]

_COUNT = 2000


def check_equations(study: Study, kinds: Robot) -> tuple[Equation, ...]:
    """Return one row for each equation.

    Args:
        study: The paper's robot.
        kinds: The arm of `four_kinds`, because MinervaBotV3 has no boundary for Eqs. (8), (9), (12)-(14).
    """
    robots = (study.robot, kinds)
    by_kind = {kind: [(r, b) for r in robots for b in r.boundaries if b.kind is kind] for kind in Kind}
    everything = [pair for pairs in by_kind.values() for pair in pairs]
    rows = (
        ("(5)-(7)", "both points from the base, whatever lies between", everything, _from_base),
        ("(8), (9)", "non-consecutive links of one chain", by_kind[Kind.NON_CONSECUTIVE], _consecutive),
        ("(10), (11)", "consecutive links", by_kind[Kind.CONSECUTIVE], _consecutive),
        ("(12)-(14)", "branches of one link", by_kind[Kind.BRANCHED], _branched),
        ("(15), (16)", "branches that begin at one place", by_kind[Kind.COINCIDENT_BRANCHED], _coincident),
    )
    return (*(_row(*row) for row in rows), *_equation_17(study))


def _row(
    number: str, says: str, pairs: Sequence[tuple[Robot, Boundary]], formula: Callable[[Robot, Boundary, Array], Array]
) -> Equation:
    worst = 0.0
    for robot, boundary in pairs:
        Q = np.random.default_rng(SEED).uniform(-2 * np.pi, 2 * np.pi, (_COUNT, len(robot.coordinates)))
        printed = np.linalg.norm(formula(robot, boundary, Q), axis=1)
        worst = max(worst, float(np.max(np.abs(printed - boundary.norm(Q)))))
    names = ", ".join(f"{boundary.name}" for _, boundary in pairs)
    return Equation(number, says, names, worst, bool(pairs) and worst <= SOLVES)


def _equation_17(study: Study) -> tuple[Equation, ...]:
    """Compare the twenty components of Eq. (17) in two rows: the four of beta_5 and beta_6 have their own row."""
    Q = np.random.default_rng(SEED).uniform(-2 * np.pi, 2 * np.pi, (_COUNT, len(study.robot.coordinates)))
    q2, q3 = (Q[:, study.robot.coordinates.index(name)] for name in ("q2", "q3"))
    rows = list[Equation]()
    for label, numbers in (("all but beta_5, beta_6", {1, 2, 3, 4, 7, 8, 9, 10}), ("beta_5, beta_6", {5, 6})):
        worst = 0.0
        for printed in (one for one in BOUNDARIES if one.number in numbers):
            components = 1e-3 * np.column_stack(printed.components(study.constants, q2, q3))
            derived = study.robot.boundaries[printed.name].vector(Q)
            worst = max(worst, float(np.max(np.abs(components - derived[:, [0, 2]]))))
        rows.append(Equation("(17)", f"components of {label}", label, worst, worst <= SOLVES))
    return tuple(rows)


def frame(robot: Robot, link: str, Q: Array) -> Frame:
    """Return r_0,link (N, 3) and R_0,link (N, 3, 3)."""
    origin = robot.positions(link, Q)
    unit = np.eye(3)
    axes = [robot.positions(link, Q, tuple(unit[i].tolist())) - origin for i in range(3)]
    return origin, np.stack(axes, axis=2)


def relative_frame(robot: Robot, above: str, link: str, Q: Array) -> Frame:
    """Return r_above,link and R_above,link."""
    (r0, R0), (r1, R1) = frame(robot, above, Q), frame(robot, link, Q)
    return np.einsum("nji,nj->ni", R0, r1 - r0), np.einsum("nji,njk->nik", R0, R1)


def _from_base(robot: Robot, boundary: Boundary, Q: Array) -> Array:
    """Evaluate Eqs. (5)-(7): `r_0,n - r_0,m`."""
    a, b = boundary.point_a, boundary.point_b
    return robot.positions(a.link, Q, a.shape.origin.tolist()) - robot.positions(b.link, Q, b.shape.origin.tolist())


def _consecutive(robot: Robot, boundary: Boundary, Q: Array) -> Array:
    """Evaluate Eqs. (8)-(11): `r_a,n - r_a,b - R_a,b r_b,m`; in (8), (9) r_a,b leads over the frames between."""
    upper, lower = boundary.point_a, boundary.point_b
    if boundary.ancestor != upper.link:
        upper, lower = lower, upper
    r, R = relative_frame(robot, upper.link, lower.link, Q)
    return upper.shape.origin - r - np.einsum("nij,j->ni", R, lower.shape.origin)


def _branched(robot: Robot, boundary: Boundary, Q: Array) -> Array:
    """Evaluate Eqs. (12)-(14): `r_c,a + R_c,a r_a,n - r_c,b - R_c,b r_b,m`; c is the link at the bifurcation."""
    ends = list[Array]()
    for point in (boundary.point_a, boundary.point_b):
        r, R = relative_frame(robot, boundary.ancestor, point.link, Q)
        ends.append(r + np.einsum("nij,j->ni", R, point.shape.origin))
    return ends[0] - ends[1]


def _coincident(robot: Robot, boundary: Boundary, Q: Array) -> Array:
    """Evaluate Eqs. (15), (16): `R_c,a r_a,n - R_c,b r_b,m`; the two offsets are equal and cancel."""
    ends = list[Array]()
    for point in (boundary.point_a, boundary.point_b):
        _, R = relative_frame(robot, boundary.ancestor, point.link, Q)
        ends.append(np.einsum("nij,j->ni", R, point.shape.origin))
    return ends[0] - ends[1]
