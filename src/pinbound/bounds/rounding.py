"""A bound of every rounding error in a chain's norm: in the reduction, in the motion, and in the evaluation.

Terms that the reduction cancels have rounding errors, too: two mimic joints that rotate by `1e6 q` and `-1e6 q + q`
give one rotation by q, with the rounding error of `1e6 q`. So the bound is about the joints between the marks as they
are in the tree, with the sums of abs(multiplier) and abs(offset). `docs/certificates.md` derives it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pinbound.bounds.bounds import Bundle
from pinbound.model.coupling import Coupling
from pinbound.model.tree import Tree
from pinbound.tolerances import EVALUATION, FOLDING, REDUCTION_ROUNDOFFS, REDUCTION_SLIDES, UNIT_ROUNDOFF
from pinbound.typing import Array

__all__ = ["Rounding", "Walks", "rounding_bound", "walks"]


@dataclass(frozen=True, eq=False)
class Walks:
    """m walks through the tree from one mark to another, before the reduction.

    Attributes:
        joints: (m,) number of joints, with fixed joints.
        turning: (m, n), sum of abs(S) over the revolute joints, for each coordinate.
        sliding: (m, n), the same for prismatic joints.
        turned: (m,) sum of abs(offset) over the revolute joints [rad].
    """

    joints: Array
    turning: Array
    sliding: Array
    turned: Array

    def with_edges(self, edges: int) -> Walks:
        """Return each walk once, and again for each of its `edges`, which rotate with it but do not translate."""
        rows = np.repeat(np.arange(len(self.joints)), 1 + edges)
        sliding = self.sliding[rows].copy()
        sliding[np.arange(len(rows)) % (1 + edges) != 0] = 0.0
        return Walks(self.joints[rows], self.turning[rows], sliding, self.turned[rows])


def walks(tree: Tree, coupling: Coupling, ends: Sequence[tuple[str, str, str]]) -> Walks:
    """Return the walks between links.

    Args:
        tree: The robot's tree.
        coupling: `theta = S q + o`.
        ends: A common ancestor and the two links of each walk.
    """
    m, n = len(ends), len(coupling.coordinates)
    found = Walks(np.zeros(m), np.zeros((m, n)), np.zeros((m, n)), np.zeros(m))
    for row, (ancestor, *links) in enumerate(ends):
        for joint in [joint for link in links for joint in tree.descent(ancestor, link)]:
            found.joints[row] += 1.0
            if not joint.moves:
                continue
            coefficients, offset = coupling.row(joint.name)
            if joint.type == "prismatic":
                found.sliding[row] += np.abs(coefficients)
            else:
                found.turning[row] += np.abs(coefficients)
                found.turned[row] += abs(offset)
    return found


@dataclass(frozen=True, eq=False)
class Rounding:
    """The data of the rounding bounds of m chains, except for the range of q.

    Attributes:
        walked: The walks that the chains were reduced from.
        reach: (m,) length of each path without prismatic joints [m].
        rotations: The number k of rotations of the chains, with padding.
    """

    walked: Walks
    reach: Array
    rotations: int

    @classmethod
    def of(cls, chains: Bundle, walked: Walks | None) -> Rounding:
        """Return the data of chains; `walked` None: the chains are exact."""
        size = np.linalg.norm(chains.offsets, axis=2).sum(axis=1)
        return cls(walked or _as_reduced(chains), np.maximum(chains.scale, size), chains.rotations)

    def linear(self) -> tuple[Array, Array]:
        """Return c (m,) and C (m, n) with `bound = c + C max(|lower|, |upper|)`: straight motions, revolute joints."""
        walked, n = self.walked, self.walked.turning.shape[1]
        joints, reach = walked.joints + 1.0, UNIT_ROUNDOFF * self.reach
        each = n + 12.0 + 1.0 + joints**2
        constant = FOLDING * joints**2 + EVALUATION * (self.rotations + 1) + n + 12.0 + each * walked.turned
        slope = each[:, None] * walked.turning + REDUCTION_ROUNDOFFS * joints[:, None] * (walked.turning > 0.0)
        return reach * constant, reach[:, None] * slope

    def bound(self, lower: Array, upper: Array, degree: int = 1) -> Array:
        """Return `rounding_bound` (m,) [m]."""
        walked, n = self.walked, self.walked.turning.shape[1]
        constants, squares, dropping, slides = self._known
        farthest = np.maximum(np.abs(lower), np.abs(upper))
        angles = walked.turning @ farthest + walked.turned
        evaluated = (n + 4 + 8 * degree) * (1.0 + angles) + squares * angles
        dropped = dropping @ farthest
        if slides is None:
            return UNIT_ROUNDOFF * (self.reach * (constants + evaluated + dropped))
        reach = self.reach + walked.sliding @ farthest
        return UNIT_ROUNDOFF * (reach * (constants + evaluated + dropped) + slides @ farthest)

    @cached_property
    def _known(self) -> tuple[Array, Array, Array, Array | None]:
        """The terms that do not depend on the box: constants, squares of joints, and terms per unit of each |q_j|."""
        walked = self.walked
        joints = walked.joints + 1.0
        constants = FOLDING * joints**2 + EVALUATION * (self.rotations + 1)
        dropping = (REDUCTION_ROUNDOFFS * joints)[:, None] * (walked.turning > 0.0)
        slides = (REDUCTION_SLIDES * joints)[:, None] * (walked.sliding > 0.0)
        return constants, 1.0 + joints**2, dropping, slides if np.any(slides) else None


def rounding_bound(chains: Bundle, walked: Walks | None, lower: Array, upper: Array, degree: int = 1) -> Array:
    """Return a bound of every rounding error in a norm while q stays in a box, (m,) [m].

    It covers the derivation of the chain (constants folded in float64, values that the reduction took for zero, sums of
    multipliers), the evaluation of a motion of this degree, and the evaluation of the chain.

    Args:
        chains: The chains.
        walked: The walks from which they were reduced; None: the chains are exact.
        lower: (n,) lower corner of the box.
        upper: (n,) upper corner.
        degree: Polynomial degree of the pieces of the motion.
    """
    return Rounding.of(chains, walked).bound(lower, upper, degree)


def _as_reduced(chains: Bundle) -> Walks:
    """Return walks with the rotations and lengths of the chains themselves."""
    m = len(chains.scale)
    turning = np.abs(chains.coefficients).sum(axis=1)
    sliding = np.zeros_like(turning) if chains.slides is None else np.linalg.norm(chains.slides, axis=2).sum(axis=1)
    return Walks(np.zeros(m), turning, sliding, np.zeros(m))
