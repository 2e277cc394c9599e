"""Contact curves `|r(x)| = T` in a slice of two coordinates: every curve is found, and traced to a stated accuracy.

The smooth function `g = |r|^2 - T^2` has `grad g = 2 J^T r`. Over a box of half-sides h around m its gradient differs
from that at m by at most `d = M h`, `M_ij = 2 (a_i a_j + b A_ij)`. Here a_i, b and A_ij bound `|d_i r|`, `|r|` and
`|d_ij r|` over the box (`bounds/derivative_bounds`). Boxes are halved until each is one of

    empty:   ||r(m)| - T| > sum rho_i h_i, or |g(m)| > |grad g(m)| h + d h / 2: no curve passes;
    regular: |d| <= sin(20 deg) |grad g(m)|, in units of the box's sides: the normal turns by at most 20 degrees.

No island can be missed: if all boxes around it are regular, each bounded part of either sign contains a corner of a
box. The signs at all corners give the crossings, and the order along the tangent connects them. Each chord is halved,
and its middle is moved onto the curve, until its distance from the curve is provably within the accuracy.
`docs/regions.md` has the proofs.

Coordinates here are those of the slice in units of `Slice.scales`. So an accuracy is a share of the window if the
window is small.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pinbound.bounds.derivative_bounds import LeverArms, lever_arms
from pinbound.evaluate import numeric
from pinbound.evaluate.planar import Arrows, arrows
from pinbound.exceptions import UnsupportedError
from pinbound.path.chain import Chain
from pinbound.region.deadline import Deadline
from pinbound.region.smooth import Smooth
from pinbound.tolerances import CONTOUR_ROUNDING, CONTOUR_TURN, VERTEX
from pinbound.typing import Array, Flags, Ints

__all__ = ["BUMP", "STRIDE", "ContactFunction", "Contour", "HeightFunction", "Traced", "box_sides", "chain_up", "trace"]

_ROOT = 4  # 2^4 root boxes a side
_FINEST = 30  # 2^30 steps a side: 6e-9 rad in a window of one turn
STRIDE = 1 << (_FINEST + 1)
_MOST_BOXES = 400_000
_TURN = np.radians(20.0)  # the largest angle by which the normal may turn in a regular box
_REGULAR = float(np.sin(_TURN))
BUMP = float(0.5 * np.tan(_TURN)) / (1 << _ROOT)
"""Of the window's side: how high a curve may rise over a box's side without including a corner (`docs/regions.md`)."""
_CORNERS: Ints = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])


@dataclass(frozen=True, eq=False)
class ContactFunction:
    """`g(x) = |r(x)|^2 - T^2` over a slice of two coordinates.

    Attributes:
        chain: The chain over the two coordinates.
        threshold: T [m].
        arms: Bounds of r's derivatives over the window.
        arrows: The chain in the complex plane, if all its rotations share one direction.
        projection: (2, 3) rows that give the part of r perpendicular to a line, if this part is measured; None: all of
            r.
    """

    chain: Chain
    threshold: float
    arms: LeverArms
    arrows: Arrows | None
    projection: Array | None = None

    @property
    def scale(self) -> float:
        """The length of the path [m]; rounding is relative to it."""
        return self.chain.scale

    @classmethod
    def over(cls, chain: Chain, threshold: float, window: Array, projection: Array | None = None) -> ContactFunction:
        """Bound the derivatives over a window (2, 2), rows lower and upper."""
        arms = lever_arms(chain, np.max(np.abs(window), axis=0))
        return cls(chain, threshold, arms, None if projection is not None else arrows(chain), projection)

    def norm(self, X: Array) -> Array:
        """Return `|r|` (N,) [m]."""
        if self.arrows:
            return self.arrows.norm(X)
        r = numeric.positions(self.chain, X)
        return numeric.norm(r if self.projection is None else r @ self.projection.T)

    def clearance(self, X: Array) -> Array:
        """Return `|r| - T` (N,) [m]."""
        return self.norm(X) - self.threshold

    def value(self, X: Array) -> Array:
        """Return g (N,) [m^2], as `(|r| - T)(|r| + T)`, accurate near contact."""
        length = self.norm(X)
        return (length - self.threshold) * (length + self.threshold)

    def value_gradient(self, X: Array) -> tuple[Array, Array]:
        """Return g (N,) and its gradient (N, 2)."""
        value, gradient, _, _ = self.parts(X)
        return value, gradient

    def parts(self, X: Array) -> tuple[Array, Array, Array, Array]:
        """Return g (N,), its gradient (N, 2), `|r|` (N,) and `|d_i r|` (N, 2)."""
        if self.arrows:
            length, half, slopes = self.arrows.half_square_gradient(X)
        else:
            r, J = numeric.jacobian(self.chain, X)
            if self.projection is not None:
                r, J = r @ self.projection.T, np.einsum("di,nia->nda", self.projection, J)
            length, half = numeric.norm(r), np.einsum("nia,ni->na", J, r)
            slopes = np.sqrt(np.einsum("nia,nia->na", J, J))
        return (length - self.threshold) * (length + self.threshold), 2.0 * half, length, slopes

    def curvature(self, length: Array, slopes: Array, half: Array) -> Array:
        """Return bounds M (N, 2, 2) of g's Hessian over boxes of half-sides `half` (N, 2)."""
        first, second = self.arms.first, self.arms.second
        reach = length + half @ first
        slope = np.minimum(slopes + half @ second, first)
        return 2.0 * (slope[:, :, None] * slope[:, None, :] + reach[:, None, None] * second)


