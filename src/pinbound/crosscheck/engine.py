"""Shapes on links, placed by Pinocchio, with distances by coal. Of pinbound only `theta = S q + o` is used."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, cast

import numpy as np

from pinbound.annotations import Mark, Measure
from pinbound.annotations import Shape as MarkShape
from pinbound.boundaries.boundary import Boundary
from pinbound.boundaries.looped import over_z
from pinbound.coverage.bodies import Body
from pinbound.exceptions import UnsupportedError
from pinbound.robot.robot import Robot
from pinbound.tolerances import CROSSCHECK_INFLATION, CROSSCHECK_POINT, CROSSCHECK_SOLID, REDUCTION
from pinbound.typing import Array, Flags, Ints
from pinbound.values import Value

__all__ = [
    "Engine",
    "Shape",
    "blocks",
    "body_shapes",
    "is_iterated",
    "mark_shape",
    "pair_engine",
    "point_engine",
    "sample",
    "size_of",
    "tolerances_of",
    "within_limits",
]

_BLOCK = 20_000
_MOST_CONTACTS = 1_000
_UNLIMITED_SLIDE = 1.0  # metres: sampling range of a prismatic joint without limits
_MOST_DRAWS = 50
_SOLID = 3  # dimensions
_GJK, _GJK_SHARE = 1e-9, 1e-11  # metres; relative to the path length if it is above 100 m
_ITERATED = ("box", "cylinder", "hull")
_LINE, _LONGER = 1e3, 8.0  # metres at least, path lengths at least: length of the capsule that replaces a line
_INFLATED = ("box",)


@dataclass(frozen=True, eq=False)
class Shape(Value):
    """A convex shape fixed to a link.

    Attributes:
        link: The link.
        kind: ``"sphere"``, ``"box"``, ``"cylinder"``, ``"capsule"``, ``"halfspace"``, ``"hull"`` or ``"mesh"``.
        size: [m], as in `bodies.Body`; for a half-space its height, z up; for a hull the radius around it.
        rotation: (3, 3), from the shape's frame to the link's.
        translation: (3,) [m] in the link's frame.
        vertices: (k, 3) [m], for a hull.
        swept_radius: [m], around a box.
        file: For a mesh; coal's own loader, which is Pinocchio's, reads it.
        scale: (3,) factors for a mesh.
    """

    link: str
    kind: str
    size: tuple[float, ...]
    rotation: Array
    translation: Array
    vertices: Array | None = None
    swept_radius: float = 0.0
    file: str = ""
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)


class Engine:
    """Coal's signed distances of chosen pairs of shapes: negative is the depth of penetration.

    Example:
        >>> import pinbound as pb
        >>> robot = pb.load("minervabot_v3")
        >>> engine = point_engine(robot)
        >>> bool(np.allclose(engine.distances(robot.home[None]), robot.boundaries.clearances(robot.home)))
        True
    """

    def __init__(self, robot: Robot, shapes: Sequence[Shape], pairs: Sequence[tuple[int, int]]) -> None:
        """Fix the shapes to the frames of their links in `robot.model`; pairs are indices in `shapes`."""
        import pinocchio

        self._pin, self._robot = cast(Any, pinocchio), robot
        self.pairs = tuple(pairs)
        self._model = robot.model
        self._data = self._model.createData()
        self._geometry = self._pin.GeometryModel()
        for index, shape in enumerate(shapes):
            # A link and a joint may have the same name; the frame of the link has the type BODY.
            frame_id = self._model.getFrameId(shape.link, self._pin.BODY)
            frame = self._model.frames[frame_id]
            placement = frame.placement * self._pin.SE3(shape.rotation, shape.translation)
            made = self._pin.GeometryObject(str(index), frame.parentJoint, frame_id, placement, _coal_shape(shape))
            self._geometry.addGeometryObject(made)
        for first, second in pairs:
            self._geometry.addCollisionPair(self._pin.CollisionPair(first, second))
        self._geometry_data = self._pin.GeometryData(self._geometry)
        size = max((size_of(boundary) for boundary in robot.boundaries), default=1.0)
        if any(shape.kind in _ITERATED for shape in shapes):
            for request in self._geometry_data.distanceRequests:  # coal's default tolerance is 1e-6 m
                request.gjk_tolerance = max(_GJK, _GJK_SHARE * size)
        _tighten(self._geometry_data)
        self._broad: tuple[Any, Any] | None = None

    def distances(self, Q: Array) -> Array:
        """Return coal's distance (N, pairs) [m] at every row of Q (N, n)."""
        found = np.empty((len(Q), len(self.pairs)))
        results = self._geometry_data.distanceResults
        for row, theta in enumerate(self._robot.coupling.expand(Q)):
            self._pin.computeDistances(self._model, self._data, self._geometry, self._geometry_data, theta)
            found[row] = [result.min_distance for result in results]
        return found

    def distance(self, q: Array, pair: int) -> float:
        """Return coal's distance [m] of one pair at q (n,)."""
        theta = self._robot.coupling.expand(q)
        self._pin.updateGeometryPlacements(self._model, self._data, self._geometry, self._geometry_data, theta)
        return float(self._pin.computeDistance(self._geometry, self._geometry_data, pair).min_distance)

    def collisions(self, Q: Array) -> Flags:
        """Return which pairs are in collision (N, pairs) at every row of Q (N, n), by coal's yes-or-no query.

        Coal's own tree of bounding boxes decides which pairs are tested at all.
        """
        found = np.zeros((len(Q), len(self.pairs)), dtype=np.bool_)
        if not self.pairs:
            return found
        if self._broad is None:
            data = self._pin.GeometryData(self._geometry)
            _tighten(data)
            manager = self._pin.BroadPhaseManager_DynamicAABBTreeCollisionManager(self._model, self._geometry, data)
            self._broad = data, manager
        data, manager = self._broad
        results = data.collisionResults
        for row, theta in enumerate(self._robot.coupling.expand(Q)):
            if self._pin.computeCollisions(self._model, self._data, manager, theta, False):
                found[row] = [result.isCollision() for result in results]
                for place in np.flatnonzero(found[row]).tolist():
                    results[place].clear()  # a pair with separate boxes is not tested, and would keep its old result
        return found

    def collides(self, q: Array, pair: int) -> bool:
        """Return whether one pair is in collision at q (n,), by coal's yes-or-no query."""
        theta = self._robot.coupling.expand(q)
        self._pin.updateGeometryPlacements(self._model, self._data, self._geometry, self._geometry_data, theta)
        return bool(self._pin.computeCollision(self._geometry, self._geometry_data, pair))

    def depth(self, q: Array, pair: int) -> float:
        """Return the largest penetration among the contacts that coal finds for one pair at q (n,) [m]; 0 without.

        For meshes it is a depth of single triangles, so it only shows whether the bodies overlap.
        """
        import coal as coal_untyped

        coal = cast(Any, coal_untyped)
        theta = self._robot.coupling.expand(q)
        self._pin.updateGeometryPlacements(self._model, self._data, self._geometry, self._geometry_data, theta)
        first, second = self.pairs[pair]
        request, result = (
            coal.CollisionRequest(coal.CollisionRequestFlag.CONTACT, _MOST_CONTACTS),
            coal.CollisionResult(),
        )
        bodies = [(self._geometry.geometryObjects[i].geometry, self._geometry_data.oMg[i]) for i in (first, second)]
        placed = [(shape, coal.Transform3s(at.rotation, at.translation)) for shape, at in bodies]
        coal.collide(*placed[0], *placed[1], request, result)
        depths = [abs(float(result.getContact(i).penetration_depth)) for i in range(result.numContacts())]
        return max(depths, default=0.0)

    def poses(self, Q: Array) -> tuple[Array, Array]:
        """Return rotations (N, shapes, 3, 3) and origins (N, shapes, 3) [m] in the world at every row of Q (N, n)."""
        count = len(self._geometry.geometryObjects)
        rotations, origins = np.empty((len(Q), count, 3, 3)), np.empty((len(Q), count, 3))
        for row, theta in enumerate(self._robot.coupling.expand(Q)):
            self._pin.updateGeometryPlacements(self._model, self._data, self._geometry, self._geometry_data, theta)
            for place, placed in enumerate(self._geometry_data.oMg):
                rotations[row, place], origins[row, place] = placed.rotation, placed.translation
        return rotations, origins

    def triangles(self, shape: int) -> tuple[Array, Ints] | None:
        """Return a mesh's corners (k, 3) [m] in its own frame, and its triangles (m, 3), as in coal; else None."""
        body = self._geometry.geometryObjects[shape].geometry
        if not hasattr(body, "tri_indices"):
            return None
        rows = [body.tri_indices(place) for place in range(body.num_tris)]
        corners = np.array(body.vertices(), dtype=np.float64)
        return corners, np.array([(one[0], one[1], one[2]) for one in rows], dtype=np.int64)

    def is_free(self, q: Array) -> bool:
        """Return whether no pair is in collision at q (n,), by coal's yes-or-no query."""
        theta = self._robot.coupling.expand(q)
        return not self._pin.computeCollisions(
            self._model, self._data, self._geometry, self._geometry_data, theta, True
        )


