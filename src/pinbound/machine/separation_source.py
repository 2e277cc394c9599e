"""The source text of the bounds of separations over pieces of motions and over boxes, for LLVM: one for all robots.

A row is a pair and a piece, or a box. In its middle the rotations of the pair's chain are multiplied up to each block,
`M_i = R_1 ... R_i`, once for neighbouring rows with the same rotations and piece. The chain and the edge vectors of
both bodies are sums of `M_i b_i`. The search for nearest points is that of `hull_source`, and gives a unit vector n.
With `U_i = M_(i-1) u_i` and the part x_i beyond rotation i, the rates along n are

    n . dr/dphi_i = (n x U_i) . x_i,

The bounds are those that `bounds/swept_bounds.py` computes in NumPy, vertex by vertex, with eight vertices at once.
`docs/hull-proofs.md` derives the bounds and adds up the rounding; `bounds/separation_tables.py` writes the tables `w`.
"""

from __future__ import annotations

from functools import cache
from typing import Final

from pinbound.machine.compiled import KernelSource
from pinbound.machine.motion_source import put_part
from pinbound.machine.nearest_steps import FURTHEST, NEAREST_STEPS
from pinbound.tolerances import INFLATION

__all__ = [
    "EDGES",
    "LANES",
    "PAIR",
    "PARTS",
    "QUESTION",
    "TABLES",
    "room_of",
    "separation_source",
]

LANES: Final = 8
"""Vertices that are examined together."""

EDGES: Final = 3
"""The largest number of edge vectors of a body."""

TABLES: Final = 24
"""At the head of the tables: n, the position of the pairs, largest number of rotations, of blocks, and of vertices of a
body, constants of the search for nearest points, and the numbers from 0 to 7."""

QUESTION: Final = 6
"""At the head of a question: whether it is about boxes, number of control points of slopes and of bends (-1: bends have
no bound), numbers of a piece or box, pairs, rates."""

PAIR: Final = 45
"""Data of a pair: rotations, blocks of the chain and of six edge vectors, slides, lever arms, vertices, kind of
quantity, a point inside, reach."""


_FEW: Final = 4
"""Largest number of coordinates of a box of which all corners are examined."""


@cache
def separation_source() -> KernelSource:
    """Return the source; it has the prototype of all kernels, with its tables in place of scratch."""
    text = _ROWS
    own = (("SLOPED", _SLOPED), ("TURNED", _TURNED), ("LEAST", _LEAST))
    for name, part in (*own, *PARTS):
        text = put_part(text, name, part)
    for name, value in (("INFLATION", INFLATION), ("QUESTION", QUESTION), ("PAIR", PAIR), ("FEW", _FEW)):
        text = text.replace(f"${name}", repr(value))
    return KernelSource(text, 0, LANES)


def room_of(rotations: int, blocks: int, n: int) -> int:
    """Return how many numbers of working memory the code needs, for the largest numbers of rotations and blocks."""
    return 9 * (rotations + 1) + 12 * rotations + 3 * blocks + 50 + 9 * max(n, 1) + 40 + 2 * LANES


_HEAD: Final = """
n, pairs, most, most_blocks = np.int64(w[0]), np.int64(w[1]), np.int64(w[2]), np.int64(w[3])
agree, rounds, known, nothing, flat, sharp = w[5], np.int64(w[6]), w[7], w[8], w[9], w[10]
"""
"""The values at the head of the tables."""

_ROOM: Final = """
axes = mats + 9 * (most + 1)
mosts, totals, rates_phi, asides = axes + 3 * most, axes + 4 * most, axes + 5 * most, axes + 6 * most
squares, slopes, swings, turned = axes + 7 * most, axes + 8 * most, axes + 9 * most, axes + 12 * most
vectors = turned + 3 * most_blocks
across, alongs, rates = vectors + 21, vectors + 42, vectors + 49
signs, actives = rates + 7 * rate_count, rates + 8 * rate_count
work = actives + rate_count + 1
shares, tried, corners, found = work + 12, work + 16, work + 20, work + 28
lanes = work + 40
for j in range(9):
    out[mats + j] = 0.0
out[mats], out[mats + 4], out[mats + 8] = 1.0, 1.0, 1.0
"""
"""Positions in the working memory behind `mats`, of the size `room_of`; the first matrix is the identity."""

