"""Pictures of covers: outlines are those of the marks, and a body that sticks out of its marks is seen to."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

import pinbound as pb
from pinbound.annotations import Box, Hull, Point, Segment
from pinbound.coverage.bodies import collision_bodies
from pinbound.figures.cover_figure import draw_cover, outline_of, picture_of
from pinbound.figures.cover_surfaces import half_spaces
from pinbound.figures.report import write_covers
from test_mesh_pairs import marked

Load = Callable[..., pb.Robot]

BLUE = "#0033CC"


def test_an_outline_is_the_support_of_its_mark() -> None:
    marks = [
        Point("p", "l", (0.1, 0.2, 0.3), 0.05),
        Segment("s", "l", (0.0, 0.0, 0.0), (0.1, -0.2, 0.3), 0.02),
        Box("b", "l", (0.1, 0.0, 0.0), (0.3, 0.4, 0.5), (0.1, 0.2, 0.3), 0.01),
        Hull("h", "l", ((0, 0, 0), (0.1, 0, 0), (0, 0.1, 0), (0, 0, 0.1))),
    ]
    for mark in marks:
        for view in ((0, 1), (0, 2), (1, 2)):
            ring = np.array(outline_of(mark, view).exterior.coords)
            for angle in np.linspace(0.0, 2 * np.pi, 17):
                normal = np.zeros(3)
                normal[list(view)] = np.cos(angle), np.sin(angle)
                support = 1e3 * (np.max(mark.shape.vertices @ normal) + mark.shape.radius)
                drawn = np.max(ring @ normal[list(view)])
                assert support - 0.32 * mark.shape.radius - 1e-9 <= drawn <= support + 1e-9


def blue_points(robot: pb.Robot, link: str, marks: list[object]) -> int:
    bodies = [body for body in collision_bodies(robot) if body.link == link]
    picture = picture_of(link, bodies, [robot.meshes.of(body) for body in bodies], marks, 20)  # type: ignore[arg-type]
    figure = draw_cover(picture, "said")
    return sum(len(line.get_xdata()) for axes in figure.axes for line in axes.lines if line.get_color() == BLUE)


def test_what_sticks_out_of_its_marks_is_blue(load_text: Load, tmp_path: Path) -> None:
    robot = marked(load_text, tmp_path)
    assert blue_points(robot, "b", [robot.annotations.marks["cube"]]) == 0
    small = marked(load_text, tmp_path, size=0.06)
    assert blue_points(small, "b", [small.annotations.marks["cube"]]) == 24  # eight corners in each of three views


def test_the_report_has_a_picture_of_every_link_that_has_marks(load_text: Load, tmp_path: Path) -> None:
    robot = marked(load_text, tmp_path)
    found = list(write_covers(robot, tmp_path))
    assert [(link, name) for link, name, _ in found] == [("base", "cover_0.png"), ("b", "cover_1.png")]
    assert all("1 mesh; 1 mark; " in said for _, _, said in found)
    for _, name, _ in found:
        assert (tmp_path / name).read_bytes().startswith(b"\x89PNG")


def test_half_spaces_of_a_mark_hold_what_the_mark_holds() -> None:
    """Faces of hulls and boxes exactly; balls by polyhedra with their corners on them, at most 3 % inside."""
    rng = np.random.default_rng(3)
    marks = [
        (Point("p", "l", (0.1, 0.2, 0.3), 0.05), 0.03 * 0.05),
        (Segment("s", "l", (0.0, 0.0, 0.0), (0.1, -0.2, 0.3), 0.02), 0.03 * 0.02),
        (Box("b", "l", (0.1, 0.0, 0.0), (0.3, 0.4, 0.5), (0.1, 0.2, 0.3)), 1e-9),
        (Hull("h", "l", ((0, 0, 0), (0.1, 0, 0), (0, 0.1, 0), (0, 0, 0.1))), 1e-9),
    ]
    for mark, less in marks:
        normals, ends = half_spaces(mark)
        directions = rng.normal(size=(200, 3))
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        centre = mark.shape.vertices.mean(axis=0)
        with np.errstate(divide="ignore"):
            rate = normals @ directions.T
            reach = np.where(rate > 0.0, (ends - normals @ centre)[:, None] / rate, np.inf).min(axis=0)
        rim = centre + reach[:, None] * directions
        support = mark.shape.vertices @ directions.T
        height = np.einsum("ki,ki->k", rim, directions)
        assert np.all(height <= support.max(axis=0) + mark.shape.radius + 1e-9)
        most = (normals @ rim.T - ends[:, None]).max(axis=0)
        assert np.abs(most).max() < 1e-9  # on the surface of the polyhedron
        corner = np.argmin(ends)
        deep = ends[corner] - (normals[corner] @ mark.shape.vertices.T).max() - mark.shape.radius
        assert -less <= deep <= 1e-9


def test_colours_are_distances_from_the_body(load_text: Load, tmp_path: Path) -> None:
    """A cube of 0.2 m in a hull of 0.26 m: 30 mm over its faces, and 52 mm at corners."""
    robot = marked(load_text, tmp_path, size=0.13)
    bodies = [body for body in collision_bodies(robot) if body.link == "b"]
    meshes = [robot.meshes.of(body) for body in bodies]
    picture = picture_of("b", bodies, meshes, [robot.annotations.marks["cube"]], 65)
    assert len(picture.views) == 3
    for one in picture.views:
        rows, columns = one.away.shape[1:]
        assert np.abs(one.away[:, rows // 2, columns // 2] - 0.03).max() < 1e-9
        seen = one.mark >= 0
        assert np.all(np.isnan(one.away) == ~seen)
        assert one.away[seen].min() > 0.03 - 1e-9
        share = seen[0].sum() / seen[0].size * np.prod(one.high - one.low)
        assert abs(share - 0.26**2) < 0.006
    assert 0.044 < picture.furthest <= 0.03 * np.sqrt(3) + 1e-9


def test_the_nearer_mark_is_seen(load_text: Load, tmp_path: Path) -> None:
    robot = marked(load_text, tmp_path)
    small = Box("front", "b", (0.0, 0.0, 0.42), (0.0, 0.0, 0.0), (0.04, 0.04, 0.04))
    bodies = [body for body in collision_bodies(robot) if body.link == "b"]
    marks = [robot.annotations.marks["cube"], small]
    picture = picture_of("b", bodies, [robot.meshes.of(body) for body in bodies], marks, 65)
    (along_z,) = [one for one in picture.views if one.view[2] == 2]
    rows, columns = along_z.mark.shape[1:]
    assert along_z.mark[:, rows // 2, columns // 2].tolist() == [1, 0]  # from +z, and from -z
    assert abs(along_z.away[0, rows // 2, columns // 2] - 0.04) < 1e-9  # its far face is 40 mm over the cube
