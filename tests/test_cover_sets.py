"""Covers: what is in them is free, the share is that of an exact area, files that are stale or damaged are refused."""

from __future__ import annotations

import contextlib
import json
from pathlib import Path

import numpy as np
import pytest

import pinbound as pb
from pinbound.certificates.records import Reason
from pinbound.certificates.search import Meter
from pinbound.freespace.cover import _free_samples, _interval, _polytopes
from pinbound.freespace.set_graph import SetGraph, connected, touching
from test_polytope import POST, load


@pytest.fixture(scope="module")
def post(tmp_path_factory: pytest.TempPathFactory) -> pb.Robot:
    return load(POST, tmp_path_factory.mktemp("post"))


@pytest.fixture(scope="module")
def cover(post: pb.Robot) -> pb.FreeCover:
    return pb.certified_cover(post, share=0.97, budget=pb.Budget(10**9, 300.0))


def test_a_cover_is_free_and_its_share_holds(post: pb.Robot, cover: pb.FreeCover) -> None:
    assert (cover.is_proven, cover.is_whole, cover.reason) == (True, True, None)
    Q = np.random.default_rng(3).uniform(post.lower, post.upper, (20_000, 2))
    inside, free = cover.contains(Q), post.boundaries.free(Q)
    assert not np.any(inside & ~free)
    share = np.count_nonzero(inside) / np.count_nonzero(free)
    spread = 4.0 * np.sqrt(0.03 * 0.97 / np.count_nonzero(free))
    assert cover.share[0] >= 0.97
    assert cover.share[0] - spread <= share <= cover.share[1] == 1.0


def test_polytopes_hold_all_that_rules_with_conditions_leave() -> None:
    robot = pb.load("palletizers/dobot_mg400")
    cover = pb.certified_cover(robot, limits_only=True, share=0.99)
    assert (cover.is_proven, len(cover.polytopes), cover.reason) == (False, 2, None)
    assert cover.share[0] >= 0.99
    Q = np.random.default_rng(1).uniform(robot.lower, robot.upper, (5000, 4))
    inside, kept = cover.contains(Q), robot.intervals.hold(Q)
    assert not np.any(inside & ~kept)
    assert np.count_nonzero(inside) > 0.98 * np.count_nonzero(kept)


def test_a_file_from_before_a_boundary_was_added_is_refused(post: pb.Robot, tmp_path: Path) -> None:
    """Its sets are free of the boundaries of that time only: they may hold contacts of the new one."""
    cover = pb.certified_cover(post, share=0.95)
    path, atlas = cover.save(tmp_path / "c.npz"), pb.pair_atlas(post, budget=pb.Budget(200, 1000.0))
    again = atlas.save(tmp_path / "a.npz")
    old = post.boundaries[0]
    more = post.with_annotations(
        pb.Annotations.of([], [pb.BoundaryMark("added", old.point_a.name, old.point_b.name, min_distance=0.3)])
    )
    Q = np.random.default_rng(4).uniform(post.lower, post.upper, (2000, 2))
    assert np.any(cover.contains(Q) & ~more.boundaries.free(Q))
    for load_file, file in ((pb.load_cover, path), (pb.load_atlas, again)):
        with pytest.raises(pb.InputError, match=r"not about 'added'.*or give boundaries=\("):
            load_file(more, file)
        assert load_file(more, file, post.boundaries.names).boundaries == post.boundaries.names
        with pytest.raises(pb.InputError, match="also about"):
            load_file(more, file, ())


