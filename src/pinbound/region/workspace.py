"""The image of a region under forward kinematics: its contour, its area, and the body that another joint sweeps.

If the map does not fold, and the image of the contour does not cross itself, the map is one-to-one. Then areas are
boundary integrals over the image of the contour,

    area = 1/2 |oint u dv - v du|,    int u dA = 1/2 |oint u^2 dv|,

whose integrands are analytic along straight edges, so Gauss-Legendre quadrature converges to rounding. Otherwise the
covered places are computed (`covering`), twice; the second time with chords of half the length. `docs/workspace.md` has
the derivation.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, cast

import numpy as np
import shapely

from pinbound.exceptions import DimensionError, UnknownNameError, UnsupportedError
from pinbound.path.chain import Chain, are_parallel
from pinbound.path.relative import absolute_chain
from pinbound.path.restriction import hold
from pinbound.region.covering import Parts, covered, cut_along_folds, subdivided
from pinbound.region.folds import Folds, find_folds
from pinbound.region.planar_image import PlanarImage, planar_image
from pinbound.region.region import Region
from pinbound.robot.robot import Robot
from pinbound.tolerances import CHORD, QUADRATURE, REDUCTION
from pinbound.typing import Array
from pinbound.values import Value

__all__ = ["Measure", "Section", "workspace_section"]

Integrand = Callable[[Array, Array], Array]
sh = cast(Any, shapely)  # newer functions than the stubs know

_NODES = 20
_HALVINGS = 12
_COVER_CHORD = 1e-7  # relative to the motion of the image for a unit of a coordinate, if all edges are straight
_COVER_CHORDS = 1e-8, 1e-4  # the least and the largest value for a quarter of the accuracy of curved edges


@dataclass(frozen=True)
class Measure:
    """A number with its error.

    Attributes:
        value: In metres, squared or cubed.
        error: In the unit of `value`: the change with twice the quadrature nodes, or with chords of half the length,
            plus rounding, plus the effect of the accuracy of the region's curved edges.
        method: ``"boundary integral"`` or ``"covered places"``.
    """

    value: float
    error: float
    method: str


@dataclass(frozen=True, eq=False)
class Turn(Value):
    """A coordinate that rotates the whole section about one line.

    Attributes:
        coordinate: Its name.
        index: Its index in q.
        point: (3,) the point of the axis nearest to the origin of the root link [m], in the frame of the root link.
        axis: (3,) unit vector.
        coefficient: Rotation angle per unit of the coordinate.
    """

    coordinate: str
    index: int
    point: Array
    axis: Array
    coefficient: float


@dataclass(frozen=True)
class Section(Value):
    """The image of a region in the plane in which a frame moves.

    Attributes:
        region: The region of two coordinates.
        link: The link of the frame.
        xyz: (3,) the point in the frame of the link [m].
        map: The map from the two coordinates to the plane; the first axis u of the plane points away from the axis of
            `turn`.
        turn: The coordinate that rotates the whole section; None if none was requested.

    Example:
        >>> import pinbound as pb
        >>> robot = pb.load("minervabot_v3")
        >>> section = pb.workspace_section(robot, pb.feasible_region(robot), "link_6")
        >>> section.link, section.xyz
        ('link_6', (0.0, 0.0, 0.0))
    """

    region: Region
    link: str
    xyz: tuple[float, float, float]
    map: PlanarImage
    turn: Turn | None

    def points(self, X: Array) -> Array:
        """Return the positions (N, 3) [m] in the frame of the root link, for points (N, 2) of the region's slice."""
        return self.map.points(np.asarray(X, dtype=np.float64).reshape(-1, 2))

    def image(self, X: Array) -> Array:
        """Return the positions (N, 2) [m] in the plane of the section: (distance from the axis, height)."""
        return self.map.image(np.asarray(X, dtype=np.float64).reshape(-1, 2))

    @cached_property
    def folds(self) -> Folds:
        """The proven sign of the Jacobian over the region, or the places where it may change."""
        return find_folds(self.map, self.region.polygon)

    @cached_property
    def is_one_to_one(self) -> bool:
        """Whether different points of the region have different images: no fold, and a simple image of the contour."""
        return self.folds.sign != 0 and bool(self._outline(CHORD).is_valid)

    def edge_image(self, start: Array, end: Array, chord: float = CHORD) -> Array:
        """Return the image (k, 2) [m] of a straight edge, `start` to `end` (2,), at most `chord` [m] away from it."""
        return self.image(self._subdivided(np.array([start, end]), chord))

    def polygon(self, chord: float = CHORD) -> Any:
        """Return the section as a `shapely` polygon [m], its curved edges within `chord` [m].

        Example:
            >>> import pinbound as pb
            >>> robot = pb.load("minervabot_v3")
            >>> section = workspace_section(robot, pb.feasible_region(robot), "link_6", turn="q1")
            >>> section.polygon(1e-6).bounds[0] > 0
            True
        """
        _positive("chord", chord)
        return self._outline(chord) if self.is_one_to_one else covered(self.map, self._parts, chord)[0]

    def export(self, path: str | Path, chord: float = CHORD) -> Path:
        """Write the polygon of the section as GeoJSON (`.geojson`, `.json`) or well-known text (`.wkt`), in metres.

        Args:
            path: The file; one that exists is replaced.
            chord: [m], the largest error of curved edges.

        Raises:
            DimensionError: If the suffix is another one.
        """
        target = Path(path)
        writers: dict[str, Any] = {".geojson": sh.to_geojson, ".json": sh.to_geojson, ".wkt": sh.to_wkt}
        if target.suffix not in writers:
            raise DimensionError(f"{target.name!r} has no suffix of a polygon format; valid: {', '.join(writers)}")
        target.write_text(writers[target.suffix](self.polygon(chord)) + "\n", encoding="utf-8")
        return target

    @cached_property
    def area(self) -> Measure:
        """Area of the section [m^2]; each point counts once.

        Example:
            >>> import pinbound as pb
            >>> robot = pb.load("minervabot_v3")
            >>> section = workspace_section(robot, pb.feasible_region(robot), "link_6", turn="q1")
            >>> round(1e6 * section.area.value, 2)
            13787.57
        """
        if self.is_one_to_one:
            return self._boundary_integral(_half_cross, 1.0)
        return self.refined(_area, 1.0)

    @cached_property
    def moment(self) -> Measure:
        """The integral of u over the section [m^3]; only for sections on one side of the axis, u >= 0."""
        return self._boundary_integral(_half_square, self.reach)

    @cached_property
    def _parts(self) -> Parts:
        return cut_along_folds(self.map, self.region.polygon)

    @cached_property
    def reach(self) -> float:
        """The largest distance of the section from the axis [m], or an upper bound of it."""
        west, south, east, north = self.region.polygon.bounds
        corners = np.array([[west, south], [east, north]])
        spread = float(self.map.first_bound @ (corners[1] - corners[0])) / 2
        return float(np.abs(self.image(corners.mean(axis=0))[:, 0]).max()) + spread

    def refined(self, quantity: Callable[[Any], float], density: float) -> Measure:
        """Return a quantity of the covered places, computed with two lengths of chords.

        The error of chords falls with the square of their length. So `fine + (fine - coarse) / 3`, where the chords of
        `fine` are half as long, cancels it to first order. The stated error is the difference of the two values.

        Args:
            quantity: A function of a shapely geometry in the plane of the section, e.g. its area.
            density: The largest value of the quantity for one square metre.

        Example:
            >>> import pinbound as pb
            >>> robot = pb.load("minervabot_v3")
            >>> section = workspace_section(robot, pb.feasible_region(robot), "link_6")
            >>> f"{1e4 * section.refined(lambda shape: shape.area, 1.0).value:.0f} cm^2"
            '138 cm^2'
        """
        finest, coarsest = _COVER_CHORDS
        share = min(max(self.region.accuracy / 4.0, finest), coarsest) if self.region.accuracy else _COVER_CHORD
        chord = share * float(np.max(self.map.first_bound))
        (coarse, _), (fine, left_out) = (covered(self.map, self._parts, chord, finer) for finer in (1, 2))
        first, second = float(quantity(coarse)), float(quantity(fine))
        error = abs(second - first) + density * (left_out + self._contour_error)
        return Measure(second + (second - first) / 3.0, error, "covered places")

    @cached_property
    def _contour_error(self) -> float:
        """[m^2], the error of the image's area: |det| along the region's curved edges, times its accuracy."""
        total = 0.0
        for edge in self.region.edges if self.region.accuracy else ():
            if len(edge.points) > 2:
                middle, length = (edge.points[1:] + edge.points[:-1]) / 2, np.diff(edge.points, axis=0)
                total += float(np.abs(self.map.determinant(middle)) @ np.linalg.norm(length, axis=1))
        return total * self.region.accuracy

    def _rings(self) -> list[Array]:
        """Return the region's rings, closed: outer counter-clockwise, holes clockwise."""
        polygon = sh.orient_polygons(self.region.polygon)
        return [shapely.get_coordinates(ring) for ring in (polygon.exterior, *polygon.interiors)]

    def _subdivided(self, ring: Array, chord: float) -> Array:
        return subdivided(self.map, ring, chord)

    def _outline(self, chord: float) -> Any:
        rings = [self.image(self._subdivided(ring, chord)) for ring in self._rings()]
        return shapely.Polygon(rings[0], rings[1:])

    def _boundary_integral(self, integrand: Integrand, density: float) -> Measure:
        """Integrate along the image of the contour; the error is the change with twice the nodes, and rounding."""
        rings, scale = self._rings(), 0.0
        starts, ends = np.vstack([r[:-1] for r in rings]), np.vstack([r[1:] for r in rings])
        value = error = math.nan
        for _ in range(_HALVINGS):
            coarse, fine = (self._gauss(integrand, starts, ends, count) for count in (_NODES, 2 * _NODES))
            value, scale = fine
            error = abs(value - coarse[0])
            if error <= QUADRATURE * scale:
                break
            middles = (starts + ends) / 2
            starts, ends = np.vstack((starts, middles)), np.vstack((middles, ends))
        rounding = 8.0 * np.finfo(float).eps * self.map.chain.rotations * scale
        return Measure(abs(value), float(error + rounding + density * self._contour_error), "boundary integral")

    def _gauss(self, integrand: Integrand, starts: Array, ends: Array, count: int) -> tuple[float, float]:
        """Return the integral over all segments, and the integral of the absolute value."""
        nodes, weights = np.polynomial.legendre.leggauss(count)
        s = (nodes + 1.0) / 2
        steps = ends - starts
        X = (starts[:, None] + s[:, None] * steps[:, None]).reshape(-1, 2)
        d = np.repeat(steps, count, axis=0)
        values = integrand(self.image(X), np.einsum("nak,nk->na", self.map.jacobian(X), d))
        weighted = np.tile(weights / 2, len(starts)) * values
        return math.fsum(weighted), math.fsum(np.abs(weighted))


