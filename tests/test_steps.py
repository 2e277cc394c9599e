"""Steps within rows are safe all the way: attacked at the corners of what the rows allow, and against Pinocchio."""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
from scipy.optimize import linprog

import pinbound as pb
from pinbound.adapters.step_terms import StepRowTerms, StepTerms
from pinbound.annotations.marks import Mark
from pinbound.bounds.bounds import box_terms
from pinbound.bounds.swept_bounds import all_rows, separated
from pinbound.tolerances import STEP_LIMIT
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
        ({"q": [0.0, -np.inf, 0.0]}, "not finite"),
        ({"q": [0.0, 1e200, 0.0]}, "beyond 1e\\+100"),
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
    bounds = pb.StepBounds(robot)
    bounds.rows(q, 0.04)
    row = bounds._area_rows(q, np.full(len(q), 0.04), 0.0, 0.0, 1.0)
    assert len(row.value) == 1
    D = np.random.default_rng(5).uniform(-0.04, 0.04, (400, len(q)))
    found = robot.boundaries.signed_clearances(q + D)[:, 0]
    assert found.min() < 0.002 < found.max()
    assert np.all(found >= row.value - row.loss(1.0) + D @ row.g[0])
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
        terms = prepared(bounds, q, half)
        which = np.arange(len(bounds._areas))
        along, rates, bend, _, _ = terms.at(which, q, half)
        bundle, rows = terms.bundle, all_rows(terms.bundle, which)
        many = len(rows)
        boxes = box_terms(bundle.chains, bundle.arms, rows, np.tile(q, (many, 1)), np.tile(half, (many, 1)))
        assert boxes.second is not None
        assert np.allclose(2.0 * bend, boxes.second[:: bundle.rows], rtol=1e-9)
        r = boxes.r.T.reshape(len(which), -1, 3)
        n = separated(bundle, which, r)[1]
        for j in range(len(q)):
            ends = []
            for sign in (step, -step):
                moved = np.tile(q + sign * np.eye(len(q))[j], (many, 1))
                there = box_terms(bundle.chains, bundle.arms, rows, moved, np.tile(half, (many, 1))).r
                ends.append(np.einsum("mci,mi->mc", there.T.reshape(len(which), -1, 3), n))
            assert np.abs(rates[:, :, j] - (ends[0] - ends[1]) / (2 * step)).max() < 1e-8
        assert np.abs(along - np.einsum("mci,mi->mc", r, n)).max() < 1e-13


def prepared(bounds: pb.StepBounds, q: np.ndarray, half: np.ndarray) -> StepTerms:
    bounds.rows(q, half)
    assert bounds._terms is not None
    return bounds._terms


