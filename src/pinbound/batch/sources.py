"""Where configurations come from: files, grids, random and Sobol points; read in chunks, always the same rows."""

from __future__ import annotations

import hashlib
import importlib
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from pinbound.exceptions import InputError, Problem, UnsupportedError, name_hint

__all__ = ["FileSource", "GridSource", "RandomSource", "SobolSource", "Source", "load_arrow", "open_source"]

Array = NDArray[np.float64]

_BLOCK = 1 << 16
"""Rows a random block: block b has its own seed, so that any chunk can be made without those before it."""


class Source(Protocol):
    """Rows of configurations (N, n), the same ones whenever they are read."""

    @property
    def rows(self) -> int:
        """N."""
        ...

    @property
    def is_random_access(self) -> bool:
        """Whether `read` is cheap anywhere, so that another process can make its own chunk."""
        ...

    def describe(self) -> dict[str, Any]:
        """Return what defines the rows, for the manifest."""
        ...

    def read(self, start: int, stop: int) -> Array:
        """Return rows start to stop."""
        ...

    def chunks(self, size: int, wanted: Sequence[int]) -> Iterator[tuple[int, Array]]:
        """Yield the wanted chunks in order, chunk i being rows `i size` to `(i + 1) size`."""
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
            rng = np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=(block,)))
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
        engine = qmc.Sobol(len(self.lower), scramble=True, bits=bits, rng=np.random.default_rng(self.seed))
        if start:
            engine.fast_forward(start)
        points = np.empty((stop - start, len(self.lower)))
        first = 0
        while first < len(points):
            # The very first draw is one point: SciPy warns of others that are no power of two, even if more follow.
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
    """Rows of a CSV, Parquet or NPY file.

    Attributes:
        path: The file.
        coordinates: Columns that are read, in q's order; an NPY has them as its columns.
        rows: N.
        sha256: Of the file, so that a resumed job reads the same.
    """

    path: str
    coordinates: tuple[str, ...]
    rows: int
    sha256: str

    @property
    def is_random_access(self) -> bool:
        """Only NPY, by memory map."""
        return self.path.endswith(".npy")

    def describe(self) -> dict[str, Any]:
        """Return kind, name and checksum."""
        return {"kind": "file", "name": Path(self.path).name, "rows": self.rows, "sha256": self.sha256}

    def read(self, start: int, stop: int) -> Array:
        """Return rows start to stop."""
        if self.is_random_access:
            return np.array(np.load(self.path, mmap_mode="r")[start:stop], dtype=np.float64)
        size = stop - start
        if start % size:
            raise ValueError("a streamed file is read in chunks of one size")
        return next(array for _, array in self.chunks(size, [start // size]))

    def chunks(self, size: int, wanted: Sequence[int]) -> Iterator[tuple[int, Array]]:
        """Yield the wanted chunks; a streamed file is read from its beginning and what is not wanted is passed over."""
        if self.is_random_access:
            for index in wanted:
                yield index, self.read(index * size, min((index + 1) * size, self.rows))
            return
        due, held, count, index = set(wanted), list[Array](), 0, 0
        for batch in _batches(Path(self.path), self.coordinates):
            start = 0
            while start < len(batch):
                part = batch[start : start + size - count]
                held.append(part)
                count, start = count + len(part), start + len(part)
                if count == size:
                    if index in due:
                        yield index, np.concatenate(held)
                    held, count, index = [], 0, index + 1
        if count and index in due:
            yield index, np.concatenate(held)


def open_source(path: Path, coordinates: Sequence[str]) -> FileSource:
    """Return a file as a source: its columns are checked and its rows counted.

    Raises:
        InputError: If it is of another kind, lacks a coordinate, or holds what is not a number.
    """
    suffix = path.suffix.lower()
    if suffix not in _READERS and suffix != ".npy":
        raise _bad(path, f"{suffix or 'no suffix'} is not known", "Give a .csv, .parquet or .npy file")
    with path.open("rb") as file:
        digest = hashlib.sha256()
        while block := file.read(1 << 20):
            digest.update(block)
    if suffix == ".npy":
        try:
            array = np.load(path, mmap_mode="r", allow_pickle=False)
        except ValueError as error:
            raise _bad(path, f"no NPY array: {error}", "Save it with numpy.save") from error
        if array.ndim != 2 or array.shape[1] != len(coordinates) or array.dtype.kind not in "fiu":
            names = ", ".join(coordinates)
            message = f"an array {array.shape} of {array.dtype}"
            raise _bad(path, message, f"Give numbers (N, {len(coordinates)}), the columns being: {names}")
        rows = len(array)
    else:
        rows = sum(len(batch) for batch in _batches(path, coordinates))
    return FileSource(str(path.resolve()), tuple(coordinates), rows, digest.hexdigest())


def _bad(path: Path, message: str, remedy: str) -> InputError:
    return InputError([Problem(message, remedy, str(path))])


def _batches(path: Path, coordinates: Sequence[str]) -> Iterator[Array]:
    """Yield a file's rows (k, n) as they come; an empty cell is NaN."""
    arrow: Any = load_arrow("pyarrow")
    try:
        for batch in _READERS[path.suffix.lower()](path, coordinates):
            columns = [
                np.asarray(batch.column(name).cast(arrow.float64()).to_numpy(zero_copy_only=False))
                for name in coordinates
            ]
            yield np.stack(columns, axis=1) if columns else np.empty((batch.num_rows, 0))
    except arrow.ArrowInvalid as error:
        raise _bad(
            path, f"cannot be read: {error}", "Every coordinate is a column of numbers; an empty cell is NaN"
        ) from error


def _csv_batches(path: Path, coordinates: Sequence[str]) -> Iterator[Any]:
    arrow: Any = load_arrow("pyarrow")
    csv: Any = load_arrow("pyarrow.csv")
    with path.open(encoding="utf-8") as file:
        found = [name.strip().strip('"') for name in file.readline().split(",")]
    _check_columns(path, found, coordinates)
    types = dict.fromkeys(coordinates, arrow.float64())
    options = csv.ConvertOptions(column_types=types, include_columns=list(coordinates))
    yield from csv.open_csv(path, convert_options=options)


def _parquet_batches(path: Path, coordinates: Sequence[str]) -> Iterator[Any]:
    parquet: Any = load_arrow("pyarrow.parquet")
    file = parquet.ParquetFile(path)
    _check_columns(path, file.schema_arrow.names, coordinates)
    yield from file.iter_batches(batch_size=_BLOCK, columns=list(coordinates))


_READERS: Mapping[str, Any] = {".csv": _csv_batches, ".parquet": _parquet_batches}


def _check_columns(path: Path, found: Sequence[str], coordinates: Sequence[str]) -> None:
    missing = [name for name in coordinates if name not in found]
    if missing:
        hint = name_hint(missing[0], found)
        raise _bad(
            path, f"has no column {', '.join(map(repr, missing))}; {hint}", "Name the columns as the coordinates"
        )


def load_arrow(module: str) -> Any:
    """Return a module of PyArrow, an extra.

    Raises:
        UnsupportedError: If it is not installed.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise UnsupportedError("a batch needs PyArrow, which is not installed; install pinbound[batch]") from error
