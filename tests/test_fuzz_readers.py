"""A seeded part of `benchmarks/fuzz_readers.py`: mutated files end in a robot, a table, or one InputError."""

import importlib
import random
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import pinbound as pb

COUNTS = {"urdf": 300, "xacro": 120, "yaml": 300, "srdf": 300, "mark": 80, "csv": 120, "npy": 100, "npz": 80}
COUNTS["parquet"] = 60


@pytest.fixture(scope="module")
def fuzzer() -> Iterator[ModuleType]:
    pytest.importorskip("pyarrow")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(Path(__file__).resolve().parents[1]))
        yield importlib.import_module("benchmarks.fuzz_readers")


@pytest.mark.filterwarnings("ignore:overflow encountered:RuntimeWarning")  # lengths of 1e308 m are what they are
@pytest.mark.filterwarnings("ignore:invalid value encountered:RuntimeWarning")
@pytest.mark.parametrize("reader", COUNTS)
def test_mutated_files_end_in_what_they_say_or_in_one_fault(fuzzer: ModuleType, tmp_path: Path, reader: str) -> None:
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


def test_a_table_read_otherwise_than_by_a_plain_reader_is_told(
    fuzzer: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The oracle of the tables can fail: a reader that gives numbers changed in the last bit is found."""
    from pinbound.tables.arrays import NpyTable

    real = NpyTable.read
    monkeypatch.setattr(NpyTable, "read", lambda *words: np.nextafter(real(*words), 9.0))
    outcomes, failures = fuzzer.fuzz("npy", 0, 30, 11, tmp_path, seconds=20.0)
    assert outcomes["different"] > 3
    assert {what for _, what in failures} == {"`check` reads other numbers than a plain reader"}
