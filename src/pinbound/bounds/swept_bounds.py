"""Certified bounds of separations: the bounds of `bounds` for bodies, lines and planes.

The distance of two convex sets is at least their distance along any direction: for a fixed unit vector n,

    min_t |r(q, t)| >= min_t n . r(q, t) = min over pairs of corners c of n . r_c(q).

With n = r*/|r*| from the middle of a piece or box, this is exact there. Every r_c is a chain, so n . r_c is the sum of
its value there, its rates, and the remainder of the pair of corners that moves most. The lowest corner of a sum of two
bodies is the sum of their lowest corners. For a height above a plane, n is the normal of the plane; for a line, n is
perpendicular to it, so the parameter of the line does not occur. The distance of two sets changes by at most the motion
of their points. So

    |f(q) - f(q_0)| <= max over corners of |r_c(q) - r_c(q_0)|.

`docs/hull-proofs.md` and `docs/segments.md` prove both, and add up the rounding.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from pinbound.bounds.bodies import SweptBundle, all_rows, spread_of, swept_bundle
from pinbound.bounds.bounds import Expansion, Terms, box_terms, motion_terms
from pinbound.bounds.inside import ball, disc, stays_inside
from pinbound.bounds.rounding import Rounding, Walks
from pinbound.bounds.vertices import Corners
from pinbound.evaluate.closest import nearest, overlap, overlap_in_plane
from pinbound.evaluate.minimum_norm import nearest_hulls, nearest_in_tables
from pinbound.tolerances import INFLATION, UNIT_ROUNDOFF
from pinbound.typing import Array, Flags, Indices

__all__ = [
    "Bounds",
    "SweptBundle",
    "all_rows",
    "along_motion",
    "bound_of",
    "chain_rounding",
    "over_box",
    "rounding_bound",
    "separated",
    "swept_bundle",
]

_PROJECTING = 96
"""Unit roundoffs, relative to the length of a path with its furthest vertices: 32 for a unit vector, its products with
the edges, their products with a corner, and the nearest t; 64 for the error of a hull's vertices when it is made."""

_FLAT = 3  # rows of a path with two edge vectors: they span no solid body
_MOST_COORDINATES = 4  # of a box of which all corners are examined
_TOUCHING = 1e-12  # relative: bodies whose distance is below this, only rounding, may overlap


@dataclass(frozen=True)
class Bounds:
    """Bounds of N separations, with all rounding subtracted.

    Attributes:
        value: (N,) [m], in the middle, as computed: between one point of each mark.
        lower: (N,) [m], over the piece or box.
        upper: (N,) [m], over the piece or box.
    """

    value: Array
    lower: Array
    upper: Array


def rounding_bound(swept: SweptBundle, walked: Walks | None, lower: Array, upper: Array, degree: int = 1) -> Array:
    """Return a bound of every rounding error in a separation while q stays in a box, (m,) [m].

    The paths were reduced from `walked`; None: the paths are exact.
    """
    return bound_of(swept, chain_rounding(swept, walked), lower, upper, degree)


def chain_rounding(swept: SweptBundle, walked: Walks | None) -> Rounding:
    """Return the data of the rounding bounds of all chains and edge vectors, except for the range of q."""
    return Rounding.of(swept.chains, walked and walked.with_edges(swept.rows - 1))


def bound_of(swept: SweptBundle, rounding: Rounding, lower: Array, upper: Array, degree: int = 1) -> Array:
    """Return `rounding_bound` from the result of `chain_rounding`."""
    rows, farthest = swept.rows, np.maximum(np.abs(lower), np.abs(upper))
    each, reach = rounding.bound(lower, upper, degree), swept.reach
    if swept.chains.slides is not None:
        reach = reach + (np.linalg.norm(swept.chains.slides[::rows], axis=2).sum(axis=1)) @ farthest
    return spread_of(swept.corners, each.reshape(-1, rows)) + _PROJECTING * UNIT_ROUNDOFF * reach


