"""The basis of all figures: axes with a light grid, text without formulas, files that are the same in every run.

Matplotlib loads when the first figure is drawn.
"""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any, cast

from pinbound.extras import Needs

__all__ = ["fit", "grow", "lay_out", "new_axes", "save", "settle", "svg_text", "width_of", "without_math"]

_PASSES = 8
_PAD = 0.1  # inches of white margin around the content of a figure


def new_axes(width: float, height: float, axes: Any = None) -> Any:
    """Return axes with a light grid: the given ones, or those of a new figure of a size [inches]."""
    with Needs("plots", "a figure"):
        from matplotlib.figure import Figure

    if axes is None:
        axes = cast(Any, Figure(figsize=(width, height), layout="constrained")).add_subplot()
    axes.grid(True, color="#E4E4E4", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    return axes


def svg_text(figure: Any) -> str:
    """Return a figure as SVG, for a page."""
    text = io.StringIO()
    figure.savefig(text, format="svg", metadata={"Date": None})
    return text.getvalue()[text.getvalue().index("<svg") :]


def without_math(figure: Any) -> Any:
    """Draw every text of a figure, or of axes, letter by letter: a name may contain `$`, and is not a formula."""
    from matplotlib.text import Text

    for text in figure.findobj(Text):
        text.set_parse_math(False)
    return figure


def lay_out(axes: Any) -> None:
    """Give axes of our own figure their final size, so that names can be placed by it."""
    settle(without_math(axes).figure)


def fit(axes: Any) -> None:
    """Make our own figure as large as its content: axes of equal aspect leave white space at two sides."""
    figure = without_math(axes).figure
    settle(figure)
    (width, height), shown = figure.get_size_inches(), figure.get_tightbbox()
    figure.set_size_inches(min(width, shown.width + 2.0 * _PAD), min(height, shown.height + 2.0 * _PAD))
    settle(figure)


def grow(axes: Any, width: float) -> None:
    """Widen our own figure until its axes are as wide [inches] as before a legend used a part of it."""
    figure = without_math(axes).figure
    for _ in range(_PASSES):
        settle(figure)
        missing = width - width_of(axes)
        if missing < _PAD / 10.0:
            return
        figure.set_size_inches(figure.get_size_inches()[0] + missing, figure.get_size_inches()[1])


def width_of(axes: Any) -> float:
    """Return the width of axes as drawn [inches]."""
    axes.apply_aspect()
    return float(axes.get_window_extent().width) / float(axes.figure.dpi)


def settle(figure: Any) -> None:
    """Lay a figure out until no text is cut off: with axes of equal aspect this needs several passes."""
    for _ in range(_PASSES):
        figure.draw_without_rendering()
        (width, height), shown = figure.get_size_inches(), figure.get_tightbbox()
        if min(shown.x0, shown.y0, width - shown.x1, height - shown.y1) >= 0.0:
            return


def save(figure: Any, path: Path) -> list[Path]:
    """Write a figure as SVG and as PNG, with the same bytes in every run; return the two paths."""
    import matplotlib as mpl_untyped

    mpl = cast(Any, mpl_untyped)

    files = [path.with_suffix(".svg"), path.with_suffix(".png")]
    settle(figure)
    with mpl.rc_context({"svg.hashsalt": "pinbound"}):
        figure.savefig(files[0], metadata={"Date": None})
        figure.savefig(files[1], dpi=160)
    return files
