"""The interface of all tables of numbers, for any file format, and the rules of all readers.

- Columns have names, and no name occurs twice. An NPY file has no names; the caller gives the names of its columns.
- A cell is a decimal number (``-1.5e-3``), ``nan`` or ``inf``; an empty or missing cell is NaN. Words, truth values and
  complex numbers are faults, as are nested columns and dates.
- Only the requested columns must be numbers.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Protocol

import numpy as np

from pinbound.tables.rules import bad
from pinbound.typing import Array

__all__ = ["SUFFIXES", "Table", "open_table", "read_table"]

SUFFIXES = (".csv", ".npy", ".npz", ".parquet")
"""File formats by suffix, in upper or lower case."""

MOST_CELLS = 100_000_000
"""Largest number of cells that `read_table` reads into memory (800 MB); larger files are refused."""


class Table(Protocol):
    """A file of named columns that is opened; its headings are checked."""

    @property
    def path(self) -> Path:
        """The file."""
        ...

    @property
    def names(self) -> tuple[str, ...]:
        """Columns, in the file's order."""
        ...

    def count(self, columns: Sequence[str]) -> int:
        """Return the number of rows; a text file is read completely for this, and these columns are checked.

        Raises:
            InputError: If the file is damaged.
        """
        ...

    def blocks(self, columns: Sequence[str]) -> Iterator[Array]:
        """Yield all rows in order, in blocks (k, len(columns)), with k at most `BLOCK`.

        Raises:
            InputError: If a cell is not a number, or the file is damaged.
        """
        ...


def open_table(path: Path, unnamed: Sequence[str] = ()) -> Table:
    r"""Return a file as a table.

    Args:
        path: A .csv, .npy, .npz or .parquet file.
        unnamed: Names of the columns of an NPY file, which does not contain names.

    Raises:
        InputError: If the file is of another kind, or its headings cannot be read.
        OSError: If the file does not exist or cannot be read.
        UnsupportedError: If it is Parquet and PyArrow is not installed.

    Example:
        >>> import tempfile
        >>> file = Path(tempfile.mkdtemp()) / "motion.csv"
        >>> _ = file.write_text("time,q1\n0,1.5\n1,\n")
        >>> table = open_table(file)
        >>> table.names, table.count(["q1"]), [block.tolist() for block in table.blocks(["q1"])]
        (('time', 'q1'), 2, [[[1.5], [nan]]])
    """
    suffix = path.suffix.lower()
    if suffix == ".csv":
        from pinbound.tables.text import TextTable

        return TextTable.open(path)
    if suffix == ".npy":
        from pinbound.tables.arrays import NpyTable

        return NpyTable.open(path, unnamed)
    if suffix == ".npz":
        from pinbound.tables.arrays import NpzTable

        return NpzTable.open(path)
    if suffix == ".parquet":
        from pinbound.tables.columnar import ParquetTable

        return ParquetTable.open(path)
    raise bad(path, f"the suffix {suffix!r} is not known" if suffix else "it has no suffix", f"Give a {_listed()} file")


def read_table(table: Table, columns: Sequence[str]) -> Mapping[str, Array]:
    """Return whole columns (N,) of a table.

    Raises:
        InputError: If a cell is not a number, the file is damaged, or the columns have more than `MOST_CELLS` cells.
    """
    blocks: list[Array] = []
    cells = 0
    for block in table.blocks(columns):
        cells += block.size
        if cells > MOST_CELLS:
            message = f"it holds more than {MOST_CELLS:,} numbers, the most that are read at once"
            raise bad(table.path, message, "Split the file, or evaluate it with `pinbound batch`, which reads in parts")
        blocks.append(block)
    whole = np.concatenate(blocks) if blocks else np.empty((0, len(columns)))
    return dict(zip(columns, np.ascontiguousarray(whole.T), strict=True))


def _listed() -> str:
    return f"{', '.join(SUFFIXES[:-1])} or {SUFFIXES[-1]}"
