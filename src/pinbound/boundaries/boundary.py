"""A boundary: distances, gradients, contacts and limits of two marks, computed from their relative path."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from pinbound.annotations import Mark
from pinbound.boundaries.spans import ContactAngle, checked_window
from pinbound.contact import ContactRule
from pinbound.evaluate import depth, separation
from pinbound.evaluate.depth import Penetration
from pinbound.exceptions import DimensionError, UnknownNameError, UnsupportedError
from pinbound.limits import outwards, univariate
from pinbound.model.coupling import as_configurations, coordinate_index, linear_text
from pinbound.path.kind import Kind
from pinbound.path.relative import RelativePath
from pinbound.tolerances import ROOT
from pinbound.typing import Array, Flags
from pinbound.values import Value

__all__ = ["Boundary", "ContactAngle", "Penetration", "checked_window", "one_configuration"]


@dataclass(frozen=True, eq=False)
class Boundary(Value):
    """Two marks that must keep a distance: `signed_clearance(q) > 0`.

    The norm is the distance between the two marks without their radii. If one mark is a line, it is the distance from
    the line. If one mark is a plane, it is the signed height above the plane.

    Attributes:
        name: Its name in the annotations.
        point_a: First mark: a point, segment, line or plane.
        point_b: Second mark.
        min_distance: [m], the distance to keep between the two surfaces.
        path: The reduced relative path between the marks.
        robot_coordinates: All active coordinates of the robot, in q's order.
        contact_tolerance: [m]; a smaller separation counts as contact.
        place_error: [m], the largest difference between the norm of the true linkage and that of the coupling, within
            all joint limits. It is not zero if opposite sides of a parallelogram on the path differ
            (`docs/closures.md`).
        home: (n,) the robot's home, which decides on which side of a stop is free; None: zero.
        stop: Whether it is declared as a stop. Contact of a stop is the angle at which the two lever arms align.

    Example:
        >>> import pinbound as pb
        >>> pb.load("minervabot_v3").boundaries["beta_4"]
        <Boundary beta_4: coincident branched, o14 on link_2, o15 on link_13; depends on q2, q3>
    """

    name: str
    point_a: Mark
    point_b: Mark
    min_distance: float
    path: RelativePath
    robot_coordinates: tuple[str, ...]
    contact_tolerance: float
    place_error: float = 0.0
    home: Array | None = None
    stop: bool = False

    def __repr__(self) -> str:
        """Return name, kind, points and coordinates."""
        points = f"{self.point_a.name} on {self.point_a.link}, {self.point_b.name} on {self.point_b.link}"
        return f"<Boundary {self.name}: {self.kind.value}, {points}; depends on {', '.join(self.coordinates)}>"

    @property
    def kind(self) -> Kind:
        """How the two links are related in the tree. Helper links (no inertia, no geometry, no marks) do not count."""
        return self.path.kind

    @property
    def ancestor(self) -> str:
        """The lowest common ancestor of the two links. Helper links do not count."""
        return self.path.ancestor

    @cached_property
    def coordinates(self) -> tuple[str, ...]:
        """The active coordinates that the norm depends on."""
        return tuple(self.robot_coordinates[index] for index in self.path.minimal.coordinates)

    @property
    def threshold(self) -> float:
        """`radius_a + radius_b + min_distance` [m]."""
        return self.point_a.shape.radius + self.point_b.shape.radius + self.min_distance

    @cached_property
    def rule(self) -> ContactRule:
        """The rule that decides what contact is for this boundary. All answers of the boundary follow it."""
        home = np.zeros(len(self.robot_coordinates)) if self.home is None else self.home
        return ContactRule(self.path, self.threshold, self.contact_tolerance, home, self.stop, self.place_error)

    @property
    def contact_distance(self) -> float:
        """The largest separation that is contact [m]: the threshold; for distances, at least the contact tolerance.

        `place_error` is added. For a stop it is the separation at the contact angle: the difference of the two arm
        lengths.
        """
        return self.rule.distance

    @property
    def is_stop(self) -> bool:
        """Whether contact is the angle at which two arms align: a declared stop, or two arms of equal length."""
        return self.rule.is_stop

    @property
    def has_size(self) -> bool:
        """Whether it keeps bodies apart, and not two points of zero threshold."""
        return self.threshold > 0.0 or not self.path.is_plain

    @cached_property
    def contacts(self) -> tuple[ContactAngle, ...] | None:
        """All contact strips of a boundary of one effective angle; None if it has several angles, or a prismatic joint.

        Two points have one strip; if they never touch, its `half_width` is None. Segments may have several strips.
        """
        found = self.rule.strips()
        if found is None:
            return None
        coefficients, strips = found
        text = linear_text(coefficients, self.robot_coordinates)
        return tuple(ContactAngle(coefficients, text, s.angle, s.half_width, s.smallest, self.is_stop) for s in strips)

    @property
    def contact(self) -> ContactAngle | None:
        """The contact angle of a boundary of one effective angle; None if it has several angles, or a prismatic joint.

        For segments it is also None if there are several strips in one turn; `contacts` has them all.

        Example:
            >>> import pinbound as pb
            >>> contact = pb.load("minervabot_v3").boundaries["beta_4"].contact
            >>> contact.text, round(float(np.degrees(contact.angle)), 9)
            ('q3 - q2', 32.429119975)
        """
        return self.contacts[0] if self.contacts is not None and len(self.contacts) == 1 else None

    def vector(self, q: ArrayLike) -> Array:
        """Return `r = x_a - x_b` in the frame of the ancestor link: (3,) or (N, 3) [m]; Eqs. (8)-(16).

        For segments and bodies, r is between the nearest points; for a line or plane, from the foot of the
        perpendicular.
        """
        return self._each(q, lambda Q: separation.vectors(self.path, Q))

    def norm(self, q: ArrayLike) -> Any:
        """Return `beta = |r|` [m]: a float, or (N,). For a plane it is `n . r`, which is negative behind the plane."""
        return self._each(q, lambda Q: separation.separations(self.path, Q))

    def nearest(self, q: ArrayLike) -> Array:
        """Return the parameters t of the nearest points on the segments: (k,) or (N, k) in [0, 1], mark a first.

        The point is `x = xyz_a + t (xyz_b - xyz_a)`. If several t are equally near (parallel segments), it is one of
        them.

        Raises:
            UnsupportedError: If a mark is a hull or a cylinder, which has no such t. Use `nearest_points`.
        """
        if not self.path.difference.is_zonotope:
            raise UnsupportedError(
                f"{self.name!r} has a hull or cylinder, whose nearest point is not given by t in [0, 1]; "
                "call nearest_points(q)"
            )
        return self._each(q, lambda Q: separation.parameters(self.path, Q))

    def nearest_points(self, q: ArrayLike) -> Array:
        """Return the nearest points of both marks, (2, 3) or (N, 2, 3) [m] in the frame of the ancestor link.

        The points belong to the marks without their radii. On a line or plane, it is the foot of the perpendicular from
        the other mark's point. If several pairs are equally near (parallel edges or faces), it is one of them.

        Example:
            >>> import pinbound as pb
            >>> beta = pb.load("minervabot_v3").boundaries["beta_4"]
            >>> a, b = beta.nearest_points([0.0, 0.1, 0.2])
            >>> bool(np.allclose(a - b, beta.vector([0.0, 0.1, 0.2])))
            True
        """
        return self._each(q, lambda Q: separation.nearest_points(self.path, Q))

    def clearance(self, q: ArrayLike) -> Any:
        """Return `norm - threshold` [m]: the unsigned distance minus the threshold.

        It is positive also beyond a stop, and it does not use the contact tolerance. Use `signed_clearance` for that.
        """
        return self.norm(q) - self.threshold

    def signed_clearance(self, q: ArrayLike) -> Any:
        """Return the signed clearance: a float, or (N,) [m]. Positive is free; zero or less is contact.

        For a distance it is `norm - max(threshold, contact_tolerance)`; for a height above a plane, `norm - threshold`.
        For a stop it is `+-sqrt(norm^2 - m^2)` with the smallest norm m: positive on home's side of the contact angle,
        negative beyond it, and smooth at the angle. Region, certificate and `free` all use this number.

        Example:
            >>> import pinbound as pb
            >>> beta = pb.load("minervabot_v3").boundaries["beta_4"]
            >>> Q = np.radians([[0.0, 0.0, 30.0], [0.0, 0.0, 35.0]])
            >>> (1e3 * beta.signed_clearance(Q)).round(3).tolist(), (1e3 * beta.norm(Q)).round(3).tolist()
            ([1.417, -1.5], [1.417, 1.5])
        """
        return self._each(q, self.rule.signed)

    def signed_gradient(self, q: ArrayLike) -> Array:
        """Return the gradient of the signed clearance, (n,) or (N, n) [m/rad, or 1 for a prismatic joint].

        For a stop it is defined at contact, too. For other boundaries it is NaN where a distance is zero (a kink).
        """
        return self._each(q, self.rule.gradients)

    def gradient(self, q: ArrayLike) -> Array:
        """Return the gradient of the norm, (n,) or (N, n) [m/rad]; NaN where the norm is zero (a kink)."""
        return self._each(q, lambda Q: separation.gradients(self.path, Q))

    def hessian(self, q: ArrayLike) -> Array:
        """Return the Hessian of the norm, (n, n) or (N, n, n); NaN where the norm is zero (a kink)."""
        return self._each(q, lambda Q: separation.hessians(self.path, Q))

    def signed_distance(self, q: ArrayLike) -> Any:
        """Return the distance between the surfaces of the two bodies, or minus their depth: a float, or (N,) [m].

        If hulls overlap, `norm` is zero. The signed distance is then minus the shortest displacement that makes them
        touch. `min_distance` does not count. Certificates and contact use `signed_clearance` instead.
        """
        return self._each(q, lambda Q: depth.signed_distances(self.path, self._radii, Q))

    def signed_distance_gradient(self, q: ArrayLike) -> Array:
        """Return the gradient of the signed distance, (n,) or (N, n) [m/rad, or 1 for a prismatic joint].

        It is NaN where the direction of separation is not unique, and where a distance without depth is zero (a kink).
        """
        return self._each(q, lambda Q: depth.signed_gradients(self.path, Q))

    def penetration(self, q: ArrayLike) -> Penetration:
        """Return the depth of overlap, the direction that separates the bodies, and whether this direction is unique.

        The depth has a proven lower and upper bound, `tolerances.DEPTH` of the bodies' size apart. Shapes: depth (N,),
        direction (N, 3) in the ancestor's frame, `is_unique` (N,); for one q a float, (3,) and a bool.

        Example:
            >>> import pinbound as pb
            >>> found = pb.load("minervabot_v3").boundaries["beta_4"].penetration([0.0, 0.0, 0.0])
            >>> found.depth, found.is_unique
            (0.0, True)
        """
        Q = as_configurations(q, self.robot_coordinates)
        is_plane_first = self.point_a.shape.is_unbounded
        found = depth.penetrations(self.path, self._radii, np.atleast_2d(Q), is_plane_first)
        if Q.ndim > 1:
            return found
        return Penetration(float(found.depth[0]), found.direction[0], bool(found.is_unique[0]))

    @property
    def _radii(self) -> float:
        return self.point_a.shape.radius + self.point_b.shape.radius

    def _each(self, q: ArrayLike, ask: Callable[[Array], Array]) -> Any:
        Q = as_configurations(q, self.robot_coordinates)
        return ask(Q) if Q.ndim > 1 else ask(Q[None])[0]

    def parts(self, start: Array, end: Array) -> bool:
        """Return whether a contact of the one effective angle lies between configurations `start` and `end` (n,)."""
        for contact in self.contacts or ():
            lower, upper = contact.gap(float(contact.coefficients @ start))
            if not lower < float(contact.coefficients @ end) < upper:
                return True
        return False

    def expression(self, frame: Literal["minimal", "ancestor"] = "minimal") -> Any:
        """Return r as a SymPy (3, 1) matrix [m] with one real symbol for each coordinate.

        Args:
            frame: ``"minimal"``: the frame on the path in which the vector has the fewest rotated terms. The norm is
                the same in every frame. ``"ancestor"``: the frame of the ancestor link, as in the paper.

        Raises:
            UnknownNameError: If the frame is none of these two.

        Example:
            >>> import pinbound as pb
            >>> pb.load("minervabot_v3").boundaries["beta_5"].expression().free_symbols
            {q3}
        """
        from pinbound.evaluate import symbolic

        if frame not in ("minimal", "ancestor"):
            raise UnknownNameError("frame", frame, ("minimal", "ancestor"))
        ask = symbolic.minimal_vector if frame == "minimal" else symbolic.ancestor_vector
        return ask(self.path, self.robot_coordinates)

    def latex(self, frame: Literal["minimal", "ancestor"] = "minimal") -> str:
        """Return `expression(frame)` as LaTeX, with decimal numbers in metres."""
        from pinbound.evaluate import symbolic

        return symbolic.latex(self.expression(frame))

    def _repr_latex_(self) -> str | None:
        """Return the vector between the marks for a notebook; None if it is too long, or SymPy is not installed."""
        if not self.path.is_short:
            return None
        try:
            return rf"$\displaystyle r = {self.latex()}\ \mathrm{{m}}$"
        except UnsupportedError:
            return None

    def limits(self, coordinate: str, q: ArrayLike, window: tuple[float, float] | None = None) -> Any:
        """Return the allowed values of one coordinate; the other coordinates are those of q.

        A value is allowed if the marks are not in contact there. For a stop, these are all arcs between its contact
        angles, also arcs that cannot be reached from home. `signed_clearance` and `BoundarySet.limits` take home into
        account.

        If the coordinate occurs in one rotation only, `|r|^2 = a + b cos q_j + c sin q_j` (the height above a plane has
        the same form), and the allowed set is one arc in each turn. If the coordinate only translates, it is all values
        outside one interval. Both are closed forms. In all other cases, every contact is isolated with a proof.

        Args:
            coordinate: An active coordinate of the robot.
            q: (n,) configuration, or (N, n); its entry for the coordinate does not matter.
            window: Range in which to search. It is needed only if the boundary has no period in the coordinate (the
                coordinate rotates and translates, or rotates by angles without a common period), or if one turn has
                too many contacts to list.

        Returns:
            `AllowedArcs` for one q, `AllowedArcsTable` for many.

        Raises:
            UnknownNameError: If the robot has no such coordinate.
            DimensionError: If q is not finite or has another shape, or if the window is not two increasing numbers.
            UnsupportedError: If a window is needed and not given, or if it holds too many contacts to list.

        Example:
            >>> import pinbound as pb
            >>> arcs = pb.load("minervabot_v3").boundaries["beta_4"].limits("q3", [0.0, 0.1, 0.0])
            >>> np.degrees(arcs.intervals).round(6)
            array([[ 38.158698, 398.158698]])
        """
        index = coordinate_index(coordinate, self.robot_coordinates)
        points = as_configurations(q, self.robot_coordinates)
        if not np.all(np.isfinite(points)):
            raise DimensionError("q holds a number that is not finite; give finite numbers")
        if window is not None:
            window = checked_window(window)
        table = self.rule.arcs(index, coordinate, np.atleast_2d(points), window)
        return table if points.ndim > 1 else table[0]

    def span(
        self, coordinate: str, q: Array, within: tuple[float, float], clear: bool | None = None
    ) -> tuple[float, float] | None:
        """Return how far a coordinate can move from q (n,) within an interval that holds its value; None if in contact.

        This is `limits(...).around(...)`, but it searches within the interval only. An end is infinite if nothing stops
        the coordinate before the interval ends. The signed clearance decides whether q is in contact; a caller that
        knows it gives `clear`. If rounding puts the end of an arc on the other side of q, the end is q itself.
        """
        if not (self.signed_clearance(q) > 0.0 if clear is None else clear):
            return None
        index, (low, high) = self.robot_coordinates.index(coordinate), within
        if self.is_stop or outwards.is_closed(self.path, index):
            span = _around(self.rule.arcs(index, coordinate, q[None])[0], float(q[index]))
        elif not low < high:
            return -math.inf, math.inf
        else:
            value = float(q[index])
            span = outwards.around(self.path, index, coordinate, q, self.rule.distance, within) or (value, value)
        return -math.inf if span[0] <= low else span[0], math.inf if span[1] >= high else span[1]

    def spans(self, coordinate: str, Q: Array, within: tuple[float, float], clear: Flags) -> Array:
        """Return `span` of a `coordinate` for many q (N, n): (N, 2), NaN where q itself is not `clear` (N,).

        Example:
            >>> import pinbound as pb
            >>> beta = pb.load("minervabot_v3").boundaries["beta_4"]
            >>> np.degrees(beta.spans("q3", np.zeros((1, 3)), within=(-2.0, 2.0), clear=np.array([True]))).round(3)
            array([[ -inf, 32.429]])
        """
        index, (low, high) = self.robot_coordinates.index(coordinate), within
        value = Q[:, index]
        if self.is_stop or outwards.is_closed(self.path, index):
            arcs = self.rule.arcs(index, coordinate, Q)
            found = arcs.around(value)
            for row in np.flatnonzero(np.isnan(found[:, 0]) & clear):  # of the others nothing is said below
                found[row] = _around(arcs[int(row)], float(value[row]))
        elif low < high:
            found = outwards.arounds(self.path, index, coordinate, Q, self.rule.distance, within)
            found = np.where(np.isnan(found), value[:, None], found)
        else:
            found = np.tile([-math.inf, math.inf], (len(Q), 1))
        found[found[:, 0] <= low, 0] = -math.inf
        found[found[:, 1] >= high, 1] = math.inf
        found[~clear] = np.nan
        return found

    def limit_expressions(self, coordinate: str) -> Any:
        """Return the two contacts of one coordinate as functions of the others, in SymPy and LaTeX: Eqs. (18)-(20).

        Raises:
            UnknownNameError: If the robot has no such coordinate.
            UnsupportedError: If the path does not use the coordinate in exactly one rotation.

        Example:
            >>> import pinbound as pb
            >>> found = pb.load("minervabot_v3").boundaries["beta_9"].limit_expressions("q3")
            >>> round(float(found.aligned.evalf()) * 180 / np.pi, 9)
            -8.462041074
        """
        from pinbound.evaluate import symbolic

        index = coordinate_index(coordinate, self.robot_coordinates)
        return symbolic.limit_expressions(self.path, index, self.robot_coordinates, self.threshold)


def _around(arcs: univariate.AllowedArcs, value: float) -> tuple[float, float]:
    """Return the arc that holds a free value, also at its end, to rounding; only the value itself if there is none."""
    near = ROOT * max(1.0, abs(value))
    for nearby in (value, value + near, value - near):
        found = arcs.around(nearby)
        if found is not None:
            return min(found[0], value), max(found[1], value)
    return value, value


def one_configuration(q: ArrayLike, coordinates: Sequence[str]) -> Array:
    """Return one finite configuration (n,).

    Raises:
        DimensionError: If there are several, or a number that is not finite.
    """
    point = as_configurations(q, coordinates)
    if point.ndim != 1:
        raise DimensionError(f"give one configuration ({len(coordinates)},), not {point.shape}")
    if not np.all(np.isfinite(point)):
        raise DimensionError(
            f"the configuration {point.tolist()} holds a number that is not finite; give finite numbers"
        )
    return point
