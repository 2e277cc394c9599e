"""Sets for Drake: what YAML's own reader gives back is A and b to the last bit, in the layout of an HPolyhedron."""

from pathlib import Path

import numpy as np
import pytest
import yaml

import pinbound as pb
from pinbound.export import half_spaces_text


def test_numbers_come_back_to_the_last_bit() -> None:
    rng = np.random.default_rng(0)
    A = rng.normal(size=(20, 3)) * 10.0 ** rng.integers(-300, 300, (20, 3))
    b = np.array([0.0, -0.0, 1.0, 1e22, 1e-7, 5e-324, *rng.normal(size=14)])
    found = yaml.safe_load(half_spaces_text({"a b: c": (A, b)}, ["x", "y", "z"]))
    assert list(found) == ["a b: c"]
    assert found["a b: c"]["ambient_dimension"] == 3
    assert np.array_equal(np.array(found["a b: c"]["A"]), A)
    assert np.array_equal(np.array(found["a b: c"]["b"]), b)


def test_covers_and_polytopes_are_written(tmp_path: Path) -> None:
    robot = pb.load("minervabot_v3")
    polytope = pb.certified_polytope(robot, robot.home)
    one = yaml.safe_load(polytope.export_drake(tmp_path / "one.yaml", "home").read_text())
    assert np.array_equal(one["home"]["A"], polytope.A)
    assert np.array_equal(one["home"]["b"], polytope.b)
    cover = pb.certified_cover(robot, ("q2", "q3"), share=0.7)
    many = yaml.safe_load(cover.export_drake(tmp_path / "many.yaml").read_text())
    assert len(many) == len(cover.boxes)
    middle = cover.boxes[3].mean(axis=0)
    held = [name for name, part in many.items() if np.all(np.array(part["A"]) @ middle <= part["b"])]
    assert held == ["set_3"]


def test_drake_reads_them(tmp_path: Path) -> None:
    optimization = pytest.importorskip("pydrake.geometry.optimization")
    robot = pb.load("minervabot_v3")
    polytope = pb.certified_polytope(robot, robot.home)
    sets = optimization.LoadIrisRegionsYamlFile(str(polytope.export_drake(tmp_path / "one.yaml")))
    Q = np.random.default_rng(0).uniform(-3.0, 3.0, (300, 3))
    assert [sets["free"].PointInSet(q, tol=0.0) for q in Q] == polytope.contains(Q).tolist()
