"""Certified bounds of separations of swept paths: what `bounds` proves of a chain, for segments, boxes, lines, planes.

Two convex sets are at least as far apart as along any direction: with a unit vector n that stays as it is,

    min_t |r(q, t)| >= min_t n . r(q, t) = n . r_c(q) + sum_i min(0, n . e'_i(q)),

r_c being the corner that is least along n in the middle of a piece or box, and e'_i the ways that lead away from it,
`n . e'_i >= 0` there. With n = r*/|r*| from the middle this is exact there, and each term is bounded like a chain. A
height above a plane is the case in which n is the plane's normal; across a line n is taken across it, where the line's
own parameter does not occur. And since the distance of two sets changes by no more than their points move,

    |f(q) - f(q_0)| <= max over corners of |r_c(q) - r_c(q_0)|.

`docs/segments.md` proves both, and adds up the rounding.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pinbound.chain import Chain
from pinbound.interpreters.bounds import Bundle, Expansion, Terms, box_terms, bundle, lever_arms, motion_terms
from pinbound.interpreters.closest import nearest, overlap, overlap_in_plane
from pinbound.interpreters.rounding import Walks
from pinbound.interpreters.rounding import rounding_bound as chain_rounding_bound
from pinbound.path import RelativePath
from pinbound.tolerances import INFLATION, REDUCTION, UNIT_ROUNDOFF

__all__ = [
    "Bounds",
    "SweptBundle",
    "all_rows",
    "along_motion",
    "over_box",
    "rounding_bound",
    "separated",
    "swept_bundle",
]

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_PROJECTING = 32
"""Unit roundoffs, relative to the length of a path: a unit vector, its products with a corner, the nearest t."""


_FLAT = 3  # rows of a path with two ways, which span no body
_FEW = 4  # ways whose corners are looked at one by one
_TOUCHING = 1e-12  # relative: bodies whose distance is rounding may overlap


@dataclass(frozen=True)
class SweptBundle:
    """m swept paths side by side.

    Attributes:
        chains: Of each path its chain and its ways, 1 + k rows, padded with zeros.
        arms: (m (1 + k), rotations) lever arms [m]: of the chain's row the largest of all corners, of a way its own.
        across: (m, 3, 3) projections onto what counts: the identity, or across a line.
        normal: (m, 3) normals of planes, zero for others.
        flat: (m, 3) unit normal of the plane in which all that counts stays, but for a constant height: the one axis of
            a path that is planar with its ways, or the direction of a line; zero for others.
        is_signed: (m,) whether it measures a height.
        reach: (m,) [m], length of each path with its ways.
    """

    chains: Bundle
    arms: Array
    across: Array
    normal: Array
    flat: Array
    is_signed: NDArray[np.bool_]
    reach: Array

    @property
    def rows(self) -> int:
        """The number 1 + k of rows a path."""
        return len(self.arms) // len(self.normal) if len(self.normal) else 1


@dataclass(frozen=True)
class Bounds:
    """Bounds of N separations, all rounding taken off.

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
    for path in paths:
        path.check_zonotopes("a certified bound")
    n, rows = len(lower), 1 + max((len(path.swept.directions) for path in paths), default=0)
    # What the reduction took for zero is 1e-14 m of a way, however short the path: its scale must not be below 1.
    chains = [
        replace(chain, scale=max(chain.scale, 1.0))
        for path in paths
        for chain in (path.minimal, *path.swept.turned, *[_nothing(path)] * (rows - 1 - len(path.swept.turned)))
    ]
    stacked = bundle(chains, n)
    arms = lever_arms(stacked, lower, upper)
    across, normal = np.tile(np.eye(3), (len(paths), 1, 1)), np.zeros((len(paths), 3))
    flat = np.array([_flat(path) for path in paths]).reshape(-1, 3)
    for row, path in enumerate(paths):
        corners = _arms_of_corners(path, lower, upper)
        arms[row * rows, : len(corners)] = corners
        if path.across is not None:
            across[row] = path.across.T @ path.across
            normal[row] = path.across[0] if path.is_signed else 0.0
    signed = np.array([path.is_signed for path in paths], dtype=np.bool_)
    lengths = stacked.scale + np.linalg.norm(stacked.offsets, axis=2).sum(axis=1)
    return SweptBundle(stacked, arms, across, normal, flat, signed, lengths.reshape(len(paths), rows).sum(axis=1))


