"""Pairs of marks on two links, judged together: pairs that may meet, with their contacts, and pairs proven apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pinbound.annotations import Mark
from pinbound.contact import contact_distance
from pinbound.coverage.poses import Poses
from pinbound.coverage.reach import Reach, least_separation
from pinbound.evaluate import separation
from pinbound.exceptions import UnsupportedError
from pinbound.loops.closures import place_error
from pinbound.marking.always import overlap_everywhere
from pinbound.model.coupling import Coupling
from pinbound.path.relative import RelativePath, relative_path
from pinbound.robot.robot import Robot
from pinbound.tolerances import FOLDING, NEVER_MEETS, UNIT_ROUNDOFF
from pinbound.typing import Array, Flags

__all__ = ["Links", "Pair"]


@dataclass(frozen=True, eq=False)
class Pair:
    """Two marks that may meet, and the candidates (N,) at which they are in contact.

    `always` is the overlap that they are proven to have in every configuration [m]; None if that is not proven.
    """

    a: Mark
    b: Mark
    contact: Flags
    always: float | None = None


class Links:
    """Two links, and the joints between them. No other joint changes a distance."""

    def __init__(self, robot: Robot, link_a: str, link_b: str, Q: Array, poses: Poses) -> None:
        """Take two links of one robot, and all configurations (N, n) with the placements of links there."""
        self.robot, self.poses = robot, poses
        between = robot.tree.path_between(link_a, link_b)
        self.joints, self.length = len(between), sum(float(np.linalg.norm(joint.translation)) for joint in between)
        joints = [joint.name for joint in between if joint.moves]
        whole = robot.coupling
        rows = [whole.places[name] for name in joints]
        used = np.flatnonzero(np.any(whole.S[rows], axis=0))
        names = tuple(whole.coordinates[index] for index in used.tolist())
        self.coupling = Coupling(names, tuple(joints), whole.S[rows][:, used], whole.offset[rows])
        self.rows: Array = Q[:, used]
        self.is_exact = not any(closure.deviations for closure in robot.closures)
        self.reach = Reach(robot.tree, self.coupling, link_a, link_b)

    def judged(self, marks_a: Sequence[Mark], marks_b: Sequence[Mark]) -> dict[tuple[Mark, Mark], Pair | float]:
        """Return for each pair a `Pair`, or how far it is proven to stay apart [m].

        The chain between the links is reduced once, and proves most of the separate pairs apart. The distances of two
        points at the samples are those of the marks. If the balls about two marks are apart at all samples, so are the
        marks. In both cases the pair needs no path of its own, unless its path could prove more.
        """
        a_few, b_few = ([mark.shape.is_point for mark in marks] for marks in (marks_a, marks_b))
        tolerance = self.robot.annotations.contact_tolerance
        radii_a, radii_b = (np.array([mark.shape.radius for mark in marks]) for marks in (marks_a, marks_b))
        radii = radii_a[:, None] + radii_b
        within = np.maximum(radii, tolerance) - radii  # contact distance without radii (no mark is a plane)
        length = self.length + sum(max(mark.shape.reach for mark in marks) for marks in (marks_a, marks_b))
        spare = self.reach.gaps(marks_a, marks_b) - within - self._rounding(length)
        deep = self.poses.gaps(marks_a, marks_b) - within[:, :, None]
        margin = NEVER_MEETS * max(1.0, self.robot.tree.length, length)
        meets, clear = np.min(deep, axis=2) < -margin, np.min(deep, axis=2) > margin
        told = clear | (np.array(a_few)[:, None] & np.array(b_few) & np.all(np.abs(deep) > margin, axis=2))
        told &= self.is_exact & (meets | self.reach.is_all(marks_a, marks_b))
        apart = self.is_exact & (spare > 0.0)
        found: dict[tuple[Mark, Mark], Pair | float] = {}
        for i, a in enumerate(marks_a):
            for j, b in enumerate(marks_b):
                if apart[i, j]:
                    found[a, b] = float(spare[i, j])
                elif told[i, j]:
                    contact = deep[i, j] < 0.0
                    found[a, b] = Pair(a, b, contact, self._always(a, b, contact))
                else:
                    found[a, b] = self._judged(a, b)
        return found

    def _rounding(self, length: float) -> float:
        """Return the largest error [m] that the reduction of a path of this length can have made."""
        return FOLDING * UNIT_ROUNDOFF * (self.joints + 2) ** 2 * length

    def _judged(self, a: Mark, b: Mark) -> Pair | float:
        """Return the result for two marks from their own path."""
        robot = self.robot
        with np.errstate(over="ignore", invalid="ignore"):
            path = relative_path(robot.tree, self.coupling, a, b)
            radii = a.shape.radius + b.shape.radius
            distance = contact_distance(path, radii, robot.annotations.contact_tolerance)
            off = place_error(robot.tree, robot.coupling, robot.linear_limits, robot.closures, a, b)
            found = self._separations(path, a, b, distance)
            contact = found <= distance
            if not np.any(contact):  # a number that is not finite is no contact here; an error below reports it
                spare = least_separation(path, distance) - (distance + off + self._rounding(path.minimal.scale))
                if spare > 0.0:  # false for a number that is not finite, which proves nothing
                    return spare
        if not np.all(np.isfinite(found)):
            raise UnsupportedError(
                f"the distance of {a.name!r} and {b.name!r} is not a finite number; give all lengths in metres"
            )
        return Pair(a, b, contact, None if off else self._always(a, b, contact))

    def _always(self, a: Mark, b: Mark, contact: Flags) -> float | None:
        return overlap_everywhere(self.robot.tree, self.coupling, a, b) if np.all(contact) else None

    def _separations(self, path: RelativePath, a: Mark, b: Mark, distance: float) -> Array:
        """Return separations (N,) [m]; if balls about both marks are apart, a lower bound that is above contact.

        Placements of links are computed once for all pairs, and distances from them. For rows that rounding could
        change, the path computes the separation, with the same result as the boundary has later.
        """
        balls = self.poses.gaps([a], [b])[0, 0]
        radii = a.shape.radius + b.shape.radius
        doubt = NEVER_MEETS * (1.0 + self.robot.tree.length + a.shape.reach + b.shape.reach)
        found, rows = balls + radii, np.flatnonzero(~(balls > distance - radii + doubt))
        if len(rows) and not (a.shape.is_unbounded or b.shape.is_unbounded):
            found[rows] = self.poses.distances(a, b, rows)
            rows = rows[~(np.abs(found[rows] - distance) > doubt)]
        if len(rows):
            found[rows] = separation.separations(path, self.rows[rows])
        return found
