"""Signed clearances of many boundaries, for many configurations: the rule of `rule`, at the speed of the batch kernel.

Stops are functions of one angle each, so that whether they are free is an interval of a linear combination of q, like
a joint limit: `free` needs the kernel for the other boundaries alone. The size of a stop's signed clearance is the norm
of two equal arms (`ContactRule.size_path`), which the kernel evaluates; the side is again an interval.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pinbound.contact.rule import ContactRule, signed_share
from pinbound.coupling import Intervals, LinearLimit, combination
from pinbound.interpreters import separation
from pinbound.values import read_only

if TYPE_CHECKING:
    from pinbound.interpreters.kernel import Backend, CommonMark, Kernel, MixedKernel, Pair

__all__ = ["SignedKernel"]

Array = NDArray[Any]

_BLOCK, _LARGE_BLOCK = 1 << 12, 1 << 15


class SignedKernel:
    """Evaluates the signed clearances of a set of boundaries; its methods are those of `Kernel`, its clearances signed.

    Attributes:
        rules: The boundaries' rules.
        areas: Places of the boundaries that are no stops.
        stops: Places of the stops.
    """

    def __init__(
        self,
        rules: Sequence[ContactRule],
        marks: Sequence[tuple[str, str]],
        n: int,
        limits: Sequence[LinearLimit],
        common: Callable[[], Mapping[str, CommonMark] | None],
    ) -> None:
        """Hold rules of one robot of n coordinates, with the names of their marks; `common` as for `Kernel`."""
        from pinbound.interpreters.kernel import Kernel, Pair, Reference, kernel_of

        self.rules, self.marks, self.n, self.limits = tuple(rules), tuple(marks), n, tuple(limits)
        is_stop = np.array([rule.is_stop for rule in rules], dtype=np.bool_)
        self.areas, self.stops = read_only(np.flatnonzero(~is_stop)), read_only(np.flatnonzero(is_stop))
        reference = Reference(separation.separations, separation.gradients)
        self.kernel: Kernel | MixedKernel = kernel_of(
            [self.pairs[k] for k in self.areas.tolist()], n, reference, common
        )
        chosen = self._chosen = [stop for rule in rules if (stop := rule.stop) is not None]
        angles: dict[tuple[float, ...], int] = {}
        places = [angles.setdefault(tuple(stop.coefficients.tolist()), len(angles)) for stop in chosen]
        self._angle = np.array(places, dtype=np.intp)
        self._angles = np.array(list(angles)).reshape(len(angles), n)
        self._gaps = np.array([stop.free_gap for stop in chosen]).reshape(-1, 2)
        self._plays = np.array([stop.play for stop in chosen])
        self._amplitudes = np.array([stop.amplitude for stop in chosen])
        self._between = [(stop.coefficients, stop.free_gap) for stop in chosen]
        sizes = [Pair(rules[k].size_path, 0.0, marks[k]) for k in self.stops.tolist()]
        self._sizes = Kernel(sizes, n, reference, _no_common)

    @cached_property
    def pairs(self) -> tuple[Pair, ...]:
        """Every boundary with what its separation must exceed."""
        from pinbound.interpreters.kernel import Pair

        return tuple(Pair(rule.path, rule.distance, names) for rule, names in zip(self.rules, self.marks, strict=True))

    @cached_property
    def thresholds(self) -> NDArray[np.float64]:
        """(m,) [m]: what is taken off the separation; of stops zero."""
        return read_only(np.array([0.0 if rule.stop else rule.distance for rule in self.rules]))

    @cached_property
    def _open(self) -> Intervals:
        return Intervals.of((), self.n, self._between)

    @cached_property
    def _within(self) -> Intervals:
        return Intervals.of(self.limits, self.n, self._between)

    def prepare(self, mode: str = "norms", dtype: Any = np.float64) -> str:
        """Compile or load a mode now, and return the backend that it will run on."""
        chosen = "numpy"
        if len(self.areas):
            chosen = self.kernel.prepare(mode, dtype)
        if len(self.stops) and mode != "least":
            chosen = self._sizes.prepare(mode, dtype)
        return chosen

    def free(self, Q: NDArray[np.float64], limits: bool, threads: int = 1, backend: Backend = "auto") -> Array:
        """Return which rows (N,) have positive signed clearances alone, and are within all joint limits."""
        from pinbound.interpreters.kernel import check_choices

        check_choices(threads, backend)
        found = (self._within if limits else self._open).hold(Q)
        if len(self.areas):
            least, _ = self.kernel.smallest(Q, False, None, threads, backend)
            found &= least > 0.0
        return found

    def one(self, q: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the signed clearances (m,) of one configuration, by plain Python where that is faster."""
        values = q.tolist()
        areas = self.kernel.one(q, "clearances") if len(self.areas) else np.empty(0)
        if areas is None or not all(map(math.isfinite, values)):
            return self.rows(q[None])[0]
        found = np.empty(len(self.rules))
        found[self.areas] = areas
        found[self.stops] = [stop.signed_at(values) for stop in self._chosen]
        return found

    def one_is_free(self, q: NDArray[np.float64], limits: bool) -> bool:
        """Return what `free` does for one configuration."""
        if not (self._within if limits else self._open).holds_at(q.tolist()):
            return False
        areas = self.kernel.one(q, "clearances") if len(self.areas) else np.empty(0)
        return areas is not None and bool(np.all(areas > 0.0))

    def rows(
        self,
        Q: NDArray[np.float64],
        mode: str = "clearances",
        out: Array | None = None,
        threads: int = 1,
        backend: Backend = "auto",
        dtype: Any = np.float64,
    ) -> Array:
        """Return the signed clearances (N, m), or with the mode ``"gradients"`` their gradients (N, m, n)."""
        from pinbound.interpreters.kernel.engine import buffer, check_choices, real

        check_choices(threads, backend)
        m, is_slope, kind = len(self.rules), mode == "gradients", real(dtype)
        if not len(self.stops):
            return self.kernel.rows(Q, "gradients" if is_slope else "clearances", out, threads, backend, dtype)
        result = buffer(out, (len(Q), m, self.n) if is_slope else (len(Q), m), kind, columns=not is_slope, source=Q)
        if is_slope:
            if len(self.areas):
                result[:, self.areas] = self.kernel.rows(Q, "gradients", None, threads, backend, dtype)
            for start in range(0, len(Q), _BLOCK):
                result[start : start + _BLOCK, self.stops] = self._slopes(Q[start : start + _BLOCK])
            bad = np.flatnonzero(~np.all(np.isfinite(Q), axis=1))
            for k in self.stops.tolist() if len(bad) else ():
                result[bad, k] = self.rules[k].gradients(Q[bad])
            return result
        if len(self.areas):
            result[:, self.areas] = self.kernel.rows(Q, "clearances", None, threads, backend, dtype)
            result[:, self.stops] = self._signed(Q, None, threads, backend, dtype)
        else:
            self._signed(Q, result, threads, backend, dtype)
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
        """Return each row's smallest signed clearance (N,) and which boundary has it; NaN and -1 if one is NaN."""
        least, index = self.kernel.smallest(Q, with_index, out, threads, backend, dtype)
        if with_index and len(self.areas):
            index = np.where(index < 0, -1, np.append(self.areas, -1)[index])
        if not len(self.stops):
            return least, index
        for start in range(0, len(Q), _LARGE_BLOCK):
            part = slice(start, start + _LARGE_BLOCK)
            best, where = least[part], index[part]
            signed = self._signed(Q[part], None, threads, backend, dtype)
            for place, column in zip(self.stops.tolist(), signed.T, strict=True):
                if with_index:
                    where += (place - where) * ~(column >= best)
                np.minimum(best, column, out=best)  # a NaN is taken, and stays
        if with_index:
            index[np.isnan(least)] = -1
        return least, index

    def _signed(self, Q: NDArray[np.float64], out: Array | None, threads: int, backend: Backend, dtype: Any) -> Array:
        """Return the signed clearances of the stops (N, k): sizes by the kernel, with the sign of the side."""
        found = self._sizes.rows(Q, "norms", out, threads, backend, dtype)
        least = float(np.finfo(found.dtype).tiny)
        for start in range(0, len(Q), _BLOCK):
            part = slice(start, start + _BLOCK)
            for column, beyond in enumerate(self._beyond(Q[part])):
                values = found[part, column]
                if self._plays[column]:  # the gap is narrower than the arms' alignment
                    values[:] = self._amplitudes[column] * signed_share(-beyond)
                    continue
                np.maximum(values, least, out=values)  # a free q has a positive clearance, however small
                np.copysign(values, beyond, out=values, casting="same_kind")  # at a contact line it is no free one
                np.negative(values, out=values)
        return found

    def _beyond(self, Q: NDArray[np.float64]) -> Iterator[NDArray[np.float64]]:
        """Yield how far each stop's angle is out of home's gap (N,) [rad], negative in it: `-Stop.depth`."""
        block = Q.T.copy().T
        with np.errstate(invalid="ignore"):
            angles: list[NDArray[np.float64]] = [combination(c, block) for c in self._angles]
            gaps: list[list[float]] = self._gaps.tolist()
            for place, (low, high) in zip(map(int, self._angle), gaps, strict=True):
                yield np.maximum(low - angles[place], angles[place] - high)

    def _slopes(self, Q: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the gradients of the stops' signed clearances (N, k, n)."""
        with np.errstate(invalid="ignore"):
            return np.stack([stop.gradients(Q) for stop in self._chosen], axis=1)


def _no_common() -> None:
    """Return that equal arms have no common frame."""
