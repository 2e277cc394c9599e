"""The window of a slice: the range of each of its two coordinates, and the limits that end it.

The limits of the coordinate's joint, of its mimic joints, and the caller's window bound one coordinate alone. The
tightest one is the side of the box. If none exists, a limit of both coordinates may help: from `c_1 x_1 + c_2 x_2 <= u`
and the ends of x_2 follow ends of x_1.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from pinbound.exceptions import DimensionError, UnknownNameError
from pinbound.region.halfplanes import HalfPlane
from pinbound.tolerances import WIDEST_WINDOW
from pinbound.typing import Array

__all__ = ["box_of", "slab"]

_PLANE = 2
_ROUNDS = 4  # of propagation of limits of both coordinates; each round can bound one more coordinate
_SPARE = 0.01  # of its width: the margin added to a box that follows only from limits of both coordinates


def slab(source: str, normal: Array, lower: float, upper: float) -> list[HalfPlane]:
    """Return the half-planes `normal @ x <= upper` and `normal @ x >= lower`, if finite."""
    sides = ((f"{source} upper", normal, upper), (f"{source} lower", -normal, -lower))
    return [HalfPlane(source, name, n, bound, False) for name, n, bound in sides if math.isfinite(bound)]


def box_of(
    names: Sequence[str], limits: Sequence[HalfPlane], window: Mapping[str, tuple[float, float]]
) -> tuple[HalfPlane, HalfPlane, HalfPlane, HalfPlane]:
    """Return the box of the two coordinates in the order right, top, left, low.

    Args:
        names: The two coordinates.
        limits: Every limit that depends on one or both of them.
        window: The caller's ends, by coordinate.

    Raises:
        UnknownNameError: If the window names another coordinate.
        DimensionError: If the window does not have two ordered numbers, if a coordinate is without limits (an end
            beyond `tolerances.WIDEST_WINDOW` does not count), or if its range is empty.
    """
    given = _checked(names, window)
    usable = [side for side in limits if _end(side) <= WIDEST_WINDOW]
    ends: dict[tuple[int, int], HalfPlane] = {}
    for side in (*usable, *given):
        axis = _only_axis(side)
        if axis is None:
            continue
        key = (axis, 1 if side.normal[axis] > 0.0 else -1)
        if key not in ends or _at(side, axis) * key[1] < _at(ends[key], axis) * key[1]:
            ends[key] = side
    _propagate(ends, [side for side in usable if _only_axis(side) is None])
    for axis, name in enumerate(names):
        if (axis, 1) not in ends or (axis, -1) not in ends:
            raise DimensionError(
                f"{name!r} has no limits{_too_far(name, limits)}; give window={{{name!r}: (lower, upper)}} around the "
                f"start (on the command line --window {name}=LOWER..UPPER)"
            )
        lower, upper = _at(ends[axis, -1], axis), _at(ends[axis, 1], axis)
        if not lower < upper:
            raise DimensionError(
                f"{name!r} has no range: its window and limits leave [{lower}, {upper}]; give a wider window"
            )
    return ends[0, 1], ends[1, 1], ends[0, -1], ends[1, -1]


def _checked(names: Sequence[str], window: Mapping[str, tuple[float, float]]) -> list[HalfPlane]:
    """Return the half-planes of a given window."""
    found: list[HalfPlane] = []
    for name, ends in window.items():
        if name not in names:
            raise UnknownNameError("coordinate of the window", name, names)
        try:
            lower, upper = (float(end) for end in ends)
        except (TypeError, ValueError):
            lower = upper = math.nan
        if math.isnan(lower) or math.isnan(upper) or lower > upper:
            raise DimensionError(f"the window of {name!r} is {ends!r}; give two numbers (lower, upper), lower first")
        axis = list(names).index(name)
        for sign, end, which in ((1.0, upper, "upper"), (-1.0, lower, "lower")):
            if abs(end) <= WIDEST_WINDOW:
                label = f"{name} window {which}"
                found.append(HalfPlane(name, label, sign * np.eye(_PLANE)[axis], sign * end, False))
    return found


def _only_axis(side: HalfPlane) -> int | None:
    """Return the one coordinate that a half-plane bounds; None if it bounds both together."""
    used = np.flatnonzero(side.normal)
    return int(used[0]) if len(used) == 1 else None


def _at(side: HalfPlane, axis: int) -> float:
    return side.bound / float(side.normal[axis])


def _end(side: HalfPlane) -> float:
    """Return the distance from zero of a half-plane's line, along its steepest axis."""
    return abs(side.bound) / float(np.max(np.abs(side.normal)))


def _too_far(name: str, limits: Sequence[HalfPlane]) -> str:
    """Return the limits of a coordinate that are too far out to count, as text."""
    far = [side for side in limits if side.source == name and _end(side) > WIDEST_WINDOW]
    ends = " and ".join(f"{side.name} of {side.bound * (-1 if side.name.endswith('lower') else 1):.6g}" for side in far)
    return f" within {WIDEST_WINDOW:.0e} of zero ({ends}: too far out to count)" if far else ""


def _propagate(ends: dict[tuple[int, int], HalfPlane], sides: Sequence[HalfPlane]) -> None:
    """Bound coordinates without ends by limits of both coordinates, with a small margin."""
    found: dict[tuple[int, int], tuple[float, HalfPlane]] = {}
    for _ in range(_ROUNDS):
        for side in sides:
            for axis in (0, 1):
                key = (axis, 1 if side.normal[axis] > 0.0 else -1)
                other = 1 - axis
                far = (other, -1 if side.normal[other] > 0.0 else 1)  # the end at which the other one helps most
                if key in ends or (far not in ends and far not in found):
                    continue
                place = _at(ends[far], other) if far in ends else found[far][0]
                end = (side.bound - float(side.normal[other]) * place) / float(side.normal[axis])
                if key not in found or end * key[1] < found[key][0] * key[1]:
                    found[key] = (end, side)
    for (axis, sign), (end, side) in found.items():
        opposite = (axis, -sign)
        place = _at(ends[opposite], axis) if opposite in ends else found[opposite][0] if opposite in found else end
        wide = end + sign * (_SPARE * abs(end - place) + _SPARE)
        ends[axis, sign] = HalfPlane(side.source, side.name, sign * np.eye(_PLANE)[axis], sign * wide, False)
