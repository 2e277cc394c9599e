"""Laws of segments, sweeps, lines and planes: against Pinocchio, coal, brute force, mpmath, differences, sampling."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import pinbound as pb
from pinbound.bounds.bounds import Expansion
from pinbound.bounds.rounding import rounding_bound as chain_rounding_bound
from pinbound.bounds.swept_bounds import over_box
from pinbound.certificates.constraints import families
from pinbound.certificates.trajectory import as_trajectory
from pinbound.evaluate.closest import nearest
from pinbound.evaluate.minimum_norm import nearest_corners
from pinbound.limits.piecewise_isolation import arcs as searched_arcs
from pinbound.path.relative import RelativePath
from robots import random_q
from segments import ROBOTS, exact_clearance, oracle_clearances, place

COAL = 1e-5  # metres: ten times the tolerance of coal's search, which few rows need
INFLATED = 1e-9  # metres: coal's boxes are 1e-10 of their size larger on rows that rounding decides, be it all of them
Load = Callable[..., pb.Robot]


@pytest.fixture(scope="module", params=sorted(ROBOTS))
def robot(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> pb.Robot:
    path = tmp_path_factory.mktemp("segments") / f"{request.param}.urdf"
    path.write_text(ROBOTS[request.param])
    return pb.load(path)


def each(robot: Any, ask: Callable[[pb.Boundary], Any]) -> Any:
    return np.stack([ask(boundary) for boundary in getattr(robot, "boundaries", robot)], axis=1)


def test_clearances_equal_coal_on_capsules_boxes_and_half_spaces(robot: pb.Robot) -> None:
    Q = random_q(robot, 400, seed=1)
    found, expected = each(robot, lambda b: b.clearance(Q)), oracle_clearances(robot, Q)
    for column, boundary in enumerate(robot.boundaries):
        floor = -boundary.threshold if boundary.path.is_solid else -np.inf  # coal goes on to measure the depth
        difference = np.abs(found[:, column] - np.maximum(expected[:, column], floor))
        assert difference.max() < COAL, boundary
        assert np.count_nonzero(difference > INFLATED) <= 0.02 * len(Q), boundary
        rough = np.flatnonzero(difference > 2e-13)  # coal's or ours: a third that is exact decides
        exact = np.array([exact_clearance(robot, boundary, Q[row]) for row in rough])
        assert np.all(np.abs(found[rough, column] - exact) < 2e-13), boundary
        assert (expected[:, column] > 0).any(), boundary


def test_the_nearest_points_are_on_the_marks_and_that_far_apart(robot: pb.Robot) -> None:
    import pinocchio as pin

    Q = random_q(robot, 30, seed=2)
    data = robot.model.createData()
    for row, theta in enumerate(robot.coupling.expand(Q)):
        pin.framesForwardKinematics(robot.model, data, theta)
        for boundary in robot.boundaries:
            t = iter(boundary.nearest(Q[row]).tolist())
            ends = []
            for mark in (boundary.point_a, boundary.point_b):
                first, *others = place(robot, theta, mark, data)
                weights = [next(t) for _ in mark.ways]
                assert all(0.0 <= weight <= 1.0 for weight in weights)
                ends.append(first + sum(w * (end - first) for w, end in zip(weights, others, strict=False)))
            r = ends[0] - ends[1]
            if boundary.path.normal is not None:
                flat = next(m for m in (boundary.point_a, boundary.point_b) if isinstance(m, (pb.Line, pb.Plane)))
                first, further = place(robot, theta, flat, data)
                unit = further - first
                r = (r @ unit) * unit if isinstance(flat, pb.Plane) else r - (r @ unit) * unit
            vector = data.oMf[robot.model.getFrameId(boundary.ancestor)].rotation.T @ r
            assert np.abs(vector - boundary.vector(Q[row])).max() < 1e-13
            assert abs(np.linalg.norm(r) - abs(boundary.norm(Q[row]))) < 1e-13


def smooth(boundary: pb.Boundary, Q: Any, step: float) -> Any:
    """Return rows around which the same t stay free, or at the same ends: no switch of features nearby."""
    patterns = []
    for shift in np.vstack((np.zeros(Q.shape[1]), step * np.eye(Q.shape[1]), -step * np.eye(Q.shape[1]))):
        t = boundary.nearest(Q + shift)
        patterns.append(np.where(t <= 0.0, 0, np.where(t >= 1.0, 2, 1)))
    return np.all(np.stack(patterns) == patterns[0], axis=(0, 2)) & (np.abs(boundary.norm(Q)) > 1e-2)


def test_gradients_and_hessians_equal_central_differences_away_from_switches(robot: pb.Robot) -> None:
    Q, h, checked = random_q(robot, 60, seed=3), 1e-6, 0
    for boundary in robot.boundaries:
        rows = Q[smooth(boundary, Q, 1e-3)]
        checked += len(rows)
        if not len(rows):
            continue
        gradient, hessian = boundary.gradient(rows), boundary.hessian(rows)
        for j in range(Q.shape[1]):
            e = h * np.eye(Q.shape[1])[j]
            assert np.abs(gradient[:, j] - (boundary.norm(rows + e) - boundary.norm(rows - e)) / (2 * h)).max() < 1e-7
            bend = (boundary.gradient(rows + e) - boundary.gradient(rows - e)) / (2 * h)
            known = np.isfinite(hessian).all(axis=(1, 2))
            assert np.abs(hessian[known, :, j] - bend[known]).max(initial=0.0) < 1e-4
    assert checked > 10 * len(robot.boundaries)


def test_there_is_no_gradient_where_bodies_overlap(tmp_path: Path) -> None:
    path = tmp_path / "bodies.urdf"
    path.write_text(ROBOTS["bodies"])
    robot = pb.load(path)
    boundary = robot.boundaries["arm_hand"]
    Q = random_q(robot, 400, seed=4)
    inside = oracle_clearances(robot, Q)[:, list(robot.boundaries.names).index("arm_hand")] < -1e-3
    assert inside.sum() > 5
    assert np.all(boundary.norm(Q[inside]) == 0.0)
    assert np.isnan(boundary.gradient(Q[inside])).all()
    assert np.isnan(boundary.hessian(Q[inside])).all()
    assert np.isnan(robot.boundaries.gradients(Q[inside])[:, list(robot.boundaries.names).index("arm_hand")]).all()


@pytest.mark.parametrize("backend", ["numpy", "compiled"])
def test_the_kernel_equals_the_reference(robot: pb.Robot, backend: Any) -> None:
    Q, B = random_q(robot, 300, seed=5), robot.boundaries
    scale = max(boundary.path.minimal.scale for boundary in B)
    norms, clearances = each(robot, lambda b: b.norm(Q)), each(robot, lambda b: b.clearance(Q))
    assert np.abs(B.norms(Q, backend=backend) - norms).max() < 4e-15 * scale
    assert np.abs(B.clearances(Q, backend=backend) - clearances).max() < 4e-15 * scale
    signed, least = each(robot, lambda b: b.signed_clearance(Q)), B.smallest(Q, backend=backend)
    assert np.abs(B.signed_clearances(Q, backend=backend) - signed).max() < 4e-15 * scale
    assert np.abs(least.clearance - signed.min(axis=1)).max() < 4e-15 * scale
    assert np.abs(signed[np.arange(len(Q)), least.index] - least.clearance).max() < 4e-15 * scale
    assert np.array_equal(B.free(Q, limits=False, backend=backend), least.clearance > 0.0)
    gradients = each(robot, lambda b: b.gradient(Q))
    assert np.nanmax(np.abs(B.gradients(Q, backend=backend) - gradients)) < 1e-11  # t may differ by rounding
    single = B.norms(Q, backend=backend, dtype=np.float32)
    assert np.abs(single - norms).max() < 2e-5 * scale
    assert np.abs(np.array([B.clearances(q) for q in Q[:20]]) - clearances[:20]).max() < 4e-15 * scale
    Q[3, -1], Q[5, 0] = np.nan, np.inf
    bad = each(robot, lambda b: b.clearance(Q))
    assert np.array_equal(np.isnan(B.clearances(Q, backend=backend)), np.isnan(bad))
    assert np.array_equal(np.isnan(B.smallest(Q, backend=backend).clearance), np.isnan(bad).any(axis=1))


def test_symbols_equal_numbers_at_the_nearest_points(robot: pb.Robot) -> None:
    import sympy

    q = random_q(robot, 1, seed=6)[0]
    for boundary in robot.boundaries:
        values = dict(zip(robot.coordinates, q, strict=True))
        values |= {f"t_{i + 1}": t for i, t in enumerate(boundary.nearest(q))}
        minimal, ancestor = boundary.expression(), boundary.expression("ancestor")
        point = {symbol: values[symbol.name] for symbol in minimal.free_symbols | ancestor.free_symbols}
        r = np.array(ancestor.evalf(30, subs=point), dtype=float).ravel()
        assert np.abs(r - boundary.vector(q)).max() < 1e-13
        assert abs(float(sympy.sqrt(minimal.dot(minimal)).evalf(30, subs=point)) - abs(boundary.norm(q))) < 1e-13
        assert set(boundary.coordinates) == {s.name for s in minimal.free_symbols} - {f"t_{i}" for i in range(1, 9)}
        assert boundary.latex()


def test_a_norm_depends_on_its_coordinates_alone(robot: pb.Robot) -> None:
    Q = random_q(robot, 40, seed=7)
    for boundary in robot.boundaries:
        for j, name in enumerate(robot.coordinates):
            moved = Q.copy()
            moved[:, j] += 0.7
            change = np.abs(boundary.norm(moved) - boundary.norm(Q)).max()
            assert (change > 1e-6) if name in boundary.coordinates else (change < 1e-13), (boundary, name)


def test_limits_are_contacts_with_the_promised_sides_and_none_is_missed(robot: pb.Robot) -> None:
    Q, checked = random_q(robot, 4, seed=8), 0
    Q[::2] = robot.home + 0.1 * Q[::2]
    for boundary, (j, name) in itertools.product(robot.boundaries, enumerate(robot.coordinates)):
        table = boundary.limits(name, Q, window=(-4.0, 4.0))
        level = boundary.contact_distance - boundary.threshold
        for row, q in enumerate(Q):
            arcs = table[row]
            for end, inwards in ((arcs.intervals[:, 0], 1.0), (arcs.intervals[:, 1], -1.0)):
                for value in end[np.isfinite(end) & (np.abs(end) != 4.0)]:
                    there = q.copy()
                    there[j] = value
                    assert abs(boundary.clearance(there) - level) < 1e-12
                    for side in (1.0, -1.0):
                        there[j] = value + 1e-6 * side * inwards
                        assert (boundary.clearance(there) - level) * side >= (0.0 if side > 0 else -1e-15)
                    checked += 1
            x = np.linspace(-3.99, 3.99, 300)
            line = np.repeat(q[None], len(x), axis=0)
            line[:, j] = x
            free = boundary.clearance(line) - level
            inside = np.array([arcs.contains(value) for value in x])
            assert not np.any(inside & (free < -1e-12))
            assert not np.any(~inside & (free > 1e-9))
    assert checked > 3


def test_the_closed_form_above_a_plane_equals_the_search_and_its_symbols(robot: pb.Robot) -> None:
    Q, checked = random_q(robot, 5, seed=9), 0
    for boundary in robot.boundaries:
        if not boundary.path.is_signed or boundary.path.difference.directions:
            continue
        for j, name in enumerate(robot.coordinates):
            if np.count_nonzero(boundary.path.minimal.coefficients[:, j]) != 1:
                continue
            table = boundary.limits(name, Q)
            found, _, _ = searched_arcs(boundary.path, j, name, Q, boundary.threshold, None)
            symbols = boundary.limit_expressions(name)
            for row, q in enumerate(Q):
                closed, searched = table[row].intervals, found[row]
                assert closed.shape == searched.shape
                if not np.isfinite(closed).all():
                    continue
                turn = table[row].period
                for ends in zip(closed.T, searched.T, strict=True):
                    apart = ends[0] - ends[1]
                    assert np.abs(apart - turn * np.round(apart / turn)).max() < 1e-9
                values = dict(zip(robot.coordinates, q, strict=True))
                lower = float(symbols.upper.evalf(30, subs={s: values[s.name] for s in symbols.upper.free_symbols}))
                apart = lower - closed[0, 0]
                assert abs(apart - turn * round(apart / turn)) < 1e-9
                checked += 1
    if any(b.path.is_signed and not b.path.difference.directions for b in robot.boundaries):
        assert checked > 0


def parts_of(robot: pb.Robot, rng: np.random.Generator, size: float, spline: bool) -> Any:
    n = len(robot.coordinates)
    start = rng.uniform(-1, 1, n)
    if spline:
        return CubicSpline(np.arange(4.0), start + size * rng.uniform(-1, 1, (4, n)))
    return start + np.array([[0.0], [1.0]]) * rng.uniform(-size, size, (1, n))


@pytest.mark.parametrize("spline", [False, True])
def test_enclosures_hold_on_motions_and_boxes(robot: pb.Robot, spline: bool) -> None:
    rng, tight = np.random.default_rng(10), []
    for size in (1e-4, 1e-2, 0.3, 2.0):
        motion = parts_of(robot, rng, size, spline)
        trajectory = as_trajectory(motion, robot.coordinates)
        a, b = np.sort(rng.uniform(0, 1, 2))
        family = families(robot, tuple(robot.boundaries), *trajectory.extent, trajectory.degree)[-1]
        assert family.names == tuple(x.name for x in robot.boundaries if not x.path.is_plain)
        which = np.arange(len(family.names))
        part = trajectory.expand(np.zeros(1, np.intp), np.array([a]), np.array([b]))
        found = family.enclose(which, part, np.zeros(len(which), np.intp))
        u = a + (b - a) * np.linspace(0, 1, 200)
        values = family.signed(trajectory.at(np.zeros(200, np.intp), u))
        assert np.all(found.lower <= values.min(axis=0) + 1e-15)
        assert np.all(
            np.abs(found.value - family.signed(trajectory.at(np.zeros(1, np.intp), np.array([a + b]) / 2))[0]) < 1e-12
        )
        if size <= 1e-2:
            tight += list(values.min(axis=0) - found.lower)
        low, high = trajectory.extent
        box = family.enclose_box(
            which, np.tile((low + high) / 2, (len(which), 1)), np.tile((high - low) / 2, (len(which), 1))
        )
        inside = family.signed(rng.uniform(low, high, (400, len(low))))
        assert np.all(box.lower <= inside.min(axis=0) + 1e-15)
    assert np.median(tight) < 2e-4  # second order: far less than the 1e-2 rad that the pieces are wide


def test_certificates_agree_with_dense_sampling(robot: pb.Robot) -> None:
    rng, verdicts = np.random.default_rng(11), []
    swept = [boundary.name for boundary in robot.boundaries if not boundary.path.is_plain]
    for trial in range(12):
        motion = parts_of(robot, rng, 1.5, spline=trial % 3 == 2)
        found = pb.certify(robot, motion, boundaries=swept, limits=False)
        u = np.linspace(0, 1, 4001) * (3.0 if trial % 3 == 2 else 1.0)
        Q = motion(u) if trial % 3 == 2 else motion[0] + u[:, None] * (motion[1] - motion[0])
        signed = pb.signed_clearances(robot, Q, swept)
        verdicts.append(found.verdict)
        if found.verdict is pb.Verdict.CERTIFIED:
            assert signed.min() > 0.0
            assert found.lower <= signed.min() + 1e-12
        elif found.verdict is pb.Verdict.VIOLATED:
            assert found.first_contact is not None
            first = found.violations[0]
            assert pb.signed_clearances(robot, first.contact.q, [first.name])[0] < 0.0
            before = u < first.contact.before - 1e-9
            assert signed[before].min(initial=1.0) > 0.0
        for finding in found.boundaries:
            assert finding.lower <= signed[:, swept.index(finding.name)].min() + 1e-12
    assert len(set(verdicts)) > 1 or robot.name


def test_a_certified_box_is_clear(robot: pb.Robot) -> None:
    swept = [boundary.name for boundary in robot.boundaries if not boundary.path.is_plain]
    half = 0.02 * np.ones(len(robot.coordinates))
    found = pb.certify_box(robot, robot.home - half, robot.home + half, swept, limits=False)
    Q = np.random.default_rng(12).uniform(robot.home - half, robot.home + half, (3000, len(half)))
    signed = pb.signed_clearances(robot, Q, swept)
    if found.verdict is pb.Verdict.CERTIFIED:
        assert signed.min() >= found.lower > 0.0
    else:
        assert signed.min() < 1e-2


def test_the_nearest_points_of_segments_against_mpmath_where_they_degenerate() -> None:
    """Parallel to 1e-16 .. 1e-4, crossing, touching, of no length: the distance is right to rounding."""
    rng = np.random.default_rng(13)
    for angle in (0.0, 1e-16, 1e-12, 1e-9, 1e-8, 1e-7, 1e-4, 1.0):
        for gap in (0.0, 1e-12, 1e-6, 0.1):
            u = rng.normal(size=3)
            across = np.cross(u, rng.normal(size=3))
            across /= np.linalg.norm(across)
            up = np.cross(u, across) / np.linalg.norm(u)
            v = rng.uniform(0.3, 2) * (u * np.cos(angle) + np.linalg.norm(u) * across * np.sin(angle))
            w = gap * up + rng.uniform(-1, 1) * u - rng.uniform(0, 1) * u + rng.uniform(0, 1) * v
            t = nearest(w[None], np.stack((u[None], -v[None])))[0]
            found = float(np.linalg.norm(w + t[0] * u - t[1] * v))
            assert abs(found - least_by_mpmath(w, u, -v)) < 4e-15 * (1 + np.linalg.norm(w))
    zero, one = np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]])
    assert nearest(one, np.stack((zero, zero))).tolist() == [[0.0, 0.0]]
    assert nearest(one, np.stack((zero, -2 * one))).tolist() == [[0.0, 0.5]]


def least_by_mpmath(w: Any, u: Any, v: Any) -> float:
    """Return the distance by 60 digits: the stationary point, and the four sides of the square."""
    with mpmath.workdps(60):
        W, U, V = ([mpmath.mpf(float(x)) for x in vector] for vector in (w, u, v))

        def dot(a: Any, b: Any) -> Any:
            return sum((x * y for x, y in zip(a, b, strict=True)), mpmath.mpf(0))

        def at(s: Any, t: Any) -> Any:
            r = [x + s * y + t * z for x, y, z in zip(W, U, V, strict=True)]
            return mpmath.sqrt(dot(r, r))

        def cut(x: Any) -> Any:
            return min(max(x, mpmath.mpf(0)), mpmath.mpf(1))

        a, b, c, d, e = dot(U, U), dot(U, V), dot(V, V), dot(U, W), dot(V, W)
        options = [at(cut(-(d + t * b) / a), t) for t in (mpmath.mpf(0), mpmath.mpf(1))]
        options += [at(s, cut(-(e + s * b) / c)) for s in (mpmath.mpf(0), mpmath.mpf(1))]
        determinant = a * c - b * b
        if determinant > 0:
            s, t = (b * e - c * d) / determinant, (b * d - a * e) / determinant
            if 0 <= s <= 1 and 0 <= t <= 1:
                options.append(at(s, t))
        return float(min(options))


def test_the_nearest_corners_agree_with_a_solver_and_prove_it() -> None:
    from scipy.optimize import lsq_linear

    rng = np.random.default_rng(14)
    for k in (3, 4, 6, 10):
        w, ways = 2 * rng.normal(size=(80, 3)), rng.normal(size=(k, 80, 3)) * rng.choice([0.1, 1.0], (k, 1, 1))
        ways[1, :20] = 0.7 * ways[0, :20]  # parallel
        ways[2, 10:40] = ways[0, 10:40] - ways[1, 10:40]  # flat
        t, bound = nearest_corners(w, ways)
        assert np.all((t >= 0.0) & (t <= 1.0))
        found = np.linalg.norm(w + np.einsum("nk,kni->ni", t, ways), axis=1)
        solved = [lsq_linear(ways[:, i].T, -w[i], (0, 1), tol=1e-14) for i in range(80)]
        expected = np.array([np.linalg.norm(ways[:, i].T @ s.x + w[i]) for i, s in enumerate(solved)])
        assert np.all(found <= expected + 1e-14)
        assert np.all(np.maximum(bound, 0.0) <= found + 1e-14)
        assert np.all(found - np.maximum(bound, 0.0) < 1e-6)
        for row in np.flatnonzero(bound < 0.0):  # a ball of that radius is inside
            for direction in rng.normal(size=(20, 3)):
                shift = -bound[row] * 0.999 * direction / np.linalg.norm(direction)
                moved, _ = nearest_corners((w[row] + shift)[None], ways[:, row : row + 1])
                assert np.linalg.norm(w[row] + shift + moved[0] @ ways[:, row]) < 1e-12


def test_two_bars_about_one_pivot_have_two_strips_a_turn(load_text: Load) -> None:
    robot = load_text(
        '<robot name="r" xmlns:pinbound="urn:pinbound:1"><link name="base"/><link name="arm"/>'
        '<joint name="q" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/></joint>'
        '<pinbound:annotations><pinbound:home q="1.5"/>'
        '<pinbound:segment name="post" link="base" xyz_a="0 0 0.5" xyz_b="0 0 0.9" radius="0.05"/>'
        '<pinbound:segment name="bar" link="arm" xyz_a="0 0 -0.8" xyz_b="0 0 0.8" radius="0.05"/>'
        '<pinbound:boundary name="beta" a="post" b="bar"/></pinbound:annotations></robot>'
    )
    boundary = robot.boundaries["beta"]
    assert boundary.contact is None
    assert boundary.contacts is not None
    assert sorted(round(c.angle, 9) for c in boundary.contacts) in ([0.0, 3.141592654], [-3.141592654, 0.0])
    half = float(np.arcsin(0.1 / 0.5))  # the end of the post at 0.5 m from the bar's line
    assert [c.half_width for c in boundary.contacts] == pytest.approx([half, half], abs=1e-12)
    found = robot.boundaries.limits("q", [1.5])
    assert (found.lower, found.upper) == pytest.approx((half, np.pi - half), abs=1e-12)
    assert robot.boundaries.beyond([4.0]) == ("beta",)
    assert robot.boundaries.beyond([2.0]) == ()


def test_sweeps_of_one_way_are_segments_and_boxes_measure_like_boxes(load_text: Load) -> None:
    head = '<robot name="r" xmlns:pinbound="urn:pinbound:1"><link name="base"/><link name="arm"/>'
    head += '<joint name="q" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>'
    head += '<limit lower="-3" upper="3" effort="1" velocity="1"/></joint><pinbound:annotations>'
    point = '<pinbound:point name="p" link="arm" xyz="0.3 0.4 1" radius="0.1"/>'
    tail = '<pinbound:boundary name="beta" a="m" b="p"/></pinbound:annotations></robot>'
    Q = np.linspace(-3, 3, 200)[:, None]
    sweep = load_text(f'{head}<pinbound:sweep name="m" link="base" xyz="0 0 -1" ways="0 0.2 0.5"/>{point}{tail}')
    segment = load_text(
        f'{head}<pinbound:segment name="m" link="base" xyz_a="0 0 -1" xyz_b="0 0.2 -0.5"/>{point}{tail}'
    )
    assert np.array_equal(sweep.boundaries.norms(Q), segment.boundaries.norms(Q))
    ways = "0.2 0 0  0 0.6 0  0 0 0.4"
    box = load_text(f'{head}<pinbound:sweep name="m" link="base" xyz="-0.1 -0.3 -1" ways="{ways}"/>{point}{tail}')
    x, z = 0.3 * np.cos(Q[:, 0]) + np.sin(Q[:, 0]), -0.3 * np.sin(Q[:, 0]) + np.cos(Q[:, 0])
    beyond = np.maximum(np.abs(np.column_stack((x, 0.4 + 0 * x, z + 0.8))) - [0.1, 0.3, 0.2], 0.0)
    assert np.abs(box.boundaries.norms(Q)[:, 0] - np.linalg.norm(beyond, axis=1)).max() < 1e-14


def test_paths_are_reduced_alike_for_all_marks(tmp_path: Path) -> None:
    """A rotation about a plane's normal, or about a line, or about a segment's own line turns nothing that counts."""
    path = tmp_path / "spatial.urdf"
    path.write_text(ROBOTS["spatial"])
    B = pb.load(path).boundaries
    assert B["ray_D"].coordinates == ("j3", "j4")
    text = (
        '<robot name="r" xmlns:pinbound="urn:pinbound:1"><link name="base"/><link name="a"/><link name="b"/>'
        '<joint name="turn" type="continuous"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/></joint>'
        '<joint name="tilt" type="continuous"><parent link="a"/><child link="b"/><origin xyz="0.3 0 0.5"/>'
        '<axis xyz="0 1 0"/></joint><pinbound:annotations>'
        '<pinbound:plane name="floor" link="base" xyz="1 2 -3" normal="0 0 2"/>'
        '<pinbound:line name="pole" link="base" xyz="0 0 7" direction="0 0 -1"/>'
        '<pinbound:line name="off" link="base" xyz="0.1 0 7" direction="0 0 -1"/>'
        '<pinbound:segment name="post" link="base" xyz_a="0 0 -1" xyz_b="0 0 1"/>'
        '<pinbound:point name="p" link="b" xyz="0.2 0.1 0.1"/>'
        '<pinbound:segment name="s" link="b" xyz_a="0.2 0.1 0.1" xyz_b="0.2 0.4 0.1"/>'
        + "".join(
            f'<pinbound:boundary name="{a}_{b}" a="{a}" b="{b}"/>'
            for a, b in itertools.product(("floor", "pole", "off", "post"), ("p", "s"))
        )
        + "</pinbound:annotations></robot>"
    )
    (tmp_path / "two.urdf").write_text(text)
    B = pb.load(tmp_path / "two.urdf").boundaries
    for name in ("floor_p", "floor_s", "pole_p", "pole_s", "post_p", "post_s"):
        assert B[name].coordinates == ("tilt",), name
    assert B["off_p"].coordinates == ("turn", "tilt")
    assert B["floor_p"].contacts is not None
    assert isinstance(B["floor_p"].path, RelativePath)


FAULTS = {
    "no length of direction": (
        '<pinbound:line name="l" link="a" xyz="0 0 0" direction="0 0 0"/>',
        "direction of line 'l' is zero. Give a vector",
    ),
    "no normal": ('<pinbound:plane name="l" link="a" xyz="0 0 0" normal="0 0 0"/>', "normal of plane 'l' is zero"),
    "two numbers a way": (
        '<pinbound:sweep name="l" link="a" xyz="0 0 0" ways="0 1"/>',
        "ways of sweep 'l' are 2 numbers. Give three numbers for each way (edge vector), up to 9 ways",
    ),
    "a way of no length": (
        '<pinbound:sweep name="l" link="a" xyz="0 0 0" ways="0 1 0 0 0 0"/>',
        "a way of sweep 'l' is zero. Leave it out",
    ),
    "a radius of a plane": (
        '<pinbound:plane name="l" link="a" xyz="0 0 0" normal="0 0 1" radius="1"/>',
        "plane 'l' has the unknown attribute 'radius'",
    ),
    "a name twice": ('<pinbound:segment name="p" link="a" xyz_a="0 0 0" xyz_b="0 0 1"/>', "'p' is declared twice"),
    "an end missing": ('<pinbound:segment name="l" link="a" xyz_a="0 0 0"/>', "segment 'l' has no xyz_b"),
    "two without ends": (
        '<pinbound:plane name="l" link="a" xyz="0 0 0" normal="0 0 1"/>'
        '<pinbound:line name="m" link="base" xyz="0 0 0" direction="0 0 1"/>'
        '<pinbound:boundary name="x" a="l" b="m"/>',
        "'l' and 'm' are infinite lines or planes",
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_faults_say_where_and_how_to_mend_them(load_text: Load, fault: str) -> None:
    mark, message = FAULTS[fault]
    text = ROBOTS["planar"].replace("<pinbound:annotations>", f"<pinbound:annotations>{mark}")
    with pytest.raises(pb.InputError) as caught:
        load_text(text)
    assert message in " ".join(str(caught.value).split()), str(caught.value)
    assert "line 1" in str(caught.value) or "robot.urdf:1" in str(caught.value)


def test_a_sidecar_says_the_same_as_the_block(robot: pb.Robot, tmp_path: Path) -> None:
    marks = robot.annotations
    marks.save(tmp_path / "saved.yaml")
    again = pb.Annotations.load(tmp_path / "saved.yaml")
    assert set(again.marks) == set(marks.marks)
    for name, mark in marks.marks.items():
        found = again.marks[name]
        assert type(found) is type(mark)
        assert (found.link, found.anchors, found.radius) == (mark.link, mark.anchors, mark.radius)
    assert "<pinbound:" in marks.to_xml()


def test_pickled_and_batched_robots_answer_alike(robot: pb.Robot) -> None:
    import pickle

    again = pickle.loads(pickle.dumps(robot))
    Q = random_q(robot, 5, seed=15)
    found, expected = (one.boundaries.clearances(Q, backend="numpy") for one in (again, robot))
    assert np.abs(found - expected).max() < 1e-14


def test_an_end_of_the_window_is_no_contact(tmp_path: Path) -> None:
    """A slide never repeats; what nothing stops within the window reaches exactly to its ends."""
    path = tmp_path / "parallel.urdf"
    path.write_text(ROBOTS["parallel"])
    robot = pb.load(path)
    rng = np.random.default_rng(16)
    for _ in range(50):
        window = tuple(np.sort(rng.uniform(-9.0, 9.0, 2)).tolist())
        for boundary, name in itertools.product(robot.boundaries, ("x", "z")):
            q = rng.uniform(-2.0, 2.0, 3)
            for low, high in boundary.limits(name, q, window).intervals:
                ends = np.array([low, high])
                there = np.repeat(q[None], 2, axis=0)
                there[:, robot.coordinates.index(name)] = ends
                level = boundary.contact_distance - boundary.threshold
                contact = np.abs(boundary.clearance(there) - level) < 1e-12
                assert np.all(contact | np.isin(ends, window))
    limits = robot.boundaries.limits("x", robot.home)
    assert (limits.lower_stop, limits.upper_stop) == ("A_B", "x")


@pytest.mark.parametrize("k", [3, 6, 18])
def test_the_compiled_search_equals_the_one_in_numpy(k: int) -> None:
    pytest.importorskip("numba")
    from pinbound.evaluate import minimum_norm
    from pinbound.geometry import gjk
    from pinbound.machine.searched import search

    rng = np.random.default_rng(17)
    w, ways = 2 * rng.normal(size=(3000, 3)), rng.normal(size=(k, 3000, 3)) * rng.choice([0.1, 1.0], (k, 1, 1))
    ways[1, :500] = 0.7 * ways[0, :500]  # parallel
    ways[2, 300:900] = ways[0, 300:900] - ways[1, 300:900]  # flat
    ways[:, 900:1000] = np.round(ways[:, 900:1000])  # along the axes, zero among them
    w[5], ways[0, 7] = np.nan, np.inf
    t, bound = search(w, ways, gjk.AGREE, gjk.MOST_ROUNDS, gjk.INSIDE)
    t_numpy, bound_numpy = minimum_norm._in_numpy(w, ways)
    assert np.array_equal(np.isnan(bound), np.isnan(bound_numpy))
    good = np.isfinite(bound)
    assert good.sum() == 2998
    t, t_numpy = np.clip(t, 0.0, 1.0), np.clip(t_numpy, 0.0, 1.0)
    found, expected = (np.linalg.norm(w + np.einsum("nk,kni->ni", x, ways), axis=1)[good] for x in (t, t_numpy))
    assert np.abs(found - expected).max() < 1e-13
    assert np.all(np.maximum(bound[good], 0.0) <= found + 1e-13)
    inside = found < 1e-13
    assert inside.any()
    assert np.all(bound[good][inside] <= 1e-13)
    nothing = search(w[:0], ways[:, :0], gjk.AGREE, gjk.MOST_ROUNDS, gjk.INSIDE)
    assert [part.shape for part in nothing] == [(0, k), (0,)]


@pytest.mark.parametrize("compiled", [False, True])
def test_the_origin_in_the_plane_of_a_flat_body_is_inside_or_as_far_as_its_polygon_says(
    compiled: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Rectangles in one plane, hexagons, and bodies nearly as thin as rounding: no four corners span anything."""
    import shapely

    from pinbound.evaluate import minimum_norm

    if compiled:
        pytest.importorskip("numba")
    monkeypatch.setattr(minimum_norm, "_is_worth_compiling", lambda k, rows: compiled)
    rng = np.random.default_rng(16)
    for thickness, k in itertools.product((0.0, 1e-14, 1e-10, 1e-6), (3, 4, 7)):
        ways = rng.normal(size=(k, 400, 3)) * [1.0, 1.0, thickness]
        w = -np.einsum("kn,kni->ni", rng.uniform(-0.5, 1.5, (k, 400)), ways) * [1.0, 1.0, 0.0]
        t, _ = nearest_corners(w, ways)
        found = np.linalg.norm((w + np.einsum("nk,kni->ni", t, ways))[:, :2], axis=1)
        corners = np.array([np.array(c) @ ways[:, :, :2].swapaxes(0, 1) for c in itertools.product((0, 1), repeat=k)])
        hulls = [shapely.MultiPoint(w[i, :2] + corners[:, i]).convex_hull for i in range(400)]
        expected = shapely.distance(np.array(hulls), shapely.Point(0, 0))
        assert 100 < np.sum(expected == 0.0) < 390
        assert np.abs(found - expected).max() < (1e-13 if thickness < 1e-12 else 1e-8)