_ANGLES: Final = """
wide, total = 0.0, 0.0
for i in range(k):
    c, phi, rate, fast, bend, aside, spread = turns + (n + 3) * i, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    if is_box:
        for j in range(n):
            phi += w[c + j] * Q[here + j]
            fast += abs(w[c + j]) * Q[here + n + j]
        wide += fast
    else:
        loose, rough = 0.0, 0.0
        for j in range(n):
            size = abs(w[c + j])
            phi += w[c + j] * Q[here + j]
            aside += size * Q[here + n + j]
            rate += w[c + j] * Q[here + 2 * n + j]
            spread += size * abs(Q[here + 2 * n + j])
            loose += size * Q[here + 3 * n + j]
            rough += size * Q[here + 4 * n + j]
        for point in range(slope_points + bend_points):
            value, at = 0.0, here + (5 + point) * n
            for j in range(n):
                value += w[c + j] * Q[at + j]
            value = abs(value)
            if point < slope_points:
                fast = value if value > fast else fast
            else:
                bend = value if value > bend else bend
        fast, bend = fast + loose, bend + rough
        wide = spread if spread > wide else wide
    before = total * total
    total += fast
    out[mosts + i], out[totals + i], out[rates_phi + i], out[asides + i] = fast, total, rate, aside
    out[squares + i] = total * total - before + bend
    x, y, z, cos, sin = w[c + n], w[c + n + 1], w[c + n + 2], math.cos(phi), math.sin(phi)
    rest, m, to = 1.0 - cos, mats + 9 * i, mats + 9 * (i + 1)
    xx, yy, zz = x * x * rest + cos, y * y * rest + cos, z * z * rest + cos
    xy, yz, zx, sx, sy, sz = x * y * rest, y * z * rest, z * x * rest, x * sin, y * sin, z * sin
    for j in range(3):
        ax, ay, az = out[m + 3 * j], out[m + 3 * j + 1], out[m + 3 * j + 2]
        out[axes + 3 * i + j] = ax * x + ay * y + az * z
        out[to + 3 * j] = ax * xx + ay * (xy + sz) + az * (zx - sy)
        out[to + 3 * j + 1] = ax * (xy - sz) + ay * yy + az * (yz + sx)
        out[to + 3 * j + 2] = ax * (zx + sy) + ay * (yz - sx) + az * zz
"""
"""For each rotation, the change of its angle, its rate, and the bound of its second derivatives; M and U."""

_VECTORS: Final = """
place = turned
for v in range(7):
    x, y, z, block = 0.0, 0.0, 0.0, np.int64(w[p + 2 + 2 * v])
    for b in range(np.int64(w[p + 3 + 2 * v])):
        m = mats + 9 * np.int64(w[block])
        bx, by, bz = w[block + 1], w[block + 2], w[block + 3]
        px = out[m] * bx + out[m + 1] * by + out[m + 2] * bz
        py = out[m + 3] * bx + out[m + 4] * by + out[m + 5] * bz
        pz = out[m + 6] * bx + out[m + 7] * by + out[m + 8] * bz
        x, y, z = x + px, y + py, z + pz
        out[place], out[place + 1], out[place + 2] = px, py, pz
        place, block = place + 3, block + 4
    out[vectors + 3 * v], out[vectors + 3 * v + 1], out[vectors + 3 * v + 2] = x, y, z
slide = np.int64(w[p + 17])
for b in range(np.int64(w[p + 16])):
    m, bx, by, bz = mats + 9 * np.int64(w[slide]), 0.0, 0.0, 0.0
    for j in range(n):
        at = slide + 1 + 3 * j
        bx, by, bz = bx + Q[here + j] * w[at], by + Q[here + j] * w[at + 1], bz + Q[here + j] * w[at + 2]
    out[vectors] += out[m] * bx + out[m + 1] * by + out[m + 2] * bz
    out[vectors + 1] += out[m + 3] * bx + out[m + 4] * by + out[m + 5] * bz
    out[vectors + 2] += out[m + 6] * bx + out[m + 7] * by + out[m + 8] * bz
    slide += 1 + 4 * n
is_height, seen = w[p + 25] == 2.0, vectors
if w[p + 25] == 1.0:
    seen = across
    for v in range(7):
        x, y, z = out[vectors + 3 * v], out[vectors + 3 * v + 1], out[vectors + 3 * v + 2]
        for i in range(3):
            at = p + 29 + 3 * i
            out[across + 3 * v + i] = w[at] * x + w[at + 1] * y + w[at + 2] * z
"""
"""The chain and the edge vectors in the middle, with each block rotated; for a line, projected perpendicular to it."""

