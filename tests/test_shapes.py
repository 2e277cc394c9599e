"""One shape behind every mark: what hulls, boxes and cylinders become, and that their boundaries are right."""

from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import pinbound as pb
from oracles import nonnegative_least_squares
from pinbound.annotations.shapes import extreme_vertices, hull
from pinbound.coverage.bodies import Body
from pinbound.coverage.holding import holds, holds_points
from robots import ARM
from segments import assemble, oracle_clearances

RNG = np.random.default_rng(13)
BALL = RNG.normal(size=(60, 3))
BALL *= 0.1 / np.linalg.norm(BALL, axis=1)[:, None]
MARKS = [
    ("H", "base", "hull", 'vertices="{}" radius="0.01"', BALL + np.array([0.4, 0.2, 0.3])),
    ("K", "d", "hull", 'vertices="{}"', 0.08 * RNG.normal(size=(12, 3)) + [0.02, 0.03, 0.12]),
    ("F", "b", "hull", 'vertices="{}" radius="0.005"', [(x, y, 0.1) for x in (0, 0.2) for y in (-0.1, 0.1, 0.15)]),
    ("S", "b", "hull", 'vertices="{}" radius="0.02"', [(0.0, 0.05, 0.1), (0.0, 0.05, 0.3), (0.0, 0.05, 0.2)]),
    ("B", "base", "box", 'xyz="0.35 -0.3 0.2" rpy="0.3 -0.2 0.5" size="0.2 0.1 0.3" radius="0.01"', ()),
    ("R", "d", "box", 'xyz="0 0 0.1" rpy="0 0 0.3" size="0.1 0.2 0"', ()),
    ("C", "d", "cylinder", 'xyz_a="0 0 0.05" xyz_b="0.1 0.1 0.2" radius="0.04"', ()),
    ("p", "base", "point", 'xyz="0.5 -0.5 0.5" radius="0.02"', ()),
    ("wall", "base", "plane", 'xyz="-0.9 0 0" normal="1 0.2 0"', ()),
    ("pole", "base", "line", 'xyz="0.6 0.6 0" direction="0.1 0 1" radius="0.03"', ()),
]
PAIRS = [
    "H_K",
    "F_H",
    "K_F",
    "S_K",
    "B_K",
    "B_C",
    "R_H",
    "K_p",
    "p_K",
    "wall_K",
    "K_wall",
    "pole_K",
    "K_pole",
    "C_wall",
]


def element(name: str, link: str, kind: str, rest: str, vertices: Any) -> str:
    said = rest.format(" ".join(map(repr, np.ravel(vertices).tolist())))
    return f'<pinbound:{kind} name="{name}" link="{link}" {said}/>'


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> pb.Robot:
    path = tmp_path_factory.mktemp("hulls") / "hulls.urdf"
    path.write_text(
        assemble(ARM, [element(*mark) for mark in MARKS], PAIRS, '<pinbound:home j1="1.2" j2="0.3" j3="0.2"/>')
    )
    return pb.load(path)


def sampled(robot: pb.Robot, count: int, seed: int = 1) -> Any:
    return np.random.default_rng(seed).uniform(-1.5, 1.5, (count, len(robot.coordinates)))


def placements(robot: pb.Robot, Q: Any) -> Any:
    """Yield for each q a function that places points of a link in another link's frame, by Pinocchio."""
    data = robot.model.createData()
    for theta in robot.coupling.expand(Q):
        pin.framesForwardKinematics(robot.model, data, theta)

        def put(link: str, points: Any, seen_from: str) -> Any:
            M = [data.oMf[robot.model.getFrameId(one, pin.BODY)] for one in (seen_from, link)]
            T = M[0].inverse() * M[1]
            return np.asarray(points) @ T.rotation.T + T.translation

        yield put


def least_distance(V: Any, W: Any) -> float:
    """Return the distance of two hulls by least squares with positive weights, which is exact however many points."""
    D = (V[:, None] - W[None]).reshape(-1, 3)
    x = nonnegative_least_squares(np.vstack((D.T, np.ones(len(D)))), np.array([0.0, 0.0, 0.0, 1.0]))
    return float(np.linalg.norm(x @ D) / x.sum())


