"""Which points a region holds, and how far inside they are.

Three questions are answered in this order, each in one place:

    order:  are the numbers a configuration of the robot, or a point of the plane? (`read_points`)
    slice:  does the plane, held at `at`, say anything of this configuration? (`Reading.elsewhere`)
    inside: within all limits, by the one rule of `coupling.Intervals`, out of all contacts, and connected (`held`).

A region is closed towards limits and open towards contacts, as `limits` and `certify` read both.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, cast

import numpy as np
import shapely
from numpy.typing import ArrayLike
from shapely import affinity

from pinbound.exceptions import DimensionError, UnknownNameError
from pinbound.model.coupling import as_configurations
from pinbound.region.halfplanes import HalfPlane
from pinbound.region.plane import Plane
from pinbound.tolerances import ON_CONTOUR
from pinbound.typing import Array, Flags

if TYPE_CHECKING:
    from pinbound.region.shape import PlanarShape

__all__ = [
    "Order",
    "Reading",
    "Weights",
    "held",
    "metric",
    "read_points",
    "refuse_elsewhere",
    "signed_distances",
    "weighted",
]

gis = cast(Any, shapely)  # its stubs know only part of what its functions take
gis_affinity = cast(Any, affinity)

Order = Literal["robot", "region"]
Weights = Mapping[str, float]

_PLANE = 2
_TURN = 2.0 * np.pi


@dataclass(frozen=True, eq=False)
class Reading:
    """Points of the plane, and what the other coordinates of their configurations say.

    Attributes:
        points: (N, 2) [rad or m].
        elsewhere: (N, n) whether a held coordinate, on which some boundary or limit depends, is not as in the slice;
            False for points of the plane.
        within: (N,) whether all limits of held coordinates are kept.
        finite: (N,) whether all numbers of the row are finite.
    """

    points: Array
    elsewhere: Flags
    within: Flags
    finite: Flags


def read_points(plane: Plane, Q: ArrayLike, order: Order | None = None) -> Reading:
    """Read configurations (n,) or (N, n), or points of the plane (2,) or (N, 2).

    Args:
        plane: The plane.
        Q: The numbers.
        order: ``"robot"``: configurations; ``"region"``: points in the order of the plane's coordinates; None: told
            by the length of the last axis.

    Raises:
        DimensionError: If the last axis fits neither, or both: a robot of two coordinates, whose plane has them in
            another order.
        UnknownNameError: If there is no such order.
    """
    coordinates, names = plane.robot.coordinates, plane.coordinates
    if order is not None and order not in ("robot", "region"):
        raise UnknownNameError("order of a point", order, ("robot", "region"))
    try:
        array = np.asarray(Q, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise DimensionError(f"q is no array of numbers ({error}); give numbers") from error
    if order is None and array.shape[-1:] == (_PLANE,) == (len(coordinates),) and names != coordinates:
        raise DimensionError(
            f"two numbers can be read in two ways here: as a configuration ({', '.join(coordinates)}) of the robot, "
            f'or as a point ({", ".join(names)}) of the plane; say which, with order="robot" or order="region"'
        )
    if order is None:
        order = "region" if array.shape[-1:] == (_PLANE,) and len(coordinates) != _PLANE else "robot"
    if order == "region":
        points = as_configurations(array, names).reshape(-1, _PLANE).copy()
        nothing = np.zeros((len(points), len(coordinates)), dtype=bool)
        return Reading(points, nothing, np.ones(len(points), dtype=bool), np.all(np.isfinite(points), axis=1))
    rows = as_configurations(array, coordinates).reshape(-1, len(coordinates))
    indices = [coordinates.index(name) for name in names]
    finite = np.all(np.isfinite(rows), axis=1)
    fixed = [coordinates.index(name) for name in plane.fixed]
    elsewhere = np.zeros(rows.shape, dtype=bool)
    elsewhere[:, fixed] = (rows[:, fixed] != plane.at[fixed]) & finite[:, None]
    within = np.ones(len(rows), dtype=bool)
    for limit in plane.robot.linear_limits:
        if not np.any(limit.coefficients[indices]):
            within &= limit.holds(rows)
    for one in plane.robot.guarded_limits:
        if not np.any(one.uses[indices]):
            within &= one.holds(rows)
    return Reading(rows[:, indices].copy(), elsewhere, within, finite)


def refuse_elsewhere(plane: Plane, reading: Reading) -> None:
    """Raise if some row is of another slice.

    Raises:
        DimensionError: Naming the coordinate, its two values, and a boundary or limit that depends on it.
    """
    rows = np.flatnonzero(np.any(reading.elsewhere, axis=1))
    if not len(rows):
        return
    index = int(np.flatnonzero(reading.elsewhere[rows[0]])[0])
    name, value = plane.robot.coordinates[index], float(plane.at[index])
    users = [boundary.name for boundary in plane.robot.boundaries if name in boundary.coordinates]
    users += [f"the rule {one.rule}" for one in plane.robot.guarded_limits if one.uses[index]]
    users += [f"the limit of {limit.joint}" for limit in plane.robot.linear_limits if limit.coefficients[index]]
    raise DimensionError(
        f"the region is the slice at {name} = {value:.9g}, and {users[0]} depends on {name}: {len(rows)} "
        f"configuration(s) with another {name} are not answered by it (first: row {rows[0]}); derive it again "
        f"with at=..., or ask for points of the plane, ({', '.join(plane.coordinates)})"
    )


def held(region: PlanarShape, points: Array) -> Flags:
    """Return whether points (N, 2) are inside: limits belong to the region, contacts do not."""
    inside = np.zeros(len(points), dtype=bool)
    if region.is_empty:
        return inside
    plane = region.plane
    rows = np.flatnonzero(np.all(np.isfinite(points), axis=1))
    x = points[rows]
    if region.planes:
        kept, near = plane.within(x), np.zeros(len(rows), dtype=bool)
        for side in region.planes:
            kept &= side.allows(x)
            if side.is_contact:
                near |= side.bound - x @ side.normal < ON_CONTOUR
        near &= kept  # next to contact, rounding decides: as the clearances do
        if np.any(near):
            kept[near] = plane.robot.boundaries.free(plane.lift(x[near]))
        inside[rows] = kept
        return inside
    gis.prepare(region.polygon)
    moved = _off_limits(plane, x)
    rows, x, moved = (part[gis.contains_xy(region.polygon, moved)] for part in (rows, x, moved))
    inside[rows] = plane.free(x) & _same_side(plane, x, moved)
    return inside


def _off_limits(plane: Plane, X: Array) -> Array:
    """Return points, those on limits moved inwards by `tolerances.ON_CONTOUR`: a polygon does not hold its border."""
    moved = X.copy()
    ends = [(obstacle.end, obstacle.conditions) for obstacle in plane.obstacles if obstacle.end is not None]
    for _ in range(2):  # twice: in a corner, moving off one limit may move onto the other
        for side, conditions in (*((side, ()) for side in (*plane.box, *plane.limits)), *ends):
            normal = side.normal * plane.scales
            depth, size = _depth(side, moved, plane), float(np.linalg.norm(normal))
            near = (depth < ON_CONTOUR) & (depth > -ON_CONTOUR)
            for condition in conditions:  # a rule's end is a limit where its conditions hold
                near &= _depth(condition, moved, plane) > -ON_CONTOUR
            moved[near] -= (ON_CONTOUR - depth[near])[:, None] * (normal / size) * plane.scales
    return moved


def _depth(side: HalfPlane, X: Array, plane: Plane) -> Array:
    """Return how far points (N, 2) are inside a half-plane, in units of `plane.scales`."""
    return (side.bound - X @ side.normal) / float(np.linalg.norm(side.normal * plane.scales))


def _same_side(plane: Plane, X: Array, moved: Array) -> Flags:
    """Return whether no contact of one effective angle lies between two points, however thin it is."""
    same = np.ones(len(X), dtype=bool)
    for strip in plane.strips:
        turns = [np.floor((points @ strip.normal - strip.angle) / _TURN) for points in (X, moved)]
        same &= turns[0] == turns[1]
    return same


def metric(plane: Plane, weights: Weights | None, what: str) -> Array:
    """Return the factors (2,) of the plane's coordinates in a distance; ones where both have one unit.

    Args:
        plane: The plane.
        weights: By coordinate, how much one radian or metre of it counts, e.g. a lever arm in metres for an angle and 1
            for a prismatic joint; the distance is then in that unit.
        what: What is asked, for people.

    Raises:
        DimensionError: If radians and metres would be added, or the weights are no positive numbers for both.
        UnknownNameError: If they name another coordinate.
    """
    if weights is None:
        if plane.units[0] == plane.units[1]:
            return np.ones(_PLANE)
        (x, y), (a, b) = plane.coordinates, plane.units
        raise DimensionError(
            f"{what} would add {x!r} in {a} and {y!r} in {b}; give weights={{{x!r}: ..., {y!r}: ...}}, how much one "
            f"{a} and one {b} count, e.g. a lever arm in metres for the angle and 1 for the other"
        )
    for name in weights:
        if name not in plane.coordinates:
            raise UnknownNameError("coordinate of the weights", name, plane.coordinates)
    factors = np.array([float(weights.get(name, np.nan)) for name in plane.coordinates])
    if not np.all((factors > 0.0) & np.isfinite(factors)):
        x, y = plane.coordinates
        raise DimensionError(
            f"the weights {dict(weights)} are not positive numbers for both; give {x!r} and {y!r} one each"
        )
    return factors


def weighted(shape: Any, factors: Array) -> Any:
    """Return a shape with its coordinates times (2,) factors."""
    if np.all(factors == 1.0):
        return shape
    return gis_affinity.scale(shape, float(factors[0]), float(factors[1]), origin=(0.0, 0.0))


def signed_distances(region: PlanarShape, points: Array, factors: Array) -> Array:
    """Return the distance (N,) to the contour, coordinates times factors (2,): positive inside, NaN if not finite."""
    finite = np.flatnonzero(np.all(np.isfinite(points), axis=1))
    distance = np.full(len(points), np.nan)
    x = points[finite]
    if region.is_empty:
        distance[finite] = -np.inf
        return distance
    if not len(finite):
        return distance
    inside = held(region, x)
    polygon, drawn = weighted(region.polygon, factors), gis.points(x * factors)
    if region.planes:
        A, b = region.halfspaces()
        A = A / factors
        size = np.asarray(np.linalg.norm(A, axis=1), dtype=np.float64)
        depth = np.asarray(np.min((b - (x * factors) @ A.T) / size, axis=1), dtype=np.float64)
        outside = depth < 0.0
        depth[outside] = -np.asarray(gis.distance(drawn[outside], polygon.exterior))
        depth[(depth > 0.0) & ~inside] = 0.0
    else:
        gis.prepare(polygon)
        away = np.asarray(gis.distance(drawn, polygon.boundary), dtype=np.float64)
        within = np.asarray(gis.contains_xy(region.polygon, x), dtype=bool)
        depth = np.where(within, away, -away)
        depth[within & ~inside] = 0.0
    depth[(depth < 0.0) & inside] = 0.0
    distance[finite] = depth
    return distance
