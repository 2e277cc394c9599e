"""Numbers for people: degrees and millimetres, counts with their nouns; API, files and JSON hold radians and metres."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pinbound.typing import Array

__all__ = ["amount", "area_name", "factors", "names", "product", "several", "shown"]

_SHOWN = {"rad": (180.0 / math.pi, "deg"), "m": (1e3, "mm")}


def names(units: Sequence[str]) -> tuple[str, ...]:
    """Return what people read instead of ``"rad"`` and ``"m"``.

    Example:
        >>> names(("m", "rad"))
        ('mm', 'deg')
    """
    return tuple(_SHOWN[unit][1] for unit in units)


def factors(units: Sequence[str]) -> Array:
    """Return by what values in these units are multiplied for people (k,).

    Example:
        >>> (factors(("m", "rad")) * [0.5, np.pi]).tolist()
        [500.0, 180.0]
    """
    return np.array([_SHOWN[unit][0] for unit in units])


def shown(values: Array | Sequence[float], units: Sequence[str]) -> Array:
    """Return values (..., k), a column a unit, as people read them."""
    return np.asarray(values, dtype=np.float64) * factors(units)


def amount(value: float, unit: str, digits: int = 6) -> str:
    """Return one value with its unit, for people.

    Example:
        >>> amount(0.5, "m", 3), amount(np.pi / 6, "rad", 3), amount(np.inf, "rad")
        ('500.000 mm', '30.000 deg', 'none')
    """
    if not math.isfinite(value):
        return "none"
    factor, name = _SHOWN[unit]
    return f"{factor * value:.{digits}f} {name}"


def product(units: Sequence[str]) -> str:
    """Return the unit of an area, or of a volume, whose sides are in these units.

    Example:
        >>> product(("rad", "rad")), product(("rad", "m")), product(("rad", "m", "rad"))
        ('rad^2', 'm rad', 'm rad^2')
    """
    counts = {unit: units.count(unit) for unit in sorted(units)}
    return " ".join(unit if count == 1 else f"{unit}^{count}" for unit, count in counts.items())


def area_name(unit: str) -> str:
    """Return a unit of area, or of volume, as a formula says it.

    Example:
        >>> area_name("rad^2"), area_name("m rad"), area_name("rad^3")
        ('rad²', 'm rad', 'rad³')
    """
    return unit.replace("^2", "\N{SUPERSCRIPT TWO}").replace("^3", "\N{SUPERSCRIPT THREE}")


def several(number: int, one: str, many: str = "") -> str:
    """Return a number with its noun; `many` is needed where the plural is not formed as usual.

    Example:
        >>> several(1, "boundary"), several(0, "boundary"), several(2000, "row"), several(2, "pair is", "pairs are")
        ('1 boundary', '0 boundaries', '2,000 rows', '2 pairs are')
    """
    if number == 1:
        return f"1 {one}"
    usual = f"{one[:-1]}ies" if one.endswith("y") else f"{one}es" if one.endswith(("x", "sh")) else f"{one}s"
    return f"{number:,} {many or usual}"
