"""The quick tier: every room is in it, and everything that it names is there."""

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

import pinbound
import tiers

HERE = Path(__file__).parent
ROOMS = {path.parent.name for path in Path(pinbound.__file__).parent.glob("*/__init__.py")}


def functions(file: str) -> set[str]:
    tree = ast.parse((HERE / f"{file}.py").read_text(encoding="utf-8"))
    found = {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}
    return {name for name in found if name.startswith("test_")}


def test_every_room_is_in_the_quick_tier() -> None:
    assert set(tiers.QUICK) == ROOMS | {""}


@pytest.mark.parametrize("room", sorted(tiers.QUICK))
def test_a_room_names_tests_that_exist_and_some_are_quick(room: str) -> None:
    for name in tiers.QUICK[room]:
        file, _, function = name.partition("::")
        assert not function or function in functions(file), name
        assert any(tiers.is_quick(file, one) for one in functions(file)), name


def test_what_is_slow_exists_and_is_in_a_quick_file() -> None:
    named = {name for names in tiers.QUICK.values() for name in names}
    assert set(tiers.SLOW) <= named
    for file, slow in tiers.SLOW.items():
        assert set(slow) <= functions(file), file


def test_pytest_runs_what_the_list_says() -> None:
    """A file that is quick but for some tests, and one that is slow as a whole."""
    command = [sys.executable, "-m", "pytest", "--collect-only", "-q", "-p", "no:cacheprovider", "-m", "not slow"]
    asked = [*command, "test_laws.py", "test_region_window.py"]
    said = subprocess.run(asked, cwd=HERE, capture_output=True, text=True, check=True, env=dict(os.environ)).stdout
    found = {line.partition("::")[::2] for line in said.splitlines() if "::" in line}
    ran = {(Path(file).stem, function.partition("[")[0]) for file, function in found}
    assert ran == {("test_laws", name) for name in functions("test_laws") - {"test_symbolic_equals_numeric"}}
