"""Free volumes and projections as pictures: what is proven free, proven not free, and undecided."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from textwrap import fill
from typing import Any, cast

import numpy as np

from pinbound import units
from pinbound.exceptions import UnsupportedError
from pinbound.extras import Needs
from pinbound.figures.canvas import without_math
from pinbound.freespace import FreeProjection, FreeVolume
from pinbound.robot.robot import Robot
from pinbound.typing import Array, Flags, Indices

__all__ = ["draw_free"]

_FREE, _OPEN, _CONTACT = "#BFE3C9", "#E69F00", "#8A8A8A"
_VOXELS = 36  # along each of three coordinates
_SEEN_THROUGH = 0.35  # opacity of voxels, so that those behind the outer ones are visible
_LINE = 82  # characters of a line about what the boundaries watch and what they do not
_NAMED = 3  # fixed coordinates in one line of the title


def draw_free(robot: Robot, found: FreeVolume | FreeProjection) -> Any:
    """Draw a slice (two coordinates), a projection, or a volume (three coordinates); return the Matplotlib figure.

    Green is proven free, grey is proven not free, orange is undecided. For three coordinates, the part that is *not*
    proven free is drawn, as voxels whose middle is in no free box; they are orange if it is in an undecided box. The
    title has the values of the other coordinates, the decided share of the box, and the pairs that the boundaries do
    not watch. Angles are in degrees, lengths in mm.

    Args:
        robot: The robot.
        found: The result of `free_volume` or `free_projection`.

    Raises:
        UnsupportedError: If the volume has four coordinates.
    """
    with Needs("plots", "a figure"):
        from matplotlib.figure import Figure

    names = found.coordinates
    if len(names) > 3:
        raise UnsupportedError(f"a picture shows two or three coordinates, and here are {len(names)}; hold some")
    kinds = ["rad" if robot.turns(name) else "m" for name in names]
    scale = units.factors(kinds)
    labels = [f"{name} [{unit}]" for name, unit in zip(names, units.names(kinds), strict=True)]
    figure = Figure(figsize=(6.4, 5.8), layout="constrained")
    if isinstance(found, FreeProjection):
        meanings = ("free for some value of the others", "free for no value", "not decided")
        title = "Projection: free for some value of the other coordinates, proven in and out"
    else:
        meanings = ("free", "not free", "not decided")
        title = _held(robot, found)
    if len(names) == 2:
        axes = cast(Any, figure).add_subplot()
        _plane(axes, found, scale)
        _legend(figure, zip(meanings, (_FREE, _CONTACT, _OPEN), strict=True))
    else:
        axes = cast(Any, figure).add_subplot(projection="3d")
        assert isinstance(found, FreeVolume)
        _voxels(axes, found, scale)
        axes.set_zlabel(labels[2], labelpad=8.0)
        axes.set_box_aspect(None, zoom=0.9)  # otherwise labels are cut off
        _legend(figure, zip(meanings[1:], (_CONTACT, _OPEN), strict=True))
        title += "\na voxel is drawn where its middle lies in no box that is proven free"
    title = f"{robot.name}. {title}\n{100.0 * found.decided:.1f} % of the box decided"
    axes.set_title(f"{title}\n{fill(str(found.coverage), _LINE)}", fontsize=9)
    axes.set_xlabel(labels[0], labelpad=None if len(names) == 2 else 12.0)
    axes.set_ylabel(labels[1], labelpad=None if len(names) == 2 else 12.0)
    return without_math(figure)


def _held(robot: Robot, found: FreeVolume) -> str:
    """Return the values of the fixed coordinates, as text."""
    held = [
        f"{name} = {units.amount(value, 'rad' if robot.turns(name) else 'm', 1)}"
        for name, value in zip(robot.coordinates, found.at.tolist(), strict=True)
        if name not in found.coordinates
    ]
    lines = [", ".join(held[start : start + _NAMED]) for start in range(0, len(held), _NAMED)]
    joined = ",\n".join(lines)
    return f"Slice: {joined}" if held else "All coordinates"


def _legend(figure: Any, entries: Iterable[tuple[str, str]]) -> None:
    from matplotlib.patches import Patch

    patches = [Patch(facecolor=colour, label=meaning) for meaning, colour in entries]
    figure.legend(handles=patches, loc="outside lower center", ncols=3, frameon=False, fontsize=9)


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
    from matplotlib.colors import to_rgba
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    ends: list[tuple[float, float]] = found.box.T.tolist()
    steps: list[Array] = [np.linspace(first, last, _VOXELS + 1) for first, last in ends]
    middles: list[Array] = [0.5 * (one[1:] + one[:-1]) for one in steps]
    is_drawn = ~_in(found.free, middles)
    colours = np.where(_in(found.open, middles)[..., None], to_rgba(_OPEN, 0.9), to_rgba(_CONTACT, _SEEN_THROUGH))
    scaled: list[Array] = [one * factor for one, factor in zip(steps, scale, strict=True)]
    corners, owners = _faces(is_drawn)
    places = np.stack([one[corners[..., axis]] for axis, one in enumerate(scaled)], axis=-1)
    if len(places):
        shown = colours[tuple(owners.T)]
        axes.add_collection3d(
            Poly3DCollection(places, facecolors=shown, edgecolors="#FFFFFF", linewidths=0.1, shade=True)
        )
    limits = (found.box * scale).T
    axes.set(xlim=limits[0], ylim=limits[1], zlim=limits[2])


def _faces(is_drawn: Flags) -> tuple[Indices, Indices]:
    """Return the squares between drawn voxels and others: corners (f, 4, 3), and the drawn voxel of each (f, 3).

    Both are in units of voxels. One collection of squares is drawn in a second; Matplotlib's `voxels` makes one for
    each voxel, which takes minutes.
    """
    corners: list[Indices] = []
    owners: list[Indices] = []
    for axis in range(3):
        width = [(int(one == axis), int(one == axis)) for one in range(3)]
        change = np.diff(np.pad(is_drawn, width).astype(np.int8), axis=axis)
        across = np.eye(3, dtype=np.intp)[[one for one in range(3) if one != axis]]
        square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) @ across
        for side in (1, -1):  # its voxel is behind the square, or in front of it
            at = np.argwhere(change == side)
            corners.append(at[:, None] + square)
            owners.append(at - (side < 0) * np.eye(3, dtype=np.intp)[axis])
    return np.concatenate(corners), np.concatenate(owners)


def _in(boxes: Array, middles: Sequence[Array]) -> Flags:
    """Return which points of a grid are in one of the boxes; `middles` are its ascending values along each axis."""
    found: Flags = np.zeros([len(one) for one in middles], dtype=np.bool_)
    first = [np.searchsorted(one, boxes[:, 0, axis], "left").tolist() for axis, one in enumerate(middles)]
    last = [np.searchsorted(one, boxes[:, 1, axis], "right").tolist() for axis, one in enumerate(middles)]
    for low, high in zip(zip(*first, strict=True), zip(*last, strict=True), strict=True):
        found[tuple(map(slice, low, high))] = True
    return found
