"""Reads a URDF or xacro file safely: entities are refused, the default namespace is dropped."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from lxml import etree

from pinbound.model.expansion import expand_xacro
from pinbound.model.xml_text import local_name, parse_bytes, parse_file, parse_floats, refusal, xml_parser

__all__ = [
    "TRUST",
    "URDF_TEXT",
    "Document",
    "local_name",
    "packaged_robots",
    "parse_file",
    "parse_floats",
    "read_document",
    "refusal",
]

URDF_TEXT = "URDF text"
"""The name, in messages, of a robot that was given as text."""

_DECLARATION = re.compile(r"^\s*<\?xml[^>]*\?>")

TRUST = ("xacro", "urdf-only")
"""The file types that may be read: xacro, too, which can run code, or plain URDF only."""


@dataclass(frozen=True, slots=True)
class Document:
    """A URDF as XML, with xacro expanded and entities refused.

    Attributes:
        label: The name of the file in error messages.
        path: The path of the file.
        root: The `<robot>` element.
        notes: Sentences about what was normalised while reading.
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
        ['minervabot_v3', 'palletizer']
    """
    here = Path(__file__).resolve()
    folders = (here.parents[1] / "robots", here.parents[3] / "urdf")
    suffix = ".urdf.xacro"
    return {
        file.name.removesuffix(suffix): file
        for folder in folders
        if folder.is_dir()
        for file in sorted(folder.glob("*" + suffix))
    }


def read_document(
    robot: str | Path,
    xacro_args: Mapping[str, str] | None = None,
    package_dirs: Sequence[str | Path] = (),
    trust: str = "xacro",
) -> Document:
    """Read a packaged robot, a `.urdf`, a `.xacro`, or the text of a URDF; no entity is resolved.

    Args:
        robot: A name of `packaged_robots`, or a path, or the text of a URDF, which begins with `<`.
        xacro_args: Arguments of the xacro file; each must be declared in it, or in an included file.
        package_dirs: Folders of ROS packages, for `$(find name)`.
        trust: `"xacro"`, or `"urdf-only"`, which refuses all xacro files except those that ship with pinbound.

    Returns:
        The document, with xacro expanded.

    Raises:
        InputError: If the file does not exist, is not well-formed XML, or is refused by xacro.
    """
    if trust not in TRUST:
        raise refusal("trust", f"{trust!r} is not a valid value of trust", f"Valid: {', '.join(TRUST)}")
    if isinstance(robot, str) and robot.lstrip().startswith("<"):
        return _from_text(robot, xacro_args)
    path = _locate(robot)
    if path.suffix.lower() == ".xacro":
        if trust == "urdf-only" and path not in packaged_robots().values():
            remedy = "Expand it yourself in a safe place, or trust it: trust='xacro', --trust xacro"
            raise refusal(path.name, "is a xacro file, which can run code, and trust is 'urdf-only'", remedy)
        parse_file(path)  # faults of the file itself are reported with its own lines
        ours = next(
            iter(packaged_robots().values())
        ).parent  # the meaning of $(find pinbound), unless another one is given
        expanded = expand_xacro(path, xacro_args or {}, [*map(str, package_dirs), str(ours)])
        label = f"{path.name} (as printed by xacro)"
        root = parse_bytes(expanded.text.encode(), label)
        return _without_default_namespace(Document(label, path, root, expanded.notes))
    root = parse_file(path)
    if xacro_args:
        raise refusal(path.name, f"xacro_args {sorted(xacro_args)} given for a plain URDF", "leave them out")
    return _without_default_namespace(Document(path.name, path, root))


def _from_text(text: str, xacro_args: Mapping[str, str] | None) -> Document:
    """Read the text of a URDF; files that it names are searched from the working folder."""
    if xacro_args:
        raise refusal(URDF_TEXT, f"xacro_args {sorted(xacro_args)} given for the text of a URDF", "leave them out")
    # A text is already decoded: the encoding in its declaration is that of a file.
    root = parse_bytes(_DECLARATION.sub("", text, count=1).encode(), URDF_TEXT)
    return _without_default_namespace(Document(URDF_TEXT, Path.cwd() / URDF_TEXT, root))


def _locate(robot: str | Path) -> Path:
    packaged = packaged_robots()
    if isinstance(robot, str) and robot in packaged:
        return packaged[robot]
    path = Path(robot)
    if path.is_file():
        return path
    what = "is a folder, not a file" if path.is_dir() else "is neither a file nor a packaged robot"
    raise refusal(str(robot), what, f"Give the path of a .urdf or .xacro file, or one of: {', '.join(packaged)}")


def _without_default_namespace(document: Document) -> Document:
    """Remove a default `xmlns` of the root: URDF readers ignore it, but for an XML reader it hides all elements.

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
