"""Lever arms, enclosures and rounding bounds, against dense sampling, Pinocchio and the unreduced vector."""

from pathlib import Path

import numpy as np
import pinocchio
import pytest

from mechanisms import random_robot
from pinbound.bounds import bounds, rounding
from pinbound.certificates.constraints import families
from pinbound.certificates.trajectory import as_trajectory
from pinbound.evaluate import numeric
from pinbound.geometry.rotations import rotation_matrix
from pinbound.path.chain import Chain


def robots(folder: Path, seed: int, count: int):
    rng = np.random.default_rng(seed)
    found = [random_robot(rng, folder, ["planar", "spatial"][k % 2], k % 3 == 2) for k in range(count)]
    return [robot for robot in found if robot is not None], rng


def _beyond(chain: Chain, index: int, q: np.ndarray) -> np.ndarray:
    x = np.zeros(3)
    for i in reversed(range(index, chain.rotations)):
        x = chain.offsets[i + 1] + chain.slides[i + 1] @ q + x
        if i > index:
            x = rotation_matrix(chain.axes[i], float(chain.coefficients[i] @ q)) @ x
    return x


def test_lever_arms_hold_and_are_not_far_off(tmp_path: Path) -> None:
    found, rng = robots(tmp_path, 1, 12)
    ratios = []
    for robot in found:
        chains = [boundary.path.minimal for boundary in robot.boundaries]
        n = len(robot.coordinates)
        lower, upper = np.full(n, -1.0), np.full(n, 2.0)
        arms = bounds.lever_arms(bounds.bundle(chains, n), lower, upper)
        for row, chain in enumerate(chains):
            Q = rng.uniform(lower, upper, (200, n))
            for i in range(chain.rotations):
                reached = max(np.linalg.norm(np.cross(chain.axes[i], _beyond(chain, i, q))) for q in Q)
                assert reached <= arms[row, i]
                ratios.append(reached / arms[row, i])
    assert np.median(ratios) > 0.7


def test_enclosures_hold_on_parts_of_motions(tmp_path: Path) -> None:
    found, rng = robots(tmp_path, 2, 12)
    for robot in found:
        n = len(robot.coordinates)
        for size in (1e-3, 0.1, 2.0):
            ends = rng.uniform(-1, 1, (1, n)) + np.array([[0.0], [1.0]]) * rng.uniform(-size, size, (1, n))
            trajectory = as_trajectory(ends, robot.coordinates)
            a, b = np.sort(rng.uniform(0, 1, 2))
            for family in families(robot, tuple(robot.boundaries), *trajectory.extent):
                m = len(family.names)
                if not m:
                    continue
                part = trajectory.expand(np.zeros(1, np.intp), np.array([a]), np.array([b]))
                found_here = family.enclose(np.arange(m), part, np.zeros(m, np.intp))
                u = np.linspace(a, b, 2001)[:, None]
                signed = family.signed(ends[0] + u * (ends[1] - ends[0]))
                assert np.all(found_here.lower <= signed.min(axis=0))
                middle = family.signed((ends[0] + 0.5 * (a + b) * (ends[1] - ends[0]))[None])[0]
                np.testing.assert_allclose(found_here.value, middle, atol=1e-13)


def test_second_order_bound_is_of_second_order(tmp_path: Path) -> None:
    found, rng = robots(tmp_path, 3, 10)
    for robot in found:
        chains = [boundary.path.minimal for boundary in robot.boundaries]
        n, m = len(robot.coordinates), len(robot.boundaries)
        packed = bounds.bundle(chains, n)
        start, step = rng.uniform(-1, 1, n), rng.uniform(-1, 1, n)
        gaps = []
        for size in (0.02, 0.01):
            trajectory = as_trajectory([start, start + size * step], robot.coordinates)
            arms = bounds.lever_arms(packed, *trajectory.extent)
            part = trajectory.expand(np.zeros(1, np.intp), np.zeros(1), np.ones(1)).take(np.zeros(m, np.intp))
            _, lower = bounds.along_motion(packed, arms, np.arange(m), part, np.zeros(m))
            u = np.linspace(0, 1, 2001)[:, None]
            gaps.append(robot.boundaries.norms(start + u * size * step).min(axis=0) - lower)
        assert np.all(gaps[1] <= 0.3 * gaps[0] + 1e-9)


