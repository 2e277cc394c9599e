"""What can be marked on a link: points, segments, swept bodies, lines and planes, and what the path needs of them.

A segment is a point that slides along its link, `x = xyz_a + t (xyz_b - xyz_a)`, t in [0, 1]; with a radius it is a
capsule. A sweep slides along several ways, `x = xyz + sum_i t_i way_i`: two make a rectangle, three a box, more a
prism. A line and a plane have no end, so that only what lies across the line, or along the plane's normal, counts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

__all__ = ["FlatMark", "Line", "Mark", "Plane", "Point", "Segment", "Sweep", "Vector"]

Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Point:
    """A marked point: `xyz` [m] in the frame of `link`, the centre of a sphere of `radius` [m]."""

    name: str
    link: str
    xyz: Vector
    radius: float = 0.0
    line: int | None = None

    @property
    def ways(self) -> tuple[Vector, ...]:
        """A point slides nowhere."""
        return ()

    @property
    def anchors(self) -> tuple[Vector, ...]:
        """Points of the link that say where the mark is [m]."""
        return (self.xyz,)


@dataclass(frozen=True, slots=True)
class Segment:
    """A marked segment from `xyz_a` to `xyz_b` [m] in the frame of `link`: with a `radius` [m] a capsule."""

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
        """From its first end to its second [m]; none, if it has no length."""
        (x, y, z), (u, v, w) = self.xyz_a, self.xyz_b
        return ((u - x, v - y, w - z),) if self.xyz_a != self.xyz_b else ()

    @property
    def anchors(self) -> tuple[Vector, ...]:
        """Its ends [m]; one, if it has no length."""
        return (self.xyz_a, self.xyz_b) if self.ways else (self.xyz_a,)


@dataclass(frozen=True, slots=True)
class Sweep:
    """A marked body: all `xyz + sum_i t_i way_i`, t_i in [0, 1] [m] in the frame of `link`, `radius` [m] around it.

    One way is a segment, two make a parallelogram, three a box; ways in a plane and one out of it make a prism.
    """

    name: str
    link: str
    xyz: Vector
    ways: tuple[Vector, ...]
    radius: float = 0.0
    line: int | None = None

    @property
    def anchors(self) -> tuple[Vector, ...]:
        """Its corner, and the ends of its ways from there [m]."""
        return (self.xyz, *(_moved(self.xyz, way) for way in self.ways))


@dataclass(frozen=True, slots=True)
class Line:
    """A marked line without ends: through `xyz` [m] along `direction`, in the frame of `link`, `radius` [m] thick.

    What is measured against it is the distance across it.
    """

    name: str
    link: str
    xyz: Vector
    direction: Vector
    radius: float = 0.0
    line: int | None = None

    @property
    def ways(self) -> tuple[Vector, ...]:
        """What has no end has no ways from end to end."""
        return ()

    @property
    def upright(self) -> Vector:
        """The unit vector along it."""
        return _unit(self.direction)

    @property
    def anchors(self) -> tuple[Vector, ...]:
        """The point that it goes through, and the one 1 m further [m]."""
        return (self.xyz, _moved(self.xyz, self.upright))


@dataclass(frozen=True, slots=True)
class Plane:
    """A marked plane: through `xyz` [m] with its `normal` towards the free side, in the frame of `link`.

    What is measured against it is the signed height: negative behind the plane. In a planar mechanism it is an edge
    with a side: the plane that holds the edge and the joints' direction.
    """

    name: str
    link: str
    xyz: Vector
    normal: Vector
    line: int | None = None

    @property
    def radius(self) -> float:
        """A plane has no thickness."""
        return 0.0

    @property
    def ways(self) -> tuple[Vector, ...]:
        """What has no end has no ways from end to end."""
        return ()

    @property
    def upright(self) -> Vector:
        """The unit normal."""
        return _unit(self.normal)

    @property
    def anchors(self) -> tuple[Vector, ...]:
        """The point that it goes through, and the one 1 m above it [m]."""
        return (self.xyz, _moved(self.xyz, self.upright))


Mark = Point | Segment | Sweep | Line | Plane
FlatMark = Line | Plane
"""Marks without ends; of the two marks of a boundary one at most may be such."""


def _unit(vector: Vector) -> Vector:
    length = math.hypot(*vector)
    return vector[0] / length, vector[1] / length, vector[2] / length


def _moved(xyz: Vector, by: Vector) -> Vector:
    return xyz[0] + by[0], xyz[1] + by[1], xyz[2] + by[2]
