"""Loop bodies straight to LLVM: what Numba would need seconds to type and lower takes milliseconds here.

A body is a list of assignments of arithmetic to names and to rows of scratch, all of one real type but for the integer
bits of `sincos`. Numba spends about 5 ms of Python a statement on such code, which is a minute for a few hundred
boundaries; here each statement becomes the one instruction that it is. Only this module and the generated
files import Numba.
"""

from __future__ import annotations

import ast
import importlib
import math
from typing import Any

_ir: Any = importlib.import_module("llvmlite.ir")
_types: Any = importlib.import_module("numba.types")
_cgutils: Any = importlib.import_module("numba.core.cgutils")
_intrinsic: Any = importlib.import_module("numba.extending").intrinsic

__all__ = ["loop_body"]

_FLAGS = ("contract",)
"""The one liberty that LLVM gets: `a * b + c` with one rounding."""

_REAL: dict[type[ast.operator], str] = {ast.Add: "fadd", ast.Sub: "fsub", ast.Mult: "fmul", ast.Div: "fdiv"}
_INTEGER: dict[type[ast.operator], str] = {
    ast.Add: "add",
    ast.BitAnd: "and_",
    ast.BitXor: "xor",
    ast.LShift: "shl",
}
_COMPARE: dict[type[ast.cmpop], str] = {ast.Lt: "<", ast.Gt: ">", ast.NotEq: "!="}


def loop_body(text: str, tile: int, is_single: bool) -> Any:
    """Return a Numba intrinsic `body(w, i)` that runs the statements on column i of the scratch w."""
    tree = ast.parse(text)

    def body(_: Any, w: Any, i: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            array = _cgutils.create_struct_proxy(signature.args[0])(context, builder, value=args[0])
            _Lowering(builder, array.data, args[1], tile, is_single).run(tree)
            return context.get_dummy_value()

        return _types.void(w, _types.intp), generate

    body.__doc__ = "Run one loop body."
    return _intrinsic(body)


class _Lowering:
    def __init__(self, builder: Any, data: Any, index: Any, tile: int, is_single: bool) -> None:
        self.builder, self.data, self.index, self.tile = builder, data, index, tile
        self.real: Any = _ir.FloatType() if is_single else _ir.DoubleType()
        self.integer: Any = _ir.IntType(64)
        self.names: dict[str, Any] = {}

    def run(self, tree: ast.Module) -> None:
        for statement in tree.body:
            if not isinstance(statement, ast.Assign):
                raise TypeError(ast.dump(statement))
            value, target = self.value(statement.value), statement.targets[0]
            if isinstance(target, ast.Name):
                self.names[target.id] = value
            else:
                self.builder.store(value, self.pointer(target))

    def pointer(self, node: ast.expr) -> Any:
        """Return the address of `w[row, i]`."""
        if not (isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Tuple)):
            raise TypeError(ast.dump(node))
        row = ast.literal_eval(node.slice.elts[0])
        offset = self.builder.add(self.index, self.integer(row * self.tile), flags=("nsw",))
        return self.builder.gep(self.data, [offset], inbounds=True)

    def value(self, node: ast.expr, like: Any = None) -> Any:
        if isinstance(node, ast.Name):
            return self.real(math.inf) if node.id == "INFINITY" else self.names[node.id]
        if isinstance(node, ast.Constant):
            return self.integer(node.value) if like is self.integer else self.real(node.value)
        if isinstance(node, ast.UnaryOp):
            return self.real(ast.literal_eval(node))
        if isinstance(node, ast.Subscript):
            return self.builder.load(self.pointer(node))
        if isinstance(node, ast.BinOp):
            return self.binary(node)
        if isinstance(node, ast.Compare):
            left = self.value(node.left)
            kind = self.integer if left.type == self.integer else None
            sign, right = _COMPARE[type(node.ops[0])], self.value(node.comparators[0], kind)
            compare = self.builder.icmp_signed if kind else self.builder.fcmp_ordered
            return compare(sign, left, right)
        if isinstance(node, ast.Call):
            return self.call(ast.unparse(node.func), node.args)
        raise TypeError(ast.dump(node))

    def binary(self, node: ast.BinOp) -> Any:
        left = self.value(node.left)
        if left.type == self.integer:
            return getattr(self.builder, _INTEGER[type(node.op)])(left, self.value(node.right, self.integer))
        return getattr(self.builder, _REAL[type(node.op)])(left, self.value(node.right), flags=_FLAGS)

    def call(self, name: str, args: list[ast.expr]) -> Any:
        if name == "F":
            return self.real(ast.literal_eval(args[0]))
        values = [self.value(arg) for arg in args]
        if name == "pick":
            return self.builder.select(*values)
        if name == "bits":
            return self.builder.bitcast(values[0], self.integer)
        if name == "real":
            return self.builder.bitcast(values[0], self.real)
        if name == "math.sqrt":
            kind = _ir.FunctionType(self.real, [self.real])
            root = _cgutils.get_or_insert_function(
                self.builder.module, kind, f"llvm.sqrt.{'f32' if self.real == _ir.FloatType() else 'f64'}"
            )
            return self.builder.call(root, values)
        raise TypeError(name)
