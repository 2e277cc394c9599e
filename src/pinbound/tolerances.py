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
"""Metres. Default `contact_tolerance`: two arms that should have equal lengths may differ by the rounding of
data given to 0.01 mm, two points of two coordinates each: 2 * sqrt(2) * 0.005 mm = 0.014 mm."""

BESIDE_CONDITION: Final = 1e-9
"""Radians or metres. A home that must lie beside the condition of a rule is put this far from it: beyond `LIMIT`,
within which a condition still holds, and far below what any controller resolves."""

NEAR_STOP: Final = 5e-3
"""Metres. Two points of zero threshold and one effective angle that miss each other by no more may have been meant as
a stop, which is said: data of another source or a changed length leave a few millimetres, bodies that are meant to
pass each other leave more."""

STOP_MISS: Final = 0.1
"""Relative to the shorter arm. The arms of a declared stop may miss each other by this where they align: more is no
difference of lengths but another point."""

CLOSURE: Final = 1e-6
"""Metres. Default tolerance of a closure, what the sides of its loop may differ by in all: far above rounding
(1e-16), far below any play of a real pin (1e-5). What they differ by is carried as an error of the links' places."""

CLOSURE_SHARE: Final = 1e-2
"""Relative to the length of a loop: no tolerance of a closure counts for more, or every pairing of the sides of a
loop of micrometres would be equal."""

EXACT_LOOP: Final = 2e-12
"""Relative to the length of a loop. Sides that differ by less are equal: folding six joints' constants in float64 can
make this difference (`FOLDING` * 7^2 * 2^-53 = 1.4e-12 at most, 1e-15 as a rule)."""

MJCF_FRAME: Final = 1e-6
"""Metres, and of the entries of a rotation. A body of an MJCF model and a link of the URDF whose places at zero differ
by more are not taken for one frame: a pin in it would be off by more than the tolerance of a closure."""

TOGGLE: Final = 1e-4
"""Radians, of the angle between the two arms that close a loop. So near a toggle no q is allowed: beyond it the passive
joints move 10^4 times as fast as the others, and rounding moves them by 1e-12. A crank is kept away from its own
toggle by half the square of it, 5e-9 rad, times the ratio of the loop's sides."""

FLAT: Final = 2e-3
"""Radians. A loop so near its flat pose in the pose that home gives is drawn flat: angles rounded to three decimals, or
to a tenth of a degree, come this near, and in the flat pose both assemblies of a parallelogram fit."""

DEVIATION: Final = 1e-2
"""Radians. A passive joint may be this far from the coupling, at most, where the sides of its loop differ: within a
loop that comes so near its flat pose the coupling says little about the linkage."""

PLACED: Final = 1e-9
"""Of the lengths of all offsets of a robot and the angles at home: more than rounding can be in where its links are.
Points further apart than this and what they must keep need no look at their relative path while the robot loads."""

PARALLEL: Final = 1e-3
"""Radians. Axes of successive joints this near to one direction are named in a note, if they are not of one direction:
0.06 degrees is far below what anyone would design, and far above rounding."""

XACRO_SECONDS: Final = 4.0
"""Seconds that the expansion of one xacro file may take: large public ones take 0.5 s; `${9**9**8}` takes for ever."""

XACRO_MEMORY: Final = 2 * 2**30
"""Bytes that the expansion of one xacro file may use: a hundred times what large public ones do."""

PRINTED_PI: Final = 5e-4
"""Radians. A printed angle further than this from a multiple of pi/2 does not mean it, whatever its digits: 1.571 and
3.142 do, 1.57 and 3.14 are further off."""

AGREEMENT: Final = 1e-12
"""Relative to the length of a path, and absolute for rotations: what rounding may make of a placement in Pinocchio and
here, a few operations of 1e-16 a joint over up to some hundred joints."""

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

REDUCTION_ROUNDOFFS: Final = 192
"""Unit roundoffs, rounded up: `REDUCTION` = 90 of them, taken for zero in an angle's coefficient, at most twice a joint
(as an entry, and as a difference of two angles that are taken for one)."""

REDUCTION_SLIDES: Final = 512
"""Unit roundoffs, rounded up: the vector of three slides of `REDUCTION` (156) that leaves the chain, or (312) the head
of the chain. Metres per unit of a coordinate, whatever the length of the path."""

EVALUATION: Final = 32
"""Unit roundoffs per rotation, relative to the length of a path: two sines, one turn, one sum, one root."""

CONVERSION: Final = 64
"""Unit roundoffs per degree and one, relative to the sum of the sizes of its terms: what a change of a spline's basis
can have changed, from the differences of its breakpoints to the last sum (`docs/certificates.md`)."""

SAMPLE_ROUNDOFFS: Final = 1000
"""Unit roundoffs, relative to 1 and the size of a value: what a caller's function of time may lose by its own
rounding before its values count as a contradiction of its bounds."""

FARTHEST: Final = 1e100
"""Radians or metres. A motion or box beyond it is refused: squares of squares of it would overflow float64."""

INFLATION: Final = 1.0 + 1e-12
"""Factor on every lever arm and every remainder: far above the rounding of the sums that make them (1e-14)."""

LIMIT: Final = 1e-12
"""Radians or metres. A motion exceeds a joint limit if it passes it by more: degrees converted to radians, and sums
along a spline, end up this close on either side."""

LARGEST_BODY: Final = 1e9
"""Metres. A longer body, or one further from its link, is a fault of the file: no robot is so large, and sums of
squares of such lengths stay far from overflow."""

