"""Machine code of the search for nearest points of hulls: what the reference says, and what brute force says."""

import pickle
from itertools import combinations
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

import pinbound as pb
from pinbound.kernel import Pair, hulls
from pinbound.path.chain import Chain, HullChain

ROBOT = """<robot name="arm" xmlns:pinbound="https://pinbound.dev/1">
  <link name="base"/><link name="upper"/><link name="fore"/><link name="slide"/><link name="other"/>
  <joint name="q1" type="revolute"><parent link="base"/><child link="upper"/><origin xyz="0 0.1 0.2" rpy="0.3 0 0"/>
    <axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <joint name="q2" type="revolute"><parent link="upper"/><child link="fore"/><origin xyz="0.5 0 0.1" rpy="0 0.7 0.2"/>
    <axis xyz="0 0.6 0.8"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <joint name="q3" type="prismatic"><parent link="fore"/><child link="slide"/><origin xyz="0.3 0 0" rpy="0.1 0 1"/>
    <axis xyz="0 1 0"/><limit lower="-0.3" upper="0.3" effort="1" velocity="1"/></joint>
  <joint name="q4" type="revolute"><parent link="base"/><child link="other"/><origin xyz="-0.4 0 0" rpy="1 0 0"/>
    <axis xyz="1 0 0"/><limit lower="-3" upper="3" effort="1" velocity="1"/>
    <mimic joint="q1" multiplier="-0.5"/></joint>
</robot>
"""


def cloud(seed: int, count: int, at: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> tuple[tuple[float, ...], ...]:
    points = np.array(at) + 0.06 * np.random.default_rng(seed).normal(size=(count, 3))
    return tuple(map(tuple, points.tolist()))


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> pb.Robot:
    marks = [
        pb.Hull("rock", "base", cloud(1, 30, (0.0, -0.42, 0.15))),
        pb.Hull("plate", "upper", tuple((x, y, 0.02) for x, y, _ in cloud(2, 9)), 0.01),
        pb.Hull("stone", "fore", cloud(3, 500)),
        pb.Box("box", "slide", (0.3, 0.0, 0.0), (0.1, 0.2, 0.3), (0.1, 0.2, 0.3)),
        pb.Hull("tetrahedron", "other", cloud(4, 4, (-0.3, 0.0, 0.0))),
        pb.Cylinder("can", "slide", (0.0, 0.0, 0.0), (0.0, 0.3, 0.1), 0.05),
        pb.Sweep("prism", "fore", (0.1, 0.1, 0.1), ((0.2, 0, 0), (0, 0.1, 0), (0, 0, 0.1), (0.05, 0.05, 0.0))),
        pb.Point("tip", "slide", (0.0, 0.1, 0.2), 0.02),
        pb.Segment("rod", "other", (-0.1, 0.0, 0.0), (-0.3, 0.2, 0.1), 0.02),
        pb.Line("wall", "base", (-0.5, 1.0, 0.0), (0.0, 1.0, 2.0), 0.01),
        pb.Plane("floor", "base", (0.0, 0.0, -0.5), (0.1, 0.0, 1.0)),
    ]
    pairs = [
        ("rock", "stone"), ("rock", "box"), ("plate", "box"), ("tetrahedron", "stone"), ("can", "rock"),
        ("prism", "tetrahedron"), ("tip", "rock"), ("stone", "rod"), ("tip", "rod"), ("wall", "stone"),
        ("box", "wall"), ("floor", "stone"), ("can", "floor"), ("plate", "floor"), ("rod", "can"), ("prism", "rock"),
    ]  # fmt: skip
    boundaries = [pb.BoundaryMark(f"{a}_{b}", a, b, 0.002 * k) for k, (a, b) in enumerate(pairs)]
    path = tmp_path_factory.mktemp("arm") / "arm.urdf"
    path.write_text(ROBOT)
    return pb.load(path, annotations=pb.Annotations.of(marks, boundaries))


@pytest.fixture(scope="module")
def Q(robot: pb.Robot) -> np.ndarray:
    return np.random.default_rng(0).uniform(robot.lower, robot.upper, (150, len(robot.coordinates)))


def test_machine_code_gives_what_the_reference_gives(robot: pb.Robot, Q: np.ndarray) -> None:
    B = robot.boundaries
    assert B.kernel._hulls is not None
    assert len(B.kernel.searched) == len(B) - 1  # all but point against segment
    want = B.norms(Q, backend="numpy")
    assert np.min(want[:, 0]) == 0.0 < np.max(want[:, 0])
    np.testing.assert_allclose(B.norms(Q, backend="compiled"), want, rtol=0.0, atol=2e-14)
    np.testing.assert_allclose(
        B.clearances(Q, backend="compiled"), want - np.array([b.threshold for b in B]), rtol=0.0, atol=2e-14
    )
    alone = np.stack([b.norm(Q) for b in B], axis=1)
    np.testing.assert_allclose(want, alone, rtol=0.0, atol=2e-14)


def test_gradients_are_those_of_differences(robot: pb.Robot, Q: np.ndarray) -> None:
    B, step = robot.boundaries, 1e-6
    found = B.gradients(Q, backend="compiled")
    norms = B.norms(Q, backend="compiled")
    for j in range(Q.shape[1]):
        move = np.zeros(Q.shape[1])
        move[j] = step
        up, down = B.norms(Q + move, backend="compiled"), B.norms(Q - move, backend="compiled")
        smooth = np.abs(up + down - 2.0 * norms) < 1e-10  # no switch of nearest features within the step
        smooth &= (norms > 0.0) | (norms < 0.0)
        assert np.count_nonzero(smooth) > 0.8 * smooth.size
        np.testing.assert_allclose(found[:, :, j][smooth], ((up - down) / (2.0 * step))[smooth], rtol=0.0, atol=2e-4)
    overlapping = norms[:, 0] == 0.0
    assert np.all(np.isnan(found[overlapping, 0]))
    assert not np.any(np.isnan(found[~overlapping, 0]))


def test_the_smallest_clearance_is_the_least_of_all(robot: pb.Robot, Q: np.ndarray) -> None:
    B = robot.boundaries
    clearances = B.signed_clearances(Q, backend="compiled")
    for backend in ("compiled", "numpy"):
        found = B.smallest(Q, backend=backend)
        np.testing.assert_allclose(found.clearance, clearances.min(axis=1), rtol=0.0, atol=2e-14)
        taken = clearances[np.arange(len(Q)), found.index]
        np.testing.assert_allclose(taken, clearances.min(axis=1), rtol=0.0, atol=4e-14)
    np.testing.assert_array_equal(B.free(Q, limits=False, backend="compiled"), np.all(clearances > 0.0, axis=1))


def test_bits_depend_neither_on_threads_nor_on_neighbours(robot: pb.Robot, Q: np.ndarray) -> None:
    B = robot.boundaries
    want = B.norms(Q, backend="compiled")
    np.testing.assert_array_equal(B.norms(Q, backend="compiled", threads=3), want)
    np.testing.assert_array_equal(B.norms(Q[7:8], backend="compiled"), want[7:8])
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(B.kernel)).rows(Q, "norms", backend="compiled"), want)
    single = B.norms(Q, backend="compiled", dtype=np.float32)
    assert single.dtype == np.float32
    np.testing.assert_allclose(single[:, B.kernel.searched], want[:, B.kernel.searched], rtol=1e-6, atol=1e-7)


