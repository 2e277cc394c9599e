"""Reads (with line numbers) and writes annotations in a YAML file beside the URDF."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any, cast

import yaml

from pinbound.annotations.records import RawItem
from pinbound.exceptions import MachineError, Problems, blames_the_path, name_hint

__all__ = ["read_node", "read_sidecar", "sidecar_items", "sidecar_text"]

_LISTS = {
    "points": "point",
    "segments": "segment",
    "sweeps": "sweep",
    "hulls": "hull",
    "boxes": "box",
    "cylinders": "cylinder",
    "lines": "line",
    "planes": "plane",
    "boundaries": "boundary",
    "closures": "closure",
    "followers": "follower",
    "limits": "limit",
    "rules": "rule",
    "axes": "axis",
    "left_out": "left_out",
    "assumptions": "assumption",
}


def read_sidecar(path: Path, problems: Problems) -> list[RawItem]:
    """Return the raw items of a YAML sidecar; anchors, duplicate keys and unknown keys are faults."""
    node = read_node(path, problems)
    return [] if node is None else sidecar_items(node, path, problems)


def read_node(path: Path, problems: Problems) -> yaml.Node | None:
    """Return the document of a YAML file, with its lines; None if it is empty, or a fault: aliases and tags are."""
    source = path.name
    try:
        text = path.read_text(encoding="utf-8")
        loader = _quickest(text)
        if _refuse_structure(text, loader, source, problems):
            return None
        node = yaml.compose(text, Loader=loader)
    except OSError as error:
        if not blames_the_path(error):
            raise MachineError(f"{path}: reading failed: {error.strerror}; try again once it can be read") from error
        problems.add(f"cannot be read ({error.strerror})", "Check the path and its permissions", source=str(path))
        return None
    except (yaml.YAMLError, UnicodeDecodeError, RecursionError) as error:
        mark = getattr(error, "problem_mark", None)
        reason = getattr(error, "problem", None) or str(error) or type(error).__name__
        line = mark.line + 1 if mark else None
        problems.add(f"is not YAML: {reason}", "Correct the YAML", line, source)
        return None
    if node is not None:
        _refuse_tags(node, source, problems)
    return node


def sidecar_items(node: yaml.Node, path: Path, problems: Problems) -> list[RawItem]:
    """Return the raw items of a sidecar's document; duplicate keys and unknown keys are faults."""
    return _Sidecar(path.name, problems, str(path.parent)).items(node)


_MOST_NESTED = 32
_OCTAL = re.compile("[-+]?0[0-7]+")
_TAGS = tuple(
    f"tag:yaml.org,2002:{kind}" for kind in ("str", "int", "float", "bool", "null", "seq", "map", "timestamp")
)


def _quickest(text: str) -> Any:
    """Return libyaml's reader, which is ten times faster, if PyYAML has it and it can read the text.

    PyYAML's own reader reports the faults, so that messages are the same everywhere.
    """
    quick = getattr(yaml, "CSafeLoader", None)
    if quick is None or not text.isascii() or "\t" in text:  # here the two readers allow different texts
        return yaml.SafeLoader
    try:
        for _ in yaml.parse(text, Loader=quick):
            pass
    except yaml.YAMLError:
        return yaml.SafeLoader
    return quick


def _refuse_structure(text: str, loader: Any, source: str, problems: Problems) -> bool:
    """Refuse aliases and deep nesting while events are read, before anything is built; return whether one was found."""
    depth = 0
    for event in yaml.parse(text, Loader=loader):
        line = event.start_mark.line + 1 if event.start_mark else None
        if isinstance(event, yaml.AliasEvent):
            problems.add("uses a YAML alias (*name)", "Write the values out", line, source)
            return True
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if depth > _MOST_NESTED:
            remedy = "A sidecar holds lists of mappings of numbers and names"
            problems.add(f"nests deeper than {_MOST_NESTED} levels", remedy, line, source)
            return True
    return False


def _refuse_tags(node: yaml.Node, source: str, problems: Problems) -> None:
    """Refuse tags: `!degrees -90` is not a number here, and must not be read as one."""
    if node.tag not in _TAGS:
        problems.add(
            f"holds the tag {node.tag!r}", "Write plain numbers in metres and radians", _node_line(node), source
        )
    if isinstance(node, yaml.SequenceNode):
        for entry in node.value:
            _refuse_tags(entry, source, problems)
    if isinstance(node, yaml.MappingNode):
        for key, value in node.value:
            _refuse_tags(key, source, problems)
            _refuse_tags(value, source, problems)


