"""Convex sets for Drake and placo: read back by other code, they are the same sets to the last digit."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import yaml

import pinbound as pb
from pinbound.adapters import placo as our_placo
from pinbound.export import drake_text, half_spaces
from robots import joint, robot_xml
from test_steps import robot_with


def test_drakes_yaml_is_the_region_to_the_last_digit(minerva: pb.Robot, tmp_path: Path) -> None:
    """As `LoadIrisRegionsYamlFile` reads it: a map of names to ambient_dimension, A and b, and nothing else."""
    region = pb.feasible_region(minerva, ("q2", "q3"))
    inset = region.inset(1e-3)
    path = pb.save_drake_regions(tmp_path / "regions.yaml", {"home": region, 'the "inner": one': inset})
    text = path.read_text()
    assert text.startswith("# x = (q2, q3)\n")
    read = yaml.safe_load(text)
    assert list(read) == ["home", 'the "inner": one']
    for one, given in zip(read.values(), (region, inset), strict=True):
        assert set(one) == {"ambient_dimension", "A", "b"}
        A, b = given.halfspaces()
        assert one["ambient_dimension"] == 2
        assert np.array_equal(np.array(one["A"]), A)
        assert np.array_equal(np.array(one["b"]), b)
    Q = np.random.default_rng(0).uniform(-1.5, 1.5, (500, 2))
    kept = np.all(Q @ np.array(read["home"]["A"]).T <= np.array(read["home"]["b"]), axis=1)
    assert np.array_equal(kept, region.contains(np.insert(Q, 0, 0.0, axis=1)))
    assert 20 < kept.sum() < 480


def test_drake_itself_reads_it(minerva: pb.Robot, tmp_path: Path) -> None:
    optimization = pytest.importorskip("pydrake.geometry.optimization", reason="drake is not installed")
    region = pb.feasible_region(minerva, ("q2", "q3"))
    path = pb.save_drake_regions(tmp_path / "regions.yaml", {"home": region})
    found = optimization.LoadIrisRegionsYamlFile(path)["home"]
    A, b = region.halfspaces()
    assert np.array_equal(found.A(), A)
    assert np.array_equal(found.b(), b)


def test_a_certified_polytope_is_written_and_another_is_not(minerva: pb.Robot) -> None:
    polytope = pb.certified_polytope(minerva, minerva.home)
    read = yaml.safe_load(drake_text({"p": polytope}))["p"]
    assert read["ambient_dimension"] == 3
    assert np.array_equal(np.array(read["A"]), polytope.A)
    open_one = SimpleNamespace(A=polytope.A, b=polytope.b, verdict=pb.Verdict.UNDECIDED)
    with pytest.raises(pb.UnsupportedError, match="the polytope is UNDECIDED"):
        half_spaces(open_one)


def test_what_is_no_convex_set_is_refused(minerva: pb.Robot) -> None:
    for given, said in (
        (([[1.0, 0.0]], [1.0, 2.0]), "A has shape"),
        (([[np.nan, 0.0]], [1.0]), "not finite"),
        ((np.zeros((0, 0)), []), "A has shape"),
    ):
        with pytest.raises(pb.DimensionError, match=said):
            half_spaces(given)
    for regions, said in (({}, "no region"), ({"a\nb": ([[1.0]], [1.0])}, "printable")):
        with pytest.raises(pb.DimensionError, match=said):
            drake_text(regions)
    with pytest.raises(pb.DimensionError, match="has 1 columns and"):
        drake_text({"a": ([[1.0]], [1.0])}, ("q1", "q2"))
    curved = pb.feasible_region(robot_with(["spheres"]), ("a", "b"))
    with pytest.raises(pb.UnsupportedError):
        drake_text({"curved": curved})


class Wrapper:
    """What is asked of placo's RobotWrapper: seven entries of its base, then its joints by name."""

    def __init__(self, names: list[str]) -> None:
        self.names, self.state = names, SimpleNamespace(q=np.zeros(7 + len(names)))

    def get_joint_offset(self, name: str) -> int:
        return 7 + self.names.index(name)


def test_placos_rows_have_a_column_for_all_of_its_q(minerva: pb.Robot) -> None:
    names = ["q3_crank", "q3", "q1", "q2_level", "q2"]
    region, wrapper = pb.feasible_region(minerva, ("q2", "q3")), Wrapper(names)
    A, b = our_placo.half_spaces(minerva, wrapper, region)
    assert A.shape == (len(b), 12)
    rng = np.random.default_rng(1)
    for q in rng.uniform(-1.5, 1.5, (200, 3)):
        full = rng.uniform(-1, 1, 12)
        full[[7 + names.index(name) for name in minerva.coordinates]] = q
        assert np.all(A @ full <= b) == region.contains(q)
    rows, bound = our_placo.half_spaces(minerva, wrapper, np.eye(3), np.ones(3))
    assert np.array_equal(rows[:, [9, 11, 8]], np.eye(3))
    assert np.array_equal(bound, np.ones(3))
    with pytest.raises(pb.DimensionError, match="A has shape"):
        our_placo.half_spaces(minerva, wrapper, np.eye(2), np.ones(2))
    endless = pb.load(robot_xml([joint("a", "continuous", "base", "l1", xyz="0 0 1")], {}, []))
    with pytest.raises(pb.UnsupportedError, match="'a' is continuous"):
        our_placo.half_spaces(endless, Wrapper(["a"]), [[1.0]], [1.0])
    rows, _ = our_placo.half_spaces(endless, Wrapper(["a"]), [[0.0]], [1.0])
    assert not np.any(rows)
