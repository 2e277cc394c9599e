"""All quantities that the page computes, as nodes of one graph: signed clearances, chains of hulls, link placements.

The page's JavaScript evaluates these nodes and has no kinematics of its own. Some boundaries need a search for their
nearest points. For these the graph gives only `w` and the edge vectors `e_i` of `r = w + sum_i t_i e_i`; the page
searches over t.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pinbound.bounds.derivative_bounds import lever_arms
from pinbound.contact import ContactRule
from pinbound.export import is_closed, signed_nodes
from pinbound.kernel import CommonMark
from pinbound.kernel.scalars import Graph, Vector
from pinbound.path.chain import Chain
from pinbound.path.relative import RelativePath, absolute_chain, direction_chain
from pinbound.robot.robot import Robot
from pinbound.tolerances import EXPLORER_SPEED, OVERLAP, REDUCTION
from pinbound.typing import Array

__all__ = ["Searched", "chain_nodes", "program_record", "speeds", "ways"]

_CODES = {
    "constant": "k",
    "coordinate": "q",
    "cos": "c",
    "sin": "s",
    "add": "+",
    "sub": "-",
    "mul": "*",
    "div": "/",
    "sqrt": "r",
    "pick": "?",
    "hold": "h",
}


@dataclass(frozen=True)
class Searched:
    """A boundary whose nearest points are searched for.

    Attributes:
        w: Nodes of r at t = 0; only the components that the measure uses, the others are zero.
        edges: Nodes of each edge vector, with the same components.
        corners: For each of the two bodies, the vertices of the set of its t.
        is_height: Whether the value is the least first component (a height) instead of the least norm.
        overlap: A distance below this one counts as an overlap, because of rounding [m].
    """

    w: Vector
    edges: tuple[Vector, ...]
    corners: tuple[Array, Array]
    is_height: bool
    overlap: float


def program_record(
    robot: Robot, rules: Sequence[ContactRule], marks: Sequence[tuple[str, str]], common: Common
) -> tuple[dict[str, Any], list[dict[str, Any]], list[dict[str, Any]]]:
    """Return the nodes, with the node numbers of each boundary's signed clearance and of each link's placement.

    Args:
        robot: The robot.
        rules: The boundaries' contact rules.
        marks: Names of the two marks of each boundary.
        common: Each mark's chains in one common frame, as for `BoundarySet`.
    """
    n = len(robot.coordinates)
    closed = [k for k, rule in enumerate(rules) if is_closed(rule)]
    nodes = signed_nodes([rules[k] for k in closed], [marks[k] for k in closed], n, common, slopes=False)
    graph, values = nodes.graph, dict(zip(closed, nodes.values, strict=True))
    searched = {k: _searched(graph, rule.path) for k, rule in enumerate(rules) if k not in values}
    links = [_placed(graph, robot, link) for link in robot.tree.links]
    outputs = [*values.values()]
    for one in searched.values():
        outputs += [*one.w, *(node for edge in one.edges for node in edge)]
    outputs += [node for link in links for vector in link for node in vector]
    order = graph.reachable(outputs)
    places = {number: place for place, number in enumerate(order)}
    found = [
        {"value": places[values[k]]} if k in values else {"hull": _hull_record(searched[k], rule.distance, places)}
        for k, rule in enumerate(rules)
    ]
    placed = [
        {key: [places[node] for node in vector] for key, vector in zip(("o", "x", "y"), link, strict=True)}
        for link in links
    ]
    return _nodes_record(graph, order, places, n), found, placed


Common = Callable[[], Mapping[str, CommonMark] | None]


def _nodes_record(graph: Graph, order: Sequence[int], places: Mapping[int, int], n: int) -> dict[str, Any]:
    """Return the kinds (one letter for each node), all operands in one list, and the values of the constants."""
    kinds, args, constants = list[str](), list[int](), list[float]()
    for number in order:
        node = graph.nodes[number]
        kinds.append(_CODES[node.kind])
        if node.kind == "constant":
            constants.append(node.value)
        elif node.kind in ("coordinate", "cos", "sin"):
            args += node.args
        else:
            args += [places[one] for one in node.args]
    return {"n": n, "kinds": "".join(kinds), "args": args, "constants": constants, "angles": list(graph.angles)}


def _hull_record(one: Searched, distance: float, places: Mapping[int, int]) -> dict[str, Any]:
    return {
        "w": [places[node] for node in one.w],
        "edges": [[places[node] for node in edge] for edge in one.edges],
        "corners": [corners.tolist() for corners in one.corners],
        "is_height": one.is_height,
        "overlap": one.overlap,
        "distance": distance,
    }


def _searched(g: Graph, path: RelativePath) -> Searched:
    counted = path.counted(np.eye(3)).T
    rows = np.zeros((3, 3))
    rows[: len(counted)] = counted
    w, *edges = (_turned_by(g, rows, chain_nodes(g, chain)) for chain in (path.minimal, *path.difference.turned))
    return Searched(w, tuple(edges), path.difference.corners, path.floor < 0.0, OVERLAP * path.minimal.scale)


def _turned_by(g: Graph, matrix: Array, vector: Vector) -> Vector:
    x, y, z = (
        g.total(g.mul(g.constant(float(entry)), part) for entry, part in zip(row, vector, strict=True))
        for row in matrix
    )
    return x, y, z


def chain_nodes(g: Graph, chain: Chain) -> Vector:
    """Return the three components of a chain's value, computed from its tail: `x_i = b_i + R(u, c . q) x_{i+1}`.

    If u is an axis of the frame, the rotation changes two components. For any other u it is
    `cos x + sin (u x x) + (1 - cos) (u . x) u`.
    """
    vector = _offset(g, chain, chain.rotations)
    for index in reversed(range(chain.rotations)):
        cos, sin = g.angle(chain.coefficients[index].tolist())
        turned = _rotated(g, chain.axes[index], cos, sin, vector)
        x, y, z = (g.add(a, b) for a, b in zip(_offset(g, chain, index), turned, strict=True))
        vector = x, y, z
    return vector


def _offset(g: Graph, chain: Chain, index: int) -> Vector:
    x, y, z = (
        g.linear(slide.tolist(), float(part))
        for slide, part in zip(chain.slides[index], chain.offsets[index], strict=True)
    )
    return x, y, z


def _rotated(g: Graph, axis: Array, cos: int, sin: int, vector: Vector) -> Vector:
    main = int(np.argmax(np.abs(axis)))
    if np.all(np.abs(np.delete(axis, main)) <= REDUCTION):
        found, (i, j) = list(vector), ((main + 1) % 3, (main + 2) % 3)
        signed = sin if axis[main] > 0.0 else g.sub(g.constant(0.0), sin)
        found[i] = g.sub(g.mul(cos, vector[i]), g.mul(signed, vector[j]))
        found[j] = g.add(g.mul(signed, vector[i]), g.mul(cos, vector[j]))
        return found[0], found[1], found[2]
    a, b, c = (float(part) for part in axis)
    across = _turned_by(g, np.array([[0.0, -c, b], [c, 0.0, -a], [-b, a, 0.0]]), vector)
    along = _turned_by(g, np.outer(axis, axis), vector)
    rest = g.sub(g.constant(1.0), cos)
    x, y, z = (
        g.total((g.mul(cos, vector[k]), g.mul(sin, across[k]), g.mul(rest, along[k]))) for k in range(len(vector))
    )
    return x, y, z


def _placed(g: Graph, robot: Robot, link: str) -> tuple[Vector, Vector, Vector]:
    """Return a link's origin [m] and the directions of its x and y axes, all in the root link's frame."""
    tree, coupling = robot.tree, robot.coupling
    origin = absolute_chain(tree, coupling, link, (0.0, 0.0, 0.0))
    x, y = (direction_chain(tree, coupling, link, unit) for unit in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)))
    return chain_nodes(g, origin), chain_nodes(g, x), chain_nodes(g, y)


def ways(rule: ContactRule, reach: Array) -> list[dict[str, Any]]:
    """Return, for each coordinate, the method by which the page finds where this boundary comes into contact.

    ``"none"``: the coordinate does not change the clearance. ``"stop"``: the contact lines are known. ``"turn"``: the
    squared distance, or the height, is `a + b cos(c q_j) + s sin(c q_j)`; `rate` is c. ``"slide"``: the squared
    distance is quadratic in q_j, or the height is linear. ``"step"``: none of these; the page steps along q_j, and
    `speed` is a bound of the rate of the signed clearance [m/rad or 1]; null if it is infinite.

    Args:
        rule: The boundary's contact rule.
        reach: (n,) the largest `|q_j|` [rad or m], infinite without limits.
    """
    path = rule.path
    chain, used = path.minimal, set(path.minimal.coordinates)
    for turned in path.difference.turned:
        used |= set(turned.coordinates)
    found_speeds = speeds(path, reach)
    found: list[dict[str, Any]] = []
    for index in range(len(reach)):
        rates = chain.coefficients[:, index][chain.coefficients[:, index] != 0.0]
        slides = bool(np.any(chain.slides[:, :, index]))
        speed = float(found_speeds[index])
        if rule.stop is not None:
            found.append({"way": "stop" if rule.stop.coefficients[index] else "none"})
        elif index not in used:
            found.append({"way": "none"})
        elif path.is_harmonic and len(rates) == 1 and not slides:
            found.append({"way": "turn", "rate": float(rates[0])})
        elif path.is_harmonic and not len(rates):
            found.append({"way": "slide"})
        else:
            found.append({"way": "step", "speed": speed if np.isfinite(speed) else None})
    return found


def speeds(path: RelativePath, reach: Array) -> Array:
    """Return bounds (n,) of `|d separation / d q_j|`: the lever arms of w, plus the largest of `sum_i t_i e_i`."""
    chain, difference = path.minimal, path.difference
    speed = lever_arms(chain, reach).first
    first = difference.corners[0].shape[1]
    for corners, edges in zip(difference.corners, (difference.turned[:first], difference.turned[first:]), strict=True):
        arms = np.array([lever_arms(edge, reach).first for edge in edges]).reshape(len(edges), len(reach))
        speed = speed + (np.abs(corners) @ arms).max(axis=0)
    return speed * (1.0 + EXPLORER_SPEED)
