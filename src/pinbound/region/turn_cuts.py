"""The cuts of the angle of a loop's X, in a slice of two coordinates: the walls of the limits `"LOOP turn"`.

If X can go around zero, its angle is taken within half a turn of home's angle. Then passive joints jump by a full turn
across the cut `Im(X e^(-i r)) = 0, Re(X e^(-i r)) < 0`, where r is the reference. `Im(X e^(-i r))` is a sum of sines of
linear forms. Its derivatives have bounds over the whole window, so its zeros are traced like other smooth curves
(`contours`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
import shapely

from pinbound.bounds.derivative_bounds import LeverArms
from pinbound.exceptions import UnsupportedError
from pinbound.loops.linkages import Linkage
from pinbound.loops.through_loops import LiftedPlane
from pinbound.region.contours import trace
from pinbound.region.deadline import Deadline
from pinbound.tolerances import REGION_ACCURACY
from pinbound.typing import Array
from pinbound.values import Value, read_only

__all__ = ["Cut", "Slit", "TurnFunction", "cuts_of", "slits_in"]

gis = cast(Any, shapely)  # its stubs know only part of what its functions take


@dataclass(frozen=True, eq=False)
class TurnFunction:
    """`g(x) = Im(X(x) e^(-i r))` over the slice in units of its scales.

    `X = sum_k (v_k + L_k x) e^(i (c_k x + p_k))`.

    Attributes:
        rates: (m, 2) c.
        phases: (m,) p [rad], minus r.
        vectors: (m,) complex v [m].
        slides: (m, 2) complex L [m].
        arms: Bounds over the window.
        threshold: 0.
    """

    rates: Array
    phases: Array
    vectors: Array
    slides: Array
    arms: LeverArms
    threshold: float = 0.0

    @classmethod
    def over(cls, one: Linkage, plane: LiftedPlane, scales: Array, window: Array) -> TurnFunction:
        """Bound the derivatives over a window (2, 2), rows lower and upper, in units of the scales."""
        held, indices = plane.at.copy(), list(plane.indices)
        held[indices] = 0.0
        n = len(held)
        rates, phases = one.angles[:, indices] * scales, one.angles[:, :n] @ held - one.reference
        vectors = (one.vectors + one.slides[:, :, :n] @ held) @ np.array([1.0, 1j])
        slides = np.einsum("kcn,c->kn", one.slides[:, :, indices], np.array([1.0, 1j])) * scales
        far = np.max(np.abs(window), axis=0)
        long, turned, slid = np.abs(vectors) + np.abs(slides) @ far, np.abs(rates), np.abs(slides)
        cross = np.einsum("ki,kj->ij", slid, turned)
        second = np.einsum("k,ki,kj->ij", long, turned, turned) + cross + cross.T
        arms = LeverArms(float(long.sum()), long @ turned + slid.sum(axis=0), second)
        return cls(rates, phases, vectors, slides, arms)

    @property
    def scale(self) -> float:
        """The largest length of X [m]; rounding is relative to it."""
        return self.arms.length

    def _parts(self, X: Array) -> tuple[Array, Array]:
        turned = np.exp(1j * (X @ self.rates.T + self.phases))
        return self.vectors + X @ self.slides.T, turned

    def moved(self, X: Array) -> Array:
        """Return `X e^(-i r)` (N,), complex [m]."""
        long, turned = self._parts(X)
        return np.einsum("nk,nk->n", long, turned)

    def value(self, X: Array) -> Array:
        """Return g (N,) [m]."""
        return self.moved(X).imag

    def value_gradient(self, X: Array) -> tuple[Array, Array]:
        """Return g (N,) and its gradient (N, 2)."""
        long, turned = self._parts(X)
        gradient = np.einsum("nk,ki->ni", turned, self.slides) + 1j * np.einsum("nk,ki->ni", long * turned, self.rates)
        return np.einsum("nk,nk->n", long, turned).imag, gradient.imag

    def parts(self, X: Array) -> tuple[Array, Array, Array, Array]:
        """Return g, its gradient, g again, and the gradient's sizes."""
        value, gradient = self.value_gradient(X)
        return value, gradient, value, np.abs(gradient)

    def curvature(self, length: Array, slopes: Array, half: Array) -> Array:
        """Return bounds (N, 2, 2) of g's Hessian."""
        return np.broadcast_to(self.arms.second, (len(half), 2, 2))


