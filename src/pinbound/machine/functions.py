"""Direct translation of a function with loops and branches to LLVM; Numba would need ten seconds of Python for it.

`statements` says which part of Python the text may use.
"""

from __future__ import annotations

import importlib
from typing import Any

from pinbound.machine.lowering import furthest
from pinbound.machine.statements import INTEGER, write_statements

_ir: Any = importlib.import_module("llvmlite.ir")
_types: Any = importlib.import_module("numba.types")
_cgutils: Any = importlib.import_module("numba.core.cgutils")
_intrinsic: Any = importlib.import_module("numba.extending").intrinsic

__all__ = ["whole_function"]


def whole_function(text: str) -> Any:
    """Return a Numba intrinsic with the arguments of all kernels that runs a text on them; it returns an integer."""

    def body(_: Any, Q: Any, out: Any, row: Any, column: Any, index: Any, s: Any, count: Any) -> Any:
        def generate(_context: Any, builder: Any, _signature: Any, args: Any) -> Any:
            kind = _ir.FunctionType(INTEGER, [argument.type for argument in args])
            function = _cgutils.get_or_insert_function(builder.module, kind, "pinbound_function")
            if function.is_declaration:
                function.linkage = "internal"
                names = ["Q", "out", "row", "column", "index", "s", "count"]
                write_statements(function, names, {"furthest": furthest}, text)
            return builder.call(function, args)

        return _types.int64(Q, out, row, column, index, s, count), generate

    body.__doc__ = "Run one function."
    return _intrinsic(body)
