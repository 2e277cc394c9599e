"""The evaluation of a chunk of configurations, as one value that can be sent to a worker on another machine."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pinbound.boundaries.boundary_set import BoundarySet
from pinbound.contact import SignedKernel
from pinbound.coverage import CoverageRecord
from pinbound.exceptions import DimensionError, UnknownNameError, UnsupportedError
from pinbound.model.coupling import Intervals
from pinbound.region import Region, feasible_region
from pinbound.robot.robot import Robot
from pinbound.tables.columnar import load_arrow
from pinbound.tolerances import LIMIT
from pinbound.typing import Array, Flags

__all__ = ["BINS", "COLUMNS", "VERDICTS", "Evaluation", "Statistics", "evaluation_of"]

COLUMNS = ("coordinates", "clearances", "smallest", "region", "verdict")
"""Groups of columns that can be requested; `row` is always included."""

VERDICTS = ("inside", "free", "outside", "limit", "contact", "invalid")
"""inside: free, within limits and in the region around home. free: the same, if no region is known. outside: free, but
not in that region. limit: free, but a joint limit is violated. contact: a signed clearance is zero or less. invalid: a
number is not finite."""

BINS = 1024
"""Bins of each boundary's histogram in the summary: quantiles have the error of one bin, the path's length over
this."""


@dataclass(frozen=True)
class Statistics:
    """Counts of one chunk, or of several merged.

    Attributes:
        rows: Rows.
        invalid: Rows that are not finite.
        verdicts: Number of rows with each verdict, in the order of `VERDICTS`; empty if verdicts were not requested.
        minima: (m,) smallest signed clearance of each boundary [m]; empty without a summary.
        contacts: (m,) number of rows with a signed clearance of zero or less.
        histograms: (m, BINS) counts over each boundary's possible clearances.
    """

    rows: int
    invalid: int
    verdicts: list[int] = field(default_factory=list[int])
    minima: list[float] = field(default_factory=list[float])
    contacts: list[int] = field(default_factory=list[int])
    histograms: list[list[int]] = field(default_factory=list[list[int]])


@dataclass(frozen=True)
class Evaluation:
    """A robot's boundaries, limits and region, and the requested columns.

    Attributes:
        robot: The robot's name.
        coordinates: Active coordinates.
        boundaries: Names of the boundaries.
        kernel: Evaluates their signed clearances.
        limits: The intervals of all joint limits.
        region: The region around home; None if it is not known.
        region_note: Why it is not known.
        columns: Some of `COLUMNS`.
        summary: Whether statistics of every boundary are kept.
        backend: ``"compiled"`` or ``"numpy"``; fixed for a job, so that all chunks have the same bits.
        coverage: Which pairs of links the boundaries watch, and which they do not.
        limits_only: Whether only joint limits are checked.
    """

    robot: str
    coordinates: tuple[str, ...]
    boundaries: tuple[str, ...]
    kernel: SignedKernel
    limits: Intervals
    region: Region | None
    region_note: str
    columns: tuple[str, ...]
    summary: bool
    backend: Literal["compiled", "numpy"]
    coverage: CoverageRecord
    limits_only: bool = False

    @property
    def spans(self) -> Array:
        """(m, 2) [m] ends of each boundary's possible clearances; with a prismatic joint they may be exceeded."""
        lengths = np.array([pair.minimal.scale for pair in self.kernel.pairs]).reshape(-1)
        floors = [-np.inf if rule.is_stop else rule.path.floor for rule in self.kernel.rules]  # beyond a stop, too
        least = np.maximum(-lengths, np.array(floors).reshape(-1))
        return np.column_stack((least, lengths)) - self.kernel.thresholds.reshape(-1, 1)

    @property
    def coordinate_columns(self) -> tuple[str, ...]:
        """Columns of the coordinates: their names, with the prefix `q.` if another column has the same name."""
        own = {"row", "smallest_clearance", "smallest_boundary", "inside_region", "verdict"}
        own |= {f"clearance_{name}" for name in self.boundaries}
        columns: list[str] = []
        for name in self.coordinates:
            column = name
            while column in own:
                column = f"q.{column}"
            own.add(column)
            columns.append(column)
        return tuple(columns)

    def digest(self) -> str:
        """Return a SHA-256 of everything that the numbers depend on: chains, thresholds, limits, region."""
        known = hashlib.sha256()
        known.update(json.dumps([self.robot, self.coordinates, self.boundaries]).encode())
        for pair in self.kernel.pairs:
            for array in pair.path.constants:
                known.update(np.ascontiguousarray(array + 0.0).tobytes())
            known.update(np.float64(pair.threshold).tobytes())
        for rule in self.kernel.rules:
            known.update(repr(rule.stop and (rule.stop.free_gap, rule.stop.amplitude)).encode())
        for array in (self.limits.coefficients, self.limits.low, self.limits.high):
            known.update(np.ascontiguousarray(array + 0.0).tobytes())
        for one in self.limits.guarded:
            for limit in (one.limit, *one.where):
                known.update(np.array([*limit.coefficients, limit.offset, limit.lower, limit.upper]).tobytes())
        known.update(b"" if self.region is None else np.ascontiguousarray(self.region.vertices).tobytes())
        return known.hexdigest()

    def table(self, Q: Array, start: int, threads: int = 1) -> tuple[Any, Statistics]:
        """Return the Arrow table of a chunk and its statistics.

        Args:
            Q: (k, n) rows.
            start: Number of the first row.
            threads: Threads of the kernel.
        """
        arrow: Any = load_arrow("pyarrow")
        threads = threads if self.backend == "compiled" else 1  # a split could change the last bits of NumPy's products
        finite = np.all(np.isfinite(Q), axis=1)
        out: dict[str, Any] = {"row": np.arange(start, start + len(Q), dtype=np.int64)}
        if "coordinates" in self.columns:
            out.update({name: Q[:, j] for j, name in enumerate(self.coordinate_columns)})
        everything = "clearances" in self.columns or self.summary
        clearances = self.kernel.rows(Q, "clearances", None, threads, self.backend) if everything else None
        if clearances is not None and "clearances" in self.columns:
            out.update({f"clearance_{name}": clearances[:, k] for k, name in enumerate(self.boundaries)})
        least: Any = None
        if "smallest" in self.columns or "verdict" in self.columns:
            with_index = "smallest" in self.columns
            least, index = self.kernel.smallest(Q, with_index, None, threads, self.backend)
            if with_index:
                out["smallest_clearance"] = least
                names = arrow.array([*self.boundaries, None], type=arrow.string())
                where = np.where(index < 0, len(self.boundaries), index).astype(np.int32)
                known = arrow.array(where, mask=index < 0)
                out["smallest_boundary"] = arrow.DictionaryArray.from_arrays(known, names[:-1])
        inside: Any = None
        if self.region is not None and ("region" in self.columns or "verdict" in self.columns):
            inside = self._inside(self.region, Q)
            if "region" in self.columns:
                out["inside_region"] = inside
        counts: list[int] = []
        if "verdict" in self.columns:
            verdict = self._verdicts(Q, finite, least, inside)
            counts = np.bincount(verdict, minlength=len(VERDICTS)).tolist()
            out["verdict"] = arrow.DictionaryArray.from_arrays(arrow.array(verdict), arrow.array(VERDICTS))
        invalid = int(np.count_nonzero(~finite))
        statistics = Statistics(len(Q), invalid, counts)
        if self.summary and clearances is not None:
            statistics = self._statistics(statistics, clearances[finite])
        return arrow.table(out), statistics

    def _inside(self, region: Region, Q: Array) -> Flags:
        """Return `region.contains(Q)`, with False for rows of another slice; rows outside its box are not tested."""
        inside = np.zeros(len(Q), dtype=np.bool_)
        if region.is_empty:
            return inside
        left, bottom, right, top = region.polygon.bounds
        x, y = (Q[:, self.coordinates.index(name)] for name in region.coordinates)
        pad = LIMIT * (1.0 + np.max(np.abs([left, bottom, right, top])))
        near = np.flatnonzero((left - pad <= x) & (x <= right + pad) & (bottom - pad <= y) & (y <= top + pad))
        near = near[region.applies(Q[near], "robot")] if near.size else near
        if near.size:
            inside[near] = region.contains(Q[near], "robot")
        return inside

    def _verdicts(self, Q: Array, finite: Any, least: Array, inside: Any) -> NDArray[np.int8]:
        verdict = np.full(len(Q), VERDICTS.index("free"), dtype=np.int8)
        if inside is not None and self.region is not None:
            verdict[:] = np.where(inside, VERDICTS.index("inside"), VERDICTS.index("outside"))
        with np.errstate(invalid="ignore"):
            verdict[~self.limits.hold(Q)] = VERDICTS.index("limit")
            verdict[~(least > 0.0)] = VERDICTS.index("contact")
        verdict[~finite] = VERDICTS.index("invalid")
        return verdict

    def _statistics(self, counts: Statistics, clearances: Array) -> Statistics:
        spans = self.spans
        position = (clearances - spans[:, 0]) * (BINS / (spans[:, 1] - spans[:, 0]))
        bins = np.clip(position, 0, BINS - 1).astype(np.int64)
        histograms = [np.bincount(bins[:, k], minlength=BINS).tolist() for k in range(len(spans))]
        minima = np.min(clearances, axis=0, initial=np.inf).tolist()
        contacts = np.count_nonzero(clearances <= 0.0, axis=0).tolist()
        return Statistics(counts.rows, counts.invalid, counts.verdicts, minima, contacts, histograms)