def along_motion(swept: SweptBundle, which: Indices, piece: Expansion, error: Array) -> Bounds:
    """Return bounds of separations `which` (N,) on N pieces; `error` (N,) is their rounding bound [m]."""
    rows = _Rows(swept, which)
    terms = motion_terms(swept.chains, swept.arms, rows.chain, piece.take(rows.asked))
    return _bounds(swept, which, rows, terms, error, share=0.5, curvature=0.125)


def over_box(
    swept: SweptBundle,
    which: Indices,
    centre: Array,
    half: Array,
    error: Array,
    steps: Array | None = None,
    off: Array | None = None,
) -> Bounds:
    """Return bounds of separations `which` (N,) over the boxes `centre +- half` (N, n).

    With `steps` (p, N, n) and `off` (N, n) over `centre + sum_p s_p steps_p + e`, `s_p` in [-1, 1], `|e| <= off`.
    """
    rows = _Rows(swept, which)
    along = (None, None) if steps is None or off is None else (steps[:, rows.asked], off[rows.asked])
    terms = box_terms(swept.chains, swept.arms, rows.chain, centre[rows.asked], half[rows.asked], *along)
    return _bounds(swept, which, rows, terms, error, share=1.0, curvature=0.5, corners=steps is not None)


class _Rows:
    """The chains that N separations need, in sequence, without padding."""

    def __init__(self, swept: SweptBundle, which: Indices) -> None:
        """List the chains: the separation of each, its chain, and its row in the separation."""
        self.shape = len(which), swept.rows
        if swept.is_even:
            self.asked = np.repeat(np.arange(len(which)), swept.rows)
            self.chain = all_rows(swept, which)
            return
        counts = swept.counts[which]
        self.asked = np.repeat(np.arange(len(which)), counts)
        self.row = np.arange(len(self.asked)) - np.repeat(np.cumsum(counts) - counts, counts)
        self.chain = which[self.asked] * swept.rows + self.row

    def of(self, values: Array) -> Array:
        """Return values (R, ...) of all chains as (N, 1 + K, ...), zero where there is none."""
        if len(values) == self.shape[0] * self.shape[1]:
            return values.reshape(*self.shape, *values.shape[1:])
        found = np.zeros((*self.shape, *values.shape[1:]))
        found[self.asked, self.row] = values
        return found


def _bounds(
    swept: SweptBundle,
    which: Indices,
    rows: _Rows,
    terms: Terms,
    error: Array,
    share: float,
    curvature: float,
    corners: bool = False,
) -> Bounds:
    r = rows.of(terms.r.T)
    value, n, depth, t = separated(swept, which, r)
    along = np.einsum("nci,ni->nc", r, n)
    moved = rows.of(terms.moved)[:, 0] * INFLATION
    least, _ = swept.corners.least(which, along[:, 1:])
    corner = along[:, 0] + least
    # The value is the distance of two points. If the search ended early, nearer points may exist.
    lower, upper = corner - moved, value + np.maximum(moved - depth, 0.0)
    off = rows.of(terms.aside)[:, 0] * INFLATION + error * (1.0 + rows.of(terms.wide).max(axis=1))
    if terms.second is not None:
        vectors = [rows.of(rate.T) for rate in terms.rates]
        falls = [share * np.einsum("nci,ni->nc", v, n) for v in vectors]
        bent = curvature * rows.of(terms.second)[:, 0] * INFLATION
        lower = np.maximum(lower, _sloped(swept.corners, which, along, falls, t) - bent)
        if len(vectors) == 1 or corners:  # the nearest points in the middle, at both ends or all corners
            here, *moves = (x[:, 0] + np.einsum("nk,nki->ni", t, x[:, 1:]) for x in (r, *vectors))
            ends = [here]
            for step in moves:
                ends = [end + sign * share * step for end in ends for sign in (-1.0, 1.0)]
            farthest: Array = np.max([_measure(swept, which, end, n) for end in ends], axis=0)
            upper = np.minimum(upper, farthest + bent)
        touching = ~swept.is_signed[which] & (value <= _TOUCHING * swept.reach[which])
        doubtful = np.flatnonzero(touching & (swept.counts[which] > _FLAT) & (depth < moved) & (bent + off < moved))
        if len(doubtful):
            steps = [share * vector[doubtful] for vector in vectors]
            still = _stays(swept, which[doubtful], r[doubtful], steps, (bent + off)[doubtful])
            upper[doubtful[still]] = value[doubtful[still]]
    return Bounds(value, lower - off, upper + off)


