"""pinbound: coupled joint limits and self-collision boundaries in closed form, from a URDF, beside Pinocchio."""

from pinbound.annotations import Annotations, BoundaryMark, ClosureMark, FollowerMark, LimitMark, Point
from pinbound.boundary import Boundary, BoundarySet, ContactAngle, CoordinateLimits
from pinbound.crosscheck import CrossCheck, cross_check
from pinbound.document import packaged_robots
from pinbound.exceptions import (
    DimensionError,
    InputError,
    PinboundError,
    UnknownNameError,
    UnsupportedError,
)
from pinbound.interpreters.univariate import AllowedArcs
from pinbound.marking import Proposal, propose_marks
from pinbound.path import Kind
from pinbound.region import Edge, Region, feasible_region
from pinbound.robot import Robot, load

__version__ = "0.1.0"

__all__ = [
    "AllowedArcs",
    "Annotations",
    "Boundary",
    "BoundaryMark",
    "BoundarySet",
    "ClosureMark",
    "ContactAngle",
    "CoordinateLimits",
    "CrossCheck",
    "DimensionError",
    "Edge",
    "FollowerMark",
    "InputError",
    "Kind",
    "LimitMark",
    "PinboundError",
    "Point",
    "Proposal",
    "Region",
    "Robot",
    "UnknownNameError",
    "UnsupportedError",
    "cross_check",
    "feasible_region",
    "load",
    "packaged_robots",
    "propose_marks",
]
