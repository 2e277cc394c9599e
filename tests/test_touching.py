"""The parts of two bodies that touch, at a configuration and along the edges of a region."""

import numpy as np
import pytest

import pinbound as pb
from pinbound.evaluate.touching import nearest_features
from pinbound.exceptions import UnknownNameError, UnsupportedError

URDF = """<robot name="table"><link name="world"/><link name="carriage"/><link name="body"/>
<joint name="x" type="prismatic"><parent link="world"/><child link="carriage"/><axis xyz="1 0 0"/>
<limit lower="-5" upper="5" effort="1" velocity="1"/></joint>
<joint name="t" type="revolute"><parent link="carriage"/><child link="body"/><axis xyz="0 0 1"/>
<limit lower="-1.5" upper="1.5" effort="1" velocity="1"/></joint></robot>"""


def robot(*others: pb.BoundaryMark | pb.Plane) -> pb.Robot:
    marks = [
        pb.Box("a", "world", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)),
        pb.Box("b", "body", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (1.0, 1.0, 0.5)),
        *(mark for mark in others if isinstance(mark, pb.Plane)),
    ]
    boundaries = [pb.BoundaryMark("ab", "a", "b"), *(one for one in others if isinstance(one, pb.BoundaryMark))]
    return pb.load(URDF, annotations=pb.Annotations.of(marks, boundaries, home={"x": 3.0}))


@pytest.mark.parametrize(
    ("q", "expected"),
    [
        ((3.0, 0.0), ("face 4-5-6-7", "face 0-1-2-3")),
        ((3.0, 0.3), ("face 4-5-6-7", "edge 2-3")),
        ((3.0, -0.3), ("face 4-5-6-7", "edge 0-1")),
        ((-3.0, 0.3), ("face 0-1-2-3", "edge 4-5")),
    ],
)
def test_boxes_meet_by_faces_and_edges(q: tuple[float, float], expected: tuple[str, str]) -> None:
    (found,) = nearest_features(robot().boundaries["ab"].path, np.array([q]))
    assert found is not None
    assert tuple(map(str, found)) == expected


def test_bodies_that_overlap_have_no_direction() -> None:
    assert nearest_features(robot().boundaries["ab"].path, np.array([[0.2, 0.1]])) == [None]


def test_a_plane_has_no_vertices() -> None:
    floor = pb.Plane("floor", "world", (0.0, 0.0, -2.0), (0.0, 0.0, 1.0))
    boundary = robot(floor, pb.BoundaryMark("down", "b", "floor")).boundaries["down"]
    with pytest.raises(UnsupportedError, match="between two bodies"):
        nearest_features(boundary.path, np.array([[3.0, 0.0]]))


def test_along_an_edge_of_a_region_the_touching_parts_change_where_the_box_is_square_to_the_other() -> None:
    region = pb.feasible_region(robot(), ("x", "t"), width=0.02)
    (edge,) = (edge for edge in region.edges if edge.name == "ab")
    touches = region.touching(edge)
    assert {str(touch.a) for touch in touches} == {"face 4-5-6-7"}
    assert {str(touch.b) for touch in touches} >= {"edge 0-1", "edge 2-3"}
    for touch in touches:
        angles = edge.points[touch.first : touch.last + 1, 1]
        side = {"edge 0-1": -1.0, "edge 2-3": 1.0}.get(str(touch.b), 0.0)
        assert np.all(side * angles >= -1e-9)
    with pytest.raises(UnknownNameError, match="t upper"):
        region.touching(next(edge for edge in region.edges if edge.name == "t upper"))
