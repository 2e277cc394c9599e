"""Marks that hold collision bodies: marks of the same shape if there are such marks, or spheres.

The mark of a sphere is a point, of a capsule a segment, and of a box a sweep along its three sides. These have no
excess. A cylinder with spheres over both its ends is a capsule. Any other cylinder lies in the prism of a regular
polygon around it. This prism is a sweep along half of the polygon's sides and the axis. Its flat ends are those of the
cylinder.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pinbound.annotations import Mark, Point, Segment, Sweep
from pinbound.checks import whole_number
from pinbound.coverage.bodies import SHAPES, Body
from pinbound.coverage.body_meshes import MeshSource
from pinbound.coverage.mesh_covers import cover_meshes
from pinbound.coverage.mesh_proof import MeshProof
from pinbound.coverage.parts import Fit
from pinbound.exceptions import DimensionError, UnsupportedError
from pinbound.tolerances import REDUCTION, SAME_BODY
from pinbound.typing import Array

__all__ = ["BY", "MOST_PARTS", "By", "Cover", "Progress", "cover", "covers", "parts_allowed"]

By = Literal["hulls", "capsules", "spheres", "boxes", "bodies"]
"""The shapes of the marks that hold the bodies; ``"bodies"`` is the old name of ``"hulls"``."""
BY: tuple[By, ...] = ("hulls", "capsules", "spheres", "boxes", "bodies")
Progress = Callable[[int, int, str], None]
"""Called with how many links are done, how many there are, and the name of the next."""

MOST_PARTS, MOST_FINE_PARTS = 8, 32
"""The largest number of marks that hold the meshes of one link, by default; the second if the accuracy is below
`FINE`."""
FINE = 0.01
"""[m]. If the accuracy is below this, as many parts as necessary are used, up to `MOST_FINE_PARTS`."""
_MOST_SPHERES = 64
_SIDES = range(2, 9)  # half the number of sides of a polygon around a cylinder


@dataclass(frozen=True)
class Cover:
    """Marks whose union holds one or several bodies of a link.

    Attributes:
        bodies: The bodies.
        marks: The marks.
        excess: [m], no point of a mark is further outside the bodies. For a mesh, no point of the marks' outer surface
            is further from it.
        proof: For a mesh: which mark holds which triangle.
    """

    bodies: tuple[Body, ...]
    marks: tuple[Mark, ...]
    excess: float
    proof: MeshProof | None = None

    @property
    def link(self) -> str:
        """The link of the bodies."""
        return self.bodies[0].link


def covers(
    bodies: Sequence[Body],
    accuracy: float,
    by: By = "hulls",
    meshes: MeshSource | None = None,
    most: int | None = None,
    progress: Progress | None = None,
) -> tuple[Cover, ...]:
    """Return covers of bodies, in their order.

    Args:
        bodies: The bodies, their shapes among `bodies.SHAPES`; meshes, if they can be read.
        accuracy: [m], the excess to aim at.
        by: The marks that hold meshes. Other bodies are held by marks of their own shape: points, capsules, boxes and
            prisms; a cylinder between two spheres is one capsule. With ``"spheres"``, spheres hold all bodies.
        meshes: Reads meshes.
        most: The largest number of marks that hold the meshes of one link; each mesh has at least one. None:
            `parts_allowed`.
        progress: Called for each link that has meshes.

    Raises:
        DimensionError: If the accuracy is not positive.
        UnsupportedError: If no mark holds such a shape.
    """
    found: list[Cover] = []
    taken: set[Body] = set()
    spheres: dict[str, list[Body]] = {}
    for body in bodies:
        if body.shape == "sphere":
            spheres.setdefault(body.link, []).append(body)
    if not accuracy > 0.0:
        raise DimensionError(f"the accuracy {accuracy} is not a positive length; give metres above 0")
    most = whole_number(parts_allowed(accuracy, most), "most", 1)
    if meshes is not None:
        found += _of_meshes([body for body in bodies if body.shape == "mesh"], accuracy, by, meshes, most, progress)
        taken |= {body for body in bodies if body.shape == "mesh"}
    if by != "spheres":
        for body in bodies:
            ends = _end_spheres(body, spheres.get(body.link, ()))
            if ends is not None and not taken & {body, *ends}:
                taken |= {body, *ends}
                excess = _beyond(body, ends)
                mark = _capsule(body, f"{body.link}.{body.index}", excess)
                found.append(Cover((body, *ends), (mark,), excess))
    found += [cover(body, accuracy, by) for body in bodies if body not in taken]
    order = {body: place for place, body in enumerate(bodies)}
    return tuple(sorted(found, key=lambda one: order[one.bodies[0]]))


def parts_allowed(accuracy: float, most: int | None) -> int:
    """Return how many marks may hold the meshes of a link: `most`, or 8, or 32 for an accuracy below 10 mm.

    Example:
        >>> parts_allowed(0.02, None), parts_allowed(0.002, None), parts_allowed(0.002, 5)
        (8, 32, 5)
    """
    if most is not None:
        return most
    return MOST_FINE_PARTS if accuracy < FINE else MOST_PARTS


def _of_meshes(
    bodies: Sequence[Body], accuracy: float, by: By, meshes: MeshSource, most: int, progress: Progress | None
) -> list[Cover]:
    """Return covers of meshes, link by link."""
    links: dict[str, list[Body]] = {}
    for body in bodies:
        links.setdefault(body.link, []).append(body)
    fit: Fit = "hulls" if by == "bodies" else by
    found: list[Cover] = []
    for place, (link, own) in enumerate(links.items()):
        if progress is not None:
            progress(place, len(links), link)
        named = [(f"{link}.{body.index}", link, meshes.of(body)) for body in own]
        made = cover_meshes(named, accuracy, fit, most)
        found += [Cover((body,), one.marks, one.excess, one.proof) for body, one in zip(own, made, strict=True)]
    if progress is not None and links:
        progress(len(links), len(links), "")
    return found


def cover(body: Body, accuracy: float, by: By = "hulls") -> Cover:
    """Return marks whose union holds one body.

    The number of spheres is the smallest that keeps the excess within `accuracy`, at most 64; that of sides, at most
    16.

    Args:
        body: The body, its shape among `bodies.SHAPES`. Measures may be zero: a flat box is a rectangle.
        accuracy: [m], the excess to aim at.
        by: As for `covers`.

    Raises:
        DimensionError: If the accuracy is not positive.
        UnsupportedError: If no mark holds such a shape.

    Example:
        >>> from pinbound.coverage.bodies import Body
        >>> rod = Body("arm", 0, "cylinder", (0.05, 0.4), np.eye(3), np.zeros(3))
        >>> prism = cover(rod, 0.005)
        >>> len(prism.marks[0].ways), round(prism.excess, 5)
        (5, 0.00412)
        >>> len(cover(rod, 0.02, "spheres").marks)
        4
    """
    if not accuracy > 0.0:
        raise DimensionError(f"the accuracy {accuracy} is not a positive length; give metres above 0")
    if body.shape not in SHAPES:
        raise UnsupportedError(f"no mark holds a {body.shape} ({body.name}); give one of: {', '.join(SHAPES)}")
    name = f"{body.link}.{body.index}"
    if body.shape == "sphere":
        return Cover((body,), (_point(body, name, np.zeros(3), body.size[0]),), 0.0)
    if by == "spheres":
        centres, radius, excess = _spheres_over(body.shape, body.size, accuracy)
        names = [name + (f".{index}" if len(centres) > 1 else "") for index in range(len(centres))]
        points = (_point(body, one, centre, radius) for one, centre in zip(names, centres, strict=True))
        return Cover((body,), tuple(points), excess)
    if body.shape == "capsule":
        return Cover((body,), (_capsule(body, name),), 0.0)
    if body.shape == "box":
        return Cover((body,), (_sum_of(body, name, np.diag(body.size)),), 0.0)
    return _prism(body, name, accuracy)


def _point(body: Body, name: str, centre: Array, radius: float) -> Point:
    x, y, z = (body.rotation @ centre + body.translation).tolist()
    return Point(name, body.link, (x, y, z), radius)


def _capsule(body: Body, name: str, excess: float = 0.0) -> Mark:
    """Return a capsule; for a cylinder with a sphere over each end, it is slightly thicker if the spheres are."""
    radius, length = body.size[0] + excess, body.size[1]
    half = body.rotation[:, 2] * (length / 2)
    (a, b, c), (x, y, z) = (body.translation - half).tolist(), (body.translation + half).tolist()
    return Segment(name, body.link, (a, b, c), (x, y, z), radius)


def _sum_of(body: Body, name: str, ways: Array) -> Mark:
    """Return the sum of the segments along the rows of `ways` (k, 3), in the body's frame and about its centre.

    Rows of length zero are left out. The result is a sweep, a segment, or a point.
    """
    ways = ways[np.any(ways, axis=1)]
    corner = (body.translation - body.rotation @ ways.sum(axis=0) / 2).tolist()
    turned: list[tuple[float, float, float]] = [(x, y, z) for x, y, z in (ways @ body.rotation.T).tolist()]
    start = (corner[0], corner[1], corner[2])
    if not turned:
        return Point(name, body.link, start)
    if len(turned) == 1:
        x, y, z = turned[0]
        return Segment(name, body.link, start, (start[0] + x, start[1] + y, start[2] + z))
    return Sweep(name, body.link, start, tuple(turned))


def _prism(body: Body, name: str, accuracy: float) -> Cover:
    """Return the prism of 2 m sides around a cylinder: each side is `2 r tan(pi / 2 m)` long."""
    radius, length = body.size
    m = next((m for m in _SIDES if _sticks_out(radius, m) <= accuracy), _SIDES[-1])
    angles = np.pi * np.arange(m) / m
    side = 2.0 * radius * math.tan(math.pi / (2 * m))
    ways = [*(side * np.column_stack((np.cos(angles), np.sin(angles), np.zeros(m)))), np.array([0.0, 0.0, length])]
    return Cover((body,), (_sum_of(body, name, np.array(ways)),), _sticks_out(radius, m))


def _sticks_out(radius: float, m: int) -> float:
    """Return how far the corners of a regular polygon of 2 m sides are outside its inscribed circle."""
    return radius * (1.0 / math.cos(math.pi / (2 * m)) - 1.0)


def _end_spheres(body: Body, bodies: Iterable[Body]) -> tuple[Body, Body] | None:
    """Return the two spheres over a cylinder's ends, with its link and radius, if they exist."""
    if body.shape != "cylinder":
        return None
    radius, length = body.size
    half = body.rotation[:, 2] * (length / 2)
    found = [
        next((one for one in bodies if one.link == body.link and _is_sphere(one, body.translation + end, radius)), None)
        for end in (half, -half)
    ]
    return (found[0], found[1]) if found[0] is not None and found[1] is not None and found[0] != found[1] else None