def test_files_come_back_and_stale_or_damaged_ones_are_refused(
    post: pb.Robot, cover: pb.FreeCover, tmp_path: Path
) -> None:
    path = cover.save(tmp_path / "cover.npz")
    again = pb.load_cover(load(POST.replace("<robot ", "<!-- a comment --><robot "), tmp_path), path)
    Q = np.random.default_rng(4).uniform(post.lower, post.upper, (500, 2))
    assert np.array_equal(again.contains(Q), cover.contains(Q))
    assert (again.share.tolist(), again.digest, again.boundaries) == (
        cover.share.tolist(),
        cover.digest,
        cover.boundaries,
    )
    with pytest.raises(pb.InputError, match="limits or marks differ"):
        pb.load_cover(load(POST.replace('radius="0.1"', 'radius="0.10000000000000002"'), tmp_path), path)
    with pytest.raises(pb.InputError, match="limits or marks differ"):
        pb.load_cover(pb.load("minervabot_v3"), path)
    with np.load(path) as file:
        given = dict(file)
    given["boxes"] = given["boxes"].copy()
    given["boxes"][0, 1, 0] = np.nextafter(given["boxes"][0, 1, 0], np.inf)
    np.savez(tmp_path / "forged.npz", **given)
    with pytest.raises(pb.InputError, match="damaged"):
        pb.load_cover(post, tmp_path / "forged.npz")
    (tmp_path / "text.npz").write_text("no cover")
    with pytest.raises(pb.InputError, match="no cover"):
        pb.load_cover(post, tmp_path / "text.npz")
    given["header"] = np.array(json.dumps({}))
    del given["rows"]
    np.savez(tmp_path / "short.npz", **given)
    with pytest.raises(pb.InputError, match="no cover"):
        pb.load_cover(post, tmp_path / "short.npz")


def test_a_file_that_is_damaged_anywhere_is_read_as_it_was_or_refused(post: pb.Robot, tmp_path: Path) -> None:
    cover = pb.certified_cover(post, share=0.3, limits_only=True)
    path = cover.save(tmp_path / "cover.npz")
    whole = path.read_bytes()
    refused, places = 0, range(0, len(whole), 5)
    for place in places:
        damaged = bytearray(whole)
        damaged[place] ^= 1 << (place % 8)
        path.write_bytes(damaged)
        with contextlib.suppress(pb.InputError):
            refused += 1
            again = pb.load_cover(post, path)  # what is damaged may be a date, which nobody reads
            refused -= 1
            assert np.array_equal(again.boxes, cover.boxes)
    assert refused > len(places) // 2
    np.save(tmp_path / "array.npy", np.ones((2, 2)))
    with pytest.raises(pb.InputError, match="no cover"):
        pb.load_cover(post, tmp_path / "array.npy")
    with pytest.raises(FileNotFoundError):
        pb.load_cover(post, tmp_path / "missing.npz")


def test_a_polytope_cover_comes_back_from_its_file(tmp_path: Path) -> None:
    robot = pb.load("minervabot_v3")
    cover = pb.certified_cover(robot)
    again = pb.load_cover(robot, cover.save(tmp_path / "cover.npz"))
    assert all(
        np.array_equal(one.A, other.A) and np.array_equal(one.b, other.b)
        for one, other in zip(again.polytopes, cover.polytopes, strict=True)
    )
    assert again.contains(robot.home)
    assert repr(again) == repr(cover)


def test_a_spent_budget_says_what_is_open(post: pb.Robot) -> None:
    found = pb.certified_cover(post, share=0.999, budget=pb.Budget(boxes=400, seconds=300.0))
    assert found.reason is Reason.BOXES
    assert len(found.open)
    sizes = [np.prod(one[:, 1] - one[:, 0], axis=1).sum() for one in (found.boxes, found.open)]
    assert found.share[0] == pytest.approx(sizes[0] / sum(sizes), abs=1e-9)


