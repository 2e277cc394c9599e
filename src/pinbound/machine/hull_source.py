"""The source text of the search for nearest points of convex hulls: one for all robots, which reads tables.

All data of a set of boundaries are in one array of numbers, `s`: a head, tables, and working memory. `hulls` writes it.
So machine code is compiled once on a machine and not once for each robot, and its length does not grow with the number
of pairs. It is one function, combined from the steps below, which `functions` translates to LLVM: Numba itself would
need ten seconds of Python for it. `docs/kernel.md` derives the method.
"""

from __future__ import annotations

from functools import cache
from textwrap import indent
from typing import Final

from pinbound.machine.compiled import KernelSource
from pinbound.machine.hull_slopes import SLOPES

__all__ = ["DIRECTION", "FEATURES", "HEAD", "INSIDE", "NODE", "PAIR", "SLIDE", "STATE", "WORK", "hull_source"]

HEAD: Final = 24
"""Numbers at the head: n, mode, then number and position of angles, nodes and pairs, positions in memory, constants."""

NODE: Final = 8
"""Data of a node: the one above, the step to it, its axis, its angle."""

STATE: Final = 15
"""Data of a node's state: its rotation W, its position P, its rotated axis."""

PAIR: Final = 56
"""Data of a pair: last node, b_0, b_k, twice a node and edge vectors, vertices, threshold, reach, slides, path."""

SLIDE: Final = 6
"""Data of a prismatic displacement: its block, its node, its coordinate, its direction."""

WORK: Final = 46
"""Data of a search: four corners, their shares twice, their vertices, edge vectors of a and b."""


@cache
def hull_source() -> KernelSource:
    """Return the source; it has the prototype of all kernels, with its tables in place of scratch."""
    steps = {name: indent(text, "    " * depth).strip() for name, (depth, text) in _STEPS.items()}
    text = _FRAME.format(**steps, node=NODE, state=STATE, pair=PAIR, slide=SLIDE)
    return KernelSource(_KERNEL.format(text=text), 0)


_PLACE = """\
for k in range(angle_count):
    angle, terms = 0.0, np.int64(s[angles + 2 * k + 1])
    for i in range(np.int64(s[angles + 2 * k])):
        angle += s[terms + 2 * i + 1] * Q[here + np.int64(s[terms + 2 * i])]
    if not abs(angle) < math.inf:
        is_regular = False
    s[trig + 2 * k], s[trig + 2 * k + 1] = math.cos(angle), math.sin(angle)
for k in range(1, node_count):
    at, to = nodes + NODE * k, state + STATE * k
    above, turn = state + STATE * np.int64(s[at]), trig + 2 * np.int64(s[at + 7])
    x, y, z, cos, sin = s[at + 4], s[at + 5], s[at + 6], s[turn], s[turn + 1]
    rest = 1.0 - cos
    xx, yy, zz = x * x * rest + cos, y * y * rest + cos, z * z * rest + cos
    xy, yz, zx, sx, sy, sz = x * y * rest, y * z * rest, z * x * rest, x * sin, y * sin, z * sin
    for i in range(3):
        ax, ay, az = s[above + 3 * i], s[above + 3 * i + 1], s[above + 3 * i + 2]
        s[to + 3 * i] = ax * xx + ay * (xy + sz) + az * (zx - sy)
        s[to + 3 * i + 1] = ax * (xy - sz) + ay * yy + az * (yz + sx)
        s[to + 3 * i + 2] = ax * (zx + sy) + ay * (yz - sx) + az * zz
        s[to + 9 + i] = s[above + 9 + i] + ax * s[at + 1] + ay * s[at + 2] + az * s[at + 3]
        s[to + 12 + i] = ax * x + ay * y + az * z
"""
"""Sines of each angle once, W and P of each node."""