def _beyond(body: Body, ends: tuple[Body, Body]) -> float:
    """Return how far the spheres stick out of a capsule with the cylinder's radius [m]: at most `SAME_BODY`, twice."""
    radius, length = body.size
    half = body.rotation[:, 2] * (length / 2)
    out = [
        float(np.linalg.norm(one.translation - body.translation - end)) + one.size[0] - radius
        for one, end in zip(ends, (half, -half), strict=True)
    ]
    return max(out) if max(out) > REDUCTION else 0.0


def _is_sphere(body: Body, centre: Array, radius: float) -> bool:
    if body.shape != "sphere":
        return False
    return float(np.linalg.norm(body.translation - centre)) <= SAME_BODY and abs(body.size[0] - radius) <= SAME_BODY


def _spheres_over(shape: str, size: tuple[float, ...], accuracy: float) -> tuple[Array, float, float]:
    if shape == "sphere":
        return np.zeros((1, 3)), size[0], 0.0
    if shape == "capsule":
        return _along(size[0], size[1], accuracy)
    if shape == "cylinder":
        return _slices(size[0], size[1], accuracy)
    if shape == "box":
        return _cells(np.asarray(size, dtype=np.float64), accuracy)
    return np.empty((0, 3)), 0.0, 0.0


def _along(radius: float, length: float, accuracy: float) -> tuple[Array, float, float]:
    """Cover a capsule: spheres from one end of its segment to the other; those at both ends hold the caps."""
    best: tuple[float, int] = (length / 2, 1)
    for count in range(2, _MOST_SPHERES + 1):
        if best[0] <= accuracy:
            break
        excess = math.hypot(radius, length / (2 * (count - 1))) - radius
        best = min(best, (excess, count))
    excess, count = best
    heights = [length * (index / (count - 1) - 0.5) for index in range(count)] if count > 1 else [0.0]
    return _on_axis(heights), radius + excess, excess


