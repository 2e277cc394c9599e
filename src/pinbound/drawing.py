"""The one way up the house: what is asked to draw itself calls the room of figures, when it is asked."""

from __future__ import annotations

import html
import importlib
from typing import Any

from pinbound.exceptions import UnsupportedError

__all__ = ["Pictured", "drawn"]


def drawn(figure: str, *values: Any, **options: Any) -> Any:
    """Return what a function of `pinbound.figures` returns, e.g. of ``"plots.draw_region"``.

    Raises:
        UnsupportedError: If matplotlib is not installed; it says what to type.
    """
    module, _, name = figure.partition(".")
    return getattr(importlib.import_module(f"pinbound.figures.{module}"), name)(*values, **options)


class Pictured:
    """What a notebook shows as a picture: the axes that `plot()` draws, and the text of `repr` below them.

    Example:
        >>> import pinbound as pb
        >>> page = pb.load("minervabot_v3")._repr_html_()
        >>> page[:4], page.endswith("</pre>")
        ('<svg', True)
    """

    __slots__ = ()

    def _repr_html_(self) -> str:
        """Return the picture and the text; the text alone if matplotlib is not installed."""
        text = f"<pre>{html.escape(repr(self))}</pre>"
        plot: Any = getattr(self, "plot")  # noqa: B009 - each class has its own
        try:
            return str(drawn("canvas.svg_text", plot().figure)) + text
        except UnsupportedError:
            return text