def _tighten(data: Any) -> None:
    """Set coal's collision tolerance to 1e-9 m: at its own 1e-6 m it calls some overlapping shapes separate."""
    for request in data.collisionRequests:
        request.gjk_tolerance = _GJK


def _coal_shape(shape: Shape) -> Any:
    import coal as coal_untyped

    coal = cast(Any, coal_untyped)
    if shape.kind == "hull":
        points = coal.StdVec_Vec3s()
        for vertex in shape.vertices if shape.vertices is not None else ():
            points.append(vertex)
        hull = coal.Convex.convexHull(points, True, "Qt")
        hull.setSweptSphereRadius(shape.size[0])
        return hull
    if shape.kind == "mesh":
        loader = coal.CachedMeshLoader(coal.NODE_TYPE.BV_OBBRSS)
        return loader.load(shape.file, np.array(shape.scale))
    if shape.kind == "halfspace":
        return coal.Halfspace(np.array([0.0, 0.0, 1.0]), shape.size[0])
    makers = {"sphere": coal.Sphere, "box": coal.Box, "cylinder": coal.Cylinder, "capsule": coal.Capsule}
    made = makers[shape.kind](*shape.size)
    if shape.swept_radius:
        made.setSweptSphereRadius(shape.swept_radius)
    return made


