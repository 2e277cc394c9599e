"""Propose marks for a robot: marks over its bodies, and every pair of them worth checking.

What is left out is left out with a reason that is proven, or that a reader can judge. Bodies that cannot be covered
are named, for the boundaries then say nothing of them. What the user has marked already stays as it is.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import Any, cast

import numpy as np

from pinbound.annotations import MARK_KINDS, Annotations, BoundaryMark, LeftOutMark, Mark, RawItem, read_inline
from pinbound.contact import contact_distance
from pinbound.coverage.bodies import SHAPES, Body, LinkBodies, read_bodies
from pinbound.coverage.covers import By, Cover, covers
from pinbound.coverage.reach import least_separation
from pinbound.evaluate import separation
from pinbound.exceptions import Problems, UnknownNameError, UnsupportedError
from pinbound.loops.closures import place_error
from pinbound.marking.candidates import can_be_home, configuration_text, draw, home_entries, within_limits
from pinbound.path.relative import relative_path
from pinbound.robot.robot import Robot
from pinbound.tolerances import FOLDING, UNIT_ROUNDOFF
from pinbound.typing import Array, Flags, Ints
from pinbound.values import Value

__all__ = ["SHAPES", "Proposal", "left_out_marks", "propose_marks"]

_SAMPLES = 500
_FINEST = 0.01  # of a body's smallest measure: the excess to aim at where marks touch at home
_NAMED = 5  # how many pairs a sentence names

NEIGHBOURS = "neighbours"
RIGID = "never move against each other"
FREE_JOINT = "a free joint lies between"
NEVER = "can never meet"
AT_HOME = "in contact at home"
_ALWAYS = "in contact in all of"


@dataclass(frozen=True)
class Proposal(Value):
    """Marks for a robot, and what they leave out.

    Attributes:
        annotations: Marks, boundaries and home, to save as a sidecar. It repeats what the robot's own sidecar says
            (limits, mimic joints, closures, marks, assumptions), and nothing of what is inside the URDF, so that it
            can take the sidecar's place.
        covers: The bodies that are covered, each with its excess [m].
        uncovered: Bodies that no mark holds: meshes, other shapes, or shapes that were not asked for.
        left_out: Pairs left out, counted by pair of links and reason: pairs of marks, or of bodies if one of the two
            is not covered. Any two links with bodies that no boundary watches are in it; so are two that are watched
            only in part.
        home_note: What was done about home, and why; empty if home is as it was and no pair touches at it.
        touching: Pairs of marks in contact at the robot's home that are apart elsewhere, and their distance less
            the radii [m]: negative is an overlap, and 0 one of boxes or prisms, which have no depth.
        notes: What of the geometry was ignored, a sentence each.
    """

    annotations: Annotations
    covers: tuple[Cover, ...]
    uncovered: tuple[Body, ...]
    left_out: dict[tuple[str, str, str], int]
    home_note: str = ""
    touching: Mapping[tuple[str, str], float] = field(default_factory=dict[tuple[str, str], float])
    notes: tuple[str, ...] = ()

    @property
    def excess(self) -> float:
        """[m], the largest excess of a cover: a refusal may be needless by twice this."""
        return max((one.excess for one in self.covers), default=0.0)


def propose_marks(
    robot: Robot, accuracy: float = 0.02, shapes: Collection[str] = SHAPES, by: By = "bodies"
) -> Proposal:
    """Return marks that hold the robot's bodies, and a boundary for every pair worth checking.

    Left out are pairs on one link, on links that never move against each other, on neighbours (one degree of freedom
    between them), and pairs that are proven never to meet. If the user has given a home, it stays. Else a home is
    looked for, today's first, at which the fewest pairs touch, and `home_note` says if it is another one. Pairs that
    touch at home are left out too, for no region could hold it, and are counted apart: those that touch in every
    sample overlap by design, the others deserve a better home. Before that, bodies of such pairs are covered as finely
    as polygons can.

    Args:
        robot: The robot; marks and boundaries that it has already are kept and not proposed again.
        accuracy: [m], how far a mark may stick out of its body, where that can be reached.
        shapes: The shapes to cover, of ``"sphere"``, ``"box"``, ``"cylinder"``, ``"capsule"``.
        by: ``"bodies"``: by points, capsules, boxes and prisms, which fit; ``"spheres"``: by spheres alone, which are
            many, but compiled as a whole, and whose regions have curved edges.

    Returns:
        The proposal; `proposal.annotations.save(path)` writes the sidecar.

    Raises:
        UnknownNameError: If a shape is none of these, or `by` neither.
        DimensionError: If the accuracy is not positive.
        InputError: If the geometry of a body has a fault: all faults at once.
        UnsupportedError: If no configuration keeps all limits, or distances are too large to compute.
    """
    for shape in shapes:
        if shape not in SHAPES:
            raise UnknownNameError("shape", shape, SHAPES)
    if by not in ("bodies", "spheres"):
        raise UnknownNameError("cover", by, ("bodies", "spheres"))
    problems = Problems(robot.document.label)
    read = read_bodies(robot.document, problems)
    problems.raise_if_any()
    chosen = [body for body in read.bodies if body.shape in shapes]
    judge = _Judge(robot)
    proposal, touching = _proposal(judge, covers(chosen, accuracy, by), read)
    if touching and by == "bodies":
        sizes = [size for body in chosen if body.link in touching for size in body.size if size > 0.0]
        finest = min((accuracy, *(_FINEST * size for size in sizes)))
        again = covers([body for body in chosen if body.link in touching], finest)
        rest = covers([body for body in chosen if body.link not in touching], accuracy)
        order = {body: place for place, body in enumerate(chosen)}
        found = sorted((*rest, *again), key=lambda one: order[one.bodies[0]])
        proposal, _ = _proposal(judge, found, read)
    return proposal


def _proposal(judge: _Judge, found: Sequence[Cover], read: LinkBodies) -> tuple[Proposal, set[str]]:
    """Return the proposal with these covers, and the links of which some pair touches at home for its covers' sake."""
    robot = judge.robot
    names = set(robot.annotations.marks)
    held = [_known(robot, one, names) for one in found]
    taken = {body for one in held for body in one.bodies}
    uncovered = tuple(body for body in read.bodies if body not in taken)
    excess = {mark.name: one.excess for one in held for mark in one.marks}
    left_out: Counter[tuple[str, str, str]] = Counter()
    pairs = _moving_pairs(judge, [mark for one in held for mark in one.marks], left_out)
    _count_uncovered(judge, read.bodies, uncovered, left_out)
    contact = np.array([pair.contact for pair in pairs]).reshape(len(pairs), len(judge.Q))
    always = np.all(contact, axis=1)
    home = _choose_home(judge, np.sum(contact[~always], axis=0))
    kept = _kept(robot)
    watched = {frozenset((mark.a, mark.b)) for mark in robot.annotations.boundaries}
    named = {mark.name for mark in robot.annotations.boundaries}
    boundaries: list[BoundaryMark] = []
    touching: set[str] = set()
    for pair, touches, by_design in zip(pairs, contact, always, strict=True):
        a, b = pair.a, pair.b
        if not touches[home.chosen]:
            if frozenset((a.name, b.name)) not in watched:
                boundaries.append(BoundaryMark(_unused(f"{a.name}-{b.name}", named), a.name, b.name))
        else:
            reason = f"{_ALWAYS} {len(judge.Q)} sampled configurations" if by_design else AT_HOME
            left_out[a.link, b.link, reason] += 1
        if (touches[home.chosen] or touches[0]) and excess[a.name] + excess[b.name] > 0.0:
            touching |= {a.link, b.link}
    used = {name for boundary in boundaries for name in (boundary.a, boundary.b)} - set(robot.annotations.marks)
    marks = {mark.name: mark for pair in pairs for mark in (pair.a, pair.b) if mark.name in used}
    annotations = replace(
        kept,
        marks={**kept.marks, **marks},
        boundaries=(*kept.boundaries, *boundaries),
        home=kept.home if robot.annotations.home or not home.can_be_said else home_entries(robot, judge.Q[home.chosen]),
    )
    at_home = [pair for pair, by_design in zip(pairs, always, strict=True) if pair.contact[0] and not by_design]
    proposal = Proposal(
        annotations=annotations,
        covers=tuple(held),
        uncovered=uncovered,
        left_out=dict(left_out),
        home_note=_home_note(judge, home, at_home),
        touching={(pair.a.name, pair.b.name): pair.gap for pair in at_home},
        notes=read.notes,
    )
    stated = dict.fromkeys((*annotations.left_out, *left_out_marks(proposal)))
    return replace(proposal, annotations=replace(annotations, left_out=tuple(stated))), touching


