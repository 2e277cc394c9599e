"""A mesh in parts: what is joined again sticks out no further, and what is said of a part is said anew."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pinbound.annotations import Hull
from pinbound.coverage import mesh_covers, partition
from pinbound.coverage.excess import excess_of
from pinbound.coverage.mesh_covers import cover_meshes
from pinbound.coverage.mesh_proof import NONE, prove, unheld
from pinbound.coverage.near import Near
from pinbound.coverage.partition import Partition
from pinbound.coverage.solids import Group
from pinbound.meshes import Mesh
from test_covers import prism


def star(points: int) -> Mesh:
    """Return a star whose tips are 0.1 m, and whose notches are 0.05 m, from its middle."""
    n = 2 * points
    turns = np.linspace(0.0, 2.0 * np.pi, n, endpoint=False)
    plan = np.column_stack((np.cos(turns), np.sin(turns))) * np.where(np.arange(n) % 2, 0.05, 0.1)[:, None]
    inner = [(1, 2 * i + 1, 2 * i + 3) for i in range(1, points - 1)]
    return prism(plan, inner + [(2 * i, 2 * i + 1, (2 * i - 1) % n) for i in range(points)], 0.05)


def without_joining(mesh: Mesh, accuracy: float, most: int, monkeypatch: pytest.MonkeyPatch) -> Any:
    with monkeypatch.context() as patch:
        patch.setattr(mesh_covers, "_improve", lambda *_: None)
        return cover_meshes([("m", "l", mesh)], accuracy, most=most)[0]


def test_parts_are_joined_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """A first cut through a star leaves tips in two that one part may hold."""
    cut = without_joining(star(5), 0.005, 16, monkeypatch)
    (cover,) = cover_meshes([("m", "l", star(5))], 0.005, most=16)
    assert cut.excess <= 0.005
    assert len(cover.marks) < len(cut.marks)
    assert cover.excess <= 0.005
    assert cover.proof.is_complete


def test_few_parts_are_found_by_way_of_more(monkeypatch: pytest.MonkeyPatch) -> None:
    """Four parts for six tips: those that are left when eight are joined stick out half as far as four cuts leave."""
    cut = without_joining(star(6), 0.01, 4, monkeypatch)
    (cover,) = cover_meshes([("m", "l", star(6))], 0.01, most=4)
    assert len(cover.marks) <= len(cut.marks) == 4
    assert cover.excess < 0.7 * cut.excess
    assert cover.proof.is_complete


def test_a_cover_is_never_worse_than_that_of_cuts_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever joining leads to: here it is made to join what sticks out most, without a bound."""
    cut = without_joining(star(6), 0.005, 5, monkeypatch)

    def worst(works: Any, limit: float) -> bool:
        found = works[0].joints(np.inf)
        return bool(found) and len(works[0].parts) > 2 and works[0].join(found[-1], np.inf)

    monkeypatch.setattr(mesh_covers, "_join_best", worst)
    cut_up_to = mesh_covers._cut
    monkeypatch.setattr(mesh_covers, "_cut", lambda works, most, *patience: cut_up_to(works, min(most, 5), *patience))
    (cover,) = cover_meshes([("m", "l", star(6))], 0.005, most=5)
    assert cover.excess <= cut.excess
    assert [mark.shape.vertices.tolist() for mark in cover.marks] == [
        mark.shape.vertices.tolist() for mark in cut.marks
    ]


def test_what_was_said_of_a_part_is_said_again_when_what_is_beside_it_changes() -> None:
    """A box with a dent of 40 mm. The hull of two others, 0.25 mm away, shuts it, but they do not as two parts.

    Boxes around the first and that hull do not meet, but the ball about all parts fills what is between them.
    """
    square = np.array([(0.0, 0.0), (0.1, 0.0), (0.1, 0.1), (0.0, 0.1)])
    box = prism(square, [(0, 1, 2), (0, 2, 3)], 0.1)
    rim = np.array([(0.1, 0.03, 0.03), (0.1, 0.07, 0.03), (0.1, 0.07, 0.07), (0.1, 0.03, 0.07)])
    dented = box.triangles[~np.all(box.vertices[box.triangles][..., 0] == 0.1, axis=1)]
    turn = [(i, (i + 1) % 4) for i in range(4)]
    ring = [
        face for i, j in turn for face in (((1, 2, 6, 5)[i], (1, 2, 6, 5)[j], 8 + j), ((1, 2, 6, 5)[i], 8 + j, 8 + i))
    ]
    dent = [(8 + i, 8 + j, 12) for i, j in turn]
    bar, shift = box.vertices * (1.0, 0.2, 1.0), np.array([0.10025, 0.0, 0.0])
    vertices = np.vstack(
        (box.vertices, rim, [(0.06, 0.05, 0.05)], bar + shift, bar + shift + np.array([0.0, 0.08, 0.0]))
    )
    rows = np.vstack((dented, ring, dent, box.triangles + 13, box.triangles + 21))
    work = Partition("m", "l", Mesh(vertices, rows, np.arange(len(rows))), "hulls", 0.002)
    (whole,) = work.parts
    first, others = whole.group.of_solids(whole.group.triangles[..., 0].max(axis=1) < 0.1001)
    work._change([whole], [work._part(first), work._part(others)])
    left, right = work.parts
    assert 0.0 < right.surface.low[0] - left.surface.high[0] < 0.0003
    work.measure()
    left, right = work.parts
    assert left.excess.bound < 0.002  # the dent is shut in
    bars = others.of_solids(others.triangles[..., 1].max(axis=1) < 0.05)
    work._change([right], [work._part(bar) for bar in bars])
    work.measure()
    anew = excess_of(work.surfaces, work.near, work.around, work.accuracy, range(3))
    assert [part.excess.bound for part in work.parts] == [one.bound for one in anew]
    assert work.bound > 0.01


