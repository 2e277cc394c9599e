"""Covers of meshes: every triangle is in a mark, no outer surface is further away than said, whoever looks again."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial import ConvexHull
from typer.testing import CliRunner

import pinbound as pb
from pinbound.cli import app
from pinbound.coverage import Status, excess, planes
from pinbound.coverage.covers import covers
from pinbound.coverage.cuts import cut_by_plane
from pinbound.coverage.excess import excess_of
from pinbound.coverage.mesh_covers import cover_meshes
from pinbound.coverage.mesh_proof import JOINTLY, away_from, prove
from pinbound.coverage.near import Near
from pinbound.coverage.parts import FITS, outline
from pinbound.coverage.planes import best_cut
from pinbound.coverage.polytopes import Polytope, split_polygon
from pinbound.coverage.solids import group_of
from pinbound.coverage.surfaces import surface_of
from pinbound.meshes import Mesh, read_mesh

L_FACES = "f 6 5 4 3 2 1\nf 7 8 9 10 11 12\n" + "\n".join(f"f {i} {i % 6 + 1} {i % 6 + 7} {i + 6}" for i in range(1, 7))
L_PLAN = ((0.0, 0.0), (0.3, 0.0), (0.3, 0.1), (0.1, 0.1), (0.1, 0.3), (0.0, 0.3))
L_SHAPE = "\n".join(f"v {x} {y} {z}" for z in (0.0, 0.05) for x, y in L_PLAN) + "\n" + L_FACES + "\n"
"""An angle of 0.3 m by 0.3 m, 0.1 m wide and 0.05 m high, of eight polygons, its hull 0.1 m too large."""
RNG = np.random.default_rng(14)


def angle(folder: Path) -> Mesh:
    (folder / "angle.obj").write_text(L_SHAPE)
    return read_mesh(folder / "angle.obj")


def triangles(mesh: Mesh) -> Mesh:
    """Return a mesh whose triangles may each be held by another mark."""
    return Mesh(mesh.vertices, mesh.triangles, np.arange(len(mesh.triangles)))


def bumpy(count: int = 8) -> Mesh:
    """Return a ball with a dent and two spikes."""
    turns, heights = np.linspace(0, 2 * np.pi, count, endpoint=False), np.linspace(0.1, np.pi - 0.1, count)
    grid = np.array([(np.sin(h) * np.cos(t), np.sin(h) * np.sin(t), np.cos(h)) for h in heights for t in turns])
    radius = 0.1 + 0.04 * (grid @ (1.0, 0.0, 0.0) > 0.9) - 0.05 * np.exp(-20 * ((grid - (0, 1, 0)) ** 2).sum(axis=1))
    rows = [(i * count + j, i * count + (j + 1) % count) for i in range(count - 1) for j in range(count)]
    faces = [face for a, b in rows for face in ((a, b, a + count), (b, b + count, a + count))]
    return Mesh(grid * radius[:, None], np.array(faces), np.arange(len(faces)))


def on_triangles(mesh: Mesh, count: int) -> Any:
    rows = RNG.integers(0, len(mesh.triangles), count)
    return np.einsum("nk,nki->ni", RNG.dirichlet(np.ones(3), count), mesh.vertices[mesh.triangles[rows]])


def outside(marks: Any, points: Any) -> Any:
    """Return how far points are outside all of the marks, by the nearest points of their hulls."""
    return np.min([away_from(mark.shape, points) - mark.shape.radius for mark in marks], axis=0)


@pytest.mark.parametrize("flat", [1.0, 1e-3, 1e-7])
def test_a_polytope_knows_what_is_inside(flat: float) -> None:
    points = RNG.normal(size=(40, 3)) * (1.0, 0.5, flat)
    polytope = Polytope.of(points)
    assert polytope is not None
    asked = RNG.normal(size=(2000, 3)) * (1.0, 0.5, flat)
    hull = ConvexHull(points / (1.0, 0.5, flat))
    height = (hull.equations @ np.column_stack((asked / (1.0, 0.5, flat), np.ones(len(asked)))).T).max(axis=0)
    clear = np.abs(height) > 1e-6
    assert np.array_equal((polytope.away(asked) == 0.0)[clear], (height < 0.0)[clear])
    shape = pb.Hull("h", "l", tuple(map(tuple, points.tolist()))).shape
    assert np.all(polytope.away(asked) >= away_from(shape, asked) - 1e-12)


def test_a_surface_that_is_not_closed_is_no_proof(monkeypatch: pytest.MonkeyPatch) -> None:
    from pinbound.coverage import polytopes

    points = RNG.normal(size=(20, 3))
    whole = polytopes._proposed(points)
    assert whole is not None
    inner = RNG.normal(size=(5, 3)) * 0.01
    for facets in (whole[1:], np.vstack((whole, whole[:1])), whole[:, ::-1], np.vstack((whole[1:], whole[:1, ::-1]))):
        with monkeypatch.context() as patch:
            patch.setattr(polytopes, "_proposed", lambda _, facets=facets: facets)
            assert Polytope.of(points) is None
    swapped = whole.copy()
    swapped[whole == whole[0, 0]] = 20  # a vertex of the surface is replaced by a point inside
    with monkeypatch.context() as patch:
        patch.setattr(polytopes, "_proposed", lambda _: swapped)
        found = Polytope.of(np.vstack((points, inner[:1])))
    assert found is None or found.slack > 0.01


@pytest.mark.parametrize("kind", ["three on a line", "two in one place"])
def test_slivers_are_replaced_and_proven(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A corner within rounding of an edge, or of another corner, as Qhull may leave it: seen from behind."""
    from pinbound.coverage import polytopes

    points = np.array([[0.0, 0, 0], [1.0, 0.1, 0.2], [0.2, 1.0, 0.1], [0.3, 0.2, 1.0], [0.0, 0, 0]])
    inner = points[:4].mean(axis=0)
    if kind == "three on a line":  # the middle of the first edge, and a little inside
        middle = 0.5 * (points[0] + points[1])
        points[4] = middle + 1e-15 * (inner - middle)
    else:
        points[4] = points[0] + 1e-15 * (inner - points[0])
    facets = np.array([[2, 1, 0], [0, 1, 4], [0, 4, 3], [4, 1, 3], [1, 2, 3], [2, 0, 3]])
    monkeypatch.setattr(polytopes, "_proposed", lambda _: facets)
    polytope = Polytope.of(points)
    assert polytope is not None
    assert polytope.slack < 1e-12
    asked = RNG.normal(size=(2000, 3)) * 0.5 + inner
    shape = pb.Hull("h", "l", tuple(map(tuple, points[:4].tolist()))).shape
    exact = away_from(shape, asked)
    assert np.all(polytope.away(asked) >= exact - 1e-12)
    clear = (exact < 1e-12) | (exact > 1e-6)
    assert np.array_equal((polytope.away(asked) > 1e-9)[clear], (exact > 1e-9)[clear])
    monkeypatch.setattr(polytopes, "_without", lambda facets, *_: facets)
    assert Polytope.of(points) is None


