"""On which side of a contact strip a motion lies: what is clear may still not be reachable from home."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pinbound.boundaries.boundary import Boundary
from pinbound.certificates.constraints import families
from pinbound.certificates.polynomials import Polynomials
from pinbound.certificates.records import Budget, Verdict
from pinbound.certificates.search import Meter, Search
from pinbound.exceptions import UnsupportedError
from pinbound.robot.robot import Robot
from pinbound.typing import Array

__all__ = ["far_sides"]

_EASY = 64  # parts a boundary, for a look that saves the isolation of all strips of a turn


def far_sides(robot: Robot, boundaries: Sequence[Boundary], q: Array) -> tuple[str, ...]:
    """Return the boundaries with a contact strip beyond which q lies, seen from home: clear, but not reachable.

    Of one effective angle, phi runs from its value at home to that at q on the straight way between them, and nowhere
    else. So a strip lies between if there is contact on that way, and none does if it is proven clear. Strips of bodies
    are looked for by their ends, over a whole turn, only where neither is proven.

    Args:
        robot: The robot.
        boundaries: Some of its boundaries, all clear at q.
        q: (n,).
    """
    known = _between(robot, [one for one in boundaries if _is_searched(one)], q)
    found: list[str] = []
    for boundary in boundaries:
        verdict = known.get(boundary.name, Verdict.UNDECIDED)
        if verdict is not Verdict.UNDECIDED:
            found += [boundary.name] if verdict is Verdict.VIOLATED else []
            continue
        try:
            is_strip = any(contact.half_width for contact in boundary.contacts or ())
        except UnsupportedError:  # contact is flat along an interval, to rounding: its sides are not known
            continue
        if is_strip and boundary.parts(robot.home, q):
            found.append(boundary.name)
    return tuple(found)


def _is_searched(boundary: Boundary) -> bool:
    """Return whether strips have no closed form, and the links are where the coupling puts them."""
    path = boundary.path
    return bool(path.swept.directions) and not np.any(path.minimal.slides) and not boundary.place_error


def _between(robot: Robot, boundaries: Sequence[Boundary], q: Array) -> dict[str, Verdict]:
    """Return what is found of boundaries on the straight way from home to q."""
    if not boundaries:
        return {}
    ends = np.stack((robot.home, q))
    nothing = np.zeros((1, len(q)))
    way = Polynomials(ends[None], np.zeros(1), np.ones(1), nothing)
    *_, swept = families(robot, boundaries, *way.extent)
    search = Search(swept, way, Meter(Budget(_EASY * len(boundaries))), None)
    search.run(each=False)
    return {one.name: one.verdict for one in search.results()[0]}
