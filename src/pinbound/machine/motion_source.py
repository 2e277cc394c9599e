"""The source text of the search of straight motions for contact, for LLVM: one for all robots, which reads tables.

Pairs of points whose chains rotate about the same axes by the same angles are a *group*. Their vectors are `r = sum_i
M_i b_i`, `r' = sum_i D_i b_i` with the same matrices M_i, `D_i = [omega_i] M_i`; each pair has its own b_i. So a part
of a motion costs one pass over the axes for each group, and a product of matrices for each pair, with 64 pairs in one
tile. A group is first examined as one pair, whose threshold covers all of its pairs. `docs/certificates.md` derives the
bounds and adds up the rounding; `bounds/groups.py` writes the tables `w` and reads the results.
"""

from __future__ import annotations

from functools import cache
from textwrap import indent
from typing import Final

from pinbound.machine.compiled import KernelSource
from pinbound.tolerances import INFLATION

__all__ = ["GROUP", "HEAD", "ROTATION", "TABLES", "TILE", "motion_source", "put_part"]

TILE: Final = 64
"""Pairs in one tile."""

HEAD: Final = 5
"""At the head of a question: precision [m], least clearance elsewhere [m], budget, mode, tight bounds for each."""

TABLES: Final = 24
"""At the head of the tables: n, number and position of groups and of rows of coefficients, tiles, size of memory."""

GROUP: Final = 6
"""Data of a group: rotations k, tiles, position of its rotations, its pairs, its rounding bound, its first tile."""

ROTATION: Final = 4
"""Data of a rotation: its row of coefficients, its axis."""


_LANES: Final = 8
"""Number of lanes; the text has no vectors, but it is compiled like text for lanes, by LLVM alone."""


@cache
def motion_source() -> KernelSource:
    """Return the source; it has the prototype of all kernels, with its tables in place of scratch."""
    text = _MOTIONS
    for name, part in (("ROWS", _ROWS), ("WALK", _WALK), ("TILE", _TILE), ("PAIR", _PAIR), ("REFINE", _REFINE)):
        text = put_part(text, name, part)
    for name, part in (("WALK", _WALK), ("PAIR", _PAIR), ("ANGLES", _ANGLES), ("BOUND", _BOUND)):
        text = put_part(text, name, part)
    for name, value in (
        ("INFLATION", repr(INFLATION)),
        ("TILE", str(TILE)),
        ("GROUP", str(GROUP)),
        ("HEAD", str(HEAD)),
    ):
        text = text.replace(f"${name}", value)
    return KernelSource(text, 0, _LANES)


def put_part(text: str, name: str, part: str) -> str:
    """Return a text in which each line `@name` is replaced by the part, with the same indentation."""
    lines: list[str] = []
    for line in text.splitlines():
        is_place = line.strip() == f"@{name}"
        lines.append(indent(part.strip("\n"), line[: len(line) - len(line.lstrip())]) if is_place else line)
    return "\n".join(lines) + "\n"


_ANGLES = """
c, phi, rate, spread = rows_at + k * n, 0.0, 0.0, 0.0
for j in range(n):
    step = Q[here + n + j] - Q[here + j]
    phi += w[c + j] * (Q[here + j] + u * step)
    rate += w[c + j] * step
    spread += abs(w[c + j] * step)
out[trig + 4 * k], out[trig + 4 * k + 1] = math.cos(phi), math.sin(phi)
out[trig + 4 * k + 2], out[trig + 4 * k + 3] = rate, spread
"""
"""For a row of coefficients: sine and cosine of its angle at u, the change of the angle over the piece, and its
size."""

_ROWS = """
for k in range(row_count):
    @ANGLES
"""

