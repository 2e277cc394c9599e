"""What two links' bodies and boundaries say of the same configurations, counted."""

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
        bodies: How many pairs of bodies.
        touching: How many pairs of bodies more were in contact at home, by coal, and therefore left out: home is free,
            so that they overlap by design.
        both_clear: Samples that both sides call clear.
        both_contact: Samples that both sides refuse.
        misses: Samples that pinbound calls clear, while bodies are in contact.
        refusals: Samples in contact for pinbound, while the bodies are clear, and none is inside another's mesh.
        ways: How many straight ways from home were swept without stepping over a contact.
        unreachable: Samples beyond a contact of any links, at which these bodies are clear.
        miss: [m], the deepest penetration at a configuration that pinbound calls clear, sample or on a way, or where
            contact begins.
        miss_q: (n,), where that is; None if there is none.
        refusal: [m], the largest gap between the bodies where pinbound refuses, or where contact begins.
        refusal_q: (n,), where that is; None if there is none.
        stops: Whether a boundary of zero threshold is among them: it claims where bodies first touch.
        meshes: Whether a body is a mesh: coal is asked for yes or no, on the raw triangles, and no way is swept.
        near: Configurations more, each where a way from home meets these boundaries, to 1e-9 of the way.
        measured: How many needless refusals were measured; of meshes at most 200, for each takes a millisecond.
        inside: Places that pinbound refuses (samples, and of *near* those just after) where no triangles touch, for a
            body is wholly inside the mesh of the other: not refused needlessly.
        inside_q: (n,), one of these places; None if there is none.
        hidden: Samples that pinbound calls clear, at which one body is wholly inside the mesh of another: a hollow that
            several marks leave between them (`robot.coverage.notes`). No motion leads there without a contact.
        hidden_q: (n,), one of these samples; None if there is none.
        within: Which link is inside which, for people; empty if none is.
        coverage: How coverage looks after the pair: only where it is watched as a whole do the marks hold the bodies.
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
    """Return the smallest signed clearance (N,); stops, whose contact is a place on the way, are not among them."""
    least = np.full(len(Q), math.inf)
    for boundary, block in product([one for one in boundaries if not one.is_stop], blocks(len(Q))):
        least[block] = np.minimum(least[block], boundary.signed_clearance(Q[block]))
    return least


def largest(choices: Sequence[tuple[Flags, Array, Array]]) -> tuple[float, Array | None]:
    """Return the largest positive value over several masked arrays, with its configuration; 0 and None without."""
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
    """Return the share of the way from home to each q (N,) at which the boundary is met; infinite if it is not."""
    share = np.full(len(Q), math.inf)
    for contact in boundary.contacts or ():
        start = float(contact.coefficients @ home)
        phi = Q @ contact.coefficients
        lower, upper = contact.gap(start)
        with np.errstate(divide="ignore", invalid="ignore"):
            share = np.fmin(share, np.where(phi >= upper, (upper - start) / (phi - start), math.inf))
            share = np.fmin(share, np.where(phi <= lower, (lower - start) / (phi - start), math.inf))
    return share
