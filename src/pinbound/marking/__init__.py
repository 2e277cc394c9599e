"""Proposed marks: bodies covered, pairs worth checking, a home that is free."""

from pinbound.marking.propose import SHAPES, Proposal, left_out_marks, propose_marks

__all__ = ["SHAPES", "Proposal", "left_out_marks", "propose_marks"]
