"""Planar loops of four sides: whether they are parallelograms, and the deviation from one if their sides differ.

A closure gives `sum_i R(g_i . q) V_i = 0` over its distinct angles. It is a parallelogram if four terms remain whose
lengths agree in two pairs, and the terms of each pair are opposite in the assembled pose. `docs/closures.md` proves the
result of `deviations`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pinbound.loops.closures import Closure
from pinbound.path.chain import Chain
from pinbound.tolerances import CLOSURE_SHARE, EXACT_LOOP, FLAT, INFLATION, REDUCTION
from pinbound.typing import Array
from pinbound.values import Value

__all__ = ["Parallelogram", "Refusal", "Side", "apart_along", "deviations", "parallelogram"]

_SIDES = 4
_PAIRINGS = (((0, 1), (2, 3)), ((0, 2), (1, 3)), ((0, 3), (1, 2)))
_ROUNDS = 200
_STEP = 1.0 + 1e-6
_MEND = "Couple the joints of the loop by <mimic>, or correct its pins"


@dataclass(frozen=True, eq=False)
class Side(Value):
    """One side of a planar loop: `R(angle . q) vector`.

    Attributes:
        angle: (n,) coefficients.
        vector: (3,) [m], perpendicular to the axis, in the frame of the loop at zero angle.
    """

    angle: Array
    vector: Array

    @property
    def length(self) -> float:
        """The length [m]."""
        return float(np.linalg.norm(self.vector))


@dataclass(frozen=True)
class Refusal:
    """Why a loop is not accepted as a parallelogram, and what to do.

    `is_other`: whether it is certainly not a parallelogram, so that it may be a loop of another form (`solving`).
    """

    reason: str
    remedy: str
    is_other: bool = False


@dataclass(frozen=True, eq=False)
class Parallelogram(Value):
    """A loop whose opposite sides stay parallel, except for the effect of the difference of its sides.

    Attributes:
        pairs: The two pairs of opposite sides.
        small: Sides that are not longer than the tolerance.
        rows: (2, n), `rows @ q = constant` holds where the sides of each pair are parallel.
        constant: (2,) [rad], in the turn of the assembled pose.
        shape: [rad], the angle from the first side of the first pair to that of the second pair, in the assembled pose.
        size: [m], the length of the path around the loop.
    """

    pairs: tuple[tuple[Side, Side], tuple[Side, Side]]
    small: tuple[Side, ...]
    rows: Array
    constant: Array
    shape: float
    size: float

    @property
    def differences(self) -> tuple[float, float]:
        """The difference of the sides of each pair [m]."""
        (a, b), (c, d) = self.pairs
        return abs(a.length - b.length), abs(c.length - d.length)

    @property
    def mismatch(self) -> float:
        """The total difference of the sides [m], with small sides and the lengths that the reduction took for zero.

        It is zero if the loop is exact: then all differences are only rounding. Otherwise all of them count.
        """
        total = sum(self.differences) + sum(side.length for side in self.small)
        return 0.0 if total <= EXACT_LOOP * self.size else total + _SIDES * REDUCTION * self.size


def apart_along(chain: Chain) -> float:
    """Return the distance of the two pins of a planar loop along the axis of its joints [m]."""
    return abs(float(chain.offsets[0] @ chain.axes[0])) if chain.rotations else 0.0


def parallelogram(
    closure: Closure, names: Sequence[str], reference: Array, coupled: Array | None = None
) -> Parallelogram | Refusal:
    """Return a loop as a parallelogram, or why it is not one.

    Args:
        closure: The closure, with its path over the coordinates `names`.
        names: Names of the coordinates (n).
        reference: (n,) the assembled pose.
        coupled: (n, m), directions of q in which the joints of the loop are already coupled, so that the coupling and
            not the pose says which sides stay parallel; None: only the pose says it.
    """
    chain, tolerance = closure.path.minimal, closure.tolerance
    moving = ", ".join(names[index] for index in chain.coordinates)
    if not chain.rotations and not np.any(chain.slides):
        gap = float(np.linalg.norm(chain.offsets[0]))
        message = f"its joints are coupled, or fixed, so that this gap of {1e3 * gap:.6g} mm is the same in every pose"
        return Refusal(message, "Correct xyz_a or xyz_b of the pin (in the frame of its link), or the joints' origins")
    if not chain.rotations or not chain.is_planar or np.any(chain.slides):
        return Refusal(f"it is not a planar loop of revolute joints ({moving})", _MEND, is_other=True)
    apart = apart_along(chain)
    if apart > tolerance:
        return Refusal(f"its two pins are {1e3 * apart:.6g} mm apart along the axis of its joints", _MEND)
    axis = chain.axes[0]
    every = _sides(chain)
    sides = [side for side in every if side.length > tolerance]
    small = [side for side in every if side.length <= tolerance]
    lengths = ", ".join(f"{1e3 * side.length:.9g}" for side in sides)
    if len(sides) != _SIDES:
        return Refusal(f"it has {len(sides)} sides of {lengths} mm, a parallelogram has 4", _MEND, is_other=True)
    room = tolerance - sum(side.length for side in small)
    across = [pairing for pairing in _PAIRINGS if _difference(sides, pairing) <= room]
    if not across:
        return _unequal(closure, sides, lengths, sum(side.length for side in small))
    turned = [_turn(axis, float(side.angle @ reference), side.vector) for side in sides]
    if coupled is None:
        gap, allowed = (
            float(np.linalg.norm(np.sum(turned, axis=0))),
            2.0 * tolerance,
        )  # their difference, and the digits of home
        if gap > allowed:
            message = f"it is open by {1e3 * gap:.6g} mm in the pose that home gives, so its assembly is not known"
            return Refusal(f"{message} (sides of {lengths} mm)", f"Let home name an assembled pose of {moving}")
        found = [p for p in across if all(np.linalg.norm(turned[i] + turned[j]) <= allowed for i, j in p)]
        refusal = _ambiguous(axis, turned, across, found, allowed, lengths, moving)
        if refusal:
            return refusal
    else:
        found = [
            p
            for p in across
            if all(np.abs((sides[i].angle - sides[j].angle) @ coupled).max(initial=0.0) <= EXACT_LOOP for i, j in p)
        ]
        if len(found) != 1:
            return Refusal(f"its sides of {lengths} mm do not stay parallel in pairs as its joints are coupled", _MEND)
    first, second = found[0]
    rows = np.array([sides[i].angle - sides[j].angle for i, j in found[0]])
    constant = np.array([_apart(axis, sides[i].vector, -sides[j].vector) for i, j in found[0]])
    turns = np.round((rows @ reference - constant) / (2 * math.pi))
    return Parallelogram(
        ((sides[first[0]], sides[first[1]]), (sides[second[0]], sides[second[1]])),
        tuple(small),
        rows,
        constant + 2 * math.pi * turns,
        _apart(axis, turned[first[0]], turned[second[0]]),
        closure.size,
    )


def _ambiguous(
    axis: Array,
    turned: Sequence[Array],
    across: Sequence[tuple[tuple[int, int], ...]],
    found: Sequence[tuple[tuple[int, int], ...]],
    allowed: float,
    lengths: str,
    moving: str,
) -> Refusal | None:
    """Return why the pose does not determine the assembly of a loop; None if it does."""
    (i, _), (k, _) = (found or across)[0]
    angle = math.remainder(_apart(axis, turned[i], turned[k]), math.pi)
    first, second = (float(np.linalg.norm(turned[index])) for index in (i, k))
    diagonal = float(np.linalg.norm(turned[i] + turned[k]))
    between = 2.0 * first * second * abs(math.sin(angle)) / diagonal if diagonal else 0.0  # of the assemblies' pins
    if abs(angle) <= FLAT or between <= 4.0 * allowed or len(found) > 1:
        far = f" (within {abs(math.degrees(angle)):.3g} deg)" if angle else ""
        message = f"it is flat in the pose that home gives{far}, so both assemblies fit (sides of {lengths} mm)"
        return Refusal(message, f"Let home name a pose of {moving} in which it is not flat")
    if found:
        return None
    if (0, 2) == across[0][0] or len(across) > 1:
        message = f"it is assembled as an anti-parallelogram (sides of {lengths} mm): its opposite sides cross"
    else:
        message = f"it is a kite (sides of {lengths} mm): sides of equal length are neighbours, not opposite"
    return Refusal(message, _MEND, is_other=True)


def _unequal(closure: Closure, sides: Sequence[Side], lengths: str, small: float) -> Refusal:
    """Return by how much the sides of a loop differ, and whether this looks like rounding of the data."""
    least = small + min(_difference(sides, pairing) for pairing in _PAIRINGS)
    message = f"its sides of {lengths} mm are not equal in two pairs"
    if least > min(CLOSURE_SHARE, 1e-3) * closure.size:
        return Refusal(message, _MEND, is_other=True)
    message += f": they differ by {_microns(least)} um, its tolerance is {_microns(closure.tolerance)} um"
    power = 10.0 ** math.floor(math.log10(least))
    enough = math.ceil(least / power * (1.0 + 1e-9)) * power
    remedy = f"Give equal sides; or, if this is rounding of the data, give the closure the tolerance {enough:.1g}"
    return Refusal(message, f"{remedy} (metres), and its effect on the links' places is added to the distances kept")


def _microns(length: float) -> str:
    return f"{1e6 * length:.6g}"


def _sides(chain: Chain) -> list[Side]:
    """Return the terms of a planar chain by distinct cumulative angle; the chain is reduced, so no term is zero."""
    axis = chain.axes[0]
    terms = zip(chain.planar_angles, chain.offsets, strict=True)
    sides = [Side(g, offset - axis * (axis @ offset)) for g, offset in terms]
    return [side for side in sides if side.length > REDUCTION * chain.scale]


def _difference(sides: Sequence[Side], pairing: tuple[tuple[int, int], ...]) -> float:
    return sum(abs(sides[i].length - sides[j].length) for i, j in pairing)


def _turn(axis: Array, angle: float, vector: Array) -> Array:
    return vector * math.cos(angle) + np.cross(axis, vector) * math.sin(angle)


def _apart(axis: Array, v: Array, w: Array) -> float:
    """Return the angle about the axis from v to w; it is exactly zero if the difference is only rounding."""
    angle = math.atan2(float(axis @ np.cross(v, w)), float(v @ w))
    return 0.0 if abs(angle) <= REDUCTION else angle


def deviations(
    lengths: tuple[float, float], mismatch: float, small: float, swing: float, shape: tuple[float, float]
) -> tuple[float, float] | None:
    """Bound the angle between opposite sides of a loop while its shape is in a range.

    With `m = mismatch`, `s = small`, `c = swing`, `k_1 = 1 / (l_1 sin)`, `k_2 = 1 / (l_2 sin)`, where sin is the least
    sine over the range, widened by X on both sides: if `S = m (k_1 + k_2) / (1 - s c (k_1 + k_2)) <= X`, then the loop
    closes for every shape of the range, and `|delta_1| <= k_1 (m + s c S)`, `|delta_2| <= k_2 (m + s c S)`.

    Args:
        lengths: The shorter side of each pair [m].
        mismatch: The total difference of the sides, with small sides [m].
        small: The sum of the small sides' lengths [m].
        swing: The largest rotation of a small side for a deviation of one of the first or second pair.
        shape: Smallest and largest angle between the pairs [rad].

    Returns:
        `(delta_1, delta_2)` [rad], the deviations from parallel; None if the loop comes so near its flat pose, at a
        multiple of pi, that there is no such bound.

    Example:
        >>> import math
        >>> first, second = deviations((0.25, 0.1), 1e-6, 0.0, 0.0, (math.radians(30), math.radians(150)))
        >>> round(1e6 * first, 3), round(1e6 * second, 3)
        (8.0, 20.001)
        >>> deviations((0.25, 0.1), 1e-6, 0.0, 0.0, (-0.1, 0.1)) is None
        True
    """
    if mismatch == 0.0:
        return 0.0, 0.0
    lower, upper = shape
    nearest = _to_flat(lower, upper)
    widest = 0.0
    for _ in range(_ROUNDS):
        room = nearest - widest
        if room <= 0.0:
            return None
        sine = math.sin(min(room, 0.5 * math.pi))
        k_1, k_2 = 1.0 / (lengths[0] * sine), 1.0 / (lengths[1] * sine)
        held = 1.0 - small * swing * (k_1 + k_2)
        if held <= 0.0:
            return None
        total = mismatch * (k_1 + k_2) / held * INFLATION
        if total <= widest:
            most = (mismatch + small * swing * total) * INFLATION
            return k_1 * most, k_2 * most
        widest = total * _STEP
    return None


def _to_flat(lower: float, upper: float) -> float:
    """Return the distance of an interval of angles from the nearest multiple of pi [rad]; negative inside."""
    below = math.floor(lower / math.pi) * math.pi
    return min(lower - below, below + math.pi - upper)
