"""`pinbound plan`, and what all commands show while they work, in narrow terminals, and for completion."""

import csv
import io
import json
import re
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console
from typer.testing import CliRunner

import pinbound as pb
from pinbound.cli import app, shared
from robots import joint, robot_xml

GOAL = "--goal=q1=60,q2=55,q3=60"


def said(*words: str, code: int = 0) -> str:
    result = CliRunner().invoke(app, words)
    assert result.exit_code == code, result.output
    return " ".join(re.sub(r"[^\x20-\x7e\n]", " ", result.output).split())


def test_a_plan_is_a_file_that_check_certifies(tmp_path: Path) -> None:
    path = tmp_path / "way.csv"
    text = said("plan", "minervabot_v3", GOAL, "--deg", "--velocity", "1", "--out", str(path))
    assert "CERTIFIED: 2 waypoints (straight), at least" in text
    assert "coverage: watches" in text
    assert f"pinbound check ROBOT {path} --deg" in text
    rows = list(csv.reader(path.read_text().splitlines()))
    assert rows[0] == ["time", "q1", "q2", "q3"]
    assert np.allclose(np.array(rows[1:], dtype=float)[:, 1:], [[0, 0, 0], [60, 55, 60]], atol=1e-12)
    assert float(rows[-1][0]) == pytest.approx(np.radians(60))  # the longest way at 1 rad/s
    assert "CERTIFIED" in said("check", "minervabot_v3", str(path), "--deg")


def test_a_plan_in_radians_is_the_one_of_python(tmp_path: Path) -> None:
    path = tmp_path / "way.csv"
    found = json.loads(
        said("plan", "minervabot_v3", "--start=q2=0.1", "--goal=q2=0.5,q3=0.8", "--out", str(path), "--json")
    )
    robot = pb.load("minervabot_v3")
    wanted = pb.plan(robot, [0.0, 0.1, 0.0], [0.0, 0.5, 0.8])
    assert found["waypoints"] == wanted.waypoints.tolist()
    assert wanted.certificate is not None
    assert found["lower"] == pytest.approx(wanted.certificate.lower, abs=1e-9)
    table = np.loadtxt(path, delimiter=",", skiprows=1)
    assert np.array_equal(table, wanted.waypoints)


def test_where_there_is_no_motion_the_boundary_is_named(tmp_path: Path) -> None:
    path = tmp_path / "way.csv"
    text = said("plan", "minervabot_v3", "--goal=q3=60", "--deg", "--out", str(path), code=1)
    assert "VIOLATED: there is no motion: beta_4" in text
    assert not path.exists()


def test_numbers_in_degrees_are_hinted_at() -> None:
    assert "--goal: these numbers look like degrees" in said("plan", "minervabot_v3", "--goal=q2=20,q3=30", code=1)
    assert "--window: these numbers look like degrees" in said("region", "minervabot_v3", "--window=q2=-20..60")
    assert "look like degrees" not in said("region", "minervabot_v3", "--window=q2=-20..60", "--deg")


def test_a_plan_is_written_as_csv_only() -> None:
    assert "Let it end in .csv" in said("plan", "minervabot_v3", GOAL, "--out", "way.txt", code=2)


def test_a_terminal_shows_how_much_time_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = io.StringIO()
    monkeypatch.setattr(shared, "console", lambda stderr=False: Console(file=screen, force_terminal=True, width=80))
    with shared.working("tracing the region", 20.0):
        pass
    assert re.search(r"tracing the region.*0 s, at most 20 s left", screen.getvalue())
    screen.truncate(0)
    with shared.working("asking coal"):
        pass
    assert "asking coal" in screen.getvalue()
    assert "left" not in screen.getvalue()


def test_a_pipe_shows_nothing_of_it(capsys: pytest.CaptureFixture[str]) -> None:
    with shared.working("tracing the region", 20.0):
        pass
    assert capsys.readouterr() == ("", "")


def test_no_name_is_cut_at_60_columns(monkeypatch: pytest.MonkeyPatch) -> None:
    """Names are whole: a table that would fold them is printed row by row."""
    long = "q2_orientation_of_the_forward_rod"
    xml = robot_xml(
        [joint("q1", "revolute", "base", "upper"), joint(long, "revolute", "upper", "lower", xyz="0.3 0 0")], {}, []
    )
    screen = io.StringIO()
    monkeypatch.setattr(shared, "console", lambda stderr=False: Console(file=screen, force_terminal=True, width=60))
    robot = pb.load(xml)
    rows = [(name, "12.345678", "-114.591559 deg", f"{name} lower") for name in robot.coordinates]
    shared.print_table("Limits", ("coordinate", "here [deg]", "from", "stopped by"), rows)
    printed = re.sub("\x1b[^m]*m", "", screen.getvalue())
    assert all(len(line) <= 60 for line in printed.splitlines())
    assert "\u2026" not in printed
    assert f"coordinate {long}" in printed  # too wide for a table: row by row, names whole
    assert long in printed.replace(f"coordinate {long}", "")


def test_completion_can_be_shown_and_installed() -> None:
    text = said("--help")
    assert "--install-completion" in text
    assert "_PINBOUND_COMPLETE" in CliRunner().invoke(app, ["--show-completion", "bash"]).output
