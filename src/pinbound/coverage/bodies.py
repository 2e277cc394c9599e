"""Bodies of a URDF's links: collision bodies, and visual bodies of links that have no collision body.

All faults of the geometry are reported at once, each with its line. A known shape that no mark can hold (a mesh, an
ellipsoid) is returned under its name, so that the caller can report that it is not covered.
"""

from __future__ import annotations

import difflib
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Literal, Protocol

import numpy as np
from lxml import etree

from pinbound.exceptions import Problems, name_hint
from pinbound.geometry.rotations import rpy_matrix
from pinbound.model.document import Document, parse_floats
from pinbound.tolerances import LARGEST_BODY
from pinbound.typing import Array

__all__ = ["SHAPES", "Body", "LinkBodies", "collision_bodies", "read_bodies"]

Source = Literal["collision", "visual"]

SHAPES = ("sphere", "box", "cylinder", "capsule")
"""Shapes that marks can hold."""

_MEASURES: dict[str, tuple[tuple[str, int], ...]] = {
    "sphere": (("radius", 1),),
    "box": (("size", 3),),
    "cylinder": (("radius", 1), ("length", 1)),
    "capsule": (("radius", 1), ("length", 1)),
}
_READ = (*_MEASURES, "mesh")
_OTHERS = (
    "cone",
    "convex_mesh",
    "ellipsoid",
    "halfspace",
    "heightmap",
    "octomap",
    "octree",
    "plane",
    "sdf_mesh",
    "superellipsoid",
    "torus",
)
_ALIKE = 0.75  # difflib's ratio, from 0 to 1: above this one word is a misspelling of the other


class HasDocument(Protocol):
    """An object that was read from an XML document, as a `Robot` is."""

    @property
    def document(self) -> Document:
        """The document."""
        ...


@dataclass(frozen=True, eq=False)
class Body:
    """A body that is fixed to a link.

    Attributes:
        link: The link it is fixed to.
        index: Its place among the link's bodies.
        shape: ``"sphere"``, ``"box"``, ``"cylinder"``, ``"capsule"`` or ``"mesh"``; or the name of another shape, as
            the file writes it, which is not read any further.
        size: [m] (radius,), (x, y, z), (radius, length), (radius, length of the straight part), (); none is negative.
        rotation: (3, 3), from the body's frame to the link's.
        translation: (3,) [m], its centre in the link's frame.
        name: Its name in the file, or ``LINK.INDEX``.
        line: Line of its element.
        source: ``"collision"``, or ``"visual"`` where the link has no collision body.
        filename: The file of a mesh, as written.
        scale: (3,) factors on a mesh; a negative one mirrors it.
    """

    link: str
    index: int
    shape: str
    size: tuple[float, ...]
    rotation: Array
    translation: Array
    name: str = ""
    line: int | None = None
    source: Source = "collision"
    filename: str = ""
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)

    def __post_init__(self) -> None:
        """Own the arrays and make them read-only; name the body."""
        for key in ("rotation", "translation"):
            array = np.array(getattr(self, key), dtype=np.float64)
            array.flags.writeable = False
            object.__setattr__(self, key, array)
        if not self.name:
            object.__setattr__(self, "name", f"{self.link}.{self.index}")


@dataclass(frozen=True)
class LinkBodies:
    """The bodies of all links, and notes about elements that were not used.

    Attributes:
        bodies: The bodies, in file order.
        notes: What was ignored, one sentence for each case.
    """

    bodies: tuple[Body, ...]
    notes: tuple[str, ...]


def collision_bodies(robot: HasDocument) -> tuple[Body, ...]:
    """Return the bodies of all links, in file order: collision bodies, else visual bodies.

    A link without any ``<collision>`` gets the bodies that its ``<visual>`` elements draw, because it has a body, too.
    As in Pinocchio, a cylinder that ``<collision_checking><capsule name="..."/>`` of its link names is read as a
    capsule of the same radius and length.

    Raises:
        InputError: If the geometry of a body has a fault: all faults at once, each with its line and remedy.

    Example:
        >>> import pinbound as pb
        >>> bodies = collision_bodies(pb.load("minervabot_v3"))
        >>> [(body.name, body.shape, body.source) for body in bodies if body.link == "link_27"]
        [('link_27.0', 'box', 'collision'), ('link_27.1', 'box', 'collision')]
    """
    problems = Problems(robot.document.label)
    found = read_bodies(robot.document, problems)
    problems.raise_if_any()
    return found.bodies


def read_bodies(document: Document, problems: Problems) -> LinkBodies:
    """Read the bodies of all links. Every fault goes to `problems`, and its body is left out.

    Args:
        document: The robot's XML.
        problems: Receives the faults; the result is complete only if none was added.
    """
    reader = _Reader(problems)
    for element in document.root.findall("link"):
        reader.link(element)
    return LinkBodies(tuple(reader.bodies), tuple(reader.notes))


