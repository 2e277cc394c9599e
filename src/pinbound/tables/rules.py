"""Rules for all readers of tables: the size of blocks, and the form of errors."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pinbound.exceptions import InputError, Problem, blames_the_path

__all__ = ["BLOCK", "bad", "check_names", "pass_on"]

BLOCK = 1 << 16
"""Largest number of rows of a block."""


def check_names(path: Path, names: Sequence[str]) -> None:
    """Refuse headings that occur twice.

    Raises:
        InputError: If a heading occurs twice.
    """
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice and all(map(_is_number, names)):  # joints may be called 1 and 2, but not 0 and 0
        raise bad(path, "the columns have numbers for names, and some twice", "Give a line of column names first")
    if twice:
        raise bad(path, f"the columns {', '.join(map(repr, twice))} are there twice", "Keep one of each")


def _is_number(name: str) -> bool:
    try:
        float(name)
    except ValueError:
        return False
    return True


def bad(path: Path, message: str, remedy: str, line: int | None = None) -> InputError:
    """Return the error for one fault of a file."""
    return InputError([Problem(message, remedy, path.name, line)])


def pass_on(error: BaseException) -> None:
    """Raise an error of the disk again; without a system error number it is a library's report of a damaged file.

    Raises:
        OSError: If the machine failed.
    """
    if isinstance(error, OSError) and error.errno is not None and not blames_the_path(error):
        raise error
