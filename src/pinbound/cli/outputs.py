"""Output files and folders of a command: they are prepared before the work, so that faults are reported before it."""

from __future__ import annotations

from pathlib import Path

from pinbound.exceptions import InputError, Problem

__all__ = ["ready_file", "ready_folder", "refuse_file"]


def ready_file(file: Path | None) -> None:
    """Make the folder of an output file; None: there is no output file.

    Raises:
        InputError: If a folder has the name of the file, or if the folder of the file cannot be made.
    """
    if file is None:
        return
    if file.is_dir():
        raise InputError([Problem("is a folder", "Give the name of a file", str(file))])
    ready_folder(file.parent)


def refuse_file(folder: Path) -> None:
    """Raise an error if a file has the name of an output folder, or of a folder above it.

    Raises:
        InputError: If such a file exists.
    """
    there = next(one for one in (folder, *folder.absolute().parents) if one.exists())
    if not there.is_dir():
        raise InputError([Problem("is a file, not a folder", "Give another folder", str(there))])


def ready_folder(folder: Path) -> None:
    """Make an output folder, if it does not exist.

    Raises:
        InputError: If a file has the name of the folder, or if the system refuses to make it.
    """
    refuse_file(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        why = error.strerror or type(error).__name__
        raise InputError([Problem(f"the folder cannot be made: {why}", "Give another folder", str(folder))]) from error
