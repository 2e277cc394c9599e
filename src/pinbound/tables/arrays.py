"""NPY and NPZ, read in blocks and never memory-mapped: a file that shrinks is an error, not the process's end."""

from __future__ import annotations

import lzma
import math
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy

from pinbound.exceptions import InputError, Problem
from pinbound.tables.rules import BLOCK, bad, check_names, pass_on
from pinbound.typing import Array

__all__ = ["DAMAGE", "NpyTable", "NpzTable"]

_ZIPPED = (b"PK\x03\x04", b"PK\x05\x06")
"""The bytes at the beginning of an archive, with entries or without, that NumPy accepts."""

DAMAGE = (
    ValueError,
    EOFError,
    SyntaxError,
    TypeError,
    KeyError,
    OverflowError,
    RecursionError,
    tokenize.TokenError,
    struct.error,
    zipfile.BadZipFile,
    zlib.error,
    lzma.LZMAError,
    RuntimeError,  # zipfile: an encrypted entry
    NotImplementedError,  # zipfile: a compression method that it does not know
)
"""Exceptions of NumPy and zipfile for damaged files and for files of other formats."""

_HEADER = 1 << 16
_CHUNK = 1 << 20


@dataclass(frozen=True)
class Header:
    """The content of an NPY header (shape, order, type), and its length in bytes."""

    shape: tuple[int, ...]
    fortran: bool
    dtype: np.dtype[Any]
    size: int

    @property
    def is_numeric(self) -> bool:
        """Whether the data are real numbers."""
        return self.dtype.kind in "fiu"

    @property
    def bytes(self) -> int:
        """Number of bytes of the data."""
        return math.prod(self.shape) * self.dtype.itemsize


def _header(stream: Any) -> Header:
    version = npy.read_magic(stream)
    readers: dict[tuple[int, int], Callable[..., Any]] = {
        (1, 0): npy.read_array_header_1_0,
        (2, 0): npy.read_array_header_2_0,
    }
    if version not in readers:
        raise ValueError(f"NPY version {version} is not known")
    shape, fortran, dtype = readers[version](stream, max_header_size=_HEADER)
    if any(type(side) is not int or side < 0 for side in shape):  # True is an int for NumPy's own check
        raise ValueError(f"shape {shape}")
    return Header(tuple(shape), bool(fortran), np.dtype(dtype), int(stream.tell()))


@dataclass(frozen=True)
class NpyTable:
    """One array (N, n) of numbers; its rows may be read in any order.

    Attributes:
        path: The file.
        names: The caller's names of its columns.
        header: The header of the file.
    """

    path: Path
    names: tuple[str, ...]
    header: Header

    @classmethod
    def open(cls, path: Path, names: Sequence[str]) -> NpyTable:
        """Read the header.

        Raises:
            InputError: If it is not an array of numbers with one column for each name, or is shorter than its header
                says.
        """
        try:
            with path.open("rb") as stream:
                header = _header(stream)
        except DAMAGE as error:
            raise bad(path, f"it is no NPY file ({error})", "Save it with numpy.save") from error
        if len(header.shape) != 2 or header.shape[1] != len(names) or not header.is_numeric:
            message = f"it holds an array {header.shape} of {header.dtype}"
            raise bad(path, message, f"Give numbers (N, {len(names)}), the columns being: {', '.join(names)}")
        if path.stat().st_size < header.size + header.bytes:
            raise bad(path, "the file ends before its last row", "Copy it again, whole")
        return cls(path, tuple(names), header)

    def count(self, columns: Sequence[str]) -> int:
        """Return the number of rows."""
        return self.header.shape[0]

    def blocks(self, columns: Sequence[str]) -> Iterator[Array]:
        """Yield all rows in blocks."""
        places = [self.names.index(name) for name in columns]
        rows = self.header.shape[0]
        for start in range(0, rows, BLOCK):
            yield self.read(start, min(start + BLOCK, rows))[:, places]

    def read(self, start: int, stop: int) -> Array:
        """Return rows start to stop, (stop - start, n).

        Raises:
            InputError: If the file ends before these rows.
        """
        header, (rows, width) = self.header, self.header.shape
        size = header.dtype.itemsize
        with self.path.open("rb") as stream:
            if not header.fortran:
                data = _take(self.path, stream, header.size + start * width * size, (stop - start) * width * size)
                return np.frombuffer(data, header.dtype).reshape(-1, width).astype(np.float64)
            parts = [
                _take(self.path, stream, header.size + (column * rows + start) * size, (stop - start) * size)
                for column in range(width)
            ]
        return np.stack([np.frombuffer(part, header.dtype) for part in parts], axis=1).astype(np.float64)


