"""Steps within rows are safe all the way: attacked at the corners of what the rows allow, and against Pinocchio."""

import numpy as np
import pytest
from scipy.optimize import linprog

import pinbound as pb
from pinbound.bounds.bounds import box_terms
from pinbound.bounds.swept_bounds import all_rows, separated
from robots import joint, robot_xml

JOINTS = [
    joint("a", "revolute", "base", "l1", axis="0 0 1", xyz="0 0 0.3"),
    joint("b", "revolute", "l1", "l2", axis="0 1 0", xyz="0.1 0 0.2", rpy="0.3 0 0"),
    joint("c", "prismatic", "l2", "l3", axis="1 0 1", xyz="0 0 0.4", limit="-0.2 0.3"),
    joint("d", "continuous", "l3", "l4", axis="1 0 0", xyz="0.2 0 0"),
    joint("e", "revolute", "l4", "l5", axis="0 1 1", xyz="0.1 0.2 0", mimic="b -0.5 0.25"),
    joint("f", "revolute", "base", "m1", axis="0 1 0", xyz="0.6 0 0.2", limit="-2 2"),
]
CAPSULE = pb.Segment("upper", "l2", (0.0, 0.0, 0.0), (0.0, 0.0, 0.35), 0.04)
FORE = pb.Segment("fore", "l5", (0.0, 0.0, 0.0), (0.3, 0.0, 0.1), 0.03)
MARKS = {
    "spheres": (pb.Point("p", "m1", (0.0, 0.1, 0.3), 0.1), pb.Point("s", "l5", (0.1, 0.0, 0.1), 0.05)),
    "capsules": (pb.Segment("post", "m1", (0.0, 0.0, 0.0), (0.0, 0.1, 0.5), 0.05), FORE),
    "capsule and sphere": (CAPSULE, pb.Point("s", "l5", (-0.2, -0.2, -0.2), 0.05)),
    "floor": (pb.Plane("floor", "base", (0.0, 0.0, 0.05), (0.0, 0.0, 1.0)), FORE),
    "pole": (pb.Line("pole", "base", (0.5, 0.4, 0.0), (0.0, 0.1, 1.0), 0.05), FORE),
    "box": (pb.Sweep("box", "m1", (-0.1, -0.1, 0.2), ((0.2, 0, 0), (0, 0.2, 0), (0, 0, 0.2)), 0.01), FORE),
    "boxes": (
        pb.Sweep("box", "m1", (-0.1, -0.1, 0.2), ((0.2, 0, 0), (0, 0.2, 0), (0, 0, 0.2)), 0.01),
        pb.Sweep("hand", "l5", (0.0, 0.0, 0.0), ((0.1, 0, 0), (0, 0.1, 0), (0, 0, 0.2)), 0.0),
    ),
    "box of hulls": (
        pb.Hull("wedge", "m1", ((0.1, 0.0, 0.2), (-0.1, 0.1, 0.2), (-0.1, -0.1, 0.2), (0.0, 0.0, 0.5)), 0.02),
        pb.Cylinder("hand", "l5", (0.0, 0.0, 0.0), (0.1, 0.0, 0.2), 0.05),
    ),
    "hull over floor": (
        pb.Plane("floor", "base", (0.0, 0.0, 0.05), (0.0, 0.0, 1.0)),
        pb.Hull("hand", "l5", ((0.2, 0.0, 0.0), (0.0, 0.1, 0.0), (0.0, -0.1, 0.0), (0.1, 0.0, 0.2))),
    ),
    "stop": (pb.Point("p", "base", (0.8, 0.0, 0.2)), pb.Point("s", "m1", (0.0, 0.0, 0.2))),
}


def robot_with(kinds: list[str]) -> pb.Robot:
    marks, bounds = {}, []
    for index, kind in enumerate(kinds):
        pair = MARKS[kind]
        marks |= {mark.name: mark for mark in pair}
        bounds.append(pb.BoundaryMark(f"b{index}", pair[0].name, pair[1].name))
    return pb.load(robot_xml(JOINTS, {}, [])).with_annotations(pb.Annotations.of(marks.values(), bounds))


def corner(rows: pb.StepRows, direction: np.ndarray) -> np.ndarray:
    """Return the step that goes furthest in a direction, of all that keep the rows."""
    bounds = list(zip(-rows.step, rows.step, strict=True))
    found = linprog(-direction, rows.A if len(rows.A) else None, rows.b if len(rows.A) else None, bounds=bounds)
    assert found.status == 0, found.message
    return found.x


