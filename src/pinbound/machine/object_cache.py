"""Object code in the user's cache folder.

The folder is `PINBOUND_CACHE_DIR`, else `XDG_CACHE_HOME/pinbound`, else `~/.cache/pinbound`.
What is read here is executed. So a file counts only if it and its folder belong to this user and nobody else may write
to them, and if it begins with its key and the SHA-256 of the code: a file that is cut short, changed, or
renamed from another key's is as good as none, and is written anew. Files are renamed into place, so that processes that
compile the same kernel at once never see half of one. Where the folder cannot be used, nothing is kept, and the log
says so once: each process then compiles anew, for seconds.
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
"""Who may not write: group and others."""

_OPEN = "it belongs to another user, or others may write to it (chmod 700)"


def load_object(key: str) -> bytes | None:
    """Return the code that was stored under a key (hexadecimal); None if there is none that can be trusted."""
    try:
        folder = _folder()
        if not _is_ours(os.stat(folder)):
            _say(folder, _OPEN)
            return None
        with open(_path(folder, key), "rb") as file:
            if not _is_ours(os.fstat(file.fileno())):
                return None
            text = file.read()
    except (OSError, RuntimeError):  # RuntimeError: a user without a home
        return None
    head = _head(key, b"")
    code = text[len(head) :]
    return code if text == _head(key, code) + code else None


def store_object(key: str, code: bytes) -> None:
    """Keep code under a key; do nothing where the folder cannot be written or is not this user's alone."""
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
        handle, name = tempfile.mkstemp(suffix=".tmp", dir=folder)  # readable and writable by this user alone
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
    """Say once a process that machine code is not kept, and why."""
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
    """Return whether a file or folder belongs to this user, and no other may write to it (known on POSIX alone)."""
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
