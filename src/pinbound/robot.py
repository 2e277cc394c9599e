"""Robot: what users hold; `loading.load` makes it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pinbound.annotations import Annotations
from pinbound.bodies import collision_bodies
from pinbound.boundary_set import BoundarySet
from pinbound.closures import Closure
from pinbound.coupling import Coupling, GuardedLimit, Intervals, LinearLimit, as_configurations
from pinbound.coverage import Coverage
from pinbound.document import Document
from pinbound.exceptions import (
    DimensionError,
    PinboundError,
    UnknownNameError,
    name_hint,
)
from pinbound.interpreters import numeric
from pinbound.path import absolute_chain
from pinbound.pinocchio_model import build_model
from pinbound.tree import Tree
from pinbound.values import Value

__all__ = ["Robot"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Robot(Value):
    """A robot with its coupling, closures and boundaries. Made by `load`; never changed afterwards.

    Attributes:
        document: The XML that it was read from.
        tree: Links and joints.
        annotations: What was marked on it.
        coupling: `theta = S q + o`.
        linear_limits: Limits of all tree joints, and rules without conditions, said of q.
        closures: Closed loops, each proven to close.
        boundaries: The boundaries, in order.
        home: (n,) a feasible configuration [rad or m].
        notes: What was normalised on loading.
        package_dirs: Folders in which `package://` is looked up.
        guarded_limits: Ends of rules that bind where conditions hold, said of q.
    """

    document: Document
    tree: Tree
    annotations: Annotations
    coupling: Coupling
    linear_limits: tuple[LinearLimit, ...]
    closures: tuple[Closure, ...]
    boundaries: BoundarySet
    home: Array
    notes: tuple[str, ...]
    package_dirs: tuple[str, ...] = ()
    guarded_limits: tuple[GuardedLimit, ...] = ()

    def __repr__(self) -> str:
        """Return name and counts."""
        counts = f"{len(self.boundaries)} boundaries, {len(self.closures)} closures"
        return f"<Robot {self.name}: coordinates {', '.join(self.coordinates)}; {counts}>"

    @property
    def name(self) -> str:
        """The robot's name in its URDF."""
        return self.tree.kinematics.name

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the active joints, in q's order."""
        return self.coupling.coordinates

    @cached_property
    def lower(self) -> Array:
        """(n,) lower limits of the active joints themselves [rad or m]; -inf where there is none, and of axes."""
        return self._ends("lower")

    @cached_property
    def upper(self) -> Array:
        """(n,) upper limits of the active joints themselves [rad or m]; inf where there is none, and of axes."""
        return self._ends("upper")

    def _ends(self, end: str) -> Array:
        joints = {joint.name: float(getattr(joint, end)) for joint in self.tree.moving_joints}
        nothing = -math.inf if end == "lower" else math.inf  # of an axis, which is no joint
        values = np.array([joints.get(name, nothing) for name in self.coordinates])
        values.flags.writeable = False
        return values

    @cached_property
    def intervals(self) -> Intervals:
        """All limits and rules as one value, whose `hold(Q)` says which configurations keep them."""
        return Intervals.of(self.linear_limits, len(self.coordinates), guarded=self.guarded_limits)

    def turns(self, joint: str) -> bool:
        """Return whether the value of a joint, or of an axis, is an angle [rad], not a length [m]."""
        joint = next((axis.instead_of for axis in self.annotations.axes if axis.name == joint), joint)
        return any(one.name == joint and one.type != "prismatic" for one in self.tree.moving_joints)

    @property
    def model(self) -> Any:
        """The `pinocchio.Model` of the whole tree, one coordinate a moving joint, in `coupling.joints`' order.

        Each access returns a copy of its own: what is changed in it changes nothing here.

        Example:
            >>> import pinbound as pb
            >>> robot = pb.load("minervabot_v3")
            >>> robot.model.nq == len(robot.coupling.joints) == 11
            True
        """
        return self._model.copy()

    @cached_property
    def _model(self) -> Any:
        model = build_model(self.document, self.tree.kinematics)
        if tuple(model.names)[1:] != self.coupling.joints:
            raise PinboundError(f"Pinocchio orders the joints as {tuple(model.names)[1:]}, not {self.coupling.joints}")
        return model

    @cached_property
    def coverage(self) -> Coverage:
        """Which bodies are held by marks, which pairs of links are watched, left out and why, or not watched.

        Example:
            >>> import pinbound as pb
            >>> coverage = pb.load("minervabot_v3").coverage
            >>> len(coverage.watched), len(coverage.in_part), coverage.is_complete
            (0, 7, False)
        """
        bodies = collision_bodies(self)
        return Coverage(self.tree, self.coupling, self.annotations, bodies, self.boundaries, self.closures)

    def closure_residuals(self, Q: ArrayLike) -> Array:
        """Return the gap of every closure, (n_closures,) or (N, n_closures) [m].

        Example:
            >>> import pinbound as pb
            >>> robot = pb.load("minervabot_v3")
            >>> bool(robot.closure_residuals(robot.home).max() < 1e-15)
            True
        """
        array = as_configurations(Q, self.coordinates)
        rows = array if array.ndim > 1 else array[None]
        residuals = np.array([closure.residuals(rows) for closure in self.closures]).reshape(-1, len(rows)).T
        return residuals if array.ndim > 1 else residuals[0]

    def positions(self, link: str, Q: ArrayLike, xyz: Sequence[float] = (0.0, 0.0, 0.0)) -> Array:
        """Return where a point of a link is, in the root link's frame: (3,) or (N, 3) [m].

        Floating and planar joints are held at their origin, as `model` holds them.

        Args:
            link: Name of the link.
            Q: One q (n,) or many (N, n).
            xyz: The point in the link's frame [m].

        Raises:
            UnknownNameError: If there is no such link.

        Example:
            >>> import pinbound as pb
            >>> pb.load("minervabot_v3").positions("link_6", [0.0, 0.0, 0.0]).round(5).tolist()
            [0.12943, 0.0, 0.14859]
        """
        if link not in self.tree.links:
            raise UnknownNameError("link", link, self.tree.links)
        x, y, z = (float(value) for value in xyz)
        chain = absolute_chain(self.tree, self.coupling, link, (x, y, z))
        array = as_configurations(Q, self.coordinates)
        return numeric.positions(chain, array) if array.ndim > 1 else numeric.positions(chain, array[None])[0]

    def operation_counts(self, boundary: str) -> tuple[int, int]:
        """Return how many operations the minimal form of a boundary's vector has, and how many Eq. (5) unreduced.

        Sums, products, sines and cosines are counted as SymPy prints them; nothing is shared between terms.

        Example:
            >>> import pinbound as pb
            >>> pb.load("minervabot_v3").operation_counts("beta_5")
            (18, 111)
        """
        from pinbound.interpreters import symbolic

        found = self.boundaries[boundary]
        place_a, place_b = (
            absolute_chain(self.tree, self.coupling, mark.link, mark.xyz, reduced=False)
            for mark in (found.point_a, found.point_b)
        )
        unreduced = symbolic.unreduced_vector(place_a, place_b, self.coordinates)
        return symbolic.operations(found.expression()), symbolic.operations(unreduced)

    def to_pinocchio(self, model: Any, Q: ArrayLike) -> Array:
        """Return q of a model that the user built from this URDF, matched by joint name.

        Works for `mimic=True` and `mimic=False`, for continuous joints (cos, sin), and for a model with a free
        flyer at its root, whose coordinates are left neutral.

        Args:
            model: A `pinocchio.Model`; it is not changed.
            Q: One q (n,) or many (N, n) of this robot.

        Returns:
            (model.nq,) or (N, model.nq).

        Raises:
            DimensionError: If the model has a joint of one coordinate that this robot does not have.
        """
        import pinocchio

        theta = self.coupling.expand(Q)
        neutral: Array = cast(Any, pinocchio).neutral(model)
        full = np.broadcast_to(neutral, (*theta.shape[:-1], len(neutral))).copy()
        for name, joint in zip(list(model.names)[1:], list(model.joints)[1:], strict=True):
            nq, nv = int(joint.nq), int(joint.nv)
            if nv != 1 or "Mimic" in joint.shortname():
                continue
            if name not in self.coupling.joints:
                hint = name_hint(name, self.coupling.joints)
                raise DimensionError(f"the model's joint {name!r} is none of {self.name!r}. {hint}")
            value = theta[..., self.coupling.joints.index(name)]
            columns = (value,) if nq == 1 else (np.cos(value), np.sin(value))
            for step, column in enumerate(columns):
                full[..., joint.idx_q + step] = column
        return full
