"""How far a configuration is inside a region: the paper's mu_n of Eq. (21), and the signed distance.

    mu(x) = x - lower              if x < lower,
            min(x - lower, upper - x)  if lower <= x <= upper,
            upper - x              if x > upper,

computed, as in the paper, along each axis between the ends of the region's projection. The paper prints `x - upper` in
the third line, which is positive outside, although its text requires a negative value. `printed=True` gives the printed
form. Even the corrected mu > 0 only says that q is in the box around the region. The signed distance is positive
exactly inside. `docs/membership.md` compares them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike

from pinbound.exceptions import DimensionError
from pinbound.model.coupling import as_configurations
from pinbound.region.region import Region
from pinbound.robot.robot import Robot
from pinbound.tolerances import ON_CONTOUR
from pinbound.typing import Array, Ints
from pinbound.values import Value

__all__ = ["Membership", "Place", "axis_membership", "classify", "projections", "region_membership"]


class Place(IntEnum):
    """Where a configuration lies. UNKNOWN is for rows that are not finite or belong to another slice.

    `INSIDE` the region, `ON` its contour, or `OUTSIDE`.

    Example:
        >>> Place(1).name
        'INSIDE'
    """

    OUTSIDE = -1
    ON = 0
    INSIDE = 1
    UNKNOWN = 2


@dataclass(frozen=True, eq=False)
class Membership(Value):
    """Membership of many configurations in a region.

    Attributes:
        coordinates: All active coordinates of the robot (n).
        lower: (n,) lower ends [rad or m]: of the region's projection, or the joint limit for other coordinates.
        upper: (n,) upper ends.
        mu: (N, n) memberships along each axis [rad or m], negative outside the ends, as the paper's text requires.
        mu_printed: (N, n) the same with the third line as printed in Eq. (21): positive beyond the upper end.
        signed_distance: (N,) [unit], in the region's slice: positive inside, zero on the contour, NaN for rows of
            another slice.
        unit: Unit of the signed distance: ``"rad"``, ``"m"``, ``"weighted"``, or ``"1"``. The last is used for a
            revolute and a prismatic joint without weights: each coordinate is divided by the length of the region's
            projection on its axis.

    Example:
        >>> import pinbound as pb
        >>> robot = pb.load("minervabot_v3")
        >>> found = pb.region_membership(robot, pb.feasible_region(robot), robot.home)
        >>> found.mu.shape, found.unit
        ((1, 3), 'rad')
    """

    coordinates: tuple[str, ...]
    lower: Array
    upper: Array
    mu: Array
    mu_printed: Array
    signed_distance: Array
    unit: str = "rad"


def axis_membership(values: ArrayLike, lower: ArrayLike, upper: ArrayLike, printed: bool = False) -> Array:
    """Return mu of values along one axis, Eq. (21); NaN stays NaN, and an infinite end does not limit mu.

    Args:
        values: (N,) or (N, n), any shape that broadcasts with the ends.
        lower: Lower end [rad or m].
        upper: Upper end, not below `lower`.
        printed: Use the third line as printed, `x - upper`, which is positive outside.

    Raises:
        DimensionError: If an end is NaN or the ends are reversed.

    Example:
        >>> axis_membership([-0.5, 0.25, 1.5], 0.0, 1.0)
        array([-0.5 ,  0.25, -0.5 ])
        >>> axis_membership([-0.5, 0.25, 1.5], 0.0, 1.0, printed=True)
        array([-0.5 ,  0.25,  0.5 ])
    """
    x, low, high = (np.asarray(value, dtype=np.float64) for value in (values, lower, upper))
    if not np.all(low <= high):
        raise DimensionError(f"the ends {low.tolist()} and {high.tolist()} are not an interval; give lower <= upper")
    mu = np.minimum(x - low, high - x)
    return np.where(x > high, x - high, mu) if printed else mu


def projections(region: Region) -> tuple[Array, Array]:
    """Return the ends (2,), (2,) of the region's projection on each of its two axes [rad or m].

    Raises:
        DimensionError: If the region is empty.

    Example:
        >>> import pinbound as pb
        >>> lower, upper = projections(pb.feasible_region(pb.load("minervabot_v3")))
        >>> np.degrees(upper).round(6).tolist()
        [70.001229, 68.981699]
    """
    if region.is_empty:
        raise DimensionError("the region is empty, so it has no projection; check `is_empty` first")
    west, south, east, north = region.polygon.bounds
    return np.array([west, south]), np.array([east, north])


def region_membership(
    robot: Robot, region: Region, Q: ArrayLike, weights: Mapping[str, float] | None = None
) -> Membership:
    """Return mu_n of every coordinate, and the signed distance.

    Coordinates outside the region's slice are compared with their own joint limits, as in the paper for q1.

    Args:
        robot: The robot.
        region: A region of the robot; the paper uses the scaled region.
        Q: (n,) or (N, n) configurations [rad or m].
        weights: The weight of one radian or metre of each coordinate of the slice in the signed distance, by name.

    Raises:
        DimensionError: If Q has another shape, if the region is empty, or if the weights are not two positive numbers.

    References:
        Eq. (21), Fig. 22.

    Example:
        At (q2, q3) = (0, 60) degrees every mu is positive, although the configuration is outside the region:

        >>> import pinbound as pb
        >>> robot = pb.load("minervabot_v3")
        >>> found = region_membership(robot, pb.feasible_region(robot), [0.0, 0.0, np.radians(60)])
        >>> bool(np.all(found.mu > 0)), bool(found.signed_distance[0] > 0)
        (True, False)
    """
    rows = as_configurations(Q, robot.coordinates).reshape(-1, len(robot.coordinates))
    lower, upper = robot.lower.copy(), robot.upper.copy()
    columns = [robot.coordinates.index(name) for name in region.coordinates]
    lower[columns], upper[columns] = projections(region)
    mu, mu_printed = (axis_membership(rows, lower, upper, printed) for printed in (False, True))
    unit = "weighted" if weights is not None else region.units[0]
    if weights is None and region.units[0] != region.units[1]:
        unit = "1"
        weights = {name: 1.0 / float(upper[i] - lower[i]) for name, i in zip(region.coordinates, columns, strict=True)}
    distance = np.asarray(region.signed_distance(rows, "robot", weights))
    return Membership(robot.coordinates, lower, upper, mu, mu_printed, distance, unit)


def classify(signed_distance: ArrayLike, tolerance: float = ON_CONTOUR) -> Ints:
    """Return the `Place` of each signed distance as an integer array; up to `tolerance` [rad], it is ON the contour.

    Args:
        signed_distance: An array of any shape; positive inside.
        tolerance: The tolerance in the unit of the distances.

    Raises:
        DimensionError: If the tolerance is negative or not finite.

    Example:
        >>> [Place(place).name for place in classify([0.2, -1e-12, -0.2, np.nan])]
        ['INSIDE', 'ON', 'OUTSIDE', 'UNKNOWN']
    """
    if not 0.0 <= tolerance < np.inf:
        raise DimensionError(f"the tolerance is {tolerance}; give radians, 0 or more")
    d = np.asarray(signed_distance, dtype=np.float64)
    place = np.where(d > tolerance, Place.INSIDE, np.where(d < -tolerance, Place.OUTSIDE, Place.ON))
    return np.where(np.isnan(d), Place.UNKNOWN, place).astype(np.int64)
