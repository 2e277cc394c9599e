"""One coordinate at a time: contact angles and allowed arcs in closed form.

If a coordinate turns one rotation of a chain, then for the other coordinates fixed `r = p + R(u, phi) s` and

    |r|^2 = h^2 + (|p| - |s|)^2 + 4 |p| |s| sin^2((phi - phi*) / 2),

with p and s taken across u, h the sum of both along u, and phi* the angle at which R s points against p. The norm
is smallest at phi*; it is at or below a threshold t on the strip `phi* +- w`, sin^2(w / 2) = (t^2 - m^2) / (4 |p| |s|),
where m is the smallest norm. The form in sin^2 keeps full accuracy near contact. See `docs/contacts.md`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pinbound.exceptions import UnsupportedError
from pinbound.path import Chain, rotation_matrix
from pinbound.tolerances import REDUCTION

__all__ = ["AllowedArcs", "Strip", "allowed_arcs", "one_angle_strip", "strip"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Strip:
    """Where `|p + R(u, phi) s|` is in contact: `phi = angle +- half_width`, every turn.

    Attributes:
        angle: phi* [rad], in (-pi, pi].
        half_width: w [rad]: None if there is no contact, 0 if the two arms just align, pi if there is always.
        smallest: m [m], the smallest norm over a turn.
    """

    angle: float
    half_width: float | None
    smallest: float


@dataclass(frozen=True)
class AllowedArcs:
    """The allowed values of one coordinate, the others fixed.

    Attributes:
        coordinate: Its name.
        intervals: (k, 2) open intervals [rad or m] of one period, ascending; ends are contacts or infinite.
        period: [rad]; the intervals repeat every period, or not at all if it is infinite.

    Example:
        >>> arcs = AllowedArcs("q1", np.array([[-1.0, 2.0]]), 2 * np.pi)
        >>> arcs.around(0.5), arcs.around(2.5), arcs.contains(-1.5)
        ((-1.0, 2.0), None, False)
    """

    coordinate: str
    intervals: Array
    period: float

    def around(self, value: float) -> tuple[float, float] | None:
        """Return the allowed interval that holds `value`, or None."""
        for lower, upper in self.intervals:
            turns = 0.0
            if math.isfinite(self.period) and math.isfinite(lower):
                turns = self.period * math.floor((value - lower) / self.period)
            if lower + turns < value < upper + turns:
                return float(lower + turns), float(upper + turns)
        return None

    def contains(self, value: float) -> bool:
        """Return whether `value` is allowed."""
        return self.around(value) is not None


def strip(p: Array, s: Array, axis: Array, threshold: float, tolerance: float) -> Strip:
    """Return the contact strip of `|p + R(axis, phi) s| <= threshold` (formula: this module's).

    Args:
        p: (3,) [m], the part that stands still.
        s: (3,) [m], the part that turns.
        axis: (3,) unit vector.
        threshold: t [m].
        tolerance: [m]. A smallest norm up to this still counts as contact, at the aligned angle: data are rounded.
    """
    height = float(axis @ (p + s))
    p_across, s_across = p - axis * (axis @ p), s - axis * (axis @ s)
    length_p, length_s = float(np.linalg.norm(p_across)), float(np.linalg.norm(s_across))
    smallest = math.hypot(height, length_p - length_s)
    angle = math.atan2(float(axis @ np.cross(s_across, -p_across)), float(-s_across @ p_across))
    rounding = REDUCTION * (length_p + length_s + abs(height))
    if smallest > max(threshold, tolerance) + rounding:  # equal arms must not come out unequal by an ulp
        return Strip(angle, None, smallest)
    if threshold <= smallest:
        return Strip(angle, 0.0, smallest)
    room, reach = (threshold - smallest) * (threshold + smallest), 4.0 * length_p * length_s
    half_width = math.pi if room >= reach else 2.0 * math.asin(math.sqrt(room / reach))
    return Strip(angle, half_width, smallest)


def one_angle_strip(chain: Chain, threshold: float, tolerance: float) -> tuple[Array, Strip] | None:
    """Return the effective angle's coefficients (n,) and its contact strip, if the chain is of one angle.

    The effective angle is `c . q`, signed so that the last coefficient that is not zero is positive.
    """
    if chain.rotations != 1 or np.any(chain.slides):
        return None
    axis, c = chain.axes[0], chain.coefficients[0]
    sign = float(np.sign(c[np.flatnonzero(c)[-1]]))
    return sign * c + 0.0, strip(chain.offsets[0], chain.offsets[1], sign * axis, threshold, tolerance)


def allowed_arcs(chain: Chain, index: int, name: str, q: Array, threshold: float, tolerance: float) -> AllowedArcs:
    """Return the values of coordinate `index` with `|r| > threshold`, the other coordinates as in q.

    Raises:
        UnsupportedError: If the path uses the coordinate more than once, or slides along it.
    """
    turned = np.flatnonzero(chain.coefficients[:, index])
    everything = np.array([[-math.inf, math.inf]])
    if np.any(chain.slides[:, :, index]) or len(turned) > 1:
        raise UnsupportedError(
            f"the path uses {name!r} more than once, or slides along it; closed-form arcs need one rotation"
        )
    if not len(turned):
        allowed = float(np.linalg.norm(_parts(chain, -1, q)[0])) > max(threshold, tolerance)
        return AllowedArcs(name, everything if allowed else np.empty((0, 2)), math.inf)
    place = int(turned[0])
    c = float(chain.coefficients[place, index])
    rest = float(np.delete(chain.coefficients[place], index) @ np.delete(q, index))
    found = strip(*_parts(chain, place, q), chain.axes[place], threshold, tolerance)
    if found.half_width is None:
        return AllowedArcs(name, everything, math.inf)
    if found.half_width >= math.pi:
        return AllowedArcs(name, np.empty((0, 2)), math.inf)
    period = 2.0 * math.pi / abs(c)
    centre, half_width = (found.angle - rest) / c, found.half_width / abs(c)
    lower = centre + half_width
    lower -= period * math.floor((lower + period / 2) / period)
    return AllowedArcs(name, np.array([[lower, lower + period - 2.0 * half_width]]), period)


def _parts(chain: Chain, place: int, q: Array) -> tuple[Array, Array]:
    """Return p and s of `r = p + R s`, R being the rotation at `place`, in the frame just before it.

    For place -1 the whole of r is p.
    """
    blocks = chain.offsets + chain.slides @ q
    s = np.zeros(3)
    for i in reversed(range(max(place, 0), chain.rotations)):
        s = blocks[i + 1] + _turn(chain, i + 1, q) @ s if i + 1 < chain.rotations else blocks[i + 1]
    if place < 0:
        return blocks[0] + (_turn(chain, 0, q) @ s if chain.rotations else 0.0), np.zeros(3)
    p = blocks[0]
    for i in range(place):
        p = _turn(chain, i, q).T @ p + blocks[i + 1]
    return p, s


def _turn(chain: Chain, index: int, q: Array) -> Array:
    return rotation_matrix(chain.axes[index], float(chain.coefficients[index] @ q))
