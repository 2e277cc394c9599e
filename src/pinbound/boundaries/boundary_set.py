"""All boundaries of a robot, evaluated together by one kernel; and how far each coordinate can move."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pinbound.boundaries.ahead import Ahead, ahead_of
from pinbound.boundaries.boundary import Boundary, checked_window, one_configuration
from pinbound.boundaries.named_boundaries import NamedBoundaries
from pinbound.boundaries.rates import farthest, rates_of, spans_of, tighten_all
from pinbound.boundaries.spans import (
    CoordinateLimits,
    Smallest,
    guarded_span,
    guarded_spans,
    linear_span,
    linear_spans,
    tighten,
)
from pinbound.checks import names_of
from pinbound.contact import SignedKernel
from pinbound.exceptions import DimensionError
from pinbound.model.coupling import GuardedLimit, LinearLimit, as_configurations, coordinate_index
from pinbound.typing import Array

if TYPE_CHECKING:
    from pinbound.kernel import Backend, CommonMark, Kernel, MixedKernel, UnionKernel

__all__ = ["BoundarySet", "CoordinateLimits", "Smallest"]


def _as_usual(threads: Any, backend: Any) -> bool:
    return type(threads) is int and threads == 1 and backend == "auto"


class BoundarySet(NamedBoundaries):
    """The boundaries of a robot, in order, evaluated together.

    Example:
        >>> import pinbound as pb
        >>> B = pb.load("minervabot_v3").boundaries
        >>> len(B), B.names[0], B["beta_1"] is B[0]
        (10, 'beta_1', True)
        >>> B.norms([0.0, 0.0, 0.0]).shape, B.norms(np.zeros((5, 3))).shape
        ((10,), (5, 10))
    """

    def __init__(
        self,
        boundaries: Sequence[Boundary],
        coordinates: Sequence[str],
        limits: Sequence[LinearLimit] = (),
        home: ArrayLike | None = None,
        common: Callable[[], Mapping[str, CommonMark] | None] = lambda: None,
        guarded: Sequence[GuardedLimit] = (),
    ) -> None:
        """Hold boundaries of one robot, with its joint limits, guarded ones too, and home for `limits`.

        `common` returns each mark's chains in one common frame, by name; None: there is none.
        """
        self.common, self._guarded = common, tuple(guarded)
        super().__init__(boundaries)
        self._coordinates, self._limits = tuple(coordinates), tuple(limits)
        self._home = np.zeros(len(coordinates)) if home is None else as_configurations(home, coordinates)

    def select(self, names: str | Iterable[str]) -> BoundarySet:
        """Return a set of some boundaries, in the order of `names`, with the same joint limits and home.

        Raises:
            UnknownNameError: If there is no boundary of a name.
            DimensionError: If a name occurs twice.

        Example:
            >>> import pinbound as pb
            >>> B = pb.load("minervabot_v3").boundaries
            >>> some = B.select(["beta_4", "beta_1"])
            >>> some.names, some.signed_clearances([0.0, 0.0, 0.0]).shape
            (('beta_4', 'beta_1'), (2,))
        """
        wanted = names_of(names, "boundaries")
        if len(set(wanted)) < len(wanted):
            twice = next(name for place, name in enumerate(wanted) if name in wanted[:place])
            raise DimensionError(f"boundary {twice!r} is named twice; name each boundary once")
        if wanted == self.names:
            return self
        chosen: list[Boundary] = [self[name] for name in wanted]
        return BoundarySet(chosen, self._coordinates, self._limits, self._home, self.common, self._guarded)

    def to_casadi(self, name: str = "signed_clearances") -> Any:
        """Return a CasADi function with this name. It maps q (n) to the signed clearances h (m) [m]; positive is free.

        For points, segments, lines and planes it is an SX `Function`, which CasADi can differentiate and convert to C.
        The nearest points of boxes and prisms need an iteration. With such boundaries it is an MX `Function` with a
        callback: it has a Jacobian and no Hessian, and works in this process only. `select(names)` leaves such
        boundaries out.

        Raises:
            UnsupportedError: If CasADi is not installed (extra `bridges`).
        """
        from pinbound.export import casadi_function

        rules, marks = [b.rule for b in self], [(b.point_a.name, b.point_b.name) for b in self]
        return casadi_function(rules, marks, len(self._coordinates), self.common, name)

    def vectors(self, Q: ArrayLike) -> Array:
        """Return r of every boundary in the frame of its ancestor link: (m, 3) for one q, (N, m, 3) for many [m]."""
        return self._stack(Q, Boundary.vector, (3,))

    @cached_property
    def kernel(self) -> Kernel | UnionKernel | MixedKernel:
        """The batch kernel behind `norms`, `clearances` and `gradients`."""
        from pinbound.kernel import Pair, Reference, kernel_of

        pairs = [Pair(b.path, b.threshold, (b.point_a.name, b.point_b.name)) for b in self._boundaries]
        return kernel_of(pairs, len(self._coordinates), Reference(), self.common)

    @cached_property
    def signed_kernel(self) -> SignedKernel:
        """The kernel of signed clearances, `smallest` and `free`: contact rules of all boundaries, and joint limits."""
        rules, marks = [b.rule for b in self], [(b.point_a.name, b.point_b.name) for b in self]
        return SignedKernel(rules, marks, len(self._coordinates), self._limits, self.common, self._guarded)

    def norms(
        self,
        Q: ArrayLike,
        out: Any = None,
        *,
        threads: int = 1,
        backend: Backend = "auto",
        dtype: Any = np.float64,
    ) -> Array:
        """Return `beta = |r|` of every boundary: (m,) for one q, (N, m) for many [m]; NaN for a row that is not finite.

        Args:
            Q: (n,) or (N, n).
            out: For many q, a buffer (N, m) of `dtype` to fill and return. A new array has contiguous columns.
            threads: The number of threads that share the rows. Compiled results do not depend on it.
            backend: ``"compiled"`` (Numba, extra `fast`), ``"numpy"``, or ``"auto"``. The last uses compiled code if
                this process has it already, or if there is so much work that one second of compiling pays off.
            dtype: float64, or float32 with an error of 1e-6 of the paths' lengths. float32 is about twice as fast for
                few pairs. For 64 pairs of points and more, it is the float64 answer, rounded.

        Raises:
            DimensionError: If Q, out, threads or dtype do not fit.
            UnsupportedError: If ``"compiled"`` is asked for and Numba is not installed.

        Example:
            >>> import pinbound as pb
            >>> B = pb.load("minervabot_v3").boundaries
            >>> bool(np.allclose(B.norms(np.zeros((2, 3)))[0], B.norms(np.zeros(3)), rtol=1e-14))
            True
        """
        return self._rows(Q, "norms", out, threads, backend, dtype)

    def clearances(
        self,
        Q: ArrayLike,
        out: Any = None,
        *,
        threads: int = 1,
        backend: Backend = "auto",
        dtype: Any = np.float64,
    ) -> Array:
        """Return `norm - threshold` of every boundary: (m,) or (N, m) [m], the unsigned distance minus the threshold.

        It is positive also beyond a stop. `signed_clearances` is negative there, and `free` uses that. Arguments and
        errors are those of `norms`.
        """
        return self._rows(Q, "clearances", out, threads, backend, dtype)

    def signed_clearances(
        self,
        Q: ArrayLike,
        out: Any = None,
        *,
        threads: int = 1,
        backend: Backend = "auto",
        dtype: Any = np.float64,
    ) -> Array:
        """Return the signed clearance of every boundary: (m,) or (N, m) [m]; positive is free.

        Arguments and errors are those of `norms`.

        Example:
            >>> import pinbound as pb
            >>> B = pb.load("minervabot_v3").boundaries
            >>> Q = np.radians([[0.0, 0.0, 0.0], [0.0, 0.0, 60.0]])
            >>> [[B.names[k] for k in np.flatnonzero(row <= 0.0)] for row in B.signed_clearances(Q)]
            [[], ['beta_1', 'beta_4']]
        """
        return self._signed(Q, "clearances", out, threads, backend, dtype)

    def signed_gradients(
        self,
        Q: ArrayLike,
        out: Any = None,
        *,
        threads: int = 1,
        backend: Backend = "auto",
        dtype: Any = np.float64,
    ) -> Array:
        """Return the gradients of the signed clearances: (m, n) or (N, m, n) [m/rad, or 1 for prismatic joints].

        They are defined at the contact angle of a stop, and NaN where a distance is zero. Arguments and errors are
        those of `norms`.
        """
        return self._signed(Q, "gradients", out, threads, backend, dtype)

    def _signed(self, Q: ArrayLike, mode: str, out: Any, threads: int, backend: Backend, dtype: Any) -> Array:
        array = as_configurations(Q, self._coordinates)
        if array.ndim == 1:
            if (
                mode == "clearances"
                and out is None
                and (threads, backend) == (1, "auto")
                and threads is not True
                and dtype is np.float64
            ):
                return self.signed_kernel.one(array)
            to = None if out is None else out[None]
            return self.signed_kernel.rows(array[None], mode, to, threads, backend, dtype)[0]
        return self.signed_kernel.rows(array, mode, out, threads, backend, dtype)

    def gradients(
        self,
        Q: ArrayLike,
        out: Any = None,
        *,
        threads: int = 1,
        backend: Backend = "auto",
        dtype: Any = np.float64,
    ) -> Array:
        """Return the gradients of the norms: (m, n) or (N, m, n) [m/rad]; NaN where a norm is zero.

        Arguments and errors are those of `norms`; `out` is (N, m, n) and C-contiguous.
        """
        return self._rows(Q, "gradients", out, threads, backend, dtype)

    def _rows(
        self,
        Q: ArrayLike,
        mode: Literal["norms", "clearances", "gradients"],
        out: Any,
        threads: int,
        backend: Backend,
        dtype: Any,
    ) -> Array:
        array = as_configurations(Q, self._coordinates)
        if array.ndim == 1:
            if not _as_usual(threads, backend):
                from pinbound.kernel import check_choices

                check_choices(threads, backend)
            if mode != "gradients" and out is None and dtype is np.float64:
                found = self.kernel.one(array, mode)
                if found is not None:
                    return found
            given: Any = cast(Any, out)[None] if isinstance(out, np.ndarray) else out
            return self.kernel.rows(array[None], mode, given, threads, backend, dtype)[0]
        return self.kernel.rows(array, mode, out, threads, backend, dtype)

    def smallest(
        self,
        Q: ArrayLike,
        out: Any = None,
        *,
        threads: int = 1,
        backend: Backend = "auto",
        dtype: Any = np.float64,
    ) -> Smallest:
        """Return the smallest signed clearance and its boundary, without an array of all clearances: floats, or (N,).

        It is positive exactly where no boundary is in contact. Arguments and errors are those of `norms`; `out` is (N,)
        and receives the clearances.

        Example:
            >>> import pinbound as pb
            >>> B = pb.load("minervabot_v3").boundaries
            >>> found = B.smallest([0.0, 0.0, 0.0])
            >>> B.names[found.index], round(1e3 * found.clearance, 6)
            ('beta_9', 5.800032)
        """
        array = as_configurations(Q, self._coordinates)
        if array.ndim == 1:
            if out is not None:
                raise DimensionError(
                    "the smallest clearance of one q is a float, and out= is for many q (N, n); remove out="
                )
            clearances = self.signed_clearances(array, threads=threads, backend=backend, dtype=dtype)
            if not len(clearances):
                return Smallest(float("inf"), -1)
            index = int(np.argmin(clearances))  # the first NaN, if there is one
            return Smallest(float(clearances[index]), -1 if np.isnan(clearances[index]) else index)
        least, index = self.signed_kernel.smallest(array, True, out, threads, backend, dtype)
        return Smallest(least, index)

    def free(self, Q: ArrayLike, *, limits: bool = True, threads: int = 1, backend: Backend = "auto") -> Any:
        """Return whether q is free: a bool, or (N,) bools; False for a row that is not finite.

        q is free if every signed clearance is positive and every joint limit is kept within `tolerances.LIMIT`, also
        limits of mimic joints. A certificate of q says the same, and a region holds free configurations only. `free`
        does not say whether the robot can reach q: `Region.contains` and `certify` do.

        Args:
            Q: (n,) or (N, n).
            limits: Whether joint limits count.
            threads: As in `norms`.
            backend: As in `norms`.

        Raises:
            DimensionError: If Q or threads do not fit.
            UnsupportedError: If ``"compiled"`` is asked for and Numba is not installed.

        Example:
            >>> import pinbound as pb
            >>> B = pb.load("minervabot_v3").boundaries
            >>> B.free([0.0, 0.0, 0.0]), B.free([3.0, 0.0, 0.0]), B.free([3.0, 0.0, 0.0], limits=False)
            (True, False, True)
        """
        array = as_configurations(Q, self._coordinates)
        if array.ndim > 1 or not _as_usual(threads, backend):
            found = self.signed_kernel.free(np.atleast_2d(array), limits, threads, backend)
            return found if array.ndim > 1 else bool(found[0])
        return self.signed_kernel.one_is_free(array, limits)

    def hessians(self, Q: ArrayLike) -> Array:
        """Return the Hessians of the norms: (m, n, n) or (N, m, n, n); NaN where a norm is zero."""
        return self._stack(Q, Boundary.hessian, (len(self._coordinates),) * 2)

    def _stack(self, Q: ArrayLike, ask: Callable[[Boundary, Array], Any], shape: tuple[int, ...]) -> Array:
        array = as_configurations(Q, self._coordinates)
        if not self._boundaries:
            return np.empty((*array.shape[:-1], 0, *shape))
        return np.stack([ask(boundary, array) for boundary in self], axis=array.ndim - 1)

    def beyond(self, q: ArrayLike) -> tuple[str, ...]:
        """Return the boundaries of one effective angle whose contact lies between home and q.

        At such a q the marks may be apart, but q cannot be reached: every motion from home passes through a contact.

        Example:
            >>> import pinbound as pb
            >>> pb.load("minervabot_v3").boundaries.beyond([0.0, -0.5, 0.0])
            ('beta_10',)
        """
        point = one_configuration(q, self._coordinates)
        return tuple(boundary.name for boundary in self if boundary.parts(self._home, point))

    def limits(self, coordinate: str, q: ArrayLike, window: tuple[float, float] | None = None) -> CoordinateLimits:
        """Return how far one coordinate can move from q, and what stops it. The other coordinates are fixed.

        All boundaries and all joint limits count, also those of mimic joints.

        Args:
            coordinate: An active coordinate of the robot.
            q: (n,) configuration.
            window: The range in which to search; by default the range that the joint limits allow. It is needed only
                for a coordinate without limits whose contacts do not repeat periodically.

        Raises:
            UnknownNameError: If the robot has no such coordinate.
            DimensionError: If q is not one finite configuration, if the window is not two increasing numbers, or if it
                does not hold q's value.
            UnsupportedError: If contacts do not repeat periodically, and none is near.

        Example:
            >>> import pinbound as pb
            >>> found = pb.load("minervabot_v3").boundaries.limits("q2", [0.0, 0.0, 0.0])
            >>> found.lower_stop, round(float(np.degrees(found.lower)), 6)
            ('beta_10', -10.145751)
        """
        index = coordinate_index(coordinate, self._coordinates)
        point = one_configuration(q, self._coordinates)
        value = float(point[index])
        if window is not None:
            window = checked_window(window)
            if not window[0] <= value <= window[1]:
                raise DimensionError(
                    f"{coordinate!r} is {value:.9g}, outside the window {window}; give a window that contains it"
                )
        spans = [(limit.joint, linear_span(limit, index, point)) for limit in self._limits]
        spans += [(one.rule, guarded_span(one, index, point)) for one in self._guarded]
        if window is None:
            held = [span for _, span in spans if span]
            window = max((s[0] for s in held), default=-math.inf), min((s[1] for s in held), default=math.inf)
        clearances = self.signed_clearances(point)
        if any(span is None for _, span in spans):  # q violates a limit: only contacts at q are of interest
            found = [(-math.inf, math.inf) if s > 0.0 else None for s in clearances.tolist()]
        else:
            found = spans_of(self, self._ahead(index), clearances, coordinate, point, window, self.signed_clearances)
        spans += zip(self.names, found, strict=True)
        return CoordinateLimits.of(coordinate, value, spans, self.beyond(point))

    def _ahead(self, index: int) -> Ahead:
        """Return what is known of all boundaries before coordinate `index` moves."""
        if index not in self._known_ahead:
            rates = rates_of(self, index, farthest(self._limits, len(self._coordinates)))
            self._known_ahead[index] = ahead_of(self, index, rates)
        return self._known_ahead[index]

    @cached_property
    def _known_ahead(self) -> dict[int, Ahead]:
        return {}

    def limits_table(self, coordinate: str, Q: ArrayLike) -> tuple[Array, NDArray[np.str_]]:
        """Return for each of many q how far one coordinate can move, and what stops it.

        Args:
            coordinate: An active coordinate of the robot.
            Q: (N, n) finite configurations.

        Returns:
            Ends (N, 2) [rad or m]: NaN where the value itself is not allowed, infinite where nothing stops the
            coordinate; and names (N, 2) of the boundary or limit at each end, empty where there is none.

        Raises:
            UnknownNameError: If the robot has no such coordinate.
            DimensionError: If Q is not finite or has another shape.
            UnsupportedError: If a coordinate without limits has contacts that do not repeat periodically.

        Example:
            >>> import pinbound as pb
            >>> ends, stops = pb.load("minervabot_v3").boundaries.limits_table("q2", np.zeros((5, 3)))
            >>> stops[0].tolist(), np.degrees(ends[0]).round(6).tolist()
            (['beta_10', 'beta_8'], [-10.145751, 68.504624])
        """
        index = coordinate_index(coordinate, self._coordinates)
        rows = np.atleast_2d(as_configurations(Q, self._coordinates))
        if not np.all(np.isfinite(rows)):
            raise DimensionError("Q holds a number that is not finite; give finite numbers")
        ends = np.tile([-math.inf, math.inf], (len(rows), 1))
        stops = np.full((len(rows), 2), "", dtype=object)
        for limit in self._limits:
            tighten(ends, stops, limit.joint, linear_spans(limit, index, rows))
        for one in self._guarded:
            tighten(ends, stops, one.rule, guarded_spans(one, index, rows))
        inside = ~np.isnan(ends[:, 0])
        rows, some, named = rows[inside], ends[inside], stops[inside]
        if not len(rows):
            return ends, stops.astype(np.str_)
        clearances = self.signed_clearances(rows)
        tighten_all(self, self._ahead(index), clearances, coordinate, rows, some, named, self.signed_clearances)
        ends[inside], stops[inside] = some, named
        return ends, stops.astype(np.str_)
