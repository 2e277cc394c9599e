"""The source text of the search of boxes for contact, for LLVM: one for all robots, which reads the tables of groups.

Each entry of the queue is a box and some of the 64 pairs of a group, given as two numbers of 32 bits. It is bounded at
its centre with half-widths h. Let `x_i = sum_(l >= i) M_l b_l` be the part beyond rotation i, and n the direction of r
there. Then

    n . dr/dphi_i = (n x U_i) . x_i,      |r| >= |r| - sum_j h_j |sum_i c_ij (n x U_i) . x_i| - K(h) / 2.

Boxes are taken in the order in which they were made, as long as the queue has space; otherwise the last one is taken
first. So the search also finds contact outside the first deep corner. `docs/certificates.md`.
"""

from __future__ import annotations

from functools import cache
from typing import Final

from pinbound.machine.compiled import KernelSource
from pinbound.machine.motion_source import GROUP, put_part
from pinbound.tolerances import INFLATION

__all__ = ["BOX_HEAD", "ENTRY", "NARROWEST", "box_source"]

BOX_HEAD: Final = 6
"""At the head of a question: budget, size of the queue, number of entries, positions, largest number of rotations."""

ENTRY: Final = 4
"""Data of an entry before the start and width of its box: group, tile, pairs as two numbers."""

NARROWEST: Final = 2.0**-40
"""Share of the whole box, in every coordinate, below which a box is not halved."""

_FEW: Final = 4
"""Largest number of pairs that are examined without their group's middle."""

_LANES: Final = 8


@cache
def box_source() -> KernelSource:
    """Return the source; it has the prototype of all kernels, with its tables in place of scratch."""
    text = put_part(put_part(_BOXES, "WALK", _WALK), "CORNER", _CORNER)
    for name, value in (
        ("INFLATION", INFLATION),
        ("GROUP", GROUP),
        ("HEAD", BOX_HEAD),
        ("ENTRY", ENTRY),
        ("FEW", _FEW),
        ("NARROWEST", NARROWEST),
    ):
        text = text.replace(f"${name}", repr(value))
    return KernelSource(text, 0, _LANES)


_WALK = """
k, rotation, error, wide, total = np.int64(w[group]), np.int64(w[group + 2]), w[group + 4], 0.0, 0.0
for j in range(n):
    error += w[errors + j] * Q[far + j]
for i in range(k):
    c, m, to, phi, swing = rows_at + n * np.int64(w[rotation]), mats + 9 * i, mats + 9 * (i + 1), 0.0, 0.0
    for j in range(n):
        phi += w[c + j] * out[centre + j]
        swing += abs(w[c + j]) * out[half + j]
    x, y, z, cos, sin = w[rotation + 1], w[rotation + 2], w[rotation + 3], math.cos(phi), math.sin(phi)
    rest = 1.0 - cos
    xx, yy, zz = x * x * rest + cos, y * y * rest + cos, z * z * rest + cos
    xy, yz, zx, sx, sy, sz = x * y * rest, y * z * rest, z * x * rest, x * sin, y * sin, z * sin
    for j in range(3):
        ax, ay, az = out[m + 3 * j], out[m + 3 * j + 1], out[m + 3 * j + 2]
        out[axes + 3 * i + j] = ax * x + ay * y + az * z
        out[to + 3 * j] = ax * xx + ay * (xy + sz) + az * (zx - sy)
        out[to + 3 * j + 1] = ax * (xy - sz) + ay * yy + az * (yz + sx)
        out[to + 3 * j + 2] = ax * (zx + sy) + ay * (yz - sx) + az * zz
    before = total * total
    total += swing
    out[pace + i], out[squares + i] = swing, total * total - before
    rotation += 4
wide = total
"""
"""M and U of each rotation of a group at the centre, the largest change of its angle, and the rounding bound."""

_CORNER = """
boxes += 1
rx, ry, rz, moved, second = w[base], w[base + 64], w[base + 128], 0.0, 0.0
for i in range(1, k + 1):
    m, f = mats + 9 * i, base + 192 * i
    x, y, z = w[f], w[f + 64], w[f + 128]
    ax = out[m] * x + out[m + 1] * y + out[m + 2] * z
    ay = out[m + 3] * x + out[m + 4] * y + out[m + 5] * z
    az = out[m + 6] * x + out[m + 7] * y + out[m + 8] * z
    out[blocks + 3 * i], out[blocks + 3 * i + 1], out[blocks + 3 * i + 2] = ax, ay, az
    rx += ax
    ry += ay
    rz += az
f = base + 192 * (k + 1)
for i in range(k):
    moved += w[f + 64 * i] * out[pace + i]
    second += w[f + 64 * i] * out[squares + i]
f += 64 * k
norm = math.sqrt(rx * rx + ry * ry + rz * rz)
nx, ny, nz = rx / norm, ry / norm, rz / norm
if not norm > 0.0:
    nx, ny, nz = 0.0, 0.0, 0.0
for j in range(n):
    out[slopes + j] = 0.0
ax, ay, az, rotation = 0.0, 0.0, 0.0, np.int64(w[group + 2]) + 4 * (k - 1)
for back in range(k):
    i = k - 1 - back
    ax += out[blocks + 3 * i + 3]
    ay += out[blocks + 3 * i + 4]
    az += out[blocks + 3 * i + 5]
    x, y, z = out[axes + 3 * i], out[axes + 3 * i + 1], out[axes + 3 * i + 2]
    slope = (ny * z - nz * y) * ax + (nz * x - nx * z) * ay + (nx * y - ny * x) * az
    c = rows_at + n * np.int64(w[rotation])
    for j in range(n):
        out[slopes + j] += w[c + j] * slope
    rotation -= 4
linear = 0.5 * second
for j in range(n):
    linear += abs(out[slopes + j]) * out[half + j]
moved = moved if moved < linear else linear
low = norm - moved * $INFLATION - error * wide
low = low if low > 0.0 else 0.0
low, value = low - w[f] - error, norm - w[f]
"""
"""The value of the pair at `base`, at the centre of the box, and the lower bound over the box."""

