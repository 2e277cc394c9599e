"""Contact curves of bodies that only translate relative to each other in the slice: one convex curve, found by rays.

Fixed rotations are constant. So in a slice of prismatic joints `r(x, t) = w + W x + sum_i t_i e_i` with constant w, W
and e_i. The separation `f(x) = min_t |A r(x, t)|` is the distance of the origin from a convex body that moves linearly
with x. So f is convex, and so is the set of contact `f <= T`. From a point c of a convex set, every ray crosses the
border once. Between two border points, the border lies in the triangle of their chord and their two tangents. So the
triangle's height over the chord bounds their distance. Rays are added until it is within the accuracy.
"""

from __future__ import annotations

import numpy as np

from pinbound.evaluate.closest import nearest, nearest_of_hulls
from pinbound.path.relative import RelativePath
from pinbound.region.cells import SeparationFunction
from pinbound.region.deadline import Deadline
from pinbound.tolerances import CONTOUR_ROUNDING
from pinbound.typing import Array, Flags

__all__ = ["SlidingFunction", "only_slides", "sliding_curves"]

_FIRST = 64  # rays at the start
_ROUNDS = 40
_MOST_RAYS = 200_000
_CENTRING = 3
_BISECTIONS = 60
_NEAR = 1e-13  # relative: the accuracy of a border point; that of the separation is no better
_AT_RIM = 2e-3  # of the window's side: the distance from the window's border to which a curve is followed


def only_slides(path: RelativePath) -> bool:
    """Return whether two bodies, one of them more than a point, translate and never rotate relative to each other."""
    return not path.minimal.rotations and bool(path.difference.directions) and not path.is_signed


class SlidingFunction(SeparationFunction):
    """`f(x) - T` of bodies that only translate, over the slice in units of its scales: convex."""

    def lowest(self, window: Array) -> Array:
        """Return the point (2,) of a window with the least f: a nearest-point problem with two more edge vectors."""
        chain, path = self.path.minimal, self.path
        low, width = window[0] * self.scales, (window[1] - window[0]) * self.scales
        start = chain.offsets[0] + chain.slides[0] @ low
        edges = [chain.slides[0][:, axis] * width[axis] for axis in (0, 1)]
        edges += [np.asarray(edge[0], dtype=np.float64) for edge in path.difference.directions]
        measured = path.counted(np.array([start, *edges]))
        if path.difference.is_zonotope:
            t = nearest(measured[:1], measured[1:, None, :])[0]
        else:  # the window is a square, so it counts as a part of one body
            mine, others = path.difference.corners
            square = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
            both = np.hstack((np.repeat(square, len(mine), axis=0), np.tile(mine, (4, 1))))
            t = nearest_of_hulls(measured[:1], measured[1:, None, :], (both, others))[0]
        return window[0] + t[:2] * (window[1] - window[0])


def sliding_curves(
    function: SlidingFunction, window: Array, accuracy: float, deadline: Deadline | None = None
) -> tuple[tuple[Array, ...], float]:
    """Return the border of the contact in a window (2, 2) as polylines (k, 2), and the proven error of their chords.

    A closed curve repeats its first point. A curve that leaves the window ends near its border. Without contact in the
    window, the result is empty. If bodies touch at the threshold over an area, as sliding faces do, this is contact.

    Raises:
        UnsupportedError: If time is up.
    """
    slack = CONTOUR_ROUNDING * max(function.path.minimal.scale, function.threshold)
    function = SlidingFunction(function.path, function.threshold + slack, function.scales)
    centre = function.lowest(window)
    if not function.value(centre[None])[0] <= 0.0:
        return (), 0.0
    for axis in (0, 1) * _CENTRING:
        there, _ = _shoot(function, centre, np.array([np.eye(2)[axis], -np.eye(2)[axis]]), window)
        centre = there.mean(axis=0)
    corners = np.array([[window[i, 0], window[j, 1]] for i in (0, 1) for j in (0, 1)]) - centre
    angles = np.concatenate((np.arange(_FIRST) * (2.0 * np.pi / _FIRST), np.arctan2(corners[:, 1], corners[:, 0])))
    angles = np.unique(np.mod(angles, 2.0 * np.pi))
    points, on_curve = _shoot(function, centre, _directions(angles), window)
    rim = _AT_RIM * float(np.min(window[1] - window[0]))
    for _ in range(_ROUNDS):
        if deadline is not None:
            deadline.check()
        height, length = _heights(function, points, on_curve)
        following = np.roll(on_curve, -1)
        both, one = on_curve & following, on_curve != following
        split = (both & (height > accuracy) & (length > accuracy / 2)) | (one & (length > rim))
        if not np.any(split) or len(angles) > _MOST_RAYS:
            break
        gap = np.mod(np.roll(angles, -1) - angles, 2.0 * np.pi)
        split &= gap > 1e-14
        if not np.any(split):
            break
        added = np.mod(angles[split] + 0.5 * gap[split], 2.0 * np.pi)
        more, more_on = _shoot(function, centre, _directions(added), window)
        angles, points = np.concatenate((angles, added)), np.concatenate((points, more))
        on_curve = np.concatenate((on_curve, more_on))
        order = np.argsort(angles, kind="stable")
        angles, points, on_curve = angles[order], points[order], on_curve[order]
    height, length = _heights(function, points, on_curve)
    both = on_curve & np.roll(on_curve, -1)
    error = float(np.max(np.minimum(height, length)[both], initial=0.0))
    return _runs(points, on_curve), error


