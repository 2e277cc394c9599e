"""The source text of step-safe rows, for LLVM: one for all robots, which reads the tables of `separation_tables`.

At one q, the nearest points of each requested pair are searched for as in `separation_source`. Along their direction n
the chain and the edge vectors of both bodies have values and rates. So each pair of vertices is linear in the step, up
to the bound of its curvature. If there are few pairs of vertices, each has a row. If there are more, one row decreases
as the nearest points do, and its loss is the most by which vertices may pass below them over the box. `docs/steps.md`
derives it.
"""

from __future__ import annotations

from functools import cache
from typing import Final

from pinbound.machine.compiled import KernelSource
from pinbound.machine.motion_source import put_part
from pinbound.machine.separation_source import LANES, PAIR, PARTS
from pinbound.tolerances import INFLATION

__all__ = ["FEW", "ROW", "step_source"]

FEW: Final = 8
"""Largest number of pairs of vertices with a row each."""

ROW: Final = 4
"""Data of a row before its rates: its pair, its value, its loss and its curvature over the box [m]."""


@cache
def step_source() -> KernelSource:
    """Return the source; it has the prototype of all kernels, with its tables in place of scratch.

    A question is q, the half-widths of the box, n ones, and the rounding bounds of all pairs. The answer begins with
    the rows; the result is their number.
    """
    text = _STEPS
    for name, part in (("LOSS", _LOSS), ("VERTICES", _VERTICES), ("WRITE", _WRITE), *PARTS):
        text = put_part(text, name, part)
    for name, value in (("INFLATION", INFLATION), ("PAIR", PAIR), ("FEW", FEW), ("ROW", ROW)):
        text = text.replace(f"${name}", repr(value))
    return KernelSource(text, 0, LANES)


_VERTICES: Final = """
at, many = np.int64(w[p + 19]), np.int64(w[p + 20])
a0, a1, a2 = w[at + vertex_a], w[at + many + vertex_a], w[at + 2 * many + vertex_a]
at, many = np.int64(w[p + 22]), np.int64(w[p + 23])
b0, b1, b2 = w[at + vertex_b], w[at + many + vertex_b], w[at + 2 * many + vertex_b]
height = out[alongs] + (a0 * out[alongs + 1] + a1 * out[alongs + 2] + a2 * out[alongs + 3])
height += b0 * out[alongs + 4] + b1 * out[alongs + 5] + b2 * out[alongs + 6]
"""
"""A pair of vertices, and its height along n."""

_WRITE: Final = """
out[row], out[row + 1], out[row + 2], out[row + 3] = pair, height - off, loss * $INFLATION, second * $INFLATION
for j in range(n):
    r = rates + 7 * j
    slope = out[r] + (a0 * out[r + 1] + a1 * out[r + 2] + a2 * out[r + 3])
    out[row + $ROW + j] = slope + (b0 * out[r + 4] + b1 * out[r + 5] + b2 * out[r + 6])
row += $ROW + n
"""
"""A row that decreases as one point on either body does."""

_LOSS: Final = """
height = out[alongs]
for side in range(2):
    at, many = np.int64(w[p + 19 + 3 * side]), np.int64(w[p + 20 + 3 * side])
    last, first = np.int64(w[p + 21 + 3 * side]), 1 + 3 * side
    ax, ay, az = out[alongs + first], out[alongs + first + 1], out[alongs + first + 2]
    @FURTHEST
    height += low
    bx, by, bz = w[at + c], w[at + many + c], w[at + 2 * many + c]
    @PLACE
    if side == 0:
        a0, a1, a2 = bx, by, bz
    b0, b1, b2 = bx, by, bz
    most8 = every(0.0)
    for i in range(many // 8):
        x8, y8, z8 = wide(w, at + 8 * i), wide(w, at + many + 8 * i), wide(w, at + 2 * many + 8 * i)
        dx8, dy8, dz8 = x8 - bx, y8 - by, z8 - bz
        loss8 = low - (ax * x8 + ay * y8 + az * z8)
        for j in range(n):
            r = rates + 7 * j + first
            fall8 = out[r] * dx8 + out[r + 1] * dy8 + out[r + 2] * dz8
            loss8 = loss8 + Q[half + j] * pick(fall8 < 0.0, -fall8, fall8)
        most8 = pick(loss8 > most8, loss8, most8)
    out[lanes] = most8
    low = 0.0
    for i in range(8):
        low = out[lanes + i] if out[lanes + i] > low else low
    loss += low
"""
"""The height of the least pair of vertices, the nearest points, and by how much vertices may pass below them."""

_STEPS: Final = """
@HEAD
counting, is_box, slope_points, bend_points, rate_count = 16, True, 0, 0, n
here, half, factors, errors, part, curvature = 0, n, 2 * n, 3 * n, 1.0, 0.5
mats, row, last_turns = $FEW * ($ROW + n) * count, 0, -1
@ROOM
for number in range(count):
    pair = index[number]
    p = pairs + $PAIR * pair
    k, turns = np.int64(w[p]), np.int64(w[p + 1])
    if turns != last_turns:
        @ANGLES
        last_turns = turns
    @VECTORS
    @NEAREST
    if not (length > 0.0 or is_height):
        n0, n1, n2 = 0.0, 0.0, 0.0
    @SWINGS
    @SLOPES
    @MOVES
    off, loss = Q[errors + pair] * (1.0 + wide), 0.0
    count_a, count_b = np.int64(w[p + 21]) + 1, np.int64(w[p + 24]) + 1
    if count_a * count_b > $FEW:
        @LOSS
        @WRITE
    else:
        for both in range(count_a * count_b):
            vertex_a = both // count_b
            vertex_b = both - count_b * vertex_a
            @VERTICES
            @WRITE
return row // ($ROW + n)
"""
"""The rows, pair by pair. Bodies that overlap have no direction: n is zero, and so is everything but the rounding
bound."""
