"""Every tolerance of pinbound, once, with its unit and its reason."""

from typing import Final

__all__ = ["CLOSURE", "CONTACT", "IMPLIED", "KERNEL_CONSTANT", "REDUCTION", "SYMBOLIC_DIGITS", "VERTEX"]

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

KERNEL_CONSTANT: Final = 2.0**-52
"""Relative to the length of a path, and absolute for entries of rotations: constants of the batch kernel that differ
by this, the last digit of a float64, are one constant, so that what they stand for is computed once."""
