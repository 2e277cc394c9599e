"""free_volume(): a proven interval of the free volume in the box of limits, over two to four coordinates.

The box is halved recursively. Each part has a list of the pairs that are not yet proven free in it. A part with an
empty list is free. A part in which one pair is proven in contact, or one limit is violated, is not free. Pairs are
bounded in their own coordinates, all boxes of a round at once. `docs/free-space.md` has the bounds.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from pinbound.boundaries.boundary import Boundary, one_configuration
from pinbound.certificates.records import Budget, Reason
from pinbound.certificates.scope import covered, scope
from pinbound.certificates.search import Meter
from pinbound.checks import names_of
from pinbound.coverage import CoverageRecord
from pinbound.exceptions import DimensionError, UnknownNameError, UnsupportedError
from pinbound.freespace.faces import Face, guarded_choices, limit_faces, outer_box
from pinbound.freespace.held import HeldPairs, Lists
from pinbound.freespace.pairs import Pairs
from pinbound.robot.robot import Robot, check_robot
from pinbound.tolerances import INFLATION, LIMIT, UNIT_ROUNDOFF
from pinbound.typing import Array, Flags, Indices
from pinbound.values import Value

__all__ = [
    "MOST",
    "FreeVolume",
    "Paving",
    "axes_of",
    "corners_of",
    "free_volume",
    "halved",
    "paved_box",
    "rounding_of_volumes",
    "volume_of_boxes",
]

_BUDGET = Budget(boxes=20_000_000, seconds=10.0)
_FEWEST, MOST = 2, 4
"""The numbers of coordinates that can be paved."""
_BESIDE = 2.0 * LIMIT
"""How far beyond a limit a joint may go: limits are kept up to LIMIT, so boxes at the edge extend beyond them."""


@dataclass(frozen=True, eq=False, repr=False)
class FreeVolume(Value):
    """Proven bounds of the free volume in a box. Made by `free_volume`.

    Attributes:
        coordinates: The coordinates of the box.
        at: (n,) the values of the other coordinates.
        coverage: Which pairs of links the boundaries watch, and which they do not.
        box: (2, k) corners of the box of limits [rad or m].
        lower: Lower bound of the free volume [rad^k, metres for a prismatic joint].
        upper: Upper bound of the free volume [as `lower`].
        free: (f, 2, k) corners of boxes that are proven free.
        open: (u, 2, k) corners of boxes that are not decided.
        reason: Why undecided boxes remain (the budget); None if the requested share was decided.
        boxes: The number of bounds computed, one for each box and boundary.
        seconds: Wall time [s].

    Example:
        >>> import pinbound as pb
        >>> found = pb.free_volume(pb.load("minervabot_v3"), ("q2", "q3"), decided=0.9)
        >>> found.lower < found.upper, found.box.shape
        (True, (2, 2))
    """

    coordinates: tuple[str, ...]
    at: Array
    coverage: CoverageRecord
    box: Array
    lower: float
    upper: float
    free: Array
    open: Array
    reason: Reason | None
    boxes: int
    seconds: float

    def __repr__(self) -> str:
        """Return the interval as shares of the box, and what the boundaries watch."""
        low, high = self.lower / self.volume, self.upper / self.volume
        said = f"free share of the box in [{low:.6g}, {high:.6g}], proven"
        return f"<FreeVolume of {', '.join(self.coordinates)}: {said}; {self.coverage}>"

    @property
    def undecided(self) -> float:
        """The undecided volume, `upper - lower` [as `lower`]."""
        return self.upper - self.lower

    @property
    def volume(self) -> float:
        """Volume of the box [as `lower`]."""
        return float((self.box[1] - self.box[0]).prod())

    @property
    def decided(self) -> float:
        """The decided share of the box, in [0, 1]."""
        return max(0.0, 1.0 - self.undecided / self.volume)


def free_volume(
    robot: Robot,
    coordinates: Sequence[str],
    at: ArrayLike | None = None,
    boundaries: Sequence[str] | None = None,
    budget: Budget | None = None,
    window: Mapping[str, tuple[float, float]] | None = None,
    *,
    decided: float = 0.99,
) -> FreeVolume:
    """Return a proven interval of the free volume in the box of limits of two to four coordinates.

    Free has the meaning of `robot.boundaries.free`: out of contact, and within all limits and rules.

    Args:
        robot: The robot.
        coordinates: Names of two, three or four coordinates.
        at: (n,) the values of the other coordinates; home by default.
        boundaries: Names of the boundaries; None: all.
        budget: The work allowed; None: 10 seconds.
        window: Ends [rad or m] by coordinate; needed for coordinates without limits.
        decided: The decided share of the box at which the search ends, in (0, 1].

    Raises:
        UnknownNameError: If a coordinate or a boundary does not exist.
        UnsupportedError: If there are not two to four different coordinates.
        DimensionError: If `at` is not one finite configuration, `decided` is not in (0, 1], or a coordinate has no
            limits.

    Example:
        >>> import pinbound as pb
        >>> robot = pb.load("minervabot_v3")
        >>> found = pb.free_volume(robot, ("q2", "q3"), decided=0.999)
        >>> area = pb.feasible_region(robot).area
        >>> found.lower < area < found.upper, found.decided >= 0.999
        (True, True)
    """
    check_robot(robot)
    held = np.array(robot.home if at is None else one_configuration(at, robot.coordinates), dtype=np.float64)
    names, axes = axes_of(robot, coordinates)
    if not 0.0 < decided <= 1.0:
        raise DimensionError(f"the share {decided} is not in (0, 1]; give above 0, at most 1")
    chosen = scope(robot, boundaries, True, not len(robot.boundaries) and boundaries is None)
    paving = Paving(robot, chosen, axes, held, dict(window or {}), Meter(budget or _BUDGET))
    total = float(np.prod(paving.high - paving.low))
    reason = paving.run(lambda free, undecided: undecided <= (1.0 - decided) * total)
    free, contact = volume_of_boxes(paving.free), volume_of_boxes(paving.contact)
    room = rounding_of_volumes(total)
    return FreeVolume(
        coordinates=names,
        at=held,
        coverage=covered(robot, chosen),
        box=np.stack([paving.low, paving.high]),
        lower=max(0.0, free - room),
        upper=min(total, total - contact + room),
        free=corners_of(paving.free, len(axes)),
        open=corners_of(paving.left, len(axes)),
        reason=reason,
        boxes=paving.meter.boxes,
        seconds=paving.meter.seconds,
    )


def axes_of(robot: Robot, coordinates: Sequence[str]) -> tuple[tuple[str, ...], Indices]:
    """Return the names of two to four coordinates, and their indices in q.

    Raises:
        UnknownNameError: If a coordinate does not exist.
        UnsupportedError: If there are not two to four different ones.
    """
    check_robot(robot)
    names = names_of(coordinates, "coordinates")
    for name in names:
        if name not in robot.coordinates:
            raise UnknownNameError("coordinate", name, robot.coordinates)
    if not _FEWEST <= len(names) <= MOST or len(set(names)) < len(names):
        raise UnsupportedError(f"you gave {', '.join(names) or 'none'}; give two to four coordinates, each once")
    return names, np.array([robot.coordinates.index(name) for name in names])


def paved_box(
    robot: Robot, axes: Indices, at: Array, window: Mapping[str, tuple[float, float]]
) -> tuple[Array, Array, Array]:
    """Return the corners (n,) of the box of limits of the axes, the others fixed, and the allowance beyond it (n,).

    Args:
        robot: The robot.
        axes: The indices in q of the coordinates of the box.
        at: (n,) the values of the other coordinates.
        window: Additional ends, by coordinate [rad or m].

    Raises:
        DimensionError: If a coordinate of the box is not bounded.
    """
    rough = limit_faces(robot, window)
    n = len(robot.coordinates)
    others = np.setdiff1d(np.arange(n), axes)
    ones = np.eye(n)
    fixed = [Face("", "", s * ones[j], s * float(at[j]), 0.0, False) for j in others for s in (1.0, -1.0)]
    bounding = [face for face in rough if np.any(face.normal[axes])]
    low, high = outer_box([*bounding, *fixed], robot.coordinates)
    ends = [(face, np.flatnonzero(face.normal)) for face in rough]
    for face, used in ends:  # exact ends where one coordinate has them: the box of limits, not a wider one
        if len(used) == 1 and used[0] in axes:
            end = face.bound / float(face.normal[used[0]])
            if face.normal[used[0]] > 0.0 and abs(end - high[used[0]]) < LIMIT * (1.0 + abs(end)):
                high[used[0]] = end
            elif face.normal[used[0]] < 0.0 and abs(end - low[used[0]]) < LIMIT * (1.0 + abs(end)):
                low[used[0]] = end
    # A mimic joint of a small slope lets its coordinate go further beyond the box.
    beyond = [replace(face, bound=face.bound + _BESIDE * (1.0 + abs(face.bound))) for face in bounding]
    far_low, far_high = outer_box([*beyond, *fixed], robot.coordinates)
    return low, high, np.maximum(np.maximum(low - far_low, far_high - high), _BESIDE)


def volume_of_boxes(parts: Sequence[Array]) -> float:
    """Return the sum of the volumes of boxes; each part is an array (f, 2, k)."""
    sizes = [(one[:, 1] - one[:, 0]).prod(axis=1) for one in parts]
    return math.fsum(float(x) for one in sizes for x in one)


def corners_of(parts: Sequence[Array], k: int) -> Array:
    """Return all boxes (f, 2, k) of some parts."""
    return np.concatenate([np.empty((0, 2, k)), *parts])


def rounding_of_volumes(total: float) -> float:
    """Return a bound of the rounding error of a sum of volumes of boxes that is at most `total`."""
    return 64.0 * UNIT_ROUNDOFF * total


def halved(boxes: Array, across: Indices) -> Array:
    """Halve each box (N, 2, k) in one coordinate (N,); return all first halves, then all second halves."""
    rows = np.arange(len(boxes))
    middle = 0.5 * (boxes[rows, 0, across] + boxes[rows, 1, across])
    first, second = boxes.copy(), boxes.copy()
    first[rows, 1, across] = middle
    second[rows, 0, across] = middle
    return np.concatenate([first, second])


class Paving:
    """Boxes [low, high] over the axes, and rows (box, pair) for pairs that are not yet proven free in a box."""

    def __init__(
        self,
        robot: Robot,
        chosen: Sequence[Boundary],
        axes: Indices,
        at: Array,
        window: Mapping[str, tuple[float, float]],
        meter: Meter,
    ) -> None:
        """Start with the box of limits of the axes; the others are fixed at `at` (n,)."""
        low, high, beside = paved_box(robot, axes, at, window)
        self.axes, self.at, self.meter = axes, at, meter
        self.low, self.high, self.beside = low[axes], high[axes], beside[axes]
        farthest = np.maximum(np.abs(low), np.abs(high))
        self.pairs = Pairs(robot, [robot.boundaries[one.name] for one in chosen], low - beside, high + beside)
        self.rules = [[face] for face in limit_faces(robot, {}, farthest)]
        self.rules += [guarded_choices(one, farthest, robot.coordinates) for one in robot.guarded_limits]
        self.farthest = farthest
        self.free: list[Array] = []
        self.contact: list[Array] = []
        self.left: list[Array] = []

    def run(self, is_enough: Callable[[float, float], bool]) -> Reason | None:
        """Halve boxes until enough volume is decided; return which part of the budget ended the search, if one did."""
        held = HeldPairs(self.pairs, self.axes, self.at, self.low, self.high, self.beside)
        items = np.setdiff1d(np.arange(len(self.pairs) + len(self.rules)), held.rows)
        boxes = np.stack([self.low, self.high])[None]
        lists, box, item = held.first_lists(1), np.zeros(len(items), dtype=np.intp), items
        free = 0.0
        while len(boxes):
            volume = np.prod(boxes[:, 1] - boxes[:, 0], axis=1)
            undecided, rounds = float(volume.sum()), list[_Round]()
            for start in range(0, len(boxes), held.most_boxes):
                reason = self.meter.spent()
                if is_enough(free, undecided) or reason:
                    self.left += [boxes[start:], *(one.boxes for one in rounds)]
                    return None if is_enough(free, undecided) else reason
                part = slice(start, start + held.most_boxes)
                rows = slice(*np.searchsorted(box, [part.start, part.stop]))
                one = self._round(held, boxes[part], lists.take(part), box[rows] - start, item[rows])
                self.free.append(boxes[part][one.is_free])
                self.contact.append(boxes[part][one.is_contact])
                free += float(volume[part][one.is_free].sum())
                undecided -= float(volume[part][one.is_free | one.is_contact].sum())
                rounds.append(one)
            boxes, lists, box, item = _joined(rounds)
        return None

    def _round(self, held: HeldPairs, boxes: Array, lists: Lists, box: Indices, item: Indices) -> _Round:
        """Bound the listed nodes of some boxes, and `item` with all coordinates; halve the remaining boxes."""
        count = len(boxes)
        found = held.decide(boxes, lists, self.meter.budget.seconds - self.meter.seconds)
        lower, upper = self.bounds(item, boxes[box]) if len(item) else (np.empty(0), np.empty(0))
        self.meter.boxes += found.bounded + len(item)
        contact = found.contact.copy()
        contact[box[upper < 0.0]] = True
        keep = ~(lower > 0.0)
        least, which = np.full(count, np.inf), np.zeros(count, dtype=np.intp)
        order = np.argsort(-lower[keep], kind="stable")  # the least one is last, and is kept
        least[box[keep][order]], which[box[keep][order]] = lower[keep][order], item[keep][order]
        is_open = ~contact & ((found.lists.length > 0) | (least < np.inf))
        across = found.across.copy()
        others = np.flatnonzero(is_open & (least < found.least))
        across[others] = self._across(boxes[others], which[others])
        keep &= is_open[box]
        number = np.cumsum(is_open) - 1
        halves = halved(boxes[is_open], across[is_open])
        return _Round(halves, found.lists.take(is_open), number[box[keep]], item[keep], ~contact & ~is_open, contact)

    def bounds(self, item: Indices, boxes: Array) -> tuple[Array, Array]:
        """Return lower bounds, positive where proven free, and upper bounds, negative where proven in contact."""
        centre = np.tile(self.at, (len(item), 1))
        half = np.zeros_like(centre)
        middle = 0.5 * (boxes[:, 0] + boxes[:, 1])
        centre[:, self.axes] = middle
        half[:, self.axes] = np.maximum(boxes[:, 1] - middle, middle - boxes[:, 0]) * INFLATION
        lower, upper = np.empty(len(item)), np.empty(len(item))
        rows = np.flatnonzero(item < len(self.pairs))
        if len(rows):
            beside = half[rows]
            beside[:, self.axes] += self.beside
            found = self.pairs.bound(item[rows], centre[rows], beside)
            lower[rows], upper[rows] = found.lower, found.upper
        for index, choices in enumerate(self.rules):
            rows = np.flatnonzero(item == len(self.pairs) + index)
            if len(rows):
                lower[rows], upper[rows] = self._rule(choices, centre[rows], half[rows])
        return lower, upper

    def _rule(self, choices: Sequence[Face], centre: Array, half: Array) -> tuple[Array, Array]:
        """Return (1, inf) if a half-space is kept everywhere, (0, -1) if all are violated everywhere, else (0, inf)."""
        kept: Flags = np.zeros(len(centre), dtype=np.bool_)
        lost: Flags = np.ones(len(centre), dtype=np.bool_)
        for index, face in enumerate(choices):
            middle, wide = centre @ face.normal, (half / INFLATION) @ np.abs(face.normal)
            rounding = (
                (2.0 * len(face.normal) + 12.0)
                * UNIT_ROUNDOFF
                * (float(np.abs(face.normal) @ self.farthest) + abs(face.bound))
            )
            tolerance = 2.0 * LIMIT if index == 0 else -LIMIT
            kept |= middle + wide <= face.proven + (LIMIT if index == 0 else 0.0) - rounding
            beyond = wide + float(np.abs(face.normal[self.axes]) @ self.beside)
            lost &= middle - beyond > face.bound + tolerance + rounding
        return np.where(kept, 1.0, 0.0), np.where(lost, -1.0, np.inf)

    def _across(self, boxes: Array, which: Indices) -> Indices:
        """Return the coordinate in which to halve each box: it moves the worst pair most; for limits the widest."""
        wide = boxes[:, 1] - boxes[:, 0]
        weights = np.ones((len(boxes), len(self.axes)))
        is_pair = which < len(self.pairs)
        weights[is_pair] = self.pairs.weights[which[is_pair]][:, self.axes]
        reach = weights * wide
        reach[~np.any(reach > 0.0, axis=1)] = wide[~np.any(reach > 0.0, axis=1)]
        return np.argmax(reach, axis=1)


@dataclass(frozen=True)
class _Round:
    """The results of a round for some boxes.

    Attributes:
        boxes: (2 o, 2, k) the halves of the o undecided boxes, first halves first.
        lists: The lists of these o boxes.
        box: For entries that are bounded with all coordinates, the index among the o boxes.
        item: These entries.
        is_free: Which of the given boxes are free.
        is_contact: Which are in contact, or beyond a limit.
    """

    boxes: Array
    lists: Lists
    box: Indices
    item: Indices
    is_free: Flags
    is_contact: Flags


def _joined(rounds: Sequence[_Round]) -> tuple[Array, Lists, Indices, Indices]:
    """Return the halves of all rounds, their lists, and the entries with all coordinates, by box."""
    nodes, first, length = list[Indices](), list[Indices](), list[Indices]()
    box, item, listed, boxes = list[Indices](), list[Indices](), 0, 0
    for one in rounds:
        count = len(one.lists.first)
        nodes.append(one.lists.nodes)
        first += [one.lists.first + listed] * 2
        length += [one.lists.length] * 2
        box += [one.box + boxes, one.box + boxes + count]
        item += [one.item] * 2
        listed, boxes = listed + len(one.lists.nodes), boxes + 2 * count
    lists = Lists(np.concatenate(nodes), np.concatenate(first), np.concatenate(length))
    return np.concatenate([one.boxes for one in rounds]), lists, np.concatenate(box), np.concatenate(item)
