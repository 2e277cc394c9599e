"""pair_atlas(): for every pair, where it is proven free and where it is proven in contact, in its own coordinates.

For a pair of one effective angle, the sets are intervals of the angle. Other pairs that move by the same chain are
paved together, as one group. Sets that differ only in names are computed once. The group with the smallest cost so far
is continued first. So all cheap groups are decided, and the others share the rest of the budget evenly.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from pinbound.boundaries.boundary import Boundary
from pinbound.certificates.records import Budget, Reason
from pinbound.certificates.scope import covered, scope
from pinbound.certificates.search import Meter
from pinbound.exceptions import DimensionError, UnsupportedError
from pinbound.freespace.atlas_records import AtlasGroup, PairAtlas
from pinbound.freespace.digest import robot_digest
from pinbound.freespace.pair_angles import angle_set
from pinbound.freespace.pair_paving import PairPaving
from pinbound.freespace.pair_sets import PairSet
from pinbound.freespace.paving import paved_box
from pinbound.freespace.structure import Structure, structures
from pinbound.robot.robot import Robot
from pinbound.typing import Array

__all__ = ["Told", "pair_atlas"]

_BUDGET = Budget(boxes=1_000_000_000, seconds=30.0)

Told = Callable[[float, str], bool | None]
"""Called with the mean decided share and the name of the next boundary; a true result ends the work."""


def pair_atlas(
    robot: Robot,
    boundaries: Sequence[str] | None = None,
    budget: Budget | None = None,
    window: Mapping[str, tuple[float, float]] | None = None,
    *,
    decided: float = 0.99,
    each: bool = False,
    progress: Told | None = None,
) -> PairAtlas:
    """Return where each boundary is proven free, and where in contact, over the coordinates that it depends on.

    Args:
        robot: The robot.
        boundaries: Names of the boundaries; None: all.
        budget: The work allowed; None: 30 seconds.
        window: Ends [rad or m] by coordinate; needed for coordinates without limits.
        decided: The decided share of the box of limits at which the search for a group of boundaries ends, in (0, 1].
        each: Whether every boundary is paved alone. Otherwise boundaries that move by the same chain are paved as a
            group, and where one is in contact, the others of the group are left undecided.
        progress: Called between parts of the work with the mean decided share and the name of the next boundary. If it
            returns true, the work ends as if the budget were spent.

    Raises:
        UnknownNameError: If the robot has no boundary of that name.
        UnsupportedError: If there is no boundary.
        DimensionError: If `decided` is not in (0, 1], or a coordinate that a boundary depends on has no limits.

    References:
        `docs/free-space.md`, Pair atlas.

    Example:
        >>> import pinbound as pb
        >>> robot = pb.load("minervabot_v3")
        >>> atlas = pb.pair_atlas(robot)
        >>> Q = np.random.default_rng(0).uniform(robot.lower, robot.upper, (1000, 3))
        >>> bool(np.array_equal(atlas.where(Q) == pb.Where.FREE, robot.boundaries.free(Q)))
        True
    """
    if not 0.0 < decided <= 1.0:
        raise DimensionError(f"the share {decided} is not in (0, 1]; give above 0, at most 1")
    chosen = scope(robot, boundaries, True, False)
    if not chosen:
        raise UnsupportedError(
            "the robot has no boundary, so there is nothing to compute; give it marks and boundaries"
        )
    meter = Meter(budget or _BUDGET)
    given = {name: (float(low), float(high)) for name, (low, high) in (window or {}).items()}
    ends = _box(robot, chosen, given)
    found = structures(robot, chosen, ends, each)
    groups, reason = _Work(robot, ends, meter).run(found, decided, progress)
    return PairAtlas(
        robot=robot,
        boundaries=tuple(one.name for one in chosen),
        coverage=covered(robot, chosen),
        groups=groups,
        window=given,
        reason=reason,
        digest=robot_digest(robot, chosen),
        work=meter.boxes,
        seconds=meter.seconds,
    )


def _box(
    robot: Robot, chosen: Sequence[Boundary], window: Mapping[str, tuple[float, float]]
) -> tuple[Array, Array, Array]:
    """Return the box of limits of all coordinates that a boundary depends on, the others at home."""
    names = {name for one in chosen for name in one.coordinates} | set(window)
    axes = np.array([j for j, name in enumerate(robot.coordinates) if name in names], dtype=np.intp)
    return paved_box(robot, axes, robot.home, window)


class _Work:
    def __init__(self, robot: Robot, ends: tuple[Array, Array, Array], meter: Meter) -> None:
        self.robot, self.ends, self.meter = robot, ends, meter

    def run(
        self, found: Sequence[Structure], decided: float, progress: Told | None
    ) -> tuple[tuple[AtlasGroup, ...], Reason | None]:
        """Return the proven sets of each structure, and which part of the budget ended the work, if one did."""
        first: dict[str, int] = {}
        for number, one in enumerate(found):
            first.setdefault(one.key, number)
        known, pavings = dict[str, PairSet](), dict[str, PairPaving]()
        for key, number in first.items():
            one = found[number]
            if one.is_exact:
                known[key] = angle_set(self.robot, one.members[0], one.columns, *self.ends)
                self.meter.boxes += known[key].work
            else:
                pavings[key] = PairPaving(self.robot, one.members, one.columns, self.robot.home, self.ends, self.meter)
        reason = self._pave(pavings, 1.0 - decided, len(known), progress)
        known |= {key: paving.finish() for key, paving in pavings.items()}
        groups = (self._group(one, number, first[one.key], known[one.key]) for number, one in enumerate(found))
        return tuple(groups), reason

    def _pave(self, pavings: Mapping[str, PairPaving], most: float, done: int, progress: Told | None) -> Reason | None:
        left = {key for key, one in pavings.items() if not one.is_done}
        while left:
            key = min(left, key=lambda key: (pavings[key].work, key))
            one = pavings[key]
            if one.is_done or one.undecided <= most:
                left.discard(key)
                continue
            reason = self.meter.spent()
            if reason is not None:
                return reason
            if progress is not None:
                share = (done + sum(1.0 - other.undecided for other in pavings.values())) / (done + len(pavings))
                if progress(share, one.names[0]):
                    return Reason.STOPPED
            one.step()
        closed = any(one.undecided > most for one in pavings.values())
        return Reason.RESOLUTION if closed else None

    def _group(self, one: Structure, number: int, first: int, known: PairSet) -> AtlasGroup:
        places: list[int] = one.columns.tolist()
        return AtlasGroup(
            names=tuple(boundary.name for boundary in one.members),
            coordinates=tuple(self.robot.coordinates[j] for j in places),
            columns=one.columns,
            known=known,
            shared_with=None if first == number else first,
        )
