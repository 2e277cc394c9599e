"""The printed numbers and formulas of the paper: Tables 3-14, Eqs. (17)-(20). They serve for comparison only.

Technologies 2025, 13(9), 404, doi 10.3390/technologies13090404. Lengths are in millimetres, with the paper's names:
`x_2,7` is the x of point o_7 in frame 2. Errors of the printed paper are kept.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from pinbound.typing import Array

__all__ = [
    "BOUNDARIES",
    "CONSTANTS",
    "LIMITS",
    "OFFSETS",
    "RECURSION",
    "PrintedBoundary",
    "PrintedLimit",
    "constants",
]

Constants = Mapping[str, float]
Components = Callable[[Constants, Array, Array], tuple[Array, Array]]

OFFSETS: tuple[tuple[str, str, str, str, int, float], ...] = (
    ("Offset z (Base to Joint 1)", "z_0,1", "base_link", "link_1", 2, 38.5),
    ("Offset z (Joint 1 to Joint 2)", "z_1,2", "link_1", "link_2", 2, 72.0),
    ("Offset z (Joint 2 to Joint 3)", "z_2,3", "link_2", "link_3", 2, 100.0),
    ("Offset x (Joint 3 to Joint 4)", "x_3,4", "link_3", "link_4", 0, 93.97),
    ("Offset z (Joint 3 to Joint 4)", "z_3,4", "link_3", "link_4", 2, -34.20),
    ("Offset x (Joint 4 to Joint 5)", "x_4,5", "link_4", "link_5", 0, 35.46),
    ("Offset z (Joint 5 to End Effector)", "z_5,6", "link_5", "link_6", 2, -27.71),
)
"""Table 3: parameter, symbol, from link, to link, axis, printed value [mm]."""

RECURSION: tuple[tuple[str, str, tuple[float, float, float], str, tuple[int, int, int]], ...] = (
    ("base_link", "link_1", (0.0, 0.0, 38.5), "R_z(q1)", (1, 0, 0)),
    ("link_1", "link_2", (0.0, 0.0, 72.0), "R_y(q2)", (0, 1, 0)),
    ("link_2", "link_3", (0.0, 0.0, 100.0), "R_y(-q2 + q3)", (0, -1, 1)),
    ("link_3", "link_4", (93.97, 0.0, -34.20), "R_y(-q3)", (0, 0, -1)),
    ("link_4", "link_5", (35.46, 0.0, 0.0), "R_y(0)", (0, 0, 0)),
    ("link_5", "link_6", (0.0, 0.0, -27.71), "I", (0, 0, 0)),
)
"""Table 4: from link, to link, offset [mm], rotation, its angle's coefficients over (q1, q2, q3)."""

CONSTANTS: dict[str, float] = {
    **{"x_2,3": 0.0, "z_2,3": 100.0, "x_3,4": 93.97, "z_3,4": -34.20, "x_1,13": 0.0, "z_1,13": 72.0},
    **{"x_2,7": 9.69, "z_2,7": 68.27, "x_3,8": 27.00, "z_3,8": -19.27},
    **{"x_2,9": -10.03, "z_2,9": 64.85, "x_3,10": -36.45, "z_3,10": 2.74},
    **{"x_3,11": 74.29, "z_3,11": -20.78, "x_4,12": 5.47, "z_4,12": 23.19},
    **{"x_2,14": -13.44, "z_2,14": 30.61, "x_13,15": -27.76, "z_13,15": 18.63},
    **{"x_3,17": 20.31, "z_3,17": 3.04, "x_16,18": 16.90, "z_16,18": 11.66},
    **{"x_3,20": -19.88, "z_3,20": 12.56, "x_16,21": 5.46, "z_16,21": 22.87},
    **{"x_21,22": 93.97, "z_21,22": 34.20},
    **{"x_2,23": -26.50, "z_2,23": 70.04, "x_3,24": -37.59, "z_3,24": 13.68},
    **{"x_1,25": -39.19, "z_1,25": 69.00, "x_13,26": -39.21, "z_13,26": 2.80},
    **{"x_1,28": -68.52, "z_1,28": 85.68, "x_27,29": -33.38, "z_27,29": -10.96},
}
"""Tables 3 and 5-14 [mm]. Assumed, not printed: r_1,13 = r_1,2. Missing: r_1,27, see `constants`."""


