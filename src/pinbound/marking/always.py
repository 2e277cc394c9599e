"""Proof that two marks overlap in every configuration.

Take a point p of one mark and a point s of the other. The reduced chain between them is `r = b_0 + R_1(b_1 +
R_2(...))`, with offsets that are linear in p and s. So `|r| <= sum |b_i|` for all angles. The part of b_i along the
axis of R_i may also be counted with `b_{i-1}`, because R_i does not change it. If one mark holds a ball of radius rho_a
about p, and the other holds one of radius rho_b about s, then `sum |b_i| < rho_a + rho_b` proves that the two balls
overlap in every configuration, also outside the joint limits. `docs/marking.md` has the derivation.
"""

from __future__ import annotations

from functools import cache
from itertools import product
from typing import Any, cast

import numpy as np

from pinbound.annotations import Mark, Shape, Sweep
from pinbound.coverage.holding import holds_points
from pinbound.model.coupling import Coupling
from pinbound.model.tree import Tree
from pinbound.path.chain import HullChain
from pinbound.path.relative import minimal_chain
from pinbound.tolerances import HELD, NEVER_MEETS
from pinbound.typing import Array

__all__ = ["overlap_everywhere"]


_SOLID = 3  # dimensions
_SMOOTH = 1e-7  # metres: the minimisation smooths norms within this length; the comparison uses exact norms
_ROUNDS = 60
_FLAT_EXTENT = 1e-6  # relative: in a thinner hull no ball is searched for


def overlap_everywhere(tree: Tree, coupling: Coupling, a: Mark, b: Mark) -> float | None:
    """Return by how much two marks are proven to overlap in every configuration [m]; None if that is not proven.

    It is a lower bound of the overlap of two balls inside them. The caller must exclude links between which a prismatic
    joint or a loop with different sides lies; with a prismatic joint this function proves nothing.

    Example:
        >>> import pinbound as pb
        >>> from pinbound.annotations import Point
        >>> robot = pb.load("minervabot_v3")
        >>> elbow = Point("a", "link_2", (0.0, 0.0, 0.0), 0.2), Point("b", "link_3", (0.0, 0.0, 0.0), 0.2)
        >>> round(overlap_everywhere(robot.tree, robot.coupling, *elbow), 3)
        0.3
    """
    shapes = a.shape, b.shape
    if any(shape.is_unbounded for shape in shapes):
        return None
    x, y, z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    open_ends = [Sweep("", link, (0.0, 0.0, 0.0), (x, y, z)) for link in (a.link, b.link)]
    difference = minimal_chain(tree, coupling, open_ends[0], open_ends[1])
    if np.any(difference.chain.slides):
        return None
    p, s, shifts = _nearest_balls(difference, *shapes)
    rho = [_ball_within(shape, centre) + shape.radius for shape, centre in zip(shapes, (p, s), strict=True)]
    reach = float(np.linalg.norm(_offsets(difference, p, s, shifts), axis=1).sum())
    overlap = rho[0] + rho[1] - reach
    return overlap if overlap > NEVER_MEETS else None


def _offsets(difference: HullChain, p: Array, s: Array, shifts: Array) -> Array:
    """Return the offsets b_i (k, 3) of the chain between two points, with parts along axes moved by `shifts`."""
    directions = np.array(difference.directions)
    found = difference.chain.offsets + np.tensordot(p, directions[:3], axes=1) + np.tensordot(s, directions[3:], axes=1)
    for index, (shift, axis) in enumerate(zip(shifts, difference.chain.axes, strict=True)):
        found[index] += shift * axis
        found[index + 1] -= shift * axis
    return found


def _nearest_balls(difference: HullChain, one: Shape, other: Shape) -> tuple[Array, Array, Array]:
    """Return points of two shapes, and shifts along the axes, that make `sum |b_i| - rho_a - rho_b` small.

    The problem is convex. The result need not be its minimum, because it is verified with its own numbers.
    """
    import scipy.optimize

    ends = [_Inside(one), _Inside(other)]
    turns = len(difference.chain.axes)
    cut = np.cumsum([ends[0].count, ends[1].count])

    def value(x: Array) -> float:
        p, s = ends[0].point(x[: cut[0]]), ends[1].point(x[cut[0] : cut[1]])
        offsets = _offsets(difference, p, s, x[cut[1] :])
        sizes = np.sqrt(np.einsum("ki,ki->k", offsets, offsets) + _SMOOTH**2)
        return float(sizes.sum() - ends[0].ball(x[: cut[0]]) - ends[1].ball(x[cut[0] : cut[1]]))

    start = np.concatenate((ends[0].start, ends[1].start, np.zeros(turns)))
    constraints: list[dict[str, Any]] = []
    for end, part in zip(ends, (slice(0, cut[0]), slice(cut[0], cut[1])), strict=True):
        constraints += end.constraints(part, len(start))
    found: Any = cast(Any, scipy.optimize).minimize(
        value, start, method="SLSQP", constraints=constraints, options={"maxiter": _ROUNDS, "ftol": 1e-9}
    )
    x = np.asarray(found.x if np.all(np.isfinite(found.x)) else start, dtype=np.float64)
    return ends[0].point(x[: cut[0]]), ends[1].point(x[cut[0] : cut[1]]), x[cut[1] :]


