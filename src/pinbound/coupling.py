"""Coupled joints: `theta = S q + o`, from followers of followers to the coordinates that the user commands."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pinbound.exceptions import DimensionError
from pinbound.tolerances import FOLLOWS
from pinbound.urdf import Joint, Mimic

__all__ = [
    "Coupling",
    "LinearLimit",
    "as_configurations",
    "couple",
    "linear_limits",
    "linear_text",
    "narrowed_by_mimics",
]


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


def as_configurations(Q: ArrayLike, coordinates: Sequence[str]) -> NDArray[np.float64]:
    """Return Q as float64 with last axis n, one (n,) or many (N, n); non-finite rows pass through.

    Raises:
        DimensionError: If Q is not numeric, or has another shape.
    """
    try:
        array = np.asarray(Q, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise DimensionError(f"q is no array of numbers: {error}") from error
    if array.ndim not in (1, 2) or array.shape[-1] != len(coordinates):
        names = ", ".join(coordinates)
        n = len(coordinates)
        raise DimensionError(f"q has shape {array.shape}; give ({n},) or (N, {n}), the last axis being: {names}")
    return array


def couple(joints: Sequence[Joint]) -> Coupling:
    """Flatten every chain of followers down to the active joints.

    A joint without `mimic` is active. `theta_f = m theta_p + o` is applied repeatedly, whatever the order of
    declaration; the URDF reader has refused cycles.
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
    flat = Mimic(name, 1.0, 0.0)
    while flat.primary in mimics:
        step = mimics[flat.primary]
        flat = Mimic(step.primary, flat.multiplier * step.multiplier, flat.multiplier * step.offset + flat.offset)
    return flat


def linear_limits(joints: Sequence[Joint], coupling: Coupling) -> tuple[LinearLimit, ...]:
    """Return the limits of every tree joint that has some, active joints and followers alike."""
    limits: list[LinearLimit] = []
    for joint in joints:
        if math.isfinite(joint.lower) or math.isfinite(joint.upper):
            coefficients, offset = coupling.row(joint.name)
            limits.append(LinearLimit(joint.name, coefficients, offset, joint.lower, joint.upper))
    return tuple(limits)


def narrowed_by_mimics(joints: Sequence[Joint], coupling: Coupling, limits: Sequence[LinearLimit]) -> list[str]:
    """Return a note for every limit of a mimic joint that leaves its primary less than the primary's own limits do.

    A mimic joint `theta = m q_j + o` within `[l, u]` keeps q_j between `(l - o) / m` and `(u - o) / m`. Gripper fingers
    that mirror each other often keep the limits of their primary, and so freeze it.
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
        notes.append(f"{what} leave {left} of {own[primary][0]:.6g} .. {own[primary][1]:.6g} to {primary!r}")
    return notes
