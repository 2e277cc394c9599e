"""The nearest points of two hulls: proven by a plane between them, known where they touch, from balls to needles."""

from collections.abc import Iterator
from itertools import product
from typing import Any

import numpy as np
import pytest

from pinbound.annotations.shapes import Shape, hull
from pinbound.geometry import gjk
from pinbound.geometry.exact_nearest import nearest_exactly

KINDS = ["ball", "box", "flat", "sliver", "needle", "prism", "segment", "point"]


def body(rng: np.random.Generator, kind: str, k: int) -> Shape:
    V = 0.2 * rng.normal(size=(k, 3))
    if kind == "ball":
        V *= 0.2 / np.linalg.norm(V, axis=1)[:, None]
    if kind == "box":
        V = np.array(list(product((-0.1, 0.1), (-0.2, 0.2), (-0.05, 0.05))))
    if kind == "flat":
        V[:, 2] = 0.0
    if kind == "sliver":
        V[:, 2] *= 10.0 ** rng.uniform(-13, -3)
    if kind == "needle":
        V[:, 1:] *= 10.0 ** rng.uniform(-12, -3)
    if kind == "prism":
        a = np.arange(24) * np.pi / 12
        V = np.vstack([np.column_stack((0.1 * np.cos(a), 0.1 * np.sin(a), 0 * a + z)) for z in (0.0, 0.3)])
    return hull(V[: {"segment": 2, "point": 1}.get(kind, len(V))])


def turned(rng: np.random.Generator) -> Any:
    return np.linalg.qr(rng.normal(size=(3, 3)))[0]


def pairs(seed: int, count: int) -> Iterator[tuple[np.random.Generator, Shape, Shape]]:
    rng = np.random.default_rng(seed)
    for _ in range(count):
        yield rng, *(body(rng, str(rng.choice(KINDS)), int(rng.choice([4, 6, 30, 500]))) for _ in range(2))


def ask(A: Shape, B: Shape, turn: Any, shift: Any) -> tuple[Any, float, Any, Any]:
    """Return the vector between the nearest points, the bound, and the vertices of both, B turned and shifted."""
    w = A.origin - turn @ B.origin - shift
    E = np.vstack((A.directions, -B.directions @ turn.T))
    t, bound = gjk.nearest_vertices(w[None], E[:, None], (A.corners, B.corners))
    return w + t[0] @ E, float(bound[0]), A.vertices, B.vertices @ turn.T + shift


def test_a_plane_between_two_hulls_proves_their_distance() -> None:
    asked = 0
    for rng, A, B in pairs(1, 90):
        turn = np.eye(3) if rng.random() < 0.4 else turned(rng)  # parallel faces and edges, too
        shift = rng.normal(size=3)
        r, bound, V, W = ask(A, B, turn, shift * 0.8 / np.linalg.norm(shift) if rng.random() < 0.5 else 4 * shift)
        found = float(np.linalg.norm(r))
        assert bound <= found + 1e-14
        if found < 1e-6:
            continue
        asked += 1
        n = r / found
        assert (V @ n).min() - (W @ n).max() >= found - 1e-13  # no pair of vertices is nearer along n
    assert asked > 40


def test_hulls_that_touch_in_a_known_point_are_at_zero() -> None:
    """A vertex of the one is put on a vertex, on an edge, or inside the other: their distance is zero, to rounding."""
    for rng, A, B in pairs(2, 90):
        turn = np.eye(3) if rng.random() < 0.4 else turned(rng)
        weights = rng.dirichlet(np.full(len(A.vertices), 0.2)) * rng.integers(0, 2, len(A.vertices))
        weights = np.eye(len(A.vertices))[0] if weights.sum() == 0.0 else weights / weights.sum()
        place = weights @ A.vertices
        r, bound, _, _ = ask(A, B, turn, place - turn @ B.vertices[int(rng.integers(len(B.vertices)))])
        assert np.linalg.norm(r) <= 4e-15
        assert bound <= 4e-15


def test_a_ball_within_the_bound_is_inside() -> None:
    deep = 0
    for rng, A, B in pairs(3, 60):
        r, bound, V, W = ask(A, B, turned(rng), 0.02 * rng.normal(size=3))
        if bound < 0.0:
            deep += 1
            assert np.linalg.norm(r) <= 1e-8
            n = rng.normal(size=(500, 3))
            n /= np.linalg.norm(n, axis=1)[:, None]
            assert ((V @ n.T).max(axis=0) - (W @ n.T).min(axis=0)).min() >= -bound - 1e-14
    assert deep > 8


def test_the_parameters_lie_in_both_hulls() -> None:
    for rng, A, B in pairs(4, 25):
        E = np.vstack((A.directions, -B.directions @ turned(rng).T))
        w = 0.5 * rng.normal(size=(20, 3))
        t, _ = gjk.nearest_vertices(w, np.repeat(E[:, None], 20, axis=1), (A.corners, B.corners))
        for corners, mine in ((A.corners, t[:, : len(A.directions)]), (B.corners, t[:, len(A.directions) :])):
            n = rng.normal(size=(200, corners.shape[1]))
            assert np.all(mine @ n.T <= (corners @ n.T).max(axis=0) + 1e-13)


def test_whole_numbers_and_floats_agree_where_both_know() -> None:
    for rng, A, B in pairs(5, 40):
        turn, shift = turned(rng), 0.6 * rng.normal(size=3)
        E, w = np.vstack((A.directions, -B.directions @ turn.T)), A.origin - turn @ B.origin - shift
        t = nearest_exactly(w, E, (A.corners, B.corners))
        found = float(np.linalg.norm(ask(A, B, turn, shift)[0]))
        exact = float(np.linalg.norm(w + t @ E))
        assert found == pytest.approx(exact, abs=1e-14 if exact > 1e-6 else 2e-8)


def test_rows_that_are_not_finite_have_no_bound() -> None:
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]), np.zeros((1, 0))
    w = np.array([[np.nan, 0.0, 0.0], [2.0, 0.0, 0.0], [np.inf, 0.0, 0.0]])
    _, bound = gjk.nearest_vertices(w, np.repeat(np.eye(3)[:, None], 3, axis=1), corners)
    assert np.isnan(bound[[0, 2]]).all()
    assert bound[1] == pytest.approx(2.0, abs=1e-15)