@pytest.mark.parametrize(
    ("kind", "size"), [(kind, size) for kind in MARKS for size in (0.05, 0.3) if "box" not in kind or size > 0.1]
)
def test_no_step_that_keeps_the_rows_meets_a_boundary(kind: str, size: float) -> None:
    robot, rng = robot_with([kind]), np.random.default_rng(1)
    bounds, B, Q = pb.StepBounds(robot), robot.boundaries, rng.uniform(-1.4, 1.4, (300, len(robot.coordinates)))
    Q = Q[B.free(Q)]
    q = Q[B.signed_clearances(Q)[:, 0].argmin()]
    target, nearest, cut = rng.uniform(-1, 1, len(q)), np.inf, 0
    for turn in range(24):
        rows = bounds.rows(q, size)
        assert not rows.blocked
        assert np.all(rows.b >= 0.0), "standing still keeps all rows"
        assert np.all(rows.step <= size)
        cut += len([name for name in rows.names if name == "b0"])
        towards = -B.signed_gradients(q)[0] if turn % 3 else target - q
        step = corner(rows, np.nan_to_num(towards) + 1e-3 * rng.uniform(-1, 1, len(q)))
        ways = q + np.linspace(0, 1, 12)[:, None] * step
        assert B.signed_clearances(ways).min() > 0.0
        assert B.free(ways).all()
        q = ways[-1]
        nearest = min(nearest, float(B.signed_clearances(q)[0]))
    assert cut > 3, "the attack must come near"
    assert nearest < 0.05


def test_the_bound_holds_at_every_step_in_the_box() -> None:
    """The inequality itself: `h(q + d) >= min over rows of (b - A d)`, less what gain and margin take."""
    rng = np.random.default_rng(2)
    for kind in MARKS:
        robot = robot_with([kind])
        bounds = pb.StepBounds(robot)
        for q in rng.uniform(-1, 1, (8, len(robot.coordinates))):
            q[2] *= 0.2
            rows = bounds.rows(q, 0.4, limits=False, gain=1.0, margin=0.0, reserve=0.0)
            if rows.blocked or not len(rows.A):
                continue
            D = rng.uniform(-1, 1, (200, len(q))) * rows.step
            low = (rows.b - D @ rows.A.T).min(axis=1)
            found = robot.boundaries.signed_clearances(q + D)[:, 0]
            assert np.all(found[low >= 0.0] > 0.0)
            if kind != "stop":  # whose rows are angles
                assert np.all(found >= low)


def test_a_row_that_is_left_out_cannot_be_broken() -> None:
    """The nearest k rows: the box shrinks until no other row counts, and never more rows come than asked for."""
    robot, rng = robot_with(["spheres", "capsules", "floor", "pole", "box"]), np.random.default_rng(3)
    bounds, B, shrunk = pb.StepBounds(robot), robot.boundaries, 0
    Q = rng.uniform(-1.4, 1.4, (400, len(robot.coordinates)))
    Q = Q[B.free(Q)]
    for q in Q[np.sort(B.signed_clearances(Q), axis=1)[:, 1].argsort()[:12]]:  # near two boundaries at once
        every = bounds.rows(q, 0.1)
        few = bounds.rows(q, 0.1, most=1)
        assert len(few.names) <= 1
        assert few.scale <= every.scale
        shrunk += few.scale < every.scale
        for direction in rng.uniform(-1, 1, (3, len(q))):
            assert B.free(q + corner(few, direction))
    assert shrunk >= 3


def test_contact_is_said_and_rows_lead_out_of_it() -> None:
    robot = robot_with(["floor"])
    down = np.array([0.0, 1.6, 0.0, 0.0, 0.0])
    at = next(robot.home + x * down for x in np.linspace(0, 1, 200) if not robot.boundaries.free(robot.home + x * down))
    rows = pb.StepBounds(robot).rows(at, 0.2)
    assert rows.blocked == ("b0",)
    assert rows.b.min() < 0.0
    assert robot.boundaries.signed_clearances(at + corner(rows, -down))[0] > 0.0


