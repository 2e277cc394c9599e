"""Planar loops in closed form against Newton at 50 digits and differences; intervals; toggles against flat poses."""

import math
from collections.abc import Callable
from functools import partial

import mpmath
import numpy as np
import pytest

import pinbound as pb
from linkages import KINDS, Mechanism, Part
from pinbound.bounds import intervals
from pinbound.bounds.intervals import Interval
from pinbound.loops.jets import Jet
from pinbound.loops.linkages import Form, Linkage
from pinbound.loops.solving import toggles
from pinbound.robot.loop_robot import LoopRobot

Load = Callable[..., pb.Robot]


def loaded(load_text: Load, kind: str, seed: int) -> tuple[Mechanism, LoopRobot]:
    """Return a random mechanism that closes at a random home, and its robot."""
    rng = np.random.default_rng(seed)
    for _ in range(400):
        mechanism = KINDS[kind](rng)
        mechanism.home = {part.name: float(rng.uniform(-1.5, 1.5)) for part in mechanism.parts}
        try:
            robot = load_text(mechanism.urdf())
        except pb.InputError:
            continue  # it does not close there
        assert isinstance(robot, LoopRobot)
        return mechanism, robot
    raise AssertionError(kind)


def poses(robot: LoopRobot, rng: np.random.Generator, count: int, within: float = 0.99) -> np.ndarray:
    """Return q at which the loops close, not too near a toggle."""
    Q = robot.home + rng.uniform(-3.0, 3.0, (60 * count, len(robot.coordinates)))
    w = robot.lift(Q)[:, robot.lift.columns[0][2]]
    low, high = robot.lift.linkages[0].transmission_range
    if np.isfinite(high):
        return Q[np.abs(w) < within][:count]
    return Q[w > low + 0.02][:count]


@pytest.mark.parametrize("kind", KINDS)
def test_passive_joints_are_where_newton_finds_them(load_text: Load, kind: str) -> None:
    for seed in range(3):
        mechanism, robot = loaded(load_text, kind, seed)
        Q = poses(robot, np.random.default_rng(seed), 4)
        for q in Q:
            theta = dict(zip(robot.coupling.joints, robot.coupling.expand(q).tolist(), strict=True))
            rough = {n: v if n in robot.coordinates else round(v, 4) for n, v in theta.items()}
            exact = mechanism.solved(rough)
            for _, link_a, a, link_b, b in mechanism.pins:
                for link, point in ((link_a, a), (link_b, b)):
                    ours = mechanism.place(link, point, {n: mpmath.mpf(v) for n, v in theta.items()})
                    assert abs(ours - mechanism.place(link, point, exact)) < 1e-12
        assert robot.closure_residuals(Q).max(initial=0.0) < 1e-13


