"""The feasible region in the plane of two coordinates, its edges named.

Two ways lead to it. If every boundary has one effective angle in the plane, the component that holds home is an
intersection of half-planes: convex, closed form, exact. Otherwise contact curves are traced (`contours`) and the faces
between them found (`arrangement`), to a stated accuracy. `docs/regions.md` has the mathematics of both.

Which points are inside is told in `inside`. A plane of an angle and a prismatic joint has no distance of its own: what
would add radians and metres takes `weights`, or is refused.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, cast

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from pinbound.exceptions import DimensionError, UnsupportedError
from pinbound.region import convex, inside, margins
from pinbound.region.arrangement import Corner, Edge, Line, Unresolved
from pinbound.region.deadline import Deadline
from pinbound.region.halfplanes import HalfPlane, Support, intersect, support
from pinbound.region.plane import Plane
from pinbound.tolerances import REGION_ACCURACY, REGION_BUDGET

__all__ = ["Corner", "Edge", "Region", "convex_region"]

Array = NDArray[np.float64]
gis = cast(Any, shapely)  # its stubs know only part of what its functions take
Loops = tuple[tuple[Edge, ...], ...]

_PLANE = 2


@dataclass(frozen=True, eq=False)
class Region:
    """A connected part of the free set, in the plane of two coordinates. Made by `feasible_region`.

    Attributes:
        plane: The plane: robot, coordinates, limits and contacts.
        loops: Named edges of the exterior, counter-clockwise, then of each hole, clockwise.
        corners: Where two edges meet, in the order of the loops.
        accuracy: [rad or m]; no point of the true contour is further than this from the edges. Zero if all is straight.
        planes: Every half-plane that bounds it, edges and implied ones alike, if it is convex in closed form.
        unresolved: Places on its contour, each with its two coordinates, that are too small to be resolved: there a
            contact curve may cross itself, and it is undecided whether parts meet. The region is the reading in
            which they do not; `joined_area` is the area if they do.
    """

    plane: Plane
    loops: Loops
    corners: tuple[Corner, ...]
    accuracy: float
    planes: tuple[HalfPlane, ...] = ()
    _lines: tuple[Line, ...] = field(default=(), repr=False, compare=False)
    _others: Callable[[], tuple[Region, ...]] | None = field(default=None, repr=False, compare=False)
    unresolved: tuple[Unresolved, ...] = ()
    _joined: float | None = field(default=None, repr=False, compare=False)

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
        if not self.unresolved:
            return ""
        places = [
            f"{place.name} at ({', '.join(f'{n} = {v:.9g} {u}' for n, v, u in zip(*axes, strict=True))})"
            for place in self.unresolved
            for axes in ((self.coordinates, place.point, self.units),)
        ]
        text = f"UNDECIDED whether parts meet in a point of contact: {'; '.join(places)}"
        if self.joined_area > self.area:
            text += f"; not joined, area {self.area:.6g} {self.area_unit}; joined, {self.joined_area:.6g}"
        return text

    @property
    def joined_area(self) -> float:
        """Area [`area_unit`] if all parts that meet at `unresolved` places are joined there; else `area`."""
        return self.area if self._joined is None else max(self._joined, self.area)

    @property
    def units(self) -> tuple[str, str]:
        """The unit of each coordinate: ``"rad"``, or ``"m"`` of a prismatic joint."""
        return self.plane.units

    @property
    def area_unit(self) -> str:
        """The unit of `area`: ``"rad^2"``, ``"m^2"``, or ``"m rad"`` of an angle and a prismatic joint."""
        first, second = sorted(self.units)
        return f"{first}^2" if first == second else f"{first} {second}"

    @property
    def coordinates(self) -> tuple[str, str]:
        """The two coordinates of the plane."""
        return self.plane.coordinates

    @property
    def robot_coordinates(self) -> tuple[str, ...]:
        """All active coordinates of the robot."""
        return self.plane.robot.coordinates

    @property
    def at(self) -> Array:
        """(n,) where the other coordinates are held."""
        return self.plane.at

    @property
    def fixed(self) -> tuple[str, ...]:
        """Other coordinates that some boundary or limit depends on: a q inside must have them as in `at`."""
        return self.plane.fixed

    @cached_property
    def edges(self) -> tuple[Edge, ...]:
        """All edges, those of the exterior first; the region lies to the left of each."""
        return tuple(edge for loop in self.loops for edge in loop)

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
    def is_convex(self) -> bool:
        """Whether it is a convex polygon with straight edges."""
        if self.planes or self.is_empty:
            return True
        return all(len(edge.points) == _PLANE for edge in self.edges) and convex.is_convex(self.polygon)

    @cached_property
    def _cell(self) -> tuple[Array, tuple[HalfPlane, ...]]:
        return intersect(self.planes)

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

        Both are taken in units of `Plane.scales`, which is one of rad and m or less.
        """
        scales = self.plane.scales
        curved = [edge.points / scales for edge in self.edges if len(edge.points) > _PLANE]
        length = float(sum(np.sum(np.linalg.norm(np.diff(p, axis=0), axis=1)) for p in curved))
        return self.accuracy / float(np.max(scales)) * length * float(np.prod(scales))

    def perimeter(self, weights: Mapping[str, float] | None = None) -> float:
        """Return the length of the contour, holes included [rad or m, or the unit of the weights].

        Args:
            weights: By coordinate, how much one radian or metre of it counts; needed where the two units differ.

        Raises:
            DimensionError: If radians and metres would be added.
        """
        return float(inside.weighted(self.polygon, inside.metric(self.plane, weights, "the perimeter")).length)

    @property
    def centroid(self) -> Array:
        """(2,) centre of area [rad or m]; NaN if the region is empty."""
        return np.array([self.polygon.centroid.x, self.polygon.centroid.y]) if not self.is_empty else np.full(2, np.nan)

    def supports(self, weights: Mapping[str, float] | None = None) -> dict[str, Support]:
        """Return, for everything that could bound the region, its slack and, if convex, the edges that imply it.

        Slack is zero for an edge. For a convex region it is measured along the half-plane's normal; otherwise it is
        the distance from the region to the limit or contact curve, and boundaries without a curve here are left out.
        It is in rad or m; where it would add both, it is NaN without weights.

        Args:
            weights: By coordinate, how much one radian or metre of it counts.

        Example:
            >>> import pinbound as pb
            >>> region = pb.feasible_region(pb.load("minervabot_v3"))
            >>> region.supports()["beta_1"].by
            ('beta_4',)
        """
        mixed = weights is None and self.units[0] != self.units[1]
        factors = np.ones(_PLANE) if mixed else inside.metric(self.plane, weights, "the slack")
        found: dict[str, Support] = {}
        if self.planes and not self.is_empty:
            for plane in self.planes:
                one = support(self.vertices, self._cell[1], plane, factors)
                if mixed and one.slack and np.all(plane.normal):
                    one = Support(float("nan"), one.by)
                if plane.name not in found or not one.slack >= found[plane.name].slack:
                    found[plane.name] = one
            return found
        names = {edge.name for edge in self.edges}
        found = {name: Support(0.0, ()) for name in names}
        polygon = inside.weighted(self.polygon, factors)
        for line in self._lines:
            if line.name in names:
                continue
            drawn = inside.weighted(gis.linestrings(line.points), factors)
            slack = float("nan") if mixed else float(polygon.distance(drawn))
            if line.name not in found or slack < found[line.name].slack:
                found[line.name] = Support(slack, ())
        return found

    def halfspaces(self) -> tuple[Array, Array]:
        """Return A (k, 2) and b (k,) with `A x <= b`, rows of unit length, one an edge.

        Raises:
            UnsupportedError: If the region is not a convex polygon; see `convex_parts` and `inscribed_polygon`.

        Example:
            >>> import pinbound as pb
            >>> region = pb.feasible_region(pb.load("minervabot_v3"))
            >>> A, b = region.halfspaces()
            >>> bool(np.all(A @ region.centroid < b))
            True
        """
        if self.planes:
            planes = self._cell[1]
            lengths = np.array([np.linalg.norm(plane.normal) for plane in planes])
            normals = np.array([plane.normal for plane in planes]).reshape(-1, _PLANE)
            return normals / lengths[:, None], np.array([plane.bound for plane in planes]) / lengths
        if not self.is_convex:
            raise UnsupportedError(
                "the region is not a convex polygon, so no A q <= b describes it; "
                "use inscribed_polygon() for a convex part of it, or convex_parts() for all of it"
            )
        return convex.polygon_halfspaces(self.polygon)

    def points(self, Q: ArrayLike, order: inside.Order | None = None) -> Array:
        """Return the region's two coordinates (N, 2) of q's; rows of another slice, or not finite, become NaN.

        Args:
            Q: As in `contains`.
            order: As in `contains`.
        """
        reading = inside.read_points(self.plane, Q, order)
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
        reading = inside.read_points(self.plane, Q, order)
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
        reading = inside.read_points(self.plane, Q, order)
        inside.refuse_elsewhere(self.plane, reading)
        found = inside.held(self, reading.points) & reading.within & reading.finite
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
        factors = inside.metric(self.plane, weights, "the signed distance")
        reading = inside.read_points(self.plane, Q, order)
        reading.points[np.any(reading.elsewhere, axis=1) | ~reading.finite] = np.nan
        distance = inside.signed_distances(self, reading.points, factors)
        distance[~reading.within & ~np.isnan(distance)] = -np.inf
        return distance if np.ndim(Q) > 1 else float(distance[0])

    def scale(self, factor: float) -> Region:
        """Return the region scaled about its centroid, the paper's safety margin; edges keep their names.

        A convex region holds every smaller copy of itself. Another one need not, and then the copy is refused.

        Raises:
            DimensionError: If the factor is not in (0, 1]: beyond 1 the region would leave the feasible one.
            LeavesRegionError: If the scaled region leaves the feasible one; `witness` is a q that does.

        Example:
            >>> import pinbound as pb
            >>> region = pb.feasible_region(pb.load("minervabot_v3"))
            >>> round(region.scale(0.9).area / region.area, 12)
            0.81
        """
        if not 0.0 < factor <= 1.0:
            raise DimensionError(f"the factor {factor} is not in (0, 1]; beyond 1 the region leaves the feasible one")
        centre = self.centroid
        if self.planes:
            return self._with(
                HalfPlane(
                    p.source,
                    p.name,
                    p.normal,
                    factor * p.bound + (1 - factor) * float(p.normal @ centre),
                    p.is_contact,
                )
                for p in self.planes
            )
        margins.check_scaled(self.polygon, factor, self.plane, self.accuracy)
        return self._moved(lambda x: centre + factor * (x - centre))

    def inset(self, angle: float, weights: Mapping[str, float] | None = None, budget: float = REGION_BUDGET) -> Region:
        """Return the points at least `angle` [rad or m] inside every edge; it may be empty.

        Where edges are curved the inset is deeper by `accuracy` and its own rounding, so that "at least" holds. If it
        falls apart, the part that holds the start is returned, or the largest; `components` has all.

        Args:
            angle: How far inside.
            weights: By coordinate, how much one radian or metre of it counts; needed where the two units differ.
            budget: [s], after which it ends in an error.

        Raises:
            DimensionError: If the angle is negative or not finite, or radians and metres would be added.
            UnsupportedError: If the budget runs out.
        """
        if not 0.0 <= angle < math.inf:
            raise DimensionError(f"the inset {angle} is not a finite angle of zero or more")
        factors = inside.metric(self.plane, weights, "an inset")
        if self.planes:
            return self._with(plane.inset(angle, factors) for plane in self.planes)
        scales = self.plane.scales
        accuracy = self.accuracy * float(np.max(factors * scales)) / float(np.max(scales))
        deadline = Deadline(budget, f"the inset by {angle:g}")
        parts = margins.inset_parts(self.polygon, self.edges, angle, accuracy, self.plane.start, factors, deadline)
        return _of_loops(self.plane, parts, self.accuracy)

    def with_clearance(self, margin: float) -> Region:
        """Return the feasible region with every threshold raised by a margin [m]: the metric safety margin.

        Raises:
            DimensionError: If the margin is negative or not finite, or the start has less clearance than that.

        Example:
            >>> import pinbound as pb
            >>> region = pb.feasible_region(pb.load("minervabot_v3"))
            >>> near = region.with_clearance(0.005)
            >>> near.area < region.area, near.clearance().lower > 0.00499
            (True, True)
        """
        if not 0.0 <= margin < math.inf:
            raise DimensionError(f"the margin {margin} is not a finite length of zero or more")
        low, high = self.plane.window
        window = {name: (float(low[i]), float(high[i])) for i, name in enumerate(self.coordinates)}
        from pinbound.region.feasible import feasible_region  # which makes what this module describes

        accuracy = self.accuracy or REGION_ACCURACY
        return feasible_region(
            self.plane.robot, self.coordinates, self.at, window, accuracy, self.plane.margin + margin
        )

    def clearance(self, gap: float = 1e-6) -> margins.SmallestClearance:
        """Return proven bounds of the smallest clearance of any boundary over the region.

        Args:
            gap: [m], how far apart the two bounds may be.

        Example:
            >>> import pinbound as pb
            >>> found = pb.feasible_region(pb.load("minervabot_v3")).scale(0.9).clearance()
            >>> found.boundary, found.lower > 0.0, found.upper - found.lower <= 1e-6
            ('beta_3', True, True)
        """
        return margins.smallest_clearance(self.plane, self.polygon, gap)

    def inscribed_polygon(self, rim: float = 1e-3, weights: Mapping[str, float] | None = None) -> Region:
        """Return a large convex polygon inside the region; the region itself if it is a convex polygon.

        Args:
            rim: [rad or m], how far from the contour its simplified copy may stay, in which the polygon is grown.
            weights: By coordinate, how much one radian or metre of it counts; needed where the two units differ.

        Raises:
            DimensionError: If the rim is not positive, or radians and metres would be added.
        """
        if self.is_convex:
            return self
        found, factors = self._inner(rim, weights)
        return self._part(inside.weighted(convex.inscribed_polygon(found), 1.0 / factors))

    def convex_parts(self, rim: float = 1e-3, weights: Mapping[str, float] | None = None) -> tuple[Region, ...]:
        """Return convex polygons that do not overlap and together are the region, less a rim.

        Args:
            rim: [rad or m], how far from the contour the parts may stay; less rim, more parts.
            weights: By coordinate, how much one radian or metre of it counts; needed where the two units differ.

        Raises:
            DimensionError: If the rim is not positive, or radians and metres would be added.
        """
        if self.is_convex:
            return (self,)
        found, factors = self._inner(rim, weights)
        return tuple(self._part(inside.weighted(part, 1.0 / factors)) for part in convex.convex_parts(found))

    def _inner(self, rim: float, weights: Mapping[str, float] | None) -> tuple[Any, Array]:
        if not 0.0 < rim < math.inf:
            raise DimensionError(f"the rim {rim} is not a finite angle above zero")
        factors, scales = inside.metric(self.plane, weights, "the rim"), self.plane.scales
        accuracy = self.accuracy * float(np.max(factors * scales)) / float(np.max(scales))
        return convex.inner(inside.weighted(self.polygon, factors), rim, accuracy), factors

    def _part(self, polygon: Any) -> Region:
        A, b = convex.polygon_halfspaces(polygon)
        vertices = gis.get_coordinates(gis.orient_polygons(polygon).exterior)
        middle = gis.points(0.5 * (vertices[1:] + vertices[:-1]))
        tree = gis.STRtree([gis.linestrings(edge.points) for edge in self.edges])
        near = [self.edges[int(i)] for i in np.asarray(tree.nearest(middle))]
        edges = tuple(
            Edge(e.name, e.source, e.is_contact, vertices[i], vertices[i + 1], vertices[i : i + 2])
            for i, e in enumerate(near)
        )
        planes = tuple(
            HalfPlane(e.source, e.name, normal, float(bound), e.is_contact)
            for e, normal, bound in zip(near, A, b, strict=True)
        )
        return Region(self.plane, (edges,), margins.loop_corners((edges,)), 0.0, (*self.plane.box, *planes))

    def _with(self, planes: Any) -> Region:
        return convex_region(self.plane, tuple(planes))

    def _moved(self, move: Callable[[Array], Array]) -> Region:
        loops = tuple(
            tuple(Edge(e.name, e.source, e.is_contact, move(e.start), move(e.end), move(e.points)) for e in loop)
            for loop in self.loops
        )
        corners = tuple(Corner(move(c.point), c.before, c.after, c.polished) for c in self.corners)
        return Region(self.plane, loops, corners, self.accuracy)

    def __getstate__(self) -> dict[str, Any]:
        """Pickle the region without the way to its sister components, which is a closure."""
        kept = {key: value for key, value in self.__dict__.items() if key != "components"}
        return kept | {"_others": None if self._others is None else _left_behind}

    @cached_property
    def components(self) -> tuple[Region, ...]:
        """All connected components of the free set within the limits: this one first, then the largest first.

        Of an inset: the parts that it fell into. Components thinner than `accuracy` are left out.

        Example:
            >>> import pinbound as pb
            >>> len(pb.feasible_region(pb.load("minervabot_v3")).components)
            47
        """
        return (self, *(self._others() if self._others else ()))


def convex_region(
    plane: Plane, planes: tuple[HalfPlane, ...], others: Callable[[], tuple[Region, ...]] | None = None
) -> Region:
    """Return the intersection of half-planes, the first four of which bound it, as a region."""
    vertices, sides = intersect(planes)
    ends = np.roll(vertices, -1, axis=0)
    edges = tuple(
        Edge(side.name, side.source, side.is_contact, start, end, np.stack((start, end)))
        for side, start, end in zip(sides, vertices, ends, strict=True)
    )
    loops = (edges,) if edges else ()
    return Region(plane, loops, margins.loop_corners(loops), 0.0, planes, (), others)


def _of_loops(plane: Plane, parts: Sequence[Loops], accuracy: float) -> Region:
    """Return the first of several parts, the others as its components."""
    regions = tuple(Region(plane, loops, margins.loop_corners(loops), accuracy) for loops in parts)
    if not regions:
        return Region(plane, (), (), accuracy)
    first = regions[0]
    return Region(plane, first.loops, first.corners, accuracy, (), (), lambda: regions[1:])


def _left_behind() -> tuple[Region, ...]:
    raise UnsupportedError("an unpickled region does not know its sister components; derive the region again")
