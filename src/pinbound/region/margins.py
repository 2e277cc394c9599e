"""Safety margins of a region: scaling, an inset, and proven bounds of the smallest clearance."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
import shapely
from shapely import affinity

from pinbound.boundaries.boundary import Boundary
from pinbound.boundaries.looped import over_z
from pinbound.bounds.derivative_bounds import lever_arms
from pinbound.bounds.swept_bounds import over_box, rounding_bound, swept_bundle
from pinbound.contact.rule import signed_share
from pinbound.evaluate import numeric, separation
from pinbound.exceptions import DimensionError, LeavesRegionError
from pinbound.limits.univariate import Strip, one_angle_strip
from pinbound.loops.through_loops import LoopBounds, contacts_through
from pinbound.path.chain import Chain
from pinbound.path.relative import RelativePath
from pinbound.path.restriction import restrict_path
from pinbound.region import convex
from pinbound.region.arrangement import Corner, Edge
from pinbound.region.deadline import Deadline
from pinbound.region.halfplanes import HalfPlane
from pinbound.region.loop_slice import lifted_plane, moved_columns, over
from pinbound.region.slice import Slice
from pinbound.robot.loop_robot import LoopRobot
from pinbound.tolerances import CONTOUR_ROUNDING, IMPLIED
from pinbound.typing import Array
from pinbound.values import Value

__all__ = [
    "SmallestClearance",
    "check_scaled",
    "inset_parts",
    "loop_corners",
    "moved",
    "named_loops",
    "named_sides",
    "smallest_clearance",
]

gis = cast(Any, shapely)  # its stubs know only part of what its functions take
gis_affinity = cast(Any, affinity)
Loops = tuple[tuple[Edge, ...], ...]

_ARC_SEGMENTS = 64  # for a quarter turn around a reflex corner
_ROUNDS = 60
_MOST_BOXES = 50_000


@dataclass(frozen=True, eq=False)
class SmallestClearance(Value):
    """The smallest clearance of any boundary over a region, between two proven bounds.

    Attributes:
        lower: [m]; no q of the region has a smaller signed clearance.
        upper: [m]; the signed clearance at `q`.
        boundary: The boundary with the smallest clearance at `q`; empty if there is no boundary.
        q: (n,) the configuration of `upper`; NaN if there is no boundary.

    Example:
        >>> import pinbound as pb
        >>> found = pb.feasible_region(pb.load("minervabot_v3")).inset(0.05).clearance()
        >>> found.boundary, found.lower <= found.upper
        ('beta_3', True)
    """

    lower: float
    upper: float
    boundary: str
    q: Array


def check_scaled(polygon: Any, factor: float, slice_: Slice, accuracy: float) -> None:
    """Raise if a polygon scaled about its centroid leaves it.

    Raises:
        LeavesRegionError: With the configuration of the scaled contour that is furthest outside.
    """
    scaled = gis_affinity.scale(polygon, factor, factor, origin=polygon.centroid)
    beyond = gis.get_coordinates(scaled.difference(polygon))
    if not len(beyond):
        return
    # the part outside may be an island in a hole of the polygon: test its inside too
    parts = np.asarray(gis.get_parts(scaled.difference(polygon)))
    beyond = np.concatenate((gis.get_coordinates(gis.point_on_surface(parts)), beyond))
    away = gis.distance(gis.points(beyond), polygon)
    worst = int(np.argmax(away))
    if float(away[worst]) > IMPLIED:
        raise LeavesRegionError(factor, slice_.coordinates, beyond[worst], slice_.lift(beyond[worst][None])[0])


def inset_parts(
    polygon: Any, edges: Sequence[Edge], angle: float, accuracy: float, start: Array, factors: Array, deadline: Deadline
) -> list[Loops]:
    """Return the named loops of the set of points that are at least `angle` inside a polygon, for each part.

    Distances are those of the coordinates times factors (2,).

    Around a reflex corner, the inset contour is an arc. It is drawn with chords, which are nearer to the corner by the
    factor `cos(pi / (4 n))`. So the depth is divided by this factor, and `accuracy` is added.
    """
    depth = (angle + accuracy) / float(np.cos(np.pi / (4 * _ARC_SEGMENTS))) if angle else 0.0
    drawn = polygon if np.all(factors == 1.0) else gis_affinity.scale(polygon, *factors.tolist(), origin=(0.0, 0.0))
    shrunk = drawn.buffer(-depth, quad_segs=_ARC_SEGMENTS) if depth else drawn
    deadline.check()
    parts = [part for part in gis.get_parts(shrunk) if part.area > 0.0]
    home = gis.Point(start * factors)
    parts.sort(key=lambda part: (not part.contains(home), -part.area))
    scaled = [replace(edge, points=edge.points * factors) for edge in edges]
    return [_unscaled(named_loops(part, scaled), factors) for part in deadline.each(parts)]


def _unscaled(loops: Loops, factors: Array) -> Loops:
    return tuple(
        tuple(replace(e, start=e.start / factors, end=e.end / factors, points=e.points / factors) for e in loop)
        for loop in loops
    )


def named_loops(polygon: Any, edges: Sequence[Edge]) -> Loops:
    """Return the loops of a polygon; each segment has the name of the nearest given edge."""
    polygon = gis.orient_polygons(polygon)
    # an entry for each segment of an edge: a tree over few long curves would measure all of them
    segments = np.concatenate([np.stack((edge.points[:-1], edge.points[1:]), axis=1) for edge in edges])
    edge_of = np.repeat(np.arange(len(edges)), [len(edge.points) - 1 for edge in edges])
    tree = gis.STRtree(gis.linestrings(segments))
    loops: list[tuple[Edge, ...]] = []
    for ring in (polygon.exterior, *polygon.interiors):
        points = gis.get_coordinates(ring)
        owner = edge_of[np.asarray(tree.nearest(gis.points(0.5 * (points[1:] + points[:-1]))))]
        breaks = np.flatnonzero(owner != np.roll(owner, 1)).tolist() or [0]
        loop: list[Edge] = []
        for i, place in enumerate(breaks):
            stop = breaks[(i + 1) % len(breaks)]
            run = np.arange(place, stop + 1 if stop > place else stop + len(points))
            line = points[run % (len(points) - 1)]
            edge = edges[int(owner[place])]
            loop.append(Edge(edge.name, edge.source, edge.is_contact, line[0], line[-1], line))
        loops.append(tuple(loop))
    return tuple(loops)


def loop_corners(loops: Loops) -> tuple[Corner, ...]:
    """Return the corners, at which edges of a loop meet."""
    return tuple(
        Corner(edge.start, loop[i - 1].name, edge.name, True)
        for loop in loops
        if len(loop) > 1
        for i, edge in enumerate(loop)
    )


def smallest_clearance(slice_: Slice, polygon: Any, gap: float) -> SmallestClearance:
    """Bound the smallest clearance over a polygon from both sides.

    For one effective angle phi, the range over the polygon is the range over the vertices, and the norm grows with the
    angle between phi and phi*: this is a closed form. For several angles, branch and bound is used. With `u = r(m) /
    |r(m)|` and `|r| >= u . r`,

        |r(x)| >= |r(m)| + u . J(m) (x - m) - h^T A h / 2,   |x - m| <= h, where A bounds the second derivatives;

    the linear part is smallest at a vertex of the part of the polygon in the box.

    Raises:
        DimensionError: If the gap is not positive, or if the polygon is empty.
    """
    if not gap > 0.0 or polygon.is_empty:
        raise DimensionError(f"the gap is {gap}; give metres above 0")
    indices = [slice_.robot.coordinates.index(name) for name in slice_.coordinates]
    best = SmallestClearance(np.inf, np.inf, "", np.full(len(slice_.at), np.nan))
    lower = np.inf
    _, at = over(slice_.robot, slice_.at)
    moved = moved_columns(slice_.robot, indices)
    for one in slice_.robot.boundaries:
        boundary = over_z(one)
        if np.any(moved[list(boundary.path.minimal.coordinates)]):
            through = _ThroughLoops(boundary, slice_, indices)
            least, upper, point = _branch_and_bound(through, 0.0, polygon, gap, best.upper)
            lower = min(lower, least)
            if upper < best.upper:
                best = SmallestClearance(lower, upper, boundary.name, slice_.lift(point[None])[0])
            continue
        rule = boundary.rule  # inside the region, a stop's signed clearance is its absolute value
        path = restrict_path(rule.size_path if rule.stop else boundary.path, at, indices)
        threshold = 0.0 if rule.stop else rule.distance
        chain = path.minimal
        bounds = _PointBounds(chain) if path.is_plain else _SeparationBounds(path)
        found = bounds.one_angle(threshold)
        if found is not None:
            least, upper, point = _one_angle(chain, threshold, polygon, *found)
        else:
            least, upper, point = _branch_and_bound(bounds, threshold, polygon, gap, best.upper)
        off = 0.5 * rule.stop.amplitude * rule.stop.play if rule.stop else 0.0  # the gap is narrower by the play
        lower = min(lower, least - off)
        if upper < best.upper:
            best = SmallestClearance(lower, upper, boundary.name, slice_.lift(point[None])[0])
    return SmallestClearance(min(lower, best.upper), best.upper, best.boundary, best.q)


def _one_angle(chain: Chain, threshold: float, polygon: Any, c: Array, strip: Strip) -> tuple[float, float, Array]:
    """Return lower and upper bound of a one-angle clearance over a polygon, which differ by rounding, and where."""
    points = gis.get_coordinates(polygon)
    phi = points @ c
    aligned = strip.angle + 2.0 * np.pi * np.ceil((phi.min() - strip.angle) / (2.0 * np.pi))
    if aligned <= phi.max():
        foot, along = c * (aligned / float(c @ c)), np.array([-c[1], c[0]])
        reach = float(np.max(np.abs(points))) / float(np.linalg.norm(c)) + 1.0
        line = gis.linestrings(foot + np.array([[-reach], [reach]]) * along)
        points = np.concatenate((points, gis.get_coordinates(polygon.intersection(line))))
    values = _clearances(chain, threshold, points)
    least = int(np.argmin(values))
    upper = float(values[least])
    lower = min(upper, strip.smallest - threshold) if aligned <= phi.max() else upper
    return lower - CONTOUR_ROUNDING * chain.scale, upper, points[least]


def _clearances(chain: Chain, threshold: float, X: Array) -> Array:
    return numeric.norm(numeric.positions(chain, X)) - threshold


class _PointBounds:
    """Values and lower bounds of the norm of one chain."""

    def __init__(self, chain: Chain) -> None:
        self.chain = chain

    def one_angle(self, threshold: float) -> tuple[Array, Strip] | None:
        """Return the effective angle's coefficients and its contact strip; None if there are several angles."""
        return one_angle_strip(self.chain, threshold, 0.0)

    def over(self, reach: Array) -> None:
        self.arms = lever_arms(self.chain, reach)
        self.weights, self.size = self.arms.first, self.arms.length

    def values(self, X: Array) -> Array:
        return numeric.norm(numeric.positions(self.chain, X))

    def lower(self, middle: Array, half: Array, parts: Array) -> Array:
        r, J = numeric.jacobian(self.chain, middle)
        length = numeric.norm(r)
        unit = r / np.where(length > 0.0, length, 1.0)[:, None]
        slope = np.einsum("ni,nia->na", unit, J)
        inside, piece = gis.get_coordinates(parts, return_index=True)
        linear = np.einsum("na,na->n", slope[piece], inside - middle[piece])
        least = np.full(len(parts), np.inf)
        np.minimum.at(least, piece, linear)
        return np.maximum(length + least - 0.5 * float(half @ self.arms.second @ half), 0.0)


