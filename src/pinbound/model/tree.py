"""The tree of links: ancestors, paths, and the helper links that do not count for boundaries."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pinbound.model.coupling import Coupling
from pinbound.model.urdf import Joint, Kinematics, Link
from pinbound.tolerances import REDUCTION
from pinbound.typing import Array
from pinbound.values import FrozenDict, read_only

__all__ = ["MANY_DEGREES", "Tree"]

MANY_DEGREES = 3
"""Links with at least this many degrees of freedom between them have no neighbours behind them."""

_Vector = Array
_Line = tuple[Joint, float, _Vector, _Vector, float]
"""A joint, its sign, its axis and a point on it (3,) each, and the length of the path up to it [m]."""

_CLEARLY = 1e-6
"""Far above `REDUCTION`: axes that differ by at least this, as directions or relative to their positions, are
different."""

_TURNING = ("revolute", "continuous")
_FREEDOMS = {"planar": 3, "floating": 6}


@dataclass(frozen=True, eq=False)
class _Own:
    """The joint that moves a link: the link above it, the number of joints above, its axis and a point on it."""

    above: str
    depth: int
    axis: _Vector
    place: _Vector


@dataclass(frozen=True)
class Tree:
    """Links and joints of one robot, and which links have marks.

    Attributes:
        kinematics: The checked links and joints.
        marked_links: Links that have a mark; these are never helpers.

    Example:
        >>> from pinbound.model.document import packaged_robots, read_document
        >>> from pinbound.exceptions import Problems
        >>> from pinbound.model.urdf import read_kinematics
        >>> document = read_document("minervabot_v3")
        >>> tree = Tree(read_kinematics(document, Problems(document.label)))
        >>> tree.common_ancestor("link_3", "link_16")
        'link_2'
        >>> sorted(tree.helpers)
        ['drive_rod_level', 'level']
    """

    kinematics: Kinematics
    marked_links: Collection[str] = frozenset()

    def __post_init__(self) -> None:
        """Copy the names of marked links."""
        object.__setattr__(self, "marked_links", frozenset(self.marked_links))

    @cached_property
    def links(self) -> FrozenDict[str, Link]:
        """Links by name, in file order."""
        return FrozenDict({link.name: link for link in self.kinematics.links})

    @cached_property
    def parent_joint(self) -> FrozenDict[str, Joint]:
        """The joint above each link; the root has none."""
        return FrozenDict({joint.child: joint for joint in self.kinematics.joints})

    @cached_property
    def children(self) -> FrozenDict[str, tuple[Joint, ...]]:
        """The joints below each link, sorted by name: the order in which Pinocchio visits them."""
        children: dict[str, list[Joint]] = {name: [] for name in self.links}
        for joint in sorted(self.kinematics.joints, key=lambda joint: joint.name):
            children[joint.parent].append(joint)
        return FrozenDict({name: tuple(joints) for name, joints in children.items()})

    @cached_property
    def root(self) -> str:
        """The link without a parent."""
        return next(name for name in self.links if name not in self.parent_joint)

    def walk(self) -> Iterator[tuple[Link, Joint | None, int]]:
        """Yield each link with the joint above it and its depth, depth first, siblings by joint name."""
        stack: list[tuple[str, Joint | None, int]] = [(self.root, None, 0)]
        while stack:
            name, joint, depth = stack.pop()
            yield self.links[name], joint, depth
            stack += [(below.child, below, depth + 1) for below in reversed(self.children[name])]

    @cached_property
    def moving_joints(self) -> tuple[Joint, ...]:
        """Joints with one coordinate, in the order of `robot.model`."""
        return tuple(joint for _, joint, _ in self.walk() if joint is not None and joint.moves)

    @cached_property
    def has_free_bodies(self) -> bool:
        """Whether there is a joint of several coordinates: floating or planar."""
        return any(joint.type in _FREEDOMS for joint in self.kinematics.joints)

    @cached_property
    def length(self) -> float:
        """The sum of the lengths of all joints' origins [m]."""
        return sum(float(np.linalg.norm(joint.translation)) for joint in self.kinematics.joints)

    @cached_property
    def frames_at_zero(self) -> FrozenDict[str, _Vector]:
        """The placement of each link with all joints at zero (3, 4), in the root link's frame."""
        found: dict[str, _Vector] = {}
        for link, joint, _ in self.walk():
            if joint is None:
                found[link.name] = np.eye(3, 4)
                continue
            turned, place = found[joint.parent][:, :3], found[joint.parent][:, 3]
            found[link.name] = np.column_stack((turned @ joint.rotation, place + turned @ joint.translation))
        return FrozenDict({name: read_only(frame) for name, frame in found.items()})

    @cached_property
    def lines_at_zero(self) -> FrozenDict[str, tuple[_Vector, _Vector]]:
        """The axis (3,) of each joint, and a point on it, in the root link's frame, with all joints at zero."""
        frames = self.frames_at_zero
        lines = {
            joint.name: (frames[joint.child][:, :3] @ joint.axis, frames[joint.child][:, 3])
            for joint in self.kinematics.joints
        }
        return FrozenDict({name: (read_only(axis), place) for name, (axis, place) in lines.items()})

    @cached_property
    def helpers(self) -> frozenset[str]:
        """Links whose only purpose is a second joint at the same place.

        A helper has no inertia, no geometry, no mark, a joint above and joints below. It is connected at zero offset:
        either its own joint or all joints below it have a zero origin.
        """
        return frozenset(name for name in self.links if self._is_helper(name))

    def _is_helper(self, name: str) -> bool:
        link, above, below = self.links[name], self.parent_joint.get(name), self.children[name]
        if link.has_inertia or link.has_geometry or name in self.marked_links or above is None or not below:
            return False
        return not np.any(above.translation) or not any(np.any(joint.translation) for joint in below)

    def lineage(self, link: str) -> list[str]:
        """Return the links from `link` up to the root, both included."""
        names = [link]
        while names[-1] in self.parent_joint:
            names.append(self.parent_joint[names[-1]].parent)
        return names

    def visible_lineage(self, link: str) -> list[str]:
        """Return the lineage without helper links (the link itself stays)."""
        return [name for name in self.lineage(link) if name == link or name not in self.helpers]

    def common_ancestor(self, link_a: str, link_b: str) -> str:
        """Return the lowest link (helpers do not count) from which both links descend, or that is one of them."""
        above_b = set(self.visible_lineage(link_b))
        return next(name for name in self.visible_lineage(link_a) if name in above_b)

    def descent(self, ancestor: str, link: str) -> list[Joint]:
        """Return the joints from `ancestor` down to `link`, in that order."""
        joints: list[Joint] = []
        while link != ancestor:
            joint = self.parent_joint[link]
            joints.append(joint)
            link = joint.parent
        return joints[::-1]

    def path_between(self, link_a: str, link_b: str) -> list[Joint]:
        """Return the joints between two links: up from `link_a`, then down to `link_b`."""
        above_b = set(self.lineage(link_b))
        meeting = next(name for name in self.lineage(link_a) if name in above_b)
        return [*reversed(self.descent(meeting, link_a)), *self.descent(meeting, link_b)]

    def motions_between(self, link_a: str, link_b: str, branches: bool = False) -> list[list[tuple[Joint, float]]]:
        """Return the moving joints between two links; joints that rotate about one axis at one point are grouped.

        Two rotations that follow each other down (or up) the tree at one point about one axis are one rotation by the
        sum of their angles, each with the returned sign. The elbow of a parallelogram arm is an example: `-q2` and `q3`
        rotate the forearm by `q3 - q2` relative to the upper arm. Two links on one common link that rotate about the
        same axis are two motions, unless `branches` is set. A planar or floating joint is a motion of its own, and so
        is each prismatic joint.
        """
        return _merged(self._axes_between(link_a, link_b), branches)

    def _axes_between(self, link_a: str, link_b: str) -> Iterator[_Line]:
        """Yield each moving joint from a to b: joint, sign, axis and point in a's frame at zero, length so far."""
        above_b = set(self.lineage(link_b))
        meeting = next(name for name in self.lineage(link_a) if name in above_b)
        rotation, place, scale = np.eye(3), np.zeros(3), 0.0
        for joint in reversed(self.descent(meeting, link_a)):
            if joint.type != "fixed":
                yield joint, -1.0, rotation @ joint.axis, place, scale
            rotation = rotation @ joint.rotation.T
            place = place - rotation @ joint.translation
            scale += float(np.linalg.norm(joint.translation))
        for joint in self.descent(meeting, link_b):
            place = place + rotation @ joint.translation
            rotation = rotation @ joint.rotation
            scale += float(np.linalg.norm(joint.translation))
            if joint.type != "fixed":
                yield joint, 1.0, rotation @ joint.axis, place, scale

    def degrees_between(self, link_a: str, link_b: str, coupling: Coupling | None = None) -> int:
        """Return how many degrees of freedom lie between two links; 0: they never move relative to each other.

        Each of the motions of `motions_between` is one, a planar joint three, a floating joint six.

        Args:
            link_a: One link.
            link_b: The other.
            coupling: `theta = S q + o`; with it, motions that no coordinate moves do not count: a mimic joint of
                multiplier 0, or rotations that cancel.

        Example:
            >>> import pinbound as pb
            >>> robot = pb.load("minervabot_v3")
            >>> [robot.tree.degrees_between("link_2", name) for name in ("link_1", "link_3", "link_21", "link_6")]
            [1, 1, 1, 2]
        """
        lines = list(self._axes_between(link_a, link_b))
        if coupling is not None and not any(self._freedoms(motion, coupling) for motion in _merged(lines, True)):
            return 0
        return sum(self._freedoms(motion, coupling) for motion in _merged(lines, False))

    def degrees_nearby(self, coupling: Coupling) -> dict[frozenset[str], int]:
        """Return `degrees_between` of links that are near each other in the tree; all other pairs have at least two.

        Links behind a link with `MANY_DEGREES` of them have at most one less: only the motion that is divided at this
        link can be cancelled behind it, by rotations about the same axis, and it counts as two if the chain goes up and
        down again.
        """
        held = self._held  # links connected by fixed joints have the same degrees to all others
        beside: dict[str, list[str]] = {name: [] for name in self.links}
        members: dict[str, list[str]] = {}
        for joint in self.kinematics.joints:
            if joint.type != "fixed":
                beside[held[joint.parent]].append(joint.child)
                beside[joint.child].append(held[joint.parent])
        for name in self.links:
            members.setdefault(held[name], []).append(name)
        near: dict[frozenset[str], int] = {}
        straight: dict[tuple[str, str], int] = {}
        for start in members:
            near[frozenset((start,))] = 0
            ways = [(start, name) for name in beside[start]]
            while ways:
                before, name = ways.pop()
                pair = frozenset((start, name))
                if pair not in near:
                    near[pair] = self._degrees_over(start, name, coupling, straight)
                if near[pair] < MANY_DEGREES:
                    ways += [(name, further) for further in beside[name] if further != before]
        return {
            frozenset((a, b)): degrees
            for pair, degrees in near.items()
            for a in members[min(pair)]
            for b in members[max(pair)]
            if a != b
        }

    def _degrees_over(self, one: str, other: str, coupling: Coupling, straight: dict[tuple[str, str], int]) -> int:
        """Return `degrees_between`; if two branches start with clearly different axes, it is the sum of both branches.

        Only joints of one branch are grouped, and rotations of both branches cancel only about the same axis. So for a
        floor with hundreds of arms, each arm is computed once (`straight`), not each pair of arms.
        """
        lines, ends = self._own_lines, [one, other]
        last: list[str | None] = [None, None]
        while ends[0] != ends[1]:
            side = int(lines[ends[0]].depth < lines[ends[1]].depth)
            last[side], ends[side] = ends[side], lines[ends[side]].above
        if last[0] is None or last[1] is None:
            return self.degrees_between(one, other, coupling)
        x, y = lines[last[0]], lines[last[1]]
        far = _CLEARLY * (1.0 + float(np.linalg.norm(x.place) + np.linalg.norm(y.place)))
        is_near = math.dist(x.place.tolist(), y.place.tolist()) <= far
        if is_near and np.linalg.norm(np.cross(x.axis, y.axis)) <= _CLEARLY:
            return self.degrees_between(one, other, coupling)
        for name in (one, other):
            if (ends[0], name) not in straight:
                straight[ends[0], name] = self.degrees_between(ends[0], name, coupling)
        return straight[ends[0], one] + straight[ends[0], other]

    @cached_property
    def _own_lines(self) -> dict[str, _Own]:
        """The joint that moves each topmost link of `_held`; for the root there is none."""
        frames: dict[str, tuple[_Vector, _Vector]] = {}
        found: dict[str, _Own] = {}
        for link, joint, _ in self.walk():
            rotation, place, nothing = np.eye(3), np.zeros(3), np.zeros(3)
            if joint is not None:
                rotation, place = frames[joint.parent]
                place, rotation = place + rotation @ joint.translation, rotation @ joint.rotation
            if joint is None:
                found[link.name] = _Own("", 0, nothing, nothing)
            elif joint.type != "fixed":
                above = self._held[joint.parent]
                found[link.name] = _Own(above, found[above].depth + 1, rotation @ joint.axis, place)
                rotation, place = np.eye(3), nothing
            frames[link.name] = rotation, place
        return found

    @cached_property
    def _held(self) -> dict[str, str]:
        """For each link, the topmost link to which only fixed joints connect it."""
        found: dict[str, str] = {}
        for link, joint, _ in self.walk():
            found[link.name] = found[joint.parent] if joint is not None and joint.type == "fixed" else link.name
        return found

    @staticmethod
    def _freedoms(motion: list[tuple[Joint, float]], coupling: Coupling | None) -> int:
        joint = motion[0][0]
        if coupling is None or not joint.moves:
            return _FREEDOMS.get(joint.type, 1)
        rows = [sign * coupling.row(one.name)[0] for one, sign in motion]
        total = rows[0] if len(rows) == 1 else np.sum(rows, axis=0)
        return int(max(float(total.max(initial=0.0)), -float(total.min(initial=0.0))) > REDUCTION)


def _merged(lines: Iterable[_Line], branches: bool) -> list[list[tuple[Joint, float]]]:
    """Return joints with their signs; consecutive ones that rotate about one axis at one point are grouped."""
    found: list[list[tuple[Joint, float]]] = []
    last: _Line | None = None
    for line in lines:
        joint, sign, axis, _, _ = line
        if joint.type not in _TURNING:
            found.append([(joint, sign)])
            last = None
        elif last is not None and (branches or last[1] == sign) and _same_axis(last, line):
            found[-1].append((joint, sign * float(np.sign(axis @ last[2]))))
        else:
            found.append([(joint, sign)])
            last = line
    return found


def _same_axis(first: _Line, second: _Line) -> bool:
    """Return whether two axes are parallel and pass through the same origin, up to the rounding of folded constants."""
    (a, b, c), (x, y, z) = first[2].tolist(), second[2].tolist()
    if max(abs(b * z - c * y), abs(c * x - a * z), abs(a * y - b * x)) > REDUCTION:
        return False
    return math.dist(first[3].tolist(), second[3].tolist()) <= REDUCTION * second[4]
