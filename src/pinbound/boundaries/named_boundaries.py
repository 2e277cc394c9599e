"""Boundaries in order, by name or position."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, overload

import numpy as np

from pinbound.boundaries.boundary import Boundary
from pinbound.exceptions import UnknownNameError

__all__ = ["NamedBoundaries"]


class NamedBoundaries(Sequence[Boundary]):
    """A sequence of boundaries with access by name."""

    def __init__(self, boundaries: Sequence[Boundary]) -> None:
        """Store boundaries with different names."""
        self._boundaries = tuple(boundaries)
        self._index = {boundary.name: boundary for boundary in boundaries}

    @property
    def names(self) -> tuple[str, ...]:
        """Their names, in order."""
        return tuple(self._index)

    def __len__(self) -> int:
        """Return the number of boundaries."""
        return len(self._boundaries)

    def __iter__(self) -> Iterator[Boundary]:
        """Iterate over them in order."""
        return iter(self._boundaries)

    @overload
    def __getitem__(self, key: int | str) -> Boundary: ...
    @overload
    def __getitem__(self, key: slice) -> Sequence[Boundary]: ...
    def __getitem__(self, key: int | str | slice) -> Boundary | Sequence[Boundary]:
        """Return one boundary by name or position.

        Raises:
            UnknownNameError: If there is no boundary of that name.
        """
        if isinstance(key, str):
            if key not in self._index:
                raise UnknownNameError("boundary", key, self._index)
            return self._index[key]
        position: Any = key  # of any type, whatever the hints say
        if not isinstance(position, int | np.integer | slice):
            raise UnknownNameError("boundary", key, self._index)
        return self._boundaries[key]

    def __repr__(self) -> str:
        """Return the names."""
        return f"<BoundarySet {', '.join(self.names)}>"