class _Inside:
    """A point of a shape and a ball about it, as numbers: weights of vertices, or a point and a radius."""

    def __init__(self, shape: Shape) -> None:
        self.vertices = np.asarray(shape.vertices, dtype=np.float64)
        self.facets = _facets(self.vertices)
        if self.facets is None:
            self.count = len(self.vertices)
            self.start = np.full(self.count, 1.0 / self.count)
        else:
            self.count = _SOLID + 1
            self.start = np.append(self.vertices.mean(axis=0), 0.0)

    def point(self, x: Array) -> Array:
        if self.facets is not None:
            return x[:_SOLID]
        weights = np.maximum(x, 0.0)
        total = float(weights.sum())
        return (weights / total if total > 0.0 else self.start) @ self.vertices

    def ball(self, x: Array) -> float:
        return 0.0 if self.facets is None else float(x[_SOLID])

    def constraints(self, part: slice, size: int) -> list[dict[str, Any]]:
        """Return constraints: the ball is behind every facet, or the weights are nonnegative with the sum one."""
        rows = np.zeros((self.count if self.facets is None else len(self.facets), size))
        if self.facets is None:
            rows[:, part] = np.eye(self.count)
            whole = np.zeros(size)
            whole[part] = 1.0
            return [_linear("ineq", rows, 0.0), _linear("eq", whole, 1.0)]
        normals, level = self.facets[:, :_SOLID], self.facets[:, _SOLID]
        rows[:, part] = -np.column_stack((normals, np.ones(len(normals))))
        return [_linear("ineq", rows, level)]


def _linear(kind: str, rows: Array, level: Array | float) -> dict[str, Any]:
    """Return `rows @ x >= level`, or `==`, in SciPy's format."""

    def value(x: Array) -> Array:
        return rows @ x - level

    def slope(_: Array) -> Array:
        return rows

    return {"type": kind, "fun": value, "jac": slope}


def _facets(vertices: Array) -> Array | None:
    """Return `n . x + c <= 0` (m, 4) of a solid's facets; None for a flat hull, a segment or a point."""
    from scipy.spatial import ConvexHull, QhullError

    if len(vertices) <= _SOLID:
        return None
    extents = np.linalg.svd(vertices - vertices.mean(axis=0), compute_uv=False)
    if extents[-1] <= _FLAT_EXTENT * extents[0]:
        return None
    try:
        return np.unique(np.round(ConvexHull(vertices).equations, 12), axis=0)
    except QhullError:
        return None


def _ball_within(shape: Shape, centre: Array) -> float:
    """Return the radius [m] of a ball about a point of a shape that is proven to lie in the shape without its radius.

    Facets propose the radius. The proof uses points of the shape: their hull is in the shape, and holds the ball.
    """
    if not holds_points(shape, centre[None], 0.0):
        return -np.inf
    facets = _facets(np.asarray(shape.vertices, dtype=np.float64))
    if facets is None:
        return 0.0
    radius = float(np.min(-facets[:, _SOLID] - facets[:, :_SOLID] @ centre))
    directions, share = _directions()
    if radius <= 0.0 or not holds_points(shape, centre + radius * directions, 0.0):
        return 0.0
    return share * radius - HELD


@cache
def _directions() -> tuple[Array, float]:
    """Return unit vectors (98, 3), and the radius of the largest ball about the origin in their hull."""
    from scipy.spatial import ConvexHull

    steps = np.array([xyz for xyz in product(range(-2, 3), repeat=3) if max(map(abs, xyz)) == 2], dtype=np.float64)
    units = steps / np.linalg.norm(steps, axis=1)[:, None]
    share = float(np.min(-ConvexHull(units).equations[:, _SOLID]))
    return units, share - HELD