_WALK = """
k, rotation, error = np.int64(w[group]), np.int64(w[group + 2]), w[group + 4]
for j in range(n):
    error += w[errors + j] * out[far + j]
wide, total, wx, wy, wz = 0.0, 0.0, 0.0, 0.0, 0.0
for i in range(k):
    t, m, to = trig + 4 * np.int64(w[rotation]), mats + 9 * i, mats + 9 * (i + 1)
    x, y, z, cos, sin = w[rotation + 1], w[rotation + 2], w[rotation + 3], out[t], out[t + 1]
    rate, spread = out[t + 2] * width, out[t + 3] * width
    wide = spread if spread > wide else wide
    rest = 1.0 - cos
    xx, yy, zz = x * x * rest + cos, y * y * rest + cos, z * z * rest + cos
    xy, yz, zx, sx, sy, sz = x * y * rest, y * z * rest, z * x * rest, x * sin, y * sin, z * sin
    wx += rate * (out[m] * x + out[m + 1] * y + out[m + 2] * z)
    wy += rate * (out[m + 3] * x + out[m + 4] * y + out[m + 5] * z)
    wz += rate * (out[m + 6] * x + out[m + 7] * y + out[m + 8] * z)
    for j in range(3):
        ax, ay, az = out[m + 3 * j], out[m + 3 * j + 1], out[m + 3 * j + 2]
        out[to + 3 * j] = ax * xx + ay * (xy + sz) + az * (zx - sy)
        out[to + 3 * j + 1] = ax * (xy - sz) + ay * yy + az * (yz + sx)
        out[to + 3 * j + 2] = ax * (zx + sy) + ay * (yz - sx) + az * zz
    d = turns + 9 * (i + 1)
    for j in range(3):
        ax, ay, az = out[to + j], out[to + 3 + j], out[to + 6 + j]
        out[d + j] = wy * az - wz * ay
        out[d + 3 + j] = wz * ax - wx * az
        out[d + 6 + j] = wx * ay - wy * ax
    pace_of, before = abs(rate), total * total
    total += pace_of
    out[pace + i], out[squares + i] = pace_of, total * total - before
    rotation += 4
boxes += 1
"""
"""M and D of each rotation of a group, the change of its angle over the part, and the rounding bound of its norms."""

_BOUND = """
norm, speed = math.sqrt(rx * rx + ry * ry + rz * rz), vx * vx + vy * vy + vz * vz
tau = -(rx * vx + ry * vy + rz * vz) / speed
tau = tau if tau < 0.5 else 0.5
tau = tau if tau > -0.5 else -0.5
tau = tau if speed > 0.0 else 0.0
x, y, z = rx + tau * vx, ry + tau * vy, rz + tau * vz
moved, second = norm - 0.5 * moved * $INFLATION, math.sqrt(x * x + y * y + z * z) - 0.125 * second * $INFLATION
low = (moved if moved > second else second) - error * wide
low = low if low > 0.0 else 0.0
"""
"""The norm in the middle of the part, and its lower bound: by lever arms, or by the line of r and its second
derivative."""

_TILE = """
for p in range($TILE):
    out[p], out[p + 64], out[p + 128] = w[base + p], w[base + 64 + p], w[base + 128 + p]
    out[p + 192], out[p + 256], out[p + 320], out[p + 384], out[p + 448] = 0.0, 0.0, 0.0, 0.0, 0.0
for i in range(1, k + 1):
    m, f = mats + 9 * i, base + 192 * i
    ax, ay, az, bx, by, bz = out[m], out[m + 1], out[m + 2], out[m + 3], out[m + 4], out[m + 5]
    cx, cy, cz = out[m + 6], out[m + 7], out[m + 8]
    for p in range($TILE):
        x, y, z = w[f + p], w[f + 64 + p], w[f + 128 + p]
        out[p] += ax * x + ay * y + az * z
        out[p + 64] += bx * x + by * y + bz * z
        out[p + 128] += cx * x + cy * y + cz * z
    if width > 0.0:
        d = turns + 9 * i
        ax, ay, az, bx, by, bz = out[d], out[d + 1], out[d + 2], out[d + 3], out[d + 4], out[d + 5]
        cx, cy, cz = out[d + 6], out[d + 7], out[d + 8]
        for p in range($TILE):
            x, y, z = w[f + p], w[f + 64 + p], w[f + 128 + p]
            out[p + 192] += ax * x + ay * y + az * z
            out[p + 256] += bx * x + by * y + bz * z
            out[p + 320] += cx * x + cy * y + cz * z
        f, ax, ay = base + 192 * (k + 1) + 64 * (i - 1), out[pace + i - 1], out[squares + i - 1]
        for p in range($TILE):
            out[p + 384] += w[f + p] * ax
            out[p + 448] += w[f + p] * ay
f = base + 192 * (k + 1) + 64 * k
for p in range($TILE):
    rx, ry, rz, vx, vy, vz = out[p], out[p + 64], out[p + 128], out[p + 192], out[p + 256], out[p + 320]
    moved, second = out[p + 384], out[p + 448]
    @BOUND
    out[p] = norm - w[f + p]
    out[p + 64] = low - w[f + p] - error
boxes += np.int64(w[f + 64])
"""
"""For 64 pairs of a group, the value in the middle of the part, and the lower bound over it."""