_MIDDLES = """\
for k in range(pair_count):
    p = pairs + PAIR * k
    at = state + STATE * np.int64(s[p])
    x, y, z = s[p + 4], s[p + 5], s[p + 6]
    wx = s[p + 1] + s[at + 9] + s[at] * x + s[at + 1] * y + s[at + 2] * z
    wy = s[p + 2] + s[at + 10] + s[at + 3] * x + s[at + 4] * y + s[at + 5] * z
    wz = s[p + 3] + s[at + 11] + s[at + 6] * x + s[at + 7] * y + s[at + 8] * z
    slide = np.int64(s[p + 35])
    for _ in range(np.int64(s[p + 34])):
        q, at = Q[here + np.int64(s[slide + 2])], state + STATE * np.int64(s[slide + 1])
        x, y, z = q * s[slide + 3], q * s[slide + 4], q * s[slide + 5]
        wx += s[at] * x + s[at + 1] * y + s[at + 2] * z
        wy += s[at + 3] * x + s[at + 4] * y + s[at + 5] * z
        wz += s[at + 6] * x + s[at + 7] * y + s[at + 8] * z
        slide += SLIDE
    s[middles + 4 * k], s[middles + 4 * k + 1], s[middles + 4 * k + 2] = wx, wy, wz
    if s[p + 40] == ACROSS:
        x, y, z = wx, wy, wz
        wx = s[p + 41] * x + s[p + 42] * y + s[p + 43] * z
        wy = s[p + 44] * x + s[p + 45] * y + s[p + 46] * z
        wz = s[p + 47] * x + s[p + 48] * y + s[p + 49] * z
    length = math.sqrt(wx * wx + wy * wy + wz * wz)
    if not length < math.inf:
        is_regular = False
    low = length * less - s[p + 33]
    if s[p + 40] == HEIGHT:
        low = s[p + 41] * wx + s[p + 42] * wy + s[p + 43] * wz - s[p + 33] - length * (1.0 - less)
    elif low < 0.0:
        low = 0.0
    s[middles + 4 * k + 3] = low - s[p + 31]
"""
"""For each pair, the vector between the middles of its bodies, and the clearance of their bounding balls."""

_CHOOSE = """\
low, k = math.inf, -1
if is_smallest:
    for i in range(pair_count):
        if s[middles + 4 * i + 3] < low:
            low, k = s[middles + 4 * i + 3], i
    if k < 0 or low > least:
        break
    s[middles + 4 * k + 3] = math.inf
    if low == least and k > which:
        continue
else:
    k, chosen = chosen, chosen + 1
    if k == pair_count:
        break
"""
"""The next pair: in sequence, or the one with the least clearance of bounding balls, until this exceeds the least
found."""

_EDGES = """\
for side in range(2):
    at, to = p + 7 + 10 * side, work + EDGES + 9 * side
    turn = state + STATE * np.int64(s[at])
    for j in range(3):
        x, y, z = s[at + 1 + j], s[at + 4 + j], s[at + 7 + j]
        s[to + j] = s[turn] * x + s[turn + 1] * y + s[turn + 2] * z
        s[to + 3 + j] = s[turn + 3] * x + s[turn + 4] * y + s[turn + 5] * z
        s[to + 6 + j] = s[turn + 6] * x + s[turn + 7] * y + s[turn + 8] * z
"""
"""The edge vectors of both bodies, as columns of two matrices: each is a rotation times a constant matrix."""

_SUPPORT = """\
a = furthest(
    s, a_at, a_count,
    s[e] * ux + s[e + 3] * uy + s[e + 6] * uz,
    s[e + 1] * ux + s[e + 4] * uy + s[e + 7] * uz,
    s[e + 2] * ux + s[e + 5] * uy + s[e + 8] * uz,
)
b = furthest(
    s, b_at, b_count,
    s[f] * ux + s[f + 3] * uy + s[f + 6] * uz,
    s[f + 1] * ux + s[f + 4] * uy + s[f + 7] * uz,
    s[f + 2] * ux + s[f + 5] * uy + s[f + 8] * uz,
)
if a > a_last:
    a = a_last
if b > b_last:
    b = b_last
ax, ay, az = s[a_at + a], s[a_at + a_count + a], s[a_at + 2 * a_count + a]
bx, by, bz = s[b_at + b], s[b_at + b_count + b], s[b_at + 2 * b_count + b]
x = wx + s[e] * ax + s[e + 1] * ay + s[e + 2] * az + s[f] * bx + s[f + 1] * by + s[f + 2] * bz
y = wy + s[e + 3] * ax + s[e + 4] * ay + s[e + 5] * az + s[f + 3] * bx + s[f + 4] * by + s[f + 5] * bz
z = wz + s[e + 6] * ax + s[e + 7] * ay + s[e + 8] * az + s[f + 6] * bx + s[f + 7] * by + s[f + 8] * bz
if is_across:
    px, py, pz = x, y, z
    x = s[p + 41] * px + s[p + 42] * py + s[p + 43] * pz
    y = s[p + 44] * px + s[p + 45] * py + s[p + 46] * pz
    z = s[p + 47] * px + s[p + 48] * py + s[p + 49] * pz
low = (x * ux + y * uy + z * uz) / math.sqrt(ux * ux + uy * uy + uz * uz)
if low > bound:
    bound = low
"""
"""The corner furthest against u, and with it a lower bound of the distance."""

