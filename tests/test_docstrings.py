"""Every public name says what it is: shapes, units, errors, and an example, by rules that a test can ask for."""

import ast
import dataclasses
import enum
import inspect
import re
import textwrap
from collections.abc import Iterator
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import pytest

import pinbound

HERE = Path(__file__).resolve().parents[1]
HEADS = ("Args", "Attributes", "Returns", "Raises", "References", "Example", "Yields")
SAID = r"\[[^]]+\]|\((?:\d|[a-z]|N)[^)]*\)|in \(0, 1\]"  # a unit in brackets, a shape in parentheses, or a share
MEASURED = r"\b(?:float|Array)\b"
ALONE = {"line", "home_line"}  # where in a file it was written: no entry of its own


def members(cls: type) -> Iterator[tuple[str, Any, str]]:
    """Yield name, function and kind of the public methods and properties that pinbound wrote."""
    for name in dir(cls):  # inspect.getmembers_static is younger than Python 3.10
        value = inspect.getattr_static(cls, name)
        owner = next((base for base in cls.__mro__ if name in vars(base)), None)
        if name.startswith("_") or owner is None or not owner.__module__.startswith("pinbound"):
            continue
        if isinstance(value, classmethod | staticmethod):
            yield name, value.__func__, "method"
        elif isinstance(value, property):
            yield name, value.fget, "property"
        elif isinstance(value, cached_property):
            yield name, value.func, "property"
        elif inspect.isfunction(value):
            yield name, value, "method"


def everything() -> Iterator[tuple[str, Any, str]]:
    for name in pinbound.__all__:
        found = getattr(pinbound, name)
        yield name, found, "class" if inspect.isclass(found) else "function"
        if inspect.isclass(found):
            yield from ((f"{name}.{inner}", value, kind) for inner, value, kind in members(found))


NAMES = list(everything())
IDS = [name for name, _, _ in NAMES]


def text_of(found: Any) -> str:
    return inspect.cleandoc(found.__doc__ or "")


def section(text: str, head: str) -> str:
    """Return a section of a docstring, or an empty text."""
    match = re.search(rf"^{head}:\n((?:[ ].*\n?|\n)+)", text + "\n", re.MULTILINE)
    return textwrap.dedent(match.group(1)) if match else ""


def entries(text: str) -> dict[str, str]:
    """Return what a section says of each name."""
    found = re.split(r"^(\w+):", text, flags=re.MULTILINE)
    return dict(zip(found[1::2], found[2::2], strict=True))


def faults(name: str, found: Any, kind: str) -> Iterator[str]:
    text = text_of(found)
    if not text:
        yield "has no docstring"
        return
    if not text.split("\n\n")[0].rstrip().endswith((".", ":")):
        yield "its first sentence has no end"
    if kind in ("class", "function") and ">>>" not in text:
        yield "has no example"
    if kind == "class":
        yield from of_a_class(found, text)
        return
    if kind != "property":
        yield from of_a_function(found, text, is_public=kind == "function")
    returned = str(inspect.signature(found).return_annotation)
    if re.search(MEASURED, returned) and not re.search(SAID, text):
        yield f"returns {returned} without a unit [m] or a shape (n,)"


def of_a_class(found: Any, text: str) -> Iterator[str]:
    if issubclass(found, enum.Enum):
        yield from (f"does not name {one.name}" for one in found if not re.search(rf"\b{one.name}\b", text))
    told = dict[str, str]()
    for base in reversed(found.__mro__):
        told |= entries(section(text_of(base), "Attributes"))
    for field in dataclasses.fields(found) if dataclasses.is_dataclass(found) else ():
        if field.name.startswith("_") or field.name in ALONE:
            continue
        if field.name not in told:
            yield f"does not say what {field.name} is"
        elif re.search(MEASURED, str(field.type)) and not re.search(SAID, told[field.name]):
            yield f"says neither unit nor shape of {field.name}"


def of_a_function(found: Any, text: str, is_public: bool) -> Iterator[str]:
    parameters = [name for name in inspect.signature(found).parameters if name not in ("self", "cls")]
    told = entries(section(text, "Args"))
    if re.search(r"Arguments\s+and\s+errors\s+are\s+those\s+of\s+`\w+`", text):
        return
    if told or is_public:
        yield from (f"does not say what {name} is" for name in parameters if name not in told)
        yield from (f"speaks of {name}, which it does not take" for name in told if name not in parameters)
    else:
        missing = [name for name in parameters if not re.search(rf"\b{name}\b", text)]
        yield from (f"does not say what {name} is" for name in missing if not (len(parameters) == 1 or name in "qQ"))
    if raises(found) and not section(text, "Raises"):
        yield "raises, and does not say what"


def raises(found: Any) -> bool:
    """Return whether it raises one of pinbound's own errors by itself."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(found)))
    return any(
        isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call) and ast.unparse(node.exc.func).endswith("Error")
        for node in ast.walk(tree)
    )


@pytest.mark.parametrize(("name", "found", "kind"), NAMES, ids=IDS)
def test_a_public_name_says_what_it_is(name: str, found: Any, kind: str) -> None:
    assert list(faults(name, found, kind)) == [], name


@cache
def shown() -> str:
    """Return the code of all examples that the tests run: of docstrings, README, tutorials, how-to pages."""
    files = [*(HERE / "src" / "pinbound").rglob("*.py"), HERE / "README.md"]
    files += [*(HERE / "docs").rglob("*.md")]
    lines = (line for file in files for line in file.read_text(encoding="utf-8").splitlines())
    return "\n".join(line for line in lines if line.lstrip().startswith((">>>", "...")))


METHODS = [name for name, _, kind in NAMES if kind == "method"]


@pytest.mark.parametrize("name", METHODS)
def test_a_public_method_has_an_example(name: str) -> None:
    assert re.search(rf"\.{name.split('.')[1]}\b", shown()), name


def test_the_rules_find_faults() -> None:
    """The check itself would see what is missing."""

    def poor(first: Any, second: float) -> float:
        """Return something."""
        if second:
            raise pinbound.DimensionError("no")
        return first

    @dataclasses.dataclass
    class Poor:
        """A record.

        Attributes:
            told: A number.
        """

        told: float
        left: int

    assert list(faults("poor", poor, "function")) == [
        "has no example",
        "does not say what first is",
        "does not say what second is",
        "raises, and does not say what",
        "returns <class 'float'> without a unit [m] or a shape (n,)",
    ]
    assert list(faults("Poor", Poor, "class")) == [
        "has no example",
        "says neither unit nor shape of told",
        "does not say what left is",
    ]
    assert "has no docstring" in list(faults("none", lambda: None, "function"))