def test_rows_that_are_not_finite_stay_with_their_boundaries(robot: pb.Robot, Q: np.ndarray) -> None:
    B, rows = robot.boundaries, Q[:4].copy()
    rows[1, 0], rows[2, 2], rows[3, 2] = np.nan, np.inf, 1e200
    with np.errstate(over="ignore", invalid="ignore"):
        want = np.stack([b.norm(rows) for b in B], axis=1)
    np.testing.assert_allclose(B.norms(rows, backend="compiled"), want, rtol=0.0, atol=2e-14)
    assert np.all(np.isnan(want[2, [1, 2]]))
    assert np.all(np.isfinite(want[2, [0, 3]]))
    found = B.smallest(rows, backend="compiled")
    assert found.index[0] >= 0
    assert found.index[1:].tolist() == [-1, -1, -1]
    assert np.array_equal(
        np.isnan(B.gradients(rows, backend="compiled")[1, :, 0]), np.isnan(B.gradients(rows)[1, :, 0])
    )


def least_by_brute_force(w: np.ndarray, A: np.ndarray, B: np.ndarray) -> float:
    """The least |w + a - b| over two hulls, among all vertices, edges and triangles of the sums, in long double."""
    points = (w + A[:, None] - B[None]).reshape(-1, 3).astype(np.longdouble)
    best = np.min(np.sum(points**2, axis=1))
    if len(points) > 1:
        first, second = np.array(list(combinations(range(len(points)), 2))).T
        a, along = points[first], points[second] - points[first]
        square = np.sum(along**2, axis=1)
        t = np.clip(-np.sum(a * along, axis=1) / np.where(square > 0, square, 1), 0, 1)
        best = min(best, np.min(np.sum((a + t[:, None] * along) ** 2, axis=1)))
    if len(points) > 2:
        corners = np.array(list(combinations(range(len(points)), 3)))
        a = points[corners[:, 0]]
        b, c = points[corners[:, 1]] - a, points[corners[:, 2]] - a
        n = np.cross(b, c)
        square = np.sum(n**2, axis=1)
        safe = np.where(square > 0, square, 1)
        s, t = np.sum(np.cross(c, a) * n, axis=1) / safe, np.sum(np.cross(a, b) * n, axis=1) / safe
        held = (square > 0) & (s >= 0) & (t >= 0) & (s + t <= 1)
        r = a + s[:, None] * b + t[:, None] * c
        best = min(best, np.min(np.sum(r[held] ** 2, axis=1), initial=np.inf))
    return float(np.sqrt(best))


