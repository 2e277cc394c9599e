"""Marks on links: points, segments, sweeps, hulls, boxes, cylinders, lines and planes.

A segment is all points `x = xyz_a + t (xyz_b - xyz_a)`, t in [0, 1]; with a radius it is a capsule. A sweep is all
points `x = xyz + sum_i t_i way_i`: two edge vectors make a parallelogram, three a parallelepiped, more a prism. A hull
is the convex hull of its vertices. A box and a cylinder are given by their sizes. A line and a plane are unbounded:
only the distance perpendicular to the line, or along the plane's normal, counts. Every mark has one `shape`. Code
outside this room uses only this shape.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from pinbound.annotations.shapes import Measure, Shape, hull, unbounded, zonotope
from pinbound.geometry.rotations import rpy_matrix
from pinbound.values import Value

__all__ = [
    "CYLINDER_SIDES",
    "Box",
    "Cylinder",
    "FlatMark",
    "Hull",
    "Line",
    "Mark",
    "Plane",
    "Point",
    "Segment",
    "Sweep",
    "Vector",
]

Vector = tuple[float, float, float]

CYLINDER_SIDES = 24
"""Sides of the prism around a cylinder. Its edges stick out by 1 / cos(pi / 24) - 1 = 0.86 % of the radius."""


@dataclass(frozen=True)
class Point(Value):
    """A marked point: `xyz` [m] in the frame of `link`, the centre of a sphere of `radius` [m].

    Attributes:
        name: Its name, unique among the marks of the robot.
        link: The link that it is fixed to.
        xyz: (3,) [m] in the frame of the link.
        radius: [m], the radius of the sphere; 0: the point alone.

    Example:
        >>> Point("tip", "hand", (0.0, 0.0, 0.1), radius=0.02).shape.radius
        0.02
    """

    name: str
    link: str
    xyz: Vector
    radius: float = 0.0
    line: int | None = None

    @property
    def ways(self) -> tuple[Vector, ...]:
        """A point has no edge vectors."""
        return ()

    @property
    def anchors(self) -> tuple[Vector, ...]:
        """Points of the link that fix the position of the mark [m]."""
        return (self.xyz,)

    @cached_property
    def shape(self) -> Shape:
        """The shape: one vertex."""
        return zonotope(self.xyz, (), self.radius)


@dataclass(frozen=True)
class Segment(Value):
    """A marked segment from `xyz_a` to `xyz_b` [m] in the frame of `link`: with a `radius` [m] a capsule.

    Attributes:
        name: Its name, unique among the marks of the robot.
        link: The link that it is fixed to.
        xyz_a: (3,) its first end [m] in the frame of the link.
        xyz_b: (3,) its second end [m].
        radius: [m] around it.

    Example:
        >>> Segment("forearm", "link_3", (0.0, 0.0, 0.0), (0.3, 0.0, 0.0), radius=0.03).ways
        ((0.3, 0.0, 0.0),)
    """

    name: str
    link: str
    xyz_a: Vector
    xyz_b: Vector
    radius: float = 0.0
    line: int | None = None

    @property
    def xyz(self) -> Vector:
        """Its first end [m]."""
        return self.xyz_a

    @property
    def ways(self) -> tuple[Vector, ...]:
        """The edge vector from its first end to its second [m]; none, if it has no length."""
        (x, y, z), (u, v, w) = self.xyz_a, self.xyz_b
        return ((u - x, v - y, w - z),) if self.xyz_a != self.xyz_b else ()

    @property
    def anchors(self) -> tuple[Vector, ...]:
        """Its ends [m]; one, if it has no length."""
        return (self.xyz_a, self.xyz_b) if self.ways else (self.xyz_a,)

    @cached_property
    def shape(self) -> Shape:
        """The shape: two vertices; one, if the segment has no length."""
        return zonotope(self.xyz, self.ways, self.radius)


@dataclass(frozen=True)
class Sweep(Value):
    """A marked body: all `xyz + sum_i t_i way_i`, t_i in [0, 1] [m] in the frame of `link`, `radius` [m] around it.

    One edge vector makes a segment, two a parallelogram, three a parallelepiped. Several edge vectors in one plane and
    one out of it make a prism. In code and files, edge vectors are called `ways`.

    Attributes:
        name: Its name, unique among the marks of the robot.
        link: The link that it is fixed to.
        xyz: (3,) its corner [m] in the frame of the link.
        ways: (k, 3) its edge vectors [m].
        radius: [m] around it.

    Example:
        >>> Sweep("plate", "base", (0.0, 0.0, 0.0), ((0.3, 0.0, 0.0), (0.0, 0.2, 0.0))).shape.vertices.shape
        (4, 3)
    """

    name: str
    link: str
    xyz: Vector
    ways: tuple[Vector, ...]
    radius: float = 0.0
    line: int | None = None

    @property
    def anchors(self) -> tuple[Vector, ...]:
        """Its corner, and the ends of its edge vectors from there [m]."""
        return (self.xyz, *(_moved(self.xyz, way) for way in self.ways))

    @cached_property
    def shape(self) -> Shape:
        """The shape: the corners, at which each t is 0 or 1."""
        return zonotope(self.xyz, self.ways, self.radius)


@dataclass(frozen=True)
class Line(Value):
    """A marked unbounded line: through `xyz` [m] along `direction`, in the frame of `link`, `radius` [m] around it.

    A boundary measures the distance from the line.

    Attributes:
        name: Its name, unique among the marks of the robot.
        link: The link that it is fixed to.
        xyz: (3,) a point of it [m] in the frame of the link.
        direction: (3,) along the line, of any length except zero.
        radius: [m] around it.

    Example:
        >>> Line("pole", "base", (0.0, 0.0, 0.0), (0.0, 0.0, 2.0)).upright
        (0.0, 0.0, 1.0)
    """

    name: str
    link: str
    xyz: Vector
    direction: Vector
    radius: float = 0.0
    line: int | None = None

    @property
    def ways(self) -> tuple[Vector, ...]:
        """A shape without ends has no edge vectors."""
        return ()

    @property
    def upright(self) -> Vector:
        """The unit vector along it."""
        return _unit(self.direction)

    @property
    def anchors(self) -> tuple[Vector, ...]:
        """The point `xyz`, and the point 1 m further along the line [m]."""
        return (self.xyz, _moved(self.xyz, self.upright))

    @cached_property
    def shape(self) -> Shape:
        """The shape: unbounded, measured perpendicular to the line."""
        return unbounded(Measure.ACROSS, self.xyz, self.direction, self.radius)


@dataclass(frozen=True)
class Plane(Value):
    """A marked plane: through `xyz` [m] with its `normal` towards the free side, in the frame of `link`.

    A boundary measures the signed height, which is negative behind the plane. In a planar mechanism, use a plane for an
    edge with a free side: the plane contains the edge and the direction of the joint axes.

    Attributes:
        name: Its name, unique among the marks of the robot.
        link: The link that it is fixed to.
        xyz: (3,) a point of it [m] in the frame of the link.
        normal: (3,) towards the free side, of any length except zero.

    Example:
        >>> Plane("floor", "base", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)).upright
        (0.0, 0.0, 1.0)
    """

    name: str
    link: str
    xyz: Vector
    normal: Vector
    line: int | None = None

    @property
    def radius(self) -> float:
        """A plane has no thickness: 0 [m]."""
        return 0.0

    @property
    def ways(self) -> tuple[Vector, ...]:
        """A shape without ends has no edge vectors."""
        return ()

    @property
    def upright(self) -> Vector:
        """The unit normal."""
        return _unit(self.normal)

    @property
    def anchors(self) -> tuple[Vector, ...]:
        """The point `xyz`, and the point 1 m above it along the normal [m]."""
        return (self.xyz, _moved(self.xyz, self.upright))

    @cached_property
    def shape(self) -> Shape:
        """The shape: unbounded, measured by the height above the plane."""
        return unbounded(Measure.HEIGHT, self.xyz, self.normal)


@dataclass(frozen=True)
class Hull(Value):
    """A marked convex hull of `vertices` (k, 3) [m] in the frame of `link`, with `radius` [m] around it.

    Attributes:
        name: Its name, unique among the marks of the robot.
        link: The link that it is fixed to.
        vertices: (k, 3) [m] in the frame of the link, in any order; inner vertices are ignored.
        radius: [m] around it.

    Example:
        >>> corner = Hull("corner", "arm", ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (0.1, 0.1, 0.1)))
        >>> len(corner.vertices), len(corner.shape.vertices)
        (5, 4)
    """

    name: str
    link: str
    vertices: tuple[Vector, ...]
    radius: float = 0.0
    line: int | None = None

    def __post_init__(self) -> None:
        """Convert the vertices, given as any sequence or array, to tuples of numbers."""
        object.__setattr__(self, "vertices", tuple((float(x), float(y), float(z)) for x, y, z in self.vertices))
        Value.__post_init__(self)

    @classmethod
    def of_mesh(
        cls,
        name: str,
        link: str,
        mesh: str | Path,
        scale: Vector = (1.0, 1.0, 1.0),
        xyz: Vector = (0.0, 0.0, 0.0),
        rpy: Vector = (0.0, 0.0, 0.0),
        radius: float = 0.0,
        package_dirs: Sequence[str | Path] = (),
    ) -> Hull:
        r"""Return the convex hull of a mesh file, in the frame of the link; the file is read now.

        Each vertex v of the file becomes `R(rpy) (scale * v) + xyz`. Files are those of `docs/meshes.md`.

        Args:
            name: Name of the mark.
            link: Its link.
            mesh: A path, or a name as a URDF has it: ``"package://arm/meshes/tip.stl"``.
            scale: Factors along x, y and z; a negative factor mirrors.
            xyz: (3,) position of the mesh's origin [m].
            rpy: (3,) roll, pitch, yaw of the mesh [rad], as in a URDF's `<origin>`.
            radius: [m] around the hull.
            package_dirs: Folders of packages, for `package://`.

        Raises:
            InputError: If the file does not exist, is damaged, or is too large.

        Example:
            >>> import tempfile
            >>> file = Path(tempfile.mkdtemp()) / "tip.obj"
            >>> _ = file.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0.2 0.2 0\nf 1 2 3\nf 1 2 4\n")
            >>> Hull.of_mesh("tip", "hand", file, scale=(0.5, 1.0, 1.0), xyz=(0.0, 0.0, 2.0)).vertices
            ((0.0, 0.0, 2.0), (0.5, 0.0, 2.0), (0.0, 1.0, 2.0))
        """
        from pinbound.annotations.mesh_hulls import HullFiles

        found = HullFiles(package_dirs=package_dirs).vertices(str(mesh), scale, xyz, rpy)
        return cls(name, link, tuple(map(tuple, found.tolist())), radius)

    @cached_property
    def shape(self) -> Shape:
        """The shape: its extreme vertices."""
        return hull(self.vertices, self.radius)


@dataclass(frozen=True)
class Box(Value):
    """A marked box: `size` [m] along the axes of its own frame. The origin of this frame, the centre, is at `xyz` [m].

    The frame is rotated by `rpy` [rad]: roll, pitch, yaw as in a URDF's origin. A size of zero makes the box flat.

    Attributes:
        name: Its name, unique among the marks of the robot.
        link: The link that it is fixed to.
        xyz: (3,) its centre [m] in the frame of the link.
        rpy: (3,) roll, pitch, yaw of its frame [rad].
        size: (3,) lengths of its edges [m].
        radius: [m] around it.

    Example:
        >>> Box("b", "arm", (0.0, 0.0, 1.0), (0.0, 0.0, 0.0), (2.0, 4.0, 6.0)).shape.vertices[[0, -1]].tolist()
        [[-1.0, -2.0, -2.0], [1.0, 2.0, 4.0]]
    """

    name: str
    link: str
    xyz: Vector
    rpy: Vector
    size: Vector
    radius: float = 0.0
    line: int | None = None

    @cached_property
    def shape(self) -> Shape:
        """The shape: its eight corners."""
        axes = rpy_matrix(self.rpy).T.tolist()
        edges = [_scaled(axis, length) for axis, length in zip(axes, self.size, strict=True) if length]
        corner = self.xyz
        for edge in edges:
            corner = _moved(corner, _scaled(edge, -0.5))
        return zonotope(corner, edges, self.radius)


@dataclass(frozen=True)
class Cylinder(Value):
    """A marked cylinder with flat ends: its axis leads from `xyz_a` to `xyz_b` [m] in the frame of `link`.

    A prism of 24 sides around it stands for it. The edges of the prism stick out by `excess`; `robot.notes` says so.

    Attributes:
        name: Its name, unique among the marks of the robot.
        link: The link that it is fixed to.
        xyz_a: (3,) one end of its axis [m] in the frame of the link.
        xyz_b: (3,) the other end [m].
        radius: [m].

    Example:
        >>> motor = Cylinder("motor", "base", (0.0, -0.03, 0.0), (0.0, 0.03, 0.0), 0.025)
        >>> f"{1e3 * motor.excess:.3f} mm"
        '0.216 mm'
    """

    name: str
    link: str
    xyz_a: Vector
    xyz_b: Vector
    radius: float
    line: int | None = None

    @property
    def excess(self) -> float:
        """How far the edges of the prism stick out of the cylinder [m]."""
        return self.radius * (1.0 / math.cos(math.pi / CYLINDER_SIDES) - 1.0)

    @cached_property
    def shape(self) -> Shape:
        """The shape: the corners of the prism around the cylinder."""
        (x, y, z), (u, v, w) = self.xyz_a, self.xyz_b
        axis = _unit((u - x, v - y, w - z))
        across = _unit(_cross(axis, _LEAST[min(range(3), key=lambda i: abs(axis[i]))]))
        other, rim = _cross(axis, across), self.radius / math.cos(math.pi / CYLINDER_SIDES)
        turns = [2.0 * math.pi * side / CYLINDER_SIDES for side in range(CYLINDER_SIDES)]
        spokes = [_moved(_scaled(across, rim * math.cos(turn)), _scaled(other, rim * math.sin(turn))) for turn in turns]
        prism = hull([_moved(end, spoke) for end in (self.xyz_a, self.xyz_b) for spoke in spokes])
        return replace(prism, excess=self.excess)


Mark = Point | Segment | Sweep | Hull | Box | Cylinder | Line | Plane
FlatMark = Line | Plane
"""Unbounded marks; at most one of the two marks of a boundary may be unbounded."""


def _unit(vector: Vector) -> Vector:
    length = math.hypot(*vector)
    return vector[0] / length, vector[1] / length, vector[2] / length


def _moved(xyz: Vector, by: Vector) -> Vector:
    return xyz[0] + by[0], xyz[1] + by[1], xyz[2] + by[2]


def _scaled(vector: Vector, by: float) -> Vector:
    return vector[0] * by, vector[1] * by, vector[2] * by


def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


_LEAST: tuple[Vector, Vector, Vector] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
