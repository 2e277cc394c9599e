"""Python source of a program: tiled loops that Numba and LLVM turn into vector code, and one scalar function.

One tile is a few hundred configurations, so that all temporary rows stay in L1. Every statement of a tile is a loop
over configurations without branches and calls, which LLVM vectorises. Values that several loops need are temporary rows
(scratch); all others stay in registers. Nothing is reassociated: LLVM may only contract `a * b + c` into one rounding.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from pinbound.kernel.program import Program
from pinbound.kernel.scalars import LEAVES, Graph
from pinbound.machine.compiled import KernelSource
from pinbound.machine.sincos import REGULAR, REGULAR32, SINCOS, SINCOS32

__all__ = ["FAR", "MODES", "kernel_source", "scalar_source"]

FAR = 100.0
"""rad or m: rows with a larger angle or coordinate are examined separately if a sign is needed."""

MODES = ("norms", "clearances", "gradients", "smallest", "least")
"""What a kernel writes; `least` is the smallest clearance without the name of its boundary."""

_SCRATCH = 30_000
"""Bytes of scratch: this leaves space in an L1 cache of 32 or 48 KiB for input and output."""

_ROWS_PER_LOOP = 24
"""Output rows for each loop: more would spill, fewer would reload what boundaries share."""

_NODES_PER_LOOP = 250
"""New nodes for each loop, limited because LLVM's time grows faster than the length of a loop."""

_LANES = 16
"""Tiles are filled up to a multiple of this, so that vector loops have no scalar remainder."""

_TURNING = ("cos", "sin")
_GIVEN = ("constant", "coordinate")
_FORMS = {
    "add": "{} + {}",
    "sub": "{} - {}",
    "mul": "{} * {}",
    "div": "{} / {}",
    "pick": "pick({} < {}, {}, {})",
    "hold": "{}",
}


def kernel_source(program: Program, mode: str, single: bool = False, sure: float = -1.0) -> KernelSource:
    """Return the source of `kernel(Q, out, row, column, index, w, count)`.

    It takes pointers: Q to (count, n) numbers without gaps; out to numbers with the strides `row` and `column`, counted
    in numbers; index to count integers in mode `smallest`; w to scratch. It returns the number of values that were not
    finite, or whose sign is not sure.

    Args:
        program: The program.
        mode: One of `MODES`.
        single: float32 instead of float64.
        sure: The size below which the sign of a result is not sure while no angle is beyond `FAR` [m]; negative: no
            sign is needed. Rows with angles beyond it are counted, too.
    """
    return _Writer(program, mode, single, sure).source()


