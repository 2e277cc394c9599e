"""XML and numbers from text: read safely, without entities, with one message for text that cannot be read."""

from __future__ import annotations

import math
import re
from pathlib import Path
from xml.parsers.expat import ExpatError, ParserCreate

from lxml import etree

from pinbound.exceptions import InputError, MachineError, Problem, blames_the_path

__all__ = ["local_name", "parse_bytes", "parse_file", "parse_floats", "refusal", "xml_parser"]


def refusal(source: str, message: str, remedy: str, line: int | None = None) -> InputError:
    """Return the error of a file with one fault."""
    return InputError([Problem(message, remedy, source, line)])


def xml_parser() -> etree.XMLParser:
    """Return a parser that resolves no entities, opens no other files, and drops comments and instructions."""
    return etree.XMLParser(
        resolve_entities=False, no_network=True, load_dtd=False, remove_comments=True, remove_pis=True
    )


def parse_file(path: Path) -> etree._Element:
    """Return the root of an XML file; entities are refused.

    Raises:
        InputError: If it cannot be read, is not well-formed, or has a DOCTYPE.
        MachineError: If the disk fails.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        if not blames_the_path(error):
            raise MachineError(f"{path}: reading failed: {error.strerror}; try again once it can be read") from error
        raise refusal(str(path), f"cannot be read ({error.strerror})", "Check the path and its permissions") from error
    return parse_bytes(data, path.name)


def parse_bytes(data: bytes, label: str) -> etree._Element:
    """Return the root of XML text; entities are refused.

    Raises:
        InputError: If it is not well-formed, has a DOCTYPE, has an encoding that XML readers read differently, or
            contains a name that they read differently.
    """
    if b"<!DOCTYPE" in data or b"\0" in data:  # zero bytes: UTF-16 or UTF-32, in which `<!DOCTYPE` has other bytes
        _refuse_doctype(data, label)
    try:
        root = etree.fromstring(data, xml_parser())
    except etree.XMLSyntaxError as error:
        line = error.lineno if error.lineno else None
        message = f"is not well-formed XML: {error.msg}"
        remedy = (
            "Correct the XML; every element must be closed, every prefix declared, its encoding be the declared one"
        )
        raise refusal(label, message, remedy, line) from error
    except (ValueError, LookupError) as error:
        raise refusal(label, f"cannot be read as XML: {error}", "Save it as UTF-8") from error
    facts = root.getroottree().docinfo
    if facts.doctype or facts.internalDTD is not None:  # in an encoding that expat does not know
        raise refusal(label, "has a DOCTYPE", _NO_DOCTYPE)
    if _BROKEN_NAME.search(data):
        _refuse_broken_names(data, label)
    encoding = (facts.encoding or "utf-8").lower()
    if not encoding.startswith(_ENCODINGS):
        raise refusal(label, f"is written in the encoding {facts.encoding!r}", "Save it as UTF-8", 1)
    return root


_ENCODINGS = ("utf-8", "utf8", "utf-16", "utf-32", "ucs-", "us-ascii", "ascii", "iso-8859-", "windows-125", "latin")
"""Encodings that every XML reader decodes in the same way; in others `\\`, `~` and stray bytes depend on the reader."""

_NO_DOCTYPE = "Remove it: pinbound resolves no entities, neither internal nor external ones"


class _DoctypeError(Exception):
    """The file has a document type declaration."""


def _refuse_doctype(data: bytes, label: str) -> None:
    """Refuse a DOCTYPE before a reader could expand an entity that it declares."""

    def found(*_: object) -> None:
        raise _DoctypeError

    parser = ParserCreate()
    parser.StartDoctypeDeclHandler = found
    try:
        parser.Parse(data, True)
    except _DoctypeError:
        raise refusal(label, "has a DOCTYPE", _NO_DOCTYPE, parser.CurrentLineNumber) from None
    except (ExpatError, ValueError, LookupError):
        return  # an encoding that expat does not know, or not XML: lxml reports the fault


_BROKEN_NAME = re.compile(rb"""\s(?:name|link[12]?|joint)\s*=\s*(?:"[^"<]*[\t\r\n]|'[^'<]*[\t\r\n])""")
"""A name with a tab or a line break: XML turns it into a space, Pinocchio's reader keeps it, so the names differ."""


def _refuse_broken_names(data: bytes, label: str) -> None:
    """Refuse such a name, unless it is in a comment."""
    bare = re.sub(rb"<!--.*?-->", lambda found: b"\n" * found.group().count(b"\n"), data, flags=re.DOTALL)
    if found := _BROKEN_NAME.search(bare):
        line = bare.count(b"\n", 0, found.start() + 1) + 1
        message = "a name holds a tab or a line break, which some readers turn into a space and some keep"
        raise refusal(label, message, "Write the name on one line, with spaces", line)


def local_name(element: etree._Element) -> str:
    """Return an element's name without its namespace."""
    return etree.QName(element).localname


def parse_floats(text: str, count: int) -> tuple[float, ...] | str:
    """Return `count` finite numbers, or a text that says what is wrong.

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
        numbers = tuple(map(float, words))
    except ValueError:
        return f"{text!r} is not {'a number' if count == 1 else f'{count} numbers'}"
    if len(numbers) != count:
        return f"{text!r} holds {len(numbers)} numbers, not {count}"
    if not all(map(math.isfinite, numbers)):
        return f"{text!r} holds a number that is not finite"
    return numbers