def test_a_gap_that_rounding_left_asks_for_a_ball_and_no_more() -> None:
    """The marks of two boxes that make an angle, one of them smaller by 1e-11 m: triangles over the cut have a gap."""
    plan = np.array([(0.0, 0.0), (0.3, 0.0), (0.3, 0.1), (0.1, 0.1), (0.1, 0.3), (0.0, 0.3)])
    work = Partition("m", "l", prism(plan, [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)], 0.05), "hulls", 0.005)
    work.cut()
    work.measure()
    bound = work.bound
    old = work.parts[1].mark
    assert isinstance(old, Hull)
    vertices = np.array(old.vertices)
    vertices += 1e-11 * np.sign(vertices.mean(axis=0) - vertices)
    small = replace(old, vertices=tuple(map(tuple, vertices.tolist())))
    work.parts[1] = replace(work.parts[1], mark=small)
    proof = prove(work.mesh, [part.mark for part in work.parts])
    left = unheld(work.mesh, [part.mark for part in work.parts], np.flatnonzero(proof.part_of == NONE))
    assert 0 < len(left)
    cover = mesh_covers._finished(work)
    assert cover.proof.is_complete
    mark = cover.marks[1]
    assert isinstance(mark, Hull)
    assert mark.vertices == small.vertices
    assert 1e-11 < mark.radius < 1e-10
    assert cover.excess == pytest.approx(bound, abs=1e-9)


