"""The vocabulary of URDF: which elements and attributes are allowed in each element, and how others are reported.

If an unknown word is almost a word that pinbound reads (`uper`, `<axes>`, `xzy`, `<Joint>`), it is probably a mistake,
and its meaning would be lost: this is a fault. Any other unknown word belongs to some other program: it is ignored, as
in every URDF reader, and one note says so. A word that occurs twice, or at a position or in a namespace where URDF
readers disagree, is a fault.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass

from lxml import etree

from pinbound.exceptions import Problems
from pinbound.model.xml_text import local_name

__all__ = ["check_vocabulary", "looks_like_ours", "near_miss"]

XACRO = ("http://www.ros.org/wiki/xacro", "http://wiki.ros.org/xacro", "http://ros.org/wiki/xacro")
_OURS = "pinbound"
_QUIET = ("http://www.w3.org/",)  # attributes such as xsi:schemaLocation do not concern the robot


@dataclass(frozen=True, slots=True)
class _Word:
    """An element of URDF: its attributes and children, and which of them pinbound reads.

    Attributes:
        read: Attributes and children that pinbound reads; a word that is almost one of them is a fault.
        ignored: Other attributes and children of URDF, or of extensions by programs in common use.
        children: The children that have a vocabulary of their own, and its key.
        once: Children that may occur only once.
        mistaken: Words that people write by mistake, each with the correct word.
    """

    read: tuple[str, ...] = ()
    ignored: tuple[str, ...] = ()
    children: Mapping[str, str] | None = None
    once: tuple[str, ...] = ()
    mistaken: Mapping[str, str] | None = None


_BODY = _Word(
    ("origin", "geometry"),
    ("name", "group", "material", "verbose", "contact_coefficients", "surface", "max_contacts", "laser_retro"),
    {"origin": "origin", "geometry": "geometry", "material": "", "verbose": ""},
    ("origin", "geometry"),
)
WORDS: Mapping[str, _Word] = {
    "robot": _Word(
        ("name", "link", "joint"),
        ("version", "material", "transmission", "gazebo", "sensor", "ros2_control", "mujoco", "loop_joint", "frame"),
        {"link": "link", "joint": "joint"},
        mistaken={"annotations": "pinbound:annotations"},
    ),
    "link": _Word(
        ("name", "inertial", "visual", "collision"),
        (
            "type",
            "collision_checking",
            "self_collision_checking",
            "contact",
            "gravity",
            "kinematic",
            "self_filter",
            "surface",
            "sensor",
        ),
        {"inertial": "inertial", "visual": "body", "collision": "body", "collision_checking": ""},
        ("inertial",),
    ),
    "joint": _Word(
        ("name", "type", "parent", "child", "origin", "axis", "limit", "mimic"),
        ("dynamics", "calibration", "safety_controller", "safety", "hardwareInterface", "dont_collapse"),
        {
            "parent": "end",
            "child": "end",
            "origin": "origin",
            "axis": "axis",
            "limit": "limit",
            "mimic": "mimic",
            "safety_controller": "safety_controller",
        },
        ("parent", "child", "origin", "axis", "limit", "mimic"),
    ),
    "end": _Word(("link",), mistaken={"name": "link", "body": "link"}),
    "origin": _Word(
        ("xyz", "rpy"),
        mistaken={
            "position": "xyz",
            "translation": "xyz",
            "pos": "xyz",
            "orientation": "rpy",
            "rotation": "rpy",
            "euler": "rpy",
            "quat": "rpy",
            "quat_xyzw": "rpy",
            "quat_wxyz": "rpy",
        },
    ),
    "axis": _Word(("xyz",), mistaken={"direction": "xyz", "vector": "xyz"}),
    "limit": _Word(
        ("lower", "upper", "effort", "velocity"),
        ("acceleration", "deceleration", "jerk", "current", "gear_velocity", "command_effort"),
        mistaken={
            "min": "lower",
            "max": "upper",
            "low": "lower",
            "high": "upper",
            "lower_limit": "lower",
            "upper_limit": "upper",
        },
    ),
    "mimic": _Word(
        ("joint", "multiplier", "offset"),
        mistaken={
            "name": "joint",
            "factor": "multiplier",
            "ratio": "multiplier",
            "scale": "multiplier",
            "bias": "offset",
        },
    ),
    "safety_controller": _Word((), ("soft_lower_limit", "soft_upper_limit", "k_position", "k_velocity")),
    "inertial": _Word(("mass",), ("origin", "inertia"), {"mass": "mass"}, ("mass",)),
    "mass": _Word(("value",)),
    "body": _BODY,
    "geometry": _Word(
        ("box", "cylinder", "sphere", "capsule", "mesh"),
        ("name", "ellipsoid", "cone", "plane", "convex", "heightmap", "sdf"),
        {"box": "box", "cylinder": "round", "sphere": "sphere", "capsule": "round", "mesh": "mesh"},
    ),
    "box": _Word(("size",), ("name",)),
    "round": _Word(("radius", "length"), ("name",)),
    "sphere": _Word(("radius",), ("name",)),
    "mesh": _Word(("filename", "scale"), ("name",)),
}
"""The vocabulary by element; `end` is for `<parent>` and `<child>`, `body` is for `<visual>` and `<collision>`."""

_ALL = {key: frozenset((*word.read, *word.ignored)) for key, word in WORDS.items()}
_OPAQUE = ("transmission", "gazebo", "ros2_control", "sensor", "mujoco", "material")
_LEAVES = ("end", "origin", "axis", "limit", "mimic", "mass")


def check_vocabulary(root: etree._Element, problems: Problems) -> list[str]:
    """Check every element and attribute of a `<robot>`; add faults to `problems`, return notes on ignored parts.

    Example:
        >>> problems = Problems("arm.urdf")
        >>> root = etree.fromstring('<robot name="r"><joint name="q"><limit uper="1"/><spring k="2"/></joint></robot>')
        >>> check_vocabulary(root, problems)
        ['<spring> in <joint> is not a part of URDF and is ignored (on line 1)']
        >>> print(problems.found[0])
        arm.urdf, line 1: <limit> of joint 'q' has 'uper', which URDF does not have. Did you mean 'upper'?
    """
    checker = _Checker(problems)
    checker.walk(root, "robot", "")
    return [*checker.notes(), *_open_loops(root)]


def _open_loops(root: etree._Element) -> list[str]:
    """Return a note on joints that close a loop only for a simulator: the robot is read as a tree without them."""
    found = [
        *root.findall("loop_joint"),
        *(one for one in root.findall("gazebo/joint") if one.find("child") is not None),
    ]
    if not found:
        return []
    named = ", ".join(f"{one.get('name')!r} (line {one.sourceline})" for one in found)
    return [
        f"joints that close loops in a simulator are not read, so these loops are open: {named}; "
        "write <pinbound:closure>"
    ]


class _Checker:
    """Walks once over the elements that pinbound reads."""

    def __init__(self, problems: Problems) -> None:
        self.problems = problems
        self.ignored: dict[str, tuple[int, int | None]] = {}
        self.xacro_seen = False

    def notes(self) -> list[str]:
        said: list[str] = []
        for what, (count, line) in self.ignored.items():
            times = f"({count} times, first on line {line})" if count > 1 else f"(on line {line})"
            said.append(f"{what} is not a part of URDF and is ignored {times}")
        return said

    def _ignore(self, what: str, element: etree._Element) -> None:
        count, line = self.ignored.get(what, (0, element.sourceline))
        self.ignored[what] = (count + 1, line)

    def _fault(self, message: str, remedy: str, element: etree._Element) -> None:
        self.problems.add(message, remedy, element.sourceline)

    def walk(self, element: etree._Element, key: str, owner: str) -> None:
        """Check one element's attributes and children; `owner` is the link or joint that it belongs to."""
        word, known = WORDS[key], _ALL[key]
        children, seen = word.children or {}, set[str]()
        for attribute in element.keys():
            if attribute not in known:
                self._attribute(element, attribute, word, owner)
            elif attribute in children and attribute in word.read:
                message = f"{_said(element, owner)} has {attribute!r} as an attribute, where no reader finds it"
                self._fault(message, f"Write it as an element: <{attribute} .../>", element)
        if key in _LEAVES and element.text and element.text.strip():
            message = f"{_said(element, owner)} holds the text {element.text.strip()!r}"
            self._fault(message, f"Write it as an attribute: {', '.join(word.read)}", element)
        if not len(element):
            return
        for child in element:
            tag = str(child.tag)
            if tag not in known or (tag in ("link", "joint") and key != "robot"):
                self._child(element, child, word, owner)
                continue
            if tag in word.read and tag not in children:
                message = f"{_said(element, owner)} has {tag!r} as an element, where no reader finds it"
                self._fault(message, f'Write it as an attribute: {tag}="..."', child)
            if tag in word.once:
                if tag in seen:
                    message = f"{_said(element, owner)} has two <{tag}>"
                    self._fault(message, "Keep one: some readers take the first, some the last", child)
                seen.add(tag)
            below = children.get(tag)
            if below:
                self.walk(child, below, f"{tag} {child.get('name')!r}" if key == "robot" else owner)
        if key == "geometry" and len(element) > 1:
            self._fault(
                f"a <geometry> of {owner} holds {len(element)} shapes", "Give each its own <collision>", element
            )

    def _attribute(self, element: etree._Element, attribute: str, word: _Word, owner: str) -> None:
        name = etree.QName(attribute)
        said = _said(element, owner)
        if name.namespace is None:
            meant = _meant(attribute, word, word.read)
            if meant:
                self._fault(f"{said} has {attribute!r}, which URDF does not have", f"Did you mean {meant!r}?", element)
            else:
                self._ignore(f"the attribute {attribute!r} of <{local_name(element)}>", element)
        elif name.namespace.startswith(_QUIET):
            return
        elif _OURS in name.namespace:
            message = f"{said} has the attribute pinbound:{name.localname}"
            self._fault(message, "Write it inside a <pinbound:annotations> directly below <robot>", element)
        elif name.localname in word.read and element.getparent() is not None:
            message = f"{said} has {name.localname!r} in the namespace {name.namespace!r}, where no reader finds it"
            self._fault(message, "Remove the prefix, or the attribute", element)
        else:
            self._ignore(f"the attribute {name.localname!r} of the namespace {name.namespace!r}", element)

    def _child(self, element: etree._Element, child: etree._Element, word: _Word, owner: str) -> None:
        name = etree.QName(child)
        tag, said = name.localname, _said(element, owner)
        if name.namespace is not None:
            self._foreign(child, word, said)
        elif tag in ("link", "joint"):
            self._fault(f"a <{tag}> stands inside {said}, where no reader finds it", "Put it below <robot>", child)
        elif meant := _meant(tag, word, word.read):
            self._fault(f"<{tag}> in {said} is not a part of URDF", f"Did you mean <{meant}>?", child)
        else:
            self._hidden(child)
            self._ignore(f"<{tag}> in <{local_name(element)}>", child)

    def _foreign(self, child: etree._Element, word: _Word, said: str) -> None:
        name = etree.QName(child)
        tag, namespace = name.localname, str(name.namespace)
        if looks_like_ours(child):
            return  # the room `annotations` reads these elements, and reports their faults
        if namespace.rstrip("/") in XACRO or child.prefix == "xacro":
            if not self.xacro_seen:
                message = f"the file holds xacro elements, <xacro:{tag}> first: they would be ignored"
                self._fault(message, "Name the file .urdf.xacro, or expand it with xacro", child)
            self.xacro_seen = True
        elif child.prefix and (parent := child.getparent()) is not None and local_name(parent) == "geometry":
            return  # a shape of another reader, e.g. <drake:capsule>: coverage reports a body that no mark holds
        elif tag in word.read or tag in ("link", "joint"):
            message = f"<{tag}> in {said} is in the namespace {namespace!r}: some readers see it, and some do not"
            self._fault(message, f"Write <{tag}> without a prefix and without xmlns, or remove it", child)
        else:
            self._hidden(child)
            self._ignore(f"<{tag}> of the namespace {namespace!r}", child)

    def _hidden(self, element: etree._Element) -> None:
        """Refuse links and joints inside an element whose content no URDF reader reads."""
        if local_name(element) in _OPAQUE:
            return
        for inner in element.iterdescendants("link", "joint"):
            parts = ("visual", "collision", "inertial") if inner.tag == "link" else ("parent", "child")
            if any(inner.find(part) is not None for part in parts):
                message = f"{inner.tag} {inner.get('name')!r} stands inside <{local_name(element)}>"
                self._fault(f"{message}, where no reader finds it", "Put it below <robot>", inner)


