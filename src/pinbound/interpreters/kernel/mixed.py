"""A set in which some boundaries cannot be compiled: those of boxes and prisms are taken from the reference.

The nearest point of two bodies with more than two ways between them is searched for (`interpreters.minimum_norm`),
which is no straight line of code. All other boundaries of the set still run in the kernel.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pinbound.interpreters.kernel.engine import Backend, Kernel, buffer, check_choices, real, representable
from pinbound.interpreters.kernel.program import CommonMark, Pair, Reference

__all__ = ["MixedKernel", "kernel_of"]

Array = NDArray[Any]

_MOST_WAYS = 2


def kernel_of(
    pairs: Sequence[Pair],
    n: int,
    reference: Reference,
    common: Callable[[], Mapping[str, CommonMark] | None],
) -> Kernel | MixedKernel:
    """Return the kernel of a set; arguments as for `Kernel`."""
    searched = [_is_searched(pair) for pair in pairs]
    if not any(searched):
        return Kernel(pairs, n, reference, common)
    easy = [pair for pair, is_searched in zip(pairs, searched, strict=True) if not is_searched]
    return MixedKernel(Kernel(easy, n, reference, common), tuple(pairs), np.flatnonzero(searched))


def _is_searched(pair: Pair) -> bool:
    swept = pair.path.swept
    return not swept.is_zonotope or (len(swept.directions) > _MOST_WAYS and not pair.path.is_signed)


class MixedKernel:
    """Evaluates a set as `Kernel` does, some boundaries of it by the reference interpreter."""

    def __init__(self, kernel: Kernel, pairs: tuple[Pair, ...], searched: NDArray[np.intp]) -> None:
        """Hold the kernel of all pairs but those at the places `searched`."""
        self.kernel, self.pairs, self.searched = kernel, pairs, searched
        self.n = kernel.n
        self._compiled = np.setdiff1d(np.arange(len(pairs)), searched)

    @cached_property
    def thresholds(self) -> NDArray[np.float64]:
        """(m,) [m]."""
        return np.array([pair.threshold for pair in self.pairs])

    def one(self, q: NDArray[np.float64], mode: Literal["norms", "clearances"]) -> NDArray[np.float64] | None:
        """Return norms or clearances (m,) of one configuration."""
        return self.rows(q[None], mode)[0]

    def prepare(self, mode: str = "norms", dtype: Any = np.float64) -> str:
        """Compile or load a mode now, and return the backend that it will run on."""
        return self.kernel.prepare(mode, dtype) if len(self._compiled) else "numpy"

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
        m = len(self.pairs)
        shape = (len(Q), m, self.n) if mode == "gradients" else (len(Q), m)
        check_choices(threads, backend)
        kind = real(dtype)
        result = buffer(out, shape, kind, columns=mode != "gradients", source=Q)
        result[:, self._compiled] = self.kernel.rows(Q, mode, None, threads, backend, dtype)
        reference, Q = self.kernel.reference, representable(Q, kind)
        for k in map(int, self.searched):
            pair = self.pairs[k]
            if mode == "gradients":
                result[:, k] = reference.gradients(pair.path, Q)
            else:
                result[:, k] = reference.norms(pair.path, Q) - (pair.threshold if mode == "clearances" else 0.0)
        return result

    def smallest(
        self,
        Q: NDArray[np.float64],
        with_index: bool = True,
        out: Array | None = None,
        threads: int = 1,
        backend: Backend = "auto",
        dtype: Any = np.float64,
    ) -> tuple[Array, NDArray[np.int64]]:
        """Return each row's smallest clearance (N,) and which boundary has it (N,); NaN and -1 if one is NaN."""
        least, index = self.kernel.smallest(Q, with_index, out, threads, backend, dtype)
        Q = representable(Q, real(dtype))
        if with_index:
            index = np.where(index < 0, -1, np.append(self._compiled, -1)[index])
        for k in map(int, self.searched):
            clearance = self.kernel.reference.norms(self.pairs[k].path, Q) - self.pairs[k].threshold
            smaller = ~(clearance >= least) & ~np.isnan(least)  # a NaN is taken, and stays
            np.copyto(least, clearance, where=smaller, casting="same_kind")
            if with_index:
                index = np.where(smaller, k, index)
        if with_index:
            index[np.isnan(least)] = -1
        return least, index
