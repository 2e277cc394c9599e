"""Planar loops in closed form: four-bar, five-bar and slider-crank, with derivatives, as numbers or intervals.

The part of a loop that active joints move is a complex number X(z) in the plane of the loop. Two passive joints close
the loop. `docs/loops.md` derives the three forms:

    ARMS       X + Y e^(i alpha) + Z e^(i beta) = 0        two arms of fixed length, pinned to each other
    SLIDE      X + s + Y e^(i alpha) = 0                   an arm, and a slide that is fixed to X's frame
    TELESCOPE  X + e^(i alpha) (s + i b) = 0               a slide that turns with the arm, b beside its pivot

Each form has two solutions, its assemblies. They meet where the *transmission* w reaches an end of its range: a toggle.
Beyond it, the formulas continue with w fixed at its end, so that they are defined everywhere; a limit of w forbids
this.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np

from pinbound.bounds.intervals import Interval
from pinbound.loops.jets import Jet, arctan2, cos, jet_root, quotient_rate, ratio, root_below, sin, sqrt, squared
from pinbound.tolerances import TOGGLE
from pinbound.typing import Array
from pinbound.values import Value

__all__ = ["Form", "Linkage", "Solution"]


class Form(Enum):
    """The form of the part that closes a loop."""

    ARMS = "two arms"
    SLIDE = "an arm and a prismatic joint"
    TELESCOPE = "an arm with a prismatic joint in it"


@dataclass(frozen=True, eq=False)
class Solution:
    """The values of a linkage's passive joints, and its transmission.

    Attributes:
        first: Value of the first passive joint [rad or m].
        second: Value of the second passive joint.
        transmission: w, without unit: its range is `Linkage.transmission_range`.
        turn: The angle of X from its reference [rad], if X can go around zero; else None.
    """

    first: Jet
    second: Jet
    transmission: Jet
    turn: Jet | None


@dataclass(frozen=True, eq=False)
class Linkage(Value):
    """A loop with two passive joints, solved.

    `X = sum_k (vectors_k + slides_k . z) e^(i angles_k . z)`; the passive joints are
    `mix @ (alpha, beta or s) + rows @ z + offset`.

    Attributes:
        name: The closure's name.
        form: The form of the part that closes it.
        angles: (m, n) coefficients of the angles of the terms of X, over all coordinates z.
        vectors: (m, 2) [m].
        slides: (m, 2, n) [m per unit].
        lengths: (Y, Z) of ARMS [m], (Y, 0) of SLIDE, (b, 0) of TELESCOPE.
        sign: +1 or -1, the assembly.
        passive: Indices of its passive joints in z.
        mix: (2, 2), integers.
        rows: (2, n).
        offset: (2,) [rad or m], with whole turns such that the values at home are the given ones.
        ahead: Index of the term that is longer than all others together (X cannot go around zero), or -1; not for
            SLIDE.
        reference: [rad], reference for the angle of X if there is no such term.
    """

    name: str
    form: Form
    angles: Array
    vectors: Array
    slides: Array
    lengths: tuple[float, float]
    sign: float
    passive: tuple[int, int]
    mix: Array
    rows: Array
    offset: Array
    ahead: int
    reference: float

    @property
    def inputs(self) -> tuple[int, ...]:
        """Indices of the coordinates in z that move it."""
        used = np.any(self.angles, axis=0) | np.any(self.slides, axis=(0, 1)) | np.any(self.rows, axis=0)
        return tuple(int(index) for index in np.flatnonzero(used))

    @property
    def transmission_range(self) -> tuple[float, float]:
        """The ends of w at which it toggles, moved inwards by `tolerances.TOGGLE`."""
        most = math.sqrt((1.0 - TOGGLE) * (1.0 + TOGGLE))
        if self.form is Form.TELESCOPE:
            return self.lengths[0] ** 2 + (TOGGLE * self._size) ** 2, math.inf
        return -most, most

    @property
    def _least_ahead(self) -> float:
        """Half the least part of X along the term that is longer than all others together [m]; else zero."""
        if self.ahead < 0:
            return 0.0
        lengths = np.linalg.norm(self.vectors, axis=1)
        return 0.5 * max(float(2.0 * lengths[self.ahead] - lengths.sum()), 0.0)

    @property
    def _size(self) -> float:
        """The largest length of X [m], without prismatic joints."""
        return float(np.linalg.norm(self.vectors, axis=1).sum())

    def moved(self, z: list[Jet]) -> tuple[Jet, Jet]:
        """Return X (real and imaginary part) at the coordinates `z`; coordinates that are None do not occur."""
        x: Jet | None = None
        y: Jet | None = None
        for row, vector, slides in zip(self.angles, self.vectors, self.slides, strict=True):
            u, v = vector.tolist()
            angle, slid = _linear(row, z), [_linear(slide, z) for slide in slides]
            zero = z[self.inputs[0]].times(0.0)
            parts = [(part or zero).plus(start) for part, start in zip(slid, (u, v), strict=True)]
            if angle is not None:
                c, s = angle.turned()
                if np.any(slides):
                    parts = [parts[0] * c - parts[1] * s, parts[0] * s + parts[1] * c]
                else:
                    parts = [c.times(u) - s.times(v), s.times(u) + c.times(v)]
            x = parts[0] if x is None else x + parts[0]
            y = parts[1] if y is None else y + parts[1]
        assert x is not None
        assert y is not None
        return x, y

    def solve(self, z: list[Jet]) -> Solution:
        """Return the passive joints for the other coordinates `z`; unused entries of z do not matter."""
        x, y = self.moved(z)
        ask = {Form.ARMS: self._arms, Form.SLIDE: self._slide, Form.TELESCOPE: self._telescope}[self.form]
        return ask(x, y, z)

    @property
    def turns_with_x(self) -> Array:
        """(2,) number of turns of the passive joints when X goes around once, with the arms fixed relative to it."""
        return self.mix @ np.array([1.0, 1.0 if self.form is Form.ARMS else 0.0])

    def values(self, z: Sequence[Array]) -> tuple[Array, ...]:
        """Return only the values of `solve`: both passive joints (N,), the transmission and, if it exists, the turn.

        Args:
            z: Columns (N,) of the coordinates; unused columns do not matter.
        """
        return self._settled(*self._moved_values(z), z)

    def slopes(
        self, z: Sequence[Array], ways: Sequence[Sequence[Array | float]]
    ) -> tuple[tuple[Array, ...], list[tuple[Array, ...]]]:
        """Return the result of `values`, and its first derivatives in some directions.

        Args:
            z: As for `values`.
            ways: The derivative of every coordinate in each direction, 0.0 for coordinates that do not move.
        """
        x, y, rates = self._moved_slopes(z, ways)
        return self._settled(x, y, z), [self._slope(x, y, *rate, way) for rate, way in zip(rates, ways, strict=True)]

    def _settled(self, x: Array, y: Array, z: Sequence[Array]) -> tuple[Array, ...]:
        """Return the passive joints, the transmission and the turn for X = (x, y)."""
        Y, Z = self.lengths
        most = 0.5 * TOGGLE
        flat = math.sqrt((1.0 - most) * (1.0 + most))
        turn: Array | None = None
        if self.form is Form.SLIDE:
            held = np.clip(y, -Y * flat, Y * flat)
            root = np.sqrt((Y - held) * (Y + held))
            one = self.sign * np.arctan2(-held, root) + (0.0 if self.sign > 0.0 else math.pi)
            other, w = -x - self.sign * root, y / Y
        else:
            turn, square = self._turn_values(x, y, z), x * x + y * y
            if self.form is Form.ARMS:
                held = np.clip(square, Y * Y + Z * Z - 2.0 * Y * Z * flat, Y * Y + Z * Z + 2.0 * Y * Z * flat)
                area = self.sign * np.sqrt(((Y + Z) ** 2 - held) * (held - (Y - Z) ** 2))
                one = turn + math.pi - np.arctan2(area, held - (Z * Z - Y * Y))
                other = one + np.arctan2(area, held - (Y * Y + Z * Z))
                w = (square - (Y * Y + Z * Z)) * (1.0 / (2.0 * Y * Z))
            else:
                low, _ = self.transmission_range
                held = np.maximum(square, Y * Y + 0.25 * (low - Y * Y))
                other, w = self.sign * np.sqrt(held - Y * Y), square
                one = turn + math.pi - np.arctan2(Y + 0.0, other)
        found: list[Array] = []
        for mix, row, offset in zip(self.mix.tolist(), self.rows, self.offset.tolist(), strict=True):
            total: Array | float = offset
            for factor, part in zip((*mix, *row.tolist()), (one, other, *z), strict=False):
                if factor:
                    total = total + (part if factor == 1.0 else factor * part)
            found.append(np.asarray(total))
        if self.ahead >= 0 or turn is None:
            return (*found, w)
        return (*found, w, turn - self.reference)

    def _moved_values(self, z: Sequence[Array]) -> tuple[Array, Array]:
        x: Array | float = 0.0
        y: Array | float = 0.0
        for row, vector, slides in zip(self.angles, self.vectors.tolist(), self.slides, strict=True):
            u, v = (start + _combined(slide, z) for start, slide in zip(vector, slides, strict=True))
            if np.any(row):
                angle = _combined(row, z)
                c, s = np.cos(angle), np.sin(angle)
                u, v = u * c - v * s, u * s + v * c
            x, y = x + u, y + v
        return np.asarray(x), np.asarray(y)

    def _moved_slopes(
        self, z: Sequence[Array], ways: Sequence[Sequence[Array | float]]
    ) -> tuple[Array, Array, list[tuple[Any, Any]]]:
        """Return X, and its derivatives in some directions."""
        x: Any = 0.0
        y: Any = 0.0
        rates: list[tuple[Any, Any]] = [(0.0, 0.0) for _ in ways]
        for row, vector, slides in zip(self.angles, self.vectors.tolist(), self.slides, strict=True):
            u, v = (start + _combined(slide, z) for start, slide in zip(vector, slides, strict=True))
            turns, c, s = bool(np.any(row)), 1.0, 0.0
            if turns:
                angle = _combined(row, z)
                c, s = np.cos(angle), np.sin(angle)
                u, v = u * c - v * s, u * s + v * c
            x, y = x + u, y + v
            for place, way in enumerate(ways):
                rate = _combined(row, way) if turns else 0.0
                du, dv = (_combined(slide, way) for slide in slides)
                dx, dy = rates[place]
                rates[place] = dx - v * rate + (c * du - s * dv), dy + u * rate + (s * du + c * dv)
        return np.asarray(x), np.asarray(y), rates

    def _slope(self, x: Array, y: Array, dx: Any, dy: Any, way: Sequence[Array | float]) -> tuple[Array, ...]:
        """Return the derivatives of the result of `_settled` for X = (x, y) with the rate (dx, dy)."""
        Y, Z = self.lengths
        most = 0.5 * TOGGLE
        flat = math.sqrt((1.0 - most) * (1.0 + most))
        dturn: Any = None
        if self.form is Form.SLIDE:
            held = np.clip(y, -Y * flat, Y * flat)
            root = np.sqrt((Y - held) * (Y + held))
            moved = np.where(held == y, dy, 0.0) / root
            one, other, w = -self.sign * moved, self.sign * held * moved - dx, dy / Y
        else:
            square, change = x * x + y * y, 2.0 * (x * dx + y * dy)
            if self.form is Form.ARMS:
                low, high = ((Y * Y + Z * Z + sign * 2.0 * Y * Z * flat) for sign in (-1.0, 1.0))
                held = np.clip(square, low, high)
                area = np.sqrt(((Y + Z) ** 2 - held) * (held - (Y - Z) ** 2))
                moved = self.sign * np.where(held == square, change, 0.0) / area
                dturn = (x * dy - y * dx) / held
                one = dturn + moved * (held + (Z * Z - Y * Y)) / (2.0 * held)
                other, w = one - moved, change * (1.0 / (2.0 * Y * Z))
            else:
                low, _ = self.transmission_range
                held = np.maximum(square, Y * Y + 0.25 * (low - Y * Y))
                other = self.sign * 0.5 * np.where(held == square, change, 0.0) / np.sqrt(held - Y * Y)
                dturn = (x * dy - y * dx) / held
                one, w = dturn + Y * other / held, change
        found: list[Array] = []
        for mix, row in zip(self.mix.tolist(), self.rows, strict=True):
            found.append(np.asarray(mix[0] * one + mix[1] * other + _combined(row, way)))
        return (*found, w) if self.ahead >= 0 or dturn is None else (*found, w, dturn)

    def _turn_values(self, x: Array, y: Array, z: Sequence[Array]) -> Array:
        if self.ahead < 0:
            return _turned_back(x, y, self.reference, None) + self.reference
        start = math.atan2(*self.vectors[self.ahead][::-1].tolist())
        lead = _combined(self.angles[self.ahead], z)
        if not np.any(self.angles[self.ahead]):
            return _turned_back(x, y, start, None) + start
        return _turned_back(x, y, start, lead) + start + lead

    def widened(self, found: Solution, error: float) -> Solution:
        """Return an interval solution, widened for a gap of `error` [m] from the rounded numbers of the loop.

        A gap e changes alpha and beta by at most e over the arm and the sine of the angle between the arms, and their
        derivatives relatively by this over the sine again. Twice and sixteen times that cover higher terms below 1e-3.
        """
        if self.form is Form.TELESCOPE:
            slide: Interval = found.second.value - float(self.offset[1])
            least = np.minimum(np.abs(slide.lower), np.abs(slide.upper))
            least = np.where((slide.lower > 0.0) | (slide.upper < 0.0), least, 0.0)
            least = np.maximum(least, 0.25 * TOGGLE * self._size)
            far = np.maximum(1.0, np.hypot(slide.magnitude, self.lengths[0]))
            off, flat = 2.0 * error * far / least, np.minimum(1.0, least / far)
        else:
            w: Interval = found.transmission.value
            most = np.minimum(w.magnitude, 1.0)
            flat = np.maximum(np.sqrt((1.0 - most) * (1.0 + most)), 0.25 * TOGGLE)
            arms = 1.0 / self.lengths[0] + (1.0 / self.lengths[1] if self.form is Form.ARMS else 1.0)
            off = 2.0 * error * arms / flat
        share = 16.0 * off / flat

        def wide(one: Jet) -> Jet:
            first, second = share * one.first.magnitude, share * (one.first.magnitude + one.second.magnitude)
            return Jet(
                one.value + Interval(-off, off),
                one.first + Interval(-first, first),
                one.second + Interval(-second, second),
            )

        turn = None if found.turn is None else wide(found.turn)
        return Solution(wide(found.first), wide(found.second), wide(found.transmission), turn)

    def _arms(self, x: Jet, y: Jet, z: list[Jet]) -> Solution:
        Y, Z = self.lengths
        square = x.squared() + y.squared()
        most = 0.5 * TOGGLE
        flat = math.sqrt((1.0 - most) * (1.0 + most))
        low, high = Y * Y + Z * Z - 2.0 * Y * Z * flat, Y * Y + Z * Z + 2.0 * Y * Z * flat
        held = square.clipped(low, high)
        area = _area(held, Y, Z)
        turn = self._angle(x, y, square, held, z)
        beyond = ratio(held.times(-self.sign), area)  # d phi = -s d(D^2) / S
        phi = Jet(arctan2(self.sign * area.value, held.value - (Y * Y + Z * Z)), beyond.first, beyond.second)
        aside = _aside(held, area, Y, Z, self.sign)
        alpha = turn.plus(math.pi) - aside
        return self._solution(alpha, alpha + phi, square.plus(-(Y * Y + Z * Z)).times(1.0 / (2.0 * Y * Z)), turn, z)

    def _slide(self, x: Jet, y: Jet, z: list[Jet]) -> Solution:
        Y = self.lengths[0]
        most = 0.5 * TOGGLE
        flat = Y * math.sqrt((1.0 - most) * (1.0 + most))
        held = y.clipped(-flat, flat)
        root = root_below(Y, held)  # sqrt(Y^2 - y^2), its derivative -y y' / root
        s = x.times(-1.0) - root.times(self.sign)
        rate = ratio(held.times(-self.sign), root)
        beta = Jet(self.sign * arctan2(-1.0 * held.value, root.value), rate.first, rate.second)
        beta = beta.plus(0.0 if self.sign > 0.0 else math.pi)
        return self._solution(beta, s, y.times(1.0 / Y), None, z)

    def _telescope(self, x: Jet, y: Jet, z: list[Jet]) -> Solution:
        b = self.lengths[0]
        square = x.squared() + y.squared()
        low, _ = self.transmission_range
        held = square.clipped(b * b + 0.25 * (low - b * b), math.inf)
        root = jet_root(held.plus(-b * b))
        s = root.times(self.sign)
        turn = self._angle(x, y, square, held, z)
        # the angle of (s, b): its derivative is -b s' / (s^2 + b^2)
        rate = quotient_rate(s.times(-b), held)
        within = Jet(arctan2(_like(b + 0.0, s.value), s.value), rate[0], rate[1])
        return self._solution(turn.plus(math.pi) - within, s, square, turn, z)

    def _solution(self, one: Jet, other: Jet, w: Jet, turn: Jet | None, z: list[Jet]) -> Solution:
        found: list[Jet] = []
        for mix, row, offset in zip(self.mix.tolist(), self.rows, self.offset.tolist(), strict=True):
            total = _linear(row, z)
            for factor, part in zip(mix, (one, other), strict=True):
                if factor:
                    scaled = part.times(factor)
                    total = scaled if total is None else total + scaled
            assert total is not None
            found.append(total.plus(offset))
        return Solution(found[0], found[1], w, None if self.ahead >= 0 or turn is None else turn.plus(-self.reference))

    def _angle(self, x: Jet, y: Jet, square: Jet, held: Jet, z: list[Jet]) -> Jet:
        """Return the angle of X: continuous if one term is ahead, else within half a turn of the reference."""
        if self.ahead >= 0:
            start = math.atan2(*self.vectors[self.ahead][::-1].tolist())
            lead = _linear(self.angles[self.ahead], z)
        else:
            start, lead = self.reference, None
        first, second = _angle_rates(x, y, held)
        value = _turned_back(x.value, y.value, start, None if lead is None else lead.value, self._least_ahead)
        value = value + start
        return Jet(value if lead is None else value + lead.value, first, second)


def _combined(row: Array, z: Sequence[Array | float]) -> Any:
    total: Any = 0.0
    for index in np.flatnonzero(row).tolist():
        c = float(row[index])
        total = total + (z[index] if c == 1.0 else c * z[index])
    return total


def _linear(row: Array, z: list[Jet]) -> Jet | None:
    total: Jet | None = None
    for index in np.flatnonzero(row).tolist():
        term = z[index].times(float(row[index]))
        total = term if total is None else total + term
    return total


def _angle_rates(x: Jet, y: Jet, square: Jet) -> tuple[Any, Any]:
    """Return the derivatives of the angle of (x, y): `(x y' - y x') / (x^2 + y^2)` and its own."""
    cross = x.value * y.first - y.value * x.first
    again = x.value * y.second - y.value * x.second
    first = cross / square.value
    return first, (again - first * square.first) / square.value


def _area(square: Jet, Y: float, Z: float) -> Jet:
    """Return `S = sqrt(4 Y^2 Z^2 - (D^2 - Y^2 - Z^2)^2)`, four times the triangle's area, from D^2."""
    outer, inner = (Y + Z) ** 2, (Y - Z) ** 2
    if isinstance(square.value, Interval):  # each occurs once: no wider than it must be
        value = sqrt((2.0 * Y * Z) * Interval.at(np.array(2.0 * Y * Z)) - (square.value - (Y * Y + Z * Z)).squared())
    else:
        value = sqrt((outer - square.value) * (square.value - inner))
    lead = square.plus(-(Y * Y + Z * Z))
    first = -(lead.value * square.first) / value
    second = -(squared(square.first) + lead.value * square.second + squared(first)) / value
    return Jet(value, first, second)


