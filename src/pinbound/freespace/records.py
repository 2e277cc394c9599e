"""Records of a free polytope: its faces, its verdict, and its geometry."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pinbound.certificates.records import OpenBox, Verdict
from pinbound.checks import random_numbers, whole_number
from pinbound.coverage import CoverageRecord
from pinbound.exceptions import UnsupportedError
from pinbound.freespace.faces import Face
from pinbound.freespace.vertices import Factor, factors, product_edges, product_vertices, volume_of
from pinbound.model.coupling import as_configurations
from pinbound.tolerances import UNIT_ROUNDOFF
from pinbound.typing import Array, Indices
from pinbound.values import Value, read_only

__all__ = ["FreePolytope"]


@dataclass(frozen=True, eq=False, repr=False)
class FreePolytope(Value):
    """The polytope `{q : A q <= b}` in all coordinates, and what was proven about it. Made by `certified_polytope`.

    Attributes:
        verdict: CERTIFIED: every q in it is free and within all limits, rounding included. VIOLATED: the requested q is
            not free, and the polytope is empty. UNDECIDED: `open_boxes` holds the undecided boxes, and `contains` is
            False for every q. NOTHING_TO_CHECK: there is no boundary.
        coverage: Which pairs of links the boundaries watch, and which they do not.
        coordinates: Names of q's entries.
        q: (n,) the requested configuration.
        faces: Its named faces, in the order of the rows of A. They are proven only if the verdict is CERTIFIED.
        is_exact: Whether all faces are limits, rules, or contact angles in closed form. Otherwise a search placed some
            faces.
        violated: The boundary or limit that q violates; None unless the verdict is VIOLATED.
        open_boxes: The undecided boxes.
        boxes: The number of bounds computed, one for each box and boundary.
        seconds: Wall time [s].
        notes: Sentences about what the verdict does not cover.

    Example:
        >>> import pinbound as pb
        >>> robot = pb.load("minervabot_v3")
        >>> found = pb.certified_polytope(robot, robot.home)
        >>> found.verdict.name, found.A.shape, found.contains(robot.home)
        ('CERTIFIED', (8, 3), True)
    """

    verdict: Verdict
    coverage: CoverageRecord
    coordinates: tuple[str, ...]
    q: Array
    faces: tuple[Face, ...]
    is_exact: bool
    violated: str | None
    open_boxes: tuple[OpenBox, ...]
    boxes: int
    seconds: float
    notes: tuple[str, ...] = ()

    def __bool__(self) -> bool:
        """Refuse.

        Raises:
            TypeError: Always: a verdict has more values than two.
        """
        raise TypeError("a polytope is neither true nor false; compare its verdict with pb.Verdict.CERTIFIED")

    def __repr__(self) -> str:
        """Return verdict, faces and coverage."""
        violated = "" if self.violated is None else f", {self.violated} violated"
        exact = ", exact" if self.is_exact else ""
        return f"<FreePolytope {self.verdict.value}: {len(self.faces)} faces{exact}{violated}; {self.coverage}>"

    @cached_property
    def A(self) -> Array:
        """(m, n) outward normals of the faces; unless the verdict is CERTIFIED, one row of zeros."""
        return self._normals if self.verdict is Verdict.CERTIFIED else read_only(np.zeros((1, len(self.coordinates))))

    @cached_property
    def b(self) -> Array:
        """(m,) proven bounds [rad or m]: every q with A q <= b is free. They are the closed forms minus `Face.slack`.

        Unless the verdict is CERTIFIED, it is -1, so that no q satisfies `A q <= b`.
        """
        if self.verdict is not Verdict.CERTIFIED:
            return read_only(np.full(1, -1.0))
        return read_only(np.array([face.proven for face in self.faces], dtype=np.float64))

    @cached_property
    def _normals(self) -> Array:
        return read_only(np.array([face.normal for face in self.faces]).reshape(-1, len(self.coordinates)))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the faces."""
        return tuple(face.name for face in self.faces)

    def contains(self, Q: ArrayLike) -> Any:
        """Return whether q (n,), or each of Q (N, n), is proven free by this polytope.

        It is True if the verdict is CERTIFIED and A q <= b holds in spite of the rounding of A q.

        Raises:
            DimensionError: If the last axis is not n long.

        Example:
            >>> import pinbound as pb
            >>> polytope = pb.certified_polytope(pb.load("minervabot_v3"), [0.0, 0.3, 0.3])
            >>> polytope.contains([1.0, 0.3, 0.4]), polytope.contains([1.0, 0.3, 1.5])
            (True, False)
        """
        array = as_configurations(Q, self.coordinates)
        rows = array if array.ndim > 1 else array[None]
        if self.verdict is Verdict.CERTIFIED:
            with np.errstate(invalid="ignore"):
                size = np.abs(rows) @ np.abs(self.A.T)
                found = np.all(rows @ self.A.T + UNIT_ROUNDOFF * (len(self.coordinates) + 2) * size <= self.b, axis=1)
            found &= np.all(np.isfinite(rows), axis=1)
        else:
            found = np.zeros(len(rows), dtype=np.bool_)
        return found if array.ndim > 1 else bool(found[0])

    def export_drake(self, path: str | Path, name: str = "free") -> Path:
        """Write `{A q <= b}` as YAML of a Drake `HPolyhedron`, which `LoadIrisRegionsYamlFile` reads.

        The proof is about `A q <= b` itself, but Drake's `PointInSet` has a tolerance of 1e-8 by default: pass
        `tol=0.0`.

        Args:
            path: The file.
            name: Name of the set in the file.

        Raises:
            OSError: If the file cannot be written.
        """
        from pinbound.export.half_spaces import write_half_spaces

        return write_half_spaces(Path(path), {name: (self.A, self.b)}, self.coordinates)

    @cached_property
    def factors(self) -> tuple[Factor, ...]:
        """The polytopes whose Cartesian product it is, from the closed forms of the faces (`Face.bound`)."""
        if not self.faces:
            return ()
        return factors(self._normals, np.array([face.bound for face in self.faces]))

    @cached_property
    def vertices(self) -> Array:
        """(v, n) its vertices, computed from the closed forms of the faces that meet [rad or m].

        Raises:
            UnsupportedError: If faces couple more than four coordinates.
        """
        if not self.faces:
            return read_only(np.empty((0, len(self.coordinates))))
        return read_only(product_vertices(self.factors, len(self.coordinates)))

    @cached_property
    def edges(self) -> Indices:
        """(e, 2) its edges, as pairs of rows of `vertices`."""
        return read_only(product_edges(self.factors) if self.faces else np.empty((0, 2), dtype=np.intp))

    @property
    def volume(self) -> float:
        """Volume of `{A q <= bound}` with the closed forms [rad^n, metres for a prismatic joint]; see `volume_error`.

        Raises:
            UnsupportedError: If faces couple more than four coordinates; `sampled_volume` estimates the volume then.

        Example:
            >>> import pinbound as pb
            >>> robot = pb.load("minervabot_v3")
            >>> polytope = pb.certified_polytope(robot, robot.home)
            >>> width = robot.upper[0] - robot.lower[0]
            >>> bool(abs(polytope.volume - width * pb.feasible_region(robot).area) < 1e-10)
            True
        """
        return volume_of(self.factors)[0] if self.faces else 0.0

    @property
    def volume_error(self) -> float:
        """A bound of the rounding error of `volume` [its unit]."""
        return volume_of(self.factors)[1] if self.faces else 0.0

    def sampled_volume(self, samples: int = 200_000, seed: int = 0) -> tuple[float, float]:
        """Return an estimate of `volume` and its standard error [its unit]. Factors of at most 4 coordinates are exact.

        Args:
            samples: Number of samples in the smallest box around each estimated factor.
            seed: Seed of the random numbers.

        Raises:
            DimensionError: If `samples` is not a whole number of at least 1, or `seed` one of at least 0.
        """
        whole_number(samples, "samples", 1)
        whole_number(seed, "seed")
        if not self.faces:
            return 0.0, 0.0
        value, relative, rng = 1.0, 0.0, random_numbers(seed)
        for part in self.factors:
            try:
                value *= part.volume[0]
                continue
            except UnsupportedError:
                low, high = part.extent
            inside, done = 0, 0
            while done < samples:
                X = rng.uniform(low, high, (min(samples - done, 1 << 15), len(low)))
                inside, done = inside + int(np.count_nonzero(np.all(X @ part.A.T <= part.b, axis=1))), done + len(X)
            share = inside / samples
            value *= share * float(np.prod(high - low))
            relative += (1.0 - share) / max(share * samples, 1e-300)
        return value, value * float(np.sqrt(relative))
