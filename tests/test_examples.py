"""Every example runs, and prints what its head says."""

import re
import runpy
import shutil
from pathlib import Path

import pytest

EXAMPLES = sorted((Path(__file__).parents[1] / "examples").glob("*.py"))
NEEDS = {"pink": "pin-pink", "mink": "mink", "casadi": "casadi", "pandas": "pandas"}


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_prints_what_its_head_says(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = path.read_text()
    head = text.split('"""')[1]
    assert f"`python examples/{path.name}`" in head
    wanted = [line.removeprefix("    ") for line in head.split("Prints:\n")[1].rstrip().splitlines()]
    for module, package in NEEDS.items():
        if re.search(rf"^(import|from) {module}\b", text, re.MULTILINE):
            pytest.importorskip(module, reason=f"{package} is not installed: pip install 'pinbound[test]'")
    if "Needs gcc" in head and shutil.which("gcc") is None:
        pytest.skip("gcc is not installed")
    runpy.run_path(str(path), run_name="__main__")
    assert capsys.readouterr().out.splitlines() == wanted


def test_there_are_examples() -> None:
    assert [path.stem[:2] for path in EXAMPLES[:9]] == [f"{number:02}" for number in range(1, 10)]
