"""Point level: coal's spheres placed by Pinocchio, compared with `clearances`; and the pins of closed loops."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from pinbound.boundaries.looped import over_z
from pinbound.crosscheck.engine import blocks, is_iterated, point_engine, sample, tolerances_of
from pinbound.robot.robot import Robot
from pinbound.tolerances import CLOSURE, CROSSCHECK_POINT, CROSSCHECK_SOLID
from pinbound.typing import Array
from pinbound.values import Value

__all__ = ["PointLevel", "check_points"]


@dataclass(frozen=True, eq=False)
class PointLevel(Value):
    """The mathematics of the clearances, compared with an independent engine.

    Attributes:
        samples: Number of configurations.
        differences: [m], largest `|clearance - coal|` by boundary.
        witnesses: (n,), by boundary, the configuration of this difference.
        pins: [m], largest gap of every closure, with its ends placed by Pinocchio.
        allowed: [m], by boundary: the allowed difference. It grows with the length of the boundary's path.
        solid: Boundaries of boxes and prisms, which coal measures by iteration.
        tolerance: [m], for the differences, for paths of up to 1 m.
        solid_tolerance: [m], for those of `solid`.
        pin_tolerance: [m], for the pins.
    """

    samples: int
    differences: Mapping[str, float]
    witnesses: Mapping[str, Array]
    pins: Mapping[str, float]
    allowed: Mapping[str, float]
    solid: tuple[str, ...] = ()
    tolerance: float = CROSSCHECK_POINT
    solid_tolerance: float = CROSSCHECK_SOLID
    pin_tolerance: float = CLOSURE

    @property
    def worst(self) -> float:
        """[m], the largest difference over all boundaries."""
        return max(self.differences.values(), default=0.0)

    @property
    def holds(self) -> bool:
        """Whether every difference and every pin is within its tolerance."""
        pins = max(self.pins.values(), default=0.0) <= self.pin_tolerance
        return pins and all(value <= self.allowed[name] for name, value in self.differences.items())


def check_points(robot: Robot, samples: int, rng: np.random.Generator) -> PointLevel:
    """Compare clearances at random configurations within the limits.

    Where bodies overlap, or a line passes through one, coal measures the depth, and pinbound a distance of zero.
    """
    Q, engine = sample(robot, samples, rng), point_engine(robot)
    worst = np.zeros(len(robot.boundaries))
    where = np.tile(robot.home, (len(robot.boundaries), 1))
    floor = np.array([over_z(one).path.floor - one.threshold for one in robot.boundaries])
    for block in blocks(len(Q)):
        coal = np.maximum(engine.distances(Q[block]), floor)
        difference = np.abs(robot.boundaries.clearances(Q[block]) - coal)
        difference[np.isnan(difference)] = np.inf
        rows = np.argmax(difference, axis=0)
        found = difference[rows, np.arange(len(worst))]
        where[found > worst] = Q[block][rows[found > worst]]
        worst = np.maximum(worst, found)
    names = robot.boundaries.names
    return PointLevel(
        len(Q),
        dict(zip(names, worst.tolist(), strict=True)),
        dict(zip(names, where, strict=True)),
        _pin_gaps(robot, Q[: min(len(Q), 1000)]),
        {boundary.name: tolerances_of(boundary) for boundary in robot.boundaries},
        tuple(boundary.name for boundary in robot.boundaries if is_iterated(boundary)),
        pin_tolerance=max((closure.mark.tolerance for closure in robot.closures), default=CLOSURE),
    )


def _pin_gaps(robot: Robot, Q: Array) -> dict[str, float]:
    """Return the largest gap of every closure, with both ends placed by Pinocchio."""
    import pinocchio

    pin, model = cast(Any, pinocchio), robot.model
    data, gaps = model.createData(), {closure.name: 0.0 for closure in robot.closures}
    ends = [
        (closure.name, [(model.getFrameId(link, pin.BODY), np.array(xyz)) for link, xyz in _ends(closure.mark)])
        for closure in robot.closures
    ]
    for theta in robot.coupling.expand(Q) if ends else ():
        pin.framesForwardKinematics(model, data, theta)
        for name, ((frame_a, a), (frame_b, b)) in ends:
            gap = np.linalg.norm(data.oMf[frame_a].act(a) - data.oMf[frame_b].act(b))
            gaps[name] = max(gaps[name], float(gap))
    return gaps


def _ends(mark: Any) -> tuple[tuple[str, Any], tuple[str, Any]]:
    return (mark.link_a, mark.xyz_a), (mark.link_b, mark.xyz_b)
