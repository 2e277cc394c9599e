"""Pair atlases against clearances at random, formulas of one angle, sets computed alone, and files that are stale."""

import math
from pathlib import Path

import numpy as np
import pytest

import pinbound as pb
from pinbound.certificates.records import Reason
from pinbound.freespace.pair_sets import AngleSet, BoxTree
from robots import joint, robot_xml
from test_polytope import POST, load, marks

SEVERAL = [
    joint("s", "prismatic", "base", "car", axis="1 0 0", limit="0 0.4"),
    joint("q1", "revolute", "car", "a", axis="0 0 1", xyz="0 0 0.2", limit="-2 2"),
    joint("q2", "revolute", "a", "b", axis="0 1 0", xyz="0 0 0.2", limit="-1.5 2"),
    joint("q3", "revolute", "b", "c", axis="1 0 0", xyz="0 0 0.4", limit="-2 1.8"),
    joint("q4", "revolute", "c", "d", axis="0 1 0", xyz="0.05 0 0.2", limit="-2 2"),
    joint("m", "revolute", "b", "e", axis="0 0 1", limit="-1 1", mimic="q3 0.5 0.05"),
]
"""A car, an arm of four joints, and a link that follows the third."""


@pytest.fixture(scope="module")
def several(tmp_path_factory: pytest.TempPathFactory) -> pb.Robot:
    """Pairs of one to four coordinates: spheres, points of no size, a capsule, a plane, ends in either order."""
    points = [("car0", "car", "-0.14 -0.22 0.2", 0.12), ("tip", "d", "0.09 0.09 0.13", 0.06)]
    points += [("dot", "d", "0 -0.17 0.04", 0.0), ("pin", "b", "-0.22 0.12 0.01", 0.0)]
    points += [("wall", "base", "-0.07 0.15 0.58", 0.12), ("b0", "b", "0.07 0.3 0.17", 0.05)]
    points += [("a0", "a", "0.26 0.3 0.33", 0.07), ("a1", "a", "0.26 0.16 0", 0.08)]
    points += [("c0", "c", "0.06 0.17 0.16", 0.06)]
    points += [("c1", "c", "-0.04 0.16 0.06", 0.07), ("e0", "e", "0.06 -0.1 0.25", 0.07)]
    pairs = [("car0", "tip"), ("tip", "a0"), ("a0", "c0"), ("a0", "c1"), ("a1", "c0"), ("a1", "c1"), ("e0", "c1")]
    pairs += [("b0", "c1"), ("b0", "tip"), ("dot", "pin"), ("wall", "a0")]
    extra = (
        '<pinbound:segment name="rod" link="c" xyz_a="0 0 0" xyz_b="0.05 0 0.2" radius="0.03"/>'
        '<pinbound:plane name="floor" link="car" xyz="0 0 0.25" normal="0 0 1"/>'
        '<pinbound:boundary name="low" a="floor" b="rod"/><pinbound:boundary name="near" a="a0" b="rod"/>'
    )
    return load(robot_xml(SEVERAL, {}, [], marks(points, pairs) + extra), tmp_path_factory.mktemp("several"))


@pytest.fixture(scope="module")
def atlas(several: pb.Robot) -> pb.PairAtlas:
    return pb.pair_atlas(several, budget=pb.Budget(150_000, 1000.0), decided=0.97)


def samples(robot: pb.Robot, count: int, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).uniform(robot.lower, robot.upper, (count, len(robot.coordinates)))


def check(robot: pb.Robot, atlas: pb.PairAtlas, Q: np.ndarray) -> np.ndarray:
    """Compare what is said of each pair with its clearance, and what is said of all of them with `free`."""
    signed = robot.boundaries.select(atlas.boundaries).signed_clearances(Q)
    each = atlas.pairs_where(Q)
    assert not np.any((each == pb.Where.FREE) & ~(signed > 0.0))
    assert not np.any((each == pb.Where.CONTACT) & (signed > 0.0))
    whole, free = atlas.where(Q), robot.boundaries.select(atlas.boundaries).free(Q)
    assert not np.any((whole == pb.Where.FREE) & ~free)
    assert not np.any((whole == pb.Where.CONTACT) & np.all(signed > 0.0, axis=1))
    kept = robot.intervals.hold(Q)
    assert np.array_equal(whole == pb.Where.FREE, kept & np.all(each == pb.Where.FREE, axis=1))
    assert np.array_equal(whole[kept] == pb.Where.CONTACT, np.any(each[kept] == pb.Where.CONTACT, axis=1))
    return each


