"""A set with boundaries whose nearest points need a search: hulls, boxes, prisms.

The search has branches, so it has its own machine code (`hulls`). Without Numba, or with too little work, the reference
interpreter does it. All other boundaries of the set run in the kernel.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pinbound.kernel.arguments import (
    Backend,
    check_choices,
    in_threads,
    real,
    representable,
    rows_buffer,
    take_smaller,
)
from pinbound.kernel.ball_kernel import BallKernel, longest
from pinbound.kernel.choice import notice_without_numba
from pinbound.kernel.engine import Kernel
from pinbound.kernel.hulls import HullTables, is_ready, prepare_hulls, tables_of
from pinbound.kernel.program import CommonMark, Pair, Reference
from pinbound.kernel.union import UnionKernel
from pinbound.machine.compiled import has_numba
from pinbound.tolerances import LONGEST, LONGEST_SINGLE
from pinbound.typing import AnyArray as Array
from pinbound.typing import Flags, Indices, Ints

__all__ = ["MANY_POINTS", "MixedKernel", "kernel_of"]


_WORTH_LOADING, _WORTH_COMPILING = 1_000, 300_000
"""Searches (pairs times rows) from which loading machine code (20 ms), or compiling it (some seconds), saves time."""

MANY_POINTS = 64
"""From this number of pairs of points on, tables (compiled once on a machine) are better than expressions for each
pair."""

_FARTHEST = 1e300
"""Rows with larger coordinates, whose sums may overflow, are computed by the reference."""


def kernel_of(
    pairs: Sequence[Pair],
    n: int,
    reference: Reference,
    common: Callable[[], Mapping[str, CommonMark] | None],
) -> Kernel | UnionKernel | MixedKernel:
    """Return the kernel of a set; arguments as for `Kernel`."""
    searched = [not pair.path.is_expression for pair in pairs]
    if not any(searched):
        return _straight(pairs, n, reference, common)
    easy = [pair for pair, is_searched in zip(pairs, searched, strict=True) if not is_searched]
    return MixedKernel(_straight(easy, n, reference, common), tuple(pairs), np.flatnonzero(searched))


def _straight(
    pairs: Sequence[Pair], n: int, reference: Reference, common: Callable[[], Mapping[str, CommonMark] | None]
) -> Kernel | UnionKernel:
    """Return the kernel of pairs in closed form: tables for many points, one program for all others."""
    plain = np.array([pair.path.is_plain for pair in pairs], dtype=np.bool_)
    marks = common() if np.count_nonzero(plain) >= MANY_POINTS else None
    if marks is None or longest(mark.spot for mark in marks.values() if mark.spot) > LONGEST_SINGLE:
        return Kernel(pairs, n, reference, common)
    kinds = [(kind, np.flatnonzero(which)) for kind, which in ((BallKernel, plain), (Kernel, ~plain)) if np.any(which)]
    parts = [(kind([pairs[k] for k in places.tolist()], n, reference, common), places) for kind, places in kinds]
    return parts[0][0] if len(parts) == 1 else UnionKernel(pairs, parts)


class MixedKernel:
    """Evaluates a set as `Kernel` does; a search finds the nearest points of some boundaries."""

    def __init__(self, kernel: Kernel | UnionKernel, pairs: tuple[Pair, ...], searched: Indices) -> None:
        """Store the kernel of all pairs except those with the indices `searched`."""
        self.kernel, self.pairs, self.searched = kernel, pairs, searched
        self.n = kernel.n
        self._compiled = np.setdiff1d(np.arange(len(pairs)), searched)
        self._searches = 0

    @cached_property
    def thresholds(self) -> NDArray[np.float64]:
        """(m,) [m]."""
        return np.array([pair.threshold for pair in self.pairs])

    @cached_property
    def _hulls(self) -> HullTables | None:
        """The searched boundaries as tables; None if some of them are not rigid bodies for the search."""
        return tables_of(self._searched_pairs, self.n)

    @cached_property
    def _searched_pairs(self) -> list[Pair]:
        return [self.pairs[int(k)] for k in self.searched]

    @cached_property
    def _farthest(self) -> NDArray[np.float64]:
        """(n,) the largest |q_j| for machine code: no square of a prismatic displacement overflows."""
        sums = [np.linalg.norm(pair.minimal.slides, axis=1).sum(axis=0) for pair in self._searched_pairs]
        rates = np.max(np.array(sums).reshape(len(sums), self.n), axis=0, initial=0.0)
        return np.where(rates > 0.0, LONGEST / (self.n * np.maximum(rates, 1e-100)), _FARTHEST)

    def one(self, q: NDArray[np.float64], mode: Literal["norms", "clearances"]) -> NDArray[np.float64] | None:
        """Return norms or clearances (m,) of one configuration."""
        return self.rows(q[None], mode)[0]

    def prepare(self, mode: str = "norms", dtype: Any = np.float64) -> str:
        """Compile or load a mode now, and return the backend that it will run on."""
        chosen = self.kernel.prepare(mode, dtype) if len(self._compiled) else "compiled"
        if self._hulls is None or not has_numba():
            return chosen if len(self._compiled) else "numpy"
        prepare_hulls()
        return chosen

    def _runs_compiled(self, rows: int, backend: Backend) -> bool:
        """Count searches, and return whether they use machine code."""
        if backend == "numpy" or not rows or self._hulls is None:
            return False
        self._searches += rows * len(self.searched)
        if backend == "compiled":
            return True
        if self._searches >= _WORTH_COMPILING:
            notice_without_numba()
        worth = self._searches >= _WORTH_COMPILING or (self._searches >= _WORTH_LOADING and is_ready())
        return has_numba() and worth

    def _search(self, Q: NDArray[np.float64], mode: str, threads: int, backend: Backend) -> tuple[Array, Array]:
        """Return the results of `mode` for the searched boundaries (a row for each q), and indices of the smallest."""
        found, places = np.empty((0, 0)), np.zeros(len(Q), dtype=np.int64)
        bad: Indices = np.arange(len(Q))
        if self._runs_compiled(len(Q), backend) and self._hulls is not None:
            tables, data = self._hulls, np.require(Q, np.float64, ["C", "A"])
            width = len(self.searched) * (self.n if mode == "gradients" else 1)
            found = np.empty((len(Q), 1 if mode == "smallest" else width))

            def work(lo: int, hi: int) -> int:
                return tables.run(data[lo:hi], mode, found[lo:hi], places[lo:hi])

            used = list(tables.columns)
            in_threads(work, len(Q), threads)
            bad = np.flatnonzero(~np.all(np.abs(Q[:, used]) <= self._farthest[used], axis=1))
            if not len(bad):
                return found, places
        with np.errstate(over="ignore", invalid="ignore"):
            rows = [self._by_reference(pair, Q[bad], mode) for pair in self._searched_pairs]
        if mode == "smallest":
            clearances = np.column_stack(rows)
            index = np.argmin(clearances, axis=1)  # the first NaN, if there is one
            values, places[bad] = clearances[np.arange(len(bad)), index][:, None], index
        else:
            values = np.stack(rows, axis=1).reshape(len(bad), -1)
        if len(bad) == len(Q):
            return values, places
        found[bad] = values
        return found, places

    def _by_reference(self, pair: Pair, Q: NDArray[np.float64], mode: str) -> NDArray[np.float64]:
        reference = self.kernel.reference
        if mode == "gradients":
            return reference.gradients(pair.path, Q)
        return reference.norms(pair.path, Q) - (0.0 if mode == "norms" else pair.threshold)

    def rows(
        self,
        Q: NDArray[np.float64],
        mode: Literal["norms", "clearances", "gradients"],
        out: Array | None = None,
        threads: int = 1,
        backend: Backend = "auto",
        dtype: Any = np.float64,
    ) -> Array:
        """Return norms or clearances (N, m), or gradients (N, m, n)."""
        check_choices(threads, backend)
        kind = real(dtype)
        result = rows_buffer(out, Q, len(self.pairs), self.n, mode, kind)
        if len(self._compiled):
            result[:, self._compiled] = self.kernel.rows(Q, mode, None, threads, backend, dtype)
        found, _ = self._search(representable(Q, kind), mode, threads, backend)
        result[:, self.searched] = found.reshape(len(Q), len(self.searched), *result.shape[2:])
        return result

    def smallest(
        self,
        Q: NDArray[np.float64],
        with_index: bool = True,
        out: Array | None = None,
        threads: int = 1,
        backend: Backend = "auto",
        dtype: Any = np.float64,
    ) -> tuple[Array, Ints]:
        """Return each row's smallest clearance (N,) and which boundary has it (N,); NaN and -1 if one is NaN."""
        least, index = self.kernel.smallest(Q, with_index, out, threads, backend, dtype)
        if with_index:
            index = np.where(index < 0, -1, np.append(self._compiled, -1)[index])
        found, places = self._search(representable(Q, real(dtype)), "smallest", threads, backend)
        smaller = take_smaller(least, found[:, 0])
        if with_index:
            index = np.where(smaller, self.searched[places], index)
            index[np.isnan(least)] = -1
        return least, index

    def free(self, Q: NDArray[np.float64], threads: int = 1, backend: Backend = "auto") -> Flags:
        """Return which rows (N,) have only positive clearances."""
        found = self.kernel.free(Q, threads, backend) if len(self._compiled) else np.ones(len(Q), dtype=np.bool_)
        rows = np.flatnonzero(found)  # rows in contact need no search
        if len(rows):
            clearance, _ = self._search(np.ascontiguousarray(Q[rows]), "smallest", threads, backend)
            found[rows] = clearance[:, 0] > 0.0
        return found