class _Writer:
    def __init__(self, program: Program, mode: str, single: bool, sure: float) -> None:
        self.program, self.graph, self.mode, self.single = program, program.graph, mode, single
        is_signed = {"norms": any(program.signed), "gradients": False}.get(mode, True)
        self.sure = sure if is_signed else -1.0
        self.rows: dict[object, int] = {}
        self.lines: list[str] = []
        self.loops: list[str] = []
        self.groups = list(_groups(program, mode))
        if mode not in ("smallest", "least"):
            for slot in range(max(len(members) for _, members in self.groups) * self._width):
                self.row(("out", slot))  # consecutive rows
        self.shared = self._shared_nodes()

    def row(self, key: object) -> int:
        return self.rows.setdefault(key, len(self.rows))

    def number(self, value: float) -> str:
        return f"F({value!r})" if self.single else repr(float(value))

    def _shared_nodes(self) -> set[int]:
        """Return the nodes that more than one loop needs."""
        seen, shared = set[int](), set[int]()
        for outputs, _ in self.groups:
            needed = {n for n in self.graph.reachable(outputs) if self.graph.nodes[n].kind not in _GIVEN}
            shared |= seen & needed
            seen |= needed
        return shared

    def source(self) -> KernelSource:
        used = [self.graph.nodes[n] for n in self.graph.reachable(n for outputs, _ in self.groups for n in outputs)]
        angles = sorted({node.args[0] for node in used if node.kind in _TURNING})
        self._load({node.args[0] for node in used if node.kind == "coordinate"}, angles)
        done = set[int]()
        for index, group in enumerate(self.groups):
            self._group(index, group, done)
        self._store_smallest()
        self._count_unsure()
        body = "\n".join(self.lines)
        item = 4 if self.single else 8
        tile = min(512, max(64, _SCRATCH // item // max(1, len(self.rows)) // 32 * 32))
        text = _FRAME.format(
            loops="\n".join(self.loops),
            body=body,
            tile=tile,
            rest=_LANES - 1,
            real="float32" if self.single else "float64",
            regular=REGULAR32 if self.single else REGULAR,
            far=(REGULAR32 if self.single else REGULAR) if self.sure < 0.0 else FAR,
            sure=self.sure,
        )
        return KernelSource(text, max(1, len(self.rows)) * tile * item)

    def line(self, text: str, depth: int = 3) -> None:
        self.lines.append("    " * (depth - 1) + text)

    def _load(self, coordinates: set[int], angles: Sequence[int]) -> None:
        """Load coordinates and angles, reduce large angles, and count values that are not finite.

        An angle beyond the polynomials' range is replaced by libm's `atan2(sin x, cos x)`. This is as good as an
        argument reduction of any length, and cheap enough for the rare element that needs it.
        """
        words: dict[int, str] = {self.row(("q", j)): self._input(j) for j in sorted(coordinates)}
        for angle in angles:
            terms = [(c, self._input(j)) for j, c in enumerate(self.graph.angles[angle]) if c]
            parts = [word if c == 1.0 else f"{self.number(c)} * {word}" for c, word in terms]
            words[self.row(("angle", angle))] = " + ".join(parts)
        if not words:
            return
        self.line("for i in range(n):")
        for row, word in words.items():
            self.line(f"w[{row} * TILE + i] = {word}", 4)
        self.line("for i in range(n, padded):")
        for row in words:
            self.line(f"w[{row} * TILE + i] = {self.number(0.0)}", 4)
        self.line("far = 0")
        self.line("for i in range(padded):")
        for row in words:
            self.line(f"far += 0 if abs(w[{row} * TILE + i]) <= FAR else 1", 4)
        self.line("if far:")
        self.line("for i in range(n):", 4)
        for row in words:
            self.line(f"x = w[{row} * TILE + i]", 5)
            self.line(f"irregular += 0 if abs(x) {'< INFINITY' if self.sure < 0.0 else '<= FAR'} else 1", 5)
            if row in {self.row(("angle", angle)) for angle in angles}:
                self.line("if not abs(x) <= REGULAR:", 5)
                self.line(f"w[{row} * TILE + i] = math.atan2(math.sin(x), math.cos(x))", 6)

    def _input(self, j: int) -> str:
        return f"load(Q, (start + i) * {self.program.n} + {j})"

    def _operand(self, number: int) -> str:
        node = self.graph.nodes[number]
        if node.kind == "constant":
            return self.number(node.value)
        return f"w[{self.row(('q', node.args[0]))}, i]" if node.kind == "coordinate" else f"v{number}"

    def _group(self, index: int, group: tuple[list[int], list[int]], done: set[int]) -> None:
        outputs, members = group
        body, self.lines = self.lines, []
        turned = set[int]()
        for number in self._needed(outputs, done):
            if number in done:
                self.line(f"v{number} = w[{self.row(('node', number))}, i]", 3)
                continue
            node = self.graph.nodes[number]
            if node.kind in _TURNING:
                if node.args[0] not in turned:
                    turned.add(node.args[0])
                    text = (SINCOS32 if self.single else SINCOS).format(x=f"w[{self.row(('angle', node.args[0]))}, i]")
                    for line in text.splitlines():
                        self.line(line)
                    self.line(f"cos{node.args[0]} = cosine", 3)
                    self.line(f"sin{node.args[0]} = sine", 3)
                self.line(f"v{number} = {node.kind}{node.args[0]}", 3)
            else:
                self.line(f"v{number} = {_FORMS[node.kind].format(*map(self._operand, node.args))}", 3)
            if number in self.shared:
                self.line(f"w[{self.row(('node', number))}, i] = v{number}", 3)
                done.add(number)
        if self.mode in ("smallest", "least"):
            self._minimum(index, members)
        else:
            self._rows(members)
        if self.sure >= 0.0 and self.mode not in ("smallest", "least"):
            self._keep_nearest(index, members)
        text = "\n".join(line.strip() for line in self.lines)
        self.loops.append(f'body{index} = loop_body("""\\\n{text}\n""", TILE, F is np.float32)\n')
        self.lines = body
        self.line("for i in range(padded):")
        self.line(f"body{index}(w, i)", 4)
        if self.mode not in ("smallest", "least"):
            self._store(members)

    def _needed(self, outputs: Iterable[int], done: set[int]) -> list[int]:
        """Return the nodes that a loop computes or loads, without the nodes below finished ones."""
        needed, stack = set[int](), list(outputs)
        while stack:
            number = stack.pop()
            node = self.graph.nodes[number]
            if number in needed or node.kind in _GIVEN:
                continue
            needed.add(number)
            if number not in done and node.kind not in LEAVES:
                stack.extend(node.args)
        return sorted(needed)

    @property
    def _width(self) -> int:
        return self.program.n if self.mode == "gradients" else 1

    def _rows(self, members: Sequence[int]) -> None:
        """Write norms, clearances or gradients of some boundaries into scratch."""
        gradients = self.program.gradients() if self.mode == "gradients" else []
        for slot, k in enumerate(members):
            self.line(f"norm = {self._root(k)}")
            if self.mode == "gradients":
                self.line(f"inverse = {self.number(1.0)}" + ("" if self.program.signed[k] else " / norm"))
                for j, dot in enumerate(gradients[k]):
                    row = self.row(("out", slot * self._width + j))
                    self.line(f"w[{row}, i] = {self._operand(dot)} * inverse")
                continue
            threshold = self.program.thresholds[k]
            less = f" - {self.number(threshold)}" if self.mode == "clearances" and threshold else ""
            self.line(f"w[{self.row(('out', slot))}, i] = norm{less}")

    def _keep_nearest(self, index: int, members: Sequence[int]) -> None:
        """Keep the least square of all values whose sign is needed."""
        row = self.row("nearest")
        self.line(f"nearest = {'INFINITY' if not index else f'w[{row}, i]'}")
        for slot, k in enumerate(members):
            if self.mode == "clearances" or self.program.signed[k]:
                self.line(f"value = w[{self.row(('out', slot))}, i]")
                self.line("value = value * value")
                self.line("nearest = pick(value < nearest, value, nearest)")
        self.line(f"w[{row}, i] = nearest")

    def _count_unsure(self) -> None:
        """Count the rows with a sign that is not sure."""
        if self.sure < 0.0:
            return
        word = f"w[{self.row('best')} * TILE + i]"
        word = f"{word} * {word}" if self.mode in ("smallest", "least") else f"w[{self.row('nearest')} * TILE + i]"
        self.line("for i in range(n):")
        self.line(f"irregular += 1 if {word} <= SURE * SURE else 0", 4)

    def _root(self, k: int) -> str:
        """Return the text of a boundary's norm, or signed height."""
        value = self._operand(self.program.squares[k])
        return value if self.program.signed[k] else f"math.sqrt({value})"

    def _store(self, members: Sequence[int]) -> None:
        first, source = members[0] * self._width, self.row(("out", 0))
        places = f"out, start * row + {first} * column, row, column, w, {source} * TILE, TILE"
        self.line(f"copy_columns({places}, {len(members) * self._width}, n)")

    def _minimum(self, index: int, members: Sequence[int]) -> None:
        """Take the least square of each threshold, with one root for each; sqrt and the subtraction are monotone."""
        with_index = self.mode == "smallest"
        best, which = self.row("best"), self.row("which") if with_index else -1
        self.line(f"best = {'INFINITY' if not index else f'w[{best}, i]'}")
        if with_index:
            self.line(f"which = {self.number(-1.0) if not index else f'w[{which}, i]'}")
        for start, stop in _runs([(self.program.signed[k], self.program.thresholds[k]) for k in members]):
            self.line(f"least = {self._operand(self.program.squares[members[start]])}")
            if with_index:
                self.line(f"at = {self.number(float(members[start]))}")
            for k in members[start + 1 : stop]:
                square = self._operand(self.program.squares[k])
                if with_index:
                    self.line(f"at = pick({square} < least, {self.number(float(k))}, at)")
                self.line(f"least = pick({square} < least, {square}, least)")
            root = "least" if self.program.signed[members[start]] else "math.sqrt(least)"
            self.line(f"found = {root} - {self.number(self.program.thresholds[members[start]])}")
            if with_index:
                self.line("which = pick(found < best, at, which)")
            self.line("best = pick(found < best, found, best)")
        self.line(f"w[{best}, i] = best")
        if with_index:
            self.line(f"w[{which}, i] = which")

    def _store_smallest(self) -> None:
        if self.mode not in ("smallest", "least"):
            return
        self.line("for i in range(n):")
        self.line(f"out[(start + i) * row] = w[{self.row('best')} * TILE + i]", 4)
        if self.mode == "smallest":
            self.line("for i in range(n):")
            self.line(f"index[start + i] = np.int64(w[{self.row('which')} * TILE + i])", 4)


def _runs(values: Sequence[tuple[bool, float]]) -> Iterator[tuple[int, int]]:
    start = 0
    for stop in range(1, len(values) + 1):
        if stop == len(values) or values[stop] != values[start]:
            yield start, stop
            start = stop


def _groups(program: Program, mode: str) -> Iterator[tuple[list[int], list[int]]]:
    """Yield for each loop the nodes that it needs and the boundaries that they belong to."""
    order = list(range(program.size))
    if mode in ("smallest", "least"):
        order.sort(key=lambda k: (program.signed[k], program.thresholds[k]))
    width = program.n if mode == "gradients" else 1
    gradients = program.gradients() if mode == "gradients" else []
    seen, outputs, members, size = set[int](), list[int](), list[int](), 0
    for k in order:
        wanted = [program.squares[k], *(gradients[k] if gradients else ())]
        fresh = set(program.graph.reachable(wanted)) - seen
        if members and (size + len(fresh) > _NODES_PER_LOOP or (len(members) + 1) * width > _ROWS_PER_LOOP):
            yield outputs, members
            outputs, members, size = [], [], 0
        outputs, members, size = outputs + wanted, [*members, k], size + len(fresh)
        seen |= fresh
    if members:
        yield outputs, members


_FRAME = '''"""Generated by pinbound; do not edit."""

import math

import numpy as np
from numba import cfunc, types

from pinbound.machine.lowering import copy_columns, load, loop_body

F = np.{real}
INFINITY = F(np.inf)
REGULAR = F({regular})
FAR, SURE = F({far}), F({sure!r})
TILE = {tile}
REALS, INTEGER, INTEGERS = types.CPointer(types.{real}), types.int64, types.CPointer(types.int64)


{loops}
@cfunc(
    INTEGER(REALS, REALS, INTEGER, INTEGER, INTEGERS, REALS, INTEGER),
    error_model="numpy", fastmath={{"contract"}}, boundscheck=False, debug=False,
)
def kernel(Q, out, row, column, index, w, count):
    irregular = 0
    start = 0
    while start < count:
        n = TILE if count - start > TILE else count - start
        padded = n + (-n & {rest})
{body}
        start += TILE
    return irregular
'''


def scalar_source(program: Program, mode: str) -> str:
    """Return the source of `function(q0, q1, ...)` for one configuration, in plain Python floats.

    Mode `norms` or `clearances`; the function returns a list.
    """
    graph = program.graph
    names = [f"q{j}" for j in range(program.n)]
    lines = [f"def function({', '.join(names)}):"]
    for number in graph.reachable(program.squares):
        lines.append(f"    v{number} = {_scalar_node(graph, number)}")
    less = program.thresholds if mode == "clearances" else (0.0,) * program.size
    roots = [f"v{s}" if signed else f"sqrt(v{s})" for s, signed in zip(program.squares, program.signed, strict=True)]
    words = [root + (f" - {t!r}" if t else "") for root, t in zip(roots, less, strict=True)]
    return "\n".join([*lines, f"    return [{', '.join(words)}]"])


def _scalar_node(graph: Graph, number: int) -> str:
    node = graph.nodes[number]
    if node.kind == "constant":
        return repr(node.value)
    if node.kind == "coordinate":
        return f"q{node.args[0]}"
    if node.kind in ("cos", "sin"):
        terms = [f"{c!r} * q{j}" for j, c in enumerate(graph.angles[node.args[0]]) if c]
        return f"{node.kind}({' + '.join(terms)})"
    if node.kind == "pick":
        return "v{2} if v{0} < v{1} else v{3}".format(*node.args)
    return _FORMS[node.kind].format(*(f"v{arg}" for arg in node.args))