@dataclass(frozen=True, eq=False)
class HeightFunction:
    """`g(x) = n . r(x) - T` over a slice of two coordinates, for contact with a plane or the foot on a segment.

    Attributes:
        chain: The chain over the two coordinates.
        normal: (3,) n, in the frame before the first rotation.
        threshold: T [m].
        arms: Bounds of r's derivatives over the window.
    """

    chain: Chain
    normal: Array
    threshold: float
    arms: LeverArms

    @property
    def scale(self) -> float:
        """The length of the path [m]; rounding is relative to it."""
        return self.chain.scale

    @classmethod
    def over(cls, chain: Chain, normal: Array, threshold: float, window: Array) -> HeightFunction:
        """Bound the derivatives over a window (2, 2), rows lower and upper."""
        return cls(chain, normal, threshold, lever_arms(chain, np.max(np.abs(window), axis=0)))

    def value(self, X: Array) -> Array:
        """Return g (N,) [m]."""
        return numeric.positions(self.chain, X) @ self.normal - self.threshold

    def value_gradient(self, X: Array) -> tuple[Array, Array]:
        """Return g (N,) and its gradient (N, 2)."""
        value, gradient, _, _ = self.parts(X)
        return value, gradient

    def parts(self, X: Array) -> tuple[Array, Array, Array, Array]:
        """Return g (N,), its gradient (N, 2), the height (N,) and the gradient's sizes (N, 2)."""
        r, J = numeric.jacobian(self.chain, X)
        height, gradient = r @ self.normal, np.einsum("i,nia->na", self.normal, J)
        return height - self.threshold, gradient, height, np.abs(gradient)

    def curvature(self, length: Array, slopes: Array, half: Array) -> Array:
        """Return bounds (N, 2, 2) of g's Hessian."""
        return np.broadcast_to(self.arms.second, (len(half), 2, 2))


Traced = ContactFunction | HeightFunction


@dataclass(frozen=True, eq=False)
class Contour:
    """The contact curves of one boundary in a window.

    Attributes:
        lines: Polylines (k, 2) [rad]; closed ones repeat their first point.
        chord_error: [rad], the largest distance of a curve from its polyline.
        unresolved: (u, 2) centres of boxes in which curves may cross or only touch themselves.
        step: (2,) sides of these boxes: 1e-9 of the window's.
    """

    lines: tuple[Array, ...]
    chord_error: float
    unresolved: Array
    step: Array


