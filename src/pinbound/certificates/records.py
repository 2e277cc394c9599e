"""Records of certificates: a verdict with its bounds and reasons, never a bare bool."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cache
from typing import Any, overload

import numpy as np

from pinbound.checks import is_amount
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

    `CERTIFIED`: every signed clearance is positive and every limit is kept, at every moment, rounding included.
    `VIOLATED`: the record holds a q in contact or outside a limit. `UNDECIDED`: neither is proven; the record lists the
    open parts. `NOTHING_TO_CHECK`: there is no boundary, and a check of limits alone was not requested.

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
        boxes: The largest number of bounds to compute, one for each part of the motion (or box) and boundary.
        seconds: Wall time [s]; checked between batches of a few thousand boxes.

    Example:
        >>> import pinbound as pb
        >>> robot = pb.load("minervabot_v3")
        >>> pb.certify(robot, [robot.home, [0.0, 0.5, 0.5]], budget=Budget(boxes=10_000, seconds=1.0)).verdict.name
        'CERTIFIED'
    """

    boxes: int = 2_000_000
    seconds: float = 30.0

    def __post_init__(self) -> None:
        """Refuse a budget that is not a number: it would never be spent.

        Raises:
            DimensionError: If boxes or seconds are negative or not a number.
        """
        if not (is_amount(self.boxes) and is_amount(self.seconds)):
            raise DimensionError(f"the budget is {self}; give numbers, 0 or more")


@dataclass(frozen=True, eq=False, slots=True)
class Contact(Value):
    """The first moment at which a boundary is in contact, or a limit is violated.

    Attributes:
        before: Until this time (inclusive, unless the motion starts in violation) there is no violation, with proof.
        after: At this time there is a violation, at q.
        q: (n,) the configuration at `after`: a witness.
        clearance: Clearance there [m], or margin of the limit [rad or m]; negative.
    """

    before: float
    after: float
    q: Array
    clearance: float