INSIDE = """\
total, far = 0.0, 0.0
for i in range(4):
    ax, ay, az = s[work + 3 * i], s[work + 3 * i + 1], s[work + 3 * i + 2]
    size = ax * ax + ay * ay + az * az
    if size > far:
        far = size
for i in range(4):
    b, c, d = work + 3 * ((i + 1) & 3), work + 3 * ((i + 2) & 3), work + 3 * ((i + 3) & 3)
    bx, by, bz = s[b], s[b + 1], s[b + 2]
    px, py, pz = s[c] - bx, s[c + 1] - by, s[c + 2] - bz
    qx, qy, qz = s[d] - bx, s[d + 1] - by, s[d + 2] - bz
    volume = bx * (py * qz - pz * qy) + by * (pz * qx - px * qz) + bz * (px * qy - py * qx)
    if i & 1:
        volume = -volume
    size = far * (px * px + py * py + pz * pz) * (qx * qx + qy * qy + qz * qz)
    if not volume * volume > known * size or total * volume < 0.0:
        is_inside = False
        break
    total = volume
"""
"""Whether four corners contain the origin, and are not a sliver of rounding: all four volumes have the same sign."""

FEATURES = """\
for a in range(4):
    if not used & (1 << a):
        continue
    ax, ay, az = s[work + 3 * a], s[work + 3 * a + 1], s[work + 3 * a + 2]
    size = ax * ax + ay * ay + az * az
    if must & (1 << a) and size < best:
        best = size
        s[tried], s[tried + 1], s[tried + 2], s[tried + 3] = 0.0, 0.0, 0.0, 0.0
        s[tried + a] = 1.0
    for b in range(a + 1, 4):
        if not used & (1 << b):
            continue
        bx, by, bz = s[work + 3 * b], s[work + 3 * b + 1], s[work + 3 * b + 2]
        px, py, pz = bx - ax, by - ay, bz - az
        pp = px * px + py * py + pz * pz
        if must & (1 << a | 1 << b):
            t = -(ax * px + ay * py + az * pz)
            if t >= 0.0 and t <= pp and pp > 0.0:
                t /= pp
                rx, ry, rz = (1.0 - t) * ax + t * bx, (1.0 - t) * ay + t * by, (1.0 - t) * az + t * bz
                size = rx * rx + ry * ry + rz * rz
                if size < best:
                    best = size
                    s[tried], s[tried + 1], s[tried + 2], s[tried + 3] = 0.0, 0.0, 0.0, 0.0
                    s[tried + a], s[tried + b] = 1.0 - t, t
        for c in range(b + 1, 4):
            if not used & (1 << c) or not must & (1 << a | 1 << b | 1 << c):
                continue
            qx, qy, qz = s[work + 3 * c] - ax, s[work + 3 * c + 1] - ay, s[work + 3 * c + 2] - az
            along, size, t = pp, qx * qx + qy * qy + qz * qz, px * qx + py * qy + pz * qz
            nx, ny, nz = px, py, pz
            if along < size:
                along, size = size, along
                nx, ny, nz, qx, qy, qz = qx, qy, qz, px, py, pz
            if not along > 0.0:
                continue
            t /= along
            qx, qy, qz = qx - t * nx, qy - t * ny, qz - t * nz
            total = qx * qx + qy * qy + qz * qz
            if not total > flat * size:
                continue
            fb, fc = -(ax * nx + ay * ny + az * nz) / along, -(ax * qx + ay * qy + az * qz) / total
            rx, ry, rz = ax + fb * nx + fc * qx, ay + fb * ny + fc * qy, az + fb * nz + fc * qz
            if total < sharp * size:
                dx, dy = -(rx * nx + ry * ny + rz * nz) / along, -(rx * qx + ry * qy + rz * qz) / total
                rx, ry, rz = rx + dx * nx + dy * qx, ry + dx * ny + dy * qy, rz + dx * nz + dy * qz
                fb, fc = fb + dx, fc + dy
            fb -= t * fc
            size = rx * rx + ry * ry + rz * rz
            if fb >= 0.0 and fc >= 0.0 and fb + fc <= 1.0 and size < best:
                best = size
                if nx != px or ny != py or nz != pz:
                    fb, fc = fc, fb
                s[tried], s[tried + 1], s[tried + 2], s[tried + 3] = 0.0, 0.0, 0.0, 0.0
                s[tried + a], s[tried + b], s[tried + c] = 1.0 - fb - fc, fb, fc
"""
"""The point nearest to the origin on the vertices, edges and faces of `used` corners that include one of `must`."""

