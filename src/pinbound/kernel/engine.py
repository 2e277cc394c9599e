"""The kernel of a boundary set: it runs a program on a backend; the reference computes what that cannot decide."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pinbound.exceptions import DimensionError, UnsupportedError
from pinbound.kernel.arguments import (
    Backend,
    buffer,
    check_choices,
    in_threads,
    real,
    representable,
    rows_buffer,
)
from pinbound.kernel.choice import Choice, Work, notice_without_numba
from pinbound.kernel.program import CommonMark, Pair, Program, Reference, compile_program
from pinbound.kernel.source import FAR, kernel_source, scalar_source
from pinbound.kernel.vectorised import LinearProgram, VectorisedProgram
from pinbound.machine.compiled import KernelSource, MachineCode, compile_source, has_numba
from pinbound.tolerances import KERNEL_SIGN, LONGEST, LONGEST_SINGLE
from pinbound.typing import AnyArray as Array
from pinbound.typing import Ints
from pinbound.values import read_only

__all__ = ["Kernel"]

_ROWS_PER_THREAD = 4096
"""With fewer rows for each thread, starting the thread costs more than it saves."""


class Kernel:
    """Evaluates a set of boundaries. It is made once for a set; backends are compiled when first needed.

    Values agree between backends, and with the reference interpreter, to rounding: 1e-12 relative, and 1e-15 of the
    length of the paths near contact. In float64 their signs always agree: if rounding could change the sign of a
    number, the reference computes it.
    """

    _DERIVED = "program"  # the data of the pairs that is kept when a kernel is sent to another process

    def __init__(
        self,
        pairs: Sequence[Pair],
        n: int,
        reference: Reference,
        common: Callable[[], Mapping[str, CommonMark] | None],
        program: Program | None = None,
    ) -> None:
        """Store what to evaluate.

        Args:
            pairs: The boundaries.
            n: Number of active coordinates.
            reference: Computes rows that are not finite.
            common: Returns each mark's chains in one common frame, or None.
            program: The expressions, if they are not those of the pairs' separations.
        """
        self.pairs, self.n = tuple(pairs), n
        self.reference, self._common = reference, common
        self._scalar: dict[str, Callable[..., list[float]]] = {}
        self._compiled: dict[tuple[str, bool], MachineCode] = {}
        self._sources: dict[tuple[str, bool], KernelSource] = {}
        self._work_of: dict[bool, tuple[float, int]] = {}
        self._choice = Choice()
        if program is not None:
            self.__dict__["program"] = program

    def __getstate__(self) -> dict[str, Any]:
        """Leave out machine code; the receiver compiles or loads its own."""
        return {name: getattr(self, name) for name in ("pairs", "n", "reference", self._DERIVED)}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore what `__getstate__` kept."""
        self.__init__(common=_no_common, **state)

    @cached_property
    def program(self) -> Program:
        """The expressions, in local frames or in the common frame, whichever are cheaper."""
        return compile_program(self.pairs, self.n, self._common())

    def _call(self, mode: str, rows: int) -> Work:
        """Return the work of a call."""
        is_slope, graph, m = mode == "gradients", self.program.graph, len(self.pairs)
        if is_slope not in self._work_of:
            outputs = list(self.program.squares)
            if is_slope:
                outputs += [number for row in self.program.gradients() for number in row]
            more = 8.0 * m * (self.n if is_slope else 1)
            self._work_of[is_slope] = graph.cost(outputs) + more, len(graph.reachable(outputs))
        cost, nodes = self._work_of[is_slope]
        return Work(rows, cost, nodes)

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
        """Return norms or clearances (m,) of one configuration in plain Python; None if this is not possible."""
        function = self._scalar.get(mode)
        if function is None:
            namespace: dict[str, Any] = {"sqrt": math.sqrt, "cos": math.cos, "sin": math.sin}
            exec(scalar_source(self.program, mode), namespace)  # our own text, made only from numbers
            function = self._scalar[mode] = namespace["function"]
        values: list[float] = q.tolist()
        if not all(map(math.isfinite, values)):
            return None
        found = function(*values)
        if not all(map(math.isfinite, found)):  # a square overflowed
            return None
        if self._signs_count(mode) and self._sure >= 0.0:
            far = max(map(abs, values), default=0.0) > self._near
            if far or min(map(abs, found), default=math.inf) <= self._sure:
                return None
        return np.array(found)

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
        kind = self._kind(dtype, threads, backend)
        result = rows_buffer(out, Q, len(self.pairs), self.n, mode, kind)
        if not result.size:
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

    def free(self, Q: NDArray[np.float64], threads: int = 1, backend: Backend = "auto") -> NDArray[np.bool_]:
        """Return which rows (N,) have only positive clearances."""
        return self.smallest(Q, False, None, threads, backend)[0] > 0.0

    def prepare(self, mode: str = "norms", dtype: Any = np.float64) -> str:
        """Compile or load a mode now, and return the backend that it will run on."""
        if not has_numba():
            notice_without_numba()
            return "numpy"
        self._machine_code(mode, real(dtype) == np.float32)
        return "compiled"

    def _kind(self, dtype: Any, threads: int, backend: Backend) -> np.dtype[Any]:
        """Check all arguments, and return the type of the numbers."""
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
        """The length of the longest path without prismatic displacements [m]."""
        return max((pair.minimal.scale for pair in self.pairs), default=0.0)

    @cached_property
    def _turns(self) -> Array:
        """(n,) the sum of all angles' |c_j|, which bounds the rounding of angles for each unit of a coordinate."""
        return np.abs(self._angles).sum(axis=0)

    @cached_property
    def _angles(self) -> Array:
        """(k, n) coefficients of all angles."""
        return np.array(self.program.graph.angles).reshape(len(self.program.graph.angles), self.n)

    @cached_property
    def _scale(self) -> float:
        """The length of the longest path of a sum [m]; zero if no sign is needed."""
        return self.program.scale

    @cached_property
    def _signed(self) -> tuple[bool, ...]:
        """Whether each result is a height, which has a sign."""
        return self.program.signed

    def _unsure(self, size: Array) -> Array:
        """Return the size (N,) [m] below which the sign of a result is not sure, for |q| (N, n)."""
        length = self._scale + size @ self._rates
        return KERNEL_SIGN * length * (1.0 + len(self._angles) + size @ self._turns)

    @cached_property
    def _sure(self) -> float:
        """The largest of them while no coordinate and no angle is beyond `FAR`; negative if no sign is needed."""
        if not self._scale > 0.0:
            return -1.0
        angles = len(self._angles)
        return KERNEL_SIGN * (self._scale + FAR * float(self._rates.sum())) * (1.0 + angles * (1.0 + FAR))

    @cached_property
    def _near(self) -> float:
        """The largest |q_j| for which no angle is beyond `FAR`."""
        most = np.abs(self._angles).sum(axis=1).max(initial=1.0)
        return FAR / float(most)

    def _signs_count(self, mode: str) -> bool:
        return any(self._signed) if mode == "norms" else mode != "gradients"

    @cached_property
    def _rates(self) -> NDArray[np.float64]:
        """(n,) the largest displacement of a path for a unit of each coordinate, by prismatic joints, all blocks."""
        sums = [np.linalg.norm(pair.minimal.slides, axis=1).sum(axis=0) for pair in self.pairs]
        return np.max(np.array(sums).reshape(len(sums), self.n), axis=0, initial=0.0)

    def _regular(self, kind: np.dtype[Any]) -> NDArray[np.float64]:
        """Return the largest |q_j| (used,) for the machine code: finite, and no square overflows."""
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
        if self._runs_compiled(len(Q), mode, backend, is_single):
            function = self._machine_code(mode, is_single)
            with np.errstate(over="ignore"):  # too large numbers become infinite, and are replaced
                data = np.require(Q, np.float32 if is_single else np.float64, ["C", "A"])
            return lambda lo, hi: function(data[lo:hi], out[lo:hi], index[lo:hi])
        return lambda lo, hi: self._in_numpy(Q, mode, out, index, lo, hi)

    def _runs_compiled(self, rows: int, mode: str, backend: Backend, is_single: bool) -> bool:
        """Choose between machine code and NumPy."""
        if backend != "auto":
            return backend == "compiled"
        if (mode, is_single) in self._compiled:
            return True
        kind = mode, is_single
        return self._choice.compiles(kind, self._call(mode, rows), lambda: self._source(mode, is_single))

    def _source(self, mode: str, is_single: bool) -> KernelSource:
        key = (mode, is_single)
        if key not in self._sources:
            self._sources[key] = kernel_source(self.program, mode, is_single, -1.0 if is_single else self._sure)
        return self._sources[key]

    def _machine_code(self, mode: str, is_single: bool) -> MachineCode:
        key = (mode, is_single)
        if key not in self._compiled:
            self._compiled[key] = compile_source(self._source(mode, is_single))
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
        is_sign, nearest = out.dtype == np.float64 and self._signs_count(mode), math.inf

        def one(rows: slice, k: int, square: Any, dots: list[Any]) -> None:
            """Take the squares of one boundary, and its `r . dr/dq_j`."""
            nonlocal nearest
            norm = square if self.program.signed[k] else np.sqrt(square)
            if is_sign and (mode != "norms" or self.program.signed[k]):
                less = 0.0 if mode == "norms" else self.thresholds[k]
                nearest = np.fmin(nearest, np.fmin.reduce(np.abs(norm - less), axis=None))
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
            """Take the squares of all boundaries."""
            nonlocal nearest
            if mode == "norms":
                np.sqrt(squares, out=target.T[:, rows], casting="same_kind")
                return
            np.sqrt(squares, out=squares)
            squares -= self.thresholds[:, None]
            if mode == "clearances":
                target.T[:, rows] = squares
                nearest = np.fmin(nearest, np.fmin.reduce(np.abs(squares, out=squares), axis=None))
                return
            target[rows, 0] = least = np.min(squares, axis=0)
            nearest = np.fmin(nearest, np.fmin.reduce(np.abs(least)))
            if mode == "smallest":
                index[lo:hi][rows] = np.argmin(squares, axis=0)

        if mode == "gradients":
            self._slopes.run(part, one)
        elif self._linear is not None:
            self._linear.run(part, several)
        else:
            self._values.run(part, one)
        most = self._near if is_sign and self._sure >= 0.0 else np.finfo(out.dtype).max
        return int(np.count_nonzero(~(np.abs(part[:, self._used]) <= most))) + int(is_sign and nearest <= self._sure)

    def _mend(self, Q: Array, mode: str, out: Array, index: Array, kind: np.dtype[Any]) -> None:
        """Compute by the reference: numbers that are not finite, or too large, or whose sign is not sure."""
        size = np.abs(Q[:, self._used])
        is_bad = ~np.all(size <= self._regular(kind), axis=1)
        if kind == np.float64 and self._signs_count(mode) and self._sure >= 0.0:
            unsure = self._unsure(np.abs(Q))
            if mode in ("norms", "clearances"):
                self._mend_signs(Q, mode, out, unsure, is_bad)
            else:
                is_bad |= np.abs(out[:, 0]) <= unsure
        bad = np.flatnonzero(is_bad)
        if not len(bad):
            return
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

    def _mend_signs(self, Q: Array, mode: str, out: Array, unsure: Array, is_bad: Any) -> None:
        """Compute numbers whose sign rounding could have changed by the reference, boundary by boundary."""
        for k, pair in enumerate(self.pairs):
            if mode == "clearances" or self._signed[k]:
                rows = np.flatnonzero(~is_bad & (np.abs(out[:, k]) <= unsure))
                if len(rows):
                    less = 0.0 if mode == "norms" else pair.threshold
                    out[rows, k] = self.reference.norms(pair.path, Q[rows]) - less


def _no_common() -> None:
    """Return None: there is no common frame."""


_NO_INDEX = np.empty(0, dtype=np.int64)
