"""The reduced relative path, which every interpreter reads.

Between two marks there is a path in the tree: up from the link of a to the lowest common ancestor, and down to the link
of b. With folded constant rotations it is a chain (`path/chain.py`), reduced to the joints that can change the
distance.

A marked segment or box is a point on prismatic joints: while the chain is reduced, each of its parameters is one more
coordinate. Afterwards it is a *direction*, the derivative of the chain by this parameter. `docs/segments.md` derives
this.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from pinbound.annotations import Mark, Measure, Shape
from pinbound.exceptions import UnsupportedError
from pinbound.geometry.rotations import rotation_matrix
from pinbound.model.coupling import Coupling
from pinbound.model.tree import Tree
from pinbound.model.urdf import MOVING_TYPES, Joint
from pinbound.path.chain import Chain, HullChain, drop_head, reduce_chain, split
from pinbound.path.frames import best_frame
from pinbound.path.kind import Case, Form, Kind
from pinbound.path.several import has_several_angles
from pinbound.tolerances import REDUCTION
from pinbound.typing import Array
from pinbound.values import Value

__all__ = ["RelativePath", "absolute_chain", "direction_chain", "minimal_chain", "relative_path"]

_MOST_ROTATIONS = 3  # in a formula that fits a page
_CLOSED = 2  # directions up to which the nearest points have a closed form, over parallelograms


@dataclass(frozen=True, eq=False)
class RelativePath(Value):
    """The path between two marks, reduced.

    Attributes:
        kind: How the two links are related in the tree.
        ancestor: The lowest common ancestor link, without helper links.
        branch_a: `x_a(q)`, mark a in the ancestor's frame.
        branch_b: `x_b(q)`, mark b in the ancestor's frame; `r = x_a - x_b` is the paper's vector.
        difference: Chain and directions with the norm of r and the fewest coordinates and rotations.
        frame: Position i of `minimal` in whose frame the vector has the fewest rotated terms.
        projection: Rows that give the part of r that counts, in the frame at position 0: (2, 3) for a line, the part
            perpendicular to it; (1, 3) for a plane, the height. None: all of r.
        normal: Unit direction of the line, or normal of the plane, in the ancestor's frame; None without one.
        measure: The distance, the distance from a line, or the height above a plane.
        first_is_b: Whether the line or plane is mark b.
    """

    kind: Kind
    ancestor: str
    branch_a: HullChain
    branch_b: HullChain
    difference: HullChain
    frame: int
    projection: Array | None = None
    normal: Chain | None = None
    measure: Measure = Measure.DISTANCE
    first_is_b: bool = False

    @cached_property
    def case(self) -> Case:
        """The measured quantity."""
        if self.measure is not Measure.DISTANCE:
            return Case.LINE if self.measure is Measure.ACROSS else Case.PLANE
        return Case.BODIES if self.difference.directions else Case.POINTS

    @cached_property
    def form(self) -> Form:
        """How an interpreter computes the separation."""
        if self.difference.directions:
            closed = self.is_signed or (len(self.difference.directions) <= _CLOSED and self.difference.is_zonotope)
            return Form.PIECEWISE if closed else Form.SEARCHED
        chain = self.minimal
        if not chain.coordinates:
            return Form.CONSTANT
        turns_once = chain.rotations == 1 and not np.any(chain.slides)
        return Form.ONE_ANGLE if turns_once and self.case is not Case.LINE else Form.SMOOTH

    @property
    def turns_several(self) -> bool:
        """Whether it is proven, without reducing the path, that there are several effective angles."""
        return False

    @property
    def minimal(self) -> Chain:
        """The chain between the points of the two marks; for two points, this is the whole path."""
        return self.difference.chain

    @property
    def is_plain(self) -> bool:
        """Whether it is between two points."""
        return self.case is Case.POINTS

    @property
    def is_harmonic(self) -> bool:
        """Whether `|r|^2`, or the height, is `a + b cos phi + c sin phi` in all angles: points, a point and a plane."""
        return not self.difference.directions and self.case is not Case.LINE

    @property
    def constants(self) -> tuple[Array, ...]:
        """All arrays that the separation depends on, in a fixed order."""
        chain, difference, projection = self.minimal, self.difference, self.projection
        corners = () if difference.is_zonotope else difference.corners
        rows = () if projection is None else (projection,)
        return chain.offsets, chain.slides, chain.axes, chain.coefficients, *difference.directions, *corners, *rows

    def counted(self, r: Array) -> Array:
        """Return the part of vectors (..., 3) that counts, in the frame at position 0: three numbers, two, or one."""
        return r if self.projection is None else r @ self.projection.T

    def counted_of_each(self, parts: Sequence[Array]) -> tuple[Array, ...]:
        """Return the part that counts of vectors (N, 3, ...), such as derivatives, with components along axis 1."""
        if self.projection is None:
            return tuple(parts)
        return tuple(np.einsum("di,ni...->nd...", self.projection, part) for part in parts)

    def left_of(self, r: Any, along: Any) -> Any:
        """Return the part of r that counts, in the ancestor's frame, given its part along `normal`."""
        return along if self.case is Case.PLANE else r - along

    def height_row(self) -> Array:
        """Return the row (3,) whose product with r, in the frame at position 0, is the height above the plane."""
        assert self.projection is not None, "only a plane measures a height"
        return self.projection[0]

    @property
    def is_solid(self) -> bool:
        """Whether the marks span bodies that may overlap with a distance of zero: boxes, prisms, hulls.

        For a line, the projection of a body is an area, which two directions span.
        """
        spanned = {Case.BODIES: 3, Case.LINE: 2}.get(self.case, math.inf)
        return len(self.difference.directions) >= spanned

    @property
    def is_signed(self) -> bool:
        """Whether it measures a height above a plane, which may be negative, and not a distance."""
        return self.case is Case.PLANE

    @property
    def floor(self) -> float:
        """The smallest possible separation [m]: zero for a distance, minus infinity for a height."""
        return -math.inf if self.case is Case.PLANE else 0.0

    @property
    def is_expression(self) -> bool:
        """Whether the separation is a closed form over t in [0, 1]; boxes, prisms and hulls need an iteration."""
        return self.is_plain or (self.form is not Form.SEARCHED and self.difference.is_zonotope)

    @property
    def is_short(self) -> bool:
        """Whether its formula fits a page: points and segments with at most three rotations."""
        return self.difference.is_zonotope and self.minimal.rotations <= _MOST_ROTATIONS