def workspace_section(
    robot: Robot,
    region: Region,
    link: str,
    xyz: Sequence[float] = (0.0, 0.0, 0.0),
    turn: str | None = None,
) -> Section:
    """Return the image of a region for one point of one link; the other coordinates are those of `region.at`.

    Args:
        robot: The robot.
        region: A region of the robot that is not empty.
        link: The link whose frame is followed.
        xyz: (3,) the point in the link's frame [m].
        turn: A coordinate that rotates the whole section about one line, for `swept_body`; then u is the distance from
            this line, and v is along it. None: u and v start at the origin of the root link, and v points upwards.

    Raises:
        UnknownNameError: If the link or the coordinate does not exist.
        UnsupportedError: If the frame does not move in a plane, or if `turn` does not rotate this whole plane about an
            axis parallel to it.
        DimensionError: If the region is empty.

    References:
        The paper's Figs. 9-12; `docs/workspace.md`.

    Example:
        >>> import pinbound as pb
        >>> robot = pb.load("minervabot_v3")
        >>> section = workspace_section(robot, pb.feasible_region(robot), "link_6")
        >>> section.folds.sign, section.is_one_to_one, section.area.method
        (-1, True, 'boundary integral')
    """
    if link not in robot.tree.links:
        raise UnknownNameError("link", link, robot.tree.links)
    if region.is_empty:
        raise DimensionError("the region is empty, so it has no image; check `is_empty` first")
    x, y, z = (float(value) for value in xyz)
    chain = absolute_chain(robot.tree, robot.coupling, link, (x, y, z))
    indices = [robot.coordinates.index(name) for name in region.coordinates]
    turning = None if turn is None else _turn(robot, chain, indices, region, turn)
    upright, foot = (np.array([0.0, 0.0, 1.0]), np.zeros(3)) if turning is None else (turning.axis, turning.point)
    most = np.max(np.abs(region.vertices), axis=0)
    image = planar_image(hold(chain, region.at, indices), upright, foot, most, region.centroid)
    if turning is not None and not are_parallel(image.v, turning.axis):
        raise UnsupportedError(
            f"the axis of {turn!r} does not lie along the plane in which {link!r} moves: no volume is swept; "
            "leave turn= out"
        )
    return Section(region, link, (x, y, z), image, turning)


