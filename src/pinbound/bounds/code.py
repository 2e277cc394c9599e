"""Machine code of a search for contact, that is loaded, or compiled, once there was enough to do for it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pinbound.machine.compiled import KernelSource, MachineCode, compile_source, is_kept
from pinbound.typing import Array, Ints

__all__ = ["Code"]

_COMPILING = 10.0  # seconds that must be left for it, on a machine that is busy
_NO_INDEX = np.empty(0, dtype=np.int64)


class Code:
    """Machine code that is loaded, or compiled, once there is enough to do for it."""

    def __init__(self, source: Callable[[], KernelSource], loading: int = 1_000, compiling: int = 300_000) -> None:
        """Begin without.

        Args:
            source: Returns the text.
            loading: Boxes that take NumPy as long as it takes to load the code, 20 ms.
            compiling: Boxes that take NumPy as long as it takes to compile it, a second.
        """
        self.source, self.work, self.loading, self.compiling = source, 0, loading, compiling
        self.code: MachineCode | None = None
        self.kept: bool | None = None

    def is_worth(self, boxes: int, seconds: float) -> bool:
        """Count boxes to come, and say whether the code is there, or worth it; `seconds` are left for the whole."""
        self.work += boxes
        if self.code is not None:
            return True
        if self.work >= self.compiling and seconds >= _COMPILING:
            return True
        if self.work < self.loading:
            return False
        if self.kept is None:  # asked once: it takes some 8 ms
            self.kept = is_kept(self.source())
        return self.kept

    def load(self) -> MachineCode:
        """Return the code, loaded or compiled now."""
        if self.code is None:
            self.code = compile_source(self.source())
        return self.code

    def run(
        self, question: Array, out: Array, row: int, column: int, table: Array, count: int, index: Ints = _NO_INDEX
    ) -> int:
        """Ask it; it returns a whole number."""
        code = self.load()
        address = [array.__array_interface__["data"][0] for array in (question, out, index, table)]
        return int(code.function(*address[:2], row, column, *address[2:], count))
