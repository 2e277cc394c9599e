"""Marks against raw meshes: what the triangles touch is no free, and what is refused needlessly is measured."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio
import pytest
from typer.testing import CliRunner

import pinbound as pb
from pinbound.cli.app import app
from pinbound.crosscheck.inside import Insides, winding_numbers
from pinbound.crosscheck.mesh_pairs import near_contact
from pinbound.crosscheck.raw import RawBodies
from robots import joint
from test_marking import urdf

Load = Callable[..., pb.Robot]

CUBE = [(x, y, z) for x in (-0.1, 0.1) for y in (-0.1, 0.1) for z in (-0.1, 0.1)]
QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
MESH = '<collision><origin xyz="{0}"/><geometry><mesh filename="{1}.obj" scale="{2}"/></geometry></collision>'
JOINTS = [
    joint("q1", "revolute", "base", "a", axis="0 1 0", xyz="0 0 0.35", limit="-3.1 3.1"),
    joint("q2", "prismatic", "a", "b", axis="1 0 0", limit="-0.6 0.6"),
]


def save_obj(path: Path, blocks: list[tuple[tuple[float, float, float], tuple[float, float, float]]]) -> None:
    """Write boxes with a middle and a size each, as one mesh."""
    lines: list[str] = []
    for index, (middle, size) in enumerate(blocks):
        lines += [f"v {' '.join(map(str, np.array(v) * 5 * size + middle))}" for v in CUBE]
        lines += [f"f {' '.join(str(8 * index + one + 1) for one in quad)}" for quad in QUADS]
    path.write_text("\n".join(lines) + "\n")


def corners(size: float, xyz: tuple[float, float, float]) -> list[list[float]]:
    return [[float(size * a / 0.1 + b) for a, b in zip(v, xyz, strict=True)] for v in CUBE]


def marked(load_text: Load, tmp_path: Path, size: float = 0.1, missing: bool = False) -> pb.Robot:
    """Return a cube of 0.2 m that swings about a fork of two teeth, and hulls over both; `size`: half the hull's."""
    save_obj(tmp_path / "cube.obj", [((0.0, 0.0, 0.0), (2.0, 2.0, 2.0))])
    save_obj(tmp_path / "fork.obj", [((-0.2, 0.0, 0.0), (0.05, 0.2, 0.2)), ((0.2, 0.0, 0.0), (0.05, 0.2, 0.2))])
    links = {
        "base": MESH.format("0 0 0", "fork" if not missing else "none", "1 1 1"),
        "a": "",
        "b": MESH.format("0 0 0.3", "cube", "0.1 0.1 0.1"),
    }
    text = f"""
home: {{q1: 0.0, q2: 0.0}}
hulls:
- {{name: fork, link: base, vertices: {[[x * 2.25, y, z] for x, y, z in CUBE]}}}
- {{name: cube, link: b, vertices: {corners(size, (0.0, 0.0, 0.3))}}}
boundaries: [{{name: one, a: fork, b: cube}}]
"""
    return load_text(urdf(links, JOINTS), text)


def test_hulls_that_hold_meshes_miss_nothing_and_their_refusals_are_the_gap_between_the_teeth(
    load_text: Load, tmp_path: Path
) -> None:
    robot = marked(load_text, tmp_path)
    found = pb.cross_check(robot, samples=600, levels=("bodies",)).bodies
    assert found is not None
    assert found.holds
    (pair,) = found.pairs
    assert pair.meshes
    assert (pair.misses, pair.miss) == (0, 0.0)
    assert pair.refusals > 10
    assert pair.both_contact > 20
    assert pair.near > 20
    assert 0.02 < pair.refusal <= 0.175 + 1e-6  # a corner midway between the teeth is half their distance from both


def test_a_mark_that_is_too_small_is_caught(load_text: Load, tmp_path: Path) -> None:
    robot = marked(load_text, tmp_path, size=0.06)
    found = pb.cross_check(robot, samples=400, levels=("bodies",)).bodies
    assert found is not None
    assert not found.holds
    (pair,) = found.pairs
    assert pair.misses > 0
    assert pair.miss_q is not None
    assert RawBodies(robot, [("base", "b")]).collisions(pair.miss_q[None]).all()
    assert robot.boundaries["one"].signed_clearance(pair.miss_q) > 0.0
    result = CliRunner().invoke(
        app, ["crosscheck", str(tmp_path / "robot.urdf"), "--levels", "bodies", "--samples", "99"]
    )
    assert result.exit_code == 1
    assert "worst miss at q1=" in result.output


