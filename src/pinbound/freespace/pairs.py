"""Clearances of many pairs over many boxes as affine lower bounds: `f(q) >= value + slope . (q - centre) - rest`.

The proof is that of `certify_box` (docs/certificates.md, Boxes): along the fixed unit vector n of the middle, `|r| >= n
. r`. Its linear part is exact, and the remainder is at most `K / 2`. With the second derivatives in the middle, it is
at most their terms and a remainder of third order (docs/free-space.md). Here only the linear part is separate, so that
it can be weighed against the faces of a polytope.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pinbound.boundaries.boundary import Boundary
from pinbound.bounds.bounds import bundle, lever_arms
from pinbound.certificates.constraints import ManyAngleBoundaries, OneAngleBoundaries, families
from pinbound.certificates.enclosures import Family
from pinbound.freespace.groups import Groups
from pinbound.robot.robot import Robot
from pinbound.tolerances import INFLATION
from pinbound.typing import Array, Indices

__all__ = ["Affine", "Pairs", "bound_points"]


@dataclass(frozen=True)
class Affine:
    """The bounds of N pairs over N boxes.

    Attributes:
        value: (N,) signed clearance at the centre, as computed, minus all rounding [m].
        slope: (N, n) of the affine lower bound [m/rad or 1].
        rest: (N,) the amount subtracted from it over the box [m].
        moved: (N,) how much smaller than `value` the clearance can be, by lever arms alone [m].
        lower: (N,) the best proven lower bound over the box [m]; above zero only if it is proven clear.
        upper: (N,) a proven upper bound over the box [m].
    """

    value: Array
    slope: Array
    rest: Array
    moved: Array
    lower: Array
    upper: Array


class Pairs:
    """Boundaries of several effective angles, with bounds over boxes within one outer box."""

    def __init__(self, robot: Robot, boundaries: Sequence[Boundary], low: Array, high: Array) -> None:
        """Store the boundaries; bounds hold while q stays in the box (n,), (n,)."""
        _, one, many, swept = families(robot, tuple(boundaries), low, high)
        self.families: tuple[Family, ...] = (one, many, swept)
        self.names = tuple(name for family in self.families for name in family.names)
        self.boundaries = tuple(robot.boundaries[name] for name in self.names)
        sizes = [len(family.names) for family in self.families]
        self.first = np.concatenate([[0], np.cumsum(sizes)])
        weights = [one.weights.reshape(size, len(low)) for one, size in zip(self.families, sizes, strict=True)]
        self.weights = np.concatenate(weights)
        grouped, error = list[int](), np.zeros(len(self.names))
        if many.chains.slides is None:
            grouped = list(range(int(self.first[1]), int(self.first[2])))
            error[grouped] = many.error
        self.groups = groups = Groups.of(self.boundaries, error, grouped)
        if groups.chains:  # pairs with fewer coordinates; they represent others, and are not boundaries
            stacked, made_of = bundle(groups.chains, len(low)), groups.made_of
            arms = lever_arms(stacked, low, high)
            rows: list[int] = made_of.tolist()
            threshold = np.array([self.boundaries[row].rule.placed_distance for row in rows])
            coarse = ManyAngleBoundaries((), stacked, arms, threshold, error[made_of], (), None)
            self.families = (*self.families, coarse)
            self.first = np.append(self.first, len(self.names) + len(made_of))
            self.weights = np.concatenate([self.weights, coarse.weights])

    def __len__(self) -> int:
        """Return the number of pairs."""
        return len(self.names)

    def bound(self, which: Indices, centre: Array, half: Array) -> Affine:
        """Return the bounds of pairs `which` (N,) over the boxes `centre +- half` (N, n)."""
        n = centre.shape[1]
        numbers = np.empty((5, len(which)))
        found = Affine(numbers[0], np.zeros((len(which), n)), *numbers[1:])
        for index, family in enumerate(self.families):
            rows = np.flatnonzero((which >= self.first[index]) & (which < self.first[index + 1]))
            if not len(rows):
                continue
            mine = which[rows] - self.first[index]
            if isinstance(family, ManyAngleBoundaries) and family.chains.slides is None:
                part = bound_points(family, mine, centre[rows], half[rows])
            else:
                seen = family.enclose_box(mine, centre[rows], half[rows])
                value = seen.value - seen.error
                lower = np.where(seen.clear, np.maximum(seen.lower, np.finfo(float).tiny), np.minimum(seen.lower, 0.0))
                upper = _upper(family, mine, centre[rows], half[rows], seen.value + seen.error)
                part = Affine(value, np.zeros((len(rows), n)), value - lower, value - lower, lower, upper)
            for name in ("value", "slope", "rest", "moved", "lower", "upper"):
                getattr(found, name)[rows] = getattr(part, name)
        return found

    def bound_nodes(self, nodes: Indices, centre: Array, half: Array) -> Affine:
        """Return the bounds of nodes of `groups`: for a group, a lower bound of all its pairs, and no upper bound."""
        found = self.bound(self.groups.pair[nodes], centre, half)
        extra = self.groups.extra[nodes]
        upper = np.where(nodes < len(self), found.upper, np.inf)
        value, lower = found.value - extra, found.lower - extra
        return Affine(value, found.slope, found.rest, found.moved, lower, upper)

    def gradients(self, which: Indices, Q: Array) -> Array:
        """Return the gradients (N, n) of the signed clearances of pairs `which` at Q; zero if there is no gradient."""
        found = np.zeros_like(Q)
        for pair in np.unique(which):
            rows = which == pair
            found[rows] = np.nan_to_num(self.boundaries[int(pair)].rule.gradients(Q[rows]))
        return found

    def slopes(self, which: Indices, Q: Array) -> Array:
        """Return the gradients (N, n), those of the affine bounds if they exist."""
        slope = self.bound(which, Q, np.zeros_like(Q)).slope
        flat = np.flatnonzero(~np.any(slope != 0.0, axis=1))
        if len(flat):
            slope[flat] = self.gradients(which[flat], Q[flat])
        return slope

    def signed(self, which: Indices, Q: Array) -> Array:
        """Return the signed clearances (N,) of pairs `which` at Q (N, n), as computed [m]."""
        return self.bound(which, Q, np.zeros_like(Q)).value


def bound_points(family: ManyAngleBoundaries, which: Indices, centre: Array, half: Array) -> Affine:
    """Return the bounds of pairs of points without prismatic joints: one pass forwards, one pass back."""
    chains, k = family.chains, family.chains.rotations
    count = len(which)
    C = chains.coefficients[which]
    phi = np.matmul(C, centre[:, :, None])[:, :, 0]
    wide = np.matmul(np.abs(C), half[:, :, None])[:, :, 0]
    cos, sin = np.cos(phi), np.sin(phi)
    axes = chains.axes[which]
    offsets = chains.offsets[which]
    r = offsets[:, k].T.copy()
    tails: list[Array] = []
    for i in reversed(range(k)):
        u, c, s = axes[:, i].T, cos[:, i], sin[:, i]
        r = _turned(u, c, s, r)
        tails.append(r)  # R_i x_i, in the frame before rotation i
        r = r + offsets[:, i].T
    norm = np.sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2])
    w = np.divide(r, norm, out=np.zeros_like(r), where=norm > 0.0)
    rates, across = np.empty((count, k)), list[Array]()
    bent_down, bent = np.zeros(count), np.zeros(count)
    for i in range(k):
        u = axes[:, i].T
        x = tails[k - 1 - i]
        rates[:, i] = (
            w[0] * (u[1] * x[2] - u[2] * x[1]) + w[1] * (u[2] * x[0] - u[0] * x[2]) + w[2] * (u[0] * x[1] - u[1] * x[0])
        )
        speed = _cross(u, x)
        across.append(_cross(w, u))
        for other, m in enumerate(across):  # H_ji = (n x u_j) . (u_i x X_i), in the frame before rotation i
            second = np.einsum("in,in->n", m, speed) * wide[:, i] * wide[:, other]
            bent += np.abs(second) * (0.5 if other == i else 1.0)
            bent_down += 0.5 * np.maximum(-second, 0.0) if other == i else np.abs(second)
        if i + 1 < k:
            w = _turned(u, cos[:, i], -sin[:, i], w)
            across = [_turned(u, cos[:, i], -sin[:, i], m) for m in across]
    slope = np.matmul(rates[:, None], C)[:, 0]
    rho = family.arms[which]
    total = np.cumsum(wide, axis=1)
    square = total * total
    K = np.einsum("nk,nk->n", rho, np.diff(square, axis=1, prepend=0.0))
    error = family.error[which]
    off = error * (1.0 + total[:, -1]) if k else error
    third = np.einsum("nk,nk->n", rho, np.diff(square * total, axis=1, prepend=0.0)) / 6.0
    third += error * square[:, -1] if k else 0.0  # the rounding of H
    value = norm - family.threshold[which] - error
    moved = np.einsum("nk,nk->n", rho, wide) * INFLATION
    rest = np.minimum(0.5 * K, bent_down + third) * INFLATION + (off - error)
    linear = np.einsum("ni,ni->n", np.abs(slope), half) * INFLATION
    lower = value - np.minimum(moved + (off - error), rest + linear)
    # |r_0 + J d| has a part along n of at most |r_0| + sum |g_j| h_j, and one normal to n of at most the motion of r.
    both = np.minimum(0.5 * K, bent + third) * INFLATION + (off - error)
    most = np.hypot(norm + linear, moved) * INFLATION + both
    upper = np.minimum(norm + moved + (off - error), most) - family.threshold[which] + error
    return Affine(value, slope, rest, moved, lower, upper)


def _upper(family: Family, which: Indices, centre: Array, half: Array, value: Array) -> Array:
    """Return an upper bound (N,) over boxes of signed clearances that are at most `value` at the centre."""
    if not isinstance(family, OneAngleBoundaries):
        return value + np.einsum("ni,ni->n", family.weights[which], half) * INFLATION
    c = family.angles[which]
    middle, wide = np.einsum("ni,ni->n", c, centre), np.einsum("ni,ni->n", np.abs(c), half)
    _, far = family.chains.extremes(which, middle - wide, middle + wide)
    slack, gap = family.angle_error[which], family.gap[which]
    beyond = (middle + wide + slack < gap[:, 0]) | (middle - wide - slack > gap[:, 1])
    stopped = np.where(beyond, -np.finfo(float).tiny, np.inf)
    return np.where(family.is_stop[which], stopped, far - family.threshold[which] + family.error[which])


def _cross(a: Array, b: Array) -> Array:
    return np.stack((a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]))


def _turned(u: Array, cos: Array, sin: Array, x: Array) -> Array:
    along = (u[0] * x[0] + u[1] * x[1] + u[2] * x[2]) * (1.0 - cos)
    return np.stack(
        (
            x[0] * cos + along * u[0] + sin * (u[1] * x[2] - u[2] * x[1]),
            x[1] * cos + along * u[1] + sin * (u[2] * x[0] - u[0] * x[2]),
            x[2] * cos + along * u[2] + sin * (u[0] * x[1] - u[1] * x[0]),
        )
    )