@pytest.mark.parametrize("kind", KINDS)
def test_derivatives_are_differences(load_text: Load, kind: str) -> None:
    _, robot = loaded(load_text, kind, 11)
    lift, step = robot.lift, 1e-5
    Q = poses(robot, np.random.default_rng(1), 20, within=0.9)
    J, H = lift.derivatives(Q, order=2)
    for k in range(Q.shape[1]):
        d = step * np.eye(Q.shape[1])[k]
        np.testing.assert_allclose((lift(Q + d) - lift(Q - d)) / (2 * step), J[:, :, k], rtol=1e-6, atol=1e-6)
        slope = (lift.jacobians(Q + d) - lift.jacobians(Q - d)) / (2 * step)
        np.testing.assert_allclose(slope, H[:, :, :, k], rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("kind", KINDS)
def test_intervals_hold_values_and_derivatives(load_text: Load, kind: str) -> None:
    rng = np.random.default_rng(5)
    for seed in range(2):
        _, robot = loaded(load_text, kind, 20 + seed)
        lift, n = robot.lift, len(robot.coordinates)
        Q = poses(robot, rng, 40, within=0.95)
        half, way = 10.0 ** rng.uniform(-6, -1, len(Q)), rng.uniform(-1.0, 1.0, (len(Q), n))
        zero, one = np.zeros(len(Q)), np.ones(len(Q))
        given = [
            Jet(Interval.at(Q[:, k], half * abs(way[:, k])), Interval.at(way[:, k]), Interval.at(zero))
            for k in range(n)
        ]
        held = lift.jets(given)
        for share in np.linspace(-1.0, 1.0, 7):
            at = Q + (share * half)[:, None] * way
            found = lift.jets([Jet(at[:, k], way[:, k] * one, zero) for k in range(n)])
            inside = np.all([robot.opened.intervals.hold(lift(at))], axis=0)
            for index in range(n, len(lift.names)):
                for part in ("value", "first", "second"):
                    value, box = getattr(found[index], part), getattr(held[index], part)
                    slack = 1e-12 * (1.0 + np.abs(value))
                    ok = (box.lower - slack <= value) & (value <= box.upper + slack)
                    assert np.all(ok | ~inside), (part, lift.names[index])


def test_interval_functions_hold_random_values() -> None:
    rng = np.random.default_rng(3)
    middle, radius = rng.uniform(-9, 9, (2, 4000)), 10.0 ** rng.uniform(-9, 0.6, (2, 4000))
    x, y = (Interval.at(m, r) for m, r in zip(middle, radius, strict=True))
    for _ in range(20):
        a, b = (m + r * rng.uniform(-1, 1, 4000) for m, r in zip(middle, radius, strict=True))
        apart = np.sign(y.lower) == np.sign(y.upper)
        cases = [(x + y, a + b), (x - y, a - b), (x * y, a * b), (x.squared(), a * a)]
        cases += [(intervals.cos(x), np.cos(a)), (intervals.sin(x), np.sin(a))]
        for box, value in cases:
            assert np.all((box.lower <= value) & (value <= box.upper))
        with np.errstate(divide="ignore", invalid="ignore"):
            box = x / y
        assert np.all(((box.lower <= a / b) & (a / b <= box.upper))[apart])
        turn = intervals.arctan2(y, x)
        angle = np.arctan2(b, a)
        angle = angle + 2 * np.pi * np.round((turn.middle - angle) / (2 * np.pi))
        assert np.all((turn.lower <= angle) & (angle <= turn.upper))


def flatness(one: Linkage, row: np.ndarray, x: mpmath.mpf) -> mpmath.mpf:
    """Return what is zero at a toggle, at the input angle x, at 50 digits."""
    (k,) = np.flatnonzero(row)[:1]
    total = mpmath.mpc(0)
    for angles, vector in zip(one.angles, one.vectors, strict=True):
        total += mpmath.mpc(*map(float, vector)) * mpmath.expj(mpmath.mpf(float(angles[k] / row[k])) * x)
    Y, Z = map(mpmath.mpf, one.lengths)
    if one.form is Form.SLIDE:
        return (total.imag - Y) * (total.imag + Y)
    if one.form is Form.TELESCOPE:
        return abs(total) ** 2 - Y**2
    return (abs(total) - Y - Z) * (abs(total) - abs(Y - Z))


@pytest.mark.parametrize("kind", ["four-bar", "slider-crank", "cylinder"])
def test_toggles_are_flat_poses(load_text: Load, kind: str) -> None:
    """At a toggle two arms are in line, or an arm is across its slide: D = Y + Z or |Y - Z|, by 50 digits."""
    seen = 0
    for seed in range(8):
        _, robot = loaded(load_text, kind, 40 + seed)
        one = robot.lift.linkages[0]
        at = toggles(one)
        if at is None:
            continue
        for x in at.angles:
            exact = mpmath.findroot(partial(flatness, one, at.row), mpmath.mpf(x))
            assert abs(exact - mpmath.mpf(x)) < 1e-9
            seen += 1
    assert seen > 1


def test_a_limit_stands_at_the_toggle_and_has_its_name(load_text: Load) -> None:
    """Ground 0.4, crank 0.3, coupler 0.2, rocker 0.25: the crank cannot go round; law of cosines where it stops."""
    ground, crank, coupler, rocker = 0.4, 0.3, 0.2, 0.25
    parts = [
        Part("A", "base", "crank", 0j),
        Part("B", "crank", "coupler", crank + 0j),
        Part("D", "base", "rocker", ground + 0j),
    ]
    pin = ("bar", "coupler", coupler + 0j, "rocker", rocker + 0j)
    text = Mechanism(parts, [pin], {"bar": ("B", "D")}, {"A": 0.6, "B": -0.3, "D": 2.0}).urdf()
    robot = load_text(text)
    assert isinstance(robot, LoopRobot)
    flat = math.acos((ground**2 + crank**2 - (coupler + rocker) ** 2) / (2 * ground * crank))
    (limit,) = [one for one in robot.opened.linear_limits if one.joint == "bar toggle" and one.coefficients[0]]
    assert limit.upper == pytest.approx(flat, abs=1e-8)
    assert limit.upper < flat
    inner = (
        math.acos((ground**2 + crank**2 - (rocker - coupler) ** 2) / (2 * ground * crank))
        if ground - crank < 0.05
        else 0
    )
    assert inner == 0
    assert robot.boundaries.free([flat - 1e-6])
    assert not robot.boundaries.free([flat + 1e-9])
    assert not robot.boundaries.free([flat + 1e-9], limits=False)
    assert pb.certify(robot, [[0.6], [flat - 1e-6]], limits_only=True).verdict is pb.Verdict.CERTIFIED
    beyond = pb.certify(robot, [[0.6], [flat + 0.1]], limits_only=True)
    assert beyond.verdict is pb.Verdict.VIOLATED
    assert beyond.violations[0].name == "bar toggle upper"
    assert beyond.violations[0].contact.after == pytest.approx((flat - 0.6) / (flat - 0.5), abs=1e-6)


def test_home_picks_the_assembly_and_the_turn(load_text: Load) -> None:
    parts = [
        Part("A", "base", "crank", 0j),
        Part("B", "crank", "coupler", 0.2 + 0j),
        Part("D", "base", "rocker", 0.5 + 0j),
    ]
    pin = ("bar", "coupler", 0.45 + 0j, "rocker", 0.4 + 0j)
    for home, sign in ((1.2, 1.0), (-1.2, -1.0)):
        robot = load_text(Mechanism(parts, [pin], {"bar": ("B", "D")}, {"A": 0.1, "D": home, "B": 0.0}).urdf())
        theta = dict(zip(robot.coupling.joints, robot.coupling.expand([0.1]), strict=True))
        assert math.copysign(1.0, math.sin(theta["D"])) == sign
    turned = load_text(
        Mechanism(parts, [pin], {"bar": ("B", "D")}, {"A": 0.1, "D": 1.2 + 4 * math.pi, "B": 0.0}).urdf()
    )
    assert turned.coupling.expand([0.1])[2] == pytest.approx(4 * math.pi + 1.2, abs=1.0)
    round_ = turned.coupling.expand(np.linspace(-20.0, 20.0, 4001)[:, None])
    assert np.abs(np.diff(round_, axis=0)).max() < 0.1  # a crank that goes round: nothing jumps
    assert round_[-1, 1] - round_[0, 1] == pytest.approx(-40.0, abs=7.0)


def test_a_loop_that_both_assemblies_fit_at_home_is_refused(load_text: Load) -> None:
    parts = [
        Part("A", "base", "crank", 0j),
        Part("B", "crank", "coupler", 0.3 + 0j),
        Part("D", "base", "rocker", 0.4 + 0j),
    ]
    pin = ("bar", "coupler", 0.2 + 0j, "rocker", 0.25 + 0j)
    in_line = {"A": 0.5, "B": 0.0, "D": 0.5}
    with pytest.raises(pb.InputError, match="equally near to both of its assemblies"):
        load_text(Mechanism(parts, [pin], {"bar": ("B", "D")}, in_line).urdf())
    open_ = {"A": 2.0, "B": -1.0, "D": 2.0}
    with pytest.raises(pb.InputError, match="does not close in the pose that home gives"):
        load_text(Mechanism(parts, [pin], {"bar": ("B", "D")}, open_).urdf())


def test_a_spatial_loop_is_refused_with_its_reason(load_text: Load) -> None:
    parts = [
        Part("A", "base", "crank", 0j),
        Part("B", "crank", "coupler", 0.3 + 0j),
        Part("D", "base", "rocker", 0.4 + 0j),
    ]
    text = Mechanism(parts, [("bar", "coupler", 0.2 + 0j, "rocker", 0.25 + 0j)], {"bar": ("B", "D")}, {"A": 0.6}).urdf()
    text = text.replace(
        '<origin xyz="0.4 0.0 0"/><axis xyz="0.0 0.0 1"/>', '<origin xyz="0.4 0.0 0"/><axis xyz="0 1 0"/>'
    )
    with pytest.raises(pb.InputError, match="spatial loop"):
        load_text(text)


@pytest.mark.parametrize("kind", KINDS)
def test_values_alone_are_those_with_derivatives(load_text: Load, kind: str) -> None:
    _, robot = loaded(load_text, kind, 70)
    Q = robot.home + np.random.default_rng(2).uniform(-3.0, 3.0, (200, len(robot.coordinates)))  # beyond toggles, too
    zero = np.zeros(len(Q))
    jets = robot.lift.jets([Jet(Q[:, k], zero, zero) for k in range(Q.shape[1])])
    expected = np.stack([jet.value for jet in jets], axis=1)
    np.testing.assert_allclose(robot.lift(Q), expected, rtol=1e-12, atol=1e-12)