def body_shapes(bodies: Sequence[Body]) -> list[Shape]:
    """Return collision bodies as shapes; the caller must have removed meshes."""
    return [Shape(body.link, body.shape, body.size, body.rotation, body.translation) for body in bodies]


def point_engine(robot: Robot) -> Engine:
    """Return the marks as coal's shapes (a sphere of radius 0 is a point), one pair for each boundary, in order.

    The first shape of each pair is larger by the distance to keep, so coal's distance is the clearance.
    """
    return _of_marks(robot, list(robot.boundaries))


def pair_engine(robot: Robot, boundary: Boundary) -> Engine:
    """Return the marks of one boundary alone: then one distance needs the placement of two shapes, not of all."""
    return _of_marks(robot, [boundary])


def _of_marks(robot: Robot, boundaries: Sequence[Boundary]) -> Engine:
    shapes: list[Shape] = []
    for boundary in boundaries:
        shapes += _shapes_of(boundary)
    return Engine(robot, shapes, [(2 * index, 2 * index + 1) for index in range(len(boundaries))])


def _shapes_of(boundary: Boundary) -> tuple[Shape, Shape]:
    size = size_of(boundary)
    return mark_shape(boundary.point_a, boundary.min_distance, size), mark_shape(boundary.point_b, 0.0, size)


def size_of(boundary: Boundary) -> float:
    """Return the length of a boundary's path [m], at least 1, to which roundings and tolerances are proportional."""
    return max(1.0, over_z(boundary).path.minimal.scale)


def is_iterated(boundary: Boundary) -> bool:
    """Return whether coal computes a boundary's distance by iteration: for boxes and hulls, without half-spaces."""
    kinds = {shape.kind for shape in _shapes_of(boundary)}
    return "halfspace" not in kinds and not kinds.isdisjoint(_ITERATED)


def tolerances_of(boundary: Boundary) -> float:
    """Return the allowed difference of coal's distance of a boundary's marks from the clearance [m]."""
    size, shapes = size_of(boundary), _shapes_of(boundary)
    if is_iterated(boundary):
        return CROSSCHECK_SOLID * size
    inflated = max((max(shape.size) for shape in shapes if shape.kind in _INFLATED), default=0.0)
    return CROSSCHECK_POINT * size + CROSSCHECK_INFLATION * inflated


