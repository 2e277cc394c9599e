"""Tables in narrow terminals, and how commands end that are stopped."""

import re
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console
from typer.testing import CliRunner

from pinbound.cli import app, inspect, shared, tables
from pinbound.cli.shared import guarded


def test_widths_keep_every_word_and_fit() -> None:
    rng, seen = np.random.default_rng(5), set()
    for _ in range(300):
        count = int(rng.integers(1, 6))
        rows = [
            tuple(" ".join("x" * int(n) for n in rng.integers(1, 12, rng.integers(0, 5))) for _ in range(count))
            for _ in range(int(rng.integers(1, 5)))
        ]
        width = int(rng.integers(10, 120))
        found = tables.fitting_widths(rows, width)
        least = [
            max((len(word) for text in column for word in text.split()), default=0)
            for column in zip(*rows, strict=True)
        ]
        assert (found is None) == (sum(least) + 3 * count + 1 > width)
        seen.add(found is None)
        if found is not None:
            assert sum(found) + 3 * count + 1 <= width
            assert all(one >= word for one, word in zip(found, least, strict=True))
            longest = [max(map(len, column)) for column in zip(*rows, strict=True)]
            assert found == longest or sum(found) + 3 * count + 1 == width
    assert seen == {True, False}


@pytest.mark.parametrize("width", [40, 60, 80, 140])
def test_no_number_and_no_name_is_cut(width: int, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Whatever the width: every word of a wide terminal is printed whole, and no line is longer than the terminal."""

    def printed(columns: int, command: list[str]) -> str:
        path = tmp_path / "screen.txt"
        with path.open("w", encoding="utf-8") as file:
            made = Console(file=file, force_terminal=True, width=columns, color_system=None, markup=False)
            monkeypatch.setattr(shared, "console", lambda stderr=False: made)
            monkeypatch.setattr(inspect, "console", lambda stderr=False: made)
            assert CliRunner().invoke(app, command).exit_code == 0
        return re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", path.read_text(encoding="utf-8"))

    for command in (["limits", "minervabot_v3", "--at", "q2=30,q3=20", "--deg"], ["region", "minervabot_v3"]):
        full, narrow = printed(400, command), printed(width, command)
        kept = [line for line in narrow.split("\n") if re.search("[━│┃]|^  ", line)]
        assert max(map(len, kept)) <= width
        words = {word for line in full.split("\n") if line.startswith("│") for word in line.replace("│", " ").split()}
        assert len(words) > 10
        assert words <= set(narrow.replace("│", " ").replace(";", " ").split())


def test_ctrl_c_says_how_to_go_on(capsys: pytest.CaptureFixture[str]) -> None:
    import typer

    def command() -> None:
        raise KeyboardInterrupt

    with pytest.raises(typer.Exit) as found:
        guarded(command)()
    assert found.value.exit_code == 130  # 1 would say that a check found a violation
    assert "Run the same command again" in capsys.readouterr().err


THREE = """<robot name="three"><link name="base"/><link name="a"/><link name="b"/><link name="c"/>
  <joint name="q1" type="{0}"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/>{1}</joint>
  <joint name="q2" type="{0}"><parent link="a"/><child link="b"/><origin xyz="0.4 0 0.1"/><axis xyz="0 1 0"/>{1}</joint>
  <joint name="q3" type="{0}"><parent link="b"/><child link="c"/><origin xyz="0.5 0 0"/><axis xyz="0 1 0"/>{1}</joint>
  <pinbound:annotations xmlns:pinbound="urn:pinbound:1">
    <pinbound:point name="tip" link="c" xyz="0.3 0 0" radius="0.05"/>
    <pinbound:point name="post" link="base" xyz="0.7 0.7 0.1" radius="0.1"/>
    <pinbound:boundary name="beta" a="tip" b="post"/></pinbound:annotations></robot>"""


def test_a_region_of_three_joints_says_the_options_to_type(tmp_path: Path) -> None:
    path = tmp_path / "three.urdf"
    path.write_text(THREE.format("continuous", ""))
    asked = CliRunner().invoke(app, ["region", str(path)])
    assert "add --coordinates NAME,NAME with two names out of: q1, q2, q3" in asked.output
    asked = CliRunner().invoke(app, ["region", str(path), "--coordinates", "q1,q2"])
    assert "add --window NAME=LOWER..UPPER" in asked.output
    window = ["--window", "q1=-0.6..0.6,q2=-0.6..0.6"]
    assert CliRunner().invoke(app, ["region", str(path), "--coordinates", "q1,q2", *window]).exit_code == 0


@pytest.mark.parametrize("option", ["--within", "--grid"])
def test_a_box_in_degrees_is_hinted_at(option: str, tmp_path: Path) -> None:
    box = {"--within": ["--random", "3", "--within", "q2=-30:40"], "--grid": ["--grid", "q2=-30:40:3"]}[option]
    command = ["batch", "minervabot_v3", *box, "--out"]
    plain = CliRunner().invoke(app, [*command, str(tmp_path / "a")])
    assert f"note: {option}: these numbers look like degrees" in plain.output
    asked = CliRunner().invoke(app, [*command, str(tmp_path / "b"), "--deg"])
    assert "look like degrees" not in asked.output
    assert (plain.exit_code, asked.exit_code) == (0, 0)
