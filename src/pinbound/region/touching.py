"""The parts of two bodies that touch along an edge of a region: a vertex, an edge or a face of each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from pinbound.boundaries.looped import over_z
from pinbound.evaluate.touching import Feature, nearest_features
from pinbound.exceptions import UnknownNameError
from pinbound.region.arrangement import Edge
from pinbound.region.loop_slice import over
from pinbound.region.slice import Slice
from pinbound.values import Value

__all__ = ["Touch", "touches"]


@dataclass(frozen=True, eq=False)
class Touch(Value):
    """An interval of an edge along which the same parts of two bodies are nearest.

    Attributes:
        first: Index in `edge.points` of its first point.
        last: Index of its last point.
        a: The part of the boundary's first mark.
        b: The part of its second mark.
    """

    first: int
    last: int
    a: Feature
    b: Feature

    def __str__(self) -> str:
        """Return both parts, e.g. ``"vertex 3 on face 0-1-2-3"``."""
        return f"{self.a} on {self.b}"


def touches(slice_: Slice, edge: Edge, contacts: Sequence[str]) -> tuple[Touch, ...]:
    """Return the intervals of an edge, in its order; points where the bodies overlap up to rounding are left out.

    An edge is a polyline within the region's `accuracy` of contact. Each of its points is tested. So an interval
    between two neighbouring points can be missed.

    Raises:
        UnknownNameError: If the edge is not a contact, but a limit of a joint, or a rule.
    """
    if not edge.is_contact:
        raise UnknownNameError("contact edge", edge.name, contacts)
    Z = over(slice_.robot, slice_.lift(np.asarray(edge.points)))[1]
    told = nearest_features(over_z(slice_.robot.boundaries[edge.source]).path, Z)
    found: list[Touch] = []
    for pair, group in groupby(enumerate(told), key=lambda one: one[1]):
        places = [place for place, _ in group]
        if pair is not None:
            found.append(Touch(places[0], places[-1], *pair))
    return tuple(found)