def _turn(robot: Robot, chain: Chain, indices: Sequence[int], region: Region, name: str) -> Turn:
    """Return the axis of a coordinate, if everything that moves in the region comes after it and it is used once."""
    if name not in robot.coordinates:
        raise UnknownNameError("coordinate", name, robot.coordinates)
    index = robot.coordinates.index(name)
    uses = np.flatnonzero(chain.coefficients[:, index])
    ahead = int(uses[0]) if len(uses) else -1
    before = np.any(chain.coefficients[: ahead + 1][:, list(indices)]) or np.any(
        chain.slides[: ahead + 1][:, :, list(indices)]
    )
    if index in indices or len(uses) != 1 or np.any(chain.slides[:, :, index]) or before:
        raise UnsupportedError(
            f"{name!r} does not rotate the whole section: it must come once in the path to the frame, before "
            f"{' and '.join(region.coordinates)} do; name another coordinate, or leave turn= out"
        )
    alone = hold(chain, region.at, [index])
    axis, point = alone.axes[0], alone.offsets[0]
    foot = point - axis * float(axis @ point)
    return Turn(name, index, foot, axis.copy(), float(alone.coefficients[0, 0]))


def _half_cross(p: Array, d: Array) -> Array:
    return (p[:, 0] * d[:, 1] - p[:, 1] * d[:, 0]) / 2


def _half_square(p: Array, d: Array) -> Array:
    return p[:, 0] ** 2 * d[:, 1] / 2


def _area(polygon: Any) -> float:
    return float(polygon.area)


def _positive(what: str, value: float) -> None:
    if not REDUCTION < value < math.inf:
        raise DimensionError(f"the {what} is {value}; give metres above 0")