DIRECTION = """\
square, count, full, used = best, 0, used, 0
vx, vy, vz = 0.0, 0.0, 0.0
for i in range(4):
    share = s[tried + i]
    s[shares + i] = share
    if share > 0.0:
        used |= 1 << i
        count += 1
        vx += share * s[work + 3 * i]
        vy += share * s[work + 3 * i + 1]
        vz += share * s[work + 3 * i + 2]
length = math.sqrt(vx * vx + vy * vy + vz * vz)
ux, uy, uz = vx, vy, vz
if count == 2 or count == 3:
    a = work if used & 1 else (work + 3 if used & 2 else work + 6)
    c = work + 9 if used & 8 else (work + 6 if used & 4 else work + 3)
    b = work + 3 if count == 3 and a == work and used & 2 else work + 6
    if count == 2:
        b = c
    px, py, pz = s[b] - s[a], s[b + 1] - s[a + 1], s[b + 2] - s[a + 2]
    qx, qy, qz = s[c] - s[a], s[c + 1] - s[a + 1], s[c + 2] - s[a + 2]
    along, size = px * px + py * py + pz * pz, qx * qx + qy * qy + qz * qz
    if along < size:
        along, size = size, along
        px, py, pz, qx, qy, qz = qx, qy, qz, px, py, pz
    t = (px * qx + py * qy + pz * qz) / along
    qx, qy, qz = qx - t * px, qy - t * py, qz - t * pz
    if qx * qx + qy * qy + qz * qz > flat * size:
        nx, ny, nz = py * qz - pz * qy, pz * qx - px * qz, px * qy - py * qx
    else:
        t = (vx * px + vy * py + vz * pz) / along
        nx, ny, nz = vx - t * px, vy - t * py, vz - t * pz
    along = nx * vx + ny * vy + nz * vz
    if along > 0.0:
        ux, uy, uz = nx, ny, nz
    elif along < 0.0:
        ux, uy, uz = -nx, -ny, -nz
"""
"""v, and the next direction u: v itself, or the normal of its edge or face, which is more accurate than v."""

_STEPS: Final = {
    "place": (1, _PLACE),
    "middles": (1, _MIDDLES),
    "choose": (2, _CHOOSE),
    "edges": (2, _EDGES),
    "support": (3, _SUPPORT),
    "inside": (4, INSIDE),
    "features": (4, FEATURES),
    "direction": (3, DIRECTION),
    "slopes": (3, SLOPES),
}

