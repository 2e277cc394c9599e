"""Coupled joints: `theta = S q + o`, from chains of mimic joints to the coordinates that the user commands."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pinbound.exceptions import DimensionError, UnknownNameError, UnsupportedError
from pinbound.model.urdf import Joint, Mimic
from pinbound.tolerances import FOLLOWS, LIMIT, UNIT_ROUNDOFF
from pinbound.typing import Array, Flags
from pinbound.values import FrozenDict, Value

__all__ = [
    "Coupling",
    "GuardedLimit",
    "Intervals",
    "LinearLimit",
    "as_configurations",
    "combination",
    "coordinate_index",
    "couple",
    "linear_limits",
    "linear_text",
    "narrowed_by_mimics",
    "real_array",
]

_LARGEST = float(np.finfo(np.float64).max)
_BLOCK = 1 << 13  # rows at a time, so that they stay in the cache


@dataclass(frozen=True, eq=False)
class Coupling(Value):
    """The affine map from active coordinates to tree joints.

    Attributes:
        coordinates: Names of the active joints, in q's order (n).
        joints: Names of all moving joints, in the order of `robot.model` (n_tree).
        S: (n_tree, n) coupling matrix.
        offset: (n_tree,) [rad or m].

    Example:
        >>> coupling = Coupling(("q1",), ("q1", "follower"), np.array([[1.0], [-1.0]]), np.array([0.0, 0.5]))
        >>> coupling.expand([0.2])
        array([0.2, 0.3])
    """

    coordinates: tuple[str, ...]
    joints: tuple[str, ...]
    S: Array
    offset: Array

    def expand(self, Q: ArrayLike) -> Array:
        """Return `theta = S q + o` for one q (n,) or many (N, n); shape (n_tree,) or (N, n_tree).

        Raises:
            DimensionError: If the last axis of Q is not n long.
        """
        with np.errstate(invalid="ignore"):  # a row that is not finite gives NaN without a warning
            return as_configurations(Q, self.coordinates) @ self.S.T + self.offset

    def row(self, joint: str) -> tuple[Array, float]:
        """Return the coefficients (n,) and the offset of one tree joint."""
        index = self.places[joint]
        return self.S[index], float(self.offset[index])

    @cached_property
    def places(self) -> FrozenDict[str, int]:
        """The row index of each joint."""
        return FrozenDict({name: row for row, name in enumerate(self.joints)})

    @cached_property
    def own(self) -> FrozenDict[str, int]:
        """For each joint that follows only one coordinate, without an offset, the index of this coordinate."""
        sizes = np.abs(self.S)
        single = (np.count_nonzero(sizes, axis=1) == 1) & (sizes.max(axis=1, initial=0.0) > FOLLOWS)
        rows = np.flatnonzero(single & (self.offset == 0.0)).tolist()
        return FrozenDict({self.joints[row]: int(np.argmax(sizes[row])) for row in rows})

    def text(self, joint: str) -> str:
        """Return the joint as a function of q, as text.

        Example:
            >>> Coupling(("q1",), ("q1", "f"), np.array([[1.0], [-2.0]]), np.array([0.0, 0.5])).text("f")
            '- 2 q1 + 0.5'
        """
        coefficients, offset = self.row(joint)
        return linear_text(coefficients, self.coordinates, offset)

    def solved(self, used: Iterable[str]) -> dict[str, str]:
        """Return the given joints that a loop determines, each with its loop: none, because this map is affine."""
        return {}


def linear_text(coefficients: Array, names: Sequence[str], offset: float = 0.0) -> str:
    """Return `c . q + o` as text, with positive terms first.

    Example:
        >>> linear_text(np.array([0.0, -1.0, 1.0]), ("q1", "q2", "q3"))
        'q3 - q2'
    """
    terms = [(float(c), name) for c, name in zip(coefficients, names, strict=True) if c]
    terms.sort(key=lambda term: term[0] < 0)
    words = [f"{'-' if c < 0 else '+'} {'' if abs(c) == 1 else f'{abs(c):.6g} '}{name}" for c, name in terms]
    if offset or not words:
        words.append(f"{'-' if offset < 0 else '+'} {abs(offset):.6g}")
    return " ".join(words).removeprefix("+ ")


@dataclass(frozen=True, eq=False)
class LinearLimit(Value):
    """`lower <= coefficients @ q + offset <= upper`: the limits of one tree joint, in terms of q.

    Attributes:
        joint: The tree joint with this limit; the limit of a mimic joint also limits its primary.
        coefficients: (n,).
        offset: [rad or m].
        lower: [rad or m], may be -inf.
        upper: [rad or m], may be +inf.
    """

    joint: str
    coefficients: Array
    offset: float
    lower: float
    upper: float

    def values(self, Q: ArrayLike) -> Array:
        """Return the joint's values `c . q + o` (N,) for Q (N, n) [rad or m]."""
        return combination(self.coefficients, np.asarray(Q, dtype=np.float64)) + self.offset

    def holds(self, Q: ArrayLike) -> Flags:
        """Return which rows (N,) of Q (N, n) keep the limit; `Intervals` defines this at the ends.

        Example:
            >>> LinearLimit("f", np.array([3.0]), 0.0, -0.3, 0.3).holds([[0.1], [0.1 + 1e-12]])  # 3 * 0.1 > 0.3
            array([ True, False])
        """
        return self._interval.hold(np.asarray(Q, dtype=np.float64))

    def holds_at(self, q: Sequence[float]) -> bool:
        """Return `holds` for one q, by plain Python."""
        return self._interval.holds_at(q)

    @cached_property
    def _interval(self) -> Intervals:
        return Intervals.of([self], len(self.coefficients))


