"""Machine code of a program: Numba compiles its source once, and later processes link the code from the cache folder.

The cache has object code without a symbol of Python or Numba. It takes pointers and strides, and uses the process's own
libm for sines of large angles. So llvmlite alone loads it, in a few milliseconds; `import numba` takes tenths of a
second. Code that was just compiled is loaded in the same way as code from the cache. The key is a hash of everything
that machine code depends on: the source, the modules that write instructions, the versions of pinbound, llvmlite and
(where it compiles) Numba, and the processor.
"""

from __future__ import annotations

import ctypes
import hashlib
import importlib
import importlib.util
import itertools
import os
import sys
import threading
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from pinbound.machine.object_cache import load_object, store_object
from pinbound.typing import AnyArray

__all__ = ["MachineCode", "compile_source", "has_numba", "is_kept", "vector_bytes"]

_SYMBOL = "pinbound_kernel"

_SETTINGS = ("NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES", "NUMBA_ENABLE_AVX")
"""Environment variables that make Numba compile for another processor than this one."""

_WRITERS = ("lowering", "functions", "statements", "lanes")
"""Modules that write LLVM's instructions."""

_IMPORTED = ("pinbound", "llvmlite")
"""Packages that provide their versions; text for lanes does not depend on Numba's, which takes 10 ms to read."""

_CACHE_LINE = 64
"""Bytes; so no vector load of scratch crosses a boundary of cache lines."""

_PROTOTYPE = ctypes.CFUNCTYPE(
    ctypes.c_int64,
    ctypes.c_void_p,
    ctypes.c_void_p,
    ctypes.c_int64,
    ctypes.c_int64,
    ctypes.c_void_p,
    ctypes.c_void_p,
    ctypes.c_int64,
)
"""The arguments of `kernel_source`; ctypes releases the interpreter's lock during the call."""


@dataclass(frozen=True)
class KernelSource:
    """The source of a kernel in Python, for Numba, and the memory that its caller must provide."""

    text: str
    scratch: int
    """Bytes."""
    lanes: int = 0
    """For text for lanes (`lanes`), their number; 0: the text is for Numba."""
    unrolled: bool = True
    """For text for lanes, whether LLVM unrolls and vectorises its loops: this doubles the time to compile."""

    @property
    def lines(self) -> str:
        """The text that the machine code depends on."""
        return f"{self.lanes} {self.unrolled}\n{self.text}" if self.lanes else self.text


