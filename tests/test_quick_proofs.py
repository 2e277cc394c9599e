"""Machine code and NumPy over the same boxes, and bounds of second order against samples."""

from __future__ import annotations

import numpy as np
import pytest

import pinbound as pb
from pinbound.certificates.search import Meter
from pinbound.freespace.draft import SHARE, Draft
from pinbound.freespace.pairs import Pairs
from pinbound.freespace.proving import Boxes, Prover
from pinbound.freespace.quick_proofs import ProofTables, Stack
from robots import ARM, robot_xml
from test_polytope import load, marks


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> pb.Robot:
    rng = np.random.default_rng(0)
    points = [(f"a{k}", "a", " ".join(map(str, rng.uniform(-0.2, 0.2, 3))), 0.01 * (k + 1)) for k in range(4)]
    points += [(f"d{k}", "d", " ".join(map(str, rng.uniform(0.3, 0.6, 3))), 0.005 * (k + 1)) for k in range(5)]
    pairs = [(f"a{i}", f"d{k}") for i in range(4) for k in range(5)]
    return load(robot_xml(ARM, {}, [], marks(points, pairs)), tmp_path_factory.mktemp("arm"))


@pytest.fixture(scope="module")
def pairs(robot: pb.Robot) -> Pairs:
    return Pairs(robot, list(robot.boundaries), robot.lower, robot.upper)


def test_bounds_of_second_order_hold_and_are_tighter_than_the_sum_of_all_angles(robot: pb.Robot, pairs: Pairs) -> None:
    rng, count = np.random.default_rng(1), 2000
    which = rng.integers(0, len(pairs), count)
    centre = rng.uniform(robot.lower, robot.upper, (count, 4))
    half = rng.uniform(0.0, 0.5, (count, 4)) * 10.0 ** rng.uniform(-3.0, 0.0, (count, 1))
    found = pairs.bound(which, centre, half)
    for _ in range(30):
        step = rng.uniform(-1.0, 1.0, (count, 4))
        step = np.where(rng.random((count, 4)) < 0.5, np.sign(step), step) * half
        value = pairs.signed(which, centre + step)
        affine = found.value + np.einsum("ni,ni->n", found.slope, step) - found.rest
        assert np.all(value >= found.lower - 1e-12)
        assert np.all(value <= found.upper + 1e-12)
        assert np.all(value >= affine - 1e-12)
    family = pairs.families[1]
    wide = np.matmul(np.abs(family.chains.coefficients[which]), half[:, :, None])[:, :, 0]
    square = np.diff(np.cumsum(wide, axis=1) ** 2, axis=1, prepend=0.0)
    first = 0.5 * np.einsum("nk,nk->n", family.arms[which], square)
    small = np.max(half, axis=1) < 0.1
    assert np.median(found.rest[small] / first[small]) < 0.5


def test_machine_code_clears_and_halves_as_numpy_does(robot: pb.Robot, pairs: Pairs) -> None:
    pytest.importorskip("llvmlite")
    rng, tables = np.random.default_rng(2), ProofTables(pairs)
    if not tables.is_ready(1_000_000, 1000.0):
        pytest.skip("no machine code on this machine")
    A = rng.normal(size=(5, 4))
    A /= np.linalg.norm(A, axis=1)[:, None]
    b, counts = np.full(5, 4.0), [0, 0, 0, 0]
    for _ in range(300):
        draft = Draft(pairs, robot.home, robot.lower, robot.upper, A, b, 0.1)
        prover = Prover(draft, Meter(pb.Budget(10**9, 1000.0)))
        node = int(rng.integers(0, len(pairs.groups.pair)))
        centre, half = 0.5 * rng.uniform(robot.lower, robot.upper), rng.uniform(0.0, 0.6, 4)
        box = Boxes(np.array([node]), (centre - half)[None], (centre + half)[None])
        stack = Stack(np.column_stack([box.which, box.low, box.high]))
        numbers = prover.unit, draft.margin, SHARE, 2.0**-40
        found = tables.run(stack, (A, b + prover.rounding()), (draft.seed, prover.farthest), numbers, 1)
        expected = prover._round(box)
        counts[len(expected) if not found.is_stopped else 3] += 1
        if found.is_stopped:
            assert np.array_equal(found.rows, stack.rows)
            continue
        assert not draft.source
        rows = np.column_stack([expected.which, expected.low, expected.high])
        assert sorted(map(tuple, found.rows.tolist())) == sorted(map(tuple, rows.tolist()))
    assert min(counts[0], counts[2]) > 20, counts


def test_a_polytope_is_proven_with_and_without_machine_code(robot: pb.Robot) -> None:
    found: list[pb.FreePolytope] = []
    for few in (0, 10**9):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("pinbound.freespace.proving._FEW", few)
            found.append(pb.certified_polytope(robot, robot.home, budget=pb.Budget(3_000_000, 300.0)))
    Q = np.random.default_rng(0).uniform(robot.lower, robot.upper, (100_000, 4))
    for one in found:
        assert one.verdict is pb.Verdict.CERTIFIED
        inside = Q[one.contains(Q)]
        assert len(inside) > 100
        assert np.all(robot.boundaries.free(inside))
