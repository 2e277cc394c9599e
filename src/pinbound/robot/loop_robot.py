"""A robot with loops that are not parallelograms: a robot over z, whose loops are open, evaluated at `z = F(q)`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pinbound.boundaries.looped import LoopBoundarySet
from pinbound.coverage import Coverage
from pinbound.exceptions import UnknownNameError
from pinbound.loops.closures import Closure
from pinbound.loops.lift import Lift
from pinbound.loops.loop_coupling import LoopCoupling, refuse_linear
from pinbound.model.coupling import GuardedLimit, Intervals, as_configurations
from pinbound.robot.model_view import ModelView
from pinbound.robot.robot import Robot
from pinbound.typing import Array, Flags

__all__ = ["LoopClosure", "LoopIntervals", "LoopRobot"]


@dataclass(frozen=True, eq=False)
class LoopIntervals(Intervals):
    """All limits and rules over z, also of passive joints and toggles, as functions of q."""

    lift: Lift | None = None

    def hold(self, Q: Array) -> Flags:
        """Return which rows (N,) of Q (N, n) keep all limits."""
        assert self.lift is not None
        return super().hold(self.lift(Q))

    def holds_at(self, q: Sequence[float]) -> bool:
        """Return `hold` for one q."""
        assert self.lift is not None
        return super().holds_at(self.lift(np.array(q, dtype=np.float64)).tolist())


@dataclass(frozen=True, eq=False)
class LoopClosure(Closure):
    """A pin of a robot with loops that are not parallelograms, evaluated at `z = F(q)`.

    Attributes:
        lift: `z = F(q)`.
        is_solved: Whether the loop of this pin is solved in closed form; then it closes for every q within the limits.
    """

    lift: Lift | None = None
    is_solved: bool = False

    def residuals(self, Q: Array) -> Array:
        """Return the gap (N,) [m] between the two ends of the pin."""
        assert self.lift is not None
        return super().residuals(self.lift(Q))

    @property
    def left(self) -> float:
        """The remaining offsets of the loop [m]; none if the closed form closes it."""
        return 0.0 if self.is_solved else super().left


class LoopRobot(Robot):
    """A robot with loops that are not parallelograms.

    `coupling.expand`, values, gradients, Hessians, certificates and cross-checks take the loops into account. Methods
    that do not yet do so refuse, with the names of the loops.

    Attributes:
        opened: The robot over z: q, the passive joints, and a transmission coordinate of each loop, whose limits are
            its toggles.
        lift: `z = F(q)`.
    """

    coupling: LoopCoupling
    opened: Robot
    lift: Lift

    def __init__(self, opened: Robot, lift: Lift, again: Callable[[Robot, Any], Robot] | None = None) -> None:
        """Hold the robot over z."""
        solved = {one.name for one in lift.linkages}
        values = {
            "document": opened.document,
            "tree": opened.tree,
            "annotations": opened.annotations,
            "coupling": LoopCoupling(opened.coupling, lift),
            "closures": tuple(
                LoopClosure(one.mark, one.path, one.deviations, one.apart, lift, one.name in solved)
                for one in opened.closures
            ),
            "boundaries": LoopBoundarySet(opened.boundaries, lift),
            "home": _own(opened.home, lift),
            "notes": opened.notes,
            "package_dirs": opened.package_dirs,
            "again": again,
            "opened": opened,
            "lift": lift,
        }
        for name, value in values.items():
            object.__setattr__(self, name, value)

    def __getattr__(self, name: str) -> Any:
        """Refuse limits as rows over q, because these rows do not contain the limits of loops.

        Raises:
            UnsupportedError: For `linear_limits`.
            AttributeError: For any other name.
        """
        if name == "linear_limits":
            refuse_linear("robot.linear_limits do not exist", self.lift)
        raise AttributeError(name)

    @property
    def guarded_limits(self) -> tuple[GuardedLimit, ...]:  # type: ignore[override]
        """Raises an error, like `linear_limits`.

        Raises:
            UnsupportedError: Always, with the names of the loops.
        """
        refuse_linear("robot.guarded_limits do not exist", self.lift)

    @cached_property
    def intervals(self) -> Intervals:
        """All limits and rules as one value, whose `hold(Q)` says which configurations keep them."""
        one = self.opened.intervals
        return LoopIntervals(one.coefficients, one.low, one.high, one.is_sum, one.guarded, self.lift)

    @cached_property
    def coverage(self) -> Coverage:
        """Which pairs of links are watched, left out (with the reason), or not watched."""
        return self.opened.coverage

    def on(self, model: Any) -> ModelView:
        """Refuse: gradients over the v of a model, in which passive joints are free, are not available through loops.

        Raises:
            UnsupportedError: Always, with the names of the loops.
        """
        refuse_linear("robot.on(model) is not derived", self.lift)

    def export(self, kind: str, path: str | Path, boundaries: Sequence[str] | str | None = None) -> tuple[Path, ...]:
        """Refuse: the export does not support loops.

        Raises:
            UnsupportedError: Always, with the names of the loops.
        """
        refuse_linear(f"export({kind!r}) is not written", self.lift)

    def closure_residuals(self, Q: ArrayLike) -> Array:
        """Return the gap of every closure, (n_closures,) or (N, n_closures) [m]."""
        return self.opened.closure_residuals(self.lift(Q))

    def positions(self, link: str, Q: ArrayLike, xyz: Sequence[float] = (0.0, 0.0, 0.0)) -> Array:
        """Return the position of a point of a link in the frame of the root link: (3,) or (N, 3) [m].

        Raises:
            UnknownNameError: If the link does not exist.
        """
        if link not in self.tree.links:
            raise UnknownNameError("link", link, self.tree.links)
        return self.opened.positions(link, self.lift(as_configurations(Q, self.coordinates)), xyz)


def _own(home: Array, lift: Lift) -> Array:
    found = home[: len(lift.coordinates)].copy()
    found.flags.writeable = False
    return found
