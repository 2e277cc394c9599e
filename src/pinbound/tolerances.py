"""Every tolerance of pinbound, once, with its unit and its reason."""

from typing import Final

__all__ = [
    "AS_PRINTED",
    "BESIDE_CONDITION",
    "CHORD",
    "CLOSURE",
    "CLOSURE_SHARE",
    "CONTACT",
    "CONTOUR_ROUNDING",
    "CONTOUR_TURN",
    "CONVERSION",
    "COUPLED",
    "CROSSCHECK_ANGLE",
    "CROSSCHECK_BODY",
    "CROSSCHECK_GRAZING",
    "CROSSCHECK_INFLATION",
    "CROSSCHECK_POINT",
    "CROSSCHECK_SOLID",
    "CROSSCHECK_STOP",
    "DEPTH",
    "DEVIATION",
    "EQUALLY_NEAR",
    "EVALUATION",
    "EXACT_LOOP",
    "EXPLORER_BUDGET",
    "EXPLORER_SPEED",
    "EXTREME",
    "FARTHEST",
    "FEELER",
    "FIRST_CONTACT",
    "FLAT",
    "FOLDING",
    "FOLLOWS",
    "HELD",
    "HOME",
    "IMPLIED",
    "INFLATION",
    "KERNEL_CONSTANT",
    "KERNEL_SIGN",
    "LARGEST_BODY",
    "LIMIT",
    "LONGEST",
    "LONGEST_SINGLE",
    "MESH_CHORD",
    "MJCF_FRAME",
    "NEARLY_TOUCHING",
    "NEAR_STOP",
    "NEVER_MEETS",
    "ON_CONTOUR",
    "OVERLAP",
    "PARALLEL",
    "PLACED",
    "PRECISION",
    "PRINTED_PI",
    "PROVEN_GAP",
    "QUADRATURE",
    "REACHED",
    "REDUCTION",
    "REDUCTION_ROUNDOFFS",
    "REDUCTION_SLIDES",
    "REGION_ACCURACY",
    "REGION_BUDGET",
    "REGION_WIDTH",
    "ROOT",
    "SAME_BODY",
    "SAME_ROBOT",
    "SAMPLE_ROUNDOFFS",
    "SOLVES",
    "STAYS_APART",
    "STEP_BOX",
    "STEP_LIMIT",
    "STEP_SEARCH",
    "STOP_MISS",
    "SYMBOLIC_DIGITS",
    "TABLE",
    "TOGGLE",
    "UNIT_CIRCLE",
    "UNIT_ROUNDOFF",
    "VERTEX",
    "WIDEST_WINDOW",
    "XACRO_MEMORY",
    "XACRO_SECONDS",
]

CONTACT: Final = 2e-5
"""Metres. Default `contact_tolerance`: two arms that should have equal lengths may differ by the rounding of data given
to 0.01 mm. For two points of two coordinates each this is 2 * sqrt(2) * 0.005 mm = 0.014 mm."""

BESIDE_CONDITION: Final = 1e-9
"""Radians or metres. If home must be outside the condition of a rule, it is put at this distance: beyond `LIMIT`,
within which a condition still holds, and far below the resolution of any controller."""

NEAR_STOP: Final = 5e-3
"""Metres. Two points of zero threshold and one effective angle that miss each other by at most this may have been meant
as a stop, so a note says so. Data of another source or a changed length give a few millimetres; bodies that are meant
to pass each other have more."""

STOP_MISS: Final = 0.1
"""Relative to the shorter arm. The points of a declared stop may miss each other by this at the angle at which the arms
align: more is not a difference of lengths but a different point."""

CLOSURE: Final = 1e-6
"""Metres. Default tolerance of a closure, the allowed total difference of the sides of its loop: far above rounding
(1e-16), far below the play of a real pin (1e-5). The difference enters all bounds as an error of the link positions."""

CLOSURE_SHARE: Final = 1e-2
"""Relative to the length of a loop: the largest tolerance of a closure that counts. With more, every pairing of the
sides of a loop of micrometres would be equal."""

EXACT_LOOP: Final = 2e-12
"""Relative to the length of a loop. Sides that differ by less are equal: folding the constants of six joints in float64
can make this difference (`FOLDING` * 7^2 * 2^-53 = 1.4e-12 at most, normally 1e-15)."""

MJCF_FRAME: Final = 1e-6
"""Metres, and for the entries of a rotation. A body of an MJCF model and a link of the URDF are not the same frame if
their placements at zero differ by more: a pin in it would have an error above the tolerance of a closure."""

