"""load(): makes a robot from its files; one error lists all faults of the files."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pinbound.annotations import Annotations, HullFiles, Mark, Measure, RawItem, raw_items, read_inline, validate
from pinbound.annotations.records import kind_of
from pinbound.boundaries.boundary import Boundary
from pinbound.boundaries.boundary_set import BoundarySet
from pinbound.contact import stop_fault
from pinbound.exceptions import Problems, UnsupportedError, name_hint
from pinbound.loops.closures import Closure, close, joint_errors, place_error
from pinbound.loops.loop_errors import carry, narrowed
from pinbound.loops.parallelograms import settle
from pinbound.model.coupling import Coupling, GuardedLimit, LinearLimit, couple, linear_limits, narrowed_by_mimics
from pinbound.model.document import Document, read_document
from pinbound.model.kinematics import Kinematics
from pinbound.model.normalise import normalise
from pinbound.model.pinocchio_model import compare_with_pinocchio, placements
from pinbound.model.tree import Tree
from pinbound.model.urdf import Mimic, read_kinematics
from pinbound.path.relative import absolute_chain, direction_chain, relative_path
from pinbound.path.shared import link_spots, moved
from pinbound.robot import load_arguments
from pinbound.robot.axes import joint_home, new_coordinates
from pinbound.robot.home import feasible_start
from pinbound.robot.mark_notes import excesses, marked_degrees
from pinbound.robot.presets import FAMILY, PREFIX, find_model
from pinbound.robot.robot import Robot
from pinbound.robot.rules import place_of_limit, rule_limits
from pinbound.tolerances import CONTACT, HOME, LONGEST, NEAR_STOP, PLACED
from pinbound.typing import Array

if TYPE_CHECKING:
    from pinbound.kernel import CommonMark
    from pinbound.loops.lift import Lift

__all__ = ["AnnotationSource", "load"]

AnnotationSource = str | Path | Annotations


def load(
    robot: str | Path,
    annotations: AnnotationSource | Sequence[AnnotationSource] | None = None,
    package_dirs: Sequence[str | Path] | str | Path = (),
    xacro_args: Mapping[str, Any] | None = None,
    trust: str = "xacro",
) -> Robot:
    """Load a robot with its boundaries.

    Args:
        robot: Name of a packaged robot (e.g. ``"minervabot_v3"``), of a preset (``"palletizers/fanuc_m410ib_700"``;
            `pinbound robots` lists them), a path to a `.urdf` or `.xacro`, or the text of a URDF (it begins with `<`).
        annotations: A path to a YAML sidecar, to an .srdf, or to a file with the loops of the robot (`robot.yaml` of
            Gepetto's toolbox, an MJCF .xml); or `Annotations`; or a sequence of these. They are added to the
            annotations inside the URDF. By default `NAME.pinbound.yaml` beside the file is used, if it exists.
        package_dirs: Folders (or one folder) that hold ROS packages, or are packages, for `package://` of meshes and
            for `$(find name)` of xacro. xacro also searches `ROS_PACKAGE_PATH`, `AMENT_PREFIX_PATH`, and beside the
            file.
        xacro_args: Arguments of a xacro file; each must be declared in it, or in an included file.
        trust: `"urdf-only"` refuses xacro files, because they can run code. Packaged robots are always accepted.

    Returns:
        The robot; every closure is proven to close, and home is proven to be free.

    Raises:
        InputError: If the files have faults; the error lists all of them with lines and remedies. Or if an argument is
            of another type.

    Example:
        >>> robot = load("minervabot_v3")
        >>> robot.coordinates, robot.boundaries["beta_5"].coordinates
        (('q1', 'q2', 'q3'), ('q3',))
        >>> load("minervabot_v3", xacro_args={"bridge": "as_printed"}).boundaries["beta_5"].coordinates
        ('q2',)
    """
    load_arguments.check_robot_source(robot)
    folders, arguments = load_arguments.folders_of(package_dirs), load_arguments.xacro_arguments(xacro_args)
    model = find_model(robot)
    if model is not None:
        more = () if annotations is None else load_arguments.annotation_sources(annotations)
        annotations, robot = (model.annotations(arguments), *more), FAMILY
        arguments = model.arguments | arguments
    document = normalise(read_document(robot, arguments, folders, trust))
    if model is not None and model.name is not None:
        document.root.set("name", model.name.removeprefix(PREFIX))
    problems = Problems(document.label)
    given, said = _given_items(document, annotations, problems)
    items = [*read_inline(document.root, problems), *given]
    said += load_arguments.missing_folders(folders)
    return _made(document, items, said, folders, problems, HullFiles(document.path, folders))


@dataclass(frozen=True)
class _Again:
    """Makes a robot again with more annotations, from the data that were read from its files.

    Attributes:
        document: The normalised document.
        items: Raw items of all annotations.
        said: Notes on annotations that were not used.
        package_dirs: The folders of packages, as for the robot.
        files: The meshes that hulls have named so far; they are not read again.
    """

    document: Document
    items: tuple[RawItem, ...]
    said: tuple[str, ...]
    package_dirs: tuple[str, ...]
    files: HullFiles

    def __call__(self, robot: Robot, more: AnnotationSource | Sequence[AnnotationSource]) -> Robot:
        """Return the robot with `more` in addition to its annotations."""
        problems = Problems(self.document.label)
        items, said = _given_items(self.document, more, problems)
        items, said = [*self.items, *items], [*self.said, *said]
        return _made(self.document, items, said, self.package_dirs, problems, self.files, robot.annotations)


def _made(
    document: Document,
    items: Sequence[RawItem],
    said: Sequence[str],
    package_dirs: tuple[str, ...],
    problems: Problems,
    files: HullFiles,
    compared: Annotations | None = None,
) -> Robot:
    """Return the robot of a document and raw items.

    `compared` are annotations for which the document was already compared with Pinocchio's reading, and agreed.
    """
    links, joints = ([str(e.get("name")) for e in document.root.findall(tag)] for tag in ("link", "joint"))
    marks = validate(items, problems, links, joints, files)
    faults = len(problems.found)
    kinematics = read_kinematics(
        document,
        problems,
        limits={mark.joint: (mark.lower, mark.upper) for mark in marks.limits},
        followers={mark.joint: Mimic(mark.primary, mark.multiplier, mark.offset) for mark in marks.followers},
        places={m.joint: (m.line, marks.sources.get(f"follower {m.joint}")) for m in marks.followers},
    )
    _check_lengths(kinematics, marks, problems)
    if marks.axes:
        place = marks.home_line, marks.sources.get("home")
        marks = replace(marks, home=joint_home(marks.home, marks.axes, problems, *place))
    if len(problems.found) > faults:
        problems.raise_if_any()
    tree = Tree(kinematics, {mark.link for mark in marks.marks.values()})
    if compared is None or (compared.limits, compared.followers) != (marks.limits, marks.followers):
        replaced = {mark.joint for mark in marks.limits}, {mark.joint for mark in marks.followers}
        compare_with_pinocchio(document, tree, problems, *replaced)
    settled = settle(tree, couple(tree.moving_joints), marks, problems)
    lift: Lift | None = None
    if settled.linkages:
        from pinbound.robot.loop_loading import opened_loops  # late, here and below: few robots have such loops

        settled, lift = opened_loops(tree, settled, marks, problems)
    coupling = settled.coupling
    limits = linear_limits(tree.moving_joints, coupling)
    closures, errors = carry(tree, settled, marks, limits, problems)
    closures = (*closures, *settled.linked)
    off = joint_errors(coupling, closures)
    limits = narrowed(limits, coupling, off)
    own = narrowed_by_mimics(tree.moving_joints, coupling, limits)
    if lift is not None:
        from pinbound.robot.loop_loading import toggles

        limits = (*limits, *toggles(lift, marks))
    taken = [boundary.name for boundary in marks.boundaries]
    rules, guarded = rule_limits(marks.rules, coupling, off, problems, taken, marks.sources)
    limits = (*limits, *rules)
    if lift is None:
        home, notes = _home(tree, coupling, marks, limits, guarded, problems)
    else:
        from pinbound.robot.loop_loading import home_of_loops

        home, notes = home_of_loops(tree, coupling, lift, marks, limits, guarded, problems)
    slides = [joint.name for joint in tree.moving_joints if joint.type == "prismatic"]
    change = new_coordinates(marks.axes, coupling, problems, slides, marks.sources)
    if change is not None:
        coupling, home = change.coupling(coupling), change.forward(home)
        limits, guarded = tuple(map(change.limit, limits)), tuple(map(change.guarded, guarded))
        anew = [(close(tree, coupling, one.mark), one) for one in closures]
        closures = tuple(replace(new, deviations=one.deviations, apart=one.apart) for new, one in anew)
        home.flags.writeable = False
    boundaries, stops = _boundaries(tree, coupling, marks, home, problems, limits, closures)
    problems.raise_if_any()
    again = _Again(document, tuple(items), tuple(said), package_dirs, files)
    robot = Robot(
        document=document,
        tree=tree,
        annotations=marks,
        coupling=coupling,
        linear_limits=limits,
        closures=closures,
        boundaries=BoundarySet(
            boundaries, coupling.coordinates, limits, home, partial(_common_marks, tree, coupling, boundaries), guarded
        ),
        home=home,
        notes=(
            *kinematics.notes,
            *said,
            *files.notes,
            *settled.notes,
            *errors,
            *own,
            *notes,
            *stops,
            *marked_degrees(items, marks, slides),
            *excesses(marks),
        ),
        package_dirs=package_dirs,
        again=again,
        guarded_limits=guarded,
    )
    return robot if lift is None else _with_loops(replace(robot, again=None), lift, again)


def _with_loops(robot: Robot, lift: Lift, again: _Again) -> Robot:
    from pinbound.robot.loop_robot import LoopRobot

    return LoopRobot(robot, lift, again)


def _given_items(
    document: Document, given: AnnotationSource | Sequence[AnnotationSource] | None, problems: Problems
) -> tuple[list[RawItem], list[str]]:
    """Return the items of the annotations beside the document, and notes on the parts that were not used."""
    if given is None:
        stem = document.path.name
        for suffix in (".xacro", ".urdf"):
            stem = stem[: -len(suffix)] if stem.lower().endswith(suffix) else stem
        beside = document.path.with_name(f"{stem}.pinbound.yaml")
        given = beside if beside.is_file() else ()
    items, notes = list[RawItem](), list[str]()
    for source in load_arguments.annotation_sources(given):
        found, said = _read_annotations(source, document, problems)
        items += found
        notes += said
    return items, notes


def _read_annotations(
    given: AnnotationSource, document: Document, problems: Problems
) -> tuple[Sequence[RawItem], Sequence[str]]:
    from pinbound.annotations.files import read_annotation_file

    if isinstance(given, Annotations):
        items = raw_items(given, "annotations")
        return items if given.contact_tolerance != CONTACT else items[1:], ()  # a default value replaces nothing
    found = read_annotation_file(Path(given), problems, document)
    return found.items, found.notes


def _check_lengths(kinematics: Kinematics, marks: Annotations, problems: Problems) -> None:
    """Refuse lengths whose squares, or products of four lengths, overflow."""
    remedy = f"Give metres; lengths up to {LONGEST:.0e} m can be measured"
    for joint in kinematics.joints:
        longest = float(np.abs(joint.translation).max())
        if joint.type == "prismatic" and joint.mimic is not None:
            longest = max(longest, abs(joint.mimic.offset))
        if longest > LONGEST:
            problems.add(f"joint {joint.name!r} has an offset of {longest:.3g} m", remedy, joint.line)
    for mark in marks.marks.values():
        longest = float(np.abs(mark.shape.vertices).max())
        if longest > LONGEST:
            source = marks.sources.get(f"{kind_of(mark)} {mark.name}")
            problems.add(
                f"mark {mark.name!r} is {longest:.3g} m from the origin of its link", remedy, mark.line, source
            )


def _home(
    tree: Tree,
    coupling: Coupling,
    marks: Annotations,
    limits: Sequence[LinearLimit],
    guarded: Sequence[GuardedLimit],
    problems: Problems,
) -> tuple[Array, list[str]]:
    """Return home within all limits: the marked values, and those of `feasible_start` for other coordinates."""
    names, joints = coupling.coordinates, {joint.name: joint for joint in tree.moving_joints}
    source = marks.sources.get("home")
    for name in marks.home:
        if name not in names and (name not in joints or joints[name].mimic is not None):
            what = "follows another joint" if name in joints else "does not exist"
            problems.add(f"home names {name!r}, which {what}", name_hint(name, names), marks.home_line, source)
    fixed = np.array([marks.home.get(name, math.nan) for name in names], dtype=np.float64)
    home, reasons = feasible_start(limits, fixed, names, guarded)
    notes: list[str] = []
    if home is None:
        home, where = np.nan_to_num(fixed), marks.home_line if marks.home else None
        for limit in limits:
            if not limit.holds(home[None])[0]:
                value, ends = float(limit.values(home[None])[0]), f"[{limit.lower:.6g}, {limit.upper:.6g}]"
                message = f"home is outside the limits of {limit.joint!r}: {value:.6g} is not in {ends}"
                remedy = "Choose a home inside all limits; angles are in radians"
                if not marks.home:
                    message = f"no configuration keeps all joint limits: at zero {limit.joint!r} is {value:.6g}"
                    message += f", which is not in {ends}"
                    remedy = "Correct the limits, or the multipliers and offsets of mimic joints"
                    where, source = place_of_limit(limit.joint, marks, joints)
                problems.add(message, remedy, where, source)
        for one in guarded:
            if not one.holds(home[None])[0]:
                said = f"rule {one.rule!r} forbids home: its conditions hold there, and its sum is "
                said += f"{float(one.limit.values(home[None])[0]):.6g}, beyond its {one.name.split()[-1]} end"
                problems.add(said, "Choose a home that keeps the rule; angles are in radians", where, source)
    else:
        notes += [
            f"home of {name!r} is {home[names.index(name)]:.6g}, {reason}: zero is outside them"
            for name, reason in reasons.items()
        ]
    for name, value in marks.home.items():
        if name in names or name not in joints or joints[name].mimic is not None:
            continue
        coefficients, offset = coupling.row(name)
        expected = float(coefficients @ home) + offset
        if abs(value - expected) > HOME:
            message = f"home has {name!r} at {value:.9g}, but the closed loops put it at {expected:.9g}"
            problems.add(message, f"Give {name!r} the value {expected:.9g}", marks.home_line, source)
    home.flags.writeable = False
    return home, notes


def _boundaries(
    tree: Tree,
    coupling: Coupling,
    marks: Annotations,
    home: Array,
    problems: Problems,
    limits: Sequence[LinearLimit],
    closures: Sequence[Closure],
) -> tuple[list[Boundary], list[str]]:
    """Return the boundaries, and notes on their stops; a boundary that is in contact at home is a fault."""
    boundaries: list[Boundary] = []
    notes: list[str] = []
    is_apart = _apart_at_home(tree, coupling, home)
    for mark in marks.boundaries:
        a, b = marks.marks[mark.a], marks.marks[mark.b]
        source = marks.sources.get(f"boundary {mark.name}")
        try:
            path = relative_path(tree, coupling, a, b)
            error = place_error(tree, coupling, limits, closures, a, b)
        except UnsupportedError as refused:
            problems.add(f"boundary {mark.name!r}: {refused}", "Choose other points", mark.line, source)
            continue
        if not math.isfinite(error):
            message = (
                f"boundary {mark.name!r} depends on a prismatic joint without limits and on a loop whose sides differ"
            )
            remedy = "Give the prismatic joint limits"
            problems.add(f"{message}: the error of the places of its marks has no bound", remedy, mark.line, source)
            continue
        boundary = Boundary(
            name=mark.name,
            point_a=a,
            point_b=b,
            min_distance=mark.min_distance,
            path=path,
            robot_coordinates=coupling.coordinates,
            contact_tolerance=marks.contact_tolerance,
            place_error=error,
            home=home,
            stop=mark.stop,
        )
        boundaries.append(boundary)
        fault = stop_fault(boundary.rule) if mark.stop else None
        if fault is not None:
            problems.add(f"boundary {mark.name!r} is declared as a stop, but {fault[0]}", fault[1], mark.line, source)
            continue
        notes += _stop_notes(boundary)
        refusal = None if is_apart(boundary) else boundary.rule.refusal_at_home()
        if refusal is not None:
            message = f"home is outside the feasible region: {mark.name!r} {refusal}"
            remedy = "Choose a free home, or correct the points and distances of this boundary"
            place = (marks.home_line, marks.sources.get("home")) if marks.home else (mark.line, source)
            problems.add(message, remedy, *place)
    return boundaries, notes


def _apart_at_home(tree: Tree, coupling: Coupling, home: Array) -> Callable[[Boundary], bool]:
    """Return a function that tells whether two points are certainly apart at home; it needs no relative path."""
    theta = coupling.expand(home)
    names, places = placements(tree, dict(zip(coupling.joints, theta.tolist(), strict=True)))
    of_link = dict(zip(names, places, strict=True))
    slack = PLACED * (sum(float(np.linalg.norm(j.translation)) for j in tree.kinematics.joints) + np.abs(theta).sum())

    def is_apart(boundary: Boundary) -> bool:
        a, b = boundary.point_a, boundary.point_b
        if not (a.shape.is_point and b.shape.is_point) or boundary.rule.is_stop:
            return False
        x, y = (of_link[m.link][:, :3] @ m.shape.origin + of_link[m.link][:, 3] for m in (a, b))
        more = slack + PLACED * (a.shape.reach + b.shape.reach)
        return bool(float(np.linalg.norm(x - y)) > boundary.rule.distance + more)

    return is_apart


def _stop_notes(boundary: Boundary) -> list[str]:
    """Return a note if the points of a stop miss each other, or if a boundary is nearly a stop."""
    miss, names = boundary.rule.miss, f"{boundary.point_a.name} and {boundary.point_b.name} ({boundary.name})"
    if miss is None or miss <= boundary.contact_tolerance:
        return []
    said = f"{names} miss each other by {1e3 * miss:.3g} mm"
    if boundary.is_stop:
        return [f"{said} where their arms align; this is contact all the same, because they are declared as a stop"]
    return [f'{said}; if this is a stop, declare it: stop="true"'] if miss <= NEAR_STOP else []


def _common_marks(tree: Tree, coupling: Coupling, boundaries: Sequence[Boundary]) -> dict[str, CommonMark]:
    """Return every mark's chains in the root's frame; for lines and planes, a point and the unit direction."""
    from pinbound.kernel import CommonMark

    marks = {mark.name: mark for boundary in boundaries for mark in (boundary.point_a, boundary.point_b)}
    links = link_spots(tree, coupling, {mark.link: None for mark in marks.values()})

    def placed(mark: Mark) -> CommonMark:
        shape = mark.shape
        if shape.normal is not None:
            point = partial(absolute_chain, tree, coupling, mark.link, shape.origin.tolist())
            unit = partial(direction_chain, tree, coupling, mark.link, shape.normal.tolist())
            return CommonMark(lambda: (point(), unit()), "plane" if shape.measure is Measure.HEIGHT else "line")
        return CommonMark(
            lambda: tuple(absolute_chain(tree, coupling, mark.link, xyz) for xyz in shape.anchors.tolist()),
            spot=moved(links[mark.link], shape.origin) if shape.is_point else None,
        )

    return {name: placed(mark) for name, mark in marks.items()}
