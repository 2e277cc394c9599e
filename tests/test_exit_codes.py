"""Exit codes: 0 holds, 1 a check found a violation, 2 bad input, 3 the machine or the cluster failed."""

import re
import subprocess
import sys
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

import pinbound
from pinbound.cli import app
from pinbound.robot import presets

HERE = Path(__file__).resolve().parents[1]
ARM = """<robot name="arm" xmlns:pinbound="urn:pinbound:1">
  <link name="base"><collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>
  <link name="upper"/>
  <link name="lower"><collision><origin xyz="0.3 0 0"/><geometry><sphere radius="0.02"/></geometry></collision></link>
  <joint name="a" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
  <joint name="b" type="revolute"><parent link="upper"/><child link="lower"/><origin xyz="0.3 0 0"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
  <pinbound:annotations><pinbound:point name="p" link="base" xyz="0.5 0 0.2" radius="0.01"/>
    <pinbound:point name="s" link="lower" xyz="0.3 0 0"/>
    <pinbound:boundary name="c" a="p" b="s"/></pinbound:annotations>
</robot>"""
MESHES = ARM.replace('<sphere radius="0.02"/>', '<mesh filename="hand.stl"/>')
BARE = ARM[: ARM.index("  <pinbound:annotations")] + "</robot>"


def out_of(text: str) -> Callable[[Any], Any]:
    def refuse(*_: object, **__: object) -> None:
        raise OSError(*{"disk": (28, "No space left on device"), "read": (5, "Input/output error")}[text])

    return refuse


# command, exit code, words; ARM, MESHES and BARE stand for robots, HERE for the folder
CASES: list[tuple[str, int, str]] = [
    ("info", 0, "info ARM"),
    ("info", 2, "info HERE/none.urdf"),
    ("derive", 0, "derive ARM"),
    ("derive", 2, "derive ARM --annotations HERE/none.yaml"),
    ("limits", 0, "limits ARM --at a=0.1"),
    ("limits", 1, "limits ARM --at a=2"),
    ("limits", 2, "limits ARM --at a=far"),
    ("region", 0, "region ARM"),
    ("region", 1, "region ARM --require-coverage"),
    ("region", 2, "region ARM --window a=1"),
    ("batch", 0, "batch ARM --random 5 --out HERE/o"),
    ("batch", 1, "batch ARM --random 5 --out HERE/o --require-coverage"),
    ("batch", 2, "batch ARM --out HERE/o"),
    ("batch", 2, "batch ARM --in HERE/rowless.csv --out HERE/o"),
    ("batch", 2, "batch ARM --random 0 --out HERE/o"),
    ("check", 2, "check ARM HERE/rowless.csv"),
    ("check", 0, "check ARM HERE/clear.csv"),
    ("check", 1, "check ARM HERE/beyond.csv"),
    ("check", 1, "check ARM HERE/clear.csv --require-coverage"),
    ("check", 2, "check ARM HERE/wrong.csv"),
    ("check", 2, "check BARE HERE/clear.csv"),
    ("mark", 0, "mark ARM --out HERE/m.yaml"),
    ("mark", 1, "mark MESHES --skip-missing"),
    ("mark", 2, "mark MESHES"),
    ("mark", 2, "mark ARM --out HERE/arm.urdf"),
    ("crosscheck", 0, "crosscheck ARM --levels points --samples 5"),
    ("crosscheck", 1, "crosscheck ARM --levels points --samples 5 --require-coverage"),
    ("crosscheck", 2, "crosscheck BARE --samples 5"),
    ("export", 0, "export ARM c --out HERE/arm.c"),
    ("export", 2, "export ARM fortran --out HERE/arm.f"),
    ("explore", 0, "explore ARM --out HERE/page.html"),
    ("explore", 1, "explore ARM --out HERE/page.html --require-coverage"),
    ("explore", 2, "explore ARM --out HERE/page.html --plane a,c"),
    ("view", 2, "view ARM --at a=far"),
    ("plan", 0, "plan ARM --goal b=0.3 --start a=-0.2 --out HERE/way.csv"),
    ("plan", 1, "plan ARM --goal b=0.3 --require-coverage"),
    ("plan", 1, "plan ARM --goal a=-0.4,b=0.0 --start a=-0.4,b=5"),
    ("plan", 2, "plan ARM --goal b=far"),
    ("plan", 2, "plan BARE --goal b=0.3"),
    ("robots", 0, "robots"),
    ("new", 0, "new palletizer --out HERE/start"),
    ("new", 2, "new crane --out HERE/start"),
    ("report", 0, "report ARM --out HERE/page"),
    ("report", 1, "report ARM --out HERE/page --require-coverage"),
    ("report", 2, "report HERE/none.urdf --out HERE/page"),
    ("reproduce", 2, "reproduce --robot HERE/none.urdf --out HERE/page"),
]
ELSEWHERE = {
    ("reproduce", 0): "tests/test_reproduce.py draws the paper",
    ("view", 0): "tests/test_live.py ends it by Ctrl-C",
}
NEVER = {
    ("info", 1),
    ("derive", 1),
    ("export", 1),
    ("reproduce", 1),
    ("view", 1),
    ("robots", 1),
    ("robots", 2),
    ("new", 1),
}
COMMANDS = sorted({command for command, _, _ in CASES})


