"""Records of certificates of boxes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import overload

import numpy as np

from pinbound.certificates.records import NoTruth, OpenBox, Reason, Verdict
from pinbound.coverage import CoverageRecord
from pinbound.typing import Array, Indices, Ints
from pinbound.values import Value, read_only

__all__ = ["BoxCertificate", "OpenBoxes"]

_REASONS = tuple(Reason)


@dataclass(frozen=True, eq=False)
class OpenBoxes(Value, Sequence[OpenBox]):
    """Boxes that were not decided, stored as arrays; an `OpenBox` is made when one is asked for.

    Attributes:
        names: Names of boundaries and limits.
        which: (v,) index of each box's boundary or limit in `names`.
        lower_corners: (v, n).
        upper_corners: (v, n).
        lower: (v,) lower bounds.
        codes: (v,) index of each reason in `tuple(Reason)`.
    """

    names: tuple[str, ...]
    which: Indices
    lower_corners: Array
    upper_corners: Array
    lower: Array
    codes: Ints

    def __post_init__(self) -> None:
        """Make the arrays read-only, and the names a tuple."""
        for name in ("which", "lower_corners", "upper_corners", "lower", "codes"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    @classmethod
    def of(cls, chunks: Sequence[tuple[tuple[str, ...], Indices, Array, Array, Array, Reason]], n: int) -> OpenBoxes:
        """Return boxes from chunks: names, indices among them, corners, bounds, and one reason."""
        starts = np.cumsum([0, *(len(chunk[0]) for chunk in chunks)]).tolist()
        nothing = np.zeros(0)
        return cls(
            tuple(name for chunk in chunks for name in chunk[0]),
            np.concatenate(
                [nothing.astype(np.intp), *(start + chunk[1] for start, chunk in zip(starts, chunks, strict=False))]
            ),
            np.concatenate([nothing.reshape(0, n), *(chunk[2] for chunk in chunks)]),
            np.concatenate([nothing.reshape(0, n), *(chunk[3] for chunk in chunks)]),
            np.concatenate([nothing, *(chunk[4] for chunk in chunks)]),
            np.concatenate([nothing, *(np.full(len(chunk[1]), _REASONS.index(chunk[5])) for chunk in chunks)]).astype(
                np.int64
            ),
        )

    def __len__(self) -> int:
        """Return the number of boxes."""
        return len(self.which)

    @overload
    def __getitem__(self, index: int) -> OpenBox: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[OpenBox, ...]: ...
    def __getitem__(self, index: int | slice) -> OpenBox | tuple[OpenBox, ...]:
        """Return one box, or several."""
        if isinstance(index, slice):
            return tuple(self[row] for row in range(*index.indices(len(self))))
        row = range(len(self))[index]
        name, reason = self.names[int(self.which[row])], _REASONS[int(self.codes[row])]
        return OpenBox(name, self.lower_corners[row], self.upper_corners[row], float(self.lower[row]), reason)


@dataclass(frozen=True, eq=False, slots=True)
class BoxCertificate(NoTruth, Value):
    """The certificate of a box of configurations.

    Attributes:
        verdict: CERTIFIED, VIOLATED, UNDECIDED or NOTHING_TO_CHECK.
        coverage: Which pairs of links the checked boundaries watch, and which they do not.
        lower_corner: (n,).
        upper_corner: (n,).
        lower: Proven lower bound of the smallest clearance over the box [m].
        upper: Upper bound of the same [m]: the smallest clearance that was computed.
        witness: (n,) a q of negative clearance or outside a limit; None unless VIOLATED.
        violated: Name of the boundary or limit that the witness violates.
        open_boxes: Boxes that are undecided.
        boxes: The number of bounds computed, one for each box and boundary.
        seconds: Wall time [s].
        notes: Sentences about what the verdict does not cover.

    Example:
        >>> import pinbound as pb
        >>> found = pb.certify_box(pb.load("minervabot_v3"), [-1.0, 0.1, 0.0], [1.0, 0.6, 0.3])
        >>> found.verdict.name, found.lower > 0.0, found.witness
        ('CERTIFIED', True, None)
    """

    verdict: Verdict
    coverage: CoverageRecord
    lower_corner: Array
    upper_corner: Array
    lower: float
    upper: float
    witness: Array | None
    violated: str | None
    open_boxes: OpenBoxes
    boxes: int
    seconds: float
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        """Return verdict, bounds and coverage."""
        span = f"[{1e3 * self.lower:.6g}, {1e3 * self.upper:.6g}] mm"
        violated = "" if self.violated is None else f", {self.violated} violated"
        return f"<BoxCertificate {self.verdict.value}: smallest clearance in {span}{violated}; {self.coverage}>"
