"""Records of the reproduction: tables, equations, errata."""

from __future__ import annotations

from dataclasses import dataclass

from pinbound.values import Value

__all__ = ["Equation", "Erratum", "Table"]


@dataclass(frozen=True)
class Table:
    """One table, computed again.

    Attributes:
        label: ``"Table 5"``, or the numbers of equations.
        title: What it shows.
        columns: Headings; a column whose heading ends in ``]`` has numbers.
        rows: Cells as text.
        verdict: How well the table agrees with the printed one, as text.
        agrees: Whether the two tables agree.
        formulas: MathML lines that belong to the table.
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
    """A printed equation, evaluated and compared with the derived boundary.

    Attributes:
        number: ``"(8), (9)"``.
        says: The statement of the equation.
        checked_on: The boundaries on which it was evaluated.
        difference: Largest difference from the derived boundary over the samples [m].
        agrees: Whether this difference is only rounding.
    """

    number: str
    says: str
    checked_on: str
    difference: float
    agrees: bool


@dataclass(frozen=True)
class Erratum(Value):
    """One fault of the printed paper, shown by a computation.

    Attributes:
        number: Its number in the list of errata.
        where: The equation, table or figure with the fault.
        title: The fault in one sentence.
        printed: The printed statement or value.
        derived: The result of the computation.
        consequence: The consequence of the fault.
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
