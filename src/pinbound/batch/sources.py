"""Sources of configurations: files, grids, random and Sobol points; read in chunks, with the same rows each time."""

from __future__ import annotations

import hashlib
import importlib
import math
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from pinbound.checks import random_numbers, whole_number
from pinbound.exceptions import InputError, Problem, name_hint
from pinbound.tables import Table, open_table
from pinbound.tables.arrays import NpyTable
from pinbound.typing import Array

__all__ = ["FileSource", "GridSource", "RandomSource", "SobolSource", "Source", "open_source"]

_BLOCK = 1 << 16
"""Rows of a random block: block b has its own seed, so any chunk can be made without those before it."""


class Source(Protocol):
    """Rows of configurations (N, n), the same each time they are read."""

    @property
    def rows(self) -> int:
        """N."""
        ...

    @property
    def is_random_access(self) -> bool:
        """Whether `read` is cheap for any rows, so that another process can make its own chunk."""
        ...

    def describe(self) -> dict[str, Any]:
        """Return the definition of the rows, for the manifest."""
        ...

    def read(self, start: int, stop: int) -> Array:
        """Return rows start to stop."""
        ...

    def chunks(self, size: int, wanted: Sequence[int]) -> Iterator[tuple[int, Array]]:
        """Yield the requested chunks in order; chunk i has the rows `i size` to `(i + 1) size`."""
        ...

    def stamp(self) -> list[int] | None:
        """Return a value that changes with the rows: size and modification time of a file; None for generated rows."""
        ...

    def check(self) -> None:
        """Refuse rows that differ from those that were opened.

        Raises:
            InputError: If the file has changed since.
        """
        ...


class _Anywhere:
    """A source whose chunks are read one by one."""

    rows: int

    @property
    def is_random_access(self) -> bool:
        return True

    def read(self, start: int, stop: int) -> Array:
        raise NotImplementedError

    def chunks(self, size: int, wanted: Sequence[int]) -> Iterator[tuple[int, Array]]:
        for index in wanted:
            yield index, self.read(index * size, min((index + 1) * size, self.rows))

    def stamp(self) -> list[int] | None:
        return None

    def check(self) -> None:
        return


