"""certified_cover(): sets that are proven free and hold a stated share of the free volume.

Over two to four coordinates, the box of limits is paved, and the share is proven. Over more coordinates, and if every
boundary has one effective angle, polytopes are certified around samples that no other polytope holds, and the share is
estimated.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pinbound.boundaries.boundary import Boundary, one_configuration
from pinbound.certificates.records import Budget, Reason, Verdict
from pinbound.certificates.scope import covered, scope
from pinbound.certificates.search import Meter
from pinbound.checks import whole_number
from pinbound.exceptions import DimensionError, UnsupportedError
from pinbound.freespace.cover_records import ConvexSet, FreeCover
from pinbound.freespace.digest import robot_digest
from pinbound.freespace.faces import limit_faces, outer_box
from pinbound.freespace.paving import MOST, Paving, axes_of, corners_of, rounding_of_volumes, volume_of_boxes
from pinbound.freespace.polytope import certified_polytope
from pinbound.robot.robot import Robot
from pinbound.tolerances import LIMIT
from pinbound.typing import Array, Flags, Indices

__all__ = ["certified_cover"]

_BUDGET = Budget(boxes=1_000_000_000, seconds=60.0)
_SAMPLES = 2000
_DRAWS = 200
_CHOICE = 64
"""Number of samples outside all sets; the one furthest from contact is the next seed."""
_ONE_SET = 0.1
"""Largest share of the seconds for one polytope."""
_NORMAL_95 = 1.959964
_FEWEST_SECONDS = 0.5


def certified_cover(
    robot: Robot,
    coordinates: Sequence[str] | None = None,
    at: ArrayLike | None = None,
    boundaries: Sequence[str] | None = None,
    budget: Budget | None = None,
    window: Mapping[str, tuple[float, float]] | None = None,
    *,
    share: float = 0.9,
    limits_only: bool = False,
    seed: int = 0,
) -> FreeCover:
    """Return sets that are proven free and hold at least a share of the free volume, as far as the budget allows.

    Two to four coordinates are paved with boxes. Then the share is proven: the volume of the boxes, divided by the
    largest volume that can be free. All coordinates of a robot with more than four, or of a robot whose boundaries have
    one effective angle each, are covered by polytopes (`certified_polytope`). Then the share is the 95 % interval of an
    estimate from samples.

    Args:
        robot: The robot.
        coordinates: Names of two to four coordinates; None: all coordinates.
        at: (n,) the values of the other coordinates; home by default.
        boundaries: Names of the boundaries; None: all.
        budget: The work allowed; None: 60 seconds.
        window: Ends [rad or m] by coordinate; needed for coordinates without limits.
        share: The share of the free volume that the sets should hold, in (0, 1].
        limits_only: Whether to use limits and rules only, without boundaries.
        seed: Seed of the random samples; the proofs do not depend on it.

    Raises:
        UnknownNameError: If a coordinate or a boundary does not exist.
        UnsupportedError: If there are not two to four different coordinates, or if there is no boundary.
        DimensionError: If `at` is not one finite configuration, `share` is not in (0, 1], or a coordinate has no
            limits.

    References:
        `docs/free-space.md`.

    Example:
        >>> import pinbound as pb
        >>> robot = pb.load("minervabot_v3")
        >>> whole = pb.certified_cover(robot, share=0.95)
        >>> len(whole.polytopes), bool(whole.share[0] > 0.95)
        (1, True)
        >>> slice_ = pb.certified_cover(robot, ("q2", "q3"), share=0.95)
        >>> slice_.is_proven, bool(slice_.share[0] >= 0.95)
        (True, True)
    """
    if not 0.0 < share <= 1.0:
        raise DimensionError(f"the share {share} is not in (0, 1]; give above 0, at most 1")
    whole_number(seed, "seed")
    chosen = scope(robot, boundaries, True, limits_only)
    if not chosen and not limits_only:
        raise UnsupportedError(
            "there is no boundary, so contact cannot be checked; give the robot "
            "boundaries, or limits_only=True to use joint limits alone"
        )
    meter = Meter(budget or _BUDGET)
    n = len(robot.coordinates)
    if coordinates is not None:
        return _paved(robot, chosen, coordinates, at, dict(window or {}), meter, share)
    one_angle = all(boundary.rule.strips() is not None for boundary in chosen)
    if not one_angle and 2 <= n <= MOST:
        return _paved(robot, chosen, robot.coordinates, None, dict(window or {}), meter, share)
    return _polytopes(robot, chosen, dict(window or {}), meter, share, limits_only, seed)


def _paved(
    robot: Robot,
    chosen: Sequence[Boundary],
    coordinates: Sequence[str],
    at: ArrayLike | None,
    window: Mapping[str, tuple[float, float]],
    meter: Meter,
    share: float,
) -> FreeCover:
    place = np.array(robot.home if at is None else one_configuration(at, robot.coordinates), dtype=np.float64)
    names, axes = axes_of(robot, coordinates)
    paving = Paving(robot, chosen, axes, place, window, meter)

    def is_enough(free: float, undecided: float) -> bool:
        return free >= share * (free + undecided) * (1.0 + 1e-12)

    reason = paving.run(is_enough)
    free, left = volume_of_boxes(paving.free), volume_of_boxes(paving.left)
    room = rounding_of_volumes(float(np.prod(paving.high - paving.low)))
    least, most = max(0.0, free - room), free + left + room
    used = {name for one in chosen for name in one.coordinates}
    held = place.copy()
    held[axes] = np.nan
    return FreeCover(
        robot=robot.name,
        robot_coordinates=robot.coordinates,
        coordinates=names,
        at=held,
        boundaries=tuple(one.name for one in chosen),
        coverage=covered(robot, chosen),
        boxes=corners_of(paving.free, len(axes)),
        polytopes=(),
        share=np.array([least / most if most > 0.0 else 1.0, 1.0]),
        is_proven=True,
        open=corners_of(paving.left, len(axes)),
        is_whole=used <= set(names) and not window and _others_keep(robot, axes, place),
        reason=reason,
        digest=robot_digest(robot, chosen),
        work=meter.boxes,
        seconds=meter.seconds,
    )


def _others_keep(robot: Robot, axes: Indices, at: Array) -> bool:
    """Return whether limits and rules do not couple the axes to the others, and the others keep their own limits.

    Then the paved result does not depend on the values of the others, as long as they keep their limits.
    """
    is_axis = np.zeros(len(at), dtype=np.bool_)
    is_axis[axes] = True
    rules = [(limit,) for limit in robot.linear_limits]
    rules += [(one.limit, *one.where) for one in robot.guarded_limits]
    for parts in rules:
        uses = np.any([part.coefficients != 0.0 for part in parts], axis=0)
        if np.any(uses & ~is_axis) and (np.any(uses & is_axis) or len(parts) > 1):
            return False
        if np.any(uses & ~is_axis):
            c, theta = parts[0].coefficients, parts[0].offset
            value = float(c[~is_axis] @ at[~is_axis]) + theta
            if not parts[0].lower - LIMIT <= value <= parts[0].upper + LIMIT:
                return False
    return True


def _polytopes(
    robot: Robot,
    chosen: Sequence[Boundary],
    window: Mapping[str, tuple[float, float]],
    meter: Meter,
    share: float,
    limits_only: bool,
    seed: int,
) -> FreeCover:
    """Certify polytopes around samples; other samples, which were not seeds, estimate the share inside."""
    rng, names = np.random.default_rng(seed), [one.name for one in chosen]
    seeds, judged = (_free_samples(robot, chosen, window, rng) for _ in range(2))
    found: list[ConvexSet] = []
    notes: list[str] = []
    held: Flags = np.zeros(len(judged), dtype=np.bool_)
    left = np.arange(len(seeds))
    failed, interval = 0, _interval(held)
    reason: Reason | None = None
    while interval[0] < share and len(left):
        reason = meter.spent()
        if reason:
            break
        some = rng.choice(left, min(_CHOICE, len(left)), replace=False)
        best = some[int(np.argmax(_least(robot, names, seeds[some])))]
        seconds = max(0.0, meter.budget.seconds - meter.seconds)  # the choice of a seed took time, too
        allowed = Budget(
            max(0, meter.budget.boxes - meter.boxes), min(seconds, max(_FEWEST_SECONDS, _ONE_SET * seconds))
        )
        polytope = certified_polytope(robot, seeds[best], names, allowed, window, limits_only=limits_only, seed=seed)
        meter.boxes += polytope.boxes
        left = left[left != best]
        if polytope.verdict is not Verdict.CERTIFIED:
            failed += 1
            continue
        one = ConvexSet(polytope.A, polytope.b)
        found.append(one)
        left = left[~one.contains(seeds[left])]
        held |= one.contains(judged)
        interval = _interval(held)
        if interval[0] >= share:  # these samples decided when to stop; new ones estimate the share
            judged = _free_samples(robot, chosen, window, rng)
            held = np.any([one.contains(judged) for one in found], axis=0)
            interval = _interval(held)
    if failed:
        notes.append(f"around {failed} free samples no polytope could be certified within its share of the budget")
    if not len(judged):
        notes.append(f"no free configuration was found among {_SAMPLES * _DRAWS} samples")
    return FreeCover(
        robot=robot.name,
        robot_coordinates=robot.coordinates,
        coordinates=robot.coordinates,
        at=np.full(len(robot.coordinates), np.nan),
        boundaries=tuple(names),
        coverage=covered(robot, chosen),
        boxes=np.empty((0, 2, len(robot.coordinates))),
        polytopes=tuple(found),
        share=interval,
        is_proven=False,
        open=np.empty((0, 2, len(robot.coordinates))),
        is_whole=False,
        reason=reason if interval[0] < share else None,
        digest=robot_digest(robot, chosen),
        work=meter.boxes,
        seconds=meter.seconds,
        notes=tuple(notes),
    )


def _free_samples(
    robot: Robot, chosen: Sequence[Boundary], window: Mapping[str, tuple[float, float]], rng: np.random.Generator
) -> Array:
    low, high = outer_box(limit_faces(robot, window), robot.coordinates)
    some: Any = robot.boundaries.select([one.name for one in chosen]) if chosen else None
    found, count = list[Array](), 0
    for _ in range(_DRAWS):
        Q = rng.uniform(low, high, (_SAMPLES, len(low)))
        Q = Q[robot.intervals.hold(Q)]
        if some is not None and len(Q):
            Q = Q[some.free(Q)]
        found.append(Q)
        count += len(Q)
        if count >= _SAMPLES:
            break
    return np.concatenate(found)[:_SAMPLES]


def _least(robot: Robot, names: Sequence[str], Q: Array) -> Array:
    if not names:
        return np.zeros(len(Q))
    return np.asarray(robot.boundaries.select(list(names)).signed_clearances(Q)).min(axis=1)


def _interval(held: Flags) -> Array:
    """Return Wilson's 95 % interval of the share of trues."""
    n = len(held)
    if not n:
        return np.array([0.0, 1.0])
    p, z = float(np.mean(held)), _NORMAL_95
    middle, wide = p + z * z / (2 * n), z * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    scale = 1.0 + z * z / n
    return np.array([max(0.0, (middle - wide) / scale), min(1.0, (middle + wide) / scale)])
