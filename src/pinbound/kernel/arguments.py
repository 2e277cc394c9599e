"""The arguments of every call of a kernel, checked before any work: types, buffers, threads, the backend's name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, cast

import numpy as np
from numpy.exceptions import TooHardError
from numpy.typing import NDArray

from pinbound.checks import whole_number
from pinbound.exceptions import DimensionError, UnknownNameError, UnsupportedError
from pinbound.machine.compiled import has_numba
from pinbound.typing import AnyArray as Array
from pinbound.typing import Flags

__all__ = [
    "BACKENDS",
    "Backend",
    "buffer",
    "check_choices",
    "in_threads",
    "real",
    "representable",
    "rows_buffer",
    "take_smaller",
]

Backend = Literal["auto", "compiled", "numpy"]

BACKENDS = ("auto", "compiled", "numpy")

_MOST_WORK = 10_000
"""Steps of NumPy's exact test for shared memory; arrays that need more count as overlapping."""


def in_threads(work: Callable[[int, int], int], rows: int, threads: int) -> int:
    """Split rows over threads, and return the sum of the results of the work on each range of rows."""
    count = max(1, min(threads, rows))
    if count == 1:
        return work(0, rows)
    from concurrent.futures import ThreadPoolExecutor

    ends = [round(rows * part / count) for part in range(count + 1)]
    with ThreadPoolExecutor(count) as pool:
        return sum(pool.map(work, ends[:-1], ends[1:]))


def real(dtype: Any) -> np.dtype[Any]:
    """Return float64 or float32.

    Raises:
        DimensionError: If it is neither.
    """
    kind = np.dtype(dtype)
    if kind not in (np.dtype(np.float64), np.dtype(np.float32)):
        raise DimensionError(f"dtype is {kind}; give float64 or float32")
    return kind


def check_choices(threads: Any, backend: Any) -> None:
    """Refuse an invalid number of threads or backend.

    Raises:
        DimensionError: If `threads` is not a whole number of at least 1.
        UnknownNameError: If there is no such backend.
        UnsupportedError: If compiled code is requested, and Numba is not installed.
    """
    whole_number(threads, "threads", 1)
    if backend not in BACKENDS:
        raise UnknownNameError("backend", str(backend), BACKENDS)
    if backend == "compiled" and not has_numba():
        raise UnsupportedError(
            "backend 'compiled' needs Numba; type: pip install 'pinbound[fast]', or leave the choice to 'auto'"
        )


def representable(Q: Array, dtype: np.dtype[Any]) -> NDArray[np.float64]:
    """Return Q in float64, NaN where a number is not finite in `dtype`: beyond 3.4e38 in float32."""
    rows = np.array(Q, dtype=np.float64)
    rows[~(np.abs(rows) <= np.finfo(dtype).max)] = np.nan
    return rows


def rows_buffer(out: Any, Q: Array, m: int, n: int, mode: str, dtype: np.dtype[Any]) -> Array:
    """Return the array for norms or clearances (N, m), or gradients (N, m, n), as `buffer` does."""
    shape = (len(Q), m, n) if mode == "gradients" else (len(Q), m)
    return buffer(out, shape, dtype, columns=mode != "gradients", source=Q)


def take_smaller(least: Array, found: Array) -> Flags:
    """Write values of `found` (N,) that are smaller over `least` (N,), and return where; a NaN is taken, and stays."""
    smaller: Flags = ~(found >= least) & ~np.isnan(least)
    np.copyto(least, found, where=smaller, casting="same_kind")
    return smaller


def buffer(out: Any, shape: tuple[int, ...], dtype: np.dtype[Any], columns: bool, source: Array) -> Array:
    """Return `out` if it fits, or a new array.

    Rows are written in blocks while others are still to be read. So `out` must not share memory with the configurations
    `source`, and none of its elements with another.

    Raises:
        DimensionError: If out has another shape or type, cannot be written, or shares memory.
    """
    if out is None:
        return np.empty(shape, dtype=dtype, order="F" if columns else "C")
    given: NDArray[Any] | None = cast(Any, out) if isinstance(out, np.ndarray) else None
    if given is None or given.shape != shape or given.dtype != dtype or not given.flags.writeable:
        found = "no array" if given is None else f"{given.dtype} {given.shape}"
        frozen = "read-only " if given is not None and not given.flags.writeable else ""
        raise DimensionError(f"out is {frozen}{found}; give a writeable {dtype} array of shape {shape}")
    if _shares(given, source):
        raise DimensionError(
            "out shares memory with q, which is still read while out is written; give an array of its own"
        )
    if _overlaps_itself(given):
        raise DimensionError(f"out holds one number in several places (strides {given.strides}); give a plain array")
    return given


def _shares(out: Array, source: Array) -> bool:
    if not np.may_share_memory(out, source):
        return False
    try:
        return cast(Any, np).shares_memory(out, source, max_work=_MOST_WORK)
    except TooHardError:
        return True


def _overlaps_itself(out: Array) -> bool:
    """Return whether two elements may share memory: a stride is at most the span of all shorter strides."""
    if not out.size:
        return False
    span = out.itemsize
    for stride, count in sorted((abs(stride), count) for stride, count in zip(out.strides, out.shape, strict=True)):
        if count > 1 and stride < span:
            return True
        span += stride * (count - 1)
    return False