class _SeparationBounds:
    """Values and lower bounds of a separation, over boxes."""

    def __init__(self, path: RelativePath) -> None:
        self.path = path

    def one_angle(self, threshold: float) -> None:
        """Return None: the search finds the strips of bodies."""

    def over(self, reach: Array) -> None:
        self.bundle = swept_bundle([self.path], -reach, reach)
        self.error = rounding_bound(self.bundle, None, -reach, reach)
        self.weights = (self.bundle.arms[0] @ np.abs(self.bundle.chains.coefficients[0])) + 1e-12
        self.size = float(self.bundle.reach[0])

    def values(self, X: Array) -> Array:
        return separation.separations(self.path, X)

    def lower(self, middle: Array, half: Array, parts: Array) -> Array:
        which = np.zeros(len(middle), dtype=np.intp)
        return over_box(self.bundle, which, middle, np.tile(half, (len(middle), 1)), self.error[which]).lower


class _ThroughLoops:
    """Signed clearances of a boundary through loops that are not parallelograms, and lower bounds over boxes."""

    def __init__(self, boundary: Boundary, slice_: Slice, indices: Sequence[int]) -> None:
        self.boundary, self.weights = boundary, np.ones(2)
        robot = slice_.robot
        assert isinstance(robot, LoopRobot)
        self.plane = lifted_plane(robot, slice_.at, indices, slice_.window)
        curves = contacts_through(boundary.name, boundary.rule, self.plane)
        self.bounds, self.size = LoopBounds(curves, *slice_.window), float(boundary.path.minimal.scale)

    def over(self, reach: Array) -> None:
        """Do nothing: the bounds hold for the whole window."""

    def values(self, X: Array) -> Array:
        return self.boundary.rule.signed(self.plane.lifted(X))

    def lower(self, middle: Array, half: Array, parts: Array) -> Array:
        count, wide = len(self.bounds.curves), np.tile(half, (len(middle), 1)) * (1.0 + 1e-9)
        which = np.repeat(np.arange(count), len(middle))
        found = self.bounds.bounds(which, np.tile(middle, (count, 1)), np.tile(wide, (count, 1)))[0]
        least = found.reshape(count, -1).min(axis=0)
        stop = self.boundary.rule.stop
        return least if stop is None else stop.amplitude * signed_share(least)


