"""A chain of rotations about constant axes, and its reduction; every interpreter reads this value.

    r(q) = b_0 + R_1( b_1 + R_2( b_2 + ... R_k b_k ) ),   R_i = R(u_i, c_i . q),   b_i = s_i + L_i q,

where L_i is zero without prismatic joints. `docs/relative-path.md` proves that each step below preserves its value or,
where stated, its norm.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np

from pinbound.annotations.shapes import cube_corners
from pinbound.tolerances import REDUCTION
from pinbound.typing import Array, Flags
from pinbound.values import Value, read_only

__all__ = ["Chain", "HullChain", "are_parallel", "drop_head", "reduce_chain", "split"]


@dataclass(frozen=True, eq=False)
class Chain(Value):
    """`b_0 + R_1(b_1 + R_2(b_2 + ...))` with k rotations, over n active coordinates.

    Attributes:
        offsets: (k + 1, 3) [m], the s_i.
        slides: (k + 1, 3, n), the L_i [m per unit of q].
        axes: (k, 3) unit vectors u_i.
        coefficients: (k, n), the c_i; in a reduced chain no row is zero, and two neighbours are parallel only if an
            offset is between them.
        scale: Metres; the length of the path before reduction, to which rounding is relative.
    """

    offsets: Array
    slides: Array
    axes: Array
    coefficients: Array
    scale: float

    @property
    def rotations(self) -> int:
        """The number k of rotations."""
        return len(self.axes)

    @property
    def coordinates(self) -> tuple[int, ...]:
        """Indices of the active coordinates that occur."""
        used = np.any(self.coefficients, axis=0) | np.any(self.slides, axis=(0, 1))
        return tuple(int(index) for index in np.flatnonzero(used))

    def reversed(self) -> Chain:
        """Return the same vector in the frame behind the last rotation: `b_k + R_k^T (b_(k-1) + ...)`."""
        return Chain(self.offsets[::-1], self.slides[::-1], -self.axes[::-1], self.coefficients[::-1], self.scale)

    def before(self, place: int) -> Chain:
        """Return the part before rotation `place`, which does not rotate with it."""
        return Chain(
            self.offsets[: place + 1],
            self.slides[: place + 1],
            self.axes[:place],
            self.coefficients[:place],
            self.scale,
        )

    def behind(self, place: int) -> Chain:
        """Return the part that rotation `place` rotates, in the frame behind it."""
        after = place + 1
        return Chain(
            self.offsets[after:], self.slides[after:], self.axes[after:], self.coefficients[after:], self.scale
        )

    def pushed_behind(self) -> tuple[Array, Array]:
        """Return offsets and slides; the part of each along the next axis, which is not rotated, moves behind it."""
        offsets, slides = self.offsets.copy(), self.slides.copy()
        for index, axis in enumerate(self.axes):
            along = np.outer(axis, axis)
            offsets[index + 1] += along @ offsets[index]
            slides[index + 1] += along @ slides[index]
            offsets[index] -= along @ offsets[index]
            slides[index] -= along @ slides[index]
        return offsets, slides

    @property
    def is_planar(self) -> bool:
        """Whether all rotations are about one direction."""
        return all(are_parallel(self.axes[0], axis) for axis in self.axes[1:])

    @cached_property
    def planar_angles(self) -> Array:
        """Coefficients (k + 1, n) of the angle, about the first axis, by which each block of a planar chain rotates."""
        signs = np.sign(self.axes @ self.axes[0]) if self.rotations else np.zeros(0)
        steps = signs[:, None] * self.coefficients
        return read_only(np.cumsum(np.vstack((np.zeros(self.coefficients.shape[1]), steps)), axis=0))


_NO_CORNER = read_only(np.zeros((1, 0)))


@dataclass(frozen=True, eq=False)
class HullChain(Value):
    """A point, or all points over two bodies: `chain + sum_i t_i direction_i`, for t in the product of two hulls.

    Attributes:
        chain: The point for t = 0.
        directions: One for each t, (k + 1, 3) [m]: offsets of a chain with the rotations of `chain`; the first body
            comes first.
        corners: The vertices of t for each body, (k_a, m_a) and (k_b, m_b), with m_a + m_b directions in total. A body
            with all `t in [0, 1]^m` has the corners of that cube.
    """

    chain: Chain
    directions: tuple[Array, ...] = ()
    corners: tuple[Array, Array] = (_NO_CORNER, _NO_CORNER)

    @cached_property
    def is_zonotope(self) -> bool:
        """Whether every t runs over [0, 1], independent of the others."""
        return all(len(c) == 2 ** c.shape[1] and np.array_equal(c, cube_corners(c.shape[1])) for c in self.corners)

    @cached_property
    def turned(self) -> tuple[Chain, ...]:
        """The directions as chains, with all rotations of the chain itself."""
        still = np.zeros_like(self.chain.slides)
        return tuple(replace(self.chain, offsets=offsets, slides=still) for offsets in self.directions)

    @cached_property
    def edges(self) -> tuple[Chain, ...]:
        """The directions as chains, as short as possible."""
        return tuple(map(_trimmed, self.turned))

    @cached_property
    def vertex_chains(self) -> tuple[Chain, ...]:
        """The chains of all pairs of vertices; the vertex of b changes fastest; for cubes, zero corners are first."""
        found: list[Chain] = []
        for corner in (np.concatenate(pair) for pair in product(*self.corners)):
            moved = sum((t * edge for t, edge in zip(corner, self.directions, strict=True)), start=self.chain.offsets)
            found.append(replace(self.chain, offsets=np.array(moved)))
        return tuple(found)


def are_parallel(u: Array, v: Array) -> bool:
    """Return whether two unit vectors are parallel or antiparallel, up to the rounding of folded constants."""
    (a, b, c), (x, y, z) = u.tolist(), v.tolist()
    return max(abs(b * z - c * y), abs(c * x - a * z), abs(a * y - b * x)) <= REDUCTION


def split(chain: Chain, n: int, corners: tuple[Array, Array] = (_NO_CORNER, _NO_CORNER)) -> HullChain:
    """Return a chain over n coordinates, and the directions of the parameters after them, with these corners."""
    own = replace(chain, slides=chain.slides[:, :, :n], coefficients=chain.coefficients[:, :n])
    return HullChain(own, tuple(chain.slides[:, :, column] for column in range(n, chain.slides.shape[2])), corners)


def _trimmed(chain: Chain) -> Chain:
    """Return a chain without prismatic joints, without the rotations behind its last offset."""
    used = np.flatnonzero(np.any(chain.offsets, axis=1))
    return chain.before(int(used[-1]) if len(used) else 0)


def reduce_chain(chain: Chain) -> Chain:
    """Collect parallel rotations until nothing changes; the value of the chain stays the same."""
    while True:
        before = chain.rotations
        chain = _collect_runs(chain)
        if chain.rotations == before:
            return chain


def _collect_runs(chain: Chain) -> Chain:
    """Rewrite each maximal run of parallel rotations as a sum over its distinct angles, and nest it again.

    In a run, `R(g_1) b_1 + ... + R(g_m) (b_m + rest)` with cumulative angles g. Offsets with equal angles are added,
    components along the axis and offsets without an angle leave the run, and zero offsets are dropped.
    """
    blocks = [np.column_stack((s, L)) for s, L in zip(chain.offsets, chain.slides, strict=True)]
    out_blocks, out_axes, out_coefficients = [blocks[0]], list[Array](), list[Array]()
    start = 0
    while start < chain.rotations:
        axis, stop = chain.axes[start], start + 1
        while stop < chain.rotations and are_parallel(axis, chain.axes[stop]):
            stop += 1
        if stop == start + 1 and np.any(np.abs(chain.coefficients[start]) > REDUCTION):  # of most chains most runs
            along = np.outer(axis, axis @ blocks[stop])
            across = blocks[stop] - along
            out_blocks[-1] = out_blocks[-1] + along
            counts = _counts(across, chain.scale)
            if counts or stop < chain.rotations:
                out_axes.append(axis)
                out_coefficients.append(_cleared(chain.coefficients[start]))
                out_blocks.append(across if counts else np.zeros_like(across))
            start = stop
            continue
        signs = np.sign(chain.axes[start:stop] @ axis)
        angles = np.cumsum(signs[:, None] * chain.coefficients[start:stop], axis=0)
        along, perpendicular = _split_blocks(blocks[start + 1 : stop + 1], axis)
        out_blocks[-1] = out_blocks[-1] + along
        groups = _group(angles, perpendicular)
        last = _Group(angles[-1], np.zeros_like(perpendicular[0])) if stop < chain.rotations else None
        previous = np.zeros(chain.coefficients.shape[1])
        for group in _ordered(groups, last, chain.scale):
            step = group.angle - previous
            if np.any(np.abs(step) > REDUCTION):
                out_axes.append(axis)
                out_coefficients.append(_cleared(step))
                out_blocks.append(group.block)
            else:
                out_blocks[-1] = out_blocks[-1] + group.block
            previous = group.angle
        start = stop
    stacked = np.array(out_blocks)
    n = chain.coefficients.shape[1]
    k = len(out_axes)
    axes, coefficients = np.array(out_axes).reshape(k, 3), np.array(out_coefficients).reshape(k, n)
    return Chain(stacked[:, :, 0], stacked[:, :, 1:], axes, coefficients, chain.scale)


@dataclass
class _Group:
    """The offsets of a run that rotate by the same angle `c . q`."""

    angle: Array
    block: Array

    def has(self, angle: Array) -> bool:
        return bool(np.all(np.abs(self.angle - angle) <= REDUCTION))


def _split_blocks(blocks: list[Array], axis: Array) -> tuple[Array, list[Array]]:
    """Return the sum of the components along the axis, and the components perpendicular to it."""
    along = [np.outer(axis, axis @ block) for block in blocks]
    return np.sum(along, axis=0), [block - part for block, part in zip(blocks, along, strict=True)]


def _group(angles: Array, blocks: list[Array]) -> list[_Group]:
    groups = [_Group(np.zeros_like(angles[0]), np.zeros_like(blocks[0]))]
    known = np.zeros((len(angles) + 1, angles.shape[1]))
    for angle, block in zip(angles, blocks, strict=True):
        found = np.flatnonzero(np.all(np.abs(known[: len(groups)] - angle) <= REDUCTION, axis=1))
        if len(found):
            group = groups[int(found[0])]
            group.block = group.block + block
        else:
            known[len(groups)] = angle
            groups.append(_Group(angle, block))
    return groups


def _ordered(groups: list[_Group], last: _Group | None, scale: float) -> list[_Group]:
    """Leave out zero terms; put the angle of the rest of the chain at the end."""
    kept = [g for g in groups if _counts(g.block, scale)]
    if last is None:
        return kept
    first = [group for group in kept if not group.has(last.angle)]
    return [*first, next((group for group in kept if group.has(last.angle)), last)]


def _counts(block: Array, scale: float) -> bool:
    """Return whether an offset with its slides is nonzero by more than rounding."""
    return bool(np.any(np.abs(block[:, 0]) > REDUCTION * scale) or np.any(_moving(block)))


def _cleared(coefficients: Array) -> Array:
    """Return coefficients in which entries that are only rounding are zero."""
    return np.where(np.abs(coefficients) > REDUCTION, coefficients, 0.0)


def _moving(block: Array) -> Flags:
    return np.abs(block[:, 1:]) > REDUCTION


def drop_head(chain: Chain, projection: Array | None = None) -> Chain:
    """Reduce a chain and drop leading rotations that do not change the measured quantity.

    `|b_0 + R x| = |b_0 + x|` if b_0 is along the axis of R. A distance from a line stays the same if, in addition, this
    axis is the direction of the line. A height above a plane stays the same if R rotates about the normal, for any b_0.
    """
    chain = reduce_chain(chain)
    while chain.rotations and _turns_nothing(chain, projection):
        offsets, slides = chain.offsets[1:].copy(), chain.slides[1:].copy()
        offsets[0] += chain.offsets[0]
        slides[0] += chain.slides[0]
        chain = reduce_chain(Chain(offsets, slides, chain.axes[1:], chain.coefficients[1:], chain.scale))
    return chain if projection is None else _only_projected(chain, projection)


def _only_projected(chain: Chain, projection: Array) -> Chain:
    """Keep only the part that counts of the first block, which no rotation rotates."""
    offsets, slides = chain.offsets.copy(), chain.slides.copy()
    offsets[0] = projection.T @ (projection @ offsets[0])
    slides[0] = projection.T @ (projection @ slides[0])
    slides[0][np.abs(slides[0]) <= REDUCTION] = 0.0
    return replace(chain, offsets=offsets, slides=slides)


def _turns_nothing(chain: Chain, projection: Array | None) -> bool:
    if projection is not None:
        towards = projection[0] if len(projection) == 1 else np.cross(projection[0], projection[1])
        if not are_parallel(chain.axes[0], towards):
            return False
        if len(projection) == 1:
            return True
    block = np.column_stack((chain.offsets[0], chain.slides[0]))
    rest = _split_blocks([block], chain.axes[0])[1][0]
    return not _counts(rest, chain.scale)
