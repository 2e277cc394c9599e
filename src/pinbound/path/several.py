"""A proof, without reducing a path, that its distance depends on several effective angles, as for most long paths.

Let every joint between two points have its own coordinate. Then no angles cancel, and neighbouring rotations become one
only if they are parallel. The reduction drops a rotation at an end of the chain only if the point at that end is on its
axis. So let i be the first joint from point a whose axis does not contain a, and k the first such joint from point b.
If i comes before k, and two neighbours from i to k are not parallel, then rotations on both sides of them remain.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from pinbound.annotations import Mark
from pinbound.model.coupling import Coupling
from pinbound.model.tree import Tree
from pinbound.tolerances import PLACED, REDUCTION
from pinbound.typing import Array

__all__ = ["has_several_angles"]


def has_several_angles(tree: Tree, coupling: Coupling, a: Mark, b: Mark) -> bool:
    """Return whether the distance of two points is proven to depend on several angles; False proves nothing.

    Example:
        >>> import pinbound as pb
        >>> robot = pb.load("minervabot_v3")
        >>> marks = robot.annotations.marks
        >>> has_several_angles(robot.tree, robot.coupling, marks["o7"], marks["o8"])
        False
    """
    joints = [joint for joint in tree.path_between(a.link, b.link) if joint.type != "fixed"]
    columns = [coupling.own.get(joint.name, -1) for joint in joints]
    if len(joints) < 2 or min(columns) < 0 or len(set(columns)) < len(columns):
        return False
    if any(joint.type not in ("revolute", "continuous") for joint in joints):
        return False
    frames = tree.frames_at_zero
    ends = [frames[mark.link][:, :3] @ mark.shape.origin + frames[mark.link][:, 3] for mark in (a, b)]
    lines = [tree.lines_at_zero[joint.name] for joint in joints]
    scale = 1.0 + tree.length + a.shape.reach + b.shape.reach
    first, last = _first_off(ends[0], lines, scale), _first_off(ends[1], lines[::-1], scale)
    if first is None or last is None:
        return False
    between = [axis for axis, _ in lines[first : len(lines) - last]]
    return any(_size(u, v) > PLACED for u, v in pairwise(between))


def _first_off(point: Array, lines: Sequence[tuple[Array, Array]], scale: float) -> int | None:
    """Return the first axis that certainly does not contain a point; None if there is none, or one may contain it."""
    for number, (axis, place) in enumerate(lines):
        away = _size(axis, point - place)
        if away > PLACED * scale:
            return number
        if away > 0.1 * REDUCTION * scale:
            return None
    return None


def _size(u: Array, v: Array) -> float:
    """Return the largest component of u x v."""
    (a, b, c), (x, y, z) = u.tolist(), v.tolist()
    return max(abs(b * z - c * y), abs(c * x - a * z), abs(a * y - b * x))