@dataclass(frozen=True, eq=False)
class _Pair:
    """Two marks that may meet: in which candidates they are in contact (N,), and their gap [m] in the first."""

    a: Mark
    b: Mark
    contact: Flags
    gap: float


class _Judge:
    """Judges pairs of links and of marks of one robot, each once."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        drawn = draw(robot, _SAMPLES - 1, np.random.default_rng(0))
        self.Q: Array = np.vstack((robot.home, drawn))
        self._links: dict[tuple[str, str], str | None] = {}
        self._pairs: dict[tuple[Mark, Mark], _Pair | None] = {}

    def links_reason(self, link_a: str, link_b: str) -> str | None:
        """Return why no pair on two links is worth checking, or None."""
        if (link_a, link_b) not in self._links:
            self._links[link_a, link_b] = _links_reason(self.robot, link_a, link_b)
        return self._links[link_a, link_b]

    def pair(self, a: Mark, b: Mark) -> _Pair | None:
        """Return what is known of two marks, or None if they are proven never to meet."""
        if (a, b) not in self._pairs:
            self._pairs[a, b] = self._judged(a, b)
        return self._pairs[a, b]

    def _judged(self, a: Mark, b: Mark) -> _Pair | None:
        robot = self.robot
        with np.errstate(over="ignore", invalid="ignore"):
            path = relative_path(robot.tree, robot.coupling, a, b)
            radii = a.shape.radius + b.shape.radius
            distance = contact_distance(path, radii, robot.annotations.contact_tolerance)
            joints = len(robot.tree.path_between(a.link, b.link))
            rounding = FOLDING * UNIT_ROUNDOFF * (joints + 2) ** 2 * path.minimal.scale
            off = place_error(robot.tree, robot.coupling, robot.linear_limits, robot.closures, a, b)
            if (
                least_separation(path) > distance + off + rounding
            ):  # false where a number is not finite: that proves nothing
                return None
            found = separation.separations(path, self.Q)
        if not np.all(np.isfinite(found)):
            raise UnsupportedError(
                f"the distance of {a.name!r} and {b.name!r} is no finite number; are all lengths of the URDF in metres?"
            )
        return _Pair(a, b, found <= distance, float(found[0]) - radii)


def _moving_pairs(judge: _Judge, marks: Sequence[Mark], left_out: Counter[tuple[str, str, str]]) -> list[_Pair]:
    """Return the pairs that may meet; count the others by reason."""
    pairs: list[_Pair] = []
    for a, b in combinations(marks, 2):
        if a.link == b.link:
            continue
        reason = judge.links_reason(a.link, b.link)
        if reason is None:
            pair = judge.pair(a, b)
            if pair is not None:
                pairs.append(pair)
                continue
            reason = NEVER
        left_out[a.link, b.link, reason] += 1
    return pairs


def _count_uncovered(
    judge: _Judge, bodies: Sequence[Body], uncovered: Sequence[Body], left_out: Counter[tuple[str, str, str]]
) -> None:
    """Count the pairs of bodies that no boundary can speak of, as one of the two is not covered."""
    of_link: dict[str, list[Body]] = {}
    for body in bodies:
        of_link.setdefault(body.link, []).append(body)
    missing = set(uncovered)
    bare = {link: [body for body in found if body in missing] for link, found in of_link.items()}
    for link_a, link_b in combinations(of_link, 2):
        a, b = len(of_link[link_a]), len(of_link[link_b])
        pairs = a * b - (a - len(bare[link_a])) * (b - len(bare[link_b]))
        if not pairs:
            continue
        reason = judge.links_reason(link_a, link_b)
        if reason is None:
            named = [f"{body.name} ({body.shape})" for body in (*bare[link_a], *bare[link_b])]
            reason = f"not covered: {_listed(named)}"
        left_out[link_a, link_b, reason] += pairs


def _listed(words: Sequence[str]) -> str:
    more = f" and {len(words) - _NAMED} more" if len(words) > _NAMED else ""
    return ", ".join(words[:_NAMED]) + more


def _links_reason(robot: Robot, link_a: str, link_b: str) -> str | None:
    """Return why no pair on two links is worth checking, or None."""
    joints = robot.tree.path_between(link_a, link_b)
    if any(joint.type in ("floating", "planar") for joint in joints):
        return FREE_JOINT
    degrees = robot.tree.degrees_between(link_a, link_b, robot.coupling)
    return {0: RIGID, 1: NEIGHBOURS}.get(degrees)


def _known(robot: Robot, cover: Cover, names: set[str]) -> Cover:
    """Return a cover by marks that the robot has already, where it has them, the others under names not yet taken."""
    alike = {_unnamed(mark): mark for mark in robot.annotations.marks.values()}
    marks = [alike.get(_unnamed(mark)) or replace(mark, name=_unused(mark.name, names)) for mark in cover.marks]
    return replace(cover, marks=tuple(marks))


def _unnamed(mark: Mark) -> Mark:
    return replace(mark, name="", line=None)


def _unused(name: str, names: set[str]) -> str:
    """Return the name, or the name and a number, that is not taken; take it."""
    found, count = name, 1
    while found in names:
        count += 1
        found = f"{name}.{count}"
    names.add(found)
    return found


@dataclass(frozen=True)
class _Home:
    """Which candidate is home, which would be best, in how many candidates pairs touch, and if home can be written."""

    chosen: int
    best: int
    touching: Ints
    can_be_said: bool


def _choose_home(judge: _Judge, touching: Ints) -> _Home:
    """Choose today's home if the user has given it or no candidate is better; `touching` (N,) counts pairs."""
    robot = judge.robot
    inside = bool(within_limits(robot.linear_limits, robot.home[None], robot.guarded_limits)[0])
    best: int | None = None
    for index in np.argsort(touching, kind="stable").tolist():
        if inside and touching[index] >= touching[0]:
            best = 0
            break
        if index and can_be_home(robot, judge.Q[index]):
            best = index
            break
    chosen = 0 if best is None or robot.annotations.home else best
    can_be_said = chosen != 0 or (inside and can_be_home(robot, robot.home))
    return _Home(chosen, chosen if best is None else best, touching, can_be_said)


