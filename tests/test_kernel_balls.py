"""Many spheres on few links: tables, clusters and float32 lanes give what the reference gives, and float64's sign."""

import importlib.util
import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import pinbound as pb
from pinbound.kernel import BallKernel, Kernel, UnionKernel, ball_kernel, balls, mixed
from pinbound.kernel.ball_tables import single_error

BACKENDS = [
    "numpy",
    pytest.param("compiled", marks=pytest.mark.skipif(not importlib.util.find_spec("numba"), reason="no Numba")),
]
COMPILED = BACKENDS[1]
NUMBA = pytest.mark.skipif(not importlib.util.find_spec("numba"), reason="no Numba")

JOINTS = (
    ("q1", "revolute", "base", "a", "0 0 0.3", "0 0 0", "0 0 1", ""),
    ("q2", "revolute", "a", "b", "0.05 0 0.2", "0.2 0 0", "0 1 0", ""),
    ("q3", "continuous", "b", "c", "0.1 0 0.25", "0 0 0.4", "0.6 0 0.8", ""),
    ("q4", "prismatic", "c", "d", "0 0.05 0.1", "0 0.3 0", "0 0 1", ""),
    ("q5", "revolute", "d", "e", "0.1 0 0", "0 0 0", "0 -1 0", ""),
    ("tip", "revolute", "e", "f", "0.1 0 0.05", "0 0 0", "1 0 0", '<mimic joint="q5" multiplier="-0.5" offset="0.1"/>'),
    ("q6", "prismatic", "a", "g", "0.2 0.2 0", "0 0 0", "0 1 0", ""),
    ("held", "fixed", "f", "h", "0.02 0 0.03", "0 0 1", "0 0 1", ""),
)
LINKS = ("base", "a", "b", "c", "d", "e", "f", "g", "h")


def joint(name: str, kind: str, parent: str, child: str, xyz: str, rpy: str, axis: str, more: str) -> str:
    limit = "" if kind in ("continuous", "fixed") else '<limit lower="-2" upper="2.5" effort="1" velocity="1"/>'
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>{limit}{more}</joint>'
    )


def text(more: str = "", each: int = 4, seed: int = 3) -> str:
    """Return a robot of all kinds of joints with a few spheres on each link, and pairs of links that are not joined."""
    rng = np.random.default_rng(seed)
    points, pairs = list[str](), list[str]()
    for link in LINKS:
        for k in range(each if link != "b" else 2 * each):
            xyz = " ".join(f"{x:.3f}" for x in rng.uniform(-0.15, 0.15, 3))
            radius = rng.uniform(0.01, 0.04)
            points.append(f'<pinbound:point name="{link}{k}" link="{link}" xyz="{xyz}" radius="{radius:.3f}"/>')
    for i, first in enumerate(LINKS):
        for last in LINKS[i + 2 :]:
            if {first, last} not in ({"e", "h"}, {"f", "h"}):
                kept = [(x, y) for x in range(each) for y in range(each) if rng.uniform() < 0.6]
                pairs += [
                    f'<pinbound:boundary name="{first}{x}-{last}{y}" a="{first}{x}" b="{last}{y}" '
                    f'min_distance="{0.01 * ((x + y) % 2)}"/>'
                    for x, y in kept
                ]
    links = "".join(f'<link name="{link}"/>' for link in LINKS)
    joints = "".join(joint(*row) for row in JOINTS)
    return (
        f'<robot name="many" xmlns:pinbound="urn:pinbound:1">{links}{joints}'
        f"<pinbound:annotations>{''.join(points)}{''.join(pairs)}{more}</pinbound:annotations></robot>"
    )


@pytest.fixture(scope="module")
def robot() -> pb.Robot:
    return pb.load(text())


def rows(robot: pb.Robot, count: int, seed: int = 0) -> Any:
    return np.random.default_rng(seed).uniform(-2.0, 2.5, (count, len(robot.coordinates)))


def reference(robot: pb.Robot, Q: Any) -> Any:
    return np.stack([boundary.clearance(Q) for boundary in robot.boundaries], axis=1)


def test_many_points_are_one_tree_with_shared_nodes(robot: pb.Robot) -> None:
    kernel = robot.boundaries.kernel
    assert isinstance(kernel, BallKernel)
    assert len(robot.boundaries) > mixed.MANY_POINTS
    tree = kernel.tree
    assert len(tree.nodes) <= 10  # the root, one a moving joint, two for slides at the end of a chain
    assert sum(len(cluster.balls) for cluster in tree.clusters) == len(tree.balls)
    for cluster in (*tree.clusters, *tree.bodies):
        far = [np.linalg.norm(tree.balls[ball][1] - cluster.middle) for ball in cluster.balls]
        assert max(far) <= cluster.radius


