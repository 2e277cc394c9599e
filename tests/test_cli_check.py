"""`pinbound check`: verdicts, exit codes, JSON, figure, errors without traceback."""

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner, Result

import pinbound as pb
from pinbound.cli import app
from pinbound.cli.shared import print_table

CLEAR = "time,q1,q2,q3\n0,0,0,0\n2,90,30,40\n"
BLOCKED = "time,q1,q2,q3\n0,0,0,0\n1,90,0,60\n"


def check(folder: Path, text: str, *options: str, name: str = "motion.csv") -> Result:
    path = folder / name
    path.write_text(text)
    return CliRunner().invoke(app, ["check", "minervabot_v3", str(path), *options])


def test_certified_motion(tmp_path: Path) -> None:
    result = check(tmp_path, CLEAR, "--deg")
    assert result.exit_code == 0
    assert "CERTIFIED" in result.stdout
    assert "beta_9" in result.stdout


def test_violated_motion(tmp_path: Path) -> None:
    result = check(tmp_path, BLOCKED, "--deg", "--json")
    assert result.exit_code == 1
    found = json.loads(result.stdout)
    assert found["verdict"] == "violated"
    assert found["first_contact"]["violated"] == "beta_4"
    assert found["first_contact"]["at"] == pytest.approx(32.429119975 / 60, abs=1e-7)
    q = found["boundaries"][3]["first_contact"]["q"]
    assert np.degrees(q["q3"] - q["q2"]) == pytest.approx(32.429119975, abs=1e-6)
    assert check(tmp_path, BLOCKED, "--deg").exit_code == 1


def test_radians_unless_degrees_are_said(tmp_path: Path) -> None:
    result = check(tmp_path, CLEAR, "--json")
    assert result.exit_code == 1
    assert json.loads(result.stdout)["limits"]


def test_only_some_boundaries_and_no_limits(tmp_path: Path) -> None:
    found = json.loads(check(tmp_path, BLOCKED, "--deg", "--json", "--boundary", "beta_9", "--no-limits").stdout)
    assert (found["verdict"], len(found["boundaries"]), found["limits"]) == ("certified", 1, [])


def test_undecided_is_no_success(tmp_path: Path) -> None:
    touching = pb.load("minervabot_v3").boundaries["beta_3"].contact.angle
    text = f"q1,q2,q3\n0,0.9,0.8\n0,0.9,{touching!r}\n0,0.9,0.8\n"
    result = check(tmp_path, text)
    assert result.exit_code == 1
    assert "UNDECIDED" in result.stdout
    assert "rounding" in result.stdout
    left = json.loads(check(tmp_path, text, "--json", "--boundary", "beta_3").stdout)["undecided"]
    assert len(left) == 1
    assert left[0]["name"] == "beta_3"
    assert left[0]["start"] <= 1.0 <= left[0]["end"]


@pytest.mark.parametrize("suffix", ["png", "svg", "pdf"])
def test_plot(tmp_path: Path, suffix: str) -> None:
    figure = tmp_path / f"figure.{suffix}"
    assert check(tmp_path, BLOCKED, "--deg", "--plot", str(figure)).exit_code == 1
    assert figure.stat().st_size > 5000


@pytest.mark.parametrize(
    ("text", "name", "message"),
    [
        ("", "m.csv", "empty"),
        ("q1,q2\n0,0\n", "m.csv", "q3"),
        (CLEAR + "1,0,0,0\n", "m.csv", "does not increase"),
        ("time,q1,q2,q3\n0,0,0,nan\n", "m.csv", "nan"),
        (CLEAR, "m.xlsx", "csv"),
    ],
)
def test_bad_input(tmp_path: Path, text: str, name: str, message: str) -> None:
    result = check(tmp_path, text, name=name)
    assert result.exit_code == 2
    assert message in result.stderr
    assert "Traceback" not in result.stderr
    assert result.stdout == ""


def test_absent_file_and_unknown_boundary_and_figure(tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["check", "minervabot_v3", str(tmp_path / "absent.csv")])
    assert result.exit_code == 2
    assert "absent.csv" in result.stderr
    unknown = check(tmp_path, CLEAR, "--deg", "--boundary", "beta_99")
    assert unknown.exit_code == 2
    assert "beta_99" in unknown.stderr
    assert check(tmp_path, CLEAR, "--deg", "--plot", str(tmp_path / "x.docx")).exit_code == 2


def test_a_long_table_is_cut_and_says_so(capsys: pytest.CaptureFixture[str]) -> None:
    print_table("T", ("name", "rows []"), [(f"r{place}", place) for place in range(30)], "Note.", most=12)
    said = capsys.readouterr().out
    assert "r11" in said
    assert "r12" not in said
    assert "The first 12 of 30 are shown: --json lists all. Note." in " ".join(said.split())
    print_table("T", ("name",), [("r0",)] * 12, most=12)
    assert "shown" not in capsys.readouterr().out
