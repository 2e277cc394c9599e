"""Placements of links at a few configurations, to see which marks come near each other.

For these marks, no proof that they never meet is tried.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

from pinbound.annotations import Mark
from pinbound.evaluate.closest import nearest, nearest_of_hulls
from pinbound.geometry.rotations import rotation_matrices
from pinbound.model.coupling import Coupling
from pinbound.model.tree import Tree
from pinbound.typing import Array, Ints

__all__ = ["Poses"]

_K = TypeVar("_K")
_V = TypeVar("_V")

_COUNT = 64

_BYTES, _FEWEST = 1 << 27, 16
"""The memory for the placements that are kept, and the smallest number of links: links examined together are near in
the tree."""


class Poses:
    """Placements of all links at configurations (random ones if none are given); free joints do not move."""

    def __init__(self, tree: Tree, coupling: Coupling, Q: Array | None = None) -> None:
        """Place every link; the random configurations are the same each time."""
        if Q is None:
            Q = np.random.default_rng(0).uniform(-np.pi, np.pi, (_COUNT, len(coupling.coordinates)))
        self._tree, self._count = tree, len(Q)
        self._theta = dict(zip(coupling.joints, coupling.expand(Q).T, strict=True))
        self._most = max(_FEWEST, _BYTES // (8 * 12 * max(1, len(Q))))  # links whose placements are kept
        self._placed: dict[str, tuple[Array, Array]] = {}
        self._balls: dict[str, tuple[Array, Array]] = {}
        self._centres: dict[Mark, Array] = {}

    def _place(self, link: str) -> tuple[Array, Array]:
        """Return a link's rotations (N, 3, 3) and positions (N, 3) in the root's frame, from the next known link."""
        missing: list[str] = []
        while link not in self._placed and link in self._tree.parent_joint:
            missing.append(link)
            link = self._tree.parent_joint[link].parent
        found = self._placed.get(link)
        if found is None:
            found = np.tile(np.eye(3), (self._count, 1, 1)), np.zeros((self._count, 3))
        for name in reversed(missing):
            joint, (rotation, translation) = self._tree.parent_joint[name], found
            translation = translation + rotation @ joint.translation
            rotation = rotation @ joint.rotation
            if joint.type == "prismatic":
                translation = translation + (rotation @ joint.axis) * self._theta[joint.name][:, None]
            elif joint.moves:
                rotation = rotation @ rotation_matrices(joint.axis, self._theta[joint.name])
            found = rotation, translation
            _keep(self._placed, name, found, self._most)
        return found

    def gaps(self, marks_a: Sequence[Mark], marks_b: Sequence[Mark]) -> Array:
        """Return the gaps (len(marks_a), len(marks_b), N) between the balls about marks [m].

        They are lower bounds of the gaps of the marks; for points they are equal to them.
        """
        a, b = (np.array([self._centre(mark) for mark in marks]) for marks in (marks_a, marks_b))
        wide = [np.array([mark.shape.radius + mark.shape.around for mark in marks]) for marks in (marks_a, marks_b)]
        apart = a[:, None] - b
        found = np.sqrt(np.einsum("abnk,abnk->abn", apart, apart))
        found -= (wide[0][:, None] + wide[1])[:, :, None]
        return found

    def distances(self, a: Mark, b: Mark, rows: Ints) -> Array:
        """Return the distances (N,) of two marks that have ends, at some configurations, without their radii [m]."""
        w, edges = self._ends(a, rows)
        other, more = self._ends(b, rows)
        w, edges = w - other, np.concatenate((edges, -more))
        if a.shape.is_zonotope and b.shape.is_zonotope:
            t = nearest(w, edges)
        else:
            t = nearest_of_hulls(w, edges, (a.shape.corners, b.shape.corners))
        return np.linalg.norm(w + np.einsum("nk,kni->ni", t, edges), axis=1)

    def _ends(self, mark: Mark, rows: Ints) -> tuple[Array, Array]:
        """Return a mark's origin (N, 3) and directions (k, N, 3) in the root's frame."""
        rotation, translation = (part[rows] for part in self._place(mark.link))
        return rotation @ mark.shape.origin + translation, np.einsum("nij,kj->kni", rotation, mark.shape.directions)

    def _centre(self, mark: Mark) -> Array:
        found = self._centres.get(mark)
        if found is None:
            rotation, translation = self._place(mark.link)
            found = rotation @ mark.shape.middle + translation
            _keep(self._centres, mark, found, 4 * self._most)
        return found

    def come_near(self, link_a: str, marks_a: Sequence[Mark], link_b: str, marks_b: Sequence[Mark]) -> bool:
        """Return whether at some configuration the balls about two marks, with radii from half their edges, overlap."""
        (x, thick), (y, wide) = self._around(link_a, marks_a), self._around(link_b, marks_b)
        limit = thick[:, None] + wide
        return any(bool(np.any(np.linalg.norm(a[:, None] - b, axis=2) <= limit)) for a, b in zip(x, y, strict=True))

    def _around(self, link: str, marks: Sequence[Mark]) -> tuple[Array, Array]:
        if link not in self._balls:
            shapes = [mark.shape for mark in marks]
            centres, radii = np.array([s.middle for s in shapes]), [s.radius + s.half_edges for s in shapes]
            rotation, translation = self._place(link)
            self._balls[link] = np.einsum("nij,mj->nmi", rotation, centres) + translation[:, None], np.array(radii)
        return self._balls[link]


def _keep(kept: dict[_K, _V], key: _K, value: _V, most: int) -> None:
    """Keep a value, and drop the oldest one if there are more than `most`."""
    kept[key] = value
    while len(kept) > most:
        del kept[next(iter(kept))]
