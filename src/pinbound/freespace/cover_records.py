"""Records of a cover of free space: boxes or polytopes that are proven free, and the undecided rest."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from pinbound.certificates.records import Reason
from pinbound.coverage import CoverageRecord
from pinbound.freespace.proven_files import COVER, write_file
from pinbound.freespace.set_graph import SetGraph, components
from pinbound.model.coupling import as_configurations
from pinbound.tolerances import UNIT_ROUNDOFF
from pinbound.typing import Array, Flags, Indices
from pinbound.values import Value, read_only

__all__ = ["APART", "NUMBERS", "TEXTS", "ConvexSet", "FreeCover"]

TEXTS = ("robot", "robot_coordinates", "coordinates", "boundaries", "digest", "notes")
NUMBERS = ("is_proven", "is_whole", "work", "seconds")
"""Fields of a cover that its file stores as text and as numbers, in addition to arrays."""

APART: Final = 1e-11
"""Radians or metres. Boxes that are this near may touch: limits are kept to `tolerances.LIMIT` beyond their ends."""

_ROWS = 2048


@dataclass(frozen=True, eq=False)
class ConvexSet(Value):
    """The set `{A x <= b}` over the coordinates of a cover, which is proven free.

    Attributes:
        A: (m, k).
        b: (m,) [rad or m].
    """

    A: Array
    b: Array

    def contains(self, X: Array) -> Flags:
        """Return which of X (N, k) are certainly in the set, in spite of the rounding of `A x`."""
        size = np.abs(X) @ np.abs(self.A.T)
        return np.all(X @ self.A.T + UNIT_ROUNDOFF * (self.A.shape[1] + 2) * size <= self.b, axis=1)


@dataclass(frozen=True, eq=False, repr=False)
class FreeCover(Value):
    """Sets in which every configuration is proven free and within all limits. Made by `certified_cover`.

    Attributes:
        robot: Name of the robot.
        robot_coordinates: Names of q's entries.
        coordinates: Names of the coordinates x of the sets.
        at: (n,) the values of the other coordinates; NaN for the coordinates of the sets.
        boundaries: Names of the requested boundaries.
        coverage: Which pairs of links these boundaries watch, and which they do not.
        boxes: (f, 2, k) corners of boxes.
        polytopes: Polytopes `{A x <= b}`. A cover has boxes or polytopes.
        share: (2,) lower and upper bound of the share of the free volume that the sets hold. They are proven if
            `is_proven`; otherwise they are the 95 % interval of an estimate from samples.
        is_proven: Whether the share is proven.
        open: (u, 2, k) undecided boxes. A cover by polytopes has none; its `share` says how much is missing.
        is_whole: Whether the free and the open boxes together hold every free configuration, for all values of the
            other coordinates. Then no motion connects two configurations that these boxes do not connect.
        reason: Why the requested share was not reached; None if it was.
        digest: SHA-256 of the coordinates, limits, paths and thresholds that the proof is about.
        work: The number of bounds computed, one for each box and boundary.
        seconds: Wall time [s].
        notes: Sentences about what was left out.

    Example:
        >>> import pinbound as pb
        >>> robot = pb.load("minervabot_v3")
        >>> cover = pb.certified_cover(robot, ("q2", "q3"), share=0.5)
        >>> cover.is_proven, cover.contains(robot.home)
        (True, True)
    """

    robot: str
    robot_coordinates: tuple[str, ...]
    coordinates: tuple[str, ...]
    at: Array
    boundaries: tuple[str, ...]
    coverage: CoverageRecord
    boxes: Array
    polytopes: tuple[ConvexSet, ...]
    share: Array
    is_proven: bool
    open: Array
    is_whole: bool
    reason: Reason | None
    digest: str
    work: int
    seconds: float
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        """Return what it holds, the share, and what the boundaries watch."""
        sets = f"{len(self.boxes)} boxes" if len(self.boxes) else f"{len(self.polytopes)} polytopes"
        how = "proven" if self.is_proven else "sampled"
        said = f"{sets}, share {self.share[0]:.3g} or more, {how}"
        return f"<FreeCover of {', '.join(self.coordinates)}: {said}; {self.coverage}>"

    def __len__(self) -> int:
        """Return how many sets there are."""
        return len(self.boxes) + len(self.polytopes)

    @cached_property
    def axes(self) -> tuple[int, ...]:
        """The indices in q of the coordinates of the sets."""
        return tuple(self.robot_coordinates.index(name) for name in self.coordinates)

    @cached_property
    def half_spaces(self) -> tuple[tuple[Array, Array], ...]:
        """All sets, also boxes, as A (m, k) and b (m,) of `A x <= b`, with x in the order of `coordinates`."""
        one = np.eye(len(self.coordinates))
        A = read_only(np.concatenate([one, -one]))
        return (
            *((A, read_only(np.concatenate([box[1], -box[0]]))) for box in self.boxes),
            *((one.A, one.b) for one in self.polytopes),
        )

    @cached_property
    def graph(self) -> SetGraph:
        """The graph of sets that intersect, and where they do."""
        return SetGraph.of_boxes(self.boxes) if len(self.boxes) else SetGraph.of_polytopes(self.half_spaces)

    @cached_property
    def components(self) -> Indices:
        """Component (f + u,) of each box, free boxes first, then open ones: equal if a chain of boxes connects two."""
        return read_only(components(np.concatenate([self.boxes, self.open]), APART))

    def contains(self, Q: ArrayLike) -> Any:
        """Return whether q (n,), or each of Q (N, n), is in one of the sets, and thus proven free.

        The other coordinates must be exactly equal to `at`.

        Raises:
            DimensionError: If the last axis is not n long.

        Example:
            >>> import pinbound as pb
            >>> robot = pb.load("minervabot_v3")
            >>> cover = pb.certified_cover(robot, ("q2", "q3"), share=0.8)
            >>> cover.contains([0.0, 0.3, 0.3]), cover.contains([0.0, 0.3, 1.5])
            (True, False)
        """
        array = as_configurations(Q, self.robot_coordinates)
        rows = array if array.ndim > 1 else array[None]
        held = np.isfinite(self.at)
        found = np.all(rows[:, held] == self.at[held], axis=1) & np.all(np.isfinite(rows), axis=1)
        X = rows[:, self.axes]
        for start in range(0, len(X), _ROWS):
            part = slice(start, start + _ROWS)
            found[part] &= self.contains_point(X[part])
        return found if array.ndim > 1 else bool(found[0])

    def contains_point(self, X: Array) -> Flags:
        """Return which of X (N, k), given in the coordinates of the sets, are in one of them."""
        found: Flags = np.zeros(len(X), dtype=np.bool_)
        if len(self.boxes):
            for row, x in enumerate(X):
                found[row] = np.any(np.all((self.boxes[:, 0] <= x) & (x <= self.boxes[:, 1]), axis=1))
        for one in self.polytopes:
            found |= one.contains(X)
        return found

    def save(self, path: str | Path) -> Path:
        """Write the cover to an NPZ file, with the hash of the robot and its marks; `pb.load_cover` reads it.

        Raises:
            OSError: If the file cannot be written.
        """
        k = len(self.coordinates)
        rows = [np.column_stack([one.A, one.b]) for one in self.polytopes]
        arrays = {"at": self.at, "boxes": self.boxes, "open": self.open, "share": self.share}
        arrays["rows"] = np.concatenate([np.empty((0, k + 1)), *rows])
        counts = np.array([len(one) for one in rows], dtype=np.int64)
        header = {name: getattr(self, name) for name in (*TEXTS, *NUMBERS)}
        header["reason"] = None if self.reason is None else self.reason.name
        return write_file(Path(path), COVER, header, {**arrays, "counts": counts})

    def export_drake(self, path: str | Path) -> Path:
        """Write all sets as YAML of Drake's `HPolyhedron`s, named set_0, set_1, ..., over `coordinates` in their order.

        `pydrake.geometry.optimization.LoadIrisRegionsYamlFile` reads the file, for `GraphOfConvexSets` and trajectory
        optimisation. The proof is about `A x <= b` itself, but Drake's `PointInSet` has a tolerance of 1e-8 by default:
        pass `tol=0.0`. Other coordinates are not in the file; they must stay at `at`.

        Raises:
            OSError: If the file cannot be written.
        """
        from pinbound.export.half_spaces import write_half_spaces

        sets = {f"set_{index}": one for index, one in enumerate(self.half_spaces)}
        return write_half_spaces(Path(path), sets, self.coordinates)