def _home_note(judge: _Judge, home: _Home, at_home: Sequence[_Pair]) -> str:
    robot = judge.robot
    inside = within_limits(robot.linear_limits, robot.home[None], robot.guarded_limits)[0]
    said = f"home ({configuration_text(robot, robot.home)})"
    faults = [] if inside else ["is outside the limits of a joint"]
    if at_home:
        pairs = _listed([f"{pair.a.name} and {pair.b.name} {_overlap(pair)}" for pair in at_home])
        faults.append(f"has {_pairs(len(at_home))} of marks in contact: {pairs}")
    if not faults:
        return ""
    note = f"The robot's {said} {' and '.join(faults)}."
    there = f"{configuration_text(robot, judge.Q[home.best])}, with {_pairs(int(home.touching[home.best]))} in contact"
    if home.chosen:
        return f"{note} The proposal replaces it by {there}."
    if home.best:
        return f"{note} The home that was given is kept, and these pairs are left out. Another home is {there}."
    return f"{note} No better home was found among {len(judge.Q)} configurations; these pairs are left out."


def _pairs(count: int) -> str:
    return "no pair" if count == 0 else "1 pair" if count == 1 else f"{count} pairs"


def _overlap(pair: _Pair) -> str:
    if pair.gap < 0.0:
        return f"overlap by {-1e3 * pair.gap:.4g} mm"
    return "touch" if pair.gap > 0.0 else "overlap"


