"""What a user marks on a robot: points, boundaries, closures, home; inline in the URDF, in a YAML sidecar, in an SRDF.

All spellings become the same raw items, and one validator reads those, so that they cannot drift apart. Unknown
elements and attributes are faults: a misspelt `min_distance` must not pass.
"""

from pinbound.annotations.inline import read_inline
from pinbound.annotations.marks import FlatMark, Line, Mark, Plane, Point, Segment, Sweep
from pinbound.annotations.records import (
    FIELDS,
    KINDS,
    NAMESPACE,
    Annotations,
    Axis,
    BoundaryMark,
    ClosureMark,
    Condition,
    FollowerMark,
    LeftOutMark,
    LimitMark,
    RawItem,
    Rule,
    raw_items,
)
from pinbound.annotations.validation import validate

__all__ = [
    "FIELDS",
    "KINDS",
    "NAMESPACE",
    "Annotations",
    "Axis",
    "BoundaryMark",
    "ClosureMark",
    "Condition",
    "FlatMark",
    "FollowerMark",
    "LeftOutMark",
    "LimitMark",
    "Line",
    "Mark",
    "Plane",
    "Point",
    "RawItem",
    "Rule",
    "Segment",
    "Sweep",
    "raw_items",
    "read_inline",
    "validate",
]
