"""What step-safe rows are made of, for many boundaries at one q: vectors, their rates along n, bounds of their bends.

Between two marks lie a chain and edge vectors, `r_c = w + sum_k c_k e_k`, all turned by the same rotations. They are
placed once from the tail, `x_i = b_i + R_(i+1) x_(i+1)`; and with `u_i = R_i^T ... R_1^T n` the rates along n are

    n . dr/dphi_i = n . W_(i-1) (a_i x R_i x_i) = (u_(i-1) x a_i) . R_i x_i,

one vector a rotation for all of them, and then linear in the rates of q.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pinbound.bounds.bounds import bends_over_box
from pinbound.bounds.rounding import Walks
from pinbound.bounds.swept_bounds import SweptBundle, all_rows, rounding_bound, separated, swept_bundle
from pinbound.path.relative import RelativePath
from pinbound.tolerances import INFLATION
from pinbound.typing import Array, Indices

__all__ = ["StepTerms", "step_terms"]


@dataclass(frozen=True)
class StepTerms:
    """Paths of one number of edge vectors side by side.

    Attributes:
        places: (m,) of the boundaries.
        bundle: The paths.
        error: (m,) rounding bounds [m].
        axes: (m, k, 3), of the rotations of each path.
        coefficients: (m, k, n), of their angles.
        offsets: (m, 1 + K, k + 1, 3), of chain and edge vectors [m].
        slides: (m, 1 + K, k + 1, 3, n), or None if nothing slides.
    """

    places: Indices
    bundle: SweptBundle
    error: Array
    axes: Array
    coefficients: Array
    offsets: Array
    slides: Array | None

    @property
    def moved(self) -> Array:
        """(m, n) how far a separation changes at most by a unit of each coordinate [m/rad or 1]."""
        chains, rows = self.bundle.chains, self.bundle.rows
        found: Array = np.einsum("mk,mkn->mn", self.bundle.arms, np.abs(chains.coefficients))
        if chains.slides is not None:
            found = found + np.linalg.norm(chains.slides, axis=2).sum(axis=1)
        return found[::rows]

    def at(self, which: Indices, q: Array, half: Array) -> tuple[Array, Array, Array, Array]:
        """Return the terms of paths `which` (c,) at q (n,), for steps within `half` (n,).

        That is `n . r` of chain and edge vectors (c, 1 + K) [m]; its rates (c, 1 + K, n); half the bound of its second
        derivatives over the box (c, 1 + K) [m]; and the rounding bound of all (c,) [m].
        """
        axes, C, offsets = self.axes[which], self.coefficients[which], self.offsets[which]
        slides = None if self.slides is None else self.slides[which]
        blocks = offsets if slides is None else offsets + slides @ q
        turns, k = _rotations(axes, C @ q), axes.shape[1]
        x, tails = blocks[:, :, k], list[Array]()
        for i in reversed(range(k)):
            x = x @ turns[:, i].transpose(0, 2, 1)
            tails.append(x)
            x = x + blocks[:, :, i]
        _, n, _, _ = separated(self.bundle, which, x)
        along = (x @ n[:, :, None])[:, :, 0]
        rates, u = np.empty((*along.shape, k)), n[:, None]
        sliding = np.zeros((*along.shape, len(q)))
        for i in range(k + 1):
            if slides is not None:
                sliding = sliding + np.einsum("crdj,cd->crj", slides[:, :, i], u[:, 0])
            if i < k:
                across = _cross(u[:, 0], axes[:, i])
                rates[:, :, i] = (tails[k - 1 - i] @ across[:, :, None])[:, :, 0]
                u = u @ turns[:, i]
        chains, rows = self.bundle.chains, self.bundle.rows
        second, wide = bends_over_box(chains, self.bundle.arms, all_rows(self.bundle, which), half)
        off = self.error[which] * (1.0 + wide.sum(axis=1).reshape(-1, rows).max(axis=1))
        return along, rates @ C + sliding, 0.5 * second.reshape(-1, rows) * INFLATION, off


def step_terms(places: Indices, paths: Sequence[RelativePath], walked: Walks, lower: Array, upper: Array) -> StepTerms:
    """Return the terms of paths of one number of edge vectors, with bounds that hold in a box of q (n,), (n,)."""
    bundle = swept_bundle(paths, lower, upper)
    error = rounding_bound(bundle, walked, lower, upper)
    chains, rows = bundle.chains, bundle.rows
    m, (blocks, n) = len(paths), (chains.offsets.shape[1], len(lower))
    return StepTerms(
        places=places,
        bundle=bundle,
        error=error,
        axes=chains.axes[::rows],
        coefficients=chains.coefficients[::rows],
        offsets=chains.offsets.reshape(m, rows, blocks, 3),
        slides=None if chains.slides is None else chains.slides.reshape(m, rows, blocks, 3, n),
    )


def _rotations(axes: Array, angles: Array) -> Array:
    """Return the matrices (c, k, 3, 3) of rotations about unit axes (c, k, 3) by angles (c, k)."""
    u, v, w = np.moveaxis(axes, 2, 0)
    sin, zero = np.sin(angles)[:, :, None, None], np.zeros_like(u)
    cross = np.stack((zero, -w, v, w, zero, -u, -v, u, zero), axis=2).reshape(*angles.shape, 3, 3)
    along = axes[:, :, :, None] * axes[:, :, None, :]
    found: Array = along + np.cos(angles)[:, :, None, None] * (np.eye(3) - along) + sin * cross
    return found


def _cross(a: Array, b: Array) -> Array:
    """Return a x b (c, 3)."""
    return a[:, _FIRST] * b[:, _LAST] - a[:, _LAST] * b[:, _FIRST]


_FIRST, _LAST = np.array([1, 2, 0]), np.array([2, 0, 1])
