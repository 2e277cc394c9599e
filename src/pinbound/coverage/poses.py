"""Where links are at a few configurations: what is seen to come near there needs no proof that it never meets."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pinbound.annotations import Mark
from pinbound.evaluate.closest import nearest, nearest_of_hulls
from pinbound.geometry.rotations import rotation_matrices
from pinbound.model.coupling import Coupling
from pinbound.model.tree import Tree
from pinbound.typing import Array, Ints

__all__ = ["Poses"]

_COUNT = 64


class Poses:
    """Placements of all links at configurations, random ones if none are given; free joints stand still."""

    def __init__(self, tree: Tree, coupling: Coupling, Q: Array | None = None) -> None:
        """Place every link; random configurations are the same each time."""
        if Q is None:
            Q = np.random.default_rng(0).uniform(-np.pi, np.pi, (_COUNT, len(coupling.coordinates)))
        count = len(Q)
        theta = dict(zip(coupling.joints, coupling.expand(Q).T, strict=True))
        self._placed: dict[str, tuple[Array, Array]] = {}
        for link, joint, _ in tree.walk():
            if joint is None:
                self._placed[link.name] = np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 3))
                continue
            rotation, translation = self._placed[joint.parent]
            translation = translation + rotation @ joint.translation
            rotation = rotation @ joint.rotation
            if joint.type == "prismatic":
                translation = translation + (rotation @ joint.axis) * theta[joint.name][:, None]
            elif joint.moves:
                rotation = rotation @ rotation_matrices(joint.axis, theta[joint.name])
            self._placed[link.name] = rotation, translation
        self._balls: dict[str, tuple[Array, Array]] = {}
        self._centres: dict[Mark, Array] = {}

    def gaps(self, marks_a: Sequence[Mark], marks_b: Sequence[Mark]) -> Array:
        """Return the gaps (len(marks_a), len(marks_b), N) between the balls about marks [m].

        They are lower bounds of the marks' own gaps, and for points these themselves.
        """
        a, b = (np.array([self._centre(mark) for mark in marks]) for marks in (marks_a, marks_b))
        wide = [np.array([mark.shape.radius + mark.shape.around for mark in marks]) for marks in (marks_a, marks_b)]
        apart = a[:, None] - b
        found = np.sqrt(np.einsum("abnk,abnk->abn", apart, apart))
        found -= (wide[0][:, None] + wide[1])[:, :, None]
        return found

    def distances(self, a: Mark, b: Mark, rows: Ints) -> Array:
        """Return the distances (N,) of two marks that have ends [m] at some configurations, their radii left out."""
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
        rotation, translation = (part[rows] for part in self._placed[mark.link])
        return rotation @ mark.shape.origin + translation, np.einsum("nij,kj->kni", rotation, mark.shape.directions)

    def _centre(self, mark: Mark) -> Array:
        if mark not in self._centres:
            rotation, translation = self._placed[mark.link]
            self._centres[mark] = rotation @ mark.shape.middle + translation
        return self._centres[mark]

    def come_near(self, link_a: str, marks_a: Sequence[Mark], link_b: str, marks_b: Sequence[Mark]) -> bool:
        """Return whether somewhere the balls about two marks, as wide as their half edges end to end, overlap."""
        (x, thick), (y, wide) = self._around(link_a, marks_a), self._around(link_b, marks_b)
        limit = thick[:, None] + wide
        return any(bool(np.any(np.linalg.norm(a[:, None] - b, axis=2) <= limit)) for a, b in zip(x, y, strict=True))

    def _around(self, link: str, marks: Sequence[Mark]) -> tuple[Array, Array]:
        if link not in self._balls:
            shapes = [mark.shape for mark in marks]
            centres, radii = np.array([s.middle for s in shapes]), [s.radius + s.half_edges for s in shapes]
            rotation, translation = self._placed[link]
            self._balls[link] = np.einsum("nij,mj->nmi", rotation, centres) + translation[:, None], np.array(radii)
        return self._balls[link]
