"""Parquet files, read through PyArrow, the pages of one row group at a time."""

from __future__ import annotations

import importlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pinbound.exceptions import InputError, Problem, UnsupportedError
from pinbound.tables.rules import BLOCK, bad, check_names, pass_on
from pinbound.typing import Array

__all__ = ["ParquetTable", "load_arrow"]


def load_arrow(module: str) -> Any:
    """Return a module of PyArrow, which is an extra.

    Raises:
        UnsupportedError: If it is not installed.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        message = "Parquet and batches need PyArrow, which is not installed; type: pip install 'pinbound[batch]'"
        raise UnsupportedError(message) from error


@dataclass(frozen=True)
class ParquetTable:
    """A Parquet file.

    Attributes:
        path: The file.
        names: Its columns.
        rows: N.
        unfit: Columns that are not plain numbers, with their types.
    """

    path: Path
    names: tuple[str, ...]
    rows: int
    unfit: dict[str, str]

    @classmethod
    def open(cls, path: Path) -> ParquetTable:
        """Read the schema.

        Raises:
            InputError: If it is not a Parquet file, or a column occurs twice.
            UnsupportedError: If PyArrow is not installed.
        """
        arrow, parquet = load_arrow("pyarrow"), load_arrow("pyarrow.parquet")
        with path.open("rb"):  # if a file does not exist or is not readable, the system's error is raised
            pass
        try:
            file = parquet.ParquetFile(path, pre_buffer=False)
            with file:
                schema, rows = file.schema_arrow, int(file.metadata.num_rows)
        except (arrow.ArrowException, OSError, ValueError) as error:
            pass_on(error)
            raise _damaged(path, error) from error
        names = tuple(schema.names)
        check_names(path, names)
        kinds = arrow.types
        unfit = {
            field.name: str(field.type)
            for field in schema
            if not (kinds.is_floating(field.type) or kinds.is_integer(field.type))
        }
        return cls(path, names, rows, unfit)

    def count(self, columns: Sequence[str]) -> int:
        """Return the number of rows."""
        return self.rows

    def blocks(self, columns: Sequence[str]) -> Iterator[Array]:
        """Yield all rows in blocks; memory grows neither with the file nor with its row groups."""
        faults = [
            Problem(f"column {name!r} is of type {self.unfit[name]}", "Store it as float64", self.path.name)
            for name in columns
            if name in self.unfit
        ]
        if faults:
            raise InputError(faults)
        arrow, parquet = load_arrow("pyarrow"), load_arrow("pyarrow.parquet")
        number, found = arrow.float64(), 0
        try:
            # pre_buffer would read and keep whole row groups, so that memory would grow with the file.
            with parquet.ParquetFile(self.path, pre_buffer=False) as file:
                for batch in file.iter_batches(batch_size=BLOCK, columns=list(columns)):
                    parts = [
                        np.asarray(batch.column(name).cast(number, safe=False).to_numpy(zero_copy_only=False))
                        for name in columns
                    ]
                    found += batch.num_rows
                    yield np.stack(parts, axis=1) if parts else np.empty((batch.num_rows, 0))
        except (arrow.ArrowException, OSError, ValueError, MemoryError) as error:
            pass_on(error)
            raise _damaged(self.path, error) from error
        if found != self.rows:
            raise bad(self.path, f"its header says {self.rows} rows, and it has {found}", "Write it again")


def _damaged(path: Path, error: BaseException) -> InputError:
    words = str(error).splitlines()
    return bad(
        path, f"it is no Parquet file, or damaged ({words[0] if words else type(error).__name__})", "Write it again"
    )
