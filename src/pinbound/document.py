"""XML in: a URDF or xacro file read safely, entities refused, default namespace dropped."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast
from xml.parsers.expat import ExpatError, ParserCreate

from lxml import etree

from pinbound.exceptions import InputError, Problem, name_hint

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
    return Document(label, path, etree.fromstring(text, _parser()), notes)


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
        root = _parse_text(text.encode(), label)
        return _without_default_namespace(Document(label, path, root))
    if xacro_args:
        raise refusal(path.name, f"xacro_args {sorted(xacro_args)} given for a plain URDF", "leave them out")
    return _without_default_namespace(Document(path.name, path, root))


def refusal(source: str, message: str, remedy: str, line: int | None = None) -> InputError:
    """Return the error of a file with one fault."""
    return InputError([Problem(message, remedy, source, line)])


def _locate(robot: str | Path) -> Path:
    packaged = packaged_robots()
    if isinstance(robot, str) and robot in packaged:
        return packaged[robot]
    path = Path(robot)
    if path.is_file():
        return path
    what = "is a folder, not a file" if path.is_dir() else "is neither a file nor a packaged robot"
    raise refusal(str(robot), what, f"Give the path of a .urdf or .xacro file, or one of: {', '.join(packaged)}")


def _parser() -> etree.XMLParser:
    return etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False, remove_comments=True)


def parse_file(path: Path) -> etree._Element:
    """Return the root of an XML file, entities refused.

    Raises:
        InputError: If it cannot be read, is not well-formed, or has a DOCTYPE.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise refusal(str(path), f"cannot be read ({error.strerror})", "Check the path and its permissions") from error
    return _parse_text(data, path.name)


def _parse_text(data: bytes, label: str) -> etree._Element:
    _refuse_doctype(data, label)
    try:
        root = etree.fromstring(data, _parser())
    except etree.XMLSyntaxError as error:
        line = error.lineno if error.lineno else None
        message = f"is not well-formed XML: {error.msg}"
        raise refusal(
            label, message, "Mend the XML; every element must be closed, every prefix declared", line
        ) from error
    except ValueError as error:
        raise refusal(label, f"cannot be read as XML: {error}", "Save it as UTF-8") from error
    return root


class _DoctypeError(Exception):
    """A document type declaration was met."""


def _refuse_doctype(data: bytes, label: str) -> None:
    """Refuse a DOCTYPE before any reader could expand an entity that it declares."""

    def found(*_: object) -> None:
        raise _DoctypeError

    parser = ParserCreate()
    parser.StartDoctypeDeclHandler = found
    try:
        parser.Parse(data, True)
    except _DoctypeError:
        remedy = "Remove it: pinbound resolves no entities, neither internal nor external ones"
        raise refusal(label, "has a DOCTYPE", remedy, parser.CurrentLineNumber) from None
    except ExpatError:
        return  # lxml says what is wrong


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
    """Drop a default `xmlns` of the root: to a URDF reader it means nothing, to an XML reader it hides all."""
    root = document.root
    namespace = etree.QName(root).namespace
    if namespace is None:
        return document
    for element in root.iter(f"{{{namespace}}}*"):
        element.tag = etree.QName(element).localname
    note = f"the default namespace {namespace!r} was dropped"
    return Document(document.label, document.path, root, (*document.notes, note))


def local_name(element: etree._Element) -> str:
    """Return an element's name without its namespace."""
    return etree.QName(element).localname


def parse_floats(text: str, count: int) -> tuple[float, ...] | str:
    """Return `count` finite numbers, or what is wrong with the text.

    Example:
        >>> parse_floats("1 2e-3 0", 3)
        (1.0, 0.002, 0.0)
        >>> parse_floats("1 nan 0", 3)
        "'1 nan 0' holds a number that is not finite"
        >>> parse_floats("1 2", 3)
        "'1 2' holds 2 numbers, not 3"
    """
    words = text.split()
    try:
        if not text.isascii() or "_" in text:  # float() would read other scripts' digits, and 1_000
            raise ValueError
        numbers = tuple(float(word) for word in words)
    except ValueError:
        return f"{text!r} is not {'a number' if count == 1 else f'{count} numbers'}"
    if len(numbers) != count:
        return f"{text!r} holds {len(numbers)} numbers, not {count}"
    if not all(math.isfinite(number) for number in numbers):
        return f"{text!r} holds a number that is not finite"
    return numbers
