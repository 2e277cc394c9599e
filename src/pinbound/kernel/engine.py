"""The kernel of a boundary set: picks the backend, checks buffers, splits rows over threads."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any, Literal, cast

import numpy as np
from numpy.exceptions import TooHardError
from numpy.typing import NDArray

from pinbound.exceptions import DimensionError, UnknownNameError, UnsupportedError
from pinbound.kernel.program import CommonMark, Pair, Program, Reference, compile_program
from pinbound.kernel.source import kernel_source, scalar_source
from pinbound.kernel.vectorised import LinearProgram, VectorisedProgram
from pinbound.machine.compiled import MachineCode, compile_source, has_numba
from pinbound.tolerances import LONGEST, LONGEST_SINGLE
from pinbound.typing import AnyArray as Array
from pinbound.typing import Ints
from pinbound.values import read_only

__all__ = [
    "BACKENDS",
    "Backend",
    "Kernel",
    "buffer",
    "check_choices",
    "in_threads",
    "notice_without_numba",
    "real",
    "representable",
]

Backend = Literal["auto", "compiled", "numpy"]

BACKENDS = ("auto", "compiled", "numpy")

_WORTH_COMPILING = 3e7
"""Counted operations (rows times cost) from which a first compile, about a second, pays in NumPy time saved."""

_ROWS_PER_THREAD = 4096
"""Fewer rows than this a thread, and starting the thread costs more than it saves."""

_MOST_WORK = 10_000
"""Steps of NumPy's exact test for shared memory; arrays that need more are taken to overlap."""

_logger = logging.getLogger("pinbound")
_noticed: list[str] = []


