"""The q and v of a user's own `pinocchio.Model` in the coordinates of this robot.

A model that was built from the same URDF may have other joints than the robot's active coordinates: a free flyer,
continuous joints as (cos, sin), mimic joints as separate joints, or locked joints (a reduced model). The robot's q is a
function of the model's q, and its rate is linear in the model's velocity,

    q_robot = f(q_model),    dq_robot/dt = E v,    so that    grad_v h = grad_q h . E,

where E (n, nv) has at most one 1 in each row. When a model is bound, the placements of all links at two configurations
prove that it is a model of this robot.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from pinbound.boundaries.boundary_set import BoundarySet
from pinbound.exceptions import DimensionError, name_hint
from pinbound.loops.loop_coupling import LoopCoupling, refuse_linear
from pinbound.model.coupling import Coupling, as_configurations, real_array
from pinbound.model.pinocchio_model import check_model, placements
from pinbound.model.tree import Tree
from pinbound.model.urdf import Joint
from pinbound.tolerances import COUPLED, SAME_ROBOT, UNIT_CIRCLE
from pinbound.typing import Array
from pinbound.values import Value

__all__ = ["ModelJoints", "ModelView", "read_model"]

_TURN = 2.0 * math.pi


@dataclass(frozen=True, eq=False)
class ModelJoints(Value):
    """The positions of the robot's joints in the q and v of a model.

    Attributes:
        nq: Length of the model's q.
        nv: Length of the model's v.
        places: For each joint that the model moves: index in q, number of entries there (2: cos, sin), index in v.
        locked: Values of joints that the model does not move [rad or m].
        driven: Mimic joints that Pinocchio itself moves with their primary joints.
        flying: Names of joints with several degrees of freedom, such as a free flyer.
    """

    nq: int
    nv: int
    places: Mapping[str, tuple[int, int, int]]
    locked: Mapping[str, float]
    driven: tuple[str, ...]
    flying: tuple[str, ...]

    def value(self, q: Array, joint: str, near: float) -> Array:
        """Return the values (N,) of a joint at q (N, nq) [rad or m]: for continuous joints, the nearest to `near`."""
        if joint in self.locked:
            return np.full(len(q), self.locked[joint])
        start, count, _ = self.places[joint]
        if count == 1:
            return q[:, start].copy()
        cos, sin = q[:, start], q[:, start + 1]
        off = np.abs(cos * cos + sin * sin - 1.0)
        if np.any(off > UNIT_CIRCLE):
            where = f"({cos[np.nanargmax(off)]:.6g}, {sin[np.nanargmax(off)]:.6g})"
            raise DimensionError(
                f"q has {where} at joint {joint!r}, which is continuous: give cos and sin of one angle there"
            )
        angle = np.arctan2(sin, cos)
        with np.errstate(invalid="ignore"):
            return angle + _TURN * np.round((near - angle) / _TURN)


def read_model(tree: Tree, coupling: Coupling, model: Any, home: Array) -> ModelJoints:
    """Return the positions of the robot's joints in a model, after proving that it is a model of this robot.

    Raises:
        DimensionError: If it is not: a joint or link is missing, a link has another placement, or mimic joints are
            locked while their primary joints move.
    """
    check_model(model)
    places, driven, flying = dict[str, tuple[int, int, int]](), list[str](), list[str]()
    known = {joint.name: joint for joint in tree.kinematics.joints}
    for name, joint in zip(list(model.names)[1:], list(model.joints)[1:], strict=True):
        if "Mimic" in joint.shortname():
            driven.append(name)
        elif int(joint.nv) != 1:
            flying.append(name)
        elif name not in coupling.joints:
            hint = name_hint(name, coupling.joints)
            raise DimensionError(f"the model's joint {name!r} does not move in {tree.kinematics.name!r}. {hint}")
        else:
            places[name] = int(joint.idx_q), int(joint.nq), int(joint.idx_v)
    stray = [name for name in driven if name not in coupling.joints or name in coupling.coordinates]
    if stray:
        raise DimensionError(
            f"the model's joint {stray[0]!r} is a mimic joint, which it is not in this robot; build the model again"
        )
    frames = _frames(tree, model)
    theta = dict(zip(coupling.joints, coupling.expand(home).tolist(), strict=True))
    still = _placed(model, frames, _neutral(model))
    missing = [name for name in coupling.joints if name not in places and name not in driven]
    locked = {name: _locked_value(known[name], still, theta[name]) for name in missing}
    _check_locked(coupling, locked)
    found = ModelJoints(int(model.nq), int(model.nv), places, locked, tuple(driven), tuple(flying))
    _compare(tree, coupling, model, frames, found, home)
    return found


def _neutral(model: Any) -> Array:
    import pinocchio

    return np.array(cast(Any, pinocchio).neutral(model), dtype=np.float64)


def _frames(tree: Tree, model: Any) -> dict[str, int]:
    import pinocchio

    body = cast(Any, pinocchio).FrameType.BODY
    frames = {str(frame.name): index for index, frame in enumerate(model.frames) if frame.type == body}
    for link in tree.links:
        if link not in frames:
            said = f"the model has no link {link!r}; build it from the same URDF. {name_hint(link, frames)}"
            raise DimensionError(said)
    return frames


def _placed(model: Any, frames: Mapping[str, int], q: Array) -> dict[str, Array]:
    """Return the placement (4, 4) of each link in the model."""
    import pinocchio

    data = model.createData()
    cast(Any, pinocchio).framesForwardKinematics(model, data, q)
    return {link: np.array(data.oMf[index].homogeneous) for link, index in frames.items()}


def _locked_value(joint: Joint, placed: Mapping[str, Array], near: float) -> float:
    """Return the value at which a model locks a joint, from the relative placement of its two links."""
    relative = np.linalg.inv(placed[joint.parent]) @ placed[joint.child]
    if joint.type == "prismatic":
        return float(joint.axis @ joint.rotation.T @ (relative[:3, 3] - joint.translation))
    turned = joint.rotation.T @ relative[:3, :3]
    sine = 0.5 * np.array([turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]])
    angle = math.atan2(float(joint.axis @ sine), 0.5 * (float(np.trace(turned)) - 1.0))
    return angle + _TURN * round((near - angle) / _TURN)


def _check_locked(coupling: Coupling, locked: Mapping[str, float]) -> None:
    """Refuse locked mimic joints whose primary joints move, or are locked at values that do not fit."""
    for name, value in locked.items():
        if name in coupling.coordinates:
            continue
        coefficients, offset = coupling.row(name)
        used = [coupling.coordinates[index] for index in np.flatnonzero(coefficients)]
        free = [primary for primary in used if primary not in locked]
        if free:
            said = f"the model locks {name!r}, but moves {free[0]!r}, which moves it"
            raise DimensionError(f"{said}: lock both, or none")
        expected = offset + sum(
            float(c) * locked[primary]
            for c, primary in zip(coefficients, coupling.coordinates, strict=True)
            if primary in used
        )
        if abs(value - expected) > COUPLED:
            said = f"the model locks {name!r} at {value:.9g}, but the joint that it follows puts it at {expected:.9g}"
            raise DimensionError(f"{said}; lock mimic joints where the robot's `to_pinocchio` puts them")


def _compare(
    tree: Tree, coupling: Coupling, model: Any, frames: Mapping[str, int], found: ModelJoints, home: Array
) -> None:
    """Compare the placements of all links, relative to the root link, at two configurations."""
    for seed in (0, 1):
        q = home + np.random.default_rng(seed).uniform(-1.0, 1.0, len(home))
        for index, name in enumerate(coupling.coordinates):
            q[index] = found.locked.get(name, q[index])
        theta = dict(zip(coupling.joints, coupling.expand(q).tolist(), strict=True))
        given = _neutral(model)
        for name, (start, count, _) in found.places.items():
            value = theta[name]
            given[start : start + count] = value if count == 1 else (math.cos(value), math.sin(value))
        theirs = _placed(model, frames, given)
        names, ours = placements(tree, theta)
        root = np.linalg.inv(theirs[tree.root])
        size = 1.0 + sum(float(np.linalg.norm(joint.translation)) for joint in tree.kinematics.joints)
        allowed = SAME_ROBOT * np.array([1.0, 1.0, 1.0, size])
        for name, place in zip(names, ours, strict=True):
            if np.any(np.abs((root @ theirs[name])[:3] - place) > allowed):
                said = f"the model places link {name!r} elsewhere than {tree.kinematics.name!r} does"
                remedy = "build the model from the same URDF"
                if any(" as pi" in note or "pi/2" in note for note in tree.kinematics.notes):
                    remedy += "; robot.notes say which printed angles are read as multiples of pi: write such angles "
                    remedy += "with all digits"
                raise DimensionError(f"{said}; {remedy}")


@dataclass(frozen=True, eq=False)
class ModelView(Value):
    """A robot's boundaries as functions of the q of a user's own Pinocchio model, with gradients over its v.

    `Robot.on` makes it. If the model has mimic joints as separate joints, their columns are zero: a velocity must move
    them with their primary joints, as `theta = S q + o` says. A q that violates this equation is refused.

    Attributes:
        boundaries: The boundaries.
        coupling: The robot's coupling.
        joints: The positions of the robot's joints in the model.
        near: (n,) reference: the angle of a continuous joint is the one nearest to it.
        E: (n, nv), `dq_robot/dt = E v`.
    """

    boundaries: BoundarySet
    coupling: Coupling
    joints: ModelJoints
    near: Array
    E: Array

    @classmethod
    def of(cls, boundaries: BoundarySet, coupling: Coupling, joints: ModelJoints, near: Array) -> ModelView:
        """Return the view of a model whose joints are known.

        Raises:
            UnsupportedError: If loops that are not parallelograms make joints nonlinear functions of q.
        """
        if isinstance(coupling, LoopCoupling):
            refuse_linear("gradients with respect to the v of a model are not available", coupling.lift)
        E = np.zeros((len(coupling.coordinates), joints.nv))
        for row, name in enumerate(coupling.coordinates):
            if name in joints.places:
                E[row, joints.places[name][2]] = 1.0
        return cls(boundaries, coupling, joints, near, E)

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes for the user of the model."""
        said = [
            f"the model has {name!r}, of several degrees of freedom: marks on the root link move with the base"
            for name in self.joints.flying
        ]
        return (*said, *[f"the model locks {name!r} at {value:.9g}" for name, value in self.joints.locked.items()])

    def select(self, names: Any) -> ModelView:
        """Return the view of some boundaries, by name, as `BoundarySet.select` does."""
        return ModelView(self.boundaries.select(names), self.coupling, self.joints, self.near, self.E)

    def configurations(self, q: ArrayLike, near: ArrayLike | None = None) -> Array:
        """Return this robot's Q, (n,) or (N, n), for the model's q, (nq,) or (N, nq).

        Args:
            q: One q of the model, or many.
            near: (n,) reference for joints that the model stores as cos and sin: the nearest angle is used; default:
                home.

        Raises:
            DimensionError: If q has another shape, if cos and sin of a joint do not have norm 1, or if a mimic joint
                does not fit its primary joint.
        """
        given = real_array(q, "q")
        if given.ndim not in (1, 2) or given.shape[-1] != self.joints.nq:
            raise DimensionError(f"q has shape {given.shape}; give ({self.joints.nq},) or (N, {self.joints.nq})")
        rows = given.reshape(-1, self.joints.nq)
        beside = self.near if near is None else as_configurations(near, self.coupling.coordinates)
        Q = np.empty((len(rows), len(self.coupling.coordinates)))
        for column, name in enumerate(self.coupling.coordinates):
            if name in self.joints.places or name in self.joints.locked:
                Q[:, column] = self.joints.value(rows, name, float(beside[column]))
        self._check_mimics(rows, Q)
        return Q if given.ndim > 1 else Q[0]

    def _check_mimics(self, rows: Array, Q: Array) -> None:
        theta = self.coupling.expand(Q)
        for column, name in enumerate(self.coupling.joints):
            if name in self.coupling.coordinates or name not in self.joints.places:
                continue
            expected = theta[:, column]
            off = np.abs(self.joints.value(rows, name, 0.0) - expected)
            if self.joints.places[name][1] > 1:
                off = np.abs(off - _TURN * np.round(off / _TURN))
            if np.any(off > COUPLED):
                worst = int(np.nanargmax(off))
                said = f"mimic joint {name!r} is {off[worst]:.3g} from {expected[worst]:.9g}, where its primary puts it"
                raise DimensionError(f"{said}; move it along, or build the model with mimic=True")

    def clearances(self, q: ArrayLike) -> Array:
        """Return every signed clearance, (m,) or (N, m) [m]; positive is free (`BoundarySet.signed_clearances`)."""
        return self.boundaries.signed_clearances(self.configurations(q))

    def gradients(self, q: ArrayLike) -> Array:
        """Return J, (m, nv) or (N, m, nv), with `d clearances / dt = J v`; NaN where a distance is zero."""
        return self.boundaries.signed_gradients(self.configurations(q)) @ self.E

    def free(self, q: ArrayLike, *, limits: bool = True) -> Any:
        """Return whether q is free: a bool, or (N,) bools, as `BoundarySet.free`."""
        return self.boundaries.free(self.configurations(q), limits=limits)