def _aside(square: Jet, area: Jet, Y: float, Z: float, sign: float) -> Jet:
    """Return the angle of the triangle between D and Y: its derivative is `-s (D^2)' g`, `g = (D^2 + c) / (2 D^2 S)`.

    c is Z^2 - Y^2.
    """
    c = Z * Z - Y * Y
    below = 2.0 * (square.value * area.value)
    g = (square.value + c) / below
    slope = (square.first - g * (2.0 * (square.first * area.value + square.value * area.first))) / below
    value = arctan2(sign * area.value, square.value - c)
    first = (g * square.first) * (-sign)
    return Jet(value, first, (slope * square.first + g * square.second) * (-sign))


def _turned_back(x: Any, y: Any, start: float, lead: Any, least: float = 0.0) -> Any:
    """Return the angle of (x, y) from `start + lead`, along which (x, y) has a part of at least `least`."""
    if lead is None and not isinstance(x, Interval):
        c, s = math.cos(start), math.sin(start)
        return np.arctan2(y * c - x * s, x * c + y * s)
    angle = (lead if lead is not None else x * 0.0) + start
    c, s = cos(angle), sin(angle)
    ahead = x * c + y * s
    if least > 0.0 and isinstance(ahead, Interval):  # as an interval it may lead anywhere
        ahead = Interval(np.maximum(ahead.lower, least), np.maximum(ahead.upper, least))
    return arctan2(y * c - x * s, ahead)


def _like(value: float, other: Any) -> Any:
    if isinstance(other, Interval):
        return Interval.at(np.full(len(other.lower), value))
    return np.full(len(other), value)
