"""What is exported says the same as we do: C compiled strictly, JSON read by another evaluator, CasADi derived."""

import ctypes
import json
import shutil
import subprocess
import sys
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pinbound as pb
from robots import joint, robot_xml
from test_steps import JOINTS, MARKS, robot_with

CLOSED = ["spheres", "capsules", "capsule and sphere", "floor", "pole", "stop"]
STRICT = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O2", "-shared", "-fPIC"]
ROUNDING = 16 * 2.0**-52  # relative to a path's length: a hundred operations, sines of two libraries


def samples(robot: pb.Robot, count: int = 60) -> Any:
    return np.random.default_rng(0).uniform(-4, 4, (count, len(robot.coordinates)))


def lengths(robot: pb.Robot) -> Any:
    slides = 4.0  # what a prismatic joint may add
    return np.array([1.0 + b.path.minimal.scale + slides for b in robot.boundaries])


def compiled(robot: pb.Robot, folder: Path) -> Any:
    if shutil.which("gcc") is None:
        pytest.skip("gcc is not installed")
    source, header = robot.export("c", folder / "arm.c")
    subprocess.run(["gcc", *STRICT, str(source), "-lm", "-o", str(folder / "arm.so")], check=True)
    assert header.name == "arm.h"
    return ctypes.CDLL(str(folder / "arm.so"))


def call(library: Any, q: Any, m: int) -> tuple[Any, Any]:
    def pointer(array: Any) -> Any:
        return array.ctypes.data_as(ctypes.POINTER(ctypes.c_double))

    q, h, alone, J = np.ascontiguousarray(q), np.empty(m), np.empty(m), np.empty((m, len(q)))
    library.arm_clearances(pointer(q), pointer(alone))
    library.arm_clearances_and_jacobian(pointer(q), pointer(h), pointer(J))
    assert np.array_equal(h, alone)
    return h, J


@pytest.mark.parametrize("which", ["arm", "minerva"])
def test_c_compiles_strictly_and_says_the_same(which: str, minerva: pb.Robot, tmp_path: Path) -> None:
    robot = minerva if which == "minerva" else robot_with(CLOSED)
    library, B = compiled(robot, tmp_path), robot.boundaries
    for q in samples(robot):
        h, J = call(library, q, len(B))
        assert np.all(np.abs(h - B.signed_clearances(q)) <= ROUNDING * lengths(robot))
        far = np.abs(B.norms(q)) > 1e-3
        assert np.all(np.abs(J - B.signed_gradients(q))[far] <= 1e3 * ROUNDING * lengths(robot)[far, None])


def test_c_is_the_same_each_time_and_says_units_and_order(tmp_path: Path) -> None:
    robot = robot_with(CLOSED)
    first = [path.read_bytes() for path in robot.export("c", tmp_path / "arm.c")]
    again = [path.read_bytes() for path in robot_with(CLOSED).export("c", tmp_path / "arm.c")]
    assert first == again
    header = first[1].decode()
    assert "q[2]  c [m]" in header
    assert "h[4]  b4" in header
    assert "#define ARM_BOUNDARIES 6" in header
    called = {word for word in first[0].decode().replace("(", " ( ").split() if word.islower() and word.isalpha()}
    assert {"sin", "cos", "sqrt"} <= called
    assert not called & {"atan2", "acos", "malloc", "fabs", "fmin"}


def test_names_cannot_leave_the_comment(tmp_path: Path) -> None:
    text = robot_xml([joint("a*/ evil", "revolute", "base", "l1", xyz="0 0 1")], {}, [])
    marks = [pb.Point("p", "base", (0.5, 0.0, 0.0)), pb.Point("s", "l1", (0.0, 0.0, 0.2), 0.1)]
    robot = pb.load(text, annotations=pb.Annotations.of(marks, [pb.BoundaryMark("b", "p", "s")]))
    source, header = robot.export("c", tmp_path / "2 arms.c")
    assert header.read_text().count("*/") == 1
    if shutil.which("gcc"):
        subprocess.run(["gcc", *STRICT, str(source), "-o", str(tmp_path / "o.so")], check=True)


def test_boxes_have_no_straight_code(tmp_path: Path) -> None:
    with pytest.raises(pb.UnsupportedError, match=r"no iteration for the nearest points of b0"):
        robot_with(["box"]).export("c", tmp_path / "a.c")
    robot = robot_with(["box", "floor"])
    assert len(robot.export("c", tmp_path / "a.c", boundaries=["b1"])) == 2
    with pytest.raises(pb.UnknownNameError, match="kind of export"):
        robot.export("fortran", tmp_path / "a.f")
    with pytest.raises(pb.DimensionError, match=r"does not end in \.c"):
        robot.export("c", tmp_path / "a.cpp", boundaries="b1")


