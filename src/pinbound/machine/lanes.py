"""Text for lanes: the language of `statements`, and vectors with one number for each lane (configuration).

It needs only llvmlite.
"""

from __future__ import annotations

import ast
import importlib
from typing import Any

from pinbound.machine.statements import COMPARE, FLAGS, INTEGER, OPERATORS, REAL, TRUTH, Statements, declared

_ir: Any = importlib.import_module("llvmlite.ir")

__all__ = ["lanes_module"]

SINGLE, SHORT, BYTE = _ir.FloatType(), _ir.IntType(32), _ir.IntType(8)
_BYTES = {"double": 8, "float": 4, "i64": 8, "i32": 4}


def lanes_module(text: str, lanes: int, symbol: str) -> str:
    """Return an LLVM module with one function of a text for lanes, with the prototype of all kernels.

    In addition to `statements`: the pointer `w` to scratch of float64 is also available as `t`, of float32, and as `k`,
    of 32-bit integers, each counted in its own numbers. A vector is `wide(s, at)`, `gather(Q, at, step)`, `every(x)` or
    `single(v)`, in float32, or an expression of vectors and scalars; `s[at] = v` stores all of it. `any(mask)`,
    `pick(mask, a, b)`, `sqrt(v)`, `bits(v)`, `real(i)`, `ones(mask)` count, choose, or read its bits.

    `k[at]` and the next entries hold the rows of the lanes, counted from `first`. `collect(Q, first, at)` is a vector
    of the numbers of these rows, `fetch` prefetches them, and `flag(index, first, at, a, b)` writes the byte `a + 2 b`
    for each row to `index`, as bytes. `floor(v)` are 32-bit integers of nonnegative numbers, and `union(at, v)` is the
    union of the bits of the bytes of `w` at v.

    Args:
        text: The text; it ends with a return.
        lanes: Number of lanes.
        symbol: The function's name.
    """
    module = _ir.Module()
    reals = REAL.as_pointer()
    kind = _ir.FunctionType(INTEGER, [reals, reals, INTEGER, INTEGER, INTEGER.as_pointer(), reals, INTEGER])
    function = _ir.Function(module, kind, symbol)
    for argument in function.args:
        if argument.type != INTEGER:
            argument.add_attribute("noalias")
    function.attributes.add("nounwind")
    names = ["Q", "out", "row", "column", "index", "w", "count"]
    _Lanes(function, names, lanes).run(text)
    return str(module)


