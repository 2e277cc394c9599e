"""The coupling of a robot with loops that are not parallelograms: a function of q, and not a matrix."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike

from pinbound.exceptions import UnsupportedError
from pinbound.loops.lift import Lift, lifted_names, places
from pinbound.loops.linkages import Linkage
from pinbound.loops.solving import toggles
from pinbound.model.coupling import Coupling, LinearLimit, linear_text
from pinbound.typing import Array

__all__ = ["LoopCoupling", "lifted", "refuse_linear", "toggle_limits"]


_WHOLE_TURN = np.pi * (1.0 - 1e-9)


def refuse_linear(what: str, lift: Lift) -> NoReturn:
    """Refuse a method that would treat passive joints of these loops as linear functions of q.

    Raises:
        UnsupportedError: Always, with the names of the loops.
    """
    names = ", ".join(repr(one.name) for one in lift.linkages)
    message = f"{what}: loop {names} is not a parallelogram, so that its passive joints are not linear functions of q"
    raise UnsupportedError(
        f"{message}. Supported through it are: values, gradients, Hessians, signed clearances, free, certify, "
        "certify_box, certified_box, feasible_region, limits, cross_check of points and bodies, coupling.expand, "
        "to_pinocchio"
    )


class LoopCoupling(Coupling):
    """`theta = S F(q) + o`, where F is a `Lift`. A request for a matrix over q is refused with the name of the loop.

    Attributes:
        opened: `theta = S z + o`, linear in all of z.
        lift: `z = F(q)`.
    """

    def __init__(self, opened: Coupling, lift: Lift) -> None:
        """Store both maps."""
        object.__setattr__(self, "coordinates", lift.coordinates)
        object.__setattr__(self, "joints", opened.joints)
        object.__setattr__(self, "opened", opened)
        object.__setattr__(self, "lift", lift)

    opened: Coupling
    lift: Lift

    def __getattr__(self, name: str) -> Any:
        """Refuse the matrix and the offset.

        Raises:
            UnsupportedError: For `S` and `offset`.
            AttributeError: For any other name.
        """
        if name in ("S", "offset"):
            refuse_linear(f"coupling.{name} does not exist", self.lift)
        raise AttributeError(name)

    def expand(self, Q: ArrayLike) -> Array:
        """Return `theta = S F(q) + o` for one q (n,) or many (N, n); shape (n_tree,) or (N, n_tree).

        Raises:
            DimensionError: If the last axis of Q is not n long.
        """
        return self.opened.expand(self.lift(Q))

    def row(self, joint: str) -> tuple[Array, float]:
        """Return the coefficients (n,) and the offset of one tree joint that no such loop moves.

        Raises:
            UnsupportedError: If the joint is passive in a loop that is not a parallelogram.
        """
        coefficients, offset = self.opened.row(joint)
        n = len(self.coordinates)
        if np.any(coefficients[n:]):
            refuse_linear(f"joint {joint!r} has no coefficients", self.lift)
        return coefficients[:n].copy(), offset

    def text(self, joint: str) -> str:
        """Return the value of a joint in terms of q, for people; for passive joints, the loop that moves them."""
        coefficients, offset = self.opened.row(joint)
        n = len(self.coordinates)
        if not np.any(coefficients[n:]):
            return linear_text(coefficients[:n], self.coordinates, offset)
        moving = {
            self.lift.names[index]: self._function(index)
            for index in np.flatnonzero(coefficients).tolist()
            if index >= n
        }
        names = [moving.get(name, name) for name in self.lift.names]
        return linear_text(coefficients, names, offset)

    def solved(self, used: Iterable[str]) -> dict[str, str]:
        """Return the joints, of those given, that a loop determines, each with its loop and the joints used there."""
        passive = [index for one in self.lift.linkages for index in one.passive if self.lift.names[index] in used]
        return {self.lift.names[index]: self._function(index) for index in passive}

    def _function(self, index: int) -> str:
        one = next(one for one in self.lift.linkages if index in one.passive)
        return f"{one.name}({', '.join(self.lift.names[k] for k in one.inputs)})"


def lifted(coupling: Coupling, linkages: tuple[Linkage, ...]) -> tuple[Coupling, Lift]:
    """Return a coupling over z, in which passive joints and toggles are coordinates, and the map from q to z.

    Args:
        coupling: The coupling over all joints that no parallelogram couples, also passive joints.
        linkages: The loops over its coordinates, in the order in which they are solved.
    """
    names = lifted_names(coupling.coordinates, linkages)
    where = places(coupling.coordinates, linkages)

    def moved(array: Array) -> Array:
        wide = np.zeros((*array.shape[:-1], len(names)))
        wide[..., where] = array
        return wide

    solved = tuple(
        replace(
            one,
            angles=moved(one.angles),
            slides=moved(one.slides),
            rows=moved(one.rows),
            passive=(where[one.passive[0]], where[one.passive[1]]),
        )
        for one in linkages
    )
    n = len(coupling.coordinates) - 2 * len(linkages)
    whole = Coupling(names, coupling.joints, moved(coupling.S), coupling.offset)
    return whole, Lift(names[:n], names, solved)


def toggle_limits(lift: Lift, home: Array) -> tuple[LinearLimit, ...]:
    """Return the limits of z that keep loops closed, in home's assembly; named ``"LOOP toggle"`` and ``"LOOP turn"``.

    Args:
        lift: The loops.
        home: (n + k,) home, lifted.
    """
    found: list[LinearLimit] = []
    unit = np.eye(len(lift.names))
    for one, columns in zip(lift.linkages, lift.columns, strict=True):
        names = [lift.names[index] for index in columns[2:]]
        low, high = one.transmission_range
        found.append(LinearLimit(names[0], unit[columns[2]], 0.0, low, high))
        if one.ahead < 0:
            found.append(LinearLimit(names[1], unit[columns[3]], 0.0, -_WHOLE_TURN, _WHOLE_TURN))
        at = toggles(one)
        if at is None:
            continue
        value = float(at.row @ home)
        for first, last in at.kept:
            turns = 2.0 * np.pi * np.floor((value - first) / (2.0 * np.pi))
            if first + turns <= value <= last + turns:
                sign = float(np.sign(at.row[np.flatnonzero(at.row)[0]]))  # "upper" refers to its first coordinate
                ends = sorted((sign * (first + turns), sign * (last + turns)))
                found.append(LinearLimit(names[0], sign * at.row + 0.0, 0.0, ends[0], ends[1]))
    return tuple(found)
