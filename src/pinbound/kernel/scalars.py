"""Scalar expressions over q, each built once: the computation of a set of chains, for any output language.

An expression is a node of a directed acyclic graph, identified by its number. Building the same node twice gives the
same number. So what two boundaries share is computed once. Zeros, ones and constants are simplified while building.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

__all__ = ["COSTS", "LEAVES", "Graph", "Node", "Vector"]

COSTS = {
    "add": 1.0,
    "sub": 1.0,
    "mul": 1.0,
    "div": 4.0,
    "sqrt": 6.0,
    "pick": 2.0,
    "hold": 0.0,
    "cos": 12.0,
    "sin": 12.0,
    "constant": 0.0,
    "coordinate": 0.0,
}
"""Cost of a node by kind, in vector instructions; cos and sin of one angle come as a pair."""

LEAVES = ("constant", "coordinate", "cos", "sin")
"""Kinds whose `args` are not nodes."""

Vector = tuple[int, int, int]


@dataclass(frozen=True)
class Node:
    """One scalar.

    Attributes:
        kind: A key of `COSTS`.
        args: Numbers of the operands; for a coordinate its index in q, for cos and sin the index of the angle. A pick
            (a, b, x, y) is x where a < b, else y; a hold is its operand, but a constant for derivatives.
        value: The constant's value.
    """

    kind: str
    args: tuple[int, ...] = ()
    value: float = 0.0


@dataclass
class Graph:
    """The nodes, ordered such that operands come before the nodes that use them.

    Attributes:
        nodes: The nodes.
        angles: Coefficients over q of the angles whose cos and sin are leaves.

    Example:
        >>> graph = Graph()
        >>> x, one = graph.coordinate(0), graph.constant(1.0)
        >>> graph.mul(x, one) == x, graph.add(x, one) == graph.add(one, x)
        (True, True)
    """

    nodes: list[Node] = field(default_factory=list[Node])
    angles: list[tuple[float, ...]] = field(default_factory=list[tuple[float, ...]])
    _known: dict[Node, int] = field(default_factory=dict[Node, int])
    _of_angle: dict[tuple[float, ...], int] = field(default_factory=dict[tuple[float, ...], int])
    _derivatives: dict[tuple[int, int], int] = field(default_factory=dict[tuple[int, int], int])

    def _make(self, node: Node) -> int:
        number = self._known.get(node)
        if number is None:
            number = len(self.nodes)
            self.nodes.append(node)
            self._known[node] = number
        return number

    def constant(self, value: float) -> int:
        """Return a constant; -0.0 is 0.0."""
        return self._make(Node("constant", value=float(value) + 0.0))

    def coordinate(self, index: int) -> int:
        """Return q[index]."""
        return self._make(Node("coordinate", (index,)))

    def angle(self, coefficients: Sequence[float]) -> tuple[int, int]:
        """Return cos and sin, as leaves, of the angle `coefficients . q`."""
        key = tuple(map(float, coefficients))
        index = self._of_angle.setdefault(key, len(self.angles))
        if index == len(self.angles):
            self.angles.append(key)
        return self._make(Node("cos", (index,))), self._make(Node("sin", (index,)))

    def value_of(self, number: int) -> float | None:
        """Return the value of a constant; None for other nodes."""
        node = self.nodes[number]
        return node.value if node.kind == "constant" else None

    def add(self, x: int, y: int) -> int:
        """Return x + y."""
        a, b = self.value_of(x), self.value_of(y)
        if a is not None and b is not None:
            return self.constant(a + b)
        if a == 0.0:
            return y
        if b == 0.0:
            return x
        return self._make(Node("add", (min(x, y), max(x, y))))

    def sub(self, x: int, y: int) -> int:
        """Return x - y."""
        a, b = self.value_of(x), self.value_of(y)
        if a is not None and b is not None:
            return self.constant(a - b)
        if b == 0.0:
            return x
        if x == y:
            return self.constant(0.0)
        return self._make(Node("sub", (x, y)))

    def mul(self, x: int, y: int) -> int:
        """Return x y."""
        a, b = self.value_of(x), self.value_of(y)
        if a is not None and b is not None:
            return self.constant(a * b)
        if a == 0.0 or b == 0.0:
            return self.constant(0.0)
        if a == 1.0:
            return y
        if b == 1.0:
            return x
        return self._make(Node("mul", (min(x, y), max(x, y))))

    def div(self, x: int, y: int) -> int:
        """Return x / y."""
        a, b = self.value_of(x), self.value_of(y)
        if b is not None and b != 0.0:
            return self.constant(a / b) if a is not None else self.mul(x, self.constant(1.0 / b))
        return self._make(Node("div", (x, y)))

    def sqrt(self, x: int) -> int:
        """Return the square root of x."""
        a = self.value_of(x)
        return self.constant(math.sqrt(a)) if a is not None else self._make(Node("sqrt", (x,)))

    def pick(self, a: int, b: int, x: int, y: int) -> int:
        """Return x where a < b, else y."""
        u, v = self.value_of(a), self.value_of(b)
        if u is not None and v is not None:
            return x if u < v else y
        return x if x == y else self._make(Node("pick", (a, b, x, y)))

    def hold(self, x: int) -> int:
        """Return x as a node whose derivatives are zero."""
        return x if self.value_of(x) is not None else self._make(Node("hold", (x,)))

    def total(self, terms: Iterable[int]) -> int:
        """Return the sum."""
        result = self.constant(0.0)
        for term in terms:
            result = self.add(result, term)
        return result

    def linear(self, coefficients: Sequence[float], offset: float = 0.0) -> int:
        """Return `coefficients . q + offset`."""
        terms = [self.mul(self.constant(c), self.coordinate(j)) for j, c in enumerate(coefficients) if c]
        return self.total([*terms, self.constant(offset)])

    def dot(self, x: Vector, y: Vector) -> int:
        """Return x . y."""
        return self.total(self.mul(a, b) for a, b in zip(x, y, strict=True))

    def derivative(self, number: int, coordinate: int) -> int:
        """Return the derivative of a node by q[coordinate]."""
        key = (number, coordinate)
        if key not in self._derivatives:
            self._derivatives[key] = self._derive(self.nodes[number], coordinate)
        return self._derivatives[key]

    def _derive(self, node: Node, j: int) -> int:
        if node.kind in ("constant", "hold"):
            return self.constant(0.0)
        if node.kind == "coordinate":
            return self.constant(float(node.args[0] == j))
        if node.kind == "pick":
            a, b, x, y = node.args
            return self.pick(a, b, self.derivative(x, j), self.derivative(y, j))
        if node.kind in ("cos", "sin"):
            rate = self.angles[node.args[0]][j]
            other = self._make(Node("sin" if node.kind == "cos" else "cos", node.args))
            return self.mul(self.constant(-rate if node.kind == "cos" else rate), other)
        if node.kind == "sqrt":
            root = self.sqrt(node.args[0])
            return self.div(self.mul(self.constant(0.5), self.derivative(node.args[0], j)), root)
        x, y = node.args
        if node.kind in ("add", "sub"):
            combine = self.add if node.kind == "add" else self.sub
            return combine(self.derivative(x, j), self.derivative(y, j))
        if node.kind == "div":
            change = self.sub(self.mul(self.derivative(x, j), y), self.mul(x, self.derivative(y, j)))
            return self.div(change, self.mul(y, y))
        return self.add(self.mul(self.derivative(x, j), y), self.mul(x, self.derivative(y, j)))

    def reachable(self, outputs: Iterable[int]) -> list[int]:
        """Return the numbers of all nodes that the outputs need, operands first."""
        needed, stack = set[int](), list(outputs)
        while stack:
            number = stack.pop()
            if number not in needed:
                needed.add(number)
                if self.nodes[number].kind not in LEAVES:
                    stack.extend(self.nodes[number].args)
        return sorted(needed)

    def cost(self, outputs: Iterable[int]) -> float:
        """Return the cost of all nodes that the outputs need."""
        return math.fsum(COSTS[self.nodes[number].kind] for number in self.reachable(outputs))
