"""Records of coverage: of a body, a link, a pair of links, and of a robot in one line."""

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
    """How boundaries cover a pair of links.

    `WATCHED`: it is proven that no body of the one link touches a body of the other while every boundary is free. A
    mesh is a surface: if several marks hold it, a body that is completely inside it is not detected
    (`Coverage.notes`).
    `IN_PART`: there are boundaries between the links, but they do not watch all pairs of their bodies.
    `LEFT_OUT`: no boundary is needed, or a file gives a reason why there is none. `UNWATCHED`: none of these.
    """

    WATCHED = "watched"
    IN_PART = "watched in part"
    LEFT_OUT = "left out"
    UNWATCHED = "not watched"


class Basis(Enum):
    """Why a pair of links that is not fully watched may be left out.

    `PROOF`: it is proven that the bodies never move relative to each other, or can never meet. `NEIGHBOURS`: one degree
    of freedom lies between the links; it is assumed, not proven, that its limits keep the bodies apart. `SAID`: a
    file gives a reason, which is not proven.
    """

    PROOF = "proven"
    NEIGHBOURS = "neighbours"
    SAID = "said"


@dataclass(frozen=True, slots=True)
class BodyCoverage:
    """A body of a link, and the marks that hold it.

    Attributes:
        link: The link of the body.
        index: Its index among the bodies of the link.
        shape: ``"sphere"``, ``"box"``, ``"cylinder"``, ``"capsule"`` or ``"mesh"``.
        held_by: Sets of names of marks whose union is proven to hold the body, one entry for each such set; empty if
            there is none.
        reason: Why no marks hold the body; empty if marks hold it.
    """

    link: str
    index: int
    shape: str
    held_by: tuple[tuple[str, ...], ...]
    reason: str

    @property
    def is_held(self) -> bool:
        """Whether marks are proven to hold the body."""
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
        status: How boundaries cover the pair.
        reason: Why the pair is left out, not watched, or watched in part; empty if it is watched.
        basis: Why the pair, or its unwatched part, may be left out; None if it is watched or open.
        boundaries: Names of the boundaries between the two links.
    """

    links: tuple[str, str]
    status: Status
    reason: str
    basis: Basis | None
    boundaries: tuple[str, ...]

    @property
    def is_open(self) -> bool:
        """Whether bodies of the two links may touch without a boundary in contact, and no reason is given."""
        return self.status is not Status.WATCHED and self.basis is None


@dataclass(frozen=True, slots=True)
class CoverageRecord:
    """The numbers of a coverage, as a certificate records them.

    Attributes:
        boundaries: Number of boundaries.
        pairs: Number of pairs of links that both have bodies.
        watched: Pairs of links that are watched.
        in_part: Pairs of links that are watched in part.
        proven: Pairs of links that are left out because they are proven never to move or never to meet.
        neighbours: Pairs of links that are left out because they are neighbours.
        said: Pairs of links that are left out because a file gives a reason.
        unwatched: Pairs of links that are not watched.
        bodies: Number of bodies.
        unheld: Bodies that no mark holds, on links with an open pair.
        is_complete: Whether there are bodies, and no pair of links is open.
        summary: These numbers in one line.

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
    """Return the counts, and one line that contains them."""
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
    """Return a note about these links' meshes that only several marks hold together; empty if there are none."""
    named = ", ".join(dict.fromkeys(links))
    if not named:
        return ""
    return (
        f"a mesh is a surface, and several marks together hold the mesh of: {named}. A body completely inside such a "
        "mesh, in a hollow between its marks, touches no triangle, and no boundary detects it. But every motion to "
        "such a place from outside passes through contact, which boundaries detect"
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
