"""Immutable records of everything that a user can mark on a robot, and the raw items that all formats become."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pinbound.annotations.marks import Box, Cylinder, Hull, Line, Mark, Plane, Point, Segment, Sweep, Vector
from pinbound.tolerances import CLOSURE
from pinbound.values import Value

__all__ = [
    "FIELDS",
    "FROM_FILE",
    "KINDS",
    "MARK_KINDS",
    "NAMESPACE",
    "Axis",
    "BoundaryMark",
    "ClosureMark",
    "Condition",
    "FollowerMark",
    "LeftOutMark",
    "LimitMark",
    "RawItem",
    "Rule",
    "kind_of",
]

NAMESPACE = "urn:pinbound:1"

FIELDS: Mapping[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "point": (("name", "link", "xyz"), ("radius",)),
    "segment": (("name", "link", "xyz_a", "xyz_b"), ("radius",)),
    "sweep": (("name", "link", "xyz", "ways"), ("radius",)),
    "hull": (("name", "link", "vertices"), ("radius",)),
    "box": (("name", "link", "xyz", "rpy", "size"), ("radius",)),
    "cylinder": (("name", "link", "xyz_a", "xyz_b", "radius"), ()),
    "line": (("name", "link", "xyz", "direction"), ("radius",)),
    "plane": (("name", "link", "xyz", "normal"), ()),
    "boundary": (("name", "a", "b"), ("min_distance", "stop")),
    "closure": (("name", "link_a", "xyz_a", "link_b", "xyz_b"), ("passive", "tolerance", "active", "weld")),
    "follower": (("joint", "primary"), ("multiplier", "offset")),
    "limit": (("joint", "lower", "upper"), ()),
    "axis": (("name", "instead_of", "coefficients"), ()),
    "rule": (("name", "coefficients"), ("lower", "upper", "where")),
    "left_out": (("a", "b", "reason"), ()),
    "settings": ((), ("contact_tolerance",)),
    "assumption": (("text",), ()),
}
"""Required and optional fields of each kind; the fields of `home` are joint names."""

FROM_FILE: Mapping[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "hull": (("name", "link", "mesh"), ("scale", "xyz", "rpy", "radius")),
}
"""Required and optional fields of hulls whose vertices come from the file that `mesh` names."""

KINDS: Mapping[type[Mark], str] = {
    Point: "point",
    Segment: "segment",
    Sweep: "sweep",
    Hull: "hull",
    Box: "box",
    Cylinder: "cylinder",
    Line: "line",
    Plane: "plane",
}
"""The kinds of marks on a link."""

MARK_KINDS: tuple[str, ...] = tuple(KINDS.values())


def kind_of(mark: Mark) -> str:
    """Return the kind of a mark, as files name it.

    Example:
        >>> kind_of(Point("p", "arm", (0.0, 0.0, 0.0)))
        'point'
    """
    return KINDS[type(mark)]


@dataclass(frozen=True, slots=True)
class BoundaryMark(Value):
    """Two marks, by name, whose surfaces must stay `min_distance` [m] apart.

    `stop=True` declares a stop: two points of zero threshold and one effective angle. Contact is the angle at which
    their two lever arms align; the arm lengths may differ slightly.

    Attributes:
        name: Its name, unique among the boundaries of the robot.
        a: Name of the first mark.
        b: Name of the second.
        min_distance: [m], the distance to keep between the two surfaces.
        stop: Whether the two points are declared as a stop.

    Example:
        >>> BoundaryMark("tip_floor", "tip", "floor", min_distance=0.01).stop
        False
    """

    name: str
    a: str
    b: str
    min_distance: float = 0.0
    stop: bool = False
    line: int | None = None


@dataclass(frozen=True, slots=True)
class ClosureMark(Value):
    """A pin that closes a loop: `xyz_a` [m] of `link_a` and `xyz_b` [m] of `link_b` are the same point.

    In an open tree, `passive` may name the joints that follow the others. By default these are the joints furthest from
    the root that `active` does not name. Opposite sides of the loop may differ by at most `tolerance` [m] in total.
    Their true difference enters all bounds as an error of the link positions. With `weld=True`, the frames of both
    links have the same orientation, too.

    Attributes:
        name: Its name.
        link_a: One link.
        xyz_a: (3,) the pin in its frame [m].
        link_b: The other link.
        xyz_b: (3,) the same pin in the frame of that one [m].
        passive: Names of joints that follow.
        tolerance: [m], the largest total difference of opposite sides of the loop.
        active: Names of joints that are commanded.
        weld: Whether the frames of both links have the same orientation, too.

    Example:
        >>> ClosureMark("drive", "rod", (0.4, 0.0, 0.0), "fore", (0.0, 0.0, 0.1)).passive
        ()
    """

    name: str
    link_a: str
    xyz_a: Vector
    link_b: str
    xyz_b: Vector
    passive: tuple[str, ...] = ()
    tolerance: float = CLOSURE
    line: int | None = None
    active: tuple[str, ...] = ()
    weld: bool = False


@dataclass(frozen=True, slots=True)
class FollowerMark(Value):
    """A mimic joint that the URDF does not declare, or declares wrongly: `theta = multiplier * theta_primary + offset`.

    Attributes:
        joint: The joint that follows.
        primary: The joint that it follows.
        multiplier: [rad/rad; m instead of rad for a prismatic joint].
        offset: [rad or m].

    Example:
        >>> FollowerMark("finger_2", "finger_1", multiplier=-1.0).offset
        0.0
    """

    joint: str
    primary: str
    multiplier: float = 1.0
    offset: float = 0.0
    line: int | None = None


@dataclass(frozen=True, slots=True)
class LimitMark(Value):
    """Limits [rad or m] that replace those of the URDF.

    Attributes:
        joint: The joint.
        lower: [rad or m].
        upper: [rad or m].

    Example:
        >>> LimitMark("q1", -1.5, 1.5).upper
        1.5
    """

    joint: str
    lower: float
    upper: float
    line: int | None = None


@dataclass(frozen=True, slots=True)
class Condition(Value):
    """The condition `lower <= sum_j c_j theta_j <= upper` [rad or m]; an end may be infinite.

    Attributes:
        coefficients: c_j by joint name [1].
        lower: [rad or m], may be -inf.
        upper: [rad or m], may be inf.

    Example:
        >>> Condition({"J3": 1.0}, upper=0.0).lower
        -inf
    """

    coefficients: Mapping[str, float]
    lower: float = -math.inf
    upper: float = math.inf


@dataclass(frozen=True, slots=True)
class Rule(Value):
    """A robot maker's rule: `lower <= sum_j c_j theta_j <= upper` [rad or m] wherever all conditions in `where` hold.

    Mimic joints are allowed. A rule without conditions holds everywhere, as a joint limit does.

    Attributes:
        name: Its name, used for edges of regions and for violations.
        coefficients: c_j by joint name [1].
        lower: [rad or m], may be -inf.
        upper: [rad or m], may be inf.
        where: Conditions; the rule applies where all of them hold.

    Example:
        The arm must not lean back by more than 19 degrees while the forearm is below the horizontal:

        >>> low = Condition({"J3": 1.0}, upper=0.0)
        >>> Rule("front", {"J2": 1.0}, lower=math.radians(-19), where=(low,)).where[0].upper
        0.0
    """

    name: str
    coefficients: Mapping[str, float]
    lower: float = -math.inf
    upper: float = math.inf
    where: tuple[Condition, ...] = ()
    line: int | None = None


@dataclass(frozen=True, slots=True)
class Axis(Value):
    """A coordinate of q that is a sum of joints, `sum_j c_j theta_j`, commanded instead of one of them.

    For example, a third axis that the URDF measures from the arm can be measured from the ground, and vice versa.

    Attributes:
        name: Its name, an entry of `robot.coordinates`.
        instead_of: The joint that it replaces in q.
        coefficients: c_j by joint name [1]; the coefficient of `instead_of` is not zero.

    Example:
        >>> Axis("J3_absolute", instead_of="J3", coefficients={"J2": 1.0, "J3": 1.0}).instead_of
        'J3'
    """

    name: str
    instead_of: str
    coefficients: Mapping[str, float]
    line: int | None = None


@dataclass(frozen=True, slots=True)
class LeftOutMark(Value):
    """Two links, by name, that have no boundary, with the reason and the file that states it.

    This is a statement, not a proof: `robot.coverage` lists it with its source, unless it can prove the pair itself.

    Attributes:
        a: Name of one link.
        b: Name of the other.
        reason: Why no boundary watches them, as text for people.
        source: The file that states it.

    Example:
        >>> LeftOutMark("camera", "hand", "the cable tray keeps them apart").source
        'annotations'
    """

    a: str
    b: str
    reason: str
    source: str = "annotations"
    line: int | None = None


@dataclass(frozen=True, slots=True)
class RawItem(Value):
    """One element or YAML entry before validation: its kind, its fields as written, its file and line.

    Fields are text. If `passive` or `active` is given as a list, the field is a tuple of names, which may contain
    spaces. For rules and axes, `coefficients` is a sequence of pairs (joint, number); for rules, `where` is a sequence
    of mappings of such fields. File names are relative to `folder`; if it is empty, to the folder of the URDF.
    """

    kind: str
    fields: Mapping[str, Any]
    source: str
    line: int | None
    folder: str = ""