_FRAME = """\
NODE, STATE, PAIR, SLIDE, EDGES = {node}, {state}, {pair}, {slide}, 28
CLEARANCES, GRADIENTS, SMALLEST, ACROSS, HEIGHT = 1, 2, 3, 1.0, 2.0
n, mode, angle_count, angles = np.int64(s[0]), np.int64(s[1]), np.int64(s[2]), np.int64(s[3])
node_count, nodes, pair_count, pairs = np.int64(s[4]), np.int64(s[5]), np.int64(s[6]), np.int64(s[7])
work, trig, state, middles = np.int64(s[8]), np.int64(s[9]), np.int64(s[10]), np.int64(s[15])
agree, rounds, known, nothing, flat, less, sharp = s[11], np.int64(s[12]), s[13], s[14], s[16], s[17], s[19]
shares, tried, vertices, e, f = work + 12, work + 16, work + 20, work + EDGES, work + EDGES + 9
is_smallest, writes_index = mode == SMALLEST, s[18] != 0.0
width = n if mode == GRADIENTS else 1
irregular = 0
for r in range(count):
    here, is_regular = r * n, True
    {place}
    {middles}
    if not is_regular:
        irregular += 1
        for k in range(1 if is_smallest else pair_count * width):
            out[r * row + k * column] = math.nan
        if writes_index:
            index[r] = -1
        continue
    least, which, chosen = math.inf, -1, 0
    while True:
        {choose}
        p = pairs + PAIR * k
        {edges}
        wx, wy, wz = s[middles + 4 * k], s[middles + 4 * k + 1], s[middles + 4 * k + 2]
        a_turn, b_turn = np.int64(s[p + 7]), np.int64(s[p + 17])
        a_at, a_count, a_last = np.int64(s[p + 27]), np.int64(s[p + 28]), np.int64(s[p + 38]) - 1
        b_at, b_count, b_last = np.int64(s[p + 29]), np.int64(s[p + 30]), np.int64(s[p + 39]) - 1
        cut = least + s[p + 31]
        ux, uy, uz, is_across = wx, wy, wz, s[p + 40] == ACROSS
        if is_across:
            ux = s[p + 41] * wx + s[p + 42] * wy + s[p + 43] * wz
            uy = s[p + 44] * wx + s[p + 45] * wy + s[p + 46] * wz
            uz = s[p + 47] * wx + s[p + 48] * wy + s[p + 49] * wz
        length = math.sqrt(ux * ux + uy * uy + uz * uz)
        scale, left = length + s[p + 32], rounds
        if not length > 0.0:
            ux, uy, uz = s[p + 41], s[p + 44], s[p + 47]
            if not is_across:
                ux = 1.0
        used, bound, square, is_height = 0, 0.0, math.inf, s[p + 40] == HEIGHT
        if is_height:
            ux, uy, uz, bound = s[p + 41], s[p + 42], s[p + 43], -math.inf
        while True:
            {support}
            if is_height:
                s[vertices + 6], s[vertices + 7], s[shares + 3] = a, b, 1.0
                length, used = low, 8
                break
            if bound > cut or (used != 0 and length - bound <= agree * scale) or left == 0:
                break
            left -= 1
            slot, is_new = 3, True
            for i in range(4):
                if not used & (1 << i):
                    slot = i
                elif s[vertices + 2 * i] == a and s[vertices + 2 * i + 1] == b:
                    is_new = False
            if not is_new:
                break
            s[work + 3 * slot], s[work + 3 * slot + 1], s[work + 3 * slot + 2] = x, y, z
            s[vertices + 2 * slot], s[vertices + 2 * slot + 1] = a, b
            before, used = used, used | 1 << slot
            if used == 15:
                is_inside = True
                {inside}
                if is_inside:
                    length, bound = 0.0, 0.0
                    break
            best, must = square, 1 << slot
            for again in range(2):
                {features}
                if best < square * (1.0 - agree):
                    break
                must = 15
            if not best < square:
                used = before
                break
            {direction}
            if length <= nothing * scale:
                length, bound = 0.0, 0.0
                break
        if is_smallest:
            clearance = length - s[p + 31]
            if bound <= cut and (clearance < least or (clearance == least and k < which)):
                least, which = clearance, k
        elif mode == GRADIENTS:
            to = r * row + k * n * column
            for j in range(n):
                out[to + j * column] = 0.0 if length > 0.0 or is_height else math.nan
            if not (length > 0.0 or is_height):
                continue
            {slopes}
        else:
            out[r * row + k * column] = length - s[p + 31] if mode == CLEARANCES else length
    if is_smallest:
        out[r * row] = least
        if writes_index:
            index[r] = which
return irregular
"""

_KERNEL = '''"""Generated by pinbound; do not edit."""

from numba import cfunc, types

from pinbound.machine.functions import whole_function

REALS, INTEGER, INTEGERS = types.CPointer(types.float64), types.int64, types.CPointer(types.int64)
body = whole_function("""\\
{text}""")


@cfunc(
    INTEGER(REALS, REALS, INTEGER, INTEGER, INTEGERS, REALS, INTEGER),
    error_model="numpy", fastmath={{"contract"}}, boundscheck=False, debug=False,
)
def kernel(Q, out, row, column, index, s, count):
    return body(Q, out, row, column, index, s, count)
'''