@pytest.mark.parametrize("backend", BACKENDS)
def test_all_answers_equal_the_reference(robot: pb.Robot, backend: Any) -> None:
    B, Q = robot.boundaries, rows(robot, 701)
    expected = reference(robot, Q)
    assert np.allclose(B.clearances(Q, backend=backend), expected, rtol=0, atol=4e-15)
    assert np.allclose(B.signed_clearances(Q, backend=backend), expected, rtol=0, atol=4e-15)
    thresholds = np.array([boundary.threshold for boundary in B])
    assert np.allclose(B.norms(Q, backend=backend), expected + thresholds, rtol=0, atol=4e-15)
    found = B.smallest(Q, backend=backend)
    assert np.allclose(found.clearance, expected.min(axis=1), rtol=0, atol=4e-15)
    assert np.allclose(expected[np.arange(len(Q)), found.index], expected.min(axis=1), rtol=0, atol=8e-15)
    assert 0.02 < np.mean(expected.min(axis=1) > 0.0) < 0.98
    assert np.array_equal(B.free(Q, backend=backend, limits=False), expected.min(axis=1) > 0.0)
    few = Q[:40]
    slopes = np.stack([boundary.gradient(few) for boundary in B], axis=1)
    assert np.allclose(B.gradients(few, backend=backend), slopes, rtol=1e-11, atol=1e-13)
    single = B.gradients(few, backend=backend, dtype=np.float32)
    assert single.dtype == np.float32
    assert np.allclose(single, slopes, rtol=1e-5, atol=3e-6)
    assert np.allclose([B.clearances(q) for q in few], expected[:40], rtol=0, atol=4e-15)
    assert [B.free(q, limits=False) for q in few] == (expected[:40].min(axis=1) > 0.0).tolist()
    assert np.allclose(B.clearances(few, backend=backend, dtype=np.float32), expected[:40], atol=3e-6)