def test_what_no_piece_mends_is_taken_in_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where pieces that are taken in do not help, whole triangles do."""

    def nothing(*asked: Any) -> dict[int, list[Any]]:
        return {row: [] for row in unheld(*asked)}

    monkeypatch.setattr(mesh_covers, "unheld", nothing)
    work = Partition("m", "l", star(5), "hulls", 0.005)
    work.cut()
    small = replace(work.parts[1].mark, vertices=tuple(map(tuple, (0.9 * work.parts[1].mark.shape.vertices).tolist())))
    work.parts[1] = replace(work.parts[1], mark=small)
    assert not prove(work.mesh, [part.mark for part in work.parts]).is_complete
    assert mesh_covers._finished(work).proof.is_complete


def test_whole_triangles_are_taken_in_only_where_a_piece_is_not_held(monkeypatch: pytest.MonkeyPatch) -> None:
    """Triangles over the cut of an angle are held by both parts together, though the proof as a whole fails."""
    plan = np.array([(0.0, 0.0), (0.3, 0.0), (0.3, 0.1), (0.1, 0.1), (0.1, 0.3), (0.0, 0.3)])
    work = Partition("m", "l", prism(plan, [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)], 0.05), "hulls", 0.005)
    work.cut()
    marks = [part.mark for part in work.parts]
    assert len(prove(work.mesh, marks).jointly) > 1
    corner = np.array([0.3, 0.1, 0.05])
    place = int(np.argmin([np.linalg.norm(one.shape.vertices - corner, axis=1).min() for one in marks]))
    small = np.array(marks[place].shape.vertices)
    small[np.linalg.norm(small - corner, axis=1) < 1e-9] -= 0.01
    marks[place] = Hull(marks[place].name, "l", tuple(map(tuple, small.tolist())))
    open_rows = np.flatnonzero(prove(work.mesh, marks).part_of == NONE)
    missing = unheld(work.mesh, marks, open_rows)
    touching = np.any(np.all(work.mesh.vertices[work.mesh.triangles] == corner, axis=2), axis=1)
    assert set(missing) <= set(np.flatnonzero(touching).tolist())
    assert 0 < len(missing) < len(open_rows)


def test_what_closes_a_cut_is_known_to_be_no_surface() -> None:
    """Two cuts through a box: the first lid is cut by the second plane, and its pieces stay what they are."""
    plan = np.array([(0.0, 0.0), (0.3, 0.0), (0.3, 0.2), (0.0, 0.2)])
    group = Partition("m", "l", prism(plan, [(0, 1, 2), (0, 2, 3)], 0.1), "hulls", 0.005).parts[0].group
    assert group.is_surface.all()
    left, _ = group.cut(np.array([1.0, 0.0, 0.0]), 0.1)
    front, back = left.cut(np.array([0.0, 1.0, 0.0]), 0.05)
    for part, lids in ((left, 0.02), (front, 0.015), (back, 0.025)):
        closing = part.triangles[~part.is_surface]
        assert np.all((closing[..., 0] == 0.1).all(axis=1) | (closing[..., 1] == 0.05).all(axis=1))
        ends = closing[:, 1:] - closing[:, :1]
        assert 0.5 * np.linalg.norm(np.cross(ends[:, 0], ends[:, 1]), axis=1).sum() == pytest.approx(lids)
    again = front.joined(back).with_more(np.zeros((1, 3, 3)))
    assert np.count_nonzero(~again.is_surface) == np.count_nonzero(~front.is_surface) + np.count_nonzero(
        ~back.is_surface
    )


def leaves(piece: Group) -> Any:
    """Return what cuts a piece off, and leaves the group as it is."""

    def cut(group: Group, *_: Any) -> tuple[Group, Group]:
        return group, piece

    return cut


@pytest.mark.parametrize(("at", "kept"), [((0.05, 0.05, 0.02), 3), ((0.2, 0.2, 0.02), 2)])
def test_a_piece_without_surface_is_a_part_only_inside_the_body(
    at: tuple[float, float, float], kept: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Lids may reach over the pocket of an angle: a piece of these alone holds nothing, and is not of the body."""
    plan = np.array([(0.0, 0.0), (0.3, 0.0), (0.3, 0.1), (0.1, 0.1), (0.1, 0.3), (0.0, 0.3)])
    work = Partition("m", "l", prism(plan, [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)], 0.05), "hulls", 0.005)
    work.cut()
    whole = work.parts[0].group
    piece = 0.01 * np.array([[(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 0, 0), (0, 1, 0), (0, 0, 1)]]) + at
    nothing = Group(piece, np.zeros(2, np.int64), np.zeros(2, np.bool_), whole.hollows)
    monkeypatch.setattr(partition, "best_cut", leaves(nothing))
    work.parts = [replace(part, excess=replace(part.excess, bound=0.1)) for part in work.parts]
    work.cut()
    assert len(work.parts) == kept


def test_a_cut_that_only_leaves_something_out_and_does_not_help_is_the_last(monkeypatch: pytest.MonkeyPatch) -> None:
    work = Partition("m", "l", star(5), "hulls", 0.005)
    nothing = Group(np.ones((1, 3, 3)), np.zeros(1, np.int64), np.zeros(1, np.bool_), np.zeros((0, 4)))
    monkeypatch.setattr(partition, "best_cut", leaves(nothing))
    assert work.can_be_cut
    work.cut()
    assert len(work.parts) == 1
    assert not work.can_be_cut


def test_a_place_is_inside_a_closed_surface_whichever_way_it_is_turned() -> None:
    plan = np.array([(0.0, 0.0), (0.3, 0.0), (0.3, 0.1), (0.1, 0.1), (0.1, 0.3), (0.0, 0.3)])
    mesh = prism(plan, [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)], 0.05)
    turned = replace(mesh, triangles=mesh.triangles[:, ::-1].copy())
    random = np.random.default_rng(1)
    for x, y, z in random.uniform((-0.05, -0.05, -0.02), (0.35, 0.35, 0.07), size=(200, 3)).tolist():
        inside = 0.0 < z < 0.05 and x > 0.0 and y > 0.0 and ((x < 0.3 and y < 0.1) or (x < 0.1 and y < 0.3))
        for one in (mesh, turned):
            assert Near(one).is_inside(np.array([x, y, z])) == inside
    open_one = replace(mesh, triangles=mesh.triangles[4:], polygons=mesh.polygons[4:])
    assert not Near(open_one).is_inside(np.array([0.05, 0.05, -0.01]))


def test_cuts_that_do_not_help_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each cut parts a group in two that stick out as far as one did."""
    work = Partition("m", "l", star(6), "hulls", 0.001)
    cuts: list[int] = []

    def vain() -> None:
        cuts.append(1)
        work.parts = [*work.parts, work.parts[0]]

    monkeypatch.setattr(work, "cut", vain)
    mesh_covers._cut([work], 100, mesh_covers._RECUTS)
    assert len(cuts) == mesh_covers._RECUTS
    mesh_covers._cut([work], 30)
    assert len(work.parts) == 30
