"""Boxes of configurations in machine code: its answers against samples, and against the search in NumPy."""

import dataclasses

import numpy as np
import pytest

import pinbound as pb
from pinbound.boundaries.boundary_set import BoundarySet
from pinbound.bounds.group_boxes import search_box
from pinbound.certificates import boxes as boxes_module
from pinbound.certificates.kept import tables_of
from pinbound.certificates.records import OpenBox
from test_groups import crowd

pytest.importorskip("numba")


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> pb.Robot:
    return crowd(np.random.default_rng(12), tmp_path_factory.mktemp("crowd"), "spatial", 4, 24)


def with_gap(robot: pb.Robot, gap: float) -> pb.Robot:
    """Return the robot with distances such that each pair is `gap` from contact at zero."""
    value = robot.boundaries.signed_clearances(np.zeros(len(robot.coordinates)))
    changed = [
        dataclasses.replace(one, min_distance=max(one.min_distance + float(v) - gap, 0.0))
        for one, v in zip(robot.boundaries, value, strict=True)
    ]
    return dataclasses.replace(robot, boundaries=BoundarySet(changed, robot.coordinates, robot.linear_limits))


def test_verdicts_are_those_of_numpy_and_bounds_hold(robot: pb.Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    rng, seen = np.random.default_rng(3), set[pb.Verdict]()
    tight = with_gap(robot, 0.01)
    for half in (0.001, 0.01, 0.02, 0.05, 0.3):
        centre = 0.1 * half * rng.normal(size=len(robot.coordinates))
        found: list[pb.BoxCertificate] = []
        for quick in (True, False):
            monkeypatch.setattr(boxes_module, "is_worth", lambda *_, quick=quick: quick)
            budget = pb.Budget(boxes=60_000)
            found.append(pb.certify_box(tight, centre - half, centre + half, budget=budget, limits=False))
        quick_one, slow = found
        assert quick_one.verdict is slow.verdict
        seen.add(slow.verdict)
        Q = centre + half * rng.uniform(-1, 1, (500, len(centre)))
        values = tight.boundaries.signed_clearances(Q)
        if quick_one.verdict is pb.Verdict.CERTIFIED:
            assert quick_one.lower <= values.min() + 1e-12
            assert quick_one.lower > 0.0
            assert quick_one.upper <= slow.upper + 1e-9
        if quick_one.witness is not None:
            assert np.all(np.abs(quick_one.witness - centre) <= half + 1e-15)
            assert tight.boundaries[str(quick_one.violated)].signed_clearance(quick_one.witness) < 0.0
    assert seen >= {pb.Verdict.CERTIFIED, pb.Verdict.VIOLATED}


def test_every_q_is_clear_or_in_an_open_box(robot: pb.Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(boxes_module, "is_worth", lambda *_: True)
    tight = with_gap(robot, 0.01)
    n = len(robot.coordinates)
    rng = np.random.default_rng(4)
    for boxes in (1, 200, 1_000):
        found = pb.certify_box(tight, np.full(n, -0.02), np.full(n, 0.025), budget=pb.Budget(boxes=boxes), limits=False)
        if found.verdict is not pb.Verdict.UNDECIDED:
            continue
        assert all(isinstance(box, OpenBox) for box in found.open_boxes[:3])
        assert found.lower == -np.inf
        opened: dict[str, list[OpenBox]] = {}
        for box in found.open_boxes:
            opened.setdefault(box.name, []).append(box)
        Q = rng.uniform(-0.02, 0.025, (200, n))
        values = tight.boundaries.signed_clearances(Q)
        for name, column in zip(tight.boundaries.names, values.T, strict=True):
            for q in Q[column <= 0.0]:
                assert any(np.all((box.lower_corner <= q) & (q <= box.upper_corner)) for box in opened.get(name, []))


def test_open_boxes_of_a_pair_tile_what_is_left(robot: pb.Robot) -> None:
    """The queue holds each part of the box once: shares of volume never exceed one a pair."""
    tight = with_gap(robot, 1e-4)
    groups = tables_of(tight, tuple(tight.boundaries)).groups
    assert groups is not None
    n = len(robot.coordinates)
    weights = np.ones((len(tight.boundaries), n))
    found = search_box(groups, weights, np.full(n, -0.01), np.full(n, 0.01), 3_000.0)
    pairs, start, width = found.open
    if found.witness is None:
        assert len(pairs)
        shares = np.bincount(pairs, np.prod(width, axis=1))
        assert shares.max() <= 1.0
        assert np.all(start + width <= 1.0)
        assert len(np.unique(np.column_stack((pairs, start)), axis=0)) == len(pairs)