def test_hulls_keep_extreme_vertices_only() -> None:
    cube = np.array(list(product((0.0, 1.0), repeat=3)))
    more = np.vstack((cube[::-1], cube, 0.5 * cube + 0.25, [(0.5, 0.5, 0.0), (0.5, 0.0, 0.0), (1.0, 0.3, 0.7)]))
    assert extreme_vertices(more).tolist() == cube[::-1].tolist()
    rng = np.random.default_rng(0)
    for thin in (1.0, 1e-4, 1e-8, 1e-12, 0.0):
        points = rng.normal(size=(200, 3)) * (1.0, 1.0, thin)
        kept = extreme_vertices(points)
        assert len(kept) < 60
        n = rng.normal(size=(4000, 3)) / (1.0, 1.0, thin or 1.0)
        n /= np.linalg.norm(n, axis=1)[:, None]
        assert np.all((points @ n.T).max(axis=0) <= (kept @ n.T).max(axis=0) + 1e-14)
        assert len(hull(points).directions) == (3 if thin else 2)


def test_what_is_flat_has_fewer_directions() -> None:
    assert [len(hull(V).directions) for V in ([(1, 2, 3)] * 3, [(0, 0, 0), (1, 1, 1), (3, 3, 3), (2, 2, 2)])] == [0, 1]
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    square = np.array([(x, y, 0.0) for x in (0, 0.3) for y in (0, 0.2)]) @ turn.T + [10.0, -5.0, 2.0]
    assert len(hull(square).directions) == 2
    assert np.abs(hull(square).vertices - square).max() < 1e-14
    lifted = square + np.outer([1e-9, 0, 0, 0], turn[:, 2])  # a nanometre is no rounding
    assert len(hull(lifted).directions) == 3


def test_a_tip_that_sticks_out_of_a_wedge_by_less_than_its_angle_is_kept() -> None:
    """Between facets at 1e-10 rad, a tip a micrometre further is within rounding of both facets, and still a vertex."""
    wedge = np.array(
        [(0, 0, 0), (0, 1, 0), (0, 0, 1e-10), (0, 1, 1e-10), (1, 0, 0), (1, 1, 0), (1 + 1e-6, 0.5, -1e-16)]
    )
    assert wedge[-1].tolist() in extreme_vertices(wedge).tolist()


def test_boxes_are_the_sweeps_of_their_edges(robot: pb.Robot) -> None:
    box = robot.annotations.marks["B"].shape
    T = pin.SE3(pin.rpy.rpyToMatrix(0.3, -0.2, 0.5), np.array([0.35, -0.3, 0.2]))
    corners = np.array([T.act(np.array(c) * (0.1, 0.05, 0.15)) for c in product((-1.0, 1.0), repeat=3)])
    assert np.abs(box.vertices - corners).max() < 1e-15
    assert (box.is_zonotope, len(robot.annotations.marks["R"].shape.directions)) == (True, 2)


def test_a_cylinder_is_held_by_its_prism_and_says_how_closely(robot: pb.Robot) -> None:
    mark = robot.annotations.marks["C"]
    a, b = np.array(mark.xyz_a), np.array(mark.xyz_b)
    z = (b - a) / np.linalg.norm(b - a)
    rng = np.random.default_rng(2)
    n = rng.normal(size=(2000, 3))
    n /= np.linalg.norm(n, axis=1)[:, None]
    true = np.maximum(n @ a, n @ b) + 0.04 * np.linalg.norm(n - np.outer(n @ z, z), axis=1)
    excess = (n @ mark.shape.vertices.T).max(axis=1) - true
    assert excess.min() >= -1e-15
    assert 0.9 * mark.shape.excess < excess.max() <= mark.shape.excess + 1e-15
    assert any("C 0.345 mm" in note for note in robot.notes)
    body = Body("d", 0, "cylinder", (0.04, float(np.linalg.norm(b - a))), frame(z), (a + b) / 2)
    assert holds(mark, body)
    assert not holds(mark, Body("d", 0, "cylinder", (0.0401, body.size[1]), frame(z), (a + b) / 2))


def frame(z: Any) -> Any:
    x = np.cross(z, (0.0, 0.0, 1.0))
    x /= np.linalg.norm(x)
    return np.column_stack((x, np.cross(z, x), z))