def _stays(swept: SweptBundle, which: Indices, r: Array, steps: Sequence[Array], off: Array) -> Flags:
    """Return which solid bodies that overlap in the middle certainly do so over the whole piece or box (N,)."""
    w, *moves = (np.einsum("nij,ncj->cni", swept.projection[which], one) for one in (r, *steps))
    return stays_inside(swept.corners, which, w[0], w[1:], [(one[0], one[1:]) for one in moves], off)


def _sloped(corners: Corners, which: Indices, along: Array, falls: Sequence[Array], t: Array) -> Array:
    """Return the minimum of n . r (N,) over a piece or box without second order, from n . r and rates (N, 1 + K).

    If vertices move linearly, the height of the lowest corner of a body is concave in q. So its minimum is at an end of
    the piece, or at a corner of the box. For many coordinates, points t (N, K) are followed, with the possible decrease
    of vertices relative to them.
    """
    active = [fall for fall in falls if np.any(fall)]
    if len(active) <= _MOST_COORDINATES:
        found = np.full(len(which), np.inf)
        for signs in product((-1.0, 1.0), repeat=len(active)):
            there = sum((sign * fall for sign, fall in zip(signs, active, strict=True)), start=along)
            found = np.minimum(found, there[:, 0] + corners.least(which, there[:, 1:])[0])
        return found
    value, _ = corners.least(which, along[:, 1:])
    swing = sum(np.abs(fall[:, 0] + np.einsum("nk,nk->n", t, fall[:, 1:])) for fall in active)
    slack = corners.slack(which, along[:, 1:], [fall[:, 1:] for fall in active], t)
    return along[:, 0] + value - swing * INFLATION + slack


def _measure(swept: SweptBundle, which: Indices, r: Array, n: Array) -> Array:
    """Return the distance, or the height along n, of vectors r (N, 3)."""
    projected = np.einsum("nij,nj->ni", swept.projection[which], r)
    length: Array = np.sqrt(np.einsum("ni,ni->n", projected, projected))
    return np.where(swept.is_signed[which], np.einsum("ni,ni->n", n, r), length)


def separated(swept: SweptBundle, which: Indices, r: Array) -> tuple[Array, Array, Array, Array]:
    """Return the results of chain and edges r (N, 1 + K, 3) in the middle.

    These are the separation (N,), the unit vector (N, 3) along which it is measured, the largest motion (N,) for which
    overlapping bodies certainly still overlap, and the nearest t (N, K).
    """
    signed, normal = swept.is_signed[which], swept.normal[which]
    measured = np.einsum("nij,ncj->cni", swept.projection[which], r)
    t = _nearest(swept, which, measured)
    least = measured[0] + np.einsum("nk,kni->ni", t, measured[1:])
    length: Array = np.sqrt(np.einsum("ni,ni->n", least, least))
    unit: Array = np.divide(least, length[:, None], out=np.zeros_like(least), where=length[:, None] > 0.0)
    # Project perpendicular to a line once more: rounding of a short vector may point along the line, where
    # nothing counts.
    unit = np.einsum("nij,nj->ni", swept.projection[which], unit)
    depth = _depth(swept, which, measured, least, length)
    if np.any(signed):
        along = np.einsum("nci,ni->nc", r, normal)
        height, t_signed = swept.corners.least(which, along[:, 1:])
        t = np.where(signed[:, None], t_signed, t)
        length, unit = np.where(signed, along[:, 0] + height, length), np.where(signed[:, None], normal, unit)
    return length, unit, depth, t


