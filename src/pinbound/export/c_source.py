"""C99 without dependencies: signed clearances and their Jacobian as straight-line code.

It calls only `sin`, `cos` and `sqrt` of `math.h`. The same robot always gives the same text.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from pinbound.export.nodes import SignedNodes
from pinbound.kernel.scalars import Graph, Node

__all__ = ["c_files"]

_INFIX = {"add": "+", "sub": "-", "mul": "*", "div": "/"}


def c_files(
    nodes: SignedNodes, robot: str, coordinates: Sequence[tuple[str, str]], names: Sequence[str], stem: str
) -> tuple[str, str]:
    """Return the text of `stem.h` and `stem.c`.

    Args:
        nodes: The nodes to compute.
        robot: The robot's name.
        coordinates: Name and unit of each coordinate, in q's order.
        names: Names of the boundaries, in order.
        stem: Name of the files; names of functions begin with it, converted to an identifier.
    """
    prefix = re.sub(r"\W", "_", stem, flags=re.ASCII)
    if not re.match(r"[A-Za-z]", prefix):
        prefix = f"pinbound_{prefix}"
    upper, n, m = prefix.upper(), nodes.n, len(names)
    said = _comment(
        [
            f"Signed clearances of {robot}, in closed form, by pinbound. Do not edit.",
            "",
            f"q: {n} numbers, in this order:",
            *[f"  q[{k}]  {name} [{unit}]" for k, (name, unit) in enumerate(coordinates)],
            f"h: {m} signed clearances [m], positive is free, zero or less is contact, in this order:",
            *[f"  h[{k}]  {name}" for k, name in enumerate(names)],
            f"J: {m} x {n} numbers, row after row: J[i * {n} + j] = dh[i]/dq[j] [m/rad, or 1 of a coordinate in m];",
            "  not a number where a distance is zero. Joint limits are not part of it.",
            "Only sin, cos and sqrt are called; nothing is allocated, nothing is kept between calls.",
        ]
    )
    header = f"""{said}#ifndef {upper}_H
#define {upper}_H

#define {upper}_COORDINATES {n}
#define {upper}_BOUNDARIES {m}

void {prefix}_clearances(const double *q, double *h);
void {prefix}_clearances_and_jacobian(const double *q, double *h, double *J);

#endif
"""
    both = [*((f"h[{k}]", node) for k, node in enumerate(nodes.values))]
    slopes = [(f"J[{i * n + j}]", node) for i, row in enumerate(nodes.slopes) for j, node in enumerate(row)]
    source = f"""{said}#include "{stem}.h"

#include <math.h>

void {prefix}_clearances(const double *q, double *h)
{{
{_body(nodes.graph, both)}}}

void {prefix}_clearances_and_jacobian(const double *q, double *h, double *J)
{{
{_body(nodes.graph, [*both, *slopes])}}}
"""
    return header, source


def _comment(lines: Sequence[str]) -> str:
    clean = [re.sub(r"[^\x20-\x7e]", "?", line).replace("*/", "* /").replace("/*", "/ *") for line in lines]
    return "/*\n" + "".join(f" * {line}".rstrip() + "\n" for line in clean) + " */\n"


def _body(graph: Graph, outputs: Sequence[tuple[str, int]]) -> str:
    """Return the declarations in order, and then the outputs."""
    numbers = graph.reachable(node for _, node in outputs)
    lines = [
        f"    const double v{number} = {_text(graph, graph.nodes[number])};\n"
        for number in numbers
        if graph.nodes[number].kind != "constant"
    ]
    lines += [f"    {place} = {_name(graph, node)};\n" for place, node in outputs]
    unused = [f"    (void){name};\n" for name in ("q", "h", "J") if not any(f"{name}[" in line for line in lines)]
    if not any(place.startswith("J") for place, _ in outputs) and "    (void)J;\n" in unused:
        unused.remove("    (void)J;\n")
    return "".join(lines + unused)


def _name(graph: Graph, number: int) -> str:
    node = graph.nodes[number]
    if node.kind != "constant":
        return f"v{number}"
    return repr(node.value) if node.value >= 0.0 else f"({node.value!r})"


def _text(graph: Graph, node: Node) -> str:
    if node.kind == "coordinate":
        return f"q[{node.args[0]}]"
    if node.kind in ("cos", "sin"):
        return f"{node.kind}({_angle(graph.angles[node.args[0]])})"
    args = [_name(graph, number) for number in node.args]
    if node.kind in _INFIX:
        return f"{args[0]} {_INFIX[node.kind]} {args[1]}"
    if node.kind == "pick":
        return f"{args[0]} < {args[1]} ? {args[2]} : {args[3]}"
    return f"sqrt({args[0]})" if node.kind == "sqrt" else args[0]


def _angle(coefficients: Sequence[float]) -> str:
    terms = [f"q[{j}]" if c == 1.0 else f"({c!r}) * q[{j}]" for j, c in enumerate(coefficients) if c]
    return " + ".join(terms)