def test_a_hull_holds_what_its_vertices_hold() -> None:
    mark = pb.Hull("h", "arm", tuple(map(tuple, BALL)), 0.01)
    inside = 0.9 * np.random.default_rng(3).dirichlet(np.ones(60), 30) @ BALL
    assert holds_points(mark.shape, inside, 0.0)
    assert not holds_points(mark.shape, np.vstack((inside, 1.01 * BALL[:1])), 0.0)
    depth = min(float((BALL @ n).max()) for n in facet_normals(BALL))
    for radius, expected in ((depth + 0.0099, True), (depth + 0.0101, False)):
        assert holds(mark, Body("arm", 0, "sphere", (radius,), np.eye(3), np.zeros(3))) is expected


def facet_normals(V: Any) -> Any:
    from scipy.spatial import ConvexHull

    return ConvexHull(V).equations[:, :3]


def test_distances_are_those_of_placed_vertices(robot: pb.Robot) -> None:
    Q = sampled(robot, 40)
    norms = robot.boundaries.norms(Q)
    for row, put in enumerate(placements(robot, Q)):
        for column, boundary in enumerate(robot.boundaries):
            a, b = boundary.point_a.shape, boundary.point_b.shape
            A, B = put(boundary.point_a.link, a.vertices, "base"), put(boundary.point_b.link, b.vertices, "base")
            if boundary.path.is_signed:
                n = (a if a.normal is not None else b).normal
                expected = (B - A[0] if a.normal is not None else A - B[0]) @ n
                assert norms[row, column] == pytest.approx(expected.min(), abs=1e-14)
            elif boundary.path.measure is pb.Measure.DISTANCE:
                assert norms[row, column] == pytest.approx(least_distance(A, B), abs=1e-9)


def test_clearances_are_those_of_coal(robot: pb.Robot) -> None:
    named = [b.name for b in robot.boundaries if "R" not in b.name]  # coal has no flat hull
    chosen = [robot.boundaries.names.index(name) for name in named if "F" not in name]
    Q = sampled(robot, 40, 4)
    found, expected = robot.boundaries.clearances(Q)[:, chosen], oracle_clearances(robot, Q, chosen)
    apart = expected > 1e-3
    assert apart.mean() > 0.5
    assert np.abs(found - expected)[apart].max() < 2e-6


def test_nearest_points_lie_on_both_marks_and_are_as_far_apart_as_said(robot: pb.Robot) -> None:
    Q = sampled(robot, 12, 5)
    for boundary in robot.boundaries:
        points, norms = boundary.nearest_points(Q), boundary.norm(Q)
        assert points.shape == (12, 2, 3)
        assert np.abs(np.linalg.norm(points[:, 0] - points[:, 1], axis=1) - np.abs(norms)).max() < 1e-13
        assert np.abs(points[:, 0] - points[:, 1] - boundary.vector(Q)).max() < 1e-13
        for row, put in enumerate(placements(robot, Q)):
            for mark, point in zip((boundary.point_a, boundary.point_b), points[row], strict=True):
                if mark.shape.normal is None:
                    placed = put(mark.link, mark.shape.vertices, boundary.ancestor)
                    assert least_distance(placed, point[None]) < 1e-9
                else:
                    at, along = put(
                        mark.link, [mark.shape.origin, mark.shape.origin + mark.shape.normal], boundary.ancestor
                    )
                    off, unit = point - at, along - at
                    on = (
                        off @ unit
                        if mark.shape.measure is pb.Measure.HEIGHT
                        else np.linalg.norm(off - off @ unit * unit)
                    )
                    assert abs(on) < 1e-13


def test_derivatives_are_those_of_differences(robot: pb.Robot) -> None:
    """Where nearest features change derivatives jump: only there, and where bodies overlap, may they differ."""
    Q, h = sampled(robot, 10, 6), 1e-5
    B, n = robot.boundaries, len(robot.coordinates)
    at = {(axis, sign): Q + sign * h * np.eye(n)[axis] for axis in range(n) for sign in (-1, 1)}
    gradients, hessians = B.gradients(Q), B.hessians(Q)
    slopes = np.stack([(B.norms(at[k, 1]) - B.norms(at[k, -1])) / (2 * h) for k in range(n)], axis=2)
    bends = np.stack([(B.gradients(at[k, 1]) - B.gradients(at[k, -1])) / (2 * h) for k in range(n)], axis=3)
    overlap = (B.norms(Q) == 0.0) & [not b.path.is_signed for b in B]
    assert np.isnan(gradients[overlap]).any(axis=1).all()
    assert not np.isnan(gradients[~overlap]).any()
    with np.errstate(invalid="ignore"):
        size = 1.0 + np.abs(hessians).max(axis=(2, 3))
        first = np.abs(gradients - slopes).max(axis=2)[~overlap]
        second = (np.abs(hessians - bends).max(axis=(2, 3)) / size)[~overlap]
    assert np.quantile(first, 0.97) < 1e-8
    assert np.isnan(second).mean() < 0.03
    assert np.nanquantile(second, 0.97) < 1e-7


