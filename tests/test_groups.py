"""Machine code that searches straight motions: its bounds against samples, its answers against the search in NumPy."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

import pinbound as pb
from mechanisms import mechanism, write
from pinbound.boundaries.boundary import Boundary
from pinbound.boundaries.boundary_set import BoundarySet
from pinbound.bounds import groups as groups_module
from pinbound.bounds.groups import Groups
from pinbound.certificates.kept import tables_of
from pinbound.path.relative import relative_path

pytest.importorskip("numba")


def crowd(rng: np.random.Generator, folder: Path, kind: str, joints: int, marks: int) -> pb.Robot:
    """Return a random arm that carries many small balls, and all pairs between links that turn by several angles."""
    bare = pb.load(write(folder, mechanism(rng, kind, joints, False)))
    links = ["base", *(f"l{i}" for i in range(joints))]
    balls = [
        pb.Point(f"p{i}", links[i % len(links)], tuple((0.3 * rng.normal(size=3)).tolist()), 0.04) for i in range(marks)
    ]
    boundaries: list[Boundary] = []
    for i, a in enumerate(balls):
        for b in balls[:i]:
            path = relative_path(bare.tree, bare.coupling, a, b)
            if a.link != b.link and path.minimal.rotations > 1 and not np.any(path.minimal.slides):
                name = f"{a.name}_{b.name}"
                boundaries.append(Boundary(name, a, b, 0.0, path, bare.coordinates, 2e-5, 0.0, bare.home))
    return dataclasses.replace(bare, boundaries=BoundarySet(boundaries, bare.coordinates, bare.linear_limits))


def tables(robot: pb.Robot) -> Groups:
    found = tables_of(robot, tuple(robot.boundaries)).groups
    assert found is not None
    return found


@pytest.fixture(scope="module")
def robots(tmp_path_factory: pytest.TempPathFactory) -> list[pb.Robot]:
    rng = np.random.default_rng(11)
    folder = tmp_path_factory.mktemp("crowds")
    return [crowd(rng, folder, kind, joints, 24) for kind, joints in (("spatial", 4), ("spatial", 6), ("planar", 4))]


def test_bounds_hold_and_are_as_tight_as_was_asked(robots: list[pb.Robot]) -> None:
    rng = np.random.default_rng(5)
    for robot in robots:
        groups, n = tables(robot), len(robot.coordinates)
        for width in (0.01, 0.3, 2.0):
            knots = rng.uniform(-2, 2, n) + np.cumsum(width * rng.normal(size=(3, n)), axis=0)
            ends = np.stack((knots[:-1], knots[1:]), axis=1)
            for each in (False, True):
                found = groups.motion(ends, 1e-6, np.inf, np.inf, each)
                assert found is not None
                u = np.linspace(0, 1, 101)
                dense = np.concatenate([a + u[:, None] * (b - a) for a, b in ends])
                least = robot.boundaries.signed_clearances(dense).min(axis=0)
                assert np.all(found.lower[found.settled] <= least[found.settled] + 1e-12)
                assert np.all(least[found.settled] > -1e-12)
                at = ends[found.piece, 0] + found.u[:, None] * (ends[found.piece, 1] - ends[found.piece, 0])
                there = robot.boundaries.signed_clearances(at)[np.arange(len(least)), np.arange(len(least))]
                assert np.all(np.abs(there - found.upper) <= 1e-9)
                if np.all(found.settled):
                    tight = found.upper - found.lower if each else found.upper.min() - found.lower.min()
                    assert np.max(tight) <= 1.1e-6


def test_verdicts_and_bounds_are_those_of_the_search_in_numpy(
    robots: list[pb.Robot], monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(6)
    seen: set[pb.Verdict] = set()
    for robot in robots:
        n = len(robot.coordinates)
        for width in (0.05, 0.3, 1.0):
            motion = 0.3 * rng.uniform(-1, 1, n) + np.cumsum(width * rng.normal(size=(3, n)), axis=0)
            found: list[pb.Certificate] = []
            for is_quick in (True, False):
                monkeypatch.setattr(Groups, "is_worth", lambda *_, quick=is_quick: quick)
                found.append(pb.certify(robot, motion, limits=False))
            quick, slow = found
            assert quick.verdict is slow.verdict
            assert np.array_equal(quick.boundaries.codes, slow.boundaries.codes)
            seen.add(quick.verdict)
            if quick.verdict is pb.Verdict.CERTIFIED:
                assert quick.lower == pytest.approx(slow.lower, abs=2e-6)
                assert quick.upper == pytest.approx(slow.upper, abs=2e-6)
            elif quick.first_contact and slow.first_contact:
                assert quick.first_contact.after == pytest.approx(slow.first_contact.after, abs=1e-8)
    assert seen == {pb.Verdict.CERTIFIED, pb.Verdict.VIOLATED}


def test_a_motion_that_just_misses_is_certified_and_one_that_just_touches_is_not(robots: list[pb.Robot]) -> None:
    """Pairs are resized so that the motion misses or overlaps by 1e-7 to 1e-9 m."""
    rng, robot = np.random.default_rng(8), robots[1]
    n = len(robot.coordinates)
    for depth in (1e-7, 1e-9, -1e-9, -1e-7):
        ends = np.stack([x := rng.uniform(-2, 2, n), x + 0.3 * rng.normal(size=n)])
        free = pb.certify(robot, ends, limits=False, each=True)
        row = int(np.argmin(np.where(free.boundaries.upper > 1e-3, free.boundaries.upper, np.inf)))
        b = robot.boundaries[row]
        low, high = float(free.boundaries.lower[row]), float(free.boundaries.upper[row])
        u = np.linspace(0, 1, 20_001)
        value = float(b.signed_clearance(ends[0] + u[:, None] * (ends[1] - ends[0])).min())
        assert low - 1e-12 <= value
        assert value <= high + 1e-9
        resized = dataclasses.replace(b, min_distance=b.min_distance + (value if depth > 0 else high) - depth)
        one = dataclasses.replace(robot, boundaries=BoundarySet([resized], robot.coordinates, robot.linear_limits))
        found = tables(one).motion(ends[None], 1e-6, np.inf, np.inf, each=False)
        assert found is not None
        if depth < 0:
            assert not found.settled[0]
            assert pb.certify(one, ends, limits=False).verdict is pb.Verdict.VIOLATED
        elif pb.certify(one, ends, limits=False).verdict is not pb.Verdict.VIOLATED:
            assert found.settled[0] or found.lower[0] <= 0.0


def test_what_the_budget_does_not_reach_is_not_settled(robots: list[pb.Robot]) -> None:
    robot = robots[0]
    n = len(robot.coordinates)
    ends = np.stack([np.zeros(n), np.full(n, 3.0)])[None]
    assert tables(robot).motion(ends, 1e-6, np.inf, 10.0, each=False) is None
    found = tables(robot).many(np.repeat(ends, 3, axis=0), 1e-6, 1.0)
    assert np.all(found.violated | found.unknown)


def test_groups_hold_each_pair_once_and_their_middle_holds_all(robots: list[pb.Robot]) -> None:
    for robot in robots:
        groups = tables(robot)
        assert len(set(groups.places.tolist())) == len(robot.boundaries)
        assert np.array_equal(groups.pairs[groups.places], np.arange(len(robot.boundaries)))
    assert not groups_module._EMPTY > -1e6
