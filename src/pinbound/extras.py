"""Libraries that an extra installs: if one is missing, the message says what to type."""

from __future__ import annotations

import importlib
from types import TracebackType

from pinbound.exceptions import UnsupportedError

__all__ = ["EXTRAS", "Needs", "require"]

EXTRAS: dict[str, tuple[str, ...]] = {
    "plots": ("matplotlib",),
    "symbols": ("sympy",),
    "report": ("jinja2", "matplotlib", "sympy"),
    "meshes": ("trimesh", "networkx", "collada"),
}
"""The modules that the core does not need, by the extra that installs them, as in `pyproject.toml`."""


class Needs:
    """A block whose imports need an extra: if a library is missing, the message says what to type.

    Raises:
        UnsupportedError: If a module of the extra is not installed.

    Example:
        >>> with Needs("plots", "a figure"):
        ...     raise ModuleNotFoundError("No module named 'matplotlib'", name="matplotlib")
        Traceback (most recent call last):
        pinbound.exceptions.UnsupportedError: a figure needs matplotlib, which is not installed; type: pip install ...
    """

    def __init__(self, extra: str, what: str) -> None:
        """Store the name of the extra, and the thing that needs it."""
        self.extra, self.what = extra, what

    def __enter__(self) -> None:
        """Do nothing when the block starts."""

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Replace the error about a missing module of the extra by a message for people."""
        if not isinstance(error, ModuleNotFoundError):
            return
        module = (error.name or "").partition(".")[0]
        if module in EXTRAS[self.extra]:
            message = f"{self.what} needs {module}, which is not installed; type: pip install 'pinbound[{self.extra}]'"
            raise UnsupportedError(message) from error


def require(extra: str, what: str) -> None:
    """Import the modules of an extra before long work starts, so that the work is not lost.

    Raises:
        UnsupportedError: If a module of the extra is not installed.
    """
    with Needs(extra, what):
        for module in EXTRAS[extra]:
            importlib.import_module(module)
