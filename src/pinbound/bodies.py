"""Collision bodies of a URDF.

yourdfpy reads the standard shapes; capsules, which it does not know, are read beside it. Nothing is dropped in silence:
meshes are returned as such.
"""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import Any, Protocol, cast

import numpy as np
from lxml import etree
from numpy.typing import NDArray

from pinbound.document import Document, parse_floats

__all__ = ["Body", "collision_bodies"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
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


class _HasDocument(Protocol):
    """A robot, as far as its bodies need it: `pinbound.robot` stands above this room."""

    @property
    def document(self) -> Document:
        """The XML that it was read from."""
        ...


def collision_bodies(robot: _HasDocument) -> tuple[Body, ...]:
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
