"""The side of a contact strip on which a motion lies: a clear motion may still be unreachable from home."""

from __future__ import annotations

from collections.abc import Container, Sequence

import numpy as np

from pinbound.boundaries.boundary import Boundary
from pinbound.certificates.kept import Tables
from pinbound.certificates.polynomials import Polynomials
from pinbound.certificates.records import Budget, Verdict
from pinbound.certificates.search import Meter, Search
from pinbound.exceptions import UnsupportedError
from pinbound.typing import Array

__all__ = ["far_sides"]

_EASY = 64  # parts for each boundary, for a test that can replace the isolation of all strips of a turn


def far_sides(tables: Tables, names: Container[str], q: Array) -> tuple[str, ...]:
    """Return the bodies with a contact strip between home and q: q is clear, but not reachable.

    For one effective angle, phi goes from its value at home to that at q on the straight motion between them, and takes
    no other values. So a strip is between them if this motion meets contact, and there is none if the motion is proven
    clear. Only if neither is proven, the ends of the strips of bodies are searched over a full turn.

    Args:
        tables: A robot's boundaries.
        names: Names of the boundaries that are clear at q.
        q: (n,).
    """
    boundaries = [one for one in tables.turning_bodies if one.name in names]
    known = _between(tables, [one.name for one in boundaries if _is_searched(one)], q)
    found: list[str] = []
    for boundary in boundaries:
        verdict = known.get(boundary.name, Verdict.UNDECIDED)
        if verdict is not Verdict.UNDECIDED:
            found += [boundary.name] if verdict is Verdict.VIOLATED else []
            continue
        try:
            is_strip = any(contact.half_width for contact in boundary.contacts or ())
        except UnsupportedError:  # up to rounding, contact is flat along an interval: its sides are not known
            continue
        if is_strip and boundary.parts(tables.robot.home, q):
            found.append(boundary.name)
    return tuple(found)


def _is_searched(boundary: Boundary) -> bool:
    """Return whether there is one angle, and the positions of the links follow from the coupling."""
    return not np.any(boundary.path.minimal.slides) and not boundary.place_error


def _between(tables: Tables, names: Sequence[str], q: Array) -> dict[str, Verdict]:
    """Return the verdicts of boundaries on the straight motion from home to q."""
    if not names:
        return {}
    ends = np.stack((tables.robot.home, q))
    way = Polynomials(ends[None], np.zeros(1), np.ones(1), np.zeros((1, len(q))))
    *_, swept = tables.families(*way.extent, 1)
    rows = np.array([swept.names.index(name) for name in names], dtype=np.intp)
    search = Search(swept, way, Meter(Budget(_EASY * len(rows))), None)
    search.run(False, rows)
    found, _ = search.results()
    return {name: found[int(row)].verdict for name, row in zip(names, rows, strict=True)}
