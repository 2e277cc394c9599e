"""A program in plain NumPy: chunk by chunk, so that all buffers stay in L2.

Either each node is one ufunc into a reused buffer. Or, if the components of all vectors are linear in few products of
cosines and sines, one matrix product computes them from these features.

If `np.tan` of float64 is vector code and `np.sin` is not (AVX-512), cos and sin come from `t = tan(x / 2)`: `cos x = 2
/ (1 + t^2) - 1`, `sin x = t 2 / (1 + t^2)`, to 4e-16. NumPy's dispatch is read once. Nothing is timed, so one machine
always gives the same bits.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np

from pinbound.kernel.program import Program
from pinbound.kernel.scalars import Graph
from pinbound.typing import Array

__all__ = ["LinearProgram", "VectorisedProgram", "has_fast_tan"]

_L2_BYTES = 1 << 20
"""The size of a common L2 cache; half and twice as much were measured to be slower."""

_DENSE = 12
"""An entry of a matrix costs this much less than a ufunc on one term; sparser matrices than 1 in 12 do not pay."""


def _pick(a: Any, b: Any, x: Any, y: Any, out: Any = None) -> Any:
    """Return x where a < b, else y."""
    if out is None:
        out = np.empty(np.broadcast_shapes(*map(np.shape, (a, b, x, y))))
    np.copyto(out, y)
    np.copyto(out, x, where=np.less(a, b))
    return out


def _hold(x: Any, out: Any = None) -> Any:
    """Return x."""
    if out is None:
        return x
    out[:] = x
    return out


_OPERATIONS: dict[str, Any] = {
    "add": np.add,
    "sub": np.subtract,
    "mul": np.multiply,
    "div": np.divide,
    "pick": _pick,
    "hold": _hold,
}


@cache
def has_fast_tan() -> bool:
    """Return whether this NumPy runs the tangent of float64 in AVX-512 code: 1.4 ns, against 18 for sine and cosine."""
    introspect: Any = getattr(np.lib, "introspect", None)
    if introspect is None:
        return False
    found = introspect.opt_func_info(func_name="^tan$", signature="float64")
    current = " ".join(str(entry.get("current", "")) for entry in found.get("tan", {}).values())
    return any(target in current for target in ("X86_V4", "AVX512"))


class VectorisedProgram:
    """Evaluates squares, or squares and gradients, of a program."""

    def __init__(self, program: Program, gradients: bool = False) -> None:
        """Order the nodes, boundary by boundary, and find the last use of each."""
        self.program = program
        inner: Sequence[Sequence[int]] = program.gradients() if gradients else [()] * len(program.squares)
        self.outputs = [[square, *row] for square, row in zip(program.squares, inner, strict=True)]
        self.steps = self._order()
        self.last_use = self._last_use()
        live = self._most_alive()
        self.chunk = int(min(8192, max(512, _L2_BYTES // 8 // max(live, 1) // 256 * 256)))

    def _order(self) -> list[list[int]]:
        graph, done = self.program.graph, set[int]()
        steps: list[list[int]] = []
        for outputs in self.outputs:
            step = [number for number in graph.reachable(outputs) if number not in done]
            done.update(step)
            steps.append(step)
        return steps

    def _last_use(self) -> dict[int, int]:
        last: dict[int, int] = {}
        for position, (step, outputs) in enumerate(zip(self.steps, self.outputs, strict=True)):
            for number in step:
                if self.program.graph.nodes[number].kind in _OPERATIONS:
                    last.update(dict.fromkeys(self.program.graph.nodes[number].args, position))
                last.setdefault(number, position)
            last.update(dict.fromkeys(outputs, position))
        return last

    def _most_alive(self) -> int:
        most = 0
        for position in range(len(self.steps)):
            born = sum(len(step) for step in self.steps[: position + 1])
            dead = sum(last < position for last in self.last_use.values())
            most = max(most, born - dead)
        return most

    def run(self, Q: Array, take: Any) -> None:
        """Evaluate chunk by chunk.

        Args:
            Q: (N, n).
            take: Called as `take(rows, k, square, dots)` for every chunk (a slice) and boundary k.
        """
        buffers: list[Array] = []
        with np.errstate(all="ignore"):
            for start in range(0, len(Q), self.chunk):
                rows = slice(start, min(start + self.chunk, len(Q)))
                self._chunk(Q[rows], rows, buffers, take)

    def _chunk(self, Q: Array, rows: slice, buffers: list[Array], take: Any) -> None:
        graph, count = self.program.graph, len(Q)

        def fresh() -> Array:
            return buffers.pop() if buffers else np.empty(self.chunk)

        columns = _Columns(Q)
        values: dict[int, Any] = {}
        owned: dict[int, Array] = {}
        for position, (step, outputs) in enumerate(zip(self.steps, self.outputs, strict=True)):
            for number in step:
                node = graph.nodes[number]
                if node.kind == "constant":
                    values[number] = node.value
                elif node.kind == "coordinate":
                    values[number] = columns[node.args[0]]
                elif node.kind in ("cos", "sin"):
                    values[number] = columns.turn(graph.angles[node.args[0]])[node.kind == "sin"]
                else:
                    buffer = owned[number] = fresh()
                    args = (values[arg] for arg in node.args)
                    values[number] = _OPERATIONS[node.kind](*args, out=buffer[:count])
            take(rows, position, values[outputs[0]], [values[number] for number in outputs[1:]])
            for number in [n for n in owned if self.last_use[n] <= position]:
                buffers.append(owned.pop(number))


class LinearProgram:
    """Evaluates all squares by one matrix product for each chunk: `X = A F`, F (features, rows), A (3 m, features)."""

    def __init__(self, program: Program) -> None:
        """Find the features and the matrix."""
        self.program = program
        forms = [_linear_form(program.graph, component) for r in program.vectors for component in r]
        self.features = sorted({feature for form in forms for feature in form})
        matrix = np.array([[form.get(feature, 0.0) for feature in self.features] for form in forms])
        matrix = matrix.reshape(len(program.vectors), 3, len(self.features)).swapaxes(0, 1)
        self.matrices = [part for part in matrix if np.any(part)] or [matrix[0]]
        self._order = program.graph.reachable(self.features)
        components = [component for r in program.vectors for component in r]
        inner = len(program.graph.reachable(components)) - len(program.graph.reachable(self.features))
        few = len(self.features) * len(forms) <= _DENSE * inner
        self.is_worthwhile = few and not any(program.signed)
        rows = len(self.features) + len(program.squares) * (len(self.matrices) + 1)
        self.chunk = int(min(8192, max(512, _L2_BYTES // 8 // rows // 256 * 256)))

    def run(self, Q: Array, take: Any) -> None:
        """Evaluate chunk by chunk; `take(rows, squares)` gets a slice and (m, rows) squares, free to overwrite."""
        m = len(self.program.squares)
        F, X, S = (np.empty((rows, self.chunk)) for rows in (len(self.features), m, m))
        with np.errstate(all="ignore"):
            for start in range(0, len(Q), self.chunk):
                rows = slice(start, min(start + self.chunk, len(Q)))
                count = rows.stop - start
                features, product, squares = F[:, :count], X[:, :count], S[:, :count]
                self._fill(features, Q[rows])
                np.matmul(self.matrices[0], features, out=squares)
                np.multiply(squares, squares, out=squares)
                for part in self.matrices[1:]:
                    np.matmul(part, features, out=product)
                    np.multiply(product, product, out=product)
                    np.add(squares, product, out=squares)
                take(rows, squares)

    def _fill(self, features: Array, Q: Array) -> None:
        """Evaluate the features of a chunk, each into its row."""
        graph, columns = self.program.graph, _Columns(Q)
        targets = {feature: features[row] for row, feature in enumerate(self.features)}
        values: dict[int, Any] = {}
        for number in self._order:
            node = graph.nodes[number]
            if node.kind in _OPERATIONS:
                args = (values[arg] for arg in node.args)
                values[number] = _OPERATIONS[node.kind](*args, out=targets.get(number))
                continue
            if node.kind == "constant":
                values[number] = node.value
            elif node.kind == "coordinate":
                values[number] = columns[node.args[0]]
            else:
                values[number] = columns.turn(graph.angles[node.args[0]])[node.kind == "sin"]
            if number in targets:
                targets[number][:] = values[number]


def _linear_form(graph: Graph, number: int) -> dict[int, float]:
    """Return a node as coefficients over features: nodes that are not sums or multiples; constants count as one."""
    node = graph.nodes[number]
    if node.kind == "constant":
        return {graph.constant(1.0): node.value} if node.value else {}
    if node.kind in ("add", "sub"):
        form = dict(_linear_form(graph, node.args[0]))
        sign = 1.0 if node.kind == "add" else -1.0
        for feature, value in _linear_form(graph, node.args[1]).items():
            form[feature] = form.get(feature, 0.0) + sign * value
        return form
    if node.kind == "mul":
        for factor, other in (node.args, node.args[::-1]):
            value = graph.value_of(factor)
            if value is not None:
                return {feature: value * entry for feature, entry in _linear_form(graph, other).items()}
    return {number: 1.0}


class _Columns(dict[int, Any]):
    """Contiguous columns of Q, and cos and sin of angles, made when first needed."""

    def __init__(self, Q: Array) -> None:
        super().__init__()
        self.Q = Q
        self.turns: dict[tuple[float, ...], tuple[Array, Array]] = {}

    def __missing__(self, j: int) -> Array:
        self[j] = np.ascontiguousarray(self.Q[:, j])
        return self[j]

    def turn(self, coefficients: tuple[float, ...]) -> tuple[Array, Array]:
        if coefficients not in self.turns:
            self.turns[coefficients] = _cos_sin(coefficients, self, len(self.Q))
        return self.turns[coefficients]


def _cos_sin(coefficients: Sequence[float], columns: dict[int, Array], count: int) -> tuple[Array, Array]:
    x = np.zeros(count)
    for j, c in enumerate(coefficients):
        if c:
            x += columns[j] if c == 1.0 else c * columns[j]
    if not has_fast_tan():
        return np.cos(x), np.sin(x)
    x *= 0.5
    t = np.tan(x, out=x)
    cos = t * t
    cos += 1.0
    np.divide(2.0, cos, out=cos)
    t *= cos
    cos -= 1.0
    return cos, t
