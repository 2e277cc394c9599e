"""The results of a set as nodes of one graph: separations minus thresholds, with square roots, and their gradients.

A program ends at squares, because each backend computes roots in its own way. Exporters need the results.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from pinbound.kernel.program import CommonMark, Pair, compile_program
from pinbound.kernel.scalars import Graph

__all__ = ["separation_nodes"]


def separation_nodes(
    pairs: Sequence[Pair], n: int, common: Callable[[], Mapping[str, CommonMark] | None], slopes: bool = True
) -> tuple[Graph, list[int], list[list[int]]]:
    """Return a graph, the nodes of `separation - threshold` (m,), and those of the gradients (m, n), if requested.

    At a distance of zero the gradient is 0 / 0.

    Args:
        pairs: The boundaries, all of closed form.
        n: Number of active coordinates.
        common: As for `kernel_of`.
        slopes: Whether gradients are made.
    """
    program = compile_program(pairs, n, common() if len(pairs) > 1 else None)
    graph, values, rates = program.graph, list[int](), list[list[int]]()
    raw = program.gradients() if slopes else [list[int]() for _ in pairs]
    for square, signed, threshold, row in zip(program.squares, program.signed, program.thresholds, raw, strict=True):
        separation = square if signed else graph.sqrt(square)
        values.append(graph.sub(separation, graph.constant(threshold)))
        rates.append(row if signed else [graph.div(slope, separation) for slope in row])
    return graph, values, rates
