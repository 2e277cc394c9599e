"""pinbound: coupled joint limits and self-collision boundaries in closed form, from a URDF, beside Pinocchio."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from pinbound.annotations import (
    Annotations,
    Axis,
    BoundaryMark,
    Box,
    ClosureMark,
    Condition,
    Cylinder,
    FollowerMark,
    Hull,
    LeftOutMark,
    LimitMark,
    Line,
    Measure,
    Plane,
    Point,
    Rule,
    Segment,
    Shape,
    Sweep,
)
from pinbound.boundaries.boundary import Boundary, ContactAngle, Penetration
from pinbound.boundaries.boundary_set import BoundarySet, CoordinateLimits, Smallest
from pinbound.coverage import Coverage, CoverageRecord
from pinbound.exceptions import (
    DimensionError,
    InputError,
    LeavesRegionError,
    MachineError,
    PinboundError,
    UnknownNameError,
    UnsupportedError,
)
from pinbound.limits.univariate import AllowedArcs, AllowedArcsTable
from pinbound.model.document import packaged_robots
from pinbound.path.kind import Kind
from pinbound.robot.loading import load
from pinbound.robot.robot import Robot

if TYPE_CHECKING:
    from pinbound.adapters.steps import StepBounds, StepRows
    from pinbound.certificates import (
        BoundedMotion,
        BoxCertificate,
        Budget,
        Certificate,
        Verdict,
        Verdicts,
        certified_box,
        certify,
        certify_box,
        certify_many,
        signed_clearances,
    )
    from pinbound.crosscheck import CrossCheck, cross_check
    from pinbound.freespace import (
        FreeCover,
        FreePolytope,
        FreeProjection,
        FreeVolume,
        Plan,
        certified_cover,
        certified_polytope,
        free_projection,
        free_volume,
        load_cover,
        plan,
    )
    from pinbound.marking.propose import Proposal, propose_marks
    from pinbound.motion.history import Motion, MotionHistory, history, read_motion
    from pinbound.motion.inverse_kinematics import InverseKinematics, solve_ik
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
    from pinbound.robot.limit_tables import LimitTable, limit_table

__version__ = "0.1.0"

__all__ = [
    "AllowedArcs",
    "AllowedArcsTable",
    "Annotations",
    "Axis",
    "Boundary",
    "BoundaryMark",
    "BoundarySet",
    "BoundedMotion",
    "Box",
    "BoxCertificate",
    "Budget",
    "Certificate",
    "ClosureMark",
    "Condition",
    "ContactAngle",
    "CoordinateLimits",
    "Corner",
    "Coverage",
    "CoverageRecord",
    "CrossCheck",
    "Cylinder",
    "DimensionError",
    "Edge",
    "FollowerMark",
    "FreeCover",
    "FreePolytope",
    "FreeProjection",
    "FreeVolume",
    "Hull",
    "InputError",
    "InverseKinematics",
    "Kind",
    "LeavesRegionError",
    "LeftOutMark",
    "LimitMark",
    "LimitTable",
    "Line",
    "MachineError",
    "Measure",
    "Membership",
    "Motion",
    "MotionHistory",
    "Penetration",
    "PinboundError",
    "Place",
    "Plan",
    "Plane",
    "Point",
    "Proposal",
    "Region",
    "Robot",
    "Rule",
    "Section",
    "Segment",
    "Shape",
    "Smallest",
    "SmallestClearance",
    "StepBounds",
    "StepRows",
    "Sweep",
    "SweptBody",
    "UnknownNameError",
    "UnsupportedError",
    "Verdict",
    "Verdicts",
    "certified_box",
    "certified_cover",
    "certified_polytope",
    "certify",
    "certify_box",
    "certify_many",
    "classify",
    "cross_check",
    "feasible_region",
    "free_projection",
    "free_volume",
    "history",
    "limit_table",
    "load",
    "load_cover",
    "packaged_robots",
    "plan",
    "propose_marks",
    "read_motion",
    "region_membership",
    "signed_clearances",
    "solve_ik",
    "swept_body",
    "workspace_section",
]

_LATER = {
    "CrossCheck": "pinbound.crosscheck",
    "LimitTable": "pinbound.robot.limit_tables",
    "limit_table": "pinbound.robot.limit_tables",
    "StepBounds": "pinbound.adapters.steps",
    "StepRows": "pinbound.adapters.steps",
    "cross_check": "pinbound.crosscheck",
    "BoundedMotion": "pinbound.certificates",
    "BoxCertificate": "pinbound.certificates",
    "Budget": "pinbound.certificates",
    "Certificate": "pinbound.certificates",
    "Verdict": "pinbound.certificates",
    "Verdicts": "pinbound.certificates",
    "certified_box": "pinbound.certificates",
    "certify": "pinbound.certificates",
    "certify_box": "pinbound.certificates",
    "certify_many": "pinbound.certificates",
    "signed_clearances": "pinbound.certificates",
    "FreeCover": "pinbound.freespace",
    "FreePolytope": "pinbound.freespace",
    "FreeProjection": "pinbound.freespace",
    "free_projection": "pinbound.freespace",
    "certified_cover": "pinbound.freespace",
    "load_cover": "pinbound.freespace",
    "Plan": "pinbound.freespace",
    "plan": "pinbound.freespace",
    "FreeVolume": "pinbound.freespace",
    "free_volume": "pinbound.freespace",
    "certified_polytope": "pinbound.freespace",
    "InverseKinematics": "pinbound.motion.inverse_kinematics",
    "solve_ik": "pinbound.motion.inverse_kinematics",
    "Proposal": "pinbound.marking.propose",
    "propose_marks": "pinbound.marking.propose",
    "Motion": "pinbound.motion.history",
    "MotionHistory": "pinbound.motion.history",
    "history": "pinbound.motion.history",
    "read_motion": "pinbound.motion.history",
    "Corner": "pinbound.region",
    "Edge": "pinbound.region",
    "Membership": "pinbound.region",
    "Place": "pinbound.region",
    "Region": "pinbound.region",
    "Section": "pinbound.region",
    "SmallestClearance": "pinbound.region",
    "SweptBody": "pinbound.region",
    "classify": "pinbound.region",
    "feasible_region": "pinbound.region",
    "region_membership": "pinbound.region",
    "swept_body": "pinbound.region",
    "workspace_section": "pinbound.region",
}
"""Rooms above the robot load when first asked for: `import pinbound` costs little more than `import pinocchio`."""


def __getattr__(name: str) -> Any:
    """Load a name of a room above the robot."""
    if name not in _LATER:
        raise AttributeError(f"module 'pinbound' has no attribute {name!r}")
    value = globals()[name] = getattr(import_module(_LATER[name]), name)
    return value


def __dir__() -> list[str]:
    """List the public names, loaded or not."""
    return sorted(__all__)
