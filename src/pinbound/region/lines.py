"""Lines and traced curves in a slice, and the line that each side of a polygon belongs to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
import shapely

from pinbound.loops.through_loops import LoopFunction
from pinbound.region.cells import SeparationFunction
from pinbound.region.contours import Traced
from pinbound.region.halfplanes import HalfPlane
from pinbound.region.sliding import SlidingFunction
from pinbound.region.turn_cuts import TurnFunction
from pinbound.typing import Array, Ints
from pinbound.values import Value

__all__ = ["Line", "segment_owners", "vertex_owners"]

gis = cast(Any, shapely)  # its stubs know only part of what its functions take


@dataclass(frozen=True, eq=False)
class Line(Value):
    """A straight line or a traced curve, with the function that is zero on it; None for a wall (undecided place)."""

    name: str
    source: str
    is_contact: bool
    points: Array
    function: Traced | SlidingFunction | SeparationFunction | LoopFunction | TurnFunction | HalfPlane | None

    def value_gradient(self, x: Array) -> tuple[float, Array]:
        """Return the function's value and gradient at one point."""
        if isinstance(self.function, HalfPlane):
            return float(self.function.normal @ x) - self.function.bound, self.function.normal
        if self.function is None:
            return 0.0, np.zeros(2)
        value, gradient = self.function.value_gradient(x[None])
        return float(value[0]), gradient[0]


def vertex_owners(lines: Sequence[Line]) -> tuple[Any, Ints]:
    """Return every line's points as sorted complex keys, and the line of each."""
    points = np.concatenate([line.points for line in lines])
    owners = np.repeat(np.arange(len(lines)), [len(line.points) for line in lines])
    keys = points[:, 0] + 1j * points[:, 1]
    order = np.argsort(keys, kind="stable")
    return keys[order], owners[order]


def segment_owners(lines: Sequence[Line], keys: Any, owners: Ints, ring: Array) -> Ints:
    """Return the line of each segment of a ring: the line of both its ends, or else the nearest to its middle."""
    z = ring[:, 0] + 1j * ring[:, 1]
    left, right = np.searchsorted(keys, z, side="left"), np.searchsorted(keys, z, side="right")
    known = right > left
    at = np.where(known, owners[np.minimum(left, len(keys) - 1)], -1)
    known &= at == owners[np.minimum(np.maximum(right - 1, 0), len(keys) - 1)]
    at = np.where(known, at, -1)
    owner = np.where(at[:-1] == at[1:], at[:-1], -1)
    unsure = np.flatnonzero(owner < 0)
    if len(unsure):
        middle = gis.points(0.5 * (ring[unsure] + ring[unsure + 1]))
        shapes = np.array([gis.linestrings(line.points) for line in lines])
        owner[unsure] = np.argmin(gis.distance(shapes[None, :], middle[:, None]), axis=1)
    return owner