def rotation(axis: list[float], angle: float) -> Any:
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def read(one: dict[str, Any], q: Any) -> float:
    """Evaluate a boundary by what the file's `about` says, the nearest points by subdivision."""
    if one["stop"]:
        stop = one["stop"]
        phi = np.array(stop["coefficients"]) @ q
        d = min(phi - stop["gap"][0], stop["gap"][1] - phi)
        s = np.sin(d / 2)
        return stop["amplitude"] * (-abs(s) if d < -2 * np.pi else s)
    chain, k = one["chain"], len(one["chain"]["axes"])

    def walk(blocks: Any) -> Any:
        x = blocks[k]
        for i in reversed(range(k)):
            x = blocks[i] + rotation(chain["axes"][i], np.array(chain["coefficients"][i]) @ q) @ x
        return x

    w = walk(np.array(chain["offsets"]) + np.array(chain["slides"]) @ q)
    ways = [walk(np.array(way)) for way in one["ways"]]
    rows = np.eye(3) if one["across"] is None else np.array(one["across"])
    w, ways = rows @ w, [rows @ way for way in ways]
    if one["is_height"]:
        corners = product((0.0, 1.0), repeat=len(ways))
        return (
            min(w[0] + sum(t * e[0] for t, e in zip(c, ways, strict=True)) for c in corners) - one["contact_distance"]
        )
    centre, half = np.full(len(ways), 0.5), 0.5
    for _ in range(60 if ways else 1):
        grid = [np.clip(c + half * np.linspace(-1, 1, 9), 0, 1) for c in centre]
        found = {
            t: np.linalg.norm(w + sum((a * e for a, e in zip(t, ways, strict=True)), np.zeros(len(w))))
            for t in product(*grid)
        }
        best = min(found, key=found.__getitem__)
        centre, half = np.array(best), half * 0.6
    return found[best] - one["contact_distance"]


def test_json_is_enough_to_evaluate_the_boundaries(tmp_path: Path) -> None:
    robot = robot_with(CLOSED)
    (path,) = robot.export("json", tmp_path / "arm.json")
    said = json.loads(path.read_text())
    assert [one["name"] for one in said["coordinates"]] == list(robot.coordinates)
    assert [one["unit"] for one in said["coordinates"]] == ["rad", "rad", "m", "rad", "rad"]
    assert [one["joint"] for one in said["limits"]] == [one.joint for one in robot.linear_limits]
    for q in samples(robot, 3):
        expected = robot.boundaries.signed_clearances(q)
        found = [read(one, q) for one in said["boundaries"]]
        assert np.abs(expected - found).max() < 1e-8  # of the subdivision


def test_casadi_says_the_same_with_derivatives() -> None:
    casadi = pytest.importorskip("casadi", reason="casadi is not installed: pip install 'pinbound[bridges]'")
    robot = robot_with(CLOSED)
    B, h = robot.boundaries, robot.boundaries.to_casadi("h")
    assert h.is_a("SXFunction")
    q = casadi.SX.sym("q", len(robot.coordinates))
    J = casadi.Function("J", [q], [casadi.jacobian(h(q), q)])
    H = casadi.Function("H", [q], [casadi.hessian(h(q)[1], q)[0]])
    for point in samples(robot, 25):
        assert np.all(np.abs(h(point).full()[:, 0] - B.signed_clearances(point)) <= ROUNDING * lengths(robot))
        far = np.abs(B.norms(point)) > 1e-3
        assert np.abs(J(point).full() - B.signed_gradients(point))[far].max() < 1e-12
        wanted = B[1].hessian(point)
        if np.isfinite(wanted).all() and np.abs(wanted).max() < 1e3:
            assert np.abs(H(point).full() - wanted).max() < 1e-9 * max(1.0, np.abs(wanted).max())


def test_casadi_takes_boxes_by_callback() -> None:
    casadi = pytest.importorskip("casadi", reason="casadi is not installed: pip install 'pinbound[bridges]'")
    robot = robot_with(["floor", "box", "spheres", "hull over floor", "box of hulls"])
    B, h = robot.boundaries, robot.boundaries.to_casadi("h")
    q = casadi.MX.sym("q", len(robot.coordinates))
    J = casadi.Function("J", [q], [casadi.jacobian(h(q), q)])
    for point in samples(robot, 8):
        assert np.abs(h(point).full()[:, 0] - B.signed_clearances(point)).max() < 1e-12
        if B.norms(point)[1] > 1e-3:
            assert np.abs(J(point).full() - B.signed_gradients(point)).max() < 1e-11


def test_without_casadi_it_is_said_what_to_type(minerva: pb.Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "casadi", None)
    with pytest.raises(pb.UnsupportedError, match=r"pip install 'pinbound\[bridges\]'"):
        minerva.boundaries.to_casadi()


def test_the_marks_here_cover_every_closed_form() -> None:
    assert set(CLOSED) == {kind for kind in MARKS if "box" not in kind and "hull" not in kind}
    assert len(JOINTS) == 6
