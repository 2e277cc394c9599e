"""Machine code of the search for nearest corners: of `minimum_norm.nearest_corners`, and of hulls with their vertices.

It does the steps of `gjk.search` row by row and in the same order; only sums may be rounded differently. It uses the
same compiler and cache as all other machine code (`compiled`); the number of edge vectors is a constant of its text.
The two searches differ in how they find the corner that is furthest against a direction: by the sign of each edge
vector, or as the least of a table of vertices.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pinbound.machine.compiled import KernelSource, MachineCode, compile_source, is_kept
from pinbound.typing import Array

__all__ = ["is_ready", "search", "search_vertices"]


def search(w: Array, edges: Array, agree: float, rounds: int, inside: float) -> tuple[Array, Array]:
    """Return t (N, k) and the bound (N,) as `nearest_corners` does; a row that is not finite gives NaN.

    Args:
        w: (N, 3).
        edges: (k, N, 3).
        agree: The largest difference of both bounds at the end, relative to the furthest corner.
        rounds: The largest number of corners to search for.
        inside: How near the point of four corners must be to the origin to count as containing it, relative to the
            corners.
    """
    k, count = len(edges), len(w)
    rows = np.empty((count, 3 * (k + 1)))
    rows[:, :3] = w
    rows[:, 3:] = np.moveaxis(edges, 0, 1).reshape(count, 3 * k)
    out = np.empty((count, k + 1))
    _code(k, agree, rounds, inside)(rows, out, _NO_INDEX)
    return out[:, :k], out[:, k]


def search_vertices(
    w: Array, edges: Array, start: Array, scale: Array, tables: Array, bodies: Array, limits: tuple[float, int, float]
) -> tuple[Array, Array]:
    """Return t (N, 6) and the bound (N,) as `gjk.search` does, for t over the product of two hulls of vertices.

    Args:
        w: (N, 3).
        edges: (N, 6, 3): three of the first body, three of the second; zero where it has fewer.
        start: (N, 3), the first search direction.
        scale: (N,), the lengths that rounding is relative to.
        tables: (V, 3), the vertices of all bodies as coefficients of their three edge vectors.
        bodies: (N, 4), first vertex and number of vertices of either body; the number is 0 for a point.
        limits: The largest difference of both bounds, the largest number of rounds, and `inside` (see `search`).
    """
    rows = np.hstack((w, edges.reshape(len(w), 18), start, scale[:, None], bodies))
    out = np.empty((len(w), 7))
    code = _code(0, *limits)
    scratch = np.empty(code.scratch // 8 + tables.size)
    scratch[code.scratch // 8 :] = tables.ravel()
    addresses = [array.__array_interface__["data"][0] for array in (rows, out, _NO_INDEX, scratch)]
    code.function(*addresses[:2], 7, 1, *addresses[2:], len(w))
    return out[:, :6], out[:, 6]


_NO_INDEX: NDArray[Any] = np.empty(0, dtype=np.int64)


@cache
def is_ready(k: int, agree: float, rounds: int, inside: float) -> bool:
    """Return whether the code for k edge vectors is ready without compiling; checked once."""
    return is_kept(_source(k, agree, rounds, inside))


@cache
def _code(k: int, agree: float, rounds: int, inside: float) -> MachineCode:
    return compile_source(_source(k, agree, rounds, inside))


def _source(k: int, agree: float, rounds: int, inside: float) -> KernelSource:
    """Return the source for k edge vectors, t in [0, 1]; for none, that of hulls: vertices are behind the scratch."""
    edges, width, start, support = (k, 3 * (k + 1), _FROM_EDGES, _BY_SIGN) if k else (6, 29, _FROM_ROW, _BY_TABLE)
    scratch = 12 + 4 * edges + edges + 8  # points, their t, the new one's, and weights twice
    text = _TEXT.format(
        k=edges, agree=agree, rounds=rounds, inside=inside, width=width, start=start, support=support, tables=scratch
    )
    return KernelSource(text, 8 * scratch)


_FROM_EDGES = """\
        vx, vy, vz = wx, wy, wz
        scale = math.sqrt(wx * wx + wy * wy + wz * wz)
        for j in range(K):
            e = base + 3 * (j + 1)
            vx += 0.5 * Q[e]
            vy += 0.5 * Q[e + 1]
            vz += 0.5 * Q[e + 2]
            scale += math.sqrt(Q[e] * Q[e] + Q[e + 1] * Q[e + 1] + Q[e + 2] * Q[e + 2])
"""

_FROM_ROW = """\
        vx, vy, vz, scale = Q[base + 21], Q[base + 22], Q[base + 23], Q[base + 24]
