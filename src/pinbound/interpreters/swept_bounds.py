"""Certified bounds of separations of swept paths: what `bounds` proves of a chain, for segments, lines and planes.

Two convex sets are at least as far apart as along any direction: with a unit vector n that stays as it is,

    min_t |r(q, t)| >= min_t n . r(q, t) = min over corners c of n . r_c(q),

for r is affine in every t, and each corner r_c is a chain. With n = r*/|r*| from the middle of a piece or box this is
exact there, and every `n . r_c` is bounded like a chain. A height above a plane is the case in which n is the plane's
normal; across a line n is taken across it, where the line's own parameter does not occur. And since the distance of two
sets changes by no more than their points move,

    |f(q) - f(q_0)| <= max over corners of |r_c(q) - r_c(q_0)|.

`docs/segments.md` proves both, and adds up the rounding.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pinbound.chain import Chain
from pinbound.interpreters.bounds import Bundle, Expansion, Terms, box_terms, bundle, lever_arms, motion_terms
from pinbound.interpreters.bounds import rounding_bound as chain_rounding_bound
from pinbound.interpreters.closest import nearest
from pinbound.path import RelativePath
from pinbound.tolerances import INFLATION, UNIT_ROUNDOFF

__all__ = ["Bounds", "SweptBundle", "along_motion", "over_box", "rounding_bound", "swept_bundle"]

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_CORNERS = 4
_PROJECTING = 32
"""Unit roundoffs, relative to the length of a path: a unit vector, its products with a corner, the nearest t."""


@dataclass(frozen=True)
class SweptBundle:
    """m swept paths side by side.

    Attributes:
        corners: Four chains a path, those of t = (0, 0), (0, 1), (1, 0), (1, 1); repeated where there are fewer t.
        arms: (4 m, k) their lever arms [m].
        across: (m, 3, 3) projections onto what counts: the identity, or across a line.
        normal: (m, 3) normals of planes, zero for others.
        is_signed: (m,) whether it measures a height.
    """

    corners: Bundle
    arms: Array
    across: Array
    normal: Array
    is_signed: NDArray[np.bool_]


@dataclass(frozen=True)
class Bounds:
    """Bounds of N separations, rounding of the bounds themselves taken off.

    Attributes:
        value: (N,) [m], in the middle, as computed: between a point of the one and a point of the other mark.
        lower: (N,) [m], over the piece or box.
        upper: (N,) [m], over the piece or box.
    """

    value: Array
    lower: Array
    upper: Array


def swept_bundle(paths: Sequence[RelativePath], lower: Array, upper: Array) -> SweptBundle:
    """Return paths side by side, with lever arms that hold while q stays in a box (n,), (n,)."""
    chains = [chain for path in paths for chain in _four(path)]
    corners = bundle(chains, len(lower))
    across, normal = np.tile(np.eye(3), (len(paths), 1, 1)), np.zeros((len(paths), 3))
    for row, path in enumerate(paths):
        if path.across is not None:
            across[row] = path.across.T @ path.across
            normal[row] = path.across[0] if path.is_signed else 0.0
    signed = np.array([path.is_signed for path in paths], dtype=np.bool_)
    return SweptBundle(corners, lever_arms(corners, lower, upper), across, normal, signed)


def _four(path: RelativePath) -> list[Chain]:
    # What the reduction took for zero is 1e-14 m of a direction, however short the path: its scale must not be below 1.
    corners = [replace(chain, scale=max(chain.scale, 1.0)) for chain in path.swept.corners]
    return [corner for corner in corners for _ in range(_CORNERS // len(corners))]


def rounding_bound(swept: SweptBundle, joints: Array, lower: Array, upper: Array, degree: int = 1) -> Array:
    """Return a bound of every rounding error in a separation while q stays in a box, (m,) [m]."""
    each = chain_rounding_bound(swept.corners, np.repeat(joints, _CORNERS), lower, upper, degree)
    reach = swept.corners.scale + np.linalg.norm(swept.corners.offsets, axis=2).sum(axis=1)
    return (each + _PROJECTING * UNIT_ROUNDOFF * reach).reshape(-1, _CORNERS).max(axis=1)


def along_motion(swept: SweptBundle, which: Indices, piece: Expansion, error: Array) -> Bounds:
    """Return bounds of separations `which` (N,) on N pieces; `error` (N,) is their rounding bound [m]."""
    rows = np.repeat(np.arange(len(which)), _CORNERS)
    terms = motion_terms(swept.corners, swept.arms, _of_corners(which), piece.take(rows))
    return _bounds(swept, which, terms, error, share=0.5, curvature=0.125)


def over_box(swept: SweptBundle, which: Indices, centre: Array, half: Array, error: Array) -> Bounds:
    """Return bounds of separations `which` (N,) over the boxes `centre +- half` (N, n)."""
    rows = np.repeat(np.arange(len(which)), _CORNERS)
    terms = box_terms(swept.corners, swept.arms, _of_corners(which), centre[rows], half[rows])
    return _bounds(swept, which, terms, error, share=1.0, curvature=0.5)


def _of_corners(which: Indices) -> Indices:
    return (which[:, None] * _CORNERS + np.arange(_CORNERS)).ravel()


def _bounds(swept: SweptBundle, which: Indices, terms: Terms, error: Array, share: float, curvature: float) -> Bounds:
    r = terms.r.T.reshape(-1, _CORNERS, 3)
    value, n = _separation(swept, which, r)
    corners = np.einsum("nci,ni->nc", r, n)
    moved = terms.moved.reshape(-1, _CORNERS)
    first = value - moved.max(axis=1) * INFLATION
    lower, upper = first, value + moved.max(axis=1) * INFLATION
    if terms.second is not None:
        linear = sum(np.abs(np.einsum("nci,ni->nc", v.T.reshape(-1, _CORNERS, 3), n)) for v in terms.rates)
        change = share * linear + curvature * terms.second.reshape(-1, _CORNERS)
        lower = np.maximum(first, np.min(corners - change * INFLATION, axis=1))
    aside = terms.aside.reshape(-1, _CORNERS).max(axis=1) * INFLATION
    slack = aside + error * terms.wide.reshape(-1, _CORNERS).max(axis=1) + error
    return Bounds(value, lower - slack, upper + slack)


def _separation(swept: SweptBundle, which: Indices, r: Array) -> tuple[Array, Array]:
    """Return the separation (N,) of corners r (N, 4, 3), and the unit vector (N, 3) along which it is measured."""
    signed, normal = swept.is_signed[which], swept.normal[which]
    heights = np.einsum("nci,ni->nc", r, normal).min(axis=1)
    measured = np.einsum("nij,ncj->nci", swept.across[which], r)
    w, second, first = measured[:, 0], measured[:, 1] - measured[:, 0], measured[:, 2] - measured[:, 0]
    t = nearest(w, [first, second])
    least = w + t[:, :1] * first + t[:, 1:] * second
    length: Array = np.sqrt(np.einsum("ni,ni->n", least, least))
    unit: Array = np.divide(least, length[:, None], out=np.zeros_like(least), where=length[:, None] > 0.0)
    return np.where(signed, heights, length), np.where(signed[:, None], normal, unit)
