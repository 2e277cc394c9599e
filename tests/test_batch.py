"""A batch job: rows equal the API's, nothing lost or repeated by any stop, bad input refused with one message."""

import hashlib
import importlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import pinbound as pb
from pinbound.batch import (
    VERDICTS,
    FileSource,
    GridSource,
    RandomSource,
    SobolSource,
    evaluation_of,
    open_source,
    run,
)
from pinbound.cli import app
from pinbound.robot.robot import Robot

pyarrow = pytest.importorskip("pyarrow")
for _module in ("pyarrow.csv", "pyarrow.parquet"):
    importlib.import_module(_module)

ALL = ("coordinates", "clearances", "smallest", "region", "verdict")
BOX = ((-1.0, -2.0, -2.0), (1.0, 2.0, 2.0))


@pytest.fixture(scope="module")
def robot() -> Robot:
    return pb.load("minervabot_v3")


def rows_of(folder: Path) -> Any:
    files = sorted(folder.glob("part-*.parquet"))
    return pyarrow.concat_tables([pyarrow.parquet.read_table(file) for file in files]).unify_dictionaries()


def digests(folder: Path) -> dict[str, str]:
    return {p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in folder.glob("part-*.parquet")}


def command(*words: str) -> Any:
    return CliRunner().invoke(app, ["batch", "minervabot_v3", *words])


def test_every_column_says_what_the_api_says(robot: Robot, tmp_path: Path) -> None:
    Q = RandomSource(900, 3, *BOX).read(0, 900)
    Q[7, 1], Q[8, 0], Q[9, 2] = np.nan, np.inf, -np.inf
    Q[10] = [0.0, 9.0, 0.0]
    np.save(tmp_path / "q.npy", Q)
    source = open_source(tmp_path / "q.npy", robot.coordinates)
    outcome = run(evaluation_of(robot, ALL, summary=True, backend="numpy"), source, tmp_path / "out", chunk_rows=400)
    table = rows_of(tmp_path / "out")
    assert table["row"].to_numpy().tolist() == list(range(900))
    found = np.stack([table[name].to_numpy() for name in robot.coordinates], axis=1)
    assert np.array_equal(found, Q, equal_nan=True)
    clearances = np.stack([table[f"clearance_{name}"].to_numpy() for name in robot.boundaries.names], axis=1)
    expected = np.stack([b.signed_clearance(Q) for b in robot.boundaries], axis=1)
    assert np.allclose(clearances, expected, rtol=1e-12, atol=1e-15, equal_nan=True)
    finite = np.all(np.isfinite(Q), axis=1)
    least = table["smallest_clearance"].to_numpy()
    assert np.allclose(least[finite], expected[finite].min(axis=1), rtol=1e-12, atol=1e-15)
    names = np.array(table["smallest_boundary"].to_pylist(), dtype=object)
    assert names[finite].tolist() == np.array(robot.boundaries.names)[expected[finite].argmin(axis=1)].tolist()
    assert names[7] is None
    region = pb.feasible_region(robot)
    assert np.array_equal(table["inside_region"].to_numpy(), region.contains(Q))
    verdicts = np.array(table["verdict"].to_pylist())
    assert np.all(verdicts[~finite] == "invalid")
    assert verdicts[10] == "contact"  # nine radians of q2 lie beyond its stops, as well as beyond its limit
    assert np.array_equal(verdicts == "inside", region.contains(Q) & finite)
    statistics = outcome.statistics
    assert (statistics.rows, statistics.invalid) == (900, 3)
    assert statistics.verdicts == [int(np.sum(verdicts == name)) for name in VERDICTS]
    assert np.allclose(statistics.minima, expected[finite].min(axis=0), rtol=1e-12, atol=1e-15)
    widths = np.diff(evaluation_of(robot, ("clearances",), backend="numpy").spans)[:, 0] / 1024
    quantiles = outcome.quantiles(evaluation_of(robot, ("clearances",), backend="numpy"), (0.1, 0.5))
    exact = np.quantile(expected[finite], (0.1, 0.5), axis=0, method="inverted_cdf").T
    assert np.all((quantiles >= exact - 1e-12) & (quantiles <= exact + widths[:, None] + 1e-12))