def test_steps_of_stops_and_limits_are_exact(minerva: pb.Robot) -> None:
    q = np.radians([0.0, 10.0, 35.0])
    rows = pb.StepBounds(minerva).rows(q, 1.0, gain=1.0, margin=0.0)
    room = dict(zip(rows.names, rows.b, strict=True))
    assert rows.scale == 1.0
    assert room["beta_4"] == pytest.approx(minerva.boundaries["beta_4"].contact.angle - np.radians(25.0), abs=1e-4)
    assert "q1" not in rows.names or room["q1"] > 0.0
    room = [b / a[1] for a, b in zip(rows.A, rows.b, strict=True) if a[1] < 0.0]  # the others standing still
    assert max(room) == pytest.approx(minerva.boundaries.limits("q2", q).lower - q[1], abs=1e-4)


def test_a_robot_that_stands_at_a_stop_is_not_blocked(minerva: pb.Robot) -> None:
    """It goes on towards the stop until nothing is left of the way: rounding there is no contact."""
    bounds, q = pb.StepBounds(minerva), minerva.home
    for _ in range(80):
        rows = bounds.rows(q, 0.5)
        assert not rows.blocked
        assert np.all(rows.b >= 0.0)
        q = q + corner(rows, np.array([0.0, -1.0, 0.0]))
        assert minerva.boundaries.free(q)
    assert minerva.boundaries.signed_clearances(q).min() < 1e-5
    assert pb.StepBounds(minerva).rows(np.array([0.0, -0.5, 0.0]), 0.1).blocked == ("beta_10",)


def test_mimic_joints_limits_are_rows() -> None:
    joints = [*JOINTS[:4], joint("e", "revolute", "l4", "l5", axis="0 1 1", limit="-0.1 0.1", mimic="b -0.5 0")]
    robot = pb.load(robot_xml(joints, {}, []))
    rows = pb.StepBounds(robot).rows(robot.home, 1.0)
    assert "e" in rows.names
    assert corner(rows, np.array([0.0, 1.0, 0.0, 0.0]))[1] == pytest.approx(0.2)


def test_half_spaces_hold_the_box(minerva: pb.Robot) -> None:
    rows = pb.StepBounds(minerva).rows(minerva.home, [0.1, 0.2, 0.3])
    A, b = rows.half_spaces
    assert A.shape == (len(rows.b) + 6, 3)
    assert np.all(A @ np.zeros(3) <= b)
    assert not np.all(A @ np.array([0.11, 0.0, 0.0]) <= b)


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"step": 0.0}, "positive"),
        ({"step": [0.1, 0.1]}, "3 of them"),
        ({"step": np.nan}, "positive"),
        ({"gain": 0.0}, "gain is"),
        ({"gain": 1.5}, "gain is"),
        ({"margin": -1.0}, "margin is"),
        ({"most": 0}, "most is"),
        ({"q": [np.nan, 0.0, 0.0]}, "not finite"),
    ],
)
def test_what_is_no_step_is_refused(changed: dict, said: str, minerva: pb.Robot) -> None:
    given = {"q": minerva.home, "step": 0.1} | changed
    with pytest.raises(pb.DimensionError, match=said):
        pb.StepBounds(minerva).rows(**given)


def test_the_other_vertices_of_a_face_are_paid_for() -> None:
    """A cylinder stands 10 mm above a floor: whichever way it tilts, another vertex of its rim comes down first."""
    rim = pb.Cylinder("rim", "m1", (0.0, 0.0, -0.14), (0.0, 0.0, 0.2), 0.3)
    marks = [pb.Plane("floor", "base", (0.0, 0.0, 0.05), (0.0, 0.0, 1.0)), rim]
    notes = pb.Annotations.of(marks, [pb.BoundaryMark("b", "floor", "rim")])
    robot = pb.load(robot_xml(JOINTS, {}, [])).with_annotations(notes)
    q = np.zeros(len(robot.coordinates))
    (row,) = pb.StepBounds(robot)._area_rows(q, np.full(len(q), 0.04), 0.0, 0.0, 1.0)
    D = np.random.default_rng(5).uniform(-0.04, 0.04, (400, len(q)))
    found = robot.boundaries.signed_clearances(q + D)[:, 0]
    assert found.min() < 0.002 < found.max()
    assert np.all(found >= row.value - row.loss(1.0) + D @ row.g)
    rows = pb.StepBounds(robot).rows(q, 0.04, limits=False, gain=1.0, margin=0.0, reserve=0.0)
    assert 0.5 < rows.scale < 1.0  # in this smaller box nothing can break the row
    assert robot.boundaries.signed_clearances(q + rows.scale * D).min() > 0.0