_SWINGS: Final = """
if w[p + 25] == 1.0:
    x, y, z, at = n0, n1, n2, p + 29
    n0 = w[at] * x + w[at + 1] * y + w[at + 2] * z
    n1 = w[at + 3] * x + w[at + 4] * y + w[at + 5] * z
    n2 = w[at + 6] * x + w[at + 7] * y + w[at + 8] * z
for i in range(k):
    x, y, z = out[axes + 3 * i], out[axes + 3 * i + 1], out[axes + 3 * i + 2]
    out[swings + 3 * i] = n1 * z - n2 * y
    out[swings + 3 * i + 1] = n2 * x - n0 * z
    out[swings + 3 * i + 2] = n0 * y - n1 * x
"""
"""n, projected perpendicular to a line once more, and its cross products with all axes."""

_SLOPES: Final = """
place = turned
for v in range(7):
    x, y, z = out[vectors + 3 * v], out[vectors + 3 * v + 1], out[vectors + 3 * v + 2]
    out[alongs + v] = n0 * x + n1 * y + n2 * z
    for i in range(k):
        out[slopes + i] = 0.0
    block = np.int64(w[p + 2 + 2 * v])
    for b in range(np.int64(w[p + 3 + 2 * v])):
        px, py, pz = out[place], out[place + 1], out[place + 2]
        for i in range(np.int64(w[block])):
            out[slopes + i] += out[swings + 3 * i] * px + out[swings + 3 * i + 1] * py + out[swings + 3 * i + 2] * pz
        place, block = place + 3, block + 4
    slide = np.int64(w[p + 17])
    for j in range(rate_count):
        out[rates + 7 * j + v] = 0.0
    for b in range(np.int64(w[p + 16]) if v == 0 else 0):
        l = np.int64(w[slide])
        m, bx, by, bz = mats + 9 * l, 0.0, 0.0, 0.0
        for j in range(n):
            at = slide + 1 + 3 * j
            bx, by, bz = bx + Q[here + j] * w[at], by + Q[here + j] * w[at + 1], bz + Q[here + j] * w[at + 2]
        px = out[m] * bx + out[m + 1] * by + out[m + 2] * bz
        py = out[m + 3] * bx + out[m + 4] * by + out[m + 5] * bz
        pz = out[m + 6] * bx + out[m + 7] * by + out[m + 8] * bz
        for i in range(l):
            out[slopes + i] += out[swings + 3 * i] * px + out[swings + 3 * i + 1] * py + out[swings + 3 * i + 2] * pz
        bx = n0 * out[m] + n1 * out[m + 3] + n2 * out[m + 6]
        by = n0 * out[m + 1] + n1 * out[m + 4] + n2 * out[m + 7]
        bz = n0 * out[m + 2] + n1 * out[m + 5] + n2 * out[m + 8]
        for j in range(n):
            at = slide + 1 + 3 * j
            px = bx * w[at] + by * w[at + 1] + bz * w[at + 2]
            if is_box:
                out[rates + 7 * j] += px * Q[factors + j]
            else:
                out[rates] += px * Q[here + 2 * n + j]
        slide += 1 + 4 * n
    if is_box:
        for i in range(k):
            for j in range(n):
                out[rates + 7 * j + v] += w[turns + (n + 3) * i + j] * out[slopes + i] * Q[factors + j]
    else:
        for i in range(k):
            out[rates + v] += out[rates_phi + i] * out[slopes + i]
"""
"""n times the chain and the edge vectors, and their rates: along the piece, or for each coordinate times its factor."""

