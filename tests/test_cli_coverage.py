"""Every command says what is watched; nothing to check exits with 2, a required coverage that is partial with 1."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from pinbound.cli import app
from test_coverage import BALLS, MARKS, arm, boundary

HELD = MARKS + boundary("base", "d") + boundary("a", "d")
CLOSED = HELD + boundary("base", "c") + boundary("b", "d")
MOTION = "j1,j2,j3,j4\n0,0,0,0\n0.1,0.1,0.1,0.1\n"
BEYOND = "j1,j2,j3,j4\n0,0,0,0\n0,3.1,0,0\n"


def run(*words: object) -> Result:
    return CliRunner().invoke(app, [str(word) for word in words])


@pytest.fixture
def bare(tmp_path: Path) -> Path:
    return written(tmp_path, "")


def written(folder: Path, notes: str) -> Path:
    path = folder / "arm.urdf"
    path.write_text(arm(BALLS, notes))
    (folder / "m.csv").write_text(MOTION)
    (folder / "beyond.csv").write_text(BEYOND)
    return path


def test_nothing_to_check_is_no_success(bare: Path) -> None:
    motion = bare.with_name("m.csv")
    found = run("check", bare, motion)
    assert found.exit_code == 2
    assert "NOTHING TO CHECK" in found.stdout
    assert "pinbound mark" in found.stderr
    assert "--limits-only" in found.stderr
    as_json = run("check", bare, motion, "--json")
    assert as_json.exit_code == 2
    assert json.loads(as_json.stdout)["verdict"] == "nothing to check"
    assert run("check", bare, bare.with_name("beyond.csv")).exit_code == 1
    assert run("batch", bare, "--random", 10, "--out", bare.with_name("o")).exit_code == 2
    assert not bare.with_name("o").exists()
    crossed = run("crosscheck", bare, "--samples", 10)
    assert crossed.exit_code == 2
    assert "Nothing was checked" in crossed.stdout


def test_limits_alone_are_checked_if_asked_for(bare: Path) -> None:
    found = run("check", bare, bare.with_name("m.csv"), "--limits-only")
    assert found.exit_code == 0
    assert "joint limits alone" in found.stdout
    assert run("check", bare, bare.with_name("beyond.csv"), "--limits-only").exit_code == 1
    out = bare.with_name("o")
    batch = run("batch", bare, "--random", 10, "--out", out, "--limits-only", "--json")
    assert batch.exit_code == 0
    assert json.loads(batch.stdout)["limits_only"] is True
    manifest = json.loads((out / "manifest.json").read_text())
    assert manifest["limits_only"] is True
    assert manifest["coverage"]["watched"] == 0


def test_limits_alone_look_at_no_boundary(tmp_path: Path) -> None:
    path = written(tmp_path, MARKS + '<pinbound:boundary name="far" a="base" b="d" min_distance="0.6"/>')
    options = ("--within", "j2=1.4:1.6,j3=2.4:2.6", "--random", 300, "--columns", "verdict", "--json")
    counts = [
        json.loads(run("batch", path, "--out", tmp_path / name, *options, *more).stdout)["verdicts"]
        for name, more in (("all", ()), ("limits", ("--limits-only",)))
    ]
    assert counts[0]["contact"] == counts[1]["free"] == 300
    contradiction = run("check", path, tmp_path / "m.csv", "--limits-only", "--no-limits")
    assert contradiction.exit_code == 2
    assert "limits_only" in contradiction.stderr


@pytest.mark.parametrize(
    "words",
    [
        ("check", "{robot}", "{folder}/m.csv"),
        ("batch", "{robot}", "--random", "10", "--out", "{folder}/out"),
        ("region", "{robot}", "--coordinates", "j2,j3"),
        ("report", "{robot}", "--out", "{folder}/report"),
        ("crosscheck", "{robot}", "--samples", "20", "--rays", "10", "--levels", "points"),
    ],
    ids=lambda words: words[0],
)
def test_every_verdict_says_its_coverage_and_a_partial_one_fails_where_it_is_required(
    tmp_path: Path, words: tuple[str, ...]
) -> None:
    for notes, summary, code in (
        (HELD, "watches 2 of 10 pairs of links; left out: 4 neighbours, 2 that cannot touch; 2 not watched", 1),
        (CLOSED, "watches 4 of 10 pairs of links; left out: 4 neighbours, 2 that cannot touch", 0),
    ):
        folder = tmp_path / str(code)
        folder.mkdir()
        path = written(folder, notes)
        plain = run(*(word.format(robot=path, folder=folder) for word in words))
        assert plain.exit_code == 0, plain.output
        assert summary in plain.stdout
        again = run(*(word.format(robot=path, folder=folder) for word in words), "--require-coverage")
        assert again.exit_code == code, again.output
        assert ("base - c: not watched" in again.stderr) is bool(code)


def test_json_and_the_page_say_it_too(tmp_path: Path) -> None:
    path = written(tmp_path, HELD)
    records = [
        json.loads(run("check", path, tmp_path / "m.csv", "--json").stdout),
        json.loads(run("region", path, "--coordinates", "j2,j3", "--json").stdout),
        json.loads(run("batch", path, "--random", 10, "--out", tmp_path / "o", "--json").stdout),
        json.loads(run("crosscheck", path, "--samples", 20, "--levels", "points", "--json").stdout),
        json.loads((tmp_path / "o" / "manifest.json").read_text()),
        json.loads(run("info", path, "--json").stdout),
    ]
    for record in records:
        assert (record["coverage"]["watched"], record["coverage"]["unwatched"]) == (2, 2)
        assert record["coverage"]["is_complete"] is False
    full = records[-1]["coverage"]
    assert len(full["pairs_of_links"]) == 10
    assert full["bodies_by_link"]["d"] == [{"index": 0, "shape": "sphere", "held_by": [["d"]], "reason": ""}]
    run("report", path, "--out", tmp_path / "report")
    page = (tmp_path / "report" / "index.html").read_text()
    assert "watches 2 of 10 pairs of links" in page
    assert "<td>base - c</td><td>not watched</td>" in page


def test_info_counts_pairs_and_lists_them(tmp_path: Path) -> None:
    path = written(tmp_path, HELD)
    short = run("info", path).stdout
    assert "no boundary between them" in short
    assert "watches 2 of 10 pairs of links" in short
    every = run("info", path, "--pairs").stdout
    assert sum("│" in line and "neighbours" in line for line in every.splitlines()) == 4
    assert "can never meet" in every


def test_a_region_without_boundaries_says_that_limits_are_all(bare: Path) -> None:
    found = run("region", bare, "--coordinates", "j2,j3")
    assert found.exit_code == 0
    assert "joint limits alone" in found.stdout
    assert "watches 0 of 10 pairs of links" in found.stdout