class _Sidecar:
    """Converts YAML nodes, which have line numbers, to raw items."""

    def __init__(self, source: str, problems: Problems, folder: str) -> None:
        self.source, self.problems, self.folder = source, problems, folder

    def items(self, node: yaml.Node) -> list[RawItem]:
        items: list[RawItem] = []
        valid = ["contact_tolerance", "home", *_LISTS]
        for key, value in self._mapping(node, "the sidecar").items():
            line = _node_line(value)
            if key == "contact_tolerance":
                items.append(RawItem("settings", {key: self._plain(value)}, self.source, line))
            elif key == "home":
                fields = {name: self._plain(angle) for name, angle in self._mapping(value, "home").items()}
                items.append(RawItem("home", fields, self.source, line))
            elif key in _LISTS:
                items += self._list(key, value)
            else:
                hint = name_hint(key, valid)
                self.problems.add(f"{key!r} is not a key of a sidecar", hint, line, self.source)
        return items

    def _list(self, key: str, node: yaml.Node) -> list[RawItem]:
        if not isinstance(node, yaml.SequenceNode):
            self.problems.add(f"{key!r} is not a list", "Write [ ... ]", _node_line(node), self.source)
            return []
        items: list[RawItem] = []
        for entry in node.value:
            if key == "assumptions":
                fields: dict[str, Any] = {"text": self._plain(entry)}
            else:
                fields = {name: self._field(name, value) for name, value in self._mapping(entry, key).items()}
            items.append(RawItem(_LISTS[key], fields, self.source, _node_line(entry), self.folder))
        return items

    def _mapping(self, node: yaml.Node, what: str) -> dict[str, yaml.Node]:
        if not isinstance(node, yaml.MappingNode):
            self.problems.add(
                f"an entry of {what} is not a mapping", "Write {key: value}", _node_line(node), self.source
            )
            return {}
        found: dict[str, yaml.Node] = {}
        for key, value in node.value:
            name = str(key.value)
            if name in found:
                self.problems.add(f"{name!r} is given twice in {what}", "Keep one", _node_line(key), self.source)
            found[name] = value
        return found

    def _field(self, name: str, node: yaml.Node) -> Any:
        """Return a field as text, a list of names as a tuple (names may contain spaces), rules as `RawItem` says."""
        if name in ("passive", "active") and isinstance(node, yaml.SequenceNode):
            return tuple(self._plain(entry) for entry in node.value)
        if name == "coefficients":
            return tuple((key, self._plain(value)) for key, value in self._mapping(node, name).items())
        if name == "where" and not isinstance(node, yaml.SequenceNode):
            self.problems.add("'where' is not a list", "Write [{...}]", _node_line(node), self.source)
            return ()
        if name == "where":
            return tuple(
                {key: self._field(key, value) for key, value in self._mapping(entry, name).items()}
                for entry in node.value
            )
        return self._plain(node, rows=name in ("vertices", "ways"))

    def _plain(self, node: yaml.Node, rows: bool = False) -> str:
        """Return the node as the text of an XML attribute: a scalar, or a list of scalars joined by spaces.

        With `rows` a list may also hold lists of three scalars, each one vector.
        """
        if isinstance(node, yaml.ScalarNode):
            self._refuse_octal(node)
            return str(node.value)
        entries: list[yaml.Node] = node.value if isinstance(node, yaml.SequenceNode) else [node]
        for entry in entries:
            if isinstance(entry, yaml.ScalarNode):
                continue
            if not rows or not isinstance(entry, yaml.SequenceNode):
                kind = "list" if isinstance(entry, yaml.SequenceNode) else "mapping"
                remedy = "Write a number, a name, or one list of numbers"
                self.problems.add(f"holds a {kind} where a value belongs", remedy, _node_line(entry), self.source)
                return ""
            if len(entry.value) != 3:
                said = f"a vector has {len(entry.value)} numbers"
                self.problems.add(said, "Give three numbers for each", _node_line(entry), self.source)
                return ""
        return " ".join(self._plain(entry) for entry in entries)

    def _refuse_octal(self, node: yaml.ScalarNode) -> None:
        """Refuse 010, which is 8 in YAML 1.1 and 10 in YAML 1.2, unless it is quoted, which makes it a text."""
        text = str(node.value)
        if not node.style and _OCTAL.fullmatch(text) and int(text, 8) != int(text):
            both = f"{int(text, 8)} in YAML 1.1 and {int(text)} in YAML 1.2"
            remedy = f"Write {int(text)} or {int(text, 8)}, without the zero in front; put a name in quotes"
            self.problems.add(f"{text} is {both}", remedy, _node_line(node), self.source)


def _node_line(node: yaml.Node) -> int:
    return node.start_mark.line + 1


def sidecar_text(items: Iterable[RawItem]) -> str:
    """Return the YAML of a sidecar with the items."""
    data: dict[str, Any] = {}
    lists = {kind: key for key, kind in _LISTS.items()}
    for item in items:
        fields = {key: _value(key, text) for key, text in item.fields.items()}
        if item.kind == "settings":
            data |= fields
        elif item.kind == "home":
            data["home"] = {name: float(text) for name, text in item.fields.items()}
        else:
            data.setdefault(lists[item.kind], []).append(item.fields["text"] if item.kind == "assumption" else fields)
    return cast(Any, yaml).safe_dump(data, sort_keys=False, default_flow_style=None, width=150, allow_unicode=True)


def _value(key: str, given: Any) -> Any:
    if key == "coefficients":
        return {name: float(text) for name, text in given}
    if key == "where":
        return [{name: _value(name, field) for name, field in entry.items()} for entry in given]
    if isinstance(given, tuple):
        return list(cast(tuple[str, ...], given))
    text = str(given)
    if key.startswith("xyz") or key in ("direction", "normal", "rpy", "size"):
        return [float(word) for word in text.split()]
    if key in ("ways", "vertices"):
        numbers = [float(word) for word in text.split()]
        return [numbers[start : start + 3] for start in range(0, len(numbers), 3)]
    if key in ("stop", "weld"):
        return text == "true"
    return float(text) if key in _NUMBERS else text


_NUMBERS = ("contact_tolerance", "radius", "min_distance", "tolerance", "multiplier", "offset", "lower", "upper")
