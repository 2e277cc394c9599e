"""The steps of the search for the nearest points of two bodies, for the text of `separation_source`.

They are those of `hull_source`, with their own working memory. Vertices are examined in vectors of eight, and the
direction with the largest proven lower bound is kept.
"""

from __future__ import annotations

from typing import Final

from pinbound.machine.hull_source import DIRECTION, FEATURES, INSIDE

__all__ = ["FURTHEST", "NEAREST_STEPS"]

FURTHEST: Final = """
low8, where8, here8 = every(math.inf), every(0.0), wide(w, counting)
for i in range(many // 8):
    h8 = ax * wide(w, at + 8 * i) + ay * wide(w, at + many + 8 * i) + az * wide(w, at + 2 * many + 8 * i)
    less8 = h8 < low8
    where8, low8, here8 = pick(less8, here8, where8), pick(less8, h8, low8), here8 + 8.0
out[lanes], out[lanes + 8] = low8, where8
low, c = out[lanes], np.int64(out[lanes + 8])
for i in range(1, 8):
    if out[lanes + i] < low:
        low, c = out[lanes + i], np.int64(out[lanes + 8 + i])
c = c if c < last else last
"""
"""The vertex of a body that is least along a vector, given the vector's products ax, ay, az with the edge vectors."""

_SUPPORT: Final = """
x, y, z = out[seen], out[seen + 1], out[seen + 2]
for side in range(2):
    e, at = seen + 3 + 9 * side, np.int64(w[p + 19 + 3 * side])
    many, last = np.int64(w[p + 20 + 3 * side]), np.int64(w[p + 21 + 3 * side])
    ax = out[e] * ux + out[e + 1] * uy + out[e + 2] * uz
    ay = out[e + 3] * ux + out[e + 4] * uy + out[e + 5] * uz
    az = out[e + 6] * ux + out[e + 7] * uy + out[e + 8] * uz
    @FURTHEST
    out[found + side] = c
    bx, by, bz = w[at + c], w[at + many + c], w[at + 2 * many + c]
    x += bx * out[e] + by * out[e + 3] + bz * out[e + 6]
    y += bx * out[e + 1] + by * out[e + 4] + bz * out[e + 7]
    z += bx * out[e + 2] + by * out[e + 5] + bz * out[e + 8]
size = math.sqrt(ux * ux + uy * uy + uz * uz)
low = (x * ux + y * uy + z * uz) / size
if low > bound or used == 0:
    n0, n1, n2 = ux / size, uy / size, uz / size
    bound = low if low > bound else bound
"""
"""The pair of vertices that is least along u, the lower bound of the distance that it gives, and n, the best u so
far."""

_NEAREST: Final = """
ux, uy, uz, length, bound, used, square = out[seen], out[seen + 1], out[seen + 2], 0.0, 0.0, 0, math.inf
n0, n1, n2 = w[p + 26], w[p + 27], w[p + 28]
for v in range(6):
    ux += w[p + 38 + v] * out[seen + 3 + 3 * v]
    uy += w[p + 38 + v] * out[seen + 4 + 3 * v]
    uz += w[p + 38 + v] * out[seen + 5 + 3 * v]
scale, left = math.sqrt(ux * ux + uy * uy + uz * uz) + w[p + 44], rounds
if not ux * ux + uy * uy + uz * uz > 0.0:
    ux, uy, uz = n0, n1, n2
while left > 0:
    if is_height:
        break
    left -= 1
    @SUPPORT
    if used != 0 and length - bound <= agree * scale:
        break
    slot, is_new = 3, True
    for i in range(4):
        if not used & (1 << i):
            slot = i
        elif out[corners + 2 * i] == out[found] and out[corners + 2 * i + 1] == out[found + 1]:
            is_new = False
    if not is_new:
        break
    out[work + 3 * slot], out[work + 3 * slot + 1], out[work + 3 * slot + 2] = x, y, z
    out[corners + 2 * slot], out[corners + 2 * slot + 1] = out[found], out[found + 1]
    before_used, used = used, used | (1 << slot)
    if used == 15:
        is_inside = True
        @INSIDE
        if is_inside:
            length = 0.0
            break
    best, must = square, 1 << slot
    for again in range(2):
        @FEATURES
        if best < square * (1.0 - agree):
            break
        must = 15
    if not best < square:
        used = before_used
        break
    @DIRECTION
    if length <= nothing * scale:
        length = 0.0
        break
"""
"""The distance of two points of the bodies that are nearest, or nearly; n, the direction of the bounds."""

NEAREST_STEPS: Final = (
    ("NEAREST", _NEAREST),
    ("SUPPORT", _SUPPORT),
    ("INSIDE", INSIDE.replace("s[", "out[")),
    ("FEATURES", FEATURES.replace("s[", "out[")),
    ("DIRECTION", DIRECTION.replace("s[", "out[")),
)
"""The parts of the text by name; parts that contain others come first."""