def _directions(angles: Array) -> Array:
    return np.stack((np.cos(angles), np.sin(angles)), axis=1)


def _shoot(function: SlidingFunction, centre: Array, directions: Array, window: Array) -> tuple[Array, Flags]:
    """Return where rays from a point in contact leave contact, or the window if it ends first, and which of the two.

    f is convex along a ray, so a tangent from outside never passes the border. So Newton steps and bisection share a
    bracket.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        gaps: Array = np.asarray(np.where(directions > 0.0, window[1] - centre, window[0] - centre), dtype=np.float64)
        away: Array = np.asarray(gaps / directions, dtype=np.float64)
    far = np.maximum(np.min(np.where(np.isfinite(away), away, np.inf), axis=1), 0.0)
    on_curve = function.value(centre + far[:, None] * directions) > 0.0
    low, high = np.zeros(len(far)), far.copy()
    live = np.flatnonzero(on_curve)
    for _ in range(_BISECTIONS):
        if not len(live):
            break
        outer = centre + high[live, None] * directions[live]
        value, gradient = function.value_gradient(outer)
        with np.errstate(divide="ignore", invalid="ignore"):
            step = value / np.einsum("na,na->n", gradient, directions[live])
        reached: Array = np.asarray(high[live] - step, dtype=np.float64)
        newton: Array = np.where((reached >= low[live]) & (reached <= high[live]), reached, high[live])
        near = _NEAR * (1.0 + newton)  # the border is this near to Newton's point: close the bracket around it
        for asked in (newton, newton + near, newton - near, 0.5 * (low[live] + high[live])):
            guess = np.clip(asked, low[live], high[live])
            inside = function.value(centre + guess[:, None] * directions[live]) <= 0.0
            low[live] = np.where(inside, np.maximum(low[live], guess), low[live])
            high[live] = np.where(inside, high[live], np.minimum(high[live], guess))
            if np.all(high[live] - low[live] <= 3.0 * _NEAR * (1.0 + high[live])):
                break
        live = live[high[live] - low[live] > 3.0 * _NEAR * (1.0 + high[live])]
    return centre + high[:, None] * directions, on_curve


def _heights(function: SlidingFunction, points: Array, on_curve: Flags) -> tuple[Array, Array]:
    """Return the height of the triangle of two tangents over each chord, and the lengths of the chords."""
    following = np.roll(points, -1, axis=0)
    along = following - points
    length = np.asarray(np.linalg.norm(along, axis=1), dtype=np.float64)
    _, normal = function.value_gradient(points)
    with np.errstate(divide="ignore", invalid="ignore"):
        normal = normal / np.linalg.norm(normal, axis=1)[:, None]
        unit = along / length[:, None]
        first = -np.einsum("na,na->n", unit, normal)  # sine of the angle from the chord to the tangent at its start
        last = np.einsum("na,na->n", unit, np.roll(normal, -1, axis=0))
        first, last = np.arcsin(np.clip(first, 0.0, 1.0)), np.arcsin(np.clip(last, 0.0, 1.0))
        height = length * np.sin(first) * np.sin(last) / np.sin(first + last)
    flat = first + last <= 0.0
    sound = np.isfinite(height) & (first + last < 0.5 * np.pi)
    return np.where(flat, 0.0, np.where(sound, height, length)), length


def _runs(points: Array, on_curve: Flags) -> tuple[Array, ...]:
    """Return the runs of points on the curve; one closed run if no point leaves the window."""
    if np.all(on_curve):
        return (np.concatenate((points, points[:1])),)
    if not np.any(on_curve):
        return ()
    start = int(np.flatnonzero(~on_curve)[0])
    order = np.roll(np.arange(len(points)), -start)
    runs = np.split(order, np.flatnonzero(np.diff(on_curve[order].astype(int))) + 1)
    return tuple(points[run] for run in runs if on_curve[run[0]] and len(run) > 1)