def _take(path: Path, stream: IO[bytes], place: int, size: int) -> bytes:
    stream.seek(place)
    data = stream.read(size)
    if len(data) != size:
        raise bad(path, "the file ends before its last row; it became shorter while it was read", "Give it whole again")
    return data


@dataclass(frozen=True)
class NpzTable:
    """An archive with one array (N,) for each column.

    Attributes:
        path: The file.
        names: The names of its arrays.
        rows: N.
    """

    path: Path
    names: tuple[str, ...]
    rows: int

    @classmethod
    def open(cls, path: Path) -> NpzTable:
        """Read the headers of all arrays.

        Raises:
            InputError: If it is not an archive of such arrays; the error lists all faults.
        """
        faults: list[Problem] = []
        lengths: dict[str, int] = {}
        remedy = "Write it with numpy.savez(file, time=t, q1=..., ...)"
        with path.open("rb") as stream:
            begin = stream.read(len(npy.MAGIC_PREFIX))
        if begin == npy.MAGIC_PREFIX:
            raise bad(path, "it holds one array, not named ones", "Call it .npy, or write it with numpy.savez")
        if not begin.startswith(_ZIPPED):  # an archive after other bytes: NumPy does not read it
            raise bad(path, "it is no NPZ file of numbers (it does not begin as one)", remedy)
        try:
            with zipfile.ZipFile(path) as archive:
                names = tuple(_named(info) for info in archive.infolist())
                check_names(path, names)
                for info in archive.infolist():
                    with archive.open(info) as stream:
                        header = _header(stream)
                    if len(header.shape) != 1 or not header.is_numeric:
                        what = f"{_named(info)!r} is an array {header.shape} of {header.dtype}"
                        faults.append(Problem(what, "Give one array of numbers (N,) per column", path.name))
                    elif info.file_size != header.size + header.bytes:
                        what = f"{_named(info)!r} has {info.file_size} bytes, not {header.size + header.bytes}"
                        faults.append(Problem(what, "Write the archive again", path.name))
                    else:
                        lengths[_named(info)] = header.shape[0]
        except InputError:
            raise
        except (*DAMAGE, OSError) as error:
            pass_on(error)
            raise bad(path, f"it is no NPZ file of numbers ({error})", remedy) from error
        if len(set(lengths.values())) > 1:
            sizes = ", ".join(f"{name}: {length}" for name, length in lengths.items())
            what = f"the columns have different lengths ({sizes})"
            faults.append(Problem(what, "Give one value per configuration", path.name))
        if faults:
            raise InputError(faults)
        if not lengths:
            raise bad(path, "there is no column", "Give one column per coordinate")
        return cls(path, names, next(iter(lengths.values())))

    def count(self, columns: Sequence[str]) -> int:
        """Return the number of rows."""
        return self.rows

    def blocks(self, columns: Sequence[str]) -> Iterator[Array]:
        """Yield all rows in blocks; every column is unpacked as a separate stream."""
        try:
            with ExitStack() as stack:
                archive = stack.enter_context(zipfile.ZipFile(self.path))
                infos = {_named(info): info for info in archive.infolist()}
                streams = [stack.enter_context(archive.open(infos[name])) for name in columns]
                types = [_header(stream).dtype for stream in streams]
                for start in range(0, self.rows, BLOCK):
                    count = min(BLOCK, self.rows - start)
                    parts = [_column(s, t, count) for s, t in zip(streams, types, strict=True)]
                    yield np.stack(parts, axis=1) if parts else np.empty((count, 0))
        except (*DAMAGE, OSError) as error:
            pass_on(error)
            raise bad(self.path, f"it is damaged ({error})", "Write it again with numpy.savez") from error


def _column(stream: IO[bytes], dtype: np.dtype[Any], count: int) -> Array:
    wanted, parts = count * dtype.itemsize, list[bytes]()
    while wanted:
        part = stream.read(min(wanted, _CHUNK))
        if not part:
            raise EOFError("an array ends before its last value")
        parts.append(part)
        wanted -= len(part)
    return np.frombuffer(b"".join(parts), dtype).astype(np.float64)


def _named(info: zipfile.ZipInfo) -> str:
    return info.filename.removesuffix(".npy")
