"""The tree of links: ancestors, paths, and the helper links that a boundary does not see."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pinbound.urdf import Joint, Kinematics, Link

__all__ = ["Tree"]


@dataclass(frozen=True)
class Tree:
    """Links and joints of one robot, with the marked links known.

    Attributes:
        kinematics: The checked links and joints.
        marked_links: Links that carry a marked point; these are never helpers.

    Example:
        >>> from pinbound.document import packaged_robots, read_document
        >>> from pinbound.exceptions import Problems
        >>> from pinbound.urdf import read_kinematics
        >>> document = read_document("minervabot_v3")
        >>> tree = Tree(read_kinematics(document, Problems(document.label)))
        >>> tree.common_ancestor("link_3", "link_16")
        'link_2'
        >>> sorted(tree.helpers)
        ['drive_rod_level', 'level']
    """

    kinematics: Kinematics
    marked_links: Collection[str] = ()

    @cached_property
    def links(self) -> dict[str, Link]:
        """Links by name, in file order."""
        return {link.name: link for link in self.kinematics.links}

    @cached_property
    def parent_joint(self) -> dict[str, Joint]:
        """The joint above each link; the root has none."""
        return {joint.child: joint for joint in self.kinematics.joints}

    @cached_property
    def children(self) -> dict[str, list[Joint]]:
        """The joints below each link, sorted by name: the order in which Pinocchio visits them."""
        children: dict[str, list[Joint]] = {name: [] for name in self.links}
        for joint in sorted(self.kinematics.joints, key=lambda joint: joint.name):
            children[joint.parent].append(joint)
        return children

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
    def helpers(self) -> frozenset[str]:
        """Links that only carry a second joint at one place.

        A helper has no inertia, no geometry, no marked point, a joint above and joints below, and is joined at
        zero offset: either its own joint or all joints below it have a zero origin.
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
        """Return the lowest link, helpers aside, from which both links descend (or that is one of them)."""
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

    def are_adjacent(self, link_a: str, link_b: str) -> bool:
        """Return whether one moving joint connects two links, fixed joints and helper links between aside."""
        moving = [joint for joint in self.path_between(link_a, link_b) if joint.type != "fixed"]
        hidden = sum(joint.child in self.helpers for joint in moving)
        return len(moving) - hidden == 1