def test_a_violated_limit_and_a_contact_have_their_verdicts(tmp_path: Path) -> None:
    path = tmp_path / "two.urdf"
    path.write_text("""<robot name="two" xmlns:pinbound="urn:pinbound:1">
      <link name="a"/><link name="b"/><link name="c"/>
      <joint name="q1" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>
        <limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
      <joint name="q2" type="revolute"><parent link="b"/><child link="c"/><origin xyz="1 0 0"/><axis xyz="0 0 1"/>
        <limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
      <pinbound:annotations><pinbound:home q1="1" q2="1"/>
        <pinbound:point name="x" link="a" xyz="1.5 0 0" radius="0.1"/><pinbound:point name="y" link="c" xyz="0.5 0 0"/>
        <pinbound:boundary name="hit" a="x" b="y" min_distance="0.05"/></pinbound:annotations></robot>""")
    np.save(tmp_path / "q.npy", np.array([[0.0, 0.0], [1.0, 1.0], [2.5, 1.0], [1.0, np.nan]]))
    robot = pb.load(path)
    evaluation = evaluation_of(robot, ("verdict",), backend="numpy")
    run(evaluation, open_source(tmp_path / "q.npy", robot.coordinates), tmp_path / "out")
    found = rows_of(tmp_path / "out")["verdict"].to_pylist()
    assert found[0] == "contact"
    assert found[1] in {"free", "inside"}
    assert found[2:] == ["limit", "invalid"]


@pytest.mark.parametrize("kind", ["csv", "parquet", "npy"])
def test_files_of_every_kind_give_the_same_rows(kind: str, robot: Robot, tmp_path: Path) -> None:
    Q = RandomSource(1050, 5, *BOX).read(0, 1050)
    Q[3, 1] = np.nan
    columns = {"other": np.arange(1050), **{name: Q[:, j] for j, name in reversed(list(enumerate(robot.coordinates)))}}
    path = tmp_path / f"q.{kind}"
    if kind == "npy":
        np.save(path, Q)
    elif kind == "parquet":
        pyarrow.parquet.write_table(pyarrow.table(columns), path, row_group_size=100)
    else:
        table = pyarrow.table({k: pyarrow.array(v, from_pandas=True) for k, v in columns.items()})
        pyarrow.csv.write_csv(table, path)
    source = open_source(path, robot.coordinates)
    assert source.rows == 1050
    found = np.concatenate([array for _, array in source.chunks(400, [0, 1, 2])])
    assert np.array_equal(found, Q, equal_nan=True)
    assert [(i, len(a)) for i, a in source.chunks(400, [2])] == [(2, 250)]
    assert np.array_equal(source.read(400, 800), Q[400:800])


def test_made_rows_do_not_depend_on_the_chunks() -> None:
    for source in (
        RandomSource(150_000, 9, *BOX),
        SobolSource(5000, 9, *BOX),
        GridSource(((0, 1, 7), (2, 3, 11), (5, 5, 1))),
    ):
        whole = source.read(0, source.rows)
        middle = source.rows // 3
        assert np.array_equal(source.read(middle, middle + 40), whole[middle : middle + 40])
        assert len(np.unique(whole, axis=0)) == source.rows
    lower, upper = map(np.array, BOX)
    points = SobolSource(4096, 1, *BOX).read(0, 4096)
    assert np.all((lower <= points) & (points <= upper))
    assert np.allclose(points.mean(axis=0), (lower + upper) / 2, atol=2e-3)


