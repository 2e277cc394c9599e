"""The interface of functions that can be traced in a slice of two coordinates."""

from __future__ import annotations

from typing import Protocol

from pinbound.bounds.derivative_bounds import LeverArms
from pinbound.typing import Array

__all__ = ["Smooth"]


class Smooth(Protocol):
    """A smooth function of two coordinates with bounds of its derivatives, whose zeros can be traced."""

    @property
    def arms(self) -> LeverArms:
        """Bounds over the window: of the quantity compared with the threshold, and its first and second derivatives."""
        ...

    @property
    def scale(self) -> float:
        """The length of the path; rounding is relative to it."""
        ...

    @property
    def threshold(self) -> float:
        """The value of `parts`' third result on the curve."""
        ...

    def value(self, X: Array) -> Array:
        """Return g (N,)."""
        ...

    def value_gradient(self, X: Array) -> tuple[Array, Array]:
        """Return g (N,) and its gradient (N, 2)."""
        ...

    def parts(self, X: Array) -> tuple[Array, Array, Array, Array]:
        """Return g, its gradient, the quantity compared with the threshold, and the sizes of its slopes."""
        ...

    def curvature(self, length: Array, slopes: Array, half: Array) -> Array:
        """Return bounds (N, 2, 2) of g's Hessian over boxes of half-sides `half` (N, 2)."""
        ...