def constants(pivot: tuple[float, float]) -> dict[str, float]:
    """Return the printed lengths, and r_1,27 (x, z) [mm] as given, which the paper does not print."""
    return {**CONSTANTS, "x_1,27": pivot[0], "z_1,27": pivot[1]}


@dataclass(frozen=True)
class PrintedBoundary:
    """The content of one of Tables 5-14.

    Attributes:
        number: The index i of beta_i.
        table: The number of its table.
        kind: The printed kind, in lower case.
        points: Frame and point of both marks: `(2, 7), (3, 8)` is o_7 in frame 2 and o_8 in frame 3.
        norm: The printed norm, as text.
        components: The function (beta_i1, beta_i3) [mm] of (q2, q3) in Eq. (17).
    """

    number: int
    table: int
    kind: str
    points: tuple[tuple[int, int], tuple[int, int]]
    norm: str
    components: Components

    @property
    def name(self) -> str:
        """Name of the boundary in the annotations."""
        return f"beta_{self.number}"


def _elbow(a: str, b: str, with_x: bool = False) -> Components:
    """Return the components for points of frames 2 and 3: `r_2,a - r_2,3 - R_2,3 r_3,b`."""

    def components(k: Constants, q2: Array, q3: Array) -> tuple[Array, Array]:
        cos, sin = np.cos(q2 - q3), np.sin(q2 - q3)
        first = k[f"x_2,{a}"] - (k["x_2,3"] if with_x else 0.0) - k[f"x_3,{b}"] * cos + k[f"z_3,{b}"] * sin
        return first, k[f"z_2,{a}"] - k["z_2,3"] - k[f"z_3,{b}"] * cos - k[f"x_3,{b}"] * sin

    return components


def _bridge(a: str, b: str) -> Components:
    """Return the components for points of frames 3 and 16, with the printed R_2,16 = R_y(q3)."""

    def components(k: Constants, q2: Array, q3: Array) -> tuple[Array, Array]:
        cos, sin, c3, s3 = np.cos(q2 - q3), np.sin(q2 - q3), np.cos(q3), np.sin(q3)
        x, z, u, w = k[f"x_3,{a}"], k[f"z_3,{a}"], k[f"x_16,{b}"], k[f"z_16,{b}"]
        return x * cos - u * c3 - w * s3 - z * sin, u * s3 - w * c3 + z * cos + x * sin

    return components


def _wrist(k: Constants, q2: Array, q3: Array) -> tuple[Array, Array]:
    cos, sin = np.cos(q3), np.sin(q3)
    first = k["x_3,11"] - k["x_3,4"] - k["x_4,12"] * cos + k["z_4,12"] * sin
    return first, k["z_3,11"] - k["z_3,4"] - k["z_4,12"] * cos - k["x_4,12"] * sin


def _crank(k: Constants, q2: Array, q3: Array) -> tuple[Array, Array]:
    c2, s2, c3, s3 = np.cos(q2), np.sin(q2), np.cos(q3), np.sin(q3)
    first = k["x_2,14"] * c2 - k["x_13,15"] * c3 - k["z_13,15"] * s3 + k["z_2,14"] * s2
    return first, k["z_2,14"] * c2 - k["z_13,15"] * c3 + k["x_13,15"] * s3 - k["x_2,14"] * s2


def _stop(k: Constants, q2: Array, q3: Array) -> tuple[Array, Array]:
    cos, sin = np.cos(q2), np.sin(q2)
    first = k["x_2,3"] * cos - k["x_21,22"] + k["z_2,3"] * sin
    return first, k["z_2,3"] * cos - k["z_21,22"] - k["x_2,3"] * sin


def _base(frame: str, a: str, b: str, uses_q2: bool) -> Components:
    """Return the components for points of frame 1 and of a frame that rotates: `r_1,a - r_1,frame - R_y r_frame,b`."""

    def components(k: Constants, q2: Array, q3: Array) -> tuple[Array, Array]:
        angle = q2 if uses_q2 else q3
        cos, sin = np.cos(angle), np.sin(angle)
        x, z = k[f"x_{frame},{b}"], k[f"z_{frame},{b}"]
        first = k[f"x_1,{a}"] - k[f"x_1,{frame}"] - x * cos - z * sin
        return first, k[f"z_1,{a}"] - k[f"z_1,{frame}"] - z * cos + x * sin

    return components


