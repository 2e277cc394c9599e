"""The worked example of the docs runs, with the output that it prints."""

import doctest
from pathlib import Path

import pytest


def test_example_runs_as_printed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = Path(__file__).parents[1] / "docs" / "example-pick-and-place.md"
    monkeypatch.chdir(tmp_path)
    result = doctest.testfile(str(page), module_relative=False, optionflags=doctest.NORMALIZE_WHITESPACE)
    assert result.attempted > 20
    assert result.failed == 0
    assert {path.name for path in tmp_path.glob("*.svg")} == {"pick-and-place-violated.svg", "pick-and-place-plane.svg"}