def evaluation_of(
    robot: Robot,
    columns: Sequence[str] = ("coordinates", "smallest", "verdict"),
    summary: bool = False,
    backend: str = "auto",
    *,
    limits_only: bool = False,
) -> Evaluation:
    """Return the evaluation for every chunk.

    Raises:
        UnknownNameError: If a group of columns is not one of `COLUMNS`.
        UnsupportedError: If the region is requested and this robot has none in a slice; or if there is no boundary, and
            a check of joint limits alone was not requested.
    """
    for name in columns:
        if name not in COLUMNS:
            raise UnknownNameError("group of columns", name, COLUMNS)
    if not len(robot.boundaries) and not limits_only:
        raise UnsupportedError(f"{robot.name} has no boundary to check; mark it, or ask for limits_only=True")
    region, note = None, "joint limits alone are checked" if limits_only else ""
    if limits_only and "region" in columns:
        raise UnsupportedError("limits_only=True computes no region; leave out the column 'region'")
    if not limits_only and ("region" in columns or "verdict" in columns):
        try:
            region = feasible_region(robot)
        except (DimensionError, UnsupportedError) as error:
            if "region" in columns:
                raise
            note = str(error)
    none = BoundarySet((), robot.coordinates, robot.linear_limits, robot.home, guarded=robot.guarded_limits)
    boundaries = none if limits_only else robot.boundaries
    kernel = boundaries.signed_kernel
    chosen = kernel.prepare("least" if "smallest" not in columns else "smallest") if backend == "auto" else backend
    return Evaluation(
        robot=robot.name,
        coordinates=robot.coordinates,
        boundaries=boundaries.names,
        kernel=kernel,
        limits=robot.intervals,
        region=region,
        region_note=note,
        columns=tuple(name for name in COLUMNS if name in columns),
        summary=summary,
        backend="compiled" if chosen == "compiled" else "numpy",
        coverage=robot.coverage.of(boundaries.names).record,
        limits_only=limits_only,
    )
