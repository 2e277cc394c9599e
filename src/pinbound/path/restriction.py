"""A chain with some coordinates fixed: constants are folded, and rotations without effect are dropped.

A rotation C by a fixed coordinate is constant, and `C R(u, phi) = R(C u, phi) C`, so it moves into the axes and offsets
behind it. A boundary with many effective angles in the robot may have one, or none, in a slice of two coordinates.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pinbound.geometry.rotations import rotation_matrix
from pinbound.path.chain import Chain, drop_head, split
from pinbound.path.relative import RelativePath
from pinbound.typing import Array

__all__ = ["hold", "restrict", "restrict_path"]


def restrict(chain: Chain, at: Array, keep: Sequence[int], projection: Array | None = None) -> Chain:
    """Return a reduced chain over the coordinates `keep` with the same norm, with the others fixed as in `at`.

    Arguments are those of `hold`, and rows `projection` that give the part that counts; None: all of the vector.

    Example:
        >>> axes, slides = np.array([[0.0, 1.0, 0.0]] * 2), np.zeros((3, 3, 2))
        >>> offsets = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 2.0], [0.0, 0.0, 3.0]])
        >>> arm = Chain(offsets, slides, axes, np.eye(2), 6.0)
        >>> restrict(arm, np.array([0.0, 0.5]), [0]).rotations
        1
    """
    return drop_head(hold(chain, at, keep), projection)


def hold(chain: Chain, at: Array, keep: Sequence[int]) -> Chain:
    """Return a chain over the coordinates `keep` with the same value, with the others fixed as in `at`.

    Args:
        chain: A chain over n coordinates.
        at: (n,) [rad or m].
        keep: Indices of the coordinates that stay, in their new order.

    Example:
        >>> turn = Chain(np.array([[0.0, 0, 0], [1.0, 0, 0]]), np.zeros((2, 3, 2)), np.array([[0.0, 0, 1]]),
        ...     np.array([[1.0, 1.0]]), 1.0)
        >>> hold(turn, np.array([9.0, np.pi / 2]), [0]).offsets[1].round(12).tolist()
        [0.0, 1.0, 0.0]
    """
    kept = list(keep)
    held = np.where(np.isin(np.arange(len(at)), kept), 0.0, at)
    turn, scale = np.eye(3), chain.scale
    offsets: list[Array] = []
    slides: list[Array] = []
    axes: list[Array] = []
    coefficients: list[Array] = []
    for index in range(chain.rotations + 1):
        moves = index == 0
        if index:
            axis, c = chain.axes[index - 1], chain.coefficients[index - 1]
            moves = bool(np.any(c[kept]))
            if moves:
                axes.append(turn @ axis)
                coefficients.append(c[kept])
            turn = turn @ rotation_matrix(axis, float(c @ held))
        slid = chain.slides[index] @ held
        scale += float(np.linalg.norm(slid))
        block, slide = turn @ (chain.offsets[index] + slid), turn @ chain.slides[index][:, kept]
        if moves:
            offsets.append(block)
            slides.append(slide)
        else:
            offsets[-1] = offsets[-1] + block
            slides[-1] = slides[-1] + slide
    shape = (-1, len(kept))
    stacked = np.array(axes).reshape(-1, 3), np.array(coefficients).reshape(shape)
    return Chain(np.array(offsets), np.array(slides), *stacked, scale)


def restrict_path(path: RelativePath, at: Array, keep: Sequence[int]) -> RelativePath:
    """Return a path over the coordinates `keep` with the same separation, with the others fixed as in `at` (n,).

    Its branches stay as they are, over all coordinates.
    """
    chain, n, k = path.minimal, len(at), len(path.difference.directions)
    edges = np.array(path.difference.directions).reshape(k, *chain.offsets.shape)
    slides = np.concatenate((chain.slides, np.moveaxis(edges, 0, 2)), axis=2)
    coefficients = np.pad(chain.coefficients, ((0, 0), (0, k)))
    whole = Chain(chain.offsets, slides, chain.axes, coefficients, chain.scale)
    parameters = range(n, n + k)
    reduced = restrict(whole, np.append(at, np.zeros(k)), [*keep, *parameters], path.projection)
    return replace(path, difference=split(reduced, len(keep), path.difference.corners), frame=0)