def looks_like_ours(element: etree._Element) -> bool:
    """Return whether an element is meant for pinbound: its namespace or prefix is that of pinbound, or almost.

    Example:
        >>> looks_like_ours(etree.fromstring('<p:annotations xmlns:p="urn:pinbond:1"/>'))
        True
        >>> looks_like_ours(etree.fromstring('<m:group xmlns:m="urn:moveit:1"/>'))
        False
    """
    namespace = etree.QName(element).namespace
    if namespace is None:
        return False
    words = [element.prefix or "", *re.split(r"[^0-9A-Za-z_]+", namespace)]
    return any(_OURS in word.lower() or near_miss(word, _OURS) for word in words)


def _said(element: etree._Element, owner: str) -> str:
    tag = local_name(element)
    return owner if tag in ("link", "joint") and owner else f"<{tag}>" + (f" of {owner}" if owner else "")


def _meant(word: str, element: _Word, words: Collection[str]) -> str | None:
    found = (element.mistaken or {}).get(word.lower())
    if found is not None:
        return found
    near = [known for known in words if near_miss(word, known)]
    return near[0] if near else None


def near_miss(word: str, known: str) -> bool:
    """Return whether a word is almost a known one: other capitals, the same letters in another order, or few typos.

    A typo is an additional, a missing or a wrong letter, or two swapped letters. One typo is allowed in words of up to
    five letters, two are allowed in longer words.

    Example:
        >>> [near_miss(word, "multiplier") for word in ("multiplyer", "Multiplier", "multi_plier", "offset")]
        [True, True, True, False]
        >>> near_miss("zxy", "xyz"), near_miss("rpy", "xyz"), near_miss("axes", "axis")
        (True, False, True)
    """
    a, b = (text.lower().replace("_", "").replace("-", "") for text in (word, known))
    if a == b or sorted(a) == sorted(b):
        return True
    return abs(len(a) - len(b)) <= 2 and _slips(a, b) <= (1 if len(b) <= _SHORT else 2)


_SHORT = 5


def _slips(a: str, b: str) -> int:
    """Return the optimal string alignment distance: insertions, deletions, replacements, swaps of neighbours."""
    before, last = list[int](), list(range(len(b) + 1))
    for i, letter in enumerate(a, start=1):
        row = [i]
        for j, other in enumerate(b, start=1):
            cost = min(last[j] + 1, row[j - 1] + 1, last[j - 1] + (letter != other))
            if i > 1 and j > 1 and letter == b[j - 2] and a[i - 2] == other:
                cost = min(cost, before[j - 2] + 1)
            row.append(cost)
        before, last = last, row
    return last[-1]