def test_raw_meshes_are_what_stock_pinocchio_loads(load_text: Load, tmp_path: Path) -> None:
    robot = marked(load_text, tmp_path)
    raw = RawBodies(robot, [("base", "b")])
    stock_file = tmp_path / "stock.urdf"  # Pinocchio looks for names without package:// in the working folder
    stock_file.write_text((tmp_path / "robot.urdf").read_text().replace('filename="', f'filename="{tmp_path}/'))
    model = pinocchio.buildModelFromUrdf(str(stock_file))
    stock = pinocchio.buildGeomFromUrdf(model, str(stock_file), pinocchio.COLLISION)
    stock.addAllCollisionPairs()
    data, geometry_data = model.createData(), pinocchio.GeometryData(stock)
    Q = np.random.default_rng(5).uniform((-3.1, -0.6), (3.1, 0.6), (300, 2))
    ours, theirs = raw.collisions(Q)[:, 0], np.empty(300, dtype=bool)
    for row, q in enumerate(Q):
        theirs[row] = pinocchio.computeCollisions(model, data, stock, geometry_data, q, False)
    assert np.array_equal(ours, theirs)
    assert 20 < ours.sum() < 280
    assert raw.first_contact(("base", "b"), Q) == int(np.argmax(ours))
    assert raw.first_contact(("base", "b"), Q[~ours]) is None


def test_just_before_contact_is_clear_and_just_after_is_not(load_text: Load, tmp_path: Path) -> None:
    robot = marked(load_text, tmp_path)
    Q = np.random.default_rng(6).uniform((-3.1, -0.6), (3.1, 0.6), (300, 2))
    before, after = near_contact(robot, list(robot.boundaries), Q)
    one = robot.boundaries["one"]
    assert len(before) > 20
    assert np.all(one.signed_clearance(before) > 0.0)
    assert np.all(one.signed_clearance(after) <= 0.0)
    assert np.abs(before - after).max() < 1e-8


@pytest.mark.parametrize("how", ["missing", "broken"])
def test_a_mesh_that_cannot_be_read_is_named(load_text: Load, tmp_path: Path, how: str) -> None:
    robot = marked(load_text, tmp_path, missing=how == "missing")
    if how == "broken":
        (tmp_path / "fork.obj").write_text("v 0 0\n")
    found = pb.cross_check(robot, samples=10, levels=("bodies",))
    assert "bodies" in found.not_checked
    assert not found.holds


def crate(load_text: Load, tmp_path: Path, plates: bool) -> pb.Robot:
    """Return a pebble that slides through a crate; the crate is held by six plates about its sides, or by one hull."""
    save_obj(tmp_path / "crate.obj", [((0.0, 0.0, 0.0), (0.4, 0.4, 0.4))])
    save_obj(tmp_path / "pebble.obj", [((0.0, 0.0, 0.0), (0.02, 0.02, 0.02))])
    links = {"base": MESH.format("0 0 0.35", "crate", "1 1 1"), "a": "", "b": MESH.format("0 0 0", "pebble", "1 1 1")}
    sides = [(axis, sign) for axis in range(3) for sign in (-1.0, 1.0)]
    hulls = [
        f"- {{name: plate{index}, link: base, vertices: {plate(axis, sign)}}}"
        for index, (axis, sign) in enumerate(sides)
    ]
    if not plates:
        hulls = [f"- {{name: plate0, link: base, vertices: {corners(0.21, (0.0, 0.0, 0.35))}}}"]
    pairs = [f"{{name: b{index}, a: plate{index}, b: pebble}}" for index in range(len(hulls))]
    text = "home: {q1: 0.0, q2: 0.5}\nhulls:\n" + "\n".join(hulls)
    text += (
        f"\n- {{name: pebble, link: b, vertices: {corners(0.02, (0.0, 0.0, 0.0))}}}\nboundaries: [{', '.join(pairs)}]\n"
    )
    return load_text(urdf(links, JOINTS), text)


@pytest.mark.parametrize("plates", [True, False])
def test_a_hollow_between_marks_is_named(load_text: Load, tmp_path: Path, plates: bool) -> None:
    """Six plates hold the surface of a crate; a pebble inside touches none of them, which coverage says."""
    robot = crate(load_text, tmp_path, plates)
    assert [pair.status.value for pair in robot.coverage.pairs if set(pair.links) == {"base", "b"}] == ["watched"]
    assert bool(robot.boundaries.free(np.zeros((1, 2)))[0]) is plates  # inside: no surface is touched
    assert any("base" in note and "completely inside" in note for note in robot.coverage.notes) is plates


def plate(axis: int, sign: float) -> list[list[float]]:
    """Return a plate of 20 mm about one side of the crate."""
    size, middle = np.full(3, 0.21), np.array([0.0, 0.0, 0.35])
    size[axis] = 0.01
    middle[axis] += 0.2 * sign
    return (np.array(CUBE) / 0.1 * size + middle).tolist()