def trace(function: Smooth, window: Array, accuracy: float, deadline: Deadline | None = None) -> Contour:
    """Return every curve `g = 0` in a window.

    Args:
        function: The contact function.
        window: (2, 2), rows lower and upper.
        accuracy: The largest distance allowed between a chord and its curve, in the window's units.
        deadline: The time limit; None: none.

    Raises:
        UnsupportedError: If g touches zero along a whole curve without changing sign, so that no number of boxes
            is enough, or if time is up.

    Example:
        >>> axes, slides = np.array([[0.0, 1.0, 0.0]] * 2), np.zeros((3, 3, 2))
        >>> offsets = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 1.0], [0.0, 0.0, 1.0]])
        >>> arm = Chain(offsets, slides, axes, np.eye(2), 3.0)
        >>> box = np.array([[-3.0, -3.0], [3.0, 3.0]])
        >>> found = trace(ContactFunction.over(arm, 1e-4, box), box, 1e-5)
        >>> len(found.lines), found.lines[0].mean(axis=0).round(6).tolist()  # two islands of 1e-4 rad
        (2, [-2.094..., -2.094...])
    """
    step = (window[1] - window[0]) / (1 << _FINEST)
    boxes, sizes, unresolved = _subdivide(function, window[0], step, deadline)
    crossings, pairs, reach = _crossings(function, window[0], step, boxes, sizes)
    if not len(pairs):
        return Contour((), 0.0, unresolved, step)
    crossings = _project(function, crossings, reach)
    chords, owner, error = _refine(function, crossings, pairs, accuracy, deadline)
    return Contour(chain_up(pairs, chords, owner), error, unresolved, step)


def _subdivide(function: Smooth, origin: Array, step: Array, deadline: Deadline | None) -> tuple[Ints, Ints, Array]:
    """Return the lower corners (N, 2) and sides (N,) of regular boxes in finest steps, and the unresolved centres."""
    side = 1 << (_FINEST - _ROOT)
    grid = np.arange(1 << _ROOT, dtype=np.int64) * side
    boxes = np.stack(np.meshgrid(grid, grid, indexing="ij"), axis=-1).reshape(-1, 2)
    kept: list[Ints] = []
    sizes: list[Ints] = []
    unresolved = np.empty((0, 2))
    count = 0
    while len(boxes):
        if deadline is not None:
            deadline.check()
        empty, regular = _classify(function, origin + step * (boxes + side / 2), step * (side / 2))
        leaf = ~empty & (regular if side > 1 else np.ones_like(regular))
        if side == 1:
            unresolved = origin + step * (boxes[~empty & ~regular] + 0.5)
        kept.append(boxes[leaf])
        sizes.append(np.full(int(leaf.sum()), side, dtype=np.int64))
        boxes = boxes[~empty & ~leaf]
        count += 4 * len(boxes)
        if count > _MOST_BOXES:
            raise UnsupportedError(
                f"a contact curve needs more than {_MOST_BOXES} boxes: somewhere the clearance touches zero along a "
                "curve, or the window is very wide; change min_distance slightly, or give a smaller window (window=, "
                "on the command line --window)"
            )
        side //= 2
        boxes = (boxes[:, None, :] + side * _CORNERS).reshape(-1, 2)
    return np.concatenate(kept), np.concatenate(sizes), unresolved


def _classify(function: Smooth, middle: Array, half: Array) -> tuple[Flags, Flags]:
    value, gradient, length, slopes = function.parts(middle)
    scale = max(function.scale, function.arms.length + abs(function.threshold))
    span = float(function.arms.first @ half) + CONTOUR_ROUNDING * scale
    halves = np.broadcast_to(half, middle.shape)
    change = function.curvature(length, slopes, halves) @ half
    drop = np.abs(gradient) @ half + 0.5 * (change @ half) + CONTOUR_ROUNDING * scale * scale
    empty = (np.abs(length - function.threshold) > span) | (np.abs(value) > drop)
    regular = np.linalg.norm(change * half, axis=1) <= _REGULAR * np.linalg.norm(gradient * half, axis=1)
    return empty, regular


def box_sides(boxes: Ints, sizes: Ints) -> tuple[Ints, Ints, Ints]:
    """Return the pieces of the sides of boxes, divided at the corners of smaller neighbours.

    Args:
        boxes: (N, 2) lower corners in finest steps, below 2^31.
        sizes: (N,) sides in finest steps.

    Returns:
        The keys of the corners (K,), `x * 2^31 + y`, ascending; the box of each piece (S,), and its ends (S, 2) among
        them.
    """
    corners = boxes[:, None, :] + sizes[:, None, None] * _CORNERS
    keys = [np.unique(corners[..., axis].ravel() * STRIDE + corners[..., 1 - axis].ravel()) for axis in (0, 1)]
    nodes = keys[0]
    cells: list[Ints] = []
    ends: list[Ints] = []
    for axis in (0, 1):  # sides on which coordinate `axis` is constant: x sides first
        for offset in (0, 1):
            fixed, low = boxes[:, axis] + offset * sizes, boxes[:, 1 - axis]
            first = np.searchsorted(keys[axis], fixed * STRIDE + low)
            last = np.searchsorted(keys[axis], fixed * STRIDE + low + sizes)
            count = last - first
            cell = np.repeat(np.arange(len(boxes)), count)
            start = np.repeat(first, count) + np.arange(len(cell)) - np.repeat(np.cumsum(count) - count, count)
            pair = np.stack((keys[axis][start], keys[axis][start + 1]), axis=1)
            if axis == 1:
                pair = (pair % STRIDE) * STRIDE + pair // STRIDE
            cells.append(cell)
            ends.append(np.searchsorted(nodes, pair))
    return nodes, np.concatenate(cells), np.concatenate(ends)


