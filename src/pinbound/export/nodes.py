"""Signed clearances and their gradients as nodes of one graph, from which every exporter starts."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pinbound.contact import ContactRule, Stop
from pinbound.kernel import CommonMark, Pair
from pinbound.kernel.outputs import separation_nodes
from pinbound.kernel.scalars import Graph

__all__ = ["SignedNodes", "is_closed", "signed_nodes"]

_TURN = 2.0 * math.pi


@dataclass(frozen=True)
class SignedNodes:
    """m signed clearances over n coordinates.

    Attributes:
        graph: The graph.
        values: (m,) nodes of the signed clearances [m].
        slopes: (m, n) nodes of their gradients [m/rad or 1]; empty if they were not requested.
        n: Number of active coordinates.
    """

    graph: Graph
    values: tuple[int, ...]
    slopes: tuple[tuple[int, ...], ...]
    n: int


def is_closed(rule: ContactRule) -> bool:
    """Return whether the nearest points have a closed form; those of boxes, prisms and hulls need an iteration."""
    return rule.is_stop or rule.path.is_expression


def signed_nodes(
    rules: Sequence[ContactRule],
    marks: Sequence[tuple[str, str]],
    n: int,
    common: Callable[[], Mapping[str, CommonMark] | None],
    slopes: bool = True,
) -> SignedNodes:
    """Return the nodes of rules; all rules must be closed (`is_closed`).

    Args:
        rules: The boundaries' rules.
        marks: Names of the two marks of each rule.
        n: Number of active coordinates.
        common: Each mark's chains in one common frame, as for `BoundarySet`.
        slopes: Whether to make gradients, too; otherwise `slopes` of the result is empty.
    """
    areas = [k for k, rule in enumerate(rules) if not rule.is_stop]
    pairs = [Pair(rules[k].path, rules[k].distance, marks[k]) for k in areas]
    graph, found, gradients = separation_nodes(pairs, n, common, slopes) if pairs else (Graph(), [], [])
    values, rates = dict(zip(areas, found, strict=True)), dict(zip(areas, gradients, strict=True))
    for k, rule in enumerate(rules):
        if rule.stop is not None:
            values[k] = _stop(graph, rule.stop)
            rates[k] = [graph.derivative(values[k], j) for j in range(n)] if slopes else []
    every = range(len(rules))
    made = tuple(tuple(rates[k]) for k in every) if slopes else ()
    return SignedNodes(graph, tuple(values[k] for k in every), made, n)


def _stop(g: Graph, stop: Stop) -> int:
    """Return `A sin(d / 2)` with the depth d in home's gap, or `-A |sin(d / 2)|` more than a turn beyond it."""
    (low, high), c = stop.free_gap, np.asarray(stop.coefficients)
    phi, (cos, sin) = g.linear(c.tolist()), g.angle((0.5 * c).tolist())

    def turned(s: float, k: float) -> int:
        return g.add(g.mul(g.constant(s), sin), g.mul(g.constant(k), cos))

    rising = turned(math.cos(0.5 * low), -math.sin(0.5 * low))  # sin((phi - low) / 2)
    falling = turned(-math.cos(0.5 * high), math.sin(0.5 * high))  # sin((high - phi) / 2)
    above, below = g.sub(phi, g.constant(low)), g.sub(g.constant(high), phi)
    share, depth = g.pick(above, below, rising, falling), g.pick(above, below, above, below)
    zero = g.constant(0.0)
    far = g.pick(share, zero, share, g.sub(zero, share))
    return g.mul(g.constant(stop.amplitude), g.pick(depth, g.constant(-_TURN), far, share))
