"""certify_box(), certified_box(): boxes of configurations that are proven free."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pinbound.boundaries.boundary import Boundary, one_configuration
from pinbound.boundaries.looped import over_z
from pinbound.bounds.group_boxes import is_worth, search_box
from pinbound.certificates.box_records import BoxCertificate, OpenBoxes
from pinbound.certificates.constraints import families, needs_limits, unplaced
from pinbound.certificates.degrees import look_like_degrees
from pinbound.certificates.distances import ManyAngleBoundaries
from pinbound.certificates.enclosures import Family
from pinbound.certificates.lifted import LiftedFamily, closed_only, loop_errors
from pinbound.certificates.records import Budget, Reason, Verdict
from pinbound.certificates.scope import covered, scope, settled
from pinbound.certificates.search import Meter
from pinbound.certificates.swept import SweptBoundaries
from pinbound.certificates.trajectory import refuse_far
from pinbound.exceptions import DimensionError
from pinbound.robot.loop_robot import LoopRobot
from pinbound.robot.robot import Robot, check_robot
from pinbound.tolerances import FARTHEST
from pinbound.typing import Array, Flags, Indices

__all__ = ["certified_box", "certify_box"]

_BATCH = 2**13
_NARROWEST = 2.0**-40
_A_SECOND = 1e6  # a low estimate of the boxes that machine code bounds in a second
_GUESS = 20  # boxes for each pair: a first estimate of the work for a box
_GROWTH = Budget(boxes=400_000, seconds=30.0)
_STEPS = 12


@dataclass
class _State:
    """The results for a box so far."""

    lower: float = np.inf
    upper: float = np.inf
    witness: Array | None = None
    violated: str | None = None
    open: list[Any] = field(default_factory=list[Any])

    def leave(self, family: Family, which: Indices, corners: tuple[Array, Array], lower: Any, reason: Reason) -> None:
        """Keep boxes of some constraints as open."""
        if len(which):
            bounds = np.broadcast_to(np.asarray(lower, dtype=np.float64), (len(which),))
            self.open.append((family.names, which, *corners, bounds, reason))


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
    """Prove that every configuration of a box is free and within limits, or find one that is not.

    Boundaries of one effective angle, and limits, are decided exactly over a box. For the others, lever arms bound the
    clearance; where the bound is too weak, the box is halved. The work grows quickly with the number of coordinates and
    near contact, so choose the budget with care.

    Args:
        robot: The robot.
        lower: (n,) lower corner [rad or m].
        upper: (n,) upper corner.
        boundaries: Names of the boundaries to check; None: all.
        budget: The work allowed; None: `Budget()`.
        limits: Whether to check joint limits, too.
        limits_only: Whether to check joint limits only. Otherwise, a robot without boundaries gives NOTHING_TO_CHECK.

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
    check_robot(robot)
    low, high = (one_configuration(corner, robot.coordinates).copy() for corner in (lower, upper))
    if np.any(low > high):
        index = int(np.flatnonzero(low > high)[0])
        name, ends = robot.coordinates[index], f"{low[index]:.9g} above {high[index]:.9g}"
        raise DimensionError(f"the box's lower corner is above its upper one in {name!r}: {ends}; swap them")
    refuse_far(low, high, robot.coordinates)
    chosen = scope(robot, boundaries, limits, limits_only)
    coverage = covered(robot, chosen)
    meter, state = Meter(budget or Budget()), _State()
    is_loose = needs_limits(chosen)
    limit_family, *others = _families(robot, chosen, low, high, limits)
    limits = limits or isinstance(robot, LoopRobot)  # its loops must close in any case
    if limits or is_loose:
        kept = state if limits else _State()
        if len(limit_family.names):
            _search(limit_family, low, high, meter, kept, is_limit=True)
        if is_loose and (kept.witness is not None or kept.open):
            _, *others = families(robot, unplaced(chosen), low, high)
            state.lower = -np.inf
    for family in others:
        if len(family.names) and state.witness is None:
            rows = _quick(family, low, high, meter, state)
            if len(rows) and state.witness is None:
                _search(family, low, high, meter, state, is_limit=False, rows=rows)
    verdict, notes = Verdict.UNDECIDED if state.open else Verdict.CERTIFIED, tuple[str, ...]()
    if state.witness is not None:
        verdict = Verdict.VIOLATED
        notes = look_like_degrees(robot, np.stack([low, high])) if state.violated in limit_family.names else ()
    return BoxCertificate(
        verdict=settled(verdict, chosen, limits_only),
        coverage=coverage,
        lower_corner=low,
        upper_corner=high,
        lower=-np.inf if state.witness is not None else state.lower,
        upper=state.upper,
        witness=state.witness,
        violated=state.violated,
        open_boxes=OpenBoxes.of(state.open, len(low)),
        boxes=meter.boxes,
        seconds=meter.seconds,
        notes=notes,
    )


