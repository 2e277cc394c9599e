"""Pairs with coordinates held: bounds against samples, machine code against NumPy, and what the lists forget."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pinbound as pb
from pinbound.certificates.search import Meter
from pinbound.freespace.held import Decided, HeldPairs
from pinbound.freespace.paving import Paving
from robots import ARM, joint, robot_xml
from test_polytope import load, marks

AT = np.array([0.4, -0.3, 0.7, 0.2])
KEPT = np.array([1, 2, 3])


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> pb.Robot:
    """Spheres on all links, so that some pairs move with one, two or three of the last coordinates."""
    rng = np.random.default_rng(3)
    points, pairs = [], []
    for link, size in (("base", 0.3), ("a", 0.15), ("b", 0.2), ("c", 0.2), ("d", 0.3)):
        for k in range(3):
            points.append((f"{link}{k}", link, " ".join(map(str, rng.uniform(-size, size, 3))), 0.03 + 0.02 * k))
    for first, second in (("base", "b"), ("base", "d"), ("a", "c"), ("a", "d"), ("b", "d")):
        pairs += [(f"{first}{i}", f"{second}{k}") for i in range(3) for k in range(3)]
    text = robot_xml(ARM, {}, [], marks(points, pairs))
    return load(text, tmp_path_factory.mktemp("arm"))


def paving_of(robot: pb.Robot, at: np.ndarray = AT) -> tuple[Paving, HeldPairs]:
    paving = Paving(robot, list(robot.boundaries), KEPT, at, {}, Meter(pb.Budget(10**9, 1000.0)))
    held = HeldPairs(paving.pairs, KEPT, at, paving.low, paving.high, paving.beside)
    return paving, held


def boxes_of(paving: Paving, count: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    middle = rng.uniform(paving.low, paving.high, (count, len(paving.low)))
    half = rng.uniform(0.0, 0.6, middle.shape) * 10.0 ** rng.uniform(-3.0, 0.0, (count, 1))
    return np.stack([np.maximum(middle - half, paving.low), np.minimum(middle + half, paving.high)], axis=1)


def within(boxes: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    part = rng.random((len(boxes), boxes.shape[2]))
    part = np.where(rng.random(part.shape) < 0.5, np.round(part), part)
    Q = np.tile(AT, (len(boxes), 1))
    Q[:, KEPT] = boxes[:, 0] + part * (boxes[:, 1] - boxes[:, 0])
    return Q


def left_of(held: HeldPairs, found: Decided) -> np.ndarray:
    """Return which pairs (N, m) are still on each box's list, parts of groups too."""
    left = np.zeros((len(found.contact), len(held)), dtype=bool)
    for box, node in zip(*found.lists.rows(), strict=True):
        left[box, list(held.groups.members[node])] = True
    return left


def test_fewer_coordinates_and_larger_groups_with_the_same_clearances(robot: pb.Robot) -> None:
    paving, held = paving_of(robot)
    assert len(held) > 30
    assert max(family.chains.rotations for _, family in held.families) <= 3
    _, ahead = paving_of(robot, at=0.0 * AT)  # without a turn between them the base and link a are one body
    assert len(ahead.groups.roots) < len(paving.pairs.groups.roots)
    boxes = boxes_of(paving, 200, 1)
    Q = within(boxes, np.random.default_rng(0))
    nodes = np.tile(np.arange(len(held)), len(Q))
    wanted = robot.boundaries.select([paving.pairs.names[row] for row in held.rows]).signed_clearances(Q)
    centre = np.repeat(Q[:, KEPT], len(held), axis=0)
    found = held.bound_nodes(nodes, centre, np.zeros_like(centre))
    value, column = found.value.reshape(len(Q), -1), [paving.pairs.names[row] for row in held.rows]
    order = [robot.boundaries.select(column).names.index(name) for name in column]
    error = 2.0 * paving.pairs.families[1].error  # what rounding may do is taken off, no more and no less
    off = (wanted[:, order] - value) / error
    assert 0.9 < off.min() < off.max() < 1.1


@pytest.mark.parametrize("machine", [False, True])
def test_what_is_off_a_list_is_clear_all_over_the_box(robot: pb.Robot, machine: bool) -> None:
    paving, held = paving_of(robot)
    boxes = boxes_of(paving, 1500, 2)
    if machine and not is_ready():
        pytest.skip("no machine code on this machine")
    found = (held._quick if machine else held._slow)(boxes, held.first_lists(len(boxes)))
    left = left_of(held, found)
    names = [paving.pairs.names[row] for row in held.rows]
    chosen = robot.boundaries.select(names)
    order = [chosen.names.index(name) for name in names]
    rng, all_ = np.random.default_rng(4), np.arange(len(boxes))
    assert np.count_nonzero(found.contact) > 20
    assert np.count_nonzero(~left & ~found.contact[:, None]) > 1000
    for _ in range(20):
        signed = chosen.signed_clearances(within(boxes, rng))[:, order]
        assert np.all(signed[found.contact].min(axis=1) < 0.0)
        assert np.all((signed > 0.0) | left | found.contact[:, None])
    for box in all_[~found.contact & (found.lists.length > 0)][:50]:
        assert found.least[box] <= 0.0