_CONSECUTIVE, _COINCIDENT = "consecutive", "coincident branched"

BOUNDARIES: tuple[PrintedBoundary, ...] = (
    PrintedBoundary(1, 5, _CONSECUTIVE, ((2, 7), (3, 8)), "|r_2,7 - r_2,3 - R_2,3 r_3,8|", _elbow("7", "8")),
    PrintedBoundary(2, 6, _CONSECUTIVE, ((2, 9), (3, 10)), "|r_2,9 - r_2,3 - R_2,3 r_3,10|", _elbow("9", "10")),
    PrintedBoundary(3, 7, _CONSECUTIVE, ((3, 11), (4, 12)), "|r_3,11 - r_3,4 - R_3,4 r_4,12|", _wrist),
    PrintedBoundary(4, 8, _COINCIDENT, ((2, 14), (13, 15)), "|R_1,2 r_2,14 - R_1,13 r_13,15|", _crank),
    PrintedBoundary(5, 9, _COINCIDENT, ((3, 17), (16, 18)), "|R_2,3 r_3,17 - R_2,16 r_16,18|", _bridge("17", "18")),
    PrintedBoundary(6, 10, _COINCIDENT, ((3, 20), (16, 21)), "|R_2,3 r_3,20 - R_2,16 r_16,21|", _bridge("20", "21")),
    PrintedBoundary(7, 11, _COINCIDENT, ((2, 3), (21, 22)), "|R_1,2 r_2,3 - R_1,21 r_21,22|", _stop),
    PrintedBoundary(8, 12, _CONSECUTIVE, ((2, 23), (3, 24)), "|r_2,23 - R_2,3 r_3,24|", _elbow("23", "24", True)),
    PrintedBoundary(
        9, 13, _CONSECUTIVE, ((1, 25), (13, 26)), "|r_1,25 - r_1,13 - R_1,13 r_13,26|", _base("13", "25", "26", False)
    ),
    PrintedBoundary(
        10, 14, _CONSECUTIVE, ((1, 28), (27, 29)), "|r_1,28 - r_1,27 - R_1,27 r_27,29|", _base("27", "28", "29", True)
    ),
)
"""Tables 5-14 and Eq. (17)."""


@dataclass(frozen=True)
class PrintedLimit:
    """One line of Eqs. (18)-(20): `joint = [other] + turns pi + atan(y / x) +- acos(cosine)`.

    Attributes:
        equation: 18, 19 or 20.
        line: The number of the line in its equation, from 1.
        boundary: The index i of the boundary beta_i whose component the line inverts.
        component: The number of this component, 1 or 3.
        joint: The joint that the line limits, ``"q2"`` or ``"q3"``.
        adds_other: Whether the line adds the other joint's angle.
        half_turns: The printed offset, divided by pi.
        arctangent: Numerator and denominator, as symbols with a sign: `-x_3,8` is minus x_3,8.
        cosine: The argument of the arccosine, as a function of the constants, of the other joint's angle, and of the
            function that evaluates an arctangent.
    """

    equation: int
    line: int
    boundary: int
    component: int
    joint: str
    adds_other: bool
    half_turns: int
    arctangent: tuple[str, str]
    cosine: Callable[[Constants, Array, Callable[[float, float], float]], Array]

    def value(
        self, k: Constants, other: Array, sign: float, two_arguments: bool, half_turns: int | None = None
    ) -> Array:
        """Return the printed angle [rad] for one sign, at angles of the other joint; NaN where the line gives none.

        Args:
            k: The lengths [mm].
            other: (N,) angles of the other joint [rad].
            sign: +1 or -1: the sign to use for the printed +-.
            two_arguments: Whether tan^-1(a / b) is read as atan2(a, b) or as the arctangent of the quotient.
            half_turns: An offset, divided by pi, that replaces the printed one.
        """
        read = math.atan2 if two_arguments else _quotient_arctangent
        y, x = (_signed(k, symbol) for symbol in self.arctangent)
        offset = math.pi * (self.half_turns if half_turns is None else half_turns)
        with np.errstate(invalid="ignore"):
            return (
                (other if self.adds_other else 0.0)
                + offset
                + read(y, x)
                + sign * np.arccos(self.cosine(k, other, read))
            )


