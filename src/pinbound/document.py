"""XML in: a URDF or xacro file read safely, entities refused, default namespace dropped."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast
from xml.parsers.expat import ExpatError

from lxml import etree

from pinbound.exceptions import name_hint
from pinbound.xml_text import local_name, parse_bytes, parse_file, parse_floats, refusal, xml_parser

__all__ = [
    "Document",
    "local_name",
    "packaged_robots",
    "parse_file",
    "parse_floats",
    "read_document",
    "refusal",
]


@dataclass(frozen=True, slots=True)
class Document:
    """A URDF as XML, xacro expanded, entities refused.

    Attributes:
        label: The file as error messages name it.
        path: Where it was read from.
        root: The `<robot>` element.
        notes: What was normalised while reading.
    """

    label: str
    path: Path
    root: etree._Element
    notes: tuple[str, ...] = ()

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the XML as text, so that robots can be sent to other processes."""
        return _restore, (self.label, self.path, etree.tostring(self.root), self.notes)


def _restore(label: str, path: Path, text: bytes, notes: tuple[str, ...]) -> Document:
    return Document(label, path, etree.fromstring(text, xml_parser()), notes)


def packaged_robots() -> dict[str, Path]:
    """Return the robots that ship with pinbound, by name.

    Example:
        >>> sorted(packaged_robots())
        ['minervabot_v3']
    """
    here = Path(__file__).resolve()
    folders = (here.parent / "robots", here.parents[2] / "urdf")
    suffix = ".urdf.xacro"
    return {
        file.name.removesuffix(suffix): file
        for folder in folders
        if folder.is_dir()
        for file in sorted(folder.glob("*" + suffix))
    }


def read_document(robot: str | Path, xacro_args: dict[str, str] | None = None) -> Document:
    """Read a packaged robot, a `.urdf` or a `.xacro`, without resolving any entity.

    Args:
        robot: A name of `packaged_robots`, or a path.
        xacro_args: Arguments of the xacro file; each must be declared in it.

    Returns:
        The document, xacro expanded.

    Raises:
        InputError: If there is no such file, or if it is not well-formed XML, or if xacro refuses it.
    """
    path = _locate(robot)
    root = parse_file(path)
    if path.suffix == ".xacro":
        text = _expand(path, dict(xacro_args or {}))
        label = f"{path.name} (as printed by xacro)"
        root = parse_bytes(text.encode(), label)
        return _without_default_namespace(Document(label, path, root))
    if xacro_args:
        raise refusal(path.name, f"xacro_args {sorted(xacro_args)} given for a plain URDF", "leave them out")
    return _without_default_namespace(Document(path.name, path, root))


def _locate(robot: str | Path) -> Path:
    packaged = packaged_robots()
    if isinstance(robot, str) and robot in packaged:
        return packaged[robot]
    path = Path(robot)
    if path.is_file():
        return path
    what = "is a folder, not a file" if path.is_dir() else "is neither a file nor a packaged robot"
    raise refusal(str(robot), what, f"Give the path of a .urdf or .xacro file, or one of: {', '.join(packaged)}")


def _expand(path: Path, xacro_args: dict[str, str]) -> str:
    import xacro

    declared = _declared_arguments(path, set())
    unknown = sorted(set(xacro_args) - declared)
    if unknown:
        hint = name_hint(unknown[0], sorted(declared))
        raise refusal(path.name, f"has no xacro argument {', '.join(map(repr, unknown))}", hint)
    try:
        expanded = cast(Any, xacro).process_file(str(path), mappings={k: str(v) for k, v in xacro_args.items()})
    except (xacro.XacroException, ExpatError, RecursionError) as error:
        reason = str(error).strip() or type(error).__name__
        raise refusal(path.name, f"xacro cannot expand it: {reason}", "Mend the xacro file or its arguments") from error
    return str(expanded.toprettyxml(indent="  "))


def _declared_arguments(path: Path, seen: set[Path]) -> set[str]:
    """Return the `xacro:arg` names of a file and of what it includes; refuse a DOCTYPE in any of them."""
    if path in seen or not path.is_file():
        return set()
    seen.add(path)
    names: set[str] = set()
    for element in parse_file(path).iter("{*}arg", "{*}include"):
        if local_name(element) == "arg":
            names.add(str(element.get("name")))
        else:
            names |= _declared_arguments(path.parent / str(element.get("filename")), seen)
    return names


def _without_default_namespace(document: Document) -> Document:
    """Drop a default `xmlns` of the root: to a URDF reader it means nothing, to an XML reader it hides all.

    Elements of that namespace that are written with a prefix stay in it: a URDF reader sees the prefix.
    """
    root = document.root
    namespace = etree.QName(root).namespace
    if namespace is None or root.prefix is not None:
        return document
    for element in root.iter(f"{{{namespace}}}*"):
        if element.prefix is None:
            element.tag = etree.QName(element).localname
    return replace(document, notes=(*document.notes, f"the default namespace {namespace!r} was dropped"))
