"""URDF in: links and joints, checked with their lines, and normalised for Pinocchio.

A URDF in the wild may miss `effort`, let a continuous joint follow a revolute one, chain followers, or carry a
default namespace. pinbound accepts what has one meaning, lists what it normalised, and refuses the rest.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass
from typing import Any, Literal, cast

import numpy as np
from lxml import etree
from numpy.typing import NDArray

from pinbound.document import Document, local_name, parse_floats, refusal
from pinbound.exceptions import Problems, name_hint

__all__ = [
    "MOVING_TYPES",
    "Joint",
    "Kinematics",
    "Link",
    "Mimic",
    "build_model",
    "read_kinematics",
]

JointType = Literal["revolute", "continuous", "prismatic", "fixed", "floating", "planar"]
JOINT_TYPES: tuple[str, ...] = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
MOVING_TYPES = ("revolute", "continuous", "prismatic")
"""Joint types with one coordinate: the ones that a boundary can depend on."""

_LIMITED_TYPES = ("revolute", "prismatic")
_FREE_TYPES = ("floating", "planar")
_UNBOUNDED = "1e9"  # urdfdom does not read "inf"; build_model puts the infinity back


@dataclass(frozen=True, slots=True)
class Mimic:
    """`theta = multiplier * theta_primary + offset`, as a `<mimic>` element says it."""

    primary: str
    multiplier: float
    offset: float


@dataclass(frozen=True, slots=True)
class Link:
    """A link: its name, and whether there is a body behind it."""

    name: str
    has_inertia: bool
    has_geometry: bool
    line: int | None = None


@dataclass(frozen=True, slots=True)
class Joint:
    """A joint as declared: `T_parent_child = (rotation, translation) * motion(axis, theta)`.

    Attributes:
        name: Joint name.
        type: One of the six URDF types.
        parent: Parent link.
        child: Child link.
        rotation: (3, 3), from the origin's rpy.
        translation: (3,) [m], the origin's xyz.
        axis: (3,) unit vector in the child's frame.
        lower: Lower limit [rad or m], -inf where the type has none.
        upper: Upper limit [rad or m], +inf where the type has none.
        mimic: The joint that it follows, or None.
        line: Line of the element in the file.
    """

    name: str
    type: JointType
    parent: str
    child: str
    rotation: NDArray[np.float64]
    translation: NDArray[np.float64]
    axis: NDArray[np.float64]
    lower: float
    upper: float
    mimic: Mimic | None = None
    line: int | None = None

    @property
    def moves(self) -> bool:
        """Whether it has exactly one coordinate."""
        return self.type in MOVING_TYPES


@dataclass(frozen=True, slots=True)
class Kinematics:
    """Links and joints of a URDF, in file order, each checked."""

    name: str
    links: tuple[Link, ...]
    joints: tuple[Joint, ...]
    notes: tuple[str, ...]


def read_kinematics(
    document: Document,
    problems: Problems,
    limits: Mapping[str, tuple[float, float]] | None = None,
    followers: Mapping[str, Mimic] | None = None,
) -> Kinematics:
    """Read links and joints; every fault goes to `problems`, with its line.

    Args:
        document: The robot's XML.
        problems: Where faults go; what comes back is complete only if none was added.
        limits: Limits by joint that replace the URDF's own.
        followers: Followers by joint that replace the URDF's own `<mimic>`.
    """
    reader = _Reader(document, problems, limits or {}, followers or {})
    return reader.read()


class _Reader:
    """One pass over a `<robot>` element, collecting faults and notes."""

    def __init__(
        self,
        document: Document,
        problems: Problems,
        given_limits: Mapping[str, tuple[float, float]],
        given_followers: Mapping[str, Mimic],
    ) -> None:
        self.root, self.problems = document.root, problems
        self.given_limits, self.given_followers = given_limits, given_followers
        self.notes: list[str] = list(document.notes)
        self.links: dict[str, Link] = {}
        self.joints: dict[str, Joint] = {}

    def read(self) -> Kinematics:
        if self.root.tag != "robot":
            self.problems.add(f"the root element is <{local_name(self.root)}>", "A URDF starts with <robot>", 1)
            return Kinematics("", (), (), ())
        for element in self.root.findall("link"):
            self._link(element)
        for element in self.root.findall("joint"):
            self._joint(element)
        for given, thing in ((self.given_limits, "limits"), (self.given_followers, "<mimic>")):
            self.notes.extend(f"the annotations replace the {thing} of joint {name!r}" for name in given)
        if not self.links:
            self.problems.add("the robot has no links", "Check that the file is the robot's URDF, and complete", 1)
        self._check_mimics()
        self._check_tree()
        name = self.root.get("name", "")
        if not name:
            name = "robot"
            self.notes.append("the robot has no name; it is called 'robot'")
        return Kinematics(name, tuple(self.links.values()), tuple(self.joints.values()), tuple(self.notes))

    def _name(self, element: etree._Element, known: dict[str, Any]) -> str | None:
        name, what, line = element.get("name"), local_name(element), element.sourceline
        if not name:
            self.problems.add(f"a <{what}> has no name", "Name it", line)
            return None
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
            self.problems.add(f"{what} has the type {kind!r}", f"Valid types: {', '.join(JOINT_TYPES)}", line)
            kind = "fixed"
        if kind in _FREE_TYPES:
            self.notes.append(f"{kind} {what} is held at its origin in robot.model; no boundary may lie across it")
        ends = [self._end(element, tag, what) for tag in ("parent", "child")]
        origin = element.find("origin")
        xyz = self._vector(origin, "xyz", f"the origin of {what}", (0.0, 0.0, 0.0))
        rpy = self._vector(origin, "rpy", f"the origin of {what}", (0.0, 0.0, 0.0))
        lower, upper = self._limits(element, kind, what) if name not in self.given_limits else self.given_limits[name]
        mimic = self._mimic(element, what) if name not in self.given_followers else self.given_followers[name]
        if ends[0] is None or ends[1] is None:
            return
        self.joints[name] = Joint(
            name=name,
            type=cast(JointType, kind),
            parent=ends[0],
            child=ends[1],
            rotation=_rotation(rpy),
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
                f"{what} has the {tag} {name!r}, which is no link", self._hint(name, self.links), _line(end)
            )
        else:
            return name
        return None

    @staticmethod
    def _hint(name: str, known: dict[str, Any]) -> str:
        return name_hint(name, known)

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

    def _axis(self, element: etree._Element, kind: str, what: str) -> NDArray[np.float64]:
        axis = np.array(self._vector(element.find("axis"), "xyz", f"the axis of {what}", (1.0, 0.0, 0.0)))
        length = float(np.linalg.norm(axis))
        if kind not in MOVING_TYPES:
            return np.array([1.0, 0.0, 0.0])
        if length == 0.0:
            self.problems.add(f"{what} has a zero axis", "Give the axis a direction", element.sourceline)
            return np.array([1.0, 0.0, 0.0])
        if abs(length - 1.0) > 1e-6:
            self.notes.append(f"the axis of {what} has length {length:.6g}; it is normalised")
        return axis / length

    def _limits(self, element: etree._Element, kind: str, what: str) -> tuple[float, float]:
        limit = element.find("limit")
        if kind not in _LIMITED_TYPES:
            return -math.inf, math.inf
        if limit is None:
            message = f"{what} is {kind} but has no <limit>"
            self.problems.add(message, "Give lower and upper, or make it continuous", element.sourceline)
            return -math.inf, math.inf
        for key in ("effort", "velocity"):
            self._number(limit, key, f"the limit of {what}", 0.0)
        missing = [key for key in ("effort", "velocity") if limit.get(key) is None]
        if missing:
            self.notes.append(f"the limit of {what} has no {' and no '.join(missing)}; boundaries do not need it")
        lower = self._number(limit, "lower", f"the limit of {what}", 0.0)
        upper = self._number(limit, "upper", f"the limit of {what}", 0.0)
        if lower > upper:
            message = f"{what} has lower {lower:g} above upper {upper:g}"
            self.problems.add(message, "Swap them", limit.sourceline)
        return lower, upper

    def _mimic(self, element: etree._Element, what: str) -> Mimic | None:
        mimic = element.find("mimic")
        if mimic is None:
            return None
        primary = mimic.get("joint")
        if not primary:
            self.problems.add(f"the <mimic> of {what} names no joint", "Name the joint it follows", mimic.sourceline)
            return None
        multiplier = self._number(mimic, "multiplier", f"the mimic of {what}", 1.0)
        return Mimic(primary, multiplier, self._number(mimic, "offset", f"the mimic of {what}", 0.0))

    def _check_mimics(self) -> None:
        moving = {name: joint for name, joint in self.joints.items() if joint.moves}
        for name, joint in self.joints.items():
            if joint.mimic is None:
                continue
            if name not in moving:
                self.notes.append(f"{joint.type} joint {name!r} has a <mimic>, which does nothing")
                continue
            primary = joint.mimic.primary
            if primary in moving:
                self._note_follower(joint, moving[primary])
                continue
            kind = f"a {self.joints[primary].type} joint" if primary in self.joints else "no joint of this robot"
            message = f"joint {name!r} follows {primary!r}, which is {kind}"
            self.problems.add(message, self._hint(primary, moving), joint.line)
        for name, joint in self.joints.items():
            if name in self._followed(joint):
                message = f"joint {name!r} follows itself, through other followers"
                self.problems.add(message, "Let one joint of the cycle be free", joint.line)

    def _note_follower(self, joint: Joint, primary: Joint) -> None:
        """Say what stock readers refuse or get wrong about a follower, and pinbound does not."""
        if primary.mimic is not None:
            self.notes.append(
                f"joint {joint.name!r} follows {primary.name!r}, itself a follower: the chain is flattened"
            )
        if (joint.type == "continuous") != (primary.type == "continuous"):
            self.notes.append(f"{joint.type} joint {joint.name!r} follows {primary.type} joint {primary.name!r}")

    def _followed(self, joint: Joint) -> set[str]:
        """Return every joint that this one follows, directly or not."""
        names: set[str] = set()
        step: Joint | None = joint
        while step is not None and step.mimic is not None and step.mimic.primary not in names:
            names.add(step.mimic.primary)
            step = self.joints.get(step.mimic.primary)
        return names

    def _check_tree(self) -> None:
        parent_joint: dict[str, Joint] = {}
        for joint in self.joints.values():
            first = parent_joint.setdefault(joint.child, joint)
            if first is not joint:
                message = f"link {joint.child!r} is the child of two joints, {first.name!r} and {joint.name!r}"
                remedy = "A URDF is a tree: keep one, and say the other as <pinbound:closure>"
                self.problems.add(message, remedy, joint.line)
        roots = [name for name in self.links if name not in parent_joint]
        if self.links and len(roots) != 1:
            found = ", ".join(map(repr, roots)) or "none: the joints form a cycle"
            message = f"the robot needs one root link, and has {len(roots)} ({found})"
            self.problems.add(message, "Connect all links by joints into one tree", 1)
            return
        for link in self.links.values():
            seen, name = {link.name}, link.name
            while name in parent_joint:
                name = parent_joint[name].parent
                if name in seen:
                    self.problems.add(f"link {link.name!r} hangs on a cycle of joints", "Cut the cycle", link.line)
                    break
                seen.add(name)


def _line(element: etree._Element | None) -> int | None:
    return None if element is None else element.sourceline


def _rotation(rpy: tuple[float, ...]) -> NDArray[np.float64]:
    """Return `R_z(yaw) R_y(pitch) R_x(roll)`, the convention of URDF."""
    (sr, sp, sy), (cr, cp, cy) = np.sin(rpy), np.cos(rpy)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def build_model(document: Document, kinematics: Kinematics) -> Any:
    """Build the `pinocchio.Model` of the whole tree, one coordinate a moving joint.

    Followers are free joints in it, continuous joints are revolute ones without limits (so nq = nv), and floating
    and planar joints are held at their origin: no boundary may depend on them.

    Raises:
        InputError: If Pinocchio refuses the normalised URDF.
    """
    import pinocchio

    pin = cast(Any, pinocchio)
    root = deepcopy(document.root)
    root.set("name", kinematics.name)
    for element in list(root):
        if not isinstance(element.tag, str) or element.tag not in ("link", "joint"):
            root.remove(element)
    for element in root.iter("link"):
        for child in [*element.findall("visual"), *element.findall("collision")]:
            element.remove(child)
    joints = {joint.name: joint for joint in kinematics.joints}
    for element in root.findall("joint"):
        _normalise_joint(element, joints[str(element.get("name"))])
    try:
        model = pin.buildModelFromXML(etree.tostring(root).decode())
    except (ValueError, RuntimeError) as error:
        reason = str(error).strip().splitlines()[0]
        raise refusal(document.label, f"Pinocchio refuses it: {reason}", "Mend the URDF") from error
    for name, joint in joints.items():
        if joint.moves:
            index = model.joints[model.getJointId(name)].idx_q
            model.lowerPositionLimit[index], model.upperPositionLimit[index] = joint.lower, joint.upper
    return model


def _normalise_joint(element: etree._Element, joint: Joint) -> None:
    limit = element.find("limit")
    given = {} if limit is None else {key: str(limit.get(key, "0")) for key in ("effort", "velocity")}
    for child in list(element):
        if local_name(child) not in ("parent", "child", "origin", "axis"):
            element.remove(child)
    if joint.type in _FREE_TYPES:
        element.set("type", "fixed")
    if joint.moves:
        element.set("type", "prismatic" if joint.type == "prismatic" else "revolute")
        bounds = {"lower": f"-{_UNBOUNDED}", "upper": _UNBOUNDED, "effort": "0", "velocity": "0"}
        etree.SubElement(element, "limit", bounds | given)
