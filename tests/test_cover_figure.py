"""Pictures of covers: outlines are those of the marks, and a body that sticks out of its marks is seen to."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

import pinbound as pb
from pinbound.annotations import Box, Hull, Point, Segment
from pinbound.coverage.bodies import collision_bodies
from pinbound.figures.cover_figure import draw_cover, outline_of
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
    figure = draw_cover(link, bodies, [robot.meshes.of(body) for body in bodies], marks, "said")  # type: ignore[arg-type]
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
