"""What a region is: named edges around a part of a plane, its area and units, and the points that it holds.

`region` makes regions, and others of them. Which points are inside is told in `inside`. A plane of an angle and a
prismatic joint has no distance of its own: what would add radians and metres takes `weights`, or is refused.
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
    """Where a region is: its edges, its area, what it implies, and which points it holds.

    Attributes:
        slice: The plane: robot, coordinates, limits and contacts.
        loops: Named edges of the exterior, counter-clockwise, then of each hole, clockwise.
        corners: Where two edges meet, in the order of the loops.
        accuracy: [rad or m]; no point of the true contour is further than this from the edges. Zero if all is straight.
        unresolved: Places on its contour, each with its two coordinates, that are too small to be resolved: there a
            contact curve may cross itself, and it is undecided whether parts meet. The region is the reading in
            which they do not; `joined_area` is the area if they do.
        width: [rad or m]; contact curves that are searched for are enclosed in cells of this side; zero if there are
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
        """What is undecided, in one sentence for people; empty if nothing is."""
        return ""

    @property
    def joined_area(self) -> float:
        """Area [`area_unit`] if all parts that meet at `unresolved` places are joined there; else `area`."""
        return self.area

    @cached_property
    def slits(self) -> tuple[Slit, ...]:
        """Walls that end inside it, of loops whose passive joints jump by a turn there: a motion has to go round them.

        Both sides belong to the region; empty for all robots but those with loops that are no parallelograms.
        """
        if self.slice.lifted is None or self.polygon.is_empty:
            return ()
        slice_, edges = self.slice, dict[str, Any]()
        for name in {edge.name for edge in self.edges}:
            edges[name] = gis.multilinestrings([gis.linestrings(e.points) for e in self.edges if e.name == name])
        return slits_in(self.slice.lifted, slice_.scales, slice_.window, self.polygon, edges, self.accuracy)

    @property
    def units(self) -> tuple[str, str]:
        """The unit of each coordinate: ``"rad"``, or ``"m"`` of a prismatic joint."""
        return self.slice.units

    @property
    def area_unit(self) -> str:
        """The unit of `area`: ``"rad^2"``, ``"m^2"``, or ``"m rad"`` of an angle and a prismatic joint."""
        return units.product(self.units)

    @property
    def coordinates(self) -> tuple[str, str]:
        """The two coordinates of the plane."""
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
        """Other coordinates that some boundary or limit depends on: a q inside must have them as in `at`."""
        return self.slice.fixed

    @cached_property
    def edges(self) -> tuple[Edge, ...]:
        """All edges, those of the exterior first; the region lies to the left of each."""
        return tuple(edge for loop in self.loops for edge in loop)

    def touching(self, edge: Edge) -> tuple[Touch, ...]:
        """Return which parts of the two bodies touch along a contact edge: a vertex, an edge or a face of each.

        One `Touch` for each stretch of `edge.points`, in their order. Vertices are counted in `mark.shape.vertices`.

        Raises:
            UnknownNameError: If the edge is a joint limit or a rule.
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
        """(k, 2) where each edge starts [rad or m], in the order of `edges`."""
        starts = np.array([edge.start for edge in self.edges]).reshape(-1, _PLANE)
        starts.flags.writeable = False
        return starts

    @property
    def is_empty(self) -> bool:
        """Whether nothing is left."""
        return not self.loops

    @property
    @abstractmethod
    def is_convex(self) -> bool:
        """Whether it is a convex polygon with straight edges."""

    @cached_property
    def polygon(self) -> Any:
        """The region as a `shapely.Polygon`, holes included."""
        rings = [np.concatenate([edge.points[:-1] for edge in loop]) for loop in self.loops]
        return gis.Polygon(rings[0], rings[1:]) if rings else gis.Polygon()

    @property
    def area(self) -> float:
        """Area [`area_unit`], by the boundary integral (shoelace)."""
        return float(self.polygon.area)

    @property
    def area_error(self) -> float:
        """[`area_unit`], a bound of what the accuracy leaves open: accuracy times the length of the curved edges.

        Both are taken in units of `Slice.scales`, which is one of rad and m or less. Where contact is searched for it
        is how far `area_interval` reaches from `area`.
        """
        return 0.0

    @property
    def area_interval(self) -> tuple[float, float]:
        """Bounds of the area [`area_unit`] of the true region: proven of contacts that are searched for.

        Of those, from the part that is proven free and connected with the start to all that undecided cells may add;
        else `area` less and plus `area_error`.
        """
        return max(self.area - self.area_error, 0.0), max(self.area + self.area_error, self.joined_area)

    def perimeter(self, weights: Mapping[str, float] | None = None) -> float:
        """Return the length of the contour, holes included [rad or m, or the unit of the weights].

        Args:
            weights: The weight of one radian or metre of each coordinate, by name; needed if the two units differ.

        Raises:
            DimensionError: If radians and metres would be added.
        """
        return float(inside.weighted(self.polygon, inside.metric(self.slice, weights, "the perimeter")).length)

    @property
    def centroid(self) -> Array:
        """(2,) centre of area [rad or m]; NaN if the region is empty."""
        if self.is_empty:
            return read_only(np.full(2, np.nan))
        return read_only(np.array([self.polygon.centroid.x, self.polygon.centroid.y]))

    @abstractmethod
    def supports(self, weights: Mapping[str, float] | None = None) -> dict[str, Support]:
        """Return, for everything that could bound the region, its slack and, if convex, the edges that imply it.

        Slack is zero for an edge. For a convex region it is measured along the half-plane's normal; otherwise it is
        the distance from the region to the limit or contact curve, and boundaries without a curve here are left out.
        It is in rad or m; where it would add both, it is NaN without weights.

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
        """Return the region's two coordinates (N, 2) of q's; rows of another slice, or not finite, become NaN.

        Args:
            Q: As in `contains`.
            order: As in `contains`.
        """
        reading = inside.read_points(self.slice, Q, order)
        reading.points[np.any(reading.elsewhere, axis=1) | ~reading.finite] = np.nan
        return reading.points

    def applies(self, Q: ArrayLike, order: inside.Order | None = None) -> Any:
        """Return whether the region can tell of q: finite, and its held coordinates as in `at` where they matter.

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

        Limits belong to the region, and may be passed by `tolerances.LIMIT`; contact does not. A point counts as inside
        only if the exact clearances say so too, so that no chord ever hides a contact; a point nearer to a curved
        edge than `accuracy` may count as outside. The limits of all held coordinates count, mimic joints' too.

        Args:
            Q: (n,) or (N, n) configurations of the robot, or (2,) or (N, 2) points of the plane.
            order: ``"robot"``: Q holds configurations, ``"region"``: points of the plane, in the order of
                `coordinates`. By default the last axis tells; it cannot if the robot has two coordinates and the plane
                has them in another order.

        Raises:
            DimensionError: If Q has another shape or could be read in two ways, or a held coordinate, on which some
                boundary or limit depends (`fixed`), is not as in `at`: this slice does not know (`applies` tells).

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
        """Return the Euclidean distance to the contour in the plane [rad or m]: positive inside, negative outside.

        For curved edges it is that to the polyline, right to `accuracy`; a point in contact never gets a positive one.
        It is zero on the contour, of which limits belong to the region and contacts do not.

        Args:
            Q: As in `contains`.
            order: As in `contains`.
            weights: By coordinate, how much one radian or metre of it counts, `|(w_1 dx_1, w_2 dx_2)|`; needed where
                the two units differ.

        Returns:
            A float, or (N,); NaN for non-finite rows and for rows of another slice; -inf if the region is empty, or a
            held coordinate is out of limits.

        Raises:
            DimensionError: If Q has another shape or could be read in two ways, or radians and metres would be added.

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
