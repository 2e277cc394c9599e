"""certify(): proves that a whole motion is free, or finds where it is not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pinbound.certificates.constraints import families, unplaced
from pinbound.certificates.degrees import look_like_degrees, look_wrapped
from pinbound.certificates.kept import Tables, tables_of
from pinbound.certificates.lifted import LiftedTrajectory, closed_only, lowered
from pinbound.certificates.records import Budget, Certificate, Findings, OpenPart, Verdict
from pinbound.certificates.scope import ONLY_LIMITS, covered, scope, settled
from pinbound.certificates.search import Meter, Search
from pinbound.certificates.sides import far_sides
from pinbound.certificates.trajectory import Trajectory, as_trajectory
from pinbound.exceptions import DimensionError
from pinbound.robot.loop_robot import LoopRobot
from pinbound.robot.robot import Robot
from pinbound.tolerances import PRECISION
from pinbound.typing import Array

__all__ = ["certify"]

_NOT_PLACED = (
    "the sides of a closed loop differ, so the places of its links are proven within the joint limits only; this "
    "motion leaves the joint limits, so nothing is proven of the boundaries of these links"
)


def certify(
    robot: Robot,
    waypoints: Any,
    times: ArrayLike | None = None,
    boundaries: Sequence[str] | None = None,
    budget: Budget | None = None,
    *,
    limits: bool = True,
    limits_only: bool = False,
    each: bool = False,
    precision: float = PRECISION,
) -> Certificate:
    """Prove that a motion stays free at every moment, or find where it does not.

    For every real t it checks that the signed clearance of every boundary is positive, and that every joint limit is
    kept, also limits of mimic joints. Nothing is sampled: each part of the motion is either proven by lever-arm bounds,
    with rounding included, or halved. Angles are not wrapped.

    Args:
        robot: The robot.
        waypoints: (N, n), straight in q between them; or a SciPy PPoly, CubicSpline, BPoly or BSpline with values (n,);
            or a `BoundedMotion`.
        times: (N,) increasing times of waypoints; None: 0, 1, ..., N - 1.
        boundaries: Names of the boundaries to check; None: all.
        budget: The work allowed; None: `Budget()`.
        limits: Whether to check joint limits, too.
        limits_only: Whether to check joint limits only. Otherwise, a robot without boundaries gives NOTHING_TO_CHECK.
        each: Whether to compute tight bounds of the smallest clearance of every boundary. Otherwise only the smallest
            of all boundaries has tight bounds; the bounds of the others are true, but may be wide.
        precision: Largest difference of the two bounds of the smallest clearance [m], if the budget suffices.

    Returns:
        The certificate: CERTIFIED, VIOLATED with first contact and witness, UNDECIDED with the open parts, or
        NOTHING_TO_CHECK. Its `coverage` says which pairs of links the boundaries watch, and which are open.

    Raises:
        DimensionError: If shapes do not fit, a number is not finite, times do not increase, a spline jumps at a
            breakpoint, the values of a `BoundedMotion` contradict its bounds, or `limits_only` is given together with
            boundaries or without limits.
        UnknownNameError: If the robot has no boundary of that name.
        UnsupportedError: If the type of the motion does not define the values between two times.

    References:
        `docs/certificates.md`.

    Example:
        >>> import pinbound as pb
        >>> robot = pb.load("minervabot_v3")
        >>> pb.certify(robot, np.radians([[0, 0, 0], [90, 30, 40]])).verdict
        <Verdict.CERTIFIED: 'certified'>
        >>> found = pb.certify(robot, np.radians([[0, 0, 0], [90, 0, 60]]))
        >>> found.verdict, found.violations[0].name, round(found.first_contact.after, 6)
        (<Verdict.VIOLATED: 'violated'>, 'beta_4', 0.540485)
    """
    if not precision >= 0.0:
        raise DimensionError(f"the precision is {precision}; give a length in metres, zero or more")
    if isinstance(robot, LoopRobot):
        motion = LiftedTrajectory.of(robot, as_trajectory(waypoints, robot.coordinates, times))
        names = [one.name for one in scope(robot, boundaries, limits, limits_only)]
        opened = robot.opened if limits else closed_only(robot)  # its loops must close in any case
        found = certify(opened, motion, None, names, budget, limits_only=limits_only, each=each, precision=precision)
        return lowered(found, robot)
    chosen = scope(robot, boundaries, limits, limits_only)
    coverage = covered(robot, chosen)
    meter = Meter(budget or Budget())
    is_ready = isinstance(waypoints, LiftedTrajectory)
    trajectory = waypoints if is_ready else as_trajectory(waypoints, robot.coordinates, times)
    tables = tables_of(robot, chosen)
    limit_family, *boundary_families = tables.families(*trajectory.extent, trajectory.degree)
    open_parts: list[OpenPart] = []
    bounds = Findings.none(len(robot.coordinates))
    placed = True
    if limits or tables.is_loose:
        search = Search(limit_family, trajectory, meter, None)
        search.run(each)
        kept, left = search.results()
        placed = not tables.is_loose or kept.verdict is Verdict.CERTIFIED
        if limits:
            bounds, open_parts = kept, left
    if not placed:
        _, *boundary_families = families(robot, unplaced(chosen), *trajectory.extent, trajectory.degree)
    best, found = np.inf, [Findings.none(len(robot.coordinates))] * len(boundary_families)
    for place in (1, 0, 2):  # many angles first: machine code finds a bound, and the others need not be tighter
        if not boundary_families[place].names:
            continue
        search = Search(boundary_families[place], trajectory, meter, precision, best)
        search.run(each)
        findings, left = search.results()
        if not placed:
            findings = _unbounded(robot, findings)
        best = min(best, float(findings.upper.min(initial=np.inf)))
        open_parts += left
        found[place] = findings
    ordered = Findings.joined(found, tables.names, tables.order)
    start, end = float(trajectory.starts[0]), float(trajectory.starts[-1] + trajectory.durations[-1])
    first_q = trajectory.at(np.zeros(1, dtype=np.intp), np.zeros(1))[0]
    return Certificate(
        verdict=settled(_verdict(ordered, bounds), chosen, limits_only),
        coverage=coverage,
        start=start,
        end=end,
        boundaries=ordered,
        limits=bounds,
        open_parts=tuple(sorted(open_parts, key=lambda part: (part.start, part.name))),
        notes=(
            *trajectory.notes,
            *_notes(tables, ordered, first_q),
            *([] if placed else [_NOT_PLACED]),
            *_degrees(robot, trajectory, bounds),
            *((ONLY_LIMITS,) if limits_only else ()),
        ),
        boxes=meter.boxes,
        seconds=meter.seconds,
    )


def _unbounded(robot: Robot, found: Findings) -> Findings:
    """Return findings without bounds for times at which the positions of the links are not bounded."""
    anywhere = np.array([robot.boundaries[name].place_error != 0.0 for name in found.names], dtype=np.bool_)
    lower, upper = np.where(anywhere, -np.inf, found.lower), np.where(anywhere, np.inf, found.upper)
    return replace(found, lower=lower, upper=upper)


def _verdict(*findings: Findings) -> Verdict:
    verdicts = {one.verdict for one in findings}
    return next((v for v in (Verdict.VIOLATED, Verdict.UNDECIDED) if v in verdicts), Verdict.CERTIFIED)


def _notes(tables: Tables, found: Findings, first_q: Array) -> tuple[str, ...]:
    beyond = tables.beyond(first_q)
    if tables.turning_bodies:
        beyond |= set(far_sides(tables, set(found.named(Verdict.CERTIFIED)), first_q))
    names = [found.names[row] for row in _rows_of(found, beyond)] if beyond else []
    if not names:
        return ()
    return (
        f"free of contact, but on the other side of contact from home, so not reachable from home: {', '.join(names)}; "
        "check that the motion has the robot's signs and zero positions",
    )


def _rows_of(found: Findings, names: set[str]) -> list[int]:
    """Return the indices of the names that are certified."""
    return [row for row in np.flatnonzero(found.codes == 0).tolist() if found.names[row] in names]


def _degrees(robot: Robot, trajectory: Trajectory, limits: Findings) -> tuple[str, ...]:
    """Return notes if a limit is violated by numbers that look like degrees, or if a step looks like wrapped angles."""
    if not limits.contacts and trajectory.degree != 1:
        return ()
    pieces = np.arange(len(trajectory.starts))
    starts, ends = (trajectory.at(pieces, np.full(len(pieces), u)) for u in (0.0, 1.0))
    wrapped = look_wrapped(robot, starts, ends) if trajectory.degree == 1 else ()
    return (*(look_like_degrees(robot, np.concatenate([starts, ends])) if limits.contacts else ()), *wrapped)
