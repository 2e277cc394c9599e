"""Robots with loops that are not parallelograms: values and certificates against Pinocchio and dense sampling."""

import itertools
import math
from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest

import linkages as zoo
import pinbound as pb
from linkages import Mechanism, Part
from pinbound.certificates.lifted import LiftedTrajectory, closed_only
from pinbound.certificates.trajectory import as_trajectory
from pinbound.robot.loop_robot import LoopRobot
from pinbound.robot.model_view import ModelJoints, ModelView

Load = Callable[..., pb.Robot]

MARKS = """<pinbound:point name="p" link="rocker" xyz="0.5 0.05 0.1" radius="0.03"/>
<pinbound:segment name="s" link="coupler" xyz_a="0 0 0" xyz_b="0.3 0.1 0.05" radius="0.02"/>
<pinbound:point name="t" link="tool" xyz="0.2 0 0" radius="0.03"/>
<pinbound:point name="w" link="base" xyz="0.35 0.35 0.05" radius="0.04"/>
<pinbound:plane name="floor" link="base" xyz="0 -0.6 0" normal="0 1 0"/>
<pinbound:boundary name="p_w" a="p" b="w"/><pinbound:boundary name="s_w" a="s" b="w"/>
<pinbound:boundary name="t_w" a="t" b="w"/><pinbound:boundary name="t_floor" a="t" b="floor"/>"""
TOOL = """<link name="tool"/><joint name="T" type="revolute"><parent link="rocker"/><child link="tool"/>
<origin xyz="0.3 0 0" rpy="0.4 0 0"/><axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>"""


def linkage(coupler: float = 0.2, limit: float = 9.0) -> str:
    """Return crank 0.3, ground 0.4, rocker 0.25, with a tool on the rocker."""
    parts = [
        Part("A", "base", "crank", 0j),
        Part("B", "crank", "coupler", 0.3 + 0j),
        Part("D", "base", "rocker", 0.4 + 0j, lower=-limit, upper=limit),
    ]
    pin_ = ("bar", "coupler", coupler + 0j, "rocker", 0.25 + 0j)
    return Mechanism(parts, [pin_], {"bar": ("B", "D")}, {"A": 0.6, "B": -0.3, "D": 2.0}).urdf(MARKS, TOOL)


@pytest.fixture
def robot(load_text: Load) -> LoopRobot:
    found = load_text(linkage())
    assert isinstance(found, LoopRobot)
    return found


def closing(robot: LoopRobot, rng: np.random.Generator, count: int) -> np.ndarray:
    Q = rng.uniform([-1.4, -3.0], [1.4, 3.0], (20 * count, 2))
    return Q[robot.intervals.hold(Q)][:count]


