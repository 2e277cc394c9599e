"""What a certificate says: a verdict, its reasons, its bounds; never a bare bool."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cache
from typing import Any, overload

import numpy as np

from pinbound.coverage import CoverageRecord
from pinbound.drawing import Pictured, drawn
from pinbound.exceptions import DimensionError
from pinbound.typing import Array, Flags, Indices, Ints
from pinbound.units import several
from pinbound.values import FrozenDict, Value, owned, read_only

__all__ = [
    "Budget",
    "Certificate",
    "Contact",
    "Finding",
    "Findings",
    "NoTruth",
    "OpenBox",
    "OpenPart",
    "Reason",
    "Verdict",
    "Verdicts",
]


class Verdict(Enum):
    """The outcome of a proof.

    `CERTIFIED`: every clearance is positive and every limit kept, at every moment, rounding included. `VIOLATED`:
    there is a q, given, at which one is not. `UNDECIDED`: neither was shown; what is left is listed.
    `NOTHING_TO_CHECK`: there is no boundary, and limits alone were not asked for, so that nothing is known of contact.

    Example:
        >>> Verdict("certified").name
        'CERTIFIED'
    """

    CERTIFIED = "certified"
    VIOLATED = "violated"
    UNDECIDED = "undecided"
    NOTHING_TO_CHECK = "nothing to check"


class Reason(Enum):
    """Why a part of a motion or a box is undecided."""

    ROUNDING = "closer to contact than rounding errors"
    RESOLUTION = "too short to be split further"
    BOXES = "the budget of boxes is spent"
    TIME = "the budget of time is spent"
    STOPPED = "stopped before the budget was spent"


@dataclass(frozen=True, slots=True)
class Budget:
    """How much work a certificate may take before it says UNDECIDED.

    Attributes:
        boxes: Parts of the motion (or boxes) times boundaries that may be bounded.
        seconds: Wall time [s]; looked at between batches of a few thousand boxes.

    Example:
        >>> import pinbound as pb
        >>> robot = pb.load("minervabot_v3")
        >>> pb.certify(robot, [robot.home, [0.0, 0.5, 0.5]], budget=Budget(boxes=10_000, seconds=1.0)).verdict.name
        'CERTIFIED'
    """

    boxes: int = 2_000_000
    seconds: float = 30.0

    def __post_init__(self) -> None:
        """Refuse what is no amount: a budget that is not a number would never be spent.

        Raises:
            DimensionError: If boxes or seconds are negative or not a number.
        """
        if not (self.boxes >= 0 and self.seconds >= 0.0):
            raise DimensionError(f"a budget of {self.boxes} boxes and {self.seconds} seconds; give numbers, 0 or more")


@dataclass(frozen=True, eq=False, slots=True)
class Contact(Value):
    """The first moment at which a boundary is touched, or a limit passed.

    Attributes:
        before: Up to here (inclusive, unless the motion starts in violation) it is proven not to happen.
        after: Here it has happened, at q.
        q: (n,) the configuration at `after`: a witness.
        clearance: Clearance there [m], or margin of the limit [rad or m]; negative.
    """

    before: float
    after: float
    q: Array
    clearance: float


@dataclass(frozen=True, eq=False, slots=True)
class Finding(Value):
    """What was found about one boundary or one joint limit, over the whole motion.

    Attributes:
        name: Boundary, or joint and end, e.g. ``"q2 upper"``.
        verdict: Of this boundary or limit alone.
        lower: Proven lower bound of its smallest clearance [m], or margin [rad or m].
        upper: Upper bound: it is at most this, at `time`.
        time: When it was found this small.
        q: (n,) the configuration then.
        contact: The first contact; None unless the verdict is VIOLATED.
    """

    name: str
    verdict: Verdict
    lower: float
    upper: float
    time: float
    q: Array
    contact: Contact | None = None


_ORDER = (Verdict.CERTIFIED, Verdict.VIOLATED, Verdict.UNDECIDED)


@dataclass(frozen=True, eq=False)
class Findings(Value, Sequence[Finding]):
    """Findings side by side, a `Finding` each when it is asked for; their numbers as arrays.

    Attributes:
        names: Of the boundaries or limits.
        codes: (m,) 0 for CERTIFIED, 1 for VIOLATED, 2 for UNDECIDED.
        lower: (m,) proven lower bounds.
        upper: (m,) upper bounds.
        times: (m,) when they were found this small.
        Q: (m, n) the configurations then.
        contacts: First contacts, by place.

    Example:
        >>> import pinbound as pb
        >>> found = pb.certify(pb.load("minervabot_v3"), np.radians([[0, 0, 0], [90, 30, 40]])).boundaries
        >>> len(found), found[0].name, found[-1].verdict.value, bool((found.lower > 0.0).all())
        (10, 'beta_1', 'certified', True)
    """

    names: tuple[str, ...]
    codes: Ints
    lower: Array
    upper: Array
    times: Array
    Q: Array
    contacts: Mapping[int, Contact]

    def __post_init__(self) -> None:
        """Freeze the arrays; names are a tuple of text as they are."""
        for name in ("codes", "lower", "upper", "times", "Q"):
            object.__setattr__(self, name, read_only(getattr(self, name)))
        object.__setattr__(self, "contacts", FrozenDict(self.contacts))

    @classmethod
    def none(cls, n: int) -> Findings:
        """Return no findings, of a robot of n coordinates."""
        return _no_findings(n)

    @classmethod
    def joined(cls, parts: Sequence[Findings], names: tuple[str, ...], order: Indices) -> Findings:
        """Return the rows `order` of findings one after the other; `names` are theirs in that order."""
        some = [part for part in parts if part.names]
        if len(some) == 1 and some[0].names == names:  # then `order` leaves each where it is
            return some[0]
        starts: list[int] = np.cumsum([0, *(len(part.names) for part in parts)]).tolist()
        contacts = {
            start + row: one for start, part in zip(starts, parts, strict=False) for row, one in part.contacts.items()
        }
        places = {int(row): place for place, row in enumerate(order)} if contacts else {}
        return cls(
            names,
            owned(np.concatenate([part.codes for part in parts])[order]),
            owned(np.concatenate([part.lower for part in parts])[order]),
            owned(np.concatenate([part.upper for part in parts])[order]),
            owned(np.concatenate([part.times for part in parts])[order]),
            owned(np.concatenate([part.Q for part in parts])[order]),
            {places[row]: contact for row, contact in contacts.items()},
        )

    @property
    def verdict(self) -> Verdict:
        """Of all of them: VIOLATED if one is, else UNDECIDED if one is, else CERTIFIED."""
        if not self.codes.any():
            return Verdict.CERTIFIED
        return next((one for one in (Verdict.VIOLATED, Verdict.UNDECIDED) if self.any(one)), Verdict.CERTIFIED)

    def any(self, verdict: Verdict) -> bool:
        """Return whether one of them has this verdict."""
        return bool(np.any(self.codes == _ORDER.index(verdict)))

    def named(self, verdict: Verdict) -> Iterable[str]:
        """Return the names of those that have this verdict."""
        return (self.names[row] for row in np.flatnonzero(self.codes == _ORDER.index(verdict)).tolist())

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self.names)

    @overload
    def __getitem__(self, index: int) -> Finding: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Finding, ...]: ...
    def __getitem__(self, index: int | slice) -> Finding | tuple[Finding, ...]:
        """Return one finding, or some."""
        if isinstance(index, slice):
            return tuple(self[row] for row in range(*index.indices(len(self))))
        row = range(len(self))[index]
        return Finding(
            self.names[row],
            _ORDER[int(self.codes[row])],
            float(self.lower[row]),
            float(self.upper[row]),
            float(self.times[row]),
            self.Q[row],
            self.contacts.get(row),
        )


@cache
def _no_findings(n: int) -> Findings:
    nothing = np.zeros(0)
    return Findings((), np.zeros(0, dtype=np.int64), nothing, nothing, nothing, np.zeros((0, n)), {})


@dataclass(frozen=True, slots=True)
class OpenPart:
    """A part of a motion that was not decided.

    Attributes:
        name: Boundary or limit.
        start: From this time.
        end: To this time.
        lower: Proven lower bound of the clearance on it [m, or rad for a limit].
        reason: Why nobody knows.
    """

    name: str
    start: float
    end: float
    lower: float
    reason: Reason


class NoTruth:
    """A verdict has three values, so that `if certificate:` would hide one."""

    __slots__ = ()

    def __bool__(self) -> bool:
        """Refuse.

        Raises:
            TypeError: Always.
        """
        raise TypeError("a certificate is neither true nor false; compare its verdict with pb.Verdict.CERTIFIED")


@dataclass(frozen=True, slots=True)
class Certificate(NoTruth, Pictured):
    """What was proven about a motion.

    Attributes:
        verdict: CERTIFIED, VIOLATED, UNDECIDED or NOTHING_TO_CHECK.
        coverage: Which pairs of links the checked boundaries watch, and which they do not.
        start: First time of the motion [its own unit; of waypoints without times their count].
        end: Last time [as `start`].
        boundaries: One finding a boundary.
        limits: One finding an end of a joint limit, followers' too; empty if they were left out.
        open_parts: What is undecided, in order of time, neighbours merged.
        notes: Sentences about what the verdict does not cover.
        boxes: The number of bounds computed, one for each part of a motion and boundary.
        seconds: Wall time [s].

    Example:
        >>> import pinbound as pb
        >>> robot = pb.load("minervabot_v3")
        >>> found = pb.certify(robot, [robot.home, [0.0, 0.5, 0.5]])
        >>> found.verdict.name, found.lower > 0.0, len(found.boundaries)
        ('CERTIFIED', True, 10)
    """

    verdict: Verdict
    coverage: CoverageRecord
    start: float
    end: float
    boundaries: Findings
    limits: Findings
    open_parts: tuple[OpenPart, ...]
    notes: tuple[str, ...]
    boxes: int
    seconds: float

    def __repr__(self) -> str:
        """Return verdict, tightest boundary and coverage."""
        found = self.tightest
        if found is None:
            return (
                f"<Certificate {self.verdict.value}: no boundary, {len(self.limits)} ends of limits; {self.coverage}>"
            )
        span = f"[{1e3 * found.lower:.6g}, {1e3 * found.upper:.6g}] mm"
        smallest = f"smallest clearance in {span}, {found.name} at t = {found.time:.6g}"
        return f"<Certificate {self.verdict.value}: {smallest}; {self.coverage}>"

    def plot(self, ax: Any = None) -> Any:
        """Draw between which bounds the smallest clearance of each boundary lies, the least first.

        Args:
            ax: Matplotlib axes to draw in; None: those of a new figure, `ax.figure`.

        Returns:
            The axes.

        Raises:
            UnsupportedError: If matplotlib is not installed; it says what to type.

        Example:
            >>> import pinbound as pb
            >>> robot = pb.load("minervabot_v3")
            >>> ax = pb.certify(robot, [robot.home, [0.0, 0.5, 0.5]]).plot()
            >>> ax.get_yticklabels()[0].get_text()
            'beta_9'
        """
        return drawn("motion_figure.certificate_axes", self, ax)

    @property
    def tightest(self) -> Finding | None:
        """The boundary whose clearance was found smallest; None without boundaries."""
        return self.boundaries[int(np.argmin(self.boundaries.upper))] if self.boundaries else None

    @property
    def lower(self) -> float:
        """Proven lower bound of the smallest clearance over the whole motion [m]; inf without boundaries."""
        return float(self.boundaries.lower.min(initial=np.inf))

    @property
    def upper(self) -> float:
        """Upper bound of the smallest clearance over the whole motion [m]; inf without boundaries."""
        return float(self.boundaries.upper.min(initial=np.inf))

    @property
    def violations(self) -> tuple[Finding, ...]:
        """Boundaries and limits that are violated, in order of first contact."""
        found = [part[row] for part in (self.boundaries, self.limits) for row in sorted(part.contacts)]
        return tuple(sorted(found, key=lambda finding: finding.contact.after if finding.contact else np.inf))

    @property
    def first_contact(self) -> Contact | None:
        """The first contact or passed limit of all, with its witness; None if nothing is violated.

        Its `before` is the earliest moment at which anything, of any boundary, is not proven clear.
        """
        violations = self.violations
        if not violations or violations[0].contact is None:
            return None
        first = violations[0].contact
        others = [f.contact.before for f in violations if f.contact]
        others += [part.start for part in self.open_parts]
        return Contact(min(first.after, *others), first.after, first.q, first.clearance)


@dataclass(frozen=True, eq=False, slots=True)
class OpenBox(Value):
    """A box that was not decided: corners (n,), the boundary or limit, a lower bound, and why."""

    name: str
    lower_corner: Array
    upper_corner: Array
    lower: float
    reason: Reason


_VERDICTS = tuple(Verdict)


@dataclass(frozen=True, eq=False)
class Verdicts(NoTruth, Value, Sequence[Verdict]):
    """What was proven about N motions: a sequence of verdicts, and their numbers as arrays.

    Attributes:
        codes: (N,) place of each verdict in `tuple(Verdict)`.
        lower: (N,) proven lower bounds of the smallest signed clearance of each motion [m]; -inf where VIOLATED.
        upper: (N,) it is at most this [m].
        witnesses: (N, n) of each VIOLATED motion a q of it that is in contact, or outside a limit; NaN for others.
        coverage: Which pairs of links the checked boundaries watch, and which they do not.
        notes: Sentences about what the verdicts do not cover.
        boxes: The number of bounds computed, one for each part of a motion and boundary.
        seconds: Wall time [s].

    Example:
        >>> import pinbound as pb
        >>> robot = pb.load("minervabot_v3")
        >>> found = pb.certify_many(robot, [robot.home], [[0.0, 0.0, 1.0]])
        >>> found[0].name, found.witnesses.shape
        ('VIOLATED', (1, 3))
    """

    codes: Ints
    lower: Array
    upper: Array
    witnesses: Array
    coverage: CoverageRecord
    notes: tuple[str, ...]
    boxes: int
    seconds: float

    def __repr__(self) -> str:
        """Return how many motions have each verdict, and coverage."""
        counts = [(verdict, int(np.sum(self.codes == place))) for place, verdict in enumerate(_VERDICTS)]
        said = ", ".join(f"{count} {verdict.value}" for verdict, count in counts if count) or "no motion"
        return f"<Verdicts of {several(len(self), 'motion')}: {said}; {self.coverage}>"

    def are(self, verdict: Verdict) -> Flags:
        """Return which motions (N,) have a verdict.

        Example:
            >>> import pinbound as pb
            >>> robot = pb.load("minervabot_v3")
            >>> pb.certify_many(robot, np.zeros((1, 3)), np.full((1, 3), 0.1)).are(pb.Verdict.CERTIFIED).tolist()
            [True]
        """
        found: Flags = self.codes == _VERDICTS.index(verdict)
        return found

    def __len__(self) -> int:
        """Return how many motions there are."""
        return len(self.codes)

    @overload
    def __getitem__(self, index: int) -> Verdict: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Verdict, ...]: ...
    def __getitem__(self, index: int | slice) -> Verdict | tuple[Verdict, ...]:
        """Return the verdict of one motion, or of some."""
        if isinstance(index, slice):
            return tuple(self[row] for row in range(*index.indices(len(self))))
        return _VERDICTS[int(self.codes[index])]