def _signed(k: Constants, symbol: str) -> float:
    return -k[symbol[1:]] if symbol.startswith("-") else k[symbol]


def _quotient_arctangent(y: float, x: float) -> float:
    return math.copysign(math.pi / 2, y) if x == 0.0 else math.atan(y / x)


def _length(k: Constants, suffix: str) -> float:
    return math.hypot(k[f"x_{suffix}"], k[f"z_{suffix}"])


def _ratio(first: str, second: str | None, arm: str) -> Callable[..., Array]:
    """Return the function `(first - second) / |arm|`."""

    def cosine(k: Constants, other: Array, _: Callable[[float, float], float]) -> Array:
        return np.full_like(other, (k[first] - (k[second] if second else 0.0)) / _length(k, arm))

    return cosine


def _crank_ratio(y: str, x: str) -> Callable[..., Array]:
    """Return the function `cos(q3 - atan(y / x)) |r_13,15| / |r_2,14|`."""

    def cosine(k: Constants, other: Array, read: Callable[[float, float], float]) -> Array:
        turned = np.cos(other - read(_signed(k, y), _signed(k, x)))
        return np.asarray(turned * _length(k, "13,15") / _length(k, "2,14"))

    return cosine


LIMITS: tuple[PrintedLimit, ...] = (
    PrintedLimit(18, 1, 1, 1, "q2", True, 1, ("z_3,8", "-x_3,8"), _ratio("x_2,7", None, "3,8")),
    PrintedLimit(18, 2, 1, 3, "q2", True, 0, ("-x_3,8", "-z_3,8"), _ratio("z_2,3", "z_2,7", "3,8")),
    PrintedLimit(18, 3, 2, 1, "q2", True, 1, ("z_3,10", "-x_3,10"), _ratio("x_2,9", None, "3,10")),
    PrintedLimit(18, 4, 2, 3, "q2", True, 0, ("-x_3,10", "-z_3,10"), _ratio("z_2,3", "z_2,9", "3,10")),
    PrintedLimit(18, 5, 4, 1, "q2", False, 1, ("z_2,14", "x_2,14"), _crank_ratio("-z_13,15", "-x_13,15")),
    PrintedLimit(18, 6, 4, 3, "q2", False, 3, ("-x_2,14", "z_2,14"), _crank_ratio("x_13,15", "-z_13,15")),
    PrintedLimit(19, 1, 7, 1, "q2", False, 0, ("z_2,3", "x_2,3"), _ratio("x_21,22", None, "2,3")),
    PrintedLimit(19, 2, 7, 3, "q2", False, 0, ("-x_2,3", "z_2,3"), _ratio("z_21,22", None, "2,3")),
    PrintedLimit(19, 3, 8, 1, "q2", True, 0, ("z_3,24", "-x_3,24"), _ratio("x_2,3", "x_2,23", "3,24")),
    PrintedLimit(19, 4, 8, 3, "q2", True, 0, ("-x_3,24", "-z_3,24"), _ratio("z_2,3", "z_2,23", "3,24")),
    PrintedLimit(19, 5, 10, 1, "q2", False, 1, ("-z_27,29", "-x_27,29"), _ratio("x_1,27", "x_1,28", "27,29")),
    PrintedLimit(19, 6, 10, 3, "q2", False, 2, ("x_27,29", "-z_27,29"), _ratio("z_1,27", "z_1,28", "27,29")),
    PrintedLimit(20, 1, 3, 1, "q3", False, 0, ("z_4,12", "-x_4,12"), _ratio("x_3,4", "x_3,11", "4,12")),
    PrintedLimit(20, 2, 3, 3, "q3", False, 0, ("-x_4,12", "-z_4,12"), _ratio("z_3,4", "z_3,11", "4,12")),
    PrintedLimit(20, 3, 9, 1, "q3", False, 2, ("-z_13,26", "-x_13,26"), _ratio("x_1,13", "x_1,25", "13,26")),
    PrintedLimit(20, 4, 9, 3, "q3", False, 0, ("x_13,26", "-z_13,26"), _ratio("z_1,13", "z_1,25", "13,26")),
)
"""Eqs. (18)-(20): sixteen lines; beta_5 and beta_6 are not inverted there."""