def _nearest(swept: SweptBundle, which: Indices, measured: Array) -> Array:
    """Return the t (N, K) of points that are nearest, or almost nearest; the proof does not depend on it."""
    signed, corners = swept.is_signed[which], swept.corners
    searched = corners.searched[which] & ~signed
    if not np.any(searched):
        return _padded(nearest(measured[0], measured[1:_FLAT]), len(measured) - 1)
    t = np.zeros((len(which), len(measured) - 1))
    rest = np.flatnonzero(~searched & ~signed)
    t[rest] = _padded(nearest(measured[0, rest], measured[1:_FLAT, rest]), t.shape[1])
    zonotope = searched & swept.zonotope[which]
    for count in np.unique(swept.counts[which[zonotope]]):
        rows = np.flatnonzero(zonotope & (swept.counts[which] == count))
        t[rows] = _padded(nearest(measured[0, rows], measured[1:count, rows]), t.shape[1])
    rows = np.flatnonzero(searched & ~zonotope)
    if len(rows):
        t[rows] = _searched(corners, which[rows], measured[0, rows], measured[1:, rows])
    return t


def _searched(corners: Corners, which: Indices, w: Array, edges: Array) -> Array:
    """Return the t (N, K) of hulls; bodies with more than three edges are searched pair by pair."""
    wide = corners.wide[which]
    if np.any(wide):
        found = np.zeros((len(w), len(edges)))
        found[~wide] = _searched(corners, which[~wide], w[~wide], edges[:, ~wide]) if not np.all(wide) else 0.0
        pairs: list[int] = np.unique(which[wide]).tolist()
        for pair in pairs:
            rows = np.flatnonzero(which == pair)
            used = edges[: sum(one.shape[1] for one in corners.pairs[pair])][:, rows]
            found[rows, : len(used)] = nearest_hulls(w[rows], used, corners.pairs[pair])
        return found
    slots, t = corners.slots[which], np.zeros((len(w), len(edges) + 1))
    padded = np.concatenate((edges, np.zeros((1, *w.shape))))
    rows = np.arange(len(w))[:, None]
    start = w + np.einsum("nk,kni->ni", corners.middle[which], edges)
    size = _size(corners, which, w, edges)
    found, _ = nearest_in_tables(w, padded[slots, rows], start, size, corners.table, corners.bodies[which])
    t[rows, slots] = found
    return t[:, :-1]


def _padded(t: Array, count: int) -> Array:
    return np.pad(t, ((0, 0), (0, count - t.shape[1])))


def _size(corners: Corners, which: Indices, w: Array, edges: Array) -> Array:
    """Return an upper bound of |r| at any t (N,) [m]."""
    lengths: Array = np.linalg.norm(edges, axis=2)
    found: Array = np.linalg.norm(w, axis=1) + np.einsum("nk,kn->n", corners.spread[which], lengths)
    return found


def _depth(swept: SweptBundle, which: Indices, measured: Array, least: Array, length: Array) -> Array:
    """Return the largest motion (N,) [m] for which overlapping bodies certainly still overlap."""
    depth, plane, corners = np.zeros(len(which)), swept.flat[which], swept.corners
    rounding = _TOUCHING * _size(corners, which, measured[0], measured[1:])
    touching = ~swept.is_signed[which] & (length <= rounding)
    zonotope, solid = swept.zonotope[which], swept.counts[which] > _FLAT
    rows = np.flatnonzero(touching & zonotope & solid)
    if len(rows):
        depth[rows] = overlap(measured[0, rows], measured[1:, rows])
    rows = np.flatnonzero(touching & ~zonotope & solid)
    if len(rows):
        depth[rows] = ball(corners, which[rows], measured[0, rows], measured[1:, rows])
    beside = least - np.einsum("ni,ni->n", least, plane)[:, None] * plane
    close = (np.einsum("ni,ni->n", beside, beside) <= rounding**2) & np.any(plane, axis=1)
    for flags, inside in ((close & zonotope, _polygon), (close & ~zonotope, disc)):
        rows = np.flatnonzero(flags)
        if len(rows):
            found = inside(corners, which[rows], measured[0, rows], measured[1:, rows], plane[rows])
            depth[rows] = np.maximum(depth[rows], found)
    return depth


def _polygon(corners: Corners, which: Indices, w: Array, edges: Array, plane: Array) -> Array:
    return overlap_in_plane(w, edges, plane)
