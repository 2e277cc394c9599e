"""A set of reduced chains as one program of scalars: what several chains share is computed once.

There are two ways to compute the vectors r. The cheaper one (by counted operations) is used for the whole set:

*local*: each boundary's minimal chain, seen from its cheapest frame f. A planar chain is the sum `r = sum_i R(u, g_i -
    g_f) s_i` of rotated terms. The in-plane basis is free. It is chosen along a term that rotates by one angle, which
    gives `x = p_x + |s| cos, y = p_y + |s| sin`. A spatial chain is evaluated from both ends towards f.

*common*: every marked point in the root's frame, `x = b_0 + W_1 b_1 + W_2 b_2 + ...`. The products `W_i = R_1 ... R_i`
    are shared between points of one link and between links; then r = x_a - x_b. This is cheaper for many spheres on few
    links.

cos and sin come from `angles`. `docs/kernel.md` has the counts and the error bounds.

A segment adds one more vector, its direction, and r is then the shortest vector of a family (`nearest`). For a line, r
is projected perpendicular to the line; for a plane, only the height along its normal is used.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from pinbound.evaluate import separation
from pinbound.kernel.angles import Angle, Angles
from pinbound.kernel.nearest import cross, lowest, nearest
from pinbound.kernel.scalars import Graph, Vector
from pinbound.path.chain import Chain
from pinbound.path.kind import Case
from pinbound.path.relative import RelativePath
from pinbound.path.shared import Spot
from pinbound.tolerances import KERNEL_CONSTANT, REDUCTION
from pinbound.typing import Array

__all__ = ["CommonMark", "Pair", "Program", "Reference", "compile_program"]


@dataclass(frozen=True)
class Pair:
    """The data of one boundary for the kernel.

    Attributes:
        path: Its reduced relative path.
        threshold: [m].
        marks: Names of its two marks, which are keys of the common frame's chains.
    """

    path: RelativePath
    threshold: float
    marks: tuple[str, str]

    @property
    def minimal(self) -> Chain:
        """Its minimal chain."""
        return self.path.minimal


@dataclass(frozen=True)
class CommonMark:
    """A mark in the common frame.

    Attributes:
        make: Computes its `chains`.
        flat: Whether it is a line or a plane.
        spot: Its position, if it is a point.
    """

    make: Callable[[], tuple[Chain, ...]]
    flat: Literal["line", "plane"] | None = None
    spot: Spot | None = None

    @cached_property
    def chains(self) -> tuple[Chain, ...]:
        """Its point, and the ends of its edge vectors; for a line or plane, its point, and its direction or normal.

        The direction or normal is a chain of rotations alone: as the difference of two far points, it would have the
        rounding of their distance.
        """
        return self.make()


@dataclass(frozen=True)
class Reference:
    """The interpreter whose results the kernel must equal; it computes the separations of rows that are not finite.

    Attributes:
        norms: (N,) norms, or signed heights, of a path at Q (N, n).
        gradients: (N, n) gradients of the norm.
    """

    norms: Callable[[RelativePath, Array], Array] = separation.separations
    gradients: Callable[[RelativePath, Array], Array] = separation.gradients


@dataclass(frozen=True)
class Program:
    """The vectors of all boundaries, as nodes of one graph.

    Attributes:
        graph: The graph.
        vectors: Each boundary's r up to a rotation, three nodes each.
        squares: Each `|r|^2`, summed from components; for a signed quantity the height itself.
        signed: Whether each is a height above a plane.
        thresholds: (m,) [m].
        n: Number of active coordinates.
        is_common: Whether the common frame was cheaper.
        scale: The longest path of a sum for r, without prismatic displacements [m]; zero if no sign is needed.
    """

    graph: Graph
    vectors: tuple[Vector, ...]
    squares: tuple[int, ...]
    signed: tuple[bool, ...]
    thresholds: tuple[float, ...]
    n: int
    is_common: bool
    scale: float = 0.0

    @property
    def size(self) -> int:
        """The number of boundaries."""
        return len(self.squares)

    def gradients(self) -> list[list[int]]:
        """Return the nodes of `r . dr/dq_j`, n for each boundary; divided by the norm it is the gradient.

        For a signed boundary they are the gradient itself.
        """
        return [self._slopes(k) for k in range(self.size)]

    def _slopes(self, k: int) -> list[int]:
        graph, r = self.graph, self.vectors[k]
        if self.signed[k]:
            return [graph.derivative(self.squares[k], j) for j in range(self.n)]
        return [graph.dot(r, self._derivative(r, j)) for j in range(self.n)]

    def _derivative(self, r: Vector, j: int) -> Vector:
        x, y, z = (self.graph.derivative(component, j) for component in r)
        return x, y, z


def compile_program(pairs: Sequence[Pair], n: int, common: Mapping[str, CommonMark] | None = None) -> Program:
    """Return the cheaper of the local and the common program.

    Args:
        pairs: The boundaries.
        n: Number of active coordinates.
        common: Each mark in one common frame; None if there is no such frame.
    """
    local = _local_program(pairs, n)
    if common is None or len(pairs) < 2:
        return local
    shared = _common_program(pairs, n, common)
    return min(local, shared, key=lambda program: program.graph.cost(program.squares))


def _local_program(pairs: Sequence[Pair], n: int) -> Program:
    graph = Graph()
    angles = Angles(graph, [angle for pair in pairs for angle in _local_angles(pair)])
    vectors = [_local_vector(angles, pair.path) for pair in pairs]
    scale = max((pair.minimal.scale for pair in pairs), default=0.0)
    return _finish(graph, vectors, pairs, n, False, scale)


def _finish(
    graph: Graph, vectors: Sequence[Vector], pairs: Sequence[Pair], n: int, is_common: bool, scale: float
) -> Program:
    signed = tuple(pair.path.is_signed for pair in pairs)
    squares = tuple(r[0] if height else graph.dot(r, r) for r, height in zip(vectors, signed, strict=True))
    return Program(graph, tuple(vectors), squares, signed, tuple(p.threshold for p in pairs), n, is_common, scale)


def _key(coefficients: Array) -> Angle:
    return tuple(float(c) if abs(c) > REDUCTION else 0.0 for c in coefficients)


def _local_angles(pair: Pair) -> Iterator[Angle]:
    chain = pair.minimal
    if chain.is_planar:
        yield from _planar_angles(chain, pair.path.frame)
    else:
        yield from (_key(c) for c in chain.coefficients)


def _planar_angles(chain: Chain, frame: int) -> list[Angle]:
    """Return `g_i - g_f` for every offset of a planar chain."""
    angles = chain.planar_angles
    return [_key(row) for row in angles - angles[frame]]


def _local_vector(angles: Angles, path: RelativePath) -> Vector:
    """Return r, or its measured part, in the frame at position f; for a signed path the height and two zeros."""
    g, f, chain = angles.graph, path.frame, path.minimal
    chains = [chain, *path.difference.turned]
    basis = np.eye(3)
    if chain.is_planar and chain.rotations:
        terms = _planar_angles(chain, f)
        lengths = [float(np.linalg.norm(b)) if any(t) else 0.0 for b, t in zip(chain.offsets, terms, strict=True)]
        basis = _basis(chain.axes[0], chain.offsets[int(np.argmax(lengths))])
        w, *edges = (_planar(angles, one, f, basis) for one in chains)
    else:
        w, *edges = (_spatial(angles, one, f) for one in chains)
    projection = path.projection
    if projection is None:  # a segment keeps its length, so q = 0 gives it
        squares = [g.constant(float(np.sum(np.sum(edge, axis=0) ** 2))) for edge in path.difference.directions]
        return nearest(g, w, edges, squares)
    rows = np.zeros((3, 3))
    rows[: len(projection)] = projection @ basis
    w, *edges = (_change(g, vector, rows) for vector in (w, *edges))
    return _COUNTED[path.case](g, w, edges)


def _height(g: Graph, w: Vector, edges: Sequence[Vector]) -> Vector:
    """Return the height as the first of three nodes."""
    zero = g.constant(0.0)
    return lowest(g, w[0], [edge[0] for edge in edges]), zero, zero


_COUNTED: Mapping[Case, Callable[[Graph, Vector, Sequence[Vector]], Vector]] = {
    Case.LINE: nearest,
    Case.PLANE: _height,
}


def _planar(angles: Angles, chain: Chain, frame: int, basis: Array) -> Vector:
    g, terms = angles.graph, _planar_angles(chain, frame)
    x = y = z = g.constant(0.0)
    for offset, slide, angle in zip(chain.offsets, chain.slides, terms, strict=True):
        u, v, w = _constant_vector(g, _clean(basis.T @ offset, chain.scale), basis.T @ slide)
        z = g.add(z, w)
        if any(angle):
            cos, sin = angles.of(angle)
            u, v = g.sub(g.mul(u, cos), g.mul(v, sin)), g.add(g.mul(u, sin), g.mul(v, cos))
        x, y = g.add(x, u), g.add(y, v)
    return x, y, z


def _basis(axis: Array, along: Array) -> Array:
    """Return a right-handed orthonormal basis (e1, e2, axis) as columns; e1 is towards `along` if that is not zero."""
    first = along - axis * (axis @ along)
    if not np.linalg.norm(first) > 0.0:
        unit = np.eye(3)[int(np.argmin(np.abs(axis)))]
        first = unit - axis * (axis @ unit)
    first = first / np.linalg.norm(first)
    return np.column_stack((first, np.cross(axis, first), axis))


def _clean(vector: Array, scale: float) -> Array:
    """Return the vector, with entries set to zero that are only rounding."""
    return np.where(np.abs(vector) <= KERNEL_CONSTANT * scale, 0.0, vector)


def _constant_vector(g: Graph, offset: Array, slide: Array) -> Vector:
    rows = [np.where(np.abs(row) > REDUCTION, row, 0.0) for row in slide]
    x, y, z = (g.linear(row.tolist(), float(b)) for row, b in zip(rows, offset, strict=True))
    return x, y, z


def _spatial(angles: Angles, chain: Chain, frame: int) -> Vector:
    """Return `b_f + R_{f+1}(b_{f+1} + ...) + R_f^-1(b_{f-1} + R_{f-1}^-1(...))`."""
    right = _end(angles, chain, range(chain.rotations, frame, -1), 1.0)
    left = _end(angles, chain, range(1, frame + 1), -1.0)
    middle = _constant_vector(angles.graph, chain.offsets[frame], chain.slides[frame])
    g = angles.graph
    x, y, z = (g.total(parts) for parts in zip(middle, right, left, strict=True))
    return x, y, z


def _end(angles: Angles, chain: Chain, rotations: range, sign: float) -> Vector:
    """Return one end of a chain, rotated inwards; the vector is expressed in the basis of the last axis."""
    g = angles.graph
    zero = g.constant(0.0)
    vector: Vector = (zero, zero, zero)
    basis = np.eye(3)
    for index in rotations:
        source = index if sign > 0 else index - 1
        frame, axis, flip = _frame(chain.axes[index - 1])
        vector = _change(g, vector, frame.T @ basis)
        offset = _constant_vector(
            g, _clean(frame.T @ chain.offsets[source], chain.scale), frame.T @ chain.slides[source]
        )
        vector = _added(g, vector, offset)
        cos, sin = angles.of(_key(sign * flip * chain.coefficients[index - 1]))
        vector, basis = _turned(g, vector, axis, cos, sin), frame
    return _change(g, vector, basis)


def _frame(axis: Array) -> tuple[Array, int, float]:
    """Return a basis in which a rotation is about a coordinate axis: its index, and the sign of the angle."""
    index = int(np.argmax(np.abs(axis)))
    if np.all(np.abs(np.delete(axis, index)) <= REDUCTION):
        return np.eye(3), index, float(np.sign(axis[index]))
    return _basis(axis, np.zeros(3)), 2, 1.0


def _change(g: Graph, vector: Vector, matrix: Array) -> Vector:
    """Return `matrix @ vector`; entries that differ from 0 or +-1 only by rounding are set to these values."""
    rounded = np.round(matrix)
    exact = np.where(np.abs(matrix - rounded) <= KERNEL_CONSTANT, rounded, matrix)
    x, y, z = (
        g.total(g.mul(g.constant(float(entry)), component) for entry, component in zip(row, vector, strict=True))
        for row in exact
    )
    return x, y, z


def _added(g: Graph, a: Vector, b: Vector) -> Vector:
    return g.add(a[0], b[0]), g.add(a[1], b[1]), g.add(a[2], b[2])


def _turned(g: Graph, vector: Vector, axis: int, cos: int, sin: int) -> Vector:
    """Return the vector rotated about a coordinate axis."""
    result = list(vector)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    x, y = vector[i], vector[j]
    result[i] = g.sub(g.mul(x, cos), g.mul(y, sin))
    result[j] = g.add(g.mul(x, sin), g.mul(y, cos))
    return result[0], result[1], result[2]


def _common_program(pairs: Sequence[Pair], n: int, common: Mapping[str, CommonMark]) -> Program:
    graph = Graph()
    marks = {name: common[name] for pair in pairs for name in pair.marks}
    chains = [chain for mark in marks.values() for chain in mark.chains]
    angles = Angles(graph, [_key(c) for chain in chains for c in chain.coefficients])
    scale = max(chain.scale for chain in chains)
    placed = {
        name: [
            _position(angles, chain, scale if mark.flat is None or not index else chain.scale)
            for index, chain in enumerate(mark.chains)
        ]
        for name, mark in marks.items()
    }
    vectors = [_common_vector(graph, pair, marks, placed) for pair in pairs]
    return _finish(graph, vectors, pairs, n, True, scale)


def _common_vector(
    g: Graph, pair: Pair, marks: Mapping[str, CommonMark], placed: Mapping[str, Sequence[Vector]]
) -> Vector:
    """Return r, or its measured part, in the common frame."""
    kinds = [marks[name].flat for name in pair.marks]
    a, b = (placed[name] for name in pair.marks)
    w, edges, squares = _less(g, a[0], b[0]), list[Vector](), list[int]()
    for side, (start, *ends) in enumerate((a, b)):
        for end in ends if kinds[side] is None else ():
            edges.append(_less(g, end, start) if side == 0 else _less(g, start, end))
            edge = pair.path.difference.directions[len(squares)]
            squares.append(g.constant(float(np.sum(np.sum(edge, axis=0) ** 2))))
    flat = next((side for side in (0, 1) if kinds[side] is not None), None)
    if flat is None:
        return nearest(g, w, edges, squares)
    unit, zero = (a, b)[flat][1], g.constant(0.0)
    if kinds[flat] == "line":
        return nearest(g, cross(g, w, unit), [cross(g, edge, unit) for edge in edges])
    towards = unit if flat == 1 else _less(g, (zero, zero, zero), unit)
    return lowest(g, g.dot(w, towards), [g.dot(edge, towards) for edge in edges]), zero, zero


def _less(g: Graph, a: Vector, b: Vector) -> Vector:
    return g.sub(a[0], b[0]), g.sub(a[1], b[1]), g.sub(a[2], b[2])


def _position(angles: Angles, chain: Chain, scale: float) -> Vector:
    """Return `b_0 + W_1 b_1 + ...` of a point, with offsets moved to the tail so that the heads are shared."""
    g = angles.graph
    offsets, slides = chain.pushed_behind()
    quantum = KERNEL_CONSTANT * 2.0 ** np.ceil(np.log2(scale)) if scale else 1.0
    offsets = np.round(offsets / quantum) * quantum
    one, zero = g.constant(1.0), g.constant(0.0)
    columns: list[Vector] = [(one, zero, zero), (zero, one, zero), (zero, zero, one)]
    basis, position = np.eye(3), _constant_vector(g, offsets[0], slides[0])
    for index, axis in enumerate(chain.axes):
        frame, k, flip = _frame(axis)
        rows = [_change(g, row, frame.T @ basis) for row in zip(*columns, strict=True)]
        cos, sin = angles.of(_key(flip * chain.coefficients[index]))
        # A product W R(phi) rotates the columns i and j: w_i cos + w_j sin, w_j cos - w_i sin.
        rows = [_turned(g, row, k, cos, g.mul(g.constant(-1.0), sin)) for row in rows]
        columns = [(rows[0][c], rows[1][c], rows[2][c]) for c in range(3)]
        basis = frame
        local = _constant_vector(g, _clean(frame.T @ offsets[index + 1], chain.scale), frame.T @ slides[index + 1])
        step: Vector = tuple(g.dot(row, local) for row in rows)  # type: ignore[assignment]
        position = _added(g, position, step)
    return position
