"""Free volumes and projections as pictures: what is proven free, what is proven not to be, and what is not decided."""

from __future__ import annotations

from typing import Any, cast

import numpy as np

from pinbound import units
from pinbound.exceptions import UnsupportedError
from pinbound.figures.plots import without_math
from pinbound.freespace import FreeProjection, FreeVolume
from pinbound.robot.robot import Robot
from pinbound.typing import Array, Flags

__all__ = ["draw_free"]

_FREE, _OPEN, _CONTACT = "#BFE3C9", "#E69F00", "#8A8A8A"
_VOXELS = 36  # along each of three coordinates
_AT_ONCE = 4096


def draw_free(robot: Robot, found: FreeVolume | FreeProjection) -> Any:
    """Draw a slice (two coordinates), a projection, or a volume (three coordinates); return the Matplotlib figure.

    Green is proven free, grey proven not to be, orange not decided. Of three coordinates what is *not* proven free is
    drawn, as voxels whose middle lies in no free box: orange where it lies in an open one. Angles are in
    degrees, lengths in mm.

    Args:
        robot: The robot.
        found: What `free_volume` or `free_projection` returned.

    Raises:
        UnsupportedError: If the volume has four coordinates.
    """
    from matplotlib.figure import Figure

    names = found.coordinates
    if len(names) > 3:
        raise UnsupportedError(f"a picture shows two or three coordinates, and here are {len(names)}; hold some")
    kinds = ["rad" if robot.turns(name) else "m" for name in names]
    scale = units.factors(kinds)
    labels = [f"{name} [{unit}]" for name, unit in zip(names, units.names(kinds), strict=True)]
    figure = Figure(figsize=(6.4, 5.4), layout="constrained")
    share = f"{100.0 * found.decided:.1f} % of the box decided"
    if len(names) == 2:
        axes = cast(Any, figure).add_subplot()
        _plane(axes, found, scale)
        what = "some value of the others is free" if isinstance(found, FreeProjection) else "free"
        axes.set_title(f"green: {what}; grey: not; orange: not decided\n{share}", fontsize=9)
    else:
        axes = cast(Any, figure).add_subplot(projection="3d")
        assert isinstance(found, FreeVolume)
        _voxels(axes, found, scale)
        axes.set_zlabel(labels[2])
        axes.set_title(f"grey: not free; orange: not decided; all else is free\n{share}", fontsize=9)
    axes.set_xlabel(labels[0])
    axes.set_ylabel(labels[1])
    return without_math(figure)


def _plane(axes: Any, found: FreeVolume | FreeProjection, scale: Array) -> None:
    from matplotlib.collections import PolyCollection

    low, high = found.box * scale
    axes.add_patch(_rectangle(low, high))
    free = found.inside if isinstance(found, FreeProjection) else found.free
    for boxes, colour in ((free, _FREE), (found.open, _OPEN)):
        ends = boxes * scale
        x, y = ends[:, [0, 1, 1, 0], 0], ends[:, [0, 0, 1, 1], 1]
        corners = np.stack([x, y], axis=2)
        axes.add_collection(PolyCollection(cast(Any, corners), facecolor=colour, edgecolor=colour, linewidth=0.2))
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])


def _rectangle(low: Array, high: Array) -> Any:
    from matplotlib.patches import Rectangle

    width, height = (high - low).tolist()
    return Rectangle((float(low[0]), float(low[1])), width, height, facecolor=_CONTACT, edgecolor="none")


def _voxels(axes: Any, found: FreeVolume, scale: Array) -> None:
    ends: list[tuple[float, float]] = found.box.T.tolist()
    steps: list[Array] = [np.linspace(first, last, _VOXELS + 1) for first, last in ends]
    middles: list[Array] = [0.5 * (one[1:] + one[:-1]) for one in steps]
    points: Array = np.stack(np.meshgrid(*middles, indexing="ij"), axis=-1).reshape(-1, 3)
    shape = (_VOXELS,) * 3
    is_open = _in(found.open, points).reshape(shape)
    is_blocked = ~_in(found.free, points).reshape(shape)
    colours = np.where(is_open, _OPEN, _CONTACT)
    scaled: list[Array] = [one * factor for one, factor in zip(steps, scale, strict=True)]
    corners = np.meshgrid(*scaled, indexing="ij")
    axes.voxels(*corners, is_blocked, facecolors=colours, edgecolor="#FFFFFF", linewidth=0.1)
    shown = (found.box * scale).T
    axes.set(xlim=shown[0], ylim=shown[1], zlim=shown[2])


def _in(boxes: Array, points: Array) -> Flags:
    """Return which points (N, 3) lie in one of the boxes."""
    found: Flags = np.zeros(len(points), dtype=np.bool_)
    for start in range(0, len(boxes), _AT_ONCE):
        some = boxes[start : start + _AT_ONCE]
        for row in np.flatnonzero(~found):
            x = points[row]
            found[row] = bool(np.any(np.all((some[:, 0] <= x) & (x <= some[:, 1]), axis=1)))
    return found