def test_nothing_free_is_in_contact_and_nothing_in_contact_is_free(several: pb.Robot, atlas: pb.PairAtlas) -> None:
    kinds = {group.kind for group in atlas.groups}
    assert kinds == {"exact", "planar", "paving"}
    assert {len(group.coordinates) for group in atlas.groups} == {1, 2, 3, 4}
    assert max(len(group.names) for group in atlas.groups) == 4
    each = check(several, atlas, samples(several, 40_000, 0))
    assert np.mean(each == pb.Where.UNDECIDED) < 0.05
    touched = np.array(atlas.boundaries)[np.any(each == pb.Where.CONTACT, axis=0)]
    assert len(touched) >= 7


def test_corners_of_boxes_keep_what_is_said_of_them(several: pb.Robot, atlas: pb.PairAtlas) -> None:
    rng = np.random.default_rng(1)
    for group in atlas.groups:
        if group.kind == "exact":
            continue
        for where, sign in ((pb.Where.FREE, 1.0), (pb.Where.CONTACT, -1.0)):
            boxes = group.boxes(where)
            if not len(boxes):
                continue
            some = boxes[rng.integers(0, len(boxes), 1000)]
            Q = samples(several, len(some), 2)
            up = rng.random((len(some), len(group.columns))) < 0.5
            Q[:, group.columns] = np.where(up, some[:, 1], some[:, 0])
            signed = several.boundaries.select(group.names).signed_clearances(Q)
            assert np.all(sign * signed.min(axis=1) > 0.0)


def test_volumes_add_up_and_hold_the_share_of_samples(several: pb.Robot, atlas: pb.PairAtlas) -> None:
    Q = samples(several, 100_000, 3)
    signed = several.boundaries.select(atlas.boundaries).signed_clearances(Q)
    for group in atlas.groups:
        sizes = [np.prod(boxes[:, 1] - boxes[:, 0], axis=1).sum() for boxes in map(group.boxes, pb.Where)]
        if group.kind != "exact":  # intervals of one angle go a little beyond the limits
            assert sum(sizes) == pytest.approx(group.volume, rel=1e-12)
            assert sizes[2] == pytest.approx(group.free[0], rel=1e-9)
            assert sizes[0] == pytest.approx(group.contact[0], rel=1e-9, abs=1e-9)
        assert group.free[0] + group.contact[0] + group.undecided == pytest.approx(group.volume, rel=1e-9)
    for column, pair in enumerate(atlas.pairs):
        if len(pair.coordinates) > 1 and pair.kind == "exact":
            continue
        share = np.mean(signed[:, column] > 0.0)
        room = 4.0 * math.sqrt(0.25 / len(Q))
        assert pair.free[0] / pair.volume - room < share < pair.free[1] / pair.volume + room
        assert pair.contact[0] / pair.volume - room < 1.0 - share < pair.contact[1] / pair.volume + room
        assert pair.free[0] + pair.contact[0] + pair.undecided == pytest.approx(pair.volume, rel=1e-9)


def test_each_pair_by_itself_is_decided_where_another_of_its_group_is_in_contact(
    several: pb.Robot, atlas: pb.PairAtlas
) -> None:
    names = next(group.names for group in atlas.groups if len(group.names) == 4)
    alone = pb.pair_atlas(several, names, pb.Budget(60_000, 1000.0), decided=0.97, each=True)
    assert [group.names for group in alone.groups] == [(name,) for name in alone.boundaries]
    check(several, alone, samples(several, 20_000, 4))
    for name in names:
        assert alone[name].decided > 0.96
        assert atlas[name].contact[0] < alone[name].contact[1]
        assert atlas[name].free[0] < alone[name].free[1]
        assert alone[name].free[0] < atlas[name].free[1]


