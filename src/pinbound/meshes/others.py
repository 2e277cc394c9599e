"""Formats that trimesh reads (extra `meshes`): PLY, OFF, glTF in one file, and the zipped 3MF and ZAE."""

from __future__ import annotations

import io
import lzma
import re
import struct
import warnings
import zipfile
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pinbound.extras import Needs
from pinbound.meshes.mesh import MOST_BYTES, refuse, too_many

__all__ = ["OTHERS", "read_other"]

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

OTHERS = (".ply", ".off", ".glb", ".3mf", ".zae")
"""The endings of the names of these files."""
_ZIPPED = (".3mf", ".zae")
_COUNTED = re.compile(rb"element\s+(vertex|face|tristrips)\s+(\d+)")
_FAULTS = (
    ArithmeticError,
    AssertionError,
    AttributeError,
    EOFError,
    LookupError,
    MemoryError,
    OSError,
    RuntimeError,
    SyntaxError,
    TypeError,
    ValueError,
    NameError,
    struct.error,
    lzma.LZMAError,
    zipfile.BadZipFile,
    zlib.error,
)
"""The errors that a reader without checks of its input may raise for damaged bytes."""
_TO_ASCII = bytes([*range(128), *b"?" * 128])
_MEND = "Export the mesh again"


def read_other(data: bytes, suffix: str, source: str) -> tuple[Array, Ints]:
    """Return vertices and triangles of all meshes of a file, placed as its scene says.

    Raises:
        InputError: If the file is damaged, or if its unpacked content is too large.
    """
    if suffix in _ZIPPED:
        _look_into(data, source)
    faces = _COUNT[suffix](data, source) if suffix in _COUNT else 0
    with Needs("meshes", "a mesh of this format"):
        import trimesh

    loader: Any = trimesh
    try:
        with warnings.catch_warnings(), Needs("meshes", f"a mesh in {suffix[1:].upper()}"):
            warnings.simplefilter("ignore")  # warnings about numbers out of range: the numbers are checked later
            scene = loader.load_scene(io.BytesIO(_ascii_text(data, suffix)), file_type=suffix[1:], process=False)
            mesh = scene.to_mesh()
        vertices, triangles = np.array(mesh.vertices, dtype=np.float64), np.array(mesh.faces, dtype=np.int64)
    except _FAULTS as error:
        said = " ".join(str(error).split())[:80] or type(error).__name__
        refuse(source, f"is no {suffix[1:].upper()} file that can be read ({said})", _MEND)
    except ModuleNotFoundError:  # trimesh guesses the encoding of such text with a library that need not be installed
        refuse(source, f"is no {suffix[1:].upper()} file that can be read (its text is not UTF-8)", _MEND)
    if len(triangles) < faces:
        refuse(source, f"is cut off: it has {len(triangles)} triangles of {faces} polygons", _MEND)
    return vertices.reshape(-1, 3), triangles.reshape(-1, 3)


def _ascii_text(data: bytes, suffix: str) -> bytes:
    """Return the file with comments in ASCII: trimesh expects UTF-8, but comments may have any encoding."""
    if suffix == ".off":
        return data.translate(_TO_ASCII)
    head, mark, body = data.partition(b"end_header")
    return head.translate(_TO_ASCII) + mark + body if suffix == ".ply" else data


def _ply_faces(data: bytes, source: str) -> int:
    """Return the number of polygons in a PLY file's header; refuse a file with missing lines, which trimesh accepts."""
    head, mark, body = data.partition(b"end_header")
    counts = {kind: int(count[:12]) for kind, count in _COUNTED.findall(head)}
    for kind, count in counts.items():
        too_many(source, count // (3 if kind == b"vertex" else 1))
    lines = sum(bool(line.strip()) for line in body.splitlines()) if b"format ascii" in head else 0
    if not mark or (lines and lines != sum(counts.values())):
        refuse(source, f"is cut off: it has {lines} lines behind its head, not {sum(counts.values())}", _MEND)
    return counts.get(b"face", 0)


def _off_faces(data: bytes, source: str) -> int:
    """Return the number of polygons in an OFF file's header; refuse a file with missing lines."""
    lines = [line for line in (one.partition(b"#")[0].split() for one in data.splitlines()) if line]
    words = lines[0][1:] if lines and len(lines[0]) > 1 else lines[1] if len(lines) > 1 else []
    if len(words) < 2 or not all(word.isdigit() for word in words[:2]):
        refuse(source, "is not an OFF file: it does not say how many vertices and polygons it has", _MEND)
    vertices, faces = (int(word[:12]) for word in words[:2])
    too_many(source, max(vertices // 3, faces))
    head = 1 if len(lines[0]) > 1 else 2
    if len(lines) != head + vertices + faces:
        refuse(source, f"is cut off: it has {len(lines) - head} lines of numbers, not {vertices + faces}", _MEND)
    for line in lines[head + vertices :]:
        if not line[0].isdigit() or len(line) <= int(line[0][:12]):
            said = line[0].decode("ascii", "replace")[:20]
            refuse(source, f"is cut off: a polygon has {len(line) - 1} corners, not {said}", _MEND)
    return faces


def _glb_faces(data: bytes, source: str) -> int:
    if data[:4] != b"glTF" or int.from_bytes(data[8:12], "little") != len(data):
        refuse(source, "is not a GLB file, or its length differs from the length in its header", _MEND)
    return 0


def _look_into(data: bytes, source: str) -> None:
    """Refuse a damaged archive, and one whose unpacked size, as stated in its directory, is too large."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            size = sum(entry.file_size for entry in archive.infolist())
    except _FAULTS as error:
        refuse(source, f"is no archive ({error})", _MEND)
    if size > MOST_BYTES:
        large = f"unpacks to {size / 2**20:.0f} MiB; up to {MOST_BYTES / 2**20:.0f} MiB are read"
        refuse(source, large, "Give a simpler mesh: collision bodies need some thousand triangles")


_COUNT = {".ply": _ply_faces, ".off": _off_faces, ".glb": _glb_faces}
"""The check of a file before trimesh reads it, by the ending of the file's name."""
