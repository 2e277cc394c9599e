"""Which backend a call takes where the user leaves it open: by counted work, and by what lies in the cache.

Nothing is timed, so that the same calls always run on the same backend. The work of each call is counted as the time
that NumPy would need for it on a common machine, and added up over the calls of a kernel:

1. Machine code that this process holds is used.
2. Machine code that the cache folder holds is loaded on the second call, or on the first one that is worth it.
3. Otherwise code is compiled when the work so far, this call included, would have paid for it `PAYS` times.

So a call is slower than NumPy by one loading, or one compilation, at most, once a kernel and kind of answer; the first
call of a process only where NumPy would have needed longer than that; and all calls together never take more than
`1 + 1 / PAYS` of NumPy's time, and one loading. `docs/kernel.md` derives the bound.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field

from pinbound.machine.compiled import KernelSource, has_numba, is_kept

__all__ = ["Choice", "Work", "notice_without_numba"]

PAYS = 1.5
"""How many times NumPy's work has to be worth a compilation: what the estimates below may be wrong by."""

_OPERATION = 2.2e-10
"""Seconds that NumPy needs for one counted operation of one row."""

_CALL = 0.8e-6
"""Seconds that NumPy needs to begin with one node, however few the rows are."""

_COMPILE = 0.9
"""Seconds to compile anything: mostly Numba's import."""

_COMPILE_NODE = 1.2e-3
"""Seconds to compile one node more."""

_LOAD = 0.02
"""Seconds to load machine code: reading, checking and linking it."""

_LOAD_NODE = 0.6e-4
"""Seconds a node to write the source, whose hash is the name of the code, and to link it."""

_WORTH_LOADING = 1e-4
"""Seconds of work from which a second call loads what is kept."""

_logger = logging.getLogger("pinbound")
_noticed: list[str] = []


@dataclass(frozen=True)
class Work:
    """What one call asks for.

    Attributes:
        rows: How many configurations.
        cost: Counted operations a configuration.
        nodes: How many expressions the program has.
        code: Seconds to compile it, where that does not depend on the nodes.
        load: Seconds to load it, the same.
    """

    rows: int
    cost: float
    nodes: int
    code: float | None = None
    load: float | None = None

    @property
    def seconds(self) -> float:
        """About what NumPy needs for it."""
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
    """Counts the work of one kernel, one entry a kind of answer."""

    spent: dict[Hashable, float] = field(default_factory=dict[Hashable, float])
    _kept: dict[Hashable, bool] = field(default_factory=dict[Hashable, bool])

    def compiles(self, kind: Hashable, work: Work, source: Callable[[], KernelSource]) -> bool:
        """Count a call, and return whether it runs compiled; no code of this kind is loaded yet.

        Args:
            kind: Of answer.
            work: Of this call.
            source: Gives the source, whose code may be kept.
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
    """Say once a process that Numba would make large batches faster."""
    text = "pinbound: large batches run in NumPy, about 6 times slower than with Numba: pip install 'pinbound[fast]'"
    if not has_numba() and text not in _noticed:
        _noticed.append(text)
        _logger.warning(text)