def test_flat_points_have_no_polytope() -> None:
    assert Polytope.of(np.column_stack((RNG.normal(size=(9, 2)), np.zeros(9)))) is None
    assert Polytope.of(np.eye(3)) is None


def test_a_polygon_is_split_where_it_is_cut() -> None:
    polygon = np.array([[0.0, 0, 0], [1.0, 0, 0], [1.0, 1.0, 0], [0, 1.0, 0]])
    below, above = split_polygon(polygon, polygon[:, 0] + polygon[:, 1] - 1.5)
    assert (len(below), len(above)) == (5, 3)
    assert np.allclose(np.sort(above[:, :2].sum(axis=1)), (1.5, 1.5, 2.0))


@pytest.mark.parametrize("fit", FITS)
@pytest.mark.parametrize("name", ["angle", "bumpy"])
def test_every_triangle_is_held_and_the_excess_is_a_bound(fit: Any, name: str, tmp_path: Path) -> None:
    mesh = triangles(angle(tmp_path)) if name == "angle" else bumpy()
    (cover,) = cover_meshes([("m", "l", mesh)], 0.01, fit, most=3)
    assert cover.proof.is_complete
    assert 1 <= len(cover.marks) <= 3
    points = np.vstack((on_triangles(mesh, 1000), mesh.vertices))
    assert outside(cover.marks, points).max() <= 2e-12
    near, worst = Near(mesh), 0.0
    hulls = [outline(mark) for mark in cover.marks]
    shapes = [pb.Hull("h", "l", tuple(map(tuple, vertices.tolist()))).shape for vertices, _ in hulls]
    around = max(radius for _, radius in hulls)
    if len(hulls) > 1:
        around = max(around + 1e-6, 0.001)  # a tenth of the accuracy
    for vertices, _ in hulls:  # places of the surface of all hulls with balls of this radius
        if Polytope.of(vertices) is None:
            continue  # flat
        hull = ConvexHull(vertices)
        rows = RNG.integers(0, len(hull.simplices), 600)
        surface = np.einsum("nk,nki->ni", RNG.dirichlet(np.ones(3), 600), vertices[hull.simplices[rows]])
        surface = surface + around * hull.equations[rows, :3]
        away = np.min([away_from(shape, surface) for shape in shapes], axis=0)
        surface = surface[away >= around - 1e-9]
        if len(surface):
            worst = max(worst, float(near.bounds(np.repeat(surface[:, None], 3, axis=1))[1].max()))
    assert 0.0 < worst <= cover.excess


