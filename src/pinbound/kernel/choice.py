"""The backend of a call if the user does not choose one: it depends on counted work, and on the cache.

Nothing is timed, so the same calls always use the same backend. The work of each call is counted as the time that NumPy
would need for it on a common machine, and summed over the calls of a kernel:

1. Machine code that this process has loaded is used.
2. Machine code in the cache folder is loaded on the second call, or earlier, on a first call with enough work.
3. Otherwise code is compiled when the work so far, with this call, is worth `PAYS` times the compilation.

So a call is slower than NumPy by at most one loading, or one compilation, once for each kernel and kind of answer. For
the first call of a process this holds only if NumPy would have needed longer. All calls together take at most `1 + 1 /
PAYS` of NumPy's time, and one loading. `docs/kernel.md` derives the bound.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field

from pinbound.machine.compiled import KernelSource, has_numba, is_kept

__all__ = ["Choice", "Work", "notice_without_numba"]

PAYS = 1.5
"""How many times NumPy's work must exceed a compilation: the allowed error of the estimates below."""

_OPERATION = 2.2e-10
"""Seconds that NumPy needs for one counted operation of one row."""

_CALL = 0.8e-6
"""Seconds that NumPy needs to start one node, for any number of rows."""

_COMPILE = 0.9
"""Seconds to compile anything: mostly Numba's import."""

_COMPILE_NODE = 1.2e-3
"""Seconds to compile each node."""

_LOAD = 0.02
"""Seconds to load machine code: reading, checking and linking it."""

_LOAD_NODE = 0.6e-4
"""Seconds for each node to write the source, whose hash is the name of the code, and to link it."""

_WORTH_LOADING = 1e-4
"""Seconds of work from which a second call loads code from the cache."""

_logger = logging.getLogger("pinbound")
_noticed: list[str] = []


@dataclass(frozen=True)
class Work:
    """The work of one call.

    Attributes:
        rows: Number of configurations.
        cost: Counted operations for one configuration.
        nodes: Number of expressions of the program.
        code: Seconds to compile it, if they do not depend on the nodes.
        load: Seconds to load it, likewise.
    """

    rows: int
    cost: float
    nodes: int
    code: float | None = None
    load: float | None = None

    @property
    def seconds(self) -> float:
        """An estimate of NumPy's time for it."""
        return self.rows * self.cost * _OPERATION + self.nodes * _CALL

    @property
    def compilation(self) -> float:
        """Seconds to compile it."""
        return self.code if self.code is not None else _COMPILE + self.nodes * _COMPILE_NODE

    @property
    def loading(self) -> float:
        """Seconds to load it from the cache."""
        return self.load if self.load is not None else _LOAD + self.nodes * _LOAD_NODE


@dataclass
class Choice:
    """Counts the work of one kernel, separately for each kind of answer."""

    spent: dict[Hashable, float] = field(default_factory=dict[Hashable, float])
    _kept: dict[Hashable, bool] = field(default_factory=dict[Hashable, bool])

    def compiles(self, kind: Hashable, work: Work, source: Callable[[], KernelSource]) -> bool:
        """Count a call, and return whether it runs compiled; no code of this kind is loaded yet.

        Args:
            kind: The kind of answer.
            work: The work of this call.
            source: Returns the source, whose code may be in the cache.
        """
        before = self.spent.get(kind)
        total = self.spent[kind] = (before or 0.0) + work.seconds
        if total >= PAYS * work.compilation:
            notice_without_numba()
            return has_numba()
        if not has_numba():
            return False
        is_next = before is not None and total >= _WORTH_LOADING
        if not is_next and work.seconds < PAYS * work.loading:
            return False
        if kind not in self._kept:
            self._kept[kind] = is_kept(source())
        return self._kept[kind]


def notice_without_numba() -> None:
    """Tell the user once in a process that Numba would make large batches faster."""
    text = "pinbound: large batches run in NumPy, about 6 times slower than with Numba: pip install 'pinbound[fast]'"
    if not has_numba() and text not in _noticed:
        _noticed.append(text)
        _logger.warning(text)
