"""Signed clearances of many boundaries for many configurations, by `rule`, at the speed of the batch kernel.

A stop is a function of one angle. It is free in an interval of a linear combination of q, like a joint limit, so `free`
needs the kernel only for the other boundaries. `stops` has the signed clearances of stops.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from pinbound.contact.rule import ContactRule
from pinbound.contact.stops import StopKernel
from pinbound.model.coupling import GuardedLimit, Intervals, LinearLimit
from pinbound.typing import AnyArray, Array, Ints
from pinbound.values import read_only

if TYPE_CHECKING:
    from pinbound.kernel import Backend, CommonMark, Kernel, MixedKernel, Pair, UnionKernel

__all__ = ["SignedKernel"]


class SignedKernel:
    """Evaluates the signed clearances of a set of boundaries, with the methods of `Kernel`.

    Attributes:
        rules: The boundaries' rules.
        areas: Indices of the boundaries that are not stops.
        stops: Indices of the stops.
    """

    def __init__(
        self,
        rules: Sequence[ContactRule],
        marks: Sequence[tuple[str, str]],
        n: int,
        limits: Sequence[LinearLimit],
        common: Callable[[], Mapping[str, CommonMark] | None],
        guarded: Sequence[GuardedLimit] = (),
    ) -> None:
        """Hold rules of one robot of n coordinates, with the names of their marks; `common` as for `Kernel`."""
        from pinbound.kernel import Reference, kernel_of

        self.rules, self.marks, self.n, self.limits = tuple(rules), tuple(marks), n, tuple(limits)
        self.guarded = tuple(guarded)
        is_stop = np.array([rule.is_stop for rule in rules], dtype=np.bool_)
        self.areas, self.stops = read_only(np.flatnonzero(~is_stop)), read_only(np.flatnonzero(is_stop))
        self.kernel: Kernel | UnionKernel | MixedKernel = kernel_of(
            [self.pairs[k] for k in self.areas.tolist()], n, Reference(), common
        )
        chosen = self._chosen = [stop for rule in rules if (stop := rule.stop) is not None]
        self._between = [(stop.coefficients, stop.free_gap) for stop in chosen]
        self._stops = StopKernel([self.rules[k] for k in self.stops.tolist()], n)

    @cached_property
    def pairs(self) -> tuple[Pair, ...]:
        """Every boundary with the value that its separation must exceed."""
        from pinbound.kernel import Pair

        return tuple(Pair(rule.path, rule.distance, names) for rule, names in zip(self.rules, self.marks, strict=True))

    @cached_property
    def thresholds(self) -> Array:
        """(m,) [m]: the value that is subtracted from the separation; zero for stops."""
        return read_only(np.array([0.0 if rule.stop else rule.distance for rule in self.rules]))

    @cached_property
    def _open(self) -> Intervals:
        return Intervals.of((), self.n, self._between)

    @cached_property
    def _within(self) -> Intervals:
        return Intervals.of(self.limits, self.n, self._between, self.guarded)

    def prepare(self, mode: str = "norms", dtype: Any = np.float64) -> str:
        """Compile or load a mode now, and return the backend that it will run on."""
        chosen = "numpy"
        if len(self.areas):
            chosen = self.kernel.prepare(mode, dtype)
        if len(self.stops) and mode != "least":
            chosen = self._stops.prepare(mode, dtype)
        return chosen

    def free(self, Q: Array, limits: bool, threads: int = 1, backend: Backend = "auto") -> AnyArray:
        """Return which rows (N,) have only positive signed clearances, and are within all joint limits."""
        from pinbound.kernel import BallKernel, check_choices

        check_choices(threads, backend)

        intervals = self._within if limits else self._open
        if not len(self.areas):
            return intervals.hold(Q)
        if not isinstance(self.kernel, BallKernel):
            return intervals.hold(Q) & self.kernel.free(Q, threads, backend)
        low, high, others = intervals.split()  # the coordinates' own ends are compared beside the spheres
        found = self.kernel.free_within(Q, low, high, threads, backend)
        return found if others is None else found & others.hold(Q)

    def one(self, q: Array) -> Array:
        """Return the signed clearances (m,) of one configuration, by plain Python where that is faster."""
        values = q.tolist()
        areas = self.kernel.one(q, "clearances") if len(self.areas) else np.empty(0)
        if areas is None or not all(map(math.isfinite, values)):
            return self.rows(q[None])[0]
        found = np.empty(len(self.rules))
        found[self.areas] = areas
        found[self.stops] = [stop.signed_at(values) for stop in self._chosen]
        return found

    def one_is_free(self, q: Array, limits: bool) -> bool:
        """Return `free` for one configuration."""
        if not (self._within if limits else self._open).holds_at(q.tolist()):
            return False
        areas = self.kernel.one(q, "clearances") if len(self.areas) else np.empty(0)
        if areas is None:  # not finite, or a sign that is for the reference to tell
            areas = self.kernel.rows(q[None], "clearances")[0]
        return bool(np.all(areas > 0.0))

    def rows(
        self,
        Q: Array,
        mode: str = "clearances",
        out: AnyArray | None = None,
        threads: int = 1,
        backend: Backend = "auto",
        dtype: Any = np.float64,
    ) -> AnyArray:
        """Return the signed clearances (N, m), or with the mode ``"gradients"`` their gradients (N, m, n)."""
        from pinbound.kernel.arguments import buffer, check_choices, real

        check_choices(threads, backend)
        m, is_slope, kind = len(self.rules), mode == "gradients", real(dtype)
        if not len(self.stops):
            return self.kernel.rows(Q, "gradients" if is_slope else "clearances", out, threads, backend, dtype)
        result = buffer(out, (len(Q), m, self.n) if is_slope else (len(Q), m), kind, columns=not is_slope, source=Q)
        if not len(self.areas):
            return self._stops.rows(Q, mode, result, threads, backend, dtype)
        result[:, self.areas] = self.kernel.rows(
            Q, "gradients" if is_slope else "clearances", None, threads, backend, dtype
        )
        result[:, self.stops] = self._stops.rows(Q, mode, None, threads, backend, dtype)
        return result

    def smallest(
        self,
        Q: Array,
        with_index: bool = True,
        out: AnyArray | None = None,
        threads: int = 1,
        backend: Backend = "auto",
        dtype: Any = np.float64,
    ) -> tuple[AnyArray, Ints]:
        """Return the smallest signed clearance (N,) of each row and its boundary; NaN and -1 if one is NaN."""
        if not len(self.stops):
            return self.kernel.smallest(Q, with_index, out, threads, backend, dtype)
        least, index = self._stops.smallest(Q, with_index, out, threads, backend, dtype)
        if with_index:
            index = np.append(self.stops, -1)[index]
        if not len(self.areas):
            return least, index
        others, places = self.kernel.smallest(Q, with_index, None, threads, backend, dtype)
        smaller = ~(others >= least)  # a NaN is taken, and stays
        if with_index:
            places = np.append(self.areas, -1)[places]
            smaller |= (others == least) & (places < index)
            index = np.where(smaller & ~np.isnan(least), places, index)
            index[np.isnan(others)] = -1
        np.copyto(least, others, where=smaller & ~np.isnan(least))
        return least, index
