"""Bodies with more than three edge vectors, rewritten with three. This is possible because a body is rigid.

The same rotations rotate all edge vectors of a body, and the blocks of a chain are linear in the edge: `E = A B` with
three rows B, orthonormal over all blocks. So `sum_i t_i E_i = (t A) B`, where t A has three numbers for each vertex.
The difference by rounding is measured, and returned.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pinbound.path.chain import HullChain
from pinbound.path.relative import RelativePath
from pinbound.tolerances import UNIT_ROUNDOFF
from pinbound.typing import Array

__all__ = ["in_three_edges"]

_EDGES = 3
_RIGID = 1e-12  # relative: a larger fourth singular value is not rounding
_ROUNDING = 64.0 * UNIT_ROUNDOFF  # an edge, relative to the body's size: products, their sums, and the difference


def in_three_edges(path: RelativePath) -> tuple[RelativePath, float]:
    """Return the path with at most three edge vectors for each body, and a bound of its separation's change [m].

    It is the path itself and zero if no body has more, or if the edges of a body are not those of a rigid body.
    """
    difference = path.difference
    first, second = difference.corners
    if max(first.shape[1], second.shape[1]) <= _EDGES:
        return path, 0.0
    split = first.shape[1]
    one, other = _rewritten(first, difference.directions[:split]), _rewritten(second, difference.directions[split:])
    if one is None or other is None:
        return path, 0.0
    found = HullChain(difference.chain, one.edges + other.edges, (one.vertices, other.vertices))
    return replace(path, difference=found), one.off + other.off


@dataclass(frozen=True, eq=False)
class _Body:
    vertices: Array
    edges: tuple[Array, ...]
    off: float
    """Largest allowed displacement of a vertex [m]."""


def _rewritten(vertices: Array, edges: tuple[Array, ...]) -> _Body | None:
    """Return a body with at most three edges; None if it is not rigid."""
    if len(edges) <= _EDGES:
        return _Body(vertices, edges, 0.0)
    stacked = np.array(edges).reshape(len(edges), -1)
    _, sizes, rows = np.linalg.svd(stacked)
    if sizes[_EDGES] > _RIGID * sizes[0]:
        return None
    basis, moved = rows[:_EDGES], vertices @ stacked
    found = moved @ basis.T
    rest = (moved - found @ basis).reshape(len(moved), -1, 3)
    size = float(np.abs(vertices).max(axis=0) @ np.linalg.norm(stacked, axis=1))
    off = float(np.linalg.norm(rest, axis=2).sum(axis=1).max()) + _ROUNDING * len(edges) * size
    return _Body(found, tuple(basis.reshape(_EDGES, -1, 3)), off)
