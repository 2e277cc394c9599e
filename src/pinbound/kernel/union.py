"""Several kernels of one set, each for some of its boundaries."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pinbound.kernel.arguments import Backend, check_choices, real, rows_buffer, take_smaller
from pinbound.kernel.engine import Kernel
from pinbound.kernel.program import Pair
from pinbound.typing import AnyArray as Array
from pinbound.typing import Flags, Indices, Ints
from pinbound.values import read_only

__all__ = ["UnionKernel"]


class UnionKernel:
    """Evaluates a set as `Kernel` does, in parts."""

    def __init__(self, pairs: Sequence[Pair], parts: Sequence[tuple[Kernel, Indices]]) -> None:
        """Store all pairs, and kernels with the indices of their pairs; each pair has one kernel."""
        self.pairs, self.parts = tuple(pairs), tuple(parts)
        self.n, self.reference = parts[0][0].n, parts[0][0].reference

    @cached_property
    def thresholds(self) -> NDArray[np.float64]:
        """(m,) [m]."""
        return read_only(np.array([pair.threshold for pair in self.pairs]))

    def one(self, q: NDArray[np.float64], mode: Literal["norms", "clearances"]) -> NDArray[np.float64] | None:
        """Return norms or clearances (m,) of one configuration; None if a part cannot compute them."""
        result = np.empty(len(self.pairs))
        for kernel, places in self.parts:
            found = kernel.one(q, mode)
            if found is None:
                return None
            result[places] = found
        return result

    def prepare(self, mode: str = "norms", dtype: Any = np.float64) -> str:
        """Compile or load a mode now, and return the backend that it will run on."""
        return [kernel.prepare(mode, dtype) for kernel, _ in self.parts].pop()

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
        result = rows_buffer(out, Q, len(self.pairs), self.n, mode, real(dtype))
        for kernel, places in self.parts:
            result[:, places] = kernel.rows(Q, mode, None, threads, backend, dtype)
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
        (first, places), *others = self.parts
        least, index = first.smallest(Q, with_index, out, threads, backend, dtype)
        index = np.append(places, -1)[index] if with_index else index
        for kernel, places in others:
            found, which = kernel.smallest(Q, with_index, None, threads, backend, dtype)
            smaller = take_smaller(least, found)
            if with_index:
                index = np.where(smaller, np.append(places, -1)[which], index)
        return least, index

    def free(self, Q: NDArray[np.float64], threads: int = 1, backend: Backend = "auto") -> Flags:
        """Return which rows (N,) have only positive clearances."""
        found = np.ones(len(Q), dtype=np.bool_)
        for kernel, _ in self.parts:
            found &= kernel.free(Q, threads, backend)
        return found