class Kernel:
    """Evaluates a set of boundaries. Made once a set; backends are compiled when first needed.

    Values agree between backends, and with the reference interpreter, to rounding: 1e-12 relative, and 1e-15 of
    the length of the paths near contact.
    """

    def __init__(
        self,
        pairs: Sequence[Pair],
        n: int,
        reference: Reference,
        common: Callable[[], Mapping[str, CommonMark] | None],
        program: Program | None = None,
    ) -> None:
        """Hold what to evaluate.

        Args:
            pairs: The boundaries.
            n: Number of active coordinates.
            reference: Gives rows that are not finite.
            common: Returns each mark's chains in one common frame, or None.
            program: The expressions, where they are not those of the pairs' separations.
        """
        self.pairs, self.n = tuple(pairs), n
        self.reference, self._common = reference, common
        self._scalar: dict[str, Callable[..., list[float]]] = {}
        self._compiled: dict[tuple[str, bool], MachineCode] = {}
        if program is not None:
            self.__dict__["program"] = program

    def __getstate__(self) -> dict[str, Any]:
        """Leave machine code out; the receiver compiles or loads its own."""
        return {"pairs": self.pairs, "n": self.n, "program": self.program, "reference": self.reference}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore what `__getstate__` kept."""
        self.__init__(state["pairs"], state["n"], state["reference"], _no_common, state["program"])

    @cached_property
    def program(self) -> Program:
        """The expressions, local or common, whichever is cheaper."""
        return compile_program(self.pairs, self.n, self._common())

    @cached_property
    def cost(self) -> float:
        """Counted operations a configuration."""
        return self.program.graph.cost(self.program.squares) + 8.0 * len(self.pairs)

    @cached_property
    def thresholds(self) -> NDArray[np.float64]:
        """(m,) [m]."""
        return read_only(np.array([pair.threshold for pair in self.pairs]))

    @cached_property
    def _used(self) -> list[int]:
        graph = self.program.graph
        nodes = [graph.nodes[number] for number in graph.reachable(self.program.squares)]
        used = {node.args[0] for node in nodes if node.kind == "coordinate"}
        for node in nodes:
            if node.kind in ("cos", "sin"):
                used |= {j for j, c in enumerate(graph.angles[node.args[0]]) if c}
        return sorted(used)

    def one(self, q: NDArray[np.float64], mode: Literal["norms", "clearances"]) -> NDArray[np.float64] | None:
        """Return norms or clearances (m,) of one finite configuration by plain Python; None if it is not finite."""
        function = self._scalar.get(mode)
        if function is None:
            namespace: dict[str, Any] = {"sqrt": math.sqrt, "cos": math.cos, "sin": math.sin}
            exec(scalar_source(self.program, mode), namespace)  # our own text, from numbers alone
            function = self._scalar[mode] = namespace["function"]
        values = q.tolist()
        if not all(map(math.isfinite, values)):
            return None
        found = function(*values)
        return np.array(found) if all(map(math.isfinite, found)) else None  # a square overflowed

    def rows(
        self,
        Q: NDArray[np.float64],
        mode: Literal["norms", "clearances", "gradients"],
        out: Array | None = None,
        threads: int = 1,
        backend: Backend = "auto",
        dtype: Any = np.float64,
    ) -> Array:
        """Return norms or clearances (N, m), or gradients (N, m, n); new arrays have contiguous columns."""
        m = len(self.pairs)
        shape = (len(Q), m, self.n) if mode == "gradients" else (len(Q), m)
        kind = self._kind(dtype, threads, backend)
        result = buffer(out, shape, kind, columns=mode != "gradients", source=Q)
        if not m or not len(Q):
            return result
        flat = result.reshape(len(Q), -1)
        if not np.shares_memory(flat, result):
            raise DimensionError("out is not laid out in memory as rows: give a C-contiguous array")
        self._run(Q, mode, flat, _NO_INDEX, threads, backend, kind)
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
        kind = self._kind(dtype, threads, backend)
        least = buffer(out, (len(Q),), kind, columns=False, source=Q)
        index = np.full(len(Q) if with_index else 0, -1, dtype=np.int64)
        if not self.pairs:
            least[:] = np.inf
        elif len(Q):
            self._run(Q, "smallest" if with_index else "least", least[:, None], index, threads, backend, kind)
        return least, index

    def prepare(self, mode: str = "norms", dtype: Any = np.float64) -> str:
        """Compile or load a mode now, and return the backend that it will run on."""
        if not has_numba():
            notice_without_numba()
            return "numpy"
        self._machine_code(mode, real(dtype) == np.float32)
        return "compiled"

    def _kind(self, dtype: Any, threads: int, backend: Backend) -> np.dtype[Any]:
        """Check all choices, and return the type of the numbers."""
        check_choices(threads, backend)
        kind = real(dtype)
        if kind == np.float32 and self._length > LONGEST_SINGLE:
            raise UnsupportedError(
                f"the paths are {self._length:.3g} m long, and products of lengths above {LONGEST_SINGLE:.0e} m "
                "overflow float32; use dtype=np.float64"
            )
        return kind

    @cached_property
    def _length(self) -> float:
        """The longest path before any joint slides [m]."""
        return max((pair.minimal.scale for pair in self.pairs), default=0.0)

    @cached_property
    def _rates(self) -> NDArray[np.float64]:
        """(n,) how far a unit of each coordinate can slide any path, summed over its blocks; 0 where none slides."""
        sums = [np.linalg.norm(pair.minimal.slides, axis=1).sum(axis=0) for pair in self.pairs]
        return np.max(np.array(sums).reshape(-1, self.n), axis=0, initial=0.0)

    def _regular(self, kind: np.dtype[Any]) -> NDArray[np.float64]:
        """Return the largest |q_j| (used,) that the machine code may take: finite, and no square overflows."""
        most = np.full(self.n, float(np.finfo(kind).max))
        slide = self._rates > 0.0
        longest = LONGEST if kind == np.float64 else LONGEST_SINGLE
        most[slide] = np.minimum(most[slide], longest / (self.n * np.maximum(self._rates[slide], 1e-100)))
        return most[self._used]

    def _run(
        self, Q: Array, mode: str, out: Array, index: Array, threads: int, backend: Backend, dtype: np.dtype[Any]
    ) -> None:
        is_single = dtype == np.float32
        work = self._work(Q, mode, out, index, backend, is_single)
        irregular = in_threads(work, len(Q), min(threads, max(1, len(Q) // _ROWS_PER_THREAD)))
        slides = np.flatnonzero(self._rates[self._used])
        if len(slides) and not irregular:
            irregular = not np.all(np.abs(Q[:, self._used][:, slides]) <= self._regular(dtype)[slides])
        if irregular:
            with np.errstate(all="ignore"):
                self._mend(Q, mode, out, index, dtype)

    def _work(
        self, Q: Array, mode: str, out: Array, index: Array, backend: Backend, is_single: bool
    ) -> Callable[[int, int], int]:
        """Return a function of a range of rows that fills them and returns how many numbers were not finite."""
        large = len(Q) * self.cost >= _WORTH_COMPILING
        compiled = backend == "compiled" or (
            backend == "auto" and has_numba() and (large or (mode, is_single) in self._compiled)
        )
        if compiled:
            function = self._machine_code(mode, is_single)
            with np.errstate(over="ignore"):  # what is too large becomes infinite, and is mended
                data = np.require(Q, np.float32 if is_single else np.float64, ["C", "A"])
            return lambda lo, hi: function(data[lo:hi], out[lo:hi], index[lo:hi])
        if large and backend == "auto":
            notice_without_numba()
        return lambda lo, hi: self._in_numpy(Q, mode, out, index, lo, hi)

    def _machine_code(self, mode: str, is_single: bool) -> MachineCode:
        key = (mode, is_single)
        if key not in self._compiled:
            self._compiled[key] = compile_source(kernel_source(self.program, mode, is_single))
        return self._compiled[key]

    @cached_property
    def _linear(self) -> LinearProgram | None:
        program = LinearProgram(self.program)
        return program if program.is_worthwhile else None

    @cached_property
    def _values(self) -> VectorisedProgram:
        return VectorisedProgram(self.program)

    @cached_property
    def _slopes(self) -> VectorisedProgram:
        return VectorisedProgram(self.program, gradients=True)

    def _in_numpy(self, Q: Array, mode: str, out: Array, index: Array, lo: int, hi: int) -> int:
        part, target = Q[lo:hi], out[lo:hi]

        def one(rows: slice, k: int, square: Any, dots: list[Any]) -> None:
            """Take one boundary's squares, and its `r . dr/dq_j`."""
            norm = square if self.program.signed[k] else np.sqrt(square)
            if mode == "gradients":
                for j, dot in enumerate(dots):
                    target[rows, k * self.n + j] = dot if self.program.signed[k] else dot / norm
            elif mode == "norms":
                target[rows, k] = norm
            elif mode == "clearances":
                target[rows, k] = norm - self.thresholds[k]
            else:
                clearance, least = norm - self.thresholds[k], target[rows, 0]
                smaller = np.broadcast_to(clearance < least if k else np.True_, least.shape)
                np.copyto(least, clearance, where=smaller, casting="same_kind")
                if mode == "smallest":
                    np.copyto(index[lo:hi][rows], k, where=smaller)

        def several(rows: slice, squares: Any) -> None:
            """Take all boundaries' squares."""
            if mode == "norms":
                np.sqrt(squares, out=target.T[:, rows], casting="same_kind")
                return
            np.sqrt(squares, out=squares)
            squares -= self.thresholds[:, None]
            if mode == "clearances":
                target.T[:, rows] = squares
                return
            target[rows, 0] = np.min(squares, axis=0)
            if mode == "smallest":
                index[lo:hi][rows] = np.argmin(squares, axis=0)

        if mode == "gradients":
            self._slopes.run(part, one)
        elif self._linear is not None:
            self._linear.run(part, several)
        else:
            self._values.run(part, one)
        return int(np.count_nonzero(~(np.abs(part[:, self._used]) <= np.finfo(out.dtype).max)))

    def _mend(self, Q: Array, mode: str, out: Array, index: Array, kind: np.dtype[Any]) -> None:
        """Take rows with numbers that are not finite, or too large, from the reference, boundary by boundary."""
        bad = np.flatnonzero(~np.all(np.abs(Q[:, self._used]) <= self._regular(kind), axis=1))
        rows, most = representable(Q[bad], kind), np.finfo(kind).max
        norms = np.column_stack([self.reference.norms(pair.path, rows) for pair in self.pairs])
        norms[~(np.abs(norms) <= most)] = np.nan
        if mode == "gradients":
            for k, pair in enumerate(self.pairs):
                slopes = np.array(self.reference.gradients(pair.path, rows))
                slopes[np.isnan(norms[:, k])] = np.nan
                out[bad, k * self.n : (k + 1) * self.n] = slopes
            return
        if mode == "norms":
            out[bad] = norms
            return
        clearances = norms - self.thresholds
        if mode == "clearances":
            out[bad] = clearances
            return
        out[bad, 0] = np.min(clearances, axis=1)
        if mode == "smallest":
            index[bad] = np.where(np.any(np.isnan(clearances), axis=1), -1, np.argmin(clearances, axis=1))


