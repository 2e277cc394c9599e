"""Certificates of motions and boxes: no false CERTIFIED, no VIOLATED without a witness, bounds that hold."""

from pathlib import Path

import coal
import numpy as np
import pytest
from scipy import interpolate, optimize

import pinbound as pb
from mechanisms import random_robot, sidecar, write
from pinbound.certificates import Reason
from pinbound.robot.robot import Robot

ARM = """<robot name="arm"><link name="base"/><link name="upper"/><link name="fore"/>
<joint name="a" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
<limit lower="-20" upper="20" effort="1" velocity="1"/></joint>
<joint name="b" type="revolute"><parent link="upper"/><child link="fore"/><origin xyz="0 0 0.3"/><axis xyz="0 1 0"/>
<limit lower="-20" upper="20" effort="1" velocity="1"/></joint></robot>"""


def arm(folder: Path, radius: float, urdf: str = ARM) -> Robot:
    """Return a planar arm whose tip must stay `radius` away from a point at the base: two effective angles."""
    points = [("tip", "fore", np.array([0.0, 0.0, 0.25]), radius), ("post", "base", np.array([0.2, 0.0, 0.1]), 0.0)]
    return pb.load(write(folder, urdf, sidecar(points, [("tip", "post", 0.0)], {})))


def hinge(folder: Path, radius: float, tolerance: float = 2e-5) -> Robot:
    """Return two arms of one length at one pivot: one effective angle, contact at q = pi (mod 2 pi), or near it."""
    urdf = ARM.replace("upper=", "upper=").replace('<link name="fore"/>', "")
    urdf = urdf[: urdf.index('<joint name="b"')] + "</robot>"
    points = [("p", "upper", np.array([0.0, 0.0, 0.2]), radius), ("s", "base", np.array([0.0, 0.0, -0.2]), 0.0)]
    marks = f"contact_tolerance: {tolerance!r}\n" + sidecar(points, [("p", "s", 0.0)], {})
    return pb.load(write(folder, urdf, marks))


def dense(robot: Robot, waypoints: np.ndarray, count: int = 4001) -> np.ndarray:
    u = np.linspace(0, len(waypoints) - 1, count)
    columns = [np.interp(u, np.arange(len(waypoints)), waypoints[:, j]) for j in range(waypoints.shape[1])]
    return np.stack(columns, axis=1)


def closest(robot: Robot, start: np.ndarray, end: np.ndarray) -> tuple[float, float]:
    """Return the smallest norm on a segment, and where, to rounding."""
    norm = lambda u: float(robot.boundaries[0].norm(start + u * (end - start)))  # noqa: E731
    grid = np.linspace(0, 1, 2001)
    best = grid[int(np.argmin([norm(u) for u in grid]))]
    found = optimize.minimize_scalar(
        norm, bounds=(best - 1e-3, best + 1e-3), method="bounded", options={"xatol": 1e-14}
    )
    return float(found.fun), float(found.x)


START, END = np.array([0.2, 0.4]), np.array([0.5, 2.6])


@pytest.mark.parametrize(
    ("depth", "verdict"), [(-1e-6, "certified"), (1e-6, "violated"), (1e-9, "violated"), (-1e-9, "certified")]
)
def test_waypoints_clear_but_not_between(tmp_path: Path, depth: float, verdict: str) -> None:
    least, where = closest(arm(tmp_path, 0.01), START, END)
    robot = arm(tmp_path, least + depth)
    assert 0.05 < where < 0.95
    assert robot.boundaries.clearances(np.array([START, END])).min() > 1e-3
    found = pb.certify(robot, [START, END])
    assert found.verdict.value == verdict
    assert found.lower <= -depth <= found.upper
    assert found.upper - found.lower <= 1e-6
    if depth > 0:
        contact = found.first_contact
        assert robot.boundaries[0].clearance(contact.q) < 0.0
        width = 1e-9 if depth > 1e-8 else 3e-8  # so slow a crossing takes longer than 1e-9 within rounding errors
        assert 0.0 <= contact.after - contact.before <= width
        assert contact.before < where