@dataclass(frozen=True)
class RandomSource(_Anywhere):
    """Uniform points of a box.

    Attributes:
        rows: N.
        seed: Seed.
        lower: (n,) [rad or m].
        upper: (n,) [rad or m].

    Example:
        >>> source = RandomSource(100_000, 1, (0.0,), (1.0,))
        >>> bool(np.array_equal(source.read(65_000, 66_000), source.read(0, 70_000)[65_000:66_000]))
        True
    """

    rows: int
    seed: int
    lower: tuple[float, ...]
    upper: tuple[float, ...]

    def describe(self) -> dict[str, Any]:
        """Return kind, seed and box."""
        return {"kind": "random", "rows": self.rows, "seed": self.seed, "lower": self.lower, "upper": self.upper}

    def read(self, start: int, stop: int) -> Array:
        """Return rows start to stop."""
        lower, upper = np.array(self.lower), np.array(self.upper)
        parts: list[Array] = []
        for block in range(start // _BLOCK, -(-stop // _BLOCK)):
            rng = np.random.default_rng(np.random.SeedSequence(whole_number(self.seed, "seed"), spawn_key=(block,)))
            points = rng.random((_BLOCK, len(lower)))
            first = block * _BLOCK
            parts.append(points[max(start - first, 0) : min(stop - first, _BLOCK)])
        points = np.concatenate(parts) if parts else np.empty((0, len(lower)))
        points *= upper - lower
        points += lower
        return points


@dataclass(frozen=True)
class SobolSource(_Anywhere):
    """Scrambled Sobol points of a box, which fill it more evenly than random ones."""

    rows: int
    seed: int
    lower: tuple[float, ...]
    upper: tuple[float, ...]

    def describe(self) -> dict[str, Any]:
        """Return kind, seed and box."""
        return {"kind": "sobol", "rows": self.rows, "seed": self.seed, "lower": self.lower, "upper": self.upper}

    def read(self, start: int, stop: int) -> Array:
        """Return rows start to stop."""
        qmc: Any = importlib.import_module("scipy.stats.qmc")
        bits = min(64, max(30, math.ceil(math.log2(max(self.rows, 2))) + 1))
        engine = qmc.Sobol(len(self.lower), scramble=True, bits=bits, rng=random_numbers(self.seed))
        if start:
            engine.fast_forward(start)
        points = np.empty((stop - start, len(self.lower)))
        first = 0
        while first < len(points):
            # SciPy warns if the first draw is neither one point nor a power of two, even if more follow.
            count = min(_BLOCK, len(points) - first) if start + first else 1
            points[first : first + count] = engine.random(count)
            first += count
        return np.array(self.lower) + points * (np.array(self.upper) - np.array(self.lower))


@dataclass(frozen=True)
class GridSource(_Anywhere):
    """The product of evenly spaced values; the last coordinate runs fastest.

    Attributes:
        axes: (first, last, count) of each coordinate.

    Example:
        >>> GridSource(((0.0, 1.0, 2), (5.0, 6.0, 3))).read(2, 5).tolist()
        [[0.0, 6.0], [1.0, 5.0], [1.0, 5.5]]
    """

    axes: tuple[tuple[float, float, int], ...]

    @property
    def rows(self) -> int:  # type: ignore[override]
        """The product of the counts."""
        return math.prod(count for _, _, count in self.axes)

    def describe(self) -> dict[str, Any]:
        """Return kind and axes."""
        return {"kind": "grid", "axes": self.axes}

    def read(self, start: int, stop: int) -> Array:
        """Return rows start to stop."""
        indices = np.unravel_index(np.arange(start, stop), [count for _, _, count in self.axes])
        columns = [
            np.linspace(first, last, count)[i] for (first, last, count), i in zip(self.axes, indices, strict=True)
        ]
        return np.stack(columns, axis=1)


@dataclass(frozen=True)
class FileSource:
    """Rows of a CSV, NPY, NPZ or Parquet file.

    Attributes:
        path: The file.
        coordinates: The columns that are read, in q's order; an NPY has them as its columns.
        rows: N.
        sha256: Of the file, so that a resumed job, and a worker on another machine, read the same file.
        degrees: (n,) which columns are in degrees; they are converted to radians.
    """

    path: str
    coordinates: tuple[str, ...]
    rows: int
    sha256: str
    degrees: tuple[bool, ...] = ()
    _stamp: list[int] = field(default_factory=list[int], compare=False)

    @property
    def is_random_access(self) -> bool:
        """Whether rows can be read without those before them: NPY only."""
        return self.path.lower().endswith(".npy")

    def describe(self) -> dict[str, Any]:
        """Return kind, name, checksum and the columns in degrees."""
        told: dict[str, Any] = {"kind": "file", "name": Path(self.path).name, "rows": self.rows, "sha256": self.sha256}
        if any(self.degrees):
            told["degrees"] = [name for name, angle in zip(self.coordinates, self.degrees, strict=True) if angle]
        return told

    def stamp(self) -> list[int] | None:
        """Return size and modification time [ns] of the file now."""
        return _stamp(self.path)

    def check(self) -> None:
        """Refuse a file that has changed since it was opened.

        Raises:
            InputError: If its contents differ.
        """
        if _digest(self.path) != self.sha256:
            raise self._changed()

    def read(self, start: int, stop: int) -> Array:
        """Return rows start to stop.

        Raises:
            InputError: If the file is not the one that was opened: it changed, or another machine has a different file.
        """
        if self.is_random_access:
            if _known_digest(self.path, *_stamp(self.path)) != self.sha256:
                raise self._changed()
            table = open_table(Path(self.path), self.coordinates)
            if not isinstance(table, NpyTable):
                raise self._changed()
            return self._radians(table.read(start, stop))
        size = stop - start
        if start % size:
            raise ValueError("a streamed file is read in chunks of one size")
        return next(array for _, array in self.chunks(size, [start // size]))

    def chunks(self, size: int, wanted: Sequence[int]) -> Iterator[tuple[int, Array]]:
        """Yield the requested chunks; a streamed file is read from its beginning, and other rows are skipped.

        Raises:
            InputError: If the file has changed since it was opened, or has another number of rows now.
        """
        if self.is_random_access:
            for index in wanted:
                yield index, self.read(index * size, min((index + 1) * size, self.rows))
            return
        due, held, count, index, total = set(wanted), list[Array](), 0, 0, 0
        for block in self._table().blocks(self.coordinates):
            total += len(block)
            start = 0
            while start < len(block):
                part = block[start : start + size - count]
                held.append(part)
                count, start = count + len(part), start + len(part)
                if count == size:
                    if index in due:
                        self._look()
                        yield index, self._radians(np.concatenate(held))
                    held, count, index = [], 0, index + 1
            if index > max(due, default=-1):
                return  # later rows are not requested
        if total != self.rows:
            raise self._changed()
        if count and index in due:
            self._look()
            yield index, self._radians(np.concatenate(held))

    def _table(self) -> Table:
        return open_table(Path(self.path), self.coordinates)

    def _look(self) -> None:
        if self._stamp and _stamp(self.path) != self._stamp and _digest(self.path) != self.sha256:
            raise self._changed()

    def _radians(self, Q: Array) -> Array:
        for column in np.flatnonzero(self.degrees):
            Q[:, column] = np.radians(Q[:, column])
        return Q

    def _changed(self) -> InputError:
        remedy = "Give the file that the job began with, or start a new job in another folder"
        return _bad(Path(self.path), "the file is not the one that was opened: it changed meanwhile", remedy)


def open_source(path: Path, coordinates: Sequence[str], degrees: Sequence[bool] = ()) -> FileSource:
    """Return a file as a source: its columns are checked and its rows counted.

    Args:
        path: A .csv, .npy, .npz or .parquet file.
        coordinates: Columns to read; an NPY has them in this order.
        degrees: Which of them are in degrees; none by default.

    Raises:
        InputError: If it is of another kind, lacks a coordinate, or contains a value that is not a number.
    """
    sha256, stamp = _digest(str(path)), _stamp(str(path))
    table = open_table(path, coordinates)
    missing = [name for name in coordinates if name not in table.names]
    if missing:
        hint = name_hint(missing[0], table.names)
        message = f"has no column {', '.join(map(repr, missing))}; {hint}"
        raise _bad(path, message, "Name the columns as the coordinates")
    source = FileSource(
        str(path.resolve()), tuple(coordinates), table.count(coordinates), sha256, tuple(degrees), stamp
    )
    if stamp != _stamp(str(path)):
        source.check()
    return source


def _stamp(path: str) -> list[int]:
    found = os.stat(path)
    return [found.st_size, found.st_mtime_ns]


def _digest(path: str) -> str:
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest() if hasattr(hashlib, "file_digest") else _blockwise(file)


def _blockwise(file: Any) -> str:  # Python 3.10
    digest = hashlib.sha256()
    while block := file.read(1 << 20):
        digest.update(block)
    return digest.hexdigest()


@lru_cache(maxsize=8)
def _known_digest(path: str, size: int, changed: int) -> str:
    """Return a file's checksum, which is computed once for each state of the file in this process."""
    return _digest(path)


def _bad(path: Path, message: str, remedy: str) -> InputError:
    return InputError([Problem(message, remedy, str(path))])
