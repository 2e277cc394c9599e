"""The body that a section sweeps when a coordinate rotates it: its volume, and a closed mesh.

A point of the section at distance u from the axis moves on an arc of radius |u|. So, with the rotation angle `alpha`,

    volume = alpha * int |u| dA      (Pappus),

if no point is swept twice. If the section crosses the axis, the part beyond it is mirrored first; the overlap of both
sides is swept over `min(2 alpha, 2 pi)`, and counts once.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, cast

import numpy as np
import shapely
import shapely.affinity

from pinbound.exceptions import DimensionError, UnsupportedError
from pinbound.extras import Needs
from pinbound.geometry.rotations import rotation_matrix
from pinbound.region.folds import triangulate
from pinbound.region.workspace import Measure, Section
from pinbound.robot.robot import Robot
from pinbound.tolerances import CHORD, MESH_CHORD, REDUCTION
from pinbound.typing import Array, Ints

__all__ = ["SweptBody", "swept_body"]

sh = cast(Any, shapely)

_TURN = 2.0 * math.pi
_FORMATS = (".ply", ".stl", ".obj")


@dataclass(frozen=True)
class SweptBody:
    """The body that a section sweeps between two values of the coordinate that rotates it.

    Attributes:
        section: The section, with its `turn`.
        lower: First value of the coordinate [rad].
        upper: Last value [rad].
        start: Rotation angle at `lower`, relative to the section [rad].

    Example:
        >>> import pinbound as pb
        >>> robot = pb.load("minervabot_v3")
        >>> section = pb.workspace_section(robot, pb.feasible_region(robot), "link_6", turn="q1")
        >>> pb.swept_body(robot, section).crosses_axis
        False
    """

    section: Section
    lower: float
    upper: float
    start: float

    @property
    def angle(self) -> float:
        """The swept angle [rad], at most a full turn."""
        turn = self.section.turn
        return min(abs(turn.coefficient) * (self.upper - self.lower), _TURN) if turn is not None else 0.0

    @cached_property
    def crosses_axis(self) -> bool:
        """Whether the section has points on both sides of the axis, or on it."""
        west, _, _, _ = self.section.polygon(CHORD).bounds
        return west <= CHORD  # the polygon is within CHORD of the section

    @cached_property
    def volume(self) -> Measure:
        """The volume [m^3]; each point counts once.

        Raises:
            UnsupportedError: If the section crosses the axis, and its plane does not contain the axis.

        Example:
            >>> import pinbound as pb
            >>> from pinbound.region.workspace import workspace_section
            >>> robot = pb.load("minervabot_v3")
            >>> section = workspace_section(robot, pb.feasible_region(robot), "link_6", turn="q1")
            >>> f"{1e9 * swept_body(robot, section).volume.value:.6e}"
            '1.014810e+07'
        """
        if self.section.is_one_to_one and not self.crosses_axis:
            moment = self.section.moment
            return Measure(self.angle * moment.value, self.angle * moment.error, moment.method)
        self._must_hold_axis()
        return self.section.refined(self._volume_of, self.angle * self.section.reach)

    def _must_hold_axis(self) -> None:
        offset = self.section.map.offset
        if self.crosses_axis and abs(offset) > REDUCTION:
            raise UnsupportedError(
                f"the section crosses its axis in a plane {1e3 * abs(offset):.6g} mm beside it; "
                "take a region whose section stays on one side of it"
            )

    def _folded_over(self, polygon: Any) -> tuple[Any, Any]:
        """Return the parts with u >= 0 and, mirrored, with u <= 0."""
        west, south, east, north = polygon.bounds
        right = polygon.intersection(shapely.box(0.0, south - 1.0, max(east, 0.0) + 1.0, north + 1.0))
        left = polygon.intersection(shapely.box(min(west, 0.0) - 1.0, south - 1.0, 0.0, north + 1.0))
        return right, shapely.affinity.scale(left, xfact=-1.0, origin=(0.0, 0.0))

    def _volume_of(self, polygon: Any) -> float:
        right, left = self._folded_over(polygon)
        once, both = _moment(right.symmetric_difference(left)), _moment(right.intersection(left))
        return self.angle * once + min(2.0 * self.angle, _TURN) * both

    def mesh(self, chord: float = MESH_CHORD) -> Any:
        """Return the body as a closed `trimesh.Trimesh` [m], within `chord` [m] of it.

        Raises:
            UnsupportedError: If the section crosses the axis.
            DimensionError: If the swept angle or the section is empty, or if the chord is not positive.

        Example:
            >>> import pinbound as pb
            >>> robot = pb.load("minervabot_v3")
            >>> section = pb.workspace_section(robot, pb.feasible_region(robot), "link_6", turn="q1")
            >>> pb.swept_body(robot, section).mesh(chord=0.002).is_watertight
            True
        """
        with Needs("meshes", "a swept body as a mesh"):
            import trimesh

        if not REDUCTION < chord < math.inf:
            raise DimensionError(f"the chord is {chord}; give metres above 0")
        if self.crosses_axis:  # chord / 2 for the section, chord / 2 for the turning
            raise UnsupportedError("the section reaches its axis; take a region whose section stays on one side of it")
        polygon = sh.orient_polygons(self.section.polygon(chord / 2))
        if polygon.geom_type != "Polygon":
            raise UnsupportedError(f"the section is a {polygon.geom_type}, not one polygon; give a smaller chord")
        if not self.angle > 0.0:
            raise DimensionError(f"from {self.lower} to {self.upper} rad nothing is swept; give lower < upper")
        radius = float(np.hypot(polygon.bounds[2], self.section.map.offset))
        widest = 2.0 * math.acos(max(1.0 - chord / 2 / radius, 0.0))
        is_closed = self.angle >= _TURN - REDUCTION
        steps = max(3, math.ceil(self.angle / widest))
        stations = self.start + np.arange(steps if is_closed else steps + 1) * self.angle / steps
        vertices, faces = _sweep(polygon, len(stations), is_closed)
        body: Any = trimesh.Trimesh(self._placed(vertices, stations), faces, process=False)
        if body.volume < 0.0:
            body.invert()
        return body

    def _placed(self, flat: Array, stations: Array) -> Array:
        """Return the vertices (len(stations) * m, 3): the section's points turned to every station."""
        section, turn = self.section, self.section.turn
        assert turn is not None  # swept_body checks it
        image = section.map
        points = flat @ np.array((image.u, image.v)) + image.offset * image.normal
        turned = [points @ rotation_matrix(turn.axis, float(angle)).T for angle in stations]
        return np.vstack(turned) + turn.point

    def export(self, path: str | Path, chord: float = MESH_CHORD) -> Path:
        """Write the mesh as `.ply`, `.stl` (binary) or `.obj`, in metres, in the frame of the root link.

        Args:
            path: The file; an existing file is replaced.
            chord: [m], the largest error of the mesh.

        Raises:
            DimensionError: If the file has another suffix.
        """
        target = Path(path)
        if target.suffix not in _FORMATS:
            raise DimensionError(f"{target.name!r} has no suffix of a mesh format; valid: {', '.join(_FORMATS)}")
        self.mesh(chord).export(target)
        return target