def random_arm(rng: np.random.Generator) -> pb.Robot:
    """Return an arm of 3 to 6 joints, some of which slide or are mimicked, with marks of every kind on its links."""

    def triple(low: float, high: float) -> tuple[float, float, float]:
        x, y, z = rng.uniform(low, high, 3).tolist()
        return x, y, z

    def words(numbers: tuple[float, float, float]) -> str:
        return " ".join(map(str, numbers))

    joints, count = [], int(rng.integers(3, 7))
    for k in range(count):
        kind = "prismatic" if rng.random() < 0.25 else "revolute"
        options = {"xyz": words(triple(-0.3, 0.3)), "rpy": words(triple(-1, 1)), "axis": words(triple(-1, 1))}
        mimic = {"mimic": f"j{k - 1} {rng.uniform(-1, 1)} 0.1"} if k and rng.random() < 0.2 else {}
        joints.append(joint(f"j{k}", kind, f"l{k}", f"l{k + 1}", limit="-0.3 0.3", **options, **mimic))
    text = robot_xml(joints, {}, []).replace('"base"', '"l0"')

    def mark(name: str, link: str, kind: int) -> Mark:
        at = triple(-0.3, 0.3)
        edges = tuple(triple(-0.2, 0.2) for _ in range(4))
        if kind == 0:
            return pb.Point(name, link, at, 0.02)
        if kind == 1:
            return pb.Segment(name, link, at, triple(-0.3, 0.3), 0.02)
        if kind == 2:
            return pb.Hull(name, link, tuple(triple(-0.2, 0.2) for _ in range(int(rng.integers(4, 12)))), 0.01)
        if kind == 3:
            return pb.Sweep(name, link, at, edges[: int(rng.integers(2, 5))])
        return pb.Plane(name, link, at, triple(-1, 1)) if kind == 4 else pb.Line(name, link, at, triple(-1, 1), 0.02)

    marks, bounds = list[Mark](), list[pb.BoundaryMark]()
    for k in range(8):
        first, last = 0, int(rng.integers(2, count + 1))
        if rng.random() < 0.5:
            first = int(rng.integers(0, last - 1))
        pair = mark(f"a{k}", f"l{first}", int(rng.integers(0, 6))), mark(f"b{k}", f"l{last}", int(rng.integers(0, 4)))
        marks += pair
        bounds.append(pb.BoundaryMark(f"p{k}", pair[0].name, pair[1].name))
    robot = pb.load(text)
    while True:
        try:
            return robot.with_annotations(pb.Annotations.of(marks, bounds))
        except pb.InputError as error:  # home must be free of them
            said = " ".join(problem.message for problem in error.problems)
            assert "home is outside the feasible region" in said
            bounds = [one for one in bounds if f"{one.name!r}" not in said]


@cache
def random_arms() -> tuple[pb.Robot, ...]:
    rng = np.random.default_rng(21)
    return tuple(random_arm(rng) for _ in range(6))


def test_on_random_robots_no_step_in_the_box_comes_nearer_than_the_rows_say() -> None:
    """`h(q + d) >= min over rows of (value + g . d - loss - bend)`, for every d, whichever code made the rows."""
    rng, asked, close = np.random.default_rng(22), 0, 0
    for robot in random_arms():
        bounds, B = pb.StepBounds(robot), robot.boundaries
        assert not bounds.stops
        bounds.prepare()
        n, which = len(robot.coordinates), np.arange(len(B))
        for size in (0.3, 0.05, 1e-3):
            q, half = rng.uniform(-0.3, 0.3, n), size * rng.uniform(0.1, 1.0, n)
            D = rng.uniform(-1, 1, (60, n)) * half
            D[:30] = np.sign(D[:30]) * half  # corners
            there, terms = B.signed_clearances(q + D), prepared(bounds, q, half)
            for found in (terms.rows(which, q, half), terms.rows_in_numpy(which, q, half)):
                assert set(found.places.tolist()) == set(which.tolist())
                low = found.value - found.loss - found.bend + D @ found.g.T
                for place in which:
                    bound = low[:, found.places == place].min(axis=1) - bounds._distances[place]
                    assert np.all(there[:, place] >= bound)
                    asked += 1
                    close += int(np.min(there[:, place] - bound) < size * size)
    assert asked > 200
    assert close > 0.7 * asked, "the rows must be near what they bound"


def test_rows_in_machine_code_are_those_of_numpy() -> None:
    """Of parallel faces, either code may take other places as the nearest; values and bends are the same."""
    pytest.importorskip("numba")
    rng, asked, same = np.random.default_rng(23), 0, 0
    for robot in random_arms():
        bounds = pb.StepBounds(robot)
        bounds.prepare()
        which = np.arange(len(bounds._areas))
        q, half = rng.uniform(-0.3, 0.3, len(robot.coordinates)), np.full(len(robot.coordinates), 0.1)
        terms = prepared(bounds, q, half)
        assert terms.tables is not None
        found, known = terms.rows(which, q, half), terms.rows_in_numpy(which, q, half)
        assert np.array_equal(found.places, known.places)
        for row in np.flatnonzero(known.value > 1e-6):  # in contact there is no direction
            asked += 1
            assert found.value[row] == pytest.approx(known.value[row], abs=1e-7)
            assert found.bend[row] == pytest.approx(known.bend[row], rel=1e-9)
            differs = abs(found.loss[row] - known.loss[row]) + np.abs(found.g[row] - known.g[row]).max()
            same += bool(differs < 1e-6)
    assert asked > 20
    assert same > 0.98 * asked