def test_one_angle_is_that_of_the_formula(tmp_path: Path) -> None:
    joints = [joint("q", "revolute", "base", "arm", axis="0 1 0", limit="-3.1 9")]
    points = [("p", "base", "0.5 0.03 0", 0.05), ("s", "arm", "0 0 0.4", 0.06)]
    robot = load(robot_xml(joints, {}, [], marks(points, [("p", "s")])), tmp_path)
    (group,) = pb.pair_atlas(robot).groups
    across = math.sqrt((0.11**2 - 0.1**2 - 0.03**2) / (4 * 0.5 * 0.4))
    half = 2.0 * math.asin(across)
    wanted = [(math.pi / 2 - half, math.pi / 2 + half), (2.5 * math.pi - half, 2.5 * math.pi + half)]
    found = group.boxes(pb.Where.CONTACT)[:, :, 0]
    assert np.abs(found - wanted).max() < 1e-9
    assert np.all((found[:, 0] > np.array(wanted)[:, 0]) & (found[:, 1] < np.array(wanted)[:, 1]))
    assert group.volume == pytest.approx(12.1, abs=1e-12)
    assert group.contact[0] < 4.0 * half < group.contact[1]
    assert group.undecided < 1e-8
    signed = robot.boundaries.signed_clearances(group.boxes(pb.Where.FREE).reshape(-1, 1)[1:-1])
    assert np.all(signed > 0.0)
    atlas, edge = pb.pair_atlas(robot), wanted[0][0]
    near = np.nextafter(edge, [-np.inf, np.inf])
    assert np.all(atlas.where([[edge], *near[:, None]]) == pb.Where.UNDECIDED)


def test_an_angle_within_rounding_of_an_edge_lies_in_neither_interval() -> None:
    numbers = {"volume": 2.0, "free": 1.0, "contact": 1.0, "work": 0}
    slots = {"slot_free": np.ones(1), "slot_contact": np.ones(1)}
    low, high, edges = np.full(2, -9e5), np.full(2, 9e5), np.array([0.0, 1.0, 2.0])
    codes = np.array([pb.Where.FREE, pb.Where.CONTACT], dtype=np.int8)
    known = AngleSet(
        **numbers, **slots, coefficients=np.array([3.0, -3.0]), low=low, high=high, edges=edges, codes=codes
    )
    base = 7e5 + np.arange(200) / 7.0
    for ulps, wanted in ((0, 0), (1, 0), (-1, 0), (40, -1), (-40, 1)):
        Y = np.stack([base + 1.0 / 3.0 + ulps * np.spacing(base), base], axis=1)
        assert set(known.where(Y).tolist()) == {wanted}
    assert known.where(np.array([[1.1, 1.0], [1.5, 1.0], [2.0, 1.0]])).tolist() == [
        1,
        -1,
        0,
    ]  # beyond what was looked at


TWINS = [
    one
    for side, at in (("l", "0.5 0 0"), ("r", "-0.5 0.1 0"))
    for one in (
        joint(f"{side}1", "revolute", "base", f"{side}a", axis="0 0 1", xyz=at, limit="-2 2"),
        joint(f"{side}2", "revolute", f"{side}a", f"{side}b", xyz="0 0 0.3", limit="-1 2"),
        joint(f"{side}3", "revolute", f"{side}b", f"{side}c", axis="1 0 0", xyz="0 0 0.3", limit="-2 2"),
    )
]
"""Two equal arms at different places."""


def twins(folder: Path, radius: float = 0.1) -> pb.Robot:
    """Return them with spheres; `radius` is that of one on the right arm."""
    points, pairs = list[tuple[str, str, str, float]](), list[tuple[str, str]]()
    for side, size in (("l", 0.1), ("r", radius)):
        points += [(f"{side}p", f"{side}a", "0.45 0 0.3", 0.1), (f"{side}s", f"{side}c", "0 0.05 0.2", size)]
        points += [(f"{side}t", f"{side}c", "0 0 0.25", 0.05)]
        pairs += [(f"{side}t", f"{side}p"), (f"{side}s", f"{side}p")]
    return load(robot_xml(TWINS, {}, [], marks(points, [*pairs, ("lt", "rt")])), folder)


def same(one: pb.AtlasGroup, other: pb.AtlasGroup) -> bool:
    assert isinstance(one.known, BoxTree)
    assert isinstance(other.known, BoxTree)
    names = ("low", "high", "codes", "touching", "first", "listed", "members", "slot_free", "slot_contact")
    return all(np.array_equal(getattr(one.known, name), getattr(other.known, name)) for name in names)


