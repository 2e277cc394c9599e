"""All annotations of one robot: read from any format, validated, and written again."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

from pinbound.annotations.files import read_annotation_file
from pinbound.annotations.inline import inline_text
from pinbound.annotations.marks import Mark, Point
from pinbound.annotations.mesh_hulls import HullFiles
from pinbound.annotations.records import (
    FIELDS,
    Axis,
    BoundaryMark,
    ClosureMark,
    Condition,
    FollowerMark,
    LeftOutMark,
    LimitMark,
    RawItem,
    Rule,
    kind_of,
)
from pinbound.annotations.sidecar import sidecar_text
from pinbound.annotations.validation import sound_fields
from pinbound.exceptions import Problems
from pinbound.tolerances import CONTACT
from pinbound.values import FrozenDict, Value

__all__ = ["Annotations", "raw_items", "validate"]


@dataclass(frozen=True)
class Annotations(Value):
    """All data that pinbound needs besides the URDF itself.

    Attributes:
        contact_tolerance: [m], the accuracy of the lengths in the file (`docs/contacts.md`).
        home: A feasible configuration by joint name [rad or m]; joints that it does not name are at zero.
        marks: Marked points, segments, sweeps, lines and planes by name.
        boundaries: Boundaries in the order of the file.
        closures: Closures in the order of the file.
        followers: Mimic joints that replace the URDF's own `<mimic>`.
        limits: Limits that replace the URDF's own.
        left_out: Pairs of links that have no boundary, with reasons.
        rules: Linear rules on joints, in the order of the file.
        axes: Coordinates that are sums of joints; each replaces one joint in q.
        assumptions: Sentences that every report of this robot must show.
        home_line: Line of the home element.
        sources: The file of each item, by keys such as `"home"`, `"boundary stop"`, `"limit q1"`.

    Example:
        >>> marks = Annotations.of([Point("tip", "arm", (0.0, 0.0, 0.1), radius=0.01)])
        >>> list(marks.marks), marks.contact_tolerance
        (['tip'], 2e-05)
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
    rules: tuple[Rule, ...] = ()
    axes: tuple[Axis, ...] = ()
    sources: Mapping[str, str] = field(default_factory=dict[str, str], compare=False, repr=False)

    @property
    def points(self) -> FrozenDict[str, Point]:
        """Marked points by name."""
        return FrozenDict({name: mark for name, mark in self.marks.items() if isinstance(mark, Point)})

    @classmethod
    def of(cls, marks: Iterable[Mark], boundaries: Iterable[BoundaryMark] = (), **others: Any) -> Annotations:
        """Return annotations made of marks and of boundaries between them.

        Args:
            marks: The marks, in any order, with different names.
            boundaries: The boundaries, in the order that the robot will have.
            others: Further fields of `Annotations`, by name.

        Raises:
            InputError: If two marks have one name.

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
        found, problems = dict[str, Mark](), Problems("annotations")
        for mark in marks:
            if mark.name in found:
                problems.add(f"two marks have the name {mark.name!r}", "Rename one, or remove it")
            found[mark.name] = mark
        problems.raise_if_any()
        return cls(marks=found, boundaries=tuple(boundaries), **others)

    @classmethod
    def load(cls, path: str | Path) -> Annotations:
        """Read a sidecar (.yaml) or an .srdf; names of links and joints are not checked yet.

        Meshes of hulls are read, too; relative names are searched for beside the file.

        Raises:
            InputError: If the file has faults; the error lists all of them.
        """
        file = Path(path)
        problems = Problems(file.name)
        annotations = validate(read_annotation_file(file, problems).items, problems)
        problems.raise_if_any()
        return annotations

    def to_yaml(self) -> str:
        """Return the text of a sidecar with the same content."""
        return sidecar_text(raw_items(self, "annotations"))

    def to_xml(self) -> str:
        """Return a `<pinbound:annotations>` block with the same content, to paste below `<robot>`.

        Raises:
            UnsupportedError: If a joint of home has a name that XML does not allow for an attribute.
        """
        return inline_text(raw_items(self, "annotations"))

    def save(self, path: str | Path) -> None:
        """Write the sidecar; `load` gives every float64 back exactly."""
        Path(path).write_text(self.to_yaml(), encoding="utf-8")


def validate(
    items: Collection[RawItem],
    problems: Problems,
    links: Collection[str] | None = None,
    joints: Collection[str] | None = None,
    files: HullFiles | None = None,
) -> Annotations:
    """Return the valid annotations; every fault of the others goes to `problems`.

    Args:
        items: Raw items, inline ones and a sidecar's together.
        problems: Collects the faults.
        links: The robot's links; None: do not check the names.
        joints: The robot's joints; None: do not check the names.
        files: Reads the meshes that hulls name.
    """
    return Annotations(**sound_fields(items, problems, links, joints, files))


def raw_items(annotations: Annotations, source: str) -> list[RawItem]:
    """Return annotations as the raw items that a file with the same content gives."""

    def item(kind: str, record: Any) -> RawItem:
        required, optional = FIELDS[kind]
        values = {key: getattr(record, key) for key in (*required, *optional)}
        kept = {key: value for key, value in values.items() if key in required or not _says_nothing(value)}
        said = {key: value if key in ("passive", "active") else _text(value) for key, value in kept.items()}
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
    for axis in annotations.axes:
        fields = {"name": axis.name, "instead_of": axis.instead_of, "coefficients": _pairs(axis.coefficients)}
        items.append(RawItem("axis", fields, source, axis.line))
    items += [RawItem("rule", _rule_fields(rule), source, rule.line) for rule in annotations.rules]
    items += [item("left_out", pair) for pair in annotations.left_out]
    return items + [RawItem("assumption", {"text": text}, source, None) for text in annotations.assumptions]


def _pairs(coefficients: Mapping[str, float]) -> tuple[tuple[str, str], ...]:
    return tuple((name, _text(c)) for name, c in coefficients.items())


def _rule_fields(rule: Rule | Condition) -> dict[str, Any]:
    """Return the fields of a rule or of a condition; infinite ends are left out."""
    fields: dict[str, Any] = {"name": rule.name} if isinstance(rule, Rule) else {}
    fields["coefficients"] = _pairs(rule.coefficients)
    fields |= {key: _text(end) for key in ("lower", "upper") if math.isfinite(end := getattr(rule, key))}
    if isinstance(rule, Rule) and rule.where:
        fields["where"] = tuple(_rule_fields(condition) for condition in rule.where)
    return fields


def _says_nothing(value: object) -> bool:
    return value is False or (isinstance(value, (str, tuple)) and not value)


def _text(value: Any) -> str:
    """Return a field as the text in a file; `repr` keeps every float64 exactly."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, tuple):
        return " ".join(_text(part) for part in cast(tuple[Any, ...], value))
    return value if isinstance(value, str) else repr(float(value))
