"""A job that is disturbed anywhere ends as the undisturbed one, or is refused with one message."""

import importlib.util
import json
import os
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import pinbound as pb
from pinbound.batch import RandomSource, evaluation_of, open_source, run
from pinbound.cli import app

pytest.importorskip("pyarrow")
BOX = ((-1.0, -2.0, -2.0), (1.0, 2.0, 2.0))


def harness() -> Any:
    spec = importlib.util.spec_from_file_location("faults", Path(__file__).parents[1] / "benchmarks" / "faults.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["faults"] = module
    spec.loader.exec_module(module)
    return module


@pytest.mark.skipif(not hasattr(os, "fork"), reason="kills need fork")
@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
def test_faults_at_every_call_change_nothing(tmp_path: Path) -> None:
    """A seeded part of `benchmarks/faults.py`."""
    found = harness().campaign(20, 7, tmp_path)
    assert not found.wrong
    assert len(found.seen) > 10


@pytest.fixture(scope="module")
def robot() -> pb.Robot:
    return pb.load("minervabot_v3")


def snapshot(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}


@pytest.mark.parametrize("name", [".draft.tmp", ".lock", "thesis.tex", ".part-00000000.parquet.tmp"])
def test_a_folder_of_somebody_else_is_left_as_it_is(name: str, robot: pb.Robot, tmp_path: Path) -> None:
    (tmp_path / name).write_text("mine")
    with pytest.raises(pb.InputError, match="holds other files"):
        run(evaluation_of(robot, ("verdict",), backend="numpy"), RandomSource(10, 1, *BOX), tmp_path)
    assert snapshot(tmp_path) == {name: b"mine"}


def test_links_are_not_followed(robot: pb.Robot, tmp_path: Path) -> None:
    target, folder = tmp_path / "precious", tmp_path / "o"
    target.write_text("mine")
    folder.mkdir()
    (folder / ".pinbound.lock").symlink_to(target)
    evaluation, source = evaluation_of(robot, ("verdict",), backend="numpy"), RandomSource(10, 1, *BOX)
    with pytest.raises(pb.InputError, match="it is a link"):
        run(evaluation, source, folder)
    (folder / ".pinbound.lock").unlink()
    (folder / ".pinbound.manifest.json.tmp").symlink_to(target)
    run(evaluation, source, folder)
    assert target.read_text() == "mine"


def spoil_text(path: Path, change: Callable[[Any], Any]) -> None:
    path.write_text(json.dumps(change(json.loads(path.read_text()))))


@pytest.mark.parametrize(
    "change",
    [
        lambda record: [],
        lambda record: record | {"rows": 200},
        lambda record: record | {"chunk": 0},
        lambda record: record | {"job": "0" * 64},
        lambda record: {key: value for key, value in record.items() if key != "statistics"},
        lambda record: record | {"statistics": record["statistics"] | {"rows": 299}},
        lambda record: record | {"statistics": record["statistics"] | {"verdicts": [300]}},
        lambda record: record | {"statistics": record["statistics"] | {"minima": ["x"]}},
        lambda record: record | {"statistics": record["statistics"] | {"more": 1}},
        lambda record: record | {"statistics": record["statistics"] | {"verdicts": [1, 2, 3, 4, 5, 6]}},
    ],
)
def test_a_record_that_is_not_this_chunks_is_made_anew(
    change: Callable[[Any], Any], robot: pb.Robot, tmp_path: Path
) -> None:
    evaluation = evaluation_of(robot, ("smallest", "verdict"), summary=True, backend="numpy")
    source = RandomSource(1000, 1, *BOX)
    whole = run(evaluation, source, tmp_path, chunk_rows=300)
    before = snapshot(tmp_path)
    spoil_text(tmp_path / "part-00000001.json", change)
    again = run(evaluation, source, tmp_path, chunk_rows=300)
    assert again.resumed == 3
    assert again.statistics == whole.statistics
    assert snapshot(tmp_path) == before


def test_a_chunk_copied_over_another_is_made_anew(robot: pb.Robot, tmp_path: Path) -> None:
    evaluation, source = evaluation_of(robot, ("verdict",), backend="numpy"), RandomSource(1200, 1, *BOX)
    run(evaluation, source, tmp_path, chunk_rows=300)
    before = snapshot(tmp_path)
    for suffix in (".json", ".parquet"):
        shutil.copy(tmp_path / f"part-00000003{suffix}", tmp_path / f"part-00000001{suffix}")
    run(evaluation, source, tmp_path, chunk_rows=300)
    assert snapshot(tmp_path) == before


@pytest.mark.parametrize("text", ["[]", "\x80", "", '{"job": 3}', "[" * 10_000])
def test_a_manifest_that_is_none_is_refused(text: str, robot: pb.Robot, tmp_path: Path) -> None:
    (tmp_path / "manifest.json").write_text(text, encoding="latin-1")
    with pytest.raises(pb.InputError, match="no manifest of a batch"):
        run(evaluation_of(robot, ("verdict",), backend="numpy"), RandomSource(10, 1, *BOX), tmp_path)
    assert len(list(tmp_path.iterdir())) == 1


@pytest.mark.parametrize("suffix", [".npy", ".csv"])
def test_an_input_that_changes_between_two_runs(suffix: str, robot: pb.Robot, tmp_path: Path) -> None:
    path = tmp_path / f"q{suffix}"

    def save(Q: Any) -> None:
        if suffix == ".npy":
            np.save(path, Q)
        else:
            np.savetxt(path, Q, delimiter=",", header="q1,q2,q3", comments="")

    Q = RandomSource(100, 1, *BOX).read(0, 100)
    save(Q)
    evaluation, source = evaluation_of(robot, ("verdict",), backend="numpy"), open_source(path, robot.coordinates)
    save(-Q)
    with pytest.raises(pb.InputError, match="not the one that was opened"):
        run(evaluation, source, tmp_path / "o", chunk_rows=30)
    with pytest.raises(pb.InputError, match="source is"):
        run(evaluation, open_source(path, robot.coordinates), tmp_path / "o", chunk_rows=30)


def test_a_joint_called_row_keeps_its_own_column(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text("""<robot name="arm"><link name="a"/><link name="b"/><link name="c"/>
      <joint name="row" type="revolute"><parent link="a"/><child link="b"/>
        <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
      <joint name="verdict" type="revolute"><parent link="b"/><child link="c"/>
        <limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>""")
    evaluation = evaluation_of(pb.load(path), ("coordinates", "verdict"), backend="numpy", limits_only=True)
    table, _ = evaluation.table(np.array([[0.25, 0.5]]), 7)
    assert table.column_names == ["row", "q.row", "q.verdict", "verdict"]
    assert table["row"].to_pylist() == [7]
    assert table["q.row"].to_pylist() == [0.25]


def test_degrees_of_a_file_are_converted(tmp_path: Path) -> None:
    path = tmp_path / "q.csv"
    path.write_text("q1,q2,q3\n0,10,20\n0,0,60\n")
    verdicts = []
    for words in (["--deg"], []):
        out = tmp_path / f"out{len(words)}"
        result = CliRunner().invoke(
            app, ["batch", "minervabot_v3", "--in", str(path), "--out", str(out), "--json", *words]
        )
        assert result.exit_code == 0, result.output
        verdicts.append(json.loads(result.stdout)["verdicts"])
    assert verdicts[0]["inside"] == 1
    assert verdicts[1]["inside"] == 0
    result = CliRunner().invoke(app, ["batch", "minervabot_v3", "--in", str(path), "--out", str(tmp_path / "out1")])
    assert result.exit_code == 2
    assert "another job: source" in result.output


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (["--random", "5", "--seed", "-1"], 2, "--seed"),
        (["--grid", "q2=0:1:²"], 2, "'²' is no count"),
        (["--random", "1" + "0" * 30], 2, "Give from 1 to 10^15"),
        (["--random", "10000000000", "--chunk-rows", "1"], 2, "the most are 100,000,000"),
        (["--random", "5", "--scheduler", "localhost:8786"], 2, "tcp://"),
        (["--random", "5", "--scheduler", "tcp://127.0.0.1:1"], 3, "no Dask scheduler answers"),
    ],
)
def test_exit_codes(words: list[str], code: int, message: str, tmp_path: Path) -> None:
    if "--scheduler" in words:
        pytest.importorskip("distributed")
    result = CliRunner().invoke(app, ["batch", "minervabot_v3", "--out", str(tmp_path / "o"), *words])
    assert result.exit_code == code, result.output
    assert message in result.output


