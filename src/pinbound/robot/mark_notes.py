"""Notes on annotations: shapes that stick out of the marked bodies, and angles that look like degrees."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable

from pinbound.annotations import Annotations, RawItem
from pinbound.model.kinematics_checks import like_degrees, said_of_degrees
from pinbound.model.xml_text import parse_floats

__all__ = ["excesses", "marked_degrees"]


def excesses(marks: Annotations) -> list[str]:
    """Return notes on how far shapes stick out of the marked bodies."""
    widest = {name: mark.shape.excess for name, mark in marks.marks.items() if mark.shape.excess > 0.0}
    if not widest:
        return []
    names = ", ".join(f"{name} {1e3 * excess:.3g} mm" for name, excess in widest.items())
    return [f"each round mark is replaced by a prism around it, whose edges are outside the mark by at most: {names}"]


def marked_degrees(items: Iterable[RawItem], marks: Annotations, slides: Collection[str]) -> list[str]:
    """Return a note on angles of annotations that look like degrees: `rpy` of marks, and ends of rules.

    Limits of joints in annotations are noted with those of the URDF.

    Args:
        items: The annotations as written; a hull of a mesh has its `rpy` only there.
        marks: The annotations.
        slides: Names of the prismatic joints, whose rules are in metres.
    """
    found: list[str] = []
    for item in items:
        rpy = parse_floats(str(item.fields.get("rpy", "")), 3)
        if not isinstance(rpy, str) and like_degrees(rpy):
            found.append(f"rpy {' '.join(f'{a:g}' for a in rpy)} of {item.kind} {item.fields.get('name')!r}")
    for rule in marks.rules:
        for one in (rule, *rule.where):
            ends = [end for end in (one.lower, one.upper) if math.isfinite(end)]
            if ends and like_degrees(ends) and not set(one.coefficients) & set(slides):
                found.append(f"{' .. '.join(f'{end:g}' for end in (one.lower, one.upper))} of rule {rule.name!r}")
    return said_of_degrees(found)
