"""Paths of bodies, lines and planes as one bundle, with the lever arms of all pairs of their vertices.

A path is its chain and the edge vectors of both bodies, as chains of the same rotations. Lever arms hold for every pair
of vertices, so one bound of the second derivative serves all pairs. `swept_bounds` bounds these paths.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from pinbound.bounds.bounds import Bundle, bundle, lever_arms
from pinbound.bounds.vertices import Corners, corners_of
from pinbound.path.chain import Chain
from pinbound.path.relative import Form, RelativePath
from pinbound.tolerances import REDUCTION
from pinbound.typing import Array, Flags, Indices

__all__ = ["SweptBundle", "all_rows", "spread_of", "swept_bundle", "with_arms"]

_FEW = 16  # pairs of corners that are examined one by one


@dataclass(frozen=True)
class SweptBundle:
    """A bundle of m swept paths.

    Attributes:
        chains: The chain and the edge vectors of each path, 1 + K rows, padded with zeros.
        counts: (m,) number of rows of each path that are not padding.
        arms: (m (1 + K), rotations) lever arms [m]: in the row of the chain, the largest of all corners; zero for
            edges.
        corners: The corners of both bodies of each path, as coefficients of its edge vectors.
        zonotope: (m,) whether all t run over [0, 1].
        projection: (m, 3, 3) onto the part that counts: the identity, or perpendicular to a line.
        normal: (m, 3) normals of planes; zero for others.
        flat: (m, 3) unit normal of the plane in which the problem is planar, up to a constant height: the one axis of a
            path that is planar with its edges, or the direction of a line; zero for others.
        is_signed: (m,) whether it measures a height.
        reach: (m,) [m], length of each path with its furthest corners.
        vertices: The data for the lever arms.
    """

    chains: Bundle
    counts: Indices
    arms: Array
    corners: Corners
    zonotope: Flags
    projection: Array
    normal: Array
    flat: Array
    is_signed: Flags
    reach: Array
    vertices: _Vertices

    @cached_property
    def is_even(self) -> bool:
        """Whether no path has padding."""
        return bool(np.all(self.counts == self.rows))

    @property
    def rows(self) -> int:
        """The number 1 + K of rows for each path."""
        return len(self.chains.scale) // len(self.normal) if len(self.normal) else 1


def swept_bundle(paths: Sequence[RelativePath], lower: Array, upper: Array) -> SweptBundle:
    """Return a bundle of paths, with lever arms that hold in a box (n,), (n,) of q."""
    n, rows = len(lower), 1 + max((len(path.difference.directions) for path in paths), default=0)
    # The reduction took values up to 1e-14 m of an edge for zero, also on a short path. So the scale must not be
    # below 1.
    chains = [
        replace(chain, scale=max(chain.scale, 1.0))
        for path in paths
        for chain in (
            path.minimal,
            *path.difference.turned,
            *[_nothing(path)] * (rows - 1 - len(path.difference.turned)),
        )
    ]
    stacked = bundle(chains, n)
    projection, normal = np.tile(np.eye(3), (len(paths), 1, 1)), np.zeros((len(paths), 3))
    flat = np.array([_flat(path) for path in paths]).reshape(-1, 3)
    for row, path in enumerate(paths):
        if path.projection is not None:
            projection[row] = path.projection.T @ path.projection
            normal[row] = path.projection[0] if path.is_signed else 0.0
    signed = np.array([path.is_signed for path in paths], dtype=np.bool_)
    searched = [path.form is Form.SEARCHED for path in paths]
    corners = corners_of([path.difference.corners for path in paths], rows - 1, searched)
    lengths = (stacked.scale + np.linalg.norm(stacked.offsets, axis=2).sum(axis=1)).reshape(len(paths), rows)
    found = SweptBundle(
        chains=stacked,
        counts=np.array([1 + len(path.difference.directions) for path in paths], dtype=np.intp),
        arms=np.zeros((0, stacked.rotations)),
        corners=corners,
        zonotope=np.array([path.difference.is_zonotope for path in paths], dtype=np.bool_),
        projection=projection,
        normal=normal,
        flat=flat,
        is_signed=signed,
        reach=spread_of(corners, lengths),
        vertices=_vertices(paths, n, stacked.rotations),
    )
    return with_arms(found, lower, upper)


def with_arms(swept: SweptBundle, lower: Array, upper: Array) -> SweptBundle:
    """Return the same paths with lever arms that hold while q stays in another box."""
    arms, vertices, m = np.zeros((len(swept.chains.scale), swept.chains.rotations)), swept.vertices, len(swept.normal)
    each = np.zeros((m, swept.chains.rotations))
    if len(vertices.owners):
        np.maximum.at(each, vertices.owners, lever_arms(vertices.chains, lower, upper))
    if len(vertices.many):
        rows = vertices.many * swept.rows
        each[vertices.many] = lever_arms(swept.chains.take(rows), lower, upper, (vertices.along, vertices.across))
    arms[:: swept.rows] = each
    return replace(swept, arms=arms)


def spread_of(corners: Corners, rows: Array) -> Array:
    """Return the sum over the rows (m, 1 + K) of each path, with edges times their largest coefficients."""
    found: Array = rows[:, 0] + np.einsum("mk,mk->m", corners.spread, rows[:, 1:])
    return found


def _sides(path: RelativePath) -> tuple[slice, slice]:
    """Return the edge vectors of the first body, and those of the second."""
    split = path.difference.corners[0].shape[1]
    return slice(0, split), slice(split, len(path.difference.directions))


def _flat(path: RelativePath) -> Array:
    """Return the normal of the plane of a planar problem: all edges and motions stay in this plane."""
    if path.projection is not None:
        towards: Any = np.cross(path.projection[0], path.projection[-1])  # zero for a plane (one row)
        return towards
    chain, edges = path.minimal, path.difference.directions
    if not edges or not chain.rotations or not chain.is_planar:
        return np.zeros(3)
    axis = chain.axes[0]
    out = np.array([edge @ axis for edge in edges])  # (K, k + 1): part of each edge out of the plane, block by block
    leading_out = float(np.abs(axis @ chain.slides).max())
    for columns, corners in zip(_sides(path), path.difference.corners, strict=True):
        leading_out = max(leading_out, float(np.abs(corners @ out[columns]).max(initial=0.0)))
    return axis if leading_out <= REDUCTION else np.zeros(3)


@dataclass(frozen=True, eq=False)
class _Vertices:
    """The data for the lever arms of all pairs of corners.

    Attributes:
        chains: Chains of paths with few pairs of corners, one by one.
        owners: The path of each chain.
        many: Paths with many pairs of corners.
        along: (len(many), rotations) their largest `|u_i . b_i|` of any pair [m].
        across: (len(many), rotations) the same of `|u_i x b_i|`.
    """

    chains: Bundle
    owners: Indices
    many: Indices
    along: Array
    across: Array


def _vertices(paths: Sequence[RelativePath], n: int, rotations: int) -> _Vertices:
    """Return the data for lever arms: all chains for few pairs of corners, extremes of each block for many."""
    chains, owners, many = list[Chain](), list[int](), list[int]()
    along, across = list[Array](), list[Array]()
    for row, path in enumerate(paths):
        corners = path.difference.corners
        if len(corners[0]) * len(corners[1]) <= _FEW:
            chains += path.difference.vertex_chains
            owners += [row] * (len(corners[0]) * len(corners[1]))
            continue
        many.append(row)
        for blocks, found in zip((along, across), _extremes(path), strict=True):
            blocks.append(np.pad(found, (0, rotations - len(found))))
    stacked = bundle(chains, n)
    missing = rotations - stacked.rotations
    if missing:
        stacked = replace(
            stacked,
            offsets=np.pad(stacked.offsets, ((0, 0), (0, missing), (0, 0))),
            slides=None if stacked.slides is None else np.pad(stacked.slides, ((0, 0), (0, missing), (0, 0), (0, 0))),
            axes=np.concatenate((stacked.axes, np.tile([0.0, 0.0, 1.0], (len(chains), missing, 1))), axis=1),
            coefficients=np.pad(stacked.coefficients, ((0, 0), (0, missing), (0, 0))),
        )
    shape = len(many), rotations
    rows = np.array(owners, dtype=np.intp), np.array(many, dtype=np.intp)
    return _Vertices(stacked, *rows, np.array(along).reshape(shape), np.array(across).reshape(shape))


def _extremes(path: RelativePath) -> tuple[Array, Array]:
    """Return the largest `|u_i . b_i|` and `|u_i x b_i|` (rotations,) [m] of any pair of corners, block by block."""
    chain, difference = path.minimal, path.difference
    axes, blocks = chain.axes[:, None], np.zeros((chain.rotations, 1, 3)) + chain.offsets[1:, None]
    high = low = np.einsum("jvi,jvi->jv", axes, blocks)[:, 0]
    edges = np.array(difference.directions)[:, 1:]
    across, middle = np.zeros(chain.rotations), blocks[:, 0]
    for columns, corners in zip(_sides(path), difference.corners, strict=True):
        moved = np.einsum("vm,mji->jvi", corners, edges[columns])
        along = np.einsum("jvi,jvi->jv", axes, moved)
        high, low = high + along.max(axis=1, initial=0.0), low + along.min(axis=1, initial=0.0)
        centre = 0.5 * (moved.max(axis=1) + moved.min(axis=1))
        middle = middle + centre
        across = across + np.linalg.norm(np.cross(axes, moved - centre[:, None]), axis=2).max(axis=1)
    across = across + np.linalg.norm(np.cross(chain.axes, middle), axis=1)
    return np.maximum(np.abs(high), np.abs(low)), across


def _nothing(path: RelativePath) -> Chain:
    """Return an edge vector of length zero."""
    chain = path.minimal
    return replace(chain, offsets=np.zeros_like(chain.offsets), slides=np.zeros_like(chain.slides))


def all_rows(swept: SweptBundle, which: Indices) -> Indices:
    """Return the rows of the chains and edge vectors of paths `which`."""
    return (which[:, None] * swept.rows + np.arange(swept.rows)).ravel()
