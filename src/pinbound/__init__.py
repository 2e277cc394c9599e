"""pinbound: coupled joint limits and self-collision boundaries in closed form, from a URDF, beside Pinocchio."""

from pinbound.boundary import Boundary, BoundarySet, ContactAngle, CoordinateLimits
from pinbound.document import packaged_robots
from pinbound.exceptions import (
    DimensionError,
    InputError,
    LeavesRegionError,
    PinboundError,
    UnknownNameError,
    UnsupportedError,
)
from pinbound.interpreters.univariate import AllowedArcs, AllowedArcsTable
from pinbound.path import Kind
from pinbound.region import Corner, Edge, Region, SmallestClearance, feasible_region
from pinbound.robot import Robot, load

__version__ = "0.1.0"

__all__ = [
    "AllowedArcs",
    "AllowedArcsTable",
    "Boundary",
    "BoundarySet",
    "ContactAngle",
    "CoordinateLimits",
    "Corner",
    "DimensionError",
    "Edge",
    "InputError",
    "Kind",
    "LeavesRegionError",
    "PinboundError",
    "Region",
    "Robot",
    "SmallestClearance",
    "UnknownNameError",
    "UnsupportedError",
    "feasible_region",
    "load",
    "packaged_robots",
]
