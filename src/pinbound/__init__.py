"""pinbound: coupled joint limits and self-collision boundaries in closed form, from a URDF, beside Pinocchio."""

from pinbound.boundary import Boundary, BoundarySet, ContactAngle, CoordinateLimits, Smallest
from pinbound.document import packaged_robots
from pinbound.exceptions import (
    DimensionError,
    InputError,
    PinboundError,
    UnknownNameError,
    UnsupportedError,
)
from pinbound.interpreters.univariate import AllowedArcs
from pinbound.path import Kind
from pinbound.region import Edge, Region, feasible_region
from pinbound.robot import Robot, load

__version__ = "0.1.0"

__all__ = [
    "AllowedArcs",
    "Boundary",
    "BoundarySet",
    "ContactAngle",
    "CoordinateLimits",
    "DimensionError",
    "Edge",
    "InputError",
    "Kind",
    "PinboundError",
    "Region",
    "Robot",
    "Smallest",
    "UnknownNameError",
    "UnsupportedError",
    "feasible_region",
    "load",
    "packaged_robots",
]