"""

_BY_SIGN = """\
            for j in range(K):
                e = base + 3 * (j + 1)
                s[NEW + j] = 0.0
                if Q[e] * vx + Q[e + 1] * vy + Q[e + 2] * vz < 0.0:
                    s[NEW + j] = 1.0
                    x += Q[e]
                    y += Q[e + 1]
                    z += Q[e + 2]
"""

_BY_TABLE = """\
            for side in range(2):
                first, many = np.int64(Q[base + 25 + 2 * side]), np.int64(Q[base + 26 + 2 * side])
                e, first = base + 3 + 9 * side, TABLES + 3 * first
                along_x = Q[e] * vx + Q[e + 1] * vy + Q[e + 2] * vz
                along_y = Q[e + 3] * vx + Q[e + 4] * vy + Q[e + 5] * vz
                along_z = Q[e + 6] * vx + Q[e + 7] * vy + Q[e + 8] * vz
                lowest, chosen = math.inf, first
                for c in range(many):
                    height = along_x * s[first] + along_y * s[first + 1] + along_z * s[first + 2]
                    if height < lowest:
                        lowest, chosen = height, first
                    first += 3
                for j in range(3):
                    share = 0.0
                    if many > 0:
                        share = s[chosen + j]
                    s[NEW + 3 * side + j] = share
                    x += share * Q[e + 3 * j]
                    y += share * Q[e + 3 * j + 1]
                    z += share * Q[e + 3 * j + 2]
