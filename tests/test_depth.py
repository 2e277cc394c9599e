"""Depth of bodies that overlap: brute force over all faces of their differences, coal, and the law of moving out."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial import ConvexHull

import pinbound as pb
from pinbound.crosscheck.engine import point_engine

ROBOT = """<robot name="three">
  <link name="base"/><link name="turn"/><link name="tilt"/><link name="slide"/>
  <joint name="a" type="revolute"><parent link="base"/><child link="turn"/><origin xyz="0 0 0.1" rpy="0.2 0 0"/>
    <axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <joint name="b" type="revolute"><parent link="turn"/><child link="tilt"/><origin xyz="0.1 0 0" rpy="0 0.3 0"/>
    <axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <joint name="c" type="prismatic"><parent link="tilt"/><child link="slide"/><origin xyz="0 0 0.1" rpy="0 0 0.4"/>
    <axis xyz="1 0 0"/><limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
</robot>
"""
HOME = {"a": 0.0, "b": 0.0, "c": 2.0}


def cloud(seed: int, count: int) -> tuple[tuple[float, ...], ...]:
    return tuple(map(tuple, (0.2 * np.random.default_rng(seed).normal(size=(count, 3))).tolist()))


def load(folder: Path, a: Any, b: Any, min_distance: float = 0.0, /, **home: float) -> pb.Boundary:
    path = folder / "three.urdf"
    path.write_text(ROBOT)
    made = pb.Annotations.of([a, b], [pb.BoundaryMark("pair", a.name, b.name, min_distance)], home=HOME | home)
    return pb.load(path, annotations=made).boundaries[0]


def sums(boundary: pb.Boundary, q: np.ndarray) -> np.ndarray:
    """All x_a - x_b of vertices, in the ancestor's frame."""
    from pinbound.evaluate import depth

    placed, corners = depth._placed(boundary.path, q[None]), boundary.path.difference.corners
    split = corners[0].shape[1]
    a, b = placed.w[0] + corners[0] @ placed.edges[:split, 0], corners[1] @ placed.edges[split:, 0]
    return (a[:, None] + b[None]).reshape(-1, 3)


BODIES = {
    "rocks": (pb.Hull("A", "slide", cloud(1, 12)), pb.Hull("B", "base", cloud(2, 9))),
    "many": (pb.Hull("A", "slide", cloud(3, 80)), pb.Hull("B", "turn", cloud(4, 60), 0.01)),
    "boxes": (
        pb.Box("A", "slide", (0.0, 0.1, 0.0), (0.1, 0.2, 0.3), (0.4, 0.3, 0.2)),
        pb.Box("B", "base", (0.1, 0.0, 0.0), (0.0, 0.0, 0.0), (0.3, 0.5, 0.4), 0.02),
    ),
    "can": (pb.Cylinder("A", "slide", (0, 0, -0.2), (0, 0, 0.2), 0.1), pb.Hull("B", "base", cloud(5, 5))),
    "needle": (
        pb.Hull("A", "slide", tuple((x, 1e-4 * y, 1e-5 * z) for x, y, z in cloud(6, 8))),
        pb.Hull("B", "base", cloud(7, 10)),
    ),
    "rod": (pb.Segment("A", "slide", (-0.2, 0, 0), (0.3, 0.1, 0), 0.05), pb.Hull("B", "base", cloud(8, 30))),
}


def configurations(count: int) -> np.ndarray:
    return np.random.default_rng(9).uniform([-3, -3, -0.3], [3, 3, 0.3], (count, 3))


@pytest.mark.parametrize("name", BODIES)
def test_depth_is_that_of_the_nearest_face_of_all_differences(name: str, tmp_path: Path) -> None:
    boundary = load(tmp_path, *BODIES[name])
    Q = configurations(20)
    radii = sum(mark.shape.radius for mark in BODIES[name])
    found, signed = boundary.penetration(Q), boundary.signed_distance(Q)
    deep = 0
    for row, q in enumerate(Q):
        points = sums(boundary, q)
        hull = ConvexHull(points, qhull_options="Qt" if name != "needle" else "Qt Q12")
        faces = -hull.equations[:, -1]
        if np.min(faces) <= 1e-9:  # the origin is outside, or on the surface
            continue
        deep += 1
        depth = np.min(faces)
        assert abs(-signed[row] - radii - depth) <= 1e-12
        assert abs(found.depth[row] - radii - depth) <= 1e-12
        h = np.max(points @ -found.direction[row])  # any direction bounds the depth from above
        assert abs(h - depth) <= 1e-12
        equal = hull.equations[faces <= depth + 1e-7, :-1]
        if found.is_unique[row]:
            assert np.max(equal @ -found.direction[row]) > 1.0 - 1e-9
    assert deep >= 3
    apart = boundary.norm(Q) > 0.0
    np.testing.assert_allclose(signed[apart], boundary.norm(Q)[apart] - radii, rtol=0.0, atol=1e-15)
    np.testing.assert_allclose(found.depth, np.maximum(-signed, 0.0), rtol=0.0, atol=1e-15)
    np.testing.assert_allclose(np.linalg.norm(found.direction, axis=1), 1.0, rtol=0.0, atol=1e-14)


