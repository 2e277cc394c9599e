"""Collision bodies of a URDF, and conservative covers of them by spheres.

yourdfpy reads the standard shapes; capsules, which it does not know, are read beside it. Nothing is dropped in silence:
a shape that cannot be covered is returned as such.
"""

from __future__ import annotations

import io
import math
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from lxml import etree
from numpy.typing import NDArray

from pinbound.document import parse_floats
from pinbound.exceptions import DimensionError
from pinbound.robot import Robot

__all__ = ["Body", "Cover", "collision_bodies", "cover"]

Array = NDArray[np.float64]

_MOST_SPHERES = 64


@dataclass(frozen=True)
class Body:
    """A collision body.

    Attributes:
        link: The link it is fixed to.
        index: Its place among the link's collision bodies.
        shape: ``"sphere"``, ``"box"``, ``"cylinder"``, ``"capsule"`` or ``"mesh"``.
        size: [m] (radius,), (x, y, z), (radius, length), (radius, length of the straight part), ().
        rotation: (3, 3), from the body's frame to the link's.
        translation: (3,) [m], its centre in the link's frame.
    """

    link: str
    index: int
    shape: str
    size: tuple[float, ...]
    rotation: Array
    translation: Array


@dataclass(frozen=True)
class Cover:
    """Spheres whose union holds a body.

    Attributes:
        body: The body.
        centres: (k, 3) [m] in the link's frame; empty if the body cannot be covered.
        radius: [m], the same for all of them.
        excess: [m], no point of a sphere is further than this outside the body.
    """

    body: Body
    centres: Array
    radius: float
    excess: float


def collision_bodies(robot: Robot) -> tuple[Body, ...]:
    """Return the collision bodies of all links, in file order.

    Example:
        >>> import pinbound as pb
        >>> bodies = collision_bodies(pb.load("minervabot_v3"))
        >>> [body.shape for body in bodies if body.link == "link_27"]
        ['box', 'box']
    """
    import yourdfpy

    root = robot.document.root
    text = etree.tostring(root)
    parsed = cast(Any, yourdfpy).URDF.load(io.BytesIO(text), build_scene_graph=False, load_meshes=False)
    capsules = {link: _capsules(element) for element in root.findall("link") if (link := str(element.get("name")))}
    bodies: list[Body] = []
    for link in parsed.robot.links:
        for index, collision in enumerate(link.collisions):
            shape, size = _shape(collision.geometry, capsules[link.name].get(index))
            origin = np.eye(4) if collision.origin is None else np.asarray(collision.origin, dtype=np.float64)
            bodies.append(Body(link.name, index, shape, size, origin[:3, :3], origin[:3, 3]))
    return tuple(bodies)


def _capsules(link: etree._Element) -> dict[int, tuple[float, float]]:
    found: dict[int, tuple[float, float]] = {}
    for index, collision in enumerate(link.findall("collision")):
        capsule = collision.find("geometry/capsule")
        if capsule is not None:
            numbers = parse_floats(f"{capsule.get('radius', '')} {capsule.get('length', '')}", 2)
            if not isinstance(numbers, str):
                found[index] = (numbers[0], numbers[1])
    return found


def _shape(geometry: Any, capsule: tuple[float, float] | None) -> tuple[str, tuple[float, ...]]:
    if capsule is not None:
        return "capsule", capsule
    if geometry.sphere is not None:
        return "sphere", (float(geometry.sphere.radius),)
    if geometry.box is not None:
        return "box", tuple(float(side) for side in geometry.box.size)
    if geometry.cylinder is not None:
        return "cylinder", (float(geometry.cylinder.radius), float(geometry.cylinder.length))
    return "mesh", ()


def cover(body: Body, accuracy: float) -> Cover:
    """Return spheres whose union holds a body, as few as keep the excess within `accuracy`, at most 64.

    A slice of half-height h of a cylinder of radius r lies in the sphere of radius sqrt(r^2 + h^2) about its middle,
    the stretch of a capsule between two spheres d apart in spheres of sqrt(r^2 + (d / 2)^2), a cell of a box in the
    sphere through its corners. The flat ends of a cylinder stick out by sqrt(r^2 + h^2) - h
    however many slices there are; the excess says so.

    Args:
        body: The body.
        accuracy: [m], the excess to aim at.

    Raises:
        DimensionError: If the accuracy is not positive.

    Example:
        >>> rod = Body("arm", 0, "capsule", (0.05, 0.4), np.eye(3), np.zeros(3))
        >>> found = cover(rod, 0.02)
        >>> len(found.centres), round(found.excess, 4)
        (6, 0.014)
    """
    if not accuracy > 0.0:
        raise DimensionError(f"the accuracy {accuracy} is not a positive length")
    local, radius, excess = _local_cover(body.shape, body.size, accuracy)
    return Cover(body, local @ body.rotation.T + body.translation, radius, excess)


def _local_cover(shape: str, size: tuple[float, ...], accuracy: float) -> tuple[Array, float, float]:
    if shape == "sphere":
        return np.zeros((1, 3)), size[0], 0.0
    if shape == "capsule":
        return _along(size[0], size[1], accuracy)
    if shape == "cylinder":
        return _slices(size[0], size[1], accuracy)
    if shape == "box":
        return _cells(np.asarray(size, dtype=np.float64), accuracy)
    return np.empty((0, 3)), 0.0, 0.0


def _along(radius: float, length: float, accuracy: float) -> tuple[Array, float, float]:
    """Cover a capsule: spheres from one end of its segment to the other, both ends included for the caps."""
    best: tuple[float, int] = (length / 2, 1)
    for count in range(2, _MOST_SPHERES + 1):
        if best[0] <= accuracy:
            break
        excess = math.hypot(radius, length / (2 * (count - 1))) - radius
        best = min(best, (excess, count))
    excess, count = best
    heights = [length * (index / (count - 1) - 0.5) for index in range(count)] if count > 1 else [0.0]
    return _on_axis(heights), radius + excess, excess


def _slices(radius: float, length: float, accuracy: float) -> tuple[Array, float, float]:
    """Cover a cylinder: a sphere about the middle of each slice, through the slice's rims."""
    options: list[tuple[float, int]] = []
    for count in range(1, _MOST_SPHERES + 1):
        half = length / (2 * count)
        options.append((math.hypot(radius, half) - min(radius, half), count))
        if options[-1][0] <= accuracy:
            break
    excess, count = min(options)
    half = length / (2 * count)
    heights = [half * (2 * index + 1) - length / 2 for index in range(count)]
    return _on_axis(heights), math.hypot(radius, half), excess


def _on_axis(heights: list[float]) -> Array:
    return np.array([(0.0, 0.0, height) for height in heights])


def _cells(size: Array, accuracy: float) -> tuple[Array, float, float]:
    """Cut a box into cells of nearly equal sides, finer until the spheres about them stick out little enough."""
    found: tuple[Array, float, float] | None = None
    for step in range(1, _MOST_SPHERES + 1):
        counts = np.maximum(1, np.ceil(size / (np.max(size) / step) - 1e-9)).astype(int)
        if found is not None and int(np.prod(counts)) > _MOST_SPHERES:
            break
        half = size / (2 * counts)
        around = float(np.linalg.norm(half))
        excess = around - float(np.min(half))
        if found is None or excess < found[2]:
            cells = np.indices(tuple(counts.tolist())).reshape(3, -1).T
            centres = half * (2.0 * cells + 1.0) - size / 2
            found = (centres, around, excess)
        if excess <= accuracy:
            break
    assert found is not None
    return found