_BOXES = """
n, group_count, groups = np.int64(w[0]), np.int64(w[1]), np.int64(w[2])
rows_at, errors_at = np.int64(w[4]), np.int64(w[6])
budget, room, filled, results, queue = Q[0], np.int64(Q[1]), np.int64(Q[2]), np.int64(Q[3]), np.int64(Q[4])
most = np.int64(Q[5])
low_corner, high_corner, far, weights = $HEAD, $HEAD + n, $HEAD + 2 * n, $HEAD + 3 * n
summary, centre, half, slopes, start, width = 0, 8, 8 + n, 8 + 2 * n, 8 + 3 * n, 8 + 4 * n
mats = 8 + 5 * n
axes, pace, squares, blocks = mats + 9 * most, mats + 12 * most, mats + 13 * most, mats + 14 * most
size, boxes, head, stop, lowest, upper, place = $ENTRY + 2 * n, 0, 0, 0, math.inf, math.inf, 0
for j in range(9):
    out[mats + j] = 0.0
out[mats], out[mats + 4], out[mats + 8] = 1.0, 1.0, 1.0
while filled > 0:
    if boxes > budget or filled + 2 > room:
        stop = 2
        break
    filled -= 1
    last = head + filled
    last = last - room if not last < room else last
    entry = queue + size * (head if 2 * filled < room else last)
    head = head + 1 if 2 * filled < room else head
    head = 0 if head == room else head
    g, tile = np.int64(out[entry]), np.int64(out[entry + 1])
    masks, others = np.int64(out[entry + 2]), np.int64(out[entry + 3])
    narrow, longest, across, count = 1, -1.0, 0, 0
    for j in range(n):
        out[start + j], out[width + j] = out[entry + 4 + j], out[entry + 4 + n + j]
        span = Q[high_corner + j] - Q[low_corner + j]
        x = Q[low_corner + j] + (out[start + j] + 0.5 * out[width + j]) * span
        x = x if x > Q[low_corner + j] else Q[low_corner + j]
        x = x if x < Q[high_corner + j] else Q[high_corner + j]
        out[centre + j], out[half + j] = x, 0.5 * out[width + j] * span
        narrow = 0 if out[width + j] > $NARROWEST else narrow
        x = Q[weights + g * n + j] * out[half + j]
        across = j if x > longest else across
        longest = x if x > longest else longest
    group, errors = groups + $GROUP * g, errors_at + n * g
    @WALK
    data, first, block = np.int64(w[group + 3]), np.int64(w[group + 5]), 64 * (4 * k + 5)
    for p in range(32):
        count += ((masks // (1 << p)) & 1) + ((others // (1 << p)) & 1)
    if count > $FEW:
        base = data
        @CORNER
        if low > 0.0 and low >= lowest:
            continue
    kept, rest_kept, at = 0, 0, data + (tile - first + 1) * block
    for p in range(64):
        bit = p if p < 32 else p - 32
        is_asked = ((masks if p < 32 else others) // (1 << bit)) & 1
        if is_asked == 0:
            continue
        base, result = at + p, results + 64 * tile + p
        @CORNER
        upper = value + error if value + error < upper else upper
        if value < 0.0 - error:
            stop, place = 1, 64 * tile + p
            break
        if low > 0.0:
            lowest = low if low < lowest else lowest
            continue
        if value - low <= 2.0 * error or narrow > 0:
            out[result] = 1.0
            continue
        kept += (1 << bit) if p < 32 else 0
        rest_kept += 0 if p < 32 else (1 << bit)
    if stop == 1:
        break
    for turn in range(2):
        if kept + rest_kept == 0:
            break
        last = head + filled
        entry = queue + size * (last - room if not last < room else last)
        out[entry], out[entry + 1], out[entry + 2], out[entry + 3] = g, tile, kept, rest_kept
        for j in range(n):
            x = 0.5 * out[width + j] if j == across else out[width + j]
            out[entry + 4 + j] = out[start + j] + (x if j == across and turn == 1 else 0.0)
            out[entry + 4 + n + j] = x
        filled += 1
out[summary], out[summary + 1], out[summary + 2], out[summary + 3] = lowest, upper, stop, place
out[summary + 4], out[summary + 5] = head, filled
return boxes
"""
"""The loop over the queue until it is empty: boxes are bounded, and halved if they are neither clear nor in contact."""
