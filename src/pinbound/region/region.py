"""The feasible region in the plane of two coordinates, its edges named.

For boundaries of one effective angle the free set is cut by strips `c . q in [phi* - w, phi* + w]`, every turn. The
component that holds home is the intersection of the gaps around home with the joint limits: a convex polygon, exact.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, cast

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from pinbound.boundary import Boundary
from pinbound.coupling import as_configurations
from pinbound.exceptions import DimensionError, UnknownNameError, UnsupportedError
from pinbound.region.halfplanes import HalfPlane, Support, intersect, support
from pinbound.robot import Robot

__all__ = ["Edge", "Region", "feasible_region"]

Array = NDArray[np.float64]

_PLANE = 2


@dataclass(frozen=True)
class Edge:
    """One edge of a region: which boundary or joint limit it is, and its two ends.

    Attributes:
        name: Boundary name, or joint and end, e.g. ``"q2 upper"``.
        source: Boundary name, or joint name.
        is_contact: True for a boundary, False for a joint limit.
        start: (2,) [rad].
        end: (2,) [rad]; the region lies to the left of start -> end.
    """

    name: str
    source: str
    is_contact: bool
    start: Array
    end: Array


@dataclass(frozen=True)
class Region:
    """A convex cell of the free set, in the plane of two coordinates.

    Attributes:
        coordinates: The two coordinates of the plane.
        robot_coordinates: All active coordinates of the robot.
        at: (n,) where the other coordinates are held.
        planes: Every half-plane that bounds the cell, edges and implied ones alike.
        fixed: Other coordinates that some boundary or limit depends on: a q is in the region only if it has them as
            in `at`. Coordinates that nothing depends on are ignored.
    """

    coordinates: tuple[str, str]
    robot_coordinates: tuple[str, ...]
    at: Array
    planes: tuple[HalfPlane, ...]
    fixed: tuple[str, ...]

    @cached_property
    def _cell(self) -> tuple[Array, tuple[HalfPlane, ...]]:
        return intersect(self.planes)

    def __repr__(self) -> str:
        """Return the plane and the edges."""
        names = ", ".join(edge.name for edge in self.edges) or "empty"
        return f"<Region ({', '.join(self.coordinates)}): {names}; area {self.area:.6g} rad^2>"

    @property
    def vertices(self) -> Array:
        """(k, 2) vertices [rad], counter-clockwise; vertex i is where edge i - 1 and edge i meet."""
        return self._cell[0]

    @cached_property
    def edges(self) -> tuple[Edge, ...]:
        """The edges, counter-clockwise, edge i from vertex i to vertex i + 1."""
        vertices, planes = self._cell
        ends = np.roll(vertices, -1, axis=0)
        return tuple(
            Edge(plane.name, plane.source, plane.is_contact, start, end)
            for plane, start, end in zip(planes, vertices, ends, strict=True)
        )

    @property
    def is_empty(self) -> bool:
        """Whether nothing is left."""
        return not len(self.vertices)

    @cached_property
    def polygon(self) -> Any:
        """The region as a `shapely.Polygon`."""
        return shapely.Polygon(self.vertices)

    @property
    def area(self) -> float:
        """[rad^2], by the boundary integral (shoelace)."""
        return float(self.polygon.area)

    @property
    def centroid(self) -> Array:
        """(2,) centre of area [rad]; NaN if the region is empty."""
        return np.array([self.polygon.centroid.x, self.polygon.centroid.y]) if not self.is_empty else np.full(2, np.nan)

    def supports(self) -> dict[str, Support]:
        """Return, for every half-plane by name, its slack [rad] and the edges that imply it.

        Example:
            >>> import pinbound as pb
            >>> region = pb.feasible_region(pb.load("minervabot_v3"))
            >>> region.supports()["beta_1"].by
            ('beta_4',)
        """
        found: dict[str, Support] = {}
        for plane in self.planes:
            one = support(self.vertices, self._cell[1], plane)
            if plane.name not in found or one.slack < found[plane.name].slack:
                found[plane.name] = one
        return found

    def halfspaces(self) -> tuple[Array, Array]:
        """Return A (k, 2) and b (k,) with `A x <= b`, rows of unit length, one an edge.

        Example:
            >>> import pinbound as pb
            >>> region = pb.feasible_region(pb.load("minervabot_v3"))
            >>> A, b = region.halfspaces()
            >>> bool(np.all(A @ region.centroid < b))
            True
        """
        planes = self._cell[1]
        lengths = np.array([np.linalg.norm(plane.normal) for plane in planes])
        normals = np.array([plane.normal for plane in planes]).reshape(-1, _PLANE)
        return normals / lengths[:, None], np.array([plane.bound for plane in planes]) / lengths

    def points(self, Q: ArrayLike) -> Array:
        """Return the region's two coordinates (N, 2) of q's (N, n); rows of another slice become NaN."""
        array = np.asarray(Q, dtype=np.float64)
        if array.shape[-1:] == (_PLANE,) and len(self.robot_coordinates) != _PLANE:
            return as_configurations(array, self.coordinates).reshape(-1, _PLANE)
        rows = as_configurations(array, self.robot_coordinates).reshape(-1, len(self.robot_coordinates))
        points = rows[:, [self.robot_coordinates.index(name) for name in self.coordinates]]
        held = [self.robot_coordinates.index(name) for name in self.fixed]
        elsewhere = np.any(rows[:, held] != self.at[held], axis=1) | ~np.all(np.isfinite(rows), axis=1)
        points[elsewhere] = np.nan
        return points

    def contains(self, Q: ArrayLike) -> Any:
        """Return whether q is inside: a bool, or (N,) bools; False on the contour and for non-finite rows.

        Args:
            Q: (n,) or (N, n) configurations of the robot, or (2,) or (N, 2) points of the plane. Coordinates that
                no boundary and no coupled limit depends on are ignored; their own limits are not looked at.
        """
        inside = self.signed_distance(Q) > 0.0
        return inside if np.ndim(inside) else bool(inside)

    def signed_distance(self, Q: ArrayLike) -> Any:
        """Return the Euclidean distance to the contour in the plane [rad]: positive inside, negative outside.

        Args:
            Q: As in `contains`.

        Returns:
            A float, or (N,); NaN for non-finite rows and for rows of another slice; -inf if the region is empty.

        Example:
            >>> import pinbound as pb
            >>> region = pb.feasible_region(pb.load("minervabot_v3"))
            >>> bool(region.contains([0.0, 0.0, 0.0])), region.contains([0.0, 0.0, np.radians(60)])
            (True, False)
        """
        points = self.points(Q)
        finite = np.all(np.isfinite(points), axis=1)
        distance = np.full(len(points), np.nan)
        if self.is_empty:
            distance[finite] = -np.inf
        else:
            A, b = self.halfspaces()
            depth = np.min(b - points[finite] @ A.T, axis=1)
            outside = depth < 0.0
            far = cast(Any, shapely).distance(shapely.points(points[finite][outside]), self.polygon.exterior)
            depth[outside] = -far
            distance[finite] = depth
        return distance if np.ndim(Q) > 1 else float(distance[0])

    def scale(self, factor: float) -> Region:
        """Return the region scaled about its centroid, the paper's safety margin; edges keep their names.

        Raises:
            DimensionError: If the factor is not in (0, 1]: beyond 1 the region would leave the feasible one.

        Example:
            >>> import pinbound as pb
            >>> region = pb.feasible_region(pb.load("minervabot_v3"))
            >>> round(region.scale(0.9).area / region.area, 12)
            0.81
        """
        if not 0.0 < factor <= 1.0:
            raise DimensionError(f"the factor {factor} is not in (0, 1]; beyond 1 the region leaves the feasible one")
        centre = self.centroid
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

    def inset(self, angle: float) -> Region:
        """Return the points at least `angle` [rad] inside every edge; it may be empty.

        Raises:
            DimensionError: If the angle is negative or not finite.
        """
        if not 0.0 <= angle < math.inf:
            raise DimensionError(f"the inset {angle} is not a finite angle of zero or more")
        return self._with(plane.inset(angle) for plane in self.planes)

    def _with(self, planes: Any) -> Region:
        return Region(self.coordinates, self.robot_coordinates, self.at, tuple(planes), self.fixed)

    @property
    def components(self) -> tuple[Region, ...]:
        """This region, the one component that holds home."""
        return (self,)


def feasible_region(
    robot: Robot,
    coordinates: Sequence[str] | None = None,
    at: ArrayLike | None = None,
    window: Mapping[str, tuple[float, float]] | None = None,
) -> Region:
    """Return the connected component, containing home, of the joint limits less the contacts.

    Args:
        robot: The robot.
        coordinates: The two coordinates of the plane; None: those that the boundaries use.
        at: (n,) where the other coordinates are held, home by default. It must be in the region itself: between it
            and home there may be no contact.
        window: Ends [rad] within which to look, by coordinate; needed for coordinates without limits.

    Returns:
        The region, with a named edge for every boundary or limit that is active.

    Raises:
        UnknownNameError: If the robot has no such coordinate.
        UnsupportedError: If there are not two coordinates, or a boundary has more than one effective angle.
        DimensionError: If a coordinate is without limits, or `at` is in contact or out of limits.

    References:
        The paper's Fig. 9; `docs/regions.md`.

    Example:
        >>> import pinbound as pb
        >>> region = pb.feasible_region(pb.load("minervabot_v3"), coordinates=("q2", "q3"))
        >>> [edge.name for edge in region.edges]
        ['beta_7', 'beta_3', 'beta_4', 'beta_10', 'beta_9', 'beta_8']
        >>> round(region.area, 10)
        1.5434743997
    """
    names = _plane_coordinates(robot, coordinates)
    start = np.array(robot.home if at is None else as_configurations(at, robot.coordinates), dtype=np.float64)
    indices = [robot.coordinates.index(name) for name in names]
    used = {robot.coordinates.index(name) for boundary in robot.boundaries for name in boundary.coordinates}
    planes = _window_planes(robot, names, start, dict(window or {}))
    for limit in robot.linear_limits:
        c = limit.coefficients[indices]
        if not np.any(c):
            continue
        used |= set(np.flatnonzero(limit.coefficients).tolist())
        rest = limit.offset + float(limit.coefficients @ start) - float(c @ start[indices])
        planes += _slab(limit.joint, c, limit.lower - rest, limit.upper - rest)
    for boundary in robot.boundaries:
        planes += _contact_planes(boundary, indices, start, robot.home)
    for plane in planes:
        if float(plane.normal @ start[indices]) >= plane.bound:
            raise DimensionError(f"the start point is not free: {plane.name!r} forbids {start[indices].tolist()}")
    fixed = tuple(robot.coordinates[index] for index in sorted(used - set(indices)))
    return Region((names[0], names[1]), robot.coordinates, start, tuple(planes), fixed)


def _plane_coordinates(robot: Robot, coordinates: Sequence[str] | None) -> tuple[str, ...]:
    used = {name for boundary in robot.boundaries for name in boundary.coordinates}
    names = tuple(name for name in robot.coordinates if name in used) if coordinates is None else tuple(coordinates)
    for name in names:
        if name not in robot.coordinates:
            raise UnknownNameError("coordinate", name, robot.coordinates)
    if len(names) != _PLANE or names[0] == names[1]:
        whose = "the boundaries use" if coordinates is None else "you gave"
        listed = ", ".join(names) or "none"
        raise UnsupportedError(
            f"a planar region needs two coordinates, and {whose} {len(names)} ({listed}); "
            f"give coordinates=(..., ...) out of: {', '.join(robot.coordinates)}"
        )
    return names


def _window_planes(
    robot: Robot, names: Sequence[str], start: Array, window: dict[str, tuple[float, float]]
) -> list[HalfPlane]:
    """Return the box of the two coordinates: window, or joint limits; the first four half-planes of the cell."""
    for name in window:
        if name not in names:
            raise UnknownNameError("coordinate of the window", name, names)
    planes: list[HalfPlane] = []
    for axis, name in enumerate(names):
        index = robot.coordinates.index(name)
        own = (float(robot.lower[index]), float(robot.upper[index]))
        given = window.get(name, own)
        lower, upper = max(own[0], given[0]), min(own[1], given[1])
        if not math.isfinite(lower) or not math.isfinite(upper):
            raise DimensionError(f"{name!r} has no limits; give window={{{name!r}: (lower, upper)}} around the start")
        planes += _slab(name, np.eye(_PLANE)[axis], lower, upper)
    return [planes[0], planes[2], planes[1], planes[3]]


def _slab(source: str, normal: Array, lower: float, upper: float, is_contact: bool = False) -> list[HalfPlane]:
    """Return `normal @ x <= upper` and `normal @ x >= lower`, those of the two that are finite."""
    names = (source, source) if is_contact else (f"{source} upper", f"{source} lower")
    sides = ((names[0], normal, upper), (names[1], -normal, -lower))
    return [HalfPlane(source, name, n, bound, is_contact) for name, n, bound in sides if math.isfinite(bound)]


def _contact_planes(boundary: Boundary, indices: Sequence[int], start: Array, home: Array) -> list[HalfPlane]:
    """Return the two sides of the gap around home; none if the boundary does not depend on the plane."""
    contact = boundary.contact
    if contact is None:
        if not boundary.coordinates or not set(indices) & set(boundary.path.minimal.coordinates):
            if float(boundary.clearance(start)) <= 0.0:
                raise DimensionError(f"the start point is not free: {boundary.name!r} is in contact")
            return []
        raise UnsupportedError(
            f"boundary {boundary.name!r} has more than one effective angle (it depends on "
            f"{', '.join(boundary.coordinates)}); planar regions are exact for one effective angle only"
        )
    if boundary.parts(home, start):
        raise DimensionError(f"the start point is not free: a contact of {boundary.name!r} lies between it and home")
    phi = float(contact.coefficients @ start)
    lower, upper = contact.gap(phi)
    c = contact.coefficients[list(indices)]
    if not np.any(c):
        return []
    rest = phi - float(c @ start[list(indices)])
    return _slab(boundary.name, c, lower - rest, upper - rest, is_contact=True)
