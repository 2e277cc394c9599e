"""SymPy expressions and LaTeX of a relative path, in the minimal frame or in the ancestor's.

Constants become the exact rationals of their decimal form (15 digits), so that expressions simplify exactly.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce
from html import escape
from typing import Any, cast

import numpy as np

from pinbound.exceptions import UnsupportedError
from pinbound.extras import Needs
from pinbound.path.chain import Chain, HullChain, are_parallel
from pinbound.path.kind import Case
from pinbound.path.relative import RelativePath
from pinbound.tolerances import SYMBOLIC_DIGITS
from pinbound.typing import Array

__all__ = [
    "LimitExpressions",
    "ancestor_vector",
    "latex",
    "limit_expressions",
    "lines",
    "mathml",
    "minimal_vector",
    "operations",
    "parameters",
    "symbols",
    "unreduced_vector",
]

with Needs("symbols", "a formula"):
    import sympy

sp = cast(Any, sympy)  # SymPy carries only part of its types


def symbols(coordinates: Sequence[str]) -> tuple[Any, ...]:
    """Return one real symbol for each coordinate, with its name."""
    return tuple(sp.Symbol(name, real=True) for name in coordinates)


def parameters(count: int, coordinates: Sequence[str]) -> tuple[Any, ...]:
    """Return one real symbol t_1, t_2 for each segment; it is primed if a coordinate has the same name."""
    names = [f"t_{index + 1}" for index in range(count)]
    return tuple(sp.Symbol(name + "'" * (name in coordinates), real=True) for name in names)


def minimal_vector(path: RelativePath, coordinates: Sequence[str]) -> Any:
    """Return r (3, 1) in the frame on the path in which it has the fewest rotated terms.

    For segments, it is between the points t_1 and t_2; for a line or plane, it is the part of r that counts.
    """
    r = _sum_vector(path.difference, path.frame, coordinates)
    rows = path.projection
    return r if rows is None else sp.expand(_constants(rows.T @ rows, 1.0) * r)


def ancestor_vector(path: RelativePath, coordinates: Sequence[str]) -> Any:
    """Return `r = x_a - x_b` (3, 1) in the ancestor's frame: the paper's form."""
    r = _sum_vector(path.branch_a, 0, coordinates) - _sum_vector(path.branch_b, 0, coordinates)
    normal = path.normal
    if normal is None:
        return r
    unit = _vector(normal, 0, symbols(coordinates))
    return path.left_of(r, unit * unit.dot(r))


def _sum_vector(points: HullChain, position: int, coordinates: Sequence[str]) -> Any:
    q = symbols(coordinates)
    total = _vector(points.chain, position, q)
    for t, edge in zip(parameters(len(points.turned), coordinates), points.turned, strict=True):
        total += t * _vector(edge, position, q)
    return total


def operations(vector: Any) -> int:
    """Return the number of operations (sums, products, sines, cosines) of a vector as it stands."""
    return int(sum(sp.count_ops(component) for component in vector))


def unreduced_vector(place_a: Chain, place_b: Chain, coordinates: Sequence[str]) -> Any:
    """Return `r_0,n - r_0,m` of Eq. (5): unreduced chains place both points from the root, without any merging."""
    q = symbols(coordinates)
    return _vector(place_a, 0, q, merge=False) - _vector(place_b, 0, q, merge=False)


def latex(vector: Any, digits: int = 6, entry: bool = False) -> str:
    """Return a vector, or only its first entry, as LaTeX, with decimal numbers in metres."""
    decimals = {number: sp.Float(number, digits) for number in vector.atoms(sp.Rational) if not number.is_Integer}
    found = vector.xreplace(decimals)
    named = {symbol: _text(symbol.name) for symbol in found.free_symbols if not _PLAIN.fullmatch(symbol.name)}
    return str(sp.latex(found[0] if entry else found, symbol_names=named))


_PLAIN = re.compile(r"[A-Za-z][A-Za-z0-9_]*'*")
"""Names that LaTeX and MathML print as symbols; all other names are printed as text, letter by letter."""

_LATEX = {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "$": r"\$"}


def _text(name: str) -> str:
    """Return LaTeX that prints a name unchanged; a name is data, and cannot contain commands."""
    return r"\text{" + "".join(_LATEX.get(letter, "\\" * (letter in "{}%&#_") + letter) for letter in name) + "}"


def lines(vector: Any, digits: int = 6) -> tuple[str, ...]:
    """Return the three components as text for people, with lengths in millimetres.

    Example:
        >>> lines(sp.Matrix([sp.Rational(969, 100000) - sp.cos(sp.Symbol("q2")) / 10, 0, 0]))
        ('9.69 - 100.0*cos(q2)', '0', '0')
    """
    metres = [sp.expand(1000 * component) for component in vector]
    texts = [str(component.evalf(digits)) for component in metres]
    return tuple("0" if component == 0 else text for component, text in zip(metres, texts, strict=True))


def mathml(vector: Any, digits: int = 6) -> tuple[str, ...]:
    """Return the components `r_x = ...`, `r_y = ...`, `r_z = ...` as MathML, lengths in millimetres."""
    from sympy.printing.mathml import mathml as to_mathml

    strange = sorted({symbol.name for symbol in vector.free_symbols if not _PLAIN.fullmatch(symbol.name)})
    stand_ins = {name: f"name{chr(0x1D400 + index)}" for index, name in enumerate(strange)}  # SymPy escapes nothing
    vector = vector.xreplace(
        {s: sp.Symbol(stand_ins[s.name], real=True) for s in vector.free_symbols if s.name in stand_ins}
    )
    metres = (1000 * vector).expand()
    decimals = {number: sp.Float(number, digits) for number in metres.atoms(sp.Rational) if not number.is_Integer}
    names = sp.symbols("r_x r_y r_z")
    equations = [sp.Eq(name, side, evaluate=False) for name, side in zip(names, metres.xreplace(decimals), strict=True)]
    bodies = [str(cast(Any, to_mathml)(equation, printer="presentation")) for equation in equations]
    bodies = [body.replace("<mo>&InvisibleTimes;</mo>", '<mspace width="0.17em"/>') for body in bodies]
    for name, stand_in in stand_ins.items():
        printed = stand_in.encode("ascii", "xmlcharrefreplace").decode()
        bodies = [body.replace(printed, escape(name)) for body in bodies]
    return tuple(f'<math xmlns="http://www.w3.org/1998/Math/MathML">{body}</math>' for body in bodies)


@dataclass(frozen=True)
class LimitExpressions:
    """The contacts of one coordinate, as SymPy expressions of the others, in every quadrant and every turn.

    Attributes:
        coordinate: Its name.
        aligned: The value at which the two arms align and the norm is smallest: `(phi* - rest) / c`, phi* is an atan2.
        half_width: `w / |c|`, an acos of lengths; zero for a boundary without threshold, whose contact is alignment.
        period: `2 pi / |c|`.
    """

    coordinate: str
    aligned: Any
    half_width: Any
    period: Any

    @property
    def lower(self) -> Any:
        """The contact below the aligned value: the upper end of an allowed arc."""
        return self.aligned - self.half_width

    @property
    def upper(self) -> Any:
        """The contact above the aligned value: the lower end of an allowed arc."""
        return self.aligned + self.half_width

    def latex(self, digits: int = 6) -> str:
        """Return `q = aligned +- half_width + period k` as LaTeX, with decimal numbers in metres and radians."""
        head = latex(sp.Matrix([sp.Symbol(self.coordinate)]), entry=True)
        aligned = latex(sp.Matrix([self.aligned]), digits, entry=True)
        width = "" if self.half_width == 0 else rf" \pm {latex(sp.Matrix([self.half_width]), digits, entry=True)}"
        period = latex(sp.Matrix([self.period]), digits, entry=True)
        return rf"{head} = {aligned}{width} + {period} k, \quad k \in \mathbb{{Z}}"


def limit_expressions(path: RelativePath, index: int, coordinates: Sequence[str], threshold: float) -> LimitExpressions:
    """Return the contacts of a coordinate in exactly one rotation: `r = p + R(u, phi) s`, `phi = c q_j + rest`.

    With the lengths P and S of the parts of p and s perpendicular to u, and the sum h of both along u, contact at the
    distance t is at

        phi = atan2(u . (p x s), -p . s) +- acos((h^2 + P^2 + S^2 - t^2) / (2 P S)).

    Above a plane with normal n, the height is `A + B cos phi + C sin phi`, and contact is at

        phi = atan2(-C, -B) +- acos((A - t) / sqrt(B^2 + C^2)).

    Raises:
        UnsupportedError: If the path does not use the coordinate in exactly one rotation, or measures a distance of
            segments or from a line.
    """
    chain = path.minimal
    if not path.is_harmonic:
        raise UnsupportedError("segments and lines have no closed form; limits(...) gives their values, all of them")
    turned = np.flatnonzero(chain.coefficients[:, index])
    name = coordinates[index]
    if len(turned) != 1 or np.any(chain.slides[:, :, index]):
        how = "does not depend on it" if not len(chain.coordinates) or index not in chain.coordinates else "uses it"
        how += "" if how.startswith("does") else " more than once, or slides along it"
        raise UnsupportedError(
            f"no closed form for {name!r}: the path {how}; limits(...) gives its values, numerically and all of them"
        )
    aligned, width = _STRIPS[path.case](path, int(turned[0]), symbols(coordinates), threshold)
    c = [_decimal(value) for value in chain.coefficients[int(turned[0])]]
    rest = sum((c[i] * q for i, q in enumerate(symbols(coordinates)) if i != index), sp.S.Zero)
    return LimitExpressions(name, (aligned - rest) / c[index], width / abs(c[index]), 2 * sp.pi / abs(c[index]))


def _distance_strip(path: RelativePath, place: int, q: Sequence[Any], threshold: float) -> tuple[Any, Any]:
    """Return phi* and w of two points for the rotation at `place`."""
    axis, p, s = _parts(path, place, q)
    height = sp.expand(axis.dot(p + s))
    p, s = p - axis * axis.dot(p), s - axis * axis.dot(s)
    aligned = sp.atan2(sp.expand(axis.dot(p.cross(s))), sp.expand(-p.dot(s)))
    squares, t = (sp.expand(p.dot(p)), sp.expand(s.dot(s))), _decimal(threshold)
    if not threshold > 0.0:
        return aligned, sp.S.Zero
    return aligned, sp.acos((height**2 + squares[0] + squares[1] - t**2) / (2 * sp.sqrt(squares[0] * squares[1])))


def _height_strip(path: RelativePath, place: int, q: Sequence[Any], threshold: float) -> tuple[Any, Any]:
    """Return phi* and w of a point above a plane for the rotation at `place`."""
    axis, p, s = _parts(path, place, q)
    before = path.minimal.before(place)
    offsets = np.zeros_like(before.offsets)
    offsets[0] = path.height_row()
    n = _vector(replace(before, offsets=offsets, slides=np.zeros_like(before.slides)), place, q)
    s_perpendicular = s - axis * axis.dot(s)
    A, B, C = n.dot(p) + n.dot(axis) * axis.dot(s), n.dot(s_perpendicular), n.dot(axis.cross(s))
    width = sp.acos((sp.expand(A) - _decimal(threshold)) / sp.sqrt(sp.expand(B**2 + C**2)))
    return sp.atan2(sp.expand(-C), sp.expand(-B)), width


_STRIPS = {Case.POINTS: _distance_strip, Case.PLANE: _height_strip}


def _parts(path: RelativePath, place: int, q: Sequence[Any]) -> tuple[Any, Any, Any]:
    """Return u, p and s of `r = p + R(u, phi) s`, where R is the rotation at `place`."""
    chain = path.minimal
    axis = _constants(chain.axes[place], 1.0)
    return axis, _vector(chain.before(place), place, q), _vector(chain.behind(place), 0, q)


def _decimal(value: float) -> Any:
    """Return the decimal number that was most likely written, as a rational."""
    return sp.Rational(f"{value:.{SYMBOLIC_DIGITS}g}")


def _vector(chain: Chain, position: int, q: Sequence[Any], merge: bool = True) -> Any:
    """Sum all offsets of a chain, rotated into the frame at `position`."""
    total = sp.zeros(3, 1)
    for index in range(chain.rotations + 1):
        block = _constants(chain.offsets[index], chain.scale) + _constants(chain.slides[index], 1.0) * sp.Matrix(q)
        if block.is_zero_matrix:
            continue
        forward = index > position
        span = slice(position, index) if forward else slice(index, position)
        factors = _factors(chain.axes[span], chain.coefficients[span], q, merge)
        turn = reduce(lambda left, right: left * right, factors, sp.eye(3))
        total += (turn if forward else turn.T) * block
    return total


def _factors(axes: Array, coefficients: Array, q: Sequence[Any], merge: bool) -> list[Any]:
    """Return rotation matrices; `merge` replaces neighbours about one direction by one rotation by the summed angle."""
    factors: list[Any] = []
    start = 0
    while start < len(axes):
        stop, total = start, np.zeros(coefficients.shape[1])
        while stop == start or (merge and stop < len(axes) and are_parallel(axes[start], axes[stop])):
            total = total + np.sign(axes[start] @ axes[stop]) * coefficients[stop]
            stop += 1
        angle = sum(
            (_decimal(c) * symbol for c, symbol in zip(total, q, strict=True)),
            sp.S.Zero,
        )
        factors.append(_rotation(axes[start], angle))
        start = stop
    return factors


def _rotation(axis: Array, angle: Any) -> Any:
    x, y, z = _constants(axis, 1.0)
    cross = sp.Matrix([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    outer = sp.Matrix([x, y, z]) * sp.Matrix([[x, y, z]])
    return sp.eye(3) * sp.cos(angle) + cross * sp.sin(angle) + outer * (1 - sp.cos(angle))


def _constants(array: Array, scale: float) -> Any:
    """Return the decimal numbers that were most likely written for float64 values of size `scale`, as rationals."""
    digits = SYMBOLIC_DIGITS - 1 - math.floor(math.log10(scale)) if scale > 0 else SYMBOLIC_DIGITS
    matrix = array.reshape(3, -1)
    return sp.Matrix(*matrix.shape, [sp.Rational(f"{value:.{max(digits, 0)}f}") for value in matrix.ravel()])
