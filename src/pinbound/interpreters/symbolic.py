"""SymPy expressions and LaTeX of a relative path, in the minimal frame or in the ancestor's.

Constants become exact rationals of their decimal form (15 digits), so that expressions simplify exactly.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import reduce
from typing import Any, cast

import numpy as np
import sympy
from numpy.typing import NDArray

from pinbound.path import Chain, RelativePath, are_parallel
from pinbound.tolerances import SYMBOLIC_DIGITS

__all__ = ["ancestor_vector", "latex", "lines", "mathml", "minimal_vector", "symbols"]

Array = NDArray[np.float64]
sp = cast(Any, sympy)  # SymPy carries only part of its types


def symbols(coordinates: Sequence[str]) -> tuple[Any, ...]:
    """Return one real symbol a coordinate, by its name."""
    return tuple(sp.Symbol(name, real=True) for name in coordinates)


def minimal_vector(path: RelativePath, coordinates: Sequence[str]) -> Any:
    """Return r (3, 1) in the frame on the path in which the fewest rotated terms are left."""
    return _vector(path.minimal, path.frame, symbols(coordinates))


def ancestor_vector(path: RelativePath, coordinates: Sequence[str]) -> Any:
    """Return `r = x_a - x_b` (3, 1) in the ancestor's frame: the paper's form."""
    q = symbols(coordinates)
    return _vector(path.branch_a, 0, q) - _vector(path.branch_b, 0, q)


def latex(vector: Any, digits: int = 6) -> str:
    """Return a vector as LaTeX, numbers as decimals in metres."""
    decimals = {number: sp.Float(number, digits) for number in vector.atoms(sp.Rational) if not number.is_Integer}
    return str(sp.latex(vector.xreplace(decimals)))


def lines(vector: Any, digits: int = 6) -> tuple[str, ...]:
    """Return the three components as text for people, lengths in millimetres.

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

    metres = (1000 * vector).expand()
    decimals = {number: sp.Float(number, digits) for number in metres.atoms(sp.Rational) if not number.is_Integer}
    names = sp.symbols("r_x r_y r_z")
    equations = [sp.Eq(name, side, evaluate=False) for name, side in zip(names, metres.xreplace(decimals), strict=True)]
    bodies = [str(cast(Any, to_mathml)(equation, printer="presentation")) for equation in equations]
    bodies = [body.replace("<mo>&InvisibleTimes;</mo>", '<mspace width="0.17em"/>') for body in bodies]
    return tuple(f'<math xmlns="http://www.w3.org/1998/Math/MathML">{body}</math>' for body in bodies)


def _vector(chain: Chain, position: int, q: Sequence[Any]) -> Any:
    """Sum every offset of a chain, turned into the frame at `position`."""
    total = sp.zeros(3, 1)
    for index in range(chain.rotations + 1):
        block = _constants(chain.offsets[index], chain.scale) + _constants(chain.slides[index], 1.0) * sp.Matrix(q)
        if block.is_zero_matrix:
            continue
        forward = index > position
        span = slice(position, index) if forward else slice(index, position)
        factors = _factors(chain.axes[span], chain.coefficients[span], q)
        turn = reduce(lambda left, right: left * right, factors, sp.eye(3))
        total += (turn if forward else turn.T) * block
    return total


def _factors(axes: Array, coefficients: Array, q: Sequence[Any]) -> list[Any]:
    """Return rotation matrices, neighbours about one direction merged into one of the summed angle."""
    factors: list[Any] = []
    start = 0
    while start < len(axes):
        stop, total = start, np.zeros(coefficients.shape[1])
        while stop < len(axes) and are_parallel(axes[start], axes[stop]):
            total = total + np.sign(axes[start] @ axes[stop]) * coefficients[stop]
            stop += 1
        angle = sum(
            (sp.Rational(f"{c:.{SYMBOLIC_DIGITS}g}") * symbol for c, symbol in zip(total, q, strict=True)),
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
    """Return the decimals that float64 values of size `scale` were most likely written as, as rationals."""
    digits = SYMBOLIC_DIGITS - 1 - math.floor(math.log10(scale)) if scale > 0 else SYMBOLIC_DIGITS
    matrix = array.reshape(3, -1)
    return sp.Matrix(*matrix.shape, [sp.Rational(f"{value:.{max(digits, 0)}f}") for value in matrix.ravel()])