def test_pairs_of_equal_arms_are_computed_once_and_are_those_computed_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pinbound.freespace.held.has_numba", lambda: False)
    robot = twins(tmp_path)
    budget = pb.Budget(10**9, 1000.0)
    own = [name for name in robot.boundaries.names if name != robot.boundaries.names[-1]]
    found = pb.pair_atlas(robot, own, budget, decided=0.96)
    assert (len(found.groups), found.shared) == (2, 1)
    left, right = found.groups
    assert right.shared_with == 0
    assert (left.coordinates, right.coordinates) == (("l3", "l2"), ("r3", "r2"))  # as the chains turn, from the tip
    for group in found.groups:
        alone = pb.pair_atlas(robot, group.names, budget, decided=0.96)
        assert alone.groups[0].names == group.names
        assert same(alone.groups[0], group)
    each = check(robot, found, samples(robot, 30_000, 5))
    assert np.all(np.any(each == pb.Where.CONTACT, axis=0))
    whole = pb.pair_atlas(robot, budget=pb.Budget(30_000, 1000.0))
    assert set(whole.groups[-1].coordinates) == set(robot.coordinates)
    assert whole.groups[-1].coordinates != robot.coordinates  # from the tip of one arm to that of the other
    check(robot, whole, samples(robot, 5000, 6))
    again = pb.load_atlas(robot, found.save(tmp_path / "twins.npz"), found.boundaries)
    assert [group.shared_with for group in again.groups] == [None, 0]
    other = twins(tmp_path, radius=0.1 + 1e-15)
    assert pb.pair_atlas(other, own, pb.Budget(10, 1000.0)).shared == 0
    narrow = pb.pair_atlas(robot, own, pb.Budget(10, 1000.0), window={"r3": (-2.0, 1.9)})
    assert narrow.shared == 0


def test_files_come_back_and_stale_or_damaged_ones_are_refused(
    several: pb.Robot, atlas: pb.PairAtlas, tmp_path: Path
) -> None:
    path = atlas.save(tmp_path / "atlas.npz")
    again = pb.load_atlas(several, path)
    Q = samples(several, 3000, 7)
    assert np.array_equal(again.pairs_where(Q), atlas.pairs_where(Q))
    assert np.array_equal(again.where(Q), atlas.where(Q))
    assert repr(again) == repr(atlas)
    assert list(map(repr, again.groups)) == list(map(repr, atlas.groups))
    assert [one.name for one in tmp_path.iterdir()] == ["atlas.npz"]
    post = load(POST, tmp_path)
    path = pb.pair_atlas(post, budget=pb.Budget(500, 1000.0)).save(tmp_path / "post.npz")
    assert len(pb.load_atlas(load(POST.replace("<robot ", "<!-- a comment --><robot "), tmp_path), path)) == 1
    for robot in (load(POST.replace('radius="0.1"', 'radius="0.10000000000000002"'), tmp_path), several):
        with pytest.raises(pb.InputError, match=r"limits or marks differ.*Make it again with pb\.pair_atlas"):
            pb.load_atlas(robot, path)
    with np.load(path) as file:
        given = dict(file)
    given["codes"] = given["codes"].copy()
    given["codes"][-1] = BoxTree.FREE
    np.savez(tmp_path / "forged.npz", **given)
    with pytest.raises(pb.InputError, match="damaged"):
        pb.load_atlas(post, tmp_path / "forged.npz")
    with pytest.raises(pb.InputError, match="no atlas"):
        pb.load_atlas(post, pb.certified_cover(post, share=0.1).save(tmp_path / "cover.npz"))
    with pytest.raises(FileNotFoundError):
        pb.load_atlas(post, tmp_path / "missing.npz")