def in_threads(work: Callable[[int, int], int], rows: int, threads: int) -> int:
    """Split rows over threads, and return the sum of what the work on each range of them returns."""
    count = max(1, min(threads, rows))
    if count == 1:
        return work(0, rows)
    from concurrent.futures import ThreadPoolExecutor

    ends = [round(rows * part / count) for part in range(count + 1)]
    with ThreadPoolExecutor(count) as pool:
        return sum(pool.map(work, ends[:-1], ends[1:]))


def _no_common() -> None:
    """Return that there is no common frame."""


_NO_INDEX = np.empty(0, dtype=np.int64)


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
    """Refuse a number of threads or a backend that cannot be meant.

    Raises:
        DimensionError: If `threads` is no whole number of 1 or more.
        UnknownNameError: If there is no such backend.
        UnsupportedError: If compiled code is asked for, and Numba is not there.
    """
    if isinstance(threads, bool) or not isinstance(threads, int | np.integer) or threads < 1:
        raise DimensionError(f"threads is {threads!r}; give a whole number of 1 or more")
    if backend not in BACKENDS:
        raise UnknownNameError("backend", str(backend), BACKENDS)
    if backend == "compiled" and not has_numba():
        raise UnsupportedError("backend 'compiled' needs Numba; install pinbound[fast], or leave the choice to 'auto'")