def test_parts_stick_out_less_than_one_hull(tmp_path: Path) -> None:
    """Its hull sticks out by 0.1 m over the inner corner."""
    mesh = triangles(angle(tmp_path))
    (one,) = cover_meshes([("m", "l", mesh)], 1.0)
    assert len(one.marks) == 1
    assert one.excess == pytest.approx(0.1, rel=1e-6)
    (more,) = cover_meshes([("m", "l", mesh)], 0.05, most=4)
    assert 1 < len(more.marks) <= 4  # which parts are found is a search, not a proof
    assert more.excess < one.excess
    assert JOINTLY in more.proof.part_of


def test_what_is_not_held_is_not_proven(tmp_path: Path) -> None:
    mesh = triangles(angle(tmp_path))
    (cover,) = cover_meshes([("m", "l", mesh)], 0.05, most=4)
    for place, mark in enumerate(cover.marks):
        others = [one for one in cover.marks if one is not mark]
        assert not prove(mesh, others).is_complete
        vertices = mark.shape.vertices
        for corner in range(0, len(vertices), 5):
            less = vertices.copy()
            less[corner] += 1e-6 * (vertices.mean(axis=0) - vertices[corner])
            smaller = pb.Hull(mark.name, "l", tuple(map(tuple, less.tolist())))
            moved = [*others[:place], smaller, *others[place:]]
            proof = prove(mesh, moved)
            points = np.vstack((on_triangles(mesh, 200), mesh.vertices))
            assert not proof.is_complete or outside(moved, points).max() <= 2e-12


def test_a_gap_between_two_marks_is_seen() -> None:
    mesh = Mesh(np.array([[0.0, 0, 0], [1.0, 0, 0], [0.5, 0.5, 0]]), np.array([[0, 1, 2]]), np.zeros(1, np.int64))
    for gap in (0.0, 1e-9):
        left = pb.Box("a", "l", (0.25 - gap / 2, 0.25, 0.0), (0.0, 0.0, 0.0), (0.5 - gap, 0.5, 0.1))
        right = pb.Box("b", "l", (0.75, 0.25, 0.0), (0.0, 0.0, 0.0), (0.5, 0.5, 0.1))
        proof = prove(mesh, [left, right])
        assert proof.is_complete == (gap == 0.0)
    assert proof.parts == ("a", "b")


def test_what_only_the_hull_itself_holds_is_held_in_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    """The triangles of the second mark leave its apex out by 1e-6 m, as may happen to a corner beside slivers."""
    from pinbound.coverage import polytopes

    box = np.array([(x, y, z) for x in (0.0, 0.1) for y in (0.0, 0.1) for z in (0.0, 0.1)])
    facets = polytopes._proposed(box)
    apex = np.array([0.15, 0.05, 0.1 + 1e-6])
    corners = np.array([[0.05, 0.04, 0.05], [0.05, 0.06, 0.05], apex])
    mesh = Mesh(corners, np.array([[0, 1, 2]]), np.zeros(1, np.int64))
    marks = [
        pb.Hull(name, "l", tuple(map(tuple, np.vstack((box + at, apex if name == "b" else at)).tolist())))
        for name, at in (("a", np.zeros(3)), ("b", np.array([0.1, 0.0, 0.0])))
    ]
    monkeypatch.setattr(polytopes, "_proposed", lambda _: facets)
    polytope = Polytope.of(marks[1].shape.vertices)
    assert polytope is not None
    assert 1e-7 < polytope.slack < 1e-5
    assert prove(mesh, marks).jointly == {0: (0, 1)}
    assert not prove(mesh, [marks[0], pb.Hull("b", "l", marks[1].vertices[:8])]).is_complete