def relative_path(tree: Tree, coupling: Coupling, a: Mark, b: Mark) -> RelativePath:
    """Derive the reduced relative path between two marks.

    Args:
        tree: The robot's tree.
        coupling: `theta = S q + o`.
        a: First mark.
        b: Second mark; at most one of the two may be a line or a plane.

    Returns:
        Kind, ancestor and reduced chains.

    Raises:
        UnsupportedError: If a floating or planar joint lies between the two links.
    """
    if not (a.shape.is_unbounded or b.shape.is_unbounded or tree.has_free_bodies):
        return _TracedLater.between(tree, coupling, a, b)
    return _traced(tree, coupling, a, b)


def _traced(tree: Tree, coupling: Coupling, a: Mark, b: Mark) -> RelativePath:
    ancestor = tree.common_ancestor(a.link, b.link)
    down = {mark.link: tree.descent(ancestor, mark.link) for mark in (a, b)}
    first = b if b.shape.is_unbounded else a
    projection = _projection(first.shape)
    minimal = _minimal(tree, coupling, a, b, projection)
    ends_at_ancestor = not _moves(down[b.link]) and _moves(down[a.link])
    return RelativePath(
        kind=_kind(tree, ancestor, a.link, b.link),
        ancestor=ancestor,
        branch_a=_branch(coupling, down[a.link], _placed(a, a, b), reach=a.shape.reach),
        branch_b=_branch(coupling, down[b.link], _placed(b, a, b), reach=b.shape.reach),
        difference=split(minimal, len(coupling.coordinates), (a.shape.corners, b.shape.corners)),
        frame=0 if projection is not None else best_frame(minimal, last_is_ancestor=ends_at_ancestor),
        projection=projection,
        normal=_normal(coupling, down[first.link], first.shape),
        measure=first.shape.measure,
        first_is_b=first is b,
    )