def test_grazing_at_exactly_the_threshold_is_undecided_and_cheap(tmp_path: Path) -> None:
    least, where = closest(arm(tmp_path, 0.01), START, END)
    found = pb.certify(arm(tmp_path, least), [START, END])
    assert found.verdict is pb.Verdict.UNDECIDED
    assert {part.reason for part in found.open_parts} == {Reason.ROUNDING}
    assert all(part.start <= where + 1e-6 and part.end >= where - 1e-6 for part in found.open_parts)
    assert found.boxes < 1000


def test_short_violations(tmp_path: Path) -> None:
    least, where = closest(arm(tmp_path, 0.01), START, END)
    robot = arm(tmp_path, least + 1e-6)
    lead_in = START + np.array([0.0, 0.05])
    times = [0.0, 1.0, 1.0 + 1e-8, 2.0]  # the segment that touches takes 5e-9 of the duration
    found = pb.certify(robot, [lead_in, START, END, END], times)
    assert found.verdict is pb.Verdict.VIOLATED
    contact = found.first_contact
    assert 1.0 < contact.after < 1.0 + 1e-8 * where
    assert contact.after - contact.before <= 2e-9
    assert robot.boundaries[0].clearance(contact.q) < 0.0


def test_thin_strip_of_one_angle(tmp_path: Path) -> None:
    robot = hinge(tmp_path, 1e-8, tolerance=0.0)  # half-width 5e-8 rad, of a motion over 6 rad
    assert robot.boundaries[0].contact.half_width == pytest.approx(5e-8, rel=1e-6)
    found = pb.certify(robot, [[-0.1], [6.0]])
    assert found.verdict is pb.Verdict.VIOLATED
    contact = found.first_contact
    assert robot.boundaries[0].clearance(contact.q) < 0.0
    q_of_contact = -0.1 + 6.1 * contact.after
    assert q_of_contact == pytest.approx(np.pi, abs=1e-7)
    assert pb.certify(robot, [[-0.1], [np.pi - 6e-8]]).verdict is pb.Verdict.CERTIFIED


def test_contact_lines_are_crossed_not_sampled(tmp_path: Path) -> None:
    robot = hinge(tmp_path, 0.0)
    assert robot.boundaries[0].contact.half_width == 0.0
    assert pb.certify(robot, [[0.0], [np.pi - 1e-9]]).verdict is pb.Verdict.CERTIFIED
    crossing = pb.certify(robot, [[0.0], [4.0]])
    assert crossing.verdict is pb.Verdict.VIOLATED
    assert crossing.first_contact.before <= np.pi / 4 <= crossing.first_contact.after
    assert pb.signed_clearances(robot, crossing.first_contact.q)[0] < 0.0
    touching = pb.certify(robot, [[0.0], [np.pi], [0.0]])
    assert touching.verdict is pb.Verdict.UNDECIDED
    assert -1e-11 < touching.lower <= 0.0


def test_contact_lines_are_bracketed_though_the_norm_is_flat_there() -> None:
    robot = pb.load("minervabot_v3")
    ends = np.radians([[0.0, 40.0, 20.0], [0.0, 60.0, 75.0]])
    found = pb.certify(robot, interpolate.CubicSpline([0.0, 1.0, 2.0], [*ends, ends[0]], bc_type="clamped"))
    assert {finding.name for finding in found.violations} == {"beta_3", "beta_6"}
    for finding in found.violations:
        angle = robot.boundaries[finding.name].contact.angle
        assert finding.contact.after - finding.contact.before <= 2e-9
        assert finding.contact.q[2] == pytest.approx(angle, abs=1e-7)
        assert finding.contact.q[2] > angle


def test_the_far_side_of_a_line_is_not_safe(tmp_path: Path) -> None:
    robot = hinge(tmp_path, 0.0)
    for value in (4.0, -4.0, 4.0 + 2 * np.pi):
        beyond = pb.certify(robot, [[value], [value + 0.1]])
        assert beyond.verdict is pb.Verdict.VIOLATED
        assert beyond.first_contact.before == beyond.first_contact.after == 0.0


