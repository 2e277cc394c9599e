"""Translation of a small part of Python to LLVM's instructions, for functions with loops and branches.

The text has assignments to names, tuples of names, and entries behind pointers; `if`, `while`, `for` over a range,
`break`, `continue`, `return`; arithmetic, comparisons, `and`, `or`, `not`, a conditional value. A name keeps the type
of its first value: real, integer, or truth. An integer becomes a real in an expression with a real. Both sides of `and`
and `or`, and of a conditional value, are evaluated. `machine/lanes.py` adds vectors.
"""

from __future__ import annotations

import ast
import importlib
import math
from collections.abc import Callable
from typing import Any

_ir: Any = importlib.import_module("llvmlite.ir")

__all__ = ["COMPARE", "FLAGS", "INTEGER", "OPERATORS", "REAL", "TRUTH", "declared", "write_statements"]

FLAGS = ("contract",)
REAL, INTEGER, TRUTH = _ir.DoubleType(), _ir.IntType(64), _ir.IntType(1)
OPERATORS: dict[type[ast.operator], tuple[str, str]] = {
    ast.Add: ("fadd", "add"),
    ast.Sub: ("fsub", "sub"),
    ast.Mult: ("fmul", "mul"),
    ast.Div: ("fdiv", ""),
    ast.FloorDiv: ("", "sdiv"),
    ast.BitAnd: ("", "and_"),
    ast.BitOr: ("", "or_"),
    ast.BitXor: ("", "xor"),
    ast.LShift: ("", "shl"),
    ast.RShift: ("", "ashr"),
}
COMPARE: dict[type[ast.cmpop], str] = {
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
    ast.Eq: "==",
    ast.NotEq: "!=",
}
_CONSTANTS = {"math.inf": math.inf, "math.nan": math.nan}
_ROOTS = {"math.sqrt": "llvm.sqrt.f64", "abs": "llvm.fabs.f64", "math.cos": "cos", "math.sin": "sin"}


def declared(module: Any, kind: Any, name: str) -> Any:
    """Return the function of a module with that name; declare it first if necessary."""
    found = module.globals.get(name)
    return found if found is not None else _ir.Function(module, kind, name)


def write_statements(
    function: Any, names: list[str], calls: dict[str, Callable[[Any, list[Any]], Any]], text: str
) -> None:
    """Write the body of a function whose arguments are pointers and integers.

    Args:
        function: An LLVM function without a block, of the result type integer.
        names: Names of its arguments.
        calls: Further functions by name, which take the builder and values.
        text: All statements; the last is a return.
    """
    Statements(function, names, calls).run(text)


