"""The house: a room imports only from floors below it; heavy libraries load when first needed."""

import ast
import graphlib
import re
import subprocess
import sys
from pathlib import Path

import pytest

import pinbound

PACKAGE = Path(pinbound.__file__).parent
FLOORS = [
    ("deprecation", "exceptions", "tolerances", "typing"),
    ("checks", "drawing", "extras", "units", "values"),
    ("geometry", "machine", "tables"),
    ("model",),
    ("meshes",),
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
    ("explorer",),
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


def full_name(path: Path) -> str:
    parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def loaded(tree: ast.AST) -> list[str]:
    """Return what a module imports when it loads or when it runs: all but what only a type checker reads."""
    if isinstance(tree, ast.If) and "TYPE_CHECKING" in ast.unparse(tree.test):
        return [name for node in tree.orelse for name in loaded(node)]
    if isinstance(tree, ast.Import):
        return [alias.name for alias in tree.names]
    if isinstance(tree, ast.ImportFrom):
        return [f"{tree.module}.{alias.name}" for alias in tree.names]
    return [name for node in ast.iter_child_nodes(tree) for name in loaded(node)]


def import_graph(trees: dict[str, ast.AST], rooms: set[str]) -> dict[str, set[str]]:
    """Return which modules each module imports; what a room passes on is imported from where it is defined."""
    passed_on = {
        f"{room}.{alias.asname or alias.name}": f"{node.module}.{alias.name}"
        for room in rooms
        for node in ast.walk(trees[room])
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }

    def defined(name: str) -> str:
        while name in passed_on and name not in trees:
            name = passed_on[name]
        return name if name in trees else name.rpartition(".")[0]

    return {
        module: {found for name in loaded(tree) if (found := defined(name)) in trees and found != module}
        for module, tree in trees.items()
        if module not in rooms
    }


def test_no_module_imports_itself_through_others() -> None:
    """Imports inside functions count: they happen, too. A room's `__init__`, which only passes names on, does not."""
    trees: dict[str, ast.AST] = {full_name(path): ast.parse(path.read_text()) for path in FILES}
    rooms = {full_name(path) for path in FILES if path.name == "__init__.py"}
    for name in rooms - {"pinbound"}:
        body = [node for node in ast.walk(trees[name]) if isinstance(node, ast.stmt)]
        assert all(isinstance(node, ast.ImportFrom | ast.Expr | ast.Assign) for node in body), f"{name} has code"
    graphlib.TopologicalSorter(import_graph(trees, rooms)).prepare()


@pytest.mark.parametrize(
    ("b", "is_circle"),
    [
        ("from room.a import f", True),
        ("def g():\n    from room.a import f", True),
        ("from room import f", True),
        ("if TYPE_CHECKING:\n    from room.a import f", False),
        ("from room.c import f", False),
    ],
)
def test_circles_are_seen(b: str, is_circle: bool) -> None:
    texts = {"room": "from room.a import f", "room.a": "from room.b import g", "room.b": b, "room.c": ""}
    graph = graphlib.TopologicalSorter(import_graph({name: ast.parse(text) for name, text in texts.items()}, {"room"}))
    if not is_circle:
        return graph.prepare()
    with pytest.raises(graphlib.CycleError):
        graph.prepare()


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


CASE = {"across", "case", "form", "is_plain", "is_signed", "is_solid", "measure", "normal", "projection"}
ASKED = {
    "boundaries/boundary.py": 1,
    "bounds/bodies.py": 10,
    "certificates/kept.py": 2,
    "cli/derive.py": 1,
    "contact/rule.py": 2,
    "coverage/reach.py": 1,
    "crosscheck/contacts.py": 1,
    "evaluate/depth.py": 2,
    "evaluate/separation.py": 4,
    "evaluate/symbolic.py": 3,
    "evaluate/touching.py": 1,
    "export/chains.py": 2,
    "kernel/hulls.py": 2,
    "kernel/mixed.py": 1,
    "kernel/program.py": 3,
    "limits/isolated.py": 1,
    "limits/outwards.py": 1,
    "limits/prismatic.py": 1,
    "limits/univariate.py": 1,
    "loops/closures.py": 1,
    "region/margins.py": 1,
    "region/outlines.py": 3,
    "region/sliding.py": 1,
}
"""How often each module asks a path which case it is. It may become less: then lower the number."""


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_which_case_a_path_is_is_asked_in_few_places(path: Path) -> None:
    """`path` decides once which case a pair is; an interpreter should ask once, and hand on what it found."""
    here = path.relative_to(PACKAGE)
    if room(here.parts) not in ("annotations", "path"):
        asked = [node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Attribute)]
        found = sum(node.attr in CASE and ast.unparse(node.value).split(".")[-1] == "path" for node in asked)
        assert found <= ASKED.get(here.as_posix(), 0), "use `path.counted`, `left_of`, `is_harmonic`, or ask once"


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_modules_stay_readable(path: Path) -> None:
    assert len(path.read_text().splitlines()) <= 450


HERE = Path(__file__).parents[1]
NAMED = sorted([*FILES, *HERE.glob("docs/*.md")])


@pytest.mark.parametrize("path", NAMED, ids=lambda path: path.name)
def test_modules_are_where_texts_say_they_are(path: Path) -> None:
    stems = {module.stem for module in FILES}
    for named in re.findall(r"`((?:[a-z_0-9]+/)+[a-z_0-9]+(?:\.py)?)`", path.read_text()):
        place = Path(named).with_suffix(".py")
        if place.stem in stems or place.name == Path(named).name:
            assert (PACKAGE / place).exists() or (HERE / place).exists(), f"there is no {place}"


def test_import_is_light() -> None:
    heavy = ("coal", "matplotlib", "numba", "pinocchio", "scipy", "sympy", "trimesh", "yourdfpy", "rich", "typer")
    code = f"import sys, pinbound; print([name for name in {heavy!r} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
