"""mink: step-safe rows as a limit, for a MuJoCo model of the robot, joints matched by name (`pip install mink`)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pinbound.adapters.shared import Polytope, SafeSteps, optional
from pinbound.exceptions import DimensionError, name_hint
from pinbound.model.pinocchio_model import placements
from pinbound.robot.model_view import ModelJoints, ModelView
from pinbound.robot.robot import Robot
from pinbound.tolerances import SAME_ROBOT
from pinbound.typing import Array

__all__ = ["PolytopeLimit", "StepLimit", "view_of"]

_Limit: Any = optional("mink", "Limit", "mink")


def view_of(robot: Robot, model: Any) -> ModelView:
    """Return the robot's boundaries as functions of the q of a `mujoco.MjModel`; joints are matched by name.

    The placements of all bodies with names of links are compared at two configurations, relative to the root link
    (MuJoCo merges links that do not move with their parents). Every moving joint's own link must be among them.

    Raises:
        DimensionError: If a joint or its body is missing, or a body has another placement: it is another robot.
    """
    mujoco = import_module("mujoco")
    hinge, slide = int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)
    places, flying = dict[str, tuple[int, int, int]](), list[str]()
    for index in range(int(model.njnt)):
        name, kind = str(model.joint(index).name), int(model.jnt_type[index])
        if kind not in (hinge, slide):
            flying.append(name or f"joint {index}")
        elif name in robot.coupling.joints:
            places[name] = int(model.jnt_qposadr[index]), 1, int(model.jnt_dofadr[index])
        else:
            hint = name_hint(name, robot.coupling.joints)
            raise DimensionError(f"MuJoCo's joint {name!r} does not move in {robot.name!r}. {hint}")
    for name in robot.coupling.joints:
        if name not in places:
            raise DimensionError(f"the MuJoCo model has no joint {name!r}. {name_hint(name, places)}")
    joints = ModelJoints(int(model.nq), int(model.nv), places, {}, (), tuple(flying))
    _compare(robot, mujoco, model, joints)
    return ModelView.of(robot.boundaries, robot.coupling, joints, robot.home)


def _compare(robot: Robot, mujoco: Any, model: Any, joints: ModelJoints) -> None:
    bodies = {str(model.body(index).name): index for index in range(int(model.nbody))}
    for joint in robot.tree.moving_joints:
        if joint.child not in bodies:
            hint = name_hint(joint.child, bodies)
            raise DimensionError(
                f"the MuJoCo model has no body {joint.child!r}; give each body the name of its link in the URDF. {hint}"
            )
    data = mujoco.MjData(model)
    size = 1.0 + sum(float(np.linalg.norm(joint.translation)) for joint in robot.tree.kinematics.joints)
    allowed = SAME_ROBOT * np.array([1.0, 1.0, 1.0, size])
    for seed in (0, 1):
        q = robot.home + np.random.default_rng(seed).uniform(-1.0, 1.0, len(robot.home))
        theta = dict(zip(robot.coupling.joints, robot.coupling.expand(q).tolist(), strict=True))
        data.qpos[:] = model.qpos0
        for name, (start, _, _) in joints.places.items():
            data.qpos[start] = theta[name]
        mujoco.mj_kinematics(model, data)
        root = _placed(data, bodies.get(robot.tree.root, 0))
        for name, place in zip(*placements(robot.tree, theta), strict=True):
            if name not in bodies:
                continue
            if np.any(np.abs((np.linalg.inv(root) @ _placed(data, bodies[name]))[:3] - place) > allowed):
                raise DimensionError(
                    f"MuJoCo places body {name!r} elsewhere than {robot.name!r} does; compile it from the same URDF"
                )


def _placed(data: Any, body: int) -> Array:
    place = np.eye(4)
    place[:3, :3], place[:3, 3] = np.reshape(data.xmat[body], (3, 3)), data.xpos[body]
    return place


def _constraint(G: Array, h: Array) -> Any:
    return import_module("mink").Constraint(G=G, h=h)


class StepLimit(_Limit):
    """No step within `G dq <= h` meets a boundary or passes a joint limit, whatever dt (`docs/steps.md`).

    Use it in `mink.solve_ik(..., limits=[StepLimit(robot, model, velocity)])`. `steps.last.blocked` names the
    boundaries in contact at q. If there are any, the program may have no solution, and mink raises `NoSolutionFound`.
    Otherwise dq = 0 satisfies all rows.

    Attributes:
        steps: The object that makes the rows, with the rows of the last step in `steps.last`.
    """

    def __init__(
        self,
        robot: Robot,
        model: Any,
        velocity: ArrayLike | Mapping[str, float],
        boundaries: Sequence[str] | str | None = None,
        **options: Any,
    ) -> None:
        """Bind the limit to the MuJoCo model of mink's configurations.

        Args:
            robot: The robot.
            model: A `mujoco.MjModel` of it, with joints and bodies named as in the URDF.
            velocity: The largest speed of each coordinate [rad/s or m/s], (n,), one number, or by name.
            boundaries: Names of boundaries; None: all.
            options: `most`, `gain`, `margin`, `reserve`, `limits`, as for `StepBounds.rows`.

        Raises:
            DimensionError: If it is not a model of this robot, or a speed is missing.
            UnsupportedError: If mink is not installed.
        """
        _Limit.__init__(self)
        self.steps = SafeSteps(robot, view_of(robot, model), velocity, boundaries, **options)

    def compute_qp_inequalities(self, configuration: Any, dt: float) -> Any:
        """Return the `mink.Constraint` with `G dq <= h`."""
        return _constraint(*self.steps.half_spaces(configuration.q, dt))


class PolytopeLimit(_Limit):
    """A convex region, or `A q <= b`, as a limit: if q is inside the set, no step leaves it."""

    def __init__(self, robot: Robot, model: Any, A: Any, b: ArrayLike | None = None) -> None:
        """Take a convex `Region` of all coordinates that boundaries depend on, or A (k, n) and b (k,) for q.

        Raises:
            UnsupportedError: If the region is not convex, or boundaries depend on coordinates that it fixes, or mink is
                not installed.
            DimensionError: If A and b do not fit, or it is not a model of this robot.
        """
        _Limit.__init__(self)
        self.polytope = Polytope(robot, view_of(robot, model), A, b)

    def compute_qp_inequalities(self, configuration: Any, dt: float) -> Any:
        """Return the `mink.Constraint` with `G dq <= h`."""
        return _constraint(*self.polytope.half_spaces(configuration.q))