def test_a_spent_budget_or_a_stop_leaves_the_rest_undecided(tmp_path: Path) -> None:
    post, told = load(POST, tmp_path), list[tuple[float, str]]()
    few = pb.pair_atlas(post, budget=pb.Budget(40, 1000.0))
    assert (few.reason, few.groups[0].decided < 0.9) == (Reason.BOXES, True)
    check(post, few, samples(post, 4000, 8))

    def stop(share: float, name: str) -> bool:
        told.append((share, name))
        return len(told) > 5

    stopped = pb.pair_atlas(post, progress=stop)
    assert (stopped.reason, len(told)) == (Reason.STOPPED, 6)
    assert [name for _, name in told] == list(post.boundaries.names) * 6
    assert 0.0 == told[0][0] <= told[-1][0] < 1.0
    check(post, stopped, samples(post, 4000, 9))


def test_what_always_touches_what_never_does_and_a_joint_without_a_range(tmp_path: Path) -> None:
    joints = [
        joint("bolts", "fixed", "base", "plate"),
        joint("q1", "revolute", "base", "a", xyz="0 0 0.1", limit="-3 3"),
        joint("still", "revolute", "a", "b", axis="1 0 0", xyz="0 0 0.2", limit="0.25 0.25"),
        joint("q2", "revolute", "b", "c", axis="1 0 0", xyz="0 0 0.2", limit="-3 3"),
    ]
    points = [("far", "base", "3 0 0", 0.1), ("near", "base", "0.3 0 0.3", 0.1), ("tip", "c", "0 0.1 0.1", 0.05)]
    points += [("fixed", "plate", "0 5 0", 0.1)]
    pairs = [("far", "tip"), ("near", "tip"), ("near", "fixed")]
    text = robot_xml(joints, {}, [], marks(points, pairs, '<pinbound:home still="0.25"/>'))
    robot = load(text, tmp_path)
    far, near, fixed = robot.boundaries.names
    found = pb.pair_atlas(robot, budget=pb.Budget(60_000, 1000.0))
    assert found[far].free == pytest.approx((0.0, 0.0))  # a box without width has no volume
    Q = samples(robot, 4000, 10)
    assert np.all(found.pairs_where(Q)[:, [0, 2]] == pb.Where.FREE)
    each = check(robot, found, Q)
    assert set(np.unique(each[:, 1]).tolist()) >= {-1, 1}
    assert found[fixed].kind == "exact"
    assert found[fixed].coordinates == ()
    free = pb.pair_atlas(robot, [near], pb.Budget(60_000, 1000.0), window={"q1": (-3.0, -2.0)})
    assert np.all(free.where(Q[Q[:, 0] < -2.0]) == pb.Where.FREE)
    touching = next(q for q in Q[each[:, 1] == pb.Where.CONTACT])
    narrow = {name: (x - 1e-4, x + 1e-4) for name, x in zip(("q1", "q2"), touching[[0, 2]], strict=True)}
    always = pb.pair_atlas(robot, [near], window=narrow)
    assert always.where(touching) is pb.Where.CONTACT
    assert len(always.groups[0].boxes(pb.Where.CONTACT)) == 1


def test_beyond_the_limits_and_for_what_is_no_number_nothing_is_said(several: pb.Robot, atlas: pb.PairAtlas) -> None:
    free = next(q for q in samples(several, 1000, 11) if atlas.where(q) is pb.Where.FREE)
    for j in range(len(free)):
        q = free.copy()
        q[j] = several.upper[j] + 1e-9
        assert atlas.where(q) is pb.Where.UNDECIDED
        q[j] = np.nan
        assert atlas.where(q) is pb.Where.UNDECIDED
    assert atlas.pairs_where(np.full(len(free), np.inf)).tolist() == [0] * len(atlas)
    edge = np.where(free > 0.0, several.upper + 5e-13, several.lower - 5e-13)
    assert np.array_equal(atlas.pairs_where(edge), atlas.pairs_where(np.clip(edge, several.lower, several.upper)))


def test_wrong_questions_are_refused(several: pb.Robot, atlas: pb.PairAtlas) -> None:
    with pytest.raises(pb.DimensionError, match=r"not in \(0, 1\]"):
        pb.pair_atlas(several, decided=0.0)
    with pytest.raises(pb.UnknownNameError, match="boundary"):
        pb.pair_atlas(several, ["none"])
    with pytest.raises(pb.UnknownNameError, match="boundary of the atlas"):
        _ = atlas["none"]
    with pytest.raises(pb.UnsupportedError, match="no boundary"):
        pb.pair_atlas(several, [])
