"""Exact values, gradients and Hessians of a chain in NumPy, for one or many configurations.

With `x_i = b_i + R_{i+1} x_{i+1}` and `R = R(u, c . q)`, one loop from the tail computes the value and the first and
second derivative (`(x)` is the outer product over coordinates, `sym` adds its transpose):

    x'  = L + R x' + (u x R x) (x) c
    x'' = R x'' + sym[(u x R x') (x) c] + u x (u x R x) (x) c (x) c
"""

from __future__ import annotations

import numpy as np

from pinbound.geometry.rotations import rotate
from pinbound.path.chain import Chain
from pinbound.typing import Array

__all__ = [
    "along",
    "derivative",
    "derivatives",
    "gradient",
    "hessian",
    "jacobian",
    "norm",
    "norm_hessian",
    "positions",
    "unit",
]


def positions(chain: Chain, Q: Array) -> Array:
    """Return the chain's value (N, 3) [m] for Q (N, n); a row that is not finite gives NaN."""
    return derivatives(chain, Q, order=0)[0]


def derivative(chain: Chain, Q: Array) -> Array:
    """Return the derivative (N, 3, n) [m/rad, or 1 for prismatic joints] of the chain's value for Q (N, n)."""
    return derivatives(chain, Q, order=1)[1]


def jacobian(chain: Chain, Q: Array) -> tuple[Array, Array]:
    """Return the chain's value (N, 3) [m] and its Jacobian (N, 3, n) [m/rad]; smooth everywhere, also at contact."""
    r, J, _ = derivatives(chain, Q, order=1)
    return r, J


def along(chain: Chain, index: int, Q: Array) -> tuple[Array, Array, Array]:
    """Return the chain's value and its first and second derivative along one coordinate, each (N, 3)."""
    r, J, H = derivatives(chain, Q, order=2)
    return r, J[:, :, index], H[:, :, index, index]


def norm(r: Array) -> Array:
    """Return `|r|` over axis 1; components are squared last, which keeps full accuracy near contact.

    Example:
        >>> norm(np.array([[3e-9, 0.0, 4e-9]]))
        array([5.e-09])
    """
    return np.sqrt(np.einsum("ni,ni->n", r, r))


def gradient(chain: Chain, Q: Array) -> Array:
    """Return the gradient (N, n) of the norm; NaN where the norm is zero (a kink)."""
    r, J, _ = derivatives(chain, Q, order=1)
    return np.einsum("ni,nia->na", unit(r), J)


def hessian(chain: Chain, Q: Array) -> Array:
    """Return the Hessian (N, n, n) of the norm: `(J^T J + r . r'' - g g^T) / |r|`; NaN where the norm is zero."""
    return norm_hessian(*derivatives(chain, Q, order=2))


def norm_hessian(r: Array, J: Array, H: Array) -> Array:
    """Return the Hessian of `|r|` from the derivatives of r; NaN where the norm is zero."""
    towards = unit(r)
    g = np.einsum("ni,nia->na", towards, J)
    curvature = np.einsum("nia,nib->nab", J, J) - np.einsum("na,nb->nab", g, g)
    with np.errstate(invalid="ignore", divide="ignore"):
        return curvature / norm(r)[:, None, None] + np.einsum("ni,niab->nab", towards, H)


def unit(r: Array) -> Array:
    """Return `r / |r|`; NaN where the norm is zero."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return r / norm(r)[:, None]


def derivatives(chain: Chain, Q: Array, order: int) -> tuple[Array, Array, Array]:
    """Return value (N, 3), first (N, 3, n) and second (N, 3, n, n) derivative; those above `order` are empty."""
    count, n = Q.shape
    x = np.empty((count, 3))
    J, H = np.zeros((count, 3, n if order else 0)), np.zeros((count, 3, *((n, n) if order > 1 else (0, 0))))
    with np.errstate(invalid="ignore"):
        x[:] = _offset(chain, chain.rotations, Q)
        if order:
            J[:] = chain.slides[-1]
        for index in reversed(range(chain.rotations)):
            axis, c = chain.axes[index], chain.coefficients[index]
            angle = _combination(c, Q)
            cos, sin = np.cos(angle), np.sin(angle)
            x = _rotate(axis, cos, sin, x)
            if order:
                turned = _cross(axis, x)
                J = _rotate(axis, cos, sin, J)
                if order > 1:
                    mixed = _cross(axis, J)[:, :, :, None] * c
                    again = _cross(axis, turned)[:, :, None, None] * np.outer(c, c)
                    H = _rotate(axis, cos, sin, H) + mixed + np.swapaxes(mixed, 2, 3) + again
                J = J + chain.slides[index] + turned[:, :, None] * c
            x = x + _offset(chain, index, Q)
    return x, J, H


def _offset(chain: Chain, index: int, Q: Array) -> Array:
    slide = chain.slides[index]
    if not np.any(slide):
        return chain.offsets[index]
    return chain.offsets[index] + np.stack([_combination(row, Q) for row in slide], axis=1)


def _combination(c: Array, Q: Array) -> Array:
    """Return `c . q` for each row; without BLAS, so that the bits of a row do not depend on the number of rows."""
    total = np.zeros(len(Q))
    for index in np.flatnonzero(c):
        total = total + c[index] * Q[:, index]
    return total


def _cross(axis: Array, x: Array) -> Array:
    """Return `axis x x` along axis 1 of x (N, 3, ...)."""
    u, v, w = axis
    return np.stack((v * x[:, 2] - w * x[:, 1], w * x[:, 0] - u * x[:, 2], u * x[:, 1] - v * x[:, 0]), axis=1)


def _rotate(axis: Array, cos: Array, sin: Array, x: Array) -> Array:
    """Return `R(axis, angle) x` along axis 1 of x (N, 3, ...)."""
    shape = (-1,) + (1,) * (x.ndim - 2)
    return np.stack(rotate(axis, cos.reshape(shape), sin.reshape(shape), (x[:, 0], x[:, 1], x[:, 2])), axis=1)
