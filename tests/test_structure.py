"""The house: a room imports only from floors below it; heavy libraries load when first needed."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import pinbound

PACKAGE = Path(pinbound.__file__).parent
FLOORS = [
    ("exceptions", "tolerances", "typing"),
    ("units", "values"),
    ("geometry", "machine", "tables"),
    ("model",),
    ("annotations",),
    ("path",),
    ("evaluate",),
    ("bounds", "kernel"),
    ("limits",),
    ("contact",),
    ("export", "loops"),
    ("boundaries",),
    ("coverage",),
    ("robot",),
    ("certificates",),
    ("marking", "region"),
    ("adapters", "batch", "freespace", "motion"),
    ("figures",),
    ("crosscheck",),
    ("reproduce",),
    ("cli",),
    ("__init__", "__main__"),
]
LEVEL = {room: level for level, rooms in enumerate(FLOORS) for room in rooms}
ONLY = {
    "pinocchio": {"model", "robot", "crosscheck"},
    "coal": {"crosscheck"},
}
FILES = sorted(PACKAGE.rglob("*.py"))


def imports(path: Path) -> list[str]:
    names: list[str] = []
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path.name}: import by full name"
            names += [node.module or "", *(f"{node.module}.{alias.name}" for alias in node.names)]
    return names


def room(parts: tuple[str, ...]) -> str:
    return parts[0].removesuffix(".py")


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_a_room_imports_only_from_floors_below(path: Path) -> None:
    here = room(path.relative_to(PACKAGE).parts)
    assert here in LEVEL, f"name the floor of {here!r} in this test and in docs/structure.md"
    for name in imports(path):
        if not name.startswith("pinbound.") or name.split(".")[1] not in LEVEL:
            continue
        there = name.split(".")[1]
        assert there == here or LEVEL[there] < LEVEL[here], f"{here} imports {there}"


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_only_some_rooms_talk_to_engines(path: Path) -> None:
    for library, allowed in ONLY.items():
        if any(name == library or name.startswith(library + ".") for name in imports(path)):
            assert room(path.relative_to(PACKAGE).parts) in allowed


def asked_classes(tree: ast.AST) -> set[str]:
    """Return which marks' classes a module asks for: by isinstance, by type(...), by a case, or by a table of them."""
    marks = {"Point", "Segment", "Sweep", "Hull", "Box", "Cylinder", "Line", "Plane", "FlatMark", "KINDS"}
    known = {
        alias.asname or alias.name: alias.name
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("pinbound.annotations")
        for alias in node.names
        if alias.name in marks
    }
    asking: list[ast.AST] = []
    for node in ast.walk(tree):
        if (
            isinstance(node, ast.Call)
            and isinstance(node.func, ast.Name)
            and node.func.id in ("isinstance", "issubclass")
        ):
            asking += node.args[1:]
        elif isinstance(node, ast.Compare) or (isinstance(node, ast.Dict) and node.keys):
            asking.append(node)
        elif isinstance(node, ast.MatchClass):
            asking.append(node.cls)
    names = {inner.id for node in asking for inner in ast.walk(node) if isinstance(inner, ast.Name)}
    return {known[name] for name in names & set(known)} | ({"KINDS"} & set(known.values()))


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_only_the_door_asks_for_the_class_of_a_mark(path: Path) -> None:
    """Behind `annotations` and `path` a mark is its shape: a new kind of mark touches no other room."""
    if room(path.relative_to(PACKAGE).parts) not in ("annotations", "path", "__init__"):
        assert asked_classes(ast.parse(path.read_text())) == set()


def test_questions_for_a_class_are_seen() -> None:
    head = "from pinbound.annotations import Line as L, Point, Segment\n"
    for text in ("isinstance(x, L)", "isinstance(x, int | Point)", "type(x) is Segment", "{Point: 1}[type(x)]"):
        assert asked_classes(ast.parse(head + text))
    assert asked_classes(ast.parse(head + "match x:\n    case L(): pass"))
    assert not asked_classes(ast.parse(head + "Point('p', 'link', (0, 0, 0)); x.shape.is_point"))


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_modules_stay_readable(path: Path) -> None:
    assert len(path.read_text().splitlines()) <= 450


def test_import_is_light() -> None:
    heavy = ("coal", "matplotlib", "numba", "pinocchio", "scipy", "sympy", "trimesh", "yourdfpy", "rich", "typer")
    code = f"import sys, pinbound; print([name for name in {heavy!r} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
