"""A terminal program whose reader stops reading (`pinbound info ROBOT | head`)."""

from __future__ import annotations

import os
from typing import TextIO

__all__ = ["Unread"]


class Unread:
    """A text stream that throws away what nobody reads any more.

    A command then runs to its end, and its exit code is that of its answer: 0 or 1, never a failure of the pipe. All
    else is the stream's own.
    """

    def __init__(self, stream: TextIO) -> None:
        """Stand before a stream, e.g. sys.stdout."""
        self._stream = stream

    def __getattr__(self, name: str) -> object:
        """Return what the stream has under this name."""
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """Write text; nothing where the reader is gone."""
        try:
            return self._stream.write(text)
        except BrokenPipeError:
            self._discard()
            return len(text)

    def flush(self) -> None:
        """Flush the stream; nothing where the reader is gone."""
        try:
            self._stream.flush()
        except BrokenPipeError:
            self._discard()

    def _discard(self) -> None:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, self._stream.fileno())
        os.close(nowhere)