_MOVES: Final = """
moved, off, slid = 0.0, 0.0, 0.0
slide = np.int64(w[p + 17])
for b in range(np.int64(w[p + 16])):
    l, fast, bent, loose, rough = np.int64(w[slide]), 0.0, 0.0, 0.0, 0.0
    at, norms = slide + 1, slide + 1 + 3 * n
    if is_box:
        for j in range(n):
            loose += w[norms + j] * Q[here + n + j]
    else:
        for j in range(n):
            off += w[norms + j] * Q[here + n + j]
            loose += w[norms + j] * Q[here + 3 * n + j]
            rough += w[norms + j] * Q[here + 4 * n + j]
        for point in range(slope_points + bend_points):
            x, y, z, q = 0.0, 0.0, 0.0, here + (5 + point) * n
            for j in range(n):
                x += Q[q + j] * w[at + 3 * j]
                y += Q[q + j] * w[at + 3 * j + 1]
                z += Q[q + j] * w[at + 3 * j + 2]
            size = math.sqrt(x * x + y * y + z * z)
            if point < slope_points:
                fast = size if size > fast else fast
            else:
                bent = size if size > bent else bent
    fast, bent = fast + loose, bent + rough
    moved += fast
    slid += bent
    if l > 0:
        slid += 2.0 * out[totals + l - 1] * fast
    slide += 1 + 4 * n
second, arms = slid, np.int64(w[p + 18])
for i in range(k):
    moved += w[arms + i] * out[mosts + i]
    second += w[arms + i] * out[squares + i]
    off += w[arms + i] * out[asides + i]
moved, second = part * moved, curvature * second
"""
"""The largest motion of any pair of vertices, the second-order bound, and the error of the middle."""

_LEAST: Final = """
for side in range(2):
    at, many = np.int64(w[p + 19 + 3 * side]), np.int64(w[p + 20 + 3 * side])
    last, first = np.int64(w[p + 21 + 3 * side]), 1 + 3 * side
    ax, ay, az = out[alongs + first], out[alongs + first + 1], out[alongs + first + 2]
    for j in range(rate_count):
        r = rates + 7 * j + first
        ax += out[signs + j] * out[r]
        ay += out[signs + j] * out[r + 1]
        az += out[signs + j] * out[r + 2]
    @FURTHEST
    height += low
    out[found + side] = c
"""
"""The least vertices of both bodies along n, at the end of a piece or at the corner of a box given by `signs`."""

_SLOPED: Final = """
active = 0
for j in range(rate_count):
    fall = 0.0
    for v in range(7):
        fall += abs(out[rates + 7 * j + v])
    out[actives + active] = j
    active += 1 if fall > 0.0 else 0
for corner_ in range((1 << active) if has_second and active <= $FEW else 0):
    height = out[alongs]
    for i in range(active):
        j = np.int64(out[actives + i])
        out[signs + j] = part if corner_ & (1 << i) else 0.0 - part
        height += out[signs + j] * out[rates + 7 * j]
    @LEAST
    sloped = height if height < sloped else sloped
"""
"""The least value at both ends of a piece, or at all corners of a box, of the relevant coordinates, if they are few."""