def _flat(path: RelativePath) -> Array:
    """Return the normal of the plane that nothing leaves: no way leads out of it, no joint turns or slides so."""
    if path.across is not None:
        towards: Any = np.cross(path.across[0], path.across[-1])  # zero of a plane, which has one row
        return towards
    chain, ways = path.minimal, path.swept.directions
    if not ways or not chain.rotations or not chain.is_planar:
        return np.zeros(3)
    axis = chain.axes[0]
    leading_out = max(*(float(np.abs(way @ axis).max()) for way in ways), float(np.abs(axis @ chain.slides).max()))
    return axis if leading_out <= REDUCTION else np.zeros(3)


def _arms_of_corners(path: RelativePath, lower: Array, upper: Array) -> Array:
    """Return the largest lever arms of any corner (rotations,) [m]; of many ways by the triangle inequality."""
    n, chain, ways = len(lower), path.minimal, path.swept.directions
    if len(ways) <= _FEW:
        return lever_arms(bundle(path.swept.vertex_chains, n), lower, upper).max(axis=0)
    halves = 0.5 * np.array(ways)
    middle = replace(chain, offsets=chain.offsets + halves.sum(axis=0))
    return lever_arms(bundle([middle], n), lower, upper, np.linalg.norm(halves, axis=2).sum(axis=0)[None])[0]


def _nothing(path: RelativePath) -> Chain:
    """Return a way that leads nowhere."""
    chain = path.minimal
    return replace(chain, offsets=np.zeros_like(chain.offsets), slides=np.zeros_like(chain.slides))


def rounding_bound(swept: SweptBundle, walked: Walks | None, lower: Array, upper: Array, degree: int = 1) -> Array:
    """Return a bound of every rounding error in a separation while q stays in a box, (m,) [m].

    `walked` is what the paths were reduced from; None: the paths are taken for exact.
    """
    rows, farthest = swept.rows, np.maximum(np.abs(lower), np.abs(upper))
    each = chain_rounding_bound(swept.chains, walked and walked.with_ways(rows - 1), lower, upper, degree)
    reach = swept.reach
    if swept.chains.slides is not None:
        reach = reach + (np.linalg.norm(swept.chains.slides[::rows], axis=2).sum(axis=1)) @ farthest
    return each.reshape(-1, rows).sum(axis=1) + _PROJECTING * UNIT_ROUNDOFF * reach


def along_motion(swept: SweptBundle, which: Indices, piece: Expansion, error: Array) -> Bounds:
    """Return bounds of separations `which` (N,) on N pieces; `error` (N,) is their rounding bound [m]."""
    again = np.repeat(np.arange(len(which)), swept.rows)
    terms = motion_terms(swept.chains, swept.arms, all_rows(swept, which), piece.take(again))
    return _bounds(swept, which, terms, error, share=0.5, curvature=0.125)


def over_box(swept: SweptBundle, which: Indices, centre: Array, half: Array, error: Array) -> Bounds:
    """Return bounds of separations `which` (N,) over the boxes `centre +- half` (N, n)."""
    again = np.repeat(np.arange(len(which)), swept.rows)
    terms = box_terms(swept.chains, swept.arms, all_rows(swept, which), centre[again], half[again])
    return _bounds(swept, which, terms, error, share=1.0, curvature=0.5)


def all_rows(swept: SweptBundle, which: Indices) -> Indices:
    """Return the rows of the chains and ways of paths `which`."""
    return (which[:, None] * swept.rows + np.arange(swept.rows)).ravel()


