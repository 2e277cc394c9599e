"""Old public names: they remain for one release, and warn with the new name."""

from __future__ import annotations

import warnings
from typing import TypeVar

__all__ = ["renamed"]

V = TypeVar("V")


def renamed(value: V, old: str, new: str) -> V:
    """Return a value that a user requested by its old name, and warn at the line of the caller's caller.

    Example:
        >>> import warnings
        >>> with warnings.catch_warnings(record=True) as told:
        ...     warnings.simplefilter("always")
        ...     value = renamed(1, "Region.plane", "Region.slice")
        >>> print(told[0].message)
        Region.plane is now called Region.slice; the old name goes with the next release
    """
    warnings.warn(
        f"{old} is now called {new}; the old name goes with the next release", DeprecationWarning, stacklevel=3
    )
    return value
