"""cross_check(): compares a robot with coal on four levels."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from typing import Any, Literal, cast

import numpy as np

from pinbound.checks import names_of, whole_number
from pinbound.coverage import CoverageRecord
from pinbound.crosscheck.bodies_level import BodyLevel, check_bodies
from pinbound.crosscheck.contacts import BoundaryLevel, check_contacts
from pinbound.crosscheck.points import PointLevel, check_points
from pinbound.crosscheck.regions_level import RegionLevel, check_region
from pinbound.exceptions import UnknownNameError
from pinbound.region import Region
from pinbound.robot.loop_robot import LoopRobot
from pinbound.robot.robot import Robot, check_robot
from pinbound.tolerances import REGION_ACCURACY
from pinbound.values import Value

__all__ = ["LEVELS", "CrossCheck", "Level", "cross_check"]

Level = Literal["points", "boundaries", "bodies", "region"]
LEVELS: tuple[Level, ...] = ("points", "boundaries", "bodies", "region")


@dataclass(frozen=True)
class CrossCheck(Value):
    """Comparison of a robot's boundaries with coal, level by level.

    The first two levels test the mathematics. The other two test the model: whether the marks represent the bodies.

    Attributes:
        robot: Its name.
        samples: Requested number of configurations.
        rays: Requested number of rays.
        seed: Seed of the random numbers.
        points: Clearances compared with coal's spheres; None if the level was not requested or does not apply.
        boundaries: Contacts compared with bisection on coal's distance.
        bodies: Verdicts compared with coal on the collision bodies.
        region: Membership compared with a flood fill.
        not_checked: Why a requested level does not apply.
        coverage: Which pairs of links the boundaries watch, and which they do not.

    Example:
        >>> import pinbound as pb
        >>> found = pb.cross_check(pb.load("minervabot_v3"), samples=50, levels=("points",))
        >>> found.holds, list(found.levels)
        (True, ['points'])
    """

    robot: str
    samples: int
    rays: int
    seed: int
    points: PointLevel | None
    boundaries: BoundaryLevel | None
    bodies: BodyLevel | None
    region: RegionLevel | None
    not_checked: dict[str, str]
    coverage: CoverageRecord

    @property
    def levels(self) -> dict[str, PointLevel | BoundaryLevel | BodyLevel | RegionLevel]:
        """The checked levels, by name."""
        found = {name: getattr(self, name) for name in LEVELS}
        return {name: level for name, level in found.items() if level is not None}

    @property
    def holds(self) -> bool:
        """Whether at least one level was checked, and every checked level holds."""
        return bool(self.levels) and all(level.holds for level in self.levels.values())

    def to_dict(self) -> dict[str, Any]:
        """Return all values for JSON: metres and radians, arrays as lists."""
        record = cast(dict[str, Any], _plain(self))
        return record | {"holds": self.holds}


def _plain(value: Any) -> Any:
    if isinstance(value, Region):
        return {"coordinates": list(value.coordinates), "vertices": value.vertices.tolist()}
    if is_dataclass(value) and not isinstance(value, type):
        record = {field.name: _plain(getattr(value, field.name)) for field in fields(value)}
        computed = [name for name in ("worst", "holds") if hasattr(value, name) and not isinstance(value, CrossCheck)]
        return record | {name: getattr(value, name) for name in computed}
    if isinstance(value, np.ndarray):
        return cast(Any, value).tolist()
    if isinstance(value, dict):
        return {str(key): _plain(entry) for key, entry in cast(dict[Any, Any], value).items()}
    if isinstance(value, tuple):
        return [_plain(entry) for entry in cast(tuple[Any, ...], value)]
    return value


def cross_check(
    robot: Robot,
    samples: int = 10_000,
    seed: int = 0,
    levels: Collection[Level] = LEVELS,
    rays: int = 1_000,
    step: float | None = None,
    coordinates: Sequence[str] | None = None,
    window: Mapping[str, tuple[float, float]] | None = None,
    accuracy: float = REGION_ACCURACY,
) -> CrossCheck:
    """Compare a robot's boundaries with coal, an independent collision engine, on up to four levels.

    Args:
        robot: The robot.
        samples: Number of random configurations of the point level and the body level.
        seed: Seed of all random numbers; the same seed gives the same answer.
        levels: Some of ``"points"``, ``"boundaries"``, ``"bodies"``, ``"region"``.
        rays: Number of rays of the boundary level, shared among the boundaries.
        step: [rad or m], the spacing of the grid of the region level; None: about 20,000 nodes over the region.
        coordinates: The two coordinates of the region level; None: the two that the boundaries use.
        window: Ends of the slice of the region level, by coordinate [rad or m]; needed for coordinates without limits.
        accuracy: [rad or m], the accuracy of curved edges of the region level.

    Returns:
        The comparison, with a witness configuration for every worst case. `holds` is False if a level disagrees by more
        than its tolerance (`tolerances.CROSSCHECK_*`).

    Raises:
        UnknownNameError: If a level does not exist, or no level is given.
        DimensionError: If `samples` or `rays` is not a positive whole number, or `seed` is negative.
        UnsupportedError: If no random configuration satisfies the limits of all joints.

    References:
        `docs/crosscheck.md`.

    Example:
        >>> import pinbound as pb
        >>> found = pb.cross_check(pb.load("minervabot_v3"), samples=100, rays=20, levels=("points", "boundaries"))
        >>> found.holds, found.points.worst < 1e-12, found.boundaries.worst < 1e-9
        (True, True, True)
    """
    check_robot(robot)
    levels = names_of(levels, "levels")
    for level in levels or ("",):
        if level not in LEVELS:
            raise UnknownNameError("level", level, LEVELS)
    for name, count, least in (("samples", samples, 1), ("rays", rays, 1), ("seed", seed, 0)):
        whole_number(count, name, least)
    if not len(robot.boundaries):
        reasons = dict.fromkeys((level for level in LEVELS if level in levels), "the robot has no boundaries")
        return CrossCheck(robot.name, samples, rays, seed, None, None, None, None, reasons, robot.coverage.record)
    # Every level has its own random stream, so that leaving one out does not change another.
    streams = np.random.default_rng(seed).spawn(3)
    questions: dict[Level, Callable[[], Any]] = {
        "points": lambda: check_points(robot, samples, streams[0]),
        "boundaries": lambda: check_contacts(robot, rays, streams[1]),
        "bodies": lambda: check_bodies(robot, samples, streams[2]),
        "region": lambda: check_region(robot, step, coordinates, window, accuracy),
    }
    if isinstance(robot, LoopRobot):
        names = ", ".join(repr(one.name) for one in robot.lift.linkages)
        for level in ("boundaries", "region"):
            questions[level] = lambda: (
                f"limits and regions are not available through loop {names}, which is not a parallelogram"
            )
    answers = {level: questions[level]() if level in levels else None for level in LEVELS}
    reasons = {level: answer for level, answer in answers.items() if isinstance(answer, str)}
    checked = {level: None if level in reasons else answer for level, answer in answers.items()}
    said = {"not_checked": reasons, "coverage": robot.coverage.record}
    return CrossCheck(robot.name, samples, rays, seed, **cast(Any, checked), **cast(Any, said))
