"""The README as a new user reads it: examples print what it shows, commands run as they stand."""

import doctest
import re
import shlex
import shutil
from importlib.metadata import distribution
from pathlib import Path

import pytest
from typer.testing import CliRunner

from pinbound.cli import app

README = Path(__file__).resolve().parents[1] / "README.md"
TEXT = README.read_text(encoding="utf-8")
SHELL = [line for block in re.findall(r"```sh\n(.*?)```", TEXT, re.DOTALL) for line in block.strip().splitlines()]


def test_python_examples_print_what_is_shown() -> None:
    result = doctest.testfile(str(README), module_relative=False, optionflags=doctest.NORMALIZE_WHITESPACE)
    assert result.attempted > 10
    assert result.failed == 0


MESHED = [line for line in SHELL if line.startswith("pinbound ") and "$PANDA" in line]


@pytest.mark.parametrize("command", [line for line in SHELL if line.startswith("pinbound ") and line not in MESHED])
def test_commands_run_as_they_stand(command: str) -> None:
    result = CliRunner().invoke(app, shlex.split(command)[1:])
    assert result.exit_code == 0, result.output


def test_a_urdf_with_meshes_is_certified_in_three_commands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    share = str(distribution("example-robot-data").locate_file("cmeel.prefix/share"))
    assert "cmeel.prefix/share" in next(line for line in SHELL if line.startswith("export ROS_PACKAGE_PATH="))
    panda = next(line for line in SHELL if line.startswith("export PANDA=")).removeprefix("export PANDA=")
    monkeypatch.setenv("ROS_PACKAGE_PATH", share)
    shutil.copytree(README.parent / "examples", tmp_path / "examples")
    monkeypatch.chdir(tmp_path)
    said: list[str] = []
    for command in MESHED:
        words = shlex.split(command.replace("$PANDA", panda.replace("$ROS_PACKAGE_PATH", share)))
        result = CliRunner().invoke(app, words[1:])
        assert result.exit_code == 0, result.output
        said.append(" ".join(result.stdout.split()))
    assert "9 meshes: 2300 of 2300 triangles are proven to lie in the marks" in said[0]
    assert "CERTIFIED" in said[1]
    assert "watches 41 of 55 pairs of links" in said[1]
    assert "bodies holds" in said[2]


def test_the_set_up_commands_are_the_promised_ones() -> None:
    assert "pip install '.[all]' && pinbound report minervabot_v3 --out report" in SHELL
    assert "pip install '.[test]' && pytest" in SHELL


def test_the_region_table_is_what_the_command_prints() -> None:
    shown = re.search(r"```text\n(.*?)```", TEXT, re.DOTALL)
    assert shown is not None
    printed = CliRunner().invoke(app, ["region", "minervabot_v3"]).stdout
    rows = [line.split() for line in shown.group(1).splitlines()[2:]]
    assert len(rows) == 6
    for row in rows:
        assert re.search(r"\s*│\s*".join(map(re.escape, row)), printed), row


def test_every_page_that_is_linked_exists() -> None:
    links = re.findall(r"\]\(((?!https?:)[^)#]+)\)", TEXT)
    assert links
    assert [link for link in links if not (README.parent / link).exists()] == []