@pytest.mark.parametrize("few", [1, 10**6])
def test_numpy_takes_rows_and_pairs_in_parts(robot: pb.Robot, few: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(balls, "_ROWS", 7)
    monkeypatch.setattr(balls, "_PART_BYTES", 8 * 3 * 7 * 11)  # 11 pairs at a time, of more than a hundred
    monkeypatch.setattr(balls, "_FEW_ROWS", few)
    Q = rows(robot, 20)
    found = robot.boundaries.kernel.rows(Q, "clearances", backend="numpy")
    np.testing.assert_allclose(found, reference(robot, Q), rtol=1e-12, atol=4e-15)
    assert np.array_equal(robot.boundaries.free(Q, limits=False, backend="numpy"), np.all(found > 0.0, axis=1))


@pytest.mark.parametrize("backend", BACKENDS)
def test_rows_that_are_no_numbers_or_far_away_are_the_references(robot: pb.Robot, backend: Any) -> None:
    B, Q = robot.boundaries, rows(robot, 40)
    Q[3, 0], Q[9, 3], Q[11, 2] = np.nan, np.inf, -np.inf
    Q[15, 2], Q[16, 2], Q[20, 3], Q[21, 5] = 2e5, 3e3, 2e3, -5.0
    expected = reference(robot, Q)
    far = Q[:, 2] > 1e5
    for found in (B.clearances(Q, backend=backend), B.signed_clearances(Q, backend=backend)):
        assert np.array_equal(np.isnan(found), np.isnan(expected))
        assert np.allclose(found[~far], expected[~far], rtol=1e-11, atol=1e-12, equal_nan=True)
    least = expected.min(axis=1)
    found = B.smallest(Q, backend=backend)
    assert np.array_equal(np.isnan(found.clearance), np.isnan(least))
    assert np.array_equal(found.index == -1, np.isnan(least))
    assert np.allclose(found.clearance[~far], least[~far], rtol=1e-11, atol=1e-12, equal_nan=True)
    assert np.array_equal(B.free(Q, backend=backend, limits=False), least > 0.0)
    assert not B.free(Q[3], limits=False)


def near_contact(kernel: Any, Q: Any, seed: int, steps: int = 22) -> Any:
    """Return rows on both sides of a contact each, as near as `steps` halvings bring them."""
    low, high = Q, Q + np.random.default_rng(seed).uniform(-1, 1, Q.shape)
    first = kernel.smallest(low, backend="compiled")[0] > 0.0
    which = first != (kernel.smallest(high, backend="compiled")[0] > 0.0)
    low, high, first = low[which], high[which], first[which]
    for _ in range(steps):
        middle = 0.5 * (low + high)
        same = (kernel.smallest(middle, backend="compiled")[0] > 0.0) == first
        low, high = np.where(same[:, None], middle, low), np.where(same[:, None], high, middle)
    return np.concatenate((low, high))


@NUMBA
def test_free_is_the_sign_of_float64(robot: pb.Robot) -> None:
    """`python -m benchmarks.spheres --check` does it for as many rows as one likes."""
    kernel = robot.boundaries.kernel
    assert isinstance(kernel, BallKernel)
    Q = near_contact(kernel, rows(robot, 6000, seed=5), seed=6)
    rng, undecided = np.random.default_rng(7), 0
    bound = 4.0 * single_error(kernel.tree, kernel._most("free"))
    for size in (1e-7, 1e-6, bound, 4.0 * bound, 0.1):
        for _ in range(4):
            some = Q + rng.uniform(-size, size, Q.shape)
            least = kernel.smallest(some, backend="compiled")[0]
            assert np.array_equal(kernel.free(some, backend="compiled"), least > 0.0)
            undecided += np.count_nonzero(np.abs(least) < 1e-6)
    assert undecided > 1000


@NUMBA
def test_the_bound_of_float32_is_needed_and_holds(robot: pb.Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    """With no bound float32 decides wrongly near contact; with it few rows are asked again."""
    kernel = robot.boundaries.kernel
    Q = near_contact(kernel, rows(robot, 6000, seed=8), seed=9)
    least = kernel.smallest(Q, backend="compiled")[0]
    for factors, is_right in (((0.0, 0.0), False), ((80.0, 100.0), True)):
        for name, factor in zip(("_ERRORS", "_SQUARES"), factors, strict=True):
            monkeypatch.setattr(f"pinbound.kernel.ball_tables.{name}", factor)
        again = pickle.loads(pickle.dumps(kernel))
        assert np.array_equal(again.free(Q, backend="compiled"), least > 0.0) == is_right
    asked: list[int] = []
    smallest = Kernel.smallest

    def counted(self: Any, some: Any, *more: Any) -> Any:
        asked.append(len(some))
        return smallest(self, some, *more)

    monkeypatch.setattr(Kernel, "smallest", counted)
    kernel.free(rows(robot, 20_000, seed=10), backend="compiled")
    assert sum(asked) < 1000


@pytest.mark.parametrize("backend", BACKENDS)
def test_joint_limits_are_compared_to_the_last_digit(robot: pb.Robot, backend: Any) -> None:
    B, Q = robot.boundaries, rows(robot, 3000)
    ends = np.array([robot.lower, robot.upper])
    rng = np.random.default_rng(1)
    for j in np.flatnonzero(np.isfinite(ends[0])):
        end = ends[rng.integers(0, 2, len(Q)), j] + rng.choice([-1.5e-12, -1e-12, 0.0, 1e-12, 1.5e-12], len(Q))
        some = rng.uniform(size=len(Q)) < 0.2
        Q[some, j] = (end + rng.integers(-2, 3, len(Q)) * np.spacing(end))[some]
    expected = (reference(robot, Q).min(axis=1) > 0.0) & B.signed_kernel._within.hold(Q)
    assert 0 < np.count_nonzero(expected) < np.count_nonzero(B.free(Q, limits=False, backend=backend))
    assert np.array_equal(B.free(Q, backend=backend), expected)


@NUMBA
def test_bits_depend_neither_on_threads_nor_on_neighbours(robot: pb.Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ball_kernel, "_LEAST_ROWS", 64)
    B, Q = robot.boundaries, rows(robot, 5003)
    whole = B.clearances(Q, backend="compiled"), B.smallest(Q, backend="compiled"), B.free(Q, backend="compiled")
    for part in (slice(0, 1), slice(7, 30), slice(777, 1904), slice(4990, None)):
        assert np.array_equal(B.clearances(Q[part], backend="compiled"), whole[0][part])
        found = B.smallest(Q[part], backend="compiled")
        assert np.array_equal(found.clearance, whole[1].clearance[part])
        assert np.array_equal(found.index, whole[1].index[part])
        assert np.array_equal(B.free(Q[part], backend="compiled"), whole[2][part])
    assert np.array_equal(B.clearances(Q, backend="compiled", threads=3), whole[0])
    assert np.array_equal(B.free(Q, backend="compiled", threads=3), whole[2])
    out = np.full((len(Q), len(B)), np.nan, order="C")
    assert np.array_equal(B.clearances(Q, out, backend="compiled"), whole[0])
    wide = np.full((len(Q), 3), np.nan)
    B.smallest(Q, wide[:, 1], backend="compiled")
    assert np.array_equal(wide[:, 1], whole[1].clearance)
    assert np.all(np.isnan(wide[:, [0, 2]]))
    strided = np.repeat(Q, 2, axis=0)[::2]
    assert np.array_equal(B.free(strided, backend="compiled"), whole[2])


@pytest.mark.parametrize("backend", BACKENDS)
def test_the_gradient_of_a_zero_norm_is_no_number(robot: pb.Robot, backend: Any) -> None:
    known = robot.boundaries.kernel
    assert isinstance(known, BallKernel)
    ends = known.tree.ends.copy()
    ends[3] = ends[3, 0]  # a ball and itself
    kernel = BallKernel(known.pairs, known.n, known.reference, lambda: None, replace(known.tree, ends=ends))
    found = kernel.rows(rows(robot, 20), "gradients", backend=backend)
    assert np.all(np.isnan(found[:, 3]))
    assert not np.any(np.isnan(np.delete(found, 3, axis=1)))


def test_a_set_survives_pickling(robot: pb.Robot) -> None:
    Q, kernel = rows(robot, 50), robot.boundaries.kernel
    again = pickle.loads(pickle.dumps(kernel))
    assert np.array_equal(again.rows(Q, "clearances", backend="numpy"), kernel.rows(Q, "clearances", backend="numpy"))
    assert np.allclose(again.rows(Q, "gradients", backend="numpy"), kernel.rows(Q, "gradients", backend="numpy"))


MORE = """
  <pinbound:segment name="bar" link="d" xyz_a="0 0 0" xyz_b="0.2 0.1 0" radius="0.02"/>
  <pinbound:plane name="floor" link="base" xyz="0 0 -0.4" normal="0 0 1"/>
  <pinbound:hull name="cover" link="f" vertices="0 0 0  0.1 0 0  0 0.1 0  0 0 0.1" radius="0.01"/>
  <pinbound:point name="stop_a" link="base" xyz="0.1 0 0.3"/>
  <pinbound:point name="stop_b" link="a" xyz="-0.06 0.08 0"/>
  <pinbound:boundary name="bar-base" a="base0" b="bar"/>
  <pinbound:boundary name="tip-floor" a="h0" b="floor"/>
  <pinbound:boundary name="cover-base" a="cover" b="base1"/>
  <pinbound:boundary name="end" a="stop_a" b="stop_b" stop="true"/>
"""


@pytest.mark.parametrize("backend", BACKENDS)
def test_mixed_robots_are_put_together(backend: Any) -> None:
    robot = pb.load(text(MORE, each=3))
    B, Q = robot.boundaries, rows(robot, 400)
    kernel = B.signed_kernel.kernel
    assert isinstance(kernel, mixed.MixedKernel)
    assert isinstance(kernel.kernel, UnionKernel)
    expected = np.stack([boundary.signed_clearance(Q) for boundary in B], axis=1)
    assert np.allclose(B.signed_clearances(Q, backend=backend), expected, rtol=0, atol=1e-12)
    found = B.smallest(Q, backend=backend)
    assert np.allclose(found.clearance, expected.min(axis=1), rtol=0, atol=1e-12)
    assert np.allclose(expected[np.arange(len(Q)), found.index], found.clearance, rtol=0, atol=1e-12)
    within = B.signed_kernel._within.hold(Q)
    assert np.array_equal(B.free(Q, limits=False, backend=backend), np.all(expected > 0.0, axis=1))
    assert np.array_equal(B.free(Q, backend=backend), np.all(expected > 0.0, axis=1) & within)
    slopes = np.stack([boundary.signed_gradient(Q[:30]) for boundary in B], axis=1)
    assert np.allclose(B.signed_gradients(Q[:30], backend=backend), slopes, atol=1e-9)
    q = Q[int(np.argmax(expected.min(axis=1)))]
    assert B.free(q, limits=False) == bool(np.all(B.signed_clearances(q) > 0.0))
    assert np.allclose(B.norms(q), [boundary.norm(q) for boundary in B], rtol=1e-12, atol=1e-14)


def test_paths_whose_squares_overflow_float32_are_no_tables() -> None:
    robot = pb.load(text().replace('xyz="0.1 0 0.25"', 'xyz="3e19 0 0.25"'))
    kernel = robot.boundaries.kernel
    assert type(kernel) is Kernel
    Q = rows(robot, 20)
    assert np.array_equal(robot.boundaries.free(Q, limits=False), reference(robot, Q).min(axis=1) > 0.0)
