"""The positions that a link's origin reaches over a region, as outlines to fill; with loops, a union of small cells."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, cast

import numpy as np
import shapely

from pinbound.exceptions import UnsupportedError
from pinbound.figures.names import resampled
from pinbound.region import Edge, Region
from pinbound.region.workspace import workspace_section
from pinbound.robot.loop_robot import LoopRobot
from pinbound.robot.robot import Robot
from pinbound.typing import Array

__all__ = ["WorkspaceImage", "edge_image", "section_axes", "workspace_image"]

gis = cast(Any, shapely)  # its type stubs lack some of the accepted arguments

_EDGE_SAMPLES = 200
_CHORD = 5e-4  # metres: largest error of a computed image, less than the width of a line
_CELLS = 96  # number of cells along each side of a region
_CHORDS = 8  # number of chords along each side of a cell
_FLAT = 1e-6  # metres: points this near to a plane count as in the plane
_LEAST = 1e-6  # square metres: smaller areas are not visible


@dataclass(frozen=True, eq=False)
class WorkspaceImage:
    """The image of a region under the forward kinematics of a link's origin.

    Attributes:
        plane: The two world axes that are drawn.
        edges: The image (k, 3) of each edge [m].
        rings: The outline and the holes of each part of the image, (k, 2) [mm]; none if the link does not move in a
            plane, or moves along a curve.
        is_sampled: Whether the image is a union of small cells.
    """

    plane: tuple[int, int]
    edges: tuple[Array, ...]
    rings: tuple[tuple[Array, ...], ...]
    is_sampled: bool


def section_axes(points: Array) -> tuple[int, int]:
    """Return the two world axes in which points (N, 3) spread most, in x, y, z order: the plane to draw.

    Example:
        >>> section_axes(np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 2.0]]))
        (0, 2)
    """
    flattest = int(np.argmin(np.ptp(points, axis=0)))
    kept = [axis for axis in range(3) if axis != flattest]
    return kept[0], kept[1]


def workspace_image(robot: Robot, region: Region, frame: str) -> WorkspaceImage:
    """Return the positions that the origin of a link reaches over a region.

    With loops that are not parallelograms, the region is divided into cells, and the borders of the cells are mapped.
    """
    edges = tuple(edge_image(robot, region, edge, frame) for edge in region.edges)
    plane = section_axes(np.concatenate(edges))
    is_sampled = isinstance(robot, LoopRobot)
    shape = _cells(robot, region, frame, plane) if is_sampled else _computed(robot, region, frame, plane)
    parts = [one for one in getattr(shape, "geoms", [shape]) if one is not None and one.area > 1e6 * _LEAST]
    rings = tuple(tuple(np.array(ring.coords) for ring in (one.exterior, *one.interiors)) for one in parts)
    return WorkspaceImage(plane, edges, rings, is_sampled)


def edge_image(robot: Robot, region: Region, edge: Edge, frame: str) -> Array:
    """Return the positions (k, 3) of a link's origin along one edge [m]."""
    return _mapped(robot, region, frame, resampled(edge.points, np.linspace(0.0, 1.0, _EDGE_SAMPLES)))


def _mapped(robot: Robot, region: Region, frame: str, X: Array) -> Array:
    Q = np.repeat(region.at[None], len(X), axis=0)
    Q[:, [region.robot_coordinates.index(name) for name in region.coordinates]] = X
    return robot.positions(frame, Q)


def _computed(robot: Robot, region: Region, frame: str, plane: tuple[int, int]) -> Any:
    """Return the image in the drawn axes [mm]; None if the link does not move in a plane."""
    try:
        section = workspace_section(robot, region, frame)
    except UnsupportedError:
        return None
    samples = np.concatenate([edge.points for edge in region.edges])
    flat = np.column_stack((section.image(samples), np.ones(len(samples))))
    to_axes, *_ = np.linalg.lstsq(flat, 1e3 * section.points(samples)[:, list(plane)], rcond=None)

    def moved(uv: Array) -> Array:
        found: Array = np.column_stack((uv, np.ones(len(uv)))) @ to_axes
        return found

    return gis.transform(section.polygon(_CHORD), moved)


def _cells(robot: Robot, region: Region, frame: str, plane: tuple[int, int]) -> Any:
    """Return the union of the images of small cells [mm]; None if they are not in a plane of two world axes."""
    whole = region.polygon
    low, high = np.array(whole.bounds).reshape(2, 2)
    x, y = np.linspace(low, high, _CELLS + 1).T
    i, j = (part.ravel() for part in np.meshgrid(np.arange(_CELLS), np.arange(_CELLS), indexing="ij"))
    pieces = gis.intersection(gis.box(x[i], y[j], x[i + 1], y[j + 1]), whole)
    pieces = gis.get_parts(pieces[~gis.is_empty(pieces)])
    pieces = pieces[gis.area(pieces) > 0.0]
    sizes = (high - low) / (_CELLS * _CHORDS)
    scaled = gis.set_coordinates(pieces, gis.get_coordinates(pieces) / sizes)  # equal chords along both coordinates
    places = gis.segmentize(scaled, 1.0)
    points = _mapped(robot, region, frame, gis.get_coordinates(places) * sizes)
    (across,) = {0, 1, 2} - set(plane)
    if np.ptp(points[:, across]) > _FLAT:
        return None
    drawn = gis.make_valid(gis.set_coordinates(places, 1e3 * points[:, list(plane)]))
    parts = gis.get_parts(gis.get_parts(drawn))
    return gis.union_all(parts[gis.get_dimensions(parts) == 2])
