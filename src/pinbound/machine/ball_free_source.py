"""The source texts of `free` for many spheres, which `ball_source` combines, with lanes in float32."""

from __future__ import annotations

from typing import Final

__all__ = [
    "COLUMNS_FREE",
    "FRAME_FREE",
    "FREE",
    "GROUPS_FREE",
    "SINGLE_SINCOS",
    "TILE",
    "TURNED_BY",
    "UNSORTED",
    "WORK_FREE",
]

TILE: Final = 4096
"""Rows that `free` sorts at a time, so that their coordinates fit L2."""

UNSORTED: Final = 256
"""Largest number of rows for which sorting costs more than it saves."""

TURNED_BY = """\
m = theta * 0.15915494309189535 + 6755399441055744.0
t[turned_by + L * j] = single(theta - (m - 6755399441055744.0) * 6.283185307179586)
"""
"""An angle reduced to one turn, for the lookup in windows."""

SINGLE_SINCOS = """\
m = theta * 0.6366197723675814 + 6755399441055744.0
m = m - 6755399441055744.0
r = single((theta - m * 1.5707963267341256) - m * 6.077100506303966e-11)
turns = single(m)
z = r * r
a = r + r * z * (-1.6666654611e-1 + z * (8.3321608736e-3 + z * -1.9515295891e-4))
b = 1.0 - 0.5 * z + z * z * (4.166664568298827e-2 + z * (-1.388731625493765e-3 + z * 2.443315711809948e-5))
h = (turns * 0.5 - 0.25 + 12582912.0) - 12582912.0
odd = turns - 2.0 * h
g = (h * 0.5 - 0.25 + 12582912.0) - 12582912.0
sign = 1.0 - 2.0 * (h - 2.0 * g)
is_odd = odd > 0.5
sine = sign * pick(is_odd, b, a)
cosine = (sign - 2.0 * odd * sign) * pick(is_odd, a, b)
"""
"""Cosine and sine in float32 of an angle that is reduced in float64; |angle| at most 1000."""

COLUMNS_FREE = """\
fetch(Q, begun * n, order + start + L)
fetch(Q, begun * n + n - 1, order + start + L)
outside, far_off = every(0.0), every(0.0)
for j in range(n):
    column_ = collect(Q, begun * n + j, order + start)
    w[shelf + L * j] = column_
    outside = pick((column_ >= w[lower + j]) & (column_ <= w[upper + j]), outside, every(1.0))
    if not bounded:
        far_off = pick(column_ * column_ <= w[most + j], far_off, every(1.0))
"""
"""A row that is not finite is within no limits. Limits below the largest |q_j| exclude rows with large coordinates."""

GROUPS_FREE = """\
stamp += 1
for chosen in range(body_count):
    {spots}
listed = 0
for g in range(group_count):
    at = groups + GROUP * g
    a, b = spots + 4 * L * k[at], spots + 4 * L * k[at + 1]
    {square}
    k[near_groups + listed] = g
    listed += 1 if any(d + dead < V[far + g]) else 0
for g in range(listed):
    at = groups + GROUP * k[near_groups + g]
    meet = 255
    if k[at + 6] > 0:
        v = windows + WINDOW * k[at + 6]
        r = k[v + 5]
        cell = floor(single(0.0))
        for i in range(2):
            x = wide(t, turned_by + L * k[v + i]) - t[r]
            m = x * 0.15915494309189535 + 12582912.0
            m = m - 12582912.0
            x = (x - m * 6.283185307179586 + t[r + 1]) * t[r + 2]
            x = pick(x > 0.0, x, single(0.0))
            x = pick(x < t[r + 3], x, single(t[r + 3]))
            cell = cell * k[v + 2 + i] + floor(x)
            r += 4
        meet = union(k[v + 4], cell)
    if meet == 0:
        continue
    {ensure}
    of_group, part = 0, 0
    for c in range(k[at + 2], k[at + 3]):
        at = clusters + CLUSTERS * c
        a, b = spots + 4 * L * k[at], spots + 4 * L * k[at + 1]
        {square_of_clusters}
        k[near_clusters + of_group] = c
        of_group += 1 if any(d + dead < V[pairs_far + c]) and ((meet >> part) & 1) else 0
        part = (part + 1) & 7
    for c in range(of_group):
        at = clusters + CLUSTERS * k[near_clusters + c]
        {clusters}
    dead = pick(low < -V[bounds], single(math.inf), single(0.0))
    if not any(dead < 1.0):
        break
"""
"""First a list of the near pairs is made: it is filled without branches, which the processor could not predict."""

FREE = {
    "pair": "d = wide(V, b + 3 * L) - V[squares + e] + ax * wide(V, b) + ay * wide(V, b + L) + az * wide(V, b + 2 * L)",
    "row": "line = line + wide(V, a + 3 * L)\nlow = pick(line < low, line, low)",
}

FRAME_FREE = """\
NODE, GROUP, CLUSTERS, WINDOW, L = {node}, {group}, {cluster}, {window}, {lanes}
{head}
begun, stamp = 0, 0
for chosen in range(set_count):
    k[stamps + chosen] = 0
while begun < count:
    size = count - begun if count - begun < {tile} else {tile}
    bins = first_bins * second_bins
    if size <= {unsorted} or bins < 2:
        for i in range(size):
            k[rows_of + i] = i
    else:
        for i in range(bins):
            k[counts + i] = 0
        for i in range(size):
            bin_x = (Q[(begun + i) * n + first] - w[keys]) * w[keys + 1]
            bin_x = bin_x if bin_x > 0.0 else 0.0
            bin_x = bin_x if bin_x < first_bins - 1 else 1.0 * (first_bins - 1)
            bin_y = (Q[(begun + i) * n + second] - w[keys + 2]) * w[keys + 3]
            bin_y = bin_y if bin_y > 0.0 else 0.0
            bin_y = bin_y if bin_y < second_bins - 1 else 1.0 * (second_bins - 1)
            bin_xy = np.int64(bin_x) * second_bins + np.int64(bin_y)
            k[chosen_bin + i] = bin_xy
            k[counts + bin_xy] = k[counts + bin_xy] + 1
        before = 0
        for i in range(bins):
            many = k[counts + i]
            k[counts + i] = before
            before += many
        for i in range(size):
            bin_xy = k[chosen_bin + i]
            many = k[counts + bin_xy]
            k[rows_of + many] = i
            k[counts + bin_xy] = many + 1
    for i in range(size, size + 2 * L):
        k[rows_of + i] = k[rows_of + size - 1]
    for i in range(size + 2 * L):
        k[order + i] = k[rows_of + i] * n
    start = 0
    while start < size:
        {place}
        {work}
        start += L
    begun += size
return 0
"""
"""Rows of a tile are sorted into bins of one or two coordinates, and blocks are filled in that order."""

WORK_FREE = """\
dead = pick(single(outside + far_off) > 0.0, single(math.inf), single(0.0))
low = single(math.inf) - dead - dead
{groups}
inside, good = outside < 1.0, far_off < 1.0
unsure = (low >= -V[bounds]) & (low <= V[bounds])
unsure = inside & (unsure | (not good))
flag(index, begun, rows_of + start, inside & good & (low > V[bounds]), unsure)
"""
