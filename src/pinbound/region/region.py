"""The feasible region in a slice of two coordinates, with named edges.

If each boundary has one effective angle in the slice, half-planes bound the region; else curves (`docs/regions.md`).
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, cast

import numpy as np
import shapely

from pinbound.deprecation import renamed
from pinbound.exceptions import DimensionError, UnsupportedError
from pinbound.region import convex, inside, margins
from pinbound.region.arrangement import Arrangement, Corner, Edge, Line, arrange, arranged_loops
from pinbound.region.deadline import Deadline
from pinbound.region.halfplanes import HalfPlane, Support, intersect, support
from pinbound.region.shape import PlanarShape
from pinbound.region.shown import Shown
from pinbound.region.slice import Slice, slice_of
from pinbound.tolerances import REGION_ACCURACY, REGION_BUDGET
from pinbound.typing import Array, Flags

__all__ = ["ConvexRegion", "Corner", "Edge", "Region", "TracedRegion", "convex_region", "region_of"]

gis = cast(Any, shapely)  # its stubs know only part of what its functions take
Loops = tuple[tuple[Edge, ...], ...]
_PLANE = 2


@dataclass(frozen=True, eq=False, repr=False)
class Region(Shown, PlanarShape):
    """A connected component of the free set in a slice of two coordinates: a `ConvexRegion` or a `TracedRegion`.

    Attributes:
        half_planes: Every half-plane that bounds it, edges and implied half-planes, if it is convex in closed form.

    Example:
        >>> import pinbound as pb
        >>> region = pb.feasible_region(pb.load("minervabot_v3"), ("q2", "q3"))
        >>> region.is_convex, len(region.edges)
        (True, 6)
    """

    half_planes: tuple[HalfPlane, ...] = ()
    _others: Callable[[], tuple[Region, ...]] | None = field(default=None, repr=False, compare=False)

    @property
    def plane(self) -> Slice:
        """Old name of `slice`, for one release."""
        return renamed(self.slice, "Region.plane", "Region.slice")

    @property
    def planes(self) -> tuple[HalfPlane, ...]:
        """Old name of `half_planes`, for one release."""
        return renamed(self.half_planes, "Region.planes", "Region.half_planes")

    @abstractmethod
    def scale(self, factor: float) -> Region:
        """Return the region scaled about its centroid (the paper's safety margin); edges keep their names.

        A convex region holds every smaller copy of itself. If another region does not hold the copy, the copy is
        refused.

        Raises:
            DimensionError: If the factor is not in (0, 1]: beyond 1 the region would leave the feasible one.
            LeavesRegionError: If the scaled region leaves the feasible region; `witness` is a q outside it.

        Example:
            >>> import pinbound as pb
            >>> region = pb.feasible_region(pb.load("minervabot_v3"))
            >>> round(region.scale(0.9).area / region.area, 12)
            0.81
        """

    @abstractmethod
    def inset(self, angle: float, weights: Mapping[str, float] | None = None, budget: float = REGION_BUDGET) -> Region:
        """Return the points at least `angle` [rad or m] inside every edge; it may be empty.

        At curved edges the inset is deeper by `accuracy` and its own rounding, so that "at least" is true. If the inset
        has several parts, the part with the start is returned, or the largest part; `components` has all parts.

        Args:
            angle: The least distance from every edge [rad or m].
            weights: The weight of one radian or metre of each coordinate, by name; needed if the two units differ.
            budget: [s], after which the work ends with an error.

        Raises:
            DimensionError: If the angle is negative or not finite, or radians and metres would be added.
            UnsupportedError: If the budget is spent.
        """

    def with_clearance(self, margin: float) -> Region:
        """Return the feasible region with a margin [m] added to every threshold: a metric safety margin.

        Raises:
            DimensionError: If the margin is negative or not finite, or if the start has less clearance.

        Example:
            >>> import pinbound as pb
            >>> region = pb.feasible_region(pb.load("minervabot_v3"))
            >>> near = region.with_clearance(0.005)
            >>> near.area < region.area, near.clearance().lower > 0.00499
            (True, True)
        """
        if not 0.0 <= margin < math.inf:
            raise DimensionError(f"the margin is {margin}; give metres, 0 or more")
        low, high = self.slice.window
        window = {name: (float(low[i]), float(high[i])) for i, name in enumerate(self.coordinates)}
        slice_ = slice_of(self.slice.robot, self.coordinates, self.at, window, self.slice.margin + margin)
        return region_of(slice_, self.accuracy or REGION_ACCURACY, self.width or None)

    def clearance(self, gap: float = 1e-6) -> margins.SmallestClearance:
        """Return proven bounds of the smallest clearance of any boundary over the region.

        Args:
            gap: [m], the largest difference of the two bounds.

        Example:
            >>> import pinbound as pb
            >>> found = pb.feasible_region(pb.load("minervabot_v3")).scale(0.9).clearance()
            >>> found.boundary, found.lower > 0.0, found.upper - found.lower <= 1e-6
            ('beta_3', True, True)
        """
        return margins.smallest_clearance(self.slice, self.polygon, gap)

    @abstractmethod
    def inscribed_polygon(self, rim: float = 1e-3, weights: Mapping[str, float] | None = None) -> Region:
        """Return a large convex polygon inside the region; the region itself if it is a convex polygon.

        Args:
            rim: [rad or m], the largest distance of a simplified contour, in which the polygon grows, from the contour.
            weights: The weight of one radian or metre of each coordinate, by name; needed if the two units differ.

        Raises:
            DimensionError: If the rim is not positive, or radians and metres would be added.
        """

    @abstractmethod
    def convex_parts(self, rim: float = 1e-3, weights: Mapping[str, float] | None = None) -> tuple[Region, ...]:
        """Return convex polygons that do not overlap and together cover the region except a rim.

        Args:
            rim: [rad or m], the largest width of the rim; a smaller rim gives more parts.
            weights: The weight of one radian or metre of each coordinate, by name; needed if the two units differ.

        Raises:
            DimensionError: If the rim is not positive, or radians and metres would be added.
        """

    def __getstate__(self) -> dict[str, Any]:
        """Pickle the region without the way to its sister components, which is a closure."""
        kept = {key: value for key, value in self.__dict__.items() if key != "components"}
        return kept | {"_others": None if self._others is None else _left_behind}

    @cached_property
    def components(self) -> tuple[Region, ...]:
        """All connected components of the free set within the limits: this component first, then by size.

        For an inset: all its parts. Components thinner than `accuracy` are left out.

        Example:
            >>> import pinbound as pb
            >>> len(pb.feasible_region(pb.load("minervabot_v3")).components)
            47
        """
        return (self, *(self._others() if self._others else ()))


@dataclass(frozen=True, eq=False, repr=False)
class ConvexRegion(Region):
    """An intersection of half-planes: closed form, exact. Made by `convex_region`."""

    @property
    def is_convex(self) -> bool:
        """True."""
        return True

    @cached_property
    def _sides(self) -> tuple[HalfPlane, ...]:
        return intersect(self.half_planes)[1]

    def supports(self, weights: Mapping[str, float] | None = None) -> dict[str, Support]:
        """Return the slack of every half-plane and the edges that imply it; see `PlanarShape.supports`."""
        factors, mixed = self._slack_factors(weights)
        found: dict[str, Support] = {}
        for half_plane in () if self.is_empty else self.half_planes:
            one = support(self.vertices, self._sides, half_plane, factors)
            if mixed and one.slack and np.all(half_plane.normal):
                one = Support(float("nan"), one.by)
            if half_plane.name not in found or not one.slack >= found[half_plane.name].slack:
                found[half_plane.name] = one
        return found

    def halfspaces(self) -> tuple[Array, Array]:
        """Return A (k, 2) and b (k,) with `A x <= b`: one row of unit length for each edge."""
        lengths = np.array([np.linalg.norm(side.normal) for side in self._sides])
        normals = np.array([side.normal for side in self._sides]).reshape(-1, _PLANE)
        return normals / lengths[:, None], np.array([side.bound for side in self._sides]) / lengths

    def scale(self, factor: float) -> ConvexRegion:
        """Return the region scaled about its centroid, which is always inside it; see `Region.scale`."""
        _check_factor(factor)
        centre = self.centroid
        moved = [(half, factor * half.bound + (1 - factor) * float(half.normal @ centre)) for half in self.half_planes]
        return convex_region(self.slice, tuple(replace(half, bound=bound) for half, bound in moved))

    def inset(
        self, angle: float, weights: Mapping[str, float] | None = None, budget: float = REGION_BUDGET
    ) -> ConvexRegion:
        """Return the points at least `angle` inside every half-plane, exactly; see `Region.inset`."""
        _check_angle(angle)
        factors = inside.metric(self.slice, weights, "an inset")
        return convex_region(self.slice, tuple(half.inset(angle, factors) for half in self.half_planes))

    def inscribed_polygon(self, rim: float = 1e-3, weights: Mapping[str, float] | None = None) -> ConvexRegion:
        """Return the region itself."""
        return self

    def convex_parts(self, rim: float = 1e-3, weights: Mapping[str, float] | None = None) -> tuple[ConvexRegion, ...]:
        """Return the region itself."""
        return (self,)

    def _holds(self, points: Array) -> Flags:
        return inside.in_half_planes(self.slice, self.half_planes, points)

    def _depths(self, points: Array, factors: Array) -> Array:
        polygon = inside.weighted(self.polygon, factors)
        return inside.depths_in_half_planes(*self.halfspaces(), polygon, points, factors)


@dataclass(frozen=True, eq=False, repr=False)
class TracedRegion(Region):
    """A region whose contact curves are traced to an accuracy."""

    _lines: tuple[Line, ...] = field(default=(), repr=False, compare=False)
    _joined: float | None = field(default=None, repr=False, compare=False)
    _interval: tuple[float, float] | None = field(default=None, repr=False, compare=False)

    @property
    def is_convex(self) -> bool:
        """Whether it is a convex polygon with straight edges."""
        straight = all(len(edge.points) == _PLANE for edge in self.edges)
        return self.is_empty or (straight and convex.is_convex(self.polygon))

    @property
    def unresolved_text(self) -> str:
        """One sentence about undecided places, for people; empty if there are none."""
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
    def area_error(self) -> float:
        """[`area_unit`]; see `PlanarShape.area_error`."""
        if self._interval is not None:
            lower, upper = self.area_interval
            return max(self.area - lower, upper - self.area)
        scales = self.slice.scales
        curved = [edge.points / scales for edge in self.edges if len(edge.points) > _PLANE]
        length = float(sum(np.sum(np.linalg.norm(np.diff(p, axis=0), axis=1)) for p in curved))
        return self.accuracy / float(np.max(scales)) * length * float(np.prod(scales))

    @property
    def area_interval(self) -> tuple[float, float]:
        """Bounds of the area [`area_unit`] of the true region; see `PlanarShape.area_interval`."""
        if self._interval is not None:
            return min(self._interval[0], self.area), max(self._interval[1], self.area)
        return super().area_interval

    def supports(self, weights: Mapping[str, float] | None = None) -> dict[str, Support]:
        """Return the distance from the region to every limit and contact curve; see `PlanarShape.supports`."""
        factors, mixed = self._slack_factors(weights)
        names = {edge.name for edge in self.edges}
        found = dict.fromkeys(names, Support(0.0, ()))
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
        """Return A (k, 2) and b (k,) with `A x <= b`: one row of unit length for each edge.

        Raises:
            UnsupportedError: If the region is not a convex polygon; see `convex_parts` and `inscribed_polygon`.
        """
        if not self.is_convex:
            raise UnsupportedError(
                "the region is not a convex polygon, so no A q <= b describes it; "
                "use inscribed_polygon() for a convex part of it, or convex_parts() for all of it"
            )
        return convex.polygon_halfspaces(self.polygon)

    def scale(self, factor: float) -> TracedRegion:
        """Return the region scaled about its centroid, if the copy stays inside; see `Region.scale`."""
        _check_factor(factor)
        centre = self.centroid
        margins.check_scaled(self.polygon, factor, self.slice, self.accuracy)
        loops, corners = margins.moved(self.loops, self.corners, lambda x: centre + factor * (x - centre))
        return TracedRegion(self.slice, loops, corners, self.accuracy)

    def inset(self, angle: float, weights: Mapping[str, float] | None = None, budget: float = REGION_BUDGET) -> Region:
        """Return the points at least `angle` inside every edge; see `Region.inset`."""
        _check_angle(angle)
        factors = inside.metric(self.slice, weights, "an inset")
        scales = self.slice.scales
        accuracy = self.accuracy * float(np.max(factors * scales)) / float(np.max(scales))
        deadline = Deadline(budget, f"the inset by {angle:g}")
        parts = margins.inset_parts(self.polygon, self.edges, angle, accuracy, self.slice.start, factors, deadline)
        return _of_loops(self.slice, parts, self.accuracy)

    def inscribed_polygon(self, rim: float = 1e-3, weights: Mapping[str, float] | None = None) -> Region:
        """Return a large convex polygon inside the region; see `Region.inscribed_polygon`."""
        if self.is_convex:
            return self
        found, factors = self._inner(rim, weights)
        return self._part(inside.weighted(convex.inscribed_polygon(found), 1.0 / factors))

    def convex_parts(self, rim: float = 1e-3, weights: Mapping[str, float] | None = None) -> tuple[Region, ...]:
        """Return convex polygons that do not overlap and together cover the region except a rim."""
        if self.is_convex:
            return (self,)
        found, factors = self._inner(rim, weights)
        return tuple(self._part(inside.weighted(part, 1.0 / factors)) for part in convex.convex_parts(found))

    def _inner(self, rim: float, weights: Mapping[str, float] | None) -> tuple[Any, Array]:
        if not 0.0 < rim < math.inf:
            raise DimensionError(f"the rim is {rim}; give radians above 0")
        factors, scales = inside.metric(self.slice, weights, "the rim"), self.slice.scales
        accuracy = self.accuracy * float(np.max(factors * scales)) / float(np.max(scales))
        return convex.inner(inside.weighted(self.polygon, factors), rim, accuracy), factors

    def _part(self, polygon: Any) -> ConvexRegion:
        edges, half_planes = margins.named_sides(polygon, self.edges)
        bounds = (*self.slice.box, *half_planes)
        return ConvexRegion(self.slice, (edges,), margins.loop_corners((edges,)), 0.0, half_planes=bounds)

    def _holds(self, points: Array) -> Flags:
        return inside.in_polygon(self.slice, self.polygon, points)

    def _depths(self, points: Array, factors: Array) -> Array:
        return inside.depths_in_polygon(self.polygon, points, factors)


def _check_factor(factor: float) -> None:
    if not 0.0 < factor <= 1.0:
        raise DimensionError(
            f"the factor is {factor}, and a factor above 1 leaves the feasible region; give above 0, at most 1"
        )


def _check_angle(angle: float) -> None:
    if not 0.0 <= angle < math.inf:
        raise DimensionError(f"the inset is {angle}; give radians, 0 or more")


def convex_region(
    slice_: Slice, half_planes: tuple[HalfPlane, ...], others: Callable[[], tuple[Region, ...]] | None = None
) -> ConvexRegion:
    """Return the intersection of half-planes as a region; the first four must form a box around it."""
    vertices, sides = intersect(half_planes)
    ends = np.roll(vertices, -1, axis=0)
    edges = tuple(
        Edge(side.name, side.source, side.is_contact, start, end, np.stack((start, end)))
        for side, start, end in zip(sides, vertices, ends, strict=True)
    )
    loops = (edges,) if edges else ()
    corners = margins.loop_corners(loops)
    return ConvexRegion(slice_, loops, corners, 0.0, half_planes=half_planes, _others=others)


def region_of(
    slice_: Slice, accuracy: float = REGION_ACCURACY, width: float | None = None, budget: float = REGION_BUDGET
) -> Region:
    """Return the component of a slice's free set that holds its start; arguments as for `feasible_region`.

    Raises:
        UnsupportedError: If a contact curve is degenerate along its length, or if the budget is spent.
    """
    deadline = Deadline(budget, f"tracing the region of ({', '.join(slice_.coordinates)})")
    if slice_.curves or slice_.obstacles:
        arrangement = arrange(slice_, accuracy, deadline, width)
        return _of_face(arrangement, 0, accuracy, True)
    half_planes = [*slice_.box, *slice_.limits]
    for strip in slice_.strips:
        lower, upper = strip.gap(slice_.start)
        half_planes.append(HalfPlane(strip.name, strip.name, strip.normal, upper, True))
        half_planes.append(HalfPlane(strip.name, strip.name, -strip.normal, -lower, True))

    def others() -> tuple[Region, ...]:
        within = Deadline(budget, "drawing the other components")
        arrangement = arrange(slice_, accuracy, within)
        return tuple(_of_face(arrangement, i, accuracy) for i in within.each(range(1, len(arrangement.faces))))

    return convex_region(slice_, tuple(half_planes), others)


def _of_face(arrangement: Arrangement, index: int, accuracy: float, with_others: bool = False) -> TracedRegion:
    slice_ = arrangement.slice
    loops, corners = arranged_loops(arrangement, arrangement.faces[index], accuracy)

    def others() -> tuple[Region, ...]:
        return tuple(_of_face(arrangement, other, accuracy) for other in range(1, len(arrangement.faces)))

    return TracedRegion(
        slice_,
        loops,
        corners,
        arrangement.chord_error * float(np.max(slice_.scales)),
        _lines=arrangement.drawn,
        _others=others if with_others else None,
        unresolved=arrangement.unresolved(index),
        _joined=arrangement.joined_area(index) if arrangement.blocks else None,
        _interval=arrangement.area_interval(index),
        width=arrangement.settled.tubes.width if arrangement.settled else 0.0,
    )


def _of_loops(slice_: Slice, parts: Sequence[Loops], accuracy: float) -> TracedRegion:
    """Return the first of several parts, the others as its components."""
    regions = tuple(TracedRegion(slice_, loops, margins.loop_corners(loops), accuracy) for loops in parts)
    return replace(regions[0], _others=lambda: regions[1:]) if regions else TracedRegion(slice_, (), (), accuracy)


def _left_behind() -> tuple[Region, ...]:
    raise UnsupportedError("an unpickled region has no other components; compute the region again")
