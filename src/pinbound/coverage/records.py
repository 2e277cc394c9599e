"""What coverage says of a body, a link, a pair of links, and of a robot in one line."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from enum import Enum

from pinbound.units import several

__all__ = [
    "Basis",
    "BodyCoverage",
    "CoverageRecord",
    "LinkCoverage",
    "PairCoverage",
    "Status",
    "hollow_note",
    "record_of",
]


class Status(Enum):
    """How a pair of links is looked after.

    `WATCHED`: as long as every boundary is clear, no body of the one link touches a body of the other; proven.
    A mesh is a surface: that a body is wholly inside it is not seen where several marks hold it (`Coverage.notes`).
    `IN_PART`: there are boundaries between the links, but they do not hold all bodies, or not all pairs of them.
    `LEFT_OUT`: no boundary is needed, or somebody said why there is none. `UNWATCHED`: neither.
    """

    WATCHED = "watched"
    IN_PART = "watched in part"
    LEFT_OUT = "left out"
    UNWATCHED = "not watched"


class Basis(Enum):
    """What a pair of links that is not watched as a whole rests on.

    `PROOF`: its bodies never move against each other, or can never meet. `NEIGHBOURS`: one degree of freedom lies
    between its links; that its limits keep the bodies apart is taken for granted, not proven. `SAID`: a file gives a
    reason, which is not proven.
    """

    PROOF = "proven"
    NEIGHBOURS = "neighbours"
    SAID = "said"


@dataclass(frozen=True, slots=True)
class BodyCoverage:
    """A body of a link, and the marks that hold it.

    Attributes:
        link: The link it is fixed to.
        index: Its place among the link's bodies.
        shape: ``"sphere"``, ``"box"``, ``"cylinder"``, ``"capsule"`` or ``"mesh"``.
        held_by: Names of marks whose union holds it, one entry a choice of marks; empty if none is proven to.
        reason: Why no marks hold it; empty if some do.
    """

    link: str
    index: int
    shape: str
    held_by: tuple[tuple[str, ...], ...]
    reason: str

    @property
    def is_held(self) -> bool:
        """Whether marks are proven to hold it."""
        return bool(self.held_by)


@dataclass(frozen=True, slots=True)
class LinkCoverage:
    """A link, its bodies and its marks.

    Attributes:
        name: The link.
        bodies: Its bodies; empty if it has none.
        marks: Names of its marks.
    """

    name: str
    bodies: tuple[BodyCoverage, ...]
    marks: tuple[str, ...]

    @property
    def held(self) -> tuple[BodyCoverage, ...]:
        """The bodies that marks are proven to hold."""
        return tuple(body for body in self.bodies if body.is_held)


@dataclass(frozen=True, slots=True)
class PairCoverage:
    """Two links that both have bodies.

    Attributes:
        links: Their names.
        status: How the pair is looked after.
        reason: Why it is left out, not watched, or watched in part only; empty if it is watched.
        basis: What leaving it out, or what is left of it, rests on; None if it is watched, or open.
        boundaries: Names of the boundaries between the two links.
    """

    links: tuple[str, str]
    status: Status
    reason: str
    basis: Basis | None
    boundaries: tuple[str, ...]

    @property
    def is_open(self) -> bool:
        """Whether bodies of the two links may touch unseen, and nothing says why nobody needs to look."""
        return self.status is not Status.WATCHED and self.basis is None


@dataclass(frozen=True, slots=True)
class CoverageRecord:
    """Coverage in numbers, as a certificate records it.

    Attributes:
        boundaries: Number of boundaries.
        pairs: Number of pairs of links that both have bodies.
        watched: Pairs of links that are watched.
        in_part: Pairs of links that are watched in part.
        proven: Pairs of links that are left out, for they are proven never to move or to meet.
        neighbours: Pairs of links that are left out, for they are neighbours.
        said: Pairs of links that are left out because a file says so.
        unwatched: Pairs of links that are not watched.
        bodies: Number of bodies.
        unheld: Bodies that no mark holds, of links of which some pair is open.
        is_complete: Whether there are bodies, and no pair of links is open.
        summary: All this in one line.

    Example:
        >>> import pinbound as pb
        >>> record = pb.load("minervabot_v3").coverage.record
        >>> record.boundaries, record.pairs, record.watched
        (10, 78, 0)
    """

    boundaries: int
    pairs: int
    watched: int
    in_part: int
    proven: int
    neighbours: int
    said: int
    unwatched: int
    bodies: int
    unheld: int
    is_complete: bool
    summary: str

    def __str__(self) -> str:
        """Return the line."""
        return self.summary


def record_of(links: Sequence[LinkCoverage], pairs: Sequence[PairCoverage], boundaries: int) -> CoverageRecord:
    """Return the counts, and the line that says them."""
    count = Counter(pair.status for pair in pairs)
    left_out = Counter(pair.basis for pair in pairs if pair.status is Status.LEFT_OUT)
    open_links = {name for pair in pairs if pair.is_open for name in pair.links}
    held = {link.name for link in links if link.held}
    only_points = all(not held & set(pair.links) for pair in pairs if pair.status is Status.IN_PART)
    record = CoverageRecord(
        boundaries=boundaries,
        pairs=len(pairs),
        watched=count[Status.WATCHED],
        in_part=count[Status.IN_PART],
        proven=left_out[Basis.PROOF],
        neighbours=left_out[Basis.NEIGHBOURS],
        said=left_out[Basis.SAID],
        unwatched=count[Status.UNWATCHED],
        bodies=sum(len(link.bodies) for link in links),
        unheld=sum(len(link.bodies) - len(link.held) for link in links if link.name in open_links),
        is_complete=any(link.bodies for link in links) and not open_links,
        summary="",
    )
    return replace(record, summary=_line(record, only_points))


def hollow_note(links: Iterable[str]) -> str:
    """Return what marks that hold a mesh together do not say of these links; empty if there are none."""
    named = ", ".join(dict.fromkeys(links))
    if not named:
        return ""
    return (
        f"a mesh is a surface, and several marks hold that of: {named}. A body that is wholly inside it, in a hollow "
        "between its marks, touches no triangle, and no boundary says so. No motion leads there from outside without "
        "contact, which boundaries see"
    )


def _line(record: CoverageRecord, only_points: bool) -> str:
    if not record.bodies:
        marks = f"pairs of marks only ({record.boundaries})" if record.boundaries else "nothing: there is no boundary"
        return f"watches {marks}; no link has a body"
    if not record.pairs:
        return "watches no pair of links: only one link has a body"
    words = [f"watches {record.watched} of {several(record.pairs, 'pair of links', 'pairs of links')}"]
    if record.in_part:
        words[0] += f", {record.in_part} {'at marked points only' if only_points else 'in part'}"
    groups = (
        (record.neighbours, "neighbour", "neighbours"),
        (record.proven, "that cannot touch", "that cannot touch"),
        (record.said, "as a file says", "as files say"),
    )
    left_out = [several(number, one, many) for number, one, many in groups if number]
    if left_out:
        words.append(f"left out: {', '.join(left_out)}")
    if record.unwatched:
        words.append(f"{record.unwatched} not watched")
    if record.unheld:
        words.append(several(record.unheld, "body is held by no mark", "bodies are held by no mark"))
    return "; ".join(words)
