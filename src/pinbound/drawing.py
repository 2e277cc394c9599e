"""The only call from lower rooms up to `figures/`: a record that is asked to draw itself imports its figure then."""

from __future__ import annotations

import html
import importlib
from typing import Any

from pinbound.exceptions import UnsupportedError

__all__ = ["Pictured", "drawn"]


def drawn(figure: str, *values: Any, **options: Any) -> Any:
    """Call a function of `pinbound.figures` by its name, e.g. ``"plots.draw_region"``, and return its result.

    Raises:
        UnsupportedError: If matplotlib is not installed; the message says what to type.
    """
    module, _, name = figure.partition(".")
    return getattr(importlib.import_module(f"pinbound.figures.{module}"), name)(*values, **options)


class Pictured:
    """A record that notebooks show as a picture: the axes that `plot()` draws, and the text of `repr` below them.

    Example:
        >>> import pinbound as pb
        >>> page = pb.load("minervabot_v3")._repr_html_()
        >>> page[:4], page.endswith("</pre>")
        ('<svg', True)
    """

    __slots__ = ()

    def _repr_html_(self) -> str:
        """Return the picture and the text; only the text if matplotlib is not installed."""
        text = f"<pre>{html.escape(repr(self))}</pre>"
        plot: Any = getattr(self, "plot")  # noqa: B009 - each class has its own
        try:
            return str(drawn("canvas.svg_text", plot().figure)) + text
        except UnsupportedError:
            return text