class Statements:
    """Writes the body of a function whose arguments are pointers and integers."""

    def __init__(self, function: Any, names: list[str], calls: dict[str, Callable[[Any, list[Any]], Any]]) -> None:
        """Start the body.

        Args:
            function: An LLVM function without a block, of the result type integer.
            names: Names of its arguments.
            calls: Further functions by name, which take the builder and values.
        """
        self.function, self.calls = function, calls
        self.entry = function.append_basic_block("entry")
        self.builder = _ir.IRBuilder(function.append_basic_block("start"))
        self.arguments = dict(zip(names, function.args, strict=True))
        self.places: dict[str, Any] = {}
        self.loops: list[tuple[Any, Any]] = []

    def run(self, text: str) -> None:
        """Write all statements; the last is a return."""
        start = self.builder.block
        self.block(ast.parse(text).body)
        _ir.IRBuilder(self.entry).branch(start)

    def block(self, statements: list[ast.stmt]) -> None:
        for statement in statements:
            if self.builder.block.is_terminated:
                return
            getattr(self, f"do_{type(statement).__name__}")(statement)

    def do_Assign(self, node: ast.Assign) -> None:
        target = node.targets[0]
        if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
            values = [self.value(part) for part in node.value.elts]
            for part, value in zip(target.elts, values, strict=True):
                self.store(part, value)
        else:
            self.store(target, self.value(node.value))

    def do_AugAssign(self, node: ast.AugAssign) -> None:
        self.store(node.target, self.binary(type(node.op), self.value(node.target), self.value(node.value)))

    def do_If(self, node: ast.If) -> None:
        then, other, after = (self.function.append_basic_block(name) for name in ("then", "else", "after"))
        self.builder.cbranch(self.truth(self.value(node.test)), then, other)
        for place, body in ((then, node.body), (other, node.orelse)):
            self.builder.position_at_end(place)
            self.block(body)
            if not self.builder.block.is_terminated:
                self.builder.branch(after)
        self.builder.position_at_end(after)

    def do_While(self, node: ast.While) -> None:
        test, body, after = (self.function.append_basic_block(name) for name in ("test", "body", "after"))
        self.builder.branch(test)
        self.builder.position_at_end(test)
        self.builder.cbranch(self.truth(self.value(node.test)), body, after)
        self.loop(body, node.body, test, after)

    def do_For(self, node: ast.For) -> None:
        bounds = [self.value(part) for part in node.iter.args]  # type: ignore[attr-defined]
        low, high = bounds if len(bounds) > 1 else (INTEGER(0), bounds[0])
        counter = self.alloca(INTEGER)
        self.builder.store(low, counter)
        names = ("test", "body", "step", "after")
        test, body, step, after = (self.function.append_basic_block(name) for name in names)
        self.builder.branch(test)
        self.builder.position_at_end(test)
        self.builder.cbranch(self.builder.icmp_signed("<", self.builder.load(counter), high), body, after)
        self.builder.position_at_end(body)
        self.store(node.target, self.builder.load(counter))
        self.loop(body, node.body, step, after)
        self.builder.position_at_end(step)
        self.builder.store(self.builder.add(self.builder.load(counter), INTEGER(1)), counter)
        self.builder.branch(test)
        self.builder.position_at_end(after)

    def loop(self, body: Any, statements: list[ast.stmt], again: Any, after: Any) -> None:
        self.loops.append((again, after))
        self.builder.position_at_end(body)
        self.block(statements)
        if not self.builder.block.is_terminated:
            self.builder.branch(again)
        self.loops.pop()
        self.builder.position_at_end(after)

    def do_Break(self, _: ast.Break) -> None:
        self.builder.branch(self.loops[-1][1])

    def do_Continue(self, _: ast.Continue) -> None:
        self.builder.branch(self.loops[-1][0])

    def do_Return(self, node: ast.Return) -> None:
        assert node.value is not None
        self.builder.ret(self.value(node.value))

    def alloca(self, kind: Any) -> Any:
        builder = _ir.IRBuilder(self.entry)
        return builder.alloca(kind)

    def store(self, target: ast.expr, value: Any) -> None:
        if isinstance(target, ast.Name):
            if target.id not in self.places:
                self.places[target.id] = self.alloca(value.type)
            place = self.places[target.id]
        else:
            place = self.pointer(target)
        self.builder.store(self.as_type(value, place.type.pointee), place)

    def pointer(self, node: ast.expr) -> Any:
        if not (isinstance(node, ast.Subscript) and isinstance(node.value, ast.Name)):
            raise TypeError(ast.dump(node))
        return self.builder.gep(self.arguments[node.value.id], [self.value(node.slice)], inbounds=True)

    def as_type(self, value: Any, kind: Any) -> Any:
        if value.type == kind:
            return value
        if kind == REAL and value.type == INTEGER:
            return self.builder.sitofp(value, kind)
        raise TypeError(f"{value.type} where {kind} is")

    def alike(self, *values: Any) -> list[Any]:
        kind = REAL if any(value.type == REAL for value in values) else values[0].type
        return [self.as_type(value, kind) for value in values]

    def binary(self, operator: type[ast.operator], left: Any, right: Any) -> Any:
        real, integer = OPERATORS[operator]
        left, right = self.alike(left, right)
        if left.type == REAL:
            return getattr(self.builder, real)(left, right, flags=FLAGS)
        return getattr(self.builder, integer)(left, right)

    def value(self, node: ast.expr) -> Any:
        return getattr(self, f"of_{type(node).__name__}")(node)

    def of_Name(self, node: ast.Name) -> Any:
        return self.builder.load(self.places[node.id]) if node.id in self.places else self.arguments[node.id]

    def of_Constant(self, node: ast.Constant) -> Any:
        kind = {bool: TRUTH, int: INTEGER, float: REAL}[type(node.value)]  # type: ignore[index]
        return kind(node.value)

    def of_Attribute(self, node: ast.Attribute) -> Any:
        return REAL(_CONSTANTS[ast.unparse(node)])

    def of_Subscript(self, node: ast.Subscript) -> Any:
        return self.builder.load(self.pointer(node))

    def of_BinOp(self, node: ast.BinOp) -> Any:
        return self.binary(type(node.op), self.value(node.left), self.value(node.right))

    def of_UnaryOp(self, node: ast.UnaryOp) -> Any:
        value = self.value(node.operand)
        if isinstance(node.op, ast.Not):
            return self.builder.not_(self.truth(value))
        return self.builder.fneg(value) if value.type == REAL else self.builder.neg(value)

    def truth(self, value: Any) -> Any:
        return value if value.type == TRUTH else self.builder.icmp_signed("!=", value, INTEGER(0))

    def of_BoolOp(self, node: ast.BoolOp) -> Any:
        combine = self.builder.and_ if isinstance(node.op, ast.And) else self.builder.or_
        found, *others = [self.truth(self.value(part)) for part in node.values]
        for other in others:
            found = combine(found, other)
        return found

    def of_Compare(self, node: ast.Compare) -> Any:
        left, right = self.alike(self.value(node.left), self.value(node.comparators[0]))
        sign = COMPARE[type(node.ops[0])]
        if left.type != REAL:
            return self.builder.icmp_signed(sign, left, right)
        compare = self.builder.fcmp_unordered if sign == "!=" else self.builder.fcmp_ordered
        return compare(sign, left, right)

    def of_IfExp(self, node: ast.IfExp) -> Any:
        return self.builder.select(
            self.truth(self.value(node.test)), *self.alike(self.value(node.body), self.value(node.orelse))
        )

    def of_Call(self, node: ast.Call) -> Any:
        name, values = ast.unparse(node.func), [self.value(arg) for arg in node.args]
        if name in self.calls:
            return self.calls[name](self.builder, values)
        if name == "np.int64":
            return self.builder.fptosi(values[0], INTEGER) if values[0].type == REAL else values[0]
        kind = _ir.FunctionType(REAL, [REAL])
        function = declared(self.builder.module, kind, _ROOTS[name])
        return self.builder.call(function, values)
