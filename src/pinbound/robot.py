"""load() and Robot: what users hold."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pinbound.annotations import Annotations, Line, Mark, Plane, RawItem, raw_items, read_inline, validate
from pinbound.boundary import Boundary
from pinbound.boundary_set import BoundarySet
from pinbound.closures import Closure
from pinbound.coupling import Coupling, LinearLimit, as_configurations, couple, linear_limits
from pinbound.document import Document, read_document
from pinbound.exceptions import (
    DimensionError,
    PinboundError,
    Problems,
    UnknownNameError,
    UnsupportedError,
    name_hint,
)
from pinbound.interpreters import numeric
from pinbound.parallelograms import settle
from pinbound.path import absolute_chain, direction_chain, relative_path
from pinbound.tolerances import HOME, LONGEST
from pinbound.tree import Tree
from pinbound.urdf import Kinematics, Mimic, build_model, read_kinematics

if TYPE_CHECKING:
    from pinbound.interpreters.kernel import CommonMark

__all__ = ["Robot", "load"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Robot:
    """A robot with its coupling, closures and boundaries. Made by `load`; never changed afterwards.

    Attributes:
        document: The XML that it was read from.
        tree: Links and joints.
        annotations: What was marked on it.
        coupling: `theta = S q + o`.
        linear_limits: Limits of all tree joints, said of q.
        closures: Closed loops, each proven to close.
        boundaries: The boundaries, in order.
        home: (n,) a feasible configuration [rad or m].
        notes: What was normalised on loading.
        package_dirs: Folders in which `package://` is looked up.
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
        """(n,) lower limits of the active joints themselves [rad or m]; -inf where there is none."""
        return self._ends("lower")

    @cached_property
    def upper(self) -> Array:
        """(n,) upper limits of the active joints themselves [rad or m]; inf where there is none."""
        return self._ends("upper")

    def _ends(self, end: str) -> Array:
        joints = {joint.name: joint for joint in self.tree.moving_joints}
        values = np.array([float(getattr(joints[name], end)) for name in self.coordinates])
        values.flags.writeable = False
        return values

    def turns(self, joint: str) -> bool:
        """Return whether a joint's value is an angle [rad], not a length [m]."""
        return any(one.name == joint and one.type != "prismatic" for one in self.tree.moving_joints)

    @cached_property
    def model(self) -> Any:
        """The `pinocchio.Model` of the whole tree, one coordinate a moving joint, in `coupling.joints`' order.

        Example:
            >>> robot = load("minervabot_v3")
            >>> robot.model.nq == len(robot.coupling.joints) == 11
            True
        """
        model = build_model(self.document, self.tree.kinematics)
        if tuple(model.names)[1:] != self.coupling.joints:
            raise PinboundError(f"Pinocchio orders the joints as {tuple(model.names)[1:]}, not {self.coupling.joints}")
        return model

    def closure_residuals(self, Q: ArrayLike) -> Array:
        """Return the gap of every closure, (n_closures,) or (N, n_closures) [m].

        Example:
            >>> robot = load("minervabot_v3")
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
            >>> load("minervabot_v3").positions("link_6", [0.0, 0.0, 0.0]).round(5).tolist()
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
            >>> load("minervabot_v3").operation_counts("beta_5")
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


def load(
    robot: str | Path,
    annotations: str | Path | Annotations | None = None,
    package_dirs: Sequence[str | Path] = (),
    xacro_args: Mapping[str, Any] | None = None,
) -> Robot:
    """Load a robot with its boundaries.

    Args:
        robot: Name of a packaged robot (e.g. ``"minervabot_v3"``), or a path to a `.urdf` or `.xacro`.
        annotations: Path of a YAML sidecar or of an .srdf with spheres, or `Annotations`; they add to what is inline.
            By default `NAME.pinbound.yaml` beside the file, where it exists.
        package_dirs: Folders in which `package://` is looked up when geometry is read.
        xacro_args: Arguments of a xacro file.

    Returns:
        The robot, every closure proven to close and home proven to be free.

    Raises:
        InputError: If anything is wrong with the files: all faults at once, each with its line and remedy.

    Example:
        >>> robot = load("minervabot_v3")
        >>> robot.coordinates, robot.boundaries["beta_5"].coordinates
        (('q1', 'q2', 'q3'), ('q3',))
        >>> load("minervabot_v3", xacro_args={"bridge": "as_printed"}).boundaries["beta_5"].coordinates
        ('q2',)
    """
    document = read_document(robot, {key: str(value) for key, value in (xacro_args or {}).items()})
    problems = Problems(document.label)
    items = [*read_inline(document.root, problems), *_given_items(document, annotations, problems)]
    links, joints = ([str(e.get("name")) for e in document.root.findall(tag)] for tag in ("link", "joint"))
    marks = validate(items, problems, links, joints)
    faults = len(problems.found)
    kinematics = read_kinematics(
        document,
        problems,
        limits={mark.joint: (mark.lower, mark.upper) for mark in marks.limits},
        followers={mark.joint: Mimic(mark.primary, mark.multiplier, mark.offset) for mark in marks.followers},
    )
    _check_lengths(kinematics, marks, problems)
    if len(problems.found) > faults:
        problems.raise_if_any()
    tree = Tree(kinematics, {mark.link for mark in marks.marks.values()})
    coupling, closures, coupled = settle(tree, couple(tree.moving_joints), marks, problems)
    limits = linear_limits(tree.moving_joints, coupling)
    home, notes = _home(tree, coupling, marks, limits, problems)
    boundaries = _boundaries(tree, coupling, marks, home, problems)
    problems.raise_if_any()
    return Robot(
        document=document,
        tree=tree,
        annotations=marks,
        coupling=coupling,
        linear_limits=limits,
        closures=closures,
        boundaries=BoundarySet(
            boundaries, coupling.coordinates, limits, home, partial(_common_marks, tree, coupling, boundaries)
        ),
        home=home,
        notes=(*kinematics.notes, *coupled, *notes),
        package_dirs=tuple(map(str, package_dirs)),
    )


def _given_items(document: Document, given: str | Path | Annotations | None, problems: Problems) -> list[RawItem]:
    if isinstance(given, Annotations):
        return raw_items(given, "annotations")
    stem = document.path.name.removesuffix(".xacro").removesuffix(".urdf")
    path = document.path.with_name(f"{stem}.pinbound.yaml") if given is None else Path(given)
    if given is None and not path.is_file():
        return []
    from pinbound.annotations.sidecar import read_sidecar
    from pinbound.annotations.srdf import read_srdf

    return read_srdf(path, problems) if path.suffix == ".srdf" else read_sidecar(path, problems)


def _check_lengths(kinematics: Kinematics, marks: Annotations, problems: Problems) -> None:
    """Refuse lengths whose squares, and products of four, overflow."""
    remedy = f"Give metres; lengths up to {LONGEST:.0e} m can be measured"
    for joint in kinematics.joints:
        longest = float(np.abs(joint.translation).max())
        if joint.type == "prismatic" and joint.mimic is not None:
            longest = max(longest, abs(joint.mimic.offset))
        if longest > LONGEST:
            problems.add(f"joint {joint.name!r} has an offset of {longest:.3g} m", remedy, joint.line)
    for mark in marks.marks.values():
        longest = max(max(map(abs, anchor)) for anchor in mark.anchors)
        if longest > LONGEST:
            problems.add(f"mark {mark.name!r} is {longest:.3g} m from the origin of its link", remedy, mark.line)


def _home(
    tree: Tree, coupling: Coupling, marks: Annotations, limits: Sequence[LinearLimit], problems: Problems
) -> tuple[Array, list[str]]:
    """Return home: what is marked, else zero, else (zero being out of limits) the middle of the limits."""
    names, joints = coupling.coordinates, {joint.name: joint for joint in tree.moving_joints}
    home, notes = np.zeros(len(names)), list[str]()
    for name in marks.home:
        if name not in names and (name not in joints or joints[name].mimic is not None):
            what = "follows another joint" if name in joints else "does not exist"
            problems.add(f"home names {name!r}, which {what}", name_hint(name, names), marks.home_line)
    for index, name in enumerate(names):
        lower, upper = joints[name].lower, joints[name].upper
        if name in marks.home:
            home[index] = marks.home[name]
        elif not lower <= 0.0 <= upper:
            home[index] = (lower + upper) / 2
            notes.append(f"home of {name!r} is the middle of its limits, {home[index]:.6g}: zero is outside them")
    for name, value in marks.home.items():
        if name in names or name not in joints or joints[name].mimic is not None:
            continue
        coefficients, offset = coupling.row(name)
        expected = float(coefficients @ home) + offset
        if abs(value - expected) > HOME:
            message = f"home has {name!r} at {value:.9g}, but the closed loops put it at {expected:.9g}"
            problems.add(message, "Leave it out, or give the assembled pose exactly", marks.home_line)
    for limit in limits:
        theta = float(limit.coefficients @ home) + limit.offset
        if marks.home and not limit.lower <= theta <= limit.upper:
            message = f"home is outside the limits of {limit.joint!r}: {theta:.6g} is not in"
            message += f" [{limit.lower:.6g}, {limit.upper:.6g}]"
            problems.add(message, "Choose a home inside all limits", marks.home_line)
    home.flags.writeable = False
    return home, notes


def _boundaries(tree: Tree, coupling: Coupling, marks: Annotations, home: Array, problems: Problems) -> list[Boundary]:
    """Return the boundaries; those that are in contact at home are faults."""
    boundaries: list[Boundary] = []
    for mark in marks.boundaries:
        a, b = marks.marks[mark.a], marks.marks[mark.b]
        try:
            path = relative_path(tree, coupling, a, b)
        except UnsupportedError as error:
            problems.add(f"boundary {mark.name!r}: {error}", "Choose other points", mark.line)
            continue
        boundary = Boundary(mark.name, a, b, mark.min_distance, path, coupling.coordinates, marks.contact_tolerance)
        boundaries.append(boundary)
        clearance = float(boundary.clearance(home))
        if clearance <= max(0.0, marks.contact_tolerance - boundary.threshold):
            message = f"home is outside the feasible region: {mark.name!r} has a clearance of {1e3 * clearance:.6g} mm"
            remedy = "Choose a free home, or mend the points and distances of this boundary"
            problems.add(message, remedy, marks.home_line or mark.line)
    return boundaries


def _common_marks(tree: Tree, coupling: Coupling, boundaries: Sequence[Boundary]) -> dict[str, CommonMark]:
    """Return every mark's chains in the root's frame; of lines and planes a point and the unit direction."""
    from pinbound.interpreters.kernel import CommonMark

    def placed(mark: Mark) -> CommonMark:
        if isinstance(mark, Line | Plane):
            point = absolute_chain(tree, coupling, mark.link, mark.xyz)
            unit = direction_chain(tree, coupling, mark.link, mark.upright)
            return CommonMark((point, unit), "line" if isinstance(mark, Line) else "plane")
        return CommonMark(tuple(absolute_chain(tree, coupling, mark.link, xyz) for xyz in mark.anchors))

    marks = {mark.name: mark for boundary in boundaries for mark in (boundary.point_a, boundary.point_b)}
    return {name: placed(mark) for name, mark in marks.items()}
