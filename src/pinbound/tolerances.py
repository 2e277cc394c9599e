"""Every tolerance of pinbound, once, with its unit and its reason."""

from typing import Final

__all__ = [
    "CHORD",
    "CLOSURE",
    "CONTACT",
    "CONTOUR_ROUNDING",
    "CONTOUR_TURN",
    "CROSSCHECK_ANGLE",
    "CROSSCHECK_BODY",
    "CROSSCHECK_GRAZING",
    "CROSSCHECK_INFLATION",
    "CROSSCHECK_POINT",
    "CROSSCHECK_SOLID",
    "CROSSCHECK_STOP",
    "EVALUATION",
    "FIRST_CONTACT",
    "FOLDING",
    "FOLLOWS",
    "HOME",
    "IMPLIED",
    "INFLATION",
    "KERNEL_CONSTANT",
    "LIMIT",
    "LONGEST",
    "LONGEST_SINGLE",
    "MESH_CHORD",
    "ON_CONTOUR",
    "OVERLAP",
    "PRECISION",
    "QUADRATURE",
    "REACHED",
    "REDUCTION",
    "REDUCTION_ROUNDOFFS",
    "REGION_ACCURACY",
    "ROOT",
    "SAME_BODY",
    "SOLVES",
    "SYMBOLIC_DIGITS",
    "UNIT_ROUNDOFF",
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

UNIT_ROUNDOFF: Final = 2.0**-53
"""Relative error of one float64 operation, rounded to nearest."""

FOLDING: Final = 256
"""Unit roundoffs per squared number of joints on a path, relative to its length: what folding its constants and
reducing it can have changed (`docs/certificates.md` adds them up)."""

REDUCTION_ROUNDOFFS: Final = 128
"""Unit roundoffs, rounded up: `REDUCTION` = 90 of them, taken for zero in an angle's coefficient, and its sums."""

EVALUATION: Final = 32
"""Unit roundoffs per rotation, relative to the length of a path: two sines, one turn, one sum, one root."""

INFLATION: Final = 1.0 + 1e-12
"""Factor on every lever arm and every remainder: far above the rounding of the sums that make them (1e-14)."""

LIMIT: Final = 1e-12
"""Radians or metres. A motion exceeds a joint limit if it passes it by more: degrees converted to radians, and sums
along a spline, end up this close on either side."""

PRECISION: Final = 1e-6
"""Metres. Default width of the bounds of a motion's smallest clearance: a tenth of the rounding of 0.01 mm data."""

FIRST_CONTACT: Final = 1e-9
"""Relative to the duration of a motion: the width to which the first contact is bracketed."""

FOLLOWS: Final = 1e-4
"""Radians or metres. A recorded follower follows if it is this near: encoders resolve 1e-5, backlash is far more."""

ON_CONTOUR: Final = 1e-9
"""Radians. A configuration is on a region's contour within this: the rounding of a path given to nine decimals."""
CHORD: Final = 1e-6
"""Metres. Default distance between a curved edge of the workspace and the polyline that stands for it: far below any
machine's accuracy, and still only some hundred points an edge."""

MESH_CHORD: Final = 1e-4
"""Metres. Default distance between a swept body and its mesh: 0.1 mm keeps files small."""

QUADRATURE: Final = 1e-13
"""Relative. Edges are halved until doubling the quadrature nodes changes an integral by less: near rounding."""

REACHED: Final = 1e-10
"""Metres. Inverse kinematics has converged when the frame is this near to its target."""

SOLVES: Final = 1e-12
"""Metres. A printed limit solves its component equation if it leaves less: rounding in arms of 0.1 m leaves 1e-16, a
wrong quadrant millimetres."""
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
KERNEL_CONSTANT: Final = 2.0**-52
"""Relative to the length of a path, and absolute for entries of rotations: constants of the batch kernel that differ
by this, the last digit of a float64, are one constant, so that what they stand for is computed once."""
LONGEST: Final = 1e75
"""Metres. Longest offset, and longest slide, that is taken: nearest points of segments need products of four lengths,
which overflow float64 from 1e77 m on."""

LONGEST_SINGLE: Final = 1e9
"""Metres, the same for float32, in which products of four lengths overflow from 4e9 m on."""

CROSSCHECK_POINT: Final = 1e-12
"""Metres, a metre of the path's length. Largest difference between a clearance and coal's distance of two spheres: a
few hundred roundings, far below any length that matters."""

CROSSCHECK_INFLATION: Final = 1e-10
"""Relative to a box's sides. Coal makes a box larger by half of this where it looks along one of its faces."""

CROSSCHECK_ANGLE: Final = 1e-9
"""Radians (metres for slides). Largest difference between a contact in closed form and the one found on coal's
distance; roundings of 1e-15 m over slopes down to `CROSSCHECK_GRAZING` leave this."""

CROSSCHECK_GRAZING: Final = 1e-5
"""Metres per radian. Below this slope a ray only grazes its contact, whose place rounding then decides: such a
contact is compared in metres, not in radians."""

CROSSCHECK_BODY: Final = 1e-6
"""Metres. How well coal (GJK, EPA) knows the distance of bodies other than spheres: its own default tolerance."""

CROSSCHECK_SOLID: Final = 1e-8
"""Metres, a metre of the path's length. How well coal's iteration, asked for 1e-9 m, knows the distance of boxes and
prisms."""

CROSSCHECK_STOP: Final = 1e-4
"""Metres. A boundary of zero threshold says that bodies first touch at the marked points: a gap left when they meet
may not be larger than this, five times the rounding of the data (`CONTACT`)."""

SAME_BODY: Final = 1e-9
"""Metres. A cylinder and spheres over its ends are one capsule if ends and radii agree to this: far below any
manufacture, far above rounding."""

OVERLAP: Final = 1e-14
"""Relative to the length of a path: boxes or prisms that are nearer than this overlap, as far as rounding can tell."""
