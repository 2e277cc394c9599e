"""CSV: a line of headings, then one line for each row; UTF-8, separated by commas.

Blank lines are skipped, and so are lines above the headings that start with ``#``. Python's reader defines the format.
If PyArrow is installed, it reads large files many times faster. Where it refuses, Python's reader continues at the part
in doubt, and reports the line with the fault.
"""

from __future__ import annotations

import codecs
import csv
import importlib
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pinbound.exceptions import InputError, Problem
from pinbound.tables.rules import BLOCK, bad, check_names
from pinbound.typing import Array

__all__ = ["TextTable"]

_MOST_FAULTS = 8
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?(nan|inf|infinity)", re.ASCII | re.IGNORECASE)
_FAST_FROM = 1 << 20
"""Size of a file in bytes from which PyArrow is loaded."""
_PART = 1 << 20


@dataclass(frozen=True)
class TextTable:
    """A CSV file.

    Attributes:
        path: The file.
        names: Its headings.
        top: Number of lines up to and including the headings.
    """

    path: Path
    names: tuple[str, ...]
    top: int

    @classmethod
    def open(cls, path: Path) -> TextTable:
        """Read the headings.

        Raises:
            InputError: If there are no headings, or if they are not in UTF-8 or not separated by commas.
        """
        for line, cells in _lines(path):
            if not any(cells) or cells[0].lstrip().startswith("#"):
                continue
            names = tuple(cell.strip() for cell in cells)
            if len(names) == 1 and (";" in names[0] or "\t" in names[0]):
                raise bad(path, "the columns are not separated by commas", "Save it as comma-separated text", line)
            check_names(path, names)
            return cls(path, names, line)
        raise bad(path, "the file is empty", "Give a line of column names, then one line per configuration")

    def count(self, columns: Sequence[str]) -> int:
        """Return the number of rows; the whole file is read, so that every fault in these columns is found."""
        return sum(len(block) for block in self.blocks(columns))

    def blocks(self, columns: Sequence[str]) -> Iterator[Array]:
        """Yield all rows in blocks."""
        done = 0
        if self.path.stat().st_size >= _FAST_FROM:
            for block in self._fast(columns):
                done += len(block)
                if not len(block):  # PyArrow refused
                    break
                yield block
            else:
                return
        yield from self._slow(columns, done)

    def lines(self) -> list[int]:
        """Return the line number of each row, for messages."""
        return [line for line, cells in self._rows() if cells]

    def _rows(self) -> Iterator[tuple[int, list[str]]]:
        for line, cells in _lines(self.path):
            if line > self.top and cells:
                yield line, cells

    def _slow(self, columns: Sequence[str], skip: int) -> Iterator[Array]:
        places = [self.names.index(name) for name in columns]
        faults: list[Problem] = []
        held: list[list[float]] = []
        for row, (line, cells) in enumerate(self._rows()):
            if row < skip:
                continue
            if len(cells) != len(self.names):
                message = f"{len(cells)} cells for {len(self.names)} columns"
                faults.append(Problem(message, "Give one cell per column", self.path.name, line))
            else:
                held.append([self._number(cells, place, line, faults) for place in places])
            if len(faults) >= _MOST_FAULTS:
                break
            if len(held) == BLOCK and not faults:
                yield np.array(held, dtype=np.float64)
                held = []
        if faults:
            raise InputError(faults)
        if held:
            yield np.array(held, dtype=np.float64).reshape(len(held), len(places))

    def _number(self, cells: list[str], place: int, line: int, faults: list[Problem]) -> float:
        cell = cells[place].strip()
        if not cell:
            return np.nan
        if not _NUMBER.fullmatch(cell):
            shown = cell if len(cell) <= 40 else f"{cell[:40]}..."
            faults.append(Problem(f"{self.names[place]} is {shown!r}", "Give a number", self.path.name, line))
            return np.nan
        return float(cell)

    def _fast(self, columns: Sequence[str]) -> Iterator[Array]:
        """Yield blocks as PyArrow reads them; an empty one if it refuses."""
        if not _is_utf8(self.path):  # PyArrow checks only the columns that it converts
            yield np.empty((0, len(columns)))
            return
        try:
            arrow: Any = importlib.import_module("pyarrow")
            text: Any = importlib.import_module("pyarrow.csv")
        except ImportError:
            yield np.empty((0, len(columns)))
            return
        number = arrow.float64()
        try:
            reader = text.open_csv(
                self.path,
                read_options=text.ReadOptions(skip_rows=self.top, column_names=list(self.names)),
                convert_options=text.ConvertOptions(
                    column_types=dict.fromkeys(columns, number), include_columns=list(columns), null_values=[""]
                ),
            )
            for batch in reader:
                table = np.stack([column.to_numpy(zero_copy_only=False) for column in batch.columns], axis=1)
                for start in range(0, len(table), BLOCK):
                    yield np.ascontiguousarray(table[start : start + BLOCK], dtype=np.float64)
        except arrow.ArrowException:
            yield np.empty((0, len(columns)))


def _is_utf8(path: Path) -> bool:
    decoder = codecs.getincrementaldecoder("utf-8")()
    try:
        with path.open("rb") as stream:
            while part := stream.read(_PART):
                decoder.decode(part)
        decoder.decode(b"", final=True)
    except UnicodeDecodeError:
        return False
    return True


def _lines(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Yield the cells of each line with its number; for a cell over several lines, the number of the last one."""
    try:
        with path.open(encoding="utf-8-sig", newline="") as stream:
            reader = csv.reader(stream, strict=True)
            for cells in reader:
                yield reader.line_num, cells
    except (UnicodeDecodeError, csv.Error) as error:
        raise bad(path, f"it is no CSV file in UTF-8 ({error})", "Save it as comma-separated text in UTF-8") from error