TOGGLE: Final = 1e-4
"""Radians, of the angle between the two arms that close a loop. Nearer to a toggle no q is allowed: there the passive
joints move 10^4 times as fast as the others, and rounding moves them by 1e-12. A crank is kept away from its own toggle
by half the square of this, 5e-9 rad, times the ratio of the loop's sides."""

FLAT: Final = 2e-3
"""Radians. If a loop is this near to its flat pose at home, home counts as drawn flat: angles rounded to three
decimals, or to a tenth of a degree, come this near, and both assemblies of a parallelogram fit the flat pose."""

DEVIATION: Final = 1e-2
"""Radians. The largest deviation of a passive joint from the coupling if the sides of its loop differ: a loop that
comes nearer to its flat pose deviates more, and then the coupling says little about the linkage."""

PLACED: Final = 1e-9
"""Relative to the lengths of all offsets of a robot and the angles at home: above the rounding of link positions. If
the distance of two points exceeds the distance to keep by more, their relative path is not needed while the robot
loads."""

PARALLEL: Final = 1e-3
"""Radians. Axes of successive joints that are this near to parallel, but not parallel, are named in a note: 0.06
degrees is far below any design, and far above rounding."""

XACRO_SECONDS: Final = 4.0
"""Seconds for the expansion of one xacro file: large public ones take 0.5 s; `${9**9**8}` never ends."""

XACRO_MEMORY: Final = 2 * 2**30
"""Bytes for the expansion of one xacro file: a hundred times the memory for large public ones."""

PRINTED_PI: Final = 5e-4
"""Radians. A printed angle further than this from a multiple of pi/2 does not mean that multiple, for any number of
digits: 1.571 and 3.142 do, 1.57 and 3.14 are further away."""

AGREEMENT: Final = 1e-12
"""Relative to the length of a path, and absolute for rotations: the rounding of a placement in Pinocchio and here, a
few operations of 1e-16 for each joint, over up to some hundred joints."""

HOME: Final = 1e-6
"""Radians or metres. The largest difference of a passive joint in home from the value that the closed loops give: six
decimals."""

REDUCTION: Final = 1e-14
"""Relative to the length of a path, and absolute for unit vectors: two axes are parallel, or an offset is zero, if
folding constant transforms in float64 could have made the difference."""

IMPLIED: Final = 1e-9
"""Radians. A limit is implied if the region passes it by at most this: it touches it at most."""

VERTEX: Final = 1e-12
"""Radians. Two vertices nearer than this are one."""

SYMBOLIC_DIGITS: Final = 15
"""Decimal digits that symbolic output keeps of a float64, so that 0.06827 - 0.1 prints as -0.03173."""

UNIT_ROUNDOFF: Final = 2.0**-53
"""Relative error of one float64 operation, rounded to nearest."""

FOLDING: Final = 256
"""Unit roundoffs for each squared number of joints on a path, relative to its length: the largest error of folding its
constants and reducing it (`docs/certificates.md` adds them up)."""

REDUCTION_ROUNDOFFS: Final = 192
"""Unit roundoffs, rounded up: `REDUCTION` is 90 of them. An angle's coefficient loses this at most twice for each joint
(an entry that counts as zero, and a difference of two angles that count as equal)."""

REDUCTION_SLIDES: Final = 512
"""Unit roundoffs, rounded up: the vector of three slides of `REDUCTION` (156) that leaves the chain, or (312) the head
of the chain. Metres for each unit of a coordinate, for a path of any length."""

EVALUATION: Final = 32
"""Unit roundoffs for each rotation, relative to the length of a path: two sines, one rotation, one sum, one root."""

CONVERSION: Final = 64
"""Unit roundoffs for each degree and one, relative to the sum of the sizes of its terms: the largest error of a change
of a spline's basis, from the differences of its breakpoints to the last sum (`docs/certificates.md`)."""

SAMPLE_ROUNDOFFS: Final = 1000
"""Unit roundoffs, relative to 1 and the size of a value: the allowed rounding of a caller's function of time, before
its values contradict its bounds."""

FARTHEST: Final = 1e100
"""Radians or metres. A motion or box beyond it is refused: its fourth power would overflow float64."""

INFLATION: Final = 1.0 + 1e-12
"""Factor on every lever arm and every remainder: far above the rounding of the sums that make them (1e-14)."""

LIMIT: Final = 1e-12
"""Radians or metres. A joint limit is violated if it is passed by more: degrees converted to radians, and sums along a
spline, have errors of this size on either side."""

