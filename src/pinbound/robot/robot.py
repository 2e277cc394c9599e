"""Robot: the central object for users; `loading.load` makes it."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from pinbound.annotations import Annotations
from pinbound.boundaries.boundary import one_configuration
from pinbound.boundaries.boundary_set import BoundarySet
from pinbound.checks import three_numbers
from pinbound.coverage import Coverage
from pinbound.coverage.bodies import collision_bodies
from pinbound.coverage.body_meshes import MeshSource
from pinbound.drawing import Pictured, drawn
from pinbound.evaluate import numeric
from pinbound.exceptions import (
    DimensionError,
    PinboundError,
    UnknownNameError,
    UnsupportedError,
    name_hint,
)
from pinbound.loops.closures import Closure
from pinbound.model.coupling import Coupling, GuardedLimit, Intervals, LinearLimit, as_configurations
from pinbound.model.document import Document
from pinbound.model.pinocchio_model import build_model, check_model
from pinbound.model.tree import Tree
from pinbound.path.relative import absolute_chain
from pinbound.robot.model_view import ModelView, read_model
from pinbound.typing import Array
from pinbound.units import several
from pinbound.values import Value

__all__ = ["Robot", "check_robot", "refuse_conditions"]


@dataclass(frozen=True, eq=False)
class Robot(Value, Pictured):
    """A robot with its coupling, closures and boundaries. `load` makes it; it never changes.

    Attributes:
        document: The XML that it was read from.
        tree: Links and joints.
        annotations: Its annotations.
        coupling: `theta = S q + o`.
        linear_limits: Limits of all tree joints, and rules without conditions, in terms of q.
        closures: Closed loops, each proven to close.
        boundaries: The boundaries, in order.
        home: (n,) a feasible configuration [rad or m].
        notes: Sentences about what was normalised, assumed or ignored while loading.
        package_dirs: Folders in which `package://` is searched.
        again: Makes the robot again with more annotations, for `with_annotations`.
        guarded_limits: Ends of rules with conditions, in terms of q.

    Example:
        >>> import pinbound as pb
        >>> robot = pb.load("minervabot_v3")
        >>> robot.coordinates, robot.home.shape, len(robot.boundaries)
        (('q1', 'q2', 'q3'), (3,), 10)
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
    again: Callable[[Robot, Any], Robot] | None = None
    guarded_limits: tuple[GuardedLimit, ...] = ()

    def __repr__(self) -> str:
        """Return name and counts."""
        counts = f"{several(len(self.boundaries), 'boundary')}, {several(len(self.closures), 'closure')}"
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
        """(n,) lower limits of the active joints [rad or m]; -inf for axes and for joints without a limit."""
        return self._ends("lower")

    @cached_property
    def upper(self) -> Array:
        """(n,) upper limits of the active joints [rad or m]; inf for axes and for joints without a limit."""
        return self._ends("upper")

    def _ends(self, end: str) -> Array:
        joints = {joint.name: float(getattr(joint, end)) for joint in self.tree.moving_joints}
        nothing = -math.inf if end == "lower" else math.inf  # for an axis, which has no limits of its own
        values = np.array([joints.get(name, nothing) for name in self.coordinates])
        values.flags.writeable = False
        return values

    @cached_property
    def intervals(self) -> Intervals:
        """All limits and rules as one object; its `hold(Q)` says which configurations keep them."""
        return Intervals.of(self.linear_limits, len(self.coordinates), guarded=self.guarded_limits)

    def turns(self, joint: str) -> bool:
        """Return whether the value of a joint or axis is an angle [rad]; otherwise it is a length [m]."""
        joint = next((axis.instead_of for axis in self.annotations.axes if axis.name == joint), joint)
        return any(one.name == joint and one.type != "prismatic" for one in self.tree.moving_joints)

    @property
    def model(self) -> Any:
        """The `pinocchio.Model` of the whole tree: one coordinate for each moving joint, in `coupling.joints`' order.

        Each access returns a new copy; changes of the copy do not change the robot.

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
            said = f"Pinocchio orders the joints as {tuple(model.names)[1:]}, not {self.coupling.joints}"
            raise PinboundError(f"{said}; report this as a bug of pinbound")
        return model

    @cached_property
    def coverage(self) -> Coverage:
        """Which bodies marks hold, and which pairs of links are watched, left out (with the reason), or not watched.

        Example:
            >>> import pinbound as pb
            >>> coverage = pb.load("minervabot_v3").coverage
            >>> len(coverage.watched), len(coverage.in_part), coverage.is_complete
            (0, 7, False)
        """
        bodies = collision_bodies(self)
        return Coverage(self.tree, self.coupling, self.annotations, bodies, self.boundaries, self.closures, self.meshes)

    @cached_property
    def meshes(self) -> MeshSource:
        """The meshes of its bodies; each file is opened when its mesh is first needed."""
        return MeshSource(self.document.path, self.package_dirs)

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
        """Return the position of a point of a link in the frame of the root link: (3,) or (N, 3) [m].

        Floating and planar joints are fixed at their origin, as in `model`.

        Args:
            link: Name of the link.
            Q: One q (n,) or many (N, n).
            xyz: The point in the link's frame [m].

        Raises:
            UnknownNameError: If the link does not exist.
            DimensionError: If xyz is not three finite numbers, or Q has another shape.

        Example:
            >>> import pinbound as pb
            >>> pb.load("minervabot_v3").positions("link_6", [0.0, 0.0, 0.0]).round(5).tolist()
            [0.12943, 0.0, 0.14859]
        """
        if link not in tuple(self.tree.links):
            raise UnknownNameError("link", link, self.tree.links)
        chain = absolute_chain(self.tree, self.coupling, link, three_numbers(xyz, "xyz"))
        array = as_configurations(Q, self.coordinates)
        return numeric.positions(chain, array) if array.ndim > 1 else numeric.positions(chain, array[None])[0]

    def operation_counts(self, boundary: str) -> tuple[int, int]:
        """Return the numbers of operations in the minimal form of a boundary's vector, and in the unreduced Eq. (5).

        Sums, products, sines and cosines are counted as SymPy prints them, without common subexpressions.

        Example:
            >>> import pinbound as pb
            >>> pb.load("minervabot_v3").operation_counts("beta_5")
            (18, 111)
        """
        from pinbound.evaluate import symbolic

        found = self.boundaries[boundary]
        place_a, place_b = (
            absolute_chain(self.tree, self.coupling, mark.link, mark.shape.origin.tolist(), reduced=False)
            for mark in (found.point_a, found.point_b)
        )
        unreduced = symbolic.unreduced_vector(place_a, place_b, self.coordinates)
        return symbolic.operations(found.expression()), symbolic.operations(unreduced)

    def with_annotations(self, more: Any) -> Robot:
        """Return the robot with more annotations, as if its files had contained them; the files are not read again.

        Marks on the root link are fixed to the world: a table, a wall, a conveyor. Everything is checked as in `load`:
        home must be free of the new boundaries, too.

        Args:
            more: `Annotations`, or the path of a sidecar or an .srdf, or a sequence of these.

        Raises:
            InputError: If the annotations have faults; the error lists all of them.
            UnsupportedError: If the robot was not made by `load`.

        Example:
            >>> import pinbound as pb
            >>> robot = pb.load("minervabot_v3")
            >>> table = pb.Plane("table", "base_link", (0.0, 0.0, -0.05), (0.0, 0.0, 1.0))
            >>> tool = pb.Point("tool", "link_6", (0.0, 0.0, 0.0), radius=0.01)
            >>> more = pb.Annotations.of([table, tool], [pb.BoundaryMark("above", "tool", "table")])
            >>> robot.with_annotations(more).boundaries.names[-2:]
            ('beta_10', 'above')
        """
        if self.again is None:
            raise UnsupportedError("this robot was not made by load(), so it cannot be made again; load() its file")
        return self.again(self, more)

    def export(self, kind: str, path: str | Path, boundaries: Sequence[str] | str | None = None) -> tuple[Path, ...]:
        """Write the boundaries for other programs; the same robot always gives the same file.

        ``"c"``: signed clearances and their Jacobian in C99 without dependencies, as `path` (ending in .c) and a header
        beside it that states units and order. ``"json"``: the reduced chains as data, with the formula that evaluates
        them. ``"ros2"``: the YAML of `joint_limits`, with limits and boundaries of one coordinate each. This format has
        no couplings; comments in the file list them as lost.

        Args:
            kind: ``"c"``, ``"json"`` or ``"ros2"``.
            path: The file; an existing file is replaced.
            boundaries: Names of the boundaries; None: all.

        Returns:
            The written files.

        Raises:
            UnknownNameError: If the kind or a boundary does not exist.
            DimensionError: If it is no path, or a path in C that does not end in .c.
            UnsupportedError: If the export cannot represent the robot: C for boxes, prisms or hulls, whose nearest
                points need an iteration; JSON for hulls and cylinders; JSON or ROS 2 for rules with conditions.
        """
        from pinbound.export import c_files, chains_record, is_closed, ros2_text, signed_nodes

        if not isinstance(cast(object, path), str | os.PathLike):
            raise DimensionError(f"path is {path!r}; give the path of a file")
        chosen = self.boundaries if boundaries is None else self.boundaries.select(boundaries)
        file, names = Path(path), chosen.names
        rules, marks = [b.rule for b in chosen], [(b.point_a.name, b.point_b.name) for b in chosen]
        units = [(name, "rad" if self.turns(name) else "m") for name in self.coordinates]
        if kind == "json":
            refuse_conditions(self, "A list of limits")
            record = chains_record(
                self.name, units, self.home.tolist(), self.linear_limits, list(zip(names, marks, rules, strict=True))
            )
            file.write_text(json.dumps(record, indent=1, allow_nan=False) + "\n", encoding="utf-8")
            return (file,)
        if kind == "ros2":
            refuse_conditions(self, "A list of limits")
            places = [(one, self.coordinates.index(one.coordinates[0]) if one.coordinates else 0) for one in chosen]
            known = [
                (b.name, b.coordinates, b.limits(b.coordinates[0], self.home).around(float(self.home[place])))
                if len(b.coordinates) == 1
                else (b.name, b.coordinates, None)
                for b, place in places
            ]
            words = [unit for _, unit in units]
            text = ros2_text(self.name, self.coordinates, self.linear_limits, known, words)
            file.write_text(text, encoding="utf-8")
            return (file,)
        if kind != "c":
            raise UnknownNameError("kind of export", kind, ("c", "json", "ros2"))
        searched = [name for name, rule in zip(names, rules, strict=True) if not is_closed(rule)]
        if searched:
            said = f"the C export has no iteration for the nearest points of {', '.join(searched)} (boxes, prisms)"
            raise UnsupportedError(f"{said}; name the other boundaries, or cover these bodies by capsules")
        if file.suffix != ".c":
            raise DimensionError(f"{file.name} does not end in .c; the header takes the same name, ending in .h")
        nodes = signed_nodes(rules, marks, len(self.coordinates), chosen.common)
        header, source = c_files(nodes, self.name, units, names, file.stem)
        file.write_text(source, encoding="ascii")
        file.with_suffix(".h").write_text(header, encoding="ascii")
        return file, file.with_suffix(".h")

    def plot(self, q: ArrayLike | None = None, ax: Any = None, region: Any = None) -> Any:
        """Draw joints, marks and their nearest points at one q, from the side in which the robot moves, in millimetres.

        Args:
            q: (n,) the configuration [rad or m]; home by default.
            ax: Matplotlib axes to draw in; None: axes of a new figure, `ax.figure`.
            region: A `Region` of this robot that is shown beside it: a boundary has the colour that it has there.

        Returns:
            The axes.

        Raises:
            UnsupportedError: If matplotlib is not installed; the message says what to type.
            DimensionError: If q is not one finite configuration.

        Example:
            >>> import pinbound as pb
            >>> ax = pb.load("minervabot_v3").plot([0.0, 0.3, 0.2])
            >>> ax.get_xlabel(), ax.get_ylabel()
            ('x [mm]', 'z [mm]')
        """
        point = self.home if q is None else one_configuration(q, self.coordinates)
        return drawn("plots.robot_axes", self, point, ax, region)

    def on(self, model: Any) -> ModelView:
        """Return the boundaries as functions of the q of a user's own `pinocchio.Model`, with gradients over its v.

        The model may have a free flyer, continuous joints as (cos, sin), mimic joints as separate joints
        (`mimic=False`) or not, and locked joints (`pinocchio.buildReducedModel`), whose values are read from it. This
        method proves that it is a model of this robot. The model is not changed and not kept.

        Raises:
            DimensionError: If it is not a model of this robot, or if it locks mimic joints whose primary joints move.

        Example:
            >>> import pinbound as pb, numpy as np
            >>> robot = pb.load("minervabot_v3")
            >>> view = robot.on(robot.model)
            >>> q = robot.to_pinocchio(robot.model, robot.home)
            >>> view.clearances(q).shape, view.gradients(q).shape
            ((10,), (10, 11))
        """
        joints = read_model(self.tree, self.coupling, model, self.home)
        return ModelView.of(self.boundaries, self.coupling, joints, self.home)

    def from_pinocchio(self, model: Any, q: ArrayLike, near: ArrayLike | None = None) -> Array:
        """Return this robot's Q for the q of your own model; the inverse of `to_pinocchio`.

        Args:
            model: As for `on`. If many q come one by one, bind the model once with `on`.
            q: (model.nq,) or (N, model.nq).
            near: (n,) reference for joints that the model stores as cos and sin, without the number of turns: the
                nearest angle is used. Default: home.

        Returns:
            (n,) or (N, n).

        Raises:
            DimensionError: If it is not a model of this robot, if q has another shape, or if a mimic joint does not fit
                its primary joint.

        Example:
            >>> import pinbound as pb
            >>> robot = pb.load("minervabot_v3")
            >>> robot.from_pinocchio(robot.model, robot.to_pinocchio(robot.model, [0.1, 0.2, 0.3])).tolist()
            [0.1, 0.2, 0.3]
        """
        return self.on(model).configurations(q, near)

    def to_pinocchio(self, model: Any, Q: ArrayLike) -> Array:
        """Return the q of a model that the user built from this URDF; joints are matched by name.

        It works for `mimic=True` and `mimic=False`, for continuous joints (cos, sin), and for a model with a free flyer
        at its root, whose coordinates stay neutral.

        Args:
            model: A `pinocchio.Model`; it is not changed.
            Q: One q (n,) or many (N, n) of this robot.

        Returns:
            (model.nq,) or (N, model.nq).

        Raises:
            DimensionError: If the model has a joint with one coordinate that this robot does not have.
        """
        import pinocchio

        check_model(model)
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


def check_robot(robot: Any) -> None:
    """Refuse what is no robot, such as its name.

    Raises:
        DimensionError: If it is none.
    """
    if not isinstance(robot, Robot):
        raise DimensionError(f"robot is of type {type(robot).__name__}; give a Robot, e.g. pinbound.load(...)")


def refuse_conditions(robot: Robot, answer: str) -> None:
    """Refuse rules with conditions, for a method that needs every limit to hold everywhere.

    Raises:
        UnsupportedError: If the robot has such a rule; the message names it.
    """
    if robot.guarded_limits:
        first = robot.guarded_limits[0].rule
        message = f"{answer} cannot express that rule {first!r} applies only where its condition holds"
        raise UnsupportedError(f"{message}. Remove the condition: the rule then applies everywhere")