def test_bounds_do_not_trust_the_search_for_the_nearest_points(
    robot: pb.Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    from pinbound.bounds import swept_bounds

    monkeypatch.setattr(swept_bounds, "nearest", lambda w, ways: np.full((len(w), len(ways)), 0.3))
    rng = np.random.default_rng(17)
    swept = [boundary for boundary in robot.boundaries if not boundary.path.is_plain]
    for size in (1e-3, 0.1):
        low = rng.uniform(-1, 1, len(robot.coordinates))
        family = families(robot, swept, low, low + size, 1)[-1]
        which = np.arange(len(swept))
        centre, half = np.tile(low + size / 2, (len(which), 1)), np.full((len(which), len(low)), size / 2)
        found = family.enclose_box(which, centre, half)
        assert np.all(found.lower <= family.signed(rng.uniform(low, low + size, (200, len(low)))).min(axis=0) + 1e-15)


def test_what_stops_at_the_end_of_a_joint_limit_is_the_limit(load_text: Load) -> None:
    from robots import joint
    from segments import assemble

    for lower, upper in ((-1.1, 0.3), (-0.37, 1.23), (0.1, 0.7), (-2.3, -0.1), (-0.9, 1.7)):
        slide = joint("x", "prismatic", "base", "a", axis="1 0 0", limit=f"{lower} {upper}")
        marks = [
            f'<pinbound:segment name="{name}" link="{link}" xyz_a="0 {y} 0" xyz_b="0 {y} 1"/>'
            for name, link, y in (("A", "base", 1), ("B", "a", 0))
        ]
        home = f'<pinbound:home x="{(lower + upper) / 2}"/>'
        found = load_text(assemble([slide], marks, ["A_B"], home)).boundaries.limits("x", [(lower + upper) / 2])
        assert (found.lower_stop, found.upper_stop) == ("x", "x")


ONE_JOINT = (
    '<robot name="r" xmlns:pinbound="urn:pinbound:1"><link name="base"/><link name="arm"/>'
    '<joint name="q" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/></joint>'
    "<pinbound:annotations>{}</pinbound:annotations></robot>"
)


def test_what_overlaps_in_a_plane_is_contact_however_thin(load_text: Load) -> None:
    """Crossing segments without radius, a point in a rectangle, a line through one: no piece need be 2e-5 m short."""
    pair = '<pinbound:boundary name="beta" a="A" b="B"/><pinbound:home q="3.1"/>'
    post = '<pinbound:segment name="A" link="base" xyz_a="6 0 -20" xyz_b="6 0 20"/>'
    for other in (
        '<pinbound:segment name="B" link="arm" xyz_a="0 0 0" xyz_b="10 0 0"/>',
        '<pinbound:sweep name="B" link="arm" xyz="0 0 0" ways="10 0 0  0 0 1e-9"/>',
    ):
        robot = load_text(ONE_JOINT.format(post + other + pair))
        found = robot.boundaries["beta"].limits("q", [0.0])
        reach = 6 - 2e-5  # contact begins at the tolerance
        assert found.intervals == pytest.approx(
            np.array([[np.arccos(reach / 10), 2 * np.pi - np.arccos(reach / 10)]]), abs=1e-7
        )
        assert pb.certify(robot, [[3.1], [1.2]]).verdict is pb.Verdict.CERTIFIED
        assert pb.certify(robot, [[3.1], [0.9]]).verdict is pb.Verdict.VIOLATED
    plate = '<pinbound:sweep name="A" link="base" xyz="6 0 -9" ways="9 0 0  0 0 18"/>'
    point = '<pinbound:point name="B" link="arm" xyz="10 0 0"/>'
    pole = '<pinbound:line name="B" link="arm" xyz="10 0 0" direction="0 1 0"/>'
    for other in (point, pole):
        boundary = load_text(ONE_JOINT.format(plate + other + pair)).boundaries["beta"]
        (contact,) = boundary.contacts or ()
        assert contact.half_width == pytest.approx(np.arccos((6 - 2e-5) / 10), abs=1e-9)


def test_contact_that_is_flat_is_refused_by_limits_and_does_not_stop_a_certificate(load_text: Load) -> None:
    marks = (
        '<pinbound:segment name="A" link="arm" xyz_a="0 0 0" xyz_b="0 0 -1"/>'
        '<pinbound:point name="B" link="base" xyz="0 0 0.5"/><pinbound:boundary name="beta" a="A" b="B" '
        'min_distance="0.4999999999"/>'
    )
    robot = load_text(ONE_JOINT.format(marks))  # the point is 0.5 m from the segment's end for half a turn
    with pytest.raises(pb.UnsupportedError, match=r"stays within 1\.0e-10 m of the contact distance"):
        robot.boundaries["beta"].limits("q", [0.0])
    assert pb.certify(robot, [[-0.01], [0.01]]).verdict is pb.Verdict.CERTIFIED


def test_a_slide_at_infinity_is_no_clearance(tmp_path: Path) -> None:
    from robots import joint
    from segments import assemble

    slide = joint("x", "prismatic", "base", "a", axis="0.36 0.48 0.8", limit="-1 1")
    marks = [
        '<pinbound:point name="p" link="base" xyz="1 1 1"/>',
        '<pinbound:point name="o" link="a" xyz="0 1 0"/>',
        '<pinbound:segment name="s" link="a" xyz_a="0 1 0" xyz_b="1 2 3"/>',
        '<pinbound:plane name="f" link="base" xyz="0 0 -9" normal="1 1 1"/>',
        '<pinbound:line name="l" link="base" xyz="0 0 -9" direction="1 0 1"/>',
    ]
    path = tmp_path / "slide.urdf"
    path.write_text(assemble([slide], marks, ["p_o", "p_s", "f_s", "f_o", "l_s", "l_o"]))
    B = pb.load(path).boundaries
    for value in (np.inf, -np.inf, np.nan):
        for boundary in B:
            assert np.isnan(boundary.norm([value])), boundary
        for backend in ("numpy", "compiled"):
            assert np.isnan(B.clearances([[value], [0.0]], backend=backend)[0]).all()
            assert B.free([[value], [0.0]], backend=backend).tolist() == [False, True]
            assert B.smallest([[value]], backend=backend).index[0] == -1


def test_a_line_through_a_body_is_in_contact_though_what_rounding_leaves_points_along_it(load_text: Load) -> None:
    """The nearest vector is then 1e-17 m long, and its direction may be the line's, along which nothing counts."""
    rng, checked = np.random.default_rng(18), 0
    for trial in range(24):
        ways = 0.2 * rng.normal(size=(2 + trial % 3, 3)) * ([1.0, 0.0, 1.0] if trial % 2 else [1.0, 1.0, 1.0])
        towards = rng.normal(size=3) * ([1.0, 0.0, 1.0] if trial % 2 else [1.0, 1.0, 1.0])
        numbers = [" ".join(map(repr, row.tolist())) for row in (ways.ravel(), towards)]
        marks = (
            f'<pinbound:sweep name="A" link="base" xyz="0.1 0 0.2" ways="{numbers[0]}" radius="0.01"/>'
            f'<pinbound:line name="B" link="arm" xyz="0.03 0 -0.14" direction="{numbers[1]}"/>'
            '<pinbound:boundary name="beta" a="A" b="B"/><pinbound:home q="-0.6"/>'
        )
        try:
            robot = load_text(ONE_JOINT.format(marks))
        except pb.InputError:  # home is in contact
            continue
        boundary, checked = robot.boundaries["beta"], checked + 1
        Q = np.linspace(-3.1, 3.1, 311)[:, None]
        arcs = boundary.limits("q", [0.0])
        allowed = np.array([arcs.contains(x) for x in Q[:, 0]])
        clear = boundary.clearance(Q)
        assert np.array_equal(allowed, clear > 0.0)
        low, high = Q - 0.005, Q + 0.005
        family = families(robot, (boundary,), np.full(1, -4.0), np.full(1, 4.0))[-1]
        found = family.enclose_box(np.zeros(len(Q), np.intp), (low + high) / 2, (high - low) / 2)
        assert np.all(found.lower <= clear + 1e-15)
    assert checked > 8


def test_all_sides_of_two_ways_are_candidates_in_reference_and_kernel(tmp_path: Path) -> None:
    """Random segments of random lengths against 60 digits: the nearest points are on every side, and inside."""
    rng, sides = np.random.default_rng(19), set[tuple[float, float]]()
    for _ in range(300):
        w, u, v = rng.normal(size=3), rng.uniform(0.1, 3) * rng.normal(size=3), rng.uniform(0.1, 3) * rng.normal(size=3)
        t = nearest(w[None], np.stack((u[None], v[None])))[0]
        sides.add(tuple(np.where((t == 0) | (t == 1), t, 0.5).tolist()))
        assert abs(float(np.linalg.norm(w + t[0] * u + t[1] * v)) - least_by_mpmath(w, u, v)) < 1e-14
    assert len(sides) >= 8
    from segments import PLANAR, assemble

    pairs, marks = [], []
    for index in range(24):
        ends = 0.3 * rng.normal(size=(4, 3)) * rng.choice([0.2, 1.0], (4, 1))
        texts = [" ".join(map(repr, end.tolist())) for end in ends]
        for link, a, b in (("a", *texts[:2]), ("b", *texts[2:])):
            marks.append(f'<pinbound:segment name="{link}{index}" link="{link}" xyz_a="{a}" xyz_b="{b}"/>')
        pairs.append(f"a{index}_b{index}")
    path = tmp_path / "many.urdf"
    path.write_text(assemble(PLANAR, marks, pairs))
    B = pb.load(path).boundaries
    Q = rng.uniform(-3, 3, (400, 2))
    assert np.abs(B.norms(Q, backend="numpy") - each(B, lambda b: b.norm(Q))).max() < 1e-14


def test_enclosures_take_off_every_error(robot: pb.Robot) -> None:
    """Rounding, and what is not known of a motion: over no time at all, and over a box of no size."""
    rng = np.random.default_rng(20)
    swept = [boundary for boundary in robot.boundaries if not boundary.path.is_plain]
    n, which = len(robot.coordinates), np.arange(len(swept))
    family = families(robot, swept, -4 * np.ones(n), 4 * np.ones(n), 1)[-1]
    lengths = np.array([boundary.path.minimal.scale for boundary in swept])
    chains = chain_rounding_bound(family.swept.chains, None, -4 * np.ones(n), 4 * np.ones(n))
    assert np.all(family.error >= chains[:: family.swept.rows] + 32 * 2.0**-53 * lengths)
    q = rng.uniform(-3, 3, n)
    still = family.enclose_box(which, np.tile(q, (len(which), 1)), np.zeros((len(which), n)))
    assert np.all(still.value - still.lower >= 0.999 * family.error)
    assert np.all(still.settled | (still.value < -family.threshold + 1e-3))
    zero, radius = np.zeros((1, 1, n)), rng.uniform(1e-4, 1e-3, n)
    piece = Expansion(q[None], radius, 0 * q[None], q[None, None], radius, zero, 0 * radius, zero, 0 * radius)
    found = family.enclose(which, piece, np.zeros(len(which), np.intp))
    truth = family.signed(q + radius * rng.choice([-1.0, 1.0], (200, n)))
    assert np.all(found.lower <= truth.min(axis=0))
    assert np.all(np.abs(found.value - family.signed(q[None])[0]) < 1e-12)


def test_a_value_within_rounding_of_contact_is_no_violation(robot: pb.Robot) -> None:
    q = random_q(robot, 1, seed=21)
    swept = [boundary for boundary in robot.boundaries if not boundary.path.is_plain and boundary.norm(q)[0] > 0.1]
    family = families(robot, swept, q[0] - 1, q[0] + 1, 1)[-1]
    which, size = np.arange(len(swept)), np.zeros((len(swept), q.shape[1]))
    for share, violated in ((0.5, False), (-0.5, False), (2.0, True)):
        norms = np.array([boundary.norm(q)[0] for boundary in swept])
        moved = dataclasses.replace(family, threshold=norms + share * family.error)
        found = moved.enclose_box(which, np.tile(q, (len(swept), 1)), size)
        assert np.all(found.violated == violated)
        assert not np.any(found.clear)


def test_upper_bounds_hold_too_also_of_what_crosses_only_as_seen_along_the_axis(robot: pb.Robot) -> None:
    rng = np.random.default_rng(22)
    swept = [boundary for boundary in robot.boundaries if not boundary.path.is_plain]
    which, n = np.arange(len(swept)), len(robot.coordinates)
    family = families(robot, swept, -4 * np.ones(n), 4 * np.ones(n), 1)[-1]
    for size in (1e-3, 0.03, 0.3):
        for _ in range(25):
            centre = rng.uniform(-3, 3, n)
            boxes = np.tile(centre, (len(which), 1)), np.full((len(which), n), size)
            found = over_box(family.swept, which, *boxes, family.error)
            values = family.signed(centre + size * rng.uniform(-1, 1, (40, n))) + family.threshold
            assert np.all(found.upper >= values.max(axis=0) - 1e-15)
            assert np.all(found.lower <= values.min(axis=0) + 1e-15)


def test_skew_bars_of_a_planar_mechanism_may_part_though_they_cross_as_seen_along_the_axis(load_text: Load) -> None:
    marks = (
        '<pinbound:segment name="A" link="base" xyz_a="1 -0.2 -1" xyz_b="1 0.4 1"/>'
        '<pinbound:segment name="B" link="arm" xyz_a="0 0 0" xyz_b="2 0.1 0"/><pinbound:home q="2"/>'
        '<pinbound:boundary name="beta" a="A" b="B" min_distance="0.08"/>'
    )
    boundary = load_text(ONE_JOINT.format(marks)).boundaries["beta"]
    Q = np.linspace(-3, 3, 1201)[:, None]
    arcs = boundary.limits("q", [0.0])
    assert np.array_equal([arcs.contains(x) for x in Q[:, 0]], boundary.clearance(Q) > 0.0)


def test_contact_above_a_plane_is_at_its_threshold_and_of_a_distance_at_the_tolerance_atleast_separation(
    robot: pb.Robot,
) -> None:
    for boundary in robot.boundaries:
        bare = dataclasses.replace(boundary, min_distance=-boundary.threshold)
        assert bare.contact_distance == (0.0 if boundary.path.is_signed else boundary.contact_tolerance)


def test_a_slide_along_the_axis_moves_what_crosses_in_the_plane_apart(load_text: Load) -> None:
    from robots import joint
    from segments import assemble

    joints = [
        joint("lift", "prismatic", "base", "a", axis="0 1 0", limit="-1 1"),
        joint("turn", "continuous", "a", "b", axis="0 1 0"),
    ]
    marks = [
        '<pinbound:segment name="A" link="base" xyz_a="1 0 -1" xyz_b="1 0 1"/>',
        '<pinbound:segment name="B" link="b" xyz_a="0 0.3 0" xyz_b="2 0.3 0"/>',
    ]
    robot = load_text(assemble(joints, marks, ["A_B"]))
    family = families(robot, tuple(robot.boundaries), -np.ones(2), np.ones(2), 1)[-1]
    found = over_box(family.swept, np.zeros(1, np.intp), np.zeros((1, 2)), np.full((1, 2), 0.1), family.error)
    assert found.upper[0] >= 0.4 - 1e-12
    arcs = robot.boundaries["A_B"].limits("lift", [0.0, 0.1], window=(-1.0, 1.0))
    assert arcs.intervals.ravel() == pytest.approx([-1.0, -0.3 - 2e-5, -0.3 + 2e-5, 1.0], abs=1e-12)


def test_what_no_pose_can_be_nearer_than_is_a_lower_bound(robot: pb.Robot, load_text: Load) -> None:
    from pinbound.coverage.reach import least_separation
    from pinbound.limits.univariate import one_angle_smallest
    from segments import PLANAR, assemble

    far = ['<pinbound:segment name="A" link="base" xyz_a="3 0 0" xyz_b="5 0 0"/>']
    far += ['<pinbound:segment name="B" link="b" xyz_a="0 0 0" xyz_b="0 0 0.4"/>']
    away = load_text(assemble(PLANAR, far, ["A_B"]))
    assert least_separation(away.boundaries["A_B"].path) > 1.0
    for one in (robot, away):
        Q = random_q(one, 3000, seed=24)
        for boundary in one.boundaries:
            if boundary.path.is_signed:
                continue
            least = float(boundary.norm(Q).min())
            assert least_separation(boundary.path) <= least
            single = one_angle_smallest(boundary.path)
            assert single is None or least - 1e-4 < single <= least


def test_rounding_of_the_projection_is_counted(robot: pb.Robot) -> None:
    from pinbound.bounds.swept_bounds import rounding_bound, swept_bundle

    n = len(robot.coordinates)
    swept = swept_bundle([b.path for b in robot.boundaries if not b.path.is_plain], -np.ones(n), np.ones(n))
    box = (-np.ones(n), np.ones(n))
    each = chain_rounding_bound(swept.chains, None, *box).reshape(-1, swept.rows)
    chains = each[:, 0] + np.sum(swept.corners.spread * each[:, 1:], axis=1)
    assert np.all(rounding_bound(swept, None, *box) >= chains + 16 * 2.0**-53 * swept.reach)


@pytest.mark.parametrize("depth", [1e-3, 1e-6, 1e-9, 1e-11, 3e-12])
def test_a_contact_however_narrow_is_not_passed_over(load_text: Load, depth: float) -> None:
    """The point passes the segment at 0.5 m: contact is `+- arccos(1 - 2 depth)`, 3e-6 rad wide at 1e-12 m."""
    marks = (
        '<pinbound:segment name="A" link="base" xyz_a="1 0 -0.1" xyz_b="1 0 0.1"/>'
        f'<pinbound:point name="B" link="arm" xyz="0.5 0 0" radius="{0.5 + depth!r}"/><pinbound:home q="2"/>'
        '<pinbound:boundary name="beta" a="A" b="B"/>'
    )
    boundary = load_text(ONE_JOINT.format(marks)).boundaries["beta"]
    half = float(np.arccos(1.0 - 2.0 * depth))
    found = boundary.limits("q", [2.0]).intervals
    assert found.shape == (1, 2)
    assert found[0] == pytest.approx([half, 2 * np.pi - half], abs=max(1e-9, 1e-16 / half))
    assert not boundary.limits("q", [2.0]).contains(0.0)


def test_the_exact_oracle_agrees_with_every_clearance(robot: pb.Robot) -> None:
    Q = random_q(robot, 12, seed=6)
    for boundary in robot.boundaries:
        found, exact = boundary.clearance(Q), [exact_clearance(robot, boundary, q) for q in Q]
        assert np.abs(found - exact).max() < 2e-13, boundary
