"""The kernel of many spheres on few links: machine code that reads tables and skips clusters, or NumPy.

Norms, clearances, gradients, the smallest clearance and `free` use the tree of `balls`. For float32 the float64 results
are rounded. `free` tests all rows in float32 first. Its error has a bound, so most rows are decided. The other rows are
tested again in float64, so the answer is always that of float64.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cached_property
from typing import Any, Literal, cast

import numpy as np
from numpy.typing import NDArray

from pinbound.kernel.arguments import Backend, check_choices, in_threads
from pinbound.kernel.ball_tables import BallTables, balls_code, balls_source
from pinbound.kernel.balls import BallTree, tree_of
from pinbound.kernel.choice import Work
from pinbound.kernel.engine import Kernel
from pinbound.kernel.program import CommonMark, Pair, Reference
from pinbound.machine.compiled import KernelSource
from pinbound.path.shared import Spot
from pinbound.typing import AnyArray as Array
from pinbound.typing import Flags

__all__ = ["BallKernel", "longest"]

_TABLES = {"norms": "all", "clearances": "all", "gradients": "slopes", "smallest": "least", "least": "least"}
"""The source text for each answer."""

_LARGEST_ANGLE = {"free": 1e3, "least": 1e5, "all": 1e5, "slopes": 1e5}
"""rad: rows with a larger angle are computed in float64, and by the reference."""

_LARGEST_SLIDE = {"free": 4.0, "least": 1e3, "all": 1e3, "slopes": 1e3}
"""m: the same for prismatic joints; the error bounds grow with it."""

_COMPILATION = {"free": 0.45, "least": 0.35, "all": 0.2, "slopes": 0.4}
"""Seconds to compile each text, by LLVM alone, without Numba, and to write its tables."""

_LOADING = {"free": 0.12, "least": 0.06, "all": 0.05, "slopes": 0.05}
"""Seconds to load each, with llvmlite's import, and to write its tables; `free` also searches for pairs that never
meet."""

_PAIR, _BALL, _NODE, _SLOPE = 40.0, 70.0, 700.0, 120.0
"""Counted operations of one of each, in NumPy; the last of a coordinate of a pair's or a ball's slope.

