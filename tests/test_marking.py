"""Covers hold their bodies; proposals leave nothing out without a reason that holds."""

import itertools
from pathlib import Path

import numpy as np
import pytest

import pinbound as pb
from pinbound.bodies import Body
from pinbound.covers import cover, covers
from pinbound.interpreters.closest import nearest
from robots import ARM, robot_xml

SHAPES = {
    "box": (0.3, 0.1, 0.05),
    "flat box": (0.4, 0.4, 0.01),
    "cylinder": (0.05, 0.4),
    "disc": (0.2, 0.03),
    "capsule": (0.05, 0.4),
    "sphere": (0.1,),
    "short capsule": (0.1, 0.0),
}


def points_of(shape: str, size: tuple[float, ...], rng: np.random.Generator, count: int) -> np.ndarray:
    """Return points of a body in its own frame, many of them on its surface and its edges."""
    if shape == "box":
        points = rng.uniform(-0.5, 0.5, (count, 3))
        faces = rng.random((count, 3)) < 0.6
        return np.where(faces, np.sign(points) / 2, points) * size
    direction = rng.normal(size=(count, 3))
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    if shape == "sphere":
        return direction * size[0]
    radius, length = size
    if shape == "capsule":
        return direction * radius + np.outer(rng.uniform(-length / 2, length / 2, count), [0, 0, 1])
    angle = rng.uniform(0, 2 * np.pi, count)
    height = np.where(rng.random(count) < 0.5, np.sign(rng.normal(size=count)) / 2, rng.uniform(-0.5, 0.5, count))
    return np.column_stack((radius * np.cos(angle), radius * np.sin(angle), height * length))


def distance_outside(shape: str, size: tuple[float, ...], points: np.ndarray) -> np.ndarray:
    if shape == "box":
        return np.linalg.norm(np.maximum(np.abs(points) - np.array(size) / 2, 0.0), axis=1)
    if shape == "sphere":
        return np.maximum(np.linalg.norm(points, axis=1) - size[0], 0.0)
    radius, length = size
    beyond = np.maximum(np.abs(points[:, 2]) - length / 2, 0.0)
    across = np.linalg.norm(points[:, :2], axis=1)
    if shape == "capsule":
        return np.maximum(np.hypot(across, beyond) - radius, 0.0)
    return np.hypot(np.maximum(across - radius, 0.0), beyond)


