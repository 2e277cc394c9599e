"""feasible_region(): the region of a robot around home.

If every boundary has one effective angle in the slice, the component that holds home is an intersection of half-planes
in closed form. Otherwise contact curves are traced (`contours`), and the faces between them are found (`arrangement`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from pinbound.boundaries.boundary import one_configuration
from pinbound.exceptions import DimensionError
from pinbound.region.region import Region, region_of
from pinbound.region.slice import slice_of
from pinbound.robot.robot import Robot, check_robot
from pinbound.tolerances import REGION_ACCURACY, REGION_BUDGET

__all__ = ["feasible_region"]


def feasible_region(
    robot: Robot,
    coordinates: Sequence[str] | None = None,
    at: ArrayLike | None = None,
    window: Mapping[str, tuple[float, float]] | None = None,
    accuracy: float = REGION_ACCURACY,
    margin: float = 0.0,
    budget: float = REGION_BUDGET,
    width: float | None = None,
) -> Region:
    """Return the connected component, containing home, of the free set of two coordinates.

    Args:
        robot: The robot.
        coordinates: The two coordinates; None: those that the boundaries use, or the only two of the robot.
        at: (n,) the values of the other coordinates, and the start point; home by default. It may be on a limit. No
            contact of a boundary of one effective angle may lie between it and home.
        window: Ends [rad or m] of the range to search, by coordinate; needed for coordinates without limits.
        accuracy: The largest allowed distance between a curved edge and its polyline [rad or m]. For a coordinate whose
            window is narrower than 1 rad or 1 m, it is a share of the window. Straight edges are exact.
        margin: [m], added to every threshold.
        budget: [s], after which tracing ends with an error that says what remains; `inf`: never.
        width: The longest side of the cells that enclose contact curves which need a search (boxes, prisms, and
            segments edge to edge, if they rotate by several angles), in the units of `accuracy`. None: 2 mrad, or 4, 8,
            ... if the curves would need more than 20,000 cells; `region.width` is the chosen value. `unresolved` and
            `area_interval` say what the cells leave open.

    Returns:
        The region, with a named edge for every active boundary or limit. `components` holds the other components.
        Limits belong to the region, contacts do not. `unresolved` lists the points at which it is undecided whether
        parts meet.

    Raises:
        UnknownNameError: If the robot has no such coordinate.
        UnsupportedError: If there are not two coordinates, if a contact curve is degenerate along its length, if the
            window holds too many turns, or if the budget is spent.
        DimensionError: If a coordinate has neither limits nor a window, if `at` is in contact or outside a joint limit,
            or if the accuracy, the margin, the budget or the window is not a usable number.

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
    check_robot(robot)
    if not 0.0 < accuracy < 1.0:
        raise DimensionError(
            f"the accuracy is {accuracy}; give a number between 0 and 1 (radians, metres, or a share of the window)"
        )
    if width is not None and not 0.0 < width < 1.0:
        raise DimensionError(
            f"the width is {width}; give a number between 0 and 1 (radians, metres, or a share of the window)"
        )
    if not 0.0 <= margin < math.inf:
        raise DimensionError(f"the margin is {margin}; give metres, 0 or more")
    start = np.array(robot.home if at is None else one_configuration(at, robot.coordinates), dtype=np.float64)
    slice_ = slice_of(robot, coordinates, start, dict(window or {}), margin)
    return region_of(slice_, accuracy, width, budget)
