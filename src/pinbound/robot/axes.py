"""Other coordinates for the same robot: sums of joints, such as a third axis measured from the ground.

With `theta = S q + o` and new coordinates `p = T q + t` the coupling is `theta = (S T^-1) p + (o - S T^-1 t)`. T has
the rows of the axes, and unit rows for the other coordinates. It is inverted in exact arithmetic and rounded once; for
sums and differences, no rounding is needed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from pinbound.annotations import Axis
from pinbound.exceptions import Problems, name_hint
from pinbound.model.coupling import Coupling, GuardedLimit, LinearLimit
from pinbound.tolerances import HOME
from pinbound.typing import Array
from pinbound.values import Value

__all__ = ["NewCoordinates", "joint_home", "new_coordinates"]

Matrix = list[list[Fraction]]


@dataclass(frozen=True, eq=False)
class NewCoordinates(Value):
    """The change of coordinates `p = T q + t`, and its inverse.

    Attributes:
        names: Names of the coordinates of p, in order.
        T: (n, n).
        t: (n,) [rad or m].
        back: T^-1, exact, as rows of fractions.

    Example:
        >>> coupling = Coupling(("J2", "J3"), ("J2", "J3"), np.eye(2), np.zeros(2))
        >>> change = new_coordinates([Axis("absolute", "J3", {"J2": 1.0, "J3": 1.0})], coupling, Problems("x"))
        >>> change.coupling(coupling).text("J3")
        'absolute - J2'
    """

    names: tuple[str, ...]
    T: Array
    t: Array
    back: tuple[tuple[Fraction, ...], ...]

    def forward(self, q: Array) -> Array:
        """Return p for q (n,)."""
        return self.T @ q + self.t

    def coupling(self, coupling: Coupling) -> Coupling:
        """Return the coupling in terms of p."""
        rows = [self._row(row, float(o)) for row, o in zip(coupling.S, coupling.offset, strict=True)]
        S = np.array([row for row, _ in rows]).reshape(coupling.S.shape)
        return Coupling(self.names, coupling.joints, S, np.array([offset for _, offset in rows]))

    def limit(self, limit: LinearLimit) -> LinearLimit:
        """Return a limit in terms of p."""
        c, offset = self._row(limit.coefficients, limit.offset)
        return LinearLimit(limit.joint, np.array(c), offset, limit.lower, limit.upper)

    def guarded(self, one: GuardedLimit) -> GuardedLimit:
        """Return a guarded limit in terms of p."""
        return GuardedLimit(self.limit(one.limit), tuple(self.limit(condition) for condition in one.where))

    def _row(self, c: Array, offset: float) -> tuple[list[float], float]:
        """Return the coefficients and the offset of `c . q + o` in terms of p."""
        given = [Fraction(float(one)) for one in c]
        row = [sum((a * b[k] for a, b in zip(given, self.back, strict=True)), Fraction(0)) for k in range(len(given))]
        moved = sum((a * Fraction(float(t)) for a, t in zip(row, self.t, strict=True)), Fraction(0))
        return [float(one) for one in row], float(Fraction(offset) - moved)


def new_coordinates(
    axes: Sequence[Axis],
    coupling: Coupling,
    problems: Problems,
    lengths: Sequence[str] = (),
    sources: Mapping[str, str] | None = None,
) -> NewCoordinates | None:
    """Return the coordinates in which axes replace joints; None if there are no axes, or if one has a fault.

    Args:
        axes: The axes.
        coupling: The coupling in terms of joints.
        problems: Collects the faults.
        lengths: Names of prismatic joints, which cannot be added to angles.
        sources: The file of each axis, as in `Annotations.sources`.
    """
    if not axes:
        return None
    names, n = list(coupling.coordinates), len(coupling.coordinates)
    T: Matrix = [[Fraction(int(i == k)) for k in range(n)] for i in range(n)]
    t, faults = [Fraction(0)] * n, len(problems.found)
    for axis in axes:
        source = (sources or {}).get(f"axis {axis.name}")
        strange = [name for name in axis.coefficients if name not in coupling.joints]
        if axis.instead_of not in coupling.coordinates or strange:
            name = strange[0] if strange else axis.instead_of
            hint = name_hint(name, coupling.coordinates)
            problems.add(f"axis {axis.name!r} names {name!r}, which is not a coordinate", hint, axis.line, source)
            continue
        if len({name in lengths for name, c in axis.coefficients.items() if c}) > 1:
            problems.add(
                f"axis {axis.name!r} adds angles and lengths, which have different units",
                "Add angles only",
                axis.line,
                source,
            )
            continue
        place = coupling.coordinates.index(axis.instead_of)
        if names[place] != axis.instead_of:
            said = f"axes {names[place]!r} and {axis.name!r} both replace {axis.instead_of!r}"
            problems.add(said, "Let each axis replace a different joint", axis.line, source)
            continue
        names[place] = axis.name
        rows = [(Fraction(c), coupling.joints.index(joint)) for joint, c in axis.coefficients.items()]
        T[place] = [sum((c * Fraction(float(coupling.S[r, k])) for c, r in rows), Fraction(0)) for k in range(n)]
        t[place] = sum((c * Fraction(float(coupling.offset[r])) for c, r in rows), Fraction(0))
    back = None if len(problems.found) > faults else _inverse(T)
    if back is None:
        if len(problems.found) == faults:
            said = f"the axes {', '.join(axis.name for axis in axes)} do not determine the joints"
            remedy = "Give each axis a coefficient of the joint that it replaces (instead_of)"
            problems.add(said, remedy, axes[0].line, (sources or {}).get(f"axis {axes[0].name}"))
        return None
    matrix = np.array([[float(one) for one in row] for row in T])
    return NewCoordinates(tuple(names), matrix, np.array([float(one) for one in t]), back)


def _inverse(T: Matrix) -> tuple[tuple[Fraction, ...], ...] | None:
    """Return the inverse, by Gauss-Jordan elimination; None if there is none."""
    n = len(T)
    rows = [[*row, *(Fraction(int(i == k)) for k in range(n))] for i, row in enumerate(T)]
    for column in range(n):
        pivot = next((i for i in range(column, n) if rows[i][column]), None)
        if pivot is None:
            return None
        rows[column], rows[pivot] = rows[pivot], rows[column]
        rows[column] = [one / rows[column][column] for one in rows[column]]
        for i in range(n):
            if i != column and rows[i][column]:
                factor = rows[i][column]
                rows[i] = [a - factor * b for a, b in zip(rows[i], rows[column], strict=True)]
    return tuple(tuple(row[n:]) for row in rows)


def joint_home(
    home: Mapping[str, float], axes: Sequence[Axis], problems: Problems, line: int | None, source: str | None
) -> dict[str, float]:
    """Return home in terms of joints if it names axes: the joint that an axis replaces is computed from the others.

    Joints that home does not name are at zero. Home may name both an axis and its joint, if both values agree.
    """
    found = {name: value for name, value in home.items() if name not in {axis.name for axis in axes}}
    for axis in axes:
        if axis.name not in home:
            continue
        rest = sum(c * found.get(joint, 0.0) for joint, c in axis.coefficients.items() if joint != axis.instead_of)
        value = (home[axis.name] - rest) / axis.coefficients[axis.instead_of]
        if abs(found.setdefault(axis.instead_of, value) - value) > HOME:
            said = (
                f"home has {axis.name!r} at {home[axis.name]:.9g}, but the values of its joints at home "
                "give another number"
            )
            problems.add(said, f"Leave {axis.name!r} or {axis.instead_of!r} out", line, source)
    return found