def test_coal_says_the_same_depth(tmp_path: Path) -> None:
    boundary = load(tmp_path, *BODIES["rocks"])
    robot = pb.load(
        tmp_path / "three.urdf",
        annotations=pb.Annotations.of(BODIES["rocks"], [pb.BoundaryMark("pair", "A", "B")], home=HOME),
    )
    Q = configurations(60)
    np.testing.assert_allclose(boundary.signed_distance(Q), point_engine(robot).distances(Q)[:, 0], rtol=0.0, atol=1e-6)


@pytest.mark.parametrize("name", BODIES)
def test_moving_out_by_the_depth_makes_them_touch(name: str, tmp_path: Path) -> None:
    boundary = load(tmp_path, *BODIES[name])
    from pinbound.evaluate.closest import nearest_of_hulls

    path, Q = boundary.path, configurations(20)
    found = boundary.penetration(Q)
    radii = sum(mark.shape.radius for mark in BODIES[name])
    from pinbound.evaluate import depth

    placed = depth._placed(path, Q)
    rounding = np.finfo(np.float64).eps * placed.edges.shape[1] * float(np.abs(placed.edges).max())  # of their sum

    def apart(moved: np.ndarray) -> np.ndarray:
        w = placed.w + moved
        t = nearest_of_hulls(w, placed.edges, path.difference.corners)
        return np.linalg.norm(w + np.einsum("nk,kni->ni", t, placed.edges), axis=1) - radii

    rows = found.depth > 1e-6
    assert np.count_nonzero(rows) >= 3
    out = apart(1.001 * found.depth[:, None] * found.direction)
    np.testing.assert_allclose(out[rows], (0.001 * found.depth)[rows], rtol=0.0, atol=1e-12)
    rng = np.random.default_rng(0)
    for _ in range(20):  # no shorter way leads out
        way = rng.normal(size=(len(Q), 3))
        way *= 0.999 * found.depth[:, None] / np.linalg.norm(way, axis=1)[:, None]
        assert np.all(apart(way)[rows] <= rounding)


@pytest.mark.parametrize("name", BODIES)
def test_gradients_are_those_of_differences(name: str, tmp_path: Path) -> None:
    boundary, step, Q = load(tmp_path, *BODIES[name]), 1e-6, configurations(12)
    value, slopes = boundary.signed_distance(Q), boundary.signed_distance_gradient(Q)
    checked = 0
    for j in range(3):
        move = step * np.eye(3)[j]
        up, down = boundary.signed_distance(Q + move), boundary.signed_distance(Q - move)
        smooth = (np.abs(up + down - 2.0 * value) < 1e-9) & np.isfinite(slopes[:, j])
        np.testing.assert_allclose(slopes[smooth, j], ((up - down) / (2.0 * step))[smooth], rtol=0.0, atol=2e-3)
        checked += np.count_nonzero(smooth & (value < 0.0))
    assert checked > 3


def test_a_cube_in_the_middle_of_another_has_six_ways_out(tmp_path: Path) -> None:
    cube = [pb.Box(name, link, (0, 0, 0), (0, 0, 0), (0.2, 0.2, 0.2)) for name, link in (("A", "slide"), ("B", "tilt"))]
    cube[1] = pb.Box("B", "tilt", (0, 0, 0.1), (0, 0, 0.4), (0.2, 0.2, 0.2))
    boundary = load(tmp_path, *cube)
    middle, aside = np.array([0.3, 0.2, 0.0]), np.array([0.3, 0.2, 0.05])
    found = boundary.penetration(np.stack((middle, aside)))
    np.testing.assert_allclose(found.depth, [0.2, 0.15], rtol=0.0, atol=1e-14)
    assert found.is_unique.tolist() == [False, True]
    assert np.all(np.isnan(boundary.signed_distance_gradient(middle)))
    np.testing.assert_allclose(boundary.signed_distance_gradient(aside), [0.0, 0.0, 1.0], rtol=0.0, atol=1e-13)
    np.testing.assert_allclose(boundary.norm(aside), 0.0)


