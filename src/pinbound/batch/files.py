"""The files of a batch folder: each is complete or absent, one process writes at a time, other files are not touched.

Every written name starts with `part-` or `.pinbound.`, or is `manifest.json`. Links are never followed.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib
import os
import stat
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from pinbound.exceptions import InputError, MachineError, Problem

__all__ = ["bad", "digest", "make_folder", "only_one", "own", "read", "remove_leftovers", "write"]

_OWN = ".pinbound."
_LOCK = f"{_OWN}lock"
_BLOCK = 1 << 20
_NOFOLLOW: int = getattr(os, "O_NOFOLLOW", 0)
_BINARY: int = getattr(os, "O_BINARY", 0)  # Windows


def bad(path: Path, message: str, remedy: str) -> InputError:
    """Return the error for a folder or file that does not fit the job."""
    return InputError([Problem(message, remedy, str(path))])


def _failed(path: Path, doing: str, error: OSError) -> MachineError:
    why = error.strerror or type(error).__name__
    return MachineError(
        f"{path}: {doing} failed: {why}. What is written is kept: run the same command again to resume."
    )


def make_folder(folder: Path) -> None:
    """Create the folder of a job, if it does not exist.

    Raises:
        InputError: If something else has its name.
        MachineError: If the system refuses.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError) as error:
        raise bad(folder, "it is a file, not a folder", "Give another folder") from error
    except OSError as error:
        raise _failed(folder, "making the folder", error) from error


def own(name: str) -> bool:
    """Return whether a file of this name, in a folder without a manifest, was left by a job that had just started."""
    return name.startswith(_OWN)


def remove_leftovers(folder: Path) -> None:
    """Remove half-written files of a job that was stopped.

    Raises:
        MachineError: If the system refuses.
    """
    try:
        for entry in os.scandir(folder):
            if own(entry.name) and entry.name.endswith(".tmp") and entry.is_file(follow_symlinks=False):
                os.unlink(entry.path)
    except OSError as error:
        raise _failed(folder, "removing half-written files", error) from error


def write(path: Path, data: bytes) -> None:
    """Write a file so that it is complete or absent, also after a power failure.

    Raises:
        MachineError: If the system refuses: the disk is full, the folder may not be written, and so on.
    """
    temporary = path.with_name(f"{_OWN}{path.name}.tmp")
    try:
        with contextlib.suppress(FileNotFoundError):
            os.unlink(temporary)
        handle = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL | _NOFOLLOW | _BINARY, 0o666)
        try:
            left = memoryview(data)
            while left:
                left = left[os.write(handle, left) :]
            os.fsync(handle)
        finally:
            os.close(handle)
        os.replace(temporary, path)
        _settle(path.parent)
    except OSError as error:
        with contextlib.suppress(OSError):
            os.unlink(temporary)
        raise _failed(path, "writing", error) from error


def _settle(folder: Path) -> None:
    """Make a rename survive a power failure, if the system supports this."""
    if os.name == "nt":
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def read(path: Path) -> bytes | None:
    """Return the content of a regular file; None if it does not exist.

    Raises:
        MachineError: If the system refuses.
    """
    try:
        handle = os.open(path, os.O_RDONLY | _NOFOLLOW | _BINARY)
    except FileNotFoundError:
        return None
    except OSError as error:
        raise _failed(path, "reading", error) from error
    try:
        if not stat.S_ISREG(os.fstat(handle).st_mode):
            return None
        parts: list[bytes] = []
        while part := os.read(handle, _BLOCK):
            parts.append(part)
        return b"".join(parts)
    except OSError as error:
        raise _failed(path, "reading", error) from error
    finally:
        os.close(handle)


def digest(path: Path) -> tuple[str, int] | None:
    """Return SHA-256 and size of a regular file; None if it does not exist.

    Raises:
        MachineError: If the system refuses.
    """
    data = read(path)
    return None if data is None else (hashlib.sha256(data).hexdigest(), len(data))


@contextmanager
def only_one(folder: Path) -> Generator[None, None, None]:
    """Keep a second process out of the folder; the system releases the lock when a process dies.

    Raises:
        InputError: If another process holds the lock, or another kind of file has the lock's name.
        MachineError: If the system refuses.
    """
    try:
        fcntl: Any = importlib.import_module("fcntl")
    except ImportError:
        yield
        return
    path = folder / _LOCK
    try:
        handle = os.open(path, os.O_RDWR | os.O_CREAT | _NOFOLLOW, 0o666)
    except OSError as error:
        if path.is_symlink() or path.is_dir():
            raise bad(path, "it is a link or a folder, not a lock of pinbound", "Give another folder") from error
        raise _failed(path, "locking the folder", error) from error
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise bad(folder, "another process is writing there", "Wait for it, or give another folder") from error
        except OSError as error:
            raise _failed(path, "locking the folder", error) from error
        yield
    finally:
        os.close(handle)
