"""Which points are in a region, and how far inside.

Three questions are answered in this order, each in one place:

    order:  are the numbers a configuration of the robot, or a point of the slice? (`read_points`)
    slice:  do all fixed coordinates of this configuration have their values of `at`? (`Reading.elsewhere`)
    inside: is it within all limits (rule of `coupling.Intervals`), out of all contacts, and connected?
            (`in_half_planes`, `in_polygon`)

A region is closed at limits and open at contacts, as in `limits` and `certify`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, cast

import numpy as np
import shapely
from numpy.typing import ArrayLike
from shapely import affinity

from pinbound.exceptions import DimensionError, UnknownNameError
from pinbound.model.coupling import as_configurations
from pinbound.region.halfplanes import HalfPlane
from pinbound.region.slice import Slice
from pinbound.tolerances import ON_CONTOUR
from pinbound.typing import Array, Flags

__all__ = [
    "Order",
    "Reading",
    "Weights",
    "depths_in_half_planes",
    "depths_in_polygon",
    "in_half_planes",
    "in_polygon",
    "metric",
    "read_points",
    "refuse_elsewhere",
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
    """Points of the slice, and the other coordinates of their configurations.

    Attributes:
        points: (N, 2) [rad or m].
        elsewhere: (N, n) whether a fixed coordinate that a boundary or limit depends on differs from the slice; False
            for points of the slice.
        within: (N,) whether all limits of fixed coordinates are kept.
        finite: (N,) whether all numbers of the row are finite.
    """

    points: Array
    elsewhere: Flags
    within: Flags
    finite: Flags


def read_points(slice_: Slice, Q: ArrayLike, order: Order | None = None) -> Reading:
    """Read configurations (n,) or (N, n), or points of the slice (2,) or (N, 2).

    Args:
        slice_: The slice.
        Q: The numbers.
        order: ``"robot"``: configurations; ``"region"``: points in the order of the slice's coordinates; None: the
            length of the last axis decides.

    Raises:
        DimensionError: If the last axis fits neither, or both: a robot of two coordinates whose slice has them in
            another order.
        UnknownNameError: If there is no such order.
    """
    coordinates, names = slice_.robot.coordinates, slice_.coordinates
    if order is not None and order not in ("robot", "region"):
        raise UnknownNameError("order of a point", order, ("robot", "region"))
    try:
        array = np.asarray(Q, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise DimensionError(f"q is not an array of numbers ({error}); give numbers") from error
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
    fixed = [coordinates.index(name) for name in slice_.fixed]
    elsewhere = np.zeros(rows.shape, dtype=bool)
    elsewhere[:, fixed] = (rows[:, fixed] != slice_.at[fixed]) & finite[:, None]
    return Reading(rows[:, indices].copy(), elsewhere, slice_.keeps_held(rows), finite)


def refuse_elsewhere(slice_: Slice, reading: Reading) -> None:
    """Raise if a row belongs to another slice.

    Raises:
        DimensionError: It names the coordinate, its two values, and a boundary or limit that depends on it.
    """
    rows = np.flatnonzero(np.any(reading.elsewhere, axis=1))
    if not len(rows):
        return
    index = int(np.flatnonzero(reading.elsewhere[rows[0]])[0])
    name, value = slice_.robot.coordinates[index], float(slice_.at[index])
    raise DimensionError(
        f"the region is the slice at {name} = {value:.9g}, and {slice_.users(index)[0]} depends on {name}: {len(rows)} "
        f"configuration(s) have another {name}, so it does not apply to them (first: row {rows[0]}); compute it again "
        f"with at=..., or give points of the slice, ({', '.join(slice_.coordinates)})"
    )


def in_half_planes(slice_: Slice, half_planes: Sequence[HalfPlane], points: Array) -> Flags:
    """Return whether finite points (N, 2) keep half-planes; limits belong to them, contacts do not."""
    kept, near = slice_.within(points), np.zeros(len(points), dtype=bool)
    for side in half_planes:
        kept &= side.allows(points)
        if side.is_contact:
            near |= side.bound - points @ side.normal < ON_CONTOUR
    near &= kept  # near contact, rounding decides, as it does for the clearances
    if np.any(near):
        kept[near] = slice_.robot.boundaries.free(slice_.lift(points[near]))
    return kept


def in_polygon(slice_: Slice, polygon: Any, points: Array) -> Flags:
    """Return whether finite points (N, 2) are in a traced polygon and free; limits belong to it, contacts do not."""
    gis.prepare(polygon)
    moved, inside = _off_limits(slice_, points), np.zeros(len(points), dtype=bool)
    rows = np.flatnonzero(gis.contains_xy(polygon, moved))
    inside[rows] = slice_.free(points[rows]) & _same_side(slice_, points[rows], moved[rows])
    return inside


def _off_limits(slice_: Slice, X: Array) -> Array:
    """Return points, those on limits moved inwards by `tolerances.ON_CONTOUR`: polygons exclude their borders."""
    moved = X.copy()
    ends = [(obstacle.end, obstacle.conditions) for obstacle in slice_.obstacles if obstacle.end is not None]
    for _ in range(2):  # twice: in a corner, a move off one limit may end on the other
        for side, conditions in (*((side, ()) for side in (*slice_.box, *slice_.limits)), *ends):
            normal = side.normal * slice_.scales
            depth, size = _depth(side, moved, slice_), float(np.linalg.norm(normal))
            near = (depth < ON_CONTOUR) & (depth > -ON_CONTOUR)
            for condition in conditions:  # a rule's end is a limit where its conditions are satisfied
                near &= _depth(condition, moved, slice_) > -ON_CONTOUR
            moved[near] -= (ON_CONTOUR - depth[near])[:, None] * (normal / size) * slice_.scales
    return moved


def _depth(side: HalfPlane, X: Array, slice_: Slice) -> Array:
    """Return how far points (N, 2) are inside a half-plane, in units of `Slice.scales`."""
    return (side.bound - X @ side.normal) / float(np.linalg.norm(side.normal * slice_.scales))


def _same_side(slice_: Slice, X: Array, moved: Array) -> Flags:
    """Return whether there is no contact of one effective angle between two points, however thin."""
    same = np.ones(len(X), dtype=bool)
    for strip in slice_.strips:
        turns = [np.floor((points @ strip.normal - strip.angle) / _TURN) for points in (X, moved)]
        same &= turns[0] == turns[1]
    return same


def metric(slice_: Slice, weights: Weights | None, what: str) -> Array:
    """Return the factors (2,) of the slice's coordinates in a distance; ones if both have the same unit.

    Args:
        slice_: The slice.
        weights: The weight of one radian or metre of each coordinate, by name, e.g. a lever arm in metres for an angle
            and 1 for a prismatic joint; the distance is then in that unit.
        what: The requested quantity, for the error message.

    Raises:
        DimensionError: If radians and metres would be added, or the weights are not two positive numbers.
        UnknownNameError: If the weights name another coordinate.
    """
    if weights is None:
        if slice_.units[0] == slice_.units[1]:
            return np.ones(_PLANE)
        (x, y), (a, b) = slice_.coordinates, slice_.units
        raise DimensionError(
            f"{what} would add {x!r} in {a} and {y!r} in {b}; give weights={{{x!r}: ..., {y!r}: ...}}, how much one "
            f"{a} and one {b} count, e.g. a lever arm in metres for the angle and 1 for the other"
        )
    for name in weights:
        if name not in slice_.coordinates:
            raise UnknownNameError("coordinate of the weights", name, slice_.coordinates)
    factors = np.array([float(weights.get(name, np.nan)) for name in slice_.coordinates])
    if not np.all((factors > 0.0) & np.isfinite(factors)):
        x, y = slice_.coordinates
        raise DimensionError(
            f"the weights {dict(weights)} are not positive numbers for both; give {x!r} and {y!r} one each"
        )
    return factors


def weighted(shape: Any, factors: Array) -> Any:
    """Return a shape with its coordinates times (2,) factors."""
    if np.all(factors == 1.0):
        return shape
    return gis_affinity.scale(shape, float(factors[0]), float(factors[1]), origin=(0.0, 0.0))


def depths_in_half_planes(A: Array, b: Array, polygon: Any, points: Array, factors: Array) -> Array:
    """Return how far points (N, 2) are inside `A x <= b`, coordinates times factors (2,); negative outside.

    Args:
        A: (k, 2).
        b: (k,).
        polygon: The same set as a shape, with its coordinates times the factors.
        points: (N, 2), finite.
        factors: (2,).
    """
    A = A / factors
    size = np.asarray(np.linalg.norm(A, axis=1), dtype=np.float64)
    depth = np.asarray(np.min((b - (points * factors) @ A.T) / size, axis=1), dtype=np.float64)
    outside = depth < 0.0
    depth[outside] = -np.asarray(gis.distance(gis.points((points * factors)[outside]), polygon.exterior))
    return depth


def depths_in_polygon(polygon: Any, points: Array, factors: Array) -> Array:
    """Return how far finite points (N, 2) are inside a polygon, coordinates times factors (2,); negative outside."""
    drawn = weighted(polygon, factors)
    gis.prepare(drawn)
    away = np.asarray(gis.distance(gis.points(points * factors), drawn.boundary), dtype=np.float64)
    return np.where(np.asarray(gis.contains_xy(polygon, points), dtype=bool), away, -away)
