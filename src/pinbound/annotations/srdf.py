"""SRDF in: spheres of `link_sphere_approximation` as marked points, `disable_collisions` as pairs left out."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path

from lxml import etree

from pinbound.annotations.records import RawItem
from pinbound.document import parse_file, parse_floats
from pinbound.exceptions import Problems

__all__ = ["read_srdf"]


def read_srdf(path: Path, problems: Problems) -> list[RawItem]:
    """Return a point for every sphere, a boundary for every pair on two links that may collide, and what is left out.

    A sphere of radius 0 says, as elsewhere, that the link has no body. Pairs of links under `disable_collisions`, and
    links under `disable_default_collisions` unless `enable_collisions` names the pair, are left out, with the reason
    that the file gives. A file without spheres says what is left out only.
    """
    root, source = parse_file(path), path.name
    items: list[RawItem] = []
    names: list[tuple[str, str]] = []
    for element in root.iter("link_sphere_approximation"):
        link = element.get("link", "")
        for index, sphere in enumerate(element.iter("sphere")):
            center, radius = sphere.get("center", ""), sphere.get("radius", "")
            fields = {"name": f"{link}.{index}", "link": link, "xyz": center, "radius": radius}
            if parse_floats(radius, 1) == (0.0,):
                continue
            items.append(RawItem("point", fields, source, sphere.sourceline))
            names.append((link, fields["name"]))
    if not names and root.find(".//disable_collisions") is None:
        said = "holds no <link_sphere_approximation> with a sphere, and no <disable_collisions>"
        problems.add(said, "Give an SRDF that holds one of them", 1, source)
    off, closed, on = _pairs(root, "disable_collisions"), set[str](), _pairs(root, "enable_collisions")
    closed = {element.get("link", "") for element in root.iter("disable_default_collisions")}
    for (link_a, a), (link_b, b) in combinations(names, 2):
        pair = frozenset((link_a, link_b))
        if link_a == link_b or pair in off or (pair & closed and pair not in on):
            continue
        items.append(RawItem("boundary", {"name": f"{a}-{b}", "a": a, "b": b}, source, None))
    for element in root.iter("disable_collisions"):
        a, b, reason = (element.get(key, "").strip() for key in ("link1", "link2", "reason"))
        if a and b and a != b:
            fields = {"a": a, "b": b, "reason": reason or "disable_collisions"}
            items.append(RawItem("left_out", fields, source, element.sourceline))
    for a, b in combinations(dict.fromkeys(link for link, _ in names), 2):
        if {a, b} & closed and frozenset((a, b)) not in on | off:
            fields = {"a": a, "b": b, "reason": "disable_default_collisions"}
            items.append(RawItem("left_out", fields, source, None))
    return items


def _pairs(root: etree._Element, tag: str) -> set[frozenset[str]]:
    return {frozenset((element.get("link1", ""), element.get("link2", ""))) for element in root.iter(tag)}
