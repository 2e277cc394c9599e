"""Links and joints of a robot as its URDF declares them: immutable records, in file order."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from pinbound.typing import Array
from pinbound.values import Value

__all__ = ["JOINT_TYPES", "MOVING_TYPES", "Joint", "JointType", "Kinematics", "Link", "Mimic"]

JointType = Literal["revolute", "continuous", "prismatic", "fixed", "floating", "planar"]
JOINT_TYPES: tuple[str, ...] = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
MOVING_TYPES = ("revolute", "continuous", "prismatic")
"""Joint types with one coordinate; only on these can a boundary depend."""


@dataclass(frozen=True, slots=True)
class Mimic:
    """`theta = multiplier * theta_primary + offset`, as in a `<mimic>` element."""

    primary: str
    multiplier: float
    offset: float


@dataclass(frozen=True, slots=True)
class Link:
    """A link: its name, and whether it has a body."""

    name: str
    has_inertia: bool
    has_geometry: bool
    line: int | None = None


@dataclass(frozen=True, eq=False, slots=True)
class Joint(Value):
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
    rotation: Array
    translation: Array
    axis: Array
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
