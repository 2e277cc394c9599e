"""Results of the bodies and boundaries of two links at the same configurations, counted."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from pinbound.boundaries.boundary import Boundary
from pinbound.crosscheck.engine import blocks
from pinbound.typing import Array, Flags
from pinbound.values import Value

__all__ = ["LinkPair", "crossing", "largest", "least_clearance"]


@dataclass(frozen=True, eq=False)
class LinkPair(Value):
    """The bodies of two links, and the boundaries between them.

    Attributes:
        links: The two links.
        boundaries: Names of the boundaries between them.
        bodies: Number of pairs of bodies.
        touching: Number of further pairs of bodies that are in contact at home, by coal. They are left out: home is
            free, so they overlap by design.
        both_clear: Samples that both sides call clear.
        both_contact: Samples that both sides refuse.
        misses: Samples that pinbound calls clear, although bodies are in contact.
        refusals: Samples in contact for pinbound, although the bodies are clear, and none is inside another's mesh.
        ways: Number of straight paths from home that were swept without stepping over a contact.
        unreachable: Samples beyond a contact of any links, at which these bodies are clear.
        miss: [m], the deepest penetration at a configuration that pinbound calls clear: a sample, a point of a path, or
            the start of contact.
        miss_q: (n,), this configuration; None if there is none.
        refusal: [m], the largest gap between the bodies where pinbound refuses, or where contact begins.
        refusal_q: (n,), this configuration; None if there is none.
        stops: Whether one boundary has zero threshold: it claims where bodies first touch.
        meshes: Whether a body is a mesh: coal then answers yes or no, on the raw triangles, and no path is swept.
        near: Number of further configurations at which a path from home meets these boundaries, to 1e-9 of the path.
        measured: Number of needless refusals that were measured; at most 200 for meshes, because each takes a
            millisecond.
        inside: Configurations that pinbound refuses (samples, and of *near* those just after) without contact of
            triangles, because a body is completely inside the mesh of the other: not needless.
        inside_q: (n,), one of these configurations; None if there is none.
        hidden: Samples that pinbound calls clear, at which one body is completely inside the mesh of another: in a
            hollow between several marks (`robot.coverage.notes`). No motion leads there without a contact.
        hidden_q: (n,), one of these samples; None if there is none.
        within: Which link is inside which, as text; empty if none is.
        coverage: The coverage of the pair: only if it is watched completely, the marks hold the bodies.
    """

    links: tuple[str, str]
    boundaries: tuple[str, ...]
    bodies: int
    touching: int
    both_clear: int
    both_contact: int
    misses: int
    refusals: int
    unreachable: int
    ways: int
    miss: float
    miss_q: Array | None
    refusal: float
    refusal_q: Array | None
    stops: bool
    meshes: bool = False
    near: int = 0
    measured: int = 0
    inside: int = 0
    inside_q: Array | None = None
    hidden: int = 0
    hidden_q: Array | None = None
    within: str = ""
    coverage: str = ""


def least_clearance(boundaries: Sequence[Boundary], Q: Array) -> Array:
    """Return the smallest signed clearance (N,), without stops, whose contact is a point of the path."""
    least = np.full(len(Q), math.inf)
    for boundary, block in product([one for one in boundaries if not one.is_stop], blocks(len(Q))):
        least[block] = np.minimum(least[block], boundary.signed_clearance(Q[block]))
    return least


def largest(choices: Sequence[tuple[Flags, Array, Array]]) -> tuple[float, Array | None]:
    """Return the largest positive value over several masked arrays, with its configuration; 0 and None if none."""
    value, q = 0.0, None
    for mask, values, Q in choices:
        if not len(mask):
            continue
        masked = np.where(mask, values, -np.inf)
        row = int(np.argmax(masked))
        if masked[row] > value:
            value, q = float(masked[row]), Q[row]
    return value, q


def crossing(boundary: Boundary, home: Array, Q: Array) -> Array:
    """Return the share of the path from home to each q (N,) at which the boundary is met; infinite if it is not."""
    share = np.full(len(Q), math.inf)
    for contact in boundary.contacts or ():
        start = float(contact.coefficients @ home)
        phi = Q @ contact.coefficients
        lower, upper = contact.gap(start)
        with np.errstate(divide="ignore", invalid="ignore"):
            share = np.fmin(share, np.where(phi >= upper, (upper - start) / (phi - start), math.inf))
            share = np.fmin(share, np.where(phi <= lower, (lower - start) / (phi - start), math.inf))
    return share