LARGEST_BODY: Final = 1e9
"""Metres. A longer body, or one further from its link, is a fault of the file: no robot is so large, and sums of
squares of such lengths stay far from overflow."""

PRECISION: Final = 1e-6
"""Metres. Default width of the bounds of a motion's smallest clearance: a tenth of the rounding of 0.01 mm data."""

FIRST_CONTACT: Final = 1e-9
"""Relative to the duration of a motion: the width to which the first contact is bracketed."""

FOLLOWS: Final = 1e-4
"""Radians or metres. The largest error of a recorded mimic joint: encoders resolve 1e-5, and backlash is far larger."""

COUPLED: Final = 1e-6
"""Radians or metres. The largest difference of a mimic joint of a user's own model from the value that its primary
gives: a million steps of integration leave 1e-9, and a model without the coupling leaves more at once."""

SAME_ROBOT: Final = 1e-9
"""Metres for each metre of the robot's size, and absolute for rotations: the largest difference of a link's placement
in a user's model. Angles that are printed to 11 digits and read as pi leave 1e-11."""

UNIT_CIRCLE: Final = 1e-6
"""Bound of `cos^2 + sin^2 - 1` of a continuous joint: integration leaves 1e-9; two numbers that are not cos and sin
leave more."""

TABLE: Final = 1e-9
"""Radians. Entries of tables of coupled limits are this far inside the limits: printing and a reader's interpolation
round by less (1e-14)."""

STEP_BOX: Final = 1.0 + 1e-3
"""Factor on the box of a step in proofs: solvers of quadratic programs violate its sides by their tolerance, 1e-6 m."""

STEP_LIMIT: Final = 1e-3
"""Radians or metres. By how much a step may pass a joint limit, in proofs of its rows: the tolerance of a solver for
that row."""

STEP_SEARCH: Final = 1e-6
"""Metres. Added to the reach of a step before a boundary is left out of its rows: a search for nearest points may end
early at slivers that touch, with an error of 3e-7 m (docs/hulls.md)."""

ON_CONTOUR: Final = 1e-9
"""Radians. A configuration this near to a region's contour is on it: the rounding of a path given to nine decimals."""
CHORD: Final = 1e-6
"""Metres. Default distance between a curved edge of the workspace and its polyline: far below any machine's accuracy,
and still only some hundred points for each edge."""

MESH_CHORD: Final = 1e-4
"""Metres. Default distance between a swept body and its mesh: 0.1 mm keeps files small."""

QUADRATURE: Final = 1e-13
"""Relative. Edges are halved until twice the quadrature nodes change an integral by less: near rounding."""

REACHED: Final = 1e-10
"""Metres. Inverse kinematics has converged if the distance of the frame from its target is at most this."""

AS_PRINTED: Final = 1e-6
"""Millimetres. The largest difference of a marked point from its printed position in the paper, which has two
decimals."""

SOLVES: Final = 1e-12
"""Metres. A printed limit solves its component equation if the residual is less: rounding in arms of 0.1 m leaves
1e-16, a wrong quadrant leaves millimetres."""
REGION_ACCURACY: Final = 1e-5
"""Radians or metres, or the same share of a window narrower than one. Default chord error of a traced contact curve: a
sixth of the step of a 16-bit encoder (9.6e-5 rad)."""

REGION_BUDGET: Final = 120.0
"""Seconds. Default time after which tracing or insetting a region ends in an error that says what remains."""

REGION_WIDTH: Final = 2e-3
"""Radians or metres, or the same share of a window narrower than one. Default side of the cells that enclose a contact
curve which needs a search: twenty steps of a 16-bit encoder, some ten thousand cells for each curve."""

WIDEST_WINDOW: Final = 1e6
"""Radians or metres. A limit further out than this does not count in a region: a float64 has an angle of 1e6 rad only
to 1e-10 rad, and SDF writes 1e16 if there is no limit."""

CONTOUR_ROUNDING: Final = 1e-13
"""Relative to the reach of a path (or its square): the rounding error of a norm of up to a hundred operations."""

CONTOUR_TURN: Final = 0.25
"""Radians. A chord of a traced curve spans at most this turn, so that islands smaller than the accuracy keep their
shape."""

ROOT: Final = 1e-13
"""Relative to the size of a coordinate (at least 1 rad). If contact and free cannot be distinguished in an interval of
this half-width, it counts as contact: it is the width at which rounding hides a triple root."""
KERNEL_CONSTANT: Final = 2.0**-52
"""Relative to the length of a path, and absolute for entries of rotations: constants of the batch kernel that differ by
at most this, the last digit of a float64, are merged, so that their expressions are computed once."""