@dataclass(frozen=True)
class MachineCode:
    """A kernel in memory."""

    function: Callable[..., int]
    scratch: int
    """Bytes."""
    owner: Any
    """Keeps the memory of the code from being freed."""

    def __call__(self, Q: AnyArray, out: AnyArray, index: AnyArray) -> int:
        """Fill rows and return how many numbers were not finite.

        Args:
            Q: (N, n), C-contiguous, of the kernel's type.
            out: (N, columns) of the kernel's type, in any layout.
            index: (N,) int64, contiguous; (0,) in a mode that does not write it.
        """
        if not out.flags.aligned or any(step % out.itemsize for step in out.strides):
            whole = np.empty(out.shape, out.dtype)
            irregular = self(Q, whole, index)
            out[:] = whole
            return irregular
        row, column = (step // out.itemsize for step in out.strides)
        scratch = np.empty(self.scratch + _CACHE_LINE, dtype=np.uint8)
        start = -_address(scratch) % _CACHE_LINE + _address(scratch)
        return self.function(_address(Q), _address(out), row, column, _address(index), start, len(Q))


@cache
def has_numba() -> bool:
    """Return whether Numba is installed; it is not imported."""
    return importlib.util.find_spec("numba") is not None


def compile_source(source: KernelSource) -> MachineCode:
    """Return the machine code of a source, from the cache if it is there."""
    key = _key(source)
    with _lock:
        if key not in _linked:
            _linked[key] = _from_cache(key) or _fresh(key, source)
        function, owner = _linked[key]
    return MachineCode(function, source.scratch, owner)


@cache
def vector_bytes() -> int:
    """Return the length of this processor's vectors in bytes: 64 with AVX-512, 32 with AVX2, else 16."""
    settings = [os.environ.get("NUMBA_CPU_FEATURES") or _features()]
    return 64 if "+avx512f" in settings[0] else 32 if "+avx2" in settings[0] else 16


def is_kept(source: KernelSource) -> bool:
    """Return whether the machine code of a source exists already, in this process or in the cache."""
    key = _key(source)
    return key in _linked or load_object(key) is not None


_lock = threading.Lock()
_linked: dict[str, tuple[Callable[..., int], Any]] = {}
_numbers = itertools.count()


def _from_cache(key: str) -> tuple[Callable[..., int], Any] | None:
    code = load_object(key)
    try:
        return None if code is None else _link(code)
    except RuntimeError:  # this process does not have a symbol
        return None


def _fresh(key: str, source: KernelSource) -> tuple[Callable[..., int], Any]:
    code = _assemble(source) if source.lanes else _compile(source.text)
    store_object(key, code)
    return _link(code)


def _key(source: KernelSource) -> str:
    llvm = _llvm()
    here = Path(__file__)
    lowering = [here.with_name(f"{name}.py").read_text(encoding="utf-8") for name in _WRITERS]
    versions = [_version(name) for name in (*_IMPORTED, *(() if source.lanes else ("numba",)))]
    processor = [llvm.get_process_triple(), llvm.get_host_cpu_name(), _features()]
    settings = [os.environ.get(name, "") for name in _SETTINGS]
    return hashlib.sha256(repr([source.lines, lowering, versions, processor, settings]).encode()).hexdigest()


@cache
def _version(name: str) -> str:
    if name in _IMPORTED:
        return getattr(sys.modules.get(name), "__version__", "")
    from importlib import metadata

    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:  # it runs from its sources
        return ""


def _features() -> str:
    try:
        return _llvm().get_host_cpu_features().flatten()
    except RuntimeError:  # llvmlite does not know the features of this processor
        return ""


def _compile(text: str) -> bytes:
    """Return the object code of a source."""
    registry: Any = importlib.import_module("numba.core.registry")
    namespace: dict[str, Any] = {"__name__": _SYMBOL}
    exec(compile(text, f"<{_SYMBOL}>", "exec"), namespace)  # our own text, made only from numbers
    callback = namespace["kernel"]
    llvm = _llvm()
    module = llvm.parse_assembly(callback.inspect_llvm().replace(callback.native_name, _SYMBOL))
    triple, cpu, features = registry.cpu_target.target_context.codegen().magic_tuple()
    reloc = "static" if triple.startswith("x86") else "default"
    target = llvm.Target.from_triple(triple)
    machine = target.create_target_machine(cpu, features, opt=3, reloc=reloc, codemodel="jitdefault", jit=True)
    return machine.emit_object(module)


def _assemble(source: KernelSource) -> bytes:
    """Return the object code of text for lanes, without Numba."""
    llvm = _llvm()
    lanes = importlib.import_module("pinbound.machine.lanes")
    module = llvm.parse_assembly(lanes.lanes_module(source.text, source.lanes, _SYMBOL))
    triple = llvm.get_process_triple()
    reloc = "static" if triple.startswith("x86") else "default"
    target = llvm.Target.from_triple(triple)
    machine = target.create_target_machine(
        os.environ.get("NUMBA_CPU_NAME") or llvm.get_host_cpu_name(),
        os.environ.get("NUMBA_CPU_FEATURES") or _features(),
        opt=3,
        reloc=reloc,
        codemodel="jitdefault",
        jit=True,
    )
    options = llvm.create_pipeline_tuning_options(speed_level=3)
    options.loop_unrolling = options.loop_vectorization = options.loop_interleaving = source.unrolled
    builder = llvm.create_pass_builder(machine, options)
    builder.getModulePassManager().run(module, builder)
    return machine.emit_object(module)


def _link(code: bytes) -> tuple[Callable[..., int], Any]:
    """Load object code into memory.

    Raises:
        RuntimeError: If it needs a symbol that does not exist.
    """
    builder = _llvm().JITLibraryBuilder().add_object_img(code).add_current_process().export_symbol(_SYMBOL)
    library = builder.link(_linker(), f"{_SYMBOL}_{next(_numbers)}")
    return _PROTOTYPE(library[_SYMBOL]), library


@cache
def _linker() -> Any:
    return _llvm().create_lljit_compiler(suppress_errors=True)


@cache
def _llvm() -> Any:
    """Return llvmlite's bindings, ready to make and link code for this machine."""
    llvm: Any = importlib.import_module("llvmlite.binding")
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm


def _address(array: AnyArray) -> int:
    return array.__array_interface__["data"][0]
