"""The source texts for many spheres on few links, for lanes of configurations: one for all robots, which reads tables.

All data of a set are in one array, which `kernel/balls.py` writes: numbers, and integers of 32 bits. So the code is
compiled once on a machine, in a second, and its length does not grow with the number of pairs. A block has as many
configurations as there are lanes. `docs/kernel.md` derives the method, and the error bounds of float32.
"""

from __future__ import annotations

import ast
import re
from functools import cache
from textwrap import indent
from typing import Final

from pinbound.machine.ball_free_source import (
    COLUMNS_FREE,
    FRAME_FREE,
    FREE,
    GROUPS_FREE,
    SINGLE_SINCOS,
    TILE,
    TURNED_BY,
    UNSORTED,
    WORK_FREE,
)
from pinbound.machine.compiled import KernelSource
from pinbound.machine.sincos import SINCOS

__all__ = ["CLUSTERS", "GROUP", "HEAD", "NODE", "WINDOW", "ball_source"]

HEAD: Final = (
    "n", "angle_count", "angles", "slots", "factors", "shelf", "most", "lower", "upper", "trig",
    "node_count", "nodes", "steps", "slides", "ways", "state", "set_count", "sets", "locals", "spots", "stamps",
    "body_count", "group_count", "groups", "far", "pairs_far", "clusters", "rows", "entries", "squares", "less",
    "numbers", "pair_count", "pairs", "bounds", "spare", "with_index", "single_state", "slack", "hosts", "exact",
    "turned", "walks", "slopes", "first", "second", "first_bins", "second_bins", "keys", "order", "rows_of",
    "chosen_bin", "counts", "near_groups", "near_clusters", "bounded", "turned_by", "windows",
)  # fmt: skip
"""Integers at the head, in this order; positions are counted in numbers of their kind."""

NODE: Final = 7
"""Integers of a node: the one above, its angle or -1, the column that stays or -1, the next, the one after, slides."""

GROUP: Final = 7
"""Integers of a group: middles of two bodies, first and last pair of clusters, sets of both bodies' clusters, window.

A window (`WINDOW`) says in which cells of one or two angles each pair of clusters may meet; 0: there is none."""

WINDOW: Final = 6
"""Integers of a window: two angles, their numbers of cells, position of the bytes of all cells, and positions of the
middle, half-width, cells per radian and last cell of each angle.

Bit i of a byte stands for the pairs of clusters i, i + 8, ... of the group."""

CLUSTERS: Final = 6
"""Integers of a pair of clusters: two middles, first and last row, the sets of both clusters' balls."""