def _kept(robot: Robot) -> Annotations:
    """Return what the robot's annotations say beside the URDF: what a sidecar that replaces today's must repeat."""
    inline = read_inline(robot.document.root, Problems(robot.document.label))
    said = {(_GROUPS.get(item.kind, item.kind), _key(item)) for item in inline}
    own = robot.annotations

    def rest(group: str, records: Sequence[Any], key: str = "name") -> tuple[Any, ...]:
        return tuple(replace(one, line=None) for one in records if (group, getattr(one, key)) not in said)

    return Annotations(
        contact_tolerance=own.contact_tolerance,
        home={} if any(item.kind == "home" for item in inline) else own.home,
        marks={mark.name: mark for mark in cast("tuple[Mark, ...]", rest("mark", [*own.marks.values()]))},
        boundaries=rest("boundary", own.boundaries),
        closures=rest("closure", own.closures),
        followers=rest("follower", own.followers, "joint"),
        limits=rest("limit", own.limits, "joint"),
        rules=rest("rule", own.rules),
        axes=rest("axis", own.axes),
        left_out=tuple(
            LeftOutMark(one.a, one.b, one.reason) for one in own.left_out if one.source != robot.document.label
        ),
        assumptions=tuple(text for text in own.assumptions if ("assumption", text) not in said),
    )


_GROUPS = dict.fromkeys(MARK_KINDS, "mark")


def _key(item: RawItem) -> str:
    keys = {"follower": "joint", "limit": "joint", "assumption": "text"}
    return str(item.fields.get(keys.get(item.kind, "name"), ""))


def left_out_marks(proposal: Proposal) -> tuple[LeftOutMark, ...]:
    """Return what the sidecar of a proposal states about pairs of links that it leaves out.

    Stated are pairs that can never meet, and pairs that overlap in every sample: by design. Not stated are neighbours
    and links that never move, which `robot.coverage` knows; nor pairs that touch at home only, or that are not covered:
    they stay open, for nobody looks at them and nothing says why nobody needs to.
    """
    annotations = proposal.annotations
    marks = annotations.marks
    watched = {frozenset((marks[one.a].link, marks[one.b].link)) for one in annotations.boundaries}
    stated: list[LeftOutMark] = []
    for (a, b, reason), count in sorted(proposal.left_out.items()):
        if reason == NEVER or reason.startswith(_ALWAYS):
            some = f"{count} pairs of marks: " if frozenset((a, b)) in watched else ""
            stated.append(LeftOutMark(a, b, some + reason))
    return tuple(stated)