_TURNED: Final = """
sloped = corner
for j in range(rate_count):
    out[signs + j] = out[rates + 7 * j]
for side in range(2):
    at, many = np.int64(w[p + 19 + 3 * side]), np.int64(w[p + 20 + 3 * side])
    first, c = 1 + 3 * side, np.int64(out[found + side])
    ax, ay, az = out[alongs + first], out[alongs + first + 1], out[alongs + first + 2]
    bx, by, bz = w[at + c], w[at + many + c], w[at + 2 * many + c]
    low = ax * bx + ay * by + az * bz
    @PLACE
    slack8 = every(0.0)
    for i in range(many // 8):
        x8, y8, z8 = wide(w, at + 8 * i), wide(w, at + many + 8 * i), wide(w, at + 2 * many + 8 * i)
        dx8, dy8, dz8 = x8 - bx, y8 - by, z8 - bz
        rest8 = ax * x8 + ay * y8 + az * z8 - low
        for j in range(rate_count):
            r = rates + 7 * j + first
            fall8 = out[r] * dx8 + out[r + 1] * dy8 + out[r + 2] * dz8
            rest8 = rest8 - $INFLATION * pick(fall8 < 0.0, -fall8, fall8)
        slack8 = pick(rest8 < slack8, rest8, slack8)
    out[lanes] = slack8
    low = 0.0
    for i in range(8):
        low = out[lanes + i] if out[lanes + i] < low else low
    sloped += low
    for j in range(rate_count):
        r = rates + 7 * j + first
        out[signs + j] += bx * out[r] + by * out[r + 1] + bz * out[r + 2]
for j in range(rate_count):
    sloped -= $INFLATION * abs(out[signs + j])
"""
"""For a box: the least vertices, decreasing as the nearest points do, and by how much others may pass below these."""

_ROWS: Final = """
@HEAD
counting, is_box, slope_points, bend_points = 16, Q[0] > 0.0, np.int64(Q[1]), np.int64(Q[2])
has_second, piece_size, errors, rate_count = Q[2] >= 0.0, np.int64(Q[3]), $QUESTION, np.int64(Q[5])
bend_points = bend_points if bend_points > 0 else 0
pieces = errors + np.int64(Q[4])
part, curvature = 0.5, 0.125
if is_box:
    part, curvature = 1.0, 0.5
mats = 2 * count
@ROOM
last_piece, last_turns = -1, -1
for row_ in range(count):
    pair, piece = index[2 * row_], index[2 * row_ + 1]
    p, here = pairs + $PAIR * pair, pieces + piece_size * piece
    factors = here + n
    k, turns = np.int64(w[p]), np.int64(w[p + 1])
    if piece != last_piece or turns != last_turns:
        @ANGLES
        last_piece, last_turns = piece, turns
    @VECTORS
    @NEAREST
    if not (length > 0.0 or is_height):
        out[2 * row_], out[2 * row_ + 1] = 0.0, -math.inf
        continue
    @SWINGS
    @SLOPES
    @MOVES
    for j in range(rate_count):
        out[signs + j] = 0.0
    height = out[alongs]
    @LEAST
    corner, sloped = height, math.inf
    @SLOPED
    if has_second and active > $FEW:
        @TURNED
    value = corner if is_height else length
    low = corner - moved * $INFLATION
    sloped = sloped - second * $INFLATION
    low = sloped if has_second and sloped > low else low
    low = low - off * $INFLATION - Q[errors + pair] * (1.0 + wide)
    out[2 * row_], out[2 * row_ + 1] = value, low if low < math.inf else 0.0 - math.inf
return 0
"""
"""The rows, one by one. If a vertex is not a number, the least is infinite: such a bound proves nothing."""

_PLACE: Final = """
if not is_height:
    bx, by, bz = 0.0, 0.0, 0.0
    for i in range(4):
        if used & (1 << i):
            c = np.int64(out[corners + 2 * i + side])
            bx += out[shares + i] * w[at + c]
            by += out[shares + i] * w[at + many + c]
            bz += out[shares + i] * w[at + 2 * many + c]
"""
"""The nearest point on a body, with coefficients (bx, by, bz): shares of the vertices at the end of the search."""

PARTS: Final = (
    ("HEAD", _HEAD),
    ("ROOM", _ROOM),
    ("ANGLES", _ANGLES),
    ("VECTORS", _VECTORS),
    *NEAREST_STEPS,
    ("SWINGS", _SWINGS),
    ("SLOPES", _SLOPES),
    ("MOVES", _MOVES),
    ("PLACE", _PLACE),
    ("FURTHEST", FURTHEST),
)
"""The parts of a text that reads these tables, by name; a text adds its own parts, which come before them."""
