"""A region as a picture, where people ask for one: `region.plot()`, and what a notebook shows."""

from __future__ import annotations

import html
from typing import Any

from pinbound.drawing import drawn
from pinbound.exceptions import UnsupportedError

__all__ = ["Shown"]


class Shown:
    """Draws a region."""

    def plot(self, ax: Any = None) -> Any:
        """Draw the region with its named edges, angles in degrees and lengths in millimetres.

        Args:
            ax: Matplotlib axes to draw in; None: those of a new figure, `ax.figure`.

        Returns:
            The axes.

        Raises:
            UnsupportedError: If matplotlib is not installed; it says what to type.

        Example:
            >>> import pinbound as pb
            >>> ax = pb.feasible_region(pb.load("minervabot_v3"), ("q2", "q3")).plot()
            >>> ax.get_xlabel(), ax.get_ylabel()
            ('q2 [deg]', 'q3 [deg]')
        """
        return drawn("plots.region_axes", self, ax)

    def _repr_html_(self) -> str:
        """Return the picture, for a notebook; the text alone where matplotlib is not installed."""
        text = f"<pre>{html.escape(repr(self))}</pre>"
        try:
            return str(drawn("canvas.svg_text", self.plot().figure)) + text
        except UnsupportedError:
            return text
