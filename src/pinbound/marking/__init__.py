"""Proposed marks that hold the bodies, pairs that need a boundary, and a home that is free."""

from pinbound.marking.disabled import DisabledPair, disabled_pairs, find_srdf
from pinbound.marking.judge import Evidence
from pinbound.marking.propose import ALL_SHAPES, Proposal, left_out_marks, propose_marks

__all__ = [
    "ALL_SHAPES",
    "DisabledPair",
    "Evidence",
    "Proposal",
    "disabled_pairs",
    "find_srdf",
    "left_out_marks",
    "propose_marks",
]