def test_a_polytope_around_a_ball_holds_it() -> None:
    for mark in (
        pb.Point("p", "l", (0.1, 0.2, 0.3), 0.05),
        pb.Segment("s", "l", (0.0, 0.0, 0.0), (0.1, 0.0, 0.1), 0.05),
    ):
        vertices, radius = outline(mark)
        assert radius == 0.0
        units = RNG.normal(size=(2000, 3))
        units *= 0.05 / np.linalg.norm(units, axis=1, keepdims=True)
        ball = pb.Hull("h", "l", tuple(map(tuple, vertices.tolist())))
        for end in mark.shape.vertices:
            assert away_from(ball.shape, end + units).max() <= 1e-12


def test_hidden_surface_counts_only_where_it_is_hidden() -> None:
    """Two boxes beside each other have no surface between them; with a gap of 1 mm they have."""
    box = np.array([(x, y, z) for x in (0.0, 0.1) for y in (0.0, 0.1) for z in (0.0, 0.1)])
    beside = box + np.array([0.1, 0.0, 0.0])
    hull = ConvexHull(np.vstack((box, beside)))
    whole = Mesh(hull.points, hull.simplices.astype(np.int64), np.arange(len(hull.simplices)))
    near = Near(whole)
    for gap, limit in ((0.0, (0.0, 0.001)), (0.001, (0.04, 0.06))):
        parts = [surface_of(box - np.array([gap, 0.0, 0.0]), 0.0), surface_of(beside, 0.0)]
        found = max(one.bound for one in excess_of(parts, near, 1e-4, 0.01, range(2)))
        assert limit[0] <= found - gap <= limit[1] + 2e-4


def test_a_corner_that_is_shut_in_by_parts_is_no_outer_surface() -> None:
    """Eight boxes around the middle of a cube, turned so that rounding plays its part; without one there is a notch."""
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    box = np.array([(x, y, z) for x in (0.0, 0.05) for y in (0.0, 0.05) for z in (0.0, 0.05)])
    hull = ConvexHull((2.0 * box - 0.05) @ turn)
    near = Near(Mesh(hull.points, hull.simplices.astype(np.int64), np.arange(len(hull.simplices))))
    parts = [surface_of((box - 0.05 * np.array(at)) @ turn, 0.0) for at in np.ndindex(2, 2, 2)]
    assert max(one.bound for one in excess_of(parts, near, 1e-3, 0.01, range(8))) <= 1e-3 + 1e-9
    notched = max(one.bound for one in excess_of(parts[1:], near, 1e-3, 0.01, range(7)))
    assert 0.05 <= notched <= 0.055
    # Parts that meet one another at other places than their corners, in the middle of a face and of an edge.
    halves = [(box * (2.0, 2.0, 1.0) - (0.05, 0.05, 0.0)) @ turn, (box * (2.0, 1.0, 1.0) - (0.05, 0.05, 0.05)) @ turn]
    quarters = [(box - (0.0, 0.0, 0.05)) @ turn, (box - (0.05, 0.0, 0.05)) @ turn]
    parts = [surface_of(one, 0.0) for one in (*halves, *quarters)]
    assert max(one.bound for one in excess_of(parts, near, 1e-3, 0.01, range(4))) <= 1e-3 + 1e-9