_PAIR = """
rx, ry, rz, vx, vy, vz, moved, second = w[base], w[base + 64], w[base + 128], 0.0, 0.0, 0.0, 0.0, 0.0
for i in range(1, k + 1):
    m, d, f = mats + 9 * i, turns + 9 * i, base + 192 * i
    x, y, z = w[f], w[f + 64], w[f + 128]
    rx += out[m] * x + out[m + 1] * y + out[m + 2] * z
    ry += out[m + 3] * x + out[m + 4] * y + out[m + 5] * z
    rz += out[m + 6] * x + out[m + 7] * y + out[m + 8] * z
    vx += out[d] * x + out[d + 1] * y + out[d + 2] * z
    vy += out[d + 3] * x + out[d + 4] * y + out[d + 5] * z
    vz += out[d + 6] * x + out[d + 7] * y + out[d + 8] * z
f = base + 192 * (k + 1)
for i in range(k):
    moved += w[f + 64 * i] * out[pace + i]
    second += w[f + 64 * i] * out[squares + i]
f += 64 * k
@BOUND
low, value = low - w[f] - error, norm - w[f]
"""
"""The same for the pair at `base`."""

_REFINE = """
depth, list_top = 0, lists + many
out[stack], out[stack + 1], out[stack + 2], out[stack + 3] = 0.0, 0.5, 0.0, many
out[stack + 4], out[stack + 5], out[stack + 6], out[stack + 7] = 0.5, 1.0, 0.0, many
depth = 2
while depth > 0:
    depth -= 1
    top = stack + 4 * depth
    a, b, begin, many = out[top], out[top + 1], np.int64(out[top + 2]), np.int64(out[top + 3])
    width, u = b - a, 0.5 * (a + b)
    for turn in range(np.int64(w[group])):
        k = np.int64(w[np.int64(w[group + 2]) + 4 * turn])
        @ANGLES
    @WALK
    list_top, left = begin + many, 0
    for one in range(begin, begin + many):
        p = np.int64(out[lists + one])
        result = results + 5 * p
        if out[result + 4] > 0.0:
            continue
        tile = p // 64
        base = data + (tile - first + 1) * block + (p - 64 * tile)
        @PAIR
        boxes += 1
        upper = value + error
        if upper < out[result + 1]:
            out[result + 1], out[result + 2], out[result + 3] = upper, piece, u
        target = upper if upper < target else target
        if value < 0.0 - error:
            out[result + 4] = 1.0
            violated = 1
            continue
        goal = (out[result + 1] if each > 0.0 else target) - precision
        if low > 0.0 and low >= goal:
            out[result] = low if low < out[result] else out[result]
            continue
        if value - low <= 2.0 * error or width <= 3.552713678800501e-15:
            if low > 0.0:
                out[result] = low if low < out[result] else out[result]
            else:
                out[result + 4] = 2.0
                unknown = 1
            continue
        out[lists + list_top + left] = p
        left += 1
    if boxes - begun > budget:
        if mode == 0:
            return -1
        unknown = 1
    if mode > 0 and violated + unknown > 0:
        break
    if left > 0:
        out[top], out[top + 1], out[top + 2], out[top + 3] = u, b, list_top, left
        out[top + 4], out[top + 5], out[top + 6], out[top + 7] = a, u, list_top, left
        depth += 2
"""
"""Halve the piece, depth first, for the pairs of a group that are not clear on it, or not bounded tightly."""

