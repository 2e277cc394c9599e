"""Every tolerance of pinbound, once, with its unit and its reason."""

from typing import Final

__all__ = [
    "CLOSURE",
    "CONTACT",
    "CONTOUR_ROUNDING",
    "CONTOUR_TURN",
    "IMPLIED",
    "REDUCTION",
    "REGION_ACCURACY",
    "ROOT",
    "SYMBOLIC_DIGITS",
    "VERTEX",
]

CONTACT: Final = 2e-5
"""Metres. Default `contact_tolerance`: two arms that should have equal lengths may differ by the rounding of
data given to 0.01 mm, two points of two coordinates each: 2 * sqrt(2) * 0.005 mm = 0.014 mm."""

CLOSURE: Final = 1e-6
"""Metres. A loop closes if its proven residual is below this: far above rounding (1e-16), far below any
play of a real pin (1e-5)."""

REDUCTION: Final = 1e-14
"""Relative to the length of a path, and absolute for unit vectors: two axes are parallel, or an offset is
zero, if folding constant transforms in float64 could have made the difference."""

IMPLIED: Final = 1e-9
"""Radians. A limit is implied if the region stays this far, or less, on its wrong side: it touches at most."""

VERTEX: Final = 1e-12
"""Radians. Two vertices nearer than this are one."""

SYMBOLIC_DIGITS: Final = 15
"""Decimal digits that symbolic output keeps of a float64, so that 0.06827 - 0.1 prints as -0.03173."""

REGION_ACCURACY: Final = 1e-5
"""Radians. Default chord error of a traced contact curve: a sixth of the least step of a 16-bit encoder (9.6e-5)."""

CONTOUR_ROUNDING: Final = 1e-13
"""Relative to the reach of a path (or its square): what rounding may add to a norm of up to a hundred operations."""

CONTOUR_TURN: Final = 0.25
"""Radians. A chord of a traced curve subtends at most this turn, so that islands smaller than the accuracy keep
their shape."""

ROOT: Final = 1e-13
"""Relative to the size of a coordinate (1 rad at least). Where contact cannot be told from freedom in an interval
of this half-width, it is taken for contact: the width at which rounding hides a triple root."""
