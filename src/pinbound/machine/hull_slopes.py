"""The step of the search for hulls that computes the gradient of a distance; `hull_source` combines all steps."""

from __future__ import annotations

from typing import Final

__all__ = ["SLOPES"]

SLOPES: Final = """\
size = math.sqrt(ux * ux + uy * uy + uz * uz)
ux, uy, uz = ux / size, uy / size, uz / size
x, y, z = s[p + 1], s[p + 2], s[p + 3]
for i in range(4):
    if used & (1 << i):
        a, b, share = np.int64(s[vertices + 2 * i]), np.int64(s[vertices + 2 * i + 1]), s[shares + i]
        ax, ay, az = share * s[a_at + a], share * s[a_at + a_count + a], share * s[a_at + 2 * a_count + a]
        bx, by, bz = share * s[b_at + b], share * s[b_at + b_count + b], share * s[b_at + 2 * b_count + b]
        px = s[e] * ax + s[e + 1] * ay + s[e + 2] * az
        py = s[e + 3] * ax + s[e + 4] * ay + s[e + 5] * az
        pz = s[e + 6] * ax + s[e + 7] * ay + s[e + 8] * az
        wx, wy, wz = wx + px, wy + py, wz + pz
        if a_turn == 0:
            x, y, z = x + px, y + py, z + pz
        px = s[f] * bx + s[f + 1] * by + s[f + 2] * bz
        py = s[f + 3] * bx + s[f + 4] * by + s[f + 5] * bz
        pz = s[f + 6] * bx + s[f + 7] * by + s[f + 8] * bz
        wx, wy, wz = wx + px, wy + py, wz + pz
        if b_turn == 0:
            x, y, z = x + px, y + py, z + pz
slide, slides, path, turns = np.int64(s[p + 35]), np.int64(s[p + 34]), np.int64(s[p + 37]), np.int64(s[p + 36])
for i in range(turns + 1):
    while slides > 0 and s[slide] <= i:
        at = state + STATE * np.int64(s[slide + 1])
        qx, qy, qz = s[slide + 3], s[slide + 4], s[slide + 5]
        px = s[at] * qx + s[at + 1] * qy + s[at + 2] * qz
        py = s[at + 3] * qx + s[at + 4] * qy + s[at + 5] * qz
        pz = s[at + 6] * qx + s[at + 7] * qy + s[at + 8] * qz
        j = np.int64(s[slide + 2])
        x, y, z = x + Q[here + j] * px, y + Q[here + j] * py, z + Q[here + j] * pz
        out[to + j * column] += ux * px + uy * py + uz * pz
        slide, slides = slide + SLIDE, slides - 1
    if i < turns:
        node = np.int64(s[path + i])
        at = state + STATE * node
        qx, qy, qz = wx - x - s[at + 9], wy - y - s[at + 10], wz - z - s[at + 11]
        slope = s[at + 12] * (qy * uz - qz * uy) + s[at + 13] * (qz * ux - qx * uz)
        slope += s[at + 14] * (qx * uy - qy * ux)
        turn = angles + 2 * np.int64(s[nodes + NODE * node + 7])
        terms = np.int64(s[turn + 1])
        for j in range(np.int64(s[turn])):
            out[to + np.int64(s[terms + 2 * j]) * column] += s[terms + 2 * j + 1] * slope
"""
"""The gradient of a distance, with its nearest points held fixed on their bodies."""
