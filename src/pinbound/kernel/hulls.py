"""Boundaries whose nearest points need a search, in machine code: the tables that `hull_source` reads, and its call.

A pair's chain is `b_0 + R_1(b_1 + R_2(... R_k b_k))`, and the edge vectors of each body are in one block. The middle of
the chain is the same for all pairs of two links, and its beginning is the same for all pairs of one link. So rotations
are *nodes* of a tree that is placed once for each configuration, `W = W_above R(u, c . q)`, `P = P_above + W_above b`.
A pair computes `w = b_0 + P + W b_k` from its last node.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pinbound.kernel.program import Pair
from pinbound.kernel.spheres import middle_of
from pinbound.machine.compiled import MachineCode, compile_source, is_kept
from pinbound.machine.hull_source import HEAD, NODE, PAIR, STATE, WORK, hull_source
from pinbound.path.chain import Chain
from pinbound.path.kind import Case
from pinbound.path.relative import RelativePath
from pinbound.tolerances import KERNEL_CONSTANT, OVERLAP, REDUCTION, UNIT_ROUNDOFF
from pinbound.typing import Array, Ints

__all__ = ["HullTables", "is_ready", "prepare_hulls", "tables_of"]

_LANES = 8  # vertices that are examined together
_AGREE = 8.0 * UNIT_ROUNDOFF  # relative to the furthest vertex: the largest difference of both bounds at the end
_ROUNDS = 100
_KNOWN = (64.0 * UNIT_ROUNDOFF) ** 2  # squared, relative: rounding alone may decide the sign of a smaller volume
_SHARP = 1e-4  # a squared sine: on flatter faces, the nearest point is corrected a second time
_FLAT = 64.0 * UNIT_ROUNDOFF**2  # a squared sine: a flatter face is treated as an edge
_ROUNDING = 64.0 * UNIT_ROUNDOFF  # relative: the rounding of a bounding ball, of its radius and its distance
_MODES = {"norms": 0, "clearances": 1, "gradients": 2, "smallest": 3, "least": 3}


@dataclass(frozen=True)
class _Node:
    """A rotation about an axis, at the end of a constant step behind the node above."""

    above: int
    step: Array
    axis: Array
    angle: int


@dataclass(frozen=True, eq=False)
class HullTables:
    """The tables of a set of pairs that the machine code reads.

    Attributes:
        numbers: Head and tables; working memory follows them.
        room: Number of float64 of working memory.
        columns: Coordinates that occur.
    """

    numbers: Array
    room: int
    columns: tuple[int, ...]

    def run(self, Q: Array, mode: str, out: Array, index: Ints) -> int:
        """Fill rows and return how many numbers were not finite.

        Args:
            Q: (N, n), C-contiguous.
            mode: One of `source.MODES`.
            out: (N, columns), of float64.
            index: (N,) int64, in mode ``"smallest"``.
        """
        s = np.zeros(len(self.numbers) + self.room)
        s[: len(self.numbers)] = self.numbers
        s[1], s[18] = _MODES[mode], mode == "smallest"
        row, column = (step // out.itemsize for step in out.strides)
        return _code().function(*map(_address, (Q, out)), row, column, _address(index), _address(s), len(Q))


def is_ready() -> bool:
    """Return whether the code is ready without compiling."""
    return bool(_code.cache_info().currsize) or is_kept(hull_source())


def prepare_hulls() -> None:
    """Compile or load the code now."""
    _code()


def tables_of(pairs: Sequence[Pair], n: int) -> HullTables | None:
    """Return the tables of pairs; None if a body's edge vectors are in several blocks, so that it is not rigid."""
    writer = _Writer(n)
    for pair in pairs:
        if not writer.add(pair):
            return None
    return writer.tables()


@cache
def _code() -> MachineCode:
    return compile_source(hull_source())


def _address(array: NDArray[Any]) -> int:
    return array.__array_interface__["data"][0]


@dataclass
class _Body:
    """The vertices of one body as a table, around their middle."""

    place: int
    middle: Array
    vertices: Array


