"""Every tolerance of pinbound, once, with its unit and its reason."""

from typing import Final

__all__ = [
    "CHORD",
    "CLOSURE",
    "CONTACT",
    "HOME",
    "IMPLIED",
    "MESH_CHORD",
    "ON_CONTOUR",
    "QUADRATURE",
    "REACHED",
    "REDUCTION",
    "SOLVES",
    "SYMBOLIC_DIGITS",
    "VERTEX",
]

CONTACT: Final = 2e-5
"""Metres. Default `contact_tolerance`: two arms that should have equal lengths may differ by the rounding of
data given to 0.01 mm, two points of two coordinates each: 2 * sqrt(2) * 0.005 mm = 0.014 mm."""

CLOSURE: Final = 1e-6
"""Metres. A loop closes if its proven residual is below this: far above rounding (1e-16), far below any
play of a real pin (1e-5)."""

HOME: Final = 1e-6
"""Radians or metres. A passive joint that home names must be where the closed loops put it: six decimals of it."""

REDUCTION: Final = 1e-14
"""Relative to the length of a path, and absolute for unit vectors: two axes are parallel, or an offset is
zero, if folding constant transforms in float64 could have made the difference."""

IMPLIED: Final = 1e-9
"""Radians. A limit is implied if the region stays this far, or less, on its wrong side: it touches at most."""

VERTEX: Final = 1e-12
"""Radians. Two vertices nearer than this are one."""

SYMBOLIC_DIGITS: Final = 15
"""Decimal digits that symbolic output keeps of a float64, so that 0.06827 - 0.1 prints as -0.03173."""

CHORD: Final = 1e-6
"""Metres. Default distance between a curved edge of the workspace and the polyline that stands for it: far below any
machine's accuracy, and still only some hundred points an edge."""

MESH_CHORD: Final = 1e-4
"""Metres. Default distance between a swept body and its mesh: 0.1 mm keeps files small."""

QUADRATURE: Final = 1e-13
"""Relative. Edges are halved until doubling the quadrature nodes changes an integral by less: near rounding."""

ON_CONTOUR: Final = 1e-9
"""Radians. A configuration this near to the contour of a region is on it: far above the rounding of a converged
inverse kinematics (1e-12), far below any encoder's step."""

REACHED: Final = 1e-10
"""Metres. Inverse kinematics has converged when the frame is this near to its target."""

SOLVES: Final = 1e-12
"""Metres. A printed limit solves its component equation if it leaves less: rounding in arms of 0.1 m leaves 1e-16, a
wrong quadrant millimetres."""