def mark_shape(mark: Mark, more: float, reach: float = 1.0) -> Shape:
    """Return a mark as a shape that is thicker by `more` [m]; a line is a capsule that is longer than `reach` [m]."""
    shape = mark.shape
    first, thick = shape.origin, shape.radius + more
    if len(shape.directions) > 1:
        lengths = np.linalg.norm(shape.directions, axis=1)
        axes = shape.directions.T / lengths
        upright = np.abs(axes.T @ axes - np.eye(len(lengths))).max() < REDUCTION
        if shape.is_zonotope and len(lengths) in (2, 3) and upright:
            return _box(mark.link, shape, axes, lengths, thick)
        if np.linalg.matrix_rank(axes) < _SOLID:
            raise UnsupportedError(
                f"coal has no flat bodies except rectangles, so not {mark.name!r}; mark a body with some thickness"
            )
        return Shape(mark.link, "hull", (thick,), np.eye(3), first, shape.corners @ shape.directions)
    if shape.is_point:
        return Shape(mark.link, "sphere", (thick,), np.eye(3), first)
    along: Array = shape.directions[0] if shape.normal is None else shape.normal
    length = float(np.linalg.norm(along))
    z = along / length
    x = np.cross(z, np.eye(3)[int(np.argmin(np.abs(z)))])
    x /= np.linalg.norm(x)
    rotation: Any = np.column_stack((x, np.cross(z, x), z))
    if shape.measure is Measure.HEIGHT:
        return Shape(mark.link, "halfspace", (more,), rotation, first)
    if shape.measure is Measure.ACROSS:
        return Shape(mark.link, "capsule", (thick, max(_LINE, _LONGER * reach)), rotation, first)
    return Shape(mark.link, "capsule", (thick, length), rotation, first + along / 2)


def _box(link: str, shape: MarkShape, axes: Array, lengths: Array, thick: float) -> Shape:
    """Return a rectangle or box with the radius `thick` around it."""
    third = np.cross(axes[:, 0], axes[:, 1])
    flip = 1.0 if axes.shape[1] == 2 or float(third @ axes[:, 2]) > 0.0 else -1.0
    rotation: Any = np.column_stack((axes[:, 0], axes[:, 1], third))
    size = (float(lengths[0]), float(lengths[1]), float(lengths[2]) if len(lengths) > 2 else 0.0)
    middle = shape.origin + rotation @ (np.array([size[0], size[1], flip * size[2]]) / 2)
    return Shape(link, "box", size, rotation, middle, swept_radius=thick)


def sample(robot: Robot, count: int, rng: np.random.Generator) -> Array:
    """Return random configurations (count, n) within all limits; unlimited angles in +-pi, lengths in +-1 m.

    Limits of mimic joints are kept by rejection; if they reject too many, fewer configurations are returned.

    Raises:
        UnsupportedError: If no configuration satisfies all limits.
    """
    free = np.array([np.pi if robot.turns(name) else _UNLIMITED_SLIDE for name in robot.coordinates])
    lower = np.where(np.isfinite(robot.lower), robot.lower, np.minimum(-free, robot.upper - 2 * free))
    upper = np.where(np.isfinite(robot.upper), robot.upper, np.maximum(free, robot.lower + 2 * free))
    drawn, have = list[Array](), 0
    for _ in range(_MOST_DRAWS):
        Q = rng.uniform(lower, upper, (count, len(lower)))
        drawn.append(Q[within_limits(robot, Q)])
        have += len(drawn[-1])
        if have >= count:
            break
    if not have:
        raise UnsupportedError(
            "no random configuration satisfies the limits of all joints; widen the limits of joints that follow others"
        )
    return np.concatenate(drawn)[:count]


def within_limits(robot: Robot, Q: Array) -> Flags:
    """Return which rows (N,) keep the limits of all tree joints, also of mimic joints."""
    return robot.intervals.hold(Q)


def blocks(count: int) -> Iterator[slice]:
    """Yield slices that divide `count` rows into blocks, to bound memory."""
    edges = [*range(0, count, _BLOCK), count]
    yield from (slice(start, stop) for start, stop in pairwise(edges))
