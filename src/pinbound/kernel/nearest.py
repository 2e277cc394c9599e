"""The nearest points of segments as scalar nodes: `closest.nearest`, candidate by candidate, without a branch.

The parameters t are *held*. At the minimum, the distance does not change with t to first order, or t cannot change. So
derivatives treat t as constants.
"""

from __future__ import annotations

from collections.abc import Sequence

from pinbound.kernel.scalars import Graph, Vector

__all__ = ["cross", "lowest", "nearest"]


def nearest(g: Graph, w: Vector, edges: Sequence[Vector], squares: Sequence[int] | None = None) -> Vector:
    """Return `w + sum_i t_i e_i` at the t in [0, 1] for which it is shortest.

    Args:
        g: The graph.
        w: The vector for t = 0.
        edges: Zero, one or two vectors e_i.
        squares: Nodes of `|e_i|^2` if they are known, as for the lengths of segments.
    """
    if not edges:
        return w
    sizes = [g.dot(e, e) for e in edges] if squares is None else squares
    if len(edges) == 1:
        return _along(g, w, g.hold(_foot(g, w, edges[0], sizes[0])), edges[0])
    (first, second), zero, one = edges, g.constant(0.0), g.constant(1.0)
    far_first, far_second = _sum(g, w, first), _sum(g, w, second)
    candidates = [
        (zero, _foot(g, w, second, sizes[1])),
        (one, _foot(g, far_first, second, sizes[1])),
        (_foot(g, w, first, sizes[0]), zero),
        (_foot(g, far_second, first, sizes[0]), one),
        _inside(g, w, (first, second), sizes),
    ]
    s, t, least = zero, zero, zero
    for index, (s_new, t_new) in enumerate(candidates):
        r = _along(g, _along(g, w, s_new, first), t_new, second)
        square = g.dot(r, r)
        s = g.pick(square, least, s_new, s) if index else s_new
        t = g.pick(square, least, t_new, t) if index else t_new
        least = g.pick(square, least, square, least) if index else square
    return _along(g, _along(g, w, g.hold(s), first), g.hold(t), second)


def lowest(g: Graph, height: int, edges: Sequence[int]) -> int:
    """Return `height + sum_i t_i e_i` at the t for which it is least; each t is 0 or 1."""
    zero = g.constant(0.0)
    return g.total([height, *(g.pick(e, zero, e, zero) for e in edges)])


def cross(g: Graph, a: Vector, b: Vector) -> Vector:
    """Return a x b."""
    x, y, z = (g.sub(g.mul(a[i], b[j]), g.mul(a[j], b[i])) for i, j in ((1, 2), (2, 0), (0, 1)))
    return x, y, z


def _inside(g: Graph, w: Vector, edges: tuple[Vector, Vector], sizes: Sequence[int]) -> tuple[int, int]:
    first, second = edges
    n = cross(g, first, second)
    s = _cut(g, g.sub(g.constant(0.0), g.dot(cross(g, w, second), n)), g.dot(n, n))
    t = _foot(g, _along(g, w, s, first), second, sizes[1])
    s = _foot(g, _along(g, w, t, second), first, sizes[0])
    return s, _foot(g, _along(g, w, s, first), second, sizes[1])


def _foot(g: Graph, w: Vector, edge: Vector, size: int) -> int:
    return _cut(g, g.sub(g.constant(0.0), g.dot(w, edge)), size)


def _cut(g: Graph, above: int, below: int) -> int:
    """Return the quotient limited to [0, 1]; 0 if the denominator is 0."""
    zero, one = g.constant(0.0), g.constant(1.0)
    if g.value_of(below) == 0.0:
        return zero
    if g.value_of(below) is None:
        above, below = g.pick(zero, below, above, zero), g.pick(zero, below, below, one)
    quotient = g.div(above, below)
    return g.pick(quotient, zero, zero, g.pick(one, quotient, one, quotient))


def _along(g: Graph, w: Vector, t: int, edge: Vector) -> Vector:
    x, y, z = (g.add(a, g.mul(t, b)) for a, b in zip(w, edge, strict=True))
    return x, y, z


def _sum(g: Graph, a: Vector, b: Vector) -> Vector:
    return g.add(a[0], b[0]), g.add(a[1], b[1]), g.add(a[2], b[2])