KERNEL_SIGN: Final = 3.6e-15
"""Relative to the length of a path, once for each of its angles and each radian of them: below this size, a result of
the batch kernel, and of the reference interpreter, may have the wrong sign (16 machine epsilons)."""

LONGEST: Final = 1e75
"""Metres. The longest offset, and the longest displacement of a prismatic joint, that is accepted: nearest points of
segments need products of four lengths, which overflow float64 from 1e77 m on."""

LONGEST_SINGLE: Final = 1e9
"""Metres, the same for float32, in which products of four lengths overflow from 4e9 m on."""

CROSSCHECK_POINT: Final = 1e-12
"""Metres, for each metre of the path's length. Largest difference between a clearance and coal's distance of two
spheres: a few hundred roundings, far below any length that matters."""

CROSSCHECK_INFLATION: Final = 1e-10
"""Relative to a box's sides. In directions along one of its faces, coal enlarges a box by half of this."""

CROSSCHECK_ANGLE: Final = 1e-9
"""Radians (metres for prismatic joints). Largest difference between a contact in closed form and the one found on
coal's distance: the result of roundings of 1e-15 m with slopes down to `CROSSCHECK_GRAZING`."""

CROSSCHECK_GRAZING: Final = 1e-5
"""Metres per radian. Below this slope a ray only grazes its contact, and rounding decides its position: such a contact
is compared in metres, not in radians."""

CROSSCHECK_BODY: Final = 1e-6
"""Metres. The accuracy of coal (GJK, EPA) for the distance of bodies other than spheres: its own default tolerance."""

CROSSCHECK_SOLID: Final = 1e-8
"""Metres, for each metre of the path's length. The accuracy of coal's iteration, with a tolerance of 1e-9 m, for the
distance of boxes and prisms."""

CROSSCHECK_STOP: Final = 1e-4
"""Metres. A boundary of zero threshold says that bodies first touch at the marked points: the largest gap that may
remain at contact, five times the rounding of the data (`CONTACT`)."""

SAME_BODY: Final = 1e-9
"""Metres. A cylinder and spheres over its ends are one capsule if ends and radii agree to this: far below any
manufacturing accuracy, far above rounding."""

EXTREME: Final = 2e-15
"""Relative to a hull's furthest vertex: a point this near to the hull of others, to their plane or to their line is on
it, up to the rounding of its own coordinates (16 unit roundoffs, rounded up)."""

OVERLAP: Final = 1e-14
"""Relative to the length of a path: boxes or prisms that are nearer than this overlap, up to rounding."""

NEARLY_TOUCHING: Final = 1e-9
"""Relative to the size of two bodies: below this distance, float64 may find wrong nearest features."""

PROVEN_GAP: Final = 1e-12
"""Relative to the size R of two bodies that are further apart than `NEARLY_TOUCHING`: the largest difference of the
returned distance and its proven lower bound. At 0.02 mm rounding alone gives the proof, not the distance, an error of
3e-13."""

FEELER: Final = 1e-6
"""Metres. Two adjacent parts of a cover, with at most this distance, have no outer surface between them."""

HELD: Final = 1e-12
"""Metres. A mark holds a body if no point of the body is further outside it: this is the rounding of a hundred
operations on lengths of a few metres."""

STAYS_APART: Final = 1e-6
"""Relative to the longest chain of a set of spheres, at least to 1 m: by how much the bound of a distance must exceed
its threshold so that `free` can leave out the pair. Closed forms lose at most sqrt(16 epsilon) of a length (6e-8), at a
distance of zero."""

NEVER_MEETS: Final = 1e-9
"""Metres. Two bodies are proven never to meet if the bound of their distance exceeds this: far above the error of
folding and reducing a path (1e-12), so that rounding cannot prove anything."""

DEPTH: Final = 1e-13
"""Relative to the size of two bodies that overlap: the largest difference of both bounds of their depth, some hundred
roundings."""

EQUALLY_NEAR: Final = 1e-10
"""Relative to the size of two bodies that overlap: if the displacements that separate them differ by at most this, the
direction is not unique. It is a thousand times `DEPTH`, far below any length that matters."""

EXPLORER_BUDGET: Final = 20.0
"""Seconds. Default time for each region of an explorer's page, and for the certificate of its motion: if a region takes
longer, the page samples it, and says so."""

EXPLORER_SPEED: Final = 1e-12
"""Relative. The margin added to bounds of speeds in an explorer's page, for the rounding of their sums."""
