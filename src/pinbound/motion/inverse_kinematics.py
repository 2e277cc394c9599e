"""Inverse kinematics of one point of a link: damped least squares within all joint limits, also of mimic joints.

With e = target - p(q) and J = dp/dq each step minimises

    |J dq - e|^2 + damping |dq|^2   subject to   c_k . dq = 0 for the active limits k,

and is shortened where it meets the next limit. The damping is proportional to the residual (Levenberg-Marquardt), so
the iteration converges quadratically near a reachable target, and steps stay small near singular configurations.
Boundaries are not checked: a path may leave the feasible region, and `pinbound.region.membership` says where.
`docs/inverse-kinematics.md` derives the step.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from numpy.typing import ArrayLike

from pinbound.checks import is_amount, random_numbers, three_numbers, whole_number
from pinbound.evaluate import numeric
from pinbound.exceptions import DimensionError, UnknownNameError
from pinbound.model.coupling import GuardedLimit, LinearLimit, as_configurations, real_array
from pinbound.path.chain import Chain
from pinbound.path.relative import absolute_chain
from pinbound.robot.home import nearest_within, ways_to_keep
from pinbound.robot.robot import Robot, check_robot
from pinbound.tolerances import LIMIT, REACHED
from pinbound.typing import Array, Flags, Ints
from pinbound.values import Value

__all__ = ["Ending", "InverseKinematics", "solve_ik"]

_CALM = 1e-13  # rad or m: steps below this no longer change anything


class Ending(Enum):
    """Why the iteration for one target ended."""

    REACHED = "reached"
    HELD_BY_LIMITS = "held back by joint limits"
    OUT_OF_REACH = "no nearer configuration in the neighbourhood"
    ITERATIONS = "out of iterations"
    NO_TARGET = "the target is not finite"


@dataclass(frozen=True, eq=False)
class InverseKinematics(Value):
    """Configurations found for a sequence of targets.

    Attributes:
        q: (N, n) the configurations [rad or m]; for a target that was not reached, the nearest one found.
        residuals: (N,) distance from the point to its target [m].
        reached: (N,) whether the residual is within the tolerance.
        iterations: (N,) steps taken.
        endings: Why each iteration ended.
        restarts: (N,) number of additional starts; if it is above 0, the path may have jumped to another branch.
        limits: For each target, the joints whose limits were active in the last step.

    Example:
        >>> import pinbound as pb
        >>> found = pb.solve_ik(pb.load("minervabot_v3"), "link_6", [[0.15, 0.05, 0.12]])
        >>> found.reached.tolist(), found.q.shape
        ([True], (1, 3))
    """

    q: Array
    residuals: Array
    reached: Flags
    iterations: Ints
    restarts: Ints
    endings: tuple[Ending, ...]
    limits: tuple[tuple[str, ...], ...]

    def text(self) -> str:
        """Return a report for people: one line if all targets are reached, else one line for each failure."""
        count = len(self.q)
        lines = [f"{int(self.reached.sum())} of {count} targets reached"]
        for i in np.flatnonzero(~self.reached):
            held = f" ({', '.join(self.limits[i])})" if self.limits[i] else ""
            lines.append(f"target {i}: {self.endings[i].value}{held}, {1e3 * self.residuals[i]:.6g} mm away")
        return "\n".join(lines)


def solve_ik(
    robot: Robot,
    link: str,
    targets: ArrayLike,
    start: ArrayLike | None = None,
    xyz: Sequence[float] = (0.0, 0.0, 0.0),
    max_iterations: int = 200,
    tolerance: float = REACHED,
    restarts: int = 12,
    seed: int = 0,
) -> InverseKinematics:
    """Find configurations that bring a point of a link to its targets; each search starts from the last solution.

    A local method can fail although the target is reachable. Then it starts again from `start` and from random
    configurations within the limits (for coordinates without limits, within half a turn or half a metre of `start`).

    Args:
        robot: The robot.
        link: The link of the point.
        targets: (3,) or (N, 3) positions in the root link's frame [m].
        start: (n,) the first configuration; home by default. It must be within the joint limits.
        xyz: (3,) the point in the link's frame [m].
        max_iterations: Largest number of iterations for each target.
        tolerance: [m] residual at which a target counts as reached.
        restarts: Largest number of additional starts for each target; 0 keeps a path on its branch.
        seed: Seed of the random starts.

    Returns:
        The result, with failures: an unreachable target raises no exception.

    Raises:
        UnknownNameError: If there is no such link.
        DimensionError: If targets or start have another shape, if the start is outside the limits or not finite, or if
            a number is not of its kind.
        UnsupportedError: If a floating or planar joint lies between the root and the link.

    Example:
        >>> import pinbound as pb
        >>> robot = pb.load("minervabot_v3")
        >>> found = solve_ik(robot, "link_6", [[0.15, 0.05, 0.12], [0.9, 0.0, 0.1]])
        >>> found.reached.tolist(), found.endings[1].name
        ([True, False], 'OUT_OF_REACH')
        >>> bool(np.linalg.norm(robot.positions("link_6", found.q[0]) - [0.15, 0.05, 0.12]) < 1e-10)
        True
    """
    check_robot(robot)
    if link not in robot.tree.links:
        raise UnknownNameError("link", link, robot.tree.links)
    goals = real_array(targets, "targets")
    if goals.ndim not in (1, 2) or goals.shape[-1] != 3:
        raise DimensionError(f"targets have shape {goals.shape}; give (3,) or (N, 3) positions [m]")
    whole_number(max_iterations, "max_iterations")
    whole_number(restarts, "restarts")
    if not is_amount(tolerance):
        raise DimensionError(f"the tolerance is {tolerance!r}; give metres, 0 or more")
    chain = absolute_chain(robot.tree, robot.coupling, link, three_numbers(xyz, "xyz"))
    solver = _Solver(chain, *_limit_rows(robot), max_iterations, tolerance)
    q = np.array(robot.home if start is None else as_configurations(start, robot.coordinates))
    inside = q.ndim == 1 and np.all(solver.A @ q <= solver.b + LIMIT) and _broken(robot, q) is None
    if not inside:
        said = f"the start {q.tolist()} is not one configuration within all joint limits"
        raise DimensionError(f"{said}; give one within the limits, or leave start out")
    starts = [q, *_random_starts(robot, q, max(restarts - 1, 0), seed)][:restarts]
    answers, tried = list[_Answer](), list[int]()
    for goal in goals.reshape(-1, 3):
        best, count = _solved(robot, solver, q, goal), 0
        for other in starts if np.all(np.isfinite(goal)) else ():
            if best.ending is Ending.REACHED:
                break
            count += 1
            best = min(best, _solved(robot, solver, other, goal), key=lambda one: one.residual)
        answers.append(best)
        tried.append(count)
        q = best.q if best.ending is Ending.REACHED else q
    return InverseKinematics(
        q=np.clip(np.array([one.q for one in answers]).reshape(-1, len(q)), robot.lower, robot.upper),  # of rounding
        residuals=np.array([one.residual for one in answers]),
        reached=np.array([one.ending is Ending.REACHED for one in answers], dtype=np.bool_),
        iterations=np.array([one.iterations for one in answers], dtype=np.int64),
        restarts=np.array(tried, dtype=np.int64),
        endings=tuple(one.ending for one in answers),
        limits=tuple(one.limits for one in answers),
    )


def _random_starts(robot: Robot, q: Array, count: int, seed: int) -> list[Array]:
    """Return configurations within all joint limits; fewer than `count` if limits of mimic joints reject many."""
    lower, upper = np.maximum(robot.lower, q - np.pi), np.minimum(robot.upper, q + np.pi)
    slides = np.array([not robot.turns(name) for name in robot.coordinates], dtype=np.bool_)
    lower[slides], upper[slides] = np.maximum(lower, q - 0.5)[slides], np.minimum(upper, q + 0.5)[slides]
    A, b, _ = _limit_rows(robot)
    drawn = random_numbers(seed).uniform(lower, upper, (20 * count, len(q)))
    return list(drawn[np.all(drawn @ A.T <= b, axis=1) & robot.intervals.hold(drawn)][:count])


def _broken(robot: Robot, q: Array) -> GuardedLimit | None:
    """Return the first end of a guarded rule that q violates; None if there is none."""
    return next((one for one in robot.guarded_limits if not one.holds_at(q.tolist())), None)


def _solved(robot: Robot, solver: _Solver, start: Array, goal: Array, more: tuple[LinearLimit, ...] = ()) -> _Answer:
    """Return the answer within all limits, also those of guarded rules.

    If an answer violates a guarded rule, each way to keep the rule becomes one more limit, and the search is repeated
    with this limit. The result is the answer with the smallest residual.
    """
    found = solver.solve(start, goal)
    broken = _broken(robot, found.q) if np.all(np.isfinite(goal)) else None
    if broken is None:
        return found
    residual = float(np.linalg.norm(goal - numeric.positions(solver.chain, start[None])[0]))
    answers = [_Answer(start, residual, found.iterations, Ending.HELD_BY_LIMITS, (broken.rule,))]
    for way in ways_to_keep(broken):
        limits, loose = (*robot.linear_limits, *more, way), np.ones(len(start), dtype=np.bool_)
        begin = nearest_within(limits, robot.guarded_limits, start, loose)
        if begin is not None:
            answers.append(_solved(robot, solver.within(way), begin, goal, (*more, way)))
    return min(answers, key=lambda one: one.residual)


def _limit_rows(robot: Robot) -> tuple[Array, Array, tuple[str, ...]]:
    """Return `A q <= b` for all joint limits, and the joint of each row."""
    return _rows(robot.linear_limits, len(robot.coordinates))


def _rows(limits: Sequence[LinearLimit], n: int) -> tuple[Array, Array, tuple[str, ...]]:
    rows, bounds, names = list[Array](), list[float](), list[str]()
    for limit in limits:
        for sign, end in ((1.0, limit.upper), (-1.0, limit.lower)):
            if np.isfinite(end) and np.any(limit.coefficients):
                rows.append(sign * limit.coefficients)
                bounds.append(sign * (end - limit.offset))
                names.append(limit.joint)
    return np.array(rows).reshape(-1, n), np.array(bounds), tuple(names)


@dataclass(frozen=True)
class _Answer:
    q: Array
    residual: float
    iterations: int
    ending: Ending
    limits: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Solver:
    """One chain with its limits `A q <= b`."""

    chain: Chain
    A: Array
    b: Array
    names: tuple[str, ...]
    max_iterations: int
    tolerance: float

    def within(self, limit: LinearLimit) -> _Solver:
        """Return the solver with one more limit."""
        A, b, names = _rows([limit], self.A.shape[1])
        return replace(self, A=np.vstack((self.A, A)), b=np.append(self.b, b), names=(*self.names, *names))

    def solve(self, start: Array, goal: Array) -> _Answer:
        if not np.all(np.isfinite(goal)):
            return _Answer(start, float("nan"), 0, Ending.NO_TARGET)
        q, error = start, goal - numeric.positions(self.chain, start[None])[0]
        damping, held = 1e-3, list[int]()
        for iteration in range(self.max_iterations):
            residual = float(np.linalg.norm(error))
            if residual <= self.tolerance:
                return _Answer(q, residual, iteration, Ending.REACHED)
            J = numeric.derivative(self.chain, q[None])[0]
            step, held = self._step(q, J, error, damping * residual**2 + 1e-30)
            if float(np.max(np.abs(step), initial=0.0)) <= _CALM:
                return self._stopped(q, residual, iteration, held)
            ahead = q + step
            error_ahead = goal - numeric.positions(self.chain, ahead[None])[0]
            if float(np.linalg.norm(error_ahead)) < residual:
                q, error, damping = ahead, error_ahead, max(damping / 4.0, 1e-6)
            else:
                damping *= 8.0
                if damping > 1e18:
                    return self._stopped(q, residual, iteration, held)
        residual = float(np.linalg.norm(error))
        ending = Ending.REACHED if residual <= self.tolerance else Ending.ITERATIONS
        return _Answer(q, residual, self.max_iterations, ending, self._held_names(held))

    def _stopped(self, q: Array, residual: float, iteration: int, held: list[int]) -> _Answer:
        ending = Ending.HELD_BY_LIMITS if held else Ending.OUT_OF_REACH
        return _Answer(q, residual, iteration, ending, self._held_names(held))

    def _held_names(self, held: list[int]) -> tuple[str, ...]:
        return tuple(dict.fromkeys(self.names[k] for k in held))

    def _step(self, q: Array, J: Array, error: Array, damping: float) -> tuple[Array, list[int]]:
        """Return the damped step along the active limits, shortened where it meets the next limit; and these limits."""
        slack = self.b - self.A @ q
        held = list[int]()
        while True:
            free = _null_space(self.A[held])
            stacked = np.vstack((J @ free, np.sqrt(damping) * np.eye(free.shape[1])))
            wanted = np.concatenate((error, np.zeros(free.shape[1])))
            step = free @ np.linalg.lstsq(stacked, wanted, rcond=None)[0]  # least norm: columns may be zero
            rate = self.A @ step
            rate[held] = 0.0
            broken = [k for k in np.flatnonzero((slack <= LIMIT) & (rate > 1e-15)) if k not in held]
            if not broken:
                break
            held.append(int(max(broken, key=lambda k: rate[k])))
        growing = rate > 0.0
        room = np.min(slack[growing] / rate[growing], initial=1.0)
        return max(float(room), 0.0) * step, held


def _null_space(A: Array) -> Array:
    """Return an orthonormal basis (n, n - rank) of the null space of A: directions that change no row."""
    n = A.shape[1]
    if not len(A):
        return np.eye(n)
    _, sizes, vectors = np.linalg.svd(A, full_matrices=True)
    rank = int(np.sum(sizes > 1e-12 * sizes[0]))
    return vectors[rank:].T