def test_contacts_repeat_every_turn_and_angles_are_not_wrapped(tmp_path: Path) -> None:
    robot = hinge(tmp_path, 0.02)
    half = robot.boundaries[0].contact.half_width
    for turn in (-2, 0, 1):
        gap = np.pi * (2 * turn - 1) + half, np.pi * (2 * turn + 1) - half
        inside = [[gap[0] + 1e-9], [gap[1] - 1e-9]]
        found = pb.certify(robot, inside)
        assert found.verdict is pb.Verdict.CERTIFIED
        assert any("not reachable" in note for note in found.notes) == (turn != 0)
        assert pb.certify(robot, [inside[0], [gap[1] + 1e-9]]).verdict is pb.Verdict.VIOLATED
    assert pb.certify(robot, [[np.pi - 0.2], [-np.pi + 0.2]]).verdict is pb.Verdict.CERTIFIED
    assert pb.certify(robot, [[np.pi - 0.2], [np.pi + 0.2]]).verdict is pb.Verdict.VIOLATED


def test_motionless_and_single_waypoints(tmp_path: Path) -> None:
    least, where = closest(arm(tmp_path, 0.01), START, END)
    robot = arm(tmp_path, least + 1e-6)
    inside = START + where * (END - START)
    for waypoints in ([START], [START, START], [START, START, START]):
        found = pb.certify(robot, waypoints)
        assert found.verdict is pb.Verdict.CERTIFIED
        assert found.lower <= robot.boundaries[0].clearance(START) <= found.upper
    for waypoints in ([inside], [inside, inside], [START, inside, inside]):
        found = pb.certify(robot, waypoints)
        assert found.verdict is pb.Verdict.VIOLATED
        assert robot.boundaries[0].clearance(found.first_contact.q) < 0.0
    one = pb.certify(robot, inside)
    assert (one.start, one.end, one.first_contact.before, one.first_contact.after) == (0.0, 0.0, 0.0, 0.0)


def test_several_angles_and_no_threshold_need_the_tolerance(tmp_path: Path) -> None:
    robot = arm(tmp_path, 0.0)
    reach = [q for q in np.random.default_rng(0).uniform(-3, 3, (2000, 2)) if robot.boundaries[0].norm(q) < 0.02]
    at_contact = optimize.least_squares(lambda q: robot.boundaries[0].vector(q)[[0, 2]], reach[0], xtol=1e-15).x
    aside = at_contact + np.array([0.3, 0.1])
    found = pb.certify(robot, [aside, at_contact, aside])
    assert found.verdict is pb.Verdict.VIOLATED
    assert robot.boundaries[0].norm(found.first_contact.q) < robot.boundaries[0].contact_tolerance
    assert found.first_contact.clearance < 0.0