Measured on the Panda's 690 pairs, 51 balls and 8 nodes: 9, 15, 150 and 26 ns where compiling `free` takes 0.45 s, all
on one quiet core. NumPy takes these times because one such operation goes through memory, which one of a program's
nodes does not."""

_BLOCK = 1 << 16
"""Numbers of float64 that are rounded to float32 at a time."""

_MOST_TABLES = 8
"""Largest number of tables of one set: further limits use the tables without limits."""

_LEAST_ROWS = 8192
"""Smallest number of rows for one thread."""


class BallKernel(Kernel):
    """Evaluates pairs of marked points as `Kernel` does, from tables."""

    _DERIVED = "tree"

    def __init__(
        self,
        pairs: Sequence[Pair],
        n: int,
        reference: Reference,
        common: Callable[[], Mapping[str, CommonMark] | None],
        tree: BallTree | None = None,
    ) -> None:
        """Store what to evaluate: arguments as for `Kernel`; `tree` instead of the chains of the common frame."""
        super().__init__(pairs, n, reference, common)
        if tree is not None:
            self.__dict__["tree"] = tree
        self._tables: dict[str, BallTables] = {}

    @cached_property
    def tree(self) -> BallTree:
        """The tree of balls."""
        marks = self._common()
        assert marks is not None
        return tree_of(self.pairs, self.n, marks)

    @cached_property
    def _used(self) -> list[int]:
        return list(self.tree.coordinates)

    @cached_property
    def _rates(self) -> Array:
        return self.tree.rates

    @cached_property
    def _angles(self) -> Array:
        return np.array(self.tree.angles).reshape(len(self.tree.angles), self.n)

    @cached_property
    def _scale(self) -> float:
        return self.tree.scale

    @cached_property
    def _signed(self) -> tuple[bool, ...]:
        return (False,) * len(self.pairs)

    def _most(self, mode: str) -> Array:
        """Return the largest |q_j| (n,) of a row that is not a special case."""
        turns = np.abs(self._angles).sum(axis=1).max(initial=1.0)
        most = np.full(self.n, _LARGEST_ANGLE[mode] / turns)
        return np.where(self._rates > 0.0, np.minimum(most, _LARGEST_SLIDE[mode]), most)

    @cached_property
    def _length(self) -> float:
        return self.tree.scale

    def _regular(self, kind: np.dtype[Any]) -> Array:
        return np.minimum(super()._regular(kind), self._most("least")[self._used])

    def _call(self, mode: str, rows: int) -> Work:
        cost = _PAIR * len(self.pairs) + _BALL * len(self.tree.balls) + _NODE * len(self.tree.nodes)
        if mode == "gradients":
            cost += _SLOPE * self.n * (len(self.pairs) + len(self.tree.balls))
        text = _TABLES.get(mode, mode)
        return Work(rows, cost, 10 * len(self.tree.nodes), _COMPILATION[text], _LOADING[text])

    def _source(self, mode: str, is_single: bool) -> KernelSource:
        return balls_source(_TABLES.get(mode, mode))

    def _table(self, mode: str) -> BallTables:
        if mode not in self._tables:
            self._tables[mode] = BallTables.of(self.tree, mode, self._most(mode), self._sure)
        return self._tables[mode]

    def _machine_code(self, mode: str, is_single: bool) -> Any:
        key = (mode, is_single)
        if key not in self._compiled:
            balls_code(_TABLES[mode])
            table = self._table(_TABLES[mode])
            less = np.zeros(len(self.pairs)) if mode == "norms" else None

            def run(Q: Array, out: Array, index: Array) -> int:
                return table.run(Q, out, index, less=less, with_index=mode == "smallest")

            def rounded(Q: Array, out: Array, index: Array) -> int:
                irregular, step = 0, max(8, _BLOCK // max(1, out.shape[1]) // 8 * 8)
                for start in range(0, len(Q), step):
                    rows = slice(start, start + step)
                    found = np.empty(out[rows].shape, order="F" if _TABLES[mode] == "all" else "C")
                    irregular += run(Q[rows].astype(np.float64), found, index[rows])
                    out[rows] = found
                return irregular

            self._compiled[key] = cast(Any, rounded if is_single else run)
        return self._compiled[key]

    def _in_numpy(self, Q: Array, mode: str, out: Array, index: Array, lo: int, hi: int) -> int:
        part, target = Q[lo:hi], out[lo:hi]
        if mode == "gradients":
            self.tree.slopes(part, target)
            return int(np.count_nonzero(~(np.abs(part[:, self._used]) <= self._near)))
        less = np.zeros(len(self.pairs)) if mode == "norms" else self.thresholds
        if mode in ("norms", "clearances"):
            self.tree.clearances(part, target, less)
            nearest = np.fmin.reduce(np.abs(target), axis=None)
        else:

            def take(rows: slice, found: Array) -> None:
                target[rows, 0] = np.min(found, axis=0)
                if mode == "smallest":
                    index[lo:hi][rows] = np.argmin(found, axis=0)

            self.tree.each_block(part, less, take)
            nearest = np.fmin.reduce(np.abs(target[:, 0]))
        most = self._near if out.dtype == np.float64 else np.finfo(out.dtype).max
        irregular = int(np.count_nonzero(~(np.abs(part[:, self._used]) <= most)))
        return irregular + int(mode != "norms" and out.dtype == np.float64 and nearest <= self._sure)

    def one(self, q: Array, mode: Literal["norms", "clearances"]) -> Array | None:
        """Return norms or clearances (m,) of one configuration; None if these tables do not have them."""
        if not np.all(np.abs(q) <= np.minimum(self._near, self._most("all"))):
            return None
        found = np.empty((1, len(self.pairs)))
        self.tree.clearances(q[None], found, np.zeros(len(self.pairs)) if mode == "norms" else self.thresholds)
        unsure = mode == "clearances" and np.any(np.abs(found) <= self._sure)
        return None if unsure or not np.all(np.isfinite(found)) else found[0]

    def prepare(self, mode: str = "norms", dtype: Any = np.float64) -> str:
        """Compile or load a mode now, and return the backend that it will run on."""
        chosen = super().prepare(mode, dtype)
        if mode == "least" and chosen == "compiled":
            balls_code("free")
        return chosen

    def free(self, Q: NDArray[np.float64], threads: int = 1, backend: Backend = "auto") -> Flags:
        """Return which rows (N,) have only positive clearances."""
        wide = np.full(self.n, np.inf)
        return self.free_within(Q, -wide, wide, threads, backend)

    def free_within(self, Q: Array, low: Array, high: Array, threads: int = 1, backend: Backend = "auto") -> Flags:
        """Return which rows (N,) have only positive clearances, and satisfy `low <= q <= high`, ends (n,) each."""
        check_choices(threads, backend)
        key = ("free", True)
        is_compiled = key in self._compiled or backend == "compiled"
        if (
            not len(Q)
            or backend == "numpy"
            or not (is_compiled or self._choice.compiles(key, self._call("free", len(Q)), lambda: balls_source("free")))
        ):
            least, _ = self.smallest(Q, False, None, threads, "numpy")
            return (least > 0.0) & np.all((Q >= low) & (Q <= high), axis=1)
        table, self._compiled[key] = self._free_table(low, high), balls_code("free")
        data, flags, nothing = np.require(Q, np.float64, ["C", "A"]), np.zeros(len(Q), np.uint8), np.empty((len(Q), 0))

        def work(lo: int, hi: int) -> int:
            return table.run(data[lo:hi], nothing[lo:hi], flags[lo:hi], limits=(low, high))

        in_threads(work, len(Q), min(threads, max(1, len(Q) // _LEAST_ROWS)))
        unsure, found = np.flatnonzero(flags > 1), flags.view(np.bool_)
        if len(unsure):
            found[unsure] = self._are_positive(data[unsure], backend)
        return found

    def _are_positive(self, Q: Array, backend: Backend) -> Flags:
        """Return the signs (N,) of float64; for few rows, so the other costs of a call matter."""
        if backend == "compiled" or ("least", False) in self._compiled:
            least = np.empty((len(Q), 1))
            if not self._table("least").run(Q, least, np.empty(0, dtype=np.int64)):
                return least[:, 0] > 0.0
        return self.smallest(Q, False, None, 1, backend)[0] > 0.0

    def _free_table(self, low: Array, high: Array) -> BallTables:
        """Return the tables of `free` within limits; for many sets of limits, those without limits serve all."""
        key = "free" + (low.tobytes() + high.tobytes()).hex()
        if key not in self._tables and len(self._tables) >= _MOST_TABLES:
            wide = np.full(self.n, np.inf)
            low, high = -wide, wide
            key = "free"
        if key not in self._tables:
            self._tables[key] = BallTables.of(self.tree, "free", self._most("free"), self._sure, (low, high))
        return self._tables[key]


def longest(spots: Iterable[Spot]) -> float:
    """Return the largest distance of points, with prismatic displacements of regular rows [m]; tables square it."""
    return max((spot.scale + _LARGEST_SLIDE["least"] * spot.rate for spot in spots), default=0.0)
