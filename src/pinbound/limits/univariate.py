"""Contact angles and allowed arcs of one coordinate, with the others fixed.

If a coordinate occurs in one rotation of a chain, and the other coordinates are fixed, `r = p + R(u, phi) s` and

    |r|^2 = h^2 + (|p| - |s|)^2 + 4 |p| |s| sin^2((phi - phi*) / 2),

where p and s are the parts perpendicular to u, h is the sum of both parts along u, and phi* is the angle at which R s
is opposite to p. The norm is smallest at phi*. It is at most t on the strip `phi* +- w`, sin^2(w / 2) = (t^2 - m^2) /
(4 |p| |s|), where m is the smallest norm. The form with sin^2 keeps full accuracy near contact. If a coordinate only
translates, `r = p + d x`, and contact is `|x - x*| <= sqrt(t^2 - m^2) / |d|`. Above a plane the height is `m + 2 D
sin^2((phi - phi*) / 2)`, which gives a strip, too. All this is evaluated for many q at once. In all other cases
`isolation` finds all roots with a proof; for segments and lines, `piecewise_isolation` does, or `prismatic` if the
coordinate only translates them. See `docs/limits.md` and `docs/segments.md`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from pinbound.evaluate import numeric
from pinbound.path.chain import Chain
from pinbound.path.kind import Case
from pinbound.path.relative import RelativePath
from pinbound.tolerances import REDUCTION
from pinbound.typing import Array
from pinbound.values import Value

__all__ = [
    "AllowedArcs",
    "AllowedArcsTable",
    "Strip",
    "allowed_arcs_table",
    "gap_around",
    "one_angle_smallest",
    "one_angle_strip",
    "one_angle_strips",
    "strip",
]


@dataclass(frozen=True)
class Strip:
    """The contact strip of `|p + R(u, phi) s|`: `phi = angle +- half_width`, repeated every turn.

    Attributes:
        angle: phi* [rad], in (-pi, pi].
        half_width: w [rad]: None: no contact; 0: contact only where the two arms align; pi: contact at every angle.
        smallest: m [m], the smallest norm over a turn.
    """

    angle: float
    half_width: float | None
    smallest: float


@dataclass(frozen=True, eq=False)
class AllowedArcs(Value):
    """The allowed values of one coordinate, with the others fixed.

    Attributes:
        coordinate: Its name.
        intervals: (k, 2) open intervals [rad or m] of one period, ascending. An end is a contact, infinite, or an end
            of the window.
        period: [rad]; the intervals repeat with this period; infinite: they do not repeat.
        window: [rad or m], the range in which the intervals were found; infinite unless the coordinate has no period.

    Example:
        >>> arcs = AllowedArcs("q1", np.array([[-1.0, 2.0]]), 2 * np.pi)
        >>> arcs.around(0.5), arcs.around(2.5), arcs.contains(-1.5)
        ((-1.0, 2.0), None, False)
    """

    coordinate: str
    intervals: Array
    period: float
    window: tuple[float, float] = (-math.inf, math.inf)

    def around(self, value: float) -> tuple[float, float] | None:
        """Return the interval (2,) that holds `value`, or None; it includes an end of the window (no contact)."""
        for lower, upper in self.intervals:
            turns = 0.0
            if math.isfinite(self.period) and math.isfinite(lower):
                turns = self.period * math.floor((value - lower) / self.period)
            edges = lower == value == self.window[0] or upper == value == self.window[1]
            if edges or lower + turns < value < upper + turns:
                return float(lower + turns), float(upper + turns)
        return None

    def contains(self, value: float) -> bool:
        """Return whether `value` is allowed."""
        return self.around(value) is not None


@dataclass(frozen=True, eq=False)
class AllowedArcsTable(Value):
    """The allowed values of one coordinate, for many configurations of the others.

    Attributes:
        coordinate: Its name.
        intervals: (N, k, 2) as in `AllowedArcs`; rows with fewer than k intervals end in NaN.
        period: (N,) [rad].
        window: [rad or m], as in `AllowedArcs`.

    Example:
        >>> import pinbound as pb
        >>> table = pb.load("minervabot_v3").boundaries["beta_4"].limits("q3", np.zeros((2, 3)))
        >>> table.intervals.shape, np.degrees(table.around(np.zeros(2))[0]).round(3).tolist()
        ((2, 1, 2), [-327.571, 32.429])
    """

    coordinate: str
    intervals: Array
    period: Array
    window: tuple[float, float] = (-math.inf, math.inf)

    def __len__(self) -> int:
        """Return N."""
        return len(self.intervals)

    def __getitem__(self, row: int) -> AllowedArcs:
        """Return the arcs of one configuration."""
        intervals = self.intervals[row]
        return AllowedArcs(self.coordinate, intervals[~np.isnan(intervals[:, 0])], float(self.period[row]), self.window)

    def around(self, values: Array) -> Array:
        """Return the allowed interval (N, 2) that holds each value (N,); NaN where the value is not allowed."""
        found = np.full((len(self), 2), np.nan)
        with np.errstate(invalid="ignore"):
            for slot in range(self.intervals.shape[1]):
                lower, upper = self.intervals[:, slot, 0], self.intervals[:, slot, 1]
                repeats = np.isfinite(self.period) & np.isfinite(lower)
                turns = np.where(repeats, self.period * np.floor((values - lower) / self.period), 0.0)
                lower, upper = lower + turns, upper + turns
                holds = (lower < values) & (values < upper)
                holds |= (lower == values) & (values == self.window[0]) | (upper == values) & (values == self.window[1])
                found[holds] = np.stack((lower, upper), axis=1)[holds]
        return found


def strips(p: Array, s: Array, axis: Array, threshold: float, tolerance: float) -> tuple[Array, Array, Array]:
    """Return `phi*` (N,), `w` (N,) and `m` (N,) of the contact strips `|p + R(axis, phi) s| <= threshold`.

    Args:
        p: (N, 3) [m], the fixed parts.
        s: (N, 3) [m], the rotating parts.
        axis: (3,) unit vector.
        threshold: t [m].
        tolerance: [m]. A smallest norm up to this is contact at the aligned angle; infinite for a stop.

    Returns:
        Angles in (-pi, pi], half widths (NaN: no contact; 0: only where the arms align; pi: always), smallest norms
        [m].
    """
    height = (p + s) @ axis
    p_perpendicular, s_perpendicular = p - np.outer(p @ axis, axis), s - np.outer(s @ axis, axis)
    length_p, length_s = np.linalg.norm(p_perpendicular, axis=1), np.linalg.norm(s_perpendicular, axis=1)
    smallest = np.hypot(height, length_p - length_s)
    angle = np.arctan2(
        np.cross(s_perpendicular, -p_perpendicular) @ axis, -np.einsum("ni,ni->n", s_perpendicular, p_perpendicular)
    )
    room, reach = (threshold - smallest) * (threshold + smallest), 4.0 * length_p * length_s
    with np.errstate(invalid="ignore", divide="ignore"):
        share = np.sqrt(np.clip(room / reach, 0.0, 1.0))
    half_width = np.where(room >= reach, math.pi, 2.0 * np.arcsin(np.nan_to_num(share)))
    half_width = np.where(threshold <= smallest, 0.0, half_width)
    rounding = REDUCTION * (length_p + length_s + np.abs(height))  # equal arms must not come out unequal by an ulp
    half_width[~(smallest <= max(threshold, tolerance) + rounding)] = np.nan
    return angle, half_width, smallest


def strip(p: Array, s: Array, axis: Array, threshold: float, tolerance: float) -> Strip:
    """Return the contact strip of one p (3,) and s (3,); see `strips`."""
    angle, half_width, smallest = (float(x[0]) for x in strips(p[None], s[None], axis, threshold, tolerance))
    return Strip(angle, None if math.isnan(half_width) else half_width, smallest)


def gap_around(angle: float, half_width: float, phi: float) -> tuple[float, float]:
    """Return the open interval around phi without contact `angle +- half_width` (every turn); NaN if in contact."""
    turn = 2.0 * math.pi
    turns = math.floor((phi - angle) / turn)
    lower = angle + turns * turn + half_width
    upper = angle + (turns + 1) * turn - half_width
    return (lower, upper) if lower < phi < upper else (math.nan, math.nan)


def height_strips(p: Array, s: Array, axis: Array, normal: Array, threshold: float) -> tuple[Array, Array, Array]:
    """Return `phi*` (N,), `w` (N,) and `m` (N,) of the contact strips `n . (p + R(axis, phi) s) <= threshold`.

    Args:
        p: (N, 3) [m], the fixed parts.
        s: (N, 3) [m], the rotating parts.
        axis: (3,) unit vector.
        normal: (N, 3) unit vectors n.
        threshold: t [m].
    """
    along = s @ axis
    perpendicular = s - np.outer(along, axis)
    cosine, sine = np.einsum("ni,ni->n", normal, perpendicular), np.einsum("ni,ni->n", normal, np.cross(axis, s))
    swing = np.hypot(cosine, sine)
    smallest = np.einsum("ni,ni->n", normal, p) + (normal @ axis) * along - swing
    angle = np.arctan2(-sine, -cosine)
    room, reach = threshold - smallest, 2.0 * swing
    with np.errstate(invalid="ignore", divide="ignore"):
        share = np.sqrt(np.clip(room / reach, 0.0, 1.0))
    half_width = np.where(room >= reach, math.pi, 2.0 * np.arcsin(np.nan_to_num(share)))
    half_width[~(smallest <= threshold)] = np.nan
    return angle, half_width, smallest


def one_angle(chain: Chain) -> tuple[Array, Array] | None:
    """Return the coefficients (n,) of the one effective angle, the last positive, and its axis; None if several."""
    if chain.rotations != 1 or np.any(chain.slides):
        return None
    axis, c = chain.axes[0], chain.coefficients[0]
    sign = float(np.sign(c[np.flatnonzero(c)[-1]]))
    return sign * c + 0.0, sign * axis


def one_angle_strips(path: RelativePath, threshold: float, tolerance: float) -> tuple[Array, tuple[Strip, ...]] | None:
    """Return the coefficients (n,) of the effective angle and all contact strips; None if there are several angles.

    Two points, or a point and a plane, have one strip; its half width is None if there is no contact. Segments may have
    several strips; without contact they have one such strip, too. The tolerance, as in `strips`, applies to two points
    only.
    """
    found = one_angle(path.minimal)
    if found is None:
        return None
    coefficients, axis = found
    return coefficients, _of(path).one_angle(path, axis, threshold, tolerance)


def one_angle_smallest(path: RelativePath) -> float | None:
    """Return a tight lower bound of the separation over a turn [m] if the path has one effective angle; else None."""
    return None if one_angle(path.minimal) is None else _of(path).smallest(path)


def one_angle_strip(chain: Chain, threshold: float, tolerance: float) -> tuple[Array, Strip] | None:
    """Return the coefficients (n,) of the effective angle and its contact strip, if the chain has one angle.

    The effective angle is `c . q`; its sign is chosen so that the last nonzero coefficient is positive.
    """
    found = one_angle(chain)
    if found is None:
        return None
    return found[0], strip(chain.offsets[0], chain.offsets[1], found[1], threshold, tolerance)


def allowed_arcs_table(
    path: RelativePath,
    index: int,
    name: str,
    Q: Array,
    threshold: float,
    tolerance: float,
    window: tuple[float, float] | None = None,
) -> AllowedArcsTable:
    """Return the values of coordinate `index` with a separation above the threshold; other coordinates are those of Q.

    The contact rule (`contact`) decides threshold and tolerance.

    Args:
        path: The reduced path.
        index: The coordinate.
        name: Its name.
        Q: (N, n) finite.
        threshold: t [m].
        tolerance: [m], as in `strips`, for coordinates in one rotation, or that only translate.
        window: The range in which to search if the coordinate has no period.

    Raises:
        UnsupportedError: If no finite window is given, and the coordinate both rotates and translates, or rotates by
            angles without a common period.
    """
    chain = path.minimal
    turned = np.flatnonzero(chain.coefficients[:, index])
    slides = bool(np.any(chain.slides[:, :, index]))
    if len(turned) == 1 and not slides and path.is_harmonic:
        return _turning(path, index, int(turned[0]), name, Q, threshold, tolerance)
    if not len(turned):
        return _of(path).prismatic(path, index, name, Q, threshold, tolerance, window)
    from pinbound.limits import isolated

    found, periods, ends = isolated.arcs(path, index, name, Q, threshold, window)
    intervals = np.full((len(found), max((len(one) for one in found), default=1) or 1, 2), np.nan)
    for number, one in enumerate(found):
        intervals[number, : len(one)] = one
    return AllowedArcsTable(name, intervals, np.array(periods), ends)


def _turning(
    path: RelativePath, index: int, place: int, name: str, Q: Array, threshold: float, tolerance: float
) -> AllowedArcsTable:
    chain = path.minimal
    c = float(chain.coefficients[place, index])
    others = chain.coefficients[place].copy()
    others[index] = 0.0
    angle, half_width = _of(path).turning(path, place, Q, threshold, tolerance)
    period = 2.0 * math.pi / abs(c)
    lower = (angle - Q @ others) / c + half_width / abs(c)
    lower -= period * np.floor((lower + period / 2) / period)
    intervals = np.stack((lower, lower + period - 2.0 * half_width / abs(c)), axis=1)
    free, blocked = np.isnan(half_width), half_width >= math.pi
    intervals[free] = -math.inf, math.inf
    intervals[blocked] = np.nan
    return AllowedArcsTable(name, intervals[:, None, :], np.where(free | blocked, math.inf, period))


def _point_intervals(chain: Chain, index: int, Q: Array, threshold: float, tolerance: float) -> Array:
    """Return the free intervals (N, 2, 2) of `r = p + d x`; with d zero, r is p and the norm decides."""
    rest = Q.copy()
    rest[:, index] = 0.0
    p, J = numeric.jacobian(chain, rest)
    d = J[:, :, index]
    speed = np.linalg.norm(d, axis=1)
    moves = speed > REDUCTION
    with np.errstate(invalid="ignore", divide="ignore"):
        nearest = np.where(moves, -np.einsum("ni,ni->n", p, d) / (speed * speed), 0.0)
        smallest = np.linalg.norm(p + d * nearest[:, None], axis=1)
        room = (threshold - smallest) * (threshold + smallest)
        half_width = np.where(moves, np.sqrt(np.maximum(room, 0.0)) / speed, math.inf)
    intervals = np.full((len(Q), 2, 2), np.nan)
    free = ~(smallest <= max(threshold, tolerance))
    intervals[free, 0] = -math.inf, math.inf
    cut = ~free & moves
    intervals[cut, 0, 0], intervals[cut, 0, 1] = -math.inf, (nearest - half_width)[cut]
    intervals[cut, 1, 0], intervals[cut, 1, 1] = (nearest + half_width)[cut], math.inf
    return intervals


class _Points:
    """Closed forms of two points."""

    @staticmethod
    def turning(path: RelativePath, place: int, Q: Array, threshold: float, tolerance: float) -> tuple[Array, Array]:
        p, s = _parts(path.minimal, place, Q)
        return strips(p, s, path.minimal.axes[place], threshold, tolerance)[:2]

    @staticmethod
    def one_angle(path: RelativePath, axis: Array, threshold: float, tolerance: float) -> tuple[Strip, ...]:
        p, s = path.minimal.offsets
        return (strip(p, s, axis, threshold, tolerance),)

    @staticmethod
    def smallest(path: RelativePath) -> float:
        p, s = path.minimal.offsets
        return strip(p, s, path.minimal.axes[0], 0.0, 0.0).smallest

    @staticmethod
    def prismatic(
        path: RelativePath,
        index: int,
        name: str,
        Q: Array,
        threshold: float,
        tolerance: float,
        window: tuple[float, float] | None,
    ) -> AllowedArcsTable:
        found = _point_intervals(path.minimal, index, Q, threshold, tolerance)
        return AllowedArcsTable(name, found, np.full(len(Q), math.inf))


class _Bodies:
    """Marks whose contacts along an angle have no closed form: they are isolated with a proof."""

    turning = _Points.turning  # of one rotation of points alone

    @staticmethod
    def one_angle(path: RelativePath, axis: Array, threshold: float, tolerance: float) -> tuple[Strip, ...]:
        from pinbound.limits.piecewise_isolation import smallest, turn_arcs

        free, (_, m) = turn_arcs(path, threshold), smallest(path)
        if not len(free):
            return (Strip(0.0, math.pi, m),)
        if not math.isfinite(free[0, 0]):
            return (Strip(0.0, None, m),)
        ends = np.stack((free[:, 1], np.append(free[1:, 0], free[0, 0] + 2.0 * math.pi)), axis=1)
        middle, half = ends.mean(axis=1), 0.5 * (ends[:, 1] - ends[:, 0])
        middle -= 2.0 * math.pi * np.ceil((middle - math.pi) / (2.0 * math.pi))
        return tuple(Strip(float(a), float(w), m) for a, w in zip(middle, half, strict=True))

    @staticmethod
    def smallest(path: RelativePath) -> float:
        from pinbound.limits.piecewise_isolation import smallest

        return smallest(path)[0]

    @staticmethod
    def prismatic(
        path: RelativePath,
        index: int,
        name: str,
        Q: Array,
        threshold: float,
        tolerance: float,
        window: tuple[float, float] | None,
    ) -> AllowedArcsTable:
        from pinbound.limits.prismatic import intervals

        found, never = intervals(path, index, Q, threshold), np.full(len(Q), math.inf)
        if window is None:
            return AllowedArcsTable(name, found, never)
        found = np.clip(found, *window)
        found[found[:, :, 0] >= found[:, :, 1]] = np.nan
        return AllowedArcsTable(name, np.take_along_axis(found, np.argsort(found, axis=1), axis=1), never, window)


class _Height(_Bodies):
    """Closed forms of a point above a plane."""

    @staticmethod
    def turning(path: RelativePath, place: int, Q: Array, threshold: float, tolerance: float) -> tuple[Array, Array]:
        chain = path.minimal
        rows = np.zeros_like(chain.offsets)
        rows[0] = path.height_row()
        normal = _parts(replace(chain, offsets=rows, slides=np.zeros_like(chain.slides)), place, Q)[0]
        return height_strips(*_parts(chain, place, Q), chain.axes[place], normal, threshold)[:2]

    @staticmethod
    def one_angle(path: RelativePath, axis: Array, threshold: float, tolerance: float) -> tuple[Strip, ...]:
        p, s = path.minimal.offsets
        normal = path.height_row()[None]
        angle, half_width, m = (float(x[0]) for x in height_strips(p[None], s[None], axis, normal, threshold))
        return (Strip(angle, None if math.isnan(half_width) else half_width, m),)


def _of(path: RelativePath) -> type[_Points] | type[_Bodies]:
    """Return the closed forms that a path has: the one place that asks for its case."""
    return {Case.POINTS: _Points, Case.PLANE: _Height}[path.case] if path.is_harmonic else _Bodies


def _parts(chain: Chain, place: int, Q: Array) -> tuple[Array, Array]:
    """Return p and s (N, 3) of `r = p + R s`, R being the rotation at `place`, in the frame just before it."""
    return numeric.positions(chain.before(place).reversed(), Q), numeric.positions(chain.behind(place), Q)
