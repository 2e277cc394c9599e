"""Closed loops: pins that join two links of the tree, and the proof that they stay joined.

The reduced path of a closure that always closes is empty: all its offsets cancel. The remaining offsets bound the
residual for every q, `|r(q)| <= sum_i |s_i|` (rotations keep lengths), so a loop is accepted without sampling.

A small residual at the pin does not mean a small error of the links. If the sides of a loop differ by more than
rounding, its passive joints differ from the coupling: each `Deviation` has a bound of this error, and `place_error` is
its effect on the distance of two marks. `docs/closures.md` derives both.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pinbound.annotations import ClosureMark, Mark, Point
from pinbound.evaluate import numeric
from pinbound.model.coupling import Coupling, LinearLimit
from pinbound.model.tree import Tree
from pinbound.path.chain import HullChain
from pinbound.path.relative import RelativePath, relative_path
from pinbound.tolerances import CLOSURE_SHARE, EXACT_LOOP, INFLATION, REDUCTION
from pinbound.typing import Array
from pinbound.values import Value

__all__ = ["Closure", "Deviation", "augmented", "close", "joint_errors", "place_error"]


@dataclass(frozen=True, eq=False)
class Deviation(Value):
    """The largest difference of the true linkage from the coupling, if the sides of its loop differ.

    Attributes:
        joint: The passive joint that deviates.
        bound: [rad], proven while every joint limit is kept.
        response: (n_tree,) the motion of each tree joint with it, per radian.
    """

    joint: str
    bound: float
    response: Array


@dataclass(frozen=True, eq=False)
class Closure(Value):
    """A pin between two links, with the path around its loop.

    Attributes:
        mark: The annotation.
        path: The relative path between the two ends of the pin.
        deviations: The errors of its passive joints; none if its sides are equal up to rounding.
        apart: [m], the distance of its two pins along the axis of its joints.
    """

    mark: ClosureMark
    path: RelativePath
    deviations: tuple[Deviation, ...] = ()
    apart: float = 0.0

    @property
    def name(self) -> str:
        """Its name in the annotations."""
        return self.mark.name

    def residuals(self, Q: Array) -> Array:
        """Return the gap (N,) [m] between the two ends of the pin, from both branches without cancellation."""
        return numeric.norm(
            numeric.positions(self.path.branch_a.chain, Q) - numeric.positions(self.path.branch_b.chain, Q)
        )

    @property
    def size(self) -> float:
        """The length of the path around the loop [m]."""
        return self.path.minimal.scale

    @property
    def left(self) -> float:
        """The remaining offsets of the loop [m]; infinite if a prismatic joint opens it."""
        chain = self.path.minimal
        if np.any(chain.slides):
            return math.inf
        return float(np.sum(np.linalg.norm(chain.offsets, axis=1)))

    @property
    def bound(self) -> float:
        """A proven upper bound of the residual over all q [m]; infinite if a prismatic joint opens the loop."""
        return self.left + REDUCTION * self.size  # what the reduction may have taken for zero

    @property
    def tolerance(self) -> float:
        """The allowed total difference of its sides [m]: that of the mark, but at most a share of the loop's size."""
        return max(min(self.mark.tolerance, CLOSURE_SHARE * self.size), EXACT_LOOP * self.size)

    @property
    def is_exact(self) -> bool:
        """Whether only rounding remains of the loop."""
        return self.left <= EXACT_LOOP * self.size

    @property
    def closes(self) -> bool:
        """Whether the proven bound is below its tolerance plus rounding."""
        return self.bound <= self.tolerance + EXACT_LOOP * self.size


def close(tree: Tree, coupling: Coupling, mark: ClosureMark) -> Closure:
    """Derive the path around a loop.

    Raises:
        UnsupportedError: If a floating or planar joint is part of the loop.
    """
    ends = (Point("a", mark.link_a, mark.xyz_a), Point("b", mark.link_b, mark.xyz_b))
    return Closure(mark, relative_path(tree, coupling, *ends))


def augmented(coupling: Coupling, responses: Sequence[tuple[str, Array]]) -> Coupling:
    """Return the coupling with additional coordinates: zero in the coupling, small in the true linkage.

    Args:
        coupling: `theta = S q + o`.
        responses: The name of each new coordinate, and the response of every tree joint to it (n_tree,).
    """
    columns = np.array([response for _, response in responses]).reshape(-1, len(coupling.joints)).T
    names = (*coupling.coordinates, *(name for name, _ in responses))
    return Coupling(names, coupling.joints, np.hstack((coupling.S, columns)), coupling.offset)


def joint_errors(coupling: Coupling, closures: Sequence[Closure]) -> Array:
    """Return the largest difference of each tree joint from `S q + o` (n_tree,) [rad or m]; zero for exact loops."""
    errors = np.zeros(len(coupling.joints))
    for one in _all(closures):
        errors += one.bound * np.abs(one.response)
    return errors


def place_error(
    tree: Tree, coupling: Coupling, limits: Sequence[LinearLimit], closures: Sequence[Closure], a: Mark, b: Mark
) -> float:
    """Return the largest error of the distance of two marks computed by the coupling [m], within all joint limits.

    `|r(q, d) - r(q, 0)| <= sum_k bound_k sum_i rho_i |c_ik|`, with the lever arms of the path over q and the deviations
    d.

    Raises:
        UnsupportedError: If a floating or planar joint lies between the two links.
    """
    found = _all(closures)
    if not found:
        return 0.0
    whole = augmented(coupling, [(one.joint, one.response) for one in found])
    path = relative_path(tree, whole, a, b)
    n, chain = len(coupling.coordinates), path.minimal
    crossed = {index - n for index in chain.coordinates if index >= n}
    if not crossed:
        return 0.0
    reach = _reach(limits, len(whole.coordinates))
    reach[:n] = np.where(np.any(chain.slides, axis=(0, 1))[:n], reach[:n], 0.0)  # revolute: any angle
    reach[n:] = [one.bound for one in found]
    if not np.all(np.isfinite(reach)):
        return math.inf
    either = (path, replace(path, difference=HullChain(chain.reversed()))) if path.is_plain else (path,)
    moved = min(float(_moved(one, reach, n) @ reach[n:]) for one in either)  # of two points either may stand still
    apart = sum(c.apart for c in closures if any(found.index(one) in crossed for one in c.deviations))
    return moved * INFLATION + apart


def _moved(path: RelativePath, reach: Array, n: int) -> Array:
    """Return the largest rate of a path's distance by each coordinate after the first n [m per unit]."""
    from pinbound.bounds.swept_bounds import swept_bundle

    chain = path.minimal
    turned = swept_bundle([path], -reach, reach).arms[0] @ np.abs(chain.coefficients[:, n:])
    moved: Array = turned + np.linalg.norm(chain.slides[:, :, n:], axis=1).sum(axis=0)
    return moved


def _all(closures: Sequence[Closure]) -> list[Deviation]:
    return [one for closure in closures for one in closure.deviations]


def _reach(limits: Sequence[LinearLimit], n: int) -> Array:
    """Return the largest absolute value of each coordinate (n,); infinite if no limit bounds it alone."""
    reach = np.full(n, np.inf)
    for limit in limits:
        (used,) = np.nonzero(limit.coefficients)
        if len(used) == 1:
            ends = (np.array([limit.lower, limit.upper]) - limit.offset) / limit.coefficients[used[0]]
            reach[used[0]] = min(reach[used[0]], float(np.abs(ends).max()))
    return reach
