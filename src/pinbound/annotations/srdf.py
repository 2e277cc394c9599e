"""Reads an SRDF: spheres of `link_sphere_approximation` as points, `disable_collisions` as pairs that are left out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

from lxml import etree

from pinbound.annotations.records import LeftOutMark, RawItem
from pinbound.exceptions import Problems
from pinbound.model.document import parse_file, parse_floats
from pinbound.units import several
from pinbound.values import Value

__all__ = ["RIGID", "Srdf", "read_disabled", "read_srdf"]

RIGID = "never move against each other"
"""Reason for leaving out two links that fixed joints connect."""

_BY_DEFAULT = "disable_default_collisions"
_NAMED = 5  # how many pairs or links a note names


@dataclass(frozen=True)
class Srdf(Value):
    """Spheres and pairs of links of an SRDF.

    Attributes:
        items: Raw items: points, boundaries, and pairs of links that the file leaves out.
        left_out: The reason why two links with spheres have no boundary, by pair of links, in the order of the file.
        notes: One sentence for each thing that was left out or ignored.
    """

    items: tuple[RawItem, ...]
    left_out: Mapping[tuple[str, str], str]
    notes: tuple[str, ...]


def read_srdf(path: Path, problems: Problems, robot: etree._Element | None = None) -> Srdf:
    """Read a point for every sphere, a boundary for every pair of spheres that may collide, and left-out pairs.

    A sphere of radius 0 means that the link has no body. Pairs under `disable_collisions` are left out, and so are
    links under `disable_default_collisions` unless `enable_collisions` names the pair. Links that fixed joints connect
    are left out, too, because they never move relative to each other. A file without spheres gives left-out pairs only.

    Args:
        path: The SRDF.
        problems: Collects the faults.
        robot: The `<robot>` element of the URDF, which has the fixed joints; None: not known.
    """
    root, source = parse_file(path), path.name
    items: list[RawItem] = []
    names: dict[str, list[str]] = {}
    for element in root.iter("link_sphere_approximation"):
        link = element.get("link", "")
        for sphere in element.iter("sphere"):
            center, radius = sphere.get("center", ""), sphere.get("radius", "")
            if parse_floats(radius, 1) == (0.0,):
                continue
            known = names.setdefault(link, [])
            fields = {"name": f"{link}.{len(known)}", "link": link, "xyz": center, "radius": radius}
            items.append(RawItem("point", fields, source, sphere.sourceline))
            known.append(fields["name"])
    if not names and root.find(".//disable_collisions") is None:
        said = "holds no <link_sphere_approximation> with a sphere, and no <disable_collisions>"
        problems.add(said, "Give an SRDF that holds one of them", 1, source)
    left_out = _left_out(root, list(names), {} if robot is None else _rigid_groups(robot))
    for link_a, link_b in combinations(names, 2):
        if (link_a, link_b) not in left_out:
            pairs = [(a, b) for a in names[link_a] for b in names[link_b]]
            items += [RawItem("boundary", {"name": f"{a}-{b}", "a": a, "b": b}, source, None) for a, b in pairs]
    items += _stated(root, source, left_out)
    known = None if robot is None else {str(link.get("name")) for link in robot.findall("link")}
    notes = _notes(root, source, left_out, known)
    if robot is not None and root.get("name") and root.get("name") != robot.get("name"):
        said = f"{source} says that it is of the robot {root.get('name')!r}, and this one is {robot.get('name')!r}"
        notes.append(f"{said}: check that the pairs of links that it leaves out are right here")
    return Srdf(tuple(items), left_out, tuple(notes))


def read_disabled(path: Path, links: Iterable[str]) -> tuple[LeftOutMark, ...]:
    """Return the pairs of links that an SRDF disables: by name, or by `disable_default_collisions` of a link.

    Args:
        path: The SRDF.
        links: Links with bodies; `disable_default_collisions` applies to pairs of them.

    Raises:
        InputError: If the file cannot be read, or is no XML.
    """
    root = parse_file(path)
    found = [
        LeftOutMark(str(item.fields["a"]), str(item.fields["b"]), str(item.fields["reason"]), item.source, item.line)
        for item in _stated(root, path.name, {})
    ]
    known = {frozenset((one.a, one.b)) for one in found}
    by_default = [pair for pair, why in _left_out(root, list(links), {}).items() if why == _BY_DEFAULT]
    found += [LeftOutMark(*pair, _BY_DEFAULT, path.name) for pair in by_default if frozenset(pair) not in known]
    return tuple(found)


def _left_out(root: etree._Element, links: list[str], rigid: Mapping[str, str]) -> dict[tuple[str, str], str]:
    """Return the reason of each pair of links that has no boundary."""
    off, on = _pairs(root, "disable_collisions"), _pairs(root, "enable_collisions")
    closed = {element.get("link", "") for element in root.iter("disable_default_collisions")}
    found: dict[tuple[str, str], str] = {}
    for a, b in combinations(links, 2):
        pair = frozenset((a, b))
        if pair in off:
            found[a, b] = f"disable_collisions: {off[pair] or 'no reason given'}"
        elif pair & closed and pair not in on:
            found[a, b] = _BY_DEFAULT
        elif a in rigid and rigid[a] == rigid.get(b):
            found[a, b] = RIGID
    return found


def _stated(root: etree._Element, source: str, left_out: Mapping[tuple[str, str], str]) -> list[RawItem]:
    """Return the pairs that the file itself leaves out, each with its reason, also for links without spheres."""
    items: list[RawItem] = []
    for element in root.iter("disable_collisions"):
        a, b, reason = (element.get(key, "").strip() for key in ("link1", "link2", "reason"))
        if a and b and a != b:
            fields = {"a": a, "b": b, "reason": reason or "disable_collisions"}
            items.append(RawItem("left_out", fields, source, element.sourceline))
    for (a, b), reason in left_out.items():
        if reason == _BY_DEFAULT:
            items.append(RawItem("left_out", {"a": a, "b": b, "reason": reason}, source, None))
    return items


def _pairs(root: etree._Element, tag: str) -> dict[frozenset[str], str]:
    """Return the pairs of links in elements with one tag, and their reasons."""
    return {
        frozenset((element.get("link1", ""), element.get("link2", ""))): element.get("reason", "")
        for element in root.iter(tag)
    }


def _rigid_groups(robot: etree._Element) -> dict[str, str]:
    """Return for each link the topmost link to which only fixed joints connect it."""
    above: dict[str, str] = {}
    for joint in robot.findall("joint"):
        parent, child = joint.find("parent"), joint.find("child")
        if joint.get("type") == "fixed" and parent is not None and child is not None:
            above[child.get("link", "")] = parent.get("link", "")
    groups: dict[str, str] = {}
    for link in robot.findall("link"):
        name, seen = str(link.get("name")), set[str]()
        top = name
        while top in above and top not in seen:  # a cycle of joints is a fault that another check reports
            seen.add(top)
            top = above[top]
        groups[name] = top
    return groups


def _notes(
    root: etree._Element, source: str, left_out: Mapping[tuple[str, str], str], links: set[str] | None
) -> list[str]:
    notes: list[str] = []
    for reason, count in Counter(left_out.values()).items():
        pairs = [f"{a} and {b}" for (a, b), why in left_out.items() if why == reason]
        notes.append(f"{source} leaves out {several(count, 'pair')} of links ({reason}): {_listed(pairs)}")
    states = [str(state.get("name")) for state in root.iter("group_state")]
    if states:
        notes.append(f"{source} has {several(len(states), 'group state')}, ignored: {_listed(states)}")
    if links is not None:
        named = {
            link for tag in ("disable_collisions", "enable_collisions") for pair in _pairs(root, tag) for link in pair
        }
        named |= {element.get("link", "") for element in root.iter("disable_default_collisions")}
        unknown = sorted(named - links)
        if unknown:
            notes.append(
                f"{source} names links that the robot does not have: {_listed([repr(one) for one in unknown])}"
            )
    return notes


def _listed(words: list[str]) -> str:
    more = f" and {len(words) - _NAMED} more" if len(words) > _NAMED else ""
    return ", ".join(words[:_NAMED]) + more
