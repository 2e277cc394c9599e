"""CasADi: signed clearances as a `Function`: SX for closed forms, callbacks for nearest points that need an iteration.

CasADi itself differentiates an SX function, also for Hessians. The nearest points of boxes and prisms need an
iteration, so these rows are callbacks with a Jacobian, but without a Hessian.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from typing import Any

import numpy as np

from pinbound.contact import ContactRule
from pinbound.exceptions import UnsupportedError
from pinbound.export.nodes import SignedNodes, is_closed, signed_nodes
from pinbound.kernel import CommonMark
from pinbound.typing import Array

__all__ = ["casadi_function"]

_kept: list[Any] = []  # CasADi does not keep a callback's Python object alive


def casadi_function(
    rules: Sequence[ContactRule],
    marks: Sequence[tuple[str, str]],
    n: int,
    common: Callable[[], Mapping[str, CommonMark] | None],
    name: str,
) -> Any:
    """Return the function `q (n) -> h (m)`; arguments as for `signed_nodes`.

    Raises:
        UnsupportedError: If CasADi is not installed.
    """
    try:
        casadi = import_module("casadi")
    except ImportError as error:
        raise UnsupportedError("this needs casadi, which is not installed: pip install 'pinbound[bridges]'") from error
    closed = [k for k, rule in enumerate(rules) if is_closed(rule)]
    nodes = signed_nodes([rules[k] for k in closed], [marks[k] for k in closed], n, common)
    if len(closed) == len(rules):
        q = casadi.SX.sym("q", n)
        return casadi.Function(name, [q], [casadi.vertcat(*_expressions(casadi, nodes, q))], ["q"], ["h"])
    q = casadi.MX.sym("q", n)
    inner = casadi.SX.sym("q", n)
    easy = casadi.Function(f"{name}_closed", [inner], [casadi.vertcat(*_expressions(casadi, nodes, inner))])
    searched = [k for k in range(len(rules)) if k not in closed]
    callback = _callback(casadi, f"{name}_searched", [rules[k] for k in searched], n)
    order = np.argsort([*closed, *searched]).tolist()
    return casadi.Function(name, [q], [casadi.vertcat(easy(q), callback(q))[order]], ["q"], ["h"])


def _expressions(casadi: Any, nodes: SignedNodes, q: Any) -> list[Any]:
    """Return the expressions of the values.

    A `hold` node has a derivative of zero elsewhere. Here it is replaced by its operand: the first derivative is the
    same, and a Hessian needs the operand.
    """
    graph, found = nodes.graph, dict[int, Any]()
    for number in graph.reachable(nodes.values):
        node = graph.nodes[number]
        if node.kind == "constant":
            found[number] = casadi.SX(node.value)
            continue
        if node.kind == "coordinate":
            found[number] = q[node.args[0]]
            continue
        if node.kind in ("cos", "sin"):
            terms = [c * q[j] for j, c in enumerate(graph.angles[node.args[0]]) if c]
            found[number] = getattr(casadi, node.kind)(sum(terms[1:], start=terms[0]))
            continue
        args = [found[operand] for operand in node.args]
        if node.kind == "pick":
            found[number] = casadi.if_else(args[0] < args[1], args[2], args[3])
        elif node.kind == "sqrt":
            found[number] = casadi.sqrt(args[0])
        elif node.kind == "hold":
            found[number] = args[0]
        else:
            a, b = args
            found[number] = {"add": a + b, "sub": a - b, "mul": a * b}[node.kind] if node.kind != "div" else a / b
    return [found[number] for number in nodes.values]


def _callback(casadi: Any, name: str, rules: Sequence[ContactRule], n: int) -> Any:
    """Return a callback of the signed clearances of rules, with its Jacobian."""
    m = len(rules)

    def values(q: Any) -> Array:
        Q = np.array(q, dtype=np.float64).reshape(1, n)
        return np.array([rule.signed(Q)[0] for rule in rules])

    def slopes(q: Any) -> Array:
        Q = np.array(q, dtype=np.float64).reshape(1, n)
        return np.array([rule.gradients(Q)[0] for rule in rules])

    class Jacobian(casadi.Callback):
        """d h / d q."""

        def __init__(self, title: str, options: Any) -> None:
            casadi.Callback.__init__(self)
            self.construct(title, options)

        def get_n_in(self) -> int:
            return 2

        def get_n_out(self) -> int:
            return 1

        def get_sparsity_in(self, index: int) -> Any:
            return casadi.Sparsity.dense(n, 1) if index == 0 else casadi.Sparsity.dense(m, 1)

        def get_sparsity_out(self, _: int) -> Any:
            return casadi.Sparsity.dense(m, n)

        def eval(self, arguments: Any) -> Any:
            return [casadi.DM(slopes(arguments[0]))]

    class Values(casadi.Callback):
        """h(q)."""

        def __init__(self, title: str) -> None:
            casadi.Callback.__init__(self)
            self.construct(title, {})

        def get_n_in(self) -> int:
            return 1

        def get_n_out(self) -> int:
            return 1

        def get_sparsity_in(self, _: int) -> Any:
            return casadi.Sparsity.dense(n, 1)

        def get_sparsity_out(self, _: int) -> Any:
            return casadi.Sparsity.dense(m, 1)

        def eval(self, arguments: Any) -> Any:
            return [casadi.DM(values(arguments[0]))]

        def has_jacobian(self, *_: Any) -> bool:
            return True

        def get_jacobian(self, title: str, _inputs: Any, _outputs: Any, options: Any) -> Any:
            made = Jacobian(title, options)
            _kept.append(made)
            return made

    made = Values(name)
    _kept.append(made)
    return made
