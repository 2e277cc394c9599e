"""docs/from-a-datasheet.md as a newcomer follows it: its blocks one after the other, in an empty folder."""

import doctest
import re
import shlex
from pathlib import Path

import pytest
from typer.testing import CliRunner

from pinbound.cli import app

PAGE = Path(__file__).resolve().parents[1] / "docs" / "from-a-datasheet.md"
BLOCKS: list[tuple[str, str, str]] = re.findall(
    r'```(\w+)(?: title="(.+?)")?\n(.*?)```', PAGE.read_text(encoding="utf-8"), re.DOTALL
)


def test_a_newcomer_gets_to_a_certified_cycle(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    said: list[str] = []
    for language, name, text in BLOCKS:
        if name:
            Path(name).write_text(text)
        elif language == "python":
            test = doctest.DocTestParser().get_doctest(text, {}, "page", str(PAGE), 0)
            assert doctest.DocTestRunner().run(test).failed == 0
        else:
            for line in text.splitlines():
                command, _, code = line.partition("# exit code ")
                done = CliRunner().invoke(app, shlex.split(command)[1:], env={"COLUMNS": "200"})
                assert done.exit_code == int(code or 0), done.output
                said.append(" ".join(done.output.split()))
    new, info, region, before, after = said
    assert "Next: pinbound info mine/my_palletizer.urdf.xacro" in new
    assert "-70 deg <= J2 + J3 <= 75 deg" in info
    assert "4 boundaries" in info
    corner = next(line for line in PAGE.read_text().splitlines() if line.startswith("| `flange_floor`"))
    numbers = re.findall(r"-?\d+\.\d+", corner)
    assert " │ ".join(["│ flange_floor", *numbers]) in re.sub(r" +", " ", region)
    assert "VIOLATED" in before
    assert "│ flange_floor │ 4.967" in before
    assert "│ flange_floor │ violated │ -29.95" in before
    assert "CERTIFIED" in after
    assert "│ flange_floor │ certified │ 18.81" in after
    for one in (before, after):
        assert "coverage: watches 1 of 1 pair of links" in one
        assert "assumption: the widths of forearm, column and flange are measured on a drawing" in one


def test_without_widths_the_answer_names_the_file_to_mark(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The robot's own name is no name of a file: `pinbound mark NAME` would not find it."""
    monkeypatch.chdir(tmp_path)
    texts = {name: text for _, name, text in BLOCKS if name}
    text = re.sub(r"forearm_width=.*?/>", "/>", texts["mine/my_palletizer.urdf.xacro"])
    Path("mine.urdf.xacro").write_text(text)
    Path("motion.csv").write_text(texts["motion.csv"])
    done = CliRunner().invoke(app, ["check", "mine.urdf.xacro", "motion.csv", "--deg"])
    assert done.exit_code == 2
    assert "pinbound mark mine.urdf.xacro --out" in done.output
