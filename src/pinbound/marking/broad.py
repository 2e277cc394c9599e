"""Links that can never meet, proven from the lengths of the chains between them alone, for all pairs of links at once.

Links that are connected by fixed joints form one *body*. Let C be the lowest body from which two links descend. Let p_a
be the fixed point of C at which the chain to link a starts: its first joint, or the middle of the link's marks if the
link is on C. For all positions of the joints behind p_a, the link's marks stay in a ball about p_a with the radius

    rho_a = sum of |c_j| + |m_a| + w_a,

where c_j is the position of each joint after the first in the frame of the body above it, m_a is the middle of the
link's marks in its body's frame, and w_a is how far the marks extend from there, with their radii (on C, rho_a is w_a
alone). So for all q, the gap of two marks of the two links is at least

    |p_a - p_b| - rho_a - rho_b.

Behind a prismatic or free joint, rho is infinite.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pinbound.annotations import Mark
from pinbound.model.tree import Tree
from pinbound.tolerances import FOLDING, UNIT_ROUNDOFF
from pinbound.typing import Array, Ints
from pinbound.values import read_only

__all__ = ["least_gaps"]

_TURNING = ("revolute", "continuous")


@dataclass(frozen=True, eq=False)
class _Body:
    """Links that are connected by fixed joints.

    Attributes:
        above: The number of the body above; -1 for the body of the root.
        place: (3,) the position of its joint, in the frame of the body above [m].
        length: The sum of |place| of this body and those above [m].
        slides: The number of joints down to this body that are not revolute.
        depth: The number of joints down to this body.
    """

    above: int
    place: Array
    length: float
    slides: int
    depth: int


@dataclass(frozen=True, eq=False)
class _Ways:
    """The chains that start at one point of a body: numbers of their links, and balls that hold them (radii [m])."""

    place: Array
    links: Ints
    radii: Array


def least_gaps(tree: Tree, marks: Mapping[str, Sequence[Mark]]) -> Array:
    """Return lower bounds of the gaps between the marks of each two links, over all q (k, k) [m].

    Rounding is subtracted. For two links on one body, and for lines and planes, the value is minus infinity.

    Args:
        tree: The robot's tree; the joints may have any positions, coupled or not.
        marks: The marks of each of k links; each has at least one.

    Example:
        >>> import pinbound as pb
        >>> from pinbound.annotations import Point
        >>> robot = pb.load("minervabot_v3")
        >>> tips = {link: [Point(link, link, (0.0, 0.0, 0.0), 0.01)] for link in ("link_2", "link_3")}
        >>> least_gaps(robot.tree, tips).shape
        (2, 2)
    """
    bodies, frames = _bodies_of(tree)
    numbers = [frames[link][0] for link in marks]
    below = _ways_below(bodies, numbers, *_balls(marks, frames))
    gaps = np.full((len(numbers), len(numbers)), -np.inf)
    rounding = FOLDING * UNIT_ROUNDOFF * (2 * max(body.depth for body in bodies) + 2) ** 2
    for own, branches in below:
        for index, one in enumerate((*own, *branches)):
            others = branches[max(0, index - len(own) + 1) :]  # two links on one body never move relative to each other
            if not others:
                continue
            links, counts = np.concatenate([way.links for way in others]), [len(way.links) for way in others]
            places = np.array([way.place for way in others])
            far = np.repeat(np.linalg.norm(places - one.place, axis=1), counts)
            lengths = np.linalg.norm(one.place) + np.repeat(np.linalg.norm(places, axis=1), counts)
            radii = one.radii[:, None] + np.concatenate([way.radii for way in others])
            found = far - radii - rounding * (lengths + radii)
            gaps[one.links[:, None], links] = found
            gaps[links[:, None], one.links] = found.T
    return read_only(gaps)


def _bodies_of(tree: Tree) -> tuple[list[_Body], dict[str, tuple[int, Array, Array]]]:
    """Return the bodies, parents first, and for each link its body, and its rotation and position there."""
    bodies = [_Body(-1, np.zeros(3), 0.0, 0, 0)]
    frames: dict[str, tuple[int, Array, Array]] = {}
    for link, joint, _ in tree.walk():
        if joint is None:
            frames[link.name] = 0, np.eye(3), np.zeros(3)
            continue
        number, rotation, place = frames[joint.parent]
        place = place + rotation @ joint.translation
        if joint.type == "fixed":
            frames[link.name] = number, rotation @ joint.rotation, place
            continue
        above = bodies[number]
        slides = above.slides + (joint.type not in _TURNING)
        bodies.append(_Body(number, place, above.length + float(np.linalg.norm(place)), slides, above.depth + 1))
        frames[link.name] = len(bodies) - 1, np.eye(3), np.zeros(3)
    return bodies, frames


def _balls(marks: Mapping[str, Sequence[Mark]], frames: Mapping[str, tuple[int, Array, Array]]) -> tuple[Array, Array]:
    """Return balls that hold the marks of each link: middles (k, 3) in its body's frame, radii (k,) [m]."""
    middles, radii = np.empty((len(marks), 3)), np.empty(len(marks))
    for index, (link, own) in enumerate(marks.items()):
        _, rotation, place = frames[link]
        centres = np.array([mark.shape.middle for mark in own]) @ rotation.T + place
        middles[index] = 0.5 * (centres.min(axis=0) + centres.max(axis=0))
        around = np.array([np.inf if m.shape.is_unbounded else m.shape.radius + m.shape.around for m in own])
        radii[index] = np.max(np.linalg.norm(centres - middles[index], axis=1) + around)
    return middles, radii


def _ways_below(
    bodies: Sequence[_Body], numbers: Sequence[int], middles: Array, radii: Array
) -> list[tuple[list[_Ways], list[_Ways]]]:
    """Return, for each body, the chains to each link on it, and those through each joint on it to all links behind."""
    found: list[tuple[list[_Ways], list[_Ways]]] = [([], []) for _ in bodies]
    links: list[list[int]] = [[] for _ in bodies]
    for link, number in enumerate(numbers):
        found[number][0].append(_Ways(middles[link], np.array([link]), radii[link : link + 1]))
        links[number].append(link)
    reach = np.array([bodies[number].length for number in numbers]) + np.linalg.norm(middles, axis=1) + radii
    slides = np.array([bodies[number].slides for number in numbers], dtype=int)
    for number in range(len(bodies) - 1, 0, -1):  # children come first
        body, behind = bodies[number], np.array(links[number], dtype=int)
        if len(behind):
            turning = slides[behind] == bodies[body.above].slides
            found[body.above][1].append(
                _Ways(body.place, behind, np.where(turning, reach[behind] - body.length, np.inf))
            )
            links[body.above] += links[number]
    return found