_MOTIONS = """
n, group_count, groups = np.int64(w[0]), np.int64(w[1]), np.int64(w[2])
row_count, rows_at, tile_count, errors_at = np.int64(w[3]), np.int64(w[4]), np.int64(w[5]), np.int64(w[6])
mats, turns, pace, squares = np.int64(w[7]), np.int64(w[8]), np.int64(w[9]), np.int64(w[10])
trig, far, lows = np.int64(w[11]), np.int64(w[12]), np.int64(w[13])
lists, stack, results = np.int64(w[14]), np.int64(w[15]), np.int64(w[16])
precision, elsewhere, budget, mode, each = Q[0], Q[1], Q[2], np.int64(Q[3]), Q[4]
boxes, motion, motions = 0, 0, 1
for j in range(9):
    out[mats + j], out[turns + j] = 0.0, 0.0
out[mats], out[mats + 4], out[mats + 8] = 1.0, 1.0, 1.0
pieces = count
if mode > 0:
    pieces, motions = 1, count
while motion < motions:
    start = $HEAD + motion * 2 * n
    target, violated, unknown, begun = elsewhere, 0, 0, boxes
    for p in range(64 * tile_count):
        result = results + 5 * p
        out[result], out[result + 1], out[result + 2] = math.inf, math.inf, 0.0
        out[result + 3], out[result + 4] = 0.0, 0.0
    for j in range(n):
        most = 0.0
        for piece in range(pieces):
            x, y = abs(Q[start + piece * 2 * n + j]), abs(Q[start + piece * 2 * n + n + j])
            most = x if x > most else most
            most = y if y > most else most
        out[far + j] = most
    for knot in range(pieces + 1):
        if mode > 0:
            break
        piece, u, width = knot, 0.0, 0.0
        if knot == pieces:
            piece, u = pieces - 1, 1.0
        here = start + piece * 2 * n
        @ROWS
        for g in range(group_count):
            group, errors = groups + $GROUP * g, errors_at + n * g
            @WALK
            data, first, block = np.int64(w[group + 3]), np.int64(w[group + 5]), 64 * (4 * k + 5)
            for tile in range(np.int64(w[group + 1])):
                base = data + (tile + 1) * block
                @TILE
                for p in range($TILE):
                    result, upper = results + 5 * (64 * (first + tile) + p), out[p] + error
                    if upper < out[result + 1]:
                        out[result + 1], out[result + 2], out[result + 3] = upper, piece, u
                        target = upper if upper < target else target
                    if out[p] < 0.0 - error:
                        out[result + 4] = 1.0
        if boxes > budget:
            return -1
    for piece in range(pieces):
        here, u, width = start + piece * 2 * n, 0.5, 1.0
        @ROWS
        for g in range(group_count):
            group, errors = groups + $GROUP * g, errors_at + n * g
            @WALK
            data, first, block = np.int64(w[group + 3]), np.int64(w[group + 5]), 64 * (4 * k + 5)
            base = data
            @PAIR
            is_far = low > 0.0 and low >= target - precision and each == 0.0
            for tile in range(np.int64(w[group + 1])):
                base = data + (tile + 1) * block
                at = lows + 64 * (first + tile)
                if is_far:
                    for p in range($TILE):
                        out[at + p] = low
                    continue
                @TILE
                for p in range($TILE):
                    result, upper = results + 5 * (64 * (first + tile) + p), out[p] + error
                    out[at + p] = out[p + 64]
                    if upper < out[result + 1]:
                        out[result + 1], out[result + 2], out[result + 3] = upper, piece, u
                        target = upper if upper < target else target
                    if out[p] < 0.0 - error:
                        out[result + 4] = 1.0
                        violated = 1
            if mode > 0 and violated > 0:
                break
        if mode == 0 and boxes > budget:
            return -1
        for g in range(group_count):
            if mode > 0 and violated + unknown > 0:
                break
            group, errors, many = groups + $GROUP * g, errors_at + n * g, 0
            first = np.int64(w[group + 5])
            for p in range(64 * first, 64 * (first + np.int64(w[group + 1]))):
                low, result = out[lows + p], results + 5 * p
                if out[result + 4] > 0.0:
                    continue
                goal = (out[result + 1] if each > 0.0 else target) - precision
                if low > 0.0 and low >= goal:
                    out[result] = low if low < out[result] else out[result]
                else:
                    out[lists + many] = p
                    many += 1
            if many > 0:
                k = np.int64(w[group])
                data, block = np.int64(w[group + 3]), 64 * (4 * k + 5)
                @REFINE
    if mode > 0:
        lowest, least, chosen = math.inf, math.inf, 0
        for p in range(64 * tile_count):
            result = results + 5 * p
            lowest = out[result] if out[result] < lowest else lowest
            if out[result + 1] < least:
                least, chosen = out[result + 1], p
        at = row + column * motion
        out[at], out[at + 1], out[at + 2] = lowest, least, chosen
        out[at + 3], out[at + 4], out[at + 5] = out[results + 5 * chosen + 3], violated, unknown
    motion += 1
return boxes
"""
"""Motions one by one: values at the knots, bounds over whole pieces, and halving of pieces that are not clear."""
