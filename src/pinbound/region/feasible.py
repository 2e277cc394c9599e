"""feasible_region(): from a robot to the region around home.

If every boundary has one effective angle in the plane, the component that holds home is an intersection of half-planes:
closed form. Otherwise contact curves are traced (`contours`) and the faces between them found (`arrangement`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pinbound.boundary import one_configuration
from pinbound.exceptions import DimensionError
from pinbound.region.arrangement import Arrangement, arrange, arranged_loops
from pinbound.region.halfplanes import HalfPlane
from pinbound.region.plane import plane_of
from pinbound.region.region import Region, convex_region
from pinbound.robot import Robot
from pinbound.tolerances import REGION_ACCURACY

__all__ = ["feasible_region"]


def feasible_region(
    robot: Robot,
    coordinates: Sequence[str] | None = None,
    at: ArrayLike | None = None,
    window: Mapping[str, tuple[float, float]] | None = None,
    accuracy: float = REGION_ACCURACY,
    margin: float = 0.0,
) -> Region:
    """Return the connected component, containing home, of the joint limits less the contacts.

    Args:
        robot: The robot.
        coordinates: The two coordinates of the plane; None: those that the boundaries use.
        at: (n,) where the other coordinates are held, and the start point; home by default. Between it and home there
            may be no contact of a boundary of one effective angle.
        window: Ends [rad] within which to look, by coordinate; needed for coordinates without limits.
        accuracy: [rad], the largest distance allowed between a curved edge and its polyline. Straight edges are exact.
        margin: [m], added to every threshold.

    Returns:
        The region, with a named edge for every boundary or limit that is active; `components` has the others.

    Raises:
        UnknownNameError: If the robot has no such coordinate.
        UnsupportedError: If there are not two coordinates, or a contact curve is degenerate along its length.
        DimensionError: If a coordinate is without limits, or `at` is in contact or out of limits, or the accuracy or
            the margin is no usable number.

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
        raise DimensionError(f"the accuracy {accuracy} is not between 0 and 1 rad")
    if not 0.0 <= margin < math.inf:
        raise DimensionError(f"the margin {margin} is not a finite length of zero or more")
    start = np.array(robot.home if at is None else one_configuration(at, robot.coordinates), dtype=np.float64)
    plane = plane_of(robot, coordinates, start, dict(window or {}), margin)
    if plane.curves:
        arrangement = arrange(plane, accuracy)
        return _of_face(arrangement, arrangement.faces[0], accuracy, arrangement.faces[1:])
    planes = [*plane.box, *plane.limits]
    for strip in plane.strips:
        lower, upper = strip.gap(plane.start)
        planes.append(HalfPlane(strip.name, strip.name, strip.normal, upper, True))
        planes.append(HalfPlane(strip.name, strip.name, -strip.normal, -lower, True))

    def others() -> tuple[Region, ...]:
        arrangement = arrange(plane, accuracy)
        return tuple(_of_face(arrangement, face, accuracy) for face in arrangement.faces[1:])

    return convex_region(plane, tuple(planes), others)


def _of_face(arrangement: Arrangement, face: Any, accuracy: float, faces: Sequence[Any] = ()) -> Region:
    loops, corners = arranged_loops(arrangement, face, accuracy)

    def others() -> tuple[Region, ...]:
        return tuple(_of_face(arrangement, other, accuracy) for other in faces)

    error = arrangement.chord_error
    return Region(arrangement.plane, loops, corners, error, (), arrangement.lines, others)