def lies_in_the_crate(q: np.ndarray) -> bool:
    return abs(q[1]) * max(abs(np.cos(q[0])), abs(np.sin(q[0]))) < 0.2


@pytest.mark.parametrize("plates", [True, False])
def test_a_body_wholly_inside_a_mesh_is_not_refused_needlessly(load_text: Load, tmp_path: Path, plates: bool) -> None:
    """One hull refuses a pebble in the crate, 190 mm from its sides; both hulls stick out by 10 mm alone."""
    robot = crate(load_text, tmp_path, plates)
    found = pb.cross_check(robot, samples=600, levels=("bodies",)).bodies
    assert found is not None
    (pair,) = found.pairs
    assert pair.misses == 0
    assert pair.within == "b in base"
    assert 0.005 < pair.refusal <= 0.02 * np.sqrt(3) + 1e-6  # from corner to corner of two hulls of 10 mm
    if plates:  # between the plates nobody refuses, which is said
        assert pair.hidden > 100
        assert robot.boundaries["b0"].signed_clearance(pair.hidden_q) > 0.0
        assert lies_in_the_crate(pair.hidden_q)
    else:
        assert (pair.inside > 100, pair.hidden) == (True, 0)
        assert pair.inside_q is not None
        assert lies_in_the_crate(pair.inside_q)
    result = CliRunner().invoke(
        app, ["crosscheck", str(tmp_path / "robot.urdf"), "--levels", "bodies", "--samples", "99"]
    )
    assert result.exit_code == 0
    assert ("the marks call CLEAR" if plates else "do not count as needless") in " ".join(result.output.split())


def test_who_is_inside_whom(load_text: Load, tmp_path: Path) -> None:
    robot = crate(load_text, tmp_path, plates=False)
    raw = RawBodies(robot, [("base", "b")])
    Q = np.column_stack((np.full(400, 0.3), np.linspace(-0.5, 0.5, 400)))
    in_second, in_first = Insides(raw.engine).of_pair(0, Q)
    reach = 0.01 * (np.cos(0.3) + np.sin(0.3))  # of the pebble, turned by q1, which slides askew
    inside = np.abs(Q[:, 1]) * np.cos(0.3) < 0.2 - reach
    apart = ~raw.collisions(Q)[:, 0]
    assert not in_second.any()
    assert np.array_equal(in_first[apart], inside[apart])
    assert 0 < apart.sum() < 400


def box(low: float, high: float, inwards: bool = False) -> np.ndarray:
    """Return the twelve triangles of a cube."""
    corners = low + (high - low) * (np.array(CUBE) / 0.2 + 0.5)
    faces = [triangle for a, b, c, d in QUADS for triangle in ((a, b, c), (a, c, d))]
    return corners[np.array(faces)][:, :: -1 if inwards else 1]


def test_winding_numbers() -> None:
    rng = np.random.default_rng(8)
    places = rng.uniform(-1.5, 1.5, (2_000, 3))
    depth = np.max(np.abs(places), axis=1)
    one = winding_numbers(box(-1.0, 1.0), places)
    assert np.abs(one - (depth < 1.0)).max() < 1e-9
    shell = np.concatenate((box(-1.0, 1.0), box(-0.5, 0.5, inwards=True)))
    assert np.abs(winding_numbers(shell, places) - ((depth < 1.0) & (depth > 0.5))).max() < 1e-9
    assert np.abs(winding_numbers(box(-1.0, 1.0, inwards=True), places) + (depth < 1.0)).max() < 1e-9
    near = np.array([[0.3, 0.2, 1.0 - 1e-9], [0.3, 0.2, 1.0 + 1e-9], [0.999999, 0.999999, 0.999999]])
    assert winding_numbers(box(-1.0, 1.0), near).round(6).tolist() == [1.0, 0.0, 1.0]
    sixth = winding_numbers(box(-1.0, 1.0)[2:], np.zeros((1, 3)))  # a side is missing: what is left is five sixths
    assert sixth.round(9).tolist() == [round(5 / 6, 9)]


def test_a_pair_that_parts_is_not_remembered(load_text: Load, tmp_path: Path) -> None:
    """Coal's tree leaves pairs out whose boxes are apart: they must not keep the answer of the row before."""
    robot = marked(load_text, tmp_path)
    raw = RawBodies(robot, [("base", "b")])
    touching, apart = np.array([3.1, 0.15]), np.array([0.0, 0.0])
    found = raw.collisions(np.array([apart, touching, apart, touching, apart]))[:, 0]
    assert found.tolist() == [False, True, False, True, False]
    assert [raw.engine.collides(q, 0) for q in (apart, touching)] == [False, True]
