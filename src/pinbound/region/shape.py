"""A region as a planar shape: its named edges, its area and units, and the points that it holds.

`region` makes regions. `inside` decides which points are inside. A slice of a revolute and a prismatic joint has no
natural distance: a method that would add radians and metres needs `weights`, or refuses.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, cast

import numpy as np
import shapely
from numpy.typing import ArrayLike

from pinbound import units
from pinbound.region import inside
from pinbound.region.arrangement import Corner, Edge, Unresolved
from pinbound.region.halfplanes import Support
from pinbound.region.slice import Slice
from pinbound.region.touching import Touch, touches
from pinbound.region.turn_cuts import Slit, slits_in
from pinbound.typing import Array, Flags
from pinbound.values import read_only

__all__ = ["PlanarShape"]

gis = cast(Any, shapely)  # its stubs know only part of what its functions take
Loops = tuple[tuple[Edge, ...], ...]

_PLANE = 2


@dataclass(frozen=True, eq=False)
class PlanarShape(ABC):
    """The shape of a region: its edges, its area, the constraints that it implies, and the points that it holds.

    Attributes:
        slice: The slice: robot, coordinates, limits and contacts.
        loops: Named edges of the exterior, counter-clockwise, then of each hole, clockwise.
        corners: The points where two edges meet, in the order of the loops.
        accuracy: [rad or m]; no point of the true contour is further than this from the edges. It is zero if all edges
            are straight.
        unresolved: Places on the contour, with their two coordinates, that are too small to resolve. A contact curve
            may cross itself there, so it is undecided whether parts meet. The region assumes that they do not;
            `joined_area` is the area if they do.
        width: [rad or m]; the side of the cells that enclose contact curves which need a search; zero if there are
            none.
    """

    slice: Slice
    loops: Loops
    corners: tuple[Corner, ...]
    accuracy: float
    unresolved: tuple[Unresolved, ...] = ()
    width: float = 0.0

    def __repr__(self) -> str:
        """Return the plane and the edges."""
        names = ", ".join(dict.fromkeys(edge.name for edge in self.edges)) or "empty"
        holes = f"; {len(self.loops) - 1} holes" if len(self.loops) > 1 else ""
        open_ = f"; {self.unresolved_text}" if self.unresolved else ""
        area = f"area {self.area:.6g} {self.area_unit}"
        return f"<Region ({', '.join(self.coordinates)}): {names}; {area}{holes}{open_}>"

    @property
    def unresolved_text(self) -> str:
        """One sentence about undecided places, for people; empty if there are none."""
        return ""

    @property
    def joined_area(self) -> float:
        """Area [`area_unit`] if all parts that meet at `unresolved` places are joined there; else `area`."""
        return self.area

    @cached_property
    def slits(self) -> tuple[Slit, ...]:
        """Walls inside the region, at which passive joints of loops jump by a turn: a motion has to go around them.

        Both sides belong to the region. Only robots with loops that are not parallelograms have slits.
        """
        if self.slice.lifted is None or self.polygon.is_empty:
            return ()
        slice_, edges = self.slice, dict[str, Any]()
        for name in {edge.name for edge in self.edges}:
            edges[name] = gis.multilinestrings([gis.linestrings(e.points) for e in self.edges if e.name == name])
        return slits_in(self.slice.lifted, slice_.scales, slice_.window, self.polygon, edges, self.accuracy)

    @property
    def units(self) -> tuple[str, str]:
        """The unit of each coordinate: ``"rad"``, or ``"m"`` for a prismatic joint."""
        return self.slice.units

    @property
    def area_unit(self) -> str:
        """The unit of `area`: ``"rad^2"``, ``"m^2"``, or ``"m rad"`` for a revolute and a prismatic joint."""
        return units.product(self.units)

    @property
    def coordinates(self) -> tuple[str, str]:
        """The two coordinates of the slice."""
        return self.slice.coordinates

    @property
    def robot_coordinates(self) -> tuple[str, ...]:
        """All active coordinates of the robot."""
        return self.slice.robot.coordinates

    @property
    def at(self) -> Array:
        """(n,) the values of the other coordinates."""
        return self.slice.at

    @property
    def fixed(self) -> tuple[str, ...]:
        """Other coordinates that a boundary or limit depends on: a q inside must have their values of `at`."""
        return self.slice.fixed

    @cached_property
    def edges(self) -> tuple[Edge, ...]:
        """All edges, those of the exterior first; the region lies to the left of each."""
        return tuple(edge for loop in self.loops for edge in loop)

    def touching(self, edge: Edge) -> tuple[Touch, ...]:
        """Return which part of each body touches along a contact edge: a vertex, an edge or a face.

        There is one `Touch` for each interval of `edge.points`, in their order. Indices are those of
        `mark.shape.vertices`.

        Raises:
            UnknownNameError: If the edge is a joint limit or a rule, and no contact.
            UnsupportedError: If one of the two marks is a line or plane.

        Example:
            >>> import pinbound as pb
            >>> region = pb.feasible_region(pb.load("minervabot_v3"), ("q2", "q3"))
            >>> edge = next(edge for edge in region.edges if edge.is_contact)
            >>> [str(touch) for touch in region.touching(edge)]
            ['point on point']
        """
        contacts = dict.fromkeys(other.name for other in self.edges if other.is_contact)
        return touches(self.slice, edge, tuple(contacts))

    @cached_property
    def vertices(self) -> Array:
        """(k, 2) the start of each edge [rad or m], in the order of `edges`."""
        starts = np.array([edge.start for edge in self.edges]).reshape(-1, _PLANE)
        starts.flags.writeable = False
        return starts

    @property
    def is_empty(self) -> bool:
        """Whether the region is empty."""
        return not self.loops

    @property
    @abstractmethod
    def is_convex(self) -> bool:
        """Whether it is a convex polygon with straight edges."""

    @cached_property
    def polygon(self) -> Any:
        """The region as a `shapely.Polygon`, with holes."""
        rings = [np.concatenate([edge.points[:-1] for edge in loop]) for loop in self.loops]
        return gis.Polygon(rings[0], rings[1:]) if rings else gis.Polygon()

    @property
    def area(self) -> float:
        """Area [`area_unit`], by the boundary integral (shoelace)."""
        return float(self.polygon.area)

    @property
    def area_error(self) -> float:
        """[`area_unit`], a bound of the error of `area`: the accuracy times the length of the curved edges.

        Both are measured in units of `Slice.scales`, which are at most 1 rad or 1 m. If contacts need a search, it is
        the largest distance of `area` from the ends of `area_interval`.
        """
        return 0.0

    @property
    def area_interval(self) -> tuple[float, float]:
        """Bounds of the area [`area_unit`] of the true region; they are proven if contacts need a search.

        Then the lower bound is the area that is proven free and connected with the start, and the upper bound adds all
        undecided cells. Otherwise the bounds are `area` minus and plus `area_error`.
        """
        return max(self.area - self.area_error, 0.0), max(self.area + self.area_error, self.joined_area)

    def perimeter(self, weights: Mapping[str, float] | None = None) -> float:
        """Return the length of the contour with holes [rad or m, or the unit of the weights].

        Args:
            weights: The weight of one radian or metre of each coordinate, by name; needed if the two units differ.

        Raises:
            DimensionError: If radians and metres would be added.
        """
        return float(inside.weighted(self.polygon, inside.metric(self.slice, weights, "the perimeter")).length)

    @property
    def centroid(self) -> Array:
        """(2,) the centroid [rad or m]; NaN if the region is empty."""
        if self.is_empty:
            return read_only(np.full(2, np.nan))
        return read_only(np.array([self.polygon.centroid.x, self.polygon.centroid.y]))

    @abstractmethod
    def supports(self, weights: Mapping[str, float] | None = None) -> dict[str, Support]:
        """Return the slack of every limit and contact and, for a convex region, the edges that imply it.

        The slack is zero for an edge. For a convex region it is measured along the normal of the half-plane. Otherwise
        it is the distance from the region to the limit or contact curve; boundaries without a curve in the slice are
        left out. Its unit is rad or m; if both units would be added, it is NaN without weights.

        Args:
            weights: The weight of one radian or metre of each coordinate, by name.

        Example:
            >>> import pinbound as pb
            >>> region = pb.feasible_region(pb.load("minervabot_v3"))
            >>> region.supports()["beta_1"].by
            ('beta_4',)
        """

    def _slack_factors(self, weights: Mapping[str, float] | None) -> tuple[Array, bool]:
        """Return the factors (2,) of a slack, and whether it would add radians and metres without weights."""
        mixed = weights is None and self.units[0] != self.units[1]
        return np.ones(_PLANE) if mixed else inside.metric(self.slice, weights, "the slack"), mixed

    @abstractmethod
    def halfspaces(self) -> tuple[Array, Array]:
        """Return A (k, 2) and b (k,) with `A x <= b`: one row of unit length for each edge.

        Raises:
            UnsupportedError: If the region is not a convex polygon; see `convex_parts` and `inscribed_polygon`.

        Example:
            >>> import pinbound as pb
            >>> region = pb.feasible_region(pb.load("minervabot_v3"))
            >>> A, b = region.halfspaces()
            >>> bool(np.all(A @ region.centroid < b))
            True
        """

    def points(self, Q: ArrayLike, order: inside.Order | None = None) -> Array:
        """Return the two coordinates (N, 2) of configurations; NaN for rows that are not finite, or of another slice.

        Args:
            Q: As in `contains`.
            order: As in `contains`.
        """
        reading = inside.read_points(self.slice, Q, order)
        reading.points[np.any(reading.elsewhere, axis=1) | ~reading.finite] = np.nan
        return reading.points

    def applies(self, Q: ArrayLike, order: inside.Order | None = None) -> Any:
        """Return whether q belongs to the slice: it is finite, and its fixed coordinates are those of `at`.

        Args:
            Q: As in `contains`.
            order: As in `contains`.

        Returns:
            A bool, or (N,) bools.
        """
        reading = inside.read_points(self.slice, Q, order)
        found = ~np.any(reading.elsewhere, axis=1) & reading.finite
        return found if np.ndim(Q) > 1 else bool(found[0])

    def contains(self, Q: ArrayLike, order: inside.Order | None = None) -> Any:
        """Return whether q is inside: a bool, or (N,) bools; False for rows that are not finite.

        Limits belong to the region and may be passed by `tolerances.LIMIT`; contacts do not belong to it. A point is
        inside only if the exact clearances are positive, too, so no chord hides a contact. A point nearer to a curved
        edge than `accuracy` may be reported as outside. Limits of all other coordinates count, also of mimic joints.

        Args:
            Q: (n,) or (N, n) configurations of the robot, or (2,) or (N, 2) points of the slice.
            order: ``"robot"``: Q holds configurations; ``"region"``: Q holds points in the order of `coordinates`. By
                default the length of the last axis decides. This fails if the robot has two coordinates and the slice
                has them in another order.

        Raises:
            DimensionError: If Q has another shape or could be read in two ways, or if a coordinate of `fixed` differs
                from `at`: then the slice has no answer (`applies` is False).

        Example:
            >>> import pinbound as pb
            >>> region = pb.feasible_region(pb.load("minervabot_v3"))
            >>> region.contains([0.0, 0.2, 0.2]), region.contains([3.0, 0.2, 0.2])  # q1 may reach 2.356
            (True, False)
        """
        reading = inside.read_points(self.slice, Q, order)
        inside.refuse_elsewhere(self.slice, reading)
        found = self._held(reading.points) & reading.within & reading.finite
        return found if np.ndim(Q) > 1 else bool(found[0])

    def signed_distance(
        self, Q: ArrayLike, order: inside.Order | None = None, weights: Mapping[str, float] | None = None
    ) -> Any:
        """Return the signed Euclidean distance to the contour [rad or m]: positive inside, negative outside.

        For curved edges it is the distance to the polyline, with an error of at most `accuracy`. A point in contact
        never has a positive distance. It is zero on the contour; limits belong to the region, contacts do not.

        Args:
            Q: As in `contains`.
            order: As in `contains`.
            weights: The weight of one radian or metre of each coordinate, by name: the distance is `|(w_1 dx_1, w_2
                dx_2)|`. Needed if the two units differ.

        Returns:
            A float, or (N,); NaN for rows that are not finite or belong to another slice; -inf if the region is empty,
            or if another coordinate is outside its limits.

        Raises:
            DimensionError: If Q has another shape or could be read in two ways, or if radians and metres would be
                added.

        Example:
            >>> import pinbound as pb
            >>> region = pb.feasible_region(pb.load("minervabot_v3"))
            >>> bool(region.contains([0.0, 0.0, 0.0])), region.contains([0.0, 0.0, np.radians(60)])
            (True, False)
        """
        factors = inside.metric(self.slice, weights, "the signed distance")
        reading = inside.read_points(self.slice, Q, order)
        reading.points[np.any(reading.elsewhere, axis=1) | ~reading.finite] = np.nan
        distance = self._distances(reading.points, factors)
        distance[~reading.within & ~np.isnan(distance)] = -np.inf
        return distance if np.ndim(Q) > 1 else float(distance[0])

    def _held(self, points: Array) -> Flags:
        """Return whether points (N, 2) are inside; False for rows that are not finite."""
        found = np.zeros(len(points), dtype=bool)
        rows = np.flatnonzero(np.all(np.isfinite(points), axis=1))
        if not self.is_empty:
            found[rows] = self._holds(points[rows])
        return found

    def _distances(self, points: Array, factors: Array) -> Array:
        """Return the signed distance (N,) to the contour, coordinates times factors (2,); NaN if not finite."""
        finite = np.flatnonzero(np.all(np.isfinite(points), axis=1))
        found = np.full(len(points), np.nan)
        if self.is_empty or not len(finite):
            found[finite] = -np.inf
            return found
        holds, depth = self._holds(points[finite]), self._depths(points[finite], factors)
        depth[(depth > 0.0) & ~holds] = 0.0
        depth[(depth < 0.0) & holds] = 0.0
        found[finite] = depth
        return found

    @abstractmethod
    def _holds(self, points: Array) -> Flags:
        """Return whether points (N, 2), finite, are inside one that is not empty."""

    @abstractmethod
    def _depths(self, points: Array, factors: Array) -> Array:
        """Return how far points (N, 2), finite, are inside the contour alone; negative outside."""