def swept_body(robot: Robot, section: Section, lower: float | None = None, upper: float | None = None) -> SweptBody:
    """Return the body that a section sweeps.

    Args:
        robot: The robot.
        section: A section made with `turn=...`.
        lower: First value of the coordinate `turn` [rad]; its lower limit by default.
        upper: Last value [rad]; its upper limit by default.

    Raises:
        DimensionError: If the section was made without `turn`, or if the range is not finite or is reversed.

    References:
        The paper's Figs. 11 and 12; `docs/workspace.md`.

    Example:
        >>> import pinbound as pb
        >>> robot = pb.load("minervabot_v3")
        >>> section = pb.workspace_section(robot, pb.feasible_region(robot), "link_6", turn="q1")
        >>> f"{1e3 * swept_body(robot, section).volume.value:.2f} dm^3"
        '10.15 dm^3'
    """
    turn = section.turn
    if turn is None:
        raise DimensionError("the section has no coordinate that turns it; make it with turn=...")
    first = float(robot.lower[turn.index]) if lower is None else float(lower)
    last = float(robot.upper[turn.index]) if upper is None else float(upper)
    if not (math.isfinite(first) and math.isfinite(last) and first <= last):
        raise DimensionError(f"{turn.coordinate!r} cannot sweep from {first} to {last}; give finite lower <= upper")
    at = float(section.region.at[turn.index])
    end = first if turn.coefficient > 0 else last
    return SweptBody(section, first, last, turn.coefficient * (end - at))


def _moment(polygon: Any) -> float:
    return float(polygon.centroid.x * polygon.area) if not polygon.is_empty else 0.0


def _sweep(polygon: Any, stations: int, is_closed: bool) -> tuple[Array, Ints]:
    """Return the section's vertices (m, 2), and faces over `stations` copies of them; caps unless closed."""
    rings = [shapely.get_coordinates(ring)[:-1] for ring in (polygon.exterior, *polygon.interiors)]
    vertices, faces, first = np.vstack(rings), list[Array](), 0
    count = len(vertices)
    for ring in rings:
        here = first + np.arange(len(ring))
        after = np.roll(here, -1)
        first += len(ring)
        for station in range(stations if is_closed else stations - 1):
            low, high = station * count, (station + 1) % stations * count
            faces += [
                np.column_stack((here + low, after + low, after + high)),
                np.column_stack((here + low, after + high, here + high)),
            ]
    if not is_closed:
        places = {tuple(vertex): index for index, vertex in enumerate(vertices.tolist())}
        cap = np.array([[places[tuple(corner)] for corner in one] for one in triangulate(polygon).tolist()])
        clockwise = _twice_area(vertices[cap]) < 0.0
        cap[clockwise] = cap[clockwise][:, ::-1]
        faces += [cap[:, ::-1], cap + (stations - 1) * count]
    return vertices, np.vstack(faces).astype(np.int64)


def _twice_area(triangles: Array) -> Array:
    a, b = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