@dataclass(frozen=True, eq=False)
class GuardedLimit(Value):
    """One end of a rule that applies under conditions only: `limit` applies to q where all of `where` hold.

    The set that it forbids is convex: q satisfies every condition, and passes the end. Conditions are closed, as limits
    are: a condition that is passed by at most `tolerances.LIMIT` still holds.

    Attributes:
        limit: The end, as a limit with one finite end; its `joint` is the rule's name.
        where: The conditions, as limits.

    Example:
        >>> end = LinearLimit("front", np.array([1.0, 0.0]), 0.0, -0.3, math.inf)
        >>> low = LinearLimit("front", np.array([0.0, 1.0]), 0.0, -math.inf, 0.0)
        >>> GuardedLimit(end, (low,)).holds(np.array([[-0.5, 0.0], [-0.5, 0.1], [-0.3, -1.0]]))
        array([False,  True,  True])
    """

    limit: LinearLimit
    where: tuple[LinearLimit, ...]

    @property
    def rule(self) -> str:
        """The rule's name."""
        return self.limit.joint

    @property
    def name(self) -> str:
        """The rule and the end, named like ends of joint limits, e.g. ``"front lower"``."""
        return f"{self.rule} {'upper' if math.isfinite(self.limit.upper) else 'lower'}"

    @property
    def uses(self) -> Flags:
        """(n,) whether it depends on each coordinate."""
        return np.any([one.coefficients != 0.0 for one in (self.limit, *self.where)], axis=0)

    def holds(self, Q: Array) -> Flags:
        """Return which rows (N,) of Q (N, n) keep it: the end holds, or a condition does not; False if not finite."""
        kept = self.limit.holds(Q)
        for condition in self.where:
            kept |= ~condition.holds(Q)
        return kept & np.all(np.isfinite(Q), axis=1)

    def holds_at(self, q: Sequence[float]) -> bool:
        """Return `holds` for one q, by plain Python."""
        return self.limit.holds_at(q) or (
            all(map(math.isfinite, q)) and not all(condition.holds_at(q) for condition in self.where)
        )