def _over_z(robot: Robot, chosen: Sequence[Boundary]) -> tuple[Robot, Sequence[Boundary]]:
    """Return a robot and its boundaries; for loops that are not parallelograms, those over z."""
    return (robot.opened, [over_z(one) for one in chosen]) if isinstance(robot, LoopRobot) else (robot, chosen)


def _families(robot: Robot, chosen: Sequence[Boundary], low: Array, high: Array, limits: bool) -> Sequence[Any]:
    """Return all constraints over boxes of q, also through loops that are not parallelograms."""
    if not isinstance(robot, LoopRobot):
        return families(robot, chosen, low, high)
    errors = loop_errors(robot, low, high, 1)
    box = robot.lift.over(low[None], high[None], errors.tolist())
    opened = robot.opened if limits else closed_only(robot)
    found = families(opened, _over_z(robot, chosen)[1], box.lower[0], box.upper[0])
    return [LiftedFamily(one, robot.lift, errors) for one in found]


@dataclass(frozen=True)
class _Boxes:
    """Boxes within a root box, each for one constraint; `start` and `width` (N, n) are exact dyadic fractions of it.

    Corners and centres are computed from the corners of the root each time. So their rounding (three operations) does
    not grow with depth. `docs/certificates.md` includes it.
    """

    which: Indices
    start: Array
    width: Array

    def __len__(self) -> int:
        return len(self.which)

    def take(self, rows: Flags | slice) -> _Boxes:
        return _Boxes(self.which[rows], self.start[rows], self.width[rows])

    def halved(self, reach: Array) -> _Boxes:
        """Halve each box in the coordinate with the largest `reach` (N, n)."""
        rows, across = np.arange(len(self)), np.argmax(reach, axis=1)
        width, second = self.width.copy(), self.start.copy()
        width[rows, across] *= 0.5
        second[rows, across] += width[rows, across]
        which, start = np.concatenate([self.which, self.which]), np.concatenate([self.start, second])
        return _Boxes(which, start, np.concatenate([width, width]))


def _at(low: Array, high: Array, fraction: Array) -> Array:
    """Return points at fractions of a box; the fraction 1 is exactly its upper corner."""
    return np.where(fraction == 1.0, high, np.clip(low + fraction * (high - low), low, high))


def _quick(family: Family, low: Array, high: Array, meter: Meter, state: _State) -> Indices:
    """Search a box by machine code, if this saves time; return the constraints that are still undecided.

    Constraints that rounding leaves undecided are searched again; boxes beyond the budget are kept as open here.
    """
    rows = np.arange(len(family.names))
    groups = family.groups if isinstance(family, ManyAngleBoundaries) else None
    reason = meter.spent()
    left = meter.budget.seconds - meter.seconds
    if groups is None or reason or not is_worth(_GUESS * len(rows), left):
        return rows
    room = meter.budget.boxes - meter.boxes
    found = search_box(groups, family.weights, low, high, min(room, _A_SECOND * left))
    meter.boxes += found.boxes
    state.upper, state.lower = min(state.upper, found.upper), min(state.lower, found.lower)
    if found.witness is not None:
        state.witness, state.violated = found.witness[0], family.names[found.witness[1]]
        return rows[:0]
    pairs, start, width = found.open
    if len(pairs):
        state.lower = -np.inf
    corners = _at(low, high, start), _at(low, high, start + width)
    state.leave(family, pairs, corners, -np.inf, Reason.BOXES if room <= _A_SECOND * left else Reason.TIME)
    return np.unique(found.unknown).astype(np.intp)