@pytest.mark.parametrize("name", ["m.csv", "m.npy", "m.npz", "m.parquet"])
def test_a_file_without_a_row_is_refused_and_leaves_no_folder(name: str, robot: pb.Robot, tmp_path: Path) -> None:
    import pyarrow
    import pyarrow.parquet

    path, out, nothing = tmp_path / name, tmp_path / "out", np.zeros(0)
    {
        ".csv": lambda: path.write_text("q1,q2,q3\n"),
        ".npy": lambda: np.save(path, np.zeros((0, 3))),
        ".npz": lambda: np.savez(path, q1=nothing, q2=nothing, q3=nothing),
        ".parquet": lambda: pyarrow.parquet.write_table(pyarrow.table(dict.fromkeys(robot.coordinates, nothing)), path),
    }[path.suffix]()
    result = CliRunner().invoke(app, ["batch", "minervabot_v3", "--in", str(path), "--out", str(out)])
    assert result.exit_code == 2, result.output
    assert f"{name}: there is no row. Give at least one configuration." in result.output
    with pytest.raises(pb.InputError, match=f"{name}: there is no row"):
        run(evaluation_of(robot, ("verdict",), backend="numpy"), open_source(path, robot.coordinates), out)
    with pytest.raises(pb.InputError, match="there is no row"):
        run(evaluation_of(robot, ("verdict",), backend="numpy"), RandomSource(0, 1, *BOX), out)
    assert not out.exists()


def test_a_full_disk_is_no_fault_of_the_input(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from pinbound.batch import files

    def full(*_: Any) -> int:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(files.os, "write", full)
    result = CliRunner().invoke(app, ["batch", "minervabot_v3", "--random", "5", "--out", str(tmp_path / "o")])
    assert result.exit_code == 3
    assert "manifest.json: writing failed: No space left on device" in result.output
    assert "run the same command again to resume" in result.output