_PLACE = """\
{columns}
for j in range(angle_count):
    theta = every(0.0)
    for i in range(k[angles + 2 * j], k[angles + 2 * j + 1]):
        theta = theta + w[factors + i] * wide(w, shelf + L * k[slots + i])
    {angle}
    {sincos}
    V[trig + 2 * L * j] = cosine
    V[trig + 2 * L * j + L] = sine
for i in range(1, node_count):
    at, c = nodes + NODE * i, steps + 6 * i
    up, to = state + 12 * L * k[at], state + 12 * L * i
    angle, kept = k[at + 1], k[at + 2]
    bx, by, bz = fill(V[c]), fill(V[c + 1]), fill(V[c + 2])
    for j in range(k[at + 5], k[at + 6]):
        along = turned(wide(w, shelf + L * k[slides + j]))
        bx, by, bz = bx + along * V[ways + 3 * j], by + along * V[ways + 3 * j + 1], bz + along * V[ways + 3 * j + 2]
    for r in range(3):
        from_, into = up + 4 * L * r, to + 4 * L * r
        px = wide(V, from_ + 3 * L) + bx * wide(V, from_) + by * wide(V, from_ + L) + bz * wide(V, from_ + 2 * L)
        V[into + 3 * L] = px
    if angle < 0:
        for r in range(3):
            for j in range(3):
                V[to + 4 * L * r + L * j] = wide(V, up + 4 * L * r + L * j)
        continue
    cos, sin = wide(V, trig + 2 * L * angle), wide(V, trig + 2 * L * angle + L)
    if kept >= 0:
        sin = sin * V[c + 3]
        for r in range(3):
            from_, into = up + 4 * L * r, to + 4 * L * r
            u, v = wide(V, from_ + k[at + 3]), wide(V, from_ + k[at + 4])
            V[into + kept] = wide(V, from_ + kept)
            V[into + k[at + 3]] = u * cos + v * sin
            V[into + k[at + 4]] = v * cos - u * sin
        continue
    x, y, z, rest = fill(V[c + 3]), fill(V[c + 4]), fill(V[c + 5]), 1.0 - cos
    xy, yz, zx, sx, sy, sz = x * y * rest, y * z * rest, z * x * rest, x * sin, y * sin, z * sin
    xx, yy, zz = x * x * rest + cos, y * y * rest + cos, z * z * rest + cos
    for r in range(3):
        from_, into = up + 4 * L * r, to + 4 * L * r
        ax, ay, az = wide(V, from_), wide(V, from_ + L), wide(V, from_ + 2 * L)
        V[into] = ax * xx + ay * (xy + sz) + az * (zx - sy)
        V[into + L] = ax * (xy - sz) + ay * yy + az * (yz + sx)
        V[into + 2 * L] = ax * (zx + sy) + ay * (yz - sx) + az * zz
"""
"""Columns of q, sines of each angle once, and rotation and position of each node."""

_COLUMNS = """\
good = every(True)
for j in range(n):
    column_ = gather(Q, start * n + j, n)
    w[shelf + L * j] = column_
    good = good & (column_ * column_ <= w[most + j])
"""

_SINGLE_STATE = """\
for i in range(12 * node_count):
    t[single_state + L * i] = single(wide(w, state + L * i))
"""
"""The nodes in float32."""

_SPOTS = """\
node = STATE + 12 * L * k[sets + 3 * chosen]
xx, xy, xz, xp = wide(V, node), wide(V, node + L), wide(V, node + 2 * L), wide(V, node + 3 * L)
yx, yy, yz, yp = wide(V, node + 4 * L), wide(V, node + 5 * L), wide(V, node + 6 * L), wide(V, node + 7 * L)
zx, zy, zz, zp = wide(V, node + 8 * L), wide(V, node + 9 * L), wide(V, node + 10 * L), wide(V, node + 11 * L)
for i in range(k[sets + 3 * chosen + 1], k[sets + 3 * chosen + 2]):
    c, to = locals + 3 * i, spots + 4 * L * i
    px = xp + xx * V[c] + xy * V[c + 1] + xz * V[c + 2]
    py = yp + yx * V[c] + yy * V[c + 1] + yz * V[c + 2]
    pz = zp + zx * V[c] + zy * V[c + 1] + zz * V[c + 2]
    V[to] = px
    V[to + L] = py
    V[to + 2 * L] = pz
    V[to + 3 * L] = px * px + py * py + pz * pz
"""
"""The points of one set, which are fixed to one node, and their squared lengths."""

_ENSURE = """\
for side in range(2):
    chosen = k[at + 4 + side]
    if k[stamps + chosen] != stamp:
        k[stamps + chosen] = stamp
        {spots}
"""
"""Both sets of a pair, if they are not placed yet in this block."""

_SQUARE = """\
dx, dy, dz = wide(V, a) - wide(V, b), wide(V, a + L) - wide(V, b + L), wide(V, a + 2 * L) - wide(V, b + 2 * L)
d = dx * dx + dy * dy + dz * dz
"""

