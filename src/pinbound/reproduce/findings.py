"""Records of the reproduction: tables, equations, errata."""

from __future__ import annotations

from dataclasses import dataclass

from pinbound.values import Value

__all__ = ["Equation", "Erratum", "Table"]


@dataclass(frozen=True)
class Table:
    """One table drawn anew.

    Attributes:
        label: ``"Table 5"``, or the numbers of equations.
        title: What it shows.
        columns: Headings; those that end in ``]`` hold numbers.
        rows: Cells as text.
        verdict: How it agrees with the print.
        agrees: Whether it does.
        formulas: MathML lines that belong to it.
    """

    label: str
    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    verdict: str
    agrees: bool
    formulas: tuple[str, ...] = ()


@dataclass(frozen=True)
class Equation:
    """A printed equation, evaluated beside the derived boundary.

    Attributes:
        number: ``"(8), (9)"``.
        says: What it states.
        checked_on: On which boundaries.
        difference: Largest difference [m] over the samples.
        agrees: Whether that is rounding.
    """

    number: str
    says: str
    checked_on: str
    difference: float
    agrees: bool


@dataclass(frozen=True)
class Erratum(Value):
    """One fault of the print, as a computation.

    Attributes:
        number: As in the list of errata.
        where: Equation, table or figure.
        title: The fault in one sentence.
        printed: What the print says or gives.
        derived: What the computation gives.
        consequence: What follows.
        numbers: The numbers behind it, by name; SI units unless the name says otherwise.
        holds: Whether the computation confirms the fault.
    """

    number: int
    where: str
    title: str
    printed: str
    derived: str
    consequence: str
    numbers: dict[str, float]
    holds: bool