def test_a_long_edge_inside_the_body_is_halved_until_other_parts_hold_its_pieces() -> None:
    """A bar of 1 m in four: an inner edge of two parts leads past where the two others meet, and the ball is 0.1 mm."""
    box = np.array([(x, y, z) for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
    whole = ConvexHull((box - (0.5, 0.0, 0.5)) * (0.2, 1.0, 0.2))
    near = Near(Mesh(whole.points, whole.simplices.astype(np.int64), np.arange(len(whole.simplices))))
    low = np.array([[-0.1, 0.0, -0.1], [-0.1, 0.317, -0.1], [0.0, 0.0, -0.1], [0.0, 0.0, 0.0]])
    size = np.array([[0.1, 0.317, 0.2], [0.1, 0.683, 0.2], [0.1, 1.0, 0.1], [0.1, 1.0, 0.1]])
    parts = [surface_of(at + box * by, 0.0) for at, by in zip(low, size, strict=True)]
    assert max(one.bound for one in excess_of(parts, near, 1e-4, 0.002, range(4))) <= 1e-4 + 1e-9


def test_what_is_buried_has_nothing_of_the_outer_surface() -> None:
    """Along each normal on an edge or vertex that is left out, other parts are nearer than the ball is wide.

    The parts are 14 slanted boxes into which one is cut, less three of them: there are corners of all kinds.
    """
    random = np.random.default_rng(5)
    boxes = [np.array([[0.0, 0.0, 0.0], [0.2, 0.2, 0.2]])]
    while len(boxes) < 14:
        low, high = boxes.pop(0)
        axis = int(random.integers(3))
        at = random.uniform(0.3, 0.7) * (high[axis] - low[axis]) + low[axis]
        for side in range(2):
            half = np.array([low, high])
            half[1 - side, axis] = at
            boxes.append(half)
    slant = random.normal(size=(3, 3))
    corners = np.array(list(np.ndindex(2, 2, 2)))
    kept = [box[corners, np.arange(3)] @ slant for place, box in enumerate(boxes) if place not in (2, 5, 11)]
    parts = [surface_of(one, 0.0) for one in kept]
    shapes = [pb.Hull("h", "l", tuple(map(tuple, one.tolist()))).shape for one in kept]
    around, counted, looked = 2e-3, 0, 0
    for place, own in enumerate(parts):
        hull, rest = ConvexHull(kept[place]), own.pieces[1].corners
        pieces = np.concatenate((rest, rest.mean(axis=1, keepdims=True).repeat(3, axis=1)))
        others = [one for row, one in enumerate(parts) if row != place]
        buried = excess._buried(pieces, np.concatenate((rest, rest)), own, others, around)
        looked += len(buried)
        for piece in pieces[buried]:
            at = random.dirichlet(np.ones(3)) @ piece
            normals = hull.equations[np.abs(hull.equations @ (*at, 1.0)) < 1e-9, :3]  # of the faces on which it lies
            units = np.vstack((normals, random.dirichlet(np.full(len(normals), 0.3), 20) @ normals))
            out = at + around * units / np.linalg.norm(units, axis=1, keepdims=True)
            away = np.min([away_from(one, out) for row, one in enumerate(shapes) if row != place], axis=0)
            assert away.max() < around
            counted += 1
    assert 20 < counted < looked


ARM = """<robot name="arm"><link name="base"><collision><geometry>
<mesh filename="angle.obj"/></geometry></collision></link>
<link name="mid"/><link name="hand"><collision><origin xyz="0 0 0.1" rpy="0.3 0 0"/><geometry>
<mesh filename="angle.obj" scale="0.5 -0.5 0.5"/></geometry></collision></link>
<joint name="a" type="revolute"><parent link="base"/><child link="mid"/><origin xyz="0 0 0.3"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
<joint name="b" type="revolute"><parent link="mid"/><child link="hand"/><origin xyz="0 0 0.1"/><axis xyz="0 1 0"/>
<limit lower="-3" upper="3" effort="1" velocity="1"/></joint></robot>"""


def test_marks_are_found_again_to_hold_the_meshes(tmp_path: Path) -> None:
    (tmp_path / "angle.obj").write_text(L_SHAPE)
    (tmp_path / "arm.urdf").write_text(ARM)
    robot = pb.load(tmp_path / "arm.urdf")
    proposal = pb.propose_marks(robot, accuracy=0.05, most=4)
    assert not proposal.uncovered
    assert 0.0 < proposal.excess < 0.1
    proposal.annotations.save(tmp_path / "arm.pinbound.yaml")
    coverage = pb.load(tmp_path / "arm.urdf").coverage
    assert [body.is_held for body in coverage.bodies] == [True, True]
    (pair,) = coverage.pairs
    assert pair.status is Status.WATCHED
    (tmp_path / "angle.obj").write_text(L_SHAPE.replace("v 0.3 0.1 0.05", "v 0.31 0.1 0.05"))
    coverage = pb.load(tmp_path / "arm.urdf").coverage
    assert not any(body.is_held for body in coverage.bodies)
    (tmp_path / "angle.obj").unlink()
    assert "angle.obj: there is no such file" in pb.load(tmp_path / "arm.urdf").coverage.bodies[0].reason


def test_a_mesh_that_cannot_be_read_is_an_error_or_is_named(tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text(ARM)
    robot = pb.load(tmp_path / "arm.urdf")
    proposal = pb.propose_marks(robot)
    assert [body.link for body in proposal.uncovered] == ["base", "hand"]
    assert any("angle.obj: there is no such file" in note for note in proposal.notes)
    with pytest.raises(pb.InputError, match="--skip-missing"):
        pb.propose_marks(robot, skip_missing=False)
    runner = CliRunner()
    assert runner.invoke(app, ["mark", str(tmp_path / "arm.urdf")]).exit_code == 2
    said = runner.invoke(app, ["mark", str(tmp_path / "arm.urdf"), "--skip-missing"])
    assert said.exit_code == 1
    (tmp_path / "angle.obj").write_text(L_SHAPE)
    words = ["mark", str(tmp_path / "arm.urdf"), "--by", "boxes", "--accuracy", "5", "--most", "3", "--json"]
    assert runner.invoke(app, words).exit_code == 0


def test_parts_are_shared_by_the_meshes_of_a_link(tmp_path: Path) -> None:
    (tmp_path / "angle.obj").write_text(L_SHAPE)
    (tmp_path / "arm.urdf").write_text(ARM)
    robot = pb.load(tmp_path / "arm.urdf")
    bodies = pb.propose_marks(robot).covers[0].bodies
    calls: list[tuple[int, int, str]] = []
    one = covers(bodies, 1e-4, "hulls", robot.meshes, 1, lambda *said: calls.append(said))
    assert len(one[0].marks) == 1
    assert calls == [(0, 1, "base"), (1, 1, "")]
    with pytest.raises(pb.DimensionError):
        covers(bodies, 1e-3, "hulls", robot.meshes, 0)


def test_a_cover_that_is_wider_than_asked_for_is_told_with_what_to_type(tmp_path: Path) -> None:
    (tmp_path / "angle.obj").write_text(L_SHAPE)
    (tmp_path / "arm.urdf").write_text(ARM)
    robot, path = pb.load(tmp_path / "arm.urdf"), str(tmp_path / "arm.urdf")
    proposal = pb.propose_marks(robot, accuracy=0.02, most=1)
    (told,) = (note for note in proposal.notes if "requested" in note)
    widest = 1e3 * max(one.excess for one in proposal.covers if one.link == "base")
    assert f"more than the requested 20 mm (base by {widest:.2f} mm" in told
    assert "--most 2, most=2" in told
    assert not any("requested" in note for note in pb.propose_marks(robot, accuracy=0.2, most=1).notes)
    said = CliRunner().invoke(app, ["mark", path, "--accuracy", "20", "--most", "1"]).stdout
    assert "--most 2" in said
    assert "2 meshes: 40 of 40 triangles are proven to lie in the marks." in said
    assert "20 of 20" in said
    found = json.loads(CliRunner().invoke(app, ["mark", path, "--json"]).stdout)["covers"]
    assert [(one["triangles"], one["triangles_held"]) for one in found] == [(20, 20), (20, 20)]


def prism(outline_of: Any, rows: Any, height: float = 0.1) -> Mesh:
    """Return the prism over a polygon (n, 2), its ends cut into the triangles (m, 3)."""
    plan, rows = np.array(outline_of, dtype=np.float64), np.array(rows)
    n = len(plan)
    vertices = np.vstack([np.column_stack((plan, np.full(n, z))) for z in (0.0, height)])
    sides = [face for i in range(n) for face in ((i, (i + 1) % n, n + i), ((i + 1) % n, n + (i + 1) % n, n + i))]
    faces = np.vstack((rows[:, ::-1], rows + n, sides))
    return Mesh(vertices, faces, np.arange(len(faces)))


def test_how_two_surfaces_are_cut_into_triangles_does_not_matter() -> None:
    """A disc in a fan of slivers is its own hull, which Qhull cuts otherwise."""
    turns = np.linspace(0.0, 2.0 * np.pi, 64, endpoint=False)
    mesh = prism(0.1 * np.column_stack((np.cos(turns), np.sin(turns))), [(0, i, i + 1) for i in range(1, 63)])
    (cover,) = cover_meshes([("m", "l", mesh)], 0.002)
    assert len(cover.marks) == 1
    (near, surface) = Near(mesh), surface_of(mesh.vertices, 0.0)
    (found,) = excess_of([surface], near, 1e-9, 1e-6, range(1))
    assert found.bound <= 1e-6


def test_two_boxes_set_together_are_two_boxes() -> None:
    """The plane of a face is where they meet: with two parts nothing sticks out but the ball that fills clefts."""
    (cover,) = cover_meshes([("m", "l", prism(L_PLAN, [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)], 0.05))], 0.005)
    assert len(cover.marks) == 2
    assert cover.excess <= 0.001
    assert cover.proof.is_complete


def test_a_section_is_closed_over_the_body_alone() -> None:
    """Of an angle it is the angle, of a tube the ring, and where a wider body begins each side has its own."""
    corner = np.array(L_PLAN)
    mesh = prism(corner, [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)])
    group, up = mesh.vertices[mesh.triangles], np.array([0.0, 0.0, 1.0])
    for turned in (group, group[:, ::-1]):  # inside out, too
        for side in cut_by_plane(turned, up, 0.04):
            assert flat_area(side.triangles, 0.04) == pytest.approx(0.05, rel=1e-9)
    square = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
    outer, inner = (prism(size * square + at, [(0, 1, 2), (0, 2, 3)]) for size, at in ((0.3, 0.0), (0.1, 0.1)))
    tube = np.concatenate((outer.vertices[outer.triangles], inner.vertices[inner.triangles][:, ::-1]))
    assert flat_area(cut_by_plane(tube, up, 0.04)[0].triangles, 0.04) == pytest.approx(0.08, rel=1e-9)
    overlapping = np.concatenate((outer.vertices[outer.triangles], inner.vertices[inner.triangles]))
    assert flat_area(cut_by_plane(overlapping, up, 0.04)[0].triangles, 0.04) == pytest.approx(0.09, rel=1e-9)
    wide = prism(2.0 * corner, [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)])
    step = np.concatenate((group, wide.vertices[wide.triangles] + (0.0, 0.0, 0.1)))
    below, above = cut_by_plane(step, up, 0.1)
    assert below.triangles[..., 0].max() == pytest.approx(0.3)
    assert above.triangles[..., 0].max() == pytest.approx(0.6)
    assert above.triangles[..., 2].min() == pytest.approx(0.1)


