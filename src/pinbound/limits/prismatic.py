"""All contacts along a prismatic coordinate of bodies, lines or planes: at most one interval; the distance is convex.

If the other coordinates are fixed, `r(x, t) = w + d x + sum_i t_i e_i`. The set of all r is convex in (x, t) together.
So the distance `f(x) = min_t |r(x, t)|` is a convex function of x, and contact, `f <= T`, is one interval or empty. f
is least where r is nearest to the line along d. With P the projection normal to d,

    m = min_t |P (w + sum_i t_i e_i)|,     x* = -d . (w + sum_i t*_i e_i) / |d|^2.

From outside, Newton's steps `x - (f - T) / f'` never pass the end of the contact, because a convex function is above
its tangents; the last bits are halved. A height above a plane is affine in x. No window is needed. `docs/segments.md`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np

from pinbound.evaluate import closest, numeric, separation
from pinbound.evaluate.closest import nearest
from pinbound.geometry import gjk
from pinbound.path.kind import Case
from pinbound.path.relative import RelativePath
from pinbound.tolerances import CONTOUR_ROUNDING, REDUCTION, UNIT_ROUNDOFF
from pinbound.typing import Array, Flags

__all__ = ["intervals", "only_slides"]

_MOST_STEPS = 60  # Newton steps; each kink of f needs one or two
_MOST_HALVINGS = 64


def only_slides(path: RelativePath, index: int) -> bool:
    """Return whether a coordinate is in no rotation of the path: it translates the path, or does not change it."""
    return not np.any(path.minimal.coefficients[:, index])


def intervals(path: RelativePath, index: int, Q: Array, threshold: float) -> Array:
    """Return the free intervals (N, 2, 2) of coordinate `index`, the others as in Q (N, n); NaN if there are fewer.

    Ends are contacts, accurate to the last bits, or infinite.

    Args:
        path: A path whose coordinate `index` is in no rotation.
        index: The coordinate.
        Q: (N, n) finite.
        threshold: T, the largest separation in contact [m].
    """
    rest = Q.copy()
    rest[:, index] = 0.0
    w, edges = separation.measured(path, rest)
    d = path.counted(numeric.derivative(path.minimal, rest)[:, :, index])
    return _INTERVALS[path.case](path, index, Q, (w, edges, d), threshold)


def _of_heights(path: RelativePath, index: int, Q: Array, line: tuple[Array, Array, Array], threshold: float) -> Array:
    """Return the free intervals of a height, which is affine."""
    w, edges, d = line
    moves, found = np.abs(d[:, 0]) > REDUCTION, np.full((len(Q), 2, 2), np.nan)
    t = closest.lowest(edges, path.difference.corners)
    height, rate = w[:, 0] + np.einsum("nk,kn->n", t, edges[:, :, 0]), d[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        end = (threshold - height) / rate
    found[moves & (rate > 0.0), 0] = np.stack((end, np.full_like(end, math.inf)), axis=1)[moves & (rate > 0.0)]
    found[moves & (rate < 0.0), 0] = np.stack((np.full_like(end, -math.inf), end), axis=1)[moves & (rate < 0.0)]
    found[~moves & (height > threshold), 0] = -math.inf, math.inf
    return found


def _of_distances(
    path: RelativePath, index: int, Q: Array, line: tuple[Array, Array, Array], threshold: float
) -> Array:
    """Return the free intervals of a distance, which is convex."""
    w, edges, d = line
    speed = np.linalg.norm(d, axis=1)
    moves, found = speed > REDUCTION, np.full((len(Q), 2, 2), np.nan)
    unit = np.divide(d, speed[:, None], out=np.zeros_like(d), where=moves[:, None])
    t = _nearest(path, *(x - np.einsum("...i,...i->...", x, unit)[..., None] * unit for x in (w, edges)))
    foot = w + np.einsum("nk,kni->ni", t, edges)
    along = np.einsum("ni,ni->n", foot, unit)
    smallest = numeric.norm(foot - along[:, None] * unit)
    size = gjk.reach(w, edges, path.difference.corners)
    rounding = CONTOUR_ROUNDING * (size + threshold)
    free = smallest > threshold + rounding
    found[free, 0] = -math.inf, math.inf
    rows = np.flatnonzero(~free & moves)
    if not len(rows):
        return found
    lowest = -along[rows] / speed[rows]
    # Where f only just reaches T, or equals T along an interval, rounding decides where it ends: all of it is contact.
    level = np.maximum(threshold, np.minimum(smallest[rows] + 2.0 * rounding[rows], threshold + rounding[rows]))
    level[smallest[rows] < threshold - rounding[rows]] = threshold
    reach = (level + 2.0 * size[rows]) / speed[rows] * (1.0 + 1e-9)
    found[rows, 0, 0], found[rows, 1, 1] = -math.inf, math.inf
    for side, slot in ((-1.0, (0, 1)), (1.0, (1, 0))):
        found[rows, slot[0], slot[1]] = _end(
            path, index, Q[rows], (w[rows], edges[:, rows], d[rows]), level, lowest, side * reach
        )
    return found


_INTERVALS: Mapping[Case, Callable[[RelativePath, int, Array, tuple[Array, Array, Array], float], Array]] = {
    Case.BODIES: _of_distances,
    Case.LINE: _of_distances,
    Case.PLANE: _of_heights,
}


def _nearest(path: RelativePath, w: Array, edges: Array) -> Array:
    return (
        nearest(w, edges)
        if path.difference.is_zonotope
        else closest.nearest_of_hulls(w, edges, path.difference.corners)
    )


def _end(
    path: RelativePath,
    index: int,
    Q: Array,
    line: tuple[Array, Array, Array],
    level: Array,
    lowest: Array,
    reach: Array,
) -> Array:
    """Return where f first exceeds the level (N,) between its minimum (N,) and `lowest + reach`, from outside."""
    w, edges, d = line
    x = lowest + reach
    scale = np.abs(lowest) + np.abs(reach)
    for _ in range(_MOST_STEPS):
        r = w + x[:, None] * d
        r = r + np.einsum("nk,kni->ni", _nearest(path, r, edges), edges)
        f = numeric.norm(r)
        slope = np.divide(np.einsum("ni,ni->n", r, d), f, out=np.zeros_like(f), where=f > 0.0)
        step = np.divide(f - level, slope, out=np.zeros_like(f), where=(f > level) & (slope * reach > 0.0))
        x = x - step
        if np.all(np.abs(step) <= 4.0 * UNIT_ROUNDOFF * scale):
            break

    def apart(places: Array) -> Flags:
        """Evaluate the public function, so that users get the same answer at the end and beyond it."""
        rows = Q.copy()
        rows[:, index] = places
        return separation.separations(path, rows) > level

    outward = np.sign(reach)
    width = 8.0 * UNIT_ROUNDOFF * np.maximum(scale, 1e-300)
    outside, inside = x + outward * width, x - outward * width
    for _ in range(_MOST_HALVINGS):
        far, near = ~apart(outside), apart(inside)
        near &= (inside - lowest) * outward > 0.0
        if not np.any(far | near):
            break
        width = 4.0 * width
        outside, inside = (
            np.where(far, outside + outward * width, outside),
            np.where(near, inside - outward * width, inside),
        )
    for _ in range(_MOST_HALVINGS):
        middle = 0.5 * (inside + outside)
        if np.all((middle == inside) | (middle == outside)):
            break
        is_apart = apart(middle)
        outside, inside = np.where(is_apart, middle, outside), np.where(is_apart, inside, middle)
    return outside
