"""The reduced relative path: the one idea that every interpreter reads.

Between two marked points lies a path in the tree. With constant rotations folded away it is a chain

    r(q) = b_0 + R_1( b_1 + R_2( b_2 + ... R_k b_k ) ),   R_i = R(u_i, c_i . q),   b_i = s_i + L_i q,

of rotations about constant axes and of offsets, in which L_i is zero unless joints slide. `docs/relative-path.md`
derives the chain and proves that each step below preserves its value (or, where said, its norm).
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from pinbound.annotations import Point
from pinbound.coupling import Coupling
from pinbound.exceptions import UnsupportedError
from pinbound.tolerances import REDUCTION
from pinbound.tree import Tree
from pinbound.urdf import MOVING_TYPES, Joint

__all__ = [
    "Chain",
    "Kind",
    "RelativePath",
    "absolute_chain",
    "are_parallel",
    "relative_path",
    "rotation_matrix",
]

Array = NDArray[np.float64]


class Kind(Enum):
    """How two links lie to each other in the tree, helper links aside."""

    CONSECUTIVE = "consecutive"
    NON_CONSECUTIVE = "non-consecutive"
    BRANCHED = "branched"
    COINCIDENT_BRANCHED = "coincident branched"


@dataclass(frozen=True)
class Chain:
    """`b_0 + R_1(b_1 + R_2(b_2 + ...))` with k rotations, over n active coordinates.

    Attributes:
        offsets: (k + 1, 3) [m], the s_i.
        slides: (k + 1, 3, n), the L_i [m per unit of q].
        axes: (k, 3) unit vectors u_i.
        coefficients: (k, n), the c_i; in a reduced chain no row is zero, and no two neighbours are parallel
            unless their offset lies between them.
        scale: Metres; the length of the path before reduction, against which rounding is judged.
    """

    offsets: Array
    slides: Array
    axes: Array
    coefficients: Array
    scale: float

    def __post_init__(self) -> None:
        """Make the value immutable."""
        for array in (self.offsets, self.slides, self.axes, self.coefficients):
            array.flags.writeable = False

    @property
    def rotations(self) -> int:
        """The number k of rotations."""
        return len(self.axes)

    @property
    def coordinates(self) -> tuple[int, ...]:
        """Indices of the active coordinates that occur."""
        used = np.any(self.coefficients, axis=0) | np.any(self.slides, axis=(0, 1))
        return tuple(int(index) for index in np.flatnonzero(used))

    @property
    def is_planar(self) -> bool:
        """Whether all rotations are about one direction."""
        return all(are_parallel(self.axes[0], axis) for axis in self.axes[1:])


@dataclass(frozen=True)
class RelativePath:
    """The path between two marked points, reduced.

    Attributes:
        kind: How the two links lie to each other.
        ancestor: The lowest common ancestor link, helpers aside.
        branch_a: `x_a(q)`, point a in the ancestor's frame.
        branch_b: `x_b(q)`, point b in the ancestor's frame; `r = x_a - x_b` is the paper's vector.
        minimal: A chain of the same norm as r in which the fewest coordinates and rotations are left.
        frame: Position i of `minimal` in whose frame the vector has the fewest rotated terms.
    """

    kind: Kind
    ancestor: str
    branch_a: Chain
    branch_b: Chain
    minimal: Chain
    frame: int


def rotation_matrix(axis: Array, angle: float) -> Array:
    """Return Rodrigues' rotation (3, 3) about a unit axis; exactly the identity for angle 0.

    Example:
        >>> rotation_matrix(np.array([0.0, 1.0, 0.0]), np.pi / 2).round(12) @ [0.0, 0.0, 1.0]
        array([1., 0., 0.])
    """
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * cross + 2.0 * np.sin(angle / 2) ** 2 * (cross @ cross)


def are_parallel(u: Array, v: Array) -> bool:
    """Return whether two unit vectors span one line, up to the rounding of folded constants."""
    (a, b, c), (x, y, z) = u.tolist(), v.tolist()
    return max(abs(b * z - c * y), abs(c * x - a * z), abs(a * y - b * x)) <= REDUCTION


def relative_path(tree: Tree, coupling: Coupling, a: Point, b: Point) -> RelativePath:
    """Derive the reduced relative path between two marked points.

    Args:
        tree: The robot's tree.
        coupling: `theta = S q + o`.
        a: First point.
        b: Second point.

    Returns:
        Kind, ancestor and reduced chains.

    Raises:
        UnsupportedError: If a floating or planar joint lies between the two links.
    """
    ancestor = tree.common_ancestor(a.link, b.link)
    down_a, down_b = tree.descent(ancestor, a.link), tree.descent(ancestor, b.link)
    builder_a, builder_b, between = _Builder(coupling), _Builder(coupling), _Builder(coupling)
    for joint in down_a:
        builder_a.down(joint)
    for joint in down_b:
        builder_b.down(joint)
    shared = sum(x is y for x, y in zip(down_a, down_b, strict=False))
    for joint in reversed(down_a[shared:]):
        between.up(joint)
    for joint in down_b[shared:]:
        between.down(joint)
    minimal = _drop_head(between.chain(np.array(b.xyz), np.array(a.xyz)))
    return RelativePath(
        kind=_kind(tree, ancestor, a.link, b.link),
        ancestor=ancestor,
        branch_a=_reduce(builder_a.chain(np.array(a.xyz))),
        branch_b=_reduce(builder_b.chain(np.array(b.xyz))),
        minimal=minimal,
        frame=_best_frame(minimal, last_is_ancestor=not _moves(down_b) and _moves(down_a)),
    )


def absolute_chain(tree: Tree, coupling: Coupling, point: Point) -> Chain:
    """Return the chain of a point's position in the root link's frame.

    Raises:
        UnsupportedError: If a floating or planar joint lies between.
    """
    builder = _Builder(coupling)
    for joint in tree.descent(tree.root, point.link):
        builder.down(joint)
    return _reduce(builder.chain(np.array(point.xyz)))


def _moves(joints: list[Joint]) -> bool:
    return any(joint.moves for joint in joints)


def _kind(tree: Tree, ancestor: str, link_a: str, link_b: str) -> Kind:
    branches = [tree.visible_lineage(link) for link in (link_a, link_b)]
    depths = [branch.index(ancestor) for branch in branches]
    if min(depths) == 0:
        return Kind.CONSECUTIVE if max(depths) <= 1 else Kind.NON_CONSECUTIVE
    first = [branch[depth - 1] for branch, depth in zip(branches, depths, strict=True)]
    offsets = [_offset_at_zero(tree, ancestor, link) for link in first]
    scale = max(float(np.linalg.norm(offset)) for offset in offsets)
    coincident = float(np.linalg.norm(offsets[0] - offsets[1])) <= REDUCTION * scale
    return Kind.COINCIDENT_BRANCHED if coincident else Kind.BRANCHED


def _offset_at_zero(tree: Tree, ancestor: str, link: str) -> Array:
    """Return the origin of a link's joint in the ancestor's frame; helper links between have zero offsets."""
    position, rotation = np.zeros(3), np.eye(3)
    for joint in tree.descent(ancestor, link):
        position, rotation = position + rotation @ joint.translation, rotation @ joint.rotation
    return position


class _Builder:
    """Collect joints along a path into a chain, constant rotations folded into what follows them."""

    def __init__(self, coupling: Coupling) -> None:
        self.coupling = coupling
        self.rotation = np.eye(3)
        n = len(coupling.coordinates)
        self.offsets: list[Array] = [np.zeros(3)]
        self.slides: list[Array] = [np.zeros((3, n))]
        self.axes: list[Array] = []
        self.coefficients: list[Array] = []
        self.scale = 0.0

    def down(self, joint: Joint) -> None:
        """Step from parent to child: origin, then motion."""
        self._constant(joint.rotation, joint.translation)
        self._motion(joint, 1.0)

    def up(self, joint: Joint) -> None:
        """Step from child to parent: inverse motion, then inverse origin."""
        self._motion(joint, -1.0)
        self._constant(joint.rotation.T, -joint.rotation.T @ joint.translation)

    def _constant(self, rotation: Array, translation: Array) -> None:
        self.scale += float(np.linalg.norm(translation))
        self.offsets[-1] = self.offsets[-1] + self.rotation @ translation
        self.rotation = self.rotation @ rotation

    def _motion(self, joint: Joint, sign: float) -> None:
        if joint.type == "fixed":
            return
        if joint.type not in MOVING_TYPES:
            message = f"joint {joint.name!r} is {joint.type} and lies between the two points of a boundary"
            raise UnsupportedError(f"{message}; take points on one side of it, or model it by single joints")
        coefficients, offset = self.coupling.row(joint.name)
        axis = self.rotation @ joint.axis
        if joint.type == "prismatic":
            self.slides[-1] = self.slides[-1] + sign * np.outer(axis, coefficients)
            self.offsets[-1] = self.offsets[-1] + axis * (sign * offset)
            self.scale += abs(offset)
            return
        self.axes.append(axis)
        self.coefficients.append(sign * coefficients)
        self.offsets.append(np.zeros(3))
        self.slides.append(np.zeros_like(self.slides[0]))
        if offset:
            self.rotation = self.rotation @ rotation_matrix(joint.axis, sign * offset)

    def chain(self, tail: Array, head: Array | None = None) -> Chain:
        """Return the position of `tail`, or `head` minus it."""
        offsets = np.array([*self.offsets[:-1], self.offsets[-1] + self.rotation @ tail])
        slides, scale = np.array(self.slides), self.scale + float(np.linalg.norm(tail))
        if head is not None:
            offsets, slides, scale = -offsets, -slides, scale + float(np.linalg.norm(head))
            offsets[0] += head
        n = slides.shape[2]
        k = len(self.axes)
        axes, coefficients = np.array(self.axes).reshape(k, 3), np.array(self.coefficients).reshape(k, n)
        return Chain(offsets, slides, axes, coefficients, scale)


def _reduce(chain: Chain) -> Chain:
    """Collect parallel rotations until nothing changes; the value of the chain stays."""
    while True:
        before = chain.rotations
        chain = _collect_runs(chain)
        if chain.rotations == before:
            return chain


def _collect_runs(chain: Chain) -> Chain:
    """Rewrite each maximal run of parallel rotations as a sum over its distinct angles, and nest that again.

    In a run, `R(g_1) b_1 + ... + R(g_m) (b_m + rest)` with cumulative angles g. Offsets under one angle add up,
    components along the axis and offsets under no angle leave the run, zero offsets vanish.
    """
    blocks = [np.column_stack((s, L)) for s, L in zip(chain.offsets, chain.slides, strict=True)]
    out_blocks, out_axes, out_coefficients = [blocks[0]], list[Array](), list[Array]()
    start = 0
    while start < chain.rotations:
        axis, stop = chain.axes[start], start + 1
        while stop < chain.rotations and are_parallel(axis, chain.axes[stop]):
            stop += 1
        signs = np.sign(chain.axes[start:stop] @ axis)
        angles = np.cumsum(signs[:, None] * chain.coefficients[start:stop], axis=0)
        along, across = _split_blocks(blocks[start + 1 : stop + 1], axis)
        out_blocks[-1] = out_blocks[-1] + along
        groups = _group(angles, across)
        last = _Group(angles[-1], np.zeros_like(across[0])) if stop < chain.rotations else None
        previous = np.zeros(chain.coefficients.shape[1])
        for group in _ordered(groups, last, chain.scale):
            step = group.angle - previous
            if np.any(np.abs(step) > REDUCTION):
                out_axes.append(axis)
                out_coefficients.append(np.where(np.abs(step) > REDUCTION, step, 0.0))
                out_blocks.append(group.block)
            else:
                out_blocks[-1] = out_blocks[-1] + group.block
            previous = group.angle
        start = stop
    stacked = np.array(out_blocks)
    n = chain.coefficients.shape[1]
    k = len(out_axes)
    axes, coefficients = np.array(out_axes).reshape(k, 3), np.array(out_coefficients).reshape(k, n)
    return Chain(stacked[:, :, 0].copy(), stacked[:, :, 1:].copy(), axes, coefficients, chain.scale)


@dataclass
class _Group:
    """The offsets of a run that turn by one angle `c . q`."""

    angle: Array
    block: Array

    def has(self, angle: Array) -> bool:
        return bool(np.all(np.abs(self.angle - angle) <= REDUCTION))


def _split_blocks(blocks: list[Array], axis: Array) -> tuple[Array, list[Array]]:
    """Return the sum of the components along the axis, and the components across it."""
    along = [np.outer(axis, axis @ block) for block in blocks]
    return np.sum(along, axis=0), [block - part for block, part in zip(blocks, along, strict=True)]


def _group(angles: Array, blocks: list[Array]) -> list[_Group]:
    groups = [_Group(np.zeros_like(angles[0]), np.zeros_like(blocks[0]))]
    for angle, block in zip(angles, blocks, strict=True):
        known = next((group for group in groups if group.has(angle)), None)
        if known is None:
            groups.append(_Group(angle, block))
        else:
            known.block = known.block + block
    return groups


def _ordered(groups: list[_Group], last: _Group | None, scale: float) -> list[_Group]:
    """Leave out what is zero; put the angle under which the rest of the chain stands at the end."""
    kept = [g for g in groups if np.any(np.abs(g.block[:, 0]) > REDUCTION * scale) or np.any(_moving(g.block))]
    if last is None:
        return kept
    first = [group for group in kept if not group.has(last.angle)]
    return [*first, next((group for group in kept if group.has(last.angle)), last)]


def _moving(block: Array) -> NDArray[np.bool_]:
    return np.abs(block[:, 1:]) > REDUCTION


def _drop_head(chain: Chain) -> Chain:
    """Drop leading rotations that turn nothing: `|b_0 + R x| = |b_0 + x|` if b_0 lies along R's axis."""
    chain = _reduce(chain)
    while chain.rotations:
        block = np.column_stack((chain.offsets[0], chain.slides[0]))
        across = _split_blocks([block], chain.axes[0])[1][0]
        if np.any(np.abs(across[:, 0]) > REDUCTION * chain.scale) or np.any(_moving(across)):
            break
        offsets, slides = chain.offsets[1:].copy(), chain.slides[1:].copy()
        offsets[0] += chain.offsets[0]
        slides[0] += chain.slides[0]
        chain = _reduce(Chain(offsets, slides, chain.axes[1:].copy(), chain.coefficients[1:].copy(), chain.scale))
    return chain


