"""Bodies of an MJCF model: their placements, their joints, and their sites."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from lxml import etree

from pinbound.geometry.rotations import rotation_matrix
from pinbound.model.document import local_name, parse_floats
from pinbound.typing import Array
from pinbound.values import Value

__all__ = ["Bodies", "Motion", "Place", "text_of"]

_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
_TURNS = ("quat", "axisangle", "xyaxes", "zaxis", "euler")
_MOVING = ("joint", "freejoint")

Fault = Callable[[str, str, etree._Element], None]


@dataclass(frozen=True, eq=False)
class Place(Value):
    """A frame (3, 4) in a link of the URDF, with the link's name."""

    link: str
    frame: Array


@dataclass(frozen=True, eq=False)
class Motion(Value):
    """The motion of a body by its one joint: about (or along) the unit axis (3,) through pos (3,), in its own frame."""

    name: str
    axis: Array
    pos: Array
    turns: bool


def text_of(vector: Array) -> str:
    """Return a vector as text of an attribute; `repr` keeps every bit of a float64."""
    return " ".join(repr(float(x) + 0.0) for x in vector)


class Bodies:
    """Bodies, by name.

    Attributes:
        frames: The placement of each body (3, 4), in the world.
        joints: The motion of each body with one hinge or slide joint.
        sites: Body and position (3,) [m] of each site; in the world the body is "world".
        moving: Bodies that move relative to the world.
    """

    def __init__(self, root: etree._Element, fault: Fault) -> None:
        """Read every `<worldbody>` of a `<mujoco>` element; faults go to `fault`."""
        self._fault = fault
        self.frames: dict[str, Array] = {"world": np.eye(3, 4)}
        self.joints: dict[str, Motion] = {}
        self.sites: dict[str, tuple[str, Array]] = {}
        self.moving: set[str] = set()
        self._defaults = {name: chain for group in root.findall("default") for name, chain in _classes(group).items()}
        compilers = root.findall("compiler")
        for one in compilers:
            if one.get("coordinate") == "global":
                self._fault(
                    "its coordinates are global, an old form that is not read", "Save it with a new MuJoCo", one
                )
        self._degrees = all(one.get("angle", "degree") == "degree" for one in compilers)
        self._sequence = next((str(one.get("eulerseq")) for one in compilers if one.get("eulerseq")), "xyz")
        for world in root.findall("worldbody"):
            self._walk(world, "world", np.eye(3, 4), np.eye(3, 4), world.get("childclass", "main"), False)

    def attribute(
        self, element: etree._Element, key: str, default: str, inherited: str = "main", kind: str = ""
    ) -> str:
        """Return an attribute, or its value in the default classes of its element."""
        if element.get(key) is not None:
            return str(element.get(key))
        for group in self._defaults.get(element.get("class", inherited), ()):
            found = group.find(kind or local_name(element))
            if found is not None and found.get(key) is not None:
                return str(found.get(key))
        return default

    def _walk(
        self, parent: etree._Element, body: str, world: Array, inside: Array, inherited: str, moves: bool
    ) -> None:
        """Read the content of a body, or of a `<frame>` in it with the placement `inside` (3, 4) in the body."""
        for element in parent.iterchildren(etree.Element):
            if element.tag == "frame":
                within = _joined(inside, self._frame(element))
                self._walk(element, body, world, within, element.get("childclass", inherited), moves)
            elif element.tag == "body":
                self._body(element, _joined(world, _joined(inside, self._frame(element))), inherited, moves)
            elif element.tag == "site" and element.get("name"):
                ends = self._numbers(element, self.attribute(element, "fromto", "", inherited), 6, np.zeros(0))
                default = 0.5 * (ends[:3] + ends[3:]) if len(ends) else np.zeros(3)
                pos = self._numbers(element, self.attribute(element, "pos", "", inherited), 3, default)
                self.sites[str(element.get("name"))] = body, inside[:, :3] @ pos + inside[:, 3]
            elif element.tag in ("replicate", "composite", "attach"):
                self._fault(f"<{element.tag}> is not read: it may hold bodies", "Save the model as one file", element)

    def _body(self, element: etree._Element, frame: Array, inherited: str, moves: bool) -> None:
        name, inherited = element.get("name", ""), element.get("childclass", inherited)
        found = [child for child in element.iterchildren(etree.Element) if child.tag in _MOVING]
        moves = moves or bool(found) or element.get("mocap") == "true"
        if name:
            self.frames[name] = frame
            if moves:
                self.moving.add(name)
            kind = self.attribute(found[0], "type", "hinge", inherited) if len(found) == 1 else ""
            if len(found) == 1 and found[0].tag == "joint" and kind in ("hinge", "slide"):
                joint = found[0]
                pos = self._numbers(joint, self.attribute(joint, "pos", "", inherited), 3, np.zeros(3))
                axis = self._numbers(joint, self.attribute(joint, "axis", "", inherited), 3, np.array(_AXES["z"]))
                if np.any(axis):
                    self.joints[name] = Motion(joint.get("name", ""), axis / np.linalg.norm(axis), pos, kind == "hinge")
        self._walk(element, name, frame, np.eye(3, 4), inherited, moves)

    def _frame(self, element: etree._Element) -> Array:
        """Return the pose (3, 4) of an element."""
        pos = self._numbers(element, element.get("pos", ""), 3, np.zeros(3))
        return np.column_stack((self._rotation(element), pos))

    def _rotation(self, element: etree._Element) -> Array:
        given = [key for key in _TURNS if element.get(key) is not None]
        if len(given) > 1:
            self._fault(f"<{element.tag}> gives its orientation as {' and as '.join(given)}", "Keep one", element)
            return np.eye(3)
        if not given:
            return np.eye(3)
        count = {"quat": 4, "axisangle": 4, "xyaxes": 6}.get(given[0], 3)
        numbers = self._numbers(element, str(element.get(given[0])), count, np.zeros(count))
        unit = math.pi / 180.0 if self._degrees else 1.0
        if given[0] == "euler":
            found: Array = np.eye(3)
            for letter, angle in zip(self._sequence, numbers, strict=False):
                turn = rotation_matrix(np.array(_AXES.get(letter.lower(), _AXES["z"])), unit * float(angle))
                found = found @ turn if letter.islower() else turn @ found
            return found
        if not np.any(numbers[:3]) and not (given[0] == "quat" and numbers[3]):
            self._fault(f"{given[0]} of <{element.tag}> is zero", "Give a direction", element)
            return np.eye(3)
        if given[0] == "quat":
            w, vector = float(numbers[0]), numbers[1:]
            length = float(np.linalg.norm(vector))
            return rotation_matrix(vector / length, 2.0 * math.atan2(length, w)) if length else np.eye(3)
        if given[0] == "axisangle":
            return rotation_matrix(numbers[:3] / np.linalg.norm(numbers[:3]), unit * float(numbers[3]))
        if given[0] == "zaxis":
            return _from_z(numbers / np.linalg.norm(numbers))
        x: Array = numbers[:3] / np.linalg.norm(numbers[:3])
        across: Array = numbers[3:] - x * (x @ numbers[3:])
        if not np.any(across):
            self._fault(f"xyaxes of <{element.tag}> are parallel", "Give two directions", element)
            return np.eye(3)
        y: Array = across / np.linalg.norm(across)
        return np.column_stack((x, y, np.cross(x, y)))

    def _numbers(self, element: etree._Element, text: str, count: int, default: Array) -> Array:
        if not text:
            return default
        numbers = parse_floats(text, count)
        if isinstance(numbers, str):
            self._fault(f"{text!r} of <{element.tag}>: {numbers}", "Write finite numbers", element)
            return np.zeros(count)
        return np.array(numbers)


def _classes(group: etree._Element) -> dict[str, tuple[etree._Element, ...]]:
    """Return the default classes of a `<default>`, each as the elements to search, the nearest first."""
    found: dict[str, tuple[etree._Element, ...]] = {}

    def walk(element: etree._Element, above: tuple[etree._Element, ...], name: str) -> None:
        chain = (element, *above)
        found[name] = chain
        for below in element.findall("default"):
            walk(below, chain, str(below.get("class")))

    walk(group, (), group.get("class", "main"))
    return found


def _joined(outer: Array, inner: Array) -> Array:
    return np.column_stack((outer[:, :3] @ inner[:, :3], outer[:, :3] @ inner[:, 3] + outer[:, 3]))


def _from_z(z: Array) -> Array:
    """Return the smallest rotation from the z axis to a unit vector."""
    across: Array = np.array([-z[1], z[0], 0.0])
    length = float(np.linalg.norm(across))
    if not length:
        return np.eye(3) if z[2] > 0.0 else rotation_matrix(np.array(_AXES["x"]), math.pi)
    return rotation_matrix(across / length, math.atan2(length, float(z[2])))