_GROUPS = """\
stamp += 1
for chosen in range(body_count):
    {spots}
for g in range(group_count):
    at = groups + GROUP * g
    a, b = spots + 4 * L * k[at], spots + 4 * L * k[at + 1]
    {square}
    {skip_group}
    {ensure}
    for c in range(k[at + 2], k[at + 3]):
        at = clusters + CLUSTERS * c
        a, b = spots + 4 * L * k[at], spots + 4 * L * k[at + 1]
        {square_of_clusters}
        {skip_clusters}
        {clusters}
"""

_PAIR_OF_CLUSTERS = """\
{ensure}
for r in range(k[at + 2], k[at + 3]):
    a, b = k[rows + 4 * r], k[rows + 4 * r + 1]
    ax, ay, az = wide(V, a) * -2.0, wide(V, a + L) * -2.0, wide(V, a + 2 * L) * -2.0
    line = single(math.inf)
    for e in range(k[rows + 4 * r + 2], k[rows + 4 * r + 3]):
        {pair}
        line = pick(d < line, d, line)
        b += 4 * L
    {row}
"""
"""A row has one ball and several others; with `|a - b|^2 = |a|^2 + (|b|^2 - 2 a . b)` a pair costs three products."""

_CANDIDATE = """\
s = top + V[squares + e]
d = wide(V, b + 3 * L) - s * s + ax * wide(V, b) + ay * wide(V, b + L) + az * wide(V, b + 2 * L)
"""
"""If it is below `-|a|^2` plus the error of float32, the pair may be nearer than all pairs before."""

_EXACT = """\
if any(line + wide(V, a + 3 * L) < V[slack]):
    b = k[rows + 4 * r + 1]
    for e in range(k[rows + 4 * r + 2], k[rows + 4 * r + 3]):
        {candidate}
        if any(d + wide(V, a + 3 * L) < V[slack]):
            x, y, z = every(0.0), every(0.0), every(0.0)
            for side in range(2):
                point, sign = ((a if side == 0 else b) - spots) // (4 * L), 1.0 - 2.0 * side
                h, c = state + 12 * L * k[hosts + point], exact + 3 * point
                ux, uy, uz, up = wide(w, h), wide(w, h + L), wide(w, h + 2 * L), wide(w, h + 3 * L)
                x = x + sign * (up + ux * w[c] + uy * w[c + 1] + uz * w[c + 2])
                ux, uy, uz, up = wide(w, h + 4 * L), wide(w, h + 5 * L), wide(w, h + 6 * L), wide(w, h + 7 * L)
                y = y + sign * (up + ux * w[c] + uy * w[c + 1] + uz * w[c + 2])
                ux, uy, uz, up = wide(w, h + 8 * L), wide(w, h + 9 * L), wide(w, h + 10 * L), wide(w, h + 11 * L)
                z = z + sign * (up + ux * w[c] + uy * w[c + 1] + uz * w[c + 2])
            gap = sqrt(x * x + y * y + z * z) - w[less + e]
            near = gap < best
            best, which = pick(near, gap, best), pick(near, every(w[numbers + e]), which)
            top = single(best)
        b += 4 * L
"""
"""In a row that may be nearer, the pairs that may be are computed again in float64."""

_LEAST = {
    "skip_group": "s = top + V[far + g]\nif not any(d <= s * s):\n    continue",
    "skip_clusters": "s = top + V[pairs_far + c]\nif not any(d <= s * s):\n    continue",
    "pair": _CANDIDATE,
}

_FRAME = """\
NODE, GROUP, CLUSTERS, L = {node}, {group}, {cluster}, {lanes}
{head}
irregular, start, stamp = 0, 0, 0
for chosen in range(set_count):
    k[stamps + chosen] = 0
while start < count:
    {place}
    {work}
    start += L
return irregular
"""

_WORK_LEAST = """\
best, which, top = every(math.inf), every(-1.0), single(math.inf)
{state}
{groups}
w[spare] = best
w[spare + L] = which
if any(best * best <= w[bounds]) or any(not good):
    irregular += 1
for i in range(L):
    out[(start + i) * row] = w[spare + i]
if with_index:
    for i in range(L):
        index[start + i] = np.int64(w[spare + L + i])
"""

