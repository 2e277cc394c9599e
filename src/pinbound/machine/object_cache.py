"""Object code in the user's cache folder.

The folder is `PINBOUND_CACHE_DIR`, else `XDG_CACHE_HOME/pinbound`, else `~/.cache/pinbound`.
What is read here is executed. So a file counts only if it and its folder belong to this user and nobody else may write
to them, and if it begins with its key and the SHA-256 of the code: a file that is cut short, changed, or
renamed from another key's is as good as none, and is written anew. Files are renamed into place, so that processes that
compile the same kernel at once never see half of one. Where the folder cannot be used, nothing is kept.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import stat
import sys
from pathlib import Path

__all__ = ["load_object", "store_object"]

_MAGIC = b"pinbound object code 1\n"

_OTHERS = stat.S_IWGRP | stat.S_IWOTH
"""Who may not write: group and others."""


def load_object(key: str) -> bytes | None:
    """Return the code that was stored under a key (hexadecimal); None if there is none that can be trusted."""
    try:
        folder = _folder()
        if not _is_ours(os.stat(folder)):
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
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        if not _is_ours(os.stat(folder)):
            return
        handle, name = tempfile.mkstemp(suffix=".tmp", dir=folder)  # readable and writable by this user alone
    except (OSError, RuntimeError):
        return
    try:
        with open(handle, "wb") as file:
            file.write(_head(key, code) + code)
        os.replace(name, _path(folder, key))
    except OSError:  # a full disk, or on Windows a file that is being read
        with contextlib.suppress(OSError):
            os.unlink(name)


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
