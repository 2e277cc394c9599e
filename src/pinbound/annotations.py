"""What a user marks on a robot: points, boundaries, closures, home; inline in the URDF, or in a YAML sidecar.

Both spellings become the same raw items, and one validator reads those, so that they cannot drift apart. Unknown
elements and attributes are faults: a misspelt `min_distance` must not pass.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml
from lxml import etree

from pinbound.document import local_name, parse_floats
from pinbound.exceptions import Problems, name_hint
from pinbound.tolerances import CONTACT

__all__ = [
    "NAMESPACE",
    "Annotations",
    "BoundaryMark",
    "ClosureMark",
    "Point",
    "RawItem",
    "read_inline",
    "read_sidecar",
    "validate",
]

NAMESPACE = "urn:pinbound:1"

Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Point:
    """A marked point: `xyz` [m] in the frame of `link`, the centre of a sphere of `radius` [m]."""

    name: str
    link: str
    xyz: Vector
    radius: float = 0.0
    line: int | None = None


@dataclass(frozen=True, slots=True)
class BoundaryMark:
    """Two marked points, by name, that must stay `min_distance` [m] apart, surface to surface."""

    name: str
    a: str
    b: str
    min_distance: float = 0.0
    line: int | None = None


@dataclass(frozen=True, slots=True)
class ClosureMark:
    """A pin: `xyz_a` [m] of `link_a` and `xyz_b` [m] of `link_b` are the same place."""

    name: str
    link_a: str
    xyz_a: Vector
    link_b: str
    xyz_b: Vector
    line: int | None = None


@dataclass(frozen=True, slots=True)
class Annotations:
    """Everything that pinbound needs beside the URDF proper.

    Attributes:
        contact_tolerance: Metres; see design "contact angle".
        home: A feasible configuration by joint name [rad or m]; coordinates that are left out are at zero.
        points: Marked points by name.
        boundaries: Boundaries in the order of the file.
        closures: Closures in the order of the file.
        assumptions: Sentences that every report of this robot must show.
        home_line: Line of the home element.
    """

    contact_tolerance: float = CONTACT
    home: Mapping[str, float] = field(default_factory=dict[str, float])
    points: Mapping[str, Point] = field(default_factory=dict[str, Point])
    boundaries: tuple[BoundaryMark, ...] = ()
    closures: tuple[ClosureMark, ...] = ()
    assumptions: tuple[str, ...] = ()
    home_line: int | None = None


@dataclass(frozen=True, slots=True)
class RawItem:
    """One element or YAML entry before validation: its kind, its fields as written, its place."""

    kind: str
    fields: Mapping[str, Any]
    source: str
    line: int | None


_FIELDS: Mapping[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "point": (("name", "link", "xyz"), ("radius",)),
    "boundary": (("name", "a", "b"), ("min_distance",)),
    "closure": (("name", "link_a", "xyz_a", "link_b", "xyz_b"), ()),
    "settings": ((), ("contact_tolerance",)),
    "assumption": (("text",), ()),
}
"""Required and optional fields of each kind; the fields of `home` are joint names."""

_SIDECAR_LISTS = {
    "points": "point",
    "boundaries": "boundary",
    "closures": "closure",
    "assumptions": "assumption",
}


def read_inline(root: etree._Element, problems: Problems) -> list[RawItem]:
    """Return the raw items of every `<pinbound:annotations>` block of a `<robot>`; there may be several."""
    items: list[RawItem] = []
    for element in root.iter(etree.Element):
        namespace = etree.QName(element).namespace
        if namespace is None or "pinbound" not in namespace:
            continue
        if namespace != NAMESPACE:
            problems.add(
                f"<{local_name(element)}> is in the namespace {namespace!r}",
                f'This version reads xmlns:pinbound="{NAMESPACE}"',
                element.sourceline,
            )
        elif local_name(element) == "annotations" and element.getparent() is root:
            items += _read_block(element, problems)
        elif not _inside_annotations(element, root):
            problems.add(
                f"<pinbound:{local_name(element)}> stands outside <pinbound:annotations>",
                "Move it into a <pinbound:annotations> directly below <robot>",
                element.sourceline,
            )
    return items


def _inside_annotations(element: etree._Element, root: etree._Element) -> bool:
    block = f"{{{NAMESPACE}}}annotations"
    return any(above.tag == block and above.getparent() is root for above in element.iterancestors())


def _read_block(block: etree._Element, problems: Problems) -> list[RawItem]:
    items = [RawItem("settings", dict(block.attrib), problems.source, block.sourceline)] if block.attrib else []
    for element in block.iterchildren(etree.Element):
        kind = local_name(element)
        valid = [kind for kind in _FIELDS if kind != "settings"] + ["home"]
        if etree.QName(element).namespace != NAMESPACE or kind not in valid:
            problems.add(
                f"<{kind}> is no annotation",
                name_hint(kind, valid),
                element.sourceline,
            )
            continue
        for child in element.iterchildren(etree.Element):
            problems.add(f"<{local_name(child)}> stands inside <pinbound:{kind}>", "Remove it", child.sourceline)
        fields: dict[str, Any] = {str(key): value for key, value in element.attrib.items()}
        text = " ".join((element.text or "").split())
        if kind == "assumption":
            fields["text"] = text
        elif text:
            problems.add(f"<pinbound:{kind}> holds the text {text!r}", "Use attributes", element.sourceline)
        items.append(RawItem(kind, fields, problems.source, element.sourceline))
    return items


def read_sidecar(path: Path, problems: Problems) -> list[RawItem]:
    """Return the raw items of a YAML sidecar; anchors, duplicate keys and unknown keys are faults."""
    source = path.name
    try:
        text = path.read_text(encoding="utf-8")
        if any(isinstance(event, yaml.AliasEvent) for event in yaml.parse(text, Loader=yaml.SafeLoader)):
            problems.add("uses a YAML alias (*name)", "Write the values out", source=source)
            return []
        node = yaml.compose(text, Loader=yaml.SafeLoader)
    except OSError as error:
        problems.add(f"cannot be read ({error.strerror})", "Check the path and its permissions", source=str(path))
        return []
    except (yaml.YAMLError, UnicodeDecodeError, RecursionError) as error:
        mark = getattr(error, "problem_mark", None)
        reason = getattr(error, "problem", None) or str(error) or type(error).__name__
        line = mark.line + 1 if mark else None
        problems.add(f"is not YAML: {reason}", "Mend the YAML", line, source)
        return []
    if node is None:
        return []
    return _Sidecar(source, problems).items(node)


class _Sidecar:
    """Walk the YAML nodes, which know their lines, into raw items."""

    def __init__(self, source: str, problems: Problems) -> None:
        self.source, self.problems = source, problems

    def items(self, node: yaml.Node) -> list[RawItem]:
        items: list[RawItem] = []
        valid = ["contact_tolerance", "home", *_SIDECAR_LISTS]
        for key, value in self._mapping(node, "the sidecar").items():
            line = _node_line(value)
            if key == "contact_tolerance":
                items.append(RawItem("settings", {key: self._plain(value)}, self.source, line))
            elif key == "home":
                fields = {name: self._plain(angle) for name, angle in self._mapping(value, "home").items()}
                items.append(RawItem("home", fields, self.source, line))
            elif key in _SIDECAR_LISTS:
                items += self._list(key, value)
            else:
                hint = name_hint(key, valid)
                self.problems.add(f"{key!r} is no key of a sidecar", hint, line, self.source)
        return items

    def _list(self, key: str, node: yaml.Node) -> list[RawItem]:
        if not isinstance(node, yaml.SequenceNode):
            self.problems.add(f"{key!r} is not a list", "Write [ ... ]", _node_line(node), self.source)
            return []
        items: list[RawItem] = []
        for entry in node.value:
            if key == "assumptions":
                fields: dict[str, Any] = {"text": self._plain(entry)}
            else:
                fields = {name: self._plain(value) for name, value in self._mapping(entry, key).items()}
            items.append(RawItem(_SIDECAR_LISTS[key], fields, self.source, _node_line(entry)))
        return items

    def _mapping(self, node: yaml.Node, what: str) -> dict[str, yaml.Node]:
        if not isinstance(node, yaml.MappingNode):
            self.problems.add(f"an entry of {what} is no mapping", "Write {key: value}", _node_line(node), self.source)
            return {}
        found: dict[str, yaml.Node] = {}
        for key, value in node.value:
            name = str(key.value)
            if name in found:
                self.problems.add(f"{name!r} is given twice in {what}", "Keep one", _node_line(key), self.source)
            found[name] = value
        return found

    @staticmethod
    def _plain(node: yaml.Node) -> str:
        """Return the node as an attribute would say it: scalars as text, lists of them joined by spaces."""
        if isinstance(node, yaml.SequenceNode):
            return " ".join(str(entry.value) for entry in node.value)
        return str(node.value)


def _node_line(node: yaml.Node) -> int:
    return node.start_mark.line + 1


def validate(items: Collection[RawItem], links: Collection[str], problems: Problems) -> Annotations:
    """Return the annotations that are sound; every fault of the others goes to `problems`.

    Args:
        items: Raw items, inline ones and a sidecar's together.
        links: The robot's links.
        problems: Where faults go.
    """
    return _Validator(links, problems).validate(items)


class _Validator:
    """Turn raw items into annotations, one kind at a time, so that references can be checked."""

    def __init__(self, links: Collection[str], problems: Problems) -> None:
        self.links, self.problems = links, problems
        self.item = RawItem("", {}, problems.source, None)

    def validate(self, items: Collection[RawItem]) -> Annotations:
        by_kind: dict[str, list[RawItem]] = {}
        for item in items:
            by_kind.setdefault(item.kind, []).append(item)
        settings = self._once([*by_kind.get("settings", [])], "contact_tolerance")
        homes = by_kind.get("home", [])
        for extra in homes[1:]:
            self.item = extra
            self._fault("home is given twice", f"Keep one (the first is on line {homes[0].line})")
        points = {p.name: p for p in map(self._point, self._unique(by_kind.get("point", []))) if p}
        marked = {str(item.fields.get("name")) for item in by_kind.get("point", [])}
        boundaries = [self._boundary(i, points, marked) for i in self._unique(by_kind.get("boundary", []))]
        closures = [self._closure(item) for item in self._unique(by_kind.get("closure", []))]
        return Annotations(
            contact_tolerance=settings,
            home=self._home(homes[0]) if homes else {},
            points=points,
            boundaries=tuple(boundary for boundary in boundaries if boundary),
            closures=tuple(closure for closure in closures if closure),
            assumptions=tuple(
                str(item.fields["text"]) for item in by_kind.get("assumption", []) if self._complete(item)
            ),
            home_line=homes[0].line if homes else None,
        )

    def _fault(self, message: str, remedy: str) -> None:
        self.problems.add(message, remedy, self.item.line, self.item.source)

    def _once(self, settings: list[RawItem], key: str) -> float:
        given = [item for item in settings if self._complete(item) and key in item.fields]
        for extra in given[1:]:
            self.item = extra
            self._fault(f"{key} is given twice", f"Keep one (the first is on line {given[0].line})")
        if not given:
            return CONTACT
        self.item = given[0]
        return self._length(key, CONTACT)

    def _unique(self, items: list[RawItem]) -> list[RawItem]:
        first: dict[str, RawItem] = {}
        kept: list[RawItem] = []
        for item in items:
            self.item = item
            if not self._complete(item):
                continue
            name = str(item.fields["name"])
            if name in first:
                self._fault(f"{item.kind} {name!r} is declared twice (first on line {first[name].line})", "Rename one")
                continue
            first[name] = item
            kept.append(item)
        return kept

    def _complete(self, item: RawItem) -> bool:
        """Report missing and unknown fields; say whether the required ones are there."""
        self.item = item
        required, optional = _FIELDS[item.kind]
        what = f"{item.kind} {item.fields['name']!r}" if item.fields.get("name") else f"a {item.kind}"
        for key in item.fields:
            if key not in required + optional:
                hint = name_hint(key, required + optional)
                self._fault(f"{what} has the unknown attribute {key!r}", hint)
        missing = [key for key in required if not str(item.fields.get(key, "")).strip()]
        if missing:
            self._fault(f"{what} has no {', no '.join(missing)}", f"It needs {', '.join(required)}")
        return not missing

    def _numbers(self, key: str, count: int) -> tuple[float, ...] | None:
        numbers = parse_floats(str(self.item.fields[key]), count)
        if isinstance(numbers, str):
            name = self.item.fields.get("name")
            what = self.item.kind if name is None else f"{self.item.kind} {name!r}"
            self._fault(f"{key} of {what}: {numbers}", "Write finite numbers, metres or radians")
            return None
        return numbers

    def _vector(self, key: str) -> Vector | None:
        numbers = self._numbers(key, 3)
        return None if numbers is None else (numbers[0], numbers[1], numbers[2])

    def _length(self, key: str, default: float) -> float:
        """Return a length that may be left out, and must not be negative."""
        if key not in self.item.fields:
            return default
        numbers = self._numbers(key, 1)
        if numbers is None:
            return default
        if numbers[0] < 0.0:
            self._fault(f"{key} = {numbers[0]:g} is negative", "Give a length in metres, zero or more")
        return numbers[0]

    def _link(self, key: str) -> str | None:
        name = str(self.item.fields[key])
        if name in self.links:
            return name
        what = f"{self.item.kind} {self.item.fields['name']!r}"
        self._fault(f"{what} names the link {name!r}, which does not exist", name_hint(name, self.links))
        return None

    def _point(self, item: RawItem) -> Point | None:
        self.item = item
        link, xyz, radius = self._link("link"), self._vector("xyz"), self._length("radius", 0.0)
        if link is None or xyz is None:
            return None
        return Point(str(item.fields["name"]), link, xyz, radius, item.line)

    def _boundary(self, item: RawItem, points: dict[str, Point], marked: set[str]) -> BoundaryMark | None:
        self.item = item
        name, a, b = (str(item.fields[key]) for key in ("name", "a", "b"))
        for point in (a, b):
            if point not in marked:
                hint = name_hint(point, points)
                self._fault(f"boundary {name!r} names the point {point!r}, which is not marked", hint)
        distance = self._length("min_distance", 0.0)
        if a not in points or b not in points:
            return None
        if points[a].link == points[b].link:
            self._fault(
                f"boundary {name!r}: both points are on link {points[a].link!r}, so their distance never changes",
                "Take points of two links",
            )
            return None
        return BoundaryMark(name, a, b, distance, item.line)

    def _closure(self, item: RawItem) -> ClosureMark | None:
        self.item = item
        link_a, link_b = self._link("link_a"), self._link("link_b")
        xyz_a, xyz_b = self._vector("xyz_a"), self._vector("xyz_b")
        if link_a is None or link_b is None or xyz_a is None or xyz_b is None:
            return None
        if link_a == link_b:
            self._fault(f"closure {item.fields['name']!r} joins link {link_a!r} to itself", "Name two links")
            return None
        return ClosureMark(str(item.fields["name"]), link_a, xyz_a, link_b, xyz_b, item.line)

    def _home(self, item: RawItem) -> dict[str, float]:
        self.item = item
        home: dict[str, float] = {}
        for name in item.fields:
            numbers = self._numbers(name, 1)
            if numbers is not None:
                home[name] = numbers[0]
        return home
