"""Closed loops: pins that join two links of the tree, and the proof that they stay joined.

The reduced path of a closure that always closes is empty: all its offsets cancel. What is left bounds the residual
for every q at once, `|r(q)| <= sum_i |s_i|` (rotations keep lengths), so no sampling is needed to accept a loop.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pinbound.annotations import ClosureMark, Point
from pinbound.coupling import Coupling
from pinbound.interpreters import numeric
from pinbound.path import RelativePath, relative_path
from pinbound.tolerances import CLOSURE, REDUCTION
from pinbound.tree import Tree

__all__ = ["Closure", "close"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Closure:
    """A pin between two links, with the path around its loop.

    Attributes:
        mark: The annotation.
        path: The relative path between the two ends of the pin.
    """

    mark: ClosureMark
    path: RelativePath

    @property
    def name(self) -> str:
        """Its name in the annotations."""
        return self.mark.name

    def residuals(self, Q: Array) -> Array:
        """Return the gap (N,) [m] between the two ends of the pin, from both branches, nothing cancelled."""
        return numeric.norm(
            numeric.positions(self.path.branch_a.chain, Q) - numeric.positions(self.path.branch_b.chain, Q)
        )

    @property
    def bound(self) -> float:
        """A proven upper bound of the residual over all q [m]; infinite if the loop slides open."""
        chain = self.path.minimal
        if np.any(chain.slides):
            return math.inf
        folded = REDUCTION * chain.scale  # what the reduction may have taken for zero
        return float(np.sum(np.linalg.norm(chain.offsets, axis=1))) + folded

    @property
    def closes(self) -> bool:
        """Whether the proven bound is below `tolerances.CLOSURE`."""
        return self.bound <= CLOSURE


def close(tree: Tree, coupling: Coupling, mark: ClosureMark) -> Closure:
    """Derive the path around a loop.

    Raises:
        UnsupportedError: If a floating or planar joint is part of the loop.
    """
    ends = (Point("a", mark.link_a, mark.xyz_a), Point("b", mark.link_b, mark.xyz_b))
    return Closure(mark, relative_path(tree, coupling, *ends))