@dataclass(frozen=True, eq=False)
class Intervals(Value):
    """Closed intervals of linear combinations of q, all of which must hold; and q must be finite.

    This is the one definition of "within a limit": a joint's value `c . q + o` may pass an end of its limits by
    `tolerances.LIMIT`, and by the rounding of that sum.

    Attributes:
        coefficients: (k, n); the first n rows are the coordinates themselves.
        low: (k,) [rad or m].
        high: (k,).
        is_sum: (k,) whether the combination has several terms, whose rounding is allowed in addition.
        guarded: Ends of rules that apply under conditions only, all of which must hold, too.
    """

    coefficients: Array
    low: Array
    high: Array
    is_sum: Flags
    guarded: tuple[GuardedLimit, ...] = ()

    @classmethod
    def of(
        cls,
        limits: Sequence[LinearLimit],
        n: int,
        between: Sequence[tuple[Array, tuple[float, float]]] = (),
        guarded: Sequence[GuardedLimit] = (),
    ) -> Intervals:
        """Return joint limits and open intervals `low < c . q < high`; rows with the same c are intersected."""
        rows = {tuple(row): [-_LARGEST, _LARGEST, 0.0] for row in np.eye(n).tolist()}
        for limit in limits:
            c = limit.coefficients
            scale = float(c[np.flatnonzero(c)[0]]) if np.count_nonzero(c) == 1 else 1.0
            ends: list[float] = []
            for end, side in ((limit.lower, -1.0), (limit.upper, 1.0)):
                granted = LIMIT + 4.0 * UNIT_ROUNDOFF * (abs(end) + abs(limit.offset))
                ends.append((end - limit.offset + side * granted) / scale)
            row = rows.setdefault(tuple((c / scale + 0.0).tolist()), [-_LARGEST, _LARGEST, 0.0])
            row[0], row[1] = max(row[0], min(ends)), min(row[1], max(ends))
            row[2] = max(row[2], float(np.count_nonzero(c) > 1))
        for c, (low, high) in between:
            row = rows.setdefault(tuple((c + 0.0).tolist()), [-_LARGEST, _LARGEST, 0.0])
            inside = math.nextafter(low, math.inf), math.nextafter(high, -math.inf)
            row[0], row[1] = max(inside[0], row[0]), min(inside[1], row[1])  # NaN (home on a contact line) stays
        table = np.array(list(rows.values())).reshape(-1, 3)
        C = np.array(list(rows)).reshape(len(rows), n)
        return cls(C, table[:, 0].copy(), table[:, 1].copy(), table[:, 2] > 0.0, tuple(guarded))

    def holds_at(self, q: Sequence[float]) -> bool:
        """Return `hold` for one q, by plain Python."""
        for terms, low, high, is_sum in self._rows:
            value, size = 0.0, 0.0
            for index, c in terms:
                value += c * q[index]
                size += abs(c) * abs(q[index])
            rounding = UNIT_ROUNDOFF * (len(q) + 2.0) * size if is_sum else 0.0
            if not low - rounding <= value <= high + rounding:
                return False
        return all(one.holds_at(q) for one in self.guarded)

    @cached_property
    def _rows(self) -> list[tuple[list[tuple[int, float]], float, float, bool]]:
        terms = [[(int(i), float(c[i])) for i in np.flatnonzero(c)] for c in self.coefficients]
        return list(zip(terms, self.low.tolist(), self.high.tolist(), self.is_sum.tolist(), strict=True))

    def split(self) -> tuple[Array, Array, Intervals | None]:
        """Return the ends (n,) of the coordinates themselves, and all other intervals; None if there are none."""
        n = self.coefficients.shape[1]
        if len(self.coefficients) == n and not self.guarded:
            return self.low, self.high, None
        rest = slice(n, None)
        others = Intervals(self.coefficients[rest], self.low[rest], self.high[rest], self.is_sum[rest], self.guarded)
        return self.low[:n], self.high[:n], others

    def hold(self, Q: Array) -> Flags:
        """Return which rows (N,) of Q (N, n) are in all intervals; False for a row that is not finite."""
        found = np.ones(len(Q), dtype=np.bool_)
        for start in range(0, len(Q), _BLOCK):
            block, ok = Q[start : start + _BLOCK].T.copy().T, found[start : start + _BLOCK]
            with np.errstate(invalid="ignore", over="ignore"):
                for c, low, high, is_sum in zip(self.coefficients, self.low, self.high, self.is_sum, strict=True):
                    value = combination(c, block)
                    if is_sum:
                        rounding = UNIT_ROUNDOFF * (len(c) + 2.0) * combination(np.abs(c), np.abs(block))
                        ok &= (value >= low - rounding) & (value <= high + rounding)
                        continue
                    ok &= value >= low
                    ok &= value <= high
                for one in self.guarded:
                    ok &= one.holds(block)
        return found


