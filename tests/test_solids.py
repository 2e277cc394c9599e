"""Closed surfaces of a mesh, and its hollow edges, by which cuts are proposed."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from pinbound.coverage.mesh_covers import cover_meshes
from pinbound.coverage.solids import Group, group_of
from pinbound.meshes import Mesh

BOX = np.array(list(np.ndindex(2, 2, 2)), dtype=np.float64)
Array = NDArray[np.float64]


def solid(points: Array) -> Array:
    """Return the triangles (n, 3, 3) of a hull, outwards."""
    hull = ConvexHull(points)
    corners = points[hull.simplices]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = np.einsum("ni,ni->n", normals, hull.equations[:, :3]) < 0.0
    corners[inward] = corners[inward][:, ::-1]
    return corners


def mesh_of(*surfaces: Array) -> Mesh:
    triangles = np.concatenate(surfaces)
    count = len(triangles)
    return Mesh(triangles.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3), np.arange(count))


ANGLE = [(0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3)], [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)]
TEE = [(0, 0), (3, 0), (3, 1), (2, 1), (2, 3), (1, 3), (1, 1), (0, 1)], [(0, 1, 2), (0, 2, 3), (0, 3, 6), (0, 6, 7)]
TEE[1].extend([(3, 4, 5), (3, 5, 6)])


def prism(plan: list[tuple[int, int]], rows: list[tuple[int, int, int]]) -> Array:
    """Return the prism of height 1 over a polygon that is cut into triangles."""
    count = len(plan)
    corners = np.array([(x, y, z) for z in (0, 1) for x, y in plan], dtype=np.float64)
    faces = [(c, b, a) for a, b, c in rows] + [(a + count, b + count, c + count) for a, b, c in rows]
    sides = [(i, (i + 1) % count) for i in range(count)]
    faces += [face for i, j in sides for face in ((i, j, i + count), (j, j + count, i + count))]
    return corners[np.array(faces)]


def counted(group: Group) -> list[int]:
    return np.bincount(group.solids).tolist()


@pytest.mark.parametrize("turned", [False, True])
def test_closed_surfaces_are_told_apart(turned: bool) -> None:
    small, large = solid(BOX), solid(2.0 * BOX + 3.0)
    surfaces = [one[:, ::-1] if turned else one for one in (small, large)]
    assert counted(group_of(mesh_of(*surfaces))) == [12, 12]
    # What is open, turned over (a hole), or next to nothing goes with what is nearest.
    hole = solid(0.2 * BOX + 0.4)[:, ::-1]
    speck = solid(0.01 * BOX + 6.0)
    sheet = np.array([[[5.5, 5.5, 5.5], [5.6, 5.5, 5.5], [5.5, 5.6, 5.5]]])
    more = [one[:, ::-1] if turned else one for one in (hole, speck, sheet)]
    group = group_of(mesh_of(*surfaces, *more))
    larger = group.triangles[group.solids == 0]
    assert counted(group) == [12 + 12 + 1, 12 + 12]
    assert larger.min() >= 3.0
    # A surface with one triangle too few, or one twice, is not closed: nothing is told apart.
    for broken in (small[1:], np.concatenate((small, small[:1]))):
        assert np.unique(group_of(mesh_of(broken)).solids).tolist() == [0]


@pytest.mark.parametrize("turned", [False, True])
def test_hollow_edges_are_found_and_say_a_plane(turned: bool) -> None:
    corners = prism(*ANGLE)
    group = group_of(mesh_of(corners[:, ::-1] if turned else corners))
    assert np.allclose(group.hollows[:, :2], 1.0)
    assert np.sort(group.hollows[:, 2]).tolist() == pytest.approx([0.25, 0.75])
    assert group_of(mesh_of(solid(BOX))).hollows.shape == (0, 4)
    below, above = group.cut(np.array([0.0, 0.0, 1.0]), 0.5)
    assert (len(below.hollows), len(above.hollows)) == (1, 1)
    below, above = group.cut(np.array([1.0, 0.0, 0.0]), 1.0)  # it is on the plane, which has parted it
    assert len(below.hollows) == len(above.hollows) == 0
    tee = prism(*TEE)
    ((axis, at),) = group_of(mesh_of(tee[:, ::-1] if turned else tee)).planes()  # where the stem meets the bar
    assert np.allclose(np.abs(axis), (0.0, 1.0, 0.0), atol=1e-12)
    assert abs(at) == pytest.approx(1.0)


def test_a_cut_closes_each_surface_on_its_own() -> None:
    """Of a rod through a block the section has both, one upon the other."""
    block, rod = solid(BOX), solid(BOX * (0.2, 0.2, 3.0) + (0.4, 0.4, -1.0))
    below, above = group_of(mesh_of(block, rod)).cut(np.array([0.0, 0.0, 1.0]), 0.5)
    for side in (below, above):
        sizes = []
        for number in range(2):
            corners = side.triangles[side.solids == number]
            flat = corners[np.all(corners[..., 2] == 0.5, axis=1)]
            crossed = np.cross(flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0])
            sizes.append(0.5 * float(np.linalg.norm(crossed, axis=1).sum()))
        assert sizes == pytest.approx([1.0, 0.04])


def test_solids_that_are_set_together_are_parts() -> None:
    """Three boxes askew, which no plane parts without leaving corners: each is one part, and nothing sticks out."""
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    boxes = [BOX * (0.3, 0.1, 0.1), (BOX * (0.1, 0.1, 0.3)) @ turn + 0.05, BOX * (0.1, 0.3, 0.1) + (0.1, -0.1, 0.15)]
    mesh = mesh_of(*map(solid, boxes))
    (cover,) = cover_meshes([("m", "l", mesh)], 0.002, most=3)
    assert cover.proof.is_complete
    assert len(cover.marks) == 3
    assert cover.excess <= 0.0005  # the ball that fills clefts
