"""What a certificate says: a verdict, its reasons, its bounds; never a bare bool."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from pinbound.coverage import CoverageRecord
from pinbound.exceptions import DimensionError
from pinbound.typing import Array
from pinbound.values import Value

__all__ = [
    "BoxCertificate",
    "Budget",
    "Certificate",
    "Contact",
    "Finding",
    "OpenBox",
    "OpenPart",
    "Reason",
    "Verdict",
]


class Verdict(Enum):
    """The outcome of a proof.

    `CERTIFIED`: every clearance is positive and every limit kept, at every moment, rounding included. `VIOLATED`:
    there is a q, given, at which one is not. `UNDECIDED`: neither was shown; what is left is listed.
    `NOTHING_TO_CHECK`: there is no boundary, and limits alone were not asked for, so that nothing is known of contact.
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


@dataclass(frozen=True, slots=True)
class Budget:
    """How much work a certificate may take before it says UNDECIDED.

    Attributes:
        boxes: Parts of the motion (or boxes) times boundaries that may be bounded.
        seconds: Wall time; looked at between batches of a few thousand boxes.
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


class _NoTruth:
    """A verdict has three values, so that `if certificate:` would hide one."""

    __slots__ = ()

    def __bool__(self) -> bool:
        """Refuse.

        Raises:
            TypeError: Always.
        """
        raise TypeError("a certificate is neither true nor false; compare its verdict with pb.Verdict.CERTIFIED")


@dataclass(frozen=True, slots=True)
class Certificate(_NoTruth):
    """What was proven about a motion.

    Attributes:
        verdict: CERTIFIED, VIOLATED, UNDECIDED or NOTHING_TO_CHECK.
        coverage: What the boundaries that were checked watch of the robot, and what they do not.
        start: First time of the motion.
        end: Last time.
        boundaries: One finding a boundary.
        limits: One finding an end of a joint limit, followers' too; empty if they were left out.
        open_parts: What is undecided, in order of time, neighbours merged.
        notes: What the verdict does not say.
        boxes: How many parts times boundaries were bounded.
        seconds: Wall time.
    """

    verdict: Verdict
    coverage: CoverageRecord
    start: float
    end: float
    boundaries: tuple[Finding, ...]
    limits: tuple[Finding, ...]
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

    @property
    def tightest(self) -> Finding | None:
        """The boundary whose clearance was found smallest; None without boundaries."""
        return min(self.boundaries, key=lambda finding: finding.upper, default=None)

    @property
    def lower(self) -> float:
        """Proven lower bound of the smallest clearance over the whole motion [m]; inf without boundaries."""
        return min((finding.lower for finding in self.boundaries), default=np.inf)

    @property
    def upper(self) -> float:
        """Upper bound of the smallest clearance over the whole motion [m]; inf without boundaries."""
        return min((finding.upper for finding in self.boundaries), default=np.inf)

    @property
    def violations(self) -> tuple[Finding, ...]:
        """Boundaries and limits that are violated, in order of first contact."""
        found = [finding for finding in (*self.boundaries, *self.limits) if finding.contact is not None]
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


@dataclass(frozen=True, eq=False, slots=True)
class BoxCertificate(_NoTruth, Value):
    """What was proven about a box of configurations.

    Attributes:
        verdict: CERTIFIED, VIOLATED, UNDECIDED or NOTHING_TO_CHECK.
        coverage: What the boundaries that were checked watch of the robot, and what they do not.
        lower_corner: (n,).
        upper_corner: (n,).
        lower: Proven lower bound of the smallest clearance over the box [m].
        upper: Upper bound of it: the smallest clearance that was met.
        witness: (n,) a q of negative clearance or outside a limit; None unless VIOLATED.
        violated: Name of the boundary or limit that the witness violates.
        open_boxes: What is undecided.
        boxes: How many boxes times boundaries were bounded.
        seconds: Wall time.
        notes: What the verdict does not say.
    """

    verdict: Verdict
    coverage: CoverageRecord
    lower_corner: Array
    upper_corner: Array
    lower: float
    upper: float
    witness: Array | None
    violated: str | None
    open_boxes: tuple[OpenBox, ...]
    boxes: int
    seconds: float
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        """Return verdict, bounds and coverage."""
        span = f"[{1e3 * self.lower:.6g}, {1e3 * self.upper:.6g}] mm"
        violated = "" if self.violated is None else f", {self.violated} violated"
        return f"<BoxCertificate {self.verdict.value}: smallest clearance in {span}{violated}; {self.coverage}>"