@pytest.mark.parametrize("accuracy", [0.5, 0.02, 0.002])
@pytest.mark.parametrize("name", SHAPES)
def test_a_cover_holds_its_body_and_sticks_out_by_no_more_than_it_says(name: str, accuracy: float) -> None:
    rng, shape = np.random.default_rng(1), name.rsplit(maxsplit=1)[-1] if name != "disc" else "cylinder"
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    body = Body("l", 0, shape, SHAPES[name], turn, np.array([0.1, -0.2, 0.3]))
    found = cover(body, accuracy, "spheres")
    centres, radius = np.array([mark.xyz for mark in found.marks]), found.marks[0].radius
    assert 1 <= len(centres) <= 64
    points = points_of(shape, body.size, rng, 4000) @ turn.T + body.translation
    nearest = np.min(np.linalg.norm(points[:, None] - centres[None], axis=2), axis=1)
    assert np.all(nearest <= radius * (1 + 1e-12))
    directions = rng.normal(size=(2000, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    for centre in centres:
        shell = (centre + radius * directions - body.translation) @ turn
        assert distance_outside(shape, body.size, shell).max() <= found.excess + 1e-12


@pytest.mark.parametrize("accuracy", [0.5, 0.02, 0.002, 1e-5])
@pytest.mark.parametrize("name", SHAPES)
def test_a_body_that_covers_holds_its_body_too(name: str, accuracy: float) -> None:
    rng, shape = np.random.default_rng(2), name.rsplit(maxsplit=1)[-1] if name != "disc" else "cylinder"
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    body = Body("l", 0, shape, SHAPES[name], turn, np.array([0.1, -0.2, 0.3]))
    found = cover(body, accuracy)
    (mark,) = found.marks
    points = points_of(shape, body.size, rng, 1500) @ turn.T + body.translation
    ways = np.array(mark.ways).reshape(-1, 1, 3)
    w, e = np.array(mark.xyz) - points, np.repeat(ways, len(points), axis=1)
    away = np.linalg.norm(w + np.einsum("nk,kni->ni", nearest(w, e), e), axis=1)
    assert np.all(away <= mark.radius + 1e-13 * (1 + max(body.size)))
    corners = np.array(list(itertools.product((0.0, 1.0), repeat=len(ways)))) @ ways.reshape(-1, 3) + mark.xyz
    outside = distance_outside(shape, body.size, (corners - body.translation) @ turn)
    assert outside.max() + (0.0 if shape in ("capsule", "sphere") else mark.radius) <= found.excess + 1e-12


def test_a_capsule_holds_end_spheres_that_are_a_little_larger_or_beside_its_ends() -> None:
    rod = Body("l", 0, "cylinder", (0.05, 0.4), np.eye(3), np.zeros(3))
    for aside, larger in ((9e-10, 0.0), (0.0, 9e-10), (6e-10, 6e-10), (0.0, -9e-10), (0.0, 0.0)):
        ends = [
            Body("l", i + 1, "sphere", (0.05 + larger,), np.eye(3), np.array([aside, 0.0, end]))
            for i, end in enumerate((0.2, -0.2))
        ]
        (found,) = covers([rod, *ends], 0.01)
        (mark,) = found.marks
        assert len(found.bodies) == 3
        assert mark.radius >= 0.05 + aside + larger - 1e-17
        assert mark.radius == 0.05 + found.excess
        assert found.excess <= max(aside + larger, 0.0) + 1e-16


def test_a_mesh_is_named_as_not_covered(tmp_path: Path) -> None:
    text = robot_xml(ARM, {}, []).replace(
        '<link name="d"/>', '<link name="d"><collision><geometry><mesh filename="x.stl"/></geometry></collision></link>'
    )
    path = tmp_path / "arm.urdf"
    path.write_text(text)
    proposal = pb.propose_marks(pb.load(path))
    assert [(body.link, body.shape) for body in proposal.uncovered] == [("d", "mesh")]
    assert not proposal.annotations.boundaries


def sphere(link: str, radius: float, xyz: str = "0 0 0") -> tuple[str, str]:
    shape = f'<collision><origin xyz="{xyz}"/><geometry><sphere radius="{radius}"/></geometry></collision>'
    return f'<link name="{link}"/>', f'<link name="{link}">{shape}</link>'


def test_reasons_for_leaving_pairs_out_hold(tmp_path: Path) -> None:
    text = robot_xml(ARM, {}, [])
    for link, radius, xyz in (
        ("base", 0.05, "0 0 0"),
        ("a", 0.05, "0 0 0"),
        ("b", 0.04, "0 0 0.2"),
        ("d", 0.03, "0 0 0"),
    ):
        text = text.replace(*sphere(link, radius, xyz))
    path = tmp_path / "arm.urdf"
    path.write_text(text)
    bare = pb.load(path)
    proposal = pb.propose_marks(bare)
    reasons = {(a, b): reason for a, b, reason in proposal.left_out}
    assert reasons["base", "a"] == reasons["a", "b"] == "neighbours"
    assert reasons["base", "b"] == "can never meet"
    Q = np.random.default_rng(0).uniform(-3.2, 3.2, (20_000, 4))
    gap = np.linalg.norm(bare.positions("base", Q) - bare.positions("b", Q, (0, 0, 0.2)), axis=1)
    assert gap.min() > 0.09
    assert {(mark.a, mark.b) for mark in proposal.annotations.boundaries} == {
        ("base.0", "d.0"),
        ("a.0", "d.0"),
        ("b.0", "d.0"),
    }
    proposal.annotations.save(tmp_path / "arm.pinbound.yaml")
    marked = pb.load(path)
    assert marked.boundaries.clearances(marked.home).min() > 0


def test_wrong_questions() -> None:
    robot = pb.load("minervabot_v3")
    with pytest.raises(pb.UnknownNameError, match="sphere, box, cylinder, capsule"):
        pb.propose_marks(robot, shapes=("cone",))
    with pytest.raises(pb.DimensionError, match="positive"):
        cover(Body("l", 0, "sphere", (1.0,), np.eye(3), np.zeros(3)), 0.0)