_WORK_ALL = """\
best = every(math.inf)
for chosen in range(body_count, set_count):
    {spots}
for p in range(pair_count):
    a, b = k[pairs + 2 * p], k[pairs + 2 * p + 1]
    {square}
    d = sqrt(d) - V[less + p]
    best = pick(d * d < best, d * d, best)
    if row == 1:
        out[start + p * column] = d
    else:
        w[spare] = d
        for i in range(L):
            out[(start + i) * row + p * column] = w[spare + i]
if any(best <= w[bounds]) or any(not good):
    irregular += 1
"""


_WORK_SLOPES = """\
for chosen in range(body_count, set_count):
    {spots}
for i in range(1, node_count):
    at, up, to = steps + 6 * i, state + 12 * L * i, turned + 3 * L * i
    kept = k[nodes + NODE * i + 2]
    for r in range(3):
        from_ = up + 4 * L * r
        if kept >= 0:
            w[to + L * r] = wide(w, from_ + kept) * w[at + 3]
        else:
            ux, uy, uz = wide(w, from_), wide(w, from_ + L), wide(w, from_ + 2 * L)
            w[to + L * r] = ux * w[at + 3] + uy * w[at + 4] + uz * w[at + 5]
for p in range(pair_count):
    a, b = k[pairs + 2 * p], k[pairs + 2 * p + 1]
    {square}
    d = 1.0 / sqrt(d)
    x, y, z = dx * d, dy * d, dz * d
    for j in range(n):
        w[slopes + L * j] = d * 0.0
    for side in range(2):
        point, sign = (a if side == 0 else b), 1.0 - 2.0 * side
        for e in range(k[walks + 2 * p + side], k[walks + 2 * p + side + 1]):
            i = k[walks + e]
            at, up, to = nodes + NODE * i, state + 12 * L * i, turned + 3 * L * i
            if k[at + 1] >= 0:
                ux, uy = wide(w, point) - wide(w, up + 3 * L), wide(w, point + L) - wide(w, up + 7 * L)
                uz = wide(w, point + 2 * L) - wide(w, up + 11 * L)
                vx, vy, vz = wide(w, to), wide(w, to + L), wide(w, to + 2 * L)
                g = sign * (x * (vy * uz - vz * uy) + y * (vz * ux - vx * uz) + z * (vx * uy - vy * ux))
                for j in range(k[angles + 2 * k[at + 1]], k[angles + 2 * k[at + 1] + 1]):
                    c = slopes + L * k[slots + j]
                    w[c] = wide(w, c) + w[factors + j] * g
            up = state + 12 * L * k[at]
            for j in range(k[at + 5], k[at + 6]):
                ux, uy, uz = w[ways + 3 * j], w[ways + 3 * j + 1], w[ways + 3 * j + 2]
                g = x * (wide(w, up) * ux + wide(w, up + L) * uy + wide(w, up + 2 * L) * uz)
                g = g + y * (wide(w, up + 4 * L) * ux + wide(w, up + 5 * L) * uy + wide(w, up + 6 * L) * uz)
                g = g + z * (wide(w, up + 8 * L) * ux + wide(w, up + 9 * L) * uy + wide(w, up + 10 * L) * uz)
                c = slopes + L * k[slides + j]
                w[c] = wide(w, c) + sign * g
    for j in range(n):
        for i in range(L):
            out[(start + i) * row + (p * n + j) * column] = w[slopes + L * j + i]
if any(not good):
    irregular += 1
"""
"""`d|r| / dq_j = u . (W a x (x - P)) c_j` for each rotation above only one of the balls, and prismatic
displacements."""


def _filled(text: str, **parts: tuple[int, str]) -> str:
    """Fill in the parts of a text, each indented by its depth."""
    return text.format(**{name: indent(part, "    " * depth).strip() for name, (depth, part) in parts.items()})


