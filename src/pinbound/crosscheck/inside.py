"""Bodies completely inside another body's mesh: a mesh is a surface, so coal reports no contact there.

Let A be a mesh with a closed surface, and P a connected piece of another body that does not touch A. Then P is
completely inside A or completely outside, and one point p of P decides. The winding number of A about p,

    w(p) = sum_T Omega_T / (4 pi),   tan(Omega_T / 2) = det(a, b, c) / (|a||b||c| + (a.b)|c| + (b.c)|a| + (c.a)|b|),

where a, b, c are the corners of triangle T relative to p, is a whole number: 0 outside, not 0 inside (negative if the
triangles are oriented inwards). The distance of p from every triangle is at least the gap of the bodies. So rounding is
far too small to change the decision: p counts as inside if |w| is above 1/2. For a mesh with holes w is not a whole
number; the same rule then means that more than half of the directions from p meet the mesh from behind.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pinbound.crosscheck.engine import Engine
from pinbound.meshes import pieces
from pinbound.typing import Array, Flags, Ints
from pinbound.values import Value

__all__ = ["Insides", "winding_numbers"]

_AT_ONCE = 500_000  # triangles times places, to bound memory


@dataclass(frozen=True, eq=False)
class _Solid(Value):
    """The data of a shape for this test.

    Attributes:
        places: (k, 3) [m], one point of each connected piece, in the shape's frame.
        surface: (m, 3, 3) [m], the corners of its triangles; None for shapes that are solid in coal.
    """

    places: Array
    surface: Array | None


class Insides:
    """Finds where a shape, or a connected piece of it, is completely inside the mesh of another.

    Example:
        >>> import pinbound as pb
        >>> from pinbound.crosscheck.engine import point_engine
        >>> robot = pb.load("minervabot_v3")
        >>> Insides(point_engine(robot)).of_pair(0, robot.home[None])[0].tolist()  # points have no inside
        [False]
    """

    def __init__(self, engine: Engine) -> None:
        """Take the shapes of an engine."""
        self._engine = engine
        self._solids: dict[int, _Solid] = {}

    def of_pair(self, pair: int, Q: Array, poses: tuple[Array, Array] | None = None) -> tuple[Flags, Flags]:
        """Return where the first shape of a pair is inside the second (N,), and the second inside the first (N,).

        The result is valid for rows of Q (N, n) at which the two shapes do not touch. `poses` is the result of
        `Engine.poses` for Q, if it is known.
        """
        first, second = self._engine.pairs[pair]
        a, b = self._solid(first), self._solid(second)
        if not len(Q) or (a.surface is None and b.surface is None):
            return np.zeros(len(Q), dtype=np.bool_), np.zeros(len(Q), dtype=np.bool_)
        rotations, origins = self._engine.poses(Q) if poses is None else poses
        at_a, at_b = (rotations[:, first], origins[:, first]), (rotations[:, second], origins[:, second])
        return _within(a, at_a, b, at_b), _within(b, at_b, a, at_a)

    def _solid(self, shape: int) -> _Solid:
        if shape not in self._solids:
            found = self._engine.triangles(shape)
            if found is None:
                self._solids[shape] = _Solid(np.zeros((1, 3)), None)
            else:
                self._solids[shape] = _Solid(_one_of_each_piece(*found), found[0][found[1]])
        return self._solids[shape]


def _one_of_each_piece(corners: Array, triangles: Ints) -> Array:
    """Return a corner (k, 3) of every connected piece; corners at the same point count as one."""
    same, of = np.unique(corners, axis=0, return_inverse=True)
    rows = of.reshape(-1)[triangles]
    used = np.unique(rows)
    _, first = np.unique(pieces(rows, len(same))[used], return_index=True)
    return same[used[first]]


def _within(inner: _Solid, at: tuple[Array, Array], outer: _Solid, around: tuple[Array, Array]) -> Flags:
    """Return where (N,) a piece of `inner` is inside the surface of `outer`; poses are those of `Engine.poses`."""
    found = np.zeros(len(at[1]), dtype=np.bool_)
    if outer.surface is None:
        return found
    low, high = outer.surface.min(axis=(0, 1)), outer.surface.max(axis=(0, 1))
    for place in inner.places:
        world = at[0] @ place + at[1]
        local = np.einsum("nij,ni->nj", around[0], world - around[1])
        rows = np.flatnonzero(np.all((local >= low) & (local <= high), axis=1) & ~found)
        found[rows] = np.abs(winding_numbers(outer.surface, local[rows])) > 0.5
    return found


def winding_numbers(surface: Array, places: Array) -> Array:
    """Return how often a surface winds around points (k,): 1 inside, 0 outside, for counter-clockwise triangles.

    Args:
        surface: (m, 3, 3) [m], corners of triangles.
        places: (k, 3) [m], not on the surface.

    Example:
        >>> a, b, c, d = np.zeros(3), np.eye(3)[0], np.eye(3)[1], np.eye(3)[2]
        >>> corner = np.array([[a, c, b], [a, b, d], [a, d, c], [b, c, d]])
        >>> winding_numbers(corner, np.array([[0.1, 0.1, 0.1], [0.5, 0.5, 0.5]])).round(12).tolist()
        [1.0, 0.0]
    """
    found = np.zeros(len(places))
    step = max(1, _AT_ONCE // max(1, len(surface)))
    for start in range(0, len(places), step):
        seen = surface[None] - places[start : start + step, None, None]
        a, b, c = seen[:, :, 0], seen[:, :, 1], seen[:, :, 2]
        la, lb, lc = (np.linalg.norm(one, axis=2) for one in (a, b, c))
        volume = np.einsum("kti,kti->kt", a, np.cross(b, c))
        dots = (np.einsum("kti,kti->kt", x, y) * length for x, y, length in ((a, b, lc), (b, c, la), (c, a, lb)))
        found[start : start + step] = np.sum(np.arctan2(volume, la * lb * lc + sum(dots)), axis=1) / (2.0 * np.pi)
    return found + 0.0