def _best_frame(chain: Chain, last_is_ancestor: bool) -> int:
    """Return the position in whose frame the fewest offsets are rotated, then the fewest coordinates occur.

    Between equals an end of the chain that does not turn in the ancestor's frame wins, and then the first.
    """
    k = chain.rotations

    def cost(position: int) -> tuple[int, int, bool, int]:
        rotated = coordinates = 0
        for index, offset in enumerate(chain.offsets):
            if index != position and (np.any(offset) or np.any(chain.slides[index])):
                span = slice(min(index, position), max(index, position))
                turning = _count_coordinates(chain.axes[span], chain.coefficients[span])
                rotated += turning > 0
                coordinates += turning
        return rotated, coordinates, last_is_ancestor and position != k, position

    return min(range(k + 1), key=cost)


def _count_coordinates(axes: Array, coefficients: Array) -> int:
    """Count the coordinates in the angles between two positions, neighbours about one direction merged."""
    count, start = 0, 0
    while start < len(axes):
        stop, total = start, np.zeros(coefficients.shape[1])
        while stop < len(axes) and are_parallel(axes[start], axes[stop]):
            total = total + np.sign(axes[start] @ axes[stop]) * coefficients[stop]
            stop += 1
        count += int(np.count_nonzero(np.abs(total) > REDUCTION))
        start = stop
    return count