@cache
def ball_source(mode: str, lanes: int) -> KernelSource:
    """Return the source; it has the prototype of all kernels, with its tables in place of scratch.

    Args:
        mode: ``"free"``: in float32, which rows are free (1), are not (0), or may be (2), as bytes of `index`.
            ``"least"``: the smallest clearance and its pair; ``"all"``: every clearance; ``"slopes"``: each gradient.
            These three in float64.
        lanes: Number of configurations in one block.
    """
    is_free = mode == "free"
    sincos = _apart(SINGLE_SINCOS if is_free else SINCOS.format(x="theta"))
    columns = COLUMNS_FREE if is_free else _COLUMNS
    angle = TURNED_BY if is_free else ""
    place = _viewed(_apart(_filled(_PLACE, sincos=(1, sincos), columns=(0, columns), angle=(1, angle))), is_free)
    if mode in ("all", "slopes"):
        work = _WORK_ALL if mode == "all" else _WORK_SLOPES
        work = _viewed(_filled(work, spots=(1, _SPOTS), square=(1, _SQUARE)).replace("STATE", "state"), False)
    else:
        words = dict(FREE if is_free else _LEAST)
        if not is_free:
            words["row"] = _filled(_EXACT, candidate=(2, _CANDIDATE))
        ensure = _filled(_ENSURE, spots=(2, _SPOTS))
        pair = _filled(_PAIR_OF_CLUSTERS, ensure=(0, ensure), pair=(2, words["pair"]), row=(1, words["row"]))
        parts = {"spots": (1, _SPOTS), "square": (1, _SQUARE), "ensure": (1, ensure), "clusters": (2, pair)}
        parts["square_of_clusters"] = (2, _SQUARE)
        if not is_free:
            parts |= {"skip_group": (1, words["skip_group"]), "skip_clusters": (2, words["skip_clusters"])}
        groups = _filled(GROUPS_FREE if is_free else _GROUPS, **parts)
        frame = WORK_FREE if is_free else _WORK_LEAST.replace("{state}", _SINGLE_STATE.strip())
        work = _viewed(frame.format(groups=groups.strip()), True).replace(
            "STATE", "state" if is_free else "single_state"
        )
    head = "\n".join(f"{name} = k[{place}]" for place, name in enumerate(HEAD))
    numbers = _numbers(lanes)
    if is_free:
        numbers |= {"window": (0, str(WINDOW)), "tile": (0, str(TILE)), "unsorted": (0, str(UNSORTED))}
    depth = 2 if is_free else 1
    text = _filled(
        FRAME_FREE if is_free else _FRAME, head=(0, head), place=(depth, place), work=(depth, work), **numbers
    )
    return KernelSource(text, 0, lanes, mode == "slopes")  # which unrolled takes 0.8 of its time, the others all of it


def _viewed(text: str, is_single: bool) -> str:
    """Return a text with numbers of float32, or float64."""
    view, fill, turned = ("t", "single(", "single(") if is_single else ("w", "every(", "(")
    return text.replace("V[", f"{view}[").replace("(V,", f"({view},").replace("fill(", fill).replace("turned(", turned)


def _apart(text: str) -> str:
    """Return a text whose names, except those of its results, are used by no other: they end with an underscore."""
    stored = [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Name)]
    names = {node.id for node in stored if isinstance(node.ctx, ast.Store)} - {
        "sine",
        "cosine",
        "good",
        "outside",
        "far_off",
    }
    return re.sub(r"\b[a-z_]+\b", lambda word: f"{word[0]}_" if word[0] in names else word[0], text)


def _numbers(lanes: int) -> dict[str, tuple[int, str]]:
    return {
        "node": (0, str(NODE)),
        "group": (0, str(GROUP)),
        "cluster": (0, str(CLUSTERS)),
        "lanes": (0, str(lanes)),
    }