def test_spheres_and_capsules_have_closed_forms(tmp_path: Path) -> None:
    spheres = load(tmp_path, pb.Point("A", "slide", (0, 0, 0), 0.3), pb.Point("B", "tilt", (0, 0, 0.1), 0.2), 0.1)
    q = np.array([0.1, 0.2, 0.2])
    assert spheres.signed_distance(q) == pytest.approx(-0.3, abs=1e-14)  # min_distance is no part of the bodies
    found = spheres.penetration(q)
    assert (found.depth, found.is_unique) == (pytest.approx(0.3, abs=1e-14), True)
    one = spheres.penetration(np.array([0.1, 0.2, 0.0]))
    assert (one.depth, one.is_unique) == (pytest.approx(0.5, abs=1e-14), False)
    assert np.linalg.norm(one.direction) == pytest.approx(1.0)
    crossing = load(
        tmp_path,
        pb.Segment("A", "slide", (0, -1, 0), (0, 1, 0), 0.02),
        pb.Segment("B", "tilt", (-1, 0, 0.1), (1, 0, 0.1), 0.01),
    )
    found = crossing.penetration(np.array([0.0, 0.0, 0.0]))
    assert (found.depth, found.is_unique) == (pytest.approx(0.03, abs=1e-14), False)


def test_lines_and_planes_have_a_side_or_none(tmp_path: Path) -> None:
    rock = pb.Hull("A", "slide", cloud(1, 12), 0.01)
    line = load(tmp_path, rock, pb.Line("B", "base", (0, 0, 0.1), (0.2, 1.0, 0.3), 0.02))
    Q = configurations(30)
    found, signed = line.penetration(Q), line.signed_distance(Q)
    from pinbound.evaluate import depth

    placed = depth._placed(line.path, Q)
    assert placed.line is not None
    units, deep = placed.line[1], 0
    for row, q in enumerate(Q):
        basis = depth._normal_plane(units[row])
        hull = ConvexHull(sums(line, q) @ basis.T)
        if np.min(-hull.equations[:, -1]) > 1e-9:
            deep += 1
            assert abs(-signed[row] - 0.03 - np.min(-hull.equations[:, -1])) <= 1e-12
            assert abs(found.direction[row] @ units[row]) <= 1e-12
    assert deep >= 3
    slopes, step = line.signed_distance_gradient(Q), 1e-6
    for j in range(3):
        up, down = (line.signed_distance(Q + sign * step * np.eye(3)[j]) for sign in (1.0, -1.0))
        smooth = (np.abs(up + down - 2.0 * signed) < 1e-9) & np.isfinite(slopes[:, j])
        np.testing.assert_allclose(slopes[smooth, j], ((up - down) / (2.0 * step))[smooth], rtol=0.0, atol=2e-3)
    for order in (1, -1):
        plane = load(tmp_path, *(rock, pb.Plane("B", "base", (0, 0, 0.1), (0.0, 0.0, 1.0)))[::order], b=-1.2)
        height = plane.norm(Q)
        np.testing.assert_allclose(plane.signed_distance(Q), height - 0.01, rtol=0.0, atol=1e-15)
        below = plane.penetration(Q)
        np.testing.assert_allclose(below.depth, np.maximum(0.01 - height, 0.0), rtol=0.0, atol=1e-15)
        np.testing.assert_allclose(below.direction, np.tile([0.0, 0.0, float(order)], (len(Q), 1)), atol=1e-14)


def test_flat_bodies_that_cross_have_no_depth_and_two_ways_out(tmp_path: Path) -> None:
    plates = [
        pb.Hull(name, link, ((-0.2, -0.2, z), (0.2, -0.2, z), (0.2, 0.2, z), (-0.2, 0.3, z)))
        for name, link, z in (("A", "slide", 0.0), ("B", "tilt", 0.1))
    ]
    found = load(tmp_path, *plates).penetration(np.array([0.3, 0.1, 0.05]))
    assert (found.depth, found.is_unique) == (pytest.approx(0.0, abs=1e-14), False)
    assert np.all(np.isnan(load(tmp_path, *plates).signed_distance([0.3, 0.1, np.nan])))
