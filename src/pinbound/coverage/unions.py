"""A proof that several spheres hold a body: every point of the body is in at least one sphere.

For a cylinder or capsule the proof goes along the axis. A sphere of radius R about a point of the axis holds the body's
disc of radius r up to a distance of `sqrt(R^2 - r^2)` from there. So these intervals must cover the axis. Otherwise the
body is divided into boxes, each in one sphere: first at the middles between centres, where covers by cells meet, then
by halving.
"""

from __future__ import annotations

import math

import numpy as np

from pinbound.tolerances import HELD, SAME_BODY
from pinbound.typing import Array, Flags

__all__ = ["spheres_over"]

_MOST_BOXES = 8_000
"""The largest number of boxes of a proof; a body that needs more is not proven to be held."""
_MOST_CELLS = 1_000
"""The largest number of boxes at the start of a proof."""


def spheres_over(shape: str, size: tuple[float, ...], centres: Array, radii: Array) -> tuple[int, ...]:
    """Return spheres, of those given, whose union is proven to hold a body; empty if that is not proven.

    Args:
        shape: ``"sphere"``, ``"box"``, ``"cylinder"`` or ``"capsule"``.
        size: [m], as in `bodies.Body`.
        centres: (k, 3) [m] in the body's frame.
        radii: (k,) [m].

    Example:
        >>> spheres_over("box", (0.2, 0.1, 0.1), np.array([[-0.05, 0, 0], [0.05, 0, 0]]), np.full(2, 0.0867))
        (0, 1)
        >>> spheres_over("box", (0.2, 0.1, 0.1), np.array([[-0.05, 0, 0], [0.05, 0, 0]]), np.full(2, 0.0866))
        ()
    """
    if shape in ("cylinder", "capsule"):
        found = _along_axis(size[0], size[1], centres, radii, has_caps=shape == "capsule")
        if found:
            return found
    return _by_boxes(shape, size, centres, radii)


def _along_axis(radius: float, length: float, centres: Array, radii: Array, has_caps: bool) -> tuple[int, ...]:
    """Go along the axis from end to end; in each step use the sphere that reaches furthest."""
    inner = radii - np.hypot(centres[:, 0], centres[:, 1])  # of the sphere that it holds about the axis
    heights, half = centres[:, 2], length / 2
    wide = inner >= radius
    reach = np.where(wide, np.sqrt(np.maximum(inner**2 - radius**2, 0.0)), -np.inf)
    used: list[int] = []
    reached, last = -half, -1
    if has_caps:
        caps = [np.flatnonzero(np.abs(heights - end) + radius <= inner + HELD) for end in (-half, half)]
        if not len(caps[0]) or not len(caps[1]):
            return ()
        first, last = int(caps[0][0]), int(caps[1][0])
        used.append(first)
        reached = max(reached, float(heights[first] + max(reach[first], 0.0)))
    while reached < half - HELD:
        ready = np.flatnonzero(heights - reach <= reached + HELD)
        if not len(ready):
            return ()
        best = int(ready[np.argmax((heights + reach)[ready])])
        if heights[best] + reach[best] <= reached + HELD:
            return ()
        reached = float(heights[best] + reach[best])
        used.append(best)
    return tuple(dict.fromkeys([*used, last] if has_caps else used))


def _by_boxes(shape: str, size: tuple[float, ...], centres: Array, radii: Array) -> tuple[int, ...]:
    """Halve the body's bounding box until every part is in one sphere, or outside the body, or the budget is spent."""
    half_size = _half_size(shape, size)
    centre, half = _first_cells(half_size, centres)
    used: set[int] = set()
    boxes = 0
    while len(centre):
        boxes += len(centre)
        if boxes > _MOST_BOXES:
            return ()
        inside = ~_is_outside(shape, size, centre, half)
        centre, half = centre[inside], half[inside]
        if not len(centre):
            break
        span = np.linalg.norm(np.abs(centre[:, None] - centres) + half[:, None], axis=2)
        slack = radii - span
        best = np.argmax(slack, axis=1)
        closed = slack[np.arange(len(centre)), best] >= -HELD
        used |= set(best[closed].tolist())
        centre, half = centre[~closed], half[~closed]
        core = ~_is_outside(shape, size, centre, np.zeros_like(half))
        distance = np.linalg.norm(centre[core][:, None] - centres, axis=2) - radii
        if np.any(np.min(distance, axis=1) > HELD):
            return ()  # a point of the body is in no sphere
        rows, across = np.arange(len(centre)), np.argmax(half, axis=1)
        half[rows, across] *= 0.5
        step = np.zeros_like(half)
        step[rows, across] = half[rows, across]
        centre, half = np.concatenate((centre - step, centre + step)), np.concatenate((half, half))
    return tuple(sorted(used))


def _half_size(shape: str, size: tuple[float, ...]) -> Array:
    if shape == "box":
        return np.array(size) / 2
    if shape == "sphere":
        return np.full(3, size[0])
    return np.array([size[0], size[0], size[1] / 2 + (size[0] if shape == "capsule" else 0.0)])


def _first_cells(half_size: Array, centres: Array) -> tuple[Array, Array]:
    """Return boxes, centres (k, 3) and half-sides, divided at the middles between centres if these give few boxes."""
    cuts: list[Array] = []
    for axis in range(3):
        order = np.sort(centres[:, axis])
        middles = ((order[:-1] + order[1:]) / 2)[np.diff(order) > SAME_BODY]
        inner = middles[np.abs(middles) < half_size[axis]]
        cuts.append(np.concatenate(([-half_size[axis]], inner, [half_size[axis]])))
    if math.prod(len(one) - 1 for one in cuts) > _MOST_CELLS:
        cuts = [np.array([-size, size]) for size in half_size.tolist()]
    grids = np.meshgrid(*(0.5 * (c[1:] + c[:-1]) for c in cuts), indexing="ij")
    halves = np.meshgrid(*(0.5 * np.diff(c) for c in cuts), indexing="ij")
    return np.column_stack([g.ravel() for g in grids]), np.column_stack([h.ravel() for h in halves])


def _is_outside(shape: str, size: tuple[float, ...], centre: Array, half: Array) -> Flags:
    """Return which boxes have no inner point of the body; for those that only touch it either answer is possible."""
    nearest = np.maximum(np.abs(centre) - half, 0.0)
    if shape == "box":
        return np.zeros(len(centre), dtype=np.bool_)
    if shape == "sphere":
        return np.linalg.norm(nearest, axis=1) > size[0] + HELD
    across = np.hypot(nearest[:, 0], nearest[:, 1])
    if shape == "capsule":
        return np.hypot(across, np.maximum(nearest[:, 2] - size[1] / 2, 0.0)) > size[0] + HELD
    return across > size[0] + HELD