@dataclass
class _Writer:
    n: int
    angles: list[Array] = field(default_factory=list[Array])
    nodes: list[_Node] = field(default_factory=list[_Node])
    pairs: list[list[float]] = field(default_factory=list[list[float]])
    slides: list[list[list[float]]] = field(default_factory=list[list[list[float]]])
    paths: list[list[int]] = field(default_factory=list[list[int]])
    bodies: dict[bytes, _Body] = field(default_factory=dict[bytes, _Body])
    used: set[int] = field(default_factory=set[int])
    vertices: list[Array] = field(default_factory=list[Array])
    length: int = 0

    def add(self, pair: Pair) -> bool:
        """Add one more pair; False if it does not fit."""
        path, chain = pair.path, pair.path.minimal
        offsets = _pushed(chain)
        path_nodes = [0]
        for index in range(chain.rotations):
            step = offsets[index] if index else np.zeros(3)
            path_nodes.append(self._node(path_nodes[-1], step, chain, index))
        counts = [corners.shape[1] for corners in path.difference.corners]
        first, last = offsets[0].copy(), offsets[-1].copy() if chain.rotations else np.zeros(3)
        sides: list[float] = []
        tables: list[float] = []
        true_counts: list[float] = []
        reach = 0.0
        for side, given in enumerate(path.difference.corners):
            edges = [path.difference.directions[i] for i in range(sum(counts[:side]), sum(counts[: side + 1]))]
            block, matrix = _one_block(chain, edges)
            if block < 0:
                return False
            corners = given
            if matrix.shape[1] > 3:  # its vertices are constants of the block themselves
                corners, matrix = given @ matrix.T, np.eye(3)
            body = self._body(corners)
            moved = matrix @ body.middle
            if block in (0, chain.rotations):
                (first if block == 0 else last)[:] += moved
                around = body.vertices
            else:
                return False
            sides += [float(path_nodes[block]), *_numbers(matrix)]
            tables += [float(body.place), float(-(-len(around) // _LANES) * _LANES)]
            true_counts.append(float(len(around)))
            reach += float(np.linalg.norm(around @ matrix.T, axis=1).max())
        measured, rows = _counted(path)
        where = [i for i in range(chain.rotations + 1) if np.any(np.abs(chain.slides[i]) > REDUCTION)]
        self.slides.append(
            [
                [float(i), float(path_nodes[i]), float(j), *_numbers(chain.slides[i][:, j])]
                for i in where
                for j in np.flatnonzero(np.any(np.abs(chain.slides[i]) > REDUCTION, axis=0)).tolist()
            ]
        )
        self.paths.append(path_nodes[1:])
        self.used |= set(chain.coordinates)
        self.pairs.append(
            [
                float(path_nodes[-1]), *_numbers(first), *_numbers(last), *sides, *tables, pair.threshold,
                reach, reach * (1.0 + _ROUNDING), 0.0, 0.0, 0.0, 0.0, *true_counts,
                measured, *_numbers(rows),
            ]
        )  # fmt: skip
        return True

    def _node(self, above: int, step: Array, chain: Chain, index: int) -> int:
        axis, near = chain.axes[index], 4.0 * KERNEL_CONSTANT * chain.scale
        coefficients = np.where(np.abs(chain.coefficients[index]) > REDUCTION, chain.coefficients[index], 0.0)
        angle = next((i for i, known in enumerate(self.angles) if np.array_equal(known, coefficients)), -1)
        if angle < 0:
            angle = len(self.angles)
            self.angles.append(coefficients)
        for number, node in enumerate(self.nodes, start=1):
            is_same = node.above == above and node.angle == angle
            if is_same and np.abs(node.axis - axis).max() <= KERNEL_CONSTANT and np.abs(node.step - step).max() <= near:
                return number
        self.nodes.append(_Node(above, step, axis, angle))
        return len(self.nodes)

    def _body(self, corners: Array) -> _Body:
        key = repr(corners.shape).encode() + corners.tobytes()
        if key not in self.bodies:
            full = np.zeros((len(corners), 3))
            full[:, : corners.shape[1]] = corners
            middle = middle_of(full)
            full = full - middle
            filled = np.vstack((full, np.repeat(full[-1:], -len(full) % _LANES, axis=0)))
            self.bodies[key] = _Body(self.length, middle, full)
            self.vertices.append(filled.T.ravel())
            self.length += filled.size
        return self.bodies[key]

    def tables(self) -> HullTables:
        parts: list[Array] = []
        at = HEAD

        def place(numbers: Any) -> int:
            nonlocal at
            array = np.array(numbers, dtype=np.float64).ravel()
            parts.append(array)
            at += len(array)
            return at - len(array)

        terms = [np.flatnonzero(c) for c in self.angles]
        term_places = [place([(j, c[j]) for j in which]) for c, which in zip(self.angles, terms, strict=True)]
        angles = place([(len(which), start) for which, start in zip(terms, term_places, strict=True)])
        rows = [[node.above, *node.step, *node.axis, node.angle] for node in self.nodes]
        nodes = place([[0.0] * NODE, *rows])
        vertices = place(np.concatenate(self.vertices)) if self.vertices else at
        for record, slides, path in zip(self.pairs, self.slides, self.paths, strict=True):
            record[27] += vertices
            record[29] += vertices
            record[34], record[35] = len(slides), place(slides)
            record[36], record[37] = len(path), place(path)
        pairs = place([record + [0.0] * (PAIR - len(record)) for record in self.pairs])
        trig = at
        state = trig + 2 * len(self.angles)
        work = state + STATE * (len(self.nodes) + 1)
        middles = work + WORK
        head = np.zeros(HEAD)
        head[:20] = [
            self.n, 0, len(self.angles), angles, len(self.nodes) + 1, nodes, len(self.pairs), pairs, work, trig,
            state, _AGREE, _ROUNDS, _KNOWN, OVERLAP, middles, _FLAT, 1.0 - _ROUNDING, 0, _SHARP,
        ]  # fmt: skip
        root = np.zeros(2 * len(self.angles) + STATE)
        root[2 * len(self.angles) :][[0, 4, 8]] = 1.0  # the first node has no rotation
        numbers = np.concatenate((head, *parts, root))
        return HullTables(numbers, middles + 4 * len(self.pairs) - len(numbers), tuple(sorted(self.used)))


def _counted(path: RelativePath) -> tuple[float, Array]:
    """Return the kind of quantity for the search, and the numbers that compute it from r."""
    projection = path.projection
    if projection is None:
        return 0.0, np.zeros(9)
    heights: tuple[float, Array] = 2.0, projection[0]
    lengths: tuple[float, Array] = 1.0, (projection.T @ projection).ravel()
    return {Case.LINE: lengths, Case.PLANE: heights}[path.case]


def _numbers(array: Array) -> list[float]:
    return [float(number) for number in array.ravel()]


def _pushed(chain: Chain) -> Array:
    """Return the chain's offsets, with the parts along the next axis moved behind its rotation.

    All offsets but the first and the last then depend only on the links, and not on their marks.
    """
    offsets = chain.offsets.copy()
    for index in range(1, chain.rotations):
        along = chain.axes[index] * (chain.axes[index] @ offsets[index])
        offsets[index] -= along
        offsets[index + 1] += along
    return offsets


def _one_block(chain: Chain, edges: Sequence[Array]) -> tuple[int, Array]:
    """Return the block of all edge vectors, and these (3, 3), padded with zeros; -1 if they are in several blocks.

    The reduction moved parts along an axis to the front of its rotation; here they are moved back.
    """
    matrix = np.zeros((3, max(len(edges), 3)))
    if not edges:
        return 0, matrix
    blocks = np.stack(edges, axis=2)  # (k + 1, 3, edges)
    for index in range(chain.rotations):
        here, axis = blocks[index], chain.axes[index]
        size = np.abs(blocks).max()
        rest = here - np.outer(axis, axis @ here)
        behind = np.any(blocks[index + 1 :])
        if np.any(here) and behind:
            if np.abs(rest).max() > REDUCTION * size:
                return -1, matrix
            blocks[index + 1] += here
            blocks[index] = 0.0
    filled = [index for index in range(chain.rotations + 1) if np.any(blocks[index])]
    if len(filled) > 1:
        return -1, matrix
    block = filled[0] if filled else 0
    while 0 < block < chain.rotations:  # all of it is along the axis, as for a capsule along a joint
        axis = chain.axes[block]
        if np.abs(blocks[block] - np.outer(axis, axis @ blocks[block])).max() > REDUCTION * np.abs(blocks[block]).max():
            break
        blocks[block + 1], blocks[block] = blocks[block], 0.0
        block += 1
    matrix[:, : len(edges)] = blocks[block]
    return block, matrix
