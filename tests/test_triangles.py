"""Distances from triangles, and triangles cut along others: against another algorithm, and by areas."""

from typing import Any

import numpy as np
import pytest

import pinbound as pb
from pinbound.coverage.mesh_proof import away_from
from pinbound.coverage.triangles import Triangles, cut_along, halved

RNG = np.random.default_rng(15)


def areas(corners: Any) -> Any:
    return 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)


@pytest.mark.parametrize("kind", ["any", "thin", "a segment", "two corners", "a point"])
def test_the_distance_is_that_of_the_hull_of_three_corners(kind: str) -> None:
    corners = RNG.normal(size=(30, 3, 3))
    if kind == "thin":
        corners[:, 2] = 0.3 * corners[:, 0] + 0.7 * corners[:, 1] + 1e-4 * corners[:, 2]
    if kind == "a segment":
        corners[:, 2] = 0.3 * corners[:, 0] + 0.7 * corners[:, 1]
    if kind in ("two corners", "a point"):
        corners[:, 1] = corners[:, 0]
    if kind == "a point":
        corners[:, 2] = corners[:, 0]
    points = RNG.normal(size=(60, 3)) * RNG.choice((0.1, 1.0, 5.0), (60, 1))
    found = Triangles(corners)
    for row in range(len(corners)):
        shape = pb.Hull("h", "l", tuple(map(tuple, corners[row].tolist()))).shape
        mine = found.away(points, np.full(len(points), row))
        assert np.allclose(mine, away_from(shape, points), rtol=0.0, atol=1e-9)
    least = found.least(points)
    assert np.array_equal(least, np.min([found.away(points, np.full(60, row)) for row in range(30)], axis=0))


def test_many_points_are_as_few() -> None:
    corners, points = RNG.normal(size=(5, 3, 3)), RNG.normal(size=(9000, 3))
    rows, found = RNG.integers(0, 5, 9000), Triangles(corners)
    few = np.concatenate([found.away(points[i : i + 7], rows[i : i + 7]) for i in range(0, 9000, 7)])
    assert np.allclose(found.away(points, rows), few, rtol=0.0, atol=1e-14)


def test_what_is_cut_along_a_triangle_is_all_there_and_on_its_side() -> None:
    pieces, others = RNG.normal(size=(400, 3, 3)), RNG.normal(size=(400, 3, 3))
    others[:40] = pieces[:40]  # over itself: all is kept
    others[40:60, 2] = others[40:60, 0]  # without area: no side is the inner one
    others[60:80] = pieces[60:80][:, (0, 2, 1)] + (0.0, 0.0, 9.0)
    (over, whose), (rest, from_row) = cut_along(pieces, others)
    total = np.bincount(whose, weights=areas(over), minlength=400)
    total += np.bincount(from_row, weights=areas(rest), minlength=400)
    assert np.allclose(total, areas(pieces), rtol=0.0, atol=1e-9)
    assert np.allclose(areas(over[whose < 40]).sum(), areas(pieces[:40]).sum())
    normals = np.cross(others[:, 1] - others[:, 0], others[:, 2] - others[:, 0])
    inside = np.full(len(rest), True)
    for corner in range(3):
        start, end = others[:, corner], others[:, (corner + 1) % 3]
        inward = np.cross(normals, end - start)
        assert np.einsum("nki,ni->nk", over - start[whose, None], inward[whose]).min() >= -1e-9
        inside &= np.einsum("ni,ni->n", rest.mean(axis=1) - start[from_row], inward[from_row]) > 1e-9
    assert not np.any(inside)
    assert 400 < len(over) + len(rest) < 400 * 13


def test_halves_are_the_whole() -> None:
    pieces = RNG.normal(size=(50, 3, 3))
    assert np.allclose(areas(halved(pieces)).reshape(-1, 2).sum(axis=1), areas(pieces))
