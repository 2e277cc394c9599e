"""Reading a URDF: links and joints, checked with their lines.

Real URDFs may omit `effort`, let a continuous joint follow a revolute one, chain mimic joints, or have a default
namespace. pinbound accepts files that have one meaning, lists what it changed, and refuses the others.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, cast

import numpy as np
from lxml import etree

from pinbound.exceptions import Problems, name_hint, printable
from pinbound.geometry.rotations import rpy_matrix
from pinbound.model.document import Document, local_name, parse_floats
from pinbound.model.kinematics import JOINT_TYPES, MOVING_TYPES, Joint, JointType, Kinematics, Link, Mimic
from pinbound.model.kinematics_checks import check_mimics, check_tree, listed, note_degrees, note_nearly_parallel
from pinbound.model.normalise import unit_vector
from pinbound.model.vocabulary import check_vocabulary, near_miss
from pinbound.typing import Array

__all__ = [
    "MOVING_TYPES",
    "Joint",
    "Kinematics",
    "Link",
    "Mimic",
    "read_kinematics",
]

_LIMITED_TYPES = ("revolute", "prismatic")
_FREE_TYPES = ("floating", "planar")


def read_kinematics(
    document: Document,
    problems: Problems,
    limits: Mapping[str, tuple[float, float]] | None = None,
    followers: Mapping[str, Mimic] | None = None,
    places: Mapping[str, tuple[int | None, str | None]] | None = None,
) -> Kinematics:
    """Read links and joints; every fault goes to `problems`, with its line.

    Args:
        document: The robot's XML.
        problems: Collects the faults; the result is complete only if none was added.
        limits: Limits by joint that replace those of the URDF.
        followers: Mimic joints by joint that replace the `<mimic>` of the URDF.
        places: Line and file of these mimic joints.
    """
    reader = _Reader(document, problems, limits or {}, followers or {}, places or {})
    return reader.read()


class _Reader:
    """One pass over a `<robot>` element, which collects faults and notes."""

    def __init__(
        self,
        document: Document,
        problems: Problems,
        given_limits: Mapping[str, tuple[float, float]],
        given_followers: Mapping[str, Mimic],
        places: Mapping[str, tuple[int | None, str | None]],
    ) -> None:
        self.root, self.problems = document.root, problems
        self.given_limits, self.given_followers, self.places = given_limits, given_followers, places
        self.notes: list[str] = list(document.notes)
        self.links: dict[str, Link] = {}
        self.joints: dict[str, Joint] = {}
        self.soft: list[str] = []
        self.unmoved: list[str] = []
        self.turned: dict[str, tuple[float, ...]] = {}

    def read(self) -> Kinematics:
        if self.root.tag != "robot":
            tag = f"{self.root.prefix}:{local_name(self.root)}" if self.root.prefix else local_name(self.root)
            self.problems.add(f"the root element is <{tag}>", "A URDF starts with <robot>", 1)
            return Kinematics("", (), (), ())
        self.notes += check_vocabulary(self.root, self.problems)
        for element in self.root.findall("link"):
            self._link(element)
        for element in self.root.findall("joint"):
            self._joint(element)
        for given, thing in ((self.given_limits, "limits"), (self.given_followers, "<mimic>")):
            for name in given:
                joint = self.joints.get(name)
                if joint is None or joint.moves:
                    self.notes.append(f"the annotations replace the {thing} of joint {name!r}")
                else:
                    self.notes.append(
                        f"{joint.type} joint {name!r} cannot move: its {thing} in the annotations do nothing"
                    )
        unexpanded = [repr(name) for name in (*self.links, *self.joints) if "${" in name or "$(" in name]
        if unexpanded:
            self.notes.append(f"names hold expressions of xacro, which nothing expands here: {listed(unexpanded)}")
        if self.soft:
            self.notes.append(f"the soft limits of safety_controller are ignored, <limit> counts: {listed(self.soft)}")
        if self.unmoved:
            self.notes.append(f"limits of joints that are fixed, floating or planar do nothing: {listed(self.unmoved)}")
        if not self.links:
            self.problems.add("the robot has no links", "Check that the file is the robot's URDF, and complete", 1)
        self.notes += check_mimics(self.joints, self.problems, self.places)
        check_tree(self.links, self.joints, self.problems)
        self.notes += [*note_nearly_parallel(self.joints), *note_degrees(self.joints, self.turned)]
        name = printable(self.root.get("name", ""))
        if not name:
            name = "robot"
            self.notes.append("the robot has no name; it is called 'robot'")
        return Kinematics(name, tuple(self.links.values()), tuple(self.joints.values()), tuple(self.notes))

    def _name(self, element: etree._Element, known: dict[str, Any]) -> str | None:
        name, what, line = element.get("name"), local_name(element), element.sourceline
        if not name:
            self.problems.add(f"a <{what}> has no name", "Name it", line)
            return None
        if printable(name) != name:
            message = f"the name {name!r} of a {what} holds invisible characters"
            self.problems.add(message, "Use letters, digits and signs; no control or formatting characters", line)
        if name in known:
            first = known[name].line
            self.problems.add(f"{what} {name!r} is declared twice (first on line {first})", "Rename one", line)
            return None
        return name

    def _link(self, element: etree._Element) -> None:
        name = self._name(element, self.links)
        if name is None:
            return
        mass = element.find("inertial/mass")
        has_inertia = False
        if mass is not None:
            value = self._number(mass, "value", f"the mass of link {name!r}", 0.0)
            has_inertia = value != 0.0
        has_geometry = element.find("visual/geometry") is not None or element.find("collision/geometry") is not None
        self.links[name] = Link(name, has_inertia, has_geometry, element.sourceline)

    def _joint(self, element: etree._Element) -> None:
        name = self._name(element, self.joints)
        if name is None:
            return
        line, what, kind = element.sourceline, f"joint {name!r}", element.get("type", "")
        if kind not in JOINT_TYPES:
            near = [valid for valid in JOINT_TYPES if near_miss(kind, valid)]
            hint = f"Did you mean {near[0]!r}? " if near else ""
            self.problems.add(f"{what} has the type {kind!r}", f"{hint}Valid types: {', '.join(JOINT_TYPES)}", line)
            kind = "fixed"
        if kind in _FREE_TYPES:
            self.notes.append(f"{kind} {what} is held at its origin in robot.model; no boundary may lie across it")
        ends = [self._end(element, tag, what) for tag in ("parent", "child")]
        origin = element.find("origin")
        xyz = self._vector(origin, "xyz", f"the origin of {what}", (0.0, 0.0, 0.0))
        rpy = self._vector(origin, "rpy", f"the origin of {what}", (0.0, 0.0, 0.0))
        lower, upper = self._limits(element, kind, what) if name not in self.given_limits else self.given_limits[name]
        mimic = self._mimic(element, what) if name not in self.given_followers else self.given_followers[name]
        self.turned[name] = rpy
        if ends[0] is None or ends[1] is None:
            return
        self.joints[name] = Joint(
            name=name,
            type=cast(JointType, kind),
            parent=ends[0],
            child=ends[1],
            rotation=rpy_matrix(rpy) if any(rpy) else np.eye(3),
            translation=np.array(xyz),
            axis=self._axis(element, kind, what),
            lower=lower,
            upper=upper,
            mimic=mimic,
            line=line,
        )

    def _end(self, element: etree._Element, tag: str, what: str) -> str | None:
        end = element.find(tag)
        name = None if end is None else end.get("link")
        if name is None:
            self.problems.add(f"{what} has no <{tag} link=...>", "Name its link", element.sourceline)
        elif name not in self.links:
            self.problems.add(
                f"{what} has the {tag} {name!r}, which is not a link", name_hint(name, self.links), _line(end)
            )
        else:
            return name
        return None

    def _number(self, element: etree._Element | None, key: str, what: str, default: float) -> float:
        return self._numbers(element, key, what, (default,))[0]

    def _vector(
        self, element: etree._Element | None, key: str, what: str, default: tuple[float, ...]
    ) -> tuple[float, ...]:
        return self._numbers(element, key, what, default)

    def _numbers(
        self, element: etree._Element | None, key: str, what: str, default: tuple[float, ...]
    ) -> tuple[float, ...]:
        text = None if element is None else element.get(key)
        if text is None:
            return default
        numbers = parse_floats(text, len(default))
        if isinstance(numbers, str):
            self.problems.add(f"{key} of {what}: {numbers}", "Write finite numbers", _line(element))
            return default
        return numbers

    def _axis(self, element: etree._Element, kind: str, what: str) -> Array:
        default = (1.0, 0.0, 0.0)
        found = element.find("axis")
        if kind not in MOVING_TYPES:
            return np.array(default)
        if found is not None and found.get("xyz") is None:
            self.problems.add(f"the <axis> of {what} has no xyz", "Write <axis xyz=...>", found.sourceline)
            return np.array(default)
        axis = self._vector(found, "xyz", f"the axis of {what}", default)
        if not any(axis):
            self.problems.add(f"{what} has a zero axis", "Give the axis a direction", element.sourceline)
            return np.array(default)
        length = math.hypot(*axis)
        if abs(length - 1.0) > 1e-6:
            self.notes.append(f"the axis of {what} has length {length:.6g}; it is normalised")
        return unit_vector(axis)

    def _limits(self, element: etree._Element, kind: str, what: str) -> tuple[float, float]:
        limit = element.find("limit")
        if kind not in _LIMITED_TYPES:
            self._note_ignored_limits(limit, kind, what)
            return -math.inf, math.inf
        if limit is None:
            message = f"{what} is {kind} but has no <limit>"
            self.problems.add(message, _limit_remedy(kind), element.sourceline)
            return -math.inf, math.inf
        for key in ("effort", "velocity"):
            if not self._is_endless(limit.get(key)) and self._number(limit, key, f"the limit of {what}", 0.0) < 0.0:
                self.notes.append(f"the limit of {what} has a negative {key}; boundaries do not need it")
        missing = [key for key in ("effort", "velocity") if limit.get(key) is None]
        if missing:
            self.notes.append(f"the limit of {what} has no {' and no '.join(missing)}; boundaries do not need it")
        endless = [key for key in ("effort", "velocity") if self._is_endless(limit.get(key))]
        if endless:
            self.notes.append(f"the limit of {what} has no finite {' and '.join(endless)}; boundaries do not need it")
        ends = [key for key in ("lower", "upper") if limit.get(key) is None]
        lower = self._number(limit, "lower", f"the limit of {what}", 0.0)
        upper = self._number(limit, "upper", f"the limit of {what}", 0.0)
        if lower > upper:
            message = f"{what} has lower {lower:g} above upper {upper:g}"
            if ends:
                message = f"the limit of {what} has no {ends[0]}, which counts as 0: lower {lower:g}, upper {upper:g}"
            self.problems.add(message, f"Give {ends[0]}" if ends else "Swap them", limit.sourceline)
        elif ends:
            still = ", so that the joint cannot move" if len(ends) > 1 else ""
            are = "which count as 0" if len(ends) > 1 else "which counts as 0"
            self.notes.append(f"the limit of {what} has no {' and no '.join(ends)}, {are}{still}")
        return lower, upper

    def _note_ignored_limits(self, limit: etree._Element | None, kind: str, what: str) -> None:
        """Note limits that have no effect for the type of a joint."""
        given = [] if limit is None else [f"{key} {limit.get(key)}" for key in ("lower", "upper") if limit.get(key)]
        if given and kind == "continuous":
            remedy = "make it revolute if they are meant"
            self.notes.append(f"continuous {what} has limits ({', '.join(given)}), which do nothing; {remedy}")
        elif given and kind in JOINT_TYPES and any(parse_floats(word.partition(" ")[2], 1) != (0.0,) for word in given):
            self.unmoved.append(what.removeprefix("joint "))

    @staticmethod
    def _is_endless(text: str | None) -> bool:
        return text is not None and text.strip().lower().lstrip("+") in ("inf", "infinity")

    def _mimic(self, element: etree._Element, what: str) -> Mimic | None:
        self._note_soft_limits(element, what)
        mimic = element.find("mimic")
        if mimic is None:
            return None
        primary = mimic.get("joint")
        if not primary:
            self.problems.add(f"the <mimic> of {what} names no joint", "Name the joint it follows", mimic.sourceline)
            return None
        multiplier = self._number(mimic, "multiplier", f"the mimic of {what}", 1.0)
        return Mimic(primary, multiplier, self._number(mimic, "offset", f"the mimic of {what}", 0.0))

    def _note_soft_limits(self, element: etree._Element, what: str) -> None:
        soft = element.find("safety_controller")
        ends = [] if soft is None else [soft.get(f"soft_{end}_limit") for end in ("lower", "upper")]
        if any(end is not None for end in ends):
            self.soft.append(f"{what.removeprefix('joint ')} ({' .. '.join(end or '0' for end in ends)})")


def _limit_remedy(kind: str) -> str:
    give = "Give lower and upper, in the URDF or as `limits` in the annotations"
    return f"{give}; or make it continuous" if kind == "revolute" else give


def _line(element: etree._Element | None) -> int | None:
    return None if element is None else element.sourceline