def test_box_enclosures_hold(tmp_path: Path) -> None:
    found, rng = robots(tmp_path, 4, 12)
    for robot in found:
        n = len(robot.coordinates)
        for size in (1e-3, 0.1, 1.0):
            centre, half = rng.uniform(-1, 1, n), rng.uniform(0, size, n)
            for family in families(robot, tuple(robot.boundaries), centre - half, centre + half):
                m = len(family.names)
                if not m:
                    continue
                which = np.arange(m)
                box = family.enclose_box(which, np.tile(centre, (m, 1)), np.tile(half, (m, 1)))
                Q = centre + half * np.concatenate([rng.uniform(-1, 1, (500, n)), rng.choice([-1, 1], (500, n))])
                assert np.all(box.lower <= family.signed(Q).min(axis=0))


def test_rounding_bound_covers_reduction_and_evaluation_and_stays_small(tmp_path: Path) -> None:
    found, rng = robots(tmp_path, 5, 20)
    for robot in found:
        n = len(robot.coordinates)
        Q = rng.uniform(-6, 6, (50, n))
        chains = bounds.bundle([boundary.path.minimal for boundary in robot.boundaries], n)
        ends = [(b.ancestor, b.point_a.link, b.point_b.link) for b in robot.boundaries]
        walked = rounding.walks(robot.tree, robot.coupling, ends)
        error = rounding.rounding_bound(chains, walked, Q.min(axis=0), Q.max(axis=0))
        data = robot.model.createData()
        frames = {f.name: i for i, f in enumerate(robot.model.frames) if f.type == pinocchio.FrameType.BODY}
        for q, theta, norms in zip(Q, robot.coupling.expand(Q), robot.boundaries.norms(Q), strict=True):
            pinocchio.framesForwardKinematics(robot.model, data, theta)
            for row, boundary in enumerate(robot.boundaries):
                ends = [
                    data.oMf[frames[point.link]].act(np.array(point.xyz))
                    for point in (boundary.point_a, boundary.point_b)
                ]
                assert abs(np.linalg.norm(ends[0] - ends[1]) - norms[row]) <= error[row]
                assert q.shape == (n,)
        assert error.max() < 1e-10


@pytest.mark.parametrize("seed", range(3))
def test_extremes_of_one_angle(seed: int) -> None:
    rng = np.random.default_rng(seed)
    offsets = np.concatenate([rng.uniform(-1, 1, (2, 2)), rng.uniform(-0.1, 0.1, (2, 1))], axis=1)
    axis = np.array([[0.0, 0.0, 1.0]])
    chain = Chain(offsets, np.zeros((2, 3, 1)), axis, np.array([[1.0]]), 2.0)
    closed = bounds.one_angle([chain], 1)
    for _ in range(200):
        lower = rng.uniform(-20, 20)
        upper = lower + rng.choice([0.0, 1e-9, 0.3, 3.0, 7.0])
        phi = np.linspace(lower, upper, 4001)
        norms = numeric.norm(numeric.positions(chain, phi[:, None]))
        which = np.zeros(len(phi), np.intp)
        np.testing.assert_allclose(closed.norm(which, phi), norms, atol=1e-14)
        least, most = closed.extremes(which[:1], np.array([lower]), np.array([upper]))
        assert least[0] <= norms.min() + 1e-14
        assert most[0] >= norms.max() - 1e-14
        assert norms.min() - least[0] < 1e-5
        assert most[0] - norms.max() < 1e-5
