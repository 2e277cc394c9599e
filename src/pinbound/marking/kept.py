"""The annotations of the robot that a proposal repeats, and the names that are still unused."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, cast

from pinbound.annotations import MARK_KINDS, Annotations, LeftOutMark, Mark, RawItem, read_inline
from pinbound.coverage.covers import Cover
from pinbound.exceptions import Problems
from pinbound.robot.robot import Robot

__all__ = ["kept", "known", "unused"]


def known(robot: Robot, covers: Sequence[Cover]) -> list[Cover]:
    """Return the covers, with the marks that the robot already has if they exist; other covers get unused names."""
    alike = {_unnamed(mark): mark for mark in robot.annotations.marks.values()}
    names = set(robot.annotations.marks)
    found: list[Cover] = []
    for cover in covers:
        marks = [alike.get(_unnamed(mark)) or replace(mark, name=unused(mark.name, names)) for mark in cover.marks]
        found.append(replace(cover, marks=tuple(marks)))
    return found


def _unnamed(mark: Mark) -> Mark:
    return replace(mark, name="", line=None)


def unused(name: str, names: set[str]) -> str:
    """Return the name, or the name with a number, that is unused, and mark it as used."""
    found, count = name, 1
    while found in names:
        count += 1
        found = f"{name}.{count}"
    names.add(found)
    return found


def kept(robot: Robot) -> Annotations:
    """Return the annotations outside the URDF. A sidecar that replaces the present one must repeat them."""
    inline = read_inline(robot.document.root, Problems(robot.document.label))
    said = {(_GROUPS.get(item.kind, item.kind), _key(item)) for item in inline}
    own = robot.annotations

    def rest(group: str, records: Sequence[Any], key: str = "name") -> tuple[Any, ...]:
        return tuple(replace(one, line=None) for one in records if (group, getattr(one, key)) not in said)

    return Annotations(
        contact_tolerance=own.contact_tolerance,
        home={} if any(item.kind == "home" for item in inline) else own.home,
        marks={mark.name: mark for mark in cast("tuple[Mark, ...]", rest("mark", [*own.marks.values()]))},
        boundaries=rest("boundary", own.boundaries),
        closures=rest("closure", own.closures),
        followers=rest("follower", own.followers, "joint"),
        limits=rest("limit", own.limits, "joint"),
        rules=rest("rule", own.rules),
        axes=rest("axis", own.axes),
        left_out=tuple(
            LeftOutMark(one.a, one.b, one.reason) for one in own.left_out if one.source != robot.document.label
        ),
        assumptions=tuple(text for text in own.assumptions if ("assumption", text) not in said),
    )


_GROUPS = dict.fromkeys(MARK_KINDS, "mark")


def _key(item: RawItem) -> str:
    keys = {"follower": "joint", "limit": "joint", "assumption": "text"}
    return str(item.fields.get(keys.get(item.kind, "name"), ""))
