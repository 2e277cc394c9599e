"""The feasible region in the plane of two coordinates, its edges named.

Two ways lead to it. If every boundary has one effective angle in the plane, the component that holds home is an
intersection of half-planes: convex, closed form, exact. Otherwise contact curves are traced (`contours`) and the faces
between them found (`arrangement`), to a stated accuracy. `docs/regions.md` has the mathematics of both.

`shape` has what a region is; here is what can be made of it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, cast

import numpy as np
import shapely

from pinbound.exceptions import DimensionError, UnsupportedError
from pinbound.region import convex, inside, margins
from pinbound.region.arrangement import Arrangement, Corner, Edge, arrange, arranged_loops
from pinbound.region.deadline import Deadline
from pinbound.region.halfplanes import HalfPlane, intersect
from pinbound.region.plane import Plane, plane_of
from pinbound.region.shape import PlanarShape
from pinbound.tolerances import REGION_ACCURACY, REGION_BUDGET, REGION_WIDTH
from pinbound.typing import Array

__all__ = ["Corner", "Edge", "Region", "convex_region", "region_of"]

gis = cast(Any, shapely)  # its stubs know only part of what its functions take
Loops = tuple[tuple[Edge, ...], ...]

_PLANE = 2


@dataclass(frozen=True, eq=False, repr=False)
class Region(PlanarShape):
    """A connected part of the free set, in the plane of two coordinates. Made by `feasible_region`.

    `PlanarShape` has its attributes: `plane`, `loops`, `corners`, `accuracy`, `planes` and `unresolved`.
    """

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
            raise DimensionError(
                f"the factor is {factor}, and beyond 1 the region leaves the feasible one; give above 0, at most 1"
            )
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
            raise DimensionError(f"the inset is {angle}; give radians, 0 or more")
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
            raise DimensionError(f"the margin is {margin}; give metres, 0 or more")
        low, high = self.plane.window
        window = {name: (float(low[i]), float(high[i])) for i, name in enumerate(self.coordinates)}
        plane = plane_of(self.plane.robot, self.coordinates, self.at, window, self.plane.margin + margin)
        return region_of(plane, self.accuracy or REGION_ACCURACY, self.width or REGION_WIDTH)

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
            raise DimensionError(f"the rim is {rim}; give radians above 0")
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


def region_of(
    plane: Plane, accuracy: float = REGION_ACCURACY, width: float = REGION_WIDTH, budget: float = REGION_BUDGET
) -> Region:
    """Return the component of a plane's free set that holds its start; arguments as for `feasible_region`.

    Raises:
        UnsupportedError: If a contact curve is degenerate along its length, or the budget runs out.
    """
    deadline = Deadline(budget, f"tracing the region of ({', '.join(plane.coordinates)})")
    if plane.curves or plane.obstacles:
        arrangement = arrange(plane, accuracy, deadline, width)
        return _of_face(arrangement, 0, accuracy, True, width)
    planes = [*plane.box, *plane.limits]
    for strip in plane.strips:
        lower, upper = strip.gap(plane.start)
        planes.append(HalfPlane(strip.name, strip.name, strip.normal, upper, True))
        planes.append(HalfPlane(strip.name, strip.name, -strip.normal, -lower, True))

    def others() -> tuple[Region, ...]:
        within = Deadline(budget, "drawing the other components")
        arrangement = arrange(plane, accuracy, within)
        return tuple(_of_face(arrangement, i, accuracy) for i in within.each(range(1, len(arrangement.faces))))

    return convex_region(plane, tuple(planes), others)


def _of_face(
    arrangement: Arrangement, index: int, accuracy: float, with_others: bool = False, width: float = 0.0
) -> Region:
    plane = arrangement.plane
    loops, corners = arranged_loops(arrangement, arrangement.faces[index], accuracy)

    def others() -> tuple[Region, ...]:
        return tuple(_of_face(arrangement, other, accuracy, width=width) for other in range(1, len(arrangement.faces)))

    return Region(
        plane,
        loops,
        corners,
        arrangement.chord_error * float(np.max(plane.scales)),
        _lines=arrangement.drawn,
        _others=others if with_others else None,
        unresolved=arrangement.unresolved(index),
        _joined=arrangement.joined_area(index) if arrangement.blocks else None,
        _interval=arrangement.area_interval(index),
        width=width if arrangement.settled else 0.0,
    )


def _of_loops(plane: Plane, parts: Sequence[Loops], accuracy: float) -> Region:
    """Return the first of several parts, the others as its components."""
    regions = tuple(Region(plane, loops, margins.loop_corners(loops), accuracy) for loops in parts)
    if not regions:
        return Region(plane, (), (), accuracy)
    first = regions[0]
    return Region(plane, first.loops, first.corners, accuracy, (), (), lambda: regions[1:])


def _left_behind() -> tuple[Region, ...]:
    raise UnsupportedError("an unpickled region does not know its sister components; derive the region again")