def _branch_and_bound(
    bounds: _PointBounds | _SeparationBounds | _ThroughLoops, threshold: float, polygon: Any, gap: float, known: float
) -> tuple[float, float, Array]:
    """Return lower and upper bound of a clearance over a polygon, and where the upper is attained."""
    x0, y0, x1, y1 = polygon.bounds
    bounds.over(np.maximum(np.abs([x0, y0]), np.abs([x1, y1])))
    slack = CONTOUR_ROUNDING * (bounds.size + threshold)
    points = gis.get_coordinates(polygon)
    values = bounds.values(points) - threshold
    upper, point, settled = float(values.min()), points[int(np.argmin(values))], np.inf
    half = 0.5 * np.array([x1 - x0, y1 - y0])
    middle, parts = np.array([[x0 + x1, y0 + y1]]) / 2.0, np.array([polygon])
    for _ in range(_ROUNDS):
        found = bounds.lower(middle, half, parts) - threshold - slack
        inside = gis.get_coordinates(parts)
        values = bounds.values(inside) - threshold
        if values.min() < upper:
            upper, point = float(values.min()), inside[int(np.argmin(values))]
        undecided = found < min(upper, known) - gap
        settled = min(settled, float(np.min(found[~undecided], initial=np.inf)))
        if not np.any(undecided) or int(undecided.sum()) > _MOST_BOXES:
            settled = min(settled, float(np.min(found)))
            break
        middle, parts = middle[undecided], parts[undecided]
        axis = np.array([1.0, 0.0]) if bounds.weights @ (half * [1, -1]) >= 0.0 else np.array([0.0, 1.0])
        half = half * (1.0 - 0.5 * axis)
        middle = np.concatenate((middle - half * axis, middle + half * axis))
        boxes = gis.box(*(middle - half).T, *(middle + half).T)
        parts = gis.intersection(np.concatenate((parts, parts)), boxes)
        kept = ~gis.is_empty(parts)
        middle, parts = middle[kept], parts[kept]
    else:
        settled = -threshold if isinstance(bounds, _PointBounds) else -np.inf
    return min(settled, upper), upper, point


