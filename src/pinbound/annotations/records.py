"""What a user can mark on a robot, as immutable records; and the raw items that both spellings become."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

from pinbound.annotations.marks import Box, Cylinder, Hull, Line, Mark, Plane, Point, Segment, Sweep, Vector
from pinbound.exceptions import Problems
from pinbound.tolerances import CLOSURE, CONTACT
from pinbound.values import FrozenDict, Value

__all__ = [
    "FIELDS",
    "KINDS",
    "MARK_KINDS",
    "NAMESPACE",
    "Annotations",
    "BoundaryMark",
    "ClosureMark",
    "FollowerMark",
    "LeftOutMark",
    "LimitMark",
    "RawItem",
    "kind_of",
    "raw_items",
]

NAMESPACE = "urn:pinbound:1"

FIELDS: Mapping[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "point": (("name", "link", "xyz"), ("radius",)),
    "segment": (("name", "link", "xyz_a", "xyz_b"), ("radius",)),
    "sweep": (("name", "link", "xyz", "ways"), ("radius",)),
    "hull": (("name", "link", "vertices"), ("radius",)),
    "box": (("name", "link", "xyz", "rpy", "size"), ("radius",)),
    "cylinder": (("name", "link", "xyz_a", "xyz_b", "radius"), ()),
    "line": (("name", "link", "xyz", "direction"), ("radius",)),
    "plane": (("name", "link", "xyz", "normal"), ()),
    "boundary": (("name", "a", "b"), ("min_distance", "stop")),
    "closure": (("name", "link_a", "xyz_a", "link_b", "xyz_b"), ("passive", "tolerance")),
    "follower": (("joint", "primary"), ("multiplier", "offset")),
    "limit": (("joint", "lower", "upper"), ()),
    "left_out": (("a", "b", "reason"), ()),
    "settings": ((), ("contact_tolerance",)),
    "assumption": (("text",), ()),
}
"""Required and optional fields of each kind; the fields of `home` are joint names."""

KINDS: Mapping[type[Mark], str] = {
    Point: "point",
    Segment: "segment",
    Sweep: "sweep",
    Hull: "hull",
    Box: "box",
    Cylinder: "cylinder",
    Line: "line",
    Plane: "plane",
}
"""The kinds of what is marked on a link."""

MARK_KINDS: tuple[str, ...] = tuple(KINDS.values())


def kind_of(mark: Mark) -> str:
    """Return what kind of mark it is, as files call it.

    Example:
        >>> kind_of(Point("p", "arm", (0.0, 0.0, 0.0)))
        'point'
    """
    return KINDS[type(mark)]


@dataclass(frozen=True, slots=True)
class BoundaryMark:
    """Two marks, by name, that must stay `min_distance` [m] apart, surface to surface.

    `stop` declares two points of zero threshold and one effective angle as a stop: contact is the angle at which their
    two arms align, whatever small difference their lengths have.
    """

    name: str
    a: str
    b: str
    min_distance: float = 0.0
    stop: bool = False
    line: int | None = None


@dataclass(frozen=True, slots=True)
class ClosureMark:
    """A pin: `xyz_a` [m] of `link_a` and `xyz_b` [m] of `link_b` are the same place.

    In an open tree `passive` may name the joints that follow; by default those furthest from the root do. `tolerance`
    [m] is what the sides of its loop may differ by in all; what they do is carried as an error of the links' places.
    """

    name: str
    link_a: str
    xyz_a: Vector
    link_b: str
    xyz_b: Vector
    passive: tuple[str, ...] = ()
    tolerance: float = CLOSURE
    line: int | None = None


@dataclass(frozen=True, slots=True)
class FollowerMark:
    """A `<mimic>` that the URDF lacks, or has wrong: `theta = multiplier * theta_primary + offset`."""

    joint: str
    primary: str
    multiplier: float = 1.0
    offset: float = 0.0
    line: int | None = None


@dataclass(frozen=True, slots=True)
class LimitMark:
    """Limits [rad or m] that replace those of the URDF."""

    joint: str
    lower: float
    upper: float
    line: int | None = None


@dataclass(frozen=True, slots=True)
class LeftOutMark:
    """Two links, by name, that no boundary watches, and the reason; `source` is the file that says so.

    It is a statement, not a proof: `robot.coverage` lists it with its source, unless it can prove the pair itself.
    """

    a: str
    b: str
    reason: str
    source: str = "annotations"
    line: int | None = None


@dataclass(frozen=True, slots=True)
class RawItem(Value):
    """One element or YAML entry before validation: its kind, its fields as written, its place.

    Fields are text; `passive` given as a list is a tuple of names, which may hold spaces.
    """

    kind: str
    fields: Mapping[str, Any]
    source: str
    line: int | None


@dataclass(frozen=True)
class Annotations(Value):
    """Everything that pinbound needs beside the URDF proper.

    Attributes:
        contact_tolerance: Metres; see design "contact angle".
        home: A feasible configuration by joint name [rad or m]; coordinates that are left out are at zero.
        marks: Marked points, segments, sweeps, lines and planes by name.
        boundaries: Boundaries in the order of the file.
        closures: Closures in the order of the file.
        followers: Followers that replace the URDF's own `<mimic>`.
        limits: Limits that replace the URDF's own.
        left_out: Pairs of links that are left out, with reasons.
        assumptions: Sentences that every report of this robot must show.
        home_line: Line of the home element.
        sources: The file that each of these was read from, by what it is: `"home"`, `"boundary stop"`, `"limit q1"`.
    """

    contact_tolerance: float = CONTACT
    home: Mapping[str, float] = field(default_factory=dict[str, float])
    marks: Mapping[str, Mark] = field(default_factory=dict[str, Mark])
    boundaries: tuple[BoundaryMark, ...] = ()
    closures: tuple[ClosureMark, ...] = ()
    followers: tuple[FollowerMark, ...] = ()
    limits: tuple[LimitMark, ...] = ()
    left_out: tuple[LeftOutMark, ...] = ()
    assumptions: tuple[str, ...] = ()
    home_line: int | None = None
    sources: Mapping[str, str] = field(default_factory=dict[str, str], compare=False, repr=False)

    @property
    def points(self) -> FrozenDict[str, Point]:
        """Marked points by name."""
        return FrozenDict({name: mark for name, mark in self.marks.items() if isinstance(mark, Point)})

    @classmethod
    def of(cls, marks: Iterable[Mark], boundaries: Iterable[BoundaryMark] = (), **others: Any) -> Annotations:
        """Return annotations of a sequence of marks and of boundaries between them.

        Example:
            >>> ends = [Point("p", "base", (1.0, 0.0, 0.0)), Point("s", "arm", (0.0, 0.0, 1.0), radius=0.01)]
            >>> print(Annotations.of(ends, [BoundaryMark("stop", "p", "s")]).to_yaml())
            contact_tolerance: 2.0e-05
            points:
            - name: p
              link: base
              xyz: [1.0, 0.0, 0.0]
              radius: 0.0
            - name: s
              link: arm
              xyz: [0.0, 0.0, 1.0]
              radius: 0.01
            boundaries:
            - {name: stop, a: p, b: s, min_distance: 0.0}
            <BLANKLINE>
        """
        return cls(marks={mark.name: mark for mark in marks}, boundaries=tuple(boundaries), **others)

    @classmethod
    def load(cls, path: str | Path) -> Annotations:
        """Read a sidecar (.yaml), or the spheres of an .srdf; names of links and joints are not checked yet.

        Raises:
            InputError: If anything is wrong with the file; all its faults at once.
        """
        from pinbound.annotations.sidecar import read_sidecar
        from pinbound.annotations.srdf import read_srdf
        from pinbound.annotations.validation import validate

        file = Path(path)
        problems = Problems(file.name)
        items = read_srdf(file, problems).items if file.suffix == ".srdf" else read_sidecar(file, problems)
        annotations = validate(items, problems)
        problems.raise_if_any()
        return annotations

    def to_yaml(self) -> str:
        """Return the sidecar that says the same."""
        from pinbound.annotations.sidecar import sidecar_text

        return sidecar_text(raw_items(self, "annotations"))

    def to_xml(self) -> str:
        """Return the `<pinbound:annotations>` block that says the same, to paste below `<robot>`.

        Raises:
            UnsupportedError: If a joint of home has a name that XML does not allow for an attribute.
        """
        from pinbound.annotations.inline import inline_text

        return inline_text(raw_items(self, "annotations"))

    def save(self, path: str | Path) -> None:
        """Write the sidecar; every float64 is given back exactly by `load`."""
        Path(path).write_text(self.to_yaml(), encoding="utf-8")


def raw_items(annotations: Annotations, source: str) -> list[RawItem]:
    """Return annotations as raw items: what a file that says the same would be read as."""

    def item(kind: str, record: Any) -> RawItem:
        required, optional = FIELDS[kind]
        values = {key: getattr(record, key) for key in (*required, *optional)}
        kept = {
            key: value
            for key, value in values.items()
            if key in required or (value not in ((), "") and value is not False)
        }
        said = {key: value if key == "passive" else _text(value) for key, value in kept.items()}
        return RawItem(kind, said, source, record.line)

    items = [RawItem("settings", {"contact_tolerance": _text(annotations.contact_tolerance)}, source, None)]
    if annotations.home:
        home = {name: _text(value) for name, value in annotations.home.items()}
        items.append(RawItem("home", home, source, annotations.home_line))
    items += [item(kind_of(mark), mark) for mark in annotations.marks.values()]
    items += [item("boundary", boundary) for boundary in annotations.boundaries]
    items += [item("closure", closure) for closure in annotations.closures]
    items += [item("follower", follower) for follower in annotations.followers]
    items += [item("limit", limit) for limit in annotations.limits]
    items += [item("left_out", pair) for pair in annotations.left_out]
    return items + [RawItem("assumption", {"text": text}, source, None) for text in annotations.assumptions]


def _text(value: Any) -> str:
    """Return a field as a file says it; `repr` gives every float64 back exactly."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, tuple):
        return " ".join(_text(part) for part in cast(tuple[Any, ...], value))
    return value if isinstance(value, str) else repr(float(value))
