"""Corrections of a robot's XML before anything reads it, so that all readers see the same robot; each gives a note.

An angle that is printed like a multiple of pi/2 becomes exact. An axis that is too long or too short to square in
float64 still has a direction. A parent `world` that no link declares becomes the root.
"""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
from lxml import etree

from pinbound.model.document import Document
from pinbound.model.xml_text import parse_floats
from pinbound.tolerances import PRINTED_PI, REDUCTION

__all__ = ["normalise", "quarter_turns", "unit_vector"]

_MOST_QUARTERS = 8
_NUMBER = re.compile(r"[+-]?(\d*)\.?(\d*)(?:[eE]([+-]?\d{1,3}))?")
_NAMED = 4
_SHORTEST = len("1.571")  # no shorter number is within `PRINTED_PI` of a multiple of pi/2
_PLAIN = 120  # characters; three numbers without an exponent in so short a text have squares within float64
_SQUARES = (1e-140, 1e140)
"""Lengths whose squares, and sums of squares, float64 holds without loss: 1e-280 is far above 1e-308 / 2**-53."""


def normalise(document: Document) -> Document:
    """Return the document with exact quarter turns, usable axes and a declared root; each change gives a note.

    The XML of the document is changed in place, because it was read for this robot only.
    """
    notes = [*_declare_world(document.root), *_exact_turns(document.root), *_usable_axes(document.root)]
    return replace(document, notes=(*document.notes, *notes)) if notes else document


def _declare_world(root: etree._Element) -> list[str]:
    """Add the link `world` if a joint uses it as parent and it is not declared: simulators assume that it exists."""
    if any(link.get("name") == "world" for link in root.findall("link")):
        return []
    if not any(end.get("link") == "world" for end in root.findall("joint/parent")):
        return []
    if any(end.get("link") == "world" for end in root.findall("joint/child")):
        return []
    world = etree.Element("link", {"name": "world"})
    root.insert(0, world)
    return ["the link 'world' is a parent, but not declared; it is taken for the root link, as simulators take it"]


def _exact_turns(root: etree._Element) -> list[str]:
    """Replace rounded multiples of pi/2 by their float64 values."""
    found: dict[tuple[str, int], list[str]] = {}
    for joint in root.findall("joint"):
        origin = joint.find("origin")
        text = None if origin is None else origin.get("rpy")
        if origin is None or text is None:
            continue
        words = text.split()
        if max(map(len, words), default=0) < _SHORTEST or isinstance(parse_floats(text, 3), str):
            continue
        turns = [quarter_turns(word) for word in words]
        if any(turn is not None for turn in turns):
            exact = [
                word if turn is None else repr(turn * math.pi / 2) for word, turn in zip(words, turns, strict=True)
            ]
            origin.set("rpy", " ".join(exact))
        for word, turn in zip(words, turns, strict=True):
            if turn is not None:
                found.setdefault((word, turn), []).append(str(joint.get("name")))
    if not found:
        return []
    said: list[str] = []
    for (word, turn), joints in found.items():
        names = list(dict.fromkeys(joints))
        who = ", ".join(map(repr, names[:_NAMED])) + (f" and {len(names) - _NAMED} more" if len(names) > _NAMED else "")
        said.append(f"{word} as {_in_pi(turn)} = {turn * math.pi / 2!r} ({who})")
    return [f"rpy angles that are multiples of pi/2 to the printed digits are read as exact ones: {'; '.join(said)}"]


def _in_pi(turn: int) -> str:
    sign, count = "-" if turn < 0 else "", abs(turn)
    over, count = ("", count // 2) if count % 2 == 0 else ("/2", count)
    return f"{sign}{'' if count == 1 else f'{count} '}pi{over}"


def quarter_turns(word: str) -> int | None:
    """Return k if a decimal number is k pi/2, rounded or cut to its digits, and not exactly k pi/2.

    The number must be within `PRINTED_PI` of k pi/2. It must also be within one unit of its own last digit of it, or of
    k pi/2 in single precision. Zero is never a result: a small angle is used as written.

    Example:
        >>> [quarter_turns(word) for word in ("3.14159265359", "-1.5708", "3.1415926", "1.571", "1.57079637")]
        [2, -1, 2, 1, 1]
        >>> [quarter_turns(word) for word in ("3.14", "1.5", "1.5705", "3.141592653589793", "0.0001", "1.57080001")]
        [None, None, None, None, None, None]
    """
    match = _NUMBER.fullmatch(word)
    if match is None:
        return None
    value = float(word)
    turn = round(value / (math.pi / 2))
    exact = turn * math.pi / 2
    if turn == 0 or abs(turn) > _MOST_QUARTERS or abs(value - exact) <= REDUCTION or abs(value - exact) > PRINTED_PI:
        return None
    digits = len(match[2].rstrip("0")) - int(match[3] or 0)
    unit = 10.0**-digits
    near = min(abs(value - exact), abs(value - float(np.float32(exact))))
    return turn if near < unit else None


def _usable_axes(root: etree._Element) -> list[str]:
    """Replace axes whose squared length overflows or underflows by unit vectors that all readers can use."""
    notes: list[str] = []
    for joint in root.findall("joint"):
        axis = joint.find("axis")
        text = "" if axis is None else axis.get("xyz", "")
        if axis is None or ("e" not in text.lower() and len(text) < _PLAIN):
            continue
        numbers = parse_floats(text, 3)
        if isinstance(numbers, str) or not any(numbers):
            continue
        length = math.hypot(*numbers)
        if _SQUARES[0] < length < _SQUARES[1]:
            continue
        unit = " ".join(repr(float(part)) for part in unit_vector(numbers))
        notes.append(f"the axis of joint {joint.get('name')!r}, {axis.get('xyz')}, is read as its direction, {unit}")
        axis.set("xyz", unit)
    return notes


def unit_vector(vector: tuple[float, ...]) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Return the direction of a vector of any length: it is scaled by its largest entry first.

    Example:
        >>> unit_vector((0.0, 0.0, -2e200)).tolist(), unit_vector((0.0, 5e-324, 0.0)).tolist()
        ([0.0, 0.0, -1.0], [0.0, 1.0, 0.0])
    """
    exponent = math.frexp(max(map(abs, vector)))[1]  # a power of two, so scaling does not round
    scaled = np.array([math.ldexp(part, -exponent) for part in vector])
    return scaled / np.linalg.norm(scaled)
