"""The nearest features of two bodies: a vertex, an edge or a face of each.

Let r^ be the unit vector between the nearest points, from b to a. The nearest feature of a has the vertices with the
smallest `r^ . x`, the nearest feature of b those with the largest, up to the rounding of r^. One vertex is a vertex,
two are an edge, more are a face.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pinbound.evaluate import numeric, separation
from pinbound.exceptions import UnsupportedError
from pinbound.path.chain import Chain
from pinbound.path.relative import RelativePath
from pinbound.tolerances import OVERLAP, UNIT_ROUNDOFF
from pinbound.typing import Array, Flags
from pinbound.values import Value

__all__ = ["Feature", "nearest_features"]

_ROUNDINGS = 64  # of the unit vector between the nearest points, and of heights along it


@dataclass(frozen=True)
class Feature(Value):
    """The part of a body that is nearest to the other one.

    Attributes:
        vertices: Indices of its vertices in the shape of the mark (`mark.shape.vertices`), in order.
        kind: ``"vertex"``, ``"edge"`` or ``"face"``; ``"point"`` if the body has only one vertex.
    """

    vertices: tuple[int, ...]
    kind: str

    def __str__(self) -> str:
        """Return the kind, and the vertices if there are several.

        Example:
            >>> str(Feature((1, 5), "edge")), str(Feature((0,), "point"))
            ('edge 1-5', 'point')
        """
        return self.kind if self.kind == "point" else f"{self.kind} {'-'.join(map(str, self.vertices))}"


def nearest_features(path: RelativePath, Q: Array) -> list[tuple[Feature, Feature] | None]:
    """Return the nearest features of a and b at each row of Q; None where the bodies overlap.

    Args:
        path: The relative path of two marks.
        Q: (N, n).

    Raises:
        UnsupportedError: If one of the marks is a line or plane, which has no vertices.
    """
    if path.normal is not None:
        raise UnsupportedError("a line or plane has no vertices to name. Ask for a boundary between two bodies")
    r = separation.vectors(path, Q)
    size = np.linalg.norm(r, axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        unit = r / size[:, None]
        slack = _ROUNDINGS * UNIT_ROUNDOFF * path.minimal.scale * (1.0 + path.minimal.scale / size)
    split = path.difference.corners[0].shape[1]  # directions of a come first
    a = _lowest(path.branch_a.edges[:split], path.difference.corners[0], Q, unit, slack)
    b = _lowest(path.branch_b.edges[split:], path.difference.corners[1], Q, -unit, slack)
    return [
        (_feature(first), _feature(second)) if length > OVERLAP * path.minimal.scale else None
        for first, second, length in zip(a, b, size.tolist(), strict=True)
    ]


def _lowest(edges: Sequence[Chain], corners: Array, Q: Array, direction: Array, slack: Array) -> Flags:
    """Return which vertices (N, k) are the lowest along a direction (N, 3), within some slack (N,) [m]."""
    along = np.array([np.einsum("ni,ni->n", numeric.positions(edge, Q), direction) for edge in edges])
    heights = along.reshape(len(edges), len(Q)).T @ corners.T
    with np.errstate(invalid="ignore"):
        found: Flags = heights <= heights.min(axis=1, keepdims=True) + slack[:, None]
    return found


def _feature(lowest: Flags) -> Feature:
    vertices = tuple(np.flatnonzero(lowest).tolist())
    kind = "point" if len(lowest) == 1 else {1: "vertex", 2: "edge"}.get(len(vertices), "face")
    return Feature(vertices, kind)
