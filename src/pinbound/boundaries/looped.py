"""Boundaries of a robot with loops that are not parallelograms: those over z, evaluated at `z = F(q)`.

A question that cannot be answered through such a loop is refused with the loop's name: F is never treated as linear.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pinbound.boundaries.boundary import Boundary, checked_window, one_configuration
from pinbound.boundaries.boundary_set import BoundarySet
from pinbound.boundaries.spans import CoordinateLimits, Smallest
from pinbound.evaluate.depth import Penetration
from pinbound.exceptions import DimensionError
from pinbound.limits.univariate import AllowedArcsTable
from pinbound.loops.lift import Lift
from pinbound.loops.loop_coupling import refuse_linear
from pinbound.model.coupling import LinearLimit, as_configurations, coordinate_index
from pinbound.path.kind import Kind
from pinbound.typing import Array

__all__ = ["LoopBoundary", "LoopBoundarySet", "formula_joints", "over_z"]


def _chained(gradients: Array, J: Array) -> Array:
    """Return `g_z dz/dq` for gradients (N, ..., n + k) and J (N, n + k, n), whose first n rows are the identity."""
    n = J.shape[2]
    found, between = gradients[..., :n].copy(), (slice(None), *(None,) * (gradients.ndim - 2))
    for index in range(n, J.shape[1]):
        if not np.any(gradients[..., index]):
            continue
        for a in range(n):
            if np.any(J[:, index, a]):
                found[..., a] += gradients[..., index] * J[:, index, a][between]
    return found


class LoopBoundary(Boundary):
    """A boundary through loops that are not parallelograms.

    Attributes:
        opened: The same boundary over z, in which the passive joints are coordinates.
        lift: `z = F(q)`.
        closing: The limits over z that keep the loops closed.
    """

    opened: Boundary
    lift: Lift
    closing: tuple[LinearLimit, ...]

    def __init__(self, opened: Boundary, lift: Lift, closing: Sequence[LinearLimit] = ()) -> None:
        """Store a boundary over z."""
        n = len(lift.coordinates)
        own = ("name", "point_a", "point_b", "min_distance", "contact_tolerance", "place_error", "stop")
        for name in own:
            object.__setattr__(self, name, getattr(opened, name))
        home = None if opened.home is None else opened.home[:n]
        values: dict[str, object] = {"robot_coordinates": lift.coordinates, "home": home, "opened": opened}
        values |= {"lift": lift, "closing": tuple(closing)}
        for name, value in values.items():
            object.__setattr__(self, name, value)

    def __getattr__(self, name: str) -> Any:
        """Refuse the path over q, which does not exist.

        Raises:
            UnsupportedError: For `path`.
            AttributeError: For any other name.
        """
        if name == "path":
            self._refuse("its path over q does not exist")
        raise AttributeError(name)

    def _refuse(self, what: str) -> NoReturn:
        refuse_linear(f"boundary {self.name!r}: {what}", self.lift)

    def __repr__(self) -> str:
        """Return name, kind, points and coordinates."""
        return repr(self.opened).rsplit("; ", 1)[0] + f"; depends on {', '.join(self.coordinates)}>"

    @property
    def kind(self) -> Kind:
        """The relation of the two links in the tree, without the pin of the loop."""
        return self.opened.kind

    @property
    def ancestor(self) -> str:
        """The lowest common ancestor of the two links in the tree. Helper links do not count."""
        return self.opened.ancestor

    @property
    def coordinates(self) -> tuple[str, ...]:  # type: ignore[override]
        """The active coordinates that the norm depends on, also through loops."""
        uses = set(self.opened.path.minimal.coordinates)
        for one in reversed(self.lift.linkages):
            if uses & set(one.passive):
                uses |= set(one.inputs)
        return tuple(name for index, name in enumerate(self.robot_coordinates) if index in uses)

    @property
    def is_direct(self) -> bool:
        """Whether its path contains no passive joint of these loops."""
        return max(self.opened.path.minimal.coordinates, default=0) < len(self.robot_coordinates)

    @property
    def contact_distance(self) -> float:
        """The largest separation that is contact [m]."""
        return self.opened.contact_distance

    @property
    def is_stop(self) -> bool:
        """Whether contact is the angle at which two arms align."""
        return self.opened.is_stop

    @property
    def has_size(self) -> bool:
        """Whether it keeps bodies apart, and not two points of zero threshold."""
        return self.opened.has_size

    @property
    def contacts(self) -> None:  # type: ignore[override]
        """None: one effective angle in z is not one in q."""
        return None

    def vector(self, q: ArrayLike) -> Array:
        """Return `r = x_a - x_b` in the frame of the ancestor link: (3,) or (N, 3) [m]."""
        return self.opened.vector(self.lift(q))

    def norm(self, q: ArrayLike) -> Any:
        """Return `beta = |r|` [m]: a float, or (N,)."""
        return self.opened.norm(self.lift(q))

    def nearest(self, q: ArrayLike) -> Array:
        """Return the parameters of the nearest points on the segments: (k,) or (N, k) in [0, 1]."""
        return self.opened.nearest(self.lift(q))

    def nearest_points(self, q: ArrayLike) -> Array:
        """Return the nearest points of both marks, (2, 3) or (N, 2, 3) [m] in the frame of the ancestor link."""
        return self.opened.nearest_points(self.lift(q))

    def signed_clearance(self, q: ArrayLike) -> Any:
        """Return the signed clearance: a float, or (N,) [m]; positive is free."""
        return self.opened.signed_clearance(self.lift(q))

    def signed_distance(self, q: ArrayLike) -> Any:
        """Return the distance between the two bodies, or minus their depth: a float, or (N,) [m]."""
        return self.opened.signed_distance(self.lift(q))

    def penetration(self, q: ArrayLike) -> Penetration:
        """Return the depth of overlap, and the direction that separates the bodies."""
        return self.opened.penetration(self.lift(q))

    def signed_gradient(self, q: ArrayLike) -> Array:
        """Return the gradient of the signed clearance, (n,) or (N, n)."""
        return self._gradient(q, self.opened.signed_gradient)

    def gradient(self, q: ArrayLike) -> Array:
        """Return the gradient of the norm, (n,) or (N, n); NaN where the norm is zero."""
        return self._gradient(q, self.opened.gradient)

    def signed_distance_gradient(self, q: ArrayLike) -> Array:
        """Return the gradient of the signed distance, (n,) or (N, n)."""
        return self._gradient(q, self.opened.signed_distance_gradient)

    def _gradient(self, q: ArrayLike, ask: Callable[[Array], Array]) -> Array:
        Q = as_configurations(q, self.robot_coordinates)
        rows = Q if Q.ndim > 1 else Q[None]
        found = _chained(ask(self.lift(rows)), self.lift.jacobians(rows))
        return found if Q.ndim > 1 else found[0]

    def hessian(self, q: ArrayLike) -> Array:
        """Return the Hessian of the norm, (n, n) or (N, n, n): `J^T H_z J + sum_k g_k d^2 z_k / dq^2`."""
        Q = as_configurations(q, self.robot_coordinates)
        rows = Q if Q.ndim > 1 else Q[None]
        Z = self.lift(rows)
        J, H = self.lift.derivatives(rows, order=2)
        found: Array = np.swapaxes(J, 1, 2) @ self.opened.hessian(Z) @ J
        found = found + np.einsum("nz,nzab->nab", self.opened.gradient(Z), H)
        return found if Q.ndim > 1 else found[0]

    def parts(self, start: Array, end: Array) -> bool:
        """Return whether a contact line of a stop lies between two configurations (n,), that is between their z."""
        return self.opened.parts(self.lift(start), self.lift(end))

    def limits(self, coordinate: str, q: ArrayLike, window: tuple[float, float] | None = None) -> Any:
        """Return the values of a coordinate that are not in contact and at which the loops close. Limits do not count.

        Raises:
            UnknownNameError: If the robot has no such coordinate.
            DimensionError: If q is not finite or of another shape, or the window is none.
            UnsupportedError: If the coordinate moves a passive joint on the path, and there is no finite window.
        """
        from pinbound.boundaries.looped_limits import allowed_arcs, moved_by

        index = coordinate_index(coordinate, self.robot_coordinates)
        Q = as_configurations(q, self.robot_coordinates)
        if not np.any(moved_by(self.lift, index)[list(self.opened.path.minimal.coordinates)]):
            return self.opened.limits(coordinate, self.lift(Q), window)
        if window is None:
            self._refuse(f"limits of {coordinate!r} do not repeat through it; give window=(lower, upper)")
        window = checked_window(window)
        if not np.all(np.isfinite(window)):
            self._refuse(f"limits of {coordinate!r} do not repeat through it; give a finite window")
        if not np.all(np.isfinite(Q)):
            raise DimensionError("q holds a number that is not finite; give finite numbers")
        found = [
            allowed_arcs(self.lift, self.opened, self.closing, index, row, window)
            for row in (Q if Q.ndim > 1 else Q[None])
        ]
        if Q.ndim == 1:
            return found[0]
        most = max((len(one.intervals) for one in found), default=0)
        intervals = np.full((len(found), most, 2), np.nan)
        for place, one in enumerate(found):
            intervals[place, : len(one.intervals)] = one.intervals
        return AllowedArcsTable(coordinate, intervals, np.full(len(found), np.inf), window)


class LoopBoundarySet(BoundarySet):
    """The boundaries of a robot with loops that are not parallelograms, evaluated together at `z = F(q)`."""

    def __init__(self, opened: BoundarySet, lift: Lift) -> None:
        """Store the boundaries over z, with their kernel."""
        self.opened, self.lift = opened, lift
        names = lift.toggle_names()
        self._closing = tuple(one for one in opened._limits if one.joint in names)
        looped = [LoopBoundary(one, lift, self._closing) for one in opened]
        super().__init__(looped, lift.coordinates, home=None)

    def select(self, names: str | Iterable[str]) -> LoopBoundarySet:
        """Return a set of some boundaries, in the order of `names`."""
        return LoopBoundarySet(self.opened.select(names), self.lift)

    @property
    def kernel(self) -> Any:  # type: ignore[override]
        """Refused: the kernel is over z."""
        refuse_linear("B.kernel does not exist", self.lift)

    @property
    def signed_kernel(self) -> Any:  # type: ignore[override]
        """Refused: the kernel is over z."""
        refuse_linear("B.signed_kernel does not exist", self.lift)

    def to_casadi(self, name: str = "signed_clearances") -> Any:
        """Refuse: the graph of a loop is not supported."""
        refuse_linear("B.to_casadi is not written", self.lift)

    def vectors(self, Q: ArrayLike) -> Array:
        """Return r of every boundary in its ancestor's frame: (m, 3) for one q, (N, m, 3) for many [m]."""
        return self.opened.vectors(self.lift(Q))

    def hessians(self, Q: ArrayLike) -> Array:
        """Return the Hessians of the norms: (m, n, n) or (N, m, n, n)."""
        array = as_configurations(Q, self._coordinates)
        if not self._boundaries:
            return np.empty((*array.shape[:-1], 0, *(len(self._coordinates),) * 2))
        return np.stack([one.hessian(array) for one in self], axis=array.ndim - 1)

    def _rows(self, Q: ArrayLike, mode: Any, out: Any, threads: int, backend: Any, dtype: Any) -> Array:
        ask = {"norms": self.opened.norms, "clearances": self.opened.clearances, "gradients": self.opened.gradients}
        return self._asked(Q, mode, ask[mode], out, threads, backend, dtype)

    def _signed(self, Q: ArrayLike, mode: str, out: Any, threads: int, backend: Any, dtype: Any) -> Array:
        ask = {"clearances": self.opened.signed_clearances, "gradients": self.opened.signed_gradients}
        return self._asked(Q, mode, ask[mode], out, threads, backend, dtype)

    def _asked(
        self, Q: ArrayLike, mode: str, ask: Callable[..., Array], out: Any, threads: int, backend: Any, dtype: Any
    ) -> Array:
        array = as_configurations(Q, self._coordinates)
        if mode != "gradients":
            return ask(self.lift(array), out, threads=threads, backend=backend, dtype=dtype)
        Z, J = self.lift.with_jacobians(array if array.ndim > 1 else array[None])
        found = ask(Z, threads=threads, backend=backend, dtype=dtype)
        chained = np.asarray(_chained(found, J), dtype=found.dtype)
        chained = chained if array.ndim > 1 else chained[0]
        if out is None:
            return chained
        if getattr(out, "shape", None) != chained.shape or getattr(out, "dtype", None) != chained.dtype:
            said = f"out does not fit; give a writeable {chained.dtype} array of shape {chained.shape}"
            raise DimensionError(said)
        out[...] = chained
        return out

    def smallest(
        self, Q: ArrayLike, out: Any = None, *, threads: int = 1, backend: Any = "auto", dtype: Any = np.float64
    ) -> Smallest:
        """Return the smallest signed clearance and its boundary: floats, or (N,)."""
        return self.opened.smallest(self.lift(Q), out, threads=threads, backend=backend, dtype=dtype)

    def free(self, Q: ArrayLike, *, limits: bool = True, threads: int = 1, backend: Any = "auto") -> Any:
        """Return whether q is free: a bool, or (N,) bools; False if a loop does not close, with or without limits.

        Limits of passive joints count, like all others.
        """
        array = as_configurations(Q, self._coordinates)
        Z = self.lift(array)
        found = self.opened.free(Z, limits=limits, threads=threads, backend=backend)
        return found if limits else (found & self.closed(Z))

    def closed(self, Z: Array) -> Any:
        """Return whether every loop closes at z, in the assembly of home: a bool, or (N,)."""
        found: Any = np.ones(Z.shape[:-1], dtype=np.bool_)
        for one, columns in zip(self.lift.linkages, self.lift.columns, strict=True):
            low, high = one.transmission_range
            w = Z[..., columns[2]]
            found = found & (w >= low) & (w <= high)
        return found if Z.ndim > 1 else bool(found)

    def beyond(self, q: ArrayLike) -> tuple[str, ...]:
        """Return the boundaries of one effective angle, in z, whose contact lies between home and q."""
        return self.opened.beyond(self.lift(q))

    def limits(self, coordinate: str, q: ArrayLike, window: tuple[float, float] | None = None) -> CoordinateLimits:
        """Return how far one coordinate can move from q, and what stops it. The other coordinates are fixed.

        Limits of passive joints and toggles count, too. Motions through a loop are proven from q outwards
        (`looped_limits`). If nothing stops the coordinate within two turns, a window is needed.

        Raises:
            UnknownNameError: If the robot has no such coordinate.
            DimensionError: If q is not one finite configuration, or the window is none, or does not hold q's value.
            UnsupportedError: If nothing stops it within two turns, and the coordinate has no limits.
        """
        from pinbound.boundaries.looped_limits import coordinate_limits

        index = coordinate_index(coordinate, self._coordinates)
        point = one_configuration(q, self._coordinates)
        window = (-np.inf, np.inf) if window is None else checked_window(window)
        if not window[0] <= point[index] <= window[1]:
            said = f"{coordinate!r} is {point[index]:.9g}, outside the window {window}; give a window that contains it"
            raise DimensionError(said)
        opened = self.opened
        given = (self.lift, list(opened), opened._limits, opened._guarded)
        return coordinate_limits(*given, index, point, window, self.beyond(point))

    def limits_table(self, coordinate: str, Q: ArrayLike) -> tuple[Array, NDArray[np.str_]]:
        """Return how far one coordinate can move from each of many q (N, n), one by one as `limits` does."""
        rows = np.atleast_2d(as_configurations(Q, self._coordinates))
        found = [self.limits(coordinate, row) for row in rows]
        ends = np.array([(one.lower, one.upper) for one in found]).reshape(-1, 2)
        stops = [(one.lower_stop or "", one.upper_stop or "") for one in found]
        return ends, np.array(stops, dtype=np.str_).reshape(-1, 2)

    def __reduce__(self) -> tuple[Any, ...]:
        """Return how to make the set again."""
        return LoopBoundarySet, (self.opened, self.lift)


def over_z(boundary: Boundary) -> Boundary:
    """Return a boundary with a path: the boundary itself, or the one over z for loops that are not parallelograms."""
    return boundary.opened if isinstance(boundary, LoopBoundary) else boundary


def formula_joints(boundary: Boundary) -> tuple[str, ...]:
    """Return the names of the joints in both forms of a boundary's expression, with passive joints of loops."""
    one = over_z(boundary)
    used = {*one.path.branch_a.chain.coordinates, *one.path.branch_b.chain.coordinates}
    return tuple(one.robot_coordinates[index] for index in sorted(used))
