"""The distance of two placed hulls for campaigns, compiled: a solver that shares nothing with pinbound's.

The corners of the difference that were least along a direction so far are kept, four at most; every corner, edge and
triangle of them is tried, and the place nearest to zero gives the next direction. What comes back is the distance of
two points of the bodies, and what the best direction proves to be a lower bound of the distance: neither needs the
search to be right. Written by faces tried one by one and orthogonal edges, not by pinbound's steps.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

__all__ = ["distance", "lowest", "moved", "nearest_of"]


@njit(cache=True)
def moved(vertices: Any, frame: Any) -> Any:
    """Return vertices (k, 3) of a link in the world, given its rotation and place (12,)."""
    found = np.empty_like(vertices)
    for v in range(len(vertices)):
        for i in range(3):
            found[v, i] = frame[9 + i]
            for j in range(3):
                found[v, i] += frame[3 * i + j] * vertices[v, j]
    return found


@njit(cache=True)
def _corner(A: Any, B: Any, unit: Any) -> Any:
    """Return the corner of the difference that is least along a direction."""
    low, a = np.inf, 0
    for v in range(len(A)):
        height = A[v, 0] * unit[0] + A[v, 1] * unit[1] + A[v, 2] * unit[2]
        if height < low:
            low, a = height, v
    high, b = -np.inf, 0
    for v in range(len(B)):
        height = B[v, 0] * unit[0] + B[v, 1] * unit[1] + B[v, 2] * unit[2]
        if height > high:
            high, b = height, v
    return A[a] - B[b]


@njit(cache=True)
def _dot(a: Any, b: Any) -> Any:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True)
def _foot(points: Any, i: int, j: int, k: int) -> Any:
    """Return the shares (3,) of the place nearest to zero in the plane of three corners, negative outside of them."""
    shares = np.full(3, -1.0)
    a, p, q = points[i], points[j] - points[i], points[k] - points[i]
    first = _dot(p, p)
    if not first > 0.0:
        return shares
    along = _dot(p, q) / first
    r = q - along * p
    again = _dot(p, r) / first  # once more, for what rounding left of it
    along, r = along + again, r - again * p
    second = _dot(r, r)
    if not second > 1e-26 * _dot(q, q):
        return shares
    s, t = -_dot(a, p) / first, -_dot(a, r) / second
    rest = a + s * p + t * r
    s, t = s - _dot(rest, p) / first, t - _dot(rest, r) / second
    shares[1], shares[2] = s - along * t, t
    shares[0] = 1.0 - shares[1] - shares[2]
    return shares


@njit(cache=True)
def _nearest(points: Any, count: int, shares: Any) -> Any:
    """Return the place of the corners, edges and triangles of some corners that is nearest to zero, and its shares."""
    best, square = np.zeros(3), np.inf
    for i in range(count):
        size = _dot(points[i], points[i])
        if size < square:
            square, best = size, points[i].copy()
            shares[:] = 0.0
            shares[i] = 1.0
        for j in range(i + 1, count):
            edge = points[j] - points[i]
            length = _dot(edge, edge)
            if length > 0.0:
                t = -_dot(points[i], edge) / length
                there = points[i] + t * edge
                size = _dot(there, there)
                if 0.0 <= t <= 1.0 and size < square:
                    square, best = size, there
                    shares[:] = 0.0
                    shares[i], shares[j] = 1.0 - t, t
            for k in range(j + 1, count):
                three = _foot(points, i, j, k)
                if three.min() < 0.0:
                    continue
                there = three[0] * points[i] + three[1] * points[j] + three[2] * points[k]
                size = _dot(there, there)
                if size < square:
                    square, best = size, there
                    shares[:] = 0.0
                    shares[i], shares[j], shares[k] = three[0], three[1], three[2]
    return best


@njit(cache=True)
def _holds_zero(points: Any) -> bool:
    """Return whether four corners hold zero, clearly: four volumes of one sign."""
    signs = 0
    for i in range(4):
        a, b, c = points[(i + 1) & 3], points[(i + 2) & 3], points[(i + 3) & 3]
        volume = _dot(a, np.cross(b, c)) * (1.0 if i & 1 == 0 else -1.0)
        size = np.sqrt(_dot(a, a) * _dot(b, b) * _dot(c, c))
        if abs(volume) <= 1e-14 * size:
            return False
        signs += 1 if volume > 0.0 else -1
    return abs(signs) == 4


@njit(cache=True)
def _is_known(points: Any, count: int, corner: Any) -> bool:
    for i in range(count):
        if points[i, 0] == corner[0] and points[i, 1] == corner[1] and points[i, 2] == corner[2]:
            return True
    return False


@njit(cache=True)
def distance(A: Any, B: Any, towards: Any, above: float) -> Any:
    """Return a distance of two points of both hulls, a proven lower bound of the least one, and its direction.

    Where it is proven to be `above` or more, the search ends, and both numbers are at least that. Zero is returned of
    bodies that overlap.

    Args:
        A: (k_a, 3) vertices of one body.
        B: (k_b, 3) of the other.
        towards: (3,) the direction to begin with; zero: any.
        above: Where to end.
    """
    size = max(np.abs(A).max() + np.abs(B).max(), 1e-300)
    points, shares = np.zeros((4, 3)), np.zeros(4)
    unit, proven, lower = towards.copy(), towards.copy(), 0.0
    if _dot(unit, unit) > 0.0:
        points[0] = _corner(A, B, unit)
        lower = _dot(points[0], unit) - 1e-15 * size
        if lower >= above:
            return max(np.sqrt(_dot(points[0], points[0])), above), lower, proven
        lower = max(lower, 0.0)
    else:
        points[0] = A[0] - B[0]
    count, place = 1, points[0].copy()
    met = np.sqrt(_dot(place, place))
    for _ in range(200):
        upper = np.sqrt(_dot(place, place))
        met = min(met, upper)
        if upper <= 1e-15 * size:
            break
        unit = place / upper
        corner = _corner(A, B, unit)
        low = _dot(corner, unit)
        if low > lower:
            lower, proven = low, unit
        if lower - 1e-15 * size >= above or met - lower <= 1e-15 * size:
            break
        if _is_known(points, count, corner):
            break
        points[count] = corner
        count += 1
        if count == 4 and _holds_zero(points):
            met, lower = 0.0, 0.0
            break
        place = _nearest(points, count, shares)
        if not np.sqrt(_dot(place, place)) < upper:
            break
        kept = 0
        for i in range(count):
            if shares[i] > 0.0:
                points[kept] = points[i]
                kept += 1
        count = kept
    return met, lower, proven


@njit(cache=True)
def nearest_of(A: Any, B: Any, a: Any, b: Any, towards: Any, value: float, lower: float) -> Any:
    """Return the least distance of two hulls over placements (N, 12) of each, its bound, where, and its direction.

    `value` and `lower` are what is known to be met elsewhere: where nothing is less, they come back, and -1.
    """
    where, found = -1, towards.copy()
    for row in range(len(a)):
        one = distance(moved(A, a[row]), moved(B, b[row]), towards, value)
        towards = one[2]
        if one[0] < value:
            value, lower, where, found = one[0], one[1], row, one[2].copy()
    return value, lower, where, found


@njit(cache=True)
def lowest(vertices: Any, frames: Any, place: Any, normal: Any, planes: Any) -> Any:
    """Return the least height (N,) of vertices above a plane, given the frames (N, 12) of both."""
    heights = np.empty(len(frames))
    for row in range(len(frames)):
        points = moved(vertices, frames[row])
        unit, foot = np.zeros(3), planes[row, 9:].copy()
        for i in range(3):
            for j in range(3):
                unit[i] += planes[row, 3 * i + j] * normal[j]
                foot[i] += planes[row, 3 * i + j] * place[j]
        least = np.inf
        for v in range(len(points)):
            least = min(least, _dot(points[v] - foot, unit))
        heights[row] = least
    return heights