def test_the_share_is_estimated_from_samples_that_did_not_say_when_to_stop(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = pb.load("palletizers/dobot_mg400")
    drawn: list[np.ndarray] = []

    def kept(*arguments: object) -> np.ndarray:
        drawn.append(_free_samples(*arguments))
        return drawn[-1]

    monkeypatch.setattr("pinbound.freespace.cover._free_samples", kept)
    cover = pb.certified_cover(robot, limits_only=True, share=0.9)
    assert cover.reason is None
    assert cover.share[0] >= 0.9
    assert len(drawn) >= 3  # seeds, those that said when to stop, and fresh ones
    assert not np.array_equal(drawn[1], drawn[-1])
    assert np.array_equal(cover.share, _interval(cover.contains(drawn[-1])))
    assert str(cover.coverage) in repr(cover)


def test_a_budget_that_ends_while_a_seed_is_chosen_ends_the_search(
    post: pb.Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Time was negative for the set to come, which raised."""
    meter = Meter(pb.Budget(10**9, 50.0))

    def slow(robot: pb.Robot, names: list[str], Q: np.ndarray) -> np.ndarray:
        meter.started -= 100.0
        return np.zeros(len(Q))

    monkeypatch.setattr("pinbound.freespace.cover._least", slow)
    found = _polytopes(post, list(post.boundaries), {}, meter, 1.0, False, 0)
    assert (len(found), found.reason) == (0, Reason.TIME)
    assert found.notes


def test_no_boundary_is_no_cover(post: pb.Robot) -> None:
    with pytest.raises(pb.UnsupportedError, match="limits_only=True"):
        pb.certified_cover(post, boundaries=[])
    whole = pb.certified_cover(post, limits_only=True)
    assert whole.share[0] > 0.99
    with pytest.raises(pb.DimensionError, match="share"):
        pb.certified_cover(post, share=1.5)


def test_boxes_meet_as_all_pairs_compared_say() -> None:
    rng = np.random.default_rng(0)
    low = np.round(rng.uniform(0.0, 1.0, (80, 3)), 1)
    boxes = np.stack([low, low + np.round(rng.uniform(0.1, 0.3, (80, 3)), 1)], axis=1)
    meets = np.all((boxes[:, None, 0] <= boxes[None, :, 1]) & (boxes[None, :, 0] <= boxes[:, None, 1]), axis=2)
    expected = {(i, j) for i in range(80) for j in range(i + 1, 80) if meets[i, j]}
    found = touching(boxes)
    assert len(found) == len(expected)
    assert {tuple(one) for one in found.tolist()} == expected


def test_boxes_that_nearly_meet_are_connected_only_if_they_may() -> None:
    boxes = np.array([[[0.0, 0.0], [1.0, 1.0]], [[1.0 + 1e-12, 0.0], [2.0, 1.0]]])
    first, last = np.array([True, False]), np.array([False, True])
    assert connected(boxes, first, last, 1e-11)
    assert not connected(boxes, first, last, 0.0)
    assert not len(SetGraph.of_boxes(boxes).pairs)


def test_components_of_a_cover_are_those_of_its_free_and_open_boxes(post: pb.Robot) -> None:
    cover = pb.certified_cover(post, post.coordinates[-2:], share=0.8)
    boxes = np.concatenate([cover.boxes, cover.open])
    label = cover.components
    assert len(label) == len(boxes)
    assert not label.flags.writeable
    rng = np.random.default_rng(0)
    for i, j in rng.integers(0, len(boxes), (20, 2)):
        first, last = (np.arange(len(boxes)) == one for one in (i, j))
        assert (label[i] == label[j]) == connected(boxes, first, last, 1e-11)


def test_a_route_keeps_to_its_sets() -> None:
    """Three squares around a corner: the path is the two straight pieces past it."""
    boxes = np.array([[[0.0, 0.0], [1.0, 3.0]], [[0.0, 2.0], [3.0, 3.0]], [[2.0, 0.0], [3.0, 3.0]]])
    one = np.eye(2)
    sets = [(np.concatenate([one, -one]), np.concatenate([box[1], -box[0]])) for box in boxes]
    start, goal = np.array([0.5, 0.0]), np.array([2.5, 0.0])
    for graph in (SetGraph.of_boxes(boxes), SetGraph.of_polytopes(sets)):
        route = graph.route((0, start), (2, goal))
        assert route is not None
        assert route.sets.tolist() == [0, 1, 2]
        for a, b, index in zip(route.points, route.points[1:], route.sets, strict=False):
            assert all(np.all((boxes[index, 0] <= x) & (x <= boxes[index, 1])) for x in (a, b))
        length = np.linalg.norm(np.diff(route.points, axis=0), axis=1).sum()
        shortest = 2.0 * np.hypot(0.5, 2.0) + 1.0
        assert shortest - 1e-12 <= length <= 1.02 * shortest
    apart = SetGraph.of_boxes(boxes[[0, 2]])
    assert apart.route((0, start), (1, goal)) is None
