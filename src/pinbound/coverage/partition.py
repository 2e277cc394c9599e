"""One mesh in parts. Each part is a share of the surface with a mark; parts are cut in two, and joined again.

All of this only proposes. `mesh_proof` and `excess` prove properties of the marks. During the search, the excess of a
part is an estimate; after `measure` it is a bound.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pinbound.annotations import Mark
from pinbound.coverage.excess import UNKNOWN, Excess, excess_of, guess_of
from pinbound.coverage.mesh_proof import away_from
from pinbound.coverage.near import Near
from pinbound.coverage.parts import FITS, Fit, outline
from pinbound.coverage.planes import best_cut
from pinbound.coverage.solids import Group, group_of
from pinbound.coverage.surfaces import Surface, surface_of
from pinbound.meshes import Mesh
from pinbound.tolerances import FEELER, HELD, SAME_BODY
from pinbound.values import Value

__all__ = ["Joint", "Part", "Partition"]

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

_SIMPLER = 0.1  # of the accuracy: the error that fewer vertices may make, and the width of pockets that count as filled
_FINER = 0.01  # of the accuracy: the error that fewer vertices may make, if there are several parts


@dataclass(frozen=True, eq=False)
class Part(Value):
    """A share of a mesh's surface, its mark, a surface around the mark, and its excess.

    Attributes:
        group: The share.
        mark: The mark.
        surface: The surface whose excess is bounded; it holds the mark.
        excess: How far it sticks out.
        is_guess: Whether `excess` is an estimate, not a bound.
    """

    group: Group
    mark: Mark
    surface: Surface
    excess: Excess = UNKNOWN
    is_guess: bool = True


@dataclass(frozen=True, eq=False)
class Joint(Value):
    """Two parts of a partition that may be joined.

    Attributes:
        pair: Their shares of the surface.
        excess: [m], an estimate of how far the joined part sticks out.
    """

    pair: tuple[Group, Group]
    excess: float


class Partition:
    """One mesh while its cover is made.

    Attributes:
        parts: Its parts.
        around: [m], the radius of the ball about all parts.
    """

    def __init__(self, name: str, link: str, mesh: Mesh, fit: Fit, accuracy: float) -> None:
        """Make the whole mesh one part."""
        self.name, self.link, self.mesh, self.accuracy = name, link, mesh, accuracy
        self.fit: Fit = fit
        self.near = Near(mesh)
        self.around, self.stuck = 0.0, False
        self.parts: list[Part] = [self._part(group_of(mesh), alone=True)]
        self._known: dict[tuple[Group, Group], float] = {}
        self._guess(range(1))

    def _part(self, group: Group, alone: bool = False, budget: float = _SIMPLER) -> Part:
        mark = FITS[self.fit](self.name, self.link, _points(group.triangles), budget * self.accuracy)
        return Part(group, mark, self._surface(mark, group, alone))

    def _surface(self, mark: Mark, group: Group, alone: bool) -> Surface:
        """Return the surface of a part, which holds its mark.

        If there are other parts, it has more vertices than the mark. The reason: surface between two parts is proven to
        be inside them only if the gap between their hulls is narrower than the ball about all parts.
        """
        vertices, radius = outline(mark)
        if not alone and self.fit == "hulls" and radius > 0.0:
            fine = FITS["hulls"](self.name, self.link, _points(group.triangles), _FINER * self.accuracy).shape
            vertices, radius = fine.vertices, radius + fine.radius
        return surface_of(vertices, radius)

    def _wide(self, surfaces: Sequence[Surface]) -> float:
        """Return the radius of the ball about parts with these surfaces [m]."""
        around = max(one.radius + one.slack for one in surfaces)
        return around if len(surfaces) == 1 else max(around + FEELER, _SIMPLER * self.accuracy)

    def _place(self) -> None:
        """Set the radius of the ball about all parts; if it changes, the excess of every part is unknown again."""
        around = self._wide(self.surfaces)
        if around != self.around:
            self.around, self.parts = around, [replace(one, is_guess=True) for one in self.parts]

    @property
    def surfaces(self) -> list[Surface]:
        """The surfaces of its parts."""
        return [one.surface for one in self.parts]

    def _guess(self, asked: Sequence[int]) -> None:
        """Estimate the excess of some parts. This proves nothing: it only says where to cut."""
        self._place()
        surfaces = self.surfaces
        for part in asked:
            excess = guess_of(surfaces, part, self.near, self.around)
            self.parts[part] = replace(self.parts[part], excess=excess, is_guess=True)

    def measure(self) -> None:
        """Bound the excess of all parts for which there is only an estimate."""
        self._place()
        asked = [place for place, one in enumerate(self.parts) if one.is_guess]
        found = excess_of(self.surfaces, self.near, self.around, self.accuracy, asked)
        for place, one in zip(asked, found, strict=True):
            self.parts[place] = replace(self.parts[place], excess=one, is_guess=False)

    @property
    def bound(self) -> float:
        """The largest excess of its parts [m]."""
        return max(one.excess.bound for one in self.parts)

    @property
    def can_be_cut(self) -> bool:
        """Whether a part sticks out further than the accuracy, and the last search for a cut found one."""
        return self.bound > self.accuracy and not self.stuck

    def cut(self) -> None:
        """Cut the part that sticks out furthest, by the plane that leaves the best hulls."""
        worst = self.parts[int(np.argmax([one.excess.bound for one in self.parts]))]
        sides = best_cut(worst.group, worst.excess.place, self.accuracy, self.near)
        if sides is None:
            self.stuck = True
            return
        kept = [side for side in sides if side.has_surface or self.near.is_inside(side.triangles.mean(axis=(0, 1)))]
        before = self.bound
        self._change([worst], [self._part(side) for side in kept])
        self.stuck = len(kept) < len(sides) and self.bound >= before

    def _change(self, old: Sequence[Part], new: Sequence[Part]) -> None:
        """Replace parts by others, and estimate the excess of the new parts and their neighbours."""
        self._replace(old, new)
        count = len(self.parts) - len(new)
        touched = [i for i in range(count) if any(_meet(self.parts[i].surface, gone.surface) for gone in old)]
        self._guess([*touched, *range(count, len(self.parts))])

    def _replace(self, old: Sequence[Part], new: Sequence[Part]) -> None:
        """Replace parts by others. The excess of their neighbours becomes an estimate: it may have changed."""
        kept = [one for one in self.parts if all(one is not gone for gone in old)]
        near = [any(_meet(one.surface, gone.surface, 2.0 * self.around) for gone in old) for one in kept]
        self.parts = [replace(one, is_guess=True) if flag else one for one, flag in zip(kept, near, strict=True)]
        self.parts += new
        self.stuck = False

    def joints(self, most: float) -> list[Joint]:
        """Return pairs of adjacent parts whose joined part sticks out by at most `most` [m], the best first."""
        known, self._known = self._known, {}
        for place, one in enumerate(self.parts):
            for two in self.parts[place + 1 :]:
                if self._are_beside(one, two):
                    pair = one.group, two.group
                    self._known[pair] = known[pair] if pair in known else self._together(one, two)
        found = [Joint(pair, excess) for pair, excess in self._known.items() if excess <= most]
        return sorted(found, key=lambda joint: joint.excess)

    def _are_beside(self, one: Part, two: Part) -> bool:
        """Return whether a vertex of one part is near the other part: an estimate."""
        margin = 2.0 * self.around
        if not _meet(one.surface, two.surface, margin):
            return False
        for part, other in ((one, two), (two, one)):
            polytope = part.surface.polytope
            vertices = other.mark.shape.vertices
            if polytope is None or np.any(polytope.heights(vertices).max(axis=1) <= margin):
                return True
        return False

    def _together(self, one: Part, two: Part) -> float:
        """Return an estimate of how far two parts stick out when joined [m]."""
        alone = len(self.parts) == 2
        if self.fit == "hulls":
            radius = max(one.surface.radius, two.surface.radius)
            surface = surface_of(np.concatenate((_outer(one), _outer(two))), radius)
        else:
            surface = self._part(one.group.joined(two.group), alone).surface
        surfaces = [surface, *(rest.surface for rest in self.parts if rest is not one and rest is not two)]
        return guess_of(surfaces, 0, self.near, self._wide(surfaces)).bound

    def join(self, joint: Joint, limit: float) -> bool:
        """Replace two parts by the joined part; if it may stick out further than `limit`, keep them and return False.

        Args:
            joint: The two.
            limit: [m]; if it is finite, a bound must confirm it, not an estimate.
        """
        before = self.parts
        old = [one for one in before if one.group in joint.pair]
        new = self._part(old[0].group.joined(old[1].group), len(before) == 2)
        if not np.isfinite(limit):
            self._change(old, [new])
            return True
        self._replace(old, [new])
        self._place()
        (excess,) = excess_of(self.surfaces, self.near, self.around, self.accuracy, [len(before) - 2])
        if excess.bound <= limit:
            self.parts[-1] = replace(new, excess=excess, is_guess=False)
            return True
        self.restore(before)
        self._known[joint.pair] = np.inf
        return False

    def restore(self, parts: list[Part]) -> None:
        """Restore parts that it had before."""
        self.parts, self.around = parts, self._wide([one.surface for one in parts])

    def take_in(self, pieces: Sequence[Array]) -> None:
        """Let parts hold more convex polygons, corners (k, 3); each goes to the part that is nearest to all of it.

        If a polygon is outside a hull only by rounding, the mark gets a larger radius. New corners so near to others
        would not help, because the triangles between them have no normals.
        """
        more: list[list[Array]] = [[] for _ in self.parts]
        wider = np.zeros(len(self.parts))
        for piece in pieces:
            away = [float(away_from(one.mark.shape, piece).max()) for one in self.parts]
            place = int(np.argmin(np.array(away) - [one.mark.shape.radius for one in self.parts]))
            mark = self.parts[place].mark
            if self.fit == "hulls" and away[place] - mark.shape.radius <= SAME_BODY:
                wider[place] = max(wider[place], away[place] + 2.0 * HELD - mark.shape.radius)
            else:
                fan = np.stack((np.repeat(piece[:1], len(piece) - 2, axis=0), piece[1:-1], piece[2:]), axis=1)
                more[place].append(fan)
        alone = len(self.parts) == 1
        for place, (old, fans, by) in enumerate(zip(self.parts, more, wider.tolist(), strict=True)):
            if fans:
                self.parts[place] = self._part(old.group.with_more(np.concatenate(fans)), alone, 0.0)
            elif by > 0.0:
                hull: Any = old.mark
                mark: Mark = replace(hull, radius=hull.radius + by)
                surface = replace(old.surface, radius=old.surface.radius + by)
                self.parts[place] = replace(old, mark=mark, surface=surface)
        self.parts = [replace(one, is_guess=True) for one in self.parts]


def _meet(one: Surface, two: Surface, margin: float = 0.0) -> bool:
    return bool(np.all((one.low <= two.high + margin) & (two.low <= one.high + margin)))


def _outer(part: Part) -> Array:
    """Return the vertices of a part."""
    polytope = part.surface.polytope
    return part.mark.shape.vertices if polytope is None else polytope.vertices


def _points(group: Array) -> Array:
    return np.unique(group.reshape(-1, 3), axis=0)