class _TracedLater(RelativePath):
    """The path between two bounded marks; each part of it is reduced when it is first needed."""

    @classmethod
    def between(cls, tree: Tree, coupling: Coupling, a: Mark, b: Mark) -> RelativePath:
        """Return the path; the tree has no joint with several coordinates."""
        path = object.__new__(cls)
        case = Case.POINTS if a.shape.is_point and b.shape.is_point else Case.BODIES
        path.__dict__.update(_source=(tree, coupling, a, b), projection=None, normal=None, case=case)
        path.__dict__.update(measure=Measure.DISTANCE, first_is_b=False)
        return path

    @property
    def turns_several(self) -> bool:
        """Whether there are certainly several; `replace` makes a path with all parts."""
        return "difference" not in self.__dict__ and self.case is Case.POINTS and has_several_angles(*self._source)

    def __getattr__(self, name: str) -> Any:
        """Reduce a missing part, and store it."""
        if "_source" not in self.__dict__ or name not in _PARTS:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        tree, coupling, a, b = self.__dict__["_source"]
        ancestor = tree.common_ancestor(a.link, b.link)
        if name == "difference":
            found: Any = minimal_chain(tree, coupling, a, b)
        elif name == "ancestor":
            found = ancestor
        elif name == "kind":
            found = _kind(tree, ancestor, a.link, b.link)
        elif name == "frame":
            moves = [_moves(tree.descent(ancestor, mark.link)) for mark in (a, b)]
            found = best_frame(self.minimal, last_is_ancestor=moves[0] and not moves[1])
        else:
            mark = a if name == "branch_a" else b
            down, placed = tree.descent(ancestor, mark.link), _placed(mark, a, b)
            found = _branch(coupling, down, placed, reach=mark.shape.reach)
        self.__dict__[name] = found
        return found


_PARTS = ("kind", "ancestor", "branch_a", "branch_b", "difference", "frame")


def minimal_chain(tree: Tree, coupling: Coupling, a: Mark, b: Mark) -> HullChain:
    """Return `relative_path(tree, coupling, a, b).difference` alone, in a third of the time.

    Raises:
        UnsupportedError: If a floating or planar joint lies between the two links.
    """
    projection = _projection(b.shape if b.shape.is_unbounded else a.shape)
    corners = a.shape.corners, b.shape.corners
    return split(_minimal(tree, coupling, a, b, projection), len(coupling.coordinates), corners)


def _minimal(tree: Tree, coupling: Coupling, a: Mark, b: Mark, projection: Array | None) -> Chain:
    ancestor = tree.common_ancestor(a.link, b.link)
    first, last = (b, a) if b.shape.is_unbounded else (a, b)  # a line or plane is constant where the walk starts
    down_first, down_last = tree.descent(ancestor, first.link), tree.descent(ancestor, last.link)
    shared = sum(x is y for x, y in zip(down_first, down_last, strict=False))
    between = _Builder(coupling)
    for joint in reversed(down_first[shared:]):
        between.up(joint)
    for joint in down_last[shared:]:
        between.down(joint)
    head, tail = (_placed(mark, a, b) for mark in (first, last))
    return drop_head(between.chain(tail, head, (last.shape.reach, first.shape.reach)), projection)


def _placed(mark: Mark, *both: Mark) -> Array:
    """Return a mark as columns (3, 1 + k): its point, and the directions of both marks, zero for the other mark."""
    directions = [one.shape.directions if one is mark else np.zeros_like(one.shape.directions) for one in both]
    return np.vstack((mark.shape.origin[None], *directions)).T


def _projection(first: Shape) -> Array | None:
    """Return the rows with which a line or plane measures r, the vector from the other mark to it."""
    unit = first.normal
    if unit is None:
        return None
    if first.measure is Measure.HEIGHT:
        return -unit[None]
    one: Any = np.cross(unit, np.eye(3)[int(np.argmin(np.abs(unit)))])
    one /= np.linalg.norm(one)
    other: Any = np.cross(unit, one)
    return np.stack((one, other))


