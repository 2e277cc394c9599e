"""Every docstring example runs, and every public name exists."""

import doctest
import importlib
import pkgutil

import pytest

import pinbound

MODULES = sorted(
    module.name for module in pkgutil.walk_packages(pinbound.__path__, "pinbound.") if "__main__" not in module.name
)


@pytest.mark.parametrize("name", ["pinbound", *MODULES])
def test_examples_in_docstrings_run(name: str) -> None:
    result = doctest.testmod(importlib.import_module(name), optionflags=doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS)
    assert result.failed == 0


@pytest.mark.parametrize("name", ["pinbound", *MODULES])
def test_all_resolves(name: str) -> None:
    module = importlib.import_module(name)
    public = getattr(module, "__all__", [])
    assert len(set(public)) == len(public)
    assert [entry for entry in public if not hasattr(module, entry)] == []