def combination(c: Array, Q: Array) -> Array:
    """Return `c . q` (N,) for the rows of Q (N, n), term by term: the bits of a row do not depend on other rows."""
    total: Array | None = None
    for index in np.flatnonzero(c).tolist():
        factor, column = float(c[index]), Q[:, index]
        term = column if factor == 1.0 else factor * column
        total = term if total is None else total + term
    return np.zeros(len(Q)) if total is None else total


def real_array(values: Any, what: str) -> Array:
    """Return values as float64; values that are not real numbers are refused.

    Raises:
        DimensionError: If a value is complex, masked, a text or a date, or the rows have different lengths.

    Example:
        >>> real_array([1, 2.5], "q").tolist()
        [1.0, 2.5]
        >>> real_array([1.0, 2.0 + 1.0j], "q")
        Traceback (most recent call last):
        pinbound.exceptions.DimensionError: q is complex; give real numbers
    """
    given: Any = values
    # NumPy imports its masked arrays when they are first named, for 10 ms: users of them have imported them.
    is_masked = "numpy.ma" in sys.modules and isinstance(given, np.ma.MaskedArray)
    if is_masked and np.any(cast(Any, np.ma).getmaskarray(given)):
        raise DimensionError(f"{what} has masked entries; fill them or leave their rows out")
    try:
        raw: NDArray[Any] = np.asarray(cast(Any, given))
        if raw.dtype.kind == "c":
            raise DimensionError(f"{what} is complex; give real numbers")
        is_text = raw.dtype.kind in "SUmM" or (raw.dtype == object and any(isinstance(x, str) for x in raw.flat))
        if is_text:
            raise DimensionError(f"{what} is not an array of numbers: its type is {raw.dtype}; give numbers")
        return np.asarray(raw, dtype=np.float64)
    except (TypeError, ValueError) as error:
        if isinstance(error, DimensionError):
            raise
        raise DimensionError(f"{what} is not an array of numbers ({error}); give numbers") from error


def as_configurations(Q: ArrayLike, coordinates: Sequence[str]) -> Array:
    """Return Q as float64 with last axis n, one (n,) or many (N, n); non-finite rows pass through.

    Raises:
        DimensionError: If Q is not numeric, has another shape, or is a data frame whose columns have other names or
            another order.
    """
    columns = getattr(Q, "columns", None)
    if columns is not None and [str(name) for name in columns] != list(coordinates):
        wanted = ", ".join(coordinates)
        raise DimensionError(f"the columns of q are {', '.join(map(str, columns))}; give them in the order {wanted}")
    array = real_array(Q, "q")
    if array.ndim not in (1, 2) or array.shape[-1] != len(coordinates):
        names = ", ".join(coordinates)
        n = len(coordinates)
        raise DimensionError(f"q has shape {array.shape}; give ({n},) or (N, {n}), the last axis being: {names}")
    return array


def coordinate_index(name: str, coordinates: Sequence[str]) -> int:
    """Return the index of a coordinate.

    Raises:
        UnknownNameError: If it does not exist; also if the argument is not a name (an array by mistake).
    """
    if str(name) not in coordinates:
        raise UnknownNameError("coordinate", name, coordinates)
    return coordinates.index(str(name))


