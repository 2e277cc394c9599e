"""Reads rules `lower <= sum_j c_j theta_j <= upper`, and axes (sums of joints), from their raw fields."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, cast

from pinbound.annotations.records import Axis, Condition, RawItem, Rule
from pinbound.exceptions import name_hint, printable
from pinbound.model.document import parse_floats

__all__ = ["read_axis", "read_rule"]

_KEYS = ("coefficients", "lower", "upper")
Fault = Callable[[str, str], None]


def read_rule(item: RawItem, fault: Fault, known: Callable[[str], bool]) -> Rule | None:
    """Return the rule of a raw item, or None if the item has a fault.

    Args:
        item: An item of kind ``"rule"`` that has all required fields and no unknown field.
        fault: Takes a message and a remedy.
        known: Returns whether the robot has a joint; if not, it reports the fault itself.
    """
    name, fields = str(item.fields["name"]), item.fields
    own = _condition(f"rule {name!r}", {key: fields[key] for key in _KEYS if key in fields}, fault, known)
    conditions: list[Condition] = []
    given: Any = fields.get("where", ())
    if isinstance(given, str):
        fault(f"where of rule {name!r} is {given!r}", "Write conditions: in XML <pinbound:where .../>, in YAML a list")
        return None
    for number, entry in enumerate(cast("Sequence[Mapping[str, Any]]", given), start=1):
        what = f"condition {number} of rule {name!r}"
        found = _condition(what, entry, fault, known)
        if found is None:
            return None
        if not found.lower < found.upper:
            fault(f"{what} holds at {found.lower:g} alone", "Give lower below upper, or only one of the two")
            return None
        conditions.append(found)
    return None if own is None else Rule(name, own.coefficients, own.lower, own.upper, tuple(conditions), item.line)


def read_axis(item: RawItem, fault: Fault, known: Callable[[str], bool]) -> Axis | None:
    """Return the axis of a raw item, or None if the item has a fault; arguments as for `read_rule`."""
    name, joint = str(item.fields["name"]), str(item.fields["instead_of"])
    pairs = _pairs(f"axis {name!r}", item.fields["coefficients"], fault, known)
    if pairs is None or not known(joint):
        return None
    if not pairs.get(joint):
        fault(f"axis {name!r} replaces {joint!r} but has no coefficient for it", f"Give {joint!r} a coefficient")
        return None
    return Axis(name, joint, pairs, item.line)


def _condition(what: str, fields: Mapping[str, Any], fault: Fault, known: Callable[[str], bool]) -> Condition | None:
    """Return `lower <= sum c_j theta_j <= upper`; at least one end and one nonzero coefficient are needed."""
    for key in fields:
        if key not in _KEYS:
            fault(f"{what} has the unknown attribute {key!r}", name_hint(key, _KEYS))
            return None
    pairs, ends = _pairs(what, fields.get("coefficients", ()), fault, known), dict[str, float]()
    for key in ("lower", "upper"):
        if key in fields:
            end = parse_floats(str(fields[key]), 1)
            if isinstance(end, str):
                fault(f"{key} of {what}: {end}", "Write a finite number of radians or metres")
                return None
            ends[key] = end[0]
    if pairs is None:
        return None
    if not any(pairs.values()):
        fault(f"{what} has only coefficients of zero", "Give coefficients: {J3: 1, J2: -1}")
        return None
    if not ends:
        fault(f"{what} has neither lower nor upper", "Give one of them, or both, in radians or metres")
        return None
    lower, upper = ends.get("lower", -math.inf), ends.get("upper", math.inf)
    if lower > upper:
        fault(f"{what} has lower {lower:g} above upper {upper:g}", "Swap them")
        return None
    return Condition(pairs, lower, upper)


def _pairs(what: str, given: Any, fault: Fault, known: Callable[[str], bool]) -> dict[str, float] | None:
    """Return coefficients by joint, from pairs or from the text `joint: number, joint: number`."""
    if isinstance(given, str):
        given = [part.rpartition(":")[::2] for part in given.split(",")]
    found: dict[str, float] = {}
    sound = True
    for raw, text in cast("Sequence[tuple[str, str]]", given):
        name, number = raw.strip(), parse_floats(text, 1)
        if isinstance(number, str) or not name or printable(name) != name:
            said = number if isinstance(number, str) else f"{name!r} is not the name of a joint"
            fault(f"coefficients of {what}: {said}", 'Write {J3: 1, J2: -1}, in XML coefficients="J3: 1, J2: -1"')
            sound = False
        elif name in found:
            fault(f"coefficients of {what} name {name!r} twice", "Keep one")
            sound = False
        elif not known(name):
            sound = False
        else:
            found[name] = number[0]
    return found if sound else None