def test_machine_code_decides_as_numpy_does(robot: pb.Robot) -> None:
    if not is_ready():
        pytest.skip("no machine code on this machine")
    paving, held = paving_of(robot)
    boxes = boxes_of(paving, 2000, 5)
    lists = held.first_lists(len(boxes))
    slow, quick = held._slow(boxes, lists), held._quick(boxes, lists)
    assert np.array_equal(slow.contact, quick.contact)
    is_open = ~slow.contact & (slow.lists.length > 0)
    assert np.count_nonzero(is_open) > 100
    assert np.array_equal(is_open, ~quick.contact & (quick.lists.length > 0))
    assert np.allclose(slow.least[is_open], quick.least[is_open], rtol=0.0, atol=1e-11)
    assert np.array_equal(slow.across[is_open], quick.across[is_open])
    assert np.array_equal(left_of(held, slow), left_of(held, quick))
    again = held._quick(boxes[is_open], quick.lists.take(is_open))  # lists of a round before
    assert np.array_equal(left_of(held, again), left_of(held, quick)[is_open])


def test_a_pair_whose_slide_is_held_turns_only_and_one_that_slides_is_left_to_all_coordinates(tmp_path: Path) -> None:
    joints = [
        joint("s", "prismatic", "base", "a", axis="1 0 0", limit="0 0.5"),
        joint("q1", "revolute", "a", "b", xyz="0 0 0.3"),
        joint("q2", "revolute", "b", "c", axis="1 0 0", xyz="0 0 0.3"),
    ]
    points = [("w", "base", "0.6 0 0.7", 0.1), ("v", "a", "0 0.4 0.5", 0.1), ("t", "c", "0 0.1 0.3", 0.05)]
    robot = load(robot_xml(joints, {}, [], marks(points, [("w", "t"), ("v", "t")])), tmp_path)
    rng = np.random.default_rng(0)
    for names, count in ((("q1", "q2"), 2), (("s", "q1", "q2"), 1)):
        at = np.array([0.45, 0.0, 0.0])
        axes = np.array([robot.coordinates.index(name) for name in names])
        paving = Paving(robot, list(robot.boundaries), axes, at, {}, Meter(pb.Budget(10**9, 60.0)))
        held = HeldPairs(paving.pairs, axes, at, paving.low, paving.high, paving.beside)
        assert len(held) == count
        found = pb.free_volume(robot, names, at=at, decided=0.97)
        assert found.decided >= 0.97
        boxes = found.free[rng.integers(0, len(found.free), 4000)]
        Q = np.tile(at, (4000, 1))
        Q[:, axes] = boxes[:, 0] + rng.random((4000, len(axes))) * (boxes[:, 1] - boxes[:, 0])
        assert np.all(robot.boundaries.free(Q))
        Q = np.tile(at, (20_000, 1))
        Q[:, axes] = rng.uniform(*found.box, (20_000, len(axes)))
        share = np.mean(robot.boundaries.free(Q))
        assert 0.005 < 1.0 - share
        assert found.lower / found.volume - 0.02 < share < found.upper / found.volume + 0.02


def is_ready() -> bool:
    """Return whether machine code can be had; it is compiled once, and kept."""
    pytest.importorskip("llvmlite")
    from pinbound.machine.compiled import compile_source, has_numba
    from pinbound.machine.paving_source import paving_source

    return has_numba() and compile_source(paving_source()) is not None


@pytest.mark.parametrize("names", [("j4", "j2", "j3"), ("j3", "j1", "j4", "j2")], ids=["held", "all"])
def test_coordinates_in_another_order_are_those_coordinates(robot: pb.Robot, names: tuple[str, ...]) -> None:
    few = [one.name for one in robot.boundaries if len(one.coordinates) == 2]
    assert len(few) > 10
    chosen = robot.boundaries.select(few)
    found = pb.free_volume(robot, names, AT, few, decided=0.95, budget=pb.Budget(200_000, 100.0))
    axes, rng = [robot.coordinates.index(name) for name in names], np.random.default_rng(0)
    assert found.lower > 0.5 * found.volume
    boxes = found.free[rng.integers(0, len(found.free), 4000)]
    Q = np.tile(AT, (4000, 1))
    Q[:, axes] = boxes[:, 0] + rng.random((4000, len(axes))) * (boxes[:, 1] - boxes[:, 0])
    assert np.all(chosen.free(Q))
    Q = np.tile(AT, (20_000, 1))
    Q[:, axes] = rng.uniform(*found.box, (20_000, len(axes)))
    assert found.lower / found.volume - 0.02 < np.mean(chosen.free(Q)) < found.upper / found.volume + 0.02


@pytest.mark.parametrize("machine", [False, True])
def test_contact_behind_a_group_is_proven(machine: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A stand-in that is in contact all over a box says nothing of it: the pair itself is asked."""
    joints = [
        joint("q1", "revolute", "base", "a", axis="0 1 0", xyz="0 0 0.2", limit="-1 1"),
        joint("q2", "revolute", "a", "b", axis="1 0 0", xyz="0 0 0.3", limit="-1 1"),
        joint("q3", "revolute", "b", "c", axis="0 0 1", xyz="0 0 0.1", limit="-3 3"),
    ]
    points = [("w", "base", "0.3 0.1 0.6", 0.2), ("t", "c", "1e-6 0 0.2", 0.05)]
    robot = load(robot_xml(joints, {}, [], marks(points, [("w", "t")])), tmp_path)
    if not machine:
        monkeypatch.setattr("pinbound.freespace.held.has_numba", lambda: False)
    found = pb.free_volume(robot, robot.coordinates, decided=0.98, budget=pb.Budget(20_000, 100.0))
    assert found.decided >= 0.98
    assert 0.1 < found.upper / found.volume < 0.95
