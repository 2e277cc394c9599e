"""Output to a pipe whose reader stops reading (`pinbound info ROBOT | head`)."""

from __future__ import annotations

import os
from typing import TextIO

__all__ = ["Unread"]


class Unread:
    """A text stream that discards output after its reader has closed the pipe.

    The command then runs to its end, and its exit code is that of its result (0 or 1), not that of a broken pipe. All
    other attributes are those of the wrapped stream.
    """

    def __init__(self, stream: TextIO) -> None:
        """Wrap a stream, e.g. sys.stdout."""
        self._stream = stream

    def __getattr__(self, name: str) -> object:
        """Return the attribute of the wrapped stream."""
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """Write text; discard it if the reader has closed the pipe."""
        try:
            return self._stream.write(text)
        except BrokenPipeError:
            self._discard()
            return len(text)

    def flush(self) -> None:
        """Flush the stream; discard the output if the reader has closed the pipe."""
        try:
            self._stream.flush()
        except BrokenPipeError:
            self._discard()

    def _discard(self) -> None:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, self._stream.fileno())
        os.close(nowhere)
