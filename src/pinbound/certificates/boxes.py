"""certify_box(), certified_box(): whole boxes of configurations proved clear."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pinbound.boundary import Boundary, one_configuration
from pinbound.certificates.constraints import families
from pinbound.certificates.enclosures import Family
from pinbound.certificates.records import BoxCertificate, Budget, OpenBox, Reason, Verdict
from pinbound.certificates.scope import covered, scope, settled
from pinbound.certificates.search import Meter
from pinbound.exceptions import DimensionError
from pinbound.robot import Robot

__all__ = ["certified_box", "certify_box"]

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_BATCH = 2**13
_NARROWEST = 2.0**-40
_GROWTH = Budget(boxes=4_000, seconds=1.0)
_STEPS = 12


@dataclass
class _State:
    """What is known of a box so far."""

    lower: float = np.inf
    upper: float = np.inf
    witness: Array | None = None
    violated: str | None = None
    open_boxes: list[OpenBox] = field(default_factory=list[OpenBox])


def certify_box(
    robot: Robot,
    lower: ArrayLike,
    upper: ArrayLike,
    boundaries: Sequence[str] | None = None,
    budget: Budget | None = None,
    *,
    limits: bool = True,
    limits_only: bool = False,
) -> BoxCertificate:
    """Prove that every configuration of a box is clear and within limits, or find one that is not.

    Boundaries of one effective angle, and limits, are exact over a box. The others are bounded by lever arms and
    halved where that does not suffice; the work grows quickly with the number of coordinates and the closeness of
    contact, so mind the budget.

    Args:
        robot: The robot.
        lower: (n,) lower corner [rad or m].
        upper: (n,) upper corner.
        boundaries: Names of the boundaries to check; None: all.
        budget: How much work is allowed; None: `Budget()`.
        limits: Whether joint limits are checked too.
        limits_only: Check joint limits and nothing else. Without it, no boundary at all is NOTHING_TO_CHECK.

    Returns:
        The certificate.

    Raises:
        DimensionError: If a corner is not one finite configuration, the corners are not in order, or `limits_only` is
            asked for together with boundaries or without limits.
        UnknownNameError: If the robot has no boundary of that name.

    Example:
        >>> import pinbound as pb
        >>> robot = pb.load("minervabot_v3")
        >>> pb.certify_box(robot, [-1.0, 0.1, 0.0], [1.0, 0.6, 0.3]).verdict
        <Verdict.CERTIFIED: 'certified'>
        >>> pb.certify_box(robot, [-1.0, 0.1, 0.0], [1.0, 0.6, 1.1]).violated
        'beta_4'
    """
    low, high = one_configuration(lower, robot.coordinates), one_configuration(upper, robot.coordinates)
    if np.any(low > high):
        index = int(np.flatnonzero(low > high)[0])
        raise DimensionError(f"the box's lower corner is above its upper one in {robot.coordinates[index]!r}")
    chosen = scope(robot, boundaries, limits, limits_only)
    coverage = covered(robot, chosen)
    meter, state = Meter(budget or Budget()), _State()
    limit_family, *others = families(robot, chosen, low, high)
    for family in ([limit_family] if limits else []) + others:
        if len(family.names) and state.witness is None:
            _search(family, low, high, meter, state, is_limit=family is limit_family)
    verdict = Verdict.UNDECIDED if state.open_boxes else Verdict.CERTIFIED
    if state.witness is not None:
        verdict = Verdict.VIOLATED
    return BoxCertificate(
        verdict=settled(verdict, chosen, limits_only),
        coverage=coverage,
        lower_corner=low,
        upper_corner=high,
        lower=-np.inf if state.witness is not None else state.lower,
        upper=state.upper,
        witness=state.witness,
        violated=state.violated,
        open_boxes=tuple(state.open_boxes),
        boxes=meter.boxes,
        seconds=meter.seconds,
    )


def _search(family: Family, low: Array, high: Array, meter: Meter, state: _State, is_limit: bool) -> None:
    """Halve boxes, last ones first, until all are clear, one is violated, or the budget is spent."""
    m = len(family.names)
    weights = family.weights
    root = 0.5 * (high - low)
    stack = [(np.arange(m), np.tile(0.5 * (low + high), (m, 1)), np.tile(root, (m, 1)))]
    while stack:
        which, centre, half = stack.pop()
        reason = meter.spent()
        if reason:
            state.lower = state.lower if is_limit else -np.inf
            for w, c, h in [(w, c, h) for one in [(which, centre, half), *stack] for w, c, h in zip(*one, strict=True)]:
                state.open_boxes.append(OpenBox(family.names[int(w)], c - h, c + h, -np.inf, reason))
            return
        if len(which) > _BATCH:
            stack.append((which[_BATCH:], centre[_BATCH:], half[_BATCH:]))
            which, centre, half = which[:_BATCH], centre[:_BATCH], half[:_BATCH]
        meter.boxes += len(which)
        found = family.enclose_box(which, centre, half)
        if not is_limit:
            state.upper = min(state.upper, float((found.value + found.error).min()))
        if np.any(found.violated):
            row = int(np.argmin(np.where(found.violated, found.value, np.inf)))
            state.witness, state.violated = centre[row].copy(), family.names[int(which[row])]
            return
        reach = weights[which] * half
        stuck = found.settled | (half <= _NARROWEST * root).all(axis=1)
        closed, left = found.clear | stuck, stuck & ~found.clear
        if not is_limit and np.any(closed):
            state.lower = min(state.lower, float(found.lower[closed].min()))
        for row in np.flatnonzero(left):
            c, h = centre[row], half[row]
            one = OpenBox(family.names[int(which[row])], c - h, c + h, float(found.lower[row]), Reason.ROUNDING)
            state.open_boxes.append(one)
        if not np.all(closed):
            keep = ~closed
            stack.append(_halved(which[keep], centre[keep], half[keep], reach[keep]))


def _halved(which: Indices, centre: Array, half: Array, reach: Array) -> tuple[Indices, Array, Array]:
    """Halve each box across the coordinate that moves the points most."""
    rows, across = np.arange(len(which)), np.argmax(reach, axis=1)
    smaller = half.copy()
    smaller[rows, across] *= 0.5
    step = half - smaller
    centres, halves = np.concatenate([centre - step, centre + step]), np.concatenate([smaller, smaller])
    return np.concatenate([which, which]), centres, halves


def certified_box(
    robot: Robot,
    q: ArrayLike,
    boundaries: Sequence[str] | None = None,
    reach: float = np.pi,
    budget: Budget = _GROWTH,
    *,
    limits: bool = True,
    limits_only: bool = False,
) -> BoxCertificate:
    """Return a box around q that is certified, and that cannot grow much on any face.

    The box grows around q alike in all coordinates that something depends on, by bisection, then face by face in
    turn. Afterwards no face can move by 1/1000 of `reach` further within the budget of one certificate; it is maximal
    in this sense, not the largest of all boxes. Coordinates that nothing depends on keep q's value.

    Args:
        robot: The robot.
        q: (n,) the configuration inside.
        boundaries: Names of the boundaries; None: all.
        reach: How far a face may be from q [rad or m].
        budget: Of each of the certificates that are tried (some 10 (2 n + 1)).
        limits: Whether joint limits count too.
        limits_only: Joint limits count and nothing else.

    Returns:
        The certificate of the box; if q itself is not certified, the certificate of q alone.

    Raises:
        DimensionError: If q is not one finite configuration, or `limits_only` is asked for together with boundaries or
            without limits.
        UnknownNameError: If the robot has no boundary of that name.

    Example:
        >>> import pinbound as pb
        >>> robot = pb.load("minervabot_v3")
        >>> box = pb.certified_box(robot, [0.0, 0.6, 0.45])
        >>> box.verdict.value, bool(np.all(box.upper_corner[1:] - box.lower_corner[1:] > 0.5))
        ('certified', True)
    """
    start = one_configuration(q, robot.coordinates)
    chosen = scope(robot, boundaries, limits, limits_only)
    moving = _moving(robot, chosen, limits)

    def ask(low: Array, high: Array) -> BoxCertificate:
        names = [boundary.name for boundary in chosen]
        corners = start - low * reach, start + high * reach
        return certify_box(robot, *corners, names, budget, limits=limits, limits_only=limits_only)

    best = ask(0.0 * moving, 0.0 * moving)
    if best.verdict is not Verdict.CERTIFIED:
        return best
    low, high = 0.0 * moving, 0.0 * moving
    faces = [(low, moving.copy(), high, moving.copy())]
    for index in np.flatnonzero(moving):
        one = np.eye(len(start))[index]
        faces += [(low, 0.0 * one, high, one), (low, one, high, 0.0 * one)]
    for _, grow_low, _, grow_high in faces:
        inside, outside = 0.0, 1.0
        for step in range(_STEPS):
            trial = 1.0 if step == 0 else 0.5 * (inside + outside)
            new = np.maximum(low, trial * grow_low), np.maximum(high, trial * grow_high)
            if np.array_equal(new[0], low) and np.array_equal(new[1], high):
                inside = trial
                continue
            found = ask(*new)
            if found.verdict is Verdict.CERTIFIED:
                inside, (low, high), best = trial, new, found
                if step == 0:
                    break
            else:
                outside = trial
    return best


def _moving(robot: Robot, chosen: Sequence[Boundary], limits: bool) -> Array:
    """Return 1 for coordinates that something depends on, else 0."""
    used = {name for boundary in chosen for name in boundary.coordinates}
    bound = np.zeros(len(robot.coordinates), dtype=np.bool_)
    if limits:
        for limit in robot.linear_limits:
            bound |= limit.coefficients != 0.0
    return (np.array([name in used for name in robot.coordinates], dtype=np.bool_) | bound).astype(np.float64)
