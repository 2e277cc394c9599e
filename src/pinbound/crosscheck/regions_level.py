"""Region level: membership compared with a flood fill from home that uses only coal's verdicts and joint limits.

The flood fill moves over a square grid through home. If a collision stops it, the point is bisected on coal's yes-or-no
query. These points are its contour, and the region must have its own contour there.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from pinbound.coverage.bodies import collision_bodies
from pinbound.crosscheck.engine import Engine, body_shapes, point_engine, within_limits
from pinbound.exceptions import DimensionError, UnsupportedError
from pinbound.region import Region, feasible_region
from pinbound.robot.robot import Robot
from pinbound.tolerances import CROSSCHECK_BODY, CROSSCHECK_STOP, REGION_ACCURACY
from pinbound.typing import Array
from pinbound.values import Value

__all__ = ["RegionLevel", "check_region"]

_NODES = 20_000  # nodes over the region's area, which set the step of the grid
_MOST_NODES = 10 * _NODES
_HALVINGS = 30

Cell = tuple[int, int]


@dataclass(frozen=True, eq=False)
class RegionLevel(Value):
    """The region in the slice, compared with the points that a robot can reach according to coal.

    Attributes:
        coordinates: The two coordinates.
        shapes: The shapes in coal: ``"bodies"``, or ``"spheres"`` at the marked points.
        ignored: Pairs of links with bodies that touch at home, which coal therefore had to leave out.
        region: The region that was checked.
        step: [rad], of the grid.
        nodes: Number of nodes that were reached, or are in the region.
        unsafe: Number of nodes in the region that the flood fill does not reach.
        refused: Number of nodes that it reaches outside the region.
        depth_unsafe: [rad], how deep in the region the deepest of the first are.
        depth_refused: [rad], how far outside the region the furthest of the second are.
        unsafe_at: (k, 2) [rad], the first.
        refused_at: (k, 2) [rad], the second.
        contour: (k, 2) [rad], where collisions stopped the flood fill.
        contour_inside: [rad], the largest distance of coal's contour inside the region: unsafe.
        contour_outside: [rad], the largest distance of it outside: a needless refusal.
        tolerance: [rad], for the contour.
        stops: Whether a boundary has zero threshold, so that the contours must agree on both sides.
        complete: Whether the flood fill was completed.
    """

    coordinates: tuple[str, str]
    shapes: str
    ignored: tuple[tuple[str, str], ...]
    region: Region
    step: float
    nodes: int
    unsafe: int
    refused: int
    depth_unsafe: float
    depth_refused: float
    unsafe_at: Array
    refused_at: Array
    contour: Array
    contour_inside: float
    contour_outside: float
    tolerance: float
    stops: bool
    complete: bool

    @property
    def worst(self) -> float:
        """[rad], the largest difference on the unsafe side."""
        return max(self.contour_inside, self.depth_unsafe - self.step, 0.0)

    @property
    def holds(self) -> bool:
        """Whether the region contains nothing that coal forbids and, with stops, refuses nothing that coal allows.

        Nodes are judged to one step of the grid, which cannot follow sharp corners; the contour to the tolerance.
        """
        safe = self.contour_inside <= self.tolerance and self.depth_unsafe <= self.step
        exact = self.contour_outside <= self.tolerance and self.depth_refused <= self.step
        return self.complete and safe and (exact or not self.stops)


def check_region(
    robot: Robot,
    step: float | None = None,
    coordinates: Sequence[str] | None = None,
    window: Mapping[str, tuple[float, float]] | None = None,
    accuracy: float = REGION_ACCURACY,
) -> RegionLevel | str:
    """Compare the region with a flood fill, or say why that cannot be done; arguments as for `feasible_region`."""
    try:
        region = feasible_region(robot, coordinates, window=window, accuracy=accuracy)
    except (UnsupportedError, DimensionError) as error:
        return str(error)
    found = _engine(robot)
    if isinstance(found, str):
        return found
    engine, shapes, ignored = found
    step = step if step is not None else math.sqrt(region.area / _NODES)
    if not (math.isfinite(step) and step > 0.0):
        raise DimensionError(f"the step {step} of the grid is not a positive angle; give radians above 0")
    columns = [robot.coordinates.index(name) for name in region.coordinates]
    flood = _Flood(robot, engine, columns, step, region.slice.window if window else None)
    flood.run()
    return _compare(robot, region, shapes, ignored, flood)


_Pairs = tuple[tuple[str, str], ...]


def _engine(robot: Robot) -> tuple[Engine, str, _Pairs] | str:
    """Return what coal checks: bodies if all marked links have simple ones, else spheres if all have some size.

    Of the bodies all pairs count that move against each other, except those that touch at home; these are returned.
    """
    bodies = [body for body in collision_bodies(robot) if body.shape != "mesh"]
    marked = {point.link for boundary in robot.boundaries for point in (boundary.point_a, boundary.point_b)}
    if marked <= {body.link for body in bodies}:
        pairs = [
            (first, second)
            for first, second in combinations(range(len(bodies)), 2)
            if any(joint.moves for joint in robot.tree.path_between(bodies[first].link, bodies[second].link))
        ]
        shapes = body_shapes(bodies)
        at_home = Engine(robot, shapes, pairs).distances(robot.home[None])[0]
        apart = [pair for pair, distance in zip(pairs, at_home, strict=True) if distance > 0.0]
        touching = [pair for pair, distance in zip(pairs, at_home, strict=True) if not distance > 0.0]
        ignored = {(bodies[first].link, bodies[second].link) for first, second in touching}
        return Engine(robot, shapes, apart), "bodies", tuple(sorted(ignored))
    if all(boundary.has_size for boundary in robot.boundaries):
        return point_engine(robot), "spheres", ()
    return "a flood fill passes through points of zero threshold; it needs collision bodies on every marked link"


class _Flood:
    """A flood fill over nodes `home + step * (i, j)`."""

    def __init__(self, robot: Robot, engine: Engine, columns: list[int], step: float, window: Array | None) -> None:
        """Fill from home; outside a window (2, 2), rows lower and upper, as outside the limits."""
        self.robot, self.engine, self.columns, self.step, self.window = robot, engine, columns, step, window
        self.reached: set[Cell] = set()
        self.stopped: list[Array] = []
        self.complete = True

    def q(self, point: Array) -> Array:
        q = np.array(self.robot.home)
        q[self.columns] = point
        return q

    def point(self, cell: Cell) -> Array:
        return self.robot.home[self.columns] + self.step * np.array(cell, dtype=np.float64)

    def run(self) -> None:
        queue: deque[Cell] = deque([(0, 0)])
        self.reached.add((0, 0))
        while queue:
            i, j = queue.popleft()
            for cell in ((i + 1, j), (i - 1, j), (i, j + 1), (i, j - 1)):
                if cell in self.reached:
                    continue
                q = self.q(self.point(cell))
                if not within_limits(self.robot, q[None])[0] or not self._in_window(self.point(cell)):
                    continue
                if self.engine.is_free(q):
                    self.reached.add(cell)
                    queue.append(cell)
                else:
                    self.stopped.append(self._stop(self.point((i, j)), self.point(cell)))
            if len(self.reached) > _MOST_NODES:
                self.complete = False
                return

    def _in_window(self, point: Array) -> bool:
        return self.window is None or bool(np.all((self.window[0] <= point) & (point <= self.window[1])))

    def _stop(self, free: Array, hit: Array) -> Array:
        for _ in range(_HALVINGS):
            middle = (free + hit) / 2
            free, hit = (middle, hit) if self.engine.is_free(self.q(middle)) else (free, middle)
        return hit


def _compare(robot: Robot, region: Region, shapes: str, ignored: _Pairs, flood: _Flood) -> RegionLevel:
    low, high = region.vertices.min(axis=0), region.vertices.max(axis=0)
    start = robot.home[flood.columns]
    first = np.floor((low - start) / flood.step).astype(int)
    last = np.ceil((high - start) / flood.step).astype(int)
    box = {(i, j) for i in range(first[0], last[0] + 1) for j in range(first[1], last[1] + 1)}
    cells = sorted(box | flood.reached)
    points = start + flood.step * np.array(cells, dtype=np.float64)
    # the grid takes one step for both coordinates, so one radian counts as much as one metre here
    even = dict.fromkeys(region.coordinates, 1.0)
    distance = np.asarray(region.signed_distance(points, "region", even), dtype=np.float64)
    reached = np.array([cell in flood.reached for cell in cells])
    unsafe, refused = (distance > 0.0) & ~reached, (distance <= 0.0) & reached
    contour = np.array(flood.stopped).reshape(-1, 2)
    apart = (
        np.asarray(region.signed_distance(contour, "region", even), dtype=np.float64) if len(contour) else np.zeros(0)
    )
    return RegionLevel(
        coordinates=region.coordinates,
        shapes=shapes,
        ignored=ignored,
        region=region,
        step=flood.step,
        nodes=int(np.sum(reached | (distance > 0.0))),
        unsafe=int(np.sum(unsafe)),
        refused=int(np.sum(refused)),
        depth_unsafe=float(np.max(distance[unsafe], initial=0.0)),
        depth_refused=float(np.max(-distance[refused], initial=0.0)),
        unsafe_at=points[unsafe],
        refused_at=points[refused],
        contour=contour,
        contour_inside=float(np.max(apart, initial=0.0)),
        contour_outside=float(np.max(-apart, initial=0.0)),
        tolerance=_angle_tolerance(robot, shapes) + region.width,  # chords in cells cut corners by less than a cell
        stops=any(not boundary.has_size for boundary in robot.boundaries),
        complete=flood.complete,
    )


def _angle_tolerance(robot: Robot, shapes: str) -> float:
    """Return what coal, the bodies or the links may be off, as an angle on the shortest lever arm of a marked point."""
    paths = [boundary.path for boundary in robot.boundaries]
    middles = [path.minimal.offsets[-1] + 0.5 * sum(edge[-1] for edge in path.difference.directions) for path in paths]
    arms = [arm for arm in np.linalg.norm(middles, axis=1).tolist() if arm > 0.0]
    margin = max((boundary.place_error for boundary in robot.boundaries), default=0.0)
    return ((CROSSCHECK_BODY if shapes == "spheres" else CROSSCHECK_STOP) + margin) / min(arms, default=1.0)