def _search(
    family: Family, low: Array, high: Array, meter: Meter, state: _State, is_limit: bool, rows: Indices | None = None
) -> None:
    """Halve boxes, the last ones first, until all are clear, one is violated, or the budget is spent."""
    which, n = np.arange(len(family.names)) if rows is None else rows, len(low)
    family = family.within(meter.budget.seconds) if isinstance(family, SweptBoundaries) else family
    weights, size = family.weights, high - low

    def at(fraction: Array) -> Array:
        return _at(low, high, fraction)

    stack = [_Boxes(which, np.zeros((len(which), n)), np.ones((len(which), n)))]
    while stack:
        boxes = stack.pop()
        reason = meter.spent()
        if reason:
            state.lower = state.lower if is_limit else -np.inf
            for left in [boxes, *stack]:
                state.leave(family, left.which, (at(left.start), at(left.start + left.width)), -np.inf, reason)
            return
        if len(boxes) > _BATCH:
            stack.append(boxes.take(slice(_BATCH, None)))
            boxes = boxes.take(slice(_BATCH))
        which, meter.boxes = boxes.which, meter.boxes + len(boxes)
        centre, half = at(boxes.start + 0.5 * boxes.width), 0.5 * boxes.width * size
        found = family.enclose_box(which, centre, half)
        if not is_limit:
            state.upper = min(state.upper, float((found.value + found.error).min()))
        if np.any(found.violated):
            row = int(np.argmin(np.where(found.violated, found.value, np.inf)))
            state.witness, state.violated = centre[row].copy(), family.names[int(which[row])]
            return
        stuck = found.settled | (boxes.width <= _NARROWEST).all(axis=1)
        closed, left = found.clear | stuck, stuck & ~found.clear
        if not is_limit and np.any(closed):
            state.lower = min(state.lower, float(found.lower[closed].min()))
        if np.any(left):
            kept = boxes.take(left)
            corners = at(kept.start), at(kept.start + kept.width)
            state.leave(family, kept.which, corners, found.lower[left], Reason.ROUNDING)
        if not np.all(closed):
            stack.append(boxes.take(~closed).halved((weights[which] * half)[~closed]))


