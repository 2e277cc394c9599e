"""Balls and discs that are proven to be inside two bodies' difference, against its facets by Qhull."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from pinbound.bounds.inside import ball, disc, stays_inside
from pinbound.bounds.vertices import Corners, corners_of

CUBE = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])


def rotation(rng: np.random.Generator) -> np.ndarray:
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return turn * np.sign(np.linalg.det(turn))


def ring(sides: int) -> np.ndarray:
    turns = 2 * np.pi * np.arange(sides) / sides
    rim = np.stack((np.cos(turns), np.sin(turns)), axis=1)
    return np.vstack([np.column_stack((rim, np.full(sides, height))) for height in (-1.0, 1.0)])


def body(rng: np.random.Generator) -> np.ndarray:
    sort = rng.integers(5)
    if sort == 0:
        return CUBE * rng.uniform(0.05, 1, 3)
    if sort == 1:
        return ring(24) * rng.uniform(0.1, 1, 3)
    if sort == 2:
        return rng.normal(size=(int(rng.integers(4, 40)), 3)) * rng.choice([1.0, 0.01], 3)  # slivers too
    return rng.normal(size=(int(rng.integers(4, 40)), 3))


def pair(a: np.ndarray, b: np.ndarray) -> Corners:
    return corners_of([(a, b)], 6, [True])


ONE = np.zeros(1, dtype=np.intp)


def test_a_ball_is_inside_wherever_it_is_claimed_and_claimed_nearly_wherever_bodies_overlap() -> None:
    rng = np.random.default_rng(0)
    shares: list[float] = []
    for _ in range(120):
        a, b = body(rng), body(rng)
        turns = [rotation(rng) if rng.random() < 0.5 else np.eye(3)[rng.permutation(3)] for _ in "ab"]
        w = 0.4 * rng.normal(size=3) * (rng.random() < 0.9)
        ways = np.concatenate((turns[0].T, -turns[1].T))
        difference = (w + (a @ ways[:3])[:, None] + (b @ ways[3:])[None]).reshape(-1, 3)
        depth = float(-ConvexHull(difference).equations[:, 3].max())  # of the origin; negative outside
        found = float(ball(pair(a, b), ONE, w[None], ways[:, None])[0])
        assert found <= max(depth, 0.0) + 1e-12
        if depth > 1e-3:
            shares.append(found / depth)
    assert len(shares) > 50
    assert np.median(shares) > 0.4
    assert np.mean(np.array(shares) == 0.0) < 0.15


@pytest.mark.parametrize("gap", [-1e-9, 0.0, 1e-9, 0.5])
def test_bodies_that_only_touch_or_are_apart_have_no_ball(gap: float) -> None:
    w, ways = np.array([[2.0 + gap, 0.3, 0.1]]), np.concatenate((np.eye(3), -np.eye(3)))[:, None]
    found = float(ball(pair(CUBE, CUBE), ONE, w, ways)[0])
    assert found <= max(-gap, 0.0)


def test_flat_bodies_have_no_ball_and_the_disc_is_that_of_their_plane() -> None:
    rng = np.random.default_rng(1)
    normal = np.array([[0.0, 0.0, 1.0]])
    found: list[float] = []
    for _ in range(40):
        a, b = (np.column_stack((rng.normal(size=(12, 2)), np.zeros(12))) for _ in "ab")
        w, ways = np.append(rng.normal(size=2), 0.0), np.concatenate((np.eye(3), -np.eye(3)))
        difference = (w + a[:, None] - b[None]).reshape(-1, 3)
        depth = float(-ConvexHull(difference[:, :2]).equations[:, 2].max())
        assert ball(pair(a, b), ONE, w[None], ways[:, None])[0] == 0.0
        inside = float(disc(pair(a, b), ONE, w[None], ways[:, None], normal)[0])
        assert inside <= max(depth, 0.0) + 1e-12
        if depth > 0.01:
            found.append(inside / depth)
    assert np.median(found) > 0.5
    assert min(found) > 0.0


def moving(rng: np.random.Generator, depth: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, list]:
    """Two bodies that overlap by about a share of their size, and how they move to first order."""
    a, b = body(rng), body(rng)
    turn = rotation(rng)
    ways = np.concatenate((np.eye(3), -turn.T))
    difference = ((a @ ways[:3])[:, None] + (b @ ways[3:])[None]).reshape(-1, 3)
    hull = ConvexHull(difference)
    facet = int(rng.integers(len(hull.simplices)))
    normal, place = hull.equations[facet, :3], difference[hull.simplices[facet]].mean(axis=0)
    w = depth * normal - place  # the origin lies just below a facet
    moves = []
    for _ in range(2):
        spin, slide = 0.1 * depth * rng.normal(size=3), 0.02 * rng.normal(size=3)
        slide -= (1.0 - 5.0 * depth * (rng.random() < 0.4)) * (slide @ normal) * normal  # mostly along the facet
        moves.append((slide, np.concatenate((np.cross(spin, ways[:3]), np.zeros((3, 3))))))
    return a, b, w, ways, moves


@pytest.mark.parametrize("depth", [0.005, 0.03, 0.2])
def test_bodies_that_are_said_to_stay_overlapping_do_so_wherever_they_move(depth: float) -> None:
    rng = np.random.default_rng(round(1e3 * depth))
    said, able = 0, 0
    for _ in range(35):
        a, b, w, ways, moves = moving(rng, depth)
        off = float(rng.choice([0.0, 1e-4]))
        found = stays_inside(
            pair(a, b), ONE, w[None], ways[:, None], [(s[None], e[:, None]) for s, e in moves], np.array([off])
        )[0]
        least = np.inf
        for signs in [*np.array(np.meshgrid([-1, 0, 1], [-1, 0, 1])).reshape(2, -1).T, *rng.uniform(-1, 1, (12, 2))]:
            there = w + sum(s * move[0] for s, move in zip(signs, moves, strict=True))
            turned = ways + sum(s * move[1] for s, move in zip(signs, moves, strict=True))
            D = (there + (a @ turned[:3])[:, None] + (b @ turned[3:])[None]).reshape(-1, 3)
            least = min(least, float(-ConvexHull(D).equations[:, 3].max()))
        assert not found or least >= off - 1e-12
        said, able = said + found, able + (least > off)
    assert able > 6
    assert said > (0.2 if depth < 0.1 else 0.5) * able


def test_what_moves_along_a_face_needs_no_depth_for_it() -> None:
    """A cube sunk by a millimetre that slides along the face by a tenth; moved across it, it may leave."""
    w, ways = np.array([[0.0, 0.0, -1.999]]), np.concatenate((np.eye(3), -np.eye(3)))[:, None]
    still = np.zeros((6, 1, 3))
    along, across = np.array([[0.1, 0.1, 0.0]]), np.array([[0.0, 0.0, 0.1]])
    assert stays_inside(pair(CUBE, CUBE), ONE, w, ways, [(along, still)], np.zeros(1))[0]
    assert not stays_inside(pair(CUBE, CUBE), ONE, w, ways, [(across, still)], np.zeros(1))[0]
    assert not stays_inside(pair(CUBE, CUBE), ONE, w, ways, [(along, still)], np.full(1, 2e-3))[0]
    nan = np.full((1, 3), np.nan)
    assert not stays_inside(pair(CUBE, CUBE), ONE, w, ways, [(nan, still)], np.zeros(1))[0]
    assert not stays_inside(pair(CUBE, CUBE), ONE, nan, ways, [(along, still)], np.zeros(1))[0]