def couple(joints: Sequence[Joint]) -> Coupling:
    """Resolve every chain of mimic joints down to the active joints.

    A joint without `mimic` is active. `theta_f = m theta_p + o` is applied repeatedly, for any order of declaration;
    the URDF reader has refused cycles.

    Raises:
        UnsupportedError: If a chain of mimic joints overflows float64.
    """
    mimics = {joint.name: joint.mimic for joint in joints if joint.mimic is not None}
    active = tuple(joint.name for joint in joints if joint.name not in mimics)
    S, offset = np.zeros((len(joints), len(active))), np.zeros(len(joints))
    for row, joint in enumerate(joints):
        chain = _flatten(joint.name, mimics)
        S[row, active.index(chain.primary)] = chain.multiplier
        offset[row] = chain.offset
    return Coupling(active, tuple(joint.name for joint in joints), S, offset)


def _flatten(name: str, mimics: dict[str, Mimic]) -> Mimic:
    """Return the active joint that a joint follows in the end, in exact arithmetic, rounded once.

    Offsets of a chain may cancel (`0.1 * 1e6 - 1e5` is 5.55e-12 for the float64 nearest to 0.1, and 0 if it is rounded
    in between). Rounded once, multiplier and offset have an error of half a digit, for any chain.
    """
    primary, multiplier, offset = name, Fraction(1), Fraction(0)
    while primary in mimics:
        step = mimics[primary]
        primary, offset = step.primary, multiplier * Fraction(step.offset) + offset
        multiplier *= Fraction(step.multiplier)
    try:
        return Mimic(primary, float(multiplier), float(offset))
    except OverflowError as error:
        message = f"joint {name!r} follows {primary!r} through a chain whose multipliers or offsets overflow float64"
        raise UnsupportedError(f"{message}; mend its <mimic> elements") from error


def linear_limits(joints: Sequence[Joint], coupling: Coupling) -> tuple[LinearLimit, ...]:
    """Return the limits of every tree joint that has some, active joints and followers alike."""
    limits: list[LinearLimit] = []
    for joint in joints:
        if math.isfinite(joint.lower) or math.isfinite(joint.upper):
            coefficients, offset = coupling.row(joint.name)
            limits.append(LinearLimit(joint.name, coefficients, offset, joint.lower, joint.upper))
    return tuple(limits)


def narrowed_by_mimics(joints: Sequence[Joint], coupling: Coupling, limits: Sequence[LinearLimit]) -> list[str]:
    """Return a note for every limit of a mimic joint that allows its primary less than the primary's own limits do.

    A mimic joint `theta = m q_j + o` within `[l, u]` keeps q_j between `(l - o) / m` and `(u - o) / m`. Gripper fingers
    that mirror each other often repeat the limits of their primary, and so fix it.
    """
    own = {joint.name: (joint.lower, joint.upper) for joint in joints}
    notes: list[str] = []
    for limit in limits:
        moved = [index for index, coefficient in enumerate(limit.coefficients) if coefficient]
        if limit.joint in coupling.coordinates or len(moved) != 1:
            continue
        primary, slope = coupling.coordinates[moved[0]], float(limit.coefficients[moved[0]])
        ends = sorted(((limit.lower - limit.offset) / slope, (limit.upper - limit.offset) / slope))
        lower, upper = max(ends[0], own[primary][0]) + 0.0, min(ends[1], own[primary][1]) + 0.0
        if lower - own[primary][0] <= FOLLOWS and own[primary][1] - upper <= FOLLOWS:
            continue
        what = f"the limits of mimic joint {limit.joint!r} ({limit.lower:.6g} .. {limit.upper:.6g})"
        left = f"{lower:.6g} .. {upper:.6g}" if lower <= upper else "nothing"
        whole = f"{own[primary][0]:.6g} .. {own[primary][1]:.6g}"
        notes.append(f"{what} reduce the range of {primary!r} from {whole} to {left}")
    return notes