def _crossings(function: Smooth, origin: Array, step: Array, boxes: Ints, sizes: Ints) -> tuple[Array, Ints, Array]:
    """Return the points (K, 2) where curves cross sides of boxes, and the pairs (P, 2) that a box connects.

    Also return the length (K,) of the piece of a side on which each point lies.
    """
    if not len(boxes):
        return np.empty((0, 2)), np.empty((0, 2), dtype=np.int64), np.empty(0)
    nodes, cell, end = box_sides(boxes, sizes)
    place = np.stack((nodes // STRIDE, nodes % STRIDE), axis=1)
    inside = function.value(origin + step * place) <= 0.0
    changes = inside[end[:, 0]] != inside[end[:, 1]]
    cell, end = cell[changes], end[changes]
    segments, index = np.unique(end[:, 0] * len(nodes) + end[:, 1], return_inverse=True)
    index = index.ravel()
    low, high = origin + step * place[segments // len(nodes)], origin + step * place[segments % len(nodes)]
    points = _bisect(function, low, high)
    middle = origin + step * (boxes + sizes[:, None] / 2)
    tangent = (function.value_gradient(middle)[1] * step)[:, ::-1] * np.array([-1.0, 1.0])
    along = np.einsum("na,na->n", (points[index] - middle[cell]) / step, tangent[cell])
    order = np.lexsort((along, cell))
    return points, index[order].reshape(-1, 2), np.asarray(np.linalg.norm(high - low, axis=1), dtype=np.float64)


def _bisect(function: Smooth, low: Array, high: Array) -> Array:
    """Return a zero of g on each segment, by false position (Illinois) within the bracket."""
    a, b = np.zeros(len(low)), np.ones(len(low))
    fa, fb = function.value(low), function.value(high)
    t = 0.5 * np.ones(len(low))
    for _ in range(6):
        with np.errstate(invalid="ignore", divide="ignore"):
            guess = (a * fb - b * fa) / (fb - fa)
        t = np.where(np.isfinite(guess), np.clip(guess, a, b), 0.5 * (a + b))
        value = function.value(low + t[:, None] * (high - low))
        same = (value <= 0.0) == (fa <= 0.0)
        a, b = np.where(same, t, a), np.where(same, b, t)
        fa, fb = np.where(same, value, fa * 0.5), np.where(same, fb * 0.5, value)
    return low + t[:, None] * (high - low)


def _project(function: Smooth, X: Array, limit: float | Array, rounds: int = 4) -> Array:
    """Move points onto the curve along the gradient; a point that would move further than its `limit` stays.

    Newton's steps shrink quadratically: the one after a step of `tolerances.VERTEX` is below rounding.
    """
    moved = X
    for _ in range(rounds):
        value, gradient = function.value_gradient(moved)
        square = np.einsum("na,na->n", gradient, gradient)
        with np.errstate(invalid="ignore", divide="ignore"):
            step = gradient * (value / square)[:, None]
        moved = moved - step
        if np.max(np.abs(step), initial=0.0) <= VERTEX:
            break
    wild = ~(np.linalg.norm(moved - X, axis=1) <= limit)
    return np.where(wild[:, None], X, moved)


def _refine(
    function: Smooth, points: Array, pairs: Ints, accuracy: float, deadline: Deadline | None
) -> tuple[Array, Ints, float]:
    """Return chords (C, 2, 2), grouped by pair and in order along the curve, their pairs (C,), and the proven error."""
    chords = points[pairs]
    owner = np.arange(len(pairs))
    rank = np.zeros(len(pairs))
    width = np.ones(len(pairs))
    done: list[tuple[Array, Ints, Array]] = []
    error = 0.0
    for _ in range(_FINEST):
        if deadline is not None:
            deadline.check()
        bound, straight = _chord_bound(function, chords)
        length = np.linalg.norm(chords[:, 1] - chords[:, 0], axis=1)
        ready = (straight & (bound <= accuracy)) | (length <= accuracy / 2)
        error = max(error, float(np.max(np.where(straight, bound, length)[ready], initial=0.0)))
        done.append((chords[ready], owner[ready], rank[ready]))
        chords, owner, rank, width = chords[~ready], owner[~ready], rank[~ready], width[~ready] / 2
        if not len(chords):
            break
        middle = _project(function, chords.mean(axis=1), 1.0)
        wild = np.linalg.norm(middle - chords.mean(axis=1), axis=1) > 0.5 * length[~ready]
        middle[wild] = chords[wild].mean(axis=1)
        first, second = np.stack((chords[:, 0], middle), axis=1), np.stack((middle, chords[:, 1]), axis=1)
        chords = np.concatenate((first, second))
        owner = np.concatenate((owner, owner))
        rank = np.concatenate((rank, rank + width))
        width = np.concatenate((width, width))
    else:
        done.append((chords, owner, rank))
    chords, owner, rank = (np.concatenate(parts) for parts in zip(*done, strict=True))
    order = np.lexsort((rank, owner))
    return chords[order], owner[order], error


def _chord_bound(function: Smooth, chords: Array) -> tuple[Array, Flags]:
    """Return a bound of the distance between chord and curve (C,), and whether it is proven.

    Let s be the length of the chord. Over the disc of radius s around the chord's middle, the gradient differs from
    that of the middle by at most `d = M s`. Let a be the angle between this gradient n and the chord's normal. If `n
    cos a > d`, the curve is a graph u over the chord. Then `|u'| <= sigma = (n sin a + d) / (n cos a - d)`, `|u''| <= M
    (1 + sigma^2) / (n cos a - d)`, `|u| <= s^2 |u''| / 8`.
    """
    along = chords[:, 1] - chords[:, 0]
    length: Array = np.linalg.norm(along, axis=1)
    middle = chords.mean(axis=1)
    _, gradient, size, slopes = function.parts(middle)
    M = function.curvature(size, slopes, np.broadcast_to(length[:, None], middle.shape))
    norm_M: Array = np.linalg.norm(M, axis=(1, 2))
    with np.errstate(invalid="ignore", divide="ignore"):
        unit = along / length[:, None]
        perpendicular = np.abs(gradient[:, 0] * unit[:, 1] - gradient[:, 1] * unit[:, 0])
        parallel = np.abs(np.einsum("na,na->n", gradient, unit))
        steep = perpendicular - norm_M * length
        slope = (parallel + norm_M * length) / steep
        bend = norm_M * (1.0 + slope * slope) / steep
        bound = length * length * bend / 8.0
    proven = (steep > 0.0) & (length * bend <= CONTOUR_TURN) & (bound <= length / 2)
    return np.asarray(np.where(proven, bound, length)), np.asarray(proven, dtype=bool)


def chain_up(pairs: Ints, chords: Array, owner: Ints) -> tuple[Array, ...]:
    """Join the refined pairs into polylines; shared end points are equal bit for bit."""
    starts = np.searchsorted(owner, np.arange(len(pairs) + 1))
    partners: dict[int, list[int]] = {}
    for number, (a, b) in enumerate(pairs.tolist()):
        partners.setdefault(a, []).append(number)
        partners.setdefault(b, []).append(number)
    unused = np.ones(len(pairs), dtype=bool)
    lines: list[Array] = []
    table = pairs.tolist()
    seeds = [found[0] for found in partners.values() if len(found) == 1] + list(range(len(pairs)))
    for seed in seeds:
        if not unused[seed]:
            continue
        a, b = table[seed]
        node = a if len(partners[a]) == 1 or len(partners[b]) > 1 else b
        number: int | None = seed
        pieces: list[Array] = []
        while number is not None:
            unused[number] = False
            piece = chords[starts[number] : starts[number + 1]]
            polyline = np.concatenate((piece[:, 0], piece[-1:, 1]))
            forward = table[number][0] == node
            polyline = polyline if forward else polyline[::-1]
            pieces.append(polyline if not pieces else polyline[1:])
            node = table[number][1] if forward else table[number][0]
            number = next((other for other in partners[node] if unused[other]), None)
        lines.append(np.concatenate(pieces))
    return tuple(lines)