def _slices(radius: float, length: float, accuracy: float) -> tuple[Array, float, float]:
    """Cover a cylinder: a sphere about the middle of each slice, through the edge circles of the slice."""
    options: list[tuple[float, int]] = []
    for count in range(1, _MOST_SPHERES + 1):
        half = length / (2 * count)
        options.append((math.hypot(radius, half) - min(radius, half), count))
        if options[-1][0] <= accuracy:
            break
    excess, count = min(options)
    half = length / (2 * count)
    heights = [half * (2 * index + 1) - length / 2 for index in range(count)]
    return _on_axis(heights), math.hypot(radius, half), excess


def _on_axis(heights: list[float]) -> Array:
    return np.array([(0.0, 0.0, height) for height in heights])


def _cells(size: Array, accuracy: float) -> tuple[Array, float, float]:
    """Cover a box by spheres about cells of nearly equal sides, halved until the excess is small enough."""
    found: tuple[Array, float, float] | None = None
    longest = float(np.max(size))
    if longest == 0.0:
        return np.zeros((1, 3)), 0.0, 0.0
    for step in range(1, _MOST_SPHERES + 1):
        counts = np.maximum(1, np.ceil(size / (longest / step) - 1e-9)).astype(int)
        if found is not None and int(np.prod(counts)) > _MOST_SPHERES:
            break
        half = size / (2 * counts)
        around = float(np.linalg.norm(half))
        excess = around - float(np.min(half))
        if found is None or excess < found[2]:
            cells = np.indices(tuple(counts.tolist())).reshape(3, -1).T
            centres = half * (2.0 * cells + 1.0) - size / 2
            found = (centres, around, excess)
        if excess <= accuracy:
            break
    assert found is not None
    return found