def named_sides(polygon: Any, edges: Sequence[Edge]) -> tuple[tuple[Edge, ...], tuple[HalfPlane, ...]]:
    """Return the sides of a convex polygon, counter-clockwise, each with the name of the edge nearest to its middle."""
    A, b = convex.polygon_halfspaces(polygon)
    vertices = gis.get_coordinates(gis.orient_polygons(polygon).exterior)
    middle = gis.points(0.5 * (vertices[1:] + vertices[:-1]))
    tree = gis.STRtree([gis.linestrings(edge.points) for edge in edges])
    near = [edges[int(i)] for i in np.asarray(tree.nearest(middle))]
    sides = tuple(
        Edge(e.name, e.source, e.is_contact, vertices[i], vertices[i + 1], vertices[i : i + 2])
        for i, e in enumerate(near)
    )
    half_planes = tuple(
        HalfPlane(e.source, e.name, normal, float(bound), e.is_contact)
        for e, normal, bound in zip(near, A, b, strict=True)
    )
    return sides, half_planes


def moved(
    loops: Sequence[Sequence[Edge]], corners: Sequence[Corner], move: Callable[[Array], Array]
) -> tuple[tuple[tuple[Edge, ...], ...], tuple[Corner, ...]]:
    """Return loops and corners with every point mapped."""
    found = tuple(
        tuple(Edge(e.name, e.source, e.is_contact, move(e.start), move(e.end), move(e.points)) for e in loop)
        for loop in loops
    )
    return found, tuple(Corner(move(c.point), c.before, c.after, c.polished) for c in corners)
