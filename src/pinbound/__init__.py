"""pinbound: coupled joint limits and self-collision boundaries in closed form, from a URDF, beside Pinocchio."""

from pinbound.annotations import Annotations, BoundaryMark, ClosureMark, FollowerMark, LimitMark, Point
from pinbound.boundary import Boundary, ContactAngle
from pinbound.boundary_set import BoundarySet, CoordinateLimits, Smallest
from pinbound.certificates import (
    BoundedMotion,
    BoxCertificate,
    Budget,
    Certificate,
    Verdict,
    certified_box,
    certify,
    certify_box,
    signed_clearances,
)
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
from pinbound.inverse_kinematics import InverseKinematics, solve_ik
from pinbound.marking import Proposal, propose_marks
from pinbound.motion import Motion, MotionHistory, history, read_motion
from pinbound.path import Kind
from pinbound.region import (
    Corner,
    Edge,
    Membership,
    Place,
    Region,
    Section,
    SmallestClearance,
    SweptBody,
    classify,
    feasible_region,
    region_membership,
    swept_body,
    workspace_section,
)
from pinbound.robot import Robot, load

__version__ = "0.1.0"

__all__ = [
    "AllowedArcs",
    "AllowedArcsTable",
    "Annotations",
    "Boundary",
    "BoundaryMark",
    "BoundarySet",
    "BoundedMotion",
    "BoxCertificate",
    "Budget",
    "Certificate",
    "ClosureMark",
    "ContactAngle",
    "CoordinateLimits",
    "Corner",
    "DimensionError",
    "Edge",
    "FollowerMark",
    "InputError",
    "InverseKinematics",
    "Kind",
    "LeavesRegionError",
    "LimitMark",
    "Membership",
    "Motion",
    "MotionHistory",
    "PinboundError",
    "Place",
    "Point",
    "Proposal",
    "Region",
    "Robot",
    "Section",
    "Smallest",
    "SmallestClearance",
    "SweptBody",
    "UnknownNameError",
    "UnsupportedError",
    "Verdict",
    "certified_box",
    "certify",
    "certify_box",
    "classify",
    "feasible_region",
    "history",
    "load",
    "packaged_robots",
    "propose_marks",
    "read_motion",
    "region_membership",
    "signed_clearances",
    "solve_ik",
    "swept_body",
    "workspace_section",
]
