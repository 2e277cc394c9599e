"""Positions of points of all links in the frame of the root link, as chains that share their beginnings.

The rotations of a link are a linked list of *steps* from the root, which links below share: 1,000 links of a chain have
1,000 steps, not half a million. A step translates by `s + L q` in the frame above, and then rotates about an axis:

    P = P_above + W_above (s + L q),    W = W_above R(u, c . q).

A step does not rotate the part along u, which moves behind it, so that marks of one link share all steps. Rotations
about one axis at one point are one step. A point on the axis of its last step belongs to the step above. A joint with
several coordinates is fixed at its origin, as in `absolute_chain`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from pinbound.geometry.rotations import rotation_matrix
from pinbound.model.coupling import Coupling
from pinbound.model.tree import Tree
from pinbound.model.urdf import Joint
from pinbound.path.chain import are_parallel
from pinbound.tolerances import REDUCTION
from pinbound.typing import Array
from pinbound.values import Value

__all__ = ["Spot", "Step", "link_spots", "moved"]

Terms = tuple[tuple[int, float], ...]


@dataclass(frozen=True, eq=False)
class Step(Value):
    """A translation, constant and by prismatic joints, then a rotation.

    Attributes:
        above: The step before; None: the root.
        offset: (3,) [m].
        slides: The direction (3,) of the translation by each coordinate [m per unit of q].
        axis: (3,) unit vector.
        terms: Coordinates and coefficients of the angle.
    """

    above: Step | None
    offset: Array
    slides: Mapping[int, Array]
    axis: Array
    terms: Terms


@dataclass(frozen=True, eq=False)
class Spot(Value):
    """A point behind a step; for a link, its origin with its orientation.

    Attributes:
        step: The last step; None: the root.
        place: (3,) [m] in the frame behind it.
        slides: As for a step.
        rotation: (3, 3) the link's orientation in that frame.
        scale: [m], the length of all offsets down to it.
        rate: Bound of the translation per unit of all coordinates [m].
    """

    step: Step | None
    place: Array
    slides: Mapping[int, Array]
    rotation: Array
    scale: float
    rate: float


def link_spots(tree: Tree, coupling: Coupling, links: Iterable[str]) -> dict[str, Spot]:
    """Return the origins of links and of all links above them, by name."""
    rows = {name: (S, float(o)) for name, S, o in zip(coupling.joints, coupling.S, coupling.offset, strict=True)}
    found = {tree.root: Spot(None, np.zeros(3), {}, np.eye(3), 0.0, 0.0)}
    for link in links:
        joints, above = list[Joint](), link
        while above not in found:
            joints.append(tree.parent_joint[above])
            above = joints[-1].parent
        for joint in reversed(joints):
            found[joint.child] = _below(found[joint.parent], joint, rows)
    return found


def moved(spot: Spot, xyz: Array) -> Spot:
    """Return a point of a link, given the link's origin.

    Example:
        >>> at_root = Spot(None, np.zeros(3), {}, np.eye(3), 0.0, 0.0)
        >>> moved(at_root, np.array([0.0, 0.0, 2.0])).place.tolist()
        [0.0, 0.0, 2.0]
    """
    point = replace(spot, place=spot.place + spot.rotation @ xyz, scale=spot.scale + float(np.linalg.norm(xyz)))
    while point.step is not None and _on_axis(point):
        place, slides = _carried(point.step, point.place, point.slides)
        point = replace(point, step=point.step.above, place=place, slides=slides)
    return point


def _below(spot: Spot, joint: Joint, rows: Mapping[str, tuple[Array, float]]) -> Spot:
    place, rotation = spot.place + spot.rotation @ joint.translation, spot.rotation @ joint.rotation
    scale = spot.scale + float(np.linalg.norm(joint.translation))
    below = replace(spot, place=place, rotation=rotation, scale=scale)
    if not joint.moves:
        return below
    coefficients, offset = rows[joint.name]
    axis, terms = rotation @ joint.axis, _terms(coefficients)
    if joint.type == "prismatic":
        slides = dict(spot.slides)
        for j, c in terms:
            slides[j] = slides.get(j, np.zeros(3)) + c * axis
        rate = spot.rate + sum(abs(c) for _, c in terms)
        return replace(below, place=place + offset * axis, slides=slides, scale=scale + abs(offset), rate=rate)
    turned = rotation @ rotation_matrix(joint.axis, offset) if offset else rotation
    if not terms:
        return replace(below, rotation=turned)
    return replace(_turned(below, axis, terms), rotation=turned)


def _turned(spot: Spot, axis: Array, terms: Terms) -> Spot:
    """Return the part along the axis, behind a rotation about it; rotations about one axis at one point are added."""
    last = spot.step
    if last is not None and are_parallel(last.axis, axis) and _on_axis(spot):
        sign = float(np.sign(last.axis @ axis))
        sums = dict(last.terms)
        for j, c in terms:
            sums[j] = sums.get(j, 0.0) + sign * c
        left = tuple((j, c) for j, c in sorted(sums.items()) if abs(c) > REDUCTION)
        if left:
            return replace(spot, step=replace(last, terms=left))
        place, slides = _carried(last, spot.place, spot.slides)
        return replace(spot, step=last.above, place=place, slides=slides)
    along = {j: axis * float(axis @ way) for j, way in spot.slides.items()}
    across = {j: way - along[j] for j, way in spot.slides.items()}
    kept = axis * float(axis @ spot.place)
    step = Step(last, spot.place - kept, _nonzero(across), axis, terms)
    return replace(spot, step=step, place=kept, slides=_nonzero(along))


def _on_axis(spot: Spot) -> bool:
    """Return whether the rotation of the last step moves neither a point nor its slides."""
    assert spot.step is not None
    axis = spot.step.axis
    across = spot.place - axis * float(axis @ spot.place)
    ways = [way - axis * float(axis @ way) for way in spot.slides.values()]
    return _largest(across) <= REDUCTION * spot.scale and all(_largest(way) <= REDUCTION for way in ways)


def _largest(vector: Array) -> float:
    """Return the size of the largest component."""
    x, y, z = vector.tolist()
    return max(abs(x), abs(y), abs(z))


def _carried(step: Step, place: Array, slides: Mapping[int, Array]) -> tuple[Array, dict[int, Array]]:
    """Return a point on the axis of a step, and its slides, in the frame above the step."""
    ways = dict(step.slides)
    for j, way in slides.items():
        ways[j] = ways.get(j, np.zeros(3)) + way
    return step.offset + step.axis * float(step.axis @ place), ways


def _nonzero(slides: Mapping[int, Array]) -> dict[int, Array]:
    return {j: way for j, way in slides.items() if _largest(way) > REDUCTION}


def _terms(row: Array) -> Terms:
    return tuple((int(j), float(row[j])) for j in np.flatnonzero(np.abs(row) > REDUCTION))
