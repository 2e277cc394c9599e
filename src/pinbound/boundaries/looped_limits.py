"""How far a coordinate that moves loops which are not parallelograms can move, with proof through `z = F(q)`.

Along one coordinate every contact and limit over z is a function with bounds over intervals (`loops/through_loops`),
which are exact to second order. From q outwards, intervals are proven free until this fails; there the function that
stops the coordinate is zero.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from pinbound.boundaries.boundary import Boundary
from pinbound.boundaries.spans import CoordinateLimits, guarded_span, linear_span
from pinbound.exceptions import UnsupportedError
from pinbound.limits.univariate import AllowedArcs
from pinbound.loops.lift import Lift
from pinbound.loops.linkages import Linkage
from pinbound.loops.through_loops import (
    LiftedPlane,
    LoopBounds,
    LoopContact,
    LoopLimit,
    contacts_through,
    free_parts,
    limits_through,
    proven_end,
    rules_through,
)
from pinbound.model.coupling import GuardedLimit, LinearLimit
from pinbound.tolerances import CONTOUR_ROUNDING
from pinbound.typing import Array, Flags

__all__ = ["allowed_arcs", "coordinate_limits", "moved_by"]

Span = tuple[float, float] | None
_Curves = Sequence[LoopContact | LoopLimit]
_FARTHEST = 4.0 * math.pi  # rad or m: search range of a coordinate without limits, to either side


def moved_by(lift: Lift, index: int) -> Flags:
    """Return which coordinates of z depend on a coordinate of q through a loop."""
    moves, found = {index}, np.zeros(len(lift.names), dtype=np.bool_)
    for one, columns in zip(lift.linkages, lift.columns, strict=True):
        if moves & set(one.inputs):
            moves |= set(columns)
            found[list(columns)] = True
    return found


def _line(lift: Lift, q: Array, index: int) -> LiftedPlane:
    errors = tuple(CONTOUR_ROUNDING * _size(one) for one in lift.linkages)
    return LiftedPlane(lift, q, (index,), errors)


def _size(one: Linkage) -> float:
    return float(np.linalg.norm(one.vectors, axis=1).sum()) + sum(map(abs, one.lengths))


def coordinate_limits(
    lift: Lift,
    boundaries: Sequence[Boundary],
    limits: Sequence[LinearLimit],
    guarded: Sequence[GuardedLimit],
    index: int,
    q: Array,
    window: tuple[float, float],
    beyond: tuple[str, ...],
) -> CoordinateLimits:
    """Return how far a coordinate of q (n,) can move, and what stops it.

    Args:
        lift: `z = F(q)`.
        boundaries: Boundaries over z.
        limits: Limits over z, with toggles.
        guarded: Guarded limits over z.
        index: Index of the coordinate.
        q: (n,).
        window: The search range.
        beyond: Boundaries whose contact lies between home and q.

    Raises:
        UnsupportedError: If neither a limit nor a contact is found within two turns, and it has no limits of its own.
    """
    z, moved, line, name = lift(q), moved_by(lift, index), _line(lift, q, index), lift.coordinates[index]
    spans: list[tuple[str, Span]] = []
    curves: list[LoopContact | LoopLimit] = []

    def add(source: str, through: bool, holds: bool, own: Callable[[], Span], more: Callable[[], _Curves]) -> None:
        """Add a limit or boundary as a span if the coordinate does not move it through a loop, else as curves."""
        if not through:
            spans.append((source, own()))
            return
        curves.extend(more())
        if not holds:
            spans.append((source, None))

    for limit in limits:
        own, more = partial(linear_span, limit, index, z), partial(limits_through, limit, line)
        add(limit.joint, bool(np.any(limit.coefficients[moved])), bool(limit.holds(z[None])[0]), own, more)
    for one in guarded:
        own, more = partial(guarded_span, one, index, z), partial(rules_through, [one], line)
        add(one.rule, bool(np.any(one.uses[moved])), bool(one.holds(z[None])[0]), own, more)
    value, known = float(q[index]), [span for _, span in spans if span is not None]
    low = max([window[0], *(span[0] for span in known)])
    high = min([window[1], *(span[1] for span in known)])
    for boundary in boundaries:
        is_clear = bool(boundary.signed_clearance(z) > 0.0)
        own = partial(boundary.span, name, z, (low, high), is_clear)
        through = bool(np.any(moved[list(boundary.path.minimal.coordinates)]))
        add(boundary.name, through, is_clear, own, partial(contacts_through, boundary.name, boundary.rule, line))
    if curves and all(span is not None for _, span in spans):
        spans += _proven(curves, name, value, (low, high))
    return CoordinateLimits.of(name, value, spans, beyond)


def _proven(curves: _Curves, name: str, value: float, within: tuple[float, float]) -> list[tuple[str, Span]]:
    """Return how far a value can move within an interval through loops, to either side, and what stops it there."""
    found: list[tuple[str, Span]] = []
    ends = max(within[0], value - _FARTHEST), min(within[1], value + _FARTHEST)
    bounds = LoopBounds(curves, np.array([ends[0]]), np.array([ends[1]]))
    for side, end in enumerate(ends):
        reached, which = proven_end(bounds, value, end)
        if which >= 0:
            found.append((curves[which].source, (reached, math.inf) if side == 0 else (-math.inf, reached)))
        elif end not in within:
            raise UnsupportedError(
                f"{name!r} meets no contact through its loops within two turns of {value:.6g}, and contacts "
                "further away are not searched; give window=(lower, upper), or the joint limits"
            )
    return found


def allowed_arcs(
    lift: Lift, boundary: Boundary, limits: Sequence[LinearLimit], index: int, q: Array, window: tuple[float, float]
) -> AllowedArcs:
    """Return the values of a coordinate within a window at which a boundary over z is free and the loops close.

    Args:
        lift: `z = F(q)`.
        boundary: A boundary over z.
        limits: Limits over z that keep the loops closed.
        index: Index of the coordinate.
        q: (n,).
        window: A finite window.

    Raises:
        UnsupportedError: If, along an interval, the separation equals the contact distance up to rounding.
    """
    line, moved = _line(lift, q, index), moved_by(lift, index)
    curves = contacts_through(boundary.name, boundary.rule, line)
    for limit in limits:
        if np.any(limit.coefficients[moved]):
            curves += limits_through(limit, line)
    bounds = LoopBounds(curves, np.array([window[0]]), np.array([window[1]]))
    name = lift.coordinates[index]
    return AllowedArcs(name, free_parts(bounds, *window, name), math.inf, window)
