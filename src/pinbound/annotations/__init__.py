"""Marks, boundaries, closures and home of a robot: inline in the URDF, in a YAML sidecar, or in an SRDF.

All formats become the same raw items, which one validator checks, so the formats have the same rules. Unknown elements
and attributes are faults: a misspelt `min_distance` must not pass.
"""

from pinbound.annotations.inline import read_inline
from pinbound.annotations.marks import Box, Cylinder, FlatMark, Hull, Line, Mark, Plane, Point, Segment, Sweep
from pinbound.annotations.mesh_hulls import HullFiles
from pinbound.annotations.records import (
    FIELDS,
    MARK_KINDS,
    NAMESPACE,
    Axis,
    BoundaryMark,
    ClosureMark,
    Condition,
    FollowerMark,
    LeftOutMark,
    LimitMark,
    RawItem,
    Rule,
    kind_of,
)
from pinbound.annotations.shapes import Measure, Shape
from pinbound.annotations.whole import Annotations, raw_items, validate

__all__ = [
    "FIELDS",
    "MARK_KINDS",
    "NAMESPACE",
    "Annotations",
    "Axis",
    "BoundaryMark",
    "Box",
    "ClosureMark",
    "Condition",
    "Cylinder",
    "FlatMark",
    "FollowerMark",
    "Hull",
    "HullFiles",
    "LeftOutMark",
    "LimitMark",
    "Line",
    "Mark",
    "Measure",
    "Plane",
    "Point",
    "RawItem",
    "Rule",
    "Segment",
    "Shape",
    "Sweep",
    "kind_of",
    "raw_items",
    "read_inline",
    "validate",
]
