"""A seeded part of `benchmarks/fuzz_readers.py`: mutated files end in a robot or in one InputError."""

import importlib.util
import random
import sys
from pathlib import Path
from types import ModuleType

import pytest

import pinbound as pb

BENCHMARK = Path(__file__).resolve().parents[1] / "benchmarks" / "fuzz_readers.py"
COUNTS = {"urdf": 300, "xacro": 120, "yaml": 300, "srdf": 300}


@pytest.fixture(scope="module")
def fuzzer() -> ModuleType:
    spec = importlib.util.spec_from_file_location("fuzz_readers", BENCHMARK)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.mark.filterwarnings("ignore:overflow encountered:RuntimeWarning")  # lengths of 1e308 m are what they are
@pytest.mark.filterwarnings("ignore:invalid value encountered:RuntimeWarning")
@pytest.mark.parametrize("reader", COUNTS)
def test_mutated_files_end_in_a_robot_or_in_one_fault(fuzzer: ModuleType, tmp_path: Path, reader: str) -> None:
    outcomes, failures = fuzzer.fuzz(reader, 0, COUNTS[reader], 11, tmp_path, seconds=20.0)
    assert failures == []
    assert outcomes["loaded"] > COUNTS[reader] / 20
    assert outcomes["refused"] > COUNTS[reader] / 4


def test_files_that_are_not_mutated_load_and_agree_with_pinocchio(fuzzer: ModuleType, tmp_path: Path) -> None:
    path = tmp_path / "r.urdf"
    path.write_text(fuzzer.URDF % fuzzer.MARKS)
    robot = pb.load(path)
    assert robot.notes == ()
    assert fuzzer._differs(robot, path.read_bytes()) == ""
    for old, new in (
        ('xyz="0.5 0 0"', 'xyz="0.5 0 1e-6"'),
        ('upper="2"', 'upper="2.1"'),
        ('axis xyz="1 0', 'axis xyz="1 1'),
    ):
        assert old in path.read_text()
        assert fuzzer._differs(robot, path.read_bytes().replace(old.encode(), new.encode()))


def test_mutations_repeat_with_their_seed(fuzzer: ModuleType) -> None:
    twice = [fuzzer.mutated(fuzzer.YAML, random.Random("3")) for _ in range(2)]
    assert twice[0] == twice[1] != fuzzer.YAML.encode()