def certified_box(
    robot: Robot,
    q: ArrayLike,
    boundaries: Sequence[str] | None = None,
    reach: float = np.pi,
    budget: Budget | None = None,
    *,
    limits: bool = True,
    limits_only: bool = False,
) -> BoxCertificate:
    """Return a certified box around q of which no face can move outwards much further.

    First the box grows equally in all coordinates that a boundary or limit depends on, by bisection; then each face
    moves in turn. At the end no face can move outwards by 1/1000 of `reach` within the budget of one certificate. The
    box is maximal in this sense; it is not the largest of all boxes. Other coordinates keep q's value.

    Args:
        robot: The robot.
        q: (n,) the configuration inside.
        boundaries: Names of the boundaries; None: all.
        reach: How far a face may be from q [rad or m].
        budget: The budget of all certificates together, about 12 (2 n + 1) of them. Half of it is for the first stage;
            the rest is shared evenly among the remaining certificates. None: 400,000 boxes, 30 seconds.
        limits: Whether joint limits count too.
        limits_only: Whether only joint limits count.

    Returns:
        The certificate of the box. Its `boxes` and `seconds` are those of the whole search. A note says if the budget
        was spent before every face was tried. If q itself is not certified, it is the certificate of q alone.

    Raises:
        DimensionError: If q is not one finite configuration, reach is no positive number, or `limits_only` is asked
            for together with boundaries or without limits.
        UnknownNameError: If the robot has no boundary of that name.

    Example:
        >>> import pinbound as pb
        >>> robot = pb.load("minervabot_v3")
        >>> box = pb.certified_box(robot, [0.0, 0.6, 0.45])
        >>> box.verdict.value, bool(np.all(box.upper_corner[1:] - box.lower_corner[1:] > 0.5))
        ('certified', True)
    """
    check_robot(robot)
    start = one_configuration(q, robot.coordinates).copy()
    if not (np.ndim(reach) == 0 and 0.0 < reach <= FARTHEST):
        raise DimensionError(f"the reach is {reach}; give one positive number [rad or m]")
    chosen = scope(robot, boundaries, limits, limits_only)
    names = [boundary.name for boundary in chosen]
    moving = _moving(robot, chosen, limits)
    low, high = 0.0 * moving, 0.0 * moving
    faces = [(low, moving.copy(), high, moving.copy())]
    for index in np.flatnonzero(moving):
        one = np.eye(len(start))[index]
        faces += [(low, 0.0 * one, high, one), (low, one, high, 0.0 * one)]
    meter = Meter(budget or _GROWTH)
    left = len(faces) * _STEPS

    def ask(low: Array, high: Array, share: int) -> BoxCertificate:
        boxes = max(meter.budget.boxes - meter.boxes, 0)
        seconds = max(meter.budget.seconds - meter.seconds, 0.0)
        allowed = Budget(-(-boxes // share), seconds / share)
        corners = start - low * reach, start + high * reach
        found = certify_box(robot, *corners, names, allowed, limits=limits, limits_only=limits_only)
        meter.boxes += found.boxes
        return found

    best, cut = ask(low, high, share=1), False
    if best.verdict is not Verdict.CERTIFIED:
        return best
    for face, (_, grow_low, _, grow_high) in enumerate(faces):
        inside, outside = 0.0, 1.0
        for step in range(_STEPS):
            trial = 1.0 if step == 0 else 0.5 * (inside + outside)
            new = np.maximum(low, trial * grow_low), np.maximum(high, trial * grow_high)
            left, cut = left - 1, cut or meter.spent() is not None
            if cut:
                break
            if np.array_equal(new[0], low) and np.array_equal(new[1], high):
                inside = trial
                continue
            found = ask(*new, share=left + 1 if face else 2 * (_STEPS - step))
            if found.verdict is Verdict.CERTIFIED:
                inside, (low, high), best = trial, new, found
                if step == 0:
                    left -= _STEPS - 1
                    break
            else:
                outside = trial
    notes = ("the budget was spent before every face had been tried: a larger box may be certified",) if cut else ()
    return replace(best, boxes=meter.boxes, seconds=meter.seconds, notes=(*best.notes, *notes))


def _moving(robot: Robot, chosen: Sequence[Boundary], limits: bool) -> Array:
    """Return 1 for coordinates on which a boundary or limit depends, else 0."""
    used = {name for boundary in chosen for name in boundary.coordinates}
    if isinstance(robot, LoopRobot):
        over = _moving(*_over_z(robot, chosen), limits)
        used |= {robot.coordinates[index] for index in robot.lift.inputs}
        own = zip(robot.coordinates, over.tolist(), strict=False)
        return np.array([float(moves > 0.0 or name in used) for name, moves in own])
    bound = np.zeros(len(robot.coordinates), dtype=np.bool_)
    if limits:
        for limit in robot.linear_limits:
            bound |= limit.coefficients != 0.0
        for one in robot.guarded_limits:
            bound |= one.uses
    return (np.array([name in used for name in robot.coordinates], dtype=np.bool_) | bound).astype(np.float64)