PRECISION: Final = 1e-6
"""Metres. Default width of the bounds of a motion's smallest clearance: a tenth of the rounding of 0.01 mm data."""

FIRST_CONTACT: Final = 1e-9
"""Relative to the duration of a motion: the width to which the first contact is bracketed."""

FOLLOWS: Final = 1e-4
"""Radians or metres. A recorded follower follows if it is this near: encoders resolve 1e-5, backlash is far more."""

COUPLED: Final = 1e-6
"""Radians or metres. A mimic joint of a user's own model must be this near to where its primary puts it: a million
steps of integration leave 1e-9, a model that does not know the coupling leaves more at once."""

SAME_ROBOT: Final = 1e-9
"""Metres a metre of the robot's size, and absolute for rotations: how far a user's model may place a link elsewhere.
Angles that are printed to 11 digits and read as pi leave 1e-11."""

UNIT_CIRCLE: Final = 1e-6
"""Of `cos^2 + sin^2 - 1` of a continuous joint: integration leaves 1e-9, two numbers that are no angle leave more."""

TABLE: Final = 1e-9
"""Radians. Entries of tables of coupled limits stay this far inside the limits: printing and a reader's interpolation
round by less (1e-14)."""

STEP_BOX: Final = 1.0 + 1e-3
"""Factor on the box of a step in proofs: solvers of quadratic programs pass its sides by their tolerance, 1e-6 m."""

STEP_LIMIT: Final = 1e-3
"""Radians or metres. How far a step may pass a joint limit, in proofs of its rows: what a solver leaves of that row."""

STEP_SEARCH: Final = 1e-6
"""Metres. What is added to the reach of a step before a boundary is left out of its rows: a search for nearest points
may end early at slivers that touch, and be off by 3e-7 m (docs/hulls.md)."""

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

AS_PRINTED: Final = 1e-6
"""Millimetres. A marked point is where the paper prints it if it is this near: the print has two decimals."""

SOLVES: Final = 1e-12
"""Metres. A printed limit solves its component equation if it leaves less: rounding in arms of 0.1 m leaves 1e-16, a
wrong quadrant millimetres."""
REGION_ACCURACY: Final = 1e-5
"""Radians or metres, or the same share of a window narrower than one. Default chord error of a traced contact curve: a
sixth of the least step of a 16-bit encoder (9.6e-5 rad)."""

REGION_BUDGET: Final = 120.0
"""Seconds. Default time after which tracing or insetting a region ends in an error that says what is left."""

REGION_WIDTH: Final = 2e-3
"""Radians or metres, or the same share of a window narrower than one. Default side of the cells that enclose a contact
curve that is searched for: twenty steps of a 16-bit encoder, some ten thousand cells a curve."""

WIDEST_WINDOW: Final = 1e6
"""Radians or metres. A limit further out than this counts as none in a region: a float64 knows an angle of 1e6 rad to
1e-10 rad only, and SDF writes 1e16 where there is no limit."""

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

KERNEL_SIGN: Final = 3.6e-15
"""Relative to the length of a path, once for each of its angles and each radian of them: how near to zero a result of
the batch kernel, and of the reference interpreter, may have the wrong sign (16 machine epsilons)."""

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

EXTREME: Final = 2e-15
"""Relative to a hull's furthest vertex: a point this near to the hull of others, to their plane or to their line is on
it, as far as the rounding of its own coordinates can tell (16 unit roundoffs, rounded up)."""

OVERLAP: Final = 1e-14
"""Relative to the length of a path: boxes or prisms that are nearer than this overlap, as far as rounding can tell."""

NEARLY_TOUCHING: Final = 1e-9
"""Relative to the size of two bodies: nearer than this, float64 may mistake which of their features are the nearest."""

PROVEN_GAP: Final = 1e-12
"""Relative to the size R of two bodies that are further apart than `NEARLY_TOUCHING`: their distance is proven to be at
most this below what is returned. At 0.02 mm rounding alone makes the proof, not the distance, wrong by 3e-13."""

FEELER: Final = 1e-6
"""Metres. Two parts of a cover that lie next to each other, or this far apart, have no outer surface between them."""

HELD: Final = 1e-12
"""Metres. A mark holds a body if no point of the body is further than this outside it: what rounding adds to a hundred
operations on lengths of a few metres, and no more."""

STAYS_APART: Final = 1e-6
"""Relative to the longest chain of a set of spheres, at least to 1 m: by how much a bound of a distance must be above
its threshold for `free` to leave the pair out. Closed forms lose sqrt(16 epsilon) of a length at most (6e-8), where a
distance is zero."""

NEVER_MEETS: Final = 1e-9
"""Metres. Two bodies are proven never to meet if the bound of their distance is larger than this: far above what
folding and reducing a path can have changed (1e-12), so that rounding cannot prove anything."""

DEPTH: Final = 1e-13
"""Relative to the size of two bodies that overlap: both bounds of their depth differ by no more, which is some hundred
roundings."""

EQUALLY_NEAR: Final = 1e-10
"""Relative to the size of two bodies that overlap: where two ways out differ by no more, neither is the only one. It is
a thousand times `DEPTH`, far below any length that matters."""

EXPLORER_BUDGET: Final = 20.0
"""Seconds. Default time for each region of an explorer's page, and for its motion's certificate: the page samples a
region that takes longer, and says so."""

EXPLORER_SPEED: Final = 1e-12
"""Relative. What bounds of speeds are raised by in an explorer's page, for the rounding of their sums."""
