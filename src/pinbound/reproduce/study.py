"""Results that all figures, tables and errata of the reproduction use, computed once from the robot."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import cached_property
from typing import Any, cast

import numpy as np

from pinbound.boundaries.boundary import ContactAngle
from pinbound.exceptions import UnsupportedError
from pinbound.motion.inverse_kinematics import InverseKinematics, solve_ik
from pinbound.region import Region, feasible_region
from pinbound.region.membership import Membership, classify, region_membership
from pinbound.region.swept import SweptBody, swept_body
from pinbound.region.workspace import Section, workspace_section
from pinbound.reproduce.printed import BOUNDARIES, RECURSION, Constants, constants
from pinbound.robot.robot import Robot
from pinbound.tolerances import AS_PRINTED
from pinbound.typing import Array, Flags, Ints
from pinbound.values import Value

__all__ = ["FACTOR", "SAMPLES", "SEED", "TOOL", "Study", "ToolPath"]

TOOL = "link_6"
TURN = "q1"
PLANE = ("q2", "q3")
FACTOR = 0.9  # the paper scales about the centroid, by a factor that it does not print
SEED, SAMPLES = 404, 90_000
_BEYOND = np.radians(12.0)  # distance to which the tool path intentionally goes outside an edge
_LEG = 60
_GRID = 221


@dataclass(frozen=True, eq=False)
class ToolPath(Value):
    """The tool path, which is defined in the workspace, and its inverse kinematics.

    Attributes:
        share: (N,) length along the path, divided by the whole length.
        targets: (N, 3) tool points [m].
        solution: Inverse kinematics of all targets; each search starts from the solution before.
        membership: Membership in the scaled region, as in the paper.
        place: (N,) `Place` relative to the scaled region.
        in_region: (N,) signed distance [rad] to the contour of the unscaled region.
        corners: (k,) shares at which legs of the path meet.
    """

    share: Array
    targets: Array
    solution: InverseKinematics
    membership: Membership
    place: Ints
    in_region: Array
    corners: Ints


@dataclass(frozen=True)
class Study:
    """The paper's robot, and the results that are computed from it."""

    robot: Robot

    def __post_init__(self) -> None:
        """Refuse a robot that is not the paper's.

        Raises:
            UnsupportedError: If it lacks coordinates, links or boundaries of the paper's robot, or one of
                these boundaries has no contact angle.
        """
        links = {link for one in RECURSION for link in one[:2]}
        missing = [name for name in ("q1", "q2", "q3") if name not in self.robot.coordinates]
        missing += sorted(links - set(self.robot.tree.links))
        missing += [one.name for one in BOUNDARIES if one.name not in self.robot.boundaries.names]
        if missing:
            raise UnsupportedError(
                f"{self.robot.name!r} is not the paper's robot: it has no {', '.join(missing)}; "
                "reproduce needs minervabot_v3, or a copy of it"
            )
        for one in BOUNDARIES:
            self.contact(one.name)

    def contact(self, name: str) -> ContactAngle:
        """Return the contact angle of a boundary.

        Raises:
            UnsupportedError: If it has none, because it has several effective angles or is never in contact.
        """
        contact = self.robot.boundaries[name].contact
        if contact is None or contact.half_width is None:
            found = self.robot.boundaries[name]
            why = (
                "it turns by more than one effective angle"
                if contact is None
                else (
                    f"{found.point_a.name} and {found.point_b.name} miss each other by {1e3 * contact.smallest:.3g} mm"
                )
            )
            remedy = "mend the two points" if contact is None else 'if it is a stop, declare it: stop="true"'
            raise UnsupportedError(
                f"{name!r} of {self.robot.name!r} has no contact angle, for {why}; the paper's has one: {remedy}"
            )
        return contact

    @cached_property
    def changes(self) -> tuple[str, ...]:
        """One sentence for each marked point at another position than the paper prints; none for the paper's robot."""
        found: dict[str, str] = {}
        for one in BOUNDARIES:
            boundary = self.robot.boundaries[one.name]
            for mark, (frame, number) in zip((boundary.point_a, boundary.point_b), one.points, strict=True):
                printed = [self.constants.get(f"{axis}_{frame},{number}") for axis in "xz"]
                x, _, z = (1e3 * value for value in mark.shape.origin.tolist())
                if any(p is not None and abs(p - v) > AS_PRINTED for p, v in zip(printed, (x, z), strict=True)):
                    text = f"{mark.name} at ({x:.6g}, {z:.6g}) mm, printed ({printed[0]:.6g}, {printed[1]:.6g})"
                    found[mark.name] = text
        return tuple(found.values())

    @cached_property
    def region(self) -> Region:
        """The feasible region of (q2, q3)."""
        return feasible_region(self.robot, PLANE)

    @cached_property
    def scaled(self) -> Region:
        """The region scaled about its centroid."""
        return self.region.scale(FACTOR)

    @cached_property
    def section(self) -> Section:
        """The positions that the tool can have, in the plane that q1 rotates."""
        return workspace_section(self.robot, self.region, TOOL, turn=TURN)

    @cached_property
    def scaled_section(self) -> Section:
        """The section of the scaled region."""
        return workspace_section(self.robot, self.scaled, TOOL, turn=TURN)

    @cached_property
    def body(self) -> SweptBody:
        """The body that the section sweeps between the limits of q1."""
        return swept_body(self.robot, self.section)

    @cached_property
    def scaled_body(self) -> SweptBody:
        """The body that the scaled section sweeps."""
        return swept_body(self.robot, self.scaled_section)

    @cached_property
    def pivot(self) -> tuple[float, float]:
        """r_1,27 (x, z) [mm], the assumed pivot of the orientation rod."""
        zero = np.zeros(len(self.robot.coordinates))
        offset = 1e3 * (self.robot.positions("link_27", zero) - self.robot.positions("link_1", zero))
        return float(offset[0]), float(offset[2])

    @cached_property
    def constants(self) -> Constants:
        """The printed lengths [mm] with the assumed pivot."""
        return constants(self.pivot)

    def configurations(self, X: Array) -> Array:
        """Return q (N, n) for points (N, 2) of the plane; the other coordinates are at home."""
        Q = np.repeat(self.robot.home[None], len(X), axis=0)
        Q[:, [self.robot.coordinates.index(name) for name in PLANE]] = X
        return Q

    def contour(self, region: Region, per_edge: int = 150) -> tuple[Array, Array, Array]:
        """Return shares (N,) of the contour's length, its points (N, 2) [rad], and the shares at vertices (k + 1,)."""
        s = np.arange(per_edge) / per_edge
        pieces = [edge.start + s[:, None] * (edge.end - edge.start) for edge in region.edges]
        X = np.vstack((*pieces, region.vertices[:1]))
        lengths = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(X, axis=0), axis=1))))
        return lengths / lengths[-1], X, (lengths / lengths[-1])[::per_edge]

    @cached_property
    def samples(self) -> tuple[Array, Array, Flags]:
        """90,000 points (N, 2) in [-2 pi, 2 pi]^2, their norms (N, m) [m], and whether they are in the region (N,)."""
        X = np.random.default_rng(SEED).uniform(-2 * np.pi, 2 * np.pi, (SAMPLES, 2))
        Q = self.configurations(X)
        return X, self.robot.boundaries.norms(Q), np.asarray(self.region.contains(Q))

    @cached_property
    def summed_norms(self) -> tuple[Array, Array, Array, Flags]:
        """A grid of q2, q3 [rad], the interpolated sum of normalised norms, and which grid points are in the region."""
        from scipy import interpolate

        X, norms, _ = self.samples
        total = np.sum(norms / norms.max(axis=0), axis=1)
        ticks = np.linspace(-2 * np.pi, 2 * np.pi, _GRID)
        q2, q3 = np.meshgrid(ticks, ticks)
        height: Array = cast(Any, interpolate).LinearNDInterpolator(X, total)(q2, q3)
        inside = self.region.contains(self.configurations(np.column_stack((q2.ravel(), q3.ravel()))))
        return q2, q3, height, np.asarray(inside).reshape(q2.shape)

    @cached_property
    def path(self) -> ToolPath:
        """The tool path: inside, intentionally beyond two edges of the region, and along one edge of the scaled region.

        The path is defined in the workspace. Legs are straight in the plane that q1 rotates, while the azimuth goes
        to +-100 degrees. The leg along an edge is the image of this edge. Outer points lie 12 degrees beyond the middle
        of two edges: the longest one, and the longest slanted one, beyond which Eq. (21) does not detect that q is
        outside.
        """
        ranked = sorted(range(len(self.region.edges)), key=lambda i: -_length(self.region, i))
        slanted = [i for i in ranked if np.all(np.abs(self.region.edges[i].end - self.region.edges[i].start) > _BEYOND)]
        first = ranked[0]
        second = next((i for i in slanted if i != first), ranked[1])
        along = next(i for i in ranked if i not in (first, second))
        centre = self.region.centroid
        edge = self.scaled.edges[along]
        inner = centre + 0.5 * (edge.start - centre)
        stops = [centre, _beyond(self.region, first), inner, edge.start, edge.end, _beyond(self.region, second), centre]
        flat = self.section.image(np.array(stops))
        s = np.arange(_LEG)[:, None] / _LEG
        legs = [a + s * (b - a) for a, b in itertools.pairwise(flat)]
        legs[3] = self.section.image(edge.start + s * (edge.end - edge.start))
        plane = np.vstack((*legs, flat[-1:]))
        t = np.linspace(0.0, 1.0, len(plane))
        azimuth = np.radians(100.0) * np.sin(2 * np.pi * t)
        targets = np.column_stack((plane[:, 0] * np.cos(azimuth), plane[:, 0] * np.sin(azimuth), plane[:, 1]))
        start = self.configurations(centre[None])[0]
        solution = solve_ik(self.robot, TOOL, targets, start=start, restarts=0)
        steps = np.linalg.norm(np.diff(targets, axis=0), axis=1)
        found = region_membership(self.robot, self.scaled, solution.q)
        return ToolPath(
            share=np.concatenate(([0.0], np.cumsum(steps))) / float(np.sum(steps)),
            targets=targets,
            solution=solution,
            membership=found,
            place=classify(found.signed_distance),
            in_region=np.asarray(self.region.signed_distance(solution.q)),
            corners=np.arange(1, len(stops) - 1) * _LEG,
        )


def _length(region: Region, index: int) -> float:
    edge = region.edges[index]
    return float(np.linalg.norm(edge.end - edge.start))


def _beyond(region: Region, index: int) -> Array:
    """Return a point outside the region, beside the middle of an edge; the region lies to the left of start -> end."""
    edge = region.edges[index]
    along = (edge.end - edge.start) / _length(region, index)
    return (edge.start + edge.end) / 2 + _BEYOND * np.array([along[1], -along[0]])
