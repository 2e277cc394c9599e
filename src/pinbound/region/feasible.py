"""feasible_region(): from a robot to the region around home.

If every boundary has one effective angle in the plane, the component that holds home is an intersection of half-planes:
closed form. Otherwise contact curves are traced (`contours`) and the faces between them found (`arrangement`).
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
from pinbound.robot.robot import Robot
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
    """Return the connected component, containing home, of the joint limits less the contacts.

    Args:
        robot: The robot.
        coordinates: The two coordinates of the plane; None: those that the boundaries use, or the robot's own two.
        at: (n,) where the other coordinates are held, and the start point; home by default. It may be on a limit.
            Between it and home there may be no contact of a boundary of one effective angle.
        window: Ends [rad or m] within which to look, by coordinate; needed for coordinates without limits.
        accuracy: The largest distance allowed between a curved edge and its polyline [rad or m]; of a coordinate whose
            window is narrower than 1 rad or 1 m, this share of the window. Straight edges are exact.
        margin: [m], added to every threshold.
        budget: [s], after which tracing ends in an error that says what is left; `inf`: never.
        width: Of contacts that are searched for (boxes, prisms, segments edge to edge, where they turn by several
            angles): the longest side of the cells that enclose their curves, in the units of `accuracy`. None: 2 mrad,
            or 4, 8, ... where the curves are so long that 20,000 cells are used up; `region.width` says which. What
            cells leave open, `unresolved` tells, and `area_interval`.

    Returns:
        The region, with a named edge for every boundary or limit that is active; `components` has the others. Limits
        belong to it, contacts do not. `unresolved` lists the points at which it is undecided whether parts meet.

    Raises:
        UnknownNameError: If the robot has no such coordinate.
        UnsupportedError: If there are not two coordinates, a contact curve is degenerate along its length, the window
            holds too many turns, or the budget runs out.
        DimensionError: If a coordinate is without limits, or `at` is in contact or out of the limits of any joint, or
            the accuracy, the margin, the budget or the window is no usable number.

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