def test_a_pair_of_which_nothing_is_known_is_blocked() -> None:
    """Numbers that are not finite, from whichever code, must not read as far away."""
    robot = robot_with(["capsules"])
    bounds = pb.StepBounds(robot)
    terms = prepared(bounds, robot.home, np.full(5, 0.1))
    for field in ("value", "g", "loss", "bend"):
        for number in (np.nan, np.inf, -np.inf):
            good = terms.rows_in_numpy(np.arange(1), robot.home, np.full(5, 0.1))
            bad = np.full_like(getattr(good, field), number)
            broken = replace(good, **{field: bad})
            bounds._terms = Fixed(broken)  # type: ignore[assignment]
            bounds._known[:] = np.nan
            bounds._moved, bounds._slack = np.full((1, 5), 100.0), np.zeros(1)
            rows = bounds.rows(robot.home, 0.1)
            assert rows.blocked == ("b0",)
            assert np.all(np.isfinite(rows.A))
            assert any(np.all(a == 0.0) and b < 0.0 for a, b in zip(rows.A, rows.b, strict=True))


@dataclass
class Fixed:
    """Rows that do not depend on what is asked."""

    found: StepRowTerms

    def rows(self, which: np.ndarray, q: np.ndarray, half: np.ndarray) -> StepRowTerms:
        return self.found


def test_a_finger_does_not_lengthen_the_arm_beyond_its_limits() -> None:
    """Lever arms hold where joint limits are kept, as their rows see to; without these, wherever a step may lead."""
    joints = [
        joint("a", "revolute", "base", "l1", axis="0 0 1"),
        joint("b", "prismatic", "l1", "l2", axis="1 0 0", xyz="0.3 0 0", limit="0 0.04"),
        joint("c", "revolute", "l2", "l3", axis="0 0 1"),
    ]
    marks = [pb.Point("tip", "l3", (0.1, 0.0, 0.0), 0.01), pb.Point("post", "base", (0.3, 0.6, 0.0), 0.01)]
    notes = pb.Annotations.of(marks, [pb.BoundaryMark("p", "tip", "post")])
    robot = pb.load(robot_xml(joints, {}, [])).with_annotations(notes)
    q, half = np.array([0.0, 0.02, 0.0]), np.array([0.5, 0.5, 0.5])
    bounds = pb.StepBounds(robot)
    bend = prepared(bounds, q, half).rows(np.arange(1), q, half).bend[0]
    post = np.hypot(0.3, 0.6)  # seen from the tip the wrist turns all that lies beyond it, the shoulder the post alone

    def expected(slid: float, turned: float) -> float:
        arms = (0.3 + slid + STEP_LIMIT + post) * turned**2 + post * ((2.0 * turned) ** 2 - turned**2)
        return 0.5 * (arms + 2.0 * turned * turned)

    assert bend == pytest.approx(expected(0.04, 0.5), rel=1e-9)
    bounds.rows(q, half, limits=False)
    assert bounds._terms is not None
    assert bounds._terms.rows(np.arange(1), q, half).bend[0] > bend + 0.05
    outside = np.array([0.0, 0.4, 0.0])  # put there by hand: rows lead back, and bounds hold from there
    bounds, half = pb.StepBounds(robot), np.full(3, 0.1)
    bend = prepared(bounds, outside, half).rows(np.arange(1), outside, half).bend[0]
    assert bend == pytest.approx(expected(0.4, 0.1), rel=1e-9)
    rows = bounds.rows(outside, half)
    assert "b" in rows.blocked
    for d in np.random.default_rng(3).uniform(-1, 1, (200, 3)) * rows.step:
        if np.all(rows.A[[name == "p" for name in rows.names]] @ d <= 0.0):
            assert robot.boundaries.signed_clearances(outside + d)[0] > 0.0