@dataclass(frozen=True, eq=False)
class Cut:
    """One piece of a cut.

    Attributes:
        name: ``"LOOP turn"``.
        points: (k, 2), in units of the scales.
        function: The function that is zero on it.
        chord_error: The largest distance of the cut from the polyline.
    """

    name: str
    points: Array
    function: TurnFunction
    chord_error: float


def cuts_of(
    plane: LiftedPlane, scales: Array, window: Array, accuracy: float, deadline: Deadline | None = None
) -> tuple[Cut, ...]:
    """Return the cuts in a window (2, 2), in units of the scales, to an accuracy.

    Raises:
        UnsupportedError: If another loop moves X, and its angle may reach the cut in the window; or if time is up.
    """
    found: list[Cut] = []
    lower, upper = plane.configurations(window * scales)
    box = plane.lift.over(lower[None], upper[None])
    for one, columns in zip(plane.lift.linkages, plane.lift.columns, strict=True):
        moves = [index for index in one.inputs if np.any(one.angles[:, index]) or np.any(one.slides[:, :, index])]
        if one.ahead >= 0 or not _reaches(moves, plane):
            continue
        low, high = float(box.lower[0, columns[3]]), float(box.upper[0, columns[3]])
        if -math.pi < low and high < math.pi:
            continue
        if max(moves) >= len(plane.at):
            raise UnsupportedError(
                f"another loop moves loop {one.name!r}, and its arms may make a full turn in this window, which is "
                "not supported; give a smaller window (window=, --window)"
            )
        function = TurnFunction.over(one, plane, scales, window)
        contour = trace(function, window, accuracy, deadline)
        for line in contour.lines:
            name = plane.lift.names[columns[3]]
            found += [Cut(name, part, function, contour.chord_error) for part in _behind(function, line)]
    return tuple(found)


@dataclass(frozen=True, eq=False)
class Slit(Value):
    """A wall that ends inside a region: across it passive joints differ by a full turn, so no motion crosses it.

    Attributes:
        name: ``"LOOP turn"``, the limit that a motion across it would violate.
        points: (k, 2) [rad or m].
    """

    name: str
    points: Array


def slits_in(
    plane: LiftedPlane, scales: Array, window: Array, polygon: Any, edges: Mapping[str, Any], accuracy: float
) -> tuple[Slit, ...]:
    """Return the parts of cuts inside a polygon that are not its edges, all in radians and metres.

    Args:
        plane: The plane.
        scales: (2,), as in `Slice.scales`.
        window: (2, 2), as in `Slice.window`.
        polygon: The region.
        edges: The edges of the polygon that are cuts, by name.
        accuracy: The largest error of the polygon's edges.
    """
    found: list[Slit] = []
    for cut in cuts_of(plane, scales, window / scales, REGION_ACCURACY):
        inner = gis.intersection(gis.linestrings(cut.points * scales), polygon)
        for part in gis.get_parts(gis.line_merge(inner) if inner.geom_type == "MultiLineString" else inner):
            points = gis.get_coordinates(part)
            edge = edges.get(cut.name)
            away = part.length if edge is None else float(gis.distance(gis.points(points), edge).max())
            if away > accuracy:
                found.append(Slit(cut.name, read_only(points)))
    return tuple(found)


def _reaches(moves: Sequence[int], plane: LiftedPlane) -> bool:
    """Return whether one of the slice's coordinates moves X, directly or through another loop."""
    moved = set(plane.indices)
    for one, columns in zip(plane.lift.linkages, plane.lift.columns, strict=True):
        if moved & set(one.inputs):
            moved |= set(columns)
    return bool(moved & set(moves))


def _behind(function: TurnFunction, line: Array) -> list[Array]:
    """Return the pieces of a zero line on which X points away from the reference, one chord longer at each end."""
    away = function.moved(line).real < 0.0
    kept = away.copy()
    kept[1:] |= away[:-1]
    kept[:-1] |= away[1:]
    edges = np.flatnonzero(np.diff(np.concatenate(([False], kept, [False])).astype(int)))
    return [line[a:b] for a, b in edges.reshape(-1, 2).tolist() if b - a > 1]