class _Reader:
    """One pass over the links, which collects bodies, faults and notes."""

    def __init__(self, problems: Problems) -> None:
        self.problems = problems
        self.bodies: list[Body] = []
        self.notes: list[str] = []

    def link(self, element: etree._Element) -> None:
        what = f"link {element.get('name')!r}"
        self._strangers(element, what, ("collision", "visual", "collision_checking"))
        self._strays(element, what)
        found: dict[Source, list[etree._Element]] = {
            "collision": _children(element, "collision"),
            "visual": _children(element, "visual"),
        }
        source: Source = "collision" if found["collision"] else "visual"
        named = [one for both in found.values() for one in both]
        capsules = self._capsules(element, what, {one.get("name", "") for one in named})
        for index, one in enumerate(found[source]):
            body = self._body(one, source, str(element.get("name")), index)
            if body is None:
                continue
            if one.get("name", "") in capsules:
                body = self._capsule(body)
            self.bodies.append(body)

    def _capsule(self, body: Body) -> Body:
        """Return the capsule that Pinocchio makes of a cylinder."""
        if body.shape != "cylinder":
            named = f"{body.name!r} of link {body.link!r}"
            self.notes.append(f"<collision_checking> names {named}, which is not a cylinder")
            return body
        return replace(body, shape="capsule")

    def _capsules(self, link: etree._Element, what: str, names: Collection[str]) -> set[str]:
        """Return which bodies `<collision_checking>` says are capsules."""
        blocks = _children(link, "collision_checking")
        if len(blocks) > 1:
            message = f"{what} has {len(blocks)} <collision_checking>, of which Pinocchio reads the first only"
            self.problems.add(message, "Write one", blocks[1].sourceline)
        found: set[str] = set()
        for capsule in [one for block in blocks for one in _children(block, "capsule")]:
            name = capsule.get("name")
            if name is None:
                message = f"a <capsule> in <collision_checking> of {what} has no name"
                self.problems.add(message, "Name the cylinder that is a capsule", capsule.sourceline)
            elif name not in names:
                message = f"<collision_checking> of {what} names {name!r}, which is not a body of this link"
                self.problems.add(message, name_hint(name, filter(None, names)), capsule.sourceline)
            else:
                found.add(name)
        return found

    def _body(self, element: etree._Element, source: Source, link: str, index: int) -> Body | None:
        name = element.get("name", "")
        what = f"{source} {name!r} of link {link!r}" if name else f"{source} {index} of link {link!r}"
        before = len(self.problems.found)
        self._strangers(element, what, ("origin", "geometry"))
        misspelt = len(self.problems.found) > before
        geometry = self._one(element, "geometry", f"the {what}", optional=misspelt)
        origin = self._one(element, "origin", f"the {what}", optional=True)
        rotation, translation = self._placement(origin, f"the origin of the {what}")
        shape = None if geometry is None else self._shape(geometry, f"the {what}")
        read = None if shape is None else self._measures(shape, f"the {what}")
        if shape is None or read is None or len(self.problems.found) > before:
            return None
        size, filename, scale = read
        return Body(
            link=link,
            index=index,
            shape=_raw_name(shape),
            size=size,
            rotation=rotation,
            translation=translation,
            name=name,
            line=element.sourceline,
            source=source,
            filename=filename,
            scale=scale,
        )

    def _one(self, element: etree._Element, tag: str, what: str, optional: bool = False) -> etree._Element | None:
        found = _children(element, tag)
        if len(found) > 1:
            self.problems.add(f"{what} has {len(found)} <{tag}>", "Keep one of each in a body", found[1].sourceline)
        elif not found and not optional:
            message = f"{what} has no <{tag}>"
            self.problems.add(message, "Give it one with a shape, or remove the body", element.sourceline)
        return found[0] if found else None

    def _shape(self, geometry: etree._Element, what: str) -> etree._Element | None:
        """Return the element of the shape: the one child of a `<geometry>`."""
        shapes = list(geometry.iterchildren(etree.Element))
        if len(shapes) != 1:
            held = ", ".join(f"<{_raw_name(one)}>" for one in shapes)
            message = f"the <geometry> of {what} " + (f"holds {len(shapes)} shapes: {held}" if shapes else "is empty")
            remedy = "Give each shape a body of its own" if shapes else f"Give it one of: {', '.join(_READ)}"
            self.problems.add(message, remedy, geometry.sourceline)
            return None
        name = _raw_name(shapes[0])
        if name not in (*_READ, *_OTHERS) and shapes[0].prefix is None:
            message = f"<{name}> in the <geometry> of {what} is no shape"
            self.problems.add(message, name_hint(name, _READ), shapes[0].sourceline)
            return None
        return shapes[0]

    def _measures(
        self, shape: etree._Element, what: str
    ) -> tuple[tuple[float, ...], str, tuple[float, float, float]] | None:
        """Return size, file name and scale of a shape."""
        name = _raw_name(shape)
        if name == "mesh":
            filename = (shape.get("filename") or "").strip()
            if not filename:
                self._missing(shape, "filename", f"the <mesh> of {what}")
            scale = self._triple(shape, "scale", f"the <mesh> of {what}", 1.0)
            if 0.0 in scale:
                message = f"scale of the <mesh> of {what} is {shape.get('scale')!r}"
                self.problems.add(message, "Give factors other than zero", shape.sourceline)
            return (), filename, scale
        size: list[float] = []
        for key, count in _MEASURES.get(name, ()):
            read = self._lengths(shape, key, count, f"the <{name}> of {what}")
            if read is None:
                return None
            size += read
        return tuple(size), "", (1.0, 1.0, 1.0)

    def _lengths(self, shape: etree._Element, key: str, count: int, what: str) -> Sequence[float] | None:
        text = shape.get(key)
        if text is None:
            self._missing(shape, key, what)
            return None
        numbers = parse_floats(text, count)
        if isinstance(numbers, str):
            self.problems.add(f"{key} of {what}: {numbers}", f"Write {_count(count)} in metres", shape.sourceline)
            return None
        if min(numbers) < 0.0 or max(numbers) > LARGEST_BODY:
            fault = "negative" if min(numbers) < 0.0 else f"larger than {LARGEST_BODY:g} m"
            message = f"{key} of {what} is {fault}: {text!r}"
            self.problems.add(message, f"Write {_count(count)} in metres, not negative", shape.sourceline)
            return None
        return numbers

    def _missing(self, shape: etree._Element, key: str, what: str) -> None:
        given = [str(name) for name in shape.attrib]
        inside = [_raw_name(child) for child in shape.iterchildren(etree.Element)]
        remedy = f'Write {key}="..." as an attribute'
        if given or inside:
            remedy += f"; it has {', '.join([*given, *(f'<{name}>' for name in inside)])}"
        self.problems.add(f"{what} has no {key}", remedy, shape.sourceline)

    def _placement(self, origin: etree._Element | None, what: str) -> tuple[Array, Array]:
        if origin is None:
            return np.eye(3), np.zeros(3)
        for key in map(str, origin.attrib):
            if key not in ("xyz", "rpy"):
                self.problems.add(f"{what} has the attribute {key!r}", "Write xyz and rpy only", origin.sourceline)
        xyz, rpy = (self._triple(origin, key, what, 0.0) for key in ("xyz", "rpy"))
        if max(map(abs, xyz)) > LARGEST_BODY:
            message = f"xyz of {what} is larger than {LARGEST_BODY:g} m: {origin.get('xyz')!r}"
            self.problems.add(message, "Write three numbers in metres", origin.sourceline)
        return rpy_matrix(rpy), np.array(xyz)

    def _triple(self, element: etree._Element, key: str, what: str, default: float) -> tuple[float, float, float]:
        text = element.get(key)
        if text is None:
            return default, default, default
        numbers = parse_floats(text, 3)
        if isinstance(numbers, str):
            self.problems.add(f"{key} of {what}: {numbers}", "Write three finite numbers", element.sourceline)
            return default, default, default
        return numbers[0], numbers[1], numbers[2]

    def _strays(self, link: etree._Element, what: str) -> None:
        """Refuse shapes at places where no URDF reader looks for them."""
        for shape in link.iter(*_READ):
            above = shape.getparent()
            where = "" if above is None else _raw_name(above)
            if where in ("link", "collision", "visual", *_READ):
                message = f"<{_raw_name(shape)}> of {what} stands in <{where}>, not in <geometry>"
                self.problems.add(message, "Move it directly into a <geometry>, or remove it", shape.sourceline)

    def _strangers(self, element: etree._Element, what: str, valid: Sequence[str]) -> None:
        """Refuse elements whose names are nearly valid ones, and note those of another namespace."""
        for child in element.iterchildren(etree.Element):
            name = _raw_name(child)
            local = name.rpartition(":")[2]
            if name in valid:
                continue
            if local in valid:
                self.notes.append(f"<{name}> of {what} is ignored: it is in the namespace {_namespace(child)!r}")
            elif child.prefix is None and difflib.get_close_matches(local.lower(), valid, n=1, cutoff=_ALIKE):
                message = f"<{name}> in {what} is no element of a URDF"
                self.problems.add(message, name_hint(local, valid), child.sourceline)


def _raw_name(element: etree._Element) -> str:
    """Return a name as URDF readers see it: a prefix is part of the text, and there is no default namespace."""
    local = etree.QName(element).localname
    return f"{element.prefix}:{local}" if element.prefix else local


def _namespace(element: etree._Element) -> str:
    return etree.QName(element).namespace or ""


def _children(element: etree._Element, tag: str) -> list[etree._Element]:
    return [child for child in element.iterchildren(etree.Element) if _raw_name(child) == tag]


def _count(count: int) -> str:
    return "one number" if count == 1 else f"{count} numbers"
