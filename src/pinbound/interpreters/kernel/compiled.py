"""Machine code of a program: its source goes to a file of the user's cache, Numba compiles it and keeps the result.

The file's name is a hash of its text and of `lowering.py`, so that another robot, or another version of pinbound,
never meets old code.
The folder is `PINBOUND_CACHE_DIR`, else `XDG_CACHE_HOME/pinbound`, else `~/.cache/pinbound`; where it cannot be
written, code is compiled for this process alone.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

__all__ = ["compile_source", "has_numba"]


@cache
def has_numba() -> bool:
    """Return whether Numba is installed; it is not imported."""
    return importlib.util.find_spec("numba") is not None


def compile_source(source: str) -> Callable[..., int]:
    """Return the `kernel` of a source; machine code comes from the cache where it is there."""
    lowering = hashlib.sha256(Path(__file__).with_name("lowering.py").read_bytes()).hexdigest()
    source = f"# lowering.py {lowering}\n{source}"
    digest = hashlib.sha256(source.encode()).hexdigest()[:24]
    name = f"pinbound_kernel_{digest}"
    path = _cached_file(name, "CACHE = True\n" + source)
    if path is None:
        namespace: dict[str, Any] = {"__name__": name}
        exec(compile("CACHE = False\n" + source, f"<{name}>", "exec"), namespace)  # our own text, from numbers alone
        return namespace["kernel"]
    if name in sys.modules:
        return sys.modules[name].kernel
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise ImportError(f"cannot import {path}")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # Numba's cached code looks its module up by name
    spec.loader.exec_module(module)
    return module.kernel


def _cached_file(name: str, text: str) -> Path | None:
    """Return a file with exactly this text; None if the cache cannot be written."""
    import tempfile

    folder = _cache_folder()
    path = folder / f"{name}.py"
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            with tempfile.NamedTemporaryFile("w", encoding="utf-8", dir=folder, suffix=".tmp", delete=False) as file:
                file.write(text)
            os.replace(file.name, path)
        return path if os.access(folder, os.W_OK) else None
    except OSError:
        return None


def _cache_folder() -> Path:
    if given := os.environ.get("PINBOUND_CACHE_DIR"):
        return Path(given) / "kernels"
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "pinbound" / "kernels"
