"""The one way up the house: what is asked to draw itself calls the room of figures, when it is asked."""

from __future__ import annotations

import importlib
from typing import Any

__all__ = ["drawn"]


def drawn(figure: str, *values: Any, **options: Any) -> Any:
    """Return what a function of `pinbound.figures` returns, e.g. of ``"plots.draw_region"``.

    Raises:
        UnsupportedError: If matplotlib is not installed; it says what to type.
    """
    module, _, name = figure.partition(".")
    return getattr(importlib.import_module(f"pinbound.figures.{module}"), name)(*values, **options)