@dataclass(frozen=True, eq=False, slots=True)
class Finding(Value):
    """The result for one boundary or one joint limit, over the whole motion.

    Attributes:
        name: Boundary, or joint and end, e.g. ``"q2 upper"``.
        verdict: The verdict for this boundary or limit alone.
        lower: Proven lower bound of its smallest clearance [m], or margin [rad or m].
        upper: Upper bound of the same, from `time`.
        time: The time of the upper bound.
        q: (n,) the configuration at `time`.
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
    """A sequence of findings, stored as arrays; a `Finding` is made when one is asked for.

    Attributes:
        names: Names of the boundaries or limits.
        codes: (m,) 0 for CERTIFIED, 1 for VIOLATED, 2 for UNDECIDED.
        lower: (m,) proven lower bounds.
        upper: (m,) upper bounds.
        times: (m,) the times of the upper bounds.
        Q: (m, n) the configurations at these times.
        contacts: First contacts, by index.

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
        """Make the arrays read-only."""
        for name in ("codes", "lower", "upper", "times", "Q"):
            object.__setattr__(self, name, read_only(getattr(self, name)))
        object.__setattr__(self, "contacts", FrozenDict(self.contacts))

    @classmethod
    def none(cls, n: int) -> Findings:
        """Return an empty sequence, for a robot of n coordinates."""
        return _no_findings(n)

    @classmethod
    def joined(cls, parts: Sequence[Findings], names: tuple[str, ...], order: Indices) -> Findings:
        """Return the rows `order` of several findings joined; `names` are the names in that order."""
        some = [part for part in parts if part.names]
        if len(some) == 1 and some[0].names == names:  # then `order` leaves each where it is
            return some[0]
        contacts, start = dict[int, Contact](), 0
        places = {int(row): place for place, row in enumerate(order)} if any(part.contacts for part in parts) else {}
        for part in parts:
            contacts |= {places[start + row]: one for row, one in part.contacts.items()}
            start += len(part.names)
        return cls(
            names,
            owned(np.concatenate([part.codes for part in parts]).take(order)),
            owned(np.concatenate([part.lower for part in parts]).take(order)),
            owned(np.concatenate([part.upper for part in parts]).take(order)),
            owned(np.concatenate([part.times for part in parts]).take(order)),
            owned(np.concatenate([part.Q for part in parts]).take(order, axis=0)),
            contacts,
        )

    @property
    def verdict(self) -> Verdict:
        """VIOLATED if one finding is, else UNDECIDED if one is, else CERTIFIED."""
        if not self.codes.any():
            return Verdict.CERTIFIED
        return next((one for one in (Verdict.VIOLATED, Verdict.UNDECIDED) if self.any(one)), Verdict.CERTIFIED)

    def any(self, verdict: Verdict) -> bool:
        """Return whether any finding has this verdict."""
        return bool(np.any(self.codes == _ORDER.index(verdict)))

    def named(self, verdict: Verdict) -> Iterable[str]:
        """Return the names of the findings with this verdict."""
        return (self.names[row] for row in np.flatnonzero(self.codes == _ORDER.index(verdict)).tolist())

    def __len__(self) -> int:
        """Return the number of findings."""
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
        start: Start time of the part.
        end: End time of the part.
        lower: Proven lower bound of the clearance on it [m, or rad for a limit].
        reason: Why it is undecided.
    """

    name: str
    start: float
    end: float
    lower: float
    reason: Reason


class NoTruth:
    """Refuses `bool(...)`: a verdict has more than two values, so `if certificate:` would hide one."""

    __slots__ = ()

    def __bool__(self) -> bool:
        """Refuse.

        Raises:
            TypeError: Always.
        """
        raise TypeError("a certificate is neither true nor false; compare its verdict with pb.Verdict.CERTIFIED")


@dataclass(frozen=True, slots=True)
class Certificate(NoTruth, Pictured):
    """The certificate of a motion.

    Attributes:
        verdict: CERTIFIED, VIOLATED, UNDECIDED or NOTHING_TO_CHECK.
        coverage: Which pairs of links the checked boundaries watch, and which they do not.
        start: First time of the motion [its own unit; for waypoints without times, the index].
        end: Last time [as `start`].
        boundaries: One finding for each boundary.
        limits: One finding for each end of a joint limit, also of mimic joints; empty if limits were not checked.
        open_parts: The undecided parts in order of time, neighbouring parts merged.
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
        """Return the verdict, the tightest boundary and the coverage."""
        found = self.tightest
        if found is None:
            said = f"no boundary, {len(self.limits)} ends of limits"
            return f"<Certificate {self.verdict.value}: {said}; {self.coverage}>"
        span = f"[{1e3 * found.lower:.6g}, {1e3 * found.upper:.6g}] mm"
        smallest = f"smallest clearance in {span}, {found.name} at t = {found.time:.6g}"
        return f"<Certificate {self.verdict.value}: {smallest}; {self.coverage}>"

    def plot(self, ax: Any = None) -> Any:
        """Draw the bounds of the smallest clearance of each boundary, the smallest first.

        Args:
            ax: Matplotlib axes to draw in; None: axes of a new figure, `ax.figure`.

        Returns:
            The axes.

        Raises:
            UnsupportedError: If matplotlib is not installed; the message says what to type.

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
        """The finding with the smallest clearance; None without boundaries."""
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
        """The first contact or violated limit of all, with its witness; None if nothing is violated.

        Until its `before`, every boundary and limit is proven free.
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
    """A box that was not decided: corners (n,), the boundary or limit, a lower bound, and the reason."""

    name: str
    lower_corner: Array
    upper_corner: Array
    lower: float
    reason: Reason


_VERDICTS = tuple(Verdict)


@dataclass(frozen=True, eq=False)
class Verdicts(NoTruth, Value, Sequence[Verdict]):
    """The certificates of N motions: a sequence of verdicts, with bounds and witnesses as arrays.

    Attributes:
        codes: (N,) index of each verdict in `tuple(Verdict)`.
        lower: (N,) proven lower bounds of the smallest signed clearance of each motion [m]; -inf where VIOLATED.
        upper: (N,) upper bounds of the same [m].
        witnesses: (N, n) a q of each VIOLATED motion that is in contact or outside a limit; NaN for other motions.
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
        """Return the number of motions with each verdict, and the coverage."""
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
        """Return the number of motions."""
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