"""

_TEXT = '''"""Generated by pinbound; do not edit."""

import math

import numpy as np
from numba import cfunc, types

K, AGREE, ROUNDS, INSIDE, WIDTH, TABLES = {k}, {agree!r}, {rounds}, {inside!r}, {width}, {tables}
POINTS, CORNERS, NEW, WEIGHTS, BEST = 0, 12, 12 + 4 * K, 12 + 5 * K, 16 + 5 * K
REALS, INTEGER, INTEGERS = types.CPointer(types.float64), types.int64, types.CPointer(types.int64)


@cfunc(
    INTEGER(REALS, REALS, INTEGER, INTEGER, INTEGERS, REALS, INTEGER),
    error_model="numpy", fastmath={{"contract"}}, boundscheck=False, debug=False,
)
def kernel(Q, out, row, column, index, s, count):
    irregular = 0
    for i in range(count):
        base = i * WIDTH
        wx, wy, wz = Q[base], Q[base + 1], Q[base + 2]
{start}\
        for j in range(K):
            out[i * row + j * column] = 0.0
        if not scale < math.inf:
            out[i * row + K * column] = math.nan
            irregular += 1
            continue
        bound, used, searching, shortest = 0.0, 0, ROUNDS, math.inf
        while searching > 0:
            searching -= 1
            x, y, z = wx, wy, wz
{support}\
            length = math.sqrt(vx * vx + vy * vy + vz * vz)
            below = 0.0
            if length > 0.0:
                below = (x * vx + y * vy + z * vz) / length
            if below > bound:
                bound = below
            known = False
            if used != 0:
                known = length <= AGREE * scale or length - below <= AGREE * scale or length >= shortest * (1.0 - AGREE)
                shortest = length
            slot = 4
            for c in range(4):
                if used & (1 << c):
                    same = True
                    for j in range(K):
                        if s[CORNERS + c * K + j] != s[NEW + j]:
                            same = False
                    if same:
                        known = True
                elif slot == 4:
                    slot = c
            if known or slot == 4:
                break
            s[POINTS + 3 * slot], s[POINTS + 3 * slot + 1], s[POINTS + 3 * slot + 2] = x, y, z
            for j in range(K):
                s[CORNERS + slot * K + j] = s[NEW + j]
            used |= 1 << slot
            best = math.inf
            for a in range(4):
                if not used & (1 << a):
                    continue
                ax, ay, az = s[POINTS + 3 * a], s[POINTS + 3 * a + 1], s[POINTS + 3 * a + 2]
                square = ax * ax + ay * ay + az * az
                if square < best:
                    best = square
                    for c in range(4):
                        s[BEST + c] = 0.0
                    s[BEST + a] = 1.0
                for b in range(a + 1, 4):
                    if not used & (1 << b):
                        continue
                    bx, by, bz = s[POINTS + 3 * b], s[POINTS + 3 * b + 1], s[POINTS + 3 * b + 2]
                    ux, uy, uz = bx - ax, by - ay, bz - az
                    size = ux * ux + uy * uy + uz * uz
                    if size > 0.0:
                        t = -(ax * ux + ay * uy + az * uz) / size
                        if t >= 0.0 and t <= 1.0:
                            rx, ry, rz = (1.0 - t) * ax + t * bx, (1.0 - t) * ay + t * by, (1.0 - t) * az + t * bz
                            square = rx * rx + ry * ry + rz * rz
                            if square < best:
                                best = square
                                for c in range(4):
                                    s[BEST + c] = 0.0
                                s[BEST + a] = 1.0 - t
                                s[BEST + b] = t
                    for c in range(b + 1, 4):
                        if not used & (1 << c):
                            continue
                        cx, cy, cz = s[POINTS + 3 * c], s[POINTS + 3 * c + 1], s[POINTS + 3 * c + 2]
                        px, py, pz = cx - ax, cy - ay, cz - az
                        nx, ny, nz = uy * pz - uz * py, uz * px - ux * pz, ux * py - uy * px
                        fa = nx * (by * cz - bz * cy) + ny * (bz * cx - bx * cz) + nz * (bx * cy - by * cx)
                        fb = nx * (cy * az - cz * ay) + ny * (cz * ax - cx * az) + nz * (cx * ay - cy * ax)
                        fc = nx * (ay * bz - az * by) + ny * (az * bx - ax * bz) + nz * (ax * by - ay * bx)
                        size = fa + fb + fc
                        if not size > 0.0:
                            continue
                        fa, fb, fc = fa / size, fb / size, fc / size
                        if fa >= 0.0 and fb >= 0.0 and fc >= 0.0:
                            rx = fa * ax + fb * bx + fc * cx
                            ry = fa * ay + fb * by + fc * cy
                            rz = fa * az + fb * bz + fc * cz
                            square = rx * rx + ry * ry + rz * rz
                            if square < best:
                                best = square
                                for d in range(4):
                                    s[BEST + d] = 0.0
                                s[BEST + a], s[BEST + b], s[BEST + c] = fa, fb, fc
            deep = 0.0
            if used == 15:
                total, depth = 0.0, math.inf
                for a in range(4):
                    b, c, d = (a + 1) & 3, (a + 2) & 3, (a + 3) & 3
                    bx, by, bz = s[POINTS + 3 * b], s[POINTS + 3 * b + 1], s[POINTS + 3 * b + 2]
                    cx, cy, cz = s[POINTS + 3 * c], s[POINTS + 3 * c + 1], s[POINTS + 3 * c + 2]
                    dx, dy, dz = s[POINTS + 3 * d], s[POINTS + 3 * d + 1], s[POINTS + 3 * d + 2]
                    volume = bx * (cy * dz - cz * dy) + by * (cz * dx - cx * dz) + bz * (cx * dy - cy * dx)
                    if a & 1:
                        volume = -volume
                    ux, uy, uz, px, py, pz = cx - bx, cy - by, cz - bz, dx - bx, dy - by, dz - bz
                    nx, ny, nz = uy * pz - uz * py, uz * px - ux * pz, ux * py - uy * px
                    area = math.sqrt(nx * nx + ny * ny + nz * nz)
                    away = 0.0
                    if area > 0.0:
                        away = abs(volume) / area
                    if away < depth:
                        depth = away
                    s[WEIGHTS + a] = volume
                    total += volume
                inside = abs(total) > 0.0 and depth > 0.0
                rx, ry, rz, far = 0.0, 0.0, 0.0, 0.0
                for a in range(4):
                    share = s[WEIGHTS + a] / total
                    if not share > 0.0:
                        inside = False
                    ax, ay, az = s[POINTS + 3 * a], s[POINTS + 3 * a + 1], s[POINTS + 3 * a + 2]
                    rx += share * ax
                    ry += share * ay
                    rz += share * az
                    size = ax * ax + ay * ay + az * az
                    if size > far:
                        far = size
                if not math.sqrt(rx * rx + ry * ry + rz * rz) <= INSIDE * math.sqrt(far):
                    inside = False
                if inside:
                    deep = depth
                    for a in range(4):
                        s[BEST + a] = s[WEIGHTS + a] / total
            used, vx, vy, vz = 0, 0.0, 0.0, 0.0
            for j in range(K):
                out[i * row + j * column] = 0.0
            for a in range(4):
                share = s[BEST + a]
                if share > 0.0:
                    used |= 1 << a
                    vx += share * s[POINTS + 3 * a]
                    vy += share * s[POINTS + 3 * a + 1]
                    vz += share * s[POINTS + 3 * a + 2]
                    for j in range(K):
                        out[i * row + j * column] += share * s[CORNERS + a * K + j]
            if deep > 0.0:
                bound = -deep
                searching = 0
        out[i * row + K * column] = bound
    return irregular
'''