def run(words: str, folder: Path) -> tuple[int, str]:
    for name, text in (("ARM", ARM), ("MESHES", MESHES), ("BARE", BARE)):
        (folder / f"{name.lower()}.urdf").write_text(text)
    (folder / "clear.csv").write_text("a,b\n0,0\n0.1,0.1\n")
    (folder / "beyond.csv").write_text("a,b\n0,0\n0,2\n")
    (folder / "wrong.csv").write_text("a,b\n0,far\n")
    (folder / "rowless.csv").write_text("a,b\n")
    robots = {name: str(folder / f"{name.lower()}.urdf") for name in ("ARM", "MESHES", "BARE")}
    line = [robots.get(word, word.replace("HERE", str(folder))) for word in words.split()]
    result = CliRunner().invoke(app, line)
    assert result.exception is None or isinstance(result.exception, SystemExit), result.output
    return result.exit_code, result.output


@pytest.mark.parametrize(("command", "code", "words"), CASES, ids=[f"{words}: {code}" for _, code, words in CASES])
def test_exit_code(command: str, code: int, words: str, tmp_path: Path) -> None:
    found, said = run(words, tmp_path)
    assert found == code, said
    if code == 2:
        assert said.count("pinbound: ") == 1
        assert "Traceback" not in said


@pytest.mark.parametrize("command", COMMANDS)
def test_a_disk_that_fails_is_no_fault_of_the_input(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    words = {"reproduce": "reproduce --robot ARM --out HERE/page", "batch": "batch ARM --random 5 --out HERE/o"}
    words |= {"check": "check ARM HERE/clear.csv", "report": "report ARM --out HERE/page"}
    words |= {"export": "export ARM json --out HERE/arm.json", "robots": "robots", "new": "new palletizer --out HERE/n"}
    words |= {"plan": "plan ARM --goal b=0.3"}
    run("info ARM", tmp_path)  # its imports read files, too
    presets.models.cache_clear()
    line = words.get(command, f"{command} ARM").replace("ARM", str(tmp_path / "arm.urdf"))
    for reads in ("read_bytes", "read_text", "write_text") if command in ("robots", "new") else ("read_bytes",):
        monkeypatch.setattr(Path, reads, out_of("read"))
    result = CliRunner().invoke(app, line.replace("HERE", str(tmp_path)).split())
    assert result.exit_code == 3, result.output
    assert ("reading failed: " if command not in ("robots", "new") else "") + "Input/output error" in result.output


@pytest.mark.parametrize(
    "words", ["mark ARM --out HERE/m.yaml", "export ARM c --out HERE/a.c", "report ARM --out HERE/page"]
)
def test_a_full_disk_exits_with_3(words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run("info ARM", tmp_path)
    monkeypatch.setattr(Path, "write_text", out_of("disk"))
    line = words.replace("ARM", str(tmp_path / "arm.urdf")).replace("HERE", str(tmp_path))
    result = CliRunner().invoke(app, line.split())
    assert result.exit_code == 3, result.output
    assert "No space left on device" in result.output


def test_the_page_lists_every_command_and_code() -> None:
    """The table of docs/reading.md is what is tested here."""
    registered = sorted(one.callback.__name__ for one in app.registered_commands if one.callback)
    assert registered == COMMANDS
    page = (HERE / "docs" / "reading.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(\w+)` \|(.*)\|(.*)\|(.*)\|(.*)\|$", page, flags=re.MULTILINE)
    told = {(name, code) for name, *cells in rows for code, cell in enumerate(cells) if cell.strip() not in ("", "-")}
    tested = {(command, code) for command, code, _ in CASES} | set(ELSEWHERE) | {(name, 3) for name in COMMANDS}
    assert told == tested
    assert not told & NEVER


@pytest.mark.parametrize(("q3", "code"), [("0.1", 0), ("1.5", 1)])
def test_a_reader_that_stops_reading_changes_no_exit_code(q3: str, code: int, tmp_path: Path) -> None:
    (tmp_path / "m.csv").write_text(f"q1,q2,q3\n0,0,0\n0,0,{q3}\n")
    words = ("from pinbound.cli import main; main()", "check", "minervabot_v3", str(tmp_path / "m.csv"))
    process = subprocess.Popen(
        (sys.executable, "-c", *words), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stderr is not None
    process.stdout.close()
    said = process.stderr.read()
    process.stderr.close()
    assert (process.wait(timeout=60), said) == (code, "")


def test_version_and_short_help() -> None:
    found = CliRunner().invoke(app, ["--version"])
    assert (found.exit_code, found.stdout.split()) == (0, ["pinbound", pinbound.__version__])
    assert version("pinbound") == pinbound.__version__
    for words in (["-h"], ["check", "-h"]):
        assert CliRunner().invoke(app, words).exit_code == 0