@pytest.mark.parametrize("seed", range(4))
def test_random_motions_against_dense_sampling(tmp_path: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    verdicts = set()
    for k in range(14):
        robot = random_robot(rng, tmp_path, ["planar", "spatial"][k % 2], k % 5 == 4)
        if robot is None:
            continue
        for m in range(8):
            size = 10 ** rng.uniform(-2, 0.3)
            steps = rng.normal(0, size, (int(rng.integers(1, 6)), len(robot.coordinates)))
            waypoints = robot.home + np.cumsum(steps, axis=0)
            found = pb.certify(robot, waypoints, each=bool(m % 2))
            verdicts.add(found.verdict)
            _check(robot, found, dense(robot, waypoints) if len(waypoints) > 1 else waypoints, bool(m % 2))
    assert verdicts >= {pb.Verdict.CERTIFIED, pb.Verdict.VIOLATED}


def _check(robot: Robot, found: pb.Certificate, samples: np.ndarray, each: bool) -> None:
    thresholds = np.array([boundary.threshold for boundary in robot.boundaries])
    least = (np.linalg.norm(robot.boundaries.vectors(samples), axis=2) - thresholds).min(axis=0)
    assert found.lower <= found.upper
    assert found.upper <= least.min() + 1.01e-6
    for boundary, finding, sampled in zip(robot.boundaries, found.boundaries, least, strict=True):
        assert finding.lower <= sampled
        if finding.verdict is pb.Verdict.CERTIFIED:
            assert sampled > 0.0
        if finding.contact:
            assert boundary.clearance(finding.contact.q) < 0.0
            assert finding.contact.after - finding.contact.before <= 1e-9 * (found.end - found.start)
        if each and finding.verdict is not pb.Verdict.UNDECIDED:
            assert finding.upper - finding.lower <= 1.01e-6
            assert boundary.clearance(finding.q) == pytest.approx(finding.upper, abs=1e-9)
    if found.verdict is pb.Verdict.CERTIFIED:
        assert not found.violations
        assert all(finding.verdict is pb.Verdict.CERTIFIED for finding in (*found.boundaries, *found.limits))


def test_contact_time_is_where_clearance_changes_sign(tmp_path: Path) -> None:
    least, _ = closest(arm(tmp_path, 0.01), START, END)
    robot = arm(tmp_path, least + 0.02)
    contact = pb.certify(robot, [START, END]).first_contact
    clearance = lambda u: float(robot.boundaries[0].clearance(START + u * (END - START)))  # noqa: E731
    root = optimize.brentq(clearance, 0.0, contact.after + 1e-3, xtol=1e-15)
    assert contact.before <= root <= contact.after


def _spline_cases(rng: np.random.Generator, start: np.ndarray) -> list:
    times = np.sort(rng.uniform(0, 5, 6))
    points = start + np.cumsum(rng.normal(0, 0.4, (6, len(start))), axis=0)
    cubic = interpolate.CubicSpline(times, points)
    b_spline = interpolate.make_interp_spline(times, points, k=3)
    quintic = interpolate.BPoly.from_derivatives(times, np.stack([points, 0.3 * points, 0 * points], axis=1))
    still = interpolate.PPoly(np.repeat(points[None, :1], 5, axis=1), times)
    return [cubic, b_spline, quintic, still]


@pytest.mark.parametrize("seed", range(3))
def test_splines_against_dense_sampling(tmp_path: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    verdicts = set()
    for k in range(6):
        robot = random_robot(rng, tmp_path, ["planar", "spatial"][k % 2], k % 3 == 2)
        if robot is None:
            continue
        for spline in _spline_cases(rng, robot.home):
            knots = spline.t if hasattr(spline, "t") else spline.x
            times = np.linspace(knots[0], np.nextafter(knots[-1], knots[0]), 4001)
            found = pb.certify(robot, spline, each=True)
            verdicts.add(found.verdict)
            _check(robot, found, spline(times), True)
            if found.first_contact:
                np.testing.assert_allclose(spline(found.first_contact.after), found.first_contact.q, atol=1e-12)
    assert verdicts >= {pb.Verdict.CERTIFIED, pb.Verdict.VIOLATED}


def test_spline_between_clear_waypoints_overshoots(tmp_path: Path) -> None:
    least, _ = closest(arm(tmp_path, 0.01), START, END)
    robot = arm(tmp_path, least + 1e-6)
    waypoints = np.array([END + 0.5, START - 0.2, END, START])
    spline = interpolate.CubicSpline([0, 1, 2, 3], waypoints)
    assert robot.boundaries.clearances(waypoints).min() > 1e-3
    found = pb.certify(robot, spline)
    sampled = robot.boundaries.clearances(spline(np.linspace(0, 3, 20001))).min()
    assert found.lower <= sampled
    assert (sampled > 0) == (found.verdict is pb.Verdict.CERTIFIED)


@pytest.mark.parametrize("second", [False, True])
def test_functions_with_bounds_of_their_derivatives(tmp_path: Path, second: bool) -> None:
    least, _ = closest(arm(tmp_path, 0.01), START, END)
    middle, half = (START + END) / 2, (END - START) / 2

    def swing(t: np.ndarray, order: int = 0) -> np.ndarray:
        return middle + np.outer(np.sin(t), half) if order == 0 else np.outer(np.cos(t), half)

    bound = np.abs(half)
    for depth, verdict in ((-1e-4, "certified"), (1e-4, "violated")):
        robot = arm(tmp_path, least + depth)
        motion = pb.BoundedMotion(swing, -1.5, 7.0, bound, bound if second else None)
        found = pb.certify(robot, motion, precision=1e-5)
        assert found.verdict.value == verdict
        assert found.lower <= -depth <= found.upper
        if second:
            assert found.boxes < 2000
    with pytest.raises(pb.DimensionError, match="true bound"):
        pb.certify(robot, pb.BoundedMotion(swing, -1.5, 7.0, bound * 0.9))
    with pytest.raises(pb.UnsupportedError, match="BoundedMotion"):
        pb.certify(robot, swing)


def test_limits_of_followers_bind(tmp_path: Path) -> None:
    follower = ARM.replace(
        '<limit lower="-20" upper="20" effort="1" velocity="1"/></joint></robot>',
        '<mimic joint="a" multiplier="-2" offset="0.1"/>'
        '<limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>',
    )
    robot = pb.load(write(tmp_path, follower))
    assert pb.certify(robot, [[-0.45], [0.55]], limits_only=True).verdict is pb.Verdict.CERTIFIED
    found = pb.certify(robot, [[0.0], [0.56]])
    assert found.verdict is pb.Verdict.VIOLATED
    assert found.violations[0].name == "b lower"
    assert found.first_contact.after == pytest.approx(0.55 / 0.56, abs=1e-8)
    assert found.first_contact.clearance < 0.0
    assert pb.certify(robot, [[0.0], [0.56]], limits=False).verdict is pb.Verdict.NOTHING_TO_CHECK


def test_a_motion_may_end_at_a_limit(tmp_path: Path) -> None:
    robot = arm(tmp_path, 0.01)
    for value, verdict in ((20.0, "certified"), (20.0 + 1e-9, "violated")):
        found = pb.certify(robot, [[0.0, -1.0], [0.0, value]], limits_only=True)
        assert found.verdict.value == verdict
    spline = interpolate.CubicSpline([0, 1, 2], [[0, 0], [0, 10], [0, 20]], bc_type="natural")
    assert pb.certify(robot, spline, limits_only=True).verdict is pb.Verdict.CERTIFIED
    assert pb.certify(robot, spline, boundaries=[]).verdict is pb.Verdict.NOTHING_TO_CHECK


def test_budget_ends_in_undecided_with_what_is_left(tmp_path: Path) -> None:
    least, _ = closest(arm(tmp_path, 0.01), START, END)
    robot = arm(tmp_path, least - 1e-6)
    waypoints = np.array([START, END, START, END])
    assert pb.certify(robot, waypoints).verdict is pb.Verdict.CERTIFIED
    short = pb.certify(robot, waypoints, budget=pb.Budget(boxes=60))
    assert short.verdict is pb.Verdict.UNDECIDED
    assert {part.reason for part in short.open_parts} == {Reason.BOXES}
    assert short.lower == -np.inf
    assert short.boxes < 120
    none = pb.certify(robot, waypoints, budget=pb.Budget(seconds=0.0))
    assert none.verdict is pb.Verdict.UNDECIDED
    assert {(part.start, part.end, part.reason) for part in none.open_parts} == {(0.0, 3.0, Reason.TIME)}


def test_budget_never_certifies_what_is_not_clear(tmp_path: Path) -> None:
    least, _ = closest(arm(tmp_path, 0.01), START, END)
    robot = arm(tmp_path, least + 1e-6)
    verdicts = {pb.certify(robot, [START, END] * 3, budget=pb.Budget(boxes=b)).verdict for b in range(0, 400, 7)}
    assert verdicts == {pb.Verdict.UNDECIDED, pb.Verdict.VIOLATED}


def test_what_the_budget_never_reached_is_not_certified(tmp_path: Path) -> None:
    least, _ = closest(arm(tmp_path, 0.01), START, END)
    points = [
        ("tip", "fore", np.array([0.0, 0.0, 0.25]), 0.0),
        ("post", "base", np.array([0.2, 0.0, 0.1]), 0.0),
        ("mirrored", "base", np.array([-0.2, 0.0, 0.1]), 0.0),
    ]
    pairs = [("tip", "post", least - 1e-9), ("tip", "mirrored", least + 1e-6)]
    robot = pb.load(write(tmp_path, ARM, sidecar(points, pairs, {})))
    forth_and_back = np.array([START, END] * 6000)  # costly for the first boundary, far from the second
    waypoints = np.concatenate([forth_and_back, [START, -START, -END]])  # the second touches in the last segment
    for boxes in (60_000, 80_000):  # spent while the first batch of segments is refined
        found = pb.certify(robot, waypoints, budget=pb.Budget(boxes, 60.0))
        assert [finding.verdict for finding in found.boundaries] == [pb.Verdict.UNDECIDED] * 2
        assert found.boundaries[1].lower == -np.inf
    assert pb.certify(robot, waypoints[-2:]).violations[0].name == "beta_1"


def test_no_boundaries(tmp_path: Path) -> None:
    robot = pb.load(write(tmp_path, ARM))
    found = pb.certify(robot, [START, END])
    assert (found.verdict, found.tightest, found.lower) == (pb.Verdict.NOTHING_TO_CHECK, None, np.inf)
    assert "nothing to check" in repr(found)
    assert pb.certify(arm(tmp_path, 0.01), [START, END], boundaries=[]).verdict is pb.Verdict.NOTHING_TO_CHECK
    alone = pb.certify(robot, [START, END], limits_only=True)
    assert alone.verdict is pb.Verdict.CERTIFIED
    assert "joint limits alone" in alone.notes[-1]
    beyond = [[0.0, 0.0], [0.0, 21.0]]
    assert pb.certify(robot, beyond).verdict is pb.Verdict.VIOLATED
    assert pb.certify(robot, beyond, limits_only=True).verdict is pb.Verdict.VIOLATED
    assert pb.certify(robot, beyond, limits=False).verdict is pb.Verdict.NOTHING_TO_CHECK


def test_no_boundaries_in_a_box(tmp_path: Path) -> None:
    robot = pb.load(write(tmp_path, ARM))
    low, high = [-1.0, -1.0], [1.0, 1.0]
    assert pb.certify_box(robot, low, high).verdict is pb.Verdict.NOTHING_TO_CHECK
    assert pb.certify_box(robot, low, high, limits_only=True).verdict is pb.Verdict.CERTIFIED
    assert pb.certify_box(robot, low, [1.0, 21.0]).verdict is pb.Verdict.VIOLATED
    assert pb.certified_box(robot, [0.0, 0.0]).verdict is pb.Verdict.NOTHING_TO_CHECK
    box = pb.certified_box(robot, [0.0, 0.0], limits_only=True, reach=30.0)
    assert box.verdict is pb.Verdict.CERTIFIED
    assert np.all(box.upper_corner > 19.0)


def test_limits_alone_and_boundaries_contradict_each_other(tmp_path: Path) -> None:
    robot = arm(tmp_path, 0.01)
    for options in ({"boundaries": list(robot.boundaries.names)}, {"limits": False}):
        with pytest.raises(pb.DimensionError, match="limits_only"):
            pb.certify(robot, [START, END], limits_only=True, **options)
        with pytest.raises(pb.DimensionError, match="limits_only"):
            pb.certify_box(robot, START, START, limits_only=True, **options)


def test_a_certificate_is_no_bool(tmp_path: Path) -> None:
    with pytest.raises(TypeError, match="verdict"):
        bool(pb.certify(arm(tmp_path, 0.01), [START]))
    with pytest.raises(TypeError, match="verdict"):
        bool(pb.certify_box(arm(tmp_path, 0.01), START, START))


@pytest.mark.parametrize(
    ("waypoints", "times", "message"),
    [
        ([[0.0, np.nan]], None, "waypoint 0"),
        ([[0.0, 1.0], [np.inf, 0.0]], None, "waypoint 1"),
        (np.empty((0, 2)), None, "no waypoint"),
        ([[0.0, 1.0, 2.0]], None, "shape"),
        ([["a", "b"]], None, "not an array"),
        ([[0.0, 1.0], [1.0, 1.0]], [0.0, 0.0], "increase"),
        ([[0.0, 1.0], [1.0, 1.0]], [0.0, -1.0], "increase"),
        ([[0.0, 1.0], [1.0, 1.0]], [0.0], "shape"),
        ([[0.0, 1.0], [1.0, 1.0]], [0.0, np.nan], "not finite"),
        (interpolate.CubicSpline([0, 1, 2], np.zeros((3, 3))), None, "shape"),
        (interpolate.CubicSpline([0, 1, 2], np.zeros((3, 2))), [0, 1], "its own"),
    ],
)
def test_bad_motions_get_one_clear_error(tmp_path: Path, waypoints, times, message: str) -> None:
    with pytest.raises(pb.DimensionError, match=message):
        pb.certify(arm(tmp_path, 0.01), waypoints, times)


def test_unknown_boundary(tmp_path: Path) -> None:
    with pytest.raises(pb.UnknownNameError, match="beta_0"):
        pb.certify(arm(tmp_path, 0.01), [START], boundaries=["beta_1"])


@pytest.mark.parametrize("seed", range(3))
def test_boxes_against_sampling(tmp_path: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    verdicts = set()
    for k in range(10):
        robot = random_robot(rng, tmp_path, ["planar", "spatial"][k % 2], k % 5 == 4)
        if robot is None:
            continue
        n = len(robot.coordinates)
        for size in (0.02, 0.1, 0.5):
            centre = robot.home + rng.normal(0, 0.3, n)
            half = rng.uniform(0, size, n)
            found = pb.certify_box(robot, centre - half, centre + half, budget=pb.Budget(20_000))
            verdicts.add(found.verdict)
            Q = centre + half * np.concatenate([rng.uniform(-1, 1, (500, n)), rng.choice([-1, 1], (200, n))])
            least = robot.boundaries.clearances(Q).min()
            assert found.lower <= least
            if found.verdict is pb.Verdict.CERTIFIED:
                assert least > 0.0
            if found.verdict is pb.Verdict.VIOLATED:
                assert np.all(np.abs(found.witness - centre) <= half * (1 + 1e-12))
                assert robot.boundaries[found.violated].clearance(found.witness) < 0.0
    assert verdicts >= {pb.Verdict.CERTIFIED, pb.Verdict.VIOLATED}


def test_maximal_box_cannot_grow() -> None:
    robot = pb.load("minervabot_v3")
    region = pb.feasible_region(robot)
    q = np.array([0.3, *region.centroid])
    box = pb.certified_box(robot, q)
    assert box.verdict is pb.Verdict.CERTIFIED
    corners = np.array([[x, y] for x in (0, 1) for y in (0, 1)]) * (box.upper_corner - box.lower_corner)[1:]
    assert region.signed_distance(corners + box.lower_corner[1:]).min() > 0.0
    assert (box.lower_corner[0], box.upper_corner[0]) == pytest.approx((robot.lower[0], robot.upper[0]), abs=2e-3)
    for index in (1, 2):
        for corner, sign in ((box.lower_corner, -1.0), (box.upper_corner, 1.0)):
            grown = corner.copy()
            grown[index] += sign * np.pi / 1000
            lower, upper = (grown, box.upper_corner) if sign < 0 else (box.lower_corner, grown)
            assert pb.certify_box(robot, lower, upper).verdict is not pb.Verdict.CERTIFIED
    outside = pb.certified_box(robot, [0.0, 0.0, 1.2])
    assert (outside.verdict, outside.violated) == (pb.Verdict.VIOLATED, "beta_4")


def test_box_of_bad_corners(tmp_path: Path) -> None:
    robot = arm(tmp_path, 0.01)
    with pytest.raises(pb.DimensionError, match="above"):
        pb.certify_box(robot, END, START)
    with pytest.raises(pb.DimensionError, match="not finite"):
        pb.certify_box(robot, START, [np.nan, 1.0])


def test_minervabot_agrees_with_its_region() -> None:
    robot = pb.load("minervabot_v3")
    region = pb.feasible_region(robot)
    rng = np.random.default_rng(0)
    for _ in range(200):
        ends = np.column_stack([rng.uniform(-2, 2, 2), rng.uniform(-0.4, 1.4, (2, 2))])
        found = pb.certify(robot, ends)
        inside = bool(np.all(region.contains(ends)))  # convex: the segment is inside if its ends are
        assert (found.verdict is pb.Verdict.CERTIFIED) == inside
        assert found.verdict is not pb.Verdict.UNDECIDED


def test_agrees_with_coal_on_spheres(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    robot = None
    while robot is None:
        robot = random_robot(rng, tmp_path, "spatial", False)
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    for _ in range(10):
        waypoints = robot.home + np.cumsum(rng.normal(0, 0.4, (3, len(robot.coordinates))), axis=0)
        found = pb.certify(robot, waypoints, each=True)
        for boundary, finding in zip(robot.boundaries, found.boundaries, strict=True):
            radius = boundary.threshold / 2
            ball = coal.Sphere(radius)
            least = np.inf
            for r in boundary.vector(dense(robot, waypoints, 400)):
                result.clear()
                placed = coal.Transform3s(np.eye(3), r)
                least = min(least, coal.distance(ball, placed, ball, coal.Transform3s.Identity(), request, result))
            assert finding.lower <= least + 1e-12
            if finding.verdict is pb.Verdict.CERTIFIED:
                assert least > 0.0
