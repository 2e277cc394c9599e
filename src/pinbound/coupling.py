"""Coupled joints: `theta = S q + o`, from followers of followers to the coordinates that the user commands."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pinbound.exceptions import DimensionError, UnsupportedError
from pinbound.urdf import Joint, Mimic

__all__ = ["Coupling", "LinearLimit", "as_configurations", "couple", "linear_limits", "linear_text", "real_array"]


@dataclass(frozen=True)
class Coupling:
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
    S: NDArray[np.float64]
    offset: NDArray[np.float64]

    def expand(self, Q: ArrayLike) -> NDArray[np.float64]:
        """Return `theta = S q + o` for one q (n,) or many (N, n); shape (n_tree,) or (N, n_tree).

        Raises:
            DimensionError: If the last axis of Q is not n long.
        """
        with np.errstate(invalid="ignore"):  # a row that is not finite gives NaN, and no warning
            return as_configurations(Q, self.coordinates) @ self.S.T + self.offset

    def row(self, joint: str) -> tuple[NDArray[np.float64], float]:
        """Return the coefficients (n,) and the offset of one tree joint."""
        index = self.joints.index(joint)
        return self.S[index], float(self.offset[index])

    def text(self, joint: str) -> str:
        """Return what a joint does in terms of q, for people.

        Example:
            >>> Coupling(("q1",), ("q1", "f"), np.array([[1.0], [-2.0]]), np.array([0.0, 0.5])).text("f")
            '- 2 q1 + 0.5'
        """
        coefficients, offset = self.row(joint)
        return linear_text(coefficients, self.coordinates, offset)


def linear_text(coefficients: NDArray[np.float64], names: Sequence[str], offset: float = 0.0) -> str:
    """Return `c . q + o` for people, positive terms first.

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


@dataclass(frozen=True)
class LinearLimit:
    """`lower <= coefficients @ q + offset <= upper`: the limits of one tree joint, said of q.

    Attributes:
        joint: The tree joint whose limit it is; a follower's limit binds its primary.
        coefficients: (n,).
        offset: [rad or m].
        lower: [rad or m], may be -inf.
        upper: [rad or m], may be +inf.
    """

    joint: str
    coefficients: NDArray[np.float64]
    offset: float
    lower: float
    upper: float


def real_array(values: Any, what: str) -> NDArray[np.float64]:
    """Return values as float64; nothing that is not a real number passes for one.

    Raises:
        DimensionError: If a value is complex, masked, a text or a date, or the rows have different lengths.

    Example:
        >>> real_array([1, 2.5], "q").tolist()
        [1.0, 2.5]
        >>> real_array([1.0, 2.0 + 1.0j], "q")
        Traceback (most recent call last):
        pinbound.exceptions.DimensionError: q holds complex numbers; give real ones
    """
    given: Any = values
    if isinstance(given, np.ma.MaskedArray) and np.any(cast(Any, np.ma).getmaskarray(given)):
        raise DimensionError(f"{what} has masked entries; fill them or leave their rows out")
    try:
        raw: NDArray[Any] = np.asarray(cast(Any, given))
        if raw.dtype.kind == "c":
            raise DimensionError(f"{what} holds complex numbers; give real ones")
        is_text = raw.dtype.kind in "SUmM" or (raw.dtype == object and any(isinstance(x, str) for x in raw.flat))
        if is_text:
            raise DimensionError(f"{what} is no array of numbers: its type is {raw.dtype}")
        return np.asarray(raw, dtype=np.float64)
    except (TypeError, ValueError) as error:
        if isinstance(error, DimensionError):
            raise
        raise DimensionError(f"{what} is no array of numbers: {error}") from error


def as_configurations(Q: ArrayLike, coordinates: Sequence[str]) -> NDArray[np.float64]:
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


def couple(joints: Sequence[Joint]) -> Coupling:
    """Flatten every chain of followers down to the active joints.

    A joint without `mimic` is active. `theta_f = m theta_p + o` is applied repeatedly, whatever the order of
    declaration; the URDF reader has refused cycles.

    Raises:
        UnsupportedError: If a chain of followers overflows float64.
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
    """Return what a joint follows in the end, in exact arithmetic, rounded once.

    Offsets of a chain may cancel (`0.1 * 1e6 - 1e5` is 5.55e-12 for the float64 nearest to 0.1, and 0 if it is rounded
    on the way); rounded once, multiplier and offset are off by half a digit of themselves, whatever the chain.
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
