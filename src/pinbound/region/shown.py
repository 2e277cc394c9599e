"""A region as a picture: `region.plot()`, and what a notebook shows."""

from __future__ import annotations

from typing import Any

from pinbound.drawing import Pictured, drawn

__all__ = ["Shown"]


class Shown(Pictured):
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
