"""Files and folders that a command is to write: made ready before the work, so that no fault is told after it."""

from __future__ import annotations

from pathlib import Path

from pinbound.exceptions import InputError, Problem

__all__ = ["ready_file", "ready_folder", "refuse_file"]


def ready_file(file: Path | None) -> None:
    """Make the folder of a file that is to be written; None: no file is.

    Raises:
        InputError: If a folder has the file's name, or its folder cannot be made.
    """
    if file is None:
        return
    if file.is_dir():
        raise InputError([Problem("is a folder", "Give the name of a file", str(file))])
    ready_folder(file.parent)


def refuse_file(folder: Path) -> None:
    """Raise an error if a file has the name of a folder that is to be made, or of one above it.

    Raises:
        InputError: If so.
    """
    there = next(one for one in (folder, *folder.absolute().parents) if one.exists())
    if not there.is_dir():
        raise InputError([Problem("is a file, not a folder", "Give another folder", str(there))])


def ready_folder(folder: Path) -> None:
    """Make a folder that is to be written into, if it is not there.

    Raises:
        InputError: If a file has its name, or the system refuses.
    """
    refuse_file(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        why = error.strerror or type(error).__name__
        raise InputError([Problem(f"the folder cannot be made: {why}", "Give another folder", str(folder))]) from error
