"""Proposes marks that hold a robot's bodies, and a boundary for every pair that can collide.

Every pair that is left out has a reason that is proven or that a reader can judge. Bodies that cannot be covered are
named, because no boundary is about them. Marks of the user stay unchanged.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pinbound.annotations import Annotations, BoundaryMark, LeftOutMark
from pinbound.coverage.bodies import SHAPES, Body, LinkBodies, read_bodies
from pinbound.coverage.covers import BY, By, Cover, Progress, covers, parts_allowed
from pinbound.coverage.records import hollow_note
from pinbound.exceptions import Problems, UnknownNameError
from pinbound.marking.candidates import home_entries
from pinbound.marking.evidence import Evidences
from pinbound.marking.homes import choose_home, home_note
from pinbound.marking.judge import (
    ALWAYS,
    AT_HOME,
    IN_ALL,
    NEVER,
    Evidence,
    Judge,
    count_uncovered,
    moving_pairs,
)
from pinbound.marking.kept import kept, known, unused
from pinbound.marking.narrow import Pair
from pinbound.robot.robot import Robot, check_robot
from pinbound.values import FrozenDict, Value

__all__ = ["ALL_SHAPES", "Proposal", "left_out_marks", "propose_marks"]


ALL_SHAPES = (*SHAPES, "mesh")
"""The shapes that can be covered."""
_FINEST = 0.01  # of a body's smallest size: the accuracy for bodies whose marks touch at home


@dataclass(frozen=True)
class Proposal(Value):
    """Proposed marks for a robot, and the pairs that are left out.

    Attributes:
        annotations: Marks, boundaries and home, to save as a sidecar. They include the content of the robot's own
            sidecar (limits, mimic joints, closures, marks, assumptions), but not the annotations inside the URDF. So
            the new file can replace the sidecar.
        covers: The covered bodies, each with its excess [m].
        uncovered: Bodies that no mark holds: meshes, other shapes, or shapes that were not requested.
        left_out: The number of left-out pairs, by pair of links and reason. Pairs of marks are counted, or pairs of
            bodies if one body is not covered. It holds every pair of links with bodies that is not watched, or only
            watched in part.
        home_note: Whether and why home was changed; empty if home is unchanged and no pair touches there.
        touching: Pairs of marks that are in contact at the robot's home and apart elsewhere, and their signed distance
            [m], which is minus the depth if they overlap.
        notes: One sentence for each part of the geometry that was ignored.
        evidence: The evidence for each reason, by the keys of `left_out`: a proof, a witness, samples, or only custom.
        judge: The object that judged the pairs; `disabled_pairs` uses its results again.

    Example:
        >>> import pinbound as pb
        >>> ball = '<collision><geometry><sphere radius="0.1"/></geometry></collision>'
        >>> proposal = pb.propose_marks(pb.load(f'<robot name="one"><link name="a">{ball}</link></robot>'))
        >>> proposal.covers[0].excess, proposal.uncovered, list(proposal.annotations.boundaries)
        (0.0, (), [])
    """

    annotations: Annotations
    covers: tuple[Cover, ...]
    uncovered: tuple[Body, ...]
    left_out: dict[tuple[str, str, str], int]
    home_note: str = ""
    touching: Mapping[tuple[str, str], float] = field(default_factory=dict[tuple[str, str], float])
    notes: tuple[str, ...] = ()
    evidence: Mapping[tuple[str, str, str], Evidence] = field(default_factory=dict[tuple[str, str, str], Evidence])
    judge: Judge | None = field(default=None, compare=False, repr=False)

    @property
    def excess(self) -> float:
        """[m], the largest excess of a cover. In a refused configuration, bodies may be up to twice this apart."""
        return max((one.excess for one in self.covers), default=0.0)


def propose_marks(
    robot: Robot,
    accuracy: float = 0.02,
    shapes: Collection[str] = ALL_SHAPES,
    by: By = "hulls",
    neighbours: bool = False,
    most: int | None = None,
    skip_missing: bool = True,
    progress: Progress | None = None,
) -> Proposal:
    """Return marks that hold the robot's bodies, and a boundary for every pair that can collide.

    These pairs are left out: pairs on one link, on links that never move against each other, on neighbours (one degree
    of freedom between them) unless they are asked for, and pairs that are proven never to meet. Every other pair has
    its boundary, unless its marks touch at home. A given home is kept. Otherwise the home at which the fewest pairs
    touch is proposed; the present home is tried first, and `home_note` says if another one is proposed. Bodies of pairs
    that touch at home are covered again, with the finest polygons. If they still touch, they are left out, because no
    region could contain home. They are counted in three groups: pairs that are proven to overlap always, pairs that
    touch in every sample, and others, for which a better home may exist. `evidence` has the evidence for each reason.

    Args:
        robot: The robot; its own marks and boundaries are kept and not proposed again.
        accuracy: [m], how far a mark may stick out of its body; not always reached.
        shapes: The shapes to cover, some of ``"sphere"``, ``"box"``, ``"cylinder"``, ``"capsule"``, ``"mesh"``.
        by: The marks for meshes: ``"hulls"``, ``"capsules"``, ``"spheres"`` or ``"boxes"``. Other bodies get points,
            capsules, boxes and prisms, which fit closely. With ``"spheres"`` all bodies get spheres: there are many of
            them, they are compiled together, and their regions have curved edges.
        neighbours: Whether to watch neighbours, too, if their marks do not touch at home.
        most: The largest number of marks for the meshes of one link; None: 8, or 32 if the accuracy is below 10 mm.
        skip_missing: Whether a mesh that cannot be read is only listed as not covered, with the reason in `notes`.
            Otherwise it is an error.
        progress: Called with the number of finished links with meshes, their total number, and the name of the next
            link.

    Returns:
        The proposal; `proposal.annotations.save(path)` writes the sidecar.

    Raises:
        UnknownNameError: If a shape or `by` is none of these.
        DimensionError: If the accuracy is not positive.
        InputError: If the geometry of a body has faults; the error lists all of them.
        UnsupportedError: If no configuration keeps all limits, or if distances are too large to compute.

    Example:
        >>> import pinbound as pb
        >>> ball = '<collision><geometry><sphere radius="0.1"/></geometry></collision>'
        >>> two = f'<robot name="two"><link name="a">{ball}</link><link name="b">{ball}</link>'
        >>> two += '<joint name="j" type="prismatic"><parent link="a"/><child link="b"/><axis xyz="1 0 0"/>'
        >>> two += '<limit lower="0.3" upper="1" effort="1" velocity="1"/></joint></robot>'
        >>> proposal = pb.propose_marks(pb.load(two))
        >>> proposal.uncovered, [reason for _, _, reason in proposal.left_out]
        ((), ['neighbours'])
    """
    check_robot(robot)
    for shape in shapes:
        if shape not in ALL_SHAPES:
            raise UnknownNameError("shape", shape, ALL_SHAPES)
    if by not in BY:
        raise UnknownNameError("cover", by, BY[:-1])
    problems = Problems(robot.document.label)
    read = read_bodies(robot.document, problems)
    problems.raise_if_any()
    asked = [body for body in read.bodies if body.shape in shapes]
    meshes, said = _readable(robot, [body for body in asked if body.shape == "mesh"], skip_missing)
    read = replace(read, notes=(*read.notes, *said))
    of_meshes = covers(meshes, accuracy, by, robot.meshes, most, progress)
    chosen = [body for body in asked if body.shape != "mesh"]
    judge = Judge(robot, neighbours)
    place = {body: place for place, body in enumerate(read.bodies)}

    def together(*found: Cover) -> list[Cover]:
        return sorted((*found, *of_meshes), key=lambda one: place[one.bodies[0]])

    proposal, touching = _proposal(judge, together(*covers(chosen, accuracy, by)), read)
    if touching and by != "spheres":
        sizes = [size for body in chosen if body.link in touching for size in body.size if size > 0.0]
        finest = min((accuracy, *(_FINEST * size for size in sizes)))
        again = covers([body for body in chosen if body.link in touching], finest)
        rest = covers([body for body in chosen if body.link not in touching], accuracy)
        proposal, _ = _proposal(judge, together(*rest, *again), read)
    hollow = hollow_note(one.link for one in proposal.covers if one.proof is not None and len(one.marks) > 1)
    more = filter(None, [_not_reached(proposal.covers, accuracy, parts_allowed(accuracy, most)), hollow])
    return replace(proposal, notes=(*proposal.notes, *more), judge=judge)


def _not_reached(found: Sequence[Cover], accuracy: float, most: int) -> str:
    """Return a note about links whose covers do not reach the accuracy, and what to do; empty if there are none."""
    wide: dict[str, float] = {}
    parts: Counter[str] = Counter()
    for one in found:
        if one.proof is not None:
            parts[one.link] += len(one.marks)
            if one.excess > accuracy:
                wide[one.link] = max(one.excess, wide.get(one.link, 0.0))
    if not wide:
        return ""
    listed = ", ".join(f"{link} by {1e3 * excess:.2f} mm" for link, excess in wide.items())
    capped = any(parts[link] >= most for link in wide)
    hint = f"allow more than {most} marks per link: --most {2 * most}, most={2 * most}" if capped else "no cut helps"
    return f"marks stick out of meshes by more than the requested {1e3 * accuracy:g} mm ({listed}); {hint}"


def _readable(robot: Robot, bodies: Sequence[Body], skip_missing: bool) -> tuple[list[Body], list[str]]:
    """Return the bodies whose meshes can be read, and notes about these and the others."""
    faults = {body: robot.meshes.fault(body) for body in bodies}
    if any(faults.values()) and not skip_missing:
        problems = Problems(robot.document.label)
        for body, fault in faults.items():
            if fault:
                remedy = "Correct it, or leave such bodies uncovered: --skip-missing, skip_missing=True"
                problems.add(f"the mesh of {body.name!r} cannot be read: {fault.rstrip('.')}", remedy, body.line)
        problems.raise_if_any()
    notes = [note for body in bodies for note in robot.meshes.notes(body)]
    notes += [
        f"{body.name} of {body.link} is not covered: {fault.rstrip('.')}" for body, fault in faults.items() if fault
    ]
    return [body for body, fault in faults.items() if not fault], [*dict.fromkeys(notes)]


def _proposal(judge: Judge, found: Sequence[Cover], read: LinkBodies) -> tuple[Proposal, set[str]]:
    """Return the proposal with these covers, and the links of which a pair touches at home because of its covers."""
    robot = judge.robot
    held = known(robot, found)
    taken = {body for one in held for body in one.bodies}
    uncovered = tuple(body for body in read.bodies if body not in taken)
    excess = {mark.name: one.excess for one in held for mark in one.marks}
    left_out: dict[tuple[str, str, str], int] = {}
    pairs, spare = moving_pairs(judge, [mark for one in held for mark in one.marks], left_out)
    count_uncovered(judge, read.bodies, uncovered, left_out)
    contact = np.array([pair.contact for pair in pairs]).reshape(len(pairs), len(judge.Q))
    always = np.all(contact, axis=1)
    home = choose_home(judge, np.sum(contact[~always], axis=0))
    own = kept(robot)
    watched = {frozenset((mark.a, mark.b)) for mark in robot.annotations.boundaries}
    named = {mark.name for mark in robot.annotations.boundaries}
    boundaries: list[BoundaryMark] = []
    dropped: dict[tuple[str, str, str], list[Pair]] = {}
    touching: set[str] = set()
    for pair, touches in zip(pairs, contact, strict=True):
        a, b = pair.a, pair.b
        if not touches[home.chosen]:
            if frozenset((a.name, b.name)) not in watched:
                boundaries.append(BoundaryMark(unused(f"{a.name}-{b.name}", named), a.name, b.name))
        else:
            key = a.link, b.link, _why_in_contact(pair)
            left_out[key] = left_out.get(key, 0) + 1
            dropped.setdefault(key, []).append(pair)
        if (touches[home.chosen] or touches[0]) and excess[a.name] + excess[b.name] > 0.0:
            touching |= {a.link, b.link}
    used = {name for boundary in boundaries for name in (boundary.a, boundary.b)} - set(robot.annotations.marks)
    # All marks of a cover together hold a body, so they are written together.
    whole = [mark for one in held if used & {mark.name for mark in one.marks} for mark in one.marks]
    marks = {mark.name: mark for mark in whole if mark.name not in robot.annotations.marks}
    annotations = replace(
        own,
        marks={**own.marks, **marks},
        boundaries=(*own.boundaries, *boundaries),
        home=own.home if robot.annotations.home or not home.can_be_said else home_entries(robot, judge.Q[home.chosen]),
    )
    at_home = [(pair, judge.at_home(pair)) for pair in pairs if pair.contact[0] and not np.all(pair.contact)]
    reasons = FrozenDict(left_out)
    del left_out  # for large robots these are millions of pairs
    proposal = Proposal(
        annotations=annotations,
        covers=tuple(held),
        uncovered=uncovered,
        left_out=reasons,
        home_note=home_note(judge, home, at_home),
        touching={(pair.a.name, pair.b.name): gap for pair, gap in at_home},
        notes=read.notes,
        evidence=Evidences(judge, reasons, spare, dropped, judge.Q[home.chosen]),
    )
    said = dict.fromkeys(annotations.left_out)
    stated = (*said, *(one for one in left_out_marks(proposal) if not said or one not in said))
    return replace(proposal, annotations=replace(annotations, left_out=stated)), touching


def _why_in_contact(pair: Pair) -> str:
    """Return why two marks that touch at the proposed home are not watched."""
    if pair.always is not None:
        return ALWAYS
    return f"{IN_ALL} {len(pair.contact)} sampled configurations" if np.all(pair.contact) else AT_HOME


def left_out_marks(proposal: Proposal) -> tuple[LeftOutMark, ...]:
    """Return the statements of a proposal's sidecar about pairs of links that it leaves out.

    It states pairs that can never meet, pairs that always overlap, and pairs that overlap in every sample. It does not
    state neighbours and links that never move, because `robot.coverage` finds them itself. It does not state pairs that
    touch at home only, or that are not covered: they stay open, because there is no reason to leave them out.
    """
    annotations = proposal.annotations
    marks = annotations.marks
    watched = {frozenset((marks[one.a].link, marks[one.b].link)) for one in annotations.boundaries}
    counts = proposal.left_out
    keys = [key for key in counts if key[2] in (NEVER, ALWAYS) or key[2].startswith(IN_ALL)]
    keys.sort()
    stated: list[LeftOutMark] = []
    for key in keys:
        a, b, reason = key
        some = f"{counts[key]} pairs of marks: " if frozenset((a, b)) in watched else ""
        stated.append(LeftOutMark(a, b, some + reason))
    return tuple(stated)
