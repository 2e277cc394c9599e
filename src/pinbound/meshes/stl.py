"""STL: binary (a header of 84 bytes, then 50 bytes for each triangle) or text."""

from __future__ import annotations

import re
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from pinbound.meshes.mesh import refuse, too_many

__all__ = ["read_stl", "stl_triangles"]

Array = NDArray[np.float64]

_HEAD, _EACH = 84, 50
_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_N = rb"([-+.\w]+)"
_FACET = re.compile(
    rb"\s*facet(?:\s+normal(?:[ \t]+[^\s]+)*)?\s+outer\s+loop"
    + 3 * (rb"\s+vertex\s+" + rb"\s+".join([_N] * 3))
    + rb"\s+endloop\s+endfacet\b",
    re.IGNORECASE,
)
_BETWEEN = re.compile(rb"\s*(?:solid\b[^\r\n]*|endsolid\b[^\r\n]*)", re.IGNORECASE)
_MEND = "Export the mesh again"


def stl_triangles(head: bytes, size: int) -> int | None:
    """Return the number of triangles in a binary file of `size` bytes that starts with `head`; None if it is text."""
    if size < _HEAD or len(head) < _HEAD:
        return None
    count = int.from_bytes(head[80:84], "little")
    if size == _HEAD + _EACH * count:
        return count
    return None if head.lstrip()[:5].lower() == b"solid" and b"\0" not in head else count


def read_stl(data: bytes, source: str) -> tuple[Array, NDArray[np.int64]]:
    """Return vertices and triangles; equal vertices are merged.

    Raises:
        InputError: If a byte is missing or too much, or if a part of a text is not a facet.
    """
    count = stl_triangles(data[:_HEAD], len(data))
    if count is None:
        corners = _of_text(data, source)
    else:
        too_many(source, count)
        wanted = _HEAD + _EACH * count
        if len(data) != wanted:
            said = f"says that it has {count} triangles, which take {wanted} bytes, and has {len(data)} bytes"
            refuse(source, said, "Export the mesh again")
        with np.errstate(invalid="ignore"):  # values that are not numbers are refused later, by name
            corners = np.frombuffer(data, dtype=_RECORD, offset=_HEAD)["corners"].reshape(-1, 3).astype(np.float64)
    vertices, rows = np.unique(corners, axis=0, return_inverse=True)
    return vertices, rows.reshape(-1, 3)


def _of_text(data: bytes, source: str) -> Array:
    found: list[tuple[bytes, ...]] = []
    place, last, is_closed = 0, len(data.rstrip()), True
    while place < last:
        match = _FACET.match(data, place)
        if match is not None:
            found.append(match.groups())
            too_many(source, len(found))
            is_closed = False
        else:
            match = _BETWEEN.match(data, place)
            is_closed = is_closed or (match is not None and match.group().lstrip()[:3].lower() == b"end")
        if match is None:
            _stray(data, place, source)
        place = match.end()
    if not is_closed:
        refuse(source, "is cut off: no 'endsolid' stands behind its last facet", _MEND)
    words = [word for triangle in found for word in triangle]
    if any(b"_" in word for word in words):
        refuse(source, "a vertex holds something that is not a number", _MEND)
    try:
        return np.array([float(word) for word in words]).reshape(-1, 3)
    except ValueError as error:
        line = next(
            (number for number, row in enumerate(data.split(b"\n"), 1) if b"vertex" in row and not _is_vertex(row)),
            None,
        )
        refuse(source, f"a vertex holds something that is not a number ({error})", _MEND, line)


def _is_vertex(row: bytes) -> bool:
    try:
        return len([float(word) for word in row.split()[1:]]) > 0
    except ValueError:
        return False


def _stray(data: bytes, place: int, source: str) -> NoReturn:
    place += len(data[place:]) - len(data[place:].lstrip())
    said = data[place : place + 40].split(b"\n")[0].decode("ascii", "replace").strip()
    line = data.count(b"\n", 0, place) + 1
    if place == 0:
        refuse(
            source,
            "is not an STL file: it does not start with 'solid', and its size differs from the size in its header",
            _MEND,
        )
    refuse(source, f"expected a facet of three vertices, or 'endsolid', found {said!r}", _MEND, line)
