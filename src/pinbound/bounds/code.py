"""Machine code of a search for contact, which is loaded or compiled after enough work."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pinbound.machine.compiled import KernelSource, MachineCode, compile_source, is_kept
from pinbound.typing import Array, Ints

__all__ = ["Code"]

_COMPILING = 10.0  # seconds that must remain for compiling, on a busy machine
_NO_INDEX = np.empty(0, dtype=np.int64)


class Code:
    """Machine code that is loaded or compiled after enough work."""

    def __init__(self, source: Callable[[], KernelSource], loading: int = 1_000, compiling: int = 300_000) -> None:
        """Begin without machine code.

        Args:
            source: Returns the source text.
            loading: Number of boxes that take NumPy as long as loading the code, 20 ms.
            compiling: Number of boxes that take NumPy as long as compiling the code, one second.
        """
        self.source, self.work, self.loading, self.compiling = source, 0, loading, compiling
        self.code: MachineCode | None = None
        self.kept: bool | None = None

    def is_worth(self, boxes: int, seconds: float) -> bool:
        """Count boxes to come, and return whether to use the code; `seconds` remain for the whole work."""
        self.work += boxes
        if self.code is not None:
            return True
        if self.work >= self.compiling and seconds >= _COMPILING:
            return True
        if self.work < self.loading:
            return False
        if self.kept is None:  # checked once, because it takes some 8 ms
            self.kept = is_kept(self.source())
        return self.kept

    def load(self) -> MachineCode:
        """Load or compile the code now, and return it."""
        if self.code is None:
            self.code = compile_source(self.source())
        return self.code

    def run(
        self, question: Array, out: Array, row: int, column: int, table: Array, count: int, index: Ints = _NO_INDEX
    ) -> int:
        """Run it; it returns a whole number."""
        code = self.load()
        address = [array.__array_interface__["data"][0] for array in (question, out, index, table)]
        return int(code.function(*address[:2], row, column, *address[2:], count))