def test_of_many_boundaries_those_that_are_left_out_cannot_be_met() -> None:
    """A ball amid 40 others, all equally near: the eight that are looked at first do not keep it from the rest."""
    robot, rng = pb.load(robot_xml(JOINTS, {}, [])), np.random.default_rng(12)
    ball = pb.Point("ball", "l5", (0.0, 0.0, 0.0), 0.02)
    ways = rng.normal(size=(40, 3))
    places = robot.positions("l5", robot.home) + 0.07 * ways / np.linalg.norm(ways, axis=1)[:, None]
    others = [pb.Point(f"p{k}", "base", tuple(place.tolist()), 0.02) for k, place in enumerate(places)]
    bounds = [pb.BoundaryMark(one.name, "ball", one.name) for one in others]
    robot = robot.with_annotations(pb.Annotations.of([ball, *others], bounds))
    q, B, steps, cut = robot.home, robot.boundaries, pb.StepBounds(robot), set()
    for size in (0.03, 0.1):
        rows = steps.rows(q, size)
        for towards in -B.signed_gradients(q):
            step = corner(rows, towards)
            clearances = B.signed_clearances(q + np.linspace(0, 1, 9)[:, None] * step)
            assert clearances.min() > 0.0
            cut |= {B.names[k] for k in np.flatnonzero(clearances[-1] < 0.02)}
    assert len(cut) > 16, "the attack must come near more than are looked at first"


def test_below_the_margin_a_step_loses_less_the_nearer_it_is() -> None:
    """Sent along a ball again and again, the robot does not use up what is left of the clearance."""
    robot = robot_with(["spheres"])
    bounds, q, B = pb.StepBounds(robot), robot.home, robot.boundaries
    for _ in range(60):  # to the margin, and then around the ball
        rows, towards = bounds.rows(q, 0.3), B.signed_gradients(q)[0]
        q = q + corner(rows, np.array([0.3, 0.1, 0.0, 0.2, 0.0]) - 3.0 * towards)
        assert B.free(q)
    assert 5e-5 < B.signed_clearances(q)[0] < 2e-3


def test_bodies_are_measured_by_machine_code_as_by_the_reference() -> None:
    pytest.importorskip("numba")
    robot = robot_with([kind for kind in MARKS if kind != "stop"])
    more = [
        pb.Segment("rod", "l1", (0.0, 0.0, 0.4), (0.0, 0.2, 0.4), 0.02),
        pb.Point("knob", "l5", (0.0, 0.3, 0.1), 0.01),
    ]
    robot = robot.with_annotations(pb.Annotations.of(more, [pb.BoundaryMark("rod", "rod", "knob")]))
    bounds = pb.StepBounds(robot)
    bounds.prepare()
    assert bounds._tables is not None
    for q in np.random.default_rng(13).uniform(-1.5, 1.5, (20, len(robot.coordinates))):
        found = bounds._measured(q, np.arange(len(bounds._areas)))
        expected = robot.boundaries.signed_clearances(q)
        assert np.abs(found - expected).max() < 1e-12


def test_terms_at_one_configuration_are_those_of_boxes() -> None:
    """The rates against differences, the bends against what boxes are bounded with."""
    robot = robot_with(list(MARKS)[:-1])
    bounds, rng, step = pb.StepBounds(robot), np.random.default_rng(14), 1e-6
    half = np.full(len(robot.coordinates), 0.3)
    for q in rng.uniform(-1.2, 1.2, (3, len(robot.coordinates))):
        bounds.rows(q, half)
        for group in bounds._groups:
            which = np.arange(len(group.places))
            along, rates, bend, _ = group.at(which, q, half)
            rows = all_rows(group.bundle, which)
            many = len(rows)
            terms = box_terms(
                group.bundle.chains, group.bundle.arms, rows, np.tile(q, (many, 1)), np.tile(half, (many, 1))
            )
            assert np.allclose(2.0 * bend.ravel(), terms.second, rtol=1e-9)
            r = terms.r.T.reshape(len(which), -1, 3)
            n = separated(group.bundle, which, r)[1]
            for j in range(len(q)):
                ends = []
                for sign in (step, -step):
                    moved = np.tile(q + sign * np.eye(len(q))[j], (many, 1))
                    there = box_terms(group.bundle.chains, group.bundle.arms, rows, moved, np.tile(half, (many, 1))).r
                    ends.append(np.einsum("mci,mi->mc", there.T.reshape(len(which), -1, 3), n))
                assert np.abs(rates[:, :, j] - (ends[0] - ends[1]) / (2 * step)).max() < 1e-8
            assert np.abs(along - np.einsum("mci,mi->mc", r, n)).max() < 1e-13