def test_distances_are_those_of_pinocchio_placements(robot: LoopRobot) -> None:
    Q = closing(robot, np.random.default_rng(0), 50)
    data = robot.model.createData()
    norms = robot.boundaries.norms(Q)
    for row, q in zip(norms, robot.to_pinocchio(robot.model, Q), strict=True):
        pin.framesForwardKinematics(robot.model, data, q)
        at = {name: data.oMf[robot.model.getFrameId(name)] for name in ("rocker", "tool", "coupler")}
        wall = np.array([0.35, 0.35, 0.05])
        p, t = at["rocker"].act(np.array([0.5, 0.05, 0.1])), at["tool"].act(np.array([0.2, 0.0, 0.0]))
        a, b = at["coupler"].act(np.zeros(3)), at["coupler"].act(np.array([0.3, 0.1, 0.05]))
        share = np.clip((wall - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
        expected = [np.linalg.norm(p - wall), np.linalg.norm(a + share * (b - a) - wall)]
        expected += [np.linalg.norm(t - wall), t[1] + 0.6]
        np.testing.assert_allclose(row, expected, atol=1e-12)


def test_batch_and_single_answers_agree_and_gradients_are_differences(robot: LoopRobot) -> None:
    B, step = robot.boundaries, 1e-6
    Q = closing(robot, np.random.default_rng(1), 20)
    for ask in (B.norms, B.clearances, B.signed_clearances, B.gradients, B.signed_gradients, B.vectors, B.hessians):
        many = ask(Q)
        for q, row in zip(Q, many, strict=True):
            np.testing.assert_allclose(ask(q), row, rtol=1e-9, atol=1e-11)
    np.testing.assert_array_equal(B.smallest(Q).clearance, B.signed_clearances(Q).min(axis=1))
    for k in range(2):
        d = step * np.eye(2)[k]
        slope = (B.norms(Q + d) - B.norms(Q - d)) / (2 * step)
        np.testing.assert_allclose(B.gradients(Q)[:, :, k], slope, atol=2e-6, rtol=1e-5)
        bend = (B.gradients(Q + d) - B.gradients(Q - d)) / (2 * step)
        smooth = np.abs(bend).max(axis=(1, 2)) < 50.0  # a segment's end comes and goes
        np.testing.assert_allclose(B.hessians(Q)[smooth][..., k], bend[smooth], atol=2e-3, rtol=1e-4)
    assert B["s_w"].coordinates == ("A",)
    assert B["t_w"].coordinates == ("A", "T")


def test_no_motion_is_certified_that_sampling_finds_in_contact(robot: LoopRobot) -> None:
    rng = np.random.default_rng(4)
    Q = closing(robot, rng, 9)
    seen = dict.fromkeys(pb.Verdict, 0)
    share = np.linspace(0.0, 1.0, 4001)[:, None]
    for start, end in itertools.pairwise(Q):
        found = pb.certify(robot, [start, end])
        path = (1.0 - share) * start + share * end
        signed, kept = robot.boundaries.signed_clearances(path), robot.intervals.hold(path)
        bad = ~kept | (signed <= 0.0).any(axis=1)
        seen[found.verdict] += 1
        assert found.verdict is (pb.Verdict.VIOLATED if bad.any() else pb.Verdict.CERTIFIED)
        if bad.any():
            first = found.first_contact
            assert first.q.shape == (2,)
            assert first.after <= share[np.argmax(bad), 0] + 1e-6
            before = share[:, 0] < first.before
            assert not bad[before].any()
        else:
            assert found.lower <= signed.min() + 1e-12
    assert seen[pb.Verdict.CERTIFIED] > 1
    assert seen[pb.Verdict.VIOLATED] > 1


def test_splines_and_functions_with_bounds_go_through_loops(robot: LoopRobot) -> None:
    from scipy.interpolate import CubicSpline

    t = np.linspace(0.0, 3.0, 7)
    spline = CubicSpline(t, np.column_stack((0.6 + 0.2 * np.sin(t), 1.5 + 0.3 * np.cos(2 * t))))
    found = pb.certify(robot, spline)
    signed = robot.boundaries.signed_clearances(spline(np.linspace(0.0, 3.0, 3001)))
    assert (found.verdict is pb.Verdict.CERTIFIED) == bool((signed > 0.0).all())
    assert found.lower <= signed.min() <= found.upper + 1e-9

    def swing(s: np.ndarray) -> np.ndarray:
        return np.column_stack((0.6 + 0.2 * np.sin(s), 1.5 + 0.0 * s))

    bounded = pb.certify(robot, pb.BoundedMotion(swing, 0.0, 3.0, speed=(0.2, 0.0)))
    signed = robot.boundaries.signed_clearances(swing(np.linspace(0.0, 3.0, 3001)))
    assert (bounded.verdict is pb.Verdict.CERTIFIED) == bool((signed > 0.0).all())


def test_boxes_are_certified_only_where_every_sample_is_free(robot: LoopRobot) -> None:
    rng = np.random.default_rng(6)
    seen = set()
    for centre in closing(robot, rng, 8):
        half = rng.uniform(0.01, 0.3, 2)
        found = pb.certify_box(robot, centre - half, centre + half)
        samples = centre + rng.uniform(-1.0, 1.0, (3000, 2)) * half
        free = robot.boundaries.free(samples)
        seen.add(found.verdict)
        if found.verdict is pb.Verdict.CERTIFIED:
            assert free.all()
            assert found.lower <= robot.boundaries.signed_clearances(samples).min()
        elif found.verdict is pb.Verdict.VIOLATED:
            assert not robot.boundaries.free(found.witness)
    assert {pb.Verdict.CERTIFIED, pb.Verdict.VIOLATED} <= seen


def test_limits_of_passive_joints_bind(load_text: Load) -> None:
    """The rocker D starts at 1.55 rad at home; its own limit of 1.7 is met before the toggle is."""
    robot = load_text(linkage(limit=1.7))
    found = pb.certify(robot, [[0.6, 1.5], [0.2, 1.5]], limits_only=True)
    assert found.verdict is pb.Verdict.VIOLATED
    assert found.violations[0].name == "D upper"
    assert robot.coupling.expand(found.violations[0].contact.q)[2] == pytest.approx(1.7, abs=1e-6)


def test_a_loop_that_opens_is_never_certified_without_limits_too(robot: LoopRobot) -> None:
    far = math.acos((0.4**2 + 0.3**2 - 0.45**2) / (2 * 0.4 * 0.3)) + 0.3
    for limits in (True, False):
        found = pb.certify(robot, [[0.6, 1.5], [far, 1.5]], limits=limits)
        assert found.verdict is pb.Verdict.VIOLATED
        box = pb.certify_box(robot, [0.6, 1.4], [far, 1.5], limits=limits)
        assert box.verdict is pb.Verdict.VIOLATED


def test_what_does_not_go_through_loops_is_refused_with_their_name(robot: LoopRobot, tmp_path: object) -> None:
    """Nothing takes a passive joint for a linear function of q."""
    asks: dict[str, Callable[[], object]] = {
        "S": lambda: robot.coupling.S,
        "row": lambda: robot.coupling.row("D"),
        "linear limits": lambda: robot.linear_limits,
        "guarded limits": lambda: robot.guarded_limits,
        "one limit": lambda: robot.boundaries["t_w"].limits("A", robot.home),
        "path": lambda: robot.boundaries["t_w"].path,
        "kernel": lambda: robot.boundaries.kernel,
        "expression": robot.boundaries["t_w"].expression,
        "casadi": robot.boundaries.to_casadi,
        "c": lambda: robot.export("c", f"{tmp_path}/x.c"),
        "json": lambda: robot.export("json", f"{tmp_path}/x.json"),
        "pinocchio": lambda: robot.on(robot.model),
        "polytope": lambda: pb.certified_polytope(robot, robot.home),
        "mink": lambda: ModelView.of(robot.boundaries, robot.coupling, ModelJoints, robot.home),  # type: ignore[arg-type]
        "steps": lambda: pb.StepBounds(robot),
    }
    for ask in asks.values():
        with pytest.raises(pb.UnsupportedError, match="'bar'"):
            ask()
    assert robot.coupling.row("A")[0].tolist() == [1.0, 0.0]
    assert robot.coupling.text("D") == "bar(A)"


def test_coal_agrees_on_points_and_what_is_not_derived_is_said(robot: LoopRobot) -> None:
    found = pb.cross_check(robot, samples=200, rays=5, levels=("points", "boundaries"))
    assert found.holds
    assert found.points.worst < 1e-9
    assert found.points.pins["bar"] < 1e-12
    assert "'bar'" in found.not_checked["boundaries"]


def test_a_box_grows_until_something_stops_it(robot: LoopRobot) -> None:
    found = pb.certified_box(robot, [0.6, 1.5], reach=0.2, budget=pb.Budget(boxes=5_000, seconds=20.0))
    assert found.verdict is pb.Verdict.CERTIFIED
    assert np.all(found.upper_corner - found.lower_corner > 0.0)
    rng = np.random.default_rng(8)
    assert robot.boundaries.free(rng.uniform(found.lower_corner, found.upper_corner, (500, 2))).all()


def test_annotations_can_be_added_to_a_robot_with_loops(robot: LoopRobot) -> None:
    ball = pb.Point("ball", "base", (0.0, 0.5, 0.0), radius=0.01)
    more = robot.with_annotations(pb.Annotations.of([ball], [pb.BoundaryMark("t_ball", "t", "ball")]))
    assert isinstance(more, LoopRobot)
    assert more.boundaries.names == (*robot.boundaries.names, "t_ball")
    some = more.boundaries.select(["t_ball", "p_w"])
    Q = closing(robot, np.random.default_rng(3), 5)
    np.testing.assert_allclose(some.norms(Q)[:, 1], robot.boundaries.norms(Q)[:, 0], rtol=1e-14)


@pytest.mark.parametrize("kind", sorted(zoo.KINDS))
def test_where_no_loop_is_said_to_open_or_to_go_round_every_z_of_a_motion_is_held(kind: str) -> None:
    """The angle that arms are counted from jumps at half a turn: a part that passes it must not be said to keep it."""
    rng, held, jumps, count = np.random.default_rng(14), 0, 0, 1500
    for _ in range(20):
        mechanism = zoo.KINDS[kind](rng)
        mechanism.home = {part.name: float(rng.uniform(-1.5, 1.5)) for part in mechanism.parts}
        try:
            robot = pb.load(mechanism.urdf('<pinbound:point name="p" link="base" xyz="0 0 0" radius="0.1"/>'))
        except pb.InputError:
            continue
        if not isinstance(robot, LoopRobot):
            continue
        lift, n = robot.lift, len(robot.coordinates)
        start = robot.home + rng.uniform(-3.0, 3.0, (count, n))
        end = start + 10.0 ** rng.uniform(-2.0, 0.5, (count, 1)) * rng.uniform(-1.0, 1.0, (count, n))
        way = np.stack((start, end), axis=1).reshape(-1, n)
        motion = LiftedTrajectory.of(robot, as_trajectory(way, robot.coordinates))
        part = motion.expand(2 * np.arange(count), np.zeros(count), np.ones(count))
        low, high = part.values.min(axis=1) - part.value_radius, part.values.max(axis=1) + part.value_radius
        kept = np.ones(count, dtype=bool)
        for limit in closed_only(robot).linear_limits:  # each is of one entry of z
            ends = np.stack((low, high)) @ limit.coefficients + limit.offset
            kept &= (ends.min(axis=0) > limit.lower) & (ends.max(axis=0) < limit.upper)
        Z = lift((start + np.linspace(0.0, 1.0, 41)[:, None, None] * (end - start)).reshape(-1, n)).reshape(
            41, count, -1
        )
        turns = [columns[3] for columns in lift.columns if len(columns) > 3]
        jumped = np.any(np.abs(np.diff(Z[..., turns], axis=0)) > np.pi, axis=(0, 2))
        assert not np.any(kept & jumped)
        assert np.all(Z[:, kept] >= low[kept] - 1e-9)
        assert np.all(Z[:, kept] <= high[kept] + 1e-9)
        held, jumps = held + int(kept.sum()), jumps + int(jumped.sum())
    assert held > 100
    assert jumps > 100 or kind != "five-bar"
