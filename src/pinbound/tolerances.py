"""Every tolerance of pinbound, once, with its unit and its reason."""

from typing import Final

__all__ = [
    "CLOSURE",
    "CONTACT",
    "CROSSCHECK_ANGLE",
    "CROSSCHECK_BODY",
    "CROSSCHECK_GRAZING",
    "CROSSCHECK_POINT",
    "CROSSCHECK_STOP",
    "HOME",
    "IMPLIED",
    "REDUCTION",
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

CROSSCHECK_POINT: Final = 1e-12
"""Metres. Largest difference between a clearance and coal's distance of two spheres: a few hundred roundings of
lengths of a few metres, far below any length that matters."""

CROSSCHECK_ANGLE: Final = 1e-9
"""Radians (metres for slides). Largest difference between a contact in closed form and the one found on coal's
distance; roundings of 1e-15 m over slopes down to `CROSSCHECK_GRAZING` leave this."""

CROSSCHECK_GRAZING: Final = 1e-5
"""Metres per radian. Below this slope a ray only grazes its contact, whose place rounding then decides: such a
contact is compared in metres, not in radians."""

CROSSCHECK_BODY: Final = 1e-6
"""Metres. How well coal (GJK, EPA) knows the distance of bodies other than spheres: its own default tolerance."""

CROSSCHECK_STOP: Final = 1e-4
"""Metres. A boundary of zero threshold says that bodies first touch at the marked points: a gap left when they meet
may not be larger than this, five times the rounding of the data (`CONTACT`)."""