def flat_area(group: Any, at: float) -> float:
    flat = group[np.all(np.abs(group[..., 2] - at) <= 1e-12, axis=1)]
    return float(0.5 * np.linalg.norm(np.cross(flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0]), axis=1).sum())


def test_a_plane_along_a_flat_part_is_no_cut(monkeypatch: pytest.MonkeyPatch) -> None:
    """A plate that is flat but for rounding: a plane between its corners leaves all of it on one side."""
    ticks = np.linspace(0.0, 0.2, 5)
    vertices = np.array(
        [(x, y, 1e-10 * ((7 * i + 3 * j) % 5)) for i, x in enumerate(ticks) for j, y in enumerate(ticks)]
    )
    cells = [5 * i + j for i in range(4) for j in range(4) if i < 2 or j < 2]
    rows = np.array([one for a in cells for one in ((a, a + 5, a + 1), (a + 5, a + 6, a + 1))])
    mesh = Mesh(vertices, rows, np.arange(len(rows)))
    group, place, near = group_of(mesh), np.array([0.15, 0.15, 0.0]), Near(mesh)
    found = best_cut(group, place, 1e-3, near)
    assert found is not None
    assert min(map(len, found)) > 0
    along = np.array([0.0, 0.0, 1.0]), 2e-10
    assert sorted(map(len, group.cut(*along)))[0] == 0
    monkeypatch.setattr(planes, "_planes", lambda *_: [along])
    assert best_cut(group, place, 1e-3, near) is None
