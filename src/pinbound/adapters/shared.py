"""Shared parts of adapters: optional classes of a library, and step-safe rows in terms of a model's velocity."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pinbound.adapters.steps import StepBounds, StepRows
from pinbound.exceptions import DimensionError, UnsupportedError
from pinbound.model.coupling import real_array
from pinbound.region import Region
from pinbound.robot.model_view import ModelView
from pinbound.robot.robot import Robot
from pinbound.robot.speeds import largest_speeds
from pinbound.typing import Array

__all__ = ["Polytope", "SafeSteps", "half_spaces_of", "optional"]


def optional(module: str, name: str, package: str) -> Any:
    """Return a class of a library, or a class whose constructor reports that the library is missing.

    Example:
        >>> optional("no_such_library", "Limit", "no-such")()
        Traceback (most recent call last):
        pinbound.exceptions.UnsupportedError: this needs no-such, ... pip install 'pinbound[bridges]'
    """
    try:
        return getattr(import_module(module), name)
    except ImportError:
        return _missing(package)


def _missing(package: str) -> type:
    class Missing:
        """A substitute for a class of a library that is not installed."""

        def __init__(self, *_: Any, **__: Any) -> None:
            raise UnsupportedError(f"this needs {package}, which is not installed: pip install 'pinbound[bridges]'")

    return Missing


class SafeSteps:
    """Step-safe rows in terms of a model's displacement: `G (v dt) <= h`.

    Attributes:
        view: The robot's boundaries as functions of the model's q.
        velocity: (n,) the largest speed of each coordinate [rad/s or m/s]: the box of a step is `velocity * dt`.
        last: The rows of the last step, with the names of near boundaries (`StepRows`); None before the first step.
    """

    def __init__(
        self,
        robot: Robot,
        view: ModelView,
        velocity: ArrayLike | Mapping[str, float],
        boundaries: Sequence[str] | str | None = None,
        **options: Any,
    ) -> None:
        """Prepare the rows; `options` are those of `StepBounds.rows`."""
        self.view, self.options = view, options
        self.velocity = largest_speeds(robot, velocity)
        self.bounds = StepBounds(robot, boundaries)
        self.bounds.prepare()  # now, and not during a motion
        self.last: StepRows | None = None
        moving = np.any(view.E != 0.0, axis=1)
        self._box = view.E[moving]
        self._moving = moving

    def half_spaces(self, q: ArrayLike, dt: float) -> tuple[Array, Array]:
        """Return G (k, nv) and h (k,) at the model's q for a step of dt [s].

        Raises:
            DimensionError: If dt is not positive, or q is refused (`ModelView.configurations`).
        """
        if not 0.0 < dt < np.inf:
            raise DimensionError(f"dt is {dt}; give a positive number of seconds")
        rows = self.last = self.bounds.rows(self.view.configurations(q), self.velocity * dt, **self.options)
        side = rows.step[self._moving]
        G = np.vstack((rows.A @ self.view.E, self._box, -self._box))
        return G, np.concatenate((rows.b, side, side))


class Polytope:
    """A convex set `A q <= b` of a robot's coordinates, in terms of a model's displacement.

    From a q inside it, every d with `A E d <= b - A q` stays inside, and so does the straight path, because the set is
    convex.
    """

    def __init__(self, robot: Robot, view: ModelView, A: Any, b: ArrayLike | None = None) -> None:
        """Take a convex region of all coordinates that the boundaries depend on, or A (k, n) and b (k,).

        Raises:
            UnsupportedError: If the region is not convex, or boundaries depend on coordinates that it fixes.
            DimensionError: If A and b do not fit.
        """
        self.view = view
        self.A, self.b = half_spaces_of(robot, A, b)

    def half_spaces(self, q: ArrayLike) -> tuple[Array, Array]:
        """Return G (k, nv) and h (k,) with `G d <= h` at the model's q."""
        return self.A @ self.view.E, self.b - self.A @ self.view.configurations(q)


def half_spaces_of(robot: Robot, A: Any, b: ArrayLike | None = None) -> tuple[Array, Array]:
    """Return A (k, n) and b (k,) of a convex region of all coordinates that the boundaries depend on, or two arrays.

    Raises:
        UnsupportedError: If the region is not convex, or boundaries depend on coordinates that it fixes.
        DimensionError: If A and b do not fit.
    """
    if isinstance(A, Region):
        rows, bound = _of_region(robot, A)
    else:
        rows, bound = real_array(A, "A"), real_array([] if b is None else b, "b")
    n = len(robot.coordinates)
    if rows.ndim != 2 or rows.shape[1] != n or bound.shape != (len(rows),):
        raise DimensionError(f"A has shape {rows.shape} and b {bound.shape}; give (k, {n}) and (k,)")
    return rows, bound


def _of_region(robot: Robot, region: Region) -> tuple[Array, Array]:
    held = {name for one in robot.boundaries for name in one.coordinates} - set(region.coordinates)
    if held:
        said = (
            f"boundaries depend on {', '.join(sorted(held))}, which the region of {', '.join(region.coordinates)} holds"
        )
        raise UnsupportedError(f"{said}: its half-planes do not hold when these coordinates change. Use step-safe rows")
    edges, bounds = region.halfspaces()
    A = np.zeros((len(edges), len(robot.coordinates)))
    A[:, [robot.coordinates.index(name) for name in region.coordinates]] = edges
    return A, bounds