def two_bodies(w: np.ndarray, A: np.ndarray, B: np.ndarray) -> Pair:
    """Two hulls that nothing moves, w between their frames."""
    scale = float(np.linalg.norm(w) + np.abs(A).max() + np.abs(B).max())
    chain = Chain(w[None].copy(), np.zeros((1, 3, 1)), np.zeros((0, 3)), np.zeros((0, 1)), scale)
    directions = tuple(np.array([sign * axis]) for sign in (1.0, -1.0) for axis in np.eye(3))
    path = SimpleNamespace(minimal=chain, difference=HullChain(chain, directions, (A, B)), projection=None)
    return Pair(cast(Any, path), 0.0, ("A", "B"))


@pytest.mark.parametrize("seed", range(2))
def test_flat_sliver_and_touching_bodies_are_right_by_brute_force(seed: int) -> None:
    rng, cases = np.random.default_rng(seed), []
    for _ in range(40):
        A, B = (rng.normal(size=(rng.integers(4, 6), 3)) for _ in range(2))
        kind = rng.integers(5)
        if kind == 0:
            A[:, 2] = B[:, 2] = 0.0  # in one plane, or in parallel ones
        elif kind == 1:
            A, B = np.round(2.0 * A) / 2.0, np.round(2.0 * B) / 2.0  # faces and edges parallel
        elif kind == 2:
            A *= [1.0, 1.0, 1e-6]  # slivers
            B *= [1.0, 1e-5, 1e-6]
        w = 3.0 * rng.normal(size=3)
        if rng.integers(3) == 0:
            w = B[0] - A[0]  # touching, or overlapping
        cases.append((w, A, B))
    tables = hulls.tables_of([two_bodies(*case) for case in cases], 1)
    assert tables is not None
    found = np.empty((1, len(cases)))
    tables.run(np.zeros((1, 1)), "norms", found, np.empty(1, dtype=np.int64))
    for value, (w, A, B) in zip(found[0].tolist(), cases, strict=True):
        want = least_by_brute_force(w, A, B)
        size = np.abs(A).max() + np.abs(B).max() + np.linalg.norm(w)
        if value:
            assert abs(value - want) <= 1e-13 * size
        elif want > 1e-13 * size:  # brute force knows the distance to the surface alone
            along = np.linspace(0.0, 2.0 * np.pi, 400)
            z = np.linspace(-1.0, 1.0, 200)[:, None]
            n = np.stack((np.sqrt(1 - z**2) * np.cos(along), np.sqrt(1 - z**2) * np.sin(along), z + 0 * along), axis=-1)
            below = n @ w + np.min(n @ A.T, axis=-1) - np.max(n @ B.T, axis=-1)
            assert np.max(below) <= 1e-12 * size  # no direction separates the bodies


def test_placements_are_shared_between_pairs(robot: pb.Robot) -> None:
    tables = robot.boundaries.kernel._hulls
    nodes = int(tables.numbers[4]) - 1
    rotations = sum(robot.boundaries[int(k)].path.minimal.rotations for k in robot.boundaries.kernel.searched)
    assert 2 * nodes < rotations


def test_a_body_that_is_not_rigid_in_one_block_is_left_to_the_reference(robot: pb.Robot) -> None:
    pair = robot.boundaries.kernel.pairs[0]
    chain = pair.path.minimal
    block, edges = hulls._one_block(chain, pair.path.difference.directions[:3])
    assert block in (0, chain.rotations)
    np.testing.assert_allclose(edges.T @ edges, np.eye(3), atol=1e-14)
    spread = [np.ones_like(way) for way in pair.path.difference.directions[:3]]
    assert hulls._one_block(chain, spread)[0] == -1


def test_code_that_runs_is_not_looked_for_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """Looking in the cache reads files: 18 ms, which one configuration at a time paid in each of its first calls."""
    hulls.prepare_hulls()
    monkeypatch.setattr(hulls, "is_kept", lambda source: pytest.fail("the cache was asked"))
    assert hulls.is_ready()
