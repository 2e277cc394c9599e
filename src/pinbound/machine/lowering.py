"""Direct translation of loop bodies to LLVM, in milliseconds; Numba would need seconds to type and lower them.

A body is a list of assignments of arithmetic to names and to rows of scratch, all of one real type except the integer
bits of `sincos`. Numba spends about 5 ms of Python on each statement of such code, which is a minute for a few hundred
boundaries. Here each statement becomes one instruction. Only this module and the generated files import Numba.
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

__all__ = ["copy_columns", "furthest", "load", "loop_body"]

_FLAGS = ("contract",)
"""The one optimisation that may change rounding: `a * b + c` with one rounding."""

_PIECE = 16
"""Numbers of a column that are copied at once: columns are written side by side, which is faster than one after
another."""

_REAL: dict[type[ast.operator], str] = {ast.Add: "fadd", ast.Sub: "fsub", ast.Mult: "fmul", ast.Div: "fdiv"}
_INTEGER: dict[type[ast.operator], str] = {
    ast.Add: "add",
    ast.BitAnd: "and_",
    ast.BitXor: "xor",
    ast.LShift: "shl",
}
_COMPARE: dict[type[ast.cmpop], str] = {ast.Lt: "<", ast.Gt: ">", ast.NotEq: "!="}


def loop_body(text: str, tile: int, is_single: bool) -> Any:
    """Return a Numba intrinsic `body(w, i)` that runs the statements on column i of the scratch that w points to."""
    tree = ast.parse(text)

    def body(_: Any, w: Any, i: Any) -> Any:
        def generate(context: Any, builder: Any, _: Any, args: Any) -> Any:
            _Lowering(builder, args[0], args[1], tile, is_single).run(tree)
            return context.get_dummy_value()

        return _types.void(w, _types.intp), generate

    body.__doc__ = "Run one loop body."
    return _intrinsic(body)


@_intrinsic
def load(_: Any, Q: Any, at: Any) -> Any:
    """Load `Q[at]` alone: an atomic unordered load is an ordinary load, but LLVM does not combine several to a gather.

    A gather along a column waits for memory; plain loads along the rows are prefetched.
    """

    def generate(_: Any, builder: Any, signature: Any, args: Any) -> Any:
        pointer = builder.gep(args[0], [args[1]])
        return builder.load_atomic(pointer, "unordered", _bytes(pointer.type.pointee))

    return Q.dtype(Q, _types.intp), generate


@_intrinsic
def copy_columns(
    _: Any, out: Any, at: Any, row: Any, column: Any, w: Any, source: Any, tile: Any, columns: Any, n: Any
) -> Any:
    """Copy rows of scratch, `w[source + c tile + i]`, to columns of the output, `out[at + i row + c column]`.

    It is one function for all loops, so that LLVM does not unroll it for each.
    """

    def generate(_: Any, builder: Any, signature: Any, args: Any) -> Any:
        out, at, row, column, w, source, tile, columns, n = args
        arguments = builder.gep(out, [at]), row, column, builder.gep(w, [source]), tile, columns, n
        kind = _ir.FunctionType(_ir.VoidType(), [argument.type for argument in arguments])
        function = _cgutils.get_or_insert_function(builder.module, kind, "pinbound_copy_columns")
        if function.is_declaration:
            function.linkage = "internal"
            function.attributes.add("noinline")
            _copy_columns(function)
        return builder.call(function, arguments)

    return _types.void(out, *[_types.intp] * 3, w, *[_types.intp] * 4), generate


def _copy_columns(function: Any) -> None:
    """Write the body: columns without gaps piece by piece, with all columns in turn; other columns number by number."""
    out, row, column, w, tile, columns, n = function.args
    builder = _ir.IRBuilder(function.append_basic_block())
    add, times, piece = builder.add, builder.mul, n.type(_PIECE)

    def copy(c: Any, start: Any, count: Any) -> None:
        places = [builder.gep(p, [add(times(c, step), start)]) for p, step in ((out, column), (w, tile))]
        _cgutils.raw_memcpy(builder, *places, count, _bytes(out.type.pointee))

    with builder.if_else(builder.icmp_signed("==", row, row.type(1))) as (is_dense, has_gaps):
        with is_dense:
            whole = builder.sdiv(n, piece)
            with _cgutils.for_range(builder, whole) as k, _cgutils.for_range(builder, columns) as c:
                copy(c.index, times(k.index, piece), piece)
            rest = times(whole, piece)
            with _cgutils.for_range(builder, columns) as c:
                copy(c.index, rest, builder.sub(n, rest))
        with has_gaps, _cgutils.for_range(builder, n) as i, _cgutils.for_range(builder, columns) as c:
            value = builder.load(builder.gep(w, [add(i.index, times(c.index, tile))]))
            builder.store(value, builder.gep(out, [add(times(i.index, row), times(c.index, column))]))
    builder.ret_void()


_WIDE = 8
"""Vertices that are examined together: two vectors of AVX2, one of AVX-512."""


def furthest(builder: Any, args: list[Any]) -> Any:
    """Return the index of the vertex that is least along (x, y, z), the first of equal ones within each of eight lanes.

    The arguments are s, start, count, x, y, z. Coordinates are stored one after the other: those along x at `s[start]`,
    those along y at `s[start + count]`, those along z after them; count is a multiple of eight. LLVM does not vectorise
    a loop that keeps the index of its minimum.
    """
    kind = _ir.FunctionType(_ir.IntType(64), [argument.type for argument in args])
    function = _cgutils.get_or_insert_function(builder.module, kind, "pinbound_furthest")
    if function.is_declaration:
        function.linkage = "internal"
        function.attributes.add("alwaysinline")
        _furthest(function)
    return builder.call(function, args)


def _furthest(function: Any) -> None:
    """Write the body: eight minima with their indices, then the least of the eight."""
    s, start, count, *direction = function.args
    integer = count.type
    reals, integers = _ir.VectorType(_ir.DoubleType(), _WIDE), _ir.VectorType(integer, _WIDE)
    entry, loop, last = (function.append_basic_block(name) for name in ("entry", "loop", "last"))
    builder = _ir.IRBuilder(entry)
    wide = [_splat(builder, _ir.Constant(reals, _ir.Undefined), number) for number in direction]
    step = _splat(builder, _ir.Constant(integers, _ir.Undefined), integer(_WIDE))
    builder.branch(loop)
    builder.position_at_end(loop)
    at, best, where, places = (builder.phi(kind) for kind in (integer, reals, integers, integers))
    at.add_incoming(integer(0), entry)
    best.add_incoming(_ir.Constant(reals, [math.inf] * _WIDE), entry)
    where.add_incoming(_ir.Constant(integers, [0] * _WIDE), entry)
    places.add_incoming(_ir.Constant(integers, list(range(_WIDE))), entry)
    total: Any = None
    for axis, number in enumerate(wide):
        offset = builder.add(builder.add(start, at), builder.mul(count, integer(axis)))
        pointer = builder.bitcast(builder.gep(s, [offset]), reals.as_pointer())
        product = builder.fmul(builder.load(pointer, align=8), number, flags=_FLAGS)
        total = product if total is None else builder.fadd(total, product, flags=_FLAGS)
    less = builder.fcmp_ordered("<", total, best)
    better, there = builder.select(less, total, best), builder.select(less, places, where)
    after = builder.add(at, integer(_WIDE))
    at.add_incoming(after, loop)
    best.add_incoming(better, loop)
    where.add_incoming(there, loop)
    places.add_incoming(builder.add(places, step), loop)
    builder.cbranch(builder.icmp_signed("<", after, count), loop, last)
    builder.position_at_end(last)
    width = _WIDE // 2
    while width:
        order = [_ir.Constant(_ir.VectorType(_ir.IntType(32), width), list(range(k, k + width))) for k in (0, width)]
        low, high = (builder.shuffle_vector(better, better, mask) for mask in order)
        left, right = (builder.shuffle_vector(there, there, mask) for mask in order)
        less = builder.fcmp_ordered("<", high, low)
        better, there = builder.select(less, high, low), builder.select(less, right, left)
        width //= 2
    builder.ret(builder.extract_element(there, _ir.IntType(32)(0)))


def _splat(builder: Any, vector: Any, number: Any) -> Any:
    """Return a vector of one number."""
    for lane in range(_WIDE):
        vector = builder.insert_element(vector, number, _ir.IntType(32)(lane))
    return vector


def _bytes(real: Any) -> int:
    return 4 if isinstance(real, _ir.FloatType) else 8


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
