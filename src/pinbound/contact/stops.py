"""Signed clearances of stops for many configurations, in the batch kernel.

A stop's signed clearance is `s = A sin(d / 2)`, `d = min(phi - low, high - phi)`, with `high = low + 2 pi` if the sides
of all loops are equal. Then both terms of the minimum have the same sine, and for d >= -2 pi

    s = A sin((phi - low) / 2) = A (sin(phi / 2) cos(low / 2) - cos(phi / 2) sin(low / 2)),

which costs two products and a difference, and the cosine and sine of `phi / 2` once for each angle. Its rounding error
is `|A| (1 + |phi|)` times a few unit roundoffs, and beyond that its sign is certain. The rule itself computes the few
rows that are nearer to a contact line, rows more than a turn beyond it, and stops with a narrowed gap.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from pinbound.contact.rule import ContactRule
from pinbound.model.coupling import combination
from pinbound.path.relative import RelativePath
from pinbound.typing import AnyArray, Array, Indices, Ints
from pinbound.values import read_only

if TYPE_CHECKING:
    from pinbound.kernel import Backend, Kernel
    from pinbound.kernel.program import Program

__all__ = ["StopKernel"]

_SURE = 32.0
"""Machine epsilons, relative to `A (1 + |phi|)`: beyond them the sign of a computed clearance is certain."""

_TURN = 2.0 * np.pi


@dataclass(frozen=True)
class _Rules:
    """The rules as the reference interpreter of the kernel."""

    rules: tuple[ContactRule, ...]

    def signed(self, path: RelativePath, Q: Array) -> Array:
        return self._of(path).signed(Q)

    def gradients(self, path: RelativePath, Q: Array) -> Array:
        return self._of(path).gradients(Q)

    def _of(self, path: RelativePath) -> ContactRule:
        return next(rule for rule in self.rules if rule.path is path)


class StopKernel:
    """Evaluates the signed clearances of stops."""

    def __init__(self, rules: Sequence[ContactRule], n: int) -> None:
        """Hold the rules of stops of one robot of n coordinates."""
        self.rules, self.n = tuple(rules), n
        self._stops = [stop for rule in rules if (stop := rule.stop) is not None]
        narrow = [stop.play > 0.0 or not np.isfinite(stop.gap[0]) for stop in self._stops]
        self._is_narrow = read_only(np.array(narrow, dtype=np.bool_))

    def prepare(self, mode: str = "norms", dtype: Any = np.float64) -> str:
        """Compile or load a mode now, and return the backend that it will run on."""
        return self._kernel.prepare("norms" if mode == "clearances" else mode, dtype)

    @cached_property
    def _kernel(self) -> Kernel:
        """The kernel of all stops; those whose gap is narrowed are overwritten."""
        from pinbound.kernel import Kernel, Pair, Reference

        reference = _Rules(self.rules)
        pairs = [Pair(rule.path, 0.0, ("", "")) for rule in self.rules]
        return Kernel(pairs, self.n, Reference(reference.signed, reference.gradients), _no_common, self._program())

    def _program(self) -> Program:
        from pinbound.kernel.program import Program
        from pinbound.kernel.scalars import Graph

        graph = Graph()
        zero, values = graph.constant(0.0), list[int]()
        for stop in self._stops:
            cos, sin = graph.angle((0.5 * stop.coefficients).tolist())
            half = 0.5 * stop.gap[0] if np.isfinite(stop.gap[0]) else 0.0
            along, across = stop.amplitude * np.cos(half), stop.amplitude * np.sin(half)
            values.append(
                graph.sub(graph.mul(graph.constant(float(along)), sin), graph.mul(graph.constant(float(across)), cos))
            )
        vectors = tuple((value, zero, zero) for value in values)
        m = len(values)
        return Program(graph, vectors, tuple(values), (True,) * m, (0.0,) * m, self.n, is_common=False)

    def rows(self, Q: Array, mode: str, out: AnyArray | None, threads: int, backend: Backend, dtype: Any) -> AnyArray:
        """Return the signed clearances (N, k), or with the mode ``"gradients"`` their gradients (N, k, n)."""
        is_slope = mode == "gradients"
        if is_slope:
            found = self._kernel.rows(Q, "gradients", out, threads, backend, dtype)
        else:
            found = self._kernel.rows(Q, "norms", out, threads, backend, dtype)
        extent = _extent(Q)
        narrow, sure = self._is_narrow, self._sure(extent, found.dtype)
        for k, (rule, far) in enumerate(zip(self.rules, self._far(Q, extent), strict=True)):
            rows = np.arange(len(Q)) if narrow[k] else far
            if not narrow[k] and not is_slope:
                rows = np.union1d(rows, np.flatnonzero(~(np.abs(found[:, k]) > sure[k])))
            if len(rows):
                found[rows, k] = rule.gradients(Q[rows]) if is_slope else _kept_free(rule.signed(Q[rows]), found.dtype)
        return found

    def smallest(
        self, Q: Array, with_index: bool, out: AnyArray | None, threads: int, backend: Backend, dtype: Any
    ) -> tuple[AnyArray, Ints]:
        """Return the smallest signed clearance (N,) of each row and its stop; NaN and -1 if one is NaN."""
        least, index = self._kernel.smallest(Q, with_index, out, threads, backend, dtype)
        extent = _extent(Q)
        doubtful = ~(np.abs(least) > self._sure(extent, least.dtype).max(initial=0.0))
        for far in self._far(Q, extent):
            doubtful[far] = True
        rows = np.arange(len(Q)) if np.any(self._is_narrow) else np.flatnonzero(doubtful)
        if len(rows):
            signed = np.stack([rule.signed(Q[rows]) for rule in self.rules], axis=1)
            least[rows] = _kept_free(np.min(signed, axis=1), least.dtype)
            if with_index:
                index[rows] = np.where(np.any(np.isnan(signed), axis=1), -1, np.argmin(signed, axis=1))
        return least, index

    def _sure(self, extent: Array, kind: np.dtype[Any]) -> Array:
        """Return the absolute value (k,) above which the sign of a finite computed clearance is certain [m]."""
        largest = np.where(np.isfinite(extent), np.abs(extent), 0.0).max(axis=0)
        reach = np.array([np.abs(stop.coefficients) @ largest for stop in self._stops])
        size = np.array([stop.amplitude for stop in self._stops])
        return _SURE * float(np.finfo(kind).eps) * size * (1.0 + reach)

    def _far(self, Q: Array, extent: Array) -> list[Indices]:
        """Return the rows at which the angle of each stop is more than a turn beyond home's gap."""
        found: list[Indices] = []
        with np.errstate(invalid="ignore", over="ignore"):
            for stop in self._stops:
                low, high = stop.gap[0] - _TURN, stop.gap[1] + _TURN
                used = np.flatnonzero(stop.coefficients)
                ends = stop.coefficients[used] * extent[:, used]
                if ends.min(axis=0).sum() > low and ends.max(axis=0).sum() < high:
                    found.append(np.empty(0, dtype=np.intp))
                    continue
                phi = combination(stop.coefficients, Q)
                found.append(np.flatnonzero(~((phi > low) & (phi < high))))
        return found


def _extent(Q: Array) -> Array:
    """Return the smallest and the largest value of each coordinate (2, n); NaN if one is NaN, zero without rows."""
    if not len(Q):
        return np.zeros((2, Q.shape[1]))
    return np.array([[column.min(), column.max()] for column in Q.T]).reshape(-1, 2).T


def _kept_free(values: Array, kind: np.dtype[Any]) -> Array:
    """Return clearances rounded to this type such that no positive one becomes zero: free stays free."""
    return np.where(values > 0.0, np.maximum(values, np.finfo(kind).tiny), values)


def _no_common() -> None:
    """Return that angles have no common frame."""
