"""Every docstring example runs, and every public name exists."""

import doctest
import importlib
import inspect
import pkgutil
from collections.abc import Iterator
from functools import cached_property
from types import ModuleType

import pytest

import pinbound

MODULES = sorted(
    module.name for module in pkgutil.walk_packages(pinbound.__path__, "pinbound.") if "__main__" not in module.name
)


@pytest.mark.parametrize("name", ["pinbound", *MODULES])
def test_examples_in_docstrings_run(name: str) -> None:
    module = importlib.import_module(name)
    flags = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS
    assert doctest.testmod(module, optionflags=flags).failed == 0
    runner = doctest.DocTestRunner(optionflags=flags)
    for test in lazy_examples(module):
        assert runner.run(test).failed == 0


def lazy_examples(module: ModuleType) -> Iterator[doctest.DocTest]:
    """Yield the examples of cached properties, which doctest's own search passes over."""
    for cls in vars(module).values():
        if inspect.isclass(cls) and cls.__module__ == module.__name__:
            for name, attribute in vars(cls).items():
                if isinstance(attribute, cached_property):
                    place = f"{module.__name__}.{cls.__name__}.{name}"
                    yield from doctest.DocTestFinder().find(attribute.func, place, module, vars(module))


@pytest.mark.parametrize("name", ["pinbound", *MODULES])
def test_all_resolves(name: str) -> None:
    module = importlib.import_module(name)
    public = getattr(module, "__all__", [])
    assert len(set(public)) == len(public)
    assert [entry for entry in public if not hasattr(module, entry)] == []