class _Lanes(Statements):
    """Writes a body in which vectors occur."""

    def __init__(self, function: Any, names: list[str], lanes: int) -> None:
        super().__init__(function, names, {})
        self.lanes = lanes
        self.double, self.float = (_ir.VectorType(kind, lanes) for kind in (REAL, SINGLE))
        kinds = (TRUTH, INTEGER, SHORT)
        self.mask, self.integers, self.shorts = (_ir.VectorType(kind, lanes) for kind in kinds)
        scratch = self.arguments["w"]
        self.arguments["t"] = self.builder.bitcast(scratch, SINGLE.as_pointer())
        self.arguments["k"] = self.builder.bitcast(scratch, SHORT.as_pointer())
        self.bytes = self.builder.bitcast(scratch, BYTE.as_pointer())
        self.flags = self.builder.bitcast(self.arguments["index"], BYTE.as_pointer())

    def do_Expr(self, node: ast.Expr) -> None:
        self.value(node.value)

    def splat(self, value: Any, kind: Any) -> Any:
        """Return a vector of one number."""
        if isinstance(value, _ir.Constant):
            return _ir.Constant(kind, [value.constant] * self.lanes)
        if value.type == INTEGER and kind.element == SHORT:
            value = self.builder.trunc(value, SHORT)
        elif value.type == INTEGER and kind.element != INTEGER:
            value = self.builder.sitofp(value, kind.element)
        elif value.type == REAL and kind.element == SINGLE:
            value = self.builder.fptrunc(value, SINGLE)
        elif value.type == SINGLE and kind.element == REAL:
            value = self.builder.fpext(value, REAL)
        zero = SHORT(0)
        first = self.builder.insert_element(_ir.Constant(kind, _ir.Undefined), value, zero)
        order = _ir.Constant(_ir.VectorType(SHORT, self.lanes), [0] * self.lanes)
        return self.builder.shuffle_vector(first, _ir.Constant(kind, _ir.Undefined), order)

    def as_type(self, value: Any, kind: Any) -> Any:
        if value.type == kind:
            return value
        if isinstance(kind, _ir.VectorType) and not isinstance(value.type, _ir.VectorType):
            return self.splat(value, kind)
        if kind == SHORT and value.type == INTEGER:
            return self.builder.trunc(value, kind)
        if kind == REAL and value.type == SINGLE:
            return self.builder.fpext(value, kind)
        if kind == SINGLE and value.type in (REAL, INTEGER):
            return self.builder.fptrunc(super().as_type(value, REAL), kind)
        return super().as_type(value, kind)

    def alike(self, *values: Any) -> list[Any]:
        wide = [value.type for value in values if isinstance(value.type, _ir.VectorType)]
        if wide:
            return [self.as_type(value, wide[0]) for value in values]
        return super().alike(*(self.as_type(v, REAL) if v.type == SINGLE else v for v in values))

    def of_Subscript(self, node: ast.Subscript) -> Any:
        value = super().of_Subscript(node)
        return self.builder.sext(value, INTEGER) if value.type == SHORT else value

    def store(self, target: ast.expr, value: Any) -> None:
        if isinstance(value.type, _ir.VectorType) and not isinstance(target, ast.Name):
            place = self.pointer(target)
            wide = self.builder.bitcast(place, value.type.as_pointer())
            self.builder.store(value, wide, align=_BYTES[str(value.type.element)])
            return
        super().store(target, value)

    def binary(self, operator: type[ast.operator], left: Any, right: Any) -> Any:
        left, right = self.alike(left, right)
        if not isinstance(left.type, _ir.VectorType):
            return super().binary(operator, left, right)
        real, integer = OPERATORS[operator]
        if left.type in (self.double, self.float):
            return getattr(self.builder, real)(left, right, flags=FLAGS)
        return getattr(self.builder, integer)(left, right)

    def of_UnaryOp(self, node: ast.UnaryOp) -> Any:
        value = self.value(node.operand)
        if value.type == self.mask:
            return self.builder.not_(value)
        if value.type in (self.double, self.float, SINGLE):
            return self.builder.fneg(value)
        if isinstance(value, _ir.Constant) and isinstance(node.op, ast.USub):
            return value.type(-value.constant)
        return super().of_UnaryOp(node)

    def of_Compare(self, node: ast.Compare) -> Any:
        left, right = self.alike(self.value(node.left), self.value(node.comparators[0]))
        if not isinstance(left.type, _ir.VectorType):
            return super().of_Compare(node)
        sign = COMPARE[type(node.ops[0])]
        if left.type == self.integers:
            return self.builder.icmp_signed(sign, left, right)
        return self.builder.fcmp_ordered(sign, left, right)

    def of_Call(self, node: ast.Call) -> Any:
        name = ast.unparse(node.func)
        if name == "wide":
            pointer = self.builder.gep(self.arguments[ast.unparse(node.args[0])], [self.value(node.args[1])])
            kind = _ir.VectorType(pointer.type.pointee, self.lanes)
            wide = self.builder.bitcast(pointer, kind.as_pointer())
            return self.builder.load(wide, align=_BYTES[str(kind.element)])
        if name == "gather":
            at, step = (self.value(part) for part in node.args[1:])
            found = _ir.Constant(self.double, _ir.Undefined)
            for lane in range(self.lanes):
                place = self.builder.gep(self.arguments[ast.unparse(node.args[0])], [at])
                number = self.builder.load_atomic(place, "unordered", 8)  # LLVM makes no gather of these
                found = self.builder.insert_element(found, number, SHORT(lane))
                at = self.builder.add(at, step)
            return found
        if name in ("collect", "fetch", "flag"):
            first, at = self.value(node.args[1]), self.value(node.args[2])
            places = [self._place(first, self.builder.add(at, INTEGER(lane))) for lane in range(self.lanes)]
            if name == "collect":
                return self._collect(self.arguments[ast.unparse(node.args[0])], places)
            if name == "fetch":
                return self._fetch(self.arguments[ast.unparse(node.args[0])], places)
            return self._flag(places, *(self.value(part) for part in node.args[3:]))
        values = [self.value(part) for part in node.args]
        wide = [value for value in values if isinstance(value.type, _ir.VectorType)]
        if name not in ("every", "any", "ones", "single", "pick", "bits", "real", "sqrt", "floor", "union"):
            return super().of_Call(node)
        return getattr(self, f"_{name}")(*values) if name != "every" or not wide else wide[0]

    def _place(self, first: Any, at: Any) -> Any:
        number = self.builder.load(self.builder.gep(self.arguments["k"], [at]))
        return self.builder.add(first, self.builder.sext(number, INTEGER))

    def _collect(self, pointer: Any, places: list[Any]) -> Any:
        found = _ir.Constant(self.double, _ir.Undefined)
        for lane, place in enumerate(places):
            number = self.builder.load_atomic(self.builder.gep(pointer, [place]), "unordered", 8)  # no gather of these
            found = self.builder.insert_element(found, number, SHORT(lane))
        return found

    def _fetch(self, pointer: Any, places: list[Any]) -> Any:
        kind = _ir.FunctionType(_ir.VoidType(), [BYTE.as_pointer(), SHORT, SHORT, SHORT])
        function = declared(self.builder.module, kind, "llvm.prefetch.p0i8")
        for place in places:
            at = self.builder.bitcast(self.builder.gep(pointer, [place]), BYTE.as_pointer())
            self.builder.call(function, [at, SHORT(0), SHORT(3), SHORT(1)])
        return INTEGER(0)

    def _flag(self, places: list[Any], a: Any, b: Any) -> Any:
        kind = _ir.VectorType(BYTE, self.lanes)
        one, two = (self.builder.zext(mask, kind) for mask in (a, b))
        both = self.builder.or_(one, self.builder.add(two, two))
        for lane, place in enumerate(places):
            byte = self.builder.extract_element(both, SHORT(lane))
            self.builder.store(byte, self.builder.gep(self.flags, [place]))
        return INTEGER(0)

    def _every(self, value: Any) -> Any:
        return self.splat(value, self.mask if value.type == TRUTH else self.double)

    def _ones(self, mask: Any) -> Any:
        kind = _ir.IntType(self.lanes)
        return self.builder.zext(self.builder.bitcast(mask, kind), INTEGER)

    def _any(self, mask: Any) -> Any:
        kind = _ir.IntType(self.lanes)
        return self.builder.icmp_signed("!=", self.builder.bitcast(mask, kind), kind(0))

    def _single(self, value: Any) -> Any:
        return self.builder.fptrunc(value, self.float) if value.type == self.double else self.splat(value, self.float)

    def _pick(self, mask: Any, a: Any, b: Any) -> Any:
        if isinstance(a, _ir.Constant) or isinstance(b, _ir.Constant):
            a, b = self.alike(a, b)
        if not isinstance(a.type, _ir.VectorType):
            a, b = (self.splat(value, self.double) for value in (a, b))
        return self.builder.select(mask, a, b)

    def _floor(self, value: Any) -> Any:
        return self.builder.fptosi(value, self.shorts)

    def _union(self, at: Any, places: Any) -> Any:
        found = BYTE(0)
        for lane in range(self.lanes):
            place = self.builder.sext(self.builder.extract_element(places, SHORT(lane)), INTEGER)
            byte = self.builder.load(self.builder.gep(self.bytes, [self.builder.add(at, place)]))
            found = self.builder.or_(found, byte)
        return self.builder.zext(found, INTEGER)

    def _bits(self, value: Any) -> Any:
        return self.builder.bitcast(value, self.integers)

    def _real(self, value: Any) -> Any:
        return self.builder.bitcast(value, self.double)

    def _sqrt(self, value: Any) -> Any:
        word = f"v{self.lanes}{'f64' if value.type == self.double else 'f32'}"
        kind = _ir.FunctionType(value.type, [value.type])
        return self.builder.call(declared(self.builder.module, kind, f"llvm.sqrt.{word}"), [value])
