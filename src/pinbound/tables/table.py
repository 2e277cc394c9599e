"""What every table of numbers offers, whatever file it is in, and the rules that all readers keep to.

- Columns have names, and no name occurs twice. An NPY file has no names: its columns are those that the caller gives.
- A cell is a decimal number (``-1.5e-3``), ``nan`` or ``inf``; an empty or missing cell is NaN. Words, truth values and
  complex numbers are faults, as are nested or dated columns.
- Only the columns that are asked for have to hold numbers.
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
"""Kinds of files, by suffix; capitals do not matter."""

MOST_CELLS = 100_000_000
"""Most cells that `read_table` takes into memory at once (800 MB); files that claim more are refused."""


class Table(Protocol):
    """A file of named columns, opened and checked as far as its headings say."""

    @property
    def path(self) -> Path:
        """The file."""
        ...

    @property
    def names(self) -> tuple[str, ...]:
        """Columns, in the file's order."""
        ...

    def count(self, columns: Sequence[str]) -> int:
        """Return the number of rows; a text file is read through for it, and these columns of it are checked.

        Raises:
            InputError: If the file turns out to be damaged.
        """
        ...

    def blocks(self, columns: Sequence[str]) -> Iterator[Array]:
        """Yield all rows in order, in blocks (k, len(columns)), k at most `BLOCK`.

        Raises:
            InputError: If a cell is no number, or the file is damaged.
        """
        ...


def open_table(path: Path, unnamed: Sequence[str] = ()) -> Table:
    r"""Return a file as a table.

    Args:
        path: A .csv, .npy, .npz or .parquet file.
        unnamed: Names of the columns of an NPY file, which has none of its own.

    Raises:
        InputError: If the file is of another kind, or its headings cannot be read.
        OSError: If the file is not there or cannot be read.
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
        InputError: If a cell is no number, the file is damaged, or the columns hold more than `MOST_CELLS` cells.
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
