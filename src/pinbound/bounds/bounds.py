"""Certified bounds of a chain's norm along a motion and over a box, for many chains at once.

With effective angles `phi_i = c_i . q`, every point beyond rotation i is at most its lever arm `rho_i` away from the
axis, so `|dr/dphi_i| <= rho_i` and, for i <= j, `|d^2 r / dphi_i dphi_j| <= rho_j`. From the middle of a motion (or
the centre of a box) with half-widths `h_i` of the angles this gives

    |r| >= |r_0| - sum_i rho_i h_i                                      (first order)
    |r| >= min |r_0 + tau r'_0| - sum_j rho_j (c_j^2 - c_(j-1)^2) / 2   (second order), c_j = h_1 + ... + h_j.

`docs/certificates.md` proves both, also with prismatic joints; `rounding` bounds the rounding errors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from pinbound.geometry.rotations import rotate
from pinbound.path.chain import Chain
from pinbound.tolerances import INFLATION
from pinbound.typing import Array, Indices

__all__ = [
    "Bundle",
    "Expansion",
    "OneAngle",
    "Terms",
    "along_motion",
    "bends_over_box",
    "box_terms",
    "bundle",
    "lever_arms",
    "motion_terms",
    "one_angle",
    "over_box",
]


@dataclass(frozen=True)
class Bundle:
    """m chains, padded with rotations by zero to the same number k of rotations.

    Attributes:
        offsets: (m, k + 1, 3) [m].
        slides: (m, k + 1, 3, n), or None without prismatic joints.
        axes: (m, k, 3) unit vectors.
        coefficients: (m, k, n).
        scale: (m,) [m], the length of each path before reduction.
    """

    offsets: Array
    slides: Array | None
    axes: Array
    coefficients: Array
    scale: Array

    @property
    def rotations(self) -> int:
        """The number k of rotations."""
        return self.axes.shape[1]

    def take(self, rows: Indices) -> Bundle:
        """Return some of the chains."""
        slides = None if self.slides is None else self.slides[rows]
        return Bundle(self.offsets[rows], slides, self.axes[rows], self.coefficients[rows], self.scale[rows])


@dataclass(frozen=True)
class Expansion:
    """Bounds of `q(u)`, u in [0, 1], on each of N short pieces of a motion.

    Derivatives are by u, so a piece of half the length has half the slope. Sets are given as convex hulls of points:
    `q'(u)` lies in the hull of `slopes`, widened by `slope_radius`.

    Attributes:
        middle: (N, n), q(1/2) [rad or m], as computed.
        middle_radius: (N, n) or (n,), the largest error of `middle`.
        slope: (N, n), q'(1/2).
        values: (N, p, n), whose hull, widened by `value_radius`, holds q(u).
        value_radius: (N, n) or (n,).
        slopes: (N, p, n).
        slope_radius: (N, n) or (n,).
        bends: (N, p, n), the same for q''; None if q'' has no bound.
        bend_radius: (N, n) or (n,).
    """

    middle: Array
    middle_radius: Array
    slope: Array
    values: Array
    value_radius: Array
    slopes: Array
    slope_radius: Array
    bends: Array | None
    bend_radius: Array

    def take(self, rows: Indices) -> Expansion:
        """Return the rows of some pieces, in this order; rows may repeat."""

        def radius(one: Array) -> Array:
            return one[rows] if one.ndim > 1 else one

        return Expansion(
            middle=self.middle[rows],
            middle_radius=radius(self.middle_radius),
            slope=self.slope[rows],
            values=self.values[rows],
            value_radius=radius(self.value_radius),
            slopes=self.slopes[rows],
            slope_radius=radius(self.slope_radius),
            bends=None if self.bends is None else self.bends[rows],
            bend_radius=radius(self.bend_radius),
        )


_TURN = 2.0 * np.pi


@dataclass(frozen=True)
class OneAngle:
    """m chains of one rotation, without prismatic joints: `norm^2 = smallest^2 + 4 |p||s| sin^2((phi - angle) / 2)`.

    Attributes:
        coefficients: (m, n), c of `phi = c . q`.
        angle: (m,) phi* [rad], the angle of the smallest norm.
        smallest: (m,) [m].
        reach: (m,) `4 |p| |s|` [m^2].
        arm: (m,) `min(|p|, |s|)` [m], perpendicular to the axis.
    """

    coefficients: Array
    angle: Array
    smallest: Array
    reach: Array
    arm: Array

    @cached_property
    def weights(self) -> Array:
        """(m, n) `abs(coefficients)`."""
        return np.abs(self.coefficients)

    def norm(self, which: Indices | slice, phi: Array) -> Array:
        """Return the norms (N,) of chains `which` at the angles phi (N,) [m]."""
        sine = np.sin((phi - self.angle[which]) / 2.0)
        return np.sqrt(self.smallest[which] ** 2 + self.reach[which] * sine * sine)

    def extremes(self, which: Indices, lower: Array, upper: Array) -> tuple[Array, Array]:
        """Return the smallest and the largest norm while phi runs over [lower, upper], (N,) each [m]."""
        far = np.maximum(self.norm(which, lower), self.norm(which, upper))
        start = lower - self.angle[which] - np.pi
        passes = np.ceil(start / _TURN) * _TURN - start <= upper - lower
        top = np.sqrt(self.smallest**2 + self.reach)[which]
        return self.least(which, lower, upper), np.where(passes, top, far)

    def least(self, which: Indices | slice, lower: Array, upper: Array) -> Array:
        """Return the smallest norm (N,) while phi runs over [lower, upper] [m]."""
        near = np.minimum(self.norm(which, lower), self.norm(which, upper))
        start = lower - self.angle[which]
        meets = np.ceil(start / _TURN) * _TURN - start <= upper - lower
        return np.where(meets, self.smallest[which], near)


def bundle(chains: Sequence[Chain], n: int) -> Bundle:
    """Return a bundle of chains over n coordinates."""
    m, k = len(chains), max((chain.rotations for chain in chains), default=0)
    offsets, slides = np.zeros((m, k + 1, 3)), np.zeros((m, k + 1, 3, n))
    axes, coefficients = np.tile(np.array([0.0, 0.0, 1.0]), (m, k, 1)), np.zeros((m, k, n))
    for row, chain in enumerate(chains):
        own = chain.rotations
        offsets[row, : own + 1], slides[row, : own + 1] = chain.offsets, chain.slides
        axes[row, :own], coefficients[row, :own] = chain.axes, chain.coefficients
    scale = np.array([chain.scale for chain in chains])
    return Bundle(offsets, slides if np.any(slides) else None, axes, coefficients, scale)


def one_angle(chains: Sequence[Chain], n: int) -> OneAngle:
    """Return chains in closed form; every chain must have one rotation and no prismatic joint."""
    rows: list[tuple[float, float, float, float]] = []
    for chain in chains:
        axis, (p, s) = chain.axes[0], chain.offsets
        p_across, s_across = p - axis * (axis @ p), s - axis * (axis @ s)
        lengths = float(np.linalg.norm(p_across)), float(np.linalg.norm(s_across))
        angle = np.arctan2(axis @ np.cross(s_across, -p_across), -s_across @ p_across)
        smallest = np.hypot(axis @ (p + s), lengths[0] - lengths[1])
        rows.append((float(angle), float(smallest), 4.0 * lengths[0] * lengths[1], min(lengths)))
    table = np.array(rows).reshape(-1, 4)
    coefficients = np.array([chain.coefficients[0] for chain in chains]).reshape(len(rows), n)
    return OneAngle(coefficients, table[:, 0], table[:, 1], table[:, 2], table[:, 3])


def _slide_lengths(chains: Bundle, lower: Array, upper: Array) -> Array:
    """Return the largest translation of each block while q stays in [lower, upper], (m, k + 1) [m]."""
    if chains.slides is None:
        return np.zeros(chains.offsets.shape[:2])
    farthest = np.maximum(np.abs(lower), np.abs(upper))
    return np.linalg.norm(chains.slides, axis=2) @ farthest


def lever_arms(chains: Bundle, lower: Array, upper: Array, blocks: tuple[Array, Array] | None = None) -> Array:
    """Return the lever arm of every rotation while q stays in a box, (m, k) [m].

    From the tail, with bounds `a_i` and `rho_i` of the parts beyond rotation i along and perpendicular to its axis:
    `rho_i = |across b_i| + min(|x|, |sin| a_(i+1) + rho_(i+1))`, with the sine of the angle between the two axes.

    Args:
        chains: The chains.
        lower: (n,) lower corner of the box; only coordinates of prismatic joints matter.
        upper: (n,) upper corner.
        blocks: The largest `|u_i . b_i|` and `|u_i x b_i|` (m, k) [m] of the blocks behind each rotation, over many
            vertices with these rotations; None: those of the chains.
    """
    m, k = chains.axes.shape[:2]
    slid = _slide_lengths(chains, lower, upper)
    arms = np.zeros((m, k))
    along_next, across_next = np.zeros(m), np.zeros(m)
    for i in reversed(range(k)):
        axis, block = chains.axes[:, i], chains.offsets[:, i + 1]
        if blocks is None:
            along, across = np.abs(np.einsum("mi,mi->m", axis, block)), np.linalg.norm(np.cross(axis, block), axis=1)
        else:
            along, across = blocks[0][:, i], blocks[1][:, i]
        along, across = along + slid[:, i + 1], across + slid[:, i + 1]
        if i + 1 < k:
            following = chains.axes[:, i + 1]
            sine = np.linalg.norm(np.cross(axis, following), axis=1)
            cosine = np.abs(np.einsum("mi,mi->m", axis, following))
            length = np.hypot(along_next, across_next)
            across = across + np.minimum(length, sine * along_next + across_next)
            along = along + np.minimum(length, cosine * along_next + sine * across_next)
        arms[:, i] = across
        along_next, across_next = along, across
    return arms * INFLATION


def along_motion(chains: Bundle, arms: Array, which: Indices, piece: Expansion, error: Array) -> tuple[Array, Array]:
    """Return, for N pieces, the norm in the middle and a lower bound of the norm on the piece.

    Args:
        chains: The chains.
        arms: (m, k) lever arms.
        which: (N,) the chain for each piece.
        piece: Bounds of the motion.
        error: (N,) rounding bound of a norm [m].

    Returns:
        Norm in the middle (N,), as computed, and the lower bound (N,). The rounding of the bound is subtracted, but
        `error` of the norm is not.
    """
    found = motion_terms(chains, arms, which, piece)
    norm = np.sqrt(_dot(found.r, found.r))
    lower = norm - found.moved * INFLATION
    if found.second is not None:
        lower = np.maximum(lower, _nearest(found.r, found.rates[0]) - found.second / 8.0 * INFLATION)
    return norm, lower - found.aside * INFLATION - error * found.wide


@dataclass(frozen=True)
class Terms:
    """The terms of the bounds of N pieces of a motion, or of N boxes.

    Attributes:
        r: (3, N) in the middle [m].
        rates: Rates of r, (3, N) each [m]: along the piece, or for half the box in each coordinate.
        moved: (N,) bound of the change of r from the middle, by lever arms [m].
        second: (N,) bound of |r''| over the piece, or over the box; None if it is not known.
        aside: (N,) [m], bound of the error of r in the middle, from the error of q.
        wide: (N,) factor on the rounding bound, for rates that cancel.
    """

    r: Array
    rates: tuple[Array, ...]
    moved: Array
    second: Array | None
    aside: Array
    wide: Array


def motion_terms(chains: Bundle, arms: Array, which: Indices, piece: Expansion) -> Terms:
    """Return the terms of chains `which` (N,) on N pieces."""
    C = chains.coefficients[which]
    rates = np.einsum("nki,ni->kn", C, piece.slope)
    most = _hull(np.einsum("nki,npi->npk", C, piece.slopes)) + _spread(np.abs(C), piece.slope_radius)
    r, v = _value_and_rate(chains, which, piece.middle, piece.slope, np.einsum("nki,ni->kn", C, piece.middle), rates)
    slides = chains.slides[which] if chains.slides is not None else None
    slid = _slid(slides, piece.slopes, piece.slope_radius)
    rho, second = arms[which], None
    if piece.bends is not None:
        bend = _hull(np.einsum("nki,npi->npk", C, piece.bends)) + _spread(np.abs(C), piece.bend_radius)
        second = _second(rho, most, slid) + np.einsum("nk,nk->n", rho, bend)
        second = second + _slid(slides, piece.bends, piece.bend_radius).sum(axis=1)
    aside = np.einsum("nk,nk->n", rho, _spread(np.abs(C), piece.middle_radius))
    aside = aside + _slid(slides, np.zeros_like(piece.slopes[:, :1]), piece.middle_radius).sum(axis=1)
    return Terms(
        r=r,
        rates=(v,),
        moved=0.5 * (np.einsum("nk,nk->n", rho, most) + slid.sum(axis=1)),
        second=second,
        aside=aside,
        wide=np.einsum("nki,ni->nk", np.abs(C), np.abs(piece.slope)).max(axis=1, initial=0.0),
    )


def over_box(
    chains: Bundle, arms: Array, which: Indices, centre: Array, half: Array, error: Array
) -> tuple[Array, Array]:
    """Return, for N boxes `centre +- half` (N, n) each, the norm at the centre and a lower bound over the box.

    First order: lever arms. Second order: `|r| >= r_0/|r_0| . r`, with an exact linear part and a bounded remainder.
    The rounding of the bound is subtracted, but `error` (N,) of the norm is not.
    """
    found = box_terms(chains, arms, which, centre, half)
    norm = np.sqrt(_dot(found.r, found.r))
    unit = np.divide(found.r, norm, out=np.zeros_like(found.r), where=norm > 0.0)
    linear = sum((np.abs(_dot(unit, v)) for v in found.rates), start=np.zeros(len(which)))
    second = linear + 0.5 * (found.second if found.second is not None else np.inf)
    return norm, norm - np.minimum(found.moved, second) * INFLATION - error * found.wide


def bends_over_box(chains: Bundle, arms: Array, which: Indices, half: Array) -> tuple[Array, Array]:
    """Return, for chains `which` (N,), a bound of |r''| over boxes of half-widths `half` (n,), (N,) [m].

    It does not depend on the positions of the boxes. The second array (N, k) has the largest change of each angle.
    """
    wide: Array = np.abs(chains.coefficients[which]) @ half
    slides = chains.slides[which] if chains.slides is not None else None
    slid = None if slides is None else np.linalg.norm(slides, axis=2) @ half
    return _second(arms[which], wide, slid), wide


def box_terms(
    chains: Bundle,
    arms: Array,
    which: Indices,
    centre: Array,
    half: Array,
    steps: Array | None = None,
    off: Array | None = None,
) -> Terms:
    """Return the terms of chains `which` (N,) on the boxes `centre +- half` (N, n).

    Args:
        chains: The chains.
        arms: (m, k) lever arms.
        which: (N,).
        centre: (N, n).
        half: (N, n), the largest distance of each coordinate from the centre.
        steps: (p, N, n): the coordinates are `centre + sum_p s_p steps_p + e`, s_p in [-1, 1]; None: each coordinate
            alone.
        off: (N, n) bounds of |e|.
    """
    C = chains.coefficients[which]
    phi = np.einsum("nki,ni->kn", C, centre)
    wide = np.einsum("nki,ni->nk", np.abs(C), half)
    slides = chains.slides[which] if chains.slides is not None else None
    nothing = np.zeros((len(which), 1, half.shape[1]))
    slid = _slid(slides, nothing, half)
    rho, (count, n) = arms[which], half.shape
    if steps is None:
        steps = np.zeros((max(n, 1), count, n))  # half the box in each coordinate alone, for all coordinates at once
        steps[np.arange(n), :, np.arange(n)] = half.T
    p = len(steps)
    turns = np.einsum("nki,jni->kjn", C, steps).reshape(len(phi), p * count)
    again, many = np.tile(which, p), np.tile(phi, (1, p))
    r, v = _value_and_rate(chains, again, np.tile(centre, (p, 1)), steps.reshape(p * count, n), many, turns)
    r, rates = r[:, :count], v.reshape(3, p, count).transpose(1, 0, 2)
    aside = np.zeros(len(which))
    if off is not None:
        aside = np.einsum("nk,nk->n", rho, _spread(np.abs(C), off)) + _slid(slides, nothing, off).sum(axis=1)
    return Terms(
        r=r,
        rates=tuple(rates),
        moved=np.einsum("nk,nk->n", rho, wide) + slid.sum(axis=1),
        second=_second(rho, wide, slid),
        aside=aside,
        wide=wide.sum(axis=1),
    )


def _hull(points: Array) -> Array:
    return np.abs(points).max(axis=1)


def _spread(coefficients: Array, radius: Array) -> Array:
    if not np.any(radius):
        return np.zeros(coefficients.shape[:2])
    return np.einsum("nki,ni->nk", coefficients, np.broadcast_to(radius, (len(coefficients), radius.shape[-1])))


def _slid(slides: Array | None, points: Array, radius: Array) -> Array:
    """Return the largest translation rate of each block, (N, k + 1)."""
    if slides is None:
        return np.zeros((len(points), 1))
    vectors = np.einsum("nkci,npi->npkc", slides, points)
    lengths = np.linalg.norm(vectors, axis=3).max(axis=1)
    return lengths + _spread(np.linalg.norm(slides, axis=2), radius)


def _second(rho: Array, most: Array, slid: Array | None = None) -> Array:
    """Return the bound of `|r''|` from rates: pairs of rotations, and rotations with translations beyond them."""
    total = np.cumsum(most, axis=1)
    square = total * total
    second = np.einsum("nk,nk->n", rho, np.diff(square, axis=1, prepend=0.0))
    if slid is not None and slid.shape[1] > 1:
        second = second + 2.0 * np.einsum("nk,nk->n", total, slid[:, 1:])
    return second


def _value_and_rate(chains: Bundle, which: Indices, q: Array, slope: Array, phi: Array, rates: Array) -> Any:
    """Return r and r' (3, N) of each chain at its q, from the tail (the loop of `numeric`, one chain for each row)."""
    k, slides = chains.rotations, chains.slides
    x = chains.offsets[which, k].T.copy()
    v = np.zeros_like(x)
    if slides is not None:
        x += np.einsum("nci,ni->cn", slides[which, k], q)
        v += np.einsum("nci,ni->cn", slides[which, k], slope)
    for i in reversed(range(k)):
        axis = chains.axes[which, i].T
        cos, sin = np.cos(phi[i]), np.sin(phi[i])
        x, v = (np.stack(rotate(axis, cos, sin, one)) for one in (x, v))
        v += _cross(axis, x) * rates[i]
        x += chains.offsets[which, i].T
        if slides is not None:
            x += np.einsum("nci,ni->cn", slides[which, i], q)
            v += np.einsum("nci,ni->cn", slides[which, i], slope)
    return x, v


def _nearest(r: Array, v: Array) -> Array:
    """Return `min |r + tau v|` over tau in [-1/2, 1/2]; a tau near the minimum suffices, because |v| is rounded."""
    speed = _dot(v, v)
    tau = np.divide(-_dot(r, v), speed, out=np.zeros_like(speed), where=speed > 0.0)
    nearest = r + v * np.clip(tau, -0.5, 0.5)
    return np.sqrt(_dot(nearest, nearest))


def _dot(a: Array, b: Array) -> Array:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(axis: Array, x: Array) -> Array:
    u, v, w = axis
    return np.stack((v * x[2] - w * x[1], w * x[0] - u * x[2], u * x[1] - v * x[0]))