def _branch(
    coupling: Coupling, joints: Sequence[Joint], placed: Array, held: bool = False, reach: float | None = None
) -> HullChain:
    """Return a point of the last joint's link and its directions (3, 1 + k), in the ancestor's frame."""
    builder = _Builder(coupling, held)
    for joint in joints:
        builder.down(joint)
    reaches = None if reach is None else (reach, 0.0)
    return split(reduce_chain(builder.chain(placed, reaches=reaches)), len(coupling.coordinates))


def _normal(coupling: Coupling, joints: Sequence[Joint], shape: Shape) -> Chain | None:
    if shape.normal is None:
        return None
    return _branch(coupling, joints, np.column_stack((np.zeros(3), shape.normal))).edges[0]


def absolute_chain(tree: Tree, coupling: Coupling, link: str, xyz: Sequence[float], reduced: bool = True) -> Chain:
    """Return the chain of a point's position in the root link's frame.

    A joint with several coordinates (floating, planar) is fixed at its origin, as in `Robot.model`.

    Args:
        tree: The robot's tree.
        coupling: `theta = S q + o`.
        link: The link that the point is fixed to.
        xyz: The point in the link's frame [m].
        reduced: False keeps one rotation for each joint, as in Eq. (5) of the paper.
    """
    builder = _Builder(coupling, held=True)
    for joint in tree.descent(tree.root, link):
        builder.down(joint)
    chain = builder.chain(np.array(xyz, dtype=np.float64)[:, None])
    return reduce_chain(chain) if reduced else chain


def direction_chain(tree: Tree, coupling: Coupling, link: str, unit: Sequence[float]) -> Chain:
    """Return the chain of a unit vector of a link in the root link's frame: rotations, no rounding by lengths.

    Joints with several coordinates are fixed at their origin, as in `absolute_chain`.
    """
    placed = np.column_stack((np.zeros(3), np.array(unit, dtype=np.float64)))
    edge = _branch(coupling, tree.descent(tree.root, link), placed, held=True).edges[0]
    return replace(edge, scale=1.0)


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
    """Collects joints along a path into a chain; constant rotations are folded into the terms after them."""

    def __init__(self, coupling: Coupling, held: bool = False) -> None:
        """Start at the frame of a link; joints with several coordinates are fixed at their origin, or refused."""
        self.coupling, self.held = coupling, held
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
            if self.held:
                return
            message = f"joint {joint.name!r} is {joint.type} and lies between the two points of a boundary"
            raise UnsupportedError(
                f"{message}; name points on one side of it, or model it by revolute and prismatic joints"
            )
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

    def chain(self, tail: Array, head: Array | None = None, reaches: tuple[float, float] | None = None) -> Chain:
        """Return the position of `tail` (3, 1 + k), or `head` minus it; k parameters follow the coordinates.

        `reaches` are bounds of the distances of tail and head from the origins of their links [m]; by default for all
        parameters in [0, 1].
        """
        if reaches is None:
            reaches = _farthest(tail), 0.0 if head is None else _farthest(head)
        n, k, more = self.slides[0].shape[1], len(self.axes), tail.shape[1] - 1
        blocks = np.zeros((k + 1, 3, 1 + n + more))
        blocks[:, :, 0], blocks[:, :, 1 : n + 1] = self.offsets, self.slides
        blocks[-1] += _columns(self.rotation @ tail, n)
        scale = self.scale + reaches[0]
        if head is not None:
            blocks = -blocks
            blocks[0] += _columns(head, n)
            scale += reaches[1]
        coefficients = np.zeros((k, n + more))
        if k:
            coefficients[:, :n] = self.coefficients
        axes = np.array(self.axes).reshape(k, 3)
        return Chain(blocks[:, :, 0], blocks[:, :, 1:], axes, coefficients, scale)


def _columns(placed: Array, n: int) -> Array:
    """Return a point and its directions as first and last columns, with the columns of n coordinates in between."""
    return np.hstack((placed[:, :1], np.zeros((3, n)), placed[:, 1:]))


def _farthest(placed: Array) -> float:
    """Return a bound of the distance of a point from the origin of its link, over all parameters [m]."""
    return float(np.linalg.norm(placed[:, 0]) + np.linalg.norm(placed[:, 1:], axis=0).sum())
