"""Object code in the user's cache folder.

The folder is `PINBOUND_CACHE_DIR`, else `XDG_CACHE_HOME/pinbound`, else `~/.cache/pinbound`.
The files that are read here are executed. So a file is used only if it and its folder belong to this user, nobody else
may write to them, and it begins with its key and the SHA-256 of the code. A file that is cut short, changed, or renamed
from another key is ignored, and written anew. A file is written under another name and then renamed, so that processes
that compile the same kernel at the same time never see an incomplete file. If the folder cannot be used, nothing is
kept, and the log says so once: then each process compiles anew, for seconds.
"""

from __future__ import annotations

import contextlib
import hashlib
import logging
import os
import stat
import sys
from pathlib import Path

__all__ = ["load_object", "store_object"]

_MAGIC = b"pinbound object code 1\n"

_logger = logging.getLogger("pinbound")
_said: set[str] = set()

_OTHERS = stat.S_IWGRP | stat.S_IWOTH
"""The users who must not have write permission: group and others."""

_OPEN = "it belongs to another user, or others may write to it (chmod 700)"


def load_object(key: str) -> bytes | None:
    """Return the code that was stored under a key (hexadecimal); None if there is no code that can be trusted."""
    try:
        folder = _folder()
        if not _is_ours(os.stat(folder)):
            _say(folder, _OPEN)
            return None
        with open(_path(folder, key), "rb") as file:
            if not _is_ours(os.fstat(file.fileno())):
                return None
            text = file.read()
    except (OSError, RuntimeError):  # RuntimeError: a user without a home folder
        return None
    head = _head(key, b"")
    code = text[len(head) :]
    return code if text == _head(key, code) + code else None


def store_object(key: str, code: bytes) -> None:
    """Store code under a key; do nothing if the folder cannot be written, or if others may write to it."""
    import tempfile

    try:
        folder = _folder()
    except RuntimeError:
        _say(None, "this user has no home folder")
        return
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        if not _is_ours(os.stat(folder)):
            _say(folder, _OPEN)
            return
        handle, name = tempfile.mkstemp(suffix=".tmp", dir=folder)  # only this user can read and write it
    except OSError as error:
        _say(folder, f"it cannot be written ({error.strerror or error})")
        return
    try:
        with open(handle, "wb") as file:
            file.write(_head(key, code) + code)
        os.replace(name, _path(folder, key))
    except OSError as error:  # a full disk, or on Windows a file that is being read
        if sys.platform != "win32":
            _say(folder, f"it cannot be written ({error.strerror or error})")
        with contextlib.suppress(OSError):
            os.unlink(name)


def _say(folder: Path | None, reason: str) -> None:
    """Log once in a process that machine code is not kept, and why."""
    if reason in _said:
        return
    _said.add(reason)
    place = "the cache" if folder is None else f"the cache folder {str(folder)!r}"
    _logger.warning(
        "pinbound: machine code is not kept: %s cannot be used, because %s; each process compiles anew, for seconds. "
        "Set PINBOUND_CACHE_DIR to a folder that is yours alone",
        place,
        reason,
    )


def _head(key: str, code: bytes) -> bytes:
    digest = hashlib.sha256(code).hexdigest()
    return _MAGIC + f"{key}\n{digest}\n".encode()


def _is_ours(status: os.stat_result) -> bool:
    """Return whether a file or folder belongs to this user, and no other may write to it (known only on POSIX)."""
    if sys.platform == "win32":
        return True
    return status.st_uid == os.geteuid() and not status.st_mode & _OTHERS


def _path(folder: Path, key: str) -> Path:
    return folder / f"{key[:32]}.o"


def _folder() -> Path:
    if given := os.environ.get("PINBOUND_CACHE_DIR"):
        return Path(given) / "kernels"
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "pinbound" / "kernels"
