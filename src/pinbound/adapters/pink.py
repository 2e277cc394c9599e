"""Pink: boundaries as a barrier, step-safe rows as a limit, convex regions as a limit (`pip install pin-pink`).

Prefer `StepLimit`: no step within it meets a boundary. `BoundaryBarrier` is like Pink's own barriers: its rows come
from the gradient alone, so they are valid only for short steps.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pinbound.adapters.shared import Polytope, SafeSteps, optional
from pinbound.exceptions import DimensionError, UnsupportedError
from pinbound.robot.robot import Robot
from pinbound.typing import Array

__all__ = ["BoundaryBarrier", "PolytopeLimit", "StepLimit"]

_Limit: Any = optional("pink.limits", "Limit", "pin-pink")
_Barrier: Any = optional("pink.barriers", "Barrier", "pin-pink")


class StepLimit(_Limit):
    """No step within `G dq <= h` meets a boundary or passes a joint limit, whatever dt (`docs/steps.md`).

    Use it in `pink.solve_ik(..., limits=[StepLimit(robot, model)])`. It includes joint limits, also of mimic joints,
    and the speeds; Pink's own limits may be used in addition. `steps.last.blocked` names the boundaries in contact at
    q. If there are any, the program may have no solution, and Pink raises `NoSolutionFound`. Otherwise dq = 0 satisfies
    all rows.

    Attributes:
        steps: The object that makes the rows, with the rows of the last step in `steps.last`.
    """

    def __init__(
        self,
        robot: Robot,
        model: Any,
        velocity: ArrayLike | Mapping[str, float] | None = None,
        boundaries: Sequence[str] | str | None = None,
        **options: Any,
    ) -> None:
        """Bind the limit to the model of Pink's configurations.

        Args:
            robot: The robot.
            model: A `pinocchio.Model` of it, as for `Robot.on`.
            velocity: The largest speed of each coordinate [rad/s or m/s], (n,), one number, or by name; None: the
                model's `velocityLimit`.
            boundaries: Names of boundaries; None: all.
            options: `most`, `gain`, `margin`, `reserve`, `limits`, as for `StepBounds.rows`.

        Raises:
            DimensionError: If it is not a model of this robot, or a coordinate has no speed.
            UnsupportedError: If Pink is not installed.
        """
        _Limit.__init__(self)
        view = robot.on(model)
        given = _velocities(robot, model, view.E) if velocity is None else velocity
        self.steps = SafeSteps(robot, view, given, boundaries, **options)

    def compute_qp_inequalities(self, configuration: Any, dt: float) -> tuple[Array, Array]:
        """Return G (k, nv) and h (k,) with `G dq <= h`."""
        return self.steps.half_spaces(configuration.q, dt)


def _velocities(robot: Robot, model: Any, E: Array) -> Array:
    limits = np.array(model.velocityLimit, dtype=np.float64)
    found = np.ones(len(robot.coordinates))
    for row, name in enumerate(robot.coordinates):
        column = np.flatnonzero(E[row])
        if not len(column):
            continue  # the model locks it
        found[row] = limits[int(column[0])]
        if not 0.0 < found[row] < np.inf:
            said = f"the model's velocityLimit of {name!r} is {found[row]:.6g}"
            raise DimensionError(f"{said}; give velocity=, the largest speed of each coordinate")
    return found


class PolytopeLimit(_Limit):
    """A convex region, or `A q <= b`, as a limit: if q is inside the set, no step leaves it."""

    def __init__(self, robot: Robot, model: Any, A: Any, b: ArrayLike | None = None) -> None:
        """Take a convex `Region` of all coordinates that boundaries depend on, or A (k, n) and b (k,) for q.

        Raises:
            UnsupportedError: If the region is not convex, or boundaries depend on coordinates that it fixes, or Pink is
                not installed.
            DimensionError: If A and b do not fit, or it is not a model of this robot.
        """
        _Limit.__init__(self)
        self.polytope = Polytope(robot, robot.on(model), A, b)

    def compute_qp_inequalities(self, configuration: Any, dt: float) -> tuple[Array, Array]:
        """Return G (k, nv) and h (k,) with `G dq <= h`."""
        return self.polytope.half_spaces(configuration.q)


class BoundaryBarrier(_Barrier):
    """Signed clearances as a control barrier function, with one row for each boundary, in order: `J v >= -gain h`.

    Rows hold to first order in the step. Nothing is cached between calls: Pink's base class would reuse J and h while q
    is nearly the same, and could let a slow robot pass a boundary.
    """

    def __init__(
        self, robot: Robot, model: Any, boundaries: Sequence[str] | str | None = None, gain: float | Array = 1.0
    ) -> None:
        """Bind the barrier to the model of Pink's configurations.

        Args:
            robot: The robot.
            model: A `pinocchio.Model` of it, as for `Robot.on`.
            boundaries: Names of boundaries; None: all.
            gain: As for `pink.barriers.Barrier` [1/s].

        Raises:
            DimensionError: If it is not a model of this robot.
            UnsupportedError: If Pink is not installed.
        """
        view = robot.on(model)
        self.view = view if boundaries is None else view.select(boundaries)
        _Barrier.__init__(self, len(self.view.boundaries), gain=gain, safe_displacement_gain=0.0)

    def compute_barrier(self, configuration: Any) -> Array:
        """Return the signed clearances (dim,) [m]."""
        return self.view.clearances(configuration.q)

    def compute_jacobian(self, configuration: Any) -> Array:
        """Return their gradients (dim, nv).

        Raises:
            UnsupportedError: If bodies overlap: their distance is zero, and has no gradient.
        """
        J = self.view.gradients(configuration.q)
        bad = np.flatnonzero(~np.all(np.isfinite(J), axis=1))
        if len(bad):
            name = self.view.boundaries.names[int(bad[0])]
            raise UnsupportedError(
                f"boundary {name!r} has a distance of zero, which has no gradient; start out of contact"
            )
        return J

    def compute_qp_inequalities(self, configuration: Any, dt: float = 1e-3) -> tuple[Array, Array]:
        """Return G (dim, nv) and h (dim,) with `G dq <= h`, exactly at this q."""
        values = self.compute_barrier(configuration)
        bound = np.array([k * self.gain_function(x) for k, x in zip(self.gain, values, strict=True)])
        return -self.compute_jacobian(configuration) / dt, bound
