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


@pytest.mark.parametrize("option", ["--within", "--grid"])
def test_a_box_in_degrees_is_hinted_at(option: str, tmp_path: Path) -> None:
    box = {"--within": ["--random", "3", "--within", "q2=-30:40"], "--grid": ["--grid", "q2=-30:40:3"]}[option]
    command = ["batch", "minervabot_v3", *box, "--out"]
    plain = CliRunner().invoke(app, [*command, str(tmp_path / "a")])
    assert f"note: {option}: these numbers look like degrees" in plain.output
    asked = CliRunner().invoke(app, [*command, str(tmp_path / "b"), "--deg"])
    assert "look like degrees" not in asked.output
    assert (plain.exit_code, asked.exit_code) == (0, 0)