def test_a_parallel_edge_that_nothing_turns_leaves_the_second_derivative(robot: pb.Robot, tmp_path: Path) -> None:
    """Prisms along the axis of the only joint: their nearest points are many, their distance is smooth all the same."""
    V = [(x, y, z) for x, z in ((0.1, 0.0), (0.2, 0.05), (0.15, 0.1)) for y in (-0.1, 0.1)]
    W = [(x, y, z) for x, z in ((0.3, 0.1), (0.35, 0.2), (0.4, 0.1)) for y in (-0.2, 0.2)]
    path = tmp_path / "planar.urdf"
    joint = '<joint name="q" type="continuous"><parent link="base"/><child link="a"/><axis xyz="0 1 0"/></joint>'
    marks = [element("V", "a", "hull", 'vertices="{}"', V), element("W", "base", "hull", 'vertices="{}"', W)]
    path.write_text(assemble([f'<link name="a"/>{joint}'], marks, ["V_W"]))
    boundary, h = pb.load(path).boundaries[0], 1e-5
    q = np.linspace(-3, 3, 40)[:, None]
    bend = (boundary.gradient(q + h) - boundary.gradient(q - h))[:, 0] / (2 * h)
    found = boundary.hessian(q)[:, 0, 0]
    away = np.abs(found - bend) < 1e-6
    assert away.mean() > 0.85  # else it is at a switch, or overlaps


def test_text_and_shape_survive_every_file(robot: pb.Robot, tmp_path: Path) -> None:
    again = tmp_path / "again.yaml"
    robot.annotations.save(again)
    loaded = pb.Annotations.load(again)
    assert loaded.to_yaml() == robot.annotations.to_yaml()
    assert loaded.to_xml() == robot.annotations.to_xml()
    for name, mark in robot.annotations.marks.items():
        assert np.array_equal(loaded.marks[name].shape.vertices, mark.shape.vertices)


@pytest.mark.parametrize(
    ("mark", "message"),
    [
        ('<pinbound:hull name="h" link="d" vertices="0 0 0 1"/>', "4 numbers"),
        ('<pinbound:hull name="h" link="d" vertices="0 0 nan"/>', "finite"),
        ('<pinbound:hull name="h" link="d" vertices="0 0 1e200"/>', "metres"),
        ('<pinbound:hull name="h" link="d" vertices="0 0 0" radius="-1"/>', "negative"),
        ('<pinbound:box name="h" link="d" xyz="0 0 0" rpy="0 0 0" size="1 -1 1"/>', "size of box 'h' holds -1"),
        ('<pinbound:cylinder name="h" link="d" xyz_a="0 0 1" xyz_b="0 0 1" radius="1"/>', "no length"),
        ('<pinbound:cylinder name="h" link="d" xyz_a="0 0 1" xyz_b="0 0 2"/>', "has no radius"),
    ],
)
def test_faults_are_told(mark: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "faulty.urdf"
    path.write_text(assemble(ARM, [mark], []))
    with pytest.raises(pb.InputError, match=message):
        pb.load(path)


def test_exports_do_not_take_a_hull_for_a_box(robot: pb.Robot, tmp_path: Path) -> None:
    from pinbound.export import is_closed

    closed = [is_closed(robot.boundaries[name].rule) for name in ("wall_K", "K_p", "pole_K")]
    assert closed == [False] * 3
    with pytest.raises(pb.UnsupportedError, match="hull"):
        robot.export("json", tmp_path / "hulls.json")


def test_hulls_have_no_parameters_between_ends(robot: pb.Robot) -> None:
    with pytest.raises(pb.UnsupportedError, match="nearest_points"):
        robot.boundaries["H_K"].nearest(robot.home)
