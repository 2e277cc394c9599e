"""Proven bounds of a chain's derivatives over a box, from lever arms.

A rotation keeps lengths. So with `x_i = b_i + R_{i+1} x_{i+1}`, and `D_j = c_j u x . + d/dq_j` below a rotation,

    |x|      <= |b| + |x'|
    |d_j x|  <= |L_j| + |c_j| |x'| + |d_j x'|
    |d_jk x| <= |c_j c_k| |x'| + |c_j| |d_k x'| + |c_k| |d_j x'| + |d_jk x'|,   and so on for the third,

where x' is the part behind the rotation. Only `|b|` depends on the box, and only with prismatic joints.
`docs/regions.md`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pinbound.path.chain import Chain
from pinbound.typing import Array

__all__ = ["LeverArms", "lever_arms", "line_bounds"]


@dataclass(frozen=True)
class LeverArms:
    """Upper bounds over a box.

    Attributes:
        length: Bound of `|r|` [m].
        first: (n,) bounds of `|d r/d q_j|` [m/rad]: the lever arms.
        second: (n, n) bounds of `|d2 r/d q_j d q_k|`.
    """

    length: float
    first: Array
    second: Array


def lever_arms(chain: Chain, reach: Array) -> LeverArms:
    """Return the bounds over the box `|q_j| <= reach_j`.

    Args:
        chain: The chain.
        reach: (n,) [rad or m]; entries of revolute coordinates do not matter, and may be infinite.

    Example:
        >>> offsets = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 2.0]])
        >>> arm = Chain(offsets, np.zeros((2, 3, 1)), np.array([[0.0, 1.0, 0.0]]), np.array([[1.0]]), 3.0)
        >>> found = lever_arms(arm, np.array([np.pi]))
        >>> found.length, found.first.tolist(), found.second.tolist()
        (3.0, [2.0], [[2.0]])
    """
    n = chain.coefficients.shape[1]
    length, first, second = 0.0, np.zeros(n), np.zeros((n, n))
    for index in reversed(range(chain.rotations + 1)):
        if index < chain.rotations:
            c = np.abs(chain.coefficients[index])
            mixed = np.outer(c, first)
            second = np.outer(c, c) * length + mixed + mixed.T + second
            first = c * length + first
        slides = np.linalg.norm(chain.slides[index], axis=0)
        used = slides > 0.0
        length += float(np.linalg.norm(chain.offsets[index])) + float(slides[used] @ reach[used])
        first = first + slides
    return LeverArms(length, first, second)


def line_bounds(chain: Chain, reach: Array, index: int, order: int = 3) -> tuple[float, ...]:
    """Return bounds of `|r|, |r'|, |r''|, ...` up to `order` along one coordinate.

    Below a rotation the m-th derivative is `sum_i binom(m, i) |c|^(m - i) |x'^(i)|`.
    """
    values = [0.0] * (order + 1)
    for place in reversed(range(chain.rotations + 1)):
        if place < chain.rotations:
            c = abs(float(chain.coefficients[place, index]))
            values = [sum(math.comb(m, i) * c ** (m - i) * values[i] for i in range(m + 1)) for m in range(order + 1)]
        slides = np.linalg.norm(chain.slides[place], axis=0)
        used = slides > 0.0
        values[0] += float(np.linalg.norm(chain.offsets[place])) + float(slides[used] @ reach[used])
        values[1] += float(slides[index])
    return tuple(values)