def representable(Q: Array, dtype: np.dtype[Any]) -> NDArray[np.float64]:
    """Return Q in float64, NaN where a number is not finite in `dtype`: beyond 3.4e38 in float32."""
    rows = np.array(Q, dtype=np.float64)
    rows[~(np.abs(rows) <= np.finfo(dtype).max)] = np.nan
    return rows


def buffer(out: Any, shape: tuple[int, ...], dtype: np.dtype[Any], columns: bool, source: Array) -> Array:
    """Return `out` if it fits, or a new array.

    Rows are written in blocks while others are still to be read, so `out` may share no memory with the configurations
    `source`, and none of its own elements with another.

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
    """Return whether two elements may be one: a stride is no longer than all that shorter strides span."""
    if not out.size:
        return False
    span = out.itemsize
    for stride, count in sorted((abs(stride), count) for stride, count in zip(out.strides, out.shape, strict=True)):
        if count > 1 and stride < span:
            return True
        span += stride * (count - 1)
    return False


def notice_without_numba() -> None:
    """Say once a process that Numba would make large batches faster."""
    text = "pinbound: large batches run in NumPy, about 6 times slower than compiled; install pinbound[fast] for Numba"
    if not has_numba() and text not in _noticed:
        _noticed.append(text)
        _logger.warning(text)