def test_a_damaged_chunk_is_made_again(robot: Robot, tmp_path: Path) -> None:
    evaluation, source = evaluation_of(robot, ALL, backend="numpy"), RandomSource(1000, 1, *BOX)
    run(evaluation, source, tmp_path / "o", chunk_rows=300)
    expected = digests(tmp_path / "o")
    (tmp_path / "o/part-00000001.parquet").write_bytes(b"PAR1 torn")
    (tmp_path / "o/part-00000002.json").unlink()
    (tmp_path / "o/part-00000003.json").write_text("{")
    outcome = run(evaluation, source, tmp_path / "o", chunk_rows=300)
    assert (outcome.chunks, outcome.resumed) == (4, 1)
    assert digests(tmp_path / "o") == expected
    manifest = json.loads((tmp_path / "o/manifest.json").read_text())
    assert manifest["state"] == "complete"
    assert {c["file"]: c["sha256"] for c in manifest["chunks"]} == expected


def test_another_job_or_other_files_in_the_folder_are_refused(robot: Robot, tmp_path: Path) -> None:
    evaluation, source = evaluation_of(robot, ("verdict",), backend="numpy"), RandomSource(10, 1, *BOX)
    run(evaluation, source, tmp_path / "o")
    with pytest.raises(pb.InputError, match="source is"):
        run(evaluation, RandomSource(10, 2, *BOX), tmp_path / "o")
    with pytest.raises(pb.InputError, match="columns is"):
        run(evaluation_of(robot, ("smallest",), backend="numpy"), source, tmp_path / "o")
    changed = pb.load("minervabot_v3", xacro_args={"bridge": "as_printed"})
    with pytest.raises(pb.InputError, match="robot_sha256 is"):
        run(evaluation_of(changed, ("verdict",), backend="numpy"), source, tmp_path / "o")
    (tmp_path / "p").mkdir()
    (tmp_path / "p/thesis.tex").write_text("x")
    with pytest.raises(pb.InputError, match=r"holds other files \(thesis.tex\)"):
        run(evaluation, source, tmp_path / "p")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ((), "0 sources of configurations"),
        (("--random", "5", "--sobol", "5"), "2 sources"),
        (("--grid", "q9=0:1:2"), "Valid: q1, q2, q3"),
        (("--grid", "q2=0:1"), "is not NAME=FROM:TO:COUNT. Write NAME=FROM:TO:COUNT"),
        (("--grid", "q2=0:1:2,q2=0:1:3"), "'q2' is given twice"),
        (("--random", "5", "--within", "q2=-0_1:1"), "is no interval"),
        (("--grid", "q2=0:1:2", "--within", "q2=0:1"), "--within: does nothing with --grid"),
        (("--grid", "q2=0:1:0"), "is no count"),
        (("--random", "5", "--within", "q2=1:-1"), "is no interval"),
        (("--random", "5", "--columns", "verdicts"), "Did you mean 'verdict'"),
        (("--in", "nowhere.csv"), "No such file"),
        (("--in", "bad.txt"), "Give a .csv, .npy, .npz or .parquet file"),
        (("--in", "bad.csv"), "has no column 'q3'"),
        (("--in", "words.csv"), "words.csv, line 2: q3 is 'north'"),
        (("--in", "bad.npy"), "Give numbers"),
    ],
)
def test_bad_input_is_one_message_and_exit_code_2(
    words: tuple[str, ...], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("bad.txt").write_text("x")
    Path("bad.csv").write_text("q1,q2\n0,0\n")
    Path("words.csv").write_text("q1,q2,q3\n0,0,north\n")
    np.save("bad.npy", np.zeros((3, 2)))
    result = command(*words, "--out", "o")
    assert result.exit_code == 2
    assert message in result.output
    assert "Traceback" not in result.output


def test_the_command_writes_grid_rows_and_a_summary(tmp_path: Path) -> None:
    result = command(
        "--grid", "q2=-90:90:19,q3=-90:90:19", "--deg", "--out", str(tmp_path / "o"), "--summary", "--json"
    )
    assert result.exit_code == 0, result.output
    record = json.loads(result.stdout)
    assert record["rows"] == sum(record["verdicts"].values()) == 361
    assert [entry["boundary"] for entry in record["summary"]][:2] == ["beta_1", "beta_2"]
    table = rows_of(tmp_path / "o")
    assert np.isclose(table["q2"].to_numpy()[0], -np.pi / 2)
    again = command("--grid", "q2=-90:90:19,q3=-90:90:19", "--deg", "--out", str(tmp_path / "o"), "--summary")
    assert "1 (1 existed already)" in again.output


def test_kill_at_random_moments_changes_nothing(robot: Robot, tmp_path: Path) -> None:
    words = ["minervabot_v3", "--random", "120000", "--seed", "4", "--chunk-rows", "2000"]
    words += ["--columns", ",".join(ALL)]
    code = "import sys; from pinbound.cli import main; sys.argv[0] = 'pinbound'; main()"
    environment = {**os.environ, "PINBOUND_CACHE_DIR": str(tmp_path / "cache")}

    def start(folder: str) -> Any:
        return subprocess.Popen(
            [sys.executable, "-c", code, "batch", *words, "--out", str(tmp_path / folder)],
            env=environment,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )

    assert start("whole").wait(timeout=120) == 0
    random = np.random.default_rng(11)
    kills = 0
    for _ in range(4):
        process = start("killed")
        before = len(list((tmp_path / "killed").glob("part-*.json")))
        deadline = time.monotonic() + 60
        target = before + int(random.integers(0, 8))
        while process.poll() is None and time.monotonic() < deadline:
            if len(list((tmp_path / "killed").glob("part-*.json"))) > target:
                break
            time.sleep(0.001)
        time.sleep(float(random.uniform(0, 0.02)))
        if process.poll() is None:
            process.send_signal(signal.SIGKILL)
            kills += 1
        process.wait(timeout=60)
    assert kills > 0
    assert start("killed").wait(timeout=120) == 0
    assert digests(tmp_path / "killed") == digests(tmp_path / "whole")
    assert rows_of(tmp_path / "killed")["row"].to_numpy().tolist() == list(range(120_000))
    assert not list((tmp_path / "killed").glob(".*.tmp"))


def test_a_second_process_is_kept_out(robot: Robot, tmp_path: Path) -> None:
    fcntl = pytest.importorskip("fcntl")
    (tmp_path / "o").mkdir()
    with (tmp_path / "o/.pinbound.lock").open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        with pytest.raises(pb.InputError, match="another process is writing there"):
            run(evaluation_of(robot, ("verdict",), backend="numpy"), RandomSource(10, 1, *BOX), tmp_path / "o")


def test_a_csv_source_is_pinned_by_its_content(robot: Robot, tmp_path: Path) -> None:
    path = tmp_path / "q.csv"
    path.write_text("q1,q2,q3\n0,0,0\n")
    first = open_source(path, robot.coordinates)
    path.write_text("q1,q2,q3\n0,0,1\n")
    assert isinstance(first, FileSource)
    assert open_source(path, robot.coordinates).sha256 != first.sha256


def test_without_pyarrow_the_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    out = str(tmp_path / "out")
    result = CliRunner().invoke(app, ["batch", "minervabot_v3", "--random", "10", "--seed", "0", "--out", out])
    assert result.exit_code == 2
    assert "pinbound[batch]" in result.stderr


def test_summaries_of_heights_below_zero_keep_their_quantiles(tmp_path: Path) -> None:
    """Behind a plane a clearance is negative beyond its threshold; no bin may clip it."""
    from segments import MARKS, PLANAR, assemble

    path = tmp_path / "planar.urdf"
    path.write_text(assemble(PLANAR, MARKS, ["C_floor", "A_C"], '<pinbound:home q1="-0.4" q2="-0.5"/>'))
    robot = pb.load(path)
    spans = evaluation_of(robot, ("clearances",), backend="numpy").spans
    Q = np.random.default_rng(3).uniform(-3, 3, (5000, 2))
    clearances = robot.boundaries.clearances(Q)
    assert clearances[:, 0].min() < -0.1
    assert np.all((spans[:, 0] <= clearances.min(axis=0)) & (clearances.max(axis=0) <= spans[:, 1]))
