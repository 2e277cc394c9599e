"""The map from a slice of two coordinates to the plane in which a frame moves, with bounds of its derivatives.

If the other coordinates are fixed, and all remaining rotations are about one direction n, the frame's position is

    p(x) = sum_i R(n, g_i . x) (s_i + L_i x) + const,   det(x) = n . (dp/dx_1 x dp/dx_2),

which stays in a plane normal to n. The length of a term is at most `B_i = |s_i| + sum_k |L_ik| max |x_k|`, so

    |dp/dx_k| <= sum_i |g_ik| B_i + |L_ik|,
    |d2p/dx_j dx_k| <= sum_i |g_ij g_ik| B_i + |g_ij| |L_ik| + |g_ik| |L_ij|,

and similarly for the third derivatives.

`docs/workspace.md` derives both.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pinbound.evaluate import numeric
from pinbound.exceptions import UnsupportedError
from pinbound.path.chain import Chain, are_parallel
from pinbound.tolerances import REDUCTION
from pinbound.typing import Array

__all__ = ["PlanarImage", "planar_image"]

_PLANE = 2


@dataclass(frozen=True)
class PlanarImage:
    """The position of a frame in a plane of space, as a function of two coordinates.

    Attributes:
        chain: The chain over the two coordinates.
        origin: (3,) origin of the plane's own frame, in the root link's frame [m].
        u: (3,) first unit vector of the plane.
        v: (3,) second unit vector; `n = u x v` is the plane's normal.
        most: (2,) the largest absolute value of each coordinate that occurs [rad or m], for the bounds.
    """

    chain: Chain
    origin: Array
    u: Array
    v: Array
    most: Array

    @property
    def normal(self) -> Array:
        """(3,) unit normal `u x v` of the plane."""
        return np.cross(self.u, self.v)

    @property
    def offset(self) -> float:
        """Signed distance of the plane from its own frame's origin along the normal [m]."""
        return float(self.normal @ (numeric.positions(self.chain, np.zeros((1, _PLANE)))[0] - self.origin))

    def points(self, X: Array) -> Array:
        """Return the positions (N, 3) [m] in the root link's frame for X (N, 2)."""
        return numeric.positions(self.chain, X)

    def image(self, X: Array) -> Array:
        """Return the positions (N, 2) [m] in the plane's own frame."""
        return (self.points(X) - self.origin) @ np.column_stack((self.u, self.v))

    def jacobian(self, X: Array) -> Array:
        """Return the derivative (N, 2, 2) of `image`."""
        return np.einsum("ai,nik->nak", np.array((self.u, self.v)), numeric.derivative(self.chain, X))

    def determinant(self, X: Array) -> Array:
        """Return the Jacobian's determinant (N,) [m^2/rad^2]: positive keeps the orientation, zero is a fold."""
        J = self.jacobian(X)
        return J[:, 0, 0] * J[:, 1, 1] - J[:, 0, 1] * J[:, 1, 0]

    @cached_property
    def _terms(self) -> tuple[Array, Array, Array]:
        """Return |g| (m, 2), B (m,) and |L| (m, 2) of the sum over cumulative angles."""
        g = np.abs(self.chain.planar_angles)
        slides = np.linalg.norm(self.chain.slides, axis=1)
        return g, np.linalg.norm(self.chain.offsets, axis=1) + slides @ self.most, slides

    @cached_property
    def first_bound(self) -> Array:
        """(2,) bound of |dp/dx_k|."""
        g, lengths, slides = self._terms
        return g.T @ lengths + slides.sum(axis=0)

    @cached_property
    def second_bound(self) -> Array:
        """(2, 2) bound of |d2p/dx_j dx_k|."""
        g, lengths, slides = self._terms
        return (g.T * lengths) @ g + g.T @ slides + slides.T @ g

    @cached_property
    def third_bound(self) -> Array:
        """(2, 2, 2) bound of |d3p/dx_j dx_k dx_l|."""
        g, lengths, slides = self._terms
        third = np.einsum("i,ij,ik,il->jkl", lengths, g, g, g)
        for pair in ("ij,ik,il->jkl", "ij,ik,il->jlk", "ij,ik,il->ljk"):
            third = third + np.einsum(pair, g, g, slides)
        return third

    @property
    def determinant_lipschitz(self) -> Array:
        """(2,) bound of |d det/dx_k|: `|p_1k| |p_2| + |p_1| |p_2k|`."""
        first, second = self.first_bound, self.second_bound
        return second[0] * first[1] + first[0] * second[1]


def _normal(chain: Chain) -> Array:
    """Return the unit normal of the plane in which a chain moves: the axis of its rotations, or normal to two slides.

    Raises:
        UnsupportedError: If it moves at most along a line.
    """
    if chain.rotations:
        return chain.axes[0]
    across = np.cross(*chain.slides[0].T)
    length = float(np.linalg.norm(across))
    if length <= REDUCTION:
        raise UnsupportedError(
            "these two coordinates move this frame along a line, or not at all, so it covers no area; choose others"
        )
    return across / length


def planar_image(chain: Chain, upright: Array, foot: Array, most: Array, middle: Array) -> PlanarImage:
    """Return the planar map of a chain over two coordinates.

    Args:
        chain: The chain over two coordinates.
        upright: (3,) direction that the plane's second axis v should have, if it lies in the plane.
        foot: (3,) origin of the plane's own frame.
        most: (2,) see `PlanarImage`.
        middle: (2,) a point whose image gets u >= 0.

    Raises:
        UnsupportedError: If the frame does not move in a plane, or does not move at all.
    """
    normal = _normal(chain)
    is_planar = all(are_parallel(normal, axis) for axis in chain.axes[1:])
    if not is_planar or np.any(np.abs(np.einsum("i,jik->jk", normal, chain.slides)) > REDUCTION):
        raise UnsupportedError(
            "this frame moves on a curved surface, not in a plane; areas need rotations about one direction; choose "
            "others"
        )
    across = upright - normal * float(normal @ upright)
    if float(np.linalg.norm(across)) <= np.sqrt(REDUCTION):  # the view is along the axis: take any direction
        across = np.eye(3)[int(np.argmin(np.abs(normal)))]
        across = across - normal * float(normal @ across)
    v = across / np.linalg.norm(across)
    u = np.cross(v, normal)
    reach = float(u @ (numeric.positions(chain, middle[None])[0] - foot))
    return PlanarImage(chain, foot, -u if reach < 0.0 else u, v, most)
