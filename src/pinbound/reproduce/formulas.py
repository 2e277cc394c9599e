"""Formulas of the page as MathML, made by SymPy."""

from __future__ import annotations

import html
import math
import re
from collections.abc import Sequence
from typing import Any, cast

from pinbound.boundaries.boundary import Boundary
from pinbound.extras import Needs

__all__ = ["limit_formula", "membership_formulas", "typeset"]

with Needs("report", "the paper's page"):
    import sympy

sp = cast(Any, sympy)

_SUBSCRIPTS = re.compile(r"\b(beta|mu|tan|[rRxzoq])_((?:max|min)|\d+(?:,\w+)?|[nkyz])\b")
_GREEK = {"beta": "\u03b2", "mu": "\u03bc", "pi": "\u03c0"}
_ALONE = re.compile(r"\b(?:beta|mu|pi)\b")


def typeset(text: str) -> str:
    """Return plain text as HTML: `beta_10` and `r_2,23` with subscripts, `mm^2` with a raised 2, minus signs.

    Example:
        >>> str(typeset("beta_4 <= 3 rad^2"))
        '\u03b2<sub>4</sub> &lt;= 3 rad\u00b2'
    """
    from markupsafe import Markup

    safe = html.escape(text, quote=False)
    safe = _SUBSCRIPTS.sub(lambda found: f"{_GREEK.get(found[1], found[1])}<sub>{found[2]}</sub>", safe)
    safe = _ALONE.sub(lambda found: _GREEK[found[0]], safe)
    safe = safe.replace("^2", "\u00b2").replace("^3", "\u00b3").replace("^-1", "\u207b\u00b9")
    safe = re.sub(r"\+-", "\u00b1", safe)
    return Markup(re.sub(r"(?<![\w)\]])-(?=[\d|q ])|(?<= )-(?= )|^-$", "\u2212", safe))


def _mathml(equation: Any) -> str:
    from sympy.printing.mathml import mathml

    body = str(cast(Any, mathml)(equation, printer="presentation", order="none")).replace(
        "<mo>&InvisibleTimes;</mo>", ""
    )
    return f'<math xmlns="http://www.w3.org/1998/Math/MathML">{body}</math>'


def limit_formula(boundary: Boundary, joint: str) -> str:
    """Return the derived limit of a joint as an equation in degrees, `q_2 = q_3 - 32.429...`.

    Example:
        >>> import pinbound as pb
        >>> "32.429" in limit_formula(pb.load("minervabot_v3").boundaries["beta_4"], "q2")
        True
    """
    contact = boundary.contact
    if contact is None:
        return ""
    names = boundary.robot_coordinates
    symbols = {name: sp.Symbol(f"q_{name.removeprefix('q')}") for name in names}
    own = float(contact.coefficients[names.index(joint)])
    side: Any = sp.Float(f"{math.degrees(contact.angle) / own:.9f}", 12)
    for name, coefficient in zip(names, contact.coefficients.tolist(), strict=True):
        if name != joint and coefficient:
            side = side - sp.nsimplify(coefficient / own) * symbols[name]
    return _mathml(sp.Eq(symbols[joint], side, evaluate=False))


def membership_formulas() -> Sequence[tuple[str, ...]]:
    """Return the lines of Eq. (21): for each the case, the printed formula, and the formula that its text means."""
    q, low, high, mu = sp.symbols("q_n q_min q_max mu_n")

    def minus(a: Any, b: Any) -> Any:
        return sp.Add(a, -b, evaluate=False)

    within = sp.And(sp.Le(low, q), sp.Le(q, high))
    nearest = sp.Min(minus(q, low), minus(high, q), evaluate=False)
    rows = (
        (sp.Lt(q, low), minus(q, low), minus(q, low)),
        (within, nearest, nearest),
        (sp.Gt(q, high), minus(q, high), minus(high, q)),
    )
    return tuple(
        (_mathml(where), *(_mathml(sp.Eq(mu, side, evaluate=False)) for side in sides)) for where, *sides in rows
    )