def _bounds(swept: SweptBundle, which: Indices, terms: Terms, error: Array, share: float, curvature: float) -> Bounds:
    rows = swept.rows
    r = terms.r.T.reshape(-1, rows, 3)
    value, n, depth, t = separated(swept, which, r)
    along = np.einsum("nci,ni->nc", r, n)
    moved = terms.moved.reshape(-1, rows)[:, 0] * INFLATION
    taken = along[:, 1:] < 0.0  # the ways that lead to the corner that is least along n
    corner = along[:, 0] + np.sum(along[:, 1:], axis=1, where=taken)
    # The value is a distance of two points, no proof that none are nearer, should the search have ended early.
    lower, upper = corner - moved, value + np.maximum(moved - depth, 0.0)
    if terms.second is not None:
        rates = [np.einsum("nci,ni->nc", rate.T.reshape(-1, rows, 3), n) for rate in terms.rates]
        bent = curvature * terms.second.reshape(-1, rows)
        swing = sum(np.abs(rate[:, 0] + np.sum(rate[:, 1:], axis=1, where=taken)) for rate in rates)
        slack = np.abs(along[:, 1:]) - (share * sum(np.abs(rate[:, 1:]) for rate in rates) + bent[:, 1:]) * INFLATION
        second = corner - (share * swing + bent[:, 0]) * INFLATION + np.minimum(slack, 0.0).sum(axis=1)
        lower = np.maximum(lower, second)
        if len(terms.rates) == 1:  # the points that are nearest in the middle, along the piece
            v = terms.rates[0].T.reshape(-1, rows, 3)
            ways = np.where(swept.is_signed[which][:, None], taken, t)
            here, step = (x[:, 0] + np.einsum("nc,nci->ni", ways, x[:, 1:]) for x in (r, v))
            ends = [_measure(swept, which, here + sign * share * step, n) for sign in (-1.0, 1.0)]
            upper = np.minimum(upper, np.maximum(*ends) + bent[:, 0] * INFLATION)
    off = terms.aside.reshape(-1, rows).sum(axis=1) * INFLATION
    off = off + error * (1.0 + terms.wide.reshape(-1, rows).max(axis=1))
    return Bounds(value, lower - off, upper + off)


def _measure(swept: SweptBundle, which: Indices, r: Array, n: Array) -> Array:
    """Return the distance, or the height along n, of vectors r (N, 3)."""
    across = np.einsum("nij,nj->ni", swept.across[which], r)
    length: Array = np.sqrt(np.einsum("ni,ni->n", across, across))
    return np.where(swept.is_signed[which], np.einsum("ni,ni->n", n, r), length)


def separated(swept: SweptBundle, which: Indices, r: Array) -> tuple[Array, Array, Array, Array]:
    """Return what chain and ways r (N, 1 + k, 3) say in the middle.

    The separation (N,), the unit vector (N, 3) along which it is measured, and how far all may move while bodies that
    overlap are sure to do so still (N,); and the nearest t (N, k).
    """
    signed, normal = swept.is_signed[which], swept.normal[which]
    along = np.einsum("nci,ni->nc", r, normal)
    heights = along[:, 0] + np.minimum(along[:, 1:], 0.0).sum(axis=1)
    measured = np.einsum("nij,ncj->cni", swept.across[which], r)
    t = nearest(measured[0], measured[1:])
    least = measured[0] + np.einsum("nk,kni->ni", t, measured[1:])
    length: Array = np.sqrt(np.einsum("ni,ni->n", least, least))
    unit: Array = np.divide(least, length[:, None], out=np.zeros_like(least), where=length[:, None] > 0.0)
    # Across a line once more: what rounding leaves of a short vector may point along the line, where nothing counts.
    unit = np.einsum("nij,nj->ni", swept.across[which], unit)
    depth = np.zeros(len(r))
    if len(measured) > _FLAT:
        near = np.flatnonzero(~signed & (length <= _TOUCHING * np.linalg.norm(r, axis=2).sum(axis=1)))
        depth[near] = overlap(measured[0, near], measured[1:, near])
    plane = swept.flat[which]
    beside = least - np.einsum("ni,ni->n", least, plane)[:, None] * plane
    close = np.einsum("ni,ni->n", beside, beside) <= (_TOUCHING * np.linalg.norm(r, axis=2).sum(axis=1)) ** 2
    near = np.flatnonzero(close & np.any(plane, axis=1))
    depth[near] = np.maximum(depth[near], overlap_in_plane(measured[0, near], measured[1:, near], plane[near]))
    return np.where(signed, heights, length), np.where(signed[:, None], normal, unit), depth, t
